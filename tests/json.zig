//! Tests of what programs read and write: reports, failures, scenarios, jobs. The schemas that the
//! documentation has are checked against what the real program prints.

const std = @import("std");
const schema_file = @import("schema.zig");
const Io = std.Io;
const Sandbox = @import("cli.zig").Sandbox;
const Value = std.json.Value;
const io = std.testing.io;
const testing = std.testing;

/// A small scene in the dark.
const quick = "\"env\": \"none\", \"resolution\": [8, 6], \"spp\": 1";

const Schema = struct {
    arena: std.mem.Allocator,
    root: Value,

    /// Of a file of the documentation.
    fn read(sandbox: *Sandbox, path: []const u8) !Schema {
        const arena = sandbox.arena_state.allocator();
        const text = try Io.Dir.cwd().readFileAlloc(io, path, arena, .unlimited);
        return .{
            .arena = arena,
            .root = try std.json.parseFromSliceLeaky(Value, arena, text, .{}),
        };
    }

    /// Expects one object in one line, as the schema has it.
    fn expect(schema: *const Schema, line: []const u8) !Value {
        errdefer std.debug.print("{s}\n", .{line});
        const value = try std.json.parseFromSliceLeaky(Value, schema.arena, line, .{});
        try schema_file.check(&schema.root, &value);
        return value;
    }
};

fn exitCodeOf(value: *const Value) i64 {
    return value.object.get("error").?.object.get("exit_code").?.integer;
}

test "reports and failures are what the schema says" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const schema: Schema = try .read(&sandbox, "docs/stats.schema.json");
    const common = .{ "--env=none", "-r8x6", "-q", "--stats=json" };
    const full = try sandbox.expectExit(0, &(.{
        "builtin:cornell", "-oa.png", "--count-tests", "--time-budget=100", "--spp=2",
    } ++ common));
    const report = try schema.expect(full.stdout);
    try testing.expectEqualStrings("a.png", report.object.get("output").?.string);
    try testing.expect(report.object.get("tests").? == .object);
    try testing.expectEqual(2, report.object.get("spp_again").?.integer);
    const linear = try sandbox.expectExit(0, &(.{ "builtin:cornell", "-o-", "--format=pfm" } ++
        common));
    try testing.expect((try schema.expect(linear.stderr)).object.get("tonemap").? == .null);

    try sandbox.write("s.pbrt", "WorldBegin\n  Bang\n");
    const broken = try sandbox.expectExit(3, &(.{"s.pbrt"} ++ common));
    const failure = try schema.expect(broken.stdout);
    const problem = &failure.object.get("error").?.object;
    try testing.expectEqual(2, problem.get("line").?.integer);
    try testing.expectEqualStrings("s.pbrt", problem.get("file").?.string);
    try testing.expectEqualStrings("s.png", failure.object.get("output").?.string);
    try testing.expectEqual(3, exitCodeOf(&failure));
    const nowhere = try sandbox.expectExit(1, &(.{ "builtin:cornell", "-ono/a.png" } ++ common));
    const unwritten = try schema.expect(nowhere.stdout);
    try testing.expectEqualStrings("no/a.png", unwritten.object.get("error").?.object
        .get("file").?.string);
    const misused = try sandbox.expectExit(2, &(.{"--spp=0"} ++ common));
    try testing.expectEqual(2, exitCodeOf(&try schema.expect(misused.stdout)));
    try testing.expect(std.mem.startsWith(u8, misused.stderr, "raylane: option '--spp'"));
}

test "descriptions are what the schema says" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const schema: Schema = try .read(&sandbox, "docs/info.schema.json");
    try sandbox.write("s.gltf",
        \\{"asset":{"version":"2.0"},"extensionsUsed":["A_b"],"nodes":[{"camera":0},{"camera":1}],
        \\"scenes":[{"nodes":[0,1]}],"scene":0,"cameras":[{"type":"perspective","perspective":
        \\{"yfov":0.5,"znear":1}},{"type":"orthographic","orthographic":
        \\{"xmag":4,"ymag":3,"zfar":9,"znear":0}}],"animations":[{"channels":[],"samplers":[]}]}
    );
    for ([_][]const u8{ "s.gltf", "builtin:cornell" }) |name| {
        const described = try sandbox.expectExit(0, &.{ "info", "--json", "-q", name });
        _ = try schema.expect(described.stdout);
    }
    const missing = try sandbox.expectExit(1, &.{ "info", "--json", "no.glb" });
    try testing.expectEqual(1, exitCodeOf(&try schema.expect(missing.stdout)));
}

