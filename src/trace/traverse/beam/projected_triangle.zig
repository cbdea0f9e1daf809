//! Projected edge functions (Pineda 1988, "A Parallel Algorithm for Polygon Rasterization") of
//! triangles on the plane across the rays of a beam, and their nearness.
//!
//! In: a pack of triangles, and how a ray is given by two numbers (u, v). Out: by triangle three
//! edge functions and a measure of nearness, each a value a u + b v + c, with bounds on their
//! errors in the manner of edges.zig. For the eye (u, v) is a pixel of the tile and nearness 1/t.
//! For a point light (u, v) are slopes, edge functions those of edges.zig over the slope's axis,
//! nearness is 1/depth; for a directional one (u, v) is where the light's ray meets an axis plane,
//! nearness is minus the depth. A triangle stands before a point if its nearness is greater.

const std = @import("std");
const ray_file = @import("../ray.zig");
const edges_file = @import("edges.zig");
const Grid = @import("grid.zig").Grid;

const unit = edges_file.unit_roundoff;

/// u, v and 1 times these.
pub fn Linear(comptime Value: type) type {
    return struct {
        u: Value,
        v: Value,
        one: Value,

        /// In lanes, times a factor.
        pub inline fn scale(form: @This(), factor: Value) @This() {
            return .{ .u = form.u.mul(factor), .v = form.v.mul(factor), .one = form.one.mul(factor) };
        }

        /// A form of numbers, at places in lanes.
        pub inline fn at(form: *const @This(), comptime F32: type, u: F32, v: F32) F32 {
            return u.mulAdd(.splat(form.u), v.mulAdd(.splat(form.v), .splat(form.one)));
        }
    };
}

/// What rounding is in proportion to, for all triangles of a beam.
pub const ErrorScale = struct {
    /// Of edge functions and of nearness.
    edge: f32,
    nearness: f32,
    /// See `edges.reachMax`.
    reach_max: f32,
};

/// Triangles of a pack in lanes.
pub fn ProjectedTriangle(comptime Lanes: type) type {
    return struct {
        /// Positive within.
        edge: [3]Linear(Lanes.F32),
        /// Bound of the error of an edge function.
        slack: Lanes.F32,
        /// In a directional light's own axes, its det the area on the plane.
        facet: edges_file.Facet(Lanes),
    };
}

/// Nearness of triangles in lanes.
pub fn Nearness(comptime Lanes: type) type {
    return struct {
        /// Greater is nearer to the eye or the light.
        form: Linear(Lanes.F32),
        /// Nearness n is within n (1 +- relative) +- absolute.
        relative: Lanes.F32,
        absolute: Lanes.F32,
        /// Lanes whose bounds hold and are worth anything; others are up to the exact test.
        decisive: Lanes.Mask,
    };
}

/// Rays from a point in directions that are linear in the pixel: (u, v) is its column and row.
pub const GridProjection = struct {
    grid: Grid,
    scale: ErrorScale,

    /// Of directions no longer than |D| that the grid has within d: that moves an edge function by
    /// 2 R L d, 1/t by L^2 / |det| d.
    pub fn init(grid: *const Grid, reach_max: f32) GridProjection {
        const longest = grid.longest();
        const off = 2 * grid.deviation_roundings;
        return .{ .grid = grid.*, .scale = .{
            .edge = unit * (edges_file.edge_roundings * longest +
                edges_file.step_roundings * grid.spread() + off),
            .nearness = unit * (edges_file.inverse_roundings * longest + off),
            .reach_max = reach_max,
        } };
    }

    /// Sets up triangles.
    pub inline fn project(
        projection: *const GridProjection,
        comptime Lanes: type,
        corners: [3]Lanes.Vec3,
    ) ProjectedTriangle(Lanes) {
        const origin: Lanes.Vec3 = .splat(projection.grid.origin);
        const edges: edges_file.Edges(Lanes) = .init(corners, origin, projection.scale.reach_max);
        var projected: ProjectedTriangle(Lanes) = .{
            .edge = undefined,
            .slack = edges.slack.mul(.splat(projection.scale.edge)),
            .facet = edges.facet,
        };
        inline for (&projected.edge, edges.normal) |*to, normal|
            to.* = projection.linear(Lanes, normal);
        return projected;
    }

    /// Nearness of the triangles that the edges have left.
    pub inline fn nearness(
        projection: *const GridProjection,
        comptime Lanes: type,
        facet: *const edges_file.Facet(Lanes),
    ) Nearness(Lanes) {
        const inverse = facet.inverse();
        return .{
            .form = projection.linear(Lanes, inverse.vector),
            .relative = inverse.relative,
            .absolute = inverse.absolute.mul(.splat(projection.scale.nearness)),
            .decisive = inverse.decisive,
        };
    }

    inline fn linear(
        projection: *const GridProjection,
        comptime Lanes: type,
        vector: Lanes.Vec3,
    ) Linear(Lanes.F32) {
        const grid = &projection.grid;
        return .{
            .u = edges_file.dot(Lanes, vector, .splat(grid.right)),
            .v = edges_file.dot(Lanes, vector, .splat(grid.down)),
            .one = edges_file.dot(Lanes, vector, .splat(grid.corner)),
        };
    }
};

