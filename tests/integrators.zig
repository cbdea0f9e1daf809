//! What all integrators that find bounced light owe: radiance that follows from a formula, light
//! that is neither made nor lost, and the same picture on every machine.
//!
//! In: furnaces, closed boxes with a known radiosity solution, a room with a lamp. Out: means of
//! small pictures beside what they must be.

const std = @import("std");
const fixture = @import("fixture.zig");
const raylane = @import("raylane");
const Builder = fixture.Builder;
const Image = raylane.image.Image;
const Integrator = raylane.settings.Integrator;
const Material = raylane.scene.Material;
const Sky = @import("environment.zig").Sky;
const gpa = std.testing.allocator;

/// Those that find light that has bounced. Virtual lights have emissive surfaces as a few lights,
/// as Whitted's integrator does, which is no solution: where these shine, paths are asked alone.
const bouncing = [_]Integrator{ .path, .lights };

/// The mean of each channel over the pixels.
fn meanOf(image: *const Image) [3]f64 {
    var sums: [3]f64 = @splat(0);
    for (image.pixels) |pixel| for (&sums, pixel[0..3]) |*sum, channel| {
        sum.* += channel;
    };
    const count: f64 = @floatFromInt(image.pixels.len);
    for (&sums) |*sum| sum.* /= count;
    return sums;
}

/// The brightest pixel, by the mean of its channels, of which a path may have one alone.
fn brightest(image: *const Image) f32 {
    var largest: f32 = 0;
    for (image.pixels) |pixel| largest = @max(largest, (pixel[0] + pixel[1] + pixel[2]) / 3);
    return largest;
}

/// A closed cube; its fronts are outside, or inside.
fn addCube(builder: *Builder, material: Material, half: f32, fronts: enum { out, in }) !void {
    var positions: [8][3]f32 = undefined;
    for (&positions, 0..) |*position, index| for (position, 0..) |*to, axis| {
        to.* = if (index >> @intCast(axis) & 1 == 0) -half else half;
    };
    var triangles = [_][3]u32{
        .{ 0, 4, 6 }, .{ 0, 6, 2 }, .{ 1, 3, 7 }, .{ 1, 7, 5 }, .{ 0, 1, 5 }, .{ 0, 5, 4 },
        .{ 2, 6, 7 }, .{ 2, 7, 3 }, .{ 0, 2, 3 }, .{ 0, 3, 1 }, .{ 4, 5, 7 }, .{ 4, 7, 6 },
    };
    if (fronts == .in) for (&triangles) |*triangle| std.mem.swap(u32, &triangle[0], &triangle[1]);
    try builder.addMesh(material, &positions, null, &triangles);
}

/// A light that gives none: scenes without any are lit from the camera.
fn addNoLight(builder: *Builder) !void {
    try builder.addPointLight(.{ 0, 0, 0 }, 0);
}

fn oneSided(color: [3]f32) Material {
    var material = fixture.matte(color);
    material.double_sided = false;
    return material;
}

fn expectMean(expected: [3]f64, image: *const Image, tolerance: f64) !void {
    for (expected, meanOf(image)) |wanted, found| {
        try std.testing.expectApproxEqRel(wanted, found, tolerance);
    }
}

test "a closed box that shines: emitted light over what is not reflected, from every wall" {
    const albedo = [3]f32{ 0.2, 0.5, 0.8 };
    const emitted = [3]f32{ 1, 0.25, 0.1 };
    var expected: [3]f64 = undefined;
    for (&expected, albedo, emitted) |*to, reflected, own| to.* = own / (1 - reflected);
    var wall = oneSided(albedo);
    wall.emissive = emitted;
    var builder: Builder = try .init();
    try addCube(&builder, wall, 1, .in);
    try builder.addCamera(.{ 0.2, 0.3, 0.4 }, 0.8);
    var scene = try builder.finish();
    defer scene.deinit();
    var image = try fixture.render(&scene, .{
        .integrator = .path,
        .width = 6,
        .height = 6,
        .sample_count = 16,
        .depth_max = 32,
        .ambient = 0,
    });
    defer image.deinit(gpa);
    try expectMean(expected, &image, 0.02);
    var lights = try fixture.render(&scene, .{
        .integrator = .lights,
        .width = 6,
        .height = 6,
        .sample_count = 4,
        .depth_max = 32,
        .ambient = 0,
    });
    defer lights.deinit(gpa);
    errdefer std.debug.print("lights: {any}\n", .{meanOf(&lights)});
    // Of what bounces more than six times, as in the third channel, light paths lose the rest.
    for (expected[0..2], meanOf(&lights)[0..2]) |wanted, found|
        try std.testing.expectApproxEqRel(wanted, found, 0.1);
}

/// The camera in the middle of a cube of 2 units sees a wall of it and nothing else, all of which
/// is alike: so it sees the mean of all walls.
const wall_fov = 1;