test "the documentation has every key" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const arena = sandbox.arena_state.allocator();
    for ([_][2][]const u8{
        .{ "docs/stats.schema.json", "docs/json.md" },
        .{ "docs/info.schema.json", "docs/info.md" },
    }) |pair| {
        const schema: Schema = try .read(&sandbox, pair[0]);
        const text = try Io.Dir.cwd().readFileAlloc(io, pair[1], arena, .unlimited);
        var list: std.ArrayList(*const Value) = .empty;
        try list.append(arena, &schema.root);
        while (list.pop()) |value| switch (value.*) {
            .object => |*object| {
                var fields = object.iterator();
                while (fields.next()) |field| try list.append(arena, field.value_ptr);
                const properties = object.get("properties") orelse continue;
                for (properties.object.keys()) |key| {
                    const quoted = try arena.print("`{s}`", .{key});
                    errdefer std.debug.print("{s} has no {s}\n", .{ pair[1], quoted });
                    try testing.expect(std.mem.find(u8, text, quoted) != null);
                }
            },
            .array => |*array| for (array.items) |*item| try list.append(arena, item),
            else => {},
        };
    }
}

test "a scenario gives the picture of the options that it names" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const options = [_][]const u8{
        "builtin:cornell", "-r8x6",            "--fov=30",      "--orbit=20,70,3",
        "--target=0,1,0",  "--background=env", "--env=sky.hdr", "--exposure=0",
        "-q",              "-oa.png",
    };
    // Two pixels.
    try sandbox.write("sky.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n" ++
        "\x80\x40\x20\x81\x20\x90\xff\x80");
    const khronos =
        \\{"scenario": {"name": "x", "model": "builtin:cornell", "lighting": "sky.hdr",
        \\ "dimensions": {"width": 8, "height": 6}, "target": {"y": 1}, "orbit":
        \\ {"theta": 20, "phi": 70, "radius": 3}, "verticalFoV": 30, "renderSkybox": true},
        \\ "outputFile": "b.png"}
    ;
    _ = try sandbox.expectExit(0, &options);
    _ = try sandbox.expectExit(0, &.{ "-q", "--scenario", khronos });
    try sandbox.write("own.json",
        \\{"input": "builtin:handles", "resolution": "8x6", "fov": 30, "orbit": [20, 70, 3],
        \\ "target": [0, 1, 0], "background": "env", "env": "sky.hdr", "exposure": 5, "quiet": true}
    );
    _ = try sandbox.expectExit(0, &.{
        "builtin:cornell", "--scenario=own.json", "-oc.png", "--exposure=0",
    });
    const expected = try sandbox.read("a.png");
    try testing.expectEqualStrings(expected, try sandbox.read("b.png"));
    try testing.expectEqualStrings(expected, try sandbox.read("c.png"));
}

test "all scenarios of a file are rendered, but for those that cannot be" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const schema: Schema = try .read(&sandbox, "docs/stats.schema.json");
    try sandbox.write("all.json", "[{\"input\": \"builtin:cornell\", \"name\": \"a\", " ++ quick ++
        "}, {\"input\": \"no.glb\", \"name\": \"b\", " ++ quick ++
        "}, {\"input\": \"builtin:cornell\", \"name\": \"c\", " ++ quick ++ "}]");
    const twice = try sandbox.expectExit(2, &.{ "--scenario=all.json", "-oa.png" });
    try testing.expect(std.mem.find(u8, twice.stderr, "two scenarios write 'a.png'") != null);
    const ending = try sandbox.expectExit(1, &.{
        "--scenario=all.json", "-o{scenario}.png", "--stats=json",
    });
    var lines = std.mem.tokenizeScalar(u8, ending.stdout, '\n');
    for ([_]bool{ true, false, true }) |is_good| {
        const value = try schema.expect(lines.next().?);
        try testing.expectEqual(is_good, value.object.get("error").? == .null);
    }
    try sandbox.expectFiles(&.{ "all.json", "a.png", "c.png" });
    try sandbox.write("bad.json", "{\"input\": \"builtin:cornell\",\n \"spq\": 1}");
    const unknown = try sandbox.expectExit(2, &.{"--scenario=bad.json"});
    try testing.expectEqualStrings(
        "raylane: bad.json: unknown key 'spq', did you mean 'spp'?\n",
        unknown.stderr,
    );
    _ = try sandbox.expectExit(1, &.{"--scenario=no.json"});
}

