//! One step of paths in lanes: from what their rays hit to light, shadow rays and rays that go on.
//!
//! In: paths whose rays have been traced. Out: their records for the next step, the radiance of
//! their samples, shadow rays. A path stays one path: whether alpha stops it, which lobe it follows
//! and whether it is worth going on (Russian roulette, Arvo and Kirk 1990) is each decided by a
//! number.

const std = @import("std");
const world_file = @import("../../world.zig");
const ray_file = @import("../traverse/ray.zig");
const bsdf_file = @import("../shade/bsdf.zig");
const environment_file = @import("../shade/environment.zig");
const exponential = @import("../shade/exponential.zig");
const light_file = @import("../shade/light.zig");
const ray_cone = @import("../shade/ray_cone.zig");
const Unique = @import("../shade/unique.zig").Unique;
const path_file = @import("path.zig");
const records_file = @import("path_records.zig");
const shadows_file = @import("path_shadows.zig");
const visibility_file = @import("visibility.zig");
const Film = @import("../../film.zig").Film;
const Frame = world_file.Frame;
const Record = records_file.Record;
const Rectangle = @import("../../film.zig").Rectangle;
const RayCounts = @import("../../statistics.zig").RayCounts;

/// Bounces after which paths that are worth little end by chance.
const roulette_depth = 3;

/// How wide the cone of a scattered ray is, over the square root of the solid angle that its
/// density stands for: what such a ray sees is blurred by the lobe anyway.
const cone_per_lobe = 0.05;

/// What numbers are for.
const Purpose = enum(u32) { opacity, lobe, lobe_x, lobe_y, light, light_x, light_y, roulette };

