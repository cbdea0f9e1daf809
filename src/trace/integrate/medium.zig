//! Light that is scattered once in volumes, on the way of paths through them.
//!
//! In: rays inside volumes that scatter, up to where they leave them. Out: the light of the scene's
//! lights and of the sample's part of the environment that a point on the way scatters towards the
//! eye, added to the radiance of the sample: absorption, phase function (Henyey and Greenstein) and
//! shadow rays, which go straight on through boundaries. The point is chosen by the transmittance
//! of the channel that is weakened least, another for each light in each sample of each pixel.
//!
//! Light scattered more than once is not traced, so that dense volumes would get too dark. As
//! Wrenninge, Kulla and Lundqvist 2013 ("Oz: The Great and Volumetric") have it, octaves with half
//! the extinction and anisotropy each stand for it; but an octave has only what the one before
//! lost, times the albedo, so that no medium sends on more light than it gets.

const std = @import("std");
const world_file = @import("../../world.zig");
const bundle_file = @import("../traverse/bundle.zig");
const ray_file = @import("../traverse/ray.zig");
const environment_file = @import("../shade/environment.zig");
const exponential = @import("../shade/exponential.zig");
const interaction_file = @import("../shade/interaction.zig");
const light_file = @import("../shade/light.zig");
const phase = @import("../shade/phase.zig");
const camera = @import("camera.zig");
const numbers_file = @import("numbers.zig");
const path_file = @import("path.zig");
const visibility_file = @import("visibility.zig");
const EnvironmentLights = @import("environment_lights.zig").EnvironmentLights;
const Frame = world_file.Frame;
const Light = world_file.Light;
const Rectangle = @import("../../film.zig").Rectangle;

/// Octaves of light that is scattered more than once.
const octave_count = 4;

/// Least optical depth of a way: what is thinner is sampled evenly all the same.
const depth_least = 0.01;

/// How far the numbers of points for one light and the next are apart: the golden section.
const golden = 0.6180339887498949;

/// Which sample of which pixels a path is of.
pub const Place = struct { rectangle: Rectangle, sample: u32 };

