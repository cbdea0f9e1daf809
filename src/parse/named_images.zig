//! Images that a mesh file names as its exporter saw them: with backslashes, with a drive, by a
//! path of another machine.
//!
//! In: a name as it stands in the file, and the folder of that file. Out: an image of the scene.
//! The name is looked for from that folder, then its last part in that folder and in the scene's.
//! What is not found is a warning.

const std = @import("std");
const diagnostic_file = @import("../diagnostic.zig");
const Allocator = std.mem.Allocator;
const ImageFiles = @import("image_files.zig");
const Message = diagnostic_file.Message;
const Resources = @import("resource.zig");
const scene = @import("../scene.zig");
const NamedImages = @This();

files: ImageFiles,
diagnostic: *diagnostic_file.Diagnostic,
/// Lives as long as the file is read.
arena: Allocator,
/// By folder and name; null: there is none.
known: std.StringHashMapUnmanaged(?u32) = .empty,

/// Frees what is neither the scene's nor the arena's.
pub fn deinit(images: *NamedImages) void {
    images.files.deinit();
    images.* = undefined;
}

/// The image that a file in `folder`, relative to the scene's, calls `name`; null, with a warning:
/// there is none.
pub fn get(images: *NamedImages, folder: []const u8, name: []const u8) Resources.Error!?u32 {
    const key = try std.fs.path.join(images.arena, &.{ folder, name });
    if (images.known.get(key)) |image| return image;
    var title: Message = .{};
    title.set("{f}", .{diagnostic_file.quote(name)});
    var paths: [3][]const u8 = undefined;
    var first_reason: Message = .{};
    const image = for (try candidates(images.arena, folder, name, &paths), 0..) |path, index| {
        var reason: Message = .{};
        break images.files.get(path, title.text(), &reason) catch |err| switch (err) {
            error.OutOfMemory => |failure| return failure,
            error.Overwritten => return images.diagnostic.fail(
                error.InputOutput,
                "image {s} {s}",
                .{ title.text(), reason.text() },
            ),
            error.Unreadable => {
                if (index == 0) first_reason = reason;
                continue;
            },
        };
    } else none: {
        images.diagnostic.warn("image {s} {s}, left out", .{ title.text(), first_reason.text() });
        break :none null;
    };
    try images.known.put(images.arena, key, image);
    return image;
}

/// Paths, relative to the scene's folder, under which a file of that name, in quotes or not, may
/// be.
pub fn candidates(
    arena: Allocator,
    folder: []const u8,
    name: []const u8,
    buffer: *[3][]const u8,
) error{OutOfMemory}![]const []const u8 {
    const is_quoted = name.len > 2 and name[0] == '"' and name[name.len - 1] == '"';
    const slashed = try arena.dupe(u8, if (is_quoted) name[1 .. name.len - 1] else name);
    std.mem.replaceScalar(u8, slashed, '\\', '/');
    const has_drive = slashed.len >= 2 and std.ascii.isAlphabetic(slashed[0]) and slashed[1] == ':';
    const last = std.fs.path.basename(if (has_drive) slashed[2..] else slashed);
    const is_absolute = has_drive or std.fs.path.isAbsolute(slashed);
    var count: usize = 0;
    const all = [_][]const u8{
        if (is_absolute) slashed else try std.fs.path.join(arena, &.{ folder, slashed }),
        try std.fs.path.join(arena, &.{ folder, last }),
        last,
    };
    for (all, 0..) |path, index| {
        const is_known = for (all[0..index]) |other| {
            if (std.mem.eql(u8, path, other)) break true;
        } else false;
        if (is_known or path.len == 0) continue;
        buffer[count] = path;
        count += 1;
    }
    return buffer[0..count];
}

test candidates {
    var arena: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena.deinit();
    var buffer: [3][]const u8 = undefined;
    for ([_]struct { []const u8, []const u8, []const []const u8 }{
        .{ "", "a b.png", &.{"a b.png"} },
        .{ "m", "a.png", &.{ "m/a.png", "a.png" } },
        .{ "m", "..\\t\\a.png", &.{ "m/../t/a.png", "m/a.png", "a.png" } },
        .{ "", "C:\\x\\a.png", &.{ "C:/x/a.png", "a.png" } },
        .{ "m", "/x/a.png", &.{ "/x/a.png", "m/a.png", "a.png" } },
        .{ "", "\"C:\\a b.png\"", &.{ "C:/a b.png", "a b.png" } },
        .{ "", "t/", &.{ "t/", "t" } },
    }) |case| {
        const found = try candidates(arena.allocator(), case[0], case[1], &buffer);
        try std.testing.expectEqual(case[2].len, found.len);
        for (case[2], found) |expected, path| try std.testing.expectEqualStrings(expected, path);
    }
}
