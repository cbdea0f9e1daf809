//! glTF's meshes become lists of triangles, points or segments with one material each.
//!
//! In: primitives (glTF 2.0, section 3.7.2). Out: `scene.Mesh`es in the scene's memory, with the
//! texture coordinates and tangents that their material's textures need, and with the morph targets
//! and joints that drawn nodes use. A set of coordinates that is missing counts as 0, as it does in
//! other viewers. What several primitives share is decoded once. Every index has been compared with
//! the number of vertices, every number is finite; strips, fans and loops are taken apart (section
//! 3.7.2.1). Points and lines without normals are not lit (section 3.9.7).

const std = @import("std");
const c = @import("../cgltf.zig");
const math = @import("../../math.zig");
const scene = @import("../../scene.zig");
const accessors = @import("../accessor.zig");
const asset = @import("asset.zig");
const attributes = @import("attributes.zig");
const Materials = @import("materials.zig");
const Source = @import("source.zig");
const variants = @import("variants.zig");
const Accessor = accessors.Accessor;
const Error = Source.Error;
const Vec3 = math.Vec3;
const Meshes = @This();
const assert = std.debug.assert;

source: *Source,
materials: *Materials,
/// The variant of materials that is shown.
variant: ?u32,
/// Index in the scene of a glTF mesh's first primitive, and how many are drawn.
ranges: std.AutoHashMapUnmanaged(u32, Range) = .empty,
positions: std.AutoHashMapUnmanaged(u32, []const Vec3) = .empty,
normals: std.AutoHashMapUnmanaged(u32, []const Vec3) = .empty,
colors: std.AutoHashMapUnmanaged(u32, []const [4]f32) = .empty,
texcoords: std.AutoHashMapUnmanaged(u32, []const [2]f32) = .empty,
tangents: std.AutoHashMapUnmanaged(u32, []const [4]f32) = .empty,
/// Of morph targets.
color_deltas: std.AutoHashMapUnmanaged(u32, []const [4]f32) = .empty,
joints: std.AutoHashMapUnmanaged(JointAccessors, Joints) = .empty,
triangles: std.AutoHashMapUnmanaged(Connection, []const [3]u32) = .empty,
segments: std.AutoHashMapUnmanaged(Connection, []const [2]u32) = .empty,
points: std.AutoHashMapUnmanaged(Connection, []const u32) = .empty,
/// Of positions: the vertices that are not finite, where there are any.
nowhere: std.AutoHashMapUnmanaged(u32, []const u32) = .empty,
/// Whether a mesh without the coordinates of its textures has been met.
coordinates_missed: bool = false,

/// Meshes `first..first + count` of the scene, and the largest number of a joint that moves them.
pub const Range = struct { first: u32, count: u32, joint_max: u32 };

/// What drawn nodes ask of a mesh besides its triangles.
pub const Deformation = struct {
    /// By morph target: whether one gives it a weight; empty: none has.
    targets: []bool = &.{},
    has_skin: bool = false,
};

/// By set: the accessors of joints and weights, or `scene.none`.
const JointAccessors = [scene.joint_set_count][2]u32;

/// What the vertices of a mesh hang on.
const Joints = struct { sets: []const scene.JointSet, largest: u32 };

/// What determines a list of triangles, segments or points.
const Connection = struct {
    /// The accessor of the indices, or `scene.none`.
    indices: u32,
    vertex_count: u32,
    mode: Mode,
};

