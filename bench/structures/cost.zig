//! What the builders of both trees share: references to triangles, blocks of them, costs.
//!
//! In: a world without regard to its own tree. Out: references with boxes as the tracer culls by
//! them, so that a tree over these boxes loses no hit.

const std = @import("std");
const raylane = @import("raylane");
const Allocator = std.mem.Allocator;
const Box3 = raylane.math.Box3;
const World = raylane.world.World;

/// Lanes of all trees here.
pub const width = 4;
pub const Block = raylane.world.TrianglePack(width);

/// Cost of going on from a node to a child, and of testing a block of triangles: as instructions
/// on NEON have it, about one to two.
pub const node_cost: f32 = 1;
pub const block_cost: f32 = 2;

/// A triangle by its number, within its box.
pub const Reference = struct { box: Box3, number: u32 };

/// All triangles of a world that are in its tree, within their boxes grown as nodes are.
pub fn references(arena: Allocator, world: *const World) error{OutOfMemory}![]Reference {
    const geometry = &world.geometry;
    var list: std.ArrayList(Reference) =
        try .initCapacity(arena, geometry.triangles.len - geometry.dropped_count);
    for (geometry.triangles, 0..) |triangle, number| {
        if (triangle.isDropped()) continue;
        var box: Box3 = .empty;
        for (triangle.corner) |corner| box = box.include(geometry.positions[corner]);
        const padding = &geometry.padding;
        const padded = box.grow(padding.ofBox(box));
        const grown = padded.grow(padding.marginOfBox(padded));
        list.appendAssumeCapacity(.{ .box = grown, .number = @intCast(number) });
    }
    return list.items;
}

/// The box of all references.
pub fn boundsOf(list: []const Reference) Box3 {
    var box: Box3 = .empty;
    for (list) |reference| box = box.join(reference.box);
    return box;
}

/// Cost of testing so many triangles.
pub fn leafCost(count: usize) f32 {
    const pack_count: f32 = @floatFromInt((count + width - 1) / width);
    return block_cost * pack_count;
}

/// Appends the triangles of references as blocks; returns how many.
pub fn appendBlocks(
    arena: Allocator,
    blocks: *std.ArrayList(Block),
    world: *const World,
    list: []const Reference,
) error{OutOfMemory}!u32 {
    const first = blocks.items.len;
    for (list, 0..) |reference, index| {
        const lane = index % width;
        if (lane == 0) try blocks.append(arena, .empty);
        const block = &blocks.items[blocks.items.len - 1];
        block.primitive[lane] = reference.number;
        for (world.geometry.triangles[reference.number].corner, 0..) |corner, place| {
            const position = world.geometry.positions[corner];
            for (0..3) |axis| block.corner[place][axis][lane] = position[axis];
        }
    }
    return @intCast(blocks.items.len - first);
}
