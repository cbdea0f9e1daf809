//! Filtered lookups of textures: trilinear in pyramids, probes along elongated footprints.
//!
//! In: textures that are sampled alike, a footprint. Out: their texels, weighted. Pyramids are
//! Williams's (1983, "Pyramidal Parametrics"); where the footprint is more than twice as long as
//! wide, up to 8 probes stand along it (McCormack et al. 1999, "Feline: Fast Elliptical Lines for
//! Anisotropic Texture Mapping"). What lies where is as glTF 2.0, section 3.8.4, and OpenGL define
//! it. One place at a time, over the channels: the same expression whatever the variant.

const std = @import("std");
const math = @import("../../math.zig");
const world_file = @import("../../world.zig");
const assert = std.debug.assert;
const Lookup = world_file.Lookup;
const Texture = world_file.Texture;
const Wrap = world_file.Wrap;

/// Channels of a texel, linear; those that a texture does not have are 0.
pub const Texel = @Vector(4, f32);

/// Textures that can be sampled at once: one for each slot.
pub const textures_max = world_file.Slot.base_count;

/// Probes along a footprint at most.
const probes_max = 8;

/// A probe serves a part of the footprint that is this many times as long as wide.
const probe_elongation = 2;

const sqrt2: f32 = std.math.sqrt2;

/// What of a texture a lookup covers.
pub const Footprint = struct {
    /// Texture coordinates: (0, 0) is the image's upper left corner, (1, 1) its lower right one.
    place: [2]f32,
    /// Both axes of the ellipse around the place, from end to end.
    axes: [2][2]f32,
};

/// Whether two lookups of textures take the texels of the same places with the same weights.
pub fn isSampledAlike(textures: []const Texture, a: *const Lookup, b: *const Lookup) bool {
    const level_a = &textures[a.texture].levels[0];
    const level_b = &textures[b.texture].levels[0];
    return level_a.width == level_b.width and level_a.height == level_b.height and
        a.wrap[0] == b.wrap[0] and a.wrap[1] == b.wrap[1] and
        a.magnify_linear == b.magnify_linear and a.minify_linear == b.minify_linear and
        a.has_mips == b.has_mips and a.mip_linear == b.mip_linear and
        a.texcoord_set == b.texcoord_set and std.meta.eql(a.transform, b.transform);
}

/// The texels of textures that are sampled as `lookup` says, which all have the same size.
pub fn sample(
    textures: []const *const Texture,
    lookup: *const Lookup,
    footprint: *const Footprint,
    texels: *[textures_max]Texel,
) void {
    const levels = textures[0].levels;
    const probes: Probes = .of(levels, lookup, footprint);
    const sums = texels[0..textures.len];
    for (sums) |*sum| sum.* = @splat(0);
    var place = probes.first;
    for (0..probes.count) |_| {
        const fine: Cell = .of(&levels[probes.level], lookup.wrap, place, probes.is_linear);
        if (probes.coarser == 0) {
            for (textures, sums) |texture, *sum| sum.* += fetch(texture, probes.level, &fine);
        } else {
            const next = probes.level + 1;
            const coarse: Cell = .of(&levels[next], lookup.wrap, place, probes.is_linear);
            for (textures, sums) |texture, *sum| {
                const near = fetch(texture, probes.level, &fine);
                sum.* += mix(near, fetch(texture, next, &coarse), probes.coarser);
            }
        }
        for (&place, probes.step) |*coordinate, step| coordinate.* += step;
    }
    const share: Texel = @splat(1 / @as(f32, @floatFromInt(probes.count)));
    for (textures, sums) |texture, *sum| {
        if (probes.count > 1) sum.* *= share;
        // Bytes count whole up to here: a texture of one value keeps it exactly.
        if (!texture.is_srgb) sum.* /= @as(Texel, @splat(255));
    }
}

