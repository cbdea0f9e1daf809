//! PBRT scenes from outside: every directive, shape, material and light in a text of a few lines,
//! what is wrong with its place, and pictures whose pixels are computed by hand.
//!
//! In: texts in this file, files in a fresh folder, and the scenes beside the checkout where there
//! are any.

const std = @import("std");
const fixture = @import("fixture.zig");
const raylane = @import("raylane");
const Diagnostic = raylane.diagnostic.Diagnostic;
const Image = raylane.image.Image;
const Scene = raylane.scene.Scene;
const Vec3 = raylane.math.Vec3;
const elementary = raylane.math.elementary;
const expect = std.testing.expect;
const expectEqual = std.testing.expectEqual;
const gpa = std.testing.allocator;
const io = std.testing.io;
const parse = raylane.parse;
const vec3 = raylane.math.vec3;

fn read(text: []const u8, said: *Diagnostic) !Scene {
    var scene = try parse.parsePbrt(gpa, io, text, .cwd(), .{}, said);
    scene.check();
    return scene;
}

/// A scene without a word of warning.
fn readClean(text: []const u8) !Scene {
    var said: Diagnostic = .{};
    const scene = read(text, &said) catch |err| {
        std.debug.print("{s}: {s}\n", .{ said.place.text(), said.message.text() });
        return err;
    };
    if (said.warning_count > 0) {
        std.debug.print("{s}\n", .{said.warnings[0].text()});
        return error.TestUnexpectedWarning;
    }
    return scene;
}

/// The camera's axes are the world's: x right, y up, z forward.
const plain_camera = "Camera \"perspective\" \"float fov\" 90 ";

inline fn world(comptime text: []const u8) []const u8 {
    return comptime plain_camera ++ "WorldBegin\n" ++ text ++ "\nWorldEnd";
}

fn expectNear(expected: f32, actual: f32, tolerance: f32) !void {
    if (@abs(expected - actual) <= tolerance) return;
    std.debug.print("expected {d}, found {d}\n", .{ expected, actual });
    return error.TestExpectedClose;
}

// Pictures.

/// Two squares of half side 0.25 under an even sky: red at (1, 0, 0), green at (0, 1, 0).
const two_squares =
    \\Film "image" "integer xresolution" 100 "integer yresolution" 100
    \\WorldBegin
    \\LightSource "infinite" "rgb L" [1 1 1]
    \\Material "matte" "rgb Kd" [1 0 0]
    \\Shape "trianglemesh" "integer indices" [0 1 2 0 2 3]
    \\  "point P" [.75 -.25 0  1.25 -.25 0  1.25 .25 0  .75 .25 0]
    \\Material "matte" "rgb Kd" [0 1 0]
    \\Shape "trianglemesh" "integer indices" [0 1 2 0 2 3]
    \\  "point P" [-.25 .75 0  .25 .75 0  .25 1.25 0  -.25 1.25 0]
;

fn renderText(text: []const u8, width: u32, height: u32) !Image {
    var scene = try readClean(text);
    defer scene.deinit();
    return fixture.render(&scene, .{ .width = width, .height = height });
}

fn expectColor(color: [3]f32, image: *const Image, x: u32, y: u32) !void {
    const pixel = image.at(x, y).*;
    errdefer std.debug.print("at {d}, {d}: {any}\n", .{ x, y, pixel });
    for (color, pixel[0..3]) |expected, channel| try expectNear(expected, channel, 1e-5);
}

test "a left-handed world: x is to the right of who looks along z, and after Scale -1 1 1 left" {
    // At distance 5 with fov 90 the picture spans -5..5, ten pixels a metre: x = 1 is the pixels
    // 57.5 to 62.5, y = 1 those from 37.5 to 42.5 below the top.
    const look = "LookAt 0 0 -5  0 0 0  0 1 0\n" ++ plain_camera;
    var image = try renderText(look ++ two_squares, 100, 100);
    defer image.deinit(gpa);
    try expectColor(.{ 1, 0, 0 }, &image, 58, 50);
    try expectColor(.{ 1, 0, 0 }, &image, 61, 48);
    try expectColor(.{ 1, 1, 1 }, &image, 63, 50);
    try expectColor(.{ 1, 1, 1 }, &image, 40, 50);
    try expectColor(.{ 0, 1, 0 }, &image, 50, 40);
    try expectColor(.{ 1, 1, 1 }, &image, 50, 60);

    var mirrored = try renderText("Scale -1 1 1\n" ++ look ++ two_squares, 100, 100);
    defer mirrored.deinit(gpa);
    try expectColor(.{ 1, 0, 0 }, &mirrored, 40, 50);
    try expectColor(.{ 1, 1, 1 }, &mirrored, 60, 50);
    try expectColor(.{ 0, 1, 0 }, &mirrored, 50, 40);

    // From behind, right and left change places.
    const behind = "LookAt 0 0 5  0 0 0  0 1 0\n" ++ plain_camera;
    var back = try renderText(behind ++ two_squares, 100, 100);
    defer back.deinit(gpa);
    try expectColor(.{ 1, 0, 0 }, &back, 40, 50);
    try expectColor(.{ 0, 1, 0 }, &back, 50, 40);
}

test "fov spans the shorter side" {
    const look = "LookAt 0 0 -5  0 0 0  0 1 0\n" ++ plain_camera;
    // Wide: 100 pixels are 10 m high. Tall: 100 pixels are 10 m wide.
    const sizes = [_][2]u32{ .{ 200, 100 }, .{ 100, 200 } };
    for (sizes) |size| {
        var buffer: [1024]u8 = undefined;
        const film = "Film \"image\" \"integer xresolution\" {d} " ++
            "\"integer yresolution\" {d}\n{s}{s}";
        const squares = two_squares[std.mem.find(u8, two_squares, "WorldBegin").?..];
        const text = try std.mem.print(&buffer, film, .{ size[0], size[1], look, squares });
        var image = try renderText(text, size[0], size[1]);
        defer image.deinit(gpa);
        try expectColor(.{ 1, 0, 0 }, &image, size[0] / 2 + 11, size[1] / 2);
        try expectColor(.{ 1, 1, 1 }, &image, size[0] / 2 + 5, size[1] / 2);
        try expectColor(.{ 0, 1, 0 }, &image, size[0] / 2, size[1] / 2 - 10);
    }
}

test "orthographic cameras show their window, wherever it lies" {
    const look =
        \\LookAt 0 0 -5  0 0 0  0 1 0
        \\Camera "orthographic" "float screenwindow" [0 2 -1 1]
        \\
    ;
    var image = try renderText(look ++ two_squares, 100, 100);
    defer image.deinit(gpa);
    try expectColor(.{ 1, 0, 0 }, &image, 50, 50); // x = 1 is the middle of 0..2.
    try expectColor(.{ 1, 0, 0 }, &image, 38, 39);
    try expectColor(.{ 1, 1, 1 }, &image, 36, 50);
    try expectColor(.{ 0, 1, 0 }, &image, 5, 1);
    // Left and right change places.
    var scene = try readClean(
        \\LookAt 0 0 -5  0 0 0  0 1 0
        \\Film "rgb" "integer xresolution" 9 "integer yresolution" 9
        \\Camera "orthographic" "float screenwindow" [2 0 -1 1]
        \\WorldBegin Shape "disk"
    );
    defer scene.deinit();
    const place = &scene.nodes[scene.cameras[0].node].local;
    try expectEqual(1, place.translation[0]);
    try expectEqual(-1, place.x[0]);
    try expectEqual(1, place.y[1]);
}

test "a disk that shines lights what it looks at as its area does, and is dark from behind" {
    // A small disk 2 m above a floor: E = L A cos^4 / d^2 off the axis, L A / d^2 below it.
    const lamp =
        \\AttributeBegin
        \\AreaLightSource "diffuse" "rgb L" [100 100 100]
        \\Material "matte" "rgb Kd" [0 0 0]
        \\Translate 0 2 0
        \\Rotate 90 1 0 0
        \\Shape "disk" "float radius" .1
        \\AttributeEnd
        \\Material "matte" "rgb Kd" [1 1 1]
        \\Shape "trianglemesh" "integer indices" [0 1 2 0 2 3]
        \\  "point P" [-9 0 -9 9 0 -9 9 0 9 -9 0 9]
    ;
    const view = "LookAt 0 1 0  0 0 0  0 0 1\n";
    var image = try renderText(view ++ world(lamp), 33, 33);
    defer image.deinit(gpa);
    const expected = 100 * 0.01 * std.math.pi / 4.0 / std.math.pi;
    // The disk is a polygon.
    try expectNear(expected, image.at(16, 16)[0], 0.03 * expected);
    // From above the lamp: black before a floor that is lit.
    var above = try renderText("LookAt 0 4 0  0 0 0  0 0 1\n" ++ world(lamp), 33, 33);
    defer above.deinit(gpa);
    try expectColor(.{ 0, 0, 0 }, &above, 16, 16);
    // From below it: bright.
    var below = try renderText("LookAt 0 1.9 0  0 2 0  0 0 1\n" ++ world(lamp), 33, 33);
    defer below.deinit(gpa);
    try expectColor(.{ 100, 100, 100 }, &below, 16, 16);
}

