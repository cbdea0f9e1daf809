//! The phase function of Henyey and Greenstein 1941 ("Diffuse Radiation in the Galaxy") in lanes:
//! what volumes scatter, by the angle, and directions with that density. Everything is + - * / sqrt
//! in a fixed order.

const std = @import("std");
const simd = @import("../../simd.zig");
const chi_squared = @import("chi_squared.zig");
const microfacet = @import("microfacet.zig");

/// Share of scattered light by solid angle, per steradian; its integral over the sphere is 1.
/// `cosine` is that between the ways of light before and after, so 1 is straight on; `g`, its mean,
/// is between -1 and 1, exclusive (`scatterAnisotropy` of KHR_materials_volume_scatter).
pub inline fn eval(comptime Lanes: type, cosine: Lanes.F32, g: Lanes.F32) Lanes.F32 {
    const F32 = Lanes.F32;
    const one: F32 = .splat(1);
    const strength = g.abs();
    const around = cosine.mul(one.copySign(g));
    // 1 + g^2 - 2 g cosine as a sum of what is not negative: nothing cancels in the peak.
    const least = one.sub(strength);
    const rest = one.sub(around).max(.zero()).mul(strength.add(strength));
    const squared = least.mul(least).add(rest);
    const above = least.mul(one.add(strength)).mul(.splat(0.25 / std.math.pi));
    return above.div(squared.mul(squared.sqrt()));
}

/// A unit vector that light comes from, for two numbers in 0..1 and `along`, the unit vector that
/// the ray to the point has: it has the density `eval` of its cosine to it. By the inverse of the
/// distribution, written so that nothing cancels, neither without g nor in the peak.
pub fn sample(
    comptime Lanes: type,
    along: Lanes.Vec3,
    g: Lanes.F32,
    numbers: [2]Lanes.F32,
) Lanes.Vec3 {
    const F32 = Lanes.F32;
    const one: F32 = .splat(1);
    const point = microfacet.disc(Lanes, numbers);
    // Even in 0..1, as the disc is.
    const squared = point[0].mul(point[0]).add(point[1].mul(point[1])).min(one);
    const strength = g.abs();
    const least = one.sub(strength);
    const below = squared.add(squared);
    // What 1 - cosine is without g is `below`.
    const bend = one.add(strength.mul(one.sub(squared)));
    const slope = least.add(strength.mul(one.add(one).sub(below)));
    const ratio = least.div(slope);
    const away = below.mul(bend).mul(ratio).mul(ratio).min(.splat(2));
    const cosine = one.sub(away).mul(one.copySign(g));
    // The sine over the radius on the disc.
    const rest = bend.add(bend).mul(F32.splat(2).sub(away)).max(.zero());
    const scale = rest.sqrt().mul(ratio);
    const across = microfacet.tangents(Lanes, along);
    return across[0].scale(point[0].mul(scale)).add(across[1].scale(point[1].mul(scale)))
        .add(along.scale(cosine)).normalize();
}

const Single = simd.Lanes(.scalar, 1);

fn testAt(cosine: f64, g: f32) f64 {
    return eval(Single, .splat(@floatCast(cosine)), .splat(g)).lane(0);
}

test "the sphere gets all of the light, whose mean cosine is g" {
    for ([_]f32{ -0.9, -0.3, 0, 0.5, 0.95 }) |g| {
        const steps = 4000;
        var sums: [2]f64 = @splat(0);
        for (0..steps) |step| {
            // Dense around the peak.
            const x = (@as(f64, @floatFromInt(step)) + 0.5) / steps;
            const cosine = (1 - 2 * x * x * x) * std.math.copysign(@as(f64, 1), g);
            const weight = testAt(cosine, g) * 2 * std.math.pi * 6 * x * x / steps;
            sums[0] += weight;
            sums[1] += weight * cosine;
        }
        try std.testing.expectApproxEqAbs(1, sums[0], 1e-4);
        try std.testing.expectApproxEqAbs(g, sums[1], 1e-4);
    }
}

test "even without g, mirrored by its sign, finite in the narrowest peak" {
    const even = 0.25 / std.math.pi;
    for ([_]f64{ -1, 0.2, 1 }) |cosine| {
        try std.testing.expectApproxEqRel(even, testAt(cosine, 0), 1e-6);
        try std.testing.expectEqual(testAt(cosine, 0.7), testAt(-cosine, -0.7));
    }
    const g: f32 = 1 - std.math.floatEps(f32);
    try std.testing.expect(std.math.isFinite(testAt(1, g)));
    // (1 + g) / (4 pi (1 - g)^2)
    try std.testing.expectApproxEqRel(1.99 / (4 * std.math.pi * 1e-4), testAt(1, 0.99), 1e-4);
}

const Scattered = struct {
    g: f32,

    const along: [3]f32 = .{ 0.48, -0.6, 0.64 };

    pub fn sample(lobe: *const Scattered, numbers: [3]f32) [3]f32 {
        const two = [2]Single.F32{ .splat(numbers[0]), .splat(numbers[1]) };
        return phase(.splat(along), lobe.g, two).lane(0);
    }

    pub fn pdf(lobe: *const Scattered, to_light: [3]f32) f32 {
        const cosine = Single.Vec3.splat(along).dot(.splat(to_light));
        return eval(Single, cosine, .splat(lobe.g)).lane(0);
    }
};

fn phase(along: Single.Vec3, g: f32, numbers: [2]Single.F32) Single.Vec3 {
    return sample(Single, along, .splat(g), numbers);
}

test "directions have the phase function as their density, by chi-squared" {
    try chi_squared.expectDistributed(&Scattered{ .g = -0.6 });
}

test "directions around a way: straight on, back, in the narrowest peak" {
    const along: Single.Vec3 = .splat(Scattered.along);
    for ([_]f32{ -0.999999, -0.5, -1e-6, 0, 1e-4, 0.7, 0.99999994 }) |g| {
        var mean: f64 = 0;
        const steps = 32;
        for (0..steps) |i| for (0..steps) |j| {
            const u = (@as(f32, @floatFromInt(i)) + 0.5) / steps;
            const v = (@as(f32, @floatFromInt(j)) + 0.5) / steps;
            const way = phase(along, g, .{ .splat(u), .splat(v) });
            try std.testing.expectApproxEqAbs(1, way.length().lane(0), 1e-6);
            mean += way.dot(along).lane(0) / @as(f64, steps * steps);
        };
        try std.testing.expectApproxEqAbs(g, mean, 0.015);
        for ([_]f32{ 0, 0.5, 1 }) |u| for ([_]f32{ 0, 0.5, 1 }) |v| {
            const way = phase(along, g, .{ .splat(u), .splat(v) });
            try std.testing.expectApproxEqAbs(1, way.length().lane(0), 1e-6);
        };
    }
}
