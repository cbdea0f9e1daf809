//! Volumes by priority, for where they overlap.
//!
//! In: materials, the triangles that are drawn. Out: what these bound, sorted, and the materials'
//! places in it. glTF has no priorities: the higher index of refraction wins, among equal ones the
//! lower material number, so that glass wins over what it holds. Materials that fill what they
//! bound with the same bound one volume.

const std = @import("std");
const math = @import("../math.zig");
const world = @import("../world.zig");
const vec3 = math.vec3;
const vec3d = math.vec3d;
const Allocator = std.mem.Allocator;
const Material = world.Material;
const Volume = world.Volume;

/// How much of the area that surfaces turn to one side may not be turned to the other.
const open_share_max = 1e-3;

/// Ranks what materials bound; empty if none of it is drawn. Further volumes than ranks can count
/// share the last.
pub fn rank(
    arena: Allocator,
    materials: []Material,
    layers: []const world.Layers,
    positions: []const [3]f32,
    triangles: []const world.Triangle,
) error{OutOfMemory}![]const Volume {
    var numbers: std.ArrayList(u32) = .empty;
    for (materials, 0..) |*material, number| {
        if (material.volume > 0) try numbers.append(arena, @intCast(number));
    }
    if (numbers.items.len == 0) return &.{};
    const all: Fillings = .{ .materials = materials, .layers = layers };
    std.mem.sort(u32, numbers.items, all, Fillings.isLess);
    // The first of those that are filled with the same.
    var leaders: std.ArrayList(u32) = .empty;
    for (numbers.items, 0..) |number, index| {
        if (index > 0 and all.compare(numbers.items[index - 1], number) == .eq) continue;
        try leaders.append(arena, number);
    }
    std.mem.sort(u32, leaders.items, all, Fillings.comesFirst);
    const volumes = try arena.alloc(Volume, @min(leaders.items.len, Volume.air));
    for (leaders.items, 0..) |number, index| {
        const material = &materials[number];
        const place = @min(index, volumes.len - 1);
        material.volume_rank = @intCast(place);
        const scattering = &layers[number];
        if (index == place) volumes[place] = .{
            .ior = material.ior,
            .sigma_t = vec3.add(material.sigma_a, scattering.sigma_s),
            .sigma_s = scattering.sigma_s,
            .scatter_anisotropy = scattering.scatter_anisotropy,
            .nests = material.transmits(),
        };
    }
    for (numbers.items[1..], 1..) |number, index| {
        const before = numbers.items[index - 1];
        if (all.compare(before, number) == .eq)
            materials[number].volume_rank = materials[before].volume_rank;
    }
    const are_drawn = try findOpen(arena, volumes, materials, positions, triangles);
    return if (are_drawn) volumes else &.{};
}

/// What tells volumes apart.
const Fillings = struct {
    materials: []const Material,
    layers: []const world.Layers,

    fn keyOf(all: Fillings, number: u32) [9]f32 {
        const material = &all.materials[number];
        const layers = &all.layers[number];
        const transmits: f32 = if (material.transmits()) 1 else 0;
        return [1]f32{material.ior} ++ material.sigma_a ++ layers.sigma_s ++
            [2]f32{ layers.scatter_anisotropy, transmits };
    }

    fn compare(all: Fillings, a: u32, b: u32) std.math.Order {
        for (all.keyOf(a), all.keyOf(b)) |x, y| if (x != y) return if (x < y) .lt else .gt;
        return .eq;
    }

    /// By what fills them, then by number.
    fn isLess(all: Fillings, a: u32, b: u32) bool {
        return switch (all.compare(a, b)) {
            .lt => true,
            .eq => a < b,
            .gt => false,
        };
    }

    fn comesFirst(all: Fillings, a: u32, b: u32) bool {
        const first = all.materials[a].ior;
        const second = all.materials[b].ior;
        return if (first == second) a < b else first > second;
    }
};

