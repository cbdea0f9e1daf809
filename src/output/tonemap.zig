//! From linear radiance to bytes: exposure, clamping, the sRGB encoding.
//!
//! In: rows of premultiplied linear RGBA, finite. Out: rows of RGB (over black) or RGBA bytes
//! (not premultiplied), or of the floats themselves. A multiplication and an exact encoding: the
//! same bytes on every target.

const std = @import("std");
const Allocator = std.mem.Allocator;
const Image = @import("../image.zig").Image;
const math = @import("../math.zig");
const settings = @import("../settings.zig");
const assert = std.debug.assert;

const auto = settings.auto_exposure;

/// The factor of an exposure in stops, 2^ev. Asserts that it is within f32's normal range.
pub fn scaleOf(ev: f32) f32 {
    assert(@abs(ev) <= 100);
    return @floatCast(math.elementary.pow(2, ev));
}

/// The factor that brings the 95th percentile of luminance to 0.8: the least luminance that 95 % of
/// the pixels do not exceed. Pixels of alpha 0 do not count; 1 where nothing is left or all is
/// black.
pub fn autoScale(gpa: Allocator, image: *const Image) error{OutOfMemory}!f32 {
    const counts = try gpa.alloc(u32, 1 << 16);
    defer gpa.free(counts);
    // Floats >= 0 are ordered as their bits are: select the upper half first, the lower within it.
    @memset(counts, 0);
    var pixel_count: u64 = 0;
    for (image.pixels) |pixel| {
        if (pixel[3] == 0) continue;
        counts[luminanceBits(pixel) >> 16] += 1;
        pixel_count += 1;
    }
    if (pixel_count == 0) return 1;
    const rank = (pixel_count * auto.percentile + 99) / 100 - 1;
    const upper = select(counts, rank);
    @memset(counts, 0);
    for (image.pixels) |pixel| {
        const bits = luminanceBits(pixel);
        if (pixel[3] != 0 and bits >> 16 == upper.index) counts[bits & 0xffff] += 1;
    }
    const lower = select(counts, upper.rank);
    const luminance: f32 = @bitCast(upper.index << 16 | lower.index);
    if (luminance < std.math.floatMin(f32)) return 1;
    const scale = auto.brightness / luminance;
    return if (scale < std.math.floatMin(f32)) std.math.floatMin(f32) else scale;
}

/// The bin that holds the element of this rank, and its rank within the bin.
fn select(counts: []const u32, rank: u64) struct { index: u32, rank: u64 } {
    var rest = rank;
    for (counts, 0..) |count, index| {
        if (rest < count) return .{ .index = @intCast(index), .rank = rest };
        rest -= count;
    }
    unreachable; // The rank is below the number of elements.
}

/// Bits of the luminance of Rec. 709 primaries, 0 where it is not above 0.
fn luminanceBits(pixel: [4]f32) u32 {
    const luminance = (0.2126 * pixel[0] + 0.7152 * pixel[1]) + 0.0722 * pixel[2];
    return if (luminance > 0) @bitCast(luminance) else 0;
}

/// What a row becomes.
pub const Form = enum {
    /// sRGB bytes, over black.
    rgb,
    /// With alpha, not premultiplied.
    rgba,
    /// Floats as they are, over black.
    linear,
    /// Floats that a pixel of Radiance HDR can hold: none below 0, none that has no exponent there.
    radiance,
};

/// The frame as rows of bytes.
pub const Rows = struct {
    image: *const Image,
    /// Exposure, of sRGB bytes.
    scale: f32,
    form: Form,

    /// Bytes of a row.
    pub fn byteCount(rows: Rows) usize {
        return @as(usize, rows.image.width) * bytesOf(rows.form);
    }

    /// Encodes row y. Asserts that `bytes` has the length of one.
    pub fn encode(rows: Rows, y: u32, bytes: []u8) void {
        assert(y < rows.image.height and bytes.len == rows.byteCount());
        const row = rows.image.pixels[@as(usize, y) * rows.image.width ..][0..rows.image.width];
        switch (rows.form) {
            .rgb => encodeRgb(row, rows.scale, std.mem.bytesAsSlice([3]u8, bytes)),
            .rgba => encodeRgba(row, rows.scale, std.mem.bytesAsSlice([4]u8, bytes)),
            .linear => for (row, std.mem.bytesAsSlice([3]f32, bytes)) |pixel, *out| {
                out.* = pixel[0..3].*;
            },
            .radiance => for (row, std.mem.bytesAsSlice([3]f32, bytes)) |pixel, *out| {
                for (out, pixel[0..3]) |*held, value| {
                    held.* = if (value > 0) @min(value, radiance_max) else 0;
                }
            },
        }
    }
};

