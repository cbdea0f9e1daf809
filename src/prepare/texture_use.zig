//! What a material has textures for: which channels of an image count, as light or as numbers.
//!
//! In: a material. Out: for each use its texture, null where it has no say, and the channels in the
//! order of the slot (glTF 2.0, section 3.9, and the texts of the extensions).

const std = @import("std");
const scene = @import("../scene.zig");
const world = @import("../world.zig");
const Effects = @import("layers.zig").Effects;
const isAll = @import("layers.zig").isAll;

/// Channel of a lookup that there is not: it counts as 1.
pub const missing: u8 = 255;

/// In the order of the slots, which those of layers end.
pub const Use = enum {
    base_color,
    alpha,
    metallic_roughness,
    normal,
    occlusion,
    emissive,
    transmission,
    specular,
    specular_color,
    glossiness,
    clearcoat,
    clearcoat_roughness,
    clearcoat_normal,
    sheen_color,
    sheen_roughness,
    iridescence,
    iridescence_thickness,
    anisotropy,
    diffuse_transmission,
    diffuse_transmission_color,
    multiscatter_color,

    /// Of the lookup.
    pub fn slot(use: Use) world.Slot {
        return switch (use) {
            .alpha => .base_color,
            inline else => |tag| @field(world.Slot, @tagName(tag)),
        };
    }

    /// Whether its colours are light, by the sRGB curve.
    pub fn isLight(use: Use) bool {
        return switch (use) {
            .base_color, .emissive, .specular_color, .sheen_color => true,
            .diffuse_transmission_color, .multiscatter_color => true,
            else => false,
        };
    }
};

/// The texture for a use, null where there is none or it has no say.
pub fn viewOf(material: *const scene.Material, use: Use) ?scene.TextureView {
    if (material.unlit and use.slot() != .base_color) return null;
    if (!counts(material, use)) return null;
    return switch (use) {
        inline else => |tag| @field(material, @tagName(tag) ++ "_texture"),
    };
}

/// Whether it matters what a texture for this use would say.
fn counts(material: *const scene.Material, use: Use) bool {
    // It may matter later.
    if (material.in_motion and use != .alpha) return true;
    const effects: Effects = .of(material);
    return switch (use) {
        .base_color, .metallic_roughness => true,
        .alpha => material.alpha_mode != .@"opaque",
        .normal => material.normal_scale != 0,
        .occlusion => material.occlusion_strength != 0,
        .emissive => !isAll(material.emissive, 0),
        .transmission => material.transmission > 0,
        .specular => effects.specular and material.specular > 0,
        .specular_color => effects.specular and material.specular > 0 and
            !isAll(material.specular_color, 0),
        .glossiness => material.roughness < 1,
        .clearcoat => effects.clearcoat,
        .clearcoat_roughness => effects.clearcoat and material.clearcoat_roughness > 0,
        .clearcoat_normal => effects.clearcoat and material.clearcoat_normal_scale != 0,
        .sheen_color => effects.sheen,
        .sheen_roughness => effects.sheen and material.sheen_roughness > 0,
        .iridescence => effects.iridescence,
        .iridescence_thickness => effects.iridescence and
            material.iridescence_thickness_min_nm != material.iridescence_thickness_max_nm,
        .anisotropy => effects.anisotropy,
        .diffuse_transmission => effects.diffuse_transmission,
        .diffuse_transmission_color => effects.diffuse_transmission and
            !isAll(material.diffuse_transmission_color, 0),
        .multiscatter_color => effects.scattering,
    };
}

/// Which channels of an image are the first, second, ... of a slot.
pub fn channelsOf(material: *const scene.Material, use: Use) [4]u8 {
    const has_alpha = material.alpha_mode != .@"opaque";
    return switch (use) {
        .base_color => .{ 0, 1, 2, if (has_alpha) 3 else missing },
        .alpha => .{ missing, missing, missing, 0 },
        .metallic_roughness => .{ 1, 2, missing, missing },
        .normal, .emissive, .specular_color, .clearcoat_normal, .sheen_color, .anisotropy => rgb,
        .diffuse_transmission_color, .multiscatter_color => rgb,
        .occlusion, .transmission, .clearcoat, .iridescence => only(0),
        .clearcoat_roughness, .iridescence_thickness => only(1),
        .specular, .glossiness, .sheen_roughness, .diffuse_transmission => only(3),
    };
}

const rgb: [4]u8 = .{ 0, 1, 2, missing };

fn only(channel: u8) [4]u8 {
    return .{ channel, missing, missing, missing };
}

/// Texture coordinates that tangents are made of.
pub const TangentSource = struct {
    texcoord_set: u8 = 0,
    transform: [2][3]f32 = .{ .{ 1, 0, 0 }, .{ 0, 1, 0 } },
};

/// What the tangents of a material's meshes are made of where they have none; null: it needs none.
/// Normal textures come first (glTF 2.0, section 3.7.2.1; KHR_materials_anisotropy), one stands for
/// all.
pub fn tangentSource(
    material: *const scene.Material,
    lookups: []const world.Lookup,
) ?TangentSource {
    const is_anisotropic = Effects.of(material).anisotropy;
    for ([_]world.Slot{ .normal, .clearcoat_normal, .anisotropy }) |slot| {
        for (lookups) |*lookup| if (lookup.slot == slot) return .{
            .texcoord_set = lookup.texcoord_set,
            .transform = lookup.transform,
        };
    }
    return if (is_anisotropic) .{} else null;
}

test "uses are in the order of the slots, those of layers last" {
    var before: u8 = 0;
    for (std.enums.values(Use)) |use| {
        const slot = @backingInt(use.slot());
        try std.testing.expect(slot >= before and slot <= before + 1);
        before = slot;
    }
    try std.testing.expectEqual(world.Slot.count, before + 1);
}
