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
const bsdf_file = @import("../shade/bsdf.zig");
const camera = @import("camera.zig");
const direct = @import("direct.zig");
const environment_light = @import("environment.zig");
const floor = @import("floor.zig");
const path_file = @import("path.zig");
const sample_file = @import("sample.zig");
const tiles = @import("tiles.zig");
const visibility_file = @import("visibility.zig");
const Film = @import("../../film.zig").Film;
const EnvironmentLights = @import("environment_lights.zig").EnvironmentLights;
const Grid = @import("../traverse/beam/grid.zig").Grid;
const Rectangle = @import("../../film.zig").Rectangle;
const assert = std.debug.assert;
const Frame = world_file.Frame;

/// A path whose throughput has fallen below this is not worth a reflection ray.
const reflection_throughput_min = 1.0 / 256.0;

/// One thread's integrator.
pub fn Whitted(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const Mask = Rays.Mask;
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
        /// Of the step under way.
        path: PathState,
        vertices: [group_count]Vertex,
        /// Lanes whose reflection is traced.
        reflected: [group_count]Mask,

        /// To be freed by `deinit`.
        pub fn init(
            gpa: std.mem.Allocator,
            frame: *const Frame,
            settings: *const tiles.Settings,
        ) error{OutOfMemory}!*Self {
            assert(settings.depth_max <= path_file.depth_limit);
            const whitted = try gpa.create(Self);
            whitted.frame = frame;
            whitted.settings = settings;
            whitted.rays = .{};
            whitted.visibility.init(frame);
            whitted.environment_lights = .init(frame.environment, settings.sample_count);
            whitted.stack.count = 0;
            for (&whitted.vertices) |*vertex| vertex.init();
            return whitted;
        }

        /// Frees everything.
        pub fn deinit(whitted: *Self, gpa: std.mem.Allocator) void {
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
            const beams = whitted.visibility.closest(&path.bundle, grid);
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
            if (any_seen) whitted.addLights(coherence);
            // The last pushed is traced first: reflection, refraction, the ray's own rest.
            whitted.stack.pushRest(path, &whitted.vertices);
            const around = whitted.frame.environment;
            environment_light.endRest(Kernel, around, path, &whitted.vertices, &whitted.sample);
            if (!any_seen or whitted.isEnd()) return;
            whitted.pushRefraction();
            whitted.pushReflection();
        }

        /// No rays go on from where the path's do.
        inline fn isEnd(whitted: *const Self) bool {
            return whitted.path.depth == whitted.settings.depth_max;
        }

        /// Finds the points that rays of a group see, and adds what these emit and the ambient
        /// light that they scatter.
        fn find(whitted: *Self, group: usize, vertex: *Vertex) void {
            vertex.find(whitted.frame, &whitted.path, group);
            const reflected = &whitted.reflected[group];
            reflected.* = .splat(false);
            if (vertex.seen.none()) return;
            reflected.* = whitted.reflects(vertex);
            const environment = whitted.frame.environment;
            var glow = vertex.point.material.emissive;
            if (environment.map == null) glow = glow.add(environment_light.scatterAmbient(
                Rays,
                environment,
                vertex,
                reflected.*,
                whitted.isEnd(),
            ));
            whitted.sample.addSurface(group, vertex, glow, whitted.path.depth);
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
                    .traced = &whitted.reflected,
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
                &whitted.reflected,
                coherence,
                radiance,
            );
        }

        /// Lanes whose reflection is traced.
        fn reflects(whitted: *const Self, vertex: *const Vertex) Mask {
            if (whitted.isEnd()) return .splat(false);
            const mirror = &vertex.bsdf.mirror;
            const worth = vertex.throughput.mul(mirror.reflected);
            const largest = worth.x.max(worth.y).max(worth.z);
            const material = &vertex.point.material;
            const smooth = material.roughness.le(.splat(bsdf_file.mirror_roughness_max));
            return vertex.seen.bitAnd(smooth.bitOr(mirror.total))
                .bitAnd(largest.gt(.splat(reflection_throughput_min)))
                .andNot(material.unlit);
        }

        fn pushReflection(whitted: *Self) void {
            const next = whitted.pushBounce(&whitted.reflected) orelse return;
            for (whitted.reflected, &whitted.vertices, 0..) |mask, *vertex, group| {
                if (mask.none()) continue;
                // As long as before: what a plane mirror sends back stays linear in the pixel.
                const length = whitted.path.bundle.groups[group].line.direction.length();
                const point = &vertex.point;
                const direction = bsdf_file.reflect(Rays, point).scale(length);
                next.leave(&whitted.path, group, point, point.normal_geometric, direction);
                next.throughput[group] = vertex.throughput.mul(vertex.bsdf.mirror.reflected);
                next.sigma_a[group] = whitted.path.sigma_a[group];
                if (whitted.frame.needsFootprints())
                    next.reflectCones(&whitted.path, group, point);
            }
        }

        fn pushRefraction(whitted: *Self) void {
            var masks: [group_count]Mask = undefined;
            for (&masks, &whitted.vertices) |*mask, *vertex| {
                mask.* = .splat(false);
                if (vertex.seen.none()) continue;
                const worth = vertex.throughput.mul(vertex.bsdf.mirror.transmitted);
                const largest = worth.x.max(worth.y).max(worth.z);
                mask.* = vertex.seen.bitAnd(largest.gt(.zero()))
                    .andNot(vertex.point.material.unlit);
            }
            const next = whitted.pushBounce(&masks) orelse return;
            for (masks, &whitted.vertices, 0..) |mask, *vertex, group| {
                if (mask.none()) continue;
                const mirror = &vertex.bsdf.mirror;
                const point = &vertex.point;
                const away = point.normal_geometric.neg();
                next.leave(&whitted.path, group, point, away, mirror.refraction);
                next.throughput[group] = vertex.throughput.mul(mirror.transmitted);
                next.cross(&whitted.path, group, point);
                if (whitted.frame.needsFootprints())
                    next.refractCones(&whitted.path, group, point);
            }
        }

        /// Room for the rays of the next depth in these lanes, counted; null if there are none.
        fn pushBounce(whitted: *Self, masks: *const [group_count]Mask) ?*PathState {
            var count: u64 = 0;
            for (masks) |mask| count += mask.popCount();
            if (count == 0) return null;
            whitted.rays.secondary += count;
            const next = whitted.stack.push(whitted.path.depth + 1, 0);
            for (&next.bundle.groups, masks) |*ray, mask| ray.active = mask;
            return next;
        }
    };
}
