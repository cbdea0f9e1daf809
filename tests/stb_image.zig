//! stb_image, as far as the tests of the output stage decode by it.

/// 8 bits a channel; null where the file is none that it knows. Free with `stbi_image_free`.
pub extern fn stbi_load_from_memory(
    file: [*]const u8,
    file_bytes: c_int,
    width: *c_int,
    height: *c_int,
    channels: *c_int,
    /// 0: as many as the file has, which `channels` tells in any case.
    desired_channels: c_int,
) ?[*]u8;

/// Floats, of a file of floats as they are.
pub extern fn stbi_loadf_from_memory(
    file: [*]const u8,
    file_bytes: c_int,
    width: *c_int,
    height: *c_int,
    channels: *c_int,
    desired_channels: c_int,
) ?[*]align(16) f32;

pub extern fn stbi_image_free(pixels: *anyopaque) void;
