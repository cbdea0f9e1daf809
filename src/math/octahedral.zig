//! The octahedral map: directions as points of a square (Praun and Hoppe 2003, Spherical
//! Parametrization and Remeshing; Engelhardt and Dachsbacher 2008, Octahedron Environment Maps).
//!
//! A direction is scaled onto the octahedron |x| + |y| + |z| = 1 and dropped along y: the upper
//! half fills the diamond in the middle of the square, the lower one is folded out to its corners.
//! Neighbours in the square are neighbours on the sphere, and no function but a division is needed.

const std = @import("std");
const vec3_file = @import("vec3.zig");
const Vec3 = [3]f32;

/// The point of the octahedron, not of unit length, for u and v in -1..1.
pub fn pointOf(u: f32, v: f32) Vec3 {
    const y = 1 - @abs(u) - @abs(v);
    if (y >= 0) return .{ u, y, v };
    return .{ withSign(1 - @abs(v), u), y, withSign(1 - @abs(u), v) };
}

/// u and v of a direction of any length, in -1..1.
pub fn coordinatesOf(direction: Vec3) [2]f32 {
    const size = @abs(direction[0]) + @abs(direction[1]) + @abs(direction[2]);
    const u = direction[0] / size;
    const v = direction[2] / size;
    if (direction[1] >= 0) return .{ u, v };
    return .{ withSign(1 - @abs(v), u), withSign(1 - @abs(u), v) };
}

/// Solid angle that a unit of area of the square has at a point of the octahedron.
pub fn density(point: Vec3) f32 {
    const squared = vec3_file.Operations(Vec3).dot(point, point);
    return 1 / (squared * @sqrt(squared));
}

inline fn withSign(size: f32, sign: f32) f32 {
    return if (sign < 0) -size else size;
}

test "there and back, and the densities sum to the sphere" {
    const count = 64;
    var sum: f64 = 0;
    for (0..count) |row| for (0..count) |column| {
        const u = (@as(f32, @floatFromInt(column)) + 0.5) / count * 2 - 1;
        const v = (@as(f32, @floatFromInt(row)) + 0.5) / count * 2 - 1;
        const point = pointOf(u, v);
        const size = @abs(point[0]) + @abs(point[1]) + @abs(point[2]);
        try std.testing.expectApproxEqAbs(@as(f32, 1), size, 1e-6);
        const back = coordinatesOf(.{ 3 * point[0], 3 * point[1], 3 * point[2] });
        try std.testing.expectApproxEqAbs(u, back[0], 1e-6);
        try std.testing.expectApproxEqAbs(v, back[1], 1e-6);
        sum += density(point) * (2.0 / @as(f32, count)) * (2.0 / @as(f32, count));
    };
    try std.testing.expectApproxEqRel(4 * std.math.pi, sum, 1e-3);
    try std.testing.expectEqual([2]f32{ 0, 0 }, coordinatesOf(.{ 0, 2, 0 }));
    try std.testing.expectEqual([2]f32{ 1, 1 }, coordinatesOf(.{ 0, -2, 0 }));
}
