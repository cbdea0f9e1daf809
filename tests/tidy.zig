//! The style of the source tree, as tests: what a reviewer would otherwise have to look for.
//!
//! In: the tree in the working directory, read anew by each test. Out: a failed test that lists
//! each finding as `path:line: what is wrong`. The directions of the imports stand in the table
//! below, which is the one of the architecture; every rule is a function of one file's text, and
//! below it a test shows that it bites.

const std = @import("std");
const Allocator = std.mem.Allocator;
const Ast = std.zig.Ast;
const testing = std.testing;

/// What a part of `src`, or a room of one, may import.
const Row = struct { part: []const u8, may_import: []const []const u8 };

/// What each part of `src` may import besides its own folder and `leaves`, and does. A part is a
/// file of `src` with the folder of the same name; `module:` begins the name of a module of the
/// build other than the language's own.
const directions = [_]Row{
    .{ .part = "main", .may_import = &.{ "module:raylane", "signals", "commands" } },
    .{ .part = "commands", .may_import = &.{ "module:raylane", "sandbox", "signals" } },
    .{ .part = "sandbox", .may_import = &.{} },
    .{ .part = "signals", .may_import = &.{"module:raylane"} },
    .{ .part = "cli", .may_import = &.{ "module:config", "batch", "variant" } },
    .{ .part = "batch", .may_import = &.{} },
    .{
        // The one that leads scenes through all stages.
        .part = "session",
        .may_import = &.{
            "builtin", "parse",    "scene",   "prepare", "world",  "trace",
            "film",    "parallel", "variant", "output",  "report", "denoise",
            "part",    "manifest",
        },
    },
    .{ .part = "level", .may_import = &.{ "main", "module:raylane" } },
    .{ .part = "release", .may_import = &.{ "module:config", "module:raylane" } },
    .{ .part = "processor", .may_import = &.{} },
    .{ .part = "memory_functions", .may_import = &.{"module:config"} },
    .{ .part = "kernel", .may_import = &.{ "module:config", "trace", "variant" } },
    .{ .part = "bench", .may_import = &.{ "display", "session", "variant", "energy" } },
    .{ .part = "compare", .may_import = &.{ "decode", "parse" } },
    .{
        .part = "info",
        .may_import = &.{ "decode", "parse", "prepare", "report", "scene", "world" },
    },
    .{ .part = "part", .may_import = &.{ "film", "manifest", "output" } },
    .{
        .part = "merge",
        .may_import = &.{
            "decode", "denoise", "film", "manifest", "output", "parallel", "parse", "part",
        },
    },
    .{ .part = "variant", .may_import = &.{"module:config"} },
    .{ .part = "simd", .may_import = &.{"variant"} },
    .{ .part = "parallel", .may_import = &.{"simd"} },
    .{ .part = "builtin", .may_import = &.{"scene"} },
    .{ .part = "call_stack", .may_import = &.{} },
    .{ .part = "parse", .may_import = &.{ "scene", "decode" } },
    .{ .part = "scene", .may_import = &.{} },
    .{
        .part = "prepare",
        .may_import = &.{ "scene", "world", "simd", "parallel", "decode", "memory_account" },
    },
    .{ .part = "world", .may_import = &.{} },
    .{ .part = "trace", .may_import = &.{ "world", "film", "variant", "simd", "parallel" } },
    .{ .part = "film", .may_import = &.{"image"} },
    .{ .part = "denoise", .may_import = &.{ "film", "parallel" } },
    .{ .part = "image", .may_import = &.{} },
    .{ .part = "memory_account", .may_import = &.{} },
    .{ .part = "output", .may_import = &.{ "image", "manifest", "memory_account", "parallel" } },
    .{ .part = "report", .may_import = &.{"manifest"} },
    .{ .part = "manifest", .may_import = &.{} },
    .{ .part = "display", .may_import = &.{"report"} },
    .{ .part = "energy", .may_import = &.{} },
    .{ .part = "decode", .may_import = &.{ "module:config", "memory_account" } },
    .{ .part = "diagnostic", .may_import = &.{} },
    .{ .part = "huge_pages", .may_import = &.{} },
    .{ .part = "identity", .may_import = &.{} },
    .{ .part = "json_text", .may_import = &.{} },
    .{ .part = "math", .may_import = &.{} },
    .{ .part = "progress", .may_import = &.{} },
    .{ .part = "settings", .may_import = &.{} },
    .{ .part = "statistics", .may_import = &.{} },
};

