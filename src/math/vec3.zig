//! Points, directions and colours as three floats, with the few operations the stages need.
//!
//! Generic over the float and over how three of them are held. Sums run x, y, z in this order
//! everywhere; `min` and `max` are comparisons (the same bits on every target), so a NaN in the
//! first operand yields the second.

const std = @import("std");

/// The operations on `V`, an array or a vector of three floats: x, y, z or red, green, blue.
pub fn Operations(comptime V: type) type {
    return struct {
        const Float = std.meta.Elem(V);

        /// a + b by component.
        pub inline fn add(a: V, b: V) V {
            return .{ a[0] + b[0], a[1] + b[1], a[2] + b[2] };
        }

        /// a - b by component.
        pub inline fn sub(a: V, b: V) V {
            return .{ a[0] - b[0], a[1] - b[1], a[2] - b[2] };
        }

        /// a * b by component.
        pub inline fn mul(a: V, b: V) V {
            return .{ a[0] * b[0], a[1] * b[1], a[2] * b[2] };
        }

        /// Every component times `factor`.
        pub inline fn scale(a: V, factor: Float) V {
            return .{ a[0] * factor, a[1] * factor, a[2] * factor };
        }

        /// -a.
        pub inline fn neg(a: V) V {
            return .{ -a[0], -a[1], -a[2] };
        }

        /// (x x' + y y') + z z'.
        pub inline fn dot(a: V, b: V) Float {
            return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
        }

        /// The right-handed cross product.
        pub inline fn cross(a: V, b: V) V {
            return .{
                a[1] * b[2] - a[2] * b[1],
                a[2] * b[0] - a[0] * b[2],
                a[0] * b[1] - a[1] * b[0],
            };
        }

        /// Euclidean length.
        pub inline fn length(a: V) Float {
            return @sqrt(dot(a, a));
        }

        /// The sum of the components' sizes: at least the Euclidean length, at most 1.74 times it.
        pub inline fn length1(a: V) Float {
            return @abs(a[0]) + @abs(a[1]) + @abs(a[2]);
        }

        /// `a` scaled to length 1, or null where that has no meaning (zero, tiny, huge, not a
        /// number). Scaled by the largest component first, so that neither squares nor their sum
        /// leave the range.
        pub fn normalize(a: V) ?V {
            const largest = maxComponent(.{ @abs(a[0]), @abs(a[1]), @abs(a[2]) });
            if (!(largest > std.math.floatMin(Float))) return null;
            if (largest == std.math.inf(Float)) return null;
            const b: V = .{ a[0] / largest, a[1] / largest, a[2] / largest };
            const b_length = length(b);
            // A NaN component hides behind the comparisons above.
            if (!(b_length >= 1)) return null;
            return .{ b[0] / b_length, b[1] / b_length, b[2] / b_length };
        }

        /// The smaller by component: a < b ? a : b.
        pub inline fn min(a: V, b: V) V {
            var c: V = undefined;
            inline for (0..3) |axis| c[axis] = if (a[axis] < b[axis]) a[axis] else b[axis];
            return c;
        }

        /// The larger by component: a > b ? a : b.
        pub inline fn max(a: V, b: V) V {
            var c: V = undefined;
            inline for (0..3) |axis| c[axis] = if (a[axis] > b[axis]) a[axis] else b[axis];
            return c;
        }

        /// The largest of the three.
        pub inline fn maxComponent(a: V) Float {
            const xy = if (a[0] > a[1]) a[0] else a[1];
            return if (xy > a[2]) xy else a[2];
        }

        /// Whether no component is infinite or NaN.
        pub inline fn isFinite(a: V) bool {
            return std.math.isFinite(a[0]) and std.math.isFinite(a[1]) and std.math.isFinite(a[2]);
        }

        /// `a` at t = 0, `b` at t = 1.
        pub inline fn mix(a: V, b: V, t: Float) V {
            return add(a, scale(sub(b, a), t));
        }

        /// Rounded to f32: what is out of range at its end, denormals as zeros.
        pub fn toSingle(a: V) [3]f32 {
            const largest: Float = std.math.floatMax(f32);
            var result: [3]f32 = undefined;
            inline for (&result, 0..) |*component, axis| {
                const bounded = std.math.clamp(a[axis], -largest, largest);
                component.* = flushDenormal(@floatCast(bounded));
            }
            return result;
        }
    };
}

/// `value` with a denormal number replaced by zero of its sign: what flush-to-zero hardware reads.
pub inline fn flushDenormal(value: f32) f32 {
    const zero = std.math.copysign(@as(f32, 0), value);
    return if (@abs(value) < std.math.floatMin(f32)) zero else value;
}

const single = Operations(Vec3);
const Vec3 = [3]f32;

test "cross is right-handed and exactly antisymmetric" {
    try std.testing.expectEqual(Vec3{ 0, 0, 1 }, single.cross(.{ 1, 0, 0 }, .{ 0, 1, 0 }));
    const a: Vec3 = .{ 0.1, -2.7, 3.3e5 };
    const b: Vec3 = .{ 7.1, 1e-3, -0.3 };
    try std.testing.expectEqual(single.cross(a, b), single.neg(single.cross(b, a)));
}

test "normalize keeps to its word at the edges" {
    try std.testing.expectEqual(null, single.normalize(.{ 0, 0, 0 }));
    try std.testing.expectEqual(null, single.normalize(.{ std.math.nan(f32), 1, 0 }));
    try std.testing.expectEqual(null, single.normalize(.{ 1, 0, std.math.nan(f32) }));
    try std.testing.expectEqual(null, single.normalize(.{ std.math.inf(f32), 1, 0 }));
    try std.testing.expectEqual(Vec3{ 0, 1, 0 }, single.normalize(.{ 0, 1e-30, 0 }).?);
    for ([_]f32{ 1e-36, 1e-20, 1, 1e19, 3e38 }) |size| {
        const unit = single.normalize(.{ size, -size, size }).?;
        try std.testing.expectApproxEqAbs(@as(f32, 1), single.length(unit), 2e-7);
    }
}

test "denormals are flushed with their sign" {
    try std.testing.expectEqual(@as(u32, 0x8000_0000), @as(u32, @bitCast(flushDenormal(-1e-39))));
    try std.testing.expectEqual(std.math.floatMin(f32), flushDenormal(std.math.floatMin(f32)));
    try std.testing.expect(std.math.isNan(flushDenormal(std.math.nan(f32))));
}