test "a lamp of alpha 0 is not seen, stops no light and shines as any other" {
    // A square above a floor, seen from above through the lamp, and without alpha from the side.
    const lamp =
        \\AttributeBegin
        \\AreaLightSource "diffuse" "rgb L" [1 2 3] "bool twosided" false
        \\Material "matte" "rgb Kd" [0 0 0]
        \\Shape "trianglemesh" "integer indices" [0 1 2 0 2 3]
        \\  "point P" [-1 2 -1 1 2 -1 1 2 1 -1 2 1]
    ;
    const floor =
        \\AttributeEnd
        \\Material "matte" "rgb Kd" [1 1 1]
        \\Shape "trianglemesh" "integer indices" [0 1 2 0 2 3]
        \\  "point P" [-9 0 -9 9 0 -9 9 0 9 -9 0 9]
    ;
    const zero = "Texture \"zero\" \"float\" \"constant\" \"float value\" 0";
    const above = "LookAt 0 4 0  0 0 0  0 0 1\n";
    const below = "LookAt 0 1 0  0 0 0  0 0 1\n";
    var shown = try renderText(below ++ world(lamp ++ "\n" ++ floor), 9, 9);
    defer shown.deinit(gpa);
    try expect(shown.at(4, 4)[0] > 0.1);
    for ([_][]const u8{ "\"float alpha\" 0 ", "\"texture alpha\" \"zero\" " }) |alpha| {
        for ([_][]const u8{ below, above }) |look| {
            var buffer: [2048]u8 = undefined;
            const text = try std.mem.print(
                &buffer,
                "{s}{s}WorldBegin {s}\n{s} {s}{s}",
                .{ look, plain_camera, zero, lamp, alpha, floor },
            );
            var hidden = try renderText(text, 9, 9);
            defer hidden.deinit(gpa);
            try expectColor(shown.at(4, 4)[0..3].*, &hidden, 4, 4);
        }
    }
}

// Shapes.

const Measures = struct { triangles: usize, area: f64, volume: f64, low: Vec3, high: Vec3 };

/// Of the first mesh, in its own space. Normals, where there are any, agree with the faces.
fn measure(scene: *const Scene) !Measures {
    const mesh = scene.meshes[0];
    var result: Measures = .{
        .triangles = mesh.triangles.len,
        .area = 0,
        .volume = 0,
        .low = @splat(std.math.inf(f32)),
        .high = @splat(-std.math.inf(f32)),
    };
    for (mesh.triangles) |corners| {
        const a, const b, const c = .{
            mesh.positions[corners[0]], mesh.positions[corners[1]], mesh.positions[corners[2]],
        };
        const face = vec3.cross(vec3.sub(b, a), vec3.sub(c, a));
        result.area += 0.5 * vec3.length(face);
        result.volume += vec3.dot(a, face) / 6;
        if (mesh.normals) |normals| for (corners) |corner| {
            try expect(vec3.dot(face, normals[corner]) > 0);
            try expectNear(1, vec3.length(normals[corner]), 1e-5);
        };
    }
    for (mesh.positions) |position| {
        result.low = vec3.min(result.low, position);
        result.high = vec3.max(result.high, position);
    }
    return result;
}

const ShapeCase = struct { text: []const u8, triangles: usize, area: f64, volume: ?f64 = null };

fn expectShape(case: ShapeCase) !Measures {
    errdefer std.debug.print("{s}\n", .{case.text});
    var buffer: [4096]u8 = undefined;
    const text = try std.mem.print(
        &buffer,
        plain_camera ++ "WorldBegin\nShape {s}\nWorldEnd",
        .{case.text},
    );
    var scene = try readClean(text);
    defer scene.deinit();
    const found = try measure(&scene);
    try expectEqual(case.triangles, found.triangles);
    errdefer std.debug.print("{any}\n", .{found});
    try expect(@abs(found.area / case.area - 1) < 0.02);
    if (case.volume) |volume| try expect(@abs(found.volume / volume - 1) < 0.03);
    return found;
}

test "quadrics, whole and in part, look outwards" {
    const pi = std.math.pi;
    const cases = [_]ShapeCase{
        .{ .text = "\"sphere\"", .triangles = 1984, .area = 4 * pi, .volume = 4 * pi / 3.0 },
        .{
            .text = "\"sphere\" \"float radius\" 2 \"float zmin\" 0 \"float phimax\" 90",
            .triangles = 8 * (2 * 16 - 1),
            .area = 2 * pi,
        },
        .{
            .text = "\"cylinder\" \"float radius\" 2 \"float zmin\" -1 \"float zmax\" 3",
            .triangles = 64,
            .area = 16 * pi,
        },
        .{ .text = "\"cylinder\" \"float phimax\" 180", .triangles = 32, .area = 2 * pi },
        .{ .text = "\"disk\" \"float radius\" 2", .triangles = 32, .area = 4 * pi },
        .{ .text = "\"disk\" \"float innerradius\" .5", .triangles = 64, .area = 0.75 * pi },
        .{ .text = "\"cone\"", .triangles = 32, .area = @sqrt(2.0) * pi },
        .{
            .text = "\"paraboloid\"",
            .triangles = 32 * 31,
            .area = pi / 6.0 * (@sqrt(125.0) - 1),
        },
        .{
            .text = "\"hyperboloid\" \"point p1\" [1 0 0] \"point p2\" [1 0 2]",
            .triangles = 32 * 32,
            .area = 4 * pi,
        },
    };
    for (cases) |case| _ = try expectShape(case);
    const shifted = try expectShape(.{
        .text = "\"disk\" \"float height\" 3",
        .triangles = 32,
        .area = pi,
    });
    try expectEqual(3, shifted.low[2]);
}

test "the tolerance is the user's" {
    var said: Diagnostic = .{};
    for ([_]u32{ 4, 16, 64 }) |steps| {
        const settings: raylane.settings.Load = .{ .tessellation = steps };
        const text = comptime world("Shape \"sphere\"");
        var scene = try parse.parsePbrt(gpa, io, text, .cwd(), settings, &said);
        defer scene.deinit();
        try expectEqual(2 * steps * (steps - 1), scene.triangleCount());
    }
}

test "meshes of all kinds" {
    _ = try expectShape(.{
        .text = "\"trianglemesh\" \"integer indices\" [0 1 2] \"point P\" [0 0 0 1 0 0 0 1 0] " ++
            "\"normal N\" [0 0 -1 0 0 -1 0 0 -1]", // The face turns to its normals.
        .triangles = 1,
        .area = 0.5,
    });
    _ = try expectShape(.{
        .text = "\"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]",
        .triangles = 1,
        .area = 0.5,
    });
    _ = try expectShape(.{
        .text = "\"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0]",
        .triangles = 2,
        .area = 1,
    });
    const field = try expectShape(.{
        .text = "\"heightfield\" \"integer nu\" 3 \"integer nv\" 2 \"float Pz\" [0 0 0 1 1 1]",
        .triangles = 4,
        .area = @sqrt(2.0),
    });
    try expectEqual(Vec3{ 1, 1, 1 }, field.high);
}

test "a subdivided octahedron nears its limit, a flat square keeps its border" {
    const octahedron = "\"loopsubdiv\" \"integer indices\" " ++
        "[0 2 4 2 1 4 1 3 4 3 0 4 2 0 5 1 2 5 3 1 5 0 3 5] " ++
        "\"point P\" [1 0 0 -1 0 0 0 1 0 0 -1 0 0 0 1 0 0 -1] ";
    const coarse = try expectShape(.{
        .text = octahedron ++ "\"integer nlevels\" 2",
        .triangles = 128,
        .area = 2.346,
    });
    const fine = try expectShape(.{
        .text = octahedron ++ "\"integer levels\" 4",
        .triangles = 2048,
        .area = 2.44,
    });
    // Vertices are at their limit on any level: for four neighbours half of the way to them.
    try expectNear(0.5, coarse.high[0], 1e-6);
    try expectNear(0.5, fine.high[0], 1e-6);
    try expect(fine.volume > coarse.volume);
    const square = try expectShape(.{
        .text = "\"loopsubdiv\" \"integer indices\" [0 1 2 0 2 3] " ++
            "\"point P\" [0 0 0 1 0 0 1 1 0 0 1 0]",
        .triangles = 128,
        .area = 0.675, // Within a closed cubic B-spline.
    });
    try expectEqual(0, square.low[2]);
    try expectEqual(0, square.high[2]);
}

