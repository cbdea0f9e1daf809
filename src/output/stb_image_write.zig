//! PNG, JPEG, TGA, BMP and Radiance HDR, by stb_image_write and libdeflate.
//!
//! In: rows from the top, of sRGB bytes or, for HDR, of floats. Out: the file, the same bytes on
//! every target. By one thread: a PNG of 1024x1024 takes 10 ms on x86-64, a JPEG 6.

const std = @import("std");
const Allocator = std.mem.Allocator;
const memory_account = @import("../memory_account.zig");
const assert = std.debug.assert;

/// In the order of stb_image_write.c.
pub const Codec = enum(c_int) { png, jpg, tga, bmp, hdr };

/// Channels of all pixels, and a byte a row: the library counts in C's int, and adds some.
pub const value_count_max = 2_000_000_000;

/// What to encode.
pub const Picture = struct {
    width: u32,
    height: u32,
    /// Three, or four with alpha (PNG and TGA).
    channel_count: u8,
    /// Floats for HDR.
    pixels: []align(4) const u8,
    /// 1 to 100; of JPEG.
    quality: u8,
};

/// The file; the caller frees it. Asserts that no more than `value_count_max` values go in.
pub fn encode(gpa: Allocator, codec: Codec, picture: Picture) error{OutOfMemory}![]u8 {
    const row_count_max = value_count_max / (@as(u64, picture.width) * picture.channel_count + 1);
    assert(picture.height <= row_count_max);
    assert(picture.quality >= 1 and picture.quality <= 100);
    var heap: memory_account.LibraryHeap = .{ .gpa = gpa };
    defer heap.deinit();
    var file: File = .{ .gpa = gpa };
    errdefer file.bytes.deinit(gpa);
    const is_done = rl_encode(
        &heap.hooks(),
        codec,
        @intCast(picture.width),
        @intCast(picture.height),
        picture.channel_count,
        picture.pixels.ptr,
        picture.quality,
        File.append,
        &file,
    );
    if (!is_done or file.is_cut) return error.OutOfMemory;
    return file.bytes.toOwnedSlice(gpa);
}

/// What has been written so far.
const File = struct {
    gpa: Allocator,
    bytes: std.ArrayList(u8) = .empty,
    is_cut: bool = false,

    fn append(user: ?*anyopaque, bytes: [*]const u8, length: c_int) callconv(.c) void {
        const file: *File = @ptrCast(@alignCast(user.?));
        const piece = bytes[0..@intCast(length)];
        file.bytes.appendSlice(file.gpa, piece) catch {
            file.is_cut = true;
        };
    }
};

extern fn rl_encode(
    memory: *const memory_account.Hooks,
    format: Codec,
    width: c_int,
    height: c_int,
    channels: c_int,
    pixels: *const anyopaque,
    quality: c_int,
    sink: *const fn (?*anyopaque, [*]const u8, c_int) callconv(.c) void,
    user: ?*anyopaque,
) bool;

test "memory that runs out is an error, whenever it does" {
    const gpa = std.testing.allocator;
    const pixels: [9 * 7 * 12]u8 align(4) = @splat(0);
    for (std.enums.values(Codec)) |codec| {
        const byte_count: usize = if (codec == .hdr) pixels.len else 9 * 7 * 3;
        for (0..100) |fail_index| {
            var failing: std.testing.FailingAllocator = .init(gpa, .{ .fail_index = fail_index });
            const file = encode(failing.allocator(), codec, .{
                .width = 9,
                .height = 7,
                .channel_count = 3,
                .pixels = pixels[0..byte_count],
                .quality = 90,
            }) catch |err| {
                try std.testing.expectEqual(error.OutOfMemory, err);
                continue;
            };
            failing.allocator().free(file);
            try std.testing.expect(fail_index > 0);
            break;
        } else return error.NeverEnoughMemory;
    }
}
