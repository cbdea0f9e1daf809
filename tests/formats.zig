//! OBJ with MTL, STL and PLY as scenes: known answers, what is wrong, and random damage.
//!
//! Files are made here, in memory; what they name lies in a fresh folder.

const std = @import("std");
const raylane = @import("raylane");
const Diagnostic = raylane.diagnostic.Diagnostic;
const Io = std.Io;
const Scene = raylane.scene.Scene;
const Vec3 = raylane.math.Vec3;
const expect = std.testing.expect;
const expectEqual = std.testing.expectEqual;
const gpa = std.testing.allocator;
const io = std.testing.io;
const srgb = raylane.math.srgb;

const Settings = raylane.settings.Load;

fn readIn(folder: Io.Dir, name: []const u8, bytes: []const u8, said: *Diagnostic) !Scene {
    var scene = try raylane.parse.parseNamed(gpa, io, name, bytes, folder, .{}, said);
    scene.check();
    return scene;
}

fn read(name: []const u8, bytes: []const u8, said: *Diagnostic) !Scene {
    return readIn(.cwd(), name, bytes, said);
}

/// A scene without a word of warning.
fn readClean(name: []const u8, bytes: []const u8) !Scene {
    var said: Diagnostic = .{};
    const scene = read(name, bytes, &said) catch |err| {
        std.debug.print("{s}\n", .{said.message.text()});
        return err;
    };
    for (said.warnings[0..said.warning_count]) |*warning| {
        std.debug.print("{s}\n", .{warning.text()});
        return error.TestUnexpectedWarning;
    }
    return scene;
}

fn expectError(needle: []const u8, name: []const u8, bytes: []const u8) !void {
    var said: Diagnostic = .{};
    errdefer std.debug.print("{s}\n", .{bytes});
    if (read(name, bytes, &said)) |found| {
        var scene = found;
        scene.deinit();
        return error.TestExpectedError;
    } else |err| try expectEqual(error.InvalidInput, err);
    try std.testing.expectEqualStrings(needle, said.message.text());
}

/// Expects one warning, which is an error with --strict.
fn expectForgiven(needle: []const u8, name: []const u8, bytes: []const u8) !Scene {
    var said: Diagnostic = .{};
    var scene = try read(name, bytes, &said);
    errdefer scene.deinit();
    try expectEqual(1, said.warning_count);
    try std.testing.expectEqualStrings(needle, said.warnings[0].text());
    var strict: Diagnostic = .{};
    const settings: Settings = .{ .strict = true };
    const refused = raylane.parse.parseNamed(gpa, io, name, bytes, .cwd(), settings, &strict);
    try std.testing.expectError(error.InvalidInput, refused);
    try std.testing.expectEqualStrings(needle, strict.message.text());
    return scene;
}

// OBJ.

test "OBJ: corners that share what they have are one vertex, polygons of all kinds are cut" {
    var scene = try readClean("a.obj",
        \\o thing
        \\v 0 0 0
        \\v 2 0 0
        \\v 2 2 0 1.0
        \\v 0 2 \
        \\  0
        \\vt 0 0
        \\vt 1 0.25
        \\vn 0 0 1
        \\g a b
        \\f 1//1 2//1 3//1 4//1 # a square
        \\f -4//-1 -3//-1 -2//-1
        \\v 1 .5 0
        \\f 1 2 3 5
    );
    defer scene.deinit();
    try expectEqual(2, scene.meshes.len);
    const smooth, const flat = .{ &scene.meshes[0], &scene.meshes[1] };
    try expectEqual(4, smooth.positions.len);
    try expectEqual(Vec3{ 0, 0, 1 }, smooth.normals.?[3]);
    try std.testing.expectEqualSlices(
        [3]u32,
        &.{ .{ 0, 1, 2 }, .{ 0, 2, 3 }, .{ 0, 1, 2 } },
        smooth.triangles,
    );
    // Concave at its last corner, from which it is cut.
    try expectEqual(null, flat.normals);
    try expectEqual(4, flat.positions.len);
    try expectEqual(2, flat.triangles.len);
    for (flat.triangles) |corners| {
        const a, const b, const c = .{
            flat.positions[corners[0]], flat.positions[corners[1]], flat.positions[corners[2]],
        };
        const vec3 = raylane.math.vec3;
        try expect(vec3.cross(vec3.sub(b, a), vec3.sub(c, a))[2] > 0);
    }
    // No material looks at coordinates, so that none are kept.
    try expectEqual(null, smooth.texcoords[0]);
    try expectEqual(0, scene.materials[0].metallic);
}

