//! Sampling of surfaces that let light through, in lanes: panes and boundaries of volumes, smooth
//! and rough.
//!
//! In: points, their BSDF, numbers in 0..1. Out: directions, densities, shares of light. Rough ones
//! have the lobes of `transmission.zig` (Walter et al. 2007): directions about microfacets that the
//! view sees bring all the light that a lobe sends on, so that energy is kept. From outside and
//! through panes it is the share that the BSDF has for the view; what microfacets of panes send to
//! each other comes through by the cosine. Inside a denser volume reflection is here as well, and
//! where all of the base transmits each microfacet has its own Fresnel factor and total reflection;
//! what goes to the wrong side there is scattered by the cosine on the right one, in a lobe that
//! lights are not weighed with. Radiance is that over the square of the
//! index: it keeps its value from one side to the other. Light that is dispersed follows one
//! channel, chosen by what it is worth (KHR_materials_dispersion).
//! Everything is + - * / sqrt in a fixed order.

const std = @import("std");
const albedo_file = @import("albedo.zig");
const bsdf_file = @import("bsdf.zig");
const energy = @import("energy.zig");
const microfacet = @import("microfacet.zig");
const sampling = @import("sampling.zig");
const transmission = @import("transmission.zig");
const Interaction = @import("interaction.zig").Interaction;
const Layers = @import("layers.zig").Layers;

