//! A grid of cells over many triangles (Ize, Wald and Parker 2007), for the first cuts of a BVH.
//!
//! In: triangles and the bounds of their centroids. Out: the cells that hold some, each with its
//! box, then references in whatever order of the cells the caller comes to. A tree over
//! the cells takes the place of the first levels of binned cuts, each of which reads and writes all
//! of memory; here the triangles are read twice and the references written once. Which cell a
//! triangle falls in, and its place among those of the same cell, are functions of the triangles
//! alone: chunks are cut by their number, not by threads.
//!
//! After the grids of T. Ize, I. Wald, S. Parker, "Asynchronous BVH Construction for Ray Tracing
//! Dynamic Scenes on Parallel Multi-Core Architectures" (2007), with counts in the place of locks.

const std = @import("std");
const math = @import("../../math.zig");
const parallel = @import("../../parallel.zig");
const world = @import("../../world.zig");
const bvh_input = @import("input.zig");
const split = @import("split.zig");
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;
const Box = split.Box;
const Box3 = math.Box3;
const Input = bvh_input.Input;
const Vec4 = @Vector(4, f32);

/// Fewer triangles are not worth a grid.
pub const reference_count_min = 16_384;

/// References to a cell of the whole grid, of which a scene of surfaces fills few.
const references_per_cell = 32;
const cell_bits_max = 16;

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

/// From a centroid to a cell.
const Grid = struct {
    offset: Vec4,
    scale: Vec4,
    /// By axis, the last index.
    last: Indices,
    /// By axis, how far its index is moved in a cell's number.
    shifts: @Vector(4, u5),

    const Indices = @Vector(4, i32);

    /// 2^`bits` cells that are as near to cubes as halving the longest edge makes them.
    fn init(centroid_bounds: Box3, bits: u5) Grid {
        const lower = centroid_bounds.lower;
        var edges: [3]f32 = undefined;
        for (&edges, lower, centroid_bounds.upper) |*edge, from, to| edge.* = to - from;
        const whole = edges;
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
        var last: [4]i32 = @splat(0);
        for (scale[0..3], last[0..3], whole, axis_bits[0..3]) |*to, *end, edge, axis_bit| {
            const cells = @as(i32, 1) << axis_bit;
            end.* = cells - 1;
            if (edge > split.extent_min) to.* = @as(f32, @floatFromInt(cells)) / edge;
        }
        return .{
            .offset = .{ lower[0], lower[1], lower[2], 0 },
            .scale = scale,
            .last = last,
            .shifts = .{ 0, axis_bits[0], axis_bits[0] + axis_bits[1], 0 },
        };
    }

    inline fn cellOf(grid: *const Grid, box: Box) u32 {
        const at = (split.centerTwice(box) - grid.offset) * grid.scale;
        // Boxes are grown, and rounded by that: their centroids may lie beyond the bounds of all,
        // how far, an integer may not hold.
        const last: Vec4 = @floatFromInt(grid.last);
        const within: Indices = @intFromFloat(@min(@max(at, @as(Vec4, @splat(0))), last));
        const moved = within << grid.shifts;
        return @intCast(moved[0] + moved[1] + moved[2]);
    }
};