/// Parts that import no other part and that all may import; `raylane` re-exports everything.
const leaves = [_][]const u8{
    "diagnostic", "huge_pages", "identity", "json_text",
    "math",       "progress",   "settings", "statistics",
};

/// Rooms of a part, and which others of its files each may import besides its own, and does. How a
/// ray is traced and what a surface does with light know nothing of each other.
const rooms = [_]Row{
    .{ .part = "trace/traverse", .may_import = &.{} },
    .{ .part = "trace/shade", .may_import = &.{} },
    .{ .part = "trace/integrate", .may_import = &.{ "trace/traverse", "trace/shade" } },
};

/// Where the compiler starts to read; every other Zig file is imported from one of them.
const roots = [_][]const u8{
    "build.zig",
    "bench/kernels.zig",
    "bench/light.zig",
    "bench/lowering.zig",
    "bench/frames.zig",
    "bench/parse.zig",
    "bench/poses.zig",
    "bench/rays.zig",
    "bench/structures.zig",
    "fuzz/main.zig",
    "src/kernel.zig",
    "src/level.zig",
    "src/main.zig",
    "src/memory_functions.zig",
    "src/raylane.zig",
    "src/release.zig",
    "scenes/make.zig",
    "tests.zig",
    "tests/cli.zig",
    "tests/launch.zig",
    "tests/raylane.zig",
    "tests/runner.zig",
    "tests/stb_image.zig",
    "tests/summary.zig",
    "tests/tidy.zig",
};

const column_count_max = 100;
const function_line_count_max = 70;
/// Lines of a function that makes a type: beyond, it is a file that is indented.
const generic_line_count_max = 250;

const LongGeneric = struct { path: []const u8, name: []const u8, lines: usize, why: []const u8 };

/// Generic types that are longer, by how much they may be, and why. To shrink.
const long_generics = [_]LongGeneric{
    .{
        .path = "bench/rays/workload.zig",
        .name = "Workload",
        .lines = 300,
        .why = "all phases of one frame of the ray benchmark",
    },
    .{
        .path = "src/prepare/bvh/build.zig",
        .name = "Builder",
        .lines = 360,
        .why = "generic over the pack's size, for the cost alone",
    },
    .{
        .path = "src/prepare/bvh/reinsert.zig",
        .name = "Optimizer",
        .lines = 430,
        .why = "generic over the pack's size, for the cost alone",
    },
    .{
        .path = "src/prepare/bvh/wide.zig",
        .name = "Collapse",
        .lines = 390,
        .why = "weighing and laying out in one",
    },
    .{
        .path = "src/trace/traverse/beam/shadow_receivers.zig",
        .name = "ShadowReceivers",
        .lines = 255,
        .why = "receivers and their regions in one",
    },
    .{
        .path = "src/trace/traverse/interval_search.zig",
        .name = "Search",
        .lines = 300,
        .why = "node and leaf of one traversal",
    },
};

/// Written in two halves, for this file is checked as well.
const unfinished_words = [_][]const u8{ "TO" ++ "DO", "FIX" ++ "ME", "XX" ++ "X" };
const unwanted_texts = [_]struct { text: []const u8, reason: []const u8 }{
    .{ .text = "usingname" ++ "space", .reason = "is gone from the language" },
    .{ .text = "crates" ++ ".io", .reason = "is a registry's host" },
    .{ .text = "py" ++ "pi.org", .reason = "is a registry's host" },
    .{ .text = "python" ++ "hosted", .reason = "is a registry's host" },
    .{ .text = "registry.npm" ++ "js", .reason = "is a registry's host" },
    .{ .text = "deb.deb" ++ "ian.org", .reason = "is a registry's host" },
    .{ .text = "proxy.go" ++ "lang", .reason = "is a registry's host" },
    .{ .text = "/ro" ++ "ot/", .reason = "is a path of one machine" },
    .{ .text = "/wo" ++ "rk/", .reason = "is a path of one machine" },
};

