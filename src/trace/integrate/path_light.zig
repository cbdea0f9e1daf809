//! Next event estimation for paths in lanes, and light that their rays meet by themselves, put
//! together by multiple importance sampling.
//!
//! In: vertices of paths, the light list (`light_sampling.zig`). Out: shadow rays with what they
//! would bring; radiance of surfaces and surroundings with its share. Each of the two ways to find
//! light is weighed by the power heuristic (Veach and Guibas 1995). Light that has no size is found
//! by shadow rays alone, and what smooth surfaces show by rays that meet it alone.
//!
//! Shadow rays are stopped by what scatters light, for whatever is found there by chance is lit
//! itself; and by what bends it, since rays that are bent themselves meet the light. Smooth panes
//! they go through, as do the rays. Those to light without a size, which no ray can meet, go as if
//! straight through smooth boundaries of volumes: nothing else would light what is behind glass.

const std = @import("std");
const light_sampling = @import("../shade/light_sampling.zig");
const phase = @import("../shade/phase.zig");
const PathStep = @import("path_step.zig").PathStep;

/// Shadow rays to triangles end this share before them: their neighbours are in the same place.
const end_share = 1 - 0x1p-13;

/// The share of a way to find light with a density of `own`, where another has `other`.
inline fn heuristic(comptime Lanes: type, own: Lanes.F32, other: Lanes.F32) Lanes.F32 {
    const one: Lanes.F32 = .splat(1);
    const ratio = other.div(own.max(.splat(1e-30)));
    return one.div(one.add(ratio.mul(ratio)));
}

/// Lanes in which some light is worth something, and none is beyond all numbers.
pub inline fn carriesLight(comptime Lanes: type, worth: Lanes.Vec3) Lanes.Mask {
    const largest = worth.x.max(worth.y).max(worth.z);
    return largest.gt(.zero()).bitAnd(largest.lt(.splat(std.math.inf(f32))));
}

/// A light for each receiver in lanes.
fn choose(
    comptime Kernel: type,
    step: *const PathStep(Kernel),
    receiver: *const light_sampling.Receiver(Kernel.Rays),
    lanes: Kernel.Rays.Mask,
) light_sampling.Sample(Kernel.Rays) {
    const choice = step.chances.at(.light);
    const place = step.chances.at(.light_point);
    const numbers = [3]Kernel.Rays.F32{ choice[0], place[0], place[1] };
    return light_sampling.sample(Kernel.Rays, step.frame, receiver, numbers, lanes);
}

/// What chosen light counts, where rays that meet it by themselves have a density of `other`.
inline fn shareOf(
    comptime Lanes: type,
    light: *const light_sampling.Sample(Lanes),
    other: Lanes.F32,
) Lanes.F32 {
    const weight = heuristic(Lanes, light.pdf, other);
    return Lanes.F32.select(light.is_delta, .splat(1), weight)
        .div(light.pdf.max(.splat(std.math.floatMin(f32))));
}

/// Where shadow rays end that are as long as the light is far.
inline fn endOf(
    comptime Lanes: type,
    light: *const light_sampling.Sample(Lanes),
) Lanes.F32 {
    const inf: Lanes.F32 = .splat(std.math.inf(f32));
    const has_primitive = light.primitive.gt(.splat(light_sampling.no_primitive));
    const end = Lanes.F32.select(has_primitive, .splat(end_share), .splat(1));
    return .select(light.distance.eq(inf), inf, end);
}

/// Takes shadow rays to a light that is chosen for each vertex. Asserts that the frame has a light
/// list.
pub noinline fn addLight(
    comptime Kernel: type,
    step: *PathStep(Kernel),
    lanes: Kernel.Rays.Mask,
) void {
    const Rays = Kernel.Rays;
    const Vec3 = Rays.Vec3;
    const point = &step.vertex.point;
    const receiver = receiverAt(Kernel, step);
    const light = choose(Kernel, step, &receiver, lanes);
    const there = lanes.bitAnd(light.pdf.gt(.zero()));
    if (there.none()) return;
    const found = step.scattering.eval(light.to_light);
    const value = step.scattering.evalPoint(light.to_light, light.is_delta, found.value);
    const share = shareOf(Rays, &light, found.pdf);
    const worth = step.throughput.mul(value).mul(light.radiance).scale(share);
    const lit = there.bitAnd(carriesLight(Rays, worth));
    if (lit.none()) return;
    const normal = point.normal_geometric;
    const behind = normal.dot(light.to_light).lt(.zero());
    const away: Vec3 = .select(behind, normal.neg(), normal);
    const origin = point.offsetOrigin(away, .zero());
    const is_far = light.distance.eq(.splat(std.math.inf(f32)));
    const target = point.position
        .add(light.to_light.scale(.select(is_far, .splat(1), light.distance)));
    const own = step.path.bundle.groups[step.group].closest.primitive;
    const has_primitive = light.primitive.gt(.splat(light_sampling.no_primitive));
    step.shadows.take(&.{
        .lanes = lit,
        .origin = origin,
        .direction = .select(is_far, light.to_light, target.sub(origin)),
        .end = endOf(Rays, &light),
        .skip = .select(has_primitive, light.primitive, own),
        .cone_width = if (step.frame.needsFootprints()) point.cone_width else .zero(),
        .straight = light.is_delta,
        .light = worth,
    }, &step.numbers);
    countShadows(Kernel, step, lit);
}