test "a bilinear NURBS is flat, a rational one is a cylinder" {
    _ = try expectShape(.{
        .text = "\"nurbs\" \"integer nu\" 2 \"integer nv\" 2 \"integer uorder\" 2 " ++
            "\"integer vorder\" 2 \"float uknots\" [0 0 1 1] \"float vknots\" [0 0 1 1] " ++
            "\"point P\" [0 0 0 2 0 0 0 3 0 2 3 0]",
        .triangles = 2048,
        .area = 6,
    });
    // A quarter of a circle by three points of weights 1, root of a half, 1 (Piegl and Tiller 7.3).
    const arc = "\"nurbs\" \"integer nu\" 3 \"integer nv\" 2 \"integer uorder\" 3 " ++
        "\"integer vorder\" 2 \"float uknots\" [0 0 0 1 1 1] \"float vknots\" [0 0 1 1] " ++
        "\"float Pw\" [1 0 0 1 .70710678 .70710678 0 .70710678 0 1 0 1 " ++
        "1 0 1 1 .70710678 .70710678 .70710678 .70710678 0 1 1 1]";
    _ = try expectShape(.{ .text = arc, .triangles = 2048, .area = std.math.pi / 2.0 });
    var scene = try readClean(comptime world("Shape " ++ arc));
    defer scene.deinit();
    for (scene.meshes[0].positions, scene.meshes[0].normals.?) |position, normal| {
        try expectNear(1, @sqrt(position[0] * position[0] + position[1] * position[1]), 1e-5);
        try expectNear(position[0], normal[0], 1e-4);
        try expectNear(position[1], normal[1], 1e-4);
    }
}

test "ReverseOrientation turns shapes inside out, mirroring transformations do not" {
    var scene = try readClean(comptime world(
        \\Shape "sphere"
        \\ReverseOrientation
        \\Shape "sphere"
        \\Shape "trianglemesh" "point P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1 2]
    ));
    defer scene.deinit();
    try expectEqual(3, scene.meshes.len);
    const a = scene.meshes[0].triangles[7];
    try expectEqual([3]u32{ a[0], a[2], a[1] }, scene.meshes[1].triangles[7]);
    try expectEqual(-scene.meshes[0].normals.?[0][2], scene.meshes[1].normals.?[0][2]);
    try expectEqual([3]u32{ 0, 2, 1 }, scene.meshes[2].triangles[0]);
}

// Directives.

/// Where the first instance puts the point (x, y, z), in the world as its camera has it.
fn placeOf(scene: *const Scene, instance: usize, point: Vec3) Vec3 {
    var at: raylane.math.Vec3d = .{ point[0], point[1], point[2] };
    var node = scene.instances[instance].node;
    while (node != raylane.scene.none) : (node = scene.nodes[node].parent) {
        // The root mirrors z where the camera does not.
        if (scene.nodes[node].parent != raylane.scene.none) at = scene.nodes[node].local.point(at);
    }
    return .{ @floatCast(at[0]), @floatCast(at[1]), @floatCast(at[2]) };
}

test "transformations act in the order in which they stand" {
    const cases = .{
        .{ "Translate 1 2 3", Vec3{ 2, 2, 3 } },
        .{ "Scale 2 3 4", Vec3{ 2, 0, 0 } },
        .{ "Rotate 90 0 0 1", Vec3{ 0, 1, 0 } },
        .{ "Translate 1 0 0 Rotate 90 0 0 1", Vec3{ 1, 1, 0 } },
        .{ "Rotate 90 0 0 1 Translate 1 0 0", Vec3{ 0, 2, 0 } },
        .{ "Translate 9 9 9 Identity", Vec3{ 1, 0, 0 } },
        .{ "Transform [1 0 0 0  0 1 0 0  0 0 1 0  5 6 7 1]", Vec3{ 6, 6, 7 } },
        .{ "Translate 1 0 0 Transform [1 0 0 0 0 1 0 0 0 0 1 0 5 6 7 1]", Vec3{ 6, 6, 7 } },
        .{ "Scale 2 2 2 ConcatTransform [1 0 0 0 0 1 0 0 0 0 1 0 5 6 7 1]", Vec3{ 12, 12, 14 } },
        .{ "LookAt 1 0 0  1 0 1  0 1 0", Vec3{ 0, 0, 0 } },
        .{ "Translate 1 0 0 CoordinateSystem \"a\" Identity " ++
            "CoordSysTransform \"a\"", Vec3{ 2, 0, 0 } },
        .{ "CoordSysTransform \"camera\"", Vec3{ 1, 0, 0 } },
        .{ "Translate 4 0 0 CoordSysTransform \"world\"", Vec3{ 1, 0, 0 } },
        .{ "AttributeBegin Translate 1 0 0 AttributeEnd", Vec3{ 1, 0, 0 } },
        .{ "TransformBegin Translate 1 0 0 TransformEnd", Vec3{ 1, 0, 0 } },
        .{ "TransformTimes 0 1", Vec3{ 1, 0, 0 } },
    };
    inline for (cases) |case| {
        errdefer std.debug.print("{s}\n", .{case[0]});
        const shape = "\nShape \"sphere\" \"float radius\" 1";
        const before = comptime std.mem.startsWith(u8, case[0], "TransformTimes");
        const text = if (before)
            case[0] ++ " " ++ plain_camera ++ "WorldBegin" ++ shape
        else
            plain_camera ++ "WorldBegin " ++ case[0] ++ shape;
        var scene = try readClean(text);
        defer scene.deinit();
        const found = placeOf(&scene, 0, .{ 1, 0, 0 });
        for (case[1], found) |expected, number| try expectNear(expected, number, 1e-6);
    }
}

test "what moves is shown as it is at the start, and it is said" {
    var said: Diagnostic = .{};
    var scene = try read(comptime world(
        \\ActiveTransform EndTime
        \\Translate 5 0 0
        \\ActiveTransform StartTime
        \\Translate 0 1 0
        \\ActiveTransform All
        \\Shape "sphere"
    ), &said);
    defer scene.deinit();
    try expectEqual(Vec3{ 1, 1, 0 }, placeOf(&scene, 0, .{ 1, 0, 0 }));
    try expectEqual(1, said.warning_count);
    try std.testing.expectEqualStrings(
        "line 2: ActiveTransform: what moves is shown at the start",
        said.warnings[0].text(),
    );
}

test "film, sampler and integrator are defaults of the picture" {
    const text =
        \\Film "image" "integer xresolution" [30] "integer yresolution" [20]
        \\  "string filename" "/etc/passwd"
        \\Sampler "stratified" "integer xsamples" 2 "integer ysamples" 3
        \\PixelFilter "box" "float xwidth" 1
        \\Accelerator "bvh"
        \\Renderer "sampler"
        \\SurfaceIntegrator "whitted" "integer maxdepth" 5
        \\Camera "perspective"
        \\WorldBegin
        \\Shape "sphere"
    ;
    var scene = try readClean(text);
    defer scene.deinit();
    try expectEqual([2]u32{ 30, 20 }, scene.resolution.?);
    try expectEqual(6, scene.sample_count.?);
    try expectEqual(4, scene.depth.?); // Whitted's counts the first ray.
    const camera = scene.cameras[0].projection.perspective;
    try expectNear(std.math.pi / 2.0, camera.y_fov_rad, 1e-6);
    try expectNear(1.5, camera.aspect.?, 1e-6);
    var other = try readClean(
        \\Sampler "halton" "integer pixelsamples" 8
        \\Integrator "path" "integer maxdepth" 20
        \\Camera "perspective" "float fov" 30 "float frameaspectratio" 1.333333
        \\WorldBegin
        \\Shape "sphere"
    );
    defer other.deinit();
    try expectEqual([2]u32{ 640, 480 }, other.resolution.?);
    try expectEqual(8, other.sample_count.?);
    try expectEqual(20, other.depth.?);
    var newer = try readClean("Film \"rgb\" Camera \"perspective\" WorldBegin Shape \"disk\"");
    defer newer.deinit();
    try expectEqual([2]u32{ 1280, 720 }, newer.resolution.?);
    try expectNear(std.math.pi / 6.0, other.cameras[0].projection.perspective.y_fov_rad, 1e-6);
}

