//! Light of a pixel's own part of a sample's lights: the environment's, by which the share of it
//! that arrives is found, and virtual lights.
//!
//! In: the vertices of a bundle's paths, lights. Out: by layer of `interleave.zig` the light of
//! these that arrives, and what the filter divides it by. As light that has bounced is traced, none
//! stands for what surfaces around send back. Virtual lights stand for surfaces: glossy lobes that
//! no ray is traced for see them as diffuse ones of the same albedo would, without highlights.

const std = @import("std");
const world_file = @import("../../world.zig");
const bundle_file = @import("../traverse/bundle.zig");
const dispatch = @import("../traverse/dispatch.zig");
const bsdf_file = @import("../shade/bsdf.zig");
const light_file = @import("../shade/light.zig");
const environment_file = @import("environment.zig");
const environment_layers = @import("environment_layers.zig");
const path_file = @import("path.zig");
const visibility_file = @import("visibility.zig");
const EnvironmentLight = @import("environment_lights.zig").EnvironmentLight;
const Light = world_file.Light;

/// What vertices make of light that is filtered.
pub fn InterleavedLight(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const Mask = Rays.Mask;
    const Vec3 = Rays.Vec3;
    const group_count = Kernel.group_count;
    const none: Vec3 = .splat(.{ 0, 0, 0 });
    const Receiver = environment_file.ReceiverOf(Rays);
    const Visibility = visibility_file.Visibility(Kernel);
    const Vertices = environment_file.Vertices(Kernel);
    const Worth = WorthOf(Kernel);
    const Shadows = ShadowsOf(Kernel);
    return struct {
        /// Of the sample under way, see `interleave.Layers`.
        bounced: [group_count]Vec3,
        albedo: [group_count]Vec3,
        arriving: [group_count]Vec3,
        shining: [group_count]Vec3,
        open: [group_count]Vec3,
        /// Of the step under way.
        worths: [group_count]Worth,
        receivers: [group_count]Receiver,

        const Self = @This();

        /// No light yet.
        pub fn start(light: *Self, has_sky: bool) void {
            light.bounced = @splat(none);
            light.albedo = @splat(none);
            if (!has_sky) return;
            light.arriving = @splat(none);
            light.shining = @splat(none);
            light.open = @splat(none);
        }

        /// Begins a step.
        pub fn find(light: *Self, vertices: *const Vertices) void {
            for (&light.worths, &light.albedo, 0..) |*worth, *albedo, group| {
                worth.find(vertices, group);
                if (worth.lit.none()) continue;
                albedo.* = albedo.add(worth.front).add(worth.back);
            }
        }

        /// Adds the light of the environment: that of `sources` to the radiance of samples, all
        /// other to the layers. Returns how many shadow rays it took.
        pub fn addSky(
            light: *Self,
            visibility: *Visibility,
            sources: []const EnvironmentLight,
            sky: []const EnvironmentLight,
            vertices: *const Vertices,
            coherence: dispatch.Coherence,
            radiance: *[group_count]Vec3,
        ) u64 {
            const environment = visibility.frame.environment;
            for (&light.receivers, vertices.all, &light.worths) |*receiver, *vertex, *worth| {
                receiver.lit = worth.lit;
                if (worth.lit.any()) receiver.start(vertex);
            }
            var sun: [2][group_count]Vec3 = .{ @splat(none), @splat(none) };
            var count: u64 = 0;
            for (sources) |*one| {
                count += light.addParallel(visibility, one, vertices, coherence, &sun[0], &sun[1]);
            }
            for (sky) |*one| count += light.addParallel(
                visibility,
                one,
                vertices,
                coherence,
                &light.arriving,
                &light.shining,
            );
            for (&light.receivers, vertices.all, radiance, 0..) |*receiver, *vertex, *sum, group| {
                if (receiver.lit.none()) continue;
                const traced = vertices.traced[group];
                var all = receiver.scatter(environment, .{ 0, 0, 0 }, vertex, traced, false);
                if (vertex.bsdf.layered) all = all.add(receiver.further
                    .scatter(environment, vertex, receiver.lit, vertices.coat_traced[group]));
                all = .select(receiver.lit, vertex.throughput.mul(all), none);
                if (vertices.is_end) {
                    const through = vertex.throughput.mul(receiver.through(environment, vertex));
                    sum.* = sum.add(.select(receiver.lit, through, none));
                }
                // The sources' part of it has shadows of its own.
                const part = all.min(sun[1][group]);
                const arriving = part.mul(quotient(sun[0][group], sun[1][group]));
                sum.* = sum.add(arriving);
                light.open[group] = light.open[group].add(all.sub(part));
            }
            return count;
        }

        fn quotient(part: Vec3, whole: Vec3) Vec3 {
            return .{
                .x = environment_layers.shareOf(Rays, part.x, whole.x),
                .y = environment_layers.shareOf(Rays, part.y, whole.y),
                .z = environment_layers.shareOf(Rays, part.z, whole.z),
            };
        }

        /// Adds the light of one of the environment's lights: what arrives, and what would.
        fn addParallel(
            light: *Self,
            visibility: *Visibility,
            one: *const EnvironmentLight,
            vertices: *const Vertices,
            coherence: dispatch.Coherence,
            arriving: *[group_count]Vec3,
            shining: *[group_count]Vec3,
        ) u64 {
            var shadows: Shadows = .{};
            for (&light.worths, 0..) |*worth, group| {
                shadows.clear(group);
                if (worth.lit.none()) continue;
                const vertex = &vertices.all[group];
                const point = &vertex.point;
                const to_light: Vec3 = .splat(one.to_light);
                const facing = worth.lit.bitAnd(environment_file.isFacing(Rays, point, to_light));
                const weight = light.parallelWeight(group, vertex, to_light);
                var gain: Vec3 = .select(facing, weight, none);
                var behind: Mask = .splat(false);
                if (worth.has_back) {
                    behind = worth.lit.bitAnd(
                        bsdf_file.behind(Rays, point, to_light, vertex.bsdf.back_albedo),
                    );
                    const back = worth.back.scale(point.normal.dot(to_light).neg());
                    gain = .select(behind, back, gain);
                }
                gain = gain.mul(.splat(one.irradiance)).scale(.splat(one.weight));
                shining[group] = shining[group].add(gain);
                shadows.put(vertices, &one.source, group, gain, behind, .zero());
            }
            return shadows.trace(visibility, &one.source, vertices, coherence, arriving);
        }

        /// What lobes in front send to the view of light from a direction, for each unit of
        /// irradiance over pi across it.
        fn parallelWeight(
            light: *const Self,
            group: usize,
            vertex: *const path_file.Vertex(Rays),
            to_light: Vec3,
        ) Vec3 {
            const worth = &light.worths[group];
            const receiver = &light.receivers[group];
            var weight = worth.diffuse.scale(vertex.point.normal.dot(to_light));
            weight = weight.add(worth.glossy
                .scale(lobeWeight(receiver.lobe, receiver.alpha_term, to_light)));
            if (!vertex.bsdf.layered) return weight;
            const further = &receiver.further;
            return weight.add(worth.coat
                .scale(lobeWeight(further.lobe, further.alpha_term, to_light)));
        }

        /// Of a lobe whose integral over all directions is pi.
        inline fn lobeWeight(lobe: Vec3, alpha_term: F32, to_light: Vec3) F32 {
            const cosine = lobe.dot(to_light).max(.splat(-1)).min(.splat(1));
            const weight = environment_layers.glossyWeight(Rays, cosine, alpha_term);
            return weight.mul(alpha_term.add(.splat(1)).mul(.splat(0.25)));
        }

        /// Adds the light of a virtual light.
        pub fn addVirtual(
            light: *Self,
            visibility: *Visibility,
            one: *const Light,
            vertices: *const Vertices,
            coherence: dispatch.Coherence,
        ) u64 {
            const inverse_pi: F32 = .splat(1.0 / std.math.pi);
            var shadows: Shadows = .{};
            for (&light.worths, 0..) |*worth, group| {
                shadows.clear(group);
                if (worth.lit.none()) continue;
                const vertex = &vertices.all[group];
                const point = &vertex.point;
                const arrival = light_file.arrive(Rays, one, point);
                const to_light = arrival.to_light;
                const cosine = point.normal.dot(to_light).mul(inverse_pi);
                const facing = worth.lit.bitAnd(environment_file.isFacing(Rays, point, to_light));
                var gain: Vec3 = .select(facing, worth.front.scale(cosine), none);
                var behind: Mask = .splat(false);
                if (worth.has_back) {
                    behind = worth.lit.bitAnd(
                        bsdf_file.behind(Rays, point, to_light, vertex.bsdf.back_albedo),
                    );
                    gain = .select(behind, worth.back.scale(cosine.neg()), gain);
                }
                gain = gain.mul(arrival.irradiance);
                shadows.put(vertices, one, group, gain, behind, arrival.distance);
            }
            return shadows.trace(visibility, one, vertices, coherence, &light.bounced);
        }
    };
}

