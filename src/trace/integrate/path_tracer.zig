//! Path tracing (Kajiya 1986, "The Rendering Equation") by streams of paths.
//!
//! In: the frame, squares of pixels. Out: samples on the film. The paths of an area, some samples
//! of each of its pixels, take their steps together: rays are traced, what they hit is shaded,
//! shadow rays are traced. In between they are sorted, by where rays go and by material, so that
//! lanes are full and neighbours need the same. What a path does depends on its pixel and sample
//! alone, and its light is added up along it: all variants, tiles and threads have the same bits.

const std = @import("std");
const world_file = @import("../../world.zig");
const film_file = @import("../../film.zig");
const statistics = @import("../../statistics.zig");
const dispatch = @import("../traverse/dispatch.zig");
const ray_file = @import("../traverse/ray.zig");
const boundaries_file = @import("boundaries.zig");
const features_file = @import("features.zig");
const path_features = @import("path_features.zig");
const path_file = @import("path.zig");
const path_primary = @import("path_primary.zig");
const records_file = @import("path_records.zig");
const shadows_file = @import("path_shadows.zig");
const step_file = @import("path_step.zig");
const tiles = @import("tiles.zig");
const visibility_file = @import("visibility.zig");
const EnvironmentLights = @import("environment_lights.zig").EnvironmentLights;
const Film = film_file.Film;
const Frame = world_file.Frame;
const OwnFrame = @import("../traverse/own_frame.zig").OwnFrame;
const Record = records_file.Record;
const Rectangle = film_file.Rectangle;

