//! The chunks of a PNG file, looked at before and beside its decoder.
//!
//! In: a file. Out: its header, and that every chunk is whole: length, order and CRC-32, which the
//! decoder does not look at (Portable Network Graphics, 3rd edition, 5.3 and 11.2). Chunks that
//! need not be understood are skipped by both.

const std = @import("std");
const texels = @import("texels.zig");
const Reason = texels.Reason;
const invalid = texels.invalid;

/// What the file starts with.
pub const signature = "\x89PNG\r\n\x1a\n";

const Colour = enum(u8) { gray = 0, rgb = 2, palette = 3, gray_alpha = 4, rgb_alpha = 6, _ };

pub const Header = struct {
    width: u32,
    height: u32,
    bit_depth: u8,
    colour: Colour,
    is_interlaced: bool,
    /// Transparency beside the colours: of palette entries, or of one colour.
    has_transparency: bool = false,

    /// Of the decoded pixels.
    pub fn channelCount(header: Header) u8 {
        const with_transparency: u8 = @intFromBool(header.has_transparency);
        return switch (header.colour) {
            .gray => 1 + with_transparency,
            .rgb, .palette => 3 + with_transparency,
            .gray_alpha => 2,
            else => 4,
        };
    }

    /// Of the pixels before compression: rows of whole bytes, a filter byte before each, of seven
    /// reduced images where it is interlaced (8.2).
    pub fn rawBytes(header: Header) u64 {
        if (!header.is_interlaced) return header.passBytes(header.width, header.height);
        var sum: u64 = 0;
        const passes = [7][4]u32{
            .{ 0, 0, 8, 8 }, .{ 4, 0, 8, 8 }, .{ 0, 4, 4, 8 }, .{ 2, 0, 4, 4 },
            .{ 0, 2, 2, 4 }, .{ 1, 0, 2, 2 }, .{ 0, 1, 1, 2 },
        };
        for (passes) |pass| {
            const width = (header.width -| pass[0] + pass[2] - 1) / pass[2];
            const height = (header.height -| pass[1] + pass[3] - 1) / pass[3];
            if (width > 0 and height > 0) sum += header.passBytes(width, height);
        }
        return sum;
    }

    fn passBytes(header: Header, width: u64, height: u64) u64 {
        const samples: u64 = switch (header.colour) {
            .gray, .palette => 1,
            .gray_alpha => 2,
            .rgb => 3,
            else => 4,
        };
        return (1 + (width * samples * header.bit_depth + 7) / 8) * height;
    }
};

/// How far to look.
pub const Depth = enum { header, whole };

/// Bytes of deflate's best case: 258 for two bits, and some for the blocks' headers.
const inflation_max = 1040;
const name_bytes = 4;

/// The header, with limits checked; with `.whole`, all chunks are.
pub fn read(file: []const u8, depth: Depth, reason: *Reason) error{InvalidImage}!Header {
    if (!std.mem.startsWith(u8, file, signature)) return invalid(reason, "not a PNG file", .{});
    var header: ?Header = null;
    var has_palette = false;
    var has_data = false;
    var rest = file[signature.len..];
    while (rest.len >= 12) {
        const length = std.mem.readInt(u32, rest[0..4], .big);
        if (length > rest.len - 12) break;
        const name = rest[4..8];
        const data = rest[8..][0..length];
        if (depth == .whole) try checkSum(rest[4..][0 .. name_bytes + length + 4], reason);
        if (header == null) {
            if (!std.mem.eql(u8, name, "IHDR")) return unknown(name, reason);
            header = try parseHeader(data, file.len, reason);
        } else if (std.mem.eql(u8, name, "PLTE")) {
            has_palette = true;
        } else if (std.mem.eql(u8, name, "tRNS")) {
            header.?.has_transparency = true;
        } else if (std.mem.eql(u8, name, "IDAT")) {
            if (header.?.colour == .palette and !has_palette)
                return invalid(reason, "it has no palette", .{});
            if (depth == .header) return header.?;
            has_data = true;
        } else if (std.mem.eql(u8, name, "IEND")) {
            if (!has_data) return invalid(reason, "it has no pixels", .{});
            return header.?;
        } else if (name[0] & 0x20 == 0) return unknown(name, reason);
        rest = rest[12 + length ..];
    }
    return invalid(reason, "cut short", .{});
}

fn unknown(name: []const u8, reason: *Reason) error{InvalidImage} {
    return invalid(reason, "a chunk {f} is not known or out of place", .{
        @import("../diagnostic.zig").quote(name),
    });
}

/// Of a chunk from its name to its sum.
fn checkSum(chunk: []const u8, reason: *Reason) error{InvalidImage}!void {
    const covered = chunk[0 .. chunk.len - 4];
    const sum = std.mem.readInt(u32, chunk[covered.len..][0..4], .big);
    if (libdeflate_crc32(0, covered.ptr, covered.len) != sum)
        return invalid(reason, "wrong checksum", .{});
}

fn parseHeader(data: []const u8, file_bytes: usize, reason: *Reason) error{InvalidImage}!Header {
    if (data.len != 13) return invalid(reason, "bad header", .{});
    const header: Header = .{
        .width = std.mem.readInt(u32, data[0..4], .big),
        .height = std.mem.readInt(u32, data[4..8], .big),
        .bit_depth = data[8],
        .colour = @fromBackingInt(data[9]),
        .is_interlaced = data[12] == 1,
    };
    const are_bits_legal = switch (header.colour) {
        .gray => switch (header.bit_depth) {
            1, 2, 4, 8, 16 => true,
            else => false,
        },
        .palette => switch (header.bit_depth) {
            1, 2, 4, 8 => true,
            else => false,
        },
        .rgb, .gray_alpha, .rgb_alpha => header.bit_depth == 8 or header.bit_depth == 16,
        _ => false,
    };
    if (!are_bits_legal or data[10] != 0 or data[11] != 0 or data[12] > 1)
        return invalid(reason, "bad header", .{});
    try texels.checkSize(header.width, header.height, texels.pixel_count_max, reason);
    if (header.rawBytes() > inflation_max * @as(u64, file_bytes)) return invalid(
        reason,
        "{d}x{d} pixels are more than its bytes can hold",
        .{ header.width, header.height },
    );
    return header;
}

extern fn libdeflate_crc32(sum: u32, bytes: [*]const u8, length: usize) u32;

test "bytes before compression" {
    var header: Header = .{
        .width = 9,
        .height = 5,
        .bit_depth = 1,
        .colour = .gray,
        .is_interlaced = false,
    };
    try std.testing.expectEqual(5 * 3, header.rawBytes());
    header.is_interlaced = true;
    // Passes of 2x1, 1x1, 3x1, 2x2, 5x1, 4x3 and 9x2 pixels.
    try std.testing.expectEqual(2 + 2 + 2 + 4 + 2 + 6 + 6, header.rawBytes());
    header = .{
        .width = 9,
        .height = 5,
        .bit_depth = 16,
        .colour = .rgb_alpha,
        .is_interlaced = false,
    };
    try std.testing.expectEqual(5 * 73, header.rawBytes());
    try std.testing.expectEqual(4, header.channelCount());
}
