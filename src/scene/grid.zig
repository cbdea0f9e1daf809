//! A grid of quadrilaterals between points in rows, each cut into two triangles.
//!
//! Seen from the front, columns run to the right and rows upwards; all indices are of points, the
//! first one 0, row after row.

const std = @import("std");
const assert = std.debug.assert;

const Grid = @This();

/// Quadrilaterals in a row and in a column.
columns: u32,
rows: u32,
/// The last column ends at the points of the first.
closed: bool = false,

/// Points in a row.
pub fn stride(grid: Grid) u32 {
    return if (grid.closed) grid.columns else grid.columns + 1;
}

/// Points of a quadrilateral, counter-clockwise from the lower left.
pub fn corners(grid: Grid, row: usize, column: usize) [4]u32 {
    assert(row < grid.rows and column < grid.columns);
    const left: u32 = @intCast(column);
    const right = if (left + 1 == grid.stride()) 0 else left + 1;
    const lower = @as(u32, @intCast(row)) * grid.stride();
    const upper = lower + grid.stride();
    return .{ lower + left, lower + right, upper + right, upper + left };
}

/// Two triangles, the one at the lower right first.
pub fn cut(quad: [4]u32) [2][3]u32 {
    return .{ quad[0..3].*, .{ quad[0], quad[2], quad[3] } };
}

test "an open grid has a column of points more than a closed one" {
    const open: Grid = .{ .columns = 3, .rows = 2 };
    try std.testing.expectEqual([4]u32{ 6, 7, 11, 10 }, open.corners(1, 2));
    const closed: Grid = .{ .columns = 3, .rows = 2, .closed = true };
    try std.testing.expectEqual([4]u32{ 5, 3, 6, 8 }, closed.corners(1, 2));
    try std.testing.expectEqual([2][3]u32{ .{ 5, 3, 6 }, .{ 5, 6, 8 } }, cut(closed.corners(1, 2)));
}
