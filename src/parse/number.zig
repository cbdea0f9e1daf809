//! Numbers of a text at the speed of reading it: decimal digits -> the nearest f32, exactly.
//!
//! In: a text that ends in a zero byte, and where a number starts. Out: its value, and where it
//! ends. Short decimals take the quick way of Clinger ("How to read floating point numbers
//! accurately", 1990): a whole number below 2^53 times or over a power of ten up to 10^22, both
//! exact in f64, whose quotient is therefore the nearest f64. Rounding that once more to f32 goes
//! wrong only where the f64 lies in the middle between two f32s; there, and for all other numbers,
//! the standard library reads the text again.

const std = @import("std");
const math = @import("../math.zig");

/// `NotANumber`: something else stands there. `OutOfRange`: it has no finite value in the type.
pub const Error = error{ NotANumber, OutOfRange };

const powers_of_ten = powers: {
    var powers: [23]f64 = undefined;
    var power: f64 = 1;
    for (&powers) |*entry| {
        entry.* = power;
        power *= 10; // Exact up to 10^22.
    }
    break :powers powers;
};

inline fn digit(byte: u8) u8 {
    return byte -% '0';
}

/// Whether a number may be followed by `byte`.
pub inline fn ends(byte: u8) bool {
    return switch (byte) {
        0...' ', ']', '[', '"', '#' => true,
        else => false,
    };
}

/// Reads the number at `start` and moves `start` behind it; denormals come out as zero.
pub inline fn float(text: [:0]const u8, start: *usize) Error!f32 {
    var index = start.*;
    const negative = text[index] == '-';
    if (negative or text[index] == '+') index += 1;
    const digits_start = index;
    var mantissa: u64 = 0;
    while (digit(text[index]) < 10) : (index += 1) {
        mantissa = mantissa *% 10 +% digit(text[index]);
    }
    var digit_count = index - digits_start;
    var fraction_count: usize = 0;
    if (text[index] == '.') {
        index += 1;
        const fraction_start = index;
        while (digit(text[index]) < 10) : (index += 1) {
            mantissa = mantissa *% 10 +% digit(text[index]);
        }
        fraction_count = index - fraction_start;
        digit_count += fraction_count;
    }
    const is_plain = ends(text[index]);
    // 19 digits are less than 2^64.
    if (!is_plain or digit_count > 19 or digit_count == 0 or mantissa > 1 << 53)
        return slow(text, start);
    // No more than 19 digits stand behind the point.
    const magnitude = @as(f64, @floatFromInt(mantissa)) / powers_of_ten[fraction_count];
    const bits: u64 = @bitCast(magnitude);
    // Between two f32s, or perhaps below the least of them: the 29 bits that f32 lacks.
    if (bits & 0x1fff_ffff == 0x1000_0000 or (magnitude < 1e-37 and mantissa != 0))
        return slow(text, start);
    start.* = index;
    const value: f32 = @floatCast(magnitude);
    return if (negative) -value else value;
}

/// Anything that the quick way leaves: exponents, many digits, and what is no number at all.
noinline fn slow(text: [:0]const u8, start: *usize) Error!f32 {
    const word = text[start.*..endOf(text, start.*)];
    for (word) |byte| switch (byte) {
        '0'...'9', '+', '-', '.', 'e', 'E' => {},
        else => return error.NotANumber, // The library knows "nan", "inf", "0x" and "_" besides.
    };
    const value = std.fmt.parseFloat(f32, word) catch return error.NotANumber;
    if (!std.math.isFinite(value)) return error.OutOfRange;
    start.* += word.len;
    return math.flushDenormal(value);
}

/// The same where "nan" and "inf" in all spellings, and what is out of range, are NaN.
pub inline fn floatOrNan(text: [:0]const u8, start: *usize) error{NotANumber}!f32 {
    const value = float(text, start) catch |err| return switch (err) {
        error.OutOfRange => skipNan(text, start),
        error.NotANumber => if (isNan(text[start.*..endOf(text, start.*)]))
            skipNan(text, start)
        else
            error.NotANumber,
    };
    return if (text[start.*] == '#' and isMarked(text[start.*..])) nan: {
        while (text[start.*] > ' ') start.* += 1;
        break :nan std.math.nan(f32);
    } else value;
}

/// Whether what stands behind a number is its name in Microsoft's libraries: `1.#QNAN`, `-1.#IND`.
fn isMarked(text: []const u8) bool {
    for ([_][]const u8{ "#QNAN", "#SNAN", "#INF", "#IND" }) |name| {
        if (std.mem.startsWith(u8, text, name)) return true;
    }
    return false;
}

fn skipNan(text: [:0]const u8, start: *usize) f32 {
    start.* = endOf(text, start.*);
    return std.math.nan(f32);
}