test "OBJ: a position may have any number of normals" {
    var text: Io.Writer.Allocating = .init(gpa);
    defer text.deinit();
    const writer = &text.writer;
    try writer.writeAll("v 0 0 0\nv 1 0 0\nv 0 1 0\n");
    const count = 20;
    for (1..count + 1) |x| try writer.print("vn {d} 0 1\n", .{x});
    for (0..2) |_| for (1..count + 1) |x| {
        try writer.print("f 1//{d} 2//{d} 3//{d}\n", .{ x, x, x });
    };
    var scene = try readClean("a.obj", text.written());
    defer scene.deinit();
    const mesh = &scene.meshes[0];
    try expectEqual(2 * count, mesh.triangles.len);
    try expectEqual(3 * count, mesh.positions.len);
    try expectEqual(mesh.triangles[count - 1], mesh.triangles[2 * count - 1]);
    for (mesh.triangles[0..count], 1..) |corners, x| {
        try expectEqual(@as(f32, @floatFromInt(x)), mesh.normals.?[corners[2]][0]);
    }
}

test "OBJ: smoothing groups make normals, each for itself" {
    // Two squares that meet at a right angle, in one group, and then in two.
    const corners =
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 0 -1\nv 1 1 -1\n";
    var one = try readClean("a.obj", corners ++ "s 1\nf 1 2 3 4\nf 2 5 6 3\n");
    defer one.deinit();
    try expectEqual(1, one.meshes.len);
    try expectEqual(6, one.meshes[0].positions.len);
    const half = @sqrt(0.5);
    for (one.meshes[0].normals.?[1], [3]f32{ half, 0, half }) |value, wanted| {
        try std.testing.expectApproxEqAbs(wanted, value, 1e-6);
    }
    var two = try readClean("a.obj", corners ++ "s 1\nf 1 2 3 4\ns 2\nf 2 5 6 3\n");
    defer two.deinit();
    try expectEqual(8, two.meshes[0].positions.len);
    try expectEqual(Vec3{ 0, 0, 1 }, two.meshes[0].normals.?[1]);
    var off = try readClean("a.obj", corners ++ "s 1\ns off\nf 1 2 3 4\nf 2 5 6 3\n");
    defer off.deinit();
    try expectEqual(null, off.meshes[0].normals);
}

test "OBJ: colours of vertices, lines and points, lines that end as on any system" {
    var scene = try readClean(
        "a.obj",
        "v 0 0 0 1 0.5 0\r\nv 1 0 0\r\rv 0 1 0\nf 1 2 3\nl 1 2 3/\np 1 3",
    );
    defer scene.deinit();
    try expectEqual(3, scene.meshes.len);
    const code: f32 = @floatCast(srgb.linear(0.5));
    try expectEqual([4]f32{ 1, code, 0, 1 }, scene.meshes[0].colors.?[0]);
    try expectEqual([4]f32{ 1, 1, 1, 1 }, scene.meshes[0].colors.?[2]);
    const line = &scene.meshes[1];
    try std.testing.expectEqualSlices([2]u32, &.{ .{ 0, 1 }, .{ 1, 2 } }, line.segments);
    try expect(scene.materials[line.material].unlit);
    try std.testing.expectEqualSlices(u32, &.{ 0, 1 }, scene.meshes[2].points);
    try expectEqual([4]f32{ 1, 1, 1, 1 }, scene.materials[0].base_color);
}

test "OBJ: vertices alone are a cloud of points" {
    var scene = try expectForgiven(
        "1 faces, lines or points with places that are not finite are left out",
        "a.obj",
        "v 0 0 0 1 0 0\nv 1.#QNAN -1.#IND 0 1 0 0\nv 1 0 0 0 1 0\n",
    );
    defer scene.deinit();
    try std.testing.expectEqualSlices(u32, &.{ 0, 1 }, scene.meshes[0].points);
    try expectEqual([4]f32{ 0, 1, 0, 1 }, scene.meshes[0].colors.?[1]);
}

test "MTL: a byte order mark, quotes and comments about names, statements in any case" {
    var folder = std.testing.tmpDir(.{});
    defer folder.cleanup();
    try folder.dir.writeFile(io, .{
        .sub_path = "a b.mtl",
        .data = "\xef\xbb\xbfnewmtl m\r\nkd 1 0 0\r\nmap_kd \"c d.png\"\r\n",
    });
    try folder.dir.writeFile(io, .{ .sub_path = "c d.png", .data = "image" });
    const text = "mtllib \"a b.mtl\"\nusemtl m # red\nv 0 0 0\nv 1 0 0\n" ++
        "v 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n";
    var said: Diagnostic = .{};
    var scene = try readIn(folder.dir, "a.obj", text, &said);
    defer scene.deinit();
    try expectEqual(0, said.warning_count);
    try expectEqual([4]f32{ 1, 0, 0, 1 }, scene.materials[0].base_color);
    try std.testing.expectEqualStrings("image", scene.images[0].bytes);
}

