//! Multi-hit traversal (Gribble, Naveros and Kerzner 2014): the first few hits of rays, in order.
//!
//! In: rays of a bundle, the materials. Out: of each ray its first `hits_max` hits in the order of
//! `ray.Hit`; or, at once, that some hit stops all light. Each goes through the tree once, where a
//! search for the closest hit would go once for each surface on its way. The rays of beams go as
//! interval packets and ray streams, others one after the other.

const std = @import("std");
const world_file = @import("../../world.zig");
const TestCounts = @import("../../statistics.zig").TestCounts;
const ray_file = @import("ray.zig");
const box = @import("box.zig");
const bundle_file = @import("bundle.zig");
const traversal_ray = @import("traversal_ray.zig");
const triangle = @import("triangle.zig");
const walk = @import("walk.zig");
const interval_packet = @import("interval_packet.zig");
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

/// Takes a hit into a list that is in order and has no more than the first `hits_max`. Returns how
/// many it then has.
fn insert(list: *[hits_max]Hit, count: u32, hit: Hit) u32 {
    var at = count;
    while (at > 0 and hit.isBefore(list[at - 1])) at -= 1;
    // A triangle that is in several leaves is met in each, and hit where it was hit before.
    if (at > 0 and !list[at - 1].isBefore(hit)) return count;
    if (at == hits_max) return count;
    const new_count = @min(count + 1, hits_max);
    var to = new_count - 1;
    while (to > at) : (to -= 1) list[to] = list[to - 1];
    list[at] = hit;
    return new_count;
}

