//! Automatic framing: a camera with all of the scene in its picture, as large as a margin allows.
//!
//! In: the triangles, their materials and the picture's aspect; points and lines count by their
//! vertices. Out: a camera, or the direction, the middle and the distance for one that is placed
//! otherwise. What is transparent everywhere does not count. A flat model is seen from its front,
//! others in a three-quarter view, unless hardly a front would be seen from there; the position is
//! the nearest that has every vertex within the frame, found on the vertices themselves, not on a
//! box or ball around them. f64 throughout, and a margin far above the rounding of the result to
//! f32.

const std = @import("std");
const math = @import("../math.zig");
const scene = @import("../scene.zig");
const world = @import("../world.zig");
const assert = std.debug.assert;
const Cursor = world.Cursor;
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

/// Rounds of fitting a camera to what it sees at most; a round that shows nothing new ends them.
const facing_round_max = 6;

/// Sine of the angle by which a face may be turned away and still counts as seen.
const facing_sine_min = -1e-3;

/// A direction to look from: degrees to the right of +z, degrees above the horizon.
const Direction = struct { azimuth_degrees: f64, elevation_degrees: f64 };

/// The views to choose from, best liked first: front before back, level before steep before below.
/// For what lies flat on the ground the first two, rather level, are left out.
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

/// The views of boards that stand upright, as signs and shelves do, to choose from: nearer to their
/// fronts, so that what is on them can be read. For boards that face x, a quarter turn is added.
const board_directions = [8]Direction{
    .{ .azimuth_degrees = 15, .elevation_degrees = 10 },
    .{ .azimuth_degrees = -15, .elevation_degrees = 10 },
    .{ .azimuth_degrees = 165, .elevation_degrees = 10 },
    .{ .azimuth_degrees = -165, .elevation_degrees = 10 },
    .{ .azimuth_degrees = 15, .elevation_degrees = 45 },
    .{ .azimuth_degrees = 165, .elevation_degrees = 45 },
    .{ .azimuth_degrees = 15, .elevation_degrees = -45 },
    .{ .azimuth_degrees = 165, .elevation_degrees = -45 },
};

/// The surface of a board is spread along its normal by at most that share of what it is along both
/// other axes (standard deviations).
const board_depth_max = 0.25;

/// A view is good enough when it shows at least this share of what the best one shows.
const visible_share_min = 0.5;

/// A model is flat when the area projected along its normal is at least this share of all area, and
/// its depth at most that share of its size.
const flat: struct { area_min: f64, depth_max: f64 } = .{ .area_min = 0.98, .depth_max = 0.05 };

/// How far the camera is from a single point, in units of `Subject.size`.
const point_distance = 0.01;

/// How far an orbit's camera is from lines that it sees end on, in units of `Subject.size` over the
/// slope of the picture's side.
const end_distance = 0.1;

/// Triangles looked at for the choice of the direction, at most (evenly spread).
const sample_count_max = 1 << 16;

/// Three axes of unit length, right-handed: right x up = back.
pub const Basis = struct {
    right: Vec3d,
    up: Vec3d,
    forward: Vec3d,

    /// Looks along `forward`, of unit length, with `up_hint` upwards as far as can be. Where the
    /// two are parallel, up is where an orbit of theta 0 has it at its poles, or y.
    pub fn look(forward: Vec3d, up_hint: Vec3d) Basis {
        const hint = vec3d.normalize(up_hint) orelse Vec3d{ 0, 1, 0 };
        var right = vec3d.cross(forward, hint);
        if (vec3d.length(right) < 1e-7) {
            const is_vertical = @abs(forward[1]) > 0.9;
            const pole: Vec3d = .{ 0, 0, if (forward[1] > 0) 1 else -1 };
            right = vec3d.cross(forward, if (is_vertical) pole else .{ 0, 1, 0 });
        }
        right = vec3d.normalize(right).?;
        return .{ .right = right, .up = vec3d.cross(right, forward), .forward = forward };
    }

    /// Looks at the middle from `azimuth_rad` to the right of +z and `elevation_rad` above the
    /// horizon; at the poles, up is what it is just beside them.
    pub fn ofAngles(azimuth_rad: f64, elevation_rad: f64) Basis {
        const sin_azimuth = math.elementary.sin(azimuth_rad);
        const cos_azimuth = math.elementary.cos(azimuth_rad);
        const sin_elevation = math.elementary.sin(elevation_rad);
        const cos_elevation = math.elementary.cos(elevation_rad);
        return .{
            .right = .{ cos_azimuth, 0, -sin_azimuth },
            .up = .{ -sin_azimuth * sin_elevation, cos_elevation, -cos_azimuth * sin_elevation },
            .forward = .{
                -sin_azimuth * cos_elevation,
                -sin_elevation,
                -cos_azimuth * cos_elevation,
            },
        };
    }

    fn ofDirection(direction: Direction) Basis {
        const degrees = std.math.pi / 180.0;
        const azimuth_rad = direction.azimuth_degrees * degrees;
        return .ofAngles(azimuth_rad, direction.elevation_degrees * degrees);
    }
};

