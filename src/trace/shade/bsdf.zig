//! The BSDF of glTF's metallic-roughness model in lanes: Lambert, GGX, Schlick's Fresnel, Snell.
//!
//! In: points on surfaces. Out: what they make of light from a direction, and what goes on by
//! reflection and refraction. Formulas: glTF 2.0, appendix B (Burley 2012 for roughness squared,
//! Schlick 1994 for Fresnel, Walter et al. 2007 and Heitz 2014 for GGX with its correlated
//! shadowing). Everything is + - * / sqrt in a fixed order.

const std = @import("std");
const simd = @import("../../simd.zig");
const Interaction = @import("interaction.zig").Interaction;

/// Least roughness for highlights of lights, which have no size: below it a highlight would be a
/// spike that no pixel grid can show.
const highlight_roughness_least = 0.05;

/// Up to this roughness reflections are traced; rougher surfaces see the ambient term instead.
pub const mirror_roughness_max = 0.25;

/// The parts of a surface's BSDF: a diffuse and a glossy one, which lights are seen by, and those
/// of a smooth boundary, which single rays follow.
pub fn Bsdf(comptime Lanes: type) type {
    return struct {
        /// Albedo of the diffuse part.
        diffuse: Lanes.Vec3,
        /// Reflectance at normal incidence.
        f0: Lanes.Vec3,
        /// Square of GGX's alpha, for highlights.
        alpha_squared: Lanes.F32,
        /// Cosine between normal and view, > 0.
        cos_view: Lanes.F32,
        mirror: Mirror(Lanes),

        const F32 = Lanes.F32;
        const Vec3 = Lanes.Vec3;

        /// That of the surface at these points.
        pub fn of(point: *const Interaction(Lanes)) @This() {
            const one: F32 = .splat(1);
            const material = &point.material;
            const dielectric = one.sub(material.metallic);
            const base = material.base_color;
            const clear_f0 = splat3(Lanes, material.dielectric_f0.mul(dielectric));
            const f0 = clear_f0.add(base.scale(material.metallic));
            const cos_view = point.normal.dot(point.view).max(.splat(1e-4)).min(one);
            const rough = material.roughness.max(.splat(highlight_roughness_least));
            const alpha = rough.mul(rough);
            return .{
                .diffuse = base.scale(dielectric.mul(one.sub(material.transmission))),
                .f0 = f0,
                .alpha_squared = alpha.mul(alpha),
                .cos_view = cos_view,
                .mirror = .of(point, f0, dielectric, cos_view),
            };
        }

        /// BSDF times cosine: radiance towards the view for each unit of irradiance on a plane
        /// across the light's way. `to_light` is a unit vector on the front side.
        pub fn eval(
            bsdf: *const @This(),
            point: *const Interaction(Lanes),
            to_light: Vec3,
        ) Vec3 {
            const one: F32 = .splat(1);
            const half = point.view.add(to_light).normalize();
            const cos_light = point.normal.dot(to_light).max(.zero());
            const cos_half = point.normal.dot(half).max(.zero()).min(one);
            const cos_view_half = point.view.dot(half).max(.zero()).min(one);
            const a = bsdf.alpha_squared;
            const slope = cos_half.mul(cos_half).mul(a.sub(one)).add(one);
            const distribution = a.div(slope.mul(slope).mul(.splat(std.math.pi)));
            const view_term = smith(Lanes, bsdf.cos_view, a).mul(cos_light);
            const light_term = smith(Lanes, cos_light, a).mul(bsdf.cos_view);
            // Both terms vanish together only where the light grazes: cos_light is 0 as well.
            const visibility = F32.splat(0.5).div(view_term.add(light_term).max(.splat(1e-12)));
            const white: Vec3 = .splat(.{ 1, 1, 1 });
            const fresnel = bsdf.f0.add(
                white.sub(bsdf.f0).scale(power5(Lanes, one.sub(cos_view_half))),
            );
            const diffuse = bsdf.diffuse.mul(white.sub(fresnel)).scale(.splat(1.0 / std.math.pi));
            const specular = fresnel.scale(distribution.mul(visibility));
            return diffuse.add(specular).scale(cos_light);
        }
    };
}

