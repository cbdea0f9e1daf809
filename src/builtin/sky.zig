//! A sky dome: unlit, behind what the camera sees, from the horizon up.
//!
//! It shines by its colour alone. Like everything else it casts shadows, so it is to be left open
//! where the scene's directional lights come from.

const std = @import("std");
const elementary = @import("../math.zig").elementary;
const scene_data = @import("../scene.zig");
const MeshBuilder = @import("mesh_builder.zig");
const Vec3 = @import("../math.zig").Vec3;
const Builder = scene_data.Builder;
const Allocator = std.mem.Allocator;
const assert = std.debug.assert;

/// A piece of a sphere about the origin.
pub const Sky = struct {
    radius: f64,
    /// Middle of the piece, from +x towards -z, and half its width.
    azimuth_deg: f64,
    half_width_deg: f64,
    /// Where it begins and ends above the horizontal plane.
    elevation_min_deg: f64,
    elevation_max_deg: f64,
    /// Radiance at the lower and the upper border.
    low_color: Vec3,
    high_color: Vec3,
};

const columns = 24;
const rows = 8;

/// Adds the sky as a mesh of its own, seen from inside.
pub fn add(builder: *Builder, sky: Sky) Allocator.Error!void {
    assert(sky.half_width_deg > 0 and sky.half_width_deg < 180 and sky.radius > 0);
    var mesh: MeshBuilder = .init(builder.arena());
    for (0..rows + 1) |row| {
        const height = @as(f64, @floatFromInt(row)) / rows;
        const elevation_deg = sky.elevation_min_deg +
            (sky.elevation_max_deg - sky.elevation_min_deg) * height;
        const elevation_rad = elevation_deg * (std.math.pi / 180.0);
        for (&mesh.tint, sky.low_color, sky.high_color) |*value, low, high| {
            value.* = low + (high - low) * @as(f32, @floatCast(height));
        }
        for (0..columns + 1) |column| {
            const across = 1 - 2 * (@as(f64, @floatFromInt(column)) / columns);
            const azimuth_deg = sky.azimuth_deg + sky.half_width_deg * across;
            const azimuth_rad = azimuth_deg * (std.math.pi / 180.0);
            const ring = sky.radius * elementary.cos(elevation_rad);
            _ = try mesh.vertex(.{
                ring * elementary.cos(azimuth_rad),
                sky.radius * elementary.sin(elevation_rad),
                -ring * elementary.sin(azimuth_rad),
            }, null);
        }
    }
    try mesh.gridFaces(.{ .columns = columns, .rows = rows }, 0);
    const material = try builder.addMaterial(.{ .metallic = 0, .unlit = true });
    try builder.addWorldMesh(try mesh.finish(material));
}

test "the sky is seen from the origin" {
    var builder: Builder = .init(std.testing.allocator);
    defer builder.deinit();
    try add(&builder, .{
        .radius = 10,
        .azimuth_deg = 0,
        .half_width_deg = 90,
        .elevation_min_deg = -10,
        .elevation_max_deg = 60,
        .low_color = .{ 1, 1, 1 },
        .high_color = .{ 0, 0, 1 },
    });
    const vec3 = @import("../math.zig").vec3;
    const mesh = builder.meshes.items[0];
    try std.testing.expectEqual(2 * columns * rows, mesh.triangles.len);
    for (mesh.triangles) |t| {
        const a = mesh.positions[t[0]];
        const ab = vec3.sub(mesh.positions[t[1]], a);
        const ac = vec3.sub(mesh.positions[t[2]], a);
        try std.testing.expect(vec3.dot(vec3.cross(ab, ac), a) < 0);
        try std.testing.expect(a[0] > -1e-5);
    }
}
