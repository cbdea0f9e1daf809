//! Rays that go on from the vertices of paths: reflections and refractions.
//!
//! In: vertices. Out: rays on a stack. Smooth surfaces send one ray each way. Rays of rough ones
//! are spread over the samples of a pixel, by a quarter of the lobe's variance, of wide reflections
//! by half of it; the rest is left to prefiltered textures and environment, which know no noise.
//! Glass that disperses light sends a ray for each channel.

const std = @import("std");
const world_file = @import("../../world.zig");
const bsdf_file = @import("../shade/bsdf.zig");
const camera = @import("camera.zig");
const numbers_file = @import("numbers.zig");
const path_file = @import("path.zig");
const transmission = @import("../shade/transmission.zig");
const Frame = world_file.Frame;
const Rectangle = @import("../../film.zig").Rectangle;

/// A path whose throughput has fallen below this is not worth a reflection ray.
const reflection_throughput_min = 1.0 / 256.0;

/// Up to this roughness reflections that are worth more than `rough_throughput_min` are traced, in
/// frames with an environment map.
const rough_traced_max = 0.5;

/// See `rough_traced_max`.
const rough_throughput_min = 1.0 / 8.0;

/// Highlights of emitters are those of the lights that stand for them where surfaces are rougher
/// and lobes spread: few samples meet a small bright lamp, and show it as noise. Smoother ones
/// mirror it.
const emitter_roughness_max = 0.1;

/// Rougher lobes are spread over the samples.
const spread_roughness_min = 0.04;

/// Rays through the first rough surface for each sample of a pixel: what is behind it may be
/// anything, and is all that is seen of it.
pub const rough_split = 4;

/// What of a lobe the samples are spread by; the rest is left to what is prefiltered.
fn Spread(comptime Lanes: type) type {
    const F32 = Lanes.F32;
    return struct {
        /// Lanes whose lobe is spread over the samples.
        lanes: Lanes.Mask,
        /// GGX's alpha of the samples, as a share of the lobe's.
        alpha: F32,
        /// Of the disc that microfacets are drawn from, the radius that is: its rim stands for the
        /// long tail of the lobe, which few samples show as dots where it is narrow.
        radius: F32,
        /// Roughness of the rest, as a share of the lobe's: variances add.
        rest: F32,

        /// For a lobe of some roughness, 0 for what is seen through a surface: the wider a
        /// reflection, the more of it is other surfaces.
        fn of(lanes: Lanes.Mask, roughness: F32) @This() {
            const wide = roughness.sub(.splat(0.3)).mul(.splat(5)).max(.zero()).min(.splat(1));
            const alpha = wide.mul(.splat(0.2)).add(.splat(0.5));
            return .{
                .lanes = lanes,
                .alpha = alpha,
                .radius = wide.mul(.splat(0.2)).add(.splat(0.8)),
                .rest = F32.splat(1).sub(alpha.mul(alpha)).sqrt().sqrt(),
            };
        }

        /// Roughness of what is not spread over the samples.
        fn left(spread: *const @This(), roughness: F32) F32 {
            return .select(spread.lanes, roughness.mul(spread.rest), roughness);
        }

        /// Numbers in 0..1 for points of the disc within the radius.
        fn within(spread: *const @This(), numbers: [2]F32) [2]F32 {
            const half: F32 = .splat(0.5);
            return .{
                numbers[0].sub(half).mul(spread.radius).add(half),
                numbers[1].sub(half).mul(spread.radius).add(half),
            };
        }
    };
}

