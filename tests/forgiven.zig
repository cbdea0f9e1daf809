//! glTF files that break the rules and can mean but one thing: each is read, with one warning for
//! each kind of fault, and refused by name when that is asked for.
//!
//! In: the document of malformed.zig, changed in one or more places. Out: the scene that the
//! unchanged one gives, the warning, and the error line of a strict reader.

const std = @import("std");
const raylane = @import("raylane");
const malformed = @import("malformed.zig");
const texts = @import("gltf_text.zig");
const Diagnostic = raylane.diagnostic.Diagnostic;
const Scene = raylane.scene.Scene;
const parse = raylane.parse;
const testing = std.testing;
const gpa = testing.allocator;
const io = testing.io;

const Change = texts.Replacement;

/// Changes, the warning of a reader that forgives, and how the line of one that does not begins;
/// the same where it is empty.
const Case = struct { changes: []const Change, warning: []const u8, refusal: []const u8 = "" };

fn change(changes: []const Change) ![]u8 {
    return texts.make(malformed.document, &malformed.makeBuffer(), changes);
}

fn read(bytes: []const u8, settings: raylane.settings.Load, said: *Diagnostic) parse.Error!Scene {
    return parse.parseBytes(gpa, io, bytes, .cwd(), settings, said);
}

fn expectWarning(said: *const Diagnostic, expected: []const u8) !void {
    for (said.warnings[0..said.warning_count]) |*warning| {
        if (std.mem.eql(u8, warning.text(), expected)) return;
    }
    std.debug.print("not said: {s}\n", .{expected});
    return error.TestUnexpectedResult;
}

/// A file with the two triangles of the document is read with one warning; strictly it is not.
fn expectForgiven(bytes: []const u8, warning: []const u8, refusal: []const u8) !void {
    var said: Diagnostic = .{};
    errdefer {
        std.debug.print("error: {s}\n", .{said.message.text()});
        for (said.warnings[0..said.warning_count]) |*one| {
            std.debug.print("warning: {s}\n", .{one.text()});
        }
    }
    {
        var scene = try read(bytes, .{}, &said);
        defer scene.deinit();
        scene.check();
        try testing.expectEqual(2, scene.triangleCount());
        try testing.expectEqual(1, scene.cameras.len);
    }
    try expectWarning(&said, warning);
    try testing.expectEqual(1, said.warning_count);

    var strict: Diagnostic = .{};
    try testing.expectError(error.InvalidInput, read(bytes, .{ .strict = true }, &strict));
    errdefer std.debug.print("strictly: {s}\n", .{strict.message.text()});
    const line = if (refusal.len > 0) refusal else warning;
    try testing.expect(std.mem.startsWith(u8, strict.message.text(), line));
    try testing.expectEqual(0, strict.warning_count);
}

fn expectAll(cases: []const Case) !void {
    for (cases) |case| {
        errdefer for (case.changes) |one| std.debug.print("{s} -> {s}\n", .{ one[0], one[1] });
        const bytes = try change(case.changes);
        defer gpa.free(bytes);
        try expectForgiven(bytes, case.warning, case.refusal);
    }
}

/// The last letter's second byte is a backslash.
const mesh_name: Change = .{ "[{\"weights\":[0]", "[{\"name\":\"\xb2\xe2\x95\\\",\"weights\":[0]" };

