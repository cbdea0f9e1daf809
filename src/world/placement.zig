//! Where an instance of a mesh stands: what its map does to points, normals and tangents.
//!
//! In: what a mesh has. Out: the same in world space. Whoever asks gets the same bits, when the
//! scene is flattened as when a ray comes to an instance that shares its mesh with others: there is
//! but one expression for each.

const std = @import("std");
const math = @import("../math.zig");
const vec3 = math.vec3;
const Affine = math.Affine;
const AffineD = math.AffineD;
const Vec3 = math.Vec3;
const Vec3d = math.Vec3d;

/// Maps into the world.
pub const Placement = struct {
    point: AffineD,
    direction: Affine,
    normal: Affine,
    /// The maps turn fronts into backs.
    mirrored: bool,

    /// By a map that may overflow to infinity or NaN.
    pub fn of(map: AffineD, mirrored: bool) Placement {
        const scaled = scaledDown(.of(map));
        return .{
            .point = map,
            .direction = scaled,
            .normal = normalMap(scaled, mirrored),
            .mirrored = mirrored,
        };
    }

    /// A point, rounded once.
    pub inline fn placePoint(placement: *const Placement, at: Vec3) Vec3 {
        return round(placement.point.point(widen(at)));
    }

    /// A normal, not of unit length.
    pub inline fn placeNormal(placement: *const Placement, normal: Vec3) Vec3 {
        return tameNormal(placement.normal.direction(normal));
    }

    /// Tangents lie in the surface and go where directions go. The bitangent, which goes there too,
    /// is cross(normal, tangent) times the sign: mirroring maps turn the cross product, so the sign
    /// turns with it.
    pub inline fn placeTangent(placement: *const Placement, tangent: [4]f32) [4]f32 {
        const sign: f32 = if (placement.mirrored) -1 else 1;
        const mapped = tameNormal(placement.direction.direction(tangent[0..3].*));
        return .{ mapped[0], mapped[1], mapped[2], tangent[3] * sign };
    }
};

/// A point in double precision.
pub inline fn widen(point: Vec3) Vec3d {
    return .{ point[0], point[1], point[2] };
}

/// A point in single precision: the one rounding of all that is placed in the world.
pub inline fn round(point: Vec3d) Vec3 {
    return .{ @floatCast(point[0]), @floatCast(point[1]), @floatCast(point[2]) };
}

/// The linear part over its largest entry, so that neither tiny nor huge maps leave the range of an
/// f32 when its entries are multiplied.
fn scaledDown(map: Affine) Affine {
    var largest: f32 = 0;
    for ([_]Vec3{ map.x, map.y, map.z }) |axis| {
        for (axis) |entry| largest = if (@abs(entry) > largest) @abs(entry) else largest;
    }
    if (!(largest > std.math.floatMin(f32)) or largest == std.math.inf(f32)) largest = 1;
    return .{
        .x = divide(map.x, largest),
        .y = divide(map.y, largest),
        .z = divide(map.z, largest),
        .translation = .{ 0, 0, 0 },
    };
}

/// The map for normals: cofactors, which turn with a mirroring map's winding, so turned back for
/// those.
fn normalMap(scaled: Affine, mirrored: bool) Affine {
    const sign: f32 = if (mirrored) -1 else 1;
    return .{
        .x = vec3.scale(vec3.cross(scaled.y, scaled.z), sign),
        .y = vec3.scale(vec3.cross(scaled.z, scaled.x), sign),
        .z = vec3.scale(vec3.cross(scaled.x, scaled.y), sign),
        .translation = .{ 0, 0, 0 },
    };
}

fn divide(a: Vec3, divisor: f32) Vec3 {
    return .{ a[0] / divisor, a[1] / divisor, a[2] / divisor };
}

/// Normals are interpolated without being made unit vectors first, which wants them in a range
/// where sums and squares keep their digits; beyond it the length is given up.
fn tameNormal(normal: Vec3) Vec3 {
    const largest = vec3.maxComponent(.{ @abs(normal[0]), @abs(normal[1]), @abs(normal[2]) });
    if (largest > 1e-12 and largest < 1e12) return normal;
    return vec3.normalize(normal) orelse .{ 0, 0, 0 };
}
