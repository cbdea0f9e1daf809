//! Rays in company through the tree: a box or a triangle against groups of rays in lanes.
//!
//! In: a bundle of groups (the thesis's 2x2 packet is a bundle of one group). Out: the nearest hit
//! of every ray, or whether there is any. A child is visited when some ray of some group enters it;
//! an inner node is handed down with the first group that does (as the ranged traversal of Wald,
//! Boulos and Shirley 2007, section 3.2), a leaf with the set of all groups that do.

const std = @import("std");
const world_file = @import("../world.zig");
const TestCounts = @import("../statistics.zig").TestCounts;
const ray_file = @import("ray.zig");
const box = @import("box.zig");
const triangle = @import("triangle.zig");
const walk = @import("walk.zig");
const assert = std.debug.assert;
const Query = walk.Query;

/// Groups of rays that travel together.
pub fn Bundle(comptime Kernel: type) type {
    return struct { groups: [Kernel.group_count]ray_file.Ray(Kernel.Rays) };
}

/// How triangles look to a group.
pub fn GroupView(comptime Rays: type) type {
    return struct {
        slabs: ray_file.Slabs(Rays),
        axis: ray_file.LongAxis(Rays),
        /// The one axis of all active rays, if there is one.
        uniform: ?u2,
        view: ray_file.View(Rays),
    };
}

/// A child still to be visited: by all groups from `group` on (nodes), or by those in the set
/// `groups` (leaves).
const Entry = struct { child: u32, block_count: u32, near: f32, group: u32, groups: u64 };

/// Looks for hits and keeps them in `nearest` of every group. With `Query.any` a ray that found one
/// is out of the search; its `nearest.primitive` tells.
pub fn trace(
    comptime Kernel: type,
    comptime query: Query,
    tree: *const world_file.Tree(Kernel.width),
    pad: f32,
    bundle: *Bundle(Kernel),
    counts: *TestCounts,
) void {
    var stack: [Kernel.stack_max]Entry = undefined;
    const first = firstActive(Kernel, bundle) orelse return;
    var views: [Kernel.group_count]GroupView(Kernel.Rays) = undefined;
    for (&views, &bundle.groups) |*view, *group| view.* = viewOf(Kernel.Rays, group);
    stack[0] = .{ .child = 0, .block_count = 0, .near = 0, .group = first, .groups = 0 };
    var stack_count: usize = 1;
    while (stack_count > 0) {
        stack_count -= 1;
        const entry = stack[stack_count];
        if (entry.block_count == 0) {
            assert(stack_count + Kernel.width <= Kernel.stack_max);
            const node = &tree.nodes[entry.child];
            const group = entry.group;
            stack_count = pushChildren(
                Kernel,
                bundle,
                &views,
                node,
                group,
                &stack,
                stack_count,
                counts,
            );
        } else {
            for (tree.blocks[entry.child..][0..entry.block_count]) |*block| {
                intersectBlock(Kernel, query, bundle, &views, block, entry.groups, pad, counts);
            }
            if (query == .any and allFound(Kernel, bundle)) return;
        }
    }
}

/// Views of the active rays of a group.
pub fn viewOf(comptime Rays: type, group: *const ray_file.Ray(Rays)) GroupView(Rays) {
    if (group.active.none()) return undefined;
    const axis: ray_file.LongAxis(Rays) = .of(group.line.direction);
    return .{
        .slabs = .init(group.line),
        .axis = axis,
        .uniform = axis.uniform(group.active),
        .view = .init(group.line, axis),
    };
}

fn firstActive(comptime Kernel: type, bundle: *const Bundle(Kernel)) ?u32 {
    for (&bundle.groups, 0..) |*group, index| {
        if (group.active.any()) return @intCast(index);
    }
    return null;
}

fn allFound(comptime Kernel: type, bundle: *const Bundle(Kernel)) bool {
    for (&bundle.groups) |*group| {
        const searching = group.nearest.primitive.eq(.splat(ray_file.no_primitive));
        if (searching.bitAnd(group.active).any()) return false;
    }
    return true;
}

/// Pushes the children that some ray enters, the nearest on top (by the first group that enters).
/// Returns the new stack count.
inline fn pushChildren(
    comptime Kernel: type,
    bundle: *const Bundle(Kernel),
    views: *const [Kernel.group_count]GroupView(Kernel.Rays),
    node: *const world_file.Node(Kernel.width),
    group_first: u32,
    stack: []Entry,
    stack_count_before: usize,
    counts: *TestCounts,
) usize {
    var stack_count = stack_count_before;
    for (0..Kernel.width) |child| {
        if (node.child[child] == world_file.none) continue;
        var entry: Entry = .{
            .child = node.child[child],
            .block_count = node.block_count[child],
            .near = 0,
            .group = group_first,
            .groups = 0,
        };
        while (entry.group < Kernel.group_count) : (entry.group += 1) {
            const at = entry.group;
            countBoxes(Kernel, &bundle.groups[at], counts);
            const near = enter(Kernel, &bundle.groups[at], &views[at].slabs, node, child);
            entry.near = near orelse continue;
            break;
        } else continue;
        if (entry.block_count > 0) {
            entry.groups = @as(u64, 1) << @intCast(entry.group);
            for (entry.group + 1..Kernel.group_count) |group| {
                const ray = &bundle.groups[group];
                countBoxes(Kernel, ray, counts);
                const near = enter(Kernel, ray, &views[group].slabs, node, child);
                if (near == null) continue;
                entry.groups |= @as(u64, 1) << @intCast(group);
            }
        }
        var slot = stack_count;
        while (slot > stack_count_before and stack[slot - 1].near < entry.near) : (slot -= 1) {
            stack[slot] = stack[slot - 1];
        }
        stack[slot] = entry;
        stack_count += 1;
    }
    return stack_count;
}