test "objects are shown anywhere, as often as they are named" {
    var scene = try readClean(comptime world(
        \\Translate 0 1 0
        \\ObjectBegin "pair"
        \\Shape "disk"
        \\Translate 1 0 0
        \\Shape "sphere"
        \\ObjectEnd
        \\Identity
        \\ObjectInstance "pair"
        \\Scale 2 2 2
        \\ObjectInstance "pair"
        \\Shape "sphere"
    ));
    defer scene.deinit();
    try expectEqual(2, scene.meshes.len); // The last sphere is the object's.
    try expectEqual(5, scene.instances.len);
    try expectEqual(2 * 32 + 3 * 1984, scene.triangleCount());
    try expectEqual(Vec3{ 0, 1, 0 }, placeOf(&scene, 0, .{ 0, 0, 0 }));
    try expectEqual(Vec3{ 1, 1, 0 }, placeOf(&scene, 1, .{ 0, 0, 0 }));
    try expectEqual(Vec3{ 2, 2, 0 }, placeOf(&scene, 3, .{ 0, 0, 0 }));
    try expectEqual(Vec3{ 0, 0, 0 }, placeOf(&scene, 4, .{ 0, 0, 0 }));
}

test "a world that only prepares another gives way to it, a second picture does not" {
    const first = "Renderer \"surfacepoints\"\n" ++ world("Shape \"disk\"");
    const second = "\nFilm \"image\" \"integer xresolution\" 7\n" ++ world("Shape \"sphere\"");
    var both = try readClean(first ++ second);
    defer both.deinit();
    try expectEqual(1984, both.triangleCount());
    var named = try readClean(first ++ "\nRenderer \"sampler\"" ++ second);
    defer named.deinit();
    try expectEqual(1984, named.triangleCount());
    try expectEqual(7, both.resolution.?[0]);
    var alone = try readClean(first);
    defer alone.deinit();
    try expectEqual(32, alone.triangleCount());
    var said: Diagnostic = .{};
    var two = try read(comptime world("Shape \"disk\"") ++ second, &said);
    defer two.deinit();
    try expectEqual(32, two.triangleCount());
    try expectEqual(1, said.warning_count);
}

// Materials, textures and lights.

fn materialOf(scene: *const Scene) raylane.scene.Material {
    return scene.materials[scene.meshes[0].material];
}

test "materials as the table of docs/pbrt.md has them" {
    const Expected = struct { []const u8, [4]f32, f32, f32, f32 };
    // Base colour, metallic, roughness, index of refraction.
    const cases = [_]Expected{
        .{ "\"matte\" \"rgb Kd\" [.1 .2 .3]", .{ 0.1, 0.2, 0.3, 1 }, 0, 1, 1 },
        .{ "\"diffuse\" \"rgb reflectance\" [.1 .2 .3]", .{ 0.1, 0.2, 0.3, 1 }, 0, 1, 1 },
        .{
            "\"plastic\" \"rgb Ks\" [1 1 1] \"float roughness\" 1",
            .{ 0.25, 0.25, 0.25, 1 },
            0,
            0.903602,
            1.5,
        },
        .{ "\"coateddiffuse\"", .{ 0.5, 0.5, 0.5, 1 }, 0, 0, 1.5 },
        .{ "\"mirror\" \"rgb Kr\" [.9 .8 .7]", .{ 0.9, 0.8, 0.7, 1 }, 1, 0, 1.5 },
        .{ "\"glass\" \"float index\" 1.3", .{ 1, 1, 1, 1 }, 0, 0, 1.3 },
        .{ "\"dielectric\" \"float eta\" 1.4", .{ 1, 1, 1, 1 }, 0, 0, 1.4 },
        .{ "\"dielectric\" \"spectrum eta\" \"glass-BK7\"", .{ 1, 1, 1, 1 }, 0, 0, 1.5168 },
        .{
            "\"metal\" \"rgb eta\" [1 1 1] \"rgb k\" [2 2 2] \"float roughness\" 0",
            .{ 0.5, 0.5, 0.5, 1 },
            1,
            0,
            1.5,
        },
        .{ "\"conductor\" \"rgb reflectance\" [.5 .6 .7]", .{ 0.5, 0.6, 0.7, 1 }, 1, 0, 1.5 },
        .{
            "\"substrate\" \"rgb Ks\" [.04 .04 .04] \"float uroughness\" .01 " ++
                "\"float vroughness\" .01 \"bool remaproughness\" \"false\"",
            .{ 0.5, 0.5, 0.5, 1 },
            0,
            0.1,
            1.5,
        },
        .{
            "\"uber\" \"rgb opacity\" [.5 .5 .5] \"rgb Kr\" [1 1 1]",
            .{ 0.25, 0.25, 0.25, 0.5 },
            0,
            0.638943,
            1.5,
        },
        .{
            "\"translucent\" \"rgb Ks\" [1 1 1] \"float roughness\" 1",
            .{ 0.25, 0.25, 0.25, 1 },
            0,
            0.903602,
            1.5,
        },
        .{ "\"kdsubsurface\" \"rgb Kd\" [.2 .5 .7]", .{ 0.2, 0.5, 0.7, 1 }, 0, 0, 1.3 },
        .{ "\"shinymetal\" \"rgb Kr\" [.2 .5 .7]", .{ 0.2, 0.5, 0.7, 1 }, 1, 0, 1.5 },
        .{
            "\"disney\" \"rgb color\" [.2 .5 .7] \"float metallic\" .5",
            .{ 0.2, 0.5, 0.7, 1 },
            0.5,
            0.5,
            1.5,
        },
    };
    for (cases) |case| {
        errdefer std.debug.print("{s}\n", .{case[0]});
        var buffer: [512]u8 = undefined;
        const text = try std.mem.print(
            &buffer,
            plain_camera ++ "WorldBegin Material {s} Shape \"sphere\"",
            .{case[0]},
        );
        var scene = try readClean(text);
        defer scene.deinit();
        const material = materialOf(&scene);
        errdefer std.debug.print("{any}\n", .{material});
        for (case[1], material.base_color) |a, b| try expectNear(a, b, 1e-5);
        try expectNear(case[2], material.metallic, 0);
        try expectNear(case[3], material.roughness, 1e-5);
        try expectNear(case[4], material.ior, 1e-4);
        try expect(material.double_sided);
    }
}

fn expectMaterial(text: []const u8, expected: anytype) !void {
    errdefer std.debug.print("{s}\n", .{text});
    var buffer: [512]u8 = undefined;
    var scene = try readClean(try std.mem.print(
        &buffer,
        plain_camera ++ "WorldBegin Material {s} Shape \"sphere\"",
        .{text},
    ));
    defer scene.deinit();
    const material = materialOf(&scene);
    inline for (comptime std.meta.fieldNames(@TypeOf(expected))) |name| {
        errdefer std.debug.print("{s}\n", .{name});
        const found = @field(material, name);
        const wanted = @field(expected, name);
        if (@TypeOf(found) == f32) {
            try expectNear(wanted, found, 1e-4);
        } else for (found, @as(@TypeOf(found), wanted)) |a, b| try expectNear(b, a, 1e-4);
    }
}