test "the grammar of JSON" {
    const not_utf8 = "strings are not UTF-8, their other bytes shown as \\xNN";
    const refused = "the JSON text is not UTF-8";
    try expectAll(&.{
        .{
            .changes = &.{.{ "\"a\\u00e9\"", "\"caf\xe9\"" }},
            .warning = not_utf8,
            .refusal = refused,
        },
        .{
            .changes = &.{.{ "\"scene\":0", "\"extras\":{\"\xfc\":[\"\xfc\"]},\"scene\":0" }},
            .warning = not_utf8 ++ " (and 1 more)",
            .refusal = refused,
        },
        .{
            .changes = &.{.{ "{\"version\"", "{\"generator\":\"\xfc\",\"version\"" }},
            .warning = not_utf8,
            .refusal = refused,
        },
        .{
            .changes = &.{.{ "\"scene\":0", "\"scene\":0 // the first\n" }},
            .warning = "the JSON text has comments, ignored",
            .refusal = "JSON line 6, byte ",
        },
        .{
            .changes = &.{.{ "[0,3]", "[0,3,]" }},
            .warning = "a comma stands before a closing bracket, ignored",
            .refusal = "JSON line 7, byte ",
        },
        .{
            .changes = &.{.{ "\"a\\u00e9\"", "\"a\tb\"" }},
            .warning = "strings have control characters, taken as spaces",
            .refusal = "JSON line ",
        },
        .{
            .changes = &.{.{ "\"a\\u00e9\"", "\"a\\q\"" }},
            .warning = "strings have backslashes that escape nothing, taken for themselves",
            .refusal = "JSON line ",
        },
    });
    const whole = try change(&.{});
    defer gpa.free(whole);
    inline for (.{
        .{ "\xef\xbb\xbf", "", "the JSON text begins with a byte order mark, ignored", "" },
        .{ "", "\x00\x00\x00\x00", "the JSON text ends in zero bytes, ignored", "JSON line " },
        .{ "", "\n/* made by hand */\n", "the JSON text has comments, ignored", "JSON line " },
    }) |around| {
        const bytes = try std.mem.concat(gpa, u8, &.{ around[0], whole, around[1] });
        defer gpa.free(bytes);
        try expectForgiven(bytes, around[2], around[3]);
    }
}

test "names that are not UTF-8 are shown with their bytes" {
    const bytes = try change(&.{ .{ "\"a\\u00e9\"", "\"caf\xe9\"" }, mesh_name });
    defer gpa.free(bytes);
    var said: Diagnostic = .{};
    var scene = try read(bytes, .{}, &said);
    defer scene.deinit();
    try testing.expectEqualStrings("caf\\xE9", scene.cameras[0].name);
    try testing.expectEqual(2, said.warning_count);
}

test "what nobody looks at" {
    try expectAll(&.{
        .{
            .changes = &.{.{ "\"count\":6", "\"count\":6,\"min\":[null],\"max\":[1e400]" }},
            .warning = "accessors[3].min[0]: a number is expected; left out (and 1 more)",
            .refusal = "accessors[3].min[0]: a number is expected",
        },
        .{
            .changes = &.{.{ "\"skin\":0", "\"skin\":0,\"camera\":null,\"extras\":null" }},
            .warning = "nodes[1].camera: a whole number is expected; left out",
            .refusal = "nodes[1].camera: a whole number is expected",
        },
        .{
            .changes = &.{.{ "\"name\":\"a\\u00e9\"", "\"name\":[7]" }},
            .warning = "cameras[0].name: a string is expected; left out",
            .refusal = "cameras[0].name: a string is expected",
        },
        .{
            .changes = &.{.{ "\"name\":\"a\\u00e9\"", "\"name\":\"a\",\"name\":\"b\"" }},
            .warning = "cameras[0].name: stands twice, the first one counts",
            .refusal = "cameras[0].name: stands twice",
        },
        .{
            .changes = &.{.{ "\"zfar\":100", "\"zfar\":1e39" }},
            .warning = "cameras[0].perspective.zfar: 1e39 is out of range; left out",
            .refusal = "cameras[0].perspective.zfar: 1e39 is out of range",
        },
        .{
            .changes = &.{.{ "\"scene\":0,", "\"scene\":0,\"textures\":{\"source\":[]}," }},
            .warning = "textures: a list is expected; left out",
            .refusal = "textures: a list is expected",
        },
    });
}

const lens = "\"orthographic\":{\"xmag\":1,\"ymag\":1,\"znear\":0,\"zfar\":1}";
const unneeded = "; nothing drawn needs it";

