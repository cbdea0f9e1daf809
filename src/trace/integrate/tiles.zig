//! Progressive rendering in square tiles, handed out by one atomic counter.
//!
//! In: an integrator's type, the frame, settings. Out: the film, finished. Passes over the samples
//! come outermost: each visits every tile and doubles its samples, up to 64 more. Those of a pixel
//! are added in order all the same: a thread that comes to a tile whose last pass is under way
//! leaves this one to whoever is at it, who does both. So nobody waits, and no lock is taken.
//!
//! An integrator is a type I with
//!
//!     width, height, counts_tests               pixels of a bundle; whether tests are counted
//!     init(gpa, frame, settings), deinit(gpa)   *I, one a thread
//!     pass(rectangle, first_sample, sample_count, film)   of a bundle or a part of it
//!     counts()                                  of all its passes, `Counts`
//!
//! which is compiled in an object of its own: `Integrator` is what its kernel shows of it.

const std = @import("std");
const choices = @import("../../settings.zig");
const world_file = @import("../../world.zig");
const statistics = @import("../../statistics.zig");
const parallel = @import("../../parallel.zig");
const film_file = @import("../../film.zig");
const sampler = @import("sampler.zig");
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;
const Film = film_file.Film;
const Frame = world_file.Frame;
const Rectangle = film_file.Rectangle;

/// How a frame is traced, and who does the work.
pub const Settings = struct {
    pool: *parallel.Pool,
    integrator: choices.Integrator = .whitted,
    /// Samples a pixel, at least 1.
    sample_count: u32 = choices.sample_count.default,
    /// Where these are in each pixel: `render` fills it in.
    offsets: []const sampler.Offset = &.{},
    /// Bounces after the primary ray, at most `settings.depth.max`.
    depth_max: u32 = choices.depth.default,
    /// Side of a tile in pixels, at least 1.
    tile_size: u32 = choices.tile_size.default,
    /// Told of every finished tile of a pass.
    progress: std.Progress.Node = .none,
    /// Looked at between tiles: set, it ends the work.
    cancel: ?*const std.atomic.Value(bool) = null,

    fn isCancelled(settings: *const Settings) bool {
        return if (settings.cancel) |cancel| cancel.load(.monotonic) else false;
    }
};

/// What an integrator's passes took.
pub const Counts = struct {
    rays: statistics.RayCounts,
    tests: statistics.TestCounts,
};

/// What the frame took.
pub const Statistics = struct {
    rays: statistics.RayCounts = .{},
    /// Null where they were not counted.
    tests: ?statistics.TestCounts = null,
    /// Pixels that came out as not a number and were made black.
    non_finite_count: u64 = 0,
};

/// `Canceled`: the film is not finished.
pub const Error = error{OutOfMemory} || parallel.Error;

/// An integrator behind pointers: only data that the program and the kernel agree on passes here,
/// and no state but what `init` gives.
pub const Integrator = extern struct {
    init: *const fn (*const Allocator, *const Frame, *const Settings) callconv(.c) ?*anyopaque,
    deinit: *const fn (integrator: *anyopaque, gpa: *const Allocator) callconv(.c) void,
    /// The next samples of a tile, bundle by bundle.
    pass: *const fn (*anyopaque, *const Rectangle, u32, u32, *Film) callconv(.c) void,
    counts: *const fn (integrator: *const anyopaque, counts: *Counts) callconv(.c) void,
    counts_tests: bool,

    /// Of the type I.
    pub fn of(comptime I: type) Integrator {
        const erased = struct {
            fn init(
                gpa: *const Allocator,
                frame: *const Frame,
                settings: *const Settings,
            ) callconv(.c) ?*anyopaque {
                return I.init(gpa.*, frame, settings) catch null;
            }

            fn deinit(integrator: *anyopaque, gpa: *const Allocator) callconv(.c) void {
                ofErased(integrator).deinit(gpa.*);
            }

            fn pass(
                integrator: *anyopaque,
                tile: *const Rectangle,
                first_sample: u32,
                sample_count: u32,
                film: *Film,
            ) callconv(.c) void {
                var y = tile.y0;
                while (y < tile.y1) : (y += I.height) {
                    var x = tile.x0;
                    while (x < tile.x1) : (x += I.width) ofErased(integrator).pass(.{
                        .x0 = x,
                        .y0 = y,
                        .x1 = @min(x + I.width, tile.x1),
                        .y1 = @min(y + I.height, tile.y1),
                    }, first_sample, sample_count, film);
                }
            }

            fn counts(integrator: *const anyopaque, result: *Counts) callconv(.c) void {
                result.* = ofErased(@constCast(integrator)).counts();
            }

            fn ofErased(integrator: *anyopaque) *I {
                return @ptrCast(@alignCast(integrator));
            }
        };
        return .{
            .init = erased.init,
            .deinit = erased.deinit,
            .pass = erased.pass,
            .counts = erased.counts,
            .counts_tests = I.counts_tests,
        };
    }
};