test "what materials have beyond that" {
    try expectMaterial("\"plastic\" \"rgb Ks\" [.1 .2 .4]", .{
        .ior = 1.5,
        .specular = 0.4,
        .specular_color = .{ 0.25, 0.5, 1 },
    });
    // All of it where light grazes, Ks at normal incidence.
    try expectMaterial("\"substrate\" \"rgb Ks\" [.02 .04 .01]", .{
        .ior = 1.5,
        .specular = 1,
        .specular_color = .{ 0.5, 1, 0.25 },
    });
    try expectMaterial("\"uber\" \"rgb Kr\" [.5 .5 .5] \"rgb Ks\" [1 .5 0]", .{
        .clearcoat = 0.5,
        .clearcoat_roughness = 0,
        .specular_color = .{ 1, 0.5, 0 },
    });
    try expectMaterial("\"glass\" \"rgb Kr\" [.5 .25 0] \"float roughness\" .02", .{
        .specular = 0.5,
        .specular_color = .{ 1, 0.5, 0 },
        .roughness = 0.442850,
        .transmission = 1,
    });
    const coated = "\"coatedconductor\" \"rgb reflectance\" [.5 .6 .7] " ++
        "\"float interface.roughness\" .25 \"float conductor.roughness\" .04 " ++
        "\"float interface.eta\" 1.4 \"bool remaproughness\" false";
    try expectMaterial(coated, .{
        .metallic = 1,
        .roughness = 0.2,
        .clearcoat = 0.0277778 / 0.04,
        .clearcoat_roughness = 0.5,
        .base_color = .{ 0.5, 0.6, 0.7, 1 },
    });
    const brushed = "\"conductor\" \"float uroughness\" .04 \"float vroughness\" .28 " ++
        "\"bool remaproughness\" false";
    try expectMaterial(brushed, .{
        .roughness = 0.2,
        .anisotropy = 0.5,
        .anisotropy_rotation_rad = std.math.pi / 2.0,
    });
    try expectMaterial("\"translucent\" \"rgb reflect\" [.6 .6 .6] \"rgb transmit\" [.2 0 .4]", .{
        .diffuse_transmission = 0.4,
        .diffuse_transmission_color = .{ 0.125, 0, 0.25 },
        .base_color = .{ 0.25, 0.25, 0.25, 1 },
    });
    const leaf = "\"diffusetransmission\" \"rgb reflectance\" [.1 .2 0] " ++
        "\"rgb transmittance\" [.1 .3 .1] \"float scale\" 2";
    try expectMaterial(leaf, .{
        .diffuse_transmission = 0.6,
        .base_color = .{ 0.5, 1, 0, 1 },
        .diffuse_transmission_color = .{ 1.0 / 3.0, 1, 1.0 / 3.0 },
    });
    const car = "\"disney\" \"rgb color\" [.2 .2 .2] \"float clearcoat\" 1 " ++
        "\"float clearcoatgloss\" 0 \"float sheen\" .5 \"float anisotropic\" .8 " ++
        "\"float speculartint\" 1";
    try expectMaterial(car, .{
        .clearcoat = 0.25,
        .clearcoat_roughness = @sqrt(0.1),
        .sheen_color = .{ 0.5, 0.5, 0.5 },
        // Alpha .25 over and times the root of the aspect ratio .28.
        .roughness = 0.363719,
        .anisotropy_rotation_rad = 0,
    });
    try expectMaterial("\"hair\" \"rgb color\" [.3 .2 .1]", .{
        .base_color = .{ 0.3, 0.2, 0.1, 1 },
        .roughness = @sqrt(0.3),
        .ior = 1.55,
    });
    try expectMaterial("\"hair\" \"rgb sigma_a\" [0 .01 1]", .{
        .base_color = .{ 1, 0.554966, 0.002772, 1 },
    });
    // Brass is yellow.
    try expectMaterial("\"conductor\" \"spectrum eta\" \"metal-CuZn-eta\" " ++
        "\"spectrum k\" \"metal-CuZn-k\"", .{ .base_color = .{ 0.8871, 0.7887, 0.4339, 1 } });
}

test "glass bends, thin glass does not, subsurface is what much scattering leaves" {
    const cases = .{
        .{ "\"glass\"", true, 1 },
        .{ "\"thindielectric\"", false, 1 },
        .{ "\"uber\" \"rgb Kt\" [.75 .75 .75]", true, 0.75 },
        .{ "\"subsurface\"", false, 0 },
    };
    inline for (cases) |case| {
        var scene = try readClean(comptime world("Material " ++ case[0] ++ "\nShape \"sphere\""));
        defer scene.deinit();
        try expectEqual(case[1], materialOf(&scene).volume);
        try expectNear(case[2], materialOf(&scene).transmission, 1e-6);
        if (case[2] == 0) try expect(materialOf(&scene).base_color[0] > 0.8);
    }
}

test "named materials, mixtures and boundaries" {
    var scene = try readClean(comptime world(
        \\MakeNamedMaterial "a" "string type" "matte" "rgb Kd" [1 0 0]
        \\MakeNamedMaterial "b" "string type" [ "mirror" ] "rgb Kr" [0 0 1]
        \\Material "mix" "string namedmaterial1" "a" "string namedmaterial2" "b"
        \\  "rgb amount" [.75 .75 .75]
        \\Shape "sphere"
        \\NamedMaterial "b"
        \\Shape "sphere"
        \\Material "mix" "string materials" ["a" "b"] "float amount" .75
        \\Shape "disk"
        \\Material "none"
        \\Shape "disk"
    ));
    defer scene.deinit();
    try expectEqual(3, scene.instances.len);
    try expectEqual([4]f32{ 0.75, 0, 0.25, 1 }, materialOf(&scene).base_color);
    try expectEqual([4]f32{ 0, 0, 1, 1 }, scene.materials[scene.meshes[1].material].base_color);
    const third = scene.materials[scene.meshes[2].material];
    try expectEqual([4]f32{ 0.25, 0, 0.75, 1 }, third.base_color);
}

test "textures count as their mean, said once a kind" {
    const cases = .{
        .{ "\"constant\" \"rgb value\" [.1 .2 .3]", [3]f32{ 0.1, 0.2, 0.3 }, 0 },
        .{ "\"scale\" \"rgb tex1\" [.5 .5 .5] \"float tex2\" .5", [3]f32{ 0.25, 0.25, 0.25 }, 0 },
        .{ "\"mix\" \"float tex2\" .5 \"float amount\" .5", [3]f32{ 0.25, 0.25, 0.25 }, 0 },
        .{ "\"checkerboard\" \"rgb tex1\" [1 0 0]", [3]f32{ 0.5, 0, 0 }, 1 },
        .{ "\"imagemap\" \"string filename\" \"no.png\"", [3]f32{ 0.5, 0.5, 0.5 }, 1 },
        .{ "\"bilerp\"", [3]f32{ 0.5, 0.5, 0.5 }, 1 },
        .{ "\"windy\"", [3]f32{ 0.5, 0.5, 0.5 }, 1 },
    };
    inline for (cases) |case| {
        var said: Diagnostic = .{};
        var scene = try read(comptime world("Texture \"t\" \"color\" " ++ case[0] ++
            " Texture \"u\" \"color\" " ++ case[0] ++
            "\nMaterial \"matte\" \"texture Kd\" \"t\" Shape \"sphere\""), &said);
        defer scene.deinit();
        for (case[1], materialOf(&scene).base_color[0..3]) |a, b| try expectNear(a, b, 1e-6);
        try expectEqual(case[2], said.warning_count);
    }
}

test "colours as spectra, XYZ, black bodies and names" {
    var scene = try readClean(comptime world(
        \\LightSource "point" "xyz I" [.9505 1 1.089] "point from" [1 2 3]
        \\LightSource "point" "blackbody I" [6500 2]
        \\LightSource "point" "spectrum I" [400 1 700 1]
        \\LightSource "point" "rgb I" [1 2 3] "rgb scale" [2 2 2]
        \\Shape "disk"
    ));
    defer scene.deinit();
    for (scene.lights[0].color) |channel| try expectNear(1, channel, 1e-3);
    try expectNear(2, scene.lights[1].color[1], 0.4);
    try expectNear(0.95, scene.lights[2].color[1], 0.02);
    try expectEqual(Vec3{ 2, 4, 6 }, scene.lights[3].color);
    const node = scene.nodes[scene.lights[0].node];
    try expectEqual(raylane.math.Vec3d{ 1, 2, 3 }, node.local.translation);
}

test "lights" {
    var said: Diagnostic = .{};
    var scene = try read(comptime world(
        \\Translate 1 0 0
        \\LightSource "spot" "point from" [0 0 0] "point to" [0 -2 0] "float coneangle" 40
        \\  "float conedeltaangle" 10
        \\LightSource "distant" "point from" [0 5 0] "point to" [0 0 0] "rgb L" [3 3 3]
        \\LightSource "goniometric" "rgb I" [4 4 4]
        \\LightSource "projection" "float fov" 60
        \\LightSource "laser"
        \\LightSource "infinite" "rgb L" [.5 .25 1] "float scale" 2
    ), &said);
    defer scene.deinit();
    try expectEqual(4, scene.lights.len);
    const spot = scene.lights[0];
    try expectNear(40.0 / 180.0 * std.math.pi, spot.outer_cone_rad, 1e-6);
    try expectNear(30.0 / 180.0 * std.math.pi, spot.inner_cone_rad, 1e-6);
    // Along -z it shines down.
    try expectNear(1, @floatCast(scene.nodes[spot.node].local.z[1]), 1e-6);
    try expectEqual(raylane.math.Vec3d{ 1, 0, 0 }, scene.nodes[spot.node].local.translation);
    try expectEqual(.directional, scene.lights[1].kind);
    try expectNear(1, @floatCast(scene.nodes[scene.lights[1].node].local.z[1]), 1e-6);
    try expectEqual(.point, scene.lights[2].kind);
    try expectNear(30.0 / 180.0 * std.math.pi, scene.lights[3].outer_cone_rad, 1e-6);
    try expectEqual(Vec3{ 1, 0.5, 2 }, scene.background.?);
    try expectNear(0.212671 + 0.35758 + 0.144338, scene.ambient.?, 1e-5);
    try expectEqual(4, said.warning_count); // Goniometric, projection, laser; nothing to render.
}

