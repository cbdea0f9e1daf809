//! glTF's materials: the metallic-roughness model, and which materials there are.
//!
//! In: materials (glTF 2.0, section 3.9; KHR_materials_unlit). Out: the scene's materials with
//! every factor in its range, in the order of the file, and behind them those that the file does
//! not have. The textures of a material are read once something is drawn with it.
//! material_extensions.zig reads what extensions say.

const std = @import("std");
const c = @import("../cgltf.zig");
const extensions = @import("material_extensions.zig");
const math = @import("../../math.zig");
const scene = @import("../../scene.zig");
const Error = Source.Error;
const Factors = @import("factors.zig");
const Source = @import("source.zig");
const Textures = @import("textures.zig");
const Materials = @This();

source: *const Source,
textures: *Textures,
/// By material of the file: whether animations move it; empty: they move none.
moved: []const bool,
/// Those of the file as far as they are read, by their indices.
list: []?scene.Material,
/// Those that come behind them.
added: std.ArrayList(scene.Material) = .empty,
/// glTF's default material, as an index into the scene's.
default: ?u32 = null,
/// By material: the one that does without something.
reduced: std.AutoHashMapUnmanaged(Reduction, u32) = .empty,
/// By material, and whether vertices are coloured: the one of points and lines without normals.
unlit: std.AutoHashMapUnmanaged(struct { u32, bool }, u32) = .empty,

/// What of a material a mesh cannot have for want of texture coordinates or tangents.
pub const Lacks = struct {
    normal_texture: bool = false,
    clearcoat_normal_texture: bool = false,
    anisotropy: bool = false,

    /// Whether there is something.
    pub fn any(lacks: Lacks) bool {
        return lacks.normal_texture or lacks.clearcoat_normal_texture or lacks.anisotropy;
    }
};

const Reduction = struct { material: u32, lacks: Lacks };

/// Nothing is read yet. Free with `deinit`.
pub fn init(
    source: *const Source,
    textures: *Textures,
    moved: []const bool,
) Error!Materials {
    const list = try source.gpa.alloc(?scene.Material, source.data.materials_count);
    @memset(list, null);
    return .{ .source = source, .textures = textures, .moved = moved, .list = list };
}

/// Frees what is not the scene's.
pub fn deinit(materials: *Materials) void {
    const gpa = materials.source.gpa;
    gpa.free(materials.list);
    materials.added.deinit(gpa);
    materials.reduced.deinit(gpa);
    materials.unlit.deinit(gpa);
    materials.* = undefined;
}

/// A material that something is drawn with, its textures included.
pub fn use(materials: *Materials, index: u32) Error!*const scene.Material {
    const file_count = materials.list.len;
    if (index >= file_count) return &materials.added.items[index - file_count];
    const slot = &materials.list[index];
    if (slot.* == null) {
        try materials.source.need(.materials, index);
        slot.* = try materials.read(index, materials.textures);
    }
    return &slot.*.?;
}

/// The material of what has none (glTF 2.0, section 3.7.2.1).
pub fn useDefault(materials: *Materials) Error!u32 {
    if (materials.default == null) materials.default = try materials.add(.{});
    return materials.default.?;
}

/// A material without what a mesh lacks.
pub fn useWithout(materials: *Materials, index: u32, lacks: Lacks) Error!u32 {
    const reduction: Reduction = .{ .material = index, .lacks = lacks };
    if (materials.reduced.get(reduction)) |known| return known;
    var material = (try materials.use(index)).*;
    if (lacks.normal_texture) material.normal_texture = null;
    if (lacks.clearcoat_normal_texture) material.clearcoat_normal_texture = null;
    if (lacks.anisotropy) {
        material.anisotropy = 0;
        material.anisotropy_texture = null;
    }
    const reduced = try materials.add(material);
    try materials.reduced.put(materials.source.gpa, reduction, reduced);
    return reduced;
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
        .in_motion = lit.in_motion,
    };
    if (!has_colors and lit.base_color_texture == null and lit.emissive_texture == null) {
        for (material.base_color[0..3], lit.emissive) |*channel, emitted| {
            channel.* = @min(channel.* + emitted, 1);
        }
    }
    const shown = try materials.add(material);
    try materials.unlit.put(materials.source.gpa, .{ index, has_colors }, shown);
    return shown;
}

/// A material of the scene that stands for one of the file.
pub const Form = struct {
    material: u32,
    /// Which of the file's numbers it has: all, those that need no tangents, or a colour and no
    /// light.
    kind: enum { whole, without_anisotropy, unlit },

    /// Whether it goes with this number of the file's.
    pub fn follows(form: Form, property: scene.MaterialProperty) bool {
        return switch (form.kind) {
            .whole => true,
            .without_anisotropy => property != .anisotropy,
            .unlit => property == .base_color or property == .alpha_cutoff,
        };
    }
};