test "MTL: names of files with escapes of URIs, and in another letter case" {
    var folder = std.testing.tmpDir(.{});
    defer folder.cleanup();
    try folder.dir.createDir(io, "Maps", .default_dir);
    try folder.dir.writeFile(io, .{
        .sub_path = "A.MTL",
        .data = "newmtl m\nmap_Kd maps\\c.png\nmap_d c%20d.png\nmap_Ke e.png",
    });
    try folder.dir.writeFile(io, .{ .sub_path = "Maps/C.PNG", .data = "one" });
    try folder.dir.writeFile(io, .{ .sub_path = "Maps/c.Png", .data = "other" });
    try folder.dir.writeFile(io, .{ .sub_path = "c d.png", .data = "holes" });
    const text = "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n";
    var said: Diagnostic = .{};
    var scene = try readIn(folder.dir, "a.obj", text, &said);
    defer scene.deinit();
    try expectEqual(2, scene.images.len);
    try std.testing.expectEqualStrings("one", scene.images[0].bytes);
    try std.testing.expectEqualStrings("holes", scene.images[1].bytes);
    try expectEqual(3, said.warning_count);
    for ([_][]const u8{
        "material library 'a.mtl' is 'A.MTL'",
        "image 'maps\\c.png' is 'Maps/C.PNG'",
        "image 'e.png' does not exist, left out",
    }, said.warnings[0..3]) |expected, *warning| {
        try std.testing.expectEqualStrings(expected, warning.text());
    }
}

test "STL: lines that end in returns alone; PLY: a byte order mark" {
    var text = try readClean("a.stl", "solid a\rfacet normal 1.#IND 0 0\router loop\r" ++
        "vertex 0 0 0\rvertex 1 0 0\rvertex 0 1 0\rendloop\rendfacet\rendsolid a\r");
    defer text.deinit();
    try expectEqual(1, text.triangleCount());
    var points = try readClean("a", "\xef\xbb\xbf" ++ ply_vertices ++
        "end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n");
    defer points.deinit();
    try expectEqual(4, points.meshes[0].points.len);
}

test "OBJ: what is wrong is an error with its line" {
    const corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    try expectError("line 4: vertex 4 of 3", "a.obj", corners ++ "f 1 2 4");
    try expectError("line 4: vertex 0 of 3", "a.obj", corners ++ "f 0 1 2");
    try expectError("line 4: vertex -4 of 3", "a.obj", corners ++ "f -1 -2 -4");
    try expectError("line 4: 'x' is no corner", "a.obj", corners ++ "f 1 2 x");
    try expectError("line 4: '.5' is no corner", "a.obj", corners ++ "f 1 2 3.5");
    try expectError(
        "line 4: a number has too many digits",
        "a.obj",
        corners ++ "f 1 2 99999999999999999999",
    );
    try expectError("line 2: a vertex has three numbers", "a.obj", "g\nv 1 2\nf 1 1 1");
    try expectError(
        "line 1: a number is expected behind a vertex's first three",
        "a.obj",
        "v 1 2 3 x",
    );
}

test "OBJ: what can be left out is" {
    const corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 -inf\n";
    for ([_]struct { []const u8, []const u8, usize }{
        .{ "1 faces, lines or points with places that are not finite are left out", "f 1 2 4", 1 },
        .{ "line 6: 1 faces or lines have too few corners, left out", "f 1 2", 1 },
        .{
            "line 6: 3 normals or coordinates of textures are not in the file, left out",
            "f 1/7/9 2//1 3",
            2,
        },
        .{
            "line 6: 1 normals or coordinates of textures are not finite, left out",
            "vn 0 nan 0",
            1,
        },
        .{ "line 6: 'quux' is no statement of OBJ, ignored: 1 of them", "quux 1", 1 },
    }) |case| {
        var buffer: [200]u8 = undefined;
        const text = try std.mem.print(&buffer, "{s}f 1 2 3\n{s}", .{ corners, case[1] });
        var scene = try expectForgiven(case[0], "a.obj", text);
        defer scene.deinit();
        try expectEqual(case[2], scene.triangleCount());
    }
    var said: Diagnostic = .{};
    var empty = try read("a.obj", "# nothing\n", &said);
    defer empty.deinit();
    try std.testing.expectEqualStrings(
        "nothing to render: no faces, lines or points",
        said.warnings[0].text(),
    );
}

const library =
    \\# by hand
    \\newmtl matt
    \\Kd 0.5 0 1
    \\illum 1
    \\newmtl shiny one
    \\Kd 1 1 1
    \\Ks .5 .25 0
    \\Ns 30
    \\newmtl window
    \\d 0.25
    \\newmtl mirror
    \\Kd 0 0 0
    \\Ks 1 1 1
    \\illum 3
    \\newmtl glass
    \\illum 7
    \\Ni 1.25
    \\Tf 1 .5 .5
    \\newmtl metal
    \\Kd 1 1 1
    \\Pm 1
    \\Pr .5
    \\Pc .75
    \\Pcr .25
    \\Ps .5
    \\aniso .5
    \\newmtl textured
    \\Kd 0 0 0
    \\map_Kd -s 2 3 1 -o .5 .25 -clamp on sub folder\a b.png
    \\map_d sub folder\a b.png
    \\map_Pr r.png
    \\norm -bm 2 C:\textures\n.png
    \\newmtl bumpy
    \\map_Bump -bm .5 r.png
    \\newmtl lamp
    \\Ke 3 2 1
    \\newmtl matt
    \\Kd 1 1 1
;

