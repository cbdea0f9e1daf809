//! Parallel top-down build of a binary BVH by the binned surface area heuristic (Wald 2007).
//!
//! In: triangles and how far their boxes are grown. Out: nodes in pairs and references to the
//! triangles in the order of the leaves. The tree is the same whatever the number of threads:
//! chunks and tasks are cut by the number of triangles alone, and no result depends on the order
//! in which they are done. Large sets are cut level by level, every thread working on every set;
//! sets of `taskSize` and less are one thread's each. Both move references in place.
//!
//! I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies" (2007).

const std = @import("std");
const math = @import("../../math.zig");
const parallel = @import("../../parallel.zig");
const world = @import("../../world.zig");
const huge_pages = @import("../../huge_pages.zig");
const bvh_input = @import("input.zig");
const cells_file = @import("cells.zig");
const split = @import("split.zig");
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;
const Bins = split.Bins(split.bin_count_large, 3);
const Binning = split.Binning(split.bin_count_large);
const Cells = cells_file.Cells;
const Input = bvh_input.Input;
const Item = cells_file.Item;
const Progress = @import("../../progress.zig").Progress;
const Box = split.Box;
const Box3 = math.Box3;
const Side = split.Side;
const Split = split.Split;
const Vec3 = math.Vec3;

/// References a thread takes at a time while large sets are cut, and at the end.
const chunk_size = 4096;

/// Triangles of sets that are cut by their references rather than their cells: there are more and
/// better planes between those, and they all fit in a cache of 256 KiB.
const task_size_min = 8192;

/// Leaves of a tree that is to be optimised hold this part of a pack, so that triangles can change
/// packs.
const high_leaf_share = 4;

/// Sets in fewer cells than these are cut by their references: too few planes lie between them.
const item_count_min = 8;

/// A node of the binary tree, laid out as a `Box` with its free lanes in use:
///
///     bytes 0..11 lower corner, 12..15 count, 16..27 negated upper corner, 28..31 pair
pub const Node = extern struct {
    lower: [3]f32 align(32),
    /// Triangles below.
    count: u32,
    upper_negated: [3]f32,
    /// Children are `nodes[2 * pair]` and the next; 0: a leaf.
    pair: u32,

    /// As a box, the free lanes meaningless.
    pub inline fn box(node: *const Node) Box {
        return @as(*const Box, @ptrCast(node)).*;
    }

    /// A leaf.
    pub fn of(bounds: Box, count: u32) Node {
        const lanes: [8]f32 = bounds;
        return .{
            .lower = lanes[0..3].*,
            .count = count,
            .upper_negated = lanes[4..7].*,
            .pair = 0,
        };
    }

    comptime {
        assert(@sizeOf(Node) == @sizeOf(Box));
    }
};

/// A binary tree. The root is node 0; the references below a node stand side by side, those of its
/// left child first.
pub const Tree = struct {
    /// Two a pair; a set of `count` references that starts at `begin` has its pairs within
    /// begin + 1 .. begin + count, so that threads need not agree on who takes which.
    nodes: []Node,
    references: []align(64) Box,
    /// Pairs made, by one task side by side: parents before children within a range.
    stretches: []Stretch,
    /// Pairs above all tasks, parents before children.
    top_pairs: []u32,

    /// Pairs `begin`..`end`.
    pub const Stretch = struct { begin: u32, end: u32 };

    /// Numbers of the triangles in the order of the references, which are freed: 4 bytes of 32.
    pub fn takeOrder(
        tree: *Tree,
        gpa: Allocator,
        pool: *parallel.Pool,
    ) (error{OutOfMemory} || parallel.Error)![]align(64) u32 {
        const order = try huge_pages.alloc(gpa, u32, tree.references.len);
        errdefer huge_pages.free(gpa, order);
        const Copy = struct {
            from: []const Box,
            to: []u32,

            fn run(copy: *const @This(), index: usize, _: usize) void {
                const begin = index * chunk_size;
                const end = @min(begin + chunk_size, copy.to.len);
                for (copy.from[begin..end], copy.to[begin..end]) |reference, *number|
                    number.* = split.triangleNumber(reference);
            }
        };
        const copy: Copy = .{ .from = tree.references, .to = order };
        try pool.forEach((order.len + chunk_size - 1) / chunk_size, &copy, Copy.run);
        huge_pages.free(gpa, tree.references);
        tree.references = &.{};
        return order;
    }

    /// Frees the arrays.
    pub fn deinit(tree: *Tree, gpa: Allocator) void {
        gpa.free(tree.nodes);
        huge_pages.free(gpa, tree.references);
        gpa.free(tree.stretches);
        gpa.free(tree.top_pairs);
        tree.* = undefined;
    }
};

