//! Morph targets and skins of glTF files: where the vertices of a strip stand that two joints bend,
//! or that targets change, from the file to the world.
//!
//! In: a strip of 2 by 3 vertices, changed in some places. Out: positions and normals that follow
//! from glTF 2.0, sections 3.7.2.2 and 3.7.3; errors and warnings where a skin is broken.

const std = @import("std");
const raylane = @import("raylane");
const fixture = @import("fixture.zig");
const texts = @import("gltf_text.zig");
const Diagnostic = raylane.diagnostic.Diagnostic;
const Replacement = texts.Replacement;
const Vec3 = raylane.math.Vec3;
const World = raylane.world.World;
const testing = std.testing;
const gpa = testing.allocator;

/// The skinned node stands elsewhere and has no size: its joints place it. They are not in the
/// scene that is shown. `$DATA` stands for the buffer, in base64.
const document =
    \\{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
    \\"extensionsUsed":["KHR_mesh_quantization"],
    \\"nodes":[{"mesh":0,"skin":0,"translation":[100,0,0],"scale":[0,0,0]},
    \\{"children":[2]},{"children":[3]},
    \\{"translation":[0,1,0],"rotation":[0,0,0.7071067811865476,0.7071067811865476]},{"mesh":0}],
    \\"skins":[{"joints":[2,3],"inverseBindMatrices":4}],
    \\"meshes":[{"primitives":[{"attributes":{"POSITION":0,"NORMAL":1,"COLOR_0":11,
    \\"JOINTS_0":2,"WEIGHTS_0":3},"indices":7}]}],
    \\"accessors":[
    \\{"bufferView":0,"componentType":5126,"count":6,"type":"VEC3"},
    \\{"bufferView":1,"componentType":5126,"count":6,"type":"VEC3"},
    \\{"bufferView":2,"componentType":5121,"count":6,"type":"VEC4"},
    \\{"bufferView":3,"componentType":5126,"count":6,"type":"VEC4"},
    \\{"bufferView":4,"componentType":5126,"count":2,"type":"MAT4"},
    \\{"bufferView":5,"componentType":5123,"count":6,"type":"VEC4"},
    \\{"bufferView":6,"componentType":5121,"count":6,"type":"VEC4","normalized":true},
    \\{"bufferView":7,"componentType":5123,"count":12,"type":"SCALAR"},
    \\{"bufferView":8,"componentType":5126,"count":6,"type":"VEC3"},
    \\{"componentType":5126,"count":6,"type":"VEC3","sparse":{"count":1,
    \\"indices":{"bufferView":9,"componentType":5123},"values":{"bufferView":10}}},
    \\{"bufferView":11,"componentType":5122,"count":6,"type":"VEC3","normalized":true},
    \\{"bufferView":12,"componentType":5121,"count":6,"type":"VEC4","normalized":true},
    \\{"bufferView":13,"componentType":5121,"count":6,"type":"VEC3","normalized":true}],
    \\"bufferViews":[
    \\{"buffer":0,"byteOffset":0,"byteLength":72},
    \\{"buffer":0,"byteOffset":72,"byteLength":72},
    \\{"buffer":0,"byteOffset":144,"byteLength":24},
    \\{"buffer":0,"byteOffset":168,"byteLength":96},
    \\{"buffer":0,"byteOffset":264,"byteLength":128},
    \\{"buffer":0,"byteOffset":392,"byteLength":48},
    \\{"buffer":0,"byteOffset":440,"byteLength":24},
    \\{"buffer":0,"byteOffset":464,"byteLength":24},
    \\{"buffer":0,"byteOffset":488,"byteLength":72},
    \\{"buffer":0,"byteOffset":560,"byteLength":2},
    \\{"buffer":0,"byteOffset":564,"byteLength":12},
    \\{"buffer":0,"byteOffset":576,"byteLength":48,"byteStride":8},
    \\{"buffer":0,"byteOffset":624,"byteLength":24},
    \\{"buffer":0,"byteOffset":648,"byteLength":24,"byteStride":4}],
    \\"buffers":[{"byteLength":672,"uri":"data:application/octet-stream;base64,$DATA"}]}
