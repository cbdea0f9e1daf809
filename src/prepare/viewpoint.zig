//! A camera at a place of the user's choice: by an eye and a target, or on an orbit about a target.
//!
//! In: the viewpoint that is asked for, what is framed, and the picture's aspect. Out: a camera.
//! What is not asked for comes from the framing: its direction, the middle of what is seen as the
//! target, and a distance that shows all of it. Orbits are spherical coordinates about y, as
//! model-viewer's `camera-orbit`. f64 throughout.

const std = @import("std");
const framing = @import("framing.zig");
const math = @import("../math.zig");
const settings = @import("../settings.zig");
const world = @import("../world.zig");
const assert = std.debug.assert;
const Basis = framing.Basis;
const Vec3d = math.Vec3d;
const vec3d = math.vec3d;

/// The camera. `width_over_height` is the picture's aspect; memory from `gpa` is returned.
pub fn place(
    gpa: std.mem.Allocator,
    subject: *const framing.Subject,
    wanted: *const settings.Viewpoint,
    width_over_height: f64,
) error{OutOfMemory}!world.Camera {
    const half = framing.halfTangents(wanted.fov_degrees, width_over_height);
    const up: Vec3d = if (wanted.up) |up| double(up) else .{ 0, 1, 0 };
    if (wanted.eye) |eye| {
        const target = if (wanted.target) |target| double(target) else subject.center;
        const toward = vec3d.sub(target, double(eye));
        const forward = vec3d.normalize(toward) orelse subject.basis.forward;
        const extent = vec3d.length(toward);
        return cameraOf(wanted, double(eye), .look(forward, up), half, extent);
    }
    var basis = if (wanted.orbit) |orbit| orbitBasis(orbit) else subject.basis;
    if (wanted.up != null) basis = .look(basis.forward, up);
    if (wanted.orbit == null and wanted.target == null) {
        if (wanted.orthographic) return subject.fitOrthographic(gpa, basis, width_over_height);
        return subject.fit(gpa, basis, half);
    }
    const target = if (wanted.target) |target| double(target) else subject.center;
    const radius = radiusOf(subject, wanted, target, basis.forward, half);
    var distance = radius;
    // An orthographic picture is the same from any distance, unless the model is cut.
    if (wanted.orthographic) distance = @max(radius, subject.farthest(target));
    const eye = vec3d.sub(target, vec3d.scale(basis.forward, distance));
    return cameraOf(wanted, eye, basis, half, radius);
}

fn double(v: math.Vec3) Vec3d {
    return .{ v[0], v[1], v[2] };
}

/// `distance` is that of the target, whose plane an orthographic camera shows as large as a
/// perspective one would.
fn cameraOf(
    wanted: *const settings.Viewpoint,
    eye: Vec3d,
    basis: Basis,
    half: [2]f64,
    distance: f64,
) world.Camera {
    const scale = if (wanted.orthographic) bounded(distance) else 1;
    return .{
        .orthographic = wanted.orthographic,
        .origin = vec3d.toSingle(eye),
        .right = vec3d.toSingle(vec3d.scale(basis.right, bounded(half[0] * scale))),
        .up = vec3d.toSingle(vec3d.scale(basis.up, bounded(half[1] * scale))),
        .forward = vec3d.toSingle(basis.forward),
    };
}

/// Within what a camera's sides can be, so that their squares stay within an f32.
fn bounded(extent: f64) f64 {
    return std.math.clamp(extent, 1e-9, 1e9);
}

/// Axes of a camera on the orbit: from (sin phi sin theta, cos phi, sin phi cos theta) to the
/// middle. Above and below the poles' ambiguity is none, since theta says where up is.
fn orbitBasis(orbit: settings.Orbit) Basis {
    assert(orbit.phi_degrees >= 0 and orbit.phi_degrees <= 180);
    const theta_degrees: f64 = @rem(@as(f64, orbit.theta_degrees), 360);
    const elevation_degrees: f64 = 90 - @as(f64, orbit.phi_degrees);
    const degrees = std.math.pi / 180.0;
    return .ofAngles(theta_degrees * degrees, elevation_degrees * degrees);
}

