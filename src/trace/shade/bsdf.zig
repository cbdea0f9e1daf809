//! The BSDF of glTF's metallic-roughness model in lanes: GGX over Lambert, energy preserved, Snell.
//!
//! In: points on surfaces. Out: what they make of light from a direction, shares for light from
//! everywhere, and what goes on by reflection and refraction. Formulas: glTF
//! 2.0, appendix B (`microfacet.zig`; Burley 2012 for roughness squared, Schlick 1994 for Fresnel),
//! with f0 mixed by the metallic factor. Light that microfacets send to each other comes out as a
//! second lobe, and the diffuse one gets what the specular one leaves, both in the reciprocal form
//! of Kulla and Conty 2017 ("Revisiting Physically Based Shading at Imageworks"); by Kelemen and
//! Szirmay-Kalos 2001. So a white surface is as bright as white light around it. Everything is
//! + - * / sqrt in a fixed order.

const std = @import("std");
const simd = @import("../../simd.zig");
const albedo_file = @import("albedo.zig");
const energy = @import("energy.zig");
const microfacet = @import("microfacet.zig");
const sampling = @import("sampling.zig");
const test_surface = @import("test_surface.zig");
const interface_file = @import("interface.zig");
const transmission_file = @import("transmission.zig");
const Coating = @import("coating.zig").Coating;
const Interaction = @import("interaction.zig").Interaction;
const Layers = @import("layers.zig").Layers;
const Stretch = @import("stretch.zig").Stretch;

/// Least roughness of the lobe that lights without size and samples see: below it a highlight would
/// be a spike of some thousandths of a steradian and some ten thousand times the light, which no
/// pixel grid can show. Albedos and mirror images have the true roughness.
pub const highlight_roughness_least = 0.05;

/// At grazing angles a boundary reflects all light (f90 = 1), unless it reflects less than 2 % at
/// normal incidence, as no material does: down to an index of 1, which is no boundary, f90 falls to
/// 0 (Lagarde and de Rousiers 2014, "Moving Frostbite to Physically Based Rendering").
pub const f90_per_f0 = 50;

/// Up to this roughness reflections are traced in any case; rougher ones where
/// `integrate/bounces.zig` says so.
pub const mirror_roughness_max = 0.25;

