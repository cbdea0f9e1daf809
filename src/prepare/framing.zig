//! Automatic framing: a camera with all of the scene in its picture, as large as a margin allows.
//!
//! In: the triangles and the picture's aspect. Out: a perspective camera. The direction is a
//! three-quarter view, unless hardly a front would be seen from there; the position is the nearest
//! that has every vertex within the frame, found on the vertices themselves, not on a box or ball
//! around them. f64 throughout, and a margin far above the rounding of the result to f32.

const std = @import("std");
const math = @import("../math.zig");
const scene = @import("../scene.zig");
const world = @import("../world.zig");
const assert = std.debug.assert;
const vec3 = math.vec3;
const Vec3 = math.Vec3;
const Vec3d = math.Vec3d;
const vec3d = math.vec3d;

/// Share of the picture's width or height that stays free on each side.
pub const margin = 0.04;

/// Farthest from the middle that a vertex may be, where the border is 1.
const extent_max: f64 = 1 - 2 * margin;

/// Full angle of view across the shorter side of the picture, in radians: 40 degrees.
const field_of_view_rad: f64 = 40.0 * std.math.pi / 180.0;

/// The longer side sees at most this many times as much, so that a strip is no fisheye.
const aspect_max: f64 = 2;

/// Rounds of centring at most; a round that moves nothing ends them, usually the third.
const centering_round_max = 16;

/// A direction to look from: degrees to the right of +z, degrees above the horizon.
const Direction = struct { azimuth_degrees: f64, elevation_degrees: f64 };

/// The views to choose from, best liked first: front before back, level before steep before below.
const directions = [12]Direction{
    .{ .azimuth_degrees = 30, .elevation_degrees = 20 },
    .{ .azimuth_degrees = -30, .elevation_degrees = 20 },
    .{ .azimuth_degrees = 30, .elevation_degrees = 45 },
    .{ .azimuth_degrees = -30, .elevation_degrees = 45 },
    .{ .azimuth_degrees = 150, .elevation_degrees = 20 },
    .{ .azimuth_degrees = -150, .elevation_degrees = 20 },
    .{ .azimuth_degrees = 150, .elevation_degrees = 45 },
    .{ .azimuth_degrees = -150, .elevation_degrees = 45 },
    .{ .azimuth_degrees = 30, .elevation_degrees = -30 },
    .{ .azimuth_degrees = -30, .elevation_degrees = -30 },
    .{ .azimuth_degrees = 150, .elevation_degrees = -30 },
    .{ .azimuth_degrees = -150, .elevation_degrees = -30 },
};

/// A view is good enough when it shows at least this share of what the best one shows.
const visible_share_min = 0.5;

/// Triangles looked at for the choice of the direction, at most (evenly spread).
const sample_count_max = 1 << 16;

/// Three axes of unit length, right-handed: right x up = back.
const Basis = struct { right: Vec3d, up: Vec3d, forward: Vec3d };

/// The camera. `aspect` is width over height; memory from `gpa` is returned before the end.
pub fn frame(
    gpa: std.mem.Allocator,
    geometry: *const world.Geometry,
    materials: []const scene.Material,
    aspect: f64,
) error{OutOfMemory}!world.Camera {
    assert(aspect > 0 and aspect < std.math.inf(f64));
    const half = halfTangents(aspect);
    const basis = basisOf(directions[chooseDirection(geometry, materials)]);
    const points = try usedVertices(gpa, geometry, basis);
    defer gpa.free(points.vertices);
    const place = fit(points.vertices, half);
    var origin = points.center;
    inline for (.{ basis.right, basis.up, basis.forward }, place) |axis, along| {
        for (&origin, axis) |*to, component| to.* += along * points.size * component;
    }
    return .{
        .orthographic = false,
        .origin = vec3d.toSingle(origin),
        .right = vec3d.toSingle(vec3d.scale(basis.right, half[0])),
        .up = vec3d.toSingle(vec3d.scale(basis.up, half[1])),
        .forward = vec3d.toSingle(basis.forward),
    };
}

