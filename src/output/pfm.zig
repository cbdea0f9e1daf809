//! PFM, Netpbm's relative for floats: linear RGB of 32 bits, no alpha, rows from the bottom.
//!
//! In: the frame, before exposure. Out: the bytes of the file. Its identity, bit for bit: what
//! other programs need to compare or to grade the picture.

const std = @import("std");
const Allocator = std.mem.Allocator;
const Image = @import("../image.zig").Image;
const assert = std.debug.assert;

/// The whole file; the caller frees it.
pub fn encode(gpa: Allocator, image: *const Image) error{OutOfMemory}![]u8 {
    comptime assert(@import("builtin").cpu.arch.endian() == .little);
    var header_buffer: [48]u8 = undefined;
    var header: std.Io.Writer = .fixed(&header_buffer);
    // A negative scale says little-endian.
    header.print("PF\n{d} {d}\n-1.0\n", .{ image.width, image.height }) catch unreachable;

    const row_bytes = std.math.mul(usize, image.width, 12) catch return error.OutOfMemory;
    const pixel_bytes = std.math.mul(usize, row_bytes, image.height) catch return error.OutOfMemory;
    const file = try gpa.alloc(u8, std.math.add(usize, header.end, pixel_bytes) catch
        return error.OutOfMemory);
    @memcpy(file[0..header.end], header.buffered());
    var rest = file[header.end..];
    var y = image.height;
    while (y > 0) {
        y -= 1;
        const row = image.pixels[@as(usize, y) * image.width ..][0..image.width];
        for (row) |pixel| {
            rest[0..12].* = @bitCast(pixel[0..3].*);
            rest = rest[12..];
        }
    }
    assert(rest.len == 0);
    return file;
}

test encode {
    const gpa = std.testing.allocator;
    var image: Image = try .init(gpa, 2, 3);
    defer image.deinit(gpa);
    for (image.pixels, 0..) |*pixel, index| {
        const value: f32 = @floatFromInt(index);
        pixel.* = .{ value, -value, value * 1e30, 0.25 };
    }
    image.pixels[0][0] = std.math.floatTrueMin(f32);
    const file = try encode(gpa, &image);
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