/// Where lookups of a footprint are made, and in which levels.
const Probes = struct {
    count: u32,
    first: [2]f32,
    step: [2]f32,
    level: u32,
    /// Share of the level after it.
    coarser: f32,
    is_linear: bool,

    fn of(
        levels: []const world_file.TextureLevel,
        lookup: *const Lookup,
        footprint: *const Footprint,
    ) Probes {
        var probes: Probes = .{
            .count = 1,
            .first = footprint.place,
            .step = .{ 0, 0 },
            .level = 0,
            .coarser = 0,
            .is_linear = lookup.minify_linear,
        };
        const lengths = [2]f32{
            lengthInTexels(&levels[0], footprint.axes[0]),
            lengthInTexels(&levels[0], footprint.axes[1]),
        };
        const longer: usize = @intFromBool(lengths[1] > lengths[0]);
        const major = lengths[longer];
        // One probe in one texel where a footprint has no bounds.
        if (!(lengths[0] + lengths[1] < 0x1p30)) {
            probes.choose(levels, lookup, 0x1p30);
            return probes;
        }
        // Texels are no finer than the finest, and probes no more than there may be.
        const minor = larger(larger(lengths[1 - longer], 1 / sqrt2), //
            major * (1.0 / @as(comptime_float, probes_max * probe_elongation)));
        const is_long = major > probe_elongation * minor;
        // As wide as a circle of the ellipse's area, up to where probes make up for the length.
        const width = if (is_long) sqrt2 * minor else @sqrt(major * minor);
        probes.choose(levels, lookup, width);
        if (is_long and probes.is_linear)
            probes.spread(footprint.axes[longer], major / (probe_elongation * minor));
        return probes;
    }

    /// Levels and filter for a width in texels of the finest level.
    fn choose(
        probes: *Probes,
        levels: []const world_file.TextureLevel,
        lookup: *const Lookup,
        width: f32,
    ) void {
        // OpenGL 4.6, section 8.15: so that it stays linear until a coarser level is nearest.
        const stays_linear = lookup.magnify_linear and !lookup.minify_linear and lookup.has_mips;
        const is_magnified = width <= if (stays_linear) sqrt2 else 1;
        if (is_magnified) probes.is_linear = lookup.magnify_linear;
        if (is_magnified or !lookup.has_mips or !(width > 1)) return;
        // The logarithm of the width, linear between powers of two.
        const bits: u32 = @bitCast(width);
        const exponent = (bits >> 23) - 127;
        const mantissa: f32 = @bitCast(bits & 0x7f_ffff | 0x3f80_0000);
        if (lookup.mip_linear) {
            probes.level = exponent;
            probes.coarser = mantissa - 1;
        } else {
            probes.level = exponent + @intFromBool(mantissa > sqrt2);
        }
        const last: u32 = @intCast(levels.len - 1);
        if (probes.level < last) return;
        probes.level = last;
        probes.coarser = 0;
    }

    /// At least `count` probes along an axis, each in the middle of an equal part.
    fn spread(probes: *Probes, axis: [2]f32, count: f32) void {
        const whole: u32 = @intFromFloat(count);
        probes.count = whole + @intFromBool(@as(f32, @floatFromInt(whole)) < count);
        assert(probes.count <= probes_max);
        const parts: f32 = @floatFromInt(probes.count);
        for (&probes.first, &probes.step, axis) |*first, *step, length| {
            step.* = length / parts;
            first.* += 0.5 * (step.* - length);
        }
    }
};

fn lengthInTexels(level: *const world_file.TextureLevel, axis: [2]f32) f32 {
    const x = axis[0] * @as(f32, @floatFromInt(level.width));
    const y = axis[1] * @as(f32, @floatFromInt(level.height));
    return @sqrt(x * x + y * y);
}