/// What is added behind a part of the document, and the fault.
const Addition = struct { behind: []const u8, added: []const u8, fault: []const u8 };

test "what nothing drawn needs" {
    const last_accessor = "\"type\":\"MAT4\"}";
    const last_view = "\"byteOffset\":188,\"byteLength\":128}";
    const last_node = "0,0,0,1]}";
    for ([_]Addition{
        .{
            .behind = last_accessor,
            .added = ",{\"componentType\":5126,\"count\":0,\"type\":\"VEC3\"}",
            .fault = "accessor 9: count is 0",
        },
        .{
            .behind = last_accessor,
            .added = ",{\"bufferView\":0,\"componentType\":5126,\"count\":9,\"type\":\"VEC3\"}",
            .fault = "accessor 9: 60 bytes past its buffer view 0",
        },
        .{
            .behind = last_accessor,
            .added = ",{\"bufferView\":77,\"componentType\":5126,\"count\":9,\"type\":\"VEC3\"}",
            .fault = "accessors[9].bufferView: 77 of 9",
        },
        .{
            .behind = last_accessor,
            .added = ",{\"bufferView\":0,\"componentType\":1,\"count\":1,\"type\":\"VEC3\"}",
            .fault = "accessor 9: unknown componentType",
        },
        .{
            .behind = last_accessor,
            .added = ",{}",
            .fault = "accessors[9]: 'componentType' is missing",
        },
        .{
            .behind = last_accessor,
            .added = ",[{}]",
            .fault = "accessors[9]: an object is expected",
        },
        .{
            .behind = last_view,
            .added = ",{\"buffer\":0,\"byteLength\":0}",
            .fault = "buffer view 9: byteLength is 0",
        },
        .{
            .behind = last_view,
            .added = ",{\"buffer\":0,\"byteOffset\":300,\"byteLength\":40}",
            .fault = "buffer view 9: 24 bytes past its buffer 0",
        },
        .{
            .behind = last_view,
            .added = ",{\"buffer\":1,\"byteLength\":4}",
            .fault = "bufferViews[9].buffer: 1 of 1",
        },
        .{
            .behind = "\"scene\":0,",
            .added = "\"textures\":[{\"source\":4}],",
            .fault = "textures[0].source: 4 of 0",
        },
        .{
            .behind = "\"znear\":0.1,\"zfar\":100}}",
            .added = ",{\"perspective\":{\"yfov\":1}," ++ lens ++ "}",
            .fault = "cameras[1].orthographic: stands beside 'perspective'",
        },
        .{
            .behind = "\"scene\":0,",
            .added = "\"images\":[{\"bufferView\":-1}],",
            .fault = "images[0].bufferView: -1 is not a whole number from 0 to 2^53 - 1",
        },
        .{
            .behind = "\"skins\":[{\"joints\":[3,0],\"inverseBindMatrices\":8}",
            .added = ",{\"joints\":[99]}",
            .fault = "skins[1].joints[0]: 99 of 4",
        },
        .{
            .behind = "\"scenes\":[{\"nodes\":[0,3]}",
            .added = ",{\"nodes\":[8]}",
            .fault = "scenes[1].nodes[0]: 8 of 4",
        },
        .{
            .behind = "\"scenes\":[{\"nodes\":[0,3]}",
            .added = ",{\"nodes\":[2]}",
            .fault = "scenes[1].nodes: 2 is a root and a child at once",
        },
        .{
            .behind = last_node,
            .added = ",{\"mesh\":5}",
            .fault = "nodes[4].mesh: 5 of 1",
        },
        .{
            .behind = last_node,
            .added = ",{\"children\":[2]}",
            .fault = "nodes[4].children[0]: 2 has two parents",
        },
        .{
            .behind = "\"targets\":[{\"POSITION\":4}]}]}",
            .added = ",{\"primitives\":[{\"attributes\":{\"POSITION\":2147483648}}]}",
            .fault = "meshes[1].primitives[0].attributes.POSITION: 2147483648 names nothing, " ++
                "lists have 4194304 elements at most",
        },
    }) |addition| {
        errdefer std.debug.print("{s}\n", .{addition.added});
        const new = try std.mem.concat(gpa, u8, &.{ addition.behind, addition.added });
        defer gpa.free(new);
        const warning = try std.mem.concat(gpa, u8, &.{ addition.fault, unneeded });
        defer gpa.free(warning);
        const bytes = try change(&.{.{ addition.behind, new }});
        defer gpa.free(bytes);
        const is_family = std.mem.find(u8, addition.fault, "a root and a child") != null;
        const refusal = if (is_family) "node 2 is a root and a child at once" else addition.fault;
        try expectForgiven(bytes, warning, refusal);
    }
}

