//! Memory that is left to this process: by the machine, and by the control groups it is in.
//!
//! In: /proc/meminfo, /proc/self/cgroup and the files of each group up to the root, of version 2 or
//! 1 (Linux's admin-guide/cgroup-v2.rst and cgroup-v1/memory.rst). Out: the least of what they
//! leave. Pages of files that the kernel would give up count as left.

const std = @import("std");
const Io = std.Io;

/// The files of a version.
const Version = struct {
    mount: []const u8,
    limit: []const u8,
    usage: []const u8,
    /// Of `memory.stat`: bytes of files that nobody has used lately.
    reclaimable: []const u8,
};

const version_1: Version = .{
    .mount = "sys/fs/cgroup/memory",
    .limit = "memory.limit_in_bytes",
    .usage = "memory.usage_in_bytes",
    .reclaimable = "total_inactive_file ",
};
const version_2: Version = .{
    .mount = "sys/fs/cgroup",
    .limit = "memory.max",
    .usage = "memory.current",
    .reclaimable = "inactive_file ",
};

/// Bytes; null: the system does not tell.
pub fn find(io: Io) ?u64 {
    var root = Io.Dir.cwd().openDir(io, "/", .{}) catch return null;
    defer root.close(io);
    return findBelow(io, root);
}

/// `root`: where /proc and /sys are.
fn findBelow(io: Io, root: Io.Dir) ?u64 {
    var least = ofMachine(io, root);
    var buffer: [4096]u8 = undefined;
    const groups = root.readFile(io, "proc/self/cgroup", &buffer) catch return least;
    var lines = std.mem.tokenizeScalar(u8, groups, '\n');
    while (lines.next()) |line| {
        // hierarchy:controllers:path, where version 2 has no controllers.
        var parts = std.mem.splitScalar(u8, line, ':');
        _ = parts.first();
        const controllers = parts.next() orelse continue;
        const version = if (controllers.len == 0)
            &version_2
        else if (isAmong("memory", controllers))
            &version_1
        else
            continue;
        var group = std.mem.trim(u8, parts.rest(), "/");
        // In a container, the group may have another name than here: the root is its own then.
        while (true) {
            if (ofGroup(io, root, version, group)) |bytes| least = @min(least orelse bytes, bytes);
            if (group.len == 0) break;
            group = std.fs.path.dirname(group) orelse "";
        }
    }
    return least;
}

fn isAmong(name: []const u8, list: []const u8) bool {
    var names = std.mem.splitScalar(u8, list, ',');
    while (names.next()) |one| if (std.mem.eql(u8, one, name)) return true;
    return false;
}

fn ofMachine(io: Io, root: Io.Dir) ?u64 {
    var buffer: [4096]u8 = undefined;
    const text = root.readFile(io, "proc/meminfo", &buffer) catch return null;
    const number = fieldOf(text, "MemAvailable:") orelse return null;
    const kibibytes = std.mem.cutSuffix(u8, number, "kB") orelse return null;
    return std.math.mul(u64, parse(kibibytes) orelse return null, 1 << 10) catch null;
}

/// Null: the group has no limit, or is not to be seen.
fn ofGroup(io: Io, root: Io.Dir, version: *const Version, group: []const u8) ?u64 {
    const limit = numberIn(io, root, version, group, version.limit) orelse return null;
    const used = numberIn(io, root, version, group, version.usage) orelse return limit;
    var buffer: [8192]u8 = undefined;
    const statistics = read(io, root, version, group, "memory.stat", &buffer) orelse "";
    const files = if (fieldOf(statistics, version.reclaimable)) |text| parse(text) orelse 0 else 0;
    return limit -| (used -| files);
}

fn numberIn(
    io: Io,
    root: Io.Dir,
    version: *const Version,
    group: []const u8,
    name: []const u8,
) ?u64 {
    var buffer: [64]u8 = undefined;
    return parse(read(io, root, version, group, name, &buffer) orelse return null);
}

fn read(
    io: Io,
    root: Io.Dir,
    version: *const Version,
    group: []const u8,
    name: []const u8,
    buffer: []u8,
) ?[]const u8 {
    var path_buffer: [4096]u8 = undefined;
    const separator = if (group.len == 0) "" else "/";
    const parts = .{ version.mount, separator, group, name };
    const path = std.fmt.bufPrint(&path_buffer, "{s}{s}{s}/{s}", parts) catch return null;
    return root.readFile(io, path, buffer) catch null;
}

/// What follows `name` at the beginning of a line.
fn fieldOf(text: []const u8, name: []const u8) ?[]const u8 {
    var lines = std.mem.tokenizeScalar(u8, text, '\n');
    while (lines.next()) |line| if (std.mem.cutPrefix(u8, line, name)) |rest| return rest;
    return null;
}

/// `max` of version 2 is no number.
fn parse(text: []const u8) ?u64 {
    return std.fmt.parseInt(u64, std.mem.trim(u8, text, " \t\n"), 10) catch null;
}

fn put(folder: Io.Dir, path: []const u8, text: []const u8) !void {
    const io = std.testing.io;
    try folder.createDirPath(io, std.fs.path.dirname(path).?);
    try folder.writeFile(io, .{ .sub_path = path, .data = text });
}

test "the machine and each group up to the root leave so much" {
    const io = std.testing.io;
    var temporary = std.testing.tmpDir(.{});
    defer temporary.cleanup();
    const root = temporary.dir;
    try std.testing.expectEqual(null, findBelow(io, root));
    try put(root, "proc/meminfo", "MemTotal: 9000 kB\nMemAvailable:    7000 kB\n");
    try std.testing.expectEqual(7000 << 10, findBelow(io, root));
    try put(root, "proc/self/cgroup", "0::/a.slice/b\n");
    try std.testing.expectEqual(7000 << 10, findBelow(io, root));
    try put(root, "sys/fs/cgroup/a.slice/b/memory.max", "max\n");
    try put(root, "sys/fs/cgroup/a.slice/memory.max", "5000000\n");
    try std.testing.expectEqual(5_000_000, findBelow(io, root));
    try put(root, "sys/fs/cgroup/a.slice/memory.current", "2000000\n");
    try put(root, "sys/fs/cgroup/a.slice/memory.stat", "anon 1\ninactive_file 500000\n");
    try std.testing.expectEqual(3_500_000, findBelow(io, root));
    try put(root, "sys/fs/cgroup/a.slice/memory.current", "9000000\n");
    try std.testing.expectEqual(0, findBelow(io, root));
    // A group that is not to be seen by its name, as in a container.
    try put(root, "proc/self/cgroup", "3:cpu:/x\n2:hugetlb,memory:/docker/c\n0::/\n");
    try put(root, "sys/fs/cgroup/memory/memory.limit_in_bytes", "4000000\n");
    try put(root, "sys/fs/cgroup/memory/memory.usage_in_bytes", "1000000\n");
    try std.testing.expectEqual(3_000_000, findBelow(io, root));
}