/// Texels around a place in a level, and where between them it is.
const Cell = struct {
    /// By row: left and right of the place.
    texels: [2][2]usize,
    /// From the left column to the right one, and from the upper row to the lower; negative: the
    /// first texel alone.
    between: [2]f32,

    fn of(
        level: *const world_file.TextureLevel,
        wrap: [2]Wrap,
        place: [2]f32,
        is_linear: bool,
    ) Cell {
        const x = fold(wrap[0], place[0]);
        const y = fold(wrap[1], place[1]);
        const width: usize = level.width;
        if (!is_linear) {
            const texel = nearest(level.height, y) * width + nearest(level.width, x);
            return .{ .texels = @splat(@splat(texel)), .between = .{ -1, -1 } };
        }
        const column = neighbours(level.width, wrap[0], x);
        const row = neighbours(level.height, wrap[1], y);
        const upper = row.first * width;
        const lower = row.second * width;
        return .{
            .texels = .{
                .{ upper + column.first, upper + column.second },
                .{ lower + column.first, lower + column.second },
            },
            .between = .{ column.between, row.between },
        };
    }
};

/// The texel that a coordinate of 0..1 is in, of `count`.
fn nearest(count: u32, coordinate: f32) usize {
    const at: u32 = @intFromFloat(coordinate * @as(f32, @floatFromInt(count)));
    return @min(at, count - 1);
}

const Neighbours = struct { first: usize, second: usize, between: f32 };

/// The texels on both sides of a coordinate of 0..1, of `count`. Mirrored images end as clamped
/// ones do: with their last texel twice.
fn neighbours(count: u32, wrap: Wrap, coordinate: f32) Neighbours {
    const at = coordinate * @as(f32, @floatFromInt(count)) - 0.5;
    const truncated: i32 = @intFromFloat(at);
    const floor = if (at < 0) -1 else truncated;
    const last: i32 = @intCast(count - 1);
    const first = if (floor >= 0) floor else if (wrap == .repeat) last else 0;
    const second = if (floor < last) floor + 1 else if (wrap == .repeat) 0 else last;
    return .{
        .first = @intCast(first),
        .second = @intCast(second),
        .between = at - @as(f32, @floatFromInt(floor)),
    };
}

/// A coordinate in 0..1 that shows the same texel; 0 for what is no number.
fn fold(wrap: Wrap, coordinate: f32) f32 {
    switch (wrap) {
        .repeat => return fraction(coordinate),
        .mirrored_repeat => {
            const twice = 2 * fraction(0.5 * coordinate);
            return if (twice > 1) 2 - twice else twice;
        },
        .clamp_to_edge => {
            if (!(coordinate > 0)) return 0;
            return if (coordinate < 1) coordinate else 1;
        },
    }
}

/// What is left of a number without the integer below it.
fn fraction(x: f32) f32 {
    // From there on all floats are integers; and infinities, NaN.
    if (!(@abs(x) < 0x1p23)) return 0;
    const whole: i32 = @intFromFloat(x);
    const rest = x - @as(f32, @floatFromInt(whole));
    return if (rest < 0) rest + 1 else rest;
}

/// The texels of a cell, mixed: colours from 0 to 1 where the texture is sRGB, bytes where not.
inline fn fetch(texture: *const Texture, level: u32, cell: *const Cell) Texel {
    const texels = texture.levels[level].texels;
    return switch (texture.channel_count) {
        inline 1, 2, 3, 4 => |count| if (texture.is_srgb)
            mixed(count, true, texels, cell)
        else
            mixed(count, false, texels, cell),
        else => unreachable,
    };
}

/// Mixed so that what is equal stays as it is: alpha of 1 does.
fn mixed(
    comptime channel_count: usize,
    comptime is_srgb: bool,
    texels: []const u8,
    cell: *const Cell,
) Texel {
    const first = decode(channel_count, is_srgb, texels, cell.texels[0][0]);
    if (cell.between[0] < 0) return first;
    const second = decode(channel_count, is_srgb, texels, cell.texels[0][1]);
    const third = decode(channel_count, is_srgb, texels, cell.texels[1][0]);
    const fourth = decode(channel_count, is_srgb, texels, cell.texels[1][1]);
    const upper = mix(first, second, cell.between[0]);
    const lower = mix(third, fourth, cell.between[0]);
    return mix(upper, lower, cell.between[1]);
}

