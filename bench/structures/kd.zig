//! A kd-tree by the binned surface area heuristic (Wald and Havran 2006, with bins and boxes in the
//! place of events and clipped triangles), and one ray or a packet of four through it.
//!
//! In: references; rays. Out: hits, the same as those of any BVH: planes are met with a slack
//! for rounding, and triangles lie in every leaf that their boxes touch.

const std = @import("std");
const raylane = @import("raylane");
const cost = @import("cost.zig");
const ray_file = raylane.trace.ray;
const bundle_file = raylane.trace.bundle;
const Allocator = std.mem.Allocator;
const Box3 = raylane.math.Box3;
const Query = raylane.trace.walk.Query;
const Reference = cost.Reference;
const Single = ray_file.Single;
const TestCounts = raylane.statistics.TestCounts;
const World = raylane.world.World;

/// Of rays of which nothing is asked that padding has a part in.
const no_padding: raylane.world.Padding = .init(@splat(0), .empty);
const assert = std.debug.assert;

const bin_count = 32;
const depth_limit = 60;
/// What a child without triangles is worth.
const empty_bonus = 0.8;
/// Rounding of (plane - origin) * inverse over the largest coordinate times inverse; see
/// `World.node_margin`.
const slack_relative = 16.0 / 16_777_216.0;

/// An inner node's children are `first` and `first` + 1; a leaf's blocks begin at `first`.
pub const Node = extern struct {
    position: f32,
    /// 0 to 2, or `leaf`.
    axis: u32,
    first: u32,
    pack_count: u32,

    pub const leaf = 3;
};

pub const Tree = struct {
    nodes: []const Node,
    blocks: []const cost.Block,
    bounds: Box3,
    /// The largest |coordinate| of the bounds.
    reach: f32,
};

/// Builds the tree; memory is the arena's.
pub fn build(
    arena: Allocator,
    gpa: Allocator,
    world: *const World,
    list: []const Reference,
) error{OutOfMemory}!Tree {
    const bounds = cost.boundsOf(list);
    var builder: Builder = .{ .arena = arena, .gpa = gpa, .world = world };
    const count_log: u32 = std.math.log2_int(usize, @max(1, list.len));
    builder.depth_max = @min(depth_limit, 8 + count_log * 13 / 10);
    try builder.nodes.append(arena, undefined);
    try builder.fill(0, list, bounds, 0);
    var reach: f32 = 0;
    for (bounds.lower, bounds.upper) |lower, upper| reach = @max(reach, @abs(lower), @abs(upper));
    return .{
        .nodes = builder.nodes.items,
        .blocks = builder.blocks.items,
        .bounds = bounds,
        .reach = reach,
    };
}

const Plane = struct { axis: u2, position: f32, cost: f32 };

