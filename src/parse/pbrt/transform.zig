//! The current transformation: affine maps in f64, as PBRT's directives build them.
//!
//! PBRT writes matrices by columns, and lets each directive act before what stands already: the
//! last one is the first that meets a point. A matrix with a projective row is refused.

const std = @import("std");
const math = @import("../../math.zig");
const elementary = math.elementary;
const AffineD = math.AffineD;

const Transform = @This();

/// Three numbers: a point, a direction, an axis.
pub const Vector = [3]f64;

/// Images of the axes x, y and z.
axes: [3]Vector = .{ .{ 1, 0, 0 }, .{ 0, 1, 0 }, .{ 0, 0, 1 } },
/// Image of the origin.
origin: Vector = .{ 0, 0, 0 },

pub const identity: Transform = .{};

/// a + b.
pub fn add(a: Vector, b: Vector) Vector {
    return .{ a[0] + b[0], a[1] + b[1], a[2] + b[2] };
}

/// a - b.
pub fn subtract(a: Vector, b: Vector) Vector {
    return .{ a[0] - b[0], a[1] - b[1], a[2] - b[2] };
}

/// a times a number.
pub fn scaled(a: Vector, factor: f64) Vector {
    return .{ a[0] * factor, a[1] * factor, a[2] * factor };
}

