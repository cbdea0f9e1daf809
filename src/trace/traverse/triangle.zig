//! Watertight ray-triangle intersection (Woop, Benthin and Wald 2013), the same in every variant.
//!
//! In: corners, a sheared ray, in lanes that may be triangles, rays or both. Out: where the
//! triangle is hit, and t; it decides the picture. Corners are sheared into the plane across the
//! ray, the same for every triangle that shares them, and there each edge function is the
//! difference of two products of floats, whose sign is right or the difference 0. A zero is
//! resolved exactly (`resolveTies`), so that a ray through an edge or a corner hits exactly one of
//! the triangles around it.

const std = @import("std");
const ray_file = @import("ray.zig");
const box = @import("box.zig");
const Padding = @import("../../world.zig").Padding;
const vec3 = @import("../../math.zig").vec3;
const ShearedRay = ray_file.ShearedRay;

/// Corners as the ray sees them: x, y across the ray from it, z the share along it times t's unit.
pub fn Projection(comptime Lanes: type) type {
    return struct { a: Lanes.Vec3, b: Lanes.Vec3, c: Lanes.Vec3 };
}

/// Shears turned corners into the view.
pub inline fn project(
    comptime Lanes: type,
    corners: [3]Lanes.Vec3,
    view: *const ShearedRay(Lanes),
) Projection(Lanes) {
    return projectOffsets(Lanes, .{
        corners[0].sub(view.origin),
        corners[1].sub(view.origin),
        corners[2].sub(view.origin),
    }, view.shear);
}

/// The same of corners given from the ray's origin.
pub inline fn projectOffsets(
    comptime Lanes: type,
    offsets: [3]Lanes.Vec3,
    shear: Lanes.Vec3,
) Projection(Lanes) {
    return .{
        .a = sheared(Lanes, offsets[0], shear),
        .b = sheared(Lanes, offsets[1], shear),
        .c = sheared(Lanes, offsets[2], shear),
    };
}

inline fn sheared(comptime Lanes: type, offset: Lanes.Vec3, shear: Lanes.Vec3) Lanes.Vec3 {
    return .{
        .x = offset.x.sub(shear.x.mul(offset.z)),
        .y = offset.y.sub(shear.y.mul(offset.z)),
        .z = offset.z.mul(shear.z),
    };
}

/// Edge functions: twice the areas that the ray cuts off opposite each corner, signed; in
/// proportion to the barycentric weights of the corners.
pub fn EdgeFunctions(comptime Lanes: type) type {
    return struct {
        a: Lanes.F32,
        b: Lanes.F32,
        c: Lanes.F32,

        /// Set where no two of them have opposite signs; zeros agree with both, NaN with none.
        pub inline fn agree(weights: @This()) Lanes.Mask {
            const zero: Lanes.F32 = .zero();
            const front = weights.a.ge(zero).bitAnd(weights.b.ge(zero)).bitAnd(weights.c.ge(zero));
            const back = weights.a.le(zero).bitAnd(weights.b.le(zero)).bitAnd(weights.c.le(zero));
            return front.bitOr(back);
        }

        /// Set where they agree, and perhaps where one is NaN or -0: quicker, to leave early.
        pub inline fn mayAgree(weights: @This()) Lanes.Mask {
            const zero: Lanes.F32 = .zero();
            const least = weights.a.minOrNegative(weights.b).minOrNegative(weights.c);
            const greatest = weights.a.maxOrNegative(weights.b).maxOrNegative(weights.c);
            return least.ge(zero).bitOr(greatest.le(zero));
        }

        /// Their sum, twice the area of the triangle seen.
        pub inline fn sum(weights: @This()) Lanes.F32 {
            return weights.a.add(weights.b).add(weights.c);
        }

        /// Barycentric coordinates: weights of corners 0, 1, 2 whose sum is 1.
        pub inline fn barycentrics(weights: @This()) [3]Lanes.F32 {
            const F32 = Lanes.F32;
            const area = weights.sum();
            // All three can round to zero where a triangle is much smaller than its distance.
            const none = area.eq(.zero());
            const divisor = F32.select(none, .splat(1), area);
            return .{
                F32.select(none, .splat(1), weights.a.div(divisor)),
                weights.b.div(divisor),
                weights.c.div(divisor),
            };
        }
    };
}

