//! Pictures whose every pixel is known from a formula.
//!
//! Each scene isolates one law: Lambert and the inverse square, the sphere's outline, the mirror,
//! Snell's, Fresnel's and Beer's laws in a slab, shadows, and energy (a furnace shows nothing but
//! its own radiance).

const std = @import("std");
const fixture = @import("fixture.zig");
const raylane = @import("raylane");
const Builder = fixture.Builder;
const expect = std.testing.expect;
const gpa = std.testing.allocator;

fn expectClose(expected: f32, actual: f32, tolerance: f32) !void {
    if (@abs(expected - actual) <= tolerance) return;
    std.debug.print("expected {d}, found {d}\n", .{ expected, actual });
    return error.TestExpectedClose;
}

test "a plane lit from the eye: albedo / pi, cosine, inverse square" {
    var builder: Builder = try .init();
    try builder.addQuad(fixture.matte(.{ 0.5, 0.25, 1 }), .{ 0, 0, 0 }, .{ 9, 0, 0 }, .{ 0, 9, 0 });
    try builder.addCamera(.{ 0, 0, 3 }, 1);
    try builder.addPointLight(.{ 0, 0, 3 }, 20);
    var scene = try builder.finish();
    defer scene.deinit();
    var image = try fixture.render(&scene, .{ .width = 33, .height = 33 });
    defer image.deinit(gpa);
    for (0..33) |y| for (0..33) |x| {
        const across = (@as(f32, @floatFromInt(x)) + 0.5) / 33 * 2 - 1;
        const upward = 1 - (@as(f32, @floatFromInt(y)) + 0.5) / 33 * 2;
        const slant_squared = 1 + across * across + upward * upward;
        const distance_squared = 9 * slant_squared;
        const cosine = 1 / @sqrt(slant_squared);
        const expected = 20.0 / std.math.pi * cosine / distance_squared;
        const pixel = image.at(@intCast(x), @intCast(y)).*;
        try expectClose(0.5 * expected, pixel[0], 1e-5);
        try expectClose(0.25 * expected, pixel[1], 1e-5);
        try expectClose(expected, pixel[2], 1e-5);
        try std.testing.expectEqual(1, pixel[3]);
    };
}

test "a sphere covers the disc that it should, with smooth shading" {
    var builder: Builder = try .init();
    try builder.addSphere(fixture.matte(.{ 1, 1, 1 }), .{ 0, 0, -5 }, 2, 48);
    try builder.addCamera(.{ 0, 0, 0 }, 0.5);
    try builder.addPointLight(.{ 0, 0, 0 }, 9);
    var scene = try builder.finish();
    defer scene.deinit();
    var image = try fixture.render(&scene, .{ .width = 64, .height = 64 });
    defer image.deinit(gpa);
    for (0..64) |y| for (0..64) |x| {
        const a = ((@as(f32, @floatFromInt(x)) + 0.5) / 64 * 2 - 1) * 0.5;
        const b = (1 - (@as(f32, @floatFromInt(y)) + 0.5) / 64 * 2) * 0.5;
        // |t d - c| = 2 with d = (a, b, -1), c = (0, 0, -5).
        const dd = a * a + b * b + 1;
        const discriminant = 25 - dd * 21;
        const pixel = image.at(@intCast(x), @intCast(y)).*;
        if (@abs(discriminant) < 0.6) continue; // The outline is a polygon.
        if (discriminant < 0) {
            try std.testing.expectEqual([4]f32{ 0, 0, 0, 1 }, pixel);
            continue;
        }
        const t = (5 - @sqrt(discriminant)) / dd;
        const normal_z = (-t + 5) / 2;
        const cosine = (normal_z - (a * (t * a) / 2 + b * (t * b) / 2)) / @sqrt(dd);
        const expected = 9 * cosine / (std.math.pi * t * t * dd);
        try expectClose(1, pixel[0] / expected, 0.02);
    };
}

