//! Light sources in world space: punctual ones (KHR_lights_punctual), and surfaces that emit.

const math = @import("../math.zig");
const Vec3 = math.Vec3;

/// A point, spot or directional light, or a surface that emits.
pub const Light = struct {
    pub const Kind = enum { point, spot, directional, emitter };

    kind: Kind,
    /// Shadow rays of a point or spot light run from the light, so that all of them share an
    /// origin, unless rounding there would be large for the scene: then they run from what they
    /// light.
    from_receiver: bool,
    /// Of all but directional lights.
    position: Vec3,
    /// Unit vector the way the light travels, or most of it; unused for point lights.
    direction: Vec3,
    /// Linear RGB in candela (point, spot, emitter) or lux (directional).
    intensity: Vec3,
    /// 1 / range^2, 0 without a range.
    range_inv_squared: f32,
    /// Cone of a spot: clamp(cosine * scale + offset, 0, 1)^2, or an emitter's lobe: the same
    /// without the square and the upper limit; 0 and 1 for the others.
    cone_scale: f32,
    cone_offset: f32,
    /// What is nearer to the position than this casts no shadow, in metres: parts of an emitter.
    radius: f32 = 0,
    /// Added to the squared distance, in square metres: the square of the radius of the disk that
    /// an emitter is as large as, so that its light is bounded where it is near.
    disk: f32 = 0,
};
