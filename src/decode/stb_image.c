/* stb_image's implementation, over libdeflate and our memory, and the two calls that we make.
 *
 * In: a file whose header and structure have passed our own check. Out: the pixels, in a block of
 * the heap behind the hooks. Both calls go straight to one codec, so that the failure reason, which
 * is thread-local, is empty unless that codec met something: it accepts some files that are broken
 * without saying so. Its assertions and memory that runs out leave it by longjmp; the call in
 * progress is thread-local, for its macros have no place for a context.
 */
#include <setjmp.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "../memory_account.h"
#include "libdeflate/libdeflate.h"

typedef struct rl_call {
    const rl_memory *memory;
    /* JPEG leaves what no scan describes as it is: the same pixels in every run need zeros. */
    bool is_zeroed;
    /* Something was read behind the last byte. */
    bool is_cut;
    /* Bytes that a PNG's pixels have before compression; some files carry a few more. */
    size_t inflated_max;
    jmp_buf left;
} rl_call;

enum { rl_done, rl_exhausted, rl_broken };

static _Thread_local rl_call *rl_now;

static void *rl_checked(void *memory) {
    if (memory == NULL) longjmp(rl_now->left, rl_exhausted);
    return memory;
}

static void *rl_allocate(size_t size) {
    void *memory = rl_checked(rl_now->memory->allocate(rl_now->memory->user, size));
    if (rl_now->is_zeroed) memset(memory, 0, size);
    return memory;
}

static void *rl_resize(void *memory, size_t size) {
    return rl_checked(rl_now->memory->resize(rl_now->memory->user, memory, size));
}

static void rl_release(void *memory) {
    rl_now->memory->release(rl_now->memory->user, memory);
}

static void rl_assert(bool holds) {
    if (!holds) longjmp(rl_now->left, rl_broken);
}

/* Exact, as the C library's; of an exponent byte only. */
static double rl_power_of_two(double one, int exponent) {
    const uint64_t bits = (uint64_t)(exponent + 1023) << 52;
    double power;
    memcpy(&power, &bits, sizeof(power));
    return one * power;
}

#define STBI_MALLOC(size) rl_allocate(size)
#define STBI_REALLOC(memory, size) rl_resize(memory, size)
#define STBI_FREE(memory) rl_release(memory)
#define STBI_ASSERT(condition) rl_assert(condition)
#define STBI_MAX_DIMENSIONS 32768
#define STBI_NO_STDIO
#define STBI_NO_LINEAR
#define STBI_NO_ZLIB
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_ONLY_HDR
#if defined(__ARM_NEON)
#define STBI_NEON
#endif
#define STB_IMAGE_STATIC
#define STB_IMAGE_IMPLEMENTATION
#define ldexp rl_power_of_two
#include "stb_image.h"

/* In the place of stb's own: faster, bounded, and with the checksum looked at. */
STBIDEF char *stbi_zlib_decode_malloc_guesssize_headerflag(const char *bytes, int size, int guess,
                                                           int *out_size, int has_header) {
    const struct libdeflate_options options = {
        .sizeof_options = sizeof(options),
        .malloc_func = rl_allocate,
        .free_func = rl_release,
    };
    struct libdeflate_decompressor *decompressor = libdeflate_alloc_decompressor_ex(&options);
    char *out = rl_allocate(rl_now->inflated_max);
    size_t written = 0;
    (void)guess;
    (void)has_header; /* Apple's variant without one was refused before. */
    const enum libdeflate_result result = libdeflate_zlib_decompress(
        decompressor, bytes, (size_t)size, out, rl_now->inflated_max, &written);
    libdeflate_free_decompressor(decompressor);
    if (result == LIBDEFLATE_INSUFFICIENT_SPACE)
        return stbi__errpuc("more data than pixels", "Corrupt PNG"), NULL;
    if (result != LIBDEFLATE_SUCCESS)
        return stbi__errpuc("bad compressed data", "Corrupt PNG"), NULL;
    *out_size = (int)written;
    return out;
}

/* What lies behind the last byte. */
static int rl_read(void *user, char *data, int size) {
    (void)user, (void)data, (void)size;
    rl_now->is_cut = true;
    return 0;
}

static void rl_skip(void *user, int size) {
    (void)user, (void)size;
    rl_now->is_cut = true;
}

static int rl_eof(void *user) {
    (void)user;
    return 1;
}

static void rl_start(stbi__context *context, const uint8_t *file, int file_bytes) {
    stbi__start_mem(context, file, file_bytes);
    context->io = (stbi_io_callbacks){.read = rl_read, .skip = rl_skip, .eof = rl_eof};
    context->io_user_data = NULL;
    context->buflen = sizeof(context->buffer_start);
    context->read_from_callbacks = 1;
    stbi__g_failure_reason = NULL;
}

/* The size of a Radiance HDR file; false: the reason is set. */
bool rl_hdr_size(const uint8_t *file, int file_bytes, int *width, int *height,
                 const char **reason) {
    rl_call call = {0};
    stbi__context context;
    int channels;
    rl_now = &call;
    rl_start(&context, file, file_bytes);
    if (stbi__hdr_info(&context, width, height, &channels) && !call.is_cut) return true;
    *reason = call.is_cut ? "cut short" : "bad header";
    return false;
}

enum { rl_png, rl_jpeg, rl_hdr };

typedef struct rl_pixels {
    int width, height, channels, bits;
    void *memory;
} rl_pixels;

/* rl_done, rl_exhausted, or rl_broken with the reason, a text of the library's. */
int rl_stb_decode(const rl_memory *memory, int format, const uint8_t *file, int file_bytes,
                  size_t inflated_max, rl_pixels *out, const char **reason) {
    rl_call call = {
        .memory = memory, .is_zeroed = format == rl_jpeg, .inflated_max = inflated_max};
    stbi__context context;
    stbi__result_info info = {.bits_per_channel = 8};
    rl_now = &call;
    *reason = "it contradicts itself";
    const int left = setjmp(call.left);
    if (left != 0) return left;
    rl_start(&context, file, file_bytes);
    switch (format) {
    case rl_png:
        out->memory = stbi__png_load(&context, &out->width, &out->height, &out->channels, 0, &info);
        break;
    case rl_jpeg:
        out->memory =
            stbi__jpeg_load(&context, &out->width, &out->height, &out->channels, 0, &info);
        break;
    default:
        info.bits_per_channel = 32;
        out->memory = stbi__hdr_load(&context, &out->width, &out->height, &out->channels, 0, &info);
    }
    out->bits = info.bits_per_channel;
    if (call.is_cut) {
        *reason = "cut short";
        return rl_broken;
    }
    if (out->memory != NULL && stbi__g_failure_reason == NULL) return rl_done;
    if (stbi__g_failure_reason != NULL) *reason = stbi__g_failure_reason;
    return rl_broken;
}
