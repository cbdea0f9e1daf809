//! Layers as pictures for people: each value a colour of the display, by docs/layers.md.
//!
//! In: a layer. Out: linear RGBA of which the sRGB encoding makes the codes that are meant, or the
//! values themselves for formats that hold them.

const std = @import("std");
const math = @import("../math.zig");
const layers = @import("layers.zig");
const settings = @import("../settings.zig");
const Image = @import("../image.zig").Image;
const Allocator = std.mem.Allocator;
const Further = layers.Further;
const Layer = settings.Layer;

/// Makes colours of a layer; the image is of its size. Every pixel is covered all over.
pub fn paint(
    gpa: Allocator,
    further: *const Further,
    image: *const Image,
) error{OutOfMemory}!void {
    const range: Range = switch (further.layer) {
        .depth, .position => .ofSeen(further),
        .cost => .{ .upper = @splat(try costMost(gpa, further)) },
        .normal => .{ .lower = @splat(-1) },
        .albedo, .uv, .node, .material, .primitive, .alpha, .variance => .{},
    };
    for (image.pixels, 0..) |*pixel, at| {
        const color = colorOf(further, at, &range);
        pixel.* = .{ color[0], color[1], color[2], 1 };
    }
}

/// Values of a layer as they are, one in all channels; numbers of things as floats, -1 where there
/// is nothing.
pub fn copy(further: *const Further, image: *const Image) void {
    for (image.pixels, 0..) |*pixel, at| {
        const values = further.valuesAt(at);
        var channels: [3]f32 = @splat(0);
        @memcpy(channels[0..values.len], values);
        if (layers.isNumber(further.layer)) {
            const number: u32 = @bitCast(values[0]);
            channels[0] = if (number == layers.none) -1 else @floatFromInt(number);
        }
        if (values.len == 1) channels = @splat(channels[0]);
        pixel.* = channels ++ [1]f32{1};
    }
}

/// What becomes black and white, by channel.
const Range = struct {
    lower: [3]f32 = @splat(0),
    upper: [3]f32 = @splat(1),

    /// Of all pixels that show something: the fourth channel says so.
    fn ofSeen(further: *const Further) Range {
        var range: Range = .{
            .lower = @splat(std.math.inf(f32)),
            .upper = @splat(-std.math.inf(f32)),
        };
        for (further.image.pixels, 0..) |pixel, at| {
            if (pixel[3] <= 0) continue;
            for (further.valuesAt(at), 0..) |value, channel| {
                range.lower[channel] = @min(range.lower[channel], value);
                range.upper[channel] = @max(range.upper[channel], value);
            }
        }
        return range;
    }

    /// 0..1 from the one to the other, 1 where these are the same.
    fn share(range: *const Range, value: f32, channel: usize) f32 {
        const size = range.upper[channel] - range.lower[channel];
        return if (size > 0) (value - range.lower[channel]) / size else 1;
    }
};

fn colorOf(further: *const Further, at: usize, range: *const Range) [3]f32 {
    const values = further.valuesAt(at);
    const is_seen = further.image.pixels[at][3] > 0;
    return switch (further.layer) {
        .albedo => values[0..3].*,
        .depth => gray(if (is_seen) 1 - range.share(values[0], 0) else 0),
        .alpha => gray(values[0]),
        .uv => ofCodes(.{ values[0] - @floor(values[0]), values[1] - @floor(values[1]), 0 }),
        .position, .normal => if (is_seen or further.layer == .normal) ofCodes(.{
            range.share(values[0], 0), range.share(values[1], 1), range.share(values[2], 2),
        }) else .{ 0, 0, 0 },
        .node, .material, .primitive => numberColor(@bitCast(values[0])),
        .cost => decoded(math.magma.colorOf(range.share(values[0] + values[1], 0))),
        // The standard error of the mean, as the mean itself is shown.
        .variance => .{ @sqrt(values[0]), @sqrt(values[1]), @sqrt(values[2]) },
    };
}

fn gray(value: f32) [3]f32 {
    return ofCodes(@splat(value));
}

/// Codes 0..255 of values 0..1.
fn ofCodes(values: [3]f32) [3]f32 {
    var codes: [3]u8 = undefined;
    for (&codes, values) |*code, value| {
        code.* = if (value > 0) @intFromFloat(@min(value, 1) * 255 + 0.5) else 0;
    }
    return decoded(codes);
}

fn decoded(codes: [3]u8) [3]f32 {
    const table = &math.srgb.decoded;
    return .{ table[codes[0]], table[codes[1]], table[codes[2]] };
}

/// Colours that differ from number to number, none of them dark; black for none.
fn numberColor(number: u32) [3]f32 {
    if (number == layers.none) return .{ 0, 0, 0 };
    // The finalizer of MurmurHash3 (Appleby 2011).
    var hash = number +% 0x9e3779b9;
    hash = (hash ^ (hash >> 16)) *% 0x85ebca6b;
    hash = (hash ^ (hash >> 13)) *% 0xc2b2ae35;
    hash ^= hash >> 16;
    var codes: [3]u8 = undefined;
    for (&codes, 0..) |*code, channel| {
        const byte: u8 = @truncate(hash >> @intCast(8 * channel));
        code.* = 64 + byte / 4 * 3;
    }
    return decoded(codes);
}

