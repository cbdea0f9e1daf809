//! Data 3: the film, where samples add up to a picture.
//!
//! `trace` adds a pixel's samples to it one by one and in order, so that the sum has the same bits
//! however pixels are shared out; in the end the sums become images in their own places, which
//! `output` reads.

const std = @import("std");
const Image = @import("image.zig").Image;
const assert = std.debug.assert;

/// Radiance of a sample at most, so that sums and exposure stay finite.
const radiance_max = 1e30;

/// What a film keeps of samples.
pub const Layer = enum {
    /// Radiance towards the camera, linear RGB.
    color,
    /// Share of a pixel that shows something, in the image's fourth channel: the background is left
    /// clear. Without it pixels are covered all over.
    alpha,
    /// Surfaces whose colours are the display's, apart from radiance, in an image of their own.
    display,
};

/// See `Layer`.
pub const Layers = std.EnumSet(Layer);

/// Pixels x0 <= x < x1, y0 <= y < y1.
pub const Rectangle = struct { x0: u32, y0: u32, x1: u32, y1: u32 };

/// Sums of samples.
pub const Film = struct {
    layers: Layers,
    /// By pixel the sums of radiance and of the share that escaped; finished pixels as `Image` has
    /// them.
    image: Image,
    /// With `Layer.display`: by pixel the sums of the colours that are the display's and of their
    /// shares of the pixel, then the means. `image` counts these shares as covered, too.
    display: ?Image,

    const V4 = @Vector(4, f32);

    /// Asserts that both sides are at least 1, and that the layers have colour.
    pub fn init(
        gpa: std.mem.Allocator,
        width: u32,
        height: u32,
        layers: Layers,
    ) error{OutOfMemory}!Film {
        assert(layers.contains(.color));
        var image: Image = try .init(gpa, width, height);
        errdefer image.deinit(gpa);
        return .{
            .layers = layers,
            .image = image,
            .display = if (layers.contains(.display)) try .init(gpa, width, height) else null,
        };
    }

    /// Frees everything.
    pub fn deinit(film: *Film, gpa: std.mem.Allocator) void {
        if (film.display) |*display| display.deinit(gpa);
        film.image.deinit(gpa);
        film.* = undefined;
    }

    /// Adds a sample to a pixel: its radiance and, fourth, the share of it that saw nothing. The
    /// samples of a pixel come in order; number 0 begins it anew.
    pub inline fn add(film: *Film, x: u32, y: u32, number: u32, sample: [4]f32) void {
        addTo(film.image.at(x, y), number, sample);
    }

    /// Adds a sample's colours of the display to a pixel and, fourth, their share of it. Asserts
    /// that there is such a layer.
    pub inline fn addDisplay(film: *Film, x: u32, y: u32, number: u32, sample: [4]f32) void {
        addTo(film.display.?.at(x, y), number, sample);
    }

    inline fn addTo(pixel: *[4]f32, number: u32, sample: [4]f32) void {
        const sum: V4 = if (number == 0) @splat(0) else pixel.*;
        const value: V4 = sample;
        const limit: V4 = @splat(radiance_max);
        // What is not a number stays so, to be counted.
        pixel.* = sum + @select(f32, value > limit, limit, value);
    }

    /// Makes the means of pixels that have so many samples; without any they are black, or clear.
    /// Returns how many came out as not a number; these are black.
    pub fn finish(film: *Film, rectangle: Rectangle, sample_count: u32) u64 {
        if (sample_count == 0) {
            film.clear(rectangle);
            return 0;
        }
        const count: V4 = @splat(@floatFromInt(sample_count));
        const none: V4 = @splat(0);
        var non_finite_count: u64 = 0;
        for (rectangle.y0..rectangle.y1) |y| {
            const start = y * film.image.width;
            for (start + rectangle.x0..start + rectangle.x1) |at| {
                const sums: V4 = film.image.pixels[at];
                // A sample whose light is less than nothing makes up for another that has too much.
                var mean: [4]f32 = @select(f32, sums < none, none, sums) / count;
                const shown = 1 - mean[3];
                mean[3] = if (!film.layers.contains(.alpha)) 1 else if (shown > 0) shown else 0;
                film.image.pixels[at] = mean;
                var sum = (mean[0] + mean[1]) + (mean[2] + mean[3]);
                if (film.display) |*display| {
                    const color: [4]f32 = @as(V4, display.pixels[at]) / count;
                    display.pixels[at] = color;
                    sum += (color[0] + color[1]) + (color[2] + color[3]);
                }
                if (std.math.isFinite(sum)) continue;
                non_finite_count += 1;
                film.image.pixels[at] = .{ 0, 0, 0, 1 };
                if (film.display) |*display| display.pixels[at] = @splat(0);
            }
        }
        return non_finite_count;
    }

    /// Pixels without samples: nothing is there.
    fn clear(film: *Film, rectangle: Rectangle) void {
        const nothing: [4]f32 = .{ 0, 0, 0, if (film.layers.contains(.alpha)) 0 else 1 };
        for (rectangle.y0..rectangle.y1) |y| {
            const start = y * film.image.width;
            const from, const to = .{ start + rectangle.x0, start + rectangle.x1 };
            @memset(film.image.pixels[from..to], nothing);
            if (film.display) |*display| @memset(display.pixels[from..to], @splat(0));
        }
    }

    /// Makes pixels of another film, of the same size and layers, what these are with the samples
    /// that they have, and leaves them as they are.
    pub fn copyFinished(
        film: *const Film,
        other: *Film,
        rectangle: Rectangle,
        sample_count: u32,
    ) void {
        for (rectangle.y0..rectangle.y1) |y| {
            const start = y * film.image.width;
            const from, const to = .{ start + rectangle.x0, start + rectangle.x1 };
            @memcpy(other.image.pixels[from..to], film.image.pixels[from..to]);
            const display = if (film.display) |*image| image else continue;
            @memcpy(other.display.?.pixels[from..to], display.pixels[from..to]);
        }
        _ = other.finish(rectangle, sample_count);
    }

    /// The identity of the picture: that of its image, where the film has no other.
    pub fn hash(film: *const Film) u64 {
        const of_image = film.image.hash();
        const display = if (film.display) |*image| image else return of_image;
        return std.hash.XxHash64.hash(of_image, std.mem.sliceAsBytes(display.pixels));
    }
};

