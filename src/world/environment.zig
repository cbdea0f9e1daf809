//! The environment: what surrounds the scene, and the light that comes from it.
//!
//! A map is radiance by direction, ready to be looked up: as it is with smaller copies, weighted by
//! the GGX lobe of several roughnesses (the first sum of Karis 2013, Real Shading in Unreal Engine
//! 4), and weighted by the cosine. All are octahedral (`math/octahedral.zig`).

const std = @import("std");
const math = @import("../math.zig");
const Vec3 = math.Vec3;

/// What a ray that leaves the scene sees, and the light that comes from everywhere.
pub const Environment = struct {
    /// Constant radiance from all sides, gray.
    ambient: f32,
    /// What primary rays see where there is nothing, linear RGB.
    background: Vec3,
    /// Radiance by direction, besides; null: none.
    map: ?*const EnvironmentMap = null,
    /// Rows of the rotation from the world's directions to those of the map.
    to_map: [3]Vec3 = .{ .{ 1, 0, 0 }, .{ 0, 1, 0 }, .{ 0, 0, 1 } },
    /// Multiplies the radiance of the map.
    scale: Vec3 = .{ 1, 1, 1 },
    /// Primary rays see the map in place of the background.
    is_seen: bool = false,
    /// What primary rays see in place of all this, by which nothing is lit.
    backdrop: ?*const Environment = null,
    /// Directional lights that stand for the map in each sample, to find how much of it arrives; 0:
    /// all of it does, everywhere.
    shadow_count: u32 = 0,
    /// Of a plane that primary rays do not see but for the shadow on it; null: none.
    floor_height: ?f32 = null,
};

/// Red, green, blue, and a fourth that is not used, so that a texel is loaded at once.
pub const EnvironmentTexel = @Vector(4, f32);

/// A square of texels in the octahedral map.
pub const EnvironmentLevel = struct {
    /// Texels along each side, without the border.
    size: u32,
    /// Rows of `size` + 2: a border repeats what lies beyond each edge, so that four texels can be
    /// mixed everywhere.
    texels: []const EnvironmentTexel,
};

/// A small part of the sky in the order of `EnvironmentMap.parts`, with all that come before it.
pub const EnvironmentPart = struct {
    solid_angle: f64,
    /// Luminance times solid angle.
    luminance: f64,
    /// Radiance times solid angle, linear RGB.
    energy: [3]f64,
    /// Direction, weighted by luminance times solid angle.
    moment: [3]f64,
};

/// A source so small and strong that it is one light.
pub const EnvironmentSource = struct { direction: Vec3, energy: Vec3 };

/// Radiance from far away by direction.
pub const EnvironmentMap = struct {
    /// From the finest, each next one half as wide.
    radiance: []const EnvironmentLevel,
    /// Number k is what a lobe of roughness (k + 1) / `glossy.len` around its direction sees.
    glossy: []const EnvironmentLevel,
    /// Irradiance over pi by normal.
    diffuse: EnvironmentLevel,
    /// Running sums over all directions but the sources', along a curve that keeps neighbours
    /// together; the first is zero. For `lights`.
    parts: []const EnvironmentPart,
    sources: []const EnvironmentSource,
};
