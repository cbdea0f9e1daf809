//! A distribution over the directions of an environment map: a probability tree (McCool and Harwood
//! 1997, "Probability Trees") over the cells of its octahedral square.
//!
//! In: the finest level of the map. Out: for each texel, and for each square of texels, luminance
//! times solid angle. Where rays look the map up four texels are mixed: a cell's luminance is the
//! mean of the mixture over it, 3/4 of the texel's own and 1/8 of each neighbour's by axis.

const std = @import("std");
const parallel = @import("../../parallel.zig");
const world = @import("../../world.zig");
const filter = @import("filter.zig");
const Level = @import("levels.zig").Level;
const assert = std.debug.assert;

/// From `arena`; null where the map is black. Asserts that the level's size is a power of two.
pub fn make(
    arena: std.mem.Allocator,
    level: *const world.EnvironmentLevel,
    pool: *parallel.Pool,
) (error{OutOfMemory} || parallel.Error)!?world.EnvironmentDistribution {
    const size: usize = level.size;
    assert(std.math.isPowerOfTwo(size));
    const inner = (size * size - 1) / 3;
    const weights = try arena.alloc(f32, inner + size * size);
    const filling: Filling = .{ .level = level, .cells = weights[inner..] };
    try pool.forEach(size, &filling, Filling.fillRow);
    var index = inner;
    while (index > 0) {
        index -= 1;
        const parts = weights[4 * index + 1 ..][0..4];
        weights[index] = (parts[0] + parts[2]) + (parts[1] + parts[3]);
    }
    if (!(weights[0] > 0)) return null;
    return .{ .weights = weights, .size = level.size };
}

const Filling = struct {
    level: *const world.EnvironmentLevel,
    cells: []f32,

    fn fillRow(filling: *const Filling, row: usize, _: usize) void {
        const size: usize = filling.level.size;
        const side = size + 2;
        const whole: Level = .{
            .size = filling.level.size,
            .texels = @constCast(filling.level.texels),
        };
        const shares = [3]f32{ 0.125, 0.75, 0.125 };
        for (0..size) |column| {
            var sum: f32 = 0;
            for (shares, 0..) |down, y| for (shares, 0..) |across, x| {
                const texel = filling.level.texels[(row + y) * side + column + x];
                sum += down * across * filter.luminance(.{ texel[0], texel[1], texel[2] });
            };
            filling.cells[mortonOf(column, row)] = sum * whole.solidAngleAt(column, row);
        }
    }
};

fn mortonOf(column: usize, row: usize) usize {
    return spread(column) | spread(row) << 1;
}

/// The bits of a number below 2^16 at the even places.
fn spread(number: usize) usize {
    var bits: u32 = @intCast(number);
    bits = (bits | bits << 8) & 0x00ff_00ff;
    bits = (bits | bits << 4) & 0x0f0f_0f0f;
    bits = (bits | bits << 2) & 0x3333_3333;
    bits = (bits | bits << 1) & 0x5555_5555;
    return bits;
}

test "squares of cells have the sum of their parts, and the whole is the map's light" {
    var arena_state: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena_state.deinit();
    const arena = arena_state.allocator();
    var pool: parallel.Pool = .init(2);
    defer pool.deinit();
    const level: Level = try .init(arena, 16);
    for (0..16) |row| for (0..16) |column| {
        level.at(column, row).* = .{ 2, 2, 2, 0 };
    };
    level.closeBorder();
    const even = (try make(arena, &level.finished(), &pool)).?;
    try std.testing.expectApproxEqRel(8 * std.math.pi, even.total(), 0.01);
    // One bright texel shines on its neighbours, and nowhere else.
    for (level.texels) |*texel| texel.* = @splat(0);
    try std.testing.expectEqual(null, try make(arena, &level.finished(), &pool));
    level.at(5, 9).* = .{ 1, 1, 1, 0 };
    level.closeBorder();
    const one = (try make(arena, &level.finished(), &pool)).?;
    const cells = one.weights[(16 * 16 - 1) / 3 ..];
    for (0..16) |row| for (0..16) |column| {
        const is_near = row + 1 >= 9 and row <= 10 and column + 1 >= 5 and column <= 6;
        try std.testing.expectEqual(is_near, cells[mortonOf(column, row)] > 0);
    };
    try std.testing.expectApproxEqRel(level.solidAngleAt(5, 9), one.total(), 0.05);
    try std.testing.expectEqual(0b10_11_01, mortonOf(0b011, 0b110));
}
