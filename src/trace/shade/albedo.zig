//! Directional albedo of GGX (the split sum of Karis 2013) as rational functions of the cosine.
//!
//! In: roughness, then cosines, in lanes. Out: how much of uniform white light a surface of
//! microfacets sends to a view after one reflection, for any reflectance f0 at normal incidence and
//! f90 at grazing incidence:
//!
//!     E(cosine, alpha) * (f0 + (f90 - f0) * (1 - m(cosine, alpha))^5)
//!
//! E is the share that leaves where nothing is absorbed, m the cosine for which Schlick's weight is
//! its mean over the lobe. Both are polynomials of the cosine over each other, whose coefficients
//! are polynomials of alpha: `bench/albedo.py` fits them to integrals, to 1 % of the albedo from
//! f0 = 0.04 on. Evaluated in lanes that is less than to gather four corners out of a table. At
//! alpha 0 E is 1 and m the cosine itself, exactly: Schlick's Fresnel.

const std = @import("std");
const simd = @import("../../simd.zig");
const microfacet = @import("microfacet.zig");

/// Least cosine that has an albedo; the fits are quotients of zeros at grazing and smooth at once.
pub const cosine_least = 1e-4;

/// Least share of light that is counted as scattered more than once, in the mean over cosines:
/// the fits know less of surfaces so smooth.
const missing_mean_least = 3e-4;

/// The albedo of surfaces of some roughness in lanes.
pub fn Albedo(comptime Lanes: type) type {
    return struct {
        /// The square of roughness that it is of; not a number: of none.
        alpha: F32,
        /// Mean over the hemisphere of 1 - E, weighted by the cosine; > 0.
        missing_mean: F32,
        /// That of Schlick's weight over the light that E sends on; 1/21 where smooth.
        schlick_mean: F32,
        missing_above: [2]F32,
        missing_below: [4]F32,
        m_above: [4]F32,
        m_below: [3]F32,

        const F32 = Lanes.F32;

        /// All but `alpha` is undefined.
        pub const unknown: @This() = none: {
            var albedo: @This() = undefined;
            albedo.alpha = .splat(std.math.nan(f32));
            break :none albedo;
        };

        /// For alpha, the square of roughness, 0..1.
        pub inline fn of(alpha: F32) @This() {
            const missing = polynomial(alpha, 2, .{ 9.462515, -30.22713, 107.8654, -20.94779 })
                .div(polynomial(alpha, 0, .{ 1, 16.33319, -43.747, 138.1782 }));
            const schlick = polynomial(alpha, 0, .{ 0.04769431, 0.4108013, -0.1874746, 0.1529256 })
                .div(polynomial(alpha, 0, .{ 1, 9.598781, 52.12378 }));
            return .{
                .alpha = alpha,
                .missing_mean = missing.max(.splat(missing_mean_least)),
                .schlick_mean = schlick,
                .missing_above = .{
                    polynomial(alpha, 1, .{ 0.1718799, 105.6906, -17.87154, 1431.584 }),
                    polynomial(alpha, 1, .{ -1.653908, 1201.054, -133.3309, 8277.698 }),
                },
                .missing_below = .{
                    polynomial(alpha, 2, .{ 0.9653885, 332.3779 }),
                    polynomial(alpha, 1, .{ -0.3860115, 1007.814, 4811.165 }),
                    polynomial(alpha, 0, .{ 1, -746.25, 462.7955, 9785.599 }),
                    polynomial(alpha, 0, .{ 357.7388, 6763.457, -14290.63, 7158.379 }),
                },
                .m_above = .{
                    polynomial(alpha, 2, .{ 7.923903, 191.623, -4.224981 }),
                    polynomial(alpha, 1, .{ -0.05504417, 108.8791, -7.839108 }),
                    polynomial(alpha, 1, .{ 23.26306, -357.3113, -523.789 }),
                    polynomial(alpha, 1, .{ -67.8341, 222.1715, 302.2887 }),
                },
                .m_below = .{
                    polynomial(alpha, 1, .{ 1.649707, 112.7893, 313.0244 }),
                    polynomial(alpha, 0, .{ 1, 81.49354, 614.0128 }),
                    polynomial(alpha, 0, .{ 85.99074, -144.2521, -342.8824 }),
                },
            };
        }

        /// Towards a direction at this cosine to the normal, 0..1.
        pub inline fn at(albedo: *const @This(), cosine: F32) Directional(Lanes) {
            const one: F32 = .splat(1);
            const bounded = cosine.max(.splat(cosine_least)).min(one);
            const missing = horner(bounded, albedo.missing_above).mul(bounded)
                .div(horner(bounded, albedo.missing_below));
            return .{
                .missing = missing.max(.zero()).min(one),
                .schlick = microfacet.power5(Lanes, one.sub(albedo.schlickCosine(bounded))),
            };
        }

        /// The cosine for which Schlick's weight is its mean over the lobe towards a direction at
        /// this cosine to the normal, 1e-4..1.
        pub inline fn schlickCosine(albedo: *const @This(), cosine: F32) F32 {
            const bent = horner(cosine, albedo.m_above).div(horner(cosine, albedo.m_below));
            return cosine.add(bent).max(.zero()).min(.splat(1));
        }

        /// `lowest` is the power of the first coefficient.
        inline fn polynomial(x: F32, comptime lowest: comptime_int, comptime factors: anytype) F32 {
            var lanes: [factors.len]F32 = undefined;
            inline for (&lanes, factors) |*lane, factor| lane.* = .splat(factor);
            var value = horner(x, lanes);
            inline for (0..lowest) |_| value = value.mul(x);
            return value;
        }

        inline fn horner(x: F32, factors: anytype) F32 {
            var value = factors[factors.len - 1];
            comptime var index = factors.len - 1;
            inline while (index > 0) {
                index -= 1;
                value = value.mul(x).add(factors[index]);
            }
            return value;
        }
    };
}

