//! What light loses on its way straight through boundaries, and inside the volumes between them.
//!
//! In: the hits of shadow rays in order. Out: of each boundary the share of light that it does not
//! reflect (Schlick 1994, at the angle of the ray, which does not bend), and of each ray the share
//! that volumes leave of it (Beer and Lambert). Volumes nest as for paths (`boundaries.zig`); one
//! that a ray leaves without having entered it is where the ray starts, and one that it does not
//! leave is where it ends. Only in frames where something transmits, one ray after the other.

const std = @import("std");
const world_file = @import("../../world.zig");
const math = @import("../../math.zig");
const bundle_file = @import("../traverse/bundle.zig");
const multi_hit = @import("../traverse/multi_hit.zig");
const ray_file = @import("../traverse/ray.zig");
const boundaries_file = @import("boundaries.zig");
const exponential = @import("../shade/exponential.zig");
const f90_per_f0 = @import("../shade/bsdf.zig").f90_per_f0;
const volumes_file = @import("../shade/volumes.zig");
const vec3 = math.vec3;
const Frame = world_file.Frame;
const Nesting = volumes_file.Nesting;
const Volume = world_file.Volume;

/// Surfaces whose distances along a ray differ by less than this share are in the same place.
const same_place_share = 0x1p-16;

/// The rays of a group.
pub fn Passage(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const Vec3 = Rays.Vec3;
    return struct {
        frame: *const Frame,
        /// By lane, up to the last hit so far.
        nestings: [Kernel.ray_count]Nesting,
        t: [Kernel.ray_count]f32,
        /// Sum of extinction coefficients times ways in units of the ray's direction, by channel.
        depth: [3][Kernel.ray_count]f32,
        /// By hit: share that a boundary does not reflect, 1 where there is none.
        passing: [multi_hit.hits_max][Kernel.ray_count]f32,
        /// By hit, a bit a lane: the boundary is hidden.
        hidden: [multi_hit.hits_max]u32,
        is_started: bool,

        const Self = @This();

        /// Before any hits.
        pub fn start(passage: *Self, frame: *const Frame) void {
            passage.frame = frame;
            passage.t = @splat(0);
            passage.depth = @splat(@splat(0));
            passage.nestings = @splat(.air);
            passage.is_started = false;
        }

        /// Takes the next hits of the active rays, those that are not stopped.
        pub noinline fn take(
            passage: *Self,
            lists: *const multi_hit.HitLists(Kernel),
            group: usize,
            direction: Vec3,
            active: Rays.Mask,
        ) void {
            passage.passing = @splat(@splat(1));
            passage.hidden = @splat(0);
            const ways = [3][Kernel.ray_count]f32{
                direction.x.toArray(), direction.y.toArray(), direction.z.toArray(),
            };
            var bits = active.bits();
            while (bits != 0) : (bits &= bits - 1) {
                const lane = @ctz(bits);
                const way = [3]f32{ ways[0][lane], ways[1][lane], ways[2][lane] };
                const hits = lists.of(group, lane);
                if (!passage.is_started)
                    passage.nestings[lane] = startOf(passage.frame, hits, way);
                var first: usize = 0;
                while (first < hits.len) {
                    const end = placeEnd(hits, first);
                    passage.advance(lane, hits[first].t);
                    passage.cross(lane, hits[first..end], first, way);
                    first = end;
                }
            }
            passage.is_started = true;
        }

        /// The share of light that volumes leave, of rays that end at these `t` if they are finite.
        pub noinline fn left(
            passage: *Self,
            ends: [Kernel.ray_count]f32,
            direction: Vec3,
        ) Vec3 {
            for (ends, 0..) |t, lane| if (t < std.math.inf(f32)) passage.advance(lane, t);
            const depth: Vec3 = .{
                .x = .fromArray(passage.depth[0]),
                .y = .fromArray(passage.depth[1]),
                .z = .fromArray(passage.depth[2]),
            };
            return exponential.transmittance(Rays, depth, direction.length());
        }

        fn advance(passage: *Self, lane: usize, t: f32) void {
            const way = t - passage.t[lane];
            passage.t[lane] = t;
            const rank = passage.nestings[lane].top();
            if (rank == Volume.air) return;
            const sigma = Volume.sigmaOf(passage.frame.materials.volumes, rank);
            for (&passage.depth, sigma) |*depth, channel| depth[lane] += channel * way;
        }

        /// Goes through surfaces in one place. The first that bounds a volume reflects for all
        /// such.
        fn cross(
            passage: *Self,
            lane: usize,
            hits: []const multi_hit.Hit,
            first: usize,
            way: [3]f32,
        ) void {
            const materials = passage.frame.materials;
            var room: Crossings = undefined;
            const crossings = crossingsOf(passage.frame, hits, way, &room);
            const boundary: volumes_file.Boundary = .cross(passage.nestings[lane], crossings);
            passage.nestings[lane] = boundary.beyond;
            var is_first = true;
            for (hits, first..) |hit, index| {
                const number: u32 = @intCast(hit.primitive);
                const material = &materials.all[passage.frame.geometry.face(number).material];
                if (!material.transmits()) continue;
                var f0 = material.dielectric_f0;
                if (boundaries_file.crossingAt(passage.frame, number, way)) |crossing| {
                    if (boundary.isHidden() or !is_first) {
                        passage.hidden[index] |= @as(u32, 1) << @intCast(lane);
                        continue;
                    }
                    is_first = false;
                    f0 = boundary.f0(materials.volumes, crossing.rank) orelse f0;
                }
                passage.passing[index][lane] = 1 - reflectance(passage.frame, number, way, f0);
            }
        }

        fn startOf(frame: *const Frame, hits: []const multi_hit.Hit, way: [3]f32) Nesting {
            var boundary: volumes_file.Boundary = .cross(.air, &.{});
            var first: usize = 0;
            while (first < hits.len) {
                const end = placeEnd(hits, first);
                var crossings: Crossings = undefined;
                boundary.take(crossingsOf(frame, hits[first..end], way, &crossings));
                first = end;
            }
            return boundary.before;
        }
    };
}