/// Sum of the products.
pub fn dot(a: Vector, b: Vector) f64 {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// The right-handed cross product.
pub fn cross(a: Vector, b: Vector) Vector {
    return .{
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    };
}

/// `a` at length 1, or null where that has no meaning.
pub fn normalize(a: Vector) ?Vector {
    const length = @sqrt(dot(a, a));
    if (!(length > 1e-300 and length < 1e300)) return null;
    return scaled(a, 1 / length);
}

/// Moves by `offset`.
pub fn translation(offset: Vector) Transform {
    return .{ .origin = offset };
}

/// Scales along the axes.
pub fn scaling(factors: Vector) Transform {
    return .{ .axes = .{ .{ factors[0], 0, 0 }, .{ 0, factors[1], 0 }, .{ 0, 0, factors[2] } } };
}

/// Turns about `axis`, counter-clockwise seen from its tip in a right-handed space; null where the
/// axis has no direction or the angle is absurd.
pub fn rotation(angle_deg: f64, axis: Vector) ?Transform {
    const a = normalize(axis) orelse return null;
    if (!(@abs(angle_deg) <= 1e6)) return null;
    const angle = angle_deg * (std.math.pi / 180.0);
    const sine = elementary.sin(angle);
    const cosine = elementary.cos(angle);
    var result: Transform = .{};
    for (&result.axes, 0..) |*image, index| {
        var unit: Vector = .{ 0, 0, 0 };
        unit[index] = 1;
        // Rodrigues: the part along the axis stays, the rest turns.
        const along = scaled(a, dot(a, unit));
        const across = subtract(unit, along);
        image.* = add(along, add(scaled(across, cosine), scaled(cross(a, unit), sine)));
    }
    return result;
}

/// The map from world to camera of a camera at `eye` that looks at `target`: its x is
/// cross(up, forward), which is the right side of a left-handed world. Null where the three leave
/// no direction.
pub fn lookAt(eye: Vector, target: Vector, up: Vector) ?Transform {
    const forward = normalize(subtract(target, eye)) orelse return null;
    const right = normalize(cross(normalize(up) orelse return null, forward)) orelse return null;
    const camera: Transform = .{
        .axes = .{ right, cross(forward, right), forward },
        .origin = eye,
    };
    return camera.inverse();
}

/// Of sixteen numbers, by columns; null where the matrix is not affine.
pub fn fromMatrix(m: *const [16]f64) ?Transform {
    if (m[3] != 0 or m[7] != 0 or m[11] != 0 or m[15] == 0) return null;
    const w = 1 / m[15];
    return .{
        .axes = .{
            .{ m[0] * w, m[1] * w, m[2] * w },
            .{ m[4] * w, m[5] * w, m[6] * w },
            .{ m[8] * w, m[9] * w, m[10] * w },
        },
        .origin = .{ m[12] * w, m[13] * w, m[14] * w },
    };
}

/// The image of a direction.
pub fn direction(map: *const Transform, d: Vector) Vector {
    const xy = add(scaled(map.axes[0], d[0]), scaled(map.axes[1], d[1]));
    return add(xy, scaled(map.axes[2], d[2]));
}

/// The image of a point.
pub fn point(map: *const Transform, p: Vector) Vector {
    return add(map.direction(p), map.origin);
}

/// `outer` after `inner`.
pub fn compose(outer: *const Transform, inner: *const Transform) Transform {
    return .{
        .axes = .{
            outer.direction(inner.axes[0]),
            outer.direction(inner.axes[1]),
            outer.direction(inner.axes[2]),
        },
        .origin = outer.point(inner.origin),
    };
}

/// Volume factor; negative where the map mirrors.
pub fn determinant(map: *const Transform) f64 {
    return dot(map.axes[0], cross(map.axes[1], map.axes[2]));
}

/// The map back, or null where there is none.
pub fn inverse(map: *const Transform) ?Transform {
    const volume = map.determinant();
    if (!(@abs(volume) > 1e-200 and @abs(volume) < 1e200)) return null;
    const rows = [3]Vector{
        scaled(cross(map.axes[1], map.axes[2]), 1 / volume),
        scaled(cross(map.axes[2], map.axes[0]), 1 / volume),
        scaled(cross(map.axes[0], map.axes[1]), 1 / volume),
    };
    var result: Transform = .{};
    for (0..3) |axis| {
        for (0..3) |row| result.axes[axis][row] = rows[row][axis];
    }
    result.origin = scaled(result.direction(map.origin), -1);
    return result;
}

/// Whether all of it fits an f32.
pub fn isFinite(map: *const Transform) bool {
    for (map.axes ++ .{map.origin}) |vector| for (vector) |number| {
        if (!(@abs(number) <= std.math.floatMax(f32))) return false;
    };
    return true;
}

/// In f32, as `toVec3` has it.
pub fn toAffine(map: *const Transform) AffineD {
    return .{
        .x = map.axes[0],
        .y = map.axes[1],
        .z = map.axes[2],
        .translation = map.origin,
    };
}

/// In f32, denormals as zeros, what is out of range at its end.
pub fn toVec3(vector: Vector) math.Vec3 {
    const largest: f64 = std.math.floatMax(f32);
    var result: math.Vec3 = undefined;
    for (vector, &result) |number, *component| {
        const bounded = std.math.clamp(number, -largest, largest);
        component.* = math.flushDenormal(@floatCast(bounded));
    }
    return result;
}

test "directives act in the order in which they stand" {
    const turn = Transform.rotation(90, .{ 0, 0, 2 }).?;
    const map = Transform.translation(.{ 1, 2, 3 }).compose(&turn);
    const image = map.point(.{ 1, 0, 0 });
    for ([3]f64{ 1, 3, 3 }, image) |expected, number| {
        try std.testing.expectApproxEqAbs(expected, number, 1e-12);
    }
    const back = map.inverse().?.point(image);
    try std.testing.expectApproxEqAbs(1, back[0], 1e-12);
    try std.testing.expectEqual(null, Transform.scaling(.{ 1, 0, 1 }).inverse());
    try std.testing.expectEqual(null, Transform.rotation(1, .{ 0, 0, 0 }));
}

test "a camera's x is the right side of a left-handed world" {
    const map = Transform.lookAt(.{ 0, 0, -5 }, .{ 0, 0, 0 }, .{ 0, 1, 0 }).?;
    const seen = map.point(.{ 1, 2, 0 });
    for ([3]f64{ 1, 2, 5 }, seen) |expected, number| {
        try std.testing.expectApproxEqAbs(expected, number, 1e-12);
    }
    try std.testing.expectEqual(null, Transform.lookAt(.{ 1, 1, 1 }, .{ 1, 1, 1 }, .{ 0, 1, 0 }));
    try std.testing.expectEqual(null, Transform.lookAt(.{ 0, 0, 0 }, .{ 0, 2, 0 }, .{ 0, 1, 0 }));
}

test "matrices stand by columns" {
    const map = Transform.fromMatrix(&.{ 1, 0, 0, 0, 0, 2, 0, 0, 0, 0, 3, 0, 4, 5, 6, 1 }).?;
    try std.testing.expectEqual(Vector{ 5, 7, 9 }, map.point(.{ 1, 1, 1 }));
    const projective = [16]f64{ 1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1 };
    try std.testing.expectEqual(null, Transform.fromMatrix(&projective));
}