test "what is drawn is needed, and so is what that is made of" {
    const last_node = "0,0,0,1]}";
    const is_shown: Change = .{ "[0,3]", "[0,3,4]" };
    for ([_]struct { []const Change, []const u8 }{
        .{
            &.{ .{ last_node, last_node ++ ",{\"children\":[2]}" }, is_shown },
            "nodes[4].children[0]: 2 has two parents",
        },
        .{
            &.{ .{ last_node, last_node ++ ",{\"mesh\":5}" }, is_shown },
            "nodes[4].mesh: 5 of 1",
        },
        .{
            &.{.{ "\"skins\":", "\"skins\":{},\"unread\":" }},
            "nodes[1].skin: 0 of 0",
        },
        .{
            &.{.{ "\"perspective\":", lens ++ ",\"perspective\":" }},
            "cameras[0].perspective: stands beside 'orthographic'",
        },
    }) |case| {
        const bytes = try change(case[0]);
        defer gpa.free(bytes);
        var said: Diagnostic = .{};
        try testing.expectError(error.InvalidInput, read(bytes, .{}, &said));
        try testing.expectEqualStrings(case[1], said.message.text());
    }
}

test "the first of several faults is the error line of a strict reader" {
    const text = try change(&.{});
    defer gpa.free(text);
    const lost = ",{\"byteLength\":4,\"uri\":\"lost.bin\"}]}";
    const parts = [_][]const u8{ "\xef\xbb\xbf", text[0 .. text.len - "]}".len], lost };
    const bytes = try std.mem.concat(gpa, u8, &parts);
    defer gpa.free(bytes);
    var said: Diagnostic = .{};
    try testing.expectError(error.InvalidInput, read(bytes, .{ .strict = true }, &said));
    const mark = "the JSON text begins with a byte order mark, ignored";
    try testing.expectEqualStrings(mark, said.message.text());
}

test "a broken animation is left out" {
    const channel = "{\"sampler\":0,\"target\":{\"node\":0,\"path\":\"scale\"}}";
    for ([_][2][]const u8{
        .{
            "[{\"channels\":[{}]}]",
            "animations[0].channels[0]: 'sampler' is missing; left out",
        },
        .{
            "[{\"samplers\":[],\"channels\":[" ++ channel ++ "]}]",
            "animation 0, channel 0: there is no sampler 0, left out",
        },
        .{
            "[{\"samplers\":[{\"input\":70,\"output\":0}]}]",
            "animations[0].samplers[0].input: 70 of 9; left out",
        },
        .{ "[7]", "animations[0]: an object is expected; nothing drawn needs it" },
        .{ "{}", "animations: a list is expected; left out" },
    }) |case| {
        const new = try std.mem.concat(gpa, u8, &.{ "\"scene\":0,\"animations\":", case[0] });
        defer gpa.free(new);
        const bytes = try change(&.{.{ "\"scene\":0", new }});
        defer gpa.free(bytes);
        var said: Diagnostic = .{};
        var scene = try read(bytes, .{}, &said);
        defer scene.deinit();
        try testing.expectEqual(2, scene.triangleCount());
        try expectWarning(&said, case[1]);
        var strict: Diagnostic = .{};
        try testing.expectError(error.InvalidInput, read(bytes, .{ .strict = true }, &strict));
    }
}

