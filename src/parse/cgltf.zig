//! cgltf's data structures, and the one call through which it is used.
//!
//! In: a JSON text that has passed our own check. Out: cgltf's data, owned by the memory behind the
//! hooks. The declarations mirror those of cgltf.h under its own names; what nobody reads is an
//! array of words with the name of its first field. cgltf.c lists sizes and offsets as the C
//! compiler sees them, and a test compares: a translation of cgltf.h takes a new machine minutes.

const std = @import("std");

/// What cgltf asks of its surroundings.
pub const rl_cgltf_hooks = extern struct {
    user: ?*anyopaque,
    /// Memory of 16-byte alignment, for size 0 as well; null when the budget is exhausted.
    allocate: *const fn (user: ?*anyopaque, size: usize) callconv(.c) ?*anyopaque,
    release: *const fn (user: ?*anyopaque, memory: ?*anyopaque) callconv(.c) void,
    /// A whole number in 0 .. 2^53-1, or -1.
    to_integer: *const fn (text: [*c]const u8) callconv(.c) c_longlong,
    /// A number rounded to float, or NaN.
    to_float: *const fn (text: [*c]const u8) callconv(.c) f32,
};

/// Parses `size` bytes of JSON.
pub extern fn rl_cgltf_parse(
    hooks: *const rl_cgltf_hooks,
    json: [*]const u8,
    size: usize,
    data: *[*c]cgltf_data,
) cgltf_result;

pub const cgltf_result = c_uint;
pub const cgltf_result_success = 0;
pub const cgltf_result_legacy_gltf = 9;

pub const cgltf_attribute_type = c_uint;
pub const cgltf_attribute_type_invalid = 0;
pub const cgltf_attribute_type_position = 1;
pub const cgltf_attribute_type_normal = 2;
pub const cgltf_attribute_type_tangent = 3;
pub const cgltf_attribute_type_texcoord = 4;
pub const cgltf_attribute_type_color = 5;
pub const cgltf_attribute_type_joints = 6;
pub const cgltf_attribute_type_weights = 7;

pub const cgltf_component_type = c_uint;
pub const cgltf_component_type_r_8 = 1;
pub const cgltf_component_type_r_8u = 2;
pub const cgltf_component_type_r_16 = 3;
pub const cgltf_component_type_r_16u = 4;
pub const cgltf_component_type_r_32u = 5;
pub const cgltf_component_type_r_32f = 6;

pub const cgltf_type = c_uint;
pub const cgltf_type_scalar = 1;
pub const cgltf_type_vec2 = 2;
pub const cgltf_type_vec3 = 3;
pub const cgltf_type_vec4 = 4;
pub const cgltf_type_mat2 = 5;
pub const cgltf_type_mat3 = 6;
pub const cgltf_type_mat4 = 7;

pub const cgltf_primitive_type = c_uint;
pub const cgltf_primitive_type_invalid = 0;
pub const cgltf_primitive_type_triangles = 5;
pub const cgltf_primitive_type_triangle_strip = 6;
pub const cgltf_primitive_type_triangle_fan = 7;

pub const cgltf_alpha_mode = c_uint;
pub const cgltf_alpha_mode_mask = 1;
pub const cgltf_alpha_mode_blend = 2;

pub const cgltf_camera_type = c_uint;
pub const cgltf_camera_type_perspective = 1;
pub const cgltf_camera_type_orthographic = 2;

pub const cgltf_light_type = c_uint;
pub const cgltf_light_type_directional = 1;
pub const cgltf_light_type_point = 2;
pub const cgltf_light_type_spot = 3;

const String = [*c]u8;
const cgltf_bool = c_int;
/// Texts that are not read.
const Extras = [3]usize;
/// What most structures end with: extras and extensions.
const Tail = [5]usize;

pub const cgltf_buffer = extern struct {
    name: String,
    size: usize,
    uri: String,
    data: [2]usize,
    extras: Tail,
};

const cgltf_meshopt_compression = extern struct { buffer: [5]usize, mode: [3]c_uint };

pub const cgltf_buffer_view = extern struct {
    name: String,
    buffer: [*c]cgltf_buffer,
    offset: usize,
    size: usize,
    stride: usize,
    type: [2]usize,
    has_meshopt_compression: cgltf_bool,
    meshopt_compression: cgltf_meshopt_compression,
    extras: Tail,
};

const cgltf_accessor_sparse = extern struct {
    count: usize,
    indices_buffer_view: [*c]cgltf_buffer_view,
    indices_byte_offset: usize,
    indices_component_type: cgltf_component_type,
    values_buffer_view: [*c]cgltf_buffer_view,
    values_byte_offset: usize,
};

pub const cgltf_accessor = extern struct {
    name: String,
    component_type: cgltf_component_type,
    normalized: cgltf_bool,
    type: cgltf_type,
    offset: usize,
    count: usize,
    stride: usize,
    buffer_view: [*c]cgltf_buffer_view,
    has_min: [34]u32,
    is_sparse: cgltf_bool,
    sparse: cgltf_accessor_sparse,
    extras: Tail,
};