const Builder = struct {
    arena: Allocator,
    gpa: Allocator,
    world: *const World,
    nodes: std.ArrayList(Node) = .empty,
    blocks: std.ArrayList(cost.Block) = .empty,
    depth_max: u32 = 0,

    /// Recursion ends at `depth_max`.
    fn fill(
        builder: *Builder,
        index: u32,
        list: []const Reference,
        box: Box3,
        depth: u32,
    ) error{OutOfMemory}!void {
        const plane = if (depth < builder.depth_max) bestPlane(list, box) else null;
        const chosen = plane orelse {
            const first: u32 = @intCast(builder.blocks.items.len);
            builder.nodes.items[index] = .{
                .position = 0,
                .axis = Node.leaf,
                .first = first,
                .pack_count = try cost.appendBlocks(
                    builder.arena,
                    &builder.blocks,
                    builder.world,
                    list,
                ),
            };
            return;
        };
        const first: u32 = @intCast(builder.nodes.items.len);
        try builder.nodes.appendNTimes(builder.arena, undefined, 2);
        builder.nodes.items[index] = .{
            .position = chosen.position,
            .axis = chosen.axis,
            .first = first,
            .pack_count = 0,
        };
        for (0..2) |child| {
            const part = try builder.side(list, chosen, child == 1);
            defer builder.gpa.free(part);
            var half = box;
            const end = if (child == 0) &half.upper else &half.lower;
            end[chosen.axis] = chosen.position;
            try builder.fill(first + @as(u32, @intCast(child)), part, half, depth + 1);
        }
    }

    /// The references that touch one side of a plane, cut at it.
    fn side(
        builder: *Builder,
        list: []const Reference,
        plane: Plane,
        is_upper: bool,
    ) error{OutOfMemory}![]Reference {
        var part: std.ArrayList(Reference) = .empty;
        errdefer part.deinit(builder.gpa);
        const axis = plane.axis;
        for (list) |reference| {
            var cut = reference;
            if (is_upper) {
                if (reference.box.upper[axis] < plane.position) continue;
                cut.box.lower[axis] = @max(cut.box.lower[axis], plane.position);
            } else {
                if (reference.box.lower[axis] > plane.position) continue;
                cut.box.upper[axis] = @min(cut.box.upper[axis], plane.position);
            }
            try part.append(builder.gpa, cut);
        }
        return part.toOwnedSlice(builder.gpa);
    }
};

/// The plane of least cost, or null where a leaf is no dearer.
fn bestPlane(list: []const Reference, box: Box3) ?Plane {
    if (list.len <= cost.width) return null;
    var best: ?Plane = null;
    var least = cost.leafCost(list.len);
    for (0..3) |axis| {
        const lower = box.lower[axis];
        const extent = box.upper[axis] - lower;
        if (!(extent > 0)) continue;
        var entries: [bin_count]usize = @splat(0);
        var exits: [bin_count]usize = @splat(0);
        for (list) |reference| {
            entries[binOf(reference.box.lower[axis], lower, extent)] += 1;
            exits[binOf(reference.box.upper[axis], lower, extent)] += 1;
        }
        var below: usize = 0;
        var above: usize = list.len;
        for (1..bin_count) |bin| {
            below += entries[bin - 1];
            above -= exits[bin - 1];
            const share = @as(f32, @floatFromInt(bin)) / bin_count;
            const position = lower + share * extent;
            if (!(position > lower) or !(position < box.upper[axis])) continue;
            const value = planeCost(box, axis, position, below, above);
            if (value >= least) continue;
            least = value;
            best = .{ .axis = @intCast(axis), .position = position, .cost = value };
        }
    }
    return best;
}

fn binOf(coordinate: f32, lower: f32, extent: f32) usize {
    const share = @max(0, (coordinate - lower) / extent * bin_count);
    return @min(bin_count - 1, @as(usize, @trunc(@min(share, bin_count))));
}

fn planeCost(box: Box3, axis: usize, position: f32, below: usize, above: usize) f32 {
    var lower = box;
    lower.upper[axis] = position;
    var upper = box;
    upper.lower[axis] = position;
    const sum = lower.halfArea() * cost.leafCost(below) + upper.halfArea() * cost.leafCost(above);
    const bonus: f32 = if (below == 0 or above == 0) empty_bonus else 1;
    return cost.node_cost + bonus * sum / box.halfArea();
}

/// What waits on the way down, for rays in lanes.
fn Entry(comptime Lanes: type) type {
    return struct { node: u32, near: Lanes.F32, far: Lanes.F32 };
}