/// Triangles of the sets that one thread cuts on its own: small enough that many threads are busy,
/// large enough that few sets are cut by all of them.
pub fn taskSize(triangle_count: usize) usize {
    return @max(triangle_count / 64, task_size_min);
}

/// Builds the tree over at least one triangle. `pack_size` is how many triangles are tested at
/// once: sets of that many and less are leaves, and cost is counted in packs.
pub fn build(
    gpa: Allocator,
    input: *const Input,
    comptime pack_size: u32,
) bvh_input.Error!Tree {
    assert(input.count() > 0 and input.triangles.len <= split.number_limit);
    const count: u32 = @intCast(input.count());
    var builder: Builder(pack_size) = .{
        .input = input,
        .references = undefined,
        .nodes = undefined,
        .task_size = @intCast(taskSize(count)),
        .leaf_size = if (input.quality == .high) pack_size / high_leaf_share else pack_size,
    };
    builder.references = try huge_pages.alloc(gpa, Box, count);
    errdefer huge_pages.free(gpa, builder.references);
    builder.nodes = try gpa.alloc(Node, 2 * @as(usize, count));
    errdefer gpa.free(builder.nodes);
    defer builder.deinit(gpa);

    try builder.cutTop(gpa);
    const stretches = try gpa.alloc(Tree.Stretch, builder.tasks.items.len);
    errdefer gpa.free(stretches);
    try builder.runTasks(stretches);
    return .{
        .nodes = builder.nodes,
        .references = builder.references,
        .stretches = stretches,
        .top_pairs = try builder.top_pairs.toOwnedSlice(gpa),
    };
}

/// What one thread cuts.
const Task = struct {
    /// Of the triangles.
    begin: u32,
    end: u32,
    /// The next pair that is free, and all before `end` are.
    pair: u32,
    /// Within `task_sets`.
    sets_begin: u32,
    sets_end: u32,
};

/// A set of triangles that is still to be cut.
const Set = struct {
    node: u32,
    begin: u32,
    end: u32,
    /// Nodes from the root to this one.
    depth: u32,
    /// Join of the references' `centerBox`es.
    centers: Box,

    fn count(set: *const Set) u32 {
        assert(set.begin < set.end);
        return set.end - set.begin;
    }
};

