//! Interval-arithmetic packet traversal (Boulos, Wald and Shirley 2006) of coherent rays.
//!
//! In: the rays of a bundle, by whatever way they came there. Out: the closest hit of each, or
//! whether there is any. Intervals that hold all rays of a packet are tested against boxes, and at
//! a leaf the rays that enter it against the triangles that are left. Packets are formed within
//! subtiles of 4x4 pixels: the first ray takes with it those that go much the same way from much
//! the same place, in the same octant, since intervals of inverse directions of both signs say
//! nothing; then the next that is left. Incoherent rays go as a ray stream (stream.zig), and once
//! there are a few, so do all that are left of the subtile.
//!
//! Every step of the slab test is monotone in origin, inverse and bound, rounding included. So
//! from the ends of intervals come bounds of what the test gives for any ray between, and nothing
//! is culled that the ray by itself would have found (box.zig; `Geometry.fused_reach` for multiply-
//! adds).
//!
//! S. Boulos, I. Wald and P. Shirley, "Geometric and Arithmetic Culling Methods for Entire Ray
//! Packets" (2006), section 3.

const std = @import("std");
const world_file = @import("../../world.zig");
const TestCounts = @import("../../statistics.zig").TestCounts;
const ray_file = @import("ray.zig");
const box = @import("box.zig");
const bundle_file = @import("bundle.zig");
const traversal_ray = @import("traversal_ray.zig");
const Stream = @import("stream.zig").Stream;
const walk = @import("walk.zig");
const Query = walk.Query;
const Geometry = world_file.Geometry;

/// Fewer rays are no packet. Both as measured (docs/performance.md): a set does so well with rays
/// that look for any hit that few of them gain by going together.
const packet_rays_min = std.EnumArray(Query, u32).init(.{ .closest_hit = 4, .any_hit = 6 });
/// Once so many rays of a subtile are incoherent, the others are not compared any more: most are
/// incoherent, too, and each comparison goes over the whole subtile.
const incoherent_max = 2;
/// How far apart the directions of rays are that go together, over their length, and the origins,
/// over the size of the scene. Both are rough: what they let through costs little more than single
/// rays, since a child is entered only where a ray is (`Search.meet`).
const direction_apart_max = 0.06;
/// See `direction_apart_max`.
const origin_apart_max = 0.01;

/// Whether packets of shadow rays pay: every node that a packet visits earns a little, every
/// child that its intervals meet though none of its rays enters it costs much more. Once all is
/// spent, rays go without. One for a bundle: its rays are much alike in this.
pub const PacketBudget = struct {
    /// What is left; what there is at first lets a packet see a few nodes.
    balance: i32 = 4,

    const balance_max = 12;

    inline fn lasts(budget: *const PacketBudget) bool {
        return budget.balance > 0;
    }

    inline fn earn(budget: *PacketBudget) void {
        budget.balance += 1;
    }

    inline fn spend(budget: *PacketBudget) void {
        budget.balance -= 6;
    }
};

/// Looks for hits of the active rays and keeps them in `closest`. With `Query.any_hit` a ray that
/// found one is out of the search; its `closest.primitive` tells. Other queries leave `budget`
/// as it is.
pub fn trace(
    comptime Kernel: type,
    comptime query: Query,
    geometry: *const Geometry,
    bundle: *bundle_file.Bundle(Kernel),
    budget: *PacketBudget,
    counts: *TestCounts,
) void {
    var stream: Stream(Kernel, query) = undefined;
    stream.init(geometry, bundle);
    for (0..Kernel.subtile_count) |subtile|
        traceSubtile(Kernel, query, &stream, subtile, budget, counts);
    stream.finish(counts);
}

