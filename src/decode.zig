//! Encoded image bytes -> texels; compressed streams of geometry -> numbers.
//!
//! In: a file in memory, of a kind that its first bytes tell. Out: its texels in the channels that
//! the file has, bytes or floats, the same on every target; or what gzip has compressed. The C
//! libraries of images see no file that has not passed our own checks, and every limit is one
//! before memory is asked for. Threads may decode at once; no state outlives a call. Geometry is
//! asked for by its codec.

const std = @import("std");
const Allocator = std.mem.Allocator;
const jpeg = @import("decode/jpeg.zig");
const ktx2 = @import("decode/ktx2.zig");
const png = @import("decode/png.zig");
const stb_image = @import("decode/stb_image.zig");
const texels = @import("decode/texels.zig");
const webp = @import("decode/webp.zig");

pub const draco = @import("decode/draco.zig");
pub const gzip = @import("decode/gzip.zig");
pub const meshopt = @import("decode/meshopt.zig");
pub const openexr = @import("decode/openexr.zig");

pub const Error = texels.Error;
pub const Format = texels.Format;
pub const Info = texels.Info;
pub const Reason = texels.Reason;
pub const Texels = texels.Texels;

/// What the first bytes tell; null: nothing that is known here.
pub fn formatOf(file: []const u8) ?Format {
    if (std.mem.startsWith(u8, file, png.signature)) return .png;
    if (std.mem.startsWith(u8, file, jpeg.signature)) return .jpeg;
    if (webp.isWebp(file)) return .webp;
    if (std.mem.startsWith(u8, file, ktx2.signature)) return .ktx2;
    if (std.mem.startsWith(u8, file, openexr.signature)) return .exr;
    for (stb_image.hdr_signatures) |signature| {
        if (std.mem.startsWith(u8, file, signature)) return .hdr;
    }
    return null;
}

/// The header alone, with all limits checked.
pub fn info(file: []const u8, reason: *Reason) error{InvalidImage}!Info {
    return switch (try formatWithin(file, reason)) {
        .png => stb_image.info(.png, file, reason),
        .jpeg => stb_image.info(.jpeg, file, reason),
        .webp => webp.info(file, reason),
        .ktx2 => ktx2.info(file, reason),
        .hdr => stb_image.info(.hdr, file, reason),
        .exr => openexr.info(file, reason),
    };
}

/// All texels; free them by `Texels.deinit`.
pub fn decode(gpa: Allocator, file: []const u8, reason: *Reason) Error!Texels {
    return switch (try formatWithin(file, reason)) {
        .png => stb_image.decode(gpa, .png, file, reason),
        .jpeg => stb_image.decode(gpa, .jpeg, file, reason),
        .webp => webp.decode(gpa, file, reason),
        .ktx2 => ktx2.decode(gpa, file, reason),
        .hdr => stb_image.decode(gpa, .hdr, file, reason),
        .exr => openexr.decode(gpa, file, reason),
    };
}

fn formatWithin(file: []const u8, reason: *Reason) error{InvalidImage}!Format {
    if (file.len > texels.file_bytes_max) return texels.invalid(
        reason,
        "{d} bytes, more than {d}",
        .{ file.len, texels.file_bytes_max },
    );
    return formatOf(file) orelse texels.invalid(reason, "no image format that is known", .{});
}

test {
    _ = draco;
    _ = gzip;
    _ = jpeg;
    _ = ktx2;
    _ = meshopt;
    _ = openexr;
    _ = png;
    _ = stb_image;
    _ = texels;
    _ = webp;
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
