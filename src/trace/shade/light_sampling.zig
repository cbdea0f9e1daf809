//! One light list in lanes: a light for each receiver, at random, and how likely it was.
//!
//! In: receivers, numbers in 0..1. Out: a direction, what arrives along it with nothing in the way,
//! and the density. What light comes from is chosen by estimates of its irradiance at the receiver:
//! the mean of the environment, all directional lights, the most that the tree's lights may give
//! (`light_tree.zig`); each that is there has a sixteenth of the whole besides, so that none that
//! is estimated low becomes rare. Environments are sampled by radiance
//! (`environment_sampling.zig`), triangles evenly by area. For multiple importance sampling (Veach
//! and Guibas 1995) the densities are there for directions from elsewhere as well, the same to the
//! bit.

const std = @import("std");
const simd = @import("../../simd.zig");
const world_file = @import("../../world.zig");
const emission = @import("emission.zig");
const environment_file = @import("environment.zig");
const environment_sampling = @import("environment_sampling.zig");
const interaction_file = @import("interaction.zig");
const light_file = @import("light.zig");
const light_tree = @import("light_tree.zig");
const microfacet = @import("microfacet.zig");
const Frame = world_file.Frame;
const LightSampler = world_file.LightSampler;
const Unique = @import("unique.zig").Unique;

/// In `Sample.primitive`: none.
pub const no_primitive: i32 = -1;

/// Of the estimates' sum, what each kind of light that is there counts besides.
const share_least = 1.0 / 16.0;
/// The largest number below 1.
const below_one = 0x1.fffffep-1;

/// Points that are lit.
pub fn Receiver(comptime Lanes: type) type {
    return struct {
        position: Lanes.Vec3,
        /// Unit geometric normal on the side that light comes from; zero where it comes from both,
        /// and in media.
        normal: Lanes.Vec3,

        inline fn at(receiver: *const @This(), lane: usize) light_tree.Receiver {
            return .{
                .position = receiver.position.laneIn(lane),
                .normal = receiver.normal.laneIn(lane),
            };
        }
    };
}

/// Light at receivers from one direction.
pub fn Sample(comptime Lanes: type) type {
    return struct {
        /// Unit vector.
        to_light: Lanes.Vec3,
        /// In metres; infinite for directional lights and the environment.
        distance: Lanes.F32,
        /// What arrives along `to_light` with nothing in the way, linear RGB: radiance, or
        /// irradiance across it of lights that are points or directions.
        radiance: Lanes.Vec3,
        /// Per steradian, the choice of the light included; of points and directions that choice
        /// alone. 0: no light. `radiance` over it is the estimate in any case.
        pdf: Lanes.F32,
        /// No ray that is scattered ever meets this light: it counts in full. Points, directions,
        /// and emitters that are hidden.
        is_delta: Lanes.Mask,
        /// The triangle that emits, which ends a shadow ray, or `no_primitive`.
        primitive: Lanes.I32,
    };
}

/// The chance of each kind of light; 0 where there is none.
fn Shares(comptime Lanes: type) type {
    const F32 = Lanes.F32;
    return struct {
        environment: F32,
        directional: F32,
        tree: F32,
        /// Those of the tree, in lanes asked for; undefined without one.
        roots: [Lanes.count]light_tree.Parts,

        fn find(
            shares: *@This(),
            sampler: *const LightSampler,
            receiver: *const Receiver(Lanes),
            asked: Lanes.Mask,
        ) void {
            var near: [Lanes.count]f32 = @splat(0);
            if (sampler.tree.nodes.len > 0) {
                var rest = asked.bits();
                while (rest != 0) : (rest &= rest - 1) {
                    const lane = @ctz(rest);
                    const root = &shares.roots[lane];
                    root.* = light_tree.partsOf(Lanes, &sampler.tree, &receiver.at(lane));
                    near[lane] = light_tree.sumOf(root);
                }
            }
            const tree: F32 = .fromArray(near);
            const environment: F32 = .splat(sampler.environment_irradiance);
            const directional: F32 = .splat(sampler.directional_irradiance);
            const least = environment.add(directional).add(tree).mul(.splat(share_least));
            const weights = [3]F32{
                atLeast(environment, least), atLeast(directional, least), atLeast(tree, least),
            };
            const sum = weights[0].add(weights[1]).add(weights[2]);
            const bounded = F32.select(sum.gt(.zero()), sum, .splat(1));
            shares.environment = weights[0].div(bounded);
            shares.directional = weights[1].div(bounded);
            shares.tree = weights[2].div(bounded);
        }

        inline fn atLeast(estimate: F32, least: F32) F32 {
            return F32.select(estimate.gt(.zero()), estimate.add(least), .zero());
        }
    };
}

