//! Numbers of a glTF material, held in their ranges.
//!
//! In: factors as cgltf has read them, finite. Out: the same within their ranges and not denormal;
//! what had to be clamped is a warning.

const std = @import("std");
const math = @import("../../math.zig");
const Source = @import("source.zig");
const Vec3 = math.Vec3;
const Factors = @This();

/// Upper end of a range that has none.
pub const endless = std.math.floatMax(f32);

source: *const Source,
/// Which material, for messages.
index: usize,

/// Four of 0..1.
pub fn color4(factors: Factors, name: []const u8, raw: [4]f32) [4]f32 {
    var color: [4]f32 = undefined;
    for (&color, raw) |*value, factor| value.* = factors.unit(name, factor);
    return color;
}

/// Three of 0..1.
pub fn color3(factors: Factors, name: []const u8, raw: [3]f32) Vec3 {
    return factors.vector(name, raw, 1);
}

/// Three of 0..`high`.
pub fn vector(factors: Factors, name: []const u8, raw: [3]f32, high: f32) Vec3 {
    var color: Vec3 = undefined;
    for (&color, raw) |*value, factor| value.* = factors.clamp(name, factor, 0, high);
    return color;
}

/// One of 0..1.
pub fn unit(factors: Factors, name: []const u8, value: f32) f32 {
    return factors.clamp(name, value, 0, 1);
}

/// One of `low`..`high`.
pub fn clamp(factors: Factors, name: []const u8, value: f32, low: f32, high: f32) f32 {
    if (value >= low and value <= high) return math.flushDenormal(value);
    if (high == endless) factors.source.forgive(
        "material {d}: {s} {d} is below {d}, clamped",
        .{ factors.index, name, value, low },
    ) else factors.source.forgive(
        "material {d}: {s} {d} is not in {d}..{d}, clamped",
        .{ factors.index, name, value, low, high },
    );
    return if (value > high) high else low;
}
