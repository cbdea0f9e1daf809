//! Progressive rendering in square tiles, handed out by one atomic counter.
//!
//! In: an integrator's type, the frame, settings. Out: the film, finished. Passes over the samples
//! come outermost: each visits every tile and doubles its samples, up to 64 more. Those of a pixel
//! are added in order all the same: a thread that comes to a tile whose last pass is under way
//! leaves this one to whoever is at it, who does both. So nobody waits, and no lock is taken.
//!
//! Where a `Course` says what comes next, passes are in rounds: after each, all threads have ended
//! and all pixels that get more samples have as many. What is added is the same either way. With
//! `Settings.noise` blocks end one by one, by passes of their own alone (adaptive.zig).
//!
//! An integrator is a type I with
//!
//!     width, height, counts_tests               pixels of a bundle; whether tests are counted
//!     init(gpa, frame, settings), deinit(gpa)   *I, one a thread
//!     pass(rectangle, first_sample, sample_count, film)   of a bundle or a part of it, whose
//!                                               places on the film `Rectangle.placeOf` says
//!     counts()                                  of all its passes, `Counts`
//!     tile_step                                 tiles' sides are multiples of it; none: of 1
//!     Shared                                    what all threads' share; none, void: nothing
//!
//! which is compiled in an object of its own: `Integrator` is what its kernel shows of it.

const std = @import("std");
const choices = @import("../../settings.zig");
const world_file = @import("../../world.zig");
const statistics = @import("../../statistics.zig");
const parallel = @import("../../parallel.zig");
const adaptive = @import("adaptive.zig");
const Diagnostic = @import("../../diagnostic.zig").Diagnostic;
const film_file = @import("../../film.zig");
const sampler = @import("sampler.zig");
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;
const Film = film_file.Film;
const Layout = film_file.Layout;
const Frame = world_file.Frame;
const Aov = @import("aov.zig").Aov;
const progress_file = @import("../../progress.zig");
const Progress = progress_file.Progress;
const Rectangle = film_file.Rectangle;

/// How a frame is traced, and who does the work.
pub const Settings = struct {
    pool: *parallel.Pool,
    integrator: choices.Integrator = .whitted,
    lights: choices.Lights = .{},
    /// Samples a pixel, at least 1; those of integrators that are open may not depend on it, which
    /// find `open_sample_count` here.
    sample_count: u32 = choices.sample_count.default,
    /// Where these are in each pixel: `render` fills it in.
    offsets: []const sampler.Offset = &.{},
    /// Bounces after the primary ray, at most `settings.depth.max`.
    depth_max: u32 = choices.depth.default,
    /// Side of a tile in pixels, at least 1.
    tile_size: u32 = choices.tile_size.default,
    /// Told of the rays and of every finished tile of a pass; null: nobody is.
    progress: ?*Progress = null,
    /// Looked at between tiles: set, it ends the work.
    cancel: ?*const std.atomic.Value(bool) = null,
    /// Looked at between tiles: set, it ends the work as soon as every pixel has a sample, and the
    /// picture is what there is.
    stop: ?*const std.atomic.Value(bool) = null,
    /// Blocks with less of it get no more samples. Asserts that the integrator is open.
    noise: ?adaptive.Noise = null,
    /// Null: all samples in one round.
    course: ?Course = null,
    /// Of the integrator of these.
    aov: Aov = .hits,
    /// Which pixels; null: all of the picture, as `render` fills in.
    layout: ?*const Layout = null,
    /// The integrator's `Shared`: `render` fills it in.
    shared: ?*anyopaque = null,

    fn isCancelled(settings: *const Settings) bool {
        return if (settings.cancel) |cancel| cancel.load(.monotonic) else false;
    }

    fn isStopped(settings: *const Settings) bool {
        return if (settings.stop) |stop| stop.load(.monotonic) else false;
    }
};

/// What integrators that are open take their number of samples to be, where details depend on it.
pub const open_sample_count = 16;

/// What decides, between rounds, how the work goes on.
pub const Course = struct {
    context: *anyopaque,
    /// Called while nobody traces. Returns how many samples pixels are to have after the next
    /// round; the work ends where they have as many.
    next: *const fn (context: *anyopaque, standing: *const Standing) u32,
    /// What it goes by, if it is a time.
    budget_ns: ?u64 = null,
};

