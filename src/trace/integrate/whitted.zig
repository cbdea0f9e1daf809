//! Whitted's recursive ray tracing (1980) of one bundle of pixels, without recursion.
//!
//! In: a bundle's place in the picture. Out: radiance and alpha of its pixels. Rays that still have
//! to be traced wait on a stack; what a ray sees is added to its pixel with the weight of its
//! path. In each lane the order of additions is the depth-first order of that pixel's own tree of
//! rays, so the sum has the same bits however pixels are bundled.

const std = @import("std");
const world_file = @import("../../world.zig");
const statistics = @import("../../statistics.zig");
const ray_file = @import("../traverse/ray.zig");
const bundle_file = @import("../traverse/bundle.zig");
const dispatch = @import("../traverse/dispatch.zig");
const camera = @import("camera.zig");
const surface_file = @import("../shade/interaction.zig");
const shade = @import("../shade/bsdf.zig");
const light_file = @import("../shade/light.zig");
const exponential = @import("../shade/exponential.zig");
const Grid = @import("../traverse/beam/grid.zig").Grid;
const assert = std.debug.assert;
const World = world_file.World;

/// Bounces at most.
const depth_limit = @import("../../settings.zig").depth.max;

/// Surfaces that one ray goes on through without a bounce (holes, blended or culled ones).
const layer_max = 255;

/// Surfaces that weaken a shadow ray before the rest counts as opaque.
const shadow_layer_max = 16;

/// A path whose weight has fallen below this is not worth a reflection ray.
const reflection_weight_min = 1.0 / 256.0;

/// Radiance of a sample at most, so that sums and exposure stay finite.
const radiance_max = 1e30;

/// What the integrator needs of the options.
pub const Settings = struct {
    sample_count: u32,
    depth_max: u32,
    /// Primary rays that leave the scene leave the pixel clear.
    transparent: bool,
};

/// Pixels of a bundle within the picture and its tile: x0 <= x < x1, y0 <= y < y1.
pub const Rectangle = struct { x0: u32, y0: u32, x1: u32, y1: u32 };