/// What the walls of that cube, which reflect half of the light, send back of `flux` watts: as
/// much as they get, for what comes back comes again, from 24 square units.
fn expectFlux(
    flux: f64,
    scene: *const raylane.scene.Scene,
    integrators: []const Integrator,
    tolerance: f64,
) !void {
    const radiance = flux / (24 * std.math.pi);
    for (integrators) |integrator| {
        var image = try fixture.render(scene, .{
            .integrator = integrator,
            .width = 8,
            .height = 8,
            .sample_count = 16,
            .depth_max = 32,
            .ambient = 0,
        });
        defer image.deinit(gpa);
        errdefer std.debug.print("{t}: {any}\n", .{ integrator, meanOf(&image) });
        try expectMean(@splat(radiance), &image, tolerance);
    }
}

test "all light of a point, and all of a lamp, arrives on walls around it, and again as often" {
    const walls = oneSided(@splat(0.5));
    {
        var builder: Builder = try .init();
        try addCube(&builder, walls, 1, .in);
        try builder.addPointLight(.{ 0, 0, 0 }, 3);
        try builder.addCamera(.{ 0, 0, 0 }, wall_fov);
        var scene = try builder.finish();
        defer scene.deinit();
        try expectFlux(4 * std.math.pi * 3.0, &scene, &bouncing, 0.04);
    }
    // White, so that it takes nothing of what comes back; the camera in it sees no backs.
    var lamp = oneSided(@splat(1));
    lamp.emissive = @splat(5);
    const half = 0.2;
    var builder: Builder = try .init();
    try addCube(&builder, walls, 1, .in);
    try addCube(&builder, lamp, half, .out);
    try builder.addCamera(.{ 0, 0, 0 }, wall_fov);
    var scene = try builder.finish();
    defer scene.deinit();
    const flux = std.math.pi * 5.0 * 24 * half * half;
    try expectFlux(flux, &scene, &.{.path}, 0.03);
    // What the lamp takes from the walls it does not give back as evenly.
    try expectFlux(flux, &scene, &.{.lights}, 0.15);
}

/// White materials by what they scatter: `least` of white light comes back.
const Lobe = struct { name: []const u8, least: f64 = 0.98, material: Material };

fn white(comptime changes: anytype) Material {
    var material = fixture.matte(@splat(1));
    inline for (comptime std.meta.fieldNames(@TypeOf(changes))) |name| {
        @field(material, name) = @field(changes, name);
    }
    return material;
}

const lobes = [_]Lobe{
    .{ .name = "matte", .material = white(.{}) },
    .{ .name = "dielectric", .material = white(.{ .ior = 1.5, .roughness = 0.3 }) },
    .{ .name = "mirror", .material = white(.{ .metallic = 1, .roughness = 0 }) },
    .{ .name = "metal", .material = white(.{ .metallic = 1, .roughness = 0.5 }) },
    .{ .name = "rough metal", .material = white(.{ .metallic = 1 }) },
    .{
        .name = "anisotropic metal",
        .least = 0.95,
        .material = white(.{ .metallic = 1, .roughness = 0.4, .anisotropy = 0.7 }),
    },
    .{
        .name = "sheen",
        .least = 0.9,
        .material = white(.{ .sheen_color = [3]f32{ 1, 1, 1 }, .sheen_roughness = 0.5 }),
    },
    .{
        .name = "coat",
        .least = 0.9,
        .material = white(.{ .clearcoat = 1, .clearcoat_roughness = 0.2 }),
    },
    .{ .name = "pane", .material = white(.{ .transmission = 1, .ior = 1.5, .roughness = 0 }) },
    .{
        .name = "rough pane",
        .least = 0.95,
        .material = white(.{ .transmission = 1, .ior = 1.5, .roughness = 0.5 }),
    },
    .{ .name = "leaf", .material = white(.{ .diffuse_transmission = 0.6 }) },
};

const glasses = [_]Lobe{
    .{
        .name = "glass",
        .least = 0.95,
        .material = white(.{ .transmission = 1, .ior = 1.5, .roughness = 0, .volume = true }),
    },
    .{
        .name = "rough glass",
        .least = 0.9,
        .material = white(.{ .transmission = 1, .ior = 1.5, .roughness = 0.4, .volume = true }),
    },
    .{
        .name = "dispersing glass",
        .least = 0.95,
        .material = white(.{
            .transmission = 1,
            .ior = 1.5,
            .roughness = 0,
            .volume = true,
            .dispersion = 1,
        }),
    },
};

