//! Paths in lanes through volumes that scatter light: where they are scattered, and how they go on.
//!
//! In: rays inside such volumes, up to what they hit. Out: shadow rays and rays that go on from
//! points on the way; of the others, what is left at the end. The distance is chosen by the
//! extinction of one channel, which what the path is worth there decides; all channels weigh it by
//! the mean of their densities (the balance heuristic of Veach and Guibas 1995, as Wilkie,
//! Nawaz, Droske, Weidlich and Hanika 2014, "Hero Wavelength Spectral Sampling", have it).
//! Directions are those of the phase function (`phase.zig`), whose value is their density.

const std = @import("std");
const ray_file = @import("../traverse/ray.zig");
const exponential = @import("../shade/exponential.zig");
const light_sampling = @import("../shade/light_sampling.zig");
const phase = @import("../shade/phase.zig");
const path_bounce = @import("path_bounce.zig");
const path_features = @import("path_features.zig");
const path_light = @import("path_light.zig");
const records_file = @import("path_records.zig");
const PathStep = @import("path_step.zig").PathStep;

/// Scatterings of a path at most: dense white volumes take many, which end by chance.
const scatter_count_max = 1024;

/// Scatterings after which paths that are worth little may end.
const roulette_count = 8;

/// Volumes that scatter, in lanes.
fn Medium(comptime Lanes: type) type {
    return struct {
        lanes: Lanes.Mask,
        sigma_s: Lanes.Vec3,
        anisotropy: Lanes.F32,

        /// Those that rays of the group are in, of the lanes asked for.
        fn of(step: anytype, asked: Lanes.Mask) @This() {
            const volumes = step.frame.materials.volumes;
            var sigma_s: [3][Lanes.count]f32 = @splat(@splat(0));
            var anisotropy: [Lanes.count]f32 = @splat(0);
            var found: u32 = 0;
            var bits = asked.bits();
            while (bits != 0) : (bits &= bits - 1) {
                const lane = @ctz(bits);
                const rank = step.path.nestings[step.group][lane].top();
                if (rank >= volumes.len or !volumes[rank].scatters()) continue;
                found |= @as(u32, 1) << @intCast(lane);
                anisotropy[lane] = volumes[rank].scatter_anisotropy;
                for (&sigma_s, volumes[rank].sigma_s) |*to, channel| to[lane] = channel;
            }
            return .{
                .lanes = .fromBits(found),
                .sigma_s = .{
                    .x = .fromArray(sigma_s[0]),
                    .y = .fromArray(sigma_s[1]),
                    .z = .fromArray(sigma_s[2]),
                },
                .anisotropy = .fromArray(anisotropy),
            };
        }
    };
}

/// Takes the step of paths that are scattered before they hit something, and weighs those of the
/// others that are in volumes which scatter. Returns the former.
pub noinline fn scatter(
    comptime Kernel: type,
    step: *PathStep(Kernel),
    hit: Kernel.Rays.Mask,
) Kernel.Rays.Mask {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const Vec3 = Rays.Vec3;
    const medium: Medium(Rays) = .of(step, hit);
    if (medium.lanes.none()) return medium.lanes;
    const one: F32 = .splat(1);
    const ray = &step.path.bundle.groups[step.group];
    const length = ray.line.direction.length();
    const start = ray.tnear.t.mul(length);
    const way = ray.closest.t.mul(length).sub(start);
    const sigma_t = step.path.sigma_t[step.group];
    const numbers = step.chances.at(.medium);
    const odds = oddsOf(Rays, step.throughput, medium.sigma_s, sigma_t);
    const after_red = numbers[0].sub(odds.x);
    const sigma = F32.select(
        after_red.lt(.zero()),
        sigma_t.x,
        .select(after_red.lt(odds.y), sigma_t.y, sigma_t.z),
    );
    const depth = exponential.log(Rays, one.sub(numbers[1])).neg();
    const distance = depth.div(sigma.max(.splat(1e-30)));
    const scattered = medium.lanes.bitAnd(distance.lt(way));
    const reached = F32.select(scattered, distance, way.max(.zero()));
    const left = exponential.transmittance(Rays, sigma_t, reached);
    const ones: Vec3 = .splat(.{ 1, 1, 1 });
    const densities = left.mul(.select(scattered, sigma_t, ones));
    const pdf = densities.dot(odds).max(.splat(std.math.floatMin(f32)));
    const gained = left.mul(.select(scattered, medium.sigma_s, ones)).scale(one.div(pdf));
    const throughput = step.throughput.mul(gained);
    step.throughput = .select(medium.lanes, throughput, step.throughput);
    const kept: Vec3 = .select(medium.lanes, .splat(.{ 0, 0, 0 }), sigma_t);
    step.path.sigma_t[step.group] = kept;
    if (scattered.none()) return scattered;
    if (step.keeps_features) path_features.scatter(Kernel, step, scattered);
    const direction = ray.line.direction.scale(one.div(length));
    const position = ray.line.origin.add(direction.scale(start.add(reached)));
    if (step.frame.light_sampler != null)
        path_light.addScattered(Kernel, step, scattered, position, direction, medium.anisotropy);
    goOn(Kernel, step, scattered, position, direction, medium.anisotropy);
    return scattered;
}

