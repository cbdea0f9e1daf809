//! Sine, cosine, tangent, arc cosine, exponential, logarithm and power from + - * / alone.
//!
//! Libraries differ in the last bit; these do not, because IEEE arithmetic in a fixed order gives
//! the same bits on every target. In f64 with a relative error below 1e-13, which leaves the f32
//! that is made of the result right to the last bit but in rare ties. For `prepare` and `output`,
//! not for hot loops.

const std = @import("std");
const assert = std.debug.assert;

/// Largest |angle| accepted, in radians: beyond it a two-part reduction by pi/2 loses digits.
const angle_rad_max = 1e5;

const Reduced = struct { rest: f64, quadrant: u2 };

/// Cody-Waite reduction to |rest| <= pi/4 with pi/2 in two parts, the first of 33 bits.
fn reduce(angle_rad: f64) Reduced {
    assert(@abs(angle_rad) <= angle_rad_max);
    const half_pi_high: f64 = 1.5707963267341256e+00;
    const half_pi_low: f64 = 6.0771005065061922e-11;
    const turns = @floor(angle_rad * (2.0 / std.math.pi) + 0.5);
    const rest = (angle_rad - turns * half_pi_high) - turns * half_pi_low;
    const turns_int: i64 = @intFromFloat(turns);
    return .{ .rest = rest, .quadrant = @intCast(@mod(turns_int, 4)) };
}

/// Taylor series of sine to x^17 on |x| <= pi/4; the first term left out is below 1e-19.
fn sinKernel(x: f64) f64 {
    const xx = x * x;
    var sum: f64 = 0;
    comptime var n = 17;
    inline while (n >= 3) : (n -= 2) sum = (sum + 1) * -xx / comptime (n * (n - 1));
    return x + x * sum;
}

/// Taylor series of cosine to x^18 on |x| <= pi/4.
fn cosKernel(x: f64) f64 {
    const xx = x * x;
    var sum: f64 = 0;
    comptime var n = 18;
    inline while (n >= 2) : (n -= 2) sum = (sum + 1) * -xx / comptime (n * (n - 1));
    return 1 + sum;
}

/// Sine. Asserts |angle_rad| <= 1e5.
pub fn sin(angle_rad: f64) f64 {
    const reduced = reduce(angle_rad);
    return switch (reduced.quadrant) {
        0 => sinKernel(reduced.rest),
        1 => cosKernel(reduced.rest),
        2 => -sinKernel(reduced.rest),
        3 => -cosKernel(reduced.rest),
    };
}

/// Cosine. Asserts |angle_rad| <= 1e5.
pub fn cos(angle_rad: f64) f64 {
    const reduced = reduce(angle_rad);
    return switch (reduced.quadrant) {
        0 => cosKernel(reduced.rest),
        1 => -sinKernel(reduced.rest),
        2 => -cosKernel(reduced.rest),
        3 => sinKernel(reduced.rest),
    };
}

/// Tangent; very large near its poles. Asserts |angle_rad| <= 1e5.
pub fn tan(angle_rad: f64) f64 {
    return sin(angle_rad) / cos(angle_rad);
}

/// e^x; 0 below -700, infinity above 709.
pub fn exp(x: f64) f64 {
    if (!(x > -700)) return if (x != x) x else 0;
    if (x > 709) return std.math.inf(f64);
    const ln2_high: f64 = 6.93147180369123816490e-01;
    const ln2_low: f64 = 1.90821492927058770002e-10;
    const power = @floor(x / std.math.ln2 + 0.5);
    const rest = (x - power * ln2_high) - power * ln2_low; // |rest| <= ln 2 / 2
    var sum: f64 = 1;
    comptime var n = 16;
    inline while (n >= 1) : (n -= 1) sum = 1 + sum * rest / n;
    const power_int: i64 = @intFromFloat(power);
    const biased: u64 = @intCast(power_int + 1023);
    return sum * @as(f64, @bitCast(biased << 52));
}

