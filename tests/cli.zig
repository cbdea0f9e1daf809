//! Tests of the command line: the real program, in a fresh folder, under qemu where it is foreign.
//!
//! In: the environment, RAYLANE_PROGRAM (the program's path), RAYLANE_OPTIMIZE (its mode) and
//! RAYLANE_EMULATOR (what runs it, with its arguments, if anything does), as build/tests.zig sets
//! them. Each test opens a `Sandbox` and looks at exit codes, at both output streams and at the
//! files left behind.

const std = @import("std");
const Io = std.Io;
const testing = std.testing;
const io = testing.io;

/// A run that takes longer is ended, and is an error.
const run_s_max = 300;

/// Where the light does not matter: making the studio is most of a small picture's time.
const dark = "--env=none";

/// What the program left when it ended.
const Ending = struct {
    exit_code: u8,
    stdout: []const u8,
    stderr: []const u8,
};

test {
    _ = @import("json.zig");
    _ = @import("sandbox.zig");
}

/// A fresh folder in which the program runs; everything is freed by `deinit`.
pub const Sandbox = struct {
    folder: testing.TmpDir,
    arena_state: std.heap.ArenaAllocator,

    pub fn init() Sandbox {
        return .{
            .folder = testing.tmpDir(.{ .iterate = true }),
            .arena_state = .init(testing.allocator),
        };
    }

    pub fn deinit(sandbox: *Sandbox) void {
        sandbox.arena_state.deinit();
        sandbox.folder.cleanup();
        sandbox.* = undefined;
    }

    /// Runs the program with `arguments` in the folder. Death by a signal is an error.
    pub fn run(sandbox: *Sandbox, arguments: []const []const u8) !Ending {
        return sandbox.runShell("exec \"$@\"", arguments);
    }

    /// Runs a shell script in the folder, whose arguments are the program and its `arguments`.
    pub fn runShell(
        sandbox: *Sandbox,
        script: []const u8,
        arguments: []const []const u8,
    ) !Ending {
        const result = try std.process.run(sandbox.arena_state.allocator(), io, .{
            .argv = try sandbox.shellCommand(script, arguments),
            .cwd = .{ .dir = sandbox.folder.dir },
            .timeout = .{ .duration = .{ .raw = .fromSeconds(run_s_max), .clock = .awake } },
        });
        return switch (result.term) {
            .exited => |code| .{
                .exit_code = code,
                .stdout = result.stdout,
                .stderr = result.stderr,
            },
            else => {
                std.debug.print("{f}\n{s}", .{ result.term, result.stderr });
                return error.ProgramDied;
            },
        };
    }

    fn shellCommand(
        sandbox: *Sandbox,
        script: []const u8,
        arguments: []const []const u8,
    ) ![]const []const u8 {
        const arena = sandbox.arena_state.allocator();
        var command: std.ArrayList([]const u8) = .empty;
        try command.appendSlice(arena, &.{ "sh", "-c", script, "sh" });
        if (testing.environ.getPosix("RAYLANE_EMULATOR")) |emulator| {
            var words = std.mem.tokenizeScalar(u8, emulator, ' ');
            while (words.next()) |word| try command.append(arena, word);
        }
        try command.append(arena, testing.environ.getPosix("RAYLANE_PROGRAM") orelse
            return error.ProgramNotNamed);
        try command.appendSlice(arena, arguments);
        return command.items;
    }

    /// Runs the program and expects this exit code; shows stderr where it is another.
    pub fn expectExit(sandbox: *Sandbox, exit_code: u8, arguments: []const []const u8) !Ending {
        const ending = try sandbox.run(arguments);
        if (ending.exit_code != exit_code) std.debug.print("{s}", .{ending.stderr});
        try testing.expectEqual(exit_code, ending.exit_code);
        return ending;
    }

    /// Expects that the folder holds nothing.
    fn expectEmpty(sandbox: *Sandbox) !void {
        try sandbox.expectFiles(&.{});
    }

    /// Expects that the folder holds these files and nothing else.
    pub fn expectFiles(sandbox: *Sandbox, expected: []const []const u8) !void {
        const found = try sandbox.names();
        for (found) |name| {
            for (expected) |other| {
                if (std.mem.eql(u8, other, name)) break;
            } else {
                std.debug.print("left behind: {s}\n", .{name});
                return error.UnexpectedFile;
            }
        }
        try testing.expectEqual(expected.len, found.len);
    }

    /// What the folder holds.
    fn names(sandbox: *Sandbox) ![]const []const u8 {
        const arena = sandbox.arena_state.allocator();
        var found: std.ArrayList([]const u8) = .empty;
        var iterator = sandbox.folder.dir.iterate();
        while (try iterator.next(io)) |entry| {
            try found.append(arena, try arena.dupe(u8, entry.name));
        }
        return found.items;
    }

    /// Writes a file.
    pub fn write(sandbox: *Sandbox, name: []const u8, bytes: []const u8) !void {
        try sandbox.folder.dir.writeFile(io, .{ .sub_path = name, .data = bytes });
    }

    /// What a file holds.
    pub fn read(sandbox: *Sandbox, name: []const u8) ![]const u8 {
        const arena = sandbox.arena_state.allocator();
        return sandbox.folder.dir.readFileAlloc(io, name, arena, .unlimited);
    }
};

/// A scene of nothing: what is seen is the background.
const empty_scene =
    \\{"asset":{"version":"2.0"}}
;

/// A PBRT scene of nothing, which asks for a picture of its own.
const pbrt_scene =
    \\Film "image" "integer xresolution" 30 "integer yresolution" 20 "string filename" "other.png"
    \\Sampler "halton" "integer pixelsamples" 2
    \\SurfaceIntegrator "whitted" "integer maxdepth" 4
    \\Camera "perspective"
    \\WorldBegin
    \\Shape "sphere"
    \\
;

test "a PBRT scene brings size, samples and depth, the command line has the last word" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.write("s.pbrt", pbrt_scene);
    const own = try sandbox.expectExit(0, &.{ "s.pbrt", "--stats=json", "-q" });
    for ([_][]const u8{ "\"width\":30", "\"height\":20", "\"samples\":2", "\"depth\":3" }) |part| {
        try testing.expect(std.mem.find(u8, own.stdout, part) != null);
    }
    const asked = [_][]const u8{
        "s.pbrt",         "--stats=json", "-q", "-r", "8x4", "--spp", "1", "--depth", "0",
        "--tessellation", "4",
    };
    const other = try sandbox.expectExit(0, &asked);
    const parts = [_][]const u8{
        "\"triangles\":24", "\"width\":8", "\"height\":4", "\"samples\":1", "\"depth\":0",
    };
    for (parts) |part| try testing.expect(std.mem.find(u8, other.stdout, part) != null);
    try sandbox.expectFiles(&.{ "s.pbrt", "s.png" });
}

test "an error in a PBRT scene names file, line and column" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.write("s.pbrt", "WorldBegin\n  Include \"in.pbrt\"\n  Bang\n");
    try sandbox.write("in.pbrt", "Shape \"sphere\"");
    const own = try sandbox.expectExit(3, &.{"s.pbrt"});
    try testing.expectEqualStrings("raylane: s.pbrt:3:3: 'Bang' is no directive\n", own.stderr);
    try sandbox.write("in.pbrt", "\nShape \"sphere\" 1");
    const included = try sandbox.expectExit(3, &.{"s.pbrt"});
    try testing.expectEqualStrings("raylane: in.pbrt:2:16: '1' is no directive\n", included.stderr);
    try sandbox.expectFiles(&.{ "in.pbrt", "s.pbrt" });
}

/// A GLB of one triangle, 36 bytes of positions.
fn triangleScene(arena: std.mem.Allocator) ![]const u8 {
    const json =
        \\{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
        \\"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"buffers":[{"byteLength":36}],
        \\"bufferViews":[{"buffer":0,"byteLength":36}],"accessors":[{"bufferView":0,"count":3,
        \\"componentType":5126,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}]}
    ;
    const corners = [_]f32{ 0, 0, 0, 1, 0, 0, 0, 1, 0 };
    const padding = "   "[0 .. (4 - json.len % 4) % 4];
    var file: Io.Writer.Allocating = .init(arena);
    const writer = &file.writer;
    try writer.writeAll("glTF");
    const json_bytes: u32 = json.len + padding.len;
    for ([_]u32{ 2, 12 + 8 + json_bytes + 8 + 36, json_bytes, 0x4e4f534a }) |word| {
        try writer.writeInt(u32, word, .little);
    }
    try writer.writeAll(json ++ padding);
    for ([_]u32{ 36, 0x004e4942 }) |word| try writer.writeInt(u32, word, .little);
    for (corners) |coordinate| try writer.writeInt(u32, @bitCast(coordinate), .little);
    return file.written();
}

/// A cube from -1 to 1 whose faces shine in a colour each: 255 or 0 of red, green and blue by the
/// bits of their number, one more than twice the axis and, towards its negative end, another one.
fn coloredCube(sandbox: *Sandbox) !void {
    var buffer: Io.Writer.Allocating = .init(sandbox.arena_state.allocator());
    var json: Io.Writer.Allocating = .init(sandbox.arena_state.allocator());
    const out = &json.writer;
    try out.writeAll(
        \\{"asset":{"version":"2.0"},"extensionsUsed":["KHR_materials_unlit"],"scene":0,
        \\"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
        \\"buffers":[{"uri":"cube.bin","byteLength":432}],
        \\"bufferViews":[{"buffer":0,"byteLength":432}],"materials":[
    );
    for (1..7) |number| try out.print(
        \\{s}{{"extensions":{{"KHR_materials_unlit":{{}}}},"pbrMetallicRoughness":
        \\{{"baseColorFactor":[{d},{d},{d},1]}}}}
    , .{ if (number > 1) "," else "", number & 1, number >> 1 & 1, number >> 2 });
    try out.writeAll("],\"accessors\":[");
    for (0..6) |face| try out.print(
        \\{s}{{"bufferView":0,"byteOffset":{d},"count":6,"componentType":5126,"type":"VEC3",
        \\"min":[-1,-1,-1],"max":[1,1,1]}}
    , .{ if (face > 0) "," else "", 72 * face });
    try out.writeAll("],\"meshes\":[{\"primitives\":[");
    for (0..6) |face| {
        try out.print("{s}{{\"attributes\":{{\"POSITION\":{d}}},\"material\":{d}}}", .{
            if (face > 0) "," else "", face, face,
        });
        const side: f32 = if (face % 2 == 0) 1 else -1;
        for ([6]u2{ 0, 1, 3, 3, 2, 0 }) |bits| {
            const at = [2]f32{ if (bits & 1 != 0) 1 else -1, if (bits & 2 != 0) 1 else -1 };
            var corner: [3]f32 = undefined;
            corner[face / 2] = side;
            corner[(face / 2 + 1) % 3] = at[0] * side;
            corner[(face / 2 + 2) % 3] = at[1];
            for (corner) |x| try buffer.writer.writeInt(u32, @bitCast(x), .little);
        }
    }
    try out.writeAll("]}]}");
    try sandbox.write("cube.gltf", json.written());
    try sandbox.write("cube.bin", buffer.written());
}

/// A pixel of a picture, as the number of a face of the cube; 0 for what is black.
fn faceAt(ppm: []const u8, width: usize, height: usize, x: usize, y: usize) !usize {
    const pixels = ppm[ppm.len - 3 * width * height ..];
    var number: usize = 0;
    for (pixels[3 * (y * width + x) ..][0..3], 0..) |code, bit| {
        try testing.expect(code == 0 or code == 255);
        if (code == 255) number |= @as(usize, 1) << @intCast(bit);
    }
    return number;
}

/// Expects what every error must be: one line `raylane: ...`, ended, and nothing on stdout.
fn expectOneErrorLine(ending: Ending) !void {
    try testing.expectStringStartsWith(ending.stderr, "raylane: ");
    try testing.expectStringEndsWith(ending.stderr, "\n");
    try testing.expectEqual(1, std.mem.countScalar(u8, ending.stderr, '\n'));
    try testing.expectEqualStrings("", ending.stdout);
}

test "--version prints one line to stdout" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const ending = try sandbox.expectExit(0, &.{"--version"});
    try testing.expectStringStartsWith(ending.stdout, "raylane ");
    try testing.expectEqual(1, std.mem.countScalar(u8, ending.stdout, '\n'));
    try testing.expectEqualStrings("", ending.stderr);
}

test "--licenses prints the project's licence and those of all libraries" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const ending = try sandbox.expectExit(0, &.{"--licenses"});
    try testing.expectEqualStrings("", ending.stderr);
    try testing.expectStringStartsWith(ending.stdout, "MIT License\n");
    for ([_][]const u8{
        "The Raylane authors", "\ncgltf ",             "Johannes Kuhlmann", "Serge A. Zaitsev",
        "\nlibdeflate ",       "Eric Biggers",         "Google LLC",        "\nstb_image_write ",
        "Sean Barrett",        "\nmusl as a whole is", "Rich Felker",
    }) |part| {
        errdefer std.debug.print("{s}\n", .{part});
        try testing.expect(std.mem.find(u8, ending.stdout, part) != null);
    }
    try sandbox.expectEmpty();
}

