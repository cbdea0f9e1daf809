//! What makes attributes of the numbers that meshoptimizer's streams hold.
//!
//! In: decoded elements. Out: the same memory, as KHR_meshopt_compression, appendix B, says, to one
//! unit in the last place, in plain single precision and in a fixed order. What the extension
//! leaves open, for numbers that no encoder writes, is within the type's range as well, so that it
//! too is the same on every target.

const std = @import("std");

/// Filter 1: unit vectors from an octahedron. The third number is the octahedron's size, the fourth
/// stays.
pub fn octahedral(comptime T: type, elements: [][4]T) void {
    for (elements) |*element| {
        var x: f32 = @floatFromInt(element[0]);
        var y: f32 = @floatFromInt(element[1]);
        const z = @as(f32, @floatFromInt(element[2])) - @abs(x) - @abs(y);
        const fold = if (z < 0) z else 0;
        x += if (x < 0) -fold else fold;
        y += if (y < 0) -fold else fold;
        const length = @sqrt(x * x + y * y + z * z);
        const scale = @as(f32, std.math.maxInt(T)) / if (length > 0) length else 1;
        for (element[0..3], [3]f32{ x, y, z }) |*to, value| to.* = round(T, value * scale);
    }
}

/// Filter 2: unit quaternions from their three smaller numbers. The fourth says which is missing,
/// and the size of 1.
pub fn quaternion(elements: [][4]i16) void {
    const root_half = 0.70710678;
    for (elements) |*element| {
        const scale: f32 = root_half / @as(f32, @floatFromInt(element[3] | 3));
        const x = @as(f32, @floatFromInt(element[0])) * scale;
        const y = @as(f32, @floatFromInt(element[1])) * scale;
        const z = @as(f32, @floatFromInt(element[2])) * scale;
        const rest = 1 - x * x - y * y - z * z;
        const w = @sqrt(if (rest > 0) rest else 0);
        const missing: u2 = @intCast(element[3] & 3);
        for ([4]f32{ w, x, y, z }, 0..) |value, step| {
            element[missing +% @as(u2, @intCast(step))] = round(i16, value * 32767);
        }
    }
}

/// Filter 3: floats from an exponent of 8 bits above a mantissa of 24, both signed.
pub fn exponential(elements: []u32) void {
    for (elements) |*element| {
        const bits: i32 = @bitCast(element.*);
        const exponent: i64 = bits >> 24;
        const mantissa: f64 = @floatFromInt(bits << 8 >> 8);
        // A power of two in double precision, which reaches further than the exponent.
        const power: f64 = @bitCast((exponent + 1023) << 52);
        element.* = @bitCast(@as(f32, @floatCast(power * mantissa)));
    }
}

/// Filter 4: colours from luma, two differences and alpha, whose highest bit says how many bits
/// they have.
pub fn color(comptime T: type, elements: [][4]T) void {
    const Signed = @Int(.signed, @bitSizeOf(T));
    for (elements) |*element| {
        const luma: i32 = element[0];
        const orange: i32 = @as(Signed, @bitCast(element[1]));
        const green: i32 = @as(Signed, @bitCast(element[2]));
        const whole: i32 = element[3];
        const one = (@as(i32, 1) << @intCast(32 - @clz(whole | 1))) - 1;
        // It has one bit less than the colours: the last one stands twice.
        const alpha = ((whole << 1) & one) | (whole & 1);
        const scale = @as(f32, std.math.maxInt(T)) / @as(f32, @floatFromInt(one));
        for (element, [4]i32{
            luma + orange - green, luma + green, luma - orange - green, alpha,
        }) |*to, value| to.* = round(T, @as(f32, @floatFromInt(value)) * scale);
    }
}

/// The nearest of a type's normalised numbers; halves go away from 0.
fn round(comptime T: type, value: f32) T {
    const max: f32 = std.math.maxInt(T);
    const min: f32 = if (std.math.minInt(T) < 0) -max else 0;
    const bounded = if (value > max) max else if (value < min) min else value;
    return @intFromFloat(if (bounded < 0) bounded - 0.5 else bounded + 0.5);
}

test octahedral {
    // Axes, a fold to the other side in 4 bits, and what is no octahedron.
    var bytes = [_][4]i8{
        .{ 0, 0, 127, 5 }, .{ -127, 0, 127, -1 },    .{ 7, 7, 7, 0 },
        .{ 0, 0, 0, 3 },   .{ -128, -128, -128, 0 },
    };
    octahedral(i8, &bytes);
    try std.testing.expectEqual([_][4]i8{
        .{ 0, 0, 127, 5 }, .{ -127, 0, 0, -1 }, .{ 0, 0, -127, 0 },
        .{ 0, 0, 0, 3 },   .{ 62, 62, -92, 0 },
    }, bytes);
    var shorts = [_][4]i16{ .{ 341, -341, 1023, 9 }, .{ 0, 511, 511, 0 } };
    octahedral(i16, &shorts);
    const third: i16 = 18918; // 32767 / sqrt(3)
    try std.testing.expectEqual(
        [_][4]i16{ .{ third, -third, third, 9 }, .{ 0, 32767, 0, 0 } },
        shorts,
    );
}

test quaternion {
    var elements = [_][4]i16{
        .{ 0, 0, 0, 32764 | 3 }, .{ 2047, 0, 0, 2044 }, .{ 32767, -32768, 32767, 1 },
    };
    quaternion(&elements);
    try std.testing.expectEqual([4]i16{ 0, 0, 0, 32767 }, elements[0]);
    // 1/sqrt(2) twice.
    try std.testing.expectEqual([4]i16{ 23170, 23170, 0, 0 }, elements[1]);
    try std.testing.expectEqual([4]i16{ 32767, 0, 32767, -32767 }, elements[2]);
}

test exponential {
    var elements = [_]u32{ 0xfe000003, 0x02ffffff, 0, 0x64000001, 0x80800000, 0x7f7fffff };
    exponential(&elements);
    const floats: [6]f32 = @bitCast(elements);
    const wanted = [4]f32{ 0.75, -4, 0, 0x1p100 };
    try std.testing.expectEqual(wanted, floats[0..4].*);
    try std.testing.expectEqual(-0x1p-105, floats[4]);
    try std.testing.expectEqual(std.math.inf(f32), floats[5]);
}

test color {
    // White and red of 8 bits, gray of 3 bits, and what has no bits.
    var bytes = [_][4]u8{
        .{ 255, 0, 0, 255 }, .{ 64, 127, 192, 255 }, .{ 3, 0, 0, 4 }, .{ 200, 127, 0, 0 },
    };
    color(u8, &bytes);
    try std.testing.expectEqual([_][4]u8{
        .{ 255, 255, 255, 255 }, .{ 255, 0, 1, 255 }, .{ 109, 109, 109, 0 }, .{ 255, 255, 255, 0 },
    }, bytes);
    var shorts = [_][4]u16{ .{ 3, 0, 0, 7 }, .{ 0, 0xffff, 0, 5 } };
    color(u16, &shorts);
    try std.testing.expectEqual([_][4]u16{
        .{ 28086, 28086, 28086, 65535 }, .{ 0, 0, 9362, 28086 },
    }, shorts);
}
