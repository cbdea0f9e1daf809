//! SSIM, the structural similarity of two pictures (Wang et al. 2004).
//!
//! In: two pictures as a display shows them. Out: the mean over all pixels of how alike their
//! neighbourhoods are in brightness, contrast and structure, 1 for the same, down to -1. On luma
//! (Rec. 709's weights of encoded values), 11x11 pixels by a Gaussian of 1.5, edges repeated.

const std = @import("std");
const filter_file = @import("filter.zig");
const Allocator = std.mem.Allocator;
const Filter = filter_file.Filter;
const Kernel = filter_file.Kernel;
const Picture = @import("picture.zig").Picture;
const assert = std.debug.assert;

const window: struct { radius: usize, sigma: f64 } = .{ .radius = 5, .sigma = 1.5 };
/// Against division by nothing, for values of 0 to 1.
const c1 = 0.01 * 0.01;
const c2 = 0.03 * 0.03;

/// Asserts that both have one size.
pub fn mean(gpa: Allocator, first: *const Picture, second: *const Picture) error{OutOfMemory}!f64 {
    const count = first.encoded[0].len;
    assert(first.width == second.width and second.encoded[0].len == count);
    const memory = try gpa.alloc(f32, 5 * count);
    defer gpa.free(memory);
    // a, b, a a, b b, a b.
    var planes: [5][]f32 = undefined;
    for (&planes, 0..) |*plane, index| plane.* = memory[index * count ..][0..count];
    for (0..count) |index| {
        const a = lumaAt(first, index);
        const b = lumaAt(second, index);
        for (planes, [_]f32{ a, b, a * a, b * b, a * b }) |plane, value| plane[index] = value;
    }
    var filter: Filter = try .init(gpa, first.width, first.height);
    defer filter.deinit(gpa);
    const kernel: Kernel = .gaussian(window.radius, window.sigma);
    for (planes) |plane| filter.apply(&kernel, &kernel, plane, plane);
    var sum: f64 = 0;
    for (0..count) |index| {
        const a: f64 = planes[0][index];
        const b: f64 = planes[1][index];
        const variances = planes[2][index] - a * a + (planes[3][index] - b * b);
        const covariance = planes[4][index] - a * b;
        const alike = (2 * a * b + c1) * (2 * covariance + c2);
        sum += alike / ((a * a + b * b + c1) * (variances + c2));
    }
    return sum / @as(f64, @floatFromInt(count));
}

fn lumaAt(picture: *const Picture, index: usize) f32 {
    const encoded = &picture.encoded;
    return 0.2126 * encoded[0][index] + 0.7152 * encoded[1][index] + 0.0722 * encoded[2][index];
}

test "of constant pictures what the formula says, of the same ones 1" {
    const gpa = std.testing.allocator;
    var dark: Picture = try .solid(gpa, 16, 16, .{ 0.2, 0.2, 0.2 });
    defer dark.deinit(gpa);
    var light: Picture = try .solid(gpa, 16, 16, .{ 0.8, 0.8, 0.8 });
    defer light.deinit(gpa);
    const a: f64 = dark.encoded[0][0];
    const b: f64 = light.encoded[0][0];
    const expected = (2 * a * b + c1) / (a * a + b * b + c1);
    try std.testing.expectApproxEqAbs(expected, try mean(gpa, &dark, &light), 1e-5);
    try std.testing.expectApproxEqAbs(1, try mean(gpa, &dark, &dark), 1e-6);
}

test "of a pattern and its negative below 0" {
    const gpa = std.testing.allocator;
    var pattern: Picture = try .solid(gpa, 16, 16, .{ 0, 0, 0 });
    defer pattern.deinit(gpa);
    var negative: Picture = try .solid(gpa, 16, 16, .{ 0, 0, 0 });
    defer negative.deinit(gpa);
    for (0..256) |index| {
        const bright = (index / 16 + index % 16) % 2 == 0;
        for (0..3) |channel| {
            pattern.encoded[channel][index] = if (bright) 0.75 else 0.25;
            negative.encoded[channel][index] = if (bright) 0.25 else 0.75;
        }
    }
    try std.testing.expectApproxEqAbs(1, try mean(gpa, &pattern, &pattern), 1e-6);
    // Variances 1/16: (2 * 1/4 + c1) (-2/16 + c2) over (2/4 + c1) (2/16 + c2).
    try std.testing.expect(try mean(gpa, &pattern, &negative) < -0.95);
}
