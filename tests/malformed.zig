//! Broken scene files, most of them glTF: an error of one line, a warning, or a scene, and never a
//! crash or a leak.
//!
//! In: a small document that is right, changed in one place, byte by byte, or cut; the corpus
//! beside the checkout where there is one. Out: what its manifest, or a table here, says.

const std = @import("std");
const raylane = @import("raylane");
const texts = @import("gltf_text.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = raylane.diagnostic.Diagnostic;
const Scene = raylane.scene.Scene;
const parse = raylane.parse;
const testing = std.testing;
const gpa = testing.allocator;
const io = testing.io;

/// A quad with everything that is read. `$DATA` stands for the buffer, in base64.
pub const document =
    \\{"asset":{"version":"2.0","minVersion":"2.0"},
    \\"extensionsUsed":["KHR_lights_punctual","KHR_materials_volume"],
    \\"extensionsRequired":["KHR_lights_punctual"],
    \\"extensions":{"KHR_lights_punctual":{"lights":[{"type":"spot","intensity":10,"range":5,
    \\"color":[1,1,1],"spot":{"innerConeAngle":0.1,"outerConeAngle":0.5}}]}},
    \\"scene":0,
    \\"scenes":[{"nodes":[0,3]}],
    \\"nodes":[{"children":[1,2],"translation":[1,2,3],"rotation":[0,0,0,1],"scale":[1,1,1]},
    \\{"mesh":0,"skin":0,"weights":[0]},
    \\{"camera":0,"extensions":{"KHR_lights_punctual":{"light":0}}},
    \\{"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]}],
    \\"cameras":[{"name":"a\u00e9","type":"perspective",
    \\"perspective":{"yfov":0.7,"aspectRatio":1.5,"znear":0.1,"zfar":100}}],
    \\"skins":[{"joints":[3,0],"inverseBindMatrices":8}],
    \\"materials":[{"pbrMetallicRoughness":{"baseColorFactor":[1,1,1,1],"roughnessFactor":0.5,
    \\"metallicFactor":0},"alphaMode":"BLEND","emissiveFactor":[0,0,0],
    \\"extensions":{"KHR_materials_volume":{"thicknessFactor":1,"attenuationDistance":2}}}],
    \\"meshes":[{"weights":[0],"primitives":[{"mode":4,"indices":3,"material":0,
    \\"attributes":{"POSITION":0,"NORMAL":1,"COLOR_0":2,"TEXCOORD_0":5,"JOINTS_0":7,"WEIGHTS_0":6},
    \\"targets":[{"POSITION":4}]}]}],
    \\"accessors":[
    \\{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3",
    \\"sparse":{"count":1,"indices":{"bufferView":4,"componentType":5123},
    \\"values":{"bufferView":5}}},
    \\{"bufferView":1,"componentType":5126,"count":4,"type":"VEC3"},
    \\{"bufferView":3,"componentType":5121,"count":4,"type":"VEC4","normalized":true},
    \\{"bufferView":2,"componentType":5123,"count":6,"type":"SCALAR"},
    \\{"componentType":5126,"count":4,"type":"VEC3"},
    \\{"bufferView":6,"componentType":5126,"count":4,"type":"VEC2"},
    \\{"componentType":5126,"count":4,"type":"VEC4"},
    \\{"bufferView":7,"componentType":5121,"count":4,"type":"VEC4"},
    \\{"bufferView":8,"componentType":5126,"count":2,"type":"MAT4"}],
    \\"bufferViews":[
    \\{"buffer":0,"byteOffset":0,"byteLength":48},
    \\{"buffer":0,"byteOffset":48,"byteLength":48,"byteStride":12},
    \\{"buffer":0,"byteOffset":96,"byteLength":12},
    \\{"buffer":0,"byteOffset":108,"byteLength":16},
    \\{"buffer":0,"byteOffset":124,"byteLength":2},
    \\{"buffer":0,"byteOffset":128,"byteLength":12},
    \\{"buffer":0,"byteOffset":140,"byteLength":32},
    \\{"buffer":0,"byteOffset":172,"byteLength":16},
    \\{"buffer":0,"byteOffset":188,"byteLength":128}],
    \\"buffers":[{"byteLength":316,"uri":"data:application/octet-stream;base64,$DATA"}]}
;

const buffer_bytes = 316;

/// The document's buffer.
pub fn makeBuffer() [buffer_bytes]u8 {
    var bytes: [buffer_bytes]u8 = @splat(0);
    const corners = [4][2]f32{ .{ 0, 0 }, .{ 1, 0 }, .{ 1, 1 }, .{ 0, 1 } };
    for (corners, 0..) |corner, index| {
        texts.putFloats(bytes[12 * index ..], &.{ corner[0], corner[1], 0 });
        texts.putFloats(bytes[48 + 12 * index ..], &.{ 0, 0, 1 });
        @memset(bytes[108 + 4 * index ..][0..4], 255);
        texts.putFloats(bytes[140 + 8 * index ..], &corner);
        bytes[172 + 4 * index] = @intCast(index % 2);
    }
    for ([6]u16{ 0, 1, 2, 0, 2, 3 }, 0..) |corner, index| {
        std.mem.writeInt(u16, bytes[96 + 2 * index ..][0..2], corner, .little);
    }
    bytes[124] = 2;
    texts.putFloats(bytes[128..], &.{ 2, 2, 0 });
    for (0..2) |matrix| for (0..4) |axis| {
        texts.putFloats(bytes[188 + 64 * matrix + 20 * axis ..], &.{1});
    };
    return bytes;
}

/// The document as GLB. The caller frees it.
pub fn makeBinary(buffer: []const u8) ![]u8 {
    const uri = ",\"uri\":\"data:application/octet-stream;base64,$DATA\"";
    const text = try texts.replace(document, uri, "");
    defer gpa.free(text);
    const text_bytes = std.mem.alignForward(usize, text.len, 4);
    const glb = try gpa.alloc(u8, 12 + 8 + text_bytes + 8 + buffer.len);
    @memset(glb, ' ');
    @memcpy(glb[0..4], "glTF");
    std.mem.writeInt(u32, glb[4..8], 2, .little);
    std.mem.writeInt(u32, glb[8..12], @intCast(glb.len), .little);
    std.mem.writeInt(u32, glb[12..16], @intCast(text_bytes), .little);
    @memcpy(glb[16..20], "JSON");
    @memcpy(glb[20..][0..text.len], text);
    const chunk = glb[20 + text_bytes ..];
    std.mem.writeInt(u32, chunk[0..4], @intCast(buffer.len), .little);
    @memcpy(chunk[4..8], "BIN\x00");
    @memcpy(chunk[8..], buffer);
    return glb;
}

/// Parses and throws away, with everything that a scene promises checked.
fn tryParse(allocator: Allocator, bytes: []const u8, said: *Diagnostic) parse.Error!void {
    var scene = try parse.parseBytes(allocator, io, bytes, .cwd(), .{}, said);
    defer scene.deinit();
    scene.check();
}

test "the document is right, as text and as GLB" {
    const buffer = makeBuffer();
    const text = try texts.make(document, &buffer, &.{});
    defer gpa.free(text);
    const glb = try makeBinary(&buffer);
    defer gpa.free(glb);
    for ([_][]const u8{ text, glb }) |bytes| {
        var said: Diagnostic = .{};
        var scene = try parse.parseBytes(gpa, io, bytes, .cwd(), .{}, &said);
        defer scene.deinit();
        scene.check();
        try testing.expectEqual(2, scene.triangleCount());
        try testing.expectEqual(4, scene.nodes.len);
        try testing.expectEqual([3]f32{ 2, 2, 0 }, scene.meshes[0].positions[2]);
        try testing.expectEqual([4]f32{ 1, 1, 1, 1 }, scene.meshes[0].colors.?[3]);
        try testing.expectEqualStrings("a\u{e9}", scene.cameras[0].name);
        try testing.expectEqual(5, scene.lights[0].range);
        try testing.expect(scene.materials[0].volume);
        try testing.expectEqual(0, said.warning_count);
    }
}

/// What one change does to the document: an error, one warning more, or neither.
const Expected = union(enum) { wrong: []const u8, odd: []const u8, fine };

fn wrong(message: []const u8) Expected {
    return .{ .wrong = message };
}

fn odd(warning: []const u8) Expected {
    return .{ .odd = warning };
}

const Change = struct { []const u8, []const u8, Expected };

fn expectChanges(changes: []const Change) !void {
    const buffer = makeBuffer();
    const text = try texts.make(document, &buffer, &.{});
    defer gpa.free(text);
    for (changes) |change| {
        const changed = try texts.replace(text, change[0], change[1]);
        defer gpa.free(changed);
        errdefer std.debug.print("{s} -> {s}\n", .{ change[0], change[1] });
        try expectOutcome(changed, change[2]);
    }
}

fn expectOutcome(bytes: []const u8, expected: Expected) !void {
    var said: Diagnostic = .{};
    errdefer {
        std.debug.print("error: {s}\n", .{said.message.text()});
        for (said.warnings[0..said.warning_count]) |*warning| {
            std.debug.print("warning: {s}\n", .{warning.text()});
        }
    }
    const result = tryParse(gpa, bytes, &said);
    switch (expected) {
        .wrong => |message| {
            try testing.expectError(error.InvalidInput, result);
            try testing.expectEqualStrings(message, said.message.text());
        },
        .odd => |message| {
            try result;
            for (said.warnings[0..said.warning_count]) |*warning| {
                if (std.mem.eql(u8, warning.text(), message)) break;
            } else return error.TestUnexpectedResult;
        },
        .fine => {
            try result;
            try testing.expectEqual(0, said.warning_count);
        },
    }
}

test "JSON, the asset and its extensions" {
    try expectChanges(&.{
        .{ "\"version\":\"2.0\"", "\"version\":\"2.1\"", .fine },
        .{
            "\"version\":\"2.0\"",
            "\"version\":\"3.0\"",
            wrong("glTF 2.0 is not supported, only 2.0"),
        },
        .{
            "\"version\":\"2.0\"",
            "\"version\":\"1.0\"",
            wrong("glTF 1.0 is not supported, only 2.0"),
        },
        .{
            "\"version\":\"2.0\"",
            "\"version\":\"x\"",
            wrong("asset.version: 'x' is not a version"),
        },
        .{
            "\"version\":\"2.0\"",
            "\"version\":\"2\"",
            odd("asset.version: '2' is taken as 2.0"),
        },
        .{
            "\"minVersion\":\"2.0\"",
            "\"minVersion\":\"3.0\"",
            wrong("glTF 3.0 is not supported, only 2.0"),
        },
        .{
            "\"minVersion\":\"2.0\"",
            "\"minVersion\":\"2.1\"",
            wrong("glTF 2.1 is not supported, only 2.0"),
        },
        .{ "\"asset\":{\"version\":\"2.0\",", "\"asset\":{", wrong("asset: 'version' is missing") },
        .{ "\"asset\"", "\"assets\"", wrong("the document: 'asset' is missing") },
        .{ "\"asset\"", "\"\\u0061sset\"", .fine },
        .{ "[\"KHR_lights_punctual\"]", "[\"KHR_texture_transform\"]", .fine },
        .{ "[\"KHR_lights_punctual\"]", "[\"FB_materials_modmap\"]", odd(
            "not rendered: the extensions 'FB_materials_modmap'",
        ) },
        .{
            "\"KHR_materials_volume\"],",
            "\"A_b\",\"FB_materials_modmap\",\"A_b\",\"KHR_xmp\",\"EXT_lights_ies\"],",
            odd("not rendered: the extensions 'A_b', 'FB_materials_modmap', 'EXT_lights_ies'"),
        },
        .{ "\"KHR_materials_volume\"],", "\"\",\"b\",\"c\",\"d\",\"e\",\"f\",\"g\"],", odd(
            "not rendered: the extensions '', 'b', 'c', 'd', 'e', 'f' and others",
        ) },
        .{ "[\"KHR_lights_punctual\"]", "[\"EXT_mesh_compression\"]", wrong(
            "the required extension 'EXT_mesh_compression' is not supported (see --force)",
        ) },
        .{ "\"scene\":0", "\"scene\":1", odd("scene: 1 of 1; left out") },
        .{
            "\"scene\":0",
            "\"scene\":-1",
            odd("scene: -1 is not a whole number from 0 to 2^53 - 1; left out"),
        },
        .{ "\"scene\":0", "\"scene\":0,\"extras\":[null,1e999]", .fine },
        .{
            "\"scene\":0",
            "\"scene\":0,",
            wrong("JSON line 6, byte 11: a key in quotes is expected"),
        },
        .{ "\"scene\":0", "\"scene\":0,\"extensions\":{}", wrong("extensions: stands twice") },
    });
}

test "nodes, cameras and lights" {
    try expectChanges(&.{
        .{ "[0,3]", "[0,3,0]", odd("scene 0: lists node 0 twice, counted once") },
        .{ "[0,3]", "[1]", wrong("scenes[0].nodes: 1 is a root and a child at once") },
        .{
            "\"children\":[1,2]",
            "\"children\":[1,1,2]",
            odd("nodes[0].children: 1 stands twice, counted once"),
        },
        .{ "\"children\":[1,2]", "\"children\":[1,4]", wrong("nodes[0].children[1]: 4 of 4") },
        .{ "\"children\":[1,2]", "\"children\":[[1]]", wrong(
            "nodes[0].children[0]: a whole number is expected",
        ) },
        .{
            "\"mesh\":0,\"skin\":0",
            "\"children\":[1]",
            wrong("nodes[1].children[0]: 1 has two parents"),
        },
        .{
            "\"rotation\":[0,0,0,1]",
            "\"rotation\":[0,0,0,0]",
            odd("node 0: rotation is zero, taken as none"),
        },
        .{ "\"rotation\":[0,0,0,1]", "\"rotation\":[0,0,0,2]", odd(
            "node 0: rotation is not a unit quaternion, made one",
        ) },
        .{
            "\"rotation\":[0,0,0,1]",
            "\"rotation\":[0,0,1]",
            wrong("nodes[0].rotation: 4 numbers are expected"),
        },
        .{ "\"scale\":[1,1,1]", "\"scale\":[0,0,0]", .fine },
        .{
            "\"scale\":[1,1,1]",
            "\"scale\":[1e39,1,1]",
            wrong("nodes[0].scale[0]: 1e39 is out of range"),
        },
        .{ "0,0,0,1]}],", "0,0,0,2]}],", odd(
            "node 3: matrix is not affine, its last row is 0 0 0 2, ignored",
        ) },
        .{ "0,0,0,1]}],", "0,0,0,1],\"scale\":[1,1,1]}],", odd(
            "node 3: has a matrix, so its other transforms are ignored",
        ) },
        .{ "\"yfov\":0.7", "\"yfov\":-0.7", wrong(
            "camera 0: yfov -0.7 is not between 0 and pi",
        ) },
        .{ "\"yfov\":0.7,", "", wrong("cameras[0].perspective: 'yfov' is missing") },
        .{
            "\"aspectRatio\":1.5",
            "\"aspectRatio\":0",
            odd("camera 0: aspectRatio 0 is not above 0, ignored"),
        },
        .{
            "\"znear\":0.1",
            "\"znear\":0",
            odd("camera 0: znear and zfar make no sense; they are not used"),
        },
        .{ "\"perspective\":{", "\"orthographic\":{\"xmag\":-1,\"ymag\":2,", odd(
            "camera 0: xmag is negative, its sign is ignored",
        ) },
        .{
            "\"perspective\":{",
            "\"orthographic\":{\"xmag\":1,\"ymag\":0,",
            wrong("camera 0: ymag is 0"),
        },
        .{
            "\"perspective\":{",
            "\"fisheye\":{",
            wrong("camera 0: neither perspective nor orthographic"),
        },
        .{ "\"camera\":0", "\"camera\":1", wrong("nodes[2].camera: 1 of 1") },
        .{
            "\"light\":0",
            "\"light\":1",
            wrong("nodes[2].extensions.KHR_lights_punctual.light: 1 of 1"),
        },
        .{ "\"spot\",", "\"area\",", odd("light 0: unknown type, left out") },
        .{ "{\"type\":\"spot\",", "{", odd("light 0: unknown type, left out") },
        .{
            "\"range\":5",
            "\"range\":0",
            odd("extensions.KHR_lights_punctual.lights[0].range: 0 is not above 0, ignored"),
        },
        .{
            "\"intensity\":10",
            "\"intensity\":-1",
            odd("light 0: intensity -1 is below 0, taken as 0"),
        },
        .{ "\"intensity\":10", "\"intensity\":1e38", .fine },
        .{ "\"outerConeAngle\":0.5", "\"outerConeAngle\":3", odd(
            "light 0: cone angles 0.1 and 3 do not fit 0 <= inner < outer <= pi / 2, clamped",
        ) },
        .{ "\"innerConeAngle\":0.1", "\"innerConeAngle\":0.5", odd(
            "light 0: cone angles 0.5 and 0.5 do not fit 0 <= inner < outer <= pi / 2, clamped",
        ) },
    });
}

test "materials" {
    try expectChanges(&.{
        .{ "[1,1,1,1]", "[1,1,2,1]", odd("material 0: baseColorFactor 2 is not in 0..1, clamped") },
        .{ "[1,1,1,1]", "[1,1,1]", wrong(
            "materials[0].pbrMetallicRoughness.baseColorFactor: 4 numbers are expected",
        ) },
        .{ "\"metallicFactor\":0", "\"metallicFactor\":-1", odd(
            "material 0: metallicFactor -1 is not in 0..1, clamped",
        ) },
        .{ "\"BLEND\"", "\"MASK\",\"alphaCutoff\":-1", odd(
            "material 0: alphaCutoff -1 is below 0, clamped",
        ) },
        .{ "\"BLEND\"", "\"GLOW\"", odd("materials[0].alphaMode: 'GLOW' is not known, ignored") },
        .{ "\"attenuationDistance\":2", "\"attenuationDistance\":0", odd(
            "material 0: attenuationDistance 0 is not above 0, left out",
        ) },
        .{ "\"KHR_materials_volume\":{", "\"KHR_materials_ior\":{\"ior\":0.5,", odd(
            "material 0: ior 0.5 is not in 1..1000000, clamped",
        ) },
        .{ "\"KHR_materials_volume\":{", "\"KHR_materials_ior\":{\"ior\":0,", .fine },
        .{ "\"KHR_materials_volume\":{", "\"x\":1,\"KHR_materials_volume\":{", wrong(
            "materials[0].extensions.x: an object is expected",
        ) },
        .{ "\"emissiveFactor\"", "\"normalTexture\":{\"index\":0},\"emissiveFactor\"", wrong(
            "materials[0].normalTexture.index: 0 of 0",
        ) },
    });
}

test "meshes, skins and weights" {
    try expectChanges(&.{
        .{ "\"mode\":4", "\"mode\":5", .fine },
        .{ "\"mode\":4", "\"mode\":6", .fine },
        .{ "\"mode\":4", "\"mode\":0", .fine },
        .{ "\"mode\":4", "\"mode\":1", .fine },
        .{ "\"mode\":4", "\"mode\":2", .fine },
        .{ "\"mode\":4", "\"mode\":3", .fine },
        .{ "\"count\":6", "\"count\":5", odd(
            "mesh 0, primitive 0: 5 vertices do not make whole triangles, the rest is left out",
        ) },
        .{ "\"mode\":4", "\"mode\":7", wrong("mesh 0, primitive 0: unknown mode") },
        .{ "\"indices\":3", "\"indices\":2", wrong(
            "accessor 2: indices have to be single unsigned integers",
        ) },
        .{ "\"indices\":3,", "", odd(
            "mesh 0, primitive 0: 4 vertices do not make whole triangles, the rest is left out",
        ) },
        .{ "\"material\":0", "\"material\":1", wrong("meshes[0].primitives[0].material: 1 of 1") },
        .{ "\"material\":0", "\"material\":4294967295", wrong(
            "meshes[0].primitives[0].material: 4294967295 names nothing, lists have 4194304 " ++
                "elements at most",
        ) },
        .{ "\"material\":0,", "", .fine },
        .{ "\"POSITION\":0", "\"POSITION\":3", wrong(
            "mesh 0, primitive 0: accessor 3 has no type for 'POSITION'",
        ) },
        .{ "\"POSITION\":0", "\"POSITION\":4", .fine },
        .{
            "\"POSITION\":0",
            "\"_POSITION\":0",
            odd("mesh 0, primitive 0: without POSITION, not drawn"),
        },
        .{ "\"POSITION\":0", "\"POSITION\":0,\"POSITION\":0", wrong(
            "mesh 0, primitive 0: 'POSITION' stands twice",
        ) },
        .{ "\"POSITION\":0", "\"POSITION\":9", wrong(
            "meshes[0].primitives[0].attributes.POSITION: 9 of 9",
        ) },
        .{ "\"NORMAL\":1", "\"NORMAL\":5", wrong(
            "mesh 0, primitive 0: accessor 5 has no type for 'NORMAL'",
        ) },
        .{ "\"COLOR_0\":2", "\"COLOR_0\":7", odd(
            "accessor 7: colours in whole numbers, taken as normalised",
        ) },
        .{ "\"COLOR_0\":2", "\"COLOR_0\":5", wrong(
            "mesh 0, primitive 0: accessor 5 has no type for 'COLOR_0'",
        ) },
        .{ "\"COLOR_0\":2", "\"COLOR_x\":2", .fine },
        .{
            "\"JOINTS_0\":7",
            "\"JOINTS_0\":0",
            wrong("mesh 0, primitive 0: accessor 0 has no type for 'JOINTS_0'"),
        },
        .{ "\"joints\":[3,0]", "\"joints\":[3]", wrong("mesh 0: joint 1 of 1") },
        .{ "\"joints\":[3,0]", "\"joints\":[3,0,1]", wrong(
            "skin 0: 2 inverseBindMatrices for 3 joints",
        ) },
        .{ "\"joints\":[3,0]", "\"joints\":[3,4]", wrong("skins[0].joints[1]: 4 of 4") },
        .{ "\"inverseBindMatrices\":8", "\"inverseBindMatrices\":0", wrong(
            "skin 0: inverseBindMatrices have to be 4 x 4 floats",
        ) },
        .{ "[{\"POSITION\":4}]", "[{\"POSITION\":3}]", odd(
            "mesh 0, primitive 0: accessor 3 has 6 elements for 4 vertices; nothing drawn needs it",
        ) },
        .{
            "[{\"weights\":[0]",
            "[{\"weights\":[0,0]",
            wrong("mesh 0: 2 weights for 1 morph targets"),
        },
        .{ "\"skin\":0,\"weights\":[0]", "\"skin\":0,\"weights\":[0,1]", wrong(
            "node 1: 2 weights for 1 morph targets",
        ) },
        .{ "\"skin\":0,\"weights\":[0]", "\"skin\":0,\"weights\":[1]", .fine },
    });
}

const no_data = "accessor 0: its buffer has no data";

test "accessors, views and buffers" {
    try expectChanges(&.{
        .{
            "\"count\":4,\"type\"",
            "\"count\":5,\"type\"",
            wrong("accessor 0: 12 bytes past its buffer view 0"),
        },
        .{ "\"count\":4,\"type\"", "\"count\":0,\"type\"", odd(
            "mesh 0, primitive 0: its vertices or indices are empty, not drawn",
        ) },
        .{ "\"count\":4,\"type\"", "\"count\":40e-1,\"type\"", .fine },
        .{ "\"count\":4,\"type\"", "\"count\":4.5,\"type\"", wrong(
            "accessors[0].count: 4.5 is not a whole number from 0 to 2^53 - 1",
        ) },
        .{ "\"count\":4,\"type\"", "\"count\":357913943,\"type\"", wrong(
            "accessor 0: 4294967268 bytes past its buffer view 0",
        ) },
        .{ "\"count\":4,\"type\"", "\"count\":2147483648,\"type\"", wrong(
            "accessor 0: count 2147483648 is over the limit of 2147483647",
        ) },
        .{
            "\"count\":4,\"type\":\"VEC3\",\n",
            "\"count\":4,\"type\":\"VEC9\",\n",
            wrong("accessor 0: unknown type"),
        },
        .{ "5126,", "5124,", wrong("accessor 0: unknown componentType") },
        .{ "\"bufferView\":0,", "\"bufferView\":\"0\",", wrong(
            "accessors[0].bufferView: a whole number is expected",
        ) },
        .{ "\"bufferView\":0,", "\"bufferView\":9,", wrong("accessors[0].bufferView: 9 of 9") },
        .{ "\"bufferView\":0,", "\"bufferView\":0,\"byteOffset\":2,", wrong(
            "accessor 0: 2 bytes past its buffer view 0",
        ) },
        .{
            "\"bufferView\":0,",
            "\"bufferView\":0,\"byteOffset\":9007199254740991,",
            wrong(if (@sizeOf(usize) == 8)
                "accessor 0: 9007199254740991 bytes past its buffer view 0"
            else
                "accessors[0].byteOffset: 9007199254740991 is too large"),
        },
        .{
            "{\"componentType\":5126,\"count\":4",
            "{\"componentType\":5126,\"count\":16777217",
            odd("accessor 4: 16777217 elements without data are over the limit of 16777216; " ++
                "nothing drawn needs it (and 1 more)"),
        },
        .{ "{\"count\":1,", "{\"count\":0,", odd("accessor 0: no sparse values") },
        .{ "{\"count\":1,", "{\"count\":5,", wrong("accessor 0: 5 sparse values for 4 elements") },
        .{ "{\"count\":1,", "{\"count\":2,", wrong(
            "accessor 0: sparse indices: 2 bytes past its buffer view 4",
        ) },
        .{
            "\"bufferView\":4,\"componentType\":5123",
            "\"bufferView\":4,\"componentType\":5126",
            wrong("accessor 0: bad componentType of sparse indices"),
        },
        .{
            "\"bufferView\":4,\"componentType\":5123",
            "\"bufferView\":2,\"byteOffset\":1,\"componentType\":5123",
            wrong("accessor 0: sparse index 256 of 4 elements"),
        },
        .{ "\"indices\":{\"bufferView\":4", "\"indices\":{\"bufferView\":2", .fine },
        .{ "\"byteStride\":12", "\"byteStride\":8", wrong(
            "accessor 1: elements of 12 bytes do not fit the byteStride 8 of buffer view 1",
        ) },
        .{ "\"byteStride\":12", "\"byteStride\":2", wrong(
            "accessor 1: elements of 12 bytes do not fit the byteStride 2 of buffer view 1",
        ) },
        .{ "\"byteStride\":12", "\"byteStride\":256", wrong(
            "buffer view 1: byteStride 256 is not in 4..252",
        ) },
        .{ "\"byteStride\":12", "\"byteStride\":13", wrong(
            "accessor 1: 3 bytes past its buffer view 1",
        ) },
        .{
            "\"byteLength\":48,\"byteStride\":12",
            "\"byteLength\":51,\"byteStride\":13",
            odd("buffer view 1: byteStride 13 is no multiple of 4"),
        },
        .{ "{\"buffer\":0,\"byteOffset\":140", "{\"buffer\":0,\"byteOffset\":139", odd(
            "accessor 5: byte 139 of buffer 0 is not aligned to 4 bytes",
        ) },
        .{ "\"byteOffset\":188,\"byteLength\":128", "\"byteOffset\":188,\"byteLength\":129", wrong(
            "buffer view 8: 1 bytes past its buffer 0",
        ) },
        .{ "\"byteOffset\":124,\"byteLength\":2", "\"byteOffset\":124,\"byteLength\":0", wrong(
            "buffer view 4: byteLength is 0",
        ) },
        .{
            "\"byteLength\":316",
            "\"byteLength\":315",
            odd("buffer view 8: 1 bytes past the byteLength of its buffer 0, where more is"),
        },
        .{ "\"byteLength\":316", "\"byteLength\":317", odd(
            "buffer 0: has 316 bytes, its byteLength is 317; nothing drawn needs more",
        ) },
        .{ "\"byteLength\":316", "\"byteLength\":2147483647", wrong(
            "buffer 0: byteLength 2147483647 is more than its data URI holds",
        ) },
        .{ "\"byteLength\":316,\"uri\"", "\"byteLength\":316,\"url\"", wrong(no_data) },
        .{ ";base64,", ",", wrong("buffer 0: its data URI is not base64") },
        .{ ";base64,", ";base64,*", wrong("buffer 0: its data URI is not valid base64") },
        .{ "application/octet-stream", "application\\/octet-\\u0073tream", .fine },
    });
}

/// What one change of the buffer's bytes does.
fn expectBytes(offset: usize, bytes: []const u8, expected: Expected) !void {
    var buffer = makeBuffer();
    @memcpy(buffer[offset..][0..bytes.len], bytes);
    const glb = try makeBinary(&buffer);
    defer gpa.free(glb);
    try expectOutcome(glb, expected);
}

test "numbers in buffers" {
    const nan = "\x00\x00\xc0\x7f";
    const infinity = "\x00\x00\x80\xff";
    try expectBytes(0, nan, wrong("accessor 0: element 0 is not finite"));
    try expectBytes(44, infinity, wrong("accessor 0: element 3 is not finite"));
    try expectBytes(128, nan, wrong("accessor 0: element 2 is not finite"));
    try expectBytes(24, nan, .fine); // Replaced by a sparse value.
    try expectBytes(48, infinity, odd("accessor 1: 1 of 4 normals are not finite, left out"));
    try expectBytes(168, nan, .fine); // No texture looks there.
    try expectBytes(188, nan, wrong("accessor 8: element 0 is not finite"));
    try expectBytes(96, "\x04\x00", wrong("accessor 3: index 4 with 4 vertices"));
    try expectBytes(96, "\xff\xff", wrong("accessor 3: index 65535 with 4 vertices"));
    try expectBytes(124, "\x04", wrong("accessor 0: sparse index 4 of 4 elements"));
    try expectBytes(172, "\x02", wrong("mesh 0: joint 2 of 2"));
    const flat: [12]u8 = @splat(1);
    try expectBytes(96, std.mem.sliceAsBytes(&[_]u16{ 1, 1, 2, 0, 0, 0 }), odd(
        "nothing to render: every triangle uses a vertex twice",
    ));
    try expectBytes(48, &flat, .fine);
}

test "indices of points and lines" {
    var bytes = makeBuffer();
    const modes = [4][]const u8{ "\"mode\":0", "\"mode\":1", "\"mode\":2", "\"mode\":3" };
    for (modes, 0..) |mode, number| {
        bytes[96] = 0;
        var expected: []const u8 = "";
        for ([_][]const u8{ "\"count\":6", "\"count\":5" }) |count| {
            const whole = try texts.make(document, &bytes, &.{});
            defer gpa.free(whole);
            const other = try texts.replace(whole, "\"mode\":4", mode);
            defer gpa.free(other);
            const text = try texts.replace(other, "\"count\":6", count);
            defer gpa.free(text);
            var said: Diagnostic = .{};
            try tryParse(gpa, text, &said);
            if (said.warning_count > 0) {
                expected = mode;
                const odd_line = "mesh 0, primitive 0: 5 vertices do not make whole lines, " ++
                    "the rest is left out";
                try std.testing.expectEqualStrings(odd_line, said.warnings[0].text());
            }
        }
        try std.testing.expectEqual(number == 1, expected.len > 0);
        bytes[96] = 4;
        const whole = try texts.make(document, &bytes, &.{});
        defer gpa.free(whole);
        const text = try texts.replace(whole, "\"mode\":4", mode);
        defer gpa.free(text);
        var said: Diagnostic = .{};
        try std.testing.expectError(error.InvalidInput, tryParse(gpa, text, &said));
        const line = "accessor 3: index 4 with 4 vertices";
        try std.testing.expectEqualStrings(line, said.message.text());
    }
}

test "GLB headers and chunks" {
    const buffer = makeBuffer();
    const glb = try makeBinary(&buffer);
    defer gpa.free(glb);
    const chunk = glb.len - buffer.len - 8;
    var header_line: [80]u8 = undefined;
    const header_odd = try std.fmt.bufPrint(
        &header_line,
        "the GLB's chunks end at {d} bytes, its header says 4294967295",
        .{glb.len},
    );
    const cases = .{
        .{ 4, "\x01\x00\x00\x00", wrong("GLB version 1 is not supported, only 2") },
        .{ 4, "\x03\x00\x00\x00", wrong("GLB version 3 is not supported, only 2") },
        .{ 8, "\x00\x00\x00\x01", null },
        .{ 8, "\xff\xff\xff\xff", odd(header_odd) },
        .{ 16, "JSOM", wrong("GLB does not begin with a JSON chunk") },
        .{ 12, "\x01\x00\x00\x00", wrong("GLB chunk 0: length 1 is no multiple of 4") },
        .{ chunk + 4, "XYZ\x00", wrong(no_data) },
        .{ 12, "\x00\x00\x00\x80", null },
    };
    inline for (cases) |case| {
        const changed = try gpa.dupe(u8, glb);
        defer gpa.free(changed);
        @memcpy(changed[case[0]..][0..4], case[1]);
        if (@TypeOf(case[2]) != @TypeOf(null)) {
            try expectOutcome(changed, case[2]);
        } else {
            var said: Diagnostic = .{};
            try testing.expectError(error.InvalidInput, tryParse(gpa, changed, &said));
        }
    }
    const longer = try std.mem.concat(gpa, u8, &.{ glb, "junk" });
    defer gpa.free(longer);
    try expectOutcome(longer, odd("4 bytes behind the end of the GLB are ignored"));
}

test "a GLB cut anywhere is an error" {
    const buffer = makeBuffer();
    const glb = try makeBinary(&buffer);
    defer gpa.free(glb);
    for (0..glb.len) |length| {
        var said: Diagnostic = .{};
        try testing.expectError(error.InvalidInput, tryParse(gpa, glb[0..length], &said));
        try testing.expect(said.message.text().len > 0);
        // With a header that agrees, so that what comes after it is cut.
        const cut = try gpa.dupe(u8, glb[0..length]);
        defer gpa.free(cut);
        if (length >= 12) std.mem.writeInt(u32, cut[8..12], @intCast(length), .little);
        try testing.expectError(error.InvalidInput, tryParse(gpa, cut, &said));
    }
}

test "no changed byte crashes or leaks" {
    const buffer = makeBuffer();
    const text = try texts.make(document, &buffer, &.{});
    defer gpa.free(text);
    const glb = try makeBinary(&buffer);
    defer gpa.free(glb);
    var random_state: std.Random.DefaultPrng = .init(0x7261796c616e65);
    const random = random_state.random();
    const alphabet = "0123456789-.eE\"{}[],: \\untf/";
    for ([_][]u8{ text, glb }) |bytes| {
        for (bytes) |*byte| {
            const before = byte.*;
            defer byte.* = before;
            byte.* = if (random.boolean())
                alphabet[random.uintLessThan(usize, alphabet.len)]
            else
                before ^ @as(u8, 1) << random.int(u3);
            var said: Diagnostic = .{};
            tryParse(gpa, bytes, &said) catch |err| {
                try testing.expect(err != error.OutOfMemory);
                try testing.expect(said.message.text().len > 0);
            };
        }
    }
}

test "every allocation may fail" {
    const buffer = makeBuffer();
    const text = try texts.make(document, &buffer, &.{});
    defer gpa.free(text);
    const glb = try makeBinary(&buffer);
    defer gpa.free(glb);
    const one = struct {
        fn one(allocator: Allocator, bytes: []const u8) !void {
            var said: Diagnostic = .{};
            try tryParse(allocator, bytes, &said);
        }
    }.one;
    for ([_][]const u8{ text, glb }) |bytes| {
        try testing.checkAllAllocationFailures(gpa, one, .{bytes});
    }
}

test "buffers beside the scene, inside its folder and outside" {
    var temporary = testing.tmpDir(.{});
    defer temporary.cleanup();
    const folder = temporary.dir;
    const buffer = makeBuffer();
    try folder.createDir(io, "in", .default_dir);
    var inner = try folder.openDir(io, "in", .{});
    defer inner.close(io);
    try inner.writeFile(io, .{ .sub_path = "a b.bin", .data = &buffer });
    try folder.writeFile(io, .{ .sub_path = "out.bin", .data = &buffer });
    try inner.symLink(io, "../out.bin", "link.bin", .{});
    try inner.symLink(io, "a b.bin", "near.bin", .{});
    const uri = "data:application/octet-stream;base64,$DATA";
    const cases = [_]struct { []const u8, bool, ?[]const u8 }{
        .{ "a%20b.bin", false, null },
        .{ "./a b.bin", false, null },
        .{ "near.bin", false, null },
        .{ "../out.bin", true, null },
        .{ "%2e%2e/out.bin", true, null },
        .{ "link.bin", true, null },
        .{
            "../out.bin",
            false,
            "buffer 0: '../out.bin' is outside the scene's folder (see --allow-outside)",
        },
        .{
            "link.bin",
            false,
            "buffer 0: 'link.bin' is a link that leads outside the scene's folder " ++
                "(see --allow-outside)",
        },
        .{ "a%00.bin", true, "buffer 0: 'a?.bin' is not a valid path" },
        .{ ".", false, "buffer 0: '.' is a folder" },
        .{
            "http://localhost/a.bin",
            true,
            "buffer 0: URIs of the scheme 'http' are not read, only files and data",
        },
        .{ "no\\u0020such", false, "buffer 0: 'no such' does not exist" },
    };
    for (cases) |case| {
        const text = try texts.replace(document, uri, case[0]);
        defer gpa.free(text);
        var said: Diagnostic = .{};
        const settings: raylane.settings.Load = .{ .allow_outside = case[1] };
        if (parse.parseBytes(gpa, io, text, inner, settings, &said)) |parsed| {
            var scene = parsed;
            scene.deinit();
            try testing.expectEqual(null, case[2]);
        } else |err| {
            try testing.expect(err == error.InvalidInput or err == error.InputOutput);
            try testing.expectEqualStrings(case[2] orelse "", said.message.text());
        }
    }
}

test "the corpus comes out as its manifest says" {
    const corpus = "../shared/malformed";
    const cwd: std.Io.Dir = .cwd();
    const limit: std.Io.Limit = .limited(1 << 20);
    const manifest = cwd.readFileAlloc(io, corpus ++ "/manifest.tsv", gpa, limit) catch
        return error.SkipZigTest;
    defer gpa.free(manifest);
    var lines = std.mem.tokenizeScalar(u8, manifest, '\n');
    var failed_count: usize = 0;
    var count: usize = 0;
    while (lines.next()) |line| {
        var columns = std.mem.splitScalar(u8, line, '\t');
        const name = columns.next().?;
        const expected = columns.next() orelse continue;
        const path = try std.fs.path.join(gpa, &.{ corpus, name });
        defer gpa.free(path);
        count += 1;
        const outcome = outcomeOf(path);
        if (std.mem.eql(u8, expected, outcome)) continue;
        // That a picture is empty is worth a warning, whatever the reason.
        const is_empty = std.mem.find(u8, line, "{policy:nothing-to-render}") != null;
        if (is_empty and std.mem.eql(u8, outcome, "warn")) continue;
        failed_count += 1;
        std.debug.print("{s}: {s} instead of {s}\n", .{ name, outcome, expected });
    }
    try testing.expect(count > 0);
    try testing.expectEqual(0, failed_count);
}

fn outcomeOf(path: []const u8) []const u8 {
    var said: Diagnostic = .{};
    var scene = parse.parse(gpa, io, path, .{}, &said) catch |err| switch (err) {
        error.InvalidInput, error.InputOutput => {
            return if (said.message.text().len > 0) "error" else "an error without a message";
        },
        error.OutOfMemory => return "out of memory",
        error.SceneUnknown, error.MaterialVariantUnknown => unreachable, // None is asked for.
    };
    defer scene.deinit();
    scene.check();
    // Whether an image is broken shows when it is decoded.
    var pool: raylane.parallel.Pool = .init(2);
    defer pool.deinit();
    var times: raylane.statistics.StageTimes = .{};
    const settings: raylane.prepare.LoadSettings = .{ .pool = &pool };
    var loaded = raylane.prepare.load(gpa, io, &scene, settings, &said, &times) catch |err|
        return @errorName(err);
    loaded.deinit();
    return if (said.warning_count > 0) "warn" else "ok";
}
