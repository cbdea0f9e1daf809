//! How far rounding may carry a ray past a triangle: `Geometry.pad`, and past a node:
//! `Geometry.node_margin`.
//!
//! In: the scene's box, the camera and the lights. Out: lengths in metres. The pad scales with the
//! largest distance between a ray's origin and a corner, and with the coordinates themselves, whose
//! own rounding moves with how far from the origin a scene stands; the margin with the largest
//! coordinate of either.

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

/// Smallest margin: a product that comes out as 0 instead of a denormal moves a bound by 2^-126
/// times the direction.
const node_margin_min: f64 = 0x1p-100;

/// Coordinates beyond it could overflow when multiplied by the inverse of a direction, up to 1e30.
const fused_reach_max: f64 = 0x1p27;

/// What `World` says of rounding.
pub const Pads = struct {
    /// `Geometry.pad`.
    triangle: f32,
    node_margin: f32,
    fused_reach: f32,
};

/// The pads of a scene within `bounds`. Asserts that non-empty bounds are finite.
pub fn choose(bounds: Box3, camera: *const world.Camera, lights: []const world.Light) Pads {
    if (bounds.isEmpty()) {
        return .{ .triangle = pad_min, .node_margin = node_margin_min, .fused_reach = 0 };
    }
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
    var magnitude = largest(bounds.lower);
    magnitude = @max(magnitude, largest(bounds.upper));
    const pad = @max(
        reach.farthest * world.pad_relative + magnitude * coordinate_relative,
        pad_min,
    );
    // Rays start off surfaces by a pad, and boxes end a pad outside of them.
    const fused_reach = @max(reach.magnitude, magnitude + 4 * pad);
    const margin = @max(fused_reach * world.node_margin_relative, node_margin_min);
    // Above those that were included, after rounding too.
    const rounded_up = fused_reach * (1 + 0x1p-20) + node_margin_min;
    return .{
        .triangle = @floatCast(pad),
        .node_margin = @floatCast(if (fused_reach <= fused_reach_max) margin else 0),
        .fused_reach = @floatCast(if (fused_reach <= fused_reach_max) rounded_up else 0),
    };
}

const Reach = struct {
    bounds: Box3,
    diagonal: f64,
    farthest: f64,
    /// Largest |coordinate| of an origin.
    magnitude: f64 = 0,

    /// Counts a point where rays begin, unless it is absurdly far away.
    fn include(reach: *Reach, origin: Vec3) void {
        var corner: Vec3 = undefined;
        for (&corner, origin, reach.bounds.lower, reach.bounds.upper) |*far, from, lower, upper| {
            far.* = if (@abs(from - lower) > @abs(upper - from)) lower else upper;
        }
        const span = distance(origin, corner);
        if (!(span <= reach.diagonal * diagonals_max)) return;
        reach.farthest = @max(reach.farthest, span);
        reach.magnitude = @max(reach.magnitude, largest(origin));
    }
};

/// The largest |coordinate| of a point.
fn largest(point: Vec3) f64 {
    var magnitude: f64 = 0;
    for (point) |coordinate| magnitude = @max(magnitude, @abs(coordinate));
    return magnitude;
}

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

fn testPad(bounds: Box3, camera: *const world.Camera, lights: []const world.Light) f32 {
    return choose(bounds, camera, lights).triangle;
}

test "the farthest of camera, lights and diagonal counts, within reason" {
    const bounds: Box3 = .{ .lower = .{ -1, 0, 0 }, .upper = .{ 1, 0, 0 } };
    const ulp: f32 = 1.0 / 16_777_216.0;
    var camera = test_camera;
    const near = testPad(bounds, &camera, &.{});
    try std.testing.expectApproxEqRel(ulp * (32 * @sqrt(82.0) + 4), near, 1e-5);
    camera.origin = .{ 0, 0, 0 };
    try std.testing.expectApproxEqRel(ulp * (32 * 2 + 4), testPad(bounds, &camera, &.{}), 1e-5);
    camera.origin = .{ 0, 0, 1e6 };
    try std.testing.expectApproxEqRel(ulp * (32 * 2 + 4), testPad(bounds, &camera, &.{}), 1e-5);
    camera.origin = .{ 0, 0, 0 };
    var light = test_light;
    light.position = .{ 99, 0, 0 };
    const lit = testPad(bounds, &camera, &.{light});
    try std.testing.expectApproxEqRel(ulp * (32 * 100 + 4), lit, 1e-5);
    light.range_inv_squared = 1.0 / (90.0 * 90.0);
    const dark = testPad(bounds, &camera, &.{light});
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
    try std.testing.expectApproxEqRel(expected, testPad(bounds, &camera, &.{}), 1e-5);
}

test "an empty scene and a far one have a pad" {
    try std.testing.expect(testPad(.empty, &test_camera, &.{}) > 0);
    const far: Box3 = .{ .lower = .{ 1e6, 0, 0 }, .upper = .{ 1e6 + 1, 1, 1 } };
    try std.testing.expect(testPad(far, &test_camera, &.{}) >= 0.2);
    const tiny: Box3 = .{ .lower = .{ 0, 0, 0 }, .upper = .{ 1e-37, 0, 0 } };
    try std.testing.expect(testPad(tiny, &test_camera, &.{}) > std.math.floatMin(f32));
}

test "a multiply-add against a box of a node accepts what the exact test accepts" {
    var random_state: std.Random.DefaultPrng = .init(5);
    const random = random_state.random();
    for (0..20_000) |_| {
        // Coordinates of a few sizes, far from and near to each other.
        const size = std.math.ldexp(@as(f32, 1), random.intRangeAtMost(i32, -8, 8));
        const bounds: Box3 = .{ .lower = @splat(-size), .upper = @splat(size) };
        const pads = choose(bounds, &test_camera, &.{});
        const reach: f32 = if (random.boolean()) size else 9;
        const origin = (random.float(f32) * 2 - 1) * reach;
        const near = random.float(f32) < 0.5;
        const bound = if (near) origin * (1 + random.floatNorm(f32) * 1e-6) else random.float(f32);
        const corner = @min(@max(bound, -size), size);
        const exponent = random.intRangeAtMost(i32, -20, 99);
        const inverse = std.math.ldexp(random.float(f32) + 1, exponent);
        try std.testing.expect(@abs(origin) < pads.fused_reach);
        const exact_near = (corner - origin) * inverse;
        const product = origin * inverse;
        for ([_]f32{ corner - pads.node_margin, corner + pads.node_margin }, 0..) |moved, side| {
            for ([_]f32{ @mulAdd(f32, moved, inverse, -product), moved * inverse - product }) |t| {
                try std.testing.expect(if (side == 0) t <= exact_near else t >= exact_near);
            }
        }
    }
}

test "scenes too large for multiply-adds, and lights too far away, are known" {
    const huge: Box3 = .{ .lower = @splat(-1e9), .upper = @splat(1e9) };
    try std.testing.expectEqual(0, choose(huge, &test_camera, &.{}).fused_reach);
    const bounds: Box3 = .{ .lower = @splat(-1), .upper = @splat(1) };
    var light = test_light;
    light.position = .{ 99, 0, 0 };
    const near = choose(bounds, &test_camera, &.{light});
    try std.testing.expect(near.fused_reach > 99 and near.fused_reach < 99.1);
    light.position = .{ 1e6, 0, 0 };
    const far = choose(bounds, &test_camera, &.{light});
    try std.testing.expect(far.fused_reach > 9 and far.fused_reach < 9.1);
}