/// Traces all samples of all pixels. Memory is taken before the work: where there is too little of
/// it for all threads, some do without the others.
pub fn render(
    integrator: *const Integrator,
    gpa: Allocator,
    frame: *const Frame,
    film: *Film,
    chosen: *const Settings,
) Error!Statistics {
    const offsets = try gpa.alloc(sampler.Offset, chosen.sample_count);
    defer gpa.free(offsets);
    sampler.place(offsets);
    var with_offsets = chosen.*;
    with_offsets.offsets = offsets;
    const settings = &with_offsets;
    var tiles: Tiles = .init(film.image.width, film.image.height, settings);
    tiles.states = try gpa.alloc(Tiles.State, tiles.count);
    defer gpa.free(tiles.states);
    @memset(tiles.states, .{});
    var by_thread: [parallel.thread_count_max]*anyopaque = undefined;
    var job: Job = .{
        .settings = settings,
        .tiles = &tiles,
        .film = film,
        .pass = integrator.pass,
        .by_thread = by_thread[0..0],
    };
    defer for (job.by_thread) |one| integrator.deinit(one, &gpa);
    while (job.by_thread.len < settings.pool.threadsFor(tiles.count)) {
        by_thread[job.by_thread.len] = integrator.init(&gpa, frame, settings) orelse {
            if (job.by_thread.len == 0) return error.OutOfMemory;
            break;
        };
        job.by_thread = by_thread[0 .. job.by_thread.len + 1];
    }
    settings.pool.share(job.by_thread.len, &job, Job.work);
    if (settings.isCancelled()) return error.Canceled;
    var total: Statistics = .{ .non_finite_count = tiles.non_finite_count.load(.monotonic) };
    var tests: statistics.TestCounts = .{};
    for (job.by_thread) |one| {
        var counts: Counts = undefined;
        integrator.counts(one, &counts);
        total.rays.add(counts.rays);
        tests.add(counts.tests);
    }
    if (integrator.counts_tests) total.tests = tests;
    return total;
}

/// One frame by one integrator.
const Job = struct {
    settings: *const Settings,
    tiles: *Tiles,
    film: *Film,
    pass: @FieldType(Integrator, "pass"),
    by_thread: []const *anyopaque,

    fn work(job: *Job, thread_index: usize) void {
        while (!job.settings.isCancelled()) {
            const number = job.tiles.take() orelse return;
            const state = &job.tiles.states[number];
            if (state.due.fetchAdd(1, .acquire) > 0) continue;
            while (true) {
                job.passTile(job.by_thread[thread_index], number);
                job.settings.progress.completeOne();
                if (job.settings.isCancelled()) return;
                if (state.due.fetchSub(1, .acq_rel) == 1) break;
            }
        }
    }

    /// The next samples of a tile.
    fn passTile(job: *Job, integrator: *anyopaque, number: u32) void {
        const state = &job.tiles.states[number];
        const tile = job.tiles.rectangleOf(number);
        const sample_count = passSamples(state.samples_done, job.settings.sample_count);
        job.pass(integrator, &tile, state.samples_done, sample_count, job.film);
        state.samples_done += sample_count;
        if (state.samples_done < job.settings.sample_count) return;
        const non_finite = job.film.finish(tile, job.settings.sample_count);
        if (non_finite == 0) return;
        _ = job.tiles.non_finite_count.fetchAdd(@intCast(non_finite), .monotonic);
    }
};

/// Samples of a tile's next pass: as many as it has, lest each ray finds the cache cold; and few
/// enough that the work ends soon after it is told to.
fn passSamples(samples_done: u32, sample_count: u32) u32 {
    return @min(sample_count - samples_done, @min(@max(samples_done, 1), 64));
}

/// The picture in tiles, each as often as there are passes.
const Tiles = struct {
    next: std.atomic.Value(u32) align(std.atomic.cache_line) = .init(0),
    width: u32,
    height: u32,
    size: u32,
    columns: u32,
    count: u32,
    pass_count: u32,
    non_finite_count: std.atomic.Value(usize) = .init(0),
    /// By tile.
    states: []State = &.{},

    const State = struct {
        /// Passes that have been handed out and are not finished. Who makes it 1 has the tile until
        /// it is 0 again.
        due: std.atomic.Value(u32) = .init(0),
        samples_done: u32 = 0,
    };

    /// Passes of all tiles at most. Threads overshoot the counter by one each.
    const count_max = 1 << 31;
    /// More than 4096 samples take.
    const passes_max = 128;

    /// Asserts that no size is 0. A side of a tile is raised where there would be too many.
    fn init(width: u32, height: u32, settings: *const Settings) Tiles {
        const sample_count = settings.sample_count;
        var size = settings.tile_size;
        assert(width > 0 and height > 0 and size > 0 and sample_count > 0);
        while (@as(u64, @divCeil(width, size)) * @divCeil(height, size) > count_max / passes_max)
            size *= 2;
        const columns = @divCeil(width, size);
        const count = columns * @divCeil(height, size);
        var pass_count: u32 = 0;
        var done: u32 = 0;
        while (done < sample_count) : (pass_count += 1) done += passSamples(done, sample_count);
        return .{
            .width = width,
            .height = height,
            .size = size,
            .columns = columns,
            .count = count,
            .pass_count = pass_count,
        };
    }

    /// The number of the next tile that is due, or null where all passes are handed out.
    fn take(tiles: *Tiles) ?u32 {
        const index = tiles.next.fetchAdd(1, .monotonic);
        return if (index < tiles.count * tiles.pass_count) index % tiles.count else null;
    }

    fn rectangleOf(tiles: *const Tiles, number: u32) Rectangle {
        const x0 = (number % tiles.columns) * tiles.size;
        const y0 = (number / tiles.columns) * tiles.size;
        return .{
            .x0 = x0,
            .y0 = y0,
            .x1 = x0 + @min(tiles.size, tiles.width - x0),
            .y1 = y0 + @min(tiles.size, tiles.height - y0),
        };
    }
};

