//! Typed arrays as glTF lays them out, decoded into plain arrays.
//!
//! In: an `Accessor` whose byte ranges have been checked against their buffers. Out: every element
//! converted (glTF 2.0, section 3.6.2.2 and 3.11: normalised integers), sparse values put in place,
//! denormal numbers flushed. Nothing here can read outside the slices: an element's bytes are
//! sliced before they are read.

const std = @import("std");
const math = @import("../math.zig");
const assert = std.debug.assert;

/// The numbers that elements are made of.
pub const Component = enum {
    i8,
    u8,
    i16,
    u16,
    u32,
    f32,

    /// Size in bytes.
    pub fn bytes(component: Component) u8 {
        return switch (component) {
            .i8, .u8 => 1,
            .i16, .u16 => 2,
            .u32, .f32 => 4,
        };
    }
};

/// Elements in a run of bytes.
pub const Strided = struct {
    /// From the first byte of the first element to the last byte of the last.
    bytes: []const u8,
    /// From one element to the next, in bytes.
    stride: u32,
};

/// Values that replace some elements.
pub const Sparse = struct {
    /// Elements replaced, >= 1.
    count: u32,
    /// Their indices: u8, u16 or u32; where one stands twice, the last counts.
    indices: []const u8,
    index_component: Component,
    /// Their values, tightly packed.
    values: []const u8,

    /// The element that the value number `position` replaces.
    pub fn index(sparse: Sparse, position: usize) u32 {
        assert(position < sparse.count);
        return switch (sparse.index_component) {
            inline .u8, .u16, .u32 => |component| readInt(component, sparse.indices, position),
            else => unreachable,
        };
    }
};

/// A checked description of a typed array.
pub const Accessor = struct {
    component: Component,
    /// Numbers in an element: 1 to 4, or 4, 9, 16 for matrices.
    component_count: u8,
    /// Integers stand for 0..1 or -1..1.
    normalized: bool,
    count: u32,
    /// Null: all zero but for the sparse values.
    base: ?Strided,
    sparse: ?Sparse,

    /// Bytes of an element without padding.
    pub fn elementBytes(accessor: Accessor) u32 {
        return @as(u32, accessor.component.bytes()) * accessor.component_count;
    }
};

/// Converts every element to `width` floats. Returns the index of the first element that is not
/// finite, null when all are; `out` is whole in both cases. Asserts that `out` has the accessor's
/// length and `width` its number of components.
pub fn decodeFloats(comptime width: u8, accessor: Accessor, out: [][width]f32) ?usize {
    assert(out.len == accessor.count);
    assert(width == accessor.component_count);
    switch (accessor.component) {
        inline else => |component| {
            if (accessor.normalized) {
                spreadFloats(width, component, true, accessor, out);
            } else {
                spreadFloats(width, component, false, accessor, out);
            }
        },
    }
    if (accessor.component != .f32) return null;
    for (out, 0..) |element, index| {
        var finite = true;
        for (element) |value| finite = finite and std.math.isFinite(value);
        if (!finite) return index;
    }
    return null;
}

fn spreadFloats(
    comptime width: u8,
    comptime component: Component,
    comptime normalized: bool,
    accessor: Accessor,
    out: [][width]f32,
) void {
    const element_bytes = @as(usize, component.bytes()) * width;
    if (accessor.base) |base| {
        var offset: usize = 0;
        for (out) |*element| {
            const bytes = base.bytes[offset..][0..element_bytes];
            inline for (0..width) |axis| {
                element[axis] = readFloat(component, normalized, bytes, axis);
            }
            offset += base.stride;
        }
    } else @memset(out, @splat(0));
    const sparse = accessor.sparse orelse return;
    for (0..sparse.count) |position| {
        const bytes = sparse.values[position * element_bytes ..][0..element_bytes];
        const element = &out[sparse.index(position)];
        inline for (0..width) |axis| element[axis] = readFloat(component, normalized, bytes, axis);
    }
}

/// Copies an array of whole numbers and returns the largest. Asserts that `out` has the accessor's
/// length and that the accessor holds single unsigned integers.
pub fn decodeIndices(accessor: Accessor, out: []u32) u32 {
    assert(out.len == accessor.count);
    assert(accessor.component_count == 1);
    switch (accessor.component) {
        inline .u8, .u16, .u32 => |component| spreadIndices(component, accessor, out),
        else => unreachable,
    }
    var largest: u32 = 0;
    for (out) |index| largest = @max(largest, index);
    return largest;
}

