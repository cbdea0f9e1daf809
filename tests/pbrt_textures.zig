//! PBRT's pictures as the scene has them: as textures of materials, with the coordinates of shapes,
//! and as light from all around; and what becomes of those that cannot be had.
//!
//! In: texts of a few lines and files in a fresh folder, whose bytes are any text: nothing here
//! decodes. Out: the scene's images, textures, materials, coordinates, lights, and warnings.

const std = @import("std");
const raylane = @import("raylane");
const Diagnostic = raylane.diagnostic.Diagnostic;
const Scene = raylane.scene.Scene;
const Vec3d = raylane.math.Vec3d;
const parse = raylane.parse;
const testing = std.testing;
const gpa = testing.allocator;
const io = testing.io;

const triangle = "Shape \"trianglemesh\" \"point P\" [0 0 0  1 0 0  0 1 0] " ++
    "\"integer indices\" [0 1 2]";
const with_uv = triangle ++ " \"float uv\" [0 0  1 0  0.25 0.75]";
const picture = "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"a.png\"";
const matte = " Material \"matte\" \"texture Kd\" \"t\" ";

fn world(comptime text: []const u8) []const u8 {
    return "Camera \"perspective\" WorldBegin " ++ text ++ " WorldEnd";
}

const Folder = struct {
    temporary: std.testing.TmpDir,

    fn make() !Folder {
        const folder: Folder = .{ .temporary = testing.tmpDir(.{}) };
        const dir = folder.temporary.dir;
        try dir.writeFile(io, .{ .sub_path = "a.png", .data = "first" });
        try dir.writeFile(io, .{ .sub_path = "b.png", .data = "second" });
        try dir.hardLink("a.png", dir, "hard.png", io, .{});
        return folder;
    }

    fn free(folder: *Folder) void {
        folder.temporary.cleanup();
    }

    fn read(folder: *Folder, text: []const u8, said: *Diagnostic) !Scene {
        return folder.readWith(gpa, text, .{}, said);
    }

    fn readWith(
        folder: *Folder,
        allocator: std.mem.Allocator,
        text: []const u8,
        settings: raylane.settings.Load,
        said: *Diagnostic,
    ) !Scene {
        const dir = folder.temporary.dir;
        const scene = try parse.parsePbrt(allocator, io, text, dir, settings, said);
        scene.check();
        return scene;
    }

    /// Without a word of warning.
    fn readClean(folder: *Folder, text: []const u8) !Scene {
        var said: Diagnostic = .{};
        errdefer std.debug.print("{s}\n{s}\n", .{ text, said.message.text() });
        var scene = try folder.read(text, &said);
        errdefer scene.deinit();
        for (said.warnings[0..said.warning_count]) |*warning| {
            std.debug.print("{s}\n", .{warning.text()});
        }
        try testing.expectEqual(0, said.warning_count);
        return scene;
    }
};

test "a picture is the base colour's texture, its scale the factor, wrapped and moved as it says" {
    var folder: Folder = try .make();
    defer folder.free();
    const more = " \"float scale\" .5 \"string wrap\" \"clamp\" \"string filter\" \"point\"" ++
        " \"float uscale\" 2 \"float vscale\" 3 \"float udelta\" .25 \"float vdelta\" .5";
    var scene = try folder.readClean(comptime world(picture ++ more ++ matte ++ with_uv));
    defer scene.deinit();
    try testing.expectEqual(1, scene.images.len);
    try testing.expectEqualStrings("first", scene.images[0].bytes);
    try testing.expectEqualStrings("'a.png'", scene.images[0].name);
    try testing.expectEqual(raylane.scene.Texture{
        .image = 0,
        .wrap = @splat(.clamp_to_edge),
        .magnify = .nearest,
        .minify = .nearest,
        .mip = .none,
    }, scene.textures[0]);
    const mesh = &scene.meshes[0];
    const material = &scene.materials[mesh.material];
    try testing.expectEqual([4]f32{ 0.5, 0.5, 0.5, 1 }, material.base_color);
    const view = material.base_color_texture.?;
    // v of PBRT grows upwards, in the scene downwards, in coordinates and in pictures alike.
    const expected = [_][2]f32{ .{ 0, 1 }, .{ 1, 1 }, .{ 0.25, 0.25 } };
    try testing.expectEqualSlices([2]f32, &expected, mesh.texcoords[0].?);
    for (expected) |coordinates| {
        const u, const v = coordinates;
        const s = 2 * u + 0.25;
        const t = 3 * (1 - v) + 0.5;
        const rows = view.transform;
        try testing.expectEqual(s, rows[0][0] * u + rows[0][1] * v + rows[0][2]);
        try testing.expectEqual(1 - t, rows[1][0] * u + rows[1][1] * v + rows[1][2]);
    }
}

