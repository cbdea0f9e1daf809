//! Search of an interval packet through the tree: intervals, then one ray, then all decide.
//!
//! In: coherent rays of a subtile, all of one octant. Out: their hits. A child that the intervals
//! meet is visited where the guide, the first ray, enters it or else any ray does; at a leaf, rays
//! that enter the box around the triangles that the intervals meet are tested against these.

const std = @import("std");
const world_file = @import("../../world.zig");
const TestCounts = @import("../../statistics.zig").TestCounts;
const ray_file = @import("ray.zig");
const box = @import("box.zig");
const bundle_file = @import("bundle.zig");
const intervals = @import("interval.zig");
const traversal_ray = @import("traversal_ray.zig");
const walk = @import("walk.zig");
const Lists = @import("stream.zig").Lists;
const PacketBudget = @import("interval_packet.zig").PacketBudget;
const Query = walk.Query;
const Geometry = world_file.Geometry;

/// For `walk.walk`.
pub fn Search(comptime Kernel: type, comptime query: Query) type {
    const Boxes = Kernel.Boxes;
    const Rays = Kernel.Rays;
    const F32 = Boxes.F32;
    const TraversalRay = traversal_ray.TraversalRay(Kernel);
    return struct {
        groups: *[Kernel.subtile_groups]ray_file.Ray(Rays),
        views: *const [Kernel.subtile_groups]bundle_file.Precalculations(Rays),
        /// Whether the way is down, by axis.
        octant: [3]bool,
        /// The first ray by itself: what it enters need not be tested against the others.
        guide: TraversalRay.Slabs,
        guide_limit: f32,
        /// By axis.
        slabs: [3]Slab,
        tnear_t: F32,
        /// The greatest t that matters.
        limit: f32,
        padding: *const world_file.Padding,
        budget: PacketBudget,
        /// That of `groups` in its bundle.
        first_group: u32,
        lists: Lists(Kernel, query),

        const Self = @This();
        const Range = box.Range(Boxes);
        const Slab = intervals.Slab(Boxes);

        /// For active rays that lie between the ends.
        pub inline fn init(
            geometry: *const Geometry,
            groups: *[Kernel.subtile_groups]ray_file.Ray(Rays),
            views: *const [Kernel.subtile_groups]bundle_file.Precalculations(Rays),
            octant: [3]bool,
            ends: *const intervals.Ends,
            budget: PacketBudget,
            first_group: usize,
            lists: Lists(Kernel, query),
        ) Self {
            const guide: TraversalRay = for (groups, views) |*group, *view| {
                const bits = group.active.bits();
                if (bits != 0) break .of(Rays, true, group, view, @ctz(bits));
            } else unreachable;
            var slabs: [3]Slab = undefined;
            for (&slabs, octant, ends.origin, ends.inverse) |*slab, down, from, inverse| {
                slab.* = .init(down, from, inverse);
            }
            return .{
                .groups = groups,
                .views = views,
                .octant = octant,
                .guide = guide.slabsOf(),
                .guide_limit = guide.limit,
                .slabs = slabs,
                .tnear_t = .splat(ends.tnear_t),
                .limit = ends.closest_t,
                .padding = &geometry.padding,
                .budget = budget,
                .first_group = @intCast(first_group),
                .lists = lists,
            };
        }

        /// Bounds of where rays are within the children's boxes. Where the intervals meet a child
        /// that the guide does not enter, the rays decide. Without budget left, nothing is
        /// met any more.
        pub inline fn meet(
            search: *Self,
            node: *const world_file.Node(Kernel.width),
            counts: *TestCounts,
        ) Range {
            walk.countNode(Kernel, node, counts);
            var near: [3]F32 = undefined;
            var far: [3]F32 = undefined;
            const guide = &search.guide;
            inline for (&near, &far, &search.slabs, 0..) |*first, *last, *slab, axis| {
                first.* = slab.near(TraversalRay.facesFrom(node, guide.near_at[axis]));
                last.* = slab.far(TraversalRay.facesFrom(node, guide.far_at[axis]));
            }
            var range = search.within(near, far);
            const guided = guide.meet(true, node, search.guide_limit, counts);
            var met = range.isMet().andNot(guided.isMet()).bits();
            if (query != .closest_hit) search.budget.earn();
            if (met == 0) return range;
            var nears = range.near.toArray();
            while (met != 0) : (met &= met - 1) {
                const child = @ctz(met);
                if (search.isEntered(node, child, counts)) continue;
                nears[child] = std.math.inf(f32);
                if (query != .closest_hit) search.budget.spend();
            }
            if (query != .closest_hit and !search.budget.lasts()) {
                search.limit = -std.math.inf(f32);
                return .{ .near = .splat(0), .far = .splat(search.limit) };
            }
            range.near = .fromArray(nears);
            return range;
        }

        /// Whether any ray enters a child.
        fn isEntered(
            search: *const Self,
            node: *const world_file.Node(Kernel.width),
            child: usize,
            counts: *TestCounts,
        ) bool {
            var near: [3]f32 = undefined;
            var far: [3]f32 = undefined;
            const guide = &search.guide;
            for (&near, &far, guide.near_at, guide.far_at) |*first, *last, near_at, far_at| {
                first.* = TraversalRay.rowFrom(node, near_at)[child];
                last.* = TraversalRay.rowFrom(node, far_at)[child];
            }
            for (0..Kernel.subtile_groups) |index| {
                if (search.entering(index, near, far, counts).any()) return true;
            }
            return false;
        }

        /// Rays of a group that enter the box with these faces: by multiply-adds, and without
        /// asking each for its signs, since all are of one octant.
        inline fn entering(
            search: *const Self,
            index: usize,
            near: [3]f32,
            far: [3]f32,
            counts: *TestCounts,
        ) Rays.Mask {
            const group = &search.groups[index];
            bundle_file.countBoxes(Kernel, group, counts);
            const inverse = search.views[index].slabs.direction_inv;
            const near_shift = search.views[index].near_shift;
            const far_shift = search.views[index].far_shift;
            var first: [3]Rays.F32 = undefined;
            var last: [3]Rays.F32 = undefined;
            inline for (&first, &last, near, far, .{ "x", "y", "z" }) |*a, *b, low, high, axis| {
                const factor = @field(inverse, axis);
                a.* = Rays.F32.splat(low).mulAdd(factor, @field(near_shift, axis));
                b.* = Rays.F32.splat(high).mulAdd(factor, @field(far_shift, axis));
            }
            const range = box.between(Rays, first, last, group.tnear.t, group.closest.t);
            return range.isMet().bitAnd(group.active);
        }

        inline fn within(search: *const Self, near: [3]F32, far: [3]F32) Range {
            return box.between(Boxes, near, far, search.tnear_t, .splat(search.limit));
        }

        /// See `walk.walk`.
        pub inline fn isDone(_: *const Self, _: bool) bool {
            return false; // Nothing is near enough when all rays are done: see `shrink`.
        }

        /// Tests the triangles of a pack whose boxes the intervals meet, against those rays that
        /// enter the box around these triangles: ray by ray or triangle by triangle, whichever are
        /// fewer. Returns whether any ray hit one.
        pub inline fn intersect(
            search: *Self,
            pack: *const world_file.TrianglePack(Kernel.width),
            counts: *TestCounts,
        ) bool {
            const met = search.meetBoxes(pack);
            if (met.lanes == 0) return false;
            const triangle_count = @popCount(met.lanes);
            var found = false;
            for (search.groups, 0..) |*group, index| {
                if (group.active.none()) continue;
                const rays = search.entering(index, met.near, met.far, counts).bits();
                if (rays == 0) continue;
                const hit = if (@popCount(rays) < triangle_count)
                    search.intersectEach(index, rays, pack, counts)
                else
                    search.intersectAll(index, met.lanes, pack, counts);
                found = found or hit;
            }
            if (found) search.shrink();
            return found;
        }

        /// Triangles of a pack, a bit each, and the near and far faces of the box around them.
        const Met = struct { lanes: u32, near: [3]f32, far: [3]f32 };

        /// Triangles whose grown boxes the intervals meet.
        inline fn meetBoxes(
            search: *const Self,
            pack: *const world_file.TrianglePack(Kernel.width),
        ) Met {
            var near: [3]F32 = undefined;
            var far: [3]F32 = undefined;
            var lowers: [3]F32 = undefined;
            var uppers: [3]F32 = undefined;
            inline for (&lowers, &uppers, 0..) |*lower, *upper, axis| {
                const a: F32 = .load(&pack.corner[0][axis]);
                const b: F32 = .load(&pack.corner[1][axis]);
                const c: F32 = .load(&pack.corner[2][axis]);
                lower.* = a.minFast(b).minFast(c);
                upper.* = a.maxFast(b).maxFast(c);
            }
            const grow = search.padding.marginOfBoxes(
                Boxes,
                .{ .x = lowers[0], .y = lowers[1], .z = lowers[2] },
                .{ .x = uppers[0], .y = uppers[1], .z = uppers[2] },
            );
            inline for (&near, &far, &search.slabs, 0..) |*first, *last, *slab, axis| {
                lowers[axis] = lowers[axis].sub(grow);
                uppers[axis] = uppers[axis].add(grow);
                first.* = slab.near(.select(slab.negative, uppers[axis], lowers[axis]));
                last.* = slab.far(.select(slab.negative, lowers[axis], uppers[axis]));
            }
            const range = search.within(near, far);
            const primitive: Boxes.I32 = .load(@ptrCast(&pack.primitive));
            const there = primitive.gt(.splat(ray_file.no_primitive));
            const lanes = range.isMet().bitAnd(there);
            var met: Met = .{ .lanes = lanes.bits(), .near = undefined, .far = undefined };
            if (met.lanes == 0) return met;
            const inf: F32 = .splat(std.math.inf(f32));
            inline for (0..3) |axis| {
                const lower = F32.select(lanes, lowers[axis], inf).reduceMin();
                const upper = F32.select(lanes, uppers[axis], inf.neg()).reduceMax();
                met.near[axis] = if (search.octant[axis]) upper else lower;
                met.far[axis] = if (search.octant[axis]) lower else upper;
            }
            return met;
        }

        /// Some rays of a group, each against all triangles of a pack.
        fn intersectEach(
            search: *Self,
            index: usize,
            lanes: u32,
            pack: *const world_file.TrianglePack(Kernel.width),
            counts: *TestCounts,
        ) bool {
            const group = &search.groups[index];
            const view = &search.views[index];
            var found: u32 = 0;
            var ts = group.closest.t.toArray();
            var primitives = group.closest.primitive.toArray();
            var rest = lanes;
            while (rest != 0) : (rest &= rest - 1) {
                const lane = @ctz(rest);
                var ray: TraversalRay = .of(Rays, true, group, view, lane);
                const place: bundle_file.Place =
                    .{ .group = search.first_group + @as(u32, @intCast(index)), .lane = lane };
                const closer = if (query == .multi_hit)
                    search.lists.take(place, &ray, pack, counts) or ray.limit < ts[lane]
                else
                    ray.intersect(pack, search.padding, counts);
                if (!closer) continue;
                found |= @as(u32, 1) << @intCast(lane);
                ts[lane] = if (query == .any_hit) -std.math.inf(f32) else ray.limit;
                primitives[lane] = ray.closest_primitive;
            }
            if (found == 0) return false;
            group.closest = .{ .t = .fromArray(ts), .primitive = .fromArray(primitives) };
            return true;
        }

        /// All rays of a group against some triangles of a pack, one by one.
        inline fn intersectAll(
            search: *Self,
            index: usize,
            lanes: u32,
            pack: *const world_file.TrianglePack(Kernel.width),
            counts: *TestCounts,
        ) bool {
            const group = &search.groups[index];
            const view = &search.views[index];
            var found = false;
            var rest = lanes;
            while (rest != 0) : (rest &= rest - 1) {
                const at: bundle_file.At = .{
                    .lane = @ctz(rest),
                    .padding = search.padding,
                };
                const closer = if (query == .multi_hit)
                    search.lists.takeLane(search.first_group + index, group, view, pack, at, counts)
                else
                    bundle_file.intersectLane(Kernel, query, group, view, pack, at, counts);
                found = closer or found;
            }
            return found;
        }

        /// No ray looks farther than its hit; one that looked for any has it at t = -inf.
        fn shrink(search: *Self) void {
            const none: Rays.F32 = .splat(-std.math.inf(f32));
            var farthest = none;
            for (search.groups) |*group| {
                farthest = farthest.maxFast(.select(group.active, group.closest.t, none));
            }
            search.limit = farthest.reduceMax();
        }
    };
}
