//! State of the glTF reader that its parts share: the document, its buffers, where results go.
//!
//! Nothing is checked here but that a reference is one. Memory from `arena` is the scene's and
//! stays; memory from `gpa` is given back before the reader ends.

const std = @import("std");
const c = @import("../cgltf.zig");
const draco_meshes = @import("draco_meshes.zig");
const json = @import("../json.zig");
const schema = @import("schema.zig");
const scene = @import("../../scene.zig");
const diagnostic_data = @import("../../diagnostic.zig");
const Diagnostic = diagnostic_data.Diagnostic;
const Message = diagnostic_data.Message;
const Allocator = std.mem.Allocator;
const Lenience = @import("../json/lenience.zig");
const assert = std.debug.assert;
const Source = @This();

gpa: Allocator,
/// The scene that results go to, and its memory.
builder: *scene.Builder,
arena: Allocator,
data: *const c.cgltf_data,
/// All bytes of each buffer that there are; null where the file gives none.
buffers: []const ?[]const u8 = &.{},
/// Contents of the buffer views that have been decompressed.
decompressed: std.AutoHashMapUnmanaged(u32, []align(4) const u8) = .empty,
/// Accessors whose elements have been decoded.
draco: std.AutoHashMapUnmanaged(u32, draco_meshes.Decoded) = .empty,
diagnostic: *Diagnostic,
/// Numbers of nodes that are not exact in single precision, by node.
doubles: []const json.Double = &.{},
/// Elements that are left out of the document, and why.
lenience: *const Lenience,
/// Whether what requires unknown extensions is drawn all the same.
force: bool = false,
/// Bytes that decoded vertices and triangles may still take, and undrawn ones that are looked at.
decoded_bytes_left: u64 = 0,
/// Accessors that have been resolved, their sparse indices in range.
resolved: std.DynamicBitSetUnmanaged = .{},
/// Nodes of the scene that are not shown (KHR_node_visibility), if there are any.
hidden: std.DynamicBitSetUnmanaged = .{},
/// These are there all the same, for animations may show them; of what is below them they say
/// nothing.
keeps_hidden: bool = false,

/// See parse.zig.
pub const Error = @import("../resource.zig").Error;

/// Frees what the reader has noted.
pub fn deinit(source: *Source) void {
    var contents = source.decompressed.valueIterator();
    while (contents.next()) |bytes| source.gpa.free(bytes.*);
    source.decompressed.deinit(source.gpa);
    var decoded = source.draco.valueIterator();
    while (decoded.next()) |entry| {
        const bytes: []align(4) const u8 = @alignCast(entry.accessor.base.?.bytes);
        source.gpa.free(bytes);
    }
    source.draco.deinit(source.gpa);
    source.resolved.deinit(source.gpa);
    source.hidden.deinit(source.gpa);
    source.* = undefined;
}

/// Ends the reader with one line.
pub fn fail(
    source: *const Source,
    comptime format: []const u8,
    arguments: anytype,
) error{InvalidInput} {
    return source.diagnostic.invalid(format, arguments);
}

/// Adds a warning.
pub fn warn(source: *const Source, comptime format: []const u8, arguments: anytype) void {
    source.diagnostic.warn(format, arguments);
}

/// Adds a warning of what is wrong and can be read all the same; see `Diagnostic.forgive`.
pub fn forgive(source: *const Source, comptime format: []const u8, arguments: anytype) void {
    source.diagnostic.forgive(format, arguments);
}

/// The same for what has names of its own; see `Diagnostic.forgiveEach`.
pub fn forgiveEach(source: *const Source, comptime format: []const u8, arguments: anytype) void {
    source.diagnostic.forgiveEach(format, arguments);
}

/// Fails where the element is one that is left out of the document, and is to be drawn.
pub fn need(source: *const Source, list: schema.List, index: usize) Error!void {
    if (source.lenience.broken.count() == 0) return;
    const broken = source.findBroken(list, index) orelse return;
    const err: Error = if (broken.is_missing) error.InputOutput else error.InvalidInput;
    return source.diagnostic.fail(err, "{s}", .{broken.reason});
}

/// Why the element is left out; null: it is not.
pub fn findBroken(source: *const Source, list: schema.List, index: usize) ?Lenience.Broken {
    return source.lenience.broken.get(.{ .list = @backingInt(list), .index = @intCast(index) });
}

/// Makes an error of what is not drawn, or must not stop the rest, a warning.
pub fn excuse(source: *const Source, err: Error) error{OutOfMemory}!void {
    const line = try source.takeLine(err);
    source.forgiveUnneeded(line.text());
}

/// The line of an error that is no reason to give up.
pub fn takeLine(source: *const Source, err: Error) error{OutOfMemory}!Message {
    if (err == error.OutOfMemory) return error.OutOfMemory;
    defer source.diagnostic.message = .{};
    return source.diagnostic.message;
}

/// Says what is wrong with what is not drawn.
pub fn forgiveUnneeded(source: *const Source, reason: []const u8) void {
    source.forgive("{s}; nothing drawn needs it", .{reason});
}

/// Notes that all has been said of an accessor.
pub fn noteResolved(source: *Source, index: usize) error{OutOfMemory}!void {
    const count = source.data.accessors_count;
    if (source.resolved.bit_length < count) try source.resolved.resize(source.gpa, count, false);
    source.resolved.set(index);
}

/// Whether it has.
pub fn isResolved(source: *const Source, index: usize) bool {
    return index < source.resolved.bit_length and source.resolved.isSet(index);
}

/// Whether a node of the scene is not shown at any time.
pub fn isHidden(source: *const Source, node: u32) bool {
    if (source.keeps_hidden) return false;
    return node < source.hidden.bit_length and source.hidden.isSet(node);
}

/// Counts decoded data before it is allocated.
pub fn charge(source: *Source, byte_count: u64) Error!void {
    if (byte_count > source.decoded_bytes_left) return source.fail(
        "decoded meshes would need much more memory than the file's size explains",
        .{},
    );
    source.decoded_bytes_left -= byte_count;
}

/// Index of `element` in `list`. Asserts that it is an element of it.
pub fn indexOf(list: anytype, element: anytype) u32 {
    const bytes = @intFromPtr(element) - @intFromPtr(list);
    const size = @sizeOf(@typeInfo(@TypeOf(list)).pointer.child);
    assert(bytes % size == 0);
    return @intCast(bytes / size);
}

/// An element of cgltf's array.
pub fn item(list: anytype, index: usize) *const @typeInfo(@TypeOf(list)).pointer.child {
    return @ptrCast(&list[index]);
}

/// cgltf's array as a slice; it is null where the file has none.
pub fn slice(list: anytype, count: usize) []const @typeInfo(@TypeOf(list)).pointer.child {
    if (count == 0) return &.{};
    return list[0..count];
}
