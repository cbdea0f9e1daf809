// Embree 3 on the workload of bench/rays: the same triangles, the same rays, the same shading.
//
// In: a file that `rays --dump` wrote (bench/rays/dump.zig has its format). Out: one JSON object
// with the keys of `rays --json` as far as they apply; a run is a mode, one of Embree's ways to
// trace: single rays, packets of 4, 8 or 16, or streams of a whole tile. "coherent" modes set
// Embree's flag for primary rays and their shadows, "coherent-all" for bounces too. Usage:
//
//   embree FILE [--mode NAME]... [--depth N] [--reps N] [--config EMBREE_OPTIONS] [--robust]
//          [--count]
//
// --count marks phases as `rays` does. The workload is that of bench/rays/workload.zig, line by
// line. For clang (`zig cc`), whose loops and vectors it uses.

#define _GNU_SOURCE
#include <embree3/rtcore.h>
#include <math.h>
#include <sched.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>
#ifdef __x86_64__
#include <immintrin.h>
#endif

enum { LARGE_PAGE = 2 << 20 };
enum { SIDE = 16, RAY_COUNT = SIDE * SIDE, NONE = -1, REPETITIONS_MAX = 1000, TAGS_PER_RUN = 16 };
static const float shadow_end = 0.9999f;
static const float shadow_share = 0.1f;
static const float bounce_weight = 0.3f;

static void fail(const char *subject, const char *what)
{
    fprintf(stderr, "embree: %s: %s\n", subject, what);
    exit(1);
}

static void *allocate(size_t size)
{
    void *memory = NULL;
    // On large pages, as ours is.
    bool large = size >= LARGE_PAGE;
    if (posix_memalign(&memory, large ? LARGE_PAGE : 64, size) != 0) fail("memory", "none left");
    if (large) madvise(memory, size / LARGE_PAGE * LARGE_PAGE, MADV_HUGEPAGE);
    memset(memory, 0, size);
    return memory;
}

// ---- The file.

struct setup {
    uint32_t triangle_count, size;
    float eye[3], corner[3], across[3], down[3], light[3], offset;
};

static struct setup setup;
static float *corners;        // [triangle][corner][axis]
static float (*normals)[4];   // [triangle + 1]
static float spread[3][RAY_COUNT];
static size_t square_offset[RAY_COUNT / 4]; // Of four pixels, within the picture.

static void place(int index, int *column, int *row)
{
    *column = *row = 0;
    for (int bit = 0; bit < 4; bit++) {
        *column |= (index >> 2 * bit & 1) << bit;
        *row |= (index >> (2 * bit + 1) & 1) << bit;
    }
}

static void read_file(const char *path)
{
    FILE *file = fopen(path, "rb");
    if (file == NULL) fail(path, "cannot be opened");
    char magic[8];
    bool good = fread(magic, 8, 1, file) == 1 && memcmp(magic, "RAYLANE1", 8) == 0 &&
        fread(&setup, sizeof setup, 1, file) == 1;
    if (!good) fail(path, "is no dump of rays");
    size_t count = setup.triangle_count;
    corners = allocate(count * 9 * sizeof(float) + 16);
    normals = allocate((count + 1) * sizeof *normals);
    good = fread(corners, 9 * sizeof(float), count, file) == count &&
        fread(normals + 1, sizeof *normals, count, file) == count;
    if (!good) fail(path, "is cut off");
    fclose(file);
    for (int index = 0; index < RAY_COUNT; index++) {
        int column, row;
        place(index, &column, &row);
        square_offset[index / 4] = (size_t)(row & ~1) * setup.size + (column & ~1);
        for (int axis = 0; axis < 3; axis++) {
            spread[axis][index] = setup.across[axis] * column + setup.down[axis] * row;
        }
    }
}

// ---- Phases, as in bench/rays/phases.zig.

enum phase { OTHER, GENERATION, PRIMARY, SHADING, SHADOW, BOUNCE, BOUNCE_SHADOW, BOUNCE_SHADING,
             BUILD, PHASE_COUNT };
