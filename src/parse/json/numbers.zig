//! Numbers of JSON, correctly rounded and without a locale.
//!
//! In: a number's text (RFC 8259, section 6). Out: its value, or null where the text is no number
//! or leaves the range. The grammar is json.zig's business; here it only has to be harmless.

const std = @import("std");

/// Largest whole number that JSON readers agree on, 2^53 - 1.
pub const integer_max = (1 << 53) - 1;

/// Reads a JSON number that has a whole value (`4`, `4.0`, `400e-2`), 0..`integer_max`.
pub fn parseInteger(text: []const u8) ?u64 {
    if (text.len <= 15) simple: {
        var value: u64 = 0;
        for (text) |byte| {
            if (!std.ascii.isDigit(byte)) break :simple;
            value = value * 10 + (byte - '0');
        }
        return if (text.len > 0) value else null;
    }
    const value = parseFinite(f64, text) orelse return null;
    if (!(value >= 0 and value <= integer_max) or value != @trunc(value)) return null;
    return @intFromFloat(value);
}

/// Reads a JSON number, correctly rounded; null where it is none or over the range of `f32`.
pub fn parseFloat(text: []const u8) ?f32 {
    return parseFinite(f32, text);
}

/// The same in double precision.
pub fn parseDouble(text: []const u8) ?f64 {
    return parseFinite(f64, text);
}

fn parseFinite(comptime Float: type, text: []const u8) ?Float {
    for (text) |byte| switch (byte) {
        // std takes words, underscores and hexadecimal digits as well.
        '0'...'9', '+', '-', '.', 'e', 'E' => {},
        else => return null,
    };
    const value = std.fmt.parseFloat(Float, text) catch return null;
    return if (std.math.isFinite(value)) value else null;
}

test parseInteger {
    const good = .{ .{ "0", 0 }, .{ "4", 4 }, .{ "4.0", 4 }, .{ "400e-2", 4 }, .{ "-0", 0 } };
    inline for (good) |pair| try std.testing.expectEqual(@as(?u64, pair[1]), parseInteger(pair[0]));
    try std.testing.expectEqual(integer_max, parseInteger("9007199254740991").?);
    const bad = [_][]const u8{
        "", "-1", "1.5", "9007199254740992", "1e300", "nan", "inf", "0x10", "1_0", "1e", "abc",
    };
    for (bad) |text| try std.testing.expectEqual(null, parseInteger(text));
}

test parseFloat {
    try std.testing.expectEqual(0.1, parseFloat("1e-1").?);
    try std.testing.expectEqual(std.math.floatMax(f32), parseFloat("3.4028235e38").?);
    for ([_][]const u8{ "", "1e39", "nan", "-inf", "0x1p3", "1__0", "e", "." }) |text| {
        try std.testing.expectEqual(null, parseFloat(text));
    }
}