test "textures of textures: products are exact, so are mixtures with nothing or all" {
    var folder: Folder = try .make();
    defer folder.free();
    const Case = struct { []const u8, [3]f32 };
    const cases = [_]Case{
        .{ "\"scale\" \"texture tex1\" \"t\" \"rgb tex2\" [.25 .5 1]", .{ 0.25, 0.5, 1 } },
        .{ "\"scale\" \"texture tex\" \"t\" \"float scale\" .5", .{ 0.5, 0.5, 0.5 } },
        .{ "\"scale\" \"rgb tex1\" [0 .5 1] \"texture tex2\" \"t\"", .{ 0, 0.5, 1 } },
        .{ "\"mix\" \"texture tex1\" \"t\" \"float amount\" 0", .{ 1, 1, 1 } },
        .{ "\"mix\" \"texture tex2\" \"t\" \"float amount\" 1", .{ 1, 1, 1 } },
        .{ "\"mix\" \"texture tex2\" \"t\" \"float amount\" .25", .{ 0.25, 0.25, 0.25 } },
        .{ "\"constant\" \"texture value\" \"t\"", .{ 1, 1, 1 } },
    };
    inline for (cases) |case| {
        var scene = try folder.readClean(comptime world(picture ++ " Texture \"u\" \"spectrum\" " ++
            case[0] ++ " Material \"diffuse\" \"texture reflectance\" \"u\" " ++ with_uv));
        defer scene.deinit();
        const material = &scene.materials[scene.meshes[0].material];
        try testing.expect(material.base_color_texture != null);
        try testing.expectEqual(case[1], material.base_color[0..3].*);
    }
}

test "each file is one image, each look at it one texture" {
    var folder: Folder = try .make();
    defer folder.free();
    const second = "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" ";
    const cases = .{
        .{ "\"a.png\"", 1, 1 },                           .{ "\"./a.png\"", 1, 1 },
        .{ "\"hard.png\"", 1, 1 },                        .{ "\"b.png\"", 2, 2 },
        .{ "\"a.png\" \"string wrap\" \"clamp\"", 1, 2 },
    };
    inline for (cases) |case| {
        var scene = try folder.readClean(comptime world(picture ++ matte ++ with_uv ++ " " ++
            second ++ case[0] ++ matte ++ with_uv));
        defer scene.deinit();
        try testing.expectEqual(case[1], scene.images.len);
        try testing.expectEqual(case[2], scene.textures.len);
    }
}

