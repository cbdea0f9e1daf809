//! Affine maps of space: what a node of a scene does to the things below it.
//!
//! Held as the images of the three axes and of the origin. Sums run x, y, z, translation in this
//! order, so that composed transforms have the same bits on every target.

const std = @import("std");
const vec3 = @import("vec3.zig");

/// p -> x p.x + y p.y + z p.z + translation, for points `V` as in vec3.zig.
pub fn Affine(comptime V: type) type {
    return struct {
        /// Image of the x axis.
        x: V,
        /// Image of the y axis.
        y: V,
        /// Image of the z axis.
        z: V,
        /// Image of the origin.
        translation: V,

        /// The map that changes nothing.
        pub const identity: Self = .{
            .x = .{ 1, 0, 0 },
            .y = .{ 0, 1, 0 },
            .z = .{ 0, 0, 1 },
            .translation = .{ 0, 0, 0 },
        };

        /// Translation after rotation (unit quaternion x, y, z, w) after scaling: glTF's T R S.
        pub fn fromTrs(translation: V, rotation: [4]Float, scaling: V) Self {
            const x = rotation[0];
            const y = rotation[1];
            const z = rotation[2];
            const w = rotation[3];
            return .{
                .x = vec.scale(.{
                    1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w),
                }, scaling[0]),
                .y = vec.scale(.{
                    2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w),
                }, scaling[1]),
                .z = vec.scale(.{
                    2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y),
                }, scaling[2]),
                .translation = translation,
            };
        }

        /// The same map in another precision, rounded.
        pub fn of(from: anytype) Self {
            var map: Self = undefined;
            inline for (.{ "x", "y", "z", "translation" }) |name| {
                inline for (0..3) |axis| {
                    @field(map, name)[axis] = @floatCast(@field(from, name)[axis]);
                }
            }
            return map;
        }

        /// The image of a point.
        pub inline fn point(map: Self, p: V) V {
            return vec.add(map.direction(p), map.translation);
        }

        /// The image of a direction: the translation does not count.
        pub inline fn direction(map: Self, d: V) V {
            const xy = vec.add(vec.scale(map.x, d[0]), vec.scale(map.y, d[1]));
            return vec.add(xy, vec.scale(map.z, d[2]));
        }

        /// The image of a surface normal, not normalised: cofactors of the linear part, which
        /// unlike the inverse transpose exist for flattening maps too. Turns with a mirroring
        /// map's winding.
        pub inline fn normal(map: Self, n: V) V {
            const xy = vec.add(
                vec.scale(vec.cross(map.y, map.z), n[0]),
                vec.scale(vec.cross(map.z, map.x), n[1]),
            );
            return vec.add(xy, vec.scale(vec.cross(map.x, map.y), n[2]));
        }

        /// Volume factor; negative where the map mirrors.
        pub fn determinant(map: Self) Float {
            return vec.dot(map.x, vec.cross(map.y, map.z));
        }

        /// `outer` after `inner`.
        pub fn compose(outer: Self, inner: Self) Self {
            return .{
                .x = outer.direction(inner.x),
                .y = outer.direction(inner.y),
                .z = outer.direction(inner.z),
                .translation = outer.point(inner.translation),
            };
        }

        /// Whether no entry is infinite or NaN.
        pub fn isFinite(map: Self) bool {
            return vec.isFinite(map.x) and vec.isFinite(map.y) and vec.isFinite(map.z) and
                vec.isFinite(map.translation);
        }

        /// Whether all is put at one place.
        pub fn isPoint(map: Self) bool {
            for ([_]V{ map.x, map.y, map.z }) |axis| {
                for (axis) |number| if (number != 0) return false;
            }
            return true;
        }

        /// Moves by `offset`.
        pub fn translate(offset: V) Self {
            var map: Self = .identity;
            map.translation = offset;
            return map;
        }

        /// Scales along the axes.
        pub fn scale(factors: V) Self {
            var map: Self = .identity;
            map.x[0] = factors[0];
            map.y[1] = factors[1];
            map.z[2] = factors[2];
            return map;
        }

        /// This map after a move by `offset`: moved in its own axes.
        pub fn moved(map: Self, offset: V) Self {
            var result = map;
            result.translation = map.point(offset);
            return result;
        }

        /// This map after quarter turns from x towards z: turned about its own y.
        pub fn turned(map: Self, quarters: u2) Self {
            var result = map;
            for (0..quarters) |_| {
                const old_x = result.x;
                result.x = result.z;
                result.z = vec.neg(old_x);
            }
            return result;
        }

        /// The map back, or null where there is none.
        pub fn inverse(map: Self) ?Self {
            const volume = map.determinant();
            // Well within the range, so that the cofactors over it are, too.
            const small: Float = if (Float == f64) 1e-200 else 1e-25;
            if (!(@abs(volume) > small and @abs(volume) < 1 / small)) return null;
            const rows = [3]V{
                vec.scale(vec.cross(map.y, map.z), 1 / volume),
                vec.scale(vec.cross(map.z, map.x), 1 / volume),
                vec.scale(vec.cross(map.x, map.y), 1 / volume),
            };
            var result: Self = .{
                .x = .{ rows[0][0], rows[1][0], rows[2][0] },
                .y = .{ rows[0][1], rows[1][1], rows[2][1] },
                .z = .{ rows[0][2], rows[1][2], rows[2][2] },
                .translation = undefined,
            };
            result.translation = vec.scale(result.direction(map.translation), -1);
            return result;
        }

        const Self = @This();
        const Float = std.meta.Elem(V);
        const vec = vec3.Operations(V);
    };
}

