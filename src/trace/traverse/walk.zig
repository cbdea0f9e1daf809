//! Depth-first, front-to-back traversal of the wide BVH, generic over what is searched for.
//!
//! Where it comes to a cluster of an instance, the same loop goes on in the small tree that the
//! cluster is mapped to (world/instances.zig), until nothing of that is left on the stack.
//!
//! In: a search, which knows what it looks for (a ray: single.zig; rays in lanes: bundle.zig; a
//! packet: interval_packet.zig; a beam: beam/traverse.zig). Out: whether it found anything. The
//! hits are the search's own.

const std = @import("std");
const world_file = @import("../../world.zig");
const TestCounts = @import("../../statistics.zig").TestCounts;
const stack_file = @import("stack.zig");
const assert = std.debug.assert;
const Entry = stack_file.Entry;

/// What rays want to know.
pub const Query = enum {
    /// The first hit in the order of `ray.Hit`.
    closest_hit,
    /// Whether there is a hit; which one is found depends on the tree.
    any_hit,
    /// The first few hits in that order, unless something stops the ray: multi_hit.zig.
    multi_hit,
};

/// Searches the whole tree, or until `search.isDone()`. Of a search it needs
///
///     limit: f32                nothing that is farther matters; it may shrink
///     meet(node, counts)        box.Range in lanes of children, `isMet` where one may matter
///     intersect(pack, counts)  tests a pack of triangles, returns whether one was hit
///     isDone(found)             asked after every leaf
///     allows(pack_count, stack_count)
///                               if there is one, asked before every leaf; the end where it says no
pub inline fn walk(
    comptime Kernel: type,
    geometry: *const world_file.Geometry,
    search: anytype,
    counts: *TestCounts,
) bool {
    return walkTree(Kernel, geometry, geometry.tree.get(Kernel.width).*, search, counts);
}

/// The same in a tree of its own, such as that of a cluster.
pub inline fn walkTree(
    comptime Kernel: type,
    geometry: *const world_file.Geometry,
    whole: world_file.Tree(Kernel.width),
    search: anytype,
    counts: *TestCounts,
) bool {
    var stack: [Kernel.stack_max]Entry = undefined;
    var stack_count: usize = 0;
    var found = false;
    var entry: Entry = .whole;
    var tree = whole;
    while (true) {
        if (entry.child.pack_count == 0) {
            assert(stack_count + Kernel.width <= Kernel.stack_max);
            const node = &tree.nodes[entry.child.target];
            const range = search.meet(node, counts);
            const met = range.isMet().bits();
            if (met != 0) {
                entry = stack_file.descend(Kernel.Boxes, node, range, met, &stack, &stack_count);
                continue;
            }
        } else if (!entry.child.hasPacks()) {
            @branchHint(.unlikely);
            if (entry.child.isCluster()) {
                stack[stack_count] = .{ .child = .cluster_end, .near = -std.math.inf(f32) };
                stack_count += 1;
                tree = clusterOf(Kernel, geometry, entry.child.target).tree();
                entry = .whole;
                continue;
            }
            tree = whole;
        } else {
            if (@hasDecl(@TypeOf(search.*), "allows") and
                !search.allows(entry.child.pack_count, stack_count)) break;
            const first, const end = entry.child.packs();
            for (tree.packs[first..end]) |*pack| {
                found = search.intersect(pack, counts) or found;
            }
            if (search.isDone(found)) break;
        }
        entry = while (stack_count > 0) {
            stack_count -= 1;
            const top = stack[stack_count];
            if (top.near <= search.limit) break top;
        } else break;
    }
    return found;
}

/// A cluster of an instance, mapped; valid until the next is asked for.
pub noinline fn clusterOf(
    comptime Kernel: type,
    geometry: *const world_file.Geometry,
    reference: u32,
) *const world_file.instances.MappedCluster(Kernel.width) {
    const Cache = world_file.instances.ClusterCache(Kernel.width);
    const cache: *const Cache = @ptrCast(@alignCast(geometry.cluster_cache.?));
    return cache.get(geometry, reference);
}

/// Counts the test of a ray against the children of a node.
pub fn countNode(comptime Kernel: type, node: anytype, counts: *TestCounts) void {
    if (!Kernel.counts_tests) return;
    counts.box_issued += Kernel.width;
    for (node.child) |child| counts.box_useful += @intFromBool(child != world_file.Child.missing);
}

/// Counts the test of a ray against the triangles of a pack.
pub fn countPack(comptime Kernel: type, pack: anytype, counts: *TestCounts) void {
    if (!Kernel.counts_tests) return;
    counts.triangle_issued += Kernel.width;
    for (pack.primitive) |primitive| {
        counts.triangle_useful += @intFromBool(primitive != world_file.none);
    }
}
