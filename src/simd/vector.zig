//! The vector backend: Zig's `@Vector`, with the form of each operation chosen by target.
//!
//! In and out: lane types whose field `v` is a vector. Where a target has several instructions
//! for one operation, the form written here is the one whose assembly is shortest; docs/lowering.md
//! has the counts. A mask is a vector of all-ones or all-zeros words, so that it can stay in one
//! register across loops and feed a bitwise select, except where the target has mask registers.

const std = @import("std");
const assert = std.debug.assert;
const derived = @import("derived.zig");
const hardware = @import("hardware.zig");

/// `lanes` floats.
pub fn F32x(comptime lanes: comptime_int) type {
    return struct {
        v: V,

        const Self = @This();
        const V = @Vector(lanes, f32);
        const moves = derived.Moves(Self, f32, lanes);
        const floats = derived.Floats(Self, Integers, Truths);
        // Types and index tables have names here, because in an inline function every call of a
        // comptime function counts against its caller's evaluation quota.
        const Truths = Mask(lanes);
        const Integers = I32x(lanes);
        const Half = F32x(lanes / 2);
        const low_lanes = interleaved(lanes, 0);
        const high_lanes = interleaved(lanes, lanes / 2);
        const lower_half = std.simd.iota(i32, lanes / 2);
        const upper_half = lower_half + @as(@Vector(lanes / 2, i32), @splat(lanes / 2));
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
            return .{ .v = a.v + b.v };
        }

        /// a - b, exact.
        pub inline fn sub(a: Self, b: Self) Self {
            return .{ .v = a.v - b.v };
        }

        /// a * b, exact.
        pub inline fn mul(a: Self, b: Self) Self {
            return .{ .v = a.v * b.v };
        }

        /// a / b, exact.
        pub inline fn div(a: Self, b: Self) Self {
            return .{ .v = a.v / b.v };
        }

        /// The square root, exact; NaN below -0.
        pub inline fn sqrt(a: Self) Self {
            return .{ .v = @sqrt(a.v) };
        }

        /// The sign bit flipped, of NaNs too.
        pub inline fn neg(a: Self) Self {
            return .{ .v = -a.v };
        }

        /// The sign bit cleared, of NaNs too.
        pub inline fn abs(a: Self) Self {
            return .{ .v = @abs(a.v) };
        }

        /// The magnitude of `a` with the sign bit of `b`.
        pub inline fn copySign(a: Self, b: Self) Self {
            const sign: Truths.Words = @splat(0x8000_0000);
            const magnitude = wordsOf(a) & ~sign;
            return .{ .v = @bitCast(magnitude | (wordsOf(b) & sign)) };
        }

        /// a * b + c, rounded once or twice as is quicker on the target: never for pixels.
        pub inline fn mulAdd(a: Self, b: Self, c: Self) Self {
            return .{ .v = if (hardware.has_fused) @mulAdd(V, a.v, b.v, c.v) else a.v * b.v + c.v };
        }

        /// a < b ? a : b, so `b` where either is NaN or both are zeros: x86's `minps`, two
        /// instructions on ARM.
        pub inline fn min(a: Self, b: Self) Self {
            return .{ .v = @select(f32, a.v < b.v, a.v, b.v) };
        }

        /// a > b ? a : b, so `b` where either is NaN or both are zeros: x86's `maxps`, two
        /// instructions on ARM.
        pub inline fn max(a: Self, b: Self) Self {
            return .{ .v = @select(f32, a.v > b.v, a.v, b.v) };
        }

        /// The smaller, by the target's quickest instruction: for culling only, since it is
        /// unspecified which comes where either is NaN or both are zeros.
        pub inline fn minFast(a: Self, b: Self) Self {
            return if (hardware.arch == .aarch64) .{ .v = @min(a.v, b.v) } else a.min(b);
        }

        /// The greater, by the target's quickest instruction: for culling only, since it is
        /// unspecified which comes where either is NaN or both are zeros.
        pub inline fn maxFast(a: Self, b: Self) Self {
            return if (hardware.arch == .aarch64) .{ .v = @max(a.v, b.v) } else a.max(b);
        }

        /// a == b; false where either is NaN.
        pub inline fn eq(a: Self, b: Self) Truths {
            return .fromBools(a.v == b.v);
        }

        /// a < b; false where either is NaN.
        pub inline fn lt(a: Self, b: Self) Truths {
            return .fromBools(a.v < b.v);
        }

        /// a <= b; false where either is NaN.
        pub inline fn le(a: Self, b: Self) Truths {
            return .fromBools(a.v <= b.v);
        }

        /// The lane of `a` where the mask is set, else of `b`.
        pub inline fn select(mask: Truths, a: Self, b: Self) Self {
            if (Truths.selects_by_bool) {
                return .{ .v = @select(f32, mask.toBools(), a.v, b.v) };
            }
            return .{ .v = @bitCast((mask.v & wordsOf(a)) | (~mask.v & wordsOf(b))) };
        }

        /// Lanes of the lower halves in turns: a0 b0 a1 b1 ... Asserts (comptime) an even count.
        pub inline fn interleaveLow(a: Self, b: Self) Self {
            return .{ .v = @shuffle(f32, a.v, b.v, low_lanes) };
        }

        /// Lanes of the upper halves in turns. Asserts (comptime) an even count.
        pub inline fn interleaveHigh(a: Self, b: Self) Self {
            return .{ .v = @shuffle(f32, a.v, b.v, high_lanes) };
        }

        /// The least lane, as `min` of the lower and the upper half, halved until one is left.
        pub inline fn reduceMin(a: Self) f32 {
            if (lanes == 2) return a.min(a.swapped()).v[0];
            return a.lowerHalf().min(a.upperHalf()).reduceMin();
        }

        /// The greatest lane, as `max` of the lower and the upper half, halved until one is left.
        pub inline fn reduceMax(a: Self) f32 {
            if (lanes == 2) return a.max(a.swapped()).v[0];
            return a.lowerHalf().max(a.upperHalf()).reduceMax();
        }

        /// Truncated toward zero. Asserts |a| < 2^31, so no NaN.
        pub inline fn toI32(a: Self) Integers {
            assert(@reduce(.And, @abs(a.v) < @as(V, @splat(0x1p31))));
            return .{ .v = @intFromFloat(a.v) };
        }

        inline fn lowerHalf(a: Self) Half {
            return .{ .v = @shuffle(f32, a.v, undefined, lower_half) };
        }

        inline fn upperHalf(a: Self) Half {
            return .{ .v = @shuffle(f32, a.v, undefined, upper_half) };
        }

        /// The two lanes the other way round: the last step of a reduction stays in a register,
        /// 6 instructions on AArch64 instead of 11 through scalars.
        inline fn swapped(a: Self) Self {
            return .{ .v = @shuffle(f32, a.v, undefined, [2]i32{ 1, 0 }) };
        }

        inline fn wordsOf(a: Self) Truths.Words {
            return @bitCast(a.v);
        }
    };
}

