//! Reflectance of a base whose channels differ: coloured dielectrics and thin films, in lanes.
//!
//! In: points, parameters of layers. Out: what Schlick's approximation starts from. By the texts of
//! KHR_materials_specular (weight and colour of the dielectric's reflection) and
//! KHR_materials_iridescence (a film over dielectric and metal alike, as `iridescence.zig` has it
//! at this view; the base below gets what the brightest channel leaves).

const std = @import("std");
const simd = @import("../../simd.zig");
const bsdf_file = @import("bsdf.zig");
const iridescence = @import("iridescence.zig");
const test_surface = @import("test_surface.zig");
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

const Single = simd.Lanes(.scalar, 1);
const ways = [_][3]f32{ .{ 0, 1, 0 }, .{ 0.6, 0.8, 0 }, .{ 0.8, 0.2, 0.5656854 } };

fn layered(point: *const Interaction(Single), layers: *const Layers(Single)) Bsdf {
    var bsdf: Bsdf = undefined;
    bsdf.albedo = .unknown;
    bsdf.becomeLayered(point, layers);
    return bsdf;
}

const Bsdf = bsdf_file.Bsdf(Single);

test "specular: without weight a dielectric is all diffuse" {
    var layers = test_surface.layersOf(Single);
    layers.specular = .zero();
    for (ways) |view| {
        var point = test_surface.pointAt(Single, view);
        point.material.roughness = .splat(0.5);
        const bsdf = layered(&point, &layers);
        try std.testing.expectEqual(@as([3]f32, @splat(0)), bsdf.specular_albedo.lane(0));
        try std.testing.expectEqual(@as([3]f32, @splat(1)), bsdf.diffuse_albedo.lane(0));
        const lobes = bsdf.evalLobes(&point, .splat(ways[1]));
        try std.testing.expectEqual(@as([3]f32, @splat(0)), lobes.specular.lane(0));
        const lambert = 0.8 / std.math.pi;
        try std.testing.expectApproxEqRel(lambert, lobes.diffuse.y.lane(0), 1e-6);
    }
}

test "specular: the weight scales f0 and f90, the colour f0, and 1 is the most" {
    const point = test_surface.pointAt(Single, ways[1]);
    var layers = test_surface.layersOf(Single);
    layers.specular = .splat(0.5);
    layers.specular_color = .splat(.{ 2, 0.5, 100 });
    const found: Interface(Single) = .of(&point, &layers);
    for ([_]f32{ 0.04, 0.01, 0.5 }, found.f0.lane(0)) |wanted, f0| {
        try std.testing.expectApproxEqRel(wanted, f0, 1e-6);
    }
    try std.testing.expectEqual(0.5, found.dielectric_f0.lane(0));
    try std.testing.expectEqual(0.5, found.dielectric_f90.lane(0));
}

test "specular: a red one leaves to the diffuse lobe what its brightest channel leaves" {
    var layers = test_surface.layersOf(Single);
    layers.specular_color = .splat(.{ 1, 0, 0 });
    for (ways) |view| {
        var point = test_surface.pointAt(Single, view);
        point.material.roughness = .splat(0.5);
        const plain: Bsdf = .of(&point);
        const red = layered(&point, &layers);
        const found = red.specular_albedo.lane(0);
        try std.testing.expectEqual(plain.specular_albedo.x.lane(0), found[0]);
        try std.testing.expect(found[1] < found[0] and found[1] == found[2]);
        try std.testing.expectEqual(plain.diffuse_albedo.lane(0), red.diffuse_albedo.lane(0));
        try std.testing.expectEqual([3]f32{ 0.04, 0, 0 }, red.f0.lane(0));
        try std.testing.expectEqual(1, red.f90.lane(0));
    }
}

test "specular: metals are what they are" {
    var point = test_surface.pointAt(Single, ways[1]);
    point.material.metallic = .splat(1);
    point.material.base_color = .splat(.{ 0.9, 0.6, 0.3 });
    var layers = test_surface.layersOf(Single);
    layers.specular = .splat(0.2);
    layers.specular_color = .splat(.{ 0, 1, 0.5 });
    const plain: Bsdf = .of(&point);
    const found = layered(&point, &layers);
    try std.testing.expectEqual(plain.f0.lane(0), found.f0.lane(0));
    try std.testing.expectEqual(plain.f90.lane(0), found.f90.lane(0));
    try std.testing.expectEqual(plain.specular_albedo.lane(0), found.specular_albedo.lane(0));
}

test "iridescence: a film of no weight, of no thickness or of index 1 changes nothing" {
    for (ways) |view| for ([_]f32{ 0, 0.5, 1 }) |metallic| {
        var point = test_surface.pointAt(Single, view);
        point.material.metallic = .splat(metallic);
        point.material.base_color = .splat(.{ 0.9, 0.6, 0.3 });
        var layers = test_surface.layersOf(Single);
        const none = Interface(Single).of(&point, &layers).f0.lane(0);
        layers.iridescence_ior = .splat(2.4);
        layers.iridescence_thickness_nm = .splat(1200);
        try std.testing.expectEqual(none, Interface(Single).of(&point, &layers).f0.lane(0));
        layers.iridescence = .splat(1);
        const whole = Interface(Single).of(&point, &layers).f0.lane(0);
        try std.testing.expect(@abs(whole[0] - none[0]) > 0.01);
        // By halves it is half of each.
        layers.iridescence = .splat(0.5);
        const half = Interface(Single).of(&point, &layers).f0.lane(0);
        for (none, whole, half) |a, b, mean| {
            try std.testing.expectApproxEqAbs((a + b) / 2, mean, 1e-6);
        }
        layers.iridescence = .splat(1);
        layers.iridescence_thickness_nm = .zero();
        const thin = Interface(Single).of(&point, &layers).f0.lane(0);
        layers.iridescence_thickness_nm = .splat(1200);
        layers.iridescence_ior = .splat(1);
        const airy = Interface(Single).of(&point, &layers).f0.lane(0);
        for (none, thin, airy) |f0, a, b| {
            try std.testing.expectApproxEqAbs(f0, a, 1e-5);
            try std.testing.expectApproxEqAbs(f0, b, 1e-5);
        }
    };
}
