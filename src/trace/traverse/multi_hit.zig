//! Multi-hit traversal (Gribble, Naveros and Kerzner 2014): the first few hits of rays, in order.
//!
//! In: rays of a bundle, the materials. Out: of each ray its first `hits_max` hits in the order of
//! `ray.Hit`; or, at once, that some hit stops all light. Each goes through the tree once, where a
//! search for the closest hit would go once for each surface on its way. Beams go as ray streams
//! (stream.zig), others one ray after the other.

const std = @import("std");
const world_file = @import("../../world.zig");
const TestCounts = @import("../../statistics.zig").TestCounts;
const ray_file = @import("ray.zig");
const box = @import("box.zig");
const bundle_file = @import("bundle.zig");
const traversal_ray = @import("traversal_ray.zig");
const walk = @import("walk.zig");
const Stream = @import("stream.zig").Stream;
const Geometry = world_file.Geometry;
const Place = bundle_file.Place;

/// Hits that are kept of a ray.
pub const hits_max = 17;

/// A hit of one ray; `ray.Hit` says in which order.
pub const Hit = struct {
    t: f32,
    primitive: i32,

    fn isBefore(hit: Hit, other: Hit) bool {
        return hit.t < other.t or (hit.t == other.t and hit.primitive < other.primitive);
    }
};

/// The first hits of one ray.
pub const HitList = struct {
    count: u32,
    hits: [hits_max]Hit,

    /// Takes a hit that comes before the last where the list is full.
    fn insert(list: *HitList, hit: Hit) void {
        var at = list.count;
        while (at > 0 and hit.isBefore(list.hits[at - 1])) at -= 1;
        // A triangle that is in several leaves is met in each, and hit where it was hit before.
        if (at > 0 and !list.hits[at - 1].isBefore(hit)) return;
        if (at == hits_max) return;
        if (list.count < hits_max) list.count += 1;
        var to = list.count - 1;
        while (to > at) : (to -= 1) list.hits[to] = list.hits[to - 1];
        list.hits[at] = hit;
    }
};

