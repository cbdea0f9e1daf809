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
    const Edges = edges_file.Edges(Lanes);
    const Facet = edges_file.Facet(Lanes);
    return struct {
        /// Positive within.
        edge: [3]Linear(Lanes),
        /// Bound of the error of an edge function.
        slack: F32,
        /// In a directional light's own axes, its det the area on the plane.
        facet: Facet,

        const Self = @This();

        /// Sets up triangles; slopes (or the rays' own) are at most `slope_max` along each axis.
        pub inline fn init(
            corners: [3]Vec3,
            projection: *const Projection,
            slope_max: f32,
            reach_max: f32,
        ) Self {
            return if (projection.slope) |slope|
                directional(corners, projection, slope, slope_max, reach_max)
            else
                pointLight(corners, projection, slope_max, reach_max);
        }

        inline fn pointLight(
            corners: [3]Vec3,
            projection: *const Projection,
            slope_max: f32,
            reach_max: f32,
        ) Self {
            const edges: Edges = .init(corners, .splat(projection.origin), reach_max);
            const sign: F32 = .splat(projection.sign);
            var edge: [3]Linear(Lanes) = undefined;
            inline for (&edge, edges.normal) |*to, normal| {
                to.* = .of(turn(Lanes, projection.axis, normal.scale(sign)));
            }
            return .{
                .edge = edge,
                .slack = edges.slack
                    .mul(.splat(edges_file.edge_roundings * unitOf(slope_max))),
                .facet = edges.facet,
            };
        }

        /// u times |D| over the depth of D.
        fn unitOf(slope_max: f32) f32 {
            return edges_file.unit_roundoff * stretchOf(slope_max);
        }

        fn stretchOf(slope_max: f32) f32 {
            return @sqrt(1 + 2 * slope_max * slope_max);
        }

        /// An edge function is twice the area between an edge and a point of the plane; depth is
        /// that of the triangle's plane. R of the bounds is the distance to the origin, or from
        /// there to a ray's end, if that is larger. With the slopes m of the rays, |D| is
        /// sqrt(1 + m . m), det the area on the plane and R S / |det| a length.
        inline fn directional(
            corners: [3]Vec3,
            projection: *const Projection,
            slope: [2]f32,
            slope_max: f32,
            reach_max: f32,
        ) Self {
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
            const along: Vec3 = .{ .x = .splat(slope[0]), .y = .splat(slope[1]), .z = .splat(1) };
            const plane = edges_file.cross(Lanes, sides[1], sides[2]);
            const area = edges_file.dot(Lanes, plane, along);
            const flip: F32 = .select(area.lt(.zero()), .splat(-1), .splat(1));
            const length_squared = edges_file.longestSquared(Lanes, sides);
            const reach = edges_file.longestSquared(Lanes, .{ a, b, c }).sqrt()
                .add(.splat(projection.reach));
            const stretch = stretchOf(slope_max);
            const length = length_squared.sqrt();
            const sums = [3]Vec3{ c.add(b), a.add(c), b.add(a) };
            var edge: [3]Linear(Lanes) = undefined;
            inline for (&edge, sides, sums) |*to, step, sum| {
                const u = step.x.sub(step.z.mul(along.x)).mul(flip);
                const v = step.y.sub(step.z.mul(along.y)).mul(flip);
                const middle_u = sum.x.sub(sum.z.mul(along.x)).mul(.splat(0.5));
                const middle_v = sum.y.sub(sum.z.mul(along.y)).mul(.splat(0.5));
                to.* = .{ .u = v.neg(), .v = u, .one = middle_u.mul(v).sub(middle_v.mul(u)) };
            }
            const scale = reach.mul(.splat(stretch));
            return .{
                .edge = edge,
                .slack = reach.mul(length.add(reach.mul(.splat(2 * edges_file.unit_roundoff))))
                    .mul(.splat(edges_file.edge_roundings * unitOf(slope_max) * stretch)),
                .facet = .{
                    .turned = edges_file.isTurned(Lanes, area, scale, length_squared, length)
                        .bitAnd(reach.lt(.splat(reach_max))),
                    .reach = reach,
                    .length = length,
                    .corner = a,
                    .sides = .{ sides[1], sides[2] },
                    .plane = plane,
                    .det = area,
                },
            };
        }

        /// Nearness of the triangles that the edges have left; arguments as for `init`.
        pub inline fn nearness(
            footprint: *const Self,
            projection: *const Projection,
            slope_max: f32,
        ) Nearness(Lanes) {
            const facet = &footprint.facet;
            const sign: F32 = .splat(projection.sign);
            const unit = unitOf(slope_max);
            if (projection.slope != null) return parallelNearness(facet, sign, unit);
            const inverse = facet.inverse();
            return .{
                .form = .of(turn(Lanes, projection.axis, inverse.vector.scale(sign))),
                .relative = inverse.relative,
                .absolute = inverse.absolute.mul(.splat(edges_file.inverse_roundings * unit)),
                .decisive = inverse.decisive,
            };
        }

        /// Depth is off by (28 R + 9 L^3 / area) u |D| S / area.
        inline fn parallelNearness(facet: *const Facet, sign: F32, unit: f32) Nearness(Lanes) {
            const area_inv, const steepness, const thinness = facet.shape();
            const reach = facet.reach;
            const absolute = reach.mulAdd(.splat(36), thinness.mul(.splat(11)))
                .mulAdd(steepness.mul(.splat(unit)), reach.mul(.splat(5 * unit)));
            const scale = area_inv.mul(sign);
            return .{
                .form = .{
                    .u = facet.plane.x.mul(scale),
                    .v = facet.plane.y.mul(scale),
                    .one = edges_file.dot(Lanes, facet.plane, facet.corner).mul(scale).neg(),
                },
                .relative = .zero(),
                .absolute = absolute,
                .decisive = facet.turned
                    .bitAnd(absolute.lt(reach.mul(.splat(edges_file.relative_error_max)))),
            };
        }
    };
}

/// Nearness of triangles in lanes.
pub fn Nearness(comptime Lanes: type) type {
    return struct {
        /// Greater is nearer to the light.
        form: Linear(Lanes),
        /// Nearness n is within n (1 +- relative) +- absolute.
        relative: Lanes.F32,
        absolute: Lanes.F32,
        /// Lanes whose bounds hold and are worth anything; others are up to the exact test.
        decisive: Lanes.Mask,
    };
}