/// A light for each lane asked for. The first number chooses it, the others a point on it. Asserts
/// that the frame has a light list.
pub noinline fn sample(
    comptime Lanes: type,
    frame: *const Frame,
    receiver: *const Receiver(Lanes),
    numbers: [3]Lanes.F32,
    asked: Lanes.Mask,
) Sample(Lanes) {
    const F32 = Lanes.F32;
    const zero: F32 = .zero();
    const sampler = frame.light_sampler.?;
    var shares: Shares(Lanes) = undefined;
    shares.find(sampler, receiver, asked);
    const number = numbers[0];
    const after_environment = number.sub(shares.environment);
    const is_around = number.lt(shares.environment).bitAnd(asked);
    const is_far = asked.andNot(is_around)
        .bitAnd(after_environment.lt(shares.directional));
    const is_near = asked.andNot(is_around).andNot(is_far).bitAnd(shares.tree.gt(zero));
    var result: Sample(Lanes) = .{
        .to_light = .splat(.{ 0, 1, 0 }),
        .distance = .splat(std.math.inf(f32)),
        .radiance = .splat(.{ 0, 0, 0 }),
        .pdf = zero,
        .is_delta = .splat(false),
        .primitive = .splat(no_primitive),
    };
    if (is_around.any()) {
        const rest = within(Lanes, number, shares.environment);
        const all = [3]F32{ rest, numbers[1], numbers[2] };
        addEnvironment(Lanes, frame, &shares, all, is_around, &result);
    }
    var chosen: Chosen(Lanes) = .none;
    if (is_far.any()) {
        const rest = within(Lanes, after_environment, shares.directional);
        chosen.takeDirectional(sampler, rest, shares.directional, is_far);
    }
    if (is_near.any()) {
        const rest = within(Lanes, after_environment.sub(shares.directional), shares.tree);
        chosen.takeFromTree(&sampler.tree, receiver, &shares, rest, is_near);
    }
    if (chosen.has_light) addLights(Lanes, frame, receiver, &chosen, &result);
    if (chosen.has_emitter) {
        addEmitters(Lanes, frame, receiver, &chosen, .{ numbers[1], numbers[2] }, &result);
    }
    return result;
}

/// Where a number is in a part of 0..1 that starts at 0.
inline fn within(comptime Lanes: type, number: Lanes.F32, share: Lanes.F32) Lanes.F32 {
    const zero: Lanes.F32 = .zero();
    const bounded = Lanes.F32.select(share.gt(zero), share, .splat(1));
    return number.max(zero).div(bounded).min(.splat(below_one));
}

/// Lights with a number, in lanes.
fn Chosen(comptime Lanes: type) type {
    return struct {
        /// In `Frame.all_lights`, negative: none. In `LightTree.leaves`, negative: none.
        light: [Lanes.count]i32,
        emitter: [Lanes.count]i32,
        probability: [Lanes.count]f32,
        has_light: bool,
        has_emitter: bool,

        const none: @This() = .{
            .light = @splat(-1),
            .emitter = @splat(-1),
            .probability = @splat(0),
            .has_light = false,
            .has_emitter = false,
        };

        fn takeDirectional(
            chosen: *@This(),
            sampler: *const LightSampler,
            numbers: Lanes.F32,
            share: Lanes.F32,
            asked: Lanes.Mask,
        ) void {
            const from = numbers.toArray();
            const shares = share.toArray();
            const choices = sampler.directional;
            var rest = asked.bits();
            while (rest != 0) : (rest &= rest - 1) {
                const lane = @ctz(rest);
                var low: usize = 0;
                var high = choices.len - 1;
                while (low < high) {
                    const middle = low + (high - low) / 2;
                    if (from[lane] < choices[middle].share_end) high = middle else low = middle + 1;
                }
                chosen.light[lane] = @intCast(choices[low].light);
                chosen.probability[lane] = shares[lane] * choices[low].share;
                chosen.has_light = true;
            }
        }

        fn takeFromTree(
            chosen: *@This(),
            tree: *const world_file.LightTree,
            receiver: *const Receiver(Lanes),
            shares: *const Shares(Lanes),
            numbers: Lanes.F32,
            asked: Lanes.Mask,
        ) void {
            const from = numbers.toArray();
            const share = shares.tree.toArray();
            var rest = asked.bits();
            while (rest != 0) : (rest &= rest - 1) {
                const lane = @ctz(rest);
                const root = &shares.roots[lane];
                const choice = light_tree
                    .choose(Lanes, tree, &receiver.at(lane), root, from[lane]);
                const number = choice.leaf orelse continue;
                const leaf = &tree.leaves[number];
                chosen.probability[lane] = share[lane] * choice.probability;
                if (leaf.is_emitter) {
                    chosen.emitter[lane] = @intCast(number);
                    chosen.has_emitter = true;
                } else {
                    chosen.light[lane] = @intCast(leaf.number);
                    chosen.has_light = true;
                }
            }
        }
    };
}

