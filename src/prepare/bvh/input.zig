//! Input of a BVH's build: triangles, and the reference that stands for each of them.

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
    /// Box of twice the centroids of the triangles' boxes, give or take rounding.
    centroid_bounds: Box3,
    padding: world.Padding,
    pool: *parallel.Pool,
    quality: TreeQuality = .default,

    /// The reference to a triangle, within its box grown by its pad.
    pub inline fn reference(input: *const Input, number: usize) split.Box {
        const corner = input.triangles[number].corner;
        const box = Box3.empty
            .include(input.positions[corner[0]])
            .include(input.positions[corner[1]])
            .include(input.positions[corner[2]]);
        return split.reference(box.grow(input.padding.ofBox(box)), @intCast(number));
    }
};