test "coordinates of shapes" {
    var folder: Folder = try .make();
    defer folder.free();
    const dir = folder.temporary.dir;
    try dir.writeFile(io, .{ .sub_path = "m.ply", .data =
        \\ply
        \\format ascii 1.0
        \\element vertex 3
        \\property float x
        \\property float y
        \\property float z
        \\property float s
        \\property float t
        \\element face 1
        \\property list uchar int vertex_indices
        \\end_header
        \\0 0 0 0.5 0.25
        \\1 0 0 1 0
        \\0 1 0 0 1
        \\3 0 1 2
        \\
    });
    const nurbs = "Shape \"nurbs\" \"integer nu\" 2 \"integer nv\" 2 \"integer uorder\" 2 " ++
        "\"integer vorder\" 2 \"float uknots\" [0 0 2 2] \"float vknots\" [0 0 1 1] " ++
        "\"point P\" [0 0 0 1 0 0 0 1 0 1 1 0]";
    const Case = struct { []const u8, []const usize, []const [2]f32 };
    const cases = [_]Case{
        // Each triangle has corners of its own.
        .{ "Shape \"trianglemesh\" \"point P\" [0 0 0 1 0 0 0 1 0 1 1 0] \"integer indices\" " ++
            "[0 1 2 2 1 3]", &.{ 0, 1, 2, 3, 5 }, &.{
            .{ 0, 1 }, .{ 1, 1 }, .{ 1, 0 }, .{ 0, 1 }, .{ 1, 0 },
        } },
        .{ "Shape \"bilinearmesh\" \"point P\" [0 0 0 1 0 0 0 1 0 1 1 0]", &.{ 0, 1, 2, 5 }, &.{
            .{ 0, 1 }, .{ 1, 1 }, .{ 1, 0 }, .{ 0, 0 },
        } },
        .{ triangle ++ " \"point2 st\" [.5 1 0 0 1 .25]", &.{ 0, 2 }, &.{
            .{ 0.5, 0 }, .{ 1, 0.75 },
        } },
        .{ "Shape \"plymesh\" \"string filename\" \"m.ply\"", &.{ 0, 1 }, &.{
            .{ 0.5, 0.75 }, .{ 1, 1 },
        } },
        // 32 columns and a seam; from the bottom up.
        .{ "Shape \"sphere\"", &.{ 0, 8, 32, 33, 33 * 33 - 1 }, &.{
            .{ 0, 1 }, .{ 0.25, 1 }, .{ 1, 1 }, .{ 0, 31.0 / 32.0 }, .{ 1, 0 },
        } },
        .{ "Shape \"disk\" \"float phimax\" 90", &.{ 0, 8, 17 }, &.{
            .{ 0, 1 }, .{ 1, 1 }, .{ 1, 0 },
        } },
        // By height, while rows go by the radius.
        .{ "Shape \"paraboloid\" \"float zmax\" 4", &.{ 0, 264 }, &.{ .{ 0, 1 }, .{ 0, 0.75 } } },
        .{ "Shape \"heightfield\" \"integer nu\" 2 \"integer nv\" 2 \"float Pz\" [0 0 0 0]", &.{
            0, 1, 2,
        }, &.{ .{ 0, 1 }, .{ 1, 1 }, .{ 0, 0 } } },
        .{ "Shape \"loopsubdiv\" \"integer levels\" 0 \"point P\" [0 0 0 1 0 0 0 1 0] " ++
            "\"integer indices\" [0 1 2]", &.{ 0, 2 }, &.{ .{ 0, 1 }, .{ 1, 0 } } },
        .{ nurbs, &.{ 16, 32 }, &.{ .{ 1, 1 }, .{ 2, 1 } } },
    };
    inline for (cases) |case| {
        var scene = try folder.readClean(comptime world(picture ++ matte ++ case[0]));
        defer scene.deinit();
        const texcoords = scene.meshes[0].texcoords[0].?;
        for (case[1], case[2]) |vertex, expected| {
            errdefer std.debug.print("{s}: {d}: {any}\n", .{ case[0], vertex, texcoords[vertex] });
            for (texcoords[vertex], expected) |value, wanted| {
                try testing.expectApproxEqAbs(wanted, value, 1e-6);
            }
        }
        // Without a texture nobody asks for them, and what was shared is again.
        var plain = try folder.readClean(comptime world("Material \"matte\" " ++ case[0]));
        defer plain.deinit();
        try testing.expectEqual(null, plain.meshes[0].texcoords[0]);
        try testing.expect(plain.meshes[0].positions.len <= scene.meshes[0].positions.len);
    }
}

test "the seam of a sphere is closed" {
    var folder: Folder = try .make();
    defer folder.free();
    var scene = try folder.readClean(comptime world(picture ++ matte ++ "Shape \"sphere\""));
    defer scene.deinit();
    const positions = scene.meshes[0].positions;
    for (0..33) |row| try testing.expectEqual(positions[33 * row], positions[33 * row + 32]);
}

