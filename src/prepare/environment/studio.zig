//! The studio: the light that files without any are shown in, computed from a few lamps.
//!
//! In: nothing. Out: radiance by direction, seen by a camera that looks along -z: a large soft box
//! above and behind the camera's left, a weak wide one to the right, a strip behind the model that
//! lights its rim, a light floor, a mid-grey horizon. Without hue; a white diffuse sphere has a
//! mean radiance of 0.75 towards the camera.

const std = @import("std");
const math = @import("../../math.zig");
const vec3 = math.vec3;
const Vec3 = math.Vec3;

/// A rectangle of light in the plane across its direction.
const SoftBox = struct {
    /// From the model, not of unit length.
    direction: Vec3,
    /// Tangents of half its angles, across and upwards.
    half_width: f32,
    half_height: f32,
    /// Over how much of it the edge fades, in the same unit.
    fade: f32,
    radiance: f32,
};

const boxes = [_]SoftBox{
    .{ // Key.
        .direction = .{ -0.62, 0.72, 0.62 },
        .half_width = 0.5,
        .half_height = 0.42,
        .fade = 0.12,
        .radiance = 5.6,
    },
    .{ // Fill.
        .direction = .{ 0.9, 0.3, 0.5 },
        .half_width = 0.75,
        .half_height = 0.6,
        .fade = 0.3,
        .radiance = 0.85,
    },
    .{ // Rim.
        .direction = .{ 0.35, 0.5, -0.9 },
        .half_width = 0.9,
        .half_height = 0.14,
        .fade = 0.06,
        .radiance = 4.5,
    },
};

/// Of the room, by height: straight down, just below the horizon, just above it, straight up.
const floor_radiance = 0.5;
const floor_far_radiance = 0.34;
const horizon_radiance = 0.22;
const ceiling_radiance = 0.3;
/// Sine of the angle over which the horizon fades.
const horizon_fade = 0.08;

/// Makes the mean of a white sphere what it should be.
const radiance_scale = 0.88725;

/// Radiance from a direction of any length.
pub fn radiance(towards: Vec3) f32 {
    const direction = vec3.normalize(towards).?;
    const height = direction[1];
    const floor = floor_far_radiance + (floor_radiance - floor_far_radiance) * -height;
    const wall = horizon_radiance + (ceiling_radiance - horizon_radiance) * height;
    const above = smoothStep(height / horizon_fade * 0.5 + 0.5);
    var sum = floor + (wall - floor) * above;
    inline for (boxes) |box| sum += boxRadiance(box, direction);
    return sum * radiance_scale;
}

fn boxRadiance(comptime box: SoftBox, direction: Vec3) f32 {
    const axis = comptime vec3.normalize(box.direction).?;
    const across = comptime vec3.normalize(vec3.cross(.{ 0, 1, 0 }, axis)).?;
    const upward = comptime vec3.cross(axis, across);
    const depth = vec3.dot(direction, axis);
    if (depth <= 0.1) return 0;
    const x = @abs(vec3.dot(direction, across)) / depth;
    const y = @abs(vec3.dot(direction, upward)) / depth;
    const inside = smoothStep((box.half_width - x) / box.fade) *
        smoothStep((box.half_height - y) / box.fade);
    return box.radiance * inside;
}

/// 0 below 0, 1 above 1, smooth in between.
fn smoothStep(x: f32) f32 {
    if (x <= 0) return 0;
    if (x >= 1) return 1;
    return x * x * (3 - 2 * x);
}
