//! A scene builder in PBRT's terms: shapes at the current transformation, objects and their
//! instances, area lights.
//!
//! A PBRT world has the hand that its camera gives it: left with a plain LookAt, right after
//! `Scale -1 1 1`. Ours is right-handed. So the root, under which everything hangs, mirrors z where
//! the camera does not mirror itself, and the picture is the same as PBRT's in both cases.

const std = @import("std");
const lights = @import("lights.zig");
const limits = @import("limits.zig");
const math = @import("../../math.zig");
const scene_data = @import("../../scene.zig");
const Input = @import("input.zig");
const Tessellator = @import("shapes/tessellator.zig");
const vec3d = math.vec3d;
const Transform = math.AffineD;
const Allocator = std.mem.Allocator;
const Error = Input.Error;
const Geometry = Tessellator.Geometry;
const Vec3 = math.Vec3;

const SceneBuilder = @This();

/// A mesh within an object, in the space of its definition.
const Part = struct { mesh: u32, place: Transform };

/// Meshes that have their instances together, anywhere: a range of `parts`.
pub const Object = struct { first: usize, count: usize };

gpa: Allocator,
input: *Input,
/// What has been added so far.
scene: *scene_data.Builder,
parts: std.ArrayList(Part) = .empty,
/// Of all instances.
triangle_count: u64 = 0,
/// Radiance from everywhere, of all infinite lights that shine evenly.
sky: ?Vec3 = null,
/// There is an infinite light whose map is not read.
has_unknown_sky: bool = false,
/// Where the last mesh hangs: the next one most often has the same place.
last_node: ?struct { index: u32, place: Transform } = null,

/// Node that everything hangs on.
const root = 0;

/// Adds the root, whose map `finish` sets, to a scene without nodes.
pub fn init(input: *Input, scene: *scene_data.Builder) Allocator.Error!SceneBuilder {
    _ = try scene.addNode(scene_data.none, .identity);
    return .{ .gpa = input.gpa, .input = input, .scene = scene };
}

/// Frees all but the scene.
pub fn deinit(builder: *SceneBuilder) void {
    builder.parts.deinit(builder.gpa);
    builder.* = undefined;
}

/// Forgets what the world holds, for another one; materials stay.
pub fn clear(builder: *SceneBuilder) void {
    builder.scene.nodes.shrinkRetainingCapacity(root + 1);
    builder.scene.meshes.clearRetainingCapacity();
    builder.scene.instances.clearRetainingCapacity();
    builder.scene.lights.clearRetainingCapacity();
    builder.parts.clearRetainingCapacity();
    builder.triangle_count = 0;
    builder.scene.scene.environment = null;
    builder.scene.scene.has_area_lights = false;
    builder.sky = null;
    builder.has_unknown_sky = false;
    builder.last_node = null;
}

/// Adds a mesh without an instance and returns its index.
pub fn addMesh(builder: *SceneBuilder, geometry: Geometry, material: u32) Allocator.Error!u32 {
    return builder.scene.addMesh(.{
        .positions = geometry.positions,
        .normals = geometry.normals,
        .texcoords = .{ geometry.texcoords, null, null, null },
        .triangles = geometry.triangles,
        .material = material,
    });
}

/// Adds an instance of a mesh at `place` in the world.
pub fn instantiate(builder: *SceneBuilder, mesh: u32, place: *const Transform) Error!void {
    const node = node: {
        if (builder.last_node) |last| {
            if (std.meta.eql(last.place, place.*)) break :node last.index;
        }
        break :node try builder.scene.addNode(root, place.*);
    };
    builder.last_node = .{ .index = node, .place = place.* };
    try builder.instantiateAt(mesh, node);
}

fn instantiateAt(builder: *SceneBuilder, mesh: u32, node: u32) Error!void {
    if (builder.scene.instances.items.len >= limits.instance_count_max) return builder.input.fail(
        builder.input.offset(),
        "over {d} instances of meshes",
        .{limits.instance_count_max},
    );
    const triangle_count_max = builder.input.resources.triangleCountMax();
    builder.triangle_count += builder.scene.meshes.items[mesh].triangles.len;
    if (builder.triangle_count > triangle_count_max) return builder.input.failHere(
        "shapes so far have over {d} triangles (see --max-triangles)",
        .{triangle_count_max},
    );
    try builder.scene.addInstance(mesh, node);
}

/// Puts a mesh into the object that is being defined.
pub fn addPart(builder: *SceneBuilder, mesh: u32, place: *const Transform) Allocator.Error!void {
    try builder.parts.append(builder.gpa, .{ .mesh = mesh, .place = place.* });
}

/// Adds an instance of an object at `place`.
pub fn instantiateObject(
    builder: *SceneBuilder,
    object: Object,
    place: *const Transform,
) Error!void {
    const above = try builder.scene.addNode(root, place.*);
    builder.last_node = null;
    var last: ?struct { index: u32, place: Transform } = null;
    for (object.first..object.first + object.count) |index| {
        const part = &builder.parts.items[index];
        if (last == null or !std.meta.eql(last.?.place, part.place)) {
            const is_plain = std.meta.eql(part.place, Transform.identity);
            const node = if (is_plain)
                above
            else
                try builder.scene.addNode(above, part.place);
            last = .{ .index = node, .place = part.place };
        }
        try builder.instantiateAt(part.mesh, last.?.index);
    }
}

/// Adds a light at a node of its own, from which it shines along `direction`.
pub fn addLight(
    builder: *SceneBuilder,
    origin: math.Vec3d,
    direction: math.Vec3d,
    light: scene_data.Light,
) Allocator.Error!void {
    const z = vec3d.normalize(vec3d.scale(direction, -1)) orelse math.Vec3d{ 0, 0, 1 };
    // Any direction that is not along z.
    const hint: math.Vec3d = if (@abs(z[0]) < 0.6) .{ 1, 0, 0 } else .{ 0, 1, 0 };
    const x = vec3d.normalize(vec3d.cross(hint, z)).?;
    const place: Transform =
        .{ .x = x, .y = vec3d.cross(z, x), .z = z, .translation = origin };
    var placed = light;
    placed.node = try builder.scene.addNode(root, place);
    try builder.scene.addLight(placed);
}

/// Makes all light so much brighter.
pub fn brighten(builder: *SceneBuilder, factor: f32) void {
    if (factor == 1) return;
    const scene = builder.scene;
    for (scene.lights.items) |*light| light.color = lights.scaled(light.color, factor);
    for (scene.materials.items) |*material|
        material.emissive = lights.scaled(material.emissive, factor);
    if (scene.scene.environment) |*map| map.scale = lights.scaled(map.scale, factor);
    if (builder.sky) |*sky| sky.* = lights.scaled(sky.*, factor);
}

/// Adds the camera and gives the world its hand. `camera` maps the camera's space, x right, y up
/// and z forward, into the world.
pub fn finish(
    builder: *SceneBuilder,
    camera: Transform,
    projection: scene_data.Camera.Projection,
) Allocator.Error!void {
    // Our cameras look along -z.
    const backward: Transform = .scale(.{ 1, 1, -1 });
    const node = try builder.scene.addNode(root, camera.compose(backward));
    if (camera.determinant() > 0) {
        builder.scene.nodes.items[root].local = backward;
        // It is its own inverse.
        if (builder.scene.scene.environment) |*map| map.rotation = map.rotation.compose(backward);
    }
    try builder.scene.addCamera(.{ .name = "", .node = node, .projection = projection });
}