test "pictures of specular colours, of what is transmitted, and of numbers" {
    var folder: Folder = try .make();
    defer folder.free();
    const cases = .{
        .{ "\"plastic\" \"texture Ks\" \"t\"", "specular_color_texture" },
        .{ "\"glass\" \"texture Kr\" \"t\"", "specular_color_texture" },
        .{ "\"translucent\" \"texture Kd\" \"t\"", "diffuse_transmission_color_texture" },
        .{
            "\"diffusetransmission\" \"texture transmittance\" \"t\"",
            "diffuse_transmission_color_texture",
        },
        .{ "\"disney\" \"texture roughness\" \"t\"", "metallic_roughness_texture" },
        .{ "\"disney\" \"texture clearcoat\" \"t\"", "clearcoat_texture" },
        .{ "\"disney\" \"texture spectrans\" \"t\"", "transmission_texture" },
    };
    inline for (cases) |case| {
        var scene = try folder.readClean(comptime world(picture ++ " Material " ++ case[0] ++
            " " ++ with_uv));
        defer scene.deinit();
        errdefer std.debug.print("{s}\n", .{case[0]});
        const material = &scene.materials[scene.meshes[0].material];
        try testing.expect(@field(material, case[1]) != null);
        try testing.expect(scene.meshes[0].texcoords[0] != null);
    }
}

test "a normal map and a shining picture" {
    var folder: Folder = try .make();
    defer folder.free();
    var scene = try folder.readClean(comptime world("Material \"diffuse\" \"string normalmap\" " ++
        "\"a.png\" AreaLightSource \"diffuse\" \"string filename\" \"b.png\" \"float scale\" 3 " ++
        with_uv));
    defer scene.deinit();
    const material = &scene.materials[scene.meshes[0].material];
    try testing.expectEqual(0, scene.textures[material.normal_texture.?.texture].image);
    try testing.expectEqual(1, scene.textures[material.emissive_texture.?.texture].image);
    try testing.expectEqual([3]f32{ 3, 3, 3 }, material.emissive);
    try testing.expect(scene.meshes[0].texcoords[0] != null);
}

test "a shape's alpha blends, or makes holes by a picture's red, in a material of its own" {
    var folder: Folder = try .make();
    defer folder.free();
    const one = with_uv ++ " \"texture alpha\" \"t\" ";
    const gone = with_uv ++ " \"float alpha\" 0 ";
    const half = with_uv ++ " \"float alpha\" .5 ";
    var scene = try folder.readClean(comptime world(picture ++ " Material \"matte\" " ++
        "\"rgb Kd\" [.1 .2 .3] " ++ with_uv ++ one ++ one ++ half ++ gone));
    defer scene.deinit();
    try testing.expectEqual(4, scene.meshes.len);
    const plain = &scene.materials[scene.meshes[0].material];
    const holes = &scene.materials[scene.meshes[1].material];
    const veil = &scene.materials[scene.meshes[3].material];
    try testing.expectEqual(scene.meshes[1].material, scene.meshes[2].material);
    try testing.expectEqual(.@"opaque", plain.alpha_mode);
    try testing.expectEqual(null, plain.alpha_texture);
    try testing.expectEqual(.mask, holes.alpha_mode);
    try testing.expectEqual(0, scene.textures[holes.alpha_texture.?.texture].image);
    try testing.expectEqual([4]f32{ 0.1, 0.2, 0.3, 1 }, holes.base_color);
    try testing.expect(scene.meshes[0].texcoords[0] == null);
    try testing.expect(scene.meshes[1].texcoords[0] != null);
    try testing.expectEqual(.blend, veil.alpha_mode);
    try testing.expectEqual(0.5, veil.base_color[3]);
}

/// A direction of the scene that is PBRT's with a plain camera, whose hand is the other one.
fn fromPbrt(direction: Vec3d) Vec3d {
    return .{ direction[0], direction[1], -direction[2] };
}

