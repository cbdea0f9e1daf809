//! Property tests of what beams take for granted: every bound on what rounding may do holds,
//! against 128-bit floats and the exact test, and is not much wider than need be.
//!
//! Edge functions and nearness of triangles as the eye and both kinds of light see them; planes
//! around a beam; bounds of shadow receivers. Inputs are random and nasty, seeds fixed.

const std = @import("std");
const raylane = @import("raylane");
const beam = raylane.trace.beam;
const Geometry = raylane.world.Geometry;
const Grid = raylane.trace.Grid;
const GridProjection = beam.projected_triangle.GridProjection;
const Light = raylane.world.Light;
const LightProjection = beam.projected_triangle.LightProjection;
const Linear = beam.projected_triangle.Linear;
const Members = beam.members.Members;
const ShadowReceivers = beam.shadow_receivers.ShadowReceivers;
const kernel_file = raylane.trace.kernel;
const bundle_file = raylane.trace.bundle;
const ray_file = raylane.trace.ray;
const triangle = raylane.trace.triangle;
const vec3 = raylane.math.vec3;

const inf = std.math.inf(f32);
/// Half a unit in the last place of 1.
const unit = 0x1p-24;
const subtile_count = kernel_file.beam_subtiles;
const subtile_pixels = kernel_file.subtile_pixels;
const pixel_count = kernel_file.beam_pixels;
const Four = raylane.simd.Lanes(.vector, 4);
const Wide = @Vector(3, f128);

const padding: raylane.world.Padding = .init(@splat(0), .empty);

/// A geometry of which nothing is asked but its padding.
fn paddedGeometry() Geometry {
    var geometry: Geometry = undefined;
    geometry.padding = padding;
    return geometry;
}

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
    @setEvalBranchQuota(4000); // For what is inlined here.
    const corners = inLanes(triangles);
    const shown = projection.project(Four, corners);
    const nearness = projection.nearness(Four, &shown.facet);
    const hit = triangle.intersect(Four, corners, line, &padding);
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

fn inLanes(triangles: *const [4][3][3]f32) [3]Four.Vec3 {
    var corners: [3]Four.Vec3 = undefined;
    for (&corners, 0..) |*corner, index| {
        var axes: [3][4]f32 = undefined;
        for (triangles, 0..) |*each, lane| {
            for (&axes, each[index]) |*axis, value| axis[lane] = value;
        }
        corner.* =
            .{ .x = .fromArray(axes[0]), .y = .fromArray(axes[1]), .z = .fromArray(axes[2]) };
    }
    return corners;
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
    var windowed_count: u32 = 0;
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
            .deviation_ulps = undefined,
        };
        grid.deviation_ulps = 4 * (vec3.length1(grid.corner) + grid.spread());
        const projection: GridProjection = .init(&grid);
        const at = [2]f32{
            @floatFromInt(random.uintLessThan(u32, 16)),
            @floatFromInt(random.uintLessThan(u32, 16)),
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
        if (grid.depthNormal() == null) continue;
        windowed_count += try expectWindows(&grid, projection, &triangles, line, at);
    }
    try usage.expectUsed();
    // Of the triangles that miss their pixel a window tells of some hundreds.
    try std.testing.expect(windowed_count > 300);
}

