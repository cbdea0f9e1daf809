//! GGX microfacets in lanes: distribution, height-correlated shadowing, visible normals.
//!
//! In: cosines to the normal, alpha (the square of roughness), numbers in 0..1. Out: densities, and
//! normals and directions distributed by them. Formulas: Walter et al. 2007 for the distribution,
//! Heitz 2014 ("Understanding the Masking-Shadowing Function") for Smith's terms, Dupuy and Benyoub
//! 2023 ("Sampling Visible GGX Normals with Spherical Caps"), Shirley and Chiu 1997 for the disc.
//! Everything is + - * / sqrt in a fixed order.

const std = @import("std");
const simd = @import("../../simd.zig");

/// Density of the microfacets' normals by solid angle, projected on the surface, per steradian.
/// `a` is alpha squared.
pub inline fn distribution(comptime Lanes: type, cos_half: Lanes.F32, a: Lanes.F32) Lanes.F32 {
    const slope = cos_half.mul(cos_half).mul(a.sub(.splat(1))).add(.splat(1));
    return a.div(slope.mul(slope).mul(.splat(std.math.pi)));
}

/// Square root of Smith's shadowing term for GGX (Heitz 2014, equation 99), a length: the cosine
/// itself where smooth. `a` is alpha squared.
pub inline fn smith(comptime Lanes: type, cosine: Lanes.F32, a: Lanes.F32) Lanes.F32 {
    return cosine.mul(cosine).mul(Lanes.F32.splat(1).sub(a)).add(a).sqrt();
}

/// x^5, the weight in Schlick's approximation of Fresnel's reflectance for x = 1 - cosine.
pub inline fn power5(comptime Lanes: type, x: Lanes.F32) Lanes.F32 {
    const squared = x.mul(x);
    return squared.mul(squared).mul(x);
}

/// Point of the unit disc, uniform for uniform numbers in 0..1.
pub inline fn disc(comptime Lanes: type, numbers: [2]Lanes.F32) [2]Lanes.F32 {
    const F32 = Lanes.F32;
    const one: F32 = .splat(1);
    const x = numbers[0].add(numbers[0]).sub(one);
    const y = numbers[1].add(numbers[1]).sub(one);
    const wide = x.abs().gt(y.abs());
    const radius = F32.select(wide, x, y);
    const other = F32.select(wide, y, x);
    const nonzero = F32.select(radius.eq(.zero()), one, radius);
    // Taylor series to the 9th power on |angle| <= pi / 4: the rest is below 2e-9.
    const angle = other.div(nonzero).mul(.splat(std.math.pi / 4.0));
    const squared = angle.mul(angle);
    var sine: F32 = one;
    var cosine: F32 = one;
    comptime var n = 8;
    inline while (n > 0) : (n -= 2) {
        sine = one.sub(sine.mul(squared).mul(.splat(1.0 / @as(f32, n * (n + 1)))));
        cosine = one.sub(cosine.mul(squared).mul(.splat(1.0 / @as(f32, n * (n - 1)))));
    }
    const along = radius.mul(cosine);
    const across = radius.mul(sine.mul(angle));
    return .{ F32.select(wide, along, across), F32.select(wide, across, along) };
}

/// Normal of a microfacet that a view from the front sees, distributed as they are seen for points
/// of the unit disc. Unit vectors, z along the surface's normal.
pub inline fn visibleNormal(
    comptime Lanes: type,
    view: Lanes.Vec3,
    alpha: Lanes.F32,
    point: [2]Lanes.F32,
) Lanes.Vec3 {
    return visibleNormalOf(Lanes, view, .{ alpha, alpha }, point);
}

/// `visibleNormal` for an alpha along x and one along y.
pub inline fn visibleNormalOf(
    comptime Lanes: type,
    view: Lanes.Vec3,
    alphas: [2]Lanes.F32,
    point: [2]Lanes.F32,
) Lanes.Vec3 {
    const one: Lanes.F32 = .splat(1);
    // The hemisphere of which a stretched one is the surface sees the cap that its mirror images
    // towards the view fill.
    const stretched = (Lanes.Vec3{
        .x = view.x.mul(alphas[0]),
        .y = view.y.mul(alphas[1]),
        .z = view.z,
    }).normalize();
    const squared = point[0].mul(point[0]).add(point[1].mul(point[1])).min(one);
    // Lambert's equal-area projection: heights fall with the square of the radius.
    const height = one.add(stretched.z);
    const z = one.sub(squared.mul(height));
    const scale = height.mul(one.add(one).sub(squared.mul(height))).max(.zero()).sqrt();
    const half: Lanes.Vec3 = .{
        .x = point[0].mul(scale).add(stretched.x).mul(alphas[0]),
        .y = point[1].mul(scale).add(stretched.y).mul(alphas[1]),
        .z = z.add(stretched.z).max(.zero()),
    };
    const squares = half.dot(half);
    // A smooth surface seen at grazing angles has no length left to be normalised.
    const flat: Lanes.Vec3 = .splat(.{ 0, 0, 1 });
    return .select(squares.gt(.splat(1e-30)), half.scale(one.div(squares.sqrt())), flat);
}

