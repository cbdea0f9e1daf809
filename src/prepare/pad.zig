//! How far rounding may carry a ray past a triangle: `World.pad`.
//!
//! In: the scene's box, the camera and the lights. Out: a length in metres. It scales with the
//! largest distance between a ray's origin and a corner, and with the coordinates themselves, whose
//! own rounding moves with how far from the origin a scene stands.

const std = @import("std");
const math = @import("../math.zig");
const world = @import("../world.zig");
const assert = std.debug.assert;
const Box3 = math.Box3;
const Vec3 = math.Vec3;

/// Ray origins farther away than this many diagonals of the scene do not count: they would swell
/// every box for the sake of rays that see the scene as a point.
const diagonals_max = 4096;

/// Pad over the largest |coordinate|: forming a point on a ray rounds a product and a sum, each by
/// half a unit in the last place, at both ends; 4 leaves a factor of two.
const coordinate_relative: f64 = 4.0 / 16_777_216.0;

/// Smallest pad: it keeps boxes of flat scenes open, and is no denormal.
const pad_min: f64 = 0x1p-120;

/// The pad of a scene within `bounds`. Asserts that non-empty bounds are finite.
pub fn rayPad(bounds: Box3, camera: *const world.Camera, lights: []const world.Light) f32 {
    if (bounds.isEmpty()) return pad_min;
    const diagonal = distance(bounds.lower, bounds.upper);
    assert(diagonal < std.math.inf(f64));
    var reach: Reach = .{ .bounds = bounds, .diagonal = diagonal, .farthest = diagonal };
    if (camera.orthographic) {
        for ([_]f32{ -1, 1 }) |x| {
            for ([_]f32{ -1, 1 }) |y| {
                const sideways = math.vec3.add(
                    math.vec3.scale(camera.right, x),
                    math.vec3.scale(camera.up, y),
                );
                reach.include(math.vec3.add(camera.origin, sideways));
            }
        }
    } else {
        reach.include(camera.origin);
    }
    for (lights) |light| switch (light.kind) {
        .directional => {},
        .point, .spot => if (isInReach(&light, bounds)) reach.include(light.position),
    };
    var magnitude: f64 = 0;
    for (bounds.lower ++ bounds.upper) |coordinate| {
        const size: f64 = @abs(coordinate);
        magnitude = if (size > magnitude) size else magnitude;
    }
    const pad = reach.farthest * world.pad_relative + magnitude * coordinate_relative;
    return @floatCast(if (pad > pad_min) pad else pad_min);
}

const Reach = struct {
    bounds: Box3,
    diagonal: f64,
    farthest: f64,

    /// Counts a point where rays begin, unless it is absurdly far away.
    fn include(reach: *Reach, origin: Vec3) void {
        var corner: Vec3 = undefined;
        for (&corner, origin, reach.bounds.lower, reach.bounds.upper) |*far, from, lower, upper| {
            far.* = if (@abs(from - lower) > @abs(upper - from)) lower else upper;
        }
        const span = distance(origin, corner);
        if (!(span <= reach.diagonal * diagonals_max)) return;
        reach.farthest = if (span > reach.farthest) span else reach.farthest;
    }
};

/// Whether the light's range ends after the nearest point of the scene.
fn isInReach(light: *const world.Light, bounds: Box3) bool {
    if (light.range_inv_squared == 0) return true;
    var nearest: Vec3 = light.position;
    for (&nearest, bounds.lower, bounds.upper) |*coordinate, lower, upper| {
        if (coordinate.* < lower) coordinate.* = lower;
        if (coordinate.* > upper) coordinate.* = upper;
    }
    const span = distance(light.position, nearest);
    return span * span * light.range_inv_squared < 1;
}

fn distance(a: Vec3, b: Vec3) f64 {
    var sum: f64 = 0;
    for (a, b) |from, to| {
        const difference = @as(f64, to) - from;
        sum += difference * difference;
    }
    return @sqrt(sum);
}

const test_camera: world.Camera = .{
    .orthographic = false,
    .origin = .{ 0, 0, 9 },
    .right = .{ 1, 0, 0 },
    .up = .{ 0, 1, 0 },
    .forward = .{ 0, 0, -1 },
};

const test_light: world.Light = .{
    .kind = .point,
    .position = .{ 0, 0, 0 },
    .direction = .{ 0, 0, -1 },
    .intensity = .{ 1, 1, 1 },
    .range_inv_squared = 0,
    .cone_scale = 0,
    .cone_offset = 1,
};

test "the farthest of camera, lights and diagonal counts, within reason" {
    const bounds: Box3 = .{ .lower = .{ -1, 0, 0 }, .upper = .{ 1, 0, 0 } };
    const ulp: f32 = 1.0 / 16_777_216.0;
    var camera = test_camera;
    const near = rayPad(bounds, &camera, &.{});
    try std.testing.expectApproxEqRel(ulp * (32 * @sqrt(82.0) + 4), near, 1e-5);
    camera.origin = .{ 0, 0, 0 };
    try std.testing.expectApproxEqRel(ulp * (32 * 2 + 4), rayPad(bounds, &camera, &.{}), 1e-5);
    camera.origin = .{ 0, 0, 1e6 };
    try std.testing.expectApproxEqRel(ulp * (32 * 2 + 4), rayPad(bounds, &camera, &.{}), 1e-5);
    camera.origin = .{ 0, 0, 0 };
    var light = test_light;
    light.position = .{ 99, 0, 0 };
    const lit = rayPad(bounds, &camera, &.{light});
    try std.testing.expectApproxEqRel(ulp * (32 * 100 + 4), lit, 1e-5);
    light.range_inv_squared = 1.0 / (90.0 * 90.0);
    const dark = rayPad(bounds, &camera, &.{light});
    try std.testing.expectApproxEqRel(ulp * (32 * 2 + 4), dark, 1e-5);
}

test "an orthographic picture is as wide as its corners" {
    const bounds: Box3 = .{ .lower = .{ -1, 0, 0 }, .upper = .{ 1, 0, 0 } };
    var camera = test_camera;
    camera.orthographic = true;
    camera.origin = .{ 0, 0, 0 };
    camera.right = .{ 3, 0, 0 };
    const ulp: f32 = 1.0 / 16_777_216.0;
    const expected = ulp * (32 * @sqrt(17.0) + 4);
    try std.testing.expectApproxEqRel(expected, rayPad(bounds, &camera, &.{}), 1e-5);
}

test "an empty scene and a far one have a pad" {
    try std.testing.expect(rayPad(.empty, &test_camera, &.{}) > 0);
    const far: Box3 = .{ .lower = .{ 1e6, 0, 0 }, .upper = .{ 1e6 + 1, 1, 1 } };
    try std.testing.expect(rayPad(far, &test_camera, &.{}) >= 0.2);
    const tiny: Box3 = .{ .lower = .{ 0, 0, 0 }, .upper = .{ 1e-37, 0, 0 } };
    try std.testing.expect(rayPad(tiny, &test_camera, &.{}) > std.math.floatMin(f32));
}
