//! The Cornell box with a mirror and a glass sphere: 3,978 triangles, open towards the camera.
//!
//! Walls after the measurements published by the Cornell University Program of Computer Graphics
//! ("Cornell Box Data"), in units of 100 mm; their reflectance spectra are approximated in linear
//! RGB. A point light below the ceiling stands for the lamp.

const std = @import("std");
const geometry = @import("geometry.zig");
const MeshBuilder = @import("mesh_builder.zig");
const placing = @import("placing.zig");
const scene_data = @import("../scene.zig");
const Point = geometry.Point;
const Builder = scene_data.Builder;
const Scene = scene_data.Scene;
const Allocator = std.mem.Allocator;

const sphere_columns = 32;
const sphere_rows = 32;

/// The scene, owned by the caller.
pub fn build(gpa: Allocator) Allocator.Error!Scene {
    var builder: Builder = .init(gpa);
    errdefer builder.deinit();
    try addWalls(&builder);
    try addSpheres(&builder);
    try placing.addPointLight(&builder, .{ 2.78, 5.2, 2.795 }, .{ 1, 0.88, 0.7 }, 30);
    try placing.addCamera(&builder, .{
        .name = "cornell",
        .eye = .{ 2.78, 2.73, -8 },
        .target = .{ 2.78, 2.73, -7 },
        .y_fov_deg = 39.3077,
        .resolution = .{ 1024, 1024 },
    });
    return builder.finish();
}

/// Five walls, seen from inside. The measured room is not quite rectangular.
fn addWalls(builder: *Builder) Allocator.Error!void {
    const floor_front_left: Point = .{ 5.528, 0, 0 };
    const floor_front_right: Point = .{ 0, 0, 0 };
    const floor_back_right: Point = .{ 0, 0, 5.592 };
    const floor_back_left: Point = .{ 5.496, 0, 5.592 };
    const ceiling_front_left: Point = .{ 5.56, 5.488, 0 };
    const ceiling_front_right: Point = .{ 0, 5.488, 0 };
    const ceiling_back_right: Point = .{ 0, 5.488, 5.592 };
    const ceiling_back_left: Point = .{ 5.56, 5.488, 5.592 };

    var white: MeshBuilder = .init(builder.arena());
    try white.quad(floor_front_left, floor_front_right, floor_back_right, floor_back_left);
    try white.quad(ceiling_front_left, ceiling_back_left, ceiling_back_right, ceiling_front_right);
    try white.quad(floor_back_left, floor_back_right, ceiling_back_right, ceiling_back_left);
    var green: MeshBuilder = .init(builder.arena());
    try green.quad(floor_back_right, floor_front_right, ceiling_front_right, ceiling_back_right);
    var red: MeshBuilder = .init(builder.arena());
    try red.quad(floor_front_left, floor_back_left, ceiling_back_left, ceiling_front_left);

    const walls = [_]struct { *MeshBuilder, [4]f32 }{
        .{ &white, .{ 0.725, 0.71, 0.68, 1 } },
        .{ &green, .{ 0.14, 0.45, 0.091, 1 } },
        .{ &red, .{ 0.63, 0.065, 0.05, 1 } },
    };
    for (walls) |wall| {
        const mesh, const base_color = wall;
        const material = try builder.addMaterial(.{ .base_color = base_color, .metallic = 0 });
        try builder.addWorldMesh(try mesh.finish(material));
    }
}

/// The mirror behind on the left, the glass in front on the right; both stand on the floor.
fn addSpheres(builder: *Builder) Allocator.Error!void {
    var mirror: MeshBuilder = .init(builder.arena());
    try mirror.sphere(.{ 3.75, 1, 3.85 }, 1, sphere_columns, sphere_rows);
    try builder.addWorldMesh(try mirror.finish(try builder.addMaterial(.{
        .base_color = .{ 0.95, 0.95, 0.95, 1 },
        .metallic = 1,
        .roughness = 0,
    })));
    var glass: MeshBuilder = .init(builder.arena());
    try glass.sphere(.{ 1.6, 0.95, 1.9 }, 0.95, sphere_columns, sphere_rows);
    // Rays inside meet the surface from behind.
    try builder.addWorldMesh(try glass.finish(try builder.addMaterial(.{
        .metallic = 0,
        .roughness = 0,
        .double_sided = true,
        .transmission = 1,
        .volume = true,
        .ior = 1.5,
    })));
}

fn buildAndFree(gpa: Allocator) Allocator.Error!void {
    var scene = try build(gpa);
    scene.deinit();
}

test "a lack of memory leaks none" {
    try std.testing.checkAllAllocationFailures(std.testing.allocator, buildAndFree, .{});
}

test "spheres are closed" {
    var scene = try build(std.testing.allocator);
    defer scene.deinit();
    for (scene.meshes[3..]) |mesh| {
        try std.testing.expectEqual(2 * sphere_columns * (sphere_rows - 1), mesh.triangles.len);
        try std.testing.expectEqual(sphere_columns * (sphere_rows - 1) + 2, mesh.positions.len);
    }
}
