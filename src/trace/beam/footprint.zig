//! Triangles as a light sees them: edge functions and depth, linear on the plane across its rays.
//!
//! In: a block of triangles, and how points fall onto that plane (`Projection`). Out: by triangle
//! three edge functions and a measure of nearness, each a value a u + b v + c, with bounds on their
//! errors in the manner of edges.zig. For a point light (u, v) are slopes, edge functions those of
//! edges.zig over the slope's axis, nearness is 1/depth; for a directional one (u, v) is where the
//! light's ray meets an axis plane, nearness is minus the depth. In both a triangle stands before a
//! point if its nearness is greater than the point's own.

const std = @import("std");
const ray_file = @import("../ray.zig");
const edges_file = @import("edges.zig");
const assert = std.debug.assert;

/// How points of space fall onto the plane across the rays.
pub const Projection = struct {
    /// Of a point light its place; else a point near the rays, to keep numbers small.
    origin: [3]f32,
    /// The axis along which depth counts; the others follow it in cyclic order.
    axis: u2,
    /// 1 or -1: the way the light travels along that axis.
    sign: f32,
    /// Null: from the origin on; else parallel rays that move by this much along the other two
    /// axes for each unit along the depth's.
    slope: ?[2]f32,
    /// Parallel rays: the largest distance of a ray's end from the origin.
    reach: f32 = 0,

    /// Index of the axis of u (0), v (1) or depth (2).
    pub fn axisAt(projection: *const Projection, place: usize) usize {
        return ray_file.turnedIndex(projection.axis, place);
    }
};

/// (u, v) and nearness of points in lanes.
pub fn Place(comptime Lanes: type) type {
    return struct { u: Lanes.F32, v: Lanes.F32, depth: Lanes.F32 };
}

/// Where points fall, given relative to the projection's origin. For a point light depth must not
/// be 0.
pub inline fn project(
    comptime Lanes: type,
    projection: *const Projection,
    point: Lanes.Vec3,
) Place(Lanes) {
    const turned = turn(Lanes, projection.axis, point);
    const sign: Lanes.F32 = .splat(projection.sign);
    if (projection.slope) |slope| return .{
        .u = turned.x.sub(turned.z.mul(.splat(slope[0]))),
        .v = turned.y.sub(turned.z.mul(.splat(slope[1]))),
        .depth = turned.z.mul(sign),
    };
    const inverse = Lanes.F32.splat(1).div(turned.z);
    return .{
        .u = turned.x.mul(inverse),
        .v = turned.y.mul(inverse),
        .depth = turned.z.mul(sign),
    };
}

/// Components in cyclic order with the given axis last.
pub inline fn turn(comptime Lanes: type, axis: u2, vector: Lanes.Vec3) Lanes.Vec3 {
    return switch (axis) {
        0 => .{ .x = vector.y, .y = vector.z, .z = vector.x },
        1 => .{ .x = vector.z, .y = vector.x, .z = vector.y },
        else => vector,
    };
}

/// u, v and 1 times these.
pub fn Linear(comptime Lanes: type) type {
    return struct {
        u: Lanes.F32,
        v: Lanes.F32,
        one: Lanes.F32,

        fn of(vector: Lanes.Vec3) @This() {
            return .{ .u = vector.x, .v = vector.y, .one = vector.z };
        }
    };
}

