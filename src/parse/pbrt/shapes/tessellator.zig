//! The tessellator of all shapes: grids of a surface, normals, memory within bounds.
//!
//! Geometry lives as long as the scene; what only the making of it needs is given back. Curved
//! shapes and subdivision make many triangles of few bytes, so that everything is counted before
//! it is allocated.

const std = @import("std");
const limits = @import("../limits.zig");
const math = @import("../../../math.zig");
const orientation = @import("../../orientation.zig");
const Input = @import("../input.zig");
const Parameters = @import("../parameters.zig");
const Error = Input.Error;
const Grid = @import("../../../scene.zig").Grid;
const Vec3 = math.Vec3;
const vec3d = math.vec3d;
const Vector = math.Vec3d;
const assert = std.debug.assert;

const Tessellator = @This();

/// Triangles in the space of the shape.
pub const Geometry = struct {
    positions: []Vec3,
    /// Null: flat faces.
    normals: ?[]Vec3 = null,
    /// The shape's u, and 1 less its v, so that it grows downwards as in pictures; null: nobody
    /// needs them.
    texcoords: ?[][2]f32 = null,
    /// Counter-clockwise seen from the side that PBRT's normal points to.
    triangles: [][3]u32,
};

input: *Input,
/// Where geometry lives.
arena: std.mem.Allocator,
/// Of the directive that is being read.
parameters: *const Parameters = undefined,
/// Whether the shape has textures, so that vertices need their coordinates.
wants_texcoords: bool = false,
/// What kind of shape it is, for messages.
name: []const u8 = "",
/// Bytes of all geometry so far.
bytes_used: u64 = 0,
/// Triangles of all curved shapes so far.
triangle_count: u64 = 0,

/// Fails where the shape stands.
pub fn fail(
    tessellator: *Tessellator,
    comptime format: []const u8,
    arguments: anytype,
) error{InvalidInput} {
    const name = .{tessellator.name};
    return tessellator.input.failHere("{s}: " ++ format, name ++ arguments);
}

/// Says what is wrong with the shape that it can do without, once a kind.
pub fn forgive(
    tessellator: *Tessellator,
    comptime format: []const u8,
    arguments: anytype,
) Error!void {
    const input = tessellator.input;
    const name = .{tessellator.name};
    try input.forgive(input.directive, format, "{s}: " ++ format, name ++ arguments);
}

/// Memory that lives as long as the scene.
pub fn alloc(tessellator: *Tessellator, comptime Element: type, count: u64) Error![]Element {
    try tessellator.reserve(count, @sizeOf(Element));
    return tessellator.arena.alloc(Element, @intCast(count));
}

/// Counts memory before it is asked for.
pub fn reserve(tessellator: *Tessellator, element_count: u64, element_bytes: u64) Error!void {
    const limit = limits.decodedBytesMax(tessellator.input.resources.bytes_read);
    const bytes = std.math.mul(u64, element_count, element_bytes) catch limit;
    tessellator.bytes_used = std.math.add(u64, tessellator.bytes_used, bytes) catch limit + 1;
    // Each array within half of the address space, too.
    if (tessellator.bytes_used <= limit and bytes <= std.math.maxInt(usize) / 2) return;
    return tessellator.fail("the scene's shapes need much more memory than its files explain", .{});
}

/// Counts triangles before they are made: `count` of a shape.
pub fn reserveTriangles(tessellator: *Tessellator, count: u64) Error!void {
    const limit = tessellator.input.resources.triangleCountMax();
    tessellator.triangle_count +|= count;
    if (tessellator.triangle_count <= limit) return;
    return tessellator.fail(
        "it becomes {d} triangles, over {d} with those before it (see --max-triangles)",
        .{ count, limit },
    );
}

/// A number that has to be above 0.
pub fn positive(tessellator: *Tessellator, name: []const u8, default: f32) Error!f64 {
    const value = tessellator.parameters.float(name, default);
    if (value > 0) return value;
    return tessellator.fail("{s} is {d}, not above 0", .{ name, value });
}

/// The sweep "phimax" in radians, at most a full turn.
pub fn sweep(tessellator: *Tessellator) Error!f64 {
    const degrees = try tessellator.positive("phimax", 360);
    return @min(degrees, 360) * (std.math.pi / 180.0);
}

/// Steps that an arc of `angle` radians is cut into, `least` at the least.
pub fn steps(tessellator: *const Tessellator, angle: f64, least: u32) u32 {
    assert(angle >= 0 and angle <= 2 * std.math.pi + 1e-9);
    const full: f64 = @floatFromInt(tessellator.input.resources.settings.tessellation);
    // A little less, lest rounding adds a step to a whole number of them.
    return @max(least, @as(u32, @intFromFloat(@ceil(full * angle / (2 * std.math.pi) - 1e-6))));
}

/// A surface over rows and columns: point and normal of each crossing.
pub const Sample = struct {
    point: Vector,
    normal: Vector,
    /// Coordinates of textures; null: the share of the columns, or of the rows.
    u: ?f64 = null,
    v: ?f64 = null,
};

/// A grid, and whether all points of its first or last row are one.
pub const Surface = struct {
    grid: Grid,
    first_row_is_point: bool = false,
    last_row_is_point: bool = false,
};