/// The parts of a surface's BSDF: a diffuse and a glossy one, which lights are seen by, and those
/// of a smooth boundary, which single rays follow.
pub fn Bsdf(comptime Lanes: type) type {
    return struct {
        /// Share of white light from everywhere that the specular lobe sends to the view, light
        /// scattered more than once included; Fresnel's reflectance where smooth, 1 where all
        /// light is reflected inside.
        specular_albedo: Vec3,
        /// Share of it that the diffuse lobe sends. With what is transmitted the shares are at
        /// most 1.
        diffuse_albedo: Vec3,
        /// Reflectance at normal incidence.
        f0: Vec3,
        /// Reflectance at grazing incidence.
        f90: F32,
        /// GGX's alpha, for highlights; the surface's own after `sampling.sharpen`.
        alpha: F32,
        /// Cosine between normal and view, > 0.
        cos_view: F32,
        /// See `microfacet.smith`.
        smith_view: F32,
        albedo: albedo_file.Albedo(Lanes),
        /// The lobe of light scattered more than once, but for the share of its way in.
        multiple: Vec3,
        /// The diffuse lobe, but for the share of its way in.
        diffuse: Vec3,
        /// Share of light that the base below the specular lobe does not see even so.
        multiple_base: F32,
        /// Reflectance of the dielectric part at normal and at grazing incidence.
        base_f0: F32,
        base_f90: F32,
        /// Share of light that comes to what is below the dielectric's boundary.
        open: F32,
        mirror: Mirror(Lanes),
        /// Share of white light from everywhere behind that leaves diffusely on this side.
        back_albedo: Vec3,
        /// Some lane scatters light from behind.
        sees_behind: bool,
        /// Some lane has further lobes: what follows is defined then.
        layered: bool,
        coating: Coating(Lanes),
        stretch: Stretch(Lanes),

        const Self = @This();
        const F32 = Lanes.F32;
        const Mask = Lanes.Mask;
        const Vec3 = Lanes.Vec3;
        const inverse_pi: F32 = .splat(1.0 / std.math.pi);

        /// That of the surface at these points.
        pub fn of(point: *const Interaction(Lanes)) Self {
            var bsdf: Self = undefined;
            bsdf.albedo = .unknown;
            bsdf.become(point);
            return bsdf;
        }

        /// Becomes that of the surface at these points, with the same bits as `of`. Of what it was
        /// before, what depends on the roughness alone stays where that is the same in all lanes,
        /// as it mostly is in neighbours: a fourth of the work.
        pub fn become(bsdf: *Self, point: *const Interaction(Lanes)) void {
            const f0 = point.material.dielectric_f0;
            bsdf.layered = false;
            bsdf.back_albedo = .splat(.{ 0, 0, 0 });
            bsdf.setBase(point, &.{ .f0 = f0, .f90 = grazingOf(Lanes, f0), .colors = null });
        }

        /// The same of points some of which have further lobes.
        pub noinline fn becomeLayered(
            bsdf: *Self,
            point: *const Interaction(Lanes),
            layers: *const Layers(Lanes),
        ) void {
            const interface: interface_file.Interface(Lanes) = .of(point, layers);
            bsdf.stretch = .of(point, layers);
            bsdf.setBase(point, &.{
                .f0 = interface.dielectric_f0,
                .f90 = interface.dielectric_f90,
                .colors = &interface,
            });
            bsdf.layered = true;
            bsdf.coating = .of(point, layers);
            const one: F32 = .splat(1);
            const share = F32.select(layers.present, layers.diffuse_transmission, .zero());
            const open = bsdf.open.sub(bsdf.open.mul(point.material.transmission));
            bsdf.back_albedo = layers.diffuse_transmission_color.min(.splat(.{ 1, 1, 1 }))
                .scale(open.mul(share).mul(bsdf.coating.below));
            energy.weaken(Lanes, bsdf, bsdf.coating.below, bsdf.coating.below.mul(one.sub(share)));
        }

        /// The dielectric's reflectance, and where channels differ the whole's.
        const Reflectance = struct {
            f0: F32,
            f90: F32,
            colors: ?*const interface_file.Interface(Lanes),
        };

        inline fn setBase(
            bsdf: *Self,
            point: *const Interaction(Lanes),
            reflectance: *const Reflectance,
        ) void {
            const one: F32 = .splat(1);
            const white: Vec3 = .splat(.{ 1, 1, 1 });
            const material = &point.material;
            const dielectric = one.sub(material.metallic);
            const base = material.base_color.min(white);
            const base_f0 = reflectance.f0;
            const base_f90 = reflectance.f90;
            const cos_view = point.normal.dot(point.view).max(.splat(1e-4)).min(one);
            const boundary: Boundary(Lanes) = .of(point, cos_view);
            const albedo = &bsdf.albedo;
            var squared = material.roughness.mul(material.roughness);
            const stretched = reflectance.colors != null and bsdf.stretch.lanes.any();
            if (stretched) squared = bsdf.stretch.effective(squared);
            if (!albedo.alpha.eq(squared).all()) albedo.* = .of(squared);
            var directional = albedo.at(boundary.cos_fresnel);
            if (stretched) directional = bsdf.stretch.directional(albedo, directional);
            const scatter_base = energy.multipleOf(Lanes, albedo, base_f0, base_f90);
            bsdf.f0 = splat3(Lanes, base_f0);
            bsdf.f90 = base_f90;
            var scatter = splat3(Lanes, scatter_base);
            const even = energy.specularOf(Lanes, directional, scatter_base, base_f0, base_f90);
            var specular = splat3(Lanes, even);
            // Without metal and colours all channels are those of the base.
            if (reflectance.colors != null or !material.metallic.eq(.zero()).all()) {
                const mixed = splat3(Lanes, base_f0.mul(dielectric))
                    .add(base.scale(material.metallic));
                const f0 = if (reflectance.colors) |colors| colors.f0 else mixed;
                const f90 = base_f90.mul(dielectric).add(material.metallic);
                inline for (.{ "x", "y", "z" }) |channel| {
                    const many = energy.multipleOf(Lanes, albedo, @field(f0, channel), f90);
                    @field(scatter, channel) = many;
                    @field(specular, channel) =
                        energy.specularOf(Lanes, directional, many, @field(f0, channel), f90);
                }
                bsdf.f0 = f0;
                bsdf.f90 = f90;
            }
            specular = .select(boundary.total, white, specular);
            const below = one.sub(directional.single(base_f0, base_f90))
                .sub(scatter_base.mul(directional.missing)).max(.zero());
            const open = F32.select(boundary.total, .zero(), below.mul(dielectric));
            const passing = open.mul(material.transmission);
            bsdf.open = open;
            bsdf.specular_albedo = specular;
            bsdf.diffuse_albedo = base.scale(open.sub(passing));
            bsdf.alpha = highlightAlpha(Lanes, material.roughness);
            bsdf.cos_view = cos_view;
            bsdf.smith_view = microfacet.smith(Lanes, cos_view, bsdf.alpha.mul(bsdf.alpha));
            bsdf.multiple = scatter
                .scale(directional.missing.div(albedo.missing_mean).mul(inverse_pi));
            const below_mean = energy.belowMean(Lanes, albedo, base_f0, base_f90, scatter_base);
            bsdf.diffuse = bsdf.diffuse_albedo.scale(inverse_pi.div(below_mean));
            bsdf.multiple_base = scatter_base;
            bsdf.sees_behind = reflectance.colors != null or
                material.transmission.gt(.zero()).andNot(material.volume).any();
            bsdf.base_f0 = base_f0;
            bsdf.base_f90 = base_f90;
            bsdf.mirror = .{
                .reflected = specular,
                .transmitted = base.scale(passing),
                .refraction = boundary.refraction,
                .total = boundary.total,
            };
        }

        /// BSDF times cosine: radiance towards the view for each unit of irradiance on a plane
        /// across the light's way. `to_light` is a unit vector; nothing comes from behind.
        pub fn eval(bsdf: *const Self, point: *const Interaction(Lanes), to_light: Vec3) Vec3 {
            const lobes = bsdf.evalLobes(point, to_light);
            return lobes.diffuse.add(lobes.specular);
        }

        /// The two lobes of `eval`; diffuse is white light that has been inside the surface.
        pub const Lobes = struct { diffuse: Vec3, specular: Vec3 };

        /// `eval` lobe by lobe.
        pub fn evalLobes(
            bsdf: *const Self,
            point: *const Interaction(Lanes),
            to_light: Vec3,
        ) Lobes {
            const one: F32 = .splat(1);
            const half = point.view.add(to_light).normalize();
            const cos_light = point.normal.dot(to_light).max(.zero()).min(one);
            const cos_half = point.normal.dot(half).max(.zero()).min(one);
            const cos_view_half = point.view.dot(half).max(.zero()).min(one);
            const a = bsdf.alpha.mul(bsdf.alpha);
            const view_term = bsdf.smith_view.mul(cos_light);
            const light_term = microfacet.smith(Lanes, cos_light, a).mul(bsdf.cos_view);
            // Both terms vanish together only where the light grazes: cos_light is 0 as well.
            const visibility = F32.splat(0.5).div(view_term.add(light_term).max(.splat(1e-12)));
            var density = microfacet.distribution(Lanes, cos_half, a).mul(visibility);
            if (bsdf.layered and bsdf.stretch.lanes.any()) {
                const stretched = bsdf.stretch.density(point, to_light, half);
                density = .select(bsdf.stretch.lanes, stretched, density);
            }
            const schlick = microfacet.power5(Lanes, one.sub(cos_view_half));
            const single = energy.schlickOf(Lanes, bsdf.f0, bsdf.f90, schlick).scale(density);
            const way_in = bsdf.albedo.at(cos_light);
            const multiple = bsdf.multiple.scale(way_in.missing);
            const below = one.sub(way_in.single(bsdf.base_f0, bsdf.base_f90))
                .sub(bsdf.multiple_base.mul(way_in.missing)).max(.zero());
            var lobes: Lobes = .{
                .diffuse = bsdf.diffuse.scale(below.mul(cos_light)),
                .specular = single.add(multiple).scale(cos_light),
            };
            if (bsdf.layered) bsdf.coating.addTo(&lobes, point, bsdf.cos_view, to_light);
            return lobes;
        }

        /// `eval` of light from behind: diffusely, and through panes. Volumes bend light on its way
        /// in and out, which lights by themselves cannot follow. `passing` is the share that comes
        /// through panes.
        pub noinline fn evalBehind(
            bsdf: *const Self,
            point: *const Interaction(Lanes),
            to_light: Vec3,
            passing: Vec3,
        ) Vec3 {
            const diffuse = bsdf.evalBack(point, to_light);
            const boundary = transmission_file.boundaryOf(Lanes, point, bsdf.alpha, point.eta);
            const density = boundary.pdf(to_light);
            const pane = F32.select(point.material.volume, .zero(), density);
            return diffuse.add(passing.scale(pane));
        }

        /// `eval` of light from behind that leaves diffusely.
        pub inline fn evalBack(
            bsdf: *const Self,
            point: *const Interaction(Lanes),
            to_light: Vec3,
        ) Vec3 {
            const cosine = point.normal.dot(to_light).neg().max(.zero());
            return bsdf.back_albedo.scale(cosine.mul(inverse_pi));
        }
    };
}

