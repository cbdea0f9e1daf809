//! Tangents of a mesh that brings none, by MikkTSpace, as glTF asks for (glTF 2.0, 3.7.2.1).
//!
//! In: triangles with a position, a normal and a texture coordinate at each corner. Out: a tangent
//! for each corner, the same bits on every target; corners that share a vertex may differ in it, so
//! nothing may be averaged. Source: Mikkelsen, Simulation of Wrinkled Surfaces Revisited, 2008. The
//! library recurses around a vertex and compares all corners at one place with each other, so that
//! their number is bounded here; a million triangles take more than a second.

const std = @import("std");
const Allocator = std.mem.Allocator;
const elementary = @import("../math.zig").elementary;
const memory_account = @import("../memory_account.zig");
const assert = std.debug.assert;

/// Vertices, and three of them for each triangle. All three arrays are as long.
pub const Mesh = struct {
    triangles: []const [3]u32,
    positions: []const [3]f32,
    /// Of unit length.
    normals: []const [3]f32,
    /// From the top left, as glTF has them.
    texcoords: []const [2]f32,
};

/// The library numbers corners in C's int, with four to a triangle.
const triangle_count_max = 1 << 28;
/// Corners at one place.
const corner_count_max = 2048;
/// Beyond it, what the library computes of positions and texture coordinates overflows.
const magnitude_max = 1e9;

/// `Unsuitable`: more corners at one place than `corner_count_max`, more triangles than
/// `triangle_count_max`, or numbers that are not finite or beyond `magnitude_max`.
pub const Error = error{ OutOfMemory, Unsuitable };

/// The tangents, of unit length and across the normal, and fourth 1 or -1: the sign of
/// cross(normal, tangent) on the way to the top of the texture. Corners where texture coordinates
/// give no direction share their neighbours', or have (1, 0, 0) across nothing.
/// In `tangents`, as long as there are triangles.
pub fn compute(gpa: Allocator, mesh: Mesh, tangents: [][3][4]f32) Error!void {
    assert(tangents.len == mesh.triangles.len);
    assert(mesh.normals.len == mesh.positions.len);
    assert(mesh.texcoords.len == mesh.positions.len);
    if (mesh.triangles.len == 0) return;
    if (mesh.triangles.len > triangle_count_max) return error.Unsuitable;
    // What the library asks for in one piece.
    if (mesh.triangles.len > std.math.maxInt(usize) / 256) return error.OutOfMemory;
    try checkNumbers(mesh);
    try checkPlaces(gpa, mesh);
    var heap: memory_account.LibraryHeap = .{ .gpa = gpa };
    defer heap.deinit();
    const hooks = heap.hooks();
    switch (rl_mikktspace(&hooks, &.{
        .triangles = mesh.triangles.ptr,
        .positions = mesh.positions.ptr,
        .normals = mesh.normals.ptr,
        .texcoords = mesh.texcoords.ptr,
        .triangle_count = @intCast(mesh.triangles.len),
        .tangents = tangents.ptr,
        .arc_cosine = arcCosine,
    })) {
        .done => {},
        .exhausted => return error.OutOfMemory,
        .broken => return error.Unsuitable,
    }
    // The library's texture coordinates are from the bottom.
    for (tangents) |*corners| for (corners) |*tangent| {
        tangent[3] = -tangent[3];
    };
}

fn checkNumbers(mesh: Mesh) error{Unsuitable}!void {
    for (mesh.triangles) |triangle| for (triangle) |vertex| {
        const values = mesh.positions[vertex] ++ mesh.normals[vertex] ++ mesh.texcoords[vertex];
        for (values) |value| {
            // Not a NaN either.
            if (!(@abs(value) <= magnitude_max)) return error.Unsuitable;
        }
    };
}