/// Hits of the rays of a bundle.
pub fn HitLists(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const TraversalRay = traversal_ray.TraversalRay(Kernel);
    return struct {
        geometry: *const Geometry,
        materials: *const world_file.Materials,
        /// By group and lane; undefined where there was no active ray.
        counts: [Kernel.group_count][Kernel.ray_count]u32,
        /// The hits of each in order.
        hits: [Kernel.group_count][Kernel.ray_count][hits_max]Hit,
        /// By group, the lanes of rays that are stopped.
        stopped: [Kernel.group_count]u32,

        const Self = @This();

        /// Looks for the hits of the active rays.
        pub fn trace(
            lists: *Self,
            bundle: *bundle_file.Bundle(Kernel),
            tests: *TestCounts,
        ) void {
            for (&bundle.groups, 0..) |*group, number| {
                if (group.active.none()) continue;
                lists.stopped[number] = 0;
                lists.counts[number] = @splat(0);
                if (Kernel.variant.traversal == .beam) continue;
                const view = bundle_file.viewOf(Rays, &lists.geometry.padding, group);
                lists.traceEach(bundle, number, &view, tests);
            }
            if (Kernel.variant.traversal == .beam)
                interval_packet.traceMultiHit(Kernel, bundle, lists, tests);
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
                if (lists.counts[group][lane] <= index) continue;
                const hit = &lists.hits[group][lane][index];
                t[lane] = hit.t;
                primitive[lane] = hit.primitive;
            }
            return .{ .t = .fromArray(t), .primitive = .fromArray(primitive) };
        }

        /// The hits of an active ray in order; none if it is stopped.
        pub fn of(lists: *const Self, group: usize, lane: usize) []const Hit {
            if (lists.stopped[group] >> @intCast(lane) & 1 != 0) return &.{};
            return lists.hits[group][lane][0..lists.counts[group][lane]];
        }

        /// Of the lanes asked for, a bit each, those whose triangle lets no light pass.
        pub fn stopping(lists: *const Self, primitive: Rays.I32, asked: Rays.Mask) u32 {
            const numbers = primitive.toArray();
            var stops: u32 = 0;
            var bits = asked.bits();
            while (bits != 0) : (bits &= bits - 1) {
                const lane = @ctz(bits);
                const is_stopping = lists.materials.isOccluder(@intCast(numbers[lane]));
                stops |= @as(u32, @intFromBool(is_stopping)) << @intCast(lane);
            }
            return stops;
        }

        /// Every active ray of a group by itself.
        pub fn traceEach(
            lists: *Self,
            bundle: *const bundle_file.Bundle(Kernel),
            group: usize,
            view: *const bundle_file.Precalculations(Rays),
            tests: *TestCounts,
        ) void {
            const rays = &bundle.groups[group];
            var bits = rays.active.bits();
            while (bits != 0) : (bits &= bits - 1) {
                const lane = @ctz(bits);
                var ray: TraversalRay = .of(Rays, false, rays, view, lane);
                var search: Search(false) =
                    .of(lists, .{ .group = @intCast(group), .lane = lane }, &ray);
                _ = walk.walk(Kernel, lists.geometry, &search, tests);
            }
        }

        /// Keeps a ray's hits of a pack. Returns whether one of them stops it.
        pub inline fn take(
            lists: *Self,
            place: Place,
            ray: *TraversalRay,
            pack: *const world_file.TrianglePack(Kernel.width),
            tests: *TestCounts,
        ) bool {
            var hits: triangle.Intersection(Kernel.Boxes) = undefined;
            if (!ray.hitsOf(pack, &lists.geometry.padding, tests, &hits)) return false;
            const ts = hits.t.toArray();
            var rest = hits.mask.bits();
            while (rest != 0) : (rest &= rest - 1) {
                const lane = @ctz(rest);
                const number: i32 = @bitCast(pack.primitive[lane]);
                const limit = lists.keep(place, .{ .t = ts[lane], .primitive = number }) orelse
                    continue;
                ray.limit = limit.t;
                ray.closest_primitive = limit.primitive;
                if (limit.t < 0) return true;
            }
            return false;
        }

        /// The same of one triangle of a pack, hit by rays of a group; whether any limit changes.
        pub inline fn takeLane(
            lists: *Self,
            number: usize,
            group: *ray_file.Ray(Rays),
            view: *const bundle_file.Precalculations(Rays),
            pack: *const world_file.TrianglePack(Kernel.width),
            which: bundle_file.At,
            tests: *TestCounts,
        ) bool {
            var hit: triangle.Intersection(Rays) = undefined;
            if (!bundle_file.hitsOfLane(Kernel, group, view, pack, which, tests, &hit))
                return false;
            var rest = hit.mask.bits();
            const found = hit.t.toArray();
            var ts = group.closest.t.toArray();
            var primitives = group.closest.primitive.toArray();
            var changes = false;
            while (rest != 0) : (rest &= rest - 1) {
                const lane = @ctz(rest);
                const limit = lists.keep(.{ .group = @intCast(number), .lane = lane }, .{
                    .t = found[lane],
                    .primitive = @bitCast(pack.primitive[which.lane]),
                }) orelse continue;
                ts[lane] = limit.t;
                primitives[lane] = limit.primitive;
                changes = true;
            }
            group.closest = .{ .t = .fromArray(ts), .primitive = .fromArray(primitives) };
            return changes;
        }

        /// Keeps a hit. Returns the ray's new limit where that changes; nothing is before that of a
        /// ray that is stopped.
        pub fn keep(lists: *Self, place: Place, hit: Hit) ?Hit {
            const number: u32 = @intCast(hit.primitive);
            if (lists.materials.isOccluder(number)) {
                lists.stopped[place.group] |= @as(u32, 1) << @intCast(place.lane);
                return .{ .t = -std.math.inf(f32), .primitive = hit.primitive };
            }
            // Its material is asked for next.
            if (lists.geometry.shared.runs.len == 0)
                @prefetch(&lists.geometry.triangles[number], .{});
            const list = &lists.hits[place.group][place.lane];
            const count = &lists.counts[place.group][place.lane];
            count.* = insert(list, count.*, hit);
            return if (count.* == hits_max) list[hits_max - 1] else null;
        }

        /// A ray on its way through a tree, for `walk.walk`. `fused` as in `TraversalRay.of`.
        pub fn Search(comptime fused: bool) type {
            return struct {
                lists: *Self,
                place: Place,
                ray: *TraversalRay,
                slabs: TraversalRay.Slabs,
                limit: f32,

                pub inline fn of(lists: *Self, place: Place, ray: *TraversalRay) @This() {
                    return .{
                        .lists = lists,
                        .place = place,
                        .ray = ray,
                        .slabs = ray.slabsOf(),
                        .limit = ray.limit,
                    };
                }

                pub inline fn meet(
                    search: *const @This(),
                    node: *const world_file.Node(Kernel.width),
                    tests: *TestCounts,
                ) box.Range(Kernel.Boxes) {
                    return search.slabs.meet(fused, node, search.limit, tests);
                }

                pub inline fn intersect(
                    search: *@This(),
                    pack: *const world_file.TrianglePack(Kernel.width),
                    tests: *TestCounts,
                ) bool {
                    const stopped = search.lists.take(search.place, search.ray, pack, tests);
                    search.limit = search.ray.limit;
                    return stopped;
                }

                pub inline fn isDone(_: *const @This(), stopped: bool) bool {
                    return stopped;
                }
            };
        }
    };
}

test "a full list keeps the first hits in order, each once" {
    var list: [hits_max]Hit = undefined;
    var count: u32 = 0;
    var random = std.Random.DefaultPrng.init(11);
    var present: [3][9]bool = @splat(@splat(false));
    for (0..200) |_| {
        const hit: Hit = .{
            .t = @floatFromInt(random.random().uintLessThan(u32, 3)),
            .primitive = random.random().uintLessThan(u31, 9),
        };
        count = insert(&list, count, hit);
        present[@intFromFloat(hit.t)][@intCast(hit.primitive)] = true;
        var index: u32 = 0;
        for (present, 0..) |row, t| for (row, 0..) |is_present, primitive| {
            if (!is_present or index == hits_max) continue;
            const expected: Hit = .{ .t = @floatFromInt(t), .primitive = @intCast(primitive) };
            try std.testing.expectEqual(expected, list[index]);
            index += 1;
        };
        try std.testing.expectEqual(index, count);
    }
}