/// Evaluates the edge functions.
pub inline fn edgeFunctions(comptime Lanes: type, seen: Projection(Lanes)) EdgeFunctions(Lanes) {
    return .{
        .a = seen.c.x.mul(seen.b.y).sub(seen.c.y.mul(seen.b.x)),
        .b = seen.a.x.mul(seen.c.y).sub(seen.a.y.mul(seen.c.x)),
        .c = seen.b.x.mul(seen.a.y).sub(seen.b.y.mul(seen.a.x)),
    };
}

/// Those of corners as in the scene, to a line that is known to hit.
pub inline fn edgeFunctionsOf(
    comptime Lanes: type,
    corners: [3]Lanes.Vec3,
    line: ray_file.Line(Lanes),
) EdgeFunctions(Lanes) {
    const axis: ray_file.LongAxis(Lanes) = .of(line.direction);
    const origin = axis.turn(line.origin);
    return edgeFunctions(Lanes, projectOffsets(Lanes, .{
        axis.turn(corners[0]).sub(origin),
        axis.turn(corners[1]).sub(origin),
        axis.turn(corners[2]).sub(origin),
    }, ray_file.shearOf(Lanes, axis.turn(line.direction))));
}

/// Of the lanes where the rounded edge functions agree, those that the exact ones accept. Where one
/// came out as 0 it is replaced by the exact difference, rounded once; see `resolveLane`.
pub inline fn resolveTies(
    comptime Lanes: type,
    seen: Projection(Lanes),
    weights: *EdgeFunctions(Lanes),
    agreeing: Lanes.Mask,
) Lanes.Mask {
    const zero: Lanes.F32 = .zero();
    const tied = weights.a.eq(zero).bitOr(weights.b.eq(zero)).bitOr(weights.c.eq(zero));
    const rare = agreeing.bitAnd(tied).bits();
    if (rare == 0) return agreeing;
    // Copies, so that nothing is put into memory unless it comes to this.
    const seen_copy = seen;
    var weights_copy = weights.*;
    const inside = resolveRareTies(Lanes, &seen_copy, &weights_copy, agreeing, rare);
    weights.* = weights_copy;
    return inside;
}

fn resolveRareTies(
    comptime Lanes: type,
    seen: *const Projection(Lanes),
    weights: *EdgeFunctions(Lanes),
    agreeing: Lanes.Mask,
    rare: u32,
) Lanes.Mask {
    @branchHint(.cold);
    var resolved: [3][Lanes.F32.count]f32 = .{
        weights.a.toArray(), weights.b.toArray(), weights.c.toArray(),
    };
    var inside = agreeing.bits();
    var rest = rare;
    while (rest != 0) : (rest &= rest - 1) {
        const lane = @ctz(rest);
        const corner_a = seen.a.lane(lane);
        const corner_b = seen.b.lane(lane);
        const corner_c = seen.c.lane(lane);
        const edges: [3]Edge = .{
            .init(corner_c, corner_b), .init(corner_a, corner_c), .init(corner_b, corner_a),
        };
        const sides = [3]Side{ edges[0].side(), edges[1].side(), edges[2].side() };
        const same = sides[0] == sides[1] and sides[1] == sides[2] and sides[0] != .none;
        if (!same) inside &= ~(@as(u32, 1) << @intCast(lane));
        const rounded = [3]f32{ resolved[0][lane], resolved[1][lane], resolved[2][lane] };
        for (&resolved, resolveLane(rounded, edges)) |*weight, value| weight[lane] = value;
    }
    weights.* = .{
        .a = .fromArray(resolved[0]),
        .b = .fromArray(resolved[1]),
        .c = .fromArray(resolved[2]),
    };
    return .fromBits(inside);
}

