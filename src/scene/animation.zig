//! Animations: key frames of what moves in a scene (glTF 2.0, section 3.11; KHR_animation_pointer).
//!
//! What moves is at rest as the scene has it. Every channel moves one property of one thing; all
//! numbers are finite and not denormal.

const std = @import("std");
const math = @import("../math.zig");
const scene = @import("../scene.zig");
const assert = std.debug.assert;
const AffineD = math.AffineD;
const Vec3d = math.Vec3d;

/// What is between two key frames.
pub const Interpolation = enum { linear, step, cubic_spline };

/// Key frames: numbers by time.
pub const Sampler = struct {
    /// Seconds, ascending, at least one.
    times: []const f32,
    /// `width` numbers for each time; of cubic splines three times as many: the tangent that comes
    /// in, the value, the tangent that goes out.
    values: []const f32,
    /// Numbers of a value, at least 1.
    width: u32,
    interpolation: Interpolation,

    /// The value at a key, or of cubic splines one of the three: 0, 1, 2.
    pub fn value(sampler: *const Sampler, key: usize, part: usize) []const f32 {
        const parts: usize = if (sampler.interpolation == .cubic_spline) 3 else 1;
        return sampler.values[(key * parts + part) * sampler.width ..][0..sampler.width];
    }

    /// What of the three a cubic spline passes through.
    pub fn valuePart(sampler: *const Sampler) usize {
        return if (sampler.interpolation == .cubic_spline) 1 else 0;
    }
};

/// A property that key frames move.
pub const Target = union(enum) {
    /// Indices into `Moving.nodes`.
    translation: u32,
    /// A quaternion.
    rotation: u32,
    scale: u32,
    /// Index into `Moving.shows`; 0 hides.
    visible: u32,
    /// All of a list of `Moving.weights`.
    weights: u32,
    /// One of them.
    weight: struct { list: u32, index: u32 },
    material: struct { material: u32, property: MaterialProperty },
    texture: struct { material: u32, field: TextureField, part: TransformPart },
    light: struct { light: u32, property: LightProperty },
    camera: struct { camera: u32, property: CameraProperty },

    /// How many numbers it takes; null: as many as there are weights.
    pub fn width(target: Target) ?u32 {
        return switch (target) {
            .translation, .scale => 3,
            .rotation => 4,
            .weights => null,
            .weight, .camera, .visible => 1,
            .material => |of| of.property.width(),
            .texture => |of| if (of.part == .rotation_rad) 1 else 2,
            .light => |of| if (of.property == .color) 3 else 1,
        };
    }
};

/// Numbers of a material, by the names of the fields but for some that it is not made of.
pub const MaterialProperty = enum {
    base_color,
    metallic,
    roughness,
    alpha_cutoff,
    normal_scale,
    occlusion_strength,
    emissive_factor,
    emissive_strength,
    ior,
    transmission,
    /// The thickness, which says whether there is a volume.
    volume,
    attenuation_color,
    attenuation_distance,
    specular,
    specular_color,
    clearcoat,
    clearcoat_roughness,
    clearcoat_normal_scale,
    sheen_color,
    sheen_roughness,
    dispersion,
    iridescence,
    iridescence_ior,
    iridescence_thickness_min_nm,
    iridescence_thickness_max_nm,
    anisotropy,
    anisotropy_rotation_rad,
    diffuse_transmission,
    diffuse_transmission_color,
    multiscatter_color,
    scatter_anisotropy,

    /// How many numbers it takes.
    pub fn width(property: MaterialProperty) u32 {
        return switch (property) {
            inline else => |tag| switch (@FieldType(scene.Material, @tagName(tag))) {
                [4]f32 => 4,
                math.Vec3 => 3,
                f32, bool => 1,
                else => comptime unreachable,
            },
        };
    }
};

/// A texture of a material.
pub const TextureField = std.meta.FieldEnum(TextureFields);

const TextureFields = fields: {
    const names = scene.texture_fields;
    const types: [names.len]type = @splat(void);
    break :fields @Struct(.auto, null, &names, &types, &@splat(.{}));
};

/// What the transform of a texture is made of.
pub const TransformPart = enum { offset, rotation_rad, scale };

/// Numbers of a light, by the names of the fields.
pub const LightProperty = enum { color, intensity, range, inner_cone_rad, outer_cone_rad };

/// Numbers of a camera's projection, by the names of the fields.
pub const CameraProperty = enum { y_fov_rad, aspect, half_width, half_height };

/// What moves one property.
pub const Channel = struct { sampler: Sampler, target: Target };