/// One text file of the tree.
const File = struct {
    /// From the top of the tree, with slashes.
    path: []const u8,
    source: [:0]const u8,

    fn isZig(file: File) bool {
        return std.mem.endsWith(u8, file.path, ".zig");
    }

    /// Programs in any language, as opposed to prose and data.
    fn isCode(file: File) bool {
        if (std.mem.eql(u8, std.fs.path.basename(file.path), "SHA256SUMS")) return false;
        const extension = std.fs.path.extension(file.path);
        for ([_][]const u8{ ".zig", ".zon", ".c", ".cpp", ".h", ".py", ".sh", "" }) |code| {
            if (std.mem.eql(u8, extension, code)) return true;
        }
        return false;
    }
};

/// What is wrong, one line each; everything is allocated in one arena.
const Findings = struct {
    arena: Allocator,
    lines: std.ArrayList([]const u8) = .empty,

    fn add(
        findings: *Findings,
        path: []const u8,
        line_index: usize,
        comptime format: []const u8,
        arguments: anytype,
    ) Allocator.Error!void {
        const line = try findings.arena.print("{s}:{d}: " ++ format, .{ path, line_index + 1 } ++
            arguments);
        try findings.lines.append(findings.arena, line);
    }
};

const Rule = fn (findings: *Findings, file: File) Allocator.Error!void;

/// Every file of the tree that a person wrote as text, tidy's own included.
fn readTree(arena: Allocator) ![]const File {
    const io = testing.io;
    var files: std.ArrayList(File) = .empty;
    const top = try std.Io.Dir.cwd().openDir(io, ".", .{ .iterate = true });
    defer top.close(io);
    var walker = try top.walkSelectively(arena);
    defer walker.deinit();
    while (try walker.next(io)) |entry| {
        const is_made = std.mem.eql(u8, entry.path, "zig-out") or
            std.mem.eql(u8, entry.path, "vendor/include") or
            std.mem.eql(u8, entry.basename, "__pycache__");
        // Folders of tools are hidden ones, but for the one with the commands of CI.
        const is_hidden = entry.basename[0] == '.' and !std.mem.eql(u8, entry.basename, ".ci");
        if (entry.kind == .directory) {
            if (!is_made and !is_hidden) try walker.enter(io, entry);
            continue;
        }
        if (entry.kind != .file or !isText(entry.basename)) continue;
        // The pointer that stands for the folder in a second checkout of one repository.
        if (std.mem.eql(u8, entry.basename, ".git")) continue;
        const limit: std.Io.Limit = .limited(16 << 20);
        try files.append(arena, .{
            .path = try arena.dupe(u8, entry.path),
            .source = try top.readFileAllocOptions(io, entry.path, arena, limit, .of(u8), 0),
        });
    }
    return files.items;
}

fn isText(basename: []const u8) bool {
    const extensions = [_][]const u8{
        ".zig", ".zon", ".c",   ".cpp",  ".h",    ".py", ".sh", ".md",
        ".txt", ".tsv", ".svg", ".toml", ".json", "",
    };
    for (extensions) |extension| {
        if (std.mem.eql(u8, std.fs.path.extension(basename), extension)) return true;
    }
    return std.mem.eql(u8, basename, ".gitignore");
}

/// Applies `rule` to the tree and fails with the list of what it found.
fn expectTidy(comptime rule: Rule) !void {
    var arena_state: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena_state.deinit();
    var findings: Findings = .{ .arena = arena_state.allocator() };
    for (try readTree(findings.arena)) |file| try rule(&findings, file);
    try expectNone(findings);
}

fn expectNone(findings: Findings) !void {
    for (findings.lines.items) |line| std.debug.print("{s}\n", .{line});
    if (findings.lines.items.len != 0) return error.Untidy;
}

/// Applies `rule` to one snippet and expects exactly this finding, or none where it is null.
fn expectFinding(
    comptime rule: Rule,
    path: []const u8,
    source: [:0]const u8,
    expected: ?[]const u8,
) !void {
    var arena_state: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena_state.deinit();
    var findings: Findings = .{ .arena = arena_state.allocator() };
    try rule(&findings, .{ .path = path, .source = source });
    const lines = findings.lines.items;
    if (expected) |line| {
        try testing.expectEqual(1, lines.len);
        try testing.expectEqualStrings(line, lines[0]);
    } else try testing.expectEqual(0, lines.len);
}

/// An `@import` and the line it stands on.
const Import = struct { name: []const u8, line_index: usize };