const Single = Affine([3]f32);

test "translation, rotation and scaling act in this order" {
    const half = @sqrt(@as(f32, 0.5)); // A quarter turn about z.
    const map: Single = .fromTrs(.{ 10, 20, 30 }, .{ 0, 0, half, half }, .{ 2, 3, 4 });
    const p = map.point(.{ 1, 1, 1 });
    try std.testing.expectApproxEqAbs(@as(f32, 7), p[0], 1e-5);
    try std.testing.expectApproxEqAbs(@as(f32, 22), p[1], 1e-5);
    try std.testing.expectApproxEqAbs(@as(f32, 34), p[2], 1e-5);
    try std.testing.expectApproxEqAbs(@as(f32, 24), map.determinant(), 1e-4);
}

test "compose equals doing one after the other, normals stay perpendicular" {
    const a: Single = .fromTrs(.{ 1, 2, 3 }, .{ 0.6, 0, 0, 0.8 }, .{ 1, -2, 0.5 });
    const b: Single = .fromTrs(.{ -1, 0, 5 }, .{ 0, 0.28, 0, 0.96 }, .{ 3, 1, 1 });
    const direct = a.point(b.point(.{ 0.3, -0.7, 2 }));
    const composed = Single.compose(a, b).point(.{ 0.3, -0.7, 2 });
    for (direct, composed) |p, q| try std.testing.expectApproxEqRel(p, q, 1e-5);
    const u: [3]f32 = .{ 1, 2, -1 };
    const v: [3]f32 = .{ 0, 1, 4 };
    const n = a.normal(Single.vec.cross(u, v));
    try std.testing.expectApproxEqAbs(@as(f32, 0), Single.vec.dot(n, a.direction(u)), 1e-4);
    try std.testing.expectApproxEqAbs(@as(f32, 0), Single.vec.dot(n, a.direction(v)), 1e-4);
    const again = Single.vec.cross(a.direction(u), a.direction(v)); // Mirrored maps included.
    for (n, again) |p, q| try std.testing.expectApproxEqAbs(p, q, 1e-4);
}

test "maps move and turn in their own axes" {
    const quarter = Single.translate(.{ 1, 2, 3 }).turned(1);
    try std.testing.expectEqual([3]f32{ 0, 2, 3 }, quarter.point(.{ 0, 0, 1 }));
    try std.testing.expectEqual([3]f32{ 1, 2, 4 }, quarter.point(.{ 1, 0, 0 }));
    const moved = quarter.moved(.{ 1, 0, 0 });
    try std.testing.expectEqual([3]f32{ 1, 7, 4 }, moved.point(.{ 0, 5, 0 }));
    try std.testing.expectEqual(Single.identity, Single.identity.turned(3).turned(1));
}

test "a map and its inverse are nothing, in either precision" {
    const Double = Affine(@Vector(3, f64));
    const map: Double = .compose(.fromTrs(.{ 1, 2, 3 }, .{ 0.6, 0, 0, 0.8 }, .{ 1, -2, 0.5 }), .{
        .x = .{ 1, 0.25, 0 },
        .y = .{ 0, 1, 0 },
        .z = .{ 0, 0, -3 },
        .translation = .{ 4, 0, -5 },
    });
    const back = map.inverse().?.point(map.point(.{ 0.3, -0.7, 2 }));
    inline for (.{ 0.3, -0.7, 2 }, 0..) |expected, axis| {
        try std.testing.expectApproxEqAbs(expected, back[axis], 1e-14);
    }
    const single: Single = .of(map);
    const single_back = single.inverse().?.point(single.point(.{ 0.3, -0.7, 2 }));
    for ([3]f32{ 0.3, -0.7, 2 }, single_back) |expected, component| {
        try std.testing.expectApproxEqAbs(expected, component, 2e-6);
    }
    try std.testing.expectEqual(null, Double.scale(.{ 1, 0, 1 }).inverse());
}
