//! What the filter reads: planes of floats with room around the picture, made of a film's layers.
//!
//! In: a finished film. Out: by pixel the light that arrives, in two halves of the samples, how
//! noisy it is, and features with how far they may differ within one surface. Light is radiance by
//! albedo, so that textures are out of the filter's way; samples of few pixels that outshine all of
//! their neighbours are cut off. All rows are made by themselves, in the order of the passes.

const std = @import("std");
const Film = @import("../film.zig").Film;
const huge_pages = @import("../huge_pages.zig");
const parallel = @import("../parallel.zig");
const assert = std.debug.assert;

/// Pixels at a time.
pub const lanes = 8;
pub const V = @Vector(lanes, f32);

/// What a pixel has.
pub const Name = enum {
    /// Light by the first half of the samples, and by the second.
    first_r,
    first_g,
    first_b,
    second_r,
    second_g,
    second_b,
    /// Variance of the mean of all samples, the sum of its channels.
    variance,
    normal_x,
    normal_y,
    normal_z,
    depth,
    albedo_r,
    albedo_g,
    albedo_b,
    /// 1 by the squares of the distances that normals, depths and albedos may have.
    normal_strictness,
    depth_strictness,
    albedo_strictness,
};

/// Darker albedos would make much of little light.
const albedo_min = 0.01;
/// Light at most that is filtered: squares of it are finite.
const light_max = 1e12;
/// What normals differ by outside of the picture: nothing is like it.
const nowhere = 1e4;

/// Features of one surface may differ by so much, depths by that share of themselves.
const normal_distance = 0.1;
const depth_share = 0.002;
const albedo_distance = 0.1;
/// And by so many times the difference from a pixel to the next; depths by more, for surfaces lean.
const slope_reach = 0.75;
const depth_slope_reach = 4.0;

/// Halves may outshine the mean of every neighbour so many times.
const cut_factor = 4.0;

/// Side of the square in which the halves say how far the samples' variance is right: planes depend
/// on pixels no further away.
pub const ratio_radius = 4;

/// Planes of one picture.
pub const Planes = struct {
    width: usize,
    height: usize,
    /// Pixels around the picture, which repeat its edge, and floats of a row.
    margin: usize,
    stride: usize,
    floats: []align(64) f32,
    of: std.EnumArray(Name, []f32),

    /// Room for a picture's; `deinit` frees it.
    pub fn init(
        gpa: std.mem.Allocator,
        width: usize,
        height: usize,
        margin: usize,
    ) error{OutOfMemory}!Planes {
        const stride = std.mem.alignForward(usize, width, lanes) + 2 * margin + lanes;
        const names = std.enums.values(Name);
        const length = std.math.mul(usize, stride, height + 2 * margin) catch
            return error.OutOfMemory;
        const count = std.math.mul(usize, length, names.len) catch return error.OutOfMemory;
        var planes: Planes = .{
            .width = width,
            .height = height,
            .margin = margin,
            .stride = stride,
            .floats = try huge_pages.alloc(gpa, f32, count),
            .of = undefined,
        };
        for (names, 0..) |name, index| {
            planes.of.set(name, planes.floats[index * length ..][0..length]);
        }
        return planes;
    }

    /// Frees everything.
    pub fn deinit(planes: *Planes, gpa: std.mem.Allocator) void {
        huge_pages.free(gpa, planes.floats);
        planes.* = undefined;
    }

    /// Place of a pixel in each plane.
    pub inline fn at(planes: *const Planes, x: usize, y: usize) usize {
        return (y + planes.margin) * planes.stride + planes.margin + x;
    }

    /// Square of how much a feature changes from a pixel to the next: along a row or a column, in
    /// that of the two directions in which it changes less. It is large where surfaces are curved
    /// and in pixels that show two of them, and small next to these.
    fn slopeOf(planes: *const Planes, comptime names: []const Name, x: usize, y: usize) f32 {
        const place = planes.at(x, y);
        const left = if (x > 0) place - 1 else place + 1;
        const right = if (x + 1 < planes.width) place + 1 else left;
        const above = if (y > 0) place - planes.stride else place + planes.stride;
        const below = if (y + 1 < planes.height) place + planes.stride else above;
        const places = [_]usize{
            if (x > 0) left else right, right, if (y > 0) above else below, below,
        };
        var squares: [4]f32 = @splat(0);
        inline for (names) |name| {
            const plane = planes.of.get(name);
            for (&squares, places) |*square, other| {
                const difference = plane[other] - plane[place];
                square.* += difference * difference;
            }
        }
        return @max(@min(squares[0], squares[1]), @min(squares[2], squares[3]));
    }

    /// Pixels of a plane from a place on.
    pub inline fn load(planes: *const Planes, comptime name: Name, place: usize) V {
        return planes.of.getPtrConst(name).*[place..][0..lanes].*;
    }
};

