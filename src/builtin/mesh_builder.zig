//! A mesh builder of procedural scenes: vertices, faces, curved patches and the simple solids.
//!
//! Everything is described in the space of `place` and put into the world by it. Faces wind
//! counter-clockwise seen from their visible side. A vertex of a flat face carries a zero normal,
//! which stands for the triangle's own; a mesh of such vertices alone has no normals. Triangles
//! without area are left out.

const std = @import("std");
const math = @import("../math.zig");
const elementary = math.elementary;
const geometry = @import("geometry.zig");
const scene_data = @import("../scene.zig");
const Grid = scene_data.Grid;
const Mesh = scene_data.Mesh;
const Place = geometry.Place;
const Point = geometry.Point;
const Vec3 = math.Vec3;
const Allocator = std.mem.Allocator;
const assert = std.debug.assert;

const MeshBuilder = @This();

arena: Allocator,
/// Where the next vertices go.
place: Place = .identity,
/// Linear RGB of the next vertices, multiplied with the material's.
tint: Vec3 = .{ 1, 1, 1 },
positions: std.ArrayList(Vec3) = .empty,
normals: std.ArrayList(Vec3) = .empty,
colors: std.ArrayList([4]f32) = .empty,
triangles: std.ArrayList([3]u32) = .empty,
smooth: bool = false,
tinted: bool = false,
/// Made when it is first needed.
scratch: ?*Scratch = null,

/// Most quadrilaterals in one patch.
pub const patch_quad_max = 2048;

/// What a patch needs while it is added: too much for a small stack.
const Scratch = struct {
    points: [patch_quad_max]Point,
    face_normals: [patch_quad_max]Point,
    corner_vertices: [patch_quad_max][4]u32,
};

/// Points in rows. Seen from the visible side, columns run to the right and rows upwards.
pub const Patch = struct {
    points: []const Point,
    columns: usize,
    /// The last column is joined to the first.
    closed: bool = false,
    /// Faces meet smoothly where the cosine between them exceeds this; null: all faces are flat.
    crease_cos: ?f64 = 0.8,
};

/// Radius and height of a point on the outline of a solid of revolution.
pub const OutlinePoint = [2]f64;

/// An empty mesh whose memory comes from `arena`, which the finished mesh lives in.
pub fn init(arena: Allocator) MeshBuilder {
    return .{ .arena = arena };
}

/// Adds a vertex and returns its index; `normal` null: its faces are flat.
pub fn vertex(builder: *MeshBuilder, position: Point, normal: ?Point) Allocator.Error!u32 {
    const index: u32 = @intCast(builder.positions.items.len);
    const world = geometry.toVec3(builder.place.point(position));
    const world_normal: Point = if (normal) |n| builder.place.direction(n) else .{ 0, 0, 0 };
    try builder.positions.append(builder.arena, world);
    try builder.normals.append(builder.arena, geometry.toVec3(world_normal));
    const tint = builder.tint;
    try builder.colors.append(builder.arena, .{ tint[0], tint[1], tint[2], 1 });
    if (normal != null) builder.smooth = true;
    if (!std.meta.eql(tint, .{ 1, 1, 1 })) builder.tinted = true;
    return index;
}

/// Adds a triangle of vertices that exist, unless it has no area.
pub fn triangle(builder: *MeshBuilder, a: u32, b: u32, c: u32) Allocator.Error!void {
    const positions = builder.positions.items;
    assert(a < positions.len and b < positions.len and c < positions.len);
    const ab = math.vec3.sub(positions[b], positions[a]);
    const ac = math.vec3.sub(positions[c], positions[a]);
    if (!(math.vec3.length(math.vec3.cross(ab, ac)) > 1e-9)) return;
    try builder.triangles.append(builder.arena, .{ a, b, c });
}

/// Adds the flat quadrilateral a b c d as two triangles, split from a to c.
pub fn quad(builder: *MeshBuilder, a: Point, b: Point, c: Point, d: Point) Allocator.Error!void {
    const first = try builder.vertex(a, null);
    _ = try builder.vertex(b, null);
    _ = try builder.vertex(c, null);
    _ = try builder.vertex(d, null);
    try builder.triangle(first, first + 1, first + 2);
    try builder.triangle(first, first + 2, first + 3);
}