/// Two unit vectors across a unit normal and each other (Duff et al. 2017, "Building an
/// Orthonormal Basis, Revisited").
pub inline fn tangents(comptime Lanes: type, normal: Lanes.Vec3) [2]Lanes.Vec3 {
    const one: Lanes.F32 = .splat(1);
    const sign = one.copySign(normal.z);
    const a = one.neg().div(sign.add(normal.z));
    const b = normal.x.mul(normal.y).mul(a);
    return .{
        .{
            .x = one.add(sign.mul(normal.x).mul(normal.x).mul(a)),
            .y = sign.mul(b),
            .z = sign.mul(normal.x).neg(),
        },
        .{ .x = b, .y = sign.add(normal.y.mul(normal.y).mul(a)), .z = normal.y.neg() },
    };
}

const Single = simd.Lanes(.scalar, 1);

test "the disc is filled evenly, and its edge is a circle" {
    const steps = 64;
    var moments: [4]f64 = .{ 0, 0, 0, 0 };
    for (0..steps) |i| for (0..steps) |j| {
        const u = (@as(f32, @floatFromInt(i)) + 0.5) / steps;
        const v = (@as(f32, @floatFromInt(j)) + 0.5) / steps;
        const point = disc(Single, .{ .splat(u), .splat(v) });
        const x: f64 = point[0].lane(0);
        const y: f64 = point[1].lane(0);
        for (&moments, [_]f64{ x, y, x * x, y * y }) |*moment, value| {
            moment.* += value / (steps * steps);
        }
    };
    try std.testing.expectApproxEqAbs(0, moments[0], 1e-6);
    try std.testing.expectApproxEqAbs(0, moments[1], 1e-6);
    try std.testing.expectApproxEqAbs(0.25, moments[2], 1e-3);
    try std.testing.expectApproxEqAbs(0.25, moments[3], 1e-3);
    for ([_]f32{ 0, 0.2, 0.5, 1 }) |u| {
        const point = disc(Single, .{ .splat(u), .splat(1) });
        const radius = std.math.hypot(point[0].lane(0), point[1].lane(0));
        try std.testing.expectApproxEqRel(1, radius, 1e-6);
    }
    const center = disc(Single, .{ .splat(0.5), .splat(0.5) });
    try std.testing.expectEqual(0, center[0].lane(0));
    try std.testing.expectEqual(0, center[1].lane(0));
}

test "the distribution covers the surface once" {
    for ([_]f32{ 0.01, 0.1, 0.5, 1 }) |alpha| {
        var sum: f64 = 0;
        const steps = 4000;
        for (0..steps) |i| {
            // Cosine 1 - x^4: dense around the normal.
            const x = (@as(f64, @floatFromInt(i)) + 0.5) / steps;
            const cosine = 1 - x * x * x * x;
            const density = distribution(Single, .splat(@floatCast(cosine)), .splat(alpha * alpha));
            sum += density.lane(0) * cosine * 2 * std.math.pi * 4 * x * x * x / steps;
        }
        try std.testing.expectApproxEqRel(1, sum, 0.01);
    }
}

test "tangents are across the normal and each other" {
    for ([_][3]f32{ .{ 0, 0, 1 }, .{ 0, 0, -1 }, .{ 0.48, -0.6, 0.64 } }) |components| {
        const normal: Single.Vec3 = .splat(components);
        const across = tangents(Single, normal);
        for (across) |tangent| {
            try std.testing.expectApproxEqAbs(0, tangent.dot(normal).lane(0), 1e-6);
            try std.testing.expectApproxEqAbs(1, tangent.length().lane(0), 1e-6);
        }
        const third = across[0].cross(across[1]);
        try std.testing.expectApproxEqAbs(1, third.dot(normal).lane(0), 1e-6);
    }
}