test "a flat mirror shows the mirrored scene" {
    var mirror = fixture.matte(.{ 1, 1, 1 });
    mirror.metallic = 1;
    mirror.roughness = 0;
    var builder: Builder = try .init();
    // The wall behind the eye: red on the left, green on the right as the mirror shows it.
    try builder.addQuad(mirror, .{ 0, 0, -4 }, .{ 9, 0, 0 }, .{ 0, 9, 0 });
    const red = fixture.flat(.{ 0.75, 0, 0 });
    const green = fixture.flat(.{ 0, 0.5, 0 });
    try builder.addQuad(red, .{ -50, 0, 5 }, .{ 0, 50, 0 }, .{ 50, 0, 0 });
    try builder.addQuad(green, .{ 50, 0, 5 }, .{ 0, 50, 0 }, .{ 50, 0, 0 });
    try builder.addCamera(.{ 0, 0, 0 }, 1);
    var scene = try builder.finish();
    defer scene.deinit();
    var image = try fixture.render(&scene, .{ .ambient = 0 });
    defer image.deinit(gpa);
    for (0..32) |y| for (0..32) |x| {
        const pixel = image.at(@intCast(x), @intCast(y)).*;
        const expected: [2]f32 = if (x < 16) .{ 0.75, 0 } else .{ 0, 0.5 };
        try expectClose(expected[0], pixel[0], 1e-5);
        try expectClose(expected[1], pixel[1], 1e-5);
    };
    var shallow = try fixture.render(&scene, .{ .ambient = 0, .depth_max = 0 });
    defer shallow.deinit(gpa);
    for (shallow.pixels) |pixel| try std.testing.expectEqual([4]f32{ 0, 0, 0, 1 }, pixel);
}

/// A slab of glass, 2 thick, before a wall that is dark left of x = `edge`.
fn slabScene(edge: f32, density: f32) !raylane.scene.Scene {
    var glass = fixture.matte(.{ 1, 1, 1 });
    glass.roughness = 0;
    glass.transmission = 1;
    glass.volume = true;
    glass.ior = 1.5;
    glass.double_sided = false;
    glass.attenuation_color = .{ 0.5, 0.25, 1 };
    glass.attenuation_distance = 1 / density;
    var builder: Builder = try .init();
    try builder.addQuad(glass, .{ 0, 0, -3 }, .{ 9, 0, 0 }, .{ 0, 9, 0 });
    try builder.addQuad(glass, .{ 0, 0, -5 }, .{ -9, 0, 0 }, .{ 0, 9, 0 });
    const wall = fixture.flat(.{ 1, 1, 1 });
    try builder.addQuad(wall, .{ edge + 9, 0, -8 }, .{ 9, 0, 0 }, .{ 0, 9, 0 });
    try builder.addCamera(.{ 0, 0, 0 }, 1);
    return builder.finish();
}

test "a glass slab: Fresnel twice and Beer's law, straight through" {
    var scene = try slabScene(-9, 1);
    defer scene.deinit();
    var image = try fixture.render(&scene, .{
        .width = 1,
        .height = 1,
        .ambient = 0,
        .depth_max = 2,
    });
    defer image.deinit(gpa);
    const passed = 0.96 * 0.96; // ((1.5 - 1) / (1.5 + 1))^2 = 0.04 is lost at each side.
    const pixel = image.at(0, 0).*;
    // The way inside is shorter by what rays start off surfaces, less than 1e-4 here.
    try expectClose(passed * 0.25, pixel[0], 1e-4);
    try expectClose(passed * 0.0625, pixel[1], 1e-4);
    try expectClose(passed, pixel[2], 1e-5);
}

test "a glass slab: Snell's law moves the edge of what is behind" {
    // Along slope s in air the ray has slope s' in glass: sin / 1.5. It meets the wall at
    // x = 3 s + 2 s' + 3 s; the edge lies where that is for s = 0.8.
    const slope: f32 = 0.8;
    const sine = slope / @sqrt(1 + slope * slope);
    const sine_inside = sine / 1.5;
    const slope_inside = sine_inside / @sqrt(1 - sine_inside * sine_inside);
    const edge = 6 * slope + 2 * slope_inside;
    var scene = try slabScene(edge, 1e-9);
    defer scene.deinit();
    const width = 200;
    var image = try fixture.render(&scene, .{ .width = width, .height = width, .ambient = 0 });
    defer image.deinit(gpa);
    const row = width / 2;
    const at: u32 = @intFromFloat((slope + 1) / 2 * width); // The pixel where the edge is.
    for (0..width) |x| {
        const seen = image.at(@intCast(x), row).*[0];
        if (x + 1 < at) try expect(seen < 0.2);
        if (x > at + 1) try expect(seen > 0.8);
    }
}