/// Indices for `@shuffle` that take lanes from `first` up from both operands in turns.
fn interleaved(comptime lanes: comptime_int, comptime first: comptime_int) @Vector(lanes, i32) {
    comptime assert(lanes % 2 == 0);
    var indices: [lanes]i32 = undefined;
    for (0..lanes / 2) |index| {
        indices[2 * index] = first + index;
        indices[2 * index + 1] = ~@as(i32, first + index);
    }
    return indices;
}

/// `lanes` integers of two's complement; arithmetic wraps.
pub fn I32x(comptime lanes: comptime_int) type {
    return struct {
        v: V,

        const Self = @This();
        const V = @Vector(lanes, i32);
        const Unsigned = @Vector(lanes, u32);
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
            return .{ .v = a.v +% b.v };
        }

        /// a - b, wrapping.
        pub inline fn sub(a: Self, b: Self) Self {
            return .{ .v = a.v -% b.v };
        }

        /// The lesser, signed.
        pub inline fn min(a: Self, b: Self) Self {
            return .{ .v = @min(a.v, b.v) };
        }

        /// The greater, signed.
        pub inline fn max(a: Self, b: Self) Self {
            return .{ .v = @max(a.v, b.v) };
        }

        /// Bits set in both.
        pub inline fn bitAnd(a: Self, b: Self) Self {
            return .{ .v = a.v & b.v };
        }

        /// Bits set in either.
        pub inline fn bitOr(a: Self, b: Self) Self {
            return .{ .v = a.v | b.v };
        }

        /// Bits set in one of them.
        pub inline fn bitXor(a: Self, b: Self) Self {
            return .{ .v = a.v ^ b.v };
        }

        /// a * b, wrapping.
        pub inline fn mul(a: Self, b: Self) Self {
            return .{ .v = a.v *% b.v };
        }

        /// Shifted left by `amount` bits, zeros from the right.
        pub inline fn shiftLeft(a: Self, comptime amount: u5) Self {
            return .{ .v = a.v << @splat(amount) };
        }

        /// Shifted right by `amount` bits, zeros from the left.
        pub inline fn shiftRight(a: Self, comptime amount: u5) Self {
            return .{ .v = @bitCast(@as(Unsigned, @bitCast(a.v)) >> @splat(amount)) };
        }

        /// a == b.
        pub inline fn eq(a: Self, b: Self) Truths {
            return .fromBools(a.v == b.v);
        }

        /// a < b, signed.
        pub inline fn lt(a: Self, b: Self) Truths {
            return .fromBools(a.v < b.v);
        }

        /// a <= b, signed.
        pub inline fn le(a: Self, b: Self) Truths {
            return .fromBools(a.v <= b.v);
        }

        /// The lane of `a` where the mask is set, else of `b`.
        pub inline fn select(mask: Truths, a: Self, b: Self) Self {
            return Floats.select(mask, a.bitcast(), b.bitcast()).bitcast();
        }

        /// The nearest float, ties to even; exact up to 2^24.
        pub inline fn toF32(a: Self) Floats {
            return .{ .v = @floatFromInt(a.v) };
        }
    };
}

