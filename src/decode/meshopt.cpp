/* The decoders of meshoptimizer's streams in a namespace without a name, so that nothing of it is
 * compiled that we do not call, and the three calls that we make.
 *
 * In: what meshopt.zig has checked of a stream and its layout. Out: elements. They allocate nothing
 * and compute with integers only, in code without SIMD.
 */
#include <assert.h>
#include <stddef.h>
#include <string.h>

namespace {
#include "meshopt/indexcodec.cpp"
#include "meshopt/vertexcodec.cpp"
} // namespace

/* In the order of meshopt.zig. `out` has the size of all elements and the alignment of an index. */
struct rl_meshopt_stream {
    const unsigned char *bytes;
    size_t byte_count;
    size_t count, stride;
    void *out;
};

extern "C" bool rl_meshopt_attributes(const rl_meshopt_stream *stream) {
    return meshopt_decodeVertexBuffer(stream->out, stream->count, stream->stride, stream->bytes,
                                      stream->byte_count) == 0;
}

extern "C" bool rl_meshopt_triangles(const rl_meshopt_stream *stream) {
    return meshopt_decodeIndexBuffer(stream->out, stream->count, stream->stride, stream->bytes,
                                     stream->byte_count) == 0;
}

extern "C" bool rl_meshopt_indices(const rl_meshopt_stream *stream) {
    return meshopt_decodeIndexSequence(stream->out, stream->count, stream->stride, stream->bytes,
                                       stream->byte_count) == 0;
}
