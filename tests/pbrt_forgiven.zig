//! PBRT texts as people have them: cut into files anywhere, compressed, with a byte order mark,
//! misnested, with names that nothing has; and that `--strict` refuses what is forgiven.
//!
//! In: texts of a few lines, and files in a fresh folder. Out: what the scene holds, and what is
//! said of it.

const std = @import("std");
const raylane = @import("raylane");
const Diagnostic = raylane.diagnostic.Diagnostic;
const Scene = raylane.scene.Scene;
const Vec3 = raylane.math.Vec3;
const expect = std.testing.expect;
const expectEqual = std.testing.expectEqual;
const expectEqualStrings = std.testing.expectEqualStrings;
const gpa = std.testing.allocator;
const io = std.testing.io;
const parse = raylane.parse;

const camera = "Camera \"perspective\" ";
const start = camera ++ "WorldBegin ";

const Folder = struct {
    temporary: std.testing.TmpDir,
    said: Diagnostic = .{},

    fn make() Folder {
        return .{ .temporary = std.testing.tmpDir(.{}) };
    }

    fn free(folder: *Folder) void {
        folder.temporary.cleanup();
    }

    fn write(folder: *Folder, name: []const u8, bytes: []const u8) !void {
        try folder.temporary.dir.writeFile(io, .{ .sub_path = name, .data = bytes });
    }

    fn read(folder: *Folder, text: []const u8, strict: bool) !Scene {
        folder.said = .{};
        const dir = folder.temporary.dir;
        const settings: raylane.settings.Load = .{ .strict = strict };
        const scene = parse.parsePbrt(gpa, io, text, dir, settings, &folder.said) catch |err| {
            if (!strict) std.debug.print("{s}: {s}\n", .{
                folder.said.place.text(), folder.said.message.text(),
            });
            return err;
        };
        scene.check();
        return scene;
    }

    /// Without a word of warning.
    fn readClean(folder: *Folder, text: []const u8) !Scene {
        var scene = try folder.read(text, true);
        errdefer scene.deinit();
        if (folder.said.warning_count == 0) return scene;
        std.debug.print("{s}\n", .{folder.said.warnings[0].text()});
        return error.TestUnexpectedWarning;
    }

    /// With one warning, which is an error where it is not forgiven.
    fn readForgiven(folder: *Folder, text: []const u8, place: []const u8, said: []const u8) !Scene {
        try std.testing.expectError(error.InvalidInput, folder.read(text, true));
        try expectEqualStrings(said, folder.said.message.text());
        var scene = try folder.read(text, false);
        errdefer scene.deinit();
        try expectEqual(1, folder.said.warning_count);
        var buffer: [400]u8 = undefined;
        const message = try std.mem.print(&buffer, "{s}{s}", .{ place, said });
        try expectEqualStrings(message, folder.said.warnings[0].text());
        return scene;
    }
};

fn colorOf(scene: *const Scene, index: usize) Vec3 {
    return scene.materials[scene.meshes[index].material].base_color[0..3].*;
}

const mesh = "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 1 1 0 0 1 0] ";
const indices = "\"integer indices\" [0 1 2 0 2 3] ";

