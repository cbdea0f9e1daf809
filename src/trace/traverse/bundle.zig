//! Packet traversal (Wald et al. 2001): a box or a triangle against all rays of a group at once.
//!
//! In: a group, such as the thesis's packet of 2x2 pixels. Out: the closest hit of every ray, or
//! whether there is any. A child is visited when some ray enters it. Holds also what a bundle is,
//! and the tests of a group that other traversals share.

const std = @import("std");
const world_file = @import("../../world.zig");
const TestCounts = @import("../../statistics.zig").TestCounts;
const ray_file = @import("ray.zig");
const box = @import("box.zig");
const triangle = @import("triangle.zig");
const walk = @import("walk.zig");
const Query = walk.Query;

/// Groups of rays that travel together.
pub fn Bundle(comptime Kernel: type) type {
    return struct { groups: [Kernel.group_count]ray_file.Ray(Kernel.Rays) };
}

/// Where in a bundle a ray is.
pub const Place = struct { group: u32, lane: u32 };

/// How boxes and triangles look to a group.
pub fn Precalculations(comptime Lanes: type) type {
    return struct {
        /// The lanes that hold the rays.
        pub const Rays = Lanes;

        slabs: ray_file.RayInverse(Rays),
        /// Padded origin times inverse, negated: what a near or far bound times the inverse has
        /// added, where nodes are tested by multiply-adds.
        near_shift: Rays.Vec3,
        far_shift: Rays.Vec3,
        /// Rays for which nodes may be tested so.
        fusable: Rays.Mask,
        axis: ray_file.LongAxis(Rays),
        /// The one axis of all active rays, if there is one.
        uniform: ?u2,
        view: ray_file.ShearedRay(Rays),

        /// Has some rays enter no box: those that are not finite would enter all of them, or those
        /// that some backend's minima and maxima let through.
        noinline fn shut(view: *@This(), lanes: Rays.Mask) void {
            @branchHint(.cold);
            const inf = std.math.inf(f32);
            const slabs = &view.slabs;
            const before: Rays.F32 = .splat(-inf);
            slabs.origin = .select(lanes, .splat(@splat(0)), slabs.origin);
            slabs.shift = .select(lanes, before, slabs.shift);
            slabs.direction_inv = .select(lanes, .splat(@splat(inf)), slabs.direction_inv);
            for (&slabs.negative) |*negative| negative.* = negative.andNot(lanes);
            view.view.shift = .select(lanes, before, view.view.shift);
            view.fusable = view.fusable.andNot(lanes);
        }
    };
}

/// Views of the active rays of a group.
pub fn viewOf(
    comptime Rays: type,
    padding: *const world_file.Padding,
    group: *const ray_file.Ray(Rays),
) Precalculations(Rays) {
    if (group.active.none()) return undefined;
    const axis: ray_file.LongAxis(Rays) = .of(group.line.direction);
    const slabs: ray_file.RayInverse(Rays) = .init(group.line, padding);
    const ends = nodeOrigins(Rays, padding, slabs.origin);
    const near = box.select3(Rays, slabs.negative, ends[1], ends[0]);
    const far = box.select3(Rays, slabs.negative, ends[0], ends[1]);
    var view: Precalculations(Rays) = .{
        .slabs = slabs,
        .near_shift = near.mul(slabs.direction_inv).neg(),
        .far_shift = far.mul(slabs.direction_inv).neg(),
        .fusable = padding.allowsProducts(Rays, slabs.origin, slabs.direction_inv),
        .axis = axis,
        .uniform = axis.uniform(group.active),
        .view = .init(group.line, axis, padding),
    };
    const not_finite = group.line.isNotFinite().bitAnd(group.active);
    if (not_finite.any()) view.shut(not_finite);
    return view;
}

