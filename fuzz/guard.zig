//! An allocator that puts each block at the end of its pages, with a page behind it that nobody may
//! touch.
//!
//! In: requests. Out: blocks whose end is the end of what may be read and written, as far as their
//! alignment allows; the bytes that it leaves behind one are looked at when that is freed. What is
//! freed may not be touched any more. What reads or writes too far ends the program by a signal.

const std = @import("std");
const Alignment = std.mem.Alignment;
const Allocator = std.mem.Allocator;
const linux = std.os.linux;

const page_bytes = 4096;
/// What is behind a block up to the page.
const filler = 0xfd;

/// For all threads.
pub const allocator: Allocator = .{ .ptr = undefined, .vtable = &.{
    .alloc = alloc,
    .resize = resize,
    .remap = remap,
    .free = free,
} };

/// Where the pages of a block are.
fn mapOf(address: usize, len: usize, alignment: Alignment) struct { start: usize, bytes: usize } {
    // Blocks that are aligned to more than a page lie at the start of their pages' aligned part.
    const start = std.mem.alignBackward(usize, address, @max(page_bytes, alignment.toByteUnits()));
    const end = std.mem.alignForward(usize, address + len, page_bytes) + page_bytes;
    return .{ .start = start, .bytes = end - start };
}

fn alloc(_: *anyopaque, len: usize, alignment: Alignment, _: usize) ?[*]u8 {
    const align_bytes = alignment.toByteUnits();
    if (len > std.math.maxInt(usize) / 4) return null;
    const used = std.mem.alignForward(usize, len, page_bytes);
    const extra = if (align_bytes > page_bytes) align_bytes else 0;
    const whole = used + page_bytes + extra;
    const mapped = linux.mmap(
        null,
        whole,
        .{ .READ = true, .WRITE = true },
        .{ .TYPE = .PRIVATE, .ANONYMOUS = true },
        -1,
        0,
    );
    if (linux.errno(mapped) != .SUCCESS) return null;
    const start = std.mem.alignForward(usize, mapped, @max(page_bytes, align_bytes));
    if (start > mapped) unmap(mapped, start - mapped);
    const end = start + used + page_bytes;
    if (end < mapped + whole) unmap(end, mapped + whole - end);
    const guard: [*]align(page_bytes) u8 = @ptrFromInt(start + used);
    if (linux.errno(linux.mprotect(guard, page_bytes, .{})) != .SUCCESS) {
        unmap(start, used + page_bytes);
        return null;
    }
    const address = if (align_bytes > page_bytes)
        start
    else
        std.mem.alignBackward(usize, start + used - len, align_bytes);
    const block: [*]u8 = @ptrFromInt(address);
    @memset(block[len .. start + used - address], filler);
    return block;
}

fn resize(_: *anyopaque, _: []u8, _: Alignment, _: usize, _: usize) bool {
    return false;
}

fn remap(_: *anyopaque, _: []u8, _: Alignment, _: usize, _: usize) ?[*]u8 {
    return null;
}

fn free(_: *anyopaque, memory: []u8, alignment: Alignment, _: usize) void {
    const map = mapOf(@intFromPtr(memory.ptr), memory.len, alignment);
    const end = map.start + map.bytes - page_bytes;
    const behind = memory.ptr[memory.len .. end - @intFromPtr(memory.ptr)];
    for (behind, 0..) |byte, index| if (byte != filler) std.debug.panic(
        "byte {d} behind a block of {d} was written",
        .{ index, memory.len },
    );
    unmap(map.start, map.bytes);
}

fn unmap(address: usize, bytes: usize) void {
    _ = linux.munmap(@ptrFromInt(address), bytes);
}