/// Bytes of a pixel.
pub fn bytesOf(form: Form) u8 {
    return switch (form) {
        .rgb => 3,
        .rgba => 4,
        .linear, .radiance => @sizeOf([3]f32),
    };
}

/// The largest mantissa and exponent of RGBE.
const radiance_max: f32 = 0x1.fep126;

const Pixel = @Vector(4, f32);

/// One row over black. Asserts that both rows have the same length.
fn encodeRgb(row: []const [4]f32, scale: f32, bytes: [][3]u8) void {
    assert(row.len == bytes.len);
    for (row, bytes) |pixel, *out| {
        out.* = math.srgb.encodeLanes(4, pixel * @as(Pixel, @splat(scale)))[0..3].*;
    }
}

/// One row with alpha: colours are divided by it before they are encoded, alpha itself is linear.
/// Asserts that both rows have the same length.
fn encodeRgba(row: []const [4]f32, scale: f32, bytes: [][4]u8) void {
    assert(row.len == bytes.len);
    for (row, bytes) |pixel, *out| {
        const alpha = alphaCode(pixel[3]);
        if (alpha == 0) {
            out.* = @splat(0);
            continue;
        }
        const color = pixel / @as(Pixel, @splat(pixel[3]));
        out.* = math.srgb.encodeLanes(4, color * @as(Pixel, @splat(scale)));
        out[3] = alpha;
    }
}

/// The nearest of 256 codes; in f64 the product is exact.
fn alphaCode(alpha: f32) u8 {
    assert(!std.math.isNan(alpha));
    if (!(alpha > 0)) return 0;
    if (alpha >= 1) return 255;
    return @intFromFloat(@as(f64, alpha) * 255 + 0.5);
}

/// A picture of one row of grays with alpha 1.
fn grayImage(gpa: Allocator, values: []const f32) !Image {
    const image: Image = try .init(gpa, @intCast(values.len), 1);
    for (image.pixels, values) |*pixel, value| pixel.* = .{ value, value, value, 1 };
    return image;
}

fn autoScaleOf(values: []const f32) !f32 {
    var image = try grayImage(std.testing.allocator, values);
    defer image.deinit(std.testing.allocator);
    return autoScale(std.testing.allocator, &image);
}

test "an exposure is a power of two" {
    try std.testing.expectEqual(1, scaleOf(0));
    try std.testing.expectApproxEqRel(8, scaleOf(3), 1e-6);
    try std.testing.expectApproxEqRel(0.25, scaleOf(-2), 1e-6);
    try std.testing.expectApproxEqRel(std.math.sqrt2, scaleOf(0.5), 1e-6);
    try std.testing.expect(scaleOf(64) < std.math.inf(f32) and scaleOf(-64) > 0);
}

test "the automatic exposure is exact about its percentile" {
    var random = std.Random.DefaultPrng.init(3);
    for ([_]usize{ 1, 2, 19, 20, 21, 100, 1999 }) |count| {
        var values: [2000]f32 = undefined;
        // Neighbours in the upper bits, so that both halves of the selection matter.
        for (values[0..count]) |*value| value.* = 1 + random.random().float(f32) * 0x1p-10;
        const scale = try autoScaleOf(values[0..count]);
        std.mem.sort(f32, values[0..count], {}, std.sort.asc(f32));
        const expected = values[(count * 95 + 99) / 100 - 1];
        const gray: [4]f32 = .{ expected, expected, expected, 1 };
        try std.testing.expectEqual(0.8 / @as(f32, @bitCast(luminanceBits(gray))), scale);
    }
}