/// Adds a box without its bottom. Asserts that it has a volume.
pub fn box(builder: *MeshBuilder, lower: Point, upper: Point) Allocator.Error!void {
    assert(@reduce(.And, lower < upper));
    const x0, const y0, const z0 = .{ lower[0], lower[1], lower[2] };
    const x1, const y1, const z1 = .{ upper[0], upper[1], upper[2] };
    try builder.quad(.{ x0, y0, z1 }, .{ x1, y0, z1 }, .{ x1, y1, z1 }, .{ x0, y1, z1 });
    try builder.quad(.{ x1, y0, z1 }, .{ x1, y0, z0 }, .{ x1, y1, z0 }, .{ x1, y1, z1 });
    try builder.quad(.{ x1, y0, z0 }, .{ x0, y0, z0 }, .{ x0, y1, z0 }, .{ x1, y1, z0 });
    try builder.quad(.{ x0, y0, z0 }, .{ x0, y0, z1 }, .{ x0, y1, z1 }, .{ x0, y1, z0 });
    try builder.quad(.{ x0, y1, z1 }, .{ x1, y1, z1 }, .{ x1, y1, z0 }, .{ x0, y1, z0 });
}

/// Adds a closed smooth sphere with poles on y, as 2 columns (rows - 1) triangles.
pub fn sphere(
    builder: *MeshBuilder,
    center: Point,
    radius: f64,
    columns: u32,
    rows: u32,
) Allocator.Error!void {
    assert(columns >= 3 and rows >= 2 and radius > 0);
    const bottom = try builder.vertex(center - Point{ 0, radius, 0 }, .{ 0, -1, 0 });
    for (1..rows) |row| {
        const polar_rad = std.math.pi * ratio(rows - row, rows);
        const ring = elementary.sin(polar_rad);
        for (0..columns) |column| {
            const azimuth_rad = 2 * std.math.pi * ratio(column, columns);
            const normal: Point = .{
                ring * elementary.sin(azimuth_rad),
                elementary.cos(polar_rad),
                ring * elementary.cos(azimuth_rad),
            };
            _ = try builder.vertex(center + geometry.scale(normal, radius), normal);
        }
    }
    const top = try builder.vertex(center + Point{ 0, radius, 0 }, .{ 0, 1, 0 });
    for (0..columns) |column_index| {
        const column: u32 = @intCast(column_index);
        const next = (column + 1) % columns;
        const first = bottom + 1;
        try builder.triangle(bottom, first + next, first + column);
        for (0..rows - 2) |row_index| {
            const lower = first + @as(u32, @intCast(row_index)) * columns;
            const upper = lower + columns;
            const corners = [4]u32{ lower + column, lower + next, upper + next, upper + column };
            for (Grid.cut(corners)) |t| try builder.triangle(t[0], t[1], t[2]);
        }
        const last = first + (rows - 2) * columns;
        try builder.triangle(last + column, last + next, top);
    }
}

/// Adds the surface that an outline, going up outside, leaves when it turns about y. It is smooth
/// around, however few the columns.
pub fn revolve(
    builder: *MeshBuilder,
    outline: []const OutlinePoint,
    columns: usize,
) Allocator.Error!void {
    const step_cos = elementary.cos(2 * std.math.pi / @as(f64, @floatFromInt(columns)));
    const crease_cos = if (step_cos < 0.9) step_cos - 0.05 else 0.8;
    try builder.turn(outline, columns, 0, crease_cos);
}

/// Adds a regular prism with flat sides and the given outline; the distance is that of the edges.
pub fn polygonPrism(
    builder: *MeshBuilder,
    outline: []const OutlinePoint,
    side_count: usize,
) Allocator.Error!void {
    const half_turns = 0.5 / @as(f64, @floatFromInt(side_count));
    try builder.turn(outline, side_count, half_turns, 0.95);
}

/// The first column stands `phase_turns` from +z towards +x.
fn turn(
    builder: *MeshBuilder,
    outline: []const OutlinePoint,
    columns: usize,
    phase_turns: f64,
    crease_cos: f64,
) Allocator.Error!void {
    assert(columns >= 3);
    const points = try builder.patchPoints(outline.len, columns);
    for (outline, 0..) |outline_point, row| {
        for (0..columns) |column| {
            const azimuth_rad = 2 * std.math.pi * (ratio(column, columns) + phase_turns);
            points[row * columns + column] = .{
                outline_point[0] * elementary.sin(azimuth_rad),
                outline_point[1],
                outline_point[0] * elementary.cos(azimuth_rad),
            };
        }
    }
    try builder.patch(.{
        .points = points,
        .columns = columns,
        .closed = true,
        .crease_cos = crease_cos,
    });
}

/// Adds a square prism with the given outline of half widths, sides across x and z.
pub fn prism(builder: *MeshBuilder, outline: []const OutlinePoint) Allocator.Error!void {
    const points = try builder.patchPoints(outline.len, 4);
    for (outline, 0..) |outline_point, row| {
        const half, const height = outline_point;
        points[4 * row ..][0..4].* = .{
            .{ -half, height, half },
            .{ half, height, half },
            .{ half, height, -half },
            .{ -half, height, -half },
        };
    }
    try builder.patch(.{ .points = points, .columns = 4, .closed = true, .crease_cos = 0.9 });
}

