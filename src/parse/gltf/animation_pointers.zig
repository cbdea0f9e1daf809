//! JSON pointers (RFC 6901) to what animations move (KHR_animation_pointer; glTF 2.0 Asset Object
//! Model).
//!
//! In: a pointer's text. Out: the property that it names, by the file's own numbers, which are not
//! compared with what there is; null where it names none that is rendered.

const std = @import("std");
const scene = @import("../../scene.zig");
const CameraProperty = scene.CameraProperty;
const LightProperty = scene.LightProperty;
const MaterialProperty = scene.MaterialProperty;
const TextureField = scene.TextureField;
const TransformPart = scene.TransformPart;

/// A property of a thing of the file.
pub const Property = union(enum) {
    /// Of nodes.
    translation: u32,
    rotation: u32,
    scale: u32,
    visible: u32,
    weights: u32,
    weight: Element,
    /// Of meshes, for nodes that have none of their own.
    mesh_weights: u32,
    mesh_weight: Element,
    material: struct { index: u32, property: MaterialProperty },
    texture: struct { index: u32, field: TextureField, part: TransformPart },
    light: struct { index: u32, property: LightProperty },
    camera: struct { index: u32, property: CameraProperty },
    /// It changes no picture.
    unseen,

    pub const Element = struct { index: u32, element: u32 };
};

/// See the head of the file.
pub fn parse(pointer: []const u8) ?Property {
    if (afterIndex(pointer, "/nodes/")) |rest| return ofNode(rest.index, rest.text);
    if (afterIndex(pointer, "/meshes/")) |rest| {
        if (std.mem.eql(u8, rest.text, "weights")) return .{ .mesh_weights = rest.index };
        const element = elementOf(rest.text) orelse return null;
        return .{ .mesh_weight = .{ .index = rest.index, .element = element } };
    }
    if (afterIndex(pointer, "/materials/")) |rest| return ofMaterial(rest.index, rest.text);
    if (afterIndex(pointer, "/cameras/")) |rest| {
        if (find(CameraProperty, &camera_properties, rest.text)) |property| return .{
            .camera = .{ .index = rest.index, .property = property },
        };
        // A ray tracer does not clip.
        for (clip_properties) |name| if (std.mem.eql(u8, name, rest.text)) return .unseen;
        return null;
    }
    const lights = "/extensions/KHR_lights_punctual/lights/";
    const rest = afterIndex(pointer, lights) orelse return null;
    const property = find(LightProperty, &light_properties, rest.text) orelse return null;
    return .{ .light = .{ .index = rest.index, .property = property } };
}

/// An index, and what comes after the slash behind it.
const Rest = struct { index: u32, text: []const u8 };

fn afterIndex(pointer: []const u8, prefix: []const u8) ?Rest {
    const text = std.mem.cutPrefix(u8, pointer, prefix) orelse return null;
    const digits, const rest = std.mem.cutScalar(u8, text, '/') orelse return null;
    return .{ .index = indexOf(digits) orelse return null, .text = rest };
}

/// RFC 6901, section 4: digits without a zero before them.
fn indexOf(digits: []const u8) ?u32 {
    if (digits.len == 0 or (digits.len > 1 and digits[0] == '0')) return null;
    for (digits) |digit| if (!std.ascii.isDigit(digit)) return null;
    return std.fmt.parseInt(u32, digits, 10) catch null;
}

/// The number of `weights/0`.
fn elementOf(text: []const u8) ?u32 {
    return indexOf(std.mem.cutPrefix(u8, text, "weights/") orelse return null);
}

fn ofNode(index: u32, text: []const u8) ?Property {
    const names = .{ "translation", "rotation", "scale", "weights" };
    inline for (names) |name| {
        if (std.mem.eql(u8, text, name)) return @unionInit(Property, name, index);
    }
    if (std.mem.eql(u8, text, "extensions/KHR_node_visibility/visible"))
        return .{ .visible = index };
    const element = elementOf(text) orelse return null;
    return .{ .weight = .{ .index = index, .element = element } };
}

fn ofMaterial(index: u32, text: []const u8) ?Property {
    if (find(MaterialProperty, &material_properties, text)) |property| return .{
        .material = .{ .index = index, .property = property },
    };
    const infix = "/extensions/KHR_texture_transform/";
    const at = std.mem.find(u8, text, infix) orelse return null;
    const field = find(TextureField, &texture_uses, text[0..at]) orelse return null;
    const part = find(TransformPart, &transform_parts, text[at + infix.len ..]) orelse return null;
    return .{ .texture = .{ .index = index, .field = field, .part = part } };
}

