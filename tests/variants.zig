//! One picture, bit for bit: every variant, thread count and tile size gives the same hash.
//!
//! The golden hashes below hold across architectures too: the same tests run natively and under
//! qemu. Where a change of shading means to change pictures, they are renewed from the failing
//! test's own output, after a look at the pictures.

const std = @import("std");
const fixture = @import("fixture.zig");
const raylane = @import("raylane");
const gpa = std.testing.allocator;

const Golden = struct { scene: []const u8, size: [2]u32, hash: u64 };

/// Small pictures of scenes that take every path of shading and traversal.
const goldens = [_]Golden{
    .{ .scene = "builtin:cornell", .size = .{ 61, 47 }, .hash = 0xf6d9e032033222c4 },
    .{ .scene = "builtin:atrium", .size = .{ 53, 40 }, .hash = 0x76eb95952f47aa9c },
    .{ .scene = "builtin:nave", .size = .{ 53, 40 }, .hash = 0xcd21067183881a92 },
    .{ .scene = "builtin:handles", .size = .{ 40, 53 }, .hash = 0xc16bfb558bb29068 },
    .{ .scene = "tests/pictures/solids.gltf", .size = .{ 50, 40 }, .hash = 0x1a9903d7c36e67a6 },
    .{ .scene = "tests/pictures/shapes.pbrt", .size = .{ 60, 40 }, .hash = 0x3cf369b8ee6a1e03 },
    .{ .scene = "tests/pictures/view.pbrt", .size = .{ 48, 32 }, .hash = 0xb0da97f9580dcf43 },
};

fn parse(name: []const u8) !raylane.scene.Scene {
    var diagnostic: raylane.diagnostic.Diagnostic = .{};
    return raylane.session.loadScene(gpa, std.testing.io, name, .{}, &diagnostic);
}

fn expectHash(expected: u64, image: *const raylane.image.Image, what: []const u8) !void {
    if (image.hash() == expected) return;
    std.debug.print("{s}: expected {x:0>16}, found {x:0>16}\n", .{ what, expected, image.hash() });
    return error.TestExpectedHash;
}

/// Renders a scene by every variant.
pub fn expectAllVariants(
    scene: *const raylane.scene.Scene,
    base: fixture.Options,
    hash: u64,
) !void {
    inline for (.{ 4, 8, 16 }) |lanes| {
        var diagnostic: raylane.diagnostic.Diagnostic = .{};
        var session: raylane.session.Session =
            .init(gpa, std.testing.io, base.thread_count, &diagnostic);
        defer session.deinit();
        for (raylane.variant.compiled, raylane.variant.names, 0..) |variant, name, index| {
            if (variant.lanes != lanes) continue;
            if (session.world == null) try fixture.view(&session, scene, lanes, base);
            var options = base;
            options.variant = index;
            try expectHash(hash, try fixture.trace(&session, options), name);
        }
    }
}

test "every variant renders built-in scenes and files to the golden hash" {
    for (goldens) |golden| {
        var scene = try parse(golden.scene);
        defer scene.deinit();
        errdefer std.debug.print("scene {s}\n", .{golden.scene});
        try expectAllVariants(&scene, .{
            .width = golden.size[0],
            .height = golden.size[1],
            .thread_count = 2,
        }, golden.hash);
    }
}

test "the file in the repository is the built-in scene" {
    var built_in = try parse("builtin:cornell");
    defer built_in.deinit();
    var file = try parse("scenes/cornell.gltf");
    defer file.deinit();
    const options: fixture.Options = .{ .width = 40, .height = 40 };
    var expected = try fixture.render(&built_in, options);
    defer expected.deinit(gpa);
    var image = try fixture.render(&file, options);
    defer image.deinit(gpa);
    try expectHash(expected.hash(), &image, "scenes/cornell.gltf");
}

test "threads, tiles and samples: the hash depends on the samples alone" {
    var scene = try parse("builtin:cornell");
    defer scene.deinit();
    for ([_]u32{ 1, 3 }) |sample_count| {
        const base: fixture.Options = .{ .width = 37, .height = 29, .sample_count = sample_count };
        var first = try fixture.render(&scene, base);
        defer first.deinit(gpa);
        for ([_]usize{ 1, 2, 7 }) |thread_count| for ([_]u32{ 1, 4, 16, 100 }) |tile_size| {
            var options = base;
            options.thread_count = thread_count;
            options.tile_size = tile_size;
            var image = try fixture.render(&scene, options);
            defer image.deinit(gpa);
            try expectHash(first.hash(), &image, "threads or tiles");
        };
        try expectAllVariants(&scene, base, first.hash());
    }
}