test "an included text stands in its Include's place, within directives and lists" {
    var folder: Folder = .make();
    defer folder.free();
    try folder.write("mesh.pbrt", mesh);
    try folder.write("indices.pbrt", "# a comment\n" ++ indices);
    try folder.write("half.pbrt", "Material \"matte\" \"rgb Kd\" [ 1 0");
    try folder.write("name.pbrt", "Shape");
    try folder.write("numbers.pbrt", "0 1 2");
    try folder.write("move.pbrt", "Translate 1 2");
    try folder.write("inner.pbrt", "Include \"half.pbrt\"");
    try folder.write("empty.pbrt", "\n# nothing\n");
    for ([_][]const u8{
        "Include \"mesh.pbrt\" " ++ indices,
        "Include \"mesh.pbrt\" Include \"indices.pbrt\"",
        mesh ++ "Include \"indices.pbrt\"",
        mesh ++ "Include \"empty.pbrt\" " ++ indices,
        "Include \"inner.pbrt\" 0 ] " ++ mesh ++ indices,
        "Include \"name.pbrt\" " ++ mesh["Shape".len..] ++ indices,
        mesh ++ "\"integer indices\" [Include \"numbers.pbrt\" 0 2 3 Include \"empty.pbrt\"]",
        "Include \"move.pbrt\" 3 " ++ mesh ++ indices,
    }) |text| {
        var buffer: [400]u8 = undefined;
        const whole = try std.mem.print(&buffer, "{s}{s}", .{ start, text });
        var scene = try folder.readClean(whole);
        defer scene.deinit();
        try expectEqual(2, scene.triangleCount());
        if (std.mem.find(u8, text, "inner") != null)
            try expectEqual(Vec3{ 1, 0, 0 }, colorOf(&scene, 0));
    }
    // What is wrong has its place in the file where it is.
    const cases = [_][3][]const u8{
        .{ "Include \"mesh.pbrt\" \"float x\" y", "text:1:63", "a number is expected, not 'y'" },
        .{ "Include \"mesh.pbrt\"", "mesh.pbrt:1:1", "trianglemesh: has no indices" },
        .{ "Include \"half.pbrt\" x", "text:1:53", "a number is expected, not 'x'" },
        .{ mesh ++ "Include \"no.pbrt\"", "text:1:99", "'no.pbrt' does not exist" },
        .{ "\"float x\" 1", "text:1:33", "a directive is expected" },
    };
    for (cases) |case| {
        var buffer: [400]u8 = undefined;
        const whole = try std.mem.print(&buffer, "{s}{s}", .{ start, case[0] });
        if (folder.read(whole, true)) |found| {
            var scene = found;
            scene.deinit();
            return error.TestExpectedError;
        } else |_| {}
        try expectEqualStrings(case[1], folder.said.place.text());
        try expectEqualStrings(case[2], folder.said.message.text());
    }
}

test "what is imported changes nothing of the text that imports it" {
    var folder: Folder = .make();
    defer folder.free();
    try folder.write("part.pbrt", "Translate 1 0 0 Material \"matte\" \"rgb Kd\" [1 0 0] " ++
        "MakeNamedMaterial \"b\" \"string type\" \"matte\" \"rgb Kd\" [0 0 1] Shape \"disk\"");
    try folder.write("open.pbrt", "AttributeBegin Translate 1 0 0");
    const text = start ++ "Material \"matte\" \"rgb Kd\" [0 1 0] Import \"part.pbrt\"\n" ++
        "Shape \"disk\" NamedMaterial \"b\" Shape \"disk\"";
    var scene = try folder.readClean(text);
    defer scene.deinit();
    for ([_]Vec3{ .{ 1, 0, 0 }, .{ 0, 1, 0 }, .{ 0, 0, 1 } }, 0..) |color, index|
        try expectEqual(color, colorOf(&scene, index));
    try expectEqual(1, scene.nodes[scene.instances[0].node].local.translation[0]);
    try expectEqual(0, scene.nodes[scene.instances[1].node].local.translation[0]);
    var open = try folder.readForgiven(
        start ++ "Import \"open.pbrt\" Shape \"disk\"",
        "open.pbrt:1: ",
        "1 blocks are begun and not ended",
    );
    defer open.deinit();
    try expectEqual(0, open.nodes[open.instances[0].node].local.translation[0]);
    try folder.write("end.pbrt", "AttributeEnd");
    const across = start ++ "AttributeBegin Import \"end.pbrt\"";
    try std.testing.expectError(error.InvalidInput, folder.read(across, true));
}

const bom = "\xef\xbb\xbf";