inline fn decode(
    comptime channel_count: usize,
    comptime is_srgb: bool,
    texels: []const u8,
    index: usize,
) Texel {
    const bytes = texels[index * channel_count ..][0..channel_count].*;
    var values: [4]f32 = @splat(0);
    inline for (bytes, 0..) |byte, channel| {
        values[channel] = if (!is_srgb)
            @floatFromInt(byte)
        else if (channel == 3)
            fractions[byte]
        else
            math.srgb.decoded[byte];
    }
    return values;
}

/// Bytes over 255.
const fractions: [256]f32 = table: {
    var table: [256]f32 = undefined;
    for (&table, 0..) |*value, byte| value.* = @as(f32, byte) / 255;
    break :table table;
};

inline fn mix(a: Texel, b: Texel, share: f32) Texel {
    return a + (b - a) * @as(Texel, @splat(share));
}

inline fn larger(a: f32, b: f32) f32 {
    return if (a > b) a else b;
}

/// A pyramid of one channel whose level l is all of value 10 (l + 1), but for the finest.
const TestPyramid = struct {
    texels: [3][64]u8,
    levels: [4]world_file.TextureLevel,

    fn init(pyramid: *TestPyramid, finest: *const [64]u8) Texture {
        pyramid.levels[0] = .{ .width = 8, .height = 8, .texels = finest };
        for (&pyramid.texels, pyramid.levels[1..], 1..) |*texels, *level, number| {
            const side = @as(u32, 8) >> @intCast(number);
            texels.* = @splat(@intCast(10 * (number + 1)));
            level.* = .{ .width = side, .height = side, .texels = texels[0 .. side * side] };
        }
        return .{ .levels = &pyramid.levels, .channel_count = 1, .is_srgb = false };
    }
};

const test_lookup: Lookup = .{
    .slot = .base_color,
    .texture = 0,
    .wrap = @splat(.repeat),
    .magnify_linear = true,
    .minify_linear = true,
    .has_mips = true,
    .mip_linear = true,
    .texcoord_set = 0,
    .transform = .{ .{ 1, 0, 0 }, .{ 0, 1, 0 } },
    .channels = @splat(0),
};

/// The first channel of a lookup, in bytes.
fn testSample(texture: *const Texture, lookup: *const Lookup, footprint: Footprint) f32 {
    var texels: [textures_max]Texel = undefined;
    sample(&.{texture}, lookup, &footprint, &texels);
    return texels[0][0] * 255;
}

/// A row of texels 0, 1, 2 and 3 looked up without a footprint.
fn testRow(wrap: Wrap, is_linear: bool, u: f32) f32 {
    const texels = [4]u8{ 0, 1, 2, 3 };
    const texture: Texture = .{
        .levels = &.{.{ .width = 4, .height = 1, .texels = &texels }},
        .channel_count = 1,
        .is_srgb = false,
    };
    var lookup = test_lookup;
    lookup.wrap = .{ wrap, .repeat };
    lookup.magnify_linear = is_linear;
    return testSample(&texture, &lookup, .{ .place = .{ u, 0.5 }, .axes = @splat(.{ 0, 0 }) });
}

test "texel centres, edges and what lies beyond them, by every wrap mode" {
    const Case = struct { Wrap, f32, f32, f32 };
    for ([_]Case{
        // Coordinate, linear, nearest.
        .{ .repeat, 0.125, 0, 0 },           .{ .repeat, 0.5, 1.5, 2 },
        .{ .repeat, 0, 1.5, 0 },             .{ .repeat, 1, 1.5, 0 },
        .{ .repeat, -0.125, 3, 3 },          .{ .repeat, 5.375, 1, 1 },
        .{ .repeat, -7.625, 1, 1 },          .{ .repeat, 0.9375, 2.25, 3 },
        .{ .repeat, 4096.625, 2, 2 },        .{ .repeat, 1e30, 1.5, 0 },
        .{ .mirrored_repeat, 0, 0, 0 },      .{ .mirrored_repeat, 1, 3, 3 },
        .{ .mirrored_repeat, 1.125, 3, 3 },  .{ .mirrored_repeat, 1.625, 1, 1 },
        .{ .mirrored_repeat, 2.125, 0, 0 },  .{ .mirrored_repeat, -0.375, 1, 1 },
        .{ .mirrored_repeat, 0.0625, 0, 0 }, .{ .mirrored_repeat, -1.25, 2.5, 3 },
        .{ .clamp_to_edge, -3, 0, 0 },       .{ .clamp_to_edge, 0.0625, 0, 0 },
        .{ .clamp_to_edge, 0.75, 2.5, 3 },   .{ .clamp_to_edge, 1e38, 3, 3 },
    }) |case| {
        errdefer std.debug.print("{t} {d}\n", .{ case[0], case[1] });
        try std.testing.expectApproxEqAbs(case[2], testRow(case[0], true, case[1]), 1e-5);
        try std.testing.expectApproxEqAbs(case[3], testRow(case[0], false, case[1]), 1e-5);
    }
}

