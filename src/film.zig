//! Data 3: the film, where samples add up to a picture.
//!
//! `trace` adds a pixel's samples to it one by one and in order, so that the sum has the same bits
//! however pixels are shared out; in the end the sums become an image in their own place, which
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

    const V4 = @Vector(4, f32);

    /// Asserts that both sides are at least 1, and that the layers have colour.
    pub fn init(
        gpa: std.mem.Allocator,
        width: u32,
        height: u32,
        layers: Layers,
    ) error{OutOfMemory}!Film {
        assert(layers.contains(.color));
        return .{ .layers = layers, .image = try .init(gpa, width, height) };
    }

    /// Frees everything.
    pub fn deinit(film: *Film, gpa: std.mem.Allocator) void {
        film.image.deinit(gpa);
        film.* = undefined;
    }

    /// Adds a sample to a pixel: its radiance and, fourth, the share of it that saw nothing. The
    /// samples of a pixel come in order; number 0 begins it anew.
    pub inline fn add(film: *Film, x: u32, y: u32, number: u32, sample: [4]f32) void {
        const pixel = film.image.at(x, y);
        const sum: V4 = if (number == 0) @splat(0) else pixel.*;
        const value: V4 = sample;
        const limit: V4 = @splat(radiance_max);
        // What is not a number stays so, to be counted.
        pixel.* = sum + @select(f32, value > limit, limit, value);
    }

    /// Makes the means of pixels that have all their samples. Returns how many came out as not a
    /// number; these are black.
    pub fn finish(film: *Film, rectangle: Rectangle, sample_count: u32) u64 {
        const count: V4 = @splat(@floatFromInt(sample_count));
        var non_finite_count: u64 = 0;
        for (rectangle.y0..rectangle.y1) |y| {
            const row = film.image.pixels[y * film.image.width ..];
            for (row[rectangle.x0..rectangle.x1]) |*pixel| {
                var mean: [4]f32 = @as(V4, pixel.*) / count;
                const shown = 1 - mean[3];
                mean[3] = if (!film.layers.contains(.alpha)) 1 else if (shown > 0) shown else 0;
                pixel.* = mean;
                if (std.math.isFinite((mean[0] + mean[1]) + (mean[2] + mean[3]))) continue;
                non_finite_count += 1;
                pixel.* = .{ 0, 0, 0, 1 };
            }
        }
        return non_finite_count;
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