/// How vertices follow one another.
const Mode = enum {
    points,
    lines,
    line_loop,
    line_strip,
    triangles,
    strip,
    fan,

    /// Null: what glTF does not know.
    fn of(primitive: *const c.cgltf_primitive) ?Mode {
        return switch (primitive.type) {
            .points => .points,
            .lines => .lines,
            .line_loop => .line_loop,
            .line_strip => .line_strip,
            .triangles => .triangles,
            .triangle_strip => .strip,
            .triangle_fan => .fan,
            else => null,
        };
    }

    /// Vertices of each element: a corner, an end or a point.
    fn size(mode: Mode) u32 {
        return switch (mode) {
            .points => 1,
            .lines, .line_loop, .line_strip => 2,
            .triangles, .strip, .fan => 3,
        };
    }

    /// What the elements are called in messages.
    fn name(mode: Mode) []const u8 {
        return switch (mode.size()) {
            1 => "points",
            2 => "lines",
            else => "triangles",
        };
    }

    /// Elements of so many vertices.
    fn count(mode: Mode, vertex_count: u32) u32 {
        return switch (mode) {
            .points => vertex_count,
            .lines => vertex_count / 2,
            // Two vertices are joined but once.
            .line_loop => if (vertex_count > 2) vertex_count else vertex_count -| 1,
            .line_strip => vertex_count -| 1,
            .triangles => vertex_count / 3,
            .strip, .fan => vertex_count -| 2,
        };
    }

    /// Whether an index can begin it anew.
    fn restarts(mode: Mode) bool {
        return switch (mode) {
            .line_loop, .line_strip, .strip, .fan => true,
            .points, .lines, .triangles => false,
        };
    }

    /// Whether vertices are left over.
    fn leavesRest(mode: Mode, vertex_count: u32) bool {
        if (vertex_count < mode.size()) return true;
        return switch (mode) {
            .lines, .triangles => vertex_count % mode.size() != 0,
            else => false,
        };
    }
};

/// Frees what is not the scene's.
pub fn deinit(meshes: *Meshes) void {
    const gpa = meshes.source.gpa;
    inline for (.{
        "ranges",   "positions",    "normals", "colors",    "texcoords",
        "tangents", "color_deltas", "joints",  "triangles", "segments",
        "points",   "nowhere",
    }) |name| @field(meshes, name).deinit(gpa);
    meshes.* = undefined;
}