test "shapes that shine are surfaces that emit, and all the light that there is" {
    var one = try readClean(comptime world(
        \\AreaLightSource "area" "rgb L" [1 2 3]
        \\Shape "disk"
    ));
    defer one.deinit();
    try expect(one.has_area_lights);
    try expectEqual(0, one.ambient.?);
    // The front shines, the back does not.
    try expectEqual(2, one.meshes.len);
    try expectEqual(Vec3{ 1, 2, 3 }, one.materials[one.meshes[0].material].emissive);
    try expectEqual(Vec3{ 0, 0, 0 }, one.materials[one.meshes[1].material].emissive);
    var both = try readClean(comptime world(
        \\AreaLightSource "diffuse" "bool twosided" true
        \\Shape "disk"
    ));
    defer both.deinit();
    try expectEqual(1, both.meshes.len);
    try expect(both.materials[both.meshes[0].material].double_sided);
}

// What is wrong or missing.

test "errors name line and column" {
    const cases = .{
        .{ "Frobnicate 1", "1:1", "'Frobnicate' is no directive" },
        .{ "WorldBegin\n  Shape sphere", "2:9", "a string is expected" },
        .{ "WorldBegin [", "1:12", "a directive is expected" },
        .{ "\x00", "1:1", "a directive is expected" },
        .{ "Shape \"sphere\"", "1:1", "Shape may not stand before WorldBegin" },
        .{ "WorldBegin Film \"image\"", "1:12", "Film may not stand after WorldBegin" },
        .{ "WorldBegin Camera \"perspective\"", "1:12", "Camera may not stand after WorldBegin" },
        .{ "Identity", "1:9", "there is no WorldBegin" },
        .{ "", "1:1", "there is no WorldBegin" },
        .{ "WorldBegin AttributeEnd", "1:12", "AttributeEnd without AttributeBegin" },
        .{ "WorldBegin TransformBegin ObjectEnd", "1:27", "no object has begun" },
        .{
            "WorldBegin TransformBegin AttributeEnd",
            "1:27",
            "AttributeEnd without AttributeBegin",
        },
        .{ "WorldBegin ObjectEnd", "1:12", "no object has begun" },
        .{
            "WorldBegin ObjectBegin \"x\" ObjectBegin \"y\"",
            "1:28",
            "an object within an object",
        },
        .{
            "WorldBegin ObjectBegin \"x\" ObjectInstance \"x\"",
            "1:28",
            "an instance within an object",
        },
        .{ "Translate 1 2", "1:14", "a number is expected, the text ends" },
        .{ "Translate 1 2 x", "1:15", "a number is expected, not 'x'" },
        .{ "Scale [1 1 1 1]", "1:14", "']' is expected" },
        .{ "Rotate 90 0 0 0", "1:1", "the axis has no direction" },
        .{ "LookAt 0 0 0 0 0 0 0 1 0", "1:1", "the three points leave no direction" },
        .{ "LookAt 0 0 0 0 1 0 0 1 0", "1:1", "the three points leave no direction" },
        .{
            "Transform [1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1]",
            "1:1",
            "the matrix is not affine",
        },
        .{ "Scale 1e30 1 1 Scale 1e30 1 1", "1:16", "the transformation is out of range" },
        .{
            "Scale 0 1 1 Camera \"perspective\"",
            "1:13",
            "the camera's transformation has no inverse",
        },
        .{
            "Camera \"perspective\" \"float fov\" 180",
            "1:1",
            "the camera's fov is 180, not between 0 and 180",
        },
        .{ "Film \"image\" \"integer xresolution\" 0", "1:1", "xresolution is 0, not 1 to 65536" },
        .{
            "Film \"image\" \"integer xresolution\" 60000 \"integer yresolution\" 60000",
            "1:1",
            "the film has over 268435456 pixels",
        },
        .{
            "WorldBegin Shape \"sphere\" \"float radius\" 0",
            "1:12",
            "sphere: radius is 0, not above 0",
        },
        .{ "WorldBegin Shape \"trianglemesh\"", "1:12", "trianglemesh: has no points P" },
        .{
            "WorldBegin Shape \"trianglemesh\" \"point P\" [0 0 0] \"integer indices\" [0 0]",
            "1:12",
            "trianglemesh: 2 indices make no whole triangles",
        },
        .{
            "WorldBegin Shape \"trianglemesh\" \"point P\" [0 0 0] \"integer indices\" [0 0 -1]",
            "1:12",
            "trianglemesh: index -1 of 1 vertices",
        },
        .{
            "WorldBegin Shape \"trianglemesh\" \"point P\" [0 0 0] \"integer indices\" [0 0 0] " ++
                "\"normal N\" [0 0 1 0 0 1]",
            "1:12",
            "trianglemesh: has 2 normals N for 1 points",
        },
        .{
            "WorldBegin Shape \"heightfield\" \"integer nu\" 2 \"integer nv\" 2 \"float Pz\" [0]",
            "1:12",
            "heightfield: has 1 heights for 2 by 2 points",
        },
        .{
            "WorldBegin Shape \"nurbs\" \"integer nu\" 2 \"integer uorder\" 3 " ++
                "\"float uknots\" [0 1]",
            "1:12",
            "nurbs: uorder is 3 for 2 points: it is 2 to 32, and not above their number",
        },
        .{ "WorldBegin Shape \"plymesh\"", "1:12", "plymesh: has no filename" },
        .{
            "WorldBegin LightSource \"distant\" \"point to\" [0 0 0]",
            "1:12",
            "the light has no direction",
        },
        .{
            "WorldBegin LightSource \"point\" \"spectrum I\" [500 1 400 1]",
            "1:32",
            "a spectrum is pairs of rising wavelengths and values",
        },
        .{ "WorldBegin LightSource \"point\" \"string I\" \"x\"", "1:32", "'I' is no colour" },
    };
    inline for (cases) |case| {
        errdefer std.debug.print("{s}\n", .{case[0]});
        var said: Diagnostic = .{};
        const settings: raylane.settings.Load = .{ .strict = true };
        const result = parse.parsePbrt(gpa, io, case[0], .cwd(), settings, &said);
        try std.testing.expectError(error.InvalidInput, result);
        try std.testing.expectEqualStrings(case[2], said.message.text());
        try std.testing.expectEqualStrings("text:" ++ case[1], said.place.text());
    }
}

test "what is not supported is left out or replaced, and said once with its line" {
    var said: Diagnostic = .{};
    var scene = try read(
        \\Camera "realistic"
        \\Integrator "ao"
        \\WorldBegin
        \\Volume "homogeneous"
        \\Volume "exponential"
        \\Material "fourier"
        \\Shape "curve"
        \\Shape "curve"
        \\Shape "sphere"
        \\AttributeBegin
    , &said);
    defer scene.deinit();
    const expected = [_][]const u8{
        "line 1: Camera 'realistic' is not supported: a perspective one with fov 90 stands for it",
        "line 2: integrator 'ao' is not supported: the picture shows lights and materials",
        "line 4: Volume: participating media are not supported",
        "line 6: Material 'fourier' is not supported: grey matte stands for it",
        "line 7: Shape 'curve' is not supported and left out",
        "line 10: 1 blocks are begun and not ended",
    };
    try expectEqual(expected.len, said.warning_count);
    for (expected, said.warnings[0..expected.len]) |text, *warning| {
        try std.testing.expectEqualStrings(text, warning.text());
    }
}

// Files.

const Folder = struct {
    temporary: std.testing.TmpDir,

    fn write(folder: *Folder, name: []const u8, bytes: []const u8) !void {
        try folder.temporary.dir.writeFile(io, .{ .sub_path = name, .data = bytes });
    }

    fn read(folder: *Folder, text: []const u8, outside: bool, said: *Diagnostic) !Scene {
        const settings: raylane.settings.Load = .{ .allow_outside = outside };
        var scene = try parse.parsePbrt(gpa, io, text, folder.temporary.dir, settings, said);
        scene.check();
        return scene;
    }

    fn expectWrong(
        folder: *Folder,
        text: []const u8,
        place: []const u8,
        message: []const u8,
    ) !void {
        var said: Diagnostic = .{};
        if (folder.read(text, false, &said)) |found| {
            var scene = found;
            scene.deinit();
            return error.TestExpectedError;
        } else |err| try expect(err == error.InvalidInput or err == error.InputOutput);
        try std.testing.expectEqualStrings(message, said.message.text());
        try std.testing.expectEqualStrings(place, said.place.text());
    }
};

