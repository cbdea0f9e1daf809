//! View frustum culling by p-vertices (Assarsson and Moeller 2000, "Optimized View Frustum Culling
//! Algorithms for Bounding Boxes"): four planes around a beam against all children of a node.
//!
//! In: normals that point inward. Out: which children the beam may meet, and the least depth at
//! which. Conservative: planes stand off by `slack_pads` times `Geometry.pad`, which covers the
//! rounding of boxes, of ray directions and of the planes themselves. Of a box only the corner
//! farthest along a plane's normal counts.

const std = @import("std");
const world_file = @import("../../../world.zig");
const assert = std.debug.assert;

/// `Geometry.pad` is at least 32 u R and 4 u X for distances R and coordinates X (`pad.zig`). A
/// fused plane equation in coordinates of the scene is off by at most 6 u (2 X + R) of the length
/// of its normal; directions that are linear in the pixel up to 24 u put a ray off by 24 u R.
const slack_pads = 8.0;

/// How far, in metres, planes stand off the rays.
pub fn slackOf(geometry: *const world_file.Geometry) f32 {
    return slack_pads * geometry.pad;
}

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

        /// Planes that stand off `origin` by `slack` metres. Depth is counted along `depth_normal`
        /// from there.
        pub fn init(origin: [3]f32, normals: [4][3]f32, depth_normal: [3]f32, slack: f32) Self {
            var frustum: Self = .{
                .sides = undefined,
                .depth = .init(depth_normal, origin, -slack),
            };
            for (&frustum.sides, normals) |*side, normal| side.* = .init(normal, origin, slack);
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

const Grid = @import("grid.zig").Grid;
const vec3 = @import("../../../math.zig").vec3;

/// A random tile, and what a point may be seen at.
const TestBeam = struct {
    grid: Grid,
    frustum: Frustum(Four),
    pad: f32,

    const Four = @import("../../../simd.zig").Lanes(.vector, 4);

    fn init(random: std.Random, place: f32, reach: f32) ?TestBeam {
        var grid: Grid = undefined;
        for (&grid.origin, &grid.corner, &grid.right, &grid.down) |*at, *to, *right, *down| {
            at.* = random.floatNorm(f32) * place;
            to.* = random.floatNorm(f32);
            right.* = random.floatNorm(f32) * 1e-2;
            down.* = random.floatNorm(f32) * 1e-2;
        }
        const sides = grid.sides() orelse return null;
        const along = grid.depthNormal() orelse return null;
        const farthest = vec3.length1(grid.origin) + reach;
        const pad = 0x1p-24 * (32 * reach + 4 * farthest);
        return .{
            .grid = grid,
            .frustum = .init(grid.origin, sides, along, slack_pads * pad),
            .pad = pad,
        };
    }

    /// A box from `lower` to `upper` as the third child of a node.
    fn meets(beam: *const TestBeam, lower: [3]f32, upper: [3]f32, depth_max: f32) ?f32 {
        var node: world_file.Node(4) = .empty;
        for (0..3) |axis| {
            node.bounds[0][axis][2] = lower[axis];
            node.bounds[1][axis][2] = upper[axis];
        }
        const met = beam.frustum.meet(&node, depth_max);
        return if (met.mask.lane(2)) met.near.lane(2) else null;
    }
};

test "no box or triangle that a ray reaches is culled; what is well beside the beam is" {
    var generator = std.Random.DefaultPrng.init(31);
    const random = generator.random();
    var beam_count: u32 = 0;
    for (0..4000) |round| {
        const reach: f32 = ([_]f32{ 1, 50, 1e4 })[round % 3];
        const beam = TestBeam.init(random, if (round % 4 == 0) 1e4 else 1, reach) orelse continue;
        beam_count += 1;
        const grid = &beam.grid;
        const x: f32 = @floatFromInt(random.uintLessThan(u32, 16));
        const y: f32 = @floatFromInt(random.uintLessThan(u32, 16));
        const direction = grid.direction(x, y);
        // On the ray in 128 bits, then the next float of either side.
        const t = random.float(f32) * reach / vec3.length1(direction);
        var lower: [3]f32 = undefined;
        var upper: [3]f32 = undefined;
        for (&lower, &upper, grid.origin, direction) |*low, *high, from, way| {
            const exact = @as(f128, from) + @as(f128, t) * @as(f128, way);
            const rounded: f32 = @floatCast(exact);
            low.* = if (rounded > exact) std.math.nextAfter(f32, rounded, -1e9) else rounded;
            high.* = if (rounded < exact) std.math.nextAfter(f32, rounded, 1e9) else rounded;
        }
        const near = beam.meets(lower, upper, std.math.inf(f32));
        try std.testing.expect(near != null and near.? <= t);
        try std.testing.expect(beam.meets(lower, upper, t) != null);
        const Vec3 = TestBeam.Four.Vec3;
        const corners = [3]Vec3{ .splat(lower), .splat(upper), .splat(lower) };
        try std.testing.expect(beam.frustum.mayMeet(corners).all());
        // As far beyond a plane as twice what it stands off.
        for (beam.frustum.sides) |plane| {
            const far = 2 * slack_pads * beam.pad + 2 * reach * 0x1p-20;
            const length = vec3.dot(plane.normal, plane.normal);
            const out = -far * vec3.length1(plane.normal) / length;
            const beyond = vec3.add(grid.origin, vec3.scale(plane.normal, out));
            try std.testing.expectEqual(null, beam.meets(beyond, beyond, std.math.inf(f32)));
        }
    }
    try std.testing.expect(beam_count > 1000);
}