/// What a smooth boundary does to light: reflection and refraction, each in one direction.
pub fn Mirror(comptime Lanes: type) type {
    return struct {
        /// Share of light from the mirror direction that is reflected to the view: the specular
        /// albedo, so that a traced image is as bright as one blurred by roughness.
        reflected: Lanes.Vec3,
        /// Share of light from behind that comes through to the view.
        transmitted: Lanes.Vec3,
        /// Unit direction that the light which comes through had; along the ray for thin walls.
        refraction: Lanes.Vec3,
        /// Where the surface reflects all light because it cannot leave the volume.
        total: Lanes.Mask,
    };
}

/// What the boundary of a volume does to light; elsewhere it goes straight on.
fn Boundary(comptime Lanes: type) type {
    return struct {
        /// See `Mirror`.
        total: Lanes.Mask,
        /// Cosine on the side of lower density, from which Schlick's approximation counts.
        cos_fresnel: Lanes.F32,
        /// See `Mirror`.
        refraction: Lanes.Vec3,

        /// Snell's law, from the side of the view.
        fn of(point: *const Interaction(Lanes), cos_view: Lanes.F32) @This() {
            const F32 = Lanes.F32;
            const one: F32 = .splat(1);
            const material = &point.material;
            if (material.volume.none()) return .{
                .total = .splat(false),
                .cos_fresnel = cos_view,
                .refraction = point.view.neg(),
            };
            const eta = point.eta;
            const bent = transmission_file.refract(Lanes, point.view, point.normal, eta);
            // A shading normal far from the triangle's can bend light back to the same side.
            const through = bent.direction.dot(point.normal_geometric).lt(.zero());
            const leaving = material.volume.bitAnd(eta.gt(one));
            return .{
                .total = material.volume.bitAnd(bent.total),
                .cos_fresnel = F32.select(leaving, bent.cos_beyond, cos_view),
                .refraction = .select(
                    material.volume.bitAnd(through),
                    bent.direction,
                    point.view.neg(),
                ),
            };
        }
    };
}

