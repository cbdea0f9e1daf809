//! The bytes of glTF's buffers: from the GLB, from data URIs, from files beside the scene.
//!
//! In: the document, the GLB's binary chunk, the folder of the scene. Out: for each buffer as many
//! bytes as its byteLength says (glTF 2.0, section 3.6.1). Images are not opened.

const std = @import("std");
const c = @import("cgltf");
const limits = @import("limits.zig");
const file = @import("../file.zig");
const escapes = @import("../json/escapes.zig");
const uri = @import("../uri.zig");
const diagnostic = @import("../../diagnostic.zig");
const Source = @import("source.zig");
const Identity = @import("../../identity.zig").Identity;
const Allocator = std.mem.Allocator;
const Diagnostic = diagnostic.Diagnostic;
const Error = Source.Error;
const Buffers = @This();

gpa: Allocator,
/// As many bytes as byteLength says; null where the file gives none.
list: []?[]const u8,
/// What `list` points into, other than the GLB.
owned: std.ArrayList([]u8) = .empty,

/// Where buffers may come from.
pub const Origin = struct {
    io: std.Io,
    /// The folder of the scene.
    folder: std.Io.Dir,
    allow_outside: bool,
    /// See parse/settings.zig.
    output: ?Identity,
    /// The GLB's BIN chunk.
    binary: ?[]const u8,
};

/// Frees what has been read and decoded.
pub fn deinit(buffers: *Buffers) void {
    for (buffers.owned.items) |bytes| buffers.gpa.free(bytes);
    buffers.owned.deinit(buffers.gpa);
    buffers.gpa.free(buffers.list);
    buffers.* = undefined;
}

/// Reads all buffers of the document.
pub fn load(
    gpa: Allocator,
    data: *const c.cgltf_data,
    origin: Origin,
    said: *Diagnostic,
) Error!Buffers {
    const list = try gpa.alloc(?[]const u8, data.buffers_count);
    var buffers: Buffers = .{ .gpa = gpa, .list = list };
    errdefer buffers.deinit();
    var total: u64 = 0;
    for (list, Source.slice(data.buffers, data.buffers_count), 0..) |*bytes, *buffer, index| {
        total +|= buffer.size;
        if (total > limits.buffer_bytes_max) return said.fail(
            error.InvalidInput,
            "buffer {d}: {d} bytes of buffers are over the limit of {d}",
            .{ index, total, limits.buffer_bytes_max },
        );
        if (buffer.size == 0) return said.fail(
            error.InvalidInput,
            "buffer {d}: byteLength is 0",
            .{index},
        );
        bytes.* = try buffers.loadOne(buffer, index, origin, said);
    }
    return buffers;
}

fn loadOne(
    buffers: *Buffers,
    buffer: *const c.cgltf_buffer,
    index: usize,
    origin: Origin,
    said: *Diagnostic,
) Error!?[]const u8 {
    const gpa = buffers.gpa;
    if (buffer.uri == null) {
        // A buffer without URI is the GLB's if it is the first, else an extension's.
        const binary = if (index == 0) origin.binary else null;
        return try whole(binary orelse return null, buffer.size, index, said);
    }
    const text = std.mem.span(@as([*:0]const u8, buffer.uri));
    switch (uri.classify(text)) {
        .base64 => |digits| {
            // Before anything of that size is allocated.
            if (buffer.size > digits.len / 4 * 3 + 3) return said.fail(
                error.InvalidInput,
                "buffer {d}: byteLength {d} is more than its data URI holds",
                .{ index, buffer.size },
            );
            const bytes = uri.decodeBase64(gpa, digits) catch |err| return switch (err) {
                error.OutOfMemory => error.OutOfMemory,
                error.NotBase64 => said.fail(
                    error.InvalidInput,
                    "buffer {d}: its data URI is not valid base64",
                    .{index},
                ),
            };
            try buffers.own(bytes);
            return try whole(bytes, buffer.size, index, said);
        },
        .data_not_base64 => return said.fail(
            error.InvalidInput,
            "buffer {d}: its data URI is not base64",
            .{index},
        ),
        .scheme => |scheme| return said.fail(
            error.InvalidInput,
            "buffer {d}: URIs of the scheme {f} are not read, only files and data",
            .{ index, diagnostic.quote(scheme) },
        ),
        .path => |encoded| {
            const bytes = try buffers.loadFile(encoded, index, origin, said);
            return try whole(bytes, buffer.size, index, said);
        },
    }
}