const with_library =
    "mtllib my materials.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 .25\nvt 1 0\nvt 0 1\n" ++
    "usemtl matt\nf 1 2 3\nusemtl shiny one\nf 1 2 3\nusemtl window\nf 1 2 3\n" ++
    "usemtl mirror\nf 1 2 3\nusemtl glass\nf 1 2 3\nusemtl metal\nf 1 2 3\n" ++
    "usemtl textured\nf 1/1 2/2 3/3\n" ++
    "usemtl bumpy\nf 1/1 2/2 3/3\nusemtl lamp\nf 1 2 3\nusemtl matt\nf 3 2 1\n";

test "MTL: every kind of material becomes ours" {
    var folder = std.testing.tmpDir(.{});
    defer folder.cleanup();
    try folder.dir.writeFile(io, .{ .sub_path = "my materials.mtl", .data = library });
    try folder.dir.createDir(io, "sub folder", .default_dir);
    for ([_][]const u8{ "sub folder/a b.png", "r.png", "n.png" }) |name| {
        try folder.dir.writeFile(io, .{ .sub_path = name, .data = name });
    }
    var said: Diagnostic = .{};
    var scene = try readIn(folder.dir, "a.obj", with_library, &said);
    defer scene.deinit();
    try expectEqual(0, said.warning_count);
    try expectEqual(9, scene.meshes.len);
    try expectEqual(2, scene.meshes[0].triangles.len);
    const all = scene.materials;
    const code: f32 = @floatCast(srgb.linear(0.5));
    try expectEqual([4]f32{ code, 0, 1, 1 }, all[0].base_color);
    try expectEqual(1, all[0].ior);
    try expectEqual(.@"opaque", all[0].alpha_mode);
    try expectEqual(0.5, all[1].specular);
    try expectEqual(Vec3{ 1, 0.5, 0 }, all[1].specular_color);
    try expectEqual(0.5, all[1].roughness); // The fourth root of 2 / 32.
    try expectEqual(0.25, all[2].base_color[3]);
    try expectEqual(.blend, all[2].alpha_mode);
    try expect(all[3].ior > 1000 and all[3].roughness == 0 and all[3].base_color[0] == 0);
    try expect(all[4].transmission == 1 and all[4].volume and all[4].ior == 1.25);
    try expectEqual([4]f32{ 1, 0.5, 0.5, 1 }, all[4].base_color);
    try expect(all[5].metallic == 1 and all[5].roughness == 0.5 and all[5].anisotropy == 0.5);
    try expect(all[5].clearcoat == 0.75 and all[5].clearcoat_roughness == 0.25);
    try expectEqual(Vec3{ 0.5, 0.5, 0.5 }, all[5].sheen_color);
    try expectEqual(Vec3{ 3, 2, 1 }, all[8].emissive);
    try expectEqual(0.5, all[7].normal_scale);
    const relief = scene.images[scene.textures[all[7].normal_texture.?.texture].image];
    try expect(relief.is_relief);
    try std.testing.expectEqualStrings("r.png", relief.bytes);
    const textured = &all[6];
    try expectEqual([4]f32{ 1, 1, 1, 1 }, textured.base_color);
    try expectEqual(.mask, textured.alpha_mode);
    try expectEqual(null, textured.alpha_texture); // The same image has alpha itself.
    const view = textured.base_color_texture.?;
    try expectEqual([2][3]f32{ .{ 2, 0, 0.5 }, .{ 0, 3, -2.25 } }, view.transform);
    const texture = scene.textures[view.texture];
    try expectEqual(.clamp_to_edge, texture.wrap[0]);
    try std.testing.expectEqualStrings("sub folder/a b.png", scene.images[texture.image].bytes);
    try expectEqual(2, textured.normal_scale);
    try expectEqual(4, scene.images.len);
    try expectEqual([2]f32{ 0, 0.75 }, scene.meshes[6].texcoords[0].?[0]);
}

test "MTL: what is missing is grey, with a warning" {
    var folder = std.testing.tmpDir(.{});
    defer folder.cleanup();
    var said: Diagnostic = .{};
    var scene = try readIn(folder.dir, "a.obj", with_library, &said);
    defer scene.deinit();
    try expectEqual(1, said.warning_count);
    try std.testing.expectEqualStrings(
        "material library 'my materials.mtl' does not exist",
        said.warnings[0].text(),
    );
    try expectEqual(0.5, scene.materials[0].base_color[0]);
    // Under the name of the scene it is found all the same.
    try folder.dir.writeFile(io, .{ .sub_path = "a.mtl", .data = "newmtl matt\nmap_Kd x.png\nhm" });
    try folder.dir.writeFile(io, .{ .sub_path = "c.mtl", .data = "newmtl a\nrefl r.png\nKa 1" });
    var unread: Diagnostic = .{};
    var third = try readIn(folder.dir, "c.obj", "mtllib c.mtl\nv 0 0 0\np 1", &unread);
    third.deinit();
    try expectEqual(1, unread.warning_count);
    try std.testing.expectEqualStrings(
        "'c.mtl': refl is not rendered",
        unread.warnings[0].text(),
    );
    var other: Diagnostic = .{};
    var named = try readIn(folder.dir, "b/a.obj", with_library, &other);
    defer named.deinit();
    try std.testing.expectEqualStrings(
        "'a.mtl': line 3: 'hm' is not understood, ignored",
        other.warnings[0].text(),
    );
    try std.testing.expectEqualStrings(
        "image 'x.png' does not exist, left out",
        other.warnings[1].text(),
    );
    try std.testing.expectEqualStrings(
        "material 'shiny one' is not defined, grey",
        other.warnings[2].text(),
    );
    try expectEqual([4]f32{ 1, 1, 1, 1 }, named.materials[0].base_color);
}

