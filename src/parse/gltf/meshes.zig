//! glTF's meshes become triangle lists with one material each.
//!
//! In: primitives (glTF 2.0, section 3.7.2). Out: `scene.Mesh`es in the scene's memory, with the
//! texture coordinates and tangents that their material's textures need. A set of coordinates that
//! is missing counts as 0, as it does in other viewers. What several primitives share is decoded
//! once. Every index has been compared with the number of
//! vertices, every number is finite; strips and fans are taken apart (section 3.7.2.1).

const std = @import("std");
const c = @import("../cgltf.zig");
const math = @import("../../math.zig");
const scene = @import("../../scene.zig");
const accessors = @import("../accessor.zig");
const attributes = @import("attributes.zig");
const Materials = @import("materials.zig");
const Source = @import("source.zig");
const Accessor = accessors.Accessor;
const Error = Source.Error;
const Vec3 = math.Vec3;
const Meshes = @This();
const assert = std.debug.assert;

source: *Source,
materials: *Materials,
/// Index in the scene of a glTF mesh's first primitive, and how many are drawn.
ranges: std.AutoHashMapUnmanaged(u32, Range) = .empty,
positions: std.AutoHashMapUnmanaged(u32, []const Vec3) = .empty,
normals: std.AutoHashMapUnmanaged(u32, []const Vec3) = .empty,
colors: std.AutoHashMapUnmanaged(u32, []const [4]f32) = .empty,
texcoords: std.AutoHashMapUnmanaged(u32, []const [2]f32) = .empty,
tangents: std.AutoHashMapUnmanaged(u32, []const [4]f32) = .empty,
triangles: std.AutoHashMapUnmanaged(Connection, []const [3]u32) = .empty,
/// Whether a mesh without the coordinates of its textures has been met.
coordinates_missed: bool = false,

/// Meshes `first..first + count` of the scene.
pub const Range = struct { first: u32, count: u32 };

/// What determines a triangle list.
const Connection = struct {
    /// The accessor of the indices, or `scene.none`.
    indices: u32,
    vertex_count: u32,
    mode: Mode,
};

/// How vertices follow one another.
const Mode = enum { triangles, strip, fan };

/// Frees what is not the scene's.
pub fn deinit(meshes: *Meshes) void {
    const gpa = meshes.source.gpa;
    inline for (.{
        "ranges", "positions", "normals", "colors", "texcoords", "tangents", "triangles",
    }) |name| @field(meshes, name).deinit(gpa);
    meshes.* = undefined;
}

/// The scene's meshes of the glTF mesh with this index, decoded at the first call.
pub fn get(meshes: *Meshes, mesh_index: u32) Error!Range {
    const gpa = meshes.source.gpa;
    if (meshes.ranges.get(mesh_index)) |range| return range;
    const mesh = Source.item(meshes.source.data.meshes, mesh_index);
    const builder = meshes.source.builder;
    const first: u32 = @intCast(builder.meshes.items.len);
    for (Source.slice(mesh.primitives, mesh.primitives_count), 0..) |*primitive, index| {
        const place: Place = .{ .mesh = mesh_index, .primitive = @intCast(index) };
        const decoded = try meshes.decode(primitive, place) orelse continue;
        _ = try builder.addMesh(decoded);
    }
    const count: u32 = @intCast(builder.meshes.items.len - first);
    try meshes.ranges.put(gpa, mesh_index, .{ .first = first, .count = count });
    return .{ .first = first, .count = count };
}

/// Where a primitive stands, for messages.
pub const Place = struct {
    mesh: u32,
    primitive: u32,

    /// Called by `{f}`.
    pub fn format(place: Place, writer: *std.Io.Writer) std.Io.Writer.Error!void {
        try writer.print("mesh {d}, primitive {d}", .{ place.mesh, place.primitive });
    }
};

fn decode(meshes: *Meshes, primitive: *const c.cgltf_primitive, place: Place) Error!?scene.Mesh {
    const source = meshes.source;
    const mode: Mode = switch (primitive.type) {
        .triangles => .triangles,
        .triangle_strip => .strip,
        .triangle_fan => .fan,
        .invalid => return source.fail("{f}: unknown mode", .{place}),
        else => {
            source.warn("points and lines are not drawn", .{});
            return null;
        },
    };
    const used = try attributes.find(source, primitive, place);
    const position = used.position orelse {
        source.warn("{f}: without POSITION, not drawn", .{place});
        return null;
    };
    const vertex_count: u32 = @intCast(source.data.accessors[position].count);
    const triangles = try meshes.connect(primitive, mode, vertex_count, place);
    if (triangles.len == 0) return null;
    var mesh: scene.Mesh = .{
        .positions = try meshes.floats(3, &meshes.positions, position),
        .normals = if (used.normal) |index|
            try meshes.floats(3, &meshes.normals, index)
        else
            null,
        .colors = if (used.color) |index| try meshes.decodeColors(index) else null,
        .triangles = triangles,
        .material = if (primitive.material) |material|
            Source.indexOf(source.data.materials, material)
        else
            try meshes.materials.useDefault(),
    };
    try meshes.decodeForTextures(&mesh, &used, place);
    return mesh;
}

