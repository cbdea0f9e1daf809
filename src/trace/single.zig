//! One ray after the other through the tree, without company.
//!
//! In: a ray. Out: its nearest hit, or whether there is any. SIMD runs across the tree, so that a
//! ray gains from lanes without company (lone.zig).

const world_file = @import("../world.zig");
const TestCounts = @import("../statistics.zig").TestCounts;
const ray_file = @import("ray.zig");
const box = @import("box.zig");
const lone = @import("lone.zig");
const packet = @import("packet.zig");
const walk = @import("walk.zig");
const Query = walk.Query;
const Single = ray_file.Single;
const World = world_file.World;

/// Looks for a hit and keeps it in `ray.nearest`. Returns whether there was one.
pub fn trace(
    comptime Kernel: type,
    comptime query: Query,
    world: *const World,
    ray: *ray_file.Ray(Single),
    counts: *TestCounts,
) bool {
    const view = packet.viewOf(Single, ray);
    const nearest = traceLane(Kernel, query, Single, world, ray, &view, 0, counts) orelse
        return false;
    ray.nearest = .{ .t = .splat(nearest.t), .primitive = .splat(nearest.primitive) };
    return true;
}

/// Every active ray of a group, of which `view` is the `packet.GroupView`, by itself.
pub fn traceEach(
    comptime Kernel: type,
    comptime query: Query,
    world: *const World,
    group: anytype,
    view: anytype,
    counts: *TestCounts,
) void {
    const Rays = @TypeOf(view.*).Rays;
    var ts = group.nearest.t.toArray();
    var primitives = group.nearest.primitive.toArray();
    var bits = group.active.bits();
    while (bits != 0) : (bits &= bits - 1) {
        const lane = @ctz(bits);
        const nearest = traceLane(Kernel, query, Rays, world, group, view, lane, counts) orelse
            continue;
        ts[lane] = nearest.t;
        primitives[lane] = nearest.primitive;
    }
    group.nearest = .{ .t = .fromArray(ts), .primitive = .fromArray(primitives) };
}

const Found = struct { t: f32, primitive: i32 };

/// The hit of the ray in one lane of a group.
fn traceLane(
    comptime Kernel: type,
    comptime query: Query,
    comptime Rays: type,
    world: *const World,
    group: *const ray_file.Ray(Rays),
    view: *const packet.GroupView(Rays),
    lane: usize,
    counts: *TestCounts,
) ?Found {
    const start = group.line.origin.lane(lane);
    const reach = @max(@abs(start[0]), @abs(start[1]), @abs(start[2]));
    if (reach < world.fused_reach) {
        var ray: lone.Lone(Kernel) = .of(Rays, true, group, view, lane);
        return travel(Kernel, query, true, world, &ray, counts);
    }
    var ray: lone.Lone(Kernel) = .of(Rays, false, group, view, lane);
    return travel(Kernel, query, false, world, &ray, counts);
}

inline fn travel(
    comptime Kernel: type,
    comptime query: Query,
    comptime fused: bool,
    world: *const World,
    ray: *lone.Lone(Kernel),
    counts: *TestCounts,
) ?Found {
    var search: Search(Kernel, query, fused) = .of(ray, world.pad);
    if (!walk.walk(Kernel, world.tree.get(Kernel.width), &search, counts)) return null;
    return .{ .t = ray.limit, .primitive = ray.nearest_primitive };
}

/// A ray on its way through a tree, for `walk.walk`. `fused` as in `Lone.of`.
pub fn Search(comptime Kernel: type, comptime query: Query, comptime fused: bool) type {
    const Lone = lone.Lone(Kernel);
    return struct {
        ray: *Lone,
        slabs: Lone.Slabs,
        /// That of the ray.
        limit: f32,
        /// See `World.pad`.
        pad: f32,

        const Self = @This();

        /// Keeps the hit in `ray`.
        pub inline fn of(ray: *Lone, pad: f32) Self {
            return .{ .ray = ray, .slabs = ray.slabsOf(), .limit = ray.limit, .pad = pad };
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
            block: *const world_file.TriangleBlock(Kernel.width),
            counts: *TestCounts,
        ) bool {
            const found = search.ray.intersect(block, search.pad, counts);
            search.limit = search.ray.limit;
            return found;
        }

        /// See `walk.walk`.
        pub inline fn isDone(_: *const Self, found: bool) bool {
            return query == .any and found;
        }
    };
}
