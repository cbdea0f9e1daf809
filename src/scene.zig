//! Data 1: what a scene file says, owned and checked.
//!
//! `parse` fills it, `prepare` reads it. Everything in it has been validated: indices are in
//! range, numbers are finite and not denormal, triangle lists are whole. Linear units: metres,
//! radians, candela, lux, linear RGB. Right-handed, y up, as in glTF.

const std = @import("std");
const math = @import("math.zig");
const assert = std.debug.assert;
const AffineD = math.AffineD;
const Vec3 = math.Vec3;

/// Grows a `Scene`.
pub const Builder = @import("scene/builder.zig");

/// How points in rows become triangles.
pub const Grid = @import("scene/grid.zig");

/// What a file says of itself.
pub const File = @import("scene/file.zig").File;

const animation_file = @import("scene/animation.zig");
const material_file = @import("scene/material.zig");

pub const Animation = animation_file.Animation;
pub const CameraProperty = animation_file.CameraProperty;
pub const Channel = animation_file.Channel;
pub const Interpolation = animation_file.Interpolation;
pub const LightProperty = animation_file.LightProperty;
pub const MaterialProperty = animation_file.MaterialProperty;
pub const Moving = animation_file.Moving;
pub const MovingNode = animation_file.MovingNode;
pub const Sampler = animation_file.Sampler;
pub const Target = animation_file.Target;
pub const TextureField = animation_file.TextureField;
pub const TransformPart = animation_file.TransformPart;

pub const AlphaMode = material_file.AlphaMode;
pub const Material = material_file.Material;
pub const texture_fields = material_file.texture_fields;

/// Index that stands for "none".
pub const none: u32 = std.math.maxInt(u32);

/// A node of the hierarchy: where things are. Only nodes that the shown scene reaches, and those
/// that the joints of what it shows hang from.
pub const Node = struct {
    /// Index of the parent, always lower than the node's own, or `none` for a root.
    parent: u32,
    /// Map from this node's space into its parent's.
    local: AffineD,
    /// The file's number of it, or `none`.
    origin: u32 = none,
};

/// A picture in a file: as it came, not decoded.
pub const Image = struct {
    /// What messages call it, printable, in quotes where it is a name of the file's.
    name: []const u8,
    bytes: []const u8,
    /// Where it is gray it holds heights, of which normals are to be made.
    is_relief: bool = false,
};

/// What a texture has beyond its image.
pub const Wrap = enum { repeat, mirrored_repeat, clamp_to_edge };

/// How a texture is looked up between its texels.
pub const Filter = enum { nearest, linear };

/// And between the levels of its pyramid; `none`: there is but the finest.
pub const MipFilter = enum { none, nearest, linear };

/// An image and how it is looked up (glTF 2.0, sections 3.8.3 and 3.8.4).
pub const Texture = struct {
    image: u32,
    wrap: [2]Wrap = .{ .repeat, .repeat },
    magnify: Filter = .linear,
    minify: Filter = .linear,
    mip: MipFilter = .linear,
};

/// Sets of texture coordinates of a mesh at most.
pub const texcoord_set_count = 4;

/// A texture as a material uses it.
pub const TextureView = struct {
    /// Index into `Scene.textures`.
    texture: u32,
    /// Below `texcoord_set_count`.
    texcoord_set: u32 = 0,
    /// Rows of the affine map of texture coordinates (KHR_texture_transform):
    /// u' = row[0] u + row[1] v + row[2].
    transform: [2][3]f32 = .{ .{ 1, 0, 0 }, .{ 0, 1, 0 } },
    /// What it is made of, where animations move that.
    parts: TextureTransform = .{},
};

/// What KHR_texture_transform is made of.
pub const TextureTransform = struct {
    offset: [2]f32 = .{ 0, 0 },
    rotation_rad: f32 = 0,
    scale: [2]f32 = .{ 1, 1 },

    /// Scaled, turned, moved; null where the angle has no digits left. The turn is
    /// counter-clockwise on the texture as it is seen, v downwards, as every viewer has it and as
    /// the sample TextureTransformTest shows; the matrix in the extension's text is its inverse.
    pub fn rows(parts: TextureTransform) ?[2][3]f32 {
        if (!(@abs(parts.rotation_rad) <= 1e5)) return null;
        const cosine: f32 = @floatCast(math.elementary.cos(parts.rotation_rad));
        const sine: f32 = @floatCast(math.elementary.sin(parts.rotation_rad));
        const u, const v = parts.scale;
        var transform: [2][3]f32 = .{
            .{ cosine * u, sine * v, parts.offset[0] },
            .{ -sine * u, cosine * v, parts.offset[1] },
        };
        for (&transform) |*row| for (row) |*value| {
            value.* = math.flushDenormal(value.*);
        };
        return transform;
    }
};

