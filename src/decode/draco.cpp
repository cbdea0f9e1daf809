/* The decoder of Draco's meshes in a namespace without a name, so that nothing is compiled of it
 * that we do not call, and the three calls that we make.
 *
 * In: a stream whose header draco.zig has checked. Out: triangles and the numbers of attributes. Of
 * the C++ library there are the headers only: the few functions of its code that they call have
 * their place here. Memory that runs out and what the library ends the program for leave it by
 * longjmp; what it holds then is freed with the heap behind the hooks, and no destructor needs to
 * run.
 */
#include <algorithm>
#include <array>
#include <cassert>
#include <cinttypes>
#include <climits>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <iostream>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <queue>
#include <set>
#include <setjmp.h>
#include <sstream>
#include <stack>
#include <string>
#include <type_traits>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

extern "C" {
#include "../memory_account.h"
}

namespace {

enum { rl_done, rl_exhausted, rl_broken };

struct rl_call {
    const rl_memory *memory;
    jmp_buf left;
};

thread_local rl_call *rl_now;

void *rl_allocate(size_t size) {
    void *memory = rl_now->memory->allocate(rl_now->memory->user, size);
    if (memory == nullptr) longjmp(rl_now->left, rl_exhausted);
    return memory;
}

void rl_release(void *memory) {
    if (memory != nullptr) rl_now->memory->release(rl_now->memory->user, memory);
}

} // namespace

void *operator new(size_t size) { return rl_allocate(size); }
void *operator new[](size_t size) { return rl_allocate(size); }
void operator delete(void *memory) noexcept { rl_release(memory); }
void operator delete[](void *memory) noexcept { rl_release(memory); }
void operator delete(void *memory, size_t) noexcept { rl_release(memory); }
void operator delete[](void *memory, size_t) noexcept { rl_release(memory); }
extern "C" void __cxa_pure_virtual() { longjmp(rl_now->left, rl_broken); }

namespace std {
inline namespace __1 {
void __libcpp_verbose_abort(const char *, ...) noexcept { longjmp(rl_now->left, rl_broken); }

/* The smallest prime that is not below a number: how large a hash table becomes. */
size_t __next_prime(size_t least) {
    for (size_t candidate = max(least, size_t(2));; candidate++) {
        size_t divisor = 2;
        while (divisor <= candidate / divisor && candidate % divisor != 0) divisor++;
        if (divisor > candidate / divisor) return candidate;
    }
}

template class basic_string<char>;
} // namespace __1
} // namespace std

namespace {

/* Draco adds hashes of its types to those of the library, as far as it can see that. */
namespace std {
using namespace ::std;
template <class Key> struct hash : ::std::hash<Key> {};
template <class Key, class Value, class Hash = hash<Key>>
using unordered_map = ::std::unordered_map<Key, Value, Hash>;
template <class Key, class Hash = hash<Key>>
using unordered_set = ::std::unordered_set<Key, Hash>;
} // namespace std

#include "draco/attributes/attribute_octahedron_transform.cc"
#include "draco/attributes/attribute_quantization_transform.cc"
#include "draco/attributes/attribute_transform.cc"
#include "draco/attributes/geometry_attribute.cc"
#include "draco/attributes/point_attribute.cc"
#include "draco/compression/attributes/attributes_decoder.cc"
#include "draco/compression/attributes/sequential_attribute_decoder.cc"
#include "draco/compression/attributes/sequential_attribute_decoders_controller.cc"
#include "draco/compression/attributes/sequential_integer_attribute_decoder.cc"
#include "draco/compression/attributes/sequential_normal_attribute_decoder.cc"
#include "draco/compression/attributes/sequential_quantization_attribute_decoder.cc"
#include "draco/compression/bit_coders/direct_bit_decoder.cc"
#include "draco/compression/bit_coders/rans_bit_decoder.cc"
#include "draco/compression/bit_coders/symbol_bit_decoder.cc"
#include "draco/compression/entropy/symbol_decoding.cc"
#include "draco/compression/mesh/mesh_decoder.cc"
#include "draco/compression/mesh/mesh_edgebreaker_decoder.cc"
#include "draco/compression/mesh/mesh_edgebreaker_decoder_impl.cc"
#include "draco/compression/mesh/mesh_sequential_decoder.cc"
#include "draco/compression/point_cloud/point_cloud_decoder.cc"
#include "draco/core/bit_utils.cc"
#include "draco/core/bounding_box.cc"
#include "draco/core/data_buffer.cc"
#include "draco/core/decoder_buffer.cc"
#include "draco/core/divide.cc"
#include "draco/core/draco_types.cc"
#include "draco/core/hash_utils.cc"
#include "draco/core/options.cc"
#include "draco/core/quantization_utils.cc"
#include "draco/mesh/corner_table.cc"
#include "draco/mesh/mesh.cc"
#include "draco/mesh/mesh_attribute_corner_table.cc"
#include "draco/metadata/geometry_metadata.cc"
#include "draco/metadata/metadata.cc"
#include "draco/metadata/metadata_decoder.cc"
#include "draco/point_cloud/point_cloud.cc"

template <class Decoder>
bool rl_decode(draco::DecoderBuffer *buffer, draco::Mesh *mesh) {
    Decoder decoder;
    return decoder.Decode(draco::DecoderOptions(), buffer, mesh).ok();
}

/* The numbers of all vertices, converted as Draco converts them for glTF. */
template <class Number>
bool rl_convert(const draco::Mesh &mesh, const draco::PointAttribute &attribute,
                uint32_t component_count, void *out) {
    Number *numbers = static_cast<Number *>(out);
    for (draco::PointIndex vertex(0); vertex < mesh.num_points(); ++vertex) {
        const draco::AttributeValueIndex index = attribute.mapped_index(vertex);
        if (index >= attribute.size() ||
            !attribute.ConvertValue<Number>(index, component_count, numbers))
            return false;
        numbers += component_count;
    }
    return true;
}

} // namespace

