//! Single-ray traversal of the wide BVH: one ray against all children of a node at once.
//!
//! In: a ray. Out: its closest hit, or whether there is any. SIMD runs across the tree, so that a
//! single ray gains from lanes, too (traversal_ray.zig).

const world_file = @import("../../world.zig");
const TestCounts = @import("../../statistics.zig").TestCounts;
const ray_file = @import("ray.zig");
const box = @import("box.zig");
const traversal_ray = @import("traversal_ray.zig");
const bundle_file = @import("bundle.zig");
const walk = @import("walk.zig");
const Query = walk.Query;
const Single = ray_file.Single;
const Geometry = world_file.Geometry;

/// Looks for a hit and keeps it in `ray.closest`. Returns whether there was one.
pub fn trace(
    comptime Kernel: type,
    comptime query: Query,
    geometry: *const Geometry,
    ray: *ray_file.Ray(Single),
    counts: *TestCounts,
) bool {
    const view = bundle_file.viewOf(Single, &geometry.padding, ray);
    const closest = traceLane(Kernel, query, Single, geometry, ray, &view, 0, counts) orelse
        return false;
    ray.closest = .{ .t = .splat(closest.t), .primitive = .splat(closest.primitive) };
    return true;
}

/// Every active ray of a group, of which `view` is the `bundle.Precalculations`, by itself.
pub fn traceEach(
    comptime Kernel: type,
    comptime query: Query,
    geometry: *const Geometry,
    group: anytype,
    view: anytype,
    counts: *TestCounts,
) void {
    const Rays = @TypeOf(view.*).Rays;
    var ts = group.closest.t.toArray();
    var primitives = group.closest.primitive.toArray();
    var bits = group.active.bits();
    while (bits != 0) : (bits &= bits - 1) {
        const lane = @ctz(bits);
        const closest = traceLane(Kernel, query, Rays, geometry, group, view, lane, counts) orelse
            continue;
        ts[lane] = closest.t;
        primitives[lane] = closest.primitive;
    }
    group.closest = .{ .t = .fromArray(ts), .primitive = .fromArray(primitives) };
}

const Found = struct { t: f32, primitive: i32 };

/// The hit of the ray in one lane of a group.
fn traceLane(
    comptime Kernel: type,
    comptime query: Query,
    comptime Rays: type,
    geometry: *const Geometry,
    group: *const ray_file.Ray(Rays),
    view: *const bundle_file.Precalculations(Rays),
    lane: usize,
    counts: *TestCounts,
) ?Found {
    if (view.fusable.lane(lane)) {
        var ray: traversal_ray.TraversalRay(Kernel) = .of(Rays, true, group, view, lane);
        return travel(Kernel, query, true, geometry, &ray, counts);
    }
    var ray: traversal_ray.TraversalRay(Kernel) = .of(Rays, false, group, view, lane);
    return travel(Kernel, query, false, geometry, &ray, counts);
}

inline fn travel(
    comptime Kernel: type,
    comptime query: Query,
    comptime fused: bool,
    geometry: *const Geometry,
    ray: *traversal_ray.TraversalRay(Kernel),
    counts: *TestCounts,
) ?Found {
    var search: Search(Kernel, query, fused) = .of(ray, &geometry.padding);
    if (!walk.walk(Kernel, geometry, &search, counts)) return null;
    return .{ .t = ray.limit, .primitive = ray.closest_primitive };
}

/// A ray on its way through a tree, for `walk.walk`. `fused` as in `TraversalRay.of`.
pub fn Search(comptime Kernel: type, comptime query: Query, comptime fused: bool) type {
    const TraversalRay = traversal_ray.TraversalRay(Kernel);
    return struct {
        ray: *TraversalRay,
        slabs: TraversalRay.Slabs,
        /// That of the ray.
        limit: f32,
        padding: *const world_file.Padding,

        const Self = @This();

        /// Keeps the hit in `ray`.
        pub inline fn of(ray: *TraversalRay, padding: *const world_file.Padding) Self {
            return .{
                .ray = ray,
                .slabs = ray.slabsOf(),
                .limit = ray.limit,
                .padding = padding,
            };
        }

        /// See `walk.walk`.
        pub inline fn meet(
            search: *const Self,
            node: *const world_file.Node(Kernel.width),
            counts: *TestCounts,
        ) box.Range(Kernel.Boxes) {
            return search.slabs.meet(fused, node, search.limit, counts);
        }

        /// See `walk.walk`.
        pub inline fn intersect(
            search: *Self,
            pack: *const world_file.TrianglePack(Kernel.width),
            counts: *TestCounts,
        ) bool {
            const found = search.ray.intersect(pack, search.padding, counts);
            search.limit = search.ray.limit;
            return found;
        }

        /// See `walk.walk`.
        pub inline fn isDone(_: *const Self, found: bool) bool {
            return query == .any_hit and found;
        }
    };
}