/// Tangent of half an angle.
pub fn halfTangent(degrees: f64) f64 {
    return math.elementary.tan(degrees * std.math.pi / 360.0);
}

/// Tangents of half the horizontal and half the vertical angle of view. `fov_degrees` is the whole
/// vertical angle; null: one that suits the picture's shape.
pub fn halfTangents(fov_degrees: ?f32, aspect: f64) [2]f64 {
    assert(aspect > 0 and aspect < std.math.inf(f64));
    if (fov_degrees) |degrees| {
        const vertical = halfTangent(degrees);
        return .{ vertical * aspect, vertical };
    }
    const shorter = math.elementary.tan(field_of_view_rad / 2);
    const ratio = if (aspect < 1) 1 / aspect else aspect;
    const narrowed = if (ratio > aspect_max) shorter * aspect_max / ratio else shorter;
    const longer = narrowed * ratio;
    return if (aspect < 1) .{ narrowed, longer } else .{ longer, narrowed };
}

/// What is to be seen: the vertices of triangles, points and lines that are not transparent
/// everywhere.
pub const Subject = struct {
    shown: Shown,
    /// The vertices that count, at least one of them unless the scene is empty.
    used: std.DynamicBitSetUnmanaged,
    /// The middle of their box, and its longest side, > 0.
    center: Vec3d,
    size: f64,
    /// All of it is at one place, and `size` made up.
    is_point: bool = false,
    /// The axes of the camera that shows it best.
    basis: Basis,

    /// Memory comes from `gpa`; geometry and materials must outlive the subject.
    pub fn init(
        gpa: std.mem.Allocator,
        geometry: *const world.Geometry,
        materials: []const scene.Material,
    ) error{OutOfMemory}!Subject {
        var subject: Subject = .{
            .shown = .{ .geometry = geometry, .materials = materials },
            .used = try .initEmpty(gpa, geometry.vertexCount()),
            .center = .{ 0, 0, 0 },
            .size = 1,
            .basis = .ofDirection(directions[0]),
        };
        subject.markShown();
        if (subject.used.findFirstSet() == null) {
            subject.shown.all = true;
            subject.markShown();
        }
        if (subject.used.findFirstSet() == null) return subject;
        errdefer subject.deinit(gpa);
        const bounds = subject.measure();
        const samples: Samples = try .init(gpa, &subject.shown);
        defer samples.deinit(gpa);
        subject.basis = chooseBasis(&samples, bounds);
        return subject;
    }

    /// Frees what `init` made.
    pub fn deinit(subject: *Subject, gpa: std.mem.Allocator) void {
        subject.used.deinit(gpa);
        subject.* = undefined;
    }

    fn markShown(subject: *Subject) void {
        const shown = &subject.shown;
        var cursor: Cursor = .init(shown.geometry);
        shown.surface_count = 0;
        for (0..shown.geometry.surfaceCount()) |number| {
            const triangle = cursor.triangleAt(@intCast(number));
            shown.surface_count += @intFromBool(!triangle.isDropped());
            if (shown.holds(&cursor, &triangle)) mark(&subject.used, &triangle);
        }
        subject.markSpheres(&subject.used);
    }

    fn markSpheres(subject: *const Subject, vertices: *std.DynamicBitSetUnmanaged) void {
        var cursor: Cursor = .init(subject.shown.geometry);
        for (subject.shown.geometry.spheres) |*sphere| {
            if (subject.shown.holdsSphere(&cursor, sphere)) vertices.set(sphere.center);
        }
    }

    /// Sets middle and size by the vertices' box, which is returned.
    fn measure(subject: *Subject) math.Box3 {
        var bounds: math.Box3 = .empty;
        var cursor: Cursor = .init(subject.shown.geometry);
        var vertices = subject.used.iterator(.{});
        while (vertices.next()) |vertex| {
            bounds = bounds.include(cursor.positionAt(@intCast(vertex)));
        }
        subject.size = 0;
        for (&subject.center, bounds.lower, bounds.upper) |*middle, lower, upper| {
            middle.* = (@as(f64, lower) + upper) / 2;
            subject.size = larger(subject.size, @as(f64, upper) - lower);
        }
        if (subject.size > 0) return bounds;
        // Triangles without an extent have no area, but points are seen. From far enough away that
        // what is small there keeps its digits.
        subject.is_point = true;
        const c = subject.center;
        const distance = larger(larger(1, @abs(c[0])), larger(@abs(c[1]), @abs(c[2])));
        subject.size = distance / point_distance;
        return bounds;
    }

    /// A perspective camera along the axes of `basis` that sees all that faces it. `half` as of
    /// `halfTangents`.
    pub fn fit(
        subject: *const Subject,
        gpa: std.mem.Allocator,
        basis: Basis,
        half: [2]f64,
    ) error{OutOfMemory}!world.Camera {
        var facing: std.DynamicBitSetUnmanaged = try .initEmpty(gpa, subject.used.bit_length);
        defer facing.deinit(gpa);
        const outside = try subject.placeFor(gpa, &subject.used, basis, half);
        var origin = outside;
        // Nearer by, more may face it: what is seen once stays in view.
        for (0..facing_round_max) |_| {
            if (!subject.addFacing(&facing, origin)) break;
            origin = try subject.placeFor(gpa, &facing, basis, half);
        } else origin = outside;
        return .{
            .orthographic = false,
            .origin = vec3d.toSingle(origin),
            .right = vec3d.toSingle(vec3d.scale(basis.right, half[0])),
            .up = vec3d.toSingle(vec3d.scale(basis.up, half[1])),
            .forward = vec3d.toSingle(basis.forward),
        };
    }

    fn placeFor(
        subject: *const Subject,
        gpa: std.mem.Allocator,
        vertices: *const std.DynamicBitSetUnmanaged,
        basis: Basis,
        half: [2]f64,
    ) error{OutOfMemory}!Vec3d {
        const points = try subject.along(gpa, vertices, basis);
        defer gpa.free(points);
        return subject.toWorld(basis, nearestPlace(points, half));
    }

    /// Adds the vertices of triangles that are not culled as seen from `eye`; whether there were
    /// others than before.
    fn addFacing(
        subject: *const Subject,
        facing: *std.DynamicBitSetUnmanaged,
        eye: Vec3d,
    ) bool {
        const before = facing.count();
        const shown = &subject.shown;
        var cursor: Cursor = .init(shown.geometry);
        subject.markSpheres(facing);
        for (0..shown.geometry.surfaceCount()) |number| {
            const triangle = cursor.triangleAt(@intCast(number));
            if (!shown.holds(&cursor, &triangle)) continue;
            if (!shown.materials[triangle.material].double_sided) {
                const normal = areaNormal(&cursor, &triangle);
                const corner = cursor.positionAt(triangle.corner[0]);
                const toward = vec3d.neg(relativeTo(eye, corner));
                const lengths = vec3d.length(normal) * vec3d.length(toward);
                if (vec3d.dot(normal, toward) < facing_sine_min * lengths) continue;
            }
            mark(facing, &triangle);
        }
        return facing.count() > before;
    }

    /// An orthographic camera along the axes of `basis` that sees all that faces it.
    pub fn fitOrthographic(
        subject: *const Subject,
        gpa: std.mem.Allocator,
        basis: Basis,
        aspect: f64,
    ) error{OutOfMemory}!world.Camera {
        var facing: std.DynamicBitSetUnmanaged = try .initEmpty(gpa, subject.used.bit_length);
        defer facing.deinit(gpa);
        const far = 1e6; // Sizes: rays from there are as good as parallel.
        const some = subject.addFacing(&facing, subject.toWorld(basis, .{ 0, 0, -far }));
        const points = try subject.along(gpa, if (some) &facing else &subject.used, basis);
        defer gpa.free(points);
        var lower = points[0];
        var upper = points[0];
        for (points) |point| {
            lower = vec3d.min(lower, point);
            upper = vec3d.max(upper, point);
        }
        const extent = vec3d.scale(vec3d.sub(upper, lower), 0.5 / extent_max);
        // Of the size: a point has no extent.
        const least: f64 = if (subject.is_point) point_distance else 1e-9;
        const half_height = larger(larger(extent[1], extent[0] / aspect), least) * subject.size;
        var place = vec3d.scale(vec3d.add(lower, upper), 0.5);
        place[2] = lower[2] - 1;
        return .{
            .orthographic = true,
            .origin = vec3d.toSingle(subject.toWorld(basis, place)),
            .right = vec3d.toSingle(vec3d.scale(basis.right, half_height * aspect)),
            .up = vec3d.toSingle(vec3d.scale(basis.up, half_height)),
            .forward = vec3d.toSingle(basis.forward),
        };
    }

    /// The least distance of a camera that looks along `forward` at `target` and sees all, however
    /// the camera is turned about the vertical axis through the target: a turntable does not jump.
    ///
    /// A vertex at height y and at r from the axis goes round a circle, on which it is farthest
    /// from the middle of a picture of slopes s, seen from an elevation of e, where
    ///
    ///     d >= r sqrt(1 / s_x^2 + cos^2 e) + y sin e           right and left
    ///     d >= r |cos e -+ sin e / s_y| + y (sin e +- cos e / s_y)     above and below
    ///
    /// An orthographic camera, whose slopes are those of its sides over its distance, has but
    /// d >= r / s_x and d >= (r |sin e| +- y cos e) / s_y. A sphere of radius R needs R / s or, in
    /// perspective, R sqrt(1 / s^2 + 1) more.
    pub fn orbitRadius(
        subject: *const Subject,
        target: Vec3d,
        forward: Vec3d,
        half: [2]f64,
        orthographic: bool,
    ) f64 {
        const slope: [2]f64 = .{ half[0] * extent_max, half[1] * extent_max };
        const sin = -forward[1];
        const cos = @sqrt(forward[0] * forward[0] + forward[2] * forward[2]);
        const toward: f64 = if (orthographic) 0 else 1;
        const aside = @sqrt(1 / (slope[0] * slope[0]) + toward * cos * cos);
        const above = @abs(toward * cos - sin / slope[1]);
        const below = @abs(toward * cos + sin / slope[1]);
        const sphere_radius = subject.shown.geometry.sphere_radius;
        var sphere: [2]f64 = undefined;
        for (&sphere, slope) |*to, s| to.* = sphere_radius * @sqrt(1 / (s * s) + toward);
        const narrow = if (slope[0] < slope[1]) slope[0] else slope[1];
        const to_end = if (sphere_radius > 0) end_distance * subject.size / narrow else 0;
        var radius: f64 = if (subject.is_point) point_distance else 1e-6;
        radius *= subject.size;
        var cursor: Cursor = .init(subject.shown.geometry);
        var vertices = subject.used.iterator(.{});
        while (vertices.next()) |vertex| {
            const p = relativeTo(target, cursor.positionAt(@intCast(vertex)));
            const r = @sqrt(p[0] * p[0] + p[2] * p[2]);
            const nearer = toward * p[1] * sin;
            const over = p[1] * cos / slope[1];
            radius = larger(radius, to_end + nearer);
            radius = larger(radius, r * aside + nearer + sphere[0]);
            radius = larger(radius, r * above + nearer + over + sphere[1]);
            radius = larger(radius, r * below + nearer - over + sphere[1]);
        }
        return radius;
    }

    /// Distance from `target` to what is farthest from it.
    pub fn farthest(subject: *const Subject, target: Vec3d) f64 {
        var distance: f64 = 0;
        var cursor: Cursor = .init(subject.shown.geometry);
        var vertices = subject.used.iterator(.{});
        while (vertices.next()) |vertex| {
            const p = relativeTo(target, cursor.positionAt(@intCast(vertex)));
            distance = larger(distance, vec3d.length(p));
        }
        return (distance + subject.shown.geometry.sphere_radius) * (1 + margin);
    }

    /// Vertices along the axes of a camera: relative to the middle, in units of the size,
    /// right, up and forward. At least one.
    fn along(
        subject: *const Subject,
        gpa: std.mem.Allocator,
        chosen: *const std.DynamicBitSetUnmanaged,
        basis: Basis,
    ) error{OutOfMemory}![]Vec3d {
        const count = chosen.count();
        const points = try gpa.alloc(Vec3d, @max(count, 1));
        points[0] = .{ 0, 0, 0 };
        var cursor: Cursor = .init(subject.shown.geometry);
        var vertices = chosen.iterator(.{});
        for (points[0..count]) |*point| {
            const position = cursor.positionAt(@intCast(vertices.next().?));
            var relative = relativeTo(subject.center, position);
            for (&relative) |*component| component.* /= subject.size;
            point.* = .{
                vec3d.dot(relative, basis.right),
                vec3d.dot(relative, basis.up),
                vec3d.dot(relative, basis.forward),
            };
        }
        return points;
    }

    /// A place as `along` has them, in the world.
    fn toWorld(subject: *const Subject, basis: Basis, place: Vec3d) Vec3d {
        var result = subject.center;
        inline for (.{ basis.right, basis.up, basis.forward }, place) |axis, distance| {
            result = vec3d.add(result, vec3d.scale(axis, distance * subject.size));
        }
        return result;
    }
};

