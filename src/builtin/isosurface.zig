//! Triangles on a smooth implicit surface: dual marching cubes, then Newton's method.
//!
//! G. Nielson, "Dual Marching Cubes" (2004): in every cell of a grid each sheet of the surface has
//! one vertex, and every grid edge that the surface crosses gives a quadrilateral of its sheet in
//! the four cells around it. Vertices begin at the mean of their sheet's crossings (S. Gibson,
//! "Constrained Elastic Surface Nets", 1998) and end on the surface itself. Neighbours share
//! vertices, so the mesh is closed.

const std = @import("std");
const geometry = @import("geometry.zig");
const Point = geometry.Point;
const Allocator = std.mem.Allocator;
const assert = std.debug.assert;

/// Where the surface is looked for.
pub const Grid = struct {
    lower: Point,
    /// Edge of a cell.
    cell: f64,
    /// Cells along each axis.
    counts: [3]usize,

    fn samplePoint(grid: Grid, index: [3]usize) Point {
        var point: Point = undefined;
        inline for (0..3) |axis| {
            point[axis] = grid.lower[axis] + grid.cell * @as(f64, @floatFromInt(index[axis]));
        }
        return point;
    }
};

/// A closed surface; lists have the same allocator.
pub const Surface = struct {
    positions: []Point,
    /// Unit vectors out of the solid.
    normals: []Point,
    triangles: [][3]u32,

    /// Frees the lists.
    pub fn deinit(surface: *Surface, gpa: Allocator) void {
        gpa.free(surface.positions);
        gpa.free(surface.normals);
        gpa.free(surface.triangles);
        surface.* = undefined;
    }
};

/// A value and its gradient.
pub const Slope = struct { value: f64, gradient: Point };

/// The surface where `field` is zero, positive inside. `field` has the methods
/// `values(lower, cell, counts, out)`, which samples a box of the grid (x runs fastest), and
/// `slope(point) Slope`. Asserts that the surface does not touch the border of the grid.
pub fn build(gpa: Allocator, grid: Grid, field: anytype) Allocator.Error!Surface {
    const samples = try sample(gpa, grid, field);
    defer gpa.free(samples);
    var nets: Nets = .{ .gpa = gpa, .grid = grid, .samples = samples };
    defer nets.deinit();
    try nets.addVertices();
    try nets.addFaces();

    const normals = try gpa.alloc(Point, nets.positions.items.len);
    errdefer gpa.free(normals);
    for (nets.positions.items, normals) |*position, *normal| {
        // Two steps reach the rounding error from a fraction of a cell away.
        for (0..2) |_| {
            const slope: Slope = field.slope(position.*);
            const step = slope.value / geometry.dot(slope.gradient, slope.gradient);
            position.* -= geometry.scale(slope.gradient, step);
        }
        normal.* = geometry.normalize(-field.slope(position.*).gradient);
    }
    const positions = try nets.positions.toOwnedSlice(gpa);
    errdefer gpa.free(positions);
    return .{
        .positions = positions,
        .normals = normals,
        .triangles = try nets.triangles.toOwnedSlice(gpa),
    };
}

/// Edge of the boxes that are sampled at once, in samples.
pub const box_samples = 8;

fn sample(gpa: Allocator, grid: Grid, field: anytype) Allocator.Error![]f64 {
    const counts: [3]usize = .{ grid.counts[0] + 1, grid.counts[1] + 1, grid.counts[2] + 1 };
    const samples = try gpa.alloc(f64, counts[0] * counts[1] * counts[2]);
    var values: [box_samples * box_samples * box_samples]f64 = undefined;
    var z: usize = 0;
    while (z < counts[2]) : (z += box_samples) {
        var y: usize = 0;
        while (y < counts[1]) : (y += box_samples) {
            var x: usize = 0;
            while (x < counts[0]) : (x += box_samples) {
                field.values(grid.samplePoint(.{ x, y, z }), grid.cell, &values);
                const nx = @min(box_samples, counts[0] - x);
                for (0..@min(box_samples, counts[2] - z)) |dz| {
                    for (0..@min(box_samples, counts[1] - y)) |dy| {
                        const from = (dz * box_samples + dy) * box_samples;
                        const to = ((z + dz) * counts[1] + y + dy) * counts[0] + x;
                        @memcpy(samples[to..][0..nx], values[from..][0..nx]);
                    }
                }
            }
        }
    }
    return samples;
}

