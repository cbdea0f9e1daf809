//! Rays in lanes, and the total order of hits (t, primitive) that decides which one is closest.
//!
//! A hit is the pair (t, primitive number), ordered by t and at equal t by the number. A ray
//! accepts hits strictly between `tnear` and `closest` in this order, so the closest hit is
//! the same in whatever order triangles are tested, and a ray goes on behind a hole or a blended
//! surface by raising `tnear` to the hit just found, without moving its origin.

const std = @import("std");
const simd = @import("../../simd.zig");
const Padding = @import("../../world.zig").Padding;
const assert = std.debug.assert;

/// Primitive number that stands for "none". As a signed lane value it is below every number, so a
/// limit of (t, none) leaves out every hit at t itself.
pub const no_primitive: i32 = -1;

/// Directions shorter than this along an axis count as this short for boxes: the inverse stays
/// finite and a box's faces never give 0 times infinity. Far below what any padding covers.
const direction_least = 1e-30;

/// Hits in lanes.
pub fn Hit(comptime Lanes: type) type {
    return struct {
        /// In units of the ray's direction.
        t: Lanes.F32,
        /// Primitive number or `no_primitive`.
        primitive: Lanes.I32,

        /// The limit of a ray without end, or of one that ends before `t_limit`.
        pub inline fn before(t_limit: Lanes.F32) @This() {
            return .{ .t = t_limit, .primitive = .splat(no_primitive) };
        }

        /// The lower bound that leaves out nothing in front of the origin.
        pub inline fn start() @This() {
            return .{ .t = .zero(), .primitive = .splat(std.math.maxInt(i32)) };
        }

        /// Set where (t, primitive) comes strictly after this hit.
        pub inline fn isBefore(
            hit: @This(),
            t: Lanes.F32,
            primitive: Lanes.I32,
        ) Lanes.Mask {
            return hit.t.lt(t).bitOr(hit.t.eq(t).bitAnd(hit.primitive.lt(primitive)));
        }

        /// Set where (t, primitive) comes strictly before this hit.
        pub inline fn isAfter(
            hit: @This(),
            t: Lanes.F32,
            primitive: Lanes.I32,
        ) Lanes.Mask {
            return t.lt(hit.t).bitOr(t.eq(hit.t).bitAnd(primitive.lt(hit.primitive)));
        }
    };
}

/// A ray's course.
pub fn Line(comptime Lanes: type) type {
    return struct {
        origin: Lanes.Vec3,
        /// Not normalised.
        direction: Lanes.Vec3,

        /// Names the two.
        pub inline fn init(origin: Lanes.Vec3, direction: Lanes.Vec3) @This() {
            return .{ .origin = origin, .direction = direction };
        }

        /// Set where a component is infinite or NaN: no triangle is hit there.
        pub inline fn isNotFinite(line: @This()) Lanes.Mask {
            const zero: Lanes.F32 = .zero();
            const origin = line.origin.scale(zero);
            const direction = line.direction.scale(zero);
            const sum = origin.x.add(origin.y).add(origin.z)
                .add(direction.x).add(direction.y).add(direction.z);
            return sum.eq(zero).bitNot();
        }
    };
}

/// What of a ray boxes are tested against; made only where they are.
pub fn RayInverse(comptime Lanes: type) type {
    return struct {
        origin: Lanes.Vec3,
        /// The origin's part of the padding: lower faces are met from the origin plus this, upper
        /// ones from the origin minus it.
        shift: Lanes.F32,
        /// 1 / direction, finite and never 0.
        direction_inv: Lanes.Vec3,
        /// Where the direction points down an axis: the upper face of a box is the near one.
        negative: [3]Lanes.Mask,

        /// Gathers what tests need.
        pub inline fn init(line: Line(Lanes), padding: *const Padding) @This() {
            const inverse: Lanes.Vec3 = .{
                .x = invert(line.direction.x),
                .y = invert(line.direction.y),
                .z = invert(line.direction.z),
            };
            const zero: Lanes.F32 = .zero();
            return .{
                .origin = line.origin,
                .shift = padding.shiftOf(Lanes, line.origin),
                .direction_inv = inverse,
                .negative = .{ inverse.x.lt(zero), inverse.y.lt(zero), inverse.z.lt(zero) },
            };
        }

        inline fn invert(component: Lanes.F32) Lanes.F32 {
            const least: Lanes.F32 = .splat(direction_least);
            const tiny = component.abs().lt(least);
            const bounded = Lanes.F32.select(tiny, least.copySign(component), component);
            return Lanes.F32.splat(1).div(bounded);
        }
    };
}

