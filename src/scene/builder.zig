//! Scene builder: the lists of a `Scene`, grown one element at a time.
//!
//! One way for the readers, the procedural scenes and the tests. The lists grow in the memory that
//! the scene's arena takes its own from; what they point to lies in the arena. `finish` hands the
//! scene over; until then `deinit` frees everything.

const std = @import("std");
const math = @import("../math.zig");
const scene_data = @import("../scene.zig");
const Allocator = std.mem.Allocator;
const Error = Allocator.Error;
const Scene = scene_data.Scene;
const assert = std.debug.assert;

const Builder = @This();

/// Everything but the lists below may be set here.
scene: Scene,
nodes: std.ArrayList(scene_data.Node) = .empty,
meshes: std.ArrayList(scene_data.Mesh) = .empty,
instances: std.ArrayList(scene_data.Instance) = .empty,
skins: std.ArrayList(scene_data.Skin) = .empty,
materials: std.ArrayList(scene_data.Material) = .empty,
lights: std.ArrayList(scene_data.Light) = .empty,
cameras: std.ArrayList(scene_data.Camera) = .empty,
images: std.ArrayList(scene_data.Image) = .empty,
textures: std.ArrayList(scene_data.Texture) = .empty,
texture_indices: std.AutoHashMapUnmanaged(scene_data.Texture, u32) = .empty,

const list_names = [_][]const u8{
    "nodes",   "meshes", "instances", "skins", "materials", "lights",
    "cameras", "images", "textures",
};

/// A scene with nothing in it. `deinit` it, unless `finish` took it over.
pub fn init(allocator: Allocator) Builder {
    return .{ .scene = .init(allocator) };
}

/// Frees everything.
pub fn deinit(builder: *Builder) void {
    builder.freeLists();
    builder.scene.deinit();
    builder.* = undefined;
}

fn freeLists(builder: *Builder) void {
    inline for (list_names) |name| @field(builder, name).deinit(builder.gpa());
    builder.texture_indices.deinit(builder.gpa());
}

/// Where the lists grow.
fn gpa(builder: *const Builder) Allocator {
    return builder.scene.arena.child_allocator;
}

/// Where vertices, triangles and names live. The builder must not move while it is used.
pub fn arena(builder: *Builder) Allocator {
    return builder.scene.arena.allocator();
}

fn add(builder: *Builder, comptime name: []const u8, element: anytype) Error!u32 {
    const list = &@field(builder, name);
    try list.append(builder.gpa(), element);
    return @intCast(list.items.len - 1);
}

/// Adds a node below `parent`, which is `scene.none` for a root, and returns its index.
pub fn addNode(builder: *Builder, parent: u32, local: math.AffineD) Error!u32 {
    assert(parent == scene_data.none or parent < builder.nodes.items.len);
    return builder.add("nodes", scene_data.Node{ .parent = parent, .local = local });
}

/// Adds a material and returns its index.
pub fn addMaterial(builder: *Builder, material: scene_data.Material) Error!u32 {
    return builder.add("materials", material);
}

/// Adds a mesh without an instance and returns its index.
pub fn addMesh(builder: *Builder, mesh: scene_data.Mesh) Error!u32 {
    return builder.add("meshes", mesh);
}

/// Adds an instance of a mesh at a node.
pub fn addInstance(builder: *Builder, mesh: u32, node: u32) Error!void {
    try builder.addDeformedInstance(.{ .mesh = mesh, .node = node });
}

/// Adds an instance that may have morph weights, which live in the arena, and a skin that exists.
pub fn addDeformedInstance(builder: *Builder, instance: scene_data.Instance) Error!void {
    assert(instance.mesh < builder.meshes.items.len);
    assert(instance.node < builder.nodes.items.len);
    assert(instance.skin == scene_data.none or instance.skin < builder.skins.items.len);
    _ = try builder.add("instances", instance);
}

/// Adds a skin of nodes that exist, whose arrays live in the arena, and returns its index.
pub fn addSkin(builder: *Builder, skin: scene_data.Skin) Error!u32 {
    for (skin.joints) |node| assert(node < builder.nodes.items.len);
    return builder.add("skins", skin);
}

/// Adds a mesh in world space with its only instance.
pub fn addWorldMesh(builder: *Builder, mesh: scene_data.Mesh) Error!void {
    const node = try builder.addNode(scene_data.none, .identity);
    try builder.addInstance(try builder.addMesh(mesh), node);
}

/// Adds a light at a node that exists.
pub fn addLight(builder: *Builder, light: scene_data.Light) Error!void {
    assert(light.node < builder.nodes.items.len);
    _ = try builder.add("lights", light);
}

/// Adds a camera at a node that exists.
pub fn addCamera(builder: *Builder, camera: scene_data.Camera) Error!void {
    assert(camera.node < builder.nodes.items.len);
    _ = try builder.add("cameras", camera);
}

/// Adds an image, whose bytes must live as long as the scene, and returns its index.
pub fn addImage(builder: *Builder, image: scene_data.Image) Error!u32 {
    return builder.add("images", image);
}

/// Adds a texture of an image that exists, unless there is the same one, and returns its index.
pub fn addTexture(builder: *Builder, texture: scene_data.Texture) Error!u32 {
    assert(texture.image < builder.images.items.len);
    const entry = try builder.texture_indices.getOrPut(builder.gpa(), texture);
    if (!entry.found_existing) {
        errdefer _ = builder.texture_indices.remove(texture);
        entry.value_ptr.* = try builder.add("textures", texture);
    }
    return entry.value_ptr.*;
}

/// The scene, whose first camera is the default. The builder is empty afterwards and needs no
/// `deinit`; on an error it is as it was.
pub fn finish(builder: *Builder) Error!Scene {
    inline for (list_names) |name| {
        const items = @field(builder, name).items;
        const Element = @typeInfo(@TypeOf(items)).pointer.child;
        @field(builder.scene, name) = try builder.arena().dupe(Element, items);
    }
    if (builder.cameras.items.len > 0) builder.scene.camera_default = 0;
    builder.freeLists();
    const scene = builder.scene;
    builder.* = undefined;
    return scene;
}

fn buildSmall(allocator: Allocator) !void {
    var builder: Builder = .init(allocator);
    errdefer builder.deinit();
    const material = try builder.addMaterial(.{ .roughness = 0.25 });
    try builder.addWorldMesh(.{
        .positions = &.{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } },
        .triangles = &.{.{ 0, 1, 2 }},
        .material = material,
    });
    const above = try builder.addNode(0, .translate(.{ 0, 0, 5 }));
    try builder.addInstance(0, above);
    try builder.addLight(.{ .kind = .point, .node = above });
    try builder.addCamera(.{ .name = "", .node = above, .projection = .{
        .orthographic = .{ .half_width = 1, .half_height = 1 },
    } });
    var scene = try builder.finish();
    defer scene.deinit();
    scene.check();
    try std.testing.expectEqual(2, scene.triangleCount());
    try std.testing.expectEqual(0, scene.camera_default);
    try std.testing.expectEqual(0.25, scene.materials[0].roughness);
}

test "a scene is what was added, and a lack of memory leaks none" {
    try std.testing.checkAllAllocationFailures(std.testing.allocator, buildSmall, .{});
}
