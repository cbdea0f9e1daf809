//! NFOR in one pass: regression of first order on features, with weights by patches of the other
//! half (Bitterli, Rousselle, Moon, Iglesias-Guitian, Adler, Mitchell, Jarosz and Novak,
//! "Nonlinearly Weighted First-order Regression for Denoising Monte Carlo Renderings", 2016,
//! section 4; the weights are those of Rousselle, Manzi and Zwicker, "Robust Denoising using
//! Feature and Color Information", 2013).
//!
//! In: the planes around a tile. Out: the light of its pixels. Pixel q counts for p as much as the
//! patches around them are alike in the half that is not averaged, by its noise, and as features of
//! p allow. Where light depends on normal and depth within a surface, the regression says how.

const std = @import("std");
const planes_file = @import("planes.zig");
const regression = @import("regression.zig");
const Planes = planes_file.Planes;
const V = planes_file.V;
const lanes = planes_file.lanes;

/// Pixels of a tile.
pub const tile_width = 64;
pub const tile_height = 16;

/// Of the square of pixels that count, and of patches.
const window_radius = 8;
const patch_radius = 3;
/// Room that a tile needs around the picture.
pub const margin = window_radius + patch_radius;

/// How many times its deviation a difference may be.
const strictness = 0.5;
/// Light that nobody can tell from black, squared: differences below it do not matter.
const dark = 1e-6;

/// Distances of one offset, of a tile and the patches of its pixels.
const rows_with_patches = tile_height + 2 * patch_radius;
const columns_with_patches = tile_width + 2 * patch_radius;
const vectors_with_patches = std.math.divCeil(usize, columns_with_patches, lanes) catch unreachable;
const vectors = tile_width / lanes;

/// Of one thread.
pub const Scratch = struct {
    /// By half: of pixels, then of columns of them.
    distances: [2][rows_with_patches][vectors_with_patches * lanes]f32,
    columns: [2][vectors_with_patches * lanes]f32,
    sums: [tile_height][vectors][2]regression.Sums,
    /// What comes out: by row and channel.
    light: [tile_height][3][tile_width]f32,
};

/// Where a tile is, and how much of it the picture has.
pub const Tile = struct {
    x: usize,
    y: usize,
    width: usize,
    height: usize,

    /// Vectors that have its pixels and so many more.
    fn vectorCount(tile: Tile, more: usize) usize {
        return std.math.divCeil(usize, tile.width + more, lanes) catch unreachable;
    }
};

/// Filters a tile; its light is in the scratch.
pub fn run(planes: *const Planes, tile: Tile, scratch: *Scratch) void {
    const count = tile.vectorCount(0);
    for (scratch.sums[0..tile.height]) |*row| @memset(row[0..count], @splat(.zero));
    var dy: isize = -window_radius;
    while (dy <= window_radius) : (dy += 1) {
        var dx: isize = -window_radius;
        while (dx <= window_radius) : (dx += 1) {
            const offset = dy * @as(isize, @intCast(planes.stride)) + dx;
            findDistances(planes, tile, offset, scratch);
            addOffset(planes, tile, offset, scratch);
        }
    }
    for (scratch.sums[0..tile.height], scratch.light[0..tile.height]) |*row, *light| {
        for (row[0..count], 0..) |*halves, index| {
            const first = halves[0].solve();
            const second = halves[1].solve();
            for (light, first, second) |*channel, a, b| {
                channel[index * lanes ..][0..lanes].* = (a + b) * splat(0.5);
            }
        }
    }
}

inline fn moved(place: usize, offset: isize) usize {
    return @intCast(@as(isize, @intCast(place)) + offset);
}

