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
const environment_layers = @import("environment_layers.zig");
const lights_file = @import("environment_lights.zig");
const path_file = @import("path.zig");
const ray_file = @import("../traverse/ray.zig");
const sample_file = @import("sample.zig");
const visibility_file = @import("visibility.zig");
const openness = environment_layers.openness;
const EnvironmentLight = lights_file.EnvironmentLight;
const EnvironmentLights = lights_file.EnvironmentLights;

/// See `bounce`.
const bounce_share = 1.4;

/// How a bundle's vertices are lit.
pub fn Vertices(comptime Kernel: type) type {
    return struct {
        path: *const path_file.PathState(Kernel),
        all: *const [Kernel.group_count]path_file.Vertex(Kernel.Rays),
        /// Lanes whose reflection is traced: only the diffuse part is missing.
        traced: *const [Kernel.group_count]Kernel.Rays.Mask,
        /// The same of a coat's reflection.
        coat_traced: *const [Kernel.group_count]Kernel.Rays.Mask,
        /// No rays go on from here.
        is_end: bool,
    };
}

/// Adds what rays of a group see that left the scene, where primary ones meet the floor
/// `floor_light` of it.
pub fn addEscaped(
    comptime Kernel: type,
    around: *const world_file.Environment,
    path: *const path_file.PathState(Kernel),
    group: usize,
    floor_light: Kernel.Rays.F32,
    sample: *sample_file.Sample(Kernel),
) void {
    const Vec3 = Kernel.Rays.Vec3;
    const ray = &path.bundle.groups[group];
    const missed = ray.closest.primitive.eq(.splat(ray_file.no_primitive));
    const gone = ray.active.bitAnd(missed);
    if (gone.none()) return;
    var throughput: Vec3 = .select(gone, path.throughput[group], .splat(.{ 0, 0, 0 }));
    if (sample.features.kept) sample.features.addEscaped(group, path, throughput);
    if (path.depth == 0) throughput = throughput.scale(floor_light);
    addSurroundings(Kernel, around, path, group, gone, throughput, sample);
}

/// Ends paths that have gone straight on through as many surfaces as they may: what is left of them
/// is better spent on what is around the scene than on a black that nothing there has. Returns how
/// many these are.
pub fn endRest(
    comptime Kernel: type,
    around: *const world_file.Environment,
    path: *const path_file.PathState(Kernel),
    vertices: *const [Kernel.group_count]path_file.Vertex(Kernel.Rays),
    sample: *sample_file.Sample(Kernel),
) u64 {
    if (path.transparency_depth < visibility_file.transparency_depth_max) return 0;
    const masks = path.restLanes(vertices) orelse return 0;
    var count: u64 = 0;
    for (masks, vertices, 0..) |mask, *vertex, group| {
        if (mask.none()) continue;
        const left = path.restThroughput(vertex, group);
        const throughput: Kernel.Rays.Vec3 = .select(mask, left, .splat(.{ 0, 0, 0 }));
        addSurroundings(Kernel, around, path, group, mask, throughput, sample);
        count += mask.popCount();
    }
    return count;
}

/// Adds what is around the scene as rays see it, worth `throughput`, which is 0 in other lanes.
fn addSurroundings(
    comptime Kernel: type,
    around: *const world_file.Environment,
    path: *const path_file.PathState(Kernel),
    group: usize,
    gone: Kernel.Rays.Mask,
    throughput: Kernel.Rays.Vec3,
    sample: *sample_file.Sample(Kernel),
) void {
    const environment = if (path.depth == 0) around.backdrop orelse around else around;
    if (path.depth > 0 or environment.is_seen)
        return sample.add(group, throughput.mul(seenBy(Kernel, environment, path, group, gone)));
    sample.addEscaped(group, throughput, environment.background);
}