test "a map of the sky is looked up where PBRT does" {
    var folder: Folder = try .make();
    defer folder.free();
    const Case = struct { Vec3d, Vec3d };
    const Turned = struct { []const u8, []const Case };
    // In PBRT u is 0 along x and grows towards y, v is 0 along z; here u is 0 along -x.
    const plain = [_]Case{
        .{ .{ 1, 0, 0 }, .{ -1, 0, 0 } },
        .{ .{ 0, 1, 0 }, .{ 0, 0, -1 } },
        .{ .{ 0, 0, 1 }, .{ 0, 1, 0 } },
    };
    const turned = [_]Case{
        .{ .{ 0, 1, 0 }, .{ 0, 1, 0 } },
        .{ .{ 1, 0, 0 }, .{ -1, 0, 0 } },
        .{ .{ 0, 0, -1 }, .{ 0, 0, -1 } },
    };
    inline for ([_]Turned{
        .{ "", &plain },
        .{ "Scale 7 7 7 Translate 1 2 3", &plain },
        .{ "Rotate -90 1 0 0", &turned },
    }) |state| {
        const light = " LightSource \"infinite\" \"string mapname\" \"a.png\" \"rgb L\" [1 2 3] " ++
            "\"float scale\" 2 ";
        var scene = try folder.readClean(comptime world(state[0] ++ light ++ triangle));
        defer scene.deinit();
        const map = &scene.environment.?;
        try testing.expectEqual(.equirectangular, map.projection);
        try testing.expect(map.is_seen);
        try testing.expectEqual([3]f32{ 2, 4, 6 }, map.scale);
        try testing.expectEqualStrings("first", scene.images[map.image].bytes);
        for (state[1]) |case| {
            const found = map.rotation.direction(fromPbrt(case[0]));
            for (found, case[1]) |value, wanted| {
                try testing.expectApproxEqAbs(wanted, value, 1e-12);
            }
        }
    }
    var square = try folder.readClean(comptime world("LightSource \"infinite\" " ++
        "\"string filename\" \"a.png\" " ++ triangle));
    defer square.deinit();
    const map = &square.environment.?;
    try testing.expectEqual(.octahedral, map.projection);
    try testing.expectEqual(Vec3d{ 1, 2, 3 }, map.rotation.direction(fromPbrt(.{ 1, 2, 3 })));
    // A camera that mirrors gives the world our hand.
    var mirrored = try folder.readClean("Scale -1 1 1 " ++ comptime world("LightSource " ++
        "\"infinite\" \"string filename\" \"a.png\" " ++ triangle));
    defer mirrored.deinit();
    const same = mirrored.environment.?.rotation.direction(.{ 1, 2, 3 });
    try testing.expectEqual(Vec3d{ 1, 2, 3 }, same);
}

test "power and illuminance" {
    var folder: Folder = try .make();
    defer folder.free();
    const Case = struct { []const u8, f32 };
    const cases = [_]Case{
        .{ "LightSource \"point\" \"float power\" 25.1327412", 2 },
        .{ "LightSource \"point\" \"float power\" 0", 1 },
        .{ "LightSource \"point\" \"float power\" 12.5663706 \"rgb I\" [.5 .5 .5]", 0.5 },
        .{ "LightSource \"point\" \"float power\" 12.5663706 \"float scale\" 3", 3 },
        .{ "LightSource \"distant\" \"float illuminance\" 5", 5 },
        // 2 pi ((1 - 1/2) + (1/2 - 0) / 2).
        .{ "LightSource \"spot\" \"float coneangle\" 90 \"float conedeltaangle\" 30 " ++
            "\"float power\" 4.71238898", 1 },
    };
    inline for (cases) |case| {
        var scene = try folder.readClean(comptime world(case[0] ++ " " ++ triangle));
        defer scene.deinit();
        errdefer std.debug.print("{s}\n", .{case[0]});
        for (scene.lights[0].color) |channel| {
            try testing.expectApproxEqRel(case[1], channel, 1e-5);
        }
    }
    var area = try folder.readClean(comptime world("AreaLightSource \"diffuse\" " ++
        "\"float power\" 6.28318531 Shape \"trianglemesh\" " ++
        "\"point P\" [0 0 0 2 0 0 0 2 0] \"integer indices\" [0 1 2]"));
    defer area.deinit();
    for (area.materials[area.meshes[0].material].emissive) |channel| {
        try testing.expectApproxEqRel(1, channel, 1e-5);
    }
    var sky = try folder.readClean(comptime world("LightSource \"infinite\" " ++
        "\"float illuminance\" 6.28318531 " ++ triangle));
    defer sky.deinit();
    try testing.expectApproxEqRel(2, sky.ambient.?, 1e-5);
}

