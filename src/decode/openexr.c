/* OpenEXRCore's reader, and the one call of it that we make.
 *
 * In: a file of one part of scan lines whose header has passed our own check. Out: floats,
 * interleaved. The library reads from memory and allocates by the hooks; its allocator has no place
 * for a context, so the call in progress is thread-local. Not all that it asks for is looked at:
 * when memory runs out it is left by longjmp, and what it holds is freed with the heap behind the
 * hooks.
 */
#include <setjmp.h>
#include <stdint.h>
#include <string.h>

#include "../memory_account.h"
#include "openexr.h"

typedef struct rl_file {
    const uint8_t *bytes;
    uint64_t length;
} rl_file;

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

static int64_t rl_size(exr_const_context_t context, void *user) {
    const rl_file *file = user;
    (void)context;
    return (int64_t)file->length;
}

static int64_t rl_read(exr_const_context_t context, void *user, void *out, uint64_t size,
                       uint64_t offset, exr_stream_error_func_ptr_t report) {
    const rl_file *file = user;
    (void)context, (void)report;
    if (offset >= file->length) return 0;
    if (size > file->length - offset) size = file->length - offset;
    memcpy(out, file->bytes + offset, size);
    return (int64_t)size;
}

/* Tells the pipeline where each channel that is wanted goes. */
static void rl_place(exr_decode_pipeline_t *pipeline, const char *const *names, int count,
                     float *rows, int width) {
    for (int channel = 0; channel < pipeline->channel_count; channel++) {
        exr_coding_channel_info_t *info = &pipeline->channels[channel];
        info->decode_to_ptr = NULL;
        for (int place = 0; place < count; place++) {
            if (strcmp(info->channel_name, names[place]) != 0) continue;
            info->decode_to_ptr = (uint8_t *)(rows + place);
            info->user_data_type = EXR_PIXEL_FLOAT;
            info->user_bytes_per_element = sizeof(float);
            info->user_pixel_stride = count * (int)sizeof(float);
            info->user_line_stride = width * count * (int)sizeof(float);
        }
    }
}

static exr_result_t rl_decode_chunks(exr_context_t context, exr_decode_pipeline_t *pipeline,
                                     const char *const *names, int count, int width, int height,
                                     float *pixels) {
    exr_attr_box2i_t window;
    int32_t lines;
    exr_result_t result = exr_get_data_window(context, 0, &window);
    if (result != EXR_ERR_SUCCESS) return result;
    result = exr_get_scanlines_per_chunk(context, 0, &lines);
    for (int y = 0; y < height && result == EXR_ERR_SUCCESS; y += lines) {
        exr_chunk_info_t chunk;
        result = exr_read_scanline_chunk_info(context, 0, window.min.y + y, &chunk);
        if (result != EXR_ERR_SUCCESS) return result;
        if (chunk.width != width || chunk.height > height - y) return EXR_ERR_CORRUPT_CHUNK;
        result = y == 0 ? exr_decoding_initialize(context, 0, &chunk, pipeline)
                        : exr_decoding_update(context, 0, &chunk, pipeline);
        if (result != EXR_ERR_SUCCESS) return result;
        rl_place(pipeline, names, count, pixels + (size_t)y * (size_t)(width * count), width);
        if (y == 0) result = exr_decoding_choose_default_routines(context, 0, pipeline);
        if (result == EXR_ERR_SUCCESS) result = exr_decoding_run(context, 0, pipeline);
    }
    return result;
}

enum { rl_done, rl_exhausted, rl_broken };

/* The named channels of all pixels. With rl_broken the reason, a text of the library's. */
int rl_exr_decode(const rl_memory *memory, const uint8_t *bytes, size_t length,
                  const char *const *names, int count, int width, int height, float *pixels,
                  const char **reason) {
    rl_file file = {bytes, length};
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    exr_decode_pipeline_t pipeline = EXR_DECODE_PIPELINE_INITIALIZER;
    exr_context_t context = NULL;
    setup.error_handler_fn = rl_report;
    setup.alloc_fn = rl_allocate;
    setup.free_fn = rl_release;
    setup.user_data = &file;
    setup.read_fn = rl_read;
    setup.size_fn = rl_size;
    setup.flags = EXR_CONTEXT_FLAG_SILENT_HEADER_PARSE;
    setup.flags |= EXR_CONTEXT_FLAG_DISABLE_CHUNK_RECONSTRUCTION;
    rl_call call = {.memory = memory};
    rl_now = &call;
    if (setjmp(call.exhausted) != 0) return rl_exhausted;
    exr_result_t result = exr_start_read(&context, "memory", &setup);
    if (result == EXR_ERR_SUCCESS)
        result = rl_decode_chunks(context, &pipeline, names, count, width, height, pixels);
    exr_decoding_destroy(context, &pipeline);
    exr_finish(&context);
    if (result == EXR_ERR_SUCCESS) return rl_done;
    *reason = exr_get_default_error_message(result);
    return rl_broken;
}
