//! Large arrays on large pages.
//!
//! In: how many items. Out: an array, from the start of a large page on where it is that long, and
//! a hint to the system that there be large pages. The build of a tree touches some 150 bytes a
//! triangle for the first time, and a page fault for every 4 KiB of them was a third of its time;
//! those before the first large page and after the last were still a twentieth, and most of what
//! two threads waited for each other. A tile of a picture touches a page in every row. Only for
//! arrays that are used to their end: a large page is there as a whole or not at all.

const std = @import("std");
const builtin = @import("builtin");
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;

/// Size of a large page, or a multiple of it, where the system has some.
const page_bytes = 2 << 20;

/// An array of `count` items, to be freed by `free`, or with the arena that it comes from.
pub fn alloc(
    allocator: Allocator,
    comptime Item: type,
    count: usize,
) error{OutOfMemory}![]align(64) Item {
    const bytes = std.math.mul(usize, count, @sizeOf(Item)) catch return error.OutOfMemory;
    if (bytes < page_bytes) return allocator.alignedAlloc(Item, .@"64", count);
    const memory = try allocator.alignedAlloc(u8, .fromByteUnits(page_bytes), withTail(bytes));
    advise(memory);
    const items: [*]align(64) Item = @ptrCast(memory.ptr);
    return items[0..count];
}

/// Frees an array that `alloc` returned.
pub fn free(allocator: Allocator, array: anytype) void {
    const bytes = std.mem.sliceAsBytes(array);
    if (bytes.len < page_bytes) return allocator.free(array);
    const memory: [*]align(page_bytes) u8 = @alignCast(bytes.ptr);
    allocator.free(memory[0..withTail(bytes.len)]);
}

/// With the rest of the last page where most of it is used.
fn withTail(bytes: usize) usize {
    const tail = bytes % page_bytes;
    return if (tail > page_bytes / 2) bytes - tail + page_bytes else bytes;
}

fn advise(memory: []align(page_bytes) u8) void {
    if (builtin.os.tag != .linux) return;
    const length = std.mem.alignBackward(usize, memory.len, page_bytes);
    assert(length > 0);
    // Systems without them say so; nothing is lost.
    _ = std.os.linux.madvise(memory.ptr, length, std.os.linux.MADV.HUGEPAGE);
}

test "arrays of any length, from any allocator" {
    const gpa = std.testing.allocator;
    var arena: std.heap.ArenaAllocator = .init(gpa);
    defer arena.deinit();
    const page_items = page_bytes / @sizeOf([3]f32) + 1;
    for ([_]usize{ 0, 1, page_items - 1, page_items, 5 * page_items / 2, 2 * page_items }) |count| {
        const array = try alloc(gpa, [3]f32, count);
        defer free(gpa, array);
        try std.testing.expectEqual(count, array.len);
        @memset(array, .{ 1, 2, 3 });
        const other = try alloc(arena.allocator(), [3]f32, count);
        @memset(other, .{ 4, 5, 6 });
        if (count > 0) try std.testing.expectEqual([3]f32{ 1, 2, 3 }, array[count - 1]);
    }
    const huge = std.math.maxInt(usize) / 2;
    try std.testing.expectError(error.OutOfMemory, alloc(gpa, [3]f32, huge));
}