/// The edge functions as floats, up to a factor common to all three: 1, unless the area would come
/// out as 0 although it is not.
fn resolveLane(rounded: [3]f32, edges: [3]Edge) [3]f32 {
    var values: [3]f32 = undefined;
    for (&values, rounded, edges) |*value, weight, edge| {
        value.* = if (weight == 0) @floatCast(edge.value) else weight;
    }
    if (values[0] + values[1] + values[2] != 0) return values;
    const greatest = @max(@abs(edges[0].value), @abs(edges[1].value), @abs(edges[2].value));
    if (greatest == 0) return values;
    for (&values, edges) |*value, edge| value.* = @floatCast(edge.value / greatest);
    return values;
}

/// The side of an edge on which a ray passes.
const Side = enum { none, left, right };

/// The exact edge function p.x q.y - p.y q.x: products of two f32 are exact in f64, so the sign of
/// their difference is, and 0 means that the ray meets the edge or its extension.
const Edge = struct {
    p: [3]f32,
    q: [3]f32,
    value: f64,

    fn init(p: [3]f32, q: [3]f32) Edge {
        const one: f64 = @as(f64, p[0]) * @as(f64, q[1]);
        const other: f64 = @as(f64, p[1]) * @as(f64, q[0]);
        return .{ .p = p, .q = q, .value = one - other };
    }

    /// On a true 0 it is the side beside it, for a ray moved by an infinitesimal step along x and
    /// a yet smaller one along y (simulation of simplicity, Edelsbrunner and Muecke 1990). It
    /// changes when the edge is walked the other way; `none` is left for edges without length.
    fn side(edge: Edge) Side {
        if (edge.value > 0) return .left;
        if (edge.value < 0) return .right;
        const p = edge.p;
        const q = edge.q;
        if (p[1] != q[1]) return if (p[1] > q[1]) .left else .right;
        if (p[0] != q[0]) return if (q[0] > p[0]) .left else .right;
        return .none;
    }
};

/// t where mask is set.
pub fn Intersection(comptime Lanes: type) type {
    return struct { mask: Lanes.Mask, t: Lanes.F32 };
}

/// The same and what decided it.
pub fn WeightedIntersection(comptime Lanes: type) type {
    return struct {
        mask: Lanes.Mask,
        t: Lanes.F32,
        weights: EdgeFunctions(Lanes),
    };
}

/// Second half of the test, for lanes inside the edges: t of the plane, held within the t range of
/// the triangle's own padded box. A hit outside of this range comes from rounding alone (a triangle
/// seen edge-on); holding it inside is what makes culling by boxes exact. Missing the box
/// altogether is a miss. `corners` and the padding's `center` are turned but not sheared.
pub inline fn locate(
    comptime Lanes: type,
    seen: Projection(Lanes),
    weights: EdgeFunctions(Lanes),
    corners: [3]Lanes.Vec3,
    view: *const ShearedRay(Lanes),
    padding: *const Padding,
    center: Lanes.Vec3,
) Intersection(Lanes) {
    const bounds = boundsOf(Lanes, corners, padding, center);
    return locateWithin(Lanes, seen, weights, box.padded(Lanes, bounds[0], bounds[1], view));
}

/// The lower and the upper corner of a triangle's box, grown by its pad; `center` is turned as
/// corners are. The order of comparisons is the builder's, so that both see the same box.
pub inline fn boundsOf(
    comptime Lanes: type,
    corners: [3]Lanes.Vec3,
    padding: *const Padding,
    center: Lanes.Vec3,
) [2]Lanes.Vec3 {
    const lower = corners[2].min(corners[1].min(corners[0]));
    const upper = corners[2].max(corners[1].max(corners[0]));
    const pad = padding.ofBoxes(Lanes, lower, upper, center);
    const grow: Lanes.Vec3 = .{ .x = pad, .y = pad, .z = pad };
    return .{ lower.sub(grow), upper.add(grow) };
}

