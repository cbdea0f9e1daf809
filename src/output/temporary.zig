//! Temporary files that leave nothing behind, whatever ends the program.
//!
//! A signal handler unlinks those that are open. What SIGKILL or a crash leaves is removed by a
//! later run in the same folder: a file is locked (flock) while its program lives, so that one
//! whose lock is free is nobody's. A lock need not be seen from another machine that shares the
//! folder, and so names tell where they are from; only those of this machine are looked at.
//!
//!     .NAME.raylane-HOST-RANDOM.tmp
//!
//! NAME is that of the file in the making, cut to what fits; HOST is a hash of the machine's id
//! and name, 16 hexadecimal digits; RANDOM is 8 more.

const std = @import("std");
const Identity = @import("../identity.zig").Identity;
const Io = std.Io;
const assert = std.debug.assert;

/// Bytes of a file name at most, as on all usual file systems.
pub const name_bytes_max = 255;
/// How many may be open at once: one for each file that is rendered side by side, and some.
pub const open_count_max = 2 * @import("../settings.zig").job_count.max;
/// Tries for a name that is free, and for a file that no other run removes before it is locked.
const attempt_count_max = 100;
const host_digit_count = 16;
const random_digit_count = 8;
const mark = ".raylane-";
const extension = ".tmp";
const suffix_bytes = mark.len + host_digit_count + 1 + random_digit_count + extension.len;

/// `Canceled`: a signal is ending the program.
pub const CreateError = Io.File.OpenError;

/// All temporary files of the program, for the handler of its signals. Any thread may open and
/// close files; `discardAll` may come at any moment.
pub const TemporaryFiles = struct {
    files: [open_count_max]TemporaryFile = @splat(.{}),
    is_ending: std.atomic.Value(bool) = .init(false),
    /// Somebody looks for leftovers.
    is_cleaning: std.atomic.Value(bool) = .init(false),
    /// The folder that was last looked through for them.
    cleaned: ?Identity = null,

    /// Unlinks all that are open, and lets no new ones be created. Async-signal-safe; the program
    /// must end right after it. Called again, it returns at once: a second signal does not wait
    /// for a file system that keeps the first one waiting.
    pub fn discardAll(temporaries: *TemporaryFiles) void {
        if (temporaries.is_ending.swap(true, .seq_cst)) return;
        for (&temporaries.files) |*file| {
            // Another thread is inside the system call, and sees `is_ending` next time.
            while (file.state.load(.seq_cst) == .creating) {
                _ = std.os.linux.nanosleep(&.{ .sec = 0, .nsec = 1_000_000 }, null);
            }
            if (file.state.load(.seq_cst) != .exists) continue;
            _ = std.c.unlinkat(file.folder.handle, &file.buffer, 0);
        }
    }

    /// Creates a file beside `name`, with `permissions` less those that the process withholds, and
    /// locks it. Leftovers in the folder go first, unless another thread is at it. `folder` must
    /// stay open as long as the file.
    pub fn create(
        temporaries: *TemporaryFiles,
        io: Io,
        folder: Io.Dir,
        name: []const u8,
        permissions: Io.File.Permissions,
    ) CreateError!*TemporaryFile {
        const file = for (&temporaries.files) |*file| {
            if (file.state.cmpxchgStrong(.free, .taken, .acquire, .monotonic) == null) break file;
        } else return error.ProcessFdQuotaExceeded;
        errdefer file.state.store(.free, .seq_cst);
        if (!temporaries.is_cleaning.swap(true, .acquire)) {
            defer temporaries.is_cleaning.store(false, .release);
            temporaries.clean(io, folder);
        }
        file.folder = folder;
        for (0..attempt_count_max) |_| {
            file.setName(io, name);
            temporaries.open(file, io, permissions) catch |err| switch (err) {
                error.PathAlreadyExists => continue,
                else => return err,
            };
            if (file.lock(io)) return file;
            file.remove(io, .taken);
        }
        return error.PathAlreadyExists;
    }

    /// No signal finds a file that exists but is not yet known to do so: this thread takes none
    /// meanwhile, and a handler in another one waits for it.
    fn open(
        temporaries: *TemporaryFiles,
        file: *TemporaryFile,
        io: Io,
        permissions: Io.File.Permissions,
    ) CreateError!void {
        const all = std.posix.sigfillset();
        var before: std.posix.sigset_t = undefined;
        std.posix.sigprocmask(std.posix.SIG.BLOCK, &all, &before);
        defer std.posix.sigprocmask(std.posix.SIG.SETMASK, &before, null);
        file.state.store(.creating, .seq_cst);
        errdefer file.state.store(.taken, .seq_cst);
        if (temporaries.is_ending.load(.seq_cst)) return error.Canceled;
        // Exclusive creation does not follow a symbolic link either.
        file.file = try file.folder.createFile(io, file.path(), .{
            .exclusive = true,
            .permissions = permissions,
        });
        file.state.store(.exists, .seq_cst);
    }

    /// Removes what runs on this machine have left in `folder`, unless it was the last one looked
    /// at. What cannot be removed stays.
    fn clean(temporaries: *TemporaryFiles, io: Io, folder: Io.Dir) void {
        const identity: ?Identity = .of(folder.handle);
        if (Identity.eql(identity, temporaries.cleaned)) return;
        temporaries.cleaned = identity;
        const listing = folder.openDir(io, ".", .{ .iterate = true }) catch return;
        defer listing.close(io);
        const host = hostDigits();
        var entries = listing.iterate();
        while (entries.next(io) catch return) |entry| {
            if (entry.kind != .file and entry.kind != .unknown) continue;
            if (!isFrom(entry.name, &host)) continue;
            // For writing, which network file systems want for a lock.
            const file = listing.openFile(io, entry.name, .{
                .mode = .write_only,
                .follow_symlinks = false,
            }) catch continue;
            defer file.close(io);
            if (file.tryLock(io, .exclusive) catch false) {
                listing.deleteFile(io, entry.name) catch continue;
            }
        }
    }
};

