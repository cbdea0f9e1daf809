//! Lights at points in lanes, before anything stands in the way.
//!
//! In: a light source, points. Out: the direction to it and the irradiance across that direction:
//! of punctual lights (KHR_lights_punctual) by inverse square, range window and cone; of emitters
//! by their lobe, and as a disk has it on its axis, I / (d^2 + r^2).

const std = @import("std");
const simd = @import("../../simd.zig");
const world_file = @import("../../world.zig");
const Interaction = @import("interaction.zig").Interaction;
const Light = world_file.Light;

/// Light at points.
pub fn Arrival(comptime Lanes: type) type {
    return struct {
        /// Unit vector.
        to_light: Lanes.Vec3,
        /// On a plane across `to_light`, in lux; linear RGB.
        irradiance: Lanes.Vec3,
        /// To the light in metres, 0 if its rays are parallel.
        distance: Lanes.F32,
    };
}

/// What arrives at the points.
pub fn arrive(
    comptime Lanes: type,
    light: *const Light,
    point: *const Interaction(Lanes),
) Arrival(Lanes) {
    const F32 = Lanes.F32;
    const one: F32 = .splat(1);
    if (light.kind == .directional) return .{
        .to_light = Lanes.Vec3.splat(light.direction).neg(),
        .irradiance = .splat(light.intensity),
        .distance = .zero(),
    };
    const way = Lanes.Vec3.splat(light.position).sub(point.position);
    const distance_squared = way.dot(way).max(.splat(1e-20));
    const distance = distance_squared.sqrt();
    const to_light = way.scale(one.div(distance));
    const reach = distance_squared.mul(.splat(light.range_inv_squared));
    const window = one.sub(reach.mul(reach)).max(.zero());
    const cosine = Lanes.Vec3.splat(light.direction).dot(to_light).neg();
    if (light.kind == .emitter) {
        const lobe = cosine.mul(.splat(light.cone_scale)).add(.splat(light.cone_offset));
        const spread = distance_squared.add(.splat(light.disk));
        return .{
            .to_light = to_light,
            .irradiance = Lanes.Vec3.splat(light.intensity).scale(lobe.max(.zero()).div(spread)),
            .distance = distance,
        };
    }
    const cone = cosine.mul(.splat(light.cone_scale)).add(.splat(light.cone_offset))
        .max(.zero()).min(one);
    const factor = window.mul(cone.mul(cone)).div(distance_squared);
    return .{
        .to_light = to_light,
        .irradiance = Lanes.Vec3.splat(light.intensity).scale(factor),
        .distance = distance,
    };
}

const Single = simd.Lanes(.scalar, 1);

/// What arrives at a point, by its first channel and the distance.
fn testArrive(light: *const Light, position: [3]f32) [2]f32 {
    var point: Interaction(Single) = undefined;
    point.position = .splat(position);
    const arrival = arrive(Single, light, &point);
    return .{ arrival.irradiance.x.lane(0), arrival.distance.lane(0) };
}

test "a range ends light by a smooth window, as KHR_lights_punctual has it" {
    var light: Light = .{
        .kind = .point,
        .from_receiver = false,
        .position = .{ 1, 0, 0 },
        .direction = .{ 0, 0, -1 },
        .intensity = .{ 8, 8, 8 },
        .range_inv_squared = 0,
        .cone_scale = 0,
        .cone_offset = 1,
    };
    // Intensity over the squared distance.
    try std.testing.expectEqual([2]f32{ 2, 2 }, testArrive(&light, .{ 1, 2, 0 }));
    // Times max(min(1 - (distance / range)^4, 1), 0).
    light.range_inv_squared = 1.0 / 16.0;
    const Case = struct { f32, f32 };
    for ([_]Case{ .{ 1, 8 * 255.0 / 256.0 }, .{ 2, 1.875 }, .{ 4, 0 }, .{ 9, 0 } }) |case| {
        const found = testArrive(&light, .{ 1, 0, case[0] })[0];
        try std.testing.expectApproxEqRel(case[1], found, 1e-6);
    }
    // Directional lights have neither.
    light.kind = .directional;
    try std.testing.expectEqual([2]f32{ 8, 0 }, testArrive(&light, .{ 100, 0, 7 }));
}

test "a spot is full within its inner cone and ends at the outer one" {
    const cosine_inner: f32 = 0.9;
    const cosine_outer: f32 = 0.5;
    const scale = 1 / (cosine_inner - cosine_outer);
    const light: Light = .{
        .kind = .spot,
        .from_receiver = false,
        .position = .{ 0, 0, 0 },
        .direction = .{ 0, 0, -1 },
        .intensity = .{ 4, 4, 4 },
        .range_inv_squared = 0,
        .cone_scale = scale,
        .cone_offset = -cosine_outer * scale,
    };
    const Case = struct { f32, f32 };
    // The square of a ramp in the cosine; nothing behind.
    for ([_]Case{
        .{ 1, 4 }, .{ 0.9, 4 }, .{ 0.7, 1 }, .{ 0.6, 0.25 }, .{ 0.5, 0 }, .{ 0.1, 0 }, .{ -1, 0 },
    }) |case| {
        const sine = @sqrt(1 - case[0] * case[0]);
        const found = testArrive(&light, .{ sine, 0, -case[0] })[0];
        try std.testing.expectApproxEqAbs(case[1], found, 1e-4);
    }
}

test "an emitter falls off as a disk does on its axis, by its lobe" {
    const light: Light = .{
        .kind = .emitter,
        .from_receiver = false,
        .position = .{ 0, 0, 0 },
        .direction = .{ 0, 0, -1 },
        .intensity = .{ 3, 3, 3 },
        .range_inv_squared = 0,
        .cone_scale = 1,
        .cone_offset = 0,
        .disk = 2,
    };
    try std.testing.expectEqual([2]f32{ 1, 1 }, testArrive(&light, .{ 0, 0, -1 }));
    // A cosine of 0.6 at a distance of 5.
    const found = testArrive(&light, .{ 4, 0, -3 })[0];
    try std.testing.expectApproxEqRel(@as(f32, 3 * 0.6 / 27.0), found, 1e-6);
    try std.testing.expectEqual(0, testArrive(&light, .{ 0, 0, 1 })[0]);
}
