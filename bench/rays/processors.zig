//! Threads held on one processor each, so that times repeat.

const std = @import("std");
const linux = std.os.linux;

/// Processors at most.
pub const count_max = 1024;

const word_bits = @bitSizeOf(usize);

/// The processors that this program may run on, in `buffer`; empty where the system does not tell.
pub fn allowed(buffer: *[count_max]u32) []const u32 {
    var set: linux.cpu_set_t = @splat(0);
    if (linux.sched_getaffinity(0, @sizeOf(linux.cpu_set_t), &set) != 0) return buffer[0..0];
    var count: usize = 0;
    for (set, 0..) |word, word_index| for (0..word_bits) |bit| {
        if (word >> @intCast(bit) & 1 == 0) continue;
        buffer[count] = @intCast(word_index * word_bits + bit);
        count += 1;
    };
    return buffer[0..count];
}

/// Holds the calling thread on one of `among`, in turns by `thread_index`; does nothing without
/// any, or where the system refuses.
pub fn pin(among: []const u32, thread_index: usize) void {
    if (among.len == 0) return;
    const processor = among[thread_index % among.len];
    var set: linux.cpu_set_t = @splat(0);
    set[processor / word_bits] = @as(usize, 1) << @intCast(processor % word_bits);
    linux.sched_setaffinity(0, &set) catch return;
}