test "files are included from within the folder, and none includes itself" {
    var folder: Folder = .{ .temporary = std.testing.tmpDir(.{}) };
    defer folder.temporary.cleanup();
    try folder.temporary.dir.createDir(io, "in", .default_dir);
    try folder.write("in/a.pbrt", "Shape \"disk\"\nInclude \"in/b.pbrt\" # and back\n");
    try folder.write("in/b.pbrt", "Shape \"disk\"");
    try folder.write("in/bad.pbrt", "# here\n Shape \"disk\" \"float radius\" [x]");
    try folder.write("in/warn.pbrt", "Shape \"curve\"");
    try folder.write("round.pbrt", "Include \"back.pbrt\"");
    try folder.write("back.pbrt", "Include \"round.pbrt\"");
    var said: Diagnostic = .{};
    var scene = try folder.read(
        plain_camera ++ "WorldBegin Include \"in/a.pbrt\" Include \"in/b.pbrt\" " ++
            "Include \"in/warn.pbrt\" Shape \"disk\"",
        false,
        &said,
    );
    defer scene.deinit();
    try expectEqual(4 * 32, scene.triangleCount());
    try std.testing.expectEqualStrings(
        "in/warn.pbrt:1: Shape 'curve' is not supported and left out",
        said.warnings[0].text(),
    );
    const start = "WorldBegin Include ";
    try folder.expectWrong(
        start ++ "\"in/bad.pbrt\"",
        "in/bad.pbrt:2:31",
        "a number is expected, not 'x'",
    );
    try folder.expectWrong(
        start ++ "\"round.pbrt\"",
        "back.pbrt:1:9",
        "'round.pbrt' includes itself",
    );
    try folder.expectWrong(start ++ "\"no.pbrt\"", "text:1:20", "'no.pbrt' does not exist");
    try folder.expectWrong(start ++ "\"in\"", "text:1:20", "'in' is a folder");
    try folder.expectWrong(start ++ "\"\"", "text:1:20", "'' is not a valid path");
    for ([_][]const u8{ "../x.pbrt", "/etc/hostname", "in/../../x.pbrt", "..\\x" }) |path| {
        var text: [100]u8 = undefined;
        var message: [200]u8 = undefined;
        try folder.expectWrong(
            try std.mem.print(&text, start ++ "\"{s}\"", .{path}),
            "text:1:20",
            try std.mem.print(
                &message,
                "'{s}' is outside the scene's folder (see --allow-outside)",
                .{path},
            ),
        );
    }
}

const ply_header =
    \\ply
    \\format $FORMAT 1.0
    \\comment by hand
    \\element vertex 5
    \\property float x
    \\property float y
    \\property float z
    \\property uchar red
    \\element face 2
    \\property list uchar int vertex_indices
    \\element edge 1
    \\property list uint8 short path
    \\end_header
    \\
;

const ply_points = [5][2]f32{ .{ 0, 0 }, .{ 1, 0 }, .{ 2, 1 }, .{ 1, 2 }, .{ 0, 1 } };

/// A pentagon and a triangle, in one of the three formats. The caller frees it.
fn plyFile(format: []const u8) ![]u8 {
    var out: std.Io.Writer.Allocating = .init(gpa);
    defer out.deinit();
    const writer = &out.writer;
    var parts = std.mem.splitSequence(u8, ply_header, "$FORMAT");
    try writer.print("{s}{s}{s}", .{ parts.next().?, format, parts.next().? });
    if (std.mem.eql(u8, format, "ascii")) {
        for (ply_points) |point| try writer.print("{d} {d} 0 255\n", .{ point[0], point[1] });
        try writer.writeAll("5 0 1 2 3 4\n3 0 1 2\n2 7 8");
        return out.toOwnedSlice();
    }
    const endian: std.lang.Endian =
        if (std.mem.eql(u8, format, "binary_big_endian")) .big else .little;
    for (ply_points) |point| {
        for ([3]f32{ point[0], point[1], 0 }) |number| {
            try writer.writeInt(u32, @bitCast(number), endian);
        }
        try writer.writeByte(255);
    }
    try writer.writeByte(5);
    for (0..5) |index| try writer.writeInt(i32, @intCast(index), endian);
    try writer.writeByte(3);
    for (0..3) |index| try writer.writeInt(i32, @intCast(index), endian);
    try writer.writeByte(1);
    try writer.writeInt(i16, 7, endian);
    return out.toOwnedSlice();
}

const ply_scene = plain_camera ++ "WorldBegin Shape \"plymesh\" \"string filename\" \"m.ply\"";

test "PLY as text and binary of both orders, polygons as fans; cut anywhere it is an error" {
    var folder: Folder = .{ .temporary = std.testing.tmpDir(.{}) };
    defer folder.temporary.cleanup();
    for ([_][]const u8{ "ascii", "binary_little_endian", "binary_big_endian" }) |format| {
        const bytes = try plyFile(format);
        defer gpa.free(bytes);
        try folder.write("m.ply", bytes);
        var said: Diagnostic = .{};
        var scene = try folder.read(ply_scene, false, &said);
        defer scene.deinit();
        const mesh = scene.meshes[0];
        try expectEqual(5, mesh.positions.len);
        try expectEqual(Vec3{ 1, 2, 0 }, mesh.positions[3]);
        const triangles = [_][3]u32{ .{ 0, 1, 2 }, .{ 0, 2, 3 }, .{ 0, 3, 4 }, .{ 0, 1, 2 } };
        try std.testing.expectEqualSlices([3]u32, &triangles, mesh.triangles);
        // The last numbers of a text may be cut without harm.
        for (0..bytes.len - 5) |length| {
            try folder.write("m.ply", bytes[0..length]);
            if (folder.read(ply_scene, false, &said)) |found| {
                var cut = found;
                cut.deinit();
                std.debug.print("{s} cut at {d}\n", .{ format, length });
                return error.TestExpectedError;
            } else |err| try expectEqual(error.InvalidInput, err);
        }
    }
}

test "no changed byte of a PLY file crashes" {
    var folder: Folder = .{ .temporary = std.testing.tmpDir(.{}) };
    defer folder.temporary.cleanup();
    var random_state: std.Random.DefaultPrng = .init(7);
    const random = random_state.random();
    for ([_][]const u8{ "ascii", "binary_little_endian", "binary_big_endian" }) |format| {
        const bytes = try plyFile(format);
        defer gpa.free(bytes);
        for (bytes) |*byte| {
            const before = byte.*;
            defer byte.* = before;
            byte.* = if (random.boolean()) random.int(u8) else '0' + random.uintLessThan(u8, 10);
            try folder.write("m.ply", bytes);
            var said: Diagnostic = .{};
            var scene = folder.read(ply_scene, false, &said) catch |err| {
                try expectEqual(error.InvalidInput, err);
                continue;
            };
            scene.deinit();
        }
    }
}

test "huge numbers stay within what a scene may hold" {
    const cases = [_][]const u8{
        "Scale 1e30 1e30 1e30 LightSource \"point\" \"point from\" [1e30 0 0]",
        "Shape \"hyperboloid\" \"point p1\" [3e38 3e38 0] \"point p2\" [-3e38 3e38 3e38]",
        "LightSource \"infinite\" \"rgb L\" [3e38 3e38 3e38] \"rgb scale\" [9 9 9]",
        "AreaLightSource \"diffuse\" \"rgb L\" [3e38 1 1] Shape \"disk\" \"float radius\" 3e38",
        "Shape \"sphere\" \"float radius\" 3e38",
        "Material \"metal\" \"rgb eta\" [3e38 0 0] \"rgb k\" [3e38 0 0] Shape \"sphere\"",
    };
    for (cases) |case| {
        var buffer: [400]u8 = undefined;
        const text = try std.mem.print(&buffer, "{s}WorldBegin {s}", .{ plain_camera, case });
        var said: Diagnostic = .{};
        var scene = try read(text, &said);
        defer scene.deinit();
        for (scene.nodes) |node| try expect(node.local.isFinite());
        for (scene.materials) |*material| try expect(std.math.isFinite(material.base_color[0]));
        if (scene.ambient) |ambient| try expect(std.math.isFinite(ambient));
    }
}

test "what is wrong in a PLY file" {
    var folder: Folder = .{ .temporary = std.testing.tmpDir(.{}) };
    defer folder.temporary.cleanup();
    const good = try plyFile("ascii");
    defer gpa.free(good);
    const cases = .{
        .{ "ply\n", "PLY\n", "is no PLY file" },
        .{ "ascii", "utf8", "is of an unknown PLY format" },
        .{ "float x", "half x", "'half' is no PLY type" },
        .{ "vertex 5", "vertex -5", "the number of 'vertex' is none" },
        .{ "vertex 5", "vertex 1000000000", "claims 1000000000 elements, its 75 bytes hold less" },
        .{ "comment by hand", "command by hand", "the PLY header says 'command'" },
        .{ "3 0 1 2", "3 0 1 5", "index 5 is not one of 0 to 4" },
        .{ "3 0 1 2", "3 0 1 -1", "index -1 is not one of 0 to 4" },
        .{ "3 0 1 2", "3 0 1 x", "a whole number is expected where something else stands" },
        .{ "5 0 1", "-5 0 1", "the face's length -5 is not one of 0 to 65536" },
        .{ "1 2 0 255", "nan 2 0 255", "a number is not finite" },
        .{ "element vertex", "element vertices", "has faces before vertices" },
    };
    inline for (cases) |case| {
        const index = std.mem.find(u8, good, case[0]).?;
        const changed = try std.mem.concat(
            gpa,
            u8,
            &.{ good[0..index], case[1], good[index + case[0].len ..] },
        );
        defer gpa.free(changed);
        try folder.write("m.ply", changed);
        try folder.expectWrong(ply_scene, "text:1:48", "plymesh: 'm.ply': " ++ case[2]);
    }
}

