//! Data 3: the film, where samples add up to a picture.
//!
//! `trace` adds a pixel's samples to it one by one and in order, so that the sum has the same bits
//! however pixels are shared out; in the end the sums become images in their own places, which
//! `output` reads.

const std = @import("std");
/// What layers are made of.
pub const Image = @import("image.zig").Image;
const settings = @import("settings.zig");
const layout_file = @import("film/layout.zig");
const assert = std.debug.assert;

/// Radiance of a sample at most, so that sums and exposure stay finite.
const radiance_max = 1e30;

/// What a film keeps of samples. Radiance is in the film's image, with what `alpha` says in its
/// fourth channel; each of the others has an image of its own, and costs nothing where it is not
/// asked for.
pub const Layer = enum {
    /// Radiance towards the camera, linear RGB.
    color,
    /// Share of a pixel that shows something, in the image's fourth channel: the background is left
    /// clear. Without it pixels are covered all over.
    alpha,
    /// Surfaces whose colours are the display's, apart from radiance, and their shares of the
    /// pixel. The image counts these shares as covered, too.
    display,
    /// Share of white light from everywhere that what is seen sends to the camera, 0..1 in RGB; 1
    /// where nothing is seen. What smooth surfaces mirror and let through is seen in them.
    albedo,
    /// Unit normals of the same, towards where the ray came from, in the world's axes, weighed by
    /// their shares of the pixel; 0 where nothing is seen.
    normal,
    /// Distance from the camera's plane in metres: of what primary rays hit, the mean of those that
    /// hit something, and fourth their share of the pixel; 0 where there are none.
    depth,
    /// Variance of the pixel's mean radiance by channel, as the samples tell it that are taken to
    /// be independent; 0 where there is but one.
    variance,
    /// Half of what the mean of the samples `isInFirstHalf` has more than that of the others; 0
    /// where there is but one sample.
    halves,
    /// What the first sample shows. `integrate/aov.zig` leaves bits of a triangle's
    /// number, `no_triangle` where there is none, weights of its corners 1 and 2, and 0; these
    /// become bits of the file's numbers of node, material and primitive, all ones where there is
    /// none, and 0. As the next two it is no mean, and left alone by `finish`.
    origin,
    /// Where that is, in the world's axes, and fourth 1; 0 where there is nothing.
    position,
    /// Its texture coordinates, of the first set.
    texcoord,
    /// Tests of rays with boxes and with triangles that all samples took, by kernels that count
    /// them; of pixels that are traced together, the mean.
    cost,

    /// Whether it is of the first sample alone.
    fn isOfHits(layer: Layer) bool {
        return layer == .origin or layer == .position or layer == .texcoord;
    }

    /// Whether it has an image of its own.
    pub fn isApart(layer: Layer) bool {
        return layer != .color and layer != .alpha;
    }
};

/// See `Layer.origin`.
pub const no_triangle: u32 = std.math.maxInt(u32);

/// The film's that has one that users choose, or some of its channels do.
pub fn layerOf(layer: settings.Layer) Layer {
    return switch (layer) {
        .depth, .alpha => .depth,
        .uv => .texcoord,
        .node, .material, .primitive => .origin,
        inline .normal, .albedo, .position, .cost, .variance => |same| @field(
            Layer,
            @tagName(same),
        ),
    };
}

/// See `Layer`.
pub const Layers = std.EnumSet(Layer);

/// Whether a sample is one of the first half: of each stretch of numbers from a power of two to the
/// next, the lower half is, so that each half of a low-discrepancy sequence has whole stretches of
/// it.
pub fn isInFirstHalf(number: u32) bool {
    if (number < 2) return number == 0;
    const top = std.math.log2_int(u32, number);
    return (number >> (top - 1)) & 1 == 0;
}

/// How many of the samples below `count` are in the first half; asserts that there are some.
fn firstHalfCount(count: u32) u32 {
    if (count == 1) return 1;
    const power = @as(u32, 1) << std.math.log2_int(u32, count);
    return power / 2 + @min(count - power, power / 2);
}