test "samples beyond the edges of small pictures are the same by every variant" {
    var scene = try parse("builtin:handles");
    defer scene.deinit();
    var hashes: [3][3]?u64 = @splat(@splat(null));
    inline for (.{ 4, 8, 16 }) |lanes| {
        var diagnostic: raylane.diagnostic.Diagnostic = .{};
        var session: raylane.session.Session = .init(gpa, std.testing.io, 1, &diagnostic);
        defer session.deinit();
        for (raylane.variant.compiled, raylane.variant.names, 0..) |variant, name, index| {
            if (variant.lanes != lanes) continue;
            if (session.world == null) try fixture.view(&session, &scene, lanes, .{});
            const sizes = [_][2]u32{ .{ 1, 1 }, .{ 5, 1 }, .{ 2, 19 } };
            for (&hashes, sizes) |*row, size| for (row, [_]u32{ 4, 8, 25 }) |*hash, count| {
                const options: fixture.Options = .{
                    .width = size[0],
                    .height = size[1],
                    .sample_count = count,
                    .variant = index,
                };
                try fixture.look(&session, options);
                const image = try fixture.trace(&session, options);
                hash.* = hash.* orelse image.hash();
                try expectHash(hash.*.?, image, name);
            };
        }
    }
}

test "colours of the display and what is seen are the same by every variant, and apart" {
    var builder: fixture.Builder = try .init();
    var veil = fixture.flat(.{ 0.2, 0.4, 0.8 });
    veil.alpha_mode = .blend;
    veil.base_color[3] = 0.25;
    var mirror = fixture.matte(.{ 1, 1, 1 });
    mirror.metallic = 1;
    mirror.roughness = 0;
    try builder.addQuad(mirror, .{ -1, 0, -3 }, .{ 1, 0, 0 }, .{ 0, 2, 0 });
    try builder.addQuad(fixture.flat(.{ 1, 0.5, 0 }), .{ 1, 0, -3 }, .{ 1, 0, 0 }, .{ 0, 2, 0 });
    try builder.addQuad(fixture.flat(.{ 1, 1, 1 }), .{ 0, 0, 3 }, .{ 9, 0, 0 }, .{ 0, 9, 0 });
    try builder.addQuad(veil, .{ 0, 0, -2 }, .{ 0.3, 0, 0 }, .{ 0, 0.3, 0 });
    try builder.addCamera(.{ 0, 0, 0 }, 0.5);
    var scene = try builder.finish();
    defer scene.deinit();
    var layers: std.EnumSet(raylane.settings.Layer) = .full;
    // Of kernels that count.
    layers.remove(.cost);
    const options: fixture.Options = .{
        .width = 21,
        .height = 14,
        .transparent = true,
        .display_referred = true,
        .layers = layers,
    };
    var diagnostic: raylane.diagnostic.Diagnostic = .{};
    var first: ?u64 = null;
    var features: ?u64 = null;
    for (raylane.variant.compiled, 0..) |variant, index| {
        var session: raylane.session.Session = .init(gpa, std.testing.io, 1, &diagnostic);
        defer session.deinit();
        try fixture.view(&session, &scene, variant.lanes, options);
        try session.render(.{ .variant = index, .sample_count = 4, .layers = layers });
        const film = &session.film.?;
        try std.testing.expectEqual(first orelse film.hash(), film.hash());
        first = film.hash();
        var hash: u64 = 0;
        for ([_]raylane.film.Layer{
            .albedo, .normal, .depth, .variance, .origin, .position, .texcoord,
        }) |layer| {
            hash = hash *% 31 +% film.imageOf(layer).?.hash();
        }
        try std.testing.expectEqual(features orelse hash, hash);
        features = hash;
        try std.testing.expectApproxEqAbs(3, film.imageOf(.depth).?.at(17, 2)[0], 1e-5);
        try std.testing.expectEqual(1, film.imageOf(.depth).?.at(17, 2)[3]);
        const albedo = film.imageOf(.albedo).?;
        try std.testing.expectEqual([4]f32{ 1, 0.5, 0, 0 }, albedo.at(17, 2).*);
        // The mirror shows the white wall, which faces the other way.
        try std.testing.expectApproxEqAbs(1, albedo.at(3, 2)[0], 1e-2);
        const normals = film.imageOf(.normal).?;
        try std.testing.expectApproxEqAbs(1, normals.at(17, 2)[2], 1e-5);
        try std.testing.expectApproxEqAbs(-1, normals.at(3, 2)[2], 1e-2);
        // What is painted is apart; in the mirror it is radiance.
        const painted = film.imageOf(.display).?.at(17, 2).*;
        try std.testing.expectEqual([4]f32{ 1, 0.5, 0, 1 }, painted);
        try std.testing.expectEqual([4]f32{ 0, 0, 0, 1 }, film.image.at(17, 2).*);
        try std.testing.expectEqual([4]f32{ 0, 0, 0, 0 }, film.imageOf(.display).?.at(3, 2).*);
        try std.testing.expect(film.image.at(3, 2)[1] > 0.5);
        // The veil is before both: a quarter of it, and of what is behind the rest.
        const veiled = film.imageOf(.display).?.at(11, 7).*;
        try std.testing.expectEqual([4]f32{ 0.8, 0.475, 0.2, 1 }, veiled);
        const before_mirror = film.imageOf(.display).?.at(9, 7).*;
        try std.testing.expectEqual([4]f32{ 0.05, 0.1, 0.2, 0.25 }, before_mirror);
        // What most is seen of is behind it.
        const places = film.imageOf(.position).?;
        const numbers = film.imageOf(.origin).?;
        for ([_][2]u32{ .{ 9, 7 }, .{ 11, 7 } }, [_][2]u32{ .{ 3, 2 }, .{ 17, 2 } }) |at, same| {
            try std.testing.expectApproxEqAbs(-3, places.at(at[0], at[1])[2], 1e-5);
            const number: [4]u32 = @bitCast(numbers.at(at[0], at[1]).*);
            const other: [4]u32 = @bitCast(numbers.at(same[0], same[1]).*);
            try std.testing.expectEqual(other, number);
        }
    }
}