fn Builder(comptime pack_size: u32) type {
    return struct {
        input: *const Input,
        references: []align(64) Box,
        nodes: []Node,
        task_size: u32,
        /// Sets of that many triangles and less are leaves.
        leaf_size: u32,
        tasks: std.ArrayList(Task) = .empty,
        /// Of tasks, those of each side by side.
        task_sets: std.ArrayList(Set) = .empty,
        top_pairs: std.ArrayList(u32) = .empty,

        const Self = @This();

        fn deinit(builder: *Self, gpa: Allocator) void {
            builder.tasks.deinit(gpa);
            builder.task_sets.deinit(gpa);
            builder.top_pairs.deinit(gpa);
        }

        /// The sets to begin with: the whole, or where there is much of it, what a grid cuts it in.
        /// Fills the references.
        fn makeSets(
            builder: *Self,
            gpa: Allocator,
            sets: *std.ArrayList(Set),
        ) bvh_input.Error!void {
            if (builder.references.len < cells_file.reference_count_min) {
                return sets.append(gpa, try builder.makeReferences());
            }
            var cells: Cells = try .init(gpa, builder.input);
            defer cells.deinit(gpa);
            var bounds: [2]Box = @splat(split.box_empty);
            for (cells.items) |*item| {
                bounds[0] = split.join(bounds[0], item.box);
                bounds[1] = split.join(bounds[1], item.centers);
            }
            try builder.cutItems(gpa, builder.makeRoot(bounds), cells.items, sets);
            try cells.scatter(gpa, builder.references);
        }

        /// Makes the references in the order of the triangles, and the root.
        fn makeReferences(builder: *Self) bvh_input.Error!Set {
            const work: ReferenceWork = .{
                .input = builder.input,
                .references = builder.references,
            };
            return builder.makeRoot(try builder.input.pool.reduce(
                [2]Box,
                @splat(split.box_empty),
                ReferenceWork.join,
                @divCeil(builder.references.len, chunk_size),
                &work,
                ReferenceWork.fill,
            ));
        }

        /// The root, of the join of all boxes and that of all `centerBox`es.
        fn makeRoot(builder: *Self, bounds: [2]Box) Set {
            const count: u32 = @intCast(builder.references.len);
            builder.nodes[0] = .of(bounds[0], count);
            return .{ .node = 0, .begin = 0, .end = count, .depth = 1, .centers = bounds[1] };
        }

        /// Cuts a set between cells, down to tasks, or to `sets` where few cells are left that hold
        /// many. Their references are yet to be moved to where the cells are moved here.
        fn cutItems(
            builder: *Self,
            gpa: Allocator,
            root: Set,
            items: []Item,
            sets: *std.ArrayList(Set),
        ) error{OutOfMemory}!void {
            const fast = builder.input.quality == .fast;
            // A set waits on each level at most.
            var stack: [world.tree_depth_max]ItemSet = undefined;
            stack[0] = .{ .set = root, .items = items, .in_task = false };
            var stack_count: usize = 1;
            while (stack_count > 0) {
                const at = stack[stack_count - 1];
                const set = &at.set;
                const is_task = set.count() <= builder.task_size;
                if (is_task and !at.in_task) try builder.beginTask(gpa, set);
                const is_done = (set.count() <= task_size_min and !fast) or isTooDeep(set) or
                    at.items.len <= @as(usize, if (fast) 1 else item_count_min);
                const chosen = if (is_done) null else chooseItems(set, at.items);
                const left = chosen orelse {
                    if (is_task) {
                        try builder.addTaskSet(gpa, set);
                    } else {
                        try sets.append(gpa, at.set);
                    }
                    stack_count -= 1;
                    continue;
                };
                const pair = try builder.takePair(gpa, set.begin + left.count, is_task);
                const children = builder.makeChildren(
                    set,
                    pair,
                    left.count,
                    left.boxes,
                    left.centers,
                );
                for ([_]usize{ 1, 0 }, stack_count - 1..) |child, to| stack[to] = .{
                    .set = children[child],
                    .items = if (child == 0)
                        at.items[0..left.item_count]
                    else
                        at.items[left.item_count..],
                    .in_task = is_task,
                };
                stack_count += 1;
            }
        }

        /// A pair for a cut whose left half ends at `left_end`, of the last task if it is in one.
        fn takePair(
            builder: *Self,
            gpa: Allocator,
            left_end: u32,
            is_task: bool,
        ) error{OutOfMemory}!u32 {
            if (is_task) {
                const task = &builder.tasks.items[builder.tasks.items.len - 1];
                task.pair += 1;
                return task.pair - 1;
            }
            // No task has this pair: theirs start one after their first triangle.
            try builder.top_pairs.append(gpa, left_end);
            return left_end;
        }

        fn beginTask(builder: *Self, gpa: Allocator, set: *const Set) error{OutOfMemory}!void {
            const sets_begin: u32 = @intCast(builder.task_sets.items.len);
            try builder.tasks.append(gpa, .{
                .begin = set.begin,
                .end = set.end,
                .pair = set.begin + 1,
                .sets_begin = sets_begin,
                .sets_end = sets_begin,
            });
        }

        /// Adds a set to the last task.
        fn addTaskSet(builder: *Self, gpa: Allocator, set: *const Set) error{OutOfMemory}!void {
            try builder.task_sets.append(gpa, set.*);
            const task = &builder.tasks.items[builder.tasks.items.len - 1];
            task.sets_end += 1;
            assert(task.sets_end == builder.task_sets.items.len);
        }

        const ItemSet = struct { set: Set, items: []Item, in_task: bool };

        const LeftItems = struct { item_count: usize, count: u32, boxes: [2]Box, centers: [2]Box };

        /// Moves the cells that go left to the front; null where nothing separates them.
        fn chooseItems(set: *const Set, items: []Item) ?LeftItems {
            const binning: Binning = .init(set.centers);
            var bins: Bins = undefined;
            bins.clear(&binning);
            for (items) |*item| bins.addItem(&binning, item);
            const chosen = bins.choose(pack_size) orelse return null;
            const side: Side = .init(&binning, &chosen);
            var left: LeftItems = .{
                .item_count = 0,
                .count = chosen.left_count,
                .boxes = .{ chosen.left_box, chosen.right_box },
                .centers = @splat(split.box_empty),
            };
            for (items) |*item| {
                const middle = split.middleOf(item.centers);
                const is_left = side.isLeft(&middle);
                const centers = &left.centers[@intFromBool(!is_left)];
                centers.* = split.join(item.centers, centers.*);
                if (!is_left) continue;
                std.mem.swap(Item, item, &items[left.item_count]);
                left.item_count += 1;
            }
            return left;
        }

        /// Makes tasks; cuts sets larger than that level by level.
        fn cutTop(builder: *Self, gpa: Allocator) bvh_input.Error!void {
            var level: std.ArrayList(Cut) = .empty;
            defer level.deinit(gpa);
            var next: std.ArrayList(Set) = .empty;
            defer next.deinit(gpa);
            try builder.makeSets(gpa, &next);
            while (next.items.len > 0) {
                level.clearRetainingCapacity();
                for (next.items) |set| {
                    if (set.count() <= builder.task_size) {
                        try builder.beginTask(gpa, &set);
                        try builder.addTaskSet(gpa, &set);
                    } else {
                        try level.append(gpa, .{ .set = set, .binning = .init(set.centers) });
                    }
                }
                next.clearRetainingCapacity();
                if (level.items.len == 0) break;
                var work = try LevelWork.init(gpa, builder, level.items);
                defer work.deinit(gpa);
                const pool = builder.input.pool;
                try pool.forEach(work.chunks.len, &work, LevelWork.fillBins);
                work.choose();
                try pool.forEach(work.chunks.len, &work, LevelWork.partitionChunk);
                try pool.forEach(work.chunks.len, &work, LevelWork.exchange);
                for (work.cuts, 0..) |*cut, index| {
                    try next.appendSlice(gpa, &work.finish(
                        cut,
                        @intCast(index),
                        try builder.takePair(gpa, cut.left_end, false),
                    ));
                }
            }
        }

        /// Cuts the sets that are tasks, the largest first.
        fn runTasks(builder: *Self, stretches: []Tree.Stretch) parallel.Error!void {
            const larger = struct {
                fn larger(_: void, a: Task, b: Task) bool {
                    return a.end - a.begin > b.end - b.begin;
                }
            }.larger;
            std.mem.sort(Task, builder.tasks.items, {}, larger);
            var work: TaskWork = .{ .builder = builder, .stretches = stretches };
            try builder.input.pool.forEach(stretches.len, &work, TaskWork.run);
        }

        /// Makes the two children of a set in the given pair. Returns them as sets.
        fn makeChildren(
            builder: *Self,
            set: *const Set,
            pair: u32,
            left_count: u32,
            boxes: [2]Box,
            centers: [2]Box,
        ) [2]Set {
            const counts = [2]u32{ left_count, set.count() - left_count };
            assert(counts[0] > 0 and counts[1] > 0);
            assert(builder.nodes[set.node].pair == 0);
            builder.nodes[set.node].pair = pair;
            const middle = set.begin + left_count;
            const begins = [2]u32{ set.begin, middle };
            const ends = [2]u32{ middle, set.end };
            var children: [2]Set = undefined;
            for (&children, 0..) |*child, index| {
                child.* = .{
                    .node = 2 * pair + @as(u32, @intCast(index)),
                    .begin = begins[index],
                    .end = ends[index],
                    .depth = set.depth + 1,
                    .centers = centers[index],
                };
                builder.nodes[child.node] = .of(boxes[index], counts[index]);
            }
            return children;
        }

        /// Whether a set must be halved now, for its leaves to stay within `world.tree_depth_max`
        /// however its heuristic cuts would fall.
        fn isTooDeep(set: *const Set) bool {
            return set.depth + std.math.log2_int_ceil(u32, set.count()) >= world.tree_depth_max;
        }

        const LevelWork = LevelWorkOf(Self, pack_size);

        const TaskWork = struct {
            builder: *Self,
            stretches: []Tree.Stretch,

            fn run(work: *TaskWork, index: usize, _: usize) void {
                work.stretches[index] = work.cutTask(&work.builder.tasks.items[index]);
            }

            /// Cuts the sets of a task down to leaves. Returns its pairs.
            fn cutTask(work: *TaskWork, task: *const Task) Tree.Stretch {
                const sets = work.builder.task_sets.items[task.sets_begin..task.sets_end];
                var pair = task.pair;
                for (sets) |*set| pair = work.cut(set.*, pair);
                assert(pair <= task.end);
                Progress.add(work.builder.input.pool.progress, task.end - task.begin);
                return .{ .begin = task.begin + 1, .end = pair };
            }

            /// Cuts a set in pairs from `first_pair` on. Returns the next.
            fn cut(work: *TaskWork, whole: Set, first_pair: u32) u32 {
                const builder = work.builder;
                // A set waits on each level at most.
                var stack: [world.tree_depth_max]Set = undefined;
                var stack_count: usize = 0;
                var pair = first_pair;
                var set = whole;
                while (true) {
                    if (set.count() <= builder.leaf_size) {
                        if (stack_count == 0) return pair;
                        stack_count -= 1;
                        set = stack[stack_count];
                    } else {
                        const children = builder.cutSet(&set, pair);
                        pair += 1;
                        stack[stack_count] = children[1];
                        stack_count += 1;
                        set = children[0];
                    }
                }
            }
        };

        /// Cuts one set by one thread.
        fn cutSet(builder: *Self, set: *const Set, pair: u32) [2]Set {
            if (!isTooDeep(set)) {
                const small = set.count() <= split.small_count_max;
                const children = switch (builder.input.quality) {
                    .fast => if (small)
                        builder.cutByCost(set, pair, split.bin_count_small, 1)
                    else
                        builder.cutByCost(set, pair, split.bin_count_large, 1),
                    .default, .high => if (small)
                        builder.cutByCost(set, pair, split.bin_count_small, 3)
                    else
                        builder.cutByCost(set, pair, split.bin_count_large, 3),
                };
                if (children) |found| return found;
            }
            const left_count = set.count() / 2;
            var sides: Sides = .empty;
            for (builder.references[set.begin..set.end], 0..) |box, index| {
                sides.add(@intFromBool(index >= left_count), box);
            }
            return builder.makeChildren(set, pair, left_count, sides.boxes, sides.centers);
        }

        /// Cuts at the cheapest plane; null where nothing separates the references.
        fn cutByCost(
            builder: *Self,
            set: *const Set,
            pair: u32,
            comptime bin_count: comptime_int,
            comptime axis_count: comptime_int,
        ) ?[2]Set {
            const references = builder.references[set.begin..set.end];
            const binning: split.Binning(bin_count) = .init(set.centers);
            var bins: split.Bins(bin_count, axis_count) = undefined;
            bins.clear(&binning);
            bins.add(&binning, references);
            const chosen = bins.choose(pack_size) orelse return null;
            const side: Side = .init(&binning, &chosen);
            // Leaves have no use for the centroids of what is in them.
            const largest = @max(chosen.left_count, set.count() - chosen.left_count);
            const centers = if (largest > builder.leaf_size)
                partition(references, &side, chosen.left_count, true)
            else
                partition(references, &side, chosen.left_count, false);
            const boxes = [2]Box{ chosen.left_box, chosen.right_box };
            return builder.makeChildren(set, pair, chosen.left_count, boxes, centers);
        }
    };
}