/// Where a sample of a box lies, in cells from its lower corner.
pub fn boxOffset(index: usize) Point {
    return .{
        @floatFromInt(index % box_samples),
        @floatFromInt(index / box_samples % box_samples),
        @floatFromInt(index / box_samples / box_samples),
    };
}

/// The edge of a cell along `axis` that begins at `corner`. Bit a of a corner's number tells
/// whether it lies at the upper end of axis a.
fn cellEdge(axis: usize, corner: usize) usize {
    const u = (axis + 1) % 3;
    const v = (axis + 2) % 3;
    return 4 * axis + (corner >> @intCast(u) & 1) + 2 * (corner >> @intCast(v) & 1);
}

/// The corner where an edge begins.
fn edgeCorner(edge: usize) usize {
    const axis = edge / 4;
    const u = (axis + 1) % 3;
    const v = (axis + 2) % 3;
    return (edge & 1) << @intCast(u) | (edge >> 1 & 1) << @intCast(v);
}

const no_sheet = 255;

/// For each set of corners inside, bit c for corner c: the sheet that crosses each edge.
const Sheets = struct {
    count: u8,
    of_edge: [12]u8,

    const of_corners: [256]Sheets = blk: {
        @setEvalBranchQuota(1_000_000);
        var table: [256]Sheets = undefined;
        for (&table, 0..) |*entry, corners| entry.* = .init(corners);
        break :blk table;
    };

    /// Joins edges that are joined on a face. Where all four edges of a face are crossed, the two
    /// corners inside are kept apart, in both cells that share the face.
    fn init(corners: usize) Sheets {
        var sheets: Sheets = .{ .count = 0, .of_edge = @splat(no_sheet) };
        for (&sheets.of_edge, 0..) |*sheet, edge| {
            const begin = edgeCorner(edge);
            const end = begin | @as(usize, 1) << @intCast(edge / 4);
            if ((corners >> @intCast(begin) ^ corners >> @intCast(end)) & 1 == 0) continue;
            sheet.* = @intCast(edge);
        }
        for (0..6) |face| sheets.joinOnFace(corners, face / 2, face % 2);
        // Number the sheets from 0 by their first edges.
        var numbers: [12]u8 = @splat(no_sheet);
        for (&sheets.of_edge) |*sheet| {
            if (sheet.* == no_sheet) continue;
            if (numbers[sheet.*] == no_sheet) {
                numbers[sheet.*] = sheets.count;
                sheets.count += 1;
            }
            sheet.* = numbers[sheet.*];
        }
        return sheets;
    }

    fn joinOnFace(sheets: *Sheets, corners: usize, axis: usize, side: usize) void {
        const u = (axis + 1) % 3;
        const v = (axis + 2) % 3;
        const base = side << @intCast(axis);
        const u_bit = @as(usize, 1) << @intCast(u);
        const v_bit = @as(usize, 1) << @intCast(v);
        // Corners and edges in turn round the face: edge k runs between corners k and k + 1.
        const around = [4]usize{ base, base | u_bit, base | u_bit | v_bit, base | v_bit };
        const edges = [4]usize{
            cellEdge(u, around[0]), cellEdge(v, around[1]),
            cellEdge(u, around[3]), cellEdge(v, around[0]),
        };
        var crossed: [4]usize = undefined;
        var count: usize = 0;
        for (edges) |edge| {
            if (sheets.of_edge[edge] == no_sheet) continue;
            crossed[count] = edge;
            count += 1;
        }
        if (count == 2) sheets.join(crossed[0], crossed[1]);
        if (count == 4) {
            const first_inside = corners >> @intCast(around[0]) & 1 == 1;
            sheets.join(edges[0], edges[if (first_inside) 3 else 1]);
            sheets.join(edges[2], edges[if (first_inside) 1 else 3]);
        }
    }

    fn join(sheets: *Sheets, a: usize, b: usize) void {
        const old = sheets.of_edge[b];
        const new = sheets.of_edge[a];
        for (&sheets.of_edge) |*sheet| {
            if (sheet.* == old) sheet.* = new;
        }
    }
};