/// One thread's integrator.
pub fn PathTracer(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const group_count = Kernel.group_count;
    return struct {
        const Self = @This();

        /// Pixels of an area.
        pub const width = records_file.area_side;
        /// See `width`.
        pub const height = records_file.area_side;
        /// Whether `counts` has tests.
        pub const counts_tests = Kernel.counts_tests;

        frame: *const Frame,
        own_frame: OwnFrame(Kernel),
        settings: *const tiles.Settings,
        rays: statistics.RayCounts,
        visibility: visibility_file.Visibility(Kernel),
        /// For the floor.
        environment_lights: EnvironmentLights,
        /// Share of light on the floor where primary rays meet it, and room for where they do.
        floor_light: [group_count]Rays.F32,
        floor_points: [group_count]path_file.Vertex(Rays),
        records: []Record,
        numbers: []u32,
        /// Of these, numbers of the paths under way, those of the next step, and room to sort them.
        live: []u32,
        next: []u32,
        sorted: []u32,
        keys: []u16,
        shadows: shadows_file.PathShadows(Kernel),
        step: step_file.PathStep(Kernel),
        /// Whose paths these are, in the groups of the bundle under way.
        groups: [group_count][Rays.count]u32,

        /// To be freed by `deinit`.
        pub fn init(
            gpa: std.mem.Allocator,
            shared_frame: *const Frame,
            settings: *const tiles.Settings,
        ) error{OutOfMemory}!*Self {
            const tracer = try gpa.create(Self);
            errdefer gpa.destroy(tracer);
            const frame = try tracer.own_frame
                .init(gpa, shared_frame, settings.pool.thread_count);
            errdefer tracer.own_frame.deinit(gpa);
            const count = records_file.path_count_max;
            tracer.records = try gpa.alloc(Record, count);
            errdefer gpa.free(tracer.records);
            tracer.numbers = try gpa.alloc(u32, 3 * count);
            errdefer gpa.free(tracer.numbers);
            tracer.live = tracer.numbers[0..count];
            tracer.next = tracer.numbers[count..][0..count];
            tracer.sorted = tracer.numbers[2 * count ..];
            const features = try gpa.alloc(path_features.Features, count);
            errdefer gpa.free(features);
            tracer.keys = try gpa.alloc(u16, count);
            errdefer gpa.free(tracer.keys);
            try tracer.shadows.init(gpa);
            tracer.frame = frame;
            tracer.settings = settings;
            tracer.rays = .{};
            tracer.visibility.init(frame);
            tracer.environment_lights = .init(frame.environment, settings.sample_count);
            const step = &tracer.step;
            step.frame = frame;
            step.visibility = &tracer.visibility;
            step.records = tracer.records;
            step.features = features;
            step.shadows = &tracer.shadows;
            step.rays = &tracer.rays;
            step.depth_max = settings.depth_max;
            step.vertex.init();
            return tracer;
        }

        /// Frees everything.
        pub fn deinit(tracer: *Self, gpa: std.mem.Allocator) void {
            tracer.shadows.deinit(gpa);
            gpa.free(tracer.keys);
            gpa.free(tracer.step.features);
            gpa.free(tracer.numbers);
            gpa.free(tracer.records);
            tracer.own_frame.deinit(gpa);
            gpa.destroy(tracer);
        }

        /// What all passes so far took.
        pub fn counts(tracer: *const Self) tiles.Counts {
            const visibility = &tracer.visibility;
            return .{ .rays = tracer.rays, .tests = visibility.tests, .cuts = visibility.cuts };
        }

        /// Adds some samples of each pixel of an area, or of a part of one, to the film.
        pub fn pass(
            tracer: *Self,
            rectangle: Rectangle,
            first_sample: u32,
            sample_count: u32,
            film: *Film,
        ) void {
            const step = &tracer.step;
            step.rectangle = rectangle;
            step.keeps_features = features_file.areKept(film.layers);
            step.is_transparent = film.layers.contains(.alpha);
            step.keeps_display = film.layers.contains(.display);
            var done: u32 = 0;
            while (done < sample_count) {
                const count = @min(sample_count - done, records_file.area_samples);
                step.first_sample = first_sample + done;
                tracer.run(count);
                for (0..count) |sample|
                    path_primary.expose(&tracer.step, @intCast(sample), film);
                done += count;
            }
        }

        /// All steps of the paths of some samples.
        fn run(tracer: *Self, sample_count: u32) void {
            const step = &tracer.step;
            var live_count = path_primary.start(Kernel, tracer, sample_count);
            while (live_count > 0) {
                const live = tracer.live[0..live_count];
                tracer.sortByMaterial(live);
                step.next = tracer.next;
                step.next_count = 0;
                tracer.shade(live);
                tracer.shadows.trace(&tracer.visibility, tracer.records);
                live_count = step.next_count;
                std.mem.swap([]u32, &tracer.live, &tracer.next);
                const going = tracer.live[0..live_count];
                tracer.sortByDirection(going);
                tracer.trace(going);
            }
        }

        /// Numbers of the next bundle of some paths; other rays of the bundle are not active.
        fn takeBundle(tracer: *Self, numbers: []const u32) void {
            for (&tracer.step.path.bundle.groups, &tracer.groups, 0..) |*ray, *group, index| {
                const first = index * Rays.count;
                const rest = numbers[@min(first, numbers.len)..];
                ray.active = if (rest.len == 0)
                    .splat(false)
                else
                    .fromBits(records_file.groupOf(Rays, rest, group));
            }
        }

        /// Finds what the rays of paths hit.
        fn trace(tracer: *Self, numbers: []const u32) void {
            const step = &tracer.step;
            const bundle = &step.path.bundle;
            const room = group_count * Rays.count;
            var first: usize = 0;
            while (first < numbers.len) : (first += room) {
                tracer.takeBundle(numbers[first..]);
                for (&bundle.groups, &tracer.groups, 0..) |*ray, *group, index| {
                    if (ray.active.any()) step.loadRays(index, group);
                }
                const geometry = tracer.frame.geometry;
                const tests = &tracer.visibility.tests;
                _ = dispatch.closestHit(Kernel, geometry, bundle, null, tests);
                for (&bundle.groups, &tracer.groups) |*ray, *group| {
                    const ts = ray.closest.t.toArray();
                    const primitives = ray.closest.primitive.toArray();
                    var bits = ray.active.bits();
                    while (bits != 0) : (bits &= bits - 1) {
                        const lane = @ctz(bits);
                        const record = &tracer.records[group[lane]];
                        record.t = ts[lane];
                        record.primitive = primitives[lane];
                    }
                }
            }
        }

        /// Takes the step of paths whose rays have been traced.
        fn shade(tracer: *Self, numbers: []const u32) void {
            const step = &tracer.step;
            const room = group_count * Rays.count;
            var first: usize = 0;
            while (first < numbers.len) : (first += room) {
                tracer.takeBundle(numbers[first..]);
                const bundle = &step.path.bundle;
                for (&bundle.groups, &tracer.groups, 0..) |*ray, *group, index| {
                    if (ray.active.any()) step.load(index, group);
                }
                if (tracer.frame.materials.volumes.len > 0)
                    boundaries_file.search(Kernel, &tracer.visibility, &step.path);
                for (&bundle.groups, &tracer.groups, 0..) |*ray, *group, index| {
                    if (ray.active.any()) step.shade(index, group);
                }
            }
        }

        /// Those that hit the same material become neighbours; those that hit nothing come last.
        fn sortByMaterial(tracer: *Self, numbers: []u32) void {
            const last = records_file.key_count - 1;
            const keys = tracer.keys[0..numbers.len];
            for (keys, numbers) |*key, number| {
                const primitive = tracer.records[number].primitive;
                key.* = if (primitive == ray_file.no_primitive)
                    last
                else
                    @intCast(tracer.frame.geometry.face(@intCast(primitive)).material % last);
            }
            records_file.sort(numbers, keys, tracer.sorted);
        }

        /// Those that go much the same way become neighbours.
        fn sortByDirection(tracer: *Self, numbers: []u32) void {
            const keys = tracer.keys[0..numbers.len];
            for (keys, numbers) |*key, number|
                key.* = records_file.wayOf(tracer.records[number].direction);
            records_file.sort(numbers, keys, tracer.sorted);
        }
    };
}
