//! Directions by an environment map's brightness in lanes: hierarchical sample warping (Clarberg et
//! al. 2005, "Wavelet Importance Sampling").
//!
//! In: a distribution over the octahedral square, numbers in 0..1. Out: directions, and their
//! density by solid angle. Numbers go down the quadtree a lane at a time: each cell parts them by
//! the weights of its halves, across and then down, so that points that are spread evenly stay so.
//! In a cell the density is even in the square; by solid angle it is that over 4 l^3, l the sum of
//! the components of the unit vector (`math/octahedral.zig`).

const std = @import("std");
const chi_squared = @import("chi_squared.zig");
const simd = @import("../../simd.zig");
const world_file = @import("../../world.zig");
const environment_file = @import("environment.zig");
const Distribution = world_file.EnvironmentDistribution;
const Environment = world_file.Environment;

/// The largest number below 1.
const below_one = 0x1.fffffep-1;

/// Unit vectors in the world for pairs of numbers; any in lanes not asked for.
pub fn sample(
    comptime Lanes: type,
    environment: *const Environment,
    distribution: *const Distribution,
    numbers: [2]Lanes.F32,
    asked: Lanes.Mask,
) Lanes.Vec3 {
    const F32 = Lanes.F32;
    const from = [2][Lanes.count]f32{ numbers[0].toArray(), numbers[1].toArray() };
    var places: [2][Lanes.count]f32 = @splat(@splat(0.5));
    var rest = asked.bits();
    while (rest != 0) : (rest &= rest - 1) {
        const lane = @ctz(rest);
        const place = placeOf(distribution, .{ from[0][lane], from[1][lane] });
        inline for (&places, place) |*coordinates, coordinate| coordinates[lane] = coordinate;
    }
    const one: F32 = .splat(1);
    const zero: F32 = .zero();
    const u = F32.fromArray(places[0]).mul(.splat(2)).sub(one);
    const v = F32.fromArray(places[1]).mul(.splat(2)).sub(one);
    const size_u = u.abs();
    const size_v = v.abs();
    const height = one.sub(size_u).sub(size_v);
    const below = height.lt(zero);
    const folded_u = one.sub(size_v);
    const folded_v = one.sub(size_u);
    const x = F32.select(below, F32.select(u.lt(zero), folded_u.neg(), folded_u), u);
    const z = F32.select(below, F32.select(v.lt(zero), folded_v.neg(), folded_v), v);
    const rows = environment.to_map;
    const turned = Lanes.Vec3.splat(rows[0]).scale(x)
        .add(Lanes.Vec3.splat(rows[1]).scale(height))
        .add(Lanes.Vec3.splat(rows[2]).scale(z));
    return turned.normalize();
}

/// Density of `sample` at unit vectors, per steradian; 0 in lanes not asked for.
pub fn pdf(
    comptime Lanes: type,
    environment: *const Environment,
    distribution: *const Distribution,
    direction: Lanes.Vec3,
    asked: Lanes.Mask,
) Lanes.F32 {
    const F32 = Lanes.F32;
    const places = environment_file.placesOf(Lanes, environment, direction);
    var weights: [Lanes.count]f32 = @splat(0);
    var rest = asked.bits();
    while (rest != 0) : (rest &= rest - 1) {
        const lane = @ctz(rest);
        weights[lane] = weightAt(distribution, places.of(lane));
    }
    const rows = environment.to_map;
    const x = direction.dot(.splat(rows[0]));
    const y = direction.dot(.splat(rows[1]));
    const z = direction.dot(.splat(rows[2]));
    const sum = x.abs().add(y.abs()).add(z.abs());
    const cells: f32 = @floatFromInt(distribution.size * distribution.size);
    const share = F32.fromArray(weights).mul(.splat(0.25 * cells / distribution.total()));
    return share.div(sum.mul(sum).mul(sum));
}

/// A point of the square, 0..1 each.
fn placeOf(distribution: *const Distribution, numbers: [2]f32) [2]f32 {
    var rest = numbers;
    var index: usize = 0;
    var column: u32 = 0;
    var row: u32 = 0;
    var size: u32 = 1;
    while (size < distribution.size) : (size *= 2) {
        const parts = distribution.weights[4 * index + 1 ..][0..4].*;
        const across: u32 = choose(&rest[0], parts[0] + parts[2], parts[1] + parts[3]);
        const down: u32 = choose(&rest[1], parts[across], parts[2 + across]);
        column = 2 * column + across;
        row = 2 * row + down;
        index = 4 * index + 1 + 2 * down + across;
    }
    const scale = 1 / @as(f32, @floatFromInt(size));
    // Sums are not to round up into the next cell.
    return .{
        (@as(f32, @floatFromInt(column)) + smaller(rest[0], 1 - 0x1p-13)) * scale,
        (@as(f32, @floatFromInt(row)) + smaller(rest[1], 1 - 0x1p-13)) * scale,
    };
}

