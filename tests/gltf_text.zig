//! glTF documents as texts that tests change: their buffer in base64, and parts of them replaced.

const std = @import("std");
const gpa = std.testing.allocator;

/// What stands in a document, and what is to stand there.
pub const Replacement = struct { []const u8, []const u8 };

/// The document with its buffer for `$DATA`, and then the first of each other part replaced. The
/// caller frees it.
pub fn make(
    document: []const u8,
    buffer: []const u8,
    replacements: []const Replacement,
) ![]u8 {
    const encoder = std.base64.standard.Encoder;
    const digits = try gpa.alloc(u8, encoder.calcSize(buffer.len));
    defer gpa.free(digits);
    var text = try replace(document, "$DATA", encoder.encode(digits, buffer));
    errdefer gpa.free(text);
    for (replacements) |pair| {
        const changed = try replace(text, pair[0], pair[1]);
        gpa.free(text);
        text = changed;
    }
    return text;
}

/// `text` with the first `old` replaced, which has to be there. The caller frees it.
pub fn replace(text: []const u8, old: []const u8, new: []const u8) ![]u8 {
    const index = std.mem.find(u8, text, old) orelse {
        std.debug.print("{s} is not there\n", .{old});
        return error.TestUnexpectedResult;
    };
    return std.mem.concat(gpa, u8, &.{ text[0..index], new, text[index + old.len ..] });
}

/// Writes floats as a file has them.
pub fn putFloats(bytes: []u8, values: []const f32) void {
    for (values, 0..) |value, index| {
        std.mem.writeInt(u32, bytes[4 * index ..][0..4], @bitCast(value), .little);
    }
}
