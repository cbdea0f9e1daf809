//! Where paths in lanes go on from surfaces: straight on, a direction of the BSDF, or an end by
//! chance.
//!
//! In: vertices. Out: records of paths with their next rays. What a path is worth decides by chance
//! whether it goes on (Russian roulette, Arvo and Kirk 1990).

const std = @import("std");
const ray_cone = @import("../shade/ray_cone.zig");
const scatter_file = @import("../shade/scatter.zig");
const path_features = @import("path_features.zig");
const path_light = @import("path_light.zig");
const records_file = @import("path_records.zig");
const visibility_file = @import("visibility.zig");
const Frame = @import("../../world.zig").Frame;
const PathStep = @import("path_step.zig").PathStep;

/// Bounces after which paths that are worth little may end.
const roulette_depth = 3;

/// How wide the cone of a scattered ray is, over the square root of the solid angle that its
/// density stands for: what such a ray sees is blurred by the lobe anyway.
const cone_per_lobe = 0.05;

/// Sends paths straight on behind what they hit.
pub fn pass(comptime Kernel: type, step: *PathStep(Kernel), lanes: Kernel.Rays.Mask) void {
    const point = &step.vertex.point;
    const closest = step.path.bundle.groups[step.group].closest;
    const ts = closest.t.toArray();
    const primitives = closest.primitive.toArray();
    const throughputs: records_file.Stored(Kernel.Rays) = .of(step.throughput);
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

/// Sends paths on by what surfaces scatter.
pub noinline fn bounce(
    comptime Kernel: type,
    step: *PathStep(Kernel),
    lanes: Kernel.Rays.Mask,
) void {
    const lobe = step.chances.at(.lobe);
    const direction = step.chances.at(.lobe_direction);
    const sampled =
        step.scattering.sample(.{ lobe[0], direction[0], direction[1], lobe[1] });
    var throughput = step.throughput.mul(sampled.weight);
    var going = lanes.andNot(sampled.is_end)
        .bitAnd(path_light.carriesLight(Kernel.Rays, throughput));
    const asked = step.depth.gt(.splat(roulette_depth - 1));
    going = survive(Kernel, step, going, asked, &throughput);
    if (step.keeps_features)
        path_features.bounce(Kernel, step, going, sampled.is_delta, sampled.pdf);
    if (going.any()) leave(Kernel, step, going, &sampled, throughput);
}

/// Russian roulette (Arvo and Kirk 1990) in the lanes asked for: paths end by chance that are worth
/// less than 1, and the others make up for them. Returns those that go on.
pub inline fn survive(
    comptime Kernel: type,
    step: *const PathStep(Kernel),
    going: Kernel.Rays.Mask,
    asked: Kernel.Rays.Mask,
    throughput: *Kernel.Rays.Vec3,
) Kernel.Rays.Mask {
    const F32 = Kernel.Rays.F32;
    const largest = throughput.x.max(throughput.y).max(throughput.z);
    const chance = largest.min(.splat(1));
    const risking = going.bitAnd(asked).bitAnd(chance.lt(.splat(1)));
    if (risking.none()) return going;
    throughput.* =
        throughput.scale(.select(risking, F32.splat(1).div(chance), .splat(1)));
    return going.andNot(risking.andNot(step.chances.at(.chance)[0].lt(chance)));
}

fn leave(
    comptime Kernel: type,
    step: *PathStep(Kernel),
    lanes: Kernel.Rays.Mask,
    sampled: *const scatter_file.Sample(Kernel.Rays),
    throughput: Kernel.Rays.Vec3,
) void {
    const Rays = Kernel.Rays;
    const Stored = records_file.Stored(Rays);
    const point = &step.vertex.point;
    const normal = point.normal_geometric;
    const away: Rays.Vec3 = .select(sampled.crosses, normal.neg(), normal);
    const origins: Stored = .of(point.offsetOrigin(away, .zero()));
    const directions: Stored = .of(sampled.to_light);
    const throughputs: Stored = .of(throughput);
    const receiver = path_light.receiverAt(Kernel, step);
    const positions: Stored = .of(receiver.position);
    const normals: Stored = .of(receiver.normal);
    const pdfs = sampled.pdf.toArray();
    const primitives = step.path.bundle.groups[step.group].closest.primitive.toArray();
    var widths: [Rays.count]f32 = @splat(0);
    var spreads: [Rays.count]f32 = @splat(0);
    if (step.frame.needsFootprints()) {
        widths = point.cone_width.toArray();
        spreads = spreadOf(Kernel, step, sampled).toArray();
    }
    const has_volumes = step.frame.materials.volumes.len > 0;
    const crossing = sampled.crosses.bitAnd(point.material.volume);
    const entering = if (has_volumes) crossing.bits() else 0;
    const sigma: Stored = if (entering != 0) .of(point.sigma_beyond) else undefined;
    const panes = sampled.is_delta.bitAnd(sampled.crosses).bits();
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
        // Light that is met through panes could have been chosen before them.
        if (panes >> @intCast(lane) & 1 == 0 or !isPane(step.frame, primitives[lane])) {
            record.scatter_pdf = pdfs[lane];
            record.receiver = positions.at(lane);
            record.receiver_normal = normals.at(lane);
        }
        record.cone_width = widths[lane];
        record.cone_spread = spreads[lane];
        record.depth += 1;
        record.transparency_depth = 0;
        if (entering >> @intCast(lane) & 1 != 0) {
            record.sigma_t = sigma.at(lane);
            record.nesting = point.beyond[lane];
        }
        step.rays.count(record.depth + record.scatter_count, .{ .closest = 1 });
        step.goOn(lane);
    }
}

fn isPane(frame: *const Frame, primitive: i32) bool {
    return visibility_file.clarityOf(frame, @intCast(primitive)) == .pane;
}

/// Of the cones of rays that go on: as the surface bends them, and at least a part of the lobe.
fn spreadOf(
    comptime Kernel: type,
    step: *const PathStep(Kernel),
    sampled: *const scatter_file.Sample(Kernel.Rays),
) Kernel.Rays.F32 {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const point = &step.vertex.point;
    const before = step.path.cone_spread[step.group];
    const width = point.cone_width;
    var spread = ray_cone.reflected(Rays, before, width, point.curvature);
    if (sampled.crosses.any()) {
        const thick = sampled.crosses.bitAnd(point.material.volume);
        spread = .select(sampled.crosses, before, spread);
        if (thick.any()) {
            const bent = ray_cone.refracted(Rays, before, width, point.curvature, point.eta);
            spread = .select(thick, bent, spread);
        }
    }
    const lobe = F32.splat(cone_per_lobe).div(sampled.pdf.max(.splat(1e-4)).sqrt());
    const wide = spread.abs().max(lobe).copySign(spread);
    return .select(sampled.pdf.gt(.zero()), wide, spread);
}
