//! Where a file may be that a mesh file names as its exporter saw it: with backslashes, with a
//! drive, by a path of another machine, in quotes, with escapes of URIs, in another letter case.
//!
//! In: a name as it stands in the file, and the folder of that file. Out: paths to try in turn:
//! from that folder, then its last part in that folder and in the scene's; then how files there are
//! really called that differ in case alone. Folders are only listed where all else has failed, and
//! up to a limit for all of a scene.

const std = @import("std");
const Allocator = std.mem.Allocator;
const Resources = @import("resource.zig");
const FileSearch = @This();

/// As it is, and with its percent signs decoded, from three places each.
const path_count_max = 6;

resources: *Resources,
arena: Allocator,
paths: [path_count_max][]const u8 = undefined,
path_count: usize = 0,
/// Of the next path, in either way.
index: usize = 0,

/// A search for what a file in `folder`, relative to the scene's, calls `name`. Paths live in
/// `arena`.
pub fn init(
    resources: *Resources,
    arena: Allocator,
    folder: []const u8,
    name: []const u8,
) Allocator.Error!FileSearch {
    var search: FileSearch = .{ .resources = resources, .arena = arena };
    const is_quoted = name.len > 2 and name[0] == '"' and name[name.len - 1] == '"';
    const bare = if (is_quoted) name[1 .. name.len - 1] else name;
    try search.addAll(folder, try arena.dupe(u8, bare));
    try search.addAll(folder, std.Uri.percentDecodeInPlace(try arena.dupe(u8, bare)));
    return search;
}

fn addAll(search: *FileSearch, folder: []const u8, name: []u8) Allocator.Error!void {
    const arena = search.arena;
    std.mem.replaceScalar(u8, name, '\\', '/');
    const has_drive = name.len >= 2 and std.ascii.isAlphabetic(name[0]) and name[1] == ':';
    const last = std.fs.path.basename(if (has_drive) name[2..] else name);
    const is_absolute = has_drive or std.fs.path.isAbsolute(name);
    for ([_][]const u8{
        if (is_absolute) name else try std.fs.path.join(arena, &.{ folder, name }),
        try std.fs.path.join(arena, &.{ folder, last }),
        last,
    }) |path| {
        const is_known = for (search.paths[0..search.path_count]) |other| {
            if (std.mem.eql(u8, path, other)) break true;
        } else false;
        if (is_known or path.len == 0) continue;
        search.paths[search.path_count] = path;
        search.path_count += 1;
    }
}

/// The next path, relative to the scene's folder; null: there are no more.
pub fn next(search: *FileSearch) Allocator.Error!?[]const u8 {
    defer search.index += 1;
    if (search.index < search.path_count) return search.paths[search.index];
    while (search.index < 2 * search.path_count) : (search.index += 1) {
        const path = search.paths[search.index - search.path_count];
        if (try search.resources.inAnyCase(search.arena, path)) |found| return found;
    }
    return null;
}

/// Whether the last path is the first.
pub fn isFirst(search: *const FileSearch) bool {
    return search.index == 1;
}

/// Whether the last path differs in case from what the file says.
pub fn isOtherCase(search: *const FileSearch) bool {
    return search.index > search.path_count;
}

test "places in turn" {
    var arena: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena.deinit();
    for ([_]struct { []const u8, []const u8, []const []const u8 }{
        .{ "", "a b.png", &.{"a b.png"} },
        .{ "m", "a.png", &.{ "m/a.png", "a.png" } },
        .{ "m", "..\\t\\a.png", &.{ "m/../t/a.png", "m/a.png", "a.png" } },
        .{ "", "C:\\x\\a.png", &.{ "C:/x/a.png", "a.png" } },
        .{ "m", "/x/a.png", &.{ "/x/a.png", "m/a.png", "a.png" } },
        .{ "", "\"C:\\a b.png\"", &.{ "C:/a b.png", "a b.png" } },
        .{ "", "t/", &.{ "t/", "t" } },
        .{ "", "t%2fa%20b%.png", &.{ "t%2fa%20b%.png", "t/a b%.png", "a b%.png" } },
    }) |case| {
        var resources: Resources = undefined; // Nothing is looked for yet.
        const search: FileSearch = try .init(&resources, arena.allocator(), case[0], case[1]);
        try std.testing.expectEqual(case[2].len, search.path_count);
        for (case[2], search.paths[0..search.path_count]) |expected, path| {
            try std.testing.expectEqualStrings(expected, path);
        }
    }
}
