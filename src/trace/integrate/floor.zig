//! A floor that cannot be seen and catches shadow: how much of the light arrives on a plane below.
//!
//! In: primary rays that left the scene. Out: the share of a plane's light that arrives
//! where they meet it from above, as shadow rays of the environment's lights of a sample and of
//! the scene's lights have it, weighed by luminance. As with surfaces (`environment.zig`), the mean
//! over all samples is that of all lights.

const std = @import("std");
const world_file = @import("../../world.zig");
const bundle_file = @import("../traverse/bundle.zig");
const ray_file = @import("../traverse/ray.zig");
const light_file = @import("../shade/light.zig");
const path_file = @import("path.zig");
const visibility_file = @import("visibility.zig");
const EnvironmentLights = @import("environment_lights.zig").EnvironmentLights;

/// Finds the share in each lane, 1 where there is no floor or a ray does not meet it; `points` is
/// room for where they do. Returns how many shadow rays it took.
pub fn lightShare(
    comptime Kernel: type,
    visibility: *visibility_file.Visibility(Kernel),
    lights: *const EnvironmentLights,
    sample: u32,
    path: *const path_file.PathState(Kernel),
    points: *[Kernel.group_count]path_file.Vertex(Kernel.Rays),
    shares: *[Kernel.group_count]Kernel.Rays.F32,
) u64 {
    const Rays = Kernel.Rays;
    shares.* = @splat(.splat(1));
    const height = visibility.frame.environment.floor_height orelse return 0;
    var any_met = false;
    for (points, 0..) |*point, group| {
        meet(Kernel, height, path, group, point);
        any_met = any_met or point.seen.any();
    }
    if (!any_met) return 0;
    var floor: Floor(Kernel) = .{
        .visibility = visibility,
        .points = points,
        .whole = @splat(.zero()),
        .hidden = @splat(.zero()),
        .ray_count = 0,
    };
    const up: Rays.Vec3 = .splat(.{ 0, 1, 0 });
    for (lights.all()) |*light| {
        if (light.to_light[1] <= 0) continue;
        const weight: Rays.F32 = .splat(luminanceOf(light.irradiance) * light.to_light[1]);
        for (&floor.whole) |*whole| whole.* = whole.add(weight);
    }
    for (lights.ofSample(sample)) |part| for (part) |*light| {
        if (light.to_light[1] <= 0) continue;
        const luminance = luminanceOf(light.irradiance) * light.weight;
        floor.weights = @splat(.splat(luminance * light.to_light[1]));
        floor.addShadow(&light.source);
    };
    for (visibility.frame.lights) |*light| {
        for (&floor.weights, points, &floor.whole) |*weight, *point, *whole| {
            const arrival = light_file.arrive(Rays, light, &point.point);
            const color = arrival.irradiance.scale(arrival.to_light.dot(up).max(.zero()));
            weight.* = color.dot(.splat(luminance_weights)).mul(.splat(1.0 / std.math.pi));
            whole.* = whole.add(weight.*);
        }
        floor.addShadow(light);
    }
    for (shares, points, floor.whole, floor.hidden) |*share, *point, whole, hidden| {
        const lit = point.seen.bitAnd(whole.gt(.zero()));
        const dark = hidden.div(Rays.F32.select(lit, whole, .splat(1)));
        share.* = .select(lit, share.sub(dark), share.*);
    }
    return floor.ray_count;
}

const luminance_weights = [3]f32{ 0.2126, 0.7152, 0.0722 };

fn luminanceOf(color: [3]f32) f32 {
    const weights = luminance_weights;
    return (weights[0] * color[0] + weights[1] * color[1]) + weights[2] * color[2];
}

/// Where the rays of a group that left the scene meet the plane from above.
fn meet(
    comptime Kernel: type,
    height: f32,
    path: *const path_file.PathState(Kernel),
    group: usize,
    point: *path_file.Vertex(Kernel.Rays),
) void {
    const Rays = Kernel.Rays;
    const ray = &path.bundle.groups[group];
    const missed = ray.closest.primitive.eq(.splat(ray_file.no_primitive));
    const down = ray.line.direction.y.lt(.zero());
    const drop = Rays.F32.splat(height).sub(ray.line.origin.y);
    point.seen = ray.active.bitAnd(missed).bitAnd(down).bitAnd(drop.lt(.zero()));
    if (point.seen.none()) return;
    const t = drop.div(ray.line.direction.y);
    const way = ray.line.direction.scale(t);
    var position = ray.line.origin.add(way);
    position.y = .splat(height);
    // Near the horizon there may be none.
    const reach = way.abs();
    const far = reach.x.max(reach.z).lt(.splat(1e15));
    point.seen = point.seen.bitAnd(far);
    point.point.position = .select(point.seen, position, .splat(.{ 0, height, 0 }));
    point.point.cone_width = .zero();
}

/// Sums over lights.
fn Floor(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    return struct {
        visibility: *visibility_file.Visibility(Kernel),
        points: *const [Kernel.group_count]path_file.Vertex(Rays),
        /// Light that would arrive, and that does not.
        whole: [Kernel.group_count]Rays.F32,
        hidden: [Kernel.group_count]Rays.F32,
        /// Of the light under way.
        weights: [Kernel.group_count]Rays.F32 = undefined,
        ray_count: u64,

        fn addShadow(floor: *@This(), light: *const world_file.Light) void {
            var bundle: bundle_file.Bundle(Kernel) = undefined;
            var active: [Kernel.group_count]Rays.Mask = undefined;
            var count: u64 = 0;
            for (&bundle.groups, &active, floor.points, 0..) |*ray, *lit, *point, group| {
                lit.* = .splat(false);
                ray.active = lit.*;
                if (point.seen.none()) continue;
                lit.* = point.seen.bitAnd(floor.weights[group].gt(.zero()));
                const none: Rays.I32 = .splat(ray_file.no_primitive);
                const position = point.point.position;
                ray.* = visibility_file.shadowRay(Rays, light, position, none, lit.*);
                count += lit.popCount();
            }
            if (count == 0) return;
            floor.ray_count += count;
            var transmittances: [Kernel.group_count]Rays.Vec3 = undefined;
            floor.visibility.transmittance(&bundle, light, floor.points, .all, &transmittances);
            for (active, transmittances, floor.weights, &floor.hidden) |lit, share, weight, *sum| {
                if (lit.none()) continue;
                const through = share.dot(.splat(luminance_weights));
                const lost = weight.mul(Rays.F32.splat(1).sub(through));
                sum.* = .select(lit, sum.add(lost), sum.*);
            }
        }
    };
}
