//! Animations of glTF files: from channels and samplers to where things are at a moment.
//!
//! In: a triangle with a morph target, a light and a camera, and animations that are put into the
//! file. Out: the scene's channels and vertices that follow from glTF 2.0, section 3.11, and from
//! KHR_animation_pointer; a warning for each way in which a channel cannot be read.

const std = @import("std");
const raylane = @import("raylane");
const texts = @import("gltf_text.zig");
const Diagnostic = raylane.diagnostic.Diagnostic;
const Scene = raylane.scene.Scene;
const Session = raylane.session.Session;
const Vec3 = raylane.math.Vec3;
const settings = raylane.settings;
const testing = std.testing;
const gpa = testing.allocator;

/// `$DATA` stands for the buffer in base64, `$ANIMATIONS` for the animations.
const document =
    \\{"asset":{"version":"2.0"},"extensionsUsed":["KHR_animation_pointer","KHR_lights_punctual"],
    \\"extensions":{"KHR_lights_punctual":{"lights":[{"type":"spot","spot":{}}]}},
    \\"nodes":[{"children":[1,2,3],"translation":[10,0,0]},{"mesh":0},
    \\{"camera":0,"extensions":{"KHR_lights_punctual":{"light":0}}},
    \\{"matrix":[0,2,0,0, -1,0,0,0, 0,0,1,0, 0,5,0,1]},{}],
    \\"scenes":[{"nodes":[0]}],
    \\"cameras":[{"type":"perspective","perspective":{"yfov":1,"znear":0.1}}],
    \\"materials":[{"pbrMetallicRoughness":{},"emissiveFactor":[0.5,0,1]}],
    \\"meshes":[{"primitives":[{"attributes":{"POSITION":0},"material":0,
    \\"targets":[{"POSITION":1},{"POSITION":1}]}]}],
    \\"animations":[$ANIMATIONS],
    \\"accessors":[
    \\{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
    \\{"bufferView":1,"componentType":5126,"count":3,"type":"VEC3"},
    \\{"bufferView":2,"componentType":5126,"count":2,"type":"SCALAR"},
    \\{"bufferView":3,"componentType":5126,"count":2,"type":"VEC3"},
    \\{"bufferView":4,"componentType":5122,"count":2,"type":"VEC4","normalized":true},
    \\{"bufferView":3,"componentType":5126,"count":4,"type":"SCALAR"},
    \\{"componentType":5126,"count":2,"type":"VEC3","sparse":{"count":1,
    \\"indices":{"bufferView":5,"componentType":5121},"values":{"bufferView":6}}},
    \\{"bufferView":7,"componentType":5126,"count":6,"type":"VEC3"},
    \\{"bufferView":3,"componentType":5126,"count":2,"type":"SCALAR"},
    \\{"bufferView":8,"componentType":5126,"count":2,"type":"SCALAR"},
    \\{"bufferView":9,"componentType":5126,"count":2,"type":"SCALAR"}],
    \\"bufferViews":[
    \\{"buffer":0,"byteOffset":0,"byteLength":36},
    \\{"buffer":0,"byteOffset":36,"byteLength":36},
    \\{"buffer":0,"byteOffset":72,"byteLength":8},
    \\{"buffer":0,"byteOffset":80,"byteLength":24},
    \\{"buffer":0,"byteOffset":104,"byteLength":16},
    \\{"buffer":0,"byteOffset":120,"byteLength":1},
    \\{"buffer":0,"byteOffset":124,"byteLength":12},
    \\{"buffer":0,"byteOffset":136,"byteLength":72},
    \\{"buffer":0,"byteOffset":208,"byteLength":8},
    \\{"buffer":0,"byteOffset":216,"byteLength":8}],
    \\"buffers":[{"byteLength":224,"uri":"data:application/octet-stream;base64,$DATA"}]}
;

/// Accessors of the document.
const times = "2";
const vectors = "3";
const quaternions = "4";
const four_numbers = "5";
const sparse_vectors = "6";
const spline_vectors = "7";
const two_numbers = "8";
const falling_times = "9";
const broken_times = "10";

fn makeBuffer() [224]u8 {
    var bytes: [224]u8 = @splat(0);
    texts.putFloats(&bytes, &.{ 0, 0, 0, 1, 0, 0, 0, 1, 0 });
    texts.putFloats(bytes[36..], &.{ 0, 0, 1, 0, 0, 1, 0, 0, 1 });
    texts.putFloats(bytes[72..], &.{ 1, 3 });
    texts.putFloats(bytes[80..], &.{ 0.5, 1, 1, 0, 2, 4 });
    // No turn, and a quarter turn about z.
    for ([8]i16{ 0, 0, 0, 32767, 0, 0, 23170, 23170 }, 0..) |number, index| {
        std.mem.writeInt(i16, bytes[104 + 2 * index ..][0..2], number, .little);
    }
    bytes[120] = 1;
    texts.putFloats(bytes[124..], &.{ 0, 0, 8 });
    texts.putFloats(bytes[136..], &.{
        9, 9, 9, 0, 0, 0, 0, 0, 4,
        0, 0, 0, 2, 0, 0, 9, 9, 9,
    });
    texts.putFloats(bytes[208..], &.{ 3, 1, 0, std.math.nan(f32) });
    return bytes;
}

/// An animation of one channel.
fn animation(
    comptime target: []const u8,
    comptime input: []const u8,
    comptime output: []const u8,
    comptime interpolation: []const u8,
) []const u8 {
    return "{\"name\":\"go\",\"channels\":[{\"sampler\":0,\"target\":{" ++ target ++ "}}]," ++
        "\"samplers\":[{\"input\":" ++ input ++ ",\"output\":" ++ output ++
        ",\"interpolation\":\"" ++ interpolation ++ "\"}]}";
}

fn node(comptime index: []const u8, comptime path: []const u8) []const u8 {
    return "\"node\":" ++ index ++ ",\"path\":\"" ++ path ++ "\"";
}

fn pointer(comptime text: []const u8) []const u8 {
    return "\"path\":\"pointer\",\"extensions\":{\"KHR_animation_pointer\":{\"pointer\":\"" ++
        text ++ "\"}}";
}

fn read(allocator: std.mem.Allocator, animations: []const u8, said: *Diagnostic) !Scene {
    const text = try makeText(animations);
    defer gpa.free(text);
    return raylane.parse.parseBytes(allocator, testing.io, text, .cwd(), .{}, said);
}

/// The caller frees it.
fn makeText(animations: []const u8) ![]u8 {
    return texts.make(document, &makeBuffer(), &.{.{ "$ANIMATIONS", animations }});
}

/// The scene, posed; the session is the caller's.
fn poseAt(session: *Session, animations: []const u8, chosen: settings.Animation) !void {
    var scene = try read(gpa, animations, session.diagnostic);
    scene.check();
    errdefer std.debug.print("{s}\n", .{session.diagnostic.message.text()});
    session.adopt(scene, .owned);
    scene = undefined;
    try session.pose(.{
        .lanes = raylane.variant.compiled[0].lanes,
        .animation = chosen,
    });
    if (session.diagnostic.warning_count > 0) {
        std.debug.print("{s}\n", .{session.diagnostic.warnings[0].text()});
        return error.TestUnexpectedResult;
    }
}

/// Where the three vertices are at 2 s, half of the way.
fn expectAt(animations: []const u8, expected: [3]Vec3) !void {
    var said: Diagnostic = .{};
    var session: Session = .init(gpa, testing.io, 1, &said);
    defer session.deinit();
    const chosen: settings.Animation = .{ .which = .{ .name = "go" }, .time_s = 2 };
    try poseAt(&session, animations, chosen);
    for (expected, session.world.?.geometry.positions) |wanted, position| {
        for (wanted, position) |a, b| try testing.expectApproxEqAbs(a, b, 1e-4);
    }
}

fn moved(offset: Vec3) [3]Vec3 {
    const vec3 = raylane.math.vec3;
    return .{
        offset, vec3.add(offset, .{ 1, 0, 0 }), vec3.add(offset, .{ 0, 1, 0 }),
    };
}

test "nodes move by floats, normalised integers, sparse values, steps and splines" {
    const line = comptime animation(node("1", "translation"), times, vectors, "LINEAR");
    try expectAt(line, moved(.{ 10.25, 1.5, 2.5 }));
    const step = comptime animation(node("1", "translation"), times, vectors, "STEP");
    try expectAt(step, moved(.{ 10.5, 1, 1 }));
    const sparse = comptime animation(node("0", "translation"), times, sparse_vectors, "LINEAR");
    try expectAt(sparse, moved(.{ 0, 0, 4 }));
    const spline = comptime animation(
        node("1", "translation"),
        times,
        spline_vectors,
        "CUBICSPLINE",
    );
    try expectAt(spline, moved(.{ 11, 0, 1 }));
    const root_half = @sqrt(@as(f32, 0.5));
    const rotation = comptime animation(node("1", "rotation"), times, quaternions, "LINEAR");
    try expectAt(rotation, .{
        .{ 10, 0, 0 }, .{ 10 + root_half, root_half, 0 }, .{ 10 - root_half, root_half, 0 },
    });
    const scale = comptime animation(node("1", "scale"), times, vectors, "LINEAR");
    try expectAt(scale, .{ .{ 10, 0, 0 }, .{ 10.25, 0, 0 }, .{ 10, 1.5, 0 } });
}

test "morph weights move, those of nodes and those of meshes" {
    const weights = comptime animation(node("1", "weights"), times, four_numbers, "LINEAR");
    // (0.5 + 1) / 2 and (1 + 0) / 2.
    try expectAt(weights, moved(.{ 10, 0, 1.25 }));
    const one = comptime animation(pointer("/nodes/1/weights/1"), times, two_numbers, "LINEAR");
    try expectAt(one, moved(.{ 10, 0, 0.75 }));
    const mesh = comptime animation(pointer("/meshes/0/weights"), times, four_numbers, "LINEAR");
    try expectAt(mesh, moved(.{ 10, 0, 1.25 }));
}

test "pointers move nodes, materials, lights and cameras" {
    const place = comptime animation(pointer("/nodes/1/translation"), times, vectors, "LINEAR");
    try expectAt(place, moved(.{ 10.25, 1.5, 2.5 }));
    const animations = comptime animation(
        pointer("/materials/0/emissiveFactor"),
        times,
        vectors,
        "LINEAR",
    ) ++ "," ++ animation(
        pointer("/extensions/KHR_lights_punctual/lights/0/intensity"),
        times,
        two_numbers,
        "LINEAR",
    ) ++ "," ++ animation(
        pointer("/cameras/0/perspective/yfov"),
        times,
        two_numbers,
        "LINEAR",
    ) ++ "," ++ animation(pointer("/cameras/0/perspective/zfar"), times, two_numbers, "LINEAR");
    var said: Diagnostic = .{};
    var session: Session = .init(gpa, testing.io, 1, &said);
    defer session.deinit();
    try poseAt(&session, animations, .{ .which = .all, .time_s = 2 });
    try session.view(.{ .resolution = .{ 4, 4 } });
    const world = &session.world.?;
    try testing.expectEqual(Vec3{ 0.25, 1, 1 }, world.materials.all[0].emissive);
    try testing.expectEqual(0.75, world.lights[0].intensity[0]);
    const half_tangent = @tan(0.75 / 2.0);
    try testing.expectApproxEqAbs(half_tangent, world.view.camera.up[1], 1e-6);
    // Another moment of the same scene, and then none.
    try session.pose(.{ .lanes = raylane.variant.compiled[0].lanes });
    try session.view(.{ .resolution = .{ 4, 4 } });
    const rest = &session.world.?;
    try testing.expectEqual(Vec3{ 0.5, 0, 1 }, rest.materials.all[0].emissive);
    try testing.expectEqual(1, rest.lights[0].intensity[0]);
}

test "what is hidden appears, with all below it, and its light" {
    const show = comptime animation(
        pointer("/nodes/0/extensions/KHR_node_visibility/visible"),
        times,
        two_numbers,
        "STEP",
    );
    var said: Diagnostic = .{};
    var session: Session = .init(gpa, testing.io, 1, &said);
    defer session.deinit();
    const text = try makeText(show);
    defer gpa.free(text);
    const hidden = try texts.replace(text, "\"nodes\":[{",
        \\"nodes":[{"extensions":{"KHR_node_visibility":{"visible":false}},
    );
    defer gpa.free(hidden);
    const io = testing.io;
    session.adopt(try raylane.parse.parseBytes(gpa, io, hidden, .cwd(), .{}, &said), .owned);
    for ([_]settings.Animation{
        .{},
        .{ .which = .all, .time_s = 1 },
        .{},
    }, [_]bool{ false, true, false }) |chosen, is_seen| {
        try session.pose(.{
            .lanes = raylane.variant.compiled[0].lanes,
            .animation = chosen,
        });
        try session.view(.{ .resolution = .{ 4, 4 } });
        const world = &session.world.?;
        try testing.expectEqual(!is_seen, world.geometry.triangles[0].isDropped());
        try testing.expectEqual(is_seen, world.facts.own_light_count > 0);
    }
    // Nothing but that there is nothing else.
    try testing.expectEqual(1, said.warning_count);
}

test "a node that moves has its matrix taken apart" {
    var said: Diagnostic = .{};
    const turn = comptime animation(node("3", "scale"), times, vectors, "LINEAR");
    var scene = try read(gpa, turn, &said);
    defer scene.deinit();
    scene.check();
    const warning = "node 3: is moved by animations, so its matrix is taken apart";
    try testing.expectEqualStrings(warning, said.warnings[0].text());
    const parts = &scene.moving.nodes[0];
    for ([3]f64{ 2, 1, 1 }, parts.scale) |wanted, number| {
        try testing.expectApproxEqAbs(wanted, number, 1e-12);
    }
    try testing.expectEqual(raylane.math.Vec3d{ 0, 5, 0 }, parts.translation);
    try testing.expectApproxEqAbs(@sqrt(0.5), @abs(parts.rotation[2]), 1e-12);
}

test "what cannot be read of an animation is left out with a warning, and the rest is there" {
    const Case = struct { []const u8, []const u8 };
    const start = "animation 0, channel 0: ";
    const cases = comptime [_]Case{
        .{
            animation(node("1", "translation"), falling_times, vectors, "LINEAR"),
            start ++ "sampler 0: its times fall, left out",
        },
        .{
            animation(node("1", "translation"), broken_times, vectors, "LINEAR"),
            start ++ "sampler 0: has numbers that are not finite, left out",
        },
        .{
            animation(node("1", "translation"), vectors, vectors, "LINEAR"),
            start ++ "sampler 0: times are single numbers, left out",
        },
        .{
            animation(node("1", "translation"), times, vectors, "CUBICSPLINE"),
            start ++ "sampler 0: 2 times with 2 values of 3 numbers, left out",
        },
        .{
            animation(node("1", "rotation"), times, vectors, "LINEAR"),
            start ++ "sampler 0: 2 times with 2 values of 3 numbers, left out",
        },
        .{
            animation(node("1", "weights"), times, two_numbers, "LINEAR"),
            start ++ "sampler 0: 2 times with 2 values of 1 numbers, left out",
        },
        .{
            animation(node("0", "weights"), times, two_numbers, "LINEAR"),
            start ++ "moves what is not there, left out",
        },
        .{
            animation(node("1", "place"), times, vectors, "LINEAR"),
            start ++ "the path 'place' is not known, left out",
        },
        .{
            animation(pointer("/nodes/1/weights/2"), times, two_numbers, "LINEAR"),
            start ++ "moves what is not there, left out",
        },
        .{
            animation(pointer("/materials/3/alphaCutoff"), times, two_numbers, "LINEAR"),
            start ++ "moves what is not there, left out",
        },
        .{
            animation(pointer("/textures/0/name"), times, two_numbers, "LINEAR"),
            "1 channels of animations move what is not rendered: the first '/textures/0/name'",
        },
    };
    for (cases) |case| {
        errdefer std.debug.print("expected: {s}\n", .{case[1]});
        var said: Diagnostic = .{};
        var scene = try read(gpa, case[0], &said);
        defer scene.deinit();
        scene.check();
        try testing.expectEqual(1, said.warning_count);
        try testing.expectEqualStrings(case[1], said.warnings[0].text());
        try testing.expectEqual(1, scene.animations.len);
        try testing.expectEqualStrings("go", scene.animations[0].name);
        try testing.expectEqual(0, scene.animations[0].channels.len);
    }
    // Of another interpolation there are values all the same. What is nowhere in the scene, or
    // nobody's, is no reason for a word.
    const others = comptime [_]struct { []const u8, usize, usize }{
        .{ animation(node("1", "translation"), times, vectors, "SMOOTH"), 1, 1 },
        .{ animation(node("4", "translation"), times, vectors, "LINEAR"), 0, 0 },
        .{ animation("\"path\":\"translation\"", times, vectors, "LINEAR"), 0, 0 },
    };
    for (others) |case| {
        var said: Diagnostic = .{};
        var scene = try read(gpa, case[0], &said);
        defer scene.deinit();
        try testing.expectEqual(case[1], said.warning_count);
        try testing.expectEqual(case[2], scene.animations[0].channels.len);
    }
}

test "a channel or a sampler that is broken costs no other" {
    const good = "{\"sampler\":0,\"target\":{\"node\":0,\"path\":\"scale\"}}";
    const sampler = "{\"input\":2,\"output\":3}";
    const cases = comptime [_]struct { []const u8, []const u8, []const u8 }{
        .{
            "{\"sampler\":5,\"target\":{\"node\":1,\"path\":\"scale\"}}",
            sampler,
            "animation 0, channel 0: there is no sampler 5, left out",
        },
        .{
            "{\"sampler\":2147483648,\"target\":{\"node\":1,\"path\":\"scale\"}}",
            sampler,
            "animation 0, channel 0: there is no sampler 2147483648, left out",
        },
        .{
            "{\"sampler\":0,\"target\":{\"node\":9,\"path\":\"scale\"}}",
            sampler,
            "animations[0].channels[0].target.node: 9 of 5; left out",
        },
        .{
            "{\"sampler\":0,\"target\":[]}",
            sampler,
            "animations[0].channels[0].target: an object is expected; left out",
        },
        .{ "7", sampler, "animations[0].channels[0]: an object is expected; left out" },
        .{
            "{\"sampler\":0,\"target\":{\"extensions\":{\"KHR_animation_pointer\":" ++
                "{\"pointer\":1}}}}",
            sampler,
            "animations[0].channels[0].target.extensions.KHR_animation_pointer.pointer: " ++
                "a string is expected; left out",
        },
        .{
            "{\"sampler\":1,\"target\":{\"node\":1,\"path\":\"scale\"}}",
            sampler ++ ",{\"input\":2,\"output\":99}",
            "animations[0].samplers[1].output: 99 of 11; left out",
        },
        .{
            "{\"sampler\":1,\"target\":{\"node\":1,\"path\":\"scale\"}}",
            sampler ++ ",{\"input\":2}",
            "animations[0].samplers[1]: 'output' is missing; left out",
        },
    };
    inline for (cases) |case| {
        errdefer std.debug.print("expected: {s}\n", .{case[2]});
        var said: Diagnostic = .{};
        var scene = try read(gpa, "{\"channels\":[" ++ case[0] ++ "," ++ good ++
            "],\"samplers\":[" ++ case[1] ++ "]}", &said);
        defer scene.deinit();
        scene.check();
        try testing.expectEqual(1, said.warning_count);
        try testing.expectEqualStrings(case[2], said.warnings[0].text());
        try testing.expectEqual(1, scene.animations.len);
        try testing.expectEqual(1, scene.animations[0].channels.len);
        try testing.expectEqual(1, scene.file.counts.?.animations);
    }
}

test "key frames in a file that is missing" {
    const text = try makeText(comptime animation(node("1", "scale"), times, "11", "LINEAR"));
    defer gpa.free(text);
    const buffers = "\"bufferViews\":[";
    const at = std.mem.find(u8, text, buffers).? - "],\n".len;
    const parts = [_][]const u8{
        text[0..at],
        ",{\"bufferView\":10,\"componentType\":5126,\"count\":2,\"type\":\"VEC3\"}",
        text[at .. text.len - "]}".len],
        ",{\"byteLength\":24,\"uri\":\"lost.bin\"}]}",
    };
    const with_buffer = try std.mem.concat(gpa, u8, &parts);
    defer gpa.free(with_buffer);
    const view = "{\"buffer\":0,\"byteOffset\":216,\"byteLength\":8}";
    const lost = view ++ ",{\"buffer\":1,\"byteLength\":24}";
    const with_view = try texts.replace(with_buffer, view, lost);
    defer gpa.free(with_view);
    var said: Diagnostic = .{};
    var scene = try raylane.parse.parseBytes(gpa, testing.io, with_view, .cwd(), .{}, &said);
    defer scene.deinit();
    try testing.expectEqualStrings(
        "animation 0, channel 0: sampler 0: buffer 1: 'lost.bin' does not exist, left out",
        said.warnings[0].text(),
    );
    try testing.expectEqual(1, scene.triangleCount());
}

test "all that an animation shows is framed, whatever moment is seen" {
    const line = comptime animation(node("1", "translation"), times, vectors, "LINEAR");
    var said: Diagnostic = .{};
    var session: Session = .init(gpa, testing.io, 1, &said);
    defer session.deinit();
    var cameras: [2]raylane.world.Camera = undefined;
    const wide: settings.View = .{ .resolution = .{ 8, 8 }, .camera = .auto, .frames_all = true };
    for (&cameras, [2]f32{ 1, 2.5 }) |*camera, time_s| {
        const chosen: settings.Animation = .{ .which = .all, .time_s = time_s };
        try poseAt(&session, line, chosen);
        try session.view(wide);
        camera.* = session.world.?.view.camera;
    }
    try testing.expectEqual(cameras[0], cameras[1]);
    try session.view(.{ .resolution = .{ 8, 8 }, .camera = .auto });
    try testing.expect(!std.meta.eql(cameras[0], session.world.?.view.camera));
    // Far away, where another moment has its origin elsewhere.
    const far: Vec3 = .{ 1 << 20, 0, 0 };
    var scene = try read(gpa, line, &said);
    const nodes = try scene.arena.allocator().dupe(raylane.scene.Node, scene.nodes);
    for (&nodes[0].local.translation, far) |*to, offset| to.* += offset;
    scene.nodes = nodes;
    session.adopt(scene, .owned);
    for (&cameras, [2]f32{ 1, 3 }) |*camera, time_s| {
        const chosen: settings.Animation = .{ .which = .all, .time_s = time_s };
        try session.pose(.{ .lanes = raylane.variant.compiled[0].lanes, .animation = chosen });
        try session.view(wide);
        // Relative to a vertex that goes from y = 1 and z = 1 to 2 and 4, and x to 0.
        const at = session.world.?.geometry.positions[0];
        camera.* = session.world.?.view.camera;
        camera.origin = raylane.math.vec3.sub(camera.origin, at);
    }
    const moved_by: Vec3 = .{ -0.5, 1, 3 };
    const same = raylane.math.vec3.add(cameras[1].origin, moved_by);
    for (cameras[0].origin, same) |a, b| try testing.expectApproxEqAbs(a, b, 1e-3);
    // At rest nothing moves.
    try session.pose(.{ .lanes = raylane.variant.compiled[0].lanes });
    try session.view(wide);
}

test "memory that runs out is an error that leaks nothing" {
    const animations = comptime animation(node("1", "weights"), times, four_numbers, "LINEAR") ++
        "," ++ animation(pointer("/materials/0/emissiveFactor"), times, vectors, "LINEAR");
    const text = try makeText(animations);
    defer gpa.free(text);
    const one = struct {
        fn one(failing: std.mem.Allocator, bytes: []const u8) !void {
            var said: Diagnostic = .{};
            const io = testing.io;
            var scene = try raylane.parse.parseBytes(failing, io, bytes, .cwd(), .{}, &said);
            scene.deinit();
        }
    }.one;
    try testing.checkAllAllocationFailures(gpa, one, .{text});
}
