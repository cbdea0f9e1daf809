//! Asks the system for large pages behind a large array.
//!
//! In: memory not yet touched. Out: nothing; it is a hint. A build touches some 150 bytes a
//! triangle for the first time, and a page fault for every 4 KiB of them was a third of its time.
//! Only for arrays that are used to their end: a large page is there as a whole or not at all.

const std = @import("std");
const builtin = @import("builtin");
const assert = std.debug.assert;

/// Size of a large page, or a multiple of it, where the system has some.
const page_bytes = 2 << 20;

/// Hints that `memory`, a slice of anything, be backed by large pages where it covers whole ones.
pub fn advise(memory: anytype) void {
    if (builtin.os.tag != .linux) return;
    const bytes = std.mem.sliceAsBytes(memory);
    const address = @intFromPtr(bytes.ptr);
    const begin = std.mem.alignForward(usize, address, page_bytes);
    const end = std.mem.alignBackward(usize, address + bytes.len, page_bytes);
    if (begin >= end) return;
    assert(begin - address + (end - begin) <= bytes.len);
    const first: [*]u8 = @constCast(bytes.ptr + (begin - address));
    // Systems without them say so; nothing is lost.
    _ = std.os.linux.madvise(first, end - begin, std.os.linux.MADV.HUGEPAGE);
}

test "any slice may be advised" {
    const gpa = std.testing.allocator;
    advise(@as([]const u8, &.{}));
    const large = try gpa.alloc([3]f32, 1 << 19);
    defer gpa.free(large);
    advise(large);
    @memset(large, .{ 1, 2, 3 });
    advise(large[1..2]);
    try std.testing.expectEqual([3]f32{ 1, 2, 3 }, large[large.len - 1]);
}
