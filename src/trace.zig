//! Stage 3: World -> Image. Rays are traced by all threads, a tile at a time.
//!
//! In: the world, which nothing changes meanwhile, and settings. Out: every pixel of the image, and
//! how many rays it took. Nothing is allocated and no lock is taken; the tile counter is the only
//! synchronisation. The picture is the same bits for every variant, thread count and tile size.

const std = @import("std");
const world_file = @import("world.zig");
const statistics = @import("statistics.zig");
const parallel = @import("parallel.zig");
const variant_file = @import("variant.zig");
const Image = @import("image.zig").Image;
const whitted = @import("trace/integrate/whitted.zig");
const Tiles = @import("trace/integrate/tiles.zig");
const assert = std.debug.assert;
const Frame = world_file.Frame;

/// How kernels are found.
pub const link = @import("trace/link.zig");
/// The comptime shape of a tracer; with the files below for tests and benchmarks of traversal.
pub const kernel = @import("trace/traverse/kernel.zig");
/// Rays in lanes.
pub const ray = @import("trace/traverse/ray.zig");
/// The exact triangle test.
pub const triangle = @import("trace/traverse/triangle.zig");
/// One ray in the lanes of a tree.
pub const traversal_ray = @import("trace/traverse/traversal_ray.zig");
/// One ray after the other through the tree.
pub const single = @import("trace/traverse/single.zig");
/// Rays that have little in common, as a set.
pub const stream = @import("trace/traverse/stream.zig");
/// A few rays that go much the same way.
pub const interval_packet = @import("trace/traverse/interval_packet.zig");
/// The way through the tree, and what rays want to know.
pub const walk = @import("trace/traverse/walk.zig");
/// A bundle of rays through the tree.
pub const bundle = @import("trace/traverse/bundle.zig");
/// Rays from one point as a beam.
pub const eye_rays = @import("trace/traverse/beam/eye_rays.zig");
/// The directions of a beam's rays.
pub const Grid = @import("trace/traverse/beam/grid.zig").Grid;
/// A bundle in the variant's own way.
pub const dispatch = @import("trace/traverse/dispatch.zig");

/// Bounces at most.
pub const depth_limit = whitted.depth_limit;

/// What the options say about tracing.
pub const Settings = struct {
    thread_count: usize,
    /// Samples a pixel, at least 1.
    sample_count: u32 = 1,
    /// Bounces after the primary ray, at most `depth_limit`.
    depth_max: u32 = 6,
    /// Side of a tile in pixels, at least 1.
    tile_size: u32 = 32,
    /// Leave the background clear instead of filling it.
    transparent: bool = false,
    /// Told of every finished tile.
    progress: std.Progress.Node = .none,
};

/// What the frame took.
pub const Statistics = struct {
    rays: statistics.RayCounts = .{},
    /// Null where they were not counted.
    tests: ?statistics.TestCounts = null,
    /// Pixels that came out as not a number and were made black.
    non_finite_count: u64 = 0,
};

/// Traces the picture with variant `variant_index` of `variant.compiled`. Asserts that the image
/// has the world's size and the tree the variant's width.
pub fn trace(
    variant_index: usize,
    frame: *const Frame,
    image: *Image,
    settings: Settings,
) Statistics {
    return run(false, variant_index, frame, image, settings);
}

/// The same with boxes and triangles counted, which takes longer: for a second pass, untimed.
pub fn traceCounting(
    variant_index: usize,
    frame: *const Frame,
    image: *Image,
    settings: Settings,
) Statistics {
    return run(true, variant_index, frame, image, settings);
}

fn run(
    comptime counting: bool,
    variant_index: usize,
    frame: *const Frame,
    image: *Image,
    settings: Settings,
) Statistics {
    assert(image.width == frame.view.width and image.height == frame.view.height);
    assert(settings.sample_count >= 1 and settings.depth_max <= depth_limit);
    var render: Render = .{
        .frame = frame,
        .image = image,
        .settings = settings,
        .tiles = .init(image.width, image.height, settings.tile_size),
        .work = workOf(counting, variant_index),
        .tile_done = Render.completeTile,
    };
    parallel.share(settings.thread_count, &render, Render.share);
    var total: Statistics = .{};
    var tests: statistics.TestCounts = .{};
    for (render.by_thread[0..settings.thread_count]) |part| {
        total.rays.add(part.rays);
        total.non_finite_count += part.non_finite_count;
        tests.add(part.tests);
    }
    if (counting) total.tests = tests;
    return total;
}

