//! Grows a procedural scene: the lists of `Scene`, each element by its plain description.
//!
//! Meshes are in world space and hang on one node that moves nothing; lights and cameras have a
//! node each. `finish` hands the scene over; until then `deinit` frees it.

const std = @import("std");
const math = @import("../math.zig");
const geometry = @import("geometry.zig");
const scene_data = @import("../scene.zig");
const Affine = math.Affine;
const AffineD = math.AffineD;
const Point = geometry.Point;
const Scene = scene_data.Scene;
const Allocator = std.mem.Allocator;
const assert = std.debug.assert;

const SceneBuilder = @This();

scene: Scene,
nodes: std.ArrayList(scene_data.Node) = .empty,
meshes: std.ArrayList(scene_data.Mesh) = .empty,
instances: std.ArrayList(scene_data.Instance) = .empty,
materials: std.ArrayList(scene_data.Material) = .empty,
lights: std.ArrayList(scene_data.Light) = .empty,
cameras: std.ArrayList(scene_data.Camera) = .empty,

/// Where a camera stands and what it sees.
pub const View = struct {
    name: []const u8,
    eye: Point,
    target: Point,
    /// Full vertical angle.
    y_fov_deg: f64,
    /// Width over height.
    aspect: f32,
};

/// A scene with nothing in it. `deinit` it, unless `finish` took it over.
pub fn init(gpa: Allocator) SceneBuilder {
    return .{ .scene = .init(gpa) };
}

/// Frees everything.
pub fn deinit(builder: *SceneBuilder) void {
    builder.scene.deinit();
    builder.* = undefined;
}

/// Where everything in the scene lives. The builder must not move while it is used.
pub fn arena(builder: *SceneBuilder) Allocator {
    return builder.scene.arena.allocator();
}

/// Adds a material and returns its index.
pub fn addMaterial(builder: *SceneBuilder, material: scene_data.Material) Allocator.Error!u32 {
    try builder.materials.append(builder.arena(), material);
    return @intCast(builder.materials.items.len - 1);
}

/// Adds a mesh in world space, seen once.
pub fn addMesh(builder: *SceneBuilder, mesh: scene_data.Mesh) Allocator.Error!void {
    assert(mesh.material < builder.materials.items.len);
    const index: u32 = @intCast(builder.meshes.items.len);
    const node = try builder.addNode(.identity);
    try builder.meshes.append(builder.arena(), mesh);
    try builder.instances.append(builder.arena(), .{ .mesh = index, .node = node });
}

/// Adds a point light; `intensity` in candela.
pub fn addPointLight(
    builder: *SceneBuilder,
    position: Point,
    color: math.Vec3,
    intensity: f32,
) Allocator.Error!void {
    var place: Affine = .identity;
    place.translation = geometry.toVec3(position);
    const node = try builder.addNode(.of(place));
    const light: scene_data.Light =
        .{ .kind = .point, .node = node, .color = color, .intensity = intensity };
    try builder.lights.append(builder.arena(), light);
}

/// Adds a directional light that comes from the direction `toward_light`; `intensity` in lux.
pub fn addDirectionalLight(
    builder: *SceneBuilder,
    toward_light: Point,
    color: math.Vec3,
    intensity: f32,
) Allocator.Error!void {
    const node = try builder.addNode(.of(lookAt(.{ 0, 0, 0 }, -toward_light)));
    const light: scene_data.Light =
        .{ .kind = .directional, .node = node, .color = color, .intensity = intensity };
    try builder.lights.append(builder.arena(), light);
}

/// Sets the radiance that comes from all sides.
pub fn setAmbient(builder: *SceneBuilder, radiance: f32) void {
    assert(radiance >= 0);
    builder.scene.ambient = radiance;
}

/// Adds a camera and makes the first one the default.
pub fn addCamera(builder: *SceneBuilder, view: View) Allocator.Error!void {
    assert(view.y_fov_deg > 0 and view.y_fov_deg < 180 and view.aspect > 0);
    const node = try builder.addNode(.of(lookAt(view.eye, view.target - view.eye)));
    try builder.cameras.append(builder.arena(), .{
        .name = view.name,
        .node = node,
        .projection = .{ .perspective = .{
            .y_fov_rad = @floatCast(view.y_fov_deg * (std.math.pi / 180.0)),
            .aspect = view.aspect,
        } },
    });
    builder.scene.camera_default = 0;
}

/// The scene. The builder is empty afterwards and needs no `deinit`.
pub fn finish(builder: *SceneBuilder) Allocator.Error!Scene {
    const allocator = builder.arena();
    builder.scene.nodes = try builder.nodes.toOwnedSlice(allocator);
    builder.scene.meshes = try builder.meshes.toOwnedSlice(allocator);
    builder.scene.instances = try builder.instances.toOwnedSlice(allocator);
    builder.scene.materials = try builder.materials.toOwnedSlice(allocator);
    builder.scene.lights = try builder.lights.toOwnedSlice(allocator);
    builder.scene.cameras = try builder.cameras.toOwnedSlice(allocator);
    const scene = builder.scene;
    builder.* = undefined;
    return scene;
}

/// Adds a root node and returns its index.
fn addNode(builder: *SceneBuilder, local: AffineD) Allocator.Error!u32 {
    try builder.nodes.append(builder.arena(), .{ .parent = scene_data.none, .local = local });
    return @intCast(builder.nodes.items.len - 1);
}

/// The placement at `origin` whose -z points along `forward` and whose y points up as far as it
/// can. Asserts that `forward` is not vertical.
fn lookAt(origin: Point, forward: Point) Affine {
    const z = geometry.normalize(-forward);
    const x = geometry.normalize(geometry.cross(.{ 0, 1, 0 }, z));
    const y = geometry.cross(z, x);
    return .{
        .x = geometry.toVec3(x),
        .y = geometry.toVec3(y),
        .z = geometry.toVec3(z),
        .translation = geometry.toVec3(origin),
    };
}

test "a camera looks along -z with y up" {
    const place = lookAt(.{ 1, 2, 3 }, .{ 0, 0, 5 });
    try std.testing.expectEqual(math.Vec3{ -1, 0, 0 }, place.x);
    try std.testing.expectEqual(math.Vec3{ 0, 1, 0 }, place.y);
    try std.testing.expectEqual(math.Vec3{ 0, 0, -1 }, place.z);
    const tilted = lookAt(.{ 0, 0, 0 }, .{ 1, -1, 2 });
    try std.testing.expectApproxEqAbs(@as(f32, 1), tilted.determinant(), 1e-6);
    try std.testing.expect(tilted.y[1] > 0);
}
