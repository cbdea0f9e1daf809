//! The bytes of glTF's buffers: from the GLB, from data URIs, from files beside the scene.
//!
//! In: the document, the GLB's binary chunk, the files of the scene. Out: for each buffer the bytes
//! that there are, which may be more or fewer than its byteLength says (glTF 2.0, section 3.6.1:
//! padding; files that are slightly wrong). One that cannot be had is left out of the document: who
//! needs it fails. Images: textures.zig.

const std = @import("std");
const buffer_views = @import("buffer_views.zig");
const c = @import("../cgltf.zig");
const limits = @import("limits.zig");
const escapes = @import("../json/escapes.zig");
const uri = @import("uri.zig");
const diagnostic_data = @import("../../diagnostic.zig");
const Source = @import("source.zig");
const Resources = @import("../resource.zig");
const Allocator = std.mem.Allocator;
const Lenience = @import("../json/lenience.zig");
const List = @import("schema.zig").List;
const Diagnostic = diagnostic_data.Diagnostic;
const Error = Source.Error;
const quote = diagnostic_data.quote;

const Buffers = @This();

gpa: Allocator,
/// All bytes that there are, also beyond byteLength; null where the file gives none.
list: []?[]const u8,
/// What `list` points into, other than the GLB.
owned: std.ArrayList([:0]const u8) = .empty,

/// Frees what has been read and decoded.
pub fn deinit(buffers: *Buffers) void {
    for (buffers.owned.items) |bytes| buffers.gpa.free(bytes);
    buffers.owned.deinit(buffers.gpa);
    buffers.gpa.free(buffers.list);
    buffers.* = undefined;
}

/// Reads all buffers of the document; `binary` is the GLB's BIN chunk.
pub fn load(
    resources: *Resources,
    data: *const c.cgltf_data,
    binary: ?[]const u8,
    lenience: *Lenience,
    diagnostic: *Diagnostic,
) Error!Buffers {
    const gpa = resources.gpa;
    const list = try gpa.alloc(?[]const u8, data.buffers_count);
    var buffers: Buffers = .{ .gpa = gpa, .list = list };
    errdefer buffers.deinit();
    const is_fallback = try buffer_views.findFallbacks(gpa, data);
    defer gpa.free(is_fallback);
    var total: u64 = 0;
    for (list, Source.slice(data.buffers, data.buffers_count), 0..) |*bytes, *raw, index| {
        const reader: Reader = .{
            .buffers = &buffers,
            .resources = resources,
            .diagnostic = diagnostic,
            .raw = raw,
            .index = index,
        };
        bytes.* = null;
        if (is_fallback[index]) continue;
        total +|= raw.size;
        if (total > limits.buffer_bytes_max) return reader.fail(
            "{d} bytes of buffers are over the limit of {d}",
            .{ total, limits.buffer_bytes_max },
        );
        bytes.* = reader.read(binary) catch |err| none: {
            if (err == error.OutOfMemory or reader.isOverwritten()) return err;
            try lenience.leaveOut(@backingInt(List.buffers), @intCast(index), .{
                .reason = diagnostic.message.text(),
                .is_missing = err == error.InputOutput,
            });
            diagnostic.message.set("", .{});
            break :none null;
        };
    }
    return buffers;
}

/// Reads one buffer.
const Reader = struct {
    buffers: *Buffers,
    resources: *Resources,
    diagnostic: *Diagnostic,
    raw: *const c.cgltf_buffer,
    index: usize,

    fn read(reader: Reader, binary: ?[]const u8) Error!?[]const u8 {
        if (reader.raw.size == 0) return reader.fail("byteLength is 0", .{});
        if (reader.raw.uri != null) return try reader.fromUri();
        // A buffer without URI is the GLB's if it is the first, else an extension's.
        return if (reader.index == 0) binary else null;
    }

    /// Whether the error is one that counts whoever needs the file.
    fn isOverwritten(reader: Reader) bool {
        const said = reader.diagnostic.message.text();
        return std.mem.endsWith(u8, said, Resources.overwritten);
    }

    fn fail(reader: Reader, comptime format: []const u8, arguments: anytype) error{InvalidInput} {
        return reader.diagnostic.invalid("buffer {d}: " ++ format, .{reader.index} ++ arguments);
    }

    fn fromUri(reader: Reader) Error![]const u8 {
        const gpa = reader.buffers.gpa;
        const text = std.mem.span(@as([*:0]const u8, reader.raw.uri));
        const kind = uri.classify(text);
        // Before anything of that size is allocated.
        if (kind == .base64 and reader.raw.size > kind.base64.len / 4 * 3 + 3) return reader.fail(
            "byteLength {d} is more than its data URI holds",
            .{reader.raw.size},
        );
        var reason: diagnostic_data.Message = .{};
        const resolved = uri.resolve(gpa, gpa, text, &reason) catch |err| return switch (err) {
            error.OutOfMemory => error.OutOfMemory,
            error.InvalidInput => reader.fail("{s}", .{reason.text()}),
        };
        if (resolved.odd.len > 0)
            reader.diagnostic.forgive("buffer {d}: its URI {s}", .{ reader.index, resolved.odd });
        switch (resolved.target) {
            .bytes => |bytes| return reader.own(bytes),
            .path => |path| {
                defer gpa.free(path);
                return reader.fromFile(path);
            },
        }
    }

    /// Takes over `bytes`, which are freed even when this fails.
    fn own(reader: Reader, bytes: [:0]const u8) error{OutOfMemory}![]const u8 {
        errdefer reader.buffers.gpa.free(bytes);
        try reader.buffers.owned.append(reader.buffers.gpa, bytes);
        return bytes;
    }

    fn fromFile(reader: Reader, path: []const u8) Error![]const u8 {
        var reason: diagnostic_data.Message = .{};
        const file = reader.resources.read(path, &reason) catch |err| {
            if (err == error.OutOfMemory) return err;
            const parts = .{ reader.index, quote(path), reason.text() };
            return reader.diagnostic.fail(err, "buffer {d}: {f} {s}", parts);
        };
        return reader.own(file.bytes);
    }
};
