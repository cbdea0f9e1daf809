//! glTF's materials: metallic-roughness factors and those of the extensions that are traced.
//!
//! In: materials (glTF 2.0, section 3.9; KHR_materials_ior, _transmission, _volume,
//! _emissive_strength, _unlit, _pbrSpecularGlossiness). Out: the scene's materials with every
//! factor in its range, in the order of the file, and behind them those that the file does not
//! have. The textures of a material are read once something is drawn with it.

const std = @import("std");
const c = @import("../cgltf.zig");
const math = @import("../../math.zig");
const scene = @import("../../scene.zig");
const Error = Source.Error;
const Source = @import("source.zig");
const Textures = @import("textures.zig");
const Vec3 = math.Vec3;
const Materials = @This();

/// Index of refraction that stands for KHR_materials_ior's 0, "Fresnel's term is 1".
const ior_total = 1e6;

const float_max = std.math.floatMax(f32);

source: *const Source,
textures: *Textures,
/// Those of the file as far as they are read, by their indices.
list: []?scene.Material,
/// Those that come behind them.
added: std.ArrayList(scene.Material) = .empty,
/// glTF's default material, as an index into the scene's.
default: ?u32 = null,
/// By material: the one without its normal texture.
smooth: std.AutoHashMapUnmanaged(u32, u32) = .empty,
/// By material, and whether vertices are coloured: the one of points and lines without normals.
unlit: std.AutoHashMapUnmanaged(struct { u32, bool }, u32) = .empty,

/// Nothing is read yet. Free with `deinit`.
pub fn init(source: *const Source, textures: *Textures) Error!Materials {
    const list = try source.gpa.alloc(?scene.Material, source.data.materials_count);
    @memset(list, null);
    return .{ .source = source, .textures = textures, .list = list };
}

/// Frees what is not the scene's.
pub fn deinit(materials: *Materials) void {
    const gpa = materials.source.gpa;
    gpa.free(materials.list);
    materials.added.deinit(gpa);
    materials.smooth.deinit(gpa);
    materials.unlit.deinit(gpa);
    materials.* = undefined;
}

/// A material that something is drawn with, its textures included.
pub fn use(materials: *Materials, index: u32) Error!*const scene.Material {
    const file_count = materials.list.len;
    if (index >= file_count) return &materials.added.items[index - file_count];
    const slot = &materials.list[index];
    if (slot.* == null) {
        const reader: Reader = .{ .source = materials.source, .index = index };
        const raw = Source.item(materials.source.data.materials, index);
        var material = reader.read(raw);
        try materials.readTextures(raw, index, &material);
        slot.* = material;
    }
    return &slot.*.?;
}

/// The material of what has none (glTF 2.0, section 3.7.2.1).
pub fn useDefault(materials: *Materials) Error!u32 {
    if (materials.default == null) materials.default = try materials.add(.{});
    return materials.default.?;
}

/// A material without its normal texture, for meshes without its coordinates: they have no
/// tangents, so it cannot bend anything.
pub fn useSmooth(materials: *Materials, index: u32) Error!u32 {
    if (materials.smooth.get(index)) |known| return known;
    var material = (try materials.use(index)).*;
    material.normal_texture = null;
    const smooth = try materials.add(material);
    try materials.smooth.put(materials.source.gpa, index, smooth);
    return smooth;
}

/// A material for points and lines without normals, which are not lit but show the sum of base
/// colour and emission (glTF 2.0, section 3.9.7); the latter as far as no texture and no colour of
/// vertices multiplies the former alone.
pub fn useUnlit(materials: *Materials, index: u32, has_colors: bool) Error!u32 {
    if (materials.unlit.get(.{ index, has_colors })) |known| return known;
    const lit = (try materials.use(index)).*;
    if (lit.unlit) return index;
    var material: scene.Material = .{
        .base_color = lit.base_color,
        .base_color_texture = lit.base_color_texture,
        .alpha_mode = lit.alpha_mode,
        .alpha_cutoff = lit.alpha_cutoff,
        .double_sided = lit.double_sided,
        .unlit = true,
    };
    if (!has_colors and lit.base_color_texture == null and lit.emissive_texture == null) {
        for (material.base_color[0..3], lit.emissive) |*channel, emitted| channel.* += emitted;
    }
    const shown = try materials.add(material);
    try materials.unlit.put(materials.source.gpa, .{ index, has_colors }, shown);
    return shown;
}

fn add(materials: *Materials, material: scene.Material) Error!u32 {
    const index = materials.list.len + materials.added.items.len;
    try materials.added.append(materials.source.gpa, material);
    return @intCast(index);
}

/// Adds all materials to the scene.
pub fn finish(materials: *Materials) Error!void {
    for (materials.list, 0..) |known, index| {
        const reader: Reader = .{ .source = materials.source, .index = index };
        const material = known orelse
            reader.read(Source.item(materials.source.data.materials, index));
        _ = try materials.source.builder.addMaterial(material);
    }
    for (materials.added.items) |material| {
        _ = try materials.source.builder.addMaterial(material);
    }
}

