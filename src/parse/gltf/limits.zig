//! Limits of glTF: how much a file may ask for, so that a short one cannot take all memory.
//!
//! Each limit has its own message where it is checked. Real files stay far below.

/// The JSON text, data URIs included, in bytes.
pub const json_bytes_max: u64 = 1 << 30;
/// All buffers of a file together, in bytes.
pub const buffer_bytes_max: u64 = 8 << 30;
/// Elements of an accessor: 32-bit indices reach no further.
pub const accessor_count_max: u64 = (1 << 31) - 1;
/// Elements of an accessor without data, which stand in no relation to the file's size.
pub const zero_count_max: u64 = 1 << 24;
/// Instances of meshes in a scene.
pub const instance_count_max: u64 = 1 << 24;

/// Bytes that cgltf may allocate for a JSON text of `json_bytes`.
pub fn heapBytesMax(json_bytes: u64) u64 {
    return (256 << 20) + 64 * json_bytes;
}

/// Bytes that decoded vertices and triangles may take, for a file and buffers of `input_bytes`.
/// Accessors may share their bytes, so the input alone is no bound.
pub fn decodedBytesMax(input_bytes: u64) u64 {
    return (512 << 20) + 64 * input_bytes;
}