/// What a smooth boundary does to light: reflection and refraction, each in one direction.
pub fn Mirror(comptime Lanes: type) type {
    return struct {
        /// Share of light from the mirror direction that is reflected to the view.
        reflected: Lanes.Vec3,
        /// Share of light from behind that comes through to the view.
        transmitted: Lanes.Vec3,
        /// Unit direction that the light which comes through had; along the ray for thin walls.
        refraction: Lanes.Vec3,
        /// Where the surface reflects all light because it cannot leave the volume.
        total: Lanes.Mask,

        inline fn of(
            point: *const Interaction(Lanes),
            f0: Lanes.Vec3,
            dielectric: Lanes.F32,
            cos_view: Lanes.F32,
        ) @This() {
            const material = &point.material;
            const boundary: Boundary(Lanes) = if (material.volume.any())
                .of(point, cos_view)
            else
                .{
                    .total = .splat(false),
                    .cos_fresnel = cos_view,
                    .refraction = point.view.neg(),
                };
            const white: Lanes.Vec3 = .splat(.{ 1, 1, 1 });
            const fresnel = schlick(Lanes, f0, material.roughness, boundary.cos_fresnel);
            const reflected: Lanes.Vec3 = .select(boundary.total, white, fresnel);
            const passing = material.base_color.scale(dielectric.mul(material.transmission));
            return .{
                .reflected = reflected,
                .transmitted = passing.mul(white.sub(reflected)),
                .refraction = boundary.refraction,
                .total = boundary.total,
            };
        }
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
            const eta = F32.select(point.back, material.ior, one.div(material.ior));
            const sin_squared = one.sub(cos_view.mul(cos_view));
            const cos_squared = one.sub(eta.mul(eta).mul(sin_squared));
            const cos_inside = cos_squared.max(.zero()).sqrt();
            const along = point.view.neg();
            const turned = point.normal.scale(eta.mul(cos_view).sub(cos_inside));
            const bent = along.scale(eta).add(turned);
            // A shading normal far from the triangle's can bend light back to the same side.
            const through = bent.dot(point.normal_geometric).lt(.zero());
            const leaving = material.volume.bitAnd(point.back);
            return .{
                .total = material.volume.bitAnd(cos_squared.lt(.zero())),
                .cos_fresnel = F32.select(leaving, cos_inside, cos_view),
                .refraction = .select(material.volume.bitAnd(through), bent, along),
            };
        }
    };
}

/// Schlick's Fresnel reflectance; rough surfaces do not turn white at grazing angles.
inline fn schlick(
    comptime Lanes: type,
    f0: Lanes.Vec3,
    roughness: Lanes.F32,
    cosine: Lanes.F32,
) Lanes.Vec3 {
    const one: Lanes.F32 = .splat(1);
    const grazing = f0.max(splat3(Lanes, one.sub(roughness)));
    return f0.add(grazing.sub(f0).scale(power5(Lanes, one.sub(cosine))));
}

inline fn power5(comptime Lanes: type, x: Lanes.F32) Lanes.F32 {
    const squared = x.mul(x);
    return squared.mul(squared).mul(x);
}

inline fn splat3(comptime Lanes: type, value: Lanes.F32) Lanes.Vec3 {
    return .{ .x = value, .y = value, .z = value };
}

/// Square root of Smith's shadowing term for GGX (Heitz 2014, equation 99).
inline fn smith(comptime Lanes: type, cosine: Lanes.F32, a: Lanes.F32) Lanes.F32 {
    return cosine.mul(cosine).mul(Lanes.F32.splat(1).sub(a)).add(a).sqrt();
}

