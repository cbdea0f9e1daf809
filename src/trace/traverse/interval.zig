//! Interval arithmetic (Moore 1966) on the slab test: bounds of where rays of a packet meet boxes.
//!
//! In: rays in lanes; faces of boxes. Out: the ends of intervals that hold what the rays have, and
//! the least and the greatest t at which any ray between them meets a face. Every step of the slab
//! test is monotone in origin, inverse and bound, rounding included, so that these bound the
//! test's result for each ray by itself.

const std = @import("std");
const bundle_file = @import("bundle.zig");
const Padding = @import("../../world.zig").Padding;

/// The least and the greatest of what rays have.
pub const Ends = struct {
    /// The least from which an upper face of a node is met, the greatest from which a lower one is.
    origin: [3][2]f32,
    inverse: [3][2]f32,
    tnear_t: f32,
    closest_t: f32,

    /// Of the active rays of some groups, of which `views` are the views.
    pub inline fn of(
        comptime Kernel: type,
        padding: *const Padding,
        groups: anytype,
        views: anytype,
    ) Ends {
        const Rays = Kernel.Rays;
        const inf: Rays.F32 = .splat(std.math.inf(f32));
        var least: [7]Rays.F32 = @splat(inf);
        var greatest: [7]Rays.F32 = @splat(inf.neg());
        for (groups, views) |*group, *view| {
            if (group.active.none()) continue;
            const most, const origin = bundle_file.nodeOrigins(Rays, padding, group.line.origin);
            const inverse = view.slabs.direction_inv;
            const lows = [6]Rays.F32{
                origin.x, origin.y, origin.z, inverse.x, inverse.y, inverse.z,
            };
            const highs = [6]Rays.F32{ most.x, most.y, most.z, inverse.x, inverse.y, inverse.z };
            for (lows, highs, least[0..6], greatest[0..6]) |less, more, *low, *high| {
                low.* = low.minFast(.select(group.active, less, inf));
                high.* = high.maxFast(.select(group.active, more, inf.neg()));
            }
            least[6] = least[6].minFast(.select(group.active, group.tnear.t, inf));
            const closest: Rays.F32 = .select(group.active, group.closest.t, inf.neg());
            greatest[6] = greatest[6].maxFast(closest);
        }
        var ends: Ends = undefined;
        for (0..3) |axis| {
            ends.origin[axis] = .{ least[axis].reduceMin(), greatest[axis].reduceMax() };
            ends.inverse[axis] = .{ least[3 + axis].reduceMin(), greatest[3 + axis].reduceMax() };
        }
        ends.tnear_t = least[6].reduceMin();
        ends.closest_t = greatest[6].reduceMax();
        return ends;
    }
};

/// What of the rays the faces across an axis are tested against.
pub fn Slab(comptime Boxes: type) type {
    const F32 = Boxes.F32;
    return struct {
        /// See `ray.RayInverse.negative`.
        negative: Boxes.Mask,
        inverse: [2]F32,
        /// The origin farthest on the way, or least far, negated and times each inverse.
        near_shift: [2]F32,
        far_shift: [2]F32,

        /// Of intervals along the axis.
        pub inline fn init(negative: bool, origin: [2]f32, inverse: [2]f32) @This() {
            const near_origin: F32 = .splat(origin[if (negative) 0 else 1]);
            const far_origin: F32 = .splat(origin[if (negative) 1 else 0]);
            const inverses = [2]F32{ .splat(inverse[0]), .splat(inverse[1]) };
            return .{
                .negative = .splat(negative),
                .inverse = inverses,
                .near_shift = shiftOf(near_origin, inverses),
                .far_shift = shiftOf(far_origin, inverses),
            };
        }

        inline fn shiftOf(origin: F32, inverse: [2]F32) [2]F32 {
            return .{ origin.mul(inverse[0]).neg(), origin.mul(inverse[1]).neg() };
        }

        inline fn ts(slab: *const @This(), bound: F32, shift: [2]F32) [2]F32 {
            return .{
                bound.mulAdd(slab.inverse[0], shift[0]),
                bound.mulAdd(slab.inverse[1], shift[1]),
            };
        }

        /// The least t at which a ray comes through the near face.
        pub inline fn near(slab: *const @This(), bound: F32) F32 {
            const both = slab.ts(bound, slab.near_shift);
            return both[0].minOrNegative(both[1]);
        }

        /// The greatest t at which a ray goes out through the far face.
        pub inline fn far(slab: *const @This(), bound: F32) F32 {
            const both = slab.ts(bound, slab.far_shift);
            return both[0].maxOrNegative(both[1]);
        }
    };
}
