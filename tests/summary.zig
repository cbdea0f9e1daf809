//! Adds up the logs of all test programs and closes with one line: `N passed, N failed`.
//!
//! In: `summary [--sources=src] LOG...`, logs as `launch.zig` and `runner.zig` write them. Out: on
//! stdout each failed test with its reason and what it printed, each suite that could not run, and
//! as the very last line the count over all of them; exit code 1 where a test failed. A log that
//! lacks its end counts as a failure of the test that was running. Tests that cannot run for want
//! of an emulator count as skipped, as many as the suite has on the host. With `--sources`, a
//! source file whose tests are in no log is a failure too: it hangs outside the root's test block.

const std = @import("std");
const Io = std.Io;
const Allocator = std.mem.Allocator;

/// More than `launch.zig` writes; a longer log is a failure.
const log_bytes_max = 64 << 20;

const Failure = struct {
    name: []const u8,
    reason: []const u8,
    /// What the test printed, trimmed.
    output: []const u8,
};

/// What one log says. The strings point into it.
const Suite = struct {
    suite: []const u8,
    target: []const u8,
    /// The emulator that is not installed, so that nothing ran.
    missing: ?[]const u8 = null,
    passed: usize = 0,
    skipped: usize = 0,
    failures: []const Failure,
    /// Every test that began.
    names: []const []const u8,
};

/// Reads the logs of the arguments and prints their sum.
pub fn main(init: std.process.Init) !u8 {
    const io = init.io;
    const arena = init.arena.allocator();
    const arguments = try init.minimal.args.toSlice(arena);
    var sources: ?[]const u8 = null;
    var suites: std.ArrayList(Suite) = .empty;
    for (arguments[1..]) |argument| {
        if (std.mem.cutPrefix(u8, argument, "--sources=")) |folder| {
            sources = folder;
            continue;
        }
        const limit: Io.Limit = .limited(log_bytes_max);
        const log = Io.Dir.cwd().readFileAlloc(io, argument, arena, limit) catch |err|
            try arena.print("::suite {s} -\n::stopped with a log that cannot be read: {t}\n", .{
                std.fs.path.basename(argument), err,
            });
        try suites.append(arena, try parse(arena, log));
    }
    if (sources) |folder| {
        const paths = try filesWithTests(arena, io, folder);
        try suites.append(arena, try unreached(arena, paths, suites.items));
    }

    var buffer: [4096]u8 = undefined;
    var stdout: Io.File.Writer = .initStreaming(.stdout(), io, &buffer);
    const failed_count = try print(&stdout.interface, suites.items);
    try stdout.interface.flush();
    return @intFromBool(failed_count != 0);
}

/// Reads one log. Whatever is wrong with it becomes a failure.
fn parse(arena: Allocator, log: []const u8) Allocator.Error!Suite {
    var suite: Suite = .{ .suite = "?", .target = "?", .failures = &.{}, .names = &.{} };
    var failures: std.ArrayList(Failure) = .empty;
    var names: std.ArrayList([]const u8) = .empty;
    var running: ?[]const u8 = null;
    var output_start: usize = 0;
    var has_ended = false;
    var stopped: ?[]const u8 = null;
    var output_end = log.len;

    var position: usize = 0;
    while (position < log.len) {
        const start = position;
        const line_end = std.mem.findScalarPos(u8, log, start, '\n') orelse log.len;
        position = @min(line_end + 1, log.len);
        const record = std.mem.cutPrefix(u8, log[start..line_end], "::") orelse continue;
        const word, const rest = std.mem.cutScalar(u8, record, ' ') orelse .{ record, "" };
        const output = std.mem.trim(u8, log[output_start..start], "\n");
        if (std.mem.eql(u8, word, "suite")) {
            suite.suite, suite.target = std.mem.cutScalar(u8, rest, ' ') orelse .{ rest, "" };
        } else if (std.mem.eql(u8, word, "missing")) {
            suite.missing = rest;
        } else if (std.mem.eql(u8, word, "start")) {
            try names.append(arena, rest);
            running = rest;
        } else if (std.mem.eql(u8, word, "pass") and running != null) {
            suite.passed += 1;
            running = null;
        } else if (std.mem.eql(u8, word, "skip") and running != null) {
            suite.skipped += 1;
            running = null;
        } else if (std.mem.eql(u8, word, "fail") and running != null) {
            try failures.append(arena, .{ .name = running.?, .reason = rest, .output = output });
            running = null;
        } else if (std.mem.eql(u8, word, "end")) {
            has_ended = true;
        } else if (std.mem.eql(u8, word, "stopped")) {
            stopped = rest;
            output_end = start;
            break;
        } else continue;
        output_start = position;
    }
    if (suite.missing == null and (!has_ended or running != null or stopped != null)) {
        try failures.append(arena, .{
            .name = running orelse "(no test)",
            .reason = stopped orelse "stopped without a word",
            .output = std.mem.trim(u8, log[output_start..output_end], "\n"),
        });
    }
    suite.failures = failures.items;
    suite.names = names.items;
    return suite;
}

