//! Reinsertion (Bittner et al. 2013, Meister and Bittner 2018): subtrees of a binary BVH are taken
//! out and put in where they cost less.
//!
//! In: a tree whose leaves may be smaller than packs. Out: the same triangles in a tree of the
//! same form. Each pass asks for every node where its subtree would cost the least, by branch and
//! bound over the whole tree and by all threads, then does the best of these moves first, each if
//! it still pays when its turn comes. So the tree is the same whatever the number of threads.
//!
//! J. Bittner, M. Hapala, V. Havran, "Fast Insertion-Based Optimization of Bounding Volume
//! Hierarchies" (2013); the search is that of D. Meister, J. Bittner, "Parallel Reinsertion for
//! Bounding Volume Hierarchy Optimization" (2018). Ours differs in what a tree costs (`Optimizer
//! .costOf`): triangles are tested by the pack, so what lies in one costs its box's area however
//! it is divided.

const std = @import("std");
const bvh_input = @import("input.zig");
const parallel = @import("../../parallel.zig");
const world = @import("../../world.zig");
const bvh_build = @import("build.zig");
const huge_pages = @import("../../huge_pages.zig");
const split = @import("split.zig");
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;
const Box = split.Box;
const Node = bvh_build.Node;
const Progress = @import("../../progress.zig").Progress;
const Tree = bvh_build.Tree;

const none: u32 = std.math.maxInt(u32);

/// A subtree that pays elsewhere.
const Move = struct {
    /// What the whole tree costs less.
    saving: f32,
    /// The root of the subtree, and the node that becomes its sibling.
    node: u32,
    out: u32,

    fn isBetter(_: void, a: Move, b: Move) bool {
        return if (a.saving == b.saving) a.node < b.node else a.saving > b.saving;
    }
};

/// Passes over all nodes at most. The first saves two thirds of what ten would, three 95 %. Each
/// counts for the progress as building does: a triangle for two nodes.
pub const pass_count_max = 3;

/// What a pass must save of the whole cost for another one to follow.
const saving_min = 0.002;

/// Savings of less than this, over the whole cost, may be rounding alone.
const saving_rounding = 1e-6;

/// Share of a wide node that a cut above packs makes, against 1 for a pack. Between 0.1 and 0.8
/// it hardly matters.
const inner_cost: f32 = 0.3;

/// Nodes that a thread looks at in one go.
const chunk_size = 256;

/// Optimises a tree in place. `pack_size` triangles are tested at once.
pub fn optimize(
    gpa: Allocator,
    tree: *Tree,
    pool: *parallel.Pool,
    comptime pack_size: u32,
) bvh_input.Error!void {
    var optimizer: Optimizer(pack_size) = try .init(gpa, tree);
    defer optimizer.deinit(gpa);
    for (1..pass_count_max + 1) |pass_count| {
        const before = optimizer.costs[0];
        try optimizer.pass(gpa, pool);
        if (optimizer.costs[0] < before * (1 - saving_min)) continue;
        Progress.add(pool.progress, (pass_count_max - pass_count) * tree.nodes.len / 2);
        break;
    }
    try optimizer.layOut(gpa, tree);
}

