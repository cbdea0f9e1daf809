//! Instant radiosity: bounced light that is known, and one picture by every variant.

const std = @import("std");
const fixture = @import("fixture.zig");
const raylane = @import("raylane");
const Builder = fixture.Builder;
const gpa = std.testing.allocator;

test "the inside of a sphere has the light that bounces in it, everywhere the same" {
    var builder: Builder = try .init();
    try builder.addCamera(.{ 0.2, 0.1, 0.4 }, 0.8);
    const albedo = 0.5;
    try builder.addSphere(fixture.matte(@splat(albedo)), .{ 0, 0, 0 }, 1, 16);
    try builder.addPointLight(.{ 0, 0, 0 }, std.math.pi);
    var scene = try builder.finish();
    defer scene.deinit();
    for ([_]u32{ 0, 6 }) |depth_max| {
        var image = try fixture.render(&scene, .{
            .integrator = .lights,
            .width = 12,
            .height = 12,
            .depth_max = depth_max,
            .sample_count = 2,
        });
        defer image.deinit(gpa);
        // Radiance of direct light, and the sum of a geometric series.
        const expected: f32 = if (depth_max == 0) albedo else albedo / (1 - albedo);
        var mean: f32 = 0;
        for (image.pixels) |pixel| {
            try std.testing.expectApproxEqRel(expected, pixel[0], 0.15);
            mean += pixel[0] / (12.0 * 12.0);
        }
        // Triangles lie within the sphere.
        try std.testing.expectApproxEqRel(expected, mean, 0.04);
    }
}

test "every variant, whatever threads and tiles, has the same picture by virtual lights" {
    var builder: Builder = try .init();
    try fixture.addBox(&builder, 0.4);
    var glass = fixture.matte(.{ 0.9, 1, 0.9 });
    glass.transmission = 1;
    glass.volume = true;
    glass.ior = 1.5;
    try builder.addSphere(glass, .{ -0.3, -0.5, 0.2 }, 0.4, 3);
    var scene = try builder.finish();
    defer scene.deinit();
    try fixture.expectOnePicture(&scene, .{
        .integrator = .lights,
        .width = 19,
        .height = 17,
        .depth_max = 4,
        .sample_count = 2,
        .environment = .{ .source = .studio },
    });
}
