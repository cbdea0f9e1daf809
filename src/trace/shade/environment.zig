//! Radiance of the environment in lanes: what escaping rays, lobes and diffuse surfaces see.
//!
//! In: directions or normals. Out: radiance. Directions are turned and projected in lanes; texels
//! are gathered a lane at a time, four mixed, and two levels: the same expression in every backend.

const std = @import("std");
const world_file = @import("../../world.zig");
const Environment = world_file.Environment;
const Level = world_file.EnvironmentLevel;
const Map = world_file.EnvironmentMap;
const Texel = world_file.EnvironmentTexel;

/// Radiance from directions of any length, in the lanes asked for, else 0; at least `ambient`. What
/// is seen is spread over an angle in radians, and by a lobe of some roughness.
pub fn radiance(
    comptime Lanes: type,
    environment: *const Environment,
    direction: Lanes.Vec3,
    roughness: Lanes.F32,
    spread: Lanes.F32,
    asked: Lanes.Mask,
) Lanes.Vec3 {
    const map = environment.map orelse return ambientOf(Lanes, environment, asked);
    const places = placesOf(Lanes, environment, direction);
    const roughnesses = roughness.toArray();
    const spreads = spread.toArray();
    var texels: [3][Lanes.count]f32 = @splat(@splat(0));
    var rest = asked.bits();
    while (rest != 0) : (rest &= rest - 1) {
        const lane = @ctz(rest);
        const place = places.of(lane);
        const texel = lobeAt(map, place, roughnesses[lane], spreads[lane]);
        inline for (&texels, 0..) |*channel, index| channel[lane] = texel[index];
    }
    return scaled(Lanes, environment, texels, asked);
}

/// Irradiance over pi by unit normals, in the lanes asked for, else 0; at least `ambient`.
pub fn irradiance(
    comptime Lanes: type,
    environment: *const Environment,
    normal: Lanes.Vec3,
    asked: Lanes.Mask,
) Lanes.Vec3 {
    const map = environment.map orelse return ambientOf(Lanes, environment, asked);
    const places = placesOf(Lanes, environment, normal);
    var texels: [3][Lanes.count]f32 = @splat(@splat(0));
    var rest = asked.bits();
    while (rest != 0) : (rest &= rest - 1) {
        const lane = @ctz(rest);
        const texel = mixed(&map.diffuse, places.of(lane));
        inline for (&texels, 0..) |*channel, index| channel[lane] = texel[index];
    }
    return scaled(Lanes, environment, texels, asked);
}

fn ambientOf(
    comptime Lanes: type,
    environment: *const Environment,
    asked: Lanes.Mask,
) Lanes.Vec3 {
    const everywhere: Lanes.Vec3 = .splat(@splat(environment.ambient));
    return .select(asked, everywhere, .splat(.{ 0, 0, 0 }));
}

fn scaled(
    comptime Lanes: type,
    environment: *const Environment,
    texels: [3][Lanes.count]f32,
    asked: Lanes.Mask,
) Lanes.Vec3 {
    const found: Lanes.Vec3 = .{
        .x = .fromArray(texels[0]),
        .y = .fromArray(texels[1]),
        .z = .fromArray(texels[2]),
    };
    return found.mul(.splat(environment.scale)).add(ambientOf(Lanes, environment, asked));
}

/// Where in the octahedral square directions are, 0..1 each; not a number where these are none.
pub fn Places(comptime Lanes: type) type {
    return struct {
        u: [Lanes.count]f32,
        v: [Lanes.count]f32,

        /// In one lane.
        pub inline fn of(places: *const @This(), lane: usize) [2]f32 {
            return .{ places.u[lane], places.v[lane] };
        }
    };
}