/// Probabilities of the channels: by what each is worth after one more scattering.
fn oddsOf(
    comptime Lanes: type,
    throughput: Lanes.Vec3,
    sigma_s: Lanes.Vec3,
    sigma_t: Lanes.Vec3,
) Lanes.Vec3 {
    const F32 = Lanes.F32;
    const least: F32 = .splat(1e-30);
    const worth: Lanes.Vec3 = .{
        .x = throughput.x.mul(sigma_s.x).div(sigma_t.x.max(least)),
        .y = throughput.y.mul(sigma_s.y).div(sigma_t.y.max(least)),
        .z = throughput.z.mul(sigma_s.z).div(sigma_t.z.max(least)),
    };
    const sum = worth.x.add(worth.y).add(worth.z);
    // None is rare: what is seen through the volume counts as well.
    const floor = sum.mul(.splat(0.1));
    const is_some = sum.gt(.splat(1e-20));
    const scale = F32.splat(1.0 / 1.3).div(F32.select(is_some, sum, .splat(1)));
    const third: F32 = .splat(1.0 / 3.0);
    return .{
        .x = .select(is_some, worth.x.add(floor).mul(scale), third),
        .y = .select(is_some, worth.y.add(floor).mul(scale), third),
        .z = .select(is_some, worth.z.add(floor).mul(scale), third),
    };
}

fn goOn(
    comptime Kernel: type,
    step: *PathStep(Kernel),
    lanes: Kernel.Rays.Mask,
    position: Kernel.Rays.Vec3,
    along: Kernel.Rays.Vec3,
    anisotropy: Kernel.Rays.F32,
) void {
    const Rays = Kernel.Rays;
    const Stored = records_file.Stored(Rays);
    const numbers = step.chances.at(.lobe_direction);
    const to_light = phase.sample(Rays, along, anisotropy, numbers);
    const pdf = phase.eval(Rays, along.dot(to_light), anisotropy);
    const count =
        records_file.integers(Rays, step.records, &step.numbers, "scatter_count");
    var throughput = step.throughput;
    var going = lanes.bitAnd(count.lt(.splat(scatter_count_max)))
        .bitAnd(path_light.carriesLight(Rays, throughput));
    const asked = count.gt(.splat(roulette_count));
    going = path_bounce.survive(Kernel, step, going, asked, &throughput);
    const positions: Stored = .of(position);
    const directions: Stored = .of(to_light);
    const throughputs: Stored = .of(throughput);
    const pdfs = pdf.toArray();
    var bits = going.bits();
    while (bits != 0) : (bits &= bits - 1) {
        const lane = @ctz(bits);
        const record = &step.records[step.numbers[lane]];
        record.origin = positions.at(lane);
        record.direction = directions.at(lane);
        record.start_t = 0;
        record.start_primitive = std.math.maxInt(i32);
        record.skip = ray_file.no_primitive;
        record.throughput = throughputs.at(lane);
        record.scatter_pdf = pdfs[lane];
        record.receiver = positions.at(lane);
        record.receiver_normal = .{ 0, 0, 0 };
        record.scatter_count += 1;
        record.transparency_depth = 0;
        step.rays.count(record.depth + record.scatter_count, .{ .closest = 1 });
        step.goOn(lane);
    }
}
