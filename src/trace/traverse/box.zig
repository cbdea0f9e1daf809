//! The slab test (Kay and Kajiya 1986): where a line enters and leaves boxes.
//!
//! In: the near and far faces of boxes, a line, in the same lanes (one ray and many boxes, or many
//! rays and one box). Out: the range of t within. Every step is monotone in the box, so a larger
//! box always gives a range that holds the smaller one's, rounding included: culling by it is exact
//! with respect to `triangle.zig`, which tests the triangle's own box the same way
//! (world/padding.zig).

const std = @import("std");
const simd = @import("../../simd.zig");
const ray = @import("ray.zig");

/// Range of t of a line within a box; empty if near > far.
pub fn Range(comptime Lanes: type) type {
    return struct {
        near: Lanes.F32,
        far: Lanes.F32,

        /// Set where near <= far, of a range whose one end is not negative: that of `between`.
        pub inline fn isMet(range: @This()) Lanes.Mask {
            return range.near.leOrNegative(range.far);
        }
    };
}

/// The range of a box whose faces lie at these offsets from a line's origin. No operand is NaN:
/// corners are finite or, in empty boxes, infinite, origins finite, inverses finite and not 0. An
/// empty box gives near = +inf.
pub inline fn slab(
    comptime Lanes: type,
    near_offset: Lanes.Vec3,
    far_offset: Lanes.Vec3,
    direction_inv: Lanes.Vec3,
) Range(Lanes) {
    const near = near_offset.mul(direction_inv);
    const far = far_offset.mul(direction_inv);
    return .{
        .near = near.x.max(near.y).max(near.z),
        .far = far.x.min(far.y).min(far.z),
    };
}

/// The range of a box as a ray meets it, its origin's padding included (`ray.RayInverse`).
pub inline fn padded(
    comptime Lanes: type,
    lower: Lanes.Vec3,
    upper: Lanes.Vec3,
    ray_inverse: anytype,
) Range(Lanes) {
    const length = ray_inverse.shift;
    const shift: Lanes.Vec3 = .{ .x = length, .y = length, .z = length };
    const from_lower = lower.sub(ray_inverse.origin.add(shift));
    const from_upper = upper.sub(ray_inverse.origin.sub(shift));
    return slab(
        Lanes,
        select3(Lanes, ray_inverse.negative, from_upper, from_lower),
        select3(Lanes, ray_inverse.negative, from_lower, from_upper),
        ray_inverse.direction_inv,
    );
}

/// By component: `a` where the mask is set, else `b`.
pub inline fn select3(
    comptime Lanes: type,
    masks: [3]Lanes.Mask,
    a: Lanes.Vec3,
    b: Lanes.Vec3,
) Lanes.Vec3 {
    return .{
        .x = Lanes.F32.select(masks[0], a.x, b.x),
        .y = Lanes.F32.select(masks[1], a.y, b.y),
        .z = Lanes.F32.select(masks[2], a.z, b.z),
    };
}

/// Set where a box may hold a hit strictly between `tnear` and `closest`.
pub inline fn mayHold(
    comptime Lanes: type,
    range: Range(Lanes),
    tnear_t: Lanes.F32,
    closest_t: Lanes.F32,
) Lanes.Mask {
    return range.near.le(range.far)
        .bitAnd(range.near.le(closest_t))
        .bitAnd(range.far.ge(tnear_t));
}

/// What is left of the ranges of all three axes between `tnear_t`, which is not negative, and
/// `closest_t`: `Range.isMet` where there may be a hit. For culling only. The way from node to node
/// is little but a chain of minima and maxima, so they are the quickest. A far end of -0 may be
/// missed: boxes are grown (world/padding.zig), so that no hit lies at their very end.
pub inline fn between(
    comptime Lanes: type,
    near: [3]Lanes.F32,
    far: [3]Lanes.F32,
    tnear_t: Lanes.F32,
    closest_t: Lanes.F32,
) Range(Lanes) {
    return .{
        .near = near[0].maxOrNegative(near[1]).maxOrNegative(near[2].maxOrNegative(tnear_t)),
        .far = far[0].minOrNegative(far[1]).minOrNegative(far[2].minOrNegative(closest_t)),
    };
}

