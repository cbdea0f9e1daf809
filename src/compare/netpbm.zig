//! PPM and PFM, the plain formats that `output` writes -> texels.
//!
//! In: a file in memory. Out: RGB bytes (P6 of 255 steps) or floats (PF, PFM's lines run upwards).

const std = @import("std");
const Reason = @import("../diagnostic.zig").Message;

pub const Kind = enum { ppm, pfm };

/// A file's header, and what follows it.
pub const File = struct {
    kind: Kind,
    width: u32,
    height: u32,
    /// Three values a pixel: bytes, or little-endian floats.
    values: []const u8,

    /// The three floats of a pixel, x from the left and y from the top; of PFM.
    pub fn floatsAt(file: *const File, x: usize, y: usize) [3]f32 {
        const row = file.height - 1 - y;
        const start = (row * file.width + x) * 12;
        return @bitCast(file.values[start..][0..12].*);
    }
};

/// Pixels on a side at most.
const side_max = 65_536;

/// What the first bytes tell; null: another format.
pub fn kindOf(bytes: []const u8) ?Kind {
    if (bytes.len < 3 or !std.ascii.isWhitespace(bytes[2])) return null;
    if (std.mem.startsWith(u8, bytes, "P6")) return .ppm;
    if (std.mem.startsWith(u8, bytes, "PF")) return .pfm;
    return null;
}

/// Asserts that `kindOf` knows the file.
pub fn read(bytes: []const u8, reason: *Reason) error{InvalidImage}!File {
    const kind = kindOf(bytes).?;
    var rest = bytes[2..];
    const width = side(word(&rest)) orelse return invalid(reason, "its header is broken");
    const height = side(word(&rest)) orelse return invalid(reason, "its header is broken");
    const last = word(&rest) orelse return invalid(reason, "its header is broken");
    switch (kind) {
        .ppm => if (!std.mem.eql(u8, last, "255"))
            return invalid(reason, "a .ppm of other than 255 steps is not supported"),
        .pfm => if (last[0] != '-')
            return invalid(reason, "a .pfm in big-endian order is not supported"),
    }
    // One byte of white space ends the header.
    const value_bytes: u64 = if (kind == .ppm) 3 else 12;
    if (rest.len < 1 or rest.len - 1 != width * @as(u64, height) * value_bytes)
        return invalid(reason, "it is shorter or longer than its header says");
    return .{ .kind = kind, .width = width, .height = height, .values = rest[1..] };
}

/// The next word, cut off the text.
fn word(text: *[]const u8) ?[]const u8 {
    const start = for (text.*, 0..) |byte, index| {
        if (!std.ascii.isWhitespace(byte)) break index;
    } else return null;
    const end = for (text.*[start..], start..) |byte, index| {
        if (std.ascii.isWhitespace(byte)) break index;
    } else return null;
    defer text.* = text.*[end..];
    return text.*[start..end];
}

fn side(text: ?[]const u8) ?u32 {
    const value = std.fmt.parseInt(u32, text orelse return null, 10) catch return null;
    return if (value >= 1 and value <= side_max) value else null;
}

fn invalid(reason: *Reason, comptime text: []const u8) error{InvalidImage} {
    reason.set(text, .{});
    return error.InvalidImage;
}

test "headers right and wrong" {
    var reason: Reason = .{};
    const ppm = try read("P6\n2 1\n255\nabcdef", &reason);
    try std.testing.expectEqual(2, ppm.width);
    try std.testing.expectEqualStrings("abcdef", ppm.values);
    const floats = [_]f32{ 1, 2, 3, 4, 5, 6 };
    const pfm = try read("PF\n1 2\n-1.0\n" ++ std.mem.asBytes(&floats), &reason);
    try std.testing.expectEqual([3]f32{ 4, 5, 6 }, pfm.floatsAt(0, 0));
    try std.testing.expectEqual(null, kindOf("P5\n"));
    try std.testing.expectEqual(null, kindOf("P6"));
    for ([_][]const u8{
        "P6 ",              "P6 2 1",            "P6 0 1 255 ",
        "P6 2 1 255 abcde", "P6 2 1 256 abcdef", "PF 1 1 1.0 123456789012",
    }) |file| try std.testing.expectError(error.InvalidImage, read(file, &reason));
}
