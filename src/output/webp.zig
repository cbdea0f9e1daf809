//! WebP, lossless or lossy, by libwebp's encoder.
//!
//! In: rows from the top, of RGB or RGBA bytes. Out: the file, the same bytes on every target: as
//! in the decoder, its plain C is compiled, and what it needs of logarithms and powers, by which it
//! chooses among ways to write the same, is ours. By one thread.

const std = @import("std");
const Allocator = std.mem.Allocator;
const elementary = @import("../math.zig").elementary;
const memory_account = @import("../memory_account.zig");
const assert = std.debug.assert;

/// Pixels on a side at most.
pub const side_max = 16_383;

/// What to encode.
pub const Picture = struct {
    width: u32,
    height: u32,
    /// Three, or four with alpha, which is kept without loss.
    channel_count: u8,
    /// Where there are four channels, the library reads words.
    pixels: []align(4) const u8,
    /// Of lossy compression, 1 to 100; null: nothing is lost.
    quality: ?u8 = null,
};

/// The file; the caller frees it.
pub fn encode(gpa: Allocator, picture: Picture) error{OutOfMemory}![]u8 {
    assert(@max(picture.width, picture.height) <= side_max);
    assert(picture.channel_count == 3 or picture.channel_count == 4);
    const byte_count = @as(usize, picture.width) * picture.height * picture.channel_count;
    assert(picture.pixels.len == byte_count);
    var heap: memory_account.LibraryHeap = .{ .gpa = gpa };
    defer heap.deinit();
    var file: File = .{ .gpa = gpa };
    errdefer file.bytes.deinit(gpa);
    const hooks = heap.hooks();
    switch (rl_webp_encode(&hooks, &.{
        .width = @intCast(picture.width),
        .height = @intCast(picture.height),
        .channel_count = picture.channel_count,
        .quality = picture.quality orelse 0,
        .pixels = picture.pixels.ptr,
        .sink = File.put,
        .user = &file,
    })) {
        .done => {},
        .exhausted => return error.OutOfMemory,
        // There is nothing that a picture within the limits could be refused for, but a file of
        // 4 GB, which no memory holds that these pixels leave.
        .broken => return error.OutOfMemory,
    }
    return file.bytes.toOwnedSlice(gpa);
}

const File = struct {
    gpa: Allocator,
    bytes: std.ArrayList(u8) = .empty,

    fn put(user: ?*anyopaque, bytes: [*]const u8, length: usize) callconv(.c) bool {
        const file: *File = @ptrCast(@alignCast(user.?));
        file.bytes.appendSlice(file.gpa, bytes[0..length]) catch return false;
        return true;
    }
};

/// In the order of webp.c.
const LibraryPicture = extern struct {
    width: c_int,
    height: c_int,
    channel_count: c_int,
    quality: c_int,
    pixels: [*]const u8,
    sink: *const fn (?*anyopaque, [*]const u8, usize) callconv(.c) bool,
    user: ?*anyopaque,
};

extern fn rl_webp_encode(
    memory: *const memory_account.Hooks,
    picture: *const LibraryPicture,
) enum(c_int) { done, exhausted, broken };

/// Exports what the library calls: to be called at comptime, once a program.
pub fn exportFunctions() void {
    @export(&log, .{ .name = "rl_webp_log" });
    @export(&pow, .{ .name = "rl_webp_pow" });
}

fn log(x: f64) callconv(.c) f64 {
    return elementary.log(x);
}

fn pow(base: f64, exponent: f64) callconv(.c) f64 {
    return if (base > 0) elementary.pow(base, exponent) else 0;
}

test "memory that runs out is an error, whenever it does; alpha and loss are what is asked for" {
    const gpa = std.testing.allocator;
    var pixels: [20 * 30 * 4]u8 align(4) = undefined;
    for (&pixels, 0..) |*byte, at| byte.* = @truncate(at * at / 7);
    for ([_]?u8{ null, 50 }) |quality| for (0..400) |fail_index| {
        var failing: std.testing.FailingAllocator = .init(gpa, .{ .fail_index = fail_index });
        const file = encode(failing.allocator(), .{
            .width = 20,
            .height = 30,
            .channel_count = 4,
            .pixels = &pixels,
            .quality = quality,
        }) catch |err| {
            try std.testing.expectEqual(error.OutOfMemory, err);
            continue;
        };
        defer failing.allocator().free(file);
        try std.testing.expect(fail_index > 2);
        try std.testing.expectEqualStrings("RIFF", file[0..4]);
        // With alpha a lossy image needs the extended format.
        try std.testing.expectEqualStrings(if (quality == null) "VP8L" else "VP8X", file[12..16]);
        break;
    } else return error.NeverEnoughMemory;
}