;

const Buffer = [672]u8;

fn makeBuffer() Buffer {
    var bytes: Buffer = @splat(0);
    for (0..6) |vertex| {
        const x: f32 = @floatFromInt(vertex % 2);
        const row = vertex / 2;
        texts.putFloats(bytes[12 * vertex ..], &.{ x, @floatFromInt(row), 0 });
        texts.putFloats(bytes[72 + 12 * vertex ..], &.{ 0, 0, 1 });
        bytes[144 + 4 * vertex ..][0..4].* = .{ 0, 1, 0, 0 };
        const weights = [3][2]f32{ .{ 1, 0 }, .{ 0.5, 0.5 }, .{ 0, 1 } };
        texts.putFloats(bytes[168 + 16 * vertex ..], &weights[row]);
        // The second set: joint 1, 0 and 1 with the same weight as all of the first.
        bytes[392 + 8 * vertex] = @intCast((row + 1) % 2);
        bytes[440 + 4 * vertex] = 255;
        texts.putFloats(bytes[488 + 12 * vertex ..], &.{ 0, 0, 1 });
        std.mem.writeInt(i16, bytes[576 + 8 * vertex ..][0..2], 32767, .little);
        bytes[624 + 4 * vertex ..][0..4].* = .{ 255, 0, 51, 255 };
        bytes[648 + 4 * vertex ..][0..3].* = .{ 255, 51, 0 };
    }
    for (0..2) |matrix| for (0..4) |axis| {
        texts.putFloats(bytes[264 + 64 * matrix + 20 * axis ..], &.{1});
    };
    texts.putFloats(bytes[264 + 64 + 52 ..], &.{-1}); // Joint 1 is bound at (0, 1, 0).
    for ([12]u16{ 0, 1, 3, 0, 3, 2, 2, 3, 5, 2, 5, 4 }, 0..) |corner, index| {
        std.mem.writeInt(u16, bytes[464 + 2 * index ..][0..2], corner, .little);
    }
    bytes[560] = 5;
    texts.putFloats(bytes[564..], &.{ 0, 3, 0 });
    return bytes;
}

/// The document with each first occurrence replaced, read. `said` gets the messages.
fn read(
    buffer: *const Buffer,
    replacements: []const Replacement,
    said: *Diagnostic,
) !raylane.scene.Scene {
    const text = try texts.make(document, buffer, replacements);
    defer gpa.free(text);
    const scene = try raylane.parse.parseBytes(gpa, testing.io, text, .cwd(), .{}, said);
    scene.check();
    return scene;
}

/// Where the vertices are; the world is the caller's.
fn place(buffer: *const Buffer, replacements: []const Replacement) !World {
    var said: Diagnostic = .{};
    errdefer std.debug.print("{s}\n", .{said.message.text()});
    var scene = try read(buffer, replacements, &said);
    defer scene.deinit();
    for (said.warnings[0..said.warning_count]) |*warning| {
        std.debug.print("{s}\n", .{warning.text()});
        return error.TestUnexpectedResult;
    }
    return fixture.prepare(&scene, 4, .{});
}

fn expectPositions(replacements: []const Replacement, expected: [6]Vec3) !void {
    const buffer = makeBuffer();
    var world = try place(&buffer, replacements);
    defer world.deinit();
    try expectNear(&expected, world.geometry.positions);
}

fn expectNear(expected: []const Vec3, found: []const Vec3) !void {
    errdefer std.debug.print("{any}\n", .{found});
    try testing.expectEqual(expected.len, found.len);
    for (expected, found) |wanted, at| {
        for (wanted, at) |a, b| try testing.expectApproxEqAbs(a, b, 1e-6);
    }
}

/// Rows y = 0 as they are, y = 2 turned about (0, 1), y = 1 between both.
const bent = [6]Vec3{
    .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 }, .{ 0.5, 1.5, 0 }, .{ -1, 1, 0 }, .{ -1, 2, 0 },
};

