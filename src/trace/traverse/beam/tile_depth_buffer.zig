//! Hierarchical z-buffer (Greene, Kass and Miller 1993) of a tile: what its pixels see so far, by
//! subtile one triangle all over, or one for each pixel.
//!
//! In: triangles that surely lie before what is known, as linear forms over the pixels. Out: the
//! triangle of every pixel, with bounds of 1/t there, and bounds by subtile. A subtile that one
//! triangle fills, or none, is kept as that triangle's form until another touches a part of it:
//! large triangles cost nothing by the pixel.

const std = @import("std");
const kernel_file = @import("../kernel.zig");
const bundle_file = @import("../bundle.zig");
const edges_file = @import("edges.zig");
const exact = @import("exact.zig");

const side = kernel_file.beam_side;
const subtile_side = kernel_file.subtile_side;
const subtile_count = kernel_file.beam_subtiles;
const pixel_count = kernel_file.beam_pixels;

/// Bounds of 1/t of a triangle, linear over the pixels; or of one in each subtile.
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
pub fn TileDepthBuffer(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const lanes = Kernel.ray_count;
    const subtile_groups = Kernel.subtile_groups;
    return struct {
        /// Subtiles that one triangle fills, or none, a bit each: `subtile_slot` and `depth` tell
        /// of these. Others have it by pixel.
        whole: u32,
        subtile_slot: [subtile_count]exact.Slot align(64),
        depth: Depth([subtile_count]f32) align(64),
        /// By pixel, in the order of groups and lanes: what is hit, and bounds of 1/t there; 0
        /// where nothing is, infinity where there is no ray.
        slot: [pixel_count]exact.Slot align(64),
        lower: [pixel_count]f32 align(64),
        upper: [pixel_count]f32 align(64),
        /// By subtile, the least `lower`; of those in `whole` the greatest `upper`, else infinity.
        subtile_lower: [subtile_count]f32 align(64),
        subtile_upper: [subtile_count]f32 align(64),
        /// The least `subtile_lower`, as of `depthMax`.
        tile_lower: f32,

        const Self = @This();
        const F32 = Rays.F32;
        const I32 = Rays.I32;
        const Mask = Rays.Mask;
        const inf = std.math.inf(f32);
        /// Columns and rows of the subtiles' first pixels.
        pub const subtile_x = subtilePlaces(false);
        pub const subtile_y = subtilePlaces(true);

        fn subtilePlaces(comptime rows: bool) [subtile_count]f32 {
            var places: [subtile_count]f32 = undefined;
            for (&places, 0..) |*to, subtile| {
                const across = side / subtile_side;
                const place = if (rows) subtile / across else subtile % across;
                to.* = @floatFromInt(subtile_side * place);
            }
            return places;
        }

        /// No hit anywhere; a pixel without a ray has one at no distance.
        pub fn clear(buffer: *Self, bundle: *const bundle_file.Bundle(Kernel)) void {
            buffer.subtile_slot = @splat(exact.no_slot);
            inline for (depth_names) |name| @field(buffer.depth, name) = @splat(0);
            buffer.subtile_lower = @splat(0);
            buffer.subtile_upper = @splat(0);
            buffer.tile_lower = 0;
            buffer.whole = (1 << subtile_count) - 1;
            for (0..subtile_count) |subtile| {
                const groups = bundle.groups[subtile * subtile_groups ..][0..subtile_groups];
                var all = groups[0].active;
                inline for (groups[1..]) |*group| all = all.bitAnd(group.active);
                if (all.all()) continue;
                buffer.spread(subtile);
                for (groups, subtile * subtile_groups..) |*group, index| {
                    const bound: F32 = .select(group.active, .zero(), .splat(inf));
                    bound.storeAligned(buffer.of("lower", index));
                    bound.storeAligned(buffer.of("upper", index));
                }
                buffer.boundSubtile(subtile);
            }
        }

        /// A group's part of one of the arrays by pixel.
        pub inline fn of(
            buffer: *Self,
            comptime name: []const u8,
            group: usize,
        ) *align(lanes * 4) [lanes]std.meta.Elem(@FieldType(Self, name)) {
            return @alignCast(@field(buffer, name)[group * lanes ..][0..lanes]);
        }

        /// A part of one of the arrays by subtile, from subtile `first` on.
        pub inline fn ofSubtiles(
            buffer: *Self,
            comptime name: []const u8,
            first: usize,
        ) *align(lanes * 4) [lanes]std.meta.Elem(@FieldType(Self, name)) {
            return @alignCast(@field(buffer, name)[first..][0..lanes]);
        }

        /// A triangle fills some of the subtiles from `first` on, before all that is known there;
        /// with bounds of 1/t in each of them.
        pub inline fn fill(
            buffer: *Self,
            first: usize,
            subtiles: Mask,
            slot: exact.Slot,
            depth: *const Depth(f32),
            lower: F32,
            upper: F32,
        ) void {
            const slots = buffer.ofSubtiles("subtile_slot", first);
            I32.select(subtiles, .splat(slot), .loadAligned(slots)).storeAligned(slots);
            const lowest = buffer.ofSubtiles("subtile_lower", first);
            F32.select(subtiles, lower, .loadAligned(lowest)).storeAligned(lowest);
            const highest = buffer.ofSubtiles("subtile_upper", first);
            F32.select(subtiles, upper, .loadAligned(highest)).storeAligned(highest);
            inline for (depth_names) |name| {
                const all = &@field(buffer.depth, name);
                const known: *align(lanes * 4) [lanes]f32 = @alignCast(all[first..][0..lanes]);
                F32.select(subtiles, .splat(@field(depth, name)), .loadAligned(known))
                    .storeAligned(known);
            }
            buffer.whole |= subtiles.bits() << @intCast(first);
        }

        /// Whether one triangle fills this subtile, or none.
        pub inline fn isWhole(buffer: *const Self, subtile: usize) bool {
            return buffer.whole >> @intCast(subtile) & 1 != 0;
        }

        /// From one triangle for the subtile to one for each pixel.
        pub fn spread(buffer: *Self, subtile: usize) void {
            buffer.whole &= ~(@as(u32, 1) << @intCast(subtile));
            buffer.subtile_upper[subtile] = inf;
            var depth: Depth(f32) = undefined;
            inline for (depth_names) |name| {
                @field(depth, name) = @field(buffer.depth, name)[subtile];
            }
            const base = depth.base + subtile_x[subtile] * depth.right +
                subtile_y[subtile] * depth.down;
            var value: F32 = .splat(base);
            if (Kernel.group_height > 1)
                value = F32.fromArray(Kernel.lane_y).mulAdd(.splat(depth.down), value);
            value = F32.fromArray(Kernel.lane_x).mulAdd(.splat(depth.right), value);
            const slot: I32 = .splat(buffer.subtile_slot[subtile]);
            inline for (0..subtile_groups) |row| {
                const group = subtile * subtile_groups + row;
                value.mulAdd(.splat(depth.shrink), .splat(-depth.drop))
                    .storeAligned(buffer.of("lower", group));
                value.storeAligned(buffer.of("upper", group));
                slot.storeAligned(buffer.of("slot", group));
                value = value.add(.splat(depth.down * Kernel.group_height));
            }
        }

        /// The same for all subtiles.
        pub fn spreadAll(buffer: *Self) void {
            for (0..subtile_count) |subtile| if (buffer.isWhole(subtile)) buffer.spread(subtile);
        }

        /// Bounds of a subtile that has its triangles by pixel.
        pub inline fn boundSubtile(buffer: *Self, subtile: usize) void {
            const first = subtile * subtile_groups;
            var least: F32 = .loadAligned(buffer.of("lower", first));
            inline for (1..subtile_groups) |row| {
                least = least.minFast(.loadAligned(buffer.of("lower", first + row)));
            }
            buffer.subtile_lower[subtile] = least.reduceMin();
        }

        /// t beyond which nothing can be seen any more.
        pub inline fn depthMax(buffer: *Self) f32 {
            var least: F32 = .loadAligned(buffer.ofSubtiles("subtile_lower", 0));
            inline for (1..subtile_count / lanes) |part| {
                const lowest = buffer.ofSubtiles("subtile_lower", part * lanes);
                least = least.minFast(.loadAligned(lowest));
            }
            buffer.tile_lower = least.reduceMin();
            if (buffer.tile_lower == 0) return inf;
            return 1 / buffer.tile_lower * (1 + 4 * edges_file.unit_roundoff);
        }
    };
}