test "a shadow falls where the light is hidden, and colours behind glass" {
    var builder: Builder = try .init();
    try builder.addQuad(fixture.matte(.{ 1, 1, 1 }), .{ 0, 0, -10 }, .{ 20, 0, 0 }, .{ 0, 20, 0 });
    try builder.addQuad(fixture.matte(.{ 1, 1, 1 }), .{ -3, 0, -5 }, .{ 1, 0, 0 }, .{ 0, 1, 0 });
    var pane = fixture.matte(.{ 0.5, 0.25, 0.125 });
    pane.transmission = 1;
    try builder.addQuad(pane, .{ 3, 0, -5 }, .{ 1, 0, 0 }, .{ 0, 1, 0 });
    var veil = fixture.matte(.{ 0, 0, 0 });
    veil.alpha_mode = .blend;
    veil.base_color[3] = 0.75;
    try builder.addQuad(veil, .{ 0, 3, -5 }, .{ 1, 0, 0 }, .{ 0, 1, 0 });
    try builder.addPointLight(.{ 0, 0, 0 }, 1000);
    // Seen from between the panes and the wall.
    try builder.addCamera(.{ 0, 0, -6 }, 2);
    var scene = try builder.finish();
    defer scene.deinit();
    const size = 160;
    var image = try fixture.render(&scene, .{ .width = size, .height = size });
    defer image.deinit(gpa);
    const at = struct {
        fn at(picture: *const raylane.image.Image, x: f32, y: f32) [4]f32 {
            const column: u32 = @intFromFloat((x / 8 + 1) / 2 * size);
            const row: u32 = @intFromFloat((1 - y / 8) / 2 * size);
            return picture.at(column, row).*;
        }
    }.at;
    // The panes' shadows are twice as far from the axis as they are.
    const free = at(&image, -5.95, 3.95);
    try expect(free[0] > 1);
    try std.testing.expectEqual(0, at(&image, -5.95, 0.05)[0]);
    const same_distance = at(&image, 0.05, -5.95);
    const tinted = at(&image, 5.95, 0.05);
    try expectClose(0.5, tinted[0] / same_distance[0], 1e-3);
    try expectClose(0.25, tinted[1] / same_distance[1], 1e-3);
    try expectClose(0.125, tinted[2] / same_distance[2], 1e-3);
    const dimmed = at(&image, 0.05, 5.95);
    try expectClose(0.25, dimmed[0] / same_distance[0], 1e-3);
}

test "67 surfaces weaken a shadow ray, holes do not count, vertices colour" {
    var builder: Builder = try .init();
    try builder.addQuad(fixture.matte(.{ 1, 1, 1 }), .{ 0, 0, -10 }, .{ 20, 0, 0 }, .{ 0, 20, 0 });
    var veil = fixture.matte(.{ 0, 0, 0 });
    veil.alpha_mode = .blend;
    veil.base_color[3] = 1.0 / 16.0;
    var hole = veil;
    hole.alpha_mode = .mask;
    for (0..68) |index| {
        const behind = 0.004 * @as(f32, @floatFromInt(index));
        const z = -5 - behind;
        if (index < 67) {
            try builder.addQuad(veil, .{ -3, 0, z }, .{ 1, 0, 0 }, .{ 0, 1, 0 });
            try builder.addQuad(veil, .{ 0, 3, z }, .{ 1, 0, 0 }, .{ 0, 1, 0 });
        }
        try builder.addQuad(veil, .{ 3, 0, z }, .{ 1, 0, 0 }, .{ 0, 1, 0 });
        // More than are kept at once, before and between the veils.
        for ([_]f32{ -4, -5.001, -5.003 }) |first| {
            const place = [3]f32{ 0, 3, first - behind };
            try builder.addQuad(hole, place, .{ 1, 0, 0 }, .{ 0, 1, 0 });
        }
    }
    var pane = fixture.matte(.{ 1, 1, 1 });
    pane.transmission = 1;
    try builder.addQuad(pane, .{ 0, -3, -5 }, .{ 1, 0, 0 }, .{ 0, 1, 0 });
    try builder.addPointLight(.{ 0, 0, 0 }, 1000);
    try builder.addCamera(.{ 0, 0, -6 }, 2);
    var scene = try builder.finish();
    defer scene.deinit();
    const meshes = try gpa.dupe(raylane.scene.Mesh, scene.meshes);
    defer gpa.free(meshes);
    const colors: [4][4]f32 = @splat(.{ 0.5, 0.25, 1, 1 });
    meshes[meshes.len - 1].colors = &colors;
    scene.meshes = meshes;
    const size = 80;
    const last = raylane.variant.compiled.len - 1;
    var expected: ?u64 = null;
    for (0..last + 1) |variant| {
        const options: fixture.Options = .{ .width = size, .height = size, .variant = variant };
        var image = try fixture.render(&scene, options);
        defer image.deinit(gpa);
        try std.testing.expectEqual(expected orelse image.hash(), image.hash());
        expected = image.hash();
        if (variant < last) continue;
        // Pixels at the same distance from the axis: one in the light, one in each shadow.
        const free = image.at(size / 2 + 21, size / 2 + 21).*;
        const weakened = std.math.pow(f32, 15.0 / 16.0, 67);
        try expectClose(weakened, image.at(size / 2 - 31, size / 2).*[0] / free[0], 0.005);
        try std.testing.expectEqual(0, image.at(size / 2 + 30, size / 2).*[0]);
        try expectClose(weakened, image.at(size / 2, size / 2 - 31).*[0] / free[0], 0.005);
        const colored = image.at(size / 2, size / 2 + 30).*;
        for (colored[0..3], free[0..3], [3]f32{ 0.5, 0.25, 1 }) |seen, whole, share| {
            try expectClose(share, seen / whole, 0.005);
        }
    }
}