/// Replaces the list by those that are drawn of a material of the file. One whose colour is in part
/// emission is not among them.
pub fn addForms(materials: *const Materials, index: u32, list: *std.ArrayList(Form)) Error!void {
    const gpa = materials.source.gpa;
    list.clearRetainingCapacity();
    const lit = materials.list[index] orelse return;
    try list.append(gpa, .{ .material = index, .kind = .whole });
    var reduced = materials.reduced.iterator();
    while (reduced.next()) |entry| {
        if (entry.key_ptr.material != index) continue;
        try list.append(gpa, .{
            .material = entry.value_ptr.*,
            .kind = if (entry.key_ptr.lacks.anisotropy) .without_anisotropy else .whole,
        });
    }
    if (math.vec3.maxComponent(lit.emissive) > 0) return;
    var unlit = materials.unlit.iterator();
    while (unlit.next()) |entry| {
        if (entry.key_ptr[0] != index) continue;
        try list.append(gpa, .{ .material = entry.value_ptr.*, .kind = .unlit });
    }
}

fn add(materials: *Materials, material: scene.Material) Error!u32 {
    const index = materials.list.len + materials.added.items.len;
    try materials.added.append(materials.source.gpa, material);
    return @intCast(index);
}

/// Adds all materials to the scene.
pub fn finish(materials: *Materials) Error!void {
    for (materials.list, 0..) |known, index| {
        const material = known orelse try materials.read(index, null);
        _ = try materials.source.builder.addMaterial(material);
    }
    for (materials.added.items) |material| {
        _ = try materials.source.builder.addMaterial(material);
    }
}

/// A material of the file, without textures where `textures` is null.
fn read(materials: *const Materials, index: usize, textures: ?*Textures) Error!scene.Material {
    const source = materials.source;
    const raw = Source.item(source.data.materials, index);
    const factors: Factors = .{ .source = source, .index = index };
    var material = readCore(factors, raw);
    extensions.readFactors(factors, raw, &material);
    if (textures) |all| {
        try readTextures(all, raw, index, &material);
        try extensions.readTextures(all, raw, index, &material);
    }
    try extensions.readScatter(factors, textures, raw, &material);
    material.origin = @intCast(index);
    material.in_motion = materials.moved.len > 0 and materials.moved[index];
    return material;
}

fn readCore(factors: Factors, raw: *const c.cgltf_material) scene.Material {
    const metal = &raw.pbr_metallic_roughness;
    var material: scene.Material = .{
        .alpha_mode = switch (raw.alpha_mode) {
            .mask => .mask,
            .blend => .blend,
            else => .@"opaque",
        },
        .alpha_cutoff = factors.clamp("alphaCutoff", raw.alpha_cutoff, 0, Factors.endless),
        .double_sided = raw.double_sided != 0,
        .unlit = raw.unlit != 0,
        .emissive = factors.color3("emissiveFactor", raw.emissive_factor),
    };
    material.emissive_factor = material.emissive;
    if (raw.has_pbr_metallic_roughness != 0) {
        material.base_color = factors.color4("baseColorFactor", metal.base_color_factor);
        material.metallic = factors.unit("metallicFactor", metal.metallic_factor);
        material.roughness = factors.unit("roughnessFactor", metal.roughness_factor);
    }
    if (raw.normal_texture.texture != null) {
        material.normal_scale = math.flushDenormal(raw.normal_texture.scale);
    }
    if (raw.occlusion_texture.texture != null) {
        const strength = raw.occlusion_texture.scale;
        material.occlusion_strength = factors.unit("occlusionTexture.strength", strength);
    }
    return material;
}

fn readTextures(
    textures: *Textures,
    raw: *const c.cgltf_material,
    index: usize,
    material: *scene.Material,
) Error!void {
    const metal = &raw.pbr_metallic_roughness;
    if (raw.has_pbr_metallic_roughness != 0 and raw.has_pbr_specular_glossiness == 0) {
        material.base_color_texture =
            try textures.view(&metal.base_color_texture, index, "baseColorTexture");
        material.metallic_roughness_texture = try textures.view(
            &metal.metallic_roughness_texture,
            index,
            "metallicRoughnessTexture",
        );
    }
    material.normal_texture = try textures.view(&raw.normal_texture, index, "normalTexture");
    material.occlusion_texture =
        try textures.view(&raw.occlusion_texture, index, "occlusionTexture");
    material.emissive_texture = try textures.view(&raw.emissive_texture, index, "emissiveTexture");
}
