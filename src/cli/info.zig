//! The command line of `raylane info`: arguments -> `Info`, or one line that says what is wrong.

const std = @import("std");
const arguments_file = @import("arguments.zig");
const cli = @import("../cli.zig");
const values = @import("values.zig");
const settings = @import("../settings.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Section = arguments_file.Section;

/// What to look at.
pub const Info = struct {
    scene: []const u8 = "",
    /// Such a file is described all the same.
    load: settings.Load = .{ .force = true },
    sandbox: settings.Sandbox = .auto,
    /// Bytes that may be allocated at a time; null: a share of what is left.
    memory_max: ?u64 = null,
    /// Null: as long as it takes.
    time_max_s: ?f32 = null,
    json: bool = false,
    quiet: bool = false,
};

/// What it understands.
pub const sections: []const Section = &.{
    .{ .title = "Options", .options = &.{
        .{ .usage = "--json", .help = "one JSON object in one line, see docs/info.md" },
        .{ .usage = "--scene WHICH", .help = "name or index of a scene of a glTF file" },
        .{
            .usage = "--material-variant N",
            .help = "name or index of one of its variants of materials",
        },
        .{
            .usage = "--up-axis AXIS",
            .words = arguments_file.wordsOf(settings.UpAxis),
            .help = "y or z: which axis of the file points up",
        },
        .{
            .usage = "--format-in FORMAT",
            .words = arguments_file.wordsOf(settings.SceneFormat),
            .help = arguments_file.namesOf(settings.SceneFormat) ++ ", whatever it holds",
        },
        .{
            .usage = "--allow-outside",
            .help = "let the scene name files outside of its own folder",
        },
        .{
            .usage = "--sandbox WHEN",
            .words = arguments_file.wordsOf(settings.Sandbox),
            .help = "auto (default), on or off, as for rendering",
        },
        .{ .usage = "--max-memory SIZE", .help = "512M or 2G, say" },
        .{ .usage = "--max-time S", .help = "seconds until the answer (default: no limit)" },
        .{ .usage = "--max-triangles N", .help = "with all instances, as for rendering" },
        .{ .usage = "-q, --quiet", .help = "no warnings" },
        .{ .usage = "-h, --help", .help = "print this" },
    } },
};

const Reader = arguments_file.Arguments(sections);

/// What `raylane info --help` prints.
pub const help: []const u8 = "raylane " ++ cli.version ++
    \\: says what is in a scene file
    \\
    \\usage: raylane info SCENE [options]
    \\
    \\Scenes, cameras, lights, variants and images with their sizes, how much is
    \\drawn and where, about how much memory that takes, and what becomes of the
    \\extensions that the file uses. Nothing is rendered and no image is decoded.
    \\
++ arguments_file.helpOf(sections) ++
    \\
    \\Exit status: 0 done, 1 files or memory, 2 usage, 3 scene invalid or not
    \\supported, 124 --max-time. A file that is rendered only with --force is
    \\described.
    \\
;

/// Reads the arguments after `info`.
pub fn parse(arguments: []const [:0]const u8, diagnostic: *Diagnostic) cli.Error!Info {
    var reader: Reader = .{
        .arguments = arguments,
        .diagnostic = diagnostic,
        .help = "raylane info --help",
    };
    var info: Info = .{};
    var scene: ?[]const u8 = null;
    while (try reader.next()) |argument| switch (argument) {
        .word => |word| {
            if (word.len == 0) return reader.fail("the scene's name is empty", .{});
            if (scene != null) return reader.fail("one scene at a time", .{});
            scene = word;
        },
        .flag => |flag| try set(&reader, &info, flag),
    };
    info.scene = scene orelse return reader.fail("no scene given", .{});
    return info;
}

fn set(reader: *const Reader, info: *Info, given: Reader.Given) cli.Error!void {
    switch (given.id) {
        .json => info.json = true,
        .scene => info.load.scene = values.choiceOf(given.value) orelse
            return reader.bad(given, "a scene's name or its index"),
        .material_variant => info.load.material_variant = values.choiceOf(given.value) orelse
            return reader.bad(given, "a material variant's name or its index"),
        .up_axis => info.load.up_axis = try reader.choice(given, settings.UpAxis),
        .format_in => info.load.format = try reader.choice(given, settings.SceneFormat),
        .sandbox => info.sandbox = try reader.choice(given, settings.Sandbox),
        .allow_outside => info.load.allow_outside = true,
        .max_memory => info.memory_max = try values.memoryMaxOf(reader, given),
        .max_time => info.time_max_s = try values.timeMaxOf(reader, given),
        .max_triangles => info.load.triangle_count_max = try values.countMaxOf(reader, given),
        .quiet => info.quiet = true,
        // By itself it is found before the rest is read.
        .help => return reader.fail("'-h' stands alone", .{}),
    }
}

const common = @import("testing.zig");
const testing = std.testing;

test "a scene and how to look at it" {
    var diagnostic: Diagnostic = .{};
    const info = try parse(&.{
        "--json",             "a.glb",        "--scene=1", "--up-axis=z",     "-q",
        "--max-time=.5",      "--max-memory", "1G",        "--max-triangles", "5M",
        "--material-variant", "red",
    }, &diagnostic);
    try testing.expectEqual(0.5, info.time_max_s);
    try testing.expectEqual(1 << 30, info.memory_max);
    try testing.expectEqual(5_000_000, info.load.triangle_count_max);
    try testing.expectEqualStrings("a.glb", info.scene);
    try testing.expect(info.json and info.quiet and info.load.force);
    try testing.expectEqual(1, info.load.scene.index);
    try testing.expectEqualStrings("red", info.load.material_variant.name);
}

test "mistakes name the option" {
    for ([_]struct { []const u8, []const [:0]const u8 }{
        .{ "no scene given", &.{"--json"} },
        .{ "one scene at a time", &.{ "a", "b" } },
        .{ "empty", &.{""} },
        .{ "'--up-axis'", &.{"--up-axis=x"} },
        .{ "'--scene'", &.{"--scene="} },
        .{ "'--format-in'", &.{"--format-in=fbx"} },
        .{ "'--max-time'", &.{"--max-time=0"} },
        .{ "'--max-memory'", &.{"--max-memory=x"} },
        .{ "did you mean '--json'?", &.{"--jsn"} },
    }) |case| try common.expectUsage("info", parse, case[0], case[1]);
}

test "the help fits a screen" {
    _ = try common.expectFits(help);
}
