//! What the commands say: reports on standard output, messages in one line on standard error.

const std = @import("std");
const exit_code = @import("exit_code.zig");
const raylane = @import("raylane");
const Allocator = std.mem.Allocator;
const signals = @import("../signals.zig");
const Account = raylane.memory_account.Account;
const Diagnostic = raylane.diagnostic.Diagnostic;
const ExitCode = exit_code.ExitCode;
const Io = std.Io;
const Target = raylane.output.Target;
const assert = std.debug.assert;
const printable = raylane.diagnostic.printable;

/// Prints what was asked for to standard output.
pub fn print(io: Io, text: []const u8) ExitCode {
    var diagnostic: Diagnostic = .{};
    writeToStdout(io, text, &diagnostic) catch {
        say(io, "raylane: standard output: {s}\n", .{diagnostic.message.text()});
        return .failed;
    };
    return .ok;
}

/// Whether standard output is a terminal: nobody wants a picture there, and this says so.
pub fn isTerminal(io: Io) bool {
    if (!(Io.File.stdout().isTty(io) catch false)) return false;
    say(io, "raylane: standard output is a terminal, where no picture goes; see -o\n", .{});
    return true;
}

/// Prints what a function writes.
pub fn printBy(gpa: std.mem.Allocator, io: Io, write: anytype, arguments: anytype) ExitCode {
    var text: Io.Writer.Allocating = .init(gpa);
    defer text.deinit();
    @call(.auto, write, .{&text.writer} ++ arguments) catch return outOfMemory(io);
    return print(io, text.written());
}

/// Writes all of a text to standard output; the diagnostic says why it cannot.
pub fn writeToStdout(
    io: Io,
    text: []const u8,
    diagnostic: *Diagnostic,
) raylane.output.TargetError!void {
    var target: Target = .openStdout(io);
    return target.finish(&.{text}, diagnostic);
}

/// Prints the JSON of what went wrong, to standard error where a picture has the output. In words
/// it has been said already.
pub fn printFailure(
    gpa: Allocator,
    io: Io,
    failure: *const raylane.report.Failure,
    to_stderr: bool,
) void {
    var text: Io.Writer.Allocating = .init(gpa);
    defer text.deinit();
    raylane.report.writeFailure(failure, &text.writer) catch return;
    if (to_stderr) say(io, "{s}", .{text.written()}) else _ = print(io, text.written());
}

/// Says something of a scene.
pub fn sayOf(io: Io, scene: []const u8, comptime format: []const u8, arguments: anytype) void {
    const title = printable(raylane.parse.title(scene));
    say(io, "raylane: {f}: " ++ format ++ "\n", .{title} ++ arguments);
}

/// Says how many warnings of a scene there was no room for.
pub fn sayDropped(io: Io, scene: []const u8, diagnostic: *const Diagnostic) void {
    const count = diagnostic.warning_dropped_count;
    if (count > 0) sayOf(io, scene, "warning: {d} more", .{count});
}

/// Writes to standard error, in place of the progress that may be shown there until it is drawn
/// again. When that fails there is nobody left to tell.
pub fn say(io: Io, comptime format: []const u8, arguments: anytype) void {
    var buffer: [512]u8 = undefined;
    const stderr = io.lockStderr(&buffer, null) catch return;
    defer io.unlockStderr();
    const writer = &stderr.file_writer.interface;
    signals.progress_line.erase(writer) catch return;
    writer.print(format, arguments) catch return;
    writer.flush() catch return;
}

/// Says that there is no memory.
pub fn outOfMemory(io: Io) ExitCode {
    say(io, "raylane: out of memory\n", .{});
    return .failed;
}

/// Says why a file could not be had.
pub fn fail(
    account: *const Account,
    io: Io,
    file: []const u8,
    err: exit_code.Error,
    diagnostic: *Diagnostic,
) ExitCode {
    if (err == error.OutOfMemory) account.explain(&diagnostic.message);
    const text = diagnostic.message.text();
    assert(text.len > 0);
    say(io, "raylane: {f}: {s}\n", .{ printable(file), text });
    return .of(err);
}

/// Where an error of a scene is: a place in its text, or the file as a whole.
pub fn placeOf(diagnostic: *const Diagnostic, scene: []const u8) []const u8 {
    const place = diagnostic.place.text();
    return if (place.len > 0) place else raylane.parse.title(scene);
}