/// Of directions of any length, see `math/octahedral.zig`.
pub inline fn placesOf(
    comptime Lanes: type,
    environment: *const Environment,
    direction: Lanes.Vec3,
) Places(Lanes) {
    const F32 = Lanes.F32;
    const rows = environment.to_map;
    const x = direction.dot(.splat(rows[0]));
    const y = direction.dot(.splat(rows[1]));
    const z = direction.dot(.splat(rows[2]));
    const one: F32 = .splat(1);
    const zero: F32 = .zero();
    const size = x.abs().add(y.abs()).add(z.abs());
    const scale = one.div(size);
    const u = x.mul(scale);
    const v = z.mul(scale);
    const folded_u = one.sub(v.abs());
    const folded_v = one.sub(u.abs());
    const below = y.lt(zero);
    const all_u = F32.select(below, F32.select(u.lt(zero), folded_u.neg(), folded_u), u);
    const all_v = F32.select(below, F32.select(v.lt(zero), folded_v.neg(), folded_v), v);
    const half: F32 = .splat(0.5);
    return .{
        .u = all_u.mul(half).add(half).toArray(),
        .v = all_v.mul(half).add(half).toArray(),
    };
}

/// Below this roughness a lobe counts as the mirror direction alone.
const roughness_least = 0.03;

/// What a lobe sees that is spread besides.
inline fn lobeAt(map: *const Map, place: [2]f32, roughness: f32, spread: f32) Texel {
    if (!(roughness > roughness_least)) return spreadAt(map, place, spread);
    // Widths add as squares: GGX's alpha is the tangent of half of where its lobe ends.
    const alpha = roughness * roughness;
    const wide = @sqrt(@sqrt(alpha * alpha + 0.25 * spread * spread));
    const last: f32 = @floatFromInt(map.glossy.len);
    const number = if (wide < 1) wide * last else last;
    if (number < 1) {
        const sharp = spreadAt(map, place, spread);
        return sharp + (mixed(&map.glossy[0], place) - sharp) * splat(number);
    }
    const index: usize = @min(@as(usize, @intFromFloat(number)), map.glossy.len - 1) - 1;
    const share = number - @as(f32, @floatFromInt(index + 1));
    const lower = mixed(&map.glossy[index], place);
    return lower + (mixed(&map.glossy[index + 1], place) - lower) * splat(share);
}

/// The radiance spread over an angle.
inline fn spreadAt(map: *const Map, place: [2]f32, spread: f32) Texel {
    // Square root of the mean solid angle of a texel.
    const texel_angle = 3.5449077 / @as(f32, @floatFromInt(map.radiance[0].size));
    const ratio = spread / texel_angle;
    if (!(ratio > 1)) return mixed(&map.radiance[0], place);
    const depth = log2(ratio);
    const last = map.radiance.len - 1;
    const index: usize = @intFromFloat(depth);
    if (index >= last) return mixed(&map.radiance[last], place);
    const share = depth - @as(f32, @floatFromInt(index));
    const finer = mixed(&map.radiance[index], place);
    return finer + (mixed(&map.radiance[index + 1], place) - finer) * splat(share);
}

/// Between powers of two on the straight line through them: for a share of two levels that is as
/// good. Of numbers from 1 on; infinity gives 128.
inline fn log2(value: f32) f32 {
    const bits: u32 = @bitCast(value);
    const exponent: f32 = @floatFromInt(@as(i32, @intCast(bits >> 23)) - 127);
    const fraction: f32 = @bitCast((bits & 0x7f_ffff) | 0x3f80_0000);
    return exponent + (fraction - 1);
}

/// Four texels mixed.
inline fn mixed(level: *const Level, place: [2]f32) Texel {
    const size: f32 = @floatFromInt(level.size);
    // With the border the first texel's middle is at 1.5; half a texel less is the upper left one.
    const across = bounded(place[0] * size + 0.5, size);
    const down = bounded(place[1] * size + 0.5, size);
    const column: usize = @intFromFloat(across);
    const row: usize = @intFromFloat(down);
    const share_right = splat(across - @as(f32, @floatFromInt(column)));
    const share_below = splat(down - @as(f32, @floatFromInt(row)));
    const side = level.size + 2;
    const upper = level.texels[row * side + column ..][0..2];
    const lower = level.texels[(row + 1) * side + column ..][0..2];
    const above = upper[0] + (upper[1] - upper[0]) * share_right;
    const below = lower[0] + (lower[1] - lower[0]) * share_right;
    return above + (below - above) * share_below;
}

/// Within the level, also what is not a number.
inline fn bounded(coordinate: f32, size: f32) f32 {
    const positive = if (coordinate > 0) coordinate else 0;
    return if (positive < size + 0.5) positive else size + 0.5;
}

inline fn splat(value: f32) Texel {
    return @splat(value);
}
