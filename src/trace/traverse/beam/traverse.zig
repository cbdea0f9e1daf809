//! Beam tracing (Heckbert and Hanrahan 1984, "Beam Tracing Polygonal Objects") of a set of rays by
//! hierarchical rasterisation: the tree is travelled once for all of them, front to back.
//!
//! In: a set of rays from the eye (eye_rays.zig) or from a light (shadow_receivers.zig). Out: the
//! closest hit of each, or whether there is any, kept by the set. Triangles are set up in lanes,
//! one from each (Olano and Greer 1997, "Triangle Scan Conversion using 2D Homogeneous
//! Coordinates"): their edge functions and nearness are linear in the two numbers that give a ray
//! (projected_triangle.zig). Those that no ray of the set may see go; the others are stepped over
//! the rays (rasterise.zig).

const std = @import("std");
const world_file = @import("../../../world.zig");
const TestCounts = @import("../../../statistics.zig").TestCounts;
const ray_file = @import("../ray.zig");
const walk = @import("../walk.zig");
const exact = @import("exact.zig");
const frustum_file = @import("frustum.zig");
const rasterise = @import("rasterise.zig");
const Budget = @import("budget.zig").Budget;
const Coverage = rasterise.Coverage;
const Linear = @import("projected_triangle.zig").Linear;

/// Traces a set of rays through the whole tree. Returns false where the budget is spent before.
pub fn trace(comptime Kernel: type, set: anytype, budget: Budget, counts: *TestCounts) bool {
    var search: Search(Kernel, @TypeOf(set.*)) = .{
        .set = set,
        .tree = set.geometry.tree.get(Kernel.width),
        .budget = budget,
        .limit = set.depthMax(),
    };
    _ = walk.walk(Kernel, set.geometry, &search, counts);
    return search.is_within_budget;
}

fn Search(comptime Kernel: type, comptime Set: type) type {
    const Boxes = Kernel.Boxes;
    const Node = world_file.Node(Kernel.width);
    const Pack = world_file.TrianglePack(Kernel.width);
    return struct {
        set: *Set,
        tree: *const world_file.Tree(Kernel.width),
        budget: Budget,
        is_within_budget: bool = true,
        /// The depth beyond which nothing can be seen any more.
        limit: f32,

        const Self = @This();

        pub inline fn meet(
            search: *const Self,
            node: *const Node,
            counts: *TestCounts,
        ) frustum_file.Met(Boxes) {
            walk.countNode(Kernel, node, counts);
            return search.set.frustum.meet(node, search.limit);
        }

        pub inline fn allows(search: *Self, pack_count: u32, waiting_count: usize) bool {
            search.is_within_budget = search.budget.allows(pack_count, waiting_count);
            return search.is_within_budget;
        }

        pub inline fn intersect(search: *const Self, pack: *const Pack, counts: *TestCounts) bool {
            walk.countPack(Kernel, pack, counts);
            draw(Kernel, search.set, pack, exact.firstSlot(Kernel.width, search.tree, pack));
            return false;
        }

        pub inline fn isDone(search: *Self, _: bool) bool {
            search.limit = search.set.depthMax();
            return search.set.isDone();
        }
    };
}

