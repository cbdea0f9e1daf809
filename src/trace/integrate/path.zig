//! The state of paths under way, so that recursion becomes a stack.
//!
//! In: what an integrator pushes. Out: rays of a bundle with their throughput, the last pushed
//! first; and a path's vertex, taken apart for shading.

const std = @import("std");
const bundle_file = @import("../traverse/bundle.zig");
const ray_file = @import("../traverse/ray.zig");
const bsdf_file = @import("../shade/bsdf.zig");
const interaction_file = @import("../shade/interaction.zig");
const layers_file = @import("../shade/layers.zig");
const exponential = @import("../shade/exponential.zig");
const Nesting = @import("../shade/volumes.zig").Nesting;
const ray_cone = @import("../shade/ray_cone.zig");
const bounces = @import("bounces.zig");
const camera = @import("camera.zig");
const visibility = @import("visibility.zig");
const assert = std.debug.assert;
const Frame = @import("../../world.zig").Frame;

/// Light that comes from behind blended surfaces and is worth no more is left out.
const rest_throughput_min = 0x1p-16;

/// Bounces at most.
pub const depth_limit = @import("../../settings.zig").depth.max;

/// Rays to be traced, and what they are worth.
pub fn PathState(comptime Kernel: type) type {
    const F32 = Kernel.Rays.F32;
    const Vec3 = Kernel.Rays.Vec3;
    const Interaction = interaction_file.Interaction(Kernel.Rays);
    return struct {
        bundle: bundle_file.Bundle(Kernel),
        /// Share of what the ray sees that reaches the pixel.
        throughput: [Kernel.group_count]Vec3,
        /// Extinction coefficient of what the ray travels in, per metre.
        sigma_t: [Kernel.group_count]Vec3,
        /// The volumes that it is in; none in frames without.
        nestings: [Kernel.group_count][Kernel.ray_count]Nesting,
        /// Of the roughest surface on the way: how far the environment is spread.
        roughness: [Kernel.group_count]Kernel.Rays.F32,
        /// Share that the ray sees of what surfaces emit: 1, or 0 where lights stand for them.
        emission: [Kernel.group_count]Kernel.Rays.F32,
        /// Ray cones (`ray_cone.zig`): width at the origin in metres, and its growth by distance;
        /// undefined in frames without footprints.
        cone_width: [Kernel.group_count]F32,
        cone_spread: [Kernel.group_count]F32,
        /// Bounces up to here.
        depth: u32,
        /// Surfaces that the ray has gone on through without a bounce.
        transparency_depth: u32,

        /// Nothing on the way yet.
        pub fn start(path: *@This()) void {
            path.throughput = @splat(.splat(.{ 1, 1, 1 }));
            path.sigma_t = @splat(.splat(.{ 0, 0, 0 }));
            path.nestings = @splat(@splat(.air));
            path.roughness = @splat(.zero());
            path.emission = @splat(.splat(1));
        }

        /// Gives primary rays their cones.
        pub fn startCones(path: *@This(), footprint: camera.Footprint) void {
            const slope: F32 = .splat(footprint.slope);
            path.cone_width = @splat(.splat(footprint.width));
            for (&path.bundle.groups, &path.cone_spread) |*ray, *spread| {
                spread.* = slope.div(ray.line.direction.length());
            }
        }

        /// Gives rays that go straight on from where they started the cones that they have.
        pub fn keepCones(path: *@This(), before: *const @This()) void {
            path.cone_width = before.cone_width;
            path.cone_spread = before.cone_spread;
        }

        /// Gives reflected rays of a group their cones: what they are at a point, and the surface
        /// makes of them.
        pub fn reflectCones(
            path: *@This(),
            before: *const @This(),
            group: usize,
            point: *const Interaction,
        ) void {
            const spread = before.cone_spread[group];
            const width = point.cone_width;
            path.cone_width[group] = width;
            path.cone_spread[group] =
                ray_cone.reflected(Kernel.Rays, spread, width, point.curvature);
        }

        /// The same of rays that go through the surface, bent if it bounds a volume.
        pub fn refractCones(
            path: *@This(),
            before: *const @This(),
            group: usize,
            point: *const Interaction,
        ) void {
            const material = &point.material;
            const spread = before.cone_spread[group];
            const width = point.cone_width;
            const bent =
                ray_cone.refracted(Kernel.Rays, spread, width, point.curvature, point.eta);
            path.cone_width[group] = width;
            path.cone_spread[group] = .select(material.volume, bent, spread);
        }

        /// How rays leave a surface.
        pub const Departure = struct {
            point: *const Interaction,
            /// The geometric normal on the side that they go to.
            away: Vec3,
            direction: Vec3,
            /// Of the lobe around the direction.
            roughness: F32,
            /// See `PathState.emission`.
            emission: F32,
        };

        /// Starts the active rays of a group off a surface.
        pub fn leave(
            path: *@This(),
            before: *const @This(),
            group: usize,
            departure: *const Departure,
        ) void {
            const origin = departure.point.offsetOrigin(departure.away, .zero());
            const from = before.bundle.groups[group].closest.primitive;
            path.roughness[group] = before.roughness[group].max(departure.roughness);
            path.emission[group] = departure.emission;
            path.nestings[group] = before.nestings[group];
            const ray = &path.bundle.groups[group];
            ray.* = .endless(.init(origin, departure.direction), from, ray.active);
        }

        /// Takes rays of a group through a surface, into what it bounds or out of it.
        pub fn cross(
            path: *@This(),
            before: *const @This(),
            group: usize,
            point: *const Interaction,
        ) void {
            const bounds = point.material.volume;
            path.sigma_t[group] = before.sigma_t[group];
            if (bounds.none()) return;
            path.sigma_t[group] = .select(bounds, point.sigma_beyond, path.sigma_t[group]);
            path.nestings[group] = point.beyond;
        }

        /// Lanes of paths that go straight on behind their vertices and are worth it, by group;
        /// null: none does.
        pub fn restLanes(
            path: *const @This(),
            vertices: *const [Kernel.group_count]Vertex(Kernel.Rays),
        ) ?[Kernel.group_count]Kernel.Rays.Mask {
            var masks: [Kernel.group_count]Kernel.Rays.Mask = undefined;
            var any_left = false;
            for (&masks, vertices, &path.bundle.groups, 0..) |*mask, *vertex, *ray, group| {
                const missed = ray.closest.primitive.eq(.splat(ray_file.no_primitive));
                mask.* = ray.active.andNot(missed);
                if (mask.none()) continue;
                mask.* = mask.bitAnd(vertex.point.opacity.lt(.splat(1)));
                if (mask.none()) continue;
                const left = path.restThroughput(vertex, group);
                const largest = left.x.max(left.y).max(left.z);
                mask.* = mask.bitAnd(largest.gt(.splat(rest_throughput_min)));
                any_left = any_left or mask.any();
            }
            return if (any_left) masks else null;
        }

        /// What is left of a group's throughput behind a vertex.
        pub fn restThroughput(
            path: *const @This(),
            vertex: *const Vertex(Kernel.Rays),
            group: usize,
        ) Vec3 {
            const clear = Kernel.Rays.F32.splat(1).sub(vertex.point.opacity);
            return path.throughput[group].scale(clear);
        }

        /// What is left of a group's throughput at a distance: Beer and Lambert's law.
        pub fn throughputAt(
            path: *const @This(),
            group: usize,
            distance: Kernel.Rays.F32,
        ) Vec3 {
            const Rays = Kernel.Rays;
            const throughput = path.throughput[group];
            const sigma_t = path.sigma_t[group];
            const zero: Rays.F32 = .zero();
            const clear = sigma_t.x.eq(zero).bitAnd(sigma_t.y.eq(zero)).bitAnd(sigma_t.z.eq(zero));
            if (clear.all()) return throughput;
            return throughput.mul(exponential.transmittance(Rays, sigma_t, distance));
        }
    };
}