/// Boxes of what goes left and what goes right, and of the centroids of both.
const Sides = struct {
    boxes: [2]Box,
    centers: [2]Box,

    const empty: Sides = .{ .boxes = @splat(split.box_empty), .centers = @splat(split.box_empty) };

    fn add(sides: *Sides, side: u1, box: Box) void {
        sides.boxes[side] = split.join(box, sides.boxes[side]);
        sides.centers[side] = split.join(split.centerBox(box), sides.centers[side]);
    }

    fn join(sides: *Sides, other: *const Sides) void {
        for (0..2) |side| {
            sides.boxes[side] = split.join(other.boxes[side], sides.boxes[side]);
            sides.centers[side] = split.join(other.centers[side], sides.centers[side]);
        }
    }
};

/// Moves what goes left to the front and bounds the centroids of each side. Lomuto's way, without a
/// branch on the side: that is as good as random, and a wrong guess costs as much as all the rest
/// of a round. A reference that goes right is exchanged too, with another one that does.
fn partition(
    references: []Box,
    side: *const Side,
    left_count: u32,
    comptime with_centers: bool,
) [2]Box {
    assert(left_count <= references.len);
    // What is not on a side is infinitely far from it.
    const absence = [2]Box{ @splat(0), split.box_empty };
    var left: usize = 0;
    var centers: [2]Box = @splat(split.box_empty);
    for (references) |*reference| {
        const box = reference.*;
        const is_left = side.isLeft(reference);
        reference.* = references[left];
        references[left] = box;
        left += @intFromBool(is_left);
        if (!with_centers) continue;
        const center = split.centerBox(box);
        centers[0] = split.join(center + absence[@intFromBool(!is_left)], centers[0]);
        centers[1] = split.join(center + absence[@intFromBool(is_left)], centers[1]);
    }
    assert(left == left_count);
    return centers;
}

