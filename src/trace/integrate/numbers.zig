//! Two numbers for a pixel, a sample and a dimension: interleaved gradient noise (Jimenez 2014,
//! "Next Generation Post Processing in Call of Duty") moved on by the R2 sequence (Roberts 2018,
//! "The Unreasonable Effectiveness of Quasirandom Sequences").
//!
//! In: columns and rows in lanes, the numbers of sample and dimension. Out: numbers in 0..1, even
//! over the samples of a pixel and, for each sample, over the pixels of any 3x3. They depend on
//! nothing else, so that every bundle, tile and thread has the same. Everything is + - * and
//! truncation of numbers that are not negative.

const std = @import("std");
const simd = @import("../../simd.zig");

/// Where the pattern is mirrored for other dimensions: pictures are not wider or higher.
const mirror_axis = 16384;

/// Four dimensions after which the pattern is the same again, moved on by the golden section.
const golden = 0.6180339887498949;

/// How far the second number's pattern is moved: where columns are rows they would be the same.
const beside = 41;

/// The inverse of the plastic number, and of its square.
const r2 = [2]f64{ 0.7548776662466927, 0.5698402909980532 };

/// The numbers of a pixel's sample in one dimension, each in 0..1, 1 exclusive.
pub fn at(
    comptime Lanes: type,
    pixel: [2]Lanes.F32,
    sample: u32,
    dimension: u32,
) [2]Lanes.F32 {
    const axis: Lanes.F32 = .splat(mirror_axis);
    const x = if (dimension % 2 == 0) pixel[0] else axis.sub(pixel[0]);
    const y = if (dimension / 2 % 2 == 0) pixel[1] else axis.sub(pixel[1]);
    const around = golden * @as(f64, @floatFromInt(dimension / 4));
    var numbers = [2]Lanes.F32{ gradient(Lanes, x, y), gradient(Lanes, y.add(.splat(beside)), x) };
    inline for (&numbers, r2) |*number, step| {
        const steps = step * @as(f64, @floatFromInt(sample)) + around;
        number.* = fraction(Lanes, number.add(.splat(@floatCast(steps - @floor(steps)))));
    }
    return numbers;
}

inline fn gradient(comptime Lanes: type, x: Lanes.F32, y: Lanes.F32) Lanes.F32 {
    const slope = x.mul(.splat(0.06711056)).add(y.mul(.splat(0.00583715)));
    return fraction(Lanes, fraction(Lanes, slope).mul(.splat(52.9829189)));
}

/// Of numbers that are not negative.
inline fn fraction(comptime Lanes: type, value: Lanes.F32) Lanes.F32 {
    return value.sub(value.toI32().toF32());
}

const Single = simd.Lanes(.scalar, 1);

fn testAt(x: usize, y: usize, sample: u32, dimension: u32) [2]f32 {
    const pixel = [2]Single.F32{ .splat(@floatFromInt(x)), .splat(@floatFromInt(y)) };
    const numbers = at(Single, pixel, sample, dimension);
    return .{ numbers[0].lane(0), numbers[1].lane(0) };
}

test "samples of a pixel, and neighbours, fill the square evenly" {
    for ([_][2]usize{ .{ 0, 0 }, .{ 511, 3 }, .{ 16380, 16380 } }) |corner| {
        for (0..4) |dimension| for (0..2) |axis| {
            var samples: [4]u32 = @splat(0);
            var neighbours: [3]u32 = @splat(0);
            for (0..64) |sample| {
                const found =
                    testAt(corner[0], corner[1], @intCast(sample), @intCast(dimension))[axis];
                try std.testing.expect(found >= 0 and found < 1);
                samples[@intFromFloat(found * 4)] += 1;
            }
            for (samples) |count| try std.testing.expect(count >= 13 and count <= 19);
            for (0..9) |index| {
                const x = corner[0] + index % 3;
                const found = testAt(x, corner[1] + index / 3, 0, @intCast(dimension))[axis];
                neighbours[@intFromFloat(found * 3)] += 1;
            }
            for (neighbours) |count| try std.testing.expect(count >= 1 and count <= 5);
        };
    }
}

test "the two numbers, and those of other dimensions, do not follow each other" {
    var products: [3]f64 = @splat(0);
    const side = 24;
    for (0..side) |y| for (0..side) |x| {
        const first = testAt(x, y, 0, 0);
        const second = testAt(x, y, 0, 1);
        for (&products, [3]f32{ first[1], second[0], second[1] }) |*product, other| {
            product.* += (@as(f64, first[0]) - 0.5) * (other - 0.5) / (side * side);
        }
    };
    // 1 / 12 if they were the same.
    for (products) |product| try std.testing.expectApproxEqAbs(0, product, 0.02);
}

test "every lane has the number of its pixel" {
    const Lanes = simd.Lanes(.vector, 4);
    const x = [4]f32{ 0, 1, 640, 9000 };
    const y = [4]f32{ 7, 1, 360, 4000 };
    const numbers = at(Lanes, .{ .fromArray(x), .fromArray(y) }, 5, 2);
    for (0..4) |lane| {
        const one = testAt(@intFromFloat(x[lane]), @intFromFloat(y[lane]), 5, 2);
        try std.testing.expectEqual(one, [2]f32{ numbers[0].lane(lane), numbers[1].lane(lane) });
    }
}
