//! The scene as it grows: meshes, instances, materials, lights and the camera of a PBRT text.
//!
//! A PBRT world has the hand that its camera gives it: left with a plain LookAt, right after
//! `Scale -1 1 1`. Ours is right-handed. So the root, under which everything hangs, mirrors z where
//! the camera does not mirror itself, and the picture is the same as PBRT's in both cases.

const std = @import("std");
const limits = @import("limits.zig");
const math = @import("../../math.zig");
const scene_data = @import("../../scene.zig");
const Input = @import("input.zig");
const Maker = @import("shapes/maker.zig");
const Transform = @import("transform.zig");
const Allocator = std.mem.Allocator;
const Error = Input.Error;
const Geometry = Maker.Geometry;
const Scene = scene_data.Scene;
const Vec3 = math.Vec3;
const assert = std.debug.assert;

const Assembly = @This();

/// A shape that shines, to become lights once all of them are known.
pub const Emitter = struct {
    geometry: Geometry,
    place: Transform,
    radiance: Vec3,
    two_sided: bool,
};

/// A mesh within an object, in the space of its definition.
const Part = struct { mesh: u32, place: Transform };

/// Meshes that are shown together, anywhere: a range of `parts`.
pub const Object = struct { first: usize, count: usize };

gpa: Allocator,
input: *Input,
scene: *Scene,
nodes: std.ArrayList(scene_data.Node) = .empty,
meshes: std.ArrayList(scene_data.Mesh) = .empty,
instances: std.ArrayList(scene_data.Instance) = .empty,
materials: std.ArrayList(scene_data.Material) = .empty,
lights: std.ArrayList(scene_data.Light) = .empty,
emitters: std.ArrayList(Emitter) = .empty,
parts: std.ArrayList(Part) = .empty,
/// Radiance from everywhere, of all infinite lights that shine evenly.
sky: ?Vec3 = null,
/// There is an infinite light whose map is not read.
has_unknown_sky: bool = false,
/// Where the last mesh hangs: the next one most often has the same place.
last_node: ?struct { index: u32, place: Transform } = null,

/// Node that everything hangs on.
const root = 0;

/// Frees all but the scene.
pub fn deinit(assembly: *Assembly) void {
    const gpa = assembly.gpa;
    assembly.nodes.deinit(gpa);
    assembly.meshes.deinit(gpa);
    assembly.instances.deinit(gpa);
    assembly.materials.deinit(gpa);
    assembly.lights.deinit(gpa);
    assembly.emitters.deinit(gpa);
    assembly.parts.deinit(gpa);
    assembly.* = undefined;
}

/// Forgets what the world holds, for another one; materials stay.
pub fn clear(assembly: *Assembly) void {
    assembly.nodes.clearRetainingCapacity();
    assembly.meshes.clearRetainingCapacity();
    assembly.instances.clearRetainingCapacity();
    assembly.lights.clearRetainingCapacity();
    assembly.emitters.clearRetainingCapacity();
    assembly.parts.clearRetainingCapacity();
    assembly.sky = null;
    assembly.has_unknown_sky = false;
    assembly.last_node = null;
}

/// Adds a node and returns its index. The first one is the root, whose map `finish` sets.
pub fn addNode(assembly: *Assembly, parent: u32, local: math.AffineD) Allocator.Error!u32 {
    if (assembly.nodes.items.len == 0)
        try assembly.nodes.append(assembly.gpa, .{ .parent = scene_data.none, .local = .identity });
    try assembly.nodes.append(assembly.gpa, .{ .parent = parent, .local = local });
    return @intCast(assembly.nodes.items.len - 1);
}

/// Adds a material and returns its index.
pub fn addMaterial(assembly: *Assembly, material: scene_data.Material) Allocator.Error!u32 {
    try assembly.materials.append(assembly.gpa, material);
    return @intCast(assembly.materials.items.len - 1);
}

/// Adds a mesh without showing it and returns its index.
pub fn addMesh(assembly: *Assembly, geometry: Geometry, material: u32) Allocator.Error!u32 {
    assert(material < assembly.materials.items.len);
    try assembly.meshes.append(assembly.gpa, .{
        .positions = geometry.positions,
        .normals = geometry.normals,
        .triangles = geometry.triangles,
        .material = material,
    });
    return @intCast(assembly.meshes.items.len - 1);
}