test "an unknown flag is a usage error" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const ending = try sandbox.expectExit(2, &.{"--no-such-flag"});
    try expectOneErrorLine(ending);
    try testing.expect(std.mem.find(u8, ending.stderr, "--no-such-flag") != null);
    try sandbox.expectEmpty();
}

test "mistakes on the command line are usage errors in one line" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const alone = try sandbox.expectExit(2, &.{});
    try testing.expect(std.mem.startsWith(u8, alone.stderr, "usage: raylane SCENE"));
    for ([_][]const []const u8{
        &.{"render"},
        &.{ "builtin:cornell", "builtin:cornell" },
        &.{ "builtin:cornell", "-o", "a.tif" },
        &.{ "builtin:cornell", "--jpeg-quality=0" },
        &.{ "builtin:cornell", "--jpeg-quality=101" },
        &.{ "builtin:cornell", "--max-memory=much" },
        &.{ "builtin:cornell", "-o" },
        &.{ "builtin:cornell", "-r", "0x1" },
        &.{ "builtin:cornell", "--threads=0" },
        &.{ "builtin:cornell", "--variant=fast" },
        &.{ "builtin:cornell", "--stats=xml" },
        &.{ "builtin:cornell", "--bvh=best" },
        &.{ "builtin:cornell", "-r8x8", "--camera=no such camera" },
        &.{ "builtin:cornell", "-r8x8", "--camera=99" },
        &.{ "builtin:cornell", "-r8x8", "--scene=1" },
        &.{ "builtin:cornell", "-r8x8", "--material-variant=0" },
        &.{ "builtin:cornell", "-r8x8", "--up-axis=x" },
        &.{ "builtin:cornell", "-r16385" },
        &.{ "builtin:cornell", "--eye=1,2,nan" },
        &.{ "builtin:cornell", "--target=inf,2,3" },
        &.{ "builtin:cornell", "--up=0,0,0" },
        &.{ "builtin:cornell", "--fov=180" },
        &.{ "builtin:cornell", "--orbit=0,181" },
        &.{ "builtin:cornell", "--orbit=0,90,-1%" },
        &.{ "builtin:cornell", "--ortho", "--fov=40" },
        &.{ "builtin:cornell", "--eye=1,2,3", "--orbit=0,90" },
        &.{ "builtin:cornell", "--eye=1,2,3", "--target=1,2,3" },
        &.{ "builtin:cornell", "--camera=0", "--eye=1,2,3" },
    }) |arguments| {
        const ending = try sandbox.expectExit(2, arguments);
        try expectOneErrorLine(ending);
        try sandbox.expectEmpty();
    }
    const near = try sandbox.expectExit(2, &.{"--resolutoin=8x8"});
    try testing.expect(std.mem.find(u8, near.stderr, "'--resolution'") != null);
}

test "the camera stands where the options say" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try coloredCube(&sandbox);
    const Case = struct {
        options: []const []const u8,
        /// Faces in the middle, and at the left and the right.
        middle: usize = 0,
        left: usize = 0,
        right: usize = 0,
    };
    // From 3 metres by 90 degrees, a face covers the middle half of the picture, and so it does in
    // an orthographic picture 4 metres high.
    const square = [_][]const u8{ "--fov=90", "--target=0,0,0" };
    for ([_]Case{
        .{ .options = &square ++ .{"--orbit=0,90,3"}, .middle = 5 },
        .{ .options = &square ++ .{"--orbit=90,90,3"}, .middle = 1 },
        .{ .options = &square ++ .{"--orbit=180,90,3"}, .middle = 6 },
        .{ .options = &square ++ .{"--orbit=-90,90,3"}, .middle = 2 },
        .{ .options = &square ++ .{"--orbit=0,0,3"}, .middle = 3 },
        .{ .options = &square ++ .{"--orbit=0,180,3"}, .middle = 4 },
        .{ .options = &square ++ .{"--eye=0,3,0"}, .middle = 3 },
        .{ .options = &.{ "--ortho", "--orbit=0,90,5.494955" }, .middle = 5 },
        .{ .options = &.{ "--ortho", "--eye=0,0,5.494955" }, .middle = 5 },
    }) |case| {
        errdefer for (case.options) |option| std.debug.print("{s} ", .{option});
        const picture = try cubePicture(&sandbox, case.options);
        for ([_]usize{ 2, 13, 18, 32, 45, 50, 61 }) |at| {
            const face: usize = if (at > 16 and at < 48) case.middle else 0;
            try testing.expectEqual(face, try faceAt(picture, 64, 64, at, 32));
            try testing.expectEqual(face, try faceAt(picture, 64, 64, 32, at));
        }
    }
    for ([_]Case{
        .{ .options = &square ++ .{"--eye=3,0,3"}, .left = 5, .right = 1 },
        .{ .options = &square ++ .{ "--eye=3,0,3", "--up=0,-1,0" }, .left = 1, .right = 5 },
        .{ .options = &square ++ .{ "--orbit=45,90,4.3", "--up=0,-2,0" }, .left = 1, .right = 5 },
        .{ .options = &.{"--orbit=45,90"}, .left = 5, .right = 1 },
        .{ .options = &.{ "--orbit=45,90,100%", "--ortho" }, .left = 5, .right = 1 },
    }) |case| {
        errdefer for (case.options) |option| std.debug.print("{s} ", .{option});
        const picture = try cubePicture(&sandbox, case.options);
        try testing.expectEqual(case.left, try faceAt(picture, 64, 64, 26, 32));
        try testing.expectEqual(case.right, try faceAt(picture, 64, 64, 37, 32));
        for ([_]usize{ 0, 63 }) |at| {
            try testing.expectEqual(0, try faceAt(picture, 64, 64, at, 32));
        }
    }
    const wide = try sandbox.expectExit(0, &.{ "cube.gltf", "-r64", "-qo-", "--format=ppm" });
    try testing.expectStringStartsWith(wide.stdout, "P6\n64 48\n");
}

fn cubePicture(sandbox: *Sandbox, options: []const []const u8) ![]const u8 {
    const arguments = try std.mem.concat(sandbox.arena_state.allocator(), []const u8, &.{
        &.{ "cube.gltf", dark, "-r64x64", "-qo-", "--format=ppm", "--spp=1" },
        &.{"--background=#000000"},
        options,
    });
    return (try sandbox.expectExit(0, arguments)).stdout;
}

test "help is for everybody, fits a screen and keeps its promises" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const help = try sandbox.expectExit(0, &.{"--help"});
    try testing.expectEqualStrings("", help.stderr);
    try testing.expect(std.mem.countScalar(u8, help.stdout, '\n') <= 190);
    const again = try sandbox.expectExit(0, &.{ "absent.glb", "--no-such-flag", "-h" });
    try testing.expectEqualStrings(help.stdout, again.stdout);
    // The built-in scenes that the help names are those that there are.
    const unknown = try sandbox.expectExit(3, &.{"builtin:no such scene"});
    try expectOneErrorLine(unknown);
    const list = std.mem.cut(u8, std.mem.trimEnd(u8, unknown.stderr, "\n"), "there are: ").?[1];
    var names = std.mem.splitSequence(u8, list, ", ");
    while (names.next()) |name| {
        errdefer std.debug.print("{s}\n", .{name});
        try testing.expect(std.mem.find(u8, help.stdout, name) != null);
    }
    try sandbox.expectEmpty();
}

test "one of several scenes is chosen by its name or index, and z may point up" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.write("s.gltf",
        \\{"asset":{"version":"2.0"},"scene":1,
        \\"scenes":[{"name":"flat","nodes":[0]},{"name":"fl\u0061t z","nodes":[1]},{"nodes":[]}],
        \\"nodes":[{"mesh":0},{"mesh":0,"matrix":[1,0,0,0,0,0,1,0,0,-1,0,0,0,0,0,1]}],
        \\"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
        \\"accessors":[{"bufferView":0,"componentType":5121,"count":3,"type":"VEC3"}],
        \\"extensionsUsed":["KHR_mesh_quantization"],
        \\"bufferViews":[{"buffer":0,"byteLength":11,"byteStride":4}],
        \\"buffers":[{"byteLength":11,"uri":"data:;base64,AAAAAAEAAAAAAQA="}]}
    );
    var pictures: [6][]const u8 = undefined;
    for (&pictures, [_][2][]const u8{
        .{ "--scene=flat", "--up-axis=y" },
        .{ "--scene=0", "--up-axis=y" },
        .{ "--scene=1", "--up-axis=z" },
        .{ "--scene=flat z", "--up-axis=z" },
        .{ "-q", "--up-axis=z" },
        .{ "-q", "-q" },
    }) |*picture, choice| {
        const arguments = [_][]const u8{ "s.gltf", "-q", "-r8x8", "-oa.ppm" } ++ choice;
        _ = try sandbox.expectExit(0, &arguments);
        picture.* = try sandbox.read("a.ppm");
    }
    for (pictures[1..5]) |picture| try testing.expectEqualStrings(pictures[0], picture);
    try testing.expect(!std.mem.eql(u8, pictures[0], pictures[5]));
    const cases = [_][2][]const u8{
        .{ "--scene=3", "no scene 3; the file has 0 'flat', 1 'flat z', 2\n" },
        .{ "--scene=x", "no scene 'x'; the file has 0 'flat', 1 'flat z', 2\n" },
    };
    for (cases) |case| {
        const ending = try sandbox.expectExit(2, &.{ "s.gltf", "-r8x8", "-ono.ppm", case[0] });
        try expectOneErrorLine(ending);
        try testing.expectStringEndsWith(ending.stderr, case[1]);
    }
}

test "a scene is rendered to its name, with a report on stdout" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const ending = try sandbox.expectExit(0, &.{ "builtin:cornell", "-r16x9" });
    try testing.expectEqualStrings("", ending.stderr);
    for ([_][]const u8{ "builtin:cornell", "cornell.png", "16 x 9", "image hash" }) |word| {
        try testing.expect(std.mem.find(u8, ending.stdout, word) != null);
    }
    try sandbox.expectFiles(&.{"cornell.png"});
    const png = try sandbox.read("cornell.png");
    try testing.expectStringStartsWith(png, "\x89PNG\r\n\x1a\n");
    try testing.expectEqual(16, std.mem.readInt(u32, png[16..20], .big));
    try testing.expectEqual(9, std.mem.readInt(u32, png[20..24], .big));
}

test "a file elsewhere is rendered to the working directory, replacing what is there" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.folder.dir.createDir(io, "sub", .default_dir);
    try sandbox.write("sub/tri.angle.glb", try triangleScene(sandbox.arena_state.allocator()));
    try sandbox.write("tri.angle.png", "old");
    _ = try sandbox.expectExit(0, &.{ "render", "sub/tri.angle.glb", "-r8x8" });
    try sandbox.expectFiles(&.{ "sub", "tri.angle.png" });
    try testing.expectStringStartsWith(try sandbox.read("tri.angle.png"), "\x89PNG");
    _ = try sandbox.expectExit(0, &.{ "-r8x8", "-o", "sub/b.pfm", "--", "sub/tri.angle.glb" });
    const pfm = try sandbox.read("sub/b.pfm");
    try testing.expectStringStartsWith(pfm, "PF\n8 8\n-1.0\n");
    try testing.expectEqual(12 + 8 * 8 * 12, pfm.len);
}

