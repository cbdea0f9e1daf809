//! Where an image goes: a file that is replaced as a whole, or something that takes a stream.
//!
//! A temporary file is created in the target's folder before anything is rendered, so that an
//! unwritable place is an error in the first second; it takes the target's name when all of it is
//! on the disk. Whatever goes wrong, the old file stays and nothing else does (temporary.zig).
//!
//! A symbolic link is followed: what it names is replaced, the link stays. A file keeps its
//! permissions, and one that must not be written is not replaced either. Standard output, open
//! descriptors (/dev/fd/N), pipes and devices are written where they stand. So is a file whose
//! folder takes no new ones or does not let it be replaced, such as a single file mounted into a
//! container: it is overwritten at the end, from memory, and only an error there can spoil it.

const std = @import("std");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Identity = @import("../identity.zig").Identity;
const systemReason = @import("../diagnostic.zig").systemReason;
const temporary_files = @import("temporary.zig");
const Io = std.Io;
const TemporaryFile = temporary_files.TemporaryFile;
const TemporaryFiles = temporary_files.TemporaryFiles;
const assert = std.debug.assert;

pub const Error = error{InputOutput};

const name_bytes_max = temporary_files.name_bytes_max;
/// As many symbolic links in a row as the system itself follows.
const link_count_max = 40;

/// An image under way to its place.
pub const Target = struct {
    io: Io,
    state: union(enum) {
        closed,
        /// Written where it stands.
        stream: Io.File,
        /// What is written to it comes behind all that has been written to another.
        part: *Target,
        file: Place,
    },
    /// The file that is there already: nobody should read it while this target is open.
    replaces: ?Identity,

    /// Opens standard output as the target.
    pub fn openStdout(io: Io) Target {
        return .ofStream(io, .stdout());
    }

    fn ofStream(io: Io, file: Io.File) Target {
        return .{ .io = io, .state = .{ .stream = file }, .replaces = .of(file.handle) };
    }

    /// Opens the place called `path`, with a file among `temporaries` until the target is closed.
    /// Errors: its folder does not exist or cannot be written, it is a folder or must not be
    /// written, its name is too long.
    pub fn openFile(
        io: Io,
        temporaries: *TemporaryFiles,
        path: []const u8,
        diagnostic: *Diagnostic,
    ) Error!Target {
        var place: Place = .{};
        errdefer place.close(io);
        var link_buffer: [Io.Dir.max_path_bytes]u8 = undefined;
        var rest = path;
        for (0..link_count_max) |_| {
            if (descriptorOf(rest)) |descriptor| {
                const file = duplicate(descriptor) catch |err| return fail(err, diagnostic);
                place.close(io);
                return .ofStream(io, file);
            }
            try place.enter(io, rest, diagnostic);
            place.existing = place.folder.openFile(io, place.name(), .{
                .mode = .write_only,
                .follow_symlinks = false,
            }) catch |err| switch (err) {
                error.FileNotFound => null,
                error.SymLinkLoop => {
                    rest = place.follow(io, &link_buffer) catch |why| return fail(why, diagnostic);
                    continue;
                },
                else => return fail(err, diagnostic),
            };
            return place.open(io, temporaries) catch |err| fail(err, diagnostic);
        }
        return fail(error.SymLinkLoop, diagnostic);
    }

    /// Writes the parts one after another; a file is then flushed to the disk and put in its place.
    /// Closes the target; on an error it is abandoned.
    pub fn finish(
        target: *Target,
        parts: []const []const u8,
        diagnostic: *Diagnostic,
    ) Error!void {
        defer target.abandon();
        switch (target.state) {
            .closed => unreachable,
            .part => |whole| whole.append(parts) catch |err| return fail(err, diagnostic),
            .stream => |file| writeAll(target.io, file, parts) catch |err|
                return fail(err, diagnostic),
            .file => |*place| place.replace(target.io, parts) catch |err|
                return fail(err, diagnostic),
        }
    }

    /// The next part of the target: what is written to it and finished comes behind all before it.
    /// The last part is what the target itself is finished with.
    pub fn part(target: *Target) Target {
        return .{ .io = target.io, .state = .{ .part = target }, .replaces = target.replaces };
    }

    fn append(target: *Target, parts: []const []const u8) Io.File.Writer.Error!void {
        switch (target.state) {
            .closed, .part => unreachable,
            .stream => |file| try writeAll(target.io, file, parts),
            .file => |*place| {
                const temporary = place.temporary;
                const file = if (temporary) |made| made.file else place.existing.?;
                try writeAll(target.io, file, parts);
                for (parts) |bytes| place.length += bytes.len;
            },
        }
    }

    /// Closes the target and removes what has not taken its place. Does nothing on a closed one.
    pub fn abandon(target: *Target) void {
        switch (target.state) {
            .closed, .part => {},
            .stream => |file| if (file.handle != Io.File.stdout().handle) file.close(target.io),
            .file => |*place| place.close(target.io),
        }
        target.state = .closed;
    }
};

