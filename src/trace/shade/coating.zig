//! What lies over a surface, in lanes: a clear coat (GGX) and, below it, fibres (Charlie).
//!
//! In: points, parameters of layers. Out: what coat and fibres make of light, and what they leave
//! to the base. By the texts of KHR_materials_clearcoat and KHR_materials_sheen: a layer takes from
//! what lies below it the share that it reflects of white light from everywhere to the view
//! ("albedo scaling"; Kulla and Conty 2017, section on layering), so that all together reflect at
//! most 1. What the light's way in would lose besides is left out, as the texts do.

const std = @import("std");
const simd = @import("../../simd.zig");
const bsdf_file = @import("bsdf.zig");
const albedo_file = @import("albedo.zig");
const microfacet = @import("microfacet.zig");
const sheen = @import("sheen.zig");
const test_surface = @import("test_surface.zig");
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

const Single = simd.Lanes(.scalar, 1);
const cosines = [_]f32{ 0.05, 0.2, 0.5, 0.8, 1 };

/// What a lobe sends to the view of white light from everywhere: its integral over directions dense
/// at the horizon and around the normal, one half of them, for the other is its mirror image.
fn integrate(lobe: anytype) f64 {
    const steps = 48;
    var sum: f64 = 0;
    for (0..steps) |i| for (0..steps) |j| {
        const u = (@as(f32, @floatFromInt(i)) + 0.5) / steps;
        const v = (@as(f32, @floatFromInt(j)) + 0.5) / steps;
        const cosine = u * u * (2 - u * u);
        const radius = @sqrt(1 - cosine * cosine);
        // Dense around the mirror direction.
        const angle = std.math.pi * (1 - v * v);
        const solid_angle = 4 * u * (1 - u * u) * 2 * v * 2 * std.math.pi / (steps * steps);
        const way = [3]f32{ radius * @cos(angle), cosine, radius * @sin(angle) };
        sum += @as(f64, lobe.at(.splat(way))) * solid_angle;
    };
    return sum;
}

const Coat = struct {
    point: *const Interaction(Single),
    coating: Coating(Single),

    fn at(coat: *const Coat, to_light: Single.Vec3) f32 {
        return coat.coating.evalCoat(coat.point, to_light).lane(0);
    }
};

const Fibres = struct {
    point: *const Interaction(Single),
    coating: Coating(Single),

    fn at(fibres: *const Fibres, to_light: Single.Vec3) f32 {
        const cos_view = fibres.point.normal.dot(fibres.point.view);
        return fibres.coating.evalSheen(fibres.point, cos_view, to_light).y.lane(0);
    }
};

test "the coat's albedo is the integral of its lobe, to 1 %" {
    for ([_]f32{ 0.4, 0.6, 1 }) |roughness| for (cosines) |cosine| {
        const point = test_surface.pointAt(Single, test_surface.viewAt(cosine).lane(0));
        var layers = test_surface.layersOf(Single);
        layers.clearcoat = .splat(0.7);
        layers.clearcoat_roughness = .splat(roughness);
        const coating: Coating(Single) = .of(&point, &layers);
        errdefer std.debug.print("roughness {d}, cosine {d}\n", .{ roughness, cosine });
        const wanted = integrate(&Coat{ .point = &point, .coating = coating });
        try std.testing.expectApproxEqRel(wanted, coating.albedo.lane(0), 0.01);
        try std.testing.expectEqual(1 - coating.albedo.lane(0), coating.below_coat.lane(0));
    };
}

test "the fibres' albedo is the integral of their lobe, to 1 %, below a coat as well" {
    for ([_]f32{ 0.3, 1 }) |roughness| for (cosines) |cosine| {
        const point = test_surface.pointAt(Single, test_surface.viewAt(cosine).lane(0));
        var layers = test_surface.layersOf(Single);
        layers.clearcoat = .splat(1);
        layers.sheen_color = .splat(.{ 1, 0.5, 0 });
        layers.sheen_roughness = .splat(roughness);
        const coating: Coating(Single) = .of(&point, &layers);
        errdefer std.debug.print("roughness {d}, cosine {d}\n", .{ roughness, cosine });
        const wanted = integrate(&Fibres{ .point = &point, .coating = coating });
        const found = coating.sheen_albedo.lane(0);
        try std.testing.expectApproxEqAbs(wanted, found[1], 0.01 * @max(wanted, 0.1));
        try std.testing.expectEqual(2 * found[1], found[0]);
        try std.testing.expectEqual(0, found[2]);
    };
}

