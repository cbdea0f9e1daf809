//! Anisotropic GGX in lanes: microfacets that are rougher along one tangent than across.
//!
//! In: directions in a frame whose x is the tangent of increased roughness, y the bitangent and z
//! the normal, and alpha along each. Out: density and Smith's term of KHR_materials_anisotropy
//! (Heitz 2014, "Understanding the Masking-Shadowing Function", appendix A), and directional
//! albedos by the fits for equal alphas. `microfacet.visibleNormalOf` samples. Everything is
//! + - * / sqrt in a fixed order.

const std = @import("std");
const simd = @import("../../simd.zig");
const albedo_file = @import("albedo.zig");
const chi_squared = @import("chi_squared.zig");
const microfacet = @import("microfacet.zig");

/// Alpha along the tangent and across: the first grows with the strength, 0..1.
pub inline fn alphasOf(
    comptime Lanes: type,
    alpha: Lanes.F32,
    strength: Lanes.F32,
) [2]Lanes.F32 {
    const grown = Lanes.F32.splat(1).sub(alpha).mul(strength.mul(strength));
    return .{ alpha.add(grown), alpha };
}

/// Density of the microfacets' normals by solid angle, projected on the surface, per steradian, at
/// a unit vector.
pub inline fn distribution(
    comptime Lanes: type,
    half: Lanes.Vec3,
    alphas: [2]Lanes.F32,
) Lanes.F32 {
    const product = alphas[0].mul(alphas[1]);
    const scaled: Lanes.Vec3 = .{
        .x = half.x.mul(alphas[1]),
        .y = half.y.mul(alphas[0]),
        .z = half.z.mul(product),
    };
    const ratio = product.div(scaled.dot(scaled));
    return product.mul(ratio).mul(ratio).mul(.splat(1.0 / std.math.pi));
}

/// As `microfacet.smith`, of a unit vector.
pub inline fn smith(
    comptime Lanes: type,
    direction: Lanes.Vec3,
    alphas: [2]Lanes.F32,
) Lanes.F32 {
    return (Lanes.Vec3{
        .x = direction.x.mul(alphas[0]),
        .y = direction.y.mul(alphas[1]),
        .z = direction.z,
    }).length();
}

/// The alpha of equally rough microfacets with about the same albedos, in the mean over directions.
pub inline fn effectiveAlpha(comptime Lanes: type, alphas: [2]Lanes.F32) Lanes.F32 {
    const half: Lanes.F32 = .splat(0.5);
    const mean = alphas[0].add(alphas[1]).mul(half);
    const squares = alphas[0].mul(alphas[0]).add(alphas[1].mul(alphas[1]));
    const root_mean_square = squares.mul(half).sqrt();
    return mean.add(root_mean_square.sub(mean).mul(.splat(0.85)));
}

/// The albedo towards a unit vector, of `albedo` for `effectiveAlpha`: at the cosine for which such
/// microfacets are as much in each other's way. Where strength is 0.6 at most, E is within 4 % of
/// the integral (else 9 %; 1 % in the mean); the albedo for f0 = 0.04 within 13 % (else 23 %; 2 %
/// in the mean).
pub fn directional(
    comptime Lanes: type,
    albedo: *const albedo_file.Albedo(Lanes),
    direction: Lanes.Vec3,
    alphas: [2]Lanes.F32,
) albedo_file.Directional(Lanes) {
    @setEvalBranchQuota(10_000);
    const F32 = Lanes.F32;
    const one: F32 = .splat(1);
    const least: F32 = .splat(albedo_file.cosine_least);
    const cosine = direction.z.max(least).min(one);
    const x = direction.x.mul(alphas[0]);
    const y = direction.y.mul(alphas[1]);
    const stretched = x.mul(x).add(y.mul(y));
    const slope = stretched.div(albedo.alpha.mul(albedo.alpha).max(.splat(1e-12)));
    const bent = cosine.div(cosine.mul(cosine).add(slope).sqrt()).max(least).min(one);
    // Schlick's weight is between those at the bent cosine, scaled back, and of the roughness along
    // the direction, nearer to the latter where that is along the tangent.
    const sine_squared = direction.x.mul(direction.x).add(direction.y.mul(direction.y));
    const along = stretched.div(sine_squared.max(.splat(1e-12))).sqrt();
    const has_azimuth = sine_squared.gt(.splat(1e-9));
    const projected: albedo_file.Albedo(Lanes) =
        .of(F32.select(has_azimuth, along, albedo.alpha).min(one));
    const scaled = albedo.schlickCosine(bent).mul(cosine).div(bent).min(one);
    const rest = projected.schlickCosine(cosine).sub(scaled);
    const turned = direction.x.mul(direction.x).div(sine_squared.max(.splat(1e-12)));
    const m = scaled.add(rest.mul(turned.mul(.splat(0.3)).add(.splat(0.5))));
    return .{
        .missing = albedo.at(bent).missing,
        .schlick = microfacet.power5(Lanes, one.sub(m)),
    };
}