/// What a morph target adds to every vertex of a mesh that has as much itself, times its weight;
/// null: nothing (glTF 2.0, section 3.7.2.2).
pub const MorphTarget = struct {
    positions: ?[]const Vec3 = null,
    normals: ?[]const Vec3 = null,
    /// The sign of the bitangent stays.
    tangents: ?[]const Vec3 = null,
    colors: ?[]const [4]f32 = null,
    texcoords: [texcoord_set_count]?[]const [2]f32 = @splat(null),
};

/// Four of the joints that move each vertex (glTF 2.0, section 3.7.3.3).
pub const JointSet = struct {
    /// Numbers among the joints of a skin.
    joints: []const [4]u16,
    /// At least 0. All of a vertex's sum up to more than 0, not necessarily to 1.
    weights: []const [4]f32,
};

/// Sets of joints of a mesh at most.
pub const joint_set_count = 2;

/// Nodes that meshes are hung on.
pub const Skin = struct {
    /// Nodes by number of the joint.
    joints: []const u32,
    /// By number of the joint: from the mesh's space to the joint's own, where it was bound.
    inverse_bind_maps: []const AffineD,
};

/// Triangles with one material, or points, or segments of lines, in the space of the node that
/// shows them.
pub const Mesh = struct {
    positions: []const Vec3,
    /// One a vertex, not necessarily of unit length; null: the faces are flat.
    normals: ?[]const Vec3 = null,
    /// Linear RGBA a vertex, multiplied with the material's base colour; null: white.
    colors: ?[]const [4]f32 = null,
    /// One a vertex in each set; null: none, which counts as 0 everywhere.
    texcoords: [texcoord_set_count]?[]const [2]f32 = @splat(null),
    /// One a vertex: a direction and, fourth, 1 or -1 for the sign of the bitangent; null: where a
    /// normal texture needs them they are made.
    tangents: ?[]const [4]f32 = null,
    /// What instances may add to the vertices.
    morph_targets: []const MorphTarget = &.{},
    /// What moves the vertices of instances with a skin, at most `joint_set_count`.
    joint_sets: []const JointSet = &.{},
    /// Vertex indices, counter-clockwise seen from the front.
    triangles: []const [3]u32,
    /// Vertex indices: each is drawn as a small sphere.
    points: []const u32 = &.{},
    /// Vertex indices of both ends: each is drawn as a thin capsule. Ends with the same index are
    /// joined.
    segments: []const [2]u32 = &.{},
    /// Index into `Scene.materials`.
    material: u32,
    /// The file's number of what it is a part of, or `none`; and its place there.
    origin: u32 = none,
    primitive: u32 = 0,

    /// Whether there is nothing to draw.
    pub fn isEmpty(mesh: *const Mesh) bool {
        return mesh.triangles.len == 0 and mesh.points.len == 0 and mesh.segments.len == 0;
    }
};

/// A mesh at a node.
pub const Instance = struct {
    mesh: u32,
    node: u32,
    /// One for each morph target of the mesh; empty: all are 0.
    morph_weights: []const f32 = &.{},
    /// Index into `Moving.weights`: of those that these are at rest. Or `none`.
    moving_weights: u32 = none,
    /// Index into `Scene.skins`, of meshes with joints: these place the mesh, not the node. Or
    /// `none`.
    skin: u32 = none,
};

