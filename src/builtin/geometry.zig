//! Points and placements in f64, in which the procedural scenes are computed.
//!
//! Coordinates are rounded to f32 once, when a vertex enters a mesh; until then only + - * / and
//! square roots are used (and `math.elementary`), so that the meshes have the same bits on every
//! target.

const std = @import("std");
const math = @import("../math.zig");

/// A point or a direction: x, y, z. A vector, for its operators.
pub const Point = @Vector(3, f64);

/// Where a part stands: a rotation and a translation.
pub const Place = math.AffineMap(Point);

const operations = math.Vec3Operations(Point);
pub const dot = operations.dot;
pub const cross = operations.cross;
pub const scale = operations.scale;
pub const length = operations.length;
pub const mix = operations.mix;

/// `a` with length 1. Asserts that it has a direction.
pub fn normalize(a: Point) Point {
    return operations.normalize(a).?;
}

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

test "a unit vector has length 1" {
    const unit = normalize(.{ 3, -4, 12 });
    try std.testing.expectApproxEqAbs(@as(f64, 1), length(unit), 1e-15);
    try std.testing.expectEqual(Point{ 2, 3, 4 }, mix(.{ 1, 2, 3 }, .{ 3, 4, 5 }, 0.5));
}
