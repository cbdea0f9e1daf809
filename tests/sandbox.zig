//! Tests of `--sandbox` on the real program; they are skipped where the system has none, as under
//! qemu. What the sandbox itself denies is tested in src/sandbox.zig, in processes of its own.

const std = @import("std");
const Sandbox = @import("cli.zig").Sandbox;
const testing = std.testing;

const small = [_][]const u8{ "-q", "--env=none", "-r8x8", "--spp=1" };
const shape = "Shape \"sphere\"\n";
const sphere = "WorldBegin\n" ++ shape;

/// Skips the test where `--sandbox on` is an error, which has to say why.
fn expectThere(sandbox: *Sandbox) !void {
    const picture = .{ "builtin:cornell", "-oprobe.ppm", "--sandbox=on" };
    const ending = try sandbox.run(&(picture ++ small));
    if (ending.exit_code == 0) return sandbox.folder.dir.deleteFile(testing.io, "probe.ppm");
    try testing.expectEqual(1, ending.exit_code);
    const start = "raylane: '--sandbox on', but this system has no ";
    try testing.expectStringStartsWith(ending.stderr, start);
    return error.SkipZigTest;
}

test "the sandbox leaves what the command line names, wherever it is" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try expectThere(&sandbox);
    for ([_][]const u8{ "scenes", "scenes/parts", "real", "env" }) |name|
        try sandbox.folder.dir.createDir(testing.io, name, .default_dir);
    try sandbox.write("scenes/a.pbrt", "WorldBegin\nInclude \"parts/b.pbrt\"\n");
    try sandbox.write("scenes/parts/b.pbrt", shape);
    try sandbox.write("real/c.pbrt", sphere);
    try sandbox.folder.dir.symLink(testing.io, "../real/c.pbrt", "scenes/c.pbrt", .{});
    const picture = [_][]const u8{ "builtin:cornell", "-v", "--env=none", "-r8x8", "--spp=1" };
    const held = try sandbox.expectExit(0, &(picture ++ .{ "-oenv/sky.png", "--sandbox=on" }));
    try testing.expect(std.mem.find(u8, held.stderr, "raylane: sandbox: Landlock (ABI ") != null);
    const free = try sandbox.expectExit(0, &(picture ++ .{ "-ofree.png", "--sandbox=off" }));
    try testing.expect(std.mem.find(u8, free.stderr, "sandbox") == null);
    const expected = try sandbox.read("free.png");
    try testing.expectEqualSlices(u8, expected, try sandbox.read("env/sky.png"));
    const several = [_][]const u8{
        "scenes", "-q", "--env=env/sky.png", "-r8x8", "--spp=1", "--turntable=2",
    };
    for ([_][]const u8{ "on", "off" }) |mode| {
        const arena = sandbox.arena_state.allocator();
        const output = try arena.print("-o{s}/new/{{model}}/{{view}}.ppm", .{mode});
        const chosen = try arena.print("--sandbox={s}", .{mode});
        _ = try sandbox.expectExit(0, &(several ++ .{ output, chosen }));
    }
    for ([_][]const u8{ "a/0", "a/1", "c/0", "c/1" }) |name| {
        const arena = sandbox.arena_state.allocator();
        const on = try sandbox.read(try arena.print("on/new/{s}.ppm", .{name}));
        const off = try sandbox.read(try arena.print("off/new/{s}.ppm", .{name}));
        try testing.expectEqualSlices(u8, off, on);
    }
    const compared = try sandbox.run(&.{ "compare", "free.png", "env/sky.png", "--sandbox=on" });
    try testing.expectEqual(0, compared.exit_code);
    _ = try sandbox.expectExit(0, &.{ "info", "scenes/c.pbrt", "--sandbox=on" });
}

test "scenarios and jobs have one sandbox for all" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try expectThere(&sandbox);
    for ([_][]const u8{ "a", "b", "out" }) |name|
        try sandbox.folder.dir.createDir(testing.io, name, .default_dir);
    try sandbox.write("a/s.pbrt", sphere);
    try sandbox.write("b/s.pbrt", sphere);
    try sandbox.write("all.json",
        \\[{"name": "x", "input": "a/s.pbrt"}, {"name": "y", "input": "b/s.pbrt"}]
    );
    _ = try sandbox.expectExit(0, &([_][]const u8{
        "--scenario=all.json", "-oout/{scenario}.ppm", "--sandbox=on",
    } ++ small));
    try testing.expectEqualSlices(
        u8,
        try sandbox.read("out/x.ppm"),
        try sandbox.read("out/y.ppm"),
    );
    const jobs =
        \\printf '%s\n' '{"id": 1, "input": "a/s.pbrt", "output": "out/a.ppm"}' \
        \\ '{"id": 2, "input": "b/s.pbrt", "output": "b/b.ppm"}' \
        \\ '{"id": 3, "input": "b/s.pbrt", "output": "b/c.ppm", "sandbox": "off"}' | "$@"
    ;
    const answered = try sandbox.runShell(jobs, &(.{ "serve", "--sandbox=on" } ++ small));
    try testing.expectEqual(0, answered.exit_code);
    const refused = "a job has no sandbox of its own";
    try testing.expect(std.mem.find(u8, answered.stdout, refused) != null);
    const first = try sandbox.read("out/a.ppm");
    try testing.expectEqualSlices(u8, first, try sandbox.read("b/b.ppm"));
    try testing.expectEqualSlices(u8, first, try sandbox.read("out/x.ppm"));
    try testing.expectError(error.FileNotFound, sandbox.read("b/c.ppm"));
}

test "a link that leads out of the scene's folder is an error, in the same words" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    try expectThere(&sandbox);
    try sandbox.folder.dir.createDir(testing.io, "scene", .default_dir);
    try sandbox.write("secret.pbrt", shape);
    try sandbox.write("scene/s.pbrt", "WorldBegin\nInclude \"link.pbrt\"\n");
    try sandbox.folder.dir.symLink(testing.io, "../secret.pbrt", "scene/link.pbrt", .{});
    const scene = [_][]const u8{"scene/s.pbrt"} ++ small;
    const free = try sandbox.expectExit(3, &(scene ++ .{"--sandbox=off"}));
    const held = try sandbox.expectExit(3, &(scene ++ .{"--sandbox=on"}));
    try testing.expectEqualStrings(free.stderr, held.stderr);
    try testing.expect(std.mem.find(u8, held.stderr, "leads outside the scene's folder") != null);
    try sandbox.expectFiles(&.{ "secret.pbrt", "scene" });
    _ = try sandbox.expectExit(0, &(scene ++ .{ "--sandbox=on", "--allow-outside" }));
}
