//! Collapse of a binary BVH into the wide one that rays travel (Ylitie, Karras and Laine 2017).
//!
//! In: triangles. Out: nodes of `width` children and packs of `width` triangles, exactly as many
//! as there are, a node's inner children side by side and likewise the packs of its leaves. Which
//! binary nodes become wide nodes, which become leaves and which vanish is decided so that the
//! expected cost is the least that the binary tree allows, by dynamic programming: H. Ylitie,
//! T. Karras, S. Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs"
//! (2017), section 3.1, equations 1 to 4.

const std = @import("std");
const math = @import("../../math.zig");
const parallel = @import("../../parallel.zig");
const world = @import("../../world.zig");
const bvh_input = @import("input.zig");
const bvh_build = @import("build.zig");
const bvh_reinsert = @import("reinsert.zig");
const bvh_split = @import("split.zig");
const huge_pages = @import("../../huge_pages.zig");
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;
const Box3 = math.Box3;
const TreeQuality = @import("../../settings.zig").TreeQuality;
const Vec3 = math.Vec3;
const Work = @import("../../progress.zig").Work;

/// What is to be built on.
pub const Input = bvh_input.Input;

/// Cost of testing a ray against the boxes of a node, and against a pack of triangles.
pub const node_cost: f32 = 1;
pub const pack_cost: f32 = 1;

/// Bytes that a build asks for by triangle, before there is a tree.
pub const build_triangle_bytes = @sizeOf(bvh_split.Box) + 2 * @sizeOf(bvh_build.Node);

/// How many numbers ahead corners are fetched, and their triangles once more as many.
const prefetch_distance = 16;

/// Nodes and packs that one thread works on: children stand behind their parents.
pub const Part = struct { node_begin: u32, node_end: u32, pack_begin: u32, pack_end: u32 };

/// A tree, to be fitted to other places of its triangles.
pub fn Built(comptime width: u32) type {
    return struct {
        nodes: []align(world.cache_line_bytes) world.Node(width),
        packs: []align(world.cache_line_bytes) world.TrianglePack(width),
        /// All of it. The first part begins with the root and is above all others; what is below a
        /// node of another part is in that.
        parts: []const Part,
        statistics: world.TreeStatistics,

        /// As rays have it.
        pub fn tree(built: *const @This()) world.Tree(width) {
            return .{ .nodes = built.nodes, .packs = built.packs };
        }
    };
}

/// What building trees of so many triangles is, for the progress.
pub fn workOf(triangle_count: u64, quality: TreeQuality) Work {
    const times: u64 = if (quality == .high) 1 + bvh_reinsert.pass_count_max else 1;
    return .{
        .stage = .tree,
        .total = times * triangle_count,
        .pieces_per_unit = times,
    };
}

/// Builds the tree of `input`. It comes from `arena`; what is needed meanwhile comes from `gpa`.
/// Without triangles the tree is one node without children.
pub fn build(
    gpa: Allocator,
    arena: Allocator,
    input: *const Input,
    comptime width: u32,
) bvh_input.Error!Built(width) {
    if (input.count() == 0) {
        const Node = world.Node(width);
        const nodes = try arena.alignedAlloc(Node, .@"64", 1);
        nodes[0] = .empty;
        const root: Part = .{ .node_begin = 0, .node_end = 1, .pack_begin = 0, .pack_end = 0 };
        return .{
            .nodes = nodes,
            .packs = &.{},
            .parts = try arena.dupe(Part, &.{root}),
            .statistics = .{
                .node_count = 1,
                .depth = 0,
                .sah_cost = 0,
                .bytes = @sizeOf(Node),
            },
        };
    }
    var binary = try bvh_build.build(gpa, input, width);
    defer binary.deinit(gpa);
    if (input.quality == .high) {
        try bvh_reinsert.optimize(gpa, &binary, input.pool, width);
    }
    const costs = try gpa.alloc([width]f32, binary.nodes.len);
    defer gpa.free(costs);
    var collapse: Collapse(width) = .init(input, &binary, costs);
    try collapse.weigh();
    const order = try binary.takeOrder(gpa, input.pool);
    defer huge_pages.free(gpa, order);
    collapse.order = order;
    return collapse.emit(gpa, arena);
}