test "a byte order mark is passed over, before the scene and what it includes" {
    var folder: Folder = .make();
    defer folder.free();
    const said = "a byte order mark (BOM) is passed over";
    try folder.write("a.pbrt", bom ++ "Shape \"disk\"");
    try folder.write("a.spd", bom ++ "400 1 700 1");
    try folder.write("a.ply", bom ++ "ply\nformat ascii 1.0\nelement vertex 3\n" ++
        "property float x\nproperty float y\nproperty float z\nelement face 1\n" ++
        "property list uchar int vertex_index\nend_header\n0 0 0 1 0 0 0 1 0 3 0 1 2\n");
    for ([_][2][]const u8{
        .{ bom ++ start ++ "Shape \"disk\"", "line 1: " },
        .{ start ++ "Include \"a.pbrt\"", "a.pbrt:1: " },
        .{ start ++ "Import \"a.pbrt\"", "a.pbrt:1: " },
    }) |case| {
        var scene = try folder.readForgiven(case[0], case[1], said);
        defer scene.deinit();
        try expectEqual(32, scene.triangleCount());
    }
    var spectrum = try folder.readForgiven(
        start ++ "Material \"matte\" \"spectrum Kd\" \"a.spd\" Shape \"disk\"",
        "line 1: ",
        "'a.spd': " ++ said,
    );
    defer spectrum.deinit();
    try expect(colorOf(&spectrum, 0)[1] > 0.9);
    var mesh_scene = try folder.readForgiven(
        start ++ "Shape \"plymesh\" \"string filename\" \"a.ply\"",
        "line 1: ",
        "'a.ply': " ++ said,
    );
    defer mesh_scene.deinit();
    try expectEqual(1, mesh_scene.triangleCount());
    for ([_][]const u8{ "\xff\xfeS\x00", "\xfe\xff\x00S" }) |text| {
        try std.testing.expectError(error.InvalidInput, folder.read(text, true));
        try expectEqualStrings("is in UTF-16, not in UTF-8", folder.said.message.text());
    }
}

/// `Shape "disk"`, a triangle as PLY, and a whole scene.
const disk_gzip =
    "\x1f\x8b\x08\x00\x00\x00\x00\x00\x02\x03\x0b\xce\x48\x2c\x48\x55\x50\x4a\xc9\x2c" ++
    "\xce\x56\xe2\x02\x00\x5e\x99\xf1\x38\x0d\x00\x00\x00";
const ply_gzip =
    "\x1f\x8b\x08\x00\x00\x00\x00\x00\x02\x03\x5d\x4d\x41\x0a\xc3\x30\x0c\xbb\xfb\x15" ++
    "\x7e\xc1\x68\xd6\x07\x15\x93\x28\xd4\x90\x26\xc1\xcd\x46\xb2\xd7\xaf\xdb\xa1\x85" ++
    "\xa2\x83\x84\x24\xa4\x9a\x06\xc5\x62\x9b\x34\x96\xdd\xab\xb2\x7b\x4c\x84\x84\x0d" ++
    "\xb9\xf1\x1b\xd6\xd0\x79\xa6\x6a\xa5\x1e\x7a\x70\x4c\xe5\x68\xf6\xbb\x31\xee\xc6" ++
    "\xe7\xdc\x88\xe2\xc1\xee\xca\x93\xee\x8d\x5f\x7e\x15\x63\x3d\x2f\x16\xcd\x01\x9d" ++
    "\x90\xc3\xb2\x42\x02\x8c\x26\xfe\xc1\xf1\xc5\xf3\x9f\x9f\xf4\x05\x9b\x0e\xdd\x84" ++
    "\xb2\x00\x00\x00";
const scene_gzip =
    "\x1f\x8b\x08\x00\x00\x00\x00\x00\x02\x03\x73\x4e\xcc\x4d\x2d\x4a\x54\x50\x2a\x48" ++
    "\x2d\x2a\x2e\x48\x4d\x2e\xc9\x2c\x4b\x55\x52\x08\xcf\x2f\xca\x49\x71\x4a\x4d\xcf" ++
    "\xcc\x53\x08\xce\x48\x2c\x48\x55\x50\x4a\xc9\x2c\xce\x56\xe2\x02\x00\xea\x1b\x66" ++
    "\x84\x2d\x00\x00\x00";

