//! Loop's subdivision of a control mesh.
//!
//! In: `P`, `indices` and `levels` (or `nlevels`). Out: that many times four triangles for each,
//! vertices at their limit on the surface, smooth normals. Weights: Loop, "Smooth subdivision
//! surfaces based on triangles" (1987), with the simpler beta of Warren that PBRT uses; limits:
//! Hoppe et al., "Piecewise smooth surface reconstruction" (1994), and that of cubic B-splines
//! along borders, 1/6, where PBRT has 1/5. Edges with other than two faces count as borders.

const std = @import("std");
const limits = @import("../limits.zig");
const math = @import("../../../math.zig");
const meshes = @import("meshes.zig");
const Tessellator = @import("tessellator.zig");
const Error = @import("../input.zig").Error;
const Geometry = Tessellator.Geometry;
const Vec3 = math.Vec3;
const vec3 = math.vec3;

/// An edge with up to two of its faces.
const Edge = struct {
    ends: [2]u32,
    /// The corners across.
    opposite: [2]u32,
    face_count: u32,
};

/// A side of a face, to be sorted by its edge.
const Side = struct {
    /// Lower end, higher end.
    key: u64,
    face: u32,
    /// Which corner of the face it starts from.
    corner: u32,

    fn before(_: void, a: Side, b: Side) bool {
        return if (a.key != b.key) a.key < b.key else a.face < b.face;
    }
};

/// What the neighbours of a vertex add up to.
const Ring = struct {
    sum: Vec3 = .{ 0, 0, 0 },
    count: u32 = 0,
    border_sum: Vec3 = .{ 0, 0, 0 },
    border_count: u32 = 0,

    /// The vertex between its neighbours: `weight` of each where it is inside, `border_weight` of
    /// the two along a border; corners of borders stay.
    fn blend(ring: *const Ring, at: Vec3, weight: f32, border_weight: f32) Vec3 {
        if (ring.border_count == 0 and ring.count > 0) {
            const own = 1 - @as(f32, @floatFromInt(ring.count)) * weight;
            return vec3.add(vec3.scale(at, own), vec3.scale(ring.sum, weight));
        }
        if (ring.border_count != 2) return at;
        const own = 1 - 2 * border_weight;
        return vec3.add(vec3.scale(at, own), vec3.scale(ring.border_sum, border_weight));
    }

    fn beta(ring: *const Ring) f32 {
        if (ring.count == 3) return 3.0 / 16.0;
        return 3.0 / (8.0 * @as(f32, @floatFromInt(@max(ring.count, 1))));
    }

    fn gamma(ring: *const Ring) f32 {
        const valence: f32 = @floatFromInt(ring.count);
        return 1 / (valence + 3 / (8 * ring.beta()));
    }
};

/// Subdivides.
pub fn loop(tessellator: *Tessellator) Error!Geometry {
    // Faces share their vertices while they are divided.
    const wants_texcoords = tessellator.wants_texcoords;
    tessellator.wants_texcoords = false;
    defer tessellator.wants_texcoords = wants_texcoords;
    var level: Geometry = try meshes.triangles(tessellator);
    level.normals = null;
    const asked = tessellator.parameters.integer("levels") orelse
        tessellator.parameters.integer("nlevels") orelse 3;
    const levels: u32 = @intCast(std.math.clamp(asked, 0, limits.subdivision_count_max));
    try tessellator.reserveTriangles(level.triangles.len *| (@as(u64, 1) << @intCast(2 * levels)));
    const gpa = tessellator.input.gpa;
    for (0..levels) |_| {
        const edges = try findEdges(tessellator, level.triangles);
        defer gpa.free(edges.list);
        defer gpa.free(edges.of_face);
        level = try refine(tessellator, &level, edges);
    }
    const edges = try findEdges(tessellator, level.triangles);
    defer gpa.free(edges.list);
    defer gpa.free(edges.of_face);
    const rings = try findRings(tessellator, &level, edges.list);
    defer gpa.free(rings);
    for (level.positions, rings) |*position, *ring| {
        position.* = finite(ring.blend(position.*, ring.gamma(), 1.0 / 6.0));
    }
    try tessellator.smooth(&level);
    if (wants_texcoords) try tessellator.unshare(&level, Tessellator.triangle_corners);
    return level;
}

fn finite(position: Vec3) Vec3 {
    if (!vec3.isFinite(position)) return .{ 0, 0, 0 };
    var result = position;
    for (&result) |*component| component.* = math.flushDenormal(component.*);
    return result;
}

