//! The environment's light at the vertices of paths, and how much of it arrives there.
//!
//! In: an environment, vertices. Out: what they make of its light, added to the radiance of their
//! samples. The light that would arrive is a smooth integral, looked up; shadow rays of a few
//! directional lights, others in each sample, say what share of it does: for the diffuse part each
//! light weighs what it adds to the irradiance at this normal, for the glossy part what it adds to
//! the lobe, which is widened so that some lights are in it. The mean over all samples is that of
//! all lights: a sample's share may be below 0, and a surface that sees all of the sky has the
//! smooth integral without noise. Light that is kept away comes from surfaces in turn, which are
//! lit themselves: some of it, in the surface's own colour, is taken to arrive.

const std = @import("std");
const world_file = @import("../../world.zig");
const bundle_file = @import("../traverse/bundle.zig");
const dispatch = @import("../traverse/dispatch.zig");
const bsdf_file = @import("../shade/bsdf.zig");
const environment_file = @import("../shade/environment.zig");
const lights_file = @import("environment_lights.zig");
const path_file = @import("path.zig");
const visibility_file = @import("visibility.zig");
const EnvironmentLight = lights_file.EnvironmentLight;
const EnvironmentLights = lights_file.EnvironmentLights;

/// Radiance of what hides the sky, as a share of what is hidden, where it is white.
const bounce = 0.4;

/// Square of GGX's alpha of the narrowest lobe that lights are weighed by.
const lobe_alpha_squared_min = 0.1;

/// How a bundle's vertices are lit.
pub fn Vertices(comptime Kernel: type) type {
    return struct {
        path: *const path_file.PathState(Kernel),
        all: *const [Kernel.group_count]path_file.Vertex(Kernel.Rays),
        /// Lanes whose reflection is traced: only the diffuse part is missing.
        traced: [Kernel.group_count]Kernel.Rays.Mask,
        /// No rays go on from here.
        is_end: bool,
    };
}

/// What rays of a group see that leave the scene, in the lanes asked for.
pub fn seenBy(
    comptime Kernel: type,
    environment: *const world_file.Environment,
    path: *const path_file.PathState(Kernel),
    group: usize,
    asked: Kernel.Rays.Mask,
) Kernel.Rays.Vec3 {
    const has_cones = environment.map != null;
    return environment_file.radiance(
        Kernel.Rays,
        environment,
        path.bundle.groups[group].line.direction,
        path.roughness[group],
        if (has_cones) path.cone_spread[group].abs() else .zero(),
        asked,
    );
}

/// Adds the light of the environment. Vertices of coherent rays are near to each other. Returns how
/// many shadow rays it took.
pub fn addLight(
    comptime Kernel: type,
    visibility: *visibility_file.Visibility(Kernel),
    lights: *const EnvironmentLights,
    sample: u32,
    vertices: *const Vertices(Kernel),
    coherence: dispatch.Coherence,
    radiance: *[Kernel.group_count]Kernel.Rays.Vec3,
) u64 {
    const Receiver = ReceiverOf(Kernel.Rays);
    const all = lights.all();
    var receivers: [Kernel.group_count]Receiver = undefined;
    for (&receivers, vertices.all, vertices.traced) |*receiver, *vertex, traced| {
        receiver.lit = .splat(false);
        if (vertex.seen.none()) continue;
        receiver.find(vertex, traced, all);
    }
    var ray_count: u64 = 0;
    for (lights.ofSample(sample)) |part| for (part) |*light| {
        ray_count += addShadow(Kernel, visibility, light, vertices, coherence, &receivers);
    };
    const environment = visibility.frame.environment;
    for (&receivers, vertices.all, vertices.traced, radiance) |*receiver, *vertex, traced, *sum| {
        if (receiver.lit.none()) continue;
        const scattered = receiver.scatter(environment, vertex, traced, vertices.is_end);
        const none: Kernel.Rays.Vec3 = .splat(.{ 0, 0, 0 });
        const seen = vertex.throughput.mul(scattered);
        sum.* = sum.add(.select(receiver.lit, seen, none));
    }
    return ray_count;
}