/// The net under construction.
const Nets = struct {
    gpa: Allocator,
    grid: Grid,
    samples: []const f64,
    /// First vertex of each cell that the surface passes through; those of its sheets follow.
    cell_vertices: []u32 = &.{},
    positions: std.ArrayList(Point) = .empty,
    triangles: std.ArrayList([3]u32) = .empty,

    fn deinit(nets: *Nets) void {
        nets.gpa.free(nets.cell_vertices);
        nets.positions.deinit(nets.gpa);
        nets.triangles.deinit(nets.gpa);
        nets.* = undefined;
    }

    fn sampleIndex(nets: *const Nets, index: [3]usize) usize {
        const counts = nets.grid.counts;
        return (index[2] * (counts[1] + 1) + index[1]) * (counts[0] + 1) + index[0];
    }

    fn cellIndex(nets: *const Nets, index: [3]usize) usize {
        const counts = nets.grid.counts;
        return (index[2] * counts[1] + index[1]) * counts[0] + index[0];
    }

    /// Values at the corners of a cell, and the set of those inside.
    fn cellCorners(nets: *const Nets, cell: [3]usize, values: *[8]f64) usize {
        var inside: usize = 0;
        const first = nets.sampleIndex(cell);
        const row = nets.grid.counts[0] + 1;
        const layer = row * (nets.grid.counts[1] + 1);
        for (values, 0..) |*value, corner| {
            const offset = (corner & 1) + (corner >> 1 & 1) * row + (corner >> 2) * layer;
            value.* = nets.samples[first + offset];
            if (value.* > 0) inside |= @as(usize, 1) << @intCast(corner);
        }
        return inside;
    }

    fn addVertices(nets: *Nets) Allocator.Error!void {
        const counts = nets.grid.counts;
        nets.cell_vertices = try nets.gpa.alloc(u32, counts[0] * counts[1] * counts[2]);
        var values: [8]f64 = undefined;
        for (0..counts[2]) |z| {
            for (0..counts[1]) |y| {
                for (0..counts[0]) |x| {
                    const cell: [3]usize = .{ x, y, z };
                    const sheets = &Sheets.of_corners[nets.cellCorners(cell, &values)];
                    const first: u32 = @intCast(nets.positions.items.len);
                    nets.cell_vertices[nets.cellIndex(cell)] = first;
                    for (0..sheets.count) |sheet| {
                        const mean = meanCrossing(&values, sheets, sheet);
                        const offset = geometry.scale(mean, nets.grid.cell);
                        try nets.positions.append(nets.gpa, nets.grid.samplePoint(cell) + offset);
                    }
                }
            }
        }
    }

    fn addFaces(nets: *Nets) Allocator.Error!void {
        const counts = nets.grid.counts;
        for (0..counts[2] + 1) |z| {
            for (0..counts[1] + 1) |y| {
                for (0..counts[0] + 1) |x| {
                    for (0..3) |axis| try nets.addFace(.{ x, y, z }, axis);
                }
            }
        }
    }

    /// Adds the quadrilateral of the grid edge from a sample along an axis, if it is crossed.
    fn addFace(nets: *Nets, at: [3]usize, axis: usize) Allocator.Error!void {
        var next = at;
        next[axis] += 1;
        if (next[axis] > nets.grid.counts[axis]) return;
        const inside = nets.samples[nets.sampleIndex(at)] > 0;
        if (inside == (nets.samples[nets.sampleIndex(next)] > 0)) return;

        // The cells around the edge, counter-clockwise seen from its end.
        const u = (axis + 1) % 3;
        const v = (axis + 2) % 3;
        assert(at[u] > 0 and at[v] > 0);
        const offsets = [4][2]usize{ .{ 0, 0 }, .{ 1, 0 }, .{ 1, 1 }, .{ 0, 1 } };
        var corners: [4]u32 = undefined;
        for (offsets, &corners) |offset, *corner| {
            var cell = at;
            cell[u] -= 1 - offset[0];
            cell[v] -= 1 - offset[1];
            const own_corner = (1 - offset[0]) << @intCast(u) | (1 - offset[1]) << @intCast(v);
            corner.* = nets.sheetVertex(cell, cellEdge(axis, own_corner));
        }
        if (!inside) std.mem.swap(u32, &corners[1], &corners[3]);
        const p = nets.positions.items;
        const first = p[corners[0]] - p[corners[2]];
        const second = p[corners[1]] - p[corners[3]];
        const keep = geometry.dot(first, first) <= geometry.dot(second, second);
        const turn: usize = if (keep) 0 else 1;
        const a, const b, const c, const d = .{
            corners[turn], corners[turn + 1], corners[turn + 2], corners[(turn + 3) % 4],
        };
        try nets.triangles.append(nets.gpa, .{ a, b, c });
        try nets.triangles.append(nets.gpa, .{ a, c, d });
    }

    /// The vertex of the sheet that crosses an edge of a cell.
    fn sheetVertex(nets: *const Nets, cell: [3]usize, edge: usize) u32 {
        var values: [8]f64 = undefined;
        const sheet = Sheets.of_corners[nets.cellCorners(cell, &values)].of_edge[edge];
        assert(sheet != no_sheet);
        return nets.cell_vertices[nets.cellIndex(cell)] + sheet;
    }
};

