//! Streams of meshoptimizer's codecs: attributes, triangles and indices, and what filters them.
//!
//! In: a stream and the layout of its elements, as EXT_meshopt_compression and
//! KHR_meshopt_compression have them (the first without version 1 and the filter of colours, which
//! are read all the same). Out: the elements, the same on every target. A layout is checked by the
//! rules of KHR_meshopt_compression ("JSON schema updates"), and a stream has to be as long as that
//! many elements take at least, before memory is asked for. Decoded indices may be any.

const std = @import("std");
const Message = @import("../diagnostic.zig").Message;
const filters = @import("meshopt/filters.zig");

pub const Mode = enum { attributes, triangles, indices };
pub const Filter = enum { none, octahedral, quaternion, exponential, color };

/// The elements of a stream.
pub const Layout = struct {
    mode: Mode,
    filter: Filter,
    count: u64,
    /// Bytes from one element to the next.
    stride: u64,

    /// Bytes of all elements.
    pub fn bytes(layout: Layout) u64 {
        return layout.count *| layout.stride;
    }
};

/// What the elements' memory is aligned to.
pub const alignment: std.mem.Alignment = .@"4";

/// `reason` says why.
pub const Error = error{InvalidStream};

/// Whether the layout is one, and whether a stream can hold as much.
pub fn check(layout: Layout, stream: []const u8, reason: *Message) Error!void {
    if (layout.count == 0) return invalid(reason, "count is 0", .{});
    const stride = layout.stride;
    const stride_fits = switch (layout.mode) {
        .attributes => stride % 4 == 0 and stride >= 4 and stride <= 256,
        .triangles, .indices => stride == 2 or stride == 4,
    };
    if (!stride_fits) return invalid(reason, "a byteStride of {d} for {s}", .{
        stride, @tagName(layout.mode),
    });
    if (layout.mode == .triangles and layout.count % 3 != 0)
        return invalid(reason, "{d} indices of triangles", .{layout.count});
    const filter_fits = switch (layout.filter) {
        .none => true,
        .octahedral, .color => layout.mode == .attributes and (stride == 4 or stride == 8),
        .quaternion => layout.mode == .attributes and stride == 8,
        .exponential => layout.mode == .attributes,
    };
    if (!filter_fits) return invalid(reason, "the filter {s} for {s} of {d} bytes", .{
        @tagName(layout.filter), @tagName(layout.mode), stride,
    });
    if (stream.len < 1 or stream.len < minimumBytes(layout, stream[0])) return invalid(
        reason,
        "{d} bytes cannot hold {d} elements",
        .{ stream.len, layout.count },
    );
}

/// Bytes of the shortest stream of such elements, by its first byte.
fn minimumBytes(layout: Layout, header: u8) u64 {
    const count = layout.count;
    switch (layout.mode) {
        // A code for each triangle, and the table of codes.
        .triangles => return (1 + 16) + count / 3,
        .indices => return (1 + 4) +| count,
        .attributes => {},
    }
    const stride = layout.stride;
    const block_count = @divCeil(count, @min((8192 / stride) & ~@as(u64, 15), 256));
    // Two bits for four bytes of a block in version 1, for sixteen elements in version 0.
    return if (header & 15 == 0)
        1 + @max(stride, 32) +| stride *| @divCeil(@divCeil(count, 16), 4)
    else
        1 + @max(stride + stride / 4, 24) +| block_count *| (stride / 4);
}