/// Sets up the triangles of a pack and goes on with those that the beam may see.
inline fn draw(
    comptime Kernel: type,
    set: anytype,
    pack: *const world_file.TrianglePack(Kernel.width),
    first: exact.Slot,
) void {
    @setEvalBranchQuota(4000); // For what is inlined here.
    const Boxes = Kernel.Boxes;
    const F32 = Boxes.F32;
    const Set = @TypeOf(set.*);
    var corners: [3]Boxes.Vec3 = undefined;
    inline for (&corners, &pack.corner) |*corner, *components| corner.* = .{
        .x = .load(&components[0]),
        .y = .load(&components[1]),
        .z = .load(&components[2]),
    };
    const primitive: Boxes.I32 = .load(@ptrCast(&pack.primitive));
    var there = primitive.gt(.splat(ray_file.no_primitive)).bitAnd(set.frustum.mayMeet(corners));
    if (there.none()) return;
    const triangle = set.projection.project(Boxes, corners);
    // Upper bounds from here on.
    var form: [4]Linear(F32) = triangle.edge ++ .{undefined};
    var along: [3]Linear(F32) = undefined;
    var least: F32 = .splat(std.math.inf(f32));
    inline for (&along, form[0..3]) |*axes, *edge| {
        edge.one = edge.one.add(triangle.slack);
        axes.* = set.inAxes(Boxes, edge);
        least = least.minOrNegative(set.greatest(Boxes, axes));
    }
    there = there.andNot(triangle.facet.turned.bitAnd(least.isNegative()));
    if (there.none()) return;
    const nearness = set.projection.nearness(Boxes, &triangle.facet);
    const growth = F32.splat(1).add(nearness.relative);
    form[3] = .{
        .u = nearness.form.u.mul(growth),
        .v = nearness.form.v.mul(growth),
        .one = nearness.form.one.mulAdd(growth, nearness.absolute),
    };
    const most = set.greatest(Boxes, &set.inAxes(Boxes, &form[3]));
    const open = there.andNot(nearness.decisive);
    var undecided: u32 = 0;
    if (open.any()) undecided = open.bitAnd(mayTouch(Boxes, set, &along, triangle.slack)).bits();
    var decided = there.bitAnd(nearness.decisive).bitAnd(most.gt(.splat(set.nearnessMin()))).bits();
    if (decided | undecided == 0) return;
    const window, const seen = set.windowOf(Boxes, corners, &triangle.facet, &along);
    decided &= seen.bits();
    undecided &= seen.bits();
    if (decided | undecided == 0) return;
    var table: Coverage(Set, [Kernel.width]f32, [Kernel.width]i32) = undefined;
    storeEach(&table, &Coverage(Set, F32, Boxes.I32){
        .form = form,
        .slack = triangle.slack.add(triangle.slack),
        .shrink = F32.splat(1).sub(nearness.relative).div(growth),
        .drop = nearness.absolute.add(nearness.absolute),
        .window = window,
        .primitive = primitive,
    });
    while (decided != 0) : (decided &= decided - 1) {
        const lane = @ctz(decided);
        var coverage: Coverage(Set, f32, i32) = undefined;
        takeEach(&coverage, &table, lane);
        const slot = exact.slotOf(set.geometry, Kernel.width, first, lane, coverage.primitive);
        rasterise.cover(Kernel, true, set, &coverage, slot);
    }
    if (undecided != 0) coverUndecided(Kernel, set, &table, undecided, first);
}

/// Out of the way of the others: they are rare.
noinline fn coverUndecided(
    comptime Kernel: type,
    set: anytype,
    table: *const Coverage(@TypeOf(set.*), [Kernel.width]f32, [Kernel.width]i32),
    undecided: u32,
    first: exact.Slot,
) void {
    @branchHint(.cold);
    var rest = undecided;
    while (rest != 0) : (rest &= rest - 1) {
        const lane = @ctz(rest);
        var coverage: Coverage(@TypeOf(set.*), f32, i32) = undefined;
        takeEach(&coverage, table, lane);
        const slot = exact.slotOf(set.geometry, Kernel.width, first, lane, coverage.primitive);
        rasterise.cover(Kernel, false, set, &coverage, slot);
    }
}

/// Lanes of triangles whose orientation is not known that the beam may touch: unless some edge
/// function is surely negative all over, and another surely positive.
fn mayTouch(
    comptime Boxes: type,
    set: anytype,
    along: *const [3]Linear(Boxes.F32),
    slack: Boxes.F32,
) Boxes.Mask {
    var negative: Boxes.Mask = .splat(false);
    var positive: Boxes.Mask = .splat(false);
    for (along) |*edge| {
        const least = set.greatest(Boxes, &edge.scale(.splat(-1))).neg();
        negative = negative.bitOr(set.greatest(Boxes, edge).lt(.zero()));
        positive = positive.bitOr(least.gt(slack.add(slack)));
    }
    return negative.bitAnd(positive).bitNot();
}

/// Stores lanes, field by field.
fn storeEach(to: anytype, from: anytype) void {
    const From = @TypeOf(from.*);
    switch (@typeInfo(From)) {
        .array => inline for (to, from) |*one, *lanes| storeEach(one, lanes),
        .@"struct" => if (@hasDecl(From, "store")) from.store(to) else {
            inline for (comptime std.meta.fieldNames(From)) |name|
                storeEach(&@field(to, name), &@field(from, name));
        },
        else => comptime unreachable,
    }
}

/// Takes what was stored of one lane.
fn takeEach(to: anytype, from: anytype, lane: usize) void {
    switch (@typeInfo(@TypeOf(to.*))) {
        .array => inline for (to, from) |*one, *lanes| takeEach(one, lanes, lane),
        .@"struct" => inline for (comptime std.meta.fieldNames(@TypeOf(to.*))) |name|
            takeEach(&@field(to, name), &@field(from, name), lane),
        else => to.* = from[lane],
    }
}