/// Paths that wait, a depth-first order.
pub fn PathStack(comptime Kernel: type) type {
    return struct {
        states: []PathState(Kernel),
        count: usize,

        /// Room for all that may wait where paths have so many bounces at most: at each depth a ray
        /// leaves at most the rest of itself, a refraction and a reflection; with further lobes
        /// one more refraction for each channel, and a coat's reflection. To be freed by `deinit`.
        pub fn init(
            gpa: std.mem.Allocator,
            depth_max: usize,
            has_layers: bool,
        ) error{OutOfMemory}!@This() {
            const most: usize = if (has_layers) 7 else 3;
            const room = most * (depth_max + 1) + bounces.rough_split;
            return .{ .states = try gpa.alloc(PathState(Kernel), room), .count = 0 };
        }

        /// Frees everything.
        pub fn deinit(stack: *@This(), gpa: std.mem.Allocator) void {
            gpa.free(stack.states);
            stack.* = undefined;
        }

        /// Room for rays of the given depth; the caller fills in the rest.
        pub fn push(
            stack: *@This(),
            depth: u32,
            transparency_depth: u32,
        ) *PathState(Kernel) {
            assert(stack.count < stack.states.len);
            const path = &stack.states[stack.count];
            stack.count += 1;
            path.depth = depth;
            path.transparency_depth = transparency_depth;
            return path;
        }

        /// Pushes what of a path goes straight on behind holes, culled backs, blended surfaces and
        /// hidden boundaries, if any does.
        pub fn pushRest(
            stack: *@This(),
            path: *const PathState(Kernel),
            vertices: *const [Kernel.group_count]Vertex(Kernel.Rays),
        ) void {
            if (path.transparency_depth == visibility.transparency_depth_max) return;
            const masks = path.restLanes(vertices) orelse return;
            const rest = stack.push(path.depth, path.transparency_depth + 1);
            rest.bundle = path.bundle;
            rest.sigma_t = path.sigma_t;
            rest.nestings = path.nestings;
            rest.keepCones(path);
            rest.roughness = path.roughness;
            rest.emission = path.emission;
            for (&rest.bundle.groups, masks, vertices, 0..) |*ray, mask, *vertex, group| {
                ray.active = mask;
                if (mask.none()) continue;
                ray.tnear = ray.closest;
                ray.closest = .before(.splat(std.math.inf(f32)));
                rest.throughput[group] = path.restThroughput(vertex, group);
                var hidden = mask.bitAnd(vertex.point.hidden).bits();
                while (hidden != 0) : (hidden &= hidden - 1) {
                    const lane = @ctz(hidden);
                    rest.nestings[group][lane] = vertex.point.beyond[lane];
                }
            }
        }

        /// The last pushed, to be used before the next is; null if none waits.
        pub fn pop(stack: *@This()) ?*const PathState(Kernel) {
            if (stack.count == 0) return null;
            stack.count -= 1;
            return &stack.states[stack.count];
        }
    };
}