/// Closed surfaces have no area as a vector, but for rounding: of others a ray may leave what it
/// has never entered, so that those do not nest. Returns whether there are any surfaces.
fn findOpen(
    arena: Allocator,
    volumes: []Volume,
    materials: []const Material,
    positions: []const [3]f32,
    triangles: []const world.Triangle,
) error{OutOfMemory}!bool {
    const Area = struct { sum: [3]f64 = @splat(0), whole: f64 = 0 };
    const areas = try arena.alloc(Area, volumes.len);
    @memset(areas, .{});
    for (triangles) |*triangle| {
        if (triangle.isDropped()) continue;
        const place = materials[triangle.material].volume_rank;
        if (place == Volume.air) continue;
        var corners: [3][3]f64 = undefined;
        for (&corners, triangle.corner) |*to, vertex| {
            for (to, positions[vertex]) |*component, value| component.* = value;
        }
        const plane = vec3d.cross(
            vec3d.sub(corners[1], corners[0]),
            vec3d.sub(corners[2], corners[0]),
        );
        areas[place].sum = vec3d.add(areas[place].sum, plane);
        areas[place].whole += vec3d.length(plane);
    }
    var any_area = false;
    for (volumes, areas) |*volume, area| {
        any_area = any_area or area.whole > 0;
        if (!(vec3d.length(area.sum) <= area.whole * open_share_max)) volume.nests = false;
    }
    return any_area;
}

const test_material: Material = .{
    .base_color = .{ 1, 1, 1, 1 },
    .emissive = .{ 0, 0, 0 },
    .metallic = 0,
    .roughness = 0,
    .dielectric_f0 = 0,
    .ior = 1.5,
    .transmission = 1,
    .sigma_a = .{ 1, 2, 3 },
    .alpha_cutoff = -1,
    .blend = 0,
    .double_sided = 0,
    .unlit = 0,
    .volume = 1,
};

test "the denser one first, among equals the lower number, the same only once" {
    var arena: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena.deinit();
    var materials: [8]Material = @splat(test_material);
    var layers: [8]world.Layers = @splat(.{});
    layers[7].sigma_s = .{ 0.5, 0, 0 };
    materials[0].ior = 1.33;
    materials[1].volume = 0;
    materials[2].sigma_a = .{ 9, 0, 0 };
    materials[4].ior = 2;
    materials[6].metallic = 1;
    materials[6].sigma_a = .{ 0, 0, 0 };
    const positions = [_][3]f32{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } };
    const volumes = try rank(arena.allocator(), &materials, &layers, &positions, &.{
        .{ .corner = .{ 0, 1, 2 }, .material = 0 },
    });
    const expected = [_]u16{ 5, Volume.air, 1, 2, 0, 2, 3, 4 };
    for (expected, materials) |place, material| {
        try std.testing.expectEqual(place, material.volume_rank);
    }
    try std.testing.expectEqual(6, volumes.len);
    try std.testing.expectEqual(1.33, Volume.iorOf(volumes, 5));
    try std.testing.expectEqual(1, Volume.iorOf(volumes, Volume.air));
    try std.testing.expectEqual([3]f32{ 1, 2, 3 }, Volume.sigmaOf(volumes, 2));
    try std.testing.expectEqual([3]f32{ 1.5, 2, 3 }, Volume.sigmaOf(volumes, 4));
    try std.testing.expect(volumes[4].scatters() and !volumes[2].scatters());
    try std.testing.expect(volumes[0].nests and !volumes[3].nests);
    const undrawn = try rank(arena.allocator(), &materials, &layers, &.{}, &.{});
    try std.testing.expectEqual(0, undrawn.len);
}

test "surfaces that do not close, and those that light does not enter, do not nest" {
    var arena: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena.deinit();
    var materials: [2]Material = @splat(test_material);
    const layers: [2]world.Layers = @splat(.{});
    materials[1].sigma_a = .{ 0, 0, 0 };
    const positions = [_][3]f32{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 }, .{ 0, 0, 1 } };
    var triangles: [8]world.Triangle = undefined;
    for ([_][3]u32{ .{ 0, 2, 1 }, .{ 0, 1, 3 }, .{ 0, 3, 2 }, .{ 1, 2, 3 } }, 0..) |corner, at| {
        triangles[at] = .{ .corner = corner, .material = 0 };
        triangles[at + 4] = .{ .corner = corner, .material = 1 };
    }
    const closed = try rank(arena.allocator(), &materials, &layers, &positions, &triangles);
    try std.testing.expect(closed[0].nests and closed[1].nests);
    const open = try rank(arena.allocator(), &materials, &layers, &positions, triangles[0..7]);
    try std.testing.expect(open[0].nests and !open[1].nests);
}