/// GGX's alpha of what lights without size and samples see.
pub inline fn highlightAlpha(comptime Lanes: type, roughness: Lanes.F32) Lanes.F32 {
    const rough = roughness.max(.splat(highlight_roughness_least));
    return rough.mul(rough);
}

/// Reflectance at grazing incidence for that at normal incidence, see `f90_per_f0`.
pub inline fn grazingOf(comptime Lanes: type, f0: Lanes.F32) Lanes.F32 {
    return f0.mul(.splat(f90_per_f0)).min(.splat(1));
}

/// Lanes that light from a direction reaches from behind, and that send a share of it to the view.
pub inline fn behind(
    comptime Lanes: type,
    point: *const Interaction(Lanes),
    to_light: Lanes.Vec3,
    albedo: Lanes.Vec3,
) Lanes.Mask {
    const zero: Lanes.F32 = .zero();
    return point.normal.dot(to_light).lt(zero)
        .bitAnd(point.normal_geometric.dot(to_light).lt(zero))
        .bitAnd(albedo.x.max(albedo.y).max(albedo.z).gt(zero));
}

/// Roughness of an even lobe that is as wide as the specular one where that is widest.
pub inline fn widest(
    comptime Lanes: type,
    bsdf: *const Bsdf(Lanes),
    roughness: Lanes.F32,
) Lanes.F32 {
    if (!bsdf.layered or bsdf.stretch.lanes.none()) return roughness;
    return bsdf.stretch.widest(roughness);
}

