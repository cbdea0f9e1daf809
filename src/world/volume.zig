//! What fills the closed surfaces of a scene, by priority.

const std = @import("std");
const math = @import("../math.zig");
const Vec3 = math.Vec3;

/// What is inside surfaces of some materials. Where several volumes overlap, the one of the lowest
/// rank is there.
pub const Volume = struct {
    ior: f32,
    /// Extinction coefficient, per metre: what light loses on its way, absorbed or scattered.
    sigma_t: Vec3,
    /// Of it what is scattered, with this mean cosine.
    sigma_s: Vec3,
    scatter_anisotropy: f32,
    /// Light goes in and out, through surfaces that have as much front as back: it can be told
    /// whether a ray is inside.
    nests: bool,

    /// Rank of where no volume is.
    pub const air = std.math.maxInt(u16);

    /// Whether rays inside meet light that is scattered.
    pub inline fn scatters(volume: *const Volume) bool {
        const sigma = volume.sigma_s;
        return volume.nests and (sigma[0] > 0 or sigma[1] > 0 or sigma[2] > 0);
    }

    /// Index of refraction of a volume by rank.
    pub inline fn iorOf(volumes: []const Volume, rank: u16) f32 {
        return if (rank < volumes.len) volumes[rank].ior else 1;
    }

    /// Extinction coefficient of a volume by rank.
    pub inline fn sigmaOf(volumes: []const Volume, rank: u16) Vec3 {
        return if (rank < volumes.len) volumes[rank].sigma_t else .{ 0, 0, 0 };
    }
};
