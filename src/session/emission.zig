//! Whether the light of surfaces that emit shows beside all other light.
//!
//! In: small pictures of a view by three lights. Out: whether some part of it would look otherwise
//! without their light, and whether it is most of the light. What is seen of the surfaces
//! themselves does not count: they are as bright in any case.

const std = @import("std");

/// It shows where it adds this part to the light of the whole picture,
const part_min = 0.05;
/// or this part to a pixel's,
const pixel_part_min = 0.25;
/// in this part of the pixels that show something.
const pixel_share_min = 1.0 / 64.0;

/// What the light of surfaces that emit is worth.
pub const Weight = struct {
    shows: bool,
    /// It is more than the other light.
    prevails: bool,
};

/// Weighs it in pictures of a size, linear RGB with alpha: `besides` by all other light, `glow` by
/// none, `lit` by theirs alone.
pub fn weigh(
    besides: []const [4]f32,
    glow: []const [4]f32,
    lit: []const [4]f32,
) Weight {
    var visible_count: usize = 0;
    var seen_count: usize = 0;
    var sum: f64 = 0;
    var other_sum: f64 = 0;
    for (besides, glow, lit) |all, own, with| {
        if (!(all[3] > 0.5)) continue;
        seen_count += 1;
        const added = @max(0, luminanceOf(with) - luminanceOf(own));
        const other = luminanceOf(all);
        sum += added;
        other_sum += @max(0, other - luminanceOf(own));
        if (added > pixel_part_min * other) visible_count += 1;
    }
    const seen: f64 = @floatFromInt(seen_count);
    const visible: f64 = @floatFromInt(visible_count);
    const shows = visible_count > 0 and visible >= pixel_share_min * seen or
        sum > part_min * other_sum;
    return .{ .shows = shows, .prevails = shows and sum > other_sum };
}

fn luminanceOf(pixel: [4]f32) f64 {
    return 0.2126 * @as(f64, pixel[0]) + 0.7152 * @as(f64, pixel[1]) +
        0.0722 * @as(f64, pixel[2]);
}

test "light shows where it is some part of all light on some part of the picture" {
    const Case = struct { f32, f32, usize, Weight };
    for ([_]Case{
        .{ 1, 0.5, 100, .{ .shows = true, .prevails = false } },
        .{ 1, 0.5, 1, .{ .shows = false, .prevails = false } },
        .{ 1, 0.04, 100, .{ .shows = false, .prevails = false } },
        .{ 1, 0.1, 100, .{ .shows = true, .prevails = false } },
        .{ 1, 0.1, 30, .{ .shows = false, .prevails = false } },
        .{ 1, 0.3, 10, .{ .shows = true, .prevails = false } },
        .{ 1, 3, 100, .{ .shows = true, .prevails = true } },
        .{ 0, 1e-6, 100, .{ .shows = true, .prevails = true } },
        .{ 0, 0, 100, .{ .shows = false, .prevails = false } },
    }) |case| {
        var pictures: [3][100][4]f32 = undefined;
        for (0..100) |index| {
            const glow: f32 = if (index % 2 == 0) 0 else 1e-3;
            const added: f32 = if (index < case[2]) case[1] else 0;
            for ([3]f32{ glow + case[0], glow, glow + added }, &pictures) |value, *picture|
                picture[index] = .{ value, value, value, 1 };
        }
        try std.testing.expectEqual(case[3], weigh(&pictures[0], &pictures[1], &pictures[2]));
    }
}
