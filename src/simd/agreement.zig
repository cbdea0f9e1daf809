//! Tests of the backends' agreement: each against plain expressions of single values.
//!
//! In: every backend and lane count that the target compiles, nasty values and random bits. Out: a
//! failed test that names backend, lanes, operation and operands. All run with flush-to-zero, as
//! the tracer's threads do. Exact operations agree to the bit, NaNs as a class.

const std = @import("std");
const simd = @import("../simd.zig");
const expect = std.testing.expect;

const spaces = [_]type{
    simd.Lanes(.scalar, 1),
    simd.Lanes(.scalar, 4),
    simd.Lanes(.scalar, 8),
    simd.Lanes(.scalar, 16),
    simd.Lanes(.vector, 4),
    simd.Lanes(.vector, 8),
    simd.Lanes(.vector, 16),
    simd.Lanes(.intrinsics, 4),
};

/// What the operations of the same name compute in each lane.
const reference = struct {
    fn add(x: f32, y: f32) f32 {
        return x + y;
    }
    fn sub(x: f32, y: f32) f32 {
        return x - y;
    }
    fn mul(x: f32, y: f32) f32 {
        return x * y;
    }
    fn div(x: f32, y: f32) f32 {
        return x / y;
    }
    fn min(x: f32, y: f32) f32 {
        return if (x < y) x else y;
    }
    fn max(x: f32, y: f32) f32 {
        return if (x > y) x else y;
    }
    fn copySign(x: f32, y: f32) f32 {
        return std.math.copysign(x, y);
    }
    fn sqrt(x: f32) f32 {
        return @sqrt(x);
    }
    fn neg(x: f32) f32 {
        return -x;
    }
    fn abs(x: f32) f32 {
        return @abs(x);
    }
    fn eq(x: anytype, y: @TypeOf(x)) bool {
        return x == y;
    }
    fn lt(x: anytype, y: @TypeOf(x)) bool {
        return x < y;
    }
    fn le(x: anytype, y: @TypeOf(x)) bool {
        return x <= y;
    }
    fn gt(x: anytype, y: @TypeOf(x)) bool {
        return x > y;
    }
    fn ge(x: f32, y: f32) bool {
        return x >= y;
    }
};

const float_max = std.math.floatMax(f32);
const float_min = std.math.floatMin(f32);
const denormal = std.math.floatTrueMin(f32);
const inf = std.math.inf(f32);
const nan = std.math.nan(f32);

const nasty_floats = [_]f32{
    0,          -0.0,       1,               -1,          1.5,       0.1,
    -2.5,       3,          inf,             -inf,        nan,       -nan,
    float_max,  -float_max, float_min,       -float_min,  denormal,  -denormal,
    0x1p-100,   0x1p100,    float_min * 1.5, 1 - 0x1p-24, 0x1p-63,   -0x1p24,
    2147483520, 0x1p23,     1 + 0x1p-23,     -0x1.8p-126, 0x1.8p-64, -2147483648,
};

const nasty_integers = [_]i32{
    0,       1,      -1,      2,                    15,                   -16, 32, 0x7fff,
    -0x8000, 0xffff, 1 << 24, std.math.maxInt(i32), std.math.minInt(i32),
};

/// All pairs of nasty values, then random bits.
fn pair(comptime Element: type, index: usize) [2]Element {
    const nasty: []const Element = if (Element == f32) &nasty_floats else &nasty_integers;
    const pairs = nasty.len * nasty.len;
    if (index >= pairs) return @bitCast(randomBits(index));
    // Volatile, because the compiler would fold operations on constants, and folds do not flush.
    const values: [*]const volatile Element = nasty.ptr;
    return .{ values[index / nasty.len], values[index % nasty.len] };
}

const pair_count = nasty_floats.len * nasty_floats.len + 3000;

fn randomBits(index: usize) u64 {
    var generator: std.Random.SplitMix64 = .init(index);
    return generator.next();
}

/// Two operands of a lane type, from `pair(first)` in lane 0 up.
fn operands(comptime T: type, comptime Element: type, first: usize) [2]T {
    var arrays: [2][T.count]Element = undefined;
    for (0..T.count) |lane| {
        const values = pair(Element, first + lane);
        arrays[0][lane] = values[0];
        arrays[1][lane] = values[1];
    }
    return .{ .fromArray(arrays[0]), .fromArray(arrays[1]) };
}