test "two joints bend a strip, wherever its own node is" {
    try expectPositions(&.{}, bent);
    // Joints of the shown scene, and those of which it shows but one.
    try expectPositions(&.{.{ "[{\"nodes\":[0]}]", "[{\"nodes\":[0,1]}]" }}, bent);
    try expectPositions(&.{.{ "[{\"nodes\":[0]}]", "[{\"nodes\":[1,0]}]" }}, bent);
    // Without matrices joints are bound at the origin.
    try expectPositions(&.{.{ ",\"inverseBindMatrices\":4", "" }}, .{
        .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ -0.5, 1, 0 }, .{ 0, 1.5, 0 }, .{ -2, 1, 0 }, .{ -2, 2, 0 },
    });
}

test "joints below a scaled or mirroring armature" {
    for ([_]Vec3{ .{ 0.01, 0.01, 0.01 }, .{ -1, 1, 1 }, .{ -2, -3, -4 }, .{ 5, -1, 1 } }) |scale| {
        var number: [64]u8 = undefined;
        const armature = try std.fmt.bufPrint(
            &number,
            "{{\"children\":[2],\"scale\":[{d},{d},{d}]}}",
            .{ scale[0], scale[1], scale[2] },
        );
        var expected = bent;
        for (&expected) |*at| at.* = raylane.math.vec3.mul(at.*, scale);
        const buffer = makeBuffer();
        var world = try place(&buffer, &.{.{ "{\"children\":[2]}", armature }});
        defer world.deinit();
        const geometry = &world.geometry;
        try expectNear(&expected, geometry.positions);
        const front: Vec3 = .{ 0, 0, if (scale[2] < 0) -1 else 1 };
        for (geometry.normals) |normal| try expectNear(&.{front}, &.{normal});
        try testing.expectEqual(4, geometry.triangles.len);
        for (geometry.triangles) |triangle| {
            const vec3 = raylane.math.vec3;
            const corner = geometry.positions[triangle.corner[0]];
            const across = vec3.cross(
                vec3.sub(geometry.positions[triangle.corner[1]], corner),
                vec3.sub(geometry.positions[triangle.corner[2]], corner),
            );
            try testing.expect(vec3.dot(across, front) > 0);
        }
    }
}

test "eight joints a vertex, and weights that do not sum up to 1" {
    const more: Replacement = .{
        "\"WEIGHTS_0\":3", "\"WEIGHTS_0\":3,\"JOINTS_1\":5,\"WEIGHTS_1\":6",
    };
    var expected = bent;
    expected[0..2].* = .{ .{ 0.5, 0.5, 0 }, .{ 1, 1, 0 } };
    expected[3] = .{ 0.75, 1.25, 0 };
    try expectPositions(&.{more}, expected);
    var buffer = makeBuffer();
    for (0..6) |vertex| {
        const factor: f32 = @floatFromInt(vertex + 2);
        const weights = [3][2]f32{ .{ 1, 0 }, .{ 0.5, 0.5 }, .{ 0, 1 } };
        const row = weights[vertex / 2];
        texts.putFloats(buffer[168 + 16 * vertex ..], &.{ factor * row[0], factor * row[1] });
    }
    // All 0: the first joint. What has no weight may be any joint.
    texts.putFloats(buffer[168..], &.{ 0, 0 });
    buffer[144 + 2] = 200;
    var world = try place(&buffer, &.{});
    defer world.deinit();
    try expectNear(&bent, world.geometry.positions);
}

test "normals go with the joints, of unit length" {
    var buffer = makeBuffer();
    for (0..6) |vertex| texts.putFloats(buffer[72 + 12 * vertex ..], &.{ 0.6, 0, 0.8 });
    const scaled: Replacement = .{ "{\"children\":[2]}", "{\"children\":[2],\"scale\":[1,1,2]}" };
    var world = try place(&buffer, &.{scaled});
    defer world.deinit();
    const length = @sqrt(@as(f32, 0.36 + 0.16));
    const x = 0.6 / length;
    const z = 0.4 / length;
    try expectNear(&.{ .{ x, 0, z }, .{ 0, x, z } }, &.{
        world.geometry.normals[0], world.geometry.normals[5],
    });
}

