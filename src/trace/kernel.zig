//! The comptime shape of a tracer: which lanes hold rays, which hold boxes, how pixels are bundled.
//!
//! In: a variant, and whether tests are counted. Out: a namespace that the other files of this
//! folder are generic over. A bundle is a block of pixels traced together: `group_count` groups of
//! as many rays as a lane value holds.

const std = @import("std");
const simd = @import("../simd.zig");
const world = @import("../world.zig");
const Variant = @import("../variant.zig").Variant;
const assert = std.debug.assert;

/// Pixels along each side of a bundle of the traversal `packet`.
const packet_side = 8;

/// Everything below `trace` is generic over this.
pub fn Kernel(comptime chosen: Variant, comptime counting: bool) type {
    comptime assert(chosen.isSupported());
    return struct {
        pub const variant = chosen;
        /// Whether boxes and triangles tested are counted.
        pub const counts_tests = counting;
        /// Children of a node, triangles of a block: the lanes of a test of one ray.
        pub const width: comptime_int = chosen.lanes;
        /// Entries of a stack that holds the siblings on the way down.
        pub const stack_max = world.tree_depth_max * (width - 1) + 1;
        /// Lane values over boxes and triangles.
        pub const Boxes = simd.Lanes(chosen.backend, width);
        /// Rays in a group.
        pub const ray_count = if (chosen.traversal == .single) 1 else width;
        /// Lane values over rays.
        pub const Rays = simd.Lanes(chosen.backend, ray_count);
        /// Pixels of a group.
        pub const group_width = switch (ray_count) {
            1 => 1,
            4 => 2,
            8, 16 => 4,
            else => unreachable,
        };
        /// See `group_width`.
        pub const group_height = ray_count / group_width;
        /// Pixels of a bundle.
        pub const bundle_width = if (chosen.traversal == .packet) packet_side else group_width;
        /// See `bundle_width`.
        pub const bundle_height = if (chosen.traversal == .packet) packet_side else group_height;
        /// Groups side by side in a bundle.
        pub const groups_across = bundle_width / group_width;
        /// Groups of a bundle.
        pub const group_count = groups_across * (bundle_height / group_height);

        comptime {
            assert(group_width * group_height == ray_count);
            assert(group_count * ray_count == bundle_width * bundle_height);
            assert(group_count <= 64); // Traversal keeps sets of groups in a word.
        }
    };
}
