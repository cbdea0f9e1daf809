//! Encoded image bytes -> texels.
//!
//! In: a file in memory, of a kind that its first bytes tell. Out: its texels in the channels that
//! the file has, bytes or floats, the same on every target. The C libraries see no file that has
//! not passed our own checks, and every limit is one before memory is asked for. Threads may decode
//! at once; no state outlives a call.

const std = @import("std");
const Allocator = std.mem.Allocator;
const jpeg = @import("decode/jpeg.zig");
const png = @import("decode/png.zig");
const stb_image = @import("decode/stb_image.zig");
const texels = @import("decode/texels.zig");

pub const Error = texels.Error;
pub const Format = texels.Format;
pub const Info = texels.Info;
pub const Reason = texels.Reason;
pub const Texels = texels.Texels;

/// What the first bytes tell; null: nothing that is known here.
pub fn formatOf(file: []const u8) ?Format {
    if (std.mem.startsWith(u8, file, png.signature)) return .png;
    if (std.mem.startsWith(u8, file, jpeg.signature)) return .jpeg;
    for (stb_image.hdr_signatures) |signature| {
        if (std.mem.startsWith(u8, file, signature)) return .hdr;
    }
    return null;
}

/// The header alone, with all limits checked.
pub fn info(file: []const u8, reason: *Reason) error{InvalidImage}!Info {
    const format = try formatWithin(file, reason);
    return stb_image.info(codecOf(format), file, reason);
}

/// All texels; free them by `Texels.deinit`.
pub fn decode(gpa: Allocator, file: []const u8, reason: *Reason) Error!Texels {
    const format = try formatWithin(file, reason);
    return stb_image.decode(gpa, codecOf(format), file, reason);
}

fn formatWithin(file: []const u8, reason: *Reason) error{InvalidImage}!Format {
    if (file.len > texels.file_bytes_max) return texels.invalid(
        reason,
        "{d} bytes, more than {d}",
        .{ file.len, texels.file_bytes_max },
    );
    return formatOf(file) orelse texels.invalid(reason, "no image format that is known", .{});
}

fn codecOf(format: Format) stb_image.Codec {
    return switch (format) {
        .png => .png,
        .jpeg => .jpeg,
        .hdr => .hdr,
    };
}

test {
    _ = jpeg;
    _ = png;
    _ = stb_image;
    _ = texels;
}

test formatOf {
    try std.testing.expectEqual(.png, formatOf(png.signature));
    try std.testing.expectEqual(.jpeg, formatOf("\xff\xd8\xff\xe0"));
    try std.testing.expectEqual(.hdr, formatOf("#?RGBE\nFORMAT=32-bit_rle_rgbe\n"));
    for ([_][]const u8{ "", "\x89PNG", "P6\n", "#?RGB" }) |file| {
        try std.testing.expectEqual(null, formatOf(file));
        var reason: Reason = .{};
        try std.testing.expectError(error.InvalidImage, info(file, &reason));
        try std.testing.expectEqualStrings("no image format that is known", reason.text());
    }
}