/// Albedos of the lobes that no rays are traced for, times the path's throughput; 0 in
/// lanes that light does not matter to.
fn WorthOf(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const Mask = Rays.Mask;
    const Vec3 = Rays.Vec3;
    const none: Vec3 = .splat(.{ 0, 0, 0 });
    const Vertices = environment_file.Vertices(Kernel);
    return struct {
        lit: Mask,
        diffuse: Vec3,
        glossy: Vec3,
        coat: Vec3,
        back: Vec3,
        /// Of all in front.
        front: Vec3,
        has_back: bool,

        fn find(worth: *@This(), vertices: *const Vertices, group: usize) void {
            const vertex = &vertices.all[group];
            worth.lit = .splat(false);
            if (vertex.seen.none()) return;
            const bsdf = &vertex.bsdf;
            worth.lit = vertex.seen.andNot(vertex.point.material.unlit);
            const throughput: Vec3 = .select(worth.lit, vertex.throughput, none);
            var diffuse = bsdf.diffuse_albedo;
            if (bsdf.layered) diffuse = diffuse.add(bsdf.coating.sheen_albedo);
            const glossy: Vec3 = .select(vertices.traced[group], none, bsdf.specular_albedo);
            worth.diffuse = throughput.mul(diffuse);
            worth.glossy = throughput.mul(glossy);
            worth.front = worth.diffuse.add(worth.glossy);
            worth.coat = none;
            worth.back = none;
            worth.has_back = false;
            if (!bsdf.layered) return;
            const coat = throughput.scale(bsdf.coating.albedo);
            worth.coat = .select(vertices.coat_traced[group], none, coat);
            worth.front = worth.front.add(worth.coat);
            worth.back = throughput.mul(bsdf.back_albedo);
            const back = worth.back;
            worth.has_back = back.x.max(back.y).max(back.z).gt(.zero()).any();
        }
    };
}

