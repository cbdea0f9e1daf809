//! Trees of rays (Whitted 1980) of bundles of pixels, without recursion.
//!
//! In: the frame, a bundle's place in the picture. Out: samples on the film. Rays that still have
//! to be traced wait on a stack; what a ray sees is added to its pixel with the throughput of its
//! path. In each lane the order of additions is the depth-first order of that pixel's own tree of
//! rays, so the sum has the same bits however pixels are bundled.
//!
//! What lights surfaces is another type, Lighting(Kernel), a field of the tree, with
//!
//!     Shared                                    see `tiles.zig`
//!     has_ambient                               light from everywhere has nothing in its way
//!     stride                                    pixels between neighbours of a bundle, at most
//!     init(lighting, frame, settings)           in place
//!     partOf(lighting, rectangle, index)        of stride^2 bundles one, or null
//!     start(lighting, rectangle)                a sample of a bundle begins
//!     addLights(lighting, tree, coherence)      to what the tree's vertices have
//!     expose(lighting, rectangle, sample)       a sample of a bundle ends

const std = @import("std");
const world_file = @import("../../world.zig");
const statistics = @import("../../statistics.zig");
const dispatch = @import("../traverse/dispatch.zig");
const bounces_file = @import("bounces.zig");
const camera = @import("camera.zig");
const direct = @import("direct.zig");
const environment_light = @import("environment.zig");
const features_file = @import("features.zig");
const floor = @import("floor.zig");
const medium_file = @import("medium.zig");
const path_file = @import("path.zig");
const sample_file = @import("sample.zig");
const tiles = @import("tiles.zig");
const visibility_file = @import("visibility.zig");
const Film = @import("../../film.zig").Film;
const OwnFrame = @import("../traverse/own_frame.zig").OwnFrame;
const EnvironmentLights = @import("environment_lights.zig").EnvironmentLights;
const Grid = @import("../traverse/beam/grid.zig").Grid;
const Rectangle = @import("../../film.zig").Rectangle;
const assert = std.debug.assert;
const Frame = world_file.Frame;
const Light = world_file.Light;

