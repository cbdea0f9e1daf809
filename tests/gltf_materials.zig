//! glTF's materials with their extensions, as the scene has them: every factor and texture, what is
//! out of range, what meshes can have of them.
//!
//! In: a triangle with one material, or several by variant. Out: the scene's materials, warnings.

const std = @import("std");
const raylane = @import("raylane");
const texts = @import("gltf_text.zig");
const Diagnostic = raylane.diagnostic.Diagnostic;
const Material = raylane.scene.Material;
const Scene = raylane.scene.Scene;
const TextureView = raylane.scene.TextureView;
const testing = std.testing;
const gpa = testing.allocator;

/// `$DATA` stands for the buffer, `$MATERIALS` and `$PRIMITIVE` for what a test is about; image n
/// of `$IMAGES` has bytes of its own.
const document =
    \\{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
    \\"meshes":[{"primitives":[{$PRIMITIVE}]}],"materials":[$MATERIALS],
    \\"textures":[$TEXTURES],"images":[$IMAGES],
    \\"accessors":[
    \\{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
    \\{"bufferView":1,"componentType":5126,"count":3,"type":"VEC3"},
    \\{"bufferView":2,"componentType":5126,"count":3,"type":"VEC4"},
    \\{"bufferView":3,"componentType":5126,"count":3,"type":"VEC2"}],
    \\"bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":36},
    \\{"buffer":0,"byteOffset":36,"byteLength":36},
    \\{"buffer":0,"byteOffset":72,"byteLength":48},
    \\{"buffer":0,"byteOffset":120,"byteLength":24}],
    \\"buffers":[{"byteLength":144,"uri":"data:application/octet-stream;base64,$DATA"}]$MORE}
;

/// As many textures as there are images, of the same numbers.
const texture_count = 20;

const Parts = struct {
    materials: []const u8,
    /// Accessors: 0 positions, 1 normals, 2 tangents, 3 texture coordinates.
    attributes: []const u8 = all_attributes,
    primitive: []const u8 = "\"material\":0",
    more: []const u8 = "",
    settings: raylane.settings.Load = .{},

    const all_attributes = "\"POSITION\":0,\"NORMAL\":1,\"TANGENT\":2,\"TEXCOORD_0\":3," ++
        "\"TEXCOORD_1\":3,\"TEXCOORD_2\":3";
};

fn read(parts: Parts, said: *Diagnostic) !Scene {
    const text = try makeText(parts);
    defer gpa.free(text);
    const dir: std.Io.Dir = .cwd(); // No file is named.
    const scene = try raylane.parse.parseBytes(gpa, testing.io, text, dir, parts.settings, said);
    scene.check();
    return scene;
}

/// The document with its parts. The caller frees it.
fn makeText(parts: Parts) ![]const u8 {
    var arena_state: std.heap.ArenaAllocator = .init(gpa);
    defer arena_state.deinit();
    const arena = arena_state.allocator();
    var bytes: [144]u8 = undefined;
    texts.putFloats(bytes[0..], &.{ 0, 0, 0, 1, 0, 0, 0, 1, 0 });
    texts.putFloats(bytes[36..], &.{ 0, 0, 1, 0, 0, 1, 0, 0, 1 });
    texts.putFloats(bytes[72..], &.{ 1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1 });
    texts.putFloats(bytes[120..], &.{ 0, 0, 1, 0, 0, 1 });
    const encoder = std.base64.standard.Encoder;
    var textures: std.Io.Writer.Allocating = .init(arena);
    var images: std.Io.Writer.Allocating = .init(arena);
    for (0..texture_count) |index| {
        const comma = if (index == 0) "" else ",";
        var letter: [4]u8 = undefined;
        const byte = encoder.encode(&letter, &.{@intCast('a' + index)});
        try textures.writer.print("{s}{{\"source\":{d}}}", .{ comma, index });
        try images.writer.print("{s}{{\"uri\":\"data:image/png;base64,{s}\"}}", .{ comma, byte });
    }
    var primitive: std.Io.Writer.Allocating = .init(arena);
    const attributes = .{ parts.attributes, parts.primitive };
    try primitive.writer.print("\"attributes\":{{{s}}},{s}", attributes);
    return texts.make(document, &bytes, &.{
        .{ "$MATERIALS", parts.materials },
        .{ "$PRIMITIVE", primitive.written() },
        .{ "$TEXTURES", textures.written() },
        .{ "$IMAGES", images.written() },
        .{ "$MORE", parts.more },
    });
}