/// One vertex of paths in lanes.
pub fn Vertex(comptime Lanes: type) type {
    return struct {
        point: interaction_file.Interaction(Lanes),
        bsdf: bsdf_file.Bsdf(Lanes),
        /// Undefined where the bsdf has no layers.
        layers: layers_file.Layers(Lanes),
        /// Lanes that have a vertex.
        seen: Lanes.Mask,
        /// Throughput of the path up to here, opacity included.
        throughput: Lanes.Vec3,

        /// Before any is found: what `find` keeps is of none.
        pub fn init(vertex: *@This()) void {
            vertex.bsdf.albedo = .unknown;
        }

        /// Where the rays of a group end. Where none hit anything, all but `seen` is undefined.
        pub fn find(vertex: *@This(), seer: anytype, path: anytype, group: usize) void {
            const frame: *const Frame = seer.frame;
            const ray = &path.bundle.groups[group];
            vertex.seen = .splat(false);
            const missed = ray.closest.primitive.eq(.splat(ray_file.no_primitive));
            if (ray.active.andNot(missed).none()) return;
            const point = &vertex.point;
            visibility.findInteraction(Lanes, frame, path, group, point);
            if (frame.materials.volumes.len > 0) seer.boundaries[group].apply(point);
            point.opacity = Lanes.F32.select(point.culled, .zero(), point.opacity);
            vertex.findBsdf(frame, path, group);
            vertex.seen = point.hit.bitAnd(point.opacity.gt(.zero()));
            const throughput = path.throughputAt(group, point.distance).scale(point.opacity);
            vertex.throughput = .select(vertex.seen, throughput, .splat(.{ 0, 0, 0 }));
        }

        /// Finds the BSDF at points that are found.
        pub inline fn findBsdf(
            vertex: *@This(),
            frame: *const Frame,
            path: anytype,
            group: usize,
        ) void {
            if (frame.hasLayers())
                vertex.findLayers(frame, path, group)
            else
                vertex.bsdf.become(&vertex.point);
        }

        /// The same in frames in which some have further lobes.
        noinline fn findLayers(
            vertex: *@This(),
            frame: *const Frame,
            path: anytype,
            group: usize,
        ) void {
            const ray = &path.bundle.groups[group];
            visibility.findLayers(Lanes, frame, ray, &vertex.point, &vertex.layers);
            if (vertex.layers.present.any())
                vertex.bsdf.becomeLayered(&vertex.point, &vertex.layers)
            else
                vertex.bsdf.become(&vertex.point);
        }
    };
}