/// What the textures of its material need of a mesh, and no more.
fn decodeForTextures(
    meshes: *Meshes,
    mesh: *scene.Mesh,
    used: *const attributes.Used,
    place: Place,
) Error!void {
    const material = try meshes.materials.use(mesh.material);
    inline for (scene.texture_fields) |field| if (@field(material, field)) |view| {
        const set = view.texcoord_set;
        if (mesh.texcoords[set] == null) {
            if (used.texcoords[set]) |index| {
                mesh.texcoords[set] = try meshes.floats(2, &meshes.texcoords, index);
            } else if (!meshes.coordinates_missed) {
                meshes.coordinates_missed = true;
                meshes.source.warn(
                    "{f}: without TEXCOORD_{d}, where its material's textures look: taken as 0",
                    .{ place, set },
                );
            }
        }
    };
    const normal_texture = material.normal_texture orelse return;
    if (mesh.texcoords[normal_texture.texcoord_set] == null) {
        mesh.material = try meshes.materials.useSmooth(mesh.material);
    } else if (mesh.normals != null) { // Without, they count for nothing.
        if (used.tangent) |index| mesh.tangents = try meshes.decodeTangents(index);
    }
}

fn floats(
    meshes: *Meshes,
    comptime width: u8,
    cache: *std.AutoHashMapUnmanaged(u32, []const [width]f32),
    index: u32,
) Error![]const [width]f32 {
    if (cache.get(index)) |known| return known;
    const source = meshes.source;
    const accessor = try attributes.required(source, index);
    try source.charge(@as(u64, accessor.count) * @sizeOf([width]f32));
    const out = try source.arena.alloc([width]f32, accessor.count);
    if (accessors.decodeFloats(width, accessor, out)) |bad| return source.fail(
        "accessor {d}: element {d} is not finite",
        .{ index, bad },
    );
    try cache.put(source.gpa, index, out);
    return out;
}

/// Tangents whose fourth number is 1 or -1.
fn decodeTangents(meshes: *Meshes, index: u32) Error![]const [4]f32 {
    if (meshes.tangents.get(index)) |known| return known;
    const source = meshes.source;
    const accessor = try attributes.required(source, index);
    try source.charge(@as(u64, accessor.count) * @sizeOf([4]f32));
    const tangents = try source.arena.alloc([4]f32, accessor.count);
    if (accessors.decodeFloats(4, accessor, tangents)) |bad| return source.fail(
        "accessor {d}: element {d} is not finite",
        .{ index, bad },
    );
    for (tangents) |*tangent| tangent[3] = if (tangent[3] < 0) -1 else 1;
    try meshes.tangents.put(source.gpa, index, tangents);
    return tangents;
}

/// Colours as RGBA, none below 0 and no alpha above 1.
fn decodeColors(meshes: *Meshes, index: u32) Error![]const [4]f32 {
    if (meshes.colors.get(index)) |known| return known;
    const source = meshes.source;
    const accessor = try attributes.required(source, index);
    try source.charge(@as(u64, accessor.count) * @sizeOf([4]f32));
    const colors = try source.arena.alloc([4]f32, accessor.count);
    const not_finite = if (accessor.component_count == 4)
        accessors.decodeFloats(4, accessor, colors)
    else not_finite: {
        const opaque_colors = try source.gpa.alloc([3]f32, accessor.count);
        defer source.gpa.free(opaque_colors);
        const first = accessors.decodeFloats(3, accessor, opaque_colors);
        for (colors, opaque_colors) |*color, rgb| color.* = rgb ++ [1]f32{1};
        break :not_finite first;
    };
    if (not_finite) |bad| return source.fail(
        "accessor {d}: element {d} is not finite",
        .{ index, bad },
    );
    if (clampColors(colors)) {
        source.warn("accessor {d}: colours out of range are clamped", .{index});
    }
    try meshes.colors.put(source.gpa, index, colors);
    return colors;
}