/// Pixels x0 <= x < x1, y0 <= y < y1 of a picture; of a bundle's every `step`th in either
/// direction.
pub const Rectangle = struct {
    x0: u32,
    y0: u32,
    x1: u32,
    y1: u32,
    step: u32 = 1,
    /// What is added to a pixel's column and row, modulo 2^32, for where it is on the film.
    shift: [2]u32 = .{ 0, 0 },

    /// Column and row of a pixel on the film.
    pub inline fn placeOf(rectangle: *const Rectangle, x: u32, y: u32) [2]u32 {
        return .{ x +% rectangle.shift[0], y +% rectangle.shift[1] };
    }

    /// The same pixels by their places on the film.
    pub fn onFilm(rectangle: *const Rectangle) Rectangle {
        const x0, const y0 = rectangle.placeOf(rectangle.x0, rectangle.y0);
        const x1, const y1 = rectangle.placeOf(rectangle.x1, rectangle.y1);
        return .{ .x0 = x0, .y0 = y0, .x1 = x1, .y1 = y1, .step = rectangle.step };
    }

    /// A part of it, given by places on the film, by its pixels of the picture.
    pub fn ofFilm(rectangle: *const Rectangle, part: Rectangle) Rectangle {
        return .{
            .x0 = part.x0 -% rectangle.shift[0],
            .y0 = part.y0 -% rectangle.shift[1],
            .x1 = part.x1 -% rectangle.shift[0],
            .y1 = part.y1 -% rectangle.shift[1],
            .step = part.step,
            .shift = rectangle.shift,
        };
    }

    /// How many pixels are within it.
    pub fn pixelCount(rectangle: *const Rectangle) u64 {
        return @as(u64, rectangle.x1 - rectangle.x0) * (rectangle.y1 - rectangle.y0);
    }
};

/// Which pixels of a picture a film has.
pub const Layout = layout_file.Layout;
/// See `Layout`.
pub const Surroundings = layout_file.Surroundings;
/// See `Layout`.
pub const Window = layout_file.Window;