test "closed furnace: walls of radiance 1 around black things look the same everywhere" {
    var wall = fixture.matte(.{ 0, 0, 0 });
    wall.emissive = .{ 1, 1, 1 };
    wall.double_sided = false;
    var builder: Builder = try .init();
    for ([_][3][3]f32{
        .{ .{ 0, 0, -2 }, .{ 2, 0, 0 }, .{ 0, 2, 0 } },
        .{ .{ 0, 0, 2 }, .{ -2, 0, 0 }, .{ 0, 2, 0 } },
        .{ .{ -2, 0, 0 }, .{ 0, 0, -2 }, .{ 0, 2, 0 } },
        .{ .{ 2, 0, 0 }, .{ 0, 0, 2 }, .{ 0, 2, 0 } },
        .{ .{ 0, -2, 0 }, .{ 2, 0, 0 }, .{ 0, 0, -2 } },
        .{ .{ 0, 2, 0 }, .{ 2, 0, 0 }, .{ 0, 0, 2 } },
    }) |quad| try builder.addQuad(wall, quad[0], quad[1], quad[2]);
    var chrome = fixture.matte(.{ 1, 1, 1 });
    chrome.metallic = 1;
    chrome.roughness = 0;
    try builder.addSphere(chrome, .{ 0.3, 0.2, -1 }, 0.4, 16);
    try builder.addCamera(.{ 0, 0, 1.5 }, 2);
    try builder.addPointLight(.{ 0, 1, 1 }, 0);
    var scene = try builder.finish();
    defer scene.deinit();
    // The mirrored sphere shows the room or itself; at the last bounce what is black would end.
    var image = try fixture.render(&scene, .{ .ambient = 1, .width = 64, .height = 64 });
    defer image.deinit(gpa);
    for (image.pixels) |pixel| {
        for (pixel) |channel| try expectClose(1, channel, 1e-5);
    }
}

test "open furnace: in ambient light of radiance 1 whatever absorbs nothing cannot be seen" {
    var rough = fixture.matte(.{ 1, 1, 1 });
    rough.ior = 1.5;
    var metal = rough;
    metal.metallic = 1;
    metal.roughness = 0.6;
    var mirror = rough;
    mirror.metallic = 1;
    mirror.roughness = 0.1;
    var lacquer = rough;
    lacquer.roughness = 0.2;
    var glass = rough;
    glass.roughness = 0;
    glass.transmission = 1;
    glass.volume = true;
    var pane = glass;
    pane.volume = false;
    var veil = rough;
    veil.alpha_mode = .blend;
    veil.base_color[3] = 0.3;
    for ([_]raylane.scene.Material{ rough, metal, mirror, lacquer, glass, pane, veil }) |material| {
        var builder: Builder = try .init();
        try builder.addSphere(material, .{ 0, 0, -5 }, 2, 16);
        try builder.addCamera(.{ 0, 0, 0 }, 0.5);
        // A light of no strength keeps the default rig away.
        try builder.addPointLight(.{ 0, 0, 0 }, 0);
        var scene = try builder.finish();
        defer scene.deinit();
        var image = try fixture.render(&scene, .{
            .ambient = 1,
            .background = .{ 1, 1, 1 },
            .depth_max = 12,
        });
        defer image.deinit(gpa);
        // What a reflection is too weak to be traced for is less than 1/256 each.
        for (image.pixels) |pixel| {
            for (pixel) |channel| try expectClose(1, channel, 1e-4);
        }
    }
}