/// What a path tracer asks of what goes through a surface.
pub fn Passing(comptime Lanes: type) type {
    const F32 = Lanes.F32;
    const Vec3 = Lanes.Vec3;
    const Mask = Lanes.Mask;
    const Bsdf = bsdf_file.Bsdf(Lanes);
    return struct {
        /// Some lane lets light through or is in a denser volume: what follows is defined then.
        any: bool,
        /// Lanes in a denser volume whose reflection is in these lobes.
        inside: Mask,
        /// Of these where each microfacet has its own Fresnel factor.
        faceted: Mask,
        /// Lanes whose light goes on in one direction.
        sharp: Mask,
        /// Share of light that comes through, and inside that is reflected, by the BSDF.
        transmitted: Vec3,
        reflected: Vec3,
        /// The first by the channels' worth, and probability of a reflection inside.
        chance: F32,
        /// Share of what microfacets let in that comes through.
        clear: Vec3,
        below: F32,
        /// Share of what comes through rough panes that more than one microfacet scatters.
        lost: F32,
        /// Fresnel's reflectance: `Bsdf.f0` and `f90`, and of the dielectric alone.
        f0: Vec3,
        f90: F32,
        base_f0: F32,
        base_f90: F32,
        boundary: transmission.RoughBoundary(Lanes),
        /// The direction of light through smooth surfaces.
        straight: Vec3,
        dispersion: Dispersion(Lanes),

        const Self = @This();
        const none: Vec3 = .splat(.{ 0, 0, 0 });

        /// Of points; `worth` weighs the channels. The BSDF has the surface's own roughness.
        pub fn become(
            passing: *Self,
            point: *const Interaction(Lanes),
            bsdf: *const Bsdf,
            layers: *const Layers(Lanes),
            worth: Vec3,
        ) void {
            const one: F32 = .splat(1);
            const material = &point.material;
            const denser = material.volume.bitAnd(point.eta.gt(one));
            passing.transmitted = bsdf.mirror.transmitted;
            const largest = maxOf(passing.transmitted);
            passing.any = largest.gt(.zero()).bitOr(denser).any();
            passing.inside = .splat(false);
            if (!passing.any) return;
            const alpha = bsdf.alpha;
            const width = F32.select(
                material.volume,
                transmission.equalAlpha(Lanes, alpha, point.eta),
                transmission.thinAlpha(Lanes, alpha, material.ior),
            );
            passing.sharp = width.le(.splat(sampling.sharp_alpha_least));
            passing.inside = denser.andNot(passing.sharp);
            const clear = material.transmission.mul(one.sub(material.metallic));
            passing.faceted = passing.inside.bitAnd(clear.ge(one));
            passing.boundary = transmission.boundaryOf(Lanes, point, alpha, point.eta);
            passing.boundary.alpha =
                passing.boundary.alpha.max(.splat(sampling.sharp_alpha_least));
            const directional = albedo_file.Albedo(Lanes).of(passing.boundary.alpha)
                .at(passing.boundary.cosView());
            passing.lost = .select(passing.boundary.thin, directional.missing, .zero());
            passing.straight = bsdf.mirror.refraction;
            passing.reflected = .select(passing.inside, bsdf.mirror.reflected, none);
            const back = passing.reflected.dot(worth);
            const whole = back.add(passing.transmitted.dot(worth));
            passing.chance = back.div(whole.max(.splat(1e-12)));
            passing.below = if (bsdf.layered) bsdf.coating.below else one;
            passing.clear = material.base_color.min(.splat(.{ 1, 1, 1 })).scale(passing.below);
            passing.f0 = bsdf.f0;
            passing.f90 = bsdf.f90;
            passing.base_f0 = bsdf.base_f0;
            passing.base_f90 = bsdf.base_f90;
            passing.dispersion.any = false;
            if (!bsdf.layered) return;
            const through: Vec3 = .select(passing.faceted, passing.clear, passing.transmitted);
            passing.dispersion.become(point, layers, through.mul(worth));
        }

        /// Share of light in all, by the channels' worth.
        pub inline fn share(passing: *const Self, worth: Vec3) F32 {
            return passing.transmitted.add(passing.reflected).dot(worth);
        }

        /// What microfacets do to light.
        const Facet = struct {
            /// Probability of a reflection.
            chance: F32,
            reflected: Vec3,
            transmitted: Vec3,
        };

        /// Those that the view sees at this cosine.
        fn facetAt(passing: *const Self, cos_view: F32) Facet {
            var facet: Facet = .{
                .chance = passing.chance,
                .reflected = passing.reflected,
                .transmitted = passing.transmitted,
            };
            if (passing.faceted.none()) return facet;
            const one: F32 = .splat(1);
            const eta = passing.boundary.eta;
            const cosine = cos_view.max(.zero()).min(one);
            const sine_squared = one.sub(cosine.mul(cosine));
            const squared = one.sub(eta.mul(eta).mul(sine_squared));
            const total = squared.lt(.zero());
            const weight = microfacet.power5(Lanes, one.sub(squared.max(.zero()).sqrt()));
            const base = passing.base_f0.add(passing.base_f90.sub(passing.base_f0).mul(weight));
            const chance = F32.select(total, one, base);
            const whole: Vec3 = .{ .x = passing.below, .y = passing.below, .z = passing.below };
            const color = energy.schlickOf(Lanes, passing.f0, passing.f90, weight);
            const through = passing.clear.scale(one.sub(chance));
            facet.chance = .select(passing.faceted, chance, facet.chance);
            facet.reflected =
                .select(passing.faceted, .select(total, whole, color), facet.reflected);
            facet.transmitted = .select(passing.faceted, through, facet.transmitted);
            return facet;
        }

        /// A direction that light comes from.
        pub const Direction = struct {
            /// Unit vector.
            to_light: Vec3,
            /// Lanes where `addTo` does not have it: this much of the light from there counts.
            alone: Mask,
            weight: Vec3,
        };

        /// One for three numbers in 0..1, of which the last chooses the side and the channel.
        pub noinline fn sample(passing: *const Self, numbers: [3]F32) Direction {
            const one: F32 = .splat(1);
            const least: F32 = .splat(1e-12);
            var boundary = passing.boundary;
            const facet = boundary.facet(.{ numbers[0], numbers[1] });
            const seen = passing.facetAt(facet.view.dot(facet.half));
            const reflects = passing.inside.bitAnd(numbers[2].lt(seen.chance));
            const left = one.sub(seen.chance).max(least);
            var weight = seen.transmitted.scale(one.div(left));
            var straight = passing.straight;
            const dispersion = &passing.dispersion;
            if (dispersion.any) {
                const rest = numbers[2].sub(seen.chance).div(left);
                const channel = dispersion.channelOf(rest);
                boundary.eta = .select(dispersion.lanes, channel.eta, boundary.eta);
                weight = weight.mul(channel.weight);
                const bent = transmission
                    .refract(Lanes, boundary.view, boundary.normal, channel.eta).direction;
                const through = bent.dot(boundary.normal_geometric).lt(.zero());
                straight = .select(dispersion.lanes.bitAnd(through), bent, straight);
            }
            const bent_through = boundary.pass(&facet);
            const back = boundary.reflect(&facet);
            const rough: Vec3 = .select(reflects, back.to_light, bent_through.to_light);
            const thin = boundary.thin.andNot(passing.sharp);
            const again = thin.bitAnd(numbers[2].lt(passing.lost));
            const scattered = reflects.bitAnd(back.scattered)
                .bitOr(bent_through.scattered.andNot(reflects)).andNot(again);
            const mirrored = seen.reflected.scale(one.div(seen.chance.max(least)));
            weight = .select(reflects, mirrored, weight);
            const spread: Vec3 = .select(again, boundary.scatter(facet.disc), rough);
            return .{
                .to_light = .select(passing.sharp, straight.normalize(), spread),
                .alone = passing.sharp.bitOr(scattered),
                .weight = .select(thin, none, weight),
            };
        }

        /// Light from a direction, its BSDF times cosine and the density of `sample`, the share
        /// that is scattered left out.
        pub const Seen = struct { value: Vec3, pdf: F32 };

        /// `half` is the half vector of a reflection, at unit length.
        pub noinline fn eval(
            passing: *const Self,
            point: *const Interaction(Lanes),
            to_light: Vec3,
            reflection_pdf: F32,
            half: Vec3,
        ) Seen {
            var boundary = passing.boundary;
            var seen = passing.passed(&boundary, to_light);
            const dispersion = &passing.dispersion;
            if (dispersion.any) {
                var value: Vec3 = undefined;
                var pdf: F32 = .zero();
                inline for (.{ "x", "y", "z" }, dispersion.etas, dispersion.odds) |name, eta, odd| {
                    boundary.eta = eta;
                    const one = passing.passed(&boundary, to_light);
                    @field(value, name) = @field(one.value, name);
                    pdf = pdf.add(one.pdf.mul(odd));
                }
                seen.value = .select(dispersion.lanes, value, seen.value);
                seen.pdf = .select(dispersion.lanes, pdf, seen.pdf);
            }
            const front = point.normal.dot(to_light).gt(.zero())
                .bitAnd(point.normal_geometric.dot(to_light).gt(.zero()))
                .bitAnd(passing.inside);
            if (front.any()) {
                const facet = passing.facetAt(point.view.dot(half));
                const mirrored = facet.reflected.scale(reflection_pdf);
                seen.value = .select(front, mirrored, seen.value);
                seen.pdf = .select(front, facet.chance.mul(reflection_pdf), seen.pdf);
            }
            return .{
                .value = .select(passing.sharp, none, seen.value),
                .pdf = .select(passing.sharp, .zero(), seen.pdf),
            };
        }

        /// From behind, with the indices of `boundary`.
        fn passed(
            passing: *const Self,
            boundary: *const transmission.RoughBoundary(Lanes),
            to_light: Vec3,
        ) Seen {
            const density = boundary.pdf(to_light);
            const bending = boundary.view.scale(boundary.eta).add(to_light);
            const squares = bending.dot(bending).max(.splat(1e-12));
            const cosine = boundary.view.dot(bending).abs().div(squares.sqrt());
            const facet = passing.facetAt(cosine);
            const left = F32.splat(1).sub(facet.chance);
            const seen: Seen = .{
                .value = facet.transmitted.scale(density),
                .pdf = left.mul(density),
            };
            if (boundary.thin.none()) return seen;
            const along = boundary.normal_geometric.dot(to_light).neg().max(.zero());
            const spread = along.mul(.splat(1.0 / std.math.pi)).mul(passing.lost);
            const once = density.mul(F32.splat(1).sub(passing.lost));
            const value = facet.transmitted.scale(boundary.eval(to_light).add(spread));
            return .{
                .value = .select(boundary.thin, value, seen.value),
                .pdf = .select(boundary.thin, once.add(spread), seen.pdf),
            };
        }

        inline fn maxOf(color: Vec3) F32 {
            return color.x.max(color.y).max(color.z);
        }
    };
}