/// The part of the JSON report that these tests look at.
const Stats = struct {
    version: []const u8,
    scene: []const u8,
    triangles: u64,
    width: u32,
    height: u32,
    samples: u32,
    depth: u32,
    threads: u32,
    variant: []const u8,
    time_ms: struct { total: f64 },
    rays: struct { primary: u64, shadow: u64, secondary: u64 },
    tests: ?struct {
        box_issued: u64,
        box_useful: u64,
        triangle_issued: u64,
        triangle_useful: u64,
    },
    bvh: struct { nodes: u64, depth: u32, sah_cost: ?f64, bytes: u64 },
    memory_peak_bytes: u64,
    image_hash: []const u8,
    exposure_ev: ?f32,
    warnings: []const []const u8,
};

fn statsOf(sandbox: *Sandbox, json: []const u8) !Stats {
    try testing.expectEqual(1, std.mem.countScalar(u8, json, '\n'));
    return std.json.parseFromSliceLeaky(Stats, sandbox.arena_state.allocator(), json, .{
        .ignore_unknown_fields = true,
    });
}

test "the report as JSON says what was done" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const ending = try sandbox.expectExit(0, &.{
        "builtin:cornell", "-q", "--stats=json", "--thesis", "-r16x8", "-t3", "--count-tests",
    });
    try testing.expectEqualStrings("", ending.stderr);
    const stats = try statsOf(&sandbox, ending.stdout);
    try testing.expectEqualStrings("builtin:cornell", stats.scene);
    try testing.expectEqual([2]u32{ 16, 8 }, [2]u32{ stats.width, stats.height });
    try testing.expectEqual([3]u32{ 1, 3, 3 }, [3]u32{ stats.samples, stats.depth, stats.threads });
    try testing.expectEqual(16 * 8, stats.rays.primary);
    try testing.expect(stats.rays.shadow > 0 and stats.triangles > 0);
    try testing.expect(stats.tests.?.box_useful <= stats.tests.?.box_issued);
    try testing.expect(stats.tests.?.triangle_useful > 0);
    try testing.expect(stats.bvh.nodes > 0 and stats.bvh.bytes > 0 and stats.bvh.sah_cost.? > 0);
    try testing.expect(stats.memory_peak_bytes > 0 and stats.time_ms.total > 0);
    try testing.expectEqual(16, stats.image_hash.len);

    const plain = try sandbox.expectExit(0, &.{
        "builtin:cornell", "--thesis", "--stats", "json", "-r16x8", "-t1", "--tile-size=4",
    });
    const plain_stats = try statsOf(&sandbox, plain.stdout);
    try testing.expectEqual(null, plain_stats.tests);
    try testing.expectEqualStrings(stats.image_hash, plain_stats.image_hash);

    // Another tree of less cost, the same picture.
    const careful = try sandbox.expectExit(0, &.{
        "builtin:cornell", "--thesis", "--stats=json", "-r16x8", "--bvh=high",
    });
    const careful_stats = try statsOf(&sandbox, careful.stdout);
    try testing.expectEqualStrings(stats.image_hash, careful_stats.image_hash);
    try testing.expect(careful_stats.bvh.sah_cost.? < stats.bvh.sah_cost.?);
}

test "every variant is listed, accepted, and gives the same picture" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const listed = try sandbox.expectExit(0, &.{"--list-variants"});
    try testing.expectEqualStrings("", listed.stderr);
    var names = std.mem.tokenizeScalar(u8, listed.stdout, '\n');
    const scene_arguments = [_][]const u8{
        "builtin:cornell", dark, "-r9x7", "-q", "--stats=json",
    };
    const first = try sandbox.expectExit(0, &scene_arguments);
    const expected = try statsOf(&sandbox, first.stdout);
    try testing.expectEqualStrings(expected.variant, names.peek().?);
    while (names.next()) |name| {
        errdefer std.debug.print("{s}\n", .{name});
        const ending = try sandbox.expectExit(0, &(scene_arguments ++ .{ "--variant", name }));
        const stats = try statsOf(&sandbox, ending.stdout);
        try testing.expectEqualStrings(name, stats.variant);
        try testing.expectEqualStrings(expected.image_hash, stats.image_hash);
    }
}

test "-o - puts the image and nothing else on stdout" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const png = try sandbox.expectExit(0, &.{ "builtin:cornell", "-r8x8", "-o", "-" });
    try testing.expectStringStartsWith(png.stdout, "\x89PNG\r\n\x1a\n");
    try testing.expectStringEndsWith(png.stdout, "IEND\xae\x42\x60\x82");
    try testing.expectEqualStrings("", png.stderr);
    const ppm = try sandbox.expectExit(0, &.{
        "builtin:cornell", "-r8x8", "-o-", "--format=ppm", "--stats=json",
    });
    try testing.expectStringStartsWith(ppm.stdout, "P6\n8 8\n255\n");
    try testing.expectEqual(11 + 8 * 8 * 3, ppm.stdout.len);
    try testing.expectEqual(8, (try statsOf(&sandbox, ppm.stderr)).width);
    try sandbox.expectEmpty();
}

test "of several scenes each is a picture, is there already, or is a line" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const scene = try triangleScene(sandbox.arena_state.allocator());
    try sandbox.folder.dir.createDirPath(io, "in/more");
    try sandbox.folder.dir.createDirPath(io, "out");
    for ([_][2][]const u8{
        .{ "in/a.glb", scene },   .{ "in/b.gltf", "no" },  .{ "in/c.GLB", scene },
        .{ "in/d.txt", "notes" }, .{ "out/c.png", "old" },
    }) |file| try sandbox.write(file[0], file[1]);
    const ending = try sandbox.expectExit(3, &.{
        "in", "--skip-existing", "-oout/", "-r4", dark, "--jobs=2", "in/none.ply",
    });
    try testing.expectEqualStrings("", ending.stdout);
    for ([_][]const u8{
        "raylane: in: warning: not looked into 1 folder in it\n",
        "raylane: in/b.gltf: ",
        "raylane: in/none.ply: does not exist\n",
        "raylane: in/a.glb: out/a.png, 4x3, ",
        "raylane: 1 picture in ",
        ", 1 kept, 2 failures\n",
    }) |part| {
        errdefer std.debug.print("{s}\n", .{ending.stderr});
        try testing.expect(std.mem.find(u8, ending.stderr, part) != null);
    }
    try testing.expectEqualStrings("old", try sandbox.read("out/c.png"));
    try testing.expectEqualStrings("\x89PNG", (try sandbox.read("out/a.png"))[0..4]);
}

/// A triangle that moves along x by one in a second.
const moving_scene =
    \\{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
    \\"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"bufferViews":[{"buffer":0,
    \\"byteLength":68}],"accessors":[{"bufferView":0,"count":3,"componentType":5126,"type":"VEC3",
    \\"min":[0,0,0],"max":[1,1,0]},{"bufferView":0,"byteOffset":36,"count":2,"min":[0],"max":[1],
    \\"componentType":5126,"type":"SCALAR"},{"bufferView":0,"byteOffset":44,"count":2,
    \\"componentType":5126,"type":"VEC3"}],"animations":[{"channels":[{"sampler":0,"target":
    \\{"node":0,"path":"translation"}}],"samplers":[{"input":1,"output":2}]}],"buffers":[{
    \\"byteLength":68,"uri":"data:application/octet-stream;base64,
++ "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAAAA" ++
    \\AAA="}]}
;

test "frames are the pictures of their moments, and a film has them in a row" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.write("m.gltf", moving_scene);
    const place = [_][]const u8{ "m.gltf", "-q", "-r4x4", dark, "--eye=0,0,4", "--target=0,0,0" };
    _ = try sandbox.expectExit(0, &place ++ [_][]const u8{
        "--frames=0,6", "--fps=12", "-omade/{model}_{frame:2}.ppm",
    });
    _ = try sandbox.expectExit(0, &place ++ [_][]const u8{ "--animation-time=0.5", "-oone.ppm" });
    const later = try sandbox.read("made/m_06.ppm");
    try testing.expectEqualStrings(try sandbox.read("one.ppm"), later);
    const first = try sandbox.read("made/m_00.ppm");
    try testing.expect(!std.mem.eql(u8, first, later));
    const film = try sandbox.expectExit(0, &.{
        "m.gltf", "--turntable=2", "--format=y4m", "-o-", "-r4x4", dark,
    });
    const header = "YUV4MPEG2 W4 H4 F24:1 Ip A1:1 C444 XCOLORRANGE=LIMITED\n";
    try testing.expectEqual(header.len + 2 * ("FRAME\n".len + 3 * 16), film.stdout.len);
    try testing.expect(std.mem.startsWith(u8, film.stdout, header ++ "FRAME\n"));
}

test "parts merge into the picture's file, wherever the scene lies; without one it stays" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.folder.dir.createDirPath(io, "there");
    try sandbox.write("s.pbrt", pbrt_scene);
    try sandbox.write("there/t.pbrt", pbrt_scene);
    _ = try sandbox.expectExit(0, &.{ "s.pbrt", "-owhole.ppm" });
    _ = try sandbox.expectExit(0, &.{ "s.pbrt", "--tile=1/2", "-o1.exr" });
    _ = try sandbox.expectExit(0, &.{
        "there/t.pbrt", "--tile", "2/2", "-o2.exr", "-t1", "--tile-size=8",
    });
    try sandbox.write("merged.ppm", "old");
    const missing = try sandbox.expectExit(3, &.{ "merge", "1.exr", "-omerged.ppm" });
    const reason = "raylane: merged.ppm: part 2 of 2 is missing\n";
    try testing.expectEqualStrings(reason, missing.stderr);
    try testing.expectEqualStrings("old", try sandbox.read("merged.ppm"));
    const merged = try sandbox.expectExit(0, &.{ "merge", "2.exr", "1.exr", "-omerged.ppm" });
    try testing.expectEqualStrings("", merged.stderr);
    const whole = try sandbox.read("whole.ppm");
    try testing.expectEqualStrings(whole, try sandbox.read("merged.ppm"));
    const outside = try sandbox.expectExit(2, &.{ "s.pbrt", "--crop=30,0,31,1" });
    try testing.expectStringEndsWith(outside.stderr, "in a picture of 30x20\n");
    try sandbox.expectFiles(&.{ "1.exr", "2.exr", "merged.ppm", "s.pbrt", "there", "whole.ppm" });
}

test "every format by its name or by --format, JPEG smaller with less quality" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    for ([_][2][]const u8{
        .{ "a.png", "\x89PNG" },    .{ "a.jpg", "\xff\xd8\xff" }, .{ "b.jpeg", "\xff\xd8\xff" },
        .{ "a.bmp", "BM" },         .{ "a.hdr", "#?RADIANCE\n" }, .{ "a.ppm", "P6\n16 9\n" },
        .{ "a.pfm", "PF\n16 9\n" }, .{ "a.tga", "\x00\x00\x0a" },
    }) |case| {
        errdefer std.debug.print("{s}\n", .{case[0]});
        _ = try sandbox.expectExit(0, &.{ "builtin:cornell", dark, "-r16x9", "-q", "-o", case[0] });
        try testing.expectStringStartsWith(try sandbox.read(case[0]), case[1]);
        try sandbox.folder.dir.deleteFile(io, case[0]);
    }
    const to_stdout = [_][]const u8{
        "builtin:cornell", dark, "-r64x64", "-o-", "--format=jpeg",
    };
    const usual = try sandbox.expectExit(0, &to_stdout);
    const ninety = try sandbox.expectExit(0, &(to_stdout ++ .{"--jpeg-quality=90"}));
    try testing.expectEqualSlices(u8, usual.stdout, ninety.stdout);
    const poor = try sandbox.expectExit(0, &(to_stdout ++ .{"--jpeg-quality=10"}));
    try testing.expect(poor.stdout.len < usual.stdout.len / 2);
    _ = try sandbox.expectExit(0, &.{ "builtin:cornell", "-r8x8", "-q", "--format=jpg" });
    try sandbox.expectFiles(&.{"cornell.jpg"});
}

