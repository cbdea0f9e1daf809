//! Exposure: how bright the picture becomes, in stops.
//!
//! In: a small picture of the view. Out: the exposure that brings its log-average luminance to a
//! key (Reinhard et al. 2002, equation 1), no brighter than highlights stand. Percentiles and sums
//! are taken in a fixed order: the same number on every target.

const std = @import("std");
const Image = @import("../image.zig").Image;
const math = @import("../math.zig");
const settings = @import("../settings.zig");
const assert = std.debug.assert;

/// Luminance that the log-average is brought to.
const key = 0.18;
/// So much of what is seen, in percent, is to be no brighter than `highlight`.
const highlight_percentile = 95;
const highlight = 1.0;
/// What is darker than the highlights by more than this factor counts as if it were not: black
/// shadows are not worth highlights.
const darkness_max = 256.0;
/// Exposures are whole multiples of 1/100 stop, so that the number that is printed says it all.
const steps_per_stop = 100;

/// What a picture shows by radiance.
pub const Metered = struct {
    /// The exposure for it in stops, within `settings.exposure_auto_ev_min` and its `max`; 0 where
    /// it shows nothing, or nothing that is not black.
    ev: f32 = 0,
    /// Next to all of what is seen is black.
    is_black: bool = true,
};

/// The factor of an exposure in stops, 2^ev. Asserts that it is within f32's normal range.
pub fn scaleOf(ev: f32) f32 {
    assert(@abs(ev) <= 100);
    return @floatCast(math.elementary.pow(2, ev));
}

/// Meters a picture. With colours of the display, their pixels do not count.
pub fn meter(
    gpa: std.mem.Allocator,
    image: *const Image,
    display: ?*const Image,
) error{OutOfMemory}!Metered {
    const luminances = try gpa.alloc(f32, image.pixels.len);
    defer gpa.free(luminances);
    var count: usize = 0;
    for (image.pixels, 0..) |pixel, index| {
        const share = pixel[3] - if (display) |other| other.pixels[index][3] else 0;
        if (share < 0.5) continue;
        luminances[count] = luminanceOf(pixel) / share;
        count += 1;
    }
    if (count == 0) return .{};
    const seen = luminances[0..count];
    std.mem.sort(f32, seen, {}, std.sort.asc(f32));
    // The least that enough of them do not exceed.
    const bright: f64 = seen[(count * highlight_percentile + 99) / 100 - 1];
    if (bright < std.math.floatMin(f32)) return .{ .ev = ofBrightest(seen[count - 1]) };
    var sum: f64 = 0;
    for (seen) |luminance| sum += math.elementary.log(@max(luminance, bright / darkness_max));
    const average = math.elementary.exp(sum / @as(f64, @floatFromInt(count)));
    return .{ .ev = round(@min(key / average, highlight / bright)), .is_black = false };
}

/// Where next to all is black: by the one thing that is not, a lamp's reflection or a sliver.
fn ofBrightest(brightest: f32) f32 {
    return if (brightest < std.math.floatMin(f32)) 0 else round(highlight / brightest);
}

/// The exposure of a factor above 0, rounded and within bounds.
fn round(factor: f64) f32 {
    const ev = math.elementary.log(factor) / std.math.ln2;
    const within = std.math.clamp(ev, settings.exposure_auto_ev_min, settings.exposure_auto_ev_max);
    const steps = @floor(within * steps_per_stop + 0.5);
    return @floatCast(steps / steps_per_stop);
}

/// By Rec. 709 primaries, 0 where it is not above 0.
fn luminanceOf(pixel: [4]f32) f32 {
    const luminance = (0.2126 * pixel[0] + 0.7152 * pixel[1]) + 0.0722 * pixel[2];
    return if (luminance > 0) luminance else 0;
}

/// The exposure of a picture of one row of grays with alpha 1.
fn meterGrays(values: []const f32) !f32 {
    const gpa = std.testing.allocator;
    var image: Image = try .init(gpa, @intCast(values.len), 1);
    defer image.deinit(gpa);
    for (image.pixels, values) |*pixel, value| pixel.* = .{ value, value, value, 1 };
    return (try meter(gpa, &image, null)).ev;
}

test "an exposure is a power of two" {
    try std.testing.expectEqual(1, scaleOf(0));
    try std.testing.expectApproxEqRel(8, scaleOf(3), 1e-6);
    try std.testing.expectApproxEqRel(0.25, scaleOf(-2), 1e-6);
    try std.testing.expectApproxEqRel(std.math.sqrt2, scaleOf(0.5), 1e-6);
    try std.testing.expect(scaleOf(64) < std.math.inf(f32) and scaleOf(-64) > 0);
}

test "the log-average comes to the key, in whole steps" {
    try std.testing.expectEqual(0, try meterGrays(&.{0.18}));
    try std.testing.expectApproxEqAbs(2, try meterGrays(&.{ 0.045, 0.045 }), 0.005);
    // The geometric mean of 0.09 and 0.36.
    try std.testing.expectApproxEqAbs(0, try meterGrays(&.{ 0.09, 0.36 }), 0.005);
    const steps = 100 * try meterGrays(&.{ 0.3, 0.7, 0.01 });
    try std.testing.expectApproxEqAbs(@round(steps), steps, 1e-3);
}

test "highlights are not given for shadows, nor one of many pixels for all others" {
    var values: [100]f32 = @splat(0);
    for (values[50..]) |*value| value.* = 2;
    try std.testing.expectEqual(-1, try meterGrays(&values));
    const even: [100]f32 = @splat(0.18);
    values = even;
    values[3] = 1e6;
    try std.testing.expect(@abs(try meterGrays(&values)) < 0.4);
}

test "bounds, black, and nothing at all" {
    try std.testing.expectEqual(-24, try meterGrays(&.{1e30}));
    // The sun at noon on white: 100,000 lx.
    try std.testing.expectApproxEqAbs(-17.4, try meterGrays(&.{31831}), 0.1);
    try std.testing.expectEqual(10, try meterGrays(&.{1e-30}));
    try std.testing.expectEqual(0, try meterGrays(&.{ 0, -1, -0.0 }));
    var values: [100]f32 = @splat(0);
    values[7] = 4;
    try std.testing.expectEqual(-2, try meterGrays(&values));

    const gpa = std.testing.allocator;
    var image: Image = try .init(gpa, 2, 1);
    defer image.deinit(gpa);
    image.pixels[0] = .{ 0.36, 0.36, 0.36, 1 };
    image.pixels[1] = .{ 0, 0, 0, 0 };
    const metered: Metered = .{ .ev = -1, .is_black = false };
    try std.testing.expectEqual(metered, try meter(gpa, &image, null));
    // What is the display's is not metered.
    var display: Image = try .init(gpa, 2, 1);
    defer display.deinit(gpa);
    display.pixels[0] = .{ 1, 1, 1, 1 };
    display.pixels[1] = @splat(0);
    try std.testing.expectEqual(Metered{}, try meter(gpa, &image, &display));
}
