//! The intrinsics backend: `arm_neon.h` and SSE through C, one function an operation, four lanes.
//!
//! In and out: lane types whose field `v` is a vector of 16 bytes, passed to C in a register.
//! intrinsics.c and the header of the architecture hold the bodies, and full link-time
//! optimization inlines them; without it every operation is a call.

const std = @import("std");
const assert = std.debug.assert;
const derived = @import("derived.zig");

const FloatQuad = @Vector(4, f32);
const IntegerQuad = @Vector(4, i32);
const WordQuad = @Vector(4, u32);

/// Four floats. Asserts (comptime) 4 lanes.
pub fn F32x(comptime lanes: comptime_int) type {
    requireQuad(lanes);
    return struct {
        v: FloatQuad,

        const Self = @This();
        const Truths = Mask(lanes);
        const Integers = I32x(lanes);
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
        pub const minOrNegative = floats.minOrNegative;
        pub const maxOrNegative = floats.maxOrNegative;
        pub const isNegative = floats.isNegative;
        pub const leOrNegative = floats.leOrNegative;

        /// a + b, exact.
        pub inline fn add(a: Self, b: Self) Self {
            return .{ .v = rl_f32x4_add(a.v, b.v) };
        }

        /// a - b, exact.
        pub inline fn sub(a: Self, b: Self) Self {
            return .{ .v = rl_f32x4_sub(a.v, b.v) };
        }

        /// a * b, exact.
        pub inline fn mul(a: Self, b: Self) Self {
            return .{ .v = rl_f32x4_mul(a.v, b.v) };
        }

        /// a / b, exact.
        pub inline fn div(a: Self, b: Self) Self {
            return .{ .v = rl_f32x4_div(a.v, b.v) };
        }

        /// The square root, exact; NaN below -0.
        pub inline fn sqrt(a: Self) Self {
            return .{ .v = rl_f32x4_sqrt(a.v) };
        }

        /// The sign bit flipped, of NaNs too.
        pub inline fn neg(a: Self) Self {
            return .{ .v = rl_f32x4_neg(a.v) };
        }

        /// The sign bit cleared, of NaNs too.
        pub inline fn abs(a: Self) Self {
            return .{ .v = rl_f32x4_abs(a.v) };
        }

        /// The magnitude of `a` with the sign bit of `b`.
        pub inline fn copySign(a: Self, b: Self) Self {
            return .{ .v = rl_f32x4_copy_sign(a.v, b.v) };
        }

        /// a * b + c, rounded once or twice as is quicker on the target: never for pixels.
        pub inline fn mulAdd(a: Self, b: Self, c: Self) Self {
            return .{ .v = rl_f32x4_mul_add(a.v, b.v, c.v) };
        }

        /// a < b ? a : b, so `b` where either is NaN or both are zeros.
        pub inline fn min(a: Self, b: Self) Self {
            return .{ .v = rl_f32x4_min(a.v, b.v) };
        }

        /// a > b ? a : b, so `b` where either is NaN or both are zeros.
        pub inline fn max(a: Self, b: Self) Self {
            return .{ .v = rl_f32x4_max(a.v, b.v) };
        }

        /// The smaller, by the target's quickest instruction: for culling only, since it is
        /// unspecified which comes where either is NaN or both are zeros.
        pub inline fn minFast(a: Self, b: Self) Self {
            return .{ .v = rl_f32x4_min_fast(a.v, b.v) };
        }

        /// The greater, by the target's quickest instruction: for culling only, since it is
        /// unspecified which comes where either is NaN or both are zeros.
        pub inline fn maxFast(a: Self, b: Self) Self {
            return .{ .v = rl_f32x4_max_fast(a.v, b.v) };
        }

        /// a == b; false where either is NaN.
        pub inline fn eq(a: Self, b: Self) Truths {
            return .{ .v = rl_f32x4_eq(a.v, b.v) };
        }

        /// a < b; false where either is NaN.
        pub inline fn lt(a: Self, b: Self) Truths {
            return .{ .v = rl_f32x4_lt(a.v, b.v) };
        }

        /// a <= b; false where either is NaN.
        pub inline fn le(a: Self, b: Self) Truths {
            return .{ .v = rl_f32x4_le(a.v, b.v) };
        }

        /// The lane of `a` where the mask is set, else of `b`.
        pub inline fn select(mask: Truths, a: Self, b: Self) Self {
            return .{ .v = rl_f32x4_select(mask.v, a.v, b.v) };
        }

        /// Lanes of the lower halves in turns: a0 b0 a1 b1 ...
        pub inline fn interleaveLow(a: Self, b: Self) Self {
            return .{ .v = rl_f32x4_interleave_low(a.v, b.v) };
        }

        /// Lanes of the upper halves in turns.
        pub inline fn interleaveHigh(a: Self, b: Self) Self {
            return .{ .v = rl_f32x4_interleave_high(a.v, b.v) };
        }

        /// The least lane, as `min` of the lower and the upper half, halved until one is left.
        pub inline fn reduceMin(a: Self) f32 {
            return rl_f32x4_reduce_min(a.v);
        }

        /// The greatest lane, as `max` of the lower and the upper half, halved until one is left.
        pub inline fn reduceMax(a: Self) f32 {
            return rl_f32x4_reduce_max(a.v);
        }

        /// Truncated toward zero. Asserts |a| < 2^31, so no NaN.
        pub inline fn toI32(a: Self) Integers {
            assert(@reduce(.And, @abs(a.v) < @as(FloatQuad, @splat(0x1p31))));
            return .{ .v = rl_f32x4_to_i32(a.v) };
        }
    };
}