/// The same with the range of the triangle's grown box given.
pub inline fn locateWithin(
    comptime Lanes: type,
    seen: Projection(Lanes),
    weights: EdgeFunctions(Lanes),
    range: box.Range(Lanes),
) Intersection(Lanes) {
    const plane = locatePlane(Lanes, seen, weights);
    return .{
        .mask = plane.mask.bitAnd(range.near.le(range.far)),
        .t = plane.t.max(range.near).min(range.far),
    };
}

/// t of the plane, where the triangle has an area.
pub inline fn locatePlane(
    comptime Lanes: type,
    seen: Projection(Lanes),
    weights: EdgeFunctions(Lanes),
) Intersection(Lanes) {
    const area = weights.sum();
    const depth = weights.a.mul(seen.a.z).add(weights.b.mul(seen.b.z)).add(weights.c.mul(seen.c.z));
    const has_area = area.abs().gt(.zero()).bitAnd(area.abs().lt(.splat(std.math.inf(f32))));
    return .{ .mask = has_area, .t = depth.div(area) };
}

/// The whole test, for callers that have no use for its parts. `corners` as in the scene.
pub inline fn intersect(
    comptime Lanes: type,
    corners: [3]Lanes.Vec3,
    line: ray_file.Line(Lanes),
    padding: *const Padding,
) WeightedIntersection(Lanes) {
    @setEvalBranchQuota(4000); // For what is inlined here.
    const axis: ray_file.LongAxis(Lanes) = .of(line.direction);
    const view: ShearedRay(Lanes) = .init(line, axis, padding);
    const turned: [3]Lanes.Vec3 = .{
        axis.turn(corners[0]), axis.turn(corners[1]), axis.turn(corners[2]),
    };
    const seen = project(Lanes, turned, &view);
    var weights = edgeFunctions(Lanes, seen);
    const inside = resolveTies(Lanes, seen, &weights, weights.agree());
    const center = axis.turn(.splat(padding.center));
    const hit = locate(Lanes, seen, weights, turned, &view, padding, center);
    return .{ .mask = inside.bitAnd(hit.mask), .t = hit.t, .weights = weights };
}

const Single = ray_file.Single;

const test_padding: Padding = .init(@splat(0), .empty);

fn testHit(corners: [3][3]f32, origin: [3]f32, direction: [3]f32) ?f32 {
    const lanes: [3]Single.Vec3 = .{ .splat(corners[0]), .splat(corners[1]), .splat(corners[2]) };
    const hit = intersect(Single, lanes, .init(.splat(origin), .splat(direction)), &test_padding);
    return if (hit.mask.lane(0)) hit.t.lane(0) else null;
}

test "a triangle in the plane z = 0, from both sides and beside it" {
    const corners = [3][3]f32{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } };
    try std.testing.expectEqual(2, testHit(corners, .{ 0.2, 0.2, 2 }, .{ 0, 0, -1 }));
    try std.testing.expectEqual(1, testHit(corners, .{ 0.2, 0.2, -2 }, .{ 0, 0, 2 }));
    try std.testing.expectEqual(null, testHit(corners, .{ 0.6, 0.5, 2 }, .{ 0, 0, -1 }));
    try std.testing.expectEqual(null, testHit(corners, .{ 0.2, 0.2, 2 }, .{ 1, 0, 0 }));
}

test "no hit without an area, with NaN or with infinity" {
    const nan = std.math.nan(f32);
    const inf = std.math.inf(f32);
    const point = [3][3]f32{ .{ 0, 0, 0 }, .{ 0, 0, 0 }, .{ 0, 0, 0 } };
    try std.testing.expectEqual(null, testHit(point, .{ 0, 0, 1 }, .{ 0, 0, -1 }));
    const line = [3][3]f32{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 2, 0, 0 } };
    try std.testing.expectEqual(null, testHit(line, .{ 1, 0, 1 }, .{ 0, 0, -1 }));
    const broken = [3][3]f32{ .{ nan, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } };
    try std.testing.expectEqual(null, testHit(broken, .{ 0.2, 0.2, 1 }, .{ 0, 0, -1 }));
    const endless = [3][3]f32{ .{ 0, 0, 0 }, .{ inf, 0, 0 }, .{ 0, 1, 0 } };
    try std.testing.expectEqual(null, testHit(endless, .{ 0.2, 0.2, 1 }, .{ 0, 0, -1 }));
    const still = [3][3]f32{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } };
    try std.testing.expectEqual(null, testHit(still, .{ 0.2, 0.2, 1 }, .{ 0, 0, 0 }));
}

