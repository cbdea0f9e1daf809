//! Extensions of glTF's materials, by the texts of their specifications.
//!
//! In: what a material says by KHR_materials_ior, _emissive_strength, _specular, _clearcoat,
//! _sheen, _transmission, _volume, _volume_scatter, _dispersion, _iridescence, _anisotropy,
//! _diffuse_transmission and _pbrSpecularGlossiness. Out: the factors of the scene's material, each
//! in its range, and its textures.

const std = @import("std");
const c = @import("../cgltf.zig");
const math = @import("../../math.zig");
const scene = @import("../../scene.zig");
const text = @import("extension_text.zig");
const Error = Source.Error;
const Factors = @import("factors.zig");
const Source = @import("source.zig");
const Textures = @import("textures.zig");

/// Index of refraction that stands for KHR_materials_ior's 0, "Fresnel's term is 1".
const ior_total = 1e6;

/// Films of more nanometres show no colours, nor does dispersion beyond it anything that is one.
const thickness_max_nm = 1e6;
const dispersion_max = 1e6;

/// Reflectance at normal incidence of the default index of refraction, 1.5.
const default_f0 = 0.04;

/// Angles beyond it have no digits left.
const angle_rad_max = 1e5;

/// The phase function of light that is only scattered straight on, or straight back, has no values.
const scatter_anisotropy_max = 0.999;

/// Reads the factors of all of them but KHR_materials_volume_scatter; `material` has those of the
/// core.
pub fn readFactors(
    factors: Factors,
    raw: *const c.cgltf_material,
    material: *scene.Material,
) void {
    if (raw.has_emissive_strength != 0) {
        const name = "emissiveStrength";
        const strength = factors.clamp(name, raw.emissive_strength, 0, Factors.endless);
        material.emissive_strength = strength;
        for (&material.emissive) |*value| value.* = math.flushDenormal(value.* * strength);
    }
    if (raw.has_ior != 0)
        material.ior = if (raw.ior == 0) ior_total else factors.clamp("ior", raw.ior, 1, ior_total);
    if (raw.has_specular != 0) readSpecular(factors, &raw.specular, material);
    if (raw.has_clearcoat != 0) readClearcoat(factors, &raw.clearcoat, material);
    if (raw.has_sheen != 0) {
        const sheen = &raw.sheen;
        material.sheen_color = factors.color3("sheenColorFactor", sheen.sheen_color_factor);
        material.sheen_roughness =
            factors.unit("sheenRoughnessFactor", sheen.sheen_roughness_factor);
    }
    if (raw.has_transmission != 0) {
        const factor = raw.transmission.transmission_factor;
        material.transmission = factors.unit("transmissionFactor", factor);
    }
    if (raw.has_volume != 0) readVolume(factors, &raw.volume, material);
    if (raw.has_dispersion != 0)
        material.dispersion = factors.clamp("dispersion", raw.dispersion, 0, dispersion_max);
    if (raw.has_iridescence != 0) readIridescence(factors, &raw.iridescence, material);
    if (raw.has_anisotropy != 0) readAnisotropy(factors, &raw.anisotropy, material);
    if (raw.has_diffuse_transmission != 0) {
        const diffuse = &raw.diffuse_transmission;
        material.diffuse_transmission =
            factors.unit("diffuseTransmissionFactor", diffuse.diffuse_transmission_factor);
        material.diffuse_transmission_color = factors.color3(
            "diffuseTransmissionColorFactor",
            diffuse.diffuse_transmission_color_factor,
        );
    }
    if (raw.has_pbr_specular_glossiness != 0)
        readSpecularGlossiness(factors, &raw.pbr_specular_glossiness, material);
}

fn readSpecular(factors: Factors, raw: *const c.cgltf_specular, material: *scene.Material) void {
    material.specular = factors.unit("specularFactor", raw.specular_factor);
    const color = raw.specular_color_factor;
    material.specular_color = factors.vector("specularColorFactor", color, Factors.endless);
}