/// Takes one of two by weight, and leaves a number that is even again. One of no weight is not
/// taken.
inline fn choose(number: *f32, first: f32, second: f32) u1 {
    const target = number.* * (first + second);
    if (target < first or !(second > 0)) {
        number.* = smaller(target / first, below_one);
        return 0;
    }
    number.* = smaller((target - first) / second, below_one);
    return 1;
}

inline fn smaller(a: f32, b: f32) f32 {
    return if (a < b) a else b;
}

/// The weight of the cell at a point of the square.
fn weightAt(distribution: *const Distribution, place: [2]f32) f32 {
    const size = distribution.size;
    const cell = interleaved(cellOf(place[0], size)) | interleaved(cellOf(place[1], size)) << 1;
    const cells = @as(usize, size) * size;
    return distribution.weights[(cells - 1) / 3 + cell];
}

/// Also of what is not a number.
inline fn cellOf(coordinate: f32, size: u32) u32 {
    const scaled = coordinate * @as(f32, @floatFromInt(size));
    if (!(scaled > 0)) return 0;
    const last: f32 = @floatFromInt(size - 1);
    return @intFromFloat(smaller(scaled, last));
}

/// The bits of a number below 2^16 at the even places.
inline fn interleaved(number: u32) usize {
    var bits = number;
    bits = (bits | bits << 8) & 0x00ff_00ff;
    bits = (bits | bits << 4) & 0x0f0f_0f0f;
    bits = (bits | bits << 2) & 0x3333_3333;
    return (bits | bits << 1) & 0x5555_5555;
}

const Single = simd.Lanes(.scalar, 1);
const sampleFor = sample;
const pdfFor = pdf;

/// A distribution over 16 x 16 cells, some of which are dark, around a turned world.
const TestSky = struct {
    weights: [1 + 4 + 16 + 64 + 256]f32,
    distribution: Distribution,
    environment: Environment,

    fn init(sky: *TestSky) void {
        var random = std.Random.DefaultPrng.init(3);
        const inner = sky.weights.len - 256;
        for (sky.weights[inner..], 0..) |*weight, index| {
            const number = random.random().float(f32);
            weight.* = if (index == 77) 40 else if (number < 0.3) 0 else number;
        }
        var index: usize = inner;
        while (index > 0) {
            index -= 1;
            const parts = sky.weights[4 * index + 1 ..][0..4];
            sky.weights[index] = (parts[0] + parts[2]) + (parts[1] + parts[3]);
        }
        sky.distribution = .{ .weights = &sky.weights, .size = 16 };
        sky.environment = .{
            .ambient = 0,
            .background = @splat(0),
            .to_map = .{ .{ 0.6, 0, 0.8 }, .{ 0, 1, 0 }, .{ -0.8, 0, 0.6 } },
        };
    }

    pub fn sample(sky: *const TestSky, numbers: [3]f32) [3]f32 {
        return sky.sampleIn(Single, numbers[0..2].*).lane(0);
    }

    fn sampleIn(sky: *const TestSky, comptime Lanes: type, numbers: [2]f32) Lanes.Vec3 {
        const points = [2]Lanes.F32{ .splat(numbers[0]), .splat(numbers[1]) };
        return sampleFor(Lanes, &sky.environment, &sky.distribution, points, .splat(true));
    }

    pub fn pdf(sky: *const TestSky, direction: [3]f32) f32 {
        const way: Single.Vec3 = .splat(direction);
        return pdfFor(Single, &sky.environment, &sky.distribution, way, .splat(true)).lane(0);
    }
};

test "directions have the density that they are said to have, which covers the sphere once" {
    var sky: TestSky = undefined;
    sky.init();
    try chi_squared.expectDistributed(&sky);
    const count = 200;
    var sum: f64 = 0;
    for (0..count) |row| for (0..count) |column| {
        const z = (@as(f32, @floatFromInt(row)) + 0.5) / count * 2 - 1;
        const turn = (@as(f32, @floatFromInt(column)) + 0.5) / count * 2 * std.math.pi;
        const radius = @sqrt(1 - z * z);
        sum += sky.pdf(.{ radius * @cos(turn), radius * @sin(turn), z });
    };
    try std.testing.expectApproxEqRel(1, sum * 4 * std.math.pi / (count * count), 0.01);
}

test "dark cells are left out, and all numbers give unit vectors" {
    var sky: TestSky = undefined;
    sky.init();
    const edges = [_]f32{ 0, 1e-7, 0.25, 0.5, 0.75, below_one };
    for (edges) |first| for (edges) |second| {
        const way = sky.sampleIn(Single, .{ first, second });
        try std.testing.expectApproxEqAbs(1, way.length().lane(0), 1e-6);
        const place = placeOf(&sky.distribution, .{ first, second });
        try std.testing.expect(weightAt(&sky.distribution, place) > 0);
    };
}
