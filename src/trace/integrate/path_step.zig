//! One step of paths in lanes: from what their rays hit to light, shadow rays and rays that go on.
//!
//! In: paths whose rays have been traced. Out: their records for the next step, the radiance of
//! their samples, shadow rays. A path stays one path: whether alpha stops it, which lobe it follows
//! and whether it is worth going on is each decided by a number.
//!
//! Light that is met counts by the power heuristic (Veach and Guibas 1995) where light could have
//! been chosen there as well (`path_light.zig`), else in full. Surfaces have no more depth than the
//! ray that leaves the last of them: it sees light and no surface.

const std = @import("std");
const world_file = @import("../../world.zig");
const ray_file = @import("../traverse/ray.zig");
const exponential = @import("../shade/exponential.zig");
const environment_file = @import("../shade/environment.zig");
const light_sampling = @import("../shade/light_sampling.zig");
const scatter_file = @import("../shade/scatter.zig");
const path_bounce = @import("path_bounce.zig");
const path_features = @import("path_features.zig");
const path_file = @import("path.zig");
const path_light = @import("path_light.zig");
const path_medium = @import("path_medium.zig");
const records_file = @import("path_records.zig");
const shadows_file = @import("path_shadows.zig");
const visibility_file = @import("visibility.zig");
const Frame = world_file.Frame;
const PathNumbers = @import("path_numbers.zig").PathNumbers;
const RayCounts = @import("../../statistics.zig").RayCounts;
const Record = records_file.Record;
const Rectangle = @import("../../film.zig").Rectangle;