/// The rays of one subtile, or they are taken by the stream.
fn traceSubtile(
    comptime Kernel: type,
    comptime query: Query,
    stream: *Stream(Kernel, query),
    subtile: usize,
    budget: *PacketBudget,
    counts: *TestCounts,
) void {
    const Rays = Kernel.Rays;
    const first_group = subtile * Kernel.subtile_groups;
    const groups = stream.bundle.groups[first_group..][0..Kernel.subtile_groups];
    var active: [Kernel.subtile_groups]Rays.Mask = undefined;
    var views: [Kernel.subtile_groups]bundle_file.Precalculations(Rays) = undefined;
    for (&active, groups) |*mask, *group| mask.* = group.active;
    if (firstOf(Rays, &active) == null) return;
    for (&views, groups) |*view, *group| view.* = bundle_file.viewOf(Rays, group);
    var rest = active;
    var incoherent: [Kernel.subtile_groups]Rays.Mask = @splat(.splat(false));
    var incoherent_count: u32 = 0;
    while (budget.lasts() and incoherent_count < incoherent_max) {
        const first = firstOf(Rays, &rest) orelse break;
        const leader = &groups[first.group];
        const coherent: CoherentGroup(Rays) =
            .of(stream.geometry, leader, &views[first.group], first.lane);
        var count: u32 = 0;
        for (&rest, &views, groups, 0..) |*left, *view, *group, index| {
            group.active = .splat(false);
            if (left.none()) continue;
            group.active = left.bitAnd(coherent.members(group, view));
            // Not a member of its own packet if its way is no number.
            const self = @as(u32, @intFromBool(index == first.group)) << @intCast(first.lane);
            group.active = group.active.bitOr(.fromBits(self));
            left.* = left.andNot(group.active);
            count += group.active.popCount();
        }
        if (count < packet_rays_min.get(query)) {
            incoherent_count += count;
        } else {
            const geometry = stream.geometry;
            const octant = coherent.octant;
            if (tracePacket(Kernel, query, geometry, groups, &views, octant, budget, counts))
                continue;
        }
        for (&incoherent, groups) |*mask, *group| mask.* = mask.bitOr(group.active);
    }
    for (groups, rest, incoherent) |*group, left, mask| group.active = left.bitOr(mask);
    stream.take(first_group, &views, counts);
    for (groups, active) |*group, mask| group.active = mask;
}

const Place = struct { group: usize, lane: usize };

inline fn firstOf(comptime Rays: type, masks: []const Rays.Mask) ?Place {
    for (masks, 0..) |mask, group| {
        const bits = mask.bits();
        if (bits != 0) return .{ .group = group, .lane = @ctz(bits) };
    }
    return null;
}

/// The rays that form a packet with a given one, the leader.
fn CoherentGroup(comptime Rays: type) type {
    return struct {
        origin: Rays.Vec3,
        direction: Rays.Vec3,
        origin_apart: Rays.F32,
        direction_apart: Rays.F32,
        /// Whether the way is down, by axis.
        octant: [3]bool,

        inline fn of(
            geometry: *const Geometry,
            group: *const ray_file.Ray(Rays),
            view: *const bundle_file.Precalculations(Rays),
            lane: usize,
        ) @This() {
            const direction = group.line.direction.lane(lane);
            const length = @max(@abs(direction[0]), @abs(direction[1]), @abs(direction[2]));
            var octant: [3]bool = undefined;
            for (&octant, view.slabs.negative) |*down, negative| down.* = negative.lane(lane);
            return .{
                .origin = .splat(group.line.origin.lane(lane)),
                .direction = .splat(direction),
                .origin_apart = .splat(geometry.pad * (origin_apart_max / world_file.pad_relative)),
                .direction_apart = .splat(length * direction_apart_max),
                .octant = octant,
            };
        }

        inline fn members(
            coherent: *const @This(),
            group: *const ray_file.Ray(Rays),
            view: *const bundle_file.Precalculations(Rays),
        ) Rays.Mask {
            const from = group.line.origin.sub(coherent.origin).abs();
            const to = group.line.direction.sub(coherent.direction).abs();
            var same = from.x.max(from.y).max(from.z).le(coherent.origin_apart)
                .bitAnd(to.x.max(to.y).max(to.z).le(coherent.direction_apart));
            for (view.slabs.negative, coherent.octant) |negative, down| {
                same = if (down) same.bitAnd(negative) else same.andNot(negative);
            }
            return same;
        }
    };
}