/// Equal to the bit, all NaNs alike.
fn isSame(wanted: anytype, found: @TypeOf(wanted)) bool {
    if (@TypeOf(wanted) != f32) return wanted == found;
    if (std.math.isNan(wanted)) return std.math.isNan(found);
    return @as(u32, @bitCast(wanted)) == @as(u32, @bitCast(found));
}

/// As `isSame`, a denormal being the zero of its sign: operations that choose or move operands
/// pass denormals on or flush them, as the target likes.
fn isSameMoved(wanted: f32, found: f32) bool {
    return isSame(flushed(wanted), flushed(found));
}

fn flushed(x: f32) f32 {
    const bits: u32 = @bitCast(x);
    return if (bits & 0x7f80_0000 == 0) @bitCast(bits & 0x8000_0000) else x;
}

/// Prints what went wrong: `given` and then what came of it.
fn disagree(comptime L: type, operation: []const u8, given: anytype, found: anytype) anyerror {
    var values: [given.len + 1]f64 = undefined;
    inline for (values[0..given.len], given) |*value, x| value.* = numberOf(x);
    values[given.len] = numberOf(found);
    return disagreeAny(@tagName(L.backend), L.count, operation, &values);
}

// Formatting is compiled once: for every operation and backend it took half a minute.
noinline fn disagreeAny(
    backend: []const u8,
    lanes: usize,
    operation: []const u8,
    values: []const f64,
) anyerror {
    std.debug.print("simd {s} x {d}: {s} of", .{ backend, lanes, operation });
    for (values[0 .. values.len - 1]) |value| std.debug.print(" {e}", .{value});
    std.debug.print(" gives {e}\n", .{values[values.len - 1]});
    return error.BackendDisagrees;
}

fn numberOf(x: anytype) f64 {
    return switch (@typeInfo(@TypeOf(x))) {
        .bool => @floatFromInt(@intFromBool(x)),
        .int => @floatFromInt(x),
        else => x,
    };
}

/// Runs `check` for every backend and lane count with flush-to-zero; in a function that is not
/// inlined, so that no arithmetic moves to before the mode is set.
fn forAll(comptime check: fn (comptime type) anyerror!void) !void {
    const before = simd.setFlushToZero();
    defer simd.setFloatControl(before);
    inline for (spaces) |L| try @call(.never_inline, check, .{L});
}

fn checkArithmetic(comptime L: type) anyerror!void {
    @setEvalBranchQuota(10_000);
    var first: usize = 0;
    while (first < pair_count) : (first += L.count) {
        const a, const b = operands(L.F32, f32, first);
        inline for (.{ "add", "sub", "mul", "div", "min", "max", "copySign" }) |name| {
            const found = @field(L.F32, name)(a, b).toArray();
            for (a.toArray(), b.toArray(), found) |x, y, z| {
                const moves = comptime std.mem.findScalar(u8, "mc", name[0]) != null and
                    !std.mem.eql(u8, name, "mul");
                const wanted = @field(reference, name)(x, y);
                const agrees = if (moves) isSameMoved(wanted, z) else isSame(wanted, z);
                if (!agrees) return disagree(L, name, .{ x, y }, z);
            }
        }
        inline for (.{ "sqrt", "neg", "abs" }) |name| {
            const found = @field(L.F32, name)(b).toArray();
            for (b.toArray(), found) |x, z| {
                const wanted = @field(reference, name)(x);
                const agrees = if (name[0] == 's') isSame(wanted, z) else isSameMoved(wanted, z);
                if (!agrees) return disagree(L, name, .{x}, z);
            }
        }
    }
}

test "arithmetic agrees with single values to the bit" {
    try forAll(checkArithmetic);
}

