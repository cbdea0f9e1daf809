//! Changes to a JSON text that leave out what breaks its rule.
//!
//! In: from json.zig, what to change and where, in the order of the text. Out: the text with the
//! changes, and which elements of its counted lists are left out: those may be missed, or not.

const std = @import("std");
const Allocator = std.mem.Allocator;
const assert = std.debug.assert;
const Lenience = @This();

gpa: Allocator,
/// Keeps what is said of broken elements.
arena: std.heap.ArenaAllocator,
/// What is wrong with each element that is left out.
broken: std.AutoArrayHashMapUnmanaged(Element, Broken) = .empty,
edits: std.ArrayList(Edit) = .empty,
/// The numbers of lists that replace others.
numbers: std.ArrayList(u8) = .empty,

/// Elements that are left out; a document with more is refused.
pub const broken_count_max = 1 << 16;

/// An element of a counted list.
pub const Element = struct { list: u8, index: u32 };

/// Why an element is left out.
pub const Broken = struct {
    reason: []const u8,
    /// Whether a file is missing or cannot be read.
    is_missing: bool = false,
};

/// Bytes `start..end` of a text that become others.
const Edit = struct {
    start: usize,
    end: usize,
    by: union(enum) {
        text: []const u8,
        /// Of `numbers`.
        numbers: struct { start: usize, end: usize },
    },
};

/// Nothing is left out yet. Free with `deinit`.
pub fn init(gpa: Allocator) Lenience {
    return .{ .gpa = gpa, .arena = .init(gpa) };
}

/// Frees everything.
pub fn deinit(lenience: *Lenience) void {
    lenience.broken.deinit(lenience.gpa);
    lenience.edits.deinit(lenience.gpa);
    lenience.numbers.deinit(lenience.gpa);
    lenience.arena.deinit();
    lenience.* = undefined;
}

/// Whether the element is left out.
pub fn isBroken(lenience: *const Lenience, list: u8, index: u32) bool {
    return lenience.broken.contains(.{ .list = list, .index = index });
}

/// Notes that an element is broken, and why; the first reason counts.
pub fn leaveOut(
    lenience: *Lenience,
    list: u8,
    index: u32,
    broken: Broken,
) error{OutOfMemory}!void {
    const element: Element = .{ .list = list, .index = index };
    if (lenience.broken.contains(element)) return;
    var kept = broken;
    kept.reason = try lenience.arena.allocator().dupe(u8, broken.reason);
    try lenience.broken.put(lenience.gpa, element, kept);
}

/// Makes the key at `start` one that is not known.
pub fn hideKey(lenience: *Lenience, start: usize) error{OutOfMemory}!void {
    const at = start + 1; // Behind its quote.
    try lenience.edits.append(lenience.gpa, .{ .start = at, .end = at, .by = .{ .text = "?" } });
}

/// Puts `by` in the place of an element, whatever was to be changed within.
pub fn replaceElement(
    lenience: *Lenience,
    start: usize,
    end: usize,
    by: []const u8,
) error{OutOfMemory}!void {
    while (lenience.edits.getLastOrNull()) |last| {
        if (last.start < start) break;
        lenience.edits.items.len -= 1;
    }
    try lenience.edits.append(lenience.gpa, .{ .start = start, .end = end, .by = .{ .text = by } });
}

/// Puts a list of these numbers in the place of another.
pub fn replaceNumbers(
    lenience: *Lenience,
    start: usize,
    end: usize,
    list: []const u32,
) error{OutOfMemory}!void {
    const first = lenience.numbers.items.len;
    for (list, 0..) |number, index| {
        try lenience.numbers.append(lenience.gpa, if (index == 0) '[' else ',');
        try lenience.numbers.print(lenience.gpa, "{d}", .{number});
    }
    try lenience.numbers.appendSlice(lenience.gpa, if (list.len == 0) "[]" else "]");
    try lenience.edits.append(lenience.gpa, .{
        .start = start,
        .end = end,
        .by = .{ .numbers = .{ .start = first, .end = lenience.numbers.items.len } },
    });
}

/// A copy of the text with all changes, which are forgotten; null: there are none. The caller frees
/// it.
pub fn apply(lenience: *Lenience, text: []const u8) error{OutOfMemory}!?[]u8 {
    if (lenience.edits.items.len == 0) return null;
    var copy: std.ArrayList(u8) = try .initCapacity(lenience.gpa, text.len);
    errdefer copy.deinit(lenience.gpa);
    var offset: usize = 0;
    for (lenience.edits.items) |edit| {
        assert(edit.start >= offset);
        try copy.appendSlice(lenience.gpa, text[offset..edit.start]);
        try copy.appendSlice(lenience.gpa, switch (edit.by) {
            .text => |other| other,
            .numbers => |range| lenience.numbers.items[range.start..range.end],
        });
        offset = edit.end;
    }
    try copy.appendSlice(lenience.gpa, text[offset..]);
    lenience.edits.clearRetainingCapacity();
    lenience.numbers.clearRetainingCapacity();
    return try copy.toOwnedSlice(lenience.gpa);
}