test "every pixel is in exactly one tile, and every tile is due once a pass" {
    var pool: parallel.Pool = .init(1);
    defer pool.deinit();
    for ([_][3]u32{ .{ 1, 1, 1 }, .{ 7, 5, 3 }, .{ 64, 64, 16 }, .{ 3, 100, 256 } }) |case| {
        var covered: [100 * 100]u8 = @splat(0);
        var tiles: Tiles = .init(case[0], case[1], &.{
            .pool = &pool,
            .tile_size = case[2],
            .sample_count = 3,
        });
        while (tiles.take()) |number| {
            const tile = tiles.rectangleOf(number);
            for (tile.y0..tile.y1) |y| {
                for (tile.x0..tile.x1) |x| covered[y * case[0] + x] += 1;
            }
        }
        const pixel_count = case[0] * case[1];
        for (covered[0..pixel_count]) |times| try std.testing.expectEqual(3, times);
        try std.testing.expectEqual(null, tiles.take());
    }
}

test "huge pictures have a countable number of tiles" {
    var pool: parallel.Pool = .init(1);
    defer pool.deinit();
    const tiles: Tiles = .init(65536, 65536, &.{
        .pool = &pool,
        .tile_size = 1,
        .sample_count = 4096,
    });
    try std.testing.expect(@as(u64, tiles.count) * tiles.pass_count <= Tiles.count_max);
    try std.testing.expect(tiles.pass_count <= Tiles.passes_max);
}

/// Counts samples, and holds that each pixel gets its own in order.
const TestIntegrator = struct {
    const width = 4;
    const height = 2;
    const counts_tests = false;
    /// Sets the flag after so many bundles.
    var bundles_left: std.atomic.Value(i32) = .init(0);
    var cancel: std.atomic.Value(bool) = .init(false);

    fn init(gpa: Allocator, _: *const Frame, _: *const Settings) error{OutOfMemory}!*@This() {
        return gpa.create(@This());
    }

    fn deinit(integrator: *@This(), gpa: Allocator) void {
        gpa.destroy(integrator);
    }

    fn counts(_: *const @This()) Counts {
        return .{ .rays = .{}, .tests = .{} };
    }

    fn pass(_: *@This(), rectangle: Rectangle, first: u32, count: u32, film: *Film) void {
        if (bundles_left.fetchSub(1, .monotonic) == 1) cancel.store(true, .monotonic);
        for (rectangle.y0..rectangle.y1) |y| for (rectangle.x0..rectangle.x1) |x| {
            for (first..first + count) |sample| {
                // The sum is right in this order alone: it doubles, and then some.
                const pixel = film.image.at(@intCast(x), @intCast(y)).*;
                const before = if (sample == 0) 0 else pixel[0];
                const value = before + @as(f32, @floatFromInt(sample));
                film.add(@intCast(x), @intCast(y), @intCast(sample), @splat(value));
            }
        };
    }
};

test "the samples of each pixel come in order, by however many threads; a flag ends the work" {
    const gpa = std.testing.allocator;
    const sample_count = 9;
    var expected: f32 = 0;
    for (0..sample_count) |sample| expected += expected + @as(f32, @floatFromInt(sample));
    const frame: Frame = undefined;
    for ([_]usize{ 1, 2, 5 }) |thread_count| for ([_]u32{ 1, 3, 40 }) |tile_size| {
        for ([_]bool{ false, true }) |is_cancelled| {
            var pool: parallel.Pool = .init(thread_count);
            defer pool.deinit();
            var film: Film = try .init(gpa, 21, 17, .init(.{ .color = true }));
            defer film.deinit(gpa);
            TestIntegrator.bundles_left.store(if (is_cancelled) 3 else -1, .monotonic);
            TestIntegrator.cancel.store(false, .monotonic);
            const result = render(&.of(TestIntegrator), gpa, &frame, &film, &.{
                .pool = &pool,
                .sample_count = sample_count,
                .tile_size = tile_size,
                .cancel = &TestIntegrator.cancel,
            });
            if (is_cancelled) {
                try std.testing.expectError(error.Canceled, result);
                continue;
            }
            _ = try result;
            for (film.image.pixels) |pixel| {
                try std.testing.expectEqual(expected / sample_count, pixel[0]);
            }
        }
    };
}
