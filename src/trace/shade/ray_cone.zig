//! Ray cones: how wide a ray is, so that textures are looked up as finely as they are seen.
//!
//! In: cones along rays, the triangles that they meet. Out: the ellipses that they cover there,
//! and the cones of rays that go on. A cone has a width and a spread, the growth of the width by
//! distance (Akenine-Moeller, Crassin, Boksansky, Belcour, Panteleev and Wright 2021, "Improved
//! Shader and Texture Level of Detail Using Ray Cones", Journal of Computer Graphics Techniques
//! 10(1)). Both have signs: behind a focus the width is negative, and grows again.

const std = @import("std");
const simd = @import("../../simd.zig");
const interaction_file = @import("interaction.zig");

/// Least cosine that an ellipse gets its length from.
const cosine_min = 1e-3;

/// Least sine at which the direction of the longer axis is told from those of the ray and normal.
const sine_min = 1e-3;

/// Largest spread, and its opposite.
const spread_max = 2;

/// A width of a cone on a triangle, as changes of barycentric weights.
pub fn Axes(comptime Lanes: type) type {
    return struct {
        /// By axis of the ellipse, from end to end: of the weights of corners 1 and 2.
        weights: [2][2]Lanes.F32,

        /// On the triangle with these corners; the direction is of unit length.
        pub inline fn ofCorners(
            corners: [3]Lanes.Vec3,
            direction: Lanes.Vec3,
            width: Lanes.F32,
        ) @This() {
            const edges = [2]Lanes.Vec3{ corners[1].sub(corners[0]), corners[2].sub(corners[0]) };
            const plane = edges[0].cross(edges[1]);
            return .of(edges, plane, interaction_file.unit(Lanes, plane), direction, width);
        }

        /// `plane` is the cross product of the edges from corner 0, `face` the same at unit length;
        /// the direction is of unit length.
        pub inline fn of(
            edges: [2]Lanes.Vec3,
            plane: Lanes.Vec3,
            face: Lanes.Vec3,
            direction: Lanes.Vec3,
            width: Lanes.F32,
        ) @This() {
            const F32 = Lanes.F32;
            const one: F32 = .splat(1);
            const size = width.abs();
            const level = face.cross(direction);
            const sine = level.length();
            const is_told = sine.gt(.splat(sine_min));
            const across = Lanes.Vec3
                .select(is_told, level, edges[0])
                .scale(one.div(F32.select(is_told, sine, edges[0].length())));
            const along = across.cross(face);
            const cosine = face.dot(direction).abs().max(.splat(cosine_min));
            const area_inverse = one.div(face.dot(plane));
            const gradients = [2]Lanes.Vec3{
                edges[1].cross(face).scale(area_inverse),
                face.cross(edges[0]).scale(area_inverse),
            };
            const length = size.div(cosine);
            return .{ .weights = .{
                .{ along.dot(gradients[0]).mul(length), along.dot(gradients[1]).mul(length) },
                .{ across.dot(gradients[0]).mul(size), across.dot(gradients[1]).mul(size) },
            } };
        }
    };
}

/// Curvature of a triangle between vertices: by how much unit normals turn along its edges, per
/// metre, the mean of the three (the same paper, section 4); 0 where a normal is zero.
pub inline fn curvatureOf(
    comptime Lanes: type,
    corners: [3]Lanes.Vec3,
    normals: [3]Lanes.Vec3,
) Lanes.F32 {
    const F32 = Lanes.F32;
    var units: [3]Lanes.Vec3 = undefined;
    var is_known: Lanes.Mask = .splat(true);
    for (&units, normals) |*to, normal| {
        const length = normal.length();
        is_known = is_known.bitAnd(length.gt(.zero())).bitAnd(length.lt(.splat(std.math.inf(f32))));
        to.* = normal.scale(F32.splat(1).div(length));
    }
    var sum: F32 = .zero();
    inline for (.{ .{ 0, 1 }, .{ 1, 2 }, .{ 2, 0 } }) |ends| {
        const edge = corners[ends[1]].sub(corners[ends[0]]);
        const turn = units[ends[1]].sub(units[ends[0]]);
        sum = sum.add(turn.dot(edge).div(edge.dot(edge)));
    }
    const mean = sum.mul(.splat(1.0 / 3.0));
    const is_finite = mean.abs().lt(.splat(std.math.inf(f32)));
    return .select(is_known.bitAnd(is_finite), mean, .zero());
}

/// Width at a distance along the ray.
pub inline fn widthAt(
    comptime Lanes: type,
    width: Lanes.F32,
    spread: Lanes.F32,
    distance: Lanes.F32,
) Lanes.F32 {
    return width.add(spread.mul(distance));
}

/// Spread after a mirror of some curvature, positive where it bulges towards the ray: normals turn
/// by curvature times width over the cone, reflections by twice that. In the plane of incidence it
/// is more, over the cosine, across it less, times the cosine: this keeps the area.
pub inline fn reflected(
    comptime Lanes: type,
    spread: Lanes.F32,
    width: Lanes.F32,
    curvature: Lanes.F32,
) Lanes.F32 {
    const turn = curvature.mul(width);
    return bounded(Lanes, spread.add(turn.add(turn)));
}