/// Points in volumes, one a ray.
pub fn Medium(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const Vec3 = Rays.Vec3;
    const group_count = Kernel.group_count;
    const Visibility = visibility_file.Visibility(Kernel);
    const PathState = path_file.PathState(Kernel);
    return struct {
        points: [group_count]Point,

        const Self = @This();

        const Point = struct {
            /// Lanes that have one.
            lit: Rays.Mask,
            /// The way through the volume: where it starts along the ray, its length, the density
            /// of points on it but for its scale, and what of that density the way leaves out.
            start: F32,
            way: F32,
            density: F32,
            lost: F32,
            /// Chooses the first point.
            number: F32,
            /// Scattering coefficient.
            sigma_s: Vec3,
            /// Only its place and cone.
            point: interaction_file.Interaction(Rays),
            /// Of the ray, of unit length.
            direction: Vec3,
            /// Share of light scattered per steradian that reaches the eye.
            worth: Vec3,
            /// What is scattered of what is lost.
            albedo: Vec3,
            anisotropy: F32,
            /// Light scattered towards the eye.
            sum: Vec3,
        };

        /// Adds what the volumes scatter that the rays of a path go through before they hit
        /// something. Returns how many shadow rays it took.
        pub fn addLight(
            medium: *Self,
            visibility: *Visibility,
            lights: *const EnvironmentLights,
            path: *const PathState,
            place: Place,
            radiance: *[group_count]Vec3,
        ) u64 {
            const frame = visibility.frame;
            var any_lit = false;
            for (&medium.points, 0..) |*point, group| {
                find(point, frame, path, group, place);
                any_lit = any_lit or point.lit.any();
            }
            if (!any_lit) return 0;
            var ray_count: u64 = 0;
            var count: u32 = 0;
            for (lights.ofSample(place.sample)) |part| for (part) |*light| {
                var energy: [3]f32 = undefined;
                const scale = std.math.pi * light.weight;
                for (&energy, light.irradiance) |*to, channel| to.* = channel * scale;
                count += 1;
                medium.choose(path, count);
                ray_count += medium.addSource(visibility, &light.source, energy);
            };
            for (frame.lights) |*light| {
                count += 1;
                medium.choose(path, count);
                ray_count += medium.addSource(visibility, light, null);
            }
            for (&medium.points, radiance) |*point, *sum| {
                if (point.lit.none()) continue;
                sum.* = sum.add(.select(point.lit, point.sum, .splat(.{ 0, 0, 0 })));
            }
            return ray_count;
        }

        /// Chooses other points.
        fn choose(medium: *Self, path: *const PathState, count: u32) void {
            for (&medium.points, 0..) |*point, group| {
                if (point.lit.any()) chooseOne(point, path, group, count);
            }
        }

        fn chooseOne(point: *Point, path: *const PathState, group: usize, count: u32) void {
            const one: F32 = .splat(1);
            const steps = golden * @as(f64, @floatFromInt(count));
            const sum = point.number.add(.splat(@floatCast(steps - @floor(steps))));
            const number = sum.sub(sum.toI32().toF32());
            const left = one.sub(number.mul(point.lost));
            const distance = exponential.log(Rays, left).neg().div(point.density);
            const at = point.start.add(distance.min(point.way));
            const origin = path.bundle.groups[group].line.origin;
            point.point.position = origin.add(point.direction.scale(at));
            const pdf_inverse = point.lost.div(point.density.mul(left));
            point.worth = path.throughputAt(group, at).mul(point.sigma_s).scale(pdf_inverse);
        }

        fn find(
            point: *Point,
            frame: *const Frame,
            path: *const PathState,
            group: usize,
            place: Place,
        ) void {
            const ray = &path.bundle.groups[group];
            const hit = ray.active
                .andNot(ray.closest.primitive.eq(.splat(ray_file.no_primitive)));
            point.lit = .splat(false);
            if (hit.none()) return;
            point.sigma_s = scattering(point, frame, path, group, hit);
            if (point.lit.none()) return;
            const sigma_t = path.sigma_t[group];
            const length = ray.line.direction.length();
            const start = ray.tnear.t.mul(length);
            const way = ray.closest.t.mul(length).sub(start);
            // Thinner than what can be told from nothing: no light.
            point.lit = point.lit.bitAnd(way.gt(.zero()));
            const thinnest = sigma_t.x.min(sigma_t.y).min(sigma_t.z);
            const density = thinnest.max(F32.splat(depth_least).div(way));
            const pixels = camera.pixels(Kernel, place.rectangle, group);
            const dimension = path_file.depth_limit + 1 + path.depth;
            point.number = numbers_file.at(Rays, pixels, place.sample, dimension)[0];
            point.start = start;
            point.way = way;
            point.density = density;
            point.lost = F32.splat(1)
                .sub(exponential.expNegative(Rays, density.mul(way).neg()));
            point.direction = ray.line.direction.scale(F32.splat(1).div(length));
            point.point.cone_width = .zero();
            const tiny: Vec3 = .splat(@splat(std.math.floatMin(f32)));
            point.albedo = .{
                .x = point.sigma_s.x.div(sigma_t.x.max(tiny.x)),
                .y = point.sigma_s.y.div(sigma_t.y.max(tiny.y)),
                .z = point.sigma_s.z.div(sigma_t.z.max(tiny.z)),
            };
            chooseOne(point, path, group, 0);
            point.sum = aroundOf(frame, point).mul(point.worth);
        }

        /// Scattering coefficients of what rays are in, and which of them are in something that
        /// has any.
        fn scattering(
            point: *Point,
            frame: *const Frame,
            path: *const PathState,
            group: usize,
            asked: Rays.Mask,
        ) Vec3 {
            const volumes = frame.materials.volumes;
            var coefficients: [3][Kernel.ray_count]f32 = @splat(@splat(0));
            var anisotropy: [Kernel.ray_count]f32 = @splat(0);
            var found: u32 = 0;
            var bits = asked.bits();
            while (bits != 0) : (bits &= bits - 1) {
                const lane = @ctz(bits);
                const rank = path.nestings[group][lane].top();
                if (rank >= volumes.len or !volumes[rank].scatters()) continue;
                found |= @as(u32, 1) << @intCast(lane);
                anisotropy[lane] = volumes[rank].scatter_anisotropy;
                for (&coefficients, volumes[rank].sigma_s) |*to, channel| to[lane] = channel;
            }
            point.lit = .fromBits(found);
            point.anisotropy = .fromArray(anisotropy);
            return .{
                .x = .fromArray(coefficients[0]),
                .y = .fromArray(coefficients[1]),
                .z = .fromArray(coefficients[2]),
            };
        }

        /// Light that comes from everywhere: the environment's, where no lights stand for it, as if
        /// nothing were in its way.
        fn aroundOf(frame: *const Frame, point: *const Point) Vec3 {
            const environment = frame.environment;
            const ambient: Vec3 = .splat(@splat(environment.ambient));
            if (environment.map == null or environment.shadow_count > 0) return ambient;
            const along = environment_file
                .irradiance(Rays, environment, point.direction, point.lit);
            const against = environment_file
                .irradiance(Rays, environment, point.direction.neg(), point.lit);
            return along.add(against).scale(.splat(0.5));
        }

        /// Adds the light of a source: `energy` is its irradiance across its way, null for what a
        /// light of the scene has.
        fn addSource(
            medium: *Self,
            visibility: *Visibility,
            light: *const Light,
            energy: ?[3]f32,
        ) u64 {
            var bundle: bundle_file.Bundle(Kernel) = undefined;
            var arrivals: [group_count]light_file.Arrival(Rays) = undefined;
            var active: [group_count]Rays.Mask = undefined;
            var ray_count: u64 = 0;
            const points = &medium.points;
            for (&bundle.groups, &arrivals, &active, points) |*ray, *arrival, *lit, *point| {
                lit.* = .splat(false);
                ray.active = lit.*;
                if (point.lit.none()) continue;
                arrival.* = light_file.arrive(Rays, light, &point.point);
                if (energy) |irradiance| arrival.irradiance = .splat(irradiance);
                const shining = arrival.irradiance;
                lit.* = point.lit.bitAnd(shining.x.max(shining.y).max(shining.z).gt(.zero()));
                const none: Rays.I32 = .splat(ray_file.no_primitive);
                ray.* = visibility_file.shadowRay(Rays, light, point.point.position, none, lit.*);
                ray_count += lit.popCount();
            }
            if (ray_count == 0) return 0;
            var shares: [group_count]Vec3 = undefined;
            visibility.transmittance(&bundle, light, points, .none, &shares);
            for (&arrivals, active, points, shares, 0..) |*arrival, lit, *point, share, group| {
                if (lit.none()) continue;
                const passage = &visibility.passages[group];
                const way = bundle.groups[group].line.direction;
                const through: Vec3 = if (passage.is_started)
                    passage.left(@splat(visibility_file.shadowEnd(light)), way)
                else
                    .splat(.{ 1, 1, 1 });
                const scattered = octaves(Rays, point, arrival.to_light, share, through);
                const seen = scattered.mul(arrival.irradiance).mul(point.worth);
                point.sum = point.sum.add(.select(lit, seen, .splat(.{ 0, 0, 0 })));
            }
            return ray_count;
        }
    };
}