test "files of gzip are read as what they hold, by content" {
    var folder: Folder = .make();
    defer folder.free();
    try folder.write("disk.pbrt.gz", disk_gzip);
    try folder.write("disk.pbrt", disk_gzip);
    try folder.write("a.ply.gz", ply_gzip);
    try folder.write("cut.ply.gz", ply_gzip[0 .. ply_gzip.len - 1]);
    const ply = start ++ "Shape \"plymesh\" \"string filename\" ";
    for ([_][]const u8{
        start ++ "Include \"disk.pbrt.gz\"",
        start ++ "Import \"disk.pbrt.gz\"",
        ply ++ "\"a.ply.gz\"",
    }, [_]usize{ 32, 32, 1 }) |text, count| {
        var scene = try folder.readClean(text);
        defer scene.deinit();
        try expectEqual(count, scene.triangleCount());
    }
    var hidden = try folder.readForgiven(
        start ++ "Include \"disk.pbrt\"",
        "line 1: ",
        "'disk.pbrt' is gzip without being called so",
    );
    defer hidden.deinit();
    for ([_][]const u8{ "a.pbrt", "a.pbrt.gz", "-" }, [_]usize{ 1, 0, 0 }) |name, count| {
        var said: Diagnostic = .{};
        const dir = folder.temporary.dir;
        var whole = try parse.parseNamed(gpa, io, name, scene_gzip, dir, .{}, &said);
        defer whole.deinit();
        try expectEqual(32, whole.triangleCount());
        try expectEqual(count, said.warning_count);
        const settings: raylane.settings.Load = .{ .strict = true };
        const strict = parse.parseNamed(gpa, io, name, scene_gzip, dir, settings, &said);
        if (count > 0) try std.testing.expectError(error.InvalidInput, strict) else {
            var same = try strict;
            same.deinit();
        }
    }
    try std.testing.expectError(error.InvalidInput, folder.read(ply ++ "\"cut.ply.gz\"", true));
    const text = folder.said.message.text();
    try expect(std.mem.startsWith(u8, text, "'cut.ply.gz' its gzip data is"));
}

test "blocks end in any order" {
    var folder: Folder = .make();
    defer folder.free();
    const parts = "ObjectBegin \"o\" AttributeBegin Translate 1 0 0 Shape \"disk\" ";
    var object = try folder.readForgiven(
        start ++ "AttributeBegin " ++ parts ++ "AttributeEnd AttributeEnd Shape \"disk\" " ++
            "ObjectEnd Shape \"disk\" ObjectInstance \"o\" ObjectInstance \"o\"",
        "line 1: ",
        "AttributeEnd, but ObjectBegin came last: the order does not count",
    );
    defer object.deinit();
    // The object goes on to its end.
    try expectEqual(5, object.instances.len);
    var mixed = try folder.readForgiven(
        start ++ "AttributeBegin Translate 1 0 0 TransformBegin Translate 1 0 0 " ++
            "Material \"matte\" \"rgb Kd\" [1 0 0] AttributeEnd Shape \"disk\" " ++
            "TransformEnd Shape \"disk\"",
        "line 1: ",
        "AttributeEnd, but TransformBegin came last: the order does not count",
    );
    defer mixed.deinit();
    // One stack has transformations, the other all else.
    try expectEqual(Vec3{ 0.5, 0.5, 0.5 }, colorOf(&mixed, 0));
    try expectEqual(1, mixed.nodes[mixed.instances[0].node].local.translation[0]);
    try expectEqual(0, mixed.nodes[mixed.instances[1].node].local.translation[0]);
}

