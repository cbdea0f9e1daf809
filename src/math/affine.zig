//! Affine maps of space: what a node of a scene does to the things below it.
//!
//! Held as the images of the three axes and of the origin. Sums run x, y, z, translation in this
//! order, so that composed transforms have the same bits on every target.

const std = @import("std");
const vec3 = @import("vec3.zig");
const Vec3 = vec3.Vec3;

/// p -> x p.x + y p.y + z p.z + translation.
pub const Affine = struct {
    /// Image of the x axis.
    x: Vec3,
    /// Image of the y axis.
    y: Vec3,
    /// Image of the z axis.
    z: Vec3,
    /// Image of the origin.
    translation: Vec3,

    /// The map that changes nothing.
    pub const identity: Affine = .{
        .x = .{ 1, 0, 0 },
        .y = .{ 0, 1, 0 },
        .z = .{ 0, 0, 1 },
        .translation = .{ 0, 0, 0 },
    };

    /// Translation after rotation (unit quaternion x, y, z, w) after scaling: glTF's T R S.
    pub fn fromTrs(translation: Vec3, rotation: [4]f32, scaling: Vec3) Affine {
        const x = rotation[0];
        const y = rotation[1];
        const z = rotation[2];
        const w = rotation[3];
        return .{
            .x = vec3.scale(.{
                1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w),
            }, scaling[0]),
            .y = vec3.scale(.{
                2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w),
            }, scaling[1]),
            .z = vec3.scale(.{
                2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y),
            }, scaling[2]),
            .translation = translation,
        };
    }

    /// The image of a point.
    pub inline fn point(map: Affine, p: Vec3) Vec3 {
        return vec3.add(map.direction(p), map.translation);
    }

    /// The image of a direction: the translation does not count.
    pub inline fn direction(map: Affine, d: Vec3) Vec3 {
        const xy = vec3.add(vec3.scale(map.x, d[0]), vec3.scale(map.y, d[1]));
        return vec3.add(xy, vec3.scale(map.z, d[2]));
    }

    /// The image of a surface normal, not normalised: cofactors of the linear part, which unlike
    /// the inverse transpose exist for flattening maps too. Turns with a mirroring map's winding.
    pub inline fn normal(map: Affine, n: Vec3) Vec3 {
        const xy = vec3.add(
            vec3.scale(vec3.cross(map.y, map.z), n[0]),
            vec3.scale(vec3.cross(map.z, map.x), n[1]),
        );
        return vec3.add(xy, vec3.scale(vec3.cross(map.x, map.y), n[2]));
    }

    /// Volume factor; negative where the map mirrors.
    pub fn determinant(map: Affine) f32 {
        return vec3.dot(map.x, vec3.cross(map.y, map.z));
    }

    /// `outer` after `inner`.
    pub fn compose(outer: Affine, inner: Affine) Affine {
        return .{
            .x = outer.direction(inner.x),
            .y = outer.direction(inner.y),
            .z = outer.direction(inner.z),
            .translation = outer.point(inner.translation),
        };
    }

    /// Whether no entry is infinite or NaN.
    pub fn isFinite(map: Affine) bool {
        return vec3.isFinite(map.x) and vec3.isFinite(map.y) and vec3.isFinite(map.z) and
            vec3.isFinite(map.translation);
    }
};

test "translation, rotation and scaling act in this order" {
    const half = @sqrt(@as(f32, 0.5)); // A quarter turn about z.
    const map: Affine = .fromTrs(.{ 10, 20, 30 }, .{ 0, 0, half, half }, .{ 2, 3, 4 });
    const p = map.point(.{ 1, 1, 1 });
    try std.testing.expectApproxEqAbs(@as(f32, 7), p[0], 1e-5);
    try std.testing.expectApproxEqAbs(@as(f32, 22), p[1], 1e-5);
    try std.testing.expectApproxEqAbs(@as(f32, 34), p[2], 1e-5);
    try std.testing.expectApproxEqAbs(@as(f32, 24), map.determinant(), 1e-4);
}

test "compose equals doing one after the other, normals stay perpendicular" {
    const a: Affine = .fromTrs(.{ 1, 2, 3 }, .{ 0.6, 0, 0, 0.8 }, .{ 1, -2, 0.5 });
    const b: Affine = .fromTrs(.{ -1, 0, 5 }, .{ 0, 0.28, 0, 0.96 }, .{ 3, 1, 1 });
    const direct = a.point(b.point(.{ 0.3, -0.7, 2 }));
    const composed = Affine.compose(a, b).point(.{ 0.3, -0.7, 2 });
    for (direct, composed) |p, q| try std.testing.expectApproxEqRel(p, q, 1e-5);
    const u: Vec3 = .{ 1, 2, -1 };
    const v: Vec3 = .{ 0, 1, 4 };
    const n = a.normal(vec3.cross(u, v));
    try std.testing.expectApproxEqAbs(@as(f32, 0), vec3.dot(n, a.direction(u)), 1e-4);
    try std.testing.expectApproxEqAbs(@as(f32, 0), vec3.dot(n, a.direction(v)), 1e-4);
    const again = vec3.cross(a.direction(u), a.direction(v)); // Mirrored maps included.
    for (n, again) |p, q| try std.testing.expectApproxEqAbs(p, q, 1e-4);
}
