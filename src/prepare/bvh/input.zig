//! Input of a BVH's build: triangles, and the reference that stands for each of them that is not
//! dropped.

const std = @import("std");
const math = @import("../../math.zig");
const parallel = @import("../../parallel.zig");
const world = @import("../../world.zig");
const split = @import("split.zig");
const Box3 = math.Box3;
const TreeQuality = @import("../../settings.zig").TreeQuality;
const Vec3 = math.Vec3;

/// `Canceled`: the pool's work was.
pub const Error = error{OutOfMemory} || parallel.Error;

/// Triangles, by how much their boxes are grown, and how they are to be worked on.
pub const Input = struct {
    positions: []const Vec3,
    triangles: []const world.Triangle,
    /// Numbers of those that are not dropped, ascending; null: of all.
    kept: ?[]const u32 = null,
    /// Box of twice the centroids of the triangles' boxes, give or take rounding.
    centroid_bounds: Box3,
    padding: world.Padding,
    pool: *parallel.Pool,
    quality: TreeQuality = .default,

    /// How many triangles the tree is to hold.
    pub fn count(input: *const Input) usize {
        return if (input.kept) |kept| kept.len else input.triangles.len;
    }

    /// The reference to one of them, within its box grown by its pad.
    pub inline fn reference(input: *const Input, index: usize) split.Box {
        const number = if (input.kept) |kept| kept[index] else index;
        return split.reference(input.grownBox(&input.triangles[number]), @intCast(number));
    }

    /// The box of a triangle's corners, grown by its pad.
    pub inline fn grownBox(input: *const Input, triangle: *const world.Triangle) Box3 {
        const corner = triangle.corner;
        const box = Box3.empty
            .include(input.positions[corner[0]])
            .include(input.positions[corner[1]])
            .include(input.positions[corner[2]]);
        return box.grow(input.padding.ofBox(box));
    }
};