/// Key frames that belong together.
pub const Animation = struct {
    /// Empty where the file gives none.
    name: []const u8 = "",
    /// In order: where two move the same, the later does.
    channels: []const Channel = &.{},

    /// First and last time of a key, in seconds; null where nothing moves.
    pub fn span(animation: *const Animation) ?[2]f32 {
        var ends: ?[2]f32 = null;
        for (animation.channels) |*channel| {
            const times = channel.sampler.times;
            const first = times[0];
            const last = times[times.len - 1];
            ends = if (ends) |known| .{ @min(known[0], first), @max(known[1], last) } else .{
                first, last,
            };
        }
        return ends;
    }
};

/// A node that animations move, by what its map is made of.
pub const MovingNode = struct {
    node: u32,
    translation: Vec3d,
    /// A quaternion of unit length: x, y, z, w.
    rotation: [4]f64,
    scale: Vec3d,
    /// What comes after these.
    outer: AffineD = .identity,

    /// The node's map into its parent's space.
    pub fn local(moving: *const MovingNode) AffineD {
        const own: AffineD = .fromTrs(moving.translation, moving.rotation, moving.scale);
        return if (std.meta.eql(moving.outer, .identity)) own else moving.outer.compose(own);
    }
};

/// What animations move, at rest.
pub const Moving = struct {
    nodes: []const MovingNode = &.{},
    /// Lists of morph weights that instances share.
    weights: []const []const f32 = &.{},
    /// By node: whether it does not hide itself and all below it; empty: nothing hides.
    shows: []const bool = &.{},
    /// Where there are some: a node without a size, for what is hidden.
    nowhere: u32 = scene.none,

    /// By node, whose parents stand before it: whether nothing hides it. From `arena`.
    pub fn visibility(
        moving: *const Moving,
        arena: std.mem.Allocator,
        nodes: []const scene.Node,
    ) error{OutOfMemory}![]const bool {
        const visible = try arena.dupe(bool, moving.shows);
        for (nodes, visible) |node, *is_visible| {
            if (node.parent != scene.none and !visible[node.parent]) is_visible.* = false;
        }
        return visible;
    }
};

/// Asserts what the stages after `parse` rely on.
pub fn check(from: *const scene.Scene) void {
    for (from.moving.nodes) |*moving| assert(moving.node < from.nodes.len);
    const shows = from.moving.shows;
    if (shows.len > 0) assert(shows.len == from.nodes.len and from.moving.nowhere < shows.len);
    for (from.instances) |*instance| {
        if (instance.moving_weights == scene.none) continue;
        const count = from.moving.weights[instance.moving_weights].len;
        assert(count == from.meshes[instance.mesh].morph_targets.len);
    }
    for (from.animations) |*animation| for (animation.channels) |*channel| {
        const sampler = &channel.sampler;
        assert(sampler.times.len > 0);
        for (sampler.times[1..], sampler.times[0 .. sampler.times.len - 1]) |next, time| {
            assert(next >= time);
        }
        const parts: usize = if (sampler.interpolation == .cubic_spline) 3 else 1;
        assert(sampler.values.len == sampler.times.len * parts * sampler.width);
        for (sampler.values) |number| assert(std.math.isFinite(number));
        checkTarget(from, channel.target, sampler.width);
    };
}

fn checkTarget(from: *const scene.Scene, target: Target, width: u32) void {
    if (target.width()) |wanted| assert(width == wanted);
    switch (target) {
        .translation, .rotation, .scale => |index| assert(index < from.moving.nodes.len),
        .visible => |node| assert(node < from.moving.shows.len),
        .weights => |list| assert(from.moving.weights[list].len == width),
        .weight => |one| assert(one.index < from.moving.weights[one.list].len),
        inline .material, .texture => |of| assert(from.materials[of.material].in_motion),
        .light => |of| assert(of.light < from.lights.len),
        .camera => |of| assert(of.camera < from.cameras.len),
    }
}

test "an animation lasts from the first key to the last of all channels" {
    const target: Target = .{ .translation = 0 };
    const still: Animation = .{};
    try std.testing.expectEqual(null, still.span());
    const zeros: [12]f32 = @splat(0);
    const moving: Animation = .{ .channels = &.{
        .{ .target = target, .sampler = .{
            .times = &.{ 0.5, 2 },
            .values = zeros[0..6],
            .width = 3,
            .interpolation = .linear,
        } },
        .{ .target = target, .sampler = .{
            .times = &.{ 0.25, 1, 1.5 },
            .values = zeros[0..9],
            .width = 3,
            .interpolation = .step,
        } },
    } };
    try std.testing.expectEqual([2]f32{ 0.25, 2 }, moving.span().?);
}

test "every number of a material that moves has a width" {
    try std.testing.expectEqual(4, MaterialProperty.base_color.width());
    try std.testing.expectEqual(3, MaterialProperty.emissive_factor.width());
    try std.testing.expectEqual(1, MaterialProperty.volume.width());
    try std.testing.expectEqual(2, (Target{ .texture = .{
        .material = 0,
        .field = .base_color_texture,
        .part = .offset,
    } }).width());
}