/// Sums of samples.
pub const Film = struct {
    layers: Layers,
    /// By pixel the sums of radiance and of the share that escaped; finished pixels as `Image` has
    /// them.
    image: Image,
    /// Images of the layers that have their own: by pixel sums, then what `Layer` says.
    apart: std.EnumArray(Layer, ?Image),
    /// Squares or halves of radiance are kept.
    has_moments: bool,

    const V4 = @Vector(4, f32);

    /// Asserts that both sides are at least 1, and that the layers have colour.
    pub fn init(
        gpa: std.mem.Allocator,
        width: u32,
        height: u32,
        layers: Layers,
    ) error{OutOfMemory}!Film {
        assert(layers.contains(.color));
        var film: Film = .{
            .layers = layers,
            .image = try .init(gpa, width, height),
            .apart = .initFill(null),
            .has_moments = layers.contains(.variance) or layers.contains(.halves),
        };
        errdefer film.deinit(gpa);
        var chosen = layers.iterator();
        while (chosen.next()) |layer| if (layer.isApart()) {
            film.apart.set(layer, try .init(gpa, width, height));
        };
        return film;
    }

    /// Frees everything.
    pub fn deinit(film: *Film, gpa: std.mem.Allocator) void {
        for (&film.apart.values) |*apart| if (apart.*) |*image| image.deinit(gpa);
        film.image.deinit(gpa);
        film.* = undefined;
    }

    /// Becomes a film of this size and these layers, to be filled anew; false: its images are not
    /// those that it would need.
    pub fn become(film: *Film, width: u32, height: u32, layers: Layers) bool {
        if (film.image.width != width or film.image.height != height) return false;
        for (std.enums.values(Layer)) |layer| {
            if (layer.isApart() and film.layers.contains(layer) != layers.contains(layer))
                return false;
        }
        film.layers = layers;
        return true;
    }

    /// The image of a layer that has its own; null: the film does not keep it.
    pub fn imageOf(film: *const Film, layer: Layer) ?*const Image {
        assert(layer.isApart());
        return if (film.apart.getPtrConst(layer).*) |*image| image else null;
    }

    /// A film of the same part of the picture without what is around it; to be freed as this one.
    pub fn cut(
        film: *const Film,
        gpa: std.mem.Allocator,
        layout: *const Layout,
    ) error{OutOfMemory}!Film {
        const bare = layout.bare();
        var result: Film = try .init(gpa, bare.film_width, bare.film_height, film.layers);
        result.clear();
        for (0..layout.count()) |number| {
            const from = layout.windowAt(@intCast(number)).own.onFilm();
            const to = bare.windowAt(@intCast(number)).own.onFilm();
            copyPixels(&film.image, from, &result.image, to);
            for (&film.apart.values, &result.apart.values) |*source, *target| {
                if (source.*) |*image| copyPixels(image, from, &target.*.?, to);
            }
        }
        return result;
    }

    /// Makes all pixels of all layers 0.
    pub fn clear(film: *Film) void {
        @memset(film.image.pixels, @splat(0));
        for (&film.apart.values) |*apart| if (apart.*) |*image| @memset(image.pixels, @splat(0));
    }

    /// Adds a sample to a pixel: its radiance and, fourth, the share of it that saw nothing. The
    /// samples of a pixel come in order; number 0 begins it anew. Variance and halves come with it.
    pub inline fn add(film: *Film, x: u32, y: u32, number: u32, sample: [4]f32) void {
        if (film.has_moments) film.addMoments(x, y, number, sample);
        addTo(film.image.at(x, y), number, sample);
    }

    /// Adds a sample to a pixel of another layer, in the same order: four channels weighed by
    /// shares of the pixel. Of the display's colours and of depth the fourth is that share.
    /// Asserts that there is such a layer, and that it is not one that `add` sees to.
    pub inline fn addApart(
        film: *Film,
        layer: Layer,
        x: u32,
        y: u32,
        number: u32,
        sample: [4]f32,
    ) void {
        assert(layer != .variance and layer != .halves and !layer.isOfHits());
        addTo(film.apart.getPtr(layer).*.?.at(x, y), number, sample);
    }

    inline fn addTo(pixel: *[4]f32, number: u32, sample: [4]f32) void {
        const sum: V4 = if (number == 0) @splat(0) else pixel.*;
        // What is not a number stays so, to be counted.
        pixel.* = sum + limited(sample);
    }

    inline fn limited(sample: V4) V4 {
        const limit: V4 = @splat(radiance_max);
        return @select(f32, sample > limit, limit, sample);
    }

    /// Before a sample is added: the sum of squared distances from the mean grows by the distance
    /// from the mean so far (Welford, "Note on a Method for Calculating Corrected Sums of Squares
    /// and Products", 1962), which cancels nothing.
    noinline fn addMoments(film: *Film, x: u32, y: u32, number: u32, sample: [4]f32) void {
        const value = limited(sample);
        const is_first = number == 0;
        if (film.apart.getPtr(.variance).*) |*image| {
            const squares = image.at(x, y);
            if (is_first) {
                squares.* = @splat(0);
            } else {
                const before: f32 = @floatFromInt(number);
                const sum: V4 = film.image.at(x, y).*;
                const away = value - sum / @as(V4, @splat(before));
                const weight: V4 = @splat(before / (before + 1));
                squares.* = @as(V4, squares.*) + limited(away * away * weight);
            }
        }
        if (film.apart.getPtr(.halves).*) |*image| {
            const none: V4 = @splat(0);
            const own = if (isInFirstHalf(number)) value else none;
            const sum: V4 = if (is_first) none else image.at(x, y).*;
            image.at(x, y).* = sum + own;
        }
    }

    /// Makes the means of pixels that have so many samples, at least 1. Returns how many came out
    /// as not a number; these are black.
    pub fn finish(film: *Film, rectangle: Rectangle, sample_count: u32) u64 {
        assert(sample_count > 0);
        const count: V4 = @splat(@floatFromInt(sample_count));
        const none: V4 = @splat(0);
        var non_finite_count: u64 = 0;
        for (rectangle.y0..rectangle.y1) |y| {
            const start = y * film.image.width;
            for (start + rectangle.x0..start + rectangle.x1) |at| {
                const sums: V4 = film.image.pixels[at];
                film.finishApart(at, sums, sample_count);
                // A sample whose light is less than nothing makes up for another that has too much.
                var mean: [4]f32 = @select(f32, sums < none, none, sums) / count;
                const shown = 1 - mean[3];
                mean[3] = if (!film.layers.contains(.alpha)) 1 else if (shown > 0) shown else 0;
                film.image.pixels[at] = mean;
                var is_number = isNumber(mean);
                if (film.imageOf(.display)) |display|
                    is_number = is_number and isNumber(display.pixels[at]);
                if (is_number) continue;
                non_finite_count += 1;
                film.image.pixels[at] = .{ 0, 0, 0, 1 };
                if (film.imageOf(.display)) |display| display.pixels[at] = @splat(0);
            }
        }
        return non_finite_count;
    }

    /// The other layers of a pixel; what is not a number there is 0, but for colours, which are
    /// counted.
    inline fn finishApart(film: *Film, at: usize, radiance: V4, sample_count: u32) void {
        const count: V4 = @splat(@floatFromInt(sample_count));
        for (&film.apart.values, std.enums.values(Layer)) |*apart, layer| {
            const image = if (apart.*) |*image| image else continue;
            if (layer.isOfHits()) continue;
            const sums: V4 = image.pixels[at];
            const means: [4]f32 = switch (layer) {
                .color, .alpha => unreachable, // They are not apart.
                .origin, .position, .texcoord => unreachable, // See above.
                .cost => sums,
                .display, .albedo, .normal => sums / count,
                .depth => depthOf(sums, count[0]),
                .variance => sums / (count * @as(V4, @splat(@max(count[0] - 1, 1)))),
                .halves => halfOfDifference(sums, radiance, sample_count),
            };
            image.pixels[at] = if (layer == .display or isNumber(means)) means else @splat(0);
        }
    }

    fn depthOf(sums: V4, count: f32) [4]f32 {
        return .{ if (sums[3] > 0) sums[0] / sums[3] else 0, 0, 0, sums[3] / count };
    }

    fn halfOfDifference(first: V4, all: V4, sample_count: u32) V4 {
        if (sample_count == 1) return @splat(0);
        const first_count = firstHalfCount(sample_count);
        const first_share: V4 = @splat(1 / (2 * @as(f32, @floatFromInt(first_count))));
        const other_share: V4 =
            @splat(1 / (2 * @as(f32, @floatFromInt(sample_count - first_count))));
        return first * first_share - (all - first) * other_share;
    }

    fn isNumber(pixel: [4]f32) bool {
        return std.math.isFinite((pixel[0] + pixel[1]) + (pixel[2] + pixel[3]));
    }

    /// Makes pixels of another film, of the same size and layers or less of them, what these are
    /// with the samples that they have, and leaves them as they are.
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
            for (&other.apart.values, &film.apart.values) |*to_image, *from_image| {
                const image = if (to_image.*) |*image| image else continue;
                @memcpy(image.pixels[from..to], from_image.*.?.pixels[from..to]);
            }
        }
        _ = other.finish(rectangle, sample_count);
    }

    /// The identity of the picture: that of its image, where the film has no other.
    pub fn hash(film: *const Film) u64 {
        const of_image = film.image.hash();
        const display = film.imageOf(.display) orelse return of_image;
        return std.hash.XxHash64.hash(of_image, std.mem.sliceAsBytes(display.pixels));
    }
};