/// Makes a reference for each triangle, and the boxes of all references and of their centroids.
const ReferenceWork = struct {
    input: *const Input,
    references: []Box,

    fn fill(work: *const ReferenceWork, chunk: usize, sum: *[2]Box) void {
        const begin = chunk * chunk_size;
        const end = @min(begin + chunk_size, work.references.len);
        var boxes: [2]Box = @splat(split.box_empty);
        for (work.references[begin..end], begin..) |*reference, index| {
            reference.* = work.input.reference(index);
            boxes[0] = split.join(boxes[0], reference.*);
            boxes[1] = split.join(boxes[1], split.centerBox(reference.*));
        }
        join(sum, &boxes);
    }

    fn join(sum: *[2]Box, other: *const [2]Box) void {
        for (sum, other) |*to, box| to.* = split.join(to.*, box);
    }
};

/// A large set on its way to being two.
const Cut = struct {
    set: Set,
    binning: Binning,
    /// Without one the set is halved as it stands.
    split: ?Split = null,
    /// First chunk of the set.
    chunk_begin: u32 = 0,
    /// Where the left half ends.
    left_end: u32 = 0,
};

/// A part of a large set.
const Chunk = struct {
    cut: u32,
    begin: u32,
    end: u32,
    /// References that go left; they stand in front once the chunk is partitioned.
    left_count: u32 = 0,
    /// References that go right but stand in the left half of the set, in the chunks before this.
    wrong_before: u32 = 0,
    sides: Sides = .empty,
};

