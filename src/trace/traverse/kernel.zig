//! The comptime shape of a tracer: which lanes hold rays, which hold boxes, how pixels are bundled.
//!
//! In: a variant, and whether tests are counted. Out: a namespace that the other files of this
//! folder are generic over. A bundle is a square of pixels traced together: `group_count` groups of
//! as many rays as a lane value holds.

const std = @import("std");
const simd = @import("../../simd.zig");
const world = @import("../../world.zig");
const Variant = @import("../../variant.zig").Variant;
const assert = std.debug.assert;

/// Pixels along each side of a beam, and of the subtiles that it is cut into.
pub const beam_side = 16;
/// See `beam_side`.
pub const subtile_side = 4;
/// Pixels of a beam, and of a subtile.
pub const beam_pixels = beam_side * beam_side;
/// See `beam_pixels`.
pub const subtile_pixels = subtile_side * subtile_side;
/// Subtiles of a beam.
pub const beam_subtiles = beam_pixels / subtile_pixels;

/// Everything below `trace` is generic over this.
pub fn Kernel(comptime chosen: Variant, comptime counting: bool) type {
    comptime assert(chosen.isSupported());
    return struct {
        pub const variant = chosen;
        /// Whether boxes and triangles tested are counted.
        pub const counts_tests = counting;
        /// Children of a node, triangles of a pack: the lanes of a test of one ray.
        pub const width: comptime_int = chosen.lanes;
        /// Entries of a stack that holds the siblings on the way down.
        pub const stack_max = world.walk_depth_max * (width - 1) + 1;
        /// Lane values over boxes and triangles.
        pub const Boxes = simd.Lanes(chosen.backend, width);
        /// Rays in a group.
        pub const ray_count = if (chosen.traversal == .single) 1 else width;
        /// Lane values over rays.
        pub const Rays = simd.Lanes(chosen.backend, ray_count);
        /// Pixels of a group: 2x2 as the thesis has it, rows of a subtile in beams.
        pub const group_width = switch (chosen.traversal) {
            .single => 1,
            .packet2x2 => 2,
            .beam => subtile_side,
        };
        /// See `group_width`.
        pub const group_height = ray_count / group_width;
        /// Pixels of a bundle.
        pub const bundle_width = if (chosen.traversal == .beam) beam_side else group_width;
        /// See `bundle_width`.
        pub const bundle_height = if (chosen.traversal == .beam) beam_side else group_height;
        /// Groups of a subtile of 4x4 pixels; they follow each other from top to bottom.
        pub const subtile_groups = if (chosen.traversal == .beam)
            subtile_side / group_height
        else
            1;
        /// Subtiles of a bundle; they follow each other in rows.
        pub const subtile_count = if (chosen.traversal == .beam) beam_subtiles else 1;
        /// Groups of a bundle.
        pub const group_count = subtile_count * subtile_groups;

        /// Columns of a group's pixels, from that of its first.
        pub const lane_x = lanePlaces(false);
        /// The same for rows.
        pub const lane_y = lanePlaces(true);

        fn lanePlaces(comptime rows: bool) [ray_count]f32 {
            var places: [ray_count]f32 = undefined;
            for (&places, 0..) |*to, lane| {
                to.* = @floatFromInt(if (rows) lane / group_width else lane % group_width);
            }
            return places;
        }

        /// Column of a pixel in its bundle.
        pub fn pixelX(group: usize, lane: usize) u32 {
            const subtile = group / subtile_groups;
            const across = bundle_width / group_width;
            return @intCast(subtile % across * group_width + lane % group_width);
        }

        /// Row of a pixel in its bundle.
        pub fn pixelY(group: usize, lane: usize) u32 {
            const subtile = group / subtile_groups;
            const across = bundle_width / group_width;
            const subtile_height = subtile_groups * group_height;
            const row = group % subtile_groups * group_height + lane / group_width;
            return @intCast(subtile / across * subtile_height + row);
        }

        comptime {
            assert(group_width * group_height == ray_count);
            assert(group_count * ray_count == bundle_width * bundle_height);
        }
    };
}

test "every pixel of a bundle is one lane" {
    inline for (.{
        Variant{ .backend = .vector, .traversal = .beam, .lanes = 4 },
        Variant{ .backend = .vector, .traversal = .beam, .lanes = 8 },
        Variant{ .backend = .vector, .traversal = .beam, .lanes = 16 },
        Variant{ .backend = .vector, .traversal = .packet2x2, .lanes = 4 },
        Variant{ .backend = .vector, .traversal = .single, .lanes = 4 },
    }) |variant| {
        const K = Kernel(variant, false);
        var seen: [K.bundle_height][K.bundle_width]bool = @splat(@splat(false));
        for (0..K.group_count) |group| {
            for (0..K.ray_count) |lane| {
                const place = &seen[K.pixelY(group, lane)][K.pixelX(group, lane)];
                try std.testing.expect(!place.*);
                place.* = true;
            }
        }
    }
}
