//! A ray made ready for traversal: slab and triangle tests in the lanes of the wide BVH.
//!
//! In: a ray of a group. Out: which children it enters; its closest hit. It is kept as plain
//! numbers: little is copied to make it, and a load puts a number into all lanes where a test wants
//! it. Which hit wins does not depend on the order of the tests (ray.zig), nor does culling change
//! it (box.zig; world/padding.zig for the rounding of multiply-adds).

const world_file = @import("../../world.zig");
const TestCounts = @import("../../statistics.zig").TestCounts;
const ray_file = @import("ray.zig");
const box = @import("box.zig");
const bundle_file = @import("bundle.zig");
const triangle = @import("triangle.zig");
const walk = @import("walk.zig");

/// A ray and the closest hit so far.
pub fn TraversalRay(comptime Kernel: type) type {
    const Boxes = Kernel.Boxes;
    const F32 = Boxes.F32;
    const width = Kernel.width;
    return struct {
        /// See `ray.RayInverse.direction_inv`.
        inverse: [3]f32,
        /// What a near bound has added after it is multiplied, or if not fused, subtracted before.
        near_shift: [3]f32,
        /// The same of a far bound.
        far_shift: [3]f32,
        /// Where the rows of `Node.bounds` that are the near faces begin, and the far, in bytes.
        near_at: [3]u32,
        far_at: [3]u32,
        /// The longest axis; `View` for what is turned by it.
        axis: u32,
        turned_origin: [3]f32,
        /// The origin's part of the padding.
        shift: f32,
        turned_inverse: [3]f32,
        shear: [3]f32,
        tnear_t: f32,
        tnear_primitive: i32,
        skip: i32,
        /// t of the closest hit so far, or what is the limit without any.
        limit: f32,
        closest_primitive: i32,

        const Self = @This();
        const row_bytes = width * @sizeOf(f32);
        const Node = world_file.Node(width);
        const Pack = world_file.TrianglePack(width);

        /// The ray in one lane of a group. With `fused`, nodes are tested by multiply-adds: it has
        /// to be `fusable`.
        pub inline fn of(
            comptime Rays: type,
            comptime fused: bool,
            group: *const ray_file.Ray(Rays),
            view: *const bundle_file.Precalculations(Rays),
            lane: usize,
        ) Self {
            const inverse = view.slabs.direction_inv.laneIn(lane);
            var near_at: [3]u32 = undefined;
            var far_at: [3]u32 = undefined;
            for (&near_at, &far_at, inverse, 0..) |*near, *far, component, row| {
                const down = (@as(u32, @bitCast(component)) >> 31) * (3 * row_bytes);
                near.* = @as(u32, @intCast(row)) * row_bytes + down;
                far.* = @as(u32, @intCast(row + 3)) * row_bytes - down;
            }
            return .{
                .inverse = inverse,
                .near_shift = if (fused)
                    view.near_shift.laneIn(lane)
                else
                    faceOrigin(view, lane, 1),
                .far_shift = if (fused)
                    view.far_shift.laneIn(lane)
                else
                    faceOrigin(view, lane, -1),
                .near_at = near_at,
                .far_at = far_at,
                .axis = view.uniform orelse view.axis.ofLane(lane),
                .turned_origin = view.view.origin.laneIn(lane),
                .shift = view.view.shift.laneIn(lane),
                .turned_inverse = view.view.direction_inv.laneIn(lane),
                .shear = view.view.shear.laneIn(lane),
                .tnear_t = group.tnear.t.laneIn(lane),
                .tnear_primitive = group.tnear.primitive.laneIn(lane),
                .skip = group.skip.laneIn(lane),
                .limit = group.closest.t.laneIn(lane),
                .closest_primitive = group.closest.primitive.laneIn(lane),
            };
        }

        /// Where near (1) or far (-1) faces are met from.
        fn faceOrigin(view: anytype, lane: usize, side: f32) [3]f32 {
            const shift = side * view.view.shift.lane(lane);
            var from = view.slabs.origin.lane(lane);
            for (&from, view.slabs.negative) |*coordinate, negative| {
                coordinate.* += if (negative.lane(lane)) -shift else shift;
            }
            return from;
        }

        /// What nodes are tested against, in lanes.
        pub const Slabs = struct {
            inverse: [3]F32,
            near_shift: [3]F32,
            far_shift: [3]F32,
            near_at: [3]usize,
            far_at: [3]usize,
            tnear_t: F32,

            /// Where the ray is within the children's boxes, up to `limit`: met where a child may
            /// hold a hit. `fused` as in `of`.
            pub inline fn meet(
                slabs: *const Slabs,
                comptime fused: bool,
                node: *const Node,
                limit: f32,
                counts: *TestCounts,
            ) box.Range(Boxes) {
                walk.countNode(Kernel, node, counts);
                var near: [3]F32 = undefined;
                var far: [3]F32 = undefined;
                inline for (0..3) |axis| {
                    const inverse = slabs.inverse[axis];
                    near[axis] = along(
                        fused,
                        facesFrom(node, slabs.near_at[axis]),
                        inverse,
                        slabs.near_shift[axis],
                    );
                    far[axis] = along(
                        fused,
                        facesFrom(node, slabs.far_at[axis]),
                        inverse,
                        slabs.far_shift[axis],
                    );
                }
                return box.between(Boxes, near, far, slabs.tnear_t, .splat(limit));
            }

            inline fn along(comptime fused: bool, bound: F32, inverse: F32, shift: F32) F32 {
                return if (fused) bound.mulAdd(inverse, shift) else bound.sub(shift).mul(inverse);
            }
        };

        /// Puts into lanes what nodes are tested against.
        pub inline fn slabsOf(ray: *const Self) Slabs {
            var slabs: Slabs = undefined;
            inline for (0..3) |axis| {
                slabs.inverse[axis] = .splat(ray.inverse[axis]);
                slabs.near_shift[axis] = .splat(ray.near_shift[axis]);
                slabs.far_shift[axis] = .splat(ray.far_shift[axis]);
                slabs.near_at[axis] = ray.near_at[axis];
                slabs.far_at[axis] = ray.far_at[axis];
            }
            slabs.tnear_t = .splat(ray.tnear_t);
            return slabs;
        }

        /// One row of `Node.bounds`; `at` is in `near_at` or `far_at`.
        pub inline fn facesFrom(node: *const Node, at: usize) F32 {
            return .load(rowFrom(node, at));
        }

        /// The same by child.
        pub inline fn rowFrom(node: *const Node, at: usize) *const [width]f32 {
            const bounds: [*]const u8 = @ptrCast(&node.bounds);
            return @ptrCast(@alignCast(bounds + at));
        }

        /// Tests the triangles of a pack: which are hit within the limits, and where. Returns
        /// whether any is. (Not the hits: a structure that comes back from two places goes through
        /// memory, in pieces of another size than it is read in.)
        pub inline fn hitsOf(
            ray: *const Self,
            pack: *const Pack,
            padding: *const world_file.Padding,
            counts: *TestCounts,
            hits: *triangle.Intersection(Boxes),
        ) bool {
            @setEvalBranchQuota(4000); // For what is inlined here.
            walk.countPack(Kernel, pack, counts);
            const inverse: Boxes.Vec3 = .splat(ray.turned_inverse);
            const zero: F32 = .zero();
            const view: ray_file.ShearedRay(Boxes) = .{
                .origin = .splat(ray.turned_origin),
                .shift = .splat(ray.shift),
                .direction_inv = inverse,
                .negative = .{ inverse.x.lt(zero), inverse.y.lt(zero), inverse.z.lt(zero) },
                .shear = .splat(ray.shear),
            };
            const corners = loadCorners(Boxes, pack, @intCast(ray.axis));
            const seen = triangle.project(Boxes, corners, &view);
            var weights = triangle.edgeFunctions(Boxes, seen);
            const primitive: Boxes.I32 = .load(@ptrCast(&pack.primitive));
            const there = primitive.gt(.splat(ray_file.no_primitive));
            if (weights.mayAgree().bitAnd(there).none()) return false;
            const agreeing = weights.agree().bitAnd(there);
            const inside = triangle.resolveTies(Boxes, seen, &weights, agreeing);
            const axis: u2 = @intCast(ray.axis);
            const center: Boxes.Vec3 = .splat(.{
                padding.center[ray_file.turnedIndex(axis, 0)],
                padding.center[ray_file.turnedIndex(axis, 1)],
                padding.center[axis],
            });
            const hit = triangle.locate(Boxes, seen, weights, corners, &view, padding, center);
            const tnear: ray_file.Hit(Boxes) =
                .{ .t = .splat(ray.tnear_t), .primitive = .splat(ray.tnear_primitive) };
            const closest: ray_file.Hit(Boxes) =
                .{ .t = .splat(ray.limit), .primitive = .splat(ray.closest_primitive) };
            hits.t = hit.t;
            hits.mask = inside.bitAnd(hit.mask)
                .bitAnd(tnear.isBefore(hit.t, primitive))
                .bitAnd(closest.isAfter(hit.t, primitive))
                .andNot(primitive.eq(.splat(ray.skip)));
            return hits.mask.any();
        }

        /// Tests the triangles of a pack and keeps the closest hit. Returns whether there was one.
        pub inline fn intersect(
            ray: *Self,
            pack: *const Pack,
            padding: *const world_file.Padding,
            counts: *TestCounts,
        ) bool {
            var hits: triangle.Intersection(Boxes) = undefined;
            if (!ray.hitsOf(pack, padding, counts, &hits)) return false;
            const ts = hits.t.toArray();
            var bits = hits.mask.bits();
            while (bits != 0) : (bits &= bits - 1) {
                const lane = @ctz(bits);
                const number: i32 = @bitCast(pack.primitive[lane]);
                const closer = ts[lane] < ray.limit or
                    (ts[lane] == ray.limit and number < ray.closest_primitive);
                if (closer) {
                    ray.limit = ts[lane];
                    ray.closest_primitive = number;
                }
            }
            return true;
        }
    };
}

/// The corners of a pack's triangles in lanes, turned so that `axis` is z.
inline fn loadCorners(comptime Boxes: type, pack: anytype, axis: u2) [3]Boxes.Vec3 {
    var corners: [3]Boxes.Vec3 = undefined;
    inline for (&corners, &pack.corner) |*corner, *components| {
        corner.* = .{
            .x = .load(&components[ray_file.turnedIndex(axis, 0)]),
            .y = .load(&components[ray_file.turnedIndex(axis, 1)]),
            .z = .load(&components[axis]),
        };
    }
    return corners;
}
