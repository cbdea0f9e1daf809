//! Boundaries of volumes that the rays of paths hit: what is on either side of them.
//!
//! In: hits, the volumes that rays are in (`../shade/volumes.zig`). Out: ratios of indices of
//! refraction, what is beyond, and where a boundary is hidden. One lane after the other: only in
//! frames with volumes, and only where one is hit. A camera is in air.

const world_file = @import("../../world.zig");
const math = @import("../../math.zig");
const multi_hit = @import("../traverse/multi_hit.zig");
const ray_file = @import("../traverse/ray.zig");
const visibility_file = @import("visibility.zig");
const interaction_file = @import("../shade/interaction.zig");
const offset = @import("../shade/offset.zig");
const volumes_file = @import("../shade/volumes.zig");
const vec3 = math.vec3;
const Crossing = volumes_file.Crossing;
const Frame = world_file.Frame;
const Nesting = volumes_file.Nesting;
const Volume = world_file.Volume;

/// What a ray in some direction goes through at a triangle; null if that bounds nothing that nests.
pub fn crossingAt(frame: *const Frame, primitive: u32, direction: [3]f32) ?Crossing {
    const geometry = frame.geometry;
    const rank = frame.materials.all[geometry.face(primitive).material].volume_rank;
    const volumes = frame.materials.volumes;
    if (rank >= volumes.len or !volumes[rank].nests) return null;
    const plane = planeOf(geometry, primitive);
    return .{ .rank = rank, .is_leaving = vec3.dot(plane, direction) > 0 };
}

/// The normal of a triangle, twice its area long.
pub fn planeOf(geometry: *const world_file.Geometry, primitive: u32) [3]f32 {
    const face = geometry.face(primitive);
    const first = face.position(geometry, 0);
    return vec3.cross(
        vec3.sub(face.position(geometry, 1), first),
        vec3.sub(face.position(geometry, 2), first),
    );
}

/// Finds what the hits of a path's rays do to the volumes that they are in.
pub fn search(comptime Kernel: type, visibility: anytype, path: anytype) void {
    const found = findAll(Kernel, visibility, path, null);
    if (found.any_hidden or (found.any_met and visibility.frame.materials.volumes.len > 1))
        searchTouching(Kernel, visibility, path);
    if (found.any_met) for (&visibility.boundaries) |*boundaries| {
        visibility.cuts.nested += boundaries.forgotten_count;
    };
}

const Found = struct { any_met: bool, any_hidden: bool };

fn findAll(
    comptime Kernel: type,
    visibility: anytype,
    path: anytype,
    touching: ?*const multi_hit.HitLists(Kernel),
) Found {
    var found: Found = .{ .any_met = false, .any_hidden = false };
    for (&visibility.boundaries, &path.bundle.groups, 0..) |*boundaries, *ray, group| {
        boundaries.find(visibility.frame, ray, &path.nestings[group], group, touching);
        found.any_met = found.any_met or boundaries.met.any();
        found.any_hidden = found.any_hidden or boundaries.hidden.any();
    }
    return found;
}

/// The same with boundaries so near to each other that rays which start off the first have the
/// others behind them.
noinline fn searchTouching(comptime Kernel: type, visibility: anytype, path: anytype) void {
    const Rays = Kernel.Rays;
    const frame: *const Frame = visibility.frame;
    var bundle = path.bundle;
    for (&bundle.groups, &visibility.boundaries) |*ray, *boundaries| {
        ray.active = boundaries.met;
        if (ray.active.none()) continue;
        const corners: interaction_file.Corners(Rays) =
            .of(frame.geometry, ray.closest.primitive, ray.active);
        const hit = visibility_file.hitOf(Rays, ray, &corners, ray.active);
        const point = interaction_file.resolve(Rays, frame, &corners, &hit);
        const length = offset.length(Rays, point.error_ulps, .zero(), point.offset_max);
        const cosine = point.normal_geometric.dot(point.view).max(.splat(1e-3));
        const reach = length.div(cosine.mul(ray.line.direction.length()));
        ray.tnear = ray.closest;
        ray.closest = .before(ray.tnear.t.add(reach));
    }
    visibility.hits.trace(&bundle, &visibility.tests);
    _ = findAll(Kernel, visibility, path, &visibility.hits);
}

