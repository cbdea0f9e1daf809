//! The binned surface area heuristic (Wald 2007): where to cut a set of triangles in two.
//!
//! In: references to triangles. Out: the plane between two bins that makes the expected cost of
//! both sides least, or null where no plane separates anything. Boxes and counts of bins do not
//! depend on the order of what is put in, so that threads may fill bins apart and join them.
//! I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies" (2007).

const std = @import("std");
const builtin = @import("builtin");
const math = @import("../../math.zig");
const simd = @import("../../simd.zig");
const assert = std.debug.assert;
const Box3 = math.Box3;

/// A box: x, y, z of the lower corner, a free lane, the negated upper corner, a free lane. Joining
/// two is one `min` of eight lanes. In references the first free lane holds the
/// triangle's number (`reference`).
pub const Box = @Vector(8, f32);

const Vec4 = @Vector(4, f32);

/// Bins along each axis.
pub const bin_count_large = 16;

/// The box without points.
pub const box_empty: Box = @splat(std.math.inf(f32));

const Lanes8 = simd.Lanes(.vector, 8).F32;

/// Added to a triangle's number to make it the bits of a normal float. By itself it would be a
/// denormal one, and those become 0 wherever the compiler lets the free lane take part in the
/// arithmetic of its neighbours: it may, as x - 0 is x, knowing nothing of flush-to-zero.
const number_bias: u32 = 0x4000_0000;

/// Triangles that references can tell apart: beyond, bits would be those of an infinity.
pub const number_limit = 0x7f80_0000 - number_bias;

/// The smallest box that holds both; free lanes mean nothing.
pub inline fn join(a: Box, b: Box) Box {
    return Lanes8.minFast(.{ .v = a }, .{ .v = b }).v;
}

/// A reference to triangle `number` within `box`. Asserts that the number is below `number_limit`.
pub inline fn reference(box: Box3, number: u32) Box {
    assert(number < number_limit);
    return .{
        box.lower[0],  box.lower[1],  box.lower[2],  @bitCast(number + number_bias),
        -box.upper[0], -box.upper[1], -box.upper[2], 0,
    };
}

/// The triangle that a reference stands for.
pub inline fn triangleNumber(box: Box) u32 {
    const bits: u32 = @bitCast(box[3]);
    return bits - number_bias;
}

/// The box with named corners.
pub inline fn toBox3(box: Box) Box3 {
    return .{
        .lower = .{ box[0], box[1], box[2] },
        .upper = .{ -box[4], -box[5], -box[6] },
    };
}

/// The lower corner.
pub inline fn lowerHalf(box: Box) Vec4 {
    return @shuffle(f32, box, undefined, @Vector(4, i32){ 0, 1, 2, 3 });
}

inline fn upperHalf(box: Box) Vec4 {
    return @shuffle(f32, box, undefined, @Vector(4, i32){ 4, 5, 6, 7 });
}

/// Twice the centroid.
pub inline fn centerTwice(box: Box) Vec4 {
    return lowerHalf(box) - upperHalf(box);
}

/// The box that holds just twice the centroid: joined up it bounds where bins are needed.
pub inline fn centerBox(box: Box) Box {
    const center = centerTwice(box);
    return std.simd.join(center, -center);
}

/// The box of no size in the middle of a join of `centerBox`es, to be put in bins.
pub inline fn middleOf(centers: Box) Box {
    const half: Vec4 = @splat(0.25);
    const center = lowerHalf(centers) * half - upperHalf(centers) * half;
    return std.simd.join(center, -center);
}

/// Edge lengths, negated; the last lane means nothing.
inline fn extentNegated(box: Box) Vec4 {
    return lowerHalf(box) + upperHalf(box);
}

/// Edge lengths; the last lane means nothing.
pub inline fn extent(box: Box) Vec4 {
    return -extentNegated(box);
}

/// Edges of bounds of centroids up to this long have no room for bins.
pub const extent_min = 0x1p-100;

