//! What a tree is built on: triangles, and the reference that stands for each of them.

const std = @import("std");
const math = @import("../../math.zig");
const world = @import("../../world.zig");
const split = @import("split.zig");
const Box3 = math.Box3;
const Vec3 = math.Vec3;

/// How much care is taken over a tree.
pub const Quality = enum {
    /// Cut between the cells of a grid as long as there are several, then along the longest axis.
    fast,
    /// Cut at the best of the planes along all three axes.
    default,
    /// That, and then each subtree moved to where it costs the least (`bvh_reinsert`).
    high,
};

/// Triangles, by how much their boxes are grown, and how they are to be worked on.
pub const Input = struct {
    positions: []const Vec3,
    triangles: []const world.Triangle,
    /// Box of twice the middles of the triangles' boxes, give or take rounding.
    centroid_bounds: Box3,
    padding: world.Padding,
    thread_count: usize,
    quality: Quality = .default,

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
