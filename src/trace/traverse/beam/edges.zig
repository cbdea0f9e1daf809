//! 3D rasterisation (Davidovic et al. 2012, "3D Rasterization: A Bridge between Rasterization and
//! Ray Casting"): edge functions and 1/t of triangles as seen from the point that rays share, all
//! linear in a ray's direction, each with a bound on what rounding may have done to it.
//!
//! In: a pack of triangles, the rays' origin. Out: per triangle the vectors whose dot products
//! with a direction D are the edge functions and 1/t. Edges are taken in Pluecker form,
//! (c + b) x (c - b) = 2 b x c, with the difference of the corners as they are in the scene: then
//! the rounding of an edge is in proportion to its length, not to its distance.
//!
//! What is decided here is a filter. Where |edge function| exceeds its bound, or two 1/t differ by
//! more than theirs, the exact test (`triangle.zig`) must come to the same answer; anything nearer
//! is in doubt and asks the exact test itself.
//!
//! The bounds, with u = 2^-24, R the largest distance of a corner, L the longest edge, D the
//! direction, T by how much directions of a beam differ, N the normal, S the sum of the absolute
//! products that its components are differences of, det = a . N.
//!
//! Of an edge function, in units of u R L |D|: 8 from rounding b, c and their sum, 2 from the edge,
//! 5 from the cross product, 6 from the dot product; 48 T / |D| from stepping over a grid. The
//! exact test moves corners by up to 4 sqrt(2) u R across the ray, on a plane that is stretched by
//! up to sqrt(3): 40 if that cannot turn the triangle over, for which |det| > 64 u R^2 L is enough.
//!
//! Of 1/t: det is off by 8 u R S, N . D by 7 u S |D|. The exact test's t is that of a point of the
//! triangle's plane off the ray by as much as corners are moved, and weighed with edge functions
//! that are off by 2 u L^2 of their area (at least |det| / R): relative to 1/t that is
//! 9 (1 + L^3 / |det|) u R S / |det| and 16 u; corners' depths and their sum are off by 6 sqrt(3)
//! u R / |D|, and |D| t is at least |det| / S: 11 u R S / |det|. A quarter is added to all of it
//! for what is of second order.

const std = @import("std");

/// Half a unit in the last place of 1.
pub const unit_roundoff: f32 = 0x1p-24;

/// Bounds in the units above.
pub const edge_ulps = 76.0;
/// Of an edge function stepped over directions that differ by T.
pub const step_ulps = 60.0;
/// Twice what is derived above: the relative part is taken of the rounded value.
pub const inverse_ulps = 18.0;
const inverse_relative_ulps = 36.0;
const weight_ulps = 11.0;

/// 1/t whose relative error may reach this is left to the exact test.
pub const relative_error_max = 0.125;

/// See above: |det| over u R^2 L that keeps a triangle from being turned over by rounding. Then the
/// sign of the rounded det is right, too: it is off by less than 8 u R S, S is at most 3 L^2, L at
/// most 2 R.
pub const turning_ulps = 64.0;

/// Outside of this range of L^2 and R, in metres, products may leave the range of floats.
pub const length_squared_min = 0x1p-80;
/// See `length_squared_min`.
pub const reach_max = 1e11;

/// Triangles of a pack in lanes, turned so that edge functions are positive within.
pub fn Edges(comptime Lanes: type) type {
    const F32 = Lanes.F32;
    const Vec3 = Lanes.Vec3;
    return struct {
        /// Edge function i of a ray with direction D is `normal[i]` . D.
        normal: [3]Vec3,
        /// Bound of the error of an edge function over u |D|, without its factor of ulps.
        slack: F32,
        facet: Facet(Lanes),

        const Self = @This();

        /// Sets up the triangles of a pack. Bounds do not hold for those with a corner farther
        /// away than `reach_max`.
        pub inline fn init(corners: [3]Vec3, origin: Vec3) Self {
            const a = corners[0].sub(origin);
            const b = corners[1].sub(origin);
            const c = corners[2].sub(origin);
            const edges: [3]Vec3 = .{
                corners[2].sub(corners[1]),
                corners[0].sub(corners[2]),
                corners[1].sub(corners[0]),
            };
            const plane = cross(Lanes, edges[1], edges[2]);
            const det = dot(Lanes, a, plane);
            const flip: F32 = .select(det.lt(.zero()), .splat(-1), .splat(1));
            const length_squared = longestSquared(Lanes, edges);
            const length = length_squared.sqrt();
            const reach = longestSquared(Lanes, .{ a, b, c }).sqrt();
            const unit: F32 = .splat(unit_roundoff);
            return .{
                .normal = .{
                    cross(Lanes, c.add(b), edges[0]).scale(flip),
                    cross(Lanes, a.add(c), edges[1]).scale(flip),
                    cross(Lanes, b.add(a), edges[2]).scale(flip),
                },
                .slack = reach.mul(reach.mulAdd(unit.add(unit), length)),
                .facet = .{
                    .turned = isTurned(Lanes, det, reach.mul(reach), length_squared, length)
                        .bitAnd(reach.lt(.splat(reach_max))),
                    .reach = reach,
                    .length = length,
                    .corner = a,
                    .sides = .{ edges[1], edges[2] },
                    .plane = plane,
                    .det = det,
                },
            };
        }
    };
}

