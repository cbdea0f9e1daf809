//! YUV4MPEG2, the uncompressed film of mjpegtools that encoders read from a pipe.
//!
//! In: sRGB bytes. Out: a header in front of the first frame, and frames of three planes, 4:4:4,
//! 8 bits. The format does not say by which matrix its colours are made; ITU-R BT.601 in its
//! limited range (Y 16 to 235, Cb and Cr 16 to 240) is what readers assume that are told no other.

const std = @import("std");
const settings = @import("../settings.zig");
const Allocator = std.mem.Allocator;
const assert = std.debug.assert;

/// Bytes of a header at most, and of the line before a frame.
pub const header_bytes_max = 128;

/// What stands before a frame; `is_first`: in a film, too.
pub fn header(
    buffer: *[header_bytes_max]u8,
    size: [2]u32,
    rate: settings.FrameRate,
    is_first: bool,
) []const u8 {
    if (!is_first) return "FRAME\n";
    // Four numbers of 10 digits and 70 bytes more fit.
    return std.mem.print(
        buffer,
        "YUV4MPEG2 W{d} H{d} F{d}:{d} Ip A1:1 C444 XCOLORRANGE=LIMITED\nFRAME\n",
        .{ size[0], size[1], rate.numerator, rate.denominator },
    ) catch unreachable;
}

/// Planes of Y, Cb and Cr, which the caller frees, of RGB bytes.
pub fn planes(gpa: Allocator, pixels: []const u8) error{OutOfMemory}![]u8 {
    assert(pixels.len % 3 == 0);
    const count = pixels.len / 3;
    const made = try gpa.alloc(u8, pixels.len);
    const luma = made[0..count];
    const blue = made[count..][0..count];
    const red = made[2 * count ..][0..count];
    for (std.mem.bytesAsSlice([3]u8, pixels), luma, blue, red) |rgb, *y, *cb, *cr| {
        y.* = weigh(.{ 16829, 33039, 6416 }, 16, rgb);
        cb.* = weigh(.{ -9714, -19070, 28784 }, 128, rgb);
        cr.* = weigh(.{ 28784, -24103, -4681 }, 128, rgb);
    }
    return made;
}

/// Sum by weights of 1/65536 (BT.601: 0.299, 0.587, 0.114 of 219 or 224 steps), rounded.
fn weigh(weights: [3]i32, offset: i32, rgb: [3]u8) u8 {
    var sum = (offset << 16) + (1 << 15);
    for (weights, rgb) |weight, value| sum += weight * value;
    return @intCast(sum >> 16);
}

test "colours of BT.601 in the limited range" {
    const gpa = std.testing.allocator;
    const pixels = [_][3]u8{
        .{ 0, 0, 0 },   .{ 255, 255, 255 }, .{ 255, 0, 0 },
        .{ 0, 255, 0 }, .{ 0, 0, 255 },     .{ 128, 128, 128 },
    };
    const made = try planes(gpa, @ptrCast(&pixels));
    defer gpa.free(made);
    try std.testing.expectEqualSlices(u8, &.{
        16,  235, 81,  145, 41,  126,
        128, 128, 90,  54,  240, 128,
        128, 128, 240, 34,  110, 128,
    }, made);
}

test header {
    var buffer: [header_bytes_max]u8 = undefined;
    const rate: settings.FrameRate = .{ .numerator = 30000, .denominator = 1001 };
    try std.testing.expectEqualStrings(
        "YUV4MPEG2 W64 H48 F30000:1001 Ip A1:1 C444 XCOLORRANGE=LIMITED\nFRAME\n",
        header(&buffer, .{ 64, 48 }, rate, true),
    );
    try std.testing.expectEqualStrings("FRAME\n", header(&buffer, .{ 64, 48 }, rate, false));
    const most = std.math.maxInt(u32);
    _ = header(&buffer, .{ most, most }, .{ .numerator = most, .denominator = most }, true);
}
