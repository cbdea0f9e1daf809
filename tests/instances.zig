//! Instances that share meshes against the same scene flattened: nothing may tell them apart.
//!
//! In: a mesh of nasty triangles that stands about mirrored, tiny, huge, far away and flattened to
//! nothing, among others. Out: the same numbers, corners and vertices' data as in the flattened
//! scene, the hits of brute force in every variant and traversal, the same picture to the bit.

const std = @import("std");
const beams = @import("beams.zig");
const fixture = @import("fixture.zig");
const soup = @import("soup.zig");
const raylane = @import("raylane");
const AffineD = raylane.math.AffineD;
const SharingRule = raylane.prepare.SharingRule;
const World = raylane.world.World;
const ray_file = raylane.trace.ray;
const gpa = std.testing.allocator;

/// Two levels, however small the scene.
const always: SharingRule = .{ .saved_min = 0, .triangle_min = 1 };

const turn: [4]f64 = .{ 0.48, 0.6, 0, 0.64 };
const no_turn: [4]f64 = .{ 0, 0, 0, 1 };

/// Where the mesh stands.
const places = [_]AffineD{
    .fromTrs(.{ 1, 2, -3 }, turn, .{ 1, 1, 1 }),
    .fromTrs(.{ -2, 0.5, 1 }, no_turn, .{ -1, 1, 1.25 }),
    .fromTrs(.{ 0.3, 0, 0.1 }, turn, .{ 1e-3, 1e-3, 1e-3 }),
    .fromTrs(.{ 0, 0, -900 }, no_turn, .{ 1e3, -1e3, 1e3 }),
    .fromTrs(.{ 3e4, -2e4, 1e4 }, turn, .{ 1, 2, 1 }),
    // Of these, all triangles and some are left out.
    .fromTrs(.{ 0, 0, 0 }, no_turn, .{ 0, 0, 0 }),
    .fromTrs(.{ 0, 0, 5 }, no_turn, .{ 1e-21, 1e-21, 1 }),
    .fromTrs(.{ 0, 0, 0 }, turn, .{ 1, 1, 1 }),
};

/// A mesh with colours and normals, some of whose triangles have no area, and another between.
fn makeScene(kind: soup.Soup, triangle_count: usize, count: usize) !raylane.scene.Scene {
    var random = std.Random.DefaultPrng.init(@as(u64, @backingInt(kind)) + 5);
    var corners: soup.Corners = .empty;
    defer corners.deinit(gpa);
    try soup.addTriangles(kind, &corners, random.random(), triangle_count);
    var builder: fixture.Builder = try .init();
    const arena = builder.scene.arena();
    const colors = try arena.alloc([4]f32, corners.items.len);
    for (colors) |*color| {
        for (color[0..3]) |*channel| channel.* = random.random().float(f32);
        color[3] = 1;
    }
    const normals = try arena.alloc([3]f32, corners.items.len);
    for (normals) |*normal| {
        for (normal) |*component| component.* = random.random().floatNorm(f32);
    }
    const triangles = try arena.alloc([3]u32, triangle_count);
    for (triangles, 0..) |*triangle, index| {
        const first: u32 = @intCast(3 * index);
        triangle.* = .{ first, first + 1, if (index % 41 == 7) first else first + 2 };
    }
    try builder.addMesh(fixture.matte(.{ 1, 1, 1 }), corners.items, normals, triangles);
    builder.scene.meshes.items[0].colors = colors;
    const few = [_][3]u32{ .{ 3, 4, 5 }, .{ 4, 4, 5 }, .{ 6, 7, 8 } };
    try builder.addMesh(fixture.matte(.{ 0.5, 0, 1 }), corners.items, null, &few);
    for (places[0..count], 0..) |place, index| {
        const node = try builder.scene.addNode(raylane.scene.none, place);
        try builder.scene.addInstance(0, node);
        // Flattened, for it emits.
        if (index % 3 == 1) try builder.addQuad(
            .{ .emissive = .{ 1, 1, 1 }, .base_color = .{ 0, 0, 0, 1 } },
            .{ 0, @floatFromInt(index), 0 },
            .{ 1, 0, 0 },
            .{ 0, 0, 1 },
        );
    }
    try builder.addCamera(.{ 0, 0, 7 }, 1);
    return builder.finish();
}