fn addEnvironment(
    comptime Lanes: type,
    frame: *const Frame,
    shares: *const Shares(Lanes),
    numbers: [3]Lanes.F32,
    asked: Lanes.Mask,
    result: *Sample(Lanes),
) void {
    const sampler = frame.light_sampler.?;
    const points = [2]Lanes.F32{ numbers[1], numbers[2] };
    const is_even = numbers[0].lt(.splat(sampler.ambient_share)).bitAnd(asked);
    var to_light = result.to_light;
    if (is_even.any()) to_light = anywhere(Lanes, points);
    const is_mapped = asked.andNot(is_even);
    if (is_mapped.any()) {
        const bright = environment_sampling.sample(
            Lanes,
            frame.environment,
            sampler.environment.?,
            points,
            is_mapped,
        );
        to_light = .select(is_mapped, bright, to_light);
    }
    const density = densityOfEnvironment(Lanes, frame, to_light, asked);
    result.to_light = .select(asked, to_light, result.to_light);
    result.pdf = .select(asked, shares.environment.mul(density), result.pdf);
    const radiance = environmentRadiance(Lanes, frame, to_light, asked);
    result.radiance = .select(asked, radiance, result.radiance);
}

/// A unit vector, even over the sphere: Lambert's equal-area projection of a disc.
fn anywhere(comptime Lanes: type, numbers: [2]Lanes.F32) Lanes.Vec3 {
    const F32 = Lanes.F32;
    const one: F32 = .splat(1);
    const disc = microfacet.disc(Lanes, numbers);
    const squared = disc[0].mul(disc[0]).add(disc[1].mul(disc[1])).min(one);
    const wide = one.sub(squared).sqrt().mul(.splat(2));
    return .{
        .x = disc[0].mul(wide),
        .y = one.sub(squared.add(squared)),
        .z = disc[1].mul(wide),
    };
}

/// Radiance that rays from anywhere see beyond the scene, as sharp as the map is; 0 in lanes not
/// asked for.
pub fn environmentRadiance(
    comptime Lanes: type,
    frame: *const Frame,
    direction: Lanes.Vec3,
    asked: Lanes.Mask,
) Lanes.Vec3 {
    const zero: Lanes.F32 = .zero();
    return environment_file.radiance(Lanes, frame.environment, direction, zero, zero, asked);
}

/// Density of `sample` at a direction that leaves the scene, a unit vector; 0 in lanes not asked
/// for. The receivers are those that light was sampled for.
pub noinline fn pdfOfEnvironment(
    comptime Lanes: type,
    frame: *const Frame,
    receiver: *const Receiver(Lanes),
    direction: Lanes.Vec3,
    asked: Lanes.Mask,
) Lanes.F32 {
    var shares: Shares(Lanes) = undefined;
    shares.find(frame.light_sampler.?, receiver, asked);
    const density = densityOfEnvironment(Lanes, frame, direction, asked);
    return .select(asked, shares.environment.mul(density), .zero());
}

fn densityOfEnvironment(
    comptime Lanes: type,
    frame: *const Frame,
    direction: Lanes.Vec3,
    asked: Lanes.Mask,
) Lanes.F32 {
    const sampler = frame.light_sampler.?;
    const share: Lanes.F32 = .splat(sampler.ambient_share);
    const even = share.mul(.splat(0.25 / std.math.pi));
    const distribution = sampler.environment orelse return even;
    const density = environment_sampling
        .pdf(Lanes, frame.environment, distribution, direction, asked);
    return even.add(density.mul(Lanes.F32.splat(1).sub(share)));
}