/// A binary node and where its triangles begin.
const Item = struct {
    node: u32,
    begin: u32,
};

/// A stretch of the tree that one thread counts and writes.
const Share = struct {
    item: Item,
    depth: u32,
    node_begin: u32 = 0,
    pack_begin: u32 = 0,
    node_count: u32 = 0,
    pack_count: u32 = 0,
    depth_max: u32 = 0,
    cost: f64 = 0,
};

/// A wide node to be written.
const Visit = struct { item: Item, depth: u32, index: u32 };

fn Collapse(comptime width: u32) type {
    return struct {
        input: *const Input,
        binary: *const bvh_build.Tree,
        /// By binary node: lane i - 1 holds the least cost of what is below it when it is shown as
        /// at most i children of one wide node, 1 <= i < width; the last lane its cost as a leaf.
        costs: [][width]f32,
        /// Numbers of the triangles, those of each leaf side by side. For `emit`.
        order: []const u32 = &.{},
        root_area: f32,
        root_area_inv: f32,

        const Self = @This();
        const Lanes = @Vector(width, f32);
        const Node = world.Node(width);
        const Pack = world.TrianglePack(width);

        fn init(input: *const Input, binary: *const bvh_build.Tree, costs: [][width]f32) Self {
            const root_area = bvh_split.halfArea(binary.nodes[0].box());
            return .{
                .input = input,
                .binary = binary,
                .costs = costs,
                .root_area = root_area,
                .root_area_inv = if (root_area > 0) 1 / root_area else 0,
            };
        }

        /// Fills `costs`, children before parents.
        fn weigh(collapse: *Self) parallel.Error!void {
            try collapse.input.pool.forEach(
                collapse.binary.stretches.len,
                collapse,
                weighStretch,
            );
            const pairs = collapse.binary.top_pairs;
            for (0..pairs.len) |index| collapse.weighPair(pairs[pairs.len - 1 - index]);
            collapse.weighNode(0);
        }

        fn weighStretch(collapse: *Self, index: usize, _: usize) void {
            const stretch = collapse.binary.stretches[index];
            var pair = stretch.end;
            while (pair > stretch.begin) {
                pair -= 1;
                collapse.weighPair(pair);
            }
        }

        fn weighPair(collapse: *Self, pair: u32) void {
            collapse.weighNode(2 * pair);
            collapse.weighNode(2 * pair + 1);
        }

        fn weighNode(collapse: *Self, index: u32) void {
            const node = &collapse.binary.nodes[index];
            const area = bvh_split.halfArea(node.box()) * collapse.root_area_inv;
            const leaf = area * pack_cost * @as(f32, @floatFromInt(packCount(node.count)));
            if (node.pair == 0) {
                collapse.costs[index] = @splat(leaf);
                return;
            }
            const shared: [width]f32 = distribute(
                collapse.costs[2 * node.pair],
                collapse.costs[2 * node.pair + 1],
            );
            const inner = shared[width - 1] + area * node_cost;
            var costs: [width]f32 = undefined;
            costs[0] = if (leaf < inner) leaf else inner;
            for (1..width - 1) |lane| {
                costs[lane] = if (shared[lane] < costs[lane - 1]) shared[lane] else costs[lane - 1];
            }
            costs[width - 1] = leaf;
            collapse.costs[index] = costs;
        }

        /// Lane j - 1: the least of left(k) + right(j - k) over 1 <= k < j, infinite for j = 1.
        inline fn distribute(left: [width]f32, right: Lanes) Lanes {
            const infinite: Lanes = @splat(std.math.inf(f32));
            var least = infinite;
            inline for (1..width) |k| {
                const shift = comptime shift: {
                    var lanes: [width]i32 = undefined;
                    for (&lanes, 0..) |*lane, j| {
                        lane.* = if (j < k) ~@as(i32, 0) else @intCast(j - k);
                    }
                    break :shift lanes;
                };
                const shifted = @shuffle(f32, right, infinite, @as(@Vector(width, i32), shift));
                const sum = shifted + @as(Lanes, @splat(left[k - 1]));
                least = @select(f32, sum < least, sum, least);
            }
            return least;
        }

        /// Whether a binary node is shown as a leaf where it is one child.
        fn isLeaf(collapse: *const Self, index: u32) bool {
            if (collapse.binary.nodes[index].pair == 0) return true;
            const costs = &collapse.costs[index];
            return costs[0] == costs[width - 1];
        }

        /// The binary nodes that are the children of the wide node made of `item`, left to right.
        fn open(collapse: *const Self, item: Item, children: *[width]Item) u32 {
            if (collapse.isLeaf(item.node)) { // The root of a tree of one leaf.
                children[0] = item;
                return 1;
            }
            const Opening = struct { item: Item, slot_count: u32 };
            var stack: [width]Opening = undefined;
            stack[0] = .{ .item = item, .slot_count = width };
            var stack_count: usize = 1;
            var child_count: u32 = 0;
            while (stack_count > 0) {
                stack_count -= 1;
                const share = stack[stack_count];
                const slot_count = collapse.usedSlots(share.item.node, share.slot_count);
                if (slot_count == 1) {
                    children[child_count] = share.item;
                    child_count += 1;
                    continue;
                }
                const pair = collapse.binary.nodes[share.item.node].pair;
                const left_slots = collapse.leftSlots(pair, slot_count);
                const left_count = collapse.binary.nodes[2 * pair].count;
                stack[stack_count] = .{
                    .item = .{ .node = 2 * pair + 1, .begin = share.item.begin + left_count },
                    .slot_count = slot_count - left_slots,
                };
                stack[stack_count + 1] = .{
                    .item = .{ .node = 2 * pair, .begin = share.item.begin },
                    .slot_count = left_slots,
                };
                stack_count += 2;
            }
            assert(child_count >= 2 and child_count <= width);
            return child_count;
        }

        /// The fewest children that do as well as `slot_count` for a node.
        fn usedSlots(collapse: *const Self, node: u32, slot_count: u32) u32 {
            assert(slot_count >= 1 and slot_count <= width);
            if (collapse.binary.nodes[node].pair == 0) return 1;
            if (slot_count == width) return width; // A wide node is made of it in any case.
            const costs = &collapse.costs[node];
            var used = slot_count;
            while (used > 1 and costs[used - 1] == costs[used - 2]) used -= 1;
            return used;
        }

        /// How many of `slot_count` children the left of a pair gets.
        fn leftSlots(collapse: *const Self, pair: u32, slot_count: u32) u32 {
            const left = &collapse.costs[2 * pair];
            const right = &collapse.costs[2 * pair + 1];
            var best: u32 = 1;
            for (2..slot_count) |k| {
                const cost = left[k - 1] + right[slot_count - k - 1];
                const best_cost = left[best - 1] + right[slot_count - best - 1];
                if (cost < best_cost) best = @intCast(k);
            }
            return best;
        }

        /// Lays out nodes and packs: counts them part by part, then writes part by part. The first
        /// part is what lies above all others.
        fn emit(
            collapse: *Self,
            gpa: Allocator,
            arena: Allocator,
        ) bvh_input.Error!Built(width) {
            const limit: u32 = @intCast(bvh_build.taskSize(collapse.input.count()));
            var parts: std.ArrayList(Share) = .empty;
            defer parts.deinit(gpa);
            try collapse.findParts(gpa, &parts, limit);
            var work: EmitWork = .{ .collapse = collapse, .parts = parts.items, .limit = limit };
            const pool = collapse.input.pool;
            try pool.forEach(parts.items.len, &work, EmitWork.count);

            var node_count: u32 = 0;
            var pack_count: u32 = 0;
            var statistics: world.TreeStatistics =
                .{ .node_count = 0, .depth = 0, .sah_cost = 0, .bytes = 0 };
            const written = try arena.alloc(Part, parts.items.len);
            for (parts.items, written) |*part, *to| {
                part.node_begin = node_count;
                part.pack_begin = pack_count;
                node_count += part.node_count;
                pack_count += part.pack_count;
                to.* = .{
                    .node_begin = part.node_begin,
                    .node_end = node_count,
                    .pack_begin = part.pack_begin,
                    .pack_end = pack_count,
                };
                statistics.depth = @max(statistics.depth, part.depth_max);
                statistics.sah_cost += part.cost;
            }
            assert(statistics.depth <= world.tree_depth_max);
            work.nodes = try huge_pages.alloc(arena, Node, node_count);
            work.packs = try huge_pages.alloc(arena, Pack, pack_count);
            try pool.forEach(parts.items.len, &work, EmitWork.write);
            statistics.node_count = node_count;
            statistics.bytes = @as(u64, node_count) * @sizeOf(Node) +
                @as(u64, pack_count) * @sizeOf(Pack);
            return .{
                .nodes = work.nodes,
                .packs = work.packs,
                .parts = written,
                .statistics = statistics,
            };
        }

        /// Parts of about `limit` triangles, each a wide node and all below it, but for the first,
        /// which starts at the root and ends where others start.
        fn findParts(
            collapse: *const Self,
            gpa: Allocator,
            parts: *std.ArrayList(Share),
            limit: u32,
        ) error{OutOfMemory}!void {
            const top: Share = .{ .item = .{ .node = 0, .begin = 0 }, .depth = 1 };
            try parts.append(gpa, top);
            var waiting: std.ArrayList(Share) = .empty;
            defer waiting.deinit(gpa);
            try waiting.append(gpa, top);
            // In the order of `walk`, which meets the same parts.
            while (waiting.pop()) |visit| {
                var children: [width]Item = undefined;
                const child_count = collapse.open(visit.item, &children);
                const bottom = waiting.items.len;
                for (children[0..child_count]) |child| {
                    if (collapse.isLeaf(child.node)) continue;
                    const is_part = collapse.binary.nodes[child.node].count <= limit;
                    const list = if (is_part) parts else &waiting;
                    try list.append(gpa, .{ .item = child, .depth = visit.depth + 1 });
                }
                std.mem.reverse(Share, waiting.items[bottom..]);
            }
        }

        const EmitWork = struct {
            collapse: *const Self,
            parts: []Share,
            limit: u32,
            nodes: []align(world.cache_line_bytes) Node = &.{},
            packs: []align(world.cache_line_bytes) Pack = &.{},

            fn count(work: *EmitWork, turn: usize, _: usize) void {
                work.walk(work.partAt(turn), false);
            }

            fn write(work: *EmitWork, turn: usize, _: usize) void {
                work.walk(work.partAt(turn), true);
            }

            fn partAt(work: *const EmitWork, turn: usize) usize {
                const thread_count = work.collapse.input.pool.thread_count;
                return parallel.interleave(turn, work.parts.len, thread_count);
            }

            /// Visits the wide nodes of a part in depth-first order.
            fn walk(work: *EmitWork, part_index: usize, comptime writing: bool) void {
                const collapse = work.collapse;
                const part = &work.parts[part_index];
                // On each level of the tree all siblings but one wait.
                var stack: [world.tree_depth_max * (width - 1) + 1]Visit = undefined;
                stack[0] = .{ .item = part.item, .depth = part.depth, .index = part.node_begin };
                var stack_count: usize = 1;
                var node_next = part.node_begin + 1;
                var pack_next = part.pack_begin;
                var next_part: usize = 1;
                while (stack_count > 0) {
                    stack_count -= 1;
                    const visit = stack[stack_count];
                    var children: [width]Item = undefined;
                    const child_count = collapse.open(visit.item, &children);
                    const bottom = stack_count;
                    if (writing) work.nodes[visit.index] = .empty;
                    if (!writing) {
                        part.depth_max = @max(part.depth_max, visit.depth);
                        part.cost += node_cost * collapse.hitShare(visit.item.node);
                    }
                    for (children[0..child_count], 0..) |child, slot| {
                        const binary = &collapse.binary.nodes[child.node];
                        var target: u32 = undefined;
                        var packs: u32 = 0;
                        if (collapse.isLeaf(child.node)) {
                            packs = packCount(binary.count);
                            target = pack_next;
                            pack_next += packs;
                            if (writing) work.writePacks(child, target, packs);
                            if (!writing) part.cost += @as(f64, @floatFromInt(packs)) *
                                pack_cost * collapse.hitShare(child.node);
                        } else if (part_index == 0 and binary.count <= work.limit) {
                            target = work.parts[next_part].node_begin;
                            next_part += 1;
                        } else {
                            target = node_next;
                            node_next += 1;
                            stack[stack_count] = .{
                                .item = child,
                                .depth = visit.depth + 1,
                                .index = target,
                            };
                            stack_count += 1;
                        }
                        if (!writing) continue;
                        collapse.setChild(&work.nodes[visit.index], slot, binary, target, packs);
                    }
                    std.mem.reverse(Visit, stack[bottom..stack_count]);
                }
                assert(part_index > 0 or next_part == work.parts.len);
                part.node_count = node_next - part.node_begin;
                part.pack_count = pack_next - part.pack_begin;
            }

            fn writePacks(work: *EmitWork, leaf: Item, begin: u32, pack_count: u32) void {
                const collapse = work.collapse;
                const order = collapse.order;
                var at: usize = leaf.begin;
                const end = at + collapse.binary.nodes[leaf.node].count;
                for (work.packs[begin..][0..pack_count]) |*pack| {
                    const filled = @min(end - at, width);
                    if (filled < width) pack.* = .empty;
                    for (0..filled) |lane| {
                        collapse.prefetch(at + lane);
                        const number = order[at + lane];
                        pack.primitive[lane] = number;
                        for (collapse.input.triangles[number].corner, 0..) |vertex, corner| {
                            const position = collapse.input.positions[vertex];
                            for (position, 0..) |coordinate, axis| {
                                pack.corner[corner][axis][lane] = coordinate;
                            }
                        }
                    }
                    at += filled;
                }
                assert(at == end);
            }
        };

        /// Leaves follow each other much as numbers do, but their triangles and corners lie
        /// scattered; waiting for them was two thirds of the time to write packs.
        inline fn prefetch(collapse: *const Self, at: usize) void {
            const order = collapse.order;
            const triangle_at = at + 2 * prefetch_distance;
            if (triangle_at >= order.len) return;
            const triangles = collapse.input.triangles;
            @prefetch(&triangles[order[triangle_at]], .{});
            const number = order[at + prefetch_distance];
            for (triangles[number].corner) |vertex| {
                @prefetch(&collapse.input.positions[vertex], .{});
            }
        }

        /// Chance that a random ray which meets the root's box meets this one.
        fn hitShare(collapse: *const Self, index: u32) f64 {
            const area: f64 = bvh_split.halfArea(collapse.binary.nodes[index].box());
            return if (collapse.root_area > 0) area / collapse.root_area else 1;
        }

        fn setChild(
            collapse: *const Self,
            node: *Node,
            slot: usize,
            binary: *const bvh_build.Node,
            target: u32,
            pack_count: u32,
        ) void {
            const upper = math.vec3.neg(binary.upper_negated);
            const box: math.Box3 = .{ .lower = binary.lower, .upper = upper };
            const grown = box.grow(collapse.input.padding.marginOfBox(box));
            node.setChildBox(slot, grown);
            node.child[slot] = .{ .target = target, .pack_count = pack_count };
        }

        fn packCount(triangle_count: u32) u32 {
            assert(triangle_count > 0);
            return (triangle_count + width - 1) / width;
        }
    };
}