test "a picture that the format cannot hold is an error before it is rendered" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    // Enough samples for an hour.
    const ending = try sandbox.expectExit(1, &.{
        "builtin:cornell", "-r65536x16", "--spp=4096", "-o", "a.jpg",
    });
    try testing.expectEqualStrings(
        "raylane: a.jpg: a jpg file has 65535 pixels on a side at most\n",
        ending.stderr,
    );
    try sandbox.expectEmpty();
}

test "background, exposure and transparency reach the pixels" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.write("empty.gltf", empty_scene);
    const to_stdout = [_][]const u8{ "empty.gltf", "-q", "-r1x1", "-o-" };
    const Case = struct { arguments: []const []const u8, pixel: [3]u8 };
    for ([_]Case{
        .{ .arguments = &.{"--background=#ff8001"}, .pixel = .{ 255, 128, 1 } },
        .{ .arguments = &.{ "--background=#f81", "--exposure=3" }, .pixel = .{ 255, 136, 17 } },
        .{ .arguments = &.{ "--background=Olive", "--tonemap=agx" }, .pixel = .{ 128, 128, 0 } },
        .{
            .arguments = &.{ "--background=0,0.5,1", "--tonemap=linear" },
            .pixel = .{ 0, 188, 255 },
        },
        .{
            .arguments = &.{ "--background=0,0.5,1", "--tonemap=linear", "--exposure=-1" },
            .pixel = .{ 0, 137, 188 },
        },
        // What the display is to show of 0.5 by PBR Neutral: less by 0.04.
        .{ .arguments = &.{"--background=0.5,0.5,0.5"}, .pixel = @splat(181) },
        .{ .arguments = &.{"--background=transparent"}, .pixel = .{ 0, 0, 0 } },
        // The middle of the gradient, and what surrounds a scene without lights.
        .{ .arguments = &.{}, .pixel = @splat(135) },
        .{
            .arguments = &.{ "--env=none", "--ambient=0.25", "--background=env" },
            .pixel = @splat(126),
        },
        // By the thesis: without curve and gradient.
        .{ .arguments = &.{ "--thesis", "-r1x1" }, .pixel = @splat(160) },
    }) |case| {
        const arena = sandbox.arena_state.allocator();
        const ending = try sandbox.expectExit(0, try std.mem.concat(arena, []const u8, &.{
            &to_stdout, &.{"--format=ppm"}, case.arguments,
        }));
        try testing.expectEqualSlices(u8, &case.pixel, ending.stdout["P6\n1 1\n255\n".len..]);
    }
    // The studio is seen whatever lights the scene.
    const studio = try sandbox.expectExit(0, &(to_stdout ++ .{ "--background=env", "-r9x9" }));
    const backdrop = try sandbox.expectExit(0, &(to_stdout ++ .{
        "--env=none", "--background=studio", "-r9x9",
    }));
    try testing.expectEqualSlices(u8, studio.stdout, backdrop.stdout);
    const opaque_png = try sandbox.expectExit(0, &to_stdout);
    try testing.expect(!std.mem.eql(u8, opaque_png.stdout, studio.stdout));
    const clear_png = try sandbox.expectExit(0, &(to_stdout ++ .{"--background=transparent"}));
    // The header's colour type: RGB and RGBA.
    try testing.expectEqual(2, opaque_png.stdout[25]);
    try testing.expectEqual(6, clear_png.stdout[25]);
}

/// A triangle that fills the view, as it is painted: sRGB codes 255, 128 and 0.
const unlit_scene =
    \\{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1]}],
    \\"nodes":[{"mesh":0},{"camera":0,"translation":[0,0,1]}],
    \\"cameras":[{"type":"perspective","perspective":{"yfov":1,"znear":0.1}}],
    \\"extensionsUsed":["KHR_materials_unlit"],
    \\"materials":[{"extensions":{"KHR_materials_unlit":{}},
    \\"pbrMetallicRoughness":{"baseColorFactor":[1,0.21586,0,1]}}],
    \\"meshes":[{"primitives":[{"attributes":{"POSITION":0},"material":0}]}],
    \\"buffers":[{"byteLength":36,"uri":"t.bin"}],"bufferViews":[{"buffer":0,"byteLength":36}],
    \\"accessors":[{"bufferView":0,"count":3,"componentType":5126,"type":"VEC3",
    \\"min":[-9,-9,0],"max":[9,9,0]}]}
;
const unlit_corners = [_]f32{ -9, -9, 0, 9, -9, 0, 0, 9, 0 };

test "an unlit surface comes out as it is painted, whatever the exposure and the curve" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.write("u.gltf", unlit_scene);
    try sandbox.write("t.bin", std.mem.sliceAsBytes(&unlit_corners));
    for ([_][]const u8{ "neutral", "aces", "agx", "linear" }) |curve| {
        for ([_][]const u8{ "0", "-5", "4", "auto" }) |exposure| {
            errdefer std.debug.print("{s} {s}\n", .{ curve, exposure });
            const is_metered = std.mem.eql(u8, exposure, "auto");
            const ending = try sandbox.expectExit(0, &.{
                "u.gltf",     "-q",     "-r3x2",     "-o-", "--format=ppm",
                "--exposure", exposure, "--tonemap", curve, if (is_metered) "-q" else dark,
            });
            const pixels = ending.stdout["P6\n3 2\n255\n".len..];
            for (0..6) |index| {
                try testing.expectEqualSlices(u8, &.{ 255, 128, 0 }, pixels[index * 3 ..][0..3]);
            }
        }
    }
    // By the thesis it is radiance.
    const thesis = try sandbox.expectExit(0, &.{
        "u.gltf", "--thesis", "-r1x1", "--exposure=-1", "-q", "-o-", "--format=ppm",
    });
    try testing.expectEqualSlices(u8, &.{ 188, 92, 0 }, thesis.stdout["P6\n1 1\n255\n".len..]);
}

/// The same with a texture.
const painted_scene =
    \\{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1]}],
    \\"nodes":[{"mesh":0},{"camera":0,"translation":[0,0,1]}],
    \\"cameras":[{"type":"perspective","perspective":{"yfov":1,"znear":0.1}}],
    \\"extensionsUsed":["KHR_materials_unlit"],"images":[{"uri":"paint.png"}],
    \\"textures":[{"source":0}],"materials":[{"extensions":{"KHR_materials_unlit":{}},
    \\"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],
    \\"meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},"material":0}]}],
    \\"buffers":[{"byteLength":36,"uri":"t.bin"}],"bufferViews":[{"buffer":0,"byteLength":36}],
    \\"accessors":[{"bufferView":0,"count":3,"componentType":5126,"type":"VEC3",
    \\"min":[-9,-9,0],"max":[9,9,0]},
    \\{"bufferView":0,"count":3,"componentType":5126,"type":"VEC2"}]}
;

test "a texture of an unlit surface comes out as it is painted" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.write("p.gltf", painted_scene);
    try sandbox.write("empty.gltf", empty_scene);
    try sandbox.write("t.bin", std.mem.sliceAsBytes(&unlit_corners));
    for ([_][3]u8{ .{ 1, 2, 3 }, .{ 200, 99, 50 }, .{ 254, 128, 255 } }) |codes| {
        const arena = sandbox.arena_state.allocator();
        const color = try arena.print("--background=#{x:0>2}{x:0>2}{x:0>2}", .{
            codes[0], codes[1], codes[2],
        });
        _ = try sandbox.expectExit(0, &.{ "empty.gltf", "-q", "-r4x4", color, "-opaint.png" });
        const ending = try sandbox.expectExit(0, &.{
            "p.gltf", "-q", "-r3x2", "-o-", "--format=ppm",
        });
        try testing.expectEqualStrings("", ending.stderr);
        const pixels = ending.stdout["P6\n3 2\n255\n".len..];
        for (0..6) |index| {
            try testing.expectEqualSlices(u8, &codes, pixels[index * 3 ..][0..3]);
        }
    }
}

test "the exposure is metered by lights of the file alone, and the report says it" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const metered = try sandbox.expectExit(0, &.{ "builtin:cornell", "-r40x30" });
    try testing.expect(std.mem.find(u8, metered.stdout, " EV (automatic), neutral\n") != null);
    const json = try sandbox.expectExit(0, &.{
        "builtin:cornell", "-q", "-r40x30", "--stats=json",
    });
    const ev = (try statsOf(&sandbox, json.stdout)).exposure_ev.?;
    try testing.expect(ev > -2 and ev < 2 and ev != 0);
    // The number that is said gives the same picture again.
    const arena = sandbox.arena_state.allocator();
    const again = try sandbox.expectExit(0, &.{
        "builtin:cornell", "-r40x30", "-o-", try arena.print("--exposure={d}", .{ev}),
    });
    try testing.expectEqualSlices(u8, try sandbox.read("cornell.png"), again.stdout);
    // What surrounds the lights does not depend on it.
    const radiance = [_][]const u8{ "builtin:cornell", "-q", "-r40x30", "-o-", "--format=pfm" };
    const darker = try sandbox.expectExit(0, &(radiance ++ .{"--exposure=-3"}));
    const automatic = try sandbox.expectExit(0, &radiance);
    try testing.expectEqualSlices(u8, automatic.stdout, darker.stdout);
    const lamp = try sandbox.expectExit(0, &(radiance ++ .{"--env=none"}));
    try testing.expect(!std.mem.eql(u8, automatic.stdout, lamp.stdout));

    try sandbox.write("empty.gltf", empty_scene);
    const unlit = try sandbox.expectExit(0, &.{ "empty.gltf", "-q", "-r4x4", "--stats=json" });
    try testing.expectEqual(0, (try statsOf(&sandbox, unlit.stdout)).exposure_ev.?);
    const linear = try sandbox.expectExit(0, &.{
        "empty.gltf", "-q", "-r4x4", "--stats=json", "-oa.pfm",
    });
    try testing.expectEqual(null, (try statsOf(&sandbox, linear.stdout)).exposure_ev);
}

test "a picture that shows next to nothing says what helps, but not with -q" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.write("empty.gltf", empty_scene);
    const Case = struct { arguments: []const []const u8, says: ?[]const u8 };
    for ([_]Case{
        .{
            .arguments = &.{"empty.gltf"},
            .says = "100 % of what the picture shows is background; --orbit",
        },
        .{ .arguments = &.{ "empty.gltf", "--background=0.3,0.3,0.3" }, .says = null },
        .{
            .arguments = &.{ "empty.gltf", "--background=9,9,9", "--exposure=1" },
            .says = "100 % of what the picture shows is white; --exposure auto makes",
        },
        .{
            .arguments = &.{ "builtin:cornell", "--exposure=-40" },
            .says = " % of what the picture shows is black; --exposure auto makes",
        },
        .{ .arguments = &.{"builtin:cornell"}, .says = null },
    }) |case| {
        const arena = sandbox.arena_state.allocator();
        const common = [_][]const u8{ "-r40x40", "--stats=json" };
        const loud = try sandbox.expectExit(
            0,
            try std.mem.concat(arena, []const u8, &.{ &common, case.arguments }),
        );
        const warnings = (try statsOf(&sandbox, loud.stdout)).warnings;
        const last = if (warnings.len > 0) warnings[warnings.len - 1] else "";
        errdefer std.debug.print("{s}\n{s}\n", .{ case.arguments[0], loud.stderr });
        if (case.says) |text| {
            try testing.expect(std.mem.find(u8, last, text) != null);
            try testing.expect(std.mem.find(u8, loud.stderr, text) != null);
        } else {
            try testing.expect(std.mem.find(u8, last, "of what the picture shows") == null);
        }
        const quiet = try sandbox.expectExit(
            0,
            try std.mem.concat(arena, []const u8, &.{ &.{"-q"}, case.arguments, &.{"-r40x40"} }),
        );
        try testing.expectEqualStrings("", quiet.stdout);
        try testing.expectEqualStrings("", quiet.stderr);
    }
}