fn Optimizer(comptime pack_size: u32) type {
    return struct {
        nodes: []Node,
        /// By pair: the node above it, or `none` for pairs that are not in use.
        parents: []u32,
        /// By leaf: its first reference.
        begins: []u32,
        /// By node: what its subtree costs.
        costs: []f32,
        /// By node: levels below it.
        heights: []u8,

        const Self = @This();

        fn init(gpa: Allocator, tree: *const Tree) error{OutOfMemory}!Self {
            const node_count = tree.nodes.len;
            const parents = try gpa.alloc(u32, node_count / 2);
            errdefer gpa.free(parents);
            @memset(parents, none);
            const begins = try gpa.alloc(u32, node_count);
            errdefer gpa.free(begins);
            const costs = try gpa.alloc(f32, node_count);
            errdefer gpa.free(costs);
            const heights = try gpa.alloc(u8, node_count);
            const optimizer: Self = .{
                .nodes = tree.nodes,
                .parents = parents,
                .begins = begins,
                .costs = costs,
                .heights = heights,
            };
            optimizer.measure();
            return optimizer;
        }

        fn deinit(optimizer: *Self, gpa: Allocator) void {
            gpa.free(optimizer.parents);
            gpa.free(optimizer.begins);
            gpa.free(optimizer.costs);
            gpa.free(optimizer.heights);
            optimizer.* = undefined;
        }

        /// Fills all arrays from the nodes, depth first.
        fn measure(optimizer: *const Self) void {
            const Visit = struct { node: u32, begin: u32, is_left: bool };
            // The way down from the root.
            var path: [world.tree_depth_max]Visit = undefined;
            path[0] = .{ .node = 0, .begin = 0, .is_left = true };
            var depth: usize = 1;
            while (true) {
                const at = path[depth - 1];
                const node = &optimizer.nodes[at.node];
                if (node.pair != 0) {
                    optimizer.parents[node.pair] = at.node;
                    path[depth] = .{ .node = 2 * node.pair, .begin = at.begin, .is_left = true };
                    depth += 1;
                    continue;
                }
                optimizer.begins[at.node] = at.begin;
                optimizer.costs[at.node] = split.halfArea(node.box());
                optimizer.heights[at.node] = 0;
                // Up from what is done, then over to the right.
                while (depth > 1 and !path[depth - 1].is_left) {
                    depth -= 1;
                    optimizer.refit(path[depth - 1].node);
                }
                if (depth == 1) return;
                const left = path[depth - 1];
                path[depth - 1] = .{
                    .node = left.node + 1,
                    .begin = left.begin + optimizer.nodes[left.node].count,
                    .is_left = false,
                };
            }
        }

        /// What a subtree costs: its packs, and a share of a wide node for each cut above them.
        inline fn costOf(area: f32, count: u32, below: f32) f32 {
            return if (count <= pack_size) area else inner_cost * area + below;
        }

        /// Makes a node anew from its children.
        fn refit(optimizer: *const Self, index: u32) void {
            const node = &optimizer.nodes[index];
            const left = 2 * node.pair;
            const right = left + 1;
            const both = joined(optimizer.restOf(left), optimizer.restOf(right));
            const pair = node.pair;
            node.* = .of(both.box, both.count);
            node.pair = pair;
            optimizer.costs[index] = both.cost;
            optimizer.heights[index] = 1 +
                @max(optimizer.heights[left], optimizer.heights[right]);
        }

        fn refitUp(optimizer: *const Self, from: u32) void {
            var index = from;
            while (true) {
                optimizer.refit(index);
                if (index == 0) return;
                index = optimizer.parents[index / 2];
            }
        }

        /// Finds where each node would best be, then moves what pays.
        fn pass(optimizer: *Self, gpa: Allocator, pool: *parallel.Pool) bvh_input.Error!void {
            const moves = try gpa.alloc(Move, optimizer.nodes.len);
            defer gpa.free(moves);
            var work: SearchWork = .{ .optimizer = optimizer, .moves = moves, .pool = pool };
            try pool.forEach(@divCeil(moves.len, chunk_size), &work, SearchWork.run);
            var count: usize = 0;
            for (moves) |move| {
                if (move.saving <= 0) continue;
                moves[count] = move;
                count += 1;
            }
            std.mem.sortUnstable(Move, moves[0..count], {}, Move.isBetter);
            for (moves[0..count]) |*move| {
                if (optimizer.stillPays(move)) optimizer.apply(move);
            }
        }

        const SearchWork = struct {
            optimizer: *const Self,
            moves: []Move,
            pool: *const parallel.Pool,

            fn run(work: *SearchWork, chunk: usize, _: usize) void {
                const begin = chunk_size * chunk;
                const end = @min(begin + chunk_size, work.moves.len);
                for (work.moves[begin..end], begin..) |*move, index| {
                    move.* = work.optimizer.search(@intCast(index));
                }
                Progress.add(work.pool.progress, (end - begin) / 2);
            }
        };

        /// A subtree as it is, or would be.
        const Rest = struct { box: Box, count: u32, cost: f32 };

        fn restOf(optimizer: *const Self, index: u32) Rest {
            const node = &optimizer.nodes[index];
            return .{ .box = node.box(), .count = node.count, .cost = optimizer.costs[index] };
        }

        fn joined(a: Rest, b: Rest) Rest {
            const box = split.join(a.box, b.box);
            const count = a.count + b.count;
            return .{
                .box = box,
                .count = count,
                .cost = costOf(split.halfArea(box), count, a.cost + b.cost),
            };
        }

        /// The best place for the subtree of a node.
        fn search(optimizer: *const Self, index: u32) Move {
            var best: Move = .{ .saving = 0, .node = index, .out = none };
            if (index < 2 or optimizer.parents[index / 2] == none) return best;
            var top = optimizer.parents[index / 2];
            const seeker: Seeker = .init(optimizer, index, &best);
            const sibling = index ^ 1;
            // What is left of `top` without the subtree.
            var rest = optimizer.restOf(sibling);
            // The sibling grows to what the parent is, and may give the subtree to one below it.
            if (optimizer.nodes[top].count > pack_size) {
                seeker.seekBelow(sibling, optimizer.costs[top] - rest.cost);
            }
            while (top != 0) {
                const above = optimizer.parents[top / 2];
                if (optimizer.nodes[above].count > pack_size) {
                    seeker.seek(top ^ 1, optimizer.costs[top] - rest.cost);
                }
                rest = joined(rest, optimizer.restOf(top ^ 1));
                top = above;
                // Beside all that is left of an ancestor.
                const coherence = joined(rest, seeker.subtree);
                seeker.offer(top, optimizer.costs[top] - coherence.cost);
            }
            if (best.saving < saving_rounding * optimizer.costs[0]) best.saving = 0;
            return best;
        }

        /// Looks through subtrees for the place of another.
        const Seeker = struct {
            optimizer: *const Self,
            subtree: Rest,
            /// The least that it adds wherever it goes.
            cost_min: f32,
            best: *Move,

            fn init(optimizer: *const Self, index: u32, best: *Move) Seeker {
                const subtree = optimizer.restOf(index);
                const alone = subtree.cost + inner_cost * split.halfArea(subtree.box);
                return .{
                    .optimizer = optimizer,
                    .subtree = subtree,
                    .cost_min = if (subtree.count < pack_size) 0 else alone,
                    .best = best,
                };
            }

            fn offer(seeker: *const Seeker, out: u32, saving: f32) void {
                if (saving <= seeker.best.saving) return;
                seeker.best.saving = saving;
                seeker.best.out = out;
            }

            /// Offers each place below a node, but not that beside it.
            fn seekBelow(seeker: *const Seeker, index: u32, saved: f32) void {
                const node = &seeker.optimizer.nodes[index];
                if (node.count <= pack_size) return;
                const grown = split.halfArea(split.join(seeker.subtree.box, node.box()));
                const left = saved - inner_cost * (grown - split.halfArea(node.box()));
                seeker.seek(2 * node.pair, left);
                seeker.seek(2 * node.pair + 1, left);
            }

            /// Offers each place in a subtree; `saved` is what all else in the tree saves.
            fn seek(seeker: *const Seeker, root: u32, saved: f32) void {
                const Visit = struct { node: u32, saved: f32 };
                const optimizer = seeker.optimizer;
                // On each level one waits.
                var stack: [world.tree_depth_max + 1]Visit = undefined;
                stack[0] = .{ .node = root, .saved = saved };
                var stack_count: usize = 1;
                while (stack_count > 0) {
                    stack_count -= 1;
                    const visit = stack[stack_count];
                    if (visit.saved - seeker.cost_min <= seeker.best.saving) continue;
                    const node = &optimizer.nodes[visit.node];
                    const cost = optimizer.costs[visit.node];
                    const grown = split.halfArea(split.join(seeker.subtree.box, node.box()));
                    const both = node.count + seeker.subtree.count;
                    const coherence = costOf(grown, both, cost + seeker.subtree.cost);
                    seeker.offer(visit.node, visit.saved - (coherence - cost));
                    if (node.count <= pack_size) continue;
                    const added = inner_cost * (grown - split.halfArea(node.box()));
                    const left = visit.saved - added;
                    stack[stack_count] = .{ .node = 2 * node.pair, .saved = left };
                    stack[stack_count + 1] = .{ .node = 2 * node.pair + 1, .saved = left };
                    stack_count += 2;
                }
            }
        };

        /// Whether a move is possible and saves something in the tree as it has become.
        fn stillPays(optimizer: *const Self, move: *const Move) bool {
            const index = move.node;
            const parent = optimizer.parents[index / 2];
            if (move.out == index or move.out == index ^ 1 or move.out == parent) return false;
            var above_buffer: [world.tree_depth_max]u32 = undefined;
            var above_count: usize = 0;
            var at = move.out;
            while (at != 0) : (above_count += 1) {
                at = optimizer.parents[at / 2];
                above_buffer[above_count] = at;
            }
            const above_out = above_buffer[0..above_count];
            if (contains(above_out, index)) return false;
            // The two stand below a new node, below all of these.
            const height = @max(optimizer.heights[index], optimizer.heights[move.out]);
            if (above_count + 2 + height > world.tree_depth_max) return false;
            return optimizer.savingOf(move, above_out) > saving_rounding * optimizer.costs[0];
        }

        fn contains(nodes: []const u32, index: u32) bool {
            return std.mem.findScalar(u32, nodes, index) != null;
        }

        /// What a move saves, `above_out` being the nodes above the new place.
        fn savingOf(optimizer: *const Self, move: *const Move, above_out: []const u32) f32 {
            const costs = optimizer.costs;
            const moved = optimizer.restOf(move.node);
            var top = optimizer.parents[move.node / 2];
            const sibling = move.node ^ 1;
            var with = joined(moved, optimizer.restOf(move.out));
            if (contains(above_out, top)) { // The new place is below the sibling.
                with = optimizer.joinedUpTo(sibling, move.out, with);
                return costs[top] - with.cost;
            }
            var without = optimizer.restOf(sibling);
            while (top != move.out and !contains(above_out, optimizer.parents[top / 2])) {
                without = joined(without, optimizer.restOf(top ^ 1));
                top = optimizer.parents[top / 2];
            }
            if (top == move.out) return costs[top] - joined(without, moved).cost;
            with = optimizer.joinedUpTo(top ^ 1, move.out, with);
            return costs[top] + costs[top ^ 1] - without.cost - with.cost;
        }

        /// What becomes of `top` where `from` below it becomes `rest`.
        fn joinedUpTo(optimizer: *const Self, top: u32, from: u32, rest: Rest) Rest {
            var result = rest;
            var at = from;
            while (at != top) : (at = optimizer.parents[at / 2]) {
                result = joined(result, optimizer.restOf(at ^ 1));
            }
            return result;
        }

        /// Takes a subtree out and puts it in beside `move.out`.
        fn apply(optimizer: *const Self, move: *const Move) void {
            const index = move.node;
            const sibling = index ^ 1;
            const pair = index / 2;
            const parent = optimizer.parents[pair];
            // The sibling takes the parent's place, what becomes the new sibling takes the
            // sibling's, and the pair goes where that one was.
            optimizer.copy(sibling, parent);
            optimizer.copy(move.out, sibling);
            optimizer.nodes[move.out].pair = pair;
            optimizer.parents[pair] = move.out;
            if (parent != 0) optimizer.refitUp(optimizer.parents[parent / 2]);
            optimizer.refitUp(move.out);
        }

        fn copy(optimizer: *const Self, from: u32, to: u32) void {
            optimizer.nodes[to] = optimizer.nodes[from];
            optimizer.begins[to] = optimizer.begins[from];
            optimizer.costs[to] = optimizer.costs[from];
            optimizer.heights[to] = optimizer.heights[from];
            const pair = optimizer.nodes[to].pair;
            if (pair != 0) optimizer.parents[pair] = to;
        }

        /// Numbers pairs and moves references as `Tree` wants them.
        fn layOut(optimizer: *const Self, gpa: Allocator, tree: *Tree) error{OutOfMemory}!void {
            const nodes = try gpa.alloc(Node, tree.nodes.len);
            errdefer gpa.free(nodes);
            const references = try huge_pages.alloc(gpa, Box, tree.references.len);
            errdefer huge_pages.free(gpa, references);
            var layout: Layout = .{
                .optimizer = optimizer,
                .from = tree.references,
                .nodes = nodes,
                .references = references,
            };
            defer layout.deinit(gpa);
            try layout.run(gpa);
            const stretches = try layout.stretches.toOwnedSlice(gpa);
            errdefer gpa.free(stretches);
            const top_pairs = try layout.top_pairs.toOwnedSlice(gpa);
            tree.deinit(gpa);
            tree.* = .{
                .nodes = nodes,
                .references = references,
                .stretches = stretches,
                .top_pairs = top_pairs,
            };
        }

        /// A tree on its way into new arrays.
        const Layout = struct {
            optimizer: *const Self,
            from: []const Box,
            nodes: []Node,
            references: []Box,
            stretches: std.ArrayList(Tree.Stretch) = .empty,
            top_pairs: std.ArrayList(u32) = .empty,

            /// `from` is where a node is, `to` where it goes, `begin` its first reference there.
            const Visit = struct { from: u32, to: u32, begin: u32, in_task: bool };

            fn deinit(layout: *Layout, gpa: Allocator) void {
                layout.stretches.deinit(gpa);
                layout.top_pairs.deinit(gpa);
            }

            /// Visits the nodes depth first, left to right.
            fn run(layout: *Layout, gpa: Allocator) error{OutOfMemory}!void {
                const task_size = bvh_build.taskSize(layout.references.len);
                var stack: [world.tree_depth_max + 1]Visit = undefined;
                stack[0] = .{ .from = 0, .to = 0, .begin = 0, .in_task = false };
                var stack_count: usize = 1;
                while (stack_count > 0) {
                    stack_count -= 1;
                    const visit = stack[stack_count];
                    const node = &layout.optimizer.nodes[visit.from];
                    layout.nodes[visit.to] = node.*;
                    const is_task = node.count <= task_size;
                    if (is_task and !visit.in_task) {
                        const first = visit.begin + 1;
                        try layout.stretches.append(gpa, .{ .begin = first, .end = first });
                    }
                    if (node.pair == 0) {
                        layout.copyLeaf(&visit, node.count);
                        continue;
                    }
                    const middle = visit.begin + layout.optimizer.nodes[2 * node.pair].count;
                    const pair = try layout.takePair(gpa, middle, is_task);
                    layout.nodes[visit.to].pair = pair;
                    for ([_]u32{ 1, 0 }, stack_count..) |side, at| stack[at] = .{
                        .from = 2 * node.pair + side,
                        .to = 2 * pair + side,
                        .begin = if (side == 0) visit.begin else middle,
                        .in_task = is_task,
                    };
                    stack_count += 2;
                }
            }

            fn copyLeaf(layout: *Layout, visit: *const Visit, count: u32) void {
                const begin = layout.optimizer.begins[visit.from];
                @memcpy(
                    layout.references[visit.begin..][0..count],
                    layout.from[begin..][0..count],
                );
            }

            /// A pair for two halves that meet at `middle`, numbered as in build.zig.
            fn takePair(
                layout: *Layout,
                gpa: Allocator,
                middle: u32,
                is_task: bool,
            ) error{OutOfMemory}!u32 {
                if (!is_task) {
                    try layout.top_pairs.append(gpa, middle);
                    return middle;
                }
                const last = &layout.stretches.items[layout.stretches.items.len - 1];
                last.end += 1;
                return last.end - 1;
            }
        };
    };
}

