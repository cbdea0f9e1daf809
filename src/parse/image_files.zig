//! The image files that a scene names, each read once, whatever names and links lead to it.
//!
//! In: paths relative to the scene's folder. Out: images of the scene, their bytes as they are in
//! the file, in the scene's memory. What is no image shows when it is decoded.

const std = @import("std");
const Identity = @import("../identity.zig").Identity;
const Message = @import("../diagnostic.zig").Message;
const Resources = @import("resource.zig");
const scene = @import("../scene.zig");
const ImageFiles = @This();

/// All files together, in bytes.
pub const bytes_max: u64 = 4 << 30;

resources: *Resources,
builder: *scene.Builder,
known: std.AutoHashMapUnmanaged(Identity, u32) = .empty,
bytes_left: u64 = bytes_max,

/// See `Resources.readOptional`.
pub const Error = Resources.OptionalError;

/// Frees what is not the scene's.
pub fn deinit(files: *ImageFiles) void {
    files.known.deinit(files.resources.gpa);
    files.* = undefined;
}

/// The scene's image from the file at `path`, which messages call `name`, which is copied. On an
/// error `reason` says why not, as what follows the name.
pub fn get(files: *ImageFiles, path: []const u8, name: []const u8, reason: *Message) Error!u32 {
    const arena = files.builder.arena();
    const file = try files.resources.readOptional(arena, path, reason);
    if (file.identity) |identity| if (files.known.get(identity)) |image| {
        arena.free(file.bytes);
        return image;
    };
    if (file.bytes.len > files.bytes_left) {
        arena.free(file.bytes);
        const limit = std.fmt.comptimePrint("{d}", .{bytes_max});
        reason.set("and the images before are over " ++ limit ++ " bytes", .{});
        return error.Unreadable;
    }
    files.bytes_left -= file.bytes.len;
    const image = try files.builder.addImage(.{
        .name = try arena.dupe(u8, name),
        .bytes = file.bytes,
    });
    if (file.identity) |identity| try files.known.put(files.resources.gpa, identity, image);
    return image;
}