pub const cgltf_attribute = extern struct {
    name: String,
    type: cgltf_attribute_type,
    index: c_int,
    data: [*c]cgltf_accessor,
};

const cgltf_texture_view = extern struct { texture: ?*anyopaque, texcoord: [10]u32 };

pub const cgltf_pbr_metallic_roughness = extern struct {
    base_color_texture: cgltf_texture_view,
    metallic_roughness_texture: cgltf_texture_view,
    base_color_factor: [4]f32,
    metallic_factor: f32,
    roughness_factor: f32,
};

const cgltf_pbr_specular_glossiness = extern struct {
    diffuse_texture: [2]cgltf_texture_view,
    diffuse_factor: [4]f32,
    specular_factor: [3]f32,
    glossiness_factor: f32,
};

pub const cgltf_volume = extern struct {
    thickness_texture: cgltf_texture_view,
    thickness_factor: f32,
    attenuation_color: [3]f32,
    attenuation_distance: f32,
};

const cgltf_clearcoat = extern struct {
    clearcoat_texture: [3]cgltf_texture_view,
    clearcoat_factor: [2]f32,
};
const cgltf_ior = extern struct { ior: f32 };
const cgltf_specular = extern struct {
    specular_texture: [2]cgltf_texture_view,
    specular_color_factor: [4]f32,
};
const Painted = extern struct { texture: cgltf_texture_view, factors: [3]f32 };
const cgltf_sheen = extern struct {
    sheen_color_texture: Painted,
    sheen_roughness_texture: cgltf_transmission,
};
const cgltf_transmission = extern struct {
    transmission_texture: cgltf_texture_view,
    transmission_factor: f32,
};
const cgltf_emissive_strength = extern struct { emissive_strength: f32 };
const cgltf_iridescence = extern struct {
    iridescence_factor: f32,
    iridescence_texture: Painted,
    iridescence_thickness_texture: cgltf_texture_view,
};
const cgltf_diffuse_transmission = extern struct {
    diffuse_transmission_texture: cgltf_texture_view,
    diffuse_transmission_factor: [4]f32,
    diffuse_transmission_color_texture: cgltf_texture_view,
};
const cgltf_anisotropy = extern struct {
    anisotropy_strength: [2]f32,
    anisotropy_texture: cgltf_texture_view,
};

pub const cgltf_material = extern struct {
    name: String,
    has_pbr_metallic_roughness: cgltf_bool,
    has_pbr_specular_glossiness: cgltf_bool,
    has_clearcoat: cgltf_bool,
    has_transmission: cgltf_bool,
    has_volume: cgltf_bool,
    has_ior: cgltf_bool,
    has_specular: [2]cgltf_bool,
    has_emissive_strength: cgltf_bool,
    has_iridescence: [4]cgltf_bool,
    pbr_metallic_roughness: cgltf_pbr_metallic_roughness,
    pbr_specular_glossiness: cgltf_pbr_specular_glossiness,
    clearcoat: cgltf_clearcoat,
    ior: cgltf_ior,
    specular: cgltf_specular,
    sheen: cgltf_sheen,
    transmission: cgltf_transmission,
    volume: cgltf_volume,
    emissive_strength: cgltf_emissive_strength,
    iridescence: cgltf_iridescence,
    diffuse_transmission: cgltf_diffuse_transmission,
    anisotropy: cgltf_anisotropy,
    dispersion: f32,
    normal_texture: [2]cgltf_texture_view,
    emissive_texture: cgltf_texture_view,
    emissive_factor: [3]f32,
    alpha_mode: cgltf_alpha_mode,
    alpha_cutoff: f32,
    double_sided: cgltf_bool,
    unlit: cgltf_bool,
    extras: Tail,
};

const cgltf_morph_target = extern struct {
    attributes: [*c]cgltf_attribute,
    attributes_count: usize,
};

pub const cgltf_primitive = extern struct {
    type: cgltf_primitive_type,
    indices: [*c]cgltf_accessor,
    material: [*c]cgltf_material,
    attributes: [*c]cgltf_attribute,
    attributes_count: usize,
    targets: [*c]cgltf_morph_target,
    targets_count: usize,
    extras: Extras,
    has_draco_mesh_compression: cgltf_bool,
    draco_mesh_compression: [7]usize,
};

const cgltf_mesh = extern struct {
    name: String,
    primitives: [*c]cgltf_primitive,
    primitives_count: usize,
    weights: [*c]f32,
    weights_count: usize,
    target_names: [2]usize,
    extras: Tail,
};

const cgltf_skin = extern struct {
    name: String,
    joints: [*c][*c]cgltf_node,
    joints_count: usize,
    skeleton: [*c]cgltf_node,
    inverse_bind_matrices: [*c]cgltf_accessor,
    extras: Tail,
};

const cgltf_camera_perspective = extern struct {
    has_aspect_ratio: cgltf_bool,
    aspect_ratio: f32,
    yfov: f32,
    has_zfar: cgltf_bool,
    zfar: f32,
    znear: f32,
    extras: Extras,
};