/// Memory for the points of one patch, until the next is made.
pub fn patchPoints(builder: *MeshBuilder, rows: usize, columns: usize) Allocator.Error![]Point {
    return (try builder.scratchSpace()).points[0 .. rows * columns];
}

fn scratchSpace(builder: *MeshBuilder) Allocator.Error!*Scratch {
    if (builder.scratch == null) builder.scratch = try builder.arena.create(Scratch);
    return builder.scratch.?;
}

/// Adds a patch. Where faces meet at more than the crease, vertices are doubled.
pub fn patch(builder: *MeshBuilder, surface: Patch) Allocator.Error!void {
    const grid = gridOf(surface);
    if (surface.crease_cos == null) {
        const first: u32 = @intCast(builder.positions.items.len);
        for (surface.points) |point| _ = try builder.vertex(point, null);
        return builder.gridFaces(grid, first);
    }
    const scratch = try builder.scratchSpace();
    for (0..grid.rows) |row| {
        for (0..grid.columns) |column| {
            const a, const b, const c, const d = grid.corners(row, column);
            scratch.face_normals[row * grid.columns + column] = geometry.cross(
                surface.points[c] - surface.points[a],
                surface.points[d] - surface.points[b],
            );
        }
    }
    for (surface.points, 0..) |_, point_index| {
        try builder.patchPoint(surface, grid, point_index);
    }
    for (scratch.corner_vertices[0 .. grid.rows * grid.columns]) |corners| {
        for (Grid.cut(corners)) |t| try builder.triangle(t[0], t[1], t[2]);
    }
}

/// Adds the faces of a grid whose points are vertices from `first` on.
pub fn gridFaces(builder: *MeshBuilder, grid: Grid, first: u32) Allocator.Error!void {
    for (0..grid.rows) |row| {
        for (0..grid.columns) |column| for (Grid.cut(grid.corners(row, column))) |t| {
            try builder.triangle(first + t[0], first + t[1], first + t[2]);
        };
    }
}

/// How the quadrilaterals of a patch lie on its points.
fn gridOf(surface: Patch) Grid {
    assert(surface.columns >= 2 and surface.points.len % surface.columns == 0);
    const rows = surface.points.len / surface.columns;
    assert(rows >= 2);
    const columns = if (surface.closed) surface.columns else surface.columns - 1;
    assert((rows - 1) * columns <= patch_quad_max);
    return .{
        .columns = @intCast(columns),
        .rows = @intCast(rows - 1),
        .closed = surface.closed,
    };
}

/// The quadrilateral that has the point (row, column) as its corner number `corner`.
fn quadAt(grid: Grid, row: usize, column: usize, corner: usize) ?usize {
    const below = corner >= 2;
    const left = corner == 1 or corner == 2;
    if (below and row == 0) return null;
    if (!below and row == grid.rows) return null;
    if (left and column == 0 and !grid.closed) return null;
    if (!left and column == grid.columns) return null;
    const quad_row = if (below) row - 1 else row;
    const to_left = if (column == 0) grid.columns - 1 else column - 1;
    return quad_row * grid.columns + (if (left) to_left else column);
}

/// Adds the vertices of one point, one for each group of faces that meet smoothly there, and
/// notes them in the corners of those faces.
fn patchPoint(
    builder: *MeshBuilder,
    surface: Patch,
    grid: Grid,
    point_index: usize,
) Allocator.Error!void {
    const scratch = try builder.scratchSpace();
    const row = point_index / grid.stride();
    const column = point_index % grid.stride();
    var groups: [4]struct { normal: Point, vertex: u32 } = undefined;
    var group_count: usize = 0;
    for (0..4) |corner| {
        const own = quadAt(grid, row, column, corner) orelse continue;
        var sum: Point = .{ 0, 0, 0 };
        for (0..4) |other_corner| {
            const other = quadAt(grid, row, column, other_corner) orelse continue;
            const a = scratch.face_normals[own];
            const b = scratch.face_normals[other];
            const lengths = geometry.length(a) * geometry.length(b);
            if (geometry.dot(a, b) > surface.crease_cos.? * lengths) sum += b;
        }
        // A face without area has no normal and gives no triangle; any vertex will do.
        const normal = if (geometry.length(sum) > 1e-12) geometry.normalize(sum) else sum;
        const group = for (groups[0..group_count]) |group| {
            if (@reduce(.And, group.normal == normal)) break group.vertex;
        } else blk: {
            const added = try builder.vertex(surface.points[point_index], normal);
            groups[group_count] = .{ .normal = normal, .vertex = added };
            group_count += 1;
            break :blk added;
        };
        scratch.corner_vertices[own][corner] = group;
    }
}

