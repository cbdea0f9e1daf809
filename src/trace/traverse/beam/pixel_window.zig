//! Bounding rectangles of projected triangles, in pixels of a tile.
//!
//! In: corners of triangles in lanes. Out: the columns and rows of pixels that each may be seen in:
//! tells more than edge functions of small triangles, many of which lie between all pixels.

const std = @import("std");
const kernel_file = @import("../kernel.zig");
const simd = @import("../../../simd.zig");
const vec3 = @import("../../../math.zig").vec3;
const edges_file = @import("edges.zig");
const Grid = @import("grid.zig").Grid;

const side = kernel_file.beam_side;
const subtile_side = kernel_file.subtile_side;

/// Columns and rows that a triangle may be seen in.
pub fn PixelWindow(comptime Int: type) type {
    return struct {
        first_x: Int,
        first_y: Int,
        last_x: Int,
        last_y: Int,
    };
}

/// The subtiles of these columns and rows, a bit each.
pub inline fn subtilesOf(window: *const PixelWindow(i32)) u32 {
    const across = side / subtile_side;
    const first_column: u5 = @intCast(@divTrunc(window.first_x, subtile_side));
    const last_column: u5 = @intCast(@divTrunc(window.last_x, subtile_side));
    const first_row: u5 = @intCast(@divTrunc(window.first_y, subtile_side));
    const last_row: u5 = @intCast(@divTrunc(window.last_y, subtile_side));
    const columns = (@as(u32, 2) << last_column) - (@as(u32, 1) << first_column);
    const rows = (@as(u32, 1) << (last_row + 1) * across) - (@as(u32, 1) << first_row * across);
    return columns * 0x1111 & rows;
}