fn readClearcoat(factors: Factors, raw: *const c.cgltf_clearcoat, material: *scene.Material) void {
    material.clearcoat = factors.unit("clearcoatFactor", raw.clearcoat_factor);
    const roughness = raw.clearcoat_roughness_factor;
    material.clearcoat_roughness = factors.unit("clearcoatRoughnessFactor", roughness);
    const normal = &raw.clearcoat_normal_texture;
    if (normal.texture != null) material.clearcoat_normal_scale = math.flushDenormal(normal.scale);
}

/// The thickness is for those who do not trace rays through the mesh: it only says whether the
/// surface bounds a volume, so that its texture is not looked at.
fn readVolume(factors: Factors, raw: *const c.cgltf_volume, material: *scene.Material) void {
    material.volume = raw.thickness_factor > 0;
    material.attenuation_color = factors.color3("attenuationColor", raw.attenuation_color);
    const distance = math.flushDenormal(raw.attenuation_distance);
    if (distance > 0) {
        // cgltf says FLT_MAX where the file says nothing.
        const is_endless = distance == Factors.endless;
        material.attenuation_distance = if (is_endless) std.math.inf(f32) else distance;
    } else factors.source.forgive(
        "material {d}: attenuationDistance {d} is not above 0, left out",
        .{ factors.index, raw.attenuation_distance },
    );
}

fn readIridescence(
    factors: Factors,
    raw: *const c.cgltf_iridescence,
    material: *scene.Material,
) void {
    const most = thickness_max_nm;
    material.iridescence = factors.unit("iridescenceFactor", raw.iridescence_factor);
    material.iridescence_ior = factors.clamp("iridescenceIor", raw.iridescence_ior, 1, ior_total);
    const least = raw.iridescence_thickness_min;
    material.iridescence_thickness_min_nm =
        factors.clamp("iridescenceThicknessMinimum", least, 0, most);
    const largest = raw.iridescence_thickness_max;
    material.iridescence_thickness_max_nm =
        factors.clamp("iridescenceThicknessMaximum", largest, 0, most);
}

fn readAnisotropy(
    factors: Factors,
    raw: *const c.cgltf_anisotropy,
    material: *scene.Material,
) void {
    material.anisotropy = factors.unit("anisotropyStrength", raw.anisotropy_strength);
    const rotation_rad = raw.anisotropy_rotation;
    if (@abs(rotation_rad) <= angle_rad_max) {
        material.anisotropy_rotation_rad = math.flushDenormal(rotation_rad);
    } else factors.source.forgive(
        "material {d}: anisotropyRotation {d} is out of range, left out",
        .{ factors.index, rotation_rad },
    );
}

/// Where it stands it counts, and neither the metallic-roughness model nor extensions that this
/// one excludes. The specular colour is the reflectance at normal incidence.
fn readSpecularGlossiness(
    factors: Factors,
    raw: *const c.cgltf_pbr_specular_glossiness,
    material: *scene.Material,
) void {
    material.base_color = factors.color4("diffuseFactor", raw.diffuse_factor);
    material.metallic = 0;
    material.roughness = 1 - factors.unit("glossinessFactor", raw.glossiness_factor);
    material.ior = 1.5;
    material.specular = 1;
    material.specular_color = factors.color3("specularFactor", raw.specular_factor);
    for (&material.specular_color) |*value| value.* /= default_f0;
}

/// Textures: where cgltf has them, what the scene calls them as well, what the file does.
const texture_table = .{
    .{ "specular", "specular_texture", "specularTexture" },
    .{ "specular", "specular_color_texture", "specularColorTexture" },
    .{ "clearcoat", "clearcoat_texture", "clearcoatTexture" },
    .{ "clearcoat", "clearcoat_roughness_texture", "clearcoatRoughnessTexture" },
    .{ "clearcoat", "clearcoat_normal_texture", "clearcoatNormalTexture" },
    .{ "sheen", "sheen_color_texture", "sheenColorTexture" },
    .{ "sheen", "sheen_roughness_texture", "sheenRoughnessTexture" },
    .{ "transmission", "transmission_texture", "transmissionTexture" },
    .{ "iridescence", "iridescence_texture", "iridescenceTexture" },
    .{ "iridescence", "iridescence_thickness_texture", "iridescenceThicknessTexture" },
    .{ "anisotropy", "anisotropy_texture", "anisotropyTexture" },
    .{ "diffuse_transmission", "diffuse_transmission_texture", "diffuseTransmissionTexture" },
    .{
        "diffuse_transmission",
        "diffuse_transmission_color_texture",
        "diffuseTransmissionColorTexture",
    },
};

