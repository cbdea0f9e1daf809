//! PNG, 8 bits a channel, RGB or RGBA, by stb_image_write.
//!
//! In: the size and bytes of sRGB. Out: the bytes of the file in memory of the encoder's own, so
//! that a failed write is seen by who writes. Exhausted memory is an error, not a crash.

const std = @import("std");
const assert = std.debug.assert;

extern fn rl_png_encode(
    pixels: [*]const u8,
    width: c_int,
    height: c_int,
    channel_count: c_int,
    byte_count: *c_int,
) ?[*]u8;
extern fn rl_png_free(bytes: [*]u8) void;

/// Bytes of a picture, with one more for each row, beyond which the encoder's `int`s overflow.
const raw_bytes_max = 1_400_000_000;

/// An encoded file.
pub const File = struct {
    bytes: []u8,

    /// Frees the bytes.
    pub fn deinit(file: *File) void {
        rl_png_free(file.bytes.ptr);
        file.* = undefined;
    }
};

/// Encodes width * height pixels of `channel_count` bytes, row by row from the top. Asserts that
/// there are as many, that both sides are at least 1, 3 or 4 channels, and 1.4e9 bytes at most.
pub fn encode(
    width: u32,
    height: u32,
    channel_count: u8,
    pixels: []const u8,
) error{OutOfMemory}!File {
    assert(channel_count == 3 or channel_count == 4);
    assert(width >= 1 and height >= 1);
    const row_bytes = @as(u64, width) * channel_count;
    assert(pixels.len == row_bytes * height);
    assert((row_bytes + 1) * height <= raw_bytes_max);
    var byte_count: c_int = 0;
    const bytes = rl_png_encode(
        pixels.ptr,
        @intCast(width),
        @intCast(height),
        channel_count,
        &byte_count,
    ) orelse return error.OutOfMemory;
    return .{ .bytes = bytes[0..@intCast(byte_count)] };
}

test "a picture of one pixel, byte by byte" {
    var file = try encode(1, 1, 3, &.{ 1, 2, 3 });
    defer file.deinit();
    const header = "\x89PNG\r\n\x1a\n" ++ "\x00\x00\x00\x0dIHDR" ++
        "\x00\x00\x00\x01\x00\x00\x00\x01\x08\x02\x00\x00\x00" ++ "\x90\x77\x53\xde";
    try std.testing.expectStringStartsWith(file.bytes, header);
    try std.testing.expectStringEndsWith(file.bytes, "\x00\x00\x00\x00IEND\xae\x42\x60\x82");
}

test "every chunk has its checksum" {
    var random = std.Random.DefaultPrng.init(5);
    for ([_][2]u32{ .{ 1, 1 }, .{ 7, 1 }, .{ 1, 9 }, .{ 33, 17 }, .{ 256, 256 } }) |size| {
        for ([_]u8{ 3, 4 }) |channel_count| {
            const gpa = std.testing.allocator;
            const pixels = try gpa.alloc(u8, size[0] * size[1] * channel_count);
            defer gpa.free(pixels);
            random.random().bytes(pixels);
            var file = try encode(size[0], size[1], channel_count, pixels);
            defer file.deinit();
            var rest: []const u8 = file.bytes[8..];
            while (rest.len > 0) {
                const length = std.mem.readInt(u32, rest[0..4], .big);
                const checksum = std.mem.readInt(u32, rest[8 + length ..][0..4], .big);
                try std.testing.expectEqual(checksum, std.hash.Crc32.hash(rest[4 .. 8 + length]));
                rest = rest[12 + length ..];
            }
        }
    }
}
