//! The cosine in lanes: the same bits on every target, unlike a library's.
//!
//! Cody and Waite's reduction (1980, "Software Manual for the Elementary Functions") by multiples
//! of pi in three parts, then Taylor's series. Everything is + - * in a fixed order and integer
//! operations on bits.

const std = @import("std");
const simd = @import("../../simd.zig");

/// Largest |angle|, in radians: beyond, products with the parts of pi are not exact.
const angle_max_rad = 12_000;

/// Cosine of an angle in radians. Asserts nothing: what is beyond 12000 of either sign counts as
/// that, NaN as well. Error below 2e-7.
pub inline fn cos(comptime Lanes: type, angle_rad: Lanes.F32) Lanes.F32 {
    const F32 = Lanes.F32;
    const one: F32 = .splat(1);
    const bounded = angle_rad.abs().min(.splat(angle_max_rad));
    const half_turns = bounded.mul(.splat(1.0 / std.math.pi)).add(.splat(0.5)).toI32();
    // As many bits as leave products with 12 bits exact; the last part is rounded.
    const parts = [_]comptime_float{ 0x1.92p1, 0x1.fb4p-11, 0x1.4442d18469899p-23 };
    const count = half_turns.toF32();
    var rest = bounded; // At most pi / 2 of either sign.
    inline for (parts) |part| rest = rest.sub(count.mul(.splat(part)));
    const squared = rest.mul(rest);
    // To the 14th power: the first term left out is below 7e-11.
    var sum: F32 = one;
    comptime var n = 14;
    inline while (n >= 2) : (n -= 2) {
        sum = one.sub(sum.mul(squared).mul(.splat(1.0 / @as(f32, n * (n - 1)))));
    }
    const even = half_turns.bitAnd(.splat(1)).eq(.zero());
    return F32.select(even, sum, sum.neg());
}

test "within 2e-7 of the library's, and the edges" {
    const at = struct {
        fn at(angle_rad: f32) f32 {
            return cos(simd.Lanes(.scalar, 1), .splat(angle_rad)).lane(0);
        }
    }.at;
    for (0..60_000) |step| {
        // Denser around zero.
        const share = @as(f32, @floatFromInt(step)) / 60_000;
        const angle_rad = share * share * angle_max_rad;
        const wanted = @cos(@as(f64, angle_rad));
        try std.testing.expectApproxEqAbs(wanted, @as(f64, at(angle_rad)), 2e-7);
        try std.testing.expectEqual(at(angle_rad), at(-angle_rad));
    }
    try std.testing.expectEqual(1, at(0));
    try std.testing.expectApproxEqAbs(0, at(std.math.pi / 2.0), 1e-7);
    try std.testing.expectEqual(-1, at(std.math.pi));
    const last = at(angle_max_rad);
    for ([_]f32{ 3e38, std.math.inf(f32), std.math.nan(f32) }) |beyond| {
        try std.testing.expectEqual(last, at(beyond));
        try std.testing.expectEqual(last, at(-beyond));
    }
}
