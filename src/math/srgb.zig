//! The sRGB transfer function (IEC 61966-2-1), rounded right.
//!
//! In: linear light as f32; out: the nearest of 256 codes, and back. Encoding is a search among the
//! 255 values where the code changes, computed in f64 at compile time, so that it is exact and the
//! same on every target without a power function at run time.

const std = @import("std");
const elementary = @import("elementary.zig");
const assert = std.debug.assert;

/// Linear light of a code given as a fraction of the largest. Asserts 0 <= fraction <= 1.
pub fn linear(fraction: f64) f64 {
    assert(fraction >= 0 and fraction <= 1);
    if (fraction <= 0.04045) return fraction / 12.92;
    return elementary.pow((fraction + 0.055) / 1.055, 2.4);
}

/// Linear light of every code.
pub const decoded: [256]f32 = table: {
    @setEvalBranchQuota(200_000);
    var table: [256]f32 = undefined;
    for (&table, 0..) |*value, code| value.* = @floatCast(linear(@as(f64, code) / 255));
    break :table table;
};

/// thresholds[c] is the least f32 that is nearer to code c than to code c - 1.
const thresholds: [257]f32 = table: {
    @setEvalBranchQuota(200_000);
    var table: [257]f32 = undefined;
    table[0] = 0;
    table[256] = std.math.inf(f32);
    for (1..256) |code| {
        const exact = linear((@as(f64, code) - 0.5) / 255);
        var value: f32 = @floatCast(exact);
        if (value < exact) value = std.math.nextAfter(f32, value, 1);
        table[code] = value;
    }
    break :table table;
};

/// Floats that share sign, exponent and the first 7 bits of the mantissa share a cell; cells are so
/// narrow that the code changes at most once within one.
const cell_shift = 16;
/// Below it everything is code 0: the first threshold is 0.5 / 255 / 12.92 = 1.52e-4.
const cell_least: f32 = 0x1p-13;
const cell_first = bits(cell_least) >> cell_shift;
const cell_count = (bits(1) >> cell_shift) - cell_first;

/// The code of the least float of each cell in the upper half. In the lower half what is missing to
/// a carry where the code changes within the cell, else 0: adding the lower bits of a float then
/// counts the code up from its threshold on.
const cells: [cell_count]u32 = table: {
    @setEvalBranchQuota(200_000);
    var table: [cell_count]u32 = undefined;
    var code: usize = 0;
    for (&table, 0..) |*cell, index| {
        const low = cell_first + index << cell_shift;
        const high: f32 = @bitCast(@as(u32, low + (1 << cell_shift)));
        while (thresholds[code + 1] <= @as(f32, @bitCast(@as(u32, low)))) code += 1;
        cell.* = code << cell_shift;
        if (thresholds[code + 1] < high) {
            cell.* += (1 << cell_shift) - (bits(thresholds[code + 1]) - low);
        }
        assert(code == 255 or thresholds[code + 2] >= high);
    }
    break :table table;
};

fn bits(value: f32) u32 {
    return @bitCast(value);
}

/// The sRGB codes nearest to linear values; below 0 counts as 0, above 1 as 1. Asserts that the
/// values are numbers.
pub inline fn encodeLanes(comptime count: usize, values: @Vector(count, f32)) [count]u8 {
    const Words = @Vector(count, u32);
    const least: @Vector(count, f32) = @splat(cell_least);
    const largest: @Vector(count, f32) = @splat(std.math.nextAfter(f32, 1, 0));
    const raised = @select(f32, values > least, values, least);
    const within: Words = @bitCast(@select(f32, raised < largest, raised, largest));
    const places: [count]u32 =
        (within >> @as(Words, @splat(cell_shift))) - @as(Words, @splat(cell_first));
    const lower: [count]u32 = within & @as(Words, @splat((1 << cell_shift) - 1));
    var codes: [count]u8 = undefined;
    inline for (&codes, places, lower, 0..) |*code, place, rest, lane| {
        assert(!std.math.isNan(@as([count]f32, values)[lane]));
        code.* = @intCast((cells[place] + rest) >> cell_shift);
    }
    return codes;
}

/// The sRGB code nearest to a linear value; below 0 counts as 0, above 1 as 1. Asserts that the
/// value is a number.
pub inline fn encode(value: f32) u8 {
    return encodeLanes(1, .{value})[0];
}

/// The standard's own formula in f64, not rounded: 0..255.
fn encodeReference(value: f32) f64 {
    const x: f64 = value;
    if (x <= 0.0031308) return 255 * 12.92 * x;
    return 255 * (1.055 * elementary.pow(x, 1.0 / 2.4) - 0.055);
}

test encode {
    try std.testing.expectEqual(0, encode(0));
    try std.testing.expectEqual(0, encode(-0.0));
    try std.testing.expectEqual(0, encode(-1));
    try std.testing.expectEqual(0, encode(-std.math.inf(f32)));
    try std.testing.expectEqual(0, encode(std.math.floatTrueMin(f32)));
    try std.testing.expectEqual(188, encode(0.5));
    try std.testing.expectEqual(255, encode(1));
    try std.testing.expectEqual(255, encode(std.math.nextAfter(f32, 1, 0)));
    try std.testing.expectEqual(255, encode(std.math.inf(f32)));
}

test "the code changes exactly where the formula passes a half" {
    for (1..256) |code| {
        const at = thresholds[code];
        const below = std.math.nextAfter(f32, at, 0);
        try std.testing.expectEqual(code, encode(at));
        try std.testing.expectEqual(code - 1, encode(below));
        const half = @as(f64, @floatFromInt(code)) - 0.5;
        try std.testing.expect(encodeReference(at) >= half);
        try std.testing.expect(encodeReference(below) < half);
    }
}

test "nearest everywhere, and never falling" {
    var previous: u8 = 0;
    var pattern: u32 = 0;
    // A prime step visits all exponents and cells at changing places.
    while (pattern <= bits(1.01)) : (pattern += 4099) {
        const value: f32 = @bitCast(pattern);
        const code = encode(value);
        try std.testing.expect(code >= previous);
        const reference = encodeReference(if (value < 1) value else 1);
        try std.testing.expect(@abs(reference - @as(f64, @floatFromInt(code))) <= 0.5);
        previous = code;
    }
    try std.testing.expectEqual(255, previous);
}

test encodeLanes {
    const values = [4]f32{ -1, 0.25, 0.5, std.math.inf(f32) };
    try std.testing.expectEqual([4]u8{ 0, 137, 188, 255 }, encodeLanes(4, values));
    for (thresholds[1..256], 1..) |at, code| {
        const below = std.math.nextAfter(f32, at, 0);
        const expected: u8 = @intCast(code);
        const codes = encodeLanes(4, .{ below, at, at, below });
        try std.testing.expectEqual([4]u8{ expected - 1, expected, expected, expected - 1 }, codes);
    }
}

test "every code survives decoding and encoding" {
    for (decoded, 0..) |value, code| try std.testing.expectEqual(code, encode(value));
    try std.testing.expectEqual(1, decoded[255]);
}
