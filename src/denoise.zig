//! Denoising: a film's noisy image by a joint filter that its other layers guide.
//!
//! In: a finished film with the layers of `needed`. Out: its image, filtered; alpha and all other
//! layers stay. The filter works on light without albedo (`denoise/planes.zig`) by regression with
//! weights of patches (`denoise/filter.zig`), in f32 and a fixed order: the same bits by any number
//! of threads, on every target. Memory is taken before the work.

const std = @import("std");
const film_file = @import("film.zig");
const huge_pages = @import("huge_pages.zig");
const parallel = @import("parallel.zig");
const planes_file = @import("denoise/planes.zig");
const filter = @import("denoise/filter.zig");
const Film = film_file.Film;
const Planes = planes_file.Planes;
const Progress = @import("progress.zig").Progress;
const assert = std.debug.assert;

/// Layers that a film has to have besides its image.
pub const needed: film_file.Layers = .init(.{
    .color = true,
    .albedo = true,
    .normal = true,
    .depth = true,
    .variance = true,
    .halves = true,
});

/// A pixel depends on others no further away, along each side.
pub const reach = filter.margin + planes_file.ratio_radius;

/// Fewer do not say how noisy they are.
pub const sample_count_min = 2;

/// What is said then.
pub const too_few_samples = "it is not denoised: one sample a pixel does not tell its noise";

/// `Canceled`: the image is filtered in part.
pub const Error = error{OutOfMemory} || parallel.Error;

/// Filters the image. Asserts that the film has the layers.
pub fn run(gpa: std.mem.Allocator, film: *Film, pool: *parallel.Pool) Error!void {
    assert(needed.subsetOf(film.layers));
    const image = &film.image;
    var planes: Planes = try .init(gpa, image.width, image.height, filter.margin);
    defer planes.deinit(gpa);
    try planes_file.fill(gpa, &planes, film, pool);
    const columns = std.math.divCeil(u32, image.width, filter.tile_width) catch unreachable;
    const rows = std.math.divCeil(u32, image.height, filter.tile_height) catch unreachable;
    const tile_count = @as(usize, columns) * rows;
    const scratches = try huge_pages.alloc(gpa, filter.Scratch, pool.threadsFor(tile_count));
    defer huge_pages.free(gpa, scratches);
    const work: Work = .{
        .film = film,
        .planes = &planes,
        .columns = columns,
        .scratches = scratches,
        .progress = pool.progress,
    };
    Progress.begin(pool.progress, .{ .stage = .denoising, .total = tile_count });
    try pool.forEach(tile_count, &work, Work.filterTile);
}

const Work = struct {
    film: *Film,
    planes: *const Planes,
    columns: u32,
    scratches: []filter.Scratch,
    progress: ?*Progress,

    fn filterTile(work: *const Work, number: usize, thread_index: usize) void {
        const scratch = &work.scratches[thread_index];
        const image = &work.film.image;
        const x = number % work.columns * filter.tile_width;
        const y = number / work.columns * filter.tile_height;
        const tile: filter.Tile = .{
            .x = x,
            .y = y,
            .width = @min(filter.tile_width, image.width - x),
            .height = @min(filter.tile_height, image.height - y),
        };
        filter.run(work.planes, tile, scratch);
        for (0..tile.height) |row| for (0..tile.width) |column| {
            const at = (y + row) * image.width + x + column;
            const divisor = planes_file.divisorOf(work.film, at);
            for (image.pixels[at][0..3], divisor, scratch.light[row]) |*to, by, light| {
                to.* = @max(light[column], 0) * by;
            }
        };
        Progress.add(work.progress, 1);
    }
};