/// The material as the file's only extension has it.
fn readExtension(arena: std.mem.Allocator, extension: []const u8, said: *Diagnostic) !Scene {
    const materials = try arena.print("{{\"extensions\":{{\"KHR_materials_{s}}}}}", .{extension});
    return read(.{ .materials = materials }, said);
}

/// Textures of a scene's materials are added as they are met, so they are known by their images.
fn expectTexture(scene: *const Scene, byte: u8, view: ?TextureView) !void {
    const found = view orelse return error.TestUnexpectedResult;
    const image = scene.textures[found.texture].image;
    try testing.expectEqualStrings(&.{byte}, scene.images[image].bytes);
}

fn expectMaterial(expected: Material, found: *const Material) !void {
    try testing.expectEqual(0, found.origin);
    var without = found.*;
    without.origin = expected.origin;
    inline for (raylane.scene.texture_fields) |field| @field(without, field) = null;
    try testing.expectEqual(expected, without);
}

test "factors of every extension" {
    var arena: std.heap.ArenaAllocator = .init(gpa);
    defer arena.deinit();
    const Case = struct { []const u8, Material };
    for ([_]Case{
        .{ "ior\":{\"ior\":1.25}", .{ .ior = 1.25 } },
        .{ "ior\":{\"ior\":0}", .{ .ior = 1e6 } },
        .{ "specular\":{}", .{} },
        .{
            "specular\":{\"specularFactor\":0.25,\"specularColorFactor\":[0.5,2,3]}",
            .{ .specular = 0.25, .specular_color = .{ 0.5, 2, 3 } },
        },
        .{ "clearcoat\":{}", .{} },
        .{
            "clearcoat\":{\"clearcoatFactor\":0.5,\"clearcoatRoughnessFactor\":0.25}",
            .{ .clearcoat = 0.5, .clearcoat_roughness = 0.25 },
        },
        .{
            "sheen\":{\"sheenColorFactor\":[0.5,0.25,1],\"sheenRoughnessFactor\":0.75}",
            .{ .sheen_color = .{ 0.5, 0.25, 1 }, .sheen_roughness = 0.75 },
        },
        .{ "transmission\":{\"transmissionFactor\":0.5}", .{ .transmission = 0.5 } },
        .{ "volume\":{}", .{} },
        .{
            "volume\":{\"thicknessFactor\":0.1,\"attenuationDistance\":2," ++
                "\"attenuationColor\":[1,0.5,0.25]}",
            .{
                .volume = true,
                .attenuation_distance = 2,
                .attenuation_color = .{ 1, 0.5, 0.25 },
            },
        },
        .{ "dispersion\":{\"dispersion\":0.5}", .{ .dispersion = 0.5 } },
        .{ "iridescence\":{}", .{} },
        .{
            "iridescence\":{\"iridescenceFactor\":0.5,\"iridescenceIor\":2," ++
                "\"iridescenceThicknessMinimum\":500,\"iridescenceThicknessMaximum\":0}",
            .{
                .iridescence = 0.5,
                .iridescence_ior = 2,
                .iridescence_thickness_min_nm = 500,
                .iridescence_thickness_max_nm = 0,
            },
        },
        .{
            "anisotropy\":{\"anisotropyStrength\":0.5,\"anisotropyRotation\":-7}",
            .{ .anisotropy = 0.5, .anisotropy_rotation_rad = -7 },
        },
        .{ "diffuse_transmission\":{}", .{} },
        .{
            "diffuse_transmission\":{\"diffuseTransmissionFactor\":0.5," ++
                "\"diffuseTransmissionColorFactor\":[0,0.5,1]}",
            .{ .diffuse_transmission = 0.5, .diffuse_transmission_color = .{ 0, 0.5, 1 } },
        },
        .{ "volume_scatter\":{}", .{} },
        .{
            "volume_scatter\":{\"multiscatterColorFactor\":[0.5,0.25,1]," ++
                "\"multiscatterColor\":[0,0,0],\"scatterAnisotropy\":-0.5}",
            .{ .multiscatter_color = .{ 0.5, 0.25, 1 }, .scatter_anisotropy = -0.5 },
        },
        .{
            "volume_scatter\":{\"multiscatterColor\":[0.5,0.25,1]}",
            .{ .multiscatter_color = .{ 0.5, 0.25, 1 } },
        },
    }) |case| {
        var said: Diagnostic = .{};
        var scene = try readExtension(arena.allocator(), case[0], &said);
        defer scene.deinit();
        errdefer std.debug.print("{s}\n", .{case[0]});
        try testing.expectEqual(0, said.warning_count);
        try expectMaterial(case[1], &scene.materials[0]);
    }
    var said: Diagnostic = .{};
    var scene = try read(.{ .materials = "{\"emissiveFactor\":[1,0.5,0],\"extensions\":" ++
        "{\"KHR_materials_emissive_strength\":{\"emissiveStrength\":10}}}" }, &said);
    defer scene.deinit();
    try testing.expectEqual([3]f32{ 10, 5, 0 }, scene.materials[0].emissive);
}

