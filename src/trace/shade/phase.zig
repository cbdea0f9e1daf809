//! The phase function of Henyey and Greenstein 1941 ("Diffuse Radiation in the Galaxy") in lanes:
//! what volumes scatter, by the angle. Everything is + - * / sqrt in a fixed order.

const std = @import("std");
const simd = @import("../../simd.zig");

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