/// The imports of a Zig file by its tokens, so that comments and strings do not count.
fn importsOf(arena: Allocator, file: File) Allocator.Error![]const Import {
    var imports: std.ArrayList(Import) = .empty;
    var tokenizer: std.zig.Tokenizer = .init(file.source);
    var is_import = false;
    while (true) {
        const token = tokenizer.next();
        const text = file.source[token.loc.start..token.loc.end];
        switch (token.tag) {
            .eof => return imports.items,
            .builtin => is_import = std.mem.eql(u8, text, "@import"),
            .l_paren => {},
            .string_literal => {
                if (is_import) try imports.append(arena, .{
                    .name = std.mem.trim(u8, text, "\""),
                    .line_index = lineIndex(file.source, token.loc.start),
                });
                is_import = false;
            },
            else => is_import = false,
        }
    }
}

fn lineIndex(source: []const u8, offset: usize) usize {
    return std.mem.countScalar(u8, source[0..offset], '\n');
}

/// The path that an import of a file names, from the top of the tree.
fn resolve(arena: Allocator, importer: []const u8, name: []const u8) Allocator.Error![]const u8 {
    const folder = std.fs.path.dirname(importer) orelse ".";
    return std.fs.path.resolvePosix(arena, &.{ folder, name });
}

/// `src/trace/box.zig` and `src/trace.zig` are both of the part `trace`; null outside `src`.
fn partOf(path: []const u8) ?[]const u8 {
    const inside = std.mem.cutPrefix(u8, path, "src/") orelse return null;
    const slash = std.mem.findScalar(u8, inside, '/') orelse
        return std.mem.cutSuffix(u8, inside, ".zig");
    return inside[0..slash];
}

/// The room that a file is in, by the table.
fn roomOf(path: []const u8) ?[]const u8 {
    const inside = std.mem.cutPrefix(u8, path, "src/") orelse return null;
    for (rooms) |row| {
        const rest = std.mem.cutPrefix(u8, inside, row.part) orelse continue;
        if (rest[0] == '/') return row.part;
    }
    return null;
}

fn contains(names: []const []const u8, name: []const u8) bool {
    for (names) |candidate| if (std.mem.eql(u8, candidate, name)) return true;
    return false;
}

fn rowOf(table: []const Row, part: []const u8) ?*const Row {
    for (table) |*row| if (std.mem.eql(u8, row.part, part)) return row;
    return null;
}

/// What an import goes to: a part, a room or a module, by the names of the tables.
const Target = struct { part: ?[]const u8, room: ?[]const u8 };

fn targetOf(arena: Allocator, file: File, import: Import) Allocator.Error!Target {
    if (std.mem.endsWith(u8, import.name, ".zig")) {
        const path = try resolve(arena, file.path, import.name);
        return .{ .part = partOf(path) orelse import.name, .room = roomOf(path) };
    }
    const own = [_][]const u8{ "std", "builtin", "root" };
    if (contains(&own, import.name)) return .{ .part = null, .room = null };
    return .{ .part = try arena.print("module:{s}", .{import.name}), .room = null };
}

fn checkDirections(findings: *Findings, file: File) Allocator.Error!void {
    if (!file.isZig()) return;
    const part = partOf(file.path) orelse return;
    if (std.mem.eql(u8, part, "raylane")) return;
    const row = rowOf(&directions, part) orelse
        return findings.add(file.path, 0, "'{s}' is not in tidy's table", .{part});
    const room = roomOf(file.path);
    for (try importsOf(findings.arena, file)) |import| {
        const target = try targetOf(findings.arena, file, import);
        const target_part = target.part orelse continue;
        const is_own = std.mem.eql(u8, target_part, part);
        if (!is_own and !contains(&leaves, target_part) and
            !contains(row.may_import, target_part))
        {
            try findings.add(file.path, import.line_index, "'{s}' may not import '{s}'", .{
                part, target_part,
            });
        }
        const from = room orelse continue;
        const to = target.room orelse target_part;
        if (!is_own or std.mem.eql(u8, from, to)) continue;
        if (contains(rowOf(&rooms, from).?.may_import, to)) continue;
        try findings.add(file.path, import.line_index, "'{s}' may not import '{s}'", .{ from, to });
    }
}