static const char *const phase_names[] = { "other", "generation", "primary", "shading", "shadow",
                                           "bounce", "bounce_shadow", "bounce_shading" };

static bool counting;
static long first_tag;
static enum phase phase_now;
static uint64_t ticks_at_mark;
static uint64_t ticks_by_phase[PHASE_COUNT];

static uint64_t now_ns(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return time.tv_sec * 1000000000ull + time.tv_nsec;
}

static uint64_t ticks(void)
{
#ifdef __x86_64__
    return __rdtsc();
#else
    return now_ns();
#endif
}

static void mark(enum phase phase)
{
    if (counting) {
        syscall(9999, phase == OTHER ? 0 : first_tag + phase);
        return;
    }
    uint64_t now = ticks();
    ticks_by_phase[phase_now] += now - ticks_at_mark;
    ticks_at_mark = now;
    phase_now = phase;
}

// ---- Rays, as in bench/rays/batch.zig.

struct batch {
    float origin[3][RAY_COUNT], direction[3][RAY_COUNT], t[RAY_COUNT];
    int32_t primitive[RAY_COUNT];
    int32_t active[RAY_COUNT];
} __attribute__((aligned(64)));

static struct batch rays, shadows;
static float normal[3][RAY_COUNT] __attribute__((aligned(64)));
static float brightness[RAY_COUNT] __attribute__((aligned(64)));
static float color[RAY_COUNT] __attribute__((aligned(64)));

// ---- Embree.

enum coherence { INCOHERENT, COHERENT_FIRST, COHERENT_ALL };

struct mode {
    const char *name;
    int width; // Of a packet; 1: single rays, RAY_COUNT: a stream.
    enum coherence coherence;
};

static const struct mode modes[] = {
    { "single", 1, INCOHERENT },
    { "packet4", 4, INCOHERENT },
    { "packet4-coherent", 4, COHERENT_FIRST },
    { "packet4-coherent-all", 4, COHERENT_ALL },
    { "packet8", 8, INCOHERENT },
    { "packet8-coherent", 8, COHERENT_FIRST },
    { "packet8-coherent-all", 8, COHERENT_ALL },
    { "packet16", 16, INCOHERENT },
    { "packet16-coherent", 16, COHERENT_FIRST },
    { "packet16-coherent-all", 16, COHERENT_ALL },
    { "stream", RAY_COUNT, INCOHERENT },
    { "stream-coherent", RAY_COUNT, COHERENT_FIRST },
};
enum { MODE_COUNT = sizeof modes / sizeof modes[0] };

static RTCDevice device;
static RTCScene scene;
static const struct mode *mode;
static struct RTCIntersectContext context;

// Words of a packet of any width, one array each, as RTCRayHit4, 8 and 16 have them.
enum word { ORIGIN = 0, NEAR = 3, DIRECTION = 4, TIME = 7, FAR = 8, MASK = 9, ID = 10, FLAGS = 11,
            PRIMITIVE = 17, GEOMETRY = 18, INSTANCE = 19, WORD_COUNT = 20 };
_Static_assert(sizeof(struct RTCRayHit8) == WORD_COUNT * 8 * 4, "layout of packets");
_Static_assert(offsetof(struct RTCRay8, tfar) == FAR * 8 * 4, "layout of packets");
_Static_assert(offsetof(struct RTCRay8, flags) == FLAGS * 8 * 4, "layout of packets");
_Static_assert(offsetof(struct RTCRayHit8, hit.primID) == PRIMITIVE * 8 * 4, "layout of packets");

union packet {
    float f[WORD_COUNT * 16];
    uint32_t u[WORD_COUNT * 16];
    struct RTCRayHit4 hit4;
    struct RTCRay4 ray4;
    struct RTCRayHit8 hit8;
    struct RTCRay8 ray8;
    struct RTCRayHit16 hit16;
    struct RTCRay16 ray16;
} __attribute__((aligned(64)));

