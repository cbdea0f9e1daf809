//! Stage 3: World -> Image. Rays are traced by all threads, a tile at a time.
//!
//! In: the world, which nothing changes meanwhile, and settings. Out: every pixel of the image, and
//! how many rays it took. Each thread's state is allocated before the first ray, nothing after; the
//! tile counter is the only synchronisation. The picture is the same bits for every variant, thread
//! count and tile size.

const std = @import("std");
const choices = @import("settings.zig");
const world_file = @import("world.zig");
const statistics = @import("statistics.zig");
const parallel = @import("parallel.zig");
const variant_file = @import("variant.zig");
const Image = @import("image.zig").Image;
const whitted = @import("trace/integrate/whitted.zig");
const Tiles = @import("trace/integrate/tiles.zig");
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;
const World = world_file.World;

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
/// Rays from one point, or behind it, as a beam.
pub const primary = @import("trace/traverse/beam/primary.zig");
/// The directions of a beam's rays.
pub const Grid = @import("trace/traverse/beam/grid.zig").Grid;
/// A bundle in the variant's own way.
pub const dispatch = @import("trace/traverse/dispatch.zig");

/// How a frame is traced, and who does the work.
pub const Settings = struct {
    pool: *parallel.Pool,
    /// Samples a pixel, at least 1.
    sample_count: u32 = choices.sample_count.default,
    /// Bounces after the primary ray, at most `settings.depth.max`.
    depth_max: u32 = choices.depth.default,
    /// Side of a tile in pixels, at least 1.
    tile_size: u32 = choices.tile_size.default,
    /// Leave the background clear instead of filling it.
    transparent: bool = false,
    /// Told of every finished tile.
    progress: std.Progress.Node = .none,
    /// Looked at between tiles: once it is set, the rest of the picture is left undefined.
    cancel: ?*const std.atomic.Value(bool) = null,
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
    gpa: Allocator,
    variant_index: usize,
    world: *const World,
    image: *Image,
    settings: Settings,
) error{OutOfMemory}!Statistics {
    return run(false, gpa, variant_index, world, image, settings);
}

/// The same with boxes and triangles counted, which takes longer: for a second pass, untimed.
pub fn traceCounting(
    gpa: Allocator,
    variant_index: usize,
    world: *const World,
    image: *Image,
    settings: Settings,
) error{OutOfMemory}!Statistics {
    return run(true, gpa, variant_index, world, image, settings);
}

fn run(
    comptime counting: bool,
    gpa: Allocator,
    variant_index: usize,
    world: *const World,
    image: *Image,
    settings: Settings,
) error{OutOfMemory}!Statistics {
    assert(image.width == world.width and image.height == world.height);
    assert(settings.sample_count >= 1 and choices.depth.holds(settings.depth_max));
    inline for (variant_file.compiled, 0..) |variant, index| {
        if (index == variant_index) {
            comptime var chosen = variant;
            if (counting) chosen.backend = variant_file.counting_backend;
            return Frame(kernel.Kernel(chosen, counting)).run(gpa, world, image, settings);
        }
    }
    unreachable; // Asserts that the index is one of `compiled`.
}

/// One frame by one variant.
fn Frame(comptime Kernel: type) type {
    return struct {
        world: *const World,
        image: *Image,
        settings: Settings,
        tiles: Tiles,
        /// By thread: a megabyte or two each, which is no size for a stack.
        tracers: []Tracer,

        const Tracer = whitted.Whitted(Kernel);

        fn run(
            gpa: Allocator,
            world: *const World,
            image: *Image,
            settings: Settings,
        ) error{OutOfMemory}!Statistics {
            const tiles: Tiles = .init(image.width, image.height, settings.tile_size);
            const tracers = try gpa.alloc(Tracer, settings.pool.threadsFor(tiles.count));
            defer gpa.free(tracers);
            for (tracers) |*tracer| tracer.* = .{
                .world = world,
                .settings = .{
                    .sample_count = settings.sample_count,
                    .depth_max = settings.depth_max,
                    .transparent = settings.transparent,
                },
            };
            var frame: @This() = .{
                .world = world,
                .image = image,
                .settings = settings,
                .tiles = tiles,
                .tracers = tracers,
            };
            settings.pool.share(tiles.count, &frame, work);
            var total: Statistics = .{};
            var tests: statistics.TestCounts = .{};
            for (tracers) |*tracer| {
                total.rays.add(tracer.rays);
                total.non_finite_count += tracer.non_finite_count;
                tests.add(tracer.tests);
            }
            if (Kernel.counts_tests) total.tests = tests;
            return total;
        }

        fn work(frame: *@This(), thread_index: usize) void {
            const tracer = &frame.tracers[thread_index];
            while (frame.tiles.take()) |tile| {
                if (frame.settings.cancel) |cancel| if (cancel.load(.monotonic)) return;
                renderTile(tracer, tile, frame.image);
                frame.settings.progress.completeOne();
            }
        }

        fn renderTile(
            tracer: *Tracer,
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
    };
}

test {
    _ = kernel;
    _ = ray;
    _ = triangle;
    _ = single;
    _ = traversal_ray;
    _ = stream;
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