/// Counts corners by a hash of their positions: never fewer than there are at one place.
fn checkPlaces(gpa: Allocator, mesh: Mesh) Error!void {
    const corner_count = mesh.triangles.len * 3;
    if (corner_count <= corner_count_max) return;
    const counts = try gpa.alloc(u16, std.math.ceilPowerOfTwoAssert(usize, corner_count));
    defer gpa.free(counts);
    @memset(counts, 0);
    for (mesh.triangles) |triangle| for (triangle) |vertex| {
        // Zero has one sign.
        const position: @Vector(3, f32) = mesh.positions[vertex];
        const place: [3]f32 = position + @as(@Vector(3, f32), @splat(0));
        const hash = std.hash.XxHash3.hash(0, std.mem.asBytes(&place));
        const count = &counts[@as(usize, @truncate(hash)) & (counts.len - 1)];
        count.* += 1;
        if (count.* > corner_count_max) return error.Unsuitable;
    };
}

fn arcCosine(cosine: f64) callconv(.c) f64 {
    return elementary.acos(std.math.clamp(cosine, -1, 1));
}

/// In the order of mikktspace.c.
const LibraryMesh = extern struct {
    triangles: [*]const [3]u32,
    positions: [*]const [3]f32,
    normals: [*]const [3]f32,
    texcoords: [*]const [2]f32,
    triangle_count: c_int,
    tangents: [*][3][4]f32,
    arc_cosine: *const fn (f64) callconv(.c) f64,
};

extern fn rl_mikktspace(
    memory: *const memory_account.Hooks,
    mesh: *const LibraryMesh,
) enum(c_int) { done, exhausted, broken };

/// A square of two triangles in the plane z = 0, u to the right, v down.
const square: Mesh = .{
    .triangles = &.{ .{ 0, 1, 2 }, .{ 0, 2, 3 } },
    .positions = &.{ .{ 0, 0, 0 }, .{ 2, 0, 0 }, .{ 2, 2, 0 }, .{ 0, 2, 0 } },
    .normals = &.{ .{ 0, 0, 1 }, .{ 0, 0, 1 }, .{ 0, 0, 1 }, .{ 0, 0, 1 } },
    .texcoords = &.{ .{ 0, 1 }, .{ 1, 1 }, .{ 1, 0 }, .{ 0, 0 } },
};

test "a square's tangent is where u grows, its bitangent up in the texture" {
    var tangents: [2][3][4]f32 = undefined;
    try compute(std.testing.allocator, square, &tangents);
    for (tangents) |corners| for (corners) |tangent| {
        try std.testing.expectEqual([4]f32{ 1, 0, 0, 1 }, tangent);
    };
    // Mirrored, and turned by 90 degrees.
    var mesh = square;
    mesh.texcoords = &.{ .{ 1, 1 }, .{ 0, 1 }, .{ 0, 0 }, .{ 1, 0 } };
    try compute(std.testing.allocator, mesh, &tangents);
    try std.testing.expectEqual([4]f32{ -1, 0, 0, -1 }, tangents[1][2]);
    mesh.texcoords = &.{ .{ 1, 1 }, .{ 1, 0 }, .{ 0, 0 }, .{ 0, 1 } };
    try compute(std.testing.allocator, mesh, &tangents);
    try std.testing.expectEqual([4]f32{ 0, -1, 0, 1 }, tangents[0][1]);
}

/// A strip around a cylinder of 64 sides, with a seam where u starts again, of `allocator`.
fn cylinder(allocator: Allocator) !Mesh {
    const side_count = 64;
    const count = 2 * (side_count + 1);
    const triangles = try allocator.alloc([3]u32, 2 * side_count);
    const positions = try allocator.alloc([3]f32, count);
    const normals = try allocator.alloc([3]f32, count);
    const texcoords = try allocator.alloc([2]f32, count);
    for (0..count) |vertex| {
        const side = vertex / 2;
        const u = @as(f32, @floatFromInt(side)) / side_count;
        const turn = 2 * std.math.pi * @as(f64, @floatFromInt(side % side_count)) / side_count;
        const x: f32 = @floatCast(elementary.cos(turn));
        const y: f32 = @floatCast(elementary.sin(turn));
        const z: f32 = @floatFromInt(vertex % 2);
        positions[vertex] = .{ x, y, z };
        normals[vertex] = .{ x, y, 0 };
        texcoords[vertex] = .{ u, 1 - z };
    }
    for (triangles, 0..) |*triangle, index| {
        const first: u32 = @intCast(index);
        triangle.* = if (index % 2 == 0)
            .{ first, first + 2, first + 1 }
        else
            .{ first, first + 1, first + 2 };
    }
    return .{
        .triangles = triangles,
        .positions = positions,
        .normals = normals,
        .texcoords = texcoords,
    };
}