/// Light from all around, as an image by direction.
pub const EnvironmentMap = struct {
    /// Index into `Scene.images`.
    image: u32,
    projection: Projection = .equirectangular,
    /// Of a cube all images, in the order +x, -x, +y, -y, +z, -z; `image` is the first.
    faces: [6]u32 = @splat(none),
    /// It is the background as well, unless the user chooses another one.
    is_seen: bool = false,
    /// Multiplies the image's radiance.
    scale: Vec3 = .{ 1, 1, 1 },
    /// From the world's directions to those of the image: a rotation, which may mirror.
    rotation: AffineD = .identity,

    /// Where an image has a direction, (0, 0) its upper left corner and (1, 1) its lower right one.
    pub const Projection = enum {
        /// u = atan2(z, x) / 2 pi + 1/2, v = acos(y) / pi, see docs/environment.md.
        equirectangular,
        /// A square: `math.equal_area`.
        octahedral,
        /// Six images, each as it is seen from within, upwards y, in that of +y -z, in that of -y
        /// +z. PNG files with alpha are RGBD: their colours are divided by alpha.
        cube,
    };
};

/// A light source (KHR_lights_punctual); it shines from its node's origin along its node's -z.
pub const Light = struct {
    pub const Kind = enum { point, spot, directional };

    kind: Kind,
    node: u32,
    /// Linear RGB, times `intensity`.
    color: Vec3 = .{ 1, 1, 1 },
    /// Candela (point, spot) or lux (directional).
    intensity: f32 = 1,
    /// Distance where the light ends; infinity: never.
    range: f32 = std.math.inf(f32),
    /// Spot only, radians from the axis: full light within.
    inner_cone_rad: f32 = 0,
    /// Spot only, radians from the axis: no light beyond, > inner, <= pi / 2.
    outer_cone_rad: f32 = std.math.pi / 4.0,

    /// Sets both angles to the nearest that fit: 0 <= inner < outer <= pi / 2.
    pub fn setCone(light: *Light, inner_rad: f32, outer_rad: f32) void {
        const outer_max: f32 = std.math.pi / 2.0;
        const outer_min: f32 = 1e-3;
        var outer = outer_rad;
        if (outer > outer_max) outer = outer_max;
        if (!(outer > outer_min)) outer = outer_min;
        var inner = inner_rad;
        if (!(inner >= 0)) inner = 0;
        const inner_max = outer * 0.9999;
        if (inner > inner_max) inner = inner_max;
        light.inner_cone_rad = inner;
        light.outer_cone_rad = outer;
    }
};

/// A view; it looks from its node's origin along its node's -z, y up.
pub const Camera = struct {
    /// Empty where the file gives none.
    name: []const u8,
    node: u32,
    projection: Projection,

    pub const Projection = union(enum) {
        perspective: struct {
            /// Full vertical angle in radians, 0 < y_fov_rad < pi.
            y_fov_rad: f32,
            /// Width over height; null: the image's.
            aspect: ?f32,
        },
        orthographic: struct {
            /// Half of the width and of the height, > 0.
            half_width: f32,
            half_height: f32,
        },
    };
};

/// What a file calls things, by its own numbers (`origin`); empty ones where it gives no name, and
/// no list where the format has none.
pub const Names = struct {
    nodes: []const []const u8 = &.{},
    meshes: []const []const u8 = &.{},
    materials: []const []const u8 = &.{},
};

