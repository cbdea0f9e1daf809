//! What lies over a surface, in lanes: a clear coat (GGX) and, below it, fibres (Charlie).
//!
//! In: points, parameters of layers. Out: what coat and fibres make of light, and what they leave
//! to the base. By the texts of KHR_materials_clearcoat and KHR_materials_sheen: a layer takes from
//! what lies below it the share that it reflects of white light from everywhere to the view
//! ("albedo scaling"; Kulla and Conty 2017, section on layering), so that all together reflect at
//! most 1. What the light's way in would lose besides is left out, as the texts do.

const bsdf_file = @import("bsdf.zig");
const albedo_file = @import("albedo.zig");
const microfacet = @import("microfacet.zig");
const sheen = @import("sheen.zig");
const Interaction = @import("interaction.zig").Interaction;
const Layers = @import("layers.zig").Layers;

/// Reflectance of a coat at normal incidence: its index is 1.5.
const coat_f0 = 0.04;

/// The layers over a base.
pub fn Coating(comptime Lanes: type) type {
    return struct {
        /// Unit normal of the coat.
        normal: Vec3,
        /// Of the coat, for lights and samples, see `bsdf.highlight_roughness_least`.
        alpha: F32,
        /// The coat's own.
        roughness: F32,
        cos_view: F32,
        smith_view: F32,
        weight: F32,
        /// Share of white light from everywhere that the coat sends to the view.
        albedo: F32,
        /// Fibres' colour, as far as the coat lets it through.
        sheen_color: Vec3,
        sheen_roughness: F32,
        /// The same as `albedo` of the fibres.
        sheen_albedo: Vec3,
        /// Share that coat and fibres leave to the base.
        below: F32,
        /// Share that the coat leaves to what is below it: of emitted light, too.
        below_coat: F32,

        const Self = @This();
        const F32 = Lanes.F32;
        const Vec3 = Lanes.Vec3;

        /// Those of points.
        pub fn of(point: *const Interaction(Lanes), layers: *const Layers(Lanes)) Self {
            const one: F32 = .splat(1);
            var coating: Self = undefined;
            const weight = F32.select(layers.present, layers.clearcoat, .zero());
            const normal = layers.clearcoat_normal;
            const cosine = normal.dot(point.view).max(.splat(1e-4)).min(one);
            const rough = layers.clearcoat_roughness;
            const squared = rough.mul(rough);
            const directional = albedo_file.Albedo(Lanes).of(squared).at(cosine);
            coating.normal = normal;
            coating.roughness = rough;
            coating.alpha = bsdf_file.highlightAlpha(Lanes, rough);
            coating.cos_view = cosine;
            const alpha_squared = coating.alpha.mul(coating.alpha);
            coating.smith_view = microfacet.smith(Lanes, cosine, alpha_squared);
            coating.weight = weight;
            coating.albedo = directional.single(.splat(coat_f0), one).mul(weight);
            coating.below_coat = one.sub(coating.albedo);
            const fibres: Vec3 =
                .select(layers.present, layers.sheen_color, .splat(.{ 0, 0, 0 }));
            const cos_view = point.normal.dot(point.view).max(.splat(1e-4)).min(one);
            const share = sheen.albedo(Lanes, cos_view, layers.sheen_roughness);
            coating.sheen_roughness = layers.sheen_roughness;
            coating.sheen_color = fibres.scale(coating.below_coat);
            coating.sheen_albedo = coating.sheen_color.scale(share);
            const largest = fibres.x.max(fibres.y).max(fibres.z);
            const below_fibres = one.sub(largest.mul(share)).max(.zero());
            coating.below = coating.below_coat.mul(below_fibres);
            return coating;
        }

        /// Adds what both send to the view to the lobes of the base.
        pub noinline fn addTo(
            coating: *const Self,
            lobes: *bsdf_file.Bsdf(Lanes).Lobes,
            point: *const Interaction(Lanes),
            cos_view: F32,
            to_light: Vec3,
        ) void {
            const coat = coating.evalCoat(point, to_light);
            lobes.specular = lobes.specular.add(.{ .x = coat, .y = coat, .z = coat });
            lobes.diffuse = lobes.diffuse.add(coating.evalSheen(point, cos_view, to_light));
        }

        /// What the coat sends to the view of a unit of irradiance across the way of light.
        pub fn evalCoat(
            coating: *const Self,
            point: *const Interaction(Lanes),
            to_light: Vec3,
        ) F32 {
            const one: F32 = .splat(1);
            const half = point.view.add(to_light).normalize();
            const cos_light = coating.normal.dot(to_light).max(.zero()).min(one);
            const cos_half = coating.normal.dot(half).max(.zero()).min(one);
            const cos_view_half = point.view.dot(half).max(.zero()).min(one);
            const a = coating.alpha.mul(coating.alpha);
            const view_term = coating.smith_view.mul(cos_light);
            const light_term = microfacet.smith(Lanes, cos_light, a).mul(coating.cos_view);
            const visibility = F32.splat(0.5).div(view_term.add(light_term).max(.splat(1e-12)));
            const density = microfacet.distribution(Lanes, cos_half, a).mul(visibility);
            const schlick = microfacet.power5(Lanes, one.sub(cos_view_half));
            const fresnel = F32.splat(coat_f0).add(schlick.mul(.splat(1 - coat_f0)));
            return density.mul(fresnel).mul(coating.weight).mul(cos_light);
        }

        /// The same of the fibres.
        pub fn evalSheen(
            coating: *const Self,
            point: *const Interaction(Lanes),
            cos_view: F32,
            to_light: Vec3,
        ) Vec3 {
            const one: F32 = .splat(1);
            const half = point.view.add(to_light).normalize();
            const cos_light = point.normal.dot(to_light).max(.zero()).min(one);
            const cos_half = point.normal.dot(half).max(.zero()).min(one);
            const value =
                sheen.eval(Lanes, cos_half, cos_view, cos_light, coating.sheen_roughness);
            const lit = F32.select(cos_light.gt(.zero()), value.mul(cos_light), .zero());
            return coating.sheen_color.scale(lit);
        }
    };
}
