//! A text in lines of words, as OBJ and MTL files are.
//!
//! In: a text with a zero byte behind it. Out: its lines, and the words and numbers of each. A line
//! goes on after a backslash at its end; `#` and what follows it says nothing, but within names.

const std = @import("std");
const number = @import("../number.zig");
const Allocator = std.mem.Allocator;
const Words = @This();

text: [:0]const u8,
cursor: usize = 0,

/// The text with blanks for the ends of lines that go on; null: it has none of these.
pub fn joined(gpa: Allocator, text: [:0]const u8) Allocator.Error!?[:0]u8 {
    var start: usize = 0;
    var copy: ?[:0]u8 = null;
    while (std.mem.findScalarPos(u8, text, start, '\\')) |at| {
        start = at + 1;
        var end = start;
        while (text[end] == ' ' or text[end] == '\t' or text[end] == '\r') end += 1;
        if (text[end] != '\n') continue;
        if (copy == null) copy = try gpa.dupeSentinel(u8, text, 0);
        @memset(copy.?[at .. end + 1], ' ');
    }
    return copy;
}

/// Moves to the next line that says something; false at the end of the text.
pub fn nextLine(words: *Words) bool {
    while (words.cursor < words.text.len) {
        if (words.hasMore()) return true;
        words.skipLine();
    }
    return false;
}

/// Passes over what is left of the line.
pub fn skipLine(words: *Words) void {
    words.cursor = @min(words.lineEnd() + 1, words.text.len);
}

fn lineEnd(words: *const Words) usize {
    var index = words.cursor;
    while (words.text[index] != '\n' and words.text[index] != '\r' and index < words.text.len) {
        index += 1;
    }
    return index;
}

/// Whether the line has more words.
pub inline fn hasMore(words: *Words) bool {
    words.skipSpace();
    return switch (words.text[words.cursor]) {
        '\n', '\r', '#' => false,
        0 => words.cursor < words.text.len,
        else => true,
    };
}

inline fn skipSpace(words: *Words) void {
    while (words.text[words.cursor] == ' ' or words.text[words.cursor] == '\t') words.cursor += 1;
}

/// The next word of the line; empty: there is none.
pub fn word(words: *Words) []const u8 {
    words.skipSpace();
    const start = words.cursor;
    while (words.text[words.cursor] > ' ') words.cursor += 1;
    return words.text[start..words.cursor];
}

/// The rest of the line, blanks around it left out.
pub fn rest(words: *Words) []const u8 {
    const start = words.cursor;
    words.cursor = words.lineEnd();
    return std.mem.trim(u8, words.text[start..words.cursor], " \t");
}

/// The next number of the line, NaN where it is not finite; null: something else stands there.
pub inline fn float(words: *Words) ?f32 {
    words.skipSpace();
    return number.floatOrNan(words.text, &words.cursor) catch null;
}

/// Line of a position, from 1.
pub fn lineOf(words: *const Words, position: usize) usize {
    return std.mem.countScalar(u8, words.text[0..position], '\n') + 1;
}

test "lines, words and numbers" {
    const gpa = std.testing.allocator;
    const text = "# a\r\n\n  f 1 \\\r\n 2.5#c\rname  a b # c \n x\x00y";
    const copy = (try joined(gpa, text)).?;
    defer gpa.free(copy);
    try std.testing.expectEqual(null, try joined(gpa, "a\\b\\"));
    var words: Words = .{ .text = copy };
    try std.testing.expect(words.nextLine());
    try std.testing.expectEqualStrings("f", words.word());
    try std.testing.expectEqual(1, words.float());
    try std.testing.expectEqual(2.5, words.float());
    try std.testing.expectEqual(null, words.float());
    try std.testing.expect(!words.hasMore() and words.nextLine());
    try std.testing.expectEqualStrings("name", words.word());
    try std.testing.expectEqualStrings("a b # c", words.rest());
    try std.testing.expectEqualStrings("", words.rest());
    words.skipLine();
    try std.testing.expect(words.nextLine());
    try std.testing.expectEqualStrings("x", words.word());
    words.skipLine();
    try std.testing.expect(!words.nextLine());
}