/// Rays of a light, given by where they meet a plane across an axis.
pub const LightProjection = struct {
    /// Of a point light its place; else a point near the rays, to keep numbers small.
    origin: [3]f32,
    /// The axis along which depth counts; the others follow it in cyclic order.
    axis: u2,
    /// 1 or -1: the way the light travels along that axis.
    sign: f32,
    /// Null: from the origin on; else parallel rays that move by this much along the other two
    /// axes for each unit along the depth's.
    slope: ?[2]f32,
    /// Parallel rays: the largest distance of a ray's end from the origin.
    reach: f32 = 0,
    /// Length of the longest direction over its depth: sqrt(1 + m . m) for slopes m.
    stretch: f32 = undefined,
    scale: ErrorScale = undefined,

    /// Of rays whose slopes are at most so much along each axis.
    pub fn bound(projection: *LightProjection, slope_max: f32, reach_max: f32) void {
        const stretch = @sqrt(1 + 2 * slope_max * slope_max);
        const parallel = projection.slope != null;
        projection.stretch = stretch;
        projection.scale = .{
            .edge = unit * stretch * edges_file.edge_roundings * if (parallel) stretch else 1,
            .nearness = if (parallel) unit * stretch else unit * stretch * edges_file.inverse_roundings,
            .reach_max = reach_max,
        };
    }

    /// Index of the axis of u (0), v (1) or depth (2).
    pub fn axisAt(projection: *const LightProjection, index: usize) usize {
        return ray_file.turnedIndex(projection.axis, index);
    }

    /// Where points fall, given relative to the projection's origin. For a point light depth must
    /// not be 0.
    pub inline fn place(
        projection: *const LightProjection,
        comptime Lanes: type,
        point: Lanes.Vec3,
    ) struct { u: Lanes.F32, v: Lanes.F32, depth: Lanes.F32 } {
        const turned = turn(Lanes, projection.axis, point);
        const depth = turned.z.mul(.splat(projection.sign));
        if (projection.slope) |slope| return .{
            .u = turned.x.sub(turned.z.mul(.splat(slope[0]))),
            .v = turned.y.sub(turned.z.mul(.splat(slope[1]))),
            .depth = depth,
        };
        const inverse = Lanes.F32.splat(1).div(turned.z);
        return .{ .u = turned.x.mul(inverse), .v = turned.y.mul(inverse), .depth = depth };
    }

    /// Sets up triangles.
    pub inline fn project(
        projection: *const LightProjection,
        comptime Lanes: type,
        corners: [3]Lanes.Vec3,
    ) ProjectedTriangle(Lanes) {
        if (projection.slope) |slope| return projection.projectParallel(Lanes, corners, slope);
        const origin: Lanes.Vec3 = .splat(projection.origin);
        const edges: edges_file.Edges(Lanes) = .init(corners, origin, projection.scale.reach_max);
        var projected: ProjectedTriangle(Lanes) = .{
            .edge = undefined,
            .slack = edges.slack.mul(.splat(projection.scale.edge)),
            .facet = edges.facet,
        };
        inline for (&projected.edge, edges.normal) |*to, normal|
            to.* = projection.linear(Lanes, normal);
        return projected;
    }

    inline fn linear(
        projection: *const LightProjection,
        comptime Lanes: type,
        vector: Lanes.Vec3,
    ) Linear(Lanes.F32) {
        const turned = turn(Lanes, projection.axis, vector.scale(.splat(projection.sign)));
        return .{ .u = turned.x, .v = turned.y, .one = turned.z };
    }

    /// An edge function is twice the area between an edge and a point of the plane; depth is
    /// that of the triangle's plane. R of the bounds is the distance to the origin, or from
    /// there to a ray's end, if that is larger. With the slopes m of the rays, |D| is
    /// sqrt(1 + m . m), det the area on the plane and R S / |det| a length.
    inline fn projectParallel(
        projection: *const LightProjection,
        comptime Lanes: type,
        corners: [3]Lanes.Vec3,
        slope: [2]f32,
    ) ProjectedTriangle(Lanes) {
        const Vec3 = Lanes.Vec3;
        const axis = projection.axis;
        const origin: Vec3 = turn(Lanes, axis, .splat(projection.origin));
        const a = turn(Lanes, axis, corners[0]).sub(origin);
        const b = turn(Lanes, axis, corners[1]).sub(origin);
        const c = turn(Lanes, axis, corners[2]).sub(origin);
        const sides = [3]Vec3{
            turn(Lanes, axis, corners[2].sub(corners[1])),
            turn(Lanes, axis, corners[0].sub(corners[2])),
            turn(Lanes, axis, corners[1].sub(corners[0])),
        };
        const along: Vec3 = .{ .x = .splat(slope[0]), .y = .splat(slope[1]), .z = .splat(1) };
        const plane = edges_file.cross(Lanes, sides[1], sides[2]);
        const area = edges_file.dot(Lanes, plane, along);
        const flip: Lanes.F32 = .select(area.lt(.zero()), .splat(-1), .splat(1));
        const length_squared = edges_file.longestSquared(Lanes, sides);
        const length = length_squared.sqrt();
        const reach = edges_file.longestSquared(Lanes, .{ a, b, c }).sqrt()
            .add(.splat(projection.reach));
        var projected: ProjectedTriangle(Lanes) = .{
            .edge = undefined,
            .slack = reach.mul(length.add(reach.mul(.splat(2 * unit))))
                .mul(.splat(projection.scale.edge)),
            .facet = .{
                .turned = edges_file.isTurned(
                    Lanes,
                    area,
                    reach.mul(.splat(projection.stretch)),
                    length_squared,
                    length,
                ).bitAnd(reach.lt(.splat(projection.scale.reach_max))),
                .reach = reach,
                .length = length,
                .corner = a,
                .sides = .{ sides[1], sides[2] },
                .plane = plane,
                .det = area,
            },
        };
        inline for (&projected.edge, sides, [3]Vec3{ c.add(b), a.add(c), b.add(a) }) |*to, by, sum| {
            const u = by.x.sub(by.z.mul(along.x)).mul(flip);
            const v = by.y.sub(by.z.mul(along.y)).mul(flip);
            const middle_u = sum.x.sub(sum.z.mul(along.x)).mul(.splat(0.5));
            const middle_v = sum.y.sub(sum.z.mul(along.y)).mul(.splat(0.5));
            to.* = .{ .u = v.neg(), .v = u, .one = middle_u.mul(v).sub(middle_v.mul(u)) };
        }
        return projected;
    }

    /// Nearness of the triangles that the edges have left. Depth along parallel rays is off by
    /// (28 R + 9 L^3 / area) u |D| S / area.
    pub inline fn nearness(
        projection: *const LightProjection,
        comptime Lanes: type,
        facet: *const edges_file.Facet(Lanes),
    ) Nearness(Lanes) {
        const scale: Lanes.F32 = .splat(projection.scale.nearness);
        if (projection.slope == null) {
            const inverse = facet.inverse();
            return .{
                .form = projection.linear(Lanes, inverse.vector),
                .relative = inverse.relative,
                .absolute = inverse.absolute.mul(scale),
                .decisive = inverse.decisive,
            };
        }
        const area_inv, const steepness, const thinness = facet.shape();
        const reach = facet.reach;
        const absolute = reach.mulAdd(.splat(36), thinness.mul(.splat(11)))
            .mulAdd(steepness.mul(scale), reach.mul(scale.mul(.splat(5))));
        const height = edges_file.dot(Lanes, facet.plane, facet.corner).neg();
        const form: Linear(Lanes.F32) = .{ .u = facet.plane.x, .v = facet.plane.y, .one = height };
        return .{
            .form = form.scale(area_inv.mul(.splat(projection.sign))),
            .relative = .zero(),
            .absolute = absolute,
            .decisive = facet.turned
                .bitAnd(absolute.lt(reach.mul(.splat(edges_file.relative_error_max)))),
        };
    }
};