test "nodes that are named once too often" {
    try expectAll(&.{
        .{
            .changes = &.{.{ "[0,3]", "[1,2,0,3]" }},
            .warning = "scenes[0].nodes: 1 is a child of another node there, listed once too often",
            .refusal = "node 1 is a root and a child at once",
        },
        .{
            .changes = &.{.{ "\"children\":[1,2]", "\"children\":[1,2,1]" }},
            .warning = "nodes[0].children: 1 stands twice, counted once",
            .refusal = "nodes[0].children[2]: 1 has two parents",
        },
        .{
            .changes = &.{.{ "[0,3]", "[0,3,0,3]" }},
            .warning = "scene 0: lists node 3 twice, counted once (and 1 more)",
            .refusal = "scene 0: lists node 3 twice, counted once",
        },
    });
}

test "primitives and attributes without elements" {
    const empty = ",{\"componentType\":5126,\"count\":0,\"type\":\"VEC3\"}";
    const more: Change = .{ "\"type\":\"MAT4\"}", "\"type\":\"MAT4\"}" ++ empty };
    try expectAll(&.{
        .{
            .changes = &.{ more, .{
                "\"targets\":[{\"POSITION\":4}]}",
                "\"targets\":[{\"POSITION\":4}]},{\"attributes\":{\"POSITION\":9}," ++
                    "\"targets\":[{}]}",
            } },
            .warning = "mesh 0, primitive 1: its vertices or indices are empty, not drawn",
        },
        .{
            .changes = &.{ more, .{
                "\"targets\":[{\"POSITION\":4}]}",
                "\"targets\":[{\"POSITION\":4}]},{\"attributes\":{\"POSITION\":0},\"indices\":9," ++
                    "\"targets\":[{}]}",
            } },
            .warning = "mesh 0, primitive 1: its vertices or indices are empty, not drawn",
        },
        .{
            .changes = &.{.{
                "\"targets\":[{\"POSITION\":4}]}",
                "\"targets\":[{\"POSITION\":4}]},{\"targets\":[{}]}",
            }},
            .warning = "mesh 0, primitive 1: without POSITION, not drawn",
        },
        .{
            .changes = &.{
                .{ "\"skin\":0,\"weights\":[0]", "\"skin\":0" },
                .{ ",\n\"targets\":[{\"POSITION\":4}]", "" },
            },
            .warning = "mesh 0: 1 weights for 0 morph targets",
        },
        .{
            .changes = &.{ more, .{ "\"NORMAL\":1", "\"NORMAL\":9" } },
            .warning = "mesh 0, primitive 0: 'NORMAL' is empty, left out",
        },
    });
}

test "views of indices with a stride" {
    for ([_]Change{
        .{ "\"byteOffset\":96,\"byteLength\":12", "\"byteStride\":2," },
        .{ "\"byteOffset\":96,\"byteLength\":12", "\"byteStride\":4," },
        .{ "\"byteOffset\":96,\"byteLength\":12", "\"byteStride\":12," },
    }) |one| {
        const new = try std.mem.concat(gpa, u8, &.{ one[1], one[0] });
        defer gpa.free(new);
        const bytes = try change(&.{.{ one[0], new }});
        defer gpa.free(bytes);
        const warning = "buffer view 2: has a byteStride, which views of indices have not";
        try expectForgiven(bytes, warning, "");
        var said: Diagnostic = .{};
        var scene = try read(bytes, .{}, &said);
        defer scene.deinit();
        try testing.expectEqual([3]u32{ 0, 2, 3 }, scene.meshes[0].triangles[1]);
    }
}

