//! Invariants of a world, asserted: what `world.zig` promises to those who trace it.
//!
//! In: a world. Out: nothing, or a failed assertion. For tests and debug builds: it visits every
//! node and triangle.

const std = @import("std");
const world = @import("../../world.zig");
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;
const math = @import("../../math.zig");
const Box3 = math.Box3;
const Vec3 = math.Vec3;
const World = world.World;

/// Asserts that every triangle that is not dropped lies in one lane of one pack below one leaf,
/// within all boxes above it, which are no larger than they have to be; that padding lanes are
/// empty; that every node and pack is reached once; and that the tree is no deeper than it says.
pub fn check(gpa: Allocator, checked: *const World) error{OutOfMemory}!void {
    const vertex_count = checked.geometry.positions.len;
    assert(checked.geometry.normals.len == vertex_count);
    assert(checked.geometry.colors.len == 0 or checked.geometry.colors.len == vertex_count);
    assert(checked.view.width > 0 and checked.view.height > 0);
    var dropped_count: usize = 0;
    for (checked.geometry.triangles) |triangle| {
        dropped_count += @intFromBool(triangle.isDropped());
        assert(triangle.isDropped() or triangle.material < checked.materials.all.len);
        for (triangle.corner) |vertex| assert(vertex < vertex_count);
    }
    assert(dropped_count == checked.geometry.dropped_count);
    switch (checked.geometry.tree) {
        inline else => |*tree| try checkTree(gpa, checked, tree),
    }
}

fn checkTree(gpa: Allocator, checked: *const World, tree: anytype) error{OutOfMemory}!void {
    const Visit = struct { node: u32, depth: u32, box: ?Box3 };
    const seen = try gpa.alloc(bool, checked.geometry.triangles.len);
    defer gpa.free(seen);
    @memset(seen, false);
    var stack: std.ArrayList(Visit) = .empty;
    defer stack.deinit(gpa);
    try stack.append(gpa, .{ .node = 0, .depth = 1, .box = null });
    var node_count: usize = 0;
    var pack_count: usize = 0;
    var depth: u32 = 0;
    while (stack.pop()) |visit| {
        node_count += 1;
        if (tree.packs.len > 0) depth = @max(depth, visit.depth);
        const node = &tree.nodes[visit.node];
        var joined: Box3 = .empty;
        for (node.child, 0..) |child, index| {
            const box = node.childBox(index);
            joined = joined.join(box);
            if (child == world.Child.missing) {
                assert(box.isEmpty());
            } else if (child.pack_count == 0) {
                const below = visit.depth + 1;
                try stack.append(gpa, .{ .node = child.target, .depth = below, .box = box });
            } else {
                pack_count += child.pack_count;
                const first, const end = child.packs();
                checkLeaf(checked, tree.packs[first..end], box, seen);
            }
        }
        // Boxes are unions, grown once: by no more than their own margin.
        if (visit.box) |box| {
            assert(box.isEmpty() == joined.isEmpty());
            if (box.isEmpty()) continue;
            const margin = checked.geometry.padding.marginOfBox(box);
            assert(box.contains(joined) and joined.grow(margin).contains(box));
        }
    }
    for (seen, checked.geometry.triangles) |is_seen, triangle| {
        assert(is_seen != triangle.isDropped());
    }
    assert(node_count == tree.nodes.len and node_count == checked.facts.tree.node_count);
    assert(pack_count == tree.packs.len);
    assert(depth == checked.facts.tree.depth and depth <= world.tree_depth_max);
    assert(checked.facts.tree.bytes >= std.mem.sliceAsBytes(tree.packs).len);
}

fn checkLeaf(checked: *const World, packs: anytype, box: Box3, seen: []bool) void {
    var joined: Box3 = .empty;
    for (packs) |*pack| {
        for (pack.primitive, 0..) |primitive, lane| {
            var corners: Box3 = .empty;
            for (&pack.corner, 0..) |*corner, corner_index| {
                const position: Vec3 = .{ corner[0][lane], corner[1][lane], corner[2][lane] };
                if (primitive == world.none) {
                    for (position) |coordinate| assert(coordinate == 0);
                    continue;
                }
                const vertex = checked.geometry.triangles[primitive].corner[corner_index];
                for (position, checked.geometry.positions[vertex]) |a, b| assert(a == b);
                corners = corners.include(position);
            }
            if (primitive == world.none) continue;
            assert(!seen[primitive]);
            seen[primitive] = true;
            joined = joined.join(corners.grow(checked.geometry.padding.ofBox(corners)));
        }
    }
    // All of its triangles may have been dropped since it was built.
    assert(box.isEmpty() == joined.isEmpty());
    if (box.isEmpty()) return;
    const grown = joined.grow(checked.geometry.padding.marginOfBox(joined));
    assert(box.contains(grown) and grown.contains(box));
}
