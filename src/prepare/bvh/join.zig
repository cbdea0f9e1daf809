//! Join of the tree over flattened triangles with one over the clusters of instances.
//!
//! In: the tree of the triangles, boxes of clusters in world space. Out: one tree of both. The
//! boxes are built over as if they were triangles; a pack of them then becomes a node, whose
//! children are the clusters. All boxes are grown like those of triangles, so that none culls what
//! is hit within.

const std = @import("std");
const math = @import("../../math.zig");
const parallel = @import("../../parallel.zig");
const world = @import("../../world.zig");
const wide = @import("wide.zig");
const bvh_input = @import("input.zig");
const huge_pages = @import("../../huge_pages.zig");
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;
const Box3 = math.Box3;
const Child = world.Child;

/// Levels above the clusters at most, so that stacks have room for what is below them.
pub fn depthMax(comptime width: u32) u32 {
    return world.walk_depth_max - world.instances.clusterNodesMax(width) - 1;
}

/// Joins `tree` with one over `boxes`, at least one, which stand for the clusters of the same
/// numbers. `input` says how to build; the tree's nodes come from `arena`. Where it would have more
/// levels than `depth_max`, the boxes are only put together in their order, `width` at a time. Adds
/// to `statistics`.
pub fn join(
    gpa: Allocator,
    arena: Allocator,
    input: *const wide.Input,
    boxes: []const Box3,
    comptime width: u32,
    tree: *const world.Tree(width),
    depth_max: u32,
    statistics: *world.TreeStatistics,
) bvh_input.Error!world.Tree(width) {
    var scratch: std.heap.ArenaAllocator = .init(gpa);
    defer scratch.deinit();
    const built = try buildClusters(gpa, scratch.allocator(), input, boxes, width);
    const clusters = built.tree();
    const has_triangles = tree.packs.len > 0;
    const kept_count = if (has_triangles) tree.nodes.len else 0;
    const Node = world.Node(width);
    // A node for each pack, and fewer above them.
    const room = 1 + kept_count + clusters.nodes.len + 2 * clusters.packs.len;
    var writer: Writer(width) = .{
        .padding = &input.padding,
        .clusters = clusters,
        .nodes = try huge_pages.alloc(arena, Node, room),
        .count = 1,
    };
    const first = if (has_triangles) writer.copy(tree.nodes) else 0;
    const below_count = writer.count;
    var second = writer.copy(clusters.nodes);
    for (second..writer.count) |index| try writer.open(scratch.allocator(), index);
    if (1 + try writer.depthBelow(gpa, second) > depth_max) {
        writer.count = below_count;
        second = (try writer.gather(scratch.allocator(), 0, clusters.packs.len)).target;
    }
    const both = [2]Child{
        .{ .target = first, .pack_count = 0 }, .{ .target = second, .pack_count = 0 },
    };
    writer.nodes[0] = .empty;
    for (both[if (has_triangles) 0 else 1..], 0..) |child, slot| {
        writer.setChild(0, slot, child, writer.boundsOf(child.target));
    }
    statistics.depth = try writer.depthBelow(gpa, 0);
    assert(statistics.depth <= world.walk_depth_max);
    statistics.node_count = writer.count;
    statistics.sah_cost += built.statistics.sah_cost;
    statistics.bytes = writer.count * @sizeOf(Node) + std.mem.sliceAsBytes(tree.packs).len;
    return .{ .nodes = writer.nodes[0..writer.count], .packs = tree.packs };
}

/// A tree over boxes in place of triangles: each is that of the triangle between its corners.
fn buildClusters(
    gpa: Allocator,
    scratch: Allocator,
    input: *const wide.Input,
    boxes: []const Box3,
    comptime width: u32,
) bvh_input.Error!wide.Built(width) {
    const positions = try scratch.alloc(math.Vec3, 2 * boxes.len);
    const triangles = try scratch.alloc(world.Triangle, boxes.len);
    var centroid_bounds: Box3 = .empty;
    for (boxes, triangles, 0..) |box, *triangle, index| {
        const first: u32 = @intCast(2 * index);
        positions[first..][0..2].* = .{ box.lower, box.upper };
        triangle.* = .{ .corner = .{ first, first + 1, first }, .material = 0 };
        centroid_bounds = centroid_bounds.include(box.centerTwice());
    }
    var own = input.*;
    own.positions = positions;
    own.triangles = triangles;
    own.centroid_bounds = centroid_bounds;
    own.kept = null;
    return wide.build(gpa, scratch, &own, width);
}

