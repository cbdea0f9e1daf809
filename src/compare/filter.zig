//! Separable filters over planes of floats, edges repeated beyond the picture.
//!
//! In: rows of a plane, weights along rows and along columns. Out: the filtered plane. Sums are in
//! a fixed order, so the same on every target.

const std = @import("std");
const elementary = @import("../math/elementary.zig");
const Allocator = std.mem.Allocator;
const assert = std.debug.assert;

/// Taps to either side of the middle at most.
pub const radius_max = 16;

/// Weights along a line, the middle one at `radius`.
pub const Kernel = struct {
    weights: [2 * radius_max + 1]f32 = @splat(0),
    radius: usize,

    /// e^(-distance^2 / (2 sigma^2)), with a sum of 1.
    pub fn gaussian(radius: usize, sigma: f64) Kernel {
        return of(radius, sigma, 0);
    }

    /// The `order`-th derivative of that, up to a factor: positive weights sum to 1, negative ones
    /// to -1. Order 0 has no negative ones.
    pub fn of(radius: usize, sigma: f64, comptime order: u2) Kernel {
        assert(radius <= radius_max);
        var exact: [2 * radius_max + 1]f64 = @splat(0);
        var positive: f64 = 0;
        var negative: f64 = 0;
        for (exact[0 .. 2 * radius + 1], 0..) |*weight, index| {
            const x = @as(f64, @floatFromInt(index)) - @as(f64, @floatFromInt(radius));
            const bell = elementary.exp(-x * x / (2 * sigma * sigma));
            weight.* = bell * switch (order) {
                0 => 1,
                1 => -x,
                2 => x * x / (sigma * sigma) - 1,
                else => comptime unreachable,
            };
            if (weight.* > 0) positive += weight.* else negative -= weight.*;
        }
        var kernel: Kernel = .{ .radius = radius };
        for (kernel.weights[0 .. 2 * radius + 1], exact[0 .. 2 * radius + 1]) |*weight, value| {
            weight.* = @floatCast(if (value > 0) value / positive else value / @max(negative, 1e-300));
        }
        return kernel;
    }
};

/// A plane's size, and room for what filters need on their way.
pub const Filter = struct {
    width: usize,
    height: usize,
    /// A row with repeated edges.
    padded: []f32,
    /// The plane between the two passes.
    between: []f32,

    /// Asserts that both sides are at least 1.
    pub fn init(gpa: Allocator, width: usize, height: usize) error{OutOfMemory}!Filter {
        assert(width >= 1 and height >= 1);
        const padded = try gpa.alloc(f32, width + 2 * radius_max);
        errdefer gpa.free(padded);
        const between = try gpa.alloc(f32, width * height);
        return .{ .width = width, .height = height, .padded = padded, .between = between };
    }

    pub fn deinit(filter: *Filter, gpa: Allocator) void {
        gpa.free(filter.padded);
        gpa.free(filter.between);
        filter.* = undefined;
    }

    /// Source and target may be one plane.
    pub fn apply(
        filter: *const Filter,
        along_rows: *const Kernel,
        along_columns: *const Kernel,
        source: []const f32,
        target: []f32,
    ) void {
        assert(source.len == filter.between.len and target.len == source.len);
        for (0..filter.height) |y| filter.filterRow(along_rows, source, y);
        for (0..filter.height) |y| filter.filterColumns(along_columns, target, y);
    }

    fn filterRow(filter: *const Filter, kernel: *const Kernel, source: []const f32, y: usize) void {
        const width = filter.width;
        const radius = kernel.radius;
        const row = source[y * width ..][0..width];
        const padded = filter.padded[0 .. width + 2 * radius];
        @memset(padded[0..radius], row[0]);
        @memcpy(padded[radius..][0..width], row);
        @memset(padded[radius + width ..], row[width - 1]);
        const target = filter.between[y * width ..][0..width];
        @memset(target, 0);
        for (kernel.weights[0 .. 2 * radius + 1], 0..) |weight, tap| {
            for (target, padded[tap..][0..width]) |*sum, value| sum.* += weight * value;
        }
    }

    fn filterColumns(filter: *const Filter, kernel: *const Kernel, plane: []f32, y: usize) void {
        const width = filter.width;
        const target = plane[y * width ..][0..width];
        @memset(target, 0);
        for (kernel.weights[0 .. 2 * kernel.radius + 1], 0..) |weight, tap| {
            const row = @min(y + tap -| kernel.radius, filter.height - 1);
            const values = filter.between[row * width ..][0..width];
            for (target, values) |*sum, value| sum.* += weight * value;
        }
    }
};

test "a constant stays, a step is smoothed, and its edges are repeated" {
    const gpa = std.testing.allocator;
    var filter: Filter = try .init(gpa, 9, 4);
    defer filter.deinit(gpa);
    var plane: [36]f32 = @splat(0.25);
    const kernel: Kernel = .gaussian(3, 1.2);
    filter.apply(&kernel, &kernel, &plane, &plane);
    for (plane) |value| try std.testing.expectApproxEqRel(0.25, value, 1e-6);
    for (&plane, 0..) |*value, index| value.* = if (index % 9 < 4) 0 else 1;
    var slope: [36]f32 = undefined;
    filter.apply(&.of(3, 1.2, 1), &kernel, &plane, &slope);
    filter.apply(&kernel, &kernel, &plane, &plane);
    for (0..4) |y| {
        try std.testing.expectApproxEqAbs(0, plane[y * 9], 1e-6);
        try std.testing.expectApproxEqAbs(1, plane[y * 9 + 8], 1e-6);
        // Between columns 3 and 4 the step is even.
        try std.testing.expectApproxEqAbs(1, plane[y * 9 + 3] + plane[y * 9 + 4], 1e-6);
        try std.testing.expectApproxEqAbs(slope[y * 9 + 3], slope[y * 9 + 4], 1e-6);
        try std.testing.expectApproxEqAbs(0, slope[y * 9 + 8], 1e-6);
    }
}
