//! Filter importance sampling (Ernst, Stamminger and Greiner 2006): where the samples of a pixel
//! are.
//!
//! In: the number of samples. Out: the place of each, the same for every pixel, variant and
//! integrator. Points of low discrepancy are spread as the reconstruction filter weighs: a sample
//! then counts in full in its own pixel and in no other, though it may lie beyond the pixel's edge.
//! The filter is the 4-term window of Blackman and Harris (Harris 1978), which is nowhere negative.

const std = @import("std");
const elementary = @import("../../math.zig").elementary;
const assert = std.debug.assert;

/// Half the filter's width, in pixels.
pub const filter_radius = 1.5;

/// A sample's place, in pixels from the upper left corner of its pixel.
pub const Offset = struct { x: f32, y: f32 };

/// The places of all samples of a pixel: the middle for a single one.
pub fn place(offsets: []Offset) void {
    assert(offsets.len > 0);
    if (offsets.len == 1) {
        offsets[0] = .{ .x = 0.5, .y = 0.5 };
        return;
    }
    const count: f64 = @floatFromInt(offsets.len);
    for (offsets, 0..) |*offset, number| {
        const index: f64 = @floatFromInt(number);
        offset.* = .{
            .x = @floatCast(0.5 + warp((index + 0.5) / count)),
            .y = @floatCast(0.5 + warp(rowOf(number, offsets.len))),
        };
    }
}

/// Rows of 4 and 8 points in the order of their columns. Each way of cutting the square into as
/// many equal boxes with sides of powers of 2 has one in each; they are their own image in the
/// middle, and edges in any direction come out the nearest to the filter's own.
const rows_of_4 = [4]f64{ 2, 0, 3, 1 };
const rows_of_8 = [8]f64{ 2, 7, 4, 1, 6, 3, 0, 5 };

/// The second coordinate of a point of so many, 0..1; the first is in equal strata.
fn rowOf(number: usize, count: usize) f64 {
    switch (count) {
        inline 4, 8 => |few| {
            const rows = if (few == 4) rows_of_4 else rows_of_8;
            return (rows[number] + 0.5) / few;
        },
        else => {
            // Kronecker's sequence of the golden ratio.
            const turns = @as(f64, @floatFromInt(number)) * 0.6180339887498949 + 0.5;
            return turns - @floor(turns);
        },
    }
}

/// Coefficients of the window, so that its integral over the width is 1.
const window = [_]f64{ 1, -0.48829 / 0.35875, 0.14128 / 0.35875, -0.01168 / 0.35875 };

/// The share of the filter up to x, -1..1 of the radius.
fn share(x: f64) f64 {
    const turn = std.math.pi * (x + 1);
    var sum = turn;
    inline for (window[1..], 1..) |coefficient, harmonic| {
        sum += coefficient / harmonic * elementary.sin(harmonic * turn);
    }
    return sum / (2 * std.math.pi);
}

/// Where the filter has the given share before it, in pixels from its middle: by bisection.
fn warp(fraction: f64) f64 {
    assert(fraction > 0 and fraction < 1);
    var low: f64 = -1;
    var high: f64 = 1;
    for (0..40) |_| {
        const middle = (low + high) / 2;
        if (share(middle) < fraction) low = middle else high = middle;
    }
    return filter_radius * (low + high) / 2;
}

test "one sample is in the middle, few are their own image in it" {
    var one: [1]Offset = undefined;
    place(&one);
    try std.testing.expectEqual(Offset{ .x = 0.5, .y = 0.5 }, one[0]);
    inline for (.{ 4, 8 }) |count| {
        var offsets: [count]Offset = undefined;
        place(&offsets);
        for (offsets, 0..) |offset, number| {
            const other = offsets[count - 1 - number];
            try std.testing.expectApproxEqAbs(1, offset.x + other.x, 1e-6);
            try std.testing.expectApproxEqAbs(1, offset.y + other.y, 1e-6);
        }
    }
}

test "few points fill every box of each way to cut the square" {
    inline for (.{ 4, 8 }) |count| {
        for (0..std.math.log2_int(usize, count) + 1) |cuts| {
            const columns = @as(usize, 1) << @intCast(cuts);
            const rows = count / columns;
            var filled: [count]bool = @splat(false);
            for (0..count) |number| {
                const column = number * columns / count;
                const box: usize = @intFromFloat(rowOf(number, count) * count);
                const row = box * rows / count;
                filled[column * rows + row] = true;
            }
            for (filled) |is_filled| try std.testing.expect(is_filled);
        }
    }
}

test "many samples have the filter's own mean and spread, and none is beyond its radius" {
    // The integral of x^2 over the window, by its antiderivative.
    var variance: f64 = 1.0 / 3.0;
    for (window[1..], 1..) |coefficient, harmonic| {
        const turn = @as(f64, @floatFromInt(harmonic)) * std.math.pi;
        variance += coefficient * 2 / (turn * turn);
    }
    variance *= filter_radius * filter_radius;
    for ([_]usize{ 256, 1000, 4096 }) |count| {
        const offsets = try std.testing.allocator.alloc(Offset, count);
        defer std.testing.allocator.free(offsets);
        place(offsets);
        var mean: [2]f64 = @splat(0);
        var square: [2]f64 = @splat(0);
        for (offsets) |offset| for ([_]f32{ offset.x, offset.y }, 0..) |at, axis| {
            const from_middle = @as(f64, at) - 0.5;
            try std.testing.expect(@abs(from_middle) < filter_radius);
            mean[axis] += from_middle / @as(f64, @floatFromInt(count));
            square[axis] += from_middle * from_middle / @as(f64, @floatFromInt(count));
        };
        for (mean, square) |first, second| {
            try std.testing.expectApproxEqAbs(0, first, 0.003);
            try std.testing.expectApproxEqRel(variance, second, 0.02);
        }
    }
}

test "the filter's shares rise from 0 to 1 and are even" {
    try std.testing.expectApproxEqAbs(0, share(-1), 1e-12);
    try std.testing.expectApproxEqAbs(0.5, share(0), 1e-12);
    try std.testing.expectApproxEqAbs(1, share(1), 1e-12);
    for (1..100) |step| {
        const fraction = @as(f64, @floatFromInt(step)) / 100;
        try std.testing.expectApproxEqAbs(fraction, share(warp(fraction) / filter_radius), 1e-9);
        try std.testing.expectApproxEqAbs(0, warp(fraction) + warp(1 - fraction), 1e-9);
    }
}