test "quick looks are the same by every variant, and tests of pixels those of the picture" {
    var builder: fixture.Builder = try .init();
    const red = fixture.matte(.{ 0.8, 0, 0 });
    try builder.addQuad(red, .{ 0, 0, -2 }, .{ 0.5, 0, 0 }, .{ 0, 0.5, 0 });
    try builder.addCamera(.{ 0, 0, 0 }, 0.5);
    var scene = try builder.finish();
    defer scene.deinit();
    var options: fixture.Options = .{ .width = 18, .height = 17, .shade = .normal };
    var diagnostic: raylane.diagnostic.Diagnostic = .{};
    var first: ?u64 = null;
    for (raylane.variant.compiled, 0..) |variant, index| {
        var session: raylane.session.Session = .init(gpa, std.testing.io, 1, &diagnostic);
        defer session.deinit();
        options.shade = .normal;
        try fixture.view(&session, &scene, variant.lanes, options);
        try session.render(.{ .variant = index, .sample_count = 2 });
        const film = &session.film.?;
        try std.testing.expectEqual(first orelse film.hash(), film.hash());
        first = film.hash();
        const decoded = &raylane.math.srgb.decoded;
        const facing = [4]f32{ decoded[128], decoded[128], decoded[255], 1 };
        try std.testing.expectEqual(facing, film.imageOf(.display).?.at(9, 8).*);
        try std.testing.expectEqual([4]f32{ 0, 0, 0, 0 }, film.image.at(0, 0).*);

        options.shade = .cost;
        try fixture.look(&session, options);
        try session.render(.{ .variant = index, .sample_count = 2 });
        const tests = session.traced.tests.?;
        var sums: [2]f64 = @splat(0);
        for (session.film.?.imageOf(.cost).?.pixels) |pixel| {
            for (&sums, pixel[0..2]) |*sum, value| sum.* += value;
        }
        const boxes: f64 = @floatFromInt(tests.box_useful);
        const triangles: f64 = @floatFromInt(tests.triangle_useful);
        try std.testing.expect(boxes > 0 and triangles > 0);
        try std.testing.expectApproxEqRel(boxes, sums[0], 1e-5);
        try std.testing.expectApproxEqRel(triangles, sums[1], 1e-5);
        try std.testing.expectEqual([4]f32{ 0, 0, 0, 1 }, session.film.?.image.at(0, 0).*);

        // Nothing hides the light, whatever the colour.
        if (index > 0) continue;
        options.shade = .ao;
        try fixture.look(&session, options);
        try session.render(.{ .sample_count = 2 });
        for (session.film.?.image.at(9, 8)[0..3]) |value| {
            try std.testing.expectApproxEqRel(1, value, 2e-2);
        }
    }
}

