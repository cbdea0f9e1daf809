//! Pure value functions: vectors, affine maps, boxes and elementary functions.
//!
//! Everything here is plain IEEE arithmetic in a fixed order without libm, so that its results
//! have the same bits on every target.

/// Operations on three floats, and affine maps, of any precision.
pub const Vec3Operations = @import("math/vec3.zig").Operations;
pub const AffineMap = @import("math/affine.zig").Affine;
/// `value` with a denormal number replaced by zero of its sign: what flush-to-zero hardware reads.
pub const flushDenormal = @import("math/vec3.zig").flushDenormal;
/// Axis-aligned boxes.
pub const box3 = @import("math/box3.zig");
/// Directions as points of a square.
pub const octahedral = @import("math/octahedral.zig");
/// Sine, cosine, tangent, arc cosine, exponential, logarithm, power.
pub const elementary = @import("math/elementary.zig");
/// Directions on a square.
pub const equal_area = @import("math/equal_area.zig");
/// Values as colours.
pub const magma = @import("math/magma.zig");
/// The sRGB transfer function.
pub const srgb = @import("math/srgb.zig");

/// Points, directions, colours, and what is done with them; `Vec3d` is in double precision.
pub const Vec3 = [3]f32;
pub const Vec3d = [3]f64;
pub const vec3 = Vec3Operations(Vec3);
pub const vec3d = Vec3Operations(Vec3d);
/// A linear map and a translation.
pub const Affine = AffineMap(Vec3);
pub const AffineD = AffineMap(Vec3d);
/// An axis-aligned box.
pub const Box3 = box3.Box3;

test {
    _ = @import("math/vec3.zig");
    _ = @import("math/affine.zig");
    _ = box3;
    _ = magma;
    _ = octahedral;
    _ = elementary;
    _ = equal_area;
    _ = srgb;
}
