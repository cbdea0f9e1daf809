//! The scalar backend: arrays of lanes and plain loops over them; the reference for the others.
//!
//! In and out: lane types whose field `v` is `[lanes]f32`, `[lanes]i32` or `[lanes]bool`. Every
//! exact operation is one IEEE operation a lane, with no state between lanes. With one lane this
//! is the arithmetic of the single values themselves, and serves all backends.

const std = @import("std");
const assert = std.debug.assert;
const derived = @import("derived.zig");
const hardware = @import("hardware.zig");

/// `lanes` floats.
pub fn F32x(comptime lanes: comptime_int) type {
    return struct {
        v: [lanes]f32,

        const Self = @This();
        const Truths = Mask(lanes);
        const Integers = I32x(lanes);
        const Half = F32x(lanes / 2);
        const moves = derived.Moves(Self, f32, lanes);
        const floats = derived.Floats(Self, Integers, Truths);
        pub const count = lanes;

        pub const splat = moves.splat;
        pub const zero = moves.zero;
        pub const iota = moves.iota;
        pub const fromArray = moves.fromArray;
        pub const toArray = moves.toArray;
        pub const load = moves.load;
        pub const loadAligned = moves.loadAligned;
        pub const store = moves.store;
        pub const storeAligned = moves.storeAligned;
        pub const lane = moves.lane;
        pub const laneIn = moves.laneIn;
        pub const gt = floats.gt;
        pub const ge = floats.ge;
        pub const reduceSum = floats.reduceSum;
        pub const bitcast = floats.bitcast;
        // One value has to leave the floats' registers to be an integer.
        pub const minOrNegative = minFast;
        pub const maxOrNegative = maxFast;
        pub const leOrNegative = le;
        pub const isNegative = floats.isNegative;

        /// a + b, exact.
        pub inline fn add(a: Self, b: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = x + y;
            return result;
        }

        /// a - b, exact.
        pub inline fn sub(a: Self, b: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = x - y;
            return result;
        }

        /// a * b, exact.
        pub inline fn mul(a: Self, b: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = x * y;
            return result;
        }

        /// a / b, exact.
        pub inline fn div(a: Self, b: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = x / y;
            return result;
        }

        /// The square root, exact; NaN below -0.
        pub inline fn sqrt(a: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v) |*r, x| r.* = @sqrt(x);
            return result;
        }

        /// The sign bit flipped, of NaNs too.
        pub inline fn neg(a: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v) |*r, x| r.* = -x;
            return result;
        }

        /// The sign bit cleared, of NaNs too.
        pub inline fn abs(a: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v) |*r, x| r.* = @abs(x);
            return result;
        }

        /// The magnitude of `a` with the sign bit of `b`.
        pub inline fn copySign(a: Self, b: Self) Self {
            const sign: u32 = 0x8000_0000;
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| {
                const magnitude = @as(u32, @bitCast(x)) & ~sign;
                r.* = @bitCast(magnitude | (@as(u32, @bitCast(y)) & sign));
            }
            return result;
        }

        /// a * b + c, rounded once or twice as is quicker on the target: never for pixels.
        pub inline fn mulAdd(a: Self, b: Self, c: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v, b.v, c.v) |*r, x, y, z| {
                r.* = if (hardware.has_fused) @mulAdd(f32, x, y, z) else x * y + z;
            }
            return result;
        }

        /// a < b ? a : b, so `b` where either is NaN or both are zeros.
        pub inline fn min(a: Self, b: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = if (x < y) x else y;
            return result;
        }

        /// a > b ? a : b, so `b` where either is NaN or both are zeros.
        pub inline fn max(a: Self, b: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = if (x > y) x else y;
            return result;
        }

        /// The smaller, by the target's quickest instruction: for culling only, since it is
        /// unspecified which comes where either is NaN or both are zeros.
        pub inline fn minFast(a: Self, b: Self) Self {
            if (hardware.arch != .aarch64) return a.min(b);
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = @min(x, y);
            return result;
        }

        /// The greater, by the target's quickest instruction: for culling only, since it is
        /// unspecified which comes where either is NaN or both are zeros.
        pub inline fn maxFast(a: Self, b: Self) Self {
            if (hardware.arch != .aarch64) return a.max(b);
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = @max(x, y);
            return result;
        }

        /// a == b; false where either is NaN.
        pub inline fn eq(a: Self, b: Self) Truths {
            var result: Truths = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = x == y;
            return result;
        }

        /// a < b; false where either is NaN.
        pub inline fn lt(a: Self, b: Self) Truths {
            var result: Truths = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = x < y;
            return result;
        }

        /// a <= b; false where either is NaN.
        pub inline fn le(a: Self, b: Self) Truths {
            var result: Truths = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = x <= y;
            return result;
        }

        /// The lane of `a` where the mask is set, else of `b`.
        pub inline fn select(mask: Truths, a: Self, b: Self) Self {
            var result: Self = undefined;
            for (&result.v, mask.v, a.v, b.v) |*r, m, x, y| r.* = if (m) x else y;
            return result;
        }

        /// Lanes of the lower halves in turns: a0 b0 a1 b1 ... Asserts (comptime) an even count.
        pub inline fn interleaveLow(a: Self, b: Self) Self {
            comptime assert(lanes % 2 == 0);
            var result: Self = undefined;
            for (0..lanes / 2) |index| {
                result.v[2 * index] = a.v[index];
                result.v[2 * index + 1] = b.v[index];
            }
            return result;
        }

        /// Lanes of the upper halves in turns. Asserts (comptime) an even count.
        pub inline fn interleaveHigh(a: Self, b: Self) Self {
            comptime assert(lanes % 2 == 0);
            var result: Self = undefined;
            for (0..lanes / 2) |index| {
                result.v[2 * index] = a.v[lanes / 2 + index];
                result.v[2 * index + 1] = b.v[lanes / 2 + index];
            }
            return result;
        }

        /// The least lane, as `min` of the lower and the upper half, halved until one is left.
        pub inline fn reduceMin(a: Self) f32 {
            if (lanes == 1) return a.v[0];
            const low: Half = .{ .v = a.v[0 .. lanes / 2].* };
            const high: Half = .{ .v = a.v[lanes / 2 ..].* };
            return low.min(high).reduceMin();
        }

        /// The greatest lane, as `max` of the lower and the upper half, halved until one is left.
        pub inline fn reduceMax(a: Self) f32 {
            if (lanes == 1) return a.v[0];
            const low: Half = .{ .v = a.v[0 .. lanes / 2].* };
            const high: Half = .{ .v = a.v[lanes / 2 ..].* };
            return low.max(high).reduceMax();
        }

        /// Truncated toward zero. Asserts |a| < 2^31, so no NaN.
        pub inline fn toI32(a: Self) Integers {
            var result: Integers = undefined;
            for (&result.v, a.v) |*r, x| {
                assert(@abs(x) < 0x1p31);
                r.* = @intFromFloat(x);
            }
            return result;
        }
    };
}