/// Where the work stands between rounds.
pub const Standing = struct {
    /// Of all pixels that get more.
    samples_done: u32,
    job: *const Job,

    /// Makes another film, of the same size and layers, what the picture is so far.
    pub fn copyTo(standing: *const Standing, film: *Film) parallel.Error!void {
        const job = standing.job;
        const copy: Copy = .{ .job = job, .film = film };
        try job.settings.pool.forEach(job.tiles.count, &copy, Copy.tile);
        const shared = job.integrator.shared orelse return;
        _ = job.doSteps(shared.steps_before, shared.step_count, film, null);
    }

    const Copy = struct {
        job: *const Job,
        film: *Film,

        fn tile(copy: *const Copy, number: usize, _: usize) void {
            var parts = copy.job.partsOf(@intCast(number));
            while (parts.next()) |part| {
                copy.job.film.copyFinished(copy.film, part.rectangle, part.sample_count);
            }
        }
    };
};

/// What an integrator's passes took.
pub const Counts = struct {
    rays: statistics.RayCounts,
    tests: statistics.TestCounts,
    cuts: statistics.CutCounts = .{},
};

/// What the frame took.
pub const Statistics = struct {
    rays: statistics.RayCounts = .{},
    /// Null where they were not counted.
    tests: ?statistics.TestCounts = null,
    cuts: statistics.CutCounts = .{},
    /// Pixels that came out as not a number and were made black.
    non_finite_count: u64 = 0,
    /// Of the pixels that have the most.
    sample_count: u32 = 0,
    /// Of all pixels that were traced, and how many these are.
    sample_sum: u64 = 0,
    pixel_count: u64 = 0,
    /// The work was stopped before its end.
    is_partial: bool = false,
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
    tile_step: u32,
    shared: ?*const Shared,

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
                        .shift = tile.shift,
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
            .tile_step = if (@hasDecl(I, "tile_step")) I.tile_step else 1,
            .shared = if (@hasDecl(I, "Shared") and I.Shared != void) &Shared.of(I) else null,
        };
    }
};

