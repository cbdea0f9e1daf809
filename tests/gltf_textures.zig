//! glTF's textures as the scene has them: which pictures are read, how they are looked up, with
//! which coordinates; and what becomes of those that cannot be had.
//!
//! In: a triangle with every kind of texture, changed in one place. Out: the scene's images (their
//! bytes are any text: nothing here decodes), textures, materials, coordinates, and warnings.

const std = @import("std");
const raylane = @import("raylane");
const texts = @import("gltf_text.zig");
const Diagnostic = raylane.diagnostic.Diagnostic;
const Replacement = texts.Replacement;
const Scene = raylane.scene.Scene;
const parse = raylane.parse;
const testing = std.testing;
const gpa = testing.allocator;
const io = testing.io;

/// `$DATA` stands for the buffer, in base64; image 1's data URI holds "second".
const document =
    \\{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
    \\"extensionsUsed":["KHR_texture_transform","EXT_texture_webp","KHR_texture_basisu",
    \\"KHR_mesh_quantization"],
    \\"meshes":[{"primitives":[{"material":0,"attributes":{"POSITION":0,"NORMAL":1,"TANGENT":2,
    \\"TEXCOORD_0":3,"TEXCOORD_1":4,"TEXCOORD_2":5,"TEXCOORD_3":6}}]}],
    \\"materials":[{
    \\"pbrMetallicRoughness":{"baseColorTexture":{"index":0,"texCoord":1,
    \\"extensions":{"KHR_texture_transform":{"offset":[0.25,0.5],"scale":[2,3],"texCoord":2}}},
    \\"metallicRoughnessTexture":{"index":1}},
    \\"normalTexture":{"index":1,"texCoord":1,"scale":-0.5},
    \\"occlusionTexture":{"index":2,"texCoord":3,"strength":0.75},
    \\"emissiveTexture":{"index":3},"emissiveFactor":[1,0.5,0.25]},
    \\{"emissiveTexture":{"index":4}}],
    \\"textures":[{"source":0},{"source":1,"sampler":0},{"source":2,"sampler":1},
    \\{"source":1,"sampler":2},{"source":3}],
    \\"samplers":[{"magFilter":9728,"minFilter":9984,"wrapS":33071,"wrapT":33648},
    \\{"magFilter":9729,"minFilter":9729,"wrapS":10497},{"minFilter":9986}],
    \\"images":[{"name":"fi\u0072st","bufferView":7},{"uri":"data:image/png;base64,c2Vjb25k"},
    \\{"uri":"a%20b.png"},{"uri":"missing.png"},{"bufferView":7}],
    \\"accessors":[
    \\{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
    \\{"bufferView":1,"componentType":5126,"count":3,"type":"VEC3"},
    \\{"bufferView":2,"componentType":5126,"count":3,"type":"VEC4"},
    \\{"bufferView":3,"componentType":5126,"count":3,"type":"VEC2"},
    \\{"bufferView":4,"componentType":5121,"count":3,"type":"VEC2","normalized":true},
    \\{"bufferView":5,"componentType":5123,"count":3,"type":"VEC2","normalized":true},
    \\{"bufferView":6,"componentType":5122,"count":3,"type":"VEC2"}],
    \\"bufferViews":[
    \\{"buffer":0,"byteOffset":0,"byteLength":36},
    \\{"buffer":0,"byteOffset":36,"byteLength":36},
    \\{"buffer":0,"byteOffset":72,"byteLength":48},
    \\{"buffer":0,"byteOffset":120,"byteLength":24},
    \\{"buffer":0,"byteOffset":144,"byteLength":12,"byteStride":4},
    \\{"buffer":0,"byteOffset":156,"byteLength":12},
    \\{"buffer":0,"byteOffset":168,"byteLength":12},
    \\{"buffer":0,"byteOffset":180,"byteLength":5},
    \\{"buffer":0,"byteOffset":180,"byteLength":5}],
    \\"buffers":[{"byteLength":188,"uri":"data:application/octet-stream;base64,$DATA"}]}
;

/// The document's buffer, as floats and bytes in the order of its views.
fn makeBuffer() [188]u8 {
    var bytes: [188]u8 = @splat(0);
    texts.putFloats(bytes[0..], &.{ 0, 0, 0, 1, 0, 0, 0, 1, 0 }); // Positions.
    texts.putFloats(bytes[36..], &.{ 0, 0, 1, 0, 0, 1, 0, 0, 1 }); // Normals.
    texts.putFloats(bytes[72..], &.{ 1, 0, 0, 1, 1, 0, 0, -1, 0, 1, 0, 0.5 }); // Tangents.
    texts.putFloats(bytes[120..], &.{ 0, 0, -2, 3.5, 0.25, 0.75 });
    bytes[144..156].* = .{ 0, 255, 0xee, 0xee, 51, 102, 0xee, 0xee, 255, 0, 0xee, 0xee };
    const shorts = [6]u16{ 0, 65535, 13107, 26214, 65535, 0 };
    const quantized = [6]i16{ 0, 1, -2, 300, 5, -32768 };
    for (shorts, quantized, 0..) |short, whole, index| {
        std.mem.writeInt(u16, bytes[156 + 2 * index ..][0..2], short, .little);
        std.mem.writeInt(i16, bytes[168 + 2 * index ..][0..2], whole, .little);
    }
    bytes[180..185].* = "first".*;
    return bytes;
}

/// The document with each first occurrence replaced. The caller frees it.
fn makeText(replacements: []const Replacement) ![]u8 {
    return texts.make(document, &makeBuffer(), replacements);
}

/// A folder with the files that the document names.
const Folder = struct {
    temporary: std.testing.TmpDir,

    fn make() !Folder {
        const folder: Folder = .{ .temporary = testing.tmpDir(.{}) };
        const dir = folder.temporary.dir;
        try dir.writeFile(io, .{ .sub_path = "a b.png", .data = "third" });
        try dir.createDir(io, "sub", .default_dir);
        try dir.hardLink("a b.png", dir, "sub/hard.png", io, .{});
        try dir.writeFile(io, .{ .sub_path = "other.png", .data = "third" });
        return folder;
    }

    fn free(folder: *Folder) void {
        folder.temporary.cleanup();
    }

    fn read(folder: *Folder, replacements: []const Replacement, said: *Diagnostic) !Scene {
        const text = try makeText(replacements);
        defer gpa.free(text);
        return folder.readText(gpa, text, .{}, said);
    }

    fn readText(
        folder: *Folder,
        allocator: std.mem.Allocator,
        text: []const u8,
        settings: raylane.settings.Load,
        said: *Diagnostic,
    ) !Scene {
        const dir = folder.temporary.dir;
        const scene = try parse.parseBytes(allocator, io, text, dir, settings, said);
        scene.check();
        return scene;
    }
};

test "textures, samplers, transforms and coordinates are those of the file" {
    var folder: Folder = try .make();
    defer folder.free();
    var said: Diagnostic = .{};
    var scene = try folder.read(&.{}, &said);
    defer scene.deinit();
    try testing.expectEqual(0, said.warning_count);

    const names = [_][]const u8{ "image 0 'first'", "image 1", "image 2 'a b.png'" };
    try testing.expectEqual(names.len, scene.images.len);
    for (scene.images, names, [_][]const u8{ "first", "second", "third" }) |image, name, bytes| {
        try testing.expectEqualStrings(name, image.name);
        try testing.expectEqualStrings(bytes, image.bytes);
    }
    const expected = [_]raylane.scene.Texture{
        .{ .image = 0 },
        .{
            .image = 1,
            .wrap = .{ .clamp_to_edge, .mirrored_repeat },
            .magnify = .nearest,
            .minify = .nearest,
            .mip = .nearest,
        },
        .{ .image = 2, .mip = .none },
        .{ .image = 1, .minify = .nearest, .mip = .linear },
    };
    try testing.expectEqualSlices(raylane.scene.Texture, &expected, scene.textures);

    const material = &scene.materials[0];
    try testing.expectEqual(raylane.scene.TextureView{
        .texture = 0,
        .texcoord_set = 2,
        .transform = .{ .{ 2, 0, 0.25 }, .{ 0, 3, 0.5 } },
        .parts = .{ .offset = .{ 0.25, 0.5 }, .scale = .{ 2, 3 } },
    }, material.base_color_texture.?);
    try testing.expectEqual(raylane.scene.TextureView{
        .texture = 1,
        .texcoord_set = 1,
    }, material.normal_texture.?);
    try testing.expectEqual(1, material.metallic_roughness_texture.?.texture);
    try testing.expectEqual(1, material.metallic);
    try testing.expectEqual(-0.5, material.normal_scale);
    try testing.expectEqual(3, material.occlusion_texture.?.texcoord_set);
    try testing.expectEqual(0.75, material.occlusion_strength);
    try testing.expectEqual(3, material.emissive_texture.?.texture);
    try testing.expectEqual([3]f32{ 1, 0.5, 0.25 }, material.emissive);
    // Nothing is drawn with it.
    try testing.expectEqual(null, scene.materials[1].emissive_texture);

    const mesh = &scene.meshes[0];
    const sets = [4][3][2]f32{
        .{ .{ 0, 0 }, .{ -2, 3.5 }, .{ 0.25, 0.75 } },
        .{ .{ 0, 1 }, .{ 0.2, 0.4 }, .{ 1, 0 } },
        .{ .{ 0, 1 }, .{ 0.2, 0.4 }, .{ 1, 0 } },
        .{ .{ 0, 1 }, .{ -2, 300 }, .{ 5, -32768 } },
    };
    for (mesh.texcoords, sets) |set, wanted| {
        try testing.expectEqualSlices([2]f32, &wanted, set.?);
    }
    try testing.expectEqualSlices(
        [4]f32,
        &.{ .{ 1, 0, 0, 1 }, .{ 1, 0, 0, -1 }, .{ 0, 1, 0, 1 } },
        mesh.tangents.?,
    );
}

test "what no texture looks at is not decoded" {
    var folder: Folder = try .make();
    defer folder.free();
    var said: Diagnostic = .{};
    const cases = [_]struct { []const Replacement, [4]bool, bool }{
        .{ &.{.{ "\"material\":0,", "" }}, .{ false, false, false, false }, false },
        .{ &.{.{ "\"material\":0,", "\"material\":1," }}, .{ false, false, false, false }, false },
        .{ &.{.{ "\"normalTexture\"", "\"x\"" }}, .{ true, false, true, true }, false },
        // Tangents count for nothing without normals.
        .{ &.{.{ "\"NORMAL\":1,", "" }}, .{ true, true, true, true }, false },
        .{ &.{.{ "\"TANGENT\":2,", "" }}, .{ true, true, true, true }, false },
    };
    for (cases) |case| {
        var scene = try folder.read(case[0], &said);
        defer scene.deinit();
        errdefer std.debug.print("{s}\n", .{case[0][0].@"0"});
        for (scene.meshes[0].texcoords, case[1]) |set, wanted| {
            try testing.expectEqual(wanted, set != null);
        }
        try testing.expectEqual(case[2], scene.meshes[0].tangents != null);
    }
}

test "the same picture is one image, the same texture one texture" {
    var folder: Folder = try .make();
    defer folder.free();
    const second = "{\"uri\":\"data:image/png;base64,c2Vjb25k\"}";
    const cases = [_]struct { Replacement, usize, usize }{
        .{ .{ second, "{\"bufferView\":8}" }, 2, 4 }, // The bytes of view 7.
        .{ .{ second, "{\"uri\":\"./sub/../a b.png\"}" }, 2, 4 },
        .{ .{ second, "{\"uri\":\".\\\\sub%5Chard.png\"}" }, 2, 4 },
        .{ .{ second, "{\"uri\":\"other.png\"}" }, 3, 4 }, // Another file with the same bytes.
        .{ .{ "{\"source\":1,\"sampler\":2}", "{\"source\":1,\"sampler\":0}" }, 3, 3 },
        .{ .{ "{\"source\":2,\"sampler\":1}", "{\"source\":0}" }, 2, 3 },
    };
    for (cases) |case| {
        var said: Diagnostic = .{};
        var scene = try folder.read(&.{case[0]}, &said);
        defer scene.deinit();
        errdefer std.debug.print("{s}\n", .{case[0].@"1"});
        const is_odd = std.mem.find(u8, case[0].@"1", "%5C") != null;
        try testing.expectEqual(@intFromBool(is_odd), said.warning_count);
        try testing.expectEqual(case[1], scene.images.len);
        try testing.expectEqual(case[2], scene.textures.len);
    }
}

test "WebP and Basis are preferred where they can be had" {
    var folder: Folder = try .make();
    defer folder.free();
    const webp = "{\"extensions\":{\"EXT_texture_webp\":{\"source\":2}},\"source\":0}";
    const basis = "{\"extensions\":{\"KHR_texture_basisu\":{\"source\":2}}}";
    const missing = "{\"extensions\":{\"EXT_texture_webp\":{\"source\":3}},\"source\":0}";
    for ([_][]const u8{ webp, basis, missing }, 0..) |texture, index| {
        var said: Diagnostic = .{};
        var scene = try folder.read(&.{.{ "{\"source\":0}", texture }}, &said);
        defer scene.deinit();
        const view = scene.materials[0].base_color_texture.?;
        const image = scene.images[scene.textures[view.texture].image];
        const wanted = if (index == 2) "first" else "third";
        try testing.expectEqualStrings(wanted, image.bytes);
        try testing.expectEqual(@intFromBool(index == 2), said.warning_count);
    }
}

test "specular-glossiness: the diffuse texture is the base colour's" {
    var folder: Folder = try .make();
    defer folder.free();
    var said: Diagnostic = .{};
    var scene = try folder.read(&.{
        .{ "\"pbrMetallicRoughness\":{\"baseColorTexture\"", "\"extensions\":" ++
            "{\"KHR_materials_pbrSpecularGlossiness\":{\"diffuseTexture\"" },
        .{ "\"metallicRoughnessTexture\":{\"index\":1}}", "\"glossinessFactor\":0.75}}" },
    }, &said);
    defer scene.deinit();
    try testing.expectEqual(2, scene.materials[0].base_color_texture.?.texcoord_set);
    try testing.expectEqual(0.25, scene.materials[0].roughness);
    try testing.expectEqual(0, scene.materials[0].metallic);
}

const second_image = "{\"uri\":\"data:image/png;base64,c2Vjb25k\"}";

const base_set = "\"texCoord\":2}";

test "a texture that cannot be had is a warning and its factor" {
    var folder: Folder = try .make();
    defer folder.free();
    const cases = [_]struct { Replacement, []const u8 }{
        .{ .{ "a%20b.png", "no.png" }, "image 2: 'no.png' does not exist, left out" },
        .{ .{ "a%20b.png", "sub" }, "image 2: 'sub' is a folder, left out" },
        .{ .{ "a%20b.png", "" }, "image 2: '' is not a valid path, left out" },
        .{ .{ "a%20b.png", "a%00" }, "image 2: 'a?' is not a valid path, left out" },
        .{
            .{ "a%20b.png", "../a" },
            "image 2: '../a' is outside the scene's folder (see --allow-outside), left out",
        },
        .{ .{ "a%20b.png", "https://a/b" }, "image 2: URIs of the scheme 'https' are not read, " ++
            "only files and data, left out" },
        .{ .{ "a%20b.png", "data:image/png,a" }, "image 2: its data URI is not base64, left out" },
        .{ .{ "{\"uri\":\"a%20b.png\"}", "{}" }, "image 2: has neither bufferView nor uri, " ++
            "left out" },
        .{ .{ "{\"source\":2,", "{" }, "texture 2: has no image that can be read, left out" },
        .{ .{ "{\"bufferView\":7}],", "{\"bufferView\":9}]," }, "images[4].bufferView: " ++
            "9 of 9; nothing drawn needs it" },
        .{ .{ "180,\"byteLength\":5}],", "180,\"byteLength\":9}]," }, "buffer view 8: 1 bytes " ++
            "past its buffer 0; nothing drawn needs it" },
        .{ .{ base_set, "\"rotation\":1e9}" }, "material 0: baseColorTexture: its rotation is " ++
            "out of range, left out" },
        .{ .{ "\"magFilter\":9728", "\"magFilter\":9984" }, "texture 1: its sampler's magFilter " ++
            "9984 is not known, ignored" },
        .{ .{ "\"minFilter\":9984", "\"minFilter\":9e0" }, "texture 1: its sampler's minFilter " ++
            "9 is not known, ignored" },
        .{ .{ "\"wrapT\":33648", "\"wrapT\":10496" }, "texture 1: its sampler's wrapT 10496 is " ++
            "not known, ignored" },
        .{ .{ "\"strength\":0.75", "\"strength\":2" }, "material 0: occlusionTexture.strength 2 " ++
            "is not in 0..1, clamped" },
        .{ .{ ",\"TEXCOORD_3\":6", "" }, "mesh 0, primitive 0: without TEXCOORD_3, where its " ++
            "material's textures look: taken as 0" },
    };
    for (cases) |case| {
        var said: Diagnostic = .{};
        errdefer std.debug.print("{s}: {s}\n", .{ case[0].@"1", said.message.text() });
        var scene = try folder.read(&.{case[0]}, &said);
        defer scene.deinit();
        try testing.expectEqual(1, said.warning_count);
        try testing.expectEqualStrings(case[1], said.warnings[0].text());
    }
}

test "images that overlap are left out before they are copied again and again" {
    var folder: Folder = try .make();
    defer folder.free();
    var said: Diagnostic = .{};
    var scene = try folder.read(&.{
        .{ second_image, "{\"bufferView\":9}" },
        .{ "\"byteLength\":5}],", "\"byteLength\":5},{\"buffer\":0,\"byteLength\":186}]," },
    }, &said);
    defer scene.deinit();
    try testing.expectEqual(1, said.warning_count);
    const expected = "image 1: images of the file overlap, left out";
    try testing.expectEqualStrings(expected, said.warnings[0].text());
    try testing.expectEqual(2, scene.images.len);
}

test "without its coordinates a normal texture bends nothing, others show their corner" {
    var folder: Folder = try .make();
    defer folder.free();
    var said: Diagnostic = .{};
    var scene = try folder.read(&.{.{ "\"TEXCOORD_1\":4,", "" }}, &said);
    defer scene.deinit();
    try testing.expectEqual(1, said.warning_count);
    const mesh = &scene.meshes[0];
    try testing.expectEqual(2, mesh.material);
    try testing.expectEqual(null, mesh.texcoords[1]);
    try testing.expectEqual(null, scene.materials[2].normal_texture);
    try testing.expect(scene.materials[2].base_color_texture != null);
    try testing.expect(scene.materials[0].normal_texture != null);
}

const surrounded: Replacement = .{
    "\"scenes\":[{\"nodes\":[0]}]",
    "\"extensions\":{\"EXT_lights_image_based\":{\"lights\":[{\"intensity\":2.5," ++
        "\"rotation\":[0,1,0,0],\"specularImageSize\":4,\"irradianceCoefficients\":[[0,0,0]]," ++
        "\"specularImages\":[[0,1,2,1,4,0],[3,3,3,3,3,3]]}]}}," ++
        "\"scenes\":[{\"nodes\":[0],\"extensions\":{\"EXT_lights_image_based\":{\"light\":0}}}]",
};

test "a scene with an image-based light is surrounded by its finest cube" {
    var folder: Folder = try .make();
    defer folder.free();
    var said: Diagnostic = .{};
    var scene = try folder.read(&.{surrounded}, &said);
    defer scene.deinit();
    try testing.expectEqual(0, said.warning_count);
    const map = &scene.environment.?;
    try testing.expectEqual(.cube, map.projection);
    // Images 0 and 4 of the file are the same bytes, 3 is not read.
    try testing.expectEqual([6]u32{ 0, 1, 2, 1, 0, 0 }, map.faces);
    try testing.expectEqual([3]f32{ 2.5, 2.5, 2.5 }, map.scale);
    // Half a turn about y.
    for (map.rotation.direction(.{ 1, 2, 3 }), [3]f64{ -1, 2, -3 }) |value, wanted| {
        try testing.expectApproxEqAbs(wanted, value, 1e-12);
    }
    for ([_]struct { Replacement, []const u8 }{
        .{ .{ "\"light\":0", "\"light\":1" }, "names a light that is not there" },
        .{ .{ "[[0,1,2,1,4,0]", "[[0,1,2,1,4]" }, "has no cube of six images" },
        .{ .{ "[[0,1,2,1,4,0]", "[[0,1,2,1,5,0]" }, "names an image that is not there" },
        .{ .{ "[[0,1,2,1,4,0],[3,3,3,3,3,3]]", "[]" }, "has no cube of six images" },
        .{ .{ "[0,1,0,0]", "[0,0,0,0]" }, "has a rotation that is none" },
        .{ .{ "\"intensity\":2.5", "\"intensity\":-1" }, "is not bright" },
    }) |case| {
        var wrong: Diagnostic = .{};
        var dark = try folder.read(&.{ surrounded, case[0] }, &wrong);
        defer dark.deinit();
        try testing.expectEqual(null, dark.environment);
        try testing.expectEqual(1, wrong.warning_count);
        var line: Diagnostic = .{};
        line.warn("EXT_lights_image_based {s}, left out", .{case[1]});
        try testing.expectEqualStrings(line.warnings[0].text(), wrong.warnings[0].text());
    }
    var missing: Diagnostic = .{};
    var dark = try folder.read(&.{ surrounded, .{ "[[0,1,2,1,4,0]", "[[0,1,2,1,3,0]" } }, &missing);
    defer dark.deinit();
    try testing.expectEqual(null, dark.environment);
    try testing.expectEqual(2, missing.warning_count);
}

test "coordinates of a set that is not read are left out, of one that is not there an error" {
    var folder: Folder = try .make();
    defer folder.free();
    var said: Diagnostic = .{};
    var scene = try folder.read(&.{
        .{ ",\"TEXCOORD_3\":6", ",\"TEXCOORD_3\":6,\"TEXCOORD_4\":6" },
        .{ base_set, "\"texCoord\":4}" },
    }, &said);
    defer scene.deinit();
    try testing.expectEqual(1, said.warning_count);
    const expected = "material 0: baseColorTexture: only TEXCOORD_0 to TEXCOORD_3 are read, " ++
        "left out";
    try testing.expectEqualStrings(expected, said.warnings[0].text());
}

test "what is wrong in the document itself is an error" {
    var folder: Folder = try .make();
    defer folder.free();
    const no_set = "material 0: baseColorTexture: there is no TEXCOORD of its texCoord";
    const cases = [_]struct { Replacement, []const u8 }{
        .{ .{ "{\"source\":2,", "{\"source\":5," }, "textures[2].source: 5 of 5" },
        .{ .{ "\"sampler\":1}", "\"sampler\":3}" }, "textures[2].sampler: 3 of 3" },
        .{ .{ "{\"source\":2,", "{\"source\":4294967295," }, "textures[2].source: 4294967295 " ++
            "names nothing, lists have 4194304 elements at most" },
        .{ .{ "{\"index\":2,", "{\"index\":5," }, "materials[0].occlusionTexture.index: 5 of 5" },
        .{ .{ "\"texCoord\":3", "\"texCoord\":-1" }, "materials[0].occlusionTexture.texCoord: " ++
            "-1 is not a whole number from 0 to 2^53 - 1" },
        .{ .{ base_set, "\"texCoord\":4}" }, no_set },
        .{ .{ base_set, "\"texCoord\":2147483648}" }, no_set },
        .{ .{ "\"scale\":[2,3]", "\"scale\":[2]" }, "materials[0].pbrMetallicRoughness." ++
            "baseColorTexture.extensions.KHR_texture_transform.scale: 2 numbers are expected" },
        .{
            .{ "3,\"componentType\":5126", "3,\"componentType\":5125" },
            "mesh 0, primitive 0: accessor 3 has no type for 'TEXCOORD_0'",
        },
        .{ .{ "\"bufferView\":5,\"componentType\":5123,\"count\":3", "\"bufferView\":5," ++
            "\"componentType\":5123,\"count\":2" }, "mesh 0, primitive 0: accessor 5 has 2 " ++
            "elements for 3 vertices" },
    };
    for (cases) |case| {
        var said: Diagnostic = .{};
        errdefer std.debug.print("{s}: {s}\n", .{ case[0].@"1", said.warnings[0].text() });
        if (folder.read(&.{case[0]}, &said)) |read_one| {
            var scene = read_one;
            scene.deinit();
            return error.TestUnexpectedResult;
        } else |err| try testing.expectEqual(error.InvalidInput, err);
        try testing.expectEqualStrings(case[1], said.message.text());
    }
}

test "a texture that the output would overwrite is an error" {
    var folder: Folder = try .make();
    defer folder.free();
    const file = try folder.temporary.dir.openFile(io, "a b.png", .{});
    defer file.close(io);
    const text = try makeText(&.{});
    defer gpa.free(text);
    var said: Diagnostic = .{};
    const settings: raylane.settings.Load = .{ .output = .of(file.handle) };
    const result = folder.readText(gpa, text, settings, &said);
    try testing.expectError(error.InputOutput, result);
    const expected = "image 2: 'a b.png' would be overwritten by the output";
    try testing.expectEqualStrings(expected, said.message.text());
}

test "every allocation may fail" {
    var folder: Folder = try .make();
    defer folder.free();
    const text = try makeText(&.{ .{ "\"TEXCOORD_1\":4,", "" }, surrounded });
    defer gpa.free(text);
    var fail_index: usize = 0;
    while (true) : (fail_index += 1) {
        var failing: testing.FailingAllocator = .init(gpa, .{ .fail_index = fail_index });
        var said: Diagnostic = .{};
        if (folder.readText(failing.allocator(), text, .{}, &said)) |parsed| {
            var scene = parsed;
            scene.deinit();
            try testing.expect(!failing.has_induced_failure);
            break;
        } else |err| try testing.expectEqual(error.OutOfMemory, err);
        try testing.expectEqual(failing.allocated_bytes, failing.freed_bytes);
    }
    try testing.expect(fail_index > 10);
}
