/* cgltf's implementation, compiled with our numbers, the shim that calls it, and its layout.
 *
 * In: a JSON text that has passed our own check. Out: cgltf's data, owned by the memory behind the
 * hooks, never by cgltf_free. No file is opened here, and no accessor is read. The numbers go
 * through hooks because atoi and atof depend on the locale and take what is not a number for 0.
 * The hooks are thread-local: cgltf's macros have no place for a context.
 */
#include <limits.h>
#include <setjmp.h>
#include <stddef.h>

/* cgltf.zig says what the hooks do. */
typedef struct rl_cgltf_hooks {
    void *user;
    void *(*allocate)(void *user, size_t size);
    void (*release)(void *user, void *memory);
    long long (*to_integer)(const char *text);
    float (*to_float)(const char *text);
} rl_cgltf_hooks;

static _Thread_local const rl_cgltf_hooks *rl_hooks;

static int rl_to_int(const char *text) {
    const long long value = rl_hooks->to_integer(text);
    return value > INT_MAX ? -1 : (int)value;
}

#define CGLTF_MALLOC(size) ((void)(size), (void *)0)
#define CGLTF_FREE(memory) ((void)(memory))
#define CGLTF_ATOI(text) rl_to_int(text)
#define CGLTF_ATOLL(text) rl_hooks->to_integer(text)
#define CGLTF_ATOF(text) rl_hooks->to_float(text)
#define CGLTF_IMPLEMENTATION
#include "cgltf.h"

typedef struct rl_memory {
    const rl_cgltf_hooks *hooks;
    jmp_buf exhausted;
} rl_memory;

static void *rl_allocate(void *user, cgltf_size size) {
    rl_memory *memory = user;
    void *result = memory->hooks->allocate(memory->hooks->user, size);
    if (result == NULL) longjmp(memory->exhausted, 1);
    return result;
}

static void rl_release(void *user, void *pointer) {
    rl_memory *memory = user;
    if (pointer != NULL) memory->hooks->release(memory->hooks->user, pointer);
}

/* cgltf_result_out_of_memory as soon as a hook returns NULL: cgltf itself crashes then, so it is
 * left by longjmp. */
cgltf_result rl_cgltf_parse(const rl_cgltf_hooks *hooks, const char *json, size_t size,
                            cgltf_data **data) {
    rl_memory memory = {.hooks = hooks};
    const cgltf_options options = {
        .type = cgltf_file_type_gltf,
        .memory = {.alloc_func = rl_allocate, .free_func = rl_release, .user_data = &memory},
    };
    rl_hooks = hooks;
    if (setjmp(memory.exhausted) != 0) return cgltf_result_out_of_memory;
    return cgltf_parse(&options, json, size, data);
}

/* What cgltf.zig takes for granted, without a name of its own. */
_Static_assert(sizeof(cgltf_size) == sizeof(size_t), "a size is a usize");
_Static_assert(sizeof(cgltf_bool) == sizeof(int), "a bool is a c_int");
_Static_assert(sizeof(cgltf_int) == sizeof(int), "an int is a c_int");
_Static_assert(sizeof(cgltf_float) == sizeof(float), "a float is an f32");
_Static_assert(sizeof(cgltf_type) == sizeof(unsigned int), "an enumeration is a c_uint");
_Static_assert(sizeof(cgltf_data) < USHRT_MAX, "numbers of the layout are unsigned short");

/* The offsets of some fields. Each round of ROUNDS expands one more of them. */
#define NOTHING
#define ROUNDS(...) ROUNDS4(ROUNDS4(ROUNDS4(__VA_ARGS__)))
#define ROUNDS4(...) ROUNDS1(ROUNDS1(ROUNDS1(ROUNDS1(__VA_ARGS__))))
#define ROUNDS1(...) ROUNDS0(ROUNDS0(ROUNDS0(ROUNDS0(__VA_ARGS__))))
#define ROUNDS0(...) __VA_ARGS__
#define EACH(type, field, ...) \
    offsetof(type, field) __VA_OPT__(, AGAIN NOTHING()(type, __VA_ARGS__))
#define AGAIN() EACH
#define OFFSETS(...) ROUNDS(EACH(__VA_ARGS__))
#define STRUCTURE(type, ...) sizeof(type), OFFSETS(type, __VA_ARGS__)

/* In the order of cgltf.zig, whose test compares: of each enumeration its values, of each structure
 * its size and the offsets of its fields. */