/// Four integers of two's complement; arithmetic wraps. Asserts (comptime) 4 lanes.
pub fn I32x(comptime lanes: comptime_int) type {
    requireQuad(lanes);
    return struct {
        v: IntegerQuad,

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
            return .{ .v = rl_i32x4_add(a.v, b.v) };
        }

        /// a - b, wrapping.
        pub inline fn sub(a: Self, b: Self) Self {
            return .{ .v = rl_i32x4_sub(a.v, b.v) };
        }

        /// The lesser, signed.
        pub inline fn min(a: Self, b: Self) Self {
            return .{ .v = rl_i32x4_min(a.v, b.v) };
        }

        /// The greater, signed.
        pub inline fn max(a: Self, b: Self) Self {
            return .{ .v = rl_i32x4_max(a.v, b.v) };
        }

        /// Bits set in both.
        pub inline fn bitAnd(a: Self, b: Self) Self {
            return .{ .v = rl_i32x4_and(a.v, b.v) };
        }

        /// Bits set in either.
        pub inline fn bitOr(a: Self, b: Self) Self {
            return .{ .v = rl_i32x4_or(a.v, b.v) };
        }

        /// Bits set in one of them.
        pub inline fn bitXor(a: Self, b: Self) Self {
            return .{ .v = rl_i32x4_xor(a.v, b.v) };
        }

        /// a * b, wrapping.
        pub inline fn mul(a: Self, b: Self) Self {
            return .{ .v = rl_i32x4_mul(a.v, b.v) };
        }

        /// Shifted left by `amount` bits, zeros from the right.
        pub inline fn shiftLeft(a: Self, comptime amount: u5) Self {
            return .{ .v = rl_i32x4_shift_left(a.v, amount) };
        }

        /// Shifted right by `amount` bits, zeros from the left.
        pub inline fn shiftRight(a: Self, comptime amount: u5) Self {
            return .{ .v = rl_i32x4_shift_right(a.v, amount) };
        }

        /// a == b.
        pub inline fn eq(a: Self, b: Self) Truths {
            return .{ .v = rl_i32x4_eq(a.v, b.v) };
        }

        /// a < b, signed.
        pub inline fn lt(a: Self, b: Self) Truths {
            return .{ .v = rl_i32x4_lt(a.v, b.v) };
        }

        /// a <= b, signed.
        pub inline fn le(a: Self, b: Self) Truths {
            return .{ .v = rl_i32x4_le(a.v, b.v) };
        }

        /// The lane of `a` where the mask is set, else of `b`.
        pub inline fn select(mask: Truths, a: Self, b: Self) Self {
            return .{ .v = rl_i32x4_select(mask.v, a.v, b.v) };
        }

        /// The nearest float, ties to even; exact up to 2^24.
        pub inline fn toF32(a: Self) Floats {
            return .{ .v = rl_i32x4_to_f32(a.v) };
        }
    };
}

