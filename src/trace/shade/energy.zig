//! How a specular lobe and what lies below it share light: energy compensation of GGX, in lanes.
//!
//! In: albedos after one reflection (`albedo.zig`), reflectance at normal and grazing incidence by
//! Schlick's approximation. Out: what microfacets send on more than once, and what they leave to
//! the base (Kulla and Conty 2017, "Revisiting Physically Based Shading at Imageworks"; Kelemen and
//! Szirmay-Kalos 2001). Everything is + - * / in a fixed order.

const albedo_file = @import("albedo.zig");
const Bsdf = @import("bsdf.zig").Bsdf;

/// Light that microfacets send on more than once, as a share of what has not left after the first
/// time, with the loss at each of the reflections.
pub inline fn multipleOf(
    comptime Lanes: type,
    albedo: *const albedo_file.Albedo(Lanes),
    f0: Lanes.F32,
    f90: Lanes.F32,
) Lanes.F32 {
    const one: Lanes.F32 = .splat(1);
    // The mean of Schlick's approximation over the hemisphere.
    const mean = f0.add(f90.sub(f0).mul(.splat(1.0 / 21.0)));
    const lost = one.sub(mean.mul(albedo.missing_mean));
    return mean.mul(mean).mul(one.sub(albedo.missing_mean)).div(lost);
}

/// Directional albedo of the specular lobe, what is scattered more than once included.
pub inline fn specularOf(
    comptime Lanes: type,
    directional: albedo_file.Directional(Lanes),
    scatter: Lanes.F32,
    f0: Lanes.F32,
    f90: Lanes.F32,
) Lanes.F32 {
    return directional.single(f0, f90).add(scatter.mul(directional.missing));
}

/// Mean over the hemisphere, weighted by the cosine, of what the specular lobe leaves to the base
/// below it; > 0.
pub inline fn belowMean(
    comptime Lanes: type,
    albedo: *const albedo_file.Albedo(Lanes),
    f0: Lanes.F32,
    f90: Lanes.F32,
    scatter: Lanes.F32,
) Lanes.F32 {
    const one: Lanes.F32 = .splat(1);
    const mean = f0.add(f90.sub(f0).mul(albedo.schlick_mean));
    const single = mean.mul(one.sub(albedo.missing_mean));
    return one.sub(single).sub(scatter.mul(albedo.missing_mean)).max(.splat(1e-3));
}

/// What lies above a base leaves these shares to its specular and to its diffuse part.
pub fn weaken(
    comptime Lanes: type,
    bsdf: *Bsdf(Lanes),
    specular: Lanes.F32,
    diffuse: Lanes.F32,
) void {
    bsdf.specular_albedo = bsdf.specular_albedo.scale(specular);
    bsdf.diffuse_albedo = bsdf.diffuse_albedo.scale(diffuse);
    // Schlick's approximation is linear in both.
    bsdf.f0 = bsdf.f0.scale(specular);
    bsdf.f90 = bsdf.f90.mul(specular);
    bsdf.multiple = bsdf.multiple.scale(specular);
    bsdf.diffuse = bsdf.diffuse.scale(diffuse);
    bsdf.mirror.reflected = bsdf.mirror.reflected.scale(specular);
    bsdf.mirror.transmitted = bsdf.mirror.transmitted.scale(specular);
}

/// Reflectance for Schlick's weight (1 - cosine)^5.
pub inline fn schlickOf(
    comptime Lanes: type,
    f0: Lanes.Vec3,
    f90: Lanes.F32,
    weight: Lanes.F32,
) Lanes.Vec3 {
    const grazing: Lanes.Vec3 = .{ .x = f90, .y = f90, .z = f90 };
    return f0.add(grazing.sub(f0).scale(weight));
}
