//! Primary rays of pixels in lanes.
//!
//! In: the camera, a sample's place within the pixel. Out: origins and directions, affine in the
//! pixel's position and not normalised, so that all pixels of a bundle can share work.

const std = @import("std");
const world_file = @import("../../world.zig");
const vec3 = @import("../../math.zig").vec3;
const ray_file = @import("../traverse/ray.zig");
const Grid = @import("../traverse/beam/grid.zig").Grid;
const assert = std.debug.assert;

/// A sample's place in its pixel, 0..1 from the upper left corner.
pub const Offset = struct { x: f32, y: f32 };

/// The place of one of `sample_count` samples: the middle for a single one; else the Hammersley
/// points (x in equal strata, y the radical inverse in base 2), the same for every pixel.
pub fn sampleOffset(sample: u32, sample_count: u32) Offset {
    assert(sample < sample_count);
    const count: f32 = @floatFromInt(sample_count);
    const index: f32 = @floatFromInt(sample);
    // @bitReverse of at most 24 significant bits, so that the conversion is exact.
    const reversed: f32 = @floatFromInt(@bitReverse(sample) >> 8);
    const radical_inverse = reversed / 16_777_216.0;
    return .{
        .x = (index + 0.5) / count,
        .y = radical_inverse + 0.5 / count,
    };
}

/// A ray in lanes before it is made ready for traversal.
pub fn Start(comptime Lanes: type) type {
    return struct { origin: Lanes.Vec3, direction: Lanes.Vec3 };
}

/// The rays through points (x, y) of the picture in pixels from its upper left corner.
pub inline fn generate(
    comptime Lanes: type,
    view: *const world_file.View,
    x: Lanes.F32,
    y: Lanes.F32,
) Start(Lanes) {
    const camera = &view.camera;
    const width: f32 = @floatFromInt(view.width);
    const height: f32 = @floatFromInt(view.height);
    const one: Lanes.F32 = .splat(1);
    const across = x.mul(.splat(2 / width)).sub(one);
    const upward = one.sub(y.mul(.splat(2 / height)));
    const right: Lanes.Vec3 = .splat(camera.right);
    const up: Lanes.Vec3 = .splat(camera.up);
    const origin: Lanes.Vec3 = .splat(camera.origin);
    const forward: Lanes.Vec3 = .splat(camera.forward);
    const base = if (camera.orthographic) origin else forward;
    const point = base.add(right.scale(across)).add(up.scale(upward));
    return if (camera.orthographic)
        .{ .origin = point, .direction = forward }
    else
        .{ .origin = origin, .direction = point };
}

/// The directions of the rays around the one through (x, y), pixel by pixel; null where rays do not
/// share an origin.
pub fn grid(view: *const world_file.View, x: f32, y: f32) ?Grid {
    const camera = &view.camera;
    if (camera.orthographic) return null;
    const width: f32 = @floatFromInt(view.width);
    const height: f32 = @floatFromInt(view.height);
    const right = vec3.scale(camera.right, 2 / width);
    const down = vec3.scale(camera.up, -2 / height);
    const start = generate(ray_file.Single, view, .splat(x), .splat(y));
    var extent: f32 = 0;
    for (camera.right ++ camera.up ++ camera.forward) |component| extent += @abs(component);
    return .{
        .origin = camera.origin,
        .corner = start.direction.lane(0),
        .right = right,
        .down = down,
        // `generate` rounds x and y 3 times, their products and two sums once; `start` as well,
        // and steps of up to a tile are as many again.
        .deviation_roundings = 12 * extent,
    };
}

test "one sample is in the middle, many fill every stratum of both axes" {
    try std.testing.expectEqual(Offset{ .x = 0.5, .y = 0.5 }, sampleOffset(0, 1));
    inline for (.{ 2, 4, 16, 64 }) |count| {
        var columns: [count]bool = @splat(false);
        var rows: [count]bool = @splat(false);
        for (0..count) |sample| {
            const offset = sampleOffset(@intCast(sample), count);
            columns[@intFromFloat(offset.x * count)] = true;
            rows[@intFromFloat(offset.y * count)] = true;
        }
        for (columns, rows) |column, row| try std.testing.expect(column and row);
    }
    for (0..7) |sample| {
        const offset = sampleOffset(@intCast(sample), 7);
        try std.testing.expect(offset.x > 0 and offset.x < 1 and offset.y > 0 and offset.y < 1);
    }
}
