//! Weighted least squares in lanes: a constant and one slope for each feature, by normal equations.
//!
//! In: by neighbour of a pixel its weight, its features less the pixel's own, its light. Out: the
//! light of the pixel. Slopes are held towards 0 (ridge regression): with few neighbours, or with
//! features that are all the same, what is left is their weighted mean.

const std = @import("std");
const planes = @import("planes.zig");
const V = planes.V;

/// Features that light may depend on.
pub const feature_count = 4;

/// Unknowns, and the entries of the lower triangle of their symmetric matrix.
const order = feature_count + 1;
const entry_count = order * (order + 1) / 2;

/// How much a slope of 1 costs, as the square of what it explains does in each neighbour.
const ridge = 0.01;

/// Sums over neighbours.
pub const Sums = struct {
    matrix: [entry_count]V,
    light: [3][order]V,

    /// None yet.
    pub const zero: Sums = .{ .matrix = @splat(@splat(0)), .light = @splat(@splat(@splat(0))) };

    /// Adds a neighbour.
    pub inline fn add(
        sums: *Sums,
        weight: V,
        features: *const [feature_count]V,
        light: [3]V,
    ) void {
        var weighted: [order]V = undefined;
        weighted[0] = weight;
        inline for (features, weighted[1..]) |feature, *to| to.* = weight * feature;
        inline for (0..order) |row| {
            inline for (0..row + 1) |column| {
                const value = if (column == 0)
                    weighted[row]
                else
                    weighted[row] * features[column - 1];
                sums.matrix[entry(row, column)] += value;
            }
            inline for (&sums.light, light) |*to, channel| to[row] += weighted[row] * channel;
        }
    }

    /// The light of the pixel: the constant, found last of all unknowns by elimination from the
    /// last feature on, where every pivot is at least the ridge. Asserts nothing: 0 without weight.
    pub fn solve(sums: *const Sums) [3]V {
        var matrix = sums.matrix;
        var light = sums.light;
        const cost = sums.matrix[0] * @as(V, @splat(ridge)) + @as(V, @splat(1e-20));
        inline for (1..order) |row| matrix[entry(row, row)] += cost;
        inline for (0..feature_count) |step| {
            const pivot = order - 1 - step;
            const scale = @as(V, @splat(1)) / matrix[entry(pivot, pivot)];
            inline for (0..pivot) |row| {
                const factor = matrix[entry(pivot, row)] * scale;
                inline for (0..row + 1) |column| {
                    matrix[entry(row, column)] -= factor * matrix[entry(pivot, column)];
                }
                inline for (&light) |*channel| channel[row] -= factor * channel[pivot];
            }
        }
        const none: V = @splat(0);
        const weight = matrix[0];
        const is_known = weight > none;
        var result: [3]V = undefined;
        inline for (&result, &light) |*to, *channel| {
            to.* = @select(f32, is_known, channel[0] / weight, none);
        }
        return result;
    }

    inline fn entry(comptime row: usize, comptime column: usize) usize {
        return row * (row + 1) / 2 + column;
    }
};

test "a plane through the features is found, and the mean where they say nothing" {
    var sums: Sums = .zero;
    var flat: Sums = .zero;
    for (0..9) |index| {
        const x: V = @splat(@as(f32, @floatFromInt(index)) - 2);
        const none: V = @splat(0);
        const light = @as(V, @splat(3)) + x * @as(V, @splat(2));
        sums.add(@splat(1), &.{ x, none, none, none }, .{ light, light, none });
        flat.add(@splat(1), &.{ none, none, none, none }, .{ light, light, none });
    }
    for (sums.solve(), [_]f32{ 3, 3, 0 }) |channel, expected| {
        try std.testing.expectApproxEqAbs(expected, channel[0], 0.02);
    }
    try std.testing.expectApproxEqRel(@as(f32, 7), flat.solve()[0][3], 1e-6);
    try std.testing.expectEqual([3]V{ @splat(0), @splat(0), @splat(0) }, Sums.zero.solve());
}
