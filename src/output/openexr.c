/* OpenEXRCore's writer, and the one call of it that we make.
 *
 * In: channels of floats and whole numbers, texts. Out: a file, in pieces with their places to a
 * sink. The library allocates by the hooks; its allocator has no place for a context, so the call
 * in progress is thread-local. When memory runs out it is left by longjmp; what it holds then is
 * freed with the heap behind the hooks.
 */
#include <setjmp.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "../memory_account.h"
#include "openexr.h"

/* In the order of openexr.zig. */
enum { rl_half, rl_float, rl_uint };

typedef struct rl_exr_channel {
    const char *name;
    /* Of the window's first pixel; others follow in rows, so many numbers apart. */
    const float *first;
    uint32_t stride;
    uint8_t kind;
} rl_exr_channel;

typedef struct rl_exr_attribute {
    const char *name, *text;
} rl_exr_attribute;

typedef struct rl_exr_picture {
    int width, height;
    /* The window that channels hold, ends exclusive. */
    int x0, y0, x1, y1;
    int channel_count, attribute_count;
    const rl_exr_channel *channels;
    const rl_exr_attribute *attributes;
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
    const exr_attr_box2i_t display = {.max = {picture->width - 1, picture->height - 1}};
    const exr_attr_box2i_t data = {.min = {picture->x0, picture->y0},
                                   .max = {picture->x1 - 1, picture->y1 - 1}};
    const exr_attr_v2f_t center = {0};
    exr_result_t result = exr_add_part(context, "", EXR_STORAGE_SCANLINE, NULL);
    if (result == EXR_ERR_SUCCESS)
        result = exr_initialize_required_attr(context, 0, &display, &data, 1, &center, 1,
                                              EXR_LINEORDER_INCREASING_Y, EXR_COMPRESSION_ZIP);
    for (int index = 0; index < picture->channel_count && result == EXR_ERR_SUCCESS; index++) {
        static const exr_pixel_type_t types[] = {
            [rl_half] = EXR_PIXEL_HALF, [rl_float] = EXR_PIXEL_FLOAT, [rl_uint] = EXR_PIXEL_UINT};
        const rl_exr_channel *channel = &picture->channels[index];
        result = exr_add_channel(context, 0, channel->name, types[channel->kind],
                                 EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
    }
    for (int index = 0; index < picture->attribute_count && result == EXR_ERR_SUCCESS; index++)
        result = exr_attr_set_string(context, 0, picture->attributes[index].name,
                                     picture->attributes[index].text);
    return result == EXR_ERR_SUCCESS ? exr_write_header(context) : result;
}

/* Tells the pipeline where its channels come from, which are in the order of the alphabet. */
static void rl_place(exr_encode_pipeline_t *pipeline, const rl_exr_picture *picture, int y) {
    const int width = picture->x1 - picture->x0;
    for (int index = 0; index < pipeline->channel_count; index++) {
        exr_coding_channel_info_t *info = &pipeline->channels[index];
        const rl_exr_channel *channel = picture->channels;
        while (strcmp(channel->name, info->channel_name) != 0) channel++;
        const size_t rows = (size_t)(y - picture->y0);
        const size_t before = rows * (size_t)width * (size_t)channel->stride;
        info->encode_from_ptr = (const uint8_t *)(channel->first + before);
        info->user_data_type = channel->kind == rl_uint ? EXR_PIXEL_UINT : EXR_PIXEL_FLOAT;
        info->user_bytes_per_element = sizeof(float);
        info->user_pixel_stride = (int)channel->stride * (int)sizeof(float);
        info->user_line_stride = width * info->user_pixel_stride;
    }
}

static exr_result_t rl_write_chunks(exr_context_t context, exr_encode_pipeline_t *pipeline,
                                    const rl_exr_picture *picture) {
    const int first = picture->y0;
    int32_t lines;
    exr_result_t result = exr_get_scanlines_per_chunk(context, 0, &lines);
    for (int y = first; y < picture->y1 && result == EXR_ERR_SUCCESS; y += lines) {
        exr_chunk_info_t chunk;
        result = exr_write_scanline_chunk_info(context, 0, y, &chunk);
        if (result != EXR_ERR_SUCCESS) return result;
        result = y == first ? exr_encoding_initialize(context, 0, &chunk, pipeline)
                            : exr_encoding_update(context, 0, &chunk, pipeline);
        if (result != EXR_ERR_SUCCESS) return result;
        rl_place(pipeline, picture, y);
        if (y == first) result = exr_encoding_choose_default_routines(context, 0, pipeline);
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