/// Light scattered to the eye per steradian, of a light of which `share` arrives by itself;
/// `through` is what volumes leave of that.
fn octaves(
    comptime Lanes: type,
    point: anytype,
    to_light: Lanes.Vec3,
    share: Lanes.Vec3,
    through: Lanes.Vec3,
) Lanes.Vec3 {
    const cosine = to_light.dot(point.direction);
    var anisotropy = point.anisotropy;
    var sum = share.scale(phase.eval(Lanes, cosine, anisotropy));
    var weight = surfaces(Lanes, share, through);
    var before = through;
    for (0..octave_count) |_| {
        const next: Lanes.Vec3 = .{
            .x = before.x.sqrt(),
            .y = before.y.sqrt(),
            .z = before.z.sqrt(),
        };
        anisotropy = anisotropy.mul(.splat(0.5));
        weight = weight.mul(point.albedo);
        const gained = weight.mul(next.sub(before));
        sum = sum.add(gained.scale(phase.eval(Lanes, cosine, anisotropy)));
        before = next;
    }
    return sum;
}

/// What surfaces leave; nothing where that cannot be told.
fn surfaces(comptime Lanes: type, share: Lanes.Vec3, through: Lanes.Vec3) Lanes.Vec3 {
    return .{
        .x = quotient(Lanes, share.x, through.x),
        .y = quotient(Lanes, share.y, through.y),
        .z = quotient(Lanes, share.z, through.z),
    };
}

inline fn quotient(comptime Lanes: type, share: Lanes.F32, through: Lanes.F32) Lanes.F32 {
    const F32 = Lanes.F32;
    const known = through.gt(.splat(1e-30));
    const exact = share.div(F32.select(known, through, .splat(1)));
    return F32.select(known, exact, .zero()).min(.splat(1));
}
