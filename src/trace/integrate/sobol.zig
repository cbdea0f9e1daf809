//! Owen-scrambled Sobol points (Laine and Karras 2011, Burley 2020) that neighbouring pixels share,
//! so that what is left of noise is blue (Ahmed and Wonka 2020).
//!
//! In: pixels, sample numbers and dimensions, in lanes. Out: points of the unit square, one for
//! each dimension of a path's integral that counts two. Integer arithmetic alone: the same bits in
//! every variant. The first 2^k samples of a pixel are a (0,k,2)-net in every dimension: one in
//! each elementary interval, whatever k, so that no number of samples need be known before.
//!
//! Ahmed and Wonka give each pixel a stretch of one sequence, in the order of a Z-shaped curve,
//! which fixes the number of samples. Here each pixel has all of the sequence, shifted bit by bit
//! by a generator matrix of the pixel's number on the curve. That of Pascal's triangle modulo 2
//! makes the first 2^k samples of any 4^j pixels of a cell of the curve a net in either coordinate,
//! for every k and j: minors of adjacent rows that begin in the first column are all 1.

const std = @import("std");
const simd = @import("../../simd.zig");

/// Points of paths in lanes.
pub fn Sobol(comptime Lanes: type) type {
    const F32 = Lanes.F32;
    const I32 = Lanes.I32;
    return struct {
        /// The pixel's number on the Z-shaped curve, and the sample's: their bits reversed.
        pixel: I32,
        sample: I32,

        const Self = @This();

        /// Of samples of pixels, 0 <= x, y < 2^16.
        pub fn init(x: I32, y: I32, number: I32) Self {
            return .{
                .pixel = reversed(spread(x).bitOr(spread(y).shiftLeft(1))),
                .sample = reversed(number),
            };
        }

        /// A point of 0 <= x, y < 1. Dimensions are those of pairs, from 0, and independent.
        pub noinline fn pair(sobol: *const Self, dimension: I32) [2]F32 {
            @setEvalBranchQuota(10_000);
            const base = dimension.shiftLeft(2).add(word(0x9e3779b9));
            const shift = reversed(scrambled(sobol.pixel, hash(base)));
            const index = reversed(scrambled(sobol.sample, hash(base.add(.splat(1)))));
            var turned = shift;
            inline for (turned_steps) |step| turned = turned.bitXor(upper(turned, step));
            const x = index.bitXor(lowerAll(shift));
            const y = upperAll(index).bitXor(lowerAll(turned));
            return .{
                fraction(scrambled(x, hash(base.add(.splat(2))))),
                fraction(scrambled(y, hash(base.add(.splat(3))))),
            };
        }

        /// Nested uniform scrambling (Owen 1995) of digits from the first in bit 0 on, by a hash in
        /// which no bit depends on those above it; constants of Vegdahl's (2021).
        inline fn scrambled(digits: I32, seed: I32) I32 {
            var v = digits;
            v = v.bitXor(v.mul(word(0x3d20adea))).add(seed);
            v = v.mul(seed.shiftRight(16).bitOr(.splat(1)));
            v = v.bitXor(v.mul(word(0x05526c56)));
            return v.bitXor(v.mul(word(0x53a22864)));
        }

        /// A hash of 32 bits to as many, of multiplications and shifts (Wellons 2018).
        inline fn hash(value: I32) I32 {
            var v = value;
            v = v.bitXor(v.shiftRight(16)).mul(word(0x21f0aaad));
            v = v.bitXor(v.shiftRight(15)).mul(word(0xd35a2d97));
            return v.bitXor(v.shiftRight(15));
        }

        /// Bit n of the result: the sum of bits i of the vector, binomial(i, n) times.
        inline fn upperAll(vector: I32) I32 {
            var v = vector;
            inline for (steps) |step| v = v.bitXor(upper(v, step));
            return v;
        }

        /// Bit n of the result: the sum of bits i of the vector, binomial(n, i) times.
        inline fn lowerAll(vector: I32) I32 {
            var v = vector;
            inline for (steps) |step| {
                v = v.bitXor(v.bitAnd(word(lowHalves(step))).shiftLeft(step));
            }
            return v;
        }

        /// One factor of Pascal's triangle: it is a Kronecker product of five.
        inline fn upper(v: I32, comptime step: u5) I32 {
            return v.shiftRight(step).bitAnd(word(lowHalves(step)));
        }

        /// The bits in the opposite order.
        inline fn reversed(value: I32) I32 {
            var v = value;
            inline for (steps[0 .. steps.len - 1]) |step| {
                const low = word(lowHalves(step));
                v = v.shiftRight(step).bitAnd(low).bitOr(v.bitAnd(low).shiftLeft(step));
            }
            return v.shiftRight(16).bitOr(v.shiftLeft(16));
        }

        /// Bit n of 16 in bit 2 n.
        inline fn spread(value: I32) I32 {
            var v = value;
            inline for ([_]u5{ 8, 4, 2, 1 }) |step| {
                v = v.bitOr(v.shiftLeft(step)).bitAnd(word(lowHalves(step)));
            }
            return v;
        }

        /// As many digits as a float holds.
        inline fn fraction(digits: I32) F32 {
            return reversed(digits).shiftRight(8).toF32().mul(.splat(0x1p-24));
        }

        inline fn word(comptime bits: u32) I32 {
            return .splat(@bitCast(bits));
        }
    };
}

