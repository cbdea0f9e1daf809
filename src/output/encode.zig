//! From a picture to rows of bytes: exposure, tone mapping, what is behind, the sRGB encoding.
//!
//! In: rows of premultiplied linear RGBA, finite, and of colours of the display. Out: rows of RGB
//! bytes, of RGBA bytes (not premultiplied), or of floats. Radiance is divided by the share of the
//! pixel that it comes from before it is mapped, so that edges of what is bright are smooth.
//! Several pixels at a time, + - * / and an exact encoding: the same bytes on every target.

const std = @import("std");
const Background = @import("background.zig").Background;
const Image = @import("../image.zig").Image;
const settings = @import("../settings.zig");
const srgb = @import("../math.zig").srgb;
const tonemap = @import("tonemap.zig");
const assert = std.debug.assert;

/// What a row becomes.
pub const Form = enum {
    /// sRGB bytes, over the background.
    rgb,
    /// With alpha, not premultiplied.
    rgba,
    /// Floats as they are, over the background.
    linear,
    /// Floats as they are, multiplied by alpha, and alpha.
    linear_alpha,
    /// Floats that a pixel of Radiance HDR can hold: none below 0, none that has no exponent there.
    radiance,
    /// Floats that a half can hold, over the background.
    half,
    /// Floats that a half can hold, multiplied by alpha, and alpha.
    half_alpha,

    /// Bytes of a pixel.
    pub fn pixelBytes(form: Form) u8 {
        return switch (form) {
            .rgb => 3,
            .rgba => 4,
            .linear, .radiance, .half => @sizeOf([3]f32),
            .half_alpha, .linear_alpha => @sizeOf([4]f32),
        };
    }
};

/// The largest mantissa and exponent of RGBE.
const radiance_max: f32 = 0x1.fep126;
const half_max = @import("openexr.zig").value_max;

/// A finished picture.
pub const Picture = struct {
    image: *const Image,
    /// Colours of the display and their shares of the pixels, of the same size.
    display: ?*const Image = null,
};

/// How many pixels look like nothing.
pub const Tally = struct {
    /// At least half of it shows the background.
    clear: u32 = 0,
    /// Nothing of it does; among these, near the ends of what a display can show.
    covered: u32 = 0,
    black: u32 = 0,
    white: u32 = 0,

    /// Display-referred light of `black` at most: code 6.
    const black_max = 0.0018;
    /// And of `white` at least, in all channels: code 252.
    const white_min = 0.97;

    /// Adds another's.
    fn add(tally: *Tally, other: Tally) void {
        inline for (comptime std.meta.fieldNames(Tally)) |name| {
            @field(tally, name) += @field(other, name);
        }
    }
};

/// Rows of a picture, from `first` on, that has `of`.
pub const Extent = struct { first: u32, of: u32 };

/// The picture as rows of bytes.
pub const Rows = struct {
    picture: Picture,
    form: Form,
    /// Exposure, of sRGB bytes.
    scale: f32 = 1,
    tone_mapping: settings.ToneMapping = .linear,
    background: Background = .none,
    extent: Extent,

    /// Bytes of a row.
    pub fn byteCount(rows: *const Rows) usize {
        return @as(usize, rows.picture.image.width) * rows.form.pixelBytes();
    }

    /// Encodes row y. Asserts that `bytes` has the length of one.
    pub fn encode(rows: *const Rows, y: u32, bytes: []u8) Tally {
        const image = rows.picture.image;
        assert(y < image.height and bytes.len == rows.byteCount());
        const start = @as(usize, y) * image.width;
        const row: Row = .{
            .lit = image.pixels[start..][0..image.width],
            .display = if (rows.picture.display) |display|
                display.pixels[start..][0..image.width]
            else
                null,
            .behind = rows.background.at(rows.extent.first + y, rows.extent.of),
            .scale = rows.scale,
        };
        switch (rows.tone_mapping) {
            inline else => |mapping| switch (rows.form) {
                .rgb => return row.encode(mapping, 3, std.mem.bytesAsSlice([3]u8, bytes)),
                .rgba => return row.encode(mapping, 4, std.mem.bytesAsSlice([4]u8, bytes)),
                .linear, .linear_alpha, .radiance, .half, .half_alpha => {},
            },
        }
        if (rows.form == .half_alpha or rows.form == .linear_alpha)
            row.copy(4, std.mem.bytesAsSlice([4]f32, bytes))
        else
            row.copy(3, std.mem.bytesAsSlice([3]f32, bytes));
        for (std.mem.bytesAsSlice(f32, bytes)) |*value| value.* = switch (rows.form) {
            .radiance => if (value.* > 0) @min(value.*, radiance_max) else 0,
            .half, .half_alpha => std.math.clamp(value.*, -half_max, half_max),
            else => break,
        };
        return .{};
    }
};

