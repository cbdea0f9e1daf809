//! e^x and its inverse in lanes: the same bits on every target, unlike a library's.
//!
//! Whole powers of two are split off by the exponent's bits, what is left are series: Taylor's of
//! e^x, that of the inverse hyperbolic tangent for the logarithm. Everything is + - * / in a fixed
//! order and integer operations on bits.

const std = @import("std");
const simd = @import("../../simd.zig");

/// e^x for absorption. Asserts nothing: x > 0 counts as 0, x < -87 gives 0, NaN gives 1. Relative
/// error < 4e-7.
pub inline fn expNegative(comptime Lanes: type, x: Lanes.F32) Lanes.F32 {
    const F32 = Lanes.F32;
    const bounded = F32.select(x.lt(.zero()), x, .zero());
    const power = powerOfTwo(Lanes, bounded.mul(.splat(std.math.log2e)).max(.splat(-126)));
    return F32.select(bounded.lt(.splat(-87)), .zero(), power);
}

/// Share of light that is left at a distance: Beer and Lambert's law, of an extinction coefficient
/// by channel, per metre.
pub inline fn transmittance(
    comptime Lanes: type,
    sigma_t: Lanes.Vec3,
    distance: Lanes.F32,
) Lanes.Vec3 {
    const way = distance.neg();
    return .{
        .x = expNegative(Lanes, sigma_t.x.mul(way)),
        .y = expNegative(Lanes, sigma_t.y.mul(way)),
        .z = expNegative(Lanes, sigma_t.z.mul(way)),
    };
}

/// e^x. Asserts nothing: what is beyond -87 or 87 counts as that, NaN as 87. Relative error
/// < 4e-7 + 1.2e-7 |x|.
pub inline fn exp(comptime Lanes: type, x: Lanes.F32) Lanes.F32 {
    const bounded = x.min(.splat(87)).max(.splat(-87));
    return powerOfTwo(Lanes, bounded.mul(.splat(std.math.log2e)));
}

/// 2^y for -126 <= y < 127, split into whole and fraction, the fraction by its Taylor series.
inline fn powerOfTwo(comptime Lanes: type, y: Lanes.F32) Lanes.F32 {
    const whole = y.toI32();
    const fraction = y.sub(whole.toF32()).mul(.splat(std.math.ln2)); // |fraction| < ln 2
    var sum: Lanes.F32 = .splat(1);
    comptime var n = 9;
    inline while (n >= 1) : (n -= 1) {
        sum = sum.mul(fraction).mul(.splat(1.0 / @as(f32, n))).add(.splat(1));
    }
    return sum.mul(whole.add(.splat(127)).shiftLeft(23).bitcast());
}

/// Natural logarithm. Asserts nothing: what is below the least normal number counts as that, so 0
/// and what is negative; infinity counts as 2^128, NaN as the least normal number. Error below
/// 1.2e-7 of the value, or 2e-8 where that is more.
pub inline fn log(comptime Lanes: type, x: Lanes.F32) Lanes.F32 {
    const one: Lanes.F32 = .splat(1);
    const bits = x.max(.splat(std.math.floatMin(f32))).bitcast();
    // The power of two that leaves a mantissa from the square root of 1/2 to that of 2.
    const half_root: i32 = @bitCast(@as(f32, std.math.sqrt1_2));
    const exponent_mask: i32 = @bitCast(@as(u32, 0xff80_0000));
    const power = bits.sub(.splat(half_root)).bitAnd(.splat(exponent_mask));
    const mantissa = bits.sub(power).bitcast();
    const exponent = power.toF32().mul(.splat(0x1p-23));
    // log m = 2 artanh((m - 1) / (m + 1)); the first term left out is below 1e-9 of the first.
    const s = mantissa.sub(one).div(mantissa.add(one));
    const squared = s.mul(s);
    var sum: Lanes.F32 = .splat(2.0 / 9.0);
    comptime var n = 7;
    inline while (n >= 1) : (n -= 2) sum = sum.mul(squared).add(.splat(2.0 / @as(f32, n)));
    // ln 2 in two parts; products of whole numbers with the first are exact.
    const high = exponent.mul(.splat(0x1.62ep-1));
    const low = exponent.mul(.splat(std.math.ln2 - 0x1.62ep-1));
    return high.add(sum.mul(s).add(low));
}

const Single = simd.Lanes(.scalar, 1);

test "within 4e-7 of the library's, and the edges" {
    const at = struct {
        fn at(x: f32) f32 {
            return expNegative(Single, .splat(x)).lane(0);
        }
    }.at;
    var x: f32 = 0;
    // The argument's own rounding by log2(e) grows with |x|.
    while (x > -80) : (x -= 0.0137) {
        const tolerance = 4e-7 + @abs(x) * 1.2e-7;
        try std.testing.expectApproxEqRel(@exp(@as(f64, x)), @as(f64, at(x)), tolerance);
    }
    try std.testing.expectEqual(1, at(0));
    try std.testing.expectEqual(1, at(-0.0));
    try std.testing.expectEqual(1, at(5));
    try std.testing.expectEqual(1, at(std.math.nan(f32)));
    try std.testing.expectEqual(0, at(-88));
    try std.testing.expectEqual(0, at(-3e38));
    try std.testing.expectEqual(0, at(-std.math.inf(f32)));
}

test "e^x of both signs, and the edges" {
    const at = struct {
        fn at(x: f32) f32 {
            return exp(Single, .splat(x)).lane(0);
        }
    }.at;
    var x: f32 = -87;
    while (x <= 87) : (x += 0.0173) {
        const tolerance = 4e-7 + @abs(x) * 1.2e-7;
        try std.testing.expectApproxEqRel(@exp(@as(f64, x)), @as(f64, at(x)), tolerance);
    }
    try std.testing.expectEqual(1, at(0));
    try std.testing.expectEqual(at(87), at(1e30));
    try std.testing.expectEqual(at(87), at(std.math.inf(f32)));
    try std.testing.expectEqual(at(87), at(std.math.nan(f32)));
    try std.testing.expectEqual(at(-87), at(-std.math.inf(f32)));
}

test "logarithms over the whole range, and the edges" {
    const at = struct {
        fn at(x: f32) f32 {
            return log(Single, .splat(x)).lane(0);
        }
    }.at;
    const least = std.math.floatMin(f32);
    var x: f32 = least;
    while (x < std.math.floatMax(f32)) : (x *= 1.00931) {
        const wanted = @log(@as(f64, x));
        const tolerance = 1.2e-7 * @abs(wanted) + 2e-8;
        try std.testing.expectApproxEqAbs(wanted, @as(f64, at(x)), tolerance);
    }
    for ([_]f32{ 0.5, std.math.sqrt1_2, 0.9999999, 1.0000001, std.math.sqrt2, 2 }) |edge| {
        const wanted = @log(@as(f64, edge));
        try std.testing.expectApproxEqRel(wanted, @as(f64, at(edge)), 2e-7);
    }
    try std.testing.expectEqual(0, at(1));
    for ([_]f32{ 0, -0.0, -1, 1e-40, std.math.nan(f32) }) |below| {
        try std.testing.expectEqual(at(least), at(below));
    }
    try std.testing.expectApproxEqRel(128 * std.math.ln2, at(std.math.inf(f32)), 1e-7);
}