inline fn splat3(comptime Lanes: type, value: Lanes.F32) Lanes.Vec3 {
    return .{ .x = value, .y = value, .z = value };
}

/// Unit direction of the mirror reflection; never into the point.
pub fn reflect(comptime Lanes: type, point: *const Interaction(Lanes)) Lanes.Vec3 {
    return mirrored(Lanes, point, point.normal);
}

/// The same about another normal.
pub fn mirrored(
    comptime Lanes: type,
    point: *const Interaction(Lanes),
    normal: Lanes.Vec3,
) Lanes.Vec3 {
    const direction = mirror(Lanes, point.view, normal);
    const below = direction.dot(point.normal_geometric).le(.zero());
    return .select(below, mirror(Lanes, point.view, point.normal_geometric), direction);
}

/// The same about a normal of microfacets of GGX's alpha that the view sees, by two numbers in
/// 0..1.
pub fn mirroredRough(
    comptime Lanes: type,
    point: *const Interaction(Lanes),
    normal: Lanes.Vec3,
    alpha: Lanes.F32,
    numbers: [2]Lanes.F32,
) Lanes.Vec3 {
    const across = microfacet.tangents(Lanes, normal);
    const local: Lanes.Vec3 = .{
        .x = across[0].dot(point.view),
        .y = across[1].dot(point.view),
        .z = normal.dot(point.view).max(.splat(1e-4)),
    };
    const view = local.normalize();
    const half = microfacet.visibleNormal(Lanes, view, alpha, microfacet.disc(Lanes, numbers));
    return mirrored(Lanes, point, across[0].scale(half.x).add(across[1].scale(half.y))
        .add(normal.scale(half.z)));
}

inline fn mirror(comptime Lanes: type, view: Lanes.Vec3, normal: Lanes.Vec3) Lanes.Vec3 {
    const cosine = normal.dot(view);
    return normal.scale(cosine.add(cosine)).sub(view).normalize();
}

const Single = simd.Lanes(.scalar, 1);
const viewAt = test_surface.viewAt;

fn testPoint(view: [3]f32) Interaction(Single) {
    return test_surface.pointAt(Single, view);
}

fn setRough(point: *Interaction(Single), metallic: f32, roughness: f32) void {
    point.material.metallic = .splat(metallic);
    point.material.roughness = .splat(roughness);
}

