//! Where the rays of a beam start that do not start at its origin: behind a mirror, as seen from
//! the mirrored eye, or behind what they have already gone through.
//!
//! In: by ray, at which t along the grid it starts. Out: bounds of 1/t there, by pixel, by block
//! and for all: a triangle counts where its own 1/t is less. The lines of such rays need not pass
//! through the origin, but near it; `edges.Spread` says how near.

const std = @import("std");
const kernel_file = @import("../kernel.zig");
const ray_file = @import("../ray.zig");
const bundle_file = @import("../bundle.zig");
const edges_file = @import("edges.zig");
const Area = @import("grid.zig").Area;

const pack_count = kernel_file.beam_subtiles;
const pixel_count = kernel_file.beam_pixels;

/// The caller fills in `ray_count`, `t`, `spread`, `t_min` and `area`, `bound` the rest.
pub fn Starts(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const lanes = Kernel.ray_count;
    return struct {
        /// Active rays.
        ray_count: u32,
        /// By group: a ray's start is t times its direction from a point no farther than
        /// `spread.apart` from the grid's origin. Not negative.
        t: [Kernel.group_count]F32,
        spread: edges_file.Spread,
        /// The least t of an active ray.
        t_min: f32,
        /// Where active rays are.
        area: Area,
        /// By pixel, in the order of groups and lanes: bounds of 1/t from which on hits count.
        lower: [pixel_count]f32 align(64),
        upper: [pixel_count]f32 align(64),
        /// By block, the least `lower` and the greatest `upper` of active rays.
        block_lower: [pack_count]f32 align(64),
        block_upper: [pack_count]f32 align(64),
        /// The greatest `upper`.
        tile_upper: f32,
        /// Triangles that rays leave out, the first `skip_count`; too many to be listed if that is
        /// more than there is room for.
        skip: [skip_max]i32,
        skip_count: u32,

        const Self = @This();
        const inf = std.math.inf(f32);
        const skip_max = 4;

        /// Bounds from `t` and from what hits have to come after.
        pub fn bound(starts: *Self, bundle: *const bundle_file.Bundle(Kernel)) void {
            const below: F32 = .splat(1 - 4 * edges_file.unit_roundoff);
            const above: F32 = .splat(1 + 4 * edges_file.unit_roundoff);
            starts.tile_upper = 0;
            starts.skip_count = 0;
            for (0..pack_count) |block| {
                var least: F32 = .splat(inf);
                var greatest: F32 = .zero();
                for (0..Kernel.subtile_groups) |row| {
                    const index = block * Kernel.subtile_groups + row;
                    const group = &bundle.groups[index];
                    const inverse = F32.splat(1).div(starts.t[index].add(group.tnear.t));
                    const lower: F32 = .select(group.active, inverse.mul(below), .splat(inf));
                    const upper: F32 = .select(group.active, inverse.mul(above), .zero());
                    lower.storeAligned(@alignCast(starts.lower[index * lanes ..][0..lanes]));
                    upper.storeAligned(@alignCast(starts.upper[index * lanes ..][0..lanes]));
                    starts.list(group.skip, group.active);
                    least = least.minFast(lower);
                    greatest = greatest.maxFast(upper);
                }
                starts.block_lower[block] = least.reduceMin();
                starts.block_upper[block] = greatest.reduceMax();
                starts.tile_upper = @max(starts.tile_upper, starts.block_upper[block]);
            }
        }

        fn list(starts: *Self, skip: Rays.I32, active: Rays.Mask) void {
            var new = active.andNot(skip.eq(.splat(ray_file.no_primitive)));
            while (starts.skip_count <= skip_max) {
                for (starts.skip[0..starts.skip_count]) |known|
                    new = new.andNot(skip.eq(.splat(known)));
                const bits = new.bits();
                if (bits == 0) return;
                if (starts.skip_count < skip_max)
                    starts.skip[starts.skip_count] = skip.lane(@ctz(bits));
                starts.skip_count += 1;
            }
        }

        /// Which of these triangles some ray may leave out, a bit each.
        pub inline fn skipped(
            starts: *const Self,
            comptime Lanes: type,
            primitive: Lanes.I32,
        ) u32 {
            if (starts.skip_count > skip_max) return std.math.maxInt(u32);
            var some: Lanes.Mask = .splat(false);
            for (starts.skip[0..starts.skip_count]) |known|
                some = some.bitOr(primitive.eq(.splat(known)));
            return some.bits();
        }

        /// A group's part, or one of as many blocks, of the bound of that name.
        pub inline fn of(starts: *const Self, comptime name: []const u8, first: usize) F32 {
            return .loadAligned(@alignCast(@field(starts, name)[first..][0..lanes]));
        }

        /// Of rays that meet a triangle at `t` from their starts, those for which it counts.
        pub inline fn counted(
            group: *const ray_file.Ray(Rays),
            t: F32,
            primitive: Rays.I32,
        ) Rays.Mask {
            return group.tnear.isBefore(t, primitive).andNot(primitive.eq(group.skip));
        }
    };
}
