//! One ray through the tree: against all boxes of a node at once, then all triangles of a block.
//!
//! In: a ray by itself. Out: its nearest hit, or whether there is any. SIMD runs across the tree,
//! so that a ray gains from lanes without company. Which hit wins does not depend on the order of
//! the visits (ray.zig), nor does culling change it (box.zig; `World.fused_reach` for the rounding
//! of multiply-adds).

const world_file = @import("../world.zig");
const TestCounts = @import("../statistics.zig").TestCounts;
const ray_file = @import("ray.zig");
const box = @import("box.zig");
const packet = @import("packet.zig");
const triangle = @import("triangle.zig");
const walk = @import("walk.zig");
const assert = @import("std").debug.assert;
const Query = walk.Query;
const Single = ray_file.Single;
const World = world_file.World;

/// Looks for a hit and keeps it in `ray.nearest`. Returns whether there was one.
pub fn trace(
    comptime Kernel: type,
    comptime query: Query,
    world: *const World,
    ray: *ray_file.Ray(Single),
    counts: *TestCounts,
) bool {
    const view = packet.viewOf(Single, ray);
    const nearest = traceLane(Kernel, query, Single, world, ray, &view, 0, counts) orelse
        return false;
    ray.nearest = .{ .t = .splat(nearest.t), .primitive = .splat(nearest.primitive) };
    return true;
}

/// Every active ray of a group, of which `view` is the `packet.GroupView`, by itself.
pub fn traceEach(
    comptime Kernel: type,
    comptime query: Query,
    world: *const World,
    group: anytype,
    view: anytype,
    counts: *TestCounts,
) void {
    const Rays = @TypeOf(view.*).Rays;
    var ts = group.nearest.t.toArray();
    var primitives = group.nearest.primitive.toArray();
    var bits = group.active.bits();
    while (bits != 0) : (bits &= bits - 1) {
        const lane = @ctz(bits);
        const nearest = traceLane(Kernel, query, Rays, world, group, view, lane, counts) orelse
            continue;
        ts[lane] = nearest.t;
        primitives[lane] = nearest.primitive;
    }
    group.nearest = .{ .t = .fromArray(ts), .primitive = .fromArray(primitives) };
}

const Found = struct { t: f32, primitive: i32 };

/// The hit of the ray in one lane of a group.
fn traceLane(
    comptime Kernel: type,
    comptime query: Query,
    comptime Rays: type,
    world: *const World,
    group: *const ray_file.Ray(Rays),
    view: *const packet.GroupView(Rays),
    lane: usize,
    counts: *TestCounts,
) ?Found {
    if (reachOf(group.line.origin.lane(lane)) < world.fused_reach) {
        var search: Search(Kernel, query, true) = .of(Rays, world, group, view, lane);
        return travel(Kernel, world, &search, counts);
    }
    var search: Search(Kernel, query, false) = .of(Rays, world, group, view, lane);
    return travel(Kernel, world, &search, counts);
}

/// The largest |coordinate| of where a ray starts.
inline fn reachOf(origin: [3]f32) f32 {
    return @max(@abs(origin[0]), @abs(origin[1]), @abs(origin[2]));
}

fn travel(comptime Kernel: type, world: *const World, search: anytype, counts: *TestCounts) ?Found {
    if (!walk.walk(Kernel, world.tree.get(Kernel.width), search, counts)) return null;
    return .{ .t = search.limit, .primitive = search.probe.nearest_primitive };
}

/// What of a ray the triangles of a block are tested against, in their lanes, and the nearest hit
/// so far.
pub fn Probe(comptime Kernel: type) type {
    const Boxes = Kernel.Boxes;
    return struct {
        view: ray_file.View(Boxes),
        /// The ray's longest axis.
        axis: u2,
        after: ray_file.Hit(Boxes),
        skip: Boxes.I32,
        /// t of the nearest hit so far.
        limit: f32,
        nearest_primitive: i32,
        pad: f32,

        const Self = @This();

        /// The probe of the ray in one lane of a group; its view and its longest axis are given.
        pub inline fn of(
            comptime Rays: type,
            group: *const ray_file.Ray(Rays),
            view: *const ray_file.View(Rays),
            axis: u2,
            lane: usize,
            pad: f32,
        ) Self {
            const inverse: Boxes.Vec3 = .splat(view.direction_inv.lane(lane));
            const zero: Boxes.F32 = .zero();
            return .{
                .view = .{
                    .origin = .splat(view.origin.lane(lane)),
                    .direction_inv = inverse,
                    .negative = .{ inverse.x.lt(zero), inverse.y.lt(zero), inverse.z.lt(zero) },
                    .shear = .splat(view.shear.lane(lane)),
                },
                .axis = axis,
                .after = .{
                    .t = .splat(group.after.t.lane(lane)),
                    .primitive = .splat(group.after.primitive.lane(lane)),
                },
                .skip = .splat(group.skip.lane(lane)),
                .limit = group.nearest.t.lane(lane),
                .nearest_primitive = group.nearest.primitive.lane(lane),
                .pad = pad,
            };
        }

        /// Tests the triangles of a block and keeps the nearest hit. Returns whether there was one.
        pub inline fn intersect(
            probe: *Self,
            block: *const world_file.TriangleBlock(Kernel.width),
            counts: *TestCounts,
        ) bool {
            walk.countBlock(Kernel, block, counts);
            const corners = loadCorners(Boxes, block, probe.axis);
            const seen = triangle.project(Boxes, corners, &probe.view);
            var weights = triangle.weigh(Boxes, seen);
            const primitive: Boxes.I32 = .load(@ptrCast(&block.primitive));
            const there = primitive.gt(.splat(ray_file.no_primitive));
            if (weights.mayAgree().bitAnd(there).none()) return false;
            const agreeing = weights.agree().bitAnd(there);
            const inside = triangle.settle(Boxes, seen, &weights, agreeing);
            const hit = triangle.locate(Boxes, seen, weights, corners, &probe.view, probe.pad);
            const nearest: ray_file.Hit(Boxes) = .{
                .t = .splat(probe.limit),
                .primitive = .splat(probe.nearest_primitive),
            };
            const accepted = inside.bitAnd(hit.mask)
                .bitAnd(probe.after.isBefore(hit.t, primitive))
                .bitAnd(nearest.isAfter(hit.t, primitive))
                .andNot(primitive.eq(probe.skip));
            var bits = accepted.bits();
            if (bits == 0) return false;
            const ts = hit.t.toArray();
            while (bits != 0) : (bits &= bits - 1) {
                const lane = @ctz(bits);
                const number: i32 = @bitCast(block.primitive[lane]);
                const closer = ts[lane] < probe.limit or
                    (ts[lane] == probe.limit and number < probe.nearest_primitive);
                if (closer) {
                    probe.limit = ts[lane];
                    probe.nearest_primitive = number;
                }
            }
            return true;
        }
    };
}