test "textures of every extension" {
    var said: Diagnostic = .{};
    var scene = try read(.{ .materials =
        \\{"extensions":{
        \\"KHR_materials_specular":{"specularTexture":{"index":0},
        \\"specularColorTexture":{"index":1}},
        \\"KHR_materials_clearcoat":{"clearcoatFactor":1,"clearcoatTexture":{"index":2},
        \\"clearcoatRoughnessTexture":{"index":3},
        \\"clearcoatNormalTexture":{"index":4,"texCoord":1,"scale":0.5}},
        \\"KHR_materials_sheen":{"sheenColorTexture":{"index":5},
        \\"sheenRoughnessTexture":{"index":6}},
        \\"KHR_materials_transmission":{"transmissionTexture":{"index":7}},
        \\"KHR_materials_volume":{"thicknessFactor":1,"thicknessTexture":{"index":8}},
        \\"KHR_materials_iridescence":{"iridescenceTexture":{"index":9},
        \\"iridescenceThicknessTexture":{"index":10}},
        \\"KHR_materials_anisotropy":{"anisotropyTexture":{"index":11,"texCoord":2}},
        \\"KHR_materials_diffuse_transmission":{"diffuseTransmissionTexture":{"index":12},
        \\"diffuseTransmissionColorTexture":{"index":13}},
        \\"KHR_materials_volume_scatter":{"multiscatterColorTexture":{"index":14,"texCoord":1,
        \\"extensions":{"KHR_texture_transform":{"offset":[0.25,0.5],"scale":[2,3],
        \\"texCoord":2}}}}}}
    }, &said);
    defer scene.deinit();
    try testing.expectEqual(0, said.warning_count);
    const material = &scene.materials[0];
    inline for (.{
        .{ "specular", 'a' },                   .{ "specular_color", 'b' },
        .{ "clearcoat", 'c' },                  .{ "clearcoat_roughness", 'd' },
        .{ "clearcoat_normal", 'e' },           .{ "sheen_color", 'f' },
        .{ "sheen_roughness", 'g' },            .{ "transmission", 'h' },
        .{ "iridescence", 'j' },                .{ "iridescence_thickness", 'k' },
        .{ "anisotropy", 'l' },                 .{ "diffuse_transmission", 'm' },
        .{ "diffuse_transmission_color", 'n' }, .{ "multiscatter_color", 'o' },
    }) |pair| try expectTexture(&scene, pair[1], @field(material, pair[0] ++ "_texture"));
    // The thickness is for those who do not trace rays.
    try testing.expectEqual(14, scene.images.len);
    try testing.expectEqual(0.5, material.clearcoat_normal_scale);
    try testing.expectEqual(1, material.clearcoat_normal_texture.?.texcoord_set);
    try testing.expectEqual(2, material.anisotropy_texture.?.texcoord_set);
    const scatter = material.multiscatter_color_texture.?;
    try testing.expectEqual(2, scatter.texcoord_set);
    try testing.expectEqual([2][3]f32{ .{ 2, 0, 0.25 }, .{ 0, 3, 0.5 } }, scatter.transform);
    // Coordinates are there for all of them.
    for (scene.meshes[0].texcoords[0..3]) |set| try testing.expect(set != null);
}

