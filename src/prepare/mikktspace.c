/* MikkTSpace's implementation, over our memory and our arc cosine, and the call that we make.
 *
 * In: triangles of finite numbers, within the limits of mikktspace.zig. Out: a tangent for each of
 * their corners. Its assertions and memory that runs out leave it by longjmp; what it holds then is
 * freed with the heap behind the hooks. The call in progress is thread-local, for it allocates
 * without a context.
 */
#include <assert.h>
#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../memory_account.h"

/* In the order of mikktspace.zig. */
typedef struct rl_mikktspace_mesh {
    const uint32_t (*triangles)[3];
    const float (*positions)[3], (*normals)[3], (*texcoords)[2];
    int triangle_count;
    float (*tangents)[3][4];
    double (*arc_cosine)(double);
} rl_mikktspace_mesh;

typedef struct rl_call {
    const rl_memory *memory;
    const rl_mikktspace_mesh *mesh;
    jmp_buf left;
} rl_call;

enum { rl_done, rl_exhausted, rl_broken };

static _Thread_local rl_call *rl_now;

static void *rl_allocate(size_t size) {
    void *memory = rl_now->memory->allocate(rl_now->memory->user, size);
    if (memory == NULL) longjmp(rl_now->left, rl_exhausted);
    return memory;
}

static void rl_release(void *memory) {
    rl_now->memory->release(rl_now->memory->user, memory);
}

static _Noreturn void rl_fail(void) {
    longjmp(rl_now->left, rl_broken);
}

static double rl_arc_cosine(double cosine) {
    return rl_now->mesh->arc_cosine(cosine);
}

#undef assert
#define __assert_fail(text, file, line, function) rl_fail()
#define malloc(size) rl_allocate(size)
#define free(memory) rl_release(memory)
#define acos(cosine) rl_arc_cosine(cosine)
/* Of the one angle that the default has, 180 degrees. */
#define cos(angle) (-1.0)
#include "mikktspace/mikktspace.c"

static const rl_mikktspace_mesh *rl_mesh(const SMikkTSpaceContext *context) {
    return context->m_pUserData;
}

static int rl_face_count(const SMikkTSpaceContext *context) {
    return rl_mesh(context)->triangle_count;
}

static int rl_vertex_count(const SMikkTSpaceContext *context, const int face) {
    (void)context, (void)face;
    return 3;
}

static void rl_position(const SMikkTSpaceContext *context, float out[], int face, int corner) {
    const rl_mikktspace_mesh *mesh = rl_mesh(context);
    memcpy(out, mesh->positions[mesh->triangles[face][corner]], sizeof(*mesh->positions));
}

static void rl_normal(const SMikkTSpaceContext *context, float out[], int face, int corner) {
    const rl_mikktspace_mesh *mesh = rl_mesh(context);
    memcpy(out, mesh->normals[mesh->triangles[face][corner]], sizeof(*mesh->normals));
}

static void rl_texcoord(const SMikkTSpaceContext *context, float out[], int face, int corner) {
    const rl_mikktspace_mesh *mesh = rl_mesh(context);
    memcpy(out, mesh->texcoords[mesh->triangles[face][corner]], sizeof(*mesh->texcoords));
}

static void rl_tangent(const SMikkTSpaceContext *context, const float tangent[], float sign,
                       int face, int corner) {
    float *out = rl_mesh(context)->tangents[face][corner];
    memcpy(out, tangent, 3 * sizeof(*out));
    out[3] = sign;
}

/* rl_done, rl_exhausted, or rl_broken where an assertion fails. */
int rl_mikktspace(const rl_memory *memory, const rl_mikktspace_mesh *mesh) {
    SMikkTSpaceInterface interface = {
        .m_getNumFaces = rl_face_count,
        .m_getNumVerticesOfFace = rl_vertex_count,
        .m_getPosition = rl_position,
        .m_getNormal = rl_normal,
        .m_getTexCoord = rl_texcoord,
        .m_setTSpaceBasic = rl_tangent,
    };
    const SMikkTSpaceContext context = {.m_pInterface = &interface, .m_pUserData = (void *)mesh};
    rl_call call = {.memory = memory, .mesh = mesh};
    rl_now = &call;
    const int left = setjmp(call.left);
    if (left != 0) return left;
    return genTangSpaceDefault(&context) ? rl_done : rl_broken;
}