/// Makes pixels of an image those of another; both rectangles are of one size.
pub fn copyPixels(from: *const Image, source: Rectangle, to: *Image, target: Rectangle) void {
    const width = source.x1 - source.x0;
    assert(target.x1 - target.x0 == width);
    assert(target.y1 - target.y0 == source.y1 - source.y0);
    for (source.y0..source.y1, target.y0..target.y1) |from_row, to_row| {
        const from_start = from_row * from.width + source.x0;
        const to_start = to_row * to.width + target.x0;
        @memcpy(to.pixels[to_start..][0..width], from.pixels[from_start..][0..width]);
    }
}

test {
    _ = layout_file;
}

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
        film.addApart(.display, @intCast(x), 0, @intCast(number), color);
    };
    const all: Rectangle = .{ .x0 = 0, .y0 = 0, .x1 = 2, .y1 = 1 };
    try std.testing.expectEqual(0, film.finish(all, 2));
    const display = film.imageOf(.display).?;
    try std.testing.expectEqual([4]f32{ 0, 0, 0, 0.25 }, film.image.at(0, 0).*);
    try std.testing.expectEqual([4]f32{ 0.25, 0.125, 0, 0.25 }, display.at(0, 0).*);
    const before = film.hash();
    try std.testing.expect(before != film.image.hash());
    display.at(1, 0)[2] = 0.5;
    try std.testing.expect(before != film.hash());

    for (0..2) |x| film.addApart(.display, @intCast(x), 0, 0, .{ std.math.nan(f32), 0, 0, 1 });
    try std.testing.expectEqual(2, film.finish(all, 1));
    try std.testing.expectEqual([4]f32{ 0, 0, 0, 0 }, display.at(1, 0).*);
}