/// What the lobes send to the view of white light from everywhere: `evalLobes` integrated over the
/// directions that visible normals and the cosine give.
fn integrate(point: *const Interaction(Single)) struct { diffuse: f64, specular: f64 } {
    const bsdf: Bsdf(Single) = .of(point);
    const view: Single.Vec3 = .{ .x = point.view.x, .y = .zero(), .z = point.view.y };
    const steps = 48;
    var diffuse: f64 = 0;
    var specular: f64 = 0;
    for (0..steps) |i| for (0..steps) |j| {
        const angle = (@as(f32, @floatFromInt(i)) + 0.5) / steps * std.math.pi;
        const v = (@as(f32, @floatFromInt(j)) + 0.5) / steps;
        const radius = @sqrt(1 - (v * v) * (v * v));
        const point_x: Single.F32 = .splat(radius * @cos(angle));
        const disc = [2]Single.F32{ point_x, .splat(radius * @sin(angle)) };
        const half = microfacet.visibleNormal(Single, view, bsdf.alpha, disc);
        const reflected = half.scale(view.dot(half).mul(.splat(2))).sub(view);
        const share = 4 * v * v * v / (steps * steps);
        const to_light: Single.Vec3 = .{ .x = reflected.x, .y = reflected.z, .z = reflected.y };
        const density = visibleDensity(&bsdf, point, to_light);
        const height = @sqrt(@max(1 - radius * radius, 0));
        const spread: Single.Vec3 = .{ .x = disc[0], .y = .splat(height), .z = disc[1] };
        const cosine_density = @max(height, 1e-12) / std.math.pi;
        const by_normal = bsdf.evalLobes(point, to_light);
        const by_cosine = bsdf.evalLobes(point, spread);
        diffuse += share * by_cosine.diffuse.x.lane(0) / cosine_density;
        // Balance heuristic (Veach and Guibas 1995): the lobe is narrow and wide at once.
        const other = @max(to_light.y.lane(0), 0) / std.math.pi;
        const spread_density = visibleDensity(&bsdf, point, spread);
        specular += share * (by_normal.specular.x.lane(0) / @max(density + other, 1e-20) +
            by_cosine.specular.x.lane(0) / (spread_density + cosine_density));
    };
    return .{ .diffuse = diffuse, .specular = specular };
}

/// Density of mirror images about visible normals.
fn visibleDensity(
    bsdf: *const Bsdf(Single),
    point: *const Interaction(Single),
    way: Single.Vec3,
) f32 {
    const half = point.view.add(way).normalize();
    return sampling.baseOf(Single, point, bsdf).pdf(half).lane(0);
}

const cosines = [_]f32{ 0.003, 0.03, 0.1, 0.3, 0.55, 0.8, 1 };
const roughnesses = [_]f32{ 0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1 };
const ways = [_][3]f32{ .{ 0, 1, 0 }, .{ -1, 0, 0 }, .{ 0, -1, 0 }, .{ 0.6, 1e-4, 0.8 } };

test "light straight above a rough white dielectric: the lobe, and what it leaves over pi" {
    const point = testPoint(.{ 0, 1, 0 });
    const lobes = Bsdf(Single).of(&point).evalLobes(&point, .splat(.{ 0, 1, 0 }));
    // D = 1 / pi, V = 1 / 4 at roughness 1; the second lobe adds 0.1 % of what is lost at most.
    const single = 0.04 / std.math.pi * 0.25;
    try std.testing.expectApproxEqAbs(single, lobes.specular.x.lane(0), 1.5e-3);
    // The whole lobe sends 1.5 % straight up, and 2.1 % in the mean over all ways.
    const below = (1 - 0.015) * (1 - 0.015) / (1 - 0.021) / std.math.pi;
    try std.testing.expectApproxEqRel(below, lobes.diffuse.x.lane(0), 3e-3);
}

test "white metal in white light is white: within 2 % at every cosine and roughness" {
    for (roughnesses) |roughness| for (cosines) |cosine| {
        var point = testPoint(viewAt(cosine).lane(0));
        setRough(&point, 1, roughness);
        errdefer std.debug.print("roughness {d}, cosine {d}\n", .{ roughness, cosine });
        try std.testing.expectApproxEqAbs(1, integrate(&point).specular, 0.02);
        const albedo = Bsdf(Single).of(&point).specular_albedo.x.lane(0);
        try std.testing.expectApproxEqAbs(1, albedo, 0.02);
    };
}

