//! What comes through a pipe, a socket or standard input, read to its end.
//!
//! In: an open descriptor. Out: all of its bytes with a zero byte behind them, up to a limit.
//! Memory grows with what has arrived, twice as much at a time. A pipe is waited for, before its
//! first writer as well.

const std = @import("std");
const Allocator = std.mem.Allocator;

/// Bytes that there is room for at first.
const first_bytes = 1 << 16;

pub const Error = error{ OutOfMemory, TooLarge } || std.posix.ReadError || std.posix.PollError;

/// Reads `descriptor` to its end; `expected_bytes` is a guess of how many there are. Memory from
/// `allocator`, the caller's.
pub fn readAll(
    allocator: Allocator,
    descriptor: std.posix.fd_t,
    expected_bytes: u64,
    bytes_max: u64,
) Error![:0]u8 {
    var bytes: std.ArrayList(u8) = .empty;
    errdefer bytes.deinit(allocator);
    const guess = @min(expected_bytes, bytes_max) + 1;
    try bytes.ensureTotalCapacityPrecise(allocator, @intCast(@max(guess, first_bytes)));
    while (true) {
        // One byte more than the limit tells that there is more.
        const room_max: usize = @intCast(@max(bytes_max + 1, first_bytes));
        if (bytes.items.len == bytes.capacity)
            try bytes.ensureTotalCapacityPrecise(allocator, @min(2 * bytes.capacity, room_max));
        const count = try readSome(descriptor, bytes.unusedCapacitySlice());
        if (count == 0) break;
        bytes.items.len += count;
        if (bytes.items.len > bytes_max) return error.TooLarge;
    }
    return bytes.toOwnedSliceSentinel(allocator, 0);
}

fn readSome(descriptor: std.posix.fd_t, room: []u8) Error!usize {
    while (true) {
        // A pipe that is opened without waiting seems to be at its end until somebody writes.
        var polled = [1]std.posix.pollfd{
            .{ .fd = descriptor, .events = std.posix.POLL.IN, .revents = 0 },
        };
        _ = try std.posix.poll(&polled, -1);
        return std.posix.read(descriptor, room) catch |err| switch (err) {
            error.WouldBlock => continue,
            else => |other| return other,
        };
    }
}

test "a pipe is read to its end, or to its limit" {
    const gpa = std.testing.allocator;
    for ([_]u64{ 5, 4 }) |bytes_max| {
        var ends: [2]std.posix.fd_t = undefined;
        try std.testing.expectEqual(0, std.c.pipe(&ends));
        defer _ = std.c.close(ends[0]);
        try std.testing.expectEqual(5, std.c.write(ends[1], "hello", 5));
        _ = std.c.close(ends[1]);
        const bytes = readAll(gpa, ends[0], 0, bytes_max) catch |err| {
            try std.testing.expectEqual(error.TooLarge, err);
            try std.testing.expectEqual(4, bytes_max);
            continue;
        };
        defer gpa.free(bytes);
        try std.testing.expectEqual(5, bytes_max);
        try std.testing.expectEqualStrings("hello", bytes);
    }
}
