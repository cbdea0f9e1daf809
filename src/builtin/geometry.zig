//! Points and placements in f64, in which the procedural scenes are computed.
//!
//! Coordinates are rounded to f32 once, when a vertex enters a mesh; until then only + - * / and
//! square roots are used (and `math.elementary`), so that the meshes have the same bits on every
//! target.

const std = @import("std");
const assert = std.debug.assert;
const math = @import("../math.zig");

/// A point or a direction: x, y, z.
pub const Point = @Vector(3, f64);

/// (x x' + y y') + z z'.
pub fn dot(a: Point, b: Point) f64 {
    return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
}

/// The right-handed cross product.
pub fn cross(a: Point, b: Point) Point {
    return .{
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    };
}

/// Every component times `factor`.
pub fn scale(a: Point, factor: f64) Point {
    return a * @as(Point, @splat(factor));
}

/// Euclidean length.
pub fn length(a: Point) f64 {
    return @sqrt(dot(a, a));
}

/// `a` with length 1. Asserts that it has a direction.
pub fn normalize(a: Point) Point {
    const a_length = length(a);
    assert(a_length > 1e-12);
    return a / @as(Point, @splat(a_length));
}

/// From `a` (t = 0) to `b` (t = 1).
pub fn mix(a: Point, b: Point, t: f64) Point {
    return a + scale(b - a, t);
}

/// Where a part stands: a rotation and a translation.
pub const Place = struct {
    /// Images of the axes, of length 1, at right angles and right-handed.
    x: Point,
    y: Point,
    z: Point,
    origin: Point,

    /// Nothing is moved.
    pub const identity: Place = .at(.{ 0, 0, 0 });

    /// Moved to `origin`, not turned.
    pub fn at(origin: Point) Place {
        return .{ .x = .{ 1, 0, 0 }, .y = .{ 0, 1, 0 }, .z = .{ 0, 0, 1 }, .origin = origin };
    }

    /// Image of a point.
    pub fn point(place: Place, p: Point) Point {
        return place.direction(p) + place.origin;
    }

    /// Image of a direction.
    pub fn direction(place: Place, d: Point) Point {
        return scale(place.x, d[0]) + scale(place.y, d[1]) + scale(place.z, d[2]);
    }

    /// This place, moved by an offset in its own axes.
    pub fn moved(place: Place, offset: Point) Place {
        var result = place;
        result.origin = place.point(offset);
        return result;
    }

    /// This place, turned about its own y by quarter turns from x towards z.
    pub fn turned(place: Place, quarters: u2) Place {
        var result = place;
        for (0..quarters) |_| {
            const old_x = result.x;
            result.x = result.z;
            result.z = -old_x;
        }
        return result;
    }
};

/// Rounded to f32; what is too small to matter becomes a true zero, never a denormal or -0.
pub fn toVec3(a: Point) math.Vec3 {
    var rounded: math.Vec3 = undefined;
    inline for (0..3) |axis| {
        rounded[axis] = if (@abs(a[axis]) < 1e-9) 0 else @floatCast(a[axis]);
    }
    return rounded;
}

test "small coordinates become zero without a sign" {
    const rounded = toVec3(.{ -1e-12, 1e-40, -0.0 });
    for (rounded) |value| try std.testing.expectEqual(@as(u32, 0), @as(u32, @bitCast(value)));
    try std.testing.expectEqual(math.Vec3{ 1, -2, 0.5 }, toVec3(.{ 1, -2, 0.5 }));
}

test "places move and turn in their own axes" {
    const quarter = Place.at(.{ 1, 2, 3 }).turned(1);
    try std.testing.expectEqual(Point{ 0, 2, 3 }, quarter.point(.{ 0, 0, 1 }));
    try std.testing.expectEqual(Point{ 1, 2, 4 }, quarter.point(.{ 1, 0, 0 }));
    try std.testing.expectEqual(Point{ 1, 7, 4 }, quarter.moved(.{ 1, 0, 0 }).point(.{ 0, 5, 0 }));
    try std.testing.expectEqual(Place.identity, Place.identity.turned(3).turned(1));
}

test "a unit vector has length 1" {
    const unit = normalize(.{ 3, -4, 12 });
    try std.testing.expectApproxEqAbs(@as(f64, 1), length(unit), 1e-15);
    try std.testing.expectEqual(Point{ 0, 0, 1 }, cross(.{ 1, 0, 0 }, .{ 0, 1, 0 }));
    try std.testing.expectEqual(Point{ 2, 3, 4 }, mix(.{ 1, 2, 3 }, .{ 3, 4, 5 }, 0.5));
}