fn checkComparisons(comptime L: type) anyerror!void {
    @setEvalBranchQuota(10_000);
    var first: usize = 0;
    while (first < pair_count) : (first += L.count) {
        inline for (.{ L.F32, L.I32 }, .{ f32, i32 }) |T, Element| {
            const a, const b = operands(T, Element, first);
            const common = .{ "eq", "lt", "le", "gt" };
            const names = if (T == L.F32) common ++ .{"ge"} else common;
            inline for (names) |name| {
                const mask = @field(T, name)(a, b);
                const selected = T.select(mask, a, b).toArray();
                for (a.toArray(), b.toArray(), mask.toArray(), selected) |x, y, m, z| {
                    if (m != @field(reference, name)(x, y)) return disagree(L, name, .{ x, y }, m);
                    const wanted = if (m) x else y;
                    const agrees = if (T == L.F32) isSameMoved(wanted, z) else wanted == z;
                    if (!agrees) return disagree(L, "select", .{ m, x, y }, z);
                }
            }
        }
    }
}

/// What is told of operands that are not both positive is little, and nothing of zeros and NaN.
fn checkOrNegative(comptime L: type) anyerror!void {
    var first: usize = 0;
    while (first < pair_count) : (first += L.count) {
        const a, const b = operands(L.F32, f32, first);
        const least = a.minOrNegative(b).toArray();
        const greatest = a.maxOrNegative(b).toArray();
        const negative = a.isNegative().toArray();
        const in_order = a.leOrNegative(b).toArray();
        for (a.toArray(), b.toArray(), 0..) |x, y, lane| {
            const low = least[lane];
            const high = greatest[lane];
            if (!(@abs(x) >= float_min and @abs(y) >= float_min)) continue;
            const low_fits = if (x < 0 or y < 0) low < 0 else low == @min(x, y);
            const high_fits = if (x < 0 and y < 0) high < 0 else high == @max(x, y);
            if (!low_fits) return disagree(L, "minOrNegative", .{ x, y }, low);
            if (!high_fits) return disagree(L, "maxOrNegative", .{ x, y }, high);
            const is_told = negative[lane];
            if (is_told != (x < 0)) return disagree(L, "isNegative", .{x}, is_told);
            const is_less = in_order[lane];
            if ((x > 0 or y > 0) and is_less != (x <= y))
                return disagree(L, "leOrNegative", .{ x, y }, is_less);
        }
    }
}

test "operations for what is not negative do as their names say" {
    try forAll(checkOrNegative);
}

test "comparisons and selects agree with single values" {
    try forAll(checkComparisons);
}

fn checkIntegers(comptime L: type) anyerror!void {
    @setEvalBranchQuota(10_000);
    var first: usize = 0;
    while (first < pair_count) : (first += L.count) {
        const a, const b = operands(L.I32, i32, first);
        const found = [_][L.count]i32{
            a.add(b).toArray(),         a.sub(b).toArray(),
            a.min(b).toArray(),         a.max(b).toArray(),
            a.bitAnd(b).toArray(),      a.bitOr(b).toArray(),
            a.shiftLeft(7).toArray(),   a.shiftLeft(31).toArray(),
            a.shiftLeft(0).toArray(),   a.bitXor(b).toArray(),
            a.mul(b).toArray(),         a.shiftRight(7).toArray(),
            a.shiftRight(31).toArray(), a.shiftRight(0).toArray(),
        };
        for (0..L.count) |lane| {
            const x, const y = .{ a.lane(lane), b.lane(lane) };
            const bits: u32 = @bitCast(x);
            const right = [_]i32{ @bitCast(bits >> 7), @bitCast(bits >> 31), x };
            const wanted = [_]i32{
                x +% y, x -% y, @min(x, y), @max(x, y), x & y, x | y, x << 7, x << 31, x, x ^ y,
                x *% y,
            } ++ right;
            for (wanted, found, 0..) |w, f, operation| {
                if (w != f[lane]) return disagree(L, "integer", .{ operation, x, y }, f[lane]);
            }
        }
    }
}

test "integer operations agree with single values" {
    try forAll(checkIntegers);
}

