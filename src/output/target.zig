//! Where an image goes: a file that is replaced as a whole, or standard output.
//!
//! A temporary file is created in the target's folder before anything is rendered, so that an
//! unwritable place is an error in the first second; it takes the target's name when all of it is
//! on the disk. Whatever goes wrong, the old file stays and nothing else does, also when a signal
//! ends the program: its handler calls `discardPending`.

const std = @import("std");
const Io = std.Io;
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const assert = std.debug.assert;

pub const Error = error{InputOutput};

/// Bytes of a file name at most, as on all usual file systems.
const name_bytes_max = 255;
/// Temporary names that are tried; a name is taken only if a crash left a file behind.
const attempt_count_max = 100;

/// What a signal handler has to remove.
const Pending = struct {
    /// Whether `folder` and `name` are set; written last, read first.
    armed: std.atomic.Value(bool) = .init(false),
    folder: std.posix.fd_t = -1,
    name: [name_bytes_max:0]u8 = undefined,
    length: usize = 0,

    fn path(self: *const Pending) []const u8 {
        return self.name[0..self.length];
    }
};

/// Global because a signal handler has no argument to find it by.
var pending: Pending = .{};

/// Unlinks the temporary file of the open target, if any. Async-signal-safe; the program must end
/// right after it.
pub fn discardPending() void {
    if (!pending.armed.load(.acquire)) return;
    _ = std.c.unlinkat(pending.folder, &pending.name, 0);
}

/// An image under way to its place. One at a time may be open.
pub const Target = struct {
    io: Io,
    state: State,

    const State = union(enum) {
        closed,
        stdout,
        file: struct {
            folder: Io.Dir,
            /// Name within the folder; the caller's memory.
            name: []const u8,
            /// Its name is in `pending`; null once it is closed.
            temporary: ?Io.File,
        },
    };

    /// Opens standard output as the target.
    pub fn openStdout(io: Io) Target {
        return .{ .io = io, .state = .stdout };
    }

    /// Creates the temporary file beside `path`, which must outlive the target. Asserts that no
    /// other file target is open. Errors: the folder does not exist or cannot be written, the
    /// target exists and is not a regular file, its name is too long.
    pub fn openFile(io: Io, path: []const u8, diagnostic: *Diagnostic) Error!Target {
        assert(!pending.armed.load(.monotonic));
        const name = std.fs.path.basename(path);
        if (name.len == 0 or path[path.len - 1] == '/') {
            return diagnostic.fail(error.InputOutput, "cannot write: not a file name", .{});
        }
        // `Io.Dir.statFile` holds a name too long for a bug of its caller.
        if (name.len > name_bytes_max) {
            return diagnostic.fail(error.InputOutput, "cannot write: name too long", .{});
        }
        const folder_path = std.fs.path.dirname(path) orelse ".";
        const folder = Io.Dir.cwd().openDir(io, folder_path, .{}) catch |err|
            return diagnostic.fail(error.InputOutput, "no access to its folder: {s}", .{
                reason(err),
            });
        errdefer folder.close(io);

        if (folder.statFile(io, name, .{ .follow_symlinks = false })) |stat| {
            if (stat.kind != .file) return diagnostic.fail(
                error.InputOutput,
                "cannot write: it exists and is not a regular file",
                .{},
            );
        } else |err| if (err != error.FileNotFound) {
            return diagnostic.fail(error.InputOutput, "cannot write: {s}", .{reason(err)});
        }
        return .{ .io = io, .state = .{ .file = .{
            .folder = folder,
            .name = name,
            .temporary = try createTemporary(io, folder, name, diagnostic),
        } } };
    }

    /// Writes the parts one after another; a file is then flushed to the disk and renamed to its
    /// place. Closes the target; on an error it is abandoned.
    pub fn finish(
        target: *Target,
        parts: []const []const u8,
        diagnostic: *Diagnostic,
    ) Error!void {
        assert(target.state != .closed);
        defer target.abandon();
        const io = target.io;
        const file: Io.File = switch (target.state) {
            .closed => unreachable,
            .stdout => .stdout(),
            .file => |state| state.temporary.?,
        };
        for (parts) |part| writeAll(io, file, part) catch |err|
            return diagnostic.fail(error.InputOutput, "cannot write: {s}", .{reason(err)});
        if (target.state == .stdout) return;

        file.sync(io) catch |err|
            return diagnostic.fail(error.InputOutput, "cannot write: {s}", .{reason(err)});
        target.state.file.temporary = null;
        // `Io.File.close` hides the result, which some network file systems say a full disk by.
        if (std.c.close(file.handle) != 0 and std.posix.errno(-1) != .INTR) {
            return diagnostic.fail(error.InputOutput, "cannot write: closing failed", .{});
        }
        const folder = target.state.file.folder;
        folder.rename(pending.path(), folder, target.state.file.name, io) catch |err|
            return diagnostic.fail(error.InputOutput, "cannot replace: {s}", .{reason(err)});
        pending.armed.store(false, .release);
        syncFolder(io, folder);
    }

    /// Closes the target and removes what has not taken its place. Does nothing on a closed one.
    pub fn abandon(target: *Target) void {
        switch (target.state) {
            .closed, .stdout => {},
            .file => |state| {
                discardPending();
                pending.armed.store(false, .release);
                if (state.temporary) |temporary| temporary.close(target.io);
                state.folder.close(target.io);
            },
        }
        target.state = .closed;
    }
};