static inline bool any_active(const struct batch *batch, int at, int width)
{
    int32_t any = 0;
    for (int lane = 0; lane < width; lane++) any |= batch->active[at + lane];
    return any != 0;
}

static inline void load(union packet *packet, const struct batch *batch, int at, int width)
{
    for (int axis = 0; axis < 3; axis++) {
        memcpy(packet->f + (ORIGIN + axis) * width, batch->origin[axis] + at, width * 4);
        memcpy(packet->f + (DIRECTION + axis) * width, batch->direction[axis] + at, width * 4);
    }
    memcpy(packet->f + FAR * width, batch->t + at, width * 4);
    for (int lane = 0; lane < width; lane++) {
        packet->f[NEAR * width + lane] = 0;
        packet->f[TIME * width + lane] = 0;
        packet->u[MASK * width + lane] = ~0u;
        packet->u[ID * width + lane] = 0;
        packet->u[FLAGS * width + lane] = 0;
    }
}

static inline void intersect_packets(struct batch *batch, int width)
{
    union packet packet;
    for (int at = 0; at < RAY_COUNT; at += width) {
        if (!any_active(batch, at, width)) continue;
        load(&packet, batch, at, width);
        for (int lane = 0; lane < width; lane++) {
            packet.u[GEOMETRY * width + lane] = RTC_INVALID_GEOMETRY_ID;
            packet.u[PRIMITIVE * width + lane] = RTC_INVALID_GEOMETRY_ID;
            packet.u[INSTANCE * width + lane] = RTC_INVALID_GEOMETRY_ID;
        }
        const int *valid = batch->active + at;
        if (width == 4) rtcIntersect4(valid, scene, &context, &packet.hit4);
        if (width == 8) rtcIntersect8(valid, scene, &context, &packet.hit8);
        if (width == 16) rtcIntersect16(valid, scene, &context, &packet.hit16);
        memcpy(batch->t + at, packet.f + FAR * width, width * 4);
        memcpy(batch->primitive + at, packet.u + PRIMITIVE * width, width * 4);
    }
}

static inline void occlude_packets(struct batch *batch, int width)
{
    union packet packet;
    for (int at = 0; at < RAY_COUNT; at += width) {
        if (!any_active(batch, at, width)) continue;
        load(&packet, batch, at, width);
        const int *valid = batch->active + at;
        if (width == 4) rtcOccluded4(valid, scene, &context, &packet.ray4);
        if (width == 8) rtcOccluded8(valid, scene, &context, &packet.ray8);
        if (width == 16) rtcOccluded16(valid, scene, &context, &packet.ray16);
        for (int lane = 0; lane < width; lane++) {
            batch->primitive[at + lane] = packet.f[FAR * width + lane] < 0 ? 0 : NONE;
        }
    }
}

static inline struct RTCRay single_ray(const struct batch *batch, int at)
{
    return (struct RTCRay){
        .org_x = batch->origin[0][at], .org_y = batch->origin[1][at], .org_z = batch->origin[2][at],
        .dir_x = batch->direction[0][at], .dir_y = batch->direction[1][at],
        .dir_z = batch->direction[2][at], .tfar = batch->t[at], .mask = ~0u,
    };
}

static void intersect_singles(struct batch *batch)
{
    for (int at = 0; at < RAY_COUNT; at++) {
        if (!batch->active[at]) continue;
        struct RTCRayHit ray;
        ray.ray = single_ray(batch, at);
        ray.hit.geomID = ray.hit.primID = ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect1(scene, &context, &ray);
        batch->t[at] = ray.ray.tfar;
        batch->primitive[at] = (int32_t)ray.hit.primID;
    }
}

static void occlude_singles(struct batch *batch)
{
    for (int at = 0; at < RAY_COUNT; at++) {
        if (!batch->active[at]) continue;
        struct RTCRay ray = single_ray(batch, at);
        rtcOccluded1(scene, &context, &ray);
        batch->primitive[at] = ray.tfar < 0 ? 0 : NONE;
    }
}