test "warnings go to stderr, and nowhere with -q" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.write("empty.gltf", empty_scene);
    const loud = try sandbox.expectExit(0, &.{ "empty.gltf", "-r1x1", "--stats=json" });
    try testing.expectStringStartsWith(loud.stderr, "raylane: empty.gltf: warning: ");
    try testing.expect((try statsOf(&sandbox, loud.stdout)).warnings.len > 0);
    const quiet = try sandbox.expectExit(0, &.{ "empty.gltf", "-r1x1", "-q" });
    try testing.expectEqualStrings("", quiet.stderr);
    try testing.expectEqualStrings("", quiet.stdout);
    const verbose = try sandbox.expectExit(0, &.{ "empty.gltf", "-r1x1", "-v", "--stats=none" });
    try testing.expect(std.mem.find(u8, verbose.stderr, "lights") != null);
    try testing.expectEqualStrings("", verbose.stdout);
}

test "a scene that cannot be read is an error that leaves the old image" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.folder.dir.createDir(io, "folder", .default_dir);
    try sandbox.write("a.png", "old");
    try sandbox.write("broken.gltf", "{");
    try sandbox.write("picture.glb", "\x89PNG\r\n\x1a\n");
    try sandbox.write("empty.glb", "");
    for ([_]struct { []const u8, u8 }{
        .{ "absent.gltf", 1 },
        .{ "absent/a.gltf", 1 },
        .{ "broken.gltf", 3 },
        .{ "picture.glb", 3 },
        .{ "empty.glb", 3 },
    }) |case| {
        const ending = try sandbox.expectExit(case[1], &.{ case[0], "-o", "a.png" });
        try expectOneErrorLine(ending);
        try testing.expectStringStartsWith(ending.stderr["raylane: ".len..], case[0]);
    }
    const folder = try sandbox.expectExit(1, &.{ "folder", "-q", "-o", "a.png" });
    try testing.expectStringStartsWith(folder.stderr, "raylane: folder: no scenes in it\n");
    try sandbox.expectFiles(&.{ "a.png", "broken.gltf", "empty.glb", "folder", "picture.glb" });
    try testing.expectEqualStrings("old", try sandbox.read("a.png"));
}

test "a scene comes from standard input or through a pipe by its name" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.write("s.glb", try triangleScene(sandbox.arena_state.allocator()));
    for ([_][]const u8{
        "cat s.glb | \"$@\" - -o a.png",
        "\"$@\" - -o a.png <s.glb",
        "mkfifo p && { cat s.glb >p & } && \"$@\" p -o a.png && wait && rm p",
    }) |script| {
        const arguments = [_][]const u8{ "-r4x4", "--spp=1", "-q", "-t1" };
        const ending = try sandbox.runShell(script, &arguments);
        try testing.expectEqualStrings("", ending.stderr);
        try testing.expectEqual(0, ending.exit_code);
        try sandbox.expectFiles(&.{ "a.png", "s.glb" });
        try sandbox.folder.dir.deleteFile(io, "a.png");
    }
    const empty = try sandbox.runShell("\"$@\" - -o a.png </dev/null", &.{});
    try testing.expectEqual(3, empty.exit_code);
    try testing.expectEqualStrings("raylane: standard input: is empty\n", empty.stderr);
    try sandbox.expectFiles(&.{"s.glb"});
}

test "a file name cannot break the line of a message" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const ending = try sandbox.expectExit(1, &.{"a\nraylane: b\x1b[31m\xff.glb"});
    try expectOneErrorLine(ending);
    try testing.expectStringStartsWith(ending.stderr, "raylane: a?raylane: b?[31m?.glb: ");
}

test "a GLB cut anywhere is invalid" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const whole = try triangleScene(sandbox.arena_state.allocator());
    const lengths = [_]usize{
        1, 4, 11, 12, 19, 20, 21, 200, whole.len - 44, whole.len - 36, whole.len - 1,
    };
    for (lengths) |length| {
        errdefer std.debug.print("{d} bytes\n", .{length});
        try sandbox.write("cut.glb", whole[0..length]);
        try expectOneErrorLine(try sandbox.expectExit(3, &.{"cut.glb"}));
    }
    try sandbox.expectFiles(&.{"cut.glb"});
}

test "an output that cannot be written is an error at once" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.folder.dir.createDir(io, "folder.png", .default_dir);
    try sandbox.folder.dir.symLink(io, "folder.png", "link.png", .{});
    const outputs = [_][]const u8{
        "absent/a.png", "folder.png", "link.png", "/proc/a.png", "/dev/fd/99",
    };
    for (outputs) |output| {
        // Enough samples for a day: the error comes before the work.
        const ending = try sandbox.expectExit(1, &.{
            "builtin:cornell", "--spp=4096", "-r16384x16384", "-o", output, "--format=png",
        });
        try expectOneErrorLine(ending);
        try testing.expectStringStartsWith(ending.stderr["raylane: ".len..], output);
    }
    try sandbox.expectFiles(&.{ "folder.png", "link.png" });
}

test "a folder without permission to write is an error" {
    if (std.posix.system.geteuid() == 0) return error.SkipZigTest; // Nothing is forbidden to root.
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const script = "mkdir locked && chmod 555 locked && \"$@\"; code=$?; rmdir locked; exit $code";
    const ending = try sandbox.runShell(script, &.{ "builtin:cornell", "-r8x8", "-olocked/a.png" });
    try testing.expectEqual(1, ending.exit_code);
    try expectOneErrorLine(ending);
    try sandbox.expectEmpty();
}

test "a full disk is an error that leaves the old image" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.write("a.ppm", "old");
    // One block of 512 bytes (1024 in some shells).
    const ending = try sandbox.runShell("ulimit -f 1; exec \"$@\"", &.{
        "builtin:cornell", "-r64x64", "-o", "a.ppm",
    });
    try testing.expectEqual(1, ending.exit_code);
    try expectOneErrorLine(ending);
    try testing.expectStringStartsWith(ending.stderr, "raylane: a.ppm: ");
    try sandbox.expectFiles(&.{"a.ppm"});
    try testing.expectEqualStrings("old", try sandbox.read("a.ppm"));
}

test "a stdout that takes nothing is an error in one line" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    for ([_][]const u8{
        "exec \"$@\" >/dev/full",
        "exec \"$@\" >&-",
        // A pipe whose reader has gone.
        "mkfifo pipe; (: <pipe) & exec 5>pipe; wait; rm pipe; exec \"$@\" >&5",
    }) |script| {
        for ([_][]const []const u8{
            &.{"--help"},
            &.{"--list-variants"},
            &.{ "builtin:cornell", dark, "-r64x64", "-o-" },
        }) |arguments| {
            errdefer std.debug.print("{s} {s}\n", .{ script, arguments[0] });
            const ending = try sandbox.runShell(script, arguments);
            try testing.expectEqual(1, ending.exit_code);
            try expectOneErrorLine(ending);
            try sandbox.expectEmpty();
        }
    }
}

test "closed standard files do not turn the image into a log" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.write("empty.gltf", empty_scene);
    const script = "exec \"$@\" 0>&- 2>&-";
    const arguments = [_][]const u8{ "empty.gltf", "-r1x1", "-v", "-oa.ppm", "--background=0,0,0" };
    const ending = try sandbox.runShell(script, &arguments);
    try testing.expectEqual(0, ending.exit_code);
    try testing.expectEqualSlices(u8, "P6\n1 1\n255\n\x00\x00\x00", try sandbox.read("a.ppm"));
}

test "--max-memory is kept to in every stage, or is an error in one line" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.write("empty.gltf", empty_scene);
    // Memory runs out while a scene is read, while it is prepared, before the picture, after it.
    for ([_]struct { []const u8, []const u8, []const []const u8, []const u8 }{
        .{ "builtin:atrium", "-r64x64", &.{ "1", "300K", "1M", "4M", "8M", "14M" }, "256M" },
        .{ "empty.gltf", "-r1024x1024", &.{ "1M", "16M", "18M", "21M", "23M" }, "64M" },
    }) |case| {
        const arguments = [_][]const u8{
            case[0], case[1], "--env=none", "-t2", "-q", "-o", "a.png",
        };
        for (case[2]) |limit| {
            errdefer std.debug.print("{s} {s}\n", .{ case[0], limit });
            const ending = try sandbox.expectExit(1, &(arguments ++ .{ "--max-memory", limit }));
            try expectOneErrorLine(ending);
            const count = std.mem.trimEnd(u8, limit, "KM");
            const unit = limit[count.len..];
            const expected = try sandbox.arena_state.allocator().print("than the {s} {s}{s} of", .{
                count, unit, if (unit.len == 0) "bytes" else "iB",
            });
            try testing.expect(std.mem.find(u8, ending.stderr, expected) != null);
            try sandbox.expectFiles(&.{"empty.gltf"});
        }
        _ = try sandbox.expectExit(0, &(arguments ++ .{ "--max-memory", case[3] }));
        const within = try sandbox.read("a.png");
        _ = try sandbox.expectExit(0, &arguments);
        try testing.expectEqualSlices(u8, try sandbox.read("a.png"), within);
        try sandbox.folder.dir.deleteFile(io, "a.png");
    }
    const arguments = [_][]const u8{ "empty.gltf", "-r1024x1024", "--env=none", "-q" };
    const before = try sandbox.run(&(arguments ++ .{"--max-memory=8M"}));
    try testing.expect(std.mem.find(u8, before.stderr, ", 16 MiB more asked for)") != null);
    const after = try sandbox.run(&(arguments ++ .{"--max-memory=18900K"}));
    try testing.expect(std.mem.find(u8, after.stderr, ", 3 MiB more asked for)") != null);
}

test "what a file asks for is refused before the work, in a line that names the option" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const film = "Camera \"perspective\" Film \"image\" \"integer xresolution\" 16384 " ++
        "\"integer yresolution\" ";
    const world = " WorldBegin Shape \"sphere\" Shape \"sphere\" WorldEnd";
    try sandbox.write("pixels.pbrt", film ++ "16384" ++ world);
    const samples = "Sampler \"halton\" \"integer pixelsamples\" 4096 ";
    try sandbox.write("samples.pbrt", samples ++ film ++ "4096" ++ world);
    try sandbox.write("levels.pbrt", "WorldBegin Shape \"loopsubdiv\" \"integer levels\" 8 " ++
        "\"point P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 2] WorldEnd");
    for ([_]struct { []const []const u8, []const u8 }{
        .{ &.{"pixels.pbrt"}, "raylane: pixels.pbrt: a picture of 16384x16384 is asked for, of " ++
            "more than 67108864 pixels (see --max-pixels and -r)\n" },
        .{ &.{"samples.pbrt"}, "raylane: samples.pbrt: it wants 4096 samples of each of " ++
            "16384x4096 pixels, over 8589934592 in all (see --spp and -r)\n" },
        .{
            &.{ "pixels.pbrt", "-r16x8", "--max-pixels=100" },
            "raylane: pixels.pbrt: a picture of 16x8 is asked for, of more than 100 pixels (see " ++
                "--max-pixels and -r)\n",
        },
        .{
            &.{ "samples.pbrt", "-r16", "--spp=1", "--max-pixels=60" },
            "raylane: samples.pbrt: a picture of 16x4 is asked for, of more than 60 pixels (see " ++
                "--max-pixels and -r)\n",
        },
        .{
            &.{ "pixels.pbrt", "--max-triangles=3K" },
            "raylane: pixels.pbrt:1:117: shapes so far have over 3000 triangles (see " ++
                "--max-triangles)\n",
        },
        .{
            &.{ "levels.pbrt", "--max-triangles=65535" },
            "raylane: levels.pbrt:1:12: loopsubdiv: it becomes 65536 triangles, over 65535 with " ++
                "those before it (see --max-triangles)\n",
        },
    }) |case| {
        const arguments = try std.mem.concat(
            sandbox.arena_state.allocator(),
            []const u8,
            &.{ case[0], &.{ "-o", "a.ppm" } },
        );
        const ending = try sandbox.expectExit(3, arguments);
        try testing.expectEqualStrings(case[1], ending.stderr);
        try sandbox.expectFiles(&.{ "levels.pbrt", "pixels.pbrt", "samples.pbrt" });
    }
    _ = try sandbox.expectExit(0, &.{
        "samples.pbrt",    "-r8x4", "--spp=1", "--max-triangles=4K",
        "--max-pixels=32", "-o",    "a.ppm",
    });
}