/// One thread's tracer.
pub fn Whitted(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const Vec3 = Rays.Vec3;
    const Mask = Rays.Mask;
    const group_count = Kernel.group_count;
    const Surface = surface_file.Surface(Rays);
    const Lobes = shade.Lobes(Rays);

    return struct {
        const Self = @This();

        world: *const World,
        settings: Settings,
        rays: statistics.RayCounts = .{},
        tests: statistics.TestCounts = .{},
        non_finite_count: u64 = 0,
        /// Radiance of the sample under way.
        radiance: [group_count]Vec3 = undefined,
        /// Share of the sample's primary ray that left the scene.
        escaped: [group_count]F32 = undefined,
        /// Directions of the primary rays of the sample under way, where they share an origin.
        grid: ?Grid = null,
        pending: [pending_max]Pending = undefined,
        pending_count: usize = 0,

        /// At each depth a ray leaves at most the rest of itself, a refraction and a reflection.
        const pending_max = 3 * (depth_limit + 1);

        /// Rays to be traced, and what they are worth.
        const Pending = struct {
            bundle: bundle_file.Bundle(Kernel),
            /// Share of what the ray sees that reaches the pixel.
            weight: [group_count]Vec3,
            /// Absorption of what the ray travels in, per metre.
            absorption: [group_count]Vec3,
            depth: u32,
            /// Surfaces already gone through.
            layer: u32,
        };

        /// One point of a path, taken apart for shading.
        const Point = struct {
            surface: Surface,
            lobe: Lobes,
            /// Lanes that have a point.
            seen: Mask,
            /// Weight of the path up to here, coverage included.
            weight: Vec3,
        };

        /// Traces the pixels of a rectangle no larger than a bundle and writes them.
        pub fn render(tracer: *Self, rectangle: Rectangle, image: anytype) void {
            assert(rectangle.x1 - rectangle.x0 <= Kernel.bundle_width);
            assert(rectangle.y1 - rectangle.y0 <= Kernel.bundle_height);
            assert(tracer.settings.depth_max <= depth_limit);
            var sums: [group_count]Vec3 = @splat(.splat(.{ 0, 0, 0 }));
            var clear: [group_count]F32 = @splat(.zero());
            for (0..tracer.settings.sample_count) |sample| {
                tracer.radiance = @splat(.splat(.{ 0, 0, 0 }));
                tracer.escaped = @splat(.zero());
                tracer.pushPrimary(rectangle, @intCast(sample));
                while (tracer.pending_count > 0) {
                    tracer.pending_count -= 1;
                    // A copy: what the step pushes takes its place.
                    var pending = tracer.pending[tracer.pending_count];
                    tracer.step(&pending);
                }
                for (&sums, &clear, tracer.radiance, tracer.escaped) |*sum, *c, radiance, escaped| {
                    sum.* = sum.add(bound(radiance));
                    c.* = c.add(escaped);
                }
            }
            tracer.write(rectangle, image, &sums, &clear);
        }

        /// Clamps radiance to `radiance_max`; NaN stays, to be counted.
        fn bound(radiance: Vec3) Vec3 {
            const limit: F32 = .splat(radiance_max);
            return .{
                .x = F32.select(radiance.x.gt(limit), limit, radiance.x),
                .y = F32.select(radiance.y.gt(limit), limit, radiance.y),
                .z = F32.select(radiance.z.gt(limit), limit, radiance.z),
            };
        }

        fn write(
            tracer: *Self,
            rectangle: Rectangle,
            image: anytype,
            sums: *const [group_count]Vec3,
            clear: *const [group_count]F32,
        ) void {
            const count: F32 = .splat(@floatFromInt(tracer.settings.sample_count));
            for (sums, clear, 0..) |sum, escaped, group| {
                const red = sum.x.div(count).toArray();
                const green = sum.y.div(count).toArray();
                const blue = sum.z.div(count).toArray();
                const covered = F32.splat(1).sub(escaped.div(count)).max(.zero()).toArray();
                for (0..Kernel.ray_count) |lane| {
                    const x = rectangle.x0 + Kernel.pixelX(group, lane);
                    const y = rectangle.y0 + Kernel.pixelY(group, lane);
                    if (x >= rectangle.x1 or y >= rectangle.y1) continue;
                    const alpha = if (tracer.settings.transparent) covered[lane] else 1;
                    const pixel = [4]f32{ red[lane], green[lane], blue[lane], alpha };
                    image.at(x, y).* = tracer.finite(pixel);
                }
            }
        }

        /// Black for a pixel that is not a number.
        fn finite(tracer: *Self, pixel: [4]f32) [4]f32 {
            const sum = (pixel[0] + pixel[1]) + (pixel[2] + pixel[3]);
            if (std.math.isFinite(sum)) return pixel;
            tracer.non_finite_count += 1;
            return .{ 0, 0, 0, 1 };
        }

        fn pushPrimary(tracer: *Self, rectangle: Rectangle, sample: u32) void {
            const offset = camera.sampleOffset(sample, tracer.settings.sample_count);
            tracer.grid = camera.grid(
                tracer.world,
                @as(f32, @floatFromInt(rectangle.x0)) + offset.x,
                @as(f32, @floatFromInt(rectangle.y0)) + offset.y,
            );
            assert(tracer.pending_count == 0);
            const end_column: F32 = .splat(@floatFromInt(rectangle.x1));
            const end_row: F32 = .splat(@floatFromInt(rectangle.y1));
            const pending = tracer.push(0, 0);
            for (&pending.bundle.groups, 0..) |*ray, group| {
                const column = place(rectangle.x0 + Kernel.pixelX(group, 0), &Kernel.lane_x);
                const row = place(rectangle.y0 + Kernel.pixelY(group, 0), &Kernel.lane_y);
                const inside = column.lt(end_column).bitAnd(row.lt(end_row));
                const x = column.add(.splat(offset.x));
                const y = row.add(.splat(offset.y));
                const start = camera.generate(Rays, tracer.world, x, y);
                ray.* = .{
                    .line = .init(start.origin, start.direction),
                    .tnear = .start(),
                    .closest = .before(.splat(std.math.inf(f32))),
                    .skip = .splat(ray_file.no_primitive),
                    .active = inside,
                };
                pending.weight[group] = .splat(.{ 1, 1, 1 });
                pending.absorption[group] = .splat(.{ 0, 0, 0 });
                tracer.rays.primary += ray.active.popCount();
            }
        }

        /// Columns or rows of a group's pixels; as integers floats hold them exactly.
        inline fn place(first: u32, steps: *const [Kernel.ray_count]f32) F32 {
            return F32.fromArray(steps.*).add(.splat(@floatFromInt(first)));
        }

        /// Room for rays of the given depth; the caller fills in bundle, weight and absorption.
        fn push(tracer: *Self, depth: u32, layer: u32) *Pending {
            assert(tracer.pending_count < pending_max);
            const pending = &tracer.pending[tracer.pending_count];
            tracer.pending_count += 1;
            pending.depth = depth;
            pending.layer = layer;
            return pending;
        }

        /// Traces rays, adds what they see, and pushes what has to be traced because of it.
        fn step(tracer: *Self, pending: *Pending) void {
            const coherence = tracer.trace(pending);
            var points: [group_count]Point = undefined;
            var any_seen = false;
            for (&points, 0..) |*point, group| {
                tracer.addEscaped(pending, group);
                tracer.find(pending, group, point);
                any_seen = any_seen or point.seen.any();
            }
            if (any_seen) for (tracer.world.lights) |*light| {
                tracer.addLight(light, pending, &points, &coherence);
            };
            // The last pushed is traced first: reflection, refraction, the ray's own rest.
            tracer.pushRest(pending, &points);
            if (pending.depth == tracer.settings.depth_max or !any_seen) return;
            tracer.pushRefraction(pending, &points);
            tracer.pushReflection(pending, &points);
        }

        /// Finds what rays see. Returns those whose hits are near to each other.
        fn trace(tracer: *Self, pending: *Pending) dispatch.Coherence(Kernel) {
            const first = pending.depth == 0 and pending.layer == 0;
            const known = if (tracer.grid) |*grid| grid else null;
            const grid = if (first) known else null;
            const beams = dispatch
                .closestHit(Kernel, tracer.world, &pending.bundle, grid, null, &tracer.tests);
            return if (pending.depth == 0) .all else beams;
        }

        /// Adds what rays see that left the scene.
        fn addEscaped(tracer: *Self, pending: *const Pending, group: usize) void {
            const ray = &pending.bundle.groups[group];
            const missed = ray.closest.primitive.eq(.splat(ray_file.no_primitive));
            const gone = ray.active.bitAnd(missed);
            if (gone.none()) return;
            const weight: Vec3 = .select(gone, pending.weight[group], .splat(.{ 0, 0, 0 }));
            const surroundings = &tracer.world.surroundings;
            var seen: [3]f32 = @splat(surroundings.ambient);
            if (pending.depth == 0) {
                tracer.escaped[group] = tracer.escaped[group].add(weight.x);
                seen = if (tracer.settings.transparent) .{ 0, 0, 0 } else surroundings.background;
            }
            tracer.radiance[group] = tracer.radiance[group].add(weight.mul(.splat(seen)));
        }

        /// Finds the points that rays of a group see, and adds what these emit and the ambient
        /// light that they scatter.
        fn find(tracer: *Self, pending: *const Pending, group: usize, point: *Point) void {
            const ray = &pending.bundle.groups[group];
            const missed = ray.closest.primitive.eq(.splat(ray_file.no_primitive));
            if (ray.active.andNot(missed).none()) {
                point.seen = .splat(false);
                return;
            }
            point.surface = surface_file.resolve(Rays, tracer.world, ray);
            const surface = &point.surface;
            surface.coverage = F32.select(surface.culled, .zero(), surface.coverage);
            point.lobe = shade.lobes(Rays, surface);
            point.seen = surface.hit.bitAnd(surface.coverage.gt(.zero()));
            const absorption = pending.absorption[group];
            const dimmed = absorb(pending.weight[group], absorption, surface.distance);
            const weight = dimmed.scale(surface.coverage);
            point.weight = .select(point.seen, weight, .splat(.{ 0, 0, 0 }));
            if (point.seen.none()) return;
            const glow = surface.material.emissive.add(tracer.scatterAmbient(pending, point));
            const shown: Vec3 = .select(surface.material.unlit, surface.material.base_color, glow);
            tracer.radiance[group] = tracer.radiance[group].add(point.weight.mul(shown));
        }

        /// Beer and Lambert's law over a distance.
        fn absorb(weight: Vec3, absorption: Vec3, distance: F32) Vec3 {
            const zero: F32 = .zero();
            const clear = absorption.x.eq(zero).bitAnd(absorption.y.eq(zero))
                .bitAnd(absorption.z.eq(zero));
            if (clear.all()) return weight;
            const way = distance.neg();
            return weight.mul(.{
                .x = exponential.expNegative(Rays, absorption.x.mul(way)),
                .y = exponential.expNegative(Rays, absorption.y.mul(way)),
                .z = exponential.expNegative(Rays, absorption.z.mul(way)),
            });
        }

        /// Ambient light that a point scatters: diffusely, and instead of rays that are not traced.
        fn scatterAmbient(tracer: *const Self, pending: *const Pending, point: *const Point) Vec3 {
            const lobe = &point.lobe;
            const none: Vec3 = .splat(.{ 0, 0, 0 });
            const white: Vec3 = .splat(.{ 1, 1, 1 });
            const diffuse = lobe.diffuse.mul(white.sub(lobe.reflected));
            const traced = tracer.reflects(pending, point);
            var scattered = diffuse.add(.select(traced, none, lobe.reflected));
            const ends = pending.depth == tracer.settings.depth_max;
            if (ends) scattered = scattered.add(lobe.transmitted);
            return scattered.scale(.splat(tracer.world.surroundings.ambient));
        }

        /// Lanes whose reflection is traced.
        fn reflects(tracer: *const Self, pending: *const Pending, point: *const Point) Mask {
            if (pending.depth == tracer.settings.depth_max) return .splat(false);
            const worth = point.weight.mul(point.lobe.reflected);
            const largest = worth.x.max(worth.y).max(worth.z);
            const smooth = point.surface.material.roughness.le(.splat(shade.mirror_roughness_max));
            return point.seen.bitAnd(smooth.bitOr(point.lobe.total))
                .bitAnd(largest.gt(.splat(reflection_weight_min)))
                .andNot(point.surface.material.unlit);
        }

        /// Adds the light of one source, as far as it arrives. Points of the rays in `together` are
        /// near to each other.
        fn addLight(
            tracer: *Self,
            light: *const world_file.Light,
            pending: *const Pending,
            points: *const [group_count]Point,
            coherence: *const dispatch.Coherence(Kernel),
        ) void {
            var bundle: bundle_file.Bundle(Kernel) = undefined;
            var light_seen: [group_count]Vec3 = undefined;
            var any_lit = false;
            for (points, 0..) |*point, group| {
                const ray = &bundle.groups[group];
                ray.active = .splat(false);
                if (point.seen.none()) continue;
                const arrival = light_file.arrive(Rays, light, &point.surface);
                const zero: F32 = .zero();
                const lit = point.seen.andNot(point.surface.material.unlit)
                    .bitAnd(point.surface.normal.dot(arrival.to_light).gt(zero))
                    .bitAnd(point.surface.normal_geometric.dot(arrival.to_light).gt(zero));
                if (lit.none()) continue;
                const response = shade.respond(Rays, &point.surface, &point.lobe, arrival.to_light);
                light_seen[group] = point.weight.mul(response).mul(arrival.irradiance);
                const worth = light_seen[group];
                const arrives = lit.bitAnd(worth.x.gt(zero).bitOr(worth.y.gt(zero))
                    .bitOr(worth.z.gt(zero)));
                const primitive = pending.bundle.groups[group].closest.primitive;
                const away = point.surface.normal_geometric;
                const end = point.surface.off(away, arrival.distance, tracer.world.pad);
                ray.* = light_file.shadowRay(Rays, light, end, primitive, arrives);
                tracer.rays.shadow += arrives.popCount();
                any_lit = any_lit or arrives.any();
            }
            if (!any_lit) return;
            var passing: [group_count]Vec3 = undefined;
            const active = activeMasks(&bundle);
            if (tracer.world.has_transparency or tracer.world.has_holes) {
                tracer.filter(&bundle, light, coherence, &passing);
            } else {
                tracer.block(&bundle, light, coherence, &passing);
            }
            for (active, passing, light_seen, 0..) |arrives, share, seen, group| {
                if (arrives.none()) continue;
                const added: Vec3 = .select(arrives, seen.mul(share), .splat(.{ 0, 0, 0 }));
                tracer.radiance[group] = tracer.radiance[group].add(added);
            }
        }

        fn activeMasks(bundle: *const bundle_file.Bundle(Kernel)) [group_count]Mask {
            var masks: [group_count]Mask = undefined;
            for (&masks, &bundle.groups) |*mask, *ray| mask.* = ray.active;
            return masks;
        }

        /// Light is stopped by anything: the quick path of scenes where all is opaque.
        fn block(
            tracer: *Self,
            bundle: *bundle_file.Bundle(Kernel),
            light: *const world_file.Light,
            coherence: *const dispatch.Coherence(Kernel),
            passing: *[group_count]Vec3,
        ) void {
            dispatch.anyHit(Kernel, tracer.world, bundle, light, coherence, &tracer.tests);
            for (&bundle.groups, passing) |*ray, *share| {
                if (ray.active.none()) continue;
                const free = ray.closest.primitive.eq(.splat(ray_file.no_primitive));
                share.* = .select(free, .splat(.{ 1, 1, 1 }), .splat(.{ 0, 0, 0 }));
            }
        }

        /// Light is weakened by what it goes through, from the nearest to the farthest.
        fn filter(
            tracer: *Self,
            bundle: *bundle_file.Bundle(Kernel),
            light: *const world_file.Light,
            coherence: *const dispatch.Coherence(Kernel),
            passing: *[group_count]Vec3,
        ) void {
            passing.* = @splat(.splat(.{ 1, 1, 1 }));
            var weakened: [group_count]F32 = @splat(.zero());
            var limits: [group_count]ray_file.Hit(Rays) = undefined;
            for (&limits, &bundle.groups) |*limit, *ray| limit.* = ray.closest;
            tracer.settle(bundle, light, coherence, passing);
            for (&bundle.groups, limits) |*ray, limit| ray.closest = limit;
            for (0..layer_max) |_| {
                _ = dispatch.closestHit(Kernel, tracer.world, bundle, null, null, &tracer.tests);
                var any_left = false;
                for (&bundle.groups, passing, &weakened, limits) |*ray, *share, *count, limit| {
                    if (ray.active.none()) continue;
                    tracer.goThrough(ray, share, count);
                    ray.closest = limit;
                    any_left = any_left or ray.active.any();
                }
                if (!any_left) return;
            }
            for (&bundle.groups, passing) |*ray, *share| {
                share.* = .select(ray.active, .splat(.{ 0, 0, 0 }), share.*);
            }
        }

        /// Settles the shadow rays that meet nothing, and those that a search for any hit finds to
        /// meet what no light passes; others stay active. A beam tells quickly; rays by themselves
        /// would take as long as to find what they meet.
        fn settle(
            tracer: *Self,
            bundle: *bundle_file.Bundle(Kernel),
            light: *const world_file.Light,
            coherence: *const dispatch.Coherence(Kernel),
            passing: *[group_count]Vec3,
        ) void {
            if (Kernel.variant.traversal != .beam) return;
            const before = switch (coherence.*) {
                .none => return,
                .all => activeMasks(bundle),
                .some => |*part| bundle_file.narrow(Kernel, bundle, part, true),
            };
            dispatch.anyHit(Kernel, tracer.world, bundle, light, &.all, &tracer.tests);
            for (&bundle.groups, before, passing) |*ray, active, *share| {
                if (active.none()) continue;
                const primitive = ray.closest.primitive;
                const free = ray.active.bitAnd(primitive.eq(.splat(ray_file.no_primitive)));
                const met = ray.active.andNot(free);
                const stopped = surface_file.stopped(Rays, tracer.world, primitive, met);
                share.* = .select(stopped, .splat(.{ 0, 0, 0 }), share.*);
                ray.active = active.andNot(free).andNot(stopped);
            }
        }

        /// Takes shadow rays through the surfaces that they hit; those that stay active go on.
        fn goThrough(
            tracer: *const Self,
            ray: *ray_file.Ray(Rays),
            share: *Vec3,
            weakened: *F32,
        ) void {
            const one: F32 = .splat(1);
            const none: Vec3 = .splat(.{ 0, 0, 0 });
            const missed = ray.closest.primitive.eq(.splat(ray_file.no_primitive));
            ray.active = ray.active.andNot(missed);
            if (ray.active.none()) return;
            const surface = surface_file.resolve(Rays, tracer.world, ray);
            const material = &surface.material;
            const clear = material.transmission.mul(one.sub(material.metallic));
            const tint = material.base_color.scale(clear.mul(surface.coverage));
            const rest = one.sub(surface.coverage);
            const factor = tint.add(.{ .x = rest, .y = rest, .z = rest });
            const shaded = share.mul(factor);
            share.* = .select(ray.active, shaded, share.*);
            weakened.* = weakened.add(F32.select(surface.coverage.gt(.zero()), one, .zero()));
            const ended = weakened.gt(.splat(shadow_layer_max)).bitAnd(ray.active);
            share.* = .select(ended, none, share.*);
            const dark = share.x.max(share.y).max(share.z).le(.zero());
            ray.active = ray.active.andNot(ended).andNot(dark);
            ray.tnear = ray.closest;
        }

        /// Pushes what goes straight on behind holes, culled backs and blended surfaces.
        fn pushRest(
            tracer: *Self,
            pending: *const Pending,
            points: *const [group_count]Point,
        ) void {
            if (pending.layer == layer_max) return;
            var masks: [group_count]Mask = undefined;
            var any_left = false;
            for (&masks, points, &pending.bundle.groups) |*mask, *point, *ray| {
                const missed = ray.closest.primitive.eq(.splat(ray_file.no_primitive));
                mask.* = ray.active.andNot(missed);
                if (mask.none()) continue;
                mask.* = mask.bitAnd(point.surface.coverage.lt(.splat(1)));
                any_left = any_left or mask.any();
            }
            if (!any_left) return;
            const rest = tracer.push(pending.depth, pending.layer + 1);
            rest.bundle = pending.bundle;
            rest.absorption = pending.absorption;
            for (&rest.bundle.groups, masks, points, 0..) |*ray, mask, *point, group| {
                ray.active = mask;
                if (mask.none()) continue;
                ray.tnear = ray.closest;
                ray.closest = .before(.splat(std.math.inf(f32)));
                const share = F32.splat(1).sub(point.surface.coverage);
                rest.weight[group] = pending.weight[group].scale(share);
            }
        }

        fn pushReflection(
            tracer: *Self,
            pending: *const Pending,
            points: *const [group_count]Point,
        ) void {
            var masks: [group_count]Mask = undefined;
            for (&masks, points) |*mask, *point| {
                mask.* = if (point.seen.any()) tracer.reflects(pending, point) else .splat(false);
            }
            const next = tracer.pushBounce(pending, &masks) orelse return;
            for (&next.bundle.groups, masks, points, 0..) |*ray, mask, *point, group| {
                if (mask.none()) continue;
                const away = point.surface.normal_geometric;
                const before = &pending.bundle.groups[group];
                // As long as before: what a plane mirror sends back stays linear in the pixel.
                const length = before.line.direction.length();
                const direction = shade.reflect(Rays, &point.surface).scale(length);
                tracer.leave(ray, point, away, direction, before.closest);
                next.weight[group] = point.weight.mul(point.lobe.reflected);
                next.absorption[group] = pending.absorption[group];
            }
        }

        fn pushRefraction(
            tracer: *Self,
            pending: *const Pending,
            points: *const [group_count]Point,
        ) void {
            var masks: [group_count]Mask = undefined;
            for (&masks, points) |*mask, *point| {
                mask.* = .splat(false);
                if (point.seen.none()) continue;
                const share = point.weight.mul(point.lobe.transmitted);
                const largest = share.x.max(share.y).max(share.z);
                mask.* = point.seen.bitAnd(largest.gt(.zero()))
                    .andNot(point.surface.material.unlit);
            }
            const next = tracer.pushBounce(pending, &masks) orelse return;
            for (&next.bundle.groups, masks, points, 0..) |*ray, mask, *point, group| {
                if (mask.none()) continue;
                const away = point.surface.normal_geometric.neg();
                const direction = point.lobe.refraction;
                tracer.leave(ray, point, away, direction, pending.bundle.groups[group].closest);
                next.weight[group] = point.weight.mul(point.lobe.transmitted);
                const material = &point.surface.material;
                const outside: Vec3 = .splat(.{ 0, 0, 0 });
                const beyond: Vec3 = .select(point.surface.back, outside, material.absorption);
                const before = pending.absorption[group];
                next.absorption[group] = .select(material.volume, beyond, before);
            }
        }

        /// Room for the rays of the next depth in these lanes, counted; null if there are none.
        fn pushBounce(
            tracer: *Self,
            pending: *const Pending,
            masks: *const [group_count]Mask,
        ) ?*Pending {
            var count: u64 = 0;
            for (masks) |mask| count += mask.popCount();
            if (count == 0) return null;
            tracer.rays.secondary += count;
            const next = tracer.push(pending.depth + 1, 0);
            for (&next.bundle.groups, masks) |*ray, mask| ray.active = mask;
            return next;
        }

        /// Starts a ray off a surface, on the side that `away` points to.
        fn leave(
            tracer: *const Self,
            ray: *ray_file.Ray(Rays),
            point: *const Point,
            away: Vec3,
            direction: Vec3,
            from: ray_file.Hit(Rays),
        ) void {
            const origin = point.surface.off(away, .zero(), tracer.world.pad);
            const active = ray.active;
            ray.* = .{
                .line = .init(origin, direction),
                .tnear = .start(),
                .closest = .before(.splat(std.math.inf(f32))),
                .skip = from.primitive,
                .active = active,
            };
        }
    };
}