fn readTextures(
    materials: *Materials,
    raw: *const c.cgltf_material,
    index: usize,
    material: *scene.Material,
) Error!void {
    const textures = materials.textures;
    const metal = &raw.pbr_metallic_roughness;
    if (raw.has_pbr_metallic_roughness != 0) {
        material.base_color_texture =
            try textures.view(&metal.base_color_texture, index, "baseColorTexture");
        material.metallic_roughness_texture = try textures.view(
            &metal.metallic_roughness_texture,
            index,
            "metallicRoughnessTexture",
        );
    } else if (raw.has_pbr_specular_glossiness != 0) {
        const diffuse = &raw.pbr_specular_glossiness.diffuse_texture;
        material.base_color_texture = try textures.view(diffuse, index, "diffuseTexture");
    }
    material.normal_texture = try textures.view(&raw.normal_texture, index, "normalTexture");
    material.occlusion_texture =
        try textures.view(&raw.occlusion_texture, index, "occlusionTexture");
    material.emissive_texture = try textures.view(&raw.emissive_texture, index, "emissiveTexture");
}

/// Reads the factors of one material.
const Reader = struct {
    source: *const Source,
    index: usize,

    fn read(reader: Reader, raw: *const c.cgltf_material) scene.Material {
        const source = reader.source;
        var material: scene.Material = .{
            .alpha_mode = switch (raw.alpha_mode) {
                .mask => .mask,
                .blend => .blend,
                else => .@"opaque",
            },
            .alpha_cutoff = reader.clamp("alphaCutoff", raw.alpha_cutoff, 0, float_max),
            .double_sided = raw.double_sided != 0,
            .unlit = raw.unlit != 0,
        };
        if (raw.has_pbr_metallic_roughness != 0) {
            const metal = &raw.pbr_metallic_roughness;
            material.base_color = reader.color4("baseColorFactor", metal.base_color_factor);
            material.metallic = reader.unit("metallicFactor", metal.metallic_factor);
            material.roughness = reader.unit("roughnessFactor", metal.roughness_factor);
        } else if (raw.has_pbr_specular_glossiness != 0) {
            source.warn("KHR_materials_pbrSpecularGlossiness is approximated", .{});
            const gloss = &raw.pbr_specular_glossiness;
            material.base_color = reader.color4("diffuseFactor", gloss.diffuse_factor);
            material.metallic = 0;
            material.roughness = 1 - reader.unit("glossinessFactor", gloss.glossiness_factor);
        }
        if (raw.normal_texture.texture != null) {
            material.normal_scale = math.flushDenormal(raw.normal_texture.scale);
        }
        if (raw.occlusion_texture.texture != null) {
            const strength = raw.occlusion_texture.scale;
            material.occlusion_strength = reader.unit("occlusionTexture.strength", strength);
        }
        material.emissive = reader.readEmissive(raw);
        if (raw.has_ior != 0) material.ior = reader.readIor(raw.ior);
        if (raw.has_transmission != 0) {
            const factor = raw.transmission.transmission_factor;
            material.transmission = reader.unit("transmissionFactor", factor);
        }
        if (raw.has_volume != 0) reader.readVolume(&raw.volume, &material);
        return material;
    }

    fn readEmissive(reader: Reader, raw: *const c.cgltf_material) Vec3 {
        const factor = reader.color3("emissiveFactor", raw.emissive_factor);
        if (raw.has_emissive_strength == 0) return factor;
        const strength = reader.clamp(
            "emissiveStrength",
            raw.emissive_strength,
            0,
            float_max,
        );
        var emissive = math.vec3.scale(factor, strength);
        for (&emissive) |*value| value.* = math.flushDenormal(value.*);
        return emissive;
    }

    fn readIor(reader: Reader, ior: f32) f32 {
        if (ior == 0) return ior_total;
        return reader.clamp("ior", ior, 1, ior_total);
    }

    fn readVolume(reader: Reader, raw: *const c.cgltf_volume, material: *scene.Material) void {
        material.volume = raw.thickness_factor > 0;
        material.attenuation_color = reader.color3("attenuationColor", raw.attenuation_color);
        const distance = math.flushDenormal(raw.attenuation_distance);
        if (distance > 0) {
            // cgltf says FLT_MAX where the file says nothing.
            const endless = distance == float_max;
            material.attenuation_distance = if (endless) std.math.inf(f32) else distance;
        } else reader.source.warn(
            "material {d}: attenuationDistance {d} is not above 0, left out",
            .{ reader.index, raw.attenuation_distance },
        );
    }

    fn color4(reader: Reader, name: []const u8, raw: [4]f32) [4]f32 {
        var color: [4]f32 = undefined;
        for (&color, raw) |*value, factor| value.* = reader.unit(name, factor);
        return color;
    }

    fn color3(reader: Reader, name: []const u8, raw: [3]f32) Vec3 {
        var color: Vec3 = undefined;
        for (&color, raw) |*value, factor| value.* = reader.unit(name, factor);
        return color;
    }

    fn unit(reader: Reader, name: []const u8, value: f32) f32 {
        return reader.clamp(name, value, 0, 1);
    }

    fn clamp(reader: Reader, name: []const u8, value: f32, low: f32, high: f32) f32 {
        if (value >= low and value <= high) return math.flushDenormal(value);
        if (high == float_max) reader.source.warn(
            "material {d}: {s} {d} is below {d}, clamped",
            .{ reader.index, name, value, low },
        ) else reader.source.warn(
            "material {d}: {s} {d} is not in {d}..{d}, clamped",
            .{ reader.index, name, value, low, high },
        );
        return if (value > high) high else low;
    }
};
