/* cgltf, and the one call through which it is used: cgltf_parse with our memory and our numbers.
 *
 * In: a JSON text that has passed our own check. Out: cgltf's data, owned by the memory behind the
 * hooks, never by cgltf_free. No file is opened here, and no accessor is read.
 */
#ifndef RL_CGLTF_SHIM_H
#define RL_CGLTF_SHIM_H

#include "cgltf.h"

/* What cgltf asks of its surroundings. */
typedef struct rl_cgltf_hooks {
    void *user;
    /* Memory of 16-byte alignment, for size 0 as well; NULL when the budget is exhausted. */
    void *(*allocate)(void *user, size_t size);
    void (*release)(void *user, void *memory);
    /* A whole number in 0 .. 2^53-1, or -1. */
    long long (*to_integer)(const char *text);
    /* A number rounded to float, or NaN. */
    float (*to_float)(const char *text);
} rl_cgltf_hooks;

/* Parses `size` bytes of JSON. cgltf_result_out_of_memory as soon as a hook returns NULL: cgltf
 * itself crashes then, so it is left by longjmp. */
cgltf_result rl_cgltf_parse(const rl_cgltf_hooks *hooks, const char *json, size_t size,
                            cgltf_data **data);

#endif
