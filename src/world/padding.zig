//! Conservative padding: by how much boxes and rays are grown, so that culling is exact: no box
//! culls what the triangle test accepts, and no ray slips through an edge for rounding alone.
//!
//! With u = 2^-24, distances in the maximum norm, C a fixed point in the middle of the geometry:
//!
//!     pad(x)    = 36 u |x - C| + 4 u |C| + 2^-120      of a triangle: x its corner farthest from C
//!     shift(o)  = pad(o)                               of a ray from o
//!     margin(x) = 16 u |x - C| + 16 u |C| + 2^-100     of a node: x its corner farthest from C
//!
//! **Enough.** To the triangle test a corner is off by at most 6 u |corner - o| in each axis across
//! the ray, and its t by 9 u of that distance (`trace/traverse/triangle.zig`); the slab test moves
//! a face by 3 u of it. Points on a ray and corners themselves are rounded by a few u of their
//! coordinates. Since |corner - o| <= |corner - C| + |o - C|, pad and shift together are at least
//! 36 u |corner - o| and 4 u of every coordinate: twice of what is needed. So the pad is local: it
//! knows nothing of cameras, lights, or the rest of the scene, and the tree depends on none of
//! them. One far vertex or lamp costs nothing but itself.
//!
//! **Exact.** The box of a triangle is that of its corners, grown by its pad; a ray is tested
//! against it from o + shift where it meets the lower faces, and from o - shift where it meets the
//! upper ones. The box of a node is the union of its triangles' boxes. All of it is monotone in the
//! box, rounding included, and the shift is the ray's own wherever it is tested: whatever the
//! triangle test accepts within its own grown box no node above it can cull, in any order.
//!
//! **Multiply-adds.** A node may be tested by bound * inverse - origin * inverse, fused or not,
//! which rounds otherwise: in units of u and as shifts of a bound, the exact expression is off by 3
//! |bound - o|, this one by |bound - o|, |o| and, not fused, |bound|: 4 (|bound| + |o|) together.
//! Boxes of nodes are grown by their margin when they are written, and a ray's shift by its own for
//! such tests. Products must not overflow (`Padding.allowsProducts`).

const std = @import("std");
const math = @import("../math.zig");
const Box3 = math.Box3;
const Vec3 = math.Vec3;

/// Half a unit in the last place of 1.
const unit_roundoff: f32 = 0x1p-24;
const pad_relative: f32 = 36 * unit_roundoff;
const margin_relative: f32 = 16 * unit_roundoff;
/// Keeps boxes of flat triangles open, and is no denormal.
const pad_least: f32 = 0x1p-120;
/// A product that comes out as 0 instead of a denormal moves a bound by 2^-126 times the direction.
const margin_least: f32 = 0x1p-100;
/// Products of bounds and inverse directions stay below it: they do not overflow.
const product_max: f32 = 0x1p126;

