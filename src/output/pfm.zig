//! PFM, Netpbm's relative for floats: linear RGB of 32 bits, no alpha, rows from the bottom.
//!
//! In: the frame, before exposure. Out: the parts of the file, its rows written by any number of
//! threads. Its identity, bit for bit: what other programs need to compare or to grade the picture.

const std = @import("std");
const Allocator = std.mem.Allocator;
const Image = @import("../image.zig").Image;
const Rows = @import("tonemap.zig").Rows;
const assert = std.debug.assert;

/// A file in the making; see the one of `png.zig`. A stretch is a row.
pub const Encoder = struct {
    image: *const Image,
    stretch_count: usize,
    pixels: [][3]f32,
    header_buffer: [48]u8,
    parts: [2][]const u8,

    /// Takes the memory. The exposure of the rows does not matter.
    pub fn init(gpa: Allocator, rows: Rows, thread_count: usize) error{OutOfMemory}!Encoder {
        comptime assert(@import("builtin").cpu.arch.endian() == .little);
        assert(thread_count >= 1);
        return .{
            .image = rows.image,
            .stretch_count = rows.image.height,
            .pixels = try gpa.alloc([3]f32, rows.image.pixels.len),
            .header_buffer = undefined,
            .parts = undefined,
        };
    }

    /// Frees everything.
    pub fn deinit(encoder: *Encoder, gpa: Allocator) void {
        gpa.free(encoder.pixels);
        encoder.* = undefined;
    }

    /// Copies one row to its place.
    pub fn encodeStretch(encoder: *Encoder, stretch_index: usize, thread_index: usize) void {
        _ = thread_index;
        const width = encoder.image.width;
        const y = encoder.stretch_count - 1 - stretch_index;
        const row = encoder.image.pixels[y * width ..][0..width];
        for (row, encoder.pixels[stretch_index * width ..][0..width]) |pixel, *out| {
            out.* = pixel[0..3].*;
        }
    }

    /// The parts of the file, when all rows are done. They are the encoder's.
    pub fn finish(encoder: *Encoder) []const []const u8 {
        // A negative scale says little-endian.
        const header = std.mem.print(&encoder.header_buffer, "PF\n{d} {d}\n-1.0\n", .{
            encoder.image.width, encoder.image.height,
        }) catch unreachable; // Two numbers of 10 digits and 10 bytes more.
        encoder.parts = .{ header, std.mem.sliceAsBytes(encoder.pixels) };
        return &encoder.parts;
    }
};

test Encoder {
    const gpa = std.testing.allocator;
    var image: Image = try .init(gpa, 2, 3);
    defer image.deinit(gpa);
    for (image.pixels, 0..) |*pixel, index| {
        const value: f32 = @floatFromInt(index);
        pixel.* = .{ value, -value, value * 1e30, 0.25 };
    }
    image.pixels[0][0] = std.math.floatTrueMin(f32);
    var encoder: Encoder = try .init(gpa, .{ .image = &image, .scale = 2, .channel_count = 3 }, 1);
    defer encoder.deinit(gpa);
    for (0..encoder.stretch_count) |index| encoder.encodeStretch(index, 0);
    const file = try std.mem.concat(gpa, u8, encoder.finish());
    defer gpa.free(file);
    const header = "PF\n2 3\n-1.0\n";
    try std.testing.expectStringStartsWith(file, header);
    try std.testing.expectEqual(header.len + 2 * 3 * 3 * 4, file.len);
    // Rows from the bottom; bits as they are.
    for ([_]usize{ 4, 5, 2, 3, 0, 1 }, 0..) |pixel, place| {
        for (0..3) |channel| {
            const at = header.len + (place * 3 + channel) * 4;
            const bits: u32 = @bitCast(image.pixels[pixel][channel]);
            try std.testing.expectEqual(bits, std.mem.readInt(u32, file[at..][0..4], .little));
        }
    }
}