/// Components in cyclic order with the given axis last.
inline fn turn(comptime Lanes: type, axis: u2, vector: Lanes.Vec3) Lanes.Vec3 {
    return switch (axis) {
        0 => .{ .x = vector.y, .y = vector.z, .z = vector.x },
        1 => .{ .x = vector.z, .y = vector.x, .z = vector.y },
        else => vector,
    };
}

const simd = @import("../../../simd.zig");
const vec3 = @import("../../../math.zig").vec3;
const triangle = @import("../triangle.zig");
const Four = simd.Lanes(.vector, 4);
const Wide = @Vector(3, f128);

fn wide(vector: [3]f32) Wide {
    return .{ vector[0], vector[1], vector[2] };
}

fn wideCross(a: Wide, b: Wide) Wide {
    return .{ a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0] };
}

fn wideDot(a: Wide, b: Wide) f128 {
    return @reduce(.Add, a * b);
}

fn randomVector(random: std.Random, size: f32) [3]f32 {
    return .{
        random.floatNorm(f32) * size, random.floatNorm(f32) * size, random.floatNorm(f32) * size,
    };
}

/// Triangles about a place, of all sizes, slivers, some in a plane with `eye`.
fn randomTriangle(random: std.Random, place: [3]f32, eye: [3]f32) [3][3]f32 {
    const size = std.math.pow(f32, 10, random.float(f32) * 5 - 3);
    var corners: [3][3]f32 = undefined;
    for (&corners) |*corner| corner.* = vec3.add(place, randomVector(random, size));
    const share = random.float(f32);
    const between = vec3.add(corners[0], vec3.scale(vec3.sub(corners[1], corners[0]), share));
    switch (random.uintLessThan(u32, 4)) {
        0 => corners[2] = vec3.add(between, randomVector(random, size * 1e-3)),
        1 => corners[2] = vec3.add(
            vec3.add(eye, vec3.scale(vec3.sub(between, eye), 0.5 + share)),
            randomVector(random, size * 1e-2),
        ),
        else => {},
    }
    return corners;
}