/// The rays of one step of an integrator.
pub fn Bounces(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const Vec3 = Rays.Vec3;
    const Mask = Rays.Mask;
    const group_count = Kernel.group_count;
    const PathState = path_file.PathState(Kernel);
    const PathStack = path_file.PathStack(Kernel);
    const Vertex = path_file.Vertex(Rays);
    return struct {
        frame: *const Frame,
        rectangle: Rectangle,
        sample: u32,
        /// Rough lobes are spread over the samples: there is more than light of no size to see.
        spreads: bool,
        /// Lanes whose reflection is traced, and those whose coat's is.
        reflected: [group_count]Mask,
        coat_reflected: [group_count]Mask,
        /// Those of the former that see emitters, and have no highlights of them.
        emitters_reflected: [group_count]Mask,
        /// Lights stand for emitters, and lobes are spread.
        splits_emitters: bool,

        const Self = @This();
        const Vertices = [group_count]Vertex;

        /// Of a frame; `start` has to come before any vertex.
        pub fn init(bounces: *Self, frame: *const Frame) void {
            bounces.frame = frame;
            bounces.spreads = frame.environment.map != null;
            const has_highlights = bounces.spreads and frame.emission.len == 0;
            bounces.splits_emitters = has_highlights and for (frame.lights) |*light| {
                if (light.kind == .emitter) break true;
            } else false;
        }

        /// A sample of a bundle's pixels begins.
        pub fn start(bounces: *Self, rectangle: Rectangle, sample: u32) void {
            bounces.rectangle = rectangle;
            bounces.sample = sample;
        }

        /// Chooses the lanes of a group whose reflections are traced; none where paths end.
        pub fn choose(bounces: *Self, group: usize, vertex: *const Vertex, is_end: bool) void {
            const none: Mask = .splat(false);
            bounces.reflected[group] = none;
            bounces.coat_reflected[group] = none;
            bounces.emitters_reflected[group] = none;
            if (is_end or vertex.seen.none()) return;
            const bsdf = &vertex.bsdf;
            const material = &vertex.point.material;
            const lit = vertex.seen.andNot(material.unlit);
            const worth = largest(vertex.throughput.mul(bsdf.mirror.reflected));
            const roughness = bsdf_file.widest(Rays, bsdf, material.roughness);
            var traced = roughness.le(.splat(bsdf_file.mirror_roughness_max))
                .bitOr(bsdf.mirror.total);
            if (bounces.spreads) traced = traced.bitOr(roughness.le(.splat(rough_traced_max))
                .bitAnd(worth.gt(.splat(rough_throughput_min))));
            bounces.reflected[group] = lit.bitAnd(traced)
                .bitAnd(worth.gt(.splat(reflection_throughput_min)));
            bounces.emitters_reflected[group] = bounces.reflected[group];
            if (bounces.splits_emitters) bounces.emitters_reflected[group] =
                bounces.reflected[group].bitAnd(roughness.le(.splat(emitter_roughness_max)));
            if (!bsdf.layered) return;
            const coating = &bsdf.coating;
            const coat_worth = largest(vertex.throughput.scale(coating.albedo));
            bounces.coat_reflected[group] = lit
                .bitAnd(coating.roughness.le(.splat(bsdf_file.mirror_roughness_max)))
                .bitAnd(coat_worth.gt(.splat(reflection_throughput_min)));
        }

        inline fn largest(color: Vec3) F32 {
            return color.x.max(color.y).max(color.z);
        }

        /// Pushes what goes on, the last to be traced first: refractions, the coat's reflections,
        /// reflections. Returns how many rays these are.
        pub fn push(
            bounces: *const Self,
            path: *const PathState,
            vertices: *const Vertices,
            stack: *PathStack,
        ) u64 {
            const step: Step(Kernel) = .{
                .bounces = bounces,
                .path = path,
                .vertices = vertices,
                .stack = stack,
            };
            var count = step.pushRefractions();
            for (bounces.coat_reflected) |mask| if (mask.any()) {
                count += step.pushReflections(.coat);
                break;
            };
            return count + step.pushReflections(.base);
        }
    };
}