/// Where lower and upper faces of nodes are met from, their margin included.
pub inline fn nodeOrigins(
    comptime Rays: type,
    padding: *const world_file.Padding,
    origin: Rays.Vec3,
) [2]Rays.Vec3 {
    const length = padding.nodeShiftOf(Rays, origin);
    const shift: Rays.Vec3 = .{ .x = length, .y = length, .z = length };
    return .{ origin.add(shift), origin.sub(shift) };
}

/// Looks for hits of the active rays and keeps them in `closest`. With `Query.any_hit` a ray that
/// found one is out of the search; its `closest.primitive` tells.
pub fn trace(
    comptime Kernel: type,
    comptime query: Query,
    geometry: *const world_file.Geometry,
    group: *ray_file.Ray(Kernel.Rays),
    counts: *TestCounts,
) void {
    if (group.active.none()) return;
    var search: Search(Kernel, query) = .{
        .group = group,
        .view = viewOf(Kernel.Rays, &geometry.padding, group),
        .padding = &geometry.padding,
    };
    _ = walk.walk(Kernel, geometry, &search, counts);
}

fn Search(comptime Kernel: type, comptime query: Query) type {
    const Boxes = Kernel.Boxes;
    const inf = std.math.inf(f32);
    return struct {
        group: *ray_file.Ray(Kernel.Rays),
        view: Precalculations(Kernel.Rays),
        padding: *const world_file.Padding,
        /// Every ray has its own.
        limit: f32 = inf,

        const Self = @This();

        /// Where the first ray enters each child.
        pub inline fn meet(
            search: *const Self,
            node: *const world_file.Node(Kernel.width),
            counts: *TestCounts,
        ) box.Range(Boxes) {
            var nears: [Kernel.width]f32 = @splat(inf);
            for (&nears, node.child, 0..) |*near, child, at| {
                if (child == world_file.Child.missing) continue;
                countBoxes(Kernel, search.group, counts);
                near.* = enter(Kernel, search.group, &search.view.slabs, node, at) orelse continue;
            }
            return .{ .near = .fromArray(nears), .far = .splat(std.math.floatMax(f32)) };
        }

        /// Tests the triangles of a pack.
        pub inline fn intersect(
            search: *Self,
            pack: *const world_file.TrianglePack(Kernel.width),
            counts: *TestCounts,
        ) bool {
            var found = false;
            for (0..Kernel.width) |lane| {
                if (pack.primitive[lane] == world_file.none) break;
                found = intersectLane(Kernel, query, search.group, &search.view, pack, .{
                    .lane = lane,
                    .padding = search.padding,
                }, counts) or found;
            }
            return found;
        }

        pub inline fn isDone(search: *const Self, _: bool) bool {
            if (query != .any_hit) return false;
            const none: Kernel.Rays.I32 = .splat(ray_file.no_primitive);
            return search.group.closest.primitive.eq(none).bitAnd(search.group.active).none();
        }
    };
}

/// The least t at which an active ray of the group enters a child, or null if none does.
inline fn enter(
    comptime Kernel: type,
    group: *const ray_file.Ray(Kernel.Rays),
    slabs: *const ray_file.RayInverse(Kernel.Rays),
    node: *const world_file.Node(Kernel.width),
    child: usize,
) ?f32 {
    const lower = [3]f32{
        node.bounds[0][0][child], node.bounds[0][1][child], node.bounds[0][2][child],
    };
    const upper = [3]f32{
        node.bounds[1][0][child], node.bounds[1][1][child], node.bounds[1][2][child],
    };
    const Rays = Kernel.Rays;
    const range = box.padded(Rays, .splat(lower), .splat(upper), slabs);
    const held = box.mayHold(Rays, range, group.tnear.t, group.closest.t).bitAnd(group.active);
    if (held.none()) return null;
    return Rays.F32.select(held, range.near, .splat(std.math.inf(f32))).reduceMin();
}

/// Counts the test of a box against a group.
pub fn countBoxes(comptime Kernel: type, group: anytype, counts: *TestCounts) void {
    if (!Kernel.counts_tests) return;
    counts.box_issued += Kernel.ray_count;
    counts.box_useful += group.active.popCount();
}