fn Named(comptime T: type) type {
    return struct { []const u8, T };
}

fn find(comptime T: type, table: []const Named(T), text: []const u8) ?T {
    for (table) |row| if (std.mem.eql(u8, row[0], text)) return row[1];
    return null;
}

const camera_properties = [_]Named(CameraProperty){
    .{ "perspective/yfov", .y_fov_rad },
    .{ "perspective/aspectRatio", .aspect },
    .{ "orthographic/xmag", .half_width },
    .{ "orthographic/ymag", .half_height },
};

const clip_properties = [_][]const u8{
    "perspective/znear", "perspective/zfar", "orthographic/znear", "orthographic/zfar",
};

const light_properties = [_]Named(LightProperty){
    .{ "color", .color },
    .{ "intensity", .intensity },
    .{ "range", .range },
    .{ "spot/innerConeAngle", .inner_cone_rad },
    .{ "spot/outerConeAngle", .outer_cone_rad },
};

const transform_parts = [_]Named(TransformPart){
    .{ "offset", .offset },
    .{ "rotation", .rotation_rad },
    .{ "scale", .scale },
};

const metal = "pbrMetallicRoughness/";
const extension = "extensions/KHR_materials_";
const clearcoat = extension ++ "clearcoat/";
const specular = extension ++ "specular/";
const sheen = extension ++ "sheen/";
const transmission = extension ++ "transmission/";
const volume = extension ++ "volume/";
const iridescence = extension ++ "iridescence/";
const anisotropy = extension ++ "anisotropy/";
const diffuse = extension ++ "diffuse_transmission/";
const scatter = extension ++ "volume_scatter/";

const material_properties = [_]Named(MaterialProperty){
    .{ metal ++ "baseColorFactor", .base_color },
    .{ metal ++ "metallicFactor", .metallic },
    .{ metal ++ "roughnessFactor", .roughness },
    .{ "alphaCutoff", .alpha_cutoff },
    .{ "normalTexture/scale", .normal_scale },
    .{ "occlusionTexture/strength", .occlusion_strength },
    .{ "emissiveFactor", .emissive_factor },
    .{ extension ++ "emissive_strength/emissiveStrength", .emissive_strength },
    .{ extension ++ "ior/ior", .ior },
    .{ transmission ++ "transmissionFactor", .transmission },
    .{ volume ++ "thicknessFactor", .volume },
    .{ volume ++ "attenuationColor", .attenuation_color },
    .{ volume ++ "attenuationDistance", .attenuation_distance },
    .{ specular ++ "specularFactor", .specular },
    .{ specular ++ "specularColorFactor", .specular_color },
    .{ clearcoat ++ "clearcoatFactor", .clearcoat },
    .{ clearcoat ++ "clearcoatRoughnessFactor", .clearcoat_roughness },
    .{ clearcoat ++ "clearcoatNormalTexture/scale", .clearcoat_normal_scale },
    .{ sheen ++ "sheenColorFactor", .sheen_color },
    .{ sheen ++ "sheenRoughnessFactor", .sheen_roughness },
    .{ extension ++ "dispersion/dispersion", .dispersion },
    .{ iridescence ++ "iridescenceFactor", .iridescence },
    .{ iridescence ++ "iridescenceIor", .iridescence_ior },
    .{ iridescence ++ "iridescenceThicknessMinimum", .iridescence_thickness_min_nm },
    .{ iridescence ++ "iridescenceThicknessMaximum", .iridescence_thickness_max_nm },
    .{ anisotropy ++ "anisotropyStrength", .anisotropy },
    .{ anisotropy ++ "anisotropyRotation", .anisotropy_rotation_rad },
    .{ diffuse ++ "diffuseTransmissionFactor", .diffuse_transmission },
    .{ diffuse ++ "diffuseTransmissionColorFactor", .diffuse_transmission_color },
    .{ scatter ++ "multiscatterColorFactor", .multiscatter_color },
    .{ scatter ++ "multiscatterColor", .multiscatter_color },
    .{ scatter ++ "scatterAnisotropy", .scatter_anisotropy },
};