/// Light whose channels go different ways through boundaries of volumes.
fn Dispersion(comptime Lanes: type) type {
    const F32 = Lanes.F32;
    const Vec3 = Lanes.Vec3;
    return struct {
        /// Some lane has such light: what follows is defined then.
        any: bool,
        lanes: Lanes.Mask,
        /// By channel: `eta` of the boundary, and the probability to follow it.
        etas: [3]F32,
        odds: [3]F32,

        const Self = @This();

        /// Of points; channels are followed by these shares.
        noinline fn become(
            dispersion: *Self,
            point: *const Interaction(Lanes),
            layers: *const Layers(Lanes),
            shares: Vec3,
        ) void {
            const material = &point.material;
            dispersion.lanes = layers.present.bitAnd(layers.dispersion.gt(.zero()))
                .bitAnd(material.volume);
            dispersion.any = dispersion.lanes.any();
            if (!dispersion.any) return;
            const iors = transmission.dispersedIors(Lanes, material.ior, layers.dispersion);
            const sum = shares.x.add(shares.y).add(shares.z);
            const usable = sum.gt(.splat(1e-12));
            const whole = sum.max(.splat(1e-12));
            for (&dispersion.etas, &dispersion.odds, iors, [3]F32{
                shares.x, shares.y, shares.z,
            }) |*eta, *odds, ior, part| {
                eta.* = transmission.dispersedEta(Lanes, point.eta, material.ior, ior);
                odds.* = .select(usable, part.div(whole), .splat(1.0 / 3.0));
            }
        }

        const Channel = struct {
            eta: F32,
            /// White where light is not dispersed.
            weight: Vec3,
        };

        /// The one for a number in 0..1.
        fn channelOf(dispersion: *const Self, number: F32) Channel {
            const odds = &dispersion.odds;
            const one: F32 = .splat(1);
            const zero: F32 = .zero();
            // A channel without a chance is never chosen, whatever rounding does.
            const is_red = number.lt(odds[0]).bitAnd(odds[0].gt(zero));
            const past = number.ge(odds[0].add(odds[1])).bitOr(odds[1].le(zero)).andNot(is_red);
            const is_blue = past.bitAnd(odds[2].gt(zero));
            const is_green = is_red.bitOr(is_blue).bitNot();
            var weight: Vec3 = undefined;
            inline for (.{ "x", "y", "z" }, .{ is_red, is_green, is_blue }, odds) |n, is, odd| {
                const inverse = F32.select(is, one.div(odd.max(.splat(1e-12))), zero);
                @field(weight, n) = .select(dispersion.lanes, inverse, one);
            }
            const eta = F32.select(is_red, dispersion.etas[0], dispersion.etas[1]);
            return .{ .eta = .select(is_blue, dispersion.etas[2], eta), .weight = weight };
        }
    };
}