fn checkConversions(comptime L: type) anyerror!void {
    var first: usize = 0;
    while (first < pair_count) : (first += L.count) {
        const integers, _ = operands(L.I32, i32, first);
        const floats = integers.toF32();
        for (integers.toArray(), floats.toArray()) |x, z| {
            if (z != @as(f32, @floatFromInt(x))) return disagree(L, "toF32", .{x}, z);
        }
        // Of magnitude below 2^31 whatever the bits, halves among them.
        const small = floats.mul(.splat(0x0.ffffp0)).mul(.splat(0x1p-9));
        for ([_]L.F32{ small, floats.mul(.splat(0x0.ffffp0)) }) |truncated| {
            for (truncated.toArray(), truncated.toI32().toArray()) |x, z| {
                if (z != @as(i32, @intFromFloat(x))) return disagree(L, "toI32", .{x}, z);
            }
        }
        const a, _ = operands(L.F32, f32, first);
        for (a.toArray(), a.bitcast().toArray(), a.bitcast().bitcast().toArray()) |x, bits, z| {
            const agrees = bits == @as(i32, @bitCast(x)) and isSame(x, z);
            if (!agrees) return disagree(L, "bitcast", .{x}, z);
        }
    }
}

test "conversions agree with single values" {
    try forAll(checkConversions);
}

/// Random magnitude from 2^-100 to 2^100, all bits random, sign too.
fn randomOrdinary(index: usize) f32 {
    const bits: u32 = @truncate(randomBits(index));
    const exponent = 127 - 100 + (bits >> 23) % 200;
    return @bitCast((bits & 0x8000_0000) | (exponent << 23) | (bits & 0x7f_ffff));
}

fn checkFast(comptime L: type) anyerror!void {
    for (0..20_000) |index| {
        const x, const y, const z = .{
            randomOrdinary(3 * index), randomOrdinary(3 * index + 1), randomOrdinary(3 * index + 2),
        };
        const lane = index % L.count;
        const a: L.F32, const b: L.F32 = .{ .splat(x), .splat(y) };
        const least = a.minFast(b).lane(lane);
        if (least != reference.min(x, y)) return disagree(L, "minFast", .{ x, y }, least);
        const greatest = a.maxFast(b).lane(lane);
        if (greatest != reference.max(x, y)) return disagree(L, "maxFast", .{ x, y }, greatest);

        // Products of 2^-25 to 2^25 stay clear of overflow and flushing.
        const p, const q = .{ shrunk(x), shrunk(y) };
        const found = L.F32.splat(p).mulAdd(.splat(q), .splat(shrunk(z))).lane(lane);
        const product = @as(f64, p) * q;
        const bound = 0x1p-23 * (@abs(product) + @abs(shrunk(z)));
        if (@abs(found - (product + shrunk(z))) > bound) {
            return disagree(L, "mulAdd", .{ p, q, shrunk(z) }, found);
        }
    }
}

/// The same sign and fraction, with a magnitude from 2^-12 to 2^13.
fn shrunk(x: f32) f32 {
    const bits: u32 = @bitCast(x);
    const exponent = 127 - 12 + ((bits >> 23) & 0xff) % 25;
    return @bitCast((bits & 0x807f_ffff) | (exponent << 23));
}

test "inexact operations are near" {
    try forAll(checkFast);
}

fn checkMasks(comptime L: type) anyerror!void {
    const patterns = @min(1 << L.count, 1 << 9);
    for (0..patterns) |index| {
        const keep = (1 << L.count) - 1;
        const x: u32 = if (L.count < 16) @intCast(index) else @truncate(randomBits(index) & keep);
        const y: u32 = @truncate(randomBits(index + 1000) & keep);
        const a: L.Mask, const b: L.Mask = .{ .fromBits(x), .fromBits(y) };
        const found = [_]u32{
            a.bits(),                             a.bitAnd(b).bits(), a.bitOr(b).bits(),
            a.bitNot().bits(),                    a.andNot(b).bits(), a.popCount(),
            L.Mask.fromArray(a.toArray()).bits(),
        };
        const wanted = [_]u32{ x, x & y, x | y, ~x & keep, x & ~y, @popCount(x), x };
        for (wanted, found, 0..) |w, f, operation| {
            if (w != f) return disagree(L, "mask", .{ operation, x, y }, f);
        }
        try expect(a.any() == (x != 0));
        try expect(a.none() == (x == 0));
        try expect(a.all() == (x == keep));
        for (a.toArray(), 0..) |truth, lane| {
            try expect(truth == ((x >> @intCast(lane)) & 1 != 0));
            try expect(truth == a.lane(lane));
        }
    }
    try expect(L.Mask.splat(true).all() and L.Mask.splat(false).none());
    try expect(L.Mask.fromBits((1 << L.count) - 1).all());
}