test "names that nothing has" {
    var folder: Folder = .make();
    defer folder.free();
    const cases = [_]struct { []const u8, []const u8, []const u8, Vec3 }{
        .{
            "NamedMaterial \"x\"",
            "line 2: ",
            "material 'x' is not defined: grey matte stands for it",
            .{ 0.5, 0.5, 0.5 },
        },
        .{
            "MakeNamedMaterial \"x\" \"rgb Kd\" [1 0 0] NamedMaterial \"x\"",
            "line 2: ",
            "the material has no type: it is matte",
            .{ 1, 0, 0 },
        },
        .{
            "Material \"velvet\" \"rgb Kd\" [1 0 0]",
            "line 2: ",
            "Material 'velvet' is not one of PBRT's: matte stands for it",
            .{ 1, 0, 0 },
        },
        .{
            "MakeNamedMaterial \"a\" \"string type\" \"velvet\" \"rgb reflectance\" [1 0 0] " ++
                "NamedMaterial \"a\"",
            "line 2: ",
            "Material 'velvet' is not one of PBRT's: matte stands for it",
            .{ 1, 0, 0 },
        },
        .{
            "MakeNamedMaterial \"a\" \"string type\" \"matte\" \"rgb Kd\" [1 0 0] " ++
                "Material \"mix\" \"string materials\" [\"a\" \"x\"] \"float amount\" 0",
            "line 2: ",
            "material 'x' is not defined: grey matte stands for it",
            .{ 1, 0, 0 },
        },
        .{
            "Material \"matte\" \"texture Kd\" \"x\"",
            "line 2: ",
            "texture 'x' is not defined: the default of 'Kd' stands for it",
            .{ 0.5, 0.5, 0.5 },
        },
        .{
            "CoordSysTransform \"x\"",
            "line 2: ",
            "no coordinate system 'x': nothing changes",
            .{ 0.5, 0.5, 0.5 },
        },
        .{
            "ColorSpace \"x\"",
            "line 2: ",
            "no color space 'x': nothing changes",
            .{ 0.5, 0.5, 0.5 },
        },
        .{
            "Attribute \"x\" \"float alpha\" 0",
            "line 2: ",
            "Attribute of 'x', which is nothing",
            .{ 0.5, 0.5, 0.5 },
        },
    };
    for (cases) |case| {
        var buffer: [400]u8 = undefined;
        const text = try std.mem.print(&buffer, "{s}\n{s} Shape \"disk\"", .{ start, case[0] });
        var scene = try folder.readForgiven(text, if (std.mem.startsWith(u8, case[2], "material"))
            ""
        else
            case[1], if (std.mem.startsWith(u8, case[2], "material"))
            try std.mem.print(buffer[300..], "line 2: {s}", .{case[2]})
        else
            case[2]);
        defer scene.deinit();
        try expectEqual(case[3], colorOf(&scene, 0));
    }
}

test "a material may be named before it is defined" {
    var folder: Folder = .make();
    defer folder.free();
    var scene = try folder.readClean(start ++ "NamedMaterial \"a\" Shape \"disk\" " ++
        "MakeNamedMaterial \"a\" \"string type\" \"diffuse\" \"rgb reflectance\" [0 1 0] " ++
        "NamedMaterial \"a\" Shape \"sphere\"");
    defer scene.deinit();
    for (0..2) |index| try expectEqual(Vec3{ 0, 1, 0 }, colorOf(&scene, index));
}

test "an object may be instanced before it is defined, and is left out where it never is" {
    var folder: Folder = .make();
    defer folder.free();
    const early = start ++ "Translate 1 0 0 ObjectInstance \"o\" Identity " ++
        "ObjectBegin \"o\" Shape \"disk\" ObjectEnd ";
    var scene = try folder.readClean(early);
    defer scene.deinit();
    try expectEqual(1, scene.instances.len);
    try expectEqual(1, scene.nodes[scene.instances[0].node].local.translation[0]);
    var without = try folder.readForgiven(
        early ++ "\nObjectInstance \"x\" ObjectInstance \"x\" ObjectInstance \"y\"",
        "",
        "line 2: no object 'x': it is left out",
    );
    defer without.deinit();
    try expectEqual(1, without.instances.len);
}

