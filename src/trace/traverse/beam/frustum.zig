//! View frustum culling by p-vertices (Assarsson and Moeller 2000, "Optimized View Frustum Culling
//! Algorithms for Bounding Boxes"): four planes around a beam against all children of a node.
//!
//! In: normals that point inward. Out: which children the beam may meet, and the least depth at
//! which. Conservative: planes stand off the rays and lean away from them (`Slack`), which covers
//! the rounding of boxes, of ray directions and of the planes themselves. Of a box only the corner
//! farthest along a plane's normal counts.

const std = @import("std");
const world_file = @import("../../../world.zig");
const vec3 = @import("../../../math.zig").vec3;
const ray_file = @import("../ray.zig");
const assert = std.debug.assert;

/// By how much, over the distance R from the rays' origin, what a ray meets may lie beside it: 6 u
/// by the exact test, 6 u by the rounding of normals. A fused plane equation in coordinates of the
/// scene is off by 3 u of those of the point and 6 u of those of the origin: 3 u R and 9 u of the
/// latter, see `apartOf`. 64 is four times that.
pub const by_distance = 64 * 0x1p-24;

/// How far, in metres, what a ray from this origin meets may lie beside it at any distance.
pub fn apartOf(padding: *const world_file.Padding, origin: [3]f32) f32 {
    return 8 * padding.shiftOf(ray_file.Single, .splat(origin)).lane(0);
}

/// How far, in metres of the maximum norm, what is met may lie beside the rays.
pub const Slack = struct {
    apart: f32,
    /// And so much more for each unit of depth: from the origin on,
    by_depth: f32,
    /// or up to this depth, where parallel rays end.
    ends_at: ?f32 = null,
};

/// Components of a normal are at least this long, so that infinite corners of empty boxes never
/// meet a zero.
const component_min = 1e-30;

/// A half space: where normal . x + offset >= 0. Asked about nodes of this width.
pub fn Plane(comptime width: u32) type {
    return struct {
        normal: [3]f32,
        offset: f32,
        /// Of the least and the greatest value in a box: by axis, the first place in a node's
        /// bounds of the side that it is on. In floats, so that addresses cost nothing in the loop.
        place: [2][3]usize,

        const Self = @This();
        const Bounds = [6 * width]f32;

        /// The plane through `point`, `slack` metres behind it. A normal of any length.
        pub fn init(normal: [3]f32, point: [3]f32, slack: f32) Self {
            var plane: Self = .{ .normal = undefined, .offset = 0, .place = undefined };
            var length: f32 = 0;
            for (&plane.normal, normal, point, 0..) |*to, component, at, axis| {
                const sign = std.math.copysign(@as(f32, component_min), component);
                to.* = if (@abs(component) < component_min) sign else component;
                const rises = @intFromBool(to.* > 0);
                plane.place[rises][axis] = (3 + axis) * width;
                plane.place[1 - rises][axis] = axis * width;
                plane.offset -= to.* * at;
                length += @abs(to.*);
            }
            plane.offset += slack * length;
            return plane;
        }

        /// Value at points.
        inline fn valueAtPoint(plane: *const Self, comptime Lanes: type, at: Lanes.Vec3) Lanes.F32 {
            var sum: Lanes.F32 = .splat(plane.offset);
            inline for (.{ at.x, at.y, at.z }, 0..) |component, axis| {
                sum = component.mulAdd(.splat(plane.normal[axis]), sum);
            }
            return sum;
        }

        /// The least (0) or the greatest (1) value in each of a node's boxes.
        inline fn extreme(
            plane: *const Self,
            comptime Lanes: type,
            node: *const world_file.Node(width),
            comptime end: u1,
        ) Lanes.F32 {
            const bounds: *const Bounds = @ptrCast(&node.bounds);
            var sum: Lanes.F32 = .splat(plane.offset);
            inline for (plane.place[end], plane.normal) |place, component| {
                const bound: Lanes.F32 = .load(bounds[place..][0..width]);
                sum = bound.mulAdd(.splat(component), sum);
            }
            return sum;
        }
    };
}

/// A pyramid from the rays' origin and the direction in which it counts depth.
pub fn Frustum(comptime Lanes: type) type {
    const width = Lanes.count;
    return struct {
        sides: [4]Plane(width),
        depth: Plane(width),

        const Self = @This();

        /// Planes through `origin`, but for the slack. Depth is counted along `depth_normal` from
        /// there.
        pub fn init(
            origin: [3]f32,
            normals: [4][3]f32,
            depth_normal: [3]f32,
            slack: Slack,
        ) Self {
            const parallel = slack.ends_at != null;
            const shrink = if (parallel) 1 else 1 - slack.by_depth * vec3.length1(depth_normal);
            const along = vec3.scale(depth_normal, shrink);
            var frustum: Self = .{
                .sides = undefined,
                .depth = .init(along, origin, -slack.apart),
            };
            for (&frustum.sides, normals) |*side, normal| {
                const lean = slack.by_depth * vec3.length1(normal);
                const toward = if (parallel) -lean else lean;
                const leaning = vec3.add(normal, vec3.scale(depth_normal, toward));
                side.* = .init(leaning, origin, slack.apart);
                if (slack.ends_at) |depth| side.offset += lean * depth;
            }
            return frustum;
        }

        /// Triangles that are not wholly on the outer side of a plane.
        pub inline fn mayMeet(
            frustum: *const Self,
            corners: [3]Lanes.Vec3,
        ) Lanes.Mask {
            var least: Lanes.F32 = undefined;
            inline for (&frustum.sides, 0..) |*side, index| {
                const most = side.valueAtPoint(Lanes, corners[0])
                    .maxOrNegative(side.valueAtPoint(Lanes, corners[1]))
                    .maxOrNegative(side.valueAtPoint(Lanes, corners[2]));
                least = if (index == 0) most else least.minOrNegative(most);
            }
            return least.isNegative().bitNot();
        }

        /// Children of a node that the beam may meet before `depth_max`, and where.
        pub inline fn meet(
            frustum: *const Self,
            node: *const world_file.Node(width),
            depth_max: f32,
        ) Met(Lanes) {
            var least = frustum.sides[0].extreme(Lanes, node, 1);
            inline for (frustum.sides[1..]) |*side| {
                least = least.minOrNegative(side.extreme(Lanes, node, 1));
            }
            const near = frustum.depth.extreme(Lanes, node, 0);
            return .{
                .near = near,
                .mask = near.le(.splat(depth_max)).andNot(least.isNegative()),
            };
        }
    };
}

/// Children of a node in lanes, as `walk.zig` wants them.
pub fn Met(comptime Lanes: type) type {
    return struct {
        /// The least depth of each.
        near: Lanes.F32,
        mask: Lanes.Mask,

        pub inline fn isMet(met: @This()) Lanes.Mask {
            return met.mask;
        }
    };
}