/// Takes away what does not arrive of one light.
fn addShadow(
    comptime Kernel: type,
    visibility: *visibility_file.Visibility(Kernel),
    light: *const EnvironmentLight,
    vertices: *const Vertices(Kernel),
    coherence: dispatch.Coherence,
    receivers: *[Kernel.group_count]ReceiverOf(Kernel.Rays),
) u64 {
    const Rays = Kernel.Rays;
    var bundle: bundle_file.Bundle(Kernel) = undefined;
    var active: [Kernel.group_count]Rays.Mask = undefined;
    var ray_count: u64 = 0;
    for (&bundle.groups, &active, receivers, 0..) |*ray, *facing, *receiver, group| {
        facing.* = .splat(false);
        ray.active = facing.*;
        if (receiver.lit.none()) continue;
        const point = &vertices.all[group].point;
        facing.* = receiver.lit.bitAnd(isFacing(Rays, point, .splat(light.to_light)));
        if (facing.none()) continue;
        const primitive = vertices.path.bundle.groups[group].closest.primitive;
        const end = point.offsetOrigin(point.normal_geometric, .zero());
        ray.* = visibility_file.shadowRay(Rays, &light.source, end, primitive, facing.*);
        ray_count += facing.popCount();
    }
    if (ray_count == 0) return 0;
    var transmittances: [Kernel.group_count]Rays.Vec3 = undefined;
    visibility.transmittance(&bundle, &light.source, vertices.all, coherence, &transmittances);
    for (active, transmittances, receivers, 0..) |facing, transmittance, *receiver, group| {
        if (facing.none()) continue;
        const none: Rays.Vec3 = .splat(.{ 0, 0, 0 });
        const white: Rays.Vec3 = .splat(.{ 1, 1, 1 });
        const hidden: Rays.Vec3 = .select(facing, white.sub(transmittance), none);
        const weighed = receiver.weigh(&vertices.all[group].point, light);
        const counted = hidden.scale(.splat(light.weight));
        receiver.hidden_diffuse = receiver.hidden_diffuse.add(weighed.diffuse.mul(counted));
        receiver.hidden_glossy = receiver.hidden_glossy.add(weighed.glossy.mul(counted));
    }
    return ray_count;
}

/// Points that light from a direction can reach from in front.
inline fn isFacing(comptime Lanes: type, point: anytype, to_light: Lanes.Vec3) Lanes.Mask {
    const zero: Lanes.F32 = .zero();
    return point.normal.dot(to_light).gt(zero)
        .bitAnd(point.normal_geometric.dot(to_light).gt(zero));
}

