//! Derived operations: they follow from primitives and are the same text in every backend.
//!
//! In: a lane type of a backend, whose field `v` is an array or a vector of its lanes. Out: the
//! declarations that the backend's type re-exports.

const std = @import("std");
const hardware = @import("hardware.zig");
const assert = std.debug.assert;

/// Operations of a lane type `Self` over `Element` that only move values, never compute.
pub fn Moves(comptime Self: type, comptime Element: type, comptime lanes: comptime_int) type {
    return struct {
        // A register goes to memory as a whole: as an array it is stored in halves with AVX-512.
        const Lanes = @FieldType(Self, "v");
        const alignment = lanes * @sizeOf(Element);

        /// `x` in every lane.
        pub inline fn splat(x: Element) Self {
            return .{ .v = @splat(x) };
        }

        /// Zero in every lane; +0 of floats.
        pub inline fn zero() Self {
            return .{ .v = @splat(0) };
        }

        /// 0, 1, 2, ... in lanes 0, 1, 2, ...
        pub inline fn iota() Self {
            return .{ .v = ascending };
        }

        /// The lanes as given, `array[0]` in lane 0.
        pub inline fn fromArray(array: [lanes]Element) Self {
            return .{ .v = array };
        }

        /// The lanes in order, lane 0 first.
        pub inline fn toArray(a: Self) [lanes]Element {
            return a.v;
        }

        /// `source[l]` in every lane l. No alignment beyond the element's is needed.
        pub inline fn load(source: *const [lanes]Element) Self {
            return .{ .v = @as(*align(@alignOf(Element)) const Lanes, @ptrCast(source)).* };
        }

        /// As `load`, from memory aligned to all the lanes together.
        pub inline fn loadAligned(source: *align(alignment) const [lanes]Element) Self {
            return .{ .v = @as(*align(alignment) const Lanes, @ptrCast(source)).* };
        }

        /// Writes lane l to `target[l]`. No alignment beyond the element's is needed.
        pub inline fn store(a: Self, target: *[lanes]Element) void {
            @as(*align(@alignOf(Element)) Lanes, @ptrCast(target)).* = a.v;
        }

        /// As `store`, to memory aligned to all the lanes together.
        pub inline fn storeAligned(a: Self, target: *align(alignment) [lanes]Element) void {
            @as(*align(alignment) Lanes, @ptrCast(target)).* = a.v;
        }

        /// The value of one lane; goes through memory. Asserts `index < count`.
        pub inline fn lane(a: Self, index: usize) Element {
            assert(index < lanes);
            return a.toArray()[index];
        }

        /// The same of a value that lies in memory, of which nothing else is read.
        pub inline fn laneIn(a: *const Self, index: usize) Element {
            comptime assert(@sizeOf(Self) == lanes * @sizeOf(Element));
            assert(index < lanes);
            const elements: *const [lanes]Element = @ptrCast(a);
            return elements[index];
        }

        const ascending: [lanes]Element = numbers: {
            var array: [lanes]Element = undefined;
            for (&array, 0..) |*element, index| element.* = index;
            break :numbers array;
        };
    };
}

/// Operations of a float type `Self`, its integers `I32` and its `Mask` that are others' twins.
pub fn Floats(comptime Self: type, comptime I32: type, comptime Mask: type) type {
    return struct {
        /// a > b; false where either is NaN.
        pub inline fn gt(a: Self, b: Self) Mask {
            return b.lt(a);
        }

        /// a >= b; false where either is NaN.
        pub inline fn ge(a: Self, b: Self) Mask {
            return b.le(a);
        }

        /// ((v0 + v1) + v2) + ..., from lane 0 up.
        pub inline fn reduceSum(a: Self) f32 {
            const values = a.toArray();
            var sum = values[0];
            for (values[1..]) |value| sum += value;
            return sum;
        }

        /// The same bits as integers.
        pub inline fn bitcast(a: Self) I32 {
            return .{ .v = @bitCast(a.v) };
        }

        /// The lesser of two, or something negative where either is: for culling only, since -0
        /// may count as negative. Words of floats are in the order of the floats but for those of
        /// negative ones, which come in the opposite order before all others; the minimum of
        /// integers takes one cycle on x86-64, that of floats four.
        pub inline fn minOrNegative(a: Self, b: Self) Self {
            if (!hardware.has_integer_extremes) return a.minFast(b);
            return a.bitcast().min(b.bitcast()).bitcast();
        }

        /// The greater of two, or something negative where both are; see `minOrNegative`.
        pub inline fn maxOrNegative(a: Self, b: Self) Self {
            if (!hardware.has_integer_extremes) return a.maxFast(b);
            return a.bitcast().max(b.bitcast()).bitcast();
        }

        /// a < 0; for culling only, since -0 may count as negative.
        pub inline fn isNegative(a: Self) Mask {
            return a.bitcast().lt(.zero());
        }

        /// a <= b unless both are negative; see `minOrNegative`.
        pub inline fn leOrNegative(a: Self, b: Self) Mask {
            return a.bitcast().le(b.bitcast());
        }
    };
}

/// Operations of an integer type `Self`, its floats `F32` and its `Mask` that are others' twins.
pub fn Integers(comptime Self: type, comptime F32: type, comptime Mask: type) type {
    return struct {
        /// a > b, signed.
        pub inline fn gt(a: Self, b: Self) Mask {
            return b.lt(a);
        }

        /// The same bits as floats.
        pub inline fn bitcast(a: Self) F32 {
            return .{ .v = @bitCast(a.v) };
        }
    };
}

/// Operations of a mask type `Self` that are others' twins.
pub fn Truths(comptime Self: type) type {
    return struct {
        /// Whether no lane is set.
        pub inline fn none(a: Self) bool {
            return !a.any();
        }

        /// The truth value of one lane. Asserts `index < count`.
        pub inline fn lane(a: Self, index: usize) bool {
            assert(index < Self.count);
            return (a.bits() >> @intCast(index)) & 1 != 0;
        }
    };
}