test "--max-time ends what takes longer, whole or not at all" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.write("a.ppm", "before");
    const arguments = [_][]const u8{
        "builtin:cornell", "-r4096x4096", "--spp=4096", "-t1", "-q", "-oa.ppm", "--max-time",
    };
    const ending = try sandbox.expectExit(124, &(arguments ++ .{"0.2"}));
    try testing.expectEqualStrings(
        "raylane: builtin:cornell: takes longer than the 0.2 s of --max-time\n",
        ending.stderr,
    );
    try testing.expectEqualStrings("before", try sandbox.read("a.ppm"));
    try sandbox.expectFiles(&.{"a.ppm"});
    _ = try sandbox.expectExit(2, &(arguments ++ .{"0"}));
}

test "info keeps to --max-time, --max-memory and --max-triangles" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const waiting = "mkfifo p && { sleep 3 >p 2>&1 & } && exec \"$@\"";
    const late = try sandbox.runShell(waiting, &.{ "info", "p", "--json", "--max-time=0.2" });
    try testing.expectEqual(124, late.exit_code);
    const line = "raylane: p: takes longer than the 0.2 s of --max-time\n";
    try testing.expectEqualStrings(line, late.stderr);
    try testing.expect(std.mem.find(u8, late.stdout, "\"exit_code\":124") != null);
    try sandbox.write("s.pbrt", "WorldBegin Shape \"sphere\"");
    for ([_]struct { u8, []const u8 }{
        .{ 1, "--max-memory=1K" },
        .{ 3, "--max-triangles=5" },
    }) |case| {
        const exit_code, const option = case;
        const ending = try sandbox.expectExit(exit_code, &.{ "info", "s.pbrt", option });
        try expectOneErrorLine(ending);
        const name = std.mem.sliceTo(option, '=');
        try testing.expect(std.mem.find(u8, ending.stderr, name) != null);
    }
}

test "exhausted memory is an error in one line" {
    // An emulator needs the address space itself.
    if (testing.environ.getPosix("RAYLANE_EMULATOR") != null) return error.SkipZigTest;
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    // 16 bytes a pixel: 256 MiB for the picture alone.
    const ending = try sandbox.runShell("ulimit -v 200000; exec \"$@\"", &.{
        "builtin:cornell", "-r4096x4096", "-t1",
    });
    try testing.expectEqual(1, ending.exit_code);
    try expectOneErrorLine(ending);
    try testing.expect(std.mem.find(u8, ending.stderr, "out of memory") != null);
    try sandbox.expectEmpty();
}

test "a small stack is enough for every command" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    // An emulator needs the limit for itself, and has another for the program.
    const script = if (testing.environ.getPosix("RAYLANE_EMULATOR") != null)
        "QEMU_STACK_SIZE=262144 exec \"$@\" <job"
    else
        "ulimit -s 256; exec \"$@\" <job";
    try sandbox.write("empty.gltf", empty_scene);
    try sandbox.write("s.pbrt", pbrt_scene);
    const job = "{\"input\":\"builtin:cornell\",\"output\":\"b.png\",\"resolution\":[8,8]," ++
        "\"spp\":1,\"env\":\"none\"}";
    try sandbox.write("job", job);
    const variant = try firstVariant(&sandbox);
    const small = [_][]const u8{ "-r8x8", "--spp=1", "-q" };
    for ([_][]const []const u8{
        &.{"--help"},
        &.{"--list-variants"},
        &.{ "empty.gltf", "-r1x1" },
        // Mirrors, glass and shadows through it, by the caller's thread and by another.
        &.{ "builtin:cornell", "-r64x64", "-t1", "--bvh=high", "--count-tests" },
        &.{ "builtin:cornell", "-r64x64", "-t2" },
        &.{ "builtin:atrium", "-r8x8" },
        &(.{ "builtin:cornell", "--integrator=path", "--denoise", dark } ++ small),
        &(.{ "builtin:cornell", "--integrator=lights", dark } ++ small),
        &(.{ "builtin:cornell", "s.pbrt", "empty.gltf", dark, "--turntable=2" } ++ small),
        &.{ "--scenario", job },
        &.{"serve"},
        &.{ "info", "builtin:cornell", "-q" },
        &(.{ "builtin:cornell", "--tile=1/1", "-ocornell.exr", dark } ++ small),
        &.{ "merge", "cornell.exr", "-omerged.png" },
        &.{ "compare", "b.png", "merged.png" },
        &.{ "bench", "builtin:cornell", "-r16x16", "-q", "--no-energy", "--rounds=2", variant },
    }) |arguments| {
        const ending = try sandbox.runShell(script, arguments);
        errdefer std.debug.print("{s} {s}: {s}\n", .{
            arguments[0], if (arguments.len > 1) arguments[1] else "", ending.stderr,
        });
        try testing.expectEqual(0, ending.exit_code);
    }
}

test "few descriptors are enough, or an error in one line" {
    // An emulator needs some itself.
    if (testing.environ.getPosix("RAYLANE_EMULATOR") != null) return error.SkipZigTest;
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.write("s.glb", try triangleScene(sandbox.arena_state.allocator()));
    const arguments = [_][]const u8{ "s.glb", dark, "-r4x4", "--spp=1", "-q", "-oa.png" };
    // Beyond the standard three: none, two, and what is enough.
    for ([_][]const u8{ "3", "5", "10" }, [_]u8{ 1, 1, 0 }) |limit, exit_code| {
        errdefer std.debug.print("{s}\n", .{limit});
        const script = try sandbox.arena_state.allocator().print(
            "ulimit -n {s}; exec \"$@\"",
            .{limit},
        );
        const ending = try sandbox.runShell(script, &arguments);
        try testing.expectEqual(exit_code, ending.exit_code);
        if (exit_code == 0) continue;
        try expectOneErrorLine(ending);
        try sandbox.expectFiles(&.{"s.glb"});
    }
    try sandbox.expectFiles(&.{ "a.png", "s.glb" });
}

test "a file that ends before its size does is an error, or a texture less" {
    // The system says 4096 bytes, and has fewer.
    const short = "/sys/devices/system/cpu/online";
    Io.Dir.cwd().access(io, short, .{}) catch return error.SkipZigTest;
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.folder.dir.symLink(io, short, "short", .{});
    try sandbox.write("s.gltf",
        \\{"asset":{"version":"2.0"},"buffers":[{"byteLength":12,"uri":"short"}],
        \\"bufferViews":[{"buffer":0,"byteLength":12}],"accessors":[{"bufferView":0,"count":1,
        \\"componentType":5126,"type":"VEC3"}],"meshes":[{"primitives":[{"mode":0,
        \\"attributes":{"POSITION":0}}]}],"nodes":[{"mesh":0}],"scenes":[{"nodes":[0]}],"scene":0}
    );
    try sandbox.write("t.pbrt", pbrt_scene ++
        "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"short\"\n" ++
        "Material \"matte\" \"texture Kd\" \"t\"\nShape \"sphere\"\n");
    const options = [_][]const u8{ "--allow-outside", dark, "-r4x4", "--spp=1", "-oa.png" };
    for ([_][]const u8{ short, "s.gltf" }) |scene| {
        const ending = try sandbox.expectExit(1, &(.{scene} ++ options));
        try expectOneErrorLine(ending);
        try testing.expectStringEndsWith(ending.stderr, "changed while it was read\n");
    }
    const textured = try sandbox.expectExit(0, &(.{"t.pbrt"} ++ options));
    try testing.expect(std.mem.find(u8, textured.stderr, "changed while it was read") != null);
}

/// Starts a render that does not end by itself, by a script as `runShell` takes it, and waits until
/// the sandbox holds `file_count` files: its unfinished one shows that it is under way.
fn startLong(sandbox: *Sandbox, script: []const u8, file_count: usize) !std.process.Child {
    var child = try std.process.spawn(io, .{
        .argv = try sandbox.shellCommand(script, &.{
            "builtin:cornell", "-r512x512", "--spp=4096", "-t2", "-oa.png",
        }),
        .cwd = .{ .dir = sandbox.folder.dir },
        .stdin = .ignore,
        .stdout = .ignore,
        .stderr = .ignore,
    });
    errdefer child.kill(io);
    for (0..2000) |_| {
        if ((try sandbox.names()).len == file_count) return child;
        try io.sleep(.fromMilliseconds(10), .awake);
    }
    return error.NotStarted;
}

/// Sends the signals and expects that the program exits with 128 and the number of `last`.
fn expectEndedBy(
    child: *std.process.Child,
    earlier: []const std.posix.SIG,
    last: std.posix.SIG,
) !void {
    errdefer child.kill(io);
    for (earlier) |signal| try std.posix.kill(child.id.?, signal);
    try std.posix.kill(child.id.?, last);
    const term = try child.wait(io);
    const exit_code: u8 = @intCast(128 + @backingInt(last));
    try testing.expectEqual(std.process.Child.Term{ .exited = exit_code }, term);
}

test "signals end a long render and leave nothing behind" {
    // While the scene is read, the tree is built, the picture traced, in some order.
    for ([_]std.posix.SIG{ .HUP, .INT, .QUIT, .TERM, .XCPU }, 0..) |signal, index| {
        errdefer std.debug.print("{t}\n", .{signal});
        var sandbox: Sandbox = .init();
        defer sandbox.deinit();
        var child = try startLong(&sandbox, "exec \"$@\"", 1);
        if (index > 0) try io.sleep(.fromMilliseconds(@intCast(20 * index * index)), .awake);
        try expectEndedBy(&child, &.{}, signal);
        try sandbox.expectEmpty();
    }
}

test "a signal has the picture so far written where that is asked for" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    var child = try startLong(&sandbox, "exec \"$@\" -r24x16 --partial --progress=json 2>log", 2);
    errdefer child.kill(io);
    for (0..2000) |_| {
        const log = try sandbox.folder.dir.readFileAlloc(io, "log", testing.allocator, .unlimited);
        defer testing.allocator.free(log);
        // Before there is a frame to trace, a signal ends the program at once.
        if (std.mem.find(u8, log, "\"stage\":\"tracing\"") != null) break;
        try io.sleep(.fromMilliseconds(10), .awake);
    } else return error.NotStarted;
    try expectEndedBy(&child, &.{}, .INT);
    const gpa = testing.allocator;
    const log = try sandbox.folder.dir.readFileAlloc(io, "log", gpa, .unlimited);
    defer gpa.free(log);
    const needle = "raylane: interrupted: a.png written with ";
    try testing.expect(std.mem.find(u8, log, needle) != null);
    try testing.expectStringEndsWith(log, " of 4096 samples\n");
    const picture = try sandbox.folder.dir.readFileAlloc(io, "a.png", gpa, .unlimited);
    defer gpa.free(picture);
    try testing.expectEqualStrings("IEND", picture[picture.len - 8 ..][0..4]);
    try testing.expectEqual(2, (try sandbox.names()).len);
}

test "the limit of CPU time ends a render like a signal" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const ending = try sandbox.runShell("ulimit -S -t 1; exec \"$@\"", &.{
        "builtin:cornell", "-r512x512", "--spp=4096",
    });
    try testing.expectEqual(152, ending.exit_code);
    const said = "raylane: out of CPU time: cornell.png not written\n";
    try testing.expectEqualStrings(said, ending.stderr);
    try sandbox.expectEmpty();
}