test "a subtile that a triangle fills says the same by pixel; a pixel without a ray stays out" {
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
        var buffer: TileDepthBuffer(Kernel) = undefined;
        buffer.clear(&bundle);
        try std.testing.expect(!buffer.isWhole(0));
        try std.testing.expectEqual(std.math.inf(f32), buffer.lower[1]);
        try std.testing.expectEqual(0, buffer.lower[0]);
        try std.testing.expectEqual(std.math.inf(f32), buffer.depthMax());

        const subtile = subtile_count - 2;
        const first = subtile / Kernel.ray_count * Kernel.ray_count;
        const depth: Depth(f32) =
            .{ .base = 1.25, .right = 0.015625, .down = 0.03125, .shrink = 0.875, .drop = 0.125 };
        buffer.fill(
            first,
            .fromBits(@as(u32, 1) << @intCast(subtile - first)),
            7,
            &depth,
            .splat(1),
            .splat(2),
        );
        try std.testing.expect(buffer.isWhole(subtile) and buffer.subtile_slot[subtile] == 7);
        try std.testing.expectEqual(exact.no_slot, buffer.subtile_slot[subtile - 1]);
        try std.testing.expectEqual([2]f32{ 1, 2 }, .{
            buffer.subtile_lower[subtile], buffer.subtile_upper[subtile],
        });
        buffer.spread(subtile);
        try std.testing.expect(!buffer.isWhole(subtile));
        for (0..kernel_file.subtile_pixels) |pixel| {
            const at = subtile * kernel_file.subtile_pixels + pixel;
            const group = at / Kernel.ray_count;
            const x: f32 = @floatFromInt(Kernel.pixelX(group, at % Kernel.ray_count));
            const y: f32 = @floatFromInt(Kernel.pixelY(group, at % Kernel.ray_count));
            const value = 1.25 + 0.015625 * x + 0.03125 * y;
            try std.testing.expectEqual(7, buffer.slot[at]);
            try std.testing.expectEqual(value, buffer.upper[at]);
            try std.testing.expectEqual(value * 0.875 - 0.125, buffer.lower[at]);
        }
        buffer.boundSubtile(subtile);
        const corner = 1.25 + 0.015625 * TileDepthBuffer(Kernel).subtile_x[subtile] +
            0.03125 * TileDepthBuffer(Kernel).subtile_y[subtile];
        try std.testing.expectEqual(corner * 0.875 - 0.125, buffer.subtile_lower[subtile]);
    }
}
