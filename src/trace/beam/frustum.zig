//! What encloses a beam: four planes through the rays' origin, and how deep it has to look.
//!
//! In: normals that point inward. Out: which children of a node the beam may meet, and the least
//! depth at which. Conservative: planes stand off by `slack_pads` times `World.pad`, which covers
//! the rounding of boxes, of ray directions and of the planes themselves. Of a box only the corner
//! farthest along a plane's normal counts (Assarsson and Moeller 2000, "Optimized View Frustum
//! Culling Algorithms for Bounding Boxes", the p-vertex).

const std = @import("std");
const world_file = @import("../../world.zig");
const stack = @import("../stack.zig");
const assert = std.debug.assert;

/// `World.pad` is at least 32 u R and 4 u X for distances R and coordinates X (`pad.zig`). A
/// fused plane equation in coordinates of the scene is off by at most 6 u (2 X + R) of the length
/// of its normal; directions that are linear in the pixel up to 24 u put a ray off by 24 u R.
pub const slack_pads = 8.0;

/// Components of a normal are at least this long, so that infinite corners of empty boxes never
/// meet a zero.
const component_min = 1e-30;

/// A half space: where normal . x + offset >= 0.
pub const Plane = struct {
    normal: [3]f32,
    offset: f32,
    /// By axis, the bound of a box (0 lower, 1 upper) that is farthest along the normal.
    far_side: [3]u1,

    /// The plane through `point`, `slack` metres behind it. A normal of any length.
    pub fn init(normal: [3]f32, point: [3]f32, slack: f32) Plane {
        var plane: Plane = .{ .normal = undefined, .offset = 0, .far_side = undefined };
        var length: f32 = 0;
        for (&plane.normal, normal, point, &plane.far_side) |*to, component, at, *side| {
            const sign = std.math.copysign(@as(f32, component_min), component);
            to.* = if (@abs(component) < component_min) sign else component;
            side.* = @intFromBool(to.* > 0);
            plane.offset -= to.* * at;
            length += @abs(to.*);
        }
        plane.offset += slack * length;
        return plane;
    }

    /// Value at points.
    inline fn valueAtPoint(plane: *const Plane, comptime Lanes: type, point: Lanes.Vec3) Lanes.F32 {
        var sum: Lanes.F32 = .splat(plane.offset);
        inline for (.{ point.x, point.y, point.z }, 0..) |component, axis| {
            sum = component.mulAdd(.splat(plane.normal[axis]), sum);
        }
        return sum;
    }

    /// Value at the corners of a node's boxes on the given sides.
    inline fn valueAt(
        plane: *const Plane,
        comptime Lanes: type,
        node: anytype,
        side: [3]u1,
    ) Lanes.F32 {
        var sum: Lanes.F32 = .splat(plane.offset);
        inline for (0..3) |axis| {
            const bound: Lanes.F32 = .load(&node.bounds[side[axis]][axis]);
            sum = bound.mulAdd(.splat(plane.normal[axis]), sum);
        }
        return sum;
    }
};

/// A pyramid from the rays' origin and the direction in which it counts depth.
pub const Frustum = struct {
    sides: [4]Plane,
    depth: Plane,

    /// Planes through `origin`. Depth is counted along `depth_normal` from there.
    pub fn init(origin: [3]f32, normals: [4][3]f32, depth_normal: [3]f32, pad: f32) Frustum {
        const slack = slack_pads * pad;
        var frustum: Frustum = .{
            .sides = undefined,
            .depth = .init(depth_normal, origin, -slack),
        };
        for (&frustum.sides, normals) |*side, normal| side.* = .init(normal, origin, slack);
        return frustum;
    }

    /// Triangles that are not wholly on the outer side of a plane.
    pub inline fn mayMeet(
        frustum: *const Frustum,
        comptime Lanes: type,
        corners: [3]Lanes.Vec3,
    ) Lanes.Mask {
        var least: Lanes.F32 = undefined;
        inline for (&frustum.sides, 0..) |*side, index| {
            const most = side.valueAtPoint(Lanes, corners[0])
                .maxFast(side.valueAtPoint(Lanes, corners[1]))
                .maxFast(side.valueAtPoint(Lanes, corners[2]));
            least = if (index == 0) most else least.minFast(most);
        }
        return least.ge(.zero());
    }

    /// Pushes the children of a node that the beam may meet before `depth_max`, the nearest on
    /// top. Returns the new count of the stack.
    pub inline fn pushChildren(
        frustum: *const Frustum,
        comptime Lanes: type,
        node: *const world_file.Node(Lanes.count),
        depth_max: f32,
        entries: []stack.Entry,
        entry_count: usize,
    ) usize {
        var least = frustum.sides[0].valueAt(Lanes, node, frustum.sides[0].far_side);
        inline for (frustum.sides[1..]) |*side| {
            least = least.minFast(side.valueAt(Lanes, node, side.far_side));
        }
        const depth = &frustum.depth;
        var near_side = depth.far_side;
        for (&near_side) |*side| side.* = 1 - side.*;
        const near = depth.valueAt(Lanes, node, near_side);
        const met = least.ge(.zero()).bitAnd(near.le(.splat(depth_max)));
        return stack.push(Lanes, node, met.bits(), near, entries, entry_count);
    }
};