test "progress for programs is one JSON object a line, and nothing of it is anywhere else" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const ending = try sandbox.runShell("exec \"$@\" 3>log", &.{
        "builtin:cornell", "-r16x16", "--spp=1", "-oa.png", "-t2", "--stats=none",
        "--progress-fd=3",
    });
    try testing.expectEqual(0, ending.exit_code);
    try testing.expectEqualStrings("", ending.stderr);
    try testing.expectEqualStrings("", ending.stdout);
    const gpa = testing.allocator;
    const log = try sandbox.folder.dir.readFileAlloc(io, "log", gpa, .unlimited);
    defer gpa.free(log);
    const Told = struct { stage: []const u8, file: []const u8, index: u32, elapsed_s: f64 };
    var lines = std.mem.tokenizeScalar(u8, log, '\n');
    // Others stand between them where the machine is slow.
    for ([_][]const u8{
        "reading", "textures", "tree", "view", "tracing", "writing", "done",
    }) |stage| {
        while (lines.next()) |line| {
            const told = try std.json.parseFromSlice(Told, gpa, line, .{
                .ignore_unknown_fields = true,
            });
            defer told.deinit();
            try testing.expectEqualStrings("builtin:cornell", told.value.file);
            try testing.expectEqual(1, told.value.index);
            if (std.mem.eql(u8, told.value.stage, stage)) break;
        } else {
            std.debug.print("{s} is not told of\n", .{stage});
            return error.NotTold;
        }
    }
    try testing.expectEqual(null, lines.next());
}

/// Completes words in bash, as it calls the function of a script. 77: there is no bash.
const complete_script =
    \\command -v bash >/dev/null || exit 77
    \\"$@" completion bash >script || exit 1
    \\exec bash -c '. ./script
    \\t() { COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _raylane; echo "${COMPREPLY[@]}"; }
    \\t raylane --tonem
    \\t raylane a.glb --tonemap = ag
    \\t raylane --up-axis ""
    \\t raylane my
    \\t raylane compa
    \\t raylane compare --thre
    \\t raylane completion ""
    \\t raylane --spp ""
    \\'
;

test "bash completes options, their words, files and commands" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.write("my model.glb", "");
    const ending = try sandbox.runShell(complete_script, &.{});
    if (ending.exit_code == 77) return error.SkipZigTest;
    errdefer std.debug.print("{s}", .{ending.stderr});
    try testing.expectEqual(0, ending.exit_code);
    try testing.expectEqualStrings(
        "--tonemap\nagx\ny z\nmy model.glb\ncompare\n--threshold\nbash zsh fish\n\n",
        ending.stdout,
    );
    try testing.expectEqualStrings("", ending.stderr);
}

test "scripts for shells and the manual are what their programs read" {
    var any = false;
    for ([_]struct { []const u8, []const u8 }{
        .{ "zsh", "\"$@\" completion zsh >script && zsh -n script" },
        .{ "fish", "\"$@\" completion fish >script && fish -n script" },
        .{ "groff", "\"$@\" man >raylane.1 && groff -man -ww -Tutf8 raylane.1 >/dev/null" },
    }) |case| {
        var sandbox: Sandbox = .init();
        defer sandbox.deinit();
        const reader, const script = case;
        const arena = sandbox.arena_state.allocator();
        const known = try arena.print("command -v {s} >/dev/null || exit 77; {s}", .{
            reader, script,
        });
        const ending = try sandbox.runShell(known, &.{});
        if (ending.exit_code == 77) continue;
        any = true;
        errdefer std.debug.print("{s}: {s}", .{ reader, ending.stderr });
        try testing.expectEqual(0, ending.exit_code);
        try testing.expectEqualStrings("", ending.stderr);
    }
    if (!any) return error.SkipZigTest;
}

test "signals that are ignored at the start stay so" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    var child = try startLong(&sandbox, "trap '' HUP INT QUIT; exec \"$@\"", 1);
    try expectEndedBy(&child, &.{ .HUP, .INT, .QUIT }, .TERM);
    try sandbox.expectEmpty();
}

test "a killed run's leftover goes with the next one, nobody else's does" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    var living = try startLong(&sandbox, "exec \"$@\"", 1);
    const living_name = (try sandbox.names())[0];
    var killed = startLong(&sandbox, "exec \"$@\"", 2) catch |err| {
        living.kill(io);
        return err;
    };
    try std.posix.kill(killed.id.?, .KILL);
    _ = try killed.wait(io);
    const both = try sandbox.names();
    try testing.expectEqual(2, both.len);
    const leftover = both[@intFromBool(std.mem.eql(u8, both[0], living_name))];

    // The same from another machine, whose processes and locks are not to be seen from here.
    const mark = ".raylane-";
    const host = std.mem.find(u8, leftover, mark) orelse return error.NotItsName;
    const foreign = try sandbox.arena_state.allocator().dupe(u8, leftover);
    const digit = &foreign[host + mark.len];
    digit.* = if (digit.* == '0') '1' else '0';
    try sandbox.write(foreign, "");

    _ = try sandbox.expectExit(0, &.{ "builtin:cornell", "-r8x8", "-q", "-ob.png" });
    try sandbox.expectFiles(&.{ living_name, foreign, "b.png" });
    try expectEndedBy(&living, &.{}, .TERM);
    try sandbox.expectFiles(&.{ foreign, "b.png" });
}

test "a file keeps its permissions, a link its place, a new file those of the process" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const folder = sandbox.folder.dir;
    const script = "umask 027; : >old.png; chmod 604 old.png; mkdir d; " ++
        "ln -s ../old.png d/link.png; ln -s new.png dangling.png; exec \"$@\"";
    const arguments = [_][]const u8{ "builtin:cornell", "-r8x8", "-q", "-o" };
    const through = try sandbox.runShell(script, &(arguments ++ .{"d/link.png"}));
    try testing.expectEqual(0, through.exit_code);
    const dangling = try sandbox.runShell("umask 027; exec \"$@\"", &(arguments ++
        .{"dangling.png"}));
    try testing.expectEqual(0, dangling.exit_code);
    try sandbox.expectFiles(&.{ "old.png", "new.png", "d", "dangling.png" });
    for ([_]struct { []const u8, u32 }{ .{ "old.png", 0o604 }, .{ "new.png", 0o640 } }) |case| {
        const stat = try folder.statFile(io, case[0], .{ .follow_symlinks = false });
        try testing.expectEqual(.file, stat.kind);
        try testing.expectEqual(case[1], stat.permissions.toMode() & 0o7777);
        try testing.expectStringStartsWith(try sandbox.read(case[0]), "\x89PNG");
    }
    const link = try folder.statFile(io, "d/link.png", .{ .follow_symlinks = false });
    try testing.expectEqual(.sym_link, link.kind);
}

test "what is protected against writing is not replaced, but overwritten in a protected folder" {
    if (std.posix.system.geteuid() == 0) return error.SkipZigTest; // Nothing is forbidden to root.
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const arguments = [_][]const u8{ "builtin:cornell", "-r8x8", "-q", "-od/a.ppm" };
    const protect = "mkdir d; : >d/a.ppm; chmod 444 d/a.ppm; exec \"$@\"";
    const file = try sandbox.runShell(protect, &arguments);
    try testing.expectEqual(1, file.exit_code);
    try expectOneErrorLine(file);
    try testing.expectEqual(0, (try sandbox.read("d/a.ppm")).len);
    const folder = try sandbox.runShell("chmod 644 d/a.ppm; head -c 999 /dev/zero >d/a.ppm; " ++
        "chmod 555 d; \"$@\"; code=$?; chmod 755 d; exit $code", &arguments);
    try testing.expectEqual(0, folder.exit_code);
    const ppm = try sandbox.read("d/a.ppm");
    try testing.expectStringStartsWith(ppm, "P6\n8 8\n255\n");
    try testing.expectEqual(11 + 8 * 8 * 3, ppm.len);
}

test "descriptors, pipes and devices take the picture where they stand" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const arguments = [_][]const u8{ "builtin:cornell", dark, "-r8x8", "--format=ppm", "-o" };
    const expected = (try sandbox.expectExit(0, &(arguments ++ .{"-"}))).stdout;
    // Without a report behind it.
    const stdout = try sandbox.expectExit(0, &(arguments ++ .{"/dev/stdout"}));
    try testing.expectEqualSlices(u8, expected, stdout.stdout);
    for ([_]struct { []const u8, []const u8 }{
        .{ "/dev/fd/7", "exec \"$@\" 7>>got" },
        .{ "link", "ln -s /dev/fd/7 link; exec \"$@\" 7>>got" },
        .{ "pipe", "mkfifo pipe; cat pipe >>got & \"$@\"; code=$?; wait; exit $code" },
        .{ "/dev/null", "exec \"$@\"" },
    }) |case| {
        errdefer std.debug.print("{s}\n", .{case[0]});
        try sandbox.write("got", "before");
        const ending = try sandbox.runShell(case[1], &(arguments ++ .{ case[0], "-q" }));
        try testing.expectEqualStrings("", ending.stderr);
        try testing.expectEqual(0, ending.exit_code);
        const got = try sandbox.read("got");
        try testing.expectStringStartsWith(got, "before");
        const is_lost = std.mem.eql(u8, case[0], "/dev/null");
        try testing.expectEqualSlices(u8, if (is_lost) "" else expected, got["before".len..]);
    }
    try sandbox.expectFiles(&.{ "got", "link", "pipe" });
}

test "an output over its own input is refused" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const folder = sandbox.folder.dir;
    const gltf =
        \\{"asset":{"version":"2.0"},"buffers":[{"byteLength":4,"uri":"b.bin"}]}
    ;
    try sandbox.write("s.gltf", gltf);
    try sandbox.write("b.bin", "1234");
    try folder.hardLink("b.bin", folder, "hard.png", io, .{});
    try folder.symLink(io, "s.gltf", "soft.png", .{});
    try sandbox.write("s.pbrt", "WorldBegin\nInclude \"in.pbrt\"\n");
    try sandbox.write("in.pbrt", "Shape \"sphere\"\n");
    for ([_][]const []const u8{
        &.{ "s.gltf", "--format=png", "-os.gltf" },
        &.{ "s.gltf", "-osoft.png" },
        &.{ "s.gltf", "-ohard.png" },
        &.{ "s.pbrt", "--format=pfm", "-o./s.pbrt" },
        &.{ "s.pbrt", "--format=png", "-oin.pbrt" },
        &.{ "bench", "-q", "--json=b.bin", "s.gltf" },
    }) |arguments| {
        const ending = try sandbox.expectExit(1, arguments);
        try expectOneErrorLine(ending);
        const reason = "would be overwritten by the output\n";
        try testing.expectStringEndsWith(ending.stderr, reason);
    }
    try testing.expectEqualStrings(gltf, try sandbox.read("s.gltf"));
    try testing.expectEqualStrings("1234", try sandbox.read("b.bin"));
    try sandbox.expectFiles(&.{ "b.bin", "hard.png", "in.pbrt", "s.gltf", "s.pbrt", "soft.png" });
}

test "a report that is lost spoils the picture only where it was asked for" {
    const arguments = [_][]const u8{ "builtin:cornell", dark, "-r8x8", "-oa.png" };
    for ([_][]const u8{ "exec \"$@\" >/dev/full", "exec \"$@\" >&-" }) |script| {
        var sandbox: Sandbox = .init();
        defer sandbox.deinit();
        const plain = try sandbox.runShell(script, &arguments);
        try testing.expectEqual(0, plain.exit_code);
        try expectOneErrorLine(plain);
        try testing.expectStringStartsWith(plain.stderr, "raylane: warning: ");
        try testing.expectStringStartsWith(try sandbox.read("a.png"), "\x89PNG");
        for ([_][]const u8{ "--stats=json", "--stats=text" }) |stats| {
            try sandbox.write("a.png", "old");
            const asked = try sandbox.runShell(script, &(arguments ++ .{stats}));
            try testing.expectEqual(1, asked.exit_code);
            try expectOneErrorLine(asked);
            try testing.expectStringStartsWith(try sandbox.read("a.png"), "\x89PNG");
        }
        try sandbox.expectFiles(&.{"a.png"});
    }
}

test "the peak of memory is that of the program, not of its launcher" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const launcher = try std.heap.page_allocator.alloc(u8, 256 << 20);
    defer std.heap.page_allocator.free(launcher);
    @memset(launcher, 1);
    const ending = try sandbox.expectExit(0, &.{ "builtin:cornell", "-r8x8", "--stats=json" });
    const stats = try statsOf(&sandbox, ending.stdout);
    try testing.expect(stats.memory_peak_bytes < launcher.len);
}