fn mark(vertices: *std.DynamicBitSetUnmanaged, triangle: *const world.Triangle) void {
    for (triangle.corner) |vertex| vertices.set(vertex);
}

fn relativeTo(middle: Vec3d, position: Vec3) Vec3d {
    return .{ position[0] - middle[0], position[1] - middle[1], position[2] - middle[2] };
}

/// Which triangles can be seen at all.
const Shown = struct {
    geometry: *const world.Geometry,
    materials: []const scene.Material,
    /// All of them, since otherwise there would be none.
    all: bool = false,
    /// Triangles of surfaces that are not dropped.
    surface_count: usize = 0,

    /// Whether alpha leaves something of the triangle.
    fn holds(shown: *const Shown, cursor: *Cursor, triangle: *const world.Triangle) bool {
        return !triangle.isDropped() and
            shown.holdsVertices(cursor, &triangle.corner, triangle.material);
    }

    fn holdsSphere(shown: *const Shown, cursor: *Cursor, sphere: *const world.Sphere) bool {
        return sphere.material != world.none and
            shown.holdsVertices(cursor, &.{sphere.center}, sphere.material);
    }

    fn holdsVertices(
        shown: *const Shown,
        cursor: *Cursor,
        vertices: []const u32,
        material_index: u32,
    ) bool {
        const material = &shown.materials[material_index];
        if (shown.all or material.alpha_mode == .@"opaque") return true;
        var alpha: f32 = 0;
        if (!shown.geometry.hasColors()) alpha = 1 else for (vertices) |vertex| {
            const color = cursor.colorAt(vertex);
            alpha = if (color[3] > alpha) color[3] else alpha;
        }
        alpha *= material.base_color[3];
        return if (material.alpha_mode == .mask) alpha >= material.alpha_cutoff else alpha > 0;
    }
};