/// Lists the parts of a table that are not there, and what they may import and do not.
fn checkPermissions(
    findings: *Findings,
    files: []const File,
    table: []const Row,
) Allocator.Error!void {
    const arena = findings.arena;
    for (table) |row| {
        var used: std.array_hash_map.String(void) = .empty;
        var is_there = false;
        for (files) |file| {
            const part = partOf(file.path) orelse continue;
            const room = roomOf(file.path) orelse part;
            if (!std.mem.eql(u8, row.part, part) and !std.mem.eql(u8, row.part, room)) continue;
            is_there = true;
            for (try importsOf(arena, file)) |import| {
                const target = try targetOf(arena, file, import);
                if (target.part) |name| try used.put(arena, name, {});
                if (target.room) |name| try used.put(arena, name, {});
            }
        }
        const path = "tests/tidy.zig";
        if (!is_there) try findings.add(path, 0, "there is no '{s}'", .{row.part});
        for (row.may_import) |name| if (!used.contains(name)) {
            try findings.add(path, 0, "'{s}' may import '{s}' and does not", .{ row.part, name });
        };
    }
}

test "imports follow the way of the data" {
    try expectTidy(checkDirections);
}

test "every permission is used" {
    var arena_state: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena_state.deinit();
    var findings: Findings = .{ .arena = arena_state.allocator() };
    const files = try readTree(findings.arena);
    try checkPermissions(&findings, files, &directions);
    try checkPermissions(&findings, files, &rooms);
    try expectNone(findings);
}

test "a permission that nobody uses and a part that is gone are found" {
    var arena_state: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena_state.deinit();
    var findings: Findings = .{ .arena = arena_state.allocator() };
    try checkPermissions(&findings, &.{
        .{ .path = "src/a.zig", .source = "const b = @import(\"b.zig\");" },
        .{ .path = "src/a/c.zig", .source = "const m = @import(\"m\");" },
        .{ .path = "src/trace/shade/d.zig", .source = "const e = @import(\"../traverse/e.zig\");" },
    }, &.{
        .{ .part = "a", .may_import = &.{ "b", "module:m", "d" } },
        .{ .part = "trace/shade", .may_import = &.{ "trace/traverse", "trace/integrate" } },
        .{ .part = "gone", .may_import = &.{} },
    });
    const expected = [_][]const u8{
        "tests/tidy.zig:1: 'a' may import 'd' and does not",
        "tests/tidy.zig:1: 'trace/shade' may import 'trace/integrate' and does not",
        "tests/tidy.zig:1: there is no 'gone'",
    };
    try testing.expectEqual(expected.len, findings.lines.items.len);
    for (expected, findings.lines.items) |line, found| try testing.expectEqualStrings(line, found);
}

test "an import against the way of the data is found" {
    const rule = checkDirections;
    try expectFinding(rule, "src/trace/box.zig",
        \\// @import("../scene.zig")
        \\const a = @import("std");
        \\const b = @import("ray.zig");
        \\const c = @import("../math.zig").vec3;
        \\const d = @import("../scene.zig");
    , "src/trace/box.zig:5: 'trace' may not import 'scene'");
    try expectFinding(
        rule,
        "src/parse.zig",
        "const a = @import(\"prepare/pose.zig\");",
        "src/parse.zig:1: 'parse' may not import 'prepare'",
    );
    try expectFinding(
        rule,
        "src/trace.zig",
        "const a = @import(\"cgltf\");",
        "src/trace.zig:1: 'trace' may not import 'module:cgltf'",
    );
    try expectFinding(
        rule,
        "src/parse.zig",
        "const a = @import(\"builtin\");\nconst b = @import(\"builtin.zig\");",
        "src/parse.zig:2: 'parse' may not import 'builtin'",
    );
    try expectFinding(
        rule,
        "src/trace/traverse/beam/a.zig",
        "const a = @import(\"../../shade/b.zig\");",
        "src/trace/traverse/beam/a.zig:1: 'trace/traverse' may not import 'trace/shade'",
    );
    try expectFinding(
        rule,
        "src/trace/shade/a.zig",
        "const a = @import(\"../integrate/b.zig\");\nconst b = @import(\"c.zig\");",
        "src/trace/shade/a.zig:1: 'trace/shade' may not import 'trace/integrate'",
    );
    try expectFinding(
        rule,
        "src/trace/integrate/a.zig",
        "const a = @import(\"../shade/b.zig\");\nconst b = @import(\"../../trace.zig\");",
        "src/trace/integrate/a.zig:2: 'trace/integrate' may not import 'trace'",
    );
    try expectFinding(rule, "src/trace.zig", "const a = @import(\"trace/shade/b.zig\");", null);
    try expectFinding(rule, "src/new.zig", "", "src/new.zig:1: 'new' is not in tidy's table");
    try expectFinding(rule, "src/raylane.zig", "const a = @import(\"trace.zig\");", null);
}

