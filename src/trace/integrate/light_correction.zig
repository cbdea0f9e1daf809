//! What few virtual lights miss, or have too much, by joint bilateral upsampling (Kopf, Cohen,
//! Lischinski and Uyttendaele 2007): the light of few over that of many changes slowly over a
//! surface.
//!
//! In: at points that the camera sees, evenly over the picture, the light of the lights that pixels
//! have, and of many more. Out: factors for pixels, between the points around each that lie on much
//! the same surface; near to 1 where there are none.

const std = @import("std");
const vec3 = @import("../../math.zig").vec3;
const interleave = @import("interleave.zig");
const Pixel = interleave.Layers.Pixel;

/// Points of a picture.
pub const Grid = struct {
    /// In a row, and rows.
    side: u32,
    /// Pixels from one to the next; the first is half of that from the edge.
    step: u32,

    /// The pixel of a place in the grid.
    pub fn pixelOf(grid: Grid, place: usize) u32 {
        return @intCast(place * grid.step + grid.step / 2);
    }
};

/// Cosine between normals, from which on light has nothing in common.
const cosine_least = 0.7;
/// How far off a pixel's plane a point may be, in distances between points.
const off_share = 0.3;
/// Weight of no correction at all beside all points around.
const plain_weight = 0.05;
/// Bounds of a factor.
const factor_least: Pixel = @splat(0.25);
const factor_most: Pixel = @splat(4);

/// Light of points, row by row; 0 where nothing is known.
pub const Correction = struct {
    grid: Grid,
    /// Where points are: of the whole picture, whatever part of it there are pixels of.
    places: []interleave.Place,
    few: []Pixel,
    many: []Pixel,

    pub const none: Correction = .{
        .grid = .{ .side = 0, .step = 1 },
        .places = &.{},
        .few = &.{},
        .many = &.{},
    };

    /// The factors of a pixel that sees this.
    pub fn of(
        correction: *const Correction,
        own: *const interleave.Place,
        x: u32,
        y: u32,
    ) Pixel {
        const grid = correction.grid;
        if (correction.few.len == 0) return @splat(1);
        const step: f32 = @floatFromInt(grid.step);
        const column = firstOf(grid, x);
        const row = firstOf(grid, y);
        const off_max = own.off * step * (off_share / interleave.off_max);
        var around: Pixel = @splat(0);
        var few: Pixel = @splat(0);
        var many: Pixel = @splat(0);
        for (0..2) |down| for (0..2) |right| {
            const at_column = column + right -% 1;
            const at_row = row + down -% 1;
            if (at_column >= grid.side or at_row >= grid.side) continue;
            const at = at_row * grid.side + at_column;
            const light = correction.few[at];
            if (light[3] == 0) continue;
            const other_x = grid.pixelOf(at_column);
            const other_y = grid.pixelOf(at_row);
            const tent = tentOf(x, other_x, step) * tentOf(y, other_y, step);
            const weight: Pixel = @splat(tent * likeness(own, &correction.places[at], off_max));
            around += @as(Pixel, @splat(tent)) * light;
            few += weight * light;
            many += weight * correction.many[at];
        };
        const rest = around * @as(Pixel, @splat(plain_weight));
        const whole = few + rest;
        const known = whole > @as(Pixel, @splat(1e-20));
        const one: Pixel = @splat(1);
        const factor = @select(f32, known, (many + rest) / @select(f32, known, whole, one), one);
        return @min(@max(factor, factor_least), factor_most);
    }

    /// The first place on the far side of a pixel, which may be one beyond the grid.
    fn firstOf(grid: Grid, pixel: u32) usize {
        return (pixel + grid.step - grid.step / 2) / grid.step;
    }

    fn tentOf(pixel: u32, other: u32, width: f32) f32 {
        const off = @as(f32, @floatFromInt(pixel)) - @as(f32, @floatFromInt(other));
        return @max(0, 1 - @abs(off) / width);
    }

    /// How much two pixels see one surface, in 0..1; 1 where the first sees several.
    fn likeness(own: *const interleave.Place, other: *const interleave.Place, off_max: f32) f32 {
        if (vec3.dot(own.normal, own.normal) == 0) return 1;
        const cosine = vec3.dot(own.normal, other.normal);
        const off = vec3.dot(own.normal, vec3.sub(other.position, own.position));
        const by_normal = (cosine - cosine_least) / (1 - cosine_least);
        const by_place = 1 - @abs(off) / off_max;
        return @min(1, @max(0, by_normal)) * @max(0, by_place);
    }
};
