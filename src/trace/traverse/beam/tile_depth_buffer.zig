//! What the pixels of a beam see so far: by block one triangle all over, or one for each pixel.
//!
//! In: triangles that surely lie before what is known, as linear forms over the pixels. Out: the
//! triangle of every pixel, with bounds of 1/t there, and bounds by block. A block that one
//! triangle fills, or none, is kept as that triangle's form until another touches a part of it:
//! large triangles cost nothing by the pixel.

const std = @import("std");
const kernel_file = @import("../kernel.zig");
const bundle_file = @import("../bundle.zig");
const edges_file = @import("edges.zig");
const exact = @import("exact.zig");

const side = kernel_file.beam_side;
const subtile_side = kernel_file.subtile_side;
const pack_count = kernel_file.beam_subtiles;
const pixel_count = kernel_file.beam_pixels;

/// Bounds of 1/t of a triangle, linear over the pixels; or of one in each block.
pub fn Depth(comptime Value: type) type {
    return struct {
        /// Upper bound at the beam's first pixel, steps right and down.
        base: Value,
        right: Value,
        down: Value,
        /// How far below it the lower bound is: by a factor, and then by as much.
        shrink: Value,
        drop: Value,
    };
}

const depth_names = std.meta.fieldNames(Depth(f32));

/// Undefined until `clear`.
pub fn Found(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const lanes = Kernel.ray_count;
    const subtile_groups = Kernel.subtile_groups;
    return struct {
        /// Blocks that one triangle fills, or none, a bit each: `block_slot` and `depth` tell of
        /// these. Others have it by pixel.
        whole: u32,
        block_slot: [pack_count]exact.Slot align(64),
        depth: Depth([pack_count]f32) align(64),
        /// By pixel, in the order of groups and lanes: what is hit, and bounds of 1/t there; 0
        /// where nothing is, infinity where there is no ray.
        slot: [pixel_count]exact.Slot align(64),
        lower: [pixel_count]f32 align(64),
        upper: [pixel_count]f32 align(64),
        /// By block, the least `lower`; of those in `whole` the greatest `upper`, else infinity.
        block_lower: [pack_count]f32 align(64),
        block_upper: [pack_count]f32 align(64),
        /// The least `block_lower`, as of `depthMax`.
        tile_lower: f32,

        const Self = @This();
        const F32 = Rays.F32;
        const I32 = Rays.I32;
        const Mask = Rays.Mask;
        const inf = std.math.inf(f32);
        /// Columns and rows of the blocks' first pixels.
        pub const block_x = blockPlaces(false);
        pub const block_y = blockPlaces(true);

        fn blockPlaces(comptime rows: bool) [pack_count]f32 {
            var places: [pack_count]f32 = undefined;
            for (&places, 0..) |*to, block| {
                const across = side / subtile_side;
                to.* = @floatFromInt(subtile_side * (if (rows) block / across else block % across));
            }
            return places;
        }

        /// No hit anywhere; a pixel without a ray has one at no distance.
        pub fn clear(found: *Self, bundle: *const bundle_file.Bundle(Kernel)) void {
            found.block_slot = @splat(exact.no_slot);
            inline for (depth_names) |name| @field(found.depth, name) = @splat(0);
            found.block_lower = @splat(0);
            found.block_upper = @splat(0);
            found.tile_lower = 0;
            found.whole = (1 << pack_count) - 1;
            for (0..pack_count) |block| {
                const groups = bundle.groups[block * subtile_groups ..][0..subtile_groups];
                var all = groups[0].active;
                inline for (groups[1..]) |*group| all = all.bitAnd(group.active);
                if (all.all()) continue;
                found.spread(block);
                for (groups, block * subtile_groups..) |*group, index| {
                    const bound: F32 = .select(group.active, .zero(), .splat(inf));
                    bound.storeAligned(found.of("lower", index));
                    bound.storeAligned(found.of("upper", index));
                }
                found.boundBlock(block);
            }
        }

        /// A group's part of one of the arrays by pixel.
        pub inline fn of(
            found: *Self,
            comptime name: []const u8,
            group: usize,
        ) *align(lanes * 4) [lanes]std.meta.Elem(@FieldType(Self, name)) {
            return @alignCast(@field(found, name)[group * lanes ..][0..lanes]);
        }

        /// A part of one of the arrays by block, from block `first` on.
        pub inline fn ofBlocks(
            found: *Self,
            comptime name: []const u8,
            first: usize,
        ) *align(lanes * 4) [lanes]std.meta.Elem(@FieldType(Self, name)) {
            return @alignCast(@field(found, name)[first..][0..lanes]);
        }

        /// A triangle fills some of the blocks from `first` on, before all that is known there;
        /// with bounds of 1/t in each of them.
        pub inline fn fill(
            found: *Self,
            first: usize,
            blocks: Mask,
            slot: exact.Slot,
            depth: *const Depth(f32),
            lower: F32,
            upper: F32,
        ) void {
            const slots = found.ofBlocks("block_slot", first);
            I32.select(blocks, .splat(slot), .loadAligned(slots)).storeAligned(slots);
            const lowest = found.ofBlocks("block_lower", first);
            F32.select(blocks, lower, .loadAligned(lowest)).storeAligned(lowest);
            const highest = found.ofBlocks("block_upper", first);
            F32.select(blocks, upper, .loadAligned(highest)).storeAligned(highest);
            inline for (depth_names) |name| {
                const all = &@field(found.depth, name);
                const known: *align(lanes * 4) [lanes]f32 = @alignCast(all[first..][0..lanes]);
                F32.select(blocks, .splat(@field(depth, name)), .loadAligned(known))
                    .storeAligned(known);
            }
            found.whole |= blocks.bits() << @intCast(first);
        }

        /// Whether one triangle fills this block, or none.
        pub inline fn isWhole(found: *const Self, block: usize) bool {
            return found.whole >> @intCast(block) & 1 != 0;
        }

        /// From one triangle for the block to one for each pixel.
        pub fn spread(found: *Self, block: usize) void {
            found.whole &= ~(@as(u32, 1) << @intCast(block));
            found.block_upper[block] = inf;
            var depth: Depth(f32) = undefined;
            inline for (depth_names) |name| {
                @field(depth, name) = @field(found.depth, name)[block];
            }
            const base = depth.base + block_x[block] * depth.right + block_y[block] * depth.down;
            var value: F32 = .splat(base);
            if (Kernel.group_height > 1)
                value = F32.fromArray(Kernel.lane_y).mulAdd(.splat(depth.down), value);
            value = F32.fromArray(Kernel.lane_x).mulAdd(.splat(depth.right), value);
            const slot: I32 = .splat(found.block_slot[block]);
            inline for (0..subtile_groups) |row| {
                const group = block * subtile_groups + row;
                value.mulAdd(.splat(depth.shrink), .splat(-depth.drop))
                    .storeAligned(found.of("lower", group));
                value.storeAligned(found.of("upper", group));
                slot.storeAligned(found.of("slot", group));
                value = value.add(.splat(depth.down * Kernel.group_height));
            }
        }

        /// The same for all blocks.
        pub fn spreadAll(found: *Self) void {
            for (0..pack_count) |block| if (found.isWhole(block)) found.spread(block);
        }

        /// Bounds of a block that has its triangles by pixel.
        pub inline fn boundBlock(found: *Self, block: usize) void {
            const first = block * subtile_groups;
            var least: F32 = .loadAligned(found.of("lower", first));
            inline for (1..subtile_groups) |row| {
                least = least.minFast(.loadAligned(found.of("lower", first + row)));
            }
            found.block_lower[block] = least.reduceMin();
        }

        /// t beyond which nothing can be seen any more.
        pub inline fn depthMax(found: *Self) f32 {
            var least: F32 = .loadAligned(found.ofBlocks("block_lower", 0));
            inline for (1..pack_count / lanes) |part| {
                least = least.minFast(.loadAligned(found.ofBlocks("block_lower", part * lanes)));
            }
            found.tile_lower = least.reduceMin();
            if (found.tile_lower == 0) return inf;
            return 1 / found.tile_lower * (1 + 4 * edges_file.unit_roundoff);
        }
    };
}