/// The padding of one geometry.
pub const Padding = struct {
    center: Vec3,
    /// What pads and margins are of the center itself.
    pad_center: f32,
    margin_center: f32,
    /// Largest |coordinate| of a node's bound.
    bound_max: f32,

    /// Of what lies within `bounds`, finite or empty, around `center`.
    pub fn init(center: Vec3, bounds: Box3) Padding {
        const size = distance(center, @splat(0));
        var padding: Padding = .{
            .center = center,
            .pad_center = 4 * unit_roundoff * size + pad_least,
            .margin_center = margin_relative * size + margin_least,
            .bound_max = 0,
        };
        if (bounds.isEmpty()) return padding;
        const grown = bounds.grow(padding.ofBox(bounds));
        const outer = grown.grow(padding.marginOfBox(grown));
        const origin: Vec3 = @splat(0);
        padding.bound_max = @max(distance(outer.lower, origin), distance(outer.upper, origin));
        return padding;
    }

    /// The pad of a triangle within this box of its corners.
    pub inline fn ofBox(padding: *const Padding, box: Box3) f32 {
        return padding.reachOf(box) * pad_relative + padding.pad_center;
    }

    /// The margin of a node with this box.
    pub inline fn marginOfBox(padding: *const Padding, box: Box3) f32 {
        return padding.reachOf(box) * margin_relative + padding.margin_center;
    }

    inline fn reachOf(padding: *const Padding, box: Box3) f32 {
        const below = distance(box.lower, padding.center);
        const above = distance(box.upper, padding.center);
        return if (above > below) above else below;
    }

    /// `ofBox` of as many boxes as vectors hold, bit for bit.
    pub inline fn ofVectors(
        padding: *const Padding,
        comptime count: comptime_int,
        lower: [3]@Vector(count, f32),
        upper: [3]@Vector(count, f32),
    ) @Vector(count, f32) {
        const Vector = @Vector(count, f32);
        var reach: Vector = @splat(0);
        for (lower, upper, padding.center) |low, high, center| {
            const middle: Vector = @splat(center);
            for ([_]Vector{ @abs(low - middle), @abs(high - middle) }) |distant| {
                reach = @select(f32, distant > reach, distant, reach);
            }
        }
        const relative: Vector = @splat(pad_relative);
        return reach * relative + @as(Vector, @splat(padding.pad_center));
    }

    /// `ofBox` in lanes, bit for bit; `lower` and `upper` may be turned, as `center` is.
    pub inline fn ofBoxes(
        padding: *const Padding,
        comptime Lanes: type,
        lower: Lanes.Vec3,
        upper: Lanes.Vec3,
        center: Lanes.Vec3,
    ) Lanes.F32 {
        const reach = largest(Lanes, lower.sub(center)).maxFast(largest(Lanes, upper.sub(center)));
        return reach.mul(.splat(pad_relative)).add(.splat(padding.pad_center));
    }

    /// `marginOfBox` and the pad in lanes together: for boxes of triangles that are tested as nodes
    /// are.
    pub inline fn marginOfBoxes(
        padding: *const Padding,
        comptime Lanes: type,
        lower: Lanes.Vec3,
        upper: Lanes.Vec3,
    ) Lanes.F32 {
        const center: Lanes.Vec3 = .splat(padding.center);
        const reach = largest(Lanes, lower.sub(center)).maxFast(largest(Lanes, upper.sub(center)));
        // The grown box reaches farther: half of a margin more.
        return reach.mul(.splat(pad_relative + 1.5 * margin_relative))
            .add(.splat(padding.pad_center + 1.5 * padding.margin_center));
    }

    /// The shift of rays from `origin`.
    pub inline fn shiftOf(
        padding: *const Padding,
        comptime Lanes: type,
        origin: Lanes.Vec3,
    ) Lanes.F32 {
        return largest(Lanes, origin.sub(.splat(padding.center))).mul(.splat(pad_relative))
            .add(.splat(padding.pad_center));
    }

    /// The same with the margin that tests of nodes want.
    pub inline fn nodeShiftOf(
        padding: *const Padding,
        comptime Lanes: type,
        origin: Lanes.Vec3,
    ) Lanes.F32 {
        return largest(Lanes, origin.sub(.splat(padding.center)))
            .mul(.splat(pad_relative + margin_relative))
            .add(.splat(padding.pad_center + padding.margin_center));
    }

    /// Rays whose products with any bound of a node are finite.
    pub inline fn allowsProducts(
        padding: *const Padding,
        comptime Lanes: type,
        origin: Lanes.Vec3,
        direction_inv: Lanes.Vec3,
    ) Lanes.Mask {
        const factor = largest(Lanes, origin).maxFast(.splat(padding.bound_max));
        return factor.mul(largest(Lanes, direction_inv)).lt(.splat(product_max));
    }
};

/// In the maximum norm.
inline fn distance(a: Vec3, b: Vec3) f32 {
    const x = @abs(a[0] - b[0]);
    const y = @abs(a[1] - b[1]);
    const z = @abs(a[2] - b[2]);
    const xy = if (y > x) y else x;
    return if (z > xy) z else xy;
}

/// The largest |component|.
inline fn largest(comptime Lanes: type, vector: Lanes.Vec3) Lanes.F32 {
    const size = vector.abs();
    return size.x.maxFast(size.y).maxFast(size.z);
}

