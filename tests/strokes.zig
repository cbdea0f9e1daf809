//! Points and lines: as wide as their pixels say, whatever their nodes' scales.

const std = @import("std");
const fixture = @import("fixture.zig");
const raylane = @import("raylane");
const Session = raylane.session.Session;
const View = raylane.settings.View;
const expect = std.testing.expect;
const gpa = std.testing.allocator;

const side = 64;

/// A picture of `side` pixels squared of one mesh at a node, its colours as radiance.
fn render(mesh: raylane.scene.Mesh, scale: [3]f64, view: View) !raylane.image.Image {
    var builder: fixture.Builder = try .init();
    const node = try builder.scene.addNode(
        raylane.scene.none,
        .fromTrs(.{ 0, 0, 0 }, .{ 0, 0, 0, 1 }, scale),
    );
    var drawn = mesh;
    drawn.material = try builder.scene.addMaterial(.{ .unlit = true });
    try builder.scene.addInstance(try builder.scene.addMesh(drawn), node);
    var diagnostic: raylane.diagnostic.Diagnostic = .{};
    var session: Session = .init(gpa, std.testing.io, 2, &diagnostic);
    defer session.deinit();
    session.adopt(try builder.finish(), .owned);
    var seen = view;
    seen.resolution = .{ side, side };
    seen.background = .{ .linear = .{ 0, 0, 0 } };
    seen.display_referred = false;
    try session.pose(.{ .lanes = raylane.variant.compiled[0].lanes, .view = seen });
    try session.view(seen);
    try session.render(.{ .sample_count = 8 });
    const image = session.film.?.image;
    const copy: raylane.image.Image = try .init(gpa, image.width, image.height);
    @memcpy(copy.pixels, image.pixels);
    return copy;
}

fn sum(image: *const raylane.image.Image, channel: usize) f32 {
    var total: f32 = 0;
    for (image.pixels) |pixel| total += pixel[channel];
    return total;
}

fn pointAt(place: *const [1][3]f32) raylane.scene.Mesh {
    return .{ .positions = place, .triangles = &.{}, .points = &.{0}, .material = 0 };
}

test "a point covers the disc that its pixels say, wherever it is" {
    for ([_]f32{ 12, 20, 1.5 }, [_]f32{ 0.05, 0.05, 0.25 }) |pixels, tolerance| {
        for ([_][1][3]f32{ .{.{ 0, 0, 0 }}, .{.{ 3000, -20, 7 }} }) |place| {
            for ([_]bool{ false, true }) |orthographic| {
                var image = try render(pointAt(&place), .{ 1, 1, 1 }, .{
                    .point_size = pixels,
                    .viewpoint = .{ .orthographic = orthographic },
                });
                defer image.deinit(gpa);
                const disc = std.math.pi / 4.0 * pixels * pixels;
                try std.testing.expectApproxEqRel(disc, sum(&image, 0), tolerance);
            }
        }
    }
}

/// A line across the picture, and points above and below, in one plane.
const cross = [4][3]f32{ .{ -1, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 }, .{ 0, -1, 0 } };
const red_to_blue = [4][4]f32{
    .{ 1, 0, 0, 1 }, .{ 0, 0, 1, 1 }, .{ 0, 1, 0, 1 }, .{ 0, 1, 0, 1 },
};

test "a line is as high as its pixels say, whatever the scale, and its colours change along it" {
    for ([_][3]f64{ .{ 1, 1, 1 }, .{ -4, 0.5, 100 }, .{ 0.001, 30, 0 } }) |scale| {
        var positions = cross;
        for (&positions) |*position| for (position, scale) |*to, factor| {
            if (to.* != 0) to.* = @floatCast(to.* / factor);
        };
        var image = try render(.{
            .positions = &positions,
            .colors = &red_to_blue,
            .triangles = &.{},
            .points = &.{ 2, 3 },
            .segments = &.{.{ 0, 1 }},
            .material = 0,
        }, scale, .{ .point_size = 6 });
        defer image.deinit(gpa);
        for ([_]u32{ 12, 31, 32, 50 }) |x| {
            var red: f32 = 0;
            var blue: f32 = 0;
            for (0..side) |y| {
                const pixel = image.at(x, @intCast(y)).*;
                red += pixel[0];
                blue += pixel[2];
            }
            try std.testing.expectApproxEqRel(@as(f32, 6), red + blue, 0.06);
            // From one end at the margin to the other.
            const share = (@as(f32, @floatFromInt(x)) + 0.5 - 0.04 * side) / (0.92 * side);
            try std.testing.expectApproxEqAbs(share, blue / (red + blue), 0.02);
        }
        try expect(sum(&image, 1) > 40);
    }
}

test "lines seen end on are dots" {
    for ([_]bool{ false, true }) |orthographic| {
        var image = try render(.{
            .positions = &.{ .{ 0, -1, 0 }, .{ 0, 1, 0 } },
            .triangles = &.{},
            .segments = &.{.{ 0, 1 }},
            .material = 0,
        }, .{ 1, 1, 1 }, .{ .viewpoint = .{
            .orbit = .{ .theta_degrees = 0, .phi_degrees = 0 },
            .orthographic = orthographic,
        } });
        defer image.deinit(gpa);
        try expect(sum(&image, 0) > 1 and sum(&image, 0) < 0.1 * side * side);
        try std.testing.expectEqual(1, image.at(side / 2, side / 2).*[0]);
    }
}

test "what has no length, and what is nowhere, is harmless" {
    const far = std.math.floatMax(f32);
    var image = try render(.{
        .positions = &.{ .{ 0, 0, 0 }, .{ 0, 0, 0 }, .{ 1, 1, 0 }, .{ far, far, far } },
        .triangles = &.{},
        .points = &.{ 3, 2, 2 },
        .segments = &.{ .{ 0, 1 }, .{ 1, 1 }, .{ 2, 3 } },
        .material = 0,
    }, .{ 1, 1, 1 }, .{});
    defer image.deinit(gpa);
    try expect(sum(&image, 0) > 1 and sum(&image, 0) < 12);
}

test "a scale of 0 hides points and lines" {
    for ([_]f64{ 0, 1e-9 }) |size| {
        var image = try render(.{
            .positions = &.{ .{ 0, 0, 0 }, .{ 1, 0, 0 } },
            .triangles = &.{},
            .points = &.{1},
            .segments = &.{.{ 0, 1 }},
            .material = 0,
        }, .{ size, size, size }, .{});
        defer image.deinit(gpa);
        try std.testing.expectEqual(size == 0, sum(&image, 0) == 0);
    }
}