// The parts of a stream that are not in the batch.
static struct {
    float near[RAY_COUNT], far[RAY_COUNT], time[RAY_COUNT], normal[3][RAY_COUNT];
    float u[RAY_COUNT], v[RAY_COUNT];
    uint32_t mask[RAY_COUNT], id[RAY_COUNT], flags[RAY_COUNT];
    uint32_t geometry[RAY_COUNT], instance[RAY_COUNT];
} stream __attribute__((aligned(64)));

static struct RTCRayNp stream_rays(struct batch *batch)
{
    for (int at = 0; at < RAY_COUNT; at++) {
        stream.near[at] = batch->active[at] ? 0 : INFINITY;
        stream.far[at] = batch->active[at] ? batch->t[at] : -INFINITY;
        stream.mask[at] = ~0u;
    }
    return (struct RTCRayNp){
        .org_x = batch->origin[0], .org_y = batch->origin[1], .org_z = batch->origin[2],
        .dir_x = batch->direction[0], .dir_y = batch->direction[1], .dir_z = batch->direction[2],
        .tnear = stream.near, .tfar = stream.far, .time = stream.time, .mask = stream.mask,
        .id = stream.id, .flags = stream.flags,
    };
}

static void intersect_stream(struct batch *batch)
{
    struct RTCRayHitNp hits = { .ray = stream_rays(batch), .hit = {
        .Ng_x = stream.normal[0], .Ng_y = stream.normal[1], .Ng_z = stream.normal[2],
        .u = stream.u, .v = stream.v, .primID = (unsigned *)batch->primitive,
        .geomID = stream.geometry, .instID = { stream.instance },
    } };
    for (int at = 0; at < RAY_COUNT; at++) {
        stream.geometry[at] = stream.instance[at] = RTC_INVALID_GEOMETRY_ID;
        batch->primitive[at] = NONE;
    }
    rtcIntersectNp(scene, &context, &hits, RAY_COUNT);
    memcpy(batch->t, stream.far, sizeof batch->t);
}

static void occlude_stream(struct batch *batch)
{
    struct RTCRayNp all = stream_rays(batch);
    rtcOccludedNp(scene, &context, &all, RAY_COUNT);
    for (int at = 0; at < RAY_COUNT; at++) {
        batch->primitive[at] = batch->active[at] && stream.far[at] < 0 ? 0 : NONE;
    }
}

static void set_coherence(bool first)
{
    bool coherent = mode->coherence == COHERENT_ALL || (mode->coherence == COHERENT_FIRST && first);
    rtcInitIntersectContext(&context);
    context.flags = coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT
                             : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
}

static void intersect(struct batch *batch, bool first)
{
    set_coherence(first);
    switch (mode->width) {
    case 1: intersect_singles(batch); break;
    case 4: intersect_packets(batch, 4); break;
    case 8: intersect_packets(batch, 8); break;
    case 16: intersect_packets(batch, 16); break;
    default: intersect_stream(batch);
    }
}

static void occlude(struct batch *batch, bool first)
{
    set_coherence(first);
    switch (mode->width) {
    case 1: occlude_singles(batch); break;
    case 4: occlude_packets(batch, 4); break;
    case 8: occlude_packets(batch, 8); break;
    case 16: occlude_packets(batch, 16); break;
    default: occlude_stream(batch);
    }
}

// ---- What comes out, as in bench/rays/observer.zig.

struct counts {
    uint64_t hits, occluded, reflections, reflection_hits, reflection_occluded;
    double t_sum;
};

static struct counts *observer; // NULL while times are taken; what it does is not counted.

static bool is_hit(const struct batch *batch, int at)
{
    return batch->active[at] != 0 && batch->primitive[at] != NONE;
}

static uint64_t hit_count(const struct batch *batch)
{
    uint64_t count = 0;
    for (int at = 0; at < RAY_COUNT; at++) count += is_hit(batch, at);
    return count;
}

