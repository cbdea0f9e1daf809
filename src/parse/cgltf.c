/* cgltf's implementation, compiled with our numbers, and the shim that calls it.
 *
 * The numbers go through hooks because atoi and atof depend on the locale and take what is not a
 * number for 0. The hooks are thread-local: cgltf's macros have no place for a context.
 */
#include "cgltf_shim.h"

#include <limits.h>
#include <setjmp.h>

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