/// Tangents of half the horizontal and half the vertical angle of view.
fn halfTangents(aspect: f64) [2]f64 {
    const shorter = math.elementary.tan(field_of_view_rad / 2);
    const ratio = if (aspect < 1) 1 / aspect else aspect;
    const narrowed = if (ratio > aspect_max) shorter * aspect_max / ratio else shorter;
    const longer = narrowed * ratio;
    return if (aspect < 1) .{ narrowed, longer } else .{ longer, narrowed };
}

/// The axes of a camera that looks from `direction` at the middle.
fn basisOf(direction: Direction) Basis {
    const azimuth_rad = direction.azimuth_degrees * std.math.pi / 180.0;
    const elevation_rad = direction.elevation_degrees * std.math.pi / 180.0;
    const sin_azimuth = math.elementary.sin(azimuth_rad);
    const cos_azimuth = math.elementary.cos(azimuth_rad);
    const sin_elevation = math.elementary.sin(elevation_rad);
    const cos_elevation = math.elementary.cos(elevation_rad);
    assert(cos_elevation > 0.1);
    return .{
        .right = .{ cos_azimuth, 0, -sin_azimuth },
        .up = .{ -sin_azimuth * sin_elevation, cos_elevation, -cos_azimuth * sin_elevation },
        .forward = .{ -sin_azimuth * cos_elevation, -sin_elevation, -cos_azimuth * cos_elevation },
    };
}

/// Index of the first direction that shows enough: the area of fronts (and backs, where they are
/// seen too) projected along it. What stands in front of what is not looked at.
fn chooseDirection(geometry: *const world.Geometry, materials: []const scene.Material) usize {
    var toward: [directions.len]Vec3 = undefined;
    for (directions, &toward) |direction, *to| {
        to.* = vec3.neg(vec3d.toSingle(basisOf(direction).forward));
    }
    var visible: [directions.len]f64 = @splat(0);
    const stride = geometry.triangles.len / sample_count_max + 1;
    var index: usize = 0;
    while (index < geometry.triangles.len) : (index += stride) {
        const triangle = &geometry.triangles[index];
        const a = geometry.positions[triangle.corner[0]];
        const normal = vec3.cross(
            vec3.sub(geometry.positions[triangle.corner[1]], a),
            vec3.sub(geometry.positions[triangle.corner[2]], a),
        );
        const back: f32 = if (materials[triangle.material].double_sided) -1 else 0;
        for (toward, &visible) |to, *sum| {
            const projected = vec3.dot(normal, to);
            sum.* += if (projected > 0) projected else projected * back;
        }
    }
    var best: f64 = 0;
    for (visible) |sum| best = if (sum > best) sum else best;
    for (visible, 0..) |sum, choice| {
        if (sum >= best * visible_share_min) return choice;
    }
    unreachable; // The best one passes.
}

/// The vertices that triangles use, along the axes of a camera: relative to the middle of the
/// scene, in units of its size, right, up and forward.
const Points = struct { vertices: []Vec3d, center: Vec3d, size: f64 };

fn usedVertices(
    gpa: std.mem.Allocator,
    geometry: *const world.Geometry,
    basis: Basis,
) error{OutOfMemory}!Points {
    if (geometry.triangles.len == 0) {
        const vertices = try gpa.alloc(Vec3d, 1);
        vertices[0] = .{ 0, 0, 0 };
        return .{ .vertices = vertices, .center = .{ 0, 0, 0 }, .size = 1 };
    }
    var used: std.DynamicBitSetUnmanaged = try .initEmpty(gpa, geometry.positions.len);
    defer used.deinit(gpa);
    for (geometry.triangles) |triangle| {
        for (triangle.corner) |vertex| used.set(vertex);
    }
    var points: Points = .{
        .vertices = try gpa.alloc(Vec3d, used.count()),
        .center = undefined,
        .size = 0,
    };
    for (&points.center, geometry.bounds.lower, geometry.bounds.upper) |*middle, lower, upper| {
        middle.* = (@as(f64, lower) + upper) / 2;
        const extent = @as(f64, upper) - lower;
        points.size = if (extent > points.size) extent else points.size;
    }
    assert(points.size > 0); // Triangles without an extent have no area.
    var iterator = used.iterator(.{});
    for (points.vertices) |*vertex| {
        var relative: Vec3d = undefined;
        for (&relative, geometry.positions[iterator.next().?], points.center) |*to, from, middle| {
            to.* = (from - middle) / points.size;
        }
        vertex.* = .{
            vec3d.dot(relative, basis.right),
            vec3d.dot(relative, basis.up),
            vec3d.dot(relative, basis.forward),
        };
    }
    return points;
}