static void observe_hits(bool first)
{
    if (observer == NULL) return;
    mark(OTHER);
    *(first ? &observer->hits : &observer->reflection_hits) += hit_count(&rays);
    for (int at = 0; at < RAY_COUNT; at++) {
        if (!first) observer->reflections += rays.active[at] != 0;
        if (first && is_hit(&rays, at)) observer->t_sum += rays.t[at];
    }
}

static void observe_shadows(bool first)
{
    if (observer == NULL) return;
    mark(OTHER);
    *(first ? &observer->occluded : &observer->reflection_occluded) += hit_count(&shadows);
}

// ---- The workload, as in bench/rays/workload.zig.

// The compiler's estimate would leave these loops to one pixel at a time: 4 times the instructions.
#define IN_LANES _Pragma("clang loop vectorize(assume_safety) interleave(disable)")

static int depth_max;
static float *pixels;

static void generate(int x, int y)
{
    for (int axis = 0; axis < 3; axis++) {
        float start = setup.corner[axis] + (setup.across[axis] * x + setup.down[axis] * y);
        float eye = setup.eye[axis];
        for (int at = 0; at < RAY_COUNT; at++) {
            rays.direction[axis][at] = start + spread[axis][at];
            rays.origin[axis][at] = eye;
        }
    }
    for (int at = 0; at < RAY_COUNT; at++) {
        rays.t[at] = INFINITY;
        rays.active[at] = -1;
    }
}

typedef float four __attribute__((vector_size(16)));

static void gather_normals(void)
{
    for (int at = 0; at < RAY_COUNT; at += 4) {
        four row[4];
        for (int lane = 0; lane < 4; lane++) {
            row[lane] = *(const four *)normals[rays.primitive[at + lane] + 1];
        }
        four xy_low = __builtin_shufflevector(row[0], row[1], 0, 4, 1, 5);
        four xy_high = __builtin_shufflevector(row[2], row[3], 0, 4, 1, 5);
        four z_low = __builtin_shufflevector(row[0], row[1], 2, 6, 3, 7);
        four z_high = __builtin_shufflevector(row[2], row[3], 2, 6, 3, 7);
        *(four *)(normal[0] + at) = __builtin_shufflevector(xy_low, xy_high, 0, 1, 4, 5);
        *(four *)(normal[1] + at) = __builtin_shufflevector(xy_low, xy_high, 2, 3, 6, 7);
        *(four *)(normal[2] + at) = __builtin_shufflevector(z_low, z_high, 0, 1, 4, 5);
    }
}

static inline float dot(float ax, float ay, float az, float bx, float by, float bz)
{
    return (ax * bx + ay * by) + az * bz;
}

static inline int shade(const bool first, const bool last)
{
    gather_normals();
    const float lx = setup.light[0], ly = setup.light[1], lz = setup.light[2];
    const float offset = setup.offset;
    int any = 0;
    IN_LANES
    for (int at = 0; at < RAY_COUNT; at++) {
        float dx = rays.direction[0][at], dy = rays.direction[1][at], dz = rays.direction[2][at];
        int hit = rays.active[at] & ~(rays.primitive[at] >> 31);
        any |= hit;
        float t = rays.t[at];
        t = hit ? t : 0;
        float nx = normal[0][at], ny = normal[1][at], nz = normal[2][at];
        float sign = copysignf(1, -dot(nx, ny, nz, dx, dy, dz));
        nx *= sign, ny *= sign, nz *= sign;
        float px = rays.origin[0][at] + dx * t + nx * offset;
        float py = rays.origin[1][at] + dy * t + ny * offset;
        float pz = rays.origin[2][at] + dz * t + nz * offset;
        float fx = px - lx, fy = py - ly, fz = pz - lz;
        float cosine = -dot(nx, ny, nz, fx, fy, fz);
        float full = (cosine > 0 ? cosine : 0) / sqrtf(dot(fx, fy, fz, fx, fy, fz));
        full = first ? full : full * bounce_weight;
        brightness[at] = hit ? full : 0;
        shadows.direction[0][at] = fx;
        shadows.direction[1][at] = fy;
        shadows.direction[2][at] = fz;
        shadows.active[at] = hit;
        if (last) continue;
        float along = dot(nx, ny, nz, dx, dy, dz) * 2;
        rays.origin[0][at] = px;
        rays.origin[1][at] = py;
        rays.origin[2][at] = pz;
        rays.direction[0][at] = dx - nx * along;
        rays.direction[1][at] = dy - ny * along;
        rays.direction[2][at] = dz - nz * along;
        rays.t[at] = INFINITY;
        rays.active[at] = hit;
    }
    return any;
}