/// How far bounds were used up: the greatest error over its bound.
const Usage = struct {
    edge: f32 = 0,
    nearness: f32 = 0,

    fn note(most: *f32, found: f128, computed: f32, bound: f32) !void {
        const used: f32 = @floatCast(@abs(found - computed) / bound);
        try std.testing.expect(used <= 1);
        most.* = @max(most.*, used);
    }

    /// Random errors come nowhere near the sum of the worst of each rounding: they use a
    /// fiftieth to a thirteenth of it.
    fn expectUsed(usage: *const Usage) !void {
        try std.testing.expect(usage.edge > 0.01 and usage.nearness > 0.01);
    }
};

/// Measures triangles in lanes at one ray: forms at (u, v) by arithmetic on floats against the
/// truth, whose three edge functions and nearness come first, and both against the exact test of
/// the ray, where a hit at t is as near as `near` says.
fn expectBounds(
    usage: *Usage,
    projection: anytype,
    triangles: *const [4][3][3]f32,
    truth: *const [4][4]f128,
    line: ray_file.Line(Four),
    at: [2]f32,
    near: struct { base: f32 = 0, by_t: f32 = 0, by_inverse: f32 = 0 },
) !void {
    var corners: [3]Four.Vec3 = undefined;
    for (&corners, 0..) |*corner, index| {
        var axes: [3][4]f32 = undefined;
        for (triangles, 0..) |*each, lane| {
            for (&axes, each[index]) |*axis, value| axis[lane] = value;
        }
        corner.* =
            .{ .x = .fromArray(axes[0]), .y = .fromArray(axes[1]), .z = .fromArray(axes[2]) };
    }
    const shown = projection.project(Four, corners);
    const nearness = projection.nearness(Four, &shown.facet);
    // As long as the way from the origin, and a pad for it.
    const reach = shown.facet.reach.toArray();
    const pad = 32 * unit * @max(reach[0], reach[1], reach[2], reach[3]);
    const hit = triangle.intersect(Four, corners, line, pad);
    for (truth, 0..) |*true_values, lane| {
        const flip: f128 = if (shown.facet.det.lane(lane) < 0) -1 else 1;
        const slack = shown.slack.lane(lane);
        const turned = shown.facet.turned.lane(lane);
        var outside = false;
        var inside = true;
        for (shown.edge, true_values[0..3]) |edge, value| {
            const found = valueAt(edge, lane, at);
            try Usage.note(&usage.edge, flip * value, found, slack);
            outside = outside or found + slack < 0;
            inside = inside and found - slack > 0;
        }
        // Behind a common origin edge functions are those of no triangle.
        const met = hit.mask.lane(lane) and hit.t.lane(lane) > 0;
        if (turned and outside) try std.testing.expect(!met);
        if (turned and inside) try std.testing.expect(hit.mask.lane(lane));
        if (!nearness.decisive.lane(lane) or !(inside or met)) continue;
        const found = valueAt(nearness.form, lane, at);
        const size: f32 = @floatCast(@abs(true_values[3]));
        const bound = nearness.relative.lane(lane) * size + nearness.absolute.lane(lane);
        try Usage.note(&usage.nearness, true_values[3], found, bound);
        if (!met) continue;
        const t: f128 = hit.t.lane(lane);
        const exact = near.base + near.by_t * t + near.by_inverse / t;
        try Usage.note(&usage.nearness, exact, found, bound);
    }
}