/// Pictures of a lobe in white light from everywhere: the mean is white, or a little less where
/// layers lose some, and no single path brings much more than there is.
fn expectFurnace(lobe: *const Lobe, is_closed: bool) !void {
    var builder: Builder = try .init();
    if (is_closed)
        try addCube(&builder, lobe.material, 1, .out)
    else
        try builder.addQuad(lobe.material, .{ 0, 0, 0 }, .{ 2, 0, -2 }, .{ 0, 3, 0 });
    try addNoLight(&builder);
    try builder.addCamera(.{ 0.4, 0.3, 4 }, 0.15);
    var scene = try builder.finish();
    defer scene.deinit();
    var options: fixture.Options = .{
        .integrator = .path,
        .width = 16,
        .height = 16,
        .depth_max = 32,
        .ambient = 1,
    };
    var one = try fixture.render(&scene, options);
    defer one.deinit(gpa);
    errdefer std.debug.print("{s}: at most {d}\n", .{ lobe.name, brightest(&one) });
    try std.testing.expect(brightest(&one) < 3);
    options.width = 6;
    options.height = 6;
    options.sample_count = 32;
    var image = try fixture.render(&scene, options);
    defer image.deinit(gpa);
    for (meanOf(&image)) |channel| {
        errdefer std.debug.print("{s}: {any}\n", .{ lobe.name, meanOf(&image) });
        try std.testing.expect(channel > lobe.least and channel < 1.02);
    }
}

test "white furnace: every lobe, by paths, gives back what light there is, and none a firefly" {
    for (&lobes) |*lobe| try expectFurnace(lobe, false);
    for (&glasses) |*lobe| try expectFurnace(lobe, true);
}

test "white furnace: corners give back a white sky, light that comes straight and bounced light" {
    var sky: Sky = try .init(&Sky.plain(@splat(1)));
    defer sky.deinit();
    var builder: Builder = try .init();
    const matte = fixture.matte(@splat(1));
    try builder.addQuad(matte, .{ -1, 0, 0 }, .{ 1, 0, -1 }, .{ 0, 3, 0 });
    try builder.addQuad(matte, .{ 1, 0, 0 }, .{ 1, 0, 1 }, .{ 0, 3, 0 });
    try builder.addCamera(.{ 0.4, 0.3, 4 }, 0.15);
    var scene = try builder.finish();
    defer scene.deinit();
    for (bouncing) |integrator| {
        var image = try fixture.render(&scene, .{
            .integrator = integrator,
            .width = 6,
            .height = 6,
            .sample_count = 16,
            .depth_max = 32,
            .environment = sky.around(),
        });
        defer image.deinit(gpa);
        errdefer std.debug.print("{t}: {any}\n", .{ integrator, meanOf(&image) });
        try expectMean(@splat(1), &image, 0.05);
    }
}

/// A room that is open to the camera, with a lamp below its ceiling and a box in its middle.
fn room() !raylane.scene.Scene {
    const pale = fixture.matte(.{ 0.7, 0.7, 0.7 });
    var builder: Builder = try .init();
    try builder.addQuad(pale, .{ 0, -1, 0 }, .{ 1, 0, 0 }, .{ 0, 0, -1 });
    try builder.addQuad(pale, .{ 0, 1, 0 }, .{ 1, 0, 0 }, .{ 0, 0, 1 });
    try builder.addQuad(pale, .{ 0, 0, -1 }, .{ 1, 0, 0 }, .{ 0, 1, 0 });
    const red = fixture.matte(.{ 0.7, 0.1, 0.1 });
    try builder.addQuad(red, .{ -1, 0, 0 }, .{ 0, 0, -1 }, .{ 0, 1, 0 });
    const green = fixture.matte(.{ 0.1, 0.6, 0.1 });
    try builder.addQuad(green, .{ 1, 0, 0 }, .{ 0, 0, 1 }, .{ 0, 1, 0 });
    try addCube(&builder, pale, 0.3, .out);
    try builder.addPointLight(.{ 0.2, 0.6, 0.4 }, 1);
    try builder.addCamera(.{ 0, 0, 3 }, 0.35);
    return builder.finish();
}

/// Hashes of the room's pictures, which hold across architectures. Where a change means to change
/// what is seen, they are renewed from the failing test's own output.
const golden = .{ .path = 0x57924e472f39992a, .lights = 0x2d4db67c54b7f8e6 };

/// The picture, which has the golden hash.
fn renderRoom(comptime integrator: Integrator, sample_count: u32) !Image {
    var scene = try room();
    defer scene.deinit();
    var image = try fixture.render(&scene, .{
        .integrator = integrator,
        .width = 13,
        .height = 11,
        .depth_max = 16,
        .sample_count = sample_count,
        .thread_count = 2,
        .ambient = 0,
    });
    errdefer image.deinit(gpa);
    const hash = image.hash();
    errdefer std.debug.print("{t}: 0x{x:0>16}\n", .{ integrator, hash });
    try std.testing.expectEqual(@as(u64, @field(golden, @tagName(integrator))), hash);
    return image;
}

test "virtual lights and paths agree where nothing focuses light, on every machine alike" {
    var paths = try renderRoom(.path, 32);
    defer paths.deinit(gpa);
    var lights = try renderRoom(.lights, 8);
    defer lights.deinit(gpa);
    errdefer std.debug.print("{any} and {any}\n", .{ meanOf(&lights), meanOf(&paths) });
    // What virtual lights are clamped by near corners is lost.
    try expectMean(meanOf(&paths), &lights, 0.08);
}
