//! KHR_mesh_quantization: vertices of every type of number, and what morph targets add to them.
//!
//! In: one triangle whose accessors all read the same bytes, as other types in each round. Out: the
//! numbers that the tables of the extension give them.

const std = @import("std");
const raylane = @import("raylane");
const Diagnostic = raylane.diagnostic.Diagnostic;
const Scene = raylane.scene.Scene;
const testing = std.testing;
const gpa = testing.allocator;

/// The types of accessors are numbered as their attributes; images are not looked at here.
const document =
    \\{{"asset":{{"version":"2.0"}},"extensionsUsed":["KHR_mesh_quantization"],
    \\"extensionsRequired":["KHR_mesh_quantization"],"scene":0,"scenes":[{{"nodes":[0]}}],
    \\"nodes":[{{"mesh":0}}],"images":[{{"uri":"data:image/png;base64,AAAA"}}],
    \\"textures":[{{"source":0}}],"materials":[{{"normalTexture":{{"index":0}}}}],
    \\"meshes":[{{"weights":[1],"primitives":[{{"material":0,
    \\"attributes":{{"POSITION":0,"NORMAL":1,"TANGENT":2,"TEXCOORD_0":3}},
    \\"targets":[{{"POSITION":4,"NORMAL":5,"TANGENT":6}}]}}]}}],
    \\"accessors":[
    \\{{"bufferView":0,"type":"VEC3","count":3,"componentType":{d},"normalized":{}}},
    \\{{"bufferView":0,"type":"VEC3","count":3,"componentType":{d},"normalized":{}}},
    \\{{"bufferView":0,"type":"VEC4","count":3,"componentType":{d},"normalized":{}}},
    \\{{"bufferView":0,"type":"VEC2","count":3,"componentType":{d},"normalized":{}}},
    \\{{"bufferView":0,"type":"VEC3","count":3,"componentType":{d},"normalized":{}}},
    \\{{"bufferView":0,"type":"VEC3","count":3,"componentType":{d},"normalized":{}}},
    \\{{"bufferView":0,"type":"VEC3","count":3,"componentType":{d},"normalized":{}}}],
    \\"bufferViews":[{{"buffer":0,"byteLength":24,"byteStride":8}}],
    \\"buffers":[{{"byteLength":24,"uri":"data:application/octet-stream;base64,{s}"}}]}}
;

const stride = 8;
const bytes = [3 * stride]u8{
    0x00, 0x01, 0x7f, 0x80, 0xff, 0xfe, 0x80, 0x80, //
    0x12, 0x34, 0x56, 0x78, 0x9a, 0xbc, 0xde, 0x01, //
    0xff, 0xff, 0x00, 0x80, 0x01, 0x80, 0x00, 0x00,
};

/// A componentType, and whether its numbers are normalised.
const Kind = struct {
    component: u16,
    normalized: bool,

    /// A number of an element (glTF 2.0, section 3.11).
    fn number(kind: Kind, element: usize, index: usize) f32 {
        const at = bytes[stride * element ..];
        const value: f64, const largest: f64 = switch (kind.component) {
            5120 => .{ @floatFromInt(@as(i8, @bitCast(at[index]))), 127 },
            5121 => .{ @floatFromInt(at[index]), 255 },
            5122 => .{ @floatFromInt(whole(i16, at[2 * index ..])), 32767 },
            5123 => .{ @floatFromInt(whole(u16, at[2 * index ..])), 65535 },
            else => unreachable,
        };
        return @floatCast(if (kind.normalized) @max(value / largest, -1) else value);
    }

    fn expect(kind: Kind, found: anytype) !void {
        for (found, 0..) |element, at| for (element, 0..) |value, index| {
            errdefer std.debug.print("{d} {}\n", .{ kind.component, kind.normalized });
            const expected = kind.number(at, index);
            try testing.expect(@abs(expected - value) <= 1e-6 * @abs(expected));
        };
    }
};

fn whole(comptime T: type, at: []const u8) T {
    return std.mem.readInt(T, at[0..2], .little);
}

/// The triangle with these types of its seven accessors.
fn read(kinds: [7]Kind, said: *Diagnostic) !Scene {
    var digits: [32]u8 = undefined;
    const encoded = std.base64.standard.Encoder.encode(&digits, &bytes);
    const text = try gpa.print(document, .{
        kinds[0].component, kinds[0].normalized, kinds[1].component, kinds[1].normalized,
        kinds[2].component, kinds[2].normalized, kinds[3].component, kinds[3].normalized,
        kinds[4].component, kinds[4].normalized, kinds[5].component, kinds[5].normalized,
        kinds[6].component, kinds[6].normalized, encoded,
    });
    defer gpa.free(text);
    return raylane.parse.parseBytes(gpa, testing.io, text, .cwd(), .{}, said);
}

test "positions, directions and coordinates of every type, with morph targets" {
    for (0..64) |round| {
        // Every pair of types of what is drawn and what is added to it.
        const any: Kind = .{
            .component = @intCast(5120 + round % 4),
            .normalized = round / 4 % 2 == 1,
        };
        const signed: Kind = .{
            .component = if (round / 8 % 2 == 1) 5122 else 5120,
            .normalized = round / 16 % 2 == 1,
        };
        const other: Kind = .{
            .component = if (round / 32 % 2 == 1) 5122 else 5120,
            .normalized = round % 2 == 1,
        };
        var said: Diagnostic = .{};
        errdefer std.debug.print("{d}: {s}\n", .{ round, said.message.text() });
        var scene = try read(.{ any, other, signed, any, signed, signed, other }, &said);
        defer scene.deinit();
        scene.check();
        try testing.expectEqual(0, said.warning_count);
        const mesh = &scene.meshes[0];
        const target = &mesh.morph_targets[0];
        try any.expect(mesh.positions);
        try any.expect(mesh.texcoords[0].?);
        try signed.expect(target.positions.?);
        // Directions are normalised in any case, so that they can be added.
        const direction: Kind = .{ .component = signed.component, .normalized = true };
        const other_direction: Kind = .{ .component = other.component, .normalized = true };
        try other_direction.expect(mesh.normals.?);
        try direction.expect(target.normals.?);
        try other_direction.expect(target.tangents.?);
        for (mesh.tangents.?, 0..) |tangent, vertex| {
            for (0..3) |axis| {
                const expected = direction.number(vertex, axis);
                try testing.expect(@abs(expected - tangent[axis]) <= 1e-6);
            }
            const is_left = direction.number(vertex, 3) < 0;
            try testing.expectEqual(@as(f32, if (is_left) -1 else 1), tangent[3]);
        }
    }
}

test "directions have signs" {
    const fine: Kind = .{ .component = 5122, .normalized = true };
    for ([_]struct { usize, u16, []const u8 }{
        .{ 1, 5121, "accessor 1 has no type for 'NORMAL'" },
        .{ 2, 5123, "accessor 2 has no type for 'TANGENT'" },
    }) |case| {
        var kinds: [7]Kind = @splat(fine);
        kinds[case[0]] = .{ .component = case[1], .normalized = false };
        var said: Diagnostic = .{};
        try testing.expectError(error.InvalidInput, read(kinds, &said));
        const text = said.message.text();
        errdefer std.debug.print("{s}\n", .{text});
        try testing.expect(std.mem.find(u8, text, case[2]) != null);
    }
}