/// Where the time of day is asked for: to be told, and to be compared with times of files. All else
/// is measured by the clock that nobody sets, so that no length of time depends on who does.
const wall_clock_files = [_][]const u8{ "src/bench.zig", "src/commands/serve/kept.zig" };

fn checkClocks(findings: *Findings, file: File) Allocator.Error!void {
    if (!file.isZig() or partOf(file.path) == null) return;
    if (contains(&wall_clock_files, file.path)) return;
    for ([_][]const u8{ ".real" ++ ".now", ".clock = .real" }) |text| {
        const place = std.mem.find(u8, file.source, text) orelse continue;
        try findings.add(file.path, lineIndex(file.source, place), "asks for the time of day", .{});
    }
}

test "no length of time is measured by a clock that can be set" {
    try expectTidy(checkClocks);
    const source = "\nconst now = Io.Clock.real" ++ ".now(io);";
    try expectFinding(checkClocks, "src/a.zig", source, "src/a.zig:2: asks for the time of day");
    try expectFinding(checkClocks, "src/bench.zig", source, null);
    try expectFinding(checkClocks, "src/a.zig", "const now = Io.Clock.awake.now(io);", null);
}

/// Lists the Zig files that no root leads to.
fn checkReached(findings: *Findings, files: []const File) Allocator.Error!void {
    const arena = findings.arena;
    var sources: std.array_hash_map.String(File) = .empty;
    for (files) |file| if (file.isZig()) try sources.put(arena, file.path, file);
    var reached: std.array_hash_map.String(void) = .empty;
    for (roots) |root| if (sources.contains(root)) try reached.put(arena, root, {});
    var index: usize = 0;
    while (index < reached.count()) : (index += 1) {
        const file = sources.get(reached.keys()[index]).?;
        for (try importsOf(arena, file)) |import| {
            const path = try resolve(arena, file.path, import.name);
            if (sources.contains(path)) try reached.put(arena, path, {});
        }
    }
    for (sources.keys()) |path| {
        if (!reached.contains(path)) try findings.add(path, 0, "no root leads to this file", .{});
    }
}

test "every Zig file is reached from a root" {
    var arena_state: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena_state.deinit();
    var findings: Findings = .{ .arena = arena_state.allocator() };
    try checkReached(&findings, try readTree(findings.arena));
    try expectNone(findings);
}

test "a dead file is found" {
    var arena_state: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena_state.deinit();
    var findings: Findings = .{ .arena = arena_state.allocator() };
    try checkReached(&findings, &.{
        .{ .path = "src/main.zig", .source = "const a = @import(\"a.zig\");" },
        .{ .path = "src/a.zig", .source = "const b = @import(\"b/b.zig\");" },
        .{ .path = "src/b/b.zig", .source = "const a = @import(\"../a.zig\");" },
        .{ .path = "src/b/dead.zig", .source = "const a = @import(\"../a.zig\");" },
    });
    try testing.expectEqual(1, findings.lines.items.len);
    try testing.expectEqualStrings(
        "src/b/dead.zig:1: no root leads to this file",
        findings.lines.items[0],
    );
}

fn checkHeader(findings: *Findings, file: File) Allocator.Error!void {
    if (!file.isZig() or std.mem.startsWith(u8, file.source, "//! ")) return;
    try findings.add(file.path, 0, "does not begin with //!", .{});
}

test "every Zig file begins with what it is for" {
    try expectTidy(checkHeader);
}

test "a file without a header is found" {
    const finding = "src/a.zig:1: does not begin with //!";
    try expectFinding(checkHeader, "src/a.zig", "const a = 1;\n//! Late.\n", finding);
    try expectFinding(checkHeader, "src/a.zig", "", finding);
    try expectFinding(checkHeader, "src/a.zig", "//! In time.\n", null);
}

