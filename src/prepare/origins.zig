//! What of the file each triangle is: node, mesh, primitive, material, by the file's own numbers.
//!
//! In: what is drawn of a scene, in the order in which triangles are numbered (`flatten.zig`,
//! `strokes.zig`): those of surfaces by instance, then those of all points, then of all lines. Out:
//! runs of triangles that one instance has, with copies of the names.

const std = @import("std");
const flatten = @import("flatten.zig");
const scene = @import("../scene.zig");
const strokes = @import("strokes.zig");
const Allocator = std.mem.Allocator;
const Parts = @import("alpha.zig").Parts;
const assert = std.debug.assert;
const Origins = @This();

arena: std.heap.ArenaAllocator,
/// In order; each ends where the next begins.
runs: []const Run,
names: scene.Names,

/// Triangles of one instance.
pub const Run = struct {
    /// Number of the first triangle.
    first: u32,
    /// Of the file where it has such numbers, else as the reader counts; or `scene.none`.
    node: u32,
    mesh: u32,
    /// Among those of the mesh.
    primitive: u32,
    material: u32,
};

/// Of what is drawn, of points and lines with this detail. Memory comes from `gpa`.
pub fn init(
    gpa: Allocator,
    from: *const scene.Scene,
    parts: *const Parts,
    detail: strokes.Detail,
) error{OutOfMemory}!Origins {
    var arena_state: std.heap.ArenaAllocator = .init(gpa);
    errdefer arena_state.deinit();
    const arena = arena_state.allocator();
    var list: List = .{ .arena = arena, .from = from, .parts = parts };
    for (parts.instances) |*instance| {
        try list.add(instance, parts.meshes[instance.mesh].triangles.len);
    }
    const counts = try gpa.alloc(?strokes.Count, parts.meshes.len);
    defer gpa.free(counts);
    @memset(counts, null);
    inline for (.{ "spheres", "segments" }) |kind| for (parts.instances) |*instance| {
        const mesh = &parts.meshes[instance.mesh];
        const count = &counts[instance.mesh];
        if (count.* == null) count.* = try flatten.countStrokes(gpa, mesh, .of(mesh));
        var own: strokes.Count = .{};
        @field(own, kind) = @field(count.*.?, kind);
        try list.add(instance, detail.triangleCount(own));
    };
    const names: scene.Names = .{
        .nodes = try copyOf(arena, from.names.nodes),
        .meshes = try copyOf(arena, from.names.meshes),
        .materials = try copyOf(arena, from.names.materials),
    };
    return .{ .arena = arena_state, .runs = list.runs.items, .names = names };
}

/// Frees everything.
pub fn deinit(origins: *Origins) void {
    origins.arena.deinit();
    origins.* = undefined;
}

/// The run that has a triangle.
pub fn runOf(origins: *const Origins, triangle: u32) *const Run {
    const runs = origins.runs;
    assert(runs.len > 0);
    var low: usize = 0;
    var high: usize = runs.len;
    while (high - low > 1) {
        const middle = low + (high - low) / 2;
        if (runs[middle].first <= triangle) low = middle else high = middle;
    }
    return &runs[low];
}

const List = struct {
    arena: Allocator,
    from: *const scene.Scene,
    parts: *const Parts,
    runs: std.ArrayList(Run) = .empty,
    next: u64 = 0,

    fn add(
        list: *List,
        instance: *const scene.Instance,
        triangle_count: u64,
    ) error{OutOfMemory}!void {
        if (triangle_count == 0) return;
        const mesh = &list.parts.meshes[instance.mesh];
        const material = list.parts.sources[mesh.material];
        const names = &list.from.names;
        const node_origin = list.from.nodes[instance.node].origin;
        const material_origin = list.from.materials[material].origin;
        // Formats without numbers have no lists of names either.
        try list.runs.append(list.arena, .{
            .first = @intCast(list.next),
            .node = if (names.nodes.len > 0) node_origin else instance.node,
            .mesh = if (names.meshes.len > 0) mesh.origin else instance.mesh,
            .primitive = mesh.primitive,
            .material = if (names.nodes.len > 0) material_origin else material,
        });
        list.next += triangle_count;
    }
};

fn copyOf(arena: Allocator, names: []const []const u8) error{OutOfMemory}![]const []const u8 {
    const copies = try arena.alloc([]const u8, names.len);
    for (copies, names) |*copy, name| copy.* = try arena.dupe(u8, name);
    return copies;
}

test "runs are in the order of triangles, without what has none" {
    const gpa = std.testing.allocator;
    var from: scene.Scene = .init(gpa);
    defer from.deinit();
    from.nodes = &.{
        .{ .parent = scene.none, .local = .identity, .origin = 7 },
        .{ .parent = scene.none, .local = .identity, .origin = 5 },
    };
    from.materials = &.{ .{ .origin = 3 }, .{} };
    from.names = .{ .nodes = &.{"n"}, .meshes = &.{"m"}, .materials = &.{"p"} };
    const corners = [_]@import("../math.zig").Vec3{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } };
    const face = [_][3]u32{.{ 0, 1, 2 }};
    const parts: Parts = .{
        .sources = &.{ 0, 1, 0 },
        .materials = &.{ .{}, .{}, .{} },
        .meshes = &.{
            .{ .positions = &corners, .triangles = &(face ++ face), .material = 2, .origin = 0 },
            .{
                .positions = &corners,
                .triangles = &.{},
                .points = &.{ 0, 2 },
                .segments = &.{.{ 0, 1 }},
                .material = 1,
                .origin = 0,
                .primitive = 1,
            },
        },
        .instances = &.{
            .{ .mesh = 1, .node = 0 }, .{ .mesh = 0, .node = 0 }, .{ .mesh = 0, .node = 1 },
        },
    };
    var origins: Origins = try .init(gpa, &from, &parts, .{ .level = 0 });
    defer origins.deinit();
    // Two instances of two triangles, three octahedra, a cylinder of four sides.
    const firsts = [_]u32{ 0, 2, 4, 28 };
    try std.testing.expectEqual(firsts.len, origins.runs.len);
    for (firsts, origins.runs) |first, run| try std.testing.expectEqual(first, run.first);
    const second: Run = .{ .first = 2, .node = 5, .mesh = 0, .primitive = 0, .material = 3 };
    try std.testing.expectEqual(second, origins.runOf(3).*);
    const stroke: Run =
        .{ .first = 28, .node = 7, .mesh = 0, .primitive = 1, .material = scene.none };
    try std.testing.expectEqual(stroke, origins.runOf(31).*);
    try std.testing.expectEqualStrings("p", origins.names.materials[0]);
}
