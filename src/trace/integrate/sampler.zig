//! Hammersley points (1960): where the samples of a pixel are.
//!
//! In: a sample's number. Out: its place; the same for every pixel, variant and integrator.

const std = @import("std");
const assert = std.debug.assert;

/// A sample's place in its pixel, 0..1 from the upper left corner.
pub const Offset = struct { x: f32, y: f32 };

/// The place of one of `sample_count` samples: the middle for a single one; else x in equal strata,
/// y the radical inverse in base 2.
pub fn pixelOffset(sample: u32, sample_count: u32) Offset {
    assert(sample < sample_count);
    const count: f32 = @floatFromInt(sample_count);
    const index: f32 = @floatFromInt(sample);
    // @bitReverse of at most 24 significant bits, so that the conversion is exact.
    const reversed: f32 = @floatFromInt(@bitReverse(sample) >> 8);
    const radical_inverse = reversed / 16_777_216.0;
    return .{
        .x = (index + 0.5) / count,
        .y = radical_inverse + 0.5 / count,
    };
}

test "one sample is in the middle, many fill every stratum of both axes" {
    try std.testing.expectEqual(Offset{ .x = 0.5, .y = 0.5 }, pixelOffset(0, 1));
    inline for (.{ 2, 4, 16, 64 }) |count| {
        var columns: [count]bool = @splat(false);
        var rows: [count]bool = @splat(false);
        for (0..count) |sample| {
            const offset = pixelOffset(@intCast(sample), count);
            columns[@intFromFloat(offset.x * count)] = true;
            rows[@intFromFloat(offset.y * count)] = true;
        }
        for (columns, rows) |column, row| try std.testing.expect(column and row);
    }
    for (0..7) |sample| {
        const offset = pixelOffset(@intCast(sample), 7);
        try std.testing.expect(offset.x > 0 and offset.x < 1 and offset.y > 0 and offset.y < 1);
    }
}