/// A picture of two walls that meet in the middle column, one of them in shadow, with noise that
/// is drawn anew by `seed`, and what it would be without.
const TestPicture = struct {
    film: Film,
    truth: [height][width]f32,

    const width = 20;
    const height = 9;
    const sample_count = 16;

    fn init(seed: u64, noise: f32) !TestPicture {
        const gpa = std.testing.allocator;
        var layers = needed;
        layers.insert(.alpha);
        var picture: TestPicture = .{
            .film = try .init(gpa, width, height, layers),
            .truth = undefined,
        };
        var state: std.Random.DefaultPrng = .init(seed);
        const random = state.random();
        for (0..height) |y| for (0..width) |x| {
            const at = [2]u32{ @intCast(x), @intCast(y) };
            const is_left = x < width / 2;
            // A wall of two colours, which turns.
            const albedo: f32 = if ((x / 2 + y / 3) % 2 == 0) 0.8 else 0.2;
            const light: f32 = if (is_left) 1 + 0.05 * @as(f32, @floatFromInt(y)) else 0.25;
            const normal: [4]f32 = if (is_left) .{ 0, 0, 1, 0 } else .{ 1, 0, 0, 0 };
            picture.truth[y][x] = albedo * light;
            for (0..sample_count) |sample| {
                const number: u32 = @intCast(sample);
                const value = albedo * light * (1 + noise * (random.float(f32) - 0.5));
                picture.film.add(at[0], at[1], number, .{ value, value, value, 0 });
                const film = &picture.film;
                film.addApart(.albedo, at[0], at[1], number, .{ albedo, albedo, albedo, 0 });
                film.addApart(.normal, at[0], at[1], number, normal);
                film.addApart(.depth, at[0], at[1], number, .{ 3, 0, 0, 1 });
            }
        };
        const all: film_file.Rectangle = .{ .x0 = 0, .y0 = 0, .x1 = width, .y1 = height };
        try std.testing.expectEqual(0, picture.film.finish(all, sample_count));
        return picture;
    }

    fn deinit(picture: *TestPicture) void {
        picture.film.deinit(std.testing.allocator);
    }

    fn denoise(picture: *TestPicture, thread_count: usize) !void {
        var pool: parallel.Pool = .init(thread_count);
        defer pool.deinit();
        try run(std.testing.allocator, &picture.film, &pool);
    }

    /// Mean square of the relative error.
    fn errorOf(picture: *const TestPicture) f32 {
        var sum: f32 = 0;
        for (&picture.truth, 0..) |*row, y| for (row, 0..) |value, x| {
            const pixel = picture.film.image.at(@intCast(x), @intCast(y));
            const part = pixel[1] / value - 1;
            sum += part * part;
        };
        return sum / (width * height);
    }
};

test "noise goes, textures and edges of features stay, the same by any number of threads" {
    var picture: TestPicture = try .init(1, 2);
    defer picture.deinit();
    const before = picture.errorOf();
    try picture.denoise(1);
    // Of 16 samples with a deviation of 0.58 each.
    try std.testing.expect(before > 0.015 and picture.errorOf() < before / 3);
    // The edge is as sharp as it was.
    const row = picture.film.image.pixels[TestPicture.width * 4 ..][0..TestPicture.width];
    for (row, picture.truth[4]) |pixel, truth| {
        try std.testing.expectApproxEqRel(truth, pixel[0], 0.3);
        try std.testing.expectEqual(1, pixel[3]);
    }
    var again: TestPicture = try .init(1, 2);
    defer again.deinit();
    try again.denoise(3);
    try std.testing.expectEqual(picture.film.hash(), again.film.hash());
}

test "what has no noise stays as it is" {
    var picture: TestPicture = try .init(1, 0);
    defer picture.deinit();
    try picture.denoise(1);
    try std.testing.expect(picture.errorOf() < 1e-8);
}

test "a sample that outshines all, shares of pixels and what is not a number" {
    var picture: TestPicture = try .init(2, 1);
    defer picture.deinit();
    const image = &picture.film.image;
    const lone = picture.film.image.at(5, 4);
    const truth = picture.truth[4][5];
    for (lone[0..3]) |*channel| channel.* = 1000;
    for (picture.film.imageOf(.halves).?.at(5, 4)[0..3]) |*channel| channel.* = 1000;
    for (picture.film.imageOf(.variance).?.at(5, 4)[0..3]) |*channel| channel.* = 1e6;
    image.at(15, 2)[3] = 0.5;
    image.at(1, 7).* = @splat(0);
    for ([_]film_file.Layer{ .albedo, .normal, .depth, .variance, .halves }) |layer| {
        picture.film.imageOf(layer).?.at(1, 7).* = .{ 1e30, -1e30, 1e30, 1 };
    }
    try picture.denoise(1);
    try std.testing.expect(lone[0] < 4 * truth);
    try std.testing.expectEqual(0.5, image.at(15, 2)[3]);
    for (image.pixels) |pixel| for (pixel) |channel| {
        try std.testing.expect(channel >= 0 and channel < 3);
    };
}

test "memory that runs out is an error, whenever it does" {
    var picture: TestPicture = try .init(3, 1);
    defer picture.deinit();
    var pool: parallel.Pool = .init(1);
    defer pool.deinit();
    for (0..3) |fail_index| {
        var failing: std.testing.FailingAllocator = .init(std.testing.allocator, .{
            .fail_index = fail_index,
        });
        const result = run(failing.allocator(), &picture.film, &pool);
        try std.testing.expectError(error.OutOfMemory, result);
    }
}

test {
    _ = @import("denoise/regression.zig");
}