fn valueAt(form: Linear(Four.F32), lane: usize, at: [2]f32) f32 {
    const one: Linear(f32) =
        .{ .u = form.u.lane(lane), .v = form.v.lane(lane), .one = form.one.lane(lane) };
    return one.at(Four.F32, .splat(at[0]), .splat(at[1])).lane(0);
}

/// Edge functions along `direction` from `origin`, and 1/t.
fn truthFrom(origin: [3]f32, corners: *const [3][3]f32, direction: Wide) [4]f128 {
    const from = wide(origin);
    const a = wide(corners[0]) - from;
    const b = wide(corners[1]) - from;
    const c = wide(corners[2]) - from;
    const two: Wide = @splat(2);
    const plane = wideCross(b - a, c - a);
    return .{
        wideDot(two * wideCross(b, c), direction),
        wideDot(two * wideCross(c, a), direction),
        wideDot(two * wideCross(a, b), direction),
        wideDot(plane, direction) / wideDot(plane, a),
    };
}

test "bounds of what the eye sees hold, and are not much too wide" {
    var generator = std.Random.DefaultPrng.init(21);
    const random = generator.random();
    var usage: Usage = .{};
    for (0..3000) |round| {
        const origin = randomVector(random, if (round % 5 == 0) 1e4 else 1);
        const forward = randomVector(random, 1);
        const length = vec3.length1(forward);
        const step = length * ([_]f32{ 1e-2, 1e-3, 1e-5 })[round % 3];
        var grid: Grid = .{
            .origin = origin,
            .corner = forward,
            .right = randomVector(random, step),
            .down = randomVector(random, step),
            .deviation_roundings = undefined,
        };
        grid.deviation_roundings = 4 * (vec3.length1(grid.corner) + grid.spread());
        const projection: GridProjection = .init(&grid, 1e9);
        const at = [2]f32{
            @floatFromInt(random.uintLessThan(u32, 16)), @floatFromInt(random.uintLessThan(u32, 16)),
        };
        const direction = grid.direction(at[0], at[1]);
        const distance = std.math.pow(f32, 10, random.float(f32) * 3 - 1);
        const place = vec3.add(origin, vec3.scale(direction, distance));
        var triangles: [4][3][3]f32 = undefined;
        var truth: [4][4]f128 = undefined;
        for (&triangles, &truth) |*corners, *values| {
            corners.* = randomTriangle(random, place, origin);
            values.* = truthFrom(origin, corners, wide(direction));
        }
        const line: ray_file.Line(Four) = .init(.splat(origin), .splat(direction));
        try expectBounds(&usage, projection, &triangles, &truth, line, at, .{ .by_inverse = 1 });
    }
    try usage.expectUsed();
}

test "bounds of what a point light sees hold, and are not much too wide" {
    var generator = std.Random.DefaultPrng.init(22);
    const random = generator.random();
    var usage: Usage = .{};
    for (0..3000) |round| {
        const origin = randomVector(random, if (round % 5 == 0) 1e4 else 1);
        const axis: u2 = @intCast(round % 3);
        var direction = randomVector(random, 3);
        direction[axis] = std.math.copysign(@abs(direction[axis]) + 1, direction[axis]);
        var projection: LightProjection = .{
            .origin = origin,
            .axis = axis,
            .sign = std.math.copysign(@as(f32, 1), direction[axis]),
            .slope = null,
        };
        const on_plane = projection.place(Four, .splat(direction));
        const at = [2]f32{ on_plane.u.lane(0), on_plane.v.lane(0) };
        projection.bound(@max(@abs(at[0]), @abs(at[1])), 1e9);
        const depth = @abs(direction[axis]);
        const distance = std.math.pow(f32, 10, random.float(f32) * 3 - 1);
        const place = vec3.add(origin, vec3.scale(direction, distance));
        var triangles: [4][3][3]f32 = undefined;
        var truth: [4][4]f128 = undefined;
        for (&triangles, &truth) |*corners, *values| {
            corners.* = randomTriangle(random, place, origin);
            values.* = truthFrom(origin, corners, wide(direction) / @as(Wide, @splat(depth)));
        }
        const line: ray_file.Line(Four) = .init(.splat(origin), .splat(direction));
        const near = 1 / depth;
        try expectBounds(&usage, projection, &triangles, &truth, line, at, .{ .by_inverse = near });
    }
    try usage.expectUsed();
}

