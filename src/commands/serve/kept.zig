//! A session that outlives its job, and whether it is still that of the files on the disk.
//!
//! The scene's files and the environment's are the same while their numbers, sizes and times are.
//! A file that was written just before it was read may be written again within the same tick of the
//! clock: what was made of it is not kept.

const std = @import("std");
const raylane = @import("raylane");
const Account = raylane.memory_account.Account;
const Allocator = std.mem.Allocator;
const Diagnostic = raylane.diagnostic.Diagnostic;
const Identity = raylane.identity.Identity;
const Io = std.Io;
const Options = raylane.cli.Options;
const Session = raylane.session.Session;
const settings = raylane.settings;

/// The coarsest clock of a file system, and then some.
const mtime_step_max_ns = 2 * std.time.ns_per_s;

/// A file as it was.
const Stamp = struct {
    path: []const u8,
    status: Io.File.Stat,

    fn of(io: Io, path: []const u8) ?Stamp {
        const status = Io.Dir.cwd().statFile(io, path, .{}) catch return null;
        return .{ .path = path, .status = status };
    }

    fn isSame(stamp: *const Stamp, io: Io) bool {
        const now = of(io, stamp.path) orelse return false;
        const then = &stamp.status;
        return now.status.inode == then.inode and now.status.size == then.size and
            now.status.mtime.nanoseconds == then.mtime.nanoseconds and
            now.status.ctime.nanoseconds == then.ctime.nanoseconds;
    }

    fn isOlderThanStep(stamp: *const Stamp, now: Io.Timestamp) bool {
        return stamp.status.mtime.nanoseconds < now.nanoseconds - mtime_step_max_ns;
    }
};

/// A scene's session. It stays where it is.
pub const Kept = struct {
    gpa: Allocator,
    account: Account,
    session: Session,
    /// Of the names below.
    arena: std.heap.ArenaAllocator,
    /// All that the scene in memory depends on besides its files.
    key: []const u8 = "",
    stamps: []const Stamp = &.{},
    environment: ?Stamp = null,
    /// It may serve another job.
    is_good: bool = false,

    /// With nothing in it. `destroy` frees it.
    pub fn create(
        gpa: Allocator,
        io: Io,
        options: *const Options,
        diagnostic: *Diagnostic,
    ) error{OutOfMemory}!*Kept {
        const kept = try gpa.create(Kept);
        kept.* = .{
            .gpa = gpa,
            .account = .initFor(gpa, io, options.memory_max),
            .session = undefined,
            .arena = .init(gpa),
        };
        kept.session = .init(
            kept.account.allocator(),
            io,
            if (options.thread_count) |count| count else null,
            diagnostic,
        );
        return kept;
    }

    pub fn destroy(kept: *Kept) void {
        kept.session.deinit();
        kept.arena.deinit();
        kept.gpa.destroy(kept);
    }

    /// Reads the scene of a job; `replaced` is the file that its picture is to replace.
    pub fn load(
        kept: *Kept,
        io: Io,
        options: *const Options,
        replaced: ?Identity,
    ) Session.Error!void {
        const arena = kept.arena.allocator();
        const start = Io.Clock.real.now(io);
        var choices = options.load;
        choices.output = replaced;
        try kept.session.load(options.scene, choices);
        kept.key = try keyOf(arena, options);
        const files = kept.session.scene.?.file.files;
        const stamps = try arena.alloc(Stamp, files.len);
        kept.is_good = true;
        for (stamps, files, 0..) |*stamp, *file, index| {
            const path = if (index == 0)
                try arena.dupe(u8, options.scene)
            else
                try std.fs.path.resolveAlloc(arena, &.{
                    std.fs.path.dirname(options.scene) orelse ".", file.path,
                });
            const found = Stamp.of(io, path);
            if (found == null or !found.?.isOlderThanStep(start)) kept.is_good = false;
            if (found) |one| stamp.* = one;
        }
        if (kept.is_good) kept.stamps = stamps;
    }

    /// Whether a job finds its scene here.
    pub fn holds(
        kept: *const Kept,
        io: Io,
        options: *const Options,
        replaced: ?Identity,
    ) error{OutOfMemory}!bool {
        if (!kept.is_good) return false;
        const key = try keyOf(kept.gpa, options);
        defer kept.gpa.free(key);
        if (!std.mem.eql(u8, key, kept.key)) return false;
        for (kept.stamps) |*stamp| {
            if (!stamp.isSame(io)) return false;
            // The one who reads refuses it.
            const file = replaced orelse continue;
            if (file.inode == stamp.status.inode) return false;
        }
        return true;
    }

    /// Begins a job with what there is.
    pub fn begin(kept: *Kept, io: Io, replaced: ?Identity, diagnostic: *Diagnostic) void {
        kept.session.diagnostic = diagnostic;
        kept.session.output = replaced;
        kept.session.times = .{};
        kept.session.start = Io.Clock.awake.now(io);
    }

    /// Gives an environment's file the name that the session knows it by, if it is as it was;
    /// otherwise has the session read it.
    pub fn recall(
        kept: *Kept,
        io: Io,
        source: *settings.Environment.Source,
    ) error{OutOfMemory}!void {
        if (source.* != .file) return;
        const path = source.file;
        if (kept.environment) |*known| if (std.mem.eql(u8, known.path, path)) {
            source.* = .{ .file = known.path };
            const is_replaced = if (kept.session.output) |file|
                file.inode == known.status.inode
            else
                false;
            if (known.isSame(io) and !is_replaced) return;
        };
        kept.session.forgetEnvironment();
        kept.environment = null;
        const name = try kept.arena.allocator().dupe(u8, path);
        source.* = .{ .file = name };
        const found = Stamp.of(io, name) orelse return;
        if (found.isOlderThanStep(Io.Clock.real.now(io))) kept.environment = found;
    }

    fn keyOf(gpa: Allocator, options: *const Options) error{OutOfMemory}![]const u8 {
        var text: Io.Writer.Allocating = .init(gpa);
        errdefer text.deinit();
        var json: std.json.Stringify = .{ .writer = &text.writer };
        writeKey(&json, options) catch return error.OutOfMemory;
        return text.toOwnedSlice();
    }

    fn writeKey(json: *std.json.Stringify, options: *const Options) Io.Writer.Error!void {
        try json.beginArray();
        try json.write(.{ options.scene, options.thread_count, options.memory_max });
        inline for (comptime std.meta.fieldNames(settings.Load)) |name| {
            const is_of_job = comptime std.mem.eql(u8, name, "progress") or
                std.mem.eql(u8, name, "output");
            if (!is_of_job) try json.write(@field(options.load, name));
        }
        try json.endArray();
    }
};
