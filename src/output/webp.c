/* libwebp's encoder, and the one call of it that we make.
 *
 * In: rows of RGB or RGBA bytes. Out: a file, in pieces to a sink. Its allocator is that of the
 * decoder (src/decode/webp.c). Of the conversion that it can make of sharp colours, which nobody
 * asks for, the functions are here, and do nothing.
 */
#include <stdbool.h>
#include <stdint.h>

#include "../memory_account.h"
#include "sharpyuv/sharpyuv.h"
#include "sharpyuv/sharpyuv_csp.h"
#include "src/webp/encode.h"

void rl_webp_use(const rl_memory *memory);

/* In the order of webp.zig. */
typedef struct rl_webp_picture {
    int width, height, channels;
    /* Of lossy compression, 0: nothing is lost. */
    int quality;
    const uint8_t *pixels;
    /* False: no memory. */
    bool (*sink)(void *user, const uint8_t *bytes, size_t length);
    void *user;
} rl_webp_picture;

static int rl_write(const uint8_t *bytes, size_t length, const WebPPicture *library) {
    const rl_webp_picture *picture = library->custom_ptr;
    return picture->sink(picture->user, bytes, length);
}

enum { rl_done, rl_exhausted, rl_broken };

/* Encodes a picture. Of what can be done about the size without loss, the cheaper half: the rest
 * takes several times as long for a few percent. */
int rl_webp_encode(const rl_memory *memory, const rl_webp_picture *picture) {
    WebPConfig config;
    WebPPicture library;
    if (!WebPConfigInit(&config) || !WebPPictureInit(&library)) return rl_broken;
    if (picture->quality > 0)
        config.quality = (float)picture->quality;
    else if (!WebPConfigLosslessPreset(&config, 2))
        return rl_broken;
    library.use_argb = picture->quality == 0;
    library.width = picture->width;
    library.height = picture->height;
    library.writer = rl_write;
    library.custom_ptr = (void *)picture;
    rl_webp_use(memory);
    const int stride = picture->width * picture->channels;
    const bool is_done = (picture->channels == 4
                              ? WebPPictureImportRGBA(&library, picture->pixels, stride)
                              : WebPPictureImportRGB(&library, picture->pixels, stride)) &&
                         WebPEncode(&config, &library);
    const WebPEncodingError error = library.error_code;
    WebPPictureFree(&library);
    if (is_done) return rl_done;
    const bool is_exhausted = error == VP8_ENC_ERROR_OUT_OF_MEMORY ||
                              error == VP8_ENC_ERROR_BITSTREAM_OUT_OF_MEMORY ||
                              error == VP8_ENC_ERROR_BAD_WRITE;
    return is_exhausted ? rl_exhausted : rl_broken;
}

void SharpYuvInit(int (*get_cpu_info)(int feature));
void SharpYuvInit(int (*get_cpu_info)(int feature)) {
    (void)get_cpu_info;
}

const SharpYuvConversionMatrix *SharpYuvGetConversionMatrix(SharpYuvMatrixType type) {
    (void)type;
    return NULL;
}

int SharpYuvConvert(const void *r, const void *g, const void *b, int rgb_step, int rgb_stride,
                    int rgb_bits, void *y, int y_stride, void *u, int u_stride, void *v,
                    int v_stride, int yuv_bits, int width, int height,
                    const SharpYuvConversionMatrix *matrix) {
    (void)r, (void)g, (void)b, (void)rgb_step, (void)rgb_stride, (void)rgb_bits, (void)y;
    (void)y_stride, (void)u, (void)u_stride, (void)v, (void)v_stride, (void)yuv_bits, (void)width;
    (void)height, (void)matrix;
    return 0;
}
