//! Values as colours: matplotlib's map magma, black through violet and orange to white.
//!
//! In: values in 0..1. Out: sRGB bytes, by a polynomial a channel that is 6 codes off at most.

const std = @import("std");

/// Coefficients of red, green and blue from the constant up, fitted to the map's 256 colours.
const coefficients = [_][3]f32{
    .{ -0.0007, -0.0024, -0.0096 },
    .{ 0.1815, 0.7812, 2.4966 },
    .{ 9.1382, -4.5919, 0.3142 },
    .{ -31.2304, 18.7332, -13.5804 },
    .{ 59.5847, -37.2648, 12.7442 },
    .{ -57.9272, 38.066, 4.4015 },
    .{ 21.2692, -14.765, -5.6183 },
};

/// Asserts that there are three bytes for each value.
pub fn fill(map: []const f32, bytes: []u8) void {
    std.debug.assert(bytes.len == 3 * map.len);
    for (map, 0..) |value, index| bytes[3 * index ..][0..3].* = colorOf(value);
}

/// Of a value in 0..1, beyond which it stays the same.
pub fn colorOf(value: f32) [3]u8 {
    const x = std.math.clamp(value, 0, 1);
    var colour: [3]u8 = undefined;
    for (&colour, 0..) |*code, channel| {
        var sum: f32 = 0;
        var index: usize = coefficients.len;
        while (index > 0) {
            index -= 1;
            sum = sum * x + coefficients[index][channel];
        }
        code.* = @intFromFloat(std.math.clamp(sum, 0, 1) * 255 + 0.5);
    }
    return colour;
}

test "from black to nearly white, and red in between" {
    try std.testing.expectEqual([3]u8{ 0, 0, 0 }, colorOf(0));
    const white = colorOf(1);
    try std.testing.expect(white[0] > 240 and white[1] > 240 and white[2] > 180);
    const middle = colorOf(0.5);
    try std.testing.expect(middle[0] > 170 and middle[1] < 70 and middle[2] > 110);
}