fn checkLines(findings: *Findings, file: File) Allocator.Error!void {
    if (file.source.len != 0 and !std.mem.endsWith(u8, file.source, "\n")) {
        try findings.add(file.path, lineIndex(file.source, file.source.len), "no newline at the " ++
            "end of the file", .{});
    }
    var lines = std.mem.splitScalar(u8, file.source, '\n');
    var line_index: usize = 0;
    while (lines.next()) |line| : (line_index += 1) {
        if (std.mem.endsWith(u8, line, " ") or std.mem.endsWith(u8, line, "\t") or
            std.mem.endsWith(u8, line, "\r"))
        {
            try findings.add(file.path, line_index, "white space at the end of the line", .{});
        }
        if (!file.isCode()) continue;
        const column_count = std.unicode.utf8CountCodepoints(line) catch line.len;
        if (column_count > column_count_max) {
            try findings.add(file.path, line_index, "{d} columns", .{column_count});
        }
    }
}

test "lines are short and end where their text ends" {
    try expectTidy(checkLines);
}

test "a long line and trailing white space are found" {
    const dash_100: [100]u8 = @splat('-');
    try expectFinding(checkLines, "a.c", dash_100 ++ "\n", null);
    try expectFinding(checkLines, "a.c", "\n" ++ dash_100 ++ "-\n", "a.c:2: 101 columns");
    try expectFinding(checkLines, "a.md", dash_100 ++ "-\n", null);
    try expectFinding(checkLines, "a.zig", dash_100[1..] ++ "é\n", null);
    const white_space = "a.md:1: white space at the end of the line";
    try expectFinding(checkLines, "a.md", "a \nb\n", white_space);
    try expectFinding(checkLines, "a.md", "a\t\nb\n", white_space);
    try expectFinding(checkLines, "a.md", "a\r\n", white_space);
    try expectFinding(checkLines, "a.md", "a\nb", "a.md:2: no newline at the end of the file");
    try expectFinding(checkLines, "a.md", "", null);
}

fn checkWords(findings: *Findings, file: File) Allocator.Error!void {
    if (file.isCode()) for (unfinished_words) |word| {
        var position: usize = 0;
        while (std.mem.findPos(u8, file.source, position, word)) |start| {
            position = start + word.len;
            const is_whole = (start == 0 or !std.ascii.isAlphanumeric(file.source[start - 1])) and
                !std.ascii.isAlphanumeric(file.source[position]);
            if (!is_whole) continue;
            try findings.add(file.path, lineIndex(file.source, start), "{s}", .{word});
        }
    };
    for (unwanted_texts) |unwanted| {
        var position: usize = 0;
        while (std.mem.findPos(u8, file.source, position, unwanted.text)) |start| {
            position = start + unwanted.text.len;
            try findings.add(file.path, lineIndex(file.source, start), "'{s}' {s}", .{
                unwanted.text, unwanted.reason,
            });
        }
    }
}

test "nothing is left unfinished, and no file names a registry's host or a machine's path" {
    try expectTidy(checkWords);
}

test "an unfinished piece, a registry's host and a machine's path are found" {
    const word = unfinished_words[0];
    try expectFinding(checkWords, "a.zig", "\n// " ++ word ++ ": this\n", "a.zig:2: " ++ word);
    try expectFinding(checkWords, "a.zig", "const MAS" ++ word ++ " = 1;\n", null);
    try expectFinding(checkWords, "a.md", word ++ "\n", null);
    inline for (unwanted_texts) |unwanted| {
        const finding = "a.md:1: '" ++ unwanted.text ++ "' " ++ unwanted.reason;
        try expectFinding(checkWords, "a.md", "see " ++ unwanted.text ++ "\n", finding);
    }
}

fn checkFunctions(findings: *Findings, file: File) Allocator.Error!void {
    if (!file.isZig()) return;
    const tree: Ast = try .parse(findings.arena, file.source, .{ .mode = .zig });
    for (tree.nodes.items(.tag), 0..) |tag, node_index| {
        if (tag != .fn_decl) continue;
        const node: Ast.Node.Index = @fromBackingInt(@intCast(node_index));
        var buffer: [1]Ast.Node.Index = undefined;
        const prototype = tree.fullFnProto(&buffer, node).?;
        const first = tree.tokenStart(prototype.firstToken());
        const first_line_index = lineIndex(file.source, first);
        const last_line_index = lineIndex(file.source, tree.tokenStart(tree.lastToken(node)));
        const line_count = last_line_index - first_line_index + 1;
        const name = if (prototype.name_token) |token| tree.tokenSlice(token) else "?";
        if (makesType(&tree, &prototype)) {
            // As long as its functions, which are measured one by one, but within its own limit.
            if (line_count > genericLimit(file.path, name)) {
                try findings.add(file.path, first_line_index, "the type of '{s}' has {d} lines", .{
                    name, line_count,
                });
            }
            continue;
        }
        if (line_count <= function_line_count_max) continue;
        if (isExcused(file.source[0..first])) continue;
        try findings.add(file.path, first_line_index, "'{s}' has {d} lines", .{ name, line_count });
    }
}