test "around a cylinder tangents are across the normals, the same on every machine" {
    var arena: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena.deinit();
    const mesh = try cylinder(arena.allocator());
    const tangents = try arena.allocator().alloc([3][4]f32, mesh.triangles.len);
    try compute(std.testing.allocator, mesh, tangents);
    for (mesh.triangles, tangents) |triangle, corners| for (triangle, corners) |vertex, tangent| {
        const normal = mesh.normals[vertex];
        // Where u grows: a quarter turn on; half a side off at the seam, where no corner is shared.
        const along = -normal[1] * tangent[0] + normal[0] * tangent[1];
        try std.testing.expect(along > 0.998);
        const across = normal[0] * tangent[0] + normal[1] * tangent[1];
        try std.testing.expectApproxEqAbs(0, across, 1e-6);
        try std.testing.expectEqual(1, tangent[3]);
    };
    const hash = std.hash.XxHash64.hash(0, std.mem.sliceAsBytes(tangents));
    try std.testing.expectEqual(0x1a28a574e3ff32f9, hash);
}

test "what the library must not see is refused" {
    const gpa = std.testing.allocator;
    var tangents: [2][3][4]f32 = undefined;
    for ([_]f32{ std.math.nan(f32), std.math.inf(f32), 1e10 }) |value| {
        var positions = square.positions[0..4].*;
        positions[2][1] = value;
        var mesh = square;
        mesh.positions = &positions;
        try std.testing.expectError(error.Unsuitable, compute(gpa, mesh, &tangents));
    }
    // All corners at one place.
    const count = corner_count_max / 3 + 1;
    const triangles: [count][3]u32 = @splat(.{ 0, 0, 0 });
    const many = try gpa.alloc([3][4]f32, count);
    defer gpa.free(many);
    var mesh = square;
    mesh.triangles = &triangles;
    try std.testing.expectError(error.Unsuitable, compute(gpa, mesh, many));
    mesh.triangles = triangles[0 .. count - 1];
    try compute(gpa, mesh, many[0 .. count - 1]);
}

test "random triangles, degenerate ones as well, have finite tangents" {
    const gpa = std.testing.allocator;
    var random_state: std.Random.DefaultPrng = .init(3);
    const random = random_state.random();
    var positions: [40][3]f32 = undefined;
    var normals: [40][3]f32 = undefined;
    var texcoords: [40][2]f32 = undefined;
    var triangles: [60][3]u32 = undefined;
    var tangents: [60][3][4]f32 = undefined;
    for (0..200) |round| {
        const scale: f32 = if (round % 2 == 0) 1 else magnitude_max;
        for (&positions, &normals, &texcoords) |*position, *normal, *texcoord| {
            for (position) |*value| value.* = @floor(random.float(f32) * 3) / 3 * scale;
            for (texcoord) |*value| value.* = @floor(random.float(f32) * 3) / 3 * scale;
            normal.* = .{ 0, 0, 0 };
            normal[random.uintLessThan(usize, 3)] = 1;
        }
        for (&triangles) |*triangle| for (triangle) |*vertex| {
            vertex.* = random.uintLessThan(u32, positions.len);
        };
        try compute(gpa, .{
            .triangles = &triangles,
            .positions = &positions,
            .normals = &normals,
            .texcoords = &texcoords,
        }, &tangents);
        for (tangents) |corners| for (corners) |tangent| {
            for (tangent) |value| try std.testing.expect(std.math.isFinite(value));
        };
    }
}

test "memory that runs out is an error, whenever it does" {
    var tangents: [2][3][4]f32 = undefined;
    for (0..100) |fail_index| {
        var failing: std.testing.FailingAllocator = .init(std.testing.allocator, .{
            .fail_index = fail_index,
        });
        compute(failing.allocator(), square, &tangents) catch |err| {
            try std.testing.expectEqual(error.OutOfMemory, err);
            continue;
        };
        try std.testing.expect(fail_index > 10);
        break;
    } else return error.NeverEnoughMemory;
}
