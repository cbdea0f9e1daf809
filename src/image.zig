//! Data 3: the picture as linear light, four floats a pixel.
//!
//! `trace` writes it by tile, `output` reads it. Rows run from the top, pixels from the left; red,
//! green and blue are premultiplied with alpha, in radiance, and always finite.

const std = @import("std");
const huge_pages = @import("huge_pages.zig");
const assert = std.debug.assert;

/// A frame of linear RGBA.
pub const Image = struct {
    width: u32,
    height: u32,
    /// width * height, row by row.
    pixels: []align(64) [4]f32,

    /// Asserts that both sides are at least 1. The pixels are undefined.
    pub fn init(gpa: std.mem.Allocator, width: u32, height: u32) error{OutOfMemory}!Image {
        assert(width >= 1 and height >= 1);
        const count = std.math.mul(usize, width, height) catch return error.OutOfMemory;
        return .{
            .width = width,
            .height = height,
            .pixels = try huge_pages.alloc(gpa, [4]f32, count),
        };
    }

    /// Frees the pixels.
    pub fn deinit(image: *Image, gpa: std.mem.Allocator) void {
        huge_pages.free(gpa, image.pixels);
        image.* = undefined;
    }

    /// The pixel in column x from the left and row y from the top.
    pub inline fn at(image: *const Image, x: u32, y: u32) *[4]f32 {
        assert(x < image.width and y < image.height);
        return &image.pixels[@as(usize, y) * image.width + x];
    }

    /// XXH64 (seed 0) of the little-endian floats: the identity of a picture.
    pub fn hash(image: *const Image) u64 {
        comptime assert(@import("builtin").cpu.arch.endian() == .little);
        return std.hash.XxHash64.hash(0, std.mem.sliceAsBytes(image.pixels));
    }
};

test "the hash sees every pixel" {
    var image: Image = try .init(std.testing.allocator, 3, 2);
    defer image.deinit(std.testing.allocator);
    @memset(image.pixels, .{ 0, 0, 0, 1 });
    const before = image.hash();
    image.at(2, 1)[3] = 0.5;
    try std.testing.expect(before != image.hash());
    image.at(2, 1)[3] = 1;
    try std.testing.expectEqual(before, image.hash());
    // Published XXH64 of no bytes.
    try std.testing.expectEqual(0xef46db3751d8e999, std.hash.XxHash64.hash(0, ""));
}

test "a size that no memory holds is an error, not an overflow" {
    const huge = std.math.maxInt(u32);
    if (@sizeOf(usize) == 4) {
        const image = Image.init(std.testing.allocator, huge, huge);
        try std.testing.expectError(error.OutOfMemory, image);
    }
}