/// Takes away what volumes absorb of light on the way of rays that end at limits.
pub noinline fn absorb(
    comptime Kernel: type,
    passages: *[Kernel.group_count]Passage(Kernel),
    bundle: *const bundle_file.Bundle(Kernel),
    limits: *const [Kernel.group_count]ray_file.Hit(Kernel.Rays),
    transmittances: *[Kernel.group_count]Kernel.Rays.Vec3,
) void {
    for (passages, &bundle.groups, limits, transmittances) |*passage, *ray, *limit, *value| {
        if (!passage.is_started) continue;
        value.* = value.mul(passage.left(limit.t.toArray(), ray.line.direction));
    }
}

const Crossings = [multi_hit.hits_max]volumes_file.Crossing;

/// What a ray in some direction goes through at surfaces.
fn crossingsOf(
    frame: *const Frame,
    hits: []const multi_hit.Hit,
    way: [3]f32,
    crossings: *Crossings,
) []const volumes_file.Crossing {
    var count: usize = 0;
    for (hits) |hit| {
        const number: u32 = @intCast(hit.primitive);
        crossings[count] = boundaries_file.crossingAt(frame, number, way) orelse continue;
        count += 1;
    }
    return crossings[0..count];
}

/// Up to where hits are in the same place as the first.
fn placeEnd(hits: []const multi_hit.Hit, first: usize) usize {
    const limit = hits[first].t * (1 + same_place_share);
    var end = first + 1;
    while (end < hits.len and hits[end].t <= limit) end += 1;
    return end;
}

/// What a boundary reflects of light that goes some way (Schlick 1994).
fn reflectance(frame: *const Frame, primitive: u32, way: [3]f32, f0: f32) f32 {
    const plane = boundaries_file.planeOf(frame.geometry, primitive);
    const normal = vec3.normalize(plane) orelse return f0;
    const along = vec3.normalize(way) orelse return f0;
    const cosine = @abs(vec3.dot(normal, along));
    const rest = if (cosine < 1) 1 - cosine else 0;
    const squared = rest * rest;
    const weight = squared * squared * rest;
    const f90 = if (f0 * f90_per_f0 < 1) f0 * f90_per_f0 else 1;
    return f0 + (f90 - f0) * weight;
}