const unsigned short rl_cgltf_layout[] = {
    cgltf_result_success, cgltf_result_legacy_gltf,
    cgltf_attribute_type_invalid, cgltf_attribute_type_position, cgltf_attribute_type_normal,
    cgltf_attribute_type_tangent, cgltf_attribute_type_texcoord, cgltf_attribute_type_color,
    cgltf_attribute_type_joints, cgltf_attribute_type_weights,
    cgltf_component_type_invalid, cgltf_component_type_r_8, cgltf_component_type_r_8u,
    cgltf_component_type_r_16, cgltf_component_type_r_16u, cgltf_component_type_r_32u,
    cgltf_component_type_r_32f,
    cgltf_type_invalid, cgltf_type_scalar, cgltf_type_vec2, cgltf_type_vec3, cgltf_type_vec4,
    cgltf_type_mat2, cgltf_type_mat3, cgltf_type_mat4,
    cgltf_primitive_type_invalid, cgltf_primitive_type_points, cgltf_primitive_type_lines,
    cgltf_primitive_type_line_loop, cgltf_primitive_type_line_strip, cgltf_primitive_type_triangles,
    cgltf_primitive_type_triangle_strip, cgltf_primitive_type_triangle_fan,
    cgltf_alpha_mode_opaque, cgltf_alpha_mode_mask, cgltf_alpha_mode_blend,
    cgltf_camera_type_invalid, cgltf_camera_type_perspective, cgltf_camera_type_orthographic,
    cgltf_light_type_invalid, cgltf_light_type_directional, cgltf_light_type_point,
    cgltf_light_type_spot,
    cgltf_filter_type_undefined, cgltf_filter_type_nearest, cgltf_filter_type_linear,
    cgltf_filter_type_nearest_mipmap_nearest, cgltf_filter_type_linear_mipmap_nearest,
    cgltf_filter_type_nearest_mipmap_linear, cgltf_filter_type_linear_mipmap_linear,
    cgltf_wrap_mode_repeat, cgltf_wrap_mode_clamp_to_edge, cgltf_wrap_mode_mirrored_repeat,
    cgltf_meshopt_compression_mode_invalid, cgltf_meshopt_compression_mode_attributes,
    cgltf_meshopt_compression_mode_triangles, cgltf_meshopt_compression_mode_indices,
    cgltf_meshopt_compression_filter_none, cgltf_meshopt_compression_filter_octahedral,
    cgltf_meshopt_compression_filter_quaternion, cgltf_meshopt_compression_filter_exponential,
    cgltf_meshopt_compression_filter_color,
    STRUCTURE(cgltf_extension, name, data),
    STRUCTURE(cgltf_buffer, name, size, uri, data, extras),
    STRUCTURE(cgltf_meshopt_compression, buffer, offset, size, stride, count, mode, filter,
              is_khr),
    STRUCTURE(cgltf_buffer_view, name, buffer, offset, size, stride, type,
              has_meshopt_compression, meshopt_compression, extras),
    STRUCTURE(cgltf_accessor_sparse, count, indices_buffer_view, indices_byte_offset,
              indices_component_type, values_buffer_view, values_byte_offset),
    STRUCTURE(cgltf_accessor, name, component_type, normalized, type, offset, count, stride,
              buffer_view, has_min, is_sparse, sparse, extras),
    STRUCTURE(cgltf_attribute, name, type, index, data),
    STRUCTURE(cgltf_image, name, uri, buffer_view, mime_type, extras),
    STRUCTURE(cgltf_sampler, name, mag_filter, min_filter, wrap_s, wrap_t, extras),
    STRUCTURE(cgltf_texture, name, image, sampler, has_basisu, basisu_image, has_webp, webp_image,
              extras),
    STRUCTURE(cgltf_texture_transform, offset, rotation, scale, has_texcoord, texcoord),
    STRUCTURE(cgltf_texture_view, texture, texcoord, scale, has_transform, transform),
    STRUCTURE(cgltf_pbr_metallic_roughness, base_color_texture, metallic_roughness_texture,
              base_color_factor, metallic_factor, roughness_factor),
    STRUCTURE(cgltf_pbr_specular_glossiness, diffuse_texture, specular_glossiness_texture,
              diffuse_factor, specular_factor, glossiness_factor),
    STRUCTURE(cgltf_volume, thickness_texture, thickness_factor, attenuation_color,
              attenuation_distance),
    STRUCTURE(cgltf_transmission, transmission_texture, transmission_factor),
    STRUCTURE(cgltf_clearcoat, clearcoat_texture, clearcoat_roughness_texture,
              clearcoat_normal_texture, clearcoat_factor, clearcoat_roughness_factor),
    STRUCTURE(cgltf_specular, specular_texture, specular_color_texture, specular_color_factor,
              specular_factor),
    STRUCTURE(cgltf_sheen, sheen_color_texture, sheen_color_factor, sheen_roughness_texture,
              sheen_roughness_factor),
    STRUCTURE(cgltf_iridescence, iridescence_factor, iridescence_texture, iridescence_ior,
              iridescence_thickness_min, iridescence_thickness_max,
              iridescence_thickness_texture),
    STRUCTURE(cgltf_diffuse_transmission, diffuse_transmission_texture,
              diffuse_transmission_factor, diffuse_transmission_color_factor,
              diffuse_transmission_color_texture),
    STRUCTURE(cgltf_anisotropy, anisotropy_strength, anisotropy_rotation, anisotropy_texture),
    STRUCTURE(cgltf_material, name, has_pbr_metallic_roughness, has_pbr_specular_glossiness,
              has_clearcoat, has_transmission, has_volume, has_ior, has_specular, has_sheen,
              has_emissive_strength, has_iridescence, has_diffuse_transmission, has_anisotropy,
              has_dispersion, pbr_metallic_roughness, pbr_specular_glossiness, clearcoat, ior,
              specular, sheen, transmission, volume, emissive_strength, iridescence,
              diffuse_transmission, anisotropy, dispersion, normal_texture, occlusion_texture,
              emissive_texture, emissive_factor, alpha_mode, alpha_cutoff, double_sided, unlit,
              extras, extensions_count, extensions),
    STRUCTURE(cgltf_material_mapping, variant, material, extras),
    STRUCTURE(cgltf_material_variant, name, extras),
    STRUCTURE(cgltf_morph_target, attributes, attributes_count),
    STRUCTURE(cgltf_draco_mesh_compression, buffer_view, attributes, attributes_count),
    STRUCTURE(cgltf_primitive, type, indices, material, attributes, attributes_count, targets,
              targets_count, extras, has_draco_mesh_compression, draco_mesh_compression, mappings,
              mappings_count, extensions_count),
    STRUCTURE(cgltf_mesh, name, primitives, primitives_count, weights, weights_count,
              target_names, extras),
    STRUCTURE(cgltf_skin, name, joints, joints_count, skeleton, inverse_bind_matrices, extras),
    STRUCTURE(cgltf_camera_perspective, has_aspect_ratio, aspect_ratio, yfov, has_zfar, zfar,
              znear, extras),
    STRUCTURE(cgltf_camera_orthographic, xmag, ymag, zfar, extras),
    STRUCTURE(cgltf_camera, name, type, data, extras),
    STRUCTURE(cgltf_light, name, color, intensity, type, range, spot_inner_cone_angle,
              spot_outer_cone_angle, extras),
    STRUCTURE(cgltf_mesh_gpu_instancing, attributes, attributes_count),
    STRUCTURE(cgltf_node, name, parent, children, children_count, skin, mesh, camera, light,
              weights, weights_count, has_translation, has_rotation, has_scale, has_matrix,
              translation, rotation, scale, matrix, extras, has_mesh_gpu_instancing,
              mesh_gpu_instancing, extensions_count, extensions),
    STRUCTURE(cgltf_scene, name, nodes, nodes_count, extras, extensions_count, extensions),
    STRUCTURE(cgltf_asset, copyright, generator, version, min_version, extras),
    OFFSETS(cgltf_data, file_type, asset, meshes, meshes_count, materials, materials_count,
            accessors, accessors_count, buffer_views, buffer_views_count, buffers,
            buffers_count, images, images_count, textures, textures_count, samplers,
            samplers_count, skins, skins_count, cameras, cameras_count, lights, lights_count,
            nodes, nodes_count, scenes, scenes_count, scene, animations, variants, variants_count,
            extras, data_extensions_count, data_extensions, extensions_used,
            extensions_used_count, extensions_required, extensions_required_count),
};
const size_t rl_cgltf_layout_count = sizeof(rl_cgltf_layout) / sizeof(*rl_cgltf_layout);
