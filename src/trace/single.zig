//! One ray through the tree: against all boxes of a node at once, then all triangles of a block.
//!
//! In: a ray by itself. Out: its nearest hit, or whether there is any. SIMD runs across the tree,
//! so that a ray gains from lanes without company. Which hit wins does not depend on the order of
//! the visits (ray.zig), nor does culling change it (box.zig).

const std = @import("std");
const world_file = @import("../world.zig");
const TestCounts = @import("../statistics.zig").TestCounts;
const ray_file = @import("ray.zig");
const box = @import("box.zig");
const triangle = @import("triangle.zig");
const stack_file = @import("stack.zig");
const assert = std.debug.assert;
const Entry = stack_file.Entry;
const Single = ray_file.Single;

/// What a ray wants to know.
pub const Query = enum {
    /// The first hit in the order of `ray.Hit`.
    nearest,
    /// Whether there is a hit; which one is found depends on the tree.
    any,
};

/// The nearest hit so far, and what the tree holds of the ray in the lanes of boxes.
fn Search(comptime Kernel: type) type {
    const Boxes = Kernel.Boxes;
    return struct {
        slabs: ray_file.Slabs(Boxes),
        view: ray_file.View(Boxes),
        /// The ray's longest axis.
        axis: u2,
        after: ray_file.Hit(Boxes),
        skip: Boxes.I32,
        nearest_t: f32,
        nearest_primitive: i32,
        /// Index of the near face in `Node.bounds`, by axis.
        near_side: [3]u1,
        pad: f32,
    };
}

/// Looks for a hit and keeps it in `ray.nearest`. Returns whether there was one.
pub fn trace(
    comptime Kernel: type,
    comptime query: Query,
    tree: *const world_file.Tree(Kernel.width),
    pad: f32,
    ray: *ray_file.Ray(Single),
    counts: *TestCounts,
) bool {
    var search = begin(Kernel, ray, pad);
    var stack: [Kernel.stack_max]Entry = undefined;
    stack[0] = .{ .child = 0, .block_count = 0, .near = 0 };
    var stack_count: usize = 1;
    var found = false;
    while (stack_count > 0) {
        stack_count -= 1;
        const entry = stack[stack_count];
        if (entry.near > search.nearest_t) continue;
        if (entry.block_count == 0) {
            assert(stack_count + Kernel.width <= Kernel.stack_max);
            const node = &tree.nodes[entry.child];
            stack_count = pushChildren(Kernel, &search, node, &stack, stack_count, counts);
        } else {
            const blocks = tree.blocks[entry.child..][0..entry.block_count];
            for (blocks) |*block| found = intersect(Kernel, &search, block, counts) or found;
            if (query == .any and found) break;
        }
    }
    ray.nearest = .{
        .t = .splat(search.nearest_t),
        .primitive = .splat(search.nearest_primitive),
    };
    return found;
}

inline fn begin(comptime Kernel: type, ray: *const ray_file.Ray(Single), pad: f32) Search(Kernel) {
    const Boxes = Kernel.Boxes;
    const spread = struct {
        inline fn vec3(v: Single.Vec3) Boxes.Vec3 {
            return .splat(v.lane(0));
        }
    };
    const slabs: ray_file.Slabs(Single) = .init(ray.line);
    var near_side: [3]u1 = undefined;
    var negative: [3]Boxes.Mask = undefined;
    for (0..3) |axis| {
        const down = slabs.negative[axis].lane(0);
        near_side[axis] = @intFromBool(down);
        negative[axis] = .splat(down);
    }
    const axis: ray_file.LongAxis(Single) = .of(ray.line.direction);
    const view: ray_file.View(Single) = .init(ray.line, axis);
    var view_negative: [3]Boxes.Mask = undefined;
    for (&view_negative, view.negative) |*spreaded, mask| spreaded.* = .splat(mask.lane(0));
    return .{
        .slabs = .{
            .origin = spread.vec3(slabs.origin),
            .direction_inv = spread.vec3(slabs.direction_inv),
            .negative = negative,
        },
        .view = .{
            .origin = spread.vec3(view.origin),
            .direction_inv = spread.vec3(view.direction_inv),
            .negative = view_negative,
            .shear = spread.vec3(view.shear),
        },
        .axis = axis.uniform(.splat(true)).?,
        .after = .{
            .t = .splat(ray.after.t.lane(0)),
            .primitive = .splat(ray.after.primitive.lane(0)),
        },
        .skip = .splat(ray.skip.lane(0)),
        .nearest_t = ray.nearest.t.lane(0),
        .nearest_primitive = ray.nearest.primitive.lane(0),
        .near_side = near_side,
        .pad = pad,
    };
}

