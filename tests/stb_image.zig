//! stb_image as far as the tests call it: its decoder of pictures that are in memory.

/// The pixels of a picture, `wanted` channels each or as many as it has, or null.
pub extern fn stbi_load_from_memory(
    file: [*]const u8,
    byte_count: c_int,
    width: *c_int,
    height: *c_int,
    channels: *c_int,
    wanted: c_int,
) [*c]u8;

/// Frees what `stbi_load_from_memory` gave.
pub extern fn stbi_image_free(pixels: ?*anyopaque) void;
