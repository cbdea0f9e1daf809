//! The bytes of glTF's buffer views: as their buffer has them, or decompressed.
//!
//! In: buffer views (glTF 2.0, section 3.6.1), with EXT_meshopt_compression or
//! KHR_meshopt_compression. Out: as many bytes as a view's byteLength says. A compressed view is
//! decompressed when it is first asked for, and kept; the uncompressed buffer that it names as well
//! is not looked at, and not even read where nothing else needs it.

const std = @import("std");
const c = @import("../cgltf.zig");
const decode = @import("../../decode.zig");
const diagnostic = @import("../../diagnostic.zig");
const Allocator = std.mem.Allocator;
const Error = Source.Error;
const Source = @import("source.zig");
const meshopt = decode.meshopt;

/// Compares every view with its buffer: those that are drawn have been.
pub fn checkRest(source: *const Source) Error!void {
    const views = Source.slice(source.data.buffer_views, source.data.buffer_views_count);
    for (views, 0..) |*view, index| {
        if (source.findBroken(.buffer_views, index) != null) continue;
        check(source, view, index) catch |err| try source.excuse(err);
        if (view.stride > 4 and view.stride % 4 != 0) source.forgive(
            "buffer view {d}: byteStride {d} is no multiple of 4",
            .{ index, view.stride },
        );
        const extent: Extent = .of(source, view);
        const byte_length = view.buffer[0].size;
        if (extent.excess() == 0 and extent.end() > byte_length) source.forgive(
            "buffer view {d}: {d} bytes past the byteLength of its buffer {d}, where more is",
            .{ index, extent.end() - byte_length, extent.buffer },
        );
    }
}

/// Compares a view with its buffer, and its compressed data with theirs.
fn check(source: *const Source, view: *const c.cgltf_buffer_view, index: usize) Error!void {
    try source.need(.buffer_views, index);
    const extent: Extent = .of(source, view);
    if (view.has_meshopt_compression == 0) try source.need(.buffers, extent.buffer);
    if (extent.excess() > 0) return source.fail(
        "buffer view {d}: {d} bytes past its buffer {d}",
        .{ index, extent.excess(), extent.buffer },
    );
    if (view.size == 0) return source.fail("buffer view {d}: byteLength is 0", .{index});
    if (view.has_meshopt_compression == 0) return;
    const compressed: Extent = .of(source, &view.meshopt_compression);
    try source.need(.buffers, compressed.buffer);
    if (compressed.excess() > 0) return source.fail(
        "buffer view {d}: its compressed data is {d} bytes past buffer {d}",
        .{ index, compressed.excess(), compressed.buffer },
    );
}

/// A run of bytes in a buffer.
const Extent = struct {
    buffer: u32,
    /// As its byteLength says, or more where there is more.
    buffer_bytes: u64,
    offset: u64,
    size: u64,

    /// Of a buffer view, or of the compressed data of one.
    fn of(source: *const Source, part: anytype) Extent {
        const buffer = Source.indexOf(source.data.buffers, part.buffer);
        const there = if (source.buffers[buffer]) |known| known.len else 0;
        return .{
            .buffer = buffer,
            .buffer_bytes = @max(part.buffer[0].size, there),
            .offset = part.offset,
            .size = part.size,
        };
    }

    fn end(extent: Extent) u64 {
        return extent.offset +| extent.size;
    }

    /// How many of its bytes are past the buffer's end.
    fn excess(extent: Extent) u64 {
        return extent.end() -| extent.buffer_bytes;
    }

    /// Null where the buffer has no data; fails where it has less than it says.
    fn bytes(extent: Extent, source: *const Source) Error!?[]const u8 {
        const buffer = source.buffers[extent.buffer] orelse return null;
        if (extent.end() > buffer.len) return source.fail(
            "buffer {d}: has {d} bytes, its byteLength is {d}",
            .{ extent.buffer, buffer.len, extent.buffer_bytes },
        );
        return buffer[@intCast(extent.offset)..][0..@intCast(extent.size)];
    }
};

/// All bytes of a view, valid as long as the source; null where its buffer has no data.
pub fn contents(source: *Source, view: *const c.cgltf_buffer_view) Error!?[]const u8 {
    const index = Source.indexOf(source.data.buffer_views, view);
    try check(source, view, index);
    if (view.has_meshopt_compression == 0) return Extent.of(source, view).bytes(source);
    if (source.decompressed.get(index)) |known| return known;
    const extent: Extent = .of(source, &view.meshopt_compression);
    const stream = try extent.bytes(source) orelse return null;
    const layout = layoutOf(&view.meshopt_compression) orelse
        return source.fail("buffer view {d}: its compression has an unknown mode", .{index});
    var reason: diagnostic.Message = .{};
    meshopt.check(layout, stream, &reason) catch return failed(source, index, &reason);
    if (layout.bytes() != view.size) return source.fail(
        "buffer view {d}: {d} elements of {d} bytes do not make {d} bytes",
        .{ index, layout.count, layout.stride, view.size },
    );
    try source.charge(view.size);
    const bytes = try source.gpa.alignedAlloc(u8, meshopt.alignment, view.size);
    errdefer source.gpa.free(bytes);
    meshopt.decode(layout, stream, bytes, &reason) catch return failed(source, index, &reason);
    try source.decompressed.put(source.gpa, index, bytes);
    return bytes;
}

fn failed(source: *const Source, index: u32, reason: *const diagnostic.Message) Error {
    return source.fail("buffer view {d}: {s}", .{ index, reason.text() });
}

/// Null: an unknown mode.
fn layoutOf(raw: *const c.cgltf_meshopt_compression) ?meshopt.Layout {
    return .{
        .mode = switch (raw.mode) {
            .attributes => .attributes,
            .triangles => .triangles,
            .indices => .indices,
            else => return null,
        },
        .filter = switch (raw.filter) {
            .octahedral => .octahedral,
            .quaternion => .quaternion,
            .exponential => .exponential,
            .color => .color,
            else => .none,
        },
        .count = raw.count,
        .stride = raw.stride,
    };
}

/// By buffer: whether it is there for readers that cannot decompress, and only for these. The
/// caller frees the list.
pub fn findFallbacks(gpa: Allocator, data: *const c.cgltf_data) Allocator.Error![]bool {
    const is_fallback = try gpa.alloc(bool, data.buffers_count);
    @memset(is_fallback, false);
    const views = Source.slice(data.buffer_views, data.buffer_views_count);
    for (views) |*view| if (view.has_meshopt_compression != 0) {
        is_fallback[Source.indexOf(data.buffers, view.buffer)] = true;
    };
    for (views) |*view| {
        const compressed = &view.meshopt_compression;
        const read = if (view.has_meshopt_compression != 0) compressed.buffer else view.buffer;
        is_fallback[Source.indexOf(data.buffers, read)] = false;
    }
    return is_fallback;
}
