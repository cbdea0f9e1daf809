//! The `main` of every test program: runs its tests one by one and tells on stderr how each went.
//!
//! In: the tests compiled into the program; of these, where there is an argument, those whose name
//! begins with it. Out: lines `::start NAME`, then `::pass`, `::skip` or
//! `::fail REASON`, and `::end` after the last; what a test prints, or a crash, stands in between.
//! `launch.zig` keeps the stream and `summary.zig` reads it; it is readable by eye too. A test
//! fails that returns an error, leaks from `std.testing.allocator`, logs an error or hangs.

const std = @import("std");
const builtin = @import("builtin");
const testing = std.testing;

/// A test that takes longer is ended, and its program with it (qemu is some 20 times slower).
const test_s_max = 600;

/// Counts logged errors; `std` looks this up in the root file, which a test runner is.
pub const std_options: std.Options = .{ .logFn = log };

var logged_error_count: usize = 0;

/// Runs the tests; the exit code is 0 whatever their results.
pub fn main(init: std.process.Init.Minimal) void {
    var arguments = init.args.iterate();
    _ = arguments.skip();
    const wanted = arguments.next() orelse "";
    for (builtin.test_functions) |test_function| {
        if (!std.mem.startsWith(u8, test_function.name, wanted)) continue;
        std.debug.print("::start {s}\n", .{test_function.name});
        const result = runOne(init, test_function.func);
        // A test's own output may not end its line.
        std.debug.print("\n::{t}", .{result});
        switch (result) {
            .pass, .skip => std.debug.print("\n", .{}),
            .fail => |reason| std.debug.print(" {s}\n", .{reason}),
        }
    }
    std.debug.print("::end\n", .{});
}

const Result = union(enum) { pass, skip, fail: []const u8 };

fn runOne(init: std.process.Init.Minimal, function: *const fn () anyerror!void) Result {
    testing.environ = init.environ;
    testing.log_level = .warn;
    testing.allocator_instance = .init(std.heap.page_allocator, .{
        .canary = 0xc3a701ba,
        .check_write_after_free = true,
    });
    testing.io_instance = .init(testing.allocator, .{
        .argv0 = .init(init.args),
        .environ = init.environ,
    });
    logged_error_count = 0;
    _ = std.c.alarm(test_s_max);

    const result: Result = if (function()) |_| .pass else |err| switch (err) {
        error.SkipZigTest => .skip,
        else => fail: {
            if (@errorReturnTrace()) |trace| std.debug.dumpErrorReturnTrace(trace);
            break :fail .{ .fail = @errorName(err) };
        },
    };

    _ = std.c.alarm(0);
    testing.io_instance.deinit();
    const leak_count = testing.allocator_instance.deinit();
    if (result == .fail) return result;
    if (leak_count != 0) return .{ .fail = "memory leaked" };
    if (logged_error_count != 0) return .{ .fail = "an error was logged" };
    return result;
}

fn log(
    comptime level: std.log.Level,
    comptime scope: @EnumLiteral(),
    comptime format: []const u8,
    arguments: anytype,
) void {
    if (level == .err) logged_error_count +|= 1;
    if (@backingInt(level) > @backingInt(testing.log_level)) return;
    std.debug.print("[{t}] ({t}): " ++ format ++ "\n", .{ scope, level } ++ arguments);
}
