/* Zstandard's decoder, and the one call of it that we make. */
#include <stddef.h>

#include "../memory_account.h"
#define ZSTD_STATIC_LINKING_ONLY
#include "zstd/zstd.h"

static void *rl_allocate(void *memory, size_t size) {
    const rl_memory *hooks = memory;
    return hooks->allocate(hooks->user, size);
}

static void rl_release(void *memory, void *block) {
    const rl_memory *hooks = memory;
    hooks->release(hooks->user, block);
}

enum { rl_done, rl_exhausted, rl_broken };

/* Fills `out` from `in`, which holds exactly as much. */
int rl_zstd_decode(const rl_memory *memory, const void *in, size_t in_bytes, void *out,
                   size_t out_bytes) {
    const ZSTD_customMem hooks = {rl_allocate, rl_release, (void *)memory};
    ZSTD_DCtx *context = ZSTD_createDCtx_advanced(hooks);
    if (context == NULL) return rl_exhausted;
    const size_t written = ZSTD_decompressDCtx(context, out, out_bytes, in, in_bytes);
    ZSTD_freeDCtx(context);
    return written == out_bytes ? rl_done : rl_broken;
}
