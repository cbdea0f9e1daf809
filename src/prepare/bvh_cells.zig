//! Many triangles -> a few thousand cells of a grid, in three passes over the references.
//!
//! In: references and the bounds of their middles. Out: the cells that hold some, each with its
//! box, then the references in whatever order of the cells the caller comes to, cell by cell. A
//! tree over the cells takes the place of the first levels of binned cuts, each of which reads and
//! writes all of memory. Which cell a reference falls in, and its place among those of the same
//! cell, are functions of the references alone: chunks are cut by their number, not by threads.
//! After the grids of T. Ize, I. Wald, S. Parker, "Asynchronous BVH Construction for Ray Tracing
//! Dynamic Scenes on Parallel Multi-Core Architectures" (2007), with counts in the place of locks.

const std = @import("std");
const parallel = @import("../parallel.zig");
const huge_pages = @import("huge_pages.zig");
const split = @import("bvh_split.zig");
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;
const Box = split.Box;
const Vec4 = @Vector(4, f32);

/// Fewer references are not worth a grid.
pub const reference_count_min = 16_384;

/// References to a cell of the whole grid, of which a scene of surfaces fills few.
const references_per_cell = 32;
const cell_bits_max = 14;

/// Parts of the references that are counted apart.
const chunk_count_max = 64;
const chunk_size_min = 8192;

/// A cell that holds references.
pub const Item = struct {
    /// Join of the references' boxes.
    box: Box,
    /// Join of their `centerBox`es.
    centers: Box,
    count: u32,
    cell: u32,
};

/// From a middle to a cell.
const Grid = struct {
    offset: Vec4,
    scale: Vec4,
    /// By axis, how far its index is moved in a cell's number.
    shifts: @Vector(4, u5),

    /// 2^`bits` cells that are as near to cubes as halving the longest edge makes them.
    fn init(centers: Box, bits: u5) Grid {
        const whole: [4]f32 = split.extent(centers);
        var edges = whole;
        var axis_bits: [4]u5 = @splat(0);
        for (0..bits) |_| {
            var longest: usize = 0;
            for (1..3) |axis| if (edges[axis] > edges[longest]) {
                longest = axis;
            };
            edges[longest] *= 0.5;
            axis_bits[longest] += 1;
        }
        var scale: [4]f32 = @splat(0);
        for (scale[0..3], whole[0..3], axis_bits[0..3]) |*to, edge, axis_bit| {
            const cells: f32 = @floatFromInt(@as(u32, 1) << axis_bit);
            // Just below, so that the last middle lands in the last cell after rounding.
            if (edge > split.extent_min) to.* = cells * (1 - 0x1p-20) / edge;
        }
        return .{
            .offset = split.lowerHalf(centers),
            .scale = scale,
            .shifts = .{ 0, axis_bits[0], axis_bits[0] + axis_bits[1], 0 },
        };
    }

    inline fn cellOf(grid: *const Grid, box: Box) u32 {
        const at: @Vector(4, i32) = @intFromFloat(
            (split.centerTwice(box) - grid.offset) * grid.scale,
        );
        const moved = at << grid.shifts;
        return @intCast(moved[0] + moved[1] + moved[2]);
    }
};

/// References counted by cell.
pub const Cells = struct {
    grid: Grid,
    references: []const Box,
    cell_count: u32,
    chunk_count: u32,
    /// By chunk and cell: how many there are, then where the next goes.
    counts: []u32,
    /// The cells that hold some, in the order of their numbers until the caller moves them.
    items: []Item,

    /// Counts `references`, `centers` being the join of their `centerBox`es.
    pub fn init(
        gpa: Allocator,
        references: []const Box,
        centers: Box,
        thread_count: usize,
    ) error{OutOfMemory}!Cells {
        assert(references.len >= reference_count_min);
        const wanted = std.math.log2_int(usize, references.len / references_per_cell);
        const bits: u5 = @intCast(@min(wanted, cell_bits_max));
        const cell_count = @as(u32, 1) << bits;
        const chunk_count: u32 = @intCast(@min(references.len / chunk_size_min, chunk_count_max));
        const counts = try gpa.alloc(u32, chunk_count * cell_count);
        errdefer gpa.free(counts);
        const used_count = @min(thread_count, chunk_count);
        const boxes = try gpa.alloc([2]Box, used_count * cell_count);
        defer gpa.free(boxes);
        var cells: Cells = .{
            .grid = .init(centers, bits),
            .references = references,
            .cell_count = cell_count,
            .chunk_count = chunk_count,
            .counts = counts,
            .items = &.{},
        };
        var work: CountWork = .{ .cells = &cells, .boxes = boxes };
        parallel.share(used_count, &work, CountWork.run);
        try work.collect(gpa);
        return cells;
    }

    /// Frees the arrays.
    pub fn deinit(cells: *Cells, gpa: Allocator) void {
        gpa.free(cells.counts);
        gpa.free(cells.items);
        cells.* = undefined;
    }

    fn chunk(cells: *const Cells, index: usize) []const Box {
        const count = cells.references.len;
        const begin = index * count / cells.chunk_count;
        return cells.references[begin .. (index + 1) * count / cells.chunk_count];
    }

    /// Writes the references to `target`, cell by cell in the order of `items`. Asserts that it is
    /// as long. Spends the counts: once only.
    pub fn scatter(cells: *Cells, target: []Box, thread_count: usize) void {
        assert(target.len == cells.references.len);
        var next: u32 = 0;
        for (cells.items) |*item| {
            for (0..cells.chunk_count) |chunk_index| {
                const place = &cells.counts[chunk_index * cells.cell_count + item.cell];
                const count = place.*;
                place.* = next;
                next += count;
            }
        }
        assert(next == target.len);
        var work: ScatterWork = .{ .cells = cells, .target = target };
        parallel.share(@min(thread_count, cells.chunk_count), &work, ScatterWork.run);
    }
};