/// The mesh as the scene keeps it. Asserts that it has triangles.
pub fn finish(builder: *MeshBuilder, material: u32) Allocator.Error!Mesh {
    assert(builder.triangles.items.len > 0);
    return .{
        .positions = try builder.positions.toOwnedSlice(builder.arena),
        .normals = if (builder.smooth) try builder.normals.toOwnedSlice(builder.arena) else null,
        .colors = if (builder.tinted) try builder.colors.toOwnedSlice(builder.arena) else null,
        .triangles = try builder.triangles.toOwnedSlice(builder.arena),
        .material = material,
    };
}

fn ratio(part: usize, whole: usize) f64 {
    return @as(f64, @floatFromInt(part)) / @as(f64, @floatFromInt(whole));
}

/// Six times the volume that the triangles enclose; positive where they face outwards.
fn volumeSixfold(mesh: Mesh) f32 {
    var sum: f32 = 0;
    for (mesh.triangles) |t| {
        const p = mesh.positions;
        sum += math.vec3.dot(p[t[0]], math.vec3.cross(p[t[1]], p[t[2]]));
    }
    return sum;
}

test "a quadrilateral is flat and has no normals" {
    var arena: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena.deinit();
    var builder: MeshBuilder = .init(arena.allocator());
    try builder.quad(.{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 1, 1, 0 }, .{ 0, 1, 0 });
    try builder.quad(.{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 0, 0 });
    const mesh = try builder.finish(7);
    try std.testing.expectEqual(null, mesh.normals);
    try std.testing.expectEqual(null, mesh.colors);
    try std.testing.expectEqual(2, mesh.triangles.len);
    try std.testing.expectEqual(7, mesh.material);
}

test "solids face outwards" {
    var arena: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena.deinit();
    var ball: MeshBuilder = .init(arena.allocator());
    try ball.sphere(.{ 5, 5, 5 }, 1, 16, 16);
    const ball_mesh = try ball.finish(0);
    try std.testing.expectEqual(2 * 16 * 15, ball_mesh.triangles.len);
    try std.testing.expectApproxEqRel(@as(f32, 8 * std.math.pi), volumeSixfold(ball_mesh), 0.05);
    for (ball_mesh.positions, ball_mesh.normals.?) |position, normal| {
        const offset = math.vec3.sub(position, .{ 5, 5, 5 });
        try std.testing.expectApproxEqAbs(@as(f32, 1), math.vec3.dot(offset, normal), 1e-5);
    }
    const outline = [_]OutlinePoint{ .{ 0, 0 }, .{ 1, 0 }, .{ 1, 2 }, .{ 0, 2 } };
    var square: MeshBuilder = .init(arena.allocator());
    square.place = .translate(.{ 3, 0, 0 });
    try square.prism(&outline);
    const square_mesh = try square.finish(0);
    try std.testing.expectApproxEqRel(@as(f32, 6 * 8), volumeSixfold(square_mesh), 1e-5);
    var cylinder: MeshBuilder = .init(arena.allocator());
    cylinder.place = geometry.Place.translate(.{ 9, 1, 2 }).turned(1);
    try cylinder.revolve(&outline, 64);
    const cylinder_mesh = try cylinder.finish(0);
    const volume: f32 = 6 * 2 * std.math.pi;
    try std.testing.expectApproxEqRel(volume, volumeSixfold(cylinder_mesh), 0.01);
}

test "a patch is smooth along a bend and doubles vertices at a crease" {
    var arena: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena.deinit();
    var bend: MeshBuilder = .init(arena.allocator());
    try bend.patch(.{ .columns = 3, .points = &.{
        .{ 0, 0, 0 }, .{ 1, 0, 0.1 }, .{ 2, 0, 0 },
        .{ 0, 1, 0 }, .{ 1, 1, 0.1 }, .{ 2, 1, 0 },
    } });
    try std.testing.expectEqual(6, bend.positions.items.len);
    try std.testing.expectEqual(Vec3{ 0, 0, 1 }, bend.normals.items[1]);
    var crease: MeshBuilder = .init(arena.allocator());
    try crease.patch(.{ .columns = 3, .points = &.{
        .{ 0, 0, 0 }, .{ 1, 0, 1 }, .{ 2, 0, 0 },
        .{ 0, 1, 0 }, .{ 1, 1, 1 }, .{ 2, 1, 0 },
    } });
    try std.testing.expectEqual(8, crease.positions.items.len);
    try std.testing.expectEqual(4, crease.triangles.items.len);
}