/// Twice the areas between edges and a point on the plane, and minus the depth of the triangle
/// there; corners and point in the projection's order of axes, from its origin.
fn truthAlong(corners: *const [3]Wide, point: Wide, way: Wide) [4]f128 {
    var flat: [3][2]f128 = undefined;
    for (&flat, corners) |*place, corner| place.* = .{
        corner[0] - corner[2] * way[0] / way[2], corner[1] - corner[2] * way[1] / way[2],
    };
    const at = [2]f128{ point[0] - point[2] * way[0] / way[2], point[1] - point[2] * way[1] / way[2] };
    var truth: [4]f128 = undefined;
    for (truth[0..3], 0..) |*value, index| {
        const from = flat[(index + 1) % 3];
        const to = flat[(index + 2) % 3];
        value.* = (to[0] - from[0]) * (at[1] - from[1]) - (to[1] - from[1]) * (at[0] - from[0]);
    }
    const plane = wideCross(corners[1] - corners[0], corners[2] - corners[0]);
    const t = wideDot(plane, corners[0] - point) / wideDot(plane, way);
    truth[3] = -(point[2] + t * way[2]) * std.math.sign(way[2]);
    return truth;
}

test "bounds of what a directional light sees hold, and are not much too wide" {
    var generator = std.Random.DefaultPrng.init(23);
    const random = generator.random();
    var usage: Usage = .{};
    for (0..3000) |round| {
        const origin = randomVector(random, if (round % 5 == 0) 1e4 else 1);
        const point = vec3.add(origin, randomVector(random, 0.3));
        const axis: u2 = @intCast(round % 3);
        var way = randomVector(random, 1);
        way[axis] = std.math.copysign(vec3.length1(way), way[axis]);
        const turned = [3]usize{
            ray_file.turnedIndex(axis, 0), ray_file.turnedIndex(axis, 1), axis,
        };
        var projection: LightProjection = .{
            .origin = origin,
            .axis = axis,
            .sign = std.math.copysign(@as(f32, 1), way[axis]),
            .slope = .{ way[turned[0]] / way[axis], way[turned[1]] / way[axis] },
            .reach = vec3.length(vec3.sub(point, origin)),
        };
        projection.bound(@max(@abs(projection.slope.?[0]), @abs(projection.slope.?[1])), 1e9);
        const on_plane = projection.place(Four, .splat(vec3.sub(point, origin)));
        const distance = std.math.pow(f32, 10, random.float(f32) * 3 - 1);
        const place = vec3.sub(point, vec3.scale(way, distance));
        var triangles: [4][3][3]f32 = undefined;
        var truth: [4][4]f128 = undefined;
        for (&triangles, &truth) |*corners, *values| {
            corners.* = randomTriangle(random, place, point);
            var inner: [4]Wide = undefined;
            for (&inner, corners.* ++ [1][3]f32{point}) |*to, from| {
                const offset = wide(from) - wide(origin);
                inline for (0..3) |index| to[index] = offsetAt(offset, turned[index]);
            }
            const wide_way = wide(.{ way[turned[0]], way[turned[1]], way[axis] });
            values.* = truthAlong(inner[0..3], inner[3], wide_way);
        }
        const line: ray_file.Line(Four) = .init(.splat(point), .splat(vec3.neg(way)));
        const depth = (point[axis] - origin[axis]) * projection.sign;
        try expectBounds(&usage, projection, &triangles, &truth, line, .{
            on_plane.u.lane(0), on_plane.v.lane(0),
        }, .{ .base = -depth, .by_t = @abs(way[axis]) });
    }
    try usage.expectUsed();
}

fn offsetAt(offset: Wide, axis: usize) f128 {
    const components: [3]f128 = offset;
    return components[axis];
}