/// What no more than a hundredth of the pixels took more than, or a little more than that: beyond
/// it all colours are the same, lest a few pixels make the others black.
fn costMost(gpa: Allocator, further: *const Further) error{OutOfMemory}!f32 {
    // Floats that are not negative are in the order of their bits.
    const counts = try gpa.alloc(u32, 1 << 16);
    defer gpa.free(counts);
    @memset(counts, 0);
    const pixels = further.image.pixels;
    for (pixels) |pixel| {
        const bits: u32 = @bitCast(@max(pixel[0] + pixel[1], 0));
        counts[bits >> 16] += 1;
    }
    var above: usize = 0;
    var bin = counts.len;
    while (bin > 0) {
        bin -= 1;
        above += counts[bin];
        if (above * 100 > pixels.len) break;
    }
    return @bitCast((@as(u32, @intCast(bin)) << 16) | 0xffff);
}

fn expectCodes(expected: []const [3]u8, further: *const Further) !void {
    const gpa = std.testing.allocator;
    var image: Image = try .init(gpa, further.image.width, further.image.height);
    defer image.deinit(gpa);
    try paint(gpa, further, &image);
    for (expected, image.pixels[0..expected.len]) |codes, pixel| {
        errdefer std.debug.print("{t}: {any}\n", .{ further.layer, pixel });
        for (codes, pixel[0..3]) |code, value| {
            try std.testing.expectEqual(code, math.srgb.encode(value));
        }
    }
}

test "near is white, far and nothing black; codes are those that are meant" {
    var pixels align(64) = [_][4]f32{
        .{ 2, 0, 0, 1 }, .{ 4, 0, 0, 0.5 }, .{ 3, 0, 0, 1 }, .{ 0, 0, 0, 0 },
    };
    const image: Image = .{ .width = 4, .height = 1, .pixels = &pixels };
    try expectCodes(
        &.{ @splat(255), @splat(0), @splat(128), @splat(0) },
        &.{ .layer = .depth, .image = &image },
    );
    try expectCodes(
        &.{ @splat(255), @splat(128), @splat(255), @splat(0) },
        &.{ .layer = .alpha, .image = &image },
    );
    pixels = .{ .{ -1, 1, 0, 1 }, .{ 0, 0, 0, 0 }, .{ 2.25, -0.25, 7, 0 }, .{ 1, 3, 5, 0 } };
    try expectCodes(
        &.{ .{ 0, 255, 128 }, @splat(128) },
        &.{ .layer = .normal, .image = &image },
    );
    try expectCodes(
        &.{ .{ 0, 0, 0 }, .{ 0, 0, 0 }, .{ 64, 191, 0 } },
        &.{ .layer = .uv, .image = &image },
    );
    pixels = .{ .{ 1, 2, 3, 1 }, .{ 2, 2, 1, 1 }, .{ 9, 9, 9, 0 }, .{ 1.5, 2, 2, 1 } };
    try expectCodes(
        &.{ .{ 0, 255, 255 }, .{ 255, 255, 0 }, .{ 0, 0, 0 }, .{ 128, 255, 128 } },
        &.{ .layer = .position, .image = &image },
    );
}

test "things have colours of their own, nothing has none; a few pixels do not darken the rest" {
    const gpa = std.testing.allocator;
    var image: Image = try .init(gpa, 256, 1);
    defer image.deinit(gpa);
    for (image.pixels, 0..) |*pixel, number| {
        pixel.* = .{ @bitCast(@as(u32, @intCast(number))), 0, 0, 0 };
    }
    image.pixels[255][0] = @bitCast(layers.none);
    var painted: Image = try .init(gpa, 256, 1);
    defer painted.deinit(gpa);
    const further: Further = .{ .layer = .node, .image = &image };
    try paint(gpa, &further, &painted);
    for (painted.pixels[0..255], 1..) |pixel, next| {
        for (painted.pixels[next..]) |other| try std.testing.expect(!std.meta.eql(pixel, other));
    }
    try std.testing.expectEqual([4]f32{ 0, 0, 0, 1 }, painted.pixels[255]);
    copy(&further, &painted);
    try std.testing.expectEqual([4]f32{ 7, 7, 7, 1 }, painted.pixels[7]);
    try std.testing.expectEqual([4]f32{ -1, -1, -1, 1 }, painted.pixels[255]);

    for (image.pixels, 0..) |*pixel, number| pixel.* = .{ @floatFromInt(number / 2), 10, 0, 0 };
    image.pixels[3][0] = 1e9;
    image.pixels[4][1] = 1e9;
    const most = try costMost(gpa, &.{ .layer = .cost, .image = &image });
    try std.testing.expect(most >= 137 and most < 139);
}