/// A name in a folder, whatever has it now, and what shall have it.
const Place = struct {
    folder: Io.Dir = .cwd(),
    name_buffer: [name_bytes_max]u8 = undefined,
    name_length: usize = 0,
    /// Open for writing.
    existing: ?Io.File = null,
    /// Null: the existing file is overwritten.
    temporary: ?*TemporaryFile = null,
    /// Bytes that are written already.
    length: u64 = 0,

    fn name(place: *const Place) []const u8 {
        return place.name_buffer[0..place.name_length];
    }

    /// Goes on to `path`, from the folder where the place is so far.
    fn enter(place: *Place, io: Io, path: []const u8, diagnostic: *Diagnostic) Error!void {
        const last = std.fs.path.basename(path);
        if (last.len == 0 or path[path.len - 1] == '/') return fail(error.BadPathName, diagnostic);
        if (last.len > name_bytes_max) return fail(error.NameTooLong, diagnostic);
        const folder_path = std.fs.path.dirname(path) orelse ".";
        const folder = place.folder.openDir(io, folder_path, .{}) catch |err|
            return diagnostic.fail(error.InputOutput, "no access to its folder: {s}", .{
                systemReason(err),
            });
        place.closeFolder(io);
        place.folder = folder;
        @memcpy(place.name_buffer[0..last.len], last);
        place.name_length = last.len;
    }

    /// Where a symbolic link leads, unless the system forbids to follow it, as it does with those
    /// of others in folders that everybody may write.
    fn follow(place: *const Place, io: Io, buffer: []u8) ![]const u8 {
        if (place.folder.openFile(io, place.name(), .{ .path_only = true })) |file| {
            file.close(io);
        } else |err| if (err != error.FileNotFound) return err;
        return buffer[0..try place.folder.readLink(io, place.name(), buffer)];
    }

    fn open(place: *Place, io: Io, temporaries: *TemporaryFiles) !Target {
        var permissions: Io.File.Permissions = .default_file;
        var replaces: ?Identity = null;
        if (place.existing) |file| {
            const stat = try file.stat(io);
            if (stat.kind != .file) {
                place.closeFolder(io);
                return .ofStream(io, file);
            }
            permissions = .fromMode(stat.permissions.toMode() & 0o777);
            replaces = .of(file.handle);
        }
        const created = temporaries.create(io, place.folder, place.name(), permissions);
        place.temporary = created catch |err| switch (err) {
            error.AccessDenied, error.PermissionDenied, error.ReadOnlyFileSystem => created: {
                if (place.existing == null) return err;
                break :created null;
            },
            else => return err,
        };
        // The process may withhold some at creation. Not all file systems know permissions.
        if (place.temporary) |temporary| if (place.existing != null) {
            temporary.file.setPermissions(io, permissions) catch {};
        };
        return .{ .io = io, .state = .{ .file = place.* }, .replaces = replaces };
    }

    fn replace(place: *Place, io: Io, parts: []const []const u8) !void {
        if (place.temporary) |temporary| {
            try writeAll(io, temporary.file, parts);
            try flush(io, temporary.file);
            if (temporary.rename(io, place.name())) {
                place.temporary = null;
                return syncFolder(io, place.folder);
            } else |err| if (place.existing == null) return err;
        }
        const existing = place.existing.?;
        try writeAll(io, existing, parts);
        var length = place.length;
        for (parts) |part| length += part.len;
        try existing.setLength(io, length);
        try flush(io, existing);
    }

    fn close(place: *Place, io: Io) void {
        if (place.temporary) |temporary| temporary.discard(io);
        if (place.existing) |existing| existing.close(io);
        place.closeFolder(io);
    }

    fn closeFolder(place: *Place, io: Io) void {
        if (place.folder.handle != Io.Dir.cwd().handle) place.folder.close(io);
    }
};

