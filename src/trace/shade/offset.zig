//! Ray origins off surfaces by bounds of the rounding error, lest rays meet what they start on.
//!
//! In: a hit, by its triangle, its place and the length of the ray. Out: a length along the
//! geometric normal, in metres. Every hit has a bound of its own (Pharr, Jakob and Humphreys,
//! "Physically Based Rendering", 4th edition, section 6.8), so that a small thing keeps its contact
//! shadows and a thin one its inside, however large the rest of the scene is.
//!
//! The triangle of the hit is left out by its number; neighbours in its plane, and surfaces in the
//! same place, are not. A ray may see its end on the wrong side of them by as much as this, in
//! units of u = 2^-24:
//!
//! - In each coordinate `point_ulps` times its magnitude: the last sum of the position
//!   (`interaction.zig`) rounds once, the sum of point and offset once, and corners of surfaces in
//!   the same place were rounded once when they were put there.
//! - `edge_ulps` times the longest edge L: edges round once, their products with the barycentrics
//!   and the sum of these once each. That these may be off moves a point within its triangle.
//! - `test_ulps` times the distance of corners from a ray's origin. To the exact test
//!   (`traverse/triangle.zig`) a corner is off by up to 4.7 across the ray: differences to the
//!   origin, slopes, their products and the results round once each. Along the ray t adds 9: 3 of
//!   each corner, products and sums 3, the sum of weights 2, the division 1. At no angle is it more
//!   than 10 along the normal. It counts for the ray that found the hit, which may have passed
//!   through what it should have met, and for the ray that starts or ends here.
//! - `sliver_ulps` times L^3 / |N|, where N is twice the area long: each edge function is off by 2
//!   of the product of two corners' distances r from the hit, which moves t by 6 r_a r_b r_c / |N|
//!   along the normal, and in a triangle r_a r_b r_c < 0.22 L^3.
//!
//! Of fifty million random triangles and rays none needed all of the sum. What is not known here is
//! the size of the other triangle, which is taken to be no larger than this one or the rays:
//! `safety` makes up for more. Twice the sum is enough for one 60 times as large.

const std = @import("std");
const simd = @import("../../simd.zig");

/// Half a unit in the last place of 1.
const unit_roundoff: f32 = 0x1p-24;

const point_ulps = 3;
const edge_ulps = 3;
const test_ulps = 10;
const sliver_ulps = 1.5;
/// Of the tests' part; see above.
const safety = 2;

/// No offset exceeds this many times what rounding is padded by at the hit.
pub const pads_max = 8;

/// The bound as far as the hit alone decides it, in metres over u. `normal` is of unit length,
/// `plane` across the triangle and twice its area long.
pub inline fn errorUlps(
    comptime Lanes: type,
    corners: [3]Lanes.Vec3,
    position: Lanes.Vec3,
    normal: Lanes.Vec3,
    plane: Lanes.Vec3,
    ray_length: Lanes.F32,
) Lanes.F32 {
    const edges = [3]Lanes.Vec3{
        corners[1].sub(corners[0]), corners[2].sub(corners[1]), corners[0].sub(corners[2]),
    };
    const longest_squared = edges[0].dot(edges[0]).max(edges[1].dot(edges[1]))
        .max(edges[2].dot(edges[2]));
    const longest = longest_squared.sqrt();
    // A bit less than the length, whose square might leave the range of floats.
    const size = plane.abs();
    const doubled_area = size.x.max(size.y).max(size.z);
    const sliver = longest_squared.div(doubled_area).mul(longest);
    return position.abs().dot(normal.abs()).mul(.splat(point_ulps))
        .add(longest.mul(.splat(edge_ulps + 2 * safety * test_ulps)))
        .add(ray_length.mul(.splat(safety * test_ulps)))
        .add(sliver.mul(.splat(safety * sliver_ulps)));
}

/// The offset in metres of a hit with this error bound, for a ray that has its other end
/// `other_distance` away if it starts there, 0 if it starts here.
pub inline fn length(
    comptime Lanes: type,
    error_ulps: Lanes.F32,
    other_distance: Lanes.F32,
    length_max: Lanes.F32,
) Lanes.F32 {
    const sum = error_ulps.add(other_distance.mul(.splat(safety * test_ulps)));
    // Of the smallest triangles the sum is NaN, which `min` turns into the limit.
    return sum.mul(.splat(unit_roundoff)).min(length_max);
}

const Single = simd.Lanes(.scalar, 1);

fn testLength(size: f32, ray_length: f32, other_distance: f32) f32 {
    const corners: [3]Single.Vec3 = .{
        .splat(.{ 0, 0, 0 }), .splat(.{ size, 0, 0 }), .splat(.{ 0, size, 0 }),
    };
    const plane: Single.Vec3 = .splat(.{ 0, 0, size * size });
    const up: Single.Vec3 = .splat(.{ 0, 0, 1 });
    const hit = errorUlps(Single, corners, corners[0], up, plane, .splat(ray_length));
    return length(Single, hit, .splat(other_distance), .splat(pads_max)).lane(0);
}

test "the offset grows with the triangle and the rays, up to the limit, and is a number" {
    const near = testLength(1, 1, 0);
    try std.testing.expect(near > 0 and near < 1e-5);
    try std.testing.expectApproxEqRel(10 * near, testLength(10, 10, 0), 1e-5);
    try std.testing.expect(testLength(1, 2, 0) > near);
    try std.testing.expectEqual(testLength(1, 2, 0), testLength(1, 1, 1));
    try std.testing.expectEqual(pads_max, testLength(1e9, 1e9, 1e9));
    for ([_]f32{ 0, 1e-30, 1e30, std.math.inf(f32) }) |size| {
        const offset = testLength(size, 1, 0);
        try std.testing.expect(offset > 0 and offset <= pads_max);
    }
}
