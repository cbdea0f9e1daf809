/* OpenEXRCore's writer, and the one call of it that we make.
 *
 * In: channels of floats. Out: a file of halves and floats, in pieces with their places to a sink.
 * The library allocates by the hooks; its allocator has no place for a context, so the call in
 * progress is thread-local. When memory runs out it is left by longjmp; what it holds then is freed
 * with the heap behind the hooks.
 */
#include <setjmp.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "../memory_account.h"
#include "openexr.h"

/* In the order of openexr.zig. */
typedef struct rl_exr_channel {
    const char *name;
    /* Of the first pixel; others follow in rows, so many floats apart. */
    const float *first;
    int stride;
    bool half;
} rl_exr_channel;

/* In the order of openexr.zig. */
typedef struct rl_exr_picture {
    int width, height, channel_count;
    const rl_exr_channel *channels;
    /* False: no memory. */
    bool (*sink)(void *user, const void *bytes, size_t length, size_t offset);
    void *user;
} rl_exr_picture;

typedef struct rl_call {
    const rl_memory *memory;
    jmp_buf exhausted;
} rl_call;

static _Thread_local rl_call *rl_now;

static void *rl_allocate(size_t size) {
    void *memory = rl_now->memory->allocate(rl_now->memory->user, size);
    if (memory == NULL) longjmp(rl_now->exhausted, 1);
    return memory;
}

static void rl_release(void *memory) {
    rl_now->memory->release(rl_now->memory->user, memory);
}

static void rl_report(exr_const_context_t context, exr_result_t code, const char *message) {
    (void)context, (void)code, (void)message;
}

static int64_t rl_write(exr_const_context_t context, void *user, const void *bytes, uint64_t size,
                        uint64_t offset, exr_stream_error_func_ptr_t report) {
    const rl_exr_picture *picture = user;
    (void)context, (void)report;
    if (!picture->sink(picture->user, bytes, (size_t)size, (size_t)offset))
        longjmp(rl_now->exhausted, 1);
    return (int64_t)size;
}

static exr_result_t rl_write_header(exr_context_t context, const rl_exr_picture *picture) {
    exr_result_t result = exr_add_part(context, "", EXR_STORAGE_SCANLINE, NULL);
    if (result == EXR_ERR_SUCCESS)
        result = exr_initialize_required_attr_simple(context, 0, picture->width, picture->height,
                                                     EXR_COMPRESSION_ZIP);
    for (int index = 0; index < picture->channel_count && result == EXR_ERR_SUCCESS; index++) {
        const rl_exr_channel *channel = &picture->channels[index];
        result = exr_add_channel(context, 0, channel->name,
                                 channel->half ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT,
                                 EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
    }
    return result == EXR_ERR_SUCCESS ? exr_write_header(context) : result;
}

/* Tells the pipeline where its channels come from, which are in the order of the alphabet. */
static void rl_place(exr_encode_pipeline_t *pipeline, const rl_exr_picture *picture, int y) {
    for (int index = 0; index < pipeline->channel_count; index++) {
        exr_coding_channel_info_t *info = &pipeline->channels[index];
        const rl_exr_channel *channel = picture->channels;
        while (strcmp(channel->name, info->channel_name) != 0) channel++;
        const size_t before = (size_t)y * (size_t)picture->width * (size_t)channel->stride;
        info->encode_from_ptr = (const uint8_t *)(channel->first + before);
        info->user_data_type = EXR_PIXEL_FLOAT;
        info->user_bytes_per_element = sizeof(float);
        info->user_pixel_stride = channel->stride * (int)sizeof(float);
        info->user_line_stride = picture->width * info->user_pixel_stride;
    }
}

static exr_result_t rl_write_chunks(exr_context_t context, exr_encode_pipeline_t *pipeline,
                                    const rl_exr_picture *picture) {
    int32_t lines;
    exr_result_t result = exr_get_scanlines_per_chunk(context, 0, &lines);
    for (int y = 0; y < picture->height && result == EXR_ERR_SUCCESS; y += lines) {
        exr_chunk_info_t chunk;
        result = exr_write_scanline_chunk_info(context, 0, y, &chunk);
        if (result != EXR_ERR_SUCCESS) return result;
        result = y == 0 ? exr_encoding_initialize(context, 0, &chunk, pipeline)
                        : exr_encoding_update(context, 0, &chunk, pipeline);
        if (result != EXR_ERR_SUCCESS) return result;
        rl_place(pipeline, picture, y);
        if (y == 0) result = exr_encoding_choose_default_routines(context, 0, pipeline);
        if (result == EXR_ERR_SUCCESS) result = exr_encoding_run(context, 0, pipeline);
    }
    return result;
}

enum { rl_done, rl_exhausted, rl_broken };

/* Encodes a picture. */
int rl_exr_encode(const rl_memory *memory, const rl_exr_picture *picture) {
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    exr_encode_pipeline_t pipeline = EXR_ENCODE_PIPELINE_INITIALIZER;
    exr_context_t context = NULL;
    setup.error_handler_fn = rl_report;
    setup.alloc_fn = rl_allocate;
    setup.free_fn = rl_release;
    setup.user_data = (void *)picture;
    setup.write_fn = rl_write;
    rl_call call = {.memory = memory};
    rl_now = &call;
    if (setjmp(call.exhausted) != 0) return rl_exhausted;
    exr_result_t result =
        exr_start_write(&context, "memory", EXR_WRITE_FILE_DIRECTLY, &setup);
    if (result == EXR_ERR_SUCCESS) result = rl_write_header(context, picture);
    if (result == EXR_ERR_SUCCESS) result = rl_write_chunks(context, &pipeline, picture);
    exr_encoding_destroy(context, &pipeline);
    const exr_result_t finished = exr_finish(&context);
    return result == EXR_ERR_SUCCESS && finished == EXR_ERR_SUCCESS ? rl_done : rl_broken;
}