/// What depth is made of, kept until the edges have left something.
pub fn Facet(comptime Lanes: type) type {
    const F32 = Lanes.F32;
    return struct {
        /// Lanes of which it is sure how they are turned, and where bounds hold.
        turned: Lanes.Mask,
        /// The largest distance of a corner, and the length of the longest edge.
        reach: F32,
        length: F32,
        /// A corner from the origin, two edges, their cross product N, and det.
        corner: Lanes.Vec3,
        sides: [2]Lanes.Vec3,
        plane: Lanes.Vec3,
        det: F32,

        const Self = @This();

        /// 1 / det, and of that bounds are made of: S / |det| and L^3 / |det|.
        pub inline fn shape(facet: *const Self) struct { F32, F32, F32 } {
            const det_inv = F32.splat(1).div(facet.det);
            const size = det_inv.abs();
            const length = facet.length;
            return .{
                det_inv,
                absoluteCross(Lanes, facet.sides[0], facet.sides[1]).mul(size),
                length.mul(length).mul(length).mul(size),
            };
        }

        /// 1/t.
        pub inline fn inverse(facet: *const Self) Inverse(Lanes) {
            const det_inv, const steepness, const thinness = facet.shape();
            const relative = weighed(Lanes, steepness.mul(facet.reach), thinness);
            return .{
                .vector = facet.plane.scale(det_inv),
                .relative = relative,
                .absolute = steepness,
                .decisive = facet.turned.bitAnd(relative.lt(.splat(relative_error_max))),
            };
        }
    };
}

/// 1/t of triangles in lanes.
pub fn Inverse(comptime Lanes: type) type {
    return struct {
        /// 1/t of a ray with direction D is `vector` . D.
        vector: Lanes.Vec3,
        /// Bound of its relative error.
        relative: Lanes.F32,
        /// Bound of the rest of its error over u |D|, without its factor of ulps.
        absolute: Lanes.F32,
        /// Lanes whose bounds hold and are worth anything; others are up to the exact test.
        decisive: Lanes.Mask,
    };
}

/// Lanes whose det has the sign that it should, rounding of corners by the exact test included, and
/// whose edges are long enough for bounds to hold. `scale` is R^2, or what else stands for it.
pub inline fn isTurned(
    comptime Lanes: type,
    det: Lanes.F32,
    scale: Lanes.F32,
    length_squared: Lanes.F32,
    length: Lanes.F32,
) Lanes.Mask {
    const least = scale.mul(length).mul(.splat(turning_ulps * unit_roundoff));
    return det.abs().gt(least).bitAnd(length_squared.gt(.splat(length_squared_min)));
}

/// Bound of the relative error of 1/t: `steepness` is R S / |det|, `thinness` L^3 / |det|.
pub inline fn weighed(
    comptime Lanes: type,
    steepness: Lanes.F32,
    thinness: Lanes.F32,
) Lanes.F32 {
    const constant: Lanes.F32 = .splat(inverse_relative_ulps * unit_roundoff);
    const share = thinness.mulAdd(.splat(weight_ulps * unit_roundoff), constant);
    return steepness.mulAdd(share, constant);
}

/// The sum over components of a x b of the absolute products.
pub inline fn absoluteCross(comptime Lanes: type, a: Lanes.Vec3, b: Lanes.Vec3) Lanes.F32 {
    const p = a.abs();
    const q = b.abs();
    const x = p.y.mulAdd(q.z, p.z.mul(q.y));
    const y = p.z.mulAdd(q.x, p.x.mulAdd(q.z, x));
    return p.x.mulAdd(q.y, p.y.mulAdd(q.x, y));
}

/// a . b, fused where the target can: for culling only.
pub inline fn dot(comptime Lanes: type, a: Lanes.Vec3, b: Lanes.Vec3) Lanes.F32 {
    return a.x.mulAdd(b.x, a.y.mulAdd(b.y, a.z.mul(b.z)));
}

/// The square of the longest of three vectors.
pub inline fn longestSquared(comptime Lanes: type, vectors: [3]Lanes.Vec3) Lanes.F32 {
    return dot(Lanes, vectors[0], vectors[0]).maxFast(dot(Lanes, vectors[1], vectors[1]))
        .maxFast(dot(Lanes, vectors[2], vectors[2]));
}

/// a x b, fused where the target can: for culling only.
pub inline fn cross(comptime Lanes: type, a: Lanes.Vec3, b: Lanes.Vec3) Lanes.Vec3 {
    return .{
        .x = a.z.neg().mulAdd(b.y, a.y.mul(b.z)),
        .y = a.x.neg().mulAdd(b.z, a.z.mul(b.x)),
        .z = a.y.neg().mulAdd(b.x, a.x.mul(b.y)),
    };
}