/// Twice the area of a triangle along its normal, towards its front.
fn areaNormal(cursor: *Cursor, triangle: *const world.Triangle) Vec3d {
    const a = cursor.positionAt(triangle.corner[0]);
    const b = cursor.positionAt(triangle.corner[1]);
    const c = cursor.positionAt(triangle.corner[2]);
    const middle: Vec3d = .{ a[0], a[1], a[2] };
    return vec3d.cross(relativeTo(middle, b), relativeTo(middle, c));
}

/// The axes to look along.
fn chooseBasis(samples: *const Samples, bounds: math.Box3) Basis {
    if (samples.shown.surface_count == 0) return strokeBasis(bounds);
    if (flatFront(samples, bounds)) |front| return .look(vec3d.neg(front), .{ 0, 1, 0 });
    const axis = boardAxis(samples, bounds) orelse
        return .ofDirection(chooseDirection(samples, &directions));
    if (axis == 1) return .ofDirection(chooseDirection(samples, directions[2..]));
    var turned = board_directions;
    if (axis == 0) for (&turned) |*direction| {
        direction.azimuth_degrees += 90;
    };
    return .ofDirection(chooseDirection(samples, &turned));
}

/// The axes to look along at points and lines alone: straight at those that lie in a plane across
/// an axis of the world.
fn strokeBasis(bounds: math.Box3) Basis {
    const extent = bounds.extent();
    const longest = vec3.maxComponent(extent);
    var front: Vec3d = .{ 0, 0, 0 };
    var flat_count: u32 = 0;
    for (&front, extent) |*component, depth| {
        if (depth > flat.depth_max * longest) continue;
        component.* = 1;
        flat_count += 1;
    }
    if (flat_count != 1) return .ofDirection(directions[0]);
    return .look(vec3d.neg(front), .{ 0, 1, 0 });
}

