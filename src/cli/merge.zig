//! The command line of `raylane merge`: arguments -> `Merge`, or one line that says what is wrong.

const std = @import("std");
const arguments_file = @import("arguments.zig");
const cli = @import("../cli.zig");
const values = @import("values.zig");
const settings = @import("../settings.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Section = arguments_file.Section;

/// What to merge.
pub const Merge = struct {
    arguments: []const [:0]const u8,
    /// At least one.
    part_count: usize = 0,
    output: []const u8 = undefined,
    format: settings.Format = undefined,
    /// Null: as many as the system has CPUs.
    thread_count: ?u32 = null,
    /// Bytes of memory that may be allocated at a time; null: as much as there is.
    memory_max: ?u64 = null,
    sandbox: settings.Sandbox = .auto,

    /// Names of the parts, as given; the caller frees the list.
    pub fn parts(
        merge: *const Merge,
        gpa: std.mem.Allocator,
    ) error{OutOfMemory}![]const []const u8 {
        const list = try gpa.alloc([]const u8, merge.part_count);
        var diagnostic: Diagnostic = .{};
        var reader = readerOf(merge.arguments, &diagnostic);
        var count: usize = 0;
        while (reader.next() catch unreachable) |argument| switch (argument) { // It has passed.
            .word => |part| {
                list[count] = part;
                count += 1;
            },
            .flag => {},
        };
        return list;
    }

    /// Whether the image goes to standard output.
    pub fn toStdout(merge: *const Merge) bool {
        return cli.isStdout(merge.output);
    }
};

/// What it understands.
pub const sections: []const Section = &.{
    .{ .title = "Options", .options = &.{
        .{ .usage = "-o, --output FILE", .help = "name ending in a format; - is standard output" },
        .{ .usage = "--format FORMAT", .help = "as 'raylane render' has them (default: by FILE)" },
        .{
            .usage = "-t, --threads N",
            .help = settings.thread_count.text() ++ " (default: as many as CPUs)",
        },
        .{ .usage = "--max-memory SIZE", .help = "512M or 2G, say; an error where more is needed" },
        .{
            .usage = "--sandbox WHEN",
            .words = arguments_file.wordsOf(settings.Sandbox),
            .help = "auto (default), on or off, as for rendering",
        },
        .{ .usage = "-h, --help", .help = "print this" },
    } },
};

const Reader = arguments_file.Arguments(sections);

/// What `raylane merge --help` prints.
pub const help: []const u8 = "raylane " ++ cli.version ++
    \\: makes a picture of its parts
    \\
    \\usage: raylane merge -o FILE PART... [options]
    \\
    \\PARTS are all files that 'raylane render' has written with '--tile 1/N' to
    \\'--tile N/N', or with '--crop' of rectangles that make up the picture, as EXR
    \\files, with the same options. FILE is what one run without these writes.
    \\
++ arguments_file.helpOf(sections) ++
    \\
    \\Exit status: 0 done, 1 files or memory, 2 usage, 3 files that are not the
    \\parts of one picture.
    \\
;

/// Reads the arguments after `merge`.
pub fn parse(arguments: []const [:0]const u8, diagnostic: *Diagnostic) cli.Error!Merge {
    var reader = readerOf(arguments, diagnostic);
    var merge: Merge = .{ .arguments = arguments };
    var output: ?[]const u8 = null;
    var format: ?settings.Format = null;
    while (try reader.next()) |argument| switch (argument) {
        .word => |part| {
            if (part.len == 0) return reader.fail("a part's name is empty", .{});
            if (std.mem.eql(u8, part, settings.standard_input))
                return reader.fail("parts are files, none comes from standard input", .{});
            merge.part_count += 1;
        },
        .flag => |flag| switch (flag.id) {
            .output => output = try reader.text(flag, "a file name or -"),
            .format => format = values.formatOf(flag.value) orelse
                return reader.bad(flag, comptime arguments_file.namesOf(settings.Format)),
            .threads => merge.thread_count = try reader.number(flag, settings.thread_count),
            .max_memory => merge.memory_max = try values.memoryMaxOf(&reader, flag),
            .sandbox => merge.sandbox = try reader.choice(flag, settings.Sandbox),
            // By itself it is found before the rest is read.
            .help => return reader.fail("'-h' stands alone", .{}),
        },
    };
    merge.output = output orelse return reader.fail("'--output' says where the picture goes", .{});
    merge.format = try cli.formatFor(&reader, format, merge.output);
    if (merge.part_count == 0) return reader.fail("no parts given", .{});
    return merge;
}

fn readerOf(arguments: []const [:0]const u8, diagnostic: *Diagnostic) Reader {
    return .{ .arguments = arguments, .diagnostic = diagnostic, .help = "raylane merge --help" };
}

const common = @import("testing.zig");
const testing = std.testing;

test "parts stand among options" {
    const gpa = testing.allocator;
    var diagnostic: Diagnostic = .{};
    const merge = try parse(
        &.{ "a.exr", "-o", "b.png", "-t2", "--", "-c.exr", "d.exr" },
        &diagnostic,
    );
    const parts = try merge.parts(gpa);
    defer gpa.free(parts);
    try testing.expectEqual(3, parts.len);
    try testing.expectEqualStrings("-c.exr", parts[1]);
    try testing.expectEqual(.png, merge.format);
    try testing.expect(!merge.toStdout() and merge.thread_count == 2);
    const piped = try parse(&.{ "a.exr", "-o-", "--format=exr", "--max-memory=1G" }, &diagnostic);
    try testing.expect(piped.toStdout() and piped.format == .exr and piped.memory_max == 1 << 30);
}

test "mistakes name the option" {
    for ([_]struct { []const u8, []const [:0]const u8 }{
        .{ "no parts", &.{"-oa.png"} },
        .{ "'--output'", &.{"a.exr"} },
        .{ "empty", &.{ "-oa.png", "" } },
        .{ "standard input", &.{ "-oa.png", "-" } },
        .{ "no image format", &.{ "-oa.tiff", "a.exr" } },
        .{ "contradicts", &.{ "-oa.png", "--format=exr", "a.exr" } },
        .{ "'--threads'", &.{ "-oa.png", "-t0", "a.exr" } },
        .{ "'--max-memory'", &.{ "-oa.png", "--max-memory=x", "a.exr" } },
    }) |case| try common.expectUsage("merge", parse, case[0], case[1]);
}

test "the help fits a screen" {
    _ = try common.expectFits(help);
}