/// Spread after Snell's refraction near the normal; `eta` is the index of refraction before over
/// that behind.
pub inline fn refracted(
    comptime Lanes: type,
    spread: Lanes.F32,
    width: Lanes.F32,
    curvature: Lanes.F32,
    eta: Lanes.F32,
) Lanes.F32 {
    const turn = curvature.mul(width);
    return bounded(Lanes, eta.mul(spread).sub(Lanes.F32.splat(1).sub(eta).mul(turn)));
}

inline fn bounded(comptime Lanes: type, spread: Lanes.F32) Lanes.F32 {
    return spread.max(.splat(-spread_max)).min(.splat(spread_max));
}

const Single = simd.Lanes(.scalar, 1);

fn vector(components: [3]f32) Single.Vec3 {
    return .splat(components);
}

/// Lengths of both axes in metres on the triangle (0,0,0), (2,0,0), (0,0,-2).
fn testLengths(direction: [3]f32, width: f32) [2]f32 {
    const edges = [2]Single.Vec3{ vector(.{ 2, 0, 0 }), vector(.{ 0, 0, -2 }) };
    const unit = vector(direction).normalize();
    const axes = Axes(Single)
        .of(edges, vector(.{ 0, 4, 0 }), vector(.{ 0, 1, 0 }), unit, .splat(width));
    var lengths: [2]f32 = undefined;
    for (&lengths, axes.weights) |*to, weights| {
        const x = 2 * weights[0].lane(0);
        const z = -2 * weights[1].lane(0);
        to.* = @sqrt(x * x + z * z);
    }
    return lengths;
}

test "a cone covers a circle straight below it, an ellipse aslant" {
    const expectClose = std.testing.expectApproxEqRel;
    for ([_][3]f32{ .{ 0, -1, 0 }, .{ 0, 1, 0 } }) |direction| {
        for (testLengths(direction, 0.25)) |length| try expectClose(0.25, length, 1e-6);
    }
    const aslant = testLengths(.{ 0.8, -0.6, 0 }, -0.3);
    try expectClose(0.5, aslant[0], 1e-6);
    try expectClose(0.3, aslant[1], 1e-6);
    for (testLengths(.{ 1, 0, 0 }, 1)) |length| try std.testing.expect(length <= 1001);
}

test "the curvature of a sphere is one over its radius, of a plane 0" {
    const normals = [3]Single.Vec3{
        vector(.{ 0, 1, 0 }), vector(.{ 0.6, 0.8, 0 }), vector(.{ 0, 0.8, 0.6 }),
    };
    var corners: [3]Single.Vec3 = undefined;
    for (&corners, normals) |*corner, normal| corner.* = normal.scale(.splat(5));
    const found = curvatureOf(Single, corners, normals).lane(0);
    try std.testing.expectApproxEqRel(@as(f32, 0.2), found, 1e-6);
    const flat: [3]Single.Vec3 = @splat(normals[0].scale(.splat(3)));
    try std.testing.expectEqual(0, curvatureOf(Single, corners, flat).lane(0));
    const none = [3]Single.Vec3{ normals[0], vector(.{ 0, 0, 0 }), normals[1] };
    try std.testing.expectEqual(0, curvatureOf(Single, corners, none).lane(0));
    const point: [3]Single.Vec3 = @splat(corners[0]);
    try std.testing.expectEqual(0, curvatureOf(Single, point, normals).lane(0));
}

test "a plane mirror keeps a cone, a convex one opens it, a concave one brings it to a focus" {
    const width: Single.F32 = .splat(0.1);
    const spread: Single.F32 = .splat(0.01);
    const Case = struct { f32, f32 };
    for ([_]Case{ .{ 0, 0.01 }, .{ 2, 0.41 }, .{ -2, -0.39 } }) |case| {
        const after = reflected(Single, spread, width, .splat(case[0]));
        try std.testing.expectApproxEqRel(case[1], after.lane(0), 1e-6);
    }
    // Parallel rays on a mirror of radius 2 meet 1 away from it.
    const focused = reflected(Single, .zero(), width, .splat(-0.5));
    try std.testing.expectEqual(0, widthAt(Single, width, focused, .splat(1)).lane(0));
}

test "a plane boundary bends a cone by Snell's law, a lens focuses it" {
    const width: Single.F32 = .splat(0.1);
    const flat = refracted(Single, .splat(0.03), width, .zero(), .splat(1.0 / 1.5));
    try std.testing.expectApproxEqRel(@as(f32, 0.02), flat.lane(0), 1e-6);
    // Focal length of one spherical surface: r n / (n - 1) = 3 for r = 1, n = 1.5.
    const lens = refracted(Single, .zero(), width, .splat(1), .splat(1.0 / 1.5));
    try std.testing.expectApproxEqAbs(
        @as(f32, 0),
        widthAt(Single, width, lens, .splat(3)).lane(0),
        1e-7,
    );
}
