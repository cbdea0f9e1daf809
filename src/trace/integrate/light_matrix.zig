//! What candidates for virtual lights give points that the camera sees, with shadows: the matrix of
//! Hašan, Pellacini and Bala 2007, "Matrix Row-Column Sampling for the Many-Light Problem".
//!
//! In: a row of gains for each candidate, as luminance. Out: the candidates' weights, by their
//! shares of what each point gets; what all of them, and what those that are chosen, give the
//! points (`light_correction.zig`). Pieces of work are some points, or some rows.

const std = @import("std");
const math = @import("../../math.zig");
const light_importance = @import("light_importance.zig");
const Allocator = std.mem.Allocator;
const Candidate = @import("virtual_lights.zig").Candidate;
const Correction = @import("light_correction.zig").Correction;
const Grid = @import("light_correction.zig").Grid;
const Pixel = @import("interleave.zig").Layers.Pixel;
const Place = @import("interleave.zig").Place;
const Point = light_importance.Point;
const View = @import("../../world.zig").View;

/// Points of a piece of work.
pub const piece_points = 64;
/// Part of what points get in the mean that is added to what each gets: where there is next to no
/// light at all it is not seen how much.
const least_share = 0.1;

/// Rows of gains; none: they are not asked for.
pub const LightMatrix = struct {
    gains: []f32,
    correction: Correction,

    pub const none: LightMatrix = .{ .gains = &.{}, .correction = .none };

    /// With room for so many rows; to be freed by `deinit`.
    pub fn init(gpa: Allocator, row_count: usize, grid: Grid) error{OutOfMemory}!LightMatrix {
        const place_count = @as(usize, grid.side) * grid.side;
        const gains = try gpa.alloc(f32, row_count * place_count);
        errdefer gpa.free(gains);
        const places = try gpa.alloc(Place, place_count);
        errdefer gpa.free(places);
        const few = try gpa.alloc(Pixel, place_count);
        errdefer gpa.free(few);
        const many = try gpa.alloc(Pixel, place_count);
        @memset(few, @splat(0));
        @memset(many, @splat(0));
        return .{
            .gains = gains,
            .correction = .{ .grid = grid, .places = places, .few = few, .many = many },
        };
    }

    /// Frees everything.
    pub fn deinit(matrix: *LightMatrix, gpa: Allocator) void {
        gpa.free(matrix.gains);
        gpa.free(matrix.correction.places);
        gpa.free(matrix.correction.few);
        gpa.free(matrix.correction.many);
    }

    /// Rows at most.
    pub fn rowCount(matrix: *const LightMatrix) usize {
        return matrix.gains.len / matrix.correction.few.len;
    }

    /// What a candidate gives all points.
    pub fn gainsOf(matrix: *const LightMatrix, row: usize, point_count: usize) []f32 {
        return matrix.gains[row * matrix.correction.few.len ..][0..point_count];
    }

    fn placeOf(matrix: *const LightMatrix, point: *const Point) usize {
        return point.row * matrix.correction.grid.side + point.column;
    }

    /// Flux over luminance; the fourth is 1, so that it is not 0 where anything arrives.
    fn colorOf(candidate: *const Candidate, luminance: f64) Pixel {
        const color = math.vec3.scale(candidate.flux, @floatCast(1 / luminance));
        return .{ color[0], color[1], color[2], 1 };
    }

    fn ofPiece(points: []const Point, piece: usize) []const Point {
        const first = piece * piece_points;
        return points[first..@min(first + piece_points, points.len)];
    }

    /// Adds up what all candidates give some points, as seen from the camera.
    pub fn addUp(
        matrix: *LightMatrix,
        view: *const View,
        candidates: []const Candidate,
        points: []const Point,
        piece: usize,
    ) void {
        var sums: [piece_points]Pixel = @splat(@splat(0));
        const some = ofPiece(points, piece);
        for (candidates, 0..) |*candidate, row| {
            const color = colorOf(candidate, candidate.luminance());
            const gains = matrix.gainsOf(row, points.len)[piece * piece_points ..][0..some.len];
            for (sums[0..some.len], gains) |*sum, gain| sum.* += color * @as(Pixel, @splat(gain));
        }
        for (sums[0..some.len], some) |sum, *point| {
            const at = matrix.placeOf(point);
            matrix.correction.many[at] = sum;
            matrix.correction.places[at] = .{
                .position = math.vec3.sub(point.position, view.camera.origin),
                .normal = point.normal,
                .off = 0,
            };
        }
    }

    /// Makes the shares of what points get that are some candidates', from this row on, their
    /// weights.
    pub fn rate(
        matrix: *const LightMatrix,
        candidates: []Candidate,
        first_row: usize,
        points: []const Point,
    ) void {
        const many = matrix.correction.many;
        var total: f64 = 0;
        for (points) |*point| total += many[matrix.placeOf(point)][3];
        const least = least_share * total / @as(f64, @floatFromInt(@max(1, points.len)));
        var inverses: [light_importance.point_max]f32 = undefined;
        for (points, inverses[0..points.len]) |*point, *inverse| {
            const whole = many[matrix.placeOf(point)][3] + least;
            inverse.* = if (whole > 0) @floatCast(1 / whole) else 0;
        }
        for (candidates, first_row..) |*candidate, row| {
            var squares: f64 = 0;
            for (matrix.gainsOf(row, points.len), inverses[0..points.len]) |gain, inverse| {
                const share = gain * inverse;
                squares += share * share;
            }
            candidate.weight = @sqrt(squares);
        }
    }

    /// Adds up what the chosen ones give some points: their flux and disks are others than those of
    /// the candidates, whose rows are `rows`.
    pub fn compare(
        matrix: *LightMatrix,
        candidates: []const Candidate,
        chosen: []const Candidate,
        rows: []const u32,
        points: []const Point,
        piece: usize,
    ) void {
        var sums: [piece_points]Pixel = @splat(@splat(0));
        const some = ofPiece(points, piece);
        for (chosen, rows) |*one, row| {
            const from = &candidates[row];
            const color = colorOf(one, from.luminance());
            const gains = matrix.gainsOf(row, points.len)[piece * piece_points ..][0..some.len];
            for (sums[0..some.len], some, gains) |*sum, *point, gain| {
                const way = math.vec3.sub(point.position, one.position);
                const squared = math.vec3.dot(way, way);
                const spread = (squared + from.disk) / (squared + one.disk);
                sum.* += color * @as(Pixel, @splat(gain * spread));
            }
        }
        for (sums[0..some.len], some) |sum, *point|
            matrix.correction.few[matrix.placeOf(point)] = sum;
    }
};