/// Distance from eye to target, in metres.
fn radiusOf(
    subject: *const framing.Subject,
    wanted: *const settings.Viewpoint,
    target: Vec3d,
    forward: Vec3d,
    half: [2]f64,
) f64 {
    const orthographic = wanted.orthographic;
    return switch (if (wanted.orbit) |orbit| orbit.radius else settings.Orbit.Radius.default) {
        .metres => |metres| metres,
        .share => |share| share * subject.orbitRadius(target, forward, half, orthographic),
    };
}

const test_box = [_]math.Vec3{ .{ -1, -1, -1 }, .{ 3, 1, 2 } };

/// Stands for a model of two opposite corners, whatever its triangles.
fn testSubject(geometry: *const world.Geometry) !framing.Subject {
    return .init(std.testing.allocator, geometry, &.{.{ .double_sided = true }});
}

fn testGeometry() world.Geometry {
    var geometry: world.Geometry = .empty;
    geometry.positions = &.{ test_box[0], test_box[1], .{ 3, -1, 2 } };
    geometry.triangles = &.{.{ .corner = .{ 0, 1, 2 }, .material = 0 }};
    geometry.bounds = .{ .lower = test_box[0], .upper = test_box[1] };
    return geometry;
}

fn placeForTest(wanted: settings.Viewpoint, aspect: f64) !world.Camera {
    const geometry = testGeometry();
    var subject = try testSubject(&geometry);
    defer subject.deinit(std.testing.allocator);
    return place(std.testing.allocator, &subject, &wanted, aspect);
}

/// How far from the middle the model reaches in a picture whose border is at 1.
fn outermost(camera: *const world.Camera, geometry: *const world.Geometry) f32 {
    const vec3 = math.vec3;
    var most: f32 = 0;
    for (geometry.positions) |position| {
        const relative = vec3.sub(position, camera.origin);
        const depth = vec3.dot(relative, camera.forward);
        assert(depth > 0);
        const scale = if (camera.orthographic) 1 else depth;
        for ([_]math.Vec3{ camera.right, camera.up }) |axis| {
            most = @max(most, @abs(vec3.dot(relative, axis) / (scale * vec3.dot(axis, axis))));
        }
    }
    return most;
}

fn expectVec3(expected: [3]f64, actual: math.Vec3) !void {
    errdefer std.debug.print("{any}, not {any}\n", .{ actual, expected });
    for (expected, actual) |e, a| {
        try std.testing.expectApproxEqAbs(e, a, 1e-6 * @max(1, @abs(e)));
    }
}

test "an orbit stands where spherical coordinates say, the fov spans the height" {
    const sin_phi = 0.86602540378443864676;
    const camera = try placeForTest(.{
        .orbit = .{ .theta_degrees = 30, .phi_degrees = 60, .radius = .{ .metres = 4.75 } },
        .target = .{ 0.5, 0.25, -1 },
        .fov_degrees = 45,
    }, 2);
    const back: [3]f64 = .{ sin_phi * 0.5, 0.5, sin_phi * sin_phi };
    try expectVec3(.{ -back[0], -back[1], -back[2] }, camera.forward);
    try expectVec3(.{
        0.5 + 4.75 * back[0],
        0.25 + 4.75 * back[1],
        -1 + 4.75 * back[2],
    }, camera.origin);
    const slope = 0.41421356237309504880; // tan 22.5
    try expectVec3(.{ 2 * slope * sin_phi, 0, -2 * slope * 0.5 }, camera.right);
    try expectVec3(
        .{ -slope * 0.5 * 0.5, slope * sin_phi, -slope * sin_phi * 0.5 },
        camera.up,
    );
    try std.testing.expect(!camera.orthographic);
}