/// Pushes the children that may hold a hit, the nearest on top. Returns the new stack count.
inline fn pushChildren(
    comptime Kernel: type,
    search: *const Search(Kernel),
    node: *const world_file.Node(Kernel.width),
    stack: []Entry,
    stack_count_before: usize,
    counts: *TestCounts,
) usize {
    const Boxes = Kernel.Boxes;
    const near_side = search.near_side;
    const near: Boxes.Vec3 = .{
        .x = .load(&node.bounds[near_side[0]][0]),
        .y = .load(&node.bounds[near_side[1]][1]),
        .z = .load(&node.bounds[near_side[2]][2]),
    };
    const far: Boxes.Vec3 = .{
        .x = .load(&node.bounds[1 - near_side[0]][0]),
        .y = .load(&node.bounds[1 - near_side[1]][1]),
        .z = .load(&node.bounds[1 - near_side[2]][2]),
    };
    const range = box.slab(Boxes, near, far, search.slabs.origin, search.slabs.direction_inv);
    const hits = box.mayHold(Boxes, range, search.after.t, .splat(search.nearest_t));
    if (Kernel.counts_tests) {
        counts.box_issued += Kernel.width;
        for (node.child) |child| counts.box_useful += @intFromBool(child != world_file.none);
    }
    return stack_file.push(Boxes, node, hits.bits(), range.near, stack, stack_count_before);
}

/// Tests the triangles of a block and keeps the nearest hit. Returns whether there was one.
inline fn intersect(
    comptime Kernel: type,
    search: *Search(Kernel),
    block: *const world_file.TriangleBlock(Kernel.width),
    counts: *TestCounts,
) bool {
    const Boxes = Kernel.Boxes;
    const corners = loadCorners(Boxes, block, search.axis);
    if (Kernel.counts_tests) countBlock(Kernel, block, counts);
    const seen = triangle.project(Boxes, corners, &search.view);
    var weights = triangle.weigh(Boxes, seen);
    const agreeing = weights.agree();
    if (agreeing.none()) return false;
    const inside = triangle.settle(Boxes, seen, &weights, agreeing);
    const hit = triangle.locate(Boxes, seen, weights, corners, &search.view, search.pad);
    const primitive: Boxes.I32 = .load(@ptrCast(&block.primitive));
    const nearest: ray_file.Hit(Boxes) = .{
        .t = .splat(search.nearest_t),
        .primitive = .splat(search.nearest_primitive),
    };
    const accepted = inside.bitAnd(hit.mask)
        .bitAnd(search.after.isBefore(hit.t, primitive))
        .bitAnd(nearest.isAfter(hit.t, primitive))
        .andNot(primitive.eq(search.skip));
    var bits = accepted.bits();
    if (bits == 0) return false;
    const ts = hit.t.toArray();
    while (bits != 0) : (bits &= bits - 1) {
        const lane = @ctz(bits);
        const number: i32 = @bitCast(block.primitive[lane]);
        const closer = ts[lane] < search.nearest_t or
            (ts[lane] == search.nearest_t and number < search.nearest_primitive);
        if (closer) {
            search.nearest_t = ts[lane];
            search.nearest_primitive = number;
        }
    }
    return true;
}

/// The corners of a block's triangles in lanes, turned so that `axis` is z.
inline fn loadCorners(comptime Boxes: type, block: anytype, axis: u2) [3]Boxes.Vec3 {
    var corners: [3]Boxes.Vec3 = undefined;
    inline for (&corners, &block.corner) |*corner, *components| {
        corner.* = .{
            .x = .load(&components[ray_file.turnedIndex(axis, 0)]),
            .y = .load(&components[ray_file.turnedIndex(axis, 1)]),
            .z = .load(&components[axis]),
        };
    }
    return corners;
}

fn countBlock(comptime Kernel: type, block: anytype, counts: *TestCounts) void {
    counts.triangle_issued += Kernel.width;
    for (block.primitive) |primitive| {
        counts.triangle_useful += @intFromBool(primitive != world_file.none);
    }
}