/// Which triangle of a pack, and the geometry's padding.
pub const At = struct { lane: usize, padding: *const world_file.Padding };

/// Tests one triangle of a pack against the active rays of one group. Returns whether any took
/// the hit.
pub inline fn intersectLane(
    comptime Kernel: type,
    comptime query: Query,
    group: *ray_file.Ray(Kernel.Rays),
    view: *const Precalculations(Kernel.Rays),
    pack: *const world_file.TrianglePack(Kernel.width),
    at: At,
    counts: *TestCounts,
) bool {
    const Rays = Kernel.Rays;
    var hit: triangle.Intersection(Rays) = undefined;
    if (!hitsOfLane(Kernel, group, view, pack, at, counts, &hit)) return false;
    // A ray that found any hit accepts no other: nothing comes before t = -inf.
    const t: Rays.F32 = if (query == .any_hit) .splat(-std.math.inf(f32)) else hit.t;
    const primitive: Rays.I32 = .splat(@bitCast(pack.primitive[at.lane]));
    group.closest.t = Rays.F32.select(hit.mask, t, group.closest.t);
    group.closest.primitive = Rays.I32.select(hit.mask, primitive, group.closest.primitive);
    return true;
}

/// Tests one triangle of a pack: which active rays of a group hit it within their limits, and
/// where. Returns whether any does.
pub inline fn hitsOfLane(
    comptime Kernel: type,
    group: *const ray_file.Ray(Kernel.Rays),
    view: *const Precalculations(Kernel.Rays),
    pack: *const world_file.TrianglePack(Kernel.width),
    at: At,
    counts: *TestCounts,
    hits: *triangle.Intersection(Kernel.Rays),
) bool {
    if (Kernel.counts_tests) {
        counts.triangle_issued += Kernel.ray_count;
        counts.triangle_useful += group.active.popCount();
    }
    const Rays = Kernel.Rays;
    const corners = turnedCorners(Rays, pack, at.lane, view);
    const seen = triangle.project(Rays, corners, &view.view);
    var weights = triangle.edgeFunctions(Rays, seen);
    if (weights.mayAgree().bitAnd(group.active).none()) return false;
    const agreeing = weights.agree().bitAnd(group.active);
    const inside = triangle.resolveTies(Rays, seen, &weights, agreeing);
    const center = turnedPoint(Rays, at.padding.center, view);
    const hit = triangle
        .locate(Rays, seen, weights, corners, &view.view, at.padding, center);
    const primitive: Rays.I32 = .splat(@bitCast(pack.primitive[at.lane]));
    hits.t = hit.t;
    hits.mask = inside.bitAnd(hit.mask)
        .bitAnd(group.tnear.isBefore(hit.t, primitive))
        .bitAnd(group.closest.isAfter(hit.t, primitive))
        .andNot(primitive.eq(group.skip));
    return hits.mask.any();
}

/// One triangle for all rays of a group, turned as each ray wants it.
inline fn turnedCorners(
    comptime Rays: type,
    pack: anytype,
    lane: usize,
    view: *const Precalculations(Rays),
) [3]Rays.Vec3 {
    var corners: [3]Rays.Vec3 = undefined;
    inline for (&corners, &pack.corner) |*corner, *components| {
        const point = [3]f32{ components[0][lane], components[1][lane], components[2][lane] };
        corner.* = turnedPoint(Rays, point, view);
    }
    return corners;
}

/// A point, turned as each ray wants it.
inline fn turnedPoint(
    comptime Rays: type,
    point: [3]f32,
    view: *const Precalculations(Rays),
) Rays.Vec3 {
    const axis = view.uniform orelse 2;
    const turned: Rays.Vec3 = .splat(.{
        point[ray_file.turnedIndex(axis, 0)], point[ray_file.turnedIndex(axis, 1)], point[axis],
    });
    return if (view.uniform == null) view.axis.turn(turned) else turned;
}