fn expectSame(flat: *const World, shared: *const World) !void {
    const a = &flat.geometry;
    const b = &shared.geometry;
    try std.testing.expectEqual(0, a.shared.runs.len);
    try std.testing.expect(b.shared.instances.len > 1);
    const mesh = &b.shared.meshes[0];
    try std.testing.expectEqual(mesh.triangles.len > 256, mesh.clusters.len > 1);
    try std.testing.expectEqual(a.triangles.len, b.triangleCount());
    try std.testing.expectEqual(a.triangles.len, b.surfaceCount());
    try std.testing.expectEqual(a.bounds, b.bounds);
    try std.testing.expectEqual(a.padding, b.padding);
    try std.testing.expectEqual(flat.facts.degenerate_count, shared.facts.degenerate_count);
    try std.testing.expectEqual(flat.view, shared.view);
    var cursor: raylane.world.Cursor = .init(b);
    for (0..a.triangles.len) |index| {
        const number: u32 = @intCast(index);
        const one = a.face(number);
        const other = b.face(number);
        const triangle = cursor.triangleAt(number);
        try std.testing.expectEqual(one.material, other.material);
        try std.testing.expectEqual(one.material, triangle.material);
        for (0..3) |corner| {
            const at = one.position(a, corner);
            try std.testing.expectEqual(at, other.position(b, corner));
            try std.testing.expectEqual(at, cursor.positionAt(triangle.corner[corner]));
            try std.testing.expectEqual(one.normal(a, corner), other.normal(b, corner));
            const color = one.color(a, corner);
            try std.testing.expectEqual(color, other.color(b, corner));
            try std.testing.expectEqual(color, cursor.colorAt(triangle.corner[corner]));
        }
    }
}

fn expectHits(kind: soup.Soup, triangle_count: usize, place_count: usize) !void {
    const query_count = fixture.enough(48);
    var scene = try makeScene(kind, triangle_count, place_count);
    defer scene.deinit();
    const mode = raylane.simd.setFlushToZero();
    defer raylane.simd.setFloatControl(mode);
    const queries = try gpa.alloc(soup.Query, query_count);
    defer gpa.free(queries);
    const expected = try gpa.alloc(soup.Hit, query_count);
    defer gpa.free(expected);
    var random = std.Random.DefaultPrng.init(@as(u64, @backingInt(kind)) + 11);
    inline for (.{ 4, 8, 16 }) |lanes| {
        if (comptime !soup.isCompiled(lanes)) continue;
        var flat = try fixture.prepare(&scene, lanes, .{ .sharing = .never });
        defer flat.deinit();
        var world = try fixture.prepare(&scene, lanes, .{ .sharing = always });
        defer world.deinit();
        try expectSame(&flat, &world);
        soup.addQueries(kind, queries, flat.geometry.positions, random.random());
        for (queries, expected, 0..) |*query, *hit, index| {
            hit.* = soup.bruteForce(&flat, query.*);
            if (index % 3 != 0 or hit.primitive == ray_file.no_primitive) continue;
            query.tnear = hit.*;
            hit.* = soup.bruteForce(&flat, query.*);
        }
        inline for (raylane.variant.compiled) |variant| {
            if (variant.lanes == lanes) {
                try soup.expectVariant(variant, &world, queries, expected);
            }
        }
    }
}

test "rays find the hits of the flattened scene, whatever the triangles and the maps" {
    try expectHits(.mixed_scales, 50, places.len);
    // Of more clusters than one.
    try expectHits(.uniform, 330, 2);
}

test "beams find the hits and shadows of brute force among instances" {
    const mode = raylane.simd.setFlushToZero();
    defer raylane.simd.setFloatControl(mode);
    inline for (raylane.variant.compiled) |variant| {
        if (comptime variant.traversal != .beam) continue;
        const Kernel = raylane.trace.kernel.Kernel(variant, false);
        var scene = try makeScene(.grid, 16, places.len);
        defer scene.deinit();
        var world = try fixture.prepare(&scene, variant.lanes, .{ .sharing = always });
        defer world.deinit();
        var random = std.Random.DefaultPrng.init(3);
        const grid = beams.aim(.{ 0.5, 3, 4 }, .{ 0, 0.5, 0 }, 8e-3, random.random());
        try beams.expectTile(Kernel, &world, &grid, .{ 2, 6, 1 });
    }
}

test "the picture is that of the flattened scene, and sharing follows the counts" {
    var scene = try makeScene(.uniform, 20, places.len);
    defer scene.deinit();
    const size: fixture.Options = .{ .width = 16, .height = 16, .depth_max = 1, .sharing = .never };
    var flat = try fixture.render(&scene, size);
    defer flat.deinit(gpa);
    var options = size;
    options.sharing = always;
    var shared = try fixture.render(&scene, options);
    defer shared.deinit(gpa);
    try std.testing.expectEqualSlices([4]f32, flat.pixels, shared.pixels);
    const lanes = raylane.variant.compiled[0].lanes;
    for ([_]struct { SharingRule, bool }{
        .{ .{}, false },
        .{ .{ .saved_min = 8 * 20 }, false },
        .{ .{ .saved_min = 8 * 20, .triangle_min = 20 }, true },
        .{ .{ .saved_min = 8 * 20 + 1, .triangle_min = 20 }, false },
        .{ .{ .saved_min = 0, .triangle_min = 21 }, false },
    }) |case| {
        var world = try fixture.prepare(&scene, lanes, .{ .sharing = case[0] });
        defer world.deinit();
        try std.testing.expectEqual(case[1], world.geometry.shared.runs.len > 0);
    }
}