/// Active rays, all of one octant. Returns false where some are still to be traced, which then are
/// the active ones.
fn tracePacket(
    comptime Kernel: type,
    comptime query: Query,
    geometry: *const Geometry,
    groups: *[Kernel.subtile_groups]ray_file.Ray(Kernel.Rays),
    views: *const [Kernel.subtile_groups]bundle_file.Precalculations(Kernel.Rays),
    octant: [3]bool,
    budget: *PacketBudget,
    counts: *TestCounts,
) bool {
    @setEvalBranchQuota(4000); // For what is inlined here.
    const tree = geometry.tree.get(Kernel.width);
    const ends: Ends = .of(Kernel, groups, views);
    if (!(ends.reach() < geometry.fused_reach)) return false;
    var search: Search(Kernel, query) = .init(geometry, groups, views, octant, &ends, budget.*);
    _ = walk.walk(Kernel, tree, &search, counts);
    budget.balance = @min(search.budget.balance, PacketBudget.balance_max);
    if (budget.lasts()) return true;
    for (groups) |*group| {
        const found = group.closest.primitive.gt(.splat(ray_file.no_primitive));
        group.active = group.active.andNot(found);
    }
    return false;
}

/// The least and the greatest of what rays have.
const Ends = struct {
    origin: [3][2]f32,
    inverse: [3][2]f32,
    tnear_t: f32,
    closest_t: f32,

    inline fn of(comptime Kernel: type, groups: anytype, views: anytype) Ends {
        const Rays = Kernel.Rays;
        const inf: Rays.F32 = .splat(std.math.inf(f32));
        var least: [7]Rays.F32 = @splat(inf);
        var greatest: [7]Rays.F32 = @splat(inf.neg());
        for (groups, views) |*group, *view| {
            if (group.active.none()) continue;
            const origin = group.line.origin;
            const inverse = view.slabs.direction_inv;
            const values = [6]Rays.F32{
                origin.x, origin.y, origin.z, inverse.x, inverse.y, inverse.z,
            };
            for (values, least[0..6], greatest[0..6]) |value, *low, *high| {
                low.* = low.minFast(.select(group.active, value, inf));
                high.* = high.maxFast(.select(group.active, value, inf.neg()));
            }
            least[6] = least[6].minFast(.select(group.active, group.tnear.t, inf));
            const closest: Rays.F32 = .select(group.active, group.closest.t, inf.neg());
            greatest[6] = greatest[6].maxFast(closest);
        }
        var ends: Ends = undefined;
        for (0..3) |axis| {
            ends.origin[axis] = .{ least[axis].reduceMin(), greatest[axis].reduceMax() };
            ends.inverse[axis] = .{ least[3 + axis].reduceMin(), greatest[3 + axis].reduceMax() };
        }
        ends.tnear_t = least[6].reduceMin();
        ends.closest_t = greatest[6].reduceMax();
        return ends;
    }

    /// The largest |coordinate| of an origin.
    fn reach(ends: *const Ends) f32 {
        var largest: f32 = 0;
        for (ends.origin) |range| largest = @max(largest, @abs(range[0]), @abs(range[1]));
        return largest;
    }
};

