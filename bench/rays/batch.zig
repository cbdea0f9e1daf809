//! The rays of a tile: 16x16 pixels in Morton order, structure of arrays.
//!
//! What the workload hands to a tracer and gets back. Any 4, 16, 64 of them from a multiple of as
//! many on are a square of pixels, any 8 are two squares side by side.

const std = @import("std");
const raylane = @import("raylane");

/// Pixels along a side of a tile.
pub const side = 16;
/// Rays in a batch.
pub const ray_count = side * side;
/// Of `Batch.primitive`: nothing was hit.
pub const none: i32 = raylane.trace.ray.no_primitive;

/// Three components of each ray.
pub const Vectors = [3][ray_count]f32;

/// In and out of a tracer. Of rays that are not active nothing is read, and what comes out of them
/// is unspecified.
pub const Batch = struct {
    /// Of reflection rays. Rays from the eye or from a light have one origin, given apart.
    origin: Vectors align(64),
    /// Not normalised.
    direction: Vectors align(64),
    /// In: where a ray ends. Out: where it hit, in units of its direction; unspecified for shadow
    /// rays, and where nothing was hit.
    t: [ray_count]f32 align(64),
    /// Out: barycentric weights of the second and the third corner; not of shadow rays.
    u: [ray_count]f32 align(64),
    v: [ray_count]f32 align(64),
    /// Out: the nearest primitive or `none`; of shadow rays anything but `none` if they hit.
    primitive: [ray_count]i32 align(64),
    /// In: a primitive that a ray passes, or `none`.
    skip: [ray_count]i32 align(64),
    /// In: -1 for a ray to be traced, 0 for none.
    active: [ray_count]i32 align(64),
};

/// Column and row within the tile of the ray at `index`.
pub fn place(index: usize) [2]u32 {
    var column: u32 = 0;
    var row: u32 = 0;
    inline for (0..4) |bit| {
        column |= @as(u32, @intCast(index >> 2 * bit & 1)) << bit;
        row |= @as(u32, @intCast(index >> 2 * bit + 1 & 1)) << bit;
    }
    return .{ column, row };
}