/// `lanes` truth values.
pub fn Mask(comptime lanes: comptime_int) type {
    return struct {
        v: if (in_mask_register) Bools else Words,

        const Self = @This();
        const truths = derived.Truths(Self);
        const Bools = @Vector(lanes, bool);
        const Words = @Vector(lanes, u32);
        const Signed = @Vector(lanes, i32);
        const Bits = @Int(.unsigned, lanes);
        // Four bits are no byte: such masks go through memory, 7 instructions instead of 1.
        const in_mask_register = hardware.has_mask_registers and lanes >= 8;
        const selects_by_bool = in_mask_register or hardware.has_sign_blend;
        const HalfMask = Mask(lanes / 2);
        const lower_half = std.simd.iota(i32, lanes / 2);
        const upper_half = lower_half + @as(@Vector(lanes / 2, i32), @splat(lanes / 2));
        /// Bit l in lane l.
        const weights: Words = @as(Words, @splat(1)) << std.simd.iota(u5, lanes);
        pub const count = lanes;

        pub const none = truths.none;
        pub const lane = truths.lane;

        /// `x` in every lane.
        pub inline fn splat(x: bool) Self {
            if (in_mask_register) return .{ .v = @splat(x) };
            return .{ .v = @splat(if (x) ~@as(u32, 0) else 0) };
        }

        /// Lane l set where bit l is. Asserts that no bit beyond the lanes is set.
        pub inline fn fromBits(mask_bits: u32) Self {
            assert(mask_bits >> (lanes - 1) <= 1);
            if (in_mask_register) return .{ .v = @bitCast(@as(Bits, @truncate(mask_bits))) };
            return fromBools((@as(Words, @splat(mask_bits)) & weights) == weights);
        }

        /// Set where both are.
        pub inline fn bitAnd(a: Self, b: Self) Self {
            return .{ .v = a.v & b.v };
        }

        /// Set where either is.
        pub inline fn bitOr(a: Self, b: Self) Self {
            return .{ .v = a.v | b.v };
        }

        /// Set where `a` is not.
        pub inline fn bitNot(a: Self) Self {
            return .{ .v = ~a.v };
        }

        /// Set where `a` is and `b` is not.
        pub inline fn andNot(a: Self, b: Self) Self {
            return .{ .v = a.v & ~b.v };
        }

        /// Whether a lane is set.
        pub inline fn any(a: Self) bool {
            return switch (hardware.arch) {
                .x86 => @reduce(.Or, a.toBools()),
                .aarch64 => @reduce(.Max, a.v) != 0,
                .arm => a.joined(.Or) != 0,
            };
        }

        /// Whether every lane is set.
        pub inline fn all(a: Self) bool {
            return switch (hardware.arch) {
                .x86 => @reduce(.And, a.toBools()),
                .aarch64 => @reduce(.Min, a.v) != 0,
                .arm => a.joined(.And) == ~@as(u64, 0),
            };
        }

        /// Lane l in bit l, zeros above.
        pub inline fn bits(a: Self) u32 {
            return switch (hardware.arch) {
                .x86 => @as(Bits, @bitCast(a.toBools())),
                .aarch64 => @reduce(.Add, a.v & weights),
                .arm => bits: {
                    const words = joined(.{ .v = a.v & weights }, .Or);
                    break :bits @truncate(words | words >> 32);
                },
            };
        }

        /// How many lanes are set.
        pub inline fn popCount(a: Self) u32 {
            return switch (hardware.arch) {
                .x86 => @popCount(a.bits()),
                // A set lane is -1; there is no popcount of general registers.
                .aarch64 => 0 -% @reduce(.Add, a.v),
                .arm => count: {
                    const words = a.joined(.Add);
                    break :count 0 -% @as(u32, @truncate(words +% (words >> 32)));
                },
            };
        }

        /// The lanes in order, lane 0 first.
        pub inline fn toArray(a: Self) [lanes]bool {
            return a.toBools();
        }

        /// The lanes as given, `array[0]` in lane 0.
        pub inline fn fromArray(array: [lanes]bool) Self {
            return fromBools(array);
        }

        inline fn fromBools(bools: Bools) Self {
            if (in_mask_register) return .{ .v = bools };
            const ones: Words = @splat(~@as(u32, 0));
            return .{ .v = @select(u32, bools, ones, @as(Words, @splat(0))) };
        }

        /// By the sign bit alone, which is what x86's blends and `movmskps` look at.
        inline fn toBools(a: Self) Bools {
            if (in_mask_register) return a.v;
            return @as(Signed, @bitCast(a.v)) < @as(Signed, @splat(0));
        }

        /// All lanes joined into two words by `op`, the first in the lower bits: one move from NEON
        /// to two general registers, where `@reduce` moves lane by lane.
        inline fn joined(a: Self, comptime op: std.lang.ReduceOp) u64 {
            if (lanes == 2) return @bitCast(a.v);
            const low = @shuffle(u32, a.v, undefined, lower_half);
            const high = @shuffle(u32, a.v, undefined, upper_half);
            return HalfMask.joined(.{ .v = switch (op) {
                .And => low & high,
                .Or => low | high,
                .Add => low +% high,
                else => @compileError("joins masks by and, or, add"),
            } }, op);
        }
    };
}