// STL.

/// Two triangles, with these bits of colour, after a header that begins like this.
fn binaryStl(comptime head: []const u8, attributes: [2]u16) [184]u8 {
    var bytes: [184]u8 = @splat(' ');
    bytes[0..head.len].* = head[0..head.len].*;
    std.mem.writeInt(u32, bytes[80..84], 2, .little);
    for (attributes, 0..) |attribute, index| {
        const triangle = bytes[84 + 50 * index ..][0..50];
        @memset(triangle, 0);
        for ([_]usize{ 6, 10 }, 0..) |place, which| {
            const value: f32 = @floatFromInt(1 + which + index);
            std.mem.writeInt(u32, triangle[4 * place ..][0..4], @bitCast(value), .little);
        }
        std.mem.writeInt(u16, triangle[48..50], attribute, .little);
    }
    return bytes;
}

test "STL: text and binary, whatever they begin with, z upwards" {
    const text =
        \\SOLID a facet of a name
        \\facet normal 0 0 nan
        \\ outer loop
        \\  vertex 0 0 0
        \\  vertex 1e0 0 0
        \\  vertex 0 2 0
        \\ endloop
        \\endfacet
        \\endsolid a
        \\solid b
        \\facet normal 0 0 1 outer loop vertex 0 0 0 vertex 1 0 0 vertex 1 1 0 vertex 0 1 0
        \\endloop endfacet endsolid
    ;
    var scene = try readClean("a", text);
    defer scene.deinit();
    try expect(scene.is_z_up);
    try expectEqual(9, scene.meshes[0].positions.len);
    try expectEqual(Vec3{ 0, 2, 0 }, scene.meshes[0].positions[2]);
    try expectEqual([3]u32{ 6, 7, 8 }, scene.meshes[0].triangles[2]);
    try expectEqual(null, scene.meshes[0].normals);
    var binary = try readClean("a", &binaryStl("solid facet", .{ 0, 0 }));
    defer binary.deinit();
    try expectEqual(2, binary.triangleCount());
    try expectEqual(Vec3{ 0, 0, 0 }, binary.meshes[0].positions[0]);
    try expectEqual(Vec3{ 1, 0, 0 }, binary.meshes[0].positions[1]);
    try expectEqual(Vec3{ 0, 3, 0 }, binary.meshes[0].positions[5]);
    try expectEqual(null, binary.meshes[0].colors);
}

test "STL: colours in both of their ways, and rubbish in their place" {
    var viscam = try readClean("a", &binaryStl("x", .{ 0x8000 | 31 << 10, 0 }));
    defer viscam.deinit();
    try expectEqual([4]f32{ 1, 0, 0, 1 }, viscam.meshes[0].colors.?[2]);
    try expect(viscam.meshes[0].colors.?[3][1] == 0.5);
    const head = "COLOR=\x00\xff\x00\xff";
    var magics = try readClean("a", &binaryStl(head, .{ 31 << 10, 0x8000 }));
    defer magics.deinit();
    try expectEqual([4]f32{ 0, 0, 1, 1 }, magics.meshes[0].colors.?[0]);
    try expectEqual([4]f32{ 0, 1, 0, 1 }, magics.meshes[0].colors.?[3]);
    for ([_][2]u16{ .{ 0x8001, 7 }, .{ 0xffff, 0xffff } }) |attributes| {
        var rubbish = try readClean("a", &binaryStl("x", attributes));
        defer rubbish.deinit();
        try expectEqual(null, rubbish.meshes[0].colors);
    }
}

