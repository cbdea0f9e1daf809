//! Images that a mesh file names as its exporter saw them.
//!
//! In: a name as it stands in the file, and the folder of that file. Out: an image of the scene,
//! from where file_search.zig finds it. What is not found is a warning.

const std = @import("std");
const diagnostic_file = @import("../diagnostic.zig");
const Allocator = std.mem.Allocator;
const FileSearch = @import("file_search.zig");
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
    var search: FileSearch = try .init(images.files.resources, images.arena, folder, name);
    var first_reason: Message = .{};
    const image = while (try search.next()) |path| {
        var reason: Message = .{};
        const found = images.files.get(path, title.text(), &reason) catch |err| switch (err) {
            error.OutOfMemory => |failure| return failure,
            error.Overwritten => return images.diagnostic.fail(
                error.InputOutput,
                "image {s} {s}",
                .{ title.text(), reason.text() },
            ),
            error.Unreadable => {
                if (search.isFirst()) first_reason = reason;
                continue;
            },
        };
        if (search.isOtherCase())
            images.diagnostic.forgiveEach("image {s} is {f}", .{
                title.text(), diagnostic_file.quote(path),
            });
        break found;
    } else none: {
        images.diagnostic.warn("image {s} {s}, left out", .{ title.text(), first_reason.text() });
        break :none null;
    };
    try images.known.put(images.arena, key, image);
    return image;
}
