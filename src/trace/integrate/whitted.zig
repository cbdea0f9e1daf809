//! Whitted's recursive ray tracing (1980) of bundles of pixels, without recursion.
//!
//! In: the frame, a bundle's place in the picture. Out: samples on the film. Rays that still have
//! to be traced wait on a stack; what a ray sees is added to its pixel with the throughput of its
//! path. In each lane the order of additions is the depth-first order of that pixel's own tree of
//! rays, so the sum has the same bits however pixels are bundled.

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

/// One thread's integrator.
pub fn Whitted(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const group_count = Kernel.group_count;
    const PathState = path_file.PathState(Kernel);
    const Vertex = path_file.Vertex(Rays);
    const Sample = sample_file.Sample(Kernel);

    return struct {
        const Self = @This();

        /// Pixels of a bundle.
        pub const width = Kernel.bundle_width;
        /// See `width`.
        pub const height = Kernel.bundle_height;
        /// Whether `counts` has tests.
        pub const counts_tests = Kernel.counts_tests;

        frame: *const Frame,
        own_frame: OwnFrame(Kernel),
        settings: *const tiles.Settings,
        rays: statistics.RayCounts,
        visibility: visibility_file.Visibility(Kernel),
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
            const whitted = try gpa.create(Self);
            errdefer gpa.destroy(whitted);
            const frame = try whitted.own_frame
                .init(gpa, shared_frame, settings.pool.thread_count);
            errdefer whitted.own_frame.deinit(gpa);
            whitted.stack = try .init(gpa, settings.depth_max, frame.hasLayers());
            whitted.frame = frame;
            whitted.settings = settings;
            whitted.rays = .{};
            whitted.visibility.init(frame);
            whitted.bounces.init(frame);
            whitted.environment_lights = .init(frame.environment, settings.sample_count);
            for (&whitted.vertices) |*vertex| vertex.init();
            return whitted;
        }

        /// Frees everything.
        pub fn deinit(whitted: *Self, gpa: std.mem.Allocator) void {
            whitted.stack.deinit(gpa);
            whitted.own_frame.deinit(gpa);
            gpa.destroy(whitted);
        }

        /// What all passes so far took.
        pub fn counts(whitted: *const Self) tiles.Counts {
            return .{ .rays = whitted.rays, .tests = whitted.visibility.tests };
        }

        /// Adds some samples of each pixel of a bundle, or of a part of one, to the film.
        pub fn pass(
            whitted: *Self,
            rectangle: Rectangle,
            first_sample: u32,
            sample_count: u32,
            film: *Film,
        ) void {
            for (first_sample..first_sample + sample_count) |sample| {
                whitted.sample.start(@intCast(sample), film.layers);
                whitted.bounces.start(rectangle, @intCast(sample));
                whitted.pushPrimary(rectangle);
                while (whitted.stack.pop()) |path| {
                    // A copy: what the step pushes takes its place.
                    whitted.path = path.*;
                    whitted.step();
                }
                whitted.sample.expose(film, rectangle);
            }
        }

        fn pushPrimary(whitted: *Self, rectangle: Rectangle) void {
            const view = whitted.frame.view;
            const offset = whitted.settings.offsets[whitted.sample.number];
            whitted.grid = camera.grid(view, rectangle, offset);
            const path = whitted.stack.push(0, 0);
            camera.primaryRays(Kernel, view, rectangle, offset, &path.bundle);
            path.start();
            if (whitted.frame.needsFootprints())
                path.startCones(camera.footprint(view, whitted.settings.sample_count));
            for (&path.bundle.groups) |*ray| whitted.rays.primary += ray.active.popCount();
        }

        /// Traces rays, adds what they see, and pushes what has to be traced because of it.
        fn step(whitted: *Self) void {
            const path = &whitted.path;
            const primary = path.depth == 0 and path.transparency_depth == 0;
            const grid = if (primary and whitted.grid != null) &whitted.grid.? else null;
            const beams = whitted.visibility.closest(path, grid);
            const coherence: dispatch.Coherence = if (path.depth == 0) .all else beams;
            if (path.depth == 0) whitted.rays.shadow += floor.lightShare(
                Kernel,
                &whitted.visibility,
                &whitted.environment_lights,
                whitted.sample.number,
                path,
                &whitted.vertices,
                &whitted.floor_light,
            );
            var any_seen = false;
            for (&whitted.vertices, whitted.floor_light, 0..) |*vertex, floor_light, group| {
                const environment = whitted.frame.environment;
                const sample = &whitted.sample;
                environment_light.addEscaped(Kernel, environment, path, group, floor_light, sample);
                whitted.find(group, vertex);
                any_seen = any_seen or vertex.seen.any();
            }
            if (whitted.frame.materials.has_scattering) whitted.addScattered();
            if (any_seen) whitted.addLights(coherence);
            // The last pushed is traced first: reflection, refraction, the ray's own rest.
            whitted.stack.pushRest(path, &whitted.vertices);
            const around = whitted.frame.environment;
            environment_light.endRest(Kernel, around, path, &whitted.vertices, &whitted.sample);
            if (!any_seen or whitted.isEnd()) return;
            const rays = &whitted.rays.secondary;
            rays.* += whitted.bounces.push(path, &whitted.vertices, &whitted.stack);
        }

        /// No rays go on from where the path's do.
        inline fn isEnd(whitted: *const Self) bool {
            return whitted.path.depth == whitted.settings.depth_max;
        }

        /// Finds the points that rays of a group see, and adds what these emit and the ambient
        /// light that they scatter.
        fn find(whitted: *Self, group: usize, vertex: *Vertex) void {
            vertex.find(&whitted.visibility, &whitted.path, group);
            whitted.bounces.choose(group, vertex, whitted.isEnd());
            if (vertex.seen.none()) return;
            if (whitted.sample.features.kept) whitted.addFeatures(group, vertex);
            const environment = whitted.frame.environment;
            var glow = vertex.point.material.emissive.scale(whitted.path.emission[group]);
            if (vertex.bsdf.layered) glow = glow.scale(vertex.bsdf.coating.below_coat);
            if (environment.map == null) glow = glow.add(environment_light.scatterAmbient(
                Rays,
                environment,
                vertex,
                whitted.bounces.reflected[group],
                whitted.isEnd(),
            ));
            whitted.sample.addSurface(group, vertex, glow, whitted.path.depth);
        }

        /// Adds what denoisers are guided by.
        noinline fn addFeatures(whitted: *Self, group: usize, vertex: *const Vertex) void {
            const path = &whitted.path;
            const features = &whitted.sample.features;
            const none: Rays.Vec3 = .splat(.{ 0, 0, 0 });
            const mirror = &vertex.bsdf.mirror;
            const smooth = vertex.point.material.roughness
                .le(.splat(features_file.smooth_roughness_max));
            const reflected = smooth.bitAnd(whitted.bounces.reflected[group]);
            var traced: Rays.Vec3 = .select(reflected, mirror.reflected, none);
            if (!whitted.isEnd()) traced = traced.add(.select(smooth, mirror.transmitted, none));
            features.addVertex(group, path, vertex, traced);
            if (path.depth == 0) features.addDepth(group, whitted.frame.view, vertex);
        }

        /// Adds what volumes scatter that rays go through.
        fn addScattered(whitted: *Self) void {
            whitted.rays.shadow += whitted.medium.addLight(
                &whitted.visibility,
                &whitted.environment_lights,
                &whitted.path,
                .{ .rectangle = whitted.bounces.rectangle, .sample = whitted.sample.number },
                &whitted.sample.radiance,
            );
        }

        /// Adds what the points that rays see scatter of the light that arrives.
        fn addLights(whitted: *Self, coherence: dispatch.Coherence) void {
            const radiance = &whitted.sample.radiance;
            whitted.rays.shadow += environment_light.addLight(
                Kernel,
                &whitted.visibility,
                &whitted.environment_lights,
                whitted.sample.number,
                &.{
                    .path = &whitted.path,
                    .all = &whitted.vertices,
                    .traced = &whitted.bounces.reflected,
                    .coat_traced = &whitted.bounces.coat_reflected,
                    .is_end = whitted.isEnd(),
                },
                coherence,
                radiance,
            );
            for (whitted.frame.lights) |*light| whitted.rays.shadow += direct.addLight(
                Kernel,
                &whitted.visibility,
                light,
                &whitted.path,
                &whitted.vertices,
                &.{
                    .base = &whitted.bounces.emitters_reflected,
                    .coat = &whitted.bounces.coat_reflected,
                },
                coherence,
                radiance,
            );
        }
    };
}