/// Pixels at a time.
const lanes = 8;
const V = @Vector(lanes, f32);
const Mask = @Vector(lanes, bool);

/// Pixels in lanes: channels, then alpha.
const Pixels = [4]V;

/// Those of a row from x on; clear ones beyond its end.
inline fn load(row: []const [4]f32, x: usize) Pixels {
    var some: [lanes][4]f32 = undefined;
    if (row.len - x >= lanes) {
        some = row[x..][0..lanes].*;
    } else {
        some = @splat(@splat(0));
        @memcpy(some[0 .. row.len - x], row[x..]);
    }
    return std.simd.deinterlace(4, @as(@Vector(4 * lanes, f32), @bitCast(some)));
}

const Row = struct {
    lit: []const [4]f32,
    display: ?[]const [4]f32,
    behind: [3]f32,
    scale: f32,

    /// With alpha where bytes have 4 channels, else over what is behind.
    fn encode(
        row: Row,
        comptime mapping: settings.ToneMapping,
        comptime channel_count: usize,
        bytes: [][channel_count]u8,
    ) Tally {
        const has_alpha = channel_count == 4;
        var tally: Tally = .{};
        var x: usize = 0;
        while (x < bytes.len) : (x += lanes) {
            const lit = load(row.lit, x);
            const display: ?Pixels = if (row.display) |other| load(other, x) else null;
            const color = row.compose(mapping, has_alpha, lit, display);
            const count = @min(lanes, bytes.len - x);
            tally.add(tallyOf(color, lit[3], count));
            var codes: [channel_count][lanes]u8 = undefined;
            inline for (codes[0..3], color) |*to, from| to.* = srgb.encodeLanes(lanes, from);
            if (has_alpha) codes[3] = alphaCodes(lit[3]);
            for (bytes[x..][0..count], 0..) |*out, lane| {
                inline for (out, &codes) |*to, *from| to.* = from[lane];
            }
            if (has_alpha) for (bytes[x..][0..count]) |*out| if (out[3] == 0) {
                out.* = @splat(0);
            };
        }
        return tally;
    }

    /// Light of the display: the whole pixel's, or that of the part that is covered.
    inline fn compose(
        row: Row,
        comptime mapping: settings.ToneMapping,
        comptime of_cover: bool,
        lit: Pixels,
        display: ?Pixels,
    ) [3]V {
        const none: V = @splat(0);
        const alpha = lit[3];
        const share = if (display) |own| alpha - own[3] else alpha;
        const is_lit = share > @as(V, @splat(share_min));
        const divisor = @select(f32, is_lit, share, @as(V, @splat(1)));
        var exposed: [3]V = undefined;
        inline for (&exposed, lit[0..3]) |*to, from| {
            to.* = @select(f32, is_lit, from / divisor, none) * @as(V, @splat(row.scale));
        }
        var color = tonemap.map(mapping, lanes, exposed);
        if (of_cover and display == null) return color;
        const weight = @select(f32, is_lit, share, none);
        inline for (&color, row.behind, 0..) |*to, behind, channel| {
            to.* *= weight;
            if (display) |own| to.* += own[channel];
            to.* = if (of_cover)
                to.* / @select(f32, alpha > none, alpha, @as(V, @splat(1)))
            else
                to.* + (@as(V, @splat(1)) - alpha) * @as(V, @splat(behind));
        }
        return color;
    }

    /// Radiance as it is, with all else as if it were radiance.
    fn copy(row: Row, comptime channel_count: usize, floats: []align(1) [channel_count]f32) void {
        for (row.lit, floats, 0..) |pixel, *out, x| {
            out.* = pixel[0..channel_count].*;
            if (row.display) |display| for (out[0..3], display[x][0..3]) |*value, own| {
                value.* += own;
            };
            if (channel_count == 3 and pixel[3] < 1) for (out, row.behind) |*value, behind| {
                if (behind > 0) value.* += (1 - pixel[3]) * behind;
            };
        }
    }
};

