//! Draco's compressed triangle meshes, where the build holds its decoder (`-Ddraco`).
//!
//! In: a stream of a mesh (Draco bitstream 2.2, the one of KHR_draco_mesh_compression). Out: its
//! triangles, and its attributes as numbers of the types that are asked for. The library allocates
//! from an account of its own, because how much a stream asks for stands in no relation to its
//! length. The vertices of triangles may be any numbers.

const std = @import("std");
const Allocator = std.mem.Allocator;
const Message = @import("../diagnostic.zig").Message;
const memory_account = @import("../memory_account.zig");

/// Whether this build can decode.
pub const is_held = @import("config").has_draco;

/// `reason` says why where it is `InvalidStream`.
pub const Error = error{ InvalidStream, OutOfMemory };

/// What an attribute's numbers become.
pub const Component = enum(u32) { i8, u8, i16, u16, u32, f32 };

/// A decoded mesh. Must not move.
pub const Mesh = struct {
    account: memory_account.Account,
    heap: memory_account.LibraryHeap,
    raw: Raw,

    /// Decodes a stream, in at most `bytes_max` bytes of memory. Asserts that the build can.
    pub fn init(
        mesh: *Mesh,
        gpa: Allocator,
        stream: []const u8,
        bytes_max: u64,
        reason: *Message,
    ) Error!void {
        try checkHeader(stream, reason);
        mesh.account = .init(gpa, bytes_max);
        mesh.heap = .{ .gpa = mesh.account.allocator() };
        errdefer mesh.deinit();
        const hooks = mesh.heap.hooks();
        switch (rl_draco_decode(&hooks, stream.ptr, stream.len, &mesh.raw)) {
            .done => {},
            .broken => return invalid(reason, "bad compressed data", .{}),
            .exhausted => return if (mesh.account.refused.load(.monotonic) > 0)
                invalid(reason, "its compressed data needs more than {d} bytes", .{bytes_max})
            else
                error.OutOfMemory,
        }
    }

    /// Frees it.
    pub fn deinit(mesh: *Mesh) void {
        mesh.heap.deinit();
        mesh.* = undefined;
    }

    pub fn vertexCount(mesh: *const Mesh) u32 {
        return mesh.raw.vertex_count;
    }

    pub fn triangleCount(mesh: *const Mesh) u32 {
        return mesh.raw.triangle_count;
    }

    /// The vertices of all triangles into `out` of exactly their number.
    pub fn triangles(mesh: *const Mesh, out: [][3]u32) void {
        std.debug.assert(out.len == mesh.raw.triangle_count);
        rl_draco_triangles(&mesh.raw, out.ptr);
    }

    /// The attribute with this identifier, `width` numbers for each vertex, into `out` of exactly
    /// their bytes. False: there is none, or its numbers do not fit the type.
    pub fn attribute(
        mesh: *const Mesh,
        id: u32,
        component: Component,
        width: u8,
        out: []align(4) u8,
    ) bool {
        const bytes: usize = switch (component) {
            .i8, .u8 => 1,
            .i16, .u16 => 2,
            .u32, .f32 => 4,
        };
        std.debug.assert(out.len == @as(usize, mesh.raw.vertex_count) * width * bytes);
        return rl_draco_attribute(&mesh.raw, id, component, width, out.ptr);
    }
};

/// Magic, version, kind and method (Draco bitstream specification, section 4.1).
fn checkHeader(stream: []const u8, reason: *Message) Error!void {
    const header_bytes = 11;
    if (stream.len < header_bytes or !std.mem.startsWith(u8, stream, "DRACO"))
        return invalid(reason, "its compressed data is not Draco's", .{});
    if (stream[5] != 2 or stream[6] != 2) return invalid(
        reason,
        "version {d}.{d} of Draco's bitstream is not supported, only 2.2",
        .{ stream[5], stream[6] },
    );
    if (stream[7] != 1 or stream[8] > 1)
        return invalid(reason, "its compressed data is no mesh", .{});
}

fn invalid(reason: *Message, comptime format: []const u8, arguments: anytype) Error {
    reason.set(format, arguments);
    return error.InvalidStream;
}

/// In the order of draco.cpp.
const Raw = extern struct { mesh: ?*const anyopaque, vertex_count: u32, triangle_count: u32 };

const Outcome = enum(c_int) { done, exhausted, broken };

extern fn rl_draco_decode(
    memory: *const memory_account.Hooks,
    bytes: [*]const u8,
    byte_count: usize,
    out: *Raw,
) Outcome;
extern fn rl_draco_triangles(mesh: *const Raw, out: [*][3]u32) void;
extern fn rl_draco_attribute(
    mesh: *const Raw,
    id: u32,
    component: Component,
    component_count: u32,
    out: [*]u8,
) bool;

test checkHeader {
    for ([_]struct { []const u8, []const u8 }{
        .{ "DRACO\x02\x02\x01\x01\x00", "its compressed data is not Draco's" },
        .{ "DRACA\x02\x02\x01\x01\x00\x00", "its compressed data is not Draco's" },
        .{
            "DRACO\x02\x01\x01\x01\x00\x00",
            "version 2.1 of Draco's bitstream is not supported, only 2.2",
        },
        .{ "DRACO\x02\x02\x00\x01\x00\x00", "its compressed data is no mesh" },
        .{ "DRACO\x02\x02\x01\x02\x00\x00", "its compressed data is no mesh" },
    }) |case| {
        var reason: Message = .{};
        try std.testing.expectError(error.InvalidStream, checkHeader(case[0], &reason));
        try std.testing.expectEqualStrings(case[1], reason.text());
    }
}