test "no number is looked up as 0, infinities somewhere in the image" {
    const inf = std.math.inf(f32);
    const nan = std.math.nan(f32);
    for (std.enums.values(Wrap)) |wrap| for ([_]bool{ false, true }) |is_linear| {
        try std.testing.expectEqual(testRow(wrap, is_linear, 0), testRow(wrap, is_linear, nan));
        for ([_]f32{ inf, -inf, std.math.floatMax(f32), -0x1p23, -1e-30 }) |u| {
            const value = testRow(wrap, is_linear, u);
            try std.testing.expect(value >= 0 and value <= 3);
        }
    };
    const finest: [64]u8 = @splat(10);
    var pyramid: TestPyramid = undefined;
    const texture = pyramid.init(&finest);
    for ([_]f32{ nan, inf, 1e30, 1e38 }) |size| {
        const footprint: Footprint = .{ .place = .{ nan, inf }, .axes = @splat(.{ size, 0 }) };
        try std.testing.expectApproxEqAbs(40, testSample(&texture, &test_lookup, footprint), 1e-5);
    }
}

test "the level is that whose texels are as wide as the footprint" {
    const finest: [64]u8 = @splat(10);
    var pyramid: TestPyramid = undefined;
    const texture = pyramid.init(&finest);
    var nearest_level = test_lookup;
    nearest_level.mip_linear = false;
    var no_levels = test_lookup;
    no_levels.has_mips = false;
    const Case = struct { f32, f32, f32 };
    for ([_]Case{
        // Texels, mixed levels, nearest level.
        .{ 0, 10, 10 },   .{ 0.5, 10, 10 }, .{ 1, 10, 10 },       .{ 1.4, 14, 10 },
        .{ 1.5, 15, 20 }, .{ 2, 20, 20 },   .{ 2.75, 23.75, 20 }, .{ 3, 25, 30 },
        .{ 4, 30, 30 },   .{ 6, 35, 40 },   .{ 8, 40, 40 },       .{ 1000, 40, 40 },
    }) |case| {
        const size = case[0] / 8;
        const footprint: Footprint = .{
            .place = .{ 0.3, 0.7 },
            .axes = .{ .{ 0, size }, .{ -size, 0 } },
        };
        const expectClose = std.testing.expectApproxEqAbs;
        try expectClose(case[1], testSample(&texture, &test_lookup, footprint), 1e-4);
        try expectClose(case[2], testSample(&texture, &nearest_level, footprint), 1e-4);
        try expectClose(10, testSample(&texture, &no_levels, footprint), 1e-4);
    }
}

test "filters for what is larger and smaller than texels differ where a sampler says so" {
    var finest: [64]u8 = undefined;
    for (&finest, 0..) |*texel, index| texel.* = if (index % 8 == 0) 0 else 100;
    var pyramid: TestPyramid = undefined;
    const texture = pyramid.init(&finest);
    var lookup = test_lookup;
    lookup.has_mips = false;
    const place = [2]f32{ 1.0 / 8.0, 0.5 }; // Between the first column and the second.
    const Case = struct { bool, bool, f32, f32 };
    for ([_]Case{ .{ true, false, 50, 100 }, .{ false, true, 100, 50 } }) |case| {
        lookup.magnify_linear = case[0];
        lookup.minify_linear = case[1];
        const small: Footprint = .{ .place = place, .axes = .{ .{ 0.1, 0 }, .{ 0, 0.1 } } };
        const large: Footprint = .{ .place = place, .axes = .{ .{ 0.2, 0 }, .{ 0, 0.2 } } };
        try std.testing.expectApproxEqAbs(case[2], testSample(&texture, &lookup, small), 1e-4);
        try std.testing.expectApproxEqAbs(case[3], testSample(&texture, &lookup, large), 1e-4);
    }
}

