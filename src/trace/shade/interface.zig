//! Reflectance of a base whose channels differ: coloured dielectrics and thin films, in lanes.
//!
//! In: points, parameters of layers. Out: what Schlick's approximation starts from. By the texts of
//! KHR_materials_specular (weight and colour of the dielectric's reflection) and
//! KHR_materials_iridescence (a film over dielectric and metal alike, as `iridescence.zig` has it
//! at this view; the base below gets what the brightest channel leaves).

const bsdf_file = @import("bsdf.zig");
const iridescence = @import("iridescence.zig");
const Interaction = @import("interaction.zig").Interaction;
const Layers = @import("layers.zig").Layers;

/// The boundary between a base and what is outside.
pub fn Interface(comptime Lanes: type) type {
    const F32 = Lanes.F32;
    const Vec3 = Lanes.Vec3;
    return struct {
        /// Reflectance at normal incidence by channel, metal included.
        f0: Vec3,
        /// Of the dielectric alone, its largest channel, and at grazing incidence.
        dielectric_f0: F32,
        dielectric_f90: F32,

        const Self = @This();

        /// Those of points.
        pub fn of(point: *const Interaction(Lanes), layers: *const Layers(Lanes)) Self {
            const one: F32 = .splat(1);
            const white: Vec3 = .splat(.{ 1, 1, 1 });
            const material = &point.material;
            const plain_f0 = material.dielectric_f0;
            const weight = F32.select(layers.present, layers.specular, one);
            const color: Vec3 = .select(layers.present, layers.specular_color, white);
            var dielectric = color.scale(plain_f0).min(white).scale(weight);
            var metal = material.base_color.min(white);
            const film = F32.select(layers.present, layers.iridescence, .zero());
            if (film.gt(.zero()).any()) {
                dielectric = filmed(point, layers, film, dielectric);
                metal = filmed(point, layers, film, metal);
            }
            const metallic = material.metallic;
            return .{
                .f0 = dielectric.scale(one.sub(metallic)).add(metal.scale(metallic)),
                .dielectric_f0 = dielectric.x.max(dielectric.y).max(dielectric.z),
                .dielectric_f90 = bsdf_file.grazingOf(Lanes, plain_f0).mul(weight),
            };
        }

        /// With a share of film over it.
        fn filmed(
            point: *const Interaction(Lanes),
            layers: *const Layers(Lanes),
            share: F32,
            f0: Vec3,
        ) Vec3 {
            const cosine = point.normal.dot(point.view).max(.splat(1e-4)).min(.splat(1));
            const index = layers.iridescence_ior;
            const thickness = layers.iridescence_thickness_nm;
            const seen = iridescence.reflectance(Lanes, cosine, index, thickness, f0);
            const film_f0 = iridescence.schlickF0(Lanes, seen, cosine);
            const mixed = f0.add(film_f0.sub(f0).scale(share));
            return .select(share.gt(.zero()), mixed, f0);
        }
    };
}
