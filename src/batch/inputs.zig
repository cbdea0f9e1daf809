//! Inputs -> scene files: a file stands for itself, a folder for all in it that are called like
//! scenes, in the order of their names.
//!
//! What is in folders of a folder does not count, nor what begins with a dot. What a file is says
//! its contents, later on; here its extension decides (`settings.SceneFormat`, perhaps with .gz).

const std = @import("std");
const diagnostic = @import("../diagnostic.zig");
const settings = @import("../settings.zig");
const Allocator = std.mem.Allocator;
const Io = std.Io;

/// A scene to be rendered.
pub const File = struct {
    /// As given, or behind the folder's name as given.
    path: []const u8,
    /// Null: there is none, or nobody knows.
    byte_count: ?u64 = null,

    /// What names of pictures call it.
    pub fn model(file: File) []const u8 {
        if (std.mem.eql(u8, file.path, settings.standard_input)) return "stdin";
        const path = std.mem.cutPrefix(u8, file.path, settings.builtin_prefix) orelse file.path;
        return std.fs.path.stem(path);
    }
};

/// What an input is.
pub const Found = union(enum) {
    /// A file, or nothing that could be looked at.
    file: File,
    /// Files are added to the list; so many folders are left out.
    folder: struct { file_count: usize, folder_count: usize },
    /// A folder that cannot be read, and why.
    unreadable: []const u8,
};

/// Adds what `input` stands for to the list. Memory is of an arena.
pub fn gather(
    arena: Allocator,
    io: Io,
    input: []const u8,
    files: *std.ArrayList(File),
) error{OutOfMemory}!Found {
    if (!isInFolder(input)) return add(arena, files, .{ .path = input });
    const cwd: Io.Dir = .cwd();
    const stat = cwd.statFile(io, input, .{}) catch
        return add(arena, files, .{ .path = input });
    if (stat.kind != .directory)
        return add(arena, files, .{ .path = input, .byte_count = stat.size });
    const folder = cwd.openDir(io, input, .{ .iterate = true }) catch |err|
        return .{ .unreadable = diagnostic.systemReason(err) };
    defer folder.close(io);
    const first = files.items.len;
    var folder_count: usize = 0;
    var entries = folder.iterate();
    while (entries.next(io) catch |err| return .{
        .unreadable = diagnostic.systemReason(err),
    }) |entry| {
        if (entry.name[0] == '.') continue;
        if (entry.kind == .directory) folder_count += 1;
        if (entry.kind == .directory or !isScene(entry.name)) continue;
        const found = folder.statFile(io, entry.name, .{}) catch continue;
        if (found.kind != .file) continue;
        try files.append(arena, .{
            .path = try std.fs.path.join(arena, &.{ input, entry.name }),
            .byte_count = found.size,
        });
    }
    std.mem.sortUnstable(File, files.items[first..], {}, isBefore);
    return .{ .folder = .{
        .file_count = files.items.len - first,
        .folder_count = folder_count,
    } };
}

fn add(arena: Allocator, files: *std.ArrayList(File), file: File) error{OutOfMemory}!Found {
    try files.append(arena, file);
    return .{ .file = file };
}

fn isInFolder(input: []const u8) bool {
    return !std.mem.eql(u8, input, settings.standard_input) and
        !std.mem.startsWith(u8, input, settings.builtin_prefix);
}

fn isBefore(_: void, one: File, other: File) bool {
    return std.mem.lessThan(u8, one.path, other.path);
}

/// Whether a file is called like a scene.
fn isScene(name: []const u8) bool {
    const packed_extension = ".gz";
    const is_packed = std.ascii.endsWithIgnoreCase(name, packed_extension);
    const bare = if (is_packed) name[0 .. name.len - packed_extension.len] else name;
    const extension = std.fs.path.extension(bare);
    for (std.enums.values(settings.SceneFormat)) |format| {
        if (extension.len == 0) return false;
        if (std.ascii.eqlIgnoreCase(extension[1..], @tagName(format))) return true;
    }
    return false;
}

const testing = std.testing;

test "a folder stands for its scenes by name, a file for itself" {
    const io = testing.io;
    var arena_state: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena_state.deinit();
    const arena = arena_state.allocator();
    var folder = testing.tmpDir(.{});
    defer folder.cleanup();
    for ([_][]const u8{
        "b.glb", "a.GLTF", "c.pbrt.gz", "a.bin", ".hidden.glb", "glb", "a.png", "d.ply",
    }) |name| try folder.dir.writeFile(io, .{ .sub_path = name, .data = "12345" });
    try folder.dir.createDir(io, "e.glb", .default_dir);
    var buffer: [std.fs.max_path_bytes]u8 = undefined;
    const path = buffer[0..try folder.dir.realPath(io, &buffer)];
    var files: std.ArrayList(File) = .empty;
    const found = try gather(arena, io, path, &files);
    try testing.expectEqual(4, found.folder.file_count);
    try testing.expectEqual(1, found.folder.folder_count);
    for (files.items, [_][]const u8{ "a", "b", "c.pbrt", "d" }) |file, model| {
        try testing.expectEqualStrings(model, file.model());
        try testing.expectEqual(5, file.byte_count.?);
        try testing.expect(std.mem.startsWith(u8, file.path, path));
    }
    for ([_][2][]const u8{
        .{ "-", "stdin" }, .{ "builtin:nave", "nave" }, .{ "no/such.obj", "such" },
    }) |case| {
        const single = try gather(arena, io, case[0], &files);
        try testing.expectEqualStrings(case[1], single.file.model());
        try testing.expectEqualStrings(case[0], files.items[files.items.len - 1].path);
    }
}
