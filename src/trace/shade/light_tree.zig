//! Choosing lights by a tree over them (Conty Estevez and Kulla 2018, "Importance Sampling of Many
//! Lights with Adaptive Tree Splitting"), by the bounds of Pharr, Jakob and Humphreys ("Physically
//! Based Rendering", 4th edition, section 12.6.3).
//!
//! In: a receiver, a number in 0..1. Out: a light and its probability there. The importance of a
//! child is the most that its lights together may light the receiver with: intensity times the
//! cosines to the nearest axis and to the receiver's normal, over the squared distance. One
//! receiver goes down at a time, the four children of a node in lanes: the same bits in every
//! variant.

const std = @import("std");
const simd = @import("../../simd.zig");
const world_file = @import("../../world.zig");
const LightNode = world_file.LightNode;
const LightTree = world_file.LightTree;

/// The largest number below 1.
const below_one = 0x1.fffffep-1;
const width = world_file.light_tree_width;

/// A point that is lit.
pub const Receiver = struct {
    position: [3]f32,
    /// Unit vector to the side that light comes from; zero: from both.
    normal: [3]f32,
};

/// A light.
pub const Choice = struct {
    /// Its number in `LightTree.leaves`; null: no light reaches the receiver.
    leaf: ?u32,
    probability: f32,

    const none: Choice = .{ .leaf = null, .probability = 0 };
};

/// The lanes that a backend has for the children of a node.
fn Children(comptime Lanes: type) type {
    return simd.Lanes(Lanes.backend, width);
}

/// Of the root's children, what each may light a receiver with at most; see `importances`.
pub const Parts = [width]f32;

/// Those of a receiver, 0 without lights. `Lanes` tells the backend.
pub noinline fn partsOf(
    comptime Lanes: type,
    tree: *const LightTree,
    receiver: *const Receiver,
) Parts {
    if (tree.nodes.len == 0) return @splat(0);
    return importances(Lanes, &tree.nodes[0], receiver);
}

/// Their sum, in lux of luminance.
pub inline fn sumOf(parts: *const Parts) f32 {
    return ((parts[0] + parts[1]) + parts[2]) + parts[3];
}

/// Chooses a light. `root` is `partsOf` the receiver.
pub noinline fn choose(
    comptime Lanes: type,
    tree: *const LightTree,
    receiver: *const Receiver,
    root: *const Parts,
    number: f32,
) Choice {
    var rest = number;
    var probability: f32 = 1;
    var parts = root.*;
    var node: *const LightNode = if (tree.nodes.len > 0) &tree.nodes[0] else return .none;
    while (true) {
        const total = sumOf(&parts);
        if (!(total > 0)) return .none;
        var target = rest * total;
        var chosen: usize = 0;
        // The first beyond which the number is not; of none beyond it is, the last with any.
        for (parts, 0..) |part, index| {
            if (!(part > 0)) continue;
            chosen = index;
            if (target < part) break;
            target -= part;
        }
        const part = parts[chosen];
        const share = target / part;
        rest = if (share < below_one) share else below_one;
        probability *= part / total;
        const child = node.child[chosen];
        if (child & LightNode.leaf_bit != 0)
            return .{ .leaf = child ^ LightNode.leaf_bit, .probability = probability };
        node = &tree.nodes[child];
        parts = importances(Lanes, node, receiver);
    }
}

/// The probability of a leaf: that of `choose`, to the bit.
pub noinline fn probabilityOf(
    comptime Lanes: type,
    tree: *const LightTree,
    receiver: *const Receiver,
    root: *const Parts,
    leaf: *const world_file.LightLeaf,
) f32 {
    var path = leaf.path;
    var probability: f32 = 1;
    var parts = root.*;
    var node = &tree.nodes[0];
    while (true) {
        const total = sumOf(&parts);
        if (!(total > 0)) return 0;
        const index: usize = @intCast(path % width);
        path /= width;
        probability *= parts[index] / total;
        const child = node.child[index];
        if (child & LightNode.leaf_bit != 0) return probability;
        node = &tree.nodes[child];
        parts = importances(Lanes, node, receiver);
    }
}

/// By child, the most that its lights together may light a receiver with, in lux of luminance; at
/// least 0. Angles are those of the first reference: what is seen in the cone of axes and the
/// bounding sphere counts as seen along an axis.
inline fn importances(
    comptime Lanes: type,
    node: *const LightNode,
    receiver: *const Receiver,
) Parts {
    const L = Children(Lanes);
    const F32 = L.F32;
    const one: F32 = .splat(1);
    const zero: F32 = .zero();
    const way = vectorOf(L, &node.center).sub(.splat(receiver.position));
    const radius: F32 = .load(&node.radius);
    const radius_squared = radius.mul(radius);
    const squared = way.dot(way).max(.splat(1e-20));
    const distance = squared.sqrt();
    const to_light = way.scale(one.div(distance));
    const is_within = squared.le(radius_squared);
    const sin_bound_squared = F32.select(is_within, zero, radius_squared.div(squared));
    const bound: Angle(L) = .{
        .cos = F32.select(is_within, .splat(-1), one.sub(sin_bound_squared).sqrt()),
        .sin = sin_bound_squared.sqrt(),
    };
    const back: F32 = .load(&node.back);
    const signed = vectorOf(L, &node.axis).dot(to_light).neg().min(one).max(.splat(-1));
    const shows_back = back.gt(zero);
    const cosine = F32.select(shows_back, signed.abs(), signed);
    const off_axis: Angle(L) = .of(cosine);
    const spread: Angle(L) = .{ .cos = .load(&node.cos_spread), .sin = .load(&node.sin_spread) };
    const least = off_axis.less(spread).less(bound);
    const reaches = distance.sub(radius).lt(.load(&node.reach));
    const emits = least.cos.gt(.load(&node.cos_emission)).bitAnd(reaches);
    const side = F32.select(shows_back.bitAnd(signed.lt(zero)), back, one);
    const intensity = F32.load(&node.intensity).mul(side);
    var result = intensity.mul(least.cos).div(squared.max(radius_squared));
    result = F32.select(emits, result, zero);
    const normal = receiver.normal;
    if (normal[0] != 0 or normal[1] != 0 or normal[2] != 0) {
        const to_normal = L.Vec3.splat(normal).dot(to_light).min(one).max(.splat(-1));
        const arriving = Angle(L).of(to_normal).less(bound);
        result = result.mul(arriving.cos.max(zero));
    }
    return result.max(zero).toArray();
}

inline fn vectorOf(comptime L: type, components: *const [3][width]f32) L.Vec3 {
    return .{
        .x = .load(&components[0]),
        .y = .load(&components[1]),
        .z = .load(&components[2]),
    };
}

/// An angle of 0..pi.
fn Angle(comptime L: type) type {
    return struct {
        cos: L.F32,
        sin: L.F32,

        inline fn of(cosine: L.F32) @This() {
            const one: L.F32 = .splat(1);
            return .{ .cos = cosine, .sin = one.sub(cosine.mul(cosine)).max(.zero()).sqrt() };
        }

        /// Less another angle; at least 0.
        inline fn less(a: @This(), b: @This()) @This() {
            const is_none = a.cos.gt(b.cos);
            const cosine = a.cos.mul(b.cos).add(a.sin.mul(b.sin));
            const sine = a.sin.mul(b.cos).sub(a.cos.mul(b.sin));
            return .{
                .cos = .select(is_none, .splat(1), cosine),
                .sin = .select(is_none, .zero(), sine),
            };
        }
    };
}
