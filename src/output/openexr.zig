//! OpenEXR of halves, floats and whole numbers, scan lines compressed by ZIP, by OpenEXRCore and
//! libdeflate.
//!
//! In: channels, rows from the top, and texts. Out: the file, the same bytes on every target. By
//! one thread.

const std = @import("std");
const Allocator = std.mem.Allocator;
const memory_account = @import("../memory_account.zig");
const assert = std.debug.assert;

/// Pixels of a row at most: the library counts the bytes of 16 rows in C's int.
pub const width_max = 1 << 20;
/// Largest value that a half holds.
pub const value_max: f32 = 65_504;
/// Bytes of an attribute's text at most; the format counts them in an int.
pub const text_bytes_max = 1 << 24;

/// Pixels x0 <= x < x1, y0 <= y < y1; at least one.
pub const Window = struct { x0: u32, y0: u32, x1: u32, y1: u32 };

/// What to encode.
pub const Picture = struct {
    /// Sides of the whole picture: the display window.
    width: u32,
    height: u32,
    /// Pixels that the channels hold: the data window. Null: all.
    window: ?Window = null,
    /// At least one; in the file they are in the order of the alphabet.
    channels: []const Channel,
    attributes: []const Attribute = &.{},
};

/// Of the values in memory and, but for halves, of those in the file.
pub const Kind = enum(u8) {
    /// Floats within the range of halves.
    half,
    float,
    uint,
};

/// Values of all pixels of the window. In the order of openexr.c.
pub const Channel = extern struct {
    /// Of its own, at most 31 bytes: `R`, or `layer.R`.
    name: [*:0]const u8,
    /// Of the first pixel; whole numbers are in the place of the floats.
    first: [*]const f32,
    /// Numbers from a pixel to the next.
    stride: u32 = 1,
    kind: Kind = .float,
};

/// A text with a name of at most 31 bytes, none of those that the format has. In the order of
/// openexr.c.
pub const Attribute = extern struct {
    name: [*:0]const u8,
    /// Of at most `text_bytes_max` bytes.
    text: [*:0]const u8,
};

/// The file; the caller frees it.
pub fn encode(gpa: Allocator, picture: Picture) error{OutOfMemory}![]u8 {
    assert(picture.width <= width_max and picture.height <= std.math.maxInt(i32));
    const window: Window = picture.window orelse
        .{ .x0 = 0, .y0 = 0, .x1 = picture.width, .y1 = picture.height };
    assert(window.x0 < window.x1 and window.x1 <= picture.width);
    assert(window.y0 < window.y1 and window.y1 <= picture.height);
    var heap: memory_account.LibraryHeap = .{ .gpa = gpa };
    defer heap.deinit();
    var file: File = .{ .gpa = gpa };
    errdefer file.bytes.deinit(gpa);
    const hooks = heap.hooks();
    switch (rl_exr_encode(&hooks, &.{
        .width = @intCast(picture.width),
        .height = @intCast(picture.height),
        .x0 = @intCast(window.x0),
        .y0 = @intCast(window.y0),
        .x1 = @intCast(window.x1),
        .y1 = @intCast(window.y1),
        .channel_count = @intCast(picture.channels.len),
        .attribute_count = @intCast(picture.attributes.len),
        .channels = picture.channels.ptr,
        .attributes = picture.attributes.ptr,
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
    x0: c_int,
    y0: c_int,
    x1: c_int,
    y1: c_int,
    channel_count: c_int,
    attribute_count: c_int,
    channels: [*]const Channel,
    attributes: [*]const Attribute,
    sink: *const fn (?*anyopaque, [*]const u8, usize, usize) callconv(.c) bool,
    user: ?*anyopaque,
};

extern fn rl_exr_encode(
    memory: *const memory_account.Hooks,
    picture: *const LibraryPicture,
) enum(c_int) { done, exhausted, broken };

test "memory that runs out is an error, whenever it does" {
    const gpa = std.testing.allocator;
    const pixels: [9 * 40]f32 = @splat(0);
    for (0..200) |fail_index| {
        var failing: std.testing.FailingAllocator = .init(gpa, .{ .fail_index = fail_index });
        const file = encode(failing.allocator(), .{
            .width = 9,
            .height = 40,
            .channels = &.{
                .{ .name = "Y", .first = &pixels, .kind = .half },
                .{ .name = "id", .first = &pixels, .kind = .uint },
            },
            .attributes = &.{.{ .name = "raylane:manifest", .text = "{}" }},
        }) catch |err| {
            try std.testing.expectEqual(error.OutOfMemory, err);
            continue;
        };
        failing.allocator().free(file);
        try std.testing.expect(fail_index > 10);
        break;
    } else return error.NeverEnoughMemory;
}

test "a window of a picture, with its texts, whatever its place" {
    const gpa = std.testing.allocator;
    const values = [_]f32{ 0.1, 1e9, @bitCast(@as(u32, 4_000_000_000)), 0, 0, 0 };
    var lengths: [2]usize = undefined;
    for (&lengths, [_]u32{ 0, 5 }) |*length, x0| {
        const file = try encode(gpa, .{
            .width = 7,
            .height = 90,
            .window = .{ .x0 = x0, .y0 = 41, .x1 = x0 + 1, .y1 = 43 },
            .channels = &.{
                .{ .name = "Z", .first = values[0..].ptr, .stride = 3 },
                .{ .name = "node", .first = values[2..].ptr, .stride = 3, .kind = .uint },
            },
            .attributes = &.{.{ .name = "part", .text = "2/3" }},
        });
        defer gpa.free(file);
        const window = std.mem.find(u8, file, "dataWindow\x00box2i\x00").? + 17 + 4;
        const expected = [4]i32{ @intCast(x0), 41, @intCast(x0), 42 };
        const found = std.mem.bytesAsSlice(i32, file[window..][0..16]);
        for (expected, found) |wanted, number| try std.testing.expectEqual(wanted, number);
        const text = "part\x00string\x00\x03\x00\x00\x002/3";
        try std.testing.expect(std.mem.find(u8, file, text) != null);
        length.* = file.len;
    }
    try std.testing.expectEqual(lengths[0], lengths[1]);
}