/* In the order of draco.zig. */
struct rl_draco_mesh {
    const draco::Mesh *mesh;
    uint32_t vertex_count, triangle_count;
};

/* The mesh, in memory of the hooks. */
extern "C" int rl_draco_decode(const rl_memory *memory, const char *bytes, size_t byte_count,
                               rl_draco_mesh *out) {
    rl_call call;
    call.memory = memory;
    rl_now = &call;
    const int left = setjmp(call.left);
    if (left != 0) return left;
    draco::DecoderBuffer *buffer = new draco::DecoderBuffer();
    buffer->Init(bytes, byte_count);
    draco::Mesh *mesh = new draco::Mesh();
    const bool is_sequential = bytes[8] == draco::MESH_SEQUENTIAL_ENCODING;
    if (!(is_sequential ? rl_decode<draco::MeshSequentialDecoder>(buffer, mesh)
                        : rl_decode<draco::MeshEdgebreakerDecoder>(buffer, mesh)))
        return rl_broken;
    out->mesh = mesh;
    out->vertex_count = mesh->num_points();
    out->triangle_count = mesh->num_faces();
    return rl_done;
}

/* The vertices of all triangles, each any number. */
extern "C" void rl_draco_triangles(const rl_draco_mesh *mesh, uint32_t (*out)[3]) {
    for (draco::FaceIndex index(0); index < mesh->triangle_count; ++index)
        for (int corner = 0; corner < 3; corner++)
            out[index.value()][corner] = mesh->mesh->face(index)[corner].value();
}

/* An attribute of all vertices; false where there is none, or where its numbers do not fit.
 * `component` is one of draco.zig's. */
extern "C" bool rl_draco_attribute(const rl_draco_mesh *mesh, uint32_t id, uint32_t component,
                                   uint32_t component_count, void *out) {
    const draco::PointAttribute *attribute = mesh->mesh->GetAttributeByUniqueId(id);
    if (attribute == nullptr || attribute->buffer() == nullptr) return false;
    if (!attribute->is_mapping_identity() && attribute->indices_map_size() < mesh->vertex_count)
        return false;
    if (attribute->byte_offset() + attribute->byte_stride() * int64_t(attribute->size()) >
        int64_t(attribute->buffer()->data_size()))
        return false;
    switch (component) {
    case 0: return rl_convert<int8_t>(*mesh->mesh, *attribute, component_count, out);
    case 1: return rl_convert<uint8_t>(*mesh->mesh, *attribute, component_count, out);
    case 2: return rl_convert<int16_t>(*mesh->mesh, *attribute, component_count, out);
    case 3: return rl_convert<uint16_t>(*mesh->mesh, *attribute, component_count, out);
    case 4: return rl_convert<uint32_t>(*mesh->mesh, *attribute, component_count, out);
    default: return rl_convert<float>(*mesh->mesh, *attribute, component_count, out);
    }
}