/// Whether C's libraries print what is not finite so: `-nan`, `nan(ind)`, `Infinity`.
fn isNan(word: []const u8) bool {
    const digits = std.mem.trimStart(u8, word, "+-");
    for ([_][]const u8{ "nan", "inf" }) |name| {
        if (std.ascii.startsWithIgnoreCase(digits, name)) return true;
    }
    return false;
}

/// Where the word that starts at `start` ends.
pub fn endOf(text: [:0]const u8, start: usize) usize {
    var index = start;
    while (!ends(text[index])) index += 1;
    return index;
}

/// Reads the whole number at `start` and moves `start` behind it.
pub inline fn integer(text: [:0]const u8, start: *usize) Error!i32 {
    var index = start.*;
    const negative = text[index] == '-';
    if (negative or text[index] == '+') index += 1;
    const digits_start = index;
    var magnitude: u64 = 0;
    while (digit(text[index]) < 10) : (index += 1) {
        magnitude = magnitude *% 10 +% digit(text[index]);
    }
    const digit_count = index - digits_start;
    if (digit_count == 0 or !ends(text[index])) return error.NotANumber;
    if (digit_count > 10 or magnitude > std.math.maxInt(i32)) return error.OutOfRange;
    start.* = index;
    const value: i32 = @intCast(magnitude);
    return if (negative) -value else value;
}

fn expectFloat(expected: f32, text: [:0]const u8) !void {
    var start: usize = 0;
    const value = try float(text, &start);
    try std.testing.expectEqual(@as(u32, @bitCast(expected)), @as(u32, @bitCast(value)));
    try std.testing.expectEqual(text.len, start);
}

test "numbers in all their forms" {
    try expectFloat(0, "0");
    try expectFloat(-0.0, "-0");
    try expectFloat(12, "+12");
    try expectFloat(0.5, ".5");
    try expectFloat(5, "5.");
    try expectFloat(-2.5889e-7, "-2.5889e-007");
    try expectFloat(1e20, "1E20");
    try expectFloat(1e20, "100000000000000000000");
    try expectFloat(0.1, "0.1000000000000000000000000000");
    try expectFloat(0, "1e-45");
    try expectFloat(0, "0.00000000000000000000000000000000000000001");
    try expectFloat(3.4028235e38, "3.4028235e38");
    const wrong = [_][:0]const u8{
        "nan", "inf", "-", ".", "1x", "1e", "1e+", "0x10", "1_0", "--1", "",
    };
    for (wrong) |bad| {
        var start: usize = 0;
        try std.testing.expectError(error.NotANumber, float(bad, &start));
        try std.testing.expectEqual(0, start);
    }
    var start: usize = 0;
    try std.testing.expectError(error.OutOfRange, float("1e999", &start));
}

test "what is not finite may be NaN" {
    for ([_][:0]const u8{ "nan", "-NaN(ind)", "inf", "-Infinity", "1e99", "1.#QNAN0" }) |word| {
        var start: usize = 0;
        try std.testing.expect(std.math.isNan(try floatOrNan(word, &start)));
        try std.testing.expectEqual(word.len, start);
    }
    for ([_][:0]const u8{ "", "x", "-", "1x" }) |word| {
        var start: usize = 0;
        try std.testing.expectError(error.NotANumber, floatOrNan(word, &start));
        try std.testing.expectEqual(0, start);
    }
}

test "the quick way rounds once: as the standard library does" {
    var random_state: std.Random.DefaultPrng = .init(3);
    const random = random_state.random();
    var buffer: [64]u8 = undefined;
    for (0..200_000) |round| {
        // Decimals, and f64s in the very middle of two f32s, cut at all lengths.
        const text = if (round % 2 == 0)
            try std.mem.printSentinel(&buffer, "{d}.{d}", .{
                random.int(u32) >> random.int(u5), random.int(u32) >> random.int(u5),
            }, 0)
        else middle: {
            const below: f32 = @floatFromInt(random.int(u24) | 1 << 23);
            const shift: f64 = @floatFromInt(@as(u32, 1) << random.uintLessThan(u5, 20));
            break :middle try std.mem.printSentinel(
                &buffer,
                "{d}",
                .{(@as(f64, below) + 0.5) / shift},
                0,
            );
        };
        try expectFloat(try std.fmt.parseFloat(f32, text), text);
    }
}

test "whole numbers" {
    var start: usize = 0;
    try std.testing.expectEqual(-17, try integer("-17]", &start));
    try std.testing.expectEqual(3, start);
    for ([_][:0]const u8{ "1.5", "1.", "", "-", "a", "1e3" }) |bad| {
        start = 0;
        try std.testing.expectError(error.NotANumber, integer(bad, &start));
    }
    start = 0;
    try std.testing.expectEqual(2147483647, try integer("2147483647", &start));
    for ([_][:0]const u8{ "2147483648", "99999999999999999999999999999" }) |large| {
        start = 0;
        try std.testing.expectError(error.OutOfRange, integer(large, &start));
    }
}
