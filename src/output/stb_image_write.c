/* The PNG encoder of stb_image_write, made safe against exhausted memory.
 *
 * stb_image_write writes through the null pointer when a reallocation fails. Here its allocator
 * never returns null: it jumps out of the encoder, after freeing all that the encoder holds, and
 * the caller gets null instead. Encoders on several threads do not meet.
 */
#include <setjmp.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

/* Stands before each allocation; all of one encoder's are in a list. */
union rl_block {
    struct {
        union rl_block *previous;
        union rl_block *next;
    } link;
    max_align_t alignment;
};

struct rl_encoder {
    jmp_buf exhausted;
    union rl_block *blocks;
};

static _Thread_local struct rl_encoder *rl_encoder;

static void rl_link(union rl_block *block)
{
    block->link.previous = NULL;
    block->link.next = rl_encoder->blocks;
    if (block->link.next) block->link.next->link.previous = block;
    rl_encoder->blocks = block;
}

static void rl_unlink(union rl_block *block)
{
    if (block->link.next) block->link.next->link.previous = block->link.previous;
    if (block->link.previous) block->link.previous->link.next = block->link.next;
    else rl_encoder->blocks = block->link.next;
}

static void *rl_resize(void *memory, size_t size)
{
    union rl_block *block = memory ? (union rl_block *)memory - 1 : NULL;
    if (block) rl_unlink(block);
    union rl_block *resized = NULL;
    if (size <= PTRDIFF_MAX - sizeof *block) resized = realloc(block, sizeof *block + size);
    if (!resized) {
        if (block) rl_link(block);
        longjmp(rl_encoder->exhausted, 1);
    }
    rl_link(resized);
    return resized + 1;
}

static void rl_free(void *memory)
{
    if (!memory) return;
    union rl_block *block = (union rl_block *)memory - 1;
    rl_unlink(block);
    free(block);
}

#define STBIW_MALLOC(size) rl_resize(NULL, size)
#define STBIW_REALLOC(memory, size) rl_resize(memory, size)
#define STBIW_FREE(memory) rl_free(memory)
#define STBI_WRITE_NO_STDIO
#define STB_IMAGE_WRITE_IMPLEMENTATION
#include "stb_image_write.h"

/* Encodes rows of channel_count bytes a pixel without padding. The result is freed by rl_png_free;
 * null: out of memory. (width * channel_count + 1) * height must not exceed 1.4e9: lengths are int,
 * and the buffer of the compressed data grows by doubling. */
unsigned char *rl_png_encode(const unsigned char *pixels, int width, int height, int channel_count,
                             int *byte_count)
{
    struct rl_encoder encoder = { .blocks = NULL };
    rl_encoder = &encoder;
    if (setjmp(encoder.exhausted)) {
        for (union rl_block *block = encoder.blocks, *next; block; block = next) {
            next = block->link.next;
            free(block);
        }
        rl_encoder = NULL;
        return NULL;
    }
    const int row_bytes = width * channel_count;
    unsigned char *bytes =
        stbi_write_png_to_mem(pixels, row_bytes, width, height, channel_count, byte_count);
    rl_encoder = NULL;
    return bytes;
}

/* Frees a result of rl_png_encode. */
void rl_png_free(unsigned char *bytes)
{
    free((union rl_block *)(void *)bytes - 1);
}