/// How unlike pixels are to those at an offset, half by half, in units of their noise, which is
/// expected to make 0 of it.
fn findDistances(planes: *const Planes, tile: Tile, offset: isize, scratch: *Scratch) void {
    const first = [_]planes_file.Name{ .first_r, .first_g, .first_b };
    const second = [_]planes_file.Name{ .second_r, .second_g, .second_b };
    const count = tile.vectorCount(2 * patch_radius);
    for (0..tile.height + 2 * patch_radius) |row| {
        const start = planes.at(tile.x, tile.y) + row * planes.stride -
            patch_radius * (planes.stride + 1);
        for (0..count) |index| {
            const p = start + index * lanes;
            const q = moved(p, offset);
            const own = planes.load(.variance, p);
            const other = planes.load(.variance, q);
            // Halves vary twice as much as the mean.
            const both = (own + other) * splat(2);
            const noise = own * splat(2) + @select(f32, own < other, own, other) * splat(2);
            const scale = splat(1) / (splat(dark) + splat(strictness * strictness) * both);
            inline for (.{ first, second }, 0..) |names, half| {
                var square: V = splat(0);
                inline for (names) |name| {
                    const difference = planes.load(name, p) - planes.load(name, q);
                    square += difference * difference;
                }
                const distance = (square - noise) * scale;
                scratch.distances[half][row][index * lanes ..][0..lanes].* =
                    @select(f32, distance < splat(distance_max), distance, splat(distance_max));
            }
        }
    }
}

/// One pixel cannot make its patch stranger than that.
const distance_max = 1e4;

/// Adds the pixels at an offset to the sums.
fn addOffset(planes: *const Planes, tile: Tile, offset: isize, scratch: *Scratch) void {
    for (0..tile.height) |row| {
        for (&scratch.columns, &scratch.distances) |*columns, *distances| {
            for (0..tile.vectorCount(2 * patch_radius)) |index| {
                var sum: V = distances[row][index * lanes ..][0..lanes].*;
                inline for (1..2 * patch_radius + 1) |k| {
                    sum += @as(V, distances[row + k][index * lanes ..][0..lanes].*);
                }
                columns[index * lanes ..][0..lanes].* = sum;
            }
        }
        for (0..tile.vectorCount(0)) |index| {
            const p = planes.at(tile.x + index * lanes, tile.y + row);
            const q = moved(p, offset);
            var features: [regression.feature_count]V = undefined;
            const unlike = featureDistance(planes, p, q, &features);
            var weights: [2]V = undefined;
            for (&weights, &scratch.columns) |*weight, *columns| {
                var sum: V = splat(0);
                inline for (0..2 * patch_radius + 1) |k| {
                    sum += @as(V, columns[index * lanes + k ..][0..lanes].*);
                }
                const side = 2 * patch_radius + 1;
                const distance = sum * splat(1.0 / @as(f32, side * side));
                weight.* = weightOf(@select(f32, distance > splat(0), distance, splat(0)) + unlike);
            }
            if (@reduce(.Max, weights[0] + weights[1]) == 0) continue;
            const sums = &scratch.sums[row][index];
            sums[0].add(weights[1], &features, .{
                planes.load(.first_r, q), planes.load(.first_g, q), planes.load(.first_b, q),
            });
            sums[1].add(weights[0], &features, .{
                planes.load(.second_r, q), planes.load(.second_g, q), planes.load(.second_b, q),
            });
        }
    }
}

/// How much features differ from those of p for q to be of the same surface, and by how much.
inline fn featureDistance(
    planes: *const Planes,
    p: usize,
    q: usize,
    features: *[regression.feature_count]V,
) V {
    features[0] = planes.load(.normal_x, q) - planes.load(.normal_x, p);
    features[1] = planes.load(.normal_y, q) - planes.load(.normal_y, p);
    features[2] = planes.load(.normal_z, q) - planes.load(.normal_z, p);
    const depth = planes.load(.depth, q) - planes.load(.depth, p);
    const red = planes.load(.albedo_r, q) - planes.load(.albedo_r, p);
    const green = planes.load(.albedo_g, q) - planes.load(.albedo_g, p);
    const blue = planes.load(.albedo_b, q) - planes.load(.albedo_b, p);
    const turned = features[0] * features[0] + features[1] * features[1] +
        features[2] * features[2];
    const painted = red * red + green * green + blue * blue;
    const depth_strictness = planes.load(.depth_strictness, p);
    const apart = depth * depth * depth_strictness;
    features[3] = depth * @sqrt(depth_strictness);
    return turned * planes.load(.normal_strictness, p) + apart +
        painted * planes.load(.albedo_strictness, p);
}

/// About e^-x, and 0 from 8 on: (1 - x / 8)^8.
inline fn weightOf(distance: V) V {
    const rest = splat(1) - distance * splat(1.0 / 8.0);
    var power = @select(f32, rest > splat(0), rest, splat(0));
    inline for (0..3) |_| power *= power;
    return power;
}

inline fn splat(value: f32) V {
    return @splat(value);
}
