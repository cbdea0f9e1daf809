//! Filter importance sampling (Ernst, Stamminger and Greiner 2006): where the samples of a pixel
//! are.
//!
//! In: the number of samples. Out: the place of each, the same for every pixel and variant. Points
//! of a lattice, or of a sequence where the number is not known before, are spread as the
//! reconstruction filter weighs: a sample then counts in full in its own pixel and in no other,
//! though it may lie beyond the pixel's edge. The filter is the 4-term window of Blackman and
//! Harris (Harris 1978), which is nowhere negative.
//!
//! Places of a sequence are those of all pixels as well: primary rays stay beams, and edges have
//! no noise. What is left of their error is the same along an edge, as a lattice's is.

const std = @import("std");
const elementary = @import("../../math.zig").elementary;
const simd = @import("../../simd.zig");
const Sobol = @import("sobol.zig").Sobol;
const assert = std.debug.assert;

/// Half the filter's width, in pixels.
const filter_radius = 1.5;

/// A sample's place, in pixels from the upper left corner of its pixel.
pub const Offset = struct { x: f32, y: f32 };

/// The places of all samples of a pixel: the middle for a single one.
pub fn place(offsets: []Offset) void {
    assert(offsets.len > 0);
    if (offsets.len == 1) {
        offsets[0] = .{ .x = 0.5, .y = 0.5 };
        return;
    }
    const step = stepOf(offsets.len);
    for (offsets, 0..) |*offset, column| offset.* = .{
        .x = strataPlace(column, offsets.len),
        .y = strataPlace(rowOf(column, offsets.len, step), offsets.len),
    };
}

/// The places of a sequence's first samples, whatever their number; any number of them is spread
/// evenly. The first is the middle.
pub fn placeInSequence(offsets: []Offset) void {
    const middle = 1 << 23;
    var shift: [2]u32 = undefined;
    for (offsets, 0..) |*offset, number| {
        const zero: Lanes.I32 = .zero();
        const sobol: Sobol(Lanes) = .init(zero, zero, .splat(@intCast(number)));
        var at: [2]u32 = undefined;
        for (&at, sobol.pair(.splat(position_dimension))) |*to, from| {
            to.* = @intFromFloat(from.lane(0) * 0x1p24);
        }
        if (number == 0) shift = .{ at[0] ^ middle, at[1] ^ middle };
        offset.* = .{ .x = placeOf(at[0] ^ shift[0]), .y = placeOf(at[1] ^ shift[1]) };
    }
}

/// The dimension of `Sobol` that is places in pixels.
pub const position_dimension = 0;

const Lanes = simd.Lanes(.scalar, 1);

/// Where the filter has so many of 2^24 shares before it; 0 is within the first one.
fn placeOf(share_count: u32) f32 {
    return @floatCast(0.5 + warp(@max(0.5, @as(f64, @floatFromInt(share_count))) * 0x1p-24));
}

/// Where the middle of one of so many equal shares of the filter is.
fn strataPlace(stratum: usize, count: usize) f32 {
    const middle = @as(f64, @floatFromInt(stratum)) + 0.5;
    return @floatCast(0.5 + warp(middle / @as(f64, @floatFromInt(count))));
}

/// Rows of 4 points, the rotated grid: of all orders the nearest to the filter's own on edges in
/// any direction.
const rows_of_4 = [4]usize{ 2, 0, 3, 1 };

/// The row of the point in a column: each has one. Other numbers than 4 make a lattice of rank 1,
/// shifted so that it is its own image in the middle.
fn rowOf(column: usize, count: usize, step: usize) usize {
    if (count == 4) return rows_of_4[column];
    const turned = if (step % 2 == 1) step - 1 else step - 1 + count;
    return (column * step + turned / 2) % count;
}

/// The step of a lattice: without a common divisor with its points' number, the nearest to the
/// golden section of it.
fn stepOf(count: usize) usize {
    const golden = @as(f64, @floatFromInt(count)) * 0.6180339887498949;
    var best: usize = 1;
    for (1..count) |step| {
        if (std.math.gcd(step, count) != 1) continue;
        const distance = @abs(@as(f64, @floatFromInt(step)) - golden);
        if (distance < @abs(@as(f64, @floatFromInt(best)) - golden)) best = step;
    }
    return best;
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

test "one sample is in the middle, more are their own image in it and fill rows and columns" {
    var one: [1]Offset = undefined;
    place(&one);
    try std.testing.expectEqual(Offset{ .x = 0.5, .y = 0.5 }, one[0]);
    for (2..100) |count| {
        var all: [100]Offset = undefined;
        const offsets = all[0..count];
        place(offsets);
        var filled: [100]bool = @splat(false);
        const step = stepOf(count);
        for (offsets, 0..) |offset, column| {
            filled[rowOf(column, count, step)] = true;
            const other = offsets[count - 1 - column];
            try std.testing.expectApproxEqAbs(1, offset.x + other.x, 1e-6);
            try std.testing.expectApproxEqAbs(1, offset.y + other.y, 1e-6);
            if (column > 0) try std.testing.expect(offset.x > offsets[column - 1].x);
        }
        for (filled[0..count]) |is_filled| try std.testing.expect(is_filled);
    }
}

test "a sequence begins in the middle, and goes on whatever the number" {
    var few: [3]Offset = undefined;
    var more: [16]Offset = undefined;
    placeInSequence(&few);
    placeInSequence(&more);
    try std.testing.expectEqual(Offset{ .x = 0.5, .y = 0.5 }, few[0]);
    try std.testing.expectEqualSlices(Offset, &few, more[0..few.len]);
    for ([_]usize{ 4, 16 }) |count| {
        var filled: [2][16]bool = @splat(@splat(false));
        for (more[0..count]) |offset| for ([_]f32{ offset.x, offset.y }, &filled) |at, *strata| {
            const fraction = share((@as(f64, at) - 0.5) / filter_radius);
            const stratum = (fraction + 1e-6) * @as(f64, @floatFromInt(count));
            strata[@intFromFloat(stratum)] = true;
        };
        for (filled) |strata| for (strata[0..count]) |is_filled| {
            try std.testing.expect(is_filled);
        };
    }
}

test "4 and 8 points fill every box of each way to cut the square" {
    for ([_]usize{ 4, 8 }) |count| {
        var columns: usize = 1;
        while (columns <= count) : (columns *= 2) {
            const rows = count / columns;
            var filled: [8]bool = @splat(false);
            for (0..count) |column| {
                const row = rowOf(column, count, stepOf(count));
                filled[column * columns / count * rows + row * rows / count] = true;
            }
            for (filled[0..count]) |is_filled| try std.testing.expect(is_filled);
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
    for ([_]usize{ 256, 1000, 4096, 256 }, [_]bool{ false, false, false, true }) |count, grows| {
        const offsets = try std.testing.allocator.alloc(Offset, count);
        defer std.testing.allocator.free(offsets);
        if (grows) placeInSequence(offsets) else place(offsets);
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