/// Four truth values. Asserts (comptime) 4 lanes.
pub fn Mask(comptime lanes: comptime_int) type {
    requireQuad(lanes);
    return struct {
        v: WordQuad,

        const Self = @This();
        const truths = derived.Truths(Self);
        pub const count = lanes;

        pub const none = truths.none;
        pub const lane = truths.lane;

        /// `x` in every lane.
        pub inline fn splat(x: bool) Self {
            return .{ .v = @splat(if (x) ~@as(u32, 0) else 0) };
        }

        /// Lane l set where bit l is. Asserts that no bit beyond the lanes is set.
        pub inline fn fromBits(mask_bits: u32) Self {
            assert(mask_bits >> (lanes - 1) <= 1);
            return .{ .v = rl_mask4_from_bits(mask_bits) };
        }

        /// Set where both are.
        pub inline fn bitAnd(a: Self, b: Self) Self {
            return .{ .v = rl_mask4_and(a.v, b.v) };
        }

        /// Set where either is.
        pub inline fn bitOr(a: Self, b: Self) Self {
            return .{ .v = rl_mask4_or(a.v, b.v) };
        }

        /// Set where `a` is not.
        pub inline fn bitNot(a: Self) Self {
            return .{ .v = rl_mask4_not(a.v) };
        }

        /// Set where `a` is and `b` is not.
        pub inline fn andNot(a: Self, b: Self) Self {
            return .{ .v = rl_mask4_and_not(a.v, b.v) };
        }

        /// Whether a lane is set.
        pub inline fn any(a: Self) bool {
            return rl_mask4_any(a.v) != 0;
        }

        /// Whether every lane is set.
        pub inline fn all(a: Self) bool {
            return rl_mask4_all(a.v) != 0;
        }

        /// Lane l in bit l, zeros above.
        pub inline fn bits(a: Self) u32 {
            return rl_mask4_bits(a.v);
        }

        /// How many lanes are set.
        pub inline fn popCount(a: Self) u32 {
            return rl_mask4_pop_count(a.v);
        }

        /// The lanes in order, lane 0 first.
        pub inline fn toArray(a: Self) [lanes]bool {
            return a.v != @as(WordQuad, @splat(0));
        }

        /// The lanes as given, `array[0]` in lane 0.
        pub inline fn fromArray(array: [lanes]bool) Self {
            const bools: @Vector(lanes, bool) = array;
            const ones: WordQuad = @splat(~@as(u32, 0));
            return .{ .v = @select(u32, bools, ones, @as(WordQuad, @splat(0))) };
        }
    };
}

fn requireQuad(comptime lanes: comptime_int) void {
    if (lanes != 4) @compileError("the intrinsics have 4 lanes");
}

