//! A sandbox around the process, on Linux: files by Landlock, system calls by seccomp.
//!
//! In: what it is to read and to write. Out: a process that can do no more, for good, and in which
//! what is denied is an error like any other. A library has no business to do this to the program
//! that it is in: the program's commands do.

const std = @import("std");
const builtin = @import("builtin");
const landlock = @import("sandbox/landlock.zig");
const seccomp = @import("sandbox/seccomp.zig");
const linux = std.os.linux;

/// What a process is held by.
pub const Held = struct {
    /// Version of Landlock; 0: files are not held.
    landlock_abi: u32 = 0,
    /// System calls are.
    has_seccomp: bool = false,
};

/// One that is being set up, by a process of one thread.
pub const Sandbox = struct {
    /// Null: the kernel has no Landlock.
    rules: ?landlock.Ruleset,

    /// In which nothing can be opened; null: this system has none, or is an emulator.
    pub fn init() ?Sandbox {
        if (builtin.os.tag != .linux or !seccomp.isAvailable()) return null;
        var sandbox: Sandbox = .{ .rules = .create() };
        // A program that is checked tells where it was when it fails.
        if (std.debug.runtime_safety) sandbox.allow("/proc/self/exe", .{ .read_file = true });
        return sandbox;
    }

    fn allow(sandbox: *const Sandbox, path: []const u8, rights: landlock.Rights) void {
        if (sandbox.rules) |*rules| rules.allow(path, rights);
    }

    /// Allows to read a file, or all beneath a folder.
    pub fn allowReading(sandbox: *const Sandbox, path: []const u8) void {
        sandbox.allow(path, .{ .read_file = true, .read_dir = true });
    }

    /// Allows to write to what is there: a device or a pipe.
    pub fn allowWriting(sandbox: *const Sandbox, path: []const u8) void {
        sandbox.allow(path, .{ .write_file = true });
    }

    /// Allows to make, replace and remove files beneath a folder; to make folders, too.
    pub fn allowReplacing(sandbox: *const Sandbox, folder: []const u8, makes_folders: bool) void {
        sandbox.allow(folder, .{
            .write_file = true,
            .truncate = true,
            .make_reg = true,
            .remove_file = true,
            .make_dir = makes_folders,
            .read_dir = true,
        });
    }

    /// Closes it around the process, and says what holds.
    pub fn enter(sandbox: *Sandbox) Held {
        defer sandbox.deinit();
        const no_new_privileges = @backingInt(linux.PR.SET_NO_NEW_PRIVS);
        if (linux.errno(linux.prctl(no_new_privileges, 1, 0, 0, 0)) != .SUCCESS) return .{};
        var held: Held = .{};
        if (sandbox.rules) |*rules| {
            if (rules.enforce()) held.landlock_abi = rules.abi;
        }
        held.has_seccomp = seccomp.install();
        return held;
    }

    /// Does without.
    pub fn deinit(sandbox: *Sandbox) void {
        if (sandbox.rules) |*rules| rules.close();
        sandbox.* = undefined;
    }
};

const testing = std.testing;

/// Runs `check` in a process of its own: its answer is 0, or the number of the first thing that is
/// not as it should be.
fn expectInProcess(check: *const fn (folder: linux.fd_t) u8, folder: linux.fd_t) !void {
    const process = std.c.fork();
    if (process == 0) std.c._exit(check(folder));
    try testing.expect(process > 0);
    var status: c_int = undefined;
    while (std.c.waitpid(process, &status, 0) < 0) {}
    try testing.expectEqual(0, status);
}

fn open(folder: linux.fd_t, path: [*:0]const u8, flags: linux.O) linux.E {
    const answer = linux.openat(folder, path, flags, 0o600);
    const err = linux.errno(answer);
    if (err == .SUCCESS) _ = linux.close(@intCast(answer));
    return err;
}