test "triangles so small that products of their edges vanish are hit" {
    const size = 1e-25;
    const corners = [3][3]f32{ .{ -size, -size, 0 }, .{ size, -size, 0 }, .{ 0, size, 0 } };
    try std.testing.expectEqual(1, testHit(corners, .{ 0, 0, 1 }, .{ 0, 0, -1 }));
    try std.testing.expectEqual(null, testHit(corners, .{ size, size, 1 }, .{ 0, 0, -1 }));
}

test "a ray through an edge or a corner hits exactly one of the triangles around it" {
    // A fan of eight around the origin, seen from above, from below and aslant; half of the
    // triangles wound the other way, as careless files have them.
    const rim = [8][3]f32{
        .{ 1, 0, 0 },  .{ 1, 1, 0 },   .{ 0, 1, 0 },  .{ -1, 1, 0 },
        .{ -1, 0, 0 }, .{ -1, -1, 0 }, .{ 0, -1, 0 }, .{ 1, -1, 0 },
    };
    const origins = [_][3]f32{ .{ 0, 0, 2 }, .{ 0, 0, -2 }, .{ 2, 1, 4 }, .{ -1, 3, -0.5 } };
    const targets = [_][3]f32{ .{ 0, 0, 0 }, .{ 0.5, 0, 0 }, .{ 0.25, 0.25, 0 }, .{ 0, -0.5, 0 } };
    for (origins) |origin| for (targets) |target| for ([_]bool{ false, true }) |careless| {
        var hit_count: u32 = 0;
        for (rim, 0..) |first, index| {
            const second = rim[(index + 1) % rim.len];
            const middle = [3]f32{ 0, 0, 0 };
            const turned = careless and index % 2 == 0;
            const corners: [3][3]f32 = if (turned)
                .{ middle, second, first }
            else
                .{ middle, first, second };
            const direction = vec3.sub(target, origin);
            hit_count += @intFromBool(testHit(corners, origin, direction) != null);
        }
        try std.testing.expectEqual(1, hit_count);
    };
}

test "a ray into a cone of random triangles around a corner hits exactly one, wherever it aims" {
    var random = std.Random.DefaultPrng.init(11);
    const r = random.random();
    for (0..20_000) |round| {
        // A convex fan seen from within its cone, so that no outline passes the ray.
        const scale: f32 = if (round % 2 == 0) 1 else 1e-3;
        const apex: [3]f32 = .{ r.floatNorm(f32) + 100, r.floatNorm(f32) + 100, 40 };
        var rim: [5][3]f32 = undefined;
        for (&rim, [5][2]f32{
            .{ 1, 0 }, .{ 0.3, 1 }, .{ -0.8, 0.6 }, .{ -0.8, -0.6 }, .{ 0.3, -1 },
        }) |*point, place| {
            point.* = vec3.add(apex, vec3.scale(.{
                place[0] + r.float(f32) * 0.2, place[1] + r.float(f32) * 0.2, r.float(f32),
            }, scale));
        }
        const origin: [3]f32 = .{ 100 + r.floatNorm(f32), 100 + r.floatNorm(f32), -50 };
        const edge_end = rim[r.uintLessThan(usize, rim.len)];
        const share: f32 = if (round % 3 == 0) 0 else r.float(f32) * 0.5;
        const target = vec3.add(apex, vec3.scale(vec3.sub(edge_end, apex), share));
        var hit_count: u32 = 0;
        for (rim, 0..) |first, index| {
            const corners = [3][3]f32{ apex, first, rim[(index + 1) % rim.len] };
            const direction = vec3.sub(target, origin);
            hit_count += @intFromBool(testHit(corners, origin, direction) != null);
        }
        try std.testing.expectEqual(1, hit_count);
    }
}