test "albedos are the integrals of their lobes, and a white dielectric is white" {
    for (roughnesses) |roughness| for (cosines) |cosine| for ([_]f32{ 0, 0.5 }) |metallic| {
        var point = testPoint(viewAt(cosine).lane(0));
        setRough(&point, metallic, roughness);
        const bsdf: Bsdf(Single) = .of(&point);
        const sums = integrate(&point);
        errdefer std.debug.print("roughness {d}, cosine {d}\n", .{ roughness, cosine });
        const specular = bsdf.specular_albedo.x.lane(0);
        const diffuse = bsdf.diffuse_albedo.x.lane(0);
        try std.testing.expectApproxEqRel(sums.specular, specular, 0.015);
        try std.testing.expectApproxEqRel(sums.diffuse, diffuse, 0.01);
        if (metallic > 0) continue;
        try std.testing.expectApproxEqAbs(1, sums.specular + sums.diffuse, 0.01);
    };
}

test "reciprocity: light and view change places" {
    var random = std.Random.DefaultPrng.init(7);
    const numbers = random.random();
    for (0..2000) |_| {
        var point = testPoint(viewAt(numbers.float(f32) * 0.99 + 0.01).lane(0));
        setRough(&point, numbers.float(f32), numbers.float(f32));
        point.material.base_color = .splat(.{ numbers.float(f32), numbers.float(f32), 0.5 });
        point.material.transmission = .splat(numbers.float(f32));
        const disc = microfacet
            .disc(Single, .{ .splat(numbers.float(f32)), .splat(numbers.float(f32)) });
        const height = 1 - disc[0].lane(0) * disc[0].lane(0) - disc[1].lane(0) * disc[1].lane(0);
        if (height < 1e-4) continue;
        const light: Single.Vec3 = .{ .x = disc[0], .y = .splat(@sqrt(height)), .z = disc[1] };
        const there = Bsdf(Single).of(&point).eval(&point, light).scale(point.view.y);
        const view = point.view;
        point.view = light;
        const back = Bsdf(Single).of(&point).eval(&point, view).scale(light.y);
        for (there.lane(0), back.lane(0)) |a, b| try std.testing.expectApproxEqRel(a, b, 1e-3);
    }
}

test "no energy is made: reflected, transmitted and diffuse shares sum to 1 at most" {
    var point = testPoint(.{ 0, 1, 0 });
    for ([_]f32{ 0, 0.3, 1 }) |metallic| for ([_]f32{ 0, 0.5, 1 }) |transmission| {
        for ([_]f32{ 0, 1e-3, 0.1, 0.7, 1 }) |cosine| for ([_]bool{ false, true }) |back| {
            for ([_]f32{ 0, 1e-3, 0.04, 0.3, 1 }) |roughness| {
                setRough(&point, metallic, roughness);
                point.view = viewAt(cosine);
                point.material.transmission = .splat(transmission);
                point.material.volume = .splat(transmission > 0);
                point.back = .splat(back);
                point.eta = .splat(if (back) 1.5 else 1.0 / 1.5);
                const bsdf: Bsdf(Single) = .of(&point);
                const shares = [_]Single.Vec3{
                    bsdf.specular_albedo, bsdf.diffuse_albedo, bsdf.mirror.transmitted,
                };
                var sum: f32 = 0;
                for (shares) |share| {
                    try std.testing.expect(share.x.lane(0) >= 0);
                    sum += share.x.lane(0);
                }
                try std.testing.expect(sum <= 1.00001);
                for (ways) |way| {
                    const lobes = bsdf.evalLobes(&point, .splat(way));
                    try std.testing.expect(lobes.diffuse.x.lane(0) >= 0);
                    try std.testing.expect(lobes.specular.x.lane(0) >= 0);
                    try std.testing.expect(std.math.isFinite(lobes.specular.x.lane(0)));
                }
            }
        };
    };
}

