//! OpenEXR of halves, scan lines compressed by ZIP, by OpenEXRCore and libdeflate.
//!
//! In: rows from the top, of RGB or RGBA floats within the range of halves. Out: the file, the same
//! bytes on every target. By one thread.

const std = @import("std");
const Allocator = std.mem.Allocator;
const memory_account = @import("../memory_account.zig");
const assert = std.debug.assert;

/// Pixels of a row at most: the library counts the bytes of 16 rows in C's int.
pub const width_max = 1 << 20;
/// Largest value that a half holds.
pub const value_max: f32 = 65_504;

/// What to encode.
pub const Picture = struct {
    width: u32,
    height: u32,
    /// Three, or four with alpha.
    channel_count: u8,
    /// Floats; colours are multiplied by alpha.
    pixels: []align(4) const u8,
};

/// The file; the caller frees it.
pub fn encode(gpa: Allocator, picture: Picture) error{OutOfMemory}![]u8 {
    assert(picture.width <= width_max and picture.height <= std.math.maxInt(i32));
    assert(picture.channel_count == 3 or picture.channel_count == 4);
    var heap: memory_account.LibraryHeap = .{ .gpa = gpa };
    defer heap.deinit();
    var file: File = .{ .gpa = gpa };
    errdefer file.bytes.deinit(gpa);
    const hooks = heap.hooks();
    switch (rl_exr_encode(&hooks, &.{
        .width = @intCast(picture.width),
        .height = @intCast(picture.height),
        .channels = picture.channel_count,
        .pixels = @ptrCast(picture.pixels.ptr),
        .sink = File.put,
        .user = &file,
    })) {
        .done => {},
        .exhausted => return error.OutOfMemory,
        // There is nothing that a picture within the limits could be refused for.
        .broken => unreachable,
    }
    return file.bytes.toOwnedSlice(gpa);
}

/// What has been written so far. The table of the rows' places is filled in at the end.
const File = struct {
    gpa: Allocator,
    bytes: std.ArrayList(u8) = .empty,

    fn put(user: ?*anyopaque, bytes: [*]const u8, length: usize, offset: usize) callconv(.c) bool {
        const file: *File = @ptrCast(@alignCast(user.?));
        const old = file.bytes.items.len;
        if (offset + length > old) {
            file.bytes.resize(file.gpa, offset + length) catch return false;
            @memset(file.bytes.items[old..], 0);
        }
        @memcpy(file.bytes.items[offset..][0..length], bytes);
        return true;
    }
};

/// In the order of openexr.c.
const LibraryPicture = extern struct {
    width: c_int,
    height: c_int,
    channels: c_int,
    pixels: [*]const f32,
    sink: *const fn (?*anyopaque, [*]const u8, usize, usize) callconv(.c) bool,
    user: ?*anyopaque,
};

extern fn rl_exr_encode(
    memory: *const memory_account.Hooks,
    picture: *const LibraryPicture,
) enum(c_int) { done, exhausted, broken };

test "memory that runs out is an error, whenever it does" {
    const gpa = std.testing.allocator;
    const pixels: [9 * 40 * 16]u8 align(4) = @splat(0);
    for (0..200) |fail_index| {
        var failing: std.testing.FailingAllocator = .init(gpa, .{ .fail_index = fail_index });
        const file = encode(failing.allocator(), .{
            .width = 9,
            .height = 40,
            .channel_count = 4,
            .pixels = &pixels,
        }) catch |err| {
            try std.testing.expectEqual(error.OutOfMemory, err);
            continue;
        };
        failing.allocator().free(file);
        try std.testing.expect(fail_index > 10);
        break;
    } else return error.NeverEnoughMemory;
}
