//! Which side of a triangle is its front, where vertices have normals.
//!
//! In: triangles and their vertices' normals. Out: the triangles, corners counter-clockwise as the
//! normals see them: exporters mirror one and forget the other.

const std = @import("std");
const vec3 = @import("../math.zig").vec3;
const Vec3 = @import("../math.zig").Vec3;

/// The normal of a face, as long as twice its area.
pub fn faceNormal(positions: []const Vec3, corners: [3]u32) Vec3 {
    const a = positions[corners[0]];
    const ab = vec3.sub(positions[corners[1]], a);
    return vec3.cross(ab, vec3.sub(positions[corners[2]], a));
}

/// Turns the faces around that look against their vertices' normals.
pub fn orient(positions: []const Vec3, normals: []const Vec3, triangles: [][3]u32) void {
    for (triangles) |*corners| {
        const face = faceNormal(positions, corners.*);
        var agreement: f32 = 0;
        for (corners) |corner| agreement += vec3.dot(face, normals[corner]);
        if (agreement < 0) std.mem.swap(u32, &corners[1], &corners[2]);
    }
}

test orient {
    const positions = [_]Vec3{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } };
    const up: [3]Vec3 = @splat(.{ 0, 0, 1 });
    const none: [3]Vec3 = @splat(.{ 0, 0, 0 });
    var triangles = [_][3]u32{ .{ 0, 1, 2 }, .{ 0, 2, 1 } };
    orient(&positions, &none, &triangles);
    try std.testing.expectEqual([3]u32{ 0, 2, 1 }, triangles[1]);
    orient(&positions, &up, &triangles);
    try std.testing.expectEqual([3]u32{ 0, 1, 2 }, triangles[0]);
    try std.testing.expectEqual([3]u32{ 0, 1, 2 }, triangles[1]);
}