/// Half the surface area, infinite or NaN for the empty box.
pub inline fn halfArea(box: Box) f32 {
    const edges = extentNegated(box); // Both factors of each product, so the sign does not show.
    const turned = @shuffle(f32, edges, undefined, @Vector(4, i32){ 1, 2, 0, 3 });
    const product = edges * turned;
    return product[0] + (product[1] + product[2]);
}

/// The axis along which a box of these edges is longest.
pub inline fn longestAxis(edges: [4]f32) u8 {
    const longer: u8 = if (edges[1] > edges[0]) 1 else 0;
    return if (edges[2] > edges[longer]) 2 else longer;
}

/// From a centroid to one of `bin_count` bins: (center - offset) * scale, rounded down.
pub fn Binning(comptime bin_count: comptime_int) type {
    return struct {
        offset: Vec4,
        /// 0 on axes where all centroids are the same, or too near to tell apart.
        scale: Vec4,
        /// The longest axis.
        axis: u8,

        const Self = @This();

        /// Bins that span `centers`, the join of `centerBox`es.
        pub fn init(centers: Box) Self {
            const edges = extent(centers);
            // Just below the count, so that the last centroid lands in the last bin after rounding.
            const width: Vec4 = @splat(bin_count * (1 - 0x1p-20));
            const least: Vec4 = @splat(extent_min);
            const zero: Vec4 = @splat(0);
            return .{
                .offset = lowerHalf(centers),
                .scale = @select(f32, edges > least, width / edges, zero),
                .axis = longestAxis(edges),
            };
        }

        inline fn binsOf(binning: *const Self, box: Box) @Vector(4, i32) {
            return @intFromFloat((centerTwice(box) - binning.offset) * binning.scale);
        }
    };
}

/// A plane to cut at.
pub const Split = struct {
    axis: u8,
    /// Bins below this one go left.
    bin: u8,
    left_count: u32,
    left_box: Box,
    right_box: Box,
};

/// Which side of a split a reference lies on; the same arithmetic as the bins', one axis alone.
pub const Side = struct {
    axis: usize,
    offset: f32,
    scale: f32,
    limit: f32,

    /// The sides of a split that was chosen from bins of `binning`.
    pub fn init(binning: anytype, split: *const Split) Side {
        assert(split.axis < 3 and split.bin >= 1);
        const offset: [4]f32 = binning.offset;
        const scale: [4]f32 = binning.scale;
        return .{
            .axis = split.axis,
            .offset = offset[split.axis],
            .scale = scale[split.axis],
            .limit = @floatFromInt(split.bin),
        };
    }

    pub inline fn isLeft(side: *const Side, box: *const Box) bool {
        const lanes: *const [8]f32 = @ptrCast(box);
        const center = lanes[side.axis] - lanes[side.axis + 4];
        return (center - side.offset) * side.scale < side.limit;
    }
};

/// Bins for sets that may be small: fewer would do, and choosing costs as much as binning there.
pub const bin_count_small = 8;

/// Sets of up to this many references get `bin_count_small` bins along each axis.
pub const small_count_max = 32;