/// A whole file. Everything lives in the arena.
pub const Scene = struct {
    arena: std.heap.ArenaAllocator,
    nodes: []const Node = &.{},
    meshes: []const Mesh = &.{},
    instances: []const Instance = &.{},
    skins: []const Skin = &.{},
    materials: []const Material = &.{},
    lights: []const Light = &.{},
    cameras: []const Camera = &.{},
    images: []const Image = &.{},
    textures: []const Texture = &.{},
    environment: ?EnvironmentMap = null,
    file: File = .{},
    names: Names = .{},
    /// In the order of the file, those that move nothing as well.
    animations: []const Animation = &.{},
    moving: Moving = .{},
    /// Names of what the file may be shown as, by the materials of its meshes (which are those of
    /// the variant that was asked for); empty ones where it gives none.
    material_variants: []const []const u8 = &.{},
    /// Its format has z point up, unless the user says otherwise.
    is_z_up: bool = false,
    /// Index of the camera that the file itself would use, `none` without cameras.
    camera_default: u32 = none,
    /// Surfaces that emit are all of the lights that the file says, each to be lit by in full.
    has_area_lights: bool = false,
    /// Ambient radiance that the source of the scene asks for; null: by the rules of shading.
    ambient: ?f32 = null,
    /// What is seen where there is nothing, linear RGB; null: by the rules of shading.
    background: ?Vec3 = null,
    /// Picture size in pixels that the file asks for, at least 1 each; null: by its camera.
    resolution: ?[2]u32 = null,
    /// Samples a pixel that the file asks for, at least 1.
    sample_count: ?u32 = null,
    /// Bounces that the file asks for.
    depth: ?u32 = null,

    /// An empty scene whose memory comes from `gpa`.
    pub fn init(gpa: std.mem.Allocator) Scene {
        return .{ .arena = .init(gpa) };
    }

    /// Frees everything.
    pub fn deinit(scene: *Scene) void {
        scene.arena.deinit();
        scene.* = undefined;
    }

    /// Turns everything about the origin, the light from all around as well.
    pub fn turn(scene: *Scene, rotation: AffineD) error{OutOfMemory}!void {
        const nodes = try scene.arena.allocator().dupe(Node, scene.nodes);
        for (nodes) |*node| {
            if (node.parent == none) node.local = rotation.compose(node.local);
        }
        scene.nodes = nodes;
        const moving = try scene.arena.allocator().dupe(MovingNode, scene.moving.nodes);
        for (moving) |*node| {
            if (nodes[node.node].parent == none) node.outer = rotation.compose(node.outer);
        }
        scene.moving.nodes = moving;
        if (scene.environment) |*map| {
            const back: AffineD = .{
                .x = .{ rotation.x[0], rotation.y[0], rotation.z[0] },
                .y = .{ rotation.x[1], rotation.y[1], rotation.z[1] },
                .z = .{ rotation.x[2], rotation.y[2], rotation.z[2] },
                .translation = .{ 0, 0, 0 },
            };
            map.rotation = map.rotation.compose(back);
        }
    }

    /// Triangles drawn, every instance counted.
    pub fn triangleCount(scene: *const Scene) u64 {
        var count: u64 = 0;
        for (scene.instances) |instance| count += scene.meshes[instance.mesh].triangles.len;
        return count;
    }

    /// Asserts what the stages after `parse` rely on; for tests and debug builds (it is O(size)).
    pub fn check(scene: *const Scene) void {
        for (scene.nodes, 0..) |node, index| {
            assert(node.parent == none or node.parent < index);
            assert(node.local.isFinite());
        }
        for (scene.meshes) |mesh| {
            assert(mesh.material < scene.materials.len);
            checkDeformation(&mesh);
            if (mesh.normals) |normals| assert(normals.len == mesh.positions.len);
            if (mesh.colors) |colors| assert(colors.len == mesh.positions.len);
            if (mesh.tangents) |tangents| assert(tangents.len == mesh.positions.len);
            for (mesh.texcoords) |set| if (set) |all| assert(all.len == mesh.positions.len);
            for (mesh.positions) |position| assert(math.vec3.isFinite(position));
            for (mesh.triangles) |triangle| {
                for (triangle) |vertex| assert(vertex < mesh.positions.len);
            }
            for (mesh.points) |vertex| assert(vertex < mesh.positions.len);
            for (mesh.segments) |ends| {
                for (ends) |vertex| assert(vertex < mesh.positions.len);
            }
        }
        for (scene.instances) |instance| {
            assert(instance.mesh < scene.meshes.len);
            assert(instance.node < scene.nodes.len);
            const mesh = &scene.meshes[instance.mesh];
            const weights = instance.morph_weights;
            assert(weights.len == 0 or weights.len == mesh.morph_targets.len);
            for (weights) |weight| assert(std.math.isFinite(weight));
            if (instance.skin == none) continue;
            const joint_count = scene.skins[instance.skin].joints.len;
            for (mesh.joint_sets) |set| for (set.joints) |joints| {
                for (joints) |joint| assert(joint < joint_count);
            };
        }
        for (scene.skins) |skin| {
            assert(skin.joints.len == skin.inverse_bind_maps.len);
            for (skin.joints) |node| assert(node < scene.nodes.len);
            for (skin.inverse_bind_maps) |map| assert(map.isFinite());
        }
        for (scene.textures) |texture| assert(texture.image < scene.images.len);
        for (scene.materials) |*material| inline for (texture_fields) |field| {
            if (@field(material, field)) |view| {
                assert(view.texture < scene.textures.len);
                assert(view.texcoord_set < texcoord_set_count);
            }
        };
        if (scene.environment) |map| {
            assert(map.image < scene.images.len);
            const faces: []const u32 = if (map.projection == .cube) &map.faces else &.{};
            for (faces) |face| assert(face < scene.images.len);
        }
        for (scene.lights) |light| assert(light.node < scene.nodes.len);
        for (scene.cameras) |camera| assert(camera.node < scene.nodes.len);
        assert(scene.camera_default == none or scene.camera_default < scene.cameras.len);
        animation_file.check(scene);
    }

    fn checkDeformation(mesh: *const Mesh) void {
        const count = mesh.positions.len;
        for (mesh.morph_targets) |target| {
            inline for (.{ "positions", "normals", "tangents", "colors" }) |name| {
                if (@field(target, name)) |deltas| assert(deltas.len == count);
            }
            for (target.texcoords) |set| if (set) |deltas| assert(deltas.len == count);
        }
        assert(mesh.joint_sets.len <= joint_set_count);
        for (mesh.joint_sets) |set| {
            assert(set.joints.len == count and set.weights.len == count);
        }
    }
};