/// What rays of a group see that leave the scene, in the lanes asked for.
fn seenBy(
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

/// Ambient light that points scatter: diffusely, and in place of rays that are not traced.
pub fn scatterAmbient(
    comptime Lanes: type,
    environment: *const world_file.Environment,
    vertex: *const path_file.Vertex(Lanes),
    traced: Lanes.Mask,
    is_end: bool,
) Lanes.Vec3 {
    const bsdf = &vertex.bsdf;
    const diffuse = bsdf.diffuse_albedo.scale(vertex.point.material.occlusion);
    const specular: Lanes.Vec3 = .select(traced, .splat(.{ 0, 0, 0 }), bsdf.specular_albedo);
    var scattered = diffuse.add(specular);
    if (is_end) scattered = scattered.add(bsdf.mirror.transmitted);
    return scattered.scale(.splat(environment.ambient));
}

/// Adds the light of the environment's map, if there is one. Vertices of coherent rays are near to
/// each other. Returns how many shadow rays it took.
pub fn addLight(
    comptime Kernel: type,
    visibility: *visibility_file.Visibility(Kernel),
    lights: *const EnvironmentLights,
    sample: u32,
    vertices: *const Vertices(Kernel),
    coherence: dispatch.Coherence,
    radiance: *[Kernel.group_count]Kernel.Rays.Vec3,
) u64 {
    const environment = visibility.frame.environment;
    if (environment.map == null) return 0;
    const Receiver = ReceiverOf(Kernel.Rays);
    const all = lights.all();
    var receivers: [Kernel.group_count]Receiver = undefined;
    for (&receivers, vertices.all) |*receiver, *vertex| {
        receiver.lit = .splat(false);
        if (vertex.seen.none()) continue;
        receiver.find(vertex, all);
    }
    var ray_count: u64 = 0;
    for (lights.ofSample(sample)) |part| for (part) |*light| {
        ray_count += addShadow(Kernel, visibility, light, vertices, coherence, &receivers);
    };
    for (&receivers, vertices.all, radiance, 0..) |*receiver, *vertex, *sum, group| {
        if (receiver.lit.none()) continue;
        const is_end = vertices.is_end;
        const traced = vertices.traced[group];
        var scattered = receiver.scatter(environment, lights.mean, vertex, traced, is_end);
        if (vertex.bsdf.layered) {
            const coat_traced = vertices.coat_traced[group];
            const further = &receiver.further;
            scattered = scattered
                .add(further.scatter(environment, vertex, receiver.lit, coat_traced));
        }
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
        const vertex = &vertices.all[group];
        const point = &vertex.point;
        facing.* = receiver.lit.bitAnd(isFacing(Rays, point, .splat(light.to_light)));
        var away = point.normal_geometric;
        if (vertex.bsdf.layered) {
            const back = vertex.bsdf.back_albedo;
            const to_light: Rays.Vec3 = .splat(light.to_light);
            const behind =
                receiver.lit.bitAnd(bsdf_file.behind(Rays, point, to_light, back));
            facing.* = facing.bitOr(behind);
            away = .select(behind, away.neg(), away);
        }
        if (facing.none()) continue;
        const primitive = vertices.path.bundle.groups[group].closest.primitive;
        const end = point.offsetOrigin(away, .zero());
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
        const counted = hidden.scale(.splat(light.weight));
        const vertex = &vertices.all[group];
        if (!vertex.bsdf.layered) {
            receiver.addLight(&receiver.hidden, vertex, light, counted);
            continue;
        }
        const front = isFacing(Rays, &vertex.point, .splat(light.to_light));
        const in_front: Rays.Vec3 = .select(front, counted, none);
        receiver.addLight(&receiver.hidden, vertex, light, in_front);
        const further = &receiver.further;
        further.addLight(&further.hidden, vertex, light, in_front, counted.sub(in_front));
    }
    return ray_count;
}

/// Points that light from a direction can reach from in front.
pub inline fn isFacing(comptime Lanes: type, point: anytype, to_light: Lanes.Vec3) Lanes.Mask {
    const zero: Lanes.F32 = .zero();
    return point.normal.dot(to_light).gt(zero)
        .bitAnd(point.normal_geometric.dot(to_light).gt(zero));
}

/// What the points of a group get of the lights.
pub fn ReceiverOf(comptime Lanes: type) type {
    const F32 = Lanes.F32;
    const Vec3 = Lanes.Vec3;
    return struct {
        lit: Lanes.Mask,
        /// Unit direction that the lobe is around.
        lobe: Vec3,
        /// Square of GGX's alpha of the lobe less 1.
        alpha_term: F32,
        /// Of all lights, and of those that are hidden.
        whole: Sums,
        hidden: Sums,
        /// Of vertices with further lobes.
        further: environment_layers.Receiver(Lanes),

        const Self = @This();

        /// Weighted by what lights add to the diffuse part, and by what to the glossy one.
        const Sums = struct {
            diffuse: Vec3,
            glossy: Vec3,
            /// As if the sky were as bright everywhere.
            diffuse_sky: F32,
            glossy_sky: F32,
            /// Radiance towards the view of what the smooth lobe leaves out: its tail, more than a
            /// quarter turn off its middle.
            tail: Vec3,
            /// The same of a sky of radiance 1.
            tail_sky: Vec3,

            const zero: Sums = .{
                .diffuse = .splat(.{ 0, 0, 0 }),
                .glossy = .splat(.{ 0, 0, 0 }),
                .diffuse_sky = .zero(),
                .glossy_sky = .zero(),
                .tail = .splat(.{ 0, 0, 0 }),
                .tail_sky = .splat(.{ 0, 0, 0 }),
            };
        };

        /// Points, and what all lights would give them.
        fn find(
            receiver: *Self,
            vertex: *const path_file.Vertex(Lanes),
            all: []const EnvironmentLight,
        ) void {
            receiver.start(vertex);
            const point = &vertex.point;
            const white: Vec3 = .splat(.{ 1, 1, 1 });
            const none: Vec3 = .splat(.{ 0, 0, 0 });
            for (all) |*light| {
                const facing = isFacing(Lanes, point, .splat(light.to_light));
                const share: Vec3 = .select(facing, white, none);
                receiver.addLight(&receiver.whole, vertex, light, share);
                if (!vertex.bsdf.layered) continue;
                const back_albedo = vertex.bsdf.back_albedo;
                const behind = bsdf_file
                    .behind(Lanes, point, .splat(light.to_light), back_albedo);
                const further = &receiver.further;
                const back: Vec3 = .select(behind, white, none);
                further.addLight(&further.whole, vertex, light, share, back);
            }
        }

        /// Points without light.
        pub inline fn start(receiver: *Self, vertex: *const path_file.Vertex(Lanes)) void {
            const point = &vertex.point;
            receiver.lit = vertex.seen.andNot(point.material.unlit);
            const alpha = point.material.roughness.mul(point.material.roughness);
            receiver.lobe = environment_layers
                .dominant(Lanes, point.normal, bsdf_file.reflect(Lanes, point), alpha);
            const squared = alpha.mul(alpha).max(.splat(environment_layers.lobe_alpha_squared_min));
            receiver.alpha_term = squared.sub(.splat(1));
            receiver.whole = .zero;
            receiver.hidden = .zero;
            if (vertex.bsdf.layered) receiver.further.start(vertex);
        }

        /// Adds some of what a light gives.
        inline fn addLight(
            receiver: *const Self,
            sums: *Sums,
            vertex: *const path_file.Vertex(Lanes),
            light: *const EnvironmentLight,
            share: Vec3,
        ) void {
            const point = &vertex.point;
            const to_light: Vec3 = .splat(light.to_light);
            const solid_angle: F32 = .splat(light.solid_angle);
            const cosine = receiver.lobe.dot(to_light).max(.splat(-1)).min(.splat(1));
            const diffuse = point.normal.dot(to_light);
            const glossy = environment_layers.glossyWeight(Lanes, cosine, receiver.alpha_term);
            const irradiance = share.mul(.splat(light.irradiance));
            const sky = share.y.mul(solid_angle);
            sums.diffuse = sums.diffuse.add(irradiance.scale(diffuse));
            sums.glossy = sums.glossy.add(irradiance.scale(glossy));
            sums.diffuse_sky = sums.diffuse_sky.add(sky.mul(diffuse));
            sums.glossy_sky = sums.glossy_sky.add(sky.mul(glossy));
            const window = F32.splat(0.5).sub(cosine.add(cosine)).max(.zero()).min(.splat(1));
            if (window.le(.zero()).all()) return;
            const specular = vertex.bsdf.evalLobes(point, to_light).specular.scale(window);
            sums.tail = sums.tail.add(specular.mul(irradiance).scale(.splat(std.math.pi)));
            sums.tail_sky = sums.tail_sky.add(specular.scale(sky));
        }

        /// Radiance towards the view for the light that arrives.
        pub fn scatter(
            receiver: *const Self,
            environment: *const world_file.Environment,
            mean: [3]f32,
            vertex: *const path_file.Vertex(Lanes),
            traced: Lanes.Mask,
            is_end: bool,
        ) Vec3 {
            const has_lights = environment.shadow_count > 0;
            const point = &vertex.point;
            const bsdf = &vertex.bsdf;
            const white: Vec3 = .splat(.{ 1, 1, 1 });
            const roughness = point.material.roughness;
            const whole = &receiver.whole;
            const hidden = &receiver.hidden;
            const around = point.material.base_color.min(white);
            const bounced = around.mul(.splat(mean));
            const irradiance = environment_file
                .irradiance(Lanes, environment, point.normal, receiver.lit)
                .mul(openness(Lanes, whole.diffuse, hidden.diffuse))
                .add(bounced.scale(bounce(hidden.diffuse_sky, whole.diffuse_sky)));
            // Where lights tell what arrives, a texture would tell it again.
            const occlusion = if (has_lights) F32.splat(1) else point.material.occlusion;
            var sum = bsdf.diffuse_albedo.mul(irradiance).scale(occlusion);
            if (bsdf.layered)
                sum = sum.add(bsdf.coating.sheen_albedo.mul(irradiance).scale(occlusion));
            const untraced = receiver.lit.andNot(traced);
            if (untraced.any()) {
                var smooth = environment_file
                    .radiance(Lanes, environment, receiver.lobe, roughness, .zero(), untraced);
                if (bsdf.layered and bsdf.stretch.lanes.any()) smooth =
                    environment_layers.stretched(Lanes, environment, vertex, untraced, smooth);
                const lobe = smooth.mul(openness(Lanes, whole.glossy, hidden.glossy))
                    .add(bounced.scale(bounce(hidden.glossy_sky, whole.glossy_sky)));
                const tail = whole.tail.sub(hidden.tail);
                const counted = whole.tail_sky.min(bsdf.specular_albedo.scale(.splat(0.5)));
                const seen = bsdf.specular_albedo.mul(lobe)
                    .add(tail.sub(smooth.mul(counted)));
                sum = sum.add(.select(untraced, seen, .splat(.{ 0, 0, 0 })));
            }
            return if (is_end) sum.add(receiver.through(environment, vertex)) else sum;
        }

        /// The same of what comes through where paths end.
        pub inline fn through(
            receiver: *const Self,
            environment: *const world_file.Environment,
            vertex: *const path_file.Vertex(Lanes),
        ) Vec3 {
            const mirror = &vertex.bsdf.mirror;
            const roughness = vertex.point.material.roughness;
            const seen = environment_file
                .radiance(Lanes, environment, mirror.refraction, roughness, .zero(), receiver.lit);
            return mirror.transmitted.mul(seen);
        }

        /// Radiance of what hides the sky, as a share of the mean, where it is white: it sees the
        /// sky itself, unless that is hidden all over.
        inline fn bounce(hidden: F32, whole: F32) F32 {
            const one: F32 = .splat(1);
            const closed = environment_layers.shareOf(Lanes, hidden, whole).max(.zero()).min(one);
            return closed.mul(one.sub(closed.mul(closed))).mul(.splat(bounce_share));
        }
    };
}
