//! The equal-area octahedral map between directions and a square (Clarberg, "Fast equal-area
//! mapping of the (hemi)sphere using SIMD", 2008), with z the axis: the square's centre is +z, its
//! corners are -z. Maps of PBRT's version 4 are laid out so.

const std = @import("std");
const elementary = @import("elementary.zig");
const Vec3d = [3]f64;

/// Where in the square, 0..1 each, a direction of unit length is.
pub fn toSquare(direction: Vec3d) [2]f64 {
    const x = @abs(direction[0]);
    const y = @abs(direction[1]);
    const z = @abs(direction[2]);
    const radius = @sqrt(@max(0, 1 - z));
    // The share of a quarter turn, from x to y.
    const phi = if (x == 0 and y == 0) 0 else quarterTurns(x, y);
    var v = phi * radius;
    var u = radius - v;
    // The lower half lies outside of the diamond, mirrored at its edges.
    if (direction[2] < 0) {
        const inner = u;
        u = 1 - v;
        v = 1 - inner;
    }
    const signed: [2]f64 = .{
        std.math.copysign(u, direction[0]),
        std.math.copysign(v, direction[1]),
    };
    return .{ 0.5 * (signed[0] + 1), 0.5 * (signed[1] + 1) };
}

/// The direction at a point of the square.
pub fn fromSquare(point: [2]f64) Vec3d {
    const u = 2 * point[0] - 1;
    const v = 2 * point[1] - 1;
    const across = @abs(u);
    const down = @abs(v);
    const inside = 1 - (across + down);
    const radius = 1 - @abs(inside);
    const share = if (radius == 0) 1 else (down - across) / radius + 1;
    const phi = share * (std.math.pi / 4.0);
    const height = std.math.copysign(1 - radius * radius, inside);
    const out = radius * @sqrt(@max(0, 2 - radius * radius));
    return .{
        std.math.copysign(elementary.cos(phi) * out, u),
        std.math.copysign(elementary.sin(phi) * out, v),
        height,
    };
}

/// Angle of (x, y), both at least 0 and one of them above, in quarter turns: Newton's method for
/// x sin = y cos from a rational guess within 0.005, where an error e becomes a third of e^3.
fn quarterTurns(x: f64, y: f64) f64 {
    const swap = y > x;
    const ratio = if (swap) x / y else y / x;
    var angle = ratio / (1 + 0.28 * ratio * ratio);
    for (0..2) |_| {
        const sine = elementary.sin(angle);
        const cosine = elementary.cos(angle);
        angle += (ratio * cosine - sine) / (cosine + ratio * sine);
    }
    const turns = angle * (2.0 / std.math.pi);
    return if (swap) 1 - turns else turns;
}

test "the axis, the equator and the corners" {
    const cases = [_]struct { [2]f64, Vec3d }{
        .{ .{ 0.5, 0.5 }, .{ 0, 0, 1 } },
        .{ .{ 1, 0.5 }, .{ 1, 0, 0 } },
        .{ .{ 0, 0.5 }, .{ -1, 0, 0 } },
        .{ .{ 0.5, 1 }, .{ 0, 1, 0 } },
        .{ .{ 0.5, 0 }, .{ 0, -1, 0 } },
        .{ .{ 0.75, 0.75 }, .{ @sqrt(0.5), @sqrt(0.5), 0 } },
    };
    for (cases) |case| {
        const square = toSquare(case[1]);
        for (square, case[0]) |value, wanted| {
            try std.testing.expectApproxEqAbs(wanted, value, 1e-12);
        }
        const direction = fromSquare(case[0]);
        for (direction, case[1]) |value, wanted| {
            try std.testing.expectApproxEqAbs(wanted, value, 1e-12);
        }
    }
    for ([_][2]f64{ .{ 0, 0 }, .{ 1, 0 }, .{ 0, 1 }, .{ 1, 1 } }) |corner| {
        try std.testing.expectApproxEqAbs(-1, fromSquare(corner)[2], 1e-12);
    }
}

test "there and back is where one was, and areas are even" {
    const side = 32;
    var sum: Vec3d = .{ 0, 0, 0 };
    var squares: f64 = 0;
    for (0..side) |row| for (0..side) |column| {
        const point: [2]f64 = .{
            (@as(f64, @floatFromInt(column)) + 0.5) / side,
            (@as(f64, @floatFromInt(row)) + 0.5) / side,
        };
        const direction = fromSquare(point);
        for (&sum, direction) |*to, part| to.* += part;
        squares += direction[2] * direction[2];
        const back = toSquare(direction);
        for (back, point) |value, wanted| {
            try std.testing.expectApproxEqAbs(wanted, value, 1e-9);
        }
    };
    // The means of a direction and of its square over the sphere.
    const count = side * side;
    for (sum) |component| try std.testing.expectApproxEqAbs(0, component / count, 1e-12);
    try std.testing.expectApproxEqAbs(1.0 / 3.0, squares / count, 2e-3);
}
