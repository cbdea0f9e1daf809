//! The environment: what surrounds the scene.

const math = @import("../math.zig");
const Vec3 = math.Vec3;

/// What a ray that leaves the scene sees, and the light that comes from everywhere.
pub const Environment = struct {
    /// Constant radiance from all sides, gray.
    ambient: f32,
    /// What primary rays see where there is nothing, linear RGB.
    background: Vec3,
};
