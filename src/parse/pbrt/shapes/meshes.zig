//! Meshes that stand in the text: trianglemesh, bilinearmesh and heightfield.
//!
//! In: lists of points and indices. Out: the same, each index within its range.

const std = @import("std");
const limits = @import("../limits.zig");
const Tessellator = @import("tessellator.zig");
const Error = @import("../input.zig").Error;
const Geometry = Tessellator.Geometry;
const Grid = @import("../../../scene.zig").Grid;
const Vec3 = @import("../../../math.zig").Vec3;

/// Triples of floats as points.
pub fn points(floats: []const f32) []const Vec3 {
    const first: [*]const Vec3 = @ptrCast(floats.ptr);
    return first[0 .. floats.len / 3];
}

/// `P`, `indices` and perhaps `N` and `uv` or `st`. One triangle needs no indices.
pub fn triangles(tessellator: *Tessellator) Error!Geometry {
    return faces(tessellator, 3, "triangles");
}

/// Patches of four points each, cut into two triangles. One needs no indices.
pub fn bilinear(tessellator: *Tessellator) Error!Geometry {
    return faces(tessellator, 4, "patches");
}

fn faces(
    tessellator: *Tessellator,
    comptime corner_count: u32,
    comptime what: []const u8,
) Error!Geometry {
    const parameters = tessellator.parameters;
    const list = parameters.find("P") orelse return tessellator.fail("has no points P", .{});
    const from = points(parameters.floatsOf(list));
    const one = [_]i32{ 0, 1, 2, 3 };
    const indices: []const i32 = if (parameters.find("indices")) |parameter|
        parameters.integersOf(parameter)
    else if (from.len == corner_count)
        one[0..corner_count]
    else
        return tessellator.fail("has no indices", .{});
    if (indices.len % corner_count != 0)
        try tessellator.forgive("{d} indices make no whole " ++ what, .{indices.len});
    const face_count = indices.len / corner_count;
    var result: Geometry = .{
        .positions = try tessellator.alloc(Vec3, from.len),
        .normals = try normals(tessellator, from.len),
        .texcoords = try texcoords(tessellator, from.len),
        .triangles = try tessellator.alloc([3]u32, face_count * (corner_count - 2)),
    };
    @memcpy(result.positions, from);
    for (0..face_count) |face| {
        var corners: [corner_count]u32 = undefined;
        for (&corners, indices[corner_count * face ..][0..corner_count]) |*corner, vertex| {
            corner.* = try checked(tessellator, vertex, from.len);
        }
        // Corners of patches stand in the order (0, 0), (1, 0), (0, 1), (1, 1).
        const cut = if (corner_count == 3)
            [1][3]u32{corners}
        else
            Grid.cut(.{ corners[0], corners[1], corners[3], corners[2] });
        result.triangles[cut.len * face ..][0..cut.len].* = cut;
    }
    if (tessellator.wants_texcoords and result.texcoords == null)
        try tessellator.unshare(&result, if (corner_count == 3)
            Tessellator.triangle_corners
        else
            patch_corners);
    Tessellator.orient(&result);
    return result;
}

/// Coordinates of the two triangles of a patch without any.
const patch_corners: []const [3][2]f32 = &.{
    .{ .{ 0, 0 }, .{ 1, 0 }, .{ 1, 1 } },
    .{ .{ 0, 0 }, .{ 1, 1 }, .{ 0, 1 } },
};

/// `N`, one for each of `vertex_count`, or none.
fn normals(tessellator: *Tessellator, vertex_count: usize) Error!?[]Vec3 {
    const from = points(tessellator.parameters.floatsNamed("N") orelse return null);
    if (from.len != vertex_count) {
        try tessellator.forgive("has {d} normals N for {d} points", .{ from.len, vertex_count });
        return null;
    }
    const result = try tessellator.alloc(Vec3, vertex_count);
    @memcpy(result, from);
    return result;
}

/// `uv` or `st`, a pair for each of `vertex_count`, where they are needed and there.
fn texcoords(tessellator: *Tessellator, vertex_count: usize) Error!?[][2]f32 {
    if (!tessellator.wants_texcoords) return null;
    const parameters = tessellator.parameters;
    const from = parameters.floatsNamed("uv") orelse parameters.floatsNamed("st") orelse
        return null;
    if (from.len != 2 * @as(u64, vertex_count)) {
        const message = "has {d} numbers of coordinates uv for {d} points";
        try tessellator.forgive(message, .{ from.len, vertex_count });
        return null;
    }
    const result = try tessellator.alloc([2]f32, vertex_count);
    for (result, 0..) |*to, index| {
        to.* = Tessellator.texcoordOf(from[2 * index], from[2 * index + 1]);
    }
    return result;
}

inline fn checked(tessellator: *Tessellator, vertex: i32, vertex_count: usize) Error!u32 {
    // Negative ones are beyond the range as well.
    if (@as(u32, @bitCast(vertex)) < vertex_count) return @intCast(vertex);
    return tessellator.fail("index {d} of {d} vertices", .{ vertex, vertex_count });
}

/// `nu` by `nv` heights `Pz` over the unit square.
pub fn heightfield(tessellator: *Tessellator) Error!Geometry {
    const parameters = tessellator.parameters;
    const columns = parameters.integer("nu") orelse return tessellator.fail("has no nu", .{});
    const rows = parameters.integer("nv") orelse return tessellator.fail("has no nv", .{});
    const heights = parameters.floatsNamed("Pz") orelse
        return tessellator.fail("has no heights Pz", .{});
    const side_max = limits.heightfield_side_max;
    if (columns < 2 or rows < 2 or columns > side_max or rows > side_max) return tessellator.fail(
        "a height field has 2 to {d} points on each side, not {d} by {d}",
        .{ side_max, columns, rows },
    );
    const wide: u32 = @intCast(columns);
    const high: u32 = @intCast(rows);
    if (heights.len != @as(u64, wide) * high) return tessellator.fail(
        "has {d} heights for {d} by {d} points",
        .{ heights.len, columns, rows },
    );
    const result: Geometry = .{
        .positions = try tessellator.alloc(Vec3, heights.len),
        .texcoords = if (tessellator.wants_texcoords)
            try tessellator.alloc([2]f32, heights.len)
        else
            null,
        .triangles = try tessellator.alloc([3]u32, 2 * @as(u64, wide - 1) * (high - 1)),
    };
    for (result.positions, heights, 0..) |*position, height, index| position.* = .{
        share(index % wide, wide - 1),
        share(index / wide, high - 1),
        height,
    };
    if (result.texcoords) |all| for (all, result.positions) |*to, position| {
        to.* = Tessellator.texcoordOf(position[0], position[1]);
    };
    const grid: Grid = .{ .columns = wide - 1, .rows = high - 1 };
    for (0..grid.rows) |row| for (0..grid.columns) |column| {
        const index = row * grid.columns + column;
        result.triangles[2 * index ..][0..2].* = Grid.cut(grid.corners(row, column));
    };
    return result;
}

fn share(index: usize, count: usize) f32 {
    return @as(f32, @floatFromInt(index)) / @as(f32, @floatFromInt(count));
}