fn checkFiles(folder: linux.fd_t) u8 {
    if (linux.errno(linux.fchdir(folder)) != .SUCCESS) return 1;
    var sandbox = Sandbox.init().?;
    sandbox.allowReading("in");
    sandbox.allowReading("single");
    sandbox.allowReplacing("out", false);
    if (sandbox.enter().landlock_abi == 0) return 2;
    const read: linux.O = .{};
    const write: linux.O = .{ .ACCMODE = .WRONLY };
    const create: linux.O = .{ .ACCMODE = .WRONLY, .CREAT = true, .EXCL = true };
    const Case = struct { linux.E, [*:0]const u8, linux.O };
    for ([_]Case{
        .{ .SUCCESS, "in/a", read },
        .{ .SUCCESS, "in/.", read },
        .{ .SUCCESS, "single", read },
        .{ .SUCCESS, "out/a", write },
        .{ .SUCCESS, "out/new", create },
        .{ .ACCES, "in/a", write },
        .{ .ACCES, "in/new", create },
        .{ .ACCES, "in/link", read },
        .{ .ACCES, "in/../other/a", read },
        .{ .ACCES, "out/a", read },
        .{ .ACCES, "other/a", read },
        .{ .ACCES, "other/new", create },
        .{ .ACCES, "single", write },
        .{ .ACCES, "/etc/passwd", read },
        .{ .NOENT, "other/none", read },
    }, 10..) |case, number| if (open(folder, case[1], case[2]) != case[0]) return @intCast(number);
    const renamed = linux.renameat2(folder, "out/new", folder, "out/a", .{});
    if (linux.errno(renamed) != .SUCCESS) return 3;
    const moved = linux.renameat2(folder, "out/a", folder, "in/b", .{});
    if (linux.errno(moved) == .SUCCESS) return 4;
    if (linux.errno(linux.unlinkat(folder, "in/a", 0)) != .ACCES) return 5;
    if (linux.errno(linux.mkdirat(folder, "out/d", 0o700)) != .ACCES) return 6;
    if (linux.errno(linux.unlinkat(folder, "out/a", 0)) != .SUCCESS) return 7;
    return 0;
}

test "beneath what is read and what is written there is nothing else" {
    const io = testing.io;
    {
        var probe = Sandbox.init() orelse return error.SkipZigTest;
        defer probe.deinit();
        if (probe.rules == null) return error.SkipZigTest;
    }
    var temporary = testing.tmpDir(.{});
    defer temporary.cleanup();
    for ([_][]const u8{ "in", "out", "other" }) |name|
        try temporary.dir.createDir(io, name, .default_dir);
    for ([_][]const u8{ "in/a", "out/a", "other/a", "single" }) |name|
        try temporary.dir.writeFile(io, .{ .sub_path = name, .data = "1" });
    try temporary.dir.symLink(io, "../other/a", "in/link", .{});
    try expectInProcess(checkFiles, temporary.dir.handle);
}

fn checkCalls(_: linux.fd_t) u8 {
    var sandbox = Sandbox.init().?;
    if (!sandbox.enter().has_seccomp) return 1;
    const E = linux.E;
    const process: usize = @intCast(linux.getppid());
    const own: usize = @intCast(linux.getpid());
    const thread_id: usize = @intCast(linux.gettid());
    const length = std.heap.page_size_max;
    for ([_]struct { E, usize }{
        .{ E.PERM, linux.syscall3(.socket, linux.AF.INET, linux.SOCK.STREAM, 0) },
        .{ E.PERM, linux.syscall3(.socket, linux.AF.UNIX, linux.SOCK.STREAM, 0) },
        .{ E.PERM, linux.syscall3(.execve, @intFromPtr("/bin/true"), 0, 0) },
        .{ E.PERM, linux.syscall5(.clone, @backingInt(linux.SIG.CHLD), 0, 0, 0, 0) },
        .{ E.NOSYS, linux.syscall2(.clone3, 0, 0) },
        .{ E.NOSYS, linux.syscall2(.io_uring_setup, 1, 0) },
        .{ E.PERM, linux.syscall2(.kill, process, 0) },
        .{ E.PERM, linux.syscall3(.tgkill, process, process, 0) },
        .{ E.PERM, linux.syscall4(.ptrace, 16, process, 0, 0) },
        .{ E.PERM, linux.syscall3(.bpf, 0, 0, 0) },
        .{ E.PERM, linux.syscall5(.perf_event_open, 0, 0, 0, 0, 0) },
        .{ E.PERM, linux.syscall5(.keyctl, 0, 0, 0, 0, 0) },
        .{ E.PERM, linux.syscall5(.mount, 0, 0, 0, 0, 0) },
        .{ E.PERM, linux.syscall3(.ioctl, 0, 0x5412, 0) },
        .{ E.PERM, linux.syscall3(.mprotect, 0, length, 4) },
        .{ E.SUCCESS, linux.syscall3(.tgkill, own, thread_id, 0) },
    }, 10..) |case, number| if (linux.errno(case[1]) != case[0]) return @intCast(number);
    // The filter is of the threads that come later, too, which can still be started.
    var seen: E = .SUCCESS;
    const Thread = struct {
        fn run(found: *E) void {
            found.* = linux.errno(linux.syscall3(.socket, linux.AF.INET, linux.SOCK.STREAM, 0));
        }
    };
    const thread = std.Thread.spawn(.{}, Thread.run, .{&seen}) catch return 2;
    thread.join();
    return if (seen == .PERM) 0 else 3;
}

test "what rendering does not need is denied, in all threads, and threads are not" {
    {
        var probe = Sandbox.init() orelse return error.SkipZigTest;
        probe.deinit();
    }
    try expectInProcess(checkCalls, -1);
}

test {
    _ = landlock;
    _ = seccomp;
}
