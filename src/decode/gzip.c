/* One call of libdeflate's, with our memory.
 *
 * In: a raw deflate stream, and room for what it holds. Out: how much of both was used. The call in
 * progress is thread-local, for the library's allocator has no place for a context.
 */
#include "../memory_account.h"
#include "libdeflate/libdeflate.h"

static _Thread_local const rl_memory *rl_now;

static void *rl_allocate(size_t size) { return rl_now->allocate(rl_now->user, size); }

static void rl_release(void *memory) { rl_now->release(rl_now->user, memory); }

enum { rl_done, rl_exhausted, rl_broken, rl_larger };

/* rl_larger: there is more than `out_bytes`. */
int rl_inflate(const rl_memory *memory, const void *in, size_t in_bytes, void *out,
               size_t out_bytes, size_t *in_used, size_t *out_used) {
    const struct libdeflate_options options = {
        .sizeof_options = sizeof(options),
        .malloc_func = rl_allocate,
        .free_func = rl_release,
    };
    rl_now = memory;
    struct libdeflate_decompressor *decompressor = libdeflate_alloc_decompressor_ex(&options);
    if (decompressor == NULL) return rl_exhausted;
    const enum libdeflate_result result = libdeflate_deflate_decompress_ex(
        decompressor, in, in_bytes, out, out_bytes, in_used, out_used);
    libdeflate_free_decompressor(decompressor);
    if (result == LIBDEFLATE_SUCCESS) return rl_done;
    return result == LIBDEFLATE_INSUFFICIENT_SPACE ? rl_larger : rl_broken;
}