/// One step's rays.
fn Step(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const Vec3 = Rays.Vec3;
    const Mask = Rays.Mask;
    const group_count = Kernel.group_count;
    const PathState = path_file.PathState(Kernel);
    const Vertex = path_file.Vertex(Rays);
    return struct {
        bounces: *const Bounces(Kernel),
        path: *const PathState,
        vertices: *const [group_count]Vertex,
        stack: *path_file.PathStack(Kernel),

        const Self = @This();
        const Lobe = enum { base, coat };

        fn pushReflections(step: *const Self, comptime lobe: Lobe) u64 {
            const bounces = step.bounces;
            const masks = switch (lobe) {
                .base => &bounces.reflected,
                .coat => &bounces.coat_reflected,
            };
            const next, const count = step.room(masks) orelse return 0;
            for (masks, step.vertices, 0..) |mask, *vertex, group| {
                if (mask.none()) continue;
                const point = &vertex.point;
                const bsdf = &vertex.bsdf;
                const roughness = switch (lobe) {
                    .coat => bsdf.coating.roughness,
                    else => bsdf_file.widest(Rays, bsdf, point.material.roughness),
                };
                const spread: Spread(Rays) = .of(step.spreadOf(roughness), roughness);
                const mirrored = switch (lobe) {
                    .coat => bsdf_file.mirrored(Rays, point, bsdf.coating.normal),
                    else => bsdf_file.reflect(Rays, point),
                };
                const normal = if (lobe == .coat) bsdf.coating.normal else point.normal;
                var direction = mirrored;
                if (spread.lanes.any()) {
                    const numbers = spread.within(step.numbersOf(group, null));
                    const alpha = roughness.mul(roughness).mul(spread.alpha);
                    const found =
                        bsdf_file.mirroredRough(Rays, point, normal, alpha, numbers);
                    direction = .select(spread.lanes, found, mirrored);
                    if (lobe == .base and bsdf.layered and bsdf.stretch.lanes.any()) {
                        const stretched = bsdf.stretch.mirrored(point, spread.alpha, numbers);
                        const lanes = spread.lanes.bitAnd(bsdf.stretch.lanes);
                        direction = .select(lanes, stretched, direction);
                    }
                }
                // As long as before: what a plane mirror sends back stays linear in the pixel.
                const length = step.path.bundle.groups[group].line.direction.length();
                next.leave(step.path, group, &.{
                    .point = point,
                    .away = point.normal_geometric,
                    .direction = direction.scale(length),
                    .roughness = spread.left(roughness),
                    .emission = if (lobe == .coat)
                        .splat(1)
                    else
                        .select(bounces.emitters_reflected[group], .splat(1), .zero()),
                });
                const share = switch (lobe) {
                    .coat => Vec3{
                        .x = bsdf.coating.albedo,
                        .y = bsdf.coating.albedo,
                        .z = bsdf.coating.albedo,
                    },
                    else => bsdf.mirror.reflected,
                };
                next.throughput[group] = vertex.throughput.mul(share);
                next.sigma_t[group] = step.path.sigma_t[group];
                if (bounces.frame.needsFootprints()) next.reflectCones(step.path, group, point);
            }
            return count;
        }

        /// Lanes whose lobe is spread over the samples.
        inline fn spreadOf(step: *const Self, roughness: F32) Mask {
            if (!step.bounces.spreads) return .splat(false);
            return roughness.gt(.splat(spread_roughness_min));
        }

        /// Two numbers in 0..1 for the pixels of a group.
        fn numbersOf(step: *const Self, group: usize, part: ?u32) [2]F32 {
            const bounces = step.bounces;
            const pixels = camera.pixels(Kernel, bounces.rectangle, group);
            const sample = if (part) |one| bounces.sample *% rough_split +% one else bounces.sample;
            return numbers_file.at(Rays, pixels, sample, step.path.depth);
        }

        fn pushRefractions(step: *const Self) u64 {
            var plain: [group_count]Mask = undefined;
            var dispersed: [group_count]Mask = undefined;
            var any_dispersed = false;
            for (&plain, &dispersed, step.vertices) |*mask, *split, *vertex| {
                mask.* = .splat(false);
                split.* = .splat(false);
                if (vertex.seen.none()) continue;
                const worth = vertex.throughput.mul(vertex.bsdf.mirror.transmitted);
                mask.* = vertex.seen.bitAnd(worth.x.max(worth.y).max(worth.z).gt(.zero()))
                    .andNot(vertex.point.material.unlit);
                if (!vertex.bsdf.layered) continue;
                const layers = &vertex.layers;
                split.* = mask.bitAnd(layers.present).bitAnd(layers.dispersion.gt(.zero()))
                    .bitAnd(vertex.point.material.volume);
                mask.* = mask.andNot(split.*);
                any_dispersed = any_dispersed or split.any();
            }
            var count = step.pushPlainRefractions(&plain);
            if (!any_dispersed) return count;
            inline for (.{ "x", "y", "z" }, 0..) |name, channel| {
                var masks: [group_count]Mask = undefined;
                for (&masks, dispersed, step.vertices) |*mask, split, *vertex| {
                    mask.* = split;
                    if (split.none()) continue;
                    const worth = vertex.throughput.mul(vertex.bsdf.mirror.transmitted);
                    mask.* = split.bitAnd(@field(worth, name).gt(.zero()));
                }
                count += step.pushRefraction(&masks, .{ .channel = channel });
            }
            return count;
        }

        /// Of all channels; several rays each through the first rough surface that is seen.
        fn pushPlainRefractions(step: *const Self, plain: *const [group_count]Mask) u64 {
            if (step.path.depth > 0) return step.pushRefraction(plain, .{});
            var sharp: [group_count]Mask = undefined;
            var rough: [group_count]Mask = undefined;
            var any_rough = false;
            for (&sharp, &rough, plain, step.vertices) |*one, *several, mask, *vertex| {
                one.* = mask;
                several.* = .splat(false);
                if (mask.none()) continue;
                several.* = mask.bitAnd(step.spreadOf(vertex.point.material.roughness));
                one.* = mask.andNot(several.*);
                any_rough = any_rough or several.any();
            }
            var count = step.pushRefraction(&sharp, .{});
            if (!any_rough) return count;
            for (0..rough_split) |part| {
                count += step.pushRefraction(&rough, .{ .part = @intCast(part) });
            }
            return count;
        }

        /// Which rays of a surface.
        const Part = struct {
            /// One channel with its own index; null: all.
            channel: ?usize = null,
            /// One of `rough_split`; null: the only one.
            part: ?u32 = null,
        };

        fn pushRefraction(
            step: *const Self,
            masks: *const [group_count]Mask,
            which: Part,
        ) u64 {
            const next, const count = step.room(masks) orelse return 0;
            for (masks, step.vertices, 0..) |mask, *vertex, group| {
                if (mask.none()) continue;
                const point = &vertex.point;
                const passing = step.refracted(vertex, group, which);
                next.leave(step.path, group, &.{
                    .point = point,
                    .away = point.normal_geometric.neg(),
                    .direction = passing.direction,
                    .roughness = passing.roughness,
                    .emission = .splat(1),
                });
                var share = vertex.bsdf.mirror.transmitted;
                inline for (.{ "x", "y", "z" }, 0..) |name, index| {
                    if (which.channel) |one| if (one != index) {
                        @field(share, name) = .zero();
                    };
                }
                if (which.part != null) share = share.scale(.splat(1.0 / @as(f32, rough_split)));
                next.throughput[group] = vertex.throughput.mul(share);
                next.cross(step.path, group, point);
                if (step.bounces.frame.needsFootprints())
                    next.refractCones(step.path, group, point);
            }
            return count;
        }

        /// Light that goes through: where from, and what roughness reflections as wide would have.
        fn refracted(
            step: *const Self,
            vertex: *const Vertex,
            group: usize,
            which: Part,
        ) struct { direction: Vec3, roughness: F32 } {
            const point = &vertex.point;
            const material = &point.material;
            const thick = material.volume;
            var eta = point.eta;
            var direction = vertex.bsdf.mirror.refraction;
            if (which.channel) |index| {
                const iors = transmission
                    .dispersedIors(Rays, material.ior, vertex.layers.dispersion);
                eta = transmission.dispersedEta(Rays, eta, material.ior, iors[index]);
                const bent = transmission.refract(Rays, point.view, point.normal, eta).direction;
                const through = bent.dot(point.normal_geometric).lt(.zero());
                direction = .select(through, bent, direction);
            }
            const alpha = material.roughness.mul(material.roughness);
            const equal: F32 = .select(
                thick,
                transmission.equalAlpha(Rays, alpha, eta),
                transmission.thinAlpha(Rays, alpha, material.ior),
            );
            const roughness = equal.max(.zero()).sqrt();
            const spread: Spread(Rays) = .of(step.spreadOf(material.roughness), .zero());
            if (spread.lanes.any()) {
                const sampled = alpha.mul(spread.alpha);
                const found = transmission.boundaryOf(Rays, point, sampled, eta)
                    .sample(spread.within(step.numbersOf(group, which.part)));
                direction = .select(spread.lanes, found.to_light, direction);
            }
            return .{ .direction = direction, .roughness = spread.left(roughness) };
        }

        /// Room for the rays of the next depth in these lanes, and how many they are; null if there
        /// are none.
        fn room(
            step: *const Self,
            masks: *const [group_count]Mask,
        ) ?struct { *PathState, u64 } {
            var count: u64 = 0;
            for (masks) |mask| count += mask.popCount();
            if (count == 0) return null;
            const next = step.stack.push(step.path.depth + 1, 0);
            for (&next.bundle.groups, masks) |*ray, mask| ray.active = mask;
            return .{ next, count };
        }
    };
}
