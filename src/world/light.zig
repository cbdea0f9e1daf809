//! Punctual light sources (KHR_lights_punctual) in world space.

const math = @import("../math.zig");
const Vec3 = math.Vec3;

/// A point, spot or directional light.
pub const Light = struct {
    pub const Kind = enum { point, spot, directional };

    kind: Kind,
    /// Shadow rays of a point or spot light run from the light, so that all of them share an
    /// origin, unless rounding there would be large for the scene: then they run from what they
    /// light.
    from_receiver: bool,
    /// Of point and spot lights.
    position: Vec3,
    /// Unit vector the way the light travels; spot and directional.
    direction: Vec3,
    /// Linear RGB in candela (point, spot) or lux (directional).
    intensity: Vec3,
    /// 1 / range^2, 0 without a range.
    range_inv_squared: f32,
    /// Cone of a spot: clamp(cosine * scale + offset, 0, 1)^2; 0 and 1 for the others.
    cone_scale: f32,
    cone_offset: f32,
};
