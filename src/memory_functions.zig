//! memcpy, memmove and memset by the widest registers of a level of processors.
//!
//! In: what the compiler, which calls them for values of any size, hands to them. Out: two
//! functions, which `release.zig` chooses as it does the program; those of the run-time library are
//! there once, for the lowest level. Short pieces are two vectors that overlap, long ones a loop
//! whose writes are aligned. To be compiled so that loops are not made calls of what they define.

const std = @import("std");
const builtin = @import("builtin");
const config = @import("config");

/// As C has them; `move` copies forwards or backwards, so that it is memcpy as well.
pub const Functions = extern struct {
    move: *const fn (to: [*]u8, from: [*]const u8, count: usize) callconv(.c) [*]u8,
    set: *const fn (to: [*]u8, byte: c_int, count: usize) callconv(.c) [*]u8,
};

/// Those for the target.
pub const functions: Functions = .{ .move = move, .set = set };

/// Name of the symbol of those of a level.
pub fn nameOf(comptime level: []const u8) []const u8 {
    return "rl_memory_" ++ level;
}

comptime {
    if (config.level.len != 0) @export(&functions, .{ .name = nameOf(config.level) });
}

/// Bytes of a register.
const width = if (builtin.cpu.arch != .x86_64)
    16
else if (std.Target.x86.featureSetHas(builtin.cpu.features, .avx512f))
    64
else if (std.Target.x86.featureSetHas(builtin.cpu.features, .avx))
    32
else
    16;

/// So many a pass of a loop.
const unroll = 4;

/// Some bytes at any place.
fn Piece(comptime size: usize) type {
    const Value = if (size <= 8) @Int(.unsigned, 8 * size) else @Vector(size, u8);
    return struct {
        inline fn load(from: [*]const u8) Value {
            return @as(*align(1) const Value, @ptrCast(from)).*;
        }

        inline fn store(to: [*]u8, value: Value) void {
            @as(*align(1) Value, @ptrCast(to)).* = value;
        }

        inline fn splat(byte: u8) Value {
            const bytes: @Vector(size, u8) = @splat(byte);
            return @bitCast(bytes);
        }
    };
}

const Widest = Piece(width);

fn move(to: [*]u8, from: [*]const u8, count: usize) callconv(.c) [*]u8 {
    @setRuntimeSafety(false);
    if (count == 0) return to;
    comptime var size = 1;
    inline while (size <= width) : (size *= 2) {
        if (count <= 2 * size) {
            const piece = Piece(size);
            const first, const last = .{ piece.load(from), piece.load(from + count - size) };
            piece.store(to, first);
            piece.store(to + count - size, last);
            return to;
        }
    }
    if (@intFromPtr(to) -% @intFromPtr(from) >= count)
        moveForwards(to, from, count)
    else
        moveBackwards(to, from, count);
    return to;
}

inline fn moveForwards(to: [*]u8, from: [*]const u8, count: usize) void {
    @setRuntimeSafety(false);
    const first, const last = .{ Widest.load(from), Widest.load(from + count - width) };
    var at = width - @intFromPtr(to) % width;
    while (at + unroll * width < count) : (at += unroll * width) {
        var values: [unroll]@TypeOf(first) = undefined;
        inline for (&values, 0..) |*value, index| value.* = Widest.load(from + at + index * width);
        inline for (values, 0..) |value, index| Widest.store(to + at + index * width, value);
    }
    while (at + width < count) : (at += width) Widest.store(to + at, Widest.load(from + at));
    // Not before: `from` may begin within the first.
    Widest.store(to, first);
    Widest.store(to + count - width, last);
}

inline fn moveBackwards(to: [*]u8, from: [*]const u8, count: usize) void {
    @setRuntimeSafety(false);
    const first, const last = .{ Widest.load(from), Widest.load(from + count - width) };
    var left = count - @intFromPtr(to + count) % width;
    while (left > unroll * width) : (left -= unroll * width) {
        var values: [unroll]@TypeOf(first) = undefined;
        const part = left - unroll * width;
        inline for (&values, 0..) |*value, index| {
            value.* = Widest.load(from + part + index * width);
        }
        inline for (values, 0..) |value, index| Widest.store(to + part + index * width, value);
    }
    while (left > width) : (left -= width)
        Widest.store(to + left - width, Widest.load(from + left - width));
    Widest.store(to + count - width, last);
    Widest.store(to, first);
}

fn set(to: [*]u8, byte: c_int, count: usize) callconv(.c) [*]u8 {
    @setRuntimeSafety(false);
    if (count == 0) return to;
    const wanted: u8 = @truncate(@as(c_uint, @bitCast(byte)));
    comptime var size = 1;
    inline while (size <= width) : (size *= 2) {
        if (count <= 2 * size) {
            const piece = Piece(size);
            piece.store(to, piece.splat(wanted));
            piece.store(to + count - size, piece.splat(wanted));
            return to;
        }
    }
    const value = Widest.splat(wanted);
    Widest.store(to, value);
    var at = width - @intFromPtr(to) % width;
    while (at + unroll * width < count) : (at += unroll * width) {
        inline for (0..unroll) |index| Widest.store(to + at + index * width, value);
    }
    while (at + width < count) : (at += width) Widest.store(to + at, value);
    Widest.store(to + count - width, value);
    return to;
}

const testing = std.testing;

test "pieces of all lengths go wherever they overlap, and nothing beside them changes" {
    const space = 24 * width;
    var memory: [space]u8 = undefined;
    var expected: [space]u8 = undefined;
    var count: usize = 0;
    while (count < 12 * width) : (count += if (count < 3 * width) 1 else 37) {
        for ([_]usize{ 0, 1, width / 2 + 3, width, 5 * width + 1 }) |distance| {
            for ([_][2]usize{ .{ 3, 3 + distance }, .{ 3 + distance, 3 } }) |places| {
                const to, const from = places;
                for (&memory, 0..) |*byte, at| byte.* = @truncate(at * 7 + at / 256);
                expected = memory;
                for (0..count) |at| expected[to + at] = memory[from + at];
                const moved = functions.move(memory[to..].ptr, memory[from..].ptr, count);
                try testing.expectEqual(memory[to..].ptr, moved);
                try testing.expectEqualSlices(u8, &expected, &memory);
            }
            @memset(expected[distance..][0..count], 0xc3);
            _ = functions.set(memory[distance..].ptr, -61, count);
            try testing.expectEqualSlices(u8, &expected, &memory);
        }
    }
}