test "halves have as many samples, and whole stretches of them" {
    var count: u32 = 0;
    for (0..1000) |number| {
        count += @intFromBool(isInFirstHalf(@intCast(number)));
        try std.testing.expectEqual(count, firstHalfCount(@intCast(number + 1)));
        if (number > 0 and std.math.isPowerOfTwo(number + 1)) {
            try std.testing.expectEqual((number + 1) / 2, count);
        }
    }
}

test "layers of what is seen: means, depth of what is hit, variance of the mean, halves" {
    const gpa = std.testing.allocator;
    var film: Film = try .init(gpa, 2, 1, .full);
    defer film.deinit(gpa);
    const nan = std.math.nan(f32);
    // Far from 0, where sums of squares would cancel.
    const samples = [_]f32{ 10_001, 10_003, 10_005, 10_007 };
    for (samples, 0..) |value, number| {
        const n: u32 = @intCast(number);
        const share: f32 = if (number < 2) 1 else 0;
        film.add(0, 0, n, .{ value, 2, 0, 0 });
        film.add(1, 0, n, .{ 0, 0, 0, 0 });
        film.addApart(.albedo, 0, 0, n, .{ share, 0.5, 1, 0 });
        film.addApart(.normal, 0, 0, n, .{ 0, share, 0, 0 });
        film.addApart(.depth, 0, 0, n, .{ 7 * share, 0, 0, share });
        film.addApart(.cost, 0, 0, n, .{ 3, 2, 0, 0 });
        film.addApart(.display, 0, 0, n, @splat(0));
        for ([_]Layer{ .albedo, .normal, .depth, .cost }) |layer| {
            film.addApart(layer, 1, 0, n, @splat(nan));
        }
        film.addApart(.display, 1, 0, n, @splat(0));
    }
    const all: Rectangle = .{ .x0 = 0, .y0 = 0, .x1 = 2, .y1 = 1 };
    try std.testing.expectEqual(0, film.finish(all, samples.len));
    const expected: std.EnumMap(Layer, [4]f32) = .init(.{
        .albedo = .{ 0.5, 0.5, 1, 0 },
        .normal = .{ 0, 0.5, 0, 0 },
        .depth = .{ 7, 0, 0, 0.5 },
        // Squares of 3, 1, 1, 3 make 20, by 3 and by 4.
        .variance = .{ 20.0 / 12.0, 0, 0, 0 },
        .cost = .{ 12, 8, 0, 0 },
        // 0 and 2 against 1 and 3.
        .halves = .{ -1, 0, 0, 0 },
    });
    for (std.enums.values(Layer)) |layer| {
        const pixel = expected.get(layer) orelse continue;
        for (pixel, film.imageOf(layer).?.at(0, 0)) |wanted, found| {
            try std.testing.expectApproxEqAbs(wanted, found, 2e-3);
        }
        try std.testing.expectEqual([4]f32{ 0, 0, 0, 0 }, film.imageOf(layer).?.at(1, 0).*);
    }
    // A picture begins anew, and knows nothing of its noise.
    film.add(0, 0, 0, .{ 1, 1, 1, 0 });
    _ = film.finish(.{ .x0 = 0, .y0 = 0, .x1 = 1, .y1 = 1 }, 1);
    for ([_]Layer{ .variance, .halves }) |layer| {
        try std.testing.expectEqual([4]f32{ 0, 0, 0, 0 }, film.imageOf(layer).?.at(0, 0).*);
    }
}