test "reciprocity: light and view change places at coat and fibres" {
    const ways = [_][3]f32{ .{ 0.6, 0.8, 0 }, .{ -0.8, 0.36, 0.48 }, .{ 0.48, 0.1, 0.8715503 } };
    var layers = test_surface.layersOf(Single);
    for ([_]f32{ 0.3, 0.6, 1 }) |roughness| for (ways) |view| for (ways) |light| {
        const there = test_surface.pointAt(Single, view);
        const back = test_surface.pointAt(Single, light);
        layers.clearcoat = .splat(1);
        layers.clearcoat_roughness = .splat(roughness);
        const a = Coat{ .point = &there, .coating = .of(&there, &layers) };
        const b = Coat{ .point = &back, .coating = .of(&back, &layers) };
        const coats = [2]f32{ a.at(.splat(light)) / light[1], b.at(.splat(view)) / view[1] };
        try std.testing.expect(coats[0] > 0);
        try std.testing.expectApproxEqRel(coats[0], coats[1], 1e-4);
        layers.clearcoat = .zero();
        layers.sheen_color = .splat(.{ 1, 1, 1 });
        layers.sheen_roughness = .splat(roughness);
        const c = Fibres{ .point = &there, .coating = .of(&there, &layers) };
        const d = Fibres{ .point = &back, .coating = .of(&back, &layers) };
        const fibres = [2]f32{ c.at(.splat(light)) / light[1], d.at(.splat(view)) / view[1] };
        try std.testing.expectApproxEqRel(fibres[0], fibres[1], 1e-4);
    };
}

/// What a furnace holds a surface to: which layers it has, a bit each.
const Layering = packed struct(u6) {
    metal: bool,
    rough_coat: bool,
    fibres: bool,
    film: bool,
    diffuse_transmission: bool,
    transmission: bool,
};

test "white furnace: all shares together are at most 1, whatever the layers" {
    var dimmest: f32 = 1;
    for (0..64) |bits| for ([_]f32{ 0, 0.5, 1 }) |coat| for ([_]f32{ 0.3, 1 }) |roughness| {
        const has: Layering = @bitCast(@as(u6, @intCast(bits)));
        for (cosines) |cosine| {
            var point = test_surface.pointAt(Single, test_surface.viewAt(cosine).lane(0));
            point.material.metallic = .splat(if (has.metal) 1 else 0);
            point.material.roughness = .splat(roughness);
            point.material.transmission = .splat(if (has.transmission) 0.5 else 0);
            var layers = test_surface.layersOf(Single);
            layers.clearcoat = .splat(coat);
            layers.clearcoat_roughness = .splat(if (has.rough_coat) 0.6 else 0.1);
            layers.sheen_color = .splat(if (has.fibres) .{ 1, 1, 1 } else .{ 0, 0, 0 });
            layers.sheen_roughness = .splat(roughness);
            layers.iridescence = .splat(if (has.film) 1 else 0);
            layers.diffuse_transmission = .splat(if (has.diffuse_transmission) 0.5 else 0);
            errdefer std.debug.print("{any}, coat {d}, roughness {d}, cosine {d}\n", .{
                has, coat, roughness, cosine,
            });
            for (sharesOf(&point, &layers)) |sum| {
                try std.testing.expect(sum <= 1 + 1e-5);
                dimmest = @min(dimmest, sum);
            }
        }
    };
    // Something was left: the film's dimmer channels alone fall short of white.
    try std.testing.expect(dimmest > 0.1 and dimmest < 1);
}

/// By channel, of white light from everywhere, from behind as well.
fn sharesOf(point: *const Interaction(Single), layers: *const Layers(Single)) [3]f32 {
    var bsdf: bsdf_file.Bsdf(Single) = undefined;
    bsdf.albedo = .unknown;
    bsdf.becomeLayered(point, layers);
    const coat = bsdf.coating.albedo;
    return bsdf.specular_albedo.add(bsdf.diffuse_albedo).add(bsdf.back_albedo)
        .add(bsdf.mirror.transmitted).add(bsdf.coating.sheen_albedo)
        .add(.{ .x = coat, .y = coat, .z = coat }).lane(0);
}
