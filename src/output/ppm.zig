//! Netpbm's binary PPM: RGB of 8 bits, sRGB, rows from the top, no alpha.
//!
//! In: the size. Out: the header; the bytes of the rows follow it as they are.

const std = @import("std");
const assert = std.debug.assert;

/// A PPM's header.
pub const Header = struct {
    buffer: [32]u8,
    length: usize,

    /// For a picture of this size.
    pub fn init(width: u32, height: u32) Header {
        var header: Header = .{ .buffer = undefined, .length = 0 };
        var writer: std.Io.Writer = .fixed(&header.buffer);
        writer.print("P6\n{d} {d}\n255\n", .{ width, height }) catch unreachable;
        header.length = writer.end;
        return header;
    }

    /// Its bytes.
    pub fn text(header: *const Header) []const u8 {
        return header.buffer[0..header.length];
    }
};

test Header {
    const largest = std.math.maxInt(u32);
    const header: Header = .init(largest, 1);
    try std.testing.expectEqualStrings("P6\n4294967295 1\n255\n", header.text());
    const header_full: Header = .init(largest, largest);
    try std.testing.expect(header_full.text().len <= header_full.buffer.len);
}