test "the quality of the tree changes nothing in the picture, by any variant" {
    for ([_][]const u8{ "builtin:cornell", "builtin:atrium" }) |name| {
        var scene = try parse(name);
        defer scene.deinit();
        var options: fixture.Options = .{ .width = 32, .height = 32, .thread_count = 2 };
        var first = try fixture.render(&scene, options);
        defer first.deinit(gpa);
        for (std.enums.values(raylane.settings.TreeQuality)) |quality| {
            options.tree_quality = quality;
            try expectAllVariants(&scene, options, first.hash());
        }
    }
}

test "orthographic views, directional and spot lights, holes, veils and absorbing glass" {
    var builder: fixture.Builder = try .init();
    var glass = fixture.matte(.{ 0.9, 1, 0.9 });
    glass.ior = 1.5;
    glass.roughness = 0;
    glass.transmission = 1;
    glass.volume = true;
    glass.attenuation_color = .{ 0.3, 0.9, 0.5 };
    glass.attenuation_distance = 0.7;
    var veil = fixture.matte(.{ 0.9, 0.2, 0.1 });
    veil.alpha_mode = .blend;
    veil.base_color[3] = 0.4;
    var hole = fixture.matte(.{ 1, 1, 1 });
    hole.alpha_mode = .mask;
    hole.base_color[3] = 0.1;
    var brass = fixture.matte(.{ 0.9, 0.7, 0.3 });
    brass.metallic = 1;
    brass.roughness = 0.22;
    brass.double_sided = false;
    const floor = fixture.matte(.{ 0.6, 0.6, 0.6 });
    try builder.addQuad(floor, .{ 0, -1, -3 }, .{ 4, 0, 0 }, .{ 0, 0, -4 });
    try builder.addSphere(glass, .{ -0.8, 0, -3 }, 0.9, 12);
    try builder.addSphere(brass, .{ 0.9, 0, -3.4 }, 0.8, 12);
    try builder.addQuad(veil, .{ 0.4, 0.2, -2 }, .{ 0.8, 0.1, 0 }, .{ 0, 0.7, 0.2 });
    try builder.addQuad(hole, .{ 0, 0, -1 }, .{ 4, 0, 0 }, .{ 0, 4, 0 });
    try builder.addPointLight(.{ 1, 3, -1 }, 30);
    const tilted = try builder.addNode(.fromTrs(.{ -2, 3, 0 }, .{ -0.6, 0, 0, 0.8 }, .{ 1, 1, 1 }));
    try builder.scene.addLight(.{ .kind = .directional, .node = tilted, .intensity = 1.5 });
    try builder.scene.addLight(.{
        .kind = .spot,
        .node = tilted,
        .intensity = 60,
        .range = 9,
        .inner_cone_rad = 0.2,
        .outer_cone_rad = 0.9,
    });
    try builder.scene.addCamera(.{ .name = "flat", .node = 0, .projection = .{
        .orthographic = .{ .half_width = 2, .half_height = 1.6 },
    } });
    var scene = try builder.finish();
    defer scene.deinit();
    const base: fixture.Options = .{ .width = 50, .height = 40, .ambient = 0.2 };
    var first = try fixture.render(&scene, base);
    defer first.deinit(gpa);
    try expectHash(0x4c29fb55b0422a1a, &first, "the mixed scene");
    try expectAllVariants(&scene, base, first.hash());
    var clear = base;
    clear.transparent = true;
    clear.sample_count = 2;
    var second = try fixture.render(&scene, clear);
    defer second.deinit(gpa);
    try expectAllVariants(&scene, clear, second.hash());
}
