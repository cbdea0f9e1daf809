//! The meshes of an OBJ file: what has the same material and the same kind becomes one.
//!
//! In: elements whose corners combine positions, coordinates and normals as they like. Out: meshes
//! whose vertices are the combinations, each once. Faces without normals are smooth where a
//! smoothing group is on: their normals are the sums of the faces around, by area, of the same
//! position and group (Gouraud 1971); others are flat. Time is linear: the elements are sorted by
//! counting, the combinations are looked up by position, or by hash where one has many.

const std = @import("std");
const math = @import("../../math.zig");
const orientation = @import("../orientation.zig");
const scene = @import("../../scene.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = @import("../../diagnostic.zig").Diagnostic;
const Materials = @import("materials.zig");
const Polygon = @import("../polygon.zig");
const Reader = @import("reader.zig");
const Resources = @import("../resource.zig");
const Vec3 = math.Vec3;
const none = scene.none;
const Assembly = @This();

/// Vertices of a position that are looked through.
const chain_max = 8;

/// What can be one mesh.
const Class = enum { smooth, flat, lines, points };
const class_count = std.enums.values(Class).len;

gpa: Allocator,
reader: *Reader,
builder: *scene.Builder,
materials: *Materials,
diagnostic: *Diagnostic,
cutter: Polygon,
/// Vertices of the mesh that is made, by what meets in them.
vertices: std.ArrayList(Reader.Corner) = .empty,
/// For each position its first vertex, and for each vertex the next one there, or `none`: at most
/// `chain_max`. What there are more is in `known`.
heads: []u32 = &.{},
nexts: std.ArrayList(u32) = .empty,
known: std.AutoHashMapUnmanaged(Reader.Corner, u32) = .empty,
triangles: std.ArrayList([3]u32) = .empty,
segments: std.ArrayList([2]u32) = .empty,
points: std.ArrayList(u32) = .empty,
/// Of the face that is cut.
face: std.ArrayList(Vec3) = .empty,
cut: std.ArrayList([3]u32) = .empty,
/// Elements with a corner that is not finite.
not_finite_count: u64 = 0,
/// Corners that should show a texture, without coordinates.
bare_count: u64 = 0,

/// Frees what it has worked with.
pub fn deinit(assembly: *Assembly) void {
    inline for (.{
        "known", "vertices", "nexts", "triangles", "segments", "points", "face", "cut",
    }) |name| @field(assembly, name).deinit(assembly.gpa);
    assembly.gpa.free(assembly.heads);
    assembly.cutter.deinit();
    assembly.* = undefined;
}

/// Adds all meshes to the scene.
pub fn run(assembly: *Assembly) Resources.Error!void {
    try assembly.smoothFaces();
    assembly.heads = try assembly.gpa.alloc(u32, assembly.reader.positions.items.len);
    @memset(assembly.heads, none);
    const elements = assembly.reader.elements.items;
    const bucket_count = class_count * (assembly.reader.material_names.items.len + 1);
    const ends = try assembly.gpa.alloc(u32, bucket_count);
    defer assembly.gpa.free(ends);
    @memset(ends, 0);
    for (elements) |*element| ends[assembly.bucketOf(element)] += 1;
    var sum: u32 = 0;
    for (ends) |*end| {
        const count = end.*;
        end.* = sum;
        sum += count;
    }
    const order = try assembly.gpa.alloc(u32, elements.len);
    defer assembly.gpa.free(order);
    for (elements, 0..) |*element, index| {
        const end = &ends[assembly.bucketOf(element)];
        order[end.*] = @intCast(index);
        end.* += 1;
    }
    var first: u32 = 0;
    for (ends, 0..) |end, bucket| {
        if (end > first) {
            const material: u32 = @intCast(bucket / class_count);
            const class: Class = @fromBackingInt(@intCast(bucket % class_count));
            try assembly.addMesh(order[first..end], material, class);
        }
        first = end;
    }
    if (assembly.not_finite_count > 0) assembly.diagnostic.forgive(
        "{d} faces, lines or points with places that are not finite are left out",
        .{assembly.not_finite_count},
    );
    if (assembly.bare_count > 0) assembly.diagnostic.warn(
        "{d} corners have no coordinates, where their material's textures look: taken as 0",
        .{assembly.bare_count},
    );
}

/// Those without a material come last.
fn bucketOf(assembly: *const Assembly, element: *const Reader.Element) usize {
    const class: Class = switch (element.kind) {
        .line => .lines,
        .points => .points,
        .face => if (hasNormals(assembly.cornersOf(element))) .smooth else .flat,
    };
    const material = @min(element.material, assembly.reader.material_names.items.len);
    return class_count * material + @backingInt(class);
}

fn cornersOf(assembly: *const Assembly, element: *const Reader.Element) []Reader.Corner {
    return assembly.reader.corners.items[element.first..][0..element.count];
}

fn hasNormals(corners: []const Reader.Corner) bool {
    for (corners) |corner| if (corner.normal == none) return false;
    return true;
}

/// Makes the normals of faces that have none and are smooth.
fn smoothFaces(assembly: *Assembly) Resources.Error!void {
    const reader = assembly.reader;
    const gpa = assembly.gpa;
    const own_count = reader.normals.items.len;
    const Key = struct { position: u32, smoothing: u32 };
    var made: std.AutoHashMapUnmanaged(Key, u32) = .empty;
    defer made.deinit(gpa);
    for (reader.elements.items) |*element| {
        const corners = assembly.cornersOf(element);
        if (element.kind != .face or element.smoothing == 0 or hasNormals(corners)) continue;
        const normal = assembly.faceNormal(corners) orelse continue;
        for (corners) |*corner| {
            const key: Key = .{ .position = corner.position, .smoothing = element.smoothing };
            const entry = try made.getOrPut(gpa, key);
            if (!entry.found_existing) {
                entry.value_ptr.* = @intCast(reader.normals.items.len);
                try reader.normals.append(gpa, .{ 0, 0, 0 });
            }
            corner.normal = entry.value_ptr.*;
            const sum = &reader.normals.items[corner.normal];
            sum.* = math.vec3.add(sum.*, normal);
        }
    }
    for (reader.normals.items[own_count..]) |*normal| {
        normal.* = math.vec3.normalize(normal.*) orelse .{ 0, 0, 0 };
    }
}

/// Newell's, as long as twice the area; null where it is not finite.
fn faceNormal(assembly: *const Assembly, corners: []const Reader.Corner) ?Vec3 {
    const positions = assembly.reader.positions.items;
    const origin = positions[corners[0].position];
    var sum: Vec3 = .{ 0, 0, 0 };
    var before = math.vec3.sub(positions[corners[1].position], origin);
    for (corners[2..]) |corner| {
        const here = math.vec3.sub(positions[corner.position], origin);
        sum = math.vec3.add(sum, math.vec3.cross(before, here));
        before = here;
    }
    return if (math.vec3.isFinite(sum)) sum else null;
}

/// Adds the mesh of these elements.
fn addMesh(
    assembly: *Assembly,
    order: []const u32,
    material_index: u32,
    class: Class,
) Resources.Error!void {
    for (assembly.vertices.items) |vertex| assembly.heads[vertex.position] = none;
    inline for (.{ "vertices", "nexts", "triangles", "segments", "points", "known" }) |name| {
        @field(assembly, name).clearRetainingCapacity();
    }
    var material = try assembly.materials.get(material_index);
    const has_texcoords = assembly.haveTexcoords(order);
    if (!has_texcoords) material = try assembly.materials.withoutTextures(material);
    const is_textured = has_texcoords and assembly.materials.hasTextures(material);
    for (order) |index| {
        const element = &assembly.reader.elements.items[index];
        const corners = assembly.cornersOf(element);
        if (!assembly.areFinite(corners)) {
            assembly.not_finite_count += 1;
            continue;
        }
        switch (class) {
            .smooth, .flat => try assembly.addFace(corners, class == .smooth, is_textured),
            .lines => try assembly.addLine(corners, is_textured),
            .points => for (corners) |corner| {
                const vertex = try assembly.vertexOf(corner, false, is_textured);
                try assembly.points.append(assembly.gpa, vertex);
            },
        }
    }
    if (class == .lines or class == .points)
        material = try assembly.materials.unlit(material);
    try assembly.finishMesh(material, class == .smooth, is_textured);
}

fn haveTexcoords(assembly: *const Assembly, order: []const u32) bool {
    for (order) |index| {
        for (assembly.cornersOf(&assembly.reader.elements.items[index])) |corner| {
            if (corner.texcoord != none) return true;
        }
    }
    return false;
}

fn areFinite(assembly: *const Assembly, corners: []const Reader.Corner) bool {
    for (corners) |corner| {
        if (!math.vec3.isFinite(assembly.reader.positions.items[corner.position])) return false;
    }
    return true;
}

/// The vertex where these meet, of what the mesh has.
fn vertexOf(
    assembly: *Assembly,
    corner: Reader.Corner,
    has_normals: bool,
    is_textured: bool,
) Allocator.Error!u32 {
    const key: Reader.Corner = .{
        .position = corner.position,
        .texcoord = if (is_textured) corner.texcoord else none,
        .normal = if (has_normals) corner.normal else none,
    };
    const vertex: u32 = @intCast(assembly.vertices.items.len);
    var link = &assembly.heads[key.position];
    for (0..chain_max) |_| {
        if (link.* == none) {
            link.* = vertex;
            break;
        }
        if (std.meta.eql(assembly.vertices.items[link.*], key)) return link.*;
        link = &assembly.nexts.items[link.*];
    } else {
        const entry = try assembly.known.getOrPut(assembly.gpa, key);
        if (entry.found_existing) return entry.value_ptr.*;
        entry.value_ptr.* = vertex;
    }
    try assembly.vertices.append(assembly.gpa, key);
    try assembly.nexts.append(assembly.gpa, none);
    if (is_textured and key.texcoord == none) assembly.bare_count += 1;
    return vertex;
}

fn addFace(
    assembly: *Assembly,
    corners: []const Reader.Corner,
    has_normals: bool,
    is_textured: bool,
) Allocator.Error!void {
    const gpa = assembly.gpa;
    assembly.face.clearRetainingCapacity();
    assembly.cut.clearRetainingCapacity();
    for (corners) |corner| {
        try assembly.face.append(gpa, assembly.reader.positions.items[corner.position]);
    }
    try assembly.cutter.cut(assembly.face.items, &assembly.cut);
    for (assembly.cut.items) |triangle| {
        var vertices: [3]u32 = undefined;
        for (&vertices, triangle) |*vertex, corner| {
            vertex.* = try assembly.vertexOf(corners[corner], has_normals, is_textured);
        }
        try assembly.triangles.append(gpa, vertices);
    }
}

fn addLine(
    assembly: *Assembly,
    corners: []const Reader.Corner,
    is_textured: bool,
) Allocator.Error!void {
    var before = try assembly.vertexOf(corners[0], false, is_textured);
    for (corners[1..]) |corner| {
        const vertex = try assembly.vertexOf(corner, false, is_textured);
        try assembly.segments.append(assembly.gpa, .{ before, vertex });
        before = vertex;
    }
}

/// Copies what has been collected into the scene.
fn finishMesh(
    assembly: *Assembly,
    material: u32,
    has_normals: bool,
    is_textured: bool,
) Resources.Error!void {
    const reader = assembly.reader;
    const arena = assembly.builder.arena();
    const vertices = assembly.vertices.items;
    if (vertices.len == 0) return;
    const positions = try arena.alloc(Vec3, vertices.len);
    const normals = if (has_normals) try arena.alloc(Vec3, vertices.len) else null;
    const texcoords = if (is_textured) try arena.alloc([2]f32, vertices.len) else null;
    const has_colors = reader.colors.items.len > 0;
    const colors = if (has_colors) try arena.alloc([4]f32, vertices.len) else null;
    for (vertices, 0..) |vertex, index| {
        positions[index] = reader.positions.items[vertex.position];
        if (normals) |all| all[index] = reader.normals.items[vertex.normal];
        if (texcoords) |all| all[index] = if (vertex.texcoord == none)
            .{ 0, 0 }
        else
            downwards(reader.texcoords.items[vertex.texcoord]);
        if (colors) |all| all[index] = linearColor(reader.colors.items, vertex.position);
    }
    const triangles = try arena.dupe([3]u32, assembly.triangles.items);
    if (normals) |all| orientation.orient(positions, all, triangles);
    try assembly.builder.addWorldMesh(.{
        .positions = positions,
        .normals = normals,
        .texcoords = .{ texcoords, null, null, null },
        .colors = colors,
        .triangles = triangles,
        .segments = try arena.dupe([2]u32, assembly.segments.items),
        .points = try arena.dupe(u32, assembly.points.items),
        .material = material,
    });
}

/// Coordinates as scenes have them.
fn downwards(texcoord: [2]f32) [2]f32 {
    return .{ texcoord[0], math.flushDenormal(1 - texcoord[1]) };
}

/// Of codes from 0 to 1, which are the display's; those behind the last colour are white.
fn linearColor(colors: []const Vec3, position: u32) [4]f32 {
    var color: [4]f32 = .{ 1, 1, 1, 1 };
    if (position >= colors.len) return color;
    for (color[0..3], colors[position]) |*channel, code| {
        const fraction = if (code > 0) @min(code, 1) else 0;
        channel.* = math.flushDenormal(@floatCast(math.srgb.linear(fraction)));
    }
    return color;
}