test "backslashes in names of files are slashes, but lead nowhere else" {
    var folder: Folder = .make();
    defer folder.free();
    try folder.temporary.dir.createDir(io, "in", .default_dir);
    try folder.write("in/a.pbrt", mesh ++ indices);
    try folder.write("in/a.spd", "400 1 700 1");
    for ([_][]const u8{ "Include \"in\\a.pbrt\"", "Import \".\\in\\a.pbrt\"" }) |text| {
        var buffers: [2][200]u8 = undefined;
        const whole = try std.mem.print(&buffers[0], "{s}{s}", .{ start, text });
        const said = try std.mem.print(&buffers[1], "'{s}': backslashes are taken as slashes", .{
            text[std.mem.findScalar(u8, text, '"').? + 1 .. text.len - 1],
        });
        var scene = try folder.readForgiven(whole, "line 1: ", said);
        defer scene.deinit();
        try expectEqual(2, scene.triangleCount());
    }
    const outside = folder.read(start ++ "Include \"..\\a.pbrt\"", false);
    try std.testing.expectError(error.InvalidInput, outside);
    var image = try folder.read(start ++ "LightSource \"infinite\" \"string filename\" " ++
        "\"in\\a.spd\" Shape \"disk\"", false);
    defer image.deinit();
    try expectEqual(1, image.images.len);
}

test "lists of a mesh that do not fit are left out, spectra come in any order" {
    var folder: Folder = .make();
    defer folder.free();
    const cases = [_]struct { []const u8, []const u8 }{
        .{ "\"normal N\" [0 0 1]", "trianglemesh: has 1 normals N for 4 points" },
        .{
            "\"integer indices\" [0 1 2 0 2 3 1]",
            "trianglemesh: 7 indices make no whole triangles",
        },
    };
    for (cases) |case| {
        var buffer: [300]u8 = undefined;
        const text = try std.mem.print(&buffer, "{s}{s}{s}{s}", .{ start, mesh, indices, case[0] });
        var scene = try folder.readForgiven(text, "line 1: ", case[1]);
        defer scene.deinit();
        try expectEqual(2, scene.triangleCount());
        try expectEqual(null, scene.meshes[0].normals);
    }
    var empty = try folder.readClean(start ++ "Shape \"trianglemesh\" \"point3 P\" [] " ++
        "\"integer indices\" [] Shape \"disk\"");
    defer empty.deinit();
    try expectEqual(32, empty.triangleCount());
    try folder.write("a.spd", "400,0\r\n500,.8 # c\r\n600,0");
    try folder.write("b.spd", "600 0 500 .8 400 0 400 1 700");
    const shape = " Shape \"disk\"";
    const named = start ++ "Material \"matte\" \"spectrum Kd\" ";
    var sorted = try folder.readClean(named ++ "\"a.spd\"" ++ shape);
    defer sorted.deinit();
    for ([_][]const u8{ "\"b.spd\"", "[600 0 500 .8 400 0 400 1]" }) |values| {
        var buffer: [300]u8 = undefined;
        const text = try std.mem.print(&buffer, "{s}{s}{s}", .{ named, values, shape });
        const said = "a spectrum is pairs of rising wavelengths and values";
        var scene = try folder.readForgiven(text, "line 1: ", said);
        defer scene.deinit();
        try expectEqual(colorOf(&sorted, 0), colorOf(&scene, 0));
    }
}

test "a named material of the type of no name is a boundary" {
    var folder: Folder = .make();
    defer folder.free();
    var scene = try folder.readClean(start ++ "MakeNamedMaterial \"a\" \"string type\" \"\" " ++
        "NamedMaterial \"a\" Shape \"disk\" Material \"matte\" Shape \"sphere\"");
    defer scene.deinit();
    try expectEqual(1, scene.meshes.len);
}

