//! Keeps the input that ends the program: by a panic, a signal, or by taking too long.
//!
//! In: the input that is about to run. Out: where the program dies of it, a file `crash-HASH` or
//! `hang-HASH` in the folder of findings, and its name on standard error. Time is the processor's,
//! of the whole process, so that a busy machine is no hang.

const std = @import("std");
const posix = std.posix;
const linux = std.os.linux;

/// What a signal handler, which has no argument to find it by, looks at.
var current: Current = .{};

const Current = struct {
    input: []const u8 = "",
    /// With a slash at its end.
    folder: []const u8 = "",
    time_s_max: u32 = 0,
};

/// From now on, what ends the program is kept in `folder`, which ends in a slash; an input may take
/// `time_s_max` seconds.
pub fn start(folder: []const u8, time_s_max: u32) void {
    current.folder = folder;
    current.time_s_max = time_s_max;
    for ([_]posix.SIG{ .ABRT, .PROF }) |signal| posix.sigaction(signal, &.{
        .handler = .{ .handler = keep },
        .mask = posix.sigemptyset(),
        .flags = posix.SA.ONSTACK,
    }, null);
}

/// Before an input.
pub fn begin(input: []const u8) void {
    current.input = input;
    setTimer(current.time_s_max);
}

/// After it, while it is still there.
pub fn end() void {
    setTimer(0);
    current.input = "";
}

fn setTimer(seconds: u32) void {
    // Until there are seconds, nothing is watched.
    if (current.time_s_max == 0) return;
    _ = linux.setitimer(@backingInt(linux.ITIMER.PROF), &.{
        .it_interval = .{ .sec = 0, .nsec = 0 },
        .it_value = .{ .sec = @min(seconds, std.math.maxInt(i32)), .nsec = 0 },
    }, null);
}

/// Longest of `nameOf`.
pub const name_bytes_max = 64;

/// The name under which an input is kept; of a short kind.
pub fn nameOf(buffer: *[name_bytes_max]u8, kind: []const u8, input: []const u8) [:0]const u8 {
    const hash = std.hash.XxHash64.hash(0, input);
    return std.mem.printSentinel(buffer, "{s}-{x:0>16}", .{ kind, hash }, 0) catch unreachable;
}

fn keep(signal: posix.SIG) callconv(.c) void {
    const kind = if (signal == .PROF) "hang" else "crash";
    save(kind);
    // Of an abort, std has told where it came from.
    if (signal == .PROF) std.c._exit(1);
}

/// Writes the input that runs, by nothing but system calls, once there is a folder for it.
pub fn save(kind: []const u8) void {
    if (current.folder.len == 0) return;
    var path_buffer: [512]u8 = undefined;
    var name_buffer: [name_bytes_max]u8 = undefined;
    const name = nameOf(&name_buffer, kind, current.input);
    const path = std.mem.printSentinel(&path_buffer, "{s}{s}", .{ current.folder, name }, 0) catch
        return;
    const file = std.c.open(path, .{ .ACCMODE = .WRONLY, .CREAT = true, .TRUNC = true }, @as(
        c_uint,
        0o644,
    ));
    if (file < 0) return;
    var rest = current.input;
    while (rest.len > 0) {
        const count = std.c.write(file, rest.ptr, rest.len);
        if (count <= 0) break;
        rest = rest[@intCast(count)..];
    }
    _ = std.c.close(file);
    for ([_][]const u8{ "fuzz: ", kind, ": the input is ", path, "\n" }) |piece| {
        _ = std.c.write(posix.STDERR_FILENO, piece.ptr, piece.len);
    }
}
