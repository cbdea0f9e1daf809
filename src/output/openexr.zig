//! OpenEXR of halves and floats, scan lines compressed by ZIP, by OpenEXRCore and libdeflate.
//!
//! In: rows from the top, of RGB or RGBA floats within the range of halves, and images of further
//! layers. Out: the file, the same bytes on every target. By one thread.

const std = @import("std");
const Allocator = std.mem.Allocator;
const Image = @import("../image.zig").Image;
const memory_account = @import("../memory_account.zig");
const settings = @import("../settings.zig");
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
    /// Of the same size, each layer once at most.
    further: []const Further = &.{},
};

/// What a file may hold besides the picture.
pub const Further = struct { layer: settings.Layer, image: *const Image };

/// Channels of a layer, the first ones of its image; albedos and normals are halves.
fn namesOf(layer: settings.Layer) []const [*:0]const u8 {
    return switch (layer) {
        .albedo => &.{ "albedo.R", "albedo.G", "albedo.B" },
        .normal => &.{ "N.X", "N.Y", "N.Z" },
        .depth => &.{"Z"},
        .variance => &.{ "variance.R", "variance.G", "variance.B" },
    };
}

/// A picture's, and all that layers may have.
const channel_count_max = 4 + 3 * std.enums.values(settings.Layer).len;

/// The file; the caller frees it.
pub fn encode(gpa: Allocator, picture: Picture) error{OutOfMemory}![]u8 {
    assert(picture.width <= width_max and picture.height <= std.math.maxInt(i32));
    assert(picture.channel_count == 3 or picture.channel_count == 4);
    var channels: [channel_count_max]Channel = undefined;
    const channel_count = place(&picture, &channels);
    var heap: memory_account.LibraryHeap = .{ .gpa = gpa };
    defer heap.deinit();
    var file: File = .{ .gpa = gpa };
    errdefer file.bytes.deinit(gpa);
    const hooks = heap.hooks();
    switch (rl_exr_encode(&hooks, &.{
        .width = @intCast(picture.width),
        .height = @intCast(picture.height),
        .channel_count = channel_count,
        .channels = &channels,
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

/// Fills in the channels. Returns how many they are.
fn place(picture: *const Picture, channels: *[channel_count_max]Channel) u8 {
    const pixels: [*]const f32 = @ptrCast(picture.pixels.ptr);
    const names = [_][*:0]const u8{ "R", "G", "B", "A" };
    for (names[0..picture.channel_count], channels[0..picture.channel_count], 0..) |name, *to, at| {
        to.* = .{
            .name = name,
            .first = pixels + at,
            .stride = picture.channel_count,
            .half = true,
        };
    }
    var count = picture.channel_count;
    for (picture.further) |*further| {
        const image = further.image;
        assert(image.width == picture.width and image.height == picture.height);
        for (namesOf(further.layer), 0..) |name, at| {
            channels[count] = .{
                .name = name,
                .first = @as([*]const f32, @ptrCast(image.pixels.ptr)) + at,
                .stride = 4,
                .half = further.layer == .albedo or further.layer == .normal,
            };
            count += 1;
        }
    }
    return count;
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
const Channel = extern struct {
    name: [*:0]const u8,
    first: [*]const f32,
    stride: c_int,
    half: bool,
};

/// In the order of openexr.c.
const LibraryPicture = extern struct {
    width: c_int,
    height: c_int,
    channel_count: c_int,
    channels: [*]const Channel,
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