/// Triangles of a surface; `sampleAt` gives the point of a column and a row.
pub fn tessellate(
    tessellator: *Tessellator,
    surface: Surface,
    context: anytype,
    comptime sampleAt: fn (@TypeOf(context), u32, u32) Sample,
) Error!Geometry {
    var grid = surface.grid;
    // The points of a seam have two coordinates.
    if (tessellator.wants_texcoords) grid.closed = false;
    assert(grid.columns >= 1 and grid.rows >= 1);
    const vertex_count = @as(u64, grid.stride()) * (grid.rows + 1);
    const points: u32 = @as(u32, @intFromBool(surface.first_row_is_point)) +
        @intFromBool(surface.last_row_is_point);
    const triangle_count = @as(u64, grid.columns) * (2 * @as(u64, grid.rows) - points);
    if (vertex_count > std.math.maxInt(u32)) return tessellator.fail("has too many vertices", .{});
    try tessellator.reserveTriangles(triangle_count);
    const result: Geometry = .{
        .positions = try tessellator.alloc(Vec3, vertex_count),
        .normals = try tessellator.alloc(Vec3, vertex_count),
        .texcoords = if (tessellator.wants_texcoords)
            try tessellator.alloc([2]f32, vertex_count)
        else
            null,
        .triangles = try tessellator.alloc([3]u32, triangle_count),
    };
    for (0..grid.rows + 1) |row| for (0..grid.stride()) |column| {
        const sample = sampleAt(context, @intCast(column % surface.grid.stride()), @intCast(row));
        const index = row * grid.stride() + column;
        if (result.texcoords) |texcoords| texcoords[index] = texcoordOf(
            sample.u orelse share(column, grid.columns),
            sample.v orelse share(row, grid.rows),
        );
        result.positions[index] = vec3d.toSingle(sample.point);
        result.normals.?[index] = vec3d.toSingle(sample.normal);
    };
    var made: usize = 0;
    for (0..grid.rows) |row| for (0..grid.columns) |column| {
        const lower, const upper = Grid.cut(grid.corners(row, column));
        if (row > 0 or !surface.first_row_is_point) {
            result.triangles[made] = lower;
            made += 1;
        }
        if (row + 1 < grid.rows or !surface.last_row_is_point) {
            result.triangles[made] = upper;
            made += 1;
        }
    };
    assert(made == result.triangles.len);
    return result;
}

fn share(index: usize, count: usize) f64 {
    return @as(f64, @floatFromInt(index)) / @as(f64, @floatFromInt(count));
}

/// Coordinates as scenes have them, of a shape's own; 0 where they are no numbers that fit.
pub fn texcoordOf(u: f64, v: f64) [2]f32 {
    var result: [2]f32 = .{ @floatCast(u), @floatCast(1 - v) };
    for (&result) |*coordinate| coordinate.* = if (std.math.isFinite(coordinate.*))
        math.flushDenormal(coordinate.*)
    else
        0;
    return result;
}

/// Gives each triangle three vertices of its own, with u and v from `corners`, whose entries take
/// turns: what PBRT does with meshes that have no coordinates.
pub fn unshare(
    tessellator: *Tessellator,
    geometry: *Geometry,
    corners: []const [3][2]f32,
) Error!void {
    const vertex_count = 3 * @as(u64, geometry.triangles.len);
    if (vertex_count > std.math.maxInt(u32)) return tessellator.fail("has too many vertices", .{});
    const positions = try tessellator.alloc(Vec3, vertex_count);
    const normals = if (geometry.normals != null)
        try tessellator.alloc(Vec3, vertex_count)
    else
        null;
    const texcoords = try tessellator.alloc([2]f32, vertex_count);
    for (geometry.triangles, 0..) |*triangle, index| for (triangle, 0..) |*vertex, corner| {
        const to = 3 * index + corner;
        positions[to] = geometry.positions[vertex.*];
        if (normals) |all| all[to] = geometry.normals.?[vertex.*];
        const u, const v = corners[index % corners.len][corner];
        texcoords[to] = texcoordOf(u, v);
        vertex.* = @intCast(to);
    };
    geometry.positions = positions;
    geometry.normals = normals;
    geometry.texcoords = texcoords;
}

/// Coordinates of the corners of a triangle without any.
pub const triangle_corners: []const [3][2]f32 = &.{.{ .{ 0, 0 }, .{ 1, 0 }, .{ 1, 1 } }};

/// Turns the faces around that look against their vertices' normals.
pub fn orient(geometry: *const Geometry) void {
    const normals = geometry.normals orelse return;
    orientation.orient(geometry.positions, normals, geometry.triangles);
}

/// Normals of a smooth surface: the sum of the faces around each vertex, by area.
pub fn smooth(tessellator: *Tessellator, geometry: *Geometry) Error!void {
    const normals = try tessellator.alloc(Vec3, geometry.positions.len);
    @memset(normals, .{ 0, 0, 0 });
    for (geometry.triangles) |corners| {
        const face = orientation.faceNormal(geometry.positions, corners);
        for (corners) |corner| normals[corner] = math.vec3.add(normals[corner], face);
    }
    for (normals) |*normal| normal.* = math.vec3.normalize(normal.*) orelse .{ 0, 0, 0 };
    geometry.normals = normals;
}