/// Adds lights that are points or directions.
fn addLights(
    comptime Lanes: type,
    frame: *const Frame,
    receiver: *const Receiver(Lanes),
    chosen: *const Chosen(Lanes),
    result: *Sample(Lanes),
) void {
    const numbers: Lanes.I32 = .fromArray(chosen.light);
    const asked = numbers.lt(.zero()).bitNot();
    const lights: Unique(Lanes) = .of(numbers, asked);
    var point: interaction_file.Interaction(Lanes) = undefined;
    point.position = receiver.position;
    for (lights.numbers[0..lights.count], lights.lanes[0..lights.count]) |number, all| {
        const lanes = all.bitAnd(asked);
        const light = &frame.all_lights[number];
        const arrival = light_file.arrive(Lanes, light, &point);
        result.to_light = .select(lanes, arrival.to_light, result.to_light);
        result.radiance = .select(lanes, arrival.irradiance, result.radiance);
        if (light.kind != .directional)
            result.distance = .select(lanes, arrival.distance, result.distance);
    }
    result.pdf = .select(asked, .fromArray(chosen.probability), result.pdf);
    result.is_delta = result.is_delta.bitOr(asked);
}

/// Adds triangles that emit.
fn addEmitters(
    comptime Lanes: type,
    frame: *const Frame,
    receiver: *const Receiver(Lanes),
    chosen: *const Chosen(Lanes),
    numbers: [2]Lanes.F32,
    result: *Sample(Lanes),
) void {
    const F32 = Lanes.F32;
    const asked = Lanes.I32.fromArray(chosen.emitter).lt(.zero()).bitNot();
    // Even by area: the root makes up for the corner that is narrow.
    const root = numbers[0].max(.zero()).sqrt();
    const weights = [2]F32{ root.mul(F32.splat(1).sub(numbers[1])), root.mul(numbers[1]) };
    var triangles: Triangles(Lanes) = .none;
    triangles.gather(frame, chosen, .{ weights[0].toArray(), weights[1].toArray() }, asked);
    const corners = triangles.cornersInLanes();
    const edges = [2]Lanes.Vec3{ corners[1].sub(corners[0]), corners[2].sub(corners[0]) };
    const along = edges[0].scale(weights[0]).add(edges[1].scale(weights[1]));
    const way = corners[0].add(along).sub(receiver.position);
    const distance = way.dot(way).max(.splat(1e-30)).sqrt();
    const to_light = way.scale(F32.splat(1).div(distance));
    const doubled = edges[0].cross(edges[1]);
    const density = densityOfArea(Lanes, doubled, distance, to_light);
    const probability: F32 = .fromArray(chosen.probability);
    const is_front = doubled.dot(to_light).lt(.zero());
    const shines = asked.bitAnd(is_front.bitOr(.fromArray(triangles.is_two_sided)))
        .bitAnd(density.gt(.zero()));
    const radiance: Lanes.Vec3 = .{
        .x = .fromArray(triangles.radiance[0]),
        .y = .fromArray(triangles.radiance[1]),
        .z = .fromArray(triangles.radiance[2]),
    };
    result.to_light = .select(asked, to_light, result.to_light);
    result.distance = .select(asked, distance, result.distance);
    result.radiance = .select(shines, radiance, result.radiance);
    result.pdf = .select(shines, probability.mul(density), result.pdf);
    result.is_delta = result.is_delta.bitOr(shines.bitAnd(.fromArray(triangles.is_hidden)));
    result.primitive = .select(asked, .fromArray(triangles.primitive), result.primitive);
}

/// Per steradian, of a point of a triangle that is even by area; `doubled` is its normal, twice as
/// long as its area is large. 0 where it is seen from its edge.
inline fn densityOfArea(
    comptime Lanes: type,
    doubled: Lanes.Vec3,
    distance: Lanes.F32,
    to_light: Lanes.Vec3,
) Lanes.F32 {
    const zero: Lanes.F32 = .zero();
    const seen = doubled.dot(to_light).abs().mul(.splat(0.5));
    const is_seen = seen.gt(.splat(1e-30));
    const density = distance.mul(distance).div(Lanes.F32.select(is_seen, seen, .splat(1)));
    return .select(is_seen, density, zero);
}