/// The direction that the front of a flat model looks to, null for others. Where both sides show as
/// much, it is the one towards the positive end of the axis it is nearest to.
fn flatFront(samples: *const Samples, bounds: math.Box3) ?Vec3d {
    var sum: Vec3d = .{ 0, 0, 0 };
    var fronts: Vec3d = .{ 0, 0, 0 };
    var all: f64 = 0;
    var cursor: Cursor = .init(samples.shown.geometry);
    for (samples.triangles) |*triangle| {
        const normal = areaNormal(&cursor, triangle);
        const sign: f64 = if (vec3d.dot(normal, sum) < 0) -1 else 1;
        sum = vec3d.add(sum, vec3d.scale(normal, sign));
        all += vec3d.length(normal);
        const is_double_sided = samples.shown.materials[triangle.material].double_sided;
        if (!is_double_sided) fronts = vec3d.add(fronts, normal);
    }
    const axis = vec3d.normalize(sum) orelse return null;
    if (vec3d.length(sum) < flat.area_min * all) return null;
    if (depthAlong(axis, samples, bounds) > flat.depth_max) return null;
    const front = vec3d.dot(fronts, axis);
    if (@abs(front) > 1e-3 * all) return if (front > 0) axis else vec3d.neg(axis);
    var largest: usize = 0;
    for (axis, 0..) |component, index| {
        if (@abs(component) > @abs(axis[largest]) + 1e-6) largest = index;
    }
    return if (axis[largest] >= 0) axis else vec3d.neg(axis);
}

/// Extent of the samples along an axis as a share of the longest side of the box.
fn depthAlong(axis: Vec3d, samples: *const Samples, bounds: math.Box3) f64 {
    var least: f64 = std.math.inf(f64);
    var most: f64 = -std.math.inf(f64);
    var cursor: Cursor = .init(samples.shown.geometry);
    for (samples.triangles) |*triangle| for (triangle.corner) |vertex| {
        const position = cursor.positionAt(vertex);
        const at = vec3d.dot(axis, .{ position[0], position[1], position[2] });
        least = if (at < least) at else least;
        most = larger(most, at);
    };
    var size: f64 = 0;
    for (bounds.lower, bounds.upper) |lower, upper| size = larger(size, @as(f64, upper) - lower);
    return (most - least) / size;
}