/// `lanes` integers of two's complement; arithmetic wraps.
pub fn I32x(comptime lanes: comptime_int) type {
    return struct {
        v: [lanes]i32,

        const Self = @This();
        const Truths = Mask(lanes);
        const Floats = F32x(lanes);
        const moves = derived.Moves(Self, i32, lanes);
        const integers = derived.Integers(Self, Floats, Truths);
        pub const count = lanes;

        pub const splat = moves.splat;
        pub const zero = moves.zero;
        pub const iota = moves.iota;
        pub const fromArray = moves.fromArray;
        pub const toArray = moves.toArray;
        pub const load = moves.load;
        pub const loadAligned = moves.loadAligned;
        pub const store = moves.store;
        pub const storeAligned = moves.storeAligned;
        pub const lane = moves.lane;
        pub const laneIn = moves.laneIn;
        pub const gt = integers.gt;
        pub const bitcast = integers.bitcast;

        /// a + b, wrapping.
        pub inline fn add(a: Self, b: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = x +% y;
            return result;
        }

        /// a - b, wrapping.
        pub inline fn sub(a: Self, b: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = x -% y;
            return result;
        }

        /// The lesser, signed.
        pub inline fn min(a: Self, b: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = @min(x, y);
            return result;
        }

        /// The greater, signed.
        pub inline fn max(a: Self, b: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = @max(x, y);
            return result;
        }

        /// Bits set in both.
        pub inline fn bitAnd(a: Self, b: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = x & y;
            return result;
        }

        /// Bits set in either.
        pub inline fn bitOr(a: Self, b: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = x | y;
            return result;
        }

        /// Bits set in one of them.
        pub inline fn bitXor(a: Self, b: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = x ^ y;
            return result;
        }

        /// a * b, wrapping.
        pub inline fn mul(a: Self, b: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = x *% y;
            return result;
        }

        /// Shifted left by `amount` bits, zeros from the right.
        pub inline fn shiftLeft(a: Self, comptime amount: u5) Self {
            var result: Self = undefined;
            for (&result.v, a.v) |*r, x| r.* = x << amount;
            return result;
        }

        /// Shifted right by `amount` bits, zeros from the left.
        pub inline fn shiftRight(a: Self, comptime amount: u5) Self {
            var result: Self = undefined;
            for (&result.v, a.v) |*r, x| r.* = @bitCast(@as(u32, @bitCast(x)) >> amount);
            return result;
        }

        /// a == b.
        pub inline fn eq(a: Self, b: Self) Truths {
            var result: Truths = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = x == y;
            return result;
        }

        /// a < b, signed.
        pub inline fn lt(a: Self, b: Self) Truths {
            var result: Truths = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = x < y;
            return result;
        }

        /// a <= b, signed.
        pub inline fn le(a: Self, b: Self) Truths {
            var result: Truths = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = x <= y;
            return result;
        }

        /// The lane of `a` where the mask is set, else of `b`.
        pub inline fn select(mask: Truths, a: Self, b: Self) Self {
            var result: Self = undefined;
            for (&result.v, mask.v, a.v, b.v) |*r, m, x, y| r.* = if (m) x else y;
            return result;
        }

        /// The nearest float, ties to even; exact up to 2^24.
        pub inline fn toF32(a: Self) Floats {
            var result: Floats = undefined;
            for (&result.v, a.v) |*r, x| r.* = @floatFromInt(x);
            return result;
        }
    };
}

