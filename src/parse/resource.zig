//! The files of a scene, found, opened once and read whole, or refused with one reason.
//!
//! In: the path that the user names; then the paths that the scene names, relative to its folder
//! and below it unless the user allows others. Out: the bytes, with a zero byte behind them.
//!
//! Regular files only, up to a limit. A file is looked at through its handle, so that no other one
//! can take its place in between, and a pipe or a device can neither block nor flood us. The user
//! alone may name a pipe as the scene, or standard input, which are read to their end.
//!
//! It is read rather than mapped. What was checked must still be so when it is used, and of a
//! mapped file another program can change every byte in between, also where the mapping is private:
//! an index that was within its range, the JSON text that cgltf trusts after `json.check`. A copy
//! of what is checked would not help where somebody shortens the file: that ends the program by a
//! signal. Mapping 4.5 MB takes 0.9 ms less than reading them (0.3 against 1.2), of 110 for the
//! picture.

const std = @import("std");
const diagnostic_data = @import("../diagnostic.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = diagnostic_data.Diagnostic;
const Identity = @import("../identity.zig").Identity;
const Io = std.Io;
const Progress = @import("../progress.zig").Progress;
const Reason = diagnostic_data.Message;
const Settings = @import("../settings.zig").Load;
const format = @import("format.zig");
const gzip = @import("../decode.zig").gzip;
const standard_input = @import("../settings.zig").standard_input;
const stream = @import("stream.zig");
const assert = std.debug.assert;

const Resources = @This();

/// See parse.zig.
pub const Error = error{ OutOfMemory, InputOutput, InvalidInput };

/// What is said of a file that would be replaced.
pub const overwritten = "would be overwritten by the output";

/// What is said of a link.
const outside = "is a link that leads outside the scene's folder (see --allow-outside)";

/// Largest file that is read, in bytes.
pub const file_bytes_max: u64 = 2 << 30;

/// What a file holds, and which one it is. The bytes are the caller's, from `gpa` unless another
/// allocator is asked for.
pub const File = struct { bytes: [:0]const u8, identity: ?Identity };

gpa: Allocator,
io: Io,
/// Folder of the scene, to which all names are relative.
folder: Io.Dir,
settings: Settings,
/// Bytes of all files so far.
bytes_read: u64 = 0,
/// Where the files that the scene names are noted as they are read; null: nowhere.
listing: ?*Listing = null,
/// Entries of folders that may still be looked at for names in another letter case.
entries_left: u32 = 1 << 18,

/// Files that were read, each path once, with its bytes.
pub const Listing = struct {
    arena: Allocator,
    byte_counts: std.array_hash_map.String(u64) = .empty,

    /// Notes a file; of one that is noted already, nothing.
    pub fn add(listing: *Listing, path: []const u8, byte_count: u64) Allocator.Error!void {
        const entry = try listing.byte_counts.getOrPut(listing.arena, path);
        if (entry.found_existing) return;
        errdefer _ = listing.byte_counts.pop();
        entry.key_ptr.* = try listing.arena.dupe(u8, path);
        entry.value_ptr.* = byte_count;
    }
};

/// A scene file and what it takes to read those that it names.
pub const Scene = struct {
    main: File,
    resources: Resources,

    /// Gives the file's bytes back and closes the folder.
    pub fn close(scene: *Scene) void {
        scene.resources.folder.close(scene.resources.io);
        scene.resources.gpa.free(scene.main.bytes);
        scene.* = undefined;
    }
};

/// Reads the scene file at `path`, or standard input, and opens its folder, which is the working
/// directory for what comes from standard input.
pub fn open(
    gpa: Allocator,
    io: Io,
    path: []const u8,
    settings: Settings,
    diagnostic: *Diagnostic,
) Error!Scene {
    var resources: Resources = .{ .gpa = gpa, .io = io, .folder = .cwd(), .settings = settings };
    resources.settings.allow_outside = true; // The user may name any file.
    const main = resources.loadMain(path, &diagnostic.message) catch |err| return switch (err) {
        error.IsFolder => error.InvalidInput,
        error.NotRegular, error.Overwritten => error.InputOutput,
        else => |other| other,
    };
    errdefer gpa.free(main.bytes);
    resources.folder = Io.Dir.cwd().openDir(io, std.fs.path.dirname(path) orelse ".", .{}) catch
        return diagnostic.fail(error.InputOutput, "its folder cannot be opened", .{});
    resources.settings = settings;
    return .{ .main = main, .resources = resources };
}

/// Reads a file that the scene names. On an error `reason` says why not, as what follows the name.
pub fn read(resources: *Resources, path: []const u8, reason: *Reason) Error!File {
    return resources.readNamed(resources.gpa, path, reason) catch |err| switch (err) {
        error.NotRegular, error.IsFolder => error.InvalidInput,
        error.Overwritten => error.InputOutput,
        else => |other| other,
    };
}

/// `Unreadable`: there is a picture without the file. `Overwritten`: the output would replace it,
/// which nobody wants, whether the picture needs it or not.
pub const OptionalError = error{ OutOfMemory, Unreadable, Overwritten };

/// Reads a file that a picture can do without into memory from `allocator`; otherwise as `read`.
pub fn readOptional(
    resources: *Resources,
    allocator: Allocator,
    path: []const u8,
    reason: *Reason,
) OptionalError!File {
    return resources.readNamed(allocator, path, reason) catch |err| switch (err) {
        error.InvalidInput,
        error.InputOutput,
        error.NotRegular,
        error.IsFolder,
        => error.Unreadable,
        else => |other| other,
    };
}

/// How a path really reads that no file has, where one differs from it in the case of letters (of
/// ASCII) alone, of several the least by bytes. Null: there is none, or it may not be looked for.
/// From `arena`.
pub fn inAnyCase(
    resources: *Resources,
    arena: Allocator,
    path: []const u8,
) Allocator.Error!?[]const u8 {
    if (!resources.settings.allow_outside and leavesFolder(path)) return null;
    var real: std.ArrayList(u8) = .empty;
    var parts = std.mem.splitScalar(u8, path, '/');
    while (parts.next()) |part| {
        const is_name = part.len > 0 and !std.mem.eql(u8, part, ".") and
            !std.mem.eql(u8, part, "..");
        const name = if (is_name)
            try resources.entryInAnyCase(arena, real.items, part) orelse return null
        else
            part;
        try real.appendSlice(arena, name);
        if (parts.peek() != null) try real.append(arena, '/');
    }
    return real.items;
}

/// The entry of a folder, "" being the scene's, with this name; null: there is none.
fn entryInAnyCase(
    resources: *Resources,
    arena: Allocator,
    folder: []const u8,
    name: []const u8,
) Allocator.Error!?[]const u8 {
    const io = resources.io;
    var listed = resources.folder.openDir(
        io,
        if (folder.len > 0) folder else ".",
        .{ .iterate = true },
    ) catch return null;
    defer listed.close(io);
    var entries = listed.iterate();
    var least: ?[]const u8 = null;
    while (entries.next(io) catch return null) |entry| {
        if (resources.entries_left == 0) return null;
        resources.entries_left -= 1;
        if (!std.ascii.eqlIgnoreCase(entry.name, name)) continue;
        const is_same = std.mem.eql(u8, entry.name, name);
        const is_less = if (least) |other| std.mem.lessThan(u8, entry.name, other) else true;
        if (is_same or is_less) least = try arena.dupe(u8, entry.name);
        if (is_same) break;
    }
    return least;
}

/// Triangles that the scene may place, for what has been read so far.
pub fn triangleCountMax(resources: *const Resources) u64 {
    return resources.settings.triangleCountMax(resources.bytes_read);
}

const LoadError = Error || error{ NotRegular, IsFolder, Overwritten };

fn readNamed(
    resources: *Resources,
    allocator: Allocator,
    path: []const u8,
    reason: *Reason,
) LoadError!File {
    if (path.len == 0 or std.mem.findScalar(u8, path, 0) != null)
        return refuse(reason, error.InvalidInput, "is not a valid path");
    if (!resources.settings.allow_outside and leavesFolder(path)) return refuse(
        reason,
        error.InvalidInput,
        "is outside the scene's folder (see --allow-outside)",
    );
    const file = try resources.load(allocator, path, reason);
    const what = format.misplaced(file.bytes) orelse return file;
    allocator.free(file.bytes);
    reason.set("is {s}", .{what});
    return error.InvalidInput;
}

/// The scene itself.
fn loadMain(resources: *Resources, path: []const u8, reason: *Reason) LoadError!File {
    if (std.mem.eql(u8, path, standard_input)) return resources.loadStream(.stdin(), reason);
    const file = try resources.openFile(path, reason);
    defer file.close(resources.io);
    const stat = file.stat(resources.io) catch |err| return refuseError(reason, err);
    return switch (stat.kind) {
        .named_pipe, .unix_domain_socket => resources.loadStream(file, reason),
        else => resources.loadFile(resources.gpa, file, reason),
    };
}

/// What is not necessarily a file.
fn loadStream(resources: *Resources, file: Io.File, reason: *Reason) LoadError!File {
    const io = resources.io;
    const identity = try resources.identify(file, reason);
    const stat = file.stat(io) catch |err| return refuseError(reason, err);
    if (stat.kind == .directory) return refuse(reason, error.IsFolder, "is a folder");
    if (file.isTty(io) catch false) return refuse(
        reason,
        error.InputOutput,
        "is a terminal: a scene comes by a pipe, or from a file by <",
    );
    const guess = if (stat.kind == .file) stat.size else 0;
    const limit = bytesMax();
    const bytes = stream.readAll(resources.gpa, file.handle, guess, limit) catch |err|
        return switch (err) {
            error.OutOfMemory => error.OutOfMemory,
            error.TooLarge => refuseSize(reason),
            else => |other| refuseError(reason, other),
        };
    resources.bytes_read += bytes.len;
    return .{ .bytes = bytes, .identity = identity };
}

fn load(
    resources: *Resources,
    allocator: Allocator,
    path: []const u8,
    reason: *Reason,
) LoadError!File {
    const file = try resources.openFile(path, reason);
    defer file.close(resources.io);
    const loaded = try resources.loadFile(allocator, file, reason);
    errdefer allocator.free(loaded.bytes);
    if (resources.listing) |listing| try listing.add(path, loaded.bytes.len);
    return loaded;
}

fn openFile(resources: *const Resources, path: []const u8, reason: *Reason) LoadError!Io.File {
    const handle = std.posix.openat(resources.folder.handle, path, .{
        .ACCMODE = .RDONLY,
        .NONBLOCK = true, // A pipe without a writer would block us.
        .NOCTTY = true,
        .CLOEXEC = true,
    }, 0) catch |err| {
        if (err == error.AccessDenied and resources.leadsOutside(path))
            return refuse(reason, error.InvalidInput, outside);
        return refuseError(reason, err);
    };
    return .{ .handle = handle, .flags = .{ .nonblocking = true } };
}

/// Whether that is what is wrong with a file that must not be opened: then it is said rather than
/// what permissions it has.
fn leadsOutside(resources: *const Resources, path: []const u8) bool {
    if (resources.settings.allow_outside) return false;
    const handle = std.posix.openat(resources.folder.handle, path, .{
        .PATH = true,
        .CLOEXEC = true,
    }, 0) catch return false;
    const file: Io.File = .{ .handle = handle, .flags = .{ .nonblocking = false } };
    defer file.close(resources.io);
    return !resources.isBelow(file);
}

/// Which file it is, unless it is the output.
fn identify(resources: *const Resources, file: Io.File, reason: *Reason) LoadError!?Identity {
    const identity: ?Identity = .of(file.handle);
    if (Identity.eql(resources.settings.output, identity))
        return refuse(reason, error.Overwritten, overwritten);
    return identity;
}

/// Bytes of a file that are read between one time that the progress is told of them and the next.
const told_bytes = 16 << 20;

fn loadFile(
    resources: *Resources,
    allocator: Allocator,
    file: Io.File,
    reason: *Reason,
) LoadError!File {
    const io = resources.io;
    const identity = try resources.identify(file, reason);
    const stat = file.stat(io) catch |err| return refuseError(reason, err);
    if (stat.kind == .directory) return refuse(reason, error.IsFolder, "is a folder");
    if (stat.kind != .file) return refuse(reason, error.NotRegular, "is not a regular file");
    if (!resources.settings.allow_outside and !resources.isBelow(file))
        return refuse(reason, error.InvalidInput, outside);
    if (stat.size > bytesMax()) return refuseSize(reason);
    const bytes = try allocator.allocSentinel(u8, @intCast(stat.size), 0);
    errdefer allocator.free(bytes);
    var done: usize = 0;
    while (done < bytes.len) {
        const part = bytes[done..@min(done + told_bytes, bytes.len)];
        const count = file.readPositionalAll(io, part, done) catch |err|
            return refuseError(reason, err);
        if (count < part.len)
            return refuse(reason, error.InputOutput, "changed while it was read");
        done += count;
        Progress.add(resources.settings.progress, count);
    }
    resources.bytes_read += bytes.len;
    return .{ .bytes = bytes, .identity = identity };
}

/// What a gzip file holds, `limit` bytes at most; it counts as read. The caller frees it. Otherwise
/// as `gzip.inflate`.
pub fn inflate(
    resources: *Resources,
    file: []const u8,
    limit: u64,
    reason: *Reason,
) gzip.Error![:0]u8 {
    const bytes = try gzip.inflate(resources.gpa, file, @min(limit, file_bytes_max), reason);
    resources.bytes_read += bytes.len;
    return bytes;
}

/// Of one file, as far as memory reaches.
fn bytesMax() u64 {
    return @min(file_bytes_max, std.math.maxInt(usize) / 2);
}

fn refuseSize(reason: *Reason) error{InvalidInput} {
    const text = std.fmt.comptimePrint("is over the limit of {d} bytes", .{file_bytes_max});
    return refuse(reason, error.InvalidInput, text);
}

fn refuse(reason: *Reason, err: anytype, comptime text: []const u8) @TypeOf(err) {
    reason.set(text, .{});
    return err;
}

fn refuseError(reason: *Reason, err: anyerror) error{InputOutput} {
    switch (err) {
        error.FileNotFound => reason.set("does not exist", .{}),
        error.NotDir => reason.set("does not exist: a folder of its path is a file", .{}),
        else => reason.set("cannot be read: {s}", .{diagnostic_data.systemReason(err)}),
    }
    return error.InputOutput;
}

/// Whether a path, read step by step, is ever above the folder it starts from. Asserts that it is
/// not empty.
fn leavesFolder(path: []const u8) bool {
    if (path[0] == '/') return true;
    // A separator elsewhere, and part of no name that a portable file would use.
    if (std.mem.findScalar(u8, path, '\\') != null) return true;
    var depth: usize = 0;
    var parts = std.mem.splitScalar(u8, path, '/');
    while (parts.next()) |part| {
        if (part.len == 0 or std.mem.eql(u8, part, ".")) continue;
        if (!std.mem.eql(u8, part, "..")) {
            depth += 1;
            continue;
        }
        if (depth == 0) return true;
        depth -= 1;
    }
    return false;
}

/// Links may lead out of the folder as well; the open file says where it really is.
fn isBelow(resources: *const Resources, file: Io.File) bool {
    var folder_buffer: [Io.Dir.max_path_bytes]u8 = undefined;
    var file_buffer: [Io.Dir.max_path_bytes]u8 = undefined;
    const io = resources.io;
    const folder_length = resources.folder.realPath(io, &folder_buffer) catch return false;
    const file_length = file.realPath(io, &file_buffer) catch return false;
    return isPathBelow(file_buffer[0..file_length], folder_buffer[0..folder_length]);
}

/// Whether the absolute path `path` lies below the absolute folder `folder`; both without links.
fn isPathBelow(path: []const u8, folder: []const u8) bool {
    assert(std.fs.path.isAbsolute(path) and std.fs.path.isAbsolute(folder));
    if (!std.mem.startsWith(u8, path, folder)) return false;
    return folder[folder.len - 1] == '/' or (path.len > folder.len and path[folder.len] == '/');
}

test leavesFolder {
    for ([_][]const u8{ "a/../b", "./a//b", "..a", "a b" }) |path| {
        try std.testing.expect(!leavesFolder(path));
    }
    for ([_][]const u8{ "..", "../a", "a/../../b", "/etc/hostname", "a\\b", "..\\a" }) |path| {
        try std.testing.expect(leavesFolder(path));
    }
}

test isPathBelow {
    try std.testing.expect(isPathBelow("/a/b", "/a"));
    try std.testing.expect(isPathBelow("/a/b", "/"));
    try std.testing.expect(!isPathBelow("/ab", "/a"));
    try std.testing.expect(!isPathBelow("/a", "/a"));
    try std.testing.expect(!isPathBelow("/b/a", "/a"));
}

test "regular files of the scene's folder only, and the reason in words" {
    const gpa = std.testing.allocator;
    const io = std.testing.io;
    var temporary = std.testing.tmpDir(.{});
    defer temporary.cleanup();
    try temporary.dir.writeFile(io, .{ .sub_path = "a", .data = "hello" });
    try temporary.dir.createDir(io, "in", .default_dir);
    const inner = try temporary.dir.openDir(io, "in", .{});
    defer inner.close(io);
    try inner.symLink(io, "../a", "link", .{});
    var resources: Resources = .{ .gpa = gpa, .io = io, .folder = temporary.dir, .settings = .{} };
    var reason: Reason = .{};
    var arena: std.heap.ArenaAllocator = .init(gpa);
    defer arena.deinit();
    var listing: Listing = .{ .arena = arena.allocator() };
    resources.listing = &listing;
    const file = try resources.read("a", &reason);
    defer gpa.free(file.bytes);
    try std.testing.expectEqualStrings("hello", file.bytes);
    try std.testing.expectEqual(5, resources.bytes_read);
    gpa.free((try resources.readOptional(gpa, "a", &reason)).bytes);
    try std.testing.expectError(error.Unreadable, resources.readOptional(gpa, "no", &reason));
    try std.testing.expectEqual(1, listing.byte_counts.count());
    try std.testing.expectEqual(5, listing.byte_counts.get("a"));
    resources.listing = null;

    try temporary.dir.writeFile(io, .{ .sub_path = "p", .data = "version https://git-lfs.x" });
    try std.testing.expectError(error.InvalidInput, resources.read("p", &reason));
    try std.testing.expect(std.mem.startsWith(u8, reason.text(), "is a Git LFS pointer"));

    const cases = [_]struct { []const u8, Error, []const u8 }{
        .{ "", error.InvalidInput, "is not a valid path" },
        .{ ".", error.InvalidInput, "is a folder" },
        .{ "../a", error.InvalidInput, "is outside the scene's folder (see --allow-outside)" },
        .{ "b", error.InputOutput, "does not exist" },
        .{ "a/b", error.InputOutput, "does not exist: a folder of its path is a file" },
    };
    for (cases) |case| {
        try std.testing.expectError(case[1], resources.read(case[0], &reason));
        try std.testing.expectEqualStrings(case[2], reason.text());
    }
    resources.folder = inner;
    try std.testing.expectError(error.InvalidInput, resources.read("link", &reason));
    try std.testing.expect(std.mem.startsWith(u8, reason.text(), "is a link that leads outside"));
    resources.settings.allow_outside = true;
    gpa.free((try resources.read("link", &reason)).bytes);
    try std.testing.expectError(error.InvalidInput, resources.read("/dev/null", &reason));
    try std.testing.expectEqualStrings("is not a regular file", reason.text());
    for ([_][]const u8{ "/dev/null", "no such file", "" }) |path| try std.testing.expectError(
        error.Unreadable,
        resources.readOptional(gpa, path, &reason),
    );
    resources.settings.output = file.identity;
    try std.testing.expectError(error.InputOutput, resources.read("../a", &reason));
    try std.testing.expectError(
        error.Overwritten,
        resources.readOptional(gpa, "../a", &reason),
    );
    try std.testing.expectEqualStrings("would be overwritten by the output", reason.text());
}
