//! Axis-aligned boxes: bounds of triangles, nodes and scenes.
//!
//! `empty` is the neutral element of `join`: lower corner +infinity, upper corner -infinity. A NaN
//! coordinate never enters a box (comparisons with it are false).

const std = @import("std");
const Vec3 = [3]f32;
const vec3 = @import("vec3.zig").Operations(Vec3);

/// The points p with lower <= p <= upper on every axis.
pub const Box3 = struct {
    lower: Vec3,
    upper: Vec3,

    /// The box without points.
    pub const empty: Box3 = .{
        .lower = @splat(std.math.inf(f32)),
        .upper = @splat(-std.math.inf(f32)),
    };

    /// The smallest box that holds `box` and the point.
    pub inline fn include(box: Box3, point: Vec3) Box3 {
        return .{ .lower = vec3.min(point, box.lower), .upper = vec3.max(point, box.upper) };
    }

    /// The smallest box that holds both.
    pub inline fn join(a: Box3, b: Box3) Box3 {
        return .{ .lower = vec3.min(a.lower, b.lower), .upper = vec3.max(a.upper, b.upper) };
    }

    /// Grown by `distance` in all six directions.
    pub inline fn grow(box: Box3, distance: f32) Box3 {
        const d: Vec3 = @splat(distance);
        return .{ .lower = vec3.sub(box.lower, d), .upper = vec3.add(box.upper, d) };
    }

    /// Whether the box holds no point.
    pub inline fn isEmpty(box: Box3) bool {
        return !(box.lower[0] <= box.upper[0] and box.lower[1] <= box.upper[1] and
            box.lower[2] <= box.upper[2]);
    }

    /// Lower + upper: twice the centre, without a multiplication that could round.
    pub inline fn centerTwice(box: Box3) Vec3 {
        return vec3.add(box.lower, box.upper);
    }

    /// Edge lengths; negative or infinite for an empty box.
    pub inline fn extent(box: Box3) Vec3 {
        return vec3.sub(box.upper, box.lower);
    }

    /// Half the surface area, 0 for an empty box.
    pub inline fn halfArea(box: Box3) f32 {
        if (box.isEmpty()) return 0;
        const e = box.extent();
        return e[0] * e[1] + (e[1] * e[2] + e[2] * e[0]);
    }

    /// Whether `inner` lies in `box`, borders included; an empty box lies in every one.
    pub fn contains(box: Box3, inner: Box3) bool {
        if (inner.isEmpty()) return true;
        for (0..3) |axis| {
            if (!(box.lower[axis] <= inner.lower[axis])) return false;
            if (!(inner.upper[axis] <= box.upper[axis])) return false;
        }
        return true;
    }
};

test "empty is neutral, NaN does not enter" {
    const nan = std.math.nan(f32);
    try std.testing.expect(Box3.empty.isEmpty());
    try std.testing.expectEqual(0, Box3.empty.halfArea());
    const point = Box3.empty.include(.{ 1, 2, 3 });
    try std.testing.expectEqual(point, Box3.empty.join(point));
    try std.testing.expectEqual(point, point.join(.empty));
    try std.testing.expectEqual(point, point.include(.{ nan, nan, nan }));
    try std.testing.expectEqual(0, point.halfArea());
    try std.testing.expect(point.contains(.empty));
    try std.testing.expect(!Box3.empty.contains(point));
}

test "area and containment" {
    const box = Box3.empty.include(.{ 0, 0, 0 }).include(.{ 1, 2, 3 });
    try std.testing.expectEqual(11, box.halfArea());
    try std.testing.expect(box.contains(box));
    try std.testing.expect(!box.contains(box.grow(0.5)));
    try std.testing.expect(box.grow(0.5).contains(box));
}