/// The document with other bytes in its buffer, as GLB. The caller frees it.
fn withBytes(offset: usize, bytes: []const u8) ![]u8 {
    var buffer = malformed.makeBuffer();
    @memcpy(buffer[offset..][0..bytes.len], bytes);
    return malformed.makeBinary(&buffer);
}

test "numbers that are not finite" {
    const nan = "\x00\x00\xc0\x7f";
    const glb = try withBytes(48, nan ++ nan ++ nan ++ nan);
    defer gpa.free(glb);
    try expectForgiven(glb, "accessor 1: 2 of 4 normals are not finite, left out", "");
    var said: Diagnostic = .{};
    var scene = try read(glb, .{}, &said);
    defer scene.deinit();
    const normals = scene.meshes[0].normals.?;
    try testing.expectEqual([4][3]f32{
        @splat(0), @splat(0), .{ 0, 0, 1 }, .{ 0, 0, 1 },
    }, normals[0..4].*);
}

test "weights and colours that are not finite" {
    const nan = "\x00\x00\xc0\x7f";
    const changes = [_]Change{
        .{ ",\"inverseBindMatrices\":8", "" },
        .{ "{\"componentType\":5126,\"count\":4,\"type\":\"VEC4\"}", "{\"bufferView\":8," ++
            "\"componentType\":5126,\"count\":4,\"type\":\"VEC4\"}" },
        .{ "\"COLOR_0\":2", "\"COLOR_0\":6" },
    };
    var buffer = malformed.makeBuffer();
    @memcpy(buffer[208..212], nan); // The second vertex; the matrices' diagonals are 1.
    const text = try texts.make(malformed.document, &buffer, &changes);
    defer gpa.free(text);
    var said: Diagnostic = .{};
    var scene = try read(text, .{}, &said);
    defer scene.deinit();
    const mesh = &scene.meshes[0];
    try testing.expectEqual([4]f32{ 1, 0, 0, 0 }, mesh.colors.?[0]);
    try testing.expectEqual([4]f32{ 1, 1, 1, 1 }, mesh.colors.?[1]);
    // What has no weight hangs on its first joint.
    try testing.expectEqual([4]f32{ 1, 0, 0, 0 }, mesh.joint_sets[0].weights[1]);
    try expectWarning(&said, "accessor 6: 1 of 4 colours are not finite, left out (and 1 more)");
}

test "positions that are not finite where nothing has a corner" {
    const nan = "\x00\x00\xc0\x7f";
    const buffer = buffer: {
        var bytes = malformed.makeBuffer();
        @memcpy(bytes[36..40], nan);
        // The second triangle is the first again.
        @memcpy(bytes[102..108], bytes[96..102]);
        break :buffer bytes;
    };
    const glb = try malformed.makeBinary(&buffer);
    defer gpa.free(glb);
    const warning = "accessor 0: 1 positions are not finite; nothing drawn needs them";
    try expectForgiven(glb, warning, "");
}

test "KHR_node_visibility hides what hangs below, and all that is wrong with it" {
    const hidden = "\"extensions\":{\"KHR_node_visibility\":{\"visible\":false}}";
    const shown = "\"KHR_node_visibility\":{\"visible\":true}";
    const cases = [_]struct { changes: []const Change, triangles: u64, lights: usize }{
        .{ .changes = &.{}, .triangles = 2, .lights = 1 },
        .{
            .changes = &.{.{ "\"children\":[1,2]", "\"children\":[1,2]," ++ hidden }},
            .triangles = 0,
            .lights = 0,
        },
        .{
            .changes = &.{
                .{ "\"children\":[1,2]", "\"children\":[1,2]," ++ hidden },
                .{ "{\"KHR_lights_punctual\":{\"light\"", "{" ++ shown ++
                    ",\"KHR_lights_punctual\":{\"light\"" },
            },
            .triangles = 0,
            .lights = 0,
        },
        .{
            .changes = &.{
                .{ "\"mesh\":0,", "\"mesh\":0," ++ hidden ++ "," },
                .{ "\"POSITION\":0,", "\"POSITION\":3," },
            },
            .triangles = 0,
            .lights = 1,
        },
        .{
            .changes = &.{.{ "0,0,0,1]}],", "0,0,0,1]," ++ hidden ++ "}]," }},
            .triangles = 2,
            .lights = 1,
        },
    };
    for (cases, 0..) |case, index| {
        errdefer std.debug.print("case {d}\n", .{index});
        const bytes = try change(case.changes);
        defer gpa.free(bytes);
        var said: Diagnostic = .{};
        var scene = try read(bytes, .{}, &said);
        defer scene.deinit();
        scene.check();
        try testing.expectEqual(case.triangles, scene.triangleCount());
        try testing.expectEqual(case.lights, scene.lights.len);
        try testing.expectEqual(1, scene.cameras.len);
        try testing.expectEqual(@intFromBool(case.triangles == 0), said.warning_count);
    }
}

