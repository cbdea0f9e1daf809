//! Lights at points in lanes, before anything stands in the way.
//!
//! In: a light source, points. Out: the direction to it and the irradiance across that direction:
//! of punctual lights (KHR_lights_punctual) by inverse square, range window and cone; of emitters
//! by their lobe, and as a disk has it on its axis, I / (d^2 + r^2).

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