fn makesType(tree: *const Ast, prototype: *const Ast.full.FnProto) bool {
    const result = prototype.ast.return_type.unwrap() orelse return false;
    return std.mem.eql(u8, tree.getNodeSource(result), "type");
}

fn genericLimit(path: []const u8, name: []const u8) usize {
    for (long_generics) |row| {
        if (std.mem.eql(u8, row.path, path) and std.mem.eql(u8, row.name, name)) return row.lines;
    }
    return generic_line_count_max;
}

/// Lists the exceptions that are none any more.
fn checkLongGenerics(findings: *Findings, files: []const File) Allocator.Error!void {
    for (long_generics) |row| {
        const file = for (files) |file| {
            if (std.mem.eql(u8, file.path, row.path)) break file;
        } else {
            try findings.add(row.path, 0, "is an exception of tidy's and not there", .{});
            continue;
        };
        // What is found at a path without exceptions is what the exception is for.
        var without: Findings = .{ .arena = findings.arena };
        try checkFunctions(&without, .{ .path = "a.zig", .source = file.source });
        const needle = try findings.arena.print("'{s}'", .{row.name});
        for (without.lines.items) |line| {
            if (std.mem.find(u8, line, needle) != null) break;
        } else try findings.add(row.path, 0, "'{s}' needs no exception", .{row.name});
    }
}

/// Whether the comment that ends `before` gives the reason of a long function: `Long: ...`.
fn isExcused(before: []const u8) bool {
    var lines = std.mem.splitBackwardsScalar(u8, before, '\n');
    // The start of the function's own line.
    _ = lines.next();
    while (lines.next()) |line| {
        const comment = std.mem.trimStart(u8, line, " ");
        if (!std.mem.startsWith(u8, comment, "//")) return false;
        if (std.mem.find(u8, comment, "Long: ") != null) return true;
    }
    return false;
}

test "functions fit a screen or say why not" {
    try expectTidy(checkFunctions);
}

test "every exception for a long type is one" {
    var arena_state: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena_state.deinit();
    var findings: Findings = .{ .arena = arena_state.allocator() };
    try checkLongGenerics(&findings, try readTree(findings.arena));
    try expectNone(findings);
    const first = long_generics[0];
    try checkLongGenerics(&findings, &.{.{ .path = first.path, .source = "fn F() type {}\n" }});
    try testing.expectEqual(long_generics.len, findings.lines.items.len);
    const expected = first.path ++ ":1: '" ++ first.name ++ "' needs no exception";
    try testing.expectEqualStrings(expected, findings.lines.items[0]);
}

test "a long function is found" {
    const rule = checkFunctions;
    const body: [68]u8 = @splat('\n');
    try expectFinding(rule, "a.zig", "fn f() void {" ++ body ++ "\n}\n", null);
    const finding = "a.zig:2: 'f' has 71 lines";
    try expectFinding(rule, "a.zig", "\nfn f() void {" ++ body ++ "\n\n}\n", finding);
    try expectFinding(rule, "a.zig", "const T = struct {\n    pub fn f() void {" ++ body ++
        "\n\n    }\n};\n", finding);
    try expectFinding(rule, "a.zig", "/// Does it.\n/// Long: one loop.\npub fn f() void {" ++
        body ++ "\n\n}\n", null);
    try expectFinding(rule, "a.zig", "// Long: another one.\nconst a = 1;\nfn f() void {" ++
        body ++ "\n\n}\n", "a.zig:3: 'f' has 71 lines");
    try expectFinding(rule, "a.zig", "fn F() type {\n    return struct {" ++ body ++
        "\n    };\n}\n", null);
    const lines: [generic_line_count_max - 1]u8 = @splat('\n');
    try expectFinding(rule, "a.zig", "fn F() type {" ++ lines ++ "}\n", null);
    try expectFinding(
        rule,
        "a.zig",
        "fn F() type {\n" ++ lines ++ "}\n",
        "a.zig:1: the type of 'F' has 251 lines",
    );
}