test "masks agree with bits" {
    try forAll(checkMasks);
}

fn checkReductions(comptime L: type) anyerror!void {
    var first: usize = 0;
    while (first < pair_count) : (first += L.count) {
        const a, _ = operands(L.F32, f32, first * 7 % pair_count);
        const values = a.toArray();
        var sum = values[0];
        for (values[1..]) |value| sum += value;
        const found = a.reduceSum();
        if (!isSame(sum, found)) return disagree(L, "reduceSum", .{values[0]}, found);

        var least = values;
        var greatest = values;
        var half: usize = L.count / 2;
        while (half > 0) : (half /= 2) {
            for (0..half) |lane| {
                least[lane] = reference.min(least[lane], least[half + lane]);
                greatest[lane] = reference.max(greatest[lane], greatest[half + lane]);
            }
        }
        if (!isSameMoved(least[0], a.reduceMin())) {
            return disagree(L, "reduceMin", .{values[0]}, a.reduceMin());
        }
        if (!isSameMoved(greatest[0], a.reduceMax())) {
            return disagree(L, "reduceMax", .{values[0]}, a.reduceMax());
        }
    }
}

fn checkEach(comptime L: type) !void {
    const count = L.F32.count;
    if (!std.math.isPowerOfTwo(count)) return;
    var random = std.Random.DefaultPrng.init(5);
    for (0..20) |_| {
        var vectors: [count]L.F32 = undefined;
        for (&vectors) |*vector| {
            var values: [count]f32 = undefined;
            for (&values) |*value| value.* = random.random().floatNorm(f32);
            values[random.random().uintLessThan(usize, count)] = std.math.inf(f32);
            vector.* = .fromArray(values);
        }
        const least = L.minOfEach(&vectors).toArray();
        const greatest = L.maxOfEach(&vectors).toArray();
        for (vectors, least, greatest) |vector, low, high| {
            try expect(low == vector.reduceMin() and high == vector.reduceMax());
        }
    }
}

test "every vector's least and greatest lane" {
    try forAll(checkEach);
}

test "reductions keep their order" {
    try forAll(checkReductions);
}

fn checkMoves(comptime L: type) anyerror!void {
    const n = L.count;
    var floats: [2 * n + 1]f32 align(64) = undefined;
    for (&floats, 0..) |*value, index| value.* = @floatFromInt(index);
    for (0..n + 1) |offset| {
        const a: L.F32 = .load(floats[offset..][0..n]);
        for (a.toArray(), offset..) |value, index| {
            try expect(value == @as(f32, @floatFromInt(index)));
        }
        var target: [n + 2]f32 = @splat(-1);
        a.store(target[1..][0..n]);
        try std.testing.expectEqualSlices(f32, floats[offset..][0..n], target[1..][0..n]);
        try expect(target[0] == -1 and target[n + 1] == -1);
    }
    const numbers: L.F32 = .loadAligned(floats[0..n]);
    try expect(numbers.eq(.iota()).all());
    try expect(numbers.toI32().eq(.iota()).all());
    try expect(numbers.lane(n - 1) == n - 1);
    try expect(numbers.laneIn(n - 1) == n - 1 and numbers.laneIn(0) == 0);
    numbers.add(.splat(1)).storeAligned(floats[0..n]);
    try expect(floats[0] == 1 and floats[n - 1] == n and L.F32.zero().eq(.splat(-0.0)).all());

    var integers: [n]i32 align(64) = undefined;
    L.I32.iota().shiftLeft(1).storeAligned(&integers);
    const indices: L.I32 = .load(&integers);
    for (indices.toArray(), 0..) |value, lane| try expect(value == 2 * lane);
    try expect(L.I32.zero().eq(indices.sub(.loadAligned(&integers))).all());
}

test "loads and stores" {
    try forAll(checkMoves);
}