test {
    _ = Builder;
    _ = Grid;
    _ = animation_file;
}

test "texture coordinates are scaled, turned and moved" {
    const half_turn: f32 = std.math.pi;
    try std.testing.expectEqual(
        [2][3]f32{ .{ 2, 0, 0.25 }, .{ 0, 3, -0.5 } },
        (TextureTransform{ .offset = .{ 0.25, -0.5 }, .scale = .{ 2, 3 } }).rows().?,
    );
    // A quarter turn counter-clockwise: what was on the right is above, at negative v.
    const parts: TextureTransform = .{ .rotation_rad = half_turn / 2, .scale = .{ 2, 3 } };
    const expected = [2][3]f32{ .{ 0, 3, 0 }, .{ -2, 0, 0 } };
    for (parts.rows().?, expected) |row, wanted| for (row, wanted) |value, one| {
        try std.testing.expectApproxEqAbs(one, value, 1e-6);
    };
    try std.testing.expectEqual(null, (TextureTransform{ .rotation_rad = 1e6 }).rows());
}

test "a scene turns about the origin, roots first, and its surroundings with it" {
    var builder: Builder = .init(std.testing.allocator);
    errdefer builder.deinit();
    const root = try builder.addNode(none, .translate(.{ 1, 2, 3 }));
    _ = try builder.addNode(root, .translate(.{ 5, 0, 0 }));
    const unturned = [4]f64{ 0, 0, 0, 1 };
    builder.scene.moving.nodes = &.{
        .{ .node = 0, .translation = .{ 1, 2, 3 }, .rotation = unturned, .scale = @splat(1) },
        .{ .node = 1, .translation = .{ 5, 0, 0 }, .rotation = unturned, .scale = @splat(1) },
    };
    const image = try builder.addImage(.{ .name = "", .bytes = "" });
    builder.scene.environment = .{ .image = image };
    var scene = try builder.finish();
    defer scene.deinit();
    // A quarter turn about x.
    try scene.turn(.{
        .x = .{ 1, 0, 0 },
        .y = .{ 0, 0, -1 },
        .z = .{ 0, 1, 0 },
        .translation = .{ 0, 0, 0 },
    });
    scene.check();
    const place = scene.nodes[0].local;
    try std.testing.expectEqual(math.Vec3d{ 1, 3, -2 }, place.translation);
    try std.testing.expectEqual(math.Vec3d{ 0, 1, 0 }, place.direction(.{ 0, 0, 1 }));
    try std.testing.expectEqual(math.Vec3d{ 5, 0, 0 }, scene.nodes[1].local.translation);
    for (scene.moving.nodes) |*moving| {
        try std.testing.expectEqual(scene.nodes[moving.node].local, moving.local());
    }
    // What is above now was at z.
    const map = scene.environment.?.rotation;
    try std.testing.expectEqual(math.Vec3d{ 0, 0, 1 }, map.direction(.{ 0, 1, 0 }));
}

test "an empty scene is a scene" {
    var scene: Scene = .init(std.testing.allocator);
    defer scene.deinit();
    scene.check();
    try std.testing.expectEqual(0, scene.triangleCount());
}
