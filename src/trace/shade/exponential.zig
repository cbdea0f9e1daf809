//! e^x in lanes for x <= 0, for absorption: the same bits on every target, unlike a library's.

const std = @import("std");
const simd = @import("../../simd.zig");

/// e^x. Asserts nothing: x > 0 counts as 0, x < -87 gives 0, NaN gives 1. Relative error < 4e-7.
/// 2^y with y = x / ln 2 split into whole and fraction, the fraction by its Taylor series.
pub inline fn expNegative(comptime Lanes: type, x: Lanes.F32) Lanes.F32 {
    const F32 = Lanes.F32;
    const bounded = F32.select(x.lt(.zero()), x, .zero());
    const y = bounded.mul(.splat(std.math.log2e)).max(.splat(-126));
    const whole = y.toI32();
    const fraction = y.sub(whole.toF32()).mul(.splat(std.math.ln2)); // -ln 2 < fraction <= 0
    var sum: F32 = .splat(1);
    comptime var n = 9;
    inline while (n >= 1) : (n -= 1) {
        sum = sum.mul(fraction).mul(.splat(1.0 / @as(f32, n))).add(.splat(1));
    }
    const scale = whole.add(.splat(127)).shiftLeft(23).bitcast();
    return F32.select(bounded.lt(.splat(-87)), .zero(), sum.mul(scale));
}

test "within 4e-7 of the library's, and the edges" {
    const Lanes = simd.Lanes(.scalar, 1);
    const at = struct {
        fn at(x: f32) f32 {
            return expNegative(Lanes, .splat(x)).lane(0);
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
