//! The current transformation: affine maps in f64, as PBRT's directives build them.
//!
//! PBRT writes matrices by columns, and lets each directive act before what stands already: the
//! last one is the first that meets a point. A matrix with a projective row is refused.

const std = @import("std");
const math = @import("../../math.zig");
const elementary = math.elementary;
const vec3d = math.vec3d;
const Transform = math.AffineD;
const Vector = math.Vec3d;

/// Turns about `axis`, counter-clockwise seen from its tip in a right-handed space; null where the
/// axis has no direction or the angle is absurd.
pub fn rotation(angle_deg: f64, axis: Vector) ?Transform {
    const a = vec3d.normalize(axis) orelse return null;
    if (!(@abs(angle_deg) <= 1e6)) return null;
    const angle = angle_deg * (std.math.pi / 180.0);
    const sine = elementary.sin(angle);
    const cosine = elementary.cos(angle);
    var result: Transform = .identity;
    inline for (.{ &result.x, &result.y, &result.z }) |image| {
        // Rodrigues: the part along the axis stays, the rest turns.
        const along = vec3d.scale(a, vec3d.dot(a, image.*));
        const across = vec3d.sub(image.*, along);
        const turned = vec3d.scale(vec3d.cross(a, image.*), sine);
        image.* = vec3d.add(along, vec3d.add(vec3d.scale(across, cosine), turned));
    }
    return result;
}

/// The map from world to camera of a camera at `eye` that looks at `target`: its x is
/// cross(up, forward), which is the right side of a left-handed world. Null where the three leave
/// no direction.
pub fn lookAt(eye: Vector, target: Vector, up: Vector) ?Transform {
    const forward = vec3d.normalize(vec3d.sub(target, eye)) orelse return null;
    const upward = vec3d.normalize(up) orelse return null;
    const right = vec3d.normalize(vec3d.cross(upward, forward)) orelse return null;
    const camera: Transform = .{
        .x = right,
        .y = vec3d.cross(forward, right),
        .z = forward,
        .translation = eye,
    };
    return camera.inverse();
}

/// Of sixteen numbers, by columns; null where the matrix is not affine.
pub fn fromMatrix(m: *const [16]f64) ?Transform {
    if (m[3] != 0 or m[7] != 0 or m[11] != 0 or m[15] == 0) return null;
    const w = 1 / m[15];
    return .{
        .x = vec3d.scale(m[0..3].*, w),
        .y = vec3d.scale(m[4..7].*, w),
        .z = vec3d.scale(m[8..11].*, w),
        .translation = vec3d.scale(m[12..15].*, w),
    };
}

/// Whether all of a map fits into f32.
pub fn fitsSingle(map: *const Transform) bool {
    for ([_]Vector{ map.x, map.y, map.z, map.translation }) |vector| for (vector) |number| {
        if (!(@abs(number) <= std.math.floatMax(f32))) return false;
    };
    return true;
}

test "directives act in the order in which they stand" {
    const turn = rotation(90, .{ 0, 0, 2 }).?;
    const map = Transform.translate(.{ 1, 2, 3 }).compose(turn);
    const image = map.point(.{ 1, 0, 0 });
    for ([3]f64{ 1, 3, 3 }, image) |expected, number| {
        try std.testing.expectApproxEqAbs(expected, number, 1e-12);
    }
    try std.testing.expectEqual(null, rotation(1, .{ 0, 0, 0 }));
}

test "a camera's x is the right side of a left-handed world" {
    const map = lookAt(.{ 0, 0, -5 }, .{ 0, 0, 0 }, .{ 0, 1, 0 }).?;
    const seen = map.point(.{ 1, 2, 0 });
    for ([3]f64{ 1, 2, 5 }, seen) |expected, number| {
        try std.testing.expectApproxEqAbs(expected, number, 1e-12);
    }
    try std.testing.expectEqual(null, lookAt(.{ 1, 1, 1 }, .{ 1, 1, 1 }, .{ 0, 1, 0 }));
    try std.testing.expectEqual(null, lookAt(.{ 0, 0, 0 }, .{ 0, 2, 0 }, .{ 0, 1, 0 }));
}

test "matrices stand by columns" {
    const map = fromMatrix(&.{ 1, 0, 0, 0, 0, 2, 0, 0, 0, 0, 3, 0, 4, 5, 6, 1 }).?;
    try std.testing.expectEqual(Vector{ 5, 7, 9 }, map.point(.{ 1, 1, 1 }));
    const projective = [16]f64{ 1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1 };
    try std.testing.expectEqual(null, fromMatrix(&projective));
}
