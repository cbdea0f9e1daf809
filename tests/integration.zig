//! The index of the tests that see Raylane from outside: `@import("raylane")` and nothing below it.
//!
//! Each file of tests beside this one is named here once; a file that is not is never compiled.
//! Pictures are decoded by stb_image, which is not what wrote them.

const std = @import("std");
const builtin = @import("builtin");
const testing = std.testing;
const stb_image = @import("stb_image.zig");

test {
    _ = @import("analytic.zig");
    _ = @import("strokes.zig");
    _ = @import("decode.zig");
    _ = @import("environment.zig");
    _ = @import("exhaustion.zig");
    _ = @import("forgiven.zig");
    _ = @import("formats.zig");
    _ = @import("garbage.zig");
    _ = @import("fuzz.zig");
    _ = @import("glass.zig");
    _ = @import("gltf_animations.zig");
    _ = @import("gltf_materials.zig");
    _ = @import("gltf_instances.zig");
    _ = @import("gltf_poses.zig");
    _ = @import("gltf_quantization.zig");
    _ = @import("gltf_textures.zig");
    _ = @import("instances.zig");
    _ = @import("integrators.zig");
    _ = @import("light_sampling.zig");
    _ = @import("lights.zig");
    _ = @import("malformed.zig");
    _ = @import("meshes.zig");
    _ = @import("offset.zig");
    _ = @import("output.zig");
    _ = @import("parts.zig");
    _ = @import("path.zig");
    _ = @import("pbrt.zig");
    _ = @import("pbrt_forgiven.zig");
    _ = @import("pbrt_textures.zig");
    _ = @import("poses.zig");
    _ = @import("samples.zig");
    _ = @import("beams.zig");
    _ = @import("soup.zig");
    _ = @import("textures.zig");
    _ = @import("variants.zig");
}

test "bounds of beams against 128-bit floats" {
    // LLVM refuses what Zig makes of vectors of them for this processor.
    if (builtin.cpu.arch == .arm) return error.SkipZigTest;
    _ = @import("bounds.zig");
}

test "the decoder of pictures decodes a PNG, and no format that it is not asked for" {
    // Two by one pixels of RGB: red, then (0, 128, 255).
    const png = "\x89PNG\r\n\x1a\n" ++
        "\x00\x00\x00\x0dIHDR\x00\x00\x00\x02\x00\x00\x00\x01\x08\x02\x00\x00\x00" ++
        "\x7b\x40\xe8\xdd" ++
        "\x00\x00\x00\x12IDAT\x78\x01\x01\x07\x00\xf8\xff" ++
        "\x00\xff\x00\x00\x00\x80\xff\x08\x00\x02\x7f\xd5\x70\x6e\xaa" ++
        "\x00\x00\x00\x00IEND\xae\x42\x60\x82";
    var width: c_int = 0;
    var height: c_int = 0;
    var channels: c_int = 0;
    const load = stb_image.stbi_load_from_memory;
    const pixels = load(png, png.len, &width, &height, &channels, 3) orelse
        return error.NotDecoded;
    defer stb_image.stbi_image_free(pixels);
    try testing.expectEqual(2, width);
    try testing.expectEqual(1, height);
    try testing.expectEqualSlices(u8, &.{ 255, 0, 0, 0, 128, 255 }, pixels[0..6]);

    const ppm = "P6 1 1 255\nabc";
    try testing.expectEqual(null, load(ppm, ppm.len, &width, &height, &channels, 3));
}