/// Fills in the planes. Asserts that the film has the layers that denoising asks for.
pub fn fill(
    gpa: std.mem.Allocator,
    planes: *Planes,
    film: *const Film,
    pool: *parallel.Pool,
) (error{OutOfMemory} || parallel.Error)!void {
    const pixel_count = planes.width * planes.height;
    const raw = try huge_pages.alloc(gpa, Pixel, pixel_count);
    defer huge_pages.free(gpa, raw);
    const work: Work = .{ .planes = planes, .film = film, .raw = raw };
    const height = planes.height;
    try pool.forEach(height, &work, Work.demodulate);
    try pool.forEach(height, &work, Work.cut);
    try pool.forEach(height, &work, Work.weigh);
    try pool.forEach(height + 2 * planes.margin, &work, Work.surround);
}

/// A pixel before the filter's planes are made of it.
const Pixel = struct {
    first: [3]f32,
    second: [3]f32,
    /// Of the mean, as the samples have it, and as the halves do.
    variance: f32,
    by_halves: f32,
    /// What the filter takes it for.
    expected: f32 = 0,
};

/// By what the pixel's radiance is divided: the albedo of what covers it.
pub fn divisorOf(film: *const Film, at: usize) [3]f32 {
    const albedo = film.imageOf(.albedo).?.pixels[at];
    const clear = 1 - film.image.pixels[at][3];
    var divisor: [3]f32 = undefined;
    for (&divisor, albedo[0..3]) |*to, from| to.* = @max(from - clear, albedo_min);
    return divisor;
}

