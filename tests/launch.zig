//! Runs one test program and keeps all that it says, whatever becomes of it.
//!
//! In: `launch LOG SUITE TARGET [OPTION]... -- COMMAND...`. Out: LOG, beginning with
//! `::suite SUITE TARGET`, then the program's stdout and stderr, then `::stopped HOW` where it did
//! not end as a test program does. The exit code is 0 so that a failed test does not keep
//! `summary.zig` from counting the others; only a log that cannot be written is an error.
//!
//! Options: `--needs=PROGRAM` logs `::missing PROGRAM` where there is none; `--env=NAME=VALUE`;
//! `--one` makes the command itself the test, passed by exit code 0 and skipped by 77.

const std = @import("std");
const Io = std.Io;

/// A program that says more on one stream is ended.
const output_bytes_max = 16 << 20;

/// With which Automake's tests, too, say that they lack what they need.
const skipped_code = 77;

const Options = struct {
    log: []const u8,
    suite: []const u8,
    target: []const u8,
    needs: ?[]const u8 = null,
    one: bool = false,
    command: []const [:0]const u8,
};

/// Runs the command of the arguments and writes the log.
pub fn main(init: std.process.Init) !void {
    const io = init.io;
    const arena = init.arena.allocator();
    const arguments = try init.minimal.args.toSlice(arena);
    const options = try parse(arguments, init.environ_map);
    const log = try Io.Dir.cwd().createFile(io, options.log, .{});
    defer log.close(io);
    var buffer: [4096]u8 = undefined;
    var file_writer = log.writerStreaming(io, &buffer);
    const writer = &file_writer.interface;

    try writer.print("::suite {s} {s}\n", .{ options.suite, options.target });
    if (options.needs) |program| if (!isInstalled(arena, io, program)) {
        try writer.print("::missing {s}\n", .{program});
        return writer.flush();
    };
    if (options.one) try writer.print("::start {s}\n", .{options.suite});
    const result = std.process.run(arena, io, .{
        .argv = options.command,
        .environ_map = init.environ_map,
        .stdout_limit = .limited(output_bytes_max),
        .stderr_limit = .limited(output_bytes_max),
    }) catch |err| {
        try writer.print("::stopped before its end could be seen: {t}\n", .{err});
        return writer.flush();
    };
    try writer.writeAll(result.stdout);
    try writer.writeAll(result.stderr);
    if (options.one) {
        if (result.term.success()) {
            try writer.writeAll("\n::pass\n::end\n");
        } else if (std.meta.eql(result.term, .{ .exited = skipped_code })) {
            try writer.writeAll("\n::skip\n::end\n");
        } else {
            try writer.print("\n::fail {f}\n::end\n", .{result.term});
        }
    } else if (!result.term.success()) {
        try writer.print("\n::stopped {f}\n", .{result.term});
    }
    try writer.flush();
}

/// Splits the command line; `--env` goes into `environment`.
fn parse(
    arguments: []const [:0]const u8,
    environment: *std.process.Environ.Map,
) error{ Usage, OutOfMemory }!Options {
    const separator = for (arguments, 0..) |argument, index| {
        if (std.mem.eql(u8, argument, "--")) break index;
    } else return error.Usage;
    if (separator < 4 or separator + 1 == arguments.len) return error.Usage;
    var options: Options = .{
        .log = arguments[1],
        .suite = arguments[2],
        .target = arguments[3],
        .command = arguments[separator + 1 ..],
    };
    for (arguments[4..separator]) |argument| {
        if (std.mem.cutPrefix(u8, argument, "--env=")) |assignment| {
            const name, const value = std.mem.cut(u8, assignment, "=") orelse return error.Usage;
            try environment.put(name, value);
        } else if (std.mem.cutPrefix(u8, argument, "--needs=")) |program| {
            options.needs = program;
        } else if (std.mem.eql(u8, argument, "--one")) {
            options.one = true;
        } else return error.Usage;
    }
    return options;
}

fn isInstalled(arena: std.mem.Allocator, io: Io, program: []const u8) bool {
    const result = std.process.run(arena, io, .{ .argv = &.{ program, "--version" } }) catch
        return false;
    return result.term.success();
}
