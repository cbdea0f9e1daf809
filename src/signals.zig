//! Signals that end the program: its temporary files go with it.
//!
//! HUP, INT, QUIT, TERM and XCPU end it with 128 and the signal's number, as a shell says it of a
//! program that died of one. What was ignored when the program started stays so (nohup, the
//! background of a script). A file that reaches its size limit is an error of writing.

const std = @import("std");
const raylane = @import("raylane");
const SIG = std.posix.SIG;
const Sigaction = std.posix.Sigaction;

/// All that the program has open. Its only global variable that changes, for a signal handler has
/// no argument to find it by.
pub var temporary_files: raylane.output.TemporaryFiles = .{};

/// Called once, before there are files or threads.
pub fn catchAll() void {
    for ([_]SIG{ .HUP, .INT, .QUIT, .TERM, .XCPU }) |signal| {
        var before: Sigaction = undefined;
        std.posix.sigaction(signal, null, &before);
        if (before.handler.handler == SIG.IGN) continue;
        std.posix.sigaction(signal, &.{
            .handler = .{ .handler = end },
            .mask = std.posix.sigemptyset(),
            // The same signal once more ends what the first one waits for.
            .flags = std.posix.SA.NODEFER,
        }, null);
    }
    std.posix.sigaction(.XFSZ, &.{
        .handler = .{ .handler = SIG.IGN },
        .mask = std.posix.sigemptyset(),
        .flags = 0,
    }, null);
}

/// Only async-signal-safe calls are made here.
fn end(signal: SIG) callconv(.c) void {
    temporary_files.discardAll();
    std.c._exit(@intCast(128 + @backingInt(signal)));
}
