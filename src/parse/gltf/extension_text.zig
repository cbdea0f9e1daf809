//! Extensions that cgltf leaves as JSON text.
//!
//! In: a list of extensions, of an object that has been checked by the schema. Out: one of them, as
//! a structure whose fields are named as the extension's properties.

const std = @import("std");
const c = @import("../cgltf.zig");
const Allocator = std.mem.Allocator;

/// The text of the extension with this name; null where there is none.
pub fn find(list: []const c.cgltf_extension, name: []const u8) ?[]const u8 {
    for (list) |*extension| {
        if (extension.name == null or extension.data == null) continue;
        const found = std.mem.span(@as([*:0]const u8, extension.name));
        if (std.mem.eql(u8, found, name)) return std.mem.span(extension.data);
    }
    return null;
}

/// What the text says, in memory from `arena`; null where it is not as `T` has it.
pub fn parse(comptime T: type, arena: Allocator, text: []const u8) error{OutOfMemory}!?T {
    const options: std.json.ParseOptions = .{ .ignore_unknown_fields = true };
    return std.json.parseFromSliceLeaky(T, arena, text, options) catch |err| switch (err) {
        error.OutOfMemory => |failure| return failure,
        else => return null,
    };
}