fn countShadows(
    comptime Kernel: type,
    step: *const PathStep(Kernel),
    lanes: Kernel.Rays.Mask,
) void {
    const turns = step.turns.toArray();
    var bits = lanes.bits();
    while (bits != 0) : (bits &= bits - 1)
        step.rays.count(@intCast(turns[@ctz(bits)]), .{ .shadow = 1 });
}

/// The same for points in volumes, at which light that goes `along` is scattered.
pub noinline fn addScattered(
    comptime Kernel: type,
    step: *PathStep(Kernel),
    lanes: Kernel.Rays.Mask,
    position: Kernel.Rays.Vec3,
    along: Kernel.Rays.Vec3,
    anisotropy: Kernel.Rays.F32,
) void {
    const Rays = Kernel.Rays;
    const Vec3 = Rays.Vec3;
    const receiver: light_sampling.Receiver(Rays) = .{
        .position = position,
        .normal = .splat(.{ 0, 0, 0 }),
    };
    const light = choose(Kernel, step, &receiver, lanes);
    const found = phase.eval(Rays, along.dot(light.to_light), anisotropy);
    const share = shareOf(Rays, &light, found);
    const worth = step.throughput.mul(light.radiance).scale(share.mul(found));
    const lit = lanes.bitAnd(light.pdf.gt(.zero())).bitAnd(carriesLight(Rays, worth));
    if (lit.none()) return;
    const is_far = light.distance.eq(.splat(std.math.inf(f32)));
    const reach: Vec3 = light.to_light.scale(.select(is_far, .splat(1), light.distance));
    step.shadows.take(&.{
        .lanes = lit,
        .origin = position,
        .direction = reach,
        .end = endOf(Rays, &light),
        .skip = light.primitive,
        .cone_width = .zero(),
        .straight = light.is_delta,
        .light = worth,
    }, &step.numbers);
    countShadows(Kernel, step, lit);
}

/// Vertices as those who get light.
pub fn receiverAt(
    comptime Kernel: type,
    step: *const PathStep(Kernel),
) light_sampling.Receiver(Kernel.Rays) {
    const Rays = Kernel.Rays;
    const none: Rays.Vec3 = .splat(.{ 0, 0, 0 });
    const point = &step.vertex.point;
    const bsdf = &step.vertex.bsdf;
    const behind = bsdf.mirror.transmitted.add(bsdf.back_albedo);
    const both = behind.x.max(behind.y).max(behind.z).gt(.zero());
    return .{
        .position = point.position,
        .normal = .select(both, none, point.normal_geometric),
    };
}

/// What rays that leave the scene bring of what is around it, in the lanes asked for.
pub noinline fn fromAround(
    comptime Kernel: type,
    step: *const PathStep(Kernel),
    asked: Kernel.Rays.Mask,
) Kernel.Rays.Vec3 {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const direction = step.path.bundle.groups[step.group].line.direction;
    const frame = step.frame;
    const radiance = light_sampling.environmentRadiance(Rays, frame, direction, asked);
    const arriving = step.throughput.mul(radiance);
    const shared = asked.bitAnd(step.scatter_pdf.gt(.zero()));
    if (frame.light_sampler == null or shared.none()) return arriving;
    const receiver = step.receiver();
    const other =
        light_sampling.pdfOfEnvironment(Rays, frame, &receiver, direction, shared);
    const share = heuristic(Rays, step.scatter_pdf, other);
    return arriving.scale(F32.select(shared, share, .splat(1)));
}

/// What surfaces emit that rays meet, with the share that these rays have of it.
pub noinline fn fromSurface(
    comptime Kernel: type,
    step: *const PathStep(Kernel),
    asked: Kernel.Rays.Mask,
) Kernel.Rays.Vec3 {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const Vec3 = Rays.Vec3;
    const none: Vec3 = .splat(.{ 0, 0, 0 });
    const point = &step.vertex.point;
    const bsdf = &step.vertex.bsdf;
    const emissive: Vec3 = .select(point.culled, none, point.material.emissive);
    const shines = asked.bitAnd(emissive.x.max(emissive.y).max(emissive.z).gt(.zero()));
    if (shines.none()) return none;
    const shared = shines.bitAnd(step.scatter_pdf.gt(.zero()));
    var share: F32 = .splat(1);
    // None of what shines below a coat is chosen.
    if (bsdf.layered) share = bsdf.coating.below_coat;
    if (step.frame.light_sampler == null or shared.none()) return emissive.scale(share);
    const receiver = step.receiver();
    const way = point.position.sub(receiver.position);
    const distance = way.length();
    const other = light_sampling.pdfOfEmitter(
        Rays,
        step.frame,
        &receiver,
        step.path.bundle.groups[step.group].closest.primitive,
        distance,
        way.scale(F32.splat(1).div(distance)),
        shared,
    );
    const weight = heuristic(Rays, step.scatter_pdf, other);
    return emissive.scale(share.mul(F32.select(shared, weight, .splat(1))));
}