test "pads are local: they grow with the distance from the center alone" {
    const far: Box3 = .{ .lower = .{ 1e4, 0, 0 }, .upper = .{ 1e4 + 1, 1, 1 } };
    const near: Box3 = .{ .lower = @splat(-1), .upper = @splat(1) };
    const padding: Padding = .init(@splat(0), near.join(far));
    try std.testing.expect(padding.ofBox(near) < 40 * unit_roundoff);
    try std.testing.expect(padding.ofBox(far) > 0.02);
    try std.testing.expect(padding.bound_max > 1e4 and padding.bound_max < 1.0001e4 + 1);
    const away: Padding = .init(@splat(50), .{ .lower = @splat(49), .upper = @splat(51) });
    const there: Box3 = .{ .lower = @splat(49.5), .upper = @splat(50.5) };
    try std.testing.expect(away.ofBox(there) >= 200 * unit_roundoff);
    const empty: Padding = .init(@splat(0), .empty);
    try std.testing.expect(empty.ofBox(near) > 0 and empty.bound_max == 0);
}

test "a multiply-add against a node's box accepts what the exact test accepts" {
    var random_state: std.Random.DefaultPrng = .init(5);
    const random = random_state.random();
    for (0..50_000) |_| {
        // Coordinates of many sizes, far from and near to each other and to the center.
        var values: [3]f32 = undefined;
        for (&values) |*value| {
            const size = std.math.ldexp(@as(f32, 1), random.intRangeAtMost(i32, -12, 16));
            value.* = (random.float(f32) * 2 - 1) * size;
        }
        const center, var origin, const corner = values;
        if (random.boolean()) origin = corner * (1 + random.floatNorm(f32) * 1e-6);
        const box: Box3 = .{ .lower = @splat(corner), .upper = @splat(corner) };
        const padding: Padding = .init(@splat(center), box);
        const reach = @abs(origin - center);
        const shift = reach * pad_relative + padding.pad_center;
        const node_shift = reach * (pad_relative + margin_relative) +
            (padding.pad_center + padding.margin_center);
        const inverse = std.math.ldexp(random.float(f32) + 1, random.intRangeAtMost(i32, -20, 99));
        const grown = box.grow(padding.ofBox(box));
        const node = grown.grow(padding.marginOfBox(grown));
        const exact = [2]f32{
            (grown.lower[0] - (origin + shift)) * inverse,
            (grown.upper[0] - (origin - shift)) * inverse,
        };
        const from = [2]f32{ (origin + node_shift) * inverse, (origin - node_shift) * inverse };
        for ([2]f32{ node.lower[0], node.upper[0] }, from, exact, 0..) |bound, product, t, side| {
            const rounded = bound * inverse - product;
            for ([_]f32{ @mulAdd(f32, bound, inverse, -product), rounded }) |other| {
                try std.testing.expect(if (side == 0) other <= t else other >= t);
            }
        }
    }
}

test "pads in vectors are those of boxes one by one" {
    var random_state: std.Random.DefaultPrng = .init(9);
    const random = random_state.random();
    for (0..200) |_| {
        var boxes: [4]Box3 = @splat(.empty);
        var lower: [3]@Vector(4, f32) = undefined;
        var upper: [3]@Vector(4, f32) = undefined;
        for (&boxes, 0..) |*box, lane| {
            for (0..2) |_| {
                var point: Vec3 = undefined;
                for (&point) |*coordinate| {
                    const size = std.math.ldexp(@as(f32, 1), random.intRangeAtMost(i32, -9, 9));
                    coordinate.* = random.floatNorm(f32) * size;
                }
                box.* = box.include(point);
            }
            inline for (0..4) |index| if (index == lane) for (0..3) |axis| {
                lower[axis][index] = box.lower[axis];
                upper[axis][index] = box.upper[axis];
            };
        }
        const padding: Padding = .init(.{ random.floatNorm(f32), 3, -0.1 }, boxes[0]);
        const pads: [4]f32 = padding.ofVectors(4, lower, upper);
        for (boxes, pads) |box, pad| try std.testing.expectEqual(padding.ofBox(box), pad);
    }
}