/// What the points of a group get of the lights.
fn ReceiverOf(comptime Lanes: type) type {
    const F32 = Lanes.F32;
    const Vec3 = Lanes.Vec3;
    return struct {
        lit: Lanes.Mask,
        /// Unit direction that lobes are around.
        reflected: Vec3,
        /// Square of GGX's alpha less 1 of the lobe.
        alpha_term: F32,
        /// Of all lights, and of those that are hidden.
        whole_diffuse: Vec3,
        whole_glossy: Vec3,
        hidden_diffuse: Vec3,
        hidden_glossy: Vec3,

        const Self = @This();
        const Weighed = struct { diffuse: Vec3, glossy: Vec3 };

        /// Points, and what all lights would give them.
        fn find(
            receiver: *Self,
            vertex: *const path_file.Vertex(Lanes),
            traced: Lanes.Mask,
            all: []const EnvironmentLight,
        ) void {
            _ = traced;
            const none: Vec3 = .splat(.{ 0, 0, 0 });
            const point = &vertex.point;
            receiver.lit = vertex.seen.andNot(point.material.unlit);
            receiver.reflected = bsdf_file.reflect(Lanes, point);
            const alpha = point.material.roughness.mul(point.material.roughness);
            const squared = alpha.mul(alpha).max(.splat(lobe_alpha_squared_min));
            receiver.alpha_term = squared.sub(.splat(1));
            receiver.whole_diffuse = none;
            receiver.whole_glossy = none;
            receiver.hidden_diffuse = none;
            receiver.hidden_glossy = none;
            for (all) |*light| {
                const facing = isFacing(Lanes, point, .splat(light.to_light));
                const weighed = receiver.weigh(point, light);
                receiver.whole_diffuse = receiver.whole_diffuse
                    .add(.select(facing, weighed.diffuse, none));
                receiver.whole_glossy = receiver.whole_glossy
                    .add(.select(facing, weighed.glossy, none));
            }
        }

        /// What a light adds to the irradiance and to the lobe.
        inline fn weigh(
            receiver: *const Self,
            point: anytype,
            light: *const EnvironmentLight,
        ) Weighed {
            const to_light: Vec3 = .splat(light.to_light);
            const irradiance: Vec3 = .splat(light.irradiance);
            const cosine = receiver.reflected.dot(to_light).max(.splat(-1)).min(.splat(1));
            const half = cosine.add(.splat(1)).mul(.splat(0.5));
            const slope = half.mul(receiver.alpha_term).add(.splat(1));
            return .{
                .diffuse = irradiance.scale(point.normal.dot(to_light)),
                .glossy = irradiance.scale(F32.splat(1).div(slope.mul(slope))),
            };
        }

        /// Radiance towards the view for the light that arrives.
        fn scatter(
            receiver: *const Self,
            environment: *const world_file.Environment,
            vertex: *const path_file.Vertex(Lanes),
            traced: Lanes.Mask,
            is_end: bool,
        ) Vec3 {
            const point = &vertex.point;
            const bsdf = &vertex.bsdf;
            const roughness = point.material.roughness;
            const irradiance = environment_file
                .irradiance(Lanes, environment, point.normal, receiver.lit);
            const diffuse_share =
                share(receiver.whole_diffuse, receiver.hidden_diffuse, bsdf.diffuse_albedo);
            var sum = bsdf.diffuse_albedo.mul(irradiance).mul(diffuse_share);
            const untraced = receiver.lit.andNot(traced);
            if (untraced.any()) {
                const lobe = environment_file
                    .radiance(Lanes, environment, receiver.reflected, roughness, .zero(), untraced);
                const lobe_share = share(receiver.whole_glossy, receiver.hidden_glossy, bsdf.f0);
                sum = sum.add(bsdf.specular_albedo.mul(lobe).mul(lobe_share));
            }
            if (is_end) {
                const through = environment_file.radiance(
                    Lanes,
                    environment,
                    bsdf.mirror.refraction,
                    roughness,
                    .zero(),
                    receiver.lit,
                );
                sum = sum.add(bsdf.mirror.transmitted.mul(through));
            }
            return sum;
        }

        /// Of the light that would arrive, what does, bounced off surfaces like this one included;
        /// all of it where there is no light to tell.
        inline fn share(whole: Vec3, hidden: Vec3, albedo: Vec3) Vec3 {
            return .{
                .x = shareOf(whole.x, hidden.x, albedo.x),
                .y = shareOf(whole.y, hidden.y, albedo.y),
                .z = shareOf(whole.z, hidden.z, albedo.z),
            };
        }

        inline fn shareOf(whole: F32, hidden: F32, albedo: F32) F32 {
            const one: F32 = .splat(1);
            const known = whole.gt(.splat(1e-12));
            const dark = hidden.div(F32.select(known, whole, one));
            const lost = dark.mul(one.sub(albedo.mul(.splat(bounce))));
            return F32.select(known, one.sub(lost), one);
        }
    };
}