/// The step of one group after the other.
pub fn PathStep(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const I32 = Rays.I32;
    const Vec3 = Rays.Vec3;
    const Mask = Rays.Mask;
    const none: Vec3 = .splat(.{ 0, 0, 0 });
    return struct {
        frame: *const Frame,
        visibility: *visibility_file.Visibility(Kernel),
        records: []Record,
        shadows: *shadows_file.PathShadows(Kernel),
        rays: *RayCounts,
        depth_max: u32,
        /// Paths that go on.
        next: []u32,
        next_count: usize,
        /// Of the samples under way.
        rectangle: Rectangle,
        first_sample: u32,
        is_transparent: bool,
        keeps_display: bool,
        /// The paths of the groups under way.
        path: path_file.PathState(Kernel),
        vertex: path_file.Vertex(Rays),
        group: usize,
        numbers: [Rays.count]u32,
        seeds: [Rays.count]u32,
        depth: I32,
        transparency_depth: I32,
        scatter_pdf: F32,
        /// At the vertex.
        throughput: Vec3,

        const Self = @This();
        const Stored = records_file.Stored(Rays);
        const vectors = records_file.vectors;
        const floats = records_file.floats;
        const integers = records_file.integers;

        /// Takes the rays of some paths, to be traced from where they are.
        pub fn loadRays(step: *Self, group: usize, numbers: *const [Rays.count]u32) void {
            const all = step.records;
            const ray = &step.path.bundle.groups[group];
            const active = ray.active;
            ray.* = .endless(.init(
                vectors(Rays, all, numbers, "origin"),
                vectors(Rays, all, numbers, "direction"),
            ), integers(Rays, all, numbers, "skip"), active);
            ray.tnear = .{
                .t = floats(Rays, all, numbers, "start_t"),
                .primitive = integers(Rays, all, numbers, "start_primitive"),
            };
        }

        /// Takes all of some paths, the hits of their rays included.
        pub fn load(step: *Self, group: usize, numbers: *const [Rays.count]u32) void {
            const all = step.records;
            const path = &step.path;
            step.loadRays(group, numbers);
            path.bundle.groups[group].closest = .{
                .t = floats(Rays, all, numbers, "t"),
                .primitive = integers(Rays, all, numbers, "primitive"),
            };
            path.throughput[group] = vectors(Rays, all, numbers, "throughput");
            path.sigma_t[group] = vectors(Rays, all, numbers, "sigma_t");
            for (&path.nestings[group], numbers) |*to, one| to.* = all[one].nesting;
            path.roughness[group] = .zero();
            if (!step.frame.needsFootprints()) return;
            path.cone_width[group] = floats(Rays, all, numbers, "cone_width");
            path.cone_spread[group] = floats(Rays, all, numbers, "cone_spread");
        }

        /// Goes on with a loaded group of these paths.
        pub fn shade(step: *Self, group: usize, numbers: *const [Rays.count]u32) void {
            const all = step.records;
            const ray = &step.path.bundle.groups[group];
            step.group = group;
            step.numbers = numbers.*;
            step.depth = integers(Rays, all, numbers, "depth");
            step.transparency_depth = integers(Rays, all, numbers, "transparency_depth");
            step.scatter_pdf = floats(Rays, all, numbers, "scatter_pdf");
            step.throughput = step.path.throughput[group];
            step.seed();
            var gone = ray.active.bitAnd(ray.closest.primitive.eq(.splat(ray_file.no_primitive)));
            const hit = ray.active.andNot(gone);
            if (hit.any()) gone = gone.bitOr(step.shadeHits(hit));
            if (gone.any()) step.addSurroundings(gone);
        }

        /// Returns the lanes that have gone straight on through as many surfaces as they may.
        fn shadeHits(step: *Self, hit: Mask) Mask {
            const point = &step.vertex.point;
            step.find();
            step.absorb();
            const stopped = hit.bitAnd(step.number(.opacity).lt(point.opacity));
            var gone: Mask = .splat(false);
            const passing = hit.andNot(stopped);
            if (passing.any()) {
                const most: I32 = .splat(visibility_file.transparency_depth_max);
                gone = passing.andNot(step.transparency_depth.lt(most));
                step.pass(passing.andNot(gone));
            }
            if (stopped.none()) return gone;
            step.addGlow(stopped);
            const scattering = stopped.andNot(point.material.unlit)
                .andNot(step.depth.gt(.splat(@intCast(step.depth_max))));
            if (scattering.none()) return gone;
            step.addLight(scattering);
            step.scatter(scattering);
            return gone;
        }

        /// The points that are hit and what is there.
        fn find(step: *Self) void {
            const frame = step.frame;
            const vertex = &step.vertex;
            const point = &vertex.point;
            const ray = &step.path.bundle.groups[step.group];
            visibility_file.findInteraction(Rays, frame, &step.path, step.group, point);
            if (frame.materials.volumes.len > 0)
                step.visibility.boundaries[step.group].apply(point);
            // Backs that the eye does not see are there for other light.
            const unseen = point.culled.bitAnd(step.depth.eq(.zero()));
            point.opacity = .select(unseen, .zero(), point.opacity);
            if (!frame.hasLayers()) return vertex.bsdf.become(point);
            visibility_file.findLayers(Rays, frame, ray, point, &vertex.layers);
            if (vertex.layers.present.any())
                vertex.bsdf.becomeLayered(point, &vertex.layers)
            else
                vertex.bsdf.become(point);
        }

        /// Takes away what volumes absorb on the way of the rays (Beer and Lambert).
        fn absorb(step: *Self) void {
            const ray = &step.path.bundle.groups[step.group];
            const sigma_t = step.path.sigma_t[step.group];
            const zero: F32 = .zero();
            if (sigma_t.x.max(sigma_t.y).max(sigma_t.z).le(zero).all()) return;
            const way = ray.closest.t.sub(ray.tnear.t).mul(ray.line.direction.length()).neg();
            step.throughput = step.throughput.mul(.{
                .x = exponential.expNegative(Rays, sigma_t.x.mul(way)),
                .y = exponential.expNegative(Rays, sigma_t.y.mul(way)),
                .z = exponential.expNegative(Rays, sigma_t.z.mul(way)),
            });
        }

        /// Goes straight on behind what is hit.
        fn pass(step: *Self, lanes: Mask) void {
            const point = &step.vertex.point;
            const closest = step.path.bundle.groups[step.group].closest;
            const ts = closest.t.toArray();
            const primitives = closest.primitive.toArray();
            const throughputs: Stored = .of(step.throughput);
            const hidden = point.hidden.bits();
            var bits = lanes.bits();
            while (bits != 0) : (bits &= bits - 1) {
                const lane = @ctz(bits);
                const record = &step.records[step.numbers[lane]];
                record.start_t = ts[lane];
                record.start_primitive = primitives[lane];
                record.throughput = throughputs.at(lane);
                record.transparency_depth += 1;
                if (hidden >> @intCast(lane) & 1 != 0) record.nesting = point.beyond[lane];
                step.goOn(lane);
            }
        }

        fn goOn(step: *Self, lane: usize) void {
            step.next[step.next_count] = step.numbers[lane];
            step.next_count += 1;
        }

        fn add(step: *const Self, lanes: Mask, radiance: Vec3) void {
            records_file.addVectors(Rays, step.records, &step.numbers, "radiance", lanes, radiance);
        }

        /// Adds what is around the scene, for rays that leave it.
        fn addSurroundings(step: *Self, gone: Mask) void {
            const around = step.frame.environment;
            const first = gone.bitAnd(step.depth.eq(.zero()));
            const later = gone.andNot(first);
            if (later.any()) step.add(later, step.throughput.mul(step.seen(around, later)));
            if (first.none()) return;
            const environment = around.backdrop orelse around;
            const floor = floats(Rays, step.records, &step.numbers, "floor_light");
            const throughput = step.throughput.scale(floor);
            if (environment.is_seen)
                return step.add(first, throughput.mul(step.seen(environment, first)));
            const shares = throughput.x.toArray();
            var bits = first.bits();
            while (bits != 0) : (bits &= bits - 1) {
                const lane = @ctz(bits);
                step.records[step.numbers[lane]].escaped += shares[lane];
            }
            if (step.is_transparent) return;
            step.add(first, throughput.mul(.splat(environment.background)));
        }

        fn seen(step: *const Self, environment: *const world_file.Environment, asked: Mask) Vec3 {
            const path = &step.path;
            const direction = path.bundle.groups[step.group].line.direction;
            const has_cones = environment.map != null;
            // What is scattered is looked up as finely as light is chosen.
            const width: F32 = if (has_cones)
                .select(step.depth.eq(.zero()), path.cone_spread[step.group].abs(), .zero())
            else
                .zero();
            const zero: F32 = .zero();
            return environment_file.radiance(Rays, environment, direction, zero, width, asked);
        }

        /// Adds what surfaces show by themselves: their colour where they are unlit, else what they
        /// emit.
        fn addGlow(step: *Self, lanes: Mask) void {
            const material = &step.vertex.point.material;
            const bsdf = &step.vertex.bsdf;
            var glow = material.emissive;
            if (bsdf.layered) glow = glow.scale(bsdf.coating.below_coat);
            const shown: Vec3 = .select(material.unlit, material.base_color, glow);
            const arriving = step.throughput.mul(shown);
            const displayed = lanes.bitAnd(material.unlit).bitAnd(step.depth.eq(.zero()));
            if (!step.keeps_display or displayed.none()) return step.add(lanes, arriving);
            step.add(lanes.andNot(displayed), arriving);
            const numbers = &step.numbers;
            records_file
                .addVectors(Rays, step.records, numbers, "displayed", displayed, arriving);
            const shares = step.throughput.x.toArray();
            var bits = displayed.bits();
            while (bits != 0) : (bits &= bits - 1) {
                const lane = @ctz(bits);
                step.records[numbers[lane]].display_share += shares[lane];
            }
        }

        /// Next event estimation: takes a shadow ray to a light that is chosen by chance.
        fn addLight(step: *Self, lanes: Mask) void {
            const lights = step.frame.lights;
            if (lights.len == 0) return;
            const count: F32 = .splat(@floatFromInt(lights.len));
            const last: I32 = .splat(@intCast(lights.len - 1));
            const chosen = step.number(.light).mul(count).toI32().min(last);
            const all: Unique(Rays) = .of(chosen, lanes);
            const point = &step.vertex.point;
            for (all.numbers[0..all.count], all.lanes[0..all.count]) |which, asked| {
                const light = &lights[which];
                if (light.kind == .emitter) continue;
                const arrival = light_file.arrive(Rays, light, point);
                const value = step.eval(arrival.to_light);
                const worth = step.throughput.mul(value).mul(arrival.irradiance).scale(count);
                const lit = lanes.bitAnd(asked)
                    .bitAnd(worth.x.max(worth.y).max(worth.z).gt(.zero()));
                if (lit.none()) continue;
                const behind = point.normal_geometric.dot(arrival.to_light).lt(.zero());
                const normal = point.normal_geometric;
                const origin =
                    point.offsetOrigin(.select(behind, normal.neg(), normal), .zero());
                const is_far = light.kind == .directional;
                const way = Vec3.splat(light.position).sub(origin);
                step.shadows.take(&.{
                    .lanes = lit,
                    .origin = origin,
                    .direction = if (is_far) arrival.to_light else way,
                    .end = .splat(if (is_far) std.math.inf(f32) else 1),
                    .skip = step.path.bundle.groups[step.group].closest.primitive,
                    .cone_width = if (step.frame.needsFootprints()) point.cone_width else .zero(),
                    .straight = .splat(true),
                    .light = worth,
                }, &step.numbers);
                step.countShadows(lit);
            }
        }

        fn countShadows(step: *Self, lanes: Mask) void {
            var bits = lanes.bits();
            const depths = step.depth.toArray();
            while (bits != 0) : (bits &= bits - 1)
                step.rays.count(@intCast(depths[@ctz(bits)]), .{ .shadow = 1 });
        }

        fn eval(step: *const Self, to_light: Vec3) Vec3 {
            const point = &step.vertex.point;
            const bsdf = &step.vertex.bsdf;
            const zero: F32 = .zero();
            const front = point.normal.dot(to_light).gt(zero)
                .bitAnd(point.normal_geometric.dot(to_light).gt(zero));
            var value: Vec3 = .select(front, bsdf.eval(point, to_light), none);
            if (!bsdf.sees_behind) return value;
            const passing: Vec3 =
                .select(point.material.volume, none, bsdf.mirror.transmitted);
            const albedo = bsdf.back_albedo.add(passing);
            const behind = bsdf_file.behind(Rays, point, to_light, albedo);
            if (behind.none()) return value;
            value = .select(behind, bsdf.evalBehind(point, to_light, passing), value);
            return value;
        }

        const Sampled = struct { to_light: Vec3, weight: Vec3, pdf: F32, crosses: Mask };

        /// A direction that light comes from, by the lobes.
        fn sample(step: *const Self) Sampled {
            const point = &step.vertex.point;
            const bsdf = &step.vertex.bsdf;
            const one: F32 = .splat(1);
            const zero: F32 = .zero();
            const ones: Vec3 = .splat(.{ 1, 1, 1 });
            const thick = point.material.volume;
            const through = F32
                .select(thick, bsdf.mirror.transmitted.dot(ones), .zero());
            const others = bsdf.specular_albedo.add(bsdf.diffuse_albedo).dot(ones);
            const share = through.div(through.add(others).max(.splat(1e-12)));
            const lobe = step.number(.lobe);
            const refracted = lobe.lt(share);
            const rest = lobe.sub(share).div(one.sub(share).max(.splat(1e-6))).max(zero)
                .min(.splat(1 - 0x1p-24));
            const scattered = bsdf
                .sample(point, .{ rest, step.number(.lobe_x), step.number(.lobe_y) });
            const pdf = bsdf.pdf(point, scattered).mul(one.sub(share));
            const weight = step.eval(scattered).scale(one.div(pdf.max(.splat(1e-20))));
            const bent = bsdf.mirror.transmitted.scale(one.div(share.max(.splat(1e-12))));
            const to_light: Vec3 = .select(refracted, bsdf.mirror.refraction, scattered);
            return .{
                .to_light = to_light,
                .weight = .select(refracted, bent, weight),
                .pdf = .select(refracted, zero, pdf),
                .crosses = point.normal_geometric.dot(to_light).lt(zero),
            };
        }

        /// Sends the paths on by what surfaces scatter.
        fn scatter(step: *Self, lanes: Mask) void {
            const sampled = step.sample();
            var throughput = step.throughput.mul(sampled.weight);
            const largest = throughput.x.max(throughput.y).max(throughput.z);
            var going = lanes.bitAnd(largest.gt(.zero()))
                .bitAnd(largest.lt(.splat(std.math.inf(f32))));
            const chance = largest.min(.splat(1));
            const asked = going.bitAnd(step.depth.gt(.splat(roulette_depth - 1)));
            if (asked.any()) {
                going = going.andNot(asked.andNot(step.number(.roulette).lt(chance)));
                const factor = F32.select(asked, F32.splat(1).div(chance), .splat(1));
                throughput = throughput.scale(factor);
            }
            if (going.any()) step.leave(going, &sampled, throughput);
        }

        fn leave(step: *Self, lanes: Mask, sampled: *const Sampled, throughput: Vec3) void {
            const point = &step.vertex.point;
            const normal = point.normal_geometric;
            const away: Vec3 = .select(sampled.crosses, normal.neg(), normal);
            const origins: Stored = .of(point.offsetOrigin(away, .zero()));
            const directions: Stored = .of(sampled.to_light);
            const throughputs: Stored = .of(throughput);
            const pdfs = sampled.pdf.toArray();
            const primitives = step.path.bundle.groups[step.group].closest.primitive.toArray();
            var widths: [Rays.count]f32 = @splat(0);
            var spreads: [Rays.count]f32 = @splat(0);
            if (step.frame.needsFootprints()) {
                widths = point.cone_width.toArray();
                spreads = step.spread(sampled).toArray();
            }
            const has_volumes = step.frame.materials.volumes.len > 0;
            const entering = if (has_volumes)
                sampled.crosses.bitAnd(point.material.volume).bits()
            else
                0;
            const sigma: Stored = if (entering != 0) .of(point.sigma_beyond) else undefined;
            var bits = lanes.bits();
            while (bits != 0) : (bits &= bits - 1) {
                const lane = @ctz(bits);
                const record = &step.records[step.numbers[lane]];
                record.origin = origins.at(lane);
                record.direction = directions.at(lane);
                record.start_t = 0;
                record.start_primitive = std.math.maxInt(i32);
                record.skip = primitives[lane];
                record.throughput = throughputs.at(lane);
                record.scatter_pdf = pdfs[lane];
                record.cone_width = widths[lane];
                record.cone_spread = spreads[lane];
                record.depth += 1;
                record.transparency_depth = 0;
                if (entering >> @intCast(lane) & 1 != 0) {
                    record.sigma_t = sigma.at(lane);
                    record.nesting = point.beyond[lane];
                }
                step.rays.count(record.depth, .{ .closest = 1 });
                step.goOn(lane);
            }
        }

        /// Of the cones of rays that go on: as the surface bends them, and at least a part of the
        /// lobe.
        fn spread(step: *const Self, sampled: *const Sampled) F32 {
            const point = &step.vertex.point;
            const before = step.path.cone_spread[step.group];
            const width = point.cone_width;
            var result = ray_cone.reflected(Rays, before, width, point.curvature);
            if (sampled.crosses.any()) {
                const bent = ray_cone.refracted(Rays, before, width, point.curvature, point.eta);
                const thick = sampled.crosses.bitAnd(point.material.volume);
                result = .select(sampled.crosses, before, result);
                result = .select(thick, bent, result);
            }
            const density = sampled.pdf.max(.splat(1e-4));
            const lobe = F32.splat(cone_per_lobe).div(density.sqrt());
            const scattered = sampled.pdf.gt(.zero());
            const wide = result.abs().max(lobe).copySign(result);
            return .select(scattered, wide, result);
        }

        fn seed(step: *Self) void {
            for (&step.seeds, step.numbers) |*value, which| {
                const record = &step.records[which];
                const place = Record.placeOf(which);
                var hash: u32 = step.first_sample + place[0];
                const depths = record.depth << 16 | record.transparency_depth;
                const x = step.rectangle.x0 + place[1];
                const y = step.rectangle.y0 + place[2];
                for ([_]u32{ x, y, depths }) |part| hash = mixed(hash ^ part *% 0x9e3779b9);
                value.* = hash;
            }
        }

        /// Numbers in 0..1, 1 exclusive.
        fn number(step: *const Self, purpose: Purpose) F32 {
            var values: [Rays.count]f32 = undefined;
            const salt = @backingInt(purpose) *% 0x85ebca6b +% 1;
            for (&values, step.seeds) |*value, one| {
                const bits = mixed(one ^ salt) >> 8;
                value.* = @as(f32, @floatFromInt(bits)) * 0x1p-24;
            }
            return .fromArray(values);
        }

        /// Hash of 32 bits.
        fn mixed(value: u32) u32 {
            var x = value;
            x ^= x >> 16;
            x *%= 0x7feb352d;
            x ^= x >> 15;
            x *%= 0x846ca68b;
            return x ^ x >> 16;
        }
    };
}
