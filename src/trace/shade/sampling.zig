//! Directions of specular lobes in lanes: mirror images of the view about visible normals.
//!
//! In: microfacets, points of the unit disc. Out: unit vectors towards light, their density by
//! solid angle. Visible normals are those of `microfacet.zig`. Everything is + - * / sqrt in a
//! fixed order.

const bsdf_file = @import("bsdf.zig");
const microfacet = @import("microfacet.zig");
const Coating = @import("coating.zig").Coating;
const Interaction = @import("interaction.zig").Interaction;

/// Least alpha of lobes that are sampled; narrower ones are one direction. Floats still know the
/// density of the microfacets, and the lobe is about as wide as a pixel.
pub const sharp_alpha_least = 1e-3;

/// Gives the lobes of a BSDF the roughness that the surface has, down to `sharp_alpha_least`, for
/// integrators whose samples find narrow ones.
pub fn sharpen(
    comptime Lanes: type,
    point: *const Interaction(Lanes),
    bsdf: *bsdf_file.Bsdf(Lanes),
) void {
    setRoughness(Lanes, point, bsdf, sharp_alpha_least);
}

/// Gives them that of highlights again.
pub fn widen(
    comptime Lanes: type,
    point: *const Interaction(Lanes),
    bsdf: *bsdf_file.Bsdf(Lanes),
) void {
    const least = bsdf_file.highlight_roughness_least;
    setRoughness(Lanes, point, bsdf, least * least);
}

inline fn setRoughness(
    comptime Lanes: type,
    point: *const Interaction(Lanes),
    bsdf: *bsdf_file.Bsdf(Lanes),
    least: f32,
) void {
    const rough = point.material.roughness;
    bsdf.alpha = rough.mul(rough).max(.splat(least));
    bsdf.smith_view = microfacet.smith(Lanes, bsdf.cos_view, bsdf.alpha.mul(bsdf.alpha));
    if (!bsdf.layered) return;
    bsdf.stretch.alpha_least = least;
    const coating = &bsdf.coating;
    coating.alpha = coating.roughness.mul(coating.roughness).max(.splat(least));
    const squared = coating.alpha.mul(coating.alpha);
    coating.smith_view = microfacet.smith(Lanes, coating.cos_view, squared);
}

/// Lanes whose lobe of this roughness is one direction.
pub inline fn isSharp(comptime Lanes: type, roughness: Lanes.F32) Lanes.Mask {
    return roughness.mul(roughness).le(.splat(sharp_alpha_least));
}

/// Even microfacets from one direction.
pub fn Facets(comptime Lanes: type) type {
    const F32 = Lanes.F32;
    const Vec3 = Lanes.Vec3;
    return struct {
        normal: Vec3,
        /// Cosine between normal and view, > 0.
        cos_view: F32,
        /// See `microfacet.smith`.
        smith_view: F32,
        alpha: F32,

        /// Mirror image of the view for a point of the disc, in the frame of two unit vectors
        /// across the normal and itself.
        pub inline fn mirrored(
            facets: *const @This(),
            across: [2]Vec3,
            view: Vec3,
            disc: [2]F32,
        ) Vec3 {
            const local: Vec3 = .{
                .x = across[0].dot(view),
                .y = across[1].dot(view),
                .z = facets.cos_view,
            };
            const alphas = [2]F32{ facets.alpha, facets.alpha };
            return imageOf(Lanes, local.normalize(), alphas, disc);
        }

        /// Density of `mirrored` by the half vector of view and light, per steradian on the whole
        /// sphere.
        pub inline fn pdf(facets: *const @This(), half: Vec3) F32 {
            const along = facets.normal.dot(half);
            // As `Bsdf.evalLobes` has it, which is asked for the same direction.
            const cos_half = along.max(.zero()).min(.splat(1));
            const a = facets.alpha.mul(facets.alpha);
            const seen = facets.cos_view.add(facets.smith_view);
            const density = microfacet.distribution(Lanes, cos_half, a).div(seen.add(seen));
            return .select(along.gt(.zero()), density, .zero());
        }
    };
}

/// Those of a base, where they are even.
pub inline fn baseOf(
    comptime Lanes: type,
    point: *const Interaction(Lanes),
    bsdf: *const bsdf_file.Bsdf(Lanes),
) Facets(Lanes) {
    return .{
        .normal = point.normal,
        .cos_view = bsdf.cos_view,
        .smith_view = bsdf.smith_view,
        .alpha = bsdf.alpha,
    };
}

/// Those of a coat.
pub inline fn coatOf(comptime Lanes: type, coating: *const Coating(Lanes)) Facets(Lanes) {
    return .{
        .normal = coating.normal,
        .cos_view = coating.cos_view,
        .smith_view = coating.smith_view,
        .alpha = coating.alpha,
    };
}

/// Mirror image of a view about a normal that it sees, for a point of the disc, all in the frame.
pub inline fn imageOf(
    comptime Lanes: type,
    view: Lanes.Vec3,
    alphas: [2]Lanes.F32,
    disc: [2]Lanes.F32,
) Lanes.Vec3 {
    const half = microfacet.visibleNormalOf(Lanes, view, alphas, disc);
    const twice = view.dot(half).mul(.splat(2));
    return half.scale(twice).sub(view);
}

/// Direction of the hemisphere for a point of the disc, uniform as that is: Lambert's equal-area
/// projection.
pub inline fn evenOf(comptime Lanes: type, disc: [2]Lanes.F32) Lanes.Vec3 {
    const squared = disc[0].mul(disc[0]).add(disc[1].mul(disc[1])).min(.splat(1));
    const wide = Lanes.F32.splat(2).sub(squared).sqrt();
    return .{
        .x = disc[0].mul(wide),
        .y = disc[1].mul(wide),
        .z = Lanes.F32.splat(1).sub(squared),
    };
}

/// Out of the frame, as a unit vector.
pub inline fn turn(
    comptime Lanes: type,
    across: [2]Lanes.Vec3,
    normal: Lanes.Vec3,
    way: Lanes.Vec3,
) Lanes.Vec3 {
    return across[0].scale(way.x).add(across[1].scale(way.y))
        .add(normal.scale(way.z)).normalize();
}