/// The scene's meshes of the glTF mesh with this index, decoded at the first call with what all
/// drawn nodes ask for.
pub fn get(meshes: *Meshes, mesh_index: u32, deformation: Deformation) Error!Range {
    const gpa = meshes.source.gpa;
    if (meshes.ranges.get(mesh_index)) |range| return range;
    try meshes.source.need(.meshes, mesh_index);
    const mesh = Source.item(meshes.source.data.meshes, mesh_index);
    const builder = meshes.source.builder;
    const first: u32 = @intCast(builder.meshes.items.len);
    var range: Range = .{ .first = first, .count = 0, .joint_max = 0 };
    if (mesh.primitives_count == 0)
        meshes.source.forgive("mesh {d}: has no primitives", .{mesh_index});
    for (Source.slice(mesh.primitives, mesh.primitives_count), 0..) |*primitive, index| {
        const place: Place = .{ .mesh = mesh_index, .primitive = @intCast(index) };
        const decoded = meshes.decode(primitive, place) catch |err| {
            if (err == error.OutOfMemory or !meshes.source.force) return err;
            try meshes.source.excuse(err);
            continue;
        } orelse continue;
        const index_of = try builder.addMesh(decoded.mesh);
        const drawn = &builder.meshes.items[index_of];
        drawn.origin = place.mesh;
        drawn.primitive = place.primitive;
        drawn.morph_targets =
            try meshes.decodeTargets(drawn, primitive, deformation.targets, place);
        if (deformation.has_skin) {
            const joints = try meshes.decodeJoints(primitive, &decoded.used, place);
            drawn.joint_sets = joints.sets;
            range.joint_max = @max(range.joint_max, joints.largest);
        }
        const vertex_count = decoded.used.vertex_count;
        try attributes.checkRest(meshes.source, primitive, vertex_count, place);
    }
    range.count = @intCast(builder.meshes.items.len - first);
    try meshes.ranges.put(gpa, mesh_index, range);
    return range;
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

/// A mesh as it is modelled, and what it was made of.
const Decoded = struct { mesh: scene.Mesh, used: attributes.Used };

fn decode(meshes: *Meshes, primitive: *const c.cgltf_primitive, place: Place) Error!?Decoded {
    const source = meshes.source;
    const named = Mode.of(primitive) orelse return source.fail("{f}: unknown mode", .{place});
    if (try attributes.isEmpty(source, primitive)) {
        source.forgive("{f}: its vertices or indices are empty, not drawn", .{place});
        return null;
    }
    const used = try attributes.find(source, primitive, place);
    const mode: Mode = if (used.is_draco) .triangles else named;
    const position = used.position orelse {
        source.forgive("{f}: without POSITION, not drawn", .{place});
        return null;
    };
    var mesh: scene.Mesh = .{
        .positions = try meshes.decodePositions(position),
        .normals = if (used.normal) |index|
            try meshes.directions(index, "normals")
        else
            null,
        .colors = if (used.color) |index| try meshes.decodeColors(index) else null,
        .triangles = &.{},
        .material = variants.materialOf(source, primitive, meshes.variant) orelse
            try meshes.materials.useDefault(),
    };
    try meshes.connect(&mesh, primitive, mode, place);
    if (mesh.isEmpty()) return null;
    if (meshes.nowhere.get(position)) |vertices| {
        try checkPlaces(source, &mesh, position, vertices);
    }
    if (mesh.normals == null and mode.size() < 3) {
        mesh.material = try meshes.materials.useUnlit(mesh.material, mesh.colors != null);
    }
    try meshes.decodeForTextures(&mesh, primitive, &used, place);
    return .{ .mesh = mesh, .used = used };
}

/// What the textures of its material need of a mesh, and no more.
fn decodeForTextures(
    meshes: *Meshes,
    mesh: *scene.Mesh,
    primitive: *const c.cgltf_primitive,
    used: *const attributes.Used,
    place: Place,
) Error!void {
    const material = try meshes.materials.use(mesh.material);
    inline for (scene.texture_fields) |field| if (@field(material, field)) |view| {
        const set = view.texcoord_set;
        if (mesh.texcoords[set] == null) {
            if (used.texcoords[set]) |index| {
                mesh.texcoords[set] =
                    try meshes.decodeTexcoords(primitive, index, used, place);
            } else if (!meshes.coordinates_missed) {
                meshes.coordinates_missed = true;
                meshes.source.forgive(
                    "{f}: without TEXCOORD_{d}, where its material's textures look: taken as 0",
                    .{ place, set },
                );
            }
        }
    };
    try meshes.decodeForTangents(mesh, primitive, used, material, place);
}

/// What bends normals, or has a direction along the surface, needs tangents, or coordinates to make
/// them of; without these it counts for nothing.
fn decodeForTangents(
    meshes: *Meshes,
    mesh: *scene.Mesh,
    primitive: *const c.cgltf_primitive,
    used: *const attributes.Used,
    material: *const scene.Material,
    place: Place,
) Error!void {
    var lacks: Materials.Lacks = .{};
    var needed = false;
    inline for (.{ "normal_texture", "clearcoat_normal_texture" }) |field| {
        if (@field(material, field)) |view| {
            if (mesh.texcoords[view.texcoord_set] == null)
                @field(lacks, field) = true
            else
                needed = true;
        }
    }
    const has_tangents = mesh.normals != null and used.tangent != null; // See below.
    if (material.anisotropy > 0 or material.in_motion and material.anisotropy_texture != null) {
        const set = if (material.anisotropy_texture) |view| view.texcoord_set else 0;
        if (!needed and !has_tangents) if (used.texcoords[set]) |index| {
            mesh.texcoords[set] = try meshes.decodeTexcoords(primitive, index, used, place);
        };
        lacks.anisotropy = !needed and !has_tangents and mesh.texcoords[set] == null;
        if (!lacks.anisotropy) needed = true;
    }
    if (lacks.any()) mesh.material = try meshes.materials.useWithout(mesh.material, lacks);
    // Tangents of a mesh without normals count for nothing (glTF 2.0, section 3.7.2.1).
    if (!needed or !has_tangents) return;
    const index = used.tangent.?;
    try attributes.check(meshes.source, primitive, index, used.vertex_count, place);
    mesh.tangents = try meshes.decodeTangents(index);
}

fn decodeTexcoords(
    meshes: *Meshes,
    primitive: *const c.cgltf_primitive,
    index: u32,
    used: *const attributes.Used,
    place: Place,
) Error![]const [2]f32 {
    try attributes.check(meshes.source, primitive, index, used.vertex_count, place);
    return meshes.floats(2, &meshes.texcoords, index, "texture coordinates");
}

/// Positions, finite ones in the place of those that are not; see `nowhere`.
fn decodePositions(meshes: *Meshes, index: u32) Error![]const Vec3 {
    if (meshes.positions.get(index)) |known| return known;
    const source = meshes.source;
    const accessor = try attributes.required(source, index);
    try source.charge(@as(u64, accessor.count) * @sizeOf(Vec3));
    const positions = try source.arena.alloc(Vec3, accessor.count);
    if (accessors.decodeFloats(3, accessor, positions) != null) {
        var vertices: std.ArrayList(u32) = .empty;
        var other: Vec3 = .{ 0, 0, 0 };
        for (positions, 0..) |position, vertex| {
            if (allFinite(3, position))
                other = position
            else
                try vertices.append(source.arena, @intCast(vertex));
        }
        for (vertices.items) |vertex| positions[vertex] = other;
        try meshes.nowhere.put(source.gpa, index, vertices.items);
    }
    try meshes.positions.put(source.gpa, index, positions);
    return positions;
}

/// Vertices that are nowhere do no harm as long as nothing has a corner there.
fn checkPlaces(
    source: *const Source,
    mesh: *const scene.Mesh,
    position: u32,
    vertices: []const u32,
) Error!void {
    const lists = [_][]const u32{
        @ptrCast(mesh.triangles), @ptrCast(mesh.segments), mesh.points,
    };
    for (lists) |list| for (list) |vertex| {
        const found = std.sort.binarySearch(u32, vertices, vertex, orderOf) orelse continue;
        return source.fail("accessor {d}: element {d} is not finite", .{
            position, vertices[found],
        });
    };
    source.forgive("accessor {d}: {d} positions are not finite; nothing drawn needs them", .{
        position, vertices.len,
    });
}

fn orderOf(wanted: u32, vertex: u32) std.math.Order {
    return std.math.order(wanted, vertex);
}

fn allFinite(comptime width: u8, element: [width]f32) bool {
    for (element) |value| if (!std.math.isFinite(value)) return false;
    return true;
}

/// What is not finite becomes 0: no normal, a corner of the texture, no change.
fn floats(
    meshes: *Meshes,
    comptime width: u8,
    cache: *std.AutoHashMapUnmanaged(u32, []const [width]f32),
    index: u32,
    what: []const u8,
) Error![]const [width]f32 {
    if (cache.get(index)) |known| return known;
    const accessor = try attributes.required(meshes.source, index);
    return meshes.decodeFloats(width, cache, index, accessor, what);
}

/// Normals, and what morph targets add to them and to tangents.
fn directions(meshes: *Meshes, index: u32, what: []const u8) Error![]const Vec3 {
    if (meshes.normals.get(index)) |known| return known;
    const accessor = try attributes.directions(meshes.source, index);
    return meshes.decodeFloats(3, &meshes.normals, index, accessor, what);
}

fn decodeFloats(
    meshes: *Meshes,
    comptime width: u8,
    cache: *std.AutoHashMapUnmanaged(u32, []const [width]f32),
    index: u32,
    accessor: Accessor,
    what: []const u8,
) Error![]const [width]f32 {
    const source = meshes.source;
    try source.charge(@as(u64, accessor.count) * @sizeOf([width]f32));
    const out = try source.arena.alloc([width]f32, accessor.count);
    if (accessors.decodeFloats(width, accessor, out) != null)
        tameAll(width, source, index, out, @splat(0), what);
    try cache.put(source.gpa, index, out);
    return out;
}

/// Puts something in the place of elements that are not finite.
fn tameAll(
    comptime width: u8,
    source: *const Source,
    index: u32,
    elements_of: [][width]f32,
    other: [width]f32,
    what: []const u8,
) void {
    var count: usize = 0;
    for (elements_of) |*element| {
        if (allFinite(width, element.*)) continue;
        element.* = other;
        count += 1;
    }
    source.forgive("accessor {d}: {d} of {d} {s} are not finite, left out", .{
        index, count, elements_of.len, what,
    });
}

/// Tangents whose fourth number is 1 or -1; null where they are not finite, for they can be made.
fn decodeTangents(meshes: *Meshes, index: u32) Error!?[]const [4]f32 {
    if (meshes.tangents.get(index)) |known| return known;
    const source = meshes.source;
    const accessor = try attributes.directions(source, index);
    try source.charge(@as(u64, accessor.count) * @sizeOf([4]f32));
    const tangents = try source.arena.alloc([4]f32, accessor.count);
    if (accessors.decodeFloats(4, accessor, tangents) != null) {
        source.forgive("accessor {d}: tangents are not finite, made anew", .{index});
        return null;
    }
    for (tangents) |*tangent| tangent[3] = if (tangent[3] < 0) -1 else 1;
    try meshes.tangents.put(source.gpa, index, tangents);
    return tangents;
}

/// Colours as RGBA, none below 0 and no alpha above 1.
fn decodeColors(meshes: *Meshes, index: u32) Error![]const [4]f32 {
    if (meshes.colors.get(index)) |known| return known;
    const source = meshes.source;
    const colors = try meshes.decodeRgba(index, 1, @splat(1));
    if (clampColors(colors)) {
        source.forgive("accessor {d}: colours out of range are clamped", .{index});
    }
    try meshes.colors.put(source.gpa, index, colors);
    return colors;
}

/// Colours as RGBA, with this alpha where the file has none, `other` where they are not finite.
fn decodeRgba(
    meshes: *Meshes,
    index: u32,
    missing_alpha: f32,
    other: [4]f32,
) Error![][4]f32 {
    const source = meshes.source;
    const accessor = try attributes.colors(source, index);
    try source.charge(@as(u64, accessor.count) * @sizeOf([4]f32));
    const colors = try source.arena.alloc([4]f32, accessor.count);
    const not_finite = if (accessor.component_count == 4)
        accessors.decodeFloats(4, accessor, colors)
    else not_finite: {
        const opaque_colors = try source.gpa.alloc([3]f32, accessor.count);
        defer source.gpa.free(opaque_colors);
        const first = accessors.decodeFloats(3, accessor, opaque_colors);
        for (colors, opaque_colors) |*color, rgb| color.* = rgb ++ [1]f32{missing_alpha};
        break :not_finite first;
    };
    if (not_finite != null) tameAll(4, source, index, colors, other, "colours");
    return colors;
}

/// Of the morph targets that have weights, what the mesh has as well; the others add nothing.
fn decodeTargets(
    meshes: *Meshes,
    mesh: *const scene.Mesh,
    primitive: *const c.cgltf_primitive,
    weighted: []const bool,
    place: Place,
) Error![]const scene.MorphTarget {
    if (weighted.len == 0) return &.{};
    const source = meshes.source;
    try source.charge(@as(u64, weighted.len) * @sizeOf(scene.MorphTarget));
    const targets = try source.arena.alloc(scene.MorphTarget, weighted.len);
    const raw_targets = Source.slice(primitive.targets, primitive.targets_count);
    for (targets, raw_targets, weighted) |*target, *raw, is_weighted| {
        target.* = .{};
        if (!is_weighted) continue;
        const vertex_count: u32 = @intCast(mesh.positions.len);
        const used = try attributes.ofTarget(source, raw, vertex_count, place);
        if (used.position) |index| {
            target.positions = try meshes.decodePositions(index);
            if (meshes.nowhere.get(index)) |vertices|
                try checkPlaces(source, mesh, index, vertices);
        }
        if (mesh.normals != null) if (used.normal) |index| {
            target.normals = try meshes.directions(index, "normals");
        };
        if (mesh.tangents != null) if (used.tangent) |index| {
            target.tangents = try meshes.directions(index, "tangents");
        };
        if (mesh.colors != null) if (used.color) |index| {
            target.colors = try meshes.decodeColorDeltas(index);
        };
        for (&target.texcoords, mesh.texcoords, used.texcoords) |*to, set, accessor| {
            if (set != null) if (accessor) |index| {
                to.* = try meshes.floats(2, &meshes.texcoords, index, "texture coordinates");
            };
        }
    }
    return targets;
}

fn decodeColorDeltas(meshes: *Meshes, index: u32) Error![]const [4]f32 {
    if (meshes.color_deltas.get(index)) |known| return known;
    const deltas = try meshes.decodeRgba(index, 0, @splat(0));
    try meshes.color_deltas.put(meshes.source.gpa, index, deltas);
    return deltas;
}

/// The joints of a primitive's vertices, none with a warning where it has none.
fn decodeJoints(
    meshes: *Meshes,
    primitive: *const c.cgltf_primitive,
    used: *const attributes.Used,
    place: Place,
) Error!Joints {
    const source = meshes.source;
    if (used.has_more_joints) source.warn(
        "{f}: more than {d} joints a vertex, the rest is left out",
        .{ place, 4 * scene.joint_set_count },
    );
    var key: JointAccessors = @splat(@splat(scene.none));
    var count: usize = 0;
    for (used.joints, used.weights, 0..) |joints, weights, set| {
        if (joints != null and weights != null) {
            key[count] = .{ joints.?, weights.? };
            for (key[count]) |index| {
                try attributes.check(source, primitive, index, used.vertex_count, place);
            }
            count += 1;
        } else if (joints != null or weights != null) source.forgive(
            "{f}: JOINTS_{d} or WEIGHTS_{d} stands alone, and is left out",
            .{ place, set, set },
        );
    }
    if (count == 0) {
        source.forgive("{f}: has a skin but no joints, its node places it", .{place});
        return .{ .sets = &.{}, .largest = 0 };
    }
    if (meshes.joints.get(key)) |known| return known;
    try source.charge(@as(u64, used.vertex_count) * count * (@sizeOf([4]u16) + @sizeOf([4]f32)));
    var joints: [scene.joint_set_count][][4]u16 = undefined;
    var weights: [scene.joint_set_count][][4]f32 = undefined;
    const sets = try source.arena.alloc(scene.JointSet, count);
    for (sets, joints[0..count], weights[0..count], key[0..count]) |*set, *numbers, *of, pair| {
        numbers.* = try decodeJointNumbers(source, pair[0]);
        of.* = try decodeJointWeights(source, pair[1]);
        set.* = .{ .joints = numbers.*, .weights = of.* };
    }
    const largest = tidyJoints(joints[0..count], weights[0..count]);
    const decoded: Joints = .{ .sets = sets, .largest = largest };
    try meshes.joints.put(source.gpa, key, decoded);
    return decoded;
}

fn decodeJointNumbers(source: *Source, index: u32) Error![][4]u16 {
    var accessor = try attributes.required(source, index);
    accessor.normalized = false; // 16 bits are exact in a float.
    const numbers = try source.gpa.alloc([4]f32, accessor.count);
    defer source.gpa.free(numbers);
    assert(accessors.decodeFloats(4, accessor, numbers) == null);
    const joints = try source.arena.alloc([4]u16, accessor.count);
    for (joints, numbers) |*to, from| {
        for (to, from) |*joint, number_of| joint.* = @intFromFloat(number_of);
    }
    return joints;
}

/// None below 0, with a warning where there was one.
fn decodeJointWeights(source: *Source, index: u32) Error![][4]f32 {
    const accessor = try attributes.required(source, index);
    const weights = try source.arena.alloc([4]f32, accessor.count);
    if (accessors.decodeFloats(4, accessor, weights) != null)
        tameAll(4, source, index, weights, @splat(0), "weights");
    var clamped = false;
    for (weights) |*four| for (four) |*weight| if (weight.* < 0) {
        weight.* = 0;
        clamped = true;
    };
    if (clamped) source.forgive("accessor {d}: weights below 0 are taken as 0", .{index});
    return weights;
}

/// Makes joints without weight joint 0, and vertices without any weight their first joint's.
/// Returns the largest number of a joint that counts.
fn tidyJoints(joints: []const [][4]u16, weights: []const [][4]f32) u32 {
    var largest: u32 = 0;
    for (0..joints[0].len) |vertex| {
        var has_weight = false;
        for (weights) |set| for (&set[vertex]) |*weight| {
            // As they count where vertices are placed: those alone would sum up to nothing.
            weight.* = math.flushDenormal(weight.*);
            if (weight.* > 0) has_weight = true;
        };
        if (!has_weight) weights[0][vertex][0] = 1;
        for (joints, weights) |numbers, set| {
            for (&numbers[vertex], set[vertex]) |*joint, weight| {
                if (!(weight > 0)) joint.* = 0;
                largest = @max(largest, joint.*);
            }
        }
    }
    return largest;
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

/// Gives a mesh the elements of a primitive, every index below the number of its vertices.
fn connect(
    meshes: *Meshes,
    mesh: *scene.Mesh,
    primitive: *const c.cgltf_primitive,
    mode: Mode,
    place: Place,
) Error!void {
    const connection: Connection = .{
        .indices = if (primitive.indices) |indices|
            Source.indexOf(meshes.source.data.accessors, indices)
        else
            scene.none,
        .vertex_count = @intCast(mesh.positions.len),
        .mode = mode,
    };
    switch (mode.size()) {
        1 => mesh.points = try meshes.elements(u32, &meshes.points, connection, place),
        2 => mesh.segments = try meshes.elements([2]u32, &meshes.segments, connection, place),
        else => mesh.triangles = try meshes.elements([3]u32, &meshes.triangles, connection, place),
    }
}

fn elements(
    meshes: *Meshes,
    comptime Element: type,
    cache: *std.AutoHashMapUnmanaged(Connection, []const Element),
    connection: Connection,
    place: Place,
) Error![]const Element {
    const source = meshes.source;
    if (cache.get(connection)) |known| return known;
    const accessor: ?Accessor = if (connection.indices != scene.none)
        try attributes.indices(source, connection.indices)
    else
        null;
    const count = if (accessor) |indexed| indexed.count else connection.vertex_count;
    const mode = connection.mode;
    if (mode.leavesRest(count)) source.forgive(
        "{f}: {d} vertices do not make whole {s}, the rest is left out",
        .{ place, count, mode.name() },
    );
    const element_count = mode.count(count);
    try source.charge(@as(u64, element_count) * @sizeOf(Element));
    var list = try source.arena.alloc(Element, element_count);
    const is_whole = switch (mode) {
        .points, .lines, .triangles => !mode.leavesRest(count),
        else => false,
    };
    if (is_whole) {
        _ = try number(source, connection, accessor, @ptrCast(list));
    } else {
        const vertices = try source.gpa.alloc(u32, count);
        defer source.gpa.free(vertices);
        const restart = try number(source, connection, accessor, vertices);
        list = list[0..takeApart(Element, mode, vertices, restart, list)];
    }
    try cache.put(source.gpa, connection, list);
    return list;
}

/// The index that no vertex has: the largest of its type (glTF 2.0, section 3.7.2.1).
fn restartIndex(accessor: Accessor) u32 {
    return switch (accessor.component) {
        .u8 => std.math.maxInt(u8),
        .u16 => std.math.maxInt(u16),
        else => std.math.maxInt(u32),
    };
}

/// Makes elements of vertices, anew behind each that is `restart`. Returns how many there are.
fn takeApart(
    comptime Element: type,
    mode: Mode,
    vertices: []const u32,
    restart: ?u32,
    list: []Element,
) usize {
    var length: usize = 0;
    var rest = vertices;
    while (rest.len > 0) {
        const end = if (restart) |wanted|
            std.mem.findScalar(u32, rest, wanted) orelse rest.len
        else
            rest.len;
        const run = rest[0..end];
        const part = list[length..][0..mode.count(@intCast(run.len))];
        switch (Element) {
            u32 => @memcpy(part, run),
            [2]u32 => join(mode, run, part),
            else => assemble(mode, run, part),
        }
        length += part.len;
        rest = rest[@min(end + 1, rest.len)..];
    }
    return length;
}

/// The vertices of a primitive in the order of the file. Returns the index behind which strips
/// begin anew, if there is one (KHR_mesh_primitive_restart; the core has none).
fn number(
    source: *const Source,
    connection: Connection,
    accessor: ?Accessor,
    vertices: []u32,
) Error!?u32 {
    const indexed = accessor orelse {
        for (vertices, 0..) |*vertex, index| vertex.* = @intCast(index);
        return null;
    };
    var largest = accessors.decodeIndices(indexed, vertices);
    if (largest < connection.vertex_count) return null;
    const restart = restartIndex(indexed);
    if (largest == restart and connection.mode.restarts()) {
        largest = 0;
        for (vertices) |vertex| if (vertex != restart) {
            largest = @max(largest, vertex);
        };
        if (largest < connection.vertex_count) {
            if (!asset.uses(source, "KHR_mesh_primitive_restart")) source.forgive(
                "accessor {d}: the index {d} is no vertex, what is drawn begins anew there",
                .{ connection.indices, restart },
            );
            return restart;
        }
    }
    return source.fail("accessor {d}: index {d} with {d} vertices", .{
        connection.indices, largest, connection.vertex_count,
    });
}

/// The last segment of a loop goes back to the first vertex.
fn join(mode: Mode, vertices: []const u32, segments: [][2]u32) void {
    for (segments, 0..) |*segment, index| segment.* = switch (mode) {
        .lines => vertices[2 * index ..][0..2].*,
        else => .{ vertices[index], vertices[(index + 1) % vertices.len] },
    };
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
        .points, .lines, .line_loop, .line_strip => unreachable, // No triangles.
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

test tidyJoints {
    var first = [_][4]u16{ .{ 5, 6, 9, 9 }, .{ 7, 9, 9, 9 }, .{ 9, 9, 9, 9 } };
    var second = [_][4]u16{ .{ 1, 9, 9, 9 }, .{ 9, 9, 9, 9 }, .{ 9, 9, 8, 9 } };
    var first_weights = [_][4]f32{ .{ 0.5, 0.25, 0, 0 }, @splat(0), @splat(0) };
    var second_weights = [_][4]f32{ .{ 0.5, 0, 0, 0 }, .{ 1e-40, 0, 0, 0 }, .{ 0, 0, 0.5, 0 } };
    try std.testing.expectEqual(8, tidyJoints(&.{ &first, &second }, &.{
        &first_weights, &second_weights,
    }));
    try std.testing.expectEqual([3][4]u16{ .{ 5, 6, 0, 0 }, .{ 7, 0, 0, 0 }, @splat(0) }, first);
    try std.testing.expectEqual([3][4]u16{ .{ 1, 0, 0, 0 }, @splat(0), .{ 0, 0, 8, 0 } }, second);
    // The one without any that counts hangs on its first joint.
    try std.testing.expectEqual([4]f32{ 1, 0, 0, 0 }, first_weights[1]);
    try std.testing.expectEqual([4]f32{ 0, 0, 0, 0 }, second_weights[1]);
    try std.testing.expectEqual([4]f32{ 0, 0, 0, 0 }, first_weights[2]);
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

test takeApart {
    const rest = 0xffff;
    const vertices = [_]u32{ rest, 0, 1, 2, 3, rest, rest, 4, 5, rest, 6, 7, 8 };
    var triangles: [11][3]u32 = undefined;
    const expected = [_][3]u32{ .{ 0, 1, 2 }, .{ 1, 3, 2 }, .{ 6, 7, 8 } };
    const count = takeApart([3]u32, .strip, &vertices, rest, &triangles);
    try std.testing.expectEqualSlices([3]u32, &expected, triangles[0..count]);
    var segments: [13][2]u32 = undefined;
    const loops = takeApart([2]u32, .line_loop, &vertices, rest, &segments);
    const wanted = [_][2]u32{
        .{ 0, 1 }, .{ 1, 2 }, .{ 2, 3 }, .{ 3, 0 },
        .{ 4, 5 }, .{ 6, 7 }, .{ 7, 8 }, .{ 8, 6 },
    };
    try std.testing.expectEqualSlices([2]u32, &wanted, segments[0..loops]);
    const whole = takeApart([2]u32, .line_strip, vertices[1..5], null, &segments);
    try std.testing.expectEqualSlices([2]u32, wanted[0..3], segments[0..whole]);
}

test join {
    const vertices = [_]u32{ 7, 8, 9, 10, 11 };
    var segments: [5][2]u32 = undefined;
    join(.line_loop, &vertices, &segments);
    const loop: [5][2]u32 = .{ .{ 7, 8 }, .{ 8, 9 }, .{ 9, 10 }, .{ 10, 11 }, .{ 11, 7 } };
    try std.testing.expectEqual(loop, segments);
    join(.line_strip, &vertices, segments[0..Mode.count(.line_strip, 5)]);
    try std.testing.expectEqual(loop[0..4].*, segments[0..4].*);
    join(.lines, &vertices, segments[0..Mode.count(.lines, 5)]);
    try std.testing.expectEqual([2][2]u32{ .{ 7, 8 }, .{ 9, 10 } }, segments[0..2].*);
}

test Mode {
    const Case = struct { mode: Mode, counts: [4]u32, rests: [4]bool };
    for ([_]Case{
        .{ .mode = .points, .counts = .{ 0, 1, 2, 3 }, .rests = .{ true, false, false, false } },
        .{ .mode = .lines, .counts = .{ 0, 0, 1, 1 }, .rests = .{ true, true, false, true } },
        .{ .mode = .line_loop, .counts = .{ 0, 0, 1, 3 }, .rests = .{ true, true, false, false } },
        .{ .mode = .line_strip, .counts = .{ 0, 0, 1, 2 }, .rests = .{ true, true, false, false } },
        .{ .mode = .fan, .counts = .{ 0, 0, 0, 1 }, .rests = .{ true, true, true, false } },
    }) |case| for (case.counts, case.rests, 0..) |count, rest, vertex_count| {
        try std.testing.expectEqual(count, case.mode.count(@intCast(vertex_count)));
        try std.testing.expectEqual(rest, case.mode.leavesRest(@intCast(vertex_count)));
    };
}