const texture_uses = [_]Named(TextureField){
    .{ metal ++ "baseColorTexture", .base_color_texture },
    .{ metal ++ "metallicRoughnessTexture", .metallic_roughness_texture },
    .{ "normalTexture", .normal_texture },
    .{ "occlusionTexture", .occlusion_texture },
    .{ "emissiveTexture", .emissive_texture },
    .{ transmission ++ "transmissionTexture", .transmission_texture },
    .{ specular ++ "specularTexture", .specular_texture },
    .{ specular ++ "specularColorTexture", .specular_color_texture },
    .{ clearcoat ++ "clearcoatTexture", .clearcoat_texture },
    .{ clearcoat ++ "clearcoatRoughnessTexture", .clearcoat_roughness_texture },
    .{ clearcoat ++ "clearcoatNormalTexture", .clearcoat_normal_texture },
    .{ sheen ++ "sheenColorTexture", .sheen_color_texture },
    .{ sheen ++ "sheenRoughnessTexture", .sheen_roughness_texture },
    .{ iridescence ++ "iridescenceTexture", .iridescence_texture },
    .{ iridescence ++ "iridescenceThicknessTexture", .iridescence_thickness_texture },
    .{ anisotropy ++ "anisotropyTexture", .anisotropy_texture },
    .{ diffuse ++ "diffuseTransmissionTexture", .diffuse_transmission_texture },
    .{ diffuse ++ "diffuseTransmissionColorTexture", .diffuse_transmission_color_texture },
    .{ scatter ++ "multiscatterColorTexture", .multiscatter_color_texture },
};

const testing = std.testing;

test "pointers to what is rendered" {
    const Case = struct { []const u8, Property };
    for ([_]Case{
        .{ "/nodes/12/rotation", .{ .rotation = 12 } },
        .{ "/nodes/0/weights", .{ .weights = 0 } },
        .{ "/nodes/7/extensions/KHR_node_visibility/visible", .{ .visible = 7 } },
        .{ "/nodes/3/weights/10", .{ .weight = .{ .index = 3, .element = 10 } } },
        .{ "/meshes/1/weights", .{ .mesh_weights = 1 } },
        .{ "/meshes/1/weights/0", .{ .mesh_weight = .{ .index = 1, .element = 0 } } },
        .{
            "/materials/2/pbrMetallicRoughness/baseColorFactor",
            .{ .material = .{ .index = 2, .property = .base_color } },
        },
        .{
            "/materials/2/extensions/KHR_materials_sheen/sheenColorTexture/extensions/" ++
                "KHR_texture_transform/offset",
            .{ .texture = .{ .index = 2, .field = .sheen_color_texture, .part = .offset } },
        },
        .{
            "/extensions/KHR_lights_punctual/lights/0/spot/outerConeAngle",
            .{ .light = .{ .index = 0, .property = .outer_cone_rad } },
        },
        .{
            "/cameras/0/perspective/yfov",
            .{ .camera = .{ .index = 0, .property = .y_fov_rad } },
        },
        .{ "/cameras/0/perspective/znear", .unseen },
    }) |case| {
        errdefer std.debug.print("{s}\n", .{case[0]});
        try testing.expectEqualDeep(case[1], parse(case[0]).?);
    }
}

test "pointers to anything else" {
    for ([_][]const u8{
        "",
        "/",
        "/nodes",
        "/nodes/",
        "/nodes/0",
        "/nodes/0/",
        "/nodes/01/scale",
        "/nodes/-1/scale",
        "/nodes/99999999999/scale",
        "/nodes/0/matrix",
        "/nodes/0/weights/",
        "/nodes/0/weights/x",
        "nodes/0/scale",
        "/nodes/0/scale/0",
        "/materials/0/name",
        "/cameras/0/yfov",
        "/scenes/0/name",
        "/materials/0/normalTexture/index",
        "/meshes/0/weights/1.",
        "/materials/0/extensions/KHR_texture_transform/offset",
    }) |pointer| {
        errdefer std.debug.print("{s}\n", .{pointer});
        try testing.expectEqual(null, parse(pointer));
    }
}

test "every property of a material and every texture of glTF's has a pointer" {
    for (std.enums.values(MaterialProperty)) |property| {
        for (material_properties) |row| {
            if (row[1] == property) break;
        } else return error.TestUnexpectedResult;
    }
    // PBRT's, and those of a model that pointers do not know.
    try testing.expectEqual(scene.texture_fields.len - 2, texture_uses.len);
}