/// The mean of the points where a sheet crosses the edges of the unit cell.
fn meanCrossing(values: *const [8]f64, sheets: *const Sheets, sheet: usize) Point {
    var sum: Point = .{ 0, 0, 0 };
    var count: f64 = 0;
    inline for (0..12) |edge| {
        if (sheets.of_edge[edge] == sheet) {
            const begin = comptime edgeCorner(edge);
            const axis = edge / 4;
            var crossing: Point = .{ begin & 1, begin >> 1 & 1, begin >> 2 };
            const a = values[begin];
            const b = values[begin | 1 << axis];
            crossing[axis] = a / (a - b);
            sum += crossing;
            count += 1;
        }
    }
    assert(count >= 3);
    return sum / @as(Point, @splat(count));
}

/// Half-edges by their ends, each of which must occur once.
const EdgeSet = std.AutoHashMapUnmanaged([2]u32, void);

/// Genus of the closed, oriented, connected surface; null if it is none. For tests.
pub fn genus(
    gpa: Allocator,
    vertex_count: usize,
    triangles: []const [3]u32,
) Allocator.Error!?usize {
    var edges: EdgeSet = .empty;
    defer edges.deinit(gpa);
    const parents = try gpa.alloc(u32, vertex_count);
    defer gpa.free(parents);
    for (parents, 0..) |*parent, index| parent.* = @intCast(index);
    for (triangles) |t| {
        for (0..3) |corner| {
            const edge: [2]u32 = .{ t[corner], t[(corner + 1) % 3] };
            const found = try edges.getOrPut(gpa, edge);
            if (found.found_existing) return null;
            parents[root(parents, edge[0])] = root(parents, edge[1]);
        }
    }
    var iterator = edges.keyIterator();
    while (iterator.next()) |edge| {
        if (!edges.contains(.{ edge[1], edge[0] })) return null;
    }
    for (0..vertex_count) |vertex| {
        if (root(parents, @intCast(vertex)) != root(parents, 0)) return null;
    }
    // Euler: vertices - edges + faces = 2 - 2 genus.
    const plus = 2 + edges.count() / 2;
    const minus = vertex_count + triangles.len;
    if (plus < minus or (plus - minus) % 2 != 0) return null;
    return (plus - minus) / 2;
}

/// The representative of a vertex's component, with the path to it halved.
fn root(parents: []u32, vertex: u32) u32 {
    var at = vertex;
    while (parents[at] != at) {
        parents[at] = parents[parents[at]];
        at = parents[at];
    }
    return at;
}