/// The elements of a stream that has passed `check`, into `out` of exactly their size.
pub fn decode(
    layout: Layout,
    stream: []const u8,
    out: []align(alignment.toByteUnits()) u8,
    reason: *Message,
) Error!void {
    std.debug.assert(out.len == layout.bytes());
    const call: Stream = .{
        .bytes = stream.ptr,
        .byte_count = stream.len,
        .count = @intCast(layout.count),
        .stride = @intCast(layout.stride),
        .out = out.ptr,
    };
    const is_whole = switch (layout.mode) {
        .attributes => rl_meshopt_attributes(&call),
        .triangles => rl_meshopt_triangles(&call),
        .indices => rl_meshopt_indices(&call),
    };
    if (!is_whole) return invalid(reason, "bad compressed data", .{});
    switch (layout.filter) {
        .none => {},
        .octahedral => if (layout.stride == 4)
            filters.octahedral(i8, @ptrCast(out))
        else
            filters.octahedral(i16, @ptrCast(out)),
        .quaternion => filters.quaternion(@ptrCast(out)),
        .exponential => filters.exponential(@ptrCast(out)),
        .color => if (layout.stride == 4)
            filters.color(u8, @ptrCast(out))
        else
            filters.color(u16, @ptrCast(out)),
    }
}

fn invalid(reason: *Message, comptime format: []const u8, arguments: anytype) Error {
    reason.set(format, arguments);
    return error.InvalidStream;
}

/// In the order of meshopt.cpp.
const Stream = extern struct {
    bytes: [*]const u8,
    byte_count: usize,
    count: usize,
    stride: usize,
    out: [*]u8,
};

extern fn rl_meshopt_attributes(stream: *const Stream) bool;
extern fn rl_meshopt_triangles(stream: *const Stream) bool;
extern fn rl_meshopt_indices(stream: *const Stream) bool;

test {
    _ = filters;
}

test check {
    const Case = struct { Layout, []const u8, ?[]const u8 };
    const version_0: [1 + 32 + 4]u8 = .{0xa0} ++ @as([36]u8, @splat(0));
    const version_1: [1 + 24 + 2]u8 = .{0xa1} ++ @as([26]u8, @splat(0));
    const flags: [1 + 16 + 2]u8 = .{0xe1} ++ @as([18]u8, @splat(0));
    for ([_]Case{
        .{ of(.attributes, .none, 64, 4), &version_0, null },
        .{ of(.attributes, .none, 65, 4), &version_0, "37 bytes cannot hold 65 elements" },
        .{ of(.attributes, .none, 512, 4), &version_1, null },
        .{ of(.attributes, .none, 513, 4), &version_1, "27 bytes cannot hold 513 elements" },
        .{ of(.attributes, .none, 1, 4), "", "0 bytes cannot hold 1 elements" },
        .{ of(.attributes, .none, 0, 4), &version_1, "count is 0" },
        .{ of(.attributes, .none, 1, 6), &version_1, "a byteStride of 6 for attributes" },
        .{ of(.attributes, .none, 1, 260), &version_1, "a byteStride of 260 for attributes" },
        .{
            of(.attributes, .none, std.math.maxInt(u64), 256),
            &version_0,
            "37 bytes cannot hold 18446744073709551615 elements",
        },
        .{ of(.triangles, .none, 6, 2), &flags, null },
        .{ of(.triangles, .none, 9, 2), &flags, "19 bytes cannot hold 9 elements" },
        .{ of(.triangles, .none, 7, 2), &flags, "7 indices of triangles" },
        .{ of(.triangles, .none, 6, 8), &flags, "a byteStride of 8 for triangles" },
        .{ of(.indices, .none, 14, 4), &flags, null },
        .{ of(.indices, .none, 15, 4), &flags, "19 bytes cannot hold 15 elements" },
        .{
            of(.attributes, .quaternion, 1, 4),
            &version_1,
            "the filter quaternion for attributes of 4 bytes",
        },
        .{
            of(.indices, .exponential, 1, 4),
            &flags,
            "the filter exponential for indices of 4 bytes",
        },
    }) |case| {
        var reason: Message = .{};
        if (case[2]) |expected| {
            try std.testing.expectError(error.InvalidStream, check(case[0], case[1], &reason));
            try std.testing.expectEqualStrings(expected, reason.text());
        } else try check(case[0], case[1], &reason);
    }
}

fn of(mode: Mode, filter: Filter, count: u64, stride: u64) Layout {
    return .{ .mode = mode, .filter = filter, .count = count, .stride = stride };
}