extern fn rl_f32x4_add(a: FloatQuad, b: FloatQuad) callconv(.c) FloatQuad;
extern fn rl_f32x4_sub(a: FloatQuad, b: FloatQuad) callconv(.c) FloatQuad;
extern fn rl_f32x4_mul(a: FloatQuad, b: FloatQuad) callconv(.c) FloatQuad;
extern fn rl_f32x4_div(a: FloatQuad, b: FloatQuad) callconv(.c) FloatQuad;
extern fn rl_f32x4_sqrt(a: FloatQuad) callconv(.c) FloatQuad;
extern fn rl_f32x4_neg(a: FloatQuad) callconv(.c) FloatQuad;
extern fn rl_f32x4_abs(a: FloatQuad) callconv(.c) FloatQuad;
extern fn rl_f32x4_copy_sign(a: FloatQuad, b: FloatQuad) callconv(.c) FloatQuad;
extern fn rl_f32x4_mul_add(a: FloatQuad, b: FloatQuad, c: FloatQuad) callconv(.c) FloatQuad;
extern fn rl_f32x4_min(a: FloatQuad, b: FloatQuad) callconv(.c) FloatQuad;
extern fn rl_f32x4_max(a: FloatQuad, b: FloatQuad) callconv(.c) FloatQuad;
extern fn rl_f32x4_min_fast(a: FloatQuad, b: FloatQuad) callconv(.c) FloatQuad;
extern fn rl_f32x4_max_fast(a: FloatQuad, b: FloatQuad) callconv(.c) FloatQuad;
extern fn rl_f32x4_eq(a: FloatQuad, b: FloatQuad) callconv(.c) WordQuad;
extern fn rl_f32x4_lt(a: FloatQuad, b: FloatQuad) callconv(.c) WordQuad;
extern fn rl_f32x4_le(a: FloatQuad, b: FloatQuad) callconv(.c) WordQuad;
extern fn rl_f32x4_select(mask: WordQuad, a: FloatQuad, b: FloatQuad) callconv(.c) FloatQuad;
extern fn rl_f32x4_interleave_low(a: FloatQuad, b: FloatQuad) callconv(.c) FloatQuad;
extern fn rl_f32x4_interleave_high(a: FloatQuad, b: FloatQuad) callconv(.c) FloatQuad;
extern fn rl_f32x4_reduce_min(a: FloatQuad) callconv(.c) f32;
extern fn rl_f32x4_reduce_max(a: FloatQuad) callconv(.c) f32;
extern fn rl_f32x4_to_i32(a: FloatQuad) callconv(.c) IntegerQuad;
extern fn rl_i32x4_add(a: IntegerQuad, b: IntegerQuad) callconv(.c) IntegerQuad;
extern fn rl_i32x4_sub(a: IntegerQuad, b: IntegerQuad) callconv(.c) IntegerQuad;
extern fn rl_i32x4_min(a: IntegerQuad, b: IntegerQuad) callconv(.c) IntegerQuad;
extern fn rl_i32x4_max(a: IntegerQuad, b: IntegerQuad) callconv(.c) IntegerQuad;
extern fn rl_i32x4_and(a: IntegerQuad, b: IntegerQuad) callconv(.c) IntegerQuad;
extern fn rl_i32x4_or(a: IntegerQuad, b: IntegerQuad) callconv(.c) IntegerQuad;
extern fn rl_i32x4_xor(a: IntegerQuad, b: IntegerQuad) callconv(.c) IntegerQuad;
extern fn rl_i32x4_mul(a: IntegerQuad, b: IntegerQuad) callconv(.c) IntegerQuad;
extern fn rl_i32x4_shift_left(a: IntegerQuad, amount: u32) callconv(.c) IntegerQuad;
extern fn rl_i32x4_shift_right(a: IntegerQuad, amount: u32) callconv(.c) IntegerQuad;
extern fn rl_i32x4_eq(a: IntegerQuad, b: IntegerQuad) callconv(.c) WordQuad;
extern fn rl_i32x4_lt(a: IntegerQuad, b: IntegerQuad) callconv(.c) WordQuad;
extern fn rl_i32x4_le(a: IntegerQuad, b: IntegerQuad) callconv(.c) WordQuad;
extern fn rl_i32x4_select(mask: WordQuad, a: IntegerQuad, b: IntegerQuad) callconv(.c) IntegerQuad;
extern fn rl_i32x4_to_f32(a: IntegerQuad) callconv(.c) FloatQuad;
extern fn rl_mask4_and(a: WordQuad, b: WordQuad) callconv(.c) WordQuad;
extern fn rl_mask4_or(a: WordQuad, b: WordQuad) callconv(.c) WordQuad;
extern fn rl_mask4_not(a: WordQuad) callconv(.c) WordQuad;
extern fn rl_mask4_and_not(a: WordQuad, b: WordQuad) callconv(.c) WordQuad;
extern fn rl_mask4_from_bits(bits: u32) callconv(.c) WordQuad;
extern fn rl_mask4_any(a: WordQuad) callconv(.c) u32;
extern fn rl_mask4_all(a: WordQuad) callconv(.c) u32;
extern fn rl_mask4_bits(a: WordQuad) callconv(.c) u32;
extern fn rl_mask4_pop_count(a: WordQuad) callconv(.c) u32;