/// The kernel of a variant. Asserts that the index is one of `variant.compiled`.
fn workOf(comptime counting: bool, variant_index: usize) Render.Work {
    const kernels = comptime kernels: {
        var list: [variant_file.compiled.len]Render.Work = undefined;
        for (&list, variant_file.compiled) |*to, held| {
            const chosen = if (counting) variant_file.countingOf(held) else held;
            const symbol = link.workSymbol(Render, chosen, counting);
            to.* = @extern(Render.Work, .{ .name = symbol });
        }
        break :kernels list;
    };
    return kernels[variant_index];
}

/// A picture under way: what a kernel is handed.
pub const Render = struct {
    frame: *const Frame,
    image: *Image,
    settings: Settings,
    tiles: Tiles,
    work: Work,
    /// Called after every tile: the state behind `settings.progress` is the program's.
    tile_done: *const fn (render: *Render) callconv(.c) void,
    by_thread: [parallel.thread_count_max]ThreadStatistics = @splat(.{}),

    /// What one thread does for a render.
    pub const Work = *const fn (render: *Render, thread_index: usize) callconv(.c) void;

    const ThreadStatistics = struct {
        rays: statistics.RayCounts = .{},
        tests: statistics.TestCounts = .{},
        non_finite_count: u64 = 0,
    };

    fn completeTile(render: *Render) callconv(.c) void {
        render.settings.progress.completeOne();
    }

    fn share(render: *Render, thread_index: usize) void {
        render.work(render, thread_index);
    }
};

/// Takes tiles, until there are none left, and traces them.
pub fn work(comptime Kernel: type, render: *Render, thread_index: usize) void {
    var tracer: whitted.Whitted(Kernel) = .{
        .frame = render.frame,
        .settings = .{
            .sample_count = render.settings.sample_count,
            .depth_max = render.settings.depth_max,
            .transparent = render.settings.transparent,
        },
    };
    while (render.tiles.take()) |tile| {
        renderTile(Kernel, &tracer, tile, render.image);
        render.tile_done(render);
    }
    render.by_thread[thread_index] = .{
        .rays = tracer.rays,
        .tests = tracer.tests,
        .non_finite_count = tracer.non_finite_count,
    };
}

fn renderTile(
    comptime Kernel: type,
    tracer: *whitted.Whitted(Kernel),
    tile: whitted.Rectangle,
    image: *Image,
) void {
    var y = tile.y0;
    while (y < tile.y1) : (y += Kernel.bundle_height) {
        var x = tile.x0;
        while (x < tile.x1) : (x += Kernel.bundle_width) {
            tracer.render(.{
                .x0 = x,
                .y0 = y,
                .x1 = @min(x + Kernel.bundle_width, tile.x1),
                .y1 = @min(y + Kernel.bundle_height, tile.y1),
            }, image);
        }
    }
}

test {
    _ = link;
    _ = kernel;
    _ = ray;
    _ = triangle;
    _ = single;
    _ = traversal_ray;
    _ = stream;
    _ = @import("trace/traverse/stack.zig");
    _ = bundle;
    _ = dispatch;
    _ = whitted;
    _ = Tiles;
    _ = @import("trace/traverse/beam/budget.zig");
    _ = @import("trace/traverse/beam/tile_depth_buffer.zig");
    _ = @import("trace/traverse/beam/grid.zig");
    _ = @import("trace/integrate/camera.zig");
    _ = @import("trace/shade/exponential.zig");
    _ = @import("trace/shade/offset.zig");
    _ = @import("trace/shade/bsdf.zig");
    _ = @import("trace/shade/interaction.zig");
}
