//! One of the things that a file counts and may name: a scene, a material variant.
//!
//! In: cgltf's list of them, and which one is asked for, by its index or its name. Out: an index,
//! or one line that lists what there is.

const std = @import("std");
const escapes = @import("../json/escapes.zig");
const quote = @import("../../diagnostic.zig").quote;
const Choice = @import("../../settings.zig").Choice;
const Source = @import("source.zig");
const Allocator = std.mem.Allocator;

/// Index of what is asked for; null: nothing is. `noun` is what the things are called, `unknown`
/// the error where none is the one.
pub fn find(
    source: *const Source,
    list: anytype,
    choice: Choice,
    comptime noun: []const u8,
    comptime unknown: anytype,
) (error{OutOfMemory} || @TypeOf(unknown))!?u32 {
    const known: Names(std.meta.Elem(@TypeOf(list))) = .{ .gpa = source.gpa, .list = list };
    switch (choice) {
        .default => return null,
        .index => |index| {
            if (index < list.len) return index;
            const parts = .{ index, known };
            return source.diagnostic.fail(unknown, "no " ++ noun ++ " {d}; {f}", parts);
        },
        .name => |wanted| {
            for (list, 0..) |*candidate, index| {
                const name = try nameOf(source.gpa, candidate) orelse continue;
                defer source.gpa.free(name);
                if (std.mem.eql(u8, name, wanted)) return @intCast(index);
            }
            const parts = .{ quote(wanted), known };
            return source.diagnostic.fail(unknown, "no " ++ noun ++ " {f}; {f}", parts);
        },
    }
}

/// The name of a thing of cgltf's, from `allocator`; null: it has none.
pub fn nameOf(allocator: Allocator, thing: anytype) error{OutOfMemory}!?[]const u8 {
    if (thing.name == null) return null;
    return try escapes.decodeString(allocator, std.mem.span(@as([*:0]const u8, thing.name)));
}

/// Prints the things of a file: index and name, if any.
fn Names(comptime Thing: type) type {
    return struct {
        gpa: Allocator,
        list: []const Thing,

        /// Called by `{f}`.
        pub fn format(names: @This(), writer: *std.Io.Writer) std.Io.Writer.Error!void {
            if (names.list.len == 0) return writer.writeAll("the file has none");
            try writer.writeAll("the file has ");
            for (names.list, 0..) |*thing, index| {
                if (index > 0) try writer.writeAll(", ");
                try writer.print("{d}", .{index});
                const found = nameOf(names.gpa, thing) catch null; // An index alone will do.
                const name = found orelse continue;
                defer names.gpa.free(name);
                try writer.print(" {f}", .{quote(name)});
            }
        }
    };
}