/// What becomes of light at microfacets on its way to one direction.
pub fn Directional(comptime Lanes: type) type {
    return struct {
        /// 1 - E: share that has not left after one reflection.
        missing: Lanes.F32,
        /// Mean of Schlick's weight (1 - cosine)^5 over what has left.
        schlick: Lanes.F32,

        /// Albedo after one reflection.
        pub inline fn single(
            directional: *const @This(),
            f0: Lanes.F32,
            f90: Lanes.F32,
        ) Lanes.F32 {
            const mean = f0.add(f90.sub(f0).mul(directional.schlick));
            return mean.mul(Lanes.F32.splat(1).sub(directional.missing));
        }
    };
}

const Single = simd.Lanes(.scalar, 1);

fn expectAlbedo(cosine: f32, roughness: f32) !void {
    const alpha: Single.F32 = .splat(roughness * roughness);
    const directional = Albedo(Single).of(alpha).at(.splat(cosine));
    const exact = integrate(cosine, roughness * roughness);
    for ([_]f32{ 0.04, 0.2, 0.6, 1 }) |f0| {
        const wanted = f0 * (exact[0] - exact[1]) + exact[1];
        const found = directional.single(.splat(f0), .splat(1)).lane(0);
        errdefer std.debug.print("cosine {d}, roughness {d}, f0 {d}\n", .{ cosine, roughness, f0 });
        try std.testing.expectApproxEqRel(wanted, found, 0.01);
    }
}

/// E and the part of it that Schlick's weight weighs, over visible normals: 1e-3 off at most.
fn integrate(cosine: f32, alpha: f32) [2]f32 {
    const a: Single.F32 = .splat(alpha * alpha);
    const view: Single.Vec3 = .splat(.{ @sqrt(1 - cosine * cosine), 0, cosine });
    const smith_view = microfacet.smith(Single, .splat(cosine), a).lane(0);
    const steps = 48;
    var sums: [2]f64 = .{ 0, 0 };
    for (0..steps) |i| for (0..steps) |j| {
        const angle = (@as(f32, @floatFromInt(i)) + 0.5) / steps * std.math.pi;
        // Dense at the edge of the disc, where the steep microfacets are.
        const v = (@as(f32, @floatFromInt(j)) + 0.5) / steps;
        const radius = @sqrt(1 - (v * v) * (v * v));
        const point_x: Single.F32 = .splat(radius * @cos(angle));
        const point = [2]Single.F32{ point_x, .splat(radius * @sin(angle)) };
        const half = microfacet.visibleNormal(Single, view, .splat(alpha), point);
        const view_half = view.dot(half).lane(0);
        const cos_light = 2 * view_half * half.z.lane(0) - cosine;
        if (cos_light <= 0) continue;
        const smith_light = microfacet.smith(Single, .splat(cos_light), a).lane(0);
        const weight = 4 * v * v * v * cos_light * (cosine + smith_view) /
            (cosine * smith_light + cos_light * smith_view);
        sums[0] += weight;
        sums[1] += weight * microfacet.power5(Single, .splat(@max(1 - view_half, 0))).lane(0);
    };
    return .{ @floatCast(sums[0] / (steps * steps)), @floatCast(sums[1] / (steps * steps)) };
}

test "within 1 % of the integral over visible normals" {
    var roughness: f32 = 0.05;
    while (roughness <= 1) : (roughness += 0.095) {
        for ([_]f32{ 0.003, 0.02, 0.05, 0.1, 0.17, 0.3, 0.45, 0.6, 0.8, 0.93, 1 }) |cosine| {
            try expectAlbedo(cosine, roughness);
        }
    }
}

test "a mirror has Schlick's Fresnel, bit for bit" {
    const albedo: Albedo(Single) = .of(.zero());
    for ([_]f32{ 1e-4, 0.01, 0.3, 0.99, 1 }) |cosine| {
        const directional = albedo.at(.splat(cosine));
        try std.testing.expectEqual(0, directional.missing.lane(0));
        const weight = microfacet.power5(Single, .splat(1 - cosine));
        try std.testing.expectEqual(weight.lane(0), directional.schlick.lane(0));
    }
}

test "shares lie between 0 and 1, and the means are those of the functions" {
    for (0..201) |step| {
        const roughness = @as(f32, @floatFromInt(step)) / 200;
        const albedo: Albedo(Single) = .of(.splat(roughness * roughness));
        var sums: [3]f64 = .{ 0, 0, 0 };
        const count = 2000;
        for (0..count) |i| {
            // Twice the cosine times its width, the square root of the cosine in equal steps.
            const root = (@as(f64, @floatFromInt(i)) + 0.5) / count;
            const directional = albedo.at(.splat(@floatCast(root * root)));
            const missing = directional.missing.lane(0);
            const schlick = directional.schlick.lane(0);
            try std.testing.expect(missing >= 0 and missing <= 1 and schlick >= 0 and schlick <= 1);
            const weight = 4 * root * root * root / count;
            sums[0] += weight * missing;
            sums[1] += weight * (1 - missing) * schlick;
            sums[2] += weight * (1 - missing);
        }
        const missing_mean = albedo.missing_mean.lane(0);
        const tolerance = 0.02 * sums[0] + 1.1 * missing_mean_least;
        try std.testing.expectApproxEqAbs(sums[0], missing_mean, tolerance);
        const schlick_mean = albedo.schlick_mean.lane(0);
        try std.testing.expectApproxEqAbs(sums[1] / sums[2], schlick_mean, 1e-3);
    }
}
