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
    checkNumbers(&checked.geometry);
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

/// Runs follow each other without gaps.
fn checkNumbers(geometry: *const world.Geometry) void {
    var primitive_next: u32 = 0;
    var vertex_next: u32 = 0;
    for (geometry.shared.runs, 0..) |run, index| {
        assert(run.primitive_first == primitive_next and run.vertex_first == vertex_next);
        if (run.instance == world.none) {
            const is_last = index + 1 == geometry.shared.runs.len;
            const shared = &geometry.shared;
            primitive_next = if (is_last)
                shared.primitive_count
            else
                shared.runs[index + 1].primitive_first;
            vertex_next = if (is_last) shared.vertex_count else shared.runs[index + 1].vertex_first;
            continue;
        }
        const instance = &geometry.shared.instances[run.instance];
        const mesh = &geometry.shared.meshes[instance.mesh];
        assert(instance.primitive_first == primitive_next);
        primitive_next += @intCast(mesh.triangles.len);
        vertex_next += @intCast(mesh.positions.len);
    }
    assert(primitive_next == geometry.shared.primitive_count);
    assert(vertex_next == geometry.shared.vertex_count);
}

fn checkTree(gpa: Allocator, checked: *const World, tree: anytype) error{OutOfMemory}!void {
    const Visit = struct { node: u32, depth: u32, box: ?Box3 };
    const width = @typeInfo(@TypeOf(tree.nodes[0].child)).array.len;
    const mapped = try gpa.create(world.instances.MappedCluster(width));
    defer gpa.destroy(mapped);
    const seen = try gpa.alloc(bool, checked.geometry.triangleCount());
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
        if (tree.packs.len > 0 or checked.geometry.shared.runs.len > 0)
            depth = @max(depth, visit.depth);
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
            } else if (child.isCluster()) {
                mapped.fill(&checked.geometry, child.target);
                checkCluster(checked, mapped, box, seen);
            } else {
                pack_count += child.pack_count;
                const first, const end = child.packs();
                checkLeaf(checked, tree.packs[first..end], box, seen);
            }
        }
        // Boxes are unions, grown once: by no more than their own margin.
        const is_joined = checked.geometry.shared.runs.len > 0;
        if (visit.box) |box| if (is_joined) assert(box.contains(joined)) else {
            assert(box.isEmpty() == joined.isEmpty());
            if (box.isEmpty()) continue;
            const margin = checked.geometry.padding.marginOfBox(box);
            assert(box.contains(joined) and joined.grow(margin).contains(box));
        };
    }
    for (seen, 0..) |is_seen, number| {
        assert(is_seen != (checked.geometry.face(@intCast(number)).material == world.none));
    }
    assert(node_count == tree.nodes.len and node_count == checked.facts.tree.node_count);
    assert(pack_count == tree.packs.len);
    assert(depth == checked.facts.tree.depth and depth <= world.walk_depth_max);
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
                const face = checked.geometry.face(primitive);
                const placed = face.position(&checked.geometry, corner_index);
                for (position, placed) |a, b| assert(a == b);
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

/// The tree of a mapped cluster, all of which lies within the box above.
fn checkCluster(checked: *const World, mapped: anytype, box: Box3, seen: []bool) void {
    const tree = mapped.tree();
    var waiting: [mapped.nodes.len]u32 = undefined;
    waiting[0] = 0;
    var count: usize = 1;
    var pack_count: usize = 0;
    while (count > 0) {
        count -= 1;
        const node = &tree.nodes[waiting[count]];
        for (node.child, 0..) |child, index| {
            if (child == world.Child.missing) continue;
            assert(box.contains(node.childBox(index)));
            if (child.pack_count == 0) {
                waiting[count] = child.target;
                count += 1;
            } else {
                pack_count += child.pack_count;
                const first, const end = child.packs();
                checkLeaf(checked, tree.packs[first..end], node.childBox(index), seen);
            }
        }
    }
    assert(pack_count == mapped.pack_count);
}