/// The part of the benchmark's JSON that these tests look at.
const BenchResults = struct {
    format: []const u8,
    machine: struct { processor: []const u8, processor_count: usize },
    build: struct { zig: []const u8, cpu_features: []const []const u8 },
    reference: []const u8,
    energy: struct {
        source: ?[]const u8,
        reason: ?[]const u8,
        idle_w: ?f64,
        readings: u64,
    },
    scenes: []const struct {
        scene: []const u8,
        image_hash: []const u8,
        rounds: usize,
        variants: []const struct {
            name: []const u8,
            tests: struct { box_issued: u64 },
            trace_ms: []const f64,
            energy: ?struct { trace_gross_j: []const f64, trace_s: []const f64 },
        },
    },
    scaling: []const struct { threads: usize, trace_ms: []const f64 },
};

fn benchResultsOf(sandbox: *Sandbox, json: []const u8) !BenchResults {
    const arena = sandbox.arena_state.allocator();
    return std.json.parseFromSliceLeaky(BenchResults, arena, json, .{
        .ignore_unknown_fields = true,
    });
}

const small_bench = [_][]const u8{
    "bench", "-r16x16", "-t2", "--rounds=2", "--time-limit=600", "-q", "builtin:cornell",
};

/// The argument that measures one variant alone, whichever the program holds.
fn firstVariant(sandbox: *Sandbox) ![]const u8 {
    const listed = try sandbox.expectExit(0, &.{"--list-variants"});
    const name = std.mem.sliceTo(listed.stdout, '\n');
    return sandbox.arena_state.allocator().print("--variants={s}", .{name});
}

test "the benchmark measures every variant, prints tables and keeps the samples" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const ending = try sandbox.expectExit(0, &(small_bench ++ .{ "--no-energy", "--json=b.json" }));
    try testing.expectEqualStrings("", ending.stderr);
    try sandbox.expectFiles(&.{"b.json"});
    const results = try benchResultsOf(&sandbox, try sandbox.read("b.json"));
    try testing.expectEqualStrings("raylane-bench-1", results.format);
    try testing.expectEqual(null, results.energy.source);
    try testing.expectEqual(1, results.scenes.len);
    const listed = try sandbox.expectExit(0, &.{"--list-variants"});
    const scene = &results.scenes[0];
    try testing.expectEqual(std.mem.countScalar(u8, listed.stdout, '\n'), scene.variants.len);
    for (scene.variants) |*variant| {
        try testing.expectEqual(2, variant.trace_ms.len);
        try testing.expect(variant.trace_ms[0] > 0 and variant.tests.box_issued > 0);
        try testing.expect(std.mem.find(u8, listed.stdout, variant.name) != null);
        try testing.expect(std.mem.find(u8, ending.stdout, variant.name) != null);
    }
    try testing.expectEqual(2, results.scaling[1].threads);
    for ([_][]const u8{
        "5.1", "5.2", "5.3", "5.4", "5.5", "C.1", "C.4", "C.5", "C.6", "C.8", scene.image_hash,
    }) |word| {
        errdefer std.debug.print("{s}\n", .{word});
        try testing.expect(std.mem.find(u8, ending.stdout, word) != null);
    }
    // The image is the one that rendering makes.
    const rendered = try sandbox.expectExit(0, &.{
        "builtin:cornell", "--thesis", "-r16x16", "--stats=json",
    });
    const stats = try statsOf(&sandbox, rendered.stdout);
    try testing.expectEqualStrings(stats.image_hash, scene.image_hash);
}

test "the benchmark measures energy by the files that it is shown" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const folder = sandbox.folder.dir;
    try folder.createDirPath(io, "sys/class/hwmon/hwmon0");
    try sandbox.write("sys/class/hwmon/hwmon0/name", "ina226\n");
    try sandbox.write("sys/class/hwmon/hwmon0/power1_input", "5250000\n");
    const one_variant = small_bench ++ .{ try firstVariant(&sandbox), "--json=-" };
    const ending = try sandbox.expectExit(0, &(one_variant ++ .{"--energy-root=sys"}));
    const results = try benchResultsOf(&sandbox, ending.stdout);
    try testing.expectEqualStrings("hwmon", results.energy.source.?);
    try testing.expectApproxEqRel(5.25, results.energy.idle_w.?, 0.01);
    const joules = results.scenes[0].variants[0].energy.?;
    for (joules.trace_gross_j, joules.trace_s) |energy_j, duration_s| {
        try testing.expectApproxEqRel(5.25 * duration_s, energy_j, 0.01);
    }

    try sandbox.write("sys/class/hwmon/hwmon0/power1_input", "garbage\n");
    const broken = try sandbox.expectExit(0, &(one_variant ++ .{"--energy-root=sys"}));
    const without = try benchResultsOf(&sandbox, broken.stdout);
    try testing.expectEqual(null, without.energy.source);
    try testing.expect(std.mem.find(u8, without.energy.reason.?, "not a number") != null);

    const command = try sandbox.expectExit(0, &(one_variant ++ .{"--energy-command=echo 7 W"}));
    const commanded = try benchResultsOf(&sandbox, command.stdout);
    try testing.expectEqualStrings("command", commanded.energy.source.?);
}

test "a source of energy that disappears half way is said to be lost" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    // Each reading removes one file of ten; without any the command fails.
    try sandbox.folder.dir.createDir(io, "left", .default_dir);
    for (0..10) |index| {
        var name: [8]u8 = undefined;
        try sandbox.write(try std.fmt.bufPrint(&name, "left/{d}", .{index}), "");
    }
    const ending = try sandbox.expectExit(0, &(small_bench ++ .{
        try firstVariant(&sandbox),
        "--energy-command=f=$(ls left | head -n 1); test -n \"$f\" && rm left/$f && echo 3 W",
    }));
    try testing.expect(std.mem.find(u8, ending.stdout, "\nLost: ") != null);
    try testing.expect(std.mem.find(u8, ending.stdout, "Render time") != null);
}

test "mistakes in what to measure are said before anything is measured" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const Case = struct { u8, []const []const u8 };
    for ([_]Case{
        .{ 2, &.{ "bench", "--rounds=0" } },
        .{ 2, &.{ "bench", "-q", "--variants=neon" } },
        .{ 3, &.{ "bench", "-q", "builtin:absent" } },
        .{ 1, &.{ "bench", "-q", "absent.glb" } },
        .{ 1, &.{ "bench", "-q", "--json=absent/b.json" } },
    }) |case| {
        const ending = try sandbox.expectExit(case[0], case[1]);
        try expectOneErrorLine(ending);
        try sandbox.expectEmpty();
    }
    try sandbox.write("bad.pbrt", "WorldBegin\n  Frobnicate\n");
    const bad = try sandbox.expectExit(3, &.{ "bench", "-q", "bad.pbrt" });
    try testing.expectStringStartsWith(bad.stderr, "raylane: bad.pbrt:2:3: ");
    const help = try sandbox.expectExit(0, &.{ "bench", "--help" });
    try testing.expect(std.mem.countScalar(u8, help.stdout, '\n') <= 60);
}

test "info: text, JSON, and the line that rendering ends with" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const text = try sandbox.expectExit(0, &.{ "info", "builtin:cornell" });
    try testing.expectStringStartsWith(
        text.stdout,
        "file         builtin:cornell\nformat       built in\n",
    );
    try testing.expectEqualStrings("", text.stderr);
    const document = "{\"asset\":{\"version\":\"2.0\"},\"extensionsUsed\":[\"A_b\"]," ++
        "\"buffers\":[{\"byteLength\":3,\"uri\":\"b%20c.bin\"}]}";
    try sandbox.write("a.gltf", document);
    try sandbox.write("b c.bin", "four");
    const json = try sandbox.expectExit(0, &.{ "info", "a.gltf", "--json" });
    const found = try std.json.parseFromSliceLeaky(
        struct {
            file: []const u8,
            bytes: u64,
            files: []const struct { path: []const u8, bytes: u64 },
            warnings: []const []const u8,
        },
        sandbox.arena_state.allocator(),
        json.stdout,
        .{ .ignore_unknown_fields = true },
    );
    try testing.expectEqualStrings("a.gltf", found.file);
    try testing.expectEqual(document.len + 4, found.bytes);
    try testing.expectEqual(2, found.files.len);
    try testing.expectEqualStrings("a.gltf", found.files[0].path);
    try testing.expectEqual(document.len, found.files[0].bytes);
    try testing.expectEqualStrings("b c.bin", found.files[1].path);
    try testing.expectEqual(4, found.files[1].bytes);
    try testing.expectEqual(2, found.warnings.len);
    try testing.expectStringStartsWith(
        json.stderr,
        "raylane: a.gltf: warning: not rendered: the extensions 'A_b'\n",
    );
    const absent = try sandbox.expectExit(1, &.{ "info", "b.gltf" });
    try testing.expectEqualStrings("raylane: b.gltf: does not exist\n", absent.stderr);
    _ = try sandbox.expectExit(2, &.{ "info", "a.gltf", "--scene=7" });
    try sandbox.expectFiles(&.{ "a.gltf", "b c.bin" });
}

test "compare: figures, a map, thresholds, and images that cannot be compared" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try sandbox.write("a.ppm", "P6 2 1 255 " ++ .{ 0, 100, 200, 7, 8, 9 });
    try sandbox.write("b.ppm", "P6 2 1 255 " ++ .{ 0, 100, 251, 7, 8, 9 });
    try sandbox.write("c.ppm", "P6 1 1 255 abc");
    const same = try sandbox.expectExit(0, &.{ "compare", "a.ppm", "a.ppm", "--threshold=max=0" });
    try testing.expectEqualStrings(
        "max   0.0000\nRMSE  0.00000\nPSNR  inf dB\nSSIM  1.00000\nFLIP  0.00000\n",
        same.stdout,
    );
    const far = try sandbox.expectExit(4, &.{
        "compare", "a.ppm", "b.ppm", "--threshold=max=0.1", "--threshold=psnr=1", "--stats=json",
        "-om.png",
    });
    const found = try std.json.parseFromSliceLeaky(
        struct { format: []const u8, width: u32, max: f64, rmse: f64, flip: f64 },
        sandbox.arena_state.allocator(),
        far.stdout,
        .{ .ignore_unknown_fields = true },
    );
    try testing.expectEqualStrings("raylane-compare-1", found.format);
    try testing.expectApproxEqAbs(0.2, found.max, 1e-6);
    try testing.expectApproxEqAbs(0.2 / @sqrt(6.0), found.rmse, 1e-6);
    try testing.expect(found.flip > 0);
    try testing.expectEqualStrings(
        "raylane: b.ppm: max is 0.20000, the threshold 0.1\n",
        far.stderr,
    );
    try testing.expectStringStartsWith(try sandbox.read("m.png"), "\x89PNG");
    const sizes = try sandbox.expectExit(3, &.{ "compare", "a.ppm", "c.ppm" });
    try testing.expectEqualStrings(
        "raylane: c.ppm: 1x1 pixels, where a.ppm has 2x1\n",
        sizes.stderr,
    );
    try sandbox.write("d.ppm", "P6 1 1 255 ab");
    const broken = try sandbox.expectExit(3, &.{ "compare", "d.ppm", "c.ppm" });
    try testing.expectStringStartsWith(broken.stderr, "raylane: d.ppm: ");
    const absent = try sandbox.expectExit(1, &.{ "compare", "a.ppm", "absent.png" });
    try testing.expectStringStartsWith(absent.stderr, "raylane: absent.png: ");
    try sandbox.write("e.png", "a text");
    const itself = try sandbox.expectExit(1, &.{ "compare", "e.png", "a.ppm", "-o./e.png" });
    try testing.expectEqualStrings(
        "raylane: e.png: would be overwritten by the output\n",
        itself.stderr,
    );
    try testing.expectEqualStrings("a text", try sandbox.read("e.png"));
    _ = try sandbox.expectExit(2, &.{ "compare", "a.ppm" });
    const help = try sandbox.expectExit(0, &.{ "compare", "--help" });
    try testing.expect(std.mem.find(u8, help.stdout, "--threshold") != null);
    try sandbox.expectFiles(&.{ "a.ppm", "b.ppm", "c.ppm", "d.ppm", "e.png", "m.png" });
}
