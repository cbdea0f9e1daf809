//! EXT_mesh_gpu_instancing of glTF files: where the instances stand, from the file to the scene.
//!
//! In: a triangle at a node that draws it at three places. Out: nodes and instances as the
//! extension's text places them; one line where its accessors do not fit.

const std = @import("std");
const raylane = @import("raylane");
const texts = @import("gltf_text.zig");
const AffineD = raylane.math.AffineD;
const Diagnostic = raylane.diagnostic.Diagnostic;
const Replacement = texts.Replacement;
const testing = std.testing;
const gpa = testing.allocator;

/// `$DATA` stands for the buffer, in base64.
const document =
    \\{"asset":{"version":"2.0"},"extensionsUsed":["EXT_mesh_gpu_instancing"],
    \\"extensionsRequired":["EXT_mesh_gpu_instancing"],"scenes":[{"nodes":[0]}],
    \\"nodes":[{"mesh":0,"translation":[100,0,0],"children":[1],"extensions":{
    \\"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":1,"ROTATION":2,"SCALE":3,"_ID":4}}}},
    \\{"mesh":0}],
    \\"meshes":[{"primitives":[{"attributes":{"POSITION":0}},{"attributes":{"POSITION":0}}]}],
    \\"accessors":[
    \\{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
    \\{"bufferView":1,"componentType":5126,"count":3,"type":"VEC3"},
    \\{"bufferView":2,"componentType":5122,"count":3,"type":"VEC4","normalized":true},
    \\{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
    \\{"bufferView":0,"componentType":5126,"count":1,"type":"VEC3"},
    \\{"bufferView":3,"componentType":5126,"count":3,"type":"VEC4"},
    \\{"componentType":5126,"count":16777215,"type":"VEC3"}],
    \\"bufferViews":[
    \\{"buffer":0,"byteOffset":0,"byteLength":36},
    \\{"buffer":0,"byteOffset":36,"byteLength":36},
    \\{"buffer":0,"byteOffset":72,"byteLength":24},
    \\{"buffer":0,"byteOffset":96,"byteLength":48}],
    \\"buffers":[{"byteLength":144,"uri":"data:application/octet-stream;base64,$DATA"}]}
;

/// Positions, which are the scales as well; translations; rotations in 16 bits; in floats.
fn makeBuffer() [144]u8 {
    var bytes: [144]u8 = @splat(0);
    texts.putFloats(bytes[0..], &.{ 1, 2, 3, -1, 1, 1, 1, 1, 0 });
    texts.putFloats(bytes[36..], &.{ 0, 0, 0, 0, 5, 0, 0, 0, -7 });
    const turns = [12]i16{ 0, 0, 0, 32767, 0, 0, 23170, 23170, 32767, 0, 0, 0 };
    for (turns, 0..) |component, index| {
        std.mem.writeInt(i16, bytes[72 + 2 * index ..][0..2], component, .little);
    }
    texts.putFloats(bytes[96..], &.{ 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 1 });
    return bytes;
}

fn read(replacements: []const Replacement, said: *Diagnostic) !raylane.scene.Scene {
    const text = try texts.make(document, &makeBuffer(), replacements);
    defer gpa.free(text);
    const scene = try raylane.parse.parseBytes(gpa, testing.io, text, .cwd(), .{}, said);
    scene.check();
    return scene;
}

test "a mesh stands where the extension puts it, below its node, and not at the node itself" {
    const half = @sqrt(0.5);
    const turned: AffineD = .fromTrs(.{ 0, 5, 0 }, .{ 0, 0, half, half }, .{ -1, 1, 1 });
    var said: Diagnostic = .{};
    var scene = try read(&.{}, &said);
    defer scene.deinit();
    try testing.expectEqual(0, said.warning_count);
    try testing.expectEqual(5, scene.nodes.len);
    // Both parts at each place, then those of the child, which is not instanced.
    try testing.expectEqual(8, scene.instances.len);
    for (scene.instances, [8]u32{ 2, 2, 3, 3, 4, 4, 1, 1 }, 0..) |instance, node, index| {
        try testing.expectEqual(node, instance.node);
        try testing.expectEqual(index % 2, instance.mesh);
    }
    for (scene.nodes[1..]) |node| try testing.expectEqual(0, node.parent);
    const first: AffineD = .fromTrs(.{ 0, 0, 0 }, .{ 0, 0, 0, 1 }, .{ 1, 2, 3 });
    try testing.expectEqual(first, scene.nodes[2].local);
    try testing.expectEqual(turned.translation, scene.nodes[3].local.translation);
    for (turned.x, scene.nodes[3].local.x) |wanted, value| {
        try testing.expectApproxEqAbs(wanted, value, 1e-9);
    }
    const flipped: AffineD = .fromTrs(.{ 0, 0, -7 }, .{ 1, 0, 0, 0 }, .{ 1, 1, 0 });
    try testing.expectEqual(flipped, scene.nodes[4].local);
}

test "any of the attributes, and what is wrong with them" {
    const all = "\"TRANSLATION\":1,\"ROTATION\":2,\"SCALE\":3,\"_ID\":4";
    const read_cases = [_]struct { []const u8, usize, ?[]const u8 }{
        .{ "\"TRANSLATION\":1", 8, null },
        .{ "\"_ID\":4", 4, null },
        .{ "", 4, "node 0: EXT_mesh_gpu_instancing without attributes: drawn once" },
        .{
            "\"ROTATION\":5",
            8,
            "node 0: 2 rotations of EXT_mesh_gpu_instancing are no unit quaternions, made such",
        },
    };
    for (read_cases) |case| {
        var said: Diagnostic = .{};
        var scene = try read(&.{.{ all, case[0] }}, &said);
        defer scene.deinit();
        try testing.expectEqual(case[1], scene.instances.len);
        try testing.expectEqual(@intFromBool(case[2] != null), said.warning_count);
        if (case[2]) |text| try testing.expectEqualStrings(text, said.warnings[0].text());
    }
    const bad_cases = [_]struct { []const u8, []const u8 }{
        .{
            "\"TRANSLATION\":1,\"SCALE\":4",
            "node 0: accessor 4 has 1 elements for 3 instances",
        },
        .{
            "\"TRANSLATION\":2",
            "node 0: accessor 2 has no type for TRANSLATION of EXT_mesh_gpu_instancing",
        },
        .{ "\"_ID\":6", "node 0: over 16777216 instances of meshes" },
    };
    for (bad_cases) |case| {
        var said: Diagnostic = .{};
        try testing.expectError(error.InvalidInput, read(&.{.{ all, case[0] }}, &said));
        try testing.expectEqualStrings(case[1], said.message.text());
    }
}