test "a picture that cannot be had is a warning and its mean" {
    var folder: Folder = try .make();
    defer folder.free();
    const Case = struct { []const u8, []const u8 };
    const missing = "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"no.png\"";
    const cases = [_]Case{
        .{ missing ++ matte ++ with_uv, "line 1: image 'no.png' does not exist, left out" },
        .{ missing, "" }, // Nobody looks.
        .{
            "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"../a\"" ++ matte ++
                with_uv,
            "line 1: image '../a' is outside the scene's folder (see --allow-outside), left out",
        },
        .{
            "Texture \"t\" \"spectrum\" \"imagemap\"" ++ matte ++ with_uv,
            "line 1: Texture 'imagemap' has no filename, left out",
        },
        .{
            "Texture \"t\" \"spectrum\" \"scale\" \"texture tex1\" \"t\"" ++ matte ++ with_uv,
            "line 1: texture 't' is not defined: the default of 'tex1' stands for it",
        },
        .{
            picture ++ " \"bool invert\" true" ++ matte ++ with_uv,
            "line 1: Texture 'imagemap': inverted pictures, and those that are mapped otherwise " ++
                "than by uv, count as 0.5",
        },
        .{
            picture ++ " \"float uscale\" 1e9" ++ matte ++ with_uv,
            "line 1: Texture: its mapping is out of range",
        },
        .{
            picture ++ " Texture \"u\" \"spectrum\" \"mix\" \"texture tex1\" \"t\" " ++
                "\"float tex2\" 1 Material \"matte\" \"texture Kd\" \"u\" " ++ with_uv,
            "line 1: Texture: sums of pictures count as their mean",
        },
        .{
            picture ++ " Material \"plastic\" \"texture roughness\" \"t\" " ++ with_uv,
            "line 1: 'roughness': a picture counts as its mean, taken as 0.5",
        },
        .{
            "LightSource \"infinite\" \"string filename\" \"a.png\" " ++
                "LightSource \"infinite\" \"string filename\" \"b.png\" " ++ triangle,
            "line 1: LightSource 'infinite': the first map is the only one",
        },
        .{
            "Scale 1 2 3 LightSource \"infinite\" \"string filename\" \"a.png\" " ++
                "Identity Translate 1 0 0 " ++ triangle,
            "",
        },
        .{
            "ConcatTransform [1 1 0 0 0 1 0 0 0 0 1 0 0 0 0 1] LightSource \"infinite\" " ++
                "\"string filename\" \"a.png\" " ++ triangle,
            "line 1: LightSource 'infinite': its transformation is no rotation, and not read",
        },
    };
    inline for (cases) |case| {
        var said: Diagnostic = .{};
        errdefer std.debug.print("{s}\n{s}\n", .{ case[0], said.message.text() });
        var scene = try folder.read(comptime world(case[0] ++ " " ++ triangle), &said);
        defer scene.deinit();
        if (case[1].len == 0) {
            try testing.expectEqual(0, said.warning_count);
        } else {
            try testing.expectEqual(1, said.warning_count);
            try testing.expectEqualStrings(case[1], said.warnings[0].text());
        }
    }
}

test "a sky whose map is missing is a grey one beside other lights" {
    var folder: Folder = try .make();
    defer folder.free();
    var said: Diagnostic = .{};
    var scene = try folder.read(comptime world("LightSource \"infinite\" \"string mapname\" " ++
        "\"no.exr\" LightSource \"point\" " ++ triangle), &said);
    defer scene.deinit();
    try testing.expectEqual(2, said.warning_count);
    try testing.expectEqual(null, scene.environment);
    try testing.expect(scene.background != null);
}

