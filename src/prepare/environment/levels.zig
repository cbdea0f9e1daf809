//! Levels of an environment map under way: texels inside a border, and copies half as wide.
//!
//! A smaller copy weighs texels by their solid angles, so that the light of the whole stays.

const std = @import("std");
const math = @import("../../math.zig");
const world = @import("../../world.zig");
const octahedral = math.octahedral;
const Texel = world.EnvironmentTexel;

/// A level that is being filled.
pub const Level = struct {
    size: u32,
    texels: []Texel,

    /// From `arena`; nothing is set.
    pub fn init(arena: std.mem.Allocator, size: u32) error{OutOfMemory}!Level {
        const side: usize = size + 2;
        return .{ .size = size, .texels = try arena.alloc(Texel, side * side) };
    }

    /// The texel at a column and row without the border.
    pub inline fn at(level: Level, column: usize, row: usize) *Texel {
        return &level.texels[(row + 1) * (level.size + 2) + column + 1];
    }

    /// The octahedron's point in the middle of a texel.
    pub fn pointAt(level: Level, column: usize, row: usize) math.Vec3 {
        return octahedral.pointOf(level.coordinate(column), level.coordinate(row));
    }

    /// Of the middle of a column or a row, in -1..1.
    pub fn coordinate(level: Level, index: usize) f32 {
        const size: f32 = @floatFromInt(level.size);
        return (2 * @as(f32, @floatFromInt(index)) + 1) / size - 1;
    }

    /// Solid angle of a texel.
    pub fn solidAngleAt(level: Level, column: usize, row: usize) f32 {
        const side = 2 / @as(f32, @floatFromInt(level.size));
        return octahedral.density(level.pointAt(column, row)) * (side * side);
    }

    /// Fills the border: beyond an edge the square goes on with the same edge's other half.
    pub fn closeBorder(level: Level) void {
        const size = level.size;
        const side = size + 2;
        for (0..size) |index| {
            const opposite = size - 1 - index;
            level.texels[index + 1] = level.at(opposite, 0).*;
            level.texels[(size + 1) * side + index + 1] = level.at(opposite, size - 1).*;
            level.texels[(index + 1) * side] = level.at(0, opposite).*;
            level.texels[(index + 1) * side + size + 1] = level.at(size - 1, opposite).*;
        }
        level.texels[0] = level.at(size - 1, size - 1).*;
        level.texels[size + 1] = level.at(0, size - 1).*;
        level.texels[(size + 1) * side] = level.at(size - 1, 0).*;
        level.texels[(size + 1) * side + size + 1] = level.at(0, 0).*;
    }

    /// As the world keeps it.
    pub fn finished(level: Level) world.EnvironmentLevel {
        return .{ .size = level.size, .texels = level.texels };
    }

    /// Fills a row of a level from one twice as wide.
    pub fn halveRow(level: Level, finer: Level, row: usize) void {
        for (0..level.size) |column| {
            var sum: Texel = @splat(0);
            var weight: f32 = 0;
            for (0..2) |down| for (0..2) |across| {
                const solid_angle = finer.solidAngleAt(2 * column + across, 2 * row + down);
                const texel = finer.at(2 * column + across, 2 * row + down).*;
                sum += texel * @as(Texel, @splat(solid_angle));
                weight += solid_angle;
            };
            level.at(column, row).* = sum / @as(Texel, @splat(weight));
        }
    }
};

test "the border is what lies beyond the edge, and a smaller copy has the same light" {
    var arena_state: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena_state.deinit();
    const arena = arena_state.allocator();
    const fine: Level = try .init(arena, 16);
    // Radiance linear in the direction has no jump anywhere.
    var light: f64 = 0;
    for (0..16) |row| for (0..16) |column| {
        const point = math.vec3.normalize(fine.pointAt(column, row)).?;
        fine.at(column, row).* = .{ point[0], point[1], point[2], 0 };
        light += @as(f64, 1 + point[0]) * fine.solidAngleAt(column, row);
    };
    fine.closeBorder();
    for (0..18) |index| for ([_][2]usize{ .{ index, 0 }, .{ 0, index }, .{ index, 17 } }) |place| {
        const inside = [2]usize{ @min(@max(place[0], 1), 16), @min(@max(place[1], 1), 16) };
        const texel = fine.texels[place[1] * 18 + place[0]];
        const neighbour = fine.texels[inside[1] * 18 + inside[0]];
        try std.testing.expect(@reduce(.Max, @abs(texel - neighbour)) < 0.35);
    };
    const coarse: Level = try .init(arena, 8);
    var coarse_light: f64 = 0;
    for (0..8) |row| {
        coarse.halveRow(fine, row);
        for (0..8) |column| for (0..4) |part| {
            const solid_angle = fine
                .solidAngleAt(2 * column + part % 2, 2 * row + part / 2);
            coarse_light += @as(f64, 1 + coarse.at(column, row)[0]) * solid_angle;
        };
    }
    try std.testing.expectApproxEqRel(light, coarse_light, 1e-5);
}
