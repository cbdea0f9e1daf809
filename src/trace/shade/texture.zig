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
pub const textures_max = @typeInfo(world_file.Slot).@"enum".field_names.len;

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