test "a long footprint is as fine as it is narrow, and as long as it is" {
    // Columns that alternate, and columns in two halves.
    var stripes: [64]u8 = undefined;
    var halves: [64]u8 = undefined;
    for (&stripes, &halves, 0..) |*stripe, *half, index| {
        stripe.* = if (index % 2 == 0) 0 else 200;
        half.* = if (index % 8 < 4) 0 else 200;
    }
    var pyramid: TestPyramid = undefined;
    var lookup = test_lookup;
    lookup.wrap = @splat(.clamp_to_edge);
    const texture = pyramid.init(&stripes);
    const texel = 1.0 / 8.0;
    // Narrow across the stripes: level 0 wherever along them, one texel of each colour across.
    const along: Footprint = .{
        .place = .{ 2.5 * texel, 0.5 },
        .axes = .{ .{ 0, 1 }, .{ 0.5 * texel, 0 } },
    };
    try std.testing.expectApproxEqAbs(0, testSample(&texture, &lookup, along), 1e-4);
    const across: Footprint = .{
        .place = .{ 0.5, 0.5 },
        .axes = .{ .{ 0.5 * texel, 0.1 * texel }, .{ 1, 0 } },
    };
    try std.testing.expectApproxEqAbs(100, testSample(&texture, &lookup, across), 20);
    // It reaches from one half to the other by an eighth of its length.
    const split = pyramid.init(&halves);
    var reaching = across;
    reaching.place[0] = 0.5 - 0.375 * 0.5;
    reaching.axes[1] = .{ 0.5, 0 };
    try std.testing.expectApproxEqAbs(25, testSample(&split, &lookup, reaching), 15);
    reaching.axes[1] = .{ 0, 0.5 };
    try std.testing.expectApproxEqAbs(0, testSample(&split, &lookup, reaching), 1e-4);
}

test "colours are decoded before they are mixed, alpha is linear" {
    const texels = [2][4]u8{ .{ 0, 255, 188, 0 }, .{ 255, 255, 188, 255 } };
    const texture: Texture = .{
        .levels = &.{.{ .width = 2, .height = 1, .texels = std.mem.asBytes(&texels) }},
        .channel_count = 4,
        .is_srgb = true,
    };
    var found: [textures_max]Texel = undefined;
    const footprint: Footprint = .{ .place = .{ 0.5, 0.5 }, .axes = @splat(.{ 0, 0 }) };
    sample(&.{ &texture, &texture }, &test_lookup, &footprint, &found);
    const expected: Texel = .{ 0.5, 1, math.srgb.decoded[188], 0.5 };
    try std.testing.expectEqual(expected, found[0]);
    try std.testing.expectEqual(expected, found[1]);
}

test "what is the same everywhere stays exactly that" {
    const finest: [64]u8 = @splat(255);
    var pyramid: TestPyramid = undefined;
    var texture = pyramid.init(&finest);
    for (&pyramid.texels) |*texels| texels.* = @splat(255);
    var random = std.Random.DefaultPrng.init(5);
    for (0..500) |_| {
        var footprint: Footprint = undefined;
        for (&footprint.place) |*coordinate| coordinate.* = random.random().float(f32) * 9 - 4;
        for (&footprint.axes) |*axis| for (axis) |*length| {
            length.* = random.random().float(f32) - 0.5;
        };
        for ([_]bool{ false, true }) |is_srgb| {
            texture.is_srgb = is_srgb;
            try std.testing.expectEqual(255, testSample(&texture, &test_lookup, footprint));
        }
    }
}