test "an orbit at the poles still knows where up is" {
    for ([_]f32{ 0, 180 }) |phi| {
        const camera = try placeForTest(.{
            .orbit = .{ .theta_degrees = 0, .phi_degrees = phi, .radius = .{ .metres = 9 } },
            .fov_degrees = 90,
        }, 1);
        const side: f64 = if (phi == 0) 1 else -1;
        try expectVec3(.{ 0, -side, 0 }, camera.forward);
        try expectVec3(.{ 1, 0, 0 }, camera.right);
        try expectVec3(.{ 0, 0, -side }, camera.up);
        try expectVec3(.{ 1, 9 * side, 0.5 }, camera.origin);
    }
}

test "an eye looks at its target, by default the middle of what is seen" {
    const free = try placeForTest(.{ .eye = .{ 1, 0, 4 } }, 1);
    try expectVec3(.{ 0, 0, -1 }, free.forward);
    try expectVec3(.{ 1, 0, 4 }, free.origin);
    const rolled = try placeForTest(.{
        .eye = .{ 0, 0, 5 },
        .target = .{ 0, 0, 0 },
        .up = .{ 3, 0, 0.5 },
        .fov_degrees = 90,
    }, 1);
    try expectVec3(.{ 1, 0, 0 }, rolled.up);
    try expectVec3(.{ 0, -1, 0 }, rolled.right);
    // As if on an orbit with theta 0.
    const above = try placeForTest(.{
        .eye = .{ 0, 5, 0 },
        .target = .{ 0, 0, 0 },
        .fov_degrees = 90,
    }, 1);
    try expectVec3(.{ 0, 0, -1 }, above.up);
    // No direction: that of the framing.
    const within = try placeForTest(.{ .eye = .{ 1, 0, 0.5 } }, 1);
    try std.testing.expect(math.vec3.isFinite(within.forward));
    try std.testing.expectApproxEqAbs(@as(f32, 1), math.vec3.length(within.forward), 1e-6);
}

test "from all around and both ways, the framing distance shows the model and hardly more" {
    const geometry = testGeometry();
    for ([_]bool{ false, true }) |orthographic| {
        for ([_]f64{ 1, 3, 0.4 }) |aspect| {
            for ([_]f32{ 0, 30, 90, 135, 180 }) |phi| {
                var farthest: f32 = 0;
                for (0..36) |step| {
                    const camera = try placeForTest(.{
                        .orbit = .{
                            .theta_degrees = 10 * @as(f32, @floatFromInt(step)),
                            .phi_degrees = phi,
                        },
                        .orthographic = orthographic,
                    }, aspect);
                    farthest = @max(farthest, outermost(&camera, &geometry));
                }
                try std.testing.expect(farthest <= 1 - 2 * framing.margin + 1e-4);
                try std.testing.expect(farthest >= 0.8);
            }
        }
    }
}

test "an orthographic orbit scales by its radius and cuts nothing off" {
    const full = try placeForTest(.{
        .orbit = .{ .theta_degrees = 0, .phi_degrees = 90 },
        .orthographic = true,
    }, 1);
    const near = try placeForTest(.{
        .orbit = .{ .theta_degrees = 0, .phi_degrees = 90, .radius = .{ .share = 0.01 } },
        .orthographic = true,
    }, 1);
    try std.testing.expectApproxEqRel(full.right[0] * 0.01, near.right[0], 1e-5);
    try std.testing.expect(near.origin[2] > test_box[1][2]);
}

test "a target alone is looked at from the direction of the framing" {
    const framed = try placeForTest(.{}, 1);
    const camera = try placeForTest(.{ .target = .{ 7, 8, 9 } }, 1);
    try expectVec3(.{ framed.forward[0], framed.forward[1], framed.forward[2] }, camera.forward);
    const toward = math.vec3.sub(.{ 7, 8, 9 }, camera.origin);
    const along = math.vec3.dot(toward, camera.forward);
    try std.testing.expectApproxEqRel(math.vec3.length(toward), along, 1e-5);
    const geometry = testGeometry();
    try std.testing.expect(outermost(&camera, &geometry) <= 1 - 2 * framing.margin + 1e-4);
}
