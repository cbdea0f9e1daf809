//! Sheen: light that fibres across a surface scatter, by the "Charlie" distribution, in lanes.
//!
//! In: cosines to the normal, roughness. Out: the lobe of KHR_materials_sheen for a white colour
//! and its directional albedo E. Distribution and visibility are those of Estevez and Kulla 2017
//! ("Production Friendly Microfacet Sheen BRDF") as the extension's text has them. Smooth fibres
//! seen at grazing angles send on more light than arrives by these formulas, up to three times as
//! much: there the lobe is divided by E of the view, so that E is 1 at most. That is the one place
//! where the lobe is not reciprocal: roughness below 0.25 and cosines below 0.05. E is e to the
//! negative of a rational function that `bench/sheen.py` fits to integrals, to 1 % of E, or 0.001
//! where E is below 0.1. Everything is + - * / in a fixed order and integer operations on bits.

const std = @import("std");
const simd = @import("../../simd.zig");
const microfacet = @import("microfacet.zig");
const exponential = @import("exponential.zig");

/// Least roughness that counts: at 0 the lobe would be a spike on the horizon.
pub const roughness_least = 0.05;

/// Least cosine that counts for the visibility, which is infinite on the horizon.
const cosine_least = 0.01;

/// The lobe without its colour and the cosine of the light, per steradian. Cosines are 0..1; light
/// and view are on the normal's side.
pub fn eval(
    comptime Lanes: type,
    cos_half: Lanes.F32,
    cos_view: Lanes.F32,
    cos_light: Lanes.F32,
    roughness: Lanes.F32,
) Lanes.F32 {
    const one: Lanes.F32 = .splat(1);
    const rough = roughness.max(.splat(roughness_least));
    const alpha = rough.mul(rough);
    const view = cos_view.max(.splat(cosine_least));
    const light = cos_light.max(.splat(cosine_least));
    const shadowing = one.add(lambda(Lanes, view, alpha)).add(lambda(Lanes, light, alpha));
    const excess = unboundedAlbedo(Lanes, view, rough).max(one);
    const below = shadowing.mul(view).mul(light).mul(excess).mul(.splat(4));
    return distribution(Lanes, cos_half, alpha).div(below);
}

/// Share of white light from everywhere that the lobe sends to a direction at this cosine to the
/// normal, 0..1.
pub fn albedo(
    comptime Lanes: type,
    cosine: Lanes.F32,
    roughness: Lanes.F32,
) Lanes.F32 {
    const bounded = cosine.max(.splat(cosine_least));
    const rough = roughness.max(.splat(roughness_least));
    return unboundedAlbedo(Lanes, bounded, rough).min(.splat(1));
}

/// Density of the fibres' normals by solid angle, projected on the surface, per steradian: the sine
/// to the power of 1 / alpha (Estevez and Kulla 2017, section 2).
fn distribution(
    comptime Lanes: type,
    cos_half: Lanes.F32,
    alpha: Lanes.F32,
) Lanes.F32 {
    const power = Lanes.F32.splat(1).div(alpha);
    const sine_squared = Lanes.F32.splat(1).sub(cos_half.mul(cos_half));
    const logarithm = exponential.log(Lanes, sine_squared).mul(.splat(0.5)).mul(power);
    const scale = power.add(.splat(2)).mul(.splat(0.5 / std.math.pi));
    return exponential.expNegative(Lanes, logarithm).mul(scale);
}

/// Smith's auxiliary function, which shadowing by fibres is 1 / (1 + this) of (section 3).
fn lambda(comptime Lanes: type, cosine: Lanes.F32, alpha: Lanes.F32) Lanes.F32 {
    @setEvalBranchQuota(10_000);
    const F32 = Lanes.F32;
    const one: F32 = .splat(1);
    const smooth = one.sub(alpha);
    const curve: Curve(Lanes) = .of(smooth.mul(smooth));
    const low = cosine.lt(.splat(0.5));
    // Above one half it is the mirror image of below about its value there.
    const value = curve.at(F32.select(low, cosine, one.sub(cosine)));
    const middle = curve.at(.splat(0.5));
    return exponential.exp(Lanes, F32.select(low, value, middle.add(middle).sub(value)));
}