static inline void add_light(const bool first)
{
    IN_LANES
    for (int at = 0; at < RAY_COUNT; at++) {
        float added = brightness[at] * (shadows.primitive[at] < 0 ? 1 : shadow_share);
        color[at] = first ? added : color[at] + added;
    }
}

static bool illuminate(const bool first, bool last)
{
    int any = last ? shade(first, true) : shade(first, false);
    if (!any) return false;
    mark(first ? SHADOW : BOUNCE_SHADOW);
    occlude(&shadows, first);
    observe_shadows(first);
    mark(first ? SHADING : BOUNCE_SHADING);
    add_light(first);
    return true;
}

static void write_pixels(int x, int y)
{
    float *first = pixels + (size_t)y * setup.size + x;
    for (int index = 0; index < RAY_COUNT; index += 4) {
        float *upper = first + square_offset[index / 4];
        memcpy(upper, color + index, 2 * sizeof(float));
        memcpy(upper + setup.size, color + index + 2, 2 * sizeof(float));
    }
}

static void render_tile(int x, int y)
{
    mark(GENERATION);
    generate(x, y);
    mark(PRIMARY);
    // As in bench/rays/workload.zig.
    for (int row = 0; row < SIDE; row++) {
        __builtin_prefetch(pixels + (size_t)(y + row) * setup.size + x, 1);
    }
    intersect(&rays, true);
    observe_hits(true);
    mark(SHADING);
    if (!illuminate(true, depth_max == 0)) {
        memset(color, 0, sizeof color);
    } else {
        for (int depth = 1; depth <= depth_max; depth++) {
            mark(BOUNCE);
            intersect(&rays, false);
            observe_hits(false);
            mark(BOUNCE_SHADING);
            if (!illuminate(false, depth == depth_max)) break;
        }
    }
    mark(SHADING);
    write_pixels(x, y);
    mark(OTHER);
}

static void render(void)
{
    for (int axis = 0; axis < 3; axis++) {
        for (int at = 0; at < RAY_COUNT; at++) shadows.origin[axis][at] = setup.light[axis];
    }
    for (int at = 0; at < RAY_COUNT; at++) shadows.t[at] = shadow_end;
    uint32_t columns = setup.size / SIDE, square = 1;
    while (square < columns) square *= 2;
    for (uint32_t index = 0; index < square * square; index++) {
        uint32_t column = 0, row = 0;
        for (int bit = 0; bit < 16; bit++) {
            column |= (index >> 2 * bit & 1) << bit;
            row |= (index >> (2 * bit + 1) & 1) << bit;
        }
        if (column < columns && row < columns) render_tile(column * SIDE, row * SIDE);
    }
}

// ---- Measuring.

struct spread_of { double min, median; };

static int ascending(const void *a, const void *b)
{
    double one = *(const double *)a, other = *(const double *)b;
    return one < other ? -1 : one > other;
}

static struct spread_of spread_of(double *values, int count)
{
    qsort(values, count, sizeof *values, ascending);
    return (struct spread_of){ values[0], values[count / 2] };
}

static void print_time(const char *key, double *values, int count)
{
    if (counting) {
        printf("\"%s\": null", key);
        return;
    }
    struct spread_of spread = spread_of(values, count);
    printf("\"%s\": {\"min\": %.6f, \"median\": %.6f}", key, spread.min, spread.median);
}

static int64_t device_bytes;

