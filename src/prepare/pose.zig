//! Where the nodes of a scene are in the world.
//!
//! In: the nodes with their maps into the parent's space, parents first. Out: one map into world
//! space each. A map may overflow to infinity or NaN; who uses it looks.

const std = @import("std");
const math = @import("../math.zig");
const scene = @import("../scene.zig");
const assert = std.debug.assert;
const Affine = math.Affine;

/// The map into world space of every node, in the order of `nodes`; the caller frees it. Asserts
/// that every parent stands before its children.
pub fn worldMaps(
    gpa: std.mem.Allocator,
    nodes: []const scene.Node,
) error{OutOfMemory}![]Affine {
    const maps = try gpa.alloc(Affine, nodes.len);
    for (nodes, maps, 0..) |node, *map, index| {
        if (node.parent == scene.none) {
            map.* = node.local;
        } else {
            assert(node.parent < index);
            map.* = .compose(maps[node.parent], node.local);
        }
    }
    return maps;
}

test "a child moves with its parent" {
    const nodes = [_]scene.Node{
        .{ .parent = scene.none, .local = .fromTrs(.{ 1, 0, 0 }, .{ 0, 0, 0, 1 }, .{ 2, 2, 2 }) },
        .{ .parent = 0, .local = .fromTrs(.{ 0, 3, 0 }, .{ 0, 0, 0, 1 }, .{ 1, 1, -1 }) },
        .{ .parent = scene.none, .local = .identity },
        .{ .parent = 1, .local = .identity },
    };
    const maps = try worldMaps(std.testing.allocator, &nodes);
    defer std.testing.allocator.free(maps);
    try std.testing.expectEqual(math.Vec3{ 3, 8, -8 }, maps[3].point(.{ 1, 1, 4 }));
    try std.testing.expectEqual(Affine.identity, maps[2]);
}

test "no nodes, no maps" {
    const maps = try worldMaps(std.testing.allocator, &.{});
    defer std.testing.allocator.free(maps);
    try std.testing.expectEqual(0, maps.len);
}