test "coordinates that do not fit are left out, a picture that is overwritten is an error" {
    var folder: Folder = try .make();
    defer folder.free();
    var said: Diagnostic = .{};
    const short = comptime world(picture ++ matte ++ triangle ++ " \"float uv\" [0 0 1 1]");
    var without = try folder.read(short, &said);
    defer without.deinit();
    const expected = "line 1: trianglemesh: has 4 numbers of coordinates uv for 3 points";
    try testing.expectEqualStrings(expected, said.warnings[0].text());

    const file = try folder.temporary.dir.openFile(io, "a.png", .{});
    defer file.close(io);
    const text = comptime world(picture ++ matte ++ with_uv);
    const settings: raylane.settings.Load = .{ .output = .of(file.handle) };
    const result = folder.readWith(gpa, text, settings, &said);
    try testing.expectError(error.InputOutput, result);
    try testing.expectEqualStrings(
        "'a.png' would be overwritten by the output",
        said.message.text(),
    );
}

test "every allocation may fail" {
    var folder: Folder = try .make();
    defer folder.free();
    const text = comptime world("LightSource \"infinite\" \"string mapname\" \"b.png\" " ++
        picture ++ matte ++ triangle ++ " Shape \"sphere\" Texture \"u\" \"spectrum\" " ++
        "\"imagemap\" \"string filename\" \"no.png\" Material \"matte\" \"texture Kd\" \"u\" " ++
        with_uv);
    var fail_index: usize = 0;
    while (true) : (fail_index += 1) {
        var failing: testing.FailingAllocator = .init(gpa, .{ .fail_index = fail_index });
        var said: Diagnostic = .{};
        if (folder.readWith(failing.allocator(), text, .{}, &said)) |parsed| {
            var scene = parsed;
            scene.deinit();
            try testing.expect(!failing.has_induced_failure);
            break;
        } else |err| try testing.expectEqual(error.OutOfMemory, err);
        try testing.expectEqual(failing.allocated_bytes, failing.freed_bytes);
    }
    try testing.expect(fail_index > 10);
}

test "the power of a lamp with a picture is what the picture lets out" {
    var folder: Folder = try .make();
    defer folder.free();
    // Two by one pixels of RGB: red, then (0, 128, 255).
    try folder.temporary.dir.writeFile(io, .{ .sub_path = "real.png", .data = "\x89PNG\r\n\x1a\n" ++
        "\x00\x00\x00\x0dIHDR\x00\x00\x00\x02\x00\x00\x00\x01\x08\x02\x00\x00\x00" ++
        "\x7b\x40\xe8\xdd" ++
        "\x00\x00\x00\x12IDAT\x78\x01\x01\x07\x00\xf8\xff" ++
        "\x00\xff\x00\x00\x00\x80\xff\x08\x00\x02\x7f\xd5\x70\x6e\xaa" ++
        "\x00\x00\x00\x00IEND\xae\x42\x60\x82" });
    const luminance = (0.212671 + 0.215861 * 0.715160 + 0.072169) / 2.0;
    // Half a square metre, to one side; and a picture that is none, which counts as white.
    for ([_][]const u8{ "real.png", "a.png" }, [_]f32{ luminance, 1 }) |name, mean| {
        var buffer: [400]u8 = undefined;
        const text = try std.mem.print(&buffer, "Camera \"perspective\" WorldBegin " ++
            "AreaLightSource \"diffuse\" \"string filename\" \"{s}\" \"float power\" 3 " ++
            with_uv ++ " WorldEnd", .{name});
        var scene = try folder.readClean(text);
        defer scene.deinit();
        const emitted = scene.materials[scene.meshes[0].material].emissive;
        for (emitted) |channel|
            try testing.expectApproxEqRel(3 / (std.math.pi * 0.5 * mean), channel, 1e-4);
    }
}