/// Hits of the rays of a bundle.
pub fn HitLists(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const TraversalRay = traversal_ray.TraversalRay(Kernel);
    return struct {
        geometry: *const Geometry,
        materials: []const world_file.Material,
        /// By group and lane; undefined where there was no active ray.
        lists: [Kernel.group_count][Kernel.ray_count]HitList,
        /// By group, the lanes of rays that are stopped.
        stopped: [Kernel.group_count]u32,

        const Self = @This();

        /// Looks for the hits of the active rays.
        pub fn trace(
            lists: *Self,
            bundle: *bundle_file.Bundle(Kernel),
            counts: *TestCounts,
        ) void {
            var stream: Stream(Kernel, .multi_hit) = undefined;
            if (Kernel.variant.traversal == .beam) stream.init(lists.geometry, bundle, lists);
            for (&bundle.groups, &lists.lists, &lists.stopped, 0..) |*group, *each, *stop, number| {
                if (group.active.none()) continue;
                stop.* = 0;
                for (each) |*list| list.count = 0;
                const view = bundle_file.viewOf(Rays, group);
                if (Kernel.variant.traversal == .beam) {
                    const active = group.active;
                    stream.take(number, (&view)[0..1], counts);
                    group.active = active;
                } else lists.traceEach(bundle, number, &view, counts);
            }
            if (Kernel.variant.traversal == .beam) stream.finish(counts);
        }

        /// The hits of active rays of a group that come after `index` others; `no_primitive` where
        /// there are none.
        pub inline fn at(
            lists: *const Self,
            group: usize,
            index: usize,
            active: Rays.Mask,
        ) ray_file.Hit(Rays) {
            var t: [Kernel.ray_count]f32 = @splat(0);
            var primitive: [Kernel.ray_count]i32 = @splat(ray_file.no_primitive);
            var bits = active.bits();
            while (bits != 0) : (bits &= bits - 1) {
                const lane = @ctz(bits);
                const list = &lists.lists[group][lane];
                if (list.count <= index) continue;
                t[lane] = list.hits[index].t;
                primitive[lane] = list.hits[index].primitive;
            }
            return .{ .t = .fromArray(t), .primitive = .fromArray(primitive) };
        }

        /// Of the lanes asked for, a bit each, those whose triangle lets no light pass.
        pub fn stopping(lists: *const Self, primitive: Rays.I32, asked: Rays.Mask) u32 {
            const numbers = primitive.toArray();
            var stops: u32 = 0;
            var bits = asked.bits();
            while (bits != 0) : (bits &= bits - 1) {
                const lane = @ctz(bits);
                if (lists.isStopping(numbers[lane])) stops |= bits & (~bits + 1);
            }
            return stops;
        }

        inline fn isStopping(lists: *const Self, primitive: i32) bool {
            const triangle = &lists.geometry.triangles[@intCast(primitive)];
            return lists.materials[triangle.material].stopsLight();
        }

        /// Every active ray of a group by itself.
        pub fn traceEach(
            lists: *Self,
            bundle: *const bundle_file.Bundle(Kernel),
            group: usize,
            view: *const bundle_file.Precalculations(Rays),
            counts: *TestCounts,
        ) void {
            const rays = &bundle.groups[group];
            var bits = rays.active.bits();
            while (bits != 0) : (bits &= bits - 1) {
                const lane = @ctz(bits);
                var ray: TraversalRay = .of(Rays, false, rays, view, lane);
                var search: Search = .{
                    .lists = lists,
                    .place = .{ .group = @intCast(group), .lane = lane },
                    .ray = &ray,
                    .slabs = ray.slabsOf(),
                    .limit = ray.limit,
                };
                const tree = lists.geometry.tree.get(Kernel.width);
                _ = walk.walk(Kernel, tree, &search, counts);
            }
        }

        /// Keeps a ray's hits of a pack. Returns whether one of them stops it.
        pub inline fn take(
            lists: *Self,
            place: Place,
            ray: *TraversalRay,
            pack: *const world_file.TrianglePack(Kernel.width),
            counts: *TestCounts,
        ) bool {
            const hits = ray.hitsOf(pack, lists.geometry.pad, counts);
            var rest = hits.lanes;
            while (rest != 0) : (rest &= rest - 1) {
                const lane = @ctz(rest);
                if (lists.keep(place, ray, .{
                    .t = hits.t[lane],
                    .primitive = @bitCast(pack.primitive[lane]),
                })) return true;
            }
            return false;
        }

        fn keep(lists: *Self, place: Place, ray: *TraversalRay, hit: Hit) bool {
            if (lists.isStopping(hit.primitive)) {
                lists.stopped[place.group] |= @as(u32, 1) << @intCast(place.lane);
                return true;
            }
            const list = &lists.lists[place.group][place.lane];
            list.insert(hit);
            if (list.count == hits_max) {
                ray.limit = list.hits[hits_max - 1].t;
                ray.closest_primitive = list.hits[hits_max - 1].primitive;
            }
            return false;
        }

        /// A ray on its way through a tree, for `walk.walk`.
        const Search = struct {
            lists: *Self,
            place: Place,
            ray: *TraversalRay,
            slabs: TraversalRay.Slabs,
            limit: f32,

            pub inline fn meet(
                search: *const Search,
                node: *const world_file.Node(Kernel.width),
                counts: *TestCounts,
            ) box.Range(Kernel.Boxes) {
                return search.slabs.meet(false, node, search.limit, counts);
            }

            pub inline fn intersect(
                search: *Search,
                pack: *const world_file.TrianglePack(Kernel.width),
                counts: *TestCounts,
            ) bool {
                const stopped = search.lists.take(search.place, search.ray, pack, counts);
                search.limit = search.ray.limit;
                return stopped;
            }

            pub inline fn isDone(_: *const Search, stopped: bool) bool {
                return stopped;
            }
        };
    };
}

test "a full list keeps the first hits in order, each once" {
    var list: HitList = .{ .count = 0, .hits = undefined };
    var random = std.Random.DefaultPrng.init(11);
    var present: [3][9]bool = @splat(@splat(false));
    for (0..200) |_| {
        const hit: Hit = .{
            .t = @floatFromInt(random.random().uintLessThan(u32, 3)),
            .primitive = random.random().uintLessThan(u31, 9),
        };
        list.insert(hit);
        present[@intFromFloat(hit.t)][@intCast(hit.primitive)] = true;
        var index: u32 = 0;
        for (present, 0..) |row, t| for (row, 0..) |is_present, primitive| {
            if (!is_present or index == hits_max) continue;
            const expected: Hit = .{ .t = @floatFromInt(t), .primitive = @intCast(primitive) };
            try std.testing.expectEqual(expected, list.hits[index]);
            index += 1;
        };
        try std.testing.expectEqual(index, list.count);
    }
}
