//! Clusters: the tree of a shared mesh cut into parts that are mapped as a whole.
//!
//! In: a wide tree in the mesh's space, as `wide.zig` lays it out. Out: its largest subtrees that
//! fit, and the leaves that hang above them. What is below a node follows in one stretch, nodes and
//! packs alike.

const std = @import("std");
const world = @import("../../world.zig");
const instances = world.instances;
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;
const Cluster = instances.Cluster;

/// What is below a node, itself left out of the nodes.
const Extent = struct {
    node_first: u32 = world.none,
    node_count: u32 = 0,
    pack_first: u32 = world.none,
    pack_count: u32 = 0,

    fn add(extent: *Extent, other: *const Extent) void {
        extent.node_first = @min(extent.node_first, other.node_first);
        extent.node_count += other.node_count;
        extent.pack_first = @min(extent.pack_first, other.pack_first);
        extent.pack_count += other.pack_count;
    }
};

/// Cuts a tree with at least one triangle, in the order of its nodes.
pub fn cut(
    gpa: Allocator,
    arena: Allocator,
    comptime width: u32,
    tree: *const world.Tree(width),
) error{OutOfMemory}![]const Cluster {
    const extents = try gpa.alloc(Extent, tree.nodes.len);
    defer gpa.free(extents);
    const is_inside = try gpa.alloc(bool, tree.nodes.len);
    defer gpa.free(is_inside);
    measure(width, tree, extents);
    var clusters: std.ArrayList(Cluster) = .empty;
    defer clusters.deinit(gpa);
    is_inside[0] = false;
    // Parents come before their children.
    for (tree.nodes, extents, is_inside, 0..) |*node, *extent, inside, index| {
        const fits = extent.pack_count <= instances.clusterPacksMax(width) and
            extent.node_count + 1 <= instances.clusterNodesMax(width);
        if (fits and !inside) try clusters.append(gpa, .{
            .root = @intCast(index),
            .node_first = extent.node_first,
            .node_count = extent.node_count,
            .pack_first = extent.pack_first,
            .pack_count = extent.pack_count,
        });
        for (node.child) |child| {
            if (child == world.Child.missing) continue;
            if (child.pack_count == 0) {
                assert(child.target > index);
                is_inside[child.target] = inside or fits;
            } else if (!inside and !fits) try addLeaf(gpa, width, child, &clusters);
        }
    }
    return arena.dupe(Cluster, clusters.items);
}

fn measure(comptime width: u32, tree: *const world.Tree(width), extents: []Extent) void {
    var index = tree.nodes.len;
    while (index > 0) {
        index -= 1;
        var extent: Extent = .{};
        for (tree.nodes[index].child) |child| {
            if (child == world.Child.missing) continue;
            if (child.pack_count > 0) {
                extent.add(&.{ .pack_first = child.target, .pack_count = child.pack_count });
            } else {
                extent.add(&.{ .node_first = child.target, .node_count = 1 });
                extent.add(&extents[child.target]);
            }
        }
        extents[index] = extent;
    }
}

/// A leaf as one cluster, or as several where it has many packs.
fn addLeaf(
    gpa: Allocator,
    comptime width: u32,
    leaf: world.Child,
    clusters: *std.ArrayList(Cluster),
) error{OutOfMemory}!void {
    const first, const end = leaf.packs();
    var at = first;
    while (at < end) : (at += instances.clusterPacksMax(width)) try clusters.append(gpa, .{
        .root = world.none,
        .node_first = world.none,
        .node_count = 0,
        .pack_first = @intCast(at),
        .pack_count = @intCast(@min(end - at, instances.clusterPacksMax(width))),
    });
}
