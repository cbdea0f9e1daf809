/* The Basis Universal transcoder in a namespace without a name, so that nothing is compiled of it
 * that we do not call, and the two calls that we make.
 *
 * In: what ktx2.zig found in a file, its sizes checked. Out: RGBA. Of the C++ library there are the
 * headers only: what would need its code has its place here. Memory that runs out, assertions that
 * do not hold, of indices above all, and what the transcoder ends the program for leave it by
 * longjmp; what it holds then is freed with the heap behind the hooks, and no destructor needs to
 * run.
 */
#include <algorithm>
#include <assert.h>
#include <cfloat>
#include <ctype.h>
#include <exception>
#include <fenv.h>
#include <functional>
#include <inttypes.h>
#include <iterator>
#include <limits.h>
#include <limits>
#include <malloc.h>
#include <math.h>
#include <memory.h>
#include <pthread.h>
#include <random>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <string>
#include <type_traits>

extern "C" {
#include "../memory_account.h"
}

namespace {

enum { rl_done, rl_exhausted, rl_broken };

struct rl_call {
    const rl_memory *memory;
    jmp_buf left;
};

thread_local rl_call *rl_now;

[[noreturn]] void rl_fail() {
    longjmp(rl_now->left, rl_broken);
}

void *rl_checked(void *memory) {
    if (memory == nullptr) longjmp(rl_now->left, rl_exhausted);
    return memory;
}

void *rl_allocate(size_t size) {
    return rl_checked(rl_now->memory->allocate(rl_now->memory->user, size));
}

void *rl_allocate_zeros(size_t count, size_t size) {
    return memset(rl_allocate(count * size), 0, count * size);
}

void *rl_resize(void *memory, size_t size) {
    return rl_checked(rl_now->memory->resize(rl_now->memory->user, memory, size));
}

void rl_release(void *memory) {
    if (memory != nullptr) rl_now->memory->release(rl_now->memory->user, memory);
}

namespace std {
using namespace ::std;
using ::std::swap;

[[noreturn]] void terminate() {
    rl_fail();
}

/* Of a handful of items. */
template <class Iterator> void sort(Iterator first, Iterator last) {
    for (Iterator end = first; end != last; ++end)
        for (Iterator item = end; item != first && *item < *(item - 1); --item)
            swap(*item, *(item - 1));
}
} // namespace std

#define malloc(size) rl_allocate(size)
#define calloc(count, size) rl_allocate_zeros(count, size)
#define realloc(memory, size) rl_resize(memory, size)
#define free(memory) rl_release(memory)
#define fputs(text, file) (0)
#define fprintf(file, ...) (0)
#include "basisu/transcoder/basisu_transcoder.cpp"

pthread_once_t rl_once = PTHREAD_ONCE_INIT;

constexpr auto rl_rgba = basist::transcoder_texture_format::cTFRGBA32;

} // namespace

/* In the order of ktx2.zig. */
struct rl_basis_image {
    uint32_t width, height;
    const uint8_t *level;
    uint32_t level_bytes;
    uint8_t *pixels;
    /* Of ETC1S. */
    uint32_t endpoint_count, selector_count;
    const uint8_t *endpoints, *selectors, *tables;
    uint32_t endpoints_bytes, selectors_bytes, tables_bytes;
    uint32_t colour_offset, colour_bytes, alpha_offset, alpha_bytes;
};

static bool rl_uastc(const rl_basis_image &image) {
    basist::basisu_lowlevel_uastc_ldr_4x4_transcoder transcoder;
    return transcoder.transcode_image(
        rl_rgba, image.pixels, image.width * image.height, image.level, image.level_bytes,
        (image.width + 3) / 4, (image.height + 3) / 4, image.width, image.height, 0, 0,
        image.level_bytes, 0, true);
}

static bool rl_etc1s(const rl_basis_image &image) {
    basist::basisu_lowlevel_etc1s_transcoder transcoder;
    return transcoder.decode_tables(image.tables, image.tables_bytes) &&
           transcoder.decode_palettes(image.endpoint_count, image.endpoints, image.endpoints_bytes,
                                      image.selector_count, image.selectors,
                                      image.selectors_bytes) &&
           transcoder.transcode_image(
               rl_rgba, image.pixels, image.width * image.height, image.level, image.level_bytes,
               (image.width + 3) / 4, (image.height + 3) / 4, image.width, image.height, 0,
               image.colour_offset, image.colour_bytes, image.alpha_offset, image.alpha_bytes, 0,
               image.alpha_bytes != 0);
}

/* The image's pixels; ETC1S where it has tables, otherwise UASTC. */
extern "C" int rl_basis_decode(const rl_memory *memory, const rl_basis_image *image) {
    rl_call call;
    call.memory = memory;
    /* Its tables are global, and take no memory of a call's. */
    rl_now = nullptr;
    pthread_once(&rl_once, [] { basist::basisu_transcoder_init(); });
    rl_now = &call;
    const int left = setjmp(call.left);
    if (left != 0) return left;
    return (image->tables != nullptr ? rl_etc1s(*image) : rl_uastc(*image)) ? rl_done : rl_broken;
}
