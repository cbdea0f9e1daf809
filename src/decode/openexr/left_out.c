/* The compressions that are left out of OpenEXR: those that lose information by block codecs, and
 * the youngest ones. Files with them are refused before the library sees them. */
#include "internal_compress.h"
#include "internal_decompress.h"

#define LEFT_OUT(name)                                                                    \
    exr_result_t internal_exr_apply_##name(exr_encode_pipeline_t *pipeline) {             \
        (void)pipeline;                                                                   \
        return EXR_ERR_FEATURE_NOT_IMPLEMENTED;                                           \
    }                                                                                     \
    exr_result_t internal_exr_undo_##name(exr_decode_pipeline_t *pipeline,                \
                                          const void *in, uint64_t in_bytes,              \
                                          void *out, uint64_t out_bytes) {                \
        (void)pipeline, (void)in, (void)in_bytes, (void)out, (void)out_bytes;             \
        return EXR_ERR_FEATURE_NOT_IMPLEMENTED;                                           \
    }

LEFT_OUT(b44)
LEFT_OUT(b44a)
LEFT_OUT(dwaa)
LEFT_OUT(dwab)
LEFT_OUT(ht)
LEFT_OUT(zstd)