/// Shares of a pixel below this are rounding, and nothing is seen of them.
const share_min = 1e-6;

/// Counts the first lanes.
inline fn tallyOf(color: [3]V, alpha: V, count: usize) Tally {
    const counted = std.simd.iota(u32, lanes) < @as(@Vector(lanes, u32), @splat(@intCast(count)));
    const clear = counted & (alpha < @as(V, @splat(0.5)));
    const covered = counted & (alpha > @as(V, @splat(1 - 1.0 / 512.0)));
    var black = covered;
    var white = covered;
    inline for (color) |channel| {
        black &= channel < @as(V, @splat(Tally.black_max));
        white &= channel > @as(V, @splat(Tally.white_min));
    }
    return .{
        .clear = countOf(clear),
        .covered = countOf(covered),
        .black = countOf(black),
        .white = countOf(white),
    };
}

inline fn countOf(mask: Mask) u32 {
    return std.simd.countTrues(mask);
}

/// The nearest of 256 codes of alpha, 0..1.
fn alphaCodes(alpha: V) [lanes]u8 {
    var codes: [lanes]u8 = undefined;
    const values: [lanes]f32 = alpha;
    for (&codes, values) |*code, value| code.* = alphaCode(value);
    return codes;
}

/// The nearest of 256 codes; in f64 the product is exact.
fn alphaCode(alpha: f32) u8 {
    assert(!std.math.isNan(alpha));
    if (!(alpha > 0)) return 0;
    if (alpha >= 1) return 255;
    return @intFromFloat(@as(f64, alpha) * 255 + 0.5);
}

/// Encodes pixels by hand, as a picture of one row.
fn encodeForTest(
    comptime channel_count: usize,
    pixels: []const [4]f32,
    display: ?[]const [4]f32,
    rows: Rows,
    bytes: [][channel_count]u8,
) !Tally {
    const gpa = std.testing.allocator;
    var image: Image = try .init(gpa, @intCast(pixels.len), 1);
    defer image.deinit(gpa);
    @memcpy(image.pixels, pixels);
    var other: Image = try .init(gpa, @intCast(pixels.len), 1);
    defer other.deinit(gpa);
    if (display) |colors| @memcpy(other.pixels, colors);
    var all = rows;
    all.form = if (channel_count == 4) .rgba else .rgb;
    all.picture = .{ .image = &image, .display = if (display == null) null else &other };
    return all.encode(0, std.mem.sliceAsBytes(bytes));
}

const rows_for_test: Rows = .{
    .picture = undefined,
    .form = .rgb,
    .extent = .{ .first = 0, .of = 1 },
};

test "linear light over black, however many pixels a row has" {
    const some = [_][4]f32{
        .{ 0, 0.5, 1, 1 },
        .{ 0.25, 2, -1, 1 },
        .{ std.math.floatMax(f32), std.math.floatTrueMin(f32), 0.0031308, 1 },
    };
    const expected = [_][3]u8{ .{ 0, 188, 255 }, .{ 137, 255, 0 }, .{ 255, 0, 10 } };
    for (1..20) |count| {
        var pixels: [20][4]f32 = undefined;
        for (&pixels, 0..) |*pixel, index| pixel.* = some[index % 3];
        var bytes: [20][3]u8 = undefined;
        _ = try encodeForTest(3, pixels[0..count], null, rows_for_test, bytes[0..count]);
        for (bytes[0..count], 0..) |codes, index| {
            try std.testing.expectEqual(expected[index % 3], codes);
        }
    }
    var brighter = rows_for_test;
    brighter.scale = 2;
    var bytes: [3][3]u8 = undefined;
    _ = try encodeForTest(3, &some, null, brighter, &bytes);
    try std.testing.expectEqual([3]u8{ 0, 255, 255 }, bytes[0]);
    try std.testing.expectEqual([3]u8{ 188, 255, 0 }, bytes[1]);
    // Too bright for a float after exposure: white, not a wrapped number.
    try std.testing.expectEqual(255, bytes[2][0]);
}

