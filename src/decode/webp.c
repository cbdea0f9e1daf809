/* The calls of libwebp's decoder that we make, and the library's allocator.
 *
 * In: a file. Out: its size, and its pixels where the caller wants them. The library is compiled
 * with malloc, calloc and free under names of ours (build/libraries.zig); the call in progress is
 * thread-local, for they have no place for a context. When memory runs out the library says so.
 */
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "../memory_account.h"
#include "src/webp/decode.h"

static _Thread_local const rl_memory *rl_memory_now;
static _Thread_local bool rl_is_exhausted;

void *rl_webp_malloc(size_t size);
void *rl_webp_calloc(size_t count, size_t size);
void rl_webp_free(void *memory);

void *rl_webp_malloc(size_t size) {
    void *memory = rl_memory_now->allocate(rl_memory_now->user, size);
    if (memory == NULL) rl_is_exhausted = true;
    return memory;
}

void rl_webp_use(const rl_memory *memory);

/* Sets what this thread's calls allocate by. */
void rl_webp_use(const rl_memory *memory) {
    rl_memory_now = memory;
    rl_is_exhausted = false;
}

/* The library has checked that the product is one. */
void *rl_webp_calloc(size_t count, size_t size) {
    void *memory = rl_webp_malloc(count * size);
    if (memory != NULL) memset(memory, 0, count * size);
    return memory;
}

void rl_webp_free(void *memory) {
    if (memory != NULL) rl_memory_now->release(rl_memory_now->user, memory);
}

static const char *const rl_reasons[] = {
    [VP8_STATUS_OK] = "done",
    [VP8_STATUS_OUT_OF_MEMORY] = "too large",
    [VP8_STATUS_INVALID_PARAM] = "bad header",
    [VP8_STATUS_BITSTREAM_ERROR] = "bad compressed data",
    [VP8_STATUS_UNSUPPORTED_FEATURE] = "a kind of WebP that is not supported",
    [VP8_STATUS_SUSPENDED] = "cut short",
    [VP8_STATUS_USER_ABORT] = "cut short",
    [VP8_STATUS_NOT_ENOUGH_DATA] = "cut short",
};

typedef struct rl_webp_features {
    int width, height;
    bool has_alpha, is_animated;
} rl_webp_features;

/* NULL, or why not. */
const char *rl_webp_info(const uint8_t *file, size_t file_bytes, rl_webp_features *out) {
    WebPBitstreamFeatures features;
    const VP8StatusCode status = WebPGetFeatures(file, file_bytes, &features);
    if (status != VP8_STATUS_OK) return rl_reasons[status];
    out->width = features.width;
    out->height = features.height;
    out->has_alpha = features.has_alpha;
    out->is_animated = features.has_animation;
    return NULL;
}

enum { rl_done, rl_exhausted, rl_broken };

/* Rows of three or four channels without gaps, as the file has alpha or not. */
int rl_webp_decode(const rl_memory *memory, const uint8_t *file, size_t file_bytes, int channels,
                   int width, int height, uint8_t *pixels, const char **reason) {
    WebPDecoderConfig config;
    if (!WebPInitDecoderConfig(&config)) return rl_broken;
    config.output.colorspace = channels == 4 ? MODE_RGBA : MODE_RGB;
    config.output.is_external_memory = 1;
    config.output.u.RGBA = (WebPRGBABuffer){
        .rgba = pixels,
        .stride = width * channels,
        .size = (size_t)width * (size_t)height * (size_t)channels,
    };
    rl_webp_use(memory);
    const VP8StatusCode status = WebPDecode(file, file_bytes, &config);
    WebPFreeDecBuffer(&config.output);
    if (status == VP8_STATUS_OK) return rl_done;
    *reason = rl_reasons[status];
    return rl_is_exhausted ? rl_exhausted : rl_broken;
}
