/* stb_image_write's implementation, over libdeflate and our memory, and the call that we make.
 *
 * The call in progress is thread-local: neither library's allocator has a place for a context. When
 * memory runs out both are left by longjmp, for not all that they ask for is looked at; what they
 * hold then is freed with the heap behind the hooks.
 */
#include <setjmp.h>
#include <stdbool.h>
#include <stdint.h>

#include "../memory_account.h"
#include "libdeflate/libdeflate.h"

typedef struct rl_call {
    const rl_memory *memory;
    jmp_buf exhausted;
} rl_call;

static _Thread_local rl_call *rl_now;

static void *rl_checked(void *memory) {
    if (memory == NULL) longjmp(rl_now->exhausted, 1);
    return memory;
}

static void *rl_allocate(size_t size) {
    return rl_checked(rl_now->memory->allocate(rl_now->memory->user, size));
}

static void *rl_resize(void *memory, size_t size) {
    return rl_checked(rl_now->memory->resize(rl_now->memory->user, memory, size));
}

static void rl_release(void *memory) {
    rl_now->memory->release(rl_now->memory->user, memory);
}

/* In the place of stb's own. Level 6 takes twice to three times as long as level 1, for files that
 * are an eighth smaller. */
static unsigned char *rl_zlib_compress(unsigned char *bytes, int size, int *out_size, int quality) {
    const struct libdeflate_options options = {
        .sizeof_options = sizeof(options),
        .malloc_func = rl_allocate,
        .free_func = rl_release,
    };
    struct libdeflate_compressor *compressor = libdeflate_alloc_compressor_ex(1, &options);
    const size_t bound = libdeflate_zlib_compress_bound(compressor, (size_t)size);
    unsigned char *out = rl_allocate(bound);
    (void)quality;
    *out_size = (int)libdeflate_zlib_compress(compressor, bytes, (size_t)size, out, bound);
    libdeflate_free_compressor(compressor);
    return out;
}

#define STBIW_MALLOC(size) rl_allocate(size)
#define STBIW_REALLOC(memory, size) rl_resize(memory, size)
#define STBIW_FREE(memory) rl_release(memory)
#define STBIW_ZLIB_COMPRESS rl_zlib_compress
#define STBIW_CRC32(bytes, size) libdeflate_crc32(0, bytes, (size_t)(size))
#define STB_IMAGE_WRITE_STATIC
#define STB_IMAGE_WRITE_IMPLEMENTATION
#include "stb_image_write.h"

/* The difference to the row above, for every row: to choose among all five takes a seventh more
 * time, for files that are 1.3 % smaller. Before main, for it is a global of the library. */
__attribute__((constructor)) static void rl_force_png_filter(void) {
    stbi_write_force_png_filter = 2;
}

enum { rl_png, rl_jpg, rl_tga, rl_bmp, rl_hdr };

/* Encodes a picture, in pieces to `sink`. Numbers of bytes must fit into int. False: no memory. */
bool rl_encode(const rl_memory *memory, int format, int width, int height, int channels,
               const void *pixels, int quality, stbi_write_func *sink, void *user) {
    rl_call call = {.memory = memory};
    rl_now = &call;
    if (setjmp(call.exhausted) != 0) return false;
    switch (format) {
    case rl_png: return stbi_write_png_to_func(sink, user, width, height, channels, pixels, 0);
    case rl_jpg:
        return stbi_write_jpg_to_func(sink, user, width, height, channels, pixels, quality);
    case rl_tga: return stbi_write_tga_to_func(sink, user, width, height, channels, pixels);
    case rl_bmp: return stbi_write_bmp_to_func(sink, user, width, height, channels, pixels);
    case rl_hdr: return stbi_write_hdr_to_func(sink, user, width, height, channels, pixels);
    default: return false;
    }
}
