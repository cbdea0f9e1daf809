//! Netpbm's binary PPM: RGB of 8 bits, sRGB, rows from the top, no alpha.
//!
//! In: rows of sRGB bytes. Out: the parts of the file, its rows written by any number of threads.

const std = @import("std");
const Allocator = std.mem.Allocator;
const Image = @import("../image.zig").Image;
const Rows = @import("tonemap.zig").Rows;
const assert = std.debug.assert;

/// A file in the making; see the one of `png.zig`. A stretch is a row.
pub const Encoder = struct {
    rows: Rows,
    stretch_count: usize,
    bytes: []u8,
    header_buffer: [32]u8,
    parts: [2][]const u8,

    /// Takes the memory. Asserts that there is no alpha.
    pub fn init(gpa: Allocator, rows: Rows, thread_count: usize) error{OutOfMemory}!Encoder {
        assert(thread_count >= 1 and rows.channel_count == 3);
        const byte_count = std.math.mul(usize, rows.byteCount(), rows.image.height) catch
            return error.OutOfMemory;
        return .{
            .rows = rows,
            .stretch_count = rows.image.height,
            .bytes = try gpa.alloc(u8, byte_count),
            .header_buffer = undefined,
            .parts = undefined,
        };
    }

    /// Frees everything.
    pub fn deinit(encoder: *Encoder, gpa: Allocator) void {
        gpa.free(encoder.bytes);
        encoder.* = undefined;
    }

    /// Encodes one row.
    pub fn encodeStretch(encoder: *Encoder, stretch_index: usize, thread_index: usize) void {
        _ = thread_index;
        const row_bytes = encoder.rows.byteCount();
        const bytes = encoder.bytes[stretch_index * row_bytes ..][0..row_bytes];
        encoder.rows.encode(@intCast(stretch_index), bytes);
    }

    /// The parts of the file, when all rows are done. They are the encoder's.
    pub fn finish(encoder: *Encoder) []const []const u8 {
        const header = headerOf(&encoder.header_buffer, encoder.rows.image);
        encoder.parts = .{ header, encoder.bytes };
        return &encoder.parts;
    }
};

fn headerOf(buffer: *[32]u8, image: *const Image) []const u8 {
    return std.mem.print(buffer, "P6\n{d} {d}\n255\n", .{ image.width, image.height }) catch
        unreachable; // Two numbers of 10 digits and 9 bytes more.
}

test headerOf {
    const largest = std.math.maxInt(u32);
    var buffer: [32]u8 = undefined;
    const image: Image = .{ .width = largest, .height = 1, .pixels = &.{} };
    try std.testing.expectEqualStrings("P6\n4294967295 1\n255\n", headerOf(&buffer, &image));
    const image_full: Image = .{ .width = largest, .height = largest, .pixels = &.{} };
    try std.testing.expect(headerOf(&buffer, &image_full).len <= buffer.len);
}