const Work = struct {
    planes: *Planes,
    film: *const Film,
    raw: []Pixel,

    fn demodulate(work: *const Work, y: usize, _: usize) void {
        const planes = work.planes;
        const film = work.film;
        for (0..planes.width) |x| {
            const at = y * planes.width + x;
            const divisor = divisorOf(film, at);
            const radiance = film.image.pixels[at];
            const half = film.imageOf(.halves).?.pixels[at];
            const variance = film.imageOf(.variance).?.pixels[at];
            const pixel = &work.raw[at];
            pixel.variance = 0;
            pixel.by_halves = 0;
            for (0..3) |channel| {
                const by = divisor[channel];
                const light = bounded(radiance[channel] / by);
                const difference = bounded(half[channel] / by);
                pixel.first[channel] = light + difference;
                pixel.second[channel] = light - difference;
                pixel.variance += bounded(@sqrt(variance[channel]) / by) *
                    bounded(@sqrt(variance[channel]) / by);
                pixel.by_halves += difference * difference;
            }
            const to = planes.at(x, y);
            const normal = film.imageOf(.normal).?.pixels[at];
            const albedo = film.imageOf(.albedo).?.pixels[at];
            const names = [_]Name{
                .normal_x, .normal_y, .normal_z, .albedo_r, .albedo_g, .albedo_b,
            };
            const values = normal[0..3].* ++ albedo[0..3].*;
            inline for (names, values) |name, value| planes.of.get(name)[to] = value;
            planes.of.get(.depth)[to] = film.imageOf(.depth).?.pixels[at][0];
        }
    }

    fn bounded(light: f32) f32 {
        return if (light > -light_max) (if (light < light_max) light else light_max) else 0;
    }

    /// Cuts off halves that outshine the neighbours' means, where these samples vary so much that
    /// it may be chance; and with them their variance.
    fn cut(work: *const Work, y: usize, _: usize) void {
        const planes = work.planes;
        for (0..planes.width) |x| {
            const pixel = work.raw[y * planes.width + x];
            var brightest: f32 = 0;
            for (@max(y, 1) - 1..@min(y + 2, planes.height)) |j| {
                for (@max(x, 1) - 1..@min(x + 2, planes.width)) |i| {
                    if (i == x and j == y) continue;
                    brightest = @max(brightest, meanOf(&work.raw[j * planes.width + i]));
                }
            }
            var scales: [2]f32 = .{ 1, 1 };
            const mean = meanOf(&pixel);
            const is_noisy = pixel.variance * 9 > 0.1 * mean * mean;
            if (is_noisy) for (&scales, [_][3]f32{ pixel.first, pixel.second }) |*scale, half| {
                const sum = half[0] + half[1] + half[2];
                if (sum > cut_factor * brightest) scale.* = cut_factor * brightest / sum;
            };
            const to = planes.at(x, y);
            const halves = [_]Name{
                .first_r, .first_g, .first_b, .second_r, .second_g, .second_b,
            };
            inline for (halves, pixel.first ++ pixel.second, 0..) |name, value, index| {
                planes.of.get(name)[to] = value * scales[index / 3];
            }
            const left = (scales[0] + scales[1]) / 2;
            planes.of.get(.variance)[to] = pixel.variance * left * left;
        }
    }

    fn meanOf(pixel: *const Pixel) f32 {
        var sum: f32 = 0;
        for (pixel.first, pixel.second) |first, second| sum += first + second;
        return @max(sum, 0) / 2;
    }

    /// Finds how far features may differ, and makes the variance that of samples which are not
    /// independent.
    fn weigh(work: *const Work, y: usize, _: usize) void {
        const planes = work.planes;
        for (0..planes.width) |x| {
            const to = planes.at(x, y);
            const normal = planes.slopeOf(&.{ .normal_x, .normal_y, .normal_z }, x, y);
            const depth = planes.slopeOf(&.{.depth}, x, y);
            const albedo = planes.slopeOf(&.{ .albedo_r, .albedo_g, .albedo_b }, x, y);
            const share = depth_share * planes.of.get(.depth)[to];
            const reach = slope_reach * slope_reach;
            const depth_reach = depth_slope_reach * depth_slope_reach;
            planes.of.get(.normal_strictness)[to] =
                1 / (normal_distance * normal_distance + reach * normal);
            planes.of.get(.depth_strictness)[to] =
                1 / (share * share + depth_reach * depth + 1e-12);
            planes.of.get(.albedo_strictness)[to] =
                1 / (albedo_distance * albedo_distance + reach * albedo);
            work.raw[y * planes.width + x].expected = work.expectedVariance(x, y);
        }
    }

    /// The variance of the samples as around the pixel, and less where the halves differ by less
    /// around it, as those of stratified samples do.
    fn expectedVariance(work: *const Work, x: usize, y: usize) f32 {
        const planes = work.planes;
        var near: f32 = 0;
        var near_count: f32 = 0;
        var by_samples: f32 = 0;
        var by_halves: f32 = 0;
        const radius = ratio_radius;
        for (@max(y, radius) - radius..@min(y + radius + 1, planes.height)) |j| {
            for (@max(x, radius) - radius..@min(x + radius + 1, planes.width)) |i| {
                const other = &work.raw[j * planes.width + i];
                by_samples += other.variance;
                by_halves += other.by_halves;
                if (i + 1 < x or i > x + 1 or j + 1 < y or j > y + 1) continue;
                near += planes.of.get(.variance)[planes.at(i, j)];
                near_count += 1;
            }
        }
        const ratio = if (by_halves < by_samples) by_halves / by_samples else 1;
        return near / near_count * ratio;
    }

    /// Repeats the picture's edge around it; `row` counts from the first above it.
    fn surround(work: *const Work, row: usize, _: usize) void {
        const planes = work.planes;
        const margin = planes.margin;
        const y = @min(@max(row, margin) - margin, planes.height - 1);
        const is_within = row == y + margin;
        for (0..planes.stride) |column| {
            const x = @min(@max(column, margin) - margin, planes.width - 1);
            const to = row * planes.stride + column;
            planes.of.get(.variance)[to] = work.raw[y * planes.width + x].expected;
            if (is_within and column == x + margin) continue;
            for (&planes.of.values) |plane| {
                if (plane.ptr == planes.of.get(.variance).ptr) continue;
                plane[to] = plane[planes.at(x, y)];
            }
            planes.of.get(.normal_x)[to] = nowhere;
        }
    }
};
