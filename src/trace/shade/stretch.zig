//! The stretched specular lobe of a base at points in lanes (KHR_materials_anisotropy): GGX with
//! two alphas (`anisotropy.zig`) along the tangents of layers.
//!
//! In: points, parameters of layers. Out: density and mirror directions of the lanes that have such
//! a lobe; others keep theirs.

const bsdf_file = @import("bsdf.zig");
const albedo_file = @import("albedo.zig");
const anisotropy = @import("anisotropy.zig");
const microfacet = @import("microfacet.zig");
const sampling = @import("sampling.zig");
const Interaction = @import("interaction.zig").Interaction;
const Layers = @import("layers.zig").Layers;

/// The frame and the alphas of the lobe.
pub fn Stretch(comptime Lanes: type) type {
    const F32 = Lanes.F32;
    const Vec3 = Lanes.Vec3;
    return struct {
        /// Lanes that have one; the rest is undefined where none has.
        lanes: Lanes.Mask,
        /// Unit vectors across the normal.
        tangent: Vec3,
        bitangent: Vec3,
        alphas: [2]F32,
        /// Least alpha of the lobe that lights and samples see.
        alpha_least: f32,
        /// The view in the frame of tangents and normal.
        view: Vec3,

        const Self = @This();

        /// That of points.
        pub fn of(point: *const Interaction(Lanes), layers: *const Layers(Lanes)) Self {
            var stretch: Self = undefined;
            stretch.alpha_least =
                bsdf_file.highlight_roughness_least * bsdf_file.highlight_roughness_least;
            stretch.lanes = layers.present.bitAnd(layers.anisotropy.gt(.zero()));
            if (stretch.lanes.none()) return stretch;
            stretch.tangent = layers.tangent;
            stretch.bitangent = point.normal.cross(layers.tangent);
            const roughness = point.material.roughness;
            stretch.alphas = anisotropy
                .alphasOf(Lanes, roughness.mul(roughness), layers.anisotropy.min(.splat(1)));
            const view = stretch.into(point, point.view);
            const above: Vec3 = .{ .x = view.x, .y = view.y, .z = view.z.max(.splat(1e-4)) };
            stretch.view = above.normalize();
            return stretch;
        }

        /// A direction in the frame.
        inline fn into(stretch: *const Self, point: *const Interaction(Lanes), way: Vec3) Vec3 {
            return .{
                .x = stretch.tangent.dot(way),
                .y = stretch.bitangent.dot(way),
                .z = point.normal.dot(way),
            };
        }

        /// Alphas of what lights and samples see.
        pub inline fn highlights(stretch: *const Self) [2]F32 {
            const least: F32 = .splat(stretch.alpha_least);
            return .{ stretch.alphas[0].max(least), stretch.alphas[1].max(least) };
        }

        /// Distribution times visibility for a half vector.
        pub fn density(
            stretch: *const Self,
            point: *const Interaction(Lanes),
            to_light: Vec3,
            half: Vec3,
        ) F32 {
            const alphas = stretch.highlights();
            const light = stretch.into(point, to_light);
            const cos_light = light.z.max(.zero()).min(.splat(1));
            const view_term = anisotropy.smith(Lanes, stretch.view, alphas).mul(cos_light);
            const light_term = anisotropy.smith(Lanes, light, alphas).mul(stretch.view.z);
            const visibility = F32.splat(0.5).div(view_term.add(light_term).max(.splat(1e-12)));
            return anisotropy.distribution(Lanes, stretch.into(point, half), alphas)
                .mul(visibility);
        }

        /// Density of mirror images about visible normals of highlights, by their half vector.
        pub fn visible(stretch: *const Self, point: *const Interaction(Lanes), half: Vec3) F32 {
            const alphas = stretch.highlights();
            const local = stretch.into(point, half);
            const seen = stretch.view.z.add(anisotropy.smith(Lanes, stretch.view, alphas));
            const found = anisotropy.distribution(Lanes, local, alphas).div(seen.add(seen));
            return .select(local.z.gt(.zero()), found, .zero());
        }

        /// Mirror image of the view for a point of the disc, with the density `visible`.
        pub fn sample(stretch: *const Self, point: *const Interaction(Lanes), disc: [2]F32) Vec3 {
            const image = sampling.imageOf(Lanes, stretch.view, stretch.highlights(), disc);
            const across = [2]Vec3{ stretch.tangent, stretch.bitangent };
            return sampling.turn(Lanes, across, point.normal, image);
        }

        /// `anisotropy.effectiveAlpha` in the lanes that have a stretched lobe, else this one.
        pub inline fn effective(stretch: *const Self, alpha: F32) F32 {
            const mean = anisotropy.effectiveAlpha(Lanes, stretch.alphas);
            return .select(stretch.lanes, mean, alpha);
        }

        /// Albedos towards the view in the lanes that have a stretched lobe, for that of
        /// `effective`; in others those of an even one.
        pub noinline fn directional(
            stretch: *const Self,
            albedo: *const albedo_file.Albedo(Lanes),
            even: albedo_file.Directional(Lanes),
        ) albedo_file.Directional(Lanes) {
            const found = anisotropy.directional(Lanes, albedo, stretch.view, stretch.alphas);
            return .{
                .missing = .select(stretch.lanes, found.missing, even.missing),
                .schlick = .select(stretch.lanes, found.schlick, even.schlick),
            };
        }

        /// The mirror direction about a normal of microfacets that the view sees, whose alphas are
        /// a share of the lobe's, by two numbers in 0..1.
        pub fn mirrored(
            stretch: *const Self,
            point: *const Interaction(Lanes),
            share: F32,
            numbers: [2]F32,
        ) Vec3 {
            const alphas = [2]F32{
                stretch.alphas[0].mul(share), stretch.alphas[1].mul(share),
            };
            const disc = microfacet.disc(Lanes, numbers);
            const half = microfacet.visibleNormalOf(Lanes, stretch.view, alphas, disc);
            const normal = stretch.tangent.scale(half.x).add(stretch.bitangent.scale(half.y))
                .add(point.normal.scale(half.z));
            return bsdf_file.mirrored(Lanes, point, normal);
        }

        /// Roughness of an even lobe that is as wide as this one along the tangent, in its lanes.
        pub inline fn widest(stretch: *const Self, roughness: F32) F32 {
            return .select(stretch.lanes, stretch.alphas[0].max(.zero()).sqrt(), roughness);
        }
    };
}
