//! gzip: the bytes that were compressed, by libdeflate.
//!
//! In: a file of one or more members (RFC 1952). Out: what they hold together, with a zero byte
//! behind it. A deflated byte stands for 1032 at most, and a member ends in its size: memory is
//! asked for only as far as both and the caller's limit allow.

const std = @import("std");
const Allocator = std.mem.Allocator;
const Message = @import("../diagnostic.zig").Message;
const memory_account = @import("../memory_account.zig");
const assert = std.debug.assert;

/// What every member starts with.
const signature = "\x1f\x8b";
/// Of a member: fixed fields in front, checksum and size behind.
const head_bytes = 10;
const foot_bytes = 8;
/// Most bytes that one deflated byte may stand for: 258 from two bits, four times.
const ratio_max = 1032;

pub const Error = error{ OutOfMemory, InvalidGzip };

/// Whether a file claims to be compressed by gzip.
pub fn isGzip(file: []const u8) bool {
    return std.mem.startsWith(u8, file, signature);
}

/// What the file, which `isGzip`, holds; `bytes_max` at most. Otherwise `reason` says why not, as
/// what follows the file's name. The caller frees it.
pub fn inflate(
    gpa: Allocator,
    file: []const u8,
    bytes_max: u64,
    reason: *Message,
) Error![:0]u8 {
    assert(isGzip(file));
    const whole_max: usize = @intCast(@min(
        bytes_max,
        @as(u64, file.len) * ratio_max,
        std.math.maxInt(usize) / 2,
    ));
    var result: std.ArrayList(u8) = .empty;
    errdefer result.deinit(gpa);
    var rest = file;
    // What follows the last member is nobody's, as with gzip itself.
    while (isGzip(rest)) {
        const start = headOf(rest) orelse
            return invalid(reason, "its gzip data is cut short");
        const used = try append(gpa, &result, rest[start..], whole_max, bytes_max, reason);
        rest = rest[start + used ..];
    }
    return result.toOwnedSliceSentinel(gpa, 0);
}

fn invalid(reason: *Message, comptime text: []const u8) error{InvalidGzip} {
    reason.set(text, .{});
    return error.InvalidGzip;
}

/// Appends the member whose deflated bytes `body` starts with, and returns where it ends.
fn append(
    gpa: Allocator,
    result: *std.ArrayList(u8),
    body: []const u8,
    whole_max: usize,
    bytes_max: u64,
    reason: *Message,
) Error!usize {
    if (body.len < foot_bytes) return invalid(reason, "its gzip data is cut short");
    const before = result.items.len;
    // The size of the last member, which is mostly the only one.
    const claimed = std.mem.readInt(u32, body[body.len - 4 ..][0..4], .little);
    var room = @min(claimed, whole_max - before);
    while (true) {
        // And one for the zero byte. What has many members grows by more than each.
        if (before == 0)
            try result.ensureTotalCapacityPrecise(gpa, room + 1)
        else
            try result.ensureTotalCapacity(gpa, before + room + 1);
        var used: usize = 0;
        var written: usize = 0;
        const out = result.allocatedSlice()[before..][0..room];
        switch (try inflateOne(gpa, body, out, &used, &written)) {
            .done => {
                if (body.len - used < foot_bytes)
                    return invalid(reason, "its gzip data is cut short");
                const foot = body[used..][0..foot_bytes];
                if (std.mem.readInt(u32, foot[0..4], .little) !=
                    libdeflate_crc32(0, out.ptr, written) or
                    std.mem.readInt(u32, foot[4..8], .little) != written)
                    return invalid(reason, "its gzip data is broken: wrong checksum");
                result.items.len = before + written;
                return used + foot_bytes;
            },
            .larger => {},
            .broken, .exhausted => return invalid(reason, "its gzip data is broken"),
        }
        const room_max = whole_max - before;
        if (room == room_max) {
            if (whole_max < bytes_max) return invalid(reason, "its gzip data is broken");
            reason.set("holds more than the limit of {d} bytes", .{bytes_max});
            return error.InvalidGzip;
        }
        room = @min(@max(2 * room, 4096), room_max);
    }
}