test "STL: what is wrong" {
    var bytes = binaryStl("x", .{ 0, 0 });
    try expectError("STL claims 2 triangles, its 183 bytes hold 1", "a.stl", bytes[0..183]);
    try expectError("STL of 83 bytes is cut short", "a.stl", bytes[0..83]);
    var longer = try expectForgiven(
        "3 bytes behind the triangles are ignored",
        "a.stl",
        bytes ++ "abc",
    );
    longer.deinit();
    std.mem.writeInt(u32, bytes[80..84], 0, .little);
    var uncounted =
        try expectForgiven("STL claims 0 triangles, all 2 are read", "a.stl", &bytes);
    defer uncounted.deinit();
    try expectEqual(2, uncounted.triangleCount());
    std.mem.writeInt(u32, bytes[80..84], std.math.maxInt(u32), .little);
    var unknown = try expectForgiven(
        "STL claims 4294967295 triangles, all 2 are read",
        "a.stl",
        &bytes,
    );
    defer unknown.deinit();
    try expectEqual(2, unknown.triangleCount());
    try expectError(
        "STL claims 4294967295 triangles, its 183 bytes hold 1",
        "a.stl",
        bytes[0..183],
    );
    std.mem.writeInt(u32, bytes[80..84], 2, .little);
    std.mem.writeInt(u32, bytes[100..104], 0x7fc00000, .little);
    var broken = try expectForgiven(
        "1 triangles with corners that are not finite are left out",
        "a.stl",
        &bytes,
    );
    defer broken.deinit();
    try expectEqual(1, broken.triangleCount());
    const head = "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n";
    try expectError("line 5: the facet does not end", "a.stl", head[0 .. head.len - 1]);
    try expectError("line 6: a number is expected", "a.stl", head ++ "vertex 1 b 0\n");
    var short = try expectForgiven(
        "a facet has less than three corners, and is left out",
        "a.stl",
        head ++ "vertex 0 1 0 endfacet facet vertex 0 0 0 vertex 1 0 0 endfacet",
    );
    short.deinit();
}

// PLY.

const ply_vertices = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\n" ++
    "property float y\nproperty float z\n";

test "PLY: colours of vertices, of faces, and coordinates of corners" {
    var scene = try readClean("a", ply_vertices ++
        \\property uchar red
        \\property uchar green
        \\property uchar blue
        \\property uchar alpha
        \\element face 1
        \\property list uchar int vertex_indices
        \\end_header
        \\0 0 0 255 0 0 255
        \\1 0 0 0 255 0 255
        \\1 1 0 0 0 188 51
        \\0 1 0 0 0 0 255
        \\4 0 1 2 3
    );
    defer scene.deinit();
    try expectEqual([4]f32{ 0, 0, srgb.decoded[188], 0.2 }, scene.meshes[0].colors.?[2]);
    try expectEqual(.blend, scene.materials[0].alpha_mode);
    try expectEqual(2, scene.triangleCount());
    var folder = std.testing.tmpDir(.{});
    defer folder.cleanup();
    try folder.dir.writeFile(io, .{ .sub_path = "t t.png", .data = "image" });
    var said: Diagnostic = .{};
    var own = try readIn(folder.dir, "a", ply_vertices ++
        \\comment TextureFile t t.png
        \\element face 2
        \\property list uchar int vertex_indices
        \\property list uchar float texcoord
        \\property float red
        \\property float green
        \\property float blue
        \\end_header
        \\0 0 0 1 0 0 1 1 0 0 1 0
        \\3 0 1 2 0 1 0 0
        \\3 0 2 3 6 0 0 1 0.75 0 1 0 255 0
    , &said);
    defer own.deinit();
    try expectEqual(0, said.warning_count);
    const mesh = &own.meshes[0];
    try expectEqual(6, mesh.positions.len);
    try expectEqual(Vec3{ 1, 1, 0 }, mesh.positions[4]);
    try expectEqual([2]f32{ 1, 0.25 }, mesh.texcoords[0].?[4]);
    try expectEqual([2]f32{ 0, 1 }, mesh.texcoords[0].?[0]);
    try expectEqual([4]f32{ 0, 1, 0, 1 }, mesh.colors.?[4]);
    try std.testing.expectEqualStrings("image", own.images[0].bytes);
}

test "PLY: strips and faces that have no colours beside some that do are white" {
    for ([_][]const u8{ "uchar", "float" }) |kind| {
        const text = try std.fmt.allocPrint(std.testing.allocator, ply_vertices ++
            \\element tristrips 1
            \\property list int int vertex_indices
            \\element face 1
            \\property list uchar int vertex_indices
            \\property {s} red
            \\element face 1
            \\property list uchar int vertex_indices
            \\end_header
            \\0 0 0 1 0 0 1 1 0 0 1 0
            \\3 0 1 2
            \\3 0 1 2 255
            \\4 0 1 2 3
        , .{kind});
        defer std.testing.allocator.free(text);
        var scene = try readClean("a", text);
        defer scene.deinit();
        const colors = scene.meshes[0].colors.?;
        try expectEqual(12, colors.len);
        for (colors, 0..) |color, index| {
            const other: f32 = if (index / 3 == 1) 0 else 1;
            try expectEqual([4]f32{ 1, other, other, 1 }, color);
        }
    }
}