const CountWork = struct {
    cells: *Cells,
    /// By thread and cell: box and middles.
    boxes: [][2]Box,
    next: std.atomic.Value(u32) = .init(0),
    /// Threads that have made their boxes.
    used: [chunk_count_max]bool = @splat(false),

    fn run(work: *CountWork, thread_index: usize) void {
        const cells = work.cells;
        const boxes = work.boxes[thread_index * cells.cell_count ..][0..cells.cell_count];
        while (true) {
            const index = work.next.fetchAdd(1, .monotonic);
            if (index >= cells.chunk_count) return;
            if (!work.used[thread_index]) {
                work.used[thread_index] = true;
                for (boxes) |*pair| pair.* = @splat(split.box_empty);
            }
            const counts = cells.counts[index * cells.cell_count ..][0..cells.cell_count];
            @memset(counts, 0);
            for (cells.chunk(index)) |box| {
                const cell = cells.grid.cellOf(box);
                counts[cell] += 1;
                const pair = &boxes[cell];
                pair[0] = split.join(box, split.loadBin(&pair[0]));
                pair[1] = split.join(split.centerBox(box), split.loadBin(&pair[1]));
            }
        }
    }

    /// Makes the items. What threads have found is joined, in any order the same.
    fn collect(work: *CountWork, gpa: Allocator) error{OutOfMemory}!void {
        const cells = work.cells;
        const totals = try gpa.alloc(u32, cells.cell_count);
        defer gpa.free(totals);
        @memset(totals, 0);
        for (0..cells.chunk_count) |chunk_index| {
            const counts = cells.counts[chunk_index * cells.cell_count ..][0..cells.cell_count];
            for (totals, counts) |*total, count| total.* += count;
        }
        var item_count: usize = 0;
        for (totals) |total| item_count += @intFromBool(total > 0);
        cells.items = try gpa.alloc(Item, item_count);
        var index: usize = 0;
        for (totals, 0..) |total, cell| {
            if (total == 0) continue;
            var pair: [2]Box = @splat(split.box_empty);
            const thread_count = work.boxes.len / cells.cell_count;
            for (work.used[0..thread_count], 0..) |is_used, thread_index| {
                if (!is_used) continue;
                const other = &work.boxes[thread_index * cells.cell_count + cell];
                for (&pair, other) |*to, box| to.* = split.join(to.*, box);
            }
            cells.items[index] = .{
                .box = pair[0],
                .centers = pair[1],
                .count = total,
                .cell = @intCast(cell),
            };
            index += 1;
        }
    }
};

const ScatterWork = struct {
    cells: *Cells,
    target: []Box,
    next: std.atomic.Value(u32) = .init(0),

    fn run(work: *ScatterWork, thread_index: usize) void {
        assert(thread_index < parallel.thread_count_max);
        const cells = work.cells;
        while (true) {
            const index = work.next.fetchAdd(1, .monotonic);
            if (index >= cells.chunk_count) return;
            const places = cells.counts[index * cells.cell_count ..][0..cells.cell_count];
            for (cells.chunk(index)) |box| {
                const place = &places[cells.grid.cellOf(box)];
                work.target[place.*] = box;
                place.* += 1;
            }
        }
    }
};

test "every reference ends up in its cell's place, in the order it had" {
    const gpa = std.testing.allocator;
    const references = try gpa.alloc(Box, reference_count_min + 7);
    defer gpa.free(references);
    var random_state: std.Random.DefaultPrng = .init(2);
    const random = random_state.random();
    var centers = split.box_empty;
    for (references, 0..) |*box, index| {
        const at: [3]f32 = .{ random.float(f32), 9 * random.float(f32), 3 };
        box.* = split.reference(.{ .lower = at, .upper = at }, @intCast(index));
        centers = split.join(centers, split.centerBox(box.*));
    }
    const target = try gpa.alloc(Box, references.len);
    defer gpa.free(target);
    var cells: Cells = try .init(gpa, references, centers, 3);
    defer cells.deinit(gpa);
    // The longer axis has the more cells, the one without extent none.
    try std.testing.expectEqual(6, cells.grid.shifts[1] - cells.grid.shifts[0] + 3);
    std.mem.reverse(Item, cells.items);
    cells.scatter(target, 3);
    var begin: usize = 0;
    for (cells.items) |item| {
        var last: ?u32 = null;
        var box = split.box_empty;
        for (target[begin..][0..item.count]) |reference| {
            try std.testing.expectEqual(item.cell, cells.grid.cellOf(reference));
            const number = split.triangleNumber(reference);
            if (last) |before| try std.testing.expect(number > before);
            last = number;
            box = split.join(box, reference);
        }
        try std.testing.expectEqual(split.toBox3(item.box), split.toBox3(box));
        begin += item.count;
    }
    try std.testing.expectEqual(references.len, begin);
}