const Single = ray.Single;

const test_padding: @import("../../world.zig").Padding = .init(@splat(0), .empty);

fn testSlab(line: ray.RayInverse(Single), near: [3]f32, far: [3]f32) Range(Single) {
    const near_offset = Single.Vec3.splat(near).sub(line.origin);
    return slab(Single, near_offset, Single.Vec3.splat(far).sub(line.origin), line.direction_inv);
}

test "an empty box is never entered, a flat one can be, a larger one gives a larger range" {
    const Lanes = Single;
    const inf = std.math.inf(f32);
    const line: ray.RayInverse(Lanes) =
        .init(.init(.splat(.{ 0, 0, 0 }), .splat(.{ 1, 0, -1e-40 })), &test_padding);
    const empty = testSlab(line, .{ inf, inf, -inf }, .{ -inf, -inf, inf });
    try std.testing.expect(!mayHold(Lanes, empty, .splat(0), .splat(inf)).lane(0));
    const flat = testSlab(line, .{ 2, -1, 1 }, .{ 2, 1, -1 });
    try std.testing.expect(mayHold(Lanes, flat, .splat(0), .splat(inf)).lane(0));
    try std.testing.expectEqual(2, flat.near.lane(0));
    try std.testing.expectEqual(2, flat.far.lane(0));
    try std.testing.expect(mayHold(Lanes, flat, .splat(0), .splat(2)).lane(0));
    try std.testing.expect(!mayHold(Lanes, flat, .splat(0), .splat(1.9)).lane(0));
    try std.testing.expect(!mayHold(Lanes, flat, .splat(2.1), .splat(inf)).lane(0));

    var random = std.Random.DefaultPrng.init(7);
    for (0..10_000) |_| {
        var lower: [3]f32 = undefined;
        var upper: [3]f32 = undefined;
        var origin: [3]f32 = undefined;
        for (0..3) |axis| {
            lower[axis] = random.random().floatNorm(f32);
            upper[axis] = lower[axis] + random.random().float(f32);
            origin[axis] = random.random().floatNorm(f32) * 3;
        }
        const up: ray.RayInverse(Lanes) =
            .init(.init(.splat(origin), .splat(.{ 0.3, 1e-8, 0.7 })), &test_padding);
        const inner = testSlab(up, lower, upper);
        for (0..3) |axis| {
            lower[axis] -= random.random().float(f32) * 1e-6;
            upper[axis] += random.random().float(f32) * 1e-6;
        }
        const outer = testSlab(up, lower, upper);
        try std.testing.expect(outer.near.lane(0) <= inner.near.lane(0));
        try std.testing.expect(outer.far.lane(0) >= inner.far.lane(0));
    }
}

test "what is left of ranges is what minima and maxima leave" {
    const Lanes = simd.Lanes(.vector, 4);
    const values = [_]f32{
        -std.math.inf(f32), -3, -1e-40, -0.0, 0, 1e-40, 1, 1.5, 3, std.math.inf(f32),
    };
    var random = std.Random.DefaultPrng.init(3);
    for (0..100_000) |_| {
        var ends: [7]f32 = undefined;
        for (&ends) |*end| end.* = values[random.random().uintLessThan(usize, values.len)];
        const tnear_t = @abs(ends[6]);
        const closest_t = values[random.random().uintLessThan(usize, values.len)];
        var near: [3]Lanes.F32 = undefined;
        var far: [3]Lanes.F32 = undefined;
        for (&near, &far, ends[0..3], ends[3..6]) |*first, *last, low, high| {
            first.* = .splat(low);
            last.* = .splat(high);
        }
        const range = between(Lanes, near, far, .splat(tnear_t), .splat(closest_t));
        const first = @max(ends[0], ends[1], ends[2], tnear_t);
        const last = @min(ends[3], ends[4], ends[5], closest_t);
        if (first == 0 and last == 0) continue; // -0 may be missed.
        try std.testing.expectEqual(first <= last, range.isMet().lane(0));
        if (first <= last) try std.testing.expectEqual(first, range.near.lane(0));
    }
}