/// Triangles counted by cell.
pub const Cells = struct {
    input: *const Input,
    grid: Grid,
    cell_count: u32,
    chunk_count: u32,
    /// By chunk and cell: how many there are, then where the next goes.
    counts: []u32,
    /// The cells that hold some, in the order of their numbers until the caller moves them.
    items: []Item,

    /// Counts the triangles of `input`, at least `reference_count_min`.
    pub fn init(gpa: Allocator, input: *const Input) bvh_input.Error!Cells {
        const count = input.count();
        assert(count >= reference_count_min);
        const wanted = std.math.log2_int(usize, count / references_per_cell);
        const bits: u5 = @intCast(@min(wanted, cell_bits_max));
        const cell_count = @as(u32, 1) << bits;
        const chunk_count: u32 = @intCast(@min(count / chunk_size_min, chunk_count_max));
        const counts = try gpa.alloc(u32, chunk_count * cell_count);
        errdefer gpa.free(counts);
        const used_count = input.pool.threadsFor(chunk_count);
        const boxes = try gpa.alloc([2]Box, used_count * cell_count);
        defer gpa.free(boxes);
        var cells: Cells = .{
            .input = input,
            .grid = .init(input.centroid_bounds, bits),
            .cell_count = cell_count,
            .chunk_count = chunk_count,
            .counts = counts,
            .items = &.{},
        };
        var work: CountWork = .{ .cells = &cells, .boxes = boxes };
        try input.pool.forEach(chunk_count, &work, CountWork.run);
        try work.collect(gpa);
        return cells;
    }

    /// Frees the arrays.
    pub fn deinit(cells: *Cells, gpa: Allocator) void {
        gpa.free(cells.counts);
        gpa.free(cells.items);
        cells.* = undefined;
    }

    /// Where a chunk begins, and the one before it ends.
    fn chunkBegin(cells: *const Cells, index: usize) usize {
        return @intCast(@as(u64, index) * cells.input.count() / cells.chunk_count);
    }

    /// Writes the references to `target`, cell by cell in the order of `items`. Asserts that there
    /// is one place for each. Spends the counts: once only.
    pub fn scatter(cells: *Cells, gpa: Allocator, target: []Box) bvh_input.Error!void {
        assert(target.len == cells.input.count());
        const places = try gpa.alloc(u32, cells.cell_count);
        defer gpa.free(places);
        @memset(places, 0);
        var next: u32 = 0;
        for (cells.items) |*item| {
            places[item.cell] = next;
            next += item.count;
        }
        assert(next == target.len);
        for (0..cells.chunk_count) |chunk| {
            const counts = cells.counts[chunk * cells.cell_count ..][0..cells.cell_count];
            for (counts, places) |*count, *place| {
                const begin = place.*;
                place.* += count.*;
                count.* = begin;
            }
        }
        var work: ScatterWork = .{ .cells = cells, .target = target };
        try cells.input.pool.forEach(cells.chunk_count, &work, ScatterWork.run);
    }
};

const CountWork = struct {
    cells: *Cells,
    /// By thread and cell: box and centroids.
    boxes: [][2]Box,
    /// Threads that have made their boxes.
    used: [chunk_count_max]bool = @splat(false),

    fn run(work: *CountWork, index: usize, thread_index: usize) void {
        const cells = work.cells;
        const boxes = work.boxes[thread_index * cells.cell_count ..][0..cells.cell_count];
        if (!work.used[thread_index]) {
            work.used[thread_index] = true;
            for (boxes) |*pair| pair.* = @splat(split.box_empty);
        }
        const counts = cells.counts[index * cells.cell_count ..][0..cells.cell_count];
        @memset(counts, 0);
        for (cells.chunkBegin(index)..cells.chunkBegin(index + 1)) |turn| {
            const box = cells.input.reference(turn);
            const cell = cells.grid.cellOf(box);
            counts[cell] += 1;
            const pair = &boxes[cell];
            pair[0] = split.join(box, split.loadBin(&pair[0]));
            pair[1] = split.join(split.centerBox(box), split.loadBin(&pair[1]));
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

    fn run(work: *ScatterWork, index: usize, _: usize) void {
        const cells = work.cells;
        const places = cells.counts[index * cells.cell_count ..][0..cells.cell_count];
        for (cells.chunkBegin(index)..cells.chunkBegin(index + 1)) |turn| {
            const box = cells.input.reference(turn);
            const place = &places[cells.grid.cellOf(box)];
            work.target[place.*] = box;
            place.* += 1;
        }
    }
};

test "every reference ends up in its cell's place, in the order it had" {
    const gpa = std.testing.allocator;
    const positions = try gpa.alloc(math.Vec3, reference_count_min + 7);
    defer gpa.free(positions);
    const triangles = try gpa.alloc(world.Triangle, positions.len);
    defer gpa.free(triangles);
    var random_state: std.Random.DefaultPrng = .init(2);
    const random = random_state.random();
    var centroid_bounds: Box3 = .empty;
    for (positions, triangles, 0..) |*position, *triangle, index| {
        position.* = .{ random.float(f32), 9 * random.float(f32), 3 };
        triangle.* = .{ .corner = @splat(@intCast(index)), .material = 0 };
        centroid_bounds = centroid_bounds.include(math.vec3.scale(position.*, 2));
    }
    var pool: parallel.Pool = .init(3);
    defer pool.deinit();
    const input: Input = .{
        .positions = positions,
        .triangles = triangles,
        .centroid_bounds = centroid_bounds,
        .padding = .init(@splat(0), .empty),
        .pool = &pool,
    };
    const target = try gpa.alloc(Box, positions.len);
    defer gpa.free(target);
    var cells: Cells = try .init(gpa, &input);
    defer cells.deinit(gpa);
    // 512 cells: the longer axis has eight times the cells, the one without extent none.
    try std.testing.expectEqual(@Vector(4, i32){ 7, 63, 0, 0 }, cells.grid.last);
    std.mem.reverse(Item, cells.items);
    try cells.scatter(gpa, target);
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
    try std.testing.expectEqual(positions.len, begin);
}