test "what a surface was before is not seen in what it becomes" {
    var random = std.Random.DefaultPrng.init(11);
    const numbers = random.random();
    var bsdf: Bsdf(Single) = .of(&testPoint(.{ 0, 1, 0 }));
    for (0..500) |_| {
        var point = testPoint(viewAt(numbers.float(f32)).lane(0));
        const metallic: f32 = @floatFromInt(numbers.uintLessThan(u32, 3));
        const roughness: f32 = @floatFromInt(numbers.uintLessThan(u32, 3));
        setRough(&point, metallic / 2, roughness / 2);
        point.material.base_color = .splat(.{ 0.9, 0.5, numbers.float(f32) });
        point.material.transmission = .splat(numbers.float(f32));
        bsdf.become(&point);
        const anew: Bsdf(Single) = .of(&point);
        for ([_][2]Single.Vec3{
            .{ anew.specular_albedo, bsdf.specular_albedo },
            .{ anew.diffuse_albedo, bsdf.diffuse_albedo },
            .{ anew.mirror.reflected, bsdf.mirror.reflected },
            .{ anew.mirror.transmitted, bsdf.mirror.transmitted },
            .{ anew.eval(&point, .splat(ways[3])), bsdf.eval(&point, .splat(ways[3])) },
        }) |pair| try std.testing.expectEqual(pair[0].lane(0), pair[1].lane(0));
    }
}

test "an index of 1 is no boundary: all light is the base's" {
    for (roughnesses) |roughness| for (cosines) |cosine| {
        var point = testPoint(viewAt(cosine).lane(0));
        setRough(&point, 0, roughness);
        point.material.dielectric_f0 = .splat(0);
        const bsdf: Bsdf(Single) = .of(&point);
        try std.testing.expectEqual(0, bsdf.specular_albedo.x.lane(0));
        try std.testing.expectEqual(1, bsdf.diffuse_albedo.x.lane(0));
        const response = bsdf.eval(&point, .splat(.{ 0, 0.8, 0.6 })).x.lane(0);
        try std.testing.expectApproxEqRel(0.8 / std.math.pi, response, 1e-6);
    };
}

test "a smooth surface reflects by Fresnel, exactly" {
    for ([_]f32{ 0.1, 0.5, 1 }) |cosine| {
        var point = testPoint(viewAt(cosine).lane(0));
        setRough(&point, 0, 0);
        const weight = microfacet.power5(Single, .splat(1 - cosine)).lane(0);
        const bsdf: Bsdf(Single) = .of(&point);
        const fresnel = 0.04 + (1 - @as(f32, 0.04)) * weight;
        try std.testing.expectApproxEqRel(fresnel, bsdf.mirror.reflected.x.lane(0), 1e-6);
    }
}

test "Snell's law, total internal reflection and the thin wall" {
    var point = testPoint(.{ 0.6, 0.8, 0 });
    point.material.transmission = .splat(1);
    point.material.volume = .splat(true);
    const entering = Bsdf(Single).of(&point);
    try std.testing.expectApproxEqRel(-0.6 / 1.5, entering.mirror.refraction.x.lane(0), 1e-5);
    try std.testing.expect(!entering.mirror.total.lane(0));
    point.back = .splat(true);
    point.eta = .splat(1.5);
    const leaving = Bsdf(Single).of(&point); // sin 0.6 * 1.5 = 0.9
    try std.testing.expectApproxEqRel(@as(f32, -0.9), leaving.mirror.refraction.x.lane(0), 1e-5);
    point.view = .splat(.{ 0.8, 0.6, 0 }); // sin 0.8 * 1.5 > 1
    const trapped = Bsdf(Single).of(&point);
    try std.testing.expect(trapped.mirror.total.lane(0));
    try std.testing.expectEqual(1, trapped.mirror.reflected.x.lane(0));
    try std.testing.expectEqual(0, trapped.mirror.transmitted.x.lane(0));
    point.material.volume = .splat(false);
    const thin = Bsdf(Single).of(&point);
    try std.testing.expectEqual(-0.8, thin.mirror.refraction.x.lane(0));
    try std.testing.expect(!thin.mirror.total.lane(0));
}

test "a mirror image leaves on the same side" {
    const point = testPoint(.{ 0.6, 0.8, 0 });
    const direction = reflect(Single, &point);
    try std.testing.expectApproxEqAbs(@as(f32, -0.6), direction.x.lane(0), 1e-6);
    try std.testing.expectApproxEqAbs(@as(f32, 0.8), direction.y.lane(0), 1e-6);
    var tilted = point;
    tilted.normal = Single.Vec3.splat(.{ -0.9, 0.1, 0 }).normalize();
    try std.testing.expect(reflect(Single, &tilted).y.lane(0) > 0);
}