/// The open descriptor that a path stands for. Its name in the file system would open a file anew,
/// from the start, and would not open a socket.
pub fn descriptorOf(path: []const u8) ?std.posix.fd_t {
    if (std.mem.eql(u8, path, "/dev/stdout")) return 1;
    if (std.mem.eql(u8, path, "/dev/stderr")) return 2;
    for ([_][]const u8{ "/dev/fd/", "/proc/self/fd/" }) |folder| {
        const digits = std.mem.cutPrefix(u8, path, folder) orelse continue;
        return std.fmt.parseUnsigned(u31, digits, 10) catch null;
    }
    return null;
}

fn duplicate(descriptor: std.posix.fd_t) !Io.File {
    const flags = std.c.fcntl(descriptor, std.c.F.GETFL);
    if (flags < 0) return error.NotOpenForWriting;
    const access: std.posix.O = @bitCast(flags);
    if (access.ACCMODE == .RDONLY) return error.NotOpenForWriting;
    // Not one of the standard three, which are never closed.
    const handle = std.c.fcntl(descriptor, std.c.F.DUPFD_CLOEXEC, @as(c_int, 3));
    if (handle < 0) return error.ProcessFdQuotaExceeded;
    return .{ .handle = handle, .flags = .{ .nonblocking = false } };
}

