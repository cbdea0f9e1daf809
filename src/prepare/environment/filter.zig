//! Convolution of an environment map with lobes, by a tree of its texels.
//!
//! In: a radiance pyramid. Out: for each direction of a level, the mean of the radiance weighted
//! by a lobe around it: D(h) (n.l) with h between n and l for GGX as seen along n (Karis 2013), or
//! the cosine. The texels of the pyramid are the nodes of a quadtree: what is far from the lobe's
//! middle counts as one where the lobe hardly changes over it (Barnes and Hut 1986), and lies in
//! its centre of luminance, so that a small strong source stays where it is. Eight directions go
//! through the tree together.

const std = @import("std");
const math = @import("../../math.zig");
const Level = @import("levels.zig").Level;
const Texel = @import("../../world.zig").EnvironmentTexel;
const vec3 = math.vec3;
const assert = std.debug.assert;

/// Directions that are convolved together, two rows of four.
pub const block_width = 4;
/// See `block_width`.
pub const block_height = 2;
const lane_count = block_width * block_height;
const Lanes = @Vector(lane_count, f32);

/// How wide a node may be for the distance from the lobe's middle, squared.
const opening_squared = 0.16;
/// How wide a node may be for the cosine, squared; radians.
const cosine_width_squared = 0.01;

/// A texel of the pyramid as a part of the sky.
pub const Node = struct {
    /// Unit direction of its centre of luminance.
    direction: [3]f32,
    solid_angle: f32,
    /// Radiance times solid angle.
    energy: [3]f32,
};

/// The nodes of a pyramid, from the coarsest level.
pub const Tree = struct {
    levels: []const []const Node,

    /// Texels along a side of the coarsest and of the finest level.
    pub const size_min = 8;
    /// See `size_min`.
    pub const size_max = 256;

    /// From levels that each are half as wide as the one before; from `arena`. Those wider than
    /// `size_max` are left out.
    pub fn init(arena: std.mem.Allocator, pyramid: []const Level) error{OutOfMemory}!Tree {
        var first: usize = 0;
        while (pyramid[first].size > size_max) first += 1;
        assert(pyramid[pyramid.len - 1].size == size_min);
        const levels = try arena.alloc([]const Node, pyramid.len - first);
        var finer: ?[]const Node = null;
        for (pyramid[first..], 0..) |level, index| {
            const nodes = try arena.alloc(Node, level.size * level.size);
            for (0..level.size) |row| for (0..level.size) |column| {
                nodes[row * level.size + column] = if (finer) |children|
                    joined(children, level.size, column, row)
                else
                    leafOf(level, column, row);
            };
            levels[levels.len - 1 - index] = nodes;
            finer = nodes;
        }
        return .{ .levels = levels };
    }

    /// The level whose sides have so many texels.
    pub fn levelOf(tree: *const Tree, size: u32) []const Node {
        return tree.levels[std.math.log2_int(u32, size / size_min)];
    }

    fn leafOf(level: Level, column: usize, row: usize) Node {
        const solid_angle = level.solidAngleAt(column, row);
        const texel = level.at(column, row).*;
        return .{
            .direction = vec3.normalize(level.pointAt(column, row)).?,
            .solid_angle = solid_angle,
            .energy = .{ texel[0] * solid_angle, texel[1] * solid_angle, texel[2] * solid_angle },
        };
    }

    fn joined(children: []const Node, size: u32, column: usize, row: usize) Node {
        var node: Node = .{ .direction = @splat(0), .solid_angle = 0, .energy = @splat(0) };
        var middle: [3]f32 = @splat(0);
        var total: f32 = 0;
        for (0..4) |part| {
            const child_row = 2 * row + part / 2;
            const child = &children[child_row * 2 * size + 2 * column + part % 2];
            const weight = luminance(child.energy);
            node.direction = vec3.add(node.direction, vec3.scale(child.direction, weight));
            middle = vec3.add(middle, vec3.scale(child.direction, child.solid_angle));
            node.solid_angle += child.solid_angle;
            node.energy = vec3.add(node.energy, child.energy);
            total += weight;
        }
        // Where it is dark the middle will do.
        const least = vec3.scale(middle, total / node.solid_angle * 1e-3 + 1e-20);
        node.direction = vec3.normalize(vec3.add(node.direction, least)) orelse
            vec3.normalize(middle).?;
        return node;
    }
};

/// Of linear Rec. 709.
pub fn luminance(color: [3]f32) f32 {
    return (0.2126 * color[0] + 0.7152 * color[1]) + 0.0722 * color[2];
}

/// What the radiance is weighted with.
pub const Lobe = union(enum) {
    cosine,
    /// Of this roughness, > 0; its square is GGX's alpha.
    ggx: f32,
};

/// Convolves a block of a level's texels.
pub fn convolve(tree: *const Tree, lobe: Lobe, level: Level, column: usize, row: usize) void {
    var block: Block = .init(lobe, level, column, row);
    var stack: [stack_max]Place = undefined;
    for (tree.levels[0], 0..) |*root, index| {
        var count: usize = 0;
        var place: Place = .{
            .depth = 0,
            .column = @intCast(index % Tree.size_min),
            .row = @intCast(index / Tree.size_min),
        };
        var node = root;
        while (true) {
            const is_leaf = place.depth + 1 == tree.levels.len;
            if (block.meet(node, is_leaf)) {
                for (0..4) |part| {
                    stack[count] = .{
                        .depth = place.depth + 1,
                        .column = 2 * place.column + @as(u16, @intCast(part % 2)),
                        .row = 2 * place.row + @as(u16, @intCast(part / 2)),
                    };
                    count += 1;
                }
            }
            if (count == 0) break;
            count -= 1;
            place = stack[count];
            const size = @as(usize, Tree.size_min) << @intCast(place.depth);
            node = &tree.levels[place.depth][place.row * size + place.column];
        }
    }
    block.store(level, column, row);
}