/// Shows a mesh at `place` in the world.
pub fn show(assembly: *Assembly, mesh: u32, place: *const Transform) Error!void {
    const node = node: {
        if (assembly.last_node) |last| {
            if (std.meta.eql(last.place, place.*)) break :node last.index;
        }
        break :node try assembly.addNode(root, place.toAffine());
    };
    assembly.last_node = .{ .index = node, .place = place.* };
    try assembly.showAt(mesh, node);
}

fn showAt(assembly: *Assembly, mesh: u32, node: u32) Error!void {
    if (assembly.instances.items.len >= limits.instance_count_max) return assembly.input.fail(
        assembly.input.offset(),
        "over {d} showings of meshes",
        .{limits.instance_count_max},
    );
    try assembly.instances.append(assembly.gpa, .{ .mesh = mesh, .node = node });
}

/// Puts a mesh into the object that is being defined.
pub fn addPart(assembly: *Assembly, mesh: u32, place: *const Transform) Allocator.Error!void {
    try assembly.parts.append(assembly.gpa, .{ .mesh = mesh, .place = place.* });
}

/// Shows an object at `place`.
pub fn showObject(assembly: *Assembly, object: Object, place: *const Transform) Error!void {
    const above = try assembly.addNode(root, place.toAffine());
    assembly.last_node = null;
    var last: ?struct { index: u32, place: Transform } = null;
    for (object.first..object.first + object.count) |index| {
        const part = &assembly.parts.items[index];
        if (last == null or !std.meta.eql(last.?.place, part.place)) {
            const is_plain = std.meta.eql(part.place, Transform.identity);
            const node = if (is_plain)
                above
            else
                try assembly.addNode(above, part.place.toAffine());
            last = .{ .index = node, .place = part.place };
        }
        try assembly.showAt(part.mesh, last.?.index);
    }
}

/// Adds a light at a node of its own, from which it shines along `direction`.
pub fn addLight(
    assembly: *Assembly,
    origin: Transform.Vector,
    direction: Transform.Vector,
    light: scene_data.Light,
) Allocator.Error!void {
    const z = Transform.normalize(Transform.scaled(direction, -1)) orelse
        Transform.Vector{ 0, 0, 1 };
    // Any direction that is not along z.
    const hint: Transform.Vector = if (@abs(z[0]) < 0.6) .{ 1, 0, 0 } else .{ 0, 1, 0 };
    const x = Transform.normalize(Transform.cross(hint, z)).?;
    const place: Transform = .{ .axes = .{ x, Transform.cross(z, x), z }, .origin = origin };
    var placed = light;
    placed.node = try assembly.addNode(root, place.toAffine());
    try assembly.lights.append(assembly.gpa, placed);
}

/// Hands everything over to the scene. `camera` maps the camera's space, x right, y up and z
/// forward, into the world.
pub fn finish(
    assembly: *Assembly,
    camera: *const Transform,
    projection: scene_data.Camera.Projection,
) Error!void {
    const scene = assembly.scene;
    const arena = scene.arena.allocator();
    // Our cameras look along -z.
    const backward = Transform.scaling(.{ 1, 1, -1 });
    const node = try assembly.addNode(root, camera.compose(&backward).toAffine());
    if (camera.determinant() > 0) assembly.nodes.items[root].local = backward.toAffine();
    scene.nodes = try arena.dupe(scene_data.Node, assembly.nodes.items);
    scene.meshes = try arena.dupe(scene_data.Mesh, assembly.meshes.items);
    scene.instances = try arena.dupe(scene_data.Instance, assembly.instances.items);
    scene.materials = try arena.dupe(scene_data.Material, assembly.materials.items);
    scene.lights = try arena.dupe(scene_data.Light, assembly.lights.items);
    scene.cameras = try arena.dupe(scene_data.Camera, &.{.{
        .name = "",
        .node = node,
        .projection = projection,
    }});
    scene.camera_default = 0;
}
