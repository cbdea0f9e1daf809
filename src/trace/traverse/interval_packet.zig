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
//! is culled that the ray by itself would have found (box.zig; world/padding.zig for multiply-
//! adds).
//!
//! S. Boulos, I. Wald and P. Shirley, "Geometric and Arithmetic Culling Methods for Entire Ray
//! Packets" (2006), section 3.

const std = @import("std");
const world_file = @import("../../world.zig");
const TestCounts = @import("../../statistics.zig").TestCounts;
const ray_file = @import("ray.zig");
const bundle_file = @import("bundle.zig");
const intervals = @import("interval.zig");
const multi_hit = @import("multi_hit.zig");
const walk = @import("walk.zig");
const Search = @import("interval_search.zig").Search;
const Stream = @import("stream.zig").Stream;
const Query = walk.Query;
const Geometry = world_file.Geometry;

/// Fewer rays are no packet. Both as measured (docs/performance.md): a stream does so well with
/// rays that look for any hit that few of them gain by going together.
const packet_rays_min = std.EnumArray(Query, u32).initDefault(6, .{ .closest_hit = 4 });
/// Once so many rays of a subtile are incoherent, the others are not compared any more: most are
/// incoherent, too, and each comparison goes over the whole subtile.
const incoherent_max = 2;
/// How far apart the directions of rays are that go together, over their length, and the origins,
/// over `Geometry.size`. Both are rough: what they let through costs little more than single
/// rays, since a child is entered only where a ray is (`Search.meet`).
const direction_apart_max = 0.06;
/// See `direction_apart_max`.
const origin_apart_max = 0.03;

/// Whether packets of shadow rays pay: every node that a packet visits earns a little, every
/// child that its intervals meet though none of its rays enters it costs much more. Once all is
/// spent, rays go without. One for a bundle: its rays are much alike in this.
pub const PacketBudget = struct {
    /// What is left; what there is at first lets a packet see a few nodes.
    balance: i32 = 4,

    const balance_max = 12;

    /// Whether there is any left.
    pub inline fn lasts(budget: *const PacketBudget) bool {
        return budget.balance > 0;
    }

    /// For a node visited.
    pub inline fn earn(budget: *PacketBudget) void {
        budget.balance += 1;
    }

    /// For a child met and not entered.
    pub inline fn spend(budget: *PacketBudget) void {
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
    stream.init(geometry, bundle, {});
    for (0..Kernel.subtile_count) |subtile|
        traceSubtile(Kernel, query, &stream, subtile, budget, counts);
    stream.finish(counts);
}

/// Collects the first hits of the active rays in their lists.
pub fn traceMultiHit(
    comptime Kernel: type,
    bundle: *bundle_file.Bundle(Kernel),
    lists: *multi_hit.HitLists(Kernel),
    counts: *TestCounts,
) void {
    var budget: PacketBudget = .{};
    var stream: Stream(Kernel, .multi_hit) = undefined;
    stream.init(lists.geometry, bundle, lists);
    for (0..Kernel.subtile_count) |subtile|
        traceSubtile(Kernel, .multi_hit, &stream, subtile, &budget, counts);
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
    const padding = &stream.geometry.padding;
    for (&views, groups) |*view, *group| view.* = bundle_file.viewOf(Rays, padding, group);
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
            const octant = coherent.octant;
            if (tracePacket(Kernel, query, stream, first_group, &views, octant, budget, counts))
                continue;
        }
        for (&incoherent, groups) |*mask, *group| mask.* = mask.bitOr(group.active);
    }
    for (groups, rest, incoherent) |*group, left, mask| group.active = left.bitOr(mask);
    stream.take(first_group, &views, counts);
    for (groups, active) |*group, mask| group.active = mask;
}

inline fn firstOf(comptime Rays: type, masks: []const Rays.Mask) ?bundle_file.Place {
    for (masks, 0..) |mask, group| {
        const bits = mask.bits();
        if (bits != 0) return .{ .group = @intCast(group), .lane = @ctz(bits) };
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
                .origin_apart = .splat(geometry.size * origin_apart_max),
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
    stream: *const Stream(Kernel, query),
    first_group: usize,
    views: *const [Kernel.subtile_groups]bundle_file.Precalculations(Kernel.Rays),
    octant: [3]bool,
    budget: *PacketBudget,
    counts: *TestCounts,
) bool {
    @setEvalBranchQuota(4000); // For what is inlined here.
    const geometry = stream.geometry;
    const groups = stream.bundle.groups[first_group..][0..Kernel.subtile_groups];
    for (groups, views) |*group, *view| {
        if (group.active.andNot(view.fusable).any()) return false;
    }
    const ends: intervals.Ends = .of(Kernel, &geometry.padding, groups, views);
    var search: Search(Kernel, query) =
        .init(geometry, groups, views, octant, &ends, budget.*, first_group, stream.lists);
    _ = walk.walk(Kernel, geometry, &search, counts);
    budget.balance = @min(search.budget.balance, PacketBudget.balance_max);
    if (budget.lasts()) return true;
    for (groups) |*group| {
        group.active = group.active.andNot(group.closest.t.eq(.splat(-std.math.inf(f32))));
    }
    return false;
}