test "a subtree that was put in the wrong place finds the right one" {
    const gpa = std.testing.allocator;
    // Two heaps of four packs; one pack of the second is among those of the first.
    const heaps = [_]f32{ 0, 0, 0, 100, 100, 100, 100, 0 };
    const nodes = try gpa.alloc(Node, 2 * heaps.len);
    const references = try huge_pages.alloc(gpa, Box, heaps.len);
    for (references, heaps, 0..) |*box, x, index| {
        const y: f32 = @floatFromInt(index);
        const lower = [3]f32{ x, y, 0 };
        const upper = [3]f32{ x + 1, y + 1, 1 };
        box.* = split.reference(.{ .lower = lower, .upper = upper }, @intCast(index));
    }
    // A list: each pair has a leaf on the left and all others on the right.
    for (0..heaps.len) |index| {
        const at = if (index == 0) 0 else 2 * index + 1;
        var box = split.box_empty;
        for (references[index..]) |other| box = split.join(box, other);
        nodes[at] = .of(box, @intCast(heaps.len - index));
        if (index + 1 == heaps.len) break;
        nodes[at].pair = @intCast(index + 1);
        nodes[2 * (index + 1)] = .of(references[index], 1);
    }
    const stretches = try gpa.dupe(Tree.Stretch, &.{.{ .begin = 1, .end = heaps.len }});
    var tree: Tree = .{
        .nodes = nodes,
        .references = references,
        .stretches = stretches,
        .top_pairs = try gpa.alloc(u32, 0),
    };
    defer tree.deinit(gpa);
    var pool: parallel.Pool = .init(2);
    defer pool.deinit();
    try optimize(gpa, &tree, &pool, 1);
    // The heaps are the root's children.
    const pair = tree.nodes[0].pair;
    for ([_]u32{ 2 * pair, 2 * pair + 1 }) |child| {
        const box = split.toBox3(tree.nodes[child].box());
        try std.testing.expectEqual(4, tree.nodes[child].count);
        try std.testing.expectEqual(1, box.upper[0] - box.lower[0]);
    }
    try std.testing.expectEqual(heaps.len, tree.stretches[0].end);
    var seen: u32 = 0;
    for (tree.references) |reference| {
        seen |= @as(u32, 1) << @intCast(split.triangleNumber(reference));
    }
    try std.testing.expectEqual(0xff, seen);
}