test "means of samples, alpha where it is wanted, black for what is not a number" {
    const nan = std.math.nan(f32);
    for ([_]bool{ false, true }) |has_alpha| {
        var film: Film = try .init(std.testing.allocator, 3, 2, .init(.{
            .color = true,
            .alpha = has_alpha,
        }));
        defer film.deinit(std.testing.allocator);
        for ([_][4]f32{ .{ 1, 2, 3, 1 }, .{ 2, 0, std.math.inf(f32), 0 } }, 0..) |sample, number| {
            film.add(1, 1, @intCast(number), sample);
            film.add(2, 1, @intCast(number), .{ nan, 0, 0, 0 });
        }
        const all: Rectangle = .{ .x0 = 1, .y0 = 1, .x1 = 3, .y1 = 2 };
        try std.testing.expectEqual(1, film.finish(all, 2));
        const alpha: f32 = if (has_alpha) 0.5 else 1;
        const mean = [4]f32{ 1.5, 1, radiance_max / 2, alpha };
        try std.testing.expectEqual(mean, film.image.at(1, 1).*);
        try std.testing.expectEqual([4]f32{ 0, 0, 0, 1 }, film.image.at(2, 1).*);
    }
}

test "colours of the display have means and a part in the hash of their own" {
    const gpa = std.testing.allocator;
    const layers: Layers = .init(.{ .color = true, .alpha = true, .display = true });
    var film: Film = try .init(gpa, 2, 1, layers);
    defer film.deinit(gpa);
    const colors = [_][4]f32{ .{ 0.5, 0.25, 0, 0.5 }, .{ 0, 0, 0, 0 } };
    for (colors, 0..) |color, number| for (0..2) |x| {
        film.add(@intCast(x), 0, @intCast(number), .{ 0, 0, 0, 1 - color[3] });
        film.addDisplay(@intCast(x), 0, @intCast(number), color);
    };
    const all: Rectangle = .{ .x0 = 0, .y0 = 0, .x1 = 2, .y1 = 1 };
    try std.testing.expectEqual(0, film.finish(all, 2));
    try std.testing.expectEqual([4]f32{ 0, 0, 0, 0.25 }, film.image.at(0, 0).*);
    try std.testing.expectEqual([4]f32{ 0.25, 0.125, 0, 0.25 }, film.display.?.at(0, 0).*);
    const before = film.hash();
    try std.testing.expect(before != film.image.hash());
    film.display.?.at(1, 0)[2] = 0.5;
    try std.testing.expect(before != film.hash());

    for (0..2) |x| film.addDisplay(@intCast(x), 0, 0, .{ std.math.nan(f32), 0, 0, 1 });
    try std.testing.expectEqual(2, film.finish(all, 1));
    try std.testing.expectEqual([4]f32{ 0, 0, 0, 0 }, film.display.?.at(1, 0).*);
}
