//! Materials of a scene: glTF 2.0's metallic-roughness model with its ratified extensions.
//!
//! Factors are in their ranges, units are metres, radians and linear RGB. A texture multiplies its
//! factor.

const std = @import("std");
const math = @import("../math.zig");
const none = @import("../scene.zig").none;
const TextureView = @import("../scene.zig").TextureView;
const Vec3 = math.Vec3;

/// What to do with the base colour's alpha.
pub const AlphaMode = enum { @"opaque", mask, blend };

/// glTF's metallic-roughness material with its extensions.
pub const Material = struct {
    /// The file's number of it, or `none`.
    origin: u32 = none,
    /// Linear RGB and alpha, 0..1.
    base_color: [4]f32 = .{ 1, 1, 1, 1 },
    metallic: f32 = 1,
    roughness: f32 = 1,
    /// Radiance emitted, linear RGB, strength included.
    emissive: Vec3 = .{ 0, 0, 0 },
    /// What it is the product of, where animations move that.
    emissive_factor: Vec3 = .{ 0, 0, 0 },
    emissive_strength: f32 = 1,
    alpha_mode: AlphaMode = .@"opaque",
    /// With `AlphaMode.mask`, what has less alpha is a hole.
    alpha_cutoff: f32 = 0.5,
    double_sided: bool = false,
    /// Its surfaces are not seen and stop no light, but what they emit lights the scene as if they
    /// were: PBRT's area lights whose alpha is 0. Asserted to blend with alpha 0.
    is_hidden_lamp: bool = false,
    /// The base colour is shown as it is, without light (KHR_materials_unlit).
    unlit: bool = false,
    /// Index of refraction, >= 1 (KHR_materials_ior).
    ior: f32 = 1.5,
    /// Share of light that goes through, 0..1 (KHR_materials_transmission).
    transmission: f32 = 0,
    /// Whether the surface bounds a volume (KHR_materials_volume with a thickness above 0): rays
    /// bend; otherwise the wall is thin and they go straight on.
    volume: bool = false,
    /// Colour that white light turns to after `attenuation_distance` inside, linear RGB.
    attenuation_color: Vec3 = .{ 1, 1, 1 },
    /// In metres of the scene's space; infinity: no attenuation.
    attenuation_distance: f32 = std.math.inf(f32),
    /// Weight and colour of the dielectric's reflection (KHR_materials_specular), 0..1 and >= 0.
    specular: f32 = 1,
    specular_color: Vec3 = .{ 1, 1, 1 },
    /// A clear coat over all else (KHR_materials_clearcoat), 0..1 each.
    clearcoat: f32 = 0,
    clearcoat_roughness: f32 = 0,
    /// Multiplies x and y of the coat's normal.
    clearcoat_normal_scale: f32 = 1,
    /// Fibres over all but the coat (KHR_materials_sheen), linear RGB and 0..1.
    sheen_color: Vec3 = .{ 0, 0, 0 },
    sheen_roughness: f32 = 0,
    /// 20 over the Abbe number (KHR_materials_dispersion), >= 0.
    dispersion: f32 = 0,
    /// A thin film below the coat (KHR_materials_iridescence): weight 0..1, index >= 1, thickness
    /// where the texture says 0 and 1.
    iridescence: f32 = 0,
    iridescence_ior: f32 = 1.3,
    iridescence_thickness_min_nm: f32 = 100,
    iridescence_thickness_max_nm: f32 = 400,
    /// How much longer reflections are along the tangent (KHR_materials_anisotropy), 0..1, after
    /// that was turned counter-clockwise.
    anisotropy: f32 = 0,
    anisotropy_rotation_rad: f32 = 0,
    /// Share of diffuse light that leaves on the other side (KHR_materials_diffuse_transmission).
    diffuse_transmission: f32 = 0,
    diffuse_transmission_color: Vec3 = .{ 1, 1, 1 },
    /// Albedo of what fills the volume, light scattered many times included
    /// (KHR_materials_volume_scatter), linear RGB 0..1; 0: nothing does.
    multiscatter_color: Vec3 = .{ 0, 0, 0 },
    /// Mean cosine of the angle that it is scattered by, between -1 and 1.
    scatter_anisotropy: f32 = 0,
    /// Red, green, blue (sRGB) and alpha, multiplied with `base_color`.
    base_color_texture: ?TextureView = null,
    /// Red: a number that alpha is multiplied with, as PBRT's shapes have it.
    alpha_texture: ?TextureView = null,
    /// Green: roughness, blue: metallic, each multiplied with its factor.
    metallic_roughness_texture: ?TextureView = null,
    /// Tangent-space normals.
    normal_texture: ?TextureView = null,
    /// Multiplies x and y of the normal.
    normal_scale: f32 = 1,
    /// Red: share of the light from all sides that arrives.
    occlusion_texture: ?TextureView = null,
    /// How much of the occlusion counts, 0..1.
    occlusion_strength: f32 = 1,
    /// Red, green, blue (sRGB), multiplied with `emissive`.
    emissive_texture: ?TextureView = null,
    /// Red, multiplied with `transmission`.
    transmission_texture: ?TextureView = null,
    /// Alpha, multiplied with `specular`.
    specular_texture: ?TextureView = null,
    /// Red, green, blue (sRGB), multiplied with `specular_color`.
    specular_color_texture: ?TextureView = null,
    /// Alpha: glossiness is 1 - `roughness` times it (KHR_materials_pbrSpecularGlossiness).
    glossiness_texture: ?TextureView = null,
    /// Red, multiplied with `clearcoat`.
    clearcoat_texture: ?TextureView = null,
    /// Green, multiplied with `clearcoat_roughness`.
    clearcoat_roughness_texture: ?TextureView = null,
    /// Tangent-space normals of the coat; null: it has those of the vertices.
    clearcoat_normal_texture: ?TextureView = null,
    /// Red, green, blue (sRGB), multiplied with `sheen_color`.
    sheen_color_texture: ?TextureView = null,
    /// Alpha, multiplied with `sheen_roughness`.
    sheen_roughness_texture: ?TextureView = null,
    /// Red, multiplied with `iridescence`.
    iridescence_texture: ?TextureView = null,
    /// Green: the thickness from the least to the largest.
    iridescence_thickness_texture: ?TextureView = null,
    /// Red, green: direction along the tangent and bitangent, blue: multiplied with `anisotropy`.
    anisotropy_texture: ?TextureView = null,
    /// Alpha, multiplied with `diffuse_transmission`.
    diffuse_transmission_texture: ?TextureView = null,
    /// Red, green, blue (sRGB), multiplied with `diffuse_transmission_color`.
    diffuse_transmission_color_texture: ?TextureView = null,
    /// Red, green, blue (sRGB), multiplied with `multiscatter_color`.
    multiscatter_color_texture: ?TextureView = null,
    /// Animations move some of its numbers: what these are at rest rules nothing out.
    in_motion: bool = false,

    /// Whether it has any.
    pub fn hasTextures(material: *const Material) bool {
        inline for (texture_fields) |field| if (@field(material, field) != null) return true;
        return false;
    }
};

/// The textures of a material.
pub const texture_fields = fields: {
    var names: []const []const u8 = &.{};
    for (std.meta.fieldNames(Material)) |name| {
        if (@FieldType(Material, name) == ?TextureView) names = names ++ .{name};
    }
    break :fields names[0..names.len].*;
};