/// Triangles of a block in lanes.
pub fn Footprint(comptime Lanes: type) type {
    const F32 = Lanes.F32;
    const Vec3 = Lanes.Vec3;
    return struct {
        /// Positive within.
        edge: [3]Linear(Lanes),
        /// Greater is nearer to the light.
        nearness: Linear(Lanes),
        /// Bound of the error of an edge function.
        slack: F32,
        /// Nearness n is within n (1 +- relative) +- absolute.
        relative: F32,
        absolute: F32,
        decisive: Lanes.Mask,
        /// Bounds R of the rounding of u and v.
        reach: F32,
        /// The longest edge.
        length: F32,

        /// Sets up triangles; slopes (or the rays' own) are at most `slope_max` along each axis.
        pub inline fn init(
            corners: [3]Vec3,
            projection: *const Projection,
            slope_max: f32,
            reach_max: f32,
        ) @This() {
            return if (projection.slope == null)
                pointLight(corners, projection, slope_max, reach_max)
            else
                directional(corners, projection, slope_max, reach_max);
        }

        inline fn pointLight(
            corners: [3]Vec3,
            projection: *const Projection,
            slope_max: f32,
            reach_max: f32,
        ) @This() {
            const edges: edges_file.Edges(Lanes) =
                .init(corners, .splat(projection.origin), reach_max);
            const sign: F32 = .splat(projection.sign);
            const unit = edges_file.unit_roundoff * @sqrt(1 + 2 * slope_max * slope_max);
            const axis = projection.axis;
            return .{
                .edge = .{
                    .of(turn(Lanes, axis, edges.normal[0].scale(sign))),
                    .of(turn(Lanes, axis, edges.normal[1].scale(sign))),
                    .of(turn(Lanes, axis, edges.normal[2].scale(sign))),
                },
                .nearness = .of(turn(Lanes, axis, edges.inverse.scale(sign))),
                .slack = edges.slack.mul(.splat(edges_file.edge_roundings * unit)),
                .relative = edges.inverse_relative,
                .absolute = edges.inverse_absolute
                    .mul(.splat(edges_file.inverse_roundings * unit)),
                .decisive = edges.decisive,
                .reach = edges.reach,
                .length = edges.length,
            };
        }

        /// An edge function is twice the area between an edge and a point of the plane; depth is
        /// that of the triangle's plane. R of the bounds is the distance to the origin, or from
        /// there to a ray's end, if that is larger. With the slopes m of the rays, |D| is
        /// sqrt(1 + m . m), det the area on the plane and R S / |det| a length: depth is off by
        /// (28 R + 9 L^3 / area) u |D| S / area.
        inline fn directional(
            corners: [3]Vec3,
            projection: *const Projection,
            slope_max: f32,
            reach_max: f32,
        ) @This() {
            const axis = projection.axis;
            const origin: Vec3 = turn(Lanes, axis, .splat(projection.origin));
            const a = turn(Lanes, axis, corners[0]).sub(origin);
            const b = turn(Lanes, axis, corners[1]).sub(origin);
            const c = turn(Lanes, axis, corners[2]).sub(origin);
            const sides = [3]Vec3{
                turn(Lanes, axis, corners[2].sub(corners[1])),
                turn(Lanes, axis, corners[0].sub(corners[2])),
                turn(Lanes, axis, corners[1].sub(corners[0])),
            };
            const slope = projection.slope.?;
            const along: Vec3 = .{ .x = .splat(slope[0]), .y = .splat(slope[1]), .z = .splat(1) };
            const plane = edges_file.cross(Lanes, sides[1], sides[2]);
            const area = edges_file.dot(Lanes, plane, along);
            const area_inv = F32.splat(1).div(area);
            const flip: F32 = .select(area.lt(.zero()), .splat(-1), .splat(1));
            const length_squared = edges_file.longestSquared(Lanes, sides);
            const reach = edges_file.longestSquared(Lanes, .{ a, b, c }).sqrt()
                .add(.splat(projection.reach));
            const stretch = @sqrt(1 + 2 * slope_max * slope_max);
            const unit = edges_file.unit_roundoff * stretch;
            const length = length_squared.sqrt();
            const steepness = edges_file.absoluteCross(Lanes, sides[1], sides[2])
                .mul(area_inv.abs());
            const thinness = length_squared.mul(length).mul(area_inv.abs());
            const absolute = reach.mulAdd(.splat(36), thinness.mul(.splat(11)))
                .mulAdd(steepness.mul(.splat(unit)), reach.mul(.splat(5 * unit)));
            const sign: F32 = .splat(projection.sign);
            const nearness_scale = area_inv.mul(sign);
            const sums = [3]Vec3{ c.add(b), a.add(c), b.add(a) };
            var edge: [3]Linear(Lanes) = undefined;
            inline for (&edge, sides, sums) |*to, step, sum| {
                const u = step.x.sub(step.z.mul(along.x)).mul(flip);
                const v = step.y.sub(step.z.mul(along.y)).mul(flip);
                const middle_u = sum.x.sub(sum.z.mul(along.x)).mul(.splat(0.5));
                const middle_v = sum.y.sub(sum.z.mul(along.y)).mul(.splat(0.5));
                to.* = .{ .u = v.neg(), .v = u, .one = middle_u.mul(v).sub(middle_v.mul(u)) };
            }
            return .{
                .edge = edge,
                .nearness = .{
                    .u = plane.x.mul(nearness_scale),
                    .v = plane.y.mul(nearness_scale),
                    .one = edges_file.dot(Lanes, plane, a).mul(nearness_scale).neg(),
                },
                .slack = reach.mul(length.add(reach.mul(.splat(2 * edges_file.unit_roundoff))))
                    .mul(.splat(edges_file.edge_roundings * unit * stretch)),
                .relative = .zero(),
                .absolute = absolute,
                .reach = reach,
                .length = length,
                .decisive = absolute.lt(reach.mul(.splat(edges_file.relative_error_max)))
                    .bitAnd(area.abs().gt(reach.mul(length)
                        .mul(.splat(edges_file.turning_roundings * unit))))
                    .bitAnd(length_squared.gt(.splat(edges_file.length_squared_min)))
                    .bitAnd(reach.lt(.splat(reach_max))),
            };
        }
    };
}