/// Triangles that can be seen, evenly spread over all.
const Samples = struct {
    shown: *const Shown,
    triangles: []const world.Triangle,

    fn init(gpa: std.mem.Allocator, shown: *const Shown) error{OutOfMemory}!Samples {
        const stride = shown.surface_count / sample_count_max + 1;
        const count_max = @divCeil(shown.surface_count, stride);
        var triangles: std.ArrayList(world.Triangle) = try .initCapacity(gpa, count_max);
        errdefer triangles.deinit(gpa);
        var cursor: Cursor = .init(shown.geometry);
        // Triangles to pass by that are not dropped.
        var ahead: usize = 0;
        for (0..shown.geometry.surfaceCount()) |number| {
            const triangle = cursor.triangleAt(@intCast(number));
            if (triangle.isDropped()) continue;
            if (ahead > 0) {
                ahead -= 1;
                continue;
            }
            ahead = stride - 1;
            if (shown.holds(&cursor, &triangle)) triangles.appendAssumeCapacity(triangle);
        }
        return .{ .shown = shown, .triangles = try triangles.toOwnedSlice(gpa) };
    }

    fn deinit(samples: *const Samples, gpa: std.mem.Allocator) void {
        gpa.free(samples.triangles);
    }
};

/// The axis that a board faces; null for other models. By how the area is spread, so that
/// a few things before or behind the board do not count much.
fn boardAxis(samples: *const Samples, bounds: math.Box3) ?usize {
    const middle: Vec3d = .{ bounds.lower[0], bounds.lower[1], bounds.lower[2] };
    var all: f64 = 0;
    var sum: Vec3d = .{ 0, 0, 0 };
    var squares: Vec3d = .{ 0, 0, 0 };
    var cursor: Cursor = .init(samples.shown.geometry);
    for (samples.triangles) |*triangle| {
        const area = vec3d.length(areaNormal(&cursor, triangle)) / 3;
        for (triangle.corner) |vertex| {
            const at = relativeTo(middle, cursor.positionAt(vertex));
            sum = vec3d.add(sum, vec3d.scale(at, area));
            squares = vec3d.add(squares, vec3d.scale(vec3d.mul(at, at), area));
            all += area;
        }
    }
    var variance: Vec3d = undefined;
    for (&variance, sum, squares) |*to, first, second| {
        to.* = second / all - (first / all) * (first / all);
    }
    const share = board_depth_max * board_depth_max;
    for (0..3) |axis| {
        const others = .{ variance[(axis + 1) % 3], variance[(axis + 2) % 3] };
        if (variance[axis] <= share * @min(others[0], others[1])) return axis;
    }
    return null;
}

/// The first direction that shows enough: the area of fronts (and backs, where they are
/// seen too) projected along it. What stands in front of what is not looked at.
fn chooseDirection(samples: *const Samples, choices: []const Direction) Direction {
    var toward: [directions.len]Vec3d = undefined;
    for (choices, toward[0..choices.len]) |direction, *to| {
        to.* = vec3d.neg(Basis.ofDirection(direction).forward);
    }
    var visible: [directions.len]f64 = @splat(0);
    var cursor: Cursor = .init(samples.shown.geometry);
    for (samples.triangles) |*triangle| {
        const normal = areaNormal(&cursor, triangle);
        const back: f64 = if (samples.shown.materials[triangle.material].double_sided) -1 else 0;
        for (toward[0..choices.len], visible[0..choices.len]) |to, *sum| {
            const projected = vec3d.dot(normal, to);
            sum.* += if (projected > 0) projected else projected * back;
        }
    }
    var best: f64 = 0;
    for (visible) |sum| best = if (sum > best) sum else best;
    for (choices, visible[0..choices.len]) |choice, sum| {
        if (sum >= best * visible_share_min) return choice;
    }
    unreachable; // The best one passes.
}