/// A ray in the lanes of boxes and of triangles. With `fused`, nodes are tested by
/// multiply-adds.
pub fn Search(comptime Kernel: type, comptime query: Query, comptime fused: bool) type {
    const Boxes = Kernel.Boxes;
    const F32 = Boxes.F32;
    const Rows = [6][Kernel.width]f32;
    return struct {
        /// What a bound has added before it is multiplied, or after with `fused`.
        shift: Boxes.Vec3,
        inverse: Boxes.Vec3,
        /// Rows of `Node.bounds`, lower x y z and upper x y z, that are the near faces and the far.
        near_row: [3]usize,
        far_row: [3]usize,
        probe: Probe(Kernel),
        /// t of the nearest hit so far.
        limit: f32,

        const Self = @This();

        /// The search of a ray that is in no group; see `of`.
        pub inline fn init(ray: *const ray_file.Ray(Single), world: *const World) Self {
            return .of(Single, world, ray, &packet.viewOf(Single, ray), 0);
        }

        /// The search of the ray in one lane of a group. Asserts, with `fused`, that it starts
        /// within `World.fused_reach`.
        pub inline fn of(
            comptime Rays: type,
            world: *const World,
            group: *const ray_file.Ray(Rays),
            view: *const packet.GroupView(Rays),
            lane: usize,
        ) Self {
            const inverses = view.slabs.direction_inv.lane(lane);
            const inverse: Boxes.Vec3 = .splat(inverses);
            const start = group.line.origin.lane(lane);
            if (fused) assert(reachOf(start) < world.fused_reach);
            const origin: Boxes.Vec3 = .splat(start);
            var near_row: [3]usize = undefined;
            var far_row: [3]usize = undefined;
            for (&near_row, &far_row, inverses, 0..) |*near, *far, component, row| {
                const down = @as(usize, @intFromBool(component < 0)) * 3;
                near.* = row + down;
                far.* = row + 3 - down;
            }
            const axis = view.uniform orelse view.axis.ofLane(lane);
            return .{
                .shift = if (fused) origin.mul(inverse).neg() else origin,
                .inverse = inverse,
                .near_row = near_row,
                .far_row = far_row,
                .probe = .of(Rays, group, &view.view, axis, lane, world.pad),
                .limit = group.nearest.t.lane(lane),
            };
        }

        /// Where the ray is within the children's boxes and its own limits: met where a child may
        /// hold a hit.
        pub inline fn meet(
            search: *const Self,
            node: *const world_file.Node(Kernel.width),
            counts: *TestCounts,
        ) Range {
            walk.countNode(Kernel, node, counts);
            const rows: *const Rows = @ptrCast(&node.bounds);
            var near: [3]F32 = undefined;
            var far: [3]F32 = undefined;
            const shifts = [3]F32{ search.shift.x, search.shift.y, search.shift.z };
            const inverses = [3]F32{ search.inverse.x, search.inverse.y, search.inverse.z };
            inline for (0..3) |axis| {
                const shift = shifts[axis];
                const inverse = inverses[axis];
                near[axis] = along(.load(&rows[search.near_row[axis]]), shift, inverse);
                far[axis] = along(.load(&rows[search.far_row[axis]]), shift, inverse);
            }
            const limit: F32 = .splat(search.limit);
            return box.between(Boxes, near, far, search.probe.after.t, limit);
        }

        const Range = box.Range(Boxes);

        inline fn along(bound: F32, shift: F32, inverse: F32) F32 {
            return if (fused) bound.mulAdd(inverse, shift) else bound.sub(shift).mul(inverse);
        }

        /// See `walk.walk`.
        pub inline fn isDone(_: *const Self, found: bool) bool {
            return query == .any and found;
        }

        /// Tests the triangles of a block and keeps the nearest hit. Returns whether there was one.
        pub inline fn intersect(
            search: *Self,
            block: *const world_file.TriangleBlock(Kernel.width),
            counts: *TestCounts,
        ) bool {
            const found = search.probe.intersect(block, counts);
            search.limit = search.probe.limit;
            return found;
        }
    };
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
