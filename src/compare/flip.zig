//! FLIP: how different two pictures look to somebody who flips between them, pixel by pixel.
//!
//! In: two pictures as a display shows them. Out: a map of differences, 0 (the same) to 1. Andersson
//! et al. 2020, "FLIP: A Difference Evaluator for Alternating Images", with its constants: colours
//! blurred by the eye's contrast sensitivity and compared in a perceptually even space, times
//! edges and points that only one picture has; for a display 0.7 m wide with 3840 pixels across,
//! seen from 0.7 m.

const std = @import("std");
const elementary = @import("../math/elementary.zig");
const filter_file = @import("filter.zig");
const Allocator = std.mem.Allocator;
const Filter = filter_file.Filter;
const Kernel = filter_file.Kernel;
const Picture = @import("picture.zig").Picture;
const assert = std.debug.assert;

/// Pixels in the middle of the display that an angle of a degree covers: 67.02.
const pixels_per_degree = 0.7 * (3840.0 / 0.7) * std.math.pi / 180.0;

/// A channel's contrast sensitivity: the sum of a * sqrt(pi / b) * e^(-pi^2 x^2 / b), x in degrees
/// (table 1).
const Sensitivity = struct { a: f64, b: f64 };
const achromatic: Sensitivity = .{ .a = 1, .b = 0.0047 };
const red_green: Sensitivity = .{ .a = 1, .b = 0.0053 };
const blue_yellow: [2]Sensitivity = .{ .{ .a = 34.1, .b = 0.04 }, .{ .a = 13.5, .b = 0.025 } };

/// Exponent of colour differences, and where the map of them to 0..1 bends (section 4.1.3).
const colour_exponent = 0.7;
const bend = .{ .at = 0.4, .to = 0.95 };
/// Width of edges and points that are looked for, in degrees (section 4.2).
const feature_width_deg = 0.082;

/// Fills the map. Asserts that both pictures and the map have one size.
pub fn evaluate(
    gpa: Allocator,
    first: *const Picture,
    second: *const Picture,
    map: []f32,
) error{OutOfMemory}!void {
    assert(first.width == second.width and first.height == second.height);
    assert(map.len == @as(usize, first.width) * first.height);
    var filter: Filter = try .init(gpa, first.width, first.height);
    defer filter.deinit(gpa);
    var looks: [2]Look = undefined;
    looks[0] = try .of(gpa, &filter, first);
    defer looks[0].deinit(gpa);
    looks[1] = try .of(gpa, &filter, second);
    defer looks[1].deinit(gpa);
    const largest = power(hyab(huntLab(.{ 0, 1, 0 }), huntLab(.{ 0, 0, 1 })), colour_exponent);
    for (map, 0..) |*value, index| {
        const distance = power(hyab(looks[0].lab(index), looks[1].lab(index)), colour_exponent);
        const colour = spread(distance, largest);
        const edges = @abs(looks[0].edges[index] - looks[1].edges[index]);
        const points = @abs(looks[0].points[index] - looks[1].points[index]);
        const feature = @sqrt(@max(edges, points) / std.math.sqrt2);
        value.* = power(colour, 1 - feature);
    }
}

