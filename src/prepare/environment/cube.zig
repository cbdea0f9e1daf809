//! Cubes of six images as environment maps.
//!
//! In: the files of the faces +x, -x, +y, -y, +z, -z, as they are seen from within (see
//! `scene.EnvironmentMap.Projection`). Out: the square of `math.equal_area` with four texels of a
//! face mixed, so that all that comes after knows squares alone.

const std = @import("std");
const decode = @import("../../decode.zig");
const math = @import("../../math.zig");
const Sky = @import("sky.zig").Sky;
const Texel = @import("../../world.zig").EnvironmentTexel;
const Allocator = std.mem.Allocator;
const Vec3d = math.Vec3d;

/// Radiance of a texel at most.
const radiance_max = 1e9;
/// Texels on the side of a face at most: six of them are in memory at once.
const face_side_max = 2048;

/// Reads a cube, as a square of at most `side_max` texels a side. On `InvalidImage` the reason says
/// why.
pub fn read(
    gpa: Allocator,
    files: *const [6][]const u8,
    side_max: u32,
    reason: *decode.Reason,
) decode.Error!Sky {
    var faces: [6]Sky = undefined;
    var count: usize = 0;
    defer for (faces[0..count]) |*face| face.deinit(gpa);
    for (&faces, files) |*face, bytes| {
        face.* = try readFace(gpa, bytes, reason);
        count += 1;
        if (face.width != face.height or face.width != faces[0].width) {
            reason.set("the faces of a cube have to be squares of the same size", .{});
            return error.InvalidImage;
        }
    }
    for (&faces) |*face| face.shrink(@max(side_max / 2, 1));
    const side = @min(2 * faces[0].width, side_max);
    const texels = try gpa.alloc(Texel, @as(usize, side) * side);
    const scale = 1 / @as(f64, @floatFromInt(side));
    for (texels, 0..) |*texel, index| {
        texel.* = at(&faces, math.equal_area.fromSquare(.{
            (@as(f64, @floatFromInt(index % side)) + 0.5) * scale,
            (@as(f64, @floatFromInt(index / side)) + 0.5) * scale,
        }));
    }
    return .{ .width = side, .height = side, .projection = .octahedral, .texels = texels };
}

/// Decodes a face; the colours of a PNG with alpha are divided by it (RGBD).
fn readFace(gpa: Allocator, bytes: []const u8, reason: *decode.Reason) decode.Error!Sky {
    const info = try decode.info(bytes, reason);
    if (info.width > face_side_max or info.height > face_side_max) {
        reason.set("faces of cubes are {d} texels wide at most", .{face_side_max});
        return error.InvalidImage;
    }
    var decoded = try decode.decode(gpa, bytes, reason);
    defer decoded.deinit(gpa);
    const face: Sky = try .init(gpa, &decoded, .equirectangular);
    const is_divided = decode.formatOf(bytes) == .png and decoded.channel_count == 4 and
        decoded.data == .bytes;
    if (is_divided) for (face.texels, 0..) |*texel, index| {
        const alpha = @as(f32, @floatFromInt(decoded.data.bytes[4 * index + 3])) / 255;
        if (!(alpha > 0)) continue;
        const divided = texel.* / @as(Texel, @splat(alpha));
        texel.* = @min(divided, @as(Texel, @splat(radiance_max)));
    };
    return face;
}

/// What is seen in a direction: the face of its largest component, and the place there.
fn at(faces: *const [6]Sky, direction: Vec3d) Texel {
    const x, const y, const z = direction;
    const size: Vec3d = .{ @abs(x), @abs(y), @abs(z) };
    const axis: usize = if (size[0] >= size[1] and size[0] >= size[2])
        0
    else if (size[1] >= size[2])
        1
    else
        2;
    const is_positive = direction[axis] > 0;
    // To the right and downwards, as it is seen from within.
    const right, const down = switch (axis) {
        0 => .{ if (is_positive) z else -z, -y },
        1 => .{ -x, if (is_positive) z else -z },
        else => .{ if (is_positive) -x else x, -y },
    };
    const face = &faces[2 * axis + @intFromBool(!is_positive)];
    return mixed(face, .{ 0.5 + 0.5 * right / size[axis], 0.5 + 0.5 * down / size[axis] });
}