const steps = [_]u5{ 1, 2, 4, 8, 16 };

/// The factors by which the second coordinate's matrix of pixels differs from the first's. All of
/// them or none would do in one dimension; of the 32 choices this is among the best ones for
/// edges in any direction, for each number of samples.
const turned_steps = [_]u5{ 1, 4, 8, 16 };

/// In each field of twice as many bits, the lower ones.
fn lowHalves(comptime bit_count: u5) u32 {
    return ~@as(u32, 0) / ((1 << bit_count) + 1);
}

const One = Sobol(simd.Lanes(.scalar, 1));

fn pointForTest(x: u32, y: u32, number: u32, dimension: u32) [2]f32 {
    const sobol: One = .init(.splat(@intCast(x)), .splat(@intCast(y)), .splat(@intCast(number)));
    const point = sobol.pair(.splat(@intCast(dimension)));
    return .{ point[0].lane(0), point[1].lane(0) };
}

/// Whether 2^k points are one in each of as many boxes, that are in so many columns.
fn fillsBoxes(points: []const [2]f32, column_count: usize) bool {
    var filled: [4096]bool = @splat(false);
    const row_count = points.len / column_count;
    for (points) |point| {
        const column: usize = @intFromFloat(point[0] * @as(f32, @floatFromInt(column_count)));
        const row: usize = @intFromFloat(point[1] * @as(f32, @floatFromInt(row_count)));
        filled[column * row_count + row] = true;
    }
    return std.mem.findScalar(bool, filled[0..points.len], false) == null;
}

test "the first 2^k samples of a pixel are one in each elementary interval, in any dimension" {
    const cases = [_][3]u32{ .{ 0, 0, 0 }, .{ 3, 1, 1 }, .{ 1023, 700, 5 }, .{ 65535, 9, 200 } };
    for (cases) |case| {
        var points: [256][2]f32 = undefined;
        for (&points, 0..) |*point, number| {
            point.* = pointForTest(case[0], case[1], @intCast(number), case[2]);
            for (point) |at| try std.testing.expect(at >= 0 and at < 1);
        }
        for (0..9) |k| for (0..k + 1) |columns| {
            const first = points[0 .. @as(usize, 1) << @intCast(k)];
            try std.testing.expect(fillsBoxes(first, @as(usize, 1) << @intCast(columns)));
        };
    }
}

test "the first 2^k samples of a cell of pixels fill every column and row" {
    for ([_][3]u32{ .{ 0, 0, 0 }, .{ 24, 8, 1 }, .{ 1016, 696, 7 } }) |case| {
        const x0, const y0, const dimension = case;
        for ([_]u32{ 1, 2, 4, 16 }) |sample_count| for ([_]u32{ 2, 4, 8 }) |side| {
            var points: [8 * 8 * 16][2]f32 = undefined;
            var rest: [][2]f32 = &points;
            for (0..side * side) |at| for (0..sample_count) |number| {
                const index: u32 = @intCast(at);
                const x, const y = .{ x0 + index % side, y0 + index / side };
                rest[0] = pointForTest(x, y, @intCast(number), dimension);
                rest = rest[1..];
            };
            const all = points[0 .. points.len - rest.len];
            try std.testing.expect(fillsBoxes(all, all.len));
            try std.testing.expect(fillsBoxes(all, 1));
        };
    }
}