/// What of one picture is compared.
const Look = struct {
    /// Of the blurred picture, in CIELAB with Hunt's effect.
    blurred: [3][]f32,
    /// How strong an edge or a point is there.
    edges: []f32,
    points: []f32,
    memory: []f32,

    fn of(gpa: Allocator, filter: *const Filter, picture: *const Picture) error{OutOfMemory}!Look {
        const count = picture.linear[0].len;
        const memory = try gpa.alloc(f32, 5 * count);
        errdefer gpa.free(memory);
        var look: Look = .{
            .blurred = undefined,
            .edges = memory[3 * count ..][0..count],
            .points = memory[4 * count ..][0..count],
            .memory = memory,
        };
        for (&look.blurred, 0..) |*plane, index| plane.* = memory[index * count ..][0..count];
        const scratch = try gpa.alloc(f32, count);
        defer gpa.free(scratch);
        for (0..count) |index| {
            const opponent = opponentOf(picture.linearAt(index));
            for (look.blurred, opponent) |plane, value| plane[index] = value;
            scratch[index] = (opponent[0] + 16) / 116;
        }
        try look.findFeatures(gpa, filter, scratch);
        look.blur(filter, scratch);
        return look;
    }

    fn deinit(look: *Look, gpa: Allocator) void {
        gpa.free(look.memory);
        look.* = undefined;
    }

    fn lab(look: *const Look, index: usize) [3]f32 {
        return .{ look.blurred[0][index], look.blurred[1][index], look.blurred[2][index] };
    }

    /// Magnitudes of the luminance's first and second derivatives, as Gaussians see them.
    fn findFeatures(
        look: *Look,
        gpa: Allocator,
        filter: *const Filter,
        luminance: []const f32,
    ) error{OutOfMemory}!void {
        const sigma = 0.5 * feature_width_deg * pixels_per_degree;
        const radius: usize = @intFromFloat(@ceil(3 * sigma));
        const smooth: Kernel = .gaussian(radius, sigma);
        const down = try gpa.alloc(f32, luminance.len);
        defer gpa.free(down);
        inline for (.{ look.edges, look.points }, .{ 1, 2 }) |across, order| {
            const derivative: Kernel = .of(radius, sigma, order);
            filter.apply(&derivative, &smooth, luminance, across);
            filter.apply(&smooth, &derivative, luminance, down);
            for (across, down) |*x, y| x.* = @sqrt(x.* * x.* + y * y);
        }
    }

    /// From opponent colours to the Lab of what the eye resolves of them.
    fn blur(look: *Look, filter: *const Filter, scratch: []f32) void {
        const radius: usize =
            @intFromFloat(@ceil(3 * sigmaOf(blue_yellow[0])));
        const kernels: [2]Kernel = .{
            .gaussian(radius, sigmaOf(achromatic)), .gaussian(radius, sigmaOf(red_green)),
        };
        for (look.blurred[0..2], &kernels) |plane, *kernel| {
            filter.apply(kernel, kernel, plane, plane);
        }
        // A sum of two bells, weighted by what each holds.
        var shares: [2]f64 = undefined;
        for (&shares, blue_yellow) |*share, part| {
            const sum = sumOf(radius, sigmaOf(part));
            share.* = part.a * @sqrt(std.math.pi / part.b) * sum * sum;
        }
        const first: Kernel = .gaussian(radius, sigmaOf(blue_yellow[0]));
        const second: Kernel = .gaussian(radius, sigmaOf(blue_yellow[1]));
        const plane = look.blurred[2];
        filter.apply(&first, &first, plane, scratch);
        filter.apply(&second, &second, plane, plane);
        const share: f32 = @floatCast(shares[0] / (shares[0] + shares[1]));
        for (plane, scratch) |*value, other| value.* = share * other + (1 - share) * value.*;
        for (0..scratch.len) |index| {
            var rgb = linearOf(look.lab(index));
            for (&rgb) |*channel| channel.* = std.math.clamp(channel.*, 0, 1);
            for (look.blurred, huntLab(rgb)) |target, value| target[index] = value;
        }
    }
};

/// Standard deviation of a contrast sensitivity, in pixels.
fn sigmaOf(sensitivity: Sensitivity) f64 {
    return @sqrt(sensitivity.b / (2 * std.math.pi * std.math.pi)) * pixels_per_degree;
}

fn sumOf(radius: usize, sigma: f64) f64 {
    var sum: f64 = 1;
    for (1..radius + 1) |x| {
        const distance: f64 = @floatFromInt(x);
        sum += 2 * elementary.exp(-distance * distance / (2 * sigma * sigma));
    }
    return sum;
}

/// Linear Rec. 709 to CIE XYZ relative to its white, whose components are 1.
fn xyzOf(rgb: [3]f32) [3]f32 {
    const white = comptime .{ row(0)[0] + row(0)[1] + row(0)[2], row(2)[0] + row(2)[1] + row(2)[2] };
    return .{
        (row(0)[0] * rgb[0] + row(0)[1] * rgb[1] + row(0)[2] * rgb[2]) / white[0],
        row(1)[0] * rgb[0] + row(1)[1] * rgb[1] + row(1)[2] * rgb[2],
        (row(2)[0] * rgb[0] + row(2)[1] * rgb[1] + row(2)[2] * rgb[2]) / white[1],
    };
}