/// What the integrators of all threads have in common, behind pointers. Its work comes in steps,
/// some before the tiles and the rest after them, each of which is cut into pieces that threads
/// take in any order. A type I.Shared has
///
///     steps_before, step_count
///     init(gpa, frame, settings), deinit(gpa)
///     pieces(step)                              how many
///     work(integrator, step, piece, film)       returns how many pixels it made black
///
/// The steps after the tiles do nothing but change the film, which may be a copy.
const Shared = extern struct {
    init: *const fn (*const Allocator, *const Frame, *const Settings) callconv(.c) ?*anyopaque,
    deinit: *const fn (shared: *anyopaque, gpa: *const Allocator) callconv(.c) void,
    pieces: *const fn (shared: *const anyopaque, step: u32) callconv(.c) u32,
    work: *const fn (*anyopaque, *anyopaque, u32, u32, *Film) callconv(.c) u64,
    steps_before: u32,
    step_count: u32,

    fn of(comptime I: type) Shared {
        const erased = struct {
            fn init(
                gpa: *const Allocator,
                frame: *const Frame,
                settings: *const Settings,
            ) callconv(.c) ?*anyopaque {
                return I.Shared.init(gpa.*, frame, settings) catch null;
            }

            fn deinit(shared: *anyopaque, gpa: *const Allocator) callconv(.c) void {
                ofErased(shared).deinit(gpa.*);
            }

            fn pieces(shared: *const anyopaque, step: u32) callconv(.c) u32 {
                return ofErased(@constCast(shared)).pieces(step);
            }

            fn work(
                shared: *anyopaque,
                integrator: *anyopaque,
                step: u32,
                piece: u32,
                film: *Film,
            ) callconv(.c) u64 {
                const one: *I = @ptrCast(@alignCast(integrator));
                return ofErased(shared).work(one, step, piece, film);
            }

            fn ofErased(shared: *anyopaque) *I.Shared {
                return @ptrCast(@alignCast(shared));
            }
        };
        return .{
            .init = erased.init,
            .deinit = erased.deinit,
            .pieces = erased.pieces,
            .work = erased.work,
            .steps_before = I.Shared.steps_before,
            .step_count = I.Shared.step_count,
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
    var with_tiles = chosen.*;
    with_tiles.tile_size = @divCeil(chosen.tile_size, integrator.tile_step) * integrator.tile_step;
    const whole: Layout = .whole(film.image.width, film.image.height);
    if (with_tiles.layout == null) with_tiles.layout = &whole;
    const settings = &with_tiles;
    const layout = settings.layout.?;
    var shown = withSamples(settings, offsets);
    if (integrator.shared) |shared|
        shown.shared = shared.init(&gpa, frame, &shown) orelse return error.OutOfMemory;
    defer if (integrator.shared) |shared| shared.deinit(shown.shared.?, &gpa);
    assert(film.image.width == layout.film_width and film.image.height == layout.film_height);
    var blocks: ?adaptive.Blocks = null;
    defer if (blocks) |*all| all.deinit(gpa);
    if (settings.noise) |noise| {
        assert(settings.integrator.isOpen());
        blocks = try .init(gpa, layout, noise);
    }
    var tiles: Tiles = .init(layout, settings);
    tiles.states = try gpa.alloc(Tiles.State, tiles.count);
    defer gpa.free(tiles.states);
    @memset(tiles.states, .{});
    var by_thread: [parallel.thread_count_max]*anyopaque = undefined;
    var job: Job = .{
        .settings = settings,
        .shared = shown.shared,
        .tiles = &tiles,
        .blocks = if (blocks) |*all| all else null,
        .film = film,
        .integrator = integrator,
        .by_thread = by_thread[0..0],
    };
    defer for (job.by_thread) |one| integrator.deinit(one, &gpa);
    while (job.by_thread.len < settings.pool.threadsFor(tiles.count)) {
        by_thread[job.by_thread.len] = integrator.init(&gpa, frame, &shown) orelse {
            if (job.by_thread.len == 0) return error.OutOfMemory;
            break;
        };
        job.by_thread = by_thread[0 .. job.by_thread.len + 1];
    }
    const progress = settings.progress;
    if (integrator.shared) |shared| _ = job.doSteps(0, shared.steps_before, film, progress);
    const is_whole = job.run();
    if (settings.isCancelled()) return error.Canceled;
    var total = try job.finish(is_whole);
    if (integrator.shared) |shared| total.non_finite_count +=
        job.doSteps(shared.steps_before, shared.step_count, film, progress);
    var tests: statistics.TestCounts = .{};
    for (job.by_thread) |one| {
        var counts: Counts = undefined;
        integrator.counts(one, &counts);
        total.rays.add(counts.rays);
        tests.add(counts.tests);
        total.cuts.add(counts.cuts);
    }
    if (integrator.counts_tests) total.tests = tests;
    return total;
}

/// Settings as integrators find them, with places for all samples.
fn withSamples(chosen: *const Settings, offsets: []sampler.Offset) Settings {
    var shown = chosen.*;
    shown.offsets = offsets;
    if (chosen.integrator.isOpen()) {
        sampler.placeInSequence(offsets);
        shown.sample_count = open_sample_count;
    } else sampler.place(offsets);
    return shown;
}

/// Has the integrator of AOVs leave hits on the film's layer of origins, of the first sample of
/// those that the picture has by these settings; all else of the film stays.
pub fn fillHits(
    integrator: *const Integrator,
    gpa: Allocator,
    frame: *const Frame,
    film: *Film,
    chosen: *const Settings,
) Error!void {
    assert(integrator.shared == null and chosen.aov == .hits);
    const offsets = try gpa.alloc(sampler.Offset, chosen.sample_count);
    defer gpa.free(offsets);
    const shown = withSamples(chosen, offsets);
    const whole: Layout = .whole(film.image.width, film.image.height);
    const tiles: Tiles = .init(chosen.layout orelse &whole, &shown);
    const nothing: f32 = @bitCast(film_file.no_triangle);
    @memset(film.imageOf(.origin).?.pixels, .{ nothing, 0, 0, 0 });
    var by_thread: [parallel.thread_count_max]*anyopaque = undefined;
    var count: usize = 0;
    defer for (by_thread[0..count]) |one| integrator.deinit(one, &gpa);
    while (count < chosen.pool.threadsFor(tiles.count)) : (count += 1) {
        by_thread[count] = integrator.init(&gpa, frame, &shown) orelse return error.OutOfMemory;
    }
    const Hits = struct {
        integrator: *const Integrator,
        tiles: *const Tiles,
        film: *Film,
        by_thread: []const *anyopaque,

        fn tile(hits: *const @This(), number: usize, thread_index: usize) void {
            const rectangle = hits.tiles.rectangleOf(@intCast(number));
            hits.integrator.pass(hits.by_thread[thread_index], &rectangle, 0, 1, hits.film);
        }
    };
    const work: Hits = .{
        .integrator = integrator,
        .tiles = &tiles,
        .film = film,
        .by_thread = by_thread[0..count],
    };
    try chosen.pool.forEach(tiles.count, &work, Hits.tile);
}

/// One frame by one integrator.
const Job = struct {
    settings: *const Settings,
    tiles: *Tiles,
    blocks: ?*adaptive.Blocks,
    film: *Film,
    integrator: *const Integrator,
    /// See `Settings.shared`.
    shared: ?*anyopaque,
    by_thread: []const *anyopaque,

    /// Work that is shared, from one step to before another. Returns how many pixels were made
    /// black.
    fn doSteps(
        job: *const Job,
        first: u32,
        end: u32,
        film: *Film,
        progress: ?*Progress,
    ) u64 {
        var steps: Steps = .{ .job = job, .film = film, .progress = progress };
        for (first..end) |step| {
            steps.step = @intCast(step);
            steps.piece_count = job.integrator.shared.?.pieces(job.shared.?, steps.step);
            steps.next.store(0, .monotonic);
            Progress.begin(progress, .{ .stage = .lights, .total = steps.piece_count });
            const thread_count = @min(job.by_thread.len, steps.piece_count);
            if (thread_count > 0) job.settings.pool.share(thread_count, &steps, Steps.work);
        }
        return steps.non_finite_count.load(.monotonic);
    }

    const Steps = struct {
        job: *const Job,
        film: *Film,
        progress: ?*Progress,
        /// Under way.
        step: u32 = 0,
        piece_count: u32 = 0,
        next: std.atomic.Value(u32) = .init(0),
        non_finite_count: std.atomic.Value(usize) = .init(0),

        fn work(steps: *Steps, thread_index: usize) void {
            const job = steps.job;
            const shared = job.integrator.shared.?;
            while (!job.settings.isCancelled()) {
                const piece = steps.next.fetchAdd(1, .monotonic);
                if (piece >= steps.piece_count) return;
                const one = job.by_thread[thread_index];
                const count = shared.work(job.shared.?, one, steps.step, piece, steps.film);
                if (count > 0) _ = steps.non_finite_count.fetchAdd(@intCast(count), .monotonic);
                Progress.add(steps.progress, 1);
            }
        }
    };

    /// All rounds; false: the work was ended before.
    fn run(job: *Job) bool {
        const settings = job.settings;
        const tiles = job.tiles;
        var done: u32 = 0;
        job.tellBegin();
        while (done < settings.sample_count) : (done = tiles.samples_due) {
            if (done > 0 and job.isEnded()) return false;
            const until = if (settings.course) |course|
                course.next(course.context, &.{ .samples_done = done, .job = job })
            else
                settings.sample_count;
            if (until <= done) return true;
            tiles.begin(done, @min(until, settings.sample_count));
            settings.pool.share(job.by_thread.len, job, work);
            if (job.isEnded()) for (tiles.states) |*state| {
                if (state.samples_done < tiles.samples_due) return false;
            };
            if (job.blocks) |blocks| if (blocks.active_count.load(.monotonic) == 0) return true;
        }
        return true;
    }

    fn isEnded(job: *const Job) bool {
        if (job.settings.isCancelled()) return true;
        return job.settings.isStopped() and job.tiles.isEachTaken();
    }

    /// Tells the progress of the tiles, each as often as there are samples; of blocks, each of
    /// which may have enough sooner, where they are judged.
    fn tellBegin(job: *const Job) void {
        const settings = job.settings;
        const count: u64 = if (job.blocks) |blocks|
            blocks.active_count.load(.monotonic)
        else
            job.tiles.count;
        Progress.begin(settings.progress, .{
            .stage = .tracing,
            .total = count * settings.sample_count,
            .pieces_per_unit = count,
            .budget_ns = if (settings.course) |course| course.budget_ns else null,
        });
    }

    /// Rays of a thread so far, where somebody is told of them.
    fn raysOf(job: *const Job, thread_index: usize) u64 {
        if (job.settings.progress == null) return 0;
        var counts: Counts = undefined;
        job.integrator.counts(job.by_thread[thread_index], &counts);
        return counts.rays.primary + counts.rays.shadow + counts.rays.secondary;
    }

    fn work(job: *Job, thread_index: usize) void {
        const progress = job.settings.progress;
        var told = job.raysOf(thread_index);
        while (!job.isEnded()) {
            const number = job.tiles.take() orelse return;
            const state = &job.tiles.states[number];
            if (state.due.fetchAdd(1, .acquire) > 0) continue;
            while (true) {
                Progress.add(progress, job.passTile(job.by_thread[thread_index], number));
                const rays = job.raysOf(thread_index);
                Progress.addRays(progress, rays - told);
                told = rays;
                if (job.isEnded()) return;
                if (state.due.fetchSub(1, .acq_rel) == 1) break;
            }
        }
    }

    /// The next samples of a tile. Returns how many pieces that are, see `tellBegin`.
    fn passTile(job: *Job, integrator: *anyopaque, number: u32) usize {
        const state = &job.tiles.states[number];
        const tile = job.tiles.rectangleOf(number);
        const done = state.samples_done;
        const sample_count = passSamples(done, job.tiles.samples_due);
        state.samples_done = done + sample_count;
        if (job.blocks) |blocks| {
            const on_film = tile.onFilm();
            var all = blocks.of(on_film);
            while (all.nextActive()) |active| {
                const rectangle = tile.ofFilm(active);
                job.integrator.pass(integrator, &rectangle, done, sample_count, job.film);
            }
            const judged = blocks.judge(on_film, job.film, done + sample_count);
            // Those that have enough count as if they had all.
            const saved = job.settings.sample_count - (done + sample_count);
            return judged.active_before * sample_count + judged.finished * saved;
        }
        job.integrator.pass(integrator, &tile, done, sample_count, job.film);
        return sample_count;
    }

    /// A tile of the film in parts whose pixels have the same number of samples.
    fn partsOf(job: *const Job, number: u32) Parts {
        const tile = job.tiles.rectangleOf(number).onFilm();
        const sample_count = job.tiles.states[number].samples_done;
        const blocks = job.blocks orelse
            return .{ .whole = .{ .rectangle = tile, .sample_count = sample_count } };
        return .{ .blocks = blocks.of(tile) };
    }

    const Part = struct { rectangle: Rectangle, sample_count: u32 };

    const Parts = union(enum) {
        whole: ?Part,
        blocks: adaptive.Blocks.Iterator,

        fn next(parts: *Parts) ?Part {
            switch (parts.*) {
                .whole => |*whole| {
                    defer whole.* = null;
                    return whole.*;
                },
                .blocks => |*blocks| {
                    const block = blocks.next() orelse return null;
                    return .{
                        .rectangle = block.rectangle,
                        .sample_count = block.state.sample_count,
                    };
                },
            }
        }
    };

    /// Makes means of sums, of all tiles.
    fn finish(job: *Job, is_whole: bool) parallel.Error!Statistics {
        const finished = try job.settings.pool
            .reduce(Finished, .{}, Finished.add, job.tiles.count, job, finishTile);
        return .{
            .non_finite_count = finished.non_finite_count,
            .sample_count = finished.sample_count,
            .sample_sum = finished.sample_sum,
            .pixel_count = job.tiles.layout.tracedCount(),
            .is_partial = !is_whole,
        };
    }

    fn finishTile(job: *Job, number: usize, sum: *Finished) void {
        var parts = job.partsOf(@intCast(number));
        while (parts.next()) |part| {
            const rectangle = part.rectangle;
            sum.non_finite_count += job.film.finish(rectangle, part.sample_count);
            sum.sample_count = @max(sum.sample_count, part.sample_count);
            sum.sample_sum += rectangle.pixelCount() * part.sample_count;
        }
    }
};

/// Of tiles that are finished, see `Statistics`: small, since each thread has one on the stack.
const Finished = struct {
    non_finite_count: u64 = 0,
    sample_count: u32 = 0,
    sample_sum: u64 = 0,

    fn add(sum: *Finished, other: *const Finished) void {
        sum.non_finite_count += other.non_finite_count;
        sum.sample_count = @max(sum.sample_count, other.sample_count);
        sum.sample_sum += other.sample_sum;
    }
};

/// Samples of a tile's next pass: as many as it has, lest each ray finds the cache cold; and few
/// enough that the work ends soon after it is told to. Every power of two is the end of one,
/// wherever rounds begin.
fn passSamples(samples_done: u32, samples_due: u32) u32 {
    if (samples_done == 0) return 1;
    const power = std.math.log2_int(u32, samples_done) + 1;
    const rest = (@as(u64, 1) << power) - samples_done;
    return @min(samples_due - samples_done, @min(@as(u32, @intCast(rest)), 64));
}

/// What is traced in tiles, each as often as there are passes.
const Tiles = struct {
    next: std.atomic.Value(u32) align(std.atomic.cache_line) = .init(0),
    layout: *const Layout,
    /// Side of a tile where there is one window, and how many there are in a row of it; windows of
    /// several are tiles themselves.
    size: u32,
    columns: u32,
    count: u32,
    /// Of the round.
    pass_count: u32 = 0,
    is_first_round: bool = true,
    /// Of a pixel, at the end of the round.
    samples_due: u32 = 0,
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
    fn init(layout: *const Layout, settings: *const Settings) Tiles {
        const width, const height = .{ layout.film_width, layout.film_height };
        var size = settings.tile_size;
        assert(width > 0 and height > 0 and size > 0 and settings.sample_count > 0);
        if (settings.noise != null) size = std.mem.alignForward(u32, size, adaptive.block_side);
        while (@as(u64, @divCeil(width, size)) * @divCeil(height, size) > count_max / passes_max)
            size *= 2;
        const columns = @divCeil(width, size);
        return .{
            .layout = layout,
            .size = size,
            .columns = columns,
            .count = switch (layout.form) {
                .window => columns * @divCeil(height, size),
                .share => layout.count(),
            },
        };
    }

    /// Begins a round, in which pixels that have so many samples get more.
    fn begin(tiles: *Tiles, samples_done: u32, samples_due: u32) void {
        tiles.next.store(0, .monotonic);
        tiles.is_first_round = samples_done == 0;
        tiles.samples_due = samples_due;
        tiles.pass_count = 0;
        var done = samples_done;
        while (done < samples_due) : (tiles.pass_count += 1) done += passSamples(done, samples_due);
    }

    /// The number of the next tile that is due, or null where all passes are handed out.
    fn take(tiles: *Tiles) ?u32 {
        const index = tiles.next.fetchAdd(1, .monotonic);
        return if (index < tiles.count * tiles.pass_count) index % tiles.count else null;
    }

    /// Whether every tile's first pass is done or under way.
    fn isEachTaken(tiles: *const Tiles) bool {
        return !tiles.is_first_round or tiles.next.load(.monotonic) >= tiles.count;
    }

    fn rectangleOf(tiles: *const Tiles, number: u32) Rectangle {
        if (tiles.layout.form == .share) return tiles.layout.windowAt(number).traced;
        const all = tiles.layout.windowAt(0).traced;
        const x0 = all.x0 + (number % tiles.columns) * tiles.size;
        const y0 = all.y0 + (number / tiles.columns) * tiles.size;
        return .{
            .x0 = x0,
            .y0 = y0,
            .x1 = x0 + @min(tiles.size, all.x1 - x0),
            .y1 = y0 + @min(tiles.size, all.y1 - y0),
            .shift = all.shift,
        };
    }
};

test "every pixel is in exactly one tile, and every tile is due once a pass" {
    var pool: parallel.Pool = .init(1);
    defer pool.deinit();
    for ([_][3]u32{ .{ 1, 1, 1 }, .{ 7, 5, 3 }, .{ 64, 64, 16 }, .{ 3, 100, 256 } }) |case| {
        var covered: [100 * 100]u8 = @splat(0);
        var tiles: Tiles = .init(&.whole(case[0], case[1]), &.{
            .pool = &pool,
            .tile_size = case[2],
        });
        tiles.begin(0, 3);
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
    var tiles: Tiles = .init(&.whole(65536, 65536), &.{ .pool = &pool, .tile_size = 1 });
    tiles.begin(0, 4096);
    try std.testing.expect(@as(u64, tiles.count) * tiles.pass_count <= Tiles.count_max);
    try std.testing.expect(tiles.pass_count <= Tiles.passes_max);
}

test "every power of two is the end of a pass, wherever rounds begin" {
    for (0..300) |begin| {
        var done: u32 = @intCast(begin);
        while (done < 1000) {
            const next = done + passSamples(done, 1000);
            const power = std.math.ceilPowerOfTwoAssert(u32, done + 1);
            try std.testing.expect(next <= power);
            try std.testing.expect(next > done and next <= done + 64);
            done = next;
        }
    }
}

/// Counts samples, and holds that each pixel gets its own in order.
const TestIntegrator = struct {
    const width = 4;
    const height = 2;
    const counts_tests = false;
    /// Sets the flag after so many bundles.
    var bundles_left: std.atomic.Value(i32) = .init(0);
    var end: std.atomic.Value(bool) = .init(false);

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
        if (bundles_left.fetchSub(1, .monotonic) == 1) end.store(true, .monotonic);
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

    /// What pixels are with so many samples.
    fn meanOf(sample_count: usize) f32 {
        var sum: f32 = 0;
        for (0..sample_count) |sample| sum += sum + @as(f32, @floatFromInt(sample));
        return sum / @as(f32, @floatFromInt(sample_count));
    }

    /// Three rounds, then no more.
    const rounds = struct {
        const ends = [_]u32{ 3, 4, 7 };

        fn next(context: *anyopaque, standing: *const Standing) u32 {
            const copy: *Film = @ptrCast(@alignCast(context));
            if (standing.samples_done > 0) standing.copyTo(copy) catch return 0;
            for (ends) |round_end| if (standing.samples_done < round_end) return round_end;
            return 0;
        }
    };
};

test "the samples of each pixel come in order, by however many threads; flags end the work" {
    const gpa = std.testing.allocator;
    const frame: Frame = undefined;
    const End = enum { done, cancelled, stopped };
    for ([_]usize{ 1, 2, 5 }) |thread_count| for ([_]u32{ 1, 3, 40 }) |tile_size| {
        for (std.enums.values(End)) |end| for ([_]bool{ false, true }) |has_course| {
            var pool: parallel.Pool = .init(thread_count);
            defer pool.deinit();
            var film: Film = try .init(gpa, 21, 17, .init(.{ .color = true }));
            defer film.deinit(gpa);
            var copy: Film = try .init(gpa, 21, 17, film.layers);
            defer copy.deinit(gpa);
            TestIntegrator.bundles_left.store(if (end == .done) -1 else 3, .monotonic);
            TestIntegrator.end.store(false, .monotonic);
            const result = render(&.of(TestIntegrator), gpa, &frame, &film, &.{
                .pool = &pool,
                .sample_count = 9,
                .tile_size = tile_size,
                .cancel = if (end == .cancelled) &TestIntegrator.end else null,
                .stop = if (end == .stopped) &TestIntegrator.end else null,
                .course = if (!has_course) null else .{
                    .context = &copy,
                    .next = TestIntegrator.rounds.next,
                },
            });
            if (end == .cancelled) {
                try std.testing.expectError(error.Canceled, result);
                continue;
            }
            const most: u32 = if (has_course) 7 else 9;
            const total = try result;
            var sum: u64 = 0;
            for (film.image.pixels) |pixel| {
                const sample_count = for (1..most + 1) |count| {
                    if (TestIntegrator.meanOf(count) == pixel[0]) break count;
                } else return error.SamplesOutOfOrder;
                if (end == .done) try std.testing.expectEqual(most, sample_count);
                sum += sample_count;
            }
            try std.testing.expectEqual(sum, total.sample_sum);
            try std.testing.expectEqual(end == .stopped, total.is_partial);
            if (end == .done) try std.testing.expectEqual(most, total.sample_count);
            if (end == .done and has_course) for (copy.image.pixels) |pixel| {
                try std.testing.expectEqual(TestIntegrator.meanOf(most), pixel[0]);
            };
        };
    };
}

/// White noise beside a quiet part.
const NoisyIntegrator = struct {
    const width = 8;
    const height = 8;
    const counts_tests = false;
    const quiet_width = 20;

    fn init(
        gpa: Allocator,
        _: *const Frame,
        settings: *const Settings,
    ) error{OutOfMemory}!*@This() {
        assert(settings.sample_count == open_sample_count);
        return gpa.create(@This());
    }

    fn deinit(integrator: *@This(), gpa: Allocator) void {
        gpa.destroy(integrator);
    }

    fn counts(_: *const @This()) Counts {
        return .{ .rays = .{}, .tests = .{} };
    }

    fn pass(_: *@This(), rectangle: Rectangle, first: u32, count: u32, film: *Film) void {
        for (rectangle.y0..rectangle.y1) |y| for (rectangle.x0..rectangle.x1) |x| {
            for (first..first + count) |sample| {
                var random: std.Random.SplitMix64 = .init((y * 64 + x) * 4096 + sample);
                const value: f32 = @floatFromInt(random.next() >> 40);
                const shown = if (x < quiet_width) 0.25 else value * 0x1p-25;
                const column, const row = rectangle.placeOf(@intCast(x), @intCast(y));
                film.add(column, row, @intCast(sample), @splat(shown));
            }
        };
    }

    fn one(_: *anyopaque, standing: *const Standing) u32 {
        return standing.samples_done + 13;
    }
};

/// Holds that all pieces that are told when the work begins are done at its end.
const TestProgress = struct {
    progress: Progress,

    fn init(told: *TestProgress) void {
        told.progress = .{ .context = told, .begun = begun };
    }

    fn begun(context: *anyopaque, work: *const progress_file.Work) void {
        const told: *TestProgress = @ptrCast(@alignCast(context));
        told.progress.restart(work);
    }

    fn expectDone(told: *const TestProgress) !void {
        const total = told.progress.total.load(.monotonic);
        try std.testing.expect(total > 0);
        try std.testing.expectEqual(total, told.progress.done.load(.monotonic));
    }
};

test "quiet blocks get no more samples than they need, whatever tiles, threads and rounds" {
    const gpa = std.testing.allocator;
    const frame: Frame = undefined;
    var hash: ?u64 = null;
    for ([_]usize{ 1, 3 }) |thread_count| for ([_]u32{ 4, 33 }) |tile_size| {
        for ([_]bool{ false, true }) |has_course| {
            var pool: parallel.Pool = .init(thread_count);
            defer pool.deinit();
            var film: Film = try .init(gpa, 40, 20, .init(.{ .color = true }));
            defer film.deinit(gpa);
            var told: TestProgress = undefined;
            told.init();
            const total = try render(&.of(NoisyIntegrator), gpa, &frame, &film, &.{
                .pool = &pool,
                .progress = &told.progress,
                .integrator = .path,
                .sample_count = 100,
                .tile_size = tile_size,
                .noise = .{ .error_max = 0.012, .exposure_scale = 1 },
                .course = if (!has_course) null else .{
                    .context = &pool,
                    .next = NoisyIntegrator.one,
                },
            });
            try told.expectDone();
            // In three columns of blocks: some stay until the end.
            try std.testing.expectEqual(100, total.sample_count);
            try std.testing.expectEqual(16 * 20 * 16 + 24 * 20 * 100, total.sample_sum);
            try std.testing.expectEqual(0.25, film.image.at(NoisyIntegrator.quiet_width - 1, 3)[0]);
            try std.testing.expectEqual(hash orelse film.hash(), film.hash());
            hash = film.hash();
        }
    };
}

test "parts of a picture are what it has there, with blocks of its own grid" {
    const gpa = std.testing.allocator;
    const frame: Frame = undefined;
    var pool: parallel.Pool = .init(2);
    defer pool.deinit();
    var diagnostic: Diagnostic = .{};
    const width = 45;
    const height = 37;
    var whole: Film = try .init(gpa, width, height, .init(.{ .color = true }));
    defer whole.deinit(gpa);
    var told: TestProgress = undefined;
    told.init();
    var shown: Settings = .{
        .pool = &pool,
        .progress = &told.progress,
        .integrator = .path,
        .sample_count = 50,
        .tile_size = 24,
        .noise = .{ .error_max = 0.015, .exposure_scale = 1 },
    };
    const total = try render(&.of(NoisyIntegrator), gpa, &frame, &whole, &shown);
    var sample_sum: u64 = 0;
    for ([_]choices.Part{
        .{ .crop = .{ .pixels = .{ 17, 3, 44, 34 } } },
        .{ .tile = .{ .number = 1, .count = 2 } },
        .{ .tile = .{ .number = 2, .count = 2 } },
    }) |part| {
        var layout: Layout = try .init(gpa, width, height, part, .{
            .step = adaptive.block_side,
            .margin = if (part == .crop) 2 else 0,
        }, &diagnostic);
        defer layout.deinit(gpa);
        shown.layout = &layout;
        var film: Film =
            try .init(gpa, layout.film_width, layout.film_height, whole.layers);
        defer film.deinit(gpa);
        const found = try render(&.of(NoisyIntegrator), gpa, &frame, &film, &shown);
        try told.expectDone();
        if (part == .tile) sample_sum += found.sample_sum;
        var cut = try film.cut(gpa, &layout);
        defer cut.deinit(gpa);
        const bare = layout.bare();
        for (0..bare.count()) |number| {
            const own = bare.windowAt(@intCast(number)).own;
            for (own.y0..own.y1) |y| for (own.x0..own.x1) |x| {
                const place = own.placeOf(@intCast(x), @intCast(y));
                const expected = whole.image.at(@intCast(x), @intCast(y)).*;
                try std.testing.expectEqual(expected, cut.image.at(place[0], place[1]).*);
            };
        }
    }
    try std.testing.expectEqual(total.sample_sum, sample_sum);
}
