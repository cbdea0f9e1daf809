//! glTF's materials: metallic-roughness factors and those of the extensions that are traced.
//!
//! In: materials (glTF 2.0, section 3.9; KHR_materials_ior, _transmission, _volume,
//! _emissive_strength, _unlit). Out: the scene's materials with every factor in its range, in the
//! order of the file. Textures are not read: where one would decide, the factor stands alone, and
//! what would be wrong at its full value (metal, glow) counts as absent.

const std = @import("std");
const c = @import("../cgltf.zig");
const math = @import("../../math.zig");
const scene = @import("../../scene.zig");
const Source = @import("source.zig");
const Error = Source.Error;
const Vec3 = math.Vec3;

/// Index of refraction that stands for KHR_materials_ior's 0, "Fresnel's term is 1".
const ior_total = 1e6;

const float_max = std.math.floatMax(f32);

/// Adds all materials to the scene; `default_added` puts glTF's default material behind them.
pub fn read(source: *const Source, default_added: bool) Error!void {
    for (0..source.data.materials_count) |index| {
        const reader: Reader = .{ .source = source, .index = index };
        const material = reader.read(Source.item(source.data.materials, index));
        _ = try source.builder.addMaterial(material);
    }
    if (default_added) _ = try source.builder.addMaterial(.{});
}

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
            reader.readMetallicRoughness(&raw.pbr_metallic_roughness, &material);
        } else if (raw.has_pbr_specular_glossiness != 0) {
            source.warn("KHR_materials_pbrSpecularGlossiness is approximated", .{});
            const gloss = &raw.pbr_specular_glossiness;
            material.base_color = reader.color4("diffuseFactor", gloss.diffuse_factor);
            material.metallic = 0;
            material.roughness = 1 - reader.unit("glossinessFactor", gloss.glossiness_factor);
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

    fn readMetallicRoughness(
        reader: Reader,
        raw: *const c.cgltf_pbr_metallic_roughness,
        material: *scene.Material,
    ) void {
        material.base_color = reader.color4("baseColorFactor", raw.base_color_factor);
        material.roughness = reader.unit("roughnessFactor", raw.roughness_factor);
        const metallic = reader.unit("metallicFactor", raw.metallic_factor);
        const textured = raw.metallic_roughness_texture.texture != null;
        material.metallic = if (textured) 0 else metallic;
    }

    fn readEmissive(reader: Reader, raw: *const c.cgltf_material) Vec3 {
        if (raw.emissive_texture.texture != null) return .{ 0, 0, 0 };
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
        reader.source.warn(
            "material {d}: {s} {d} is not in {d}..{d}, clamped",
            .{ reader.index, name, value, low, high },
        );
        return if (value > high) high else low;
    }
};
