//! Means of repetitions with their 95 % confidence intervals, after Student.
//!
//! In: samples. Out: the mean and half the width of the interval, which is null for one sample.
//! Ratios are formed within each round and then averaged, so that a machine that slows down for a
//! while slows both sides.

const std = @import("std");
const assert = std.debug.assert;

/// A mean and the half width of its interval.
pub const Estimate = struct {
    mean: f64,
    /// Null for fewer than two samples.
    half_width: ?f64,

    /// Half the width over the mean; infinite where it is not known.
    pub fn relative(self: Estimate) f64 {
        const half_width = self.half_width orelse return std.math.inf(f64);
        if (half_width == 0) return 0;
        return half_width / @abs(self.mean);
    }
};

/// The mean of at least one sample.
pub fn estimate(samples: []const f64) Estimate {
    assert(samples.len >= 1);
    const count: f64 = @floatFromInt(samples.len);
    var sum: f64 = 0;
    for (samples) |sample| sum += sample;
    const mean = sum / count;
    if (samples.len == 1) return .{ .mean = mean, .half_width = null };
    var squares: f64 = 0;
    for (samples) |sample| squares += (sample - mean) * (sample - mean);
    const deviation = @sqrt(squares / (count - 1));
    return .{
        .mean = mean,
        .half_width = quantile(samples.len - 1) * deviation / @sqrt(count),
    };
}

/// The mean of `numerator[i] / denominator[i]`; null where there is no pair or a denominator is 0.
pub fn ratio(numerator: []const f64, denominator: []const f64) ?Estimate {
    var buffer: [round_count_max]f64 = undefined;
    const count = @min(numerator.len, denominator.len);
    assert(count <= round_count_max);
    if (count == 0) return null;
    for (buffer[0..count], numerator[0..count], denominator[0..count]) |*to, upper, lower| {
        if (lower == 0) return null;
        to.* = upper / lower;
    }
    return estimate(buffer[0..count]);
}

/// The mean of `from[i] - less[i]`, of `from` where there is no `less`; null without a sample.
pub fn difference(from: []const f64, less: []const f64) ?Estimate {
    if (from.len == 0) return null;
    var buffer: [round_count_max]f64 = undefined;
    assert(from.len <= round_count_max and (less.len == 0 or less.len == from.len));
    @memcpy(buffer[0..from.len], from);
    for (buffer[0..less.len], less) |*sample, part| sample.* -= part;
    return estimate(buffer[0..from.len]);
}

/// The mean of `work / samples[i]`, a rate.
pub fn rate(work: f64, samples: []const f64) ?Estimate {
    var buffer: [round_count_max]f64 = undefined;
    assert(samples.len <= round_count_max);
    @memset(buffer[0..samples.len], work);
    return ratio(buffer[0..samples.len], samples);
}

/// Samples of one series at most.
pub const round_count_max = 1000;

/// Student's t for 95 % in the middle, by degrees of freedom: a table up to 30, above it the normal
/// quantile with the first two terms of its expansion (Fisher and Cornish 1960), right to 1e-4.
fn quantile(freedom: usize) f64 {
    const table = [_]f64{
        12.7062, 4.3027, 3.1824, 2.7764, 2.5706, 2.4469, 2.3646, 2.3060, 2.2622, 2.2281,
        2.2010,  2.1788, 2.1604, 2.1448, 2.1314, 2.1199, 2.1098, 2.1009, 2.0930, 2.0860,
        2.0796,  2.0739, 2.0687, 2.0639, 2.0595, 2.0555, 2.0518, 2.0484, 2.0452, 2.0423,
    };
    assert(freedom >= 1);
    if (freedom <= table.len) return table[freedom - 1];
    const z: f64 = 1.959964;
    const n: f64 = @floatFromInt(freedom);
    const z3 = z * z * z;
    return z + (z3 + z) / (4 * n) + (5 * z3 * z * z + 16 * z3 + 3 * z) / (96 * n * n);
}

const testing = std.testing;

test "the interval of known samples" {
    // Mean 5, deviation sqrt(2.5), t(4) = 2.7764.
    const result = estimate(&.{ 3, 4, 5, 6, 7 });
    try testing.expectApproxEqRel(5, result.mean, 1e-12);
    try testing.expectApproxEqRel(2.7764 * @sqrt(2.5) / @sqrt(5.0), result.half_width.?, 1e-12);
    try testing.expectEqual(null, estimate(&.{4}).half_width);
    try testing.expect(std.math.isInf(estimate(&.{4}).relative()));
    try testing.expectEqual(0, estimate(&.{ 0, 0 }).relative());
}

test "Student's t beyond the table" {
    try testing.expectApproxEqAbs(2.0395, quantile(31), 1e-4);
    try testing.expectApproxEqAbs(2.0086, quantile(50), 1e-4);
    try testing.expectApproxEqAbs(1.9840, quantile(100), 1e-4);
    try testing.expect(quantile(30) > quantile(31));
}

test "ratios are of pairs: a slow round that slows both does not widen them" {
    const paired = ratio(&.{ 10, 20, 30 }, &.{ 5, 10, 15 }).?;
    try testing.expectEqual(2, paired.mean);
    try testing.expectEqual(0, paired.half_width.?);
    try testing.expectEqual(null, ratio(&.{}, &.{1}));
    try testing.expectEqual(null, ratio(&.{1}, &.{0}));
    try testing.expectEqual(50, rate(100, &.{ 2, 2 }).?.mean);
}