/// One of `TemporaryFiles`.
pub const TemporaryFile = struct {
    state: std.atomic.Value(State) = .init(.free),
    folder: Io.Dir = .{ .handle = -1 },
    file: Io.File = .{ .handle = -1, .flags = .{ .nonblocking = false } },
    buffer: [name_bytes_max:0]u8 = @splat(0),

    const State = enum(u8) { free, taken, creating, exists };

    /// Its name for the time being.
    pub fn path(file: *const TemporaryFile) []const u8 {
        return std.mem.sliceTo(&file.buffer, 0);
    }

    fn setName(file: *TemporaryFile, io: Io, name: []const u8) void {
        var kept = @min(name.len, name_bytes_max - suffix_bytes - 1);
        // Some file systems want whole UTF-8 sequences.
        while (kept < name.len and kept > 0 and name[kept] & 0xc0 == 0x80) kept -= 1;
        var random: [random_digit_count / 2]u8 = undefined;
        io.random(&random);
        const path_format = ".{s}" ++ mark ++ "{s}-{x}" ++ extension;
        const written = std.mem.print(&file.buffer, path_format, .{
            name[0..kept], &hostDigits(), &random,
        }) catch unreachable; // `kept` leaves the room.
        file.buffer[written.len] = 0;
    }

    /// Locks the file as long as it is open. False: another run took it for a leftover in the
    /// moment between creation and lock. Where the file system has no locks the file goes without
    /// one, and as no run gets one either, none removes it.
    fn lock(file: *TemporaryFile, io: Io) bool {
        const is_locked = file.file.tryLock(io, .exclusive) catch return true;
        const stat = file.file.stat(io) catch return is_locked;
        return is_locked and stat.nlink > 0;
    }

    /// Gives the file its final name, in place of what has it, and closes it. On an error it is
    /// left as it was.
    pub fn rename(file: *TemporaryFile, io: Io, name: []const u8) Io.Dir.RenameError!void {
        try file.folder.rename(file.path(), file.folder, name, io);
        file.close(io);
    }

    /// Removes the file.
    pub fn discard(file: *TemporaryFile, io: Io) void {
        assert(file.state.load(.monotonic) == .exists);
        file.remove(io, .free);
    }

    fn remove(file: *TemporaryFile, io: Io, next: State) void {
        file.folder.deleteFile(io, file.path()) catch {}; // A signal or a person was faster.
        file.file.close(io);
        file.state.store(next, .seq_cst);
    }

    /// Until here the lock is held.
    fn close(file: *TemporaryFile, io: Io) void {
        file.file.close(io);
        file.state.store(.free, .seq_cst);
    }
};