test "PLY: names in any case, and alpha of 0 everywhere is none" {
    var said: Diagnostic = .{};
    var scene = try read("a", "ply\nformat ascii 1.0\nelement Vertex 3\nproperty FLOAT X\n" ++
        "property float Y\nproperty float Z\nproperty uchar Red\nproperty uchar Alpha\n" ++
        "element FACE 1\nproperty list uchar int Vertex_Indices\nend_header\n" ++
        "1 2 3 255 0 4 5 6 0 0 7 8 9 0 0 3 0 1 2", &said);
    defer scene.deinit();
    const mesh = &scene.meshes[0];
    try expectEqual(Vec3{ 1, 2, 3 }, mesh.positions[0]);
    try expectEqual(1, scene.triangleCount());
    try expectEqual([4]f32{ 1, 0, 0, 1 }, mesh.colors.?[0]);
    try expectEqual(.@"opaque", scene.materials[0].alpha_mode);
    try expectEqual(1, said.warning_count);
    try std.testing.expectEqualStrings(
        "alpha is 0 everywhere: taken as opaque",
        said.warnings[0].text(),
    );
}

test "PLY: nothing at all is a warning" {
    var said: Diagnostic = .{};
    var scene = try read("a", "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\n" ++
        "element face 0\nproperty list uchar int vertex_indices\nend_header\n", &said);
    defer scene.deinit();
    try std.testing.expectEqualStrings(
        "nothing to render: no triangles",
        said.warnings[0].text(),
    );
}

test "PLY: lines that end in returns alone, faces that look as their normals say" {
    var scene = try readClean("a", "ply\rformat binary_little_endian 1.0\rcomment x\r" ++
        "element vertex 3\rproperty char x\rproperty char y\rproperty char z\r" ++
        "property char nx\rproperty char ny\rproperty char nz\r" ++
        "element face 1\rproperty list uchar uchar vertex_index\rend_header\r" ++
        "\x0a\x00\x00\x00\x00\x01\x01\x00\x00\x00\x00\x01\x00\x01\x00\x00\x00\x01" ++
        "\x03\x00\x01\x02");
    defer scene.deinit();
    try expectEqual(Vec3{ 10, 0, 0 }, scene.meshes[0].positions[0]);
    try expectEqual([3]u32{ 0, 2, 1 }, scene.meshes[0].triangles[0]);
}

test "PLY: points, edges and strips" {
    var points = try expectForgiven(
        "1 faces, edges or points whose places are not finite are left out",
        "a",
        ply_vertices ++ "end_header\n0 0 0\n1 0 0\nnan 0 0\n0 1 0\n",
    );
    defer points.deinit();
    try std.testing.expectEqualSlices(u32, &.{ 0, 1, 3 }, points.meshes[0].points);
    try expect(points.materials[0].unlit);
    var edges = try readClean("a", ply_vertices ++
        "element edge 2\nproperty int vertex1\nproperty int vertex2\nend_header\n" ++
        "0 0 0 1 0 0 1 1 0 0 1 0 0 1 3 2");
    defer edges.deinit();
    const segments = edges.meshes[0].segments;
    try std.testing.expectEqualSlices([2]u32, &.{ .{ 0, 1 }, .{ 3, 2 } }, segments);
    var strips = try readClean("a", ply_vertices ++
        "element tristrips 1\nproperty list int int vertex_indices\nend_header\n" ++
        "0 0 0 1 0 0 1 1 0 0 1 0 8 0 1 2 3 -1 3 2 1");
    defer strips.deinit();
    try std.testing.expectEqualSlices(
        [3]u32,
        &.{ .{ 0, 1, 2 }, .{ 2, 1, 3 }, .{ 3, 2, 1 } },
        strips.meshes[0].triangles,
    );
}

test "a gzip file is what it holds, but not twice" {
    var bytes: Io.Writer.Allocating = .init(gpa);
    defer bytes.deinit();
    const plain = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    try gzipped(&bytes.writer, plain);
    var scene = try readClean("a.obj.gz", bytes.written());
    defer scene.deinit();
    try expectEqual(1, scene.triangleCount());
    var twice: Io.Writer.Allocating = .init(gpa);
    defer twice.deinit();
    try gzipped(&twice.writer, bytes.written());
    try expectError("is a gzip file within another one; unpack it", "a", twice.written());
    try expectError("its gzip data is cut short", "a", bytes.written()[0..12]);
}

/// One stored block (RFC 1951, 3.2.4).
fn gzipped(writer: *Io.Writer, bytes: []const u8) !void {
    try writer.writeAll("\x1f\x8b\x08\x00\x00\x00\x00\x00\x00\x03\x01");
    const length: u16 = @intCast(bytes.len);
    try writer.writeInt(u16, length, .little);
    try writer.writeInt(u16, ~length, .little);
    try writer.writeAll(bytes);
    try writer.writeInt(u32, std.hash.Crc32.hash(bytes), .little);
    try writer.writeInt(u32, length, .little);
}

test "what is forced by --format-in, and what is no scene" {
    var said: Diagnostic = .{};
    const settings: Settings = .{ .format = .obj };
    var scene =
        try raylane.parse.parseNamed(gpa, io, "a", "#x\ncall y\n", .cwd(), settings, &said);
    scene.deinit();
    try expectError(
        "is no glTF, PBRT, OBJ, STL or PLY file by its contents (see --format-in)",
        "a",
        "hello",
    );
    try expectError("is empty", "a.glb", "");
    try expectError("is a PNG; a picture is no scene", "a.obj", "\x89PNG\r\n\x1a\n");
}