test "noise is blue: over 64x64 pixels, errors of areas are less than those of white noise" {
    const side = 64;
    const area = 8;
    const edge_count = 6;
    // By pixel and edge: the samples behind it so far.
    var behind: [side * side][edge_count]f64 = @splat(@splat(0));
    for (0..4) |number| {
        for (&behind, 0..) |*counts, at| {
            const p = pointForTest(@intCast(at % side), @intCast(at / side), @intCast(number), 3);
            for (counts, 0..) |*count, edge| {
                const angle = @as(f32, @floatFromInt(edge)) * std.math.pi / edge_count;
                const distance = (p[0] - 0.45) * @cos(angle) + (p[1] - 0.55) * @sin(angle);
                count.* += if (distance < 0) 1 else 0;
            }
        }
        if (number == 2) continue;
        var relative: f64 = 0;
        for (0..edge_count) |edge| {
            var sums: [side / area][side / area]f64 = @splat(@splat(0));
            var mean: f64 = 0;
            var square: f64 = 0;
            for (behind, 0..) |counts, at| {
                const count = counts[edge];
                sums[at / side / area][at % side / area] += count;
                mean += count / (side * side);
                square += count * count / (side * side);
            }
            var of_areas: f64 = 0;
            for (sums) |row| for (row) |sum| {
                const difference = sum / (area * area) - mean;
                of_areas += difference * difference * (area * area) / (side * side);
            };
            // White noise's means of so many pixels have this share of the variance of one.
            relative += of_areas / ((square - mean * mean) / (area * area)) / edge_count;
        }
        errdefer std.debug.print("{d} samples: {d}\n", .{ number + 1, relative });
        try std.testing.expect(relative < 0.4);
    }
}

test "dimensions are independent, and means are those of the square" {
    var mean: [2]f64 = @splat(0);
    var products: [2]f64 = @splat(0);
    const side = 32;
    for (0..side) |y| for (0..side) |x| {
        const a = pointForTest(@intCast(x), @intCast(y), 0, 4);
        const b = pointForTest(@intCast(x), @intCast(y), 0, 5);
        for (a, &mean) |at, *sum| sum.* += at / (side * side);
        products[0] += (a[0] - 0.5) * (b[0] - 0.5) * 12 / (side * side);
        products[1] += (a[0] - 0.5) * (b[1] - 0.5) * 12 / (side * side);
    };
    for (mean) |found| try std.testing.expectApproxEqAbs(0.5, found, 0.002);
    for (products) |correlation| try std.testing.expectApproxEqAbs(0, correlation, 0.1);
}

fn checkLanes(comptime Lanes: type) !void {
    const n = Lanes.count;
    var random: std.Random.DefaultPrng = .init(1);
    for (0..50) |_| {
        var given: [4][n]i32 = undefined;
        for (&given, [_]u31{ 1 << 16, 1 << 16, 1 << 12, 1 << 10 }) |*numbers, limit| {
            for (numbers) |*number| number.* = random.random().uintLessThan(u31, limit);
        }
        const sobol: Sobol(Lanes) = .init(
            .fromArray(given[0]),
            .fromArray(given[1]),
            .fromArray(given[2]),
        );
        const found = sobol.pair(.fromArray(given[3]));
        for (0..n) |lane| {
            const wanted = pointForTest(
                @intCast(given[0][lane]),
                @intCast(given[1][lane]),
                @intCast(given[2][lane]),
                @intCast(given[3][lane]),
            );
            for (wanted, found) |w, f| try std.testing.expectEqual(w, f.lane(lane));
        }
    }
}

test "every backend has the same points" {
    inline for (.{
        simd.Lanes(.scalar, 8),
        simd.Lanes(.vector, 4),
        simd.Lanes(.vector, 16),
        simd.Lanes(.intrinsics, 4),
    }) |Lanes| try checkLanes(Lanes);
}