const Single = simd.Lanes(.scalar, 1);
const pairs = [_][2]f32{ .{ 0.3, 0.3 }, .{ 0.6, 0.2 }, .{ 1, 0.25 } };

fn lanesOf(pair: [2]f32) [2]Single.F32 {
    return .{ .splat(pair[0]), .splat(pair[1]) };
}

fn directionAt(cosine: f32, azimuth: f32) [3]f32 {
    const sine = @sqrt(1 - cosine * cosine);
    return .{ sine * @cos(azimuth), sine * @sin(azimuth), cosine };
}

test "the tangent's alpha grows to 1 with the square of the strength" {
    const alphas = alphasOf(Single, .splat(0.2), .splat(0.5));
    try std.testing.expectApproxEqAbs(0.4, alphas[0].lane(0), 1e-6);
    try std.testing.expectEqual(0.2, alphas[1].lane(0));
    try std.testing.expectEqual(0.2, alphasOf(Single, .splat(0.2), .splat(0))[0].lane(0));
    try std.testing.expectEqual(1, alphasOf(Single, .splat(0.2), .splat(1))[0].lane(0));
}

test "the distribution covers the surface once" {
    for (pairs) |pair| {
        var sum: f64 = 0;
        const steps = 96;
        for (0..steps) |i| for (0..steps) |j| {
            // Cosine 1 - x^2: dense around the normal.
            const x = (@as(f32, @floatFromInt(i)) + 0.5) / steps;
            const angle = (@as(f32, @floatFromInt(j)) + 0.5) / steps * std.math.pi;
            const cosine = 1 - x * x;
            const half: Single.Vec3 = .splat(directionAt(cosine, angle));
            const density = distribution(Single, half, lanesOf(pair)).lane(0);
            sum += density * cosine * 2 * x * 2 * std.math.pi / (steps * steps);
        };
        try std.testing.expectApproxEqRel(1, sum, 0.002);
    }
}

test "equal alphas are those of the isotropic functions" {
    for ([_]f32{ 0.04, 0.3, 1 }) |alpha| for ([_]f32{ 0.02, 0.4, 0.9, 1 }) |cosine| {
        const a: Single.F32 = .splat(alpha * alpha);
        const alphas = lanesOf(.{ alpha, alpha });
        const direction: Single.Vec3 = .splat(directionAt(cosine, 0.7));
        const tolerance = 1e-4;
        try std.testing.expectApproxEqRel(
            microfacet.distribution(Single, direction.z, a).lane(0),
            distribution(Single, direction, alphas).lane(0),
            tolerance,
        );
        try std.testing.expectApproxEqRel(
            microfacet.smith(Single, direction.z, a).lane(0),
            smith(Single, direction, alphas).lane(0),
            tolerance,
        );
        const mean = effectiveAlpha(Single, alphas);
        try std.testing.expectApproxEqRel(alpha, mean.lane(0), 1e-6);
        const albedo: albedo_file.Albedo(Single) = .of(mean);
        const wanted = albedo.at(direction.z);
        const found = directional(Single, &albedo, direction, alphas);
        try std.testing.expectApproxEqAbs(wanted.missing.lane(0), found.missing.lane(0), tolerance);
        try std.testing.expectApproxEqAbs(wanted.schlick.lane(0), found.schlick.lane(0), tolerance);
    };
}

