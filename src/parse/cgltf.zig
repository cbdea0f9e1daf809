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

pub const cgltf_result = enum(c_uint) { success = 0, legacy_gltf = 9, _ };
pub const cgltf_attribute_type = enum(c_uint) {
    invalid,
    position,
    normal,
    tangent,
    texcoord,
    color,
    joints,
    weights,
    _,
};
pub const cgltf_component_type = enum(c_uint) { invalid, r_8, r_8u, r_16, r_16u, r_32u, r_32f, _ };
pub const cgltf_type = enum(c_uint) { invalid, scalar, vec2, vec3, vec4, mat2, mat3, mat4, _ };
pub const cgltf_primitive_type = enum(c_uint) {
    invalid = 0,
    points = 1,
    lines = 2,
    line_loop = 3,
    line_strip = 4,
    triangles = 5,
    triangle_strip = 6,
    triangle_fan = 7,
    _,
};
pub const cgltf_alpha_mode = enum(c_uint) { @"opaque", mask, blend, _ };
pub const cgltf_camera_type = enum(c_uint) { invalid, perspective, orthographic, _ };
pub const cgltf_light_type = enum(c_uint) { invalid, directional, point, spot, _ };
pub const cgltf_filter_type = enum(c_uint) {
    undefined = 0,
    nearest = 9728,
    linear = 9729,
    nearest_mipmap_nearest = 9984,
    linear_mipmap_nearest = 9985,
    nearest_mipmap_linear = 9986,
    linear_mipmap_linear = 9987,
    _,
};
pub const cgltf_wrap_mode = enum(c_uint) {
    repeat = 10497,
    clamp_to_edge = 33071,
    mirrored_repeat = 33648,
    _,
};

pub const cgltf_meshopt_compression_mode = enum(c_uint) {
    invalid,
    attributes,
    triangles,
    indices,
    _,
};
pub const cgltf_meshopt_compression_filter = enum(c_uint) {
    none,
    octahedral,
    quaternion,
    exponential,
    color,
    _,
};

const String = [*c]u8;
const cgltf_bool = c_int;
/// Texts that are not read.
const Extras = [3]usize;
/// What most structures end with: extras and extensions.
const Tail = [5]usize;

pub const cgltf_extension = extern struct { name: String, data: String };

pub const cgltf_buffer = extern struct {
    name: String,
    size: usize,
    uri: String,
    data: [2]usize,
    extras: Tail,
};

pub const cgltf_meshopt_compression = extern struct {
    buffer: [*c]cgltf_buffer,
    offset: usize,
    size: usize,
    stride: usize,
    count: usize,
    mode: cgltf_meshopt_compression_mode,
    filter: cgltf_meshopt_compression_filter,
    is_khr: cgltf_bool,
};

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