/// Writes all bytes, however few the system takes at a time.
fn writeAll(io: Io, file: Io.File, bytes: []const u8) Io.File.Writer.Error!void {
    var rest = bytes;
    while (rest.len > 0) {
        const written = file.writeStreaming(io, &.{}, &.{rest}, 1) catch |err| switch (err) {
            // Somebody gave us a pipe that does not wait by itself.
            error.WouldBlock => {
                var writable = [_]std.posix.pollfd{.{
                    .fd = file.handle,
                    .events = std.posix.POLL.OUT,
                    .revents = 0,
                }};
                _ = std.posix.poll(&writable, -1) catch return error.WouldBlock;
                continue;
            },
            else => return err,
        };
        rest = rest[written..];
    }
}

/// Creates `.NAME.PID-ATTEMPT.tmp` and arms `pending` with it.
fn createTemporary(
    io: Io,
    folder: Io.Dir,
    name: []const u8,
    diagnostic: *Diagnostic,
) Error!Io.File {
    const kept = name[0..@min(name.len, name_bytes_max - 40)];
    pending.folder = folder.handle;
    var attempt: u32 = 0;
    while (true) : (attempt += 1) {
        pending.armed.store(false, .release);
        const path = std.mem.printSentinel(&pending.name, ".{s}.{d}-{d}.tmp", .{
            kept, std.c.getpid(), attempt,
        }, 0) catch unreachable; // 30 bytes at most beside `kept`.
        pending.length = path.len;
        // Armed before it exists: there is no moment when a signal would leave it behind.
        pending.armed.store(true, .release);
        // Exclusive creation does not follow a symbolic link either.
        return folder.createFile(io, path, .{ .exclusive = true }) catch |err| {
            pending.armed.store(false, .release);
            if (err == error.PathAlreadyExists and attempt + 1 < attempt_count_max) continue;
            return diagnostic.fail(error.InputOutput, "cannot write: {s}", .{reason(err)});
        };
    }
}

/// Flushes the renaming to the disk. Not all file systems can, and the file is in place by then:
/// what fails here is no error.
fn syncFolder(io: Io, folder: Io.Dir) void {
    const readable = folder.openDir(io, ".", .{ .iterate = true }) catch return;
    defer readable.close(io);
    _ = std.c.fsync(readable.handle);
}

const reasons: std.StaticStringMap([]const u8) = .initComptime(.{
    .{ "AccessDenied", "permission denied" },
    .{ "BadPathName", "not a file name" },
    .{ "BrokenPipe", "nobody reads it" },
    .{ "DeviceBusy", "device busy" },
    .{ "DiskQuota", "disk quota exceeded" },
    .{ "FileNotFound", "no such file or directory" },
    .{ "FileTooBig", "file too large" },
    .{ "InputOutput", "input/output error" },
    .{ "IsDir", "it is a directory" },
    .{ "NameTooLong", "name too long" },
    .{ "NoSpaceLeft", "no space left on the device" },
    .{ "NotDir", "not a directory" },
    .{ "NotOpenForWriting", "it is closed" },
    .{ "PermissionDenied", "permission denied" },
    .{ "ProcessFdQuotaExceeded", "too many open files" },
    .{ "ReadOnlyFileSystem", "read-only file system" },
    .{ "SymLinkLoop", "too many symbolic links" },
    .{ "SystemFdQuotaExceeded", "too many open files" },
    .{ "SystemResources", "the system is out of resources" },
});

/// An error of the file system in words.
fn reason(err: anytype) []const u8 {
    const name = @errorName(err);
    return reasons.get(name) orelse name;
}

