//! Changes of text: tokens and lines.
//!
//! Tokens are words, numbers, strings in quotes and single other bytes; a number becomes one at
//! the limits of types, a run of tokens is doubled until lists are long.

const std = @import("std");
const Allocator = std.mem.Allocator;
const Mutator = @import("../mutate.zig").Mutator;

/// Tokens that are looked at.
const token_count_max = 1 << 13;
/// Most copies of a run of tokens.
const copy_count_max = 64;

const Range = struct { start: usize, end: usize };

/// Changes one thing.
pub fn change(mutator: *const Mutator, input: []const u8) Allocator.Error![]const u8 {
    const tokens = try tokensOf(mutator.arena, input);
    if (tokens.len == 0) return mutator.changeBytes(input);
    const index = mutator.below(tokens.len);
    const token = tokens[index];
    switch (mutator.below(12)) {
        0, 1, 2 => {
            const number = numberNear(mutator, input, tokens, index) orelse
                return mutator.changeBytes(input);
            const found = input[number.start..number.end];
            return mutator.replaced(input, number.start, number.end, try numberFor(mutator, found));
        },
        3 => return mutator.replaced(input, token.start, token.end, ""),
        4 => {
            const end = tokens[@min(tokens.len, index + mutator.lengthBelow(16)) - 1].end;
            const run = try std.mem.concat(mutator.arena, u8, &.{ " ", input[token.start..end] });
            const count = mutator.lengthBelow(copy_count_max);
            return mutator.replaced(input, end, null, try repeated(mutator, run, count));
        },
        5 => {
            const other = tokens[mutator.below(tokens.len)];
            const found = input[other.start..other.end];
            return mutator.replaced(input, token.start, token.end, found);
        },
        6, 7 => {
            const source = mutator.anyOther();
            const found = try tokensOf(mutator.arena, source);
            if (found.len == 0) return input;
            const first = mutator.below(found.len);
            const last = @min(found.len, first + mutator.lengthBelow(16)) - 1;
            const run = source[found[first].start..found[last].end];
            const end = if (mutator.random.boolean()) token.end else null;
            return mutator.replaced(input, token.start, end, run);
        },
        8, 9, 10 => return changeLines(mutator, input),
        else => return mutator.changeBytes(input),
    }
}

/// A number in the place of another one, as text.
pub fn numberFor(mutator: *const Mutator, before: []const u8) Allocator.Error![]const u8 {
    const arena = mutator.arena;
    const choice = mutator.below(4);
    if (choice > 0) return interesting[mutator.below(interesting.len)];
    const number = std.fmt.parseFloat(f64, before) catch return "0";
    return switch (mutator.below(6)) {
        0 => arena.print("{d}", .{number + 1}),
        1 => arena.print("{d}", .{number - 1}),
        2 => arena.print("{d}", .{number * 2}),
        3 => arena.print("{d}", .{@trunc(number / 2)}),
        4 => arena.print("{d}", .{-number}),
        else => arena.print("{d}", .{mutator.below(300)}),
    };
}

/// `piece` again and again.
pub fn repeated(
    mutator: *const Mutator,
    piece: []const u8,
    count: usize,
) Allocator.Error![]const u8 {
    const result = try mutator.arena.alloc(u8, piece.len * count);
    for (0..count) |index| @memcpy(result[index * piece.len ..][0..piece.len], piece);
    return result;
}

fn changeLines(mutator: *const Mutator, input: []const u8) Allocator.Error![]const u8 {
    const line = lineOf(mutator, input);
    const own = input[line.start..line.end];
    switch (mutator.below(4)) {
        0 => return mutator.replaced(input, line.start, line.end, ""),
        1 => return mutator.replaced(input, lineOf(mutator, input).start, null, own),
        2 => {
            const copies = try repeated(mutator, own, mutator.lengthBelow(copy_count_max));
            return mutator.replaced(input, line.end, null, copies);
        },
        else => {
            const other = mutator.anyOther();
            const from = lineOf(mutator, other);
            return mutator.replaced(input, line.start, null, other[from.start..from.end]);
        },
    }
}

/// A line with its end.
fn lineOf(mutator: *const Mutator, input: []const u8) Range {
    const at = mutator.below(input.len + 1);
    const start = if (std.mem.findScalarLast(u8, input[0..at], '\n')) |end| end + 1 else 0;
    const end = std.mem.findScalarPos(u8, input, at, '\n') orelse return .{
        .start = start,
        .end = input.len,
    };
    return .{ .start = start, .end = end + 1 };
}

fn numberNear(
    mutator: *const Mutator,
    input: []const u8,
    tokens: []const Range,
    index: usize,
) ?Range {
    _ = mutator;
    for (0..tokens.len) |step| {
        const token = tokens[(index + step) % tokens.len];
        if (isNumber(input[token.start..token.end])) return token;
    }
    return null;
}

/// Whether it begins as a number does.
pub fn isNumber(token: []const u8) bool {
    const digits = std.mem.trimStart(u8, token, "+-.");
    return digits.len > 0 and std.ascii.isDigit(digits[0]);
}

fn tokensOf(arena: Allocator, input: []const u8) Allocator.Error![]const Range {
    var tokens: std.ArrayList(Range) = .empty;
    var at: usize = 0;
    while (at < input.len and tokens.items.len < token_count_max) {
        const start = at;
        at += 1;
        if (isSpace(input[start])) continue;
        if (input[start] == '"') {
            at = if (std.mem.findAnyPos(u8, input, at, "\"\n")) |end| end + 1 else input.len;
        } else if (isWord(input[start])) {
            while (at < input.len and isWord(input[at])) at += 1;
        }
        try tokens.append(arena, .{ .start = start, .end = at });
    }
    return tokens.items;
}

fn isSpace(byte: u8) bool {
    return byte == ' ' or (byte >= '\t' and byte <= '\r');
}

fn isWord(byte: u8) bool {
    return std.ascii.isAlphanumeric(byte) or byte >= 0x80 or byte == 0 or
        std.mem.findScalar(u8, "_+-.:", byte) != null;
}

const interesting = [_][]const u8{
    "0",          "-0",                   "1",                    "-1",
    "2",          "3",                    "4",                    "7",
    "15",         "16",                   "17",                   "31",
    "64",         "100",                  "127",                  "128",
    "255",        "256",                  "1000",                 "4096",
    "65535",      "65536",                "100000",               "1000000",
    "16777217",   "2147483647",           "2147483648",           "-2147483648",
    "4294967295", "4294967296",           "9007199254740991",     "9007199254740993",
    "1e18",       "18446744073709551615", "18446744073709551616", "-9223372036854775808",
    "0.5",        "0.1",                  "1e-5",                 "1e-20",
    "1e-45",      "1e-400",               "1e5",                  "1e10",
    "1e20",       "1e38",                 "3.4028235e38",         "3.5e38",
    "-1e39",      "1e308",                "1e400",                "-1e400",
    "nan",        "inf",                  "-inf",                 "1e",
    "1.",         ".5",                   "+1",                   "00",
    "0x10",       "4.0",                  "400e-2",               "1_0",
};