/// Four texels of a face, whose edges are its last ones.
fn mixed(face: *const Sky, place: [2]f64) Texel {
    const last: f64 = @floatFromInt(face.width - 1);
    const across = clamp(place[0] * @as(f64, @floatFromInt(face.width)) - 0.5, last);
    const down = clamp(place[1] * @as(f64, @floatFromInt(face.width)) - 0.5, last);
    const column: usize = @intFromFloat(across);
    const row: usize = @intFromFloat(down);
    const next_column = @min(column + 1, face.width - 1);
    const next_row = @min(row + 1, face.width - 1);
    const share_right: Texel = @splat(@floatCast(across - @floor(across)));
    const share_below: Texel = @splat(@floatCast(down - @floor(down)));
    const upper = face.texels[row * face.width ..];
    const lower = face.texels[next_row * face.width ..];
    const above = upper[column] + (upper[next_column] - upper[column]) * share_right;
    const below = lower[column] + (lower[next_column] - lower[column]) * share_right;
    return above + (below - above) * share_below;
}

fn clamp(value: f64, largest: f64) f64 {
    return if (value < 0) 0 else if (value > largest) largest else value;
}

test "every direction is found on the face that shows it" {
    const side = 16;
    var texels: [6][side * side]Texel = undefined;
    var faces: [6]Sky = undefined;
    // Along, to the right and downwards of each face.
    const frames = [6][3]Vec3d{
        .{ .{ 1, 0, 0 }, .{ 0, 0, 1 }, .{ 0, -1, 0 } },
        .{ .{ -1, 0, 0 }, .{ 0, 0, -1 }, .{ 0, -1, 0 } },
        .{ .{ 0, 1, 0 }, .{ -1, 0, 0 }, .{ 0, 0, 1 } },
        .{ .{ 0, -1, 0 }, .{ -1, 0, 0 }, .{ 0, 0, -1 } },
        .{ .{ 0, 0, 1 }, .{ -1, 0, 0 }, .{ 0, -1, 0 } },
        .{ .{ 0, 0, -1 }, .{ 1, 0, 0 }, .{ 0, -1, 0 } },
    };
    for (&faces, &texels, frames) |*face, *all, frame| {
        // Seen from within, right is along cross up.
        const cross = math.vec3d.cross(frame[0], math.vec3d.scale(frame[2], -1));
        try std.testing.expectEqual(frame[1], math.vec3d.add(cross, .{ 0, 0, 0 }));
        for (all, 0..) |*texel, index| {
            const u = (@as(f64, @floatFromInt(index % side)) + 0.5) / side * 2 - 1;
            const v = (@as(f64, @floatFromInt(index / side)) + 0.5) / side * 2 - 1;
            const across = math.vec3d.scale(frame[1], u);
            const downwards = math.vec3d.scale(frame[2], v);
            const point = math.vec3d.add(frame[0], math.vec3d.add(across, downwards));
            const direction = math.vec3d.normalize(point).?;
            inline for (direction, 0..) |component, axis| texel[axis] = @floatCast(component);
            texel[3] = 0;
        }
        face.* = .{ .width = side, .height = side, .texels = all };
    }
    var random_state: std.Random.DefaultPrng = .init(5);
    for (0..2000) |_| {
        var point: Vec3d = undefined;
        for (&point) |*component| component.* = random_state.random().float(f64) - 0.5;
        const direction = math.vec3d.normalize(point) orelse continue;
        const found = at(&faces, direction);
        inline for (direction, 0..) |component, axis| {
            try std.testing.expectApproxEqAbs(component, found[axis], 0.06);
        }
    }
}

test "PNG with alpha is divided by it, and what is no cube is an error" {
    // One texel: 255, 188, 0 and alpha 51.
    const file =
        "\x89\x50\x4e\x47\x0d\x0a\x1a\x0a\x00\x00\x00\x0d\x49\x48\x44\x52\x00\x00\x00\x01" ++
        "\x00\x00\x00\x01\x08\x06\x00\x00\x00\x1f\x15\xc4\x89\x00\x00\x00\x0d\x49\x44\x41" ++
        "\x54\x78\x9c\x63\xf8\xbf\x87\xc1\x18\x00\x06\x68\x01\xef\x00\xb5\x8e\x70\x00\x00" ++
        "\x00\x00\x49\x45\x4e\x44\xae\x42\x60\x82";
    var reason: decode.Reason = .{};
    const gpa = std.testing.allocator;
    var sky = try read(gpa, &@splat(file), 1024, &reason);
    defer sky.deinit(gpa);
    try std.testing.expectEqual(2, sky.width);
    for (sky.texels) |texel| {
        try std.testing.expectApproxEqRel(5, texel[0], 1e-6);
        try std.testing.expectApproxEqRel(5 * math.srgb.decoded[188], texel[1], 1e-6);
        try std.testing.expectEqual(0, texel[2]);
    }
    var files: [6][]const u8 = @splat(file);
    files[4] = "GIF89a";
    try std.testing.expectError(error.InvalidImage, read(gpa, &files, 1024, &reason));
    try std.testing.expect(reason.text().len > 0);
}