test "colours with alpha are not premultiplied" {
    const row = [_][4]f32{
        .{ 0.25, 0.5, 0, 0.5 }, // 0.5, 1 and 0 before it was premultiplied.
        .{ 0, 0, 0, 0 },
        .{ 1, 1, 1, 1 },
        .{ 0.5, 0.5, 0.5, 0.001 }, // Nearer to code 0: nothing is left of it.
        .{ 0.001, 0, 0, 0.002 },
        .{ 1, 1, 1, 2 },
    };
    var bytes: [6][4]u8 = undefined;
    _ = try encodeForTest(4, &row, null, rows_for_test, &bytes);
    try std.testing.expectEqual([4]u8{ 188, 255, 0, 128 }, bytes[0]);
    try std.testing.expectEqual([4]u8{ 0, 0, 0, 0 }, bytes[1]);
    try std.testing.expectEqual([4]u8{ 255, 255, 255, 255 }, bytes[2]);
    try std.testing.expectEqual([4]u8{ 0, 0, 0, 0 }, bytes[3]);
    try std.testing.expectEqual([4]u8{ 188, 0, 0, 1 }, bytes[4]);
    try std.testing.expectEqual(255, bytes[5][3]);
}

test "colours of the display and the background come out as they are, by any curve" {
    const codes = [3]u8{ 200, 100, 7 };
    const color = [4]f32{ srgb.decoded[200], srgb.decoded[100], srgb.decoded[7], 1 };
    inline for (comptime std.enums.values(settings.ToneMapping)) |mapping| {
        var rows = rows_for_test;
        rows.tone_mapping = mapping;
        rows.scale = 5;
        rows.background = .{ .srgb = codes };
        const lit = [_][4]f32{ .{ 0, 0, 0, 0 }, .{ 0, 0, 0, 1 } };
        const display = [_][4]f32{ .{ 0, 0, 0, 0 }, color };
        var bytes: [2][3]u8 = undefined;
        _ = try encodeForTest(3, &lit, &display, rows, &bytes);
        try std.testing.expectEqual(codes, bytes[0]);
        try std.testing.expectEqual(codes, bytes[1]);
        var with_alpha: [2][4]u8 = undefined;
        _ = try encodeForTest(4, &lit, &display, rows, &with_alpha);
        try std.testing.expectEqual([4]u8{ 0, 0, 0, 0 }, with_alpha[0]);
        try std.testing.expectEqual(codes ++ .{255}, with_alpha[1]);
    }
}

test "what covers half of a pixel is mapped before it is mixed" {
    var rows = rows_for_test;
    rows.background = .{ .srgb = .{ 255, 0, 0 } };
    // 8 where it is, which is white: half of it and half of red.
    const lit = [_][4]f32{.{ 4, 4, 4, 0.5 }};
    var bytes: [1][3]u8 = undefined;
    _ = try encodeForTest(3, &lit, null, rows, &bytes);
    try std.testing.expectEqual([3]u8{ 255, 188, 188 }, bytes[0]);
    // A quarter is lit, a quarter is the display's, half is red.
    const display = [_][4]f32{.{ 0, 0, 0.25, 0.25 }};
    _ = try encodeForTest(3, &lit, &display, rows, &bytes);
    try std.testing.expectEqual([3]u8{
        srgb.encode(0.75), srgb.encode(0.25), srgb.encode(0.5),
    }, bytes[0]);
}

test "pixels that look like nothing are counted" {
    var pixels: [11][4]f32 = @splat(.{ 0.25, 0.25, 0.25, 1 });
    pixels[0] = .{ 0, 0, 0, 0 };
    pixels[1] = .{ 9, 9, 9, 0.4 };
    pixels[2] = .{ 0, 0, 0.001, 1 };
    pixels[9] = .{ 1, 2, 3, 1 };
    pixels[10] = .{ 0, 0, 0, 0.9 };
    var bytes: [11][3]u8 = undefined;
    const tally = try encodeForTest(3, &pixels, null, rows_for_test, &bytes);
    try std.testing.expectEqual(Tally{ .clear = 2, .covered = 8, .black = 1, .white = 1 }, tally);
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