test "what lies behind more surfaces than a ray may go through is not black" {
    var veil = fixture.flat(.{ 1, 0, 0 });
    veil.alpha_mode = .blend;
    veil.base_color[3] = 1e-6;
    for ([_]bool{ false, true }) |transparent| for ([_]usize{ 255, 256, 300 }) |count| {
        var builder: Builder = try .init();
        for (0..count) |index| {
            const z = -2 - 0.01 * @as(f32, @floatFromInt(index));
            try builder.addQuad(veil, .{ 0, 0, z }, .{ 9, 0, 0 }, .{ 0, 9, 0 });
        }
        try builder.addCamera(.{ 0, 0, 0 }, 1);
        var scene = try builder.finish();
        defer scene.deinit();
        var image = try fixture.render(&scene, .{
            .width = 3,
            .height = 3,
            .ambient = 0,
            .background = .{ 0.25, 0.5, 2 },
            .transparent = transparent,
        });
        defer image.deinit(gpa);
        const expected: [3]f32 = if (transparent) .{ 0, 0, 0 } else .{ 0.25, 0.5, 2 };
        for (image.pixels) |pixel| {
            for (expected, pixel[0..3]) |channel, found| try expectClose(channel, found, 1e-3);
        }
    };
}

test "vertex alpha makes no hole in what is opaque" {
    var builder: Builder = try .init();
    try builder.addQuad(fixture.flat(.{ 1, 1, 1 }), .{ 0, 0, -2 }, .{ 9, 0, 0 }, .{ 0, 9, 0 });
    try builder.addCamera(.{ 0, 0, 0 }, 1);
    var scene = try builder.finish();
    defer scene.deinit();
    const colors: [6][4]f32 = @splat(.{ 1, 1, 1, -2 });
    var meshes = [_]raylane.scene.Mesh{scene.meshes[0]};
    meshes[0].colors = colors[0..meshes[0].positions.len];
    scene.meshes = &meshes;
    var image = try fixture.render(&scene, .{ .background = .{ 0, 0, 0 } });
    defer image.deinit(gpa);
    for (image.pixels) |pixel| try expectClose(1, pixel[0], 1e-6);
}

test "a hole shows what is behind it, a culled back too, and transparency leaves alpha" {
    var hole = fixture.flat(.{ 1, 0, 0 });
    hole.alpha_mode = .mask;
    hole.base_color[3] = 0.4;
    var back = fixture.flat(.{ 0, 1, 0 });
    back.double_sided = false;
    var veil = fixture.flat(.{ 0.8, 0.8, 0.8 });
    veil.alpha_mode = .blend;
    veil.base_color[3] = 0.25;
    var builder: Builder = try .init();
    try builder.addQuad(hole, .{ 0, 0, -2 }, .{ 9, 0, 0 }, .{ 0, 9, 0 });
    try builder.addQuad(back, .{ 0, 0, -3 }, .{ -9, 0, 0 }, .{ 0, 9, 0 });
    try builder.addQuad(veil, .{ 0, 0, -4 }, .{ 9, 0, 0 }, .{ 0, 9, 0 });
    // Twice the same place: the lower number comes first, and each counts once.
    try builder.addQuad(veil, .{ 0, 0, -4 }, .{ 9, 0, 0 }, .{ 0, 9, 0 });
    try builder.addCamera(.{ 0, 0, 0 }, 1);
    var scene = try builder.finish();
    defer scene.deinit();
    var image = try fixture.render(&scene, .{ .background = .{ 0, 0, 1 } });
    defer image.deinit(gpa);
    const shown = 0.8 * 0.25 + 0.75 * 0.25 * 0.8;
    for (image.pixels) |pixel| {
        try expectClose(shown, pixel[0], 1e-6);
        try expectClose(shown, pixel[1], 1e-6);
        try expectClose(shown + 0.75 * 0.75, pixel[2], 1e-6);
        try std.testing.expectEqual(1, pixel[3]);
    }
    var clear = try fixture.render(&scene, .{ .transparent = true });
    defer clear.deinit(gpa);
    for (clear.pixels) |pixel| {
        try expectClose(shown, pixel[2], 1e-6);
        try expectClose(1 - 0.75 * 0.75, pixel[3], 1e-6);
    }
}