/// Boxes and counts of what lies in the bins of all three axes, or of the longest alone.
pub fn Bins(comptime bin_count: comptime_int, comptime axis_count: comptime_int) type {
    assert(axis_count == 1 or axis_count == 3);
    return struct {
        boxes: [axis_count][bin_count]Box,
        counts: [axis_count][bin_count]i32,
        /// Of the only row where there is one.
        axis: u8,

        const Self = @This();
        /// A value for each plane between two bins: lane i for that below bin i, lane 0 unused.
        const Planes = @Vector(bin_count, f32);
        const Counts = @Vector(bin_count, i32);

        /// Makes all bins empty. By a loop: a constant of this size would be copied, at twice the
        /// instructions.
        pub fn clear(bins: *Self, binning: *const Binning(bin_count)) void {
            bins.axis = binning.axis;
            for (&bins.boxes) |*boxes| {
                for (boxes) |*box| box.* = box_empty;
            }
            bins.counts = @splat(@splat(0));
        }

        /// Puts references into their bins.
        pub fn add(bins: *Self, binning: *const Binning(bin_count), references: []const Box) void {
            for (references) |box| {
                // Indices into tables: lanes of an array, not of a vector.
                const indices: [4]i32 = binning.binsOf(box);
                inline for (&bins.boxes, &bins.counts, 0..) |*boxes, *counts, row| {
                    const index: usize = @intCast(indices[bins.axisOf(row)]);
                    assert(index < bin_count);
                    boxes[index] = join(box, loadBin(&boxes[index]));
                    counts[index] += 1;
                }
            }
        }

        /// Puts a cell of references into the bins of its centroid.
        pub fn addItem(bins: *Self, binning: *const Binning(bin_count), item: anytype) void {
            const indices: [4]i32 = binning.binsOf(middleOf(item.centers));
            inline for (&bins.boxes, &bins.counts, 0..) |*boxes, *counts, row| {
                const index: usize = @intCast(indices[bins.axisOf(row)]);
                assert(index < bin_count);
                boxes[index] = join(item.box, boxes[index]);
                counts[index] += @intCast(item.count);
            }
        }

        inline fn axisOf(bins: *const Self, row: usize) usize {
            return if (axis_count == 1) bins.axis else row;
        }

        inline fn rowOf(axis: usize) usize {
            return if (axis_count == 1) 0 else axis;
        }

        /// Adds the bins of another part of the same set.
        pub fn addBins(bins: *Self, other: *const Self) void {
            for (&bins.boxes, &bins.counts, &other.boxes, &other.counts) |*boxes, *counts, *b, *c| {
                for (boxes, b) |*box, other_box| box.* = join(box.*, other_box);
                for (counts, c) |*count, other_count| count.* += other_count;
            }
        }

        /// References left of a plane.
        pub fn countLeft(bins: *const Self, split: *const Split) u32 {
            var count: i32 = 0;
            for (bins.counts[rowOf(split.axis)][0..split.bin]) |bin| count += bin;
            return @intCast(count);
        }

        /// The cheapest plane: the sum over both sides of half area times packs of `pack_size`
        /// triangles. Null where all references share a bin on every axis.
        pub fn choose(bins: *const Self, comptime pack_size: u32) ?Split {
            var costs: [axis_count]Planes = undefined;
            inline for (&costs, &bins.boxes, &bins.counts) |*to, *boxes, *counts| {
                to.* = planeCosts(boxes, counts, pack_size);
            }
            var lowest = costs[0];
            for (costs[1..]) |row_costs| lowest = lesser(lowest, row_costs);
            const least = leastLane(bin_count, lowest);
            if (least == std.math.inf(f32)) return null;
            for (costs, 0..) |row_costs, row| {
                const lanes: [bin_count]f32 = row_costs;
                const plane = std.mem.findScalar(f32, &lanes, least) orelse continue;
                return bins.cutAt(bins.axisOf(row), plane);
            }
            unreachable; // One of them is the least.
        }

        /// Cost of cutting at each plane, infinite where it leaves a side empty.
        inline fn planeCosts(
            boxes: *const [bin_count]Box,
            counts: *const [bin_count]i32,
            comptime pack_size: u32,
        ) Planes {
            var left_extents: [bin_count]Vec4 = undefined;
            var right_extents: [bin_count]Vec4 = undefined;
            var left_counts: [bin_count]i32 = undefined;
            left_extents[0] = @splat(0);
            right_extents[0] = @splat(0);
            left_counts[0] = 0;
            var left = box_empty;
            var right = box_empty;
            inline for (1..bin_count) |plane| {
                left = join(left, boxes[plane - 1]);
                left_extents[plane] = extentNegated(left);
                left_counts[plane] = left_counts[plane - 1] + counts[plane - 1];
                right = join(right, boxes[bin_count - plane]);
                right_extents[bin_count - plane] = extentNegated(right);
            }
            const total = left_counts[bin_count - 1] + counts[bin_count - 1];
            const all: Counts = @splat(total);
            const none: Counts = @splat(0);
            const left_count: Counts = left_counts;
            const right_count = all - left_count;
            const left_cost = halfAreas(&left_extents) * packsOf(left_count, pack_size);
            const right_cost = halfAreas(&right_extents) * packsOf(right_count, pack_size);
            const infinite: Planes = @splat(std.math.inf(f32));
            // Sides without references have a box without meaning.
            const is_left_empty = left_count == none;
            const cost = @select(f32, is_left_empty, infinite, left_cost + right_cost);
            return @select(f32, right_count == none, infinite, cost);
        }

        inline fn packsOf(count: Counts, comptime pack_size: u32) Planes {
            const shift: @Vector(bin_count, u5) = @splat(std.math.log2_int(u32, pack_size));
            const rounding: Counts = @splat(pack_size - 1);
            return @floatFromInt((count + rounding) >> shift);
        }

        /// Half the surface area of a box of each extent, all three edges negated or none.
        inline fn halfAreas(extents: *const [bin_count]Vec4) Planes {
            var areas: [bin_count]f32 = undefined;
            inline for (0..bin_count / 4) |group| {
                const rows = extents[4 * group ..][0..4];
                const x, const y, const z = columns(rows[0], rows[1], rows[2], rows[3]);
                areas[4 * group ..][0..4].* = x * y + (y * z + z * x);
            }
            return areas;
        }

        fn cutAt(bins: *const Self, axis: usize, plane: usize) Split {
            assert(plane >= 1 and plane < bin_count);
            var result: Split = .{
                .axis = @intCast(axis),
                .bin = @intCast(plane),
                .left_count = 0,
                .left_box = box_empty,
                .right_box = box_empty,
            };
            result.left_count = bins.countLeft(&result);
            const boxes = &bins.boxes[rowOf(axis)];
            for (boxes[0..plane]) |box| result.left_box = join(result.left_box, box);
            for (boxes[plane..]) |box| result.right_box = join(result.right_box, box);
            return result;
        }
    };
}