/// Where a camera has to stand, in its own axes, to have all of `points` (at least one) within the
/// frame, as near as can be, in the middle of both axes.
///
/// A side plane of the frame through the camera c, of slope s = extent_max * half, holds a point p
/// when p.x - s p.z <= c.x - s c.z, its opposite when -p.x - s p.z <= -c.x - s c.z. The sum of both
/// bounds c.z alone; the axis that binds is centred when both are equalities.
fn fit(points: []const Vec3d, half: [2]f64) Vec3d {
    assert(points.len > 0);
    const slope: [2]f64 = .{ half[0] * extent_max, half[1] * extent_max };
    var side: [2][2]f64 = @splat(@splat(-std.math.inf(f64)));
    var nearest: f64 = std.math.inf(f64);
    for (points) |p| {
        for (0..2) |axis| {
            const past = slope[axis] * p[2];
            side[axis][0] = larger(side[axis][0], p[axis] - past);
            side[axis][1] = larger(side[axis][1], -p[axis] - past);
        }
        nearest = if (p[2] < nearest) p[2] else nearest;
    }
    var place: Vec3d = .{ 0, 0, nearest - 0.01 }; // A point has no size to be framed by.
    for (0..2) |axis| {
        const z = -(side[axis][0] + side[axis][1]) / (2 * slope[axis]);
        place[2] = if (z < place[2]) z else place[2];
    }
    for (0..2) |axis| {
        const guess = (side[axis][0] - side[axis][1]) / 2;
        place[axis] = center(points, axis, guess, place[2]);
    }
    return place;
}

/// The coordinate along `axis` from which the outermost points of both sides are seen equally far
/// from the middle, by a camera at depth `camera_z`. From a guess, the pair of points that are
/// outermost is centred, until the pair stays the same.
fn center(points: []const Vec3d, axis: usize, guess: f64, camera_z: f64) f64 {
    var place = guess;
    for (0..centering_round_max) |_| {
        var low: Vec3d = points[0];
        var high: Vec3d = points[0];
        var lowest: f64 = std.math.inf(f64);
        var highest: f64 = -std.math.inf(f64);
        for (points) |p| {
            const seen = (p[axis] - place) / (p[2] - camera_z);
            if (seen < lowest) {
                lowest = seen;
                low = p;
            }
            if (seen > highest) {
                highest = seen;
                high = p;
            }
        }
        // (high - c) / z_high = (c - low) / z_low
        const z_low = low[2] - camera_z;
        const z_high = high[2] - camera_z;
        assert(z_low > 0 and z_high > 0);
        const next = (high[axis] * z_low + low[axis] * z_high) / (z_low + z_high);
        if (next == place) break;
        place = next;
    }
    return place;
}

fn larger(a: f64, b: f64) f64 {
    return if (a > b) a else b;
}

const TestShape = struct {
    positions: []const Vec3,
    triangles: []const world.Triangle,

    fn geometry(shape: TestShape) world.Geometry {
        var bounds: math.Box3 = .empty;
        for (shape.triangles) |triangle| {
            for (triangle.corner) |vertex| bounds = bounds.include(shape.positions[vertex]);
        }
        var shown: world.Geometry = .empty;
        shown.positions = shape.positions;
        shown.triangles = shape.triangles;
        shown.bounds = bounds;
        return shown;
    }
};

const TestView = struct { lowest: [2]f64, highest: [2]f64 };

/// Where the used vertices lie in the picture of `camera`, whose border is at -1 and 1.
fn project(camera: *const world.Camera, geometry: *const world.Geometry) TestView {
    var view: TestView = .{
        .lowest = @splat(std.math.inf(f64)),
        .highest = @splat(-std.math.inf(f64)),
    };
    for (geometry.triangles) |triangle| {
        for (triangle.corner) |vertex| {
            const relative = vec3.sub(geometry.positions[vertex], camera.origin);
            const depth = vec3.dot(relative, camera.forward);
            assert(depth > 0);
            const axes = .{ camera.right, camera.up };
            inline for (axes, 0..) |axis, index| {
                const seen = vec3.dot(relative, axis) / (depth * vec3.dot(axis, axis));
                view.lowest[index] = @min(view.lowest[index], seen);
                view.highest[index] = @max(view.highest[index], seen);
            }
        }
    }
    return view;
}