/// Prints failures, suites that did not run, and the closing line; returns how many tests failed.
fn print(writer: *Io.Writer, suites: []const Suite) Io.Writer.Error!usize {
    var passed: usize = 0;
    var skipped: usize = 0;
    var failed: usize = 0;
    for (suites) |suite| {
        passed += suite.passed;
        skipped += suite.skipped;
        failed += suite.failures.len;
        for (suite.failures) |failure| {
            try writer.print("\nFAILED {s} {s}: {s}: {s}\n", .{
                suite.suite, suite.target, failure.name, failure.reason,
            });
            if (failure.output.len != 0) try writer.print("{s}\n", .{failure.output});
        }
    }
    for (suites) |suite| {
        const program = suite.missing orelse continue;
        const count = hostCount(suites, suite.suite);
        skipped += count;
        try writer.print("skipped {s} {s}: {d} tests, for {s} is not installed\n", .{
            suite.suite, suite.target, count, program,
        });
    }
    try writer.print("{d} passed, {d} failed", .{ passed, failed });
    if (skipped != 0) try writer.print(", {d} skipped", .{skipped});
    try writer.writeAll("\n");
    return failed;
}

/// How many tests the suite of this name has where it ran; 1 where it ran nowhere.
fn hostCount(suites: []const Suite, name: []const u8) usize {
    for (suites) |suite| {
        if (suite.missing == null and std.mem.eql(u8, suite.suite, name)) return suite.names.len;
    }
    return 1;
}

/// Paths of the Zig files in `folder` that have test blocks.
fn filesWithTests(arena: Allocator, io: Io, folder: []const u8) ![]const []const u8 {
    var paths: std.ArrayList([]const u8) = .empty;
    const directory = try Io.Dir.cwd().openDir(io, folder, .{ .iterate = true });
    defer directory.close(io);
    var walker = try directory.walk(arena);
    defer walker.deinit();
    while (try walker.next(io)) |entry| {
        if (entry.kind != .file or !std.mem.endsWith(u8, entry.path, ".zig")) continue;
        const source = try entry.dir.readFileAlloc(io, entry.basename, arena, .limited(1 << 20));
        if (!std.mem.startsWith(u8, source, "test ") and
            std.mem.find(u8, source, "\ntest ") == null) continue;
        try paths.append(arena, try std.fs.path.join(arena, &.{ folder, entry.path }));
    }
    return paths.items;
}

/// A suite of one test, that of each source file with tests at least one is in a log.
/// Test names are the file's path with dots, then `.test.` or `.decltest.` and its own name.
fn unreached(
    arena: Allocator,
    paths: []const []const u8,
    suites: []const Suite,
) Allocator.Error!Suite {
    var failures: std.ArrayList(Failure) = .empty;
    for (paths) |path| {
        const stem = try arena.dupe(u8, path[0 .. path.len - ".zig".len]);
        std.mem.replaceScalar(u8, stem, '/', '.');
        if (!hasTestOf(suites, stem)) try failures.append(arena, .{
            .name = path,
            .reason = "none of its tests ran: no test block of a file above refers to it",
            .output = "",
        });
    }
    return .{
        .suite = "reached",
        .target = "sources",
        .passed = @intFromBool(failures.items.len == 0),
        .failures = failures.items,
        .names = paths,
    };
}