/// How planes look to rays.
fn Course(comptime Lanes: type) type {
    return struct {
        origin: [3]Lanes.F32,
        inverse: [3]Lanes.F32,
        slack: [3]Lanes.F32,
        near: Lanes.F32,
        far: Lanes.F32,

        /// From where rays enter the tree to where they leave it or end.
        inline fn init(tree: *const Tree, ray: *const ray_file.Ray(Lanes)) @This() {
            const slabs: ray_file.RayInverse(Lanes) = .init(ray.line, &no_padding);
            var course: @This() = .{
                .origin = .{ slabs.origin.x, slabs.origin.y, slabs.origin.z },
                .inverse = .{
                    slabs.direction_inv.x, slabs.direction_inv.y, slabs.direction_inv.z,
                },
                .slack = undefined,
                .near = .zero(),
                .far = ray.closest.t,
            };
            inline for (0..3) |axis| {
                const reach = course.origin[axis].abs().max(.splat(tree.reach));
                const inverse = course.inverse[axis];
                const slack = reach.mul(inverse.abs()).mul(.splat(slack_relative));
                course.slack[axis] = slack;
                const one = course.meet(axis, tree.bounds.lower[axis]);
                const other = course.meet(axis, tree.bounds.upper[axis]);
                course.near = course.near.max(one.min(other).sub(slack));
                course.far = course.far.min(one.max(other).add(slack));
            }
            return course;
        }

        inline fn meet(course: *const @This(), axis: usize, position: f32) Lanes.F32 {
            return Lanes.F32.splat(position).sub(course.origin[axis]).mul(course.inverse[axis]);
        }
    };
}

/// One ray, against four triangles at once.
pub fn traceSingle(
    comptime Kernel: type,
    comptime query: Query,
    tree: *const Tree,
    world: *const World,
    ray: *ray_file.Ray(Single),
) void {
    var counts: TestCounts = .{};
    const view = bundle_file.viewOf(Single, &world.geometry.padding, ray);
    const TraversalRay = raylane.trace.traversal_ray.TraversalRay(Kernel);
    var traversal_ray: TraversalRay = .of(Single, false, ray, &view, 0);
    const course: Course(Single) = .init(tree, ray);
    var stack: [depth_limit + 1]struct { node: u32, near: f32, far: f32 } = undefined;
    var stack_count: usize = 0;
    var node: u32 = 0;
    var near = course.near.lane(0);
    var far = course.far.lane(0);
    while (true) {
        const at = &tree.nodes[node];
        if (near <= far and at.axis != Node.leaf) {
            const t = course.meet(at.axis, at.position).lane(0);
            const slack = course.slack[at.axis].lane(0);
            const is_down = course.inverse[at.axis].lane(0) < 0;
            const first = at.first + @intFromBool(is_down);
            const second = at.first + @intFromBool(!is_down);
            if (near > t + slack) {
                node = second;
            } else {
                if (far >= t - slack) {
                    stack[stack_count] = .{
                        .node = second,
                        .near = @max(near, t - slack),
                        .far = far,
                    };
                    stack_count += 1;
                }
                node = first;
                far = @min(far, t + slack);
            }
            continue;
        }
        if (near <= far) {
            var found = false;
            for (tree.blocks[at.first..][0..at.pack_count]) |*block| {
                found = traversal_ray.intersect(block, &world.geometry.padding, &counts) or found;
            }
            if (query == .any_hit and found) break;
        }
        if (!popSingle(&stack, &stack_count, traversal_ray.limit, &node, &near, &far)) break;
    }
    ray.closest = .{
        .t = .splat(traversal_ray.limit),
        .primitive = .splat(traversal_ray.closest_primitive),
    };
}

inline fn popSingle(
    stack: anytype,
    stack_count: *usize,
    limit: f32,
    node: *u32,
    near: *f32,
    far: *f32,
) bool {
    while (stack_count.* > 0) {
        stack_count.* -= 1;
        const top = stack[stack_count.*];
        if (top.near > limit) continue;
        node.* = top.node;
        near.* = top.near;
        far.* = top.far;
        return true;
    }
    return false;
}

