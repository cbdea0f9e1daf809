//! Backgrounds: what is behind what covers a pixel in part or not at all.
//!
//! In: a row of the picture. Out: linear light of the display, neither exposed nor tone mapped.

const std = @import("std");
const srgb = @import("../math.zig").srgb;
const assert = std.debug.assert;

/// Codes of the gradient at the upper and the lower edge of the picture: around mid-grey, so that
/// black things stand off as white ones do, and lighter below, where a floor would be.
const gradient_codes: [2]f64 = .{ 105, 165 };

/// The same along each row.
pub const Background = union(enum) {
    /// Nothing is behind: black, or what the file's alpha leaves open.
    none,
    /// From darker grey above to lighter below.
    gradient,
    /// Codes that come out as they are.
    srgb: [3]u8,

    /// Its colour in a row from the top. Asserts that there is such a row.
    pub fn at(background: Background, y: u32, height: u32) [3]f32 {
        assert(y < height);
        return switch (background) {
            .none => .{ 0, 0, 0 },
            .gradient => {
                const middle = @as(f64, @floatFromInt(y)) + 0.5;
                const down = middle / @as(f64, @floatFromInt(height));
                const code = gradient_codes[0] + down * (gradient_codes[1] - gradient_codes[0]);
                return @splat(@floatCast(srgb.linear(code / 255)));
            },
            .srgb => |codes| .{
                srgb.decoded[codes[0]], srgb.decoded[codes[1]], srgb.decoded[codes[2]],
            },
        };
    }
};

test "a colour is the same everywhere, a gradient rises and is grey" {
    const color: Background = .{ .srgb = .{ 1, 128, 255 } };
    try std.testing.expectEqual(color.at(0, 9), color.at(8, 9));
    try std.testing.expectEqual(1, color.at(0, 9)[2]);
    var previous: f32 = 0;
    for (0..64) |y| {
        const gray = @as(Background, .gradient).at(@intCast(y), 64);
        try std.testing.expect(gray[0] > previous and gray[0] == gray[1] and gray[1] == gray[2]);
        previous = gray[0];
    }
    try std.testing.expect(previous < 0.5);
}