/// All edges, and for each face those of its sides. The caller frees both.
const Edges = struct { list: []Edge, of_face: [][3]u32 };

fn findEdges(tessellator: *Tessellator, faces: []const [3]u32) Error!Edges {
    const gpa = tessellator.input.gpa;
    if (faces.len > std.math.maxInt(u32) / 16) return tessellator.fail("has too many faces", .{});
    const sides = try gpa.alloc(Side, 3 * faces.len);
    defer gpa.free(sides);
    for (faces, 0..) |face, index| for (0..3) |corner| {
        const a = face[corner];
        const b = face[(corner + 1) % 3];
        sides[3 * index + corner] = .{
            .key = @as(u64, @min(a, b)) << 32 | @max(a, b),
            .face = @intCast(index),
            .corner = @intCast(corner),
        };
    };
    std.mem.sortUnstable(Side, sides, {}, Side.before);
    const of_face = try gpa.alloc([3]u32, faces.len);
    errdefer gpa.free(of_face);
    var list: std.ArrayList(Edge) = .empty;
    errdefer list.deinit(gpa);
    for (sides, 0..) |side, index| {
        if (index == 0 or sides[index - 1].key != side.key) try list.append(gpa, .{
            .ends = .{ @intCast(side.key >> 32), @truncate(side.key) },
            .opposite = .{ 0, 0 },
            .face_count = 0,
        });
        const edge = &list.items[list.items.len - 1];
        const across = faces[side.face][(side.corner + 2) % 3];
        if (edge.face_count < 2) edge.opposite[edge.face_count] = across;
        edge.face_count += 1;
        of_face[side.face][side.corner] = @intCast(list.items.len - 1);
    }
    return .{ .list = try list.toOwnedSlice(gpa), .of_face = of_face };
}

/// The rings of all vertices. The caller frees them.
fn findRings(tessellator: *Tessellator, level: *const Geometry, edges: []const Edge) Error![]Ring {
    const rings = try tessellator.input.gpa.alloc(Ring, level.positions.len);
    @memset(rings, .{});
    for (edges) |edge| for (0..2) |end| {
        const ring = &rings[edge.ends[end]];
        const other = level.positions[edge.ends[1 - end]];
        ring.sum = vec3.add(ring.sum, other);
        ring.count += 1;
        if (edge.face_count == 2) continue;
        ring.border_sum = vec3.add(ring.border_sum, other);
        ring.border_count += 1;
    };
    return rings;
}

/// One level further: the old vertices first, then one for each edge.
fn refine(tessellator: *Tessellator, level: *const Geometry, edges: Edges) Error!Geometry {
    const vertex_count = level.positions.len;
    if (vertex_count + edges.list.len > std.math.maxInt(u32) / 2)
        return tessellator.fail("has too many vertices", .{});
    const rings = try findRings(tessellator, level, edges.list);
    defer tessellator.input.gpa.free(rings);
    const result: Geometry = .{
        .positions = try tessellator.alloc(Vec3, vertex_count + edges.list.len),
        .triangles = try tessellator.alloc([3]u32, 4 * level.triangles.len),
    };
    for (level.positions, rings, result.positions[0..vertex_count]) |from, *ring, *to| {
        to.* = finite(ring.blend(from, ring.beta(), 1.0 / 8.0));
    }
    for (edges.list, result.positions[vertex_count..]) |edge, *to| {
        const ends = vec3.add(level.positions[edge.ends[0]], level.positions[edge.ends[1]]);
        if (edge.face_count != 2) {
            to.* = finite(vec3.scale(ends, 0.5));
            continue;
        }
        const across =
            vec3.add(level.positions[edge.opposite[0]], level.positions[edge.opposite[1]]);
        to.* = finite(vec3.add(vec3.scale(ends, 3.0 / 8.0), vec3.scale(across, 1.0 / 8.0)));
    }
    const first: u32 = @intCast(vertex_count);
    for (level.triangles, edges.of_face, 0..) |face, sides, index| {
        const a, const b, const c = .{ first + sides[0], first + sides[1], first + sides[2] };
        result.triangles[4 * index] = .{ face[0], a, c };
        result.triangles[4 * index + 1] = .{ face[1], b, a };
        result.triangles[4 * index + 2] = .{ face[2], c, b };
        result.triangles[4 * index + 3] = .{ a, b, c };
    }
    return result;
}