// Damage.

/// Reads copies of a file in which some bytes are others, or which end early.
fn damage(name: []const u8, bytes: []const u8, seed: u64, rounds: usize) !void {
    var random_state: std.Random.DefaultPrng = .init(seed);
    const random = random_state.random();
    const copy = try gpa.dupe(u8, bytes);
    defer gpa.free(copy);
    for (0..rounds) |_| {
        @memcpy(copy, bytes);
        for (0..random.uintAtMost(usize, 3)) |_| {
            const index = random.uintLessThan(usize, bytes.len);
            copy[index] = switch (random.uintLessThan(u8, 3)) {
                0 => random.int(u8),
                1 => bytes[random.uintLessThan(usize, bytes.len)],
                else => " /-.#\n09\\"[random.uintLessThan(usize, 9)],
            };
        }
        const length = if (random.boolean()) bytes.len else random.uintAtMost(usize, bytes.len);
        var said: Diagnostic = .{};
        var scene = read(name, copy[0..length], &said) catch |err| {
            try expectEqual(error.InvalidInput, err);
            try expect(said.message.text().len > 0);
            continue;
        };
        scene.deinit();
    }
}

const obj_text =
    \\v 0 0 0 1 0 0
    \\v 1 0 0
    \\v 1 1 0
    \\v 0 1 \
    \\ 0
    \\vt 0 0
    \\vn 0 0 1
    \\s 1
    \\f 1/1/1 2/1/1 3//1 -1
    \\f 1 2 3 4
    \\usemtl a
    \\l 1 2
    \\p 3 4
;

const stl_text =
    \\solid x
    \\facet normal 0 0 1
    \\outer loop
    \\vertex 0 0 0
    \\vertex 1 0 0
    \\vertex 0 1 0
    \\endloop
    \\endfacet
    \\endsolid
;

const ply_text = ply_vertices ++
    \\property uchar red
    \\element face 1
    \\property list uchar int vertex_indices
    \\property list uchar float texcoord
    \\element tristrips 1
    \\property list int int vertex_indices
    \\element edge 1
    \\property int vertex1
    \\property int vertex2
    \\end_header
    \\0 0 0 255 1 0 0 0 1 1 0 9 0 1 0 8
    \\4 0 1 2 3 8 0 0 1 0 1 1 0 1
    \\4 0 1 2 -1
    \\0 1
;

test "no damage to an OBJ, STL or PLY file crashes" {
    try damage("a.obj", obj_text, 1, 300);
    try damage("a.stl", &binaryStl("solid COLOR=\xff\x00\x00\xff", .{ 0, 0x8000 }), 2, 100);
    try damage("a.stl", stl_text, 3, 100);
    try damage("a.ply", ply_text, 4, 300);
}

test "no damage to a material library crashes" {
    var random_state: std.Random.DefaultPrng = .init(5);
    const random = random_state.random();
    var folder = std.testing.tmpDir(.{});
    defer folder.cleanup();
    const bytes = library.*;
    for (0..40) |_| {
        var copy = bytes;
        for (0..4) |_| copy[random.uintLessThan(usize, copy.len)] =
            " -.#\n09\\\x00\xff"[random.uintLessThan(usize, 10)];
        try folder.dir.writeFile(io, .{ .sub_path = "my materials.mtl", .data = &copy });
        var said: Diagnostic = .{};
        var scene = try readIn(folder.dir, "a.obj", with_library, &said);
        scene.deinit();
    }
}

fn readWithLibrary(allocator: std.mem.Allocator, folder: Io.Dir) !void {
    var said: Diagnostic = .{};
    var scene = try raylane.parse.parseNamed(
        allocator,
        io,
        "a.obj",
        with_library,
        folder,
        .{},
        &said,
    );
    scene.deinit();
}

test "a lack of memory while an OBJ file is read leaks none" {
    var folder = std.testing.tmpDir(.{});
    defer folder.cleanup();
    try folder.dir.writeFile(io, .{ .sub_path = "my materials.mtl", .data = library });
    try std.testing.checkAllAllocationFailures(gpa, readWithLibrary, .{folder.dir});
}

fn readAndFree(allocator: std.mem.Allocator, name: []const u8, bytes: []const u8) !void {
    var said: Diagnostic = .{};
    var scene = try raylane.parse.parseNamed(allocator, io, name, bytes, .cwd(), .{}, &said);
    scene.deinit();
}

test "a lack of memory while an STL, PLY or gzip file is read leaks none" {
    var packed_file: Io.Writer.Allocating = .init(gpa);
    defer packed_file.deinit();
    try gzipped(&packed_file.writer, obj_text);
    for ([_][2][]const u8{
        .{ "a.stl", &binaryStl("solid COLOR=\xff\x00\x00\xff", .{ 0, 0x8000 }) },
        .{ "a.stl", stl_text },
        .{ "a.ply", ply_text },
        .{ "a.obj.gz", packed_file.written() },
    }) |file| try std.testing.checkAllAllocationFailures(gpa, readAndFree, .{ file[0], file[1] });
}