/// Volatile on x86, or LLVM turns the minimum and its store into a masked store (AVX), which the
/// next load of the same bin has to wait for: 1.6 times as long for a whole tree.
pub inline fn loadBin(box: *const Box) Box {
    if (comptime !builtin.cpu.arch.isX86()) return box.*;
    const held: *const volatile Box = box;
    return held.*;
}

/// The first three columns of a matrix given by rows.
inline fn columns(a: Vec4, b: Vec4, c: Vec4, d: Vec4) [3]Vec4 {
    const low: @Vector(4, i32) = .{ 0, ~@as(i32, 0), 1, ~@as(i32, 1) };
    const high: @Vector(4, i32) = .{ 2, ~@as(i32, 2), 3, ~@as(i32, 3) };
    const ab = @shuffle(f32, a, b, low); // a0 b0 a1 b1
    const cd = @shuffle(f32, c, d, low);
    const ab_high = @shuffle(f32, a, b, high); // a2 b2 a3 b3
    const cd_high = @shuffle(f32, c, d, high);
    const first: @Vector(4, i32) = .{ 0, 1, ~@as(i32, 0), ~@as(i32, 1) };
    const second: @Vector(4, i32) = .{ 2, 3, ~@as(i32, 2), ~@as(i32, 3) };
    return .{
        @shuffle(f32, ab, cd, first),
        @shuffle(f32, ab, cd, second),
        @shuffle(f32, ab_high, cd_high, first),
    };
}

inline fn lesser(a: anytype, b: @TypeOf(a)) @TypeOf(a) {
    return @select(f32, a < b, a, b);
}

/// The least of the lanes. By halves: `@reduce(.Min)` calls a function for each lane on ARMv7.
inline fn leastLane(comptime count: comptime_int, lanes: @Vector(count, f32)) f32 {
    if (count == 1) return lanes[0];
    const half = count / 2;
    const all: [count]f32 = lanes;
    const low: @Vector(half, f32) = all[0..half].*;
    const high: @Vector(half, f32) = all[half..].*;
    return leastLane(half, lesser(low, high));
}