/// Rows of the matrix from the primaries of Rec. 709 and D65.
fn row(comptime index: usize) [3]f32 {
    return ([3][3]f32{
        .{ 0.41238656, 0.35759149, 0.18045049 },
        .{ 0.21263682, 0.71518298, 0.07218020 },
        .{ 0.01933062, 0.11919716, 0.95037259 },
    })[index];
}

/// Opponent colours YCxCz, in which the contrast sensitivities are known.
fn opponentOf(rgb: [3]f32) [3]f32 {
    const xyz = xyzOf(rgb);
    return .{ 116 * xyz[1] - 16, 500 * (xyz[0] - xyz[1]), 200 * (xyz[1] - xyz[2]) };
}

/// Back to linear Rec. 709.
fn linearOf(opponent: [3]f32) [3]f32 {
    const y = (opponent[0] + 16) / 116;
    const x = (y + opponent[1] / 500) * comptime (row(0)[0] + row(0)[1] + row(0)[2]);
    const z = (y - opponent[2] / 200) * comptime (row(2)[0] + row(2)[1] + row(2)[2]);
    return .{
        3.2410033 * x - 1.5373989 * y - 0.49861587 * z,
        -0.96922433 * x + 1.8759301 * y + 0.041554224 * z,
        0.055639423 * x - 0.20401120 * y + 1.0571489 * z,
    };
}

/// CIELAB, its colours fainter where it is dark (Hunt 1952).
fn huntLab(rgb: [3]f32) [3]f32 {
    const xyz = xyzOf(rgb);
    var roots: [3]f32 = undefined;
    for (&roots, xyz) |*root, value| {
        const knee = 6.0 / 29.0;
        root.* = if (value > knee * knee * knee)
            @floatCast(elementary.pow(value, 1.0 / 3.0))
        else
            value / (3 * knee * knee) + 4.0 / 29.0;
    }
    const lightness = 116 * roots[1] - 16;
    return .{
        lightness,
        0.01 * lightness * 500 * (roots[0] - roots[1]),
        0.01 * lightness * 200 * (roots[1] - roots[2]),
    };
}

/// Distance of colours far apart (Abasi et al. 2020).
fn hyab(a: [3]f32, b: [3]f32) f32 {
    const x = a[1] - b[1];
    const y = a[2] - b[2];
    return @abs(a[0] - b[0]) + @sqrt(x * x + y * y);
}

/// Most of the range for small differences, the rest for large ones.
fn spread(distance: f32, largest: f32) f32 {
    const knee = bend.at * largest;
    if (distance < knee) return distance * (bend.to / knee);
    return bend.to + (distance - knee) / (largest - knee) * (1 - bend.to);
}

fn power(base: f32, exponent: f32) f32 {
    return @floatCast(elementary.pow(base, exponent));
}

test "the same picture differs nowhere, black from white as much as colours of one luminance can" {
    const gpa = std.testing.allocator;
    var black: Picture = try .solid(gpa, 20, 12, .{ 0, 0, 0 });
    defer black.deinit(gpa);
    var white: Picture = try .solid(gpa, 20, 12, .{ 1, 1, 1 });
    defer white.deinit(gpa);
    var map: [240]f32 = undefined;
    try evaluate(gpa, &white, &white, &map);
    for (map) |value| try std.testing.expectEqual(0, value);
    try evaluate(gpa, &black, &white, &map);
    // HyAB 100 to the 0.7 is 25.12, that of green and blue 41.27: 0.95 + 0.05 * (25.12 - 16.51) /
    // 24.76. There are no edges.
    for (map) |value| try std.testing.expectApproxEqAbs(0.9674, value, 1e-3);
}

test "colours go to opponents and back" {
    for ([_][3]f32{ .{ 1, 1, 1 }, .{ 0.2, 0.5, 0.9 }, .{ 0, 1, 0 } }) |rgb| {
        for (linearOf(opponentOf(rgb)), rgb) |found, wanted| {
            try std.testing.expectApproxEqAbs(wanted, found, 1e-5);
        }
    }
    const white = huntLab(.{ 1, 1, 1 });
    try std.testing.expectApproxEqAbs(100, white[0], 1e-3);
    try std.testing.expectApproxEqAbs(0, white[1], 1e-3);
}