/// Triangles that emit, a lane at a time.
fn Triangles(comptime Lanes: type) type {
    return struct {
        /// [corner][axis][lane].
        corners: [3][3][Lanes.count]f32,
        radiance: [3][Lanes.count]f32,
        primitive: [Lanes.count]i32,
        is_two_sided: [Lanes.count]bool,
        is_hidden: [Lanes.count]bool,

        const none: @This() = .{
            .corners = @splat(@splat(@splat(0))),
            .radiance = @splat(@splat(0)),
            .primitive = @splat(no_primitive),
            .is_two_sided = @splat(false),
            .is_hidden = @splat(false),
        };

        fn gather(
            triangles: *@This(),
            frame: *const Frame,
            chosen: *const Chosen(Lanes),
            weights: [2][Lanes.count]f32,
            asked: Lanes.Mask,
        ) void {
            var rest = asked.bits();
            while (rest != 0) : (rest &= rest - 1) {
                const lane = @ctz(rest);
                const leaf = &frame.light_sampler.?.tree.leaves[@intCast(chosen.emitter[lane])];
                triangles.putCorners(frame, leaf.number, lane);
                const at = [2]f32{ weights[0][lane], weights[1][lane] };
                const radiance = emission.radianceAt(frame, leaf.number, at);
                inline for (&triangles.radiance, radiance) |*to, channel| to[lane] = channel;
                triangles.primitive[lane] = @intCast(leaf.number);
                triangles.is_two_sided[lane] = leaf.is_two_sided;
                triangles.is_hidden[lane] = leaf.is_hidden;
            }
        }

        fn putCorners(triangles: *@This(), frame: *const Frame, primitive: u32, lane: usize) void {
            const face = frame.geometry.face(primitive);
            inline for (&triangles.corners, 0..) |*corner, number| {
                const position = face.position(frame.geometry, number);
                inline for (corner, position) |*axis, coordinate| axis[lane] = coordinate;
            }
        }

        inline fn cornersInLanes(triangles: *const @This()) [3]Lanes.Vec3 {
            var corners: [3]Lanes.Vec3 = undefined;
            inline for (&corners, triangles.corners) |*to, axes| to.* = .{
                .x = .fromArray(axes[0]),
                .y = .fromArray(axes[1]),
                .z = .fromArray(axes[2]),
            };
            return corners;
        }
    };
}

/// Density of `sample` at directions in which rays from the receivers hit triangles, `distance`
/// metres away; 0 where these are not sampled, and in lanes not asked for.
pub noinline fn pdfOfEmitter(
    comptime Lanes: type,
    frame: *const Frame,
    receiver: *const Receiver(Lanes),
    primitive: Lanes.I32,
    distance: Lanes.F32,
    to_light: Lanes.Vec3,
    asked: Lanes.Mask,
) Lanes.F32 {
    const tree = &frame.light_sampler.?.tree;
    const numbers = primitive.toArray();
    var leaves: [Lanes.count]*const world_file.LightLeaf = undefined;
    var triangles: Triangles(Lanes) = .none;
    var found: u32 = 0;
    var rest = asked.bits();
    while (rest != 0) : (rest &= rest - 1) {
        const lane = @ctz(rest);
        const leaf = tree.leafOf(@intCast(numbers[lane])) orelse continue;
        if (leaf.is_hidden) continue;
        found |= @as(u32, 1) << @intCast(lane);
        leaves[lane] = leaf;
        triangles.putCorners(frame, leaf.number, lane);
    }
    if (found == 0) return .zero();
    const lanes: Lanes.Mask = .fromBits(found);
    var shares: Shares(Lanes) = undefined;
    shares.find(frame.light_sampler.?, receiver, lanes);
    var probabilities: [Lanes.count]f32 = @splat(0);
    while (found != 0) : (found &= found - 1) {
        const lane = @ctz(found);
        const root = &shares.roots[lane];
        probabilities[lane] = light_tree
            .probabilityOf(Lanes, tree, &receiver.at(lane), root, leaves[lane]);
    }
    const corners = triangles.cornersInLanes();
    const doubled = corners[1].sub(corners[0]).cross(corners[2].sub(corners[0]));
    const density = densityOfArea(Lanes, doubled, distance, to_light);
    const probability = shares.tree.mul(.fromArray(probabilities));
    return .select(lanes, probability.mul(density), .zero());
}
