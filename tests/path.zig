//! Path tracing: light that is known, two ways to find it that agree, and one picture by every
//! variant.

const std = @import("std");
const fixture = @import("fixture.zig");
const raylane = @import("raylane");
const Builder = fixture.Builder;
const Session = raylane.session.Session;
const gpa = std.testing.allocator;

/// The sum of an image's first three channels, over pixels.
fn meanOf(image: *const raylane.image.Image) [3]f64 {
    var sum: [3]f64 = @splat(0);
    for (image.pixels) |pixel| for (&sum, pixel[0..3]) |*to, channel| {
        to.* += channel;
    };
    const count: f64 = @floatFromInt(image.pixels.len);
    for (&sum) |*channel| channel.* /= count;
    return sum;
}

/// Expects paths to see nothing of a scene in white light that is all around, in the mean.
fn expectWhite(builder: *Builder, tolerance: f64) !void {
    var scene = try builder.finish();
    defer scene.deinit();
    var image = try fixture.render(&scene, .{
        .integrator = .path,
        .width = 4,
        .height = 4,
        .depth_max = 32,
        .sample_count = 32,
        .ambient = 1,
    });
    defer image.deinit(gpa);
    for (meanOf(&image)) |channel| try std.testing.expectApproxEqAbs(1, channel, tolerance);
}

test "white surfaces in white light are as bright, bounced among each other" {
    var builder: Builder = try .init();
    try builder.addCamera(.{ 0, 0, 5 }, 0.1);
    var smooth = fixture.matte(.{ 1, 1, 1 });
    smooth.ior = 1.5;
    smooth.roughness = 0.3;
    // Two walls that meet in the middle.
    try builder.addQuad(fixture.matte(.{ 1, 1, 1 }), .{ -1, 0, 0 }, .{ 1, 0, -1 }, .{ 0, 2, 0 });
    try builder.addQuad(smooth, .{ 1, 0, 0 }, .{ 1, 0, 1 }, .{ 0, 2, 0 });
    // Scenes without any light get some; this is behind the walls.
    try builder.addPointLight(.{ 0, 0, -5 }, 1e-3);
    try expectWhite(&builder, 0.03);
}

test "light that is chosen and light that rays meet are the same" {
    var builder: Builder = try .init();
    try fixture.addBox(&builder, 1.4);
    var scene = try builder.finish();
    defer scene.deinit();
    const options: fixture.Options = .{
        .integrator = .path,
        .width = 8,
        .height = 8,
        .depth_max = 3,
        .sample_count = 64,
        .ambient = 0.2,
    };
    var diagnostic: raylane.diagnostic.Diagnostic = .{};
    var session: Session = .init(gpa, std.testing.io, 1, &diagnostic);
    defer session.deinit();
    try fixture.view(&session, &scene, raylane.variant.default.lanes, options);
    const both = meanOf(try fixture.trace(&session, options));
    var film: raylane.film.Film = try .init(gpa, 8, 8, .init(.{ .color = true }));
    defer film.deinit(gpa);
    // Without a list of lights only rays meet them.
    _ = try raylane.trace.trace(gpa, 0, &session.world.?.frame(), &film, .{
        .pool = &session.pool,
        .integrator = .path,
        .sample_count = 64,
        .depth_max = 3,
    });
    for (both, meanOf(&film.image)) |expected, found| {
        try std.testing.expect(expected > 0.1);
        try std.testing.expectApproxEqRel(expected, found, 0.06);
    }
}

test "every variant, whatever threads and tiles, has the same path-traced picture" {
    var builder: Builder = try .init();
    try fixture.addBox(&builder, 0.3);
    var glass = fixture.matte(.{ 0.9, 1, 0.9 });
    glass.roughness = 0.2;
    glass.transmission = 1;
    glass.volume = true;
    glass.ior = 1.5;
    glass.attenuation_color = .{ 0.5, 0.9, 0.5 };
    glass.attenuation_distance = 0.5;
    try builder.addSphere(glass, .{ -0.3, -0.5, 0.2 }, 0.4, 3);
    try builder.addPointLight(.{ 0.2, 0.2, 0.9 }, 0.5);
    var scene = try builder.finish();
    defer scene.deinit();
    try fixture.expectOnePicture(&scene, .{
        .integrator = .path,
        .width = 19,
        .height = 9,
        .depth_max = 5,
        .sample_count = 3,
        .thread_count = 2,
        .ambient = 0.1,
    });
}

test "furnace: a ball of white mist, scattered in as often as it takes, cannot be seen" {
    var builder: Builder = try .init();
    try builder.addCamera(.{ 0, 0, 5 }, 0.1);
    var mist = fixture.matte(.{ 1, 1, 1 });
    mist.roughness = 0;
    mist.transmission = 1;
    mist.volume = true;
    mist.double_sided = false;
    mist.attenuation_color = .{ 0.2, 0.3, 0.4 };
    mist.attenuation_distance = 1;
    mist.multiscatter_color = .{ 1, 1, 1 };
    mist.scatter_anisotropy = 0.5;
    try builder.addSphere(mist, .{ 0, 0, 0 }, 1, 6);
    try builder.addPointLight(.{ 0, 0, -50 }, 1e-3);
    try expectWhite(&builder, 0.04);
}