/// Logarithm of Smith's auxiliary function for cosines up to 0.5.
fn Curve(comptime Lanes: type) type {
    return struct {
        a: F32,
        b: F32,
        c: F32,
        d: F32,
        e: F32,

        const F32 = Lanes.F32;

        /// For (1 - alpha)^2.
        inline fn of(share: F32) @This() {
            return .{
                .a = mix(21.5473, 25.3245, share),
                .b = mix(3.82987, 3.32435, share),
                .c = mix(0.19823, 0.16801, share),
                .d = mix(-1.97760, -1.27393, share),
                .e = mix(-4.32054, -4.85967, share),
            };
        }

        inline fn mix(comptime rough: f32, comptime smooth: f32, share: F32) F32 {
            return share.mul(.splat(smooth - rough)).add(.splat(rough));
        }

        inline fn at(curve: @This(), x: F32) F32 {
            const power = exponential.expNegative(Lanes, exponential.log(Lanes, x).mul(curve.c));
            return curve.a.div(curve.b.mul(power).add(.splat(1)))
                .add(curve.d.mul(x)).add(curve.e);
        }
    };
}

/// `albedo` of the lobe before it is bounded.
fn unboundedAlbedo(
    comptime Lanes: type,
    cosine: Lanes.F32,
    roughness: Lanes.F32,
) Lanes.F32 {
    @setEvalBranchQuota(10_000);
    const above = horner(Lanes, cosine, .{
        horner(Lanes, roughness, .{ -263.6952, -19316.26, 115090.4, -178196.2, 83012.21 }),
        horner(Lanes, roughness, .{ 14562.94, 5411.687, 506997.6, -821686, 383847.9 }),
        horner(Lanes, roughness, .{ 33932.21, 451380.4, -1055374, 1192721, -523365.3 }),
        horner(Lanes, roughness, .{ 97326.9, -760647.5, 727515.7, -231133.6, 119699.3 }),
    });
    const below = horner(Lanes, cosine, .{
        horner(Lanes, roughness, .{ 1, 12148.82, 27675.38, -19100.87 }),
        horner(Lanes, roughness, .{ -1230.578, 73501.78, 202885.3, -168173 }),
        horner(Lanes, roughness, .{ -3204.697, 18266.4, -464772.4, 400478.6 }),
    });
    return exponential.exp(Lanes, above.div(below).neg());
}

/// Polynomial of x whose factors, the constant first, are numbers or lanes.
inline fn horner(comptime Lanes: type, x: Lanes.F32, factors: anytype) Lanes.F32 {
    var value = lanesOf(Lanes, factors[factors.len - 1]);
    comptime var index = factors.len - 1;
    inline while (index > 0) {
        index -= 1;
        value = value.mul(x).add(lanesOf(Lanes, factors[index]));
    }
    return value;
}

inline fn lanesOf(comptime Lanes: type, factor: anytype) Lanes.F32 {
    return if (@TypeOf(factor) == Lanes.F32) factor else .splat(factor);
}

const Single = simd.Lanes(.scalar, 1);

/// What the lobe sends to a view: its integral over light dense at the horizon and around the
/// view's azimuth.
fn integrate(cosine: f32, roughness: f32) f64 {
    const steps = 44;
    const sine = @sqrt(1 - cosine * cosine);
    var sum: f64 = 0;
    for (0..steps) |i| for (0..steps) |j| {
        const u = (@as(f32, @floatFromInt(i)) + 0.5) / steps;
        const v = (@as(f32, @floatFromInt(j)) + 0.5) / steps;
        const cos_light = u * u * u;
        const angle = v * v * std.math.pi;
        const across = sine * @sqrt(1 - cos_light * cos_light) * @cos(angle);
        const cos_half = (cosine + cos_light) / @sqrt(2 + 2 * (across + cosine * cos_light));
        const value = eval(
            Single,
            .splat(cos_half),
            .splat(cosine),
            .splat(cos_light),
            .splat(roughness),
        ).lane(0);
        const solid_angle = 3 * u * u * 2 * v * 2 * std.math.pi / (steps * steps);
        sum += @as(f64, value) * cos_light * solid_angle;
    };
    return sum;
}