fn spreadIndices(comptime component: Component, accessor: Accessor, out: []u32) void {
    if (accessor.base) |base| {
        var offset: usize = 0;
        for (out) |*index| {
            index.* = readInt(component, base.bytes[offset..][0..component.bytes()], 0);
            offset += base.stride;
        }
    } else @memset(out, 0);
    const sparse = accessor.sparse orelse return;
    for (0..sparse.count) |position| {
        out[sparse.index(position)] = readInt(component, sparse.values, position);
    }
}

/// The first element that is not finite, sparse values included; null where there is none.
pub fn findNotFinite(accessor: Accessor) ?usize {
    if (accessor.component != .f32) return null;
    if (accessor.base) |base| {
        for (0..accessor.count) |index| {
            const bytes = base.bytes[index * base.stride ..][0..accessor.elementBytes()];
            if (!allFinite(bytes)) return index;
        }
    }
    const sparse = accessor.sparse orelse return null;
    for (0..sparse.count) |position| {
        const element_bytes = accessor.elementBytes();
        const bytes = sparse.values[position * element_bytes ..][0..element_bytes];
        if (!allFinite(bytes)) return sparse.index(position);
    }
    return null;
}

fn allFinite(bytes: []const u8) bool {
    for (0..bytes.len / 4) |position| {
        const value: f32 = @bitCast(readInt(.u32, bytes, position));
        if (!std.math.isFinite(value)) return false;
    }
    return true;
}

/// The largest of all numbers, sparse values included; null where they are not unsigned integers.
pub fn largestInteger(accessor: Accessor) ?u32 {
    switch (accessor.component) {
        .i8, .i16, .f32 => return null,
        inline .u8, .u16, .u32 => |component| {
            var largest: u32 = 0;
            const width = accessor.component_count;
            if (accessor.base) |base| for (0..accessor.count) |index| {
                const bytes = base.bytes[index * base.stride ..][0..accessor.elementBytes()];
                for (0..width) |axis| largest = @max(largest, readInt(component, bytes, axis));
            };
            const sparse = accessor.sparse orelse return largest;
            for (0..@as(usize, sparse.count) * width) |position| {
                largest = @max(largest, readInt(component, sparse.values, position));
            }
            return largest;
        },
    }
}

inline fn readInt(comptime component: Component, bytes: []const u8, position: usize) u32 {
    const T = switch (component) {
        .u8 => u8,
        .u16 => u16,
        .u32 => u32,
        else => comptime unreachable,
    };
    const size = @sizeOf(T);
    return std.mem.readInt(T, bytes[position * size ..][0..size], .little);
}

inline fn readFloat(
    comptime component: Component,
    comptime normalized: bool,
    bytes: []const u8,
    comptime position: usize,
) f32 {
    const T = switch (component) {
        .i8 => i8,
        .u8 => u8,
        .i16 => i16,
        .u16 => u16,
        .u32, .f32 => u32,
    };
    const size = @sizeOf(T);
    const raw = std.mem.readInt(T, bytes[position * size ..][0..size], .little);
    if (component == .f32) return math.flushDenormal(@bitCast(raw));
    const value: f32 = @floatFromInt(raw);
    if (!normalized) return value;
    const scaled = value / @as(f32, @floatFromInt(std.math.maxInt(T)));
    // Two's complement has one number below -1.
    return if (scaled > -1) scaled else -1;
}

/// An accessor over `bytes`, for tests.
fn testAccessor(
    component: Component,
    component_count: u8,
    normalized: bool,
    count: u32,
    base: ?Strided,
) Accessor {
    return .{
        .component = component,
        .component_count = component_count,
        .normalized = normalized,
        .count = count,
        .base = base,
        .sparse = null,
    };
}

test "integers become floats, normalised ones 0..1 and -1..1" {
    const bytes = [_]u8{ 0x80, 0x81, 0, 0x7f, 0xff };
    var out: [5][1]f32 = undefined;
    const cases = .{
        .{ Component.u8, false, [5]f32{ 128, 129, 0, 127, 255 } },
        .{ Component.u8, true, [5]f32{ 128.0 / 255.0, 129.0 / 255.0, 0, 127.0 / 255.0, 1 } },
        .{ Component.i8, false, [5]f32{ -128, -127, 0, 127, -1 } },
        .{ Component.i8, true, [5]f32{ -1, -1, 0, 1, -1.0 / 127.0 } },
    };
    inline for (cases) |case| {
        const base: Strided = .{ .bytes = &bytes, .stride = 1 };
        const accessor = testAccessor(case[0], 1, case[1], 5, base);
        try std.testing.expectEqual(null, decodeFloats(1, accessor, &out));
        for (out, case[2]) |value, expected| try std.testing.expectEqual(expected, value[0]);
    }
    const wide = [_]u8{ 0x00, 0x80, 0xff, 0x7f, 0xff, 0xff };
    const base: Strided = .{ .bytes = &wide, .stride = 2 };
    _ = decodeFloats(1, testAccessor(.i16, 1, true, 3, base), out[0..3]);
    try std.testing.expectEqual([3][1]f32{ .{-1}, .{1}, .{-1.0 / 32767.0} }, out[0..3].*);
    _ = decodeFloats(1, testAccessor(.u16, 1, true, 3, base), out[0..3]);
    try std.testing.expectEqual(@as(f32, 1), out[2][0]);
}