test "the automatic exposure at the edges" {
    try std.testing.expectEqual(1, try autoScaleOf(&.{0}));
    try std.testing.expectEqual(1, try autoScaleOf(&.{ -1, 0, -0.0 }));
    const zeros: [95]f32 = @splat(0);
    try std.testing.expectEqual(1, try autoScaleOf(&(zeros ++ [_]f32{ 9, 9, 9, 9, 9 })));
    try std.testing.expect(try autoScaleOf(&.{std.math.floatMax(f32)}) > 0);
    try std.testing.expect(try autoScaleOf(&.{std.math.floatMin(f32)}) < std.math.inf(f32));

    const gpa = std.testing.allocator;
    var image = try grayImage(gpa, &.{ 1, 1, 5 });
    defer image.deinit(gpa);
    image.pixels[2] = .{ 0, 0, 0, 0 };
    const two = try autoScale(gpa, &image);
    try std.testing.expectEqual(try autoScaleOf(&.{ 1, 1 }), two);
    image.pixels[0][3] = 0;
    image.pixels[1][3] = 0;
    try std.testing.expectEqual(1, try autoScale(gpa, &image));
}

test encodeRgb {
    const row = [_][4]f32{
        .{ 0, 0.5, 1, 1 },
        .{ 0.25, 2, -1, 0.5 },
        .{ std.math.floatMax(f32), std.math.floatTrueMin(f32), 0.0031308, 0 },
    };
    var bytes: [3][3]u8 = undefined;
    encodeRgb(&row, 1, &bytes);
    try std.testing.expectEqual([3]u8{ 0, 188, 255 }, bytes[0]);
    try std.testing.expectEqual([3]u8{ 137, 255, 0 }, bytes[1]);
    try std.testing.expectEqual([3]u8{ 255, 0, 10 }, bytes[2]);
    encodeRgb(&row, 2, &bytes);
    try std.testing.expectEqual([3]u8{ 0, 255, 255 }, bytes[0]);
    try std.testing.expectEqual([3]u8{ 188, 255, 0 }, bytes[1]);
    // Too bright for a float after exposure: white, not a wrapped number.
    try std.testing.expectEqual(255, bytes[2][0]);
    encodeRgb(&.{}, 1, &.{});
}

test encodeRgba {
    const row = [_][4]f32{
        .{ 0.25, 0.5, 0, 0.5 }, // 0.5, 1 and 0 before it was premultiplied.
        .{ 0, 0, 0, 0 },
        .{ 1, 1, 1, 1 },
        .{ 0.5, 0.5, 0.5, 0.001 }, // Nearer to code 0: nothing is left of it.
        .{ 0.001, 0, 0, 0.002 },
        .{ 1, 1, 1, 2 },
    };
    var bytes: [6][4]u8 = undefined;
    encodeRgba(&row, 1, &bytes);
    try std.testing.expectEqual([4]u8{ 188, 255, 0, 128 }, bytes[0]);
    try std.testing.expectEqual([4]u8{ 0, 0, 0, 0 }, bytes[1]);
    try std.testing.expectEqual([4]u8{ 255, 255, 255, 255 }, bytes[2]);
    try std.testing.expectEqual([4]u8{ 0, 0, 0, 0 }, bytes[3]);
    try std.testing.expectEqual([4]u8{ 188, 0, 0, 1 }, bytes[4]);
    try std.testing.expectEqual(255, bytes[5][3]);
}

test "alpha is rounded to the nearest code" {
    for (0..256) |code| {
        const exact = @as(f32, @floatFromInt(code)) / 255;
        try std.testing.expectEqual(code, alphaCode(exact));
    }
    for (0..255) |code| {
        const half: f32 = @floatCast((@as(f64, @floatFromInt(code)) + 0.5) / 255);
        try std.testing.expectEqual(code, alphaCode(half - half * 0x1p-22));
        try std.testing.expectEqual(code + 1, alphaCode(half + half * 0x1p-22));
    }
}