test "every vertex is inside, one axis touches the margin, both are centred" {
    const gpa = std.testing.allocator;
    var random: std.Random.DefaultPrng = .init(5);
    const materials = [_]scene.Material{.{ .double_sided = true }};
    const aspects = [_]f64{ 1, 4.0 / 3.0, 0.25, 7, 100 };
    for ([_]f32{ 1, 1e-9, 1e9 }) |size| {
        for (aspects) |aspect| {
            var positions: [60]Vec3 = undefined;
            for (&positions) |*position| {
                for (position, [_]f32{ 1, 3, 0.5 }) |*coordinate, stretch| {
                    coordinate.* = (random.random().float(f32) + 0.3) * stretch * size;
                }
            }
            positions[7] = .{ 1e20, 0, 0 }; // Not used by a triangle.
            var triangles: [30]world.Triangle = undefined;
            for (&triangles) |*triangle| {
                triangle.material = 0;
                for (&triangle.corner) |*vertex| {
                    vertex.* = random.random().intRangeAtMost(u32, 8, 59);
                }
            }
            const shape: TestShape = .{ .positions = &positions, .triangles = &triangles };
            const geometry = shape.geometry();
            const camera = try frame(gpa, &geometry, &materials, aspect);
            const view = project(&camera, &geometry);
            var outermost: f64 = 0;
            for (view.lowest, view.highest) |lowest, highest| {
                try std.testing.expectApproxEqAbs(-lowest, highest, 1e-4);
                outermost = larger(outermost, highest);
            }
            try std.testing.expectApproxEqAbs(extent_max, outermost, 1e-4);
        }
    }
}

test "a face is seen from its front, at a fair angle, whichever way it looks" {
    const gpa = std.testing.allocator;
    for (0..3) |axis| {
        for ([_]bool{ false, true }) |flipped| {
            for ([_]bool{ false, true }) |double_sided| {
                var positions: [3]Vec3 = @splat(.{ 0, 0, 0 });
                positions[1][(axis + 1) % 3] = 1;
                positions[2][(axis + 2) % 3] = 1;
                if (flipped) std.mem.swap(Vec3, &positions[1], &positions[2]);
                const shape: TestShape = .{
                    .positions = &positions,
                    .triangles = &.{.{ .corner = .{ 0, 1, 2 }, .material = 0 }},
                };
                const materials = [_]scene.Material{.{ .double_sided = double_sided }};
                const camera = try frame(gpa, &shape.geometry(), &materials, 1);
                const cosine = -camera.forward[axis] * @as(f32, if (flipped) -1 else 1);
                const shown = if (double_sided) @abs(cosine) else cosine;
                try std.testing.expect(shown > 0.3);
            }
        }
    }
}

test "the usual view comes from the front, the right and above" {
    const shape: TestShape = .{
        .positions = &.{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } },
        .triangles = &.{.{ .corner = .{ 0, 1, 2 }, .material = 0 }},
    };
    const materials = [_]scene.Material{.{}};
    const camera = try frame(std.testing.allocator, &shape.geometry(), &materials, 1);
    try std.testing.expectApproxEqAbs(@as(f32, -0.4698463), camera.forward[0], 1e-6);
    try std.testing.expectApproxEqAbs(@as(f32, -0.3420201), camera.forward[1], 1e-6);
    try std.testing.expect(camera.right[1] == 0 and camera.up[1] > 0);
    const back = vec3.normalize(vec3.cross(camera.right, camera.up)).?;
    for (back, camera.forward) |b, f| try std.testing.expectApproxEqAbs(-b, f, 1e-6);
}

test "nothing to see still makes a camera" {
    const shape: TestShape = .{ .positions = &.{}, .triangles = &.{} };
    const camera = try frame(std.testing.allocator, &shape.geometry(), &.{}, 1.5);
    try std.testing.expect(vec3.isFinite(camera.origin));
    try std.testing.expectApproxEqRel(@as(f32, 1), vec3.length(camera.forward), 1e-6);
    try std.testing.expect(vec3.length(camera.right) > vec3.length(camera.up));
}