const TorusField = struct {
    fn value(p: Point) f64 {
        const ring = @sqrt(p[0] * p[0] + p[1] * p[1]) - 1;
        return 0.16 - (ring * ring + p[2] * p[2]);
    }

    fn values(_: TorusField, lower: Point, cell: f64, out: []f64) void {
        for (out, 0..) |*result, index| {
            result.* = value(lower + geometry.scale(boxOffset(index), cell));
        }
    }

    fn slope(_: TorusField, p: Point) Slope {
        const radius = @sqrt(p[0] * p[0] + p[1] * p[1]);
        const factor = -2 * (radius - 1) / radius;
        return .{ .value = value(p), .gradient = .{ p[0] * factor, p[1] * factor, -2 * p[2] } };
    }
};

test "a torus has one handle, and its vertices lie on it" {
    const gpa = std.testing.allocator;
    const grid: Grid = .{ .lower = .{ -1.6, -1.6, -0.6 }, .cell = 0.1, .counts = .{ 33, 32, 13 } };
    var surface = try build(gpa, grid, TorusField{});
    defer surface.deinit(gpa);
    try std.testing.expectEqual(1, try genus(gpa, surface.positions.len, surface.triangles));
    var volume: f64 = 0;
    for (surface.positions) |position| {
        try std.testing.expectApproxEqAbs(@as(f64, 0), TorusField.value(position), 1e-6);
    }
    for (surface.triangles) |t| {
        const p = surface.positions;
        volume += geometry.dot(p[t[0]], geometry.cross(p[t[1]], p[t[2]])) / 6;
        const face = geometry.cross(p[t[1]] - p[t[0]], p[t[2]] - p[t[0]]);
        try std.testing.expect(geometry.dot(face, surface.normals[t[0]]) > 0);
    }
    const exact = 2 * std.math.pi * std.math.pi * 0.16;
    try std.testing.expectApproxEqRel(exact, volume, 0.02);
}

fn buildAndFree(gpa: Allocator) Allocator.Error!void {
    const grid: Grid = .{ .lower = .{ -1.6, -1.6, -0.6 }, .cell = 0.2, .counts = .{ 17, 17, 7 } };
    var surface = try build(gpa, grid, TorusField{});
    surface.deinit(gpa);
}

test "a lack of memory leaks none" {
    try std.testing.checkAllAllocationFailures(std.testing.allocator, buildAndFree, .{});
}

test "cells have the sheets that their corners ask for" {
    // None, a corner, an edge, two opposite corners, a face, all but a corner, all.
    const cases = [_][2]u8{
        .{ 0, 0 },      .{ 1, 1 },   .{ 0b11, 1 }, .{ 0b1000_0001, 2 }, .{ 0b1001, 2 },
        .{ 0b1111, 1 }, .{ 254, 1 }, .{ 255, 0 },
    };
    for (cases) |case| {
        try std.testing.expectEqual(case[1], Sheets.of_corners[case[0]].count);
    }
    for (Sheets.of_corners) |sheets| {
        try std.testing.expect(sheets.count <= 4);
        for (0..sheets.count) |sheet| {
            const count = std.mem.countScalar(u8, &sheets.of_edge, @intCast(sheet));
            try std.testing.expect(count >= 3);
        }
    }
    for (0..12) |edge| try std.testing.expectEqual(edge, cellEdge(edge / 4, edgeCorner(edge)));
}

test "open, doubled and parted surfaces have no genus" {
    const gpa = std.testing.allocator;
    const tetrahedron = [_][3]u32{ .{ 0, 1, 2 }, .{ 0, 2, 3 }, .{ 0, 3, 1 }, .{ 1, 3, 2 } };
    try std.testing.expectEqual(0, try genus(gpa, 4, &tetrahedron));
    try std.testing.expectEqual(null, try genus(gpa, 4, tetrahedron[0..3]));
    try std.testing.expectEqual(null, try genus(gpa, 5, &tetrahedron));
    try std.testing.expectEqual(null, try genus(gpa, 4, &(tetrahedron ++ tetrahedron)));
}