/// The inverse of a grid: for c = t (corner + x right + y down), depth . c = t, column . c = t x,
/// row . c = t y.
pub const Dual = struct {
    origin: [3]f32,
    column: [3]f32,
    row: [3]f32,
    depth: [3]f32,
    /// |column| + |row| + 16 |depth|: x or y of a point is off by 4 u of it, times |c| / t.
    gain: f32,

    /// Of a grid that has a `depthNormal`.
    pub fn of(grid: *const Grid) Dual {
        const facing = vec3.cross(grid.right, grid.down);
        const scale = 1 / vec3.dot(facing, grid.corner);
        var dual: Dual = .{
            .origin = grid.origin,
            .column = vec3.scale(vec3.cross(grid.down, grid.corner), scale),
            .row = vec3.scale(vec3.cross(grid.corner, grid.right), scale),
            .depth = vec3.scale(facing, scale),
            .gain = undefined,
        };
        dual.gain = vec3.length1(dual.column) + vec3.length1(dual.row) +
            side * vec3.length1(dual.depth);
        return dual;
    }

    /// Windows of triangles, and lanes of those that hold a pixel; the whole tile if some corner is
    /// not in front of the origin, or no triangle is small. A corner's place is off by less than
    /// 8 u G |c| / t, G the gain, the exact test's displacement of corners included.
    pub inline fn windowOf(
        dual: *const Dual,
        comptime Lanes: type,
        corners: [3]Lanes.Vec3,
        facet: *const edges_file.Facet(Lanes),
    ) struct { PixelWindow(Lanes.I32), Lanes.Mask } {
        const F32 = Lanes.F32;
        const end: Lanes.I32 = .splat(side - 1);
        var window: PixelWindow(Lanes.I32) =
            .{ .first_x = .zero(), .first_y = .zero(), .last_x = end, .last_y = end };
        const small = facet.length.mul(.splat(dual.gain)).lt(facet.reach.mul(.splat(side)));
        if (small.none()) return .{ window, .splat(true) };
        const inf: F32 = .splat(std.math.inf(f32));
        var low = [2]F32{ inf, inf };
        var high = [2]F32{ inf.neg(), inf.neg() };
        var least_t = inf;
        var greatest_inverse: F32 = .zero();
        inline for (corners) |corner| {
            const offset = corner.sub(.splat(dual.origin));
            const t = edges_file.dot(Lanes, offset, .splat(dual.depth));
            const inverse = F32.splat(1).div(t);
            inline for (&low, &high, .{ dual.column, dual.row }) |*least, *most, vector| {
                const place = edges_file.dot(Lanes, offset, .splat(vector)).mul(inverse);
                least.* = least.minFast(place);
                most.* = most.maxFast(place);
            }
            least_t = least_t.minFast(t);
            greatest_inverse = greatest_inverse.maxFast(inverse.abs());
        }
        const margin = facet.reach.mul(greatest_inverse)
            .mul(.splat(16 * edges_file.unit_roundoff * dual.gain));
        // Also where |t| is so small that rounding may have turned its sign.
        const bounded = least_t.gt(.zero()).bitAnd(margin.lt(.splat(side)));
        // What is not a number, as of corners at the origin, does not become a whole one.
        const first: F32 = .zero();
        const last: F32 = .splat(side - 1);
        window = .{
            .first_x = firstOf(Lanes, .select(bounded, low[0].sub(margin), first)),
            .first_y = firstOf(Lanes, .select(bounded, low[1].sub(margin), first)),
            .last_x = lastOf(Lanes, .select(bounded, high[0].add(margin), last)),
            .last_y = lastOf(Lanes, .select(bounded, high[1].add(margin), last)),
        };
        const empty = window.first_x.gt(window.last_x).bitOr(window.first_y.gt(window.last_y));
        return .{ window, empty.bitNot() };
    }

    /// The first whole number of the tile from here on.
    inline fn firstOf(comptime Lanes: type, low: Lanes.F32) Lanes.I32 {
        // Just below 1, so that a whole number stays what it is.
        const up: Lanes.F32 = .splat(1 - 0x1p-10);
        return low.add(up).maxFast(.zero()).minFast(.splat(side)).toI32();
    }

    /// The last whole number of the tile up to here.
    inline fn lastOf(comptime Lanes: type, high: Lanes.F32) Lanes.I32 {
        const past = high.add(.splat(1)).maxFast(.zero()).minFast(.splat(side));
        return past.toI32().sub(.splat(1));
    }
};

test "corners at the origin may be seen anywhere; a small triangle has its pixels" {
    const dual: Dual = .{
        .origin = .{ 0, 0, 0 },
        .column = .{ 1, 0, 0 },
        .row = .{ 0, 1, 0 },
        .depth = .{ 0, 0, 1 },
        .gain = 18,
    };
    inline for (.{ .scalar, .vector, .intrinsics }) |backend| {
        const Lanes = simd.Lanes(backend, 4);
        var corners: [3]Lanes.Vec3 = @splat(.splat(.{ 0, 0, 0 }));
        const there: Lanes.Mask = .fromBits(2);
        for (&corners, [3][3]f32{ .{ 5.2, 2.9, 1 }, .{ 6.4, 2.9, 1 }, .{ 5.2, 4.1, 1 } }) |*to, at|
            to.* = .select(there, .splat(at), to.*);
        var facet: edges_file.Facet(Lanes) = undefined;
        facet.length = .splat(2);
        facet.reach = .splat(8);
        const window, const seen = dual.windowOf(Lanes, corners, &facet);
        try std.testing.expect(seen.all());
        try std.testing.expectEqual([4]i32{ 0, 6, 0, 0 }, window.first_x.toArray());
        try std.testing.expectEqual([4]i32{ 15, 6, 15, 15 }, window.last_x.toArray());
        try std.testing.expectEqual([4]i32{ 0, 3, 0, 0 }, window.first_y.toArray());
        try std.testing.expectEqual([4]i32{ 15, 4, 15, 15 }, window.last_y.toArray());
    }
}