test "specular-glossiness counts, whatever else the material says" {
    const gloss = "\"KHR_materials_pbrSpecularGlossiness\":{\"diffuseFactor\":[0.5,0.25,1,0.75]," ++
        "\"diffuseTexture\":{\"index\":0},\"specularFactor\":[1,0.5,0]," ++
        "\"glossinessFactor\":0.75," ++
        "\"specularGlossinessTexture\":{\"index\":1,\"texCoord\":1}}";
    const alone = "{\"extensions\":{" ++ gloss ++ "}}";
    const beside = "{\"pbrMetallicRoughness\":{\"baseColorFactor\":[0,0,0,0]," ++
        "\"baseColorTexture\":{\"index\":2},\"metallicRoughnessTexture\":{\"index\":3}}," ++
        "\"extensions\":{\"KHR_materials_ior\":{\"ior\":2}," ++
        "\"KHR_materials_specular\":{\"specularFactor\":0,\"specularTexture\":{\"index\":4}," ++
        "\"specularColorTexture\":{\"index\":5}}," ++ gloss ++ "}}";
    for ([_][]const u8{ alone, beside }) |materials| {
        var said: Diagnostic = .{};
        var scene = try read(.{ .materials = materials }, &said);
        defer scene.deinit();
        try testing.expectEqual(0, said.warning_count);
        const material = &scene.materials[0];
        try expectMaterial(.{
            .base_color = .{ 0.5, 0.25, 1, 0.75 },
            .metallic = 0,
            .roughness = 0.25,
            .ior = 1.5,
            .specular = 1,
            .specular_color = .{ 25, 12.5, 0 },
        }, material);
        try expectTexture(&scene, 'a', material.base_color_texture);
        try expectTexture(&scene, 'b', material.specular_color_texture);
        try expectTexture(&scene, 'b', material.glossiness_texture);
        try testing.expectEqual(1, material.glossiness_texture.?.texcoord_set);
        try testing.expectEqual(null, material.metallic_roughness_texture);
        try testing.expectEqual(null, material.specular_texture);
    }
}

test "what is out of range is clamped, what makes no sense is left out, each with a warning" {
    var arena: std.heap.ArenaAllocator = .init(gpa);
    defer arena.deinit();
    const Case = struct { []const u8, []const u8, Material };
    for ([_]Case{
        .{
            "specular\":{\"specularFactor\":2}",
            "specularFactor 2 is not in 0..1, clamped",
            .{},
        },
        .{
            "specular\":{\"specularColorFactor\":[-1,1,1]}",
            "specularColorFactor -1 is below 0, clamped",
            .{ .specular_color = .{ 0, 1, 1 } },
        },
        .{
            "clearcoat\":{\"clearcoatRoughnessFactor\":-1}",
            "clearcoatRoughnessFactor -1 is not in 0..1, clamped",
            .{},
        },
        .{
            "sheen\":{\"sheenColorFactor\":[0,0,2]}",
            "sheenColorFactor 2 is not in 0..1, clamped",
            .{ .sheen_color = .{ 0, 0, 1 } },
        },
        .{ "dispersion\":{\"dispersion\":-1}", "dispersion -1 is not in 0..1000000, clamped", .{} },
        .{
            "iridescence\":{\"iridescenceIor\":0.5}",
            "iridescenceIor 0.5 is not in 1..1000000, clamped",
            .{ .iridescence_ior = 1 },
        },
        .{
            "iridescence\":{\"iridescenceThicknessMinimum\":-5}",
            "iridescenceThicknessMinimum -5 is not in 0..1000000, clamped",
            .{ .iridescence_thickness_min_nm = 0 },
        },
        .{
            "anisotropy\":{\"anisotropyRotation\":1e30}",
            "anisotropyRotation 1000000000000000000000000000000 is out of range, left out",
            .{},
        },
        .{
            "volume_scatter\":{\"scatterAnisotropy\":-1}",
            "scatterAnisotropy -1 is not in -0.999..0.999, clamped",
            .{ .scatter_anisotropy = -0.999 },
        },
        .{
            "volume_scatter\":{\"multiscatterColorFactor\":[0,0,1.5]}",
            "multiscatterColorFactor 1.5 is not in 0..1, clamped",
            .{ .multiscatter_color = .{ 0, 0, 1 } },
        },
        .{
            "volume_scatter\":{\"multiscatterColorTexture\":{\"index\":20}}",
            "multiscatterColorTexture: there is no texture 20",
            .{},
        },
        .{
            "volume_scatter\":{\"multiscatterColorTexture\":{\"index\":0,\"texCoord\":4294967295}}",
            "multiscatterColorTexture: there is no TEXCOORD of its texCoord",
            .{},
        },
        .{
            "volume_scatter\":{\"multiscatterColorTexture\":{\"index\":4294967296}}",
            "names nothing, lists have 4194304 elements at most",
            .{},
        },
    }) |case| {
        var said: Diagnostic = .{};
        errdefer std.debug.print("{s} {s}\n", .{ case[0], said.message.text() });
        var scene = readExtension(arena.allocator(), case[0], &said) catch |err| {
            try testing.expectEqual(error.InvalidInput, err);
            const is_reference = std.mem.find(u8, case[0], "\"index\"") != null;
            try testing.expect(is_reference);
            if (@sizeOf(usize) == 8) // Else such a number is too large for the processor.
                try testing.expectStringEndsWith(said.message.text(), case[1]);
            continue;
        };
        defer scene.deinit();
        try testing.expectEqual(1, said.warning_count);
        const found = said.warnings[0].text();
        try testing.expect(std.mem.startsWith(u8, found, "material 0: "));
        try testing.expectStringEndsWith(found, case[1]);
        try expectMaterial(case[2], &scene.materials[0]);
        try testing.expectEqual(null, scene.materials[0].multiscatter_color_texture);
    }
}