test "a mixture with a boundary is as dense as the other's share" {
    var folder: Folder = .make();
    defer folder.free();
    const named = start ++ "MakeNamedMaterial \"a\" \"string type\" \"interface\" " ++
        "MakeNamedMaterial \"b\" \"string type\" \"matte\" \"rgb Kd\" [1 0 0] " ++
        "Material \"mix\" \"string materials\" [\"a\" \"b\"] \"float amount\" ";
    for ([_][]const u8{ "0", ".25", "1" }, [_]?f32{ null, 0.25, 1 }) |amount, opacity| {
        var buffer: [400]u8 = undefined;
        const text = try std.mem.print(&buffer, "{s}{s} Shape \"disk\"", .{ named, amount });
        var scene = try folder.read(text, true);
        defer scene.deinit();
        try expectEqual(@as(usize, if (opacity == null) 0 else 1), scene.meshes.len);
        if (opacity == null) continue;
        const material = &scene.materials[scene.meshes[0].material];
        try expectEqual([4]f32{ 1, 0, 0, opacity.? }, material.base_color);
        try expectEqual(opacity.? < 1, material.alpha_mode == .blend);
    }
}

test "what Attribute says counts where a directive does not, within its block" {
    var folder: Folder = .make();
    defer folder.free();
    var scene = try folder.readClean(start ++
        \\Attribute "material" "rgb reflectance" [1 0 0] "float eta" 1.3
        \\AttributeBegin
        \\Attribute "material" "rgb reflectance" [0 1 0]
        \\Attribute "shape" "float radius" 2 "float innerradius" 1
        \\Attribute "light" "rgb I" [1 2 3]
        \\Attribute "texture" "rgb value" [.25 .5 .75]
        \\Material "diffuse"
        \\Shape "disk" "float radius" 3
        \\Texture "t" "spectrum" "constant"
        \\Material "coateddiffuse" "texture reflectance" "t"
        \\Shape "disk"
        \\LightSource "point" "float scale" 2
        \\AttributeEnd
        \\Material "diffuse"
        \\Shape "disk"
        \\LightSource "point"
    );
    defer scene.deinit();
    try expectEqual(Vec3{ 0, 1, 0 }, colorOf(&scene, 0));
    try expectEqual(Vec3{ 0.25, 0.5, 0.75 }, colorOf(&scene, 1));
    try expectEqual(1.3, scene.materials[scene.meshes[1].material].ior);
    try expectEqual(Vec3{ 1, 0, 0 }, colorOf(&scene, 2));
    for ([_]f32{ 3, 2, 1 }, [_]usize{ 64, 64, 32 }, scene.meshes) |radius, count, shape| {
        var largest: f32 = 0;
        for (shape.positions) |position| largest = @max(largest, position[0]);
        try std.testing.expectApproxEqAbs(radius, largest, 1e-6);
        try expectEqual(count, shape.triangles.len);
    }
    try expectEqual(Vec3{ 2, 4, 6 }, scene.lights[0].color);
    try expectEqual(Vec3{ 1, 1, 1 }, scene.lights[1].color);
}

test "what samples and depth are clamped to is said" {
    var folder: Folder = .make();
    defer folder.free();
    const cases = [_]struct { []const u8, []const u8, ?u32, ?u32 }{
        .{
            "Sampler \"halton\" \"integer pixelsamples\" 100000",
            "line 1: Sampler: 100000 samples a pixel are taken as 4096",
            4096,
            null,
        },
        .{
            "Sampler \"stratified\" \"integer xsamples\" 0 \"integer ysamples\" 4",
            "line 1: Sampler: 0 samples a pixel are taken as 1",
            1,
            null,
        },
        .{
            "Integrator \"path\" \"integer maxdepth\" 100",
            "line 1: 'path': maxdepth 100 is taken as 32",
            null,
            32,
        },
        .{
            "SurfaceIntegrator \"whitted\" \"integer maxdepth\" 99",
            "line 1: 'whitted': maxdepth 99 is taken as 33",
            null,
            32,
        },
        .{
            "Integrator \"volpath\" \"integer maxdepth\" -1",
            "line 1: 'volpath': maxdepth -1 is taken as 0",
            null,
            0,
        },
        .{
            "Option \"seed\" 3 Option \"disablePixelJitter\" true " ++
                "Option \"bool pixelstats\" [false] " ++
                "Option \"string msereferenceout\" \"a b\" Option \"forcediffuse\" true",
            "line 1: Option 'forcediffuse' is not read",
            null,
            null,
        },
        .{
            "Option \"bool forcediffuse\" true",
            "line 1: Option 'forcediffuse' is not read",
            null,
            null,
        },
    };
    for (cases) |case| {
        var buffer: [400]u8 = undefined;
        const text = try std.mem.print(&buffer, "{s} {s}Shape \"disk\"", .{ case[0], start });
        var scene = try folder.read(text, true);
        defer scene.deinit();
        try expectEqual(1, folder.said.warning_count);
        try expectEqualStrings(case[1], folder.said.warnings[0].text());
        try expectEqual(case[2], scene.sample_count);
        try expectEqual(case[3], scene.depth);
    }
}

