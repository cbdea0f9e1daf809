//! Tangents for meshes that bring none and whose material needs them: for normals from textures, of
//! a coat as well, and for anisotropy (glTF 2.0, section 3.7.2.1), made once of a scene.
//!
//! In: a mesh, and its texture coordinates that count. Out: the mesh with tangents by MikkTSpace.
//! They belong to corners: a vertex whose corners differ in them becomes several, all at the very
//! same place, so that surfaces stay closed. The texture's transform turns tangents as it turns
//! texture coordinates. Meshes are done by all threads, each on its own.

const std = @import("std");
const math = @import("../math.zig");
const mikktspace = @import("mikktspace.zig");
const parallel = @import("../parallel.zig");
const scene = @import("../scene.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const TangentSource = @import("texture_use.zig").TangentSource;
const TextureSet = @import("texture.zig").TextureSet;
const assert = std.debug.assert;
const vec3 = math.vec3;
const Allocator = std.mem.Allocator;
const Mesh = scene.Mesh;
const Vec3 = math.Vec3;

pub const Error = error{OutOfMemory} || parallel.Error;

/// The scene's meshes, those of `instances` with the tangents that they need. New arrays come from
/// `arena`, what is needed meanwhile from `gpa`; threads share both.
pub fn make(
    gpa: Allocator,
    arena: Allocator,
    from: *const scene.Scene,
    instances: []const scene.Instance,
    textures: *const TextureSet,
    pool: *parallel.Pool,
    diagnostic: *Diagnostic,
) Error![]const Mesh {
    var work: Work = .{ .gpa = gpa, .arena = arena, .meshes = &.{}, .textures = textures };
    defer work.tasks.deinit(gpa);
    try work.collect(from, instances);
    if (work.tasks.items.len == 0) return from.meshes;
    work.meshes = try arena.dupe(Mesh, from.meshes);
    try pool.forEach(work.tasks.items.len, &work, Work.run);
    if (work.exhausted.load(.monotonic)) return error.OutOfMemory;
    const unsuitable_count = work.unsuitable_count.load(.monotonic);
    if (unsuitable_count > 0) diagnostic.warn(
        "{d} meshes without tangents are shown without their normal texture: too many corners " ++
            "at one place, or numbers too large, for tangents to be made",
        .{unsuitable_count},
    );
    return work.meshes;
}

/// Shared by the threads.
const Work = struct {
    gpa: Allocator,
    arena: Allocator,
    meshes: []Mesh,
    textures: *const TextureSet,
    /// Meshes to make tangents for.
    tasks: std.ArrayList(u32) = .empty,
    exhausted: std.atomic.Value(bool) = .init(false),
    unsuitable_count: std.atomic.Value(u32) = .init(0),

    fn collect(
        work: *Work,
        from: *const scene.Scene,
        instances: []const scene.Instance,
    ) error{OutOfMemory}!void {
        const is_listed = try work.gpa.alloc(bool, from.meshes.len);
        defer work.gpa.free(is_listed);
        @memset(is_listed, false);
        for (instances) |instance| {
            const mesh = &from.meshes[instance.mesh];
            if (is_listed[instance.mesh] or mesh.tangents != null) continue;
            const coordinates = work.textures.materials[mesh.material].tangents orelse continue;
            const has_none = mesh.texcoords[coordinates.texcoord_set] == null;
            if (mesh.triangles.len == 0 or has_none) continue;
            is_listed[instance.mesh] = true;
            try work.tasks.append(work.gpa, instance.mesh);
        }
    }

    fn run(work: *Work, index: usize, _: usize) void {
        if (work.exhausted.load(.monotonic)) return;
        const mesh = &work.meshes[work.tasks.items[index]];
        const coordinates = &work.textures.materials[mesh.material].tangents.?;
        mesh.* = withTangents(work.gpa, work.arena, mesh, coordinates) catch |err| switch (err) {
            error.OutOfMemory => return work.exhausted.store(true, .monotonic),
            error.Unsuitable => {
                _ = work.unsuitable_count.fetchAdd(1, .monotonic);
                return;
            },
        };
    }
};

/// A mesh of the same triangles with tangents.
fn withTangents(
    gpa: Allocator,
    arena: Allocator,
    mesh: *const Mesh,
    coordinates: *const TangentSource,
) mikktspace.Error!Mesh {
    var scratch_state: std.heap.ArenaAllocator = .init(gpa);
    defer scratch_state.deinit();
    const scratch = scratch_state.allocator();
    const tangents = try scratch.alloc([3][4]f32, mesh.triangles.len);
    const input = if (mesh.normals != null)
        try smoothInput(scratch, mesh, coordinates)
    else
        try flatInput(scratch, mesh, coordinates);
    try mikktspace.compute(gpa, input, tangents);
    return split(scratch, arena, mesh, tangents);
}

/// The mesh as it is, its normals of unit length.
fn smoothInput(
    scratch: Allocator,
    mesh: *const Mesh,
    coordinates: *const TangentSource,
) error{OutOfMemory}!mikktspace.Mesh {
    const normals = try scratch.dupe(Vec3, mesh.normals.?);
    const texcoords = try scratch.dupe([2]f32, mesh.texcoords[coordinates.texcoord_set].?);
    for (mesh.triangles) |triangle| for (triangle) |vertex| {
        // Where there is none the triangle's own is seen.
        normals[vertex] = vec3.normalize(mesh.normals.?[vertex]) orelse faceNormal(mesh, triangle);
        texcoords[vertex] = transformed(mesh, coordinates, vertex);
    };
    return .{
        .triangles = mesh.triangles,
        .positions = mesh.positions,
        .normals = normals,
        .texcoords = texcoords,
    };
}

/// Triangles with three vertices of their own each, for they have a normal of their own each.
fn flatInput(
    scratch: Allocator,
    mesh: *const Mesh,
    coordinates: *const TangentSource,
) error{OutOfMemory}!mikktspace.Mesh {
    const count = 3 * mesh.triangles.len;
    const triangles = try scratch.alloc([3]u32, mesh.triangles.len);
    const positions = try scratch.alloc(Vec3, count);
    const normals = try scratch.alloc(Vec3, count);
    const texcoords = try scratch.alloc([2]f32, count);
    for (mesh.triangles, triangles, 0..) |source, *triangle, index| {
        const normal = faceNormal(mesh, source);
        for (source, triangle, 0..) |vertex, *corner, place| {
            const at = 3 * index + place;
            corner.* = @intCast(at);
            positions[at] = mesh.positions[vertex];
            normals[at] = normal;
            texcoords[at] = transformed(mesh, coordinates, vertex);
        }
    }
    return .{
        .triangles = triangles,
        .positions = positions,
        .normals = normals,
        .texcoords = texcoords,
    };
}

/// Of a triangle without area: any.
fn faceNormal(mesh: *const Mesh, triangle: [3]u32) Vec3 {
    const first = mesh.positions[triangle[0]];
    const across = vec3.cross(
        vec3.sub(mesh.positions[triangle[1]], first),
        vec3.sub(mesh.positions[triangle[2]], first),
    );
    return vec3.normalize(across) orelse .{ 0, 0, 1 };
}

fn transformed(mesh: *const Mesh, coordinates: *const TangentSource, vertex: u32) [2]f32 {
    const at = mesh.texcoords[coordinates.texcoord_set].?[vertex];
    const rows = coordinates.transform;
    return .{
        rows[0][0] * at[0] + rows[0][1] * at[1] + rows[0][2],
        rows[1][0] * at[0] + rows[1][1] * at[1] + rows[1][2],
    };
}

/// Gives each vertex its corners' tangent, and those that have several copies for the others, which
/// follow the vertices that a triangle uses.
fn split(
    scratch: Allocator,
    arena: Allocator,
    mesh: *const Mesh,
    corner_tangents: []const [3][4]f32,
) error{OutOfMemory}!Mesh {
    const first, const count = usedRange(mesh.triangles);
    var splitting: Splitting = .{ .first = first, .count = count };
    const triangles = try arena.alloc([3]u32, mesh.triangles.len);
    try splitting.tangents.appendNTimes(scratch, @splat(0), count);
    try splitting.next.appendNTimes(scratch, Splitting.untouched, count);
    for (mesh.triangles, triangles, corner_tangents) |source, *triangle, tangents| {
        for (source, triangle, tangents) |vertex, *corner, tangent| {
            corner.* = try splitting.place(scratch, vertex - first, tangent);
        }
    }
    var result: Mesh = .{
        .positions = try splitting.extended(arena, Vec3, mesh.positions),
        .tangents = try arena.dupe([4]f32, splitting.tangents.items),
        .triangles = triangles,
        .material = mesh.material,
    };
    try extendVertices(&splitting, arena, mesh, &result);
    const targets = try arena.alloc(scene.MorphTarget, mesh.morph_targets.len);
    for (targets, mesh.morph_targets) |*to, *target| {
        to.* = .{};
        if (target.positions) |all| to.positions = try splitting.extended(arena, Vec3, all);
        try extendVertices(&splitting, arena, target, to);
    }
    result.morph_targets = targets;
    const sets = try arena.alloc(scene.JointSet, mesh.joint_sets.len);
    for (sets, mesh.joint_sets) |*to, set| to.* = .{
        .joints = try splitting.extended(arena, [4]u16, set.joints),
        .weights = try splitting.extended(arena, [4]f32, set.weights),
    };
    result.joint_sets = sets;
    return result;
}

/// Gives a mesh, or a morph target, what vertices have besides their place and tangent.
fn extendVertices(
    splitting: *const Splitting,
    arena: Allocator,
    from: anytype,
    to: anytype,
) error{OutOfMemory}!void {
    if (from.normals) |all| to.normals = try splitting.extended(arena, Vec3, all);
    if (from.colors) |all| to.colors = try splitting.extended(arena, [4]f32, all);
    for (&to.texcoords, from.texcoords) |*to_set, set| {
        if (set) |all| to_set.* = try splitting.extended(arena, [2]f32, all);
    }
}

/// First vertex of those that triangles use, and how many there are from there to the last.
fn usedRange(triangles: []const [3]u32) [2]u32 {
    assert(triangles.len > 0);
    var lowest: u32 = std.math.maxInt(u32);
    var highest: u32 = 0;
    for (triangles) |triangle| for (triangle) |vertex| {
        lowest = @min(lowest, vertex);
        highest = @max(highest, vertex);
    };
    return .{ lowest, highest - lowest + 1 };
}

/// Vertices while they become more.
const Splitting = struct {
    /// Of the source's vertices, those that count.
    first: u32,
    count: u32,
    tangents: std.ArrayList([4]f32) = .empty,
    /// The next vertex at the same place with another tangent, or what follows.
    next: std.ArrayList(u32) = .empty,
    /// By vertex that was added: the one that it is a copy of.
    sources: std.ArrayList(u32) = .empty,

    const last = std.math.maxInt(u32);
    const untouched = last - 1;

    /// The number of a copy of `vertex` that has this tangent.
    fn place(
        splitting: *Splitting,
        scratch: Allocator,
        vertex: u32,
        tangent: [4]f32,
    ) error{OutOfMemory}!u32 {
        if (splitting.next.items[vertex] == untouched) {
            splitting.next.items[vertex] = last;
            splitting.tangents.items[vertex] = tangent;
            return vertex;
        }
        var at = vertex;
        while (true) : (at = splitting.next.items[at]) {
            const known = &splitting.tangents.items[at];
            if (std.mem.eql(u32, &@as([4]u32, @bitCast(known.*)), &@as([4]u32, @bitCast(tangent))))
                return at;
            if (splitting.next.items[at] == last) break;
        }
        const added: u32 = @intCast(splitting.tangents.items.len);
        try splitting.tangents.append(scratch, tangent);
        try splitting.next.append(scratch, last);
        try splitting.sources.append(scratch, vertex);
        splitting.next.items[at] = added;
        return added;
    }

    /// An array by vertex, with what the added ones have.
    fn extended(
        splitting: *const Splitting,
        arena: Allocator,
        comptime Item: type,
        all: []const Item,
    ) error{OutOfMemory}![]const Item {
        const used = all[splitting.first..][0..splitting.count];
        if (splitting.sources.items.len == 0) return used;
        const result = try arena.alloc(Item, splitting.tangents.items.len);
        @memcpy(result[0..used.len], used);
        for (result[used.len..], splitting.sources.items) |*to, source| to.* = used[source];
        return result;
    }
};

const testing = std.testing;

const identity: TangentSource = .{};

/// Two squares side by side in z = 0, the right one with u mirrored; vertex 0 is nobody's.
const mirrored: Mesh = .{
    .positions = &.{
        .{ 9, 9, 9 }, .{ 0, 0, 0 }, .{ 0, 1, 0 }, .{ 1, 0, 0 }, .{ 1, 1, 0 }, .{ 2, 0, 0 },
        .{ 2, 1, 0 },
    },
    .normals = &@as([7]Vec3, @splat(.{ 0, 0, 3 })),
    .texcoords = .{
        &.{ .{ 9, 9 }, .{ 0, 1 }, .{ 0, 0 }, .{ 1, 1 }, .{ 1, 0 }, .{ 0, 1 }, .{ 0, 0 } },
        null,
        null,
        null,
    },
    .triangles = &.{ .{ 1, 3, 4 }, .{ 1, 4, 2 }, .{ 3, 5, 6 }, .{ 3, 6, 4 } },
    .material = 4,
};

test "a vertex between mirrored halves becomes two at the same place" {
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    var mesh = mirrored;
    mesh.colors = &.{
        .{ 0, 0, 0, 1 }, .{ 1, 0, 0, 1 }, .{ 2, 0, 0, 1 }, .{ 3, 0, 0, 1 }, .{ 4, 0, 0, 1 },
        .{ 5, 0, 0, 1 }, .{ 6, 0, 0, 1 },
    };
    var deltas: [7]Vec3 = undefined;
    var joints: [7][4]u16 = undefined;
    for (&deltas, &joints, 0..) |*delta, *four, vertex| {
        delta.* = @splat(@floatFromInt(vertex));
        four.* = @splat(@intCast(vertex));
    }
    mesh.morph_targets = &.{ .{}, .{ .positions = &deltas, .normals = &deltas } };
    mesh.joint_sets = &.{.{ .joints = &joints, .weights = mesh.colors.? }};
    const made = try withTangents(testing.allocator, arena.allocator(), &mesh, &identity);
    try testing.expectEqual(null, made.morph_targets[0].positions);
    try testing.expectEqual(8, made.positions.len); // Six are used, two of them twice.
    try testing.expectEqual(4, made.material);
    for (made.triangles, mesh.triangles, 0..) |triangle, source, index| {
        const sign: f32 = if (index < 2) 1 else -1;
        for (triangle, source) |corner, vertex| {
            try testing.expectEqual(mesh.positions[vertex], made.positions[corner]);
            try testing.expectEqual(mesh.normals.?[vertex], made.normals.?[corner]);
            try testing.expectEqual(mesh.colors.?[vertex], made.colors.?[corner]);
            try testing.expectEqual(mesh.texcoords[0].?[vertex], made.texcoords[0].?[corner]);
            const target = &made.morph_targets[1];
            try testing.expectEqual(deltas[vertex], target.positions.?[corner]);
            try testing.expectEqual(deltas[vertex], target.normals.?[corner]);
            try testing.expectEqual(joints[vertex], made.joint_sets[0].joints[corner]);
            try testing.expectEqual(mesh.colors.?[vertex], made.joint_sets[0].weights[corner]);
            try testing.expectEqual([4]f32{ sign, 0, 0, sign }, made.tangents.?[corner]);
        }
    }
}

test "without normals each triangle has its own" {
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    var mesh = mirrored;
    mesh.normals = null;
    mesh.triangles = mesh.triangles[0..2];
    const made = try withTangents(testing.allocator, arena.allocator(), &mesh, &identity);
    try testing.expectEqual(null, made.normals);
    try testing.expectEqual(4, made.positions.len);
    for (made.tangents.?) |tangent| try testing.expectEqual([4]f32{ 1, 0, 0, 1 }, tangent);
    // Normals that are none count as the triangle's own.
    mesh.normals = &@as([7]Vec3, @splat(.{ 0, 0, 0 }));
    const other = try withTangents(testing.allocator, arena.allocator(), &mesh, &identity);
    try testing.expectEqualSlices([4]f32, made.tangents.?, other.tangents.?);
}

test "tangents turn with the transform of the texture" {
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    var mesh = mirrored;
    mesh.triangles = mesh.triangles[0..2];
    var turned = identity;
    // u' = v, v' = -u: u grows downwards.
    turned.transform = .{ .{ 0, 1, 0 }, .{ -1, 0, 0 } };
    const made = try withTangents(testing.allocator, arena.allocator(), &mesh, &turned);
    for (made.tangents.?) |tangent| {
        for ([4]f32{ 0, -1, 0, 1 }, tangent) |a, b| try testing.expectApproxEqAbs(a, b, 1e-6);
    }
}

test "numbers that are too large are refused" {
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    var positions = mirrored.positions[0..7].*;
    positions[3][0] = 1e20;
    var mesh = mirrored;
    mesh.positions = &positions;
    const result = withTangents(testing.allocator, arena.allocator(), &mesh, &identity);
    try testing.expectError(error.Unsuitable, result);
}