test "the lobe is the text's formula" {
    const cosines = [_][3]f64{
        .{ 0.9, 0.7, 0.3 }, .{ 0.1, 0.2, 0.05 }, .{ 0.5, 0.999, 0.4 },
        .{ 1, 1, 1 },       .{ 0, 0.5, 0.6 },
    };
    for (cosines) |case| for ([_]f64{ 0.3, 0.6, 1 }) |roughness| {
        const alpha = roughness * roughness;
        const sine_squared = 1 - case[0] * case[0];
        const density = (2 + 1 / alpha) * std.math.pow(f64, sine_squared, 0.5 / alpha) /
            (2 * std.math.pi);
        const shadowing = 1 + exactLambda(case[1], alpha) + exactLambda(case[2], alpha);
        const wanted = density / (shadowing * 4 * case[1] * case[2]);
        const found = eval(
            Single,
            .splat(@floatCast(case[0])),
            .splat(@floatCast(case[1])),
            .splat(@floatCast(case[2])),
            .splat(@floatCast(roughness)),
        ).lane(0);
        try std.testing.expectApproxEqAbs(wanted, @as(f64, found), 2e-5 * wanted + 1e-12);
    };
}

fn exactLambda(cosine: f64, alpha: f64) f64 {
    const share = (1 - alpha) * (1 - alpha);
    return if (cosine < 0.5)
        @exp(exactCurve(cosine, share))
    else
        @exp(2 * exactCurve(0.5, share) - exactCurve(1 - cosine, share));
}

fn exactCurve(x: f64, share: f64) f64 {
    const a = 21.5473 * (1 - share) + 25.3245 * share;
    const b = 3.82987 * (1 - share) + 3.32435 * share;
    const c = 0.19823 * (1 - share) + 0.16801 * share;
    const d = -1.97760 * (1 - share) - 1.27393 * share;
    const e = -4.32054 * (1 - share) - 4.85967 * share;
    return a / (1 + b * std.math.pow(f64, x, c)) + d * x + e;
}

test "the albedo is the integral of the lobe, to 1 %, and 1 at most" {
    for ([_]f32{ 0, 0.08, 0.15, 0.25, 0.5, 1 }) |roughness| {
        for ([_]f32{ 0.01, 0.03, 0.1, 0.2, 0.4, 0.7, 1 }) |cosine| {
            const wanted = integrate(cosine, roughness);
            const found = albedo(Single, .splat(cosine), .splat(roughness)).lane(0);
            errdefer std.debug.print("cosine {d}, roughness {d}\n", .{ cosine, roughness });
            try std.testing.expectApproxEqAbs(wanted, @as(f64, found), 0.01 * @max(wanted, 0.1));
            try std.testing.expect(found >= 0 and found <= 1);
            try std.testing.expect(wanted < 1.01);
        }
    }
}

test "light by the cosine brings the albedo" {
    const steps = 100;
    const cosine = 0.6;
    const view: Single.Vec3 = .splat(.{ 0.8, 0, cosine });
    var sum: f64 = 0;
    for (0..steps) |i| for (0..steps) |j| {
        const u = (@as(f32, @floatFromInt(i)) + 0.5) / steps;
        const v = (@as(f32, @floatFromInt(j)) + 0.5) / steps;
        const point = microfacet.disc(Single, .{ .splat(u), .splat(v) });
        const squared = point[0].mul(point[0]).add(point[1].mul(point[1]));
        const cos_light = Single.F32.splat(1).sub(squared).sqrt();
        const half = (Single.Vec3{ .x = point[0], .y = point[1], .z = cos_light })
            .add(view).normalize();
        const value = eval(Single, half.z, view.z, cos_light, .splat(0.7));
        // The density is the cosine over pi.
        sum += value.lane(0) * std.math.pi;
    };
    const found = albedo(Single, .splat(cosine), .splat(0.7)).lane(0);
    try std.testing.expectApproxEqRel(sum / (steps * steps), @as(f64, found), 0.01);
}

test "light and view change places but where fibres would send on more than arrives" {
    const at = struct {
        fn at(cos_view: f32, cos_light: f32, roughness: f32) f32 {
            const half: Single.F32 = .splat(0.2);
            return eval(Single, half, .splat(cos_view), .splat(cos_light), .splat(roughness))
                .lane(0);
        }
    }.at;
    for ([_]f32{ 0.25, 0.5, 1 }) |roughness| {
        try std.testing.expectApproxEqRel(at(0.02, 0.7, roughness), at(0.7, 0.02, roughness), 1e-6);
    }
    try std.testing.expectApproxEqRel(at(0.07, 0.3, 0.05), at(0.3, 0.07, 0.05), 1e-6);
    try std.testing.expect(at(0.02, 0.7, 0.1) < 0.7 * at(0.7, 0.02, 0.1));
}