fn hasTestOf(suites: []const Suite, stem: []const u8) bool {
    for (suites) |suite| for (suite.names) |name| {
        const rest = std.mem.cutPrefix(u8, name, stem) orelse continue;
        if (std.mem.startsWith(u8, rest, ".test") or
            std.mem.startsWith(u8, rest, ".decltest")) return true;
    };
    return false;
}

fn expectSummary(logs: []const []const u8, failed: usize, expected: []const u8) !void {
    var arena_state: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena_state.deinit();
    const arena = arena_state.allocator();
    var suites: std.ArrayList(Suite) = .empty;
    for (logs) |log| try suites.append(arena, try parse(arena, log));
    var text: Io.Writer.Allocating = .init(arena);
    try std.testing.expectEqual(failed, try print(&text.writer, suites.items));
    try std.testing.expectEqualStrings(expected, text.written());
}

test "all passed" {
    try expectSummary(&.{
        "::suite unit native\n::start a\n\n::pass\n::start b\n\n::pass\n::end\n",
        "::suite fmt native\n::start fmt\n\n::pass\n::end\n",
    }, 0, "3 passed, 0 failed\n");
}

test "a failure is named with its output, a skip is counted" {
    try expectSummary(
        &.{"::suite unit arm\n::start a\nfound 3\n\n::fail Unequal\n::start b\n\n::skip\n::end\n"},
        1,
        "\nFAILED unit arm: a: Unequal\nfound 3\n0 passed, 1 failed, 1 skipped\n",
    );
}

test "a crash fails the test that was running" {
    try expectSummary(
        &.{"::suite unit arm\n::start a\n\n::pass\n::start b\npanic: no\n\n::stopped by SEGV\n"},
        1,
        "\nFAILED unit arm: b: by SEGV\npanic: no\n1 passed, 1 failed\n",
    );
}

test "a log without an end is a failure, even an empty one" {
    try expectSummary(
        &.{ "::suite unit arm\n::start a\n\n::pass\n", "" },
        2,
        "\nFAILED unit arm: (no test): stopped without a word\n" ++
            "\nFAILED ? ?: (no test): stopped without a word\n1 passed, 2 failed\n",
    );
}

test "an error after the last test is a failure" {
    try expectSummary(
        &.{"::suite unit arm\n::start a\n\n::pass\n::end\n\n::stopped exited with code 1\n"},
        1,
        "\nFAILED unit arm: (no test): exited with code 1\n1 passed, 1 failed\n",
    );
}

test "without an emulator as many are skipped as the host has" {
    try expectSummary(
        &.{
            "::suite unit native\n::start a\n\n::pass\n::start b\n\n::skip\n::end\n",
            "::suite unit arm\n::missing qemu-arm\n",
            "::suite cli arm\n::missing qemu-arm\n",
        },
        0,
        "skipped unit arm: 2 tests, for qemu-arm is not installed\n" ++
            "skipped cli arm: 1 tests, for qemu-arm is not installed\n" ++
            "1 passed, 0 failed, 4 skipped\n",
    );
}

test "a source file whose tests did not run is found" {
    var arena_state: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena_state.deinit();
    const arena = arena_state.allocator();
    const log = "::suite unit native\n::start math.vec3.test.dot\n::pass\n" ++
        "::start simd.decltest.any\n::pass\n::end\n";
    const suites = [_]Suite{try parse(arena, log)};
    const paths = [_][]const u8{ "math/vec3.zig", "math.zig", "simd.zig" };
    const suite = try unreached(arena, &paths, &suites);
    try std.testing.expectEqual(1, suite.failures.len);
    try std.testing.expectEqualStrings("math.zig", suite.failures[0].name);
    try std.testing.expectEqual(0, suite.passed);
}
