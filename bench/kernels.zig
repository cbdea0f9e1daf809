//! The innermost work of tracing, a function each, so that kernels.py can estimate what a processor
//! makes of it.
//!
//! In: the module `choice`, which names backend and lanes. Out: an object with functions without
//! loops or calls: one ray against the boxes of a node, against the triangles of a block as far as
//! most blocks come, and on to where they are hit. They are made of the tracer's own parts.

const raylane = @import("raylane");
const choice = @import("choice");
const triangle = raylane.trace.triangle;
const world = raylane.world;

const Kernel = raylane.trace.kernel.Kernel(.{
    .backend = choice.backend,
    .traversal = .single,
    .lanes = choice.lanes,
}, false);
const Boxes = Kernel.Boxes;
const Node = world.Node(Kernel.width);
const Block = world.TrianglePack(Kernel.width);
const Search = raylane.trace.single.Search(Kernel, .closest_hit, true);
const View = raylane.trace.ray.ShearedRay(Boxes);

const Ranges = extern struct { near: [Kernel.width]f32, far: [Kernel.width]f32 };

/// Where a ray is within the boxes of a node and its own limits.
fn boxTest(search: *const Search, node: *const Node, ranges: *Ranges) callconv(.c) void {
    var counts: raylane.statistics.TestCounts = .{};
    const range = search.meet(node, &counts);
    ranges.near = range.near.toArray();
    ranges.far = range.far.toArray();
}

inline fn seenBy(view: *const View, block: *const Block) triangle.Projection(Boxes) {
    return triangle.project(Boxes, cornersOf(block), view);
}

/// For a ray whose longest axis is z.
inline fn cornersOf(block: *const Block) [3]Boxes.Vec3 {
    var corners: [3]Boxes.Vec3 = undefined;
    inline for (&corners, &block.corner) |*corner, *components| corner.* = .{
        .x = .load(&components[0]),
        .y = .load(&components[1]),
        .z = .load(&components[2]),
    };
    return corners;
}

/// Whether any triangle of a block may be hit: where most blocks are left.
fn triangleCull(view: *const View, block: *const Block) callconv(.c) bool {
    return triangle.edgeFunctions(Boxes, seenBy(view, block)).mayAgree().none();
}

/// Where the triangles of a block are hit, a bit each; without the rare exact settling of zeros.
fn triangleHit(
    view: *const View,
    block: *const Block,
    padding: *const raylane.world.Padding,
    t: *[Kernel.width]f32,
) callconv(.c) u32 {
    const seen = seenBy(view, block);
    const weights = triangle.edgeFunctions(Boxes, seen);
    const hit = triangle.locate(
        Boxes,
        seen,
        weights,
        cornersOf(block),
        view,
        padding,
        .splat(padding.center),
    );
    t.* = hit.t.toArray();
    return weights.agree().bitAnd(hit.mask).bits();
}

comptime {
    @export(&boxTest, .{ .name = "Kernel.boxTest" });
    @export(&triangleCull, .{ .name = "Kernel.triangleCull" });
    @export(&triangleHit, .{ .name = "Kernel.triangleHit" });
}
