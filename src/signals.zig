//! Signals that end the program: its temporary files go with it, and so does its line of progress;
//! one line says what was kept.
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

/// All that the program has open. This and the other variables here are its only global ones that
/// change, for a signal handler has no argument to find them by.
pub var temporary_files: raylane.output.TemporaryFiles = .{};

/// How a signal stops the work rather than the program.
pub var stop: Stop = .{};

/// Whether a line of progress is on the terminal.
pub var progress_line: raylane.display.Line = .{};

/// What is said of files when a signal ends the program.
pub var outcome: Outcome = .{};

/// See `outcome`. Has one writer; a signal may come at any moment.
pub const Outcome = struct {
    texts: [2]raylane.diagnostic.Message = @splat(.{}),
    /// 0: nothing is said; else one more than the index of the text.
    current: std.atomic.Value(u8) = .init(0),

    /// Chooses what would be said from now on.
    pub fn set(chosen: *Outcome, comptime format: []const u8, arguments: anytype) void {
        const other = 1 - chosen.current.load(.monotonic) / 2;
        chosen.texts[other].set(format, arguments);
        chosen.current.store(@intCast(other + 1), .release);
    }

    /// From now on nothing would.
    pub fn clear(chosen: *Outcome) void {
        chosen.current.store(0, .release);
    }

    /// Async-signal-safe.
    fn say(chosen: *const Outcome, signal: SIG) void {
        const current = chosen.current.load(.acquire);
        if (current == 0) return;
        var line: [raylane.diagnostic.message_bytes_max + 64]u8 = undefined;
        var length: usize = 0;
        const text = chosen.texts[current - 1].text();
        for ([_][]const u8{ "raylane: ", verbOf(signal), ": ", text, "\n" }) |part| {
            @memcpy(line[length..][0..part.len], part);
            length += part.len;
        }
        _ = std.c.write(std.posix.STDERR_FILENO, &line, length);
    }
};

/// Ends the program with one line, as a signal does, after an answer for programs. Any thread may
/// call it.
pub fn endWith(answer: Answer, text: []const u8, code: u8) noreturn {
    temporary_files.discardAll();
    var rest = answer.text;
    while (rest.len > 0) {
        const count = std.c.write(answer.file, rest.ptr, rest.len);
        if (count <= 0) break;
        rest = rest[@intCast(count)..];
    }
    progress_line.close(std.posix.STDERR_FILENO);
    var line: [raylane.diagnostic.message_bytes_max + 1]u8 = undefined;
    @memcpy(line[0..text.len], text);
    line[text.len] = '\n';
    _ = std.c.write(std.posix.STDERR_FILENO, &line, text.len + 1);
    std.c._exit(code);
}

/// Lines of JSON, and where they go.
pub const Answer = struct { text: []const u8 = "", file: std.posix.fd_t = std.posix.STDOUT_FILENO };

/// What a signal does.
pub fn verbOf(signal: SIG) []const u8 {
    return switch (signal) {
        .INT => "interrupted",
        .TERM => "terminated",
        .HUP => "hung up",
        .QUIT => "quit",
        .XCPU => "out of CPU time",
        else => "ended",
    };
}

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
    progress_line.close(std.posix.STDERR_FILENO);
    outcome.say(signal);
    std.c._exit(@intCast(128 + @backingInt(signal)));
}