test "a block that a triangle fills says the same by pixel; a pixel without a ray stays out" {
    inline for (.{ 4, 8, 16 }) |lane_count| {
        const Kernel = kernel_file.Kernel(.{
            .backend = .vector,
            .traversal = .beam,
            .lanes = lane_count,
        }, false);
        const Mask = Kernel.Rays.Mask;
        var bundle: bundle_file.Bundle(Kernel) = undefined;
        for (&bundle.groups) |*group| group.active = .splat(true);
        bundle.groups[0].active = Mask.splat(true).andNot(.fromBits(2));
        var found: Found(Kernel) = undefined;
        found.clear(&bundle);
        try std.testing.expect(!found.isWhole(0));
        try std.testing.expectEqual(std.math.inf(f32), found.lower[1]);
        try std.testing.expectEqual(0, found.lower[0]);
        try std.testing.expectEqual(std.math.inf(f32), found.depthMax());

        const block = pack_count - 2;
        const first = block / Kernel.ray_count * Kernel.ray_count;
        const depth: Depth(f32) =
            .{ .base = 1.25, .right = 0.015625, .down = 0.03125, .shrink = 0.875, .drop = 0.125 };
        found.fill(
            first,
            .fromBits(@as(u32, 1) << @intCast(block - first)),
            7,
            &depth,
            .splat(1),
            .splat(2),
        );
        try std.testing.expect(found.isWhole(block) and found.block_slot[block] == 7);
        try std.testing.expectEqual(exact.no_slot, found.block_slot[block - 1]);
        try std.testing.expectEqual([2]f32{ 1, 2 }, .{
            found.block_lower[block], found.block_upper[block],
        });
        found.spread(block);
        try std.testing.expect(!found.isWhole(block));
        for (0..kernel_file.subtile_pixels) |pixel| {
            const at = block * kernel_file.subtile_pixels + pixel;
            const group = at / Kernel.ray_count;
            const x: f32 = @floatFromInt(Kernel.pixelX(group, at % Kernel.ray_count));
            const y: f32 = @floatFromInt(Kernel.pixelY(group, at % Kernel.ray_count));
            const value = 1.25 + 0.015625 * x + 0.03125 * y;
            try std.testing.expectEqual(7, found.slot[at]);
            try std.testing.expectEqual(value, found.upper[at]);
            try std.testing.expectEqual(value * 0.875 - 0.125, found.lower[at]);
        }
        found.boundBlock(block);
        const corner = 1.25 + 0.015625 * Found(Kernel).block_x[block] +
            0.03125 * Found(Kernel).block_y[block];
        try std.testing.expectEqual(corner * 0.875 - 0.125, found.block_lower[block]);
    }
}