fn inflateOne(
    gpa: Allocator,
    body: []const u8,
    out: []u8,
    used: *usize,
    written: *usize,
) error{OutOfMemory}!Outcome {
    var heap: memory_account.LibraryHeap = .{ .gpa = gpa };
    defer heap.deinit();
    const hooks = heap.hooks();
    const outcome = rl_inflate(&hooks, body.ptr, body.len, out.ptr, out.len, used, written);
    return if (outcome == .exhausted) error.OutOfMemory else outcome;
}

/// Length of a member's head; null: it is cut short. RFC 1952, 2.3.
fn headOf(member: []const u8) ?usize {
    const Flags = packed struct(u8) {
        is_text: bool,
        has_checksum: bool,
        has_extra: bool,
        has_name: bool,
        has_comment: bool,
        reserved: u3,
    };
    if (member.len < head_bytes) return null;
    const flags: Flags = @bitCast(member[3]);
    var length: usize = head_bytes;
    if (flags.has_extra) {
        if (member.len - length < 2) return null;
        length += 2 + @as(usize, std.mem.readInt(u16, member[length..][0..2], .little));
    }
    inline for (.{ flags.has_name, flags.has_comment }) |has| if (has) {
        if (length > member.len) return null;
        length = (std.mem.findScalarPos(u8, member, length, 0) orelse return null) + 1;
    };
    if (flags.has_checksum) length += 2;
    return if (length <= member.len) length else null;
}

const Outcome = enum(c_int) { done, exhausted, broken, larger };

extern fn rl_inflate(
    memory: *const memory_account.Hooks,
    in: [*]const u8,
    in_bytes: usize,
    out: [*]u8,
    out_bytes: usize,
    in_used: *usize,
    out_used: *usize,
) Outcome;

extern fn libdeflate_crc32(sum: u32, bytes: [*]const u8, length: usize) u32;

/// "hello, hello, hello\n", deflated, with its checksum and size.
const hello = "\xcb\x48\xcd\xc9\xc9\xd7\x51\xc8\x40\xa2\xb8\x00" ++
    "\xe7\x42\x6e\x52\x14\x00\x00\x00";
const plain = "\x1f\x8b\x08\x00\x00\x00\x00\x00\x00\x03" ++ hello;

test "members follow each other, with all that their heads may hold" {
    const gpa = std.testing.allocator;
    const full = "\x1f\x8b\x08\x1e\x00\x00\x00\x00\x00\x03\x02\x00ab" ++
        "name\x00comment\x00\x12\x34" ++ hello;
    var reason: Message = .{};
    for ([_][]const u8{ plain, full, plain ++ full ++ plain, plain ++ "rest" }, [_]usize{
        1, 1, 3, 1,
    }) |file, count| {
        const bytes = try inflate(gpa, file, 1 << 20, &reason);
        defer gpa.free(bytes);
        try std.testing.expectEqual(20 * count, bytes.len);
        for (0..count) |index| {
            const member = bytes[20 * index ..][0..20];
            try std.testing.expectEqualStrings("hello, hello, hello\n", member);
        }
        try std.testing.expectEqual(0, bytes[bytes.len]);
    }
}

test "what is cut short, broken or too much is said" {
    const gpa = std.testing.allocator;
    var reason: Message = .{};
    for (2..plain.len) |length| try std.testing.expectError(
        error.InvalidGzip,
        inflate(gpa, plain[0..length], 1 << 20, &reason),
    );
    for ([_]usize{ 12, plain.len - 8, plain.len - 4 }) |place| {
        var broken = plain.*;
        broken[place] ^= 0x40;
        try std.testing.expectError(error.InvalidGzip, inflate(gpa, &broken, 1 << 20, &reason));
        try std.testing.expect(std.mem.startsWith(u8, reason.text(), "its gzip data is broken"));
    }
    try std.testing.expectError(error.InvalidGzip, inflate(gpa, plain, 19, &reason));
    try std.testing.expectEqualStrings("holds more than the limit of 19 bytes", reason.text());
    var failing: std.testing.FailingAllocator = .init(gpa, .{ .fail_index = 1 });
    try std.testing.expectError(
        error.OutOfMemory,
        inflate(failing.allocator(), plain, 1 << 20, &reason),
    );
}