const targets: Replacement = .{
    "\"indices\":7",
    \\"indices":7,"targets":[{"POSITION":8,"COLOR_0":12},{"POSITION":9},{"POSITION":10}]
};

const placed: Replacement = .{ "\"scale\":[0,0,0]", "\"scale\":[1,2,1]" };

const unskinned: Replacement = .{ "\"skin\":0,", "" };

fn meshWeights(comptime list: []const u8) Replacement {
    return .{ "\"meshes\":[{", "\"meshes\":[{\"weights\":" ++ list ++ "," };
}

fn strip(offset: Vec3, last: Vec3) [6]Vec3 {
    var at: [6]Vec3 = undefined;
    for (&at, 0..) |*to, vertex| to.* = .{
        @as(f32, @floatFromInt(vertex % 2)) + offset[0],
        2 * @as(f32, @floatFromInt(vertex / 2)) + offset[1],
        offset[2],
    };
    at[5] = raylane.math.vec3.add(at[5], last);
    return at;
}

test "morph targets by the mesh's weights, or by the node's: floats, sparse and quantized" {
    const still = strip(.{ 100, 0, 0 }, .{ 0, 0, 0 });
    try expectPositions(&.{ unskinned, placed, targets }, still);
    try expectPositions(&.{ unskinned, placed, targets, meshWeights("[0,0,0]") }, still);
    const half = strip(.{ 100, 0, 0.5 }, .{ 0, 0, 0 });
    try expectPositions(&.{ unskinned, placed, targets, meshWeights("[0.5,0,0]") }, half);
    const own: Replacement = .{ "{\"mesh\":0,", "{\"weights\":[-2,0.5,4],\"mesh\":0," };
    const moved = strip(.{ 104, 0, -2 }, .{ 0, 3, 0 });
    try expectPositions(&.{ unskinned, placed, targets, meshWeights("[0.5,0,0]"), own }, moved);
    const none: Replacement = .{ "{\"mesh\":0,", "{\"weights\":[0,0,0],\"mesh\":0," };
    try expectPositions(&.{ unskinned, placed, targets, meshWeights("[0.5,0,0]"), none }, still);
}

test "the same mesh by two nodes with weights of their own" {
    const both: Replacement = .{ "[{\"nodes\":[0]}]", "[{\"nodes\":[0,4]}]" };
    const own: Replacement = .{ "{\"mesh\":0}", "{\"weights\":[0,0,1],\"mesh\":0}" };
    const buffer = makeBuffer();
    var world = try place(&buffer, &.{ targets, meshWeights("[0.5,0,0]"), both, own });
    defer world.deinit();
    var expected = bent;
    for (&expected) |*at| at[2] = 0.5; // Before the joints.
    try expectNear(&expected, world.geometry.positions[0..6]);
    for (world.geometry.positions[6..], 0..) |at, vertex| {
        const x: f32 = @floatFromInt(vertex % 2);
        try testing.expectEqual(Vec3{ x + 1, @floatFromInt(vertex / 2), 0 }, at);
    }
}

test "colours of morph targets are added, and kept within 0 and 1" {
    const buffer = makeBuffer();
    var world = try place(&buffer, &.{ unskinned, placed, targets, meshWeights("[0.5,0,0]") });
    defer world.deinit();
    for (world.geometry.colors) |color| for ([4]f32{ 1, 0.1, 0.2, 1 }, color) |wanted, value| {
        try testing.expectApproxEqAbs(wanted, value, 1e-6);
    };
    var other = try place(&buffer, &.{ unskinned, placed, targets, meshWeights("[-0.5,0,0]") });
    defer other.deinit();
    for (other.geometry.colors) |color| for ([4]f32{ 0.5, 0, 0.2, 1 }, color) |wanted, value| {
        try testing.expectApproxEqAbs(wanted, value, 1e-6);
    };
}