/// Unit direction of the mirror reflection; never into the point.
pub fn reflect(comptime Lanes: type, point: *const Interaction(Lanes)) Lanes.Vec3 {
    const mirrored = mirror(Lanes, point.view, point.normal);
    const below = mirrored.dot(point.normal_geometric).le(.zero());
    return .select(below, mirror(Lanes, point.view, point.normal_geometric), mirrored);
}

inline fn mirror(comptime Lanes: type, view: Lanes.Vec3, normal: Lanes.Vec3) Lanes.Vec3 {
    const cosine = normal.dot(view);
    return normal.scale(cosine.add(cosine)).sub(view).normalize();
}

const Single = simd.Lanes(.scalar, 1);

fn testPoint(view: [3]f32) Interaction(Single) {
    const up: Single.Vec3 = .splat(.{ 0, 1, 0 });
    return .{
        .hit = .splat(true),
        .position = .splat(.{ 0, 0, 0 }),
        .normal_geometric = up,
        .normal = up,
        .view = .splat(view),
        .distance = .splat(1),
        .back = .splat(false),
        .culled = .splat(false),
        .opacity = .splat(1),
        .error_ulps = .zero(),
        .offset_max = .zero(),
        .cone_width = .zero(),
        .curvature = .zero(),
        .material = .{
            .base_color = .splat(.{ 1, 1, 1 }),
            .emissive = .splat(.{ 0, 0, 0 }),
            .metallic = .splat(0),
            .roughness = .splat(1),
            .dielectric_f0 = .splat(0.04),
            .ior = .splat(1.5),
            .transmission = .splat(0),
            .sigma_a = .splat(.{ 0, 0, 0 }),
            .occlusion = .splat(1),
            .unlit = .splat(false),
            .volume = .splat(false),
        },
    };
}

test "light straight above a rough white dielectric: albedo over pi, less the reflected share" {
    const point = testPoint(.{ 0, 1, 0 });
    const bsdf: Bsdf(Single) = .of(&point);
    const response = bsdf.eval(&point, .splat(.{ 0, 1, 0 }));
    const specular = 0.04 / std.math.pi * 0.25; // D = 1 / pi, V = 1 / 4 at roughness 1.
    try std.testing.expectApproxEqRel(0.96 / std.math.pi + specular, response.x.lane(0), 1e-5);
}

test "no energy is made: reflected, transmitted and diffuse shares sum to 1 at most" {
    var point = testPoint(.{ 0, 1, 0 });
    for ([_]f32{ 0, 0.3, 1 }) |metallic| for ([_]f32{ 0, 0.5, 1 }) |transmission| {
        for ([_]f32{ 1e-3, 0.1, 0.7, 1 }) |cosine| for ([_]bool{ false, true }) |back| {
            const sine = @sqrt(1 - cosine * cosine);
            point.view = .splat(.{ sine, cosine, 0 });
            point.material.metallic = .splat(metallic);
            point.material.transmission = .splat(transmission);
            point.material.volume = .splat(true);
            point.back = .splat(back);
            point.material.roughness = .splat(0);
            const bsdf: Bsdf(Single) = .of(&point);
            const reflected = bsdf.mirror.reflected.x.lane(0);
            const rest = bsdf.diffuse.x.lane(0) * (1 - reflected);
            try std.testing.expect(reflected + bsdf.mirror.transmitted.x.lane(0) + rest <= 1.00001);
        };
    };
}

test "Snell's law, total internal reflection and the thin wall" {
    var point = testPoint(.{ 0.6, 0.8, 0 });
    point.material.transmission = .splat(1);
    point.material.volume = .splat(true);
    const entering = Bsdf(Single).of(&point);
    try std.testing.expectApproxEqRel(-0.6 / 1.5, entering.mirror.refraction.x.lane(0), 1e-5);
    try std.testing.expect(!entering.mirror.total.lane(0));
    point.back = .splat(true);
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