/// `lanes` truth values.
pub fn Mask(comptime lanes: comptime_int) type {
    return struct {
        v: [lanes]bool,

        const Self = @This();
        const truths = derived.Truths(Self);
        pub const count = lanes;

        pub const none = truths.none;
        pub const lane = truths.lane;

        /// `x` in every lane.
        pub inline fn splat(x: bool) Self {
            return .{ .v = @splat(x) };
        }

        /// Lane l set where bit l is. Asserts that no bit beyond the lanes is set.
        pub inline fn fromBits(mask_bits: u32) Self {
            assert(mask_bits >> (lanes - 1) <= 1);
            var result: Self = undefined;
            for (&result.v, 0..) |*r, index| {
                r.* = (mask_bits >> @intCast(index)) & 1 != 0;
            }
            return result;
        }

        /// Set where both are.
        pub inline fn bitAnd(a: Self, b: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = x and y;
            return result;
        }

        /// Set where either is.
        pub inline fn bitOr(a: Self, b: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = x or y;
            return result;
        }

        /// Set where `a` is not.
        pub inline fn bitNot(a: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v) |*r, x| r.* = !x;
            return result;
        }

        /// Set where `a` is and `b` is not.
        pub inline fn andNot(a: Self, b: Self) Self {
            var result: Self = undefined;
            for (&result.v, a.v, b.v) |*r, x, y| r.* = x and !y;
            return result;
        }

        /// Whether a lane is set.
        pub inline fn any(a: Self) bool {
            return a.bits() != 0;
        }

        /// Whether every lane is set.
        pub inline fn all(a: Self) bool {
            return a.bits() == (1 << lanes) - 1;
        }

        /// Lane l in bit l, zeros above.
        pub inline fn bits(a: Self) u32 {
            var result: u32 = 0;
            for (a.v, 0..) |x, index| {
                result |= @as(u32, @intFromBool(x)) << @intCast(index);
            }
            return result;
        }

        /// How many lanes are set.
        pub inline fn popCount(a: Self) u32 {
            var result: u32 = 0;
            for (a.v) |x| result += @intFromBool(x);
            return result;
        }

        /// The lanes in order, lane 0 first.
        pub inline fn toArray(a: Self) [lanes]bool {
            return a.v;
        }

        /// The lanes as given, `array[0]` in lane 0.
        pub inline fn fromArray(array: [lanes]bool) Self {
            return .{ .v = array };
        }
    };
}
