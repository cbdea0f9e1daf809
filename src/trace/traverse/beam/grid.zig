//! The directions of a beam's rays, linear in the pixel, and what bounds them.
//!
//! In: what a camera or a mirror makes of a square of pixels. Out: for the beam, inward normals of
//! the pyramid around its rays, and the axis along which t counts.

const std = @import("std");
const kernel_file = @import("../kernel.zig");
const vec3 = @import("../../../math.zig").vec3;

const side = kernel_file.beam_side;
const subtile_side = kernel_file.subtile_side;
const last: f32 = side - 1;
const block_last: f32 = subtile_side - 1;

/// Directions of a beam's rays: corner + x right + y down for the pixel in column x, row y.
pub const Grid = struct {
    origin: [3]f32,
    corner: [3]f32,
    right: [3]f32,
    down: [3]f32,
    /// Bound of what every ray's direction differs from that, in units of 2^-24.
    deviation_roundings: f32,

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

    /// Inward normals of the pyramid around the rays of an area, or null where the rays of all
    /// pixels are too far apart for one.
    pub fn sides(grid: *const Grid, area: Area) ?[4][3]f32 {
        if (!(grid.spread() <= 0.5 * vec3.length1(grid.corner))) return null;
        const corners = [4][3]f32{
            grid.direction(area.x[0], area.y[0]), grid.direction(area.x[1], area.y[0]),
            grid.direction(area.x[1], area.y[1]), grid.direction(area.x[0], area.y[1]),
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

/// Pixels that have rays: the first and the last column and row.
pub const Area = struct {
    x: [2]f32 = .{ 0, last },
    y: [2]f32 = .{ 0, last },

    /// Around the pixels of blocks, a bit each; there is at least one.
    pub fn of(blocks: u32) Area {
        const across = side / subtile_side;
        var columns: u32 = 0;
        for (0..across) |row| columns |= blocks >> @intCast(row * across) & ((1 << across) - 1);
        return .{
            .x = span(@ctz(columns), 31 - @clz(columns)),
            .y = span(@ctz(blocks) / across, (31 - @clz(blocks)) / across),
        };
    }

    fn span(first_block: u32, last_block: u32) [2]f32 {
        const first: f32 = @floatFromInt(first_block * subtile_side);
        const final: f32 = @floatFromInt(last_block * subtile_side);
        return .{ first, final + block_last };
    }
};

test "an area is around its blocks" {
    try std.testing.expectEqual(Area{}, Area.of(0xffff));
    try std.testing.expectEqual(Area{ .x = .{ 0, 3 }, .y = .{ 0, 3 } }, Area.of(1));
    try std.testing.expectEqual(Area{ .x = .{ 12, 15 }, .y = .{ 12, 15 } }, Area.of(1 << 15));
    // The second of the first row, the first and the third of the third.
    try std.testing.expectEqual(Area{ .x = .{ 0, 11 }, .y = .{ 0, 11 } }, Area.of(0x502));
}

test "the pyramid of an area holds its pixels and leaves out the others, turned either way" {
    const area: Area = .{ .x = .{ 4, 7 }, .y = .{ 8, 15 } };
    for ([_]f32{ 1, -1 }) |turn| {
        const grid: Grid = .{
            .origin = .{ 1, 2, 3 },
            .corner = .{ 0.3 * turn, -1, 0.2 },
            .right = .{ 0.01 * turn, 0, 0.002 },
            .down = .{ 0, 0.003, 0.01 },
            .deviation_roundings = 0,
        };
        const sides = grid.sides(area).?;
        const along = grid.depthNormal().?;
        for (0..side) |row| for (0..side) |column| {
            const x: f32 = @floatFromInt(column);
            const y: f32 = @floatFromInt(row);
            const direction = grid.direction(x, y);
            try std.testing.expectApproxEqAbs(1, vec3.dot(along, direction), 1e-4);
            var inside = true;
            for (sides) |normal| inside = inside and vec3.dot(normal, direction) > -1e-6;
            const within = x >= area.x[0] and x <= area.x[1] and y >= area.y[0] and y <= area.y[1];
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
        .deviation_roundings = 0,
    };
    try std.testing.expectEqual(null, grid.sides(.{}));
    grid.right = .{ 0.001, 0, 0 };
    grid.down = .{ 0, 0, 0.001 };
    try std.testing.expectEqual(null, grid.depthNormal());
    grid.down = .{ 0, 0, 0 };
    try std.testing.expectEqual(null, grid.depthNormal());
    grid.down = .{ 0.002, 0.000001, 0 };
    try std.testing.expectEqual(null, grid.depthNormal());
    grid.corner = @splat(std.math.nan(f32));
    try std.testing.expectEqual(null, grid.sides(.{}));
}