/// Mirror images of the view about visible normals, with their density.
const Mirrored = struct {
    view: [3]f32,
    alphas: [2]f32,

    pub fn sample(lobe: *const Mirrored, numbers: [3]f32) [3]f32 {
        const point = microfacet.disc(Single, .{ .splat(numbers[0]), .splat(numbers[1]) });
        return lobe.reflect(point).lane(0);
    }

    fn reflect(lobe: *const Mirrored, point: [2]Single.F32) Single.Vec3 {
        const view: Single.Vec3 = .splat(lobe.view);
        const half = microfacet.visibleNormalOf(Single, view, lanesOf(lobe.alphas), point);
        return half.scale(view.dot(half).mul(.splat(2))).sub(view);
    }

    pub fn pdf(lobe: *const Mirrored, direction: [3]f32) f32 {
        const view: Single.Vec3 = .splat(lobe.view);
        const half = view.add(.splat(direction)).normalize();
        if (half.z.lane(0) <= 0) return 0;
        const alphas = lanesOf(lobe.alphas);
        const seen = lobe.view[2] + smith(Single, view, alphas).lane(0);
        return distribution(Single, half, alphas).lane(0) / (2 * seen);
    }

    /// E, and the part of it that Schlick's weight weighs.
    fn integrate(lobe: *const Mirrored) [2]f64 {
        const steps = 48;
        const alphas = lanesOf(lobe.alphas);
        const view: Single.Vec3 = .splat(lobe.view);
        const cosine = lobe.view[2];
        const smith_view = smith(Single, view, alphas).lane(0);
        var sums: [2]f64 = .{ 0, 0 };
        for (0..steps) |i| for (0..steps) |j| {
            const angle = (@as(f32, @floatFromInt(i)) + 0.5) / steps * 2 * std.math.pi;
            const v = (@as(f32, @floatFromInt(j)) + 0.5) / steps;
            const radius = @sqrt(1 - (v * v) * (v * v));
            const to_light = lobe.reflect(.{
                .splat(radius * @cos(angle)),
                .splat(radius * @sin(angle)),
            });
            const cos_light = to_light.z.lane(0);
            if (cos_light <= 0) continue;
            const smith_light = smith(Single, to_light, alphas).lane(0);
            const weight = 4 * v * v * v * cos_light * (cosine + smith_view) /
                (cosine * smith_light + cos_light * smith_view) / (steps * steps);
            const view_half = view.dot(view.add(to_light).normalize()).lane(0);
            sums[0] += weight;
            sums[1] += weight *
                microfacet.power5(Single, .splat(@max(1 - view_half, 0))).lane(0);
        };
        return sums;
    }
};

test "mirror images about visible normals have their density, by chi-squared" {
    for (pairs) |pair| for ([_]f32{ 0.3, 0.9 }) |cosine| {
        try chi_squared.expectDistributed(&Mirrored{
            .view = directionAt(cosine, 0.6),
            .alphas = pair,
        });
    };
}

test "albedos are near the integrals" {
    const cases = [_]struct { alphas: [2]f32, tolerances: [2]f64 }{
        .{ .alphas = .{ 0.3, 0.3 }, .tolerances = .{ 0.01, 0.01 } },
        .{ .alphas = .{ 0.27, 0.1 }, .tolerances = .{ 0.04, 0.06 } },
        .{ .alphas = .{ 0.52, 0.25 }, .tolerances = .{ 0.04, 0.13 } },
        .{ .alphas = .{ 1, 0.1 }, .tolerances = .{ 0.09, 0.23 } },
    };
    for (cases) |case| for ([_]f32{ 0.1, 0.3, 0.7, 1 }) |cosine| for (0..3) |turn| {
        const azimuth = @as(f32, @floatFromInt(turn)) * std.math.pi / 4.0;
        const lobe: Mirrored = .{ .view = directionAt(cosine, azimuth), .alphas = case.alphas };
        const exact = lobe.integrate();
        const alphas = lanesOf(case.alphas);
        const albedo: albedo_file.Albedo(Single) = .of(effectiveAlpha(Single, alphas));
        const found = directional(Single, &albedo, .splat(lobe.view), alphas);
        errdefer std.debug.print("{any} {d} {d}\n", .{ case.alphas, cosine, turn });
        for ([_]f32{ 1, 0.04 }, case.tolerances) |f0, tolerance| {
            const wanted = f0 * (exact[0] - exact[1]) + exact[1];
            const value: f64 = found.single(.splat(f0), .splat(1)).lane(0);
            try std.testing.expectApproxEqRel(wanted, value, tolerance);
        }
    };
}