/// One level of large sets, cut in chunks.
fn LevelWorkOf(comptime Self: type, comptime pack_size: u32) type {
    return struct {
        builder: *Self,
        cuts: []Cut,
        chunks: []Chunk,
        /// By chunk.
        bins: []Bins,

        const LevelWork = @This();

        fn init(gpa: Allocator, builder: *Self, cuts: []Cut) error{OutOfMemory}!LevelWork {
            var chunk_count: usize = 0;
            for (cuts) |*cut| {
                cut.chunk_begin = @intCast(chunk_count);
                chunk_count += (cut.set.count() + chunk_size - 1) / chunk_size;
            }
            const chunks = try gpa.alloc(Chunk, chunk_count);
            errdefer gpa.free(chunks);
            for (cuts, 0..) |*cut, cut_index| {
                var begin = cut.set.begin;
                var chunk = cut.chunk_begin;
                while (begin < cut.set.end) : (chunk += 1) {
                    const end = @min(begin + chunk_size, cut.set.end);
                    chunks[chunk] = .{ .cut = @intCast(cut_index), .begin = begin, .end = end };
                    begin = end;
                }
            }
            return .{
                .builder = builder,
                .cuts = cuts,
                .chunks = chunks,
                .bins = try gpa.alloc(Bins, chunk_count),
            };
        }

        fn deinit(work: *LevelWork, gpa: Allocator) void {
            gpa.free(work.chunks);
            gpa.free(work.bins);
        }

        fn chunksOf(work: *LevelWork, cut_index: u32) []Chunk {
            const end = if (cut_index + 1 < work.cuts.len)
                work.cuts[cut_index + 1].chunk_begin
            else
                work.chunks.len;
            return work.chunks[work.cuts[cut_index].chunk_begin..end];
        }

        fn fillBins(work: *LevelWork, index: usize, _: usize) void {
            const chunk = &work.chunks[index];
            const cut = &work.cuts[chunk.cut];
            work.bins[index].clear(&cut.binning);
            work.bins[index].add(&cut.binning, work.builder.references[chunk.begin..chunk.end]);
        }

        /// Chooses the planes, and with them how many of each chunk's references go left.
        fn choose(work: *LevelWork) void {
            for (work.cuts, 0..) |*cut, cut_index| {
                const chunks = work.chunksOf(@intCast(cut_index));
                const bins = work.bins[cut.chunk_begin..][0..chunks.len];
                cut.left_end = cut.set.begin + cut.set.count() / 2;
                if (Self.isTooDeep(&cut.set)) continue;
                var all = bins[0];
                for (bins[1..]) |*other| all.addBins(other);
                cut.split = all.choose(pack_size);
                const chosen = &(cut.split orelse continue);
                cut.left_end = cut.set.begin + chosen.left_count;
                var wrong_count: u32 = 0;
                for (chunks, bins) |*chunk, *other| {
                    chunk.left_count = other.countLeft(chosen);
                    chunk.wrong_before = wrong_count;
                    wrong_count += wrongRights(chunk, cut.left_end).count();
                }
            }
        }

        /// A stretch of references.
        const Stretch = struct {
            begin: u32,
            end: u32,

            fn count(stretch: Stretch) u32 {
                return stretch.end -| stretch.begin;
            }
        };

        /// What goes right but stands in the left half, after the chunk is partitioned.
        fn wrongRights(chunk: *const Chunk, left_end: u32) Stretch {
            return .{
                .begin = chunk.begin + chunk.left_count,
                .end = @min(chunk.end, left_end),
            };
        }

        /// What goes left but stands in the right half, after the chunk is partitioned.
        fn wrongLefts(chunk: *const Chunk, left_end: u32) Stretch {
            return .{
                .begin = @max(chunk.begin, left_end),
                .end = chunk.begin + chunk.left_count,
            };
        }

        /// Partitions a chunk by itself.
        fn partitionChunk(work: *LevelWork, index: usize, _: usize) void {
            const chunk = &work.chunks[index];
            const cut = &work.cuts[chunk.cut];
            const references = work.builder.references[chunk.begin..chunk.end];
            if (cut.split) |*chosen| {
                const side: Side = .init(&cut.binning, chosen);
                chunk.sides.centers = partition(references, &side, chunk.left_count, true);
            } else {
                for (references, chunk.begin..) |box, at| {
                    chunk.sides.add(@intFromBool(at >= cut.left_end), box);
                }
            }
        }

        /// Exchanges what stands in the wrong half: the k-th that goes right with the k-th that
        /// goes left, each thread for those of a chunk in the left half.
        fn exchange(work: *LevelWork, index: usize, _: usize) void {
            const references = work.builder.references;
            const chunk = &work.chunks[index];
            const cut = &work.cuts[chunk.cut];
            if (cut.split == null) return;
            const rights = wrongRights(chunk, cut.left_end);
            var skip_count = chunk.wrong_before;
            var right = rights.begin;
            for (work.chunksOf(chunk.cut)) |*other| {
                if (right >= rights.end) break;
                const lefts = wrongLefts(other, cut.left_end);
                if (skip_count >= lefts.count()) {
                    skip_count -= lefts.count();
                    continue;
                }
                var left = lefts.begin + skip_count;
                skip_count = 0;
                while (left < lefts.end and right < rights.end) {
                    std.mem.swap(Box, &references[left], &references[right]);
                    left += 1;
                    right += 1;
                }
            }
            assert(right >= rights.end);
        }

        /// The children of a set whose references have been moved.
        fn finish(work: *LevelWork, cut: *const Cut, cut_index: u32, pair: u32) [2]Set {
            var sides: Sides = .empty;
            for (work.chunksOf(cut_index)) |*chunk| sides.join(&chunk.sides);
            if (cut.split) |*chosen| sides.boxes = .{ chosen.left_box, chosen.right_box };
            const left_count = cut.left_end - cut.set.begin;
            const builder = work.builder;
            return builder.makeChildren(&cut.set, pair, left_count, sides.boxes, sides.centers);
        }
    };
}