test "broken skins: an error or a warning" {
    const Case = struct {
        replacement: Replacement,
        message: []const u8,
        is_error: bool = true,
        place: usize = 0,
        byte: u8 = 0,
    };
    const cases = [_]Case{
        .{ .replacement = .{ "[2,3]", "[2]" }, .message = "mesh 0: joint 1 of 1" },
        .{
            .replacement = .{ "[2,3]", "[2,3,1]" },
            .message = "skin 0: 2 inverseBindMatrices for 3 joints",
        },
        .{ .replacement = .{ "[2,3]", "[2,9]" }, .message = "skins[0].joints[1]: 9 of 5" },
        .{
            .replacement = .{ "[2,3]", "[2,3]" },
            .message = "mesh 0: joint 7 of 2",
            .place = 144,
            .byte = 7,
        },
        .{
            .replacement = .{ ",\"WEIGHTS_0\":3", "" },
            .message = "mesh 0, primitive 0: JOINTS_0 or WEIGHTS_0 stands alone, and is left out",
            .is_error = false,
        },
        .{
            .replacement = .{ ",\n\"JOINTS_0\":2,\"WEIGHTS_0\":3", "" },
            .message = "mesh 0, primitive 0: has a skin but no joints, its node places it",
            .is_error = false,
        },
        .{
            .replacement = .{ "{\"children\":[2]},{\"children\":[3]}", "{},{\"children\":[3,2]}" },
            .message = "node 2: is its own ancestor, or hangs below a node that is",
        },
        .{
            .replacement = .{ "[2,3]", "[2,3]" },
            .message = "skin 0: inverseBindMatrices are not affine, their last rows are ignored",
            .is_error = false,
            .place = 264 + 15,
            .byte = 0x3f,
        },
        .{
            .replacement = .{ "[2,3]", "[2,3]" },
            .message = "accessor 3: weights below 0 are taken as 0",
            .is_error = false,
            .place = 168 + 3,
            .byte = 0xbf,
        },
        .{
            .replacement = .{
                "\"WEIGHTS_0\":3",
                "\"WEIGHTS_0\":3,\"JOINTS_2\":5,\"WEIGHTS_2\":6",
            },
            .message = "mesh 0, primitive 0: more than 8 joints a vertex, the rest is left out",
            .is_error = false,
        },
    };
    for (cases) |case| {
        errdefer std.debug.print("expected: {s}\n", .{case.message});
        var buffer = makeBuffer();
        if (case.byte != 0) buffer[case.place] = case.byte;
        var said: Diagnostic = .{};
        if (case.is_error) {
            const result = read(&buffer, &.{case.replacement}, &said);
            try testing.expectError(error.InvalidInput, result);
            try testing.expectEqualStrings(case.message, said.message.text());
            continue;
        }
        var scene = try read(&buffer, &.{case.replacement}, &said);
        defer scene.deinit();
        for (said.warnings[0..said.warning_count]) |*warning| {
            if (std.mem.eql(u8, warning.text(), case.message)) break;
        } else return error.TestUnexpectedResult;
        var world = try fixture.prepare(&scene, 4, .{});
        defer world.deinit();
    }
}

test "what no drawn node asks for is not read" {
    var said: Diagnostic = .{};
    const buffer = makeBuffer();
    var scene = try read(&buffer, &.{ unskinned, targets, meshWeights("[0,1,0]") }, &said);
    defer scene.deinit();
    try testing.expectEqual(0, scene.skins.len);
    try testing.expectEqual(1, scene.nodes.len);
    const mesh = &scene.meshes[0];
    try testing.expectEqual(0, mesh.joint_sets.len);
    try testing.expectEqual(3, mesh.morph_targets.len);
    try testing.expectEqual(null, mesh.morph_targets[0].positions);
    try testing.expectEqual(null, mesh.morph_targets[0].colors);
    try testing.expectEqual(Vec3{ 0, 3, 0 }, mesh.morph_targets[1].positions.?[5]);
    try testing.expectEqual(null, mesh.morph_targets[2].positions);
}

test "memory that runs out is an error that leaks nothing" {
    const buffer = makeBuffer();
    const text = try texts.make(document, &buffer, &.{ targets, meshWeights("[0.5,1,2]") });
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