/// Four rays that stay together (Wald 2004, section 7.2), where they go the same way along every
/// axis; else each by itself.
pub fn tracePacket(
    comptime SingleKernel: type,
    comptime Kernel: type,
    comptime query: Query,
    tree: *const Tree,
    world: *const World,
    group: *ray_file.Ray(Kernel.Rays),
) void {
    const Rays = Kernel.Rays;
    if (group.active.none()) return;
    const view = bundle_file.viewOf(Rays, &world.geometry.padding, group);
    var is_down: [3]bool = undefined;
    for (&is_down, view.slabs.negative) |*down, negative| {
        down.* = negative.bitAnd(group.active).any();
        if (down.* and group.active.andNot(negative).any())
            return traceApart(SingleKernel, Rays, query, tree, world, group);
    }
    const course: Course(Rays) = .init(tree, group);
    var counts: TestCounts = .{};
    var stack: [depth_limit + 1]Entry(Rays) = undefined;
    var stack_count: usize = 0;
    var entry: Entry(Rays) = .{ .node = 0, .near = course.near, .far = course.far };
    while (true) {
        const alive = entry.near.le(entry.far).bitAnd(group.active);
        const at = &tree.nodes[entry.node];
        if (at.axis != Node.leaf and alive.any()) {
            const t = course.meet(at.axis, at.position);
            const low = t.sub(course.slack[at.axis]);
            const high = t.add(course.slack[at.axis]);
            const first = at.first + @intFromBool(is_down[at.axis]);
            const second = at.first + @intFromBool(!is_down[at.axis]);
            if (entry.near.le(high).bitAnd(alive).none()) {
                entry = .{ .node = second, .near = entry.near, .far = entry.far };
                continue;
            }
            if (low.le(entry.far).bitAnd(alive).any()) {
                stack[stack_count] = .{
                    .node = second,
                    .near = entry.near.max(low),
                    .far = entry.far,
                };
                stack_count += 1;
            }
            entry = .{ .node = first, .near = entry.near, .far = entry.far.min(high) };
            continue;
        }
        if (alive.any()) {
            for (tree.blocks[at.first..][0..at.pack_count]) |*block| {
                intersectBlock(Kernel, query, world, group, &view, block, &counts);
            }
            if (query == .any_hit and isFound(Rays, group)) return;
        }
        entry = while (stack_count > 0) {
            stack_count -= 1;
            const top = stack[stack_count];
            if (top.near.le(group.closest.t).bitAnd(group.active).any()) break top;
        } else return;
    }
}

inline fn isFound(comptime Rays: type, group: *const ray_file.Ray(Rays)) bool {
    const none: Rays.I32 = .splat(ray_file.no_primitive);
    return group.closest.primitive.eq(none).bitAnd(group.active).none();
}

inline fn intersectBlock(
    comptime Kernel: type,
    comptime query: Query,
    world: *const World,
    group: *ray_file.Ray(Kernel.Rays),
    view: *const bundle_file.Precalculations(Kernel.Rays),
    block: *const cost.Block,
    counts: *TestCounts,
) void {
    for (0..cost.width) |lane| {
        if (block.primitive[lane] == raylane.world.none) break;
        _ = bundle_file.intersectLane(Kernel, query, group, view, block, .{
            .lane = lane,
            .padding = &world.geometry.padding,
        }, counts);
    }
}

fn traceApart(
    comptime SingleKernel: type,
    comptime Rays: type,
    comptime query: Query,
    tree: *const Tree,
    world: *const World,
    group: *ray_file.Ray(Rays),
) void {
    var ts = group.closest.t.toArray();
    var primitives = group.closest.primitive.toArray();
    var bits = group.active.bits();
    while (bits != 0) : (bits &= bits - 1) {
        const lane = @ctz(bits);
        var ray = group.extract(lane);
        traceSingle(SingleKernel, query, tree, world, &ray);
        ts[lane] = ray.closest.t.lane(0);
        primitives[lane] = ray.closest.primitive.lane(0);
    }
    group.closest = .{ .t = .fromArray(ts), .primitive = .fromArray(primitives) };
}