fn testReference(lower: math.Vec3, upper: math.Vec3, number: u32) Box {
    return reference(.{ .lower = lower, .upper = upper }, number);
}

test "two heaps are cut apart" {
    var references: [20]Box = undefined;
    for (&references, 0..) |*box, index| {
        const far: f32 = if (index < 13) 0 else 100;
        const at: f32 = far + @as(f32, @floatFromInt(index)) * 0.1;
        box.* = testReference(.{ 5, at, 7 }, .{ 6, at + 1, 8 }, @intCast(index));
    }
    var centers = box_empty;
    for (references) |box| centers = join(centers, centerBox(box));
    const binning: Binning(16) = .init(centers);
    var bins: Bins(16, 3) = undefined;
    bins.clear(&binning);
    bins.add(&binning, &references);
    const split = bins.choose(4).?;
    try std.testing.expectEqual(1, split.axis);
    try std.testing.expectEqual(13, split.left_count);
    try std.testing.expectEqual(13, bins.countLeft(&split));
    const side: Side = .init(&binning, &split);
    for (&references, 0..) |*box, index| {
        try std.testing.expectEqual(index < 13, side.isLeft(box));
        try std.testing.expectEqual(index, triangleNumber(box.*));
    }
    const right = toBox3(split.right_box);
    try std.testing.expectEqual(math.Vec3{ 6, 102.9, 8 }, right.upper);

    // The same in two parts.
    var first: Bins(16, 3) = undefined;
    first.clear(&binning);
    first.add(&binning, references[0..7]);
    var second: Bins(16, 3) = undefined;
    second.clear(&binning);
    second.add(&binning, references[7..]);
    second.addBins(&first);
    try std.testing.expectEqual(split.bin, second.choose(4).?.bin);
}

test "a triangle's number is no float that arithmetic would change" {
    const box: Box3 = .{ .lower = .{ -1, 0, 1 }, .upper = .{ 2, 3, 4 } };
    for ([_]u32{ 0, 1, 0x7f_ffff, 0x80_0000, number_limit - 1 }) |number| {
        const made = reference(box, number);
        try std.testing.expectEqual(number, triangleNumber(made));
        try std.testing.expect(std.math.isNormal(made[3]));
        try std.testing.expectEqual(box, toBox3(made));
    }
}

test "middles that are the same have no plane between them" {
    var references: [5]Box = undefined;
    for (&references, 0..) |*box, index| {
        const half: f32 = @floatFromInt(index);
        box.* = testReference(.{ -half, 0, -half }, .{ half, 1, half }, @intCast(index));
    }
    var centers = box_empty;
    for (references) |box| centers = join(centers, centerBox(box));
    const binning: Binning(16) = .init(centers);
    var bins: Bins(16, 3) = undefined;
    bins.clear(&binning);
    bins.add(&binning, &references);
    try std.testing.expectEqual(null, bins.choose(4));
}

test "box arithmetic agrees with Box3" {
    var random: std.Random.DefaultPrng = .init(3);
    for (0..100) |_| {
        var corners: [4]math.Vec3 = undefined;
        for (&corners) |*corner| {
            for (corner) |*coordinate| coordinate.* = random.random().floatNorm(f32);
        }
        const a = Box3.empty.include(corners[0]).include(corners[1]);
        const b = Box3.empty.include(corners[2]).include(corners[3]);
        const joined = join(reference(a, 1), reference(b, 2));
        try std.testing.expectEqual(a.join(b), toBox3(joined));
        try std.testing.expectEqual(a.join(b).halfArea(), halfArea(joined));
        const center = toBox3(centerBox(reference(a, 0)));
        try std.testing.expectEqual(a.centerTwice(), center.lower);
        try std.testing.expectEqual(a.centerTwice(), center.upper);
    }
}
