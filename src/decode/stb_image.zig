//! PNG, JPEG and Radiance HDR, by stb_image and libdeflate.
//!
//! In: a file. Out: its texels, in the channels that it has; 16 bits a channel come as 8. What the
//! library takes on trust is checked before: png.zig and jpeg.zig. By one thread: a JPEG of
//! 2048x2048 takes 30 to 110 ms on x86-64.

const std = @import("std");
const Allocator = std.mem.Allocator;
const diagnostic = @import("../diagnostic.zig");
const jpeg = @import("jpeg.zig");
const memory_account = @import("../memory_account.zig");
const png = @import("png.zig");
const texels = @import("texels.zig");
const assert = std.debug.assert;
const Info = texels.Info;
const Reason = texels.Reason;
const Texels = texels.Texels;
const invalid = texels.invalid;

/// In the order of stb_image.c.
pub const Codec = enum(c_int) { png, jpeg, hdr };

/// Where a Radiance HDR file starts with one of these.
pub const hdr_signatures = [_][]const u8{ "#?RADIANCE\n", "#?RGBE\n" };
/// A run of 127 values takes two bytes, in each of four channels.
const hdr_pixels_per_byte_max = 16;
/// What some files have behind their pixels.
const png_rest_bytes_max = 4096;

/// The header, with limits checked. The file is no longer than `texels.file_bytes_max`.
pub fn info(codec: Codec, file: []const u8, reason: *Reason) error{InvalidImage}!Info {
    switch (codec) {
        .png => {
            const header = try png.read(file, .header, reason);
            return .{
                .format = .png,
                .width = header.width,
                .height = header.height,
                .channel_count = header.channelCount(),
                .is_float = false,
            };
        },
        .jpeg => {
            const header = try jpeg.read(file, .header, reason);
            return .{
                .format = .jpeg,
                .width = header.width,
                .height = header.height,
                .channel_count = header.channelCount(),
                .is_float = false,
            };
        },
        .hdr => {
            const width, const height = try hdrSize(file, reason);
            return .{
                .format = .hdr,
                .width = width,
                .height = height,
                .channel_count = 3,
                .is_float = true,
            };
        },
    }
}

fn hdrSize(file: []const u8, reason: *Reason) error{InvalidImage}![2]u32 {
    var width: c_int = 0;
    var height: c_int = 0;
    var text: [*:0]const u8 = undefined;
    if (!rl_hdr_size(file.ptr, @intCast(file.len), &width, &height, &text))
        return invalid(reason, "{s}", .{text});
    const size = [2]u32{ @max(width, 0), @max(height, 0) };
    const most = hdr_pixels_per_byte_max * @as(u64, file.len);
    try texels.checkSize(size[0], size[1], most, reason);
    return size;
}

/// The texels of a file that `info` has passed; the caller frees them.
pub fn decode(
    gpa: Allocator,
    codec: Codec,
    file: []const u8,
    reason: *Reason,
) texels.Error!Texels {
    const expected = try info(codec, file, reason);
    var inflated_bytes_max: usize = 0;
    switch (codec) {
        .png => {
            const header = try png.read(file, .whole, reason);
            inflated_bytes_max = @intCast(header.rawBytes() + png_rest_bytes_max);
        },
        .jpeg => _ = try jpeg.read(file, .whole, reason),
        .hdr => {},
    }
    var heap: memory_account.LibraryHeap = .{ .gpa = gpa };
    defer heap.deinit();
    var pixels: Pixels = .{};
    var text: [*:0]const u8 = undefined;
    const hooks = heap.hooks();
    switch (rl_stb_decode(
        &hooks,
        codec,
        file.ptr,
        @intCast(file.len),
        inflated_bytes_max,
        &pixels,
        &text,
    )) {
        .done => {},
        .exhausted => return error.OutOfMemory,
        .broken => return invalid(reason, "{f}", .{diagnostic.printable(std.mem.span(text))}),
    }
    if (pixels.width != expected.width or pixels.height != expected.height or
        pixels.channels != expected.channel_count)
        return invalid(reason, "it contradicts itself", .{});
    const memory = heap.take(pixels.memory.?);
    return texelsOf(expected, pixels, memory);
}

/// The block's pixels as texels, 16 bits made 8 where they stand.
fn texelsOf(header: Info, pixels: Pixels, memory: []align(64) u8) Texels {
    const count = @as(usize, header.width) * header.height * header.channel_count;
    const start: [*]align(16) u8 = @ptrCast(@alignCast(pixels.memory.?));
    switch (pixels.bits) {
        8, 32 => {},
        16 => {
            const words: [*]align(16) const u16 = @ptrCast(start);
            for (start[0..count], words[0..count]) |*byte, word| byte.* = eightBits(word);
        },
        else => unreachable,
    }
    const floats: [*]f32 = @ptrCast(start);
    return .{
        .width = header.width,
        .height = header.height,
        .channel_count = header.channel_count,
        .data = if (header.is_float)
            .{ .floats = floats[0..count] }
        else
            .{ .bytes = start[0..count] },
        .memory = memory,
    };
}

/// The nearest of 256 steps.
fn eightBits(word: u16) u8 {
    return @intCast((@as(u32, word) * 255 + 32_895) >> 16);
}

const Pixels = extern struct {
    width: c_int = 0,
    height: c_int = 0,
    channels: c_int = 0,
    bits: c_int = 0,
    memory: ?*anyopaque = null,
};

extern fn rl_hdr_size(
    file: [*]const u8,
    file_bytes: c_int,
    width: *c_int,
    height: *c_int,
    reason: *[*:0]const u8,
) bool;

extern fn rl_stb_decode(
    memory: *const memory_account.Hooks,
    codec: Codec,
    file: [*]const u8,
    file_bytes: c_int,
    inflated_max: usize,
    pixels: *Pixels,
    reason: *[*:0]const u8,
) enum(c_int) { done, exhausted, broken };

test eightBits {
    for (0..65_536) |word| {
        const nearest = (word * 2 + 257) / 514;
        try std.testing.expectEqual(nearest, eightBits(@intCast(word)));
    }
}