/// The step of one group after the other.
pub fn PathStep(comptime Kernel: type) type {
    const F32 = Kernel.Rays.F32;
    const I32 = Kernel.Rays.I32;
    const Vec3 = Kernel.Rays.Vec3;
    const Mask = Kernel.Rays.Mask;
    return struct {
        frame: *const Frame,
        visibility: *visibility_file.Visibility(Kernel),
        records: []Record,
        /// By path; left alone unless the film keeps them.
        features: []path_features.Features,
        keeps_features: bool,
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
        /// Of the group under way.
        vertex: path_file.Vertex(Rays),
        scattering: scatter_file.Scatter(Rays),
        group: usize,
        numbers: [Rays.count]u32,
        chances: PathNumbers(Rays),
        depth: I32,
        /// Bounces and scatterings.
        turns: I32,
        transparency_depth: I32,
        scatter_pdf: F32,
        /// Share of what is at the end of the rays that reaches the pixel.
        throughput: Vec3,

        const Self = @This();
        pub const Rays = Kernel.Rays;
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
            for (&path.nestings[group], numbers) |*to, number| to.* = all[number].nesting;
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
            step.turns = step.depth.add(integers(Rays, all, numbers, "scatter_count"));
            step.transparency_depth = integers(Rays, all, numbers, "transparency_depth");
            step.scatter_pdf = floats(Rays, all, numbers, "scatter_pdf");
            step.throughput = step.path.throughput[group];
            step.findChances();
            var gone = ray.active.bitAnd(ray.closest.primitive.eq(.splat(ray_file.no_primitive)));
            var hit = ray.active.andNot(gone);
            if (hit.any() and step.frame.materials.has_scattering)
                hit = hit.andNot(path_medium.scatter(Kernel, step, hit));
            if (hit.any()) gone = gone.bitOr(step.shadeHits(hit));
            if (gone.any()) step.addSurroundings(gone);
        }

        fn findChances(step: *Self) void {
            var places: [3][Rays.count]i32 = undefined;
            for (step.numbers, 0..) |number, lane| {
                const sample, const x, const y = Record.placeOf(number);
                places[0][lane] = @intCast(step.first_sample + sample);
                places[1][lane] = @intCast(step.rectangle.x0 + x);
                places[2][lane] = @intCast(step.rectangle.y0 + y);
            }
            const x: I32 = .fromArray(places[1]);
            step.chances = .init(x, .fromArray(places[2]), .fromArray(places[0]), step.turns);
        }

        /// Returns the lanes that have gone straight on through as many surfaces as they may.
        fn shadeHits(step: *Self, hit: Mask) Mask {
            const point = &step.vertex.point;
            step.find();
            step.absorb();
            var number: F32 = .zero();
            const open = point.opacity.gt(.zero()).bitAnd(point.opacity.lt(.splat(1)));
            if (open.bitAnd(hit).any()) number = step.chances.atPassage(step.transparency_depth);
            const stopped = hit.bitAnd(number.lt(point.opacity));
            var gone: Mask = .splat(false);
            const passing = hit.andNot(stopped);
            if (passing.any()) {
                const most: I32 = .splat(visibility_file.transparency_depth_max);
                gone = passing.andNot(step.transparency_depth.lt(most));
                step.visibility.cuts.passing += gone.popCount();
                path_bounce.pass(Kernel, step, passing.andNot(gone));
            }
            if (stopped.none()) return gone;
            if (step.keeps_features) path_features.addVertices(Kernel, step, stopped);
            step.addGlow(stopped);
            const scattering = stopped.andNot(point.material.unlit)
                .andNot(step.depth.gt(.splat(@intCast(step.depth_max))));
            if (scattering.none()) return gone;
            const vertex = &step.vertex;
            const layers = &vertex.layers;
            step.scattering.become(point, &vertex.bsdf, layers, scattering, step.throughput);
            if (step.frame.light_sampler != null) path_light.addLight(Kernel, step, scattering);
            path_bounce.bounce(Kernel, step, scattering);
            return gone;
        }

        /// The points that are hit and what is there.
        fn find(step: *Self) void {
            const frame = step.frame;
            const vertex = &step.vertex;
            const point = &vertex.point;
            visibility_file.findInteraction(Rays, frame, &step.path, step.group, point);
            if (frame.materials.volumes.len > 0)
                step.visibility.boundaries[step.group].apply(point);
            // Backs that the eye does not see are there for other light.
            const unseen = point.culled.bitAnd(step.turns.eq(.zero()));
            point.opacity = .select(unseen, .zero(), point.opacity);
            vertex.findBsdf(frame, &step.path, step.group);
        }

        /// Takes away what volumes absorb on the way of the rays (Beer and Lambert).
        fn absorb(step: *Self) void {
            const ray = &step.path.bundle.groups[step.group];
            const sigma_t = step.path.sigma_t[step.group];
            const zero: F32 = .zero();
            if (sigma_t.x.max(sigma_t.y).max(sigma_t.z).le(zero).all()) return;
            const way = ray.closest.t.sub(ray.tnear.t).mul(ray.line.direction.length());
            step.throughput =
                step.throughput.mul(exponential.transmittance(Rays, sigma_t, way));
        }

        /// The path of a lane takes another step.
        pub fn goOn(step: *Self, lane: usize) void {
            step.next[step.next_count] = step.numbers[lane];
            step.next_count += 1;
        }

        fn add(step: *const Self, lanes: Mask, radiance: Vec3) void {
            records_file.addVectors(Rays, step.records, &step.numbers, "radiance", lanes, radiance);
        }

        /// Where light could have been chosen that the rays meet.
        pub fn receiver(step: *const Self) light_sampling.Receiver(Rays) {
            return .{
                .position = vectors(Rays, step.records, &step.numbers, "receiver"),
                .normal = vectors(Rays, step.records, &step.numbers, "receiver_normal"),
            };
        }

        /// Adds what is around the scene, for rays that leave it.
        fn addSurroundings(step: *Self, gone: Mask) void {
            if (step.keeps_features) path_features.addEscaped(Kernel, step, gone);
            const around = step.frame.environment;
            const first = gone.bitAnd(step.turns.eq(.zero()));
            const later = gone.andNot(first);
            if (later.any()) step.add(later, path_light.fromAround(Kernel, step, later));
            if (first.none()) return;
            const environment = around.backdrop orelse around;
            const floor = floats(Rays, step.records, &step.numbers, "floor_light");
            const throughput = step.throughput.scale(floor);
            if (environment.is_seen)
                return step.add(first, throughput.mul(step.seen(environment, first)));
            step.addShares("escaped", first, throughput.x);
            if (step.is_transparent) return;
            step.add(first, throughput.mul(.splat(environment.background)));
        }

        fn seen(step: *const Self, environment: *const world_file.Environment, asked: Mask) Vec3 {
            const path = &step.path;
            const direction = path.bundle.groups[step.group].line.direction;
            const width: F32 = if (environment.map != null)
                path.cone_spread[step.group].abs()
            else
                .zero();
            const zero: F32 = .zero();
            return environment_file.radiance(Rays, environment, direction, zero, width, asked);
        }

        fn addShares(step: *Self, comptime name: []const u8, lanes: Mask, share: F32) void {
            const shares = share.toArray();
            var bits = lanes.bits();
            while (bits != 0) : (bits &= bits - 1) {
                const lane = @ctz(bits);
                @field(step.records[step.numbers[lane]], name) += shares[lane];
            }
        }

        /// Adds what surfaces show by themselves: their colour where they are unlit, else what they
        /// emit.
        fn addGlow(step: *Self, lanes: Mask) void {
            const material = &step.vertex.point.material;
            const glow = path_light.fromSurface(Kernel, step, lanes);
            const shown: Vec3 = .select(material.unlit, material.base_color, glow);
            const arriving = step.throughput.mul(shown);
            const displayed = lanes.bitAnd(material.unlit).bitAnd(step.turns.eq(.zero()));
            if (!step.keeps_display or displayed.none()) return step.add(lanes, arriving);
            step.add(lanes.andNot(displayed), arriving);
            const numbers = &step.numbers;
            records_file
                .addVectors(Rays, step.records, numbers, "displayed", displayed, arriving);
            step.addShares("display_share", displayed, step.throughput.x);
        }
    };
}