test "elements lie a stride apart, unaligned, and the last one needs no padding" {
    var bytes: [1 + 2 * 16 + 12]u8 = @splat(0xee);
    for (0..3) |element| for (0..3) |axis| {
        const value: f32 = @floatFromInt(10 * element + axis);
        const offset = 1 + 16 * element + 4 * axis;
        std.mem.writeInt(u32, bytes[offset..][0..4], @bitCast(value), .little);
    };
    const base: Strided = .{ .bytes = bytes[1..], .stride = 16 };
    var out: [3][3]f32 = undefined;
    try std.testing.expectEqual(null, decodeFloats(3, testAccessor(.f32, 3, false, 3, base), &out));
    try std.testing.expectEqual([3][3]f32{ .{ 0, 1, 2 }, .{ 10, 11, 12 }, .{ 20, 21, 22 } }, out);
}

test "sparse values replace elements, and zeros where there is no base" {
    const indices = [_]u8{ 1, 0, 3, 0 };
    const values = [_]u8{ 7, 9 };
    const base_bytes = [_]u8{ 1, 2, 3, 4 };
    var accessor = testAccessor(.u8, 1, false, 4, .{ .bytes = &base_bytes, .stride = 1 });
    accessor.sparse = .{
        .count = 2,
        .indices = &indices,
        .index_component = .u16,
        .values = &values,
    };
    var whole: [4]u32 = undefined;
    try std.testing.expectEqual(9, decodeIndices(accessor, &whole));
    try std.testing.expectEqual([4]u32{ 1, 7, 3, 9 }, whole);
    try std.testing.expectEqual(9, largestInteger(accessor).?);
    accessor.base = null;
    var out: [4][1]f32 = undefined;
    try std.testing.expectEqual(null, decodeFloats(1, accessor, &out));
    try std.testing.expectEqual([4][1]f32{ .{0}, .{7}, .{0}, .{9} }, out);
}

test "denormal floats are flushed, infinite ones and NaNs are found" {
    const nan = std.math.nan(f32);
    const infinity = std.math.inf(f32);
    const cases = [_]struct { [3]f32, ?usize }{
        .{ .{ 1e-40, -1e-40, 1 }, null },
        .{ .{ 1, infinity, nan }, 1 },
        .{ .{ 1, 2, -infinity }, 2 },
        .{ .{ nan, 2, 3 }, 0 },
    };
    for (cases) |case| {
        var bytes: [12]u8 = undefined;
        for (case[0], 0..) |value, index| {
            std.mem.writeInt(u32, bytes[4 * index ..][0..4], @bitCast(value), .little);
        }
        const accessor = testAccessor(.f32, 1, false, 3, .{ .bytes = &bytes, .stride = 4 });
        var out: [3][1]f32 = undefined;
        try std.testing.expectEqual(case[1], decodeFloats(1, accessor, &out));
        try std.testing.expectEqual(case[1], findNotFinite(accessor));
        if (case[1] == null) {
            try std.testing.expectEqual(@as(u32, 0), @as(u32, @bitCast(out[0][0])));
            try std.testing.expectEqual(@as(u32, 0x8000_0000), @as(u32, @bitCast(out[1][0])));
        }
    }
}

test "whole numbers of every width" {
    const bytes = [_]u8{ 0xff, 0xff, 0xff, 0xff };
    var out: [4]u32 = undefined;
    const base: Strided = .{ .bytes = &bytes, .stride = 1 };
    try std.testing.expectEqual(0xff, decodeIndices(testAccessor(.u8, 1, false, 4, base), &out));
    const halves: Strided = .{ .bytes = &bytes, .stride = 2 };
    const accessor = testAccessor(.u16, 1, false, 2, halves);
    try std.testing.expectEqual(0xffff, decodeIndices(accessor, out[0..2]));
    const words: Strided = .{ .bytes = &bytes, .stride = 4 };
    const word = testAccessor(.u32, 1, false, 1, words);
    try std.testing.expectEqual(0xffff_ffff, decodeIndices(word, out[0..1]));
    try std.testing.expectEqual(null, largestInteger(testAccessor(.f32, 1, false, 1, words)));
}
