//! Normals from textures, in the frame of tangents (glTF 2.0, section 3.9.3).
//!
//! In: what a texture says, the frame between the vertices. Out: unit normals for shading, on the
//! side that is seen. Where such a normal would mirror what is seen from below the surface, it is
//! bent back until it does not, as the microfacets of one surface do that hide behind others
//! (Schuessler et al. 2017, "Microfacet-based Normal Mapping for Robust Monte Carlo Path Tracing"):
//! so there are no black rims.

const std = @import("std");
const interaction_file = @import("interaction.zig");

/// Cosine that mirror directions have with the geometric normal at least, but where the view has
/// little more itself.
const mirror_cosine_min = 0.01;

/// And the share of the view's that they have then.
const mirror_cosine_share = 0.9;

/// The frame of tangents in lanes, as vertices have it.
pub fn TangentFrame(comptime Lanes: type) type {
    return struct {
        /// Neither is of unit length; the tangent may be zero, see `apply`.
        normal: Lanes.Vec3,
        tangent: Lanes.Vec3,
        /// Of cross(normal, tangent).
        bitangent_sign: Lanes.F32,
    };
}

/// Normals by a texture's channels, 0..1; undefined where the tangent is zero. `scale` multiplies x
/// and y.
pub inline fn apply(
    comptime Lanes: type,
    point: *const interaction_file.Interaction(Lanes),
    frame: *const TangentFrame(Lanes),
    channels: Lanes.Vec3,
    scale: Lanes.F32,
) Lanes.Vec3 {
    const one: Lanes.F32 = .splat(1);
    const normal = interaction_file.unit(Lanes, frame.normal);
    const tangent = interaction_file.unit(Lanes, frame.tangent);
    const bitangent = normal.cross(tangent).scale(frame.bitangent_sign);
    const x = channels.x.add(channels.x).sub(one).mul(scale);
    const y = channels.y.add(channels.y).sub(one).mul(scale);
    const z = channels.z.add(channels.z).sub(one);
    const bumps = tangent.scale(x).add(bitangent.scale(y));
    const mapped = normal.scale(z).add(bumps);
    // All of it as it is where a texture says nothing, or nothing that has a direction.
    const size = mapped.dot(mapped);
    const usable = size.gt(.splat(1e-12)).bitAnd(size.lt(.splat(std.math.inf(f32))));
    const front = Lanes.Vec3.select(usable, mapped, normal).normalize();
    const opposite = normal.dot(point.normal_geometric).lt(.zero());
    return bentBack(Lanes, point, .select(opposite, front.neg(), front));
}

/// Half way from the view to the mirror direction, after that was turned up to where it just leaves
/// the surface.
inline fn bentBack(
    comptime Lanes: type,
    point: *const interaction_file.Interaction(Lanes),
    normal: Lanes.Vec3,
) Lanes.Vec3 {
    const up = point.normal_geometric;
    const cosine = normal.dot(point.view);
    const mirrored = normal.scale(cosine.add(cosine)).sub(point.view);
    const height = mirrored.dot(up);
    const least = point.view.dot(up).mul(.splat(mirror_cosine_share))
        .min(.splat(mirror_cosine_min));
    const across = mirrored.sub(up.scale(height));
    const is_upright = across.dot(across).lt(.splat(1e-8));
    const level = Lanes.Vec3
        .select(is_upright, normal.sub(up.scale(normal.dot(up))), across).normalize();
    const share = Lanes.F32.splat(1).sub(least.mul(least)).sqrt();
    const turned = level.scale(share).add(up.scale(least));
    const bent = turned.add(point.view).normalize();
    return .select(height.lt(least), bent, normal);
}