/// The axis along which a direction is longest, in lanes.
pub fn LongAxis(comptime Lanes: type) type {
    return struct {
        x: Lanes.Mask,
        /// Never set together with `x`; neither: z.
        y: Lanes.Mask,

        const Self = @This();

        /// Of equal lengths the first counts.
        pub inline fn of(direction: Lanes.Vec3) Self {
            const length = direction.abs();
            const x = length.x.ge(length.y).bitAnd(length.x.ge(length.z));
            return .{ .x = x, .y = length.y.ge(length.z).andNot(x) };
        }

        /// The one axis of all lanes that are set, 0 to 2, or null.
        pub inline fn uniform(axis: Self, lanes: Lanes.Mask) ?u2 {
            if (lanes.andNot(axis.x).none()) return 0;
            if (lanes.andNot(axis.y).none()) return 1;
            if (lanes.bitAnd(axis.x.bitOr(axis.y)).none()) return 2;
            return null;
        }

        /// That of one lane.
        pub inline fn ofLane(axis: Self, index: usize) u2 {
            return if (axis.x.lane(index)) 0 else if (axis.y.lane(index)) 1 else 2;
        }

        /// Components in cyclic order with that of the long axis last.
        pub inline fn turn(axis: Self, v: Lanes.Vec3) Lanes.Vec3 {
            const F32 = Lanes.F32;
            return .{
                .x = F32.select(axis.x, v.y, F32.select(axis.y, v.z, v.x)),
                .y = F32.select(axis.x, v.z, F32.select(axis.y, v.x, v.y)),
                .z = F32.select(axis.x, v.x, F32.select(axis.y, v.y, v.z)),
            };
        }

        /// The same for masks.
        pub inline fn turnMasks(axis: Self, m: [3]Lanes.Mask) [3]Lanes.Mask {
            const pick = struct {
                inline fn pick(a: Self, x: Lanes.Mask, y: Lanes.Mask, z: Lanes.Mask) Lanes.Mask {
                    const either = a.x.bitOr(a.y);
                    return a.x.bitAnd(x).bitOr(a.y.bitAnd(y)).bitOr(z.andNot(either));
                }
            }.pick;
            return .{
                pick(axis, m[1], m[2], m[0]),
                pick(axis, m[2], m[0], m[1]),
                pick(axis, m[0], m[1], m[2]),
            };
        }
    };
}

/// Index of the component that comes at `place` when the long axis is last (see `LongAxis.turn`).
pub inline fn turnedIndex(axis: u2, place: usize) usize {
    return (place + axis + 1) % 3;
}

/// What of a ray triangles are tested against: space turned so that the ray's longest axis is z,
/// and sheared so that the ray runs along it (Woop, Benthin and Wald 2013, section 3).
pub fn ShearedRay(comptime Lanes: type) type {
    return struct {
        /// Turned.
        origin: Lanes.Vec3,
        /// See `RayInverse`.
        shift: Lanes.F32,
        /// Turned, see `RayInverse`.
        direction_inv: Lanes.Vec3,
        /// Turned, see `RayInverse`.
        negative: [3]Lanes.Mask,
        /// Turned direction's x / z, y / z and 1 / z.
        shear: Lanes.Vec3,

        /// A line whose longest axis is the given one.
        pub inline fn init(
            line: Line(Lanes),
            axis: LongAxis(Lanes),
            padding: *const Padding,
        ) @This() {
            const direction = axis.turn(line.direction);
            const slabs: RayInverse(Lanes) = .init(line, padding);
            return .{
                .origin = axis.turn(line.origin),
                .shift = slabs.shift,
                .direction_inv = axis.turn(slabs.direction_inv),
                .negative = axis.turnMasks(slabs.negative),
                .shear = shearOf(Lanes, direction),
            };
        }
    };
}

/// What shears space so that a line in this turned direction runs along z.
pub inline fn shearOf(comptime Lanes: type, direction: Lanes.Vec3) Lanes.Vec3 {
    return .{
        .x = direction.x.div(direction.z),
        .y = direction.y.div(direction.z),
        .z = Lanes.F32.splat(1).div(direction.z),
    };
}

