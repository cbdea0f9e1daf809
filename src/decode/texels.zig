//! What the codecs have in common: the formats, the texels that come out, and the limits.
//!
//! In: what a file's header says. Out: a refusal, before memory is asked for, of what cannot be
//! true or would take too much of it.

const std = @import("std");
const Allocator = std.mem.Allocator;
const huge_pages = @import("../huge_pages.zig");

/// Why an image cannot be used, in one line without its name.
pub const Reason = @import("../diagnostic.zig").Message;

pub const Format = enum { png, jpeg, webp, ktx2, hdr, exr };

/// The reason is set where it is `InvalidImage`.
pub const Error = error{ InvalidImage, OutOfMemory };

/// What the header says.
pub const Info = struct {
    format: Format,
    width: u32,
    height: u32,
    /// 1 gray, 2 with alpha, 3 RGB, 4 with alpha.
    channel_count: u8,
    /// Linear floats; otherwise bytes, encoded as whoever wrote the file meant.
    is_float: bool,
};

/// A decoded image.
pub const Texels = struct {
    width: u32,
    height: u32,
    /// 1 to 4, as `Info` has it.
    channel_count: u8,
    /// Interleaved, rows from the top. Floats are finite and not negative.
    data: union(enum) { bytes: []u8, floats: []f32 },
    /// What `data` lies in.
    memory: []align(64) u8,

    pub fn deinit(texels: *Texels, gpa: Allocator) void {
        huge_pages.free(gpa, texels.memory);
        texels.* = undefined;
    }
};

/// Texels on a side, and in all.
pub const side_max = 32_768;
pub const pixel_count_max = 1 << 27;
/// Bytes of a file: the libraries count them in C's int.
pub const file_bytes_max = std.math.maxInt(i32);

/// Sets the reason and returns the error.
pub fn invalid(
    reason: *Reason,
    comptime format: []const u8,
    arguments: anytype,
) error{InvalidImage} {
    reason.set(format, arguments);
    return error.InvalidImage;
}

/// Refuses an image that is too large, or larger than `most_pixels`, as many as a file of
/// its length can hold.
pub fn checkSize(
    width: u64,
    height: u64,
    most_pixels: u64,
    reason: *Reason,
) error{InvalidImage}!void {
    if (width == 0 or height == 0) return invalid(reason, "it has no pixels", .{});
    if (@max(width, height) > side_max) return invalid(
        reason,
        "{d}x{d} pixels, more than {d} on a side",
        .{ width, height, side_max },
    );
    if (width * height > pixel_count_max) return invalid(
        reason,
        "{d}x{d} pixels, more than {d}",
        .{ width, height, pixel_count_max },
    );
    if (width * height > most_pixels) return invalid(
        reason,
        "{d}x{d} pixels are more than its bytes can hold",
        .{ width, height },
    );
}

test checkSize {
    var reason: Reason = .{};
    try checkSize(32_768, 4096, 1 << 40, &reason);
    for ([_]struct { u64, u64, []const u8 }{
        .{ 0, 5, "it has no pixels" },
        .{ 32_769, 1, "32769x1 pixels, more than 32768 on a side" },
        .{ 1, std.math.maxInt(u32), "1x4294967295 pixels, more than 32768 on a side" },
        .{ 32_768, 4097, "32768x4097 pixels, more than 134217728" },
        .{ 4, 3, "4x3 pixels are more than its bytes can hold" },
    }) |case| {
        const result = checkSize(case[0], case[1], 11, &reason);
        try std.testing.expectError(error.InvalidImage, result);
        try std.testing.expectEqualStrings(case[2], reason.text());
    }
}