test "a mesh has of a material what its coordinates and tangents allow" {
    const normal = "\"normalTexture\":{\"index\":0}";
    const coat = "\"KHR_materials_clearcoat\":{\"clearcoatFactor\":1," ++
        "\"clearcoatNormalTexture\":{\"index\":1,\"texCoord\":1}}";
    const brushed = "\"KHR_materials_anisotropy\":{\"anisotropyStrength\":1," ++
        "\"anisotropyTexture\":{\"index\":2,\"texCoord\":2}}";
    const all = "{" ++ normal ++ ",\"extensions\":{" ++ coat ++ "," ++ brushed ++ "}}";
    const only_coat = "{\"extensions\":{" ++ coat ++ "}}";
    const only_brushed = "{\"extensions\":{" ++ brushed ++ "}}";
    const plain_brushed = "{\"extensions\":{\"KHR_materials_anisotropy\":" ++
        "{\"anisotropyStrength\":1}}}";
    const Kept = struct { normal: bool = false, coat: bool = false, brushed: bool = false };
    const Case = struct { []const u8, []const u8, Kept, bool };
    const tangents = ",\"NORMAL\":1,\"TANGENT\":2";
    for ([_]Case{
        .{ all, tangents ++ ",\"TEXCOORD_0\":3,\"TEXCOORD_1\":3,\"TEXCOORD_2\":3", .{
            .normal = true,
            .coat = true,
            .brushed = true,
        }, true },
        .{ all, tangents ++ ",\"TEXCOORD_1\":3", .{ .coat = true, .brushed = true }, true },
        .{ all, ",\"NORMAL\":1,\"TEXCOORD_0\":3", .{ .normal = true, .brushed = true }, false },
        .{ all, ",\"TANGENT\":2", .{}, false },
        .{ only_coat, tangents ++ ",\"TEXCOORD_1\":3", .{ .coat = true }, true },
        .{ only_coat, tangents ++ ",\"TEXCOORD_0\":3", .{}, false },
        .{ only_brushed, tangents, .{ .brushed = true }, true },
        .{ only_brushed, ",\"NORMAL\":1,\"TEXCOORD_2\":3", .{ .brushed = true }, false },
        .{ only_brushed, ",\"NORMAL\":1,\"TEXCOORD_0\":3", .{}, false },
        .{ plain_brushed, tangents, .{ .brushed = true }, true },
        .{ plain_brushed, ",\"NORMAL\":1,\"TEXCOORD_0\":3", .{ .brushed = true }, false },
        .{ plain_brushed, ",\"NORMAL\":1", .{}, false },
    }, 0..) |case, index| {
        errdefer std.debug.print("case {d}\n", .{index});
        var attributes: [128]u8 = undefined;
        var said: Diagnostic = .{};
        var scene = try read(.{
            .materials = case[0],
            .attributes = try std.fmt.bufPrint(&attributes, "\"POSITION\":0{s}", .{case[1]}),
        }, &said);
        defer scene.deinit();
        const mesh = &scene.meshes[0];
        const material = &scene.materials[mesh.material];
        try testing.expectEqual(case[2], Kept{
            .normal = material.normal_texture != null,
            .coat = material.clearcoat_normal_texture != null,
            .brushed = material.anisotropy > 0,
        });
        try testing.expectEqual(case[3], mesh.tangents != null);
        // Then they can be made.
        const needs_some = case[2].normal or case[2].coat or case[2].brushed;
        if (!needs_some or case[3]) continue;
        const set: usize = if (case[2].normal or case[0].ptr == plain_brushed.ptr) 0 else 2;
        try testing.expect(mesh.texcoords[set] != null);
    }
}

/// Three variants, of which the second has the last material, and the third none of its own.
const variants = ",\"extensions\":{\"KHR_materials_variants\":{\"variants\":[" ++
    "{\"name\":\"r\\u0065d\"},{\"name\":\"blue\"},{},{\"name\":\"blue\"}]}}";