test "required extensions: known, without a part in the picture, unknown, by force" {
    const required = "[\"KHR_lights_punctual\"]";
    const Outcome = struct { []const u8, []const u8, []const u8 };
    for ([_]Outcome{
        .{
            "[\"EXT_structural_metadata\",\"KHR_node_hoverability\"]",
            "without a part in the picture: the required extensions 'EXT_structural_metadata', " ++
                "'KHR_node_hoverability'",
            "",
        },
        .{
            "[\"EXT_turns_the_colours\"]",
            "not supported, and yet required: the extensions 'EXT_turns_the_colours'",
            "the required extension 'EXT_turns_the_colours' is not supported (see --force)",
        },
    }) |outcome| {
        const bytes = try change(&.{.{ required, outcome[0] }});
        defer gpa.free(bytes);
        for ([_]bool{ false, true }) |force| {
            var said: Diagnostic = .{};
            if (!force and outcome[2].len > 0) {
                const result = read(bytes, .{}, &said);
                try testing.expectError(error.InvalidInput, result);
                try testing.expectEqualStrings(outcome[2], said.message.text());
                continue;
            }
            var scene = try read(bytes, .{ .force = force }, &said);
            defer scene.deinit();
            try testing.expectEqual(2, scene.triangleCount());
            try expectWarning(&said, outcome[1]);
        }
    }
}

test "thousands of faults are one warning, and references that lead nowhere are refused quickly" {
    var text: std.ArrayList(u8) = .empty;
    defer text.deinit(gpa);
    try text.appendSlice(gpa, "\"type\":\"MAT4\"}");
    for (0..2000) |_| try text.appendSlice(gpa, ",{\"bufferView\":99}");
    const bytes = try change(&.{.{ "\"type\":\"MAT4\"}", text.items }});
    defer gpa.free(bytes);
    try expectForgiven(
        bytes,
        "accessors[9]: 'componentType' is missing; nothing drawn needs it (and 1999 more)",
        "accessors[9]: 'componentType' is missing",
    );
}

test "every allocation may fail while a text is mended" {
    const bytes = try change(&.{
        .{ "[0,3]", "[1,0,3,]" },
        .{ "\"type\":\"MAT4\"}", "\"type\":\"MAT4\"},{\"bufferView\":99}" },
        .{ "\"a\\u00e9\"", "\"caf\xe9\"" },
    });
    defer gpa.free(bytes);
    var fail_index: usize = 0;
    while (true) : (fail_index += 1) {
        var failing: testing.FailingAllocator = .init(gpa, .{ .fail_index = fail_index });
        var said: Diagnostic = .{};
        if (parse.parseBytes(failing.allocator(), io, bytes, .cwd(), .{}, &said)) |parsed| {
            var scene = parsed;
            scene.deinit();
            try testing.expect(!failing.has_induced_failure);
            return;
        } else |err| try testing.expectEqual(error.OutOfMemory, err);
    }
}