test "jobs are answered in turn, whatever is wrong with some" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const arena = sandbox.arena_state.allocator();
    const schema: Schema = try .read(&sandbox, "docs/stats.schema.json");
    const long: [1 << 21]u8 = @splat('x');
    try sandbox.write("jobs", try arena.print(
        \\{{"id": 1, "input": "builtin:cornell", "output": "a.png", {0s}}}
        \\broken
        \\
        \\{{"id": "two", "input": "builtin:cornell", "output": "b.png", {0s}, "orbit": [20, 70]}}
        \\{{"id": 3, "input": "builtin:cornell", "output": "-"}}
        \\{{"id": 4, "input": "no.glb", "output": "d.png"}}
        \\{1s}
        \\{{"id": 5, "input": "-", "output": "e.png"}}
        \\{{"id": 6, "input": "builtin:cornell", "output": "f.png", {0s}}}
    , .{ quick, &long }));
    const ending = try sandbox.runShell("exec \"$@\" <jobs", &.{ "serve", "--fov=40" });
    try testing.expectEqual(0, ending.exit_code);
    try testing.expectEqualStrings("", ending.stderr);
    const Expected = struct { id: []const u8, exit_code: i64 };
    var lines = std.mem.tokenizeScalar(u8, ending.stdout, '\n');
    for ([_]Expected{
        .{ .id = "{\"id\":1,", .exit_code = 0 },       .{ .id = "{\"id\":null,", .exit_code = 2 },
        .{ .id = "{\"id\":\"two\",", .exit_code = 0 }, .{ .id = "{\"id\":3,", .exit_code = 2 },
        .{ .id = "{\"id\":4,", .exit_code = 1 },       .{ .id = "{\"id\":null,", .exit_code = 2 },
        .{ .id = "{\"id\":5,", .exit_code = 2 },       .{ .id = "{\"id\":6,", .exit_code = 0 },
    }) |expected| {
        const line = lines.next().?;
        const value = try schema.expect(line);
        try testing.expect(std.mem.startsWith(u8, line, expected.id));
        const is_good = value.object.get("error").? == .null;
        try testing.expectEqual(expected.exit_code, if (is_good) 0 else exitCodeOf(&value));
    }
    try testing.expectEqual(null, lines.next());
    try sandbox.expectFiles(&.{ "jobs", "a.png", "b.png", "f.png" });
    try testing.expectEqualStrings(try sandbox.read("a.png"), try sandbox.read("f.png"));
    _ = try sandbox.expectExit(0, &.{
        "builtin:cornell", "-ok.png",       "-r8x6", "--spp=1", "--env=none", "--fov=40",
        "-q",              "--orbit=20,70",
    });
    try testing.expectEqualStrings(try sandbox.read("k.png"), try sandbox.read("b.png"));
}

test "a job finds the scene of the one before only while its files are as they were" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const arena = sandbox.arena_state.allocator();
    const one = "Camera \"perspective\"\nWorldBegin\nShape \"sphere\"\n";
    try sandbox.write("s.pbrt", one);
    try sandbox.write("t.pbrt", one ++ "Shape \"disk\"\n");
    const job = "{\"input\":\"s.pbrt\",\"output\":\"a.png\"," ++ quick ++ "}";
    // The scene is old, then newly written under the same name; the program runs meanwhile.
    const script = try arena.print("touch -d '1 hour ago' s.pbrt t.pbrt; mkfifo in; " ++
        "\"$@\" <in >out & exec 3>in; wanted() {{ while test \"$(wc -l <out)\" -lt $1; " ++
        "do sleep 0.02; done; }}; echo '{0s}' >&3; echo '{0s}' >&3; wanted 2; mv t.pbrt s.pbrt; " ++
        "echo '{0s}' >&3; exec 3>&-; wait $!", .{job});
    const ending = try sandbox.runShell(script, &.{ "serve", "--tessellation=4" });
    try testing.expectEqual(0, ending.exit_code);
    const schema: Schema = try .read(&sandbox, "docs/stats.schema.json");
    var lines = std.mem.tokenizeScalar(u8, try sandbox.read("out"), '\n');
    var triangles: [3]i64 = undefined;
    for (&triangles, [_]bool{ true, false, true }) |*count, is_read| {
        const answer = try schema.expect(lines.next().?);
        count.* = answer.object.get("triangles").?.integer;
        const parsed = answer.object.get("time_ms").?.object.get("parse").?;
        try testing.expectEqual(!is_read, parsed == .integer and parsed.integer == 0);
    }
    try testing.expectEqual(triangles[0], triangles[1]);
    try testing.expect(triangles[2] > triangles[1]);
}

test "names of other programs are understood, or answered with the right one" {
    var sandbox: Sandbox = .init();
    defer sandbox.deinit();
    const nothing = try sandbox.expectExit(2, &.{});
    try testing.expect(std.mem.startsWith(u8, nothing.stderr, "usage: raylane SCENE"));
    try testing.expectEqualStrings("", nothing.stdout);
    const version = try sandbox.expectExit(0, &.{"-V"});
    try testing.expect(std.mem.startsWith(u8, version.stdout, "raylane "));
    const help = try sandbox.expectExit(0, &.{ "help", "serve" });
    try testing.expect(std.mem.find(u8, help.stdout, "raylane serve [options]") != null);
    _ = try sandbox.expectExit(0, &.{
        "builtin:cornell", "--samples=1", "--width=8", "--height", "6", "--hdri=none", "-q",
        "--outfile=a.png",
    });
    _ = try sandbox.expectExit(0, &.{
        "builtin:cornell", "--spp=1", "--size=8x6", "--env=none", "-q", "-ob.png",
    });
    try testing.expectEqualStrings(try sandbox.read("a.png"), try sandbox.read("b.png"));
}

test {
    _ = schema_file;
}
