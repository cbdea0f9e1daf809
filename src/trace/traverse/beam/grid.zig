//! The ray grid of a beam: directions linear in the pixel, and what bounds them.
//!
//! In: what a camera makes of a square of pixels. Out: for the beam, inward normals of
//! the pyramid around its rays, and the axis along which t counts.

const std = @import("std");
const kernel_file = @import("../kernel.zig");
const vec3 = @import("../../../math.zig").vec3;

const side = kernel_file.beam_side;
const last: f32 = side - 1;

/// Directions of a beam's rays: corner + x right + y down for the pixel in column x, row y.
pub const Grid = struct {
    origin: [3]f32,
    corner: [3]f32,
    right: [3]f32,
    down: [3]f32,
    /// Bound of what every ray's direction differs from that, in units of 2^-24.
    deviation_ulps: f32,

    /// A bound of how much directions differ.
    pub fn spread(grid: *const Grid) f32 {
        return last * (vec3.length1(grid.right) + vec3.length1(grid.down));
    }

    /// A bound of their lengths.
    pub fn longest(grid: *const Grid) f32 {
        return @sqrt(vec3.dot(grid.corner, grid.corner)) + grid.spread();
    }

    /// The direction of a pixel, rounded.
    pub fn direction(grid: *const Grid, x: f32, y: f32) [3]f32 {
        return vec3.add(grid.corner, vec3.add(vec3.scale(grid.right, x), vec3.scale(grid.down, y)));
    }

    /// Inward normals of the pyramid around the rays; null where these are too far apart for one.
    pub fn sides(grid: *const Grid) ?[4][3]f32 {
        if (!(grid.spread() <= 0.5 * vec3.length1(grid.corner))) return null;
        const corners = [4][3]f32{
            grid.direction(0, 0),       grid.direction(last, 0),
            grid.direction(last, last), grid.direction(0, last),
        };
        const facing = vec3.dot(vec3.cross(grid.right, grid.down), grid.corner);
        var normals: [4][3]f32 = undefined;
        for (&normals, corners, 0..) |*normal, corner, index| {
            // By the step, not by the next corner: two corners are nearly parallel, or the same.
            const across = vec3.cross(corner, if (index % 2 == 0) grid.right else grid.down);
            const inward = (facing > 0) == (index < 2);
            normal.* = vec3.scale(across, if (inward) 1 else -1);
        }
        return normals;
    }

    /// The vector whose product with every direction of the grid is 1, or null where they are too
    /// oblique, or one step much like the other, so that rounding would be all there is of it.
    pub fn depthNormal(grid: *const Grid) ?[3]f32 {
        const facing = vec3.cross(grid.right, grid.down);
        const area_max = vec3.length1(grid.right) * vec3.length1(grid.down);
        if (!(vec3.length1(facing) > 0.01 * area_max)) return null;
        const share = vec3.dot(facing, grid.corner);
        if (!(@abs(share) > 0.1 * vec3.length1(facing) * vec3.length1(grid.corner))) return null;
        return vec3.scale(facing, 1 / share);
    }
};

test "the pyramid holds its pixels and leaves out the others, turned either way" {
    for ([_]f32{ 1, -1 }) |turn| {
        const grid: Grid = .{
            .origin = .{ 1, 2, 3 },
            .corner = .{ 0.3 * turn, -1, 0.2 },
            .right = .{ 0.01 * turn, 0, 0.002 },
            .down = .{ 0, 0.003, 0.01 },
            .deviation_ulps = 0,
        };
        const sides = grid.sides().?;
        const along = grid.depthNormal().?;
        for (0..side + 2) |row| for (0..side + 2) |column| {
            const x = @as(f32, @floatFromInt(column)) - 1;
            const y = @as(f32, @floatFromInt(row)) - 1;
            const direction = grid.direction(x, y);
            try std.testing.expectApproxEqAbs(1, vec3.dot(along, direction), 1e-4);
            var inside = true;
            for (sides) |normal| inside = inside and vec3.dot(normal, direction) > -1e-6;
            const within = x >= 0 and x <= last and y >= 0 and y <= last;
            try std.testing.expectEqual(within, inside);
        };
    }
}

test "directions too far apart, or along the picture, have no pyramid" {
    var grid: Grid = .{
        .origin = .{ 0, 0, 0 },
        .corner = .{ 0, 0, 1 },
        .right = .{ 0.1, 0, 0 },
        .down = .{ 0, 0.1, 0 },
        .deviation_ulps = 0,
    };
    try std.testing.expectEqual(null, grid.sides());
    grid.right = .{ 0.001, 0, 0 };
    grid.down = .{ 0, 0, 0.001 };
    try std.testing.expectEqual(null, grid.depthNormal());
    grid.down = .{ 0, 0, 0 };
    try std.testing.expectEqual(null, grid.depthNormal());
    grid.down = .{ 0.002, 0.000001, 0 };
    try std.testing.expectEqual(null, grid.depthNormal());
    grid.corner = @splat(std.math.nan(f32));
    try std.testing.expectEqual(null, grid.sides());
}