/// Those that the rays of a group hit.
pub fn Boundaries(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const Vec3 = Rays.Vec3;
    return struct {
        /// Lanes that hit one.
        met: Rays.Mask,
        /// Of these where the same volume is on both sides.
        hidden: Rays.Mask,
        /// Of these where the reflectance is another than that of the material in air.
        is_between: Rays.Mask,
        /// By lane: `volumes_file.Boundary.eta` and `f0`.
        eta: [Kernel.ray_count]f32,
        f0: [Kernel.ray_count]f32,
        /// Of what is beyond, by channel.
        sigma_t: [3][Kernel.ray_count]f32,
        /// Hits where rays enter more volumes than are told apart.
        forgotten_count: u32,
        /// What rays are in beyond, whatever they hit.
        beyond: [Kernel.ray_count]Nesting,

        const Self = @This();

        /// Those of all hits, each with those of `touching` hits behind it, if they are known.
        /// Where touching boundaries hide each other, the last of them becomes the ray's hit.
        pub noinline fn find(
            boundaries: *Self,
            frame: *const Frame,
            ray: *ray_file.Ray(Rays),
            nestings: *const [Kernel.ray_count]Nesting,
            group: usize,
            touching: ?*const multi_hit.HitLists(Kernel),
        ) void {
            const volumes = frame.materials.volumes;
            const directions = arraysOf(ray.line.direction);
            const missed = ray.closest.primitive.eq(.splat(ray_file.no_primitive));
            var ts = ray.closest.t.toArray();
            var primitives = ray.closest.primitive.toArray();
            var masks: [3]u32 = @splat(0);
            boundaries.beyond = nestings.*;
            boundaries.forgotten_count = 0;
            boundaries.eta = @splat(1);
            boundaries.f0 = @splat(0);
            boundaries.sigma_t = @splat(@splat(0));
            var bits = ray.active.andNot(missed).bits();
            while (bits != 0) : (bits &= bits - 1) {
                const lane = @ctz(bits);
                const bit = @as(u32, 1) << @intCast(lane);
                const direction = laneOf(directions, lane);
                boundaries.putAlone(frame, lane, @intCast(primitives[lane]), direction);
                var crossings: [multi_hit.hits_max + 1]Crossing = undefined;
                crossings[0] = crossingAt(frame, @intCast(primitives[lane]), direction) orelse
                    continue;
                masks[0] |= bit;
                var count: usize = 1;
                var last: multi_hit.Hit = .{ .t = ts[lane], .primitive = primitives[lane] };
                if (touching) |lists| for (lists.of(group, lane)) |hit| {
                    crossings[count] = crossingAt(frame, @intCast(hit.primitive), direction) orelse
                        continue;
                    count += 1;
                    last = hit;
                };
                const boundary: volumes_file.Boundary =
                    .cross(nestings[lane], crossings[0..count]);
                boundaries.beyond[lane] = boundary.beyond;
                const is_forgotten = nestings[lane].isFull() and boundary.beyond.isFull() and
                    !crossings[0].is_leaving;
                boundaries.forgotten_count += @intFromBool(is_forgotten);
                boundaries.eta[lane] = boundary.eta(volumes);
                const sigma = Volume.sigmaOf(volumes, boundary.beyond.top());
                for (&boundaries.sigma_t, sigma) |*to, channel| to[lane] = channel;
                if (boundary.f0(volumes, crossings[0].rank)) |f0| {
                    boundaries.f0[lane] = f0;
                    masks[2] |= bit;
                }
                if (!boundary.isHidden()) continue;
                masks[1] |= bit;
                ts[lane] = last.t;
                primitives[lane] = last.primitive;
            }
            boundaries.met = .fromBits(masks[0]);
            boundaries.hidden = .fromBits(masks[1]);
            boundaries.is_between = .fromBits(masks[2]);
            if (touching == null or masks[1] == 0) return;
            ray.closest = .{ .t = .fromArray(ts), .primitive = .fromArray(primitives) };
        }

        /// Tells the points of the hits.
        pub fn apply(
            boundaries: *const Self,
            point: *interaction_file.Interaction(Rays),
        ) void {
            const material = &point.material;
            point.eta = .fromArray(boundaries.eta);
            point.sigma_beyond = .{
                .x = .fromArray(boundaries.sigma_t[0]),
                .y = .fromArray(boundaries.sigma_t[1]),
                .z = .fromArray(boundaries.sigma_t[2]),
            };
            point.beyond = boundaries.beyond;
            point.hidden = boundaries.hidden;
            point.opacity = .select(boundaries.hidden, .zero(), point.opacity);
            const f0: F32 = .fromArray(boundaries.f0);
            material.dielectric_f0 = .select(boundaries.is_between, f0, material.dielectric_f0);
        }

        /// Of a volume that does not nest.
        fn putAlone(
            boundaries: *Self,
            frame: *const Frame,
            lane: usize,
            primitive: u32,
            direction: [3]f32,
        ) void {
            const volumes = frame.materials.volumes;
            const material = frame.geometry.face(primitive).material;
            const rank = frame.materials.all[material].volume_rank;
            if (rank >= volumes.len or volumes[rank].nests) return;
            const ior = volumes[rank].ior;
            const is_leaving = vec3.dot(planeOf(frame.geometry, primitive), direction) > 0;
            boundaries.eta[lane] = if (is_leaving) ior else 1 / ior;
            if (is_leaving) return;
            for (&boundaries.sigma_t, volumes[rank].sigma_t) |*to, channel| to[lane] = channel;
        }

        fn arraysOf(vector: Vec3) [3][Kernel.ray_count]f32 {
            return .{ vector.x.toArray(), vector.y.toArray(), vector.z.toArray() };
        }

        fn laneOf(vectors: [3][Kernel.ray_count]f32, lane: usize) [3]f32 {
            return .{ vectors[0][lane], vectors[1][lane], vectors[2][lane] };
        }
    };
}