/// A folder for a test, and paths into it.
const TestFolder = struct {
    folder: std.testing.TmpDir,
    buffer: [std.fs.max_path_bytes]u8 = undefined,

    fn init() TestFolder {
        return .{ .folder = std.testing.tmpDir(.{ .iterate = true }) };
    }

    fn path(self: *TestFolder, name: []const u8) ![]const u8 {
        const length = try self.folder.dir.realPath(std.testing.io, &self.buffer);
        const rest = try std.mem.print(self.buffer[length..], "/{s}", .{name});
        return self.buffer[0 .. length + rest.len];
    }

    /// Expects exactly one entry, a file with these contents.
    fn expectOnly(self: *TestFolder, name: []const u8, contents: []const u8) !void {
        const io = std.testing.io;
        var buffer: [64]u8 = undefined;
        const found = try self.folder.dir.readFile(io, name, &buffer);
        try std.testing.expectEqualStrings(contents, found);
        var entries = self.folder.dir.iterate();
        while (try entries.next(io)) |entry| try std.testing.expectEqualStrings(name, entry.name);
    }
};

fn expectOpenFails(path: []const u8, needle: []const u8) !void {
    var diagnostic: Diagnostic = .{};
    const result = Target.openFile(std.testing.io, path, &diagnostic);
    try std.testing.expectError(error.InputOutput, result);
    const text = diagnostic.message.text();
    errdefer std.debug.print("{s}\n", .{text});
    try std.testing.expect(std.mem.find(u8, text, needle) != null);
}

test "a file is replaced as a whole, or not at all" {
    const io = std.testing.io;
    var test_folder: TestFolder = .init();
    defer test_folder.folder.cleanup();
    const dir = test_folder.folder.dir;
    const path = try test_folder.path("a.png");
    try dir.writeFile(io, .{ .sub_path = "a.png", .data = "old" });
    var diagnostic: Diagnostic = .{};

    var abandoned: Target = try .openFile(io, path, &diagnostic);
    abandoned.abandon();
    abandoned.abandon();
    try test_folder.expectOnly("a.png", "old");

    var interrupted: Target = try .openFile(io, path, &diagnostic);
    discardPending();
    discardPending();
    try test_folder.expectOnly("a.png", "old");
    try std.testing.expectError(error.InputOutput, interrupted.finish(&.{"new"}, &diagnostic));
    try test_folder.expectOnly("a.png", "old");

    var finished: Target = try .openFile(io, path, &diagnostic);
    try finished.finish(&.{ "n", "", "ew" }, &diagnostic);
    finished.abandon();
    discardPending();
    try test_folder.expectOnly("a.png", "new");
}

test "places that cannot be written are refused before anything is done" {
    const io = std.testing.io;
    var test_folder: TestFolder = .init();
    defer test_folder.folder.cleanup();
    const dir = test_folder.folder.dir;
    try dir.createDir(io, "folder", .default_dir);
    try dir.symLink(io, "elsewhere", "link", .{});
    try expectOpenFails(try test_folder.path("folder"), "not a regular file");
    try expectOpenFails(try test_folder.path("folder/"), "not a file name");
    try expectOpenFails(try test_folder.path("link"), "not a regular file");
    try expectOpenFails(try test_folder.path("absent/a.png"), "folder: no such file");
    const long: [300]u8 = @splat('x');
    try expectOpenFails(try test_folder.path(&long), "name too long");
    try expectOpenFails(try test_folder.path(long ++ "/a.png"), "folder: name too long");
    try expectOpenFails(try test_folder.path("link/a.png"), "folder: no such file");
    try expectOpenFails("", "not a file name");
    try expectOpenFails("/", "not a file name");
    try expectOpenFails("/dev/null", "not a regular file");
}

test "a name as long as may be, and temporary files that a crash left" {
    const io = std.testing.io;
    var test_folder: TestFolder = .init();
    defer test_folder.folder.cleanup();
    const dir = test_folder.folder.dir;
    var diagnostic: Diagnostic = .{};
    const long: [name_bytes_max]u8 = @splat('x');
    var target: Target = try .openFile(io, try test_folder.path(&long), &diagnostic);
    try target.finish(&.{"long"}, &diagnostic);
    try test_folder.expectOnly(&long, "long");
    try dir.deleteFile(io, &long);

    var first: Target = try .openFile(io, try test_folder.path("a"), &diagnostic);
    var name_buffer: [name_bytes_max]u8 = undefined;
    const left = name_buffer[0..pending.length];
    @memcpy(left, pending.path());
    first.abandon();
    try dir.writeFile(io, .{ .sub_path = left, .data = "left" });
    var second: Target = try .openFile(io, try test_folder.path("a"), &diagnostic);
    try second.finish(&.{"second"}, &diagnostic);
    try dir.deleteFile(io, left);
    try test_folder.expectOnly("a", "second");
}
