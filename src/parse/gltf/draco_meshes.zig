//! KHR_draco_mesh_compression: accessors get their data from a primitive's compressed stream.
//!
//! In: a primitive with the extension. Out: its accessors, decoded, in the state that the reader's
//! parts share: from there on they are as any other. Where the file has the plain data as well, the
//! extension is ignored, as it may be, and every build draws the same.

const std = @import("std");
const accessors = @import("../accessor.zig");
const buffer_views = @import("buffer_views.zig");
const c = @import("../cgltf.zig");
const diagnostic = @import("../../diagnostic.zig");
const draco = @import("../../decode.zig").draco;
const gltf_accessors = @import("accessors.zig");
const Error = Source.Error;
const Place = @import("meshes.zig").Place;
const Source = @import("source.zig");

/// An accessor whose elements are in a stream.
pub const Decoded = struct {
    /// The buffer view with the stream.
    view: u32,
    accessor: accessors.Accessor,
};

/// Memory that decoding may take, in bytes: so much, and for each vertex and each index. What the
/// file says of these is charged before, so that a short one cannot claim to have many.
const decoder_bytes_min: u64 = 16 << 20;
const decoder_bytes_of_each: u64 = 256;
const charged_bytes_of_each: u64 = 32;

/// Decodes the accessors of a primitive; false where they have plain data.
pub fn decode(source: *Source, primitive: *const c.cgltf_primitive, place: Place) Error!bool {
    if (primitive.has_draco_mesh_compression == 0) return false;
    const position = find(primitive, "POSITION") orelse return false;
    if (Source.item(position, 0).buffer_view != null) return false;
    if (!draco.is_held) return source.fail(
        "{f}: its data is in 'KHR_draco_mesh_compression', and this build has no Draco (-Ddraco)",
        .{place},
    );
    const compressed = &primitive.draco_mesh_compression;
    const view = Source.indexOf(source.data.buffer_views, compressed.buffer_view);
    const position_index = Source.indexOf(source.data.accessors, position);
    if (source.draco.get(position_index)) |known| if (known.view == view) return true;
    const indices = primitive.indices orelse
        return source.fail("{f}: compressed by Draco, but without indices", .{place});
    const indices_index = Source.indexOf(source.data.accessors, indices);
    try source.need(.accessors, position_index);
    try source.need(.accessors, indices_index);
    const stream = try buffer_views.contents(source, compressed.buffer_view) orelse
        return source.fail("buffer view {d}: its buffer has no data", .{view});
    const count = @as(u64, Source.item(position, 0).count) +| Source.item(indices, 0).count;
    try source.charge(charged_bytes_of_each *| count);
    var mesh: draco.Mesh = undefined;
    var reason: diagnostic.Message = .{};
    const bytes_max = decoder_bytes_min +| decoder_bytes_of_each *| count;
    mesh.init(source.gpa, stream, bytes_max, &reason) catch |err| return switch (err) {
        error.OutOfMemory => error.OutOfMemory,
        error.InvalidStream => source.fail("buffer view {d}: {s}", .{ view, reason.text() }),
    };
    defer mesh.deinit();
    const decoder: Decoder = .{ .source = source, .mesh = &mesh, .view = view };
    try decoder.indices(indices_index);
    const attributes = Source.slice(compressed.attributes, compressed.attributes_count);
    for (attributes) |*attribute| {
        const name = std.mem.span(@as([*:0]const u8, attribute.name));
        const accessor = find(primitive, name) orelse continue;
        const id = Source.indexOf(source.data.accessors, attribute.data);
        try decoder.attribute(Source.indexOf(source.data.accessors, accessor), id);
    }
    return true;
}

/// The accessor of a primitive's attribute.
fn find(primitive: *const c.cgltf_primitive, name: []const u8) [*c]c.cgltf_accessor {
    const attributes = Source.slice(primitive.attributes, primitive.attributes_count);
    for (attributes) |*attribute| {
        const found = std.mem.span(@as([*:0]const u8, attribute.name));
        if (std.mem.eql(u8, found, name)) return attribute.data;
    }
    return null;
}

/// Fills the accessors of one stream.
const Decoder = struct {
    source: *Source,
    mesh: *const draco.Mesh,
    view: u32,

    fn indices(decoder: Decoder, index: u32) Error!void {
        const count = @as(u64, decoder.mesh.triangleCount()) * 3;
        const accessor: accessors.Accessor = .{
            .component = .u32,
            .component_count = 1,
            .normalized = false,
            .count = try decoder.checkCount(index, count, "indices"),
            .base = null,
            .sparse = null,
        };
        const bytes = try decoder.keep(index, accessor) orelse return;
        decoder.mesh.triangles(@ptrCast(bytes));
    }

    fn attribute(decoder: Decoder, index: u32, id: u32) Error!void {
        const source = decoder.source;
        var accessor = try gltf_accessors.describe(source, index);
        accessor.count = try decoder.checkCount(index, decoder.mesh.vertexCount(), "vertices");
        const bytes = try decoder.keep(index, accessor) orelse return;
        const component: draco.Component = switch (accessor.component) {
            inline else => |tag| @field(draco.Component, @tagName(tag)),
        };
        if (!decoder.mesh.attribute(id, component, accessor.component_count, bytes)) {
            @memset(bytes, 0); // Others may draw with it.
            return source.fail("accessor {d}: its compressed data has no attribute {d}, " ++
                "or one that does not fit its type", .{ index, id });
        }
    }

    fn checkCount(decoder: Decoder, index: u32, count: u64, what: []const u8) Error!u32 {
        const expected = Source.item(decoder.source.data.accessors, index).count;
        if (count != expected or count == 0) return decoder.source.fail(
            "accessor {d}: count is {d}, its compressed data has {d} {s}",
            .{ index, expected, count, what },
        );
        return std.math.cast(u32, count) orelse decoder.source.fail(
            "accessor {d}: {d} {s} are too many",
            .{ index, count, what },
        );
    }

    /// Memory for the elements of an accessor, which is the source's from now on; null where they
    /// are there.
    fn keep(decoder: Decoder, index: u32, accessor: accessors.Accessor) Error!?[]align(4) u8 {
        const source = decoder.source;
        const gpa = source.gpa;
        if (source.draco.get(index)) |known| {
            if (known.view == decoder.view) return null;
            return source.fail("accessor {d}: buffer views {d} and {d} have its data", .{
                index, known.view, decoder.view,
            });
        }
        const stride = accessor.elementBytes();
        const byte_count = @as(u64, stride) * accessor.count;
        try source.charge(byte_count);
        const bytes = try gpa.alignedAlloc(u8, .@"4", @intCast(byte_count));
        errdefer gpa.free(bytes);
        var decoded: Decoded = .{ .view = decoder.view, .accessor = accessor };
        decoded.accessor.base = .{ .bytes = bytes, .stride = stride };
        try source.draco.put(gpa, index, decoded);
        return bytes;
    }
};