/// Whether a file name is that of a temporary file of the machine with these digits.
fn isFrom(name: []const u8, host: *const [host_digit_count]u8) bool {
    if (name.len <= suffix_bytes or name[0] != '.') return false;
    const random = std.mem.cutSuffix(u8, name, extension) orelse return false;
    const rest, const digits = std.mem.cutLast(u8, random, "-") orelse return false;
    if (digits.len != random_digit_count) return false;
    for (digits) |digit| if (!std.ascii.isHex(digit)) return false;
    return std.mem.endsWith(u8, rest, host) and
        std.mem.endsWith(u8, rest[0 .. rest.len - host_digit_count], mark);
}

/// Containers may share an id and machines a name: only who has both is this machine.
fn hostDigits() [host_digit_count]u8 {
    var hash: std.hash.Fnv1a_64 = .init();
    var id: [64]u8 = undefined;
    if (std.posix.openat(std.posix.AT.FDCWD, "/etc/machine-id", .{ .CLOEXEC = true }, 0)) |file| {
        defer _ = std.c.close(file);
        hash.update(id[0 .. std.posix.read(file, &id) catch 0]);
    } else |_| {}
    const system = std.posix.uname();
    hash.update(std.mem.sliceTo(&system.nodename, 0));
    return std.fmt.hex(hash.final());
}

test "a leftover goes where its lock is free and its name from here, and nothing else does" {
    const io = std.testing.io;
    var folder = std.testing.tmpDir(.{ .iterate = true });
    defer folder.cleanup();
    var earlier: TemporaryFiles = .{};
    const killed = try earlier.create(io, folder.dir, "a.png", .default_file);
    const living = try earlier.create(io, folder.dir, "a.png", .default_file);
    var leftover_buffer: [name_bytes_max]u8 = undefined;
    const leftover = leftover_buffer[0..killed.path().len];
    @memcpy(leftover, killed.path());
    killed.close(io); // As the system does when the program dies.

    var foreign_buffer = leftover_buffer;
    const foreign = foreign_buffer[0..leftover.len];
    const digit = &foreign[foreign.len - suffix_bytes + mark.len];
    digit.* = if (digit.* == '0') '1' else '0';
    const others = [_][]const u8{
        foreign, living.path(), leftover[1..], leftover[0 .. leftover.len - 1], "a.png", ".tmp",
    };
    for (others) |name| {
        if (name.ptr == others[1].ptr) continue;
        try folder.dir.writeFile(io, .{ .sub_path = name, .data = "" });
    }
    var later: TemporaryFiles = .{};
    const current = try later.create(io, folder.dir, "b.png", .default_file);
    try std.testing.expectError(error.FileNotFound, folder.dir.access(io, leftover, .{}));
    for (others) |name| try folder.dir.access(io, name, .{});

    // Looked through once.
    living.close(io);
    (try later.create(io, folder.dir, "c.png", .default_file)).discard(io);
    try folder.dir.access(io, living.path(), .{});
    current.discard(io);
}

test "names are cut to what fits, between UTF-8 sequences" {
    const io = std.testing.io;
    var file: TemporaryFile = .{};
    const host = hostDigits();
    const pairs: [127][2]u8 = @splat("é"[0..2].*);
    const even = std.mem.sliceAsBytes(&pairs);
    const odd = [_]u8{'x'} ++ @as([254]u8, @bitCast(pairs));
    for ([_][]const u8{ "a", even, &odd, "-", ".tmp" }) |name| {
        file.setName(io, name);
        try std.testing.expect(file.path().len <= name_bytes_max);
        try std.testing.expect(std.unicode.utf8ValidateSlice(file.path()));
        try std.testing.expect(isFrom(file.path(), &host));
        const kept = file.path()[1 .. file.path().len - suffix_bytes];
        try std.testing.expectStringStartsWith(name, kept);
        try std.testing.expect(kept.len + 2 > @min(name.len, name_bytes_max - suffix_bytes - 1));
    }
}

test "as many files as may be, and no more" {
    const io = std.testing.io;
    var folder = std.testing.tmpDir(.{ .iterate = true });
    defer folder.cleanup();
    var temporaries: TemporaryFiles = .{};
    for (0..open_count_max) |_| {
        _ = try temporaries.create(io, folder.dir, "a", .default_file);
    }
    const result = temporaries.create(io, folder.dir, "a", .default_file);
    try std.testing.expectError(error.ProcessFdQuotaExceeded, result);
    temporaries.discardAll();
    var entries = folder.dir.iterate();
    try std.testing.expectEqual(null, try entries.next(io));
    for (&temporaries.files) |*file| file.discard(io);
}