fn checkShuffles(comptime L: type) anyerror!void {
    const n = L.count;
    if (n == 1) return;
    const a: L.F32 = .iota();
    const b = a.add(.splat(100));
    for (a.interleaveLow(b).toArray(), a.interleaveHigh(b).toArray(), 0..) |low, high, lane| {
        const base: f32 = @floatFromInt(lane / 2 + 100 * (lane % 2));
        try expect(low == base);
        try expect(high == base + n / 2);
    }
}

test "interleaving" {
    try forAll(checkShuffles);
}

fn checkVectors(comptime L: type) anyerror!void {
    for (0..500) |index| {
        var arrays: [6][L.count]f32 = undefined;
        for (&arrays, 0..) |*array, component| {
            for (array, 0..) |*value, lane| {
                const here = (index * L.count + lane) * 6 + component;
                value.* = if (index % 8 == 0) pair(f32, here % pair_count)[0] else //
                    shrunk(randomOrdinary(here));
            }
        }
        var lanes: [6]L.F32 = undefined;
        for (&lanes, arrays) |*lane_values, array| lane_values.* = .load(&array);
        const a: L.Vec3 = .{ .x = lanes[0], .y = lanes[1], .z = lanes[2] };
        const b: L.Vec3 = .{ .x = lanes[3], .y = lanes[4], .z = lanes[5] };
        const mask = a.x.lt(b.x);
        const found = [_]L.Vec3{
            a.add(b),   a.sub(b),      a.mul(b),
            a.cross(b), a.scale(b.x),  .{ .x = a.dot(b), .y = a.length(), .z = b.z },
            a.min(b),   a.max(b),      .select(mask, a, b),
            a.neg(),    a.neg().abs(), a.normalize(),
        };
        for (0..L.count) |lane| {
            const wanted = wantedVectors(a.lane(lane), b.lane(lane));
            for (wanted, found, 0..) |w, f, operation| {
                for (w, f.lane(lane)) |x, z| {
                    if (!isSameMoved(x, z)) return disagree(L, "Vec3", .{ operation, x }, z);
                }
            }
        }
    }
}

/// The formulas of `checkVectors` for one lane, in the same order.
fn wantedVectors(a: [3]f32, b: [3]f32) [12][3]f32 {
    const dot = (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
    const length = @sqrt((a[0] * a[0] + a[1] * a[1]) + a[2] * a[2]);
    const inverse = 1 / length;
    var wanted: [12][3]f32 = undefined;
    for (a, b, 0..) |x, y, axis| {
        const next, const last = .{ (axis + 1) % 3, (axis + 2) % 3 };
        const column = [12]f32{
            x + y,
            x - y,
            x * y,
            a[next] * b[last] - a[last] * b[next],
            x * b[0],
            ([3]f32{ dot, length, y })[axis],
            reference.min(x, y),
            reference.max(x, y),
            if (a[0] < b[0]) x else y,
            -x,
            @abs(x),
            x * inverse,
        };
        for (&wanted, column) |*vector, value| vector[axis] = value;
    }
    return wanted;
}

test "vectors agree with formulas of single values" {
    try forAll(checkVectors);
}

/// The same value, which the compiler cannot know: it would fold operations, and not flush.
fn unknown(x: f32) f32 {
    var value = x;
    return @as(*volatile f32, &value).*;
}

fn checkFlush(comptime L: type) anyerror!void {
    var tiny: [L.count]f32 = undefined;
    for (&tiny) |*value| value.* = unknown(float_min);
    const least: L.F32 = .load(&tiny);
    try expect(least.mul(.splat(0.5)).bitcast().eq(.zero()).all());
    try expect(least.neg().div(.splat(2)).bitcast().eq(.splat(std.math.minInt(i32))).all());
    try expect(least.sub(least.mul(.splat(1.5))).eq(.zero()).all());

    for (&tiny) |*value| value.* = unknown(denormal);
    const below: L.F32 = .load(&tiny);
    try expect(below.mul(.splat(0x1p100)).bitcast().eq(.zero()).all());
    try expect(below.eq(.zero()).all() and below.gt(.zero()).none());
    try expect(L.F32.splat(1).div(below).eq(.splat(inf)).all());
}

test "denormals count as zeros" {
    try forAll(checkFlush);
}
