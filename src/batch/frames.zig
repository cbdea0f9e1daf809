//! Numbers of frames, as Open Job Description writes ranges of integers (its template schemas of
//! 2023-09, section 3.4.1.1.1, `IntRangeExpr`).
//!
//! In: `1-10,12,20-40:2`, elements in any order, with spaces or tabs around numbers. Out: the
//! numbers, ascending. A step may be negative where a range goes down; no two ranges overlap.

const std = @import("std");
const settings = @import("../settings.zig");
const Allocator = std.mem.Allocator;

/// Why a text has no numbers.
pub const Fault = enum {
    syntax,
    overlap,
    /// Over `settings.frame_count_max`.
    too_many,

    /// For messages.
    pub fn text(fault: Fault) []const u8 {
        return switch (fault) {
            .syntax => "is not a range such as 1-10,12,20-40:2",
            .overlap => "has ranges that overlap",
            .too_many => std.fmt.comptimePrint("has more than {d} numbers", .{
                settings.frame_count_max,
            }),
        };
    }
};

/// One element: first, first + step, and so on, not beyond last.
const Range = struct {
    first: i32,
    last: i32,
    step: i32 = 1,

    /// At least 1, for the first always counts.
    fn count(range: Range) u64 {
        const way = @as(i64, range.last) - range.first;
        if (way == 0 or (way > 0) != (range.step > 0)) return 1;
        return @abs(way) / @abs(@as(i64, range.step)) + 1;
    }

    /// From the least to the greatest number that it spans.
    fn span(range: Range) [2]i32 {
        return if (range.step > 0)
            .{ range.first, @max(range.first, range.last) }
        else
            .{ @min(range.first, range.last), range.first };
    }

    fn startsBefore(_: void, one: Range, other: Range) bool {
        return one.span()[0] < other.span()[0];
    }
};

/// What is wrong with a text, as far as is known without memory; null: nothing, but for ranges that
/// may overlap.
pub fn check(text: []const u8) ?Fault {
    var count: u64 = 0;
    var elements = std.mem.splitScalar(u8, text, ',');
    while (elements.next()) |element| {
        const range = rangeOf(element) orelse return .syntax;
        count += range.count();
        if (count > settings.frame_count_max) return .too_many;
    }
    return null;
}

/// The least number. Asserts that `check` finds nothing wrong.
pub fn first(text: []const u8) i32 {
    var least: i32 = std.math.maxInt(i32);
    var elements = std.mem.splitScalar(u8, text, ',');
    while (elements.next()) |element| {
        const range = rangeOf(element).?;
        const last_index: i64 = @intCast(range.count() - 1);
        const last = range.first + last_index * range.step;
        least = @intCast(@min(least, range.first, last));
    }
    return least;
}

/// All numbers, ascending, which the caller frees. Asserts that `check` finds nothing wrong.
pub fn expand(gpa: Allocator, text: []const u8) error{ OutOfMemory, Overlap }![]const i32 {
    var ranges: std.ArrayList(Range) = .empty;
    defer ranges.deinit(gpa);
    var elements = std.mem.splitScalar(u8, text, ',');
    while (elements.next()) |element| try ranges.append(gpa, rangeOf(element).?);
    std.mem.sortUnstable(Range, ranges.items, {}, Range.startsBefore);
    var numbers: std.ArrayList(i32) = .empty;
    errdefer numbers.deinit(gpa);
    for (ranges.items, 0..) |range, index| {
        if (index > 0 and ranges.items[index - 1].span()[1] >= range.span()[0])
            return error.Overlap;
        const start = numbers.items.len;
        for (try numbers.addManyAsSlice(gpa, @intCast(range.count())), 0..) |*number, place|
            number.* = @intCast(range.first + @as(i64, @intCast(place)) * range.step);
        if (range.step < 0) std.mem.reverse(i32, numbers.items[start..]);
    }
    return numbers.toOwnedSlice(gpa);
}

fn rangeOf(element: []const u8) ?Range {
    var rest = element;
    const low = takeInteger(&rest) orelse return null;
    var range: Range = .{ .first = low, .last = low };
    if (rest.len == 0) return range;
    if (!takeByte(&rest, '-')) return null;
    range.last = takeInteger(&rest) orelse return null;
    if (takeByte(&rest, ':')) range.step = takeInteger(&rest) orelse return null;
    return if (rest.len == 0 and range.step != 0) range else null;
}

fn takeByte(rest: *[]const u8, byte: u8) bool {
    if (rest.len == 0 or rest.*[0] != byte) return false;
    rest.* = rest.*[1..];
    return true;
}

/// Digits, perhaps with a minus, and spaces or tabs around them.
fn takeInteger(rest: *[]const u8) ?i32 {
    const text = std.mem.trimStart(u8, rest.*, " \t");
    const sign_length: usize = @intFromBool(text.len > 0 and text[0] == '-');
    var end = sign_length;
    while (end < text.len and std.ascii.isDigit(text[end])) end += 1;
    if (end == sign_length) return null;
    rest.* = std.mem.trimStart(u8, text[end..], " \t");
    return std.fmt.parseInt(i32, text[0..end], 10) catch null;
}

const testing = std.testing;

fn expectNumbers(expected: []const i32, text: []const u8) !void {
    errdefer std.debug.print("{s}\n", .{text});
    try testing.expectEqual(null, check(text));
    const numbers = try expand(testing.allocator, text);
    defer testing.allocator.free(numbers);
    try testing.expectEqualSlices(i32, expected, numbers);
    try testing.expectEqual(expected[0], first(text));
}

test "the examples of the specification, and others" {
    try expectNumbers(&.{ 1, 2, 3, 4, 5 }, "1 - 5");
    try expectNumbers(&.{1}, "1 - -1");
    try expectNumbers(&.{ -1, 0, 1 }, "-1 - 1");
    try expectNumbers(&.{ 1, 3, 5 }, "1-5:2");
    try expectNumbers(&.{ 1, 2, 3, 4, 5, 10, 12, 14 }, "10-15:2,1-5");
    try expectNumbers(&.{ 1, 5, 9 }, "1-10:4");
    try expectNumbers(&.{ -2, -1, 3, 4, 5, 7, 100 }, "100,-1--2:-1,3-5,\t7 ");
    try expectNumbers(&.{ 2, 4, 6, 8, 10 }, "10-1:-2");
    try expectNumbers(&.{ std.math.minInt(i32), std.math.maxInt(i32) }, "2147483647,-2147483648");
    for ([_][]const u8{ "1-10:4,10-15", "5,5", "1-3,2", "9-2:-3,4" }) |text|
        try testing.expectError(error.Overlap, expand(testing.allocator, text));
}

test "what is no range" {
    for ([_][]const u8{
        "",           "a",    "1-",      "-",   "1,,2", "1-5:0", "1-5:", "1:2", "1 2", "+1",
        "1-2-3",      "1..3", "1-3:1:1", "1;2", ",",    "1,",    "0x1",  "1_0", "1.5", "1-3 x",
        "2147483648",
    }) |text| {
        errdefer std.debug.print("{s}\n", .{text});
        try testing.expectEqual(.syntax, check(text).?);
    }
    try testing.expectEqual(.too_many, check("0-1000000").?);
    try testing.expectEqual(null, check("1-1000000"));
    try testing.expectEqual(.too_many, check("-2147483648-2147483647").?);
}