/// One thread's trees.
pub fn RayTree(comptime Kernel: type, comptime Lighting: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const group_count = Kernel.group_count;
    const PathState = path_file.PathState(Kernel);
    const Vertex = path_file.Vertex(Rays);
    const Sample = sample_file.Sample(Kernel);
    const stride = Lighting.stride;

    return struct {
        const Self = @This();

        /// Pixels that are passed together.
        pub const width = stride * Kernel.bundle_width;
        /// See `width`.
        pub const height = stride * Kernel.bundle_height;
        /// See `tiles.zig`.
        pub const tile_step = if (stride > 1) width else 1;
        /// See `tiles.zig`.
        pub const Shared = Lighting.Shared;
        /// Whether `counts` has tests.
        pub const counts_tests = Kernel.counts_tests;

        frame: *const Frame,
        own_frame: OwnFrame(Kernel),
        settings: *const tiles.Settings,
        rays: statistics.RayCounts,
        visibility: visibility_file.Visibility(Kernel),
        lighting: Lighting,
        environment_lights: EnvironmentLights,
        /// Share of light on the floor where primary rays that left the scene meet it.
        floor_light: [group_count]F32,
        /// Directions of the primary rays of the sample under way, where they share an origin.
        grid: ?Grid,
        stack: path_file.PathStack(Kernel),
        /// Under way.
        sample: Sample,
        /// Undefined in frames where no volume scatters light.
        medium: medium_file.Medium(Kernel),
        /// Of the step under way.
        path: PathState,
        vertices: [group_count]Vertex,
        bounces: bounces_file.Bounces(Kernel),

        /// To be freed by `deinit`.
        pub fn init(
            gpa: std.mem.Allocator,
            shared_frame: *const Frame,
            settings: *const tiles.Settings,
        ) error{OutOfMemory}!*Self {
            assert(settings.depth_max <= path_file.depth_limit);
            const tree = try gpa.create(Self);
            errdefer gpa.destroy(tree);
            const frame = try tree.own_frame.init(gpa, shared_frame, settings.pool.thread_count);
            errdefer tree.own_frame.deinit(gpa);
            tree.stack = try .init(gpa, settings.depth_max, frame.hasLayers());
            tree.frame = frame;
            tree.settings = settings;
            tree.rays = .{};
            tree.visibility.init(frame);
            tree.bounces.init(frame);
            tree.environment_lights = .init(frame.environment, settings.sample_count);
            tree.lighting.init(frame, settings);
            for (&tree.vertices) |*vertex| vertex.init();
            return tree;
        }

        /// Frees everything.
        pub fn deinit(tree: *Self, gpa: std.mem.Allocator) void {
            tree.stack.deinit(gpa);
            tree.own_frame.deinit(gpa);
            gpa.destroy(tree);
        }

        /// What all passes so far took.
        pub fn counts(tree: *const Self) tiles.Counts {
            const seen = &tree.visibility;
            return .{ .rays = tree.rays, .tests = seen.tests, .cuts = seen.cuts };
        }

        /// Adds some samples of each pixel of `width` x `height`, or of a part, to the film.
        pub fn pass(
            tree: *Self,
            rectangle: Rectangle,
            first_sample: u32,
            sample_count: u32,
            film: *Film,
        ) void {
            for (0..stride * stride) |index| {
                const part = tree.lighting.partOf(rectangle, index) orelse continue;
                for (first_sample..first_sample + sample_count) |sample|
                    tree.trace(part, @intCast(sample), film);
            }
        }

        /// A sample of each pixel of a bundle.
        fn trace(tree: *Self, rectangle: Rectangle, sample: u32, film: *Film) void {
            const before = if (Kernel.counts_tests) tree.visibility.tests else {};
            tree.sample.start(sample, film.layers);
            tree.bounces.start(rectangle, sample);
            tree.lighting.start(rectangle);
            tree.pushPrimary(rectangle);
            while (tree.stack.pop()) |path| {
                // A copy: what the step pushes takes its place.
                tree.path = path.*;
                tree.step();
            }
            tree.sample.expose(film, rectangle);
            tree.lighting.expose(rectangle, sample);
            const place: camera.Place = .{ .rectangle = rectangle, .sample = sample };
            if (Kernel.counts_tests and film.layers.contains(.cost))
                camera.exposeCost(Kernel, film, place, before, tree.visibility.tests);
        }

        fn pushPrimary(tree: *Self, rectangle: Rectangle) void {
            const view = tree.frame.view;
            const offset = tree.settings.offsets[tree.sample.number];
            tree.grid = camera.grid(view, rectangle, offset);
            const path = tree.stack.push(0, 0);
            camera.primaryRays(Kernel, view, rectangle, offset, &path.bundle);
            path.start();
            if (tree.frame.needsFootprints())
                path.startCones(camera.footprint(view, tree.settings.sample_count));
            var count: u64 = 0;
            for (&path.bundle.groups) |*ray| count += ray.active.popCount();
            tree.rays.count(0, .{ .closest = count });
        }

        /// Traces rays, adds what they see, and pushes what has to be traced because of it.
        fn step(tree: *Self) void {
            const path = &tree.path;
            const primary = path.depth == 0 and path.transparency_depth == 0;
            const grid = if (primary and tree.grid != null) &tree.grid.? else null;
            const beams = tree.visibility.closest(path, grid);
            const coherence: dispatch.Coherence = if (path.depth == 0) .all else beams;
            if (path.depth == 0) tree.countShadow(floor.lightShare(
                Kernel,
                &tree.visibility,
                &tree.environment_lights,
                tree.sample.number,
                path,
                &tree.vertices,
                &tree.floor_light,
            ));
            var any_seen = false;
            for (&tree.vertices, tree.floor_light, 0..) |*vertex, floor_light, group| {
                const environment = tree.frame.environment;
                const sample = &tree.sample;
                environment_light.addEscaped(Kernel, environment, path, group, floor_light, sample);
                tree.find(group, vertex);
                any_seen = any_seen or vertex.seen.any();
            }
            if (tree.frame.materials.has_scattering) tree.addScattered();
            if (any_seen) tree.lighting.addLights(tree, coherence);
            // The last pushed is traced first: reflection, refraction, the ray's own rest.
            tree.stack.pushRest(path, &tree.vertices);
            const around = tree.frame.environment;
            tree.visibility.cuts.passing +=
                environment_light.endRest(Kernel, around, path, &tree.vertices, &tree.sample);
            if (!any_seen or tree.isEnd()) return;
            const count = tree.bounces.push(path, &tree.vertices, &tree.stack);
            tree.rays.count(path.depth + 1, .{ .closest = count });
        }

        /// No rays go on from where the path's do.
        inline fn isEnd(tree: *const Self) bool {
            return tree.path.depth == tree.settings.depth_max;
        }

        /// Finds the points that rays of a group see, and adds what these emit and the ambient
        /// light that they scatter.
        fn find(tree: *Self, group: usize, vertex: *Vertex) void {
            vertex.find(&tree.visibility, &tree.path, group);
            tree.bounces.choose(group, vertex, tree.isEnd());
            if (vertex.seen.none()) return;
            const environment = tree.frame.environment;
            var glow = vertex.point.material.emissive.scale(tree.path.emission[group]);
            if (vertex.bsdf.layered) glow = glow.scale(vertex.bsdf.coating.below_coat);
            if (Lighting.has_ambient and environment.map == null)
                glow = glow.add(environment_light.scatterAmbient(
                    Rays,
                    environment,
                    vertex,
                    tree.bounces.reflected[group],
                    tree.isEnd(),
                ));
            if (tree.sample.features.kept) tree.addFeatures(group, vertex);
            tree.sample.addSurface(group, vertex, glow, tree.path.depth);
        }

        /// Adds what denoisers are guided by.
        noinline fn addFeatures(tree: *Self, group: usize, vertex: *const Vertex) void {
            const path = &tree.path;
            const features = &tree.sample.features;
            const none: Rays.Vec3 = .splat(.{ 0, 0, 0 });
            const mirror = &vertex.bsdf.mirror;
            const smooth = vertex.point.material.roughness
                .le(.splat(features_file.smooth_roughness_max));
            const reflected = smooth.bitAnd(tree.bounces.reflected[group]);
            var traced: Rays.Vec3 = .select(reflected, mirror.reflected, none);
            if (!tree.isEnd()) traced = traced.add(.select(smooth, mirror.transmitted, none));
            features.addVertex(group, path, vertex, traced);
            if (path.depth == 0) features.addDepth(group, tree.frame.view, vertex);
        }

        /// Adds what volumes scatter that rays go through.
        fn addScattered(tree: *Self) void {
            tree.countShadow(tree.medium.addLight(
                &tree.visibility,
                &tree.environment_lights,
                &tree.path,
                .{ .rectangle = tree.bounces.rectangle, .sample = tree.sample.number },
                &tree.sample.radiance,
            ));
        }

        /// Adds what the points that rays see scatter of these of the scene's lights.
        pub fn addDirect(tree: *Self, lights: []const Light, coherence: dispatch.Coherence) void {
            for (lights) |*light| tree.countShadow(direct.addLight(
                Kernel,
                &tree.visibility,
                light,
                &tree.path,
                &tree.vertices,
                &.{
                    .base = &tree.bounces.emitters_reflected,
                    .coat = &tree.bounces.coat_reflected,
                },
                coherence,
                &tree.sample.radiance,
            ));
        }

        /// How the vertices of the step are lit by the environment.
        pub fn receivers(tree: *const Self) environment_light.Vertices(Kernel) {
            return .{
                .path = &tree.path,
                .all = &tree.vertices,
                .traced = &tree.bounces.reflected,
                .coat_traced = &tree.bounces.coat_reflected,
                .is_end = tree.isEnd(),
            };
        }

        /// Counts shadow rays of the step.
        pub fn countShadow(tree: *Self, count: u64) void {
            tree.rays.count(tree.path.depth, .{ .shadow = count });
        }
    };
}