static bool on_memory(void *unused, ssize_t bytes, bool after)
{
    (void)unused, (void)after;
    device_bytes += bytes;
    return true;
}

// The buffers of the geometry are shared, so that only the tree is built, and counted.
static double build(unsigned (*indices)[3], bool robust)
{
    if (scene != NULL) rtcReleaseScene(scene);
    scene = rtcNewScene(device);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_MEDIUM);
    rtcSetSceneFlags(scene, robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    size_t count = setup.triangle_count;
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, corners, 0,
                               12, 3 * count);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, indices, 0,
                               12, count);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
    device_bytes = 0;
    uint64_t start = now_ns();
    if (counting) syscall(9999, BUILD);
    rtcCommitScene(scene);
    if (counting) syscall(9999, OTHER);
    return (now_ns() - start) * 1e-6;
}

static void build_all(int repetitions, bool robust)
{
    unsigned (*indices)[3] = allocate(setup.triangle_count * sizeof *indices + 16);
    for (unsigned index = 0; index < 3 * setup.triangle_count; index++) {
        indices[index / 3][index % 3] = index;
    }
    static double times_ms[REPETITIONS_MAX];
    for (int index = 0; index < repetitions; index++) times_ms[index] = build(indices, robust);
    if (rtcGetDeviceError(device) != RTC_ERROR_NONE) fail("scene", "was not built");
    bool wide = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED);
    printf("\"builds\": [{\"lanes\": %d, \"first_tag\": 0, ", wide ? 8 : 4);
    print_time("time_ms", times_ms, repetitions);
    printf(", \"bytes_per_triangle\": %.1f}]", (double)device_bytes / setup.triangle_count);
}

struct result {
    struct counts counts;
    double frame_ms[REPETITIONS_MAX];
    double phase_ms[PHASE_COUNT][REPETITIONS_MAX];
};

static void measure(struct result *result, int repetition)
{
    memset(ticks_by_phase, 0, sizeof ticks_by_phase);
    uint64_t start = now_ns(), start_ticks = ticks();
    ticks_at_mark = start_ticks;
    phase_now = OTHER;
    render();
    double ticks_spent = ticks() - start_ticks;
    double time_ms = (now_ns() - start) * 1e-6;
    result->frame_ms[repetition] = time_ms;
    for (int phase = 0; phase < PHASE_COUNT; phase++) {
        result->phase_ms[phase][repetition] = ticks_by_phase[phase] * time_ms / ticks_spent;
    }
}

static uint64_t ray_count(enum phase phase, const struct counts *counts)
{
    switch (phase) {
    case GENERATION: case PRIMARY: case SHADING: return (uint64_t)setup.size * setup.size;
    case SHADOW: return counts->hits;
    case BOUNCE: case BOUNCE_SHADING: return counts->reflections;
    case BOUNCE_SHADOW: return counts->reflection_hits;
    default: return 0;
    }
}

static void print_run(const char *name, int position, struct result *result, int repetitions)
{
    printf("%s\n {\"name\": \"%s\", \"first_tag\": %d, ", position > 0 ? "," : "", name,
           position * TAGS_PER_RUN);
    print_time("frame_ms", result->frame_ms, repetitions);
    for (int phase = GENERATION; phase <= BOUNCE_SHADING; phase++) {
        printf(",\n  \"%s\": {\"rays\": %llu, ", phase_names[phase],
               (unsigned long long)ray_count(phase, &result->counts));
        print_time("time_ms", result->phase_ms[phase], repetitions);
        printf("}");
    }
    const struct counts *counts = &result->counts;
    printf(",\n  \"hits\": %llu, \"occluded\": %llu, \"t_sum\": %.6f, \"reflections\": %llu, "
           "\"reflection_hits\": %llu, \"reflection_occluded\": %llu, \"hash\": \"\"}",
           (unsigned long long)counts->hits, (unsigned long long)counts->occluded, counts->t_sum,
           (unsigned long long)counts->reflections, (unsigned long long)counts->reflection_hits,
           (unsigned long long)counts->reflection_occluded);
}