const Place = struct { depth: u16, column: u16, row: u16 };
/// Each level leaves three brothers.
const stack_max = 3 * std.math.log2_int(u32, Tree.size_max / Tree.size_min) + 4;

/// The largest of the lanes. By halves: of `@reduce(.Max)` the x86 backend of debug builds makes
/// what an earlier vector left in a register.
inline fn largestLane(comptime count: comptime_int, lanes: @Vector(count, f32)) f32 {
    if (count == 1) return lanes[0];
    const half = count / 2;
    const all: [count]f32 = lanes;
    const low: @Vector(half, f32) = all[0..half].*;
    const high: @Vector(half, f32) = all[half..].*;
    return largestLane(half, @select(f32, low > high, low, high));
}

/// Directions under way.
const Block = struct {
    x: Lanes,
    y: Lanes,
    z: Lanes,
    weight: Lanes = @splat(0),
    sum: [3]Lanes = @splat(@splat(0)),
    /// GGX's alpha squared less 1; of the cosine null.
    alpha_term: ?f32,
    /// A node may be as wide as this much ...
    width_squared: f32,
    /// ... and so much of its distance.
    distance_factor: f32,

    fn init(lobe: Lobe, level: Level, column: usize, row: usize) Block {
        var directions: [3][lane_count]f32 = undefined;
        for (0..lane_count) |lane| {
            const point = level.pointAt(column + lane % block_width, row + lane / block_width);
            const direction = vec3.normalize(point).?;
            for (&directions, direction) |*axis, component| axis[lane] = component;
        }
        var block: Block = .{
            .x = directions[0],
            .y = directions[1],
            .z = directions[2],
            .alpha_term = null,
            .width_squared = cosine_width_squared,
            .distance_factor = 0,
        };
        switch (lobe) {
            .cosine => {},
            .ggx => |roughness| {
                const alpha = roughness * roughness;
                block.alpha_term = alpha * alpha - 1;
                block.width_squared = opening_squared * 4 * alpha * alpha;
                block.distance_factor = opening_squared;
            },
        }
        return block;
    }

    /// Adds a node; returns true where its children are to be met instead.
    inline fn meet(block: *Block, node: *const Node, is_leaf: bool) bool {
        const to = node.direction;
        const cosine = (block.x * splat(to[0]) + block.y * splat(to[1])) + block.z * splat(to[2]);
        const nearest = largestLane(lane_count, cosine);
        // A chord of the sphere is no longer than its arc, and a texel hardly longer than wide.
        if (nearest < 0 and nearest * nearest > 2 * node.solid_angle) return false;
        const distance_squared = 2 - 2 * nearest;
        const allowed = block.width_squared + block.distance_factor * distance_squared;
        if (!is_leaf and node.solid_angle > allowed) return true;
        const zero: Lanes = @splat(0);
        var weight = @select(f32, cosine > zero, cosine, zero);
        if (block.alpha_term) |term| {
            const half = (cosine + splat(1)) * splat(0.5 * term) + splat(1);
            weight /= half * half;
        }
        block.weight += weight * splat(node.solid_angle);
        inline for (&block.sum, node.energy) |*sum, energy| sum.* += weight * splat(energy);
        return false;
    }

    fn store(block: *const Block, level: Level, column: usize, row: usize) void {
        var means: [3][lane_count]f32 = undefined;
        for (&means, block.sum) |*mean, sum| mean.* = sum / block.weight;
        for (0..lane_count) |lane| {
            level.at(column + lane % block_width, row + lane / block_width).* = .{
                means[0][lane], means[1][lane], means[2][lane], 0,
            };
        }
    }

    inline fn splat(value: f32) Lanes {
        return @splat(value);
    }
};

test "a level has the bits that it has in every build and on every target" {
    var arena_state: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena_state.deinit();
    const arena = arena_state.allocator();
    const finest: Level = try .init(arena, Tree.size_min);
    for (0..finest.size) |row| for (0..finest.size) |column| {
        const value: f32 = @floatFromInt(1 + (7 * row + 3 * column) % 11);
        finest.at(column, row).* = .{ value, 2 * value, 3, 0 };
    };
    const pyramid = [_]Level{ try .init(arena, 16), finest };
    for (0..16) |row| for (0..16) |column| {
        pyramid[0].at(column, row).* = finest.at(column / 2, row / 2).*;
    };
    const tree: Tree = try .init(arena, &pyramid);
    const Case = struct { Lobe, [4]u32 };
    for ([_]Case{
        .{ .cosine, .{ 0x40bb2b18, 0x40c047c8, 0x40c4b0b7, 0x40c7615e } },
        .{ .{ .ggx = 0.125 }, .{ 0x3fd25f9e, 0x4088493b, 0x40df0c01, 0x411a0aa7 } },
        .{ .{ .ggx = 0.5 }, .{ 0x40a38967, 0x40bb5c08, 0x40d4fab6, 0x40d368b4 } },
    }) |case| {
        const level: Level = try .init(arena, 8);
        convolve(&tree, case[0], level, 4, 2);
        var bits: [4]u32 = undefined;
        for (&bits, 4..) |*to, column| to.* = @bitCast(level.at(column, 3).*[0]);
        try std.testing.expectEqual(case[1], bits);
    }
}