/// Reads the textures of all of them but KHR_materials_volume_scatter.
pub fn readTextures(
    textures: *Textures,
    raw: *const c.cgltf_material,
    index: usize,
    material: *scene.Material,
) Error!void {
    inline for (texture_table) |row| {
        const group, const field, const name = row;
        if (@field(raw, "has_" ++ group) != 0) {
            const view = &@field(@field(raw, group), field);
            @field(material, field) = try textures.view(view, index, name);
        }
    }
    if (raw.has_pbr_specular_glossiness == 0) return;
    const gloss = &raw.pbr_specular_glossiness;
    material.base_color_texture =
        try textures.view(&gloss.diffuse_texture, index, "diffuseTexture");
    material.specular_texture = null;
    const packed_view = &gloss.specular_glossiness_texture;
    const packed_texture = try textures.view(packed_view, index, "specularGlossinessTexture");
    material.specular_color_texture = packed_texture;
    material.glossiness_texture = packed_texture;
}

/// KHR_materials_volume_scatter. Its draft called the factor `multiscatterColor`.
const Scatter = struct {
    multiscatterColorFactor: ?[3]f32 = null,
    multiscatterColor: [3]f32 = .{ 0, 0, 0 },
    multiscatterColorTexture: ?TextureInfo = null,
    scatterAnisotropy: f32 = 0,
};

/// glTF 2.0, section 5.30, with KHR_texture_transform.
const TextureInfo = struct {
    index: u32,
    texCoord: u32 = 0,
    extensions: struct { KHR_texture_transform: ?Transform = null } = .{},
};

const Transform = struct {
    offset: [2]f32 = .{ 0, 0 },
    rotation: f32 = 0,
    scale: [2]f32 = .{ 1, 1 },
    texCoord: ?u32 = null,
};

/// Reads KHR_materials_volume_scatter, which cgltf leaves as it is.
pub fn readScatter(
    factors: Factors,
    textures: ?*Textures,
    raw: *const c.cgltf_material,
    material: *scene.Material,
) Error!void {
    const source = factors.source;
    const list = Source.slice(raw.extensions, raw.extensions_count);
    const described = text.find(list, "KHR_materials_volume_scatter") orelse return;
    var arena_state: std.heap.ArenaAllocator = .init(source.gpa);
    defer arena_state.deinit();
    const scatter = try text.parse(Scatter, arena_state.allocator(), described) orelse
        return source.forgive(
            "material {d}: KHR_materials_volume_scatter is not as it should be, left out",
            .{factors.index},
        );
    material.multiscatter_color = factors.color3(
        "multiscatterColorFactor",
        scatter.multiscatterColorFactor orelse scatter.multiscatterColor,
    );
    const most = scatter_anisotropy_max;
    material.scatter_anisotropy =
        factors.clamp("scatterAnisotropy", scatter.scatterAnisotropy, -most, most);
    const info = scatter.multiscatterColorTexture orelse return;
    const name = "multiscatterColorTexture";
    const all = textures orelse return;
    if (info.index >= source.data.textures_count) return source.fail(
        "material {d}: {s}: there is no texture {d}",
        .{ factors.index, name, info.index },
    );
    const view = viewOf(source, &info);
    material.multiscatter_color_texture = try all.view(&view, factors.index, name);
}

/// As cgltf would have it.
fn viewOf(source: *const Source, info: *const TextureInfo) c.cgltf_texture_view {
    const transform = info.extensions.KHR_texture_transform;
    const moved: Transform = transform orelse .{};
    return .{
        .texture = &source.data.textures[info.index],
        .texcoord = std.math.cast(c_int, info.texCoord) orelse -1,
        .scale = 1,
        .has_transform = @intFromBool(transform != null),
        .transform = .{
            .offset = moved.offset,
            .rotation = moved.rotation,
            .scale = moved.scale,
            .has_texcoord = @intFromBool(moved.texCoord != null),
            .texcoord = std.math.cast(c_int, moved.texCoord orelse 0) orelse -1,
        },
    };
}