/// Shadow rays of one light, and what they are worth.
fn ShadowsOf(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const Mask = Rays.Mask;
    const Vec3 = Rays.Vec3;
    const group_count = Kernel.group_count;
    const none: Vec3 = .splat(.{ 0, 0, 0 });
    const Vertices = environment_file.Vertices(Kernel);
    const Visibility = visibility_file.Visibility(Kernel);
    return struct {
        const Self = @This();

        bundle: bundle_file.Bundle(Kernel) = undefined,
        gains: [group_count]Vec3 = undefined,
        active: [group_count]Mask = undefined,
        count: u64 = 0,

        inline fn clear(shadows: *Self, group: usize) void {
            shadows.active[group] = .splat(false);
            shadows.bundle.groups[group].active = .splat(false);
        }

        inline fn put(
            shadows: *Self,
            vertices: *const Vertices,
            one: *const Light,
            group: usize,
            gain: Vec3,
            behind: Mask,
            distance: F32,
        ) void {
            const shines = gain.x.max(gain.y).max(gain.z).gt(.zero());
            if (shines.none()) return;
            const point = &vertices.all[group].point;
            var away = point.normal_geometric;
            away = .select(behind, away.neg(), away);
            const end = point.offsetOrigin(away, distance);
            const primitive = vertices.path.bundle.groups[group].closest.primitive;
            shadows.bundle.groups[group] =
                visibility_file.shadowRay(Rays, one, end, primitive, shines);
            shadows.gains[group] = gain;
            shadows.active[group] = shines;
            shadows.count += shines.popCount();
        }

        fn trace(
            shadows: *Self,
            visibility: *Visibility,
            one: *const Light,
            vertices: *const Vertices,
            coherence: dispatch.Coherence,
            sums: *[group_count]Vec3,
        ) u64 {
            if (shadows.count == 0) return 0;
            var transmittances: [group_count]Vec3 = undefined;
            visibility.transmittance(
                &shadows.bundle,
                one,
                vertices.all,
                coherence,
                &transmittances,
            );
            const gains = &shadows.gains;
            for (shadows.active, transmittances, gains, sums) |active, share, gain, *sum| {
                if (active.none()) continue;
                sum.* = sum.add(.select(active, gain.mul(share), none));
            }
            return shadows.count;
        }
    };
}
