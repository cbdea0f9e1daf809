//! The bytes of glTF's buffers: from the GLB, from data URIs, from files beside the scene.
//!
//! In: the document, the GLB's binary chunk, the files of the scene. Out: for each buffer as many
//! bytes as its byteLength says (glTF 2.0, section 3.6.1). Images are not opened.

const std = @import("std");
const c = @import("../cgltf.zig");
const limits = @import("limits.zig");
const escapes = @import("../json/escapes.zig");
const uri = @import("uri.zig");
const diagnostic_data = @import("../../diagnostic.zig");
const Source = @import("source.zig");
const Resources = @import("../resource.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = diagnostic_data.Diagnostic;
const Error = Source.Error;
const quote = diagnostic_data.quote;

const Buffers = @This();

gpa: Allocator,
/// As many bytes as byteLength says; null where the file gives none.
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
    diagnostic: *Diagnostic,
) Error!Buffers {
    const gpa = resources.gpa;
    const list = try gpa.alloc(?[]const u8, data.buffers_count);
    var buffers: Buffers = .{ .gpa = gpa, .list = list };
    errdefer buffers.deinit();
    var total: u64 = 0;
    for (list, Source.slice(data.buffers, data.buffers_count), 0..) |*bytes, *buffer, index| {
        total +|= buffer.size;
        if (total > limits.buffer_bytes_max) return diagnostic.fail(
            error.InvalidInput,
            "buffer {d}: {d} bytes of buffers are over the limit of {d}",
            .{ index, total, limits.buffer_bytes_max },
        );
        if (buffer.size == 0) return diagnostic.fail(
            error.InvalidInput,
            "buffer {d}: byteLength is 0",
            .{index},
        );
        bytes.* = if (buffer.uri != null)
            try buffers.loadUri(buffer, index, resources, diagnostic)
        else if (index == 0 and binary != null)
            // A buffer without URI is the GLB's if it is the first, else an extension's.
            try whole(binary.?, buffer.size, index, diagnostic)
        else
            null;
    }
    return buffers;
}

fn loadUri(
    buffers: *Buffers,
    buffer: *const c.cgltf_buffer,
    index: usize,
    resources: *Resources,
    diagnostic: *Diagnostic,
) Error![]const u8 {
    const gpa = buffers.gpa;
    const text = std.mem.span(@as([*:0]const u8, buffer.uri));
    switch (uri.classify(text)) {
        .base64 => |digits| {
            // Before anything of that size is allocated.
            if (buffer.size > digits.len / 4 * 3 + 3) return diagnostic.fail(
                error.InvalidInput,
                "buffer {d}: byteLength {d} is more than its data URI holds",
                .{ index, buffer.size },
            );
            const bytes = uri.decodeBase64(gpa, digits) catch |err| return switch (err) {
                error.OutOfMemory => error.OutOfMemory,
                error.NotBase64 => diagnostic.fail(
                    error.InvalidInput,
                    "buffer {d}: its data URI is not valid base64",
                    .{index},
                ),
            };
            try buffers.own(bytes);
            return try whole(bytes, buffer.size, index, diagnostic);
        },
        .data_not_base64 => return diagnostic.fail(
            error.InvalidInput,
            "buffer {d}: its data URI is not base64",
            .{index},
        ),
        .scheme => |scheme| return diagnostic.fail(
            error.InvalidInput,
            "buffer {d}: URIs of the scheme {f} are not read, only files and data",
            .{ index, quote(scheme) },
        ),
        .path => |encoded| {
            const bytes = try buffers.loadFile(encoded, index, resources, diagnostic);
            return try whole(bytes, buffer.size, index, diagnostic);
        },
    }
}

/// Takes over `bytes`, which are freed even when this fails.
fn own(buffers: *Buffers, bytes: [:0]const u8) error{OutOfMemory}!void {
    errdefer buffers.gpa.free(bytes);
    try buffers.owned.append(buffers.gpa, bytes);
}

fn loadFile(
    buffers: *Buffers,
    encoded: []const u8,
    index: usize,
    resources: *Resources,
    diagnostic: *Diagnostic,
) Error![]const u8 {
    const gpa = buffers.gpa;
    const text = try escapes.decodeString(gpa, encoded);
    defer gpa.free(text);
    const path = uri.decodePath(gpa, text) catch |err| return switch (err) {
        error.OutOfMemory => error.OutOfMemory,
        error.BadEscape => diagnostic.fail(
            error.InvalidInput,
            "buffer {d}: {f} is not a valid path",
            .{ index, quote(text) },
        ),
    };
    defer gpa.free(path);
    var reason: diagnostic_data.Message = .{};
    const file = resources.read(path, &reason) catch |err| return if (err == error.OutOfMemory)
        err
    else
        diagnostic.fail(err, "buffer {d}: {f} {s}", .{ index, quote(text), reason.text() });
    try buffers.own(file.bytes);
    return file.bytes;
}

fn whole(
    bytes: []const u8,
    byte_length: u64,
    index: usize,
    diagnostic: *Diagnostic,
) error{InvalidInput}![]const u8 {
    if (bytes.len >= byte_length) return bytes[0..@intCast(byte_length)];
    return diagnostic.fail(
        error.InvalidInput,
        "buffer {d}: has {d} bytes, its byteLength is {d}",
        .{ index, bytes.len, byte_length },
    );
}