/// Takes over `bytes`, which are freed even when this fails.
fn own(buffers: *Buffers, bytes: []u8) error{OutOfMemory}!void {
    errdefer buffers.gpa.free(bytes);
    try buffers.owned.append(buffers.gpa, bytes);
}

fn loadFile(
    buffers: *Buffers,
    encoded: []const u8,
    index: usize,
    origin: Origin,
    said: *Diagnostic,
) Error![]const u8 {
    const gpa = buffers.gpa;
    const text = try escapes.decodeString(gpa, encoded);
    defer gpa.free(text);
    const name = diagnostic.quote(text);
    const path = uri.decodePath(gpa, text, origin.allow_outside) catch |err| return switch (err) {
        error.OutOfMemory => error.OutOfMemory,
        error.Outside => said.fail(
            error.InvalidInput,
            "buffer {d}: {f} is outside the scene's folder (see --allow-outside)",
            .{ index, name },
        ),
        error.BadEscape, error.HasNul, error.Empty => said.fail(
            error.InvalidInput,
            "buffer {d}: {f} is not a valid path",
            .{ index, name },
        ),
    };
    defer gpa.free(path);
    var reason: []const u8 = "";
    const opened = file.open(origin.io, origin.folder, path, origin.output, &reason) catch |err|
        return fileError(err, index, name, reason, said);
    defer opened.close(origin.io);
    if (!origin.allow_outside) try checkBelow(opened, index, name, origin, said);
    const bytes = file.read(gpa, origin.io, opened, limits.file_bytes_max, &reason) catch |err|
        return fileError(err, index, name, reason, said);
    try buffers.own(bytes);
    return bytes;
}

fn fileError(
    err: file.Error,
    index: usize,
    name: diagnostic.Quoted,
    reason: []const u8,
    said: *Diagnostic,
) Error {
    switch (err) {
        error.OutOfMemory => return error.OutOfMemory,
        error.InputOutput => {},
        error.NotRegular, error.TooLarge => return said.fail(
            error.InvalidInput,
            "buffer {d}: {f} {s}",
            .{ index, name, reason },
        ),
    }
    return said.fail(error.InputOutput, "buffer {d}: {f} {s}", .{ index, name, reason });
}

/// Links may lead out of the folder as well; the open file says where it really is.
fn checkBelow(
    opened: std.Io.File,
    index: usize,
    name: diagnostic.Quoted,
    origin: Origin,
    said: *Diagnostic,
) Error!void {
    var folder_buffer: [file.path_bytes_max]u8 = undefined;
    var file_buffer: [file.path_bytes_max]u8 = undefined;
    const below = below: {
        const folder_length = origin.folder.realPath(origin.io, &folder_buffer) catch
            break :below false;
        const file_length = opened.realPath(origin.io, &file_buffer) catch break :below false;
        break :below uri.isBelow(file_buffer[0..file_length], folder_buffer[0..folder_length]);
    };
    if (!below) return said.fail(
        error.InvalidInput,
        "buffer {d}: {f} is a link that leads outside the scene's folder (see --allow-outside)",
        .{ index, name },
    );
}

fn whole(
    bytes: []const u8,
    byte_length: u64,
    index: usize,
    said: *Diagnostic,
) error{InvalidInput}![]const u8 {
    if (bytes.len >= byte_length) return bytes[0..@intCast(byte_length)];
    return said.fail(
        error.InvalidInput,
        "buffer {d}: has {d} bytes, its byteLength is {d}",
        .{ index, bytes.len, byte_length },
    );
}