/// Whether any had to be.
fn clampColors(colors: [][4]f32) bool {
    var clamped = false;
    for (colors) |*color| {
        for (color) |*value| if (value.* < 0) {
            value.* = 0;
            clamped = true;
        };
        if (color[3] > 1) {
            color[3] = 1;
            clamped = true;
        }
    }
    return clamped;
}

/// Triangles of a primitive, every index below `vertex_count`.
fn connect(
    meshes: *Meshes,
    primitive: *const c.cgltf_primitive,
    mode: Mode,
    vertex_count: u32,
    place: Place,
) Error![]const [3]u32 {
    const source = meshes.source;
    const connection: Connection = .{
        .indices = if (primitive.indices) |indices|
            Source.indexOf(source.data.accessors, indices)
        else
            scene.none,
        .vertex_count = vertex_count,
        .mode = mode,
    };
    if (meshes.triangles.get(connection)) |known| return known;
    const accessor: ?Accessor = if (primitive.indices != null)
        try attributes.indices(source, connection.indices)
    else
        null;
    const count = if (accessor) |indexed| indexed.count else vertex_count;
    const triangle_count = switch (mode) {
        .triangles => count / 3,
        .strip, .fan => count -| 2,
    };
    if (count < 3 or (mode == .triangles and count % 3 != 0)) source.warn(
        "{f}: {d} vertices do not make whole triangles, the rest is left out",
        .{ place, count },
    );
    try source.charge(@as(u64, triangle_count) * @sizeOf([3]u32));
    const triangles = try source.arena.alloc([3]u32, triangle_count);
    if (mode == .triangles and count % 3 == 0) {
        try number(source, connection, accessor, @ptrCast(triangles));
    } else {
        const vertices = try source.gpa.alloc(u32, count);
        defer source.gpa.free(vertices);
        try number(source, connection, accessor, vertices);
        assemble(mode, vertices, triangles);
    }
    try meshes.triangles.put(source.gpa, connection, triangles);
    return triangles;
}

/// The vertices of a primitive in the order of the file.
fn number(
    source: *const Source,
    connection: Connection,
    accessor: ?Accessor,
    vertices: []u32,
) Error!void {
    const indexed = accessor orelse {
        for (vertices, 0..) |*vertex, index| vertex.* = @intCast(index);
        return;
    };
    const largest = accessors.decodeIndices(indexed, vertices);
    if (largest >= connection.vertex_count) return source.fail(
        "accessor {d}: index {d} with {d} vertices",
        .{ connection.indices, largest, connection.vertex_count },
    );
}

/// Strips and fans turn so that every triangle keeps the winding of the first.
fn assemble(mode: Mode, vertices: []const u32, triangles: [][3]u32) void {
    for (triangles, 0..) |*triangle, index| triangle.* = switch (mode) {
        .triangles => vertices[3 * index ..][0..3].*,
        .strip => .{
            vertices[index],
            vertices[index + 1 + index % 2],
            vertices[index + 2 - index % 2],
        },
        .fan => .{ vertices[index + 1], vertices[index + 2], vertices[0] },
    };
}

test clampColors {
    var colors = [_][4]f32{ .{ 0, 0.5, 2, 1 }, .{ -1, 0, 0, 0 }, .{ 0, 0, 0, 2 } };
    try std.testing.expect(!clampColors(colors[0..1]));
    try std.testing.expect(clampColors(colors[1..2]));
    try std.testing.expect(clampColors(colors[2..3]));
    const expected = [_][4]f32{ .{ 0, 0.5, 2, 1 }, .{ 0, 0, 0, 0 }, .{ 0, 0, 0, 1 } };
    try std.testing.expectEqual(expected, colors);
}

test assemble {
    const Triangles = [3][3]u32;
    const vertices = [_]u32{ 10, 11, 12, 13, 14 };
    var triangles: Triangles = undefined;
    assemble(.strip, &vertices, &triangles);
    const strip: Triangles = .{ .{ 10, 11, 12 }, .{ 11, 13, 12 }, .{ 12, 13, 14 } };
    try std.testing.expectEqual(strip, triangles);
    assemble(.fan, &vertices, &triangles);
    const fan: Triangles = .{ .{ 11, 12, 10 }, .{ 12, 13, 10 }, .{ 13, 14, 10 } };
    try std.testing.expectEqual(fan, triangles);
    assemble(.triangles, &.{ 0, 1, 2, 3, 4, 5, 6 }, triangles[0..2]);
    try std.testing.expectEqual([3]u32{ 3, 4, 5 }, triangles[1]);
}
