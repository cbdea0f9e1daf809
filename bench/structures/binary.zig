//! A binary BVH by the binned surface area heuristic, in nodes of four children of which two are
//! used: so that the renderer's own traversals go through it, with half the lanes idle.
//!
//! In: references. Out: a `Tree(4)`.

const std = @import("std");
const raylane = @import("raylane");
const cost = @import("cost.zig");
const Allocator = std.mem.Allocator;
const Box3 = raylane.math.Box3;
const Node = raylane.world.Node(cost.width);
const Reference = cost.Reference;
const World = raylane.world.World;

const bin_count = 16;
/// Deeper than this, lists are cut in the middle, which ends.
const depth_balanced = 40;

/// Builds the tree; memory is the arena's.
pub fn build(
    arena: Allocator,
    world: *const World,
    list: []Reference,
) error{OutOfMemory}!raylane.world.Tree(cost.width) {
    var builder: Builder = .{ .arena = arena, .world = world };
    _ = try builder.addNode(list, 0);
    const nodes = try arena.alignedAlloc(Node, .fromByteUnits(64), builder.nodes.items.len);
    @memcpy(nodes, builder.nodes.items);
    const blocks = try arena.alignedAlloc(cost.Block, .fromByteUnits(64), builder.blocks.items.len);
    @memcpy(blocks, builder.blocks.items);
    return .{ .nodes = nodes, .packs = blocks };
}

const Builder = struct {
    arena: Allocator,
    world: *const World,
    nodes: std.ArrayList(Node) = .empty,
    blocks: std.ArrayList(cost.Block) = .empty,

    /// Recursion ends at `depth_balanced` + 32: lists are halved from there on.
    fn addNode(builder: *Builder, list: []Reference, depth: u32) error{OutOfMemory}!u32 {
        const index: u32 = @intCast(builder.nodes.items.len);
        try builder.nodes.append(builder.arena, .empty);
        const middle = split(list, depth);
        // The root alone may have one child.
        const parts: []const []Reference = if (middle == 0)
            &.{list}
        else
            &.{ list[0..middle], list[middle..] };
        for (parts, 0..) |part, child| {
            const is_leaf = middle == 0 or split(part, depth + 1) == 0;
            const first: u32 = @intCast(builder.blocks.items.len);
            const pack_count = if (is_leaf)
                try cost.appendBlocks(builder.arena, &builder.blocks, builder.world, part)
            else
                0;
            const target = if (is_leaf) first else try builder.addNode(part, depth + 1);
            if (is_leaf and pack_count == 0) continue;
            const node = &builder.nodes.items[index];
            node.child[child] = .{ .target = target, .pack_count = pack_count };
            const box = cost.boundsOf(part);
            for (0..3) |axis| {
                node.bounds[0][axis][child] = box.lower[axis];
                node.bounds[1][axis][child] = box.upper[axis];
            }
        }
        return index;
    }
};

/// Sorts references to both sides of the best plane and returns how many lie before it; 0 where a
/// leaf is best. The same list gives the same answer again.
fn split(list: []Reference, depth: u32) usize {
    if (list.len <= cost.width) return 0;
    if (depth >= depth_balanced) return list.len / 2;
    var middles: Box3 = .empty;
    for (list) |reference| middles = middles.include(reference.box.centerTwice());
    const extent = middles.extent();
    var axis: usize = 0;
    for (1..3) |other| if (extent[other] > extent[axis]) {
        axis = other;
    };
    if (!(extent[axis] > 0)) return list.len / 2;
    const plane, const least = bestBin(list, axis, middles);
    if (least >= cost.leafCost(list.len) and list.len <= 4 * cost.width) return 0;
    var before: usize = 0;
    for (list) |*reference| {
        if (binOf(reference, axis, middles) >= plane) continue;
        std.mem.swap(Reference, reference, &list[before]);
        before += 1;
    }
    return before;
}

fn binOf(reference: *const Reference, axis: usize, middles: Box3) usize {
    const offset = reference.box.centerTwice()[axis] - middles.lower[axis];
    const share = offset / (middles.upper[axis] - middles.lower[axis]);
    return @min(bin_count - 1, @as(usize, @trunc(@max(0, share * bin_count))));
}

/// The bin before which to cut, 1..`bin_count` - 1, and what that costs.
fn bestBin(list: []const Reference, axis: usize, middles: Box3) struct { usize, f32 } {
    var boxes: [bin_count]Box3 = @splat(.empty);
    var counts: [bin_count]usize = @splat(0);
    for (list) |*reference| {
        const bin = binOf(reference, axis, middles);
        boxes[bin] = boxes[bin].join(reference.box);
        counts[bin] += 1;
    }
    var right_costs: [bin_count]f32 = undefined;
    var box: Box3 = .empty;
    var count: usize = 0;
    var bin: usize = bin_count - 1;
    while (bin > 0) : (bin -= 1) {
        box = box.join(boxes[bin]);
        count += counts[bin];
        right_costs[bin] = box.halfArea() * cost.leafCost(count);
        if (count == 0) right_costs[bin] = std.math.inf(f32);
    }
    const whole = box.join(boxes[0]).halfArea();
    var best: usize = bin_count / 2;
    var least = std.math.inf(f32);
    box = .empty;
    count = 0;
    for (1..bin_count) |plane| {
        box = box.join(boxes[plane - 1]);
        count += counts[plane - 1];
        if (count == 0) continue;
        const sum = box.halfArea() * cost.leafCost(count) + right_costs[plane];
        if (sum >= least) continue;
        least = sum;
        best = plane;
    }
    return .{ best, cost.node_cost + least / whole };
}