/// Rays with what they look for.
pub fn Ray(comptime Lanes: type) type {
    return struct {
        line: Line(Lanes),
        /// Only hits strictly after this one count.
        tnear: Hit(Lanes),
        /// Only hits strictly before this one count; in the end the nearest of them.
        closest: Hit(Lanes),
        /// The primitive that the ray starts or ends on, never hit; or `no_primitive`.
        skip: Lanes.I32,
        /// Lanes without a ray are left alone.
        active: Lanes.Mask,

        /// Rays that look for whatever they hit but `skip`.
        pub inline fn endless(line: Line(Lanes), skip: Lanes.I32, active: Lanes.Mask) @This() {
            return .{
                .line = line,
                .tnear = .start(),
                .closest = .before(.splat(std.math.inf(f32))),
                .skip = skip,
                .active = active,
            };
        }

        /// The ray in one lane, by itself.
        pub fn extract(ray: *const @This(), lane: usize) Ray(Single) {
            assert(ray.active.lane(lane));
            const one = struct {
                inline fn float(value: Lanes.F32, index: usize) Single.F32 {
                    return .splat(value.lane(index));
                }
                inline fn int(value: Lanes.I32, index: usize) Single.I32 {
                    return .splat(value.lane(index));
                }
            };
            return .{
                .line = .init(
                    .splat(ray.line.origin.lane(lane)),
                    .splat(ray.line.direction.lane(lane)),
                ),
                .tnear = .{
                    .t = one.float(ray.tnear.t, lane),
                    .primitive = one.int(ray.tnear.primitive, lane),
                },
                .closest = .{
                    .t = one.float(ray.closest.t, lane),
                    .primitive = one.int(ray.closest.primitive, lane),
                },
                .skip = one.int(ray.skip, lane),
                .active = .splat(true),
            };
        }
    };
}

/// One ray by itself.
pub const Single = simd.Lanes(.scalar, 1);

const test_padding: Padding = .init(@splat(0), .empty);

test "hits are ordered by t, then by number; limits are strict" {
    const inf = std.math.inf(f32);
    const H = Hit(Single);
    const at = struct {
        fn float(x: f32) Single.F32 {
            return .splat(x);
        }
        fn int(x: i32) Single.I32 {
            return .splat(x);
        }
    };
    const hit: H = .{ .t = at.float(2), .primitive = at.int(5) };
    try std.testing.expect(hit.isAfter(at.float(1), at.int(9)).lane(0));
    try std.testing.expect(hit.isAfter(at.float(2), at.int(4)).lane(0));
    try std.testing.expect(!hit.isAfter(at.float(2), at.int(5)).lane(0));
    try std.testing.expect(!hit.isBefore(at.float(2), at.int(5)).lane(0));
    try std.testing.expect(hit.isBefore(at.float(2), at.int(6)).lane(0));
    try std.testing.expect(!H.before(at.float(2)).isAfter(at.float(2), at.int(0)).lane(0));
    try std.testing.expect(H.before(at.float(inf)).isAfter(at.float(3e38), at.int(0)).lane(0));
    try std.testing.expect(!H.before(at.float(inf)).isAfter(at.float(inf), at.int(0)).lane(0));
    try std.testing.expect(!H.start().isBefore(at.float(0), at.int(0)).lane(0));
    try std.testing.expect(!H.start().isBefore(at.float(std.math.nan(f32)), at.int(0)).lane(0));
    try std.testing.expect(!H.start().isBefore(at.float(-1), at.int(0)).lane(0));
    try std.testing.expect(H.start().isBefore(at.float(1e-30), at.int(0)).lane(0));
}

test "the long axis comes last, in cyclic order" {
    const directions = [_][3]f32{ .{ -3, 2, 1 }, .{ 1, 3, -2 }, .{ 1, 2, -3 }, .{ 0, 2, 2 } };
    for (directions, [_]u2{ 0, 1, 2, 1 }) |direction, expected| {
        const v: Single.Vec3 = .splat(direction);
        const axis: LongAxis(Single) = .of(v);
        try std.testing.expectEqual(expected, axis.uniform(.splat(true)).?);
        const turned = axis.turn(v).lane(0);
        for (0..3) |place| {
            try std.testing.expectEqual(direction[turnedIndex(expected, place)], turned[place]);
        }
        const line: Line(Single) = .init(.splat(.{ 7, 8, 9 }), v);
        const slabs: RayInverse(Single) = .init(line, &test_padding);
        const masks = axis.turnMasks(slabs.negative);
        for (masks, turned) |mask, component| {
            try std.testing.expectEqual(component < 0, mask.lane(0));
        }
    }
}

test "inverse directions are finite and keep their sign" {
    const directions = [_]f32{ 0, -0.0, 1e-39, -1e-39, 1e-30, -1e-20, 1, -1e18 };
    for (directions) |direction| {
        const slabs: RayInverse(Single) =
            .init(.init(.splat(.{ 0, 0, 0 }), .splat(@splat(direction))), &test_padding);
        const inverse = slabs.direction_inv.x.lane(0);
        try std.testing.expect(std.math.isFinite(inverse) and inverse != 0);
        try std.testing.expectEqual(std.math.signbit(direction), std.math.signbit(inverse));
        try std.testing.expectEqual(std.math.signbit(direction), slabs.negative[0].lane(0));
    }
}