test "spectra from files, and what cannot be read is said" {
    var folder: Folder = .{ .temporary = std.testing.tmpDir(.{}) };
    defer folder.temporary.cleanup();
    try folder.write("white.spd", "# ones\n400 1\n700 1\n");
    try folder.write("bad.spd", "400 one");
    var said: Diagnostic = .{};
    var scene = try folder.read(plain_camera ++
        \\WorldBegin
        \\Material "matte" "spectrum Kd" "white.spd"
        \\Shape "sphere"
        \\Material "matte" "spectrum Kd" "bad.spd"
        \\Material "matte" "spectrum Kd" "none.spd"
    , false, &said);
    defer scene.deinit();
    try expectNear(0.948, materialOf(&scene).base_color[1], 0.01);
    try expectEqual(1, said.warning_count);
    try expectEqual(0, said.place.text().len);
}

// Anything.

const everything =
    \\Scale -1 1 1 LookAt 0 1 -5  0 0 0  0 1 0
    \\Camera "perspective" "float fov" [50] "float screenwindow" [-1 1 -1 1]
    \\Film "image" "integer xresolution" [16] "integer yresolution" [16]
    \\Sampler "halton" "integer pixelsamples" 2 Integrator "path" "integer maxdepth" 3
    \\MakeNamedMaterial "m" "string type" "uber" "rgb Kt" [.1 .2 .3]
    \\Texture "t" "color" "scale" "rgb tex1" [.5 .5 .5] "float tex2" 2
    \\WorldBegin Attribute "shape" "float alpha" 1 "string note" "x" ColorSpace "rec2020"
    \\LightSource "spot" "point from" [0 5 0] "point to" [0 0 0] "blackbody I" [3000 1]
    \\LightSource "infinite" "spectrum L" [400 1 500 .5 700 1]
    \\AttributeBegin
    \\AreaLightSource "diffuse" "rgb L" [1 1 1] "bool twosided" false
    \\Translate 0 3 0 Rotate 90 1 0 0 Shape "disk" "float radius" .5 "float innerradius" .1
    \\AttributeEnd
    \\Material "plastic" "texture Kd" "t" "float roughness" .1
    \\ObjectBegin "o" Shape "cone" Shape "cylinder" "float phimax" 90 ObjectEnd
    \\TransformBegin Transform [1 0 0 0 0 1 0 0 0 0 1 0 1 2 3 1] ObjectInstance "o" TransformEnd
    \\NamedMaterial "later" Shape "disk" MakeNamedMaterial "later" "string type" "matte"
    \\NamedMaterial "m"
    \\Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point P" [0 0 0 1 0 0 1 1 0 0 1 0]
    \\Shape "loopsubdiv" "integer indices" [0 1 2] "point P" [0 0 0 1 0 0 1 1 0] "integer levels" 1
    \\Shape "nurbs" "integer nu" 2 "integer nv" 2 "integer uorder" 2 "integer vorder" 2
    \\"float uknots" [0 0 1 1] "float vknots" [0 0 1 1] "point P" [0 0 0 2 0 0 0 3 0 2 3 0]
    \\ReverseOrientation Shape "hyperboloid" "point p1" [1 0 0] "point p2" [.5 1 1]
    \\Shape "paraboloid" Shape "sphere" "float zmax" .5 "alpha" 1
    \\WorldEnd
;

/// Reads whatever it is, coarsely; an error has its line.
fn tryAnything(allocator: std.mem.Allocator, text: []const u8) !void {
    var said: Diagnostic = .{};
    const settings: raylane.settings.Load = .{ .tessellation = 4 };
    var scene = parse.parsePbrt(allocator, io, text, .cwd(), settings, &said) catch |err| {
        if (err != error.OutOfMemory) try expect(said.message.text().len > 0);
        return err;
    };
    defer scene.deinit();
    scene.check();
}

const right_text = text: {
    @setEvalBranchQuota(10_000);
    const index = std.mem.find(u8, everything, " \"alpha\" 1").?;
    break :text everything[0..index] ++ everything[index + " \"alpha\" 1".len ..];
};

test "the text with everything is right, cut anywhere it does not crash" {
    try tryAnything(gpa, right_text);
    for (0..right_text.len) |length| tryAnything(gpa, right_text[0..length]) catch |err|
        try expect(err == error.InvalidInput);
}

test "every allocation may fail" {
    var fail_index: usize = 0;
    while (true) : (fail_index += 1) {
        var failing: std.testing.FailingAllocator = .init(gpa, .{ .fail_index = fail_index });
        if (tryAnything(failing.allocator(), right_text)) {
            try expect(!failing.has_induced_failure);
            break;
        } else |err| try expectEqual(error.OutOfMemory, err);
        try expectEqual(failing.allocated_bytes, failing.freed_bytes);
    }
    try expect(fail_index > 10);
}

// Fuzzing: texts made of pieces of a right one, words and numbers of every sort. A fixed seed and
// few rounds here; RAYLANE_FUZZ_ROUNDS asks for more.
test "fuzz: no text crashes, leaks or takes memory that it does not explain" {
    const rounds = if (std.testing.environ.getPosix("RAYLANE_FUZZ_ROUNDS")) |text|
        try std.fmt.parseInt(u32, text, 10)
    else
        2000;
    var random_state: std.Random.DefaultPrng = .init(0x70627274);
    const random = random_state.random();
    const words = [_][]const u8{
        "1e38",           "-1",   "0",           "1e-40",             "nan",         "2147483647",
        "99999999999",    "[",    "]",           "\"",                "\"float x\"", "\"rgb Kd\"",
        "\n",             "#",    "WorldBegin ", "AttributeEnd ",     "ObjectEnd ",  "Identity ",
        "\"integer nu\"", "1024", ".",           "Shape \"sphere\" ",
    };
    var text: std.ArrayList(u8) = .empty;
    defer text.deinit(gpa);
    for (0..rounds) |_| {
        text.clearRetainingCapacity();
        try text.appendSlice(gpa, right_text);
        for (0..random.intRangeAtMost(usize, 1, 6)) |_| {
            const at = random.uintAtMost(usize, text.items.len);
            const length = random.uintAtMost(usize, @min(text.items.len - at, 12));
            const from = random.uintLessThan(usize, right_text.len);
            const piece = switch (random.uintLessThan(u8, 3)) {
                0 => words[random.uintLessThan(usize, words.len)],
                1 => right_text[from..@min(right_text.len, from + random.uintAtMost(usize, 80))],
                else => &.{random.int(u8)},
            };
            try text.replaceRange(gpa, at, length, piece);
        }
        tryAnything(gpa, text.items) catch |err| {
            errdefer std.debug.print("{s}\n", .{text.items});
            try expect(err == error.InvalidInput or err == error.InputOutput);
        };
    }
}

// Scenes beside the checkout.

test "the scenes of the thesis have the triangles of their glTF files" {
    const cases = .{
        .{ "cornell", 3978 }, .{ "sponza", 66454 }, .{ "sibenik", 80479 }, .{ "yeahright", 188674 },
    };
    const top = "../shared/scenes/";
    std.Io.Dir.cwd().access(io, top ++ "pbrt/pbrt-v2-scenes", .{}) catch return error.SkipZigTest;
    inline for (cases) |case| {
        var said: Diagnostic = .{};
        const text = top ++ "pbrt/pbrt-v2-scenes/thesis-" ++ case[0] ++ ".pbrt";
        var scene = try parse.parse(gpa, io, text, .{}, &said);
        defer scene.deinit();
        var model = try parse.parse(gpa, io, top ++ "thesis/" ++ case[0] ++ ".glb", .{}, &said);
        defer model.deinit();
        try expectEqual(case[1], scene.triangleCount());
        try expectEqual(case[1], model.triangleCount());
        try expectEqual([2]u32{ 1024, 1024 }, scene.resolution.?);
        const here = scene.cameras[0].projection.perspective.y_fov_rad;
        try expectNear(model.cameras[0].projection.perspective.y_fov_rad, here, 1e-4);
    }
}