const mapped = "\"material\":0,\"extensions\":{\"KHR_materials_variants\":{\"mappings\":[" ++
    "{\"material\":1,\"variants\":[0]},{\"material\":2,\"variants\":[9,1,3]}," ++
    "{\"material\":0,\"variants\":[0]}]}}";
const variant_materials = "{\"normalTexture\":{\"index\":0}}," ++
    "{\"emissiveTexture\":{\"index\":1,\"texCoord\":1},\"emissiveFactor\":[1,0,0]}," ++
    "{\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":2,\"texCoord\":2}}}";

test "a primitive has the material of the variant that is asked for, and nothing else is read" {
    const Choice = raylane.settings.Choice;
    const Case = struct { Choice, u8, u32, usize };
    for ([_]Case{
        .{ .default, 'a', 0, 0 },
        .{ .{ .index = 0 }, 'b', 1, 1 },
        .{ .{ .name = "red" }, 'b', 1, 1 },
        .{ .{ .name = "blue" }, 'c', 2, 2 },
        .{ .{ .index = 2 }, 'a', 0, 0 },
        .{ .{ .index = 3 }, 'c', 2, 2 },
    }) |case| {
        var said: Diagnostic = .{};
        var scene = try read(.{
            .materials = variant_materials,
            .primitive = mapped,
            .more = variants,
            .settings = .{ .material_variant = case[0] },
        }, &said);
        defer scene.deinit();
        try testing.expectEqual(0, said.warning_count);
        try testing.expectEqual(case[2], scene.meshes[0].material);
        try testing.expectEqual(1, scene.images.len);
        try testing.expectEqualStrings(&.{case[1]}, scene.images[0].bytes);
        for (scene.meshes[0].texcoords, 0..) |set, number| {
            try testing.expectEqual(number == case[3], set != null);
        }
        try testing.expectEqual(case[2] == 0, scene.meshes[0].tangents != null);
        const names = [_][]const u8{ "red", "blue", "", "blue" };
        try testing.expectEqual(names.len, scene.material_variants.len);
        for (names, scene.material_variants) |name, found| {
            try testing.expectEqualStrings(name, found);
        }
    }
    // What has no material of its own may have one by a variant.
    const bare = mapped["\"material\":0,".len..];
    for ([_]Choice{ .default, .{ .index = 0 } }, [_]u32{ 3, 1 }) |choice, material| {
        var said: Diagnostic = .{};
        var scene = try read(.{
            .materials = variant_materials,
            .primitive = bare,
            .more = variants,
            .settings = .{ .material_variant = choice },
        }, &said);
        defer scene.deinit();
        try testing.expectEqual(material, scene.meshes[0].material);
    }
}

test "an unknown variant is an error that lists those that there are" {
    const Case = struct { raylane.settings.Choice, []const u8, []const u8 };
    const list = "the file has 0 'red', 1 'blue', 2, 3 'blue'";
    for ([_]Case{
        .{ .{ .index = 4 }, variants, "no material variant 4; " ++ list },
        .{ .{ .name = "Red" }, variants, "no material variant 'Red'; " ++ list },
        .{ .{ .index = 0 }, "", "no material variant 0; the file has none" },
    }) |case| {
        var said: Diagnostic = .{};
        try testing.expectError(error.MaterialVariantUnknown, read(.{
            .materials = variant_materials,
            .more = case[1],
            .settings = .{ .material_variant = case[0] },
        }, &said));
        try testing.expectEqualStrings(case[2], said.message.text());
    }
}

test "every allocation may fail" {
    const text = try makeText(.{
        .materials = variant_materials ++ ",{\"extensions\":{\"KHR_materials_volume_scatter\":" ++
            "{\"multiscatterColorTexture\":{\"index\":3}}}}",
        .primitive = "\"material\":3",
        .more = variants,
    });
    defer gpa.free(text);
    const one = struct {
        fn one(failing: std.mem.Allocator, bytes: []const u8) !void {
            var said: Diagnostic = .{};
            const dir: std.Io.Dir = .cwd();
            const settings: raylane.settings.Load = .{ .material_variant = .{ .name = "blue" } };
            var scene =
                try raylane.parse.parseBytes(failing, testing.io, bytes, dir, settings, &said);
            scene.deinit();
        }
    }.one;
    try testing.checkAllAllocationFailures(gpa, one, .{text});
}
