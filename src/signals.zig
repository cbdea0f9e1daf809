//! Signals that end the program: its temporary files go with it.
//!
//! While a picture is awaited that may be written before it is finished, the first INT or TERM asks
//! for it and no more.
//!
//! HUP, INT, QUIT, TERM and XCPU end it with 128 and the signal's number, as a shell says it of a
//! program that died of one. What was ignored when the program started stays so (nohup, the
//! background of a script). A file that reaches its size limit is an error of writing.

const std = @import("std");
const raylane = @import("raylane");
const SIG = std.posix.SIG;
const Sigaction = std.posix.Sigaction;

/// All that the program has open. This and `stop` are its only global variables that change, for a
/// signal handler has no argument to find them by.
pub var temporary_files: raylane.output.TemporaryFiles = .{};

/// How a signal stops the work rather than the program.
pub var stop: Stop = .{};

/// See `stop`.
pub const Stop = struct {
    /// Whether the next one does.
    is_awaited: std.atomic.Value(bool) = .init(false),
    /// Whether one has.
    is_asked: std.atomic.Value(bool) = .init(false),
    /// Which one.
    signal: std.atomic.Value(u8) = .init(0),
};

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
    if ((signal == .INT or signal == .TERM) and stop.is_awaited.swap(false, .acq_rel)) {
        stop.signal.store(@intCast(@backingInt(signal)), .monotonic);
        stop.is_asked.store(true, .release);
        return;
    }
    temporary_files.discardAll();
    std.c._exit(@intCast(128 + @backingInt(signal)));
}
