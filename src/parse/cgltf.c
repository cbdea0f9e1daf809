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

/* In the order of cgltf.zig, whose test compares: of each structure its size and the offsets of its
 * fields, then the values of the enumerations. */
#define AT(field) offsetof(TYPE, field)
const unsigned short rl_cgltf_layout[] = {
#define TYPE cgltf_buffer
    sizeof(TYPE), AT(name), AT(size), AT(uri), AT(data), AT(extras),
#undef TYPE
#define TYPE cgltf_meshopt_compression
    sizeof(TYPE), AT(buffer), AT(mode),
#undef TYPE
#define TYPE cgltf_buffer_view
    sizeof(TYPE), AT(name), AT(buffer), AT(offset), AT(size), AT(stride), AT(type),
    AT(has_meshopt_compression), AT(meshopt_compression), AT(extras),
#undef TYPE
#define TYPE cgltf_accessor_sparse
    sizeof(TYPE), AT(count), AT(indices_buffer_view), AT(indices_byte_offset),
    AT(indices_component_type), AT(values_buffer_view), AT(values_byte_offset),
#undef TYPE
#define TYPE cgltf_accessor
    sizeof(TYPE), AT(name), AT(component_type), AT(normalized), AT(type), AT(offset), AT(count),
    AT(stride), AT(buffer_view), AT(has_min), AT(is_sparse), AT(sparse), AT(extras),
#undef TYPE
#define TYPE cgltf_attribute
    sizeof(TYPE), AT(name), AT(type), AT(index), AT(data),
#undef TYPE
#define TYPE cgltf_texture_view
    sizeof(TYPE), AT(texture), AT(texcoord),
#undef TYPE
#define TYPE cgltf_pbr_metallic_roughness
    sizeof(TYPE), AT(base_color_texture), AT(metallic_roughness_texture), AT(base_color_factor),
    AT(metallic_factor), AT(roughness_factor),
#undef TYPE
#define TYPE cgltf_pbr_specular_glossiness
    sizeof(TYPE), AT(diffuse_texture), AT(diffuse_factor), AT(specular_factor),
    AT(glossiness_factor),
#undef TYPE
#define TYPE cgltf_volume
    sizeof(TYPE), AT(thickness_texture), AT(thickness_factor), AT(attenuation_color),
    AT(attenuation_distance),
#undef TYPE
#define TYPE cgltf_clearcoat
    sizeof(TYPE), AT(clearcoat_texture), AT(clearcoat_factor),
#undef TYPE
#define TYPE cgltf_ior
    sizeof(TYPE), AT(ior),
#undef TYPE
#define TYPE cgltf_specular
    sizeof(TYPE), AT(specular_texture), AT(specular_color_factor),
#undef TYPE
#define TYPE cgltf_sheen
    sizeof(TYPE), AT(sheen_color_texture), AT(sheen_roughness_texture),
#undef TYPE
#define TYPE cgltf_transmission
    sizeof(TYPE), AT(transmission_texture), AT(transmission_factor),
#undef TYPE
#define TYPE cgltf_emissive_strength
    sizeof(TYPE), AT(emissive_strength),
#undef TYPE
#define TYPE cgltf_iridescence
    sizeof(TYPE), AT(iridescence_factor), AT(iridescence_texture),
    AT(iridescence_thickness_texture),
#undef TYPE
#define TYPE cgltf_diffuse_transmission
    sizeof(TYPE), AT(diffuse_transmission_texture), AT(diffuse_transmission_factor),
    AT(diffuse_transmission_color_texture),
#undef TYPE
#define TYPE cgltf_anisotropy
    sizeof(TYPE), AT(anisotropy_strength), AT(anisotropy_texture),
#undef TYPE
#define TYPE cgltf_material
    sizeof(TYPE), AT(name), AT(has_pbr_metallic_roughness), AT(has_pbr_specular_glossiness),
    AT(has_clearcoat), AT(has_transmission), AT(has_volume), AT(has_ior), AT(has_specular),
    AT(has_emissive_strength), AT(has_iridescence), AT(pbr_metallic_roughness),
    AT(pbr_specular_glossiness), AT(clearcoat), AT(ior), AT(specular), AT(sheen),
    AT(transmission), AT(volume), AT(emissive_strength), AT(iridescence),
    AT(diffuse_transmission), AT(anisotropy), AT(dispersion), AT(normal_texture),
    AT(emissive_texture), AT(emissive_factor), AT(alpha_mode), AT(alpha_cutoff), AT(double_sided),
    AT(unlit), AT(extras),
#undef TYPE
#define TYPE cgltf_morph_target
    sizeof(TYPE), AT(attributes), AT(attributes_count),
#undef TYPE
#define TYPE cgltf_primitive
    sizeof(TYPE), AT(type), AT(indices), AT(material), AT(attributes), AT(attributes_count),
    AT(targets), AT(targets_count), AT(extras), AT(has_draco_mesh_compression),
    AT(draco_mesh_compression),
#undef TYPE
#define TYPE cgltf_mesh
    sizeof(TYPE), AT(name), AT(primitives), AT(primitives_count), AT(weights), AT(weights_count),
    AT(target_names), AT(extras),
#undef TYPE
#define TYPE cgltf_skin
    sizeof(TYPE), AT(name), AT(joints), AT(joints_count), AT(skeleton), AT(inverse_bind_matrices),
    AT(extras),
#undef TYPE
#define TYPE cgltf_camera_perspective
    sizeof(TYPE), AT(has_aspect_ratio), AT(aspect_ratio), AT(yfov), AT(has_zfar), AT(zfar),
    AT(znear), AT(extras),
#undef TYPE
#define TYPE cgltf_camera_orthographic
    sizeof(TYPE), AT(xmag), AT(ymag), AT(zfar), AT(extras),
#undef TYPE
#define TYPE cgltf_camera
    sizeof(TYPE), AT(name), AT(type), AT(data), AT(extras),
#undef TYPE
#define TYPE cgltf_light
    sizeof(TYPE), AT(name), AT(color), AT(intensity), AT(type), AT(range),
    AT(spot_inner_cone_angle), AT(spot_outer_cone_angle), AT(extras),
#undef TYPE
#define TYPE cgltf_node
    sizeof(TYPE), AT(name), AT(parent), AT(children), AT(children_count), AT(skin), AT(mesh),
    AT(camera), AT(light), AT(weights), AT(weights_count), AT(has_translation), AT(has_rotation),
    AT(has_scale), AT(has_matrix), AT(translation), AT(rotation), AT(scale), AT(matrix),
    AT(extras), AT(has_mesh_gpu_instancing), AT(mesh_gpu_instancing),
#undef TYPE
#define TYPE cgltf_scene
    sizeof(TYPE), AT(name), AT(nodes), AT(nodes_count), AT(extras),
#undef TYPE
#define TYPE cgltf_asset
    sizeof(TYPE), AT(copyright), AT(version), AT(min_version), AT(extras),
#undef TYPE
#define TYPE cgltf_data
    AT(file_type), AT(asset), AT(meshes), AT(meshes_count), AT(materials), AT(materials_count),
    AT(accessors), AT(accessors_count), AT(buffer_views), AT(buffer_views_count), AT(buffers),
    AT(buffers_count), AT(images), AT(textures_count), AT(samplers), AT(skins), AT(skins_count),
    AT(cameras), AT(cameras_count), AT(lights), AT(lights_count), AT(nodes), AT(nodes_count),
    AT(scenes), AT(scenes_count), AT(scene), AT(animations), AT(animations_count), AT(variants),
    AT(extensions_used), AT(extensions_used_count), AT(extensions_required),
    AT(extensions_required_count),
#undef TYPE
    cgltf_result_success, cgltf_result_legacy_gltf, cgltf_attribute_type_invalid,
    cgltf_attribute_type_position, cgltf_attribute_type_normal, cgltf_attribute_type_tangent,
    cgltf_attribute_type_texcoord, cgltf_attribute_type_color, cgltf_attribute_type_joints,
    cgltf_attribute_type_weights, cgltf_component_type_r_8, cgltf_component_type_r_8u,
    cgltf_component_type_r_16, cgltf_component_type_r_16u, cgltf_component_type_r_32u,
    cgltf_component_type_r_32f, cgltf_type_scalar, cgltf_type_vec2, cgltf_type_vec3,
    cgltf_type_vec4, cgltf_type_mat2, cgltf_type_mat3, cgltf_type_mat4,
    cgltf_primitive_type_invalid, cgltf_primitive_type_triangles,
    cgltf_primitive_type_triangle_strip, cgltf_primitive_type_triangle_fan, cgltf_alpha_mode_mask,
    cgltf_alpha_mode_blend, cgltf_camera_type_perspective, cgltf_camera_type_orthographic,
    cgltf_light_type_directional, cgltf_light_type_point, cgltf_light_type_spot,
};
const size_t rl_cgltf_layout_count = sizeof(rl_cgltf_layout) / sizeof(*rl_cgltf_layout);