/// Where a camera has to stand, in its own axes, to have all of `points` (at least one) within the
/// frame, as near as can be, in the middle of both axes.
///
/// A side plane of the frame through the camera c, of slope s = extent_max * half, holds a point p
/// when p.x - s p.z <= c.x - s c.z, its opposite when -p.x - s p.z <= -c.x - s c.z. The sum of both
/// bounds c.z alone; the axis that binds is centred when both are equalities.
fn nearestPlace(points: []const Vec3d, half: [2]f64) Vec3d {
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
    // A point has no size to be framed by.
    var place: Vec3d = .{ 0, 0, nearest - point_distance };
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

/// The camera of the default view.
fn frameForTest(
    geometry: *const world.Geometry,
    materials: []const scene.Material,
    aspect: f64,
) !world.Camera {
    const gpa = std.testing.allocator;
    var subject: Subject = try .init(gpa, geometry, materials);
    defer subject.deinit(gpa);
    return subject.fit(gpa, subject.basis, halfTangents(null, aspect));
}

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
            const camera = try frameForTest(&geometry, &materials, aspect);
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

test "a flat model is seen straight from its front, whichever way it looks" {
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
                const camera = try frameForTest(&shape.geometry(), &materials, 1);
                const cosine = -camera.forward[axis] * @as(f32, if (flipped) -1 else 1);
                const shown = if (double_sided) -camera.forward[axis] else cosine;
                try std.testing.expectApproxEqAbs(@as(f32, 1), shown, 1e-6);
                try std.testing.expectApproxEqAbs(@as(f32, 0), camera.right[1], 1e-6);
            }
        }
    }
}

/// Two walls and a floor, that meet in a corner.
const test_corner: TestShape = .{
    .positions = &.{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 }, .{ 0, 0, 1 } },
    .triangles = &.{
        .{ .corner = .{ 0, 1, 2 }, .material = 0 },
        .{ .corner = .{ 0, 2, 3 }, .material = 0 },
        .{ .corner = .{ 0, 3, 1 }, .material = 0 },
    },
};

test "the usual view comes from the front, the right and above" {
    const materials = [_]scene.Material{.{}};
    const camera = try frameForTest(&test_corner.geometry(), &materials, 1);
    try std.testing.expectApproxEqAbs(@as(f32, -0.4698463), camera.forward[0], 1e-6);
    try std.testing.expectApproxEqAbs(@as(f32, -0.3420201), camera.forward[1], 1e-6);
    try std.testing.expect(camera.right[1] == 0 and camera.up[1] > 0);
    const back = vec3.normalize(vec3.cross(camera.right, camera.up)).?;
    for (back, camera.forward) |b, f| try std.testing.expectApproxEqAbs(-b, f, 1e-6);
}

test "steps and shelves are not flat" {
    const shape: TestShape = .{
        .positions = &.{
            .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 0, -1 }, .{ 0, 1, 0 }, .{ 1, 1, 0 }, .{ 0, 1, -1 },
        },
        .triangles = &.{
            .{ .corner = .{ 0, 1, 2 }, .material = 0 },
            .{ .corner = .{ 3, 4, 5 }, .material = 0 },
        },
    };
    const camera = try frameForTest(&shape.geometry(), &.{.{}}, 1);
    try std.testing.expect(camera.forward[1] > -0.9);
}

test "what alpha leaves nothing of does not count, unless there is nothing else" {
    const gpa = std.testing.allocator;
    var shape = test_corner;
    shape.positions = test_corner.positions ++
        [3]Vec3{ .{ 9, 0, 0 }, .{ 0, 9, 0 }, .{ 0, 0, 9 } };
    shape.triangles = test_corner.triangles ++
        [1]world.Triangle{.{ .corner = .{ 4, 5, 6 }, .material = 1 }};
    var geometry = shape.geometry();
    const Case = struct { material: scene.Material, size: f64, vertex_alpha: f32 = 1 };
    const clear: scene.Material = .{ .alpha_mode = .blend, .base_color = .{ 1, 1, 1, 0 } };
    var faint = clear;
    faint.base_color[3] = 0.01;
    var solid = clear;
    solid.alpha_mode = .@"opaque";
    var holes = clear;
    holes.alpha_mode = .mask;
    holes.base_color[3] = 0.4;
    var edge = holes;
    edge.alpha_cutoff = 0.4;
    for ([_]Case{
        .{ .material = clear, .size = 1 },
        .{ .material = faint, .size = 9 },
        .{ .material = solid, .size = 9 },
        .{ .material = holes, .size = 1 },
        .{ .material = edge, .size = 9 },
        .{ .material = edge, .size = 1, .vertex_alpha = 0.9 },
        .{ .material = faint, .size = 1, .vertex_alpha = 0 },
    }) |case| {
        const materials = [_]scene.Material{ .{}, case.material };
        const colors: [7][4]f32 = @splat(.{ 1, 1, 1, case.vertex_alpha });
        geometry.colors = &colors;
        var subject: Subject = try .init(gpa, &geometry, &materials);
        defer subject.deinit(gpa);
        try std.testing.expectEqual(case.size, subject.size);
    }
    geometry.colors = &.{};
    geometry.triangles = test_corner.triangles;
    const camera = try frameForTest(&geometry, &.{clear}, 1);
    try std.testing.expect(vec3.length(camera.origin) < 9);
}

