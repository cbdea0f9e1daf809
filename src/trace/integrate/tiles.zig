//! The picture cut into square tiles, handed out by one atomic counter.
//!
//! In: picture and tile size. Out: rectangles, each to one thread; the counter is all that threads
//! share while they trace.

const std = @import("std");
const Rectangle = @import("whitted.zig").Rectangle;
const assert = std.debug.assert;
const Tiles = @This();

next: std.atomic.Value(u32) align(std.atomic.cache_line) = .init(0),
width: u32,
height: u32,
size: u32,
columns: u32,
count: u32,

/// Asserts that no size is 0. A side of `size` pixels is raised where there would be too many tiles
/// to count.
pub fn init(width: u32, height: u32, size: u32) Tiles {
    assert(width > 0 and height > 0 and size > 0);
    const columns = @divCeil(width, size);
    const rows = @divCeil(height, size);
    // Threads overshoot the counter by one each; 2^31 leaves room for them.
    const count = std.math.mul(u32, columns, rows) catch std.math.maxInt(u32);
    if (count > 1 << 31) return init(width, height, size * 2);
    return .{ .width = width, .height = height, .size = size, .columns = columns, .count = count };
}

/// The next tile that no thread has yet, or null. Asserts nothing: any thread, any time.
pub fn take(tiles: *Tiles) ?Rectangle {
    const index = tiles.next.fetchAdd(1, .monotonic);
    if (index >= tiles.count) return null;
    const x0 = (index % tiles.columns) * tiles.size;
    const y0 = (index / tiles.columns) * tiles.size;
    return .{
        .x0 = x0,
        .y0 = y0,
        .x1 = x0 + @min(tiles.size, tiles.width - x0),
        .y1 = y0 + @min(tiles.size, tiles.height - y0),
    };
}

test "every pixel is in exactly one tile" {
    for ([_][3]u32{ .{ 1, 1, 1 }, .{ 7, 5, 3 }, .{ 64, 64, 16 }, .{ 3, 100, 256 } }) |case| {
        var covered: [100 * 100]u8 = @splat(0);
        var tiles: Tiles = .init(case[0], case[1], case[2]);
        while (tiles.take()) |tile| {
            for (tile.y0..tile.y1) |y| {
                for (tile.x0..tile.x1) |x| covered[y * case[0] + x] += 1;
            }
        }
        const pixel_count = case[0] * case[1];
        for (covered[0..pixel_count]) |times| try std.testing.expectEqual(1, times);
        try std.testing.expectEqual(null, tiles.take());
    }
}

test "huge pictures have a countable number of tiles" {
    const tiles: Tiles = .init(65536, 65536, 1);
    try std.testing.expect(tiles.count <= 1 << 31);
}