static void run_all(const struct mode *const *chosen, int chosen_count, int repetitions)
{
    struct result *results = allocate(chosen_count * sizeof *results);
    for (int index = 0; index < chosen_count; index++) {
        mode = chosen[index];
        first_tag = index * TAGS_PER_RUN;
        observer = &results[index].counts;
        render();
    }
    observer = NULL;
    for (int repetition = 0; repetition < repetitions && !counting; repetition++) {
        for (int index = 0; index < chosen_count; index++) {
            mode = chosen[index];
            measure(&results[index], repetition);
        }
    }
    printf(",\n\"runs\": [");
    for (int index = 0; index < chosen_count; index++) {
        print_run(chosen[index]->name, index, &results[index], repetitions);
    }
    printf("]}\n");
}

static void settle_thread(void)
{
#ifdef __x86_64__
    _mm_setcsr(_mm_getcsr() | 0x8040); // Denormals are zero, as Embree wants it.
#endif
    cpu_set_t set;
    if (counting || sched_getaffinity(0, sizeof set, &set) != 0) return;
    for (int processor = 0; processor < CPU_SETSIZE; processor++) {
        if (!CPU_ISSET(processor, &set)) continue;
        CPU_ZERO(&set);
        CPU_SET(processor, &set);
        sched_setaffinity(0, sizeof set, &set);
        return;
    }
}

static const struct mode *mode_named(const char *name)
{
    for (int index = 0; index < MODE_COUNT; index++) {
        if (strcmp(modes[index].name, name) == 0) return &modes[index];
    }
    fail(name, "no such mode");
    return NULL;
}

int main(int argument_count, char **arguments)
{
    const char *path = NULL, *config = "";
    const struct mode *chosen[MODE_COUNT];
    int chosen_count = 0, repetitions = 7;
    bool robust = false;
    for (int index = 1; index < argument_count; index++) {
        const char *argument = arguments[index];
        const char *value = index + 1 < argument_count ? arguments[index + 1] : "";
        if (argument[0] != '-') path = argument;
        else if (strcmp(argument, "--robust") == 0) robust = true;
        else if (strcmp(argument, "--count") == 0) counting = true;
        else if (strcmp(argument, "--json") == 0) continue; // It prints nothing else.
        else {
            index++;
            if (strcmp(argument, "--depth") == 0) depth_max = atoi(value);
            else if (strcmp(argument, "--reps") == 0) repetitions = atoi(value);
            else if (strcmp(argument, "--config") == 0) config = value;
            else if (strcmp(argument, "--mode") == 0 && chosen_count < MODE_COUNT)
                chosen[chosen_count++] = mode_named(value);
            else fail(argument, "no such option");
        }
    }
    if (path == NULL) fail("usage", "embree FILE [--mode NAME]... (see the source)");
    if (repetitions < 1 || repetitions > REPETITIONS_MAX) fail("--reps", "is 1 to 1000");
    if (counting) repetitions = 1;
    if (chosen_count == 0) {
        while (chosen_count < MODE_COUNT) {
            chosen[chosen_count] = &modes[chosen_count];
            chosen_count++;
        }
    }
    read_file(path);
    pixels = allocate((size_t)setup.size * setup.size * sizeof *pixels);
    settle_thread();
    char options[512];
    snprintf(options, sizeof options, "threads=1,set_affinity=0,frequency_level=simd512%s%s",
             *config != '\0' ? "," : "", config);
    device = rtcNewDevice(options);
    if (device == NULL) fail("Embree", "gives no device");
    rtcSetDeviceMemoryMonitorFunction(device, on_memory, NULL);
    printf("{\"scene\": \"%s\", \"triangles\": %u, \"size\": %u, \"depth\": %d,\n", path,
           setup.triangle_count, setup.size, depth_max);
    build_all(repetitions, robust);
    run_all(chosen, chosen_count, repetitions);
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
    return 0;
}
