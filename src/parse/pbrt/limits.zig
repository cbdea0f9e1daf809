//! Limits of PBRT: how much a text may ask for, so that a short one cannot take all memory.
//!
//! Each limit has its own message where it is checked. Real files stay far below.

/// All text of a scene, each file as often as it is included, in bytes.
pub const text_bytes_max: u64 = 4 << 30;
/// Files open at a time, each included by the one before.
pub const include_depth_max = 64;
/// Files included altogether.
pub const include_count_max = 10_000;
/// Attributes, transforms and objects that are begun and not yet ended.
pub const attribute_depth_max = 1 << 16;
/// Parameters of one directive.
pub const parameter_count_max = 256;
/// Instances of meshes in a scene.
pub const instance_count_max: u64 = 1 << 24;
/// Times that a control mesh is subdivided; more is taken as this.
pub const subdivision_count_max = 8;
/// Largest order of a NURBS.
pub const nurbs_order_max = 32;
/// Points on the side of a height field.
pub const heightfield_side_max = 1 << 15;
/// Layers of mixed materials and of textures that refer to each other have no limit of their own:
/// both are resolved when they are named.
/// Bytes that vertices and triangles may take, for texts and PLY files of `input_bytes`: curved
/// shapes and subdivision make many of few.
pub fn decodedBytesMax(input_bytes: u64) u64 {
    return (1 << 30) + 64 * input_bytes;
}