/// Fails where a pixel whose ray hits a triangle is out of its window. Returns how many windows do
/// not hold it.
fn expectWindows(
    grid: *const Grid,
    projection: GridProjection,
    triangles: *const [4][3][3]f32,
    line: ray_file.Line(Four),
    at: [2]f32,
) !u32 {
    @setEvalBranchQuota(4000); // For what is inlined here.
    const corners = inLanes(triangles);
    const facet = projection.project(Four, corners).facet;
    const window, const seen = beam.pixel_window.Dual.of(grid).windowOf(Four, corners, &facet);
    const hit = triangle.intersect(Four, corners, line, &padding);
    var outside_count: u32 = 0;
    for (0..4) |lane| {
        const x: i32 = @trunc(at[0]);
        const y: i32 = @trunc(at[1]);
        const holds = seen.lane(lane) and
            window.first_x.lane(lane) <= x and x <= window.last_x.lane(lane) and
            window.first_y.lane(lane) <= y and y <= window.last_y.lane(lane);
        if (hit.mask.lane(lane) and hit.t.lane(lane) > 0) try std.testing.expect(holds);
        outside_count += @intFromBool(!holds);
    }
    return outside_count;
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
        projection.bound(@max(@abs(at[0]), @abs(at[1])));
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
    const at = [2]f128{
        point[0] - point[2] * way[0] / way[2], point[1] - point[2] * way[1] / way[2],
    };
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
        projection.bound(@max(@abs(projection.slope.?[0]), @abs(projection.slope.?[1])));
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

/// A random tile, and what a point may be seen at.
const Tile = struct {
    grid: Grid,
    frustum: beam.frustum.Frustum(Four),
    /// By how much its planes stand off.
    slack: f32,

    fn init(random: std.Random, place: f32, reach: f32) ?Tile {
        var grid: Grid = undefined;
        for (&grid.origin, &grid.corner, &grid.right, &grid.down) |*at, *to, *right, *down| {
            at.* = random.floatNorm(f32) * place;
            to.* = random.floatNorm(f32);
            right.* = random.floatNorm(f32) * 1e-2;
            down.* = random.floatNorm(f32) * 1e-2;
        }
        const sides = grid.sides() orelse return null;
        const along = grid.depthNormal() orelse return null;
        const slack: beam.frustum.Slack = .{
            .apart = beam.frustum.apartOf(&padding, grid.origin),
            .by_depth = beam.frustum.by_distance * grid.longest(),
        };
        return .{
            .grid = grid,
            .frustum = .init(grid.origin, sides, along, slack),
            .slack = slack.apart + 2 * beam.frustum.by_distance * reach,
        };
    }

    /// A box from `lower` to `upper` as the third child of a node.
    fn meets(tile: *const Tile, lower: [3]f32, upper: [3]f32, depth_max: f32) ?f32 {
        var node: raylane.world.Node(4) = .empty;
        node.setChildBox(2, .{ .lower = lower, .upper = upper });
        const met = tile.frustum.meet(&node, depth_max);
        return if (met.mask.lane(2)) met.near.lane(2) else null;
    }
};

test "no box or triangle that a ray reaches is culled; what is well beside the beam is" {
    var generator = std.Random.DefaultPrng.init(31);
    const random = generator.random();
    var tile_count: u32 = 0;
    for (0..4000) |round| {
        const reach: f32 = ([_]f32{ 1, 50, 1e4 })[round % 3];
        const tile = Tile.init(random, if (round % 4 == 0) 1e4 else 1, reach) orelse continue;
        tile_count += 1;
        const grid = &tile.grid;
        const x: f32 = @floatFromInt(random.uintLessThan(u32, 16));
        const y: f32 = @floatFromInt(random.uintLessThan(u32, 16));
        const direction = grid.direction(x, y);
        // On the ray in 128 bits, then the next float of either side.
        const t = random.float(f32) * reach / vec3.length1(direction);
        var lower: [3]f32 = undefined;
        var upper: [3]f32 = undefined;
        for (&lower, &upper, grid.origin, direction) |*low, *high, from, way| {
            const exact = @as(f128, from) + @as(f128, t) * @as(f128, way);
            const rounded: f32 = @floatCast(exact);
            low.* = if (rounded > exact) std.math.nextAfter(f32, rounded, -1e9) else rounded;
            high.* = if (rounded < exact) std.math.nextAfter(f32, rounded, 1e9) else rounded;
        }
        const near = tile.meets(lower, upper, inf);
        try std.testing.expect(near != null and near.? <= t);
        try std.testing.expect(tile.meets(lower, upper, t) != null);
        const Vec3 = Four.Vec3;
        const corners = [3]Vec3{ .splat(lower), .splat(upper), .splat(lower) };
        try std.testing.expect(tile.frustum.mayMeet(corners).all());
        // As far beyond a plane as twice what it stands off.
        for (tile.frustum.sides) |plane| {
            const far = 2 * tile.slack + 2 * reach * 0x1p-20;
            const length = vec3.dot(plane.normal, plane.normal);
            const out = -far * vec3.length1(plane.normal) / length;
            const beyond = vec3.add(grid.origin, vec3.scale(plane.normal, out));
            try std.testing.expectEqual(null, tile.meets(beyond, beyond, inf));
        }
    }
    try std.testing.expect(tile_count > 1000);
}

/// Rays of a tile that end on a rough plane, or scattered.
fn randomBundle(
    comptime Kernel: type,
    random: std.Random,
    light: *const Light,
    scattered: bool,
) bundle_file.Bundle(Kernel) {
    var bundle: bundle_file.Bundle(Kernel) = undefined;
    var axes: [3][3]f32 = undefined;
    for (&axes) |*axis| for (axis) |*component| {
        component.* = random.floatNorm(f32);
    };
    const spread: f32 = if (scattered) 1 else 1e-3;
    for (&bundle.groups, 0..) |*group, index| {
        var point: [3][Kernel.ray_count]f32 = undefined;
        var active: [Kernel.ray_count]bool = undefined;
        for (&active, 0..) |*is_active, lane| {
            is_active.* = !scattered or random.float(f32) < 0.8;
            const x = @as(f32, @floatFromInt(Kernel.pixelX(index, lane))) * 0.02;
            const y = @as(f32, @floatFromInt(Kernel.pixelY(index, lane))) * 0.02;
            for (&point, 0..) |*component, axis| component[lane] = axes[0][axis] +
                x * axes[1][axis] + y * axes[2][axis] + spread * random.floatNorm(f32);
        }
        const ends: Kernel.Rays.Vec3 =
            .{ .x = .fromArray(point[0]), .y = .fromArray(point[1]), .z = .fromArray(point[2]) };
        const none: Kernel.Rays.Vec3 = .splat(light.position);
        group.active = .fromArray(active);
        group.skip = .splat(ray_file.no_primitive);
        group.closest = .before(.splat(if (light.kind == .point) 1 else inf));
        group.line = if (light.kind == .point)
            .init(none, ends.sub(none))
        else
            .init(ends, .splat(.{ -light.direction[0], -light.direction[1], -light.direction[2] }));
    }
    return bundle;
}

/// Whether bounds of subtiles and of all hold every member, and the planes around them the way from
/// the light; places are those of the rays' own numbers in 128 bits.
fn expectEnclosed(
    comptime Kernel: type,
    set: *const ShadowReceivers(Kernel),
    members: *const Members,
    random: std.Random,
) !void {
    const projection = &set.projection;
    var ends: [2][2]f128 = @splat(.{ inf, -inf });
    for (0..pixel_count) |pixel| {
        const subtile = pixel / subtile_pixels;
        if (members[subtile] >> @intCast(pixel % subtile_pixels) & 1 == 0) continue;
        const group = &set.bundle.groups[pixel / Kernel.ray_count];
        const lane = pixel % Kernel.ray_count;
        const origin = group.line.origin.lane(lane);
        const direction = group.line.direction.lane(lane);
        var from: [3]f128 = undefined;
        var way: [3]f128 = undefined;
        for (&from, &way, 0..) |*start, *along, index| {
            const axis = projection.axisAt(index);
            start.* = @as(f128, origin[axis]) - projection.origin[axis];
            along.* = direction[axis];
        }
        const depth = if (projection.slope == null) way[2] else from[2];
        const flat: [2]f128 = if (projection.slope == null)
            .{ way[0] / way[2], way[1] / way[2] }
        else
            .{ from[0] - from[2] * way[0] / way[2], from[1] - from[2] * way[1] / way[2] };
        const basis = &set.basis;
        const axes = [2]f128{
            flat[0] * basis.i00 + flat[1] * basis.i01,
            flat[0] * basis.i10 + flat[1] * basis.i11,
        };
        const all = [2][2]f32{ set.bounds.u, set.bounds.v };
        const subtiles = [2]*const [2][subtile_count]f32{ &set.subtile_u, &set.subtile_v };
        for (axes, all, subtiles, &ends) |at, bounds, own, *end| {
            try std.testing.expect(bounds[0] <= at and at <= bounds[1]);
            try std.testing.expect(own[0][subtile] <= at and at <= own[1][subtile]);
            end.* = .{ @min(end[0], at), @max(end[1], at) };
        }
        const farthest: f128 = @as(f128, set.bounds.depth) * (1 + 0x1p-20) + 0x1p-20;
        try std.testing.expect(depth * projection.sign <= farthest);
        // A point on the way between light and receiver.
        const share: f32 = random.float(f32) * @as(f32, if (projection.slope == null) 1 else 3);
        var corner: [3]f32 = undefined;
        for (&corner, origin, direction) |*to, start, along| to.* = start + share * along;
        const at: Kernel.Boxes.Vec3 = .splat(corner);
        try std.testing.expect(set.frustum.mayMeet(.{ at, at, at }).all());
    }
    // Not wider than what is there by more than some hundred ulps of the largest number.
    for (ends, [2][2]f32{ set.bounds.u, set.bounds.v }) |end, bounds| {
        const size = @max(1, @abs(end[0]), @abs(end[1]), projection.reach);
        const margin = 0x1p-14 * size * set.basis.norm();
        try std.testing.expect(bounds[0] >= end[0] - margin and bounds[1] <= end[1] + margin);
    }
}

test "bounds and planes hold every receiver and the light's way to it, and little more" {
    var generator = std.Random.DefaultPrng.init(41);
    const random = generator.random();
    inline for (.{ 4, 16 }) |lanes| {
        const Kernel = kernel_file
            .Kernel(.{ .backend = .vector, .traversal = .beam, .lanes = lanes }, false);
        for (0..60) |round| {
            var light: Light = .{
                .kind = if (round % 2 == 0) .point else .directional,
                .position = undefined,
                .from_receiver = false,
                .direction = undefined,
                .intensity = @splat(1),
                .range_inv_squared = 0,
                .cone_scale = 0,
                .cone_offset = 1,
            };
            for (&light.position, &light.direction) |*at, *way| {
                at.* = random.floatNorm(f32) * 4;
                way.* = random.floatNorm(f32);
            }
            var bundle = randomBundle(Kernel, random, &light, round % 3 == 0);
            const geometry = paddedGeometry();
            var set: ShadowReceivers(Kernel) = undefined;
            set.geometry = &geometry;
            set.bundle = &bundle;
            var members = beam.members.activeOf(Kernel, &bundle);
            const count = beam.members.count(&members);
            const rest = beam.shadow_plane.place(Kernel, &set, &light, &members);
            try std.testing.expectEqual(count, beam.members.count(&members) +
                beam.members.count(&rest));
            if (beam.members.count(&members) == 0) continue;
            beam.shadow_plane.encloseRays(Kernel, &set);
            try expectEnclosed(Kernel, &set, &members, random);
        }
    }
}