/// Writes all bytes, however few the system takes at a time.
fn writeAll(io: Io, file: Io.File, parts: []const []const u8) Io.File.Writer.Error!void {
    for (parts) |part| {
        var rest = part;
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
}

/// Waits until the file is on the disk.
fn flush(io: Io, file: Io.File) !void {
    try file.sync(io);
    // Some network file systems say a full disk when a file is closed: a duplicate is, for the file
    // itself keeps its lock.
    const copy = std.c.dup(file.handle);
    if (copy < 0 or std.c.close(copy) == 0) return;
    if (std.posix.errno(-1) != .INTR) return error.InputOutput;
}

/// Flushes the renaming to the disk. Not all file systems can, and the file is in place by then:
/// what fails here is no error.
fn syncFolder(io: Io, folder: Io.Dir) void {
    const readable = folder.openDir(io, ".", .{ .iterate = true }) catch return;
    defer readable.close(io);
    _ = std.c.fsync(readable.handle);
}

/// Says why nothing can be written.
fn fail(err: anytype, diagnostic: *Diagnostic) Error {
    return diagnostic.fail(error.InputOutput, "cannot write: {s}", .{systemReason(err)});
}

/// A folder for a test, paths into it, and its temporary files.
const TestFolder = struct {
    folder: std.testing.TmpDir,
    temporaries: TemporaryFiles = .{},
    diagnostic: Diagnostic = .{},
    buffer: [std.fs.max_path_bytes]u8 = undefined,

    fn init() TestFolder {
        return .{ .folder = std.testing.tmpDir(.{ .iterate = true }) };
    }

    fn path(self: *TestFolder, name: []const u8) ![]const u8 {
        const length = try self.folder.dir.realPath(std.testing.io, &self.buffer);
        const rest = try std.mem.print(self.buffer[length..], "/{s}", .{name});
        return self.buffer[0 .. length + rest.len];
    }

    fn open(self: *TestFolder, name: []const u8) !Target {
        const full = try self.path(name);
        return .openFile(std.testing.io, &self.temporaries, full, &self.diagnostic);
    }

    /// Expects exactly one entry, a file with these contents.
    fn expectOnly(self: *TestFolder, name: []const u8, contents: []const u8) !void {
        try self.expectFile(name, contents);
        var entries = self.folder.dir.iterate();
        while (try entries.next(std.testing.io)) |entry| {
            try std.testing.expectEqualStrings(name, entry.name);
        }
    }

    fn expectFile(self: *TestFolder, name: []const u8, contents: []const u8) !void {
        var buffer: [64]u8 = undefined;
        const found = try self.folder.dir.readFile(std.testing.io, name, &buffer);
        try std.testing.expectEqualStrings(contents, found);
    }

    fn expectOpenFails(self: *TestFolder, full: []const u8, needle: []const u8) !void {
        const io = std.testing.io;
        const result = Target.openFile(io, &self.temporaries, full, &self.diagnostic);
        try std.testing.expectError(error.InputOutput, result);
        const text = self.diagnostic.message.text();
        errdefer std.debug.print("{s}\n", .{text});
        try std.testing.expect(std.mem.find(u8, text, needle) != null);
    }
};

test "parts are one file, which is there when the last one is" {
    const io = std.testing.io;
    var folder: TestFolder = .init();
    defer folder.folder.cleanup();
    var whole = try folder.open("a.y4m");
    defer whole.abandon();
    for ([_][]const u8{ "one", "two" }) |text| {
        var part = whole.part();
        try part.finish(&.{ text, "," }, &folder.diagnostic);
        try std.testing.expectError(
            error.FileNotFound,
            folder.folder.dir.access(io, "a.y4m", .{}),
        );
    }
    try whole.finish(&.{}, &folder.diagnostic);
    try folder.expectOnly("a.y4m", "one,two,");
}

test "a file is replaced as a whole, or not at all" {
    const io = std.testing.io;
    var folder: TestFolder = .init();
    defer folder.folder.cleanup();
    try folder.folder.dir.writeFile(io, .{ .sub_path = "a.png", .data = "old" });

    var abandoned = try folder.open("a.png");
    abandoned.abandon();
    abandoned.abandon();
    try folder.expectOnly("a.png", "old");

    // Several at once, in any order.
    var first = try folder.open("a.png");
    var second = try folder.open("a.png");
    var third = try folder.open("b.png");
    try first.finish(&.{"first"}, &folder.diagnostic);
    try folder.expectFile("a.png", "first");
    third.abandon();
    try second.finish(&.{ "s", "", "econd" }, &folder.diagnostic);
    second.abandon();
    try folder.expectOnly("a.png", "second");

    const long: [name_bytes_max]u8 = @splat('x');
    var longest = try folder.open(&long);
    try longest.finish(&.{"long"}, &folder.diagnostic);
    try folder.expectFile(&long, "long");
    try folder.folder.dir.deleteFile(io, &long);

    var interrupted = try folder.open("a.png");
    folder.temporaries.discardAll();
    folder.temporaries.discardAll();
    try folder.expectOnly("a.png", "second");
    try folder.expectOpenFails(try folder.path("b.png"), "the program is ending");
    try folder.expectOnly("a.png", "second");
    interrupted.abandon();
}

test "a new file that lost its temporary is an error" {
    var folder: TestFolder = .init();
    defer folder.folder.cleanup();
    var interrupted = try folder.open("a.png");
    folder.temporaries.discardAll();
    const result = interrupted.finish(&.{"new"}, &folder.diagnostic);
    try std.testing.expectError(error.InputOutput, result);
    var entries = folder.folder.dir.iterate();
    try std.testing.expectEqual(null, try entries.next(std.testing.io));
}

test "a file is known again through links, and keeps its permissions" {
    const io = std.testing.io;
    var folder: TestFolder = .init();
    defer folder.folder.cleanup();
    const dir = folder.folder.dir;
    try dir.writeFile(io, .{ .sub_path = "a", .data = "old" });
    const old = try dir.openFile(io, "a", .{});
    const identity: ?Identity = .of(old.handle);
    try old.setPermissions(io, .fromMode(0o620));
    old.close(io);
    try dir.createDir(io, "b", .default_dir);
    try dir.symLink(io, "../a", "b/link", .{});
    try dir.symLink(io, "b/link", "link", .{});
    try dir.symLink(io, "new", "dangling", .{});

    var target = try folder.open("link");
    try std.testing.expect(Identity.eql(identity, target.replaces));
    try target.finish(&.{"new"}, &folder.diagnostic);
    try folder.expectFile("a", "new");
    const permissions = (try dir.statFile(io, "a", .{})).permissions;
    try std.testing.expectEqual(0o620, permissions.toMode() & 0o7777);
    for ([_][]const u8{ "link", "b/link" }) |name| {
        const stat = try dir.statFile(io, name, .{ .follow_symlinks = false });
        try std.testing.expectEqual(.sym_link, stat.kind);
    }

    var created = try folder.open("dangling");
    try std.testing.expectEqual(null, created.replaces);
    try created.finish(&.{"created"}, &folder.diagnostic);
    try folder.expectFile("new", "created");
}

test "an existing file is overwritten where it cannot be replaced" {
    const io = std.testing.io;
    var folder: TestFolder = .init();
    defer folder.folder.cleanup();
    try folder.folder.dir.writeFile(io, .{ .sub_path = "a", .data = "much longer" });
    var target = try folder.open("a");
    // As where the folder is read-only.
    target.state.file.temporary.?.discard(io);
    target.state.file.temporary = null;
    try target.finish(&.{ "ne", "w" }, &folder.diagnostic);
    try folder.expectOnly("a", "new");
    // As where another file system is mounted there: the temporary file cannot take the name.
    var busy = try folder.open("a");
    try folder.folder.dir.deleteFile(io, busy.state.file.temporary.?.path());
    try busy.finish(&.{"newest"}, &folder.diagnostic);
    try folder.expectOnly("a", "newest");
}

test "places that cannot be written are refused before anything is done" {
    const io = std.testing.io;
    var folder: TestFolder = .init();
    defer folder.folder.cleanup();
    const dir = folder.folder.dir;
    try dir.createDir(io, "folder", .default_dir);
    try dir.symLink(io, "elsewhere", "link", .{});
    try dir.symLink(io, "loop", "loop", .{});
    try dir.symLink(io, "folder/", "slash", .{});
    try folder.expectOpenFails(try folder.path("folder"), "it is a directory");
    try folder.expectOpenFails(try folder.path("folder/"), "not a file name");
    try folder.expectOpenFails(try folder.path("slash"), "not a file name");
    try folder.expectOpenFails(try folder.path("loop"), "too many symbolic links");
    try folder.expectOpenFails(try folder.path("absent/a.png"), "folder: no such file");
    const long: [300]u8 = @splat('x');
    try folder.expectOpenFails(try folder.path(&long), "name too long");
    try folder.expectOpenFails(try folder.path(long ++ "/a.png"), "folder: name too long");
    try folder.expectOpenFails(try folder.path("link/a.png"), "folder: no such file");
    try folder.expectOpenFails("", "not a file name");
    try folder.expectOpenFails("/", "not a file name");
    try folder.expectOpenFails(".", "it is a directory");
    try folder.expectOpenFails("/dev/fd/99999", "it is closed");
    try folder.expectOpenFails("/dev/fd/x", "cannot write");
}

test "pipes, devices and descriptors are written where they stand" {
    const io = std.testing.io;
    var folder: TestFolder = .init();
    defer folder.folder.cleanup();
    const dir = folder.folder.dir;
    try dir.symLink(io, "/dev/null", "null", .{});
    var device = try folder.open("null");
    try device.finish(&.{"lost"}, &folder.diagnostic);
    try std.testing.expectEqual(.sym_link, (try dir.statFile(io, "null", .{
        .follow_symlinks = false,
    })).kind);
    const stat = try dir.statFile(io, "null", .{});
    try std.testing.expectEqual(.character_device, stat.kind);
    var full: Target = try .openFile(io, &folder.temporaries, "/dev/full", &folder.diagnostic);
    const result = full.finish(&.{"lost"}, &folder.diagnostic);
    try std.testing.expectError(error.InputOutput, result);

    const file = try dir.createFile(io, "file", .{});
    defer file.close(io);
    try writeAll(io, file, &.{"before, "});
    var name: [32]u8 = undefined;
    for ([_][]const u8{ "/dev/fd/", "/proc/self/fd/" }) |start| {
        const path = try std.mem.print(&name, "{s}{d}", .{ start, file.handle });
        var target: Target = try .openFile(io, &folder.temporaries, path, &folder.diagnostic);
        try target.finish(&.{"picture, "}, &folder.diagnostic);
    }
    try writeAll(io, file, &.{"behind"});
    try folder.expectFile("file", "before, picture, picture, behind");
}

test "a small stack is enough" {
    var folder: TestFolder = .init();
    defer folder.folder.cleanup();
    const Thread = struct {
        result: anyerror!void = error.NotRun,

        fn run(thread: *@This(), test_folder: *TestFolder) void {
            thread.result = thread.replace(test_folder);
        }

        fn replace(_: *@This(), test_folder: *TestFolder) !void {
            for (0..2) |_| {
                var target = try test_folder.open("a");
                try target.finish(&.{"new"}, &test_folder.diagnostic);
            }
        }
    };
    var thread: Thread = .{};
    // A quarter of `ulimit -s 256`.
    const handle = try std.Thread.spawn(.{ .stack_size = 64 << 10 }, Thread.run, .{
        &thread, &folder,
    });
    handle.join();
    try thread.result;
    try folder.expectOnly("a", "new");
}