fn Search(comptime Kernel: type, comptime query: Query) type {
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
        /// By how much boxes of triangles are grown: more than their own pad and a node's margin.
        grow: f32,
        /// See `Geometry.pad`.
        pad: f32,
        budget: PacketBudget,

        const Self = @This();
        const Range = box.Range(Boxes);

        /// What of the rays the faces across an axis are tested against.
        const Slab = struct {
            /// See `ray.RayInverse.negative`.
            negative: Boxes.Mask,
            inverse: [2]F32,
            /// The origin farthest on the way, or least far, negated and times each inverse.
            near_shift: [2]F32,
            far_shift: [2]F32,

            inline fn init(negative: bool, origin: [2]f32, inverse: [2]f32) Slab {
                const near_origin: F32 = .splat(origin[if (negative) 0 else 1]);
                const far_origin: F32 = .splat(origin[if (negative) 1 else 0]);
                const inverses = [2]F32{ .splat(inverse[0]), .splat(inverse[1]) };
                return .{
                    .negative = .splat(negative),
                    .inverse = inverses,
                    .near_shift = shiftOf(near_origin, inverses),
                    .far_shift = shiftOf(far_origin, inverses),
                };
            }

            inline fn shiftOf(origin: F32, inverse: [2]F32) [2]F32 {
                return .{ origin.mul(inverse[0]).neg(), origin.mul(inverse[1]).neg() };
            }

            inline fn ts(slab: *const Slab, bound: F32, shift: [2]F32) [2]F32 {
                return .{
                    bound.mulAdd(slab.inverse[0], shift[0]),
                    bound.mulAdd(slab.inverse[1], shift[1]),
                };
            }

            /// The least t at which a ray comes through the near face.
            inline fn near(slab: *const Slab, bound: F32) F32 {
                const both = slab.ts(bound, slab.near_shift);
                return both[0].minOrNegative(both[1]);
            }

            /// The greatest t at which a ray goes out through the far face.
            inline fn far(slab: *const Slab, bound: F32) F32 {
                const both = slab.ts(bound, slab.far_shift);
                return both[0].maxOrNegative(both[1]);
            }
        };

        inline fn init(
            geometry: *const Geometry,
            groups: *[Kernel.subtile_groups]ray_file.Ray(Rays),
            views: *const [Kernel.subtile_groups]bundle_file.Precalculations(Rays),
            octant: [3]bool,
            ends: *const Ends,
            budget: PacketBudget,
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
                .grow = geometry.pad + 2 * geometry.node_margin,
                .pad = geometry.pad,
                .budget = budget,
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
            if (query == .any_hit) search.budget.earn();
            if (met == 0) return range;
            var nears = range.near.toArray();
            while (met != 0) : (met &= met - 1) {
                const child = @ctz(met);
                if (search.isEntered(node, child, counts)) continue;
                nears[child] = std.math.inf(f32);
                if (query == .any_hit) search.budget.spend();
            }
            if (query == .any_hit and !search.budget.lasts()) {
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
            const shift = search.views[index].shift;
            var first: [3]Rays.F32 = undefined;
            var last: [3]Rays.F32 = undefined;
            inline for (&first, &last, near, far, .{ "x", "y", "z" }) |*a, *b, low, high, axis| {
                a.* = Rays.F32.splat(low).mulAdd(@field(inverse, axis), @field(shift, axis));
                b.* = Rays.F32.splat(high).mulAdd(@field(inverse, axis), @field(shift, axis));
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
            for (search.groups, search.views, 0..) |*group, *view, index| {
                if (group.active.none()) continue;
                const rays = search.entering(index, met.near, met.far, counts).bits();
                if (rays == 0) continue;
                const hit = if (@popCount(rays) < triangle_count)
                    search.intersectEach(group, view, rays, pack, counts)
                else
                    search.intersectAll(group, view, met.lanes, pack, counts);
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
            const grow: F32 = .splat(search.grow);
            var near: [3]F32 = undefined;
            var far: [3]F32 = undefined;
            var lowers: [3]F32 = undefined;
            var uppers: [3]F32 = undefined;
            inline for (&near, &far, &search.slabs, 0..) |*first, *last, *slab, axis| {
                const a: F32 = .load(&pack.corner[0][axis]);
                const b: F32 = .load(&pack.corner[1][axis]);
                const c: F32 = .load(&pack.corner[2][axis]);
                lowers[axis] = a.minFast(b).minFast(c).sub(grow);
                uppers[axis] = a.maxFast(b).maxFast(c).add(grow);
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
            group: *ray_file.Ray(Rays),
            view: *const bundle_file.Precalculations(Rays),
            lanes: u32,
            pack: *const world_file.TrianglePack(Kernel.width),
            counts: *TestCounts,
        ) bool {
            var found: u32 = 0;
            var ts = group.closest.t.toArray();
            var primitives = group.closest.primitive.toArray();
            var rest = lanes;
            while (rest != 0) : (rest &= rest - 1) {
                const lane = @ctz(rest);
                var ray: TraversalRay = .of(Rays, true, group, view, lane);
                if (!ray.intersect(pack, search.pad, counts)) continue;
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
            group: *ray_file.Ray(Rays),
            view: *const bundle_file.Precalculations(Rays),
            lanes: u32,
            pack: *const world_file.TrianglePack(Kernel.width),
            counts: *TestCounts,
        ) bool {
            var found = false;
            var rest = lanes;
            while (rest != 0) : (rest &= rest - 1) {
                found = bundle_file.intersectLane(Kernel, query, group, view, pack, .{
                    .lane = @ctz(rest),
                    .pad = search.pad,
                }, counts) or found;
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