fn Writer(comptime width: u32) type {
    return struct {
        padding: *const world.Padding,
        /// Its packs hold the boxes of clusters.
        clusters: world.Tree(width),
        nodes: []align(64) world.Node(width),
        count: u32,

        const Self = @This();
        const Item = struct { child: Child, box: Box3 };

        /// Appends nodes of a tree. Returns the number of their root.
        fn copy(writer: *Self, nodes: []const world.Node(width)) u32 {
            const first = writer.count;
            for (nodes, writer.nodes[first..][0..nodes.len]) |*from, *to| {
                to.* = from.*;
                for (&to.child) |*child| {
                    if (child.* != Child.missing and child.pack_count == 0) child.target += first;
                }
            }
            writer.count += @intCast(nodes.len);
            return first;
        }

        /// Makes nodes of the leaves of a node.
        fn open(writer: *Self, scratch: Allocator, index: usize) error{OutOfMemory}!void {
            for (0..width) |slot| {
                const child = writer.nodes[index].child[slot];
                if (child.pack_count == 0) continue;
                const first, const end = child.packs();
                writer.nodes[index].child[slot] = try writer.gather(scratch, first, end);
            }
        }

        /// A node over the clusters of some packs, one at least.
        fn gather(
            writer: *Self,
            scratch: Allocator,
            first: usize,
            end: usize,
        ) error{OutOfMemory}!Child {
            var items = try scratch.alloc(Item, end - first);
            for (items, first..end) |*item, pack| item.* = writer.nodeOf(pack);
            while (items.len > 1) {
                const groups = @divCeil(items.len, width);
                for (0..groups) |turn| {
                    const begin = turn * width;
                    items[turn] = writer.group(items[begin..@min(begin + width, items.len)]);
                }
                items = items[0..groups];
            }
            return items[0].child;
        }

        /// A new node of the clusters of a pack.
        fn nodeOf(writer: *Self, pack_index: usize) Item {
            const pack = &writer.clusters.packs[pack_index];
            var items: [width]Item = undefined;
            var count: usize = 0;
            for (pack.primitive, 0..) |number, lane| {
                if (number == world.none) break;
                var box: Box3 = .empty;
                for (pack.corner) |corner| {
                    box = box.include(.{ corner[0][lane], corner[1][lane], corner[2][lane] });
                }
                items[count] = .{
                    .child = .{ .target = number, .pack_count = Child.cluster_mark },
                    .box = box,
                };
                count += 1;
            }
            return writer.group(items[0..count]);
        }

        /// A new node of some items.
        fn group(writer: *Self, items: []const Item) Item {
            const index = writer.count;
            writer.count += 1;
            writer.nodes[index] = .empty;
            var joined: Box3 = .empty;
            for (items, 0..) |*item, slot| {
                writer.setChild(index, slot, item.child, item.box);
                joined = joined.join(item.box);
            }
            return .{ .child = .{ .target = index, .pack_count = 0 }, .box = joined };
        }

        fn setChild(writer: *Self, index: usize, slot: usize, child: Child, box: Box3) void {
            const grown = box.grow(writer.padding.marginOfBox(box));
            const node = &writer.nodes[index];
            node.setChildBox(slot, grown);
            node.child[slot] = child;
        }

        /// Levels of nodes from one on.
        fn depthBelow(writer: *const Self, gpa: Allocator, node: u32) error{OutOfMemory}!u32 {
            const Visit = struct { node: u32, level: u32 };
            var stack: std.ArrayList(Visit) = .empty;
            defer stack.deinit(gpa);
            try stack.append(gpa, .{ .node = node, .level = 1 });
            var deepest: u32 = 0;
            while (stack.pop()) |visit| {
                deepest = @max(deepest, visit.level);
                for (writer.nodes[visit.node].child) |child| {
                    if (child == Child.missing or child.pack_count > 0) continue;
                    try stack.append(gpa, .{ .node = child.target, .level = visit.level + 1 });
                }
            }
            return deepest;
        }

        fn boundsOf(writer: *const Self, index: u32) Box3 {
            var box: Box3 = .empty;
            for (0..width) |slot| box = box.join(writer.nodes[index].childBox(slot));
            return box;
        }
    };
}

test "every cluster is reached once, in its box, however few levels there may be" {
    const gpa = std.testing.allocator;
    var arena_state: std.heap.ArenaAllocator = .init(gpa);
    defer arena_state.deinit();
    const arena = arena_state.allocator();
    var pool: parallel.Pool = .init(1);
    defer pool.deinit();
    var random_state: std.Random.DefaultPrng = .init(7);
    const random = random_state.random();
    var boxes: [200]Box3 = undefined;
    var bounds: Box3 = .empty;
    for (&boxes, 0..) |*box, index| {
        // Many in one place.
        if (index % 3 == 1) {
            box.* = boxes[0];
            continue;
        }
        var at: math.Vec3 = undefined;
        for (&at) |*coordinate| coordinate.* = random.floatNorm(f32);
        box.* = Box3.empty.include(at).grow(0.1);
        bounds = bounds.join(box.*);
    }
    const input: wide.Input = .{
        .positions = &.{},
        .triangles = &.{},
        .centroid_bounds = .empty,
        .padding = .init(@splat(0), bounds),
        .pool = &pool,
    };
    inline for (.{ 4, 8, 16 }) |width| for ([_]u32{ 1, depthMax(width) }) |depth_max| {
        var built = try wide.build(gpa, arena, &input, width);
        const tree = built.tree();
        const joined =
            try join(gpa, arena, &input, &boxes, width, &tree, depth_max, &built.statistics);
        var seen: [boxes.len]bool = @splat(false);
        for (joined.nodes) |*node| for (node.child, 0..) |child, slot| {
            if (!child.isCluster()) continue;
            try std.testing.expect(!seen[child.target]);
            seen[child.target] = true;
            try std.testing.expect(node.childBox(slot).contains(boxes[child.target]));
        };
        for (seen) |is_seen| try std.testing.expect(is_seen);
        if (depth_max == 1) try std.testing.expect(built.statistics.depth <= 6);
        try std.testing.expectEqual(joined.nodes.len, built.statistics.node_count);
    };
}
