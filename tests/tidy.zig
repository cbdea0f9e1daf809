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

/// What each part of `src` may import besides std, its own folder and `leaves`. A part is a file
/// of `src` with the folder of the same name; names without a file are modules of the build.
const directions = [_]struct { part: []const u8, may_import: []const []const u8 }{
    .{ .part = "main", .may_import = &.{ "raylane", "signals" } },
    .{ .part = "signals", .may_import = &.{"raylane"} },
    .{ .part = "kernel", .may_import = &.{ "config", "trace", "variant" } },
    .{ .part = "options", .may_import = &.{ "config", "variant" } },
    .{ .part = "variant", .may_import = &.{"config"} },
    .{ .part = "simd", .may_import = &.{"variant"} },
    .{ .part = "huge_pages", .may_import = &.{} },
    .{ .part = "math", .may_import = &.{} },
    .{ .part = "parallel", .may_import = &.{"simd"} },
    .{ .part = "parse", .may_import = &.{ "scene", "parallel", "builtin" } },
    .{ .part = "builtin", .may_import = &.{ "scene", "parallel" } },
    .{ .part = "scene", .may_import = &.{} },
    .{ .part = "prepare", .may_import = &.{ "scene", "world", "simd", "variant", "parallel" } },
    .{ .part = "world", .may_import = &.{} },
    .{ .part = "trace", .may_import = &.{ "world", "film", "variant", "simd", "parallel" } },
    .{ .part = "film", .may_import = &.{"image"} },
    .{ .part = "image", .may_import = &.{} },
    .{ .part = "memory_account", .may_import = &.{} },
    .{ .part = "output", .may_import = &.{ "image", "memory_account", "parallel" } },
    .{ .part = "report", .may_import = &.{ "config", "options", "variant", "world" } },
    .{ .part = "energy", .may_import = &.{} },
    .{
        // The second program, beside `main`, that leads scenes through all stages.
        .part = "bench",
        .may_import = &.{
            "parse", "prepare", "trace", "world", "film", "options", "variant", "energy",
        },
    },
    .{ .part = "diagnostic", .may_import = &.{} },
    .{ .part = "identity", .may_import = &.{} },
    .{ .part = "statistics", .may_import = &.{} },
};

/// Parts that import no other part and that all may import; `raylane` re-exports everything.
const leaves = [_][]const u8{
    "diagnostic", "huge_pages", "identity", "math", "statistics", "std", "builtin",
};

/// Folders of a part, and which others of its files each may import besides its own.
const rooms = [_]struct { room: []const u8, may_import: []const []const u8 }{
    .{ .room = "src/trace/traverse/", .may_import = &.{} },
    .{ .room = "src/trace/shade/", .may_import = &.{} },
    .{
        .room = "src/trace/integrate/",
        .may_import = &.{ "src/trace/traverse/", "src/trace/shade/" },
    },
};

/// Where the compiler starts to read; every other Zig file is imported from one of them.
const roots = [_][]const u8{
    "build.zig",
    "bench/kernels.zig",
    "bench/lowering.zig",
    "bench/parse.zig",
    "bench/rays.zig",
    "bench/structures.zig",
    "src/kernel.zig",
    "src/main.zig",
    "src/raylane.zig",
    "scenes/make.zig",
    "tests/cli.zig",
    "tests/integration.zig",
    "tests/launch.zig",
    "tests/runner.zig",
    "tests/stb_image.zig",
    "tests/summary.zig",
    "tests/tidy.zig",
};

const column_count_max = 100;
const function_line_count_max = 70;

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
        for ([_][]const u8{ ".zig", ".zon", ".c", ".h", ".py", ".sh", "" }) |code| {
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
        ".zig", ".zon", ".c",   ".h",    ".py",   ".sh", ".md",
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

fn contains(names: []const []const u8, name: []const u8) bool {
    for (names) |candidate| if (std.mem.eql(u8, candidate, name)) return true;
    return false;
}

fn checkDirections(findings: *Findings, file: File) Allocator.Error!void {
    if (!file.isZig()) return;
    const part = partOf(file.path) orelse return;
    if (std.mem.eql(u8, part, "raylane")) return;
    const may_import = for (directions) |row| {
        if (std.mem.eql(u8, row.part, part)) break row.may_import;
    } else return findings.add(file.path, 0, "'{s}' is not in tidy's table", .{part});
    for (try importsOf(findings.arena, file)) |import| {
        const target = if (std.mem.endsWith(u8, import.name, ".zig"))
            partOf(try resolve(findings.arena, file.path, import.name)) orelse import.name
        else
            import.name;
        if (std.mem.eql(u8, target, part)) continue;
        if (contains(&leaves, target) or contains(may_import, target)) continue;
        try findings.add(file.path, import.line_index, "'{s}' may not import '{s}'", .{
            part, target,
        });
    }
}

test "imports follow the way of the data" {
    try expectTidy(checkDirections);
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
        "src/trace.zig:1: 'trace' may not import 'cgltf'",
    );
    try expectFinding(rule, "src/new.zig", "", "src/new.zig:1: 'new' is not in tidy's table");
    try expectFinding(rule, "src/raylane.zig", "const a = @import(\"trace.zig\");", null);
}

fn checkRooms(findings: *Findings, file: File) Allocator.Error!void {
    const row = for (rooms) |row| {
        if (std.mem.startsWith(u8, file.path, row.room)) break row;
    } else return;
    const part = partOf(file.path).?;
    imports: for (try importsOf(findings.arena, file)) |import| {
        const path = try resolve(findings.arena, file.path, import.name);
        const target = partOf(path) orelse continue;
        if (!std.mem.eql(u8, target, part) or std.mem.startsWith(u8, path, row.room)) continue;
        for (row.may_import) |room| if (std.mem.startsWith(u8, path, room)) continue :imports;
        try findings.add(file.path, import.line_index, "'{s}' may not import '{s}'", .{
            row.room, path,
        });
    }
}

test "rooms of a part know each other in one direction" {
    try expectTidy(checkRooms);
}

test "an import against the direction of rooms is found" {
    try expectFinding(checkRooms, "src/trace/integrate/a.zig",
        \\const a = @import("../../world.zig");
        \\const b = @import("b.zig");
        \\const c = @import("../shade/c.zig");
        \\const d = @import("../../trace.zig");
    , "src/trace/integrate/a.zig:4: 'src/trace/integrate/' may not import 'src/trace.zig'");
    try expectFinding(checkRooms, "src/trace/shade/a.zig",
        \\const a = @import("../traverse/beam/b.zig");
    , "src/trace/shade/a.zig:1: 'src/trace/shade/' may not import " ++
        "'src/trace/traverse/beam/b.zig'");
    const down = "const a = @import(\"trace/shade/a.zig\");";
    try expectFinding(checkRooms, "src/trace.zig", down, null);
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
        // A generic type is as long as its functions, and those are measured one by one.
        if (prototype.ast.return_type.unwrap()) |result| {
            if (std.mem.eql(u8, tree.getNodeSource(result), "type")) continue;
        }
        const first = tree.tokenStart(prototype.firstToken());
        const first_line_index = lineIndex(file.source, first);
        const last_line_index = lineIndex(file.source, tree.tokenStart(tree.lastToken(node)));
        const line_count = last_line_index - first_line_index + 1;
        if (line_count <= function_line_count_max) continue;
        if (isExcused(file.source[0..first])) continue;
        const name = if (prototype.name_token) |token| tree.tokenSlice(token) else "?";
        try findings.add(file.path, first_line_index, "'{s}' has {d} lines", .{ name, line_count });
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
}
