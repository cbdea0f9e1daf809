//! The markers of a JPEG file, looked at before its decoder.
//!
//! In: a file. Out: its frame header, and that it has its scans and an end: a decoder fills what is
//! missing with gray and says nothing (ITU-T T.81, B.1 and B.2). The number of scans is limited,
//! for each passes over all of the picture, however short it is.

const std = @import("std");
const texels = @import("texels.zig");
const Reason = texels.Reason;
const invalid = texels.invalid;

/// What the file starts with.
pub const signature = "\xff\xd8\xff";

/// Of a picture in steps: libjpeg's script makes 10, its finest division some 100.
const scan_count_max = 200;
/// A block of 64 pixels takes a bit at least.
const pixels_per_byte_max = 512;

pub const Header = struct {
    width: u16,
    height: u16,
    component_count: u8,

    /// Of the decoded pixels: four components become three.
    pub fn channelCount(header: Header) u8 {
        return if (header.component_count == 1) 1 else 3;
    }
};

/// How far to look.
pub const Depth = enum { header, whole };

/// The header, with limits checked; with `.whole`, all markers are looked at.
pub fn read(file: []const u8, depth: Depth, reason: *Reason) error{InvalidImage}!Header {
    if (!std.mem.startsWith(u8, file, signature)) return invalid(reason, "not a JPEG file", .{});
    var header: ?Header = null;
    var scan_count: usize = 0;
    var position: usize = 2;
    while (nextMarker(file, position)) |at| {
        position = at + 1;
        const marker = file[at];
        switch (marker) {
            // The end of the image.
            0xd9 => {
                if (scan_count == 0) return invalid(reason, "it has no pixels", .{});
                return header.?;
            },
            // Restarts lie within scans; the rest has no length.
            0x01, 0xd0...0xd8 => continue,
            else => {},
        }
        if (file.len - position < 2) break;
        const length = std.mem.readInt(u16, file[position..][0..2], .big);
        if (length < 2) return invalid(reason, "bad marker", .{});
        if (length > file.len - position) break;
        const segment = file[position + 2 .. position + length];
        position += length;
        switch (marker) {
            0xc0...0xc2 => {
                if (header != null) return invalid(reason, "two headers", .{});
                header = try parseHeader(segment, file.len, reason);
                if (depth == .header) return header.?;
            },
            0xc3, 0xc5...0xc7, 0xc9...0xcb, 0xcd...0xcf => return invalid(
                reason,
                "a kind of JPEG that is not supported (SOF{d})",
                .{marker - 0xc0},
            ),
            0xda => {
                if (header == null) return invalid(reason, "a scan before the header", .{});
                scan_count += 1;
                if (scan_count > scan_count_max)
                    return invalid(reason, "more than {d} scans", .{scan_count_max});
            },
            else => {},
        }
    }
    return invalid(reason, "cut short", .{});
}

/// Where the next marker's second byte is. Within a scan, a zero or a restart behind 0xff is data;
/// between markers, some files have padding.
fn nextMarker(file: []const u8, start: usize) ?usize {
    var position = start;
    while (std.mem.findScalarPos(u8, file, position, 0xff)) |at| {
        position = at + 1;
        if (position == file.len) return null;
        switch (file[position]) {
            0, 0xff, 0xd0...0xd7 => {},
            else => return position,
        }
    }
    return null;
}

fn parseHeader(data: []const u8, file_bytes: usize, reason: *Reason) error{InvalidImage}!Header {
    if (data.len < 6) return invalid(reason, "bad header", .{});
    const header: Header = .{
        .height = std.mem.readInt(u16, data[1..3], .big),
        .width = std.mem.readInt(u16, data[3..5], .big),
        .component_count = data[5],
    };
    if (data[0] != 8) return invalid(reason, "{d} bits a sample, not 8", .{data[0]});
    switch (header.component_count) {
        1, 3, 4 => {},
        else => |count| return invalid(reason, "{d} components", .{count}),
    }
    const most = pixels_per_byte_max * @as(u64, file_bytes);
    try texels.checkSize(header.width, header.height, most, reason);
    return header;
}

test nextMarker {
    const file = "\x00\xff\x00\xff\xd3\x12\xff\xff\xd9\xff";
    try std.testing.expectEqual(8, nextMarker(file, 0));
    try std.testing.expectEqual(null, nextMarker(file, 8));
}