test "lights of version 4 are as bright as their scale, the film as its exposure" {
    var folder: Folder = .make();
    defer folder.free();
    const lights =
        \\WorldBegin
        \\LightSource "point" "blackbody I" 3000 "float scale" 10
        \\LightSource "point" "spectrum I" [400 3 700 3]
        \\LightSource "point" "rgb I" [1 2 3]
        \\ColorSpace "rec2020"
        \\LightSource "point" "rgb I" [0 1 0]
        \\AreaLightSource "diffuse" "spectrum L" [400 3 700 3] "float scale" 2
        \\Shape "disk"
    ;
    const four = "Film \"rgb\" \"float iso\" 200 Camera \"perspective\" \"float shutterclose\" .5 ";
    var new = try folder.readClean(four ++ lights);
    defer new.deinit();
    for ([_]f32{ 10, 1 }, new.lights[0..2]) |expected, light|
        try std.testing.expectApproxEqRel(expected, luminanceOf(light.color), 1e-4);
    try expectEqual(Vec3{ 1, 2, 3 }, new.lights[2].color);
    try expect(new.lights[3].color[0] == 0 and new.lights[3].color[1] > 1);
    const emitted = new.materials[new.meshes[0].material].emissive;
    try std.testing.expectApproxEqRel(2, luminanceOf(emitted), 1e-4);
    // In the older dialects a spectrum is what it says.
    const three = "Film \"image\" \"float scale\" 2 Camera \"perspective\" ";
    var old = try folder.readClean(three ++ lights);
    defer old.deinit();
    try std.testing.expectApproxEqRel(6, luminanceOf(old.lights[1].color), 1e-3);
    try expectEqual(Vec3{ 2, 4, 6 }, old.lights[2].color);
}

fn luminanceOf(color: Vec3) f32 {
    return 0.212671 * color[0] + 0.715160 * color[1] + 0.072169 * color[2];
}

test "parameters that nothing reads are said, once for each kind of directive" {
    var folder: Folder = .make();
    defer folder.free();
    var scene = try folder.read(
        \\Camera "perspective" "float aperture" 1 "float focaldistance" 2
        \\Film "rgb" "integer xresolution" 5 "integer xresolution" 10 "float diagonal" 35
        \\WorldBegin
        \\Attribute "shape" "float unknown" 1
        \\LightSource "point" "float brightness" 2 "integer nsamples" 4
        \\Material "matte" "float sigma" 20
        \\Shape "disk" "float shadowalpha" 0
        \\Shape "disk" "float shadowalpha" 0 "float radius" 2
        \\Shape "curve" "float width" 1
        \\Material "subsurface" "string name" "Ketchup" "float scale" 2
        \\Shape "disk"
    , true);
    defer scene.deinit();
    for ([_][]const u8{
        "line 1: Camera: 'aperture' is not read",
        "line 5: LightSource: 'brightness' is not read",
        "line 6: Material: 'sigma' is not read",
        "line 7: Shape: 'shadowalpha' is not read",
        "line 9: Shape 'curve' is not supported and left out",
    }, 0..) |text, index| try expectEqualStrings(text, folder.said.warnings[index].text());
    try expectEqual(5, folder.said.warning_count);
    try expectEqual(10, scene.resolution.?[0]);
    const ketchup = colorOf(&scene, 2);
    try expect(ketchup[0] > 4 * ketchup[1] and ketchup[0] > 4 * ketchup[2]);
}