/// The least t at which an active ray of the group enters a child, or null if none does.
pub inline fn enter(
    comptime Kernel: type,
    group: *const ray_file.Ray(Kernel.Rays),
    slabs: *const ray_file.Slabs(Kernel.Rays),
    node: *const world_file.Node(Kernel.width),
    child: usize,
) ?f32 {
    const Rays = Kernel.Rays;
    const lower: Rays.Vec3 = .splat(.{
        node.bounds[0][0][child], node.bounds[0][1][child], node.bounds[0][2][child],
    });
    const upper: Rays.Vec3 = .splat(.{
        node.bounds[1][0][child], node.bounds[1][1][child], node.bounds[1][2][child],
    });
    const near = triangle.select3(Rays, slabs.negative, upper, lower);
    const far = triangle.select3(Rays, slabs.negative, lower, upper);
    const range = box.slab(Rays, near, far, slabs.origin, slabs.direction_inv);
    const entered = box.mayHold(Rays, range, group.after.t, group.nearest.t).bitAnd(group.active);
    if (entered.none()) return null;
    return Rays.F32.select(entered, range.near, .splat(std.math.inf(f32))).reduceMin();
}

fn countBoxes(comptime Kernel: type, group: anytype, counts: *TestCounts) void {
    if (!Kernel.counts_tests) return;
    counts.box_issued += Kernel.ray_count;
    counts.box_useful += group.active.popCount();
}

/// Tests the triangles of a block against the groups of a set.
inline fn intersectBlock(
    comptime Kernel: type,
    comptime query: Query,
    bundle: *Bundle(Kernel),
    views: *const [Kernel.group_count]GroupView(Kernel.Rays),
    block: *const world_file.TriangleBlock(Kernel.width),
    groups: u64,
    pad: f32,
    counts: *TestCounts,
) void {
    for (0..Kernel.width) |lane| {
        if (block.primitive[lane] == world_file.none) break;
        const primitive: i32 = @intCast(block.primitive[lane]);
        var rest = groups;
        while (rest != 0) : (rest &= rest - 1) {
            const index = @ctz(rest);
            const group = &bundle.groups[index];
            if (Kernel.counts_tests) {
                counts.triangle_issued += Kernel.ray_count;
                counts.triangle_useful += group.active.popCount();
            }
            const corners = turnedCorners(Kernel.Rays, block, lane, &views[index]);
            _ = intersect(Kernel, query, group, &views[index].view, corners, primitive, pad);
        }
    }
}

/// Tests one triangle against the active rays of one group. Returns whether any took the hit.
pub inline fn intersect(
    comptime Kernel: type,
    comptime query: Query,
    group: *ray_file.Ray(Kernel.Rays),
    view: *const ray_file.View(Kernel.Rays),
    corners: [3]Kernel.Rays.Vec3,
    primitive_number: i32,
    pad: f32,
) bool {
    const Rays = Kernel.Rays;
    const seen = triangle.project(Rays, corners, view);
    var weights = triangle.weigh(Rays, seen);
    if (weights.mayAgree().bitAnd(group.active).none()) return false;
    const agreeing = weights.agree().bitAnd(group.active);
    const inside = triangle.settle(Rays, seen, &weights, agreeing);
    const hit = triangle.locate(Rays, seen, weights, corners, view, pad);
    const primitive: Rays.I32 = .splat(primitive_number);
    const accepted = inside.bitAnd(hit.mask)
        .bitAnd(group.after.isBefore(hit.t, primitive))
        .bitAnd(group.nearest.isAfter(hit.t, primitive))
        .andNot(primitive.eq(group.skip));
    // A ray that found any hit accepts no other: nothing comes before t = -inf.
    const t: Rays.F32 = if (query == .any) .splat(-std.math.inf(f32)) else hit.t;
    group.nearest.t = Rays.F32.select(accepted, t, group.nearest.t);
    group.nearest.primitive = Rays.I32.select(accepted, primitive, group.nearest.primitive);
    return accepted.any();
}

/// One triangle for all rays of a group, turned as each ray wants it.
pub inline fn turnedCorners(
    comptime Rays: type,
    block: anytype,
    lane: usize,
    view: *const GroupView(Rays),
) [3]Rays.Vec3 {
    var corners: [3]Rays.Vec3 = undefined;
    const axis = view.uniform orelse 2;
    inline for (&corners, &block.corner) |*corner, *components| {
        corner.* = .splat(.{
            components[ray_file.turnedIndex(axis, 0)][lane],
            components[ray_file.turnedIndex(axis, 1)][lane],
            components[axis][lane],
        });
        if (view.uniform == null) corner.* = view.axis.turn(corner.*);
    }
    return corners;
}