pub const cgltf_accessor_sparse = extern struct {
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

pub const cgltf_image = extern struct {
    name: String,
    uri: String,
    buffer_view: [*c]cgltf_buffer_view,
    mime_type: String,
    extras: Tail,
};

pub const cgltf_sampler = extern struct {
    name: String,
    mag_filter: cgltf_filter_type,
    min_filter: cgltf_filter_type,
    wrap_s: cgltf_wrap_mode,
    wrap_t: cgltf_wrap_mode,
    extras: Tail,
};

pub const cgltf_texture = extern struct {
    name: String,
    image: [*c]cgltf_image,
    sampler: [*c]cgltf_sampler,
    has_basisu: cgltf_bool,
    basisu_image: [*c]cgltf_image,
    has_webp: cgltf_bool,
    webp_image: [*c]cgltf_image,
    extras: Tail,
};

pub const cgltf_texture_transform = extern struct {
    offset: [2]f32,
    rotation: f32,
    scale: [2]f32,
    has_texcoord: cgltf_bool,
    texcoord: c_int,
};

pub const cgltf_texture_view = extern struct {
    texture: [*c]cgltf_texture,
    texcoord: c_int,
    /// The strength of an occlusion texture as well.
    scale: f32,
    has_transform: cgltf_bool,
    transform: cgltf_texture_transform,
};

pub const cgltf_pbr_metallic_roughness = extern struct {
    base_color_texture: cgltf_texture_view,
    metallic_roughness_texture: cgltf_texture_view,
    base_color_factor: [4]f32,
    metallic_factor: f32,
    roughness_factor: f32,
};

pub const cgltf_pbr_specular_glossiness = extern struct {
    diffuse_texture: cgltf_texture_view,
    specular_glossiness_texture: cgltf_texture_view,
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

pub const cgltf_transmission = extern struct {
    transmission_texture: cgltf_texture_view,
    transmission_factor: f32,
};

pub const cgltf_clearcoat = extern struct {
    clearcoat_texture: cgltf_texture_view,
    clearcoat_roughness_texture: cgltf_texture_view,
    clearcoat_normal_texture: cgltf_texture_view,
    clearcoat_factor: f32,
    clearcoat_roughness_factor: f32,
};

pub const cgltf_specular = extern struct {
    specular_texture: cgltf_texture_view,
    specular_color_texture: cgltf_texture_view,
    specular_color_factor: [3]f32,
    specular_factor: f32,
};

pub const cgltf_sheen = extern struct {
    sheen_color_texture: cgltf_texture_view,
    sheen_color_factor: [3]f32,
    sheen_roughness_texture: cgltf_texture_view,
    sheen_roughness_factor: f32,
};

pub const cgltf_iridescence = extern struct {
    iridescence_factor: f32,
    iridescence_texture: cgltf_texture_view,
    iridescence_ior: f32,
    iridescence_thickness_min: f32,
    iridescence_thickness_max: f32,
    iridescence_thickness_texture: cgltf_texture_view,
};

pub const cgltf_diffuse_transmission = extern struct {
    diffuse_transmission_texture: cgltf_texture_view,
    diffuse_transmission_factor: f32,
    diffuse_transmission_color_factor: [3]f32,
    diffuse_transmission_color_texture: cgltf_texture_view,
};

pub const cgltf_anisotropy = extern struct {
    anisotropy_strength: f32,
    anisotropy_rotation: f32,
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
    has_specular: cgltf_bool,
    has_sheen: cgltf_bool,
    has_emissive_strength: cgltf_bool,
    has_iridescence: cgltf_bool,
    has_diffuse_transmission: cgltf_bool,
    has_anisotropy: cgltf_bool,
    has_dispersion: cgltf_bool,
    pbr_metallic_roughness: cgltf_pbr_metallic_roughness,
    pbr_specular_glossiness: cgltf_pbr_specular_glossiness,
    clearcoat: cgltf_clearcoat,
    ior: f32,
    specular: cgltf_specular,
    sheen: cgltf_sheen,
    transmission: cgltf_transmission,
    volume: cgltf_volume,
    emissive_strength: f32,
    iridescence: cgltf_iridescence,
    diffuse_transmission: cgltf_diffuse_transmission,
    anisotropy: cgltf_anisotropy,
    dispersion: f32,
    normal_texture: cgltf_texture_view,
    occlusion_texture: cgltf_texture_view,
    emissive_texture: cgltf_texture_view,
    emissive_factor: [3]f32,
    alpha_mode: cgltf_alpha_mode,
    alpha_cutoff: f32,
    double_sided: cgltf_bool,
    unlit: cgltf_bool,
    extras: Extras,
    extensions_count: usize,
    extensions: [*c]cgltf_extension,
};

/// A material of a primitive in a variant.
pub const cgltf_material_mapping = extern struct {
    variant: usize,
    material: [*c]cgltf_material,
    extras: Extras,
};

pub const cgltf_material_variant = extern struct { name: String, extras: Extras };

pub const cgltf_morph_target = extern struct {
    attributes: [*c]cgltf_attribute,
    attributes_count: usize,
};

pub const cgltf_draco_mesh_compression = extern struct {
    buffer_view: [*c]cgltf_buffer_view,
    /// Draco's own numbers of attributes, as if they were indices of accessors.
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
    draco_mesh_compression: cgltf_draco_mesh_compression,
    mappings: [*c]cgltf_material_mapping,
    mappings_count: usize,
    extensions_count: [2]usize,
};

pub const cgltf_mesh = extern struct {
    name: String,
    primitives: [*c]cgltf_primitive,
    primitives_count: usize,
    weights: [*c]f32,
    weights_count: usize,
    target_names: [2]usize,
    extras: Tail,
};

pub const cgltf_skin = extern struct {
    name: String,
    joints: [*c][*c]cgltf_node,
    joints_count: usize,
    skeleton: [*c]cgltf_node,
    inverse_bind_matrices: [*c]cgltf_accessor,
    extras: Tail,
};

pub const cgltf_camera_perspective = extern struct {
    has_aspect_ratio: cgltf_bool,
    aspect_ratio: f32,
    yfov: f32,
    has_zfar: cgltf_bool,
    zfar: f32,
    znear: f32,
    extras: Extras,
};

pub const cgltf_camera_orthographic = extern struct {
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

pub const cgltf_mesh_gpu_instancing = extern struct {
    attributes: [*c]cgltf_attribute,
    attributes_count: usize,
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
    mesh_gpu_instancing: cgltf_mesh_gpu_instancing,
    extensions_count: usize,
    extensions: [*c]cgltf_extension,
};

pub const cgltf_scene = extern struct {
    name: String,
    nodes: [*c][*c]cgltf_node,
    nodes_count: usize,
    extras: Extras,
    extensions_count: usize,
    extensions: [*c]cgltf_extension,
};

pub const cgltf_asset = extern struct {
    copyright: usize,
    generator: String,
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
    images: [*c]cgltf_image,
    images_count: usize,
    textures: [*c]cgltf_texture,
    textures_count: usize,
    samplers: [*c]cgltf_sampler,
    samplers_count: usize,
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
    animations: [2]usize,
    variants: [*c]cgltf_material_variant,
    variants_count: usize,
    extras: Extras,
    data_extensions_count: usize,
    data_extensions: [*c]cgltf_extension,
    extensions_used: [*c]String,
    extensions_used_count: usize,
    extensions_required: [*c]String,
    extensions_required_count: usize,
};

/// In the order above: of each enumeration its values, of each structure its size and the offsets
/// of its fields, of the document the offsets alone.
const layout = numbers: {
    @setEvalBranchQuota(10_000);
    var numbers: []const usize = &.{};
    for (@typeInfo(@This()).@"struct".decl_names) |name| {
        const Mirror = @field(@This(), name);
        if (!std.mem.startsWith(u8, name, "cgltf_")) continue;
        const is_structure = @typeInfo(Mirror) == .@"struct";
        if (is_structure and Mirror != cgltf_data) numbers = numbers ++ .{@sizeOf(Mirror)};
        for (std.meta.fieldNames(Mirror)) |field| numbers = numbers ++ .{
            if (is_structure) @offsetOf(Mirror, field) else @backingInt(@field(Mirror, field)),
        };
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
