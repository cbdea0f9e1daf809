//! Whitted's recursive ray tracing (1980) of bundles of pixels, without recursion.
//!
//! In: the frame, a bundle's place in the picture. Out: samples on the film. Rays that still have
//! to be traced wait on a stack; what a ray sees is added to its pixel with the throughput of its
//! path. In each lane the order of additions is the depth-first order of that pixel's own tree of
//! rays, so the sum has the same bits however pixels are bundled.

const std = @import("std");
const world_file = @import("../../world.zig");
const statistics = @import("../../statistics.zig");
const ray_file = @import("../traverse/ray.zig");
const dispatch = @import("../traverse/dispatch.zig");
const bsdf_file = @import("../shade/bsdf.zig");
const camera = @import("camera.zig");
const direct = @import("direct.zig");
const environment_light = @import("environment.zig");
const floor = @import("floor.zig");
const path_file = @import("path.zig");
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
    const Vec3 = Rays.Vec3;
    const Mask = Rays.Mask;
    const group_count = Kernel.group_count;
    const PathState = path_file.PathState(Kernel);
    const Vertex = path_file.Vertex(Rays);
    const Vertices = [group_count]Vertex;

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
        /// The background is left clear.
        transparent: bool,
        rays: statistics.RayCounts,
        visibility: visibility_file.Visibility(Kernel),
        environment_lights: EnvironmentLights,
        /// Radiance of the sample under way.
        radiance: [group_count]Vec3,
        /// Share of light on the floor where primary rays that left the scene meet it.
        floor_light: [group_count]F32,
        /// Share of the sample's primary ray that left the scene.
        escaped: [group_count]F32,
        /// Colours of the display are kept apart from radiance.
        keeps_display: bool,
        /// What the sample's primary ray sees of such colours, and its share of them.
        displayed: [group_count]Vec3,
        display_share: [group_count]F32,
        /// Directions of the primary rays of the sample under way, where they share an origin.
        grid: ?Grid,
        stack: path_file.PathStack(Kernel),
        /// Number of the sample under way.
        sample: u32,
        /// Of the step under way.
        path: PathState,
        vertices: Vertices,

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
            whitted.transparent = film.layers.contains(.alpha);
            whitted.keeps_display = film.layers.contains(.display);
            for (first_sample..first_sample + sample_count) |sample| {
                whitted.radiance = @splat(.splat(.{ 0, 0, 0 }));
                whitted.escaped = @splat(.zero());
                if (whitted.keeps_display) {
                    whitted.displayed = @splat(.splat(.{ 0, 0, 0 }));
                    whitted.display_share = @splat(.zero());
                }
                whitted.pushPrimary(rectangle, @intCast(sample));
                while (whitted.stack.pop()) |path| {
                    // A copy: what the step pushes takes its place.
                    whitted.path = path.*;
                    whitted.step();
                }
                const number: u32 = @intCast(sample);
                const place: camera.Place = .{ .rectangle = rectangle, .sample = number };
                camera.expose(Kernel, film, .color, place, &whitted.radiance, &whitted.escaped);
                if (!whitted.keeps_display) continue;
                const share = &whitted.display_share;
                camera.expose(Kernel, film, .display, place, &whitted.displayed, share);
            }
        }

        fn pushPrimary(whitted: *Self, rectangle: Rectangle, sample: u32) void {
            whitted.sample = sample;
            const view = whitted.frame.view;
            const offset = whitted.settings.offsets[sample];
            whitted.grid = camera.grid(view, rectangle, offset);
            const path = whitted.stack.push(0, 0);
            camera.primaryRays(Kernel, view, rectangle, offset, &path.bundle);
            path.throughput = @splat(.splat(.{ 1, 1, 1 }));
            path.sigma_a = @splat(.splat(.{ 0, 0, 0 }));
            path.roughness = @splat(.zero());
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
            if (path.depth == 0) whitted.lightFloor();
            var any_seen = false;
            for (&whitted.vertices, 0..) |*vertex, group| {
                whitted.addEscaped(group);
                whitted.find(group, vertex);
                any_seen = any_seen or vertex.seen.any();
            }
            if (any_seen and whitted.frame.environment.map != null)
                whitted.addEnvironment(coherence);
            if (any_seen) for (whitted.frame.lights) |*light| {
                whitted.rays.shadow += direct.addLight(
                    Kernel,
                    &whitted.visibility,
                    light,
                    path,
                    &whitted.vertices,
                    coherence,
                    &whitted.radiance,
                );
            };
            // The last pushed is traced first: reflection, refraction, the ray's own rest.
            whitted.pushRest();
            if (path.depth == whitted.settings.depth_max or !any_seen) return;
            whitted.pushRefraction();
            whitted.pushReflection();
        }

        fn lightFloor(whitted: *Self) void {
            const floor_height = whitted.frame.environment.floor_height orelse {
                whitted.floor_light = @splat(.splat(1));
                return;
            };
            whitted.rays.shadow += floor.lightShare(
                Kernel,
                &whitted.visibility,
                &whitted.environment_lights,
                whitted.sample,
                floor_height,
                &whitted.path,
                &whitted.vertices,
                &whitted.floor_light,
            );
        }

        /// Adds what rays see that left the scene.
        fn addEscaped(whitted: *Self, group: usize) void {
            const path = &whitted.path;
            const ray = &path.bundle.groups[group];
            const missed = ray.closest.primitive.eq(.splat(ray_file.no_primitive));
            const gone = ray.active.bitAnd(missed);
            if (gone.none()) return;
            var throughput: Vec3 = .select(gone, path.throughput[group], .splat(.{ 0, 0, 0 }));
            if (path.depth == 0) throughput = throughput.scale(whitted.floor_light[group]);
            const around = whitted.frame.environment;
            const environment = if (path.depth == 0) around.backdrop orelse around else around;
            if (path.depth > 0 or environment.is_seen) {
                const seen = environment_light.seenBy(Kernel, environment, path, group, gone);
                return whitted.add(group, throughput.mul(seen));
            }
            whitted.escaped[group] = whitted.escaped[group].add(throughput.x);
            const background = environment.background;
            const seen: [3]f32 = if (whitted.transparent) .{ 0, 0, 0 } else background;
            whitted.add(group, throughput.mul(.splat(seen)));
        }

        /// Adds what points that rays see scatter of the environment's light.
        fn addEnvironment(whitted: *Self, coherence: dispatch.Coherence) void {
            var vertices: environment_light.Vertices(Kernel) = .{
                .path = &whitted.path,
                .all = &whitted.vertices,
                .traced = @splat(.splat(false)),
                .is_end = whitted.path.depth == whitted.settings.depth_max,
            };
            for (&vertices.traced, &whitted.vertices) |*traced, *vertex| {
                if (vertex.seen.any()) traced.* = whitted.reflects(vertex);
            }
            whitted.rays.shadow += environment_light.addLight(
                Kernel,
                &whitted.visibility,
                &whitted.environment_lights,
                whitted.sample,
                &vertices,
                coherence,
                &whitted.radiance,
            );
        }

        inline fn add(whitted: *Self, group: usize, radiance: Vec3) void {
            whitted.radiance[group] = whitted.radiance[group].add(radiance);
        }

        /// Finds the points that rays of a group see, and adds what these emit and the ambient
        /// light that they scatter.
        fn find(whitted: *Self, group: usize, vertex: *Vertex) void {
            vertex.find(whitted.frame, &whitted.path, group);
            if (vertex.seen.none()) return;
            const material = &vertex.point.material;
            var glow = material.emissive;
            if (whitted.frame.environment.map == null)
                glow = glow.add(whitted.scatterAmbient(vertex));
            const shown: Vec3 = .select(material.unlit, material.base_color, glow);
            const arriving = vertex.throughput.mul(shown);
            if (!whitted.keeps_display or whitted.path.depth > 0)
                return whitted.add(group, arriving);
            const none: Vec3 = .splat(.{ 0, 0, 0 });
            whitted.add(group, .select(material.unlit, none, arriving));
            whitted.addDisplayed(group, .select(material.unlit, arriving, none), .select(
                material.unlit,
                vertex.throughput.x,
                .zero(),
            ));
        }

        fn addDisplayed(whitted: *Self, group: usize, color: Vec3, share: F32) void {
            whitted.displayed[group] = whitted.displayed[group].add(color);
            whitted.display_share[group] = whitted.display_share[group].add(share);
        }

        /// Ambient light that a point scatters: diffusely, and instead of rays that are not traced.
        fn scatterAmbient(whitted: *const Self, vertex: *const Vertex) Vec3 {
            const bsdf = &vertex.bsdf;
            const none: Vec3 = .splat(.{ 0, 0, 0 });
            const diffuse = bsdf.diffuse_albedo.scale(vertex.point.material.occlusion);
            const traced = whitted.reflects(vertex);
            const specular: Vec3 = .select(traced, none, bsdf.specular_albedo);
            var scattered = diffuse.add(specular);
            const ends = whitted.path.depth == whitted.settings.depth_max;
            if (ends) scattered = scattered.add(bsdf.mirror.transmitted);
            return scattered.scale(.splat(whitted.frame.environment.ambient));
        }

        /// Lanes whose reflection is traced.
        fn reflects(whitted: *const Self, vertex: *const Vertex) Mask {
            if (whitted.path.depth == whitted.settings.depth_max) return .splat(false);
            const mirror = &vertex.bsdf.mirror;
            const worth = vertex.throughput.mul(mirror.reflected);
            const largest = worth.x.max(worth.y).max(worth.z);
            const material = &vertex.point.material;
            const smooth = material.roughness.le(.splat(bsdf_file.mirror_roughness_max));
            return vertex.seen.bitAnd(smooth.bitOr(mirror.total))
                .bitAnd(largest.gt(.splat(reflection_throughput_min)))
                .andNot(material.unlit);
        }

        /// Pushes what goes straight on behind holes, culled backs and blended surfaces.
        fn pushRest(whitted: *Self) void {
            const path = &whitted.path;
            if (path.transparency_depth == visibility_file.transparency_depth_max) return;
            var masks: [group_count]Mask = undefined;
            var any_left = false;
            for (&masks, &whitted.vertices, &path.bundle.groups) |*mask, *vertex, *ray| {
                const missed = ray.closest.primitive.eq(.splat(ray_file.no_primitive));
                mask.* = ray.active.andNot(missed);
                if (mask.none()) continue;
                mask.* = mask.bitAnd(vertex.point.opacity.lt(.splat(1)));
                any_left = any_left or mask.any();
            }
            if (!any_left) return;
            const rest = whitted.stack.push(path.depth, path.transparency_depth + 1);
            rest.bundle = path.bundle;
            rest.sigma_a = path.sigma_a;
            rest.keepCones(path);
            rest.roughness = path.roughness;
            for (&rest.bundle.groups, masks, &whitted.vertices, 0..) |*ray, mask, *vertex, group| {
                ray.active = mask;
                if (mask.none()) continue;
                ray.tnear = ray.closest;
                ray.closest = .before(.splat(std.math.inf(f32)));
                const clear = F32.splat(1).sub(vertex.point.opacity);
                rest.throughput[group] = path.throughput[group].scale(clear);
            }
        }

        fn pushReflection(whitted: *Self) void {
            var masks: [group_count]Mask = undefined;
            for (&masks, &whitted.vertices) |*mask, *vertex| {
                mask.* = if (vertex.seen.any()) whitted.reflects(vertex) else .splat(false);
            }
            const next = whitted.pushBounce(&masks) orelse return;
            for (masks, &whitted.vertices, 0..) |mask, *vertex, group| {
                if (mask.none()) continue;
                // As long as before: what a plane mirror sends back stays linear in the pixel.
                const length = whitted.path.bundle.groups[group].line.direction.length();
                const direction = bsdf_file.reflect(Rays, &vertex.point).scale(length);
                whitted.leave(next, group, vertex.point.normal_geometric, direction);
                next.throughput[group] = vertex.throughput.mul(vertex.bsdf.mirror.reflected);
                next.sigma_a[group] = whitted.path.sigma_a[group];
                if (whitted.frame.needsFootprints())
                    next.reflectCones(&whitted.path, group, &vertex.point);
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
                whitted.leave(next, group, vertex.point.normal_geometric.neg(), mirror.refraction);
                next.throughput[group] = vertex.throughput.mul(mirror.transmitted);
                const material = &vertex.point.material;
                const outside: Vec3 = .splat(.{ 0, 0, 0 });
                const beyond: Vec3 = .select(vertex.point.back, outside, material.sigma_a);
                const before = whitted.path.sigma_a[group];
                next.sigma_a[group] = .select(material.volume, beyond, before);
                if (whitted.frame.needsFootprints())
                    next.refractCones(&whitted.path, group, &vertex.point);
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

        /// Starts the active rays of a group off a surface, on the side that `away` points to.
        fn leave(
            whitted: *const Self,
            next: *PathState,
            group: usize,
            away: Vec3,
            direction: Vec3,
        ) void {
            const point = &whitted.vertices[group].point;
            const origin = point.offsetOrigin(away, .zero());
            const from = whitted.path.bundle.groups[group].closest.primitive;
            next.roughness[group] = whitted.path.roughness[group].max(point.material.roughness);
            const ray = &next.bundle.groups[group];
            ray.* = .endless(.init(origin, direction), from, ray.active);
        }
    };
}
