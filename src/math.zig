//! Pure value functions on scalars: vectors, affine maps, boxes and elementary functions.
//!
//! Everything here is plain IEEE arithmetic in a fixed order without libm, so that its results
//! have the same bits on every target.

/// Three floats: points, directions, colours.
pub const vec3 = @import("math/vec3.zig");
/// Affine maps of space.
pub const affine = @import("math/affine.zig");
/// Axis-aligned boxes.
pub const box3 = @import("math/box3.zig");
/// Sine, cosine, tangent, exponential, logarithm, power.
pub const elementary = @import("math/elementary.zig");
/// The sRGB transfer function.
pub const srgb = @import("math/srgb.zig");

/// Three floats.
pub const Vec3 = vec3.Vec3;
/// A linear map and a translation.
pub const Affine = affine.Affine;
/// An axis-aligned box.
pub const Box3 = box3.Box3;

test {
    _ = vec3;
    _ = affine;
    _ = box3;
    _ = elementary;
    _ = srgb;
}