/// Natural logarithm of a normal positive number; -infinity for 0 and denormals, NaN below.
pub fn log(x: f64) f64 {
    if (x != x or x == std.math.inf(f64)) return x;
    if (x < 0) return std.math.nan(f64);
    if (x < std.math.floatMin(f64)) return -std.math.inf(f64);
    const bits: u64 = @bitCast(x);
    var exponent: i64 = @as(i64, @intCast(bits >> 52)) - 1023;
    var mantissa: f64 = @bitCast((bits & 0x000f_ffff_ffff_ffff) | 0x3ff0_0000_0000_0000);
    if (mantissa > std.math.sqrt2) {
        mantissa /= 2;
        exponent += 1;
    }
    // log m = 2 artanh((m - 1) / (m + 1)), |s| <= 0.172: the series ends below 1e-18.
    const s = (mantissa - 1) / (mantissa + 1);
    const ss = s * s;
    var sum: f64 = 0;
    comptime var n = 21;
    inline while (n >= 1) : (n -= 2) sum = sum * ss + 1.0 / @as(comptime_float, n);
    return 2 * s * sum + @as(f64, @floatFromInt(exponent)) * std.math.ln2;
}

/// In 0 .. pi, of a cosine in -1 .. 1; near 1 it is as exact as the cosine lets it be.
pub fn acos(cosine: f64) f64 {
    assert(@abs(cosine) <= 1);
    // Half-angle formula: sin(angle / 2)^2 = (1 - cos(angle)) / 2.
    if (cosine > 0.5) return 2 * asinKernel(@sqrt((1 - cosine) / 2));
    if (cosine < -0.5) return std.math.pi - 2 * asinKernel(@sqrt((1 + cosine) / 2));
    return std.math.pi / 2.0 - asinKernel(cosine);
}

/// Taylor series of arc sine to x^47 on |x| <= 1/2; the first term left out is below 1e-17.
fn asinKernel(x: f64) f64 {
    const xx = x * x;
    var sum: f64 = 0;
    comptime var n = 47;
    // The coefficient of x^n is (1 * 3 * ... (n - 2)) / (2 * 4 * ... (n - 1)) / n.
    inline while (n >= 3) : (n -= 2) {
        const ratio = comptime @as(f64, (n - 2) * (n - 2)) / (n * (n - 1));
        sum = (sum + 1) * xx * ratio;
    }
    return x + x * sum;
}

/// base^exponent for base >= 0; 0^0 is 1.
pub fn pow(base: f64, exponent: f64) f64 {
    assert(base >= 0);
    if (exponent == 0) return 1;
    if (base == 0) return if (exponent > 0) 0 else std.math.inf(f64);
    return exp(exponent * log(base));
}

test "within 1e-13 of the library's functions" {
    var random = std.Random.DefaultPrng.init(1);
    for (0..20_000) |_| {
        const angle = (random.random().float(f64) - 0.5) * 200;
        try std.testing.expectApproxEqAbs(@sin(angle), sin(angle), 1e-13);
        try std.testing.expectApproxEqAbs(@cos(angle), cos(angle), 1e-13);
        const power = (random.random().float(f64) - 0.5) * 100;
        try std.testing.expectApproxEqRel(@exp(power), exp(power), 1e-13);
        try std.testing.expectApproxEqAbs(power, log(@exp(power)), 1e-13 * (1 + @abs(power)));
    }
    for (0..20_001) |step| {
        const cosine = @as(f64, @floatFromInt(step)) / 10_000 - 1;
        try std.testing.expectApproxEqRel(std.math.acos(cosine), acos(cosine), 1e-15);
    }
    try std.testing.expectApproxEqRel(@as(f64, 1), tan(std.math.pi / 4.0), 1e-15);
}

test "the edges" {
    const inf = std.math.inf(f64);
    try std.testing.expectEqual(0, sin(0));
    try std.testing.expectEqual(1, cos(0));
    try std.testing.expectEqual(1, exp(0));
    try std.testing.expectEqual(0, exp(-inf));
    try std.testing.expectEqual(inf, exp(inf));
    try std.testing.expectEqual(inf, exp(709.5));
    try std.testing.expect(std.math.isNan(exp(std.math.nan(f64))));
    try std.testing.expectEqual(0, log(1));
    try std.testing.expectEqual(-inf, log(0));
    try std.testing.expectEqual(inf, log(inf));
    try std.testing.expect(std.math.isNan(log(-1)));
    try std.testing.expectEqual(1, pow(0, 0));
    try std.testing.expectEqual(0, pow(0, 2));
    try std.testing.expectApproxEqRel(@as(f64, 8), pow(2, 3), 1e-15);
    try std.testing.expectApproxEqRel(@as(f64, 1e-300), exp(log(1e-300)), 1e-12);
}
