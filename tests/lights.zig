//! Instant radiosity: bounced light that is known, and one picture by every variant.

const std = @import("std");
const fixture = @import("fixture.zig");
const raylane = @import("raylane");
const Builder = fixture.Builder;
const Session = raylane.session.Session;
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
    try builder.addCamera(.{ 0, 0, 3 }, 0.4);
    const white = fixture.matte(.{ 0.8, 0.8, 0.8 });
    try builder.addQuad(white, .{ 0, -1, 0 }, .{ 1, 0, 0 }, .{ 0, 0, -1 });
    try builder.addQuad(white, .{ 0, 0, -1 }, .{ 1, 0, 0 }, .{ 0, 1, 0 });
    const red = fixture.matte(.{ 0.8, 0.1, 0.1 });
    try builder.addQuad(red, .{ -1, 0, 0 }, .{ 0, 0, -1 }, .{ 0, 1, 0 });
    var metal = fixture.matte(.{ 0.9, 0.8, 0.5 });
    metal.metallic = 1;
    metal.roughness = 0.4;
    try builder.addQuad(metal, .{ 1, 0, 0 }, .{ 0, 0, 1 }, .{ 0, 1, 0 });
    var lamp = fixture.matte(.{ 0, 0, 0 });
    lamp.emissive = .{ 5, 5, 5 };
    try builder.addQuad(lamp, .{ 0, 0.9, 0 }, .{ 0.2, 0, 0 }, .{ 0, 0, 0.2 });
    var pane = fixture.matte(.{ 0.2, 0.5, 0.9 });
    pane.alpha_mode = .blend;
    pane.base_color[3] = 0.5;
    try builder.addQuad(pane, .{ 0.3, 0, 0 }, .{ 0.4, 0, 0.3 }, .{ 0, 0.5, 0 });
    var glass = fixture.matte(.{ 0.9, 1, 0.9 });
    glass.transmission = 1;
    glass.volume = true;
    glass.ior = 1.5;
    try builder.addSphere(glass, .{ -0.3, -0.5, 0.2 }, 0.4, 3);
    var scene = try builder.finish();
    defer scene.deinit();
    var first: ?u64 = null;
    for (raylane.variant.compiled, 0..) |variant, index| {
        if (raylane.variant.litIndexOf(index) == null) continue;
        var options: fixture.Options = .{
            .integrator = .lights,
            .width = 19,
            .height = 17,
            .depth_max = 4,
            .sample_count = 2,
            .environment = .{ .source = .studio },
            .variant = index,
        };
        for ([_]usize{ 2, 1 }, [_]u32{ 16, 5 }) |thread_count, tile_size| {
            // Other threads and tiles once will do.
            if (tile_size != 16 and first != null and index > 0) continue;
            var diagnostic: raylane.diagnostic.Diagnostic = .{};
            var session: Session = .init(gpa, std.testing.io, thread_count, &diagnostic);
            defer session.deinit();
            options.tile_size = tile_size;
            try fixture.view(&session, &scene, variant.lanes, options);
            const image = try fixture.trace(&session, options);
            if (first) |hash| try std.testing.expectEqual(hash, image.hash());
            first = first orelse image.hash();
        }
    }
}