test "boards are seen nearer to their front than other things" {
    const Case = struct { depth: [3]f32, forward: [2]f32 };
    for ([_]Case{
        .{ .depth = .{ 1, 1, 0.05 }, .forward = .{ -0.254887, -0.951251 } },
        .{ .depth = .{ 0.05, 1, 1 }, .forward = .{ -0.951251, 0.254887 } },
        .{ .depth = .{ 1, 0.05, 1 }, .forward = .{ -0.353553, -0.612372 } },
        .{ .depth = .{ 1, 1, 0.9 }, .forward = .{ -0.469846, -0.813798 } },
    }) |case| {
        var positions: [8]Vec3 = undefined;
        for (&positions, 0..) |*position, bits| {
            for (position, case.depth, 0..) |*to, depth, axis| {
                to.* = if (bits >> @intCast(axis) & 1 != 0) depth else 0;
            }
        }
        const quads = [6][4]u32{
            .{ 0, 4, 6, 2 }, .{ 1, 3, 7, 5 }, .{ 0, 1, 5, 4 },
            .{ 2, 6, 7, 3 }, .{ 0, 2, 3, 1 }, .{ 4, 5, 7, 6 },
        };
        var triangles: [12]world.Triangle = undefined;
        for (&triangles, 0..) |*triangle, index| {
            const quad = quads[index / 2];
            const from = 2 * (index % 2);
            const corner: [3]u32 = .{ quad[from], quad[from + 1], quad[(from + 2) % 4] };
            triangle.* = .{ .corner = corner, .material = 0 };
        }
        const shape: TestShape = .{ .positions = &positions, .triangles = &triangles };
        const camera = try frameForTest(&shape.geometry(), &.{.{}}, 1);
        try std.testing.expectApproxEqAbs(case.forward[0], camera.forward[0], 1e-5);
        try std.testing.expectApproxEqAbs(case.forward[1], camera.forward[2], 1e-5);
    }
}

test "what faces away and is culled does not push the camera off" {
    const gpa = std.testing.allocator;
    const shape: TestShape = .{
        .positions = &.{
            .{ 4, 4, 0 },  .{ 5, 4, 0 },  .{ 4, 5, 0 },
            .{ 0, 0, -9 }, .{ 9, 0, -9 }, .{ 0, 9, -9 },
        },
        .triangles = &.{
            .{ .corner = .{ 0, 1, 2 }, .material = 0 },
            .{ .corner = .{ 3, 5, 4 }, .material = 1 },
        },
    };
    const geometry = shape.geometry();
    const basis: Basis = .ofAngles(0, 0);
    for ([_]bool{ false, true }) |double_sided| {
        const materials = [_]scene.Material{ .{}, .{ .double_sided = double_sided } };
        var subject: Subject = try .init(gpa, &geometry, &materials);
        defer subject.deinit(gpa);
        const camera = try subject.fit(gpa, basis, halfTangents(null, 1));
        const flattened = try subject.fitOrthographic(gpa, basis, 1);
        // Half of the side over the slope, or of the side of 9, from -9 on.
        const slope: f64 = halfTangents(null, 1)[0] * extent_max;
        const distance: f64 = if (double_sided) 4.5 / slope - 9 else 0.5 / slope;
        const half: f64 = if (double_sided) 4.5 else 0.5;
        try std.testing.expectApproxEqRel(distance, camera.origin[2], 1e-5);
        try std.testing.expectApproxEqRel(half / extent_max, flattened.up[1], 1e-5);
    }
}

test "an orthographic view has all within its margin" {
    const gpa = std.testing.allocator;
    const geometry = test_corner.geometry();
    var subject: Subject = try .init(gpa, &geometry, &.{.{}});
    defer subject.deinit(gpa);
    for ([_]f64{ 1, 5, 0.2 }) |aspect| {
        const camera = try subject.fitOrthographic(gpa, subject.basis, aspect);
        var outermost: [2]f32 = @splat(0);
        for (geometry.positions) |position| {
            const relative = vec3.sub(position, camera.origin);
            try std.testing.expect(vec3.dot(relative, camera.forward) > 0);
            inline for (.{ camera.right, camera.up }, &outermost) |axis, *most| {
                const at = @abs(vec3.dot(relative, axis) / vec3.dot(axis, axis));
                most.* = if (at > most.*) at else most.*;
            }
        }
        try std.testing.expectApproxEqAbs(extent_max, larger(outermost[0], outermost[1]), 1e-4);
        const ratio = vec3.length(camera.right) / vec3.length(camera.up);
        try std.testing.expectApproxEqRel(aspect, ratio, 1e-5);
    }
}

test "nothing to see still makes a camera" {
    const shape: TestShape = .{ .positions = &.{}, .triangles = &.{} };
    const camera = try frameForTest(&shape.geometry(), &.{}, 1.5);
    try std.testing.expect(vec3.isFinite(camera.origin));
    try std.testing.expectApproxEqRel(@as(f32, 1), vec3.length(camera.forward), 1e-6);
    try std.testing.expect(vec3.length(camera.right) > vec3.length(camera.up));
}