const cgltf_camera_orthographic = extern struct {
    xmag: f32,
    ymag: f32,
    zfar: [2]f32,
    extras: Extras,
};

pub const cgltf_camera = extern struct {
    name: String,
    type: cgltf_camera_type,
    data: extern union {
        perspective: cgltf_camera_perspective,
        orthographic: cgltf_camera_orthographic,
    },
    extras: Tail,
};

pub const cgltf_light = extern struct {
    name: String,
    color: [3]f32,
    intensity: f32,
    type: cgltf_light_type,
    range: f32,
    spot_inner_cone_angle: f32,
    spot_outer_cone_angle: f32,
    extras: Extras,
};

pub const cgltf_node = extern struct {
    name: String,
    parent: [*c]cgltf_node,
    children: [*c][*c]cgltf_node,
    children_count: usize,
    skin: [*c]cgltf_skin,
    mesh: [*c]cgltf_mesh,
    camera: [*c]cgltf_camera,
    light: [*c]cgltf_light,
    weights: [*c]f32,
    weights_count: usize,
    has_translation: cgltf_bool,
    has_rotation: cgltf_bool,
    has_scale: cgltf_bool,
    has_matrix: cgltf_bool,
    translation: [3]f32,
    rotation: [4]f32,
    scale: [3]f32,
    matrix: [16]f32,
    extras: Extras,
    has_mesh_gpu_instancing: cgltf_bool,
    mesh_gpu_instancing: [4]usize,
};

const cgltf_scene = extern struct {
    name: String,
    nodes: [*c][*c]cgltf_node,
    nodes_count: usize,
    extras: Tail,
};

const cgltf_asset = extern struct {
    copyright: [2]usize,
    version: String,
    min_version: String,
    extras: Tail,
};

/// The document as far as it is read; more follows.
pub const cgltf_data = extern struct {
    file_type: [3]usize,
    asset: cgltf_asset,
    meshes: [*c]cgltf_mesh,
    meshes_count: usize,
    materials: [*c]cgltf_material,
    materials_count: usize,
    accessors: [*c]cgltf_accessor,
    accessors_count: usize,
    buffer_views: [*c]cgltf_buffer_view,
    buffer_views_count: usize,
    buffers: [*c]cgltf_buffer,
    buffers_count: usize,
    images: [3]usize,
    textures_count: usize,
    samplers: [2]usize,
    skins: [*c]cgltf_skin,
    skins_count: usize,
    cameras: [*c]cgltf_camera,
    cameras_count: usize,
    lights: [*c]cgltf_light,
    lights_count: usize,
    nodes: [*c]cgltf_node,
    nodes_count: usize,
    scenes: [*c]cgltf_scene,
    scenes_count: usize,
    scene: [*c]cgltf_scene,
    animations: ?*anyopaque,
    animations_count: usize,
    variants: [7]usize,
    extensions_used: [*c]String,
    extensions_used_count: usize,
    extensions_required: [*c]String,
    extensions_required_count: usize,
};

const mirrored = .{
    cgltf_buffer,                  cgltf_meshopt_compression,
    cgltf_buffer_view,             cgltf_accessor_sparse,
    cgltf_accessor,                cgltf_attribute,
    cgltf_texture_view,            cgltf_pbr_metallic_roughness,
    cgltf_pbr_specular_glossiness, cgltf_volume,
    cgltf_clearcoat,               cgltf_ior,
    cgltf_specular,                cgltf_sheen,
    cgltf_transmission,            cgltf_emissive_strength,
    cgltf_iridescence,             cgltf_diffuse_transmission,
    cgltf_anisotropy,              cgltf_material,
    cgltf_morph_target,            cgltf_primitive,
    cgltf_mesh,                    cgltf_skin,
    cgltf_camera_perspective,      cgltf_camera_orthographic,
    cgltf_camera,                  cgltf_light,
    cgltf_node,                    cgltf_scene,
    cgltf_asset,
};

/// Of each structure its size, then the offsets of its fields; of the document the offsets alone;
/// then the values of the enumerations.
const layout = numbers: {
    @setEvalBranchQuota(10_000);
    var numbers: []const usize = &.{};
    for (mirrored ++ .{cgltf_data}) |Struct| {
        if (Struct != cgltf_data) numbers = numbers ++ .{@sizeOf(Struct)};
        for (std.meta.fieldNames(Struct)) |name| numbers = numbers ++ .{@offsetOf(Struct, name)};
    }
    for (@typeInfo(@This()).@"struct".decl_names) |name| {
        const value = @field(@This(), name);
        if (@TypeOf(value) == comptime_int) numbers = numbers ++ .{value};
    }
    break :numbers numbers;
};

test "sizes, offsets and values are those of cgltf.h" {
    const seen = struct {
        extern const rl_cgltf_layout: [layout.len]c_ushort;
        extern const rl_cgltf_layout_count: usize;
    };
    try std.testing.expectEqual(layout.len, seen.rl_cgltf_layout_count);
    for (layout, seen.rl_cgltf_layout) |ours, theirs| try std.testing.expectEqual(ours, theirs);
}
