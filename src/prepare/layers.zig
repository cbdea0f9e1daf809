//! What the extensions of a material come to: which of its layers change anything, and their
//! numbers as shading wants them.
//!
//! In: a material of the scene. Out: `world.Layers`, where what has no effect has the defaults.
//! Scattering in volumes: the albedo of light that is scattered many times is that of a single
//! scattering by the fit of Kulla and Conty 2017, "Revisiting Physically Based Shading at
//! Imageworks", as KHR_materials_volume_scatter has it.

const std = @import("std");
const math = @import("../math.zig");
const scene = @import("../scene.zig");
const world = @import("../world.zig");
const assert = std.debug.assert;
const Vec3 = math.Vec3;

/// Darkest attenuation colour: a channel at 0 would absorb without bound.
const attenuation_color_min = 1e-4;

/// Which layers of a material change what is seen of it.
pub const Effects = struct {
    specular: bool = false,
    clearcoat: bool = false,
    sheen: bool = false,
    dispersion: bool = false,
    iridescence: bool = false,
    anisotropy: bool = false,
    diffuse_transmission: bool = false,
    scattering: bool = false,

    /// Those of a material.
    pub fn of(from: *const scene.Material) Effects {
        if (from.unlit) return .{};
        const is_metal = from.metallic == 1 and from.metallic_roughness_texture == null;
        const is_tinted = from.specular != 1 or !isAll(from.specular_color, 1) or
            from.specular_texture != null or from.specular_color_texture != null;
        // A film of no thickness, or of the index of air, is none.
        const film_max_nm = if (from.iridescence_thickness_texture == null)
            from.iridescence_thickness_max_nm
        else
            @max(from.iridescence_thickness_min_nm, from.iridescence_thickness_max_nm);
        const is_filled = from.volume and from.attenuation_distance < std.math.inf(f32) and
            !isAll(from.attenuation_color, 1) and !isAll(from.multiscatter_color, 0);
        const transmission = !is_metal and from.transmission > 0;
        const diffuse_transmission = !is_metal and from.diffuse_transmission > 0;
        return .{
            .specular = is_tinted and !is_metal,
            .clearcoat = from.clearcoat > 0,
            .sheen = !isAll(from.sheen_color, 0),
            .dispersion = from.dispersion > 0 and from.volume and transmission,
            .iridescence = from.iridescence > 0 and from.iridescence_ior > 1 and film_max_nm > 0,
            .anisotropy = from.anisotropy > 0,
            .diffuse_transmission = diffuse_transmission,
            .scattering = is_filled and (transmission or diffuse_transmission),
        };
    }

    fn any(effects: Effects) bool {
        inline for (comptime std.meta.fieldNames(Effects)) |name| {
            if (@field(effects, name)) return true;
        }
        return false;
    }
};

/// Whether all channels are this.
pub fn isAll(color: Vec3, value: f32) bool {
    return color[0] == value and color[1] == value and color[2] == value;
}

/// The layers of a material, which has textures for some of them or not.
pub fn convert(from: *const scene.Material, has_textures: bool) world.Layers {
    const effects: Effects = .of(from);
    var layers: world.Layers = .{
        .present = if (effects.any() or has_textures) 1 else 0,
    };
    if (effects.specular) copy(from, &layers, .{ "specular", "specular_color" });
    if (effects.clearcoat)
        copy(from, &layers, .{ "clearcoat", "clearcoat_roughness", "clearcoat_normal_scale" });
    if (effects.sheen) copy(from, &layers, .{ "sheen_color", "sheen_roughness" });
    if (effects.dispersion) copy(from, &layers, .{"dispersion"});
    if (effects.iridescence) copy(from, &layers, .{
        "iridescence",
        "iridescence_ior",
        "iridescence_thickness_min_nm",
        "iridescence_thickness_max_nm",
    });
    if (effects.anisotropy) {
        layers.anisotropy = from.anisotropy;
        const angle_rad = from.anisotropy_rotation_rad;
        layers.anisotropy_rotation = .{
            math.flushDenormal(@floatCast(math.elementary.cos(angle_rad))),
            math.flushDenormal(@floatCast(math.elementary.sin(angle_rad))),
        };
    }
    if (effects.diffuse_transmission)
        copy(from, &layers, .{ "diffuse_transmission", "diffuse_transmission_color" });
    if (effects.scattering) {
        layers.sigma_s = volumeOf(from).sigma_s;
        layers.scatter_anisotropy = from.scatter_anisotropy;
    }
    return layers;
}

fn copy(from: *const scene.Material, to: *world.Layers, comptime names: anytype) void {
    inline for (names) |name| @field(to, name) = @field(from, name);
}

/// Coefficients of what fills a volume, per metre.
pub const Volume = struct {
    sigma_a: Vec3 = .{ 0, 0, 0 },
    sigma_s: Vec3 = .{ 0, 0, 0 },
};

/// What fills the volume that surfaces of a material bound. Attenuation is sigma_a + sigma_s =
/// -ln(color) / distance a channel (KHR_materials_volume, "Attenuation").
pub fn volumeOf(from: *const scene.Material) Volume {
    var volume: Volume = .{};
    if (!from.volume) return volume;
    assert(from.attenuation_distance > 0);
    if (from.attenuation_distance == std.math.inf(f32)) return volume;
    const scatters = Effects.of(from).scattering;
    for (from.attenuation_color, 0..) |color, channel| {
        const floor: f64 = if (color > attenuation_color_min) color else attenuation_color_min;
        const share: f64 = if (floor < 1) floor else 1;
        const sigma_t = -math.elementary.log(share) / from.attenuation_distance;
        const albedo = if (scatters) singleScatterAlbedo(from.multiscatter_color[channel]) else 0;
        volume.sigma_a[channel] = finite(sigma_t * (1 - albedo));
        volume.sigma_s[channel] = finite(sigma_t * albedo);
    }
    return volume;
}

fn finite(exact: f64) f32 {
    const largest: f64 = std.math.floatMax(f32);
    return math.flushDenormal(@floatCast(if (exact < largest) exact else largest));
}

/// KHR_materials_volume_scatter, "Multi-Scatter Albedo".
fn singleScatterAlbedo(multi: f64) f64 {
    const root = @sqrt(9.59217 + 41.6808 * multi + 17.7126 * multi * multi);
    const difference = 4.09712 + 4.20863 * multi - root;
    const albedo = 1 - difference * difference;
    if (!(albedo > 0)) return 0;
    return if (albedo < 1) albedo else 1;
}

const testing = std.testing;

test "layers without effect are none" {
    const none: world.Layers = .{};
    const wet: scene.Material = .{ .metallic = 0, .transmission = 1, .volume = true };
    var cases: [12]scene.Material = @splat(wet);
    cases[0] = .{};
    cases[1].clearcoat_roughness = 0.5;
    cases[2].sheen_roughness = 0.5;
    cases[3].iridescence = 1;
    cases[3].iridescence_ior = 1;
    cases[4].iridescence = 1;
    cases[4].iridescence_thickness_max_nm = 0;
    cases[5].anisotropy_rotation_rad = 1;
    cases[6].diffuse_transmission_color = .{ 1, 0, 0 };
    cases[7].dispersion = 0.3;
    cases[7].volume = false;
    cases[8].multiscatter_color = .{ 1, 1, 1 };
    cases[8].attenuation_distance = 2;
    cases[9] = .{ .specular = 0.5, .diffuse_transmission = 1 }; // All metal.
    cases[10].multiscatter_color = .{ 0.5, 0.5, 0.5 };
    cases[10].attenuation_distance = 2;
    cases[10].attenuation_color = .{ 0.5, 0.5, 0.5 };
    cases[10].transmission = 0;
    cases[11] = .{ .clearcoat = 1, .sheen_color = .{ 1, 1, 1 }, .anisotropy = 1, .unlit = true };
    for (&cases) |*from| try testing.expectEqual(none, convert(from, false));
    var textured = none;
    textured.present = 1;
    try testing.expectEqual(textured, convert(&.{}, true));
}

test "each layer brings its own numbers" {
    const texture: scene.TextureView = .{ .texture = 0 };
    const Case = struct { scene.Material, world.Layers };
    const glass: scene.Material = .{
        .metallic = 0,
        .transmission = 1,
        .volume = true,
        .dispersion = 0.3,
    };
    for ([_]Case{
        .{
            .{ .metallic = 0, .specular = 0.5, .specular_color = .{ 2, 1, 0 } },
            .{ .specular = 0.5, .specular_color = .{ 2, 1, 0 } },
        },
        .{ .{ .metallic = 0.5, .specular_texture = texture }, .{} },
        .{ .{ .metallic_roughness_texture = texture, .specular = 0 }, .{ .specular = 0 } },
        .{
            .{ .clearcoat = 0.5, .clearcoat_roughness = 0.25, .clearcoat_normal_scale = 2 },
            .{ .clearcoat = 0.5, .clearcoat_roughness = 0.25, .clearcoat_normal_scale = 2 },
        },
        .{
            .{ .sheen_color = .{ 0, 0, 0.5 }, .sheen_roughness = 0.75 },
            .{ .sheen_color = .{ 0, 0, 0.5 }, .sheen_roughness = 0.75 },
        },
        .{ glass, .{ .dispersion = 0.3 } },
        .{
            .{
                .iridescence = 0.5,
                .iridescence_ior = 2,
                .iridescence_thickness_min_nm = 10,
                .iridescence_thickness_max_nm = 0,
                .iridescence_thickness_texture = texture,
            },
            .{
                .iridescence = 0.5,
                .iridescence_ior = 2,
                .iridescence_thickness_min_nm = 10,
                .iridescence_thickness_max_nm = 0,
            },
        },
        .{
            .{
                .metallic = 0,
                .diffuse_transmission = 1,
                .diffuse_transmission_color = .{ 0, 1, 0 },
            },
            .{ .diffuse_transmission = 1, .diffuse_transmission_color = .{ 0, 1, 0 } },
        },
    }) |case| {
        var expected = case[1];
        expected.present = 1;
        try testing.expectEqual(expected, convert(&case[0], false));
    }
    const turned = convert(&.{ .anisotropy = 0.5, .anisotropy_rotation_rad = 2.5 }, false);
    try testing.expectEqual(0.5, turned.anisotropy);
    try testing.expectApproxEqAbs(@as(f32, -0.80114362), turned.anisotropy_rotation[0], 1e-7);
    try testing.expectApproxEqAbs(@as(f32, 0.59847214), turned.anisotropy_rotation[1], 1e-7);
}

test "white light turns to the attenuation colour after the attenuation distance" {
    const from: scene.Material = .{
        .volume = true,
        .transmission = 1,
        .attenuation_color = .{ 1, 0.5, 0 },
        .attenuation_distance = 2,
    };
    const sigma_a = volumeOf(&from).sigma_a;
    try testing.expectEqual(0, sigma_a[0]);
    try testing.expectApproxEqRel(@as(f32, 0.34657359), sigma_a[1], 1e-6);
    try testing.expectApproxEqRel(@as(f32, 4.6051702), sigma_a[2], 1e-6);
    var thin = from;
    thin.volume = false;
    try testing.expectEqual(Volume{}, volumeOf(&thin));
    var clear = from;
    clear.attenuation_distance = std.math.inf(f32);
    try testing.expectEqual(Volume{}, volumeOf(&clear));
    var dense = from;
    dense.attenuation_distance = std.math.floatMin(f32);
    try testing.expect(math.vec3.isFinite(volumeOf(&dense).sigma_a));
}

test "what is scattered and what is absorbed are what is attenuated" {
    const from: scene.Material = .{
        .metallic = 0,
        .volume = true,
        .diffuse_transmission = 1,
        .attenuation_color = @splat(0.5),
        .attenuation_distance = 2,
        .multiscatter_color = .{ 0, 0.5, 1 },
        .scatter_anisotropy = -0.5,
    };
    const volume = volumeOf(&from);
    const layers = convert(&from, false);
    try testing.expectEqual(1, layers.present);
    try testing.expectEqual(volume.sigma_s, layers.sigma_s);
    try testing.expectEqual(-0.5, layers.scatter_anisotropy);
    const sigma_t: f32 = 0.34657359;
    for (volume.sigma_a, volume.sigma_s) |sigma_a, sigma_s| {
        try testing.expectApproxEqRel(sigma_t, sigma_a + sigma_s, 1e-6);
    }
    // 1 - (6.201435 - sqrt(34.860720))^2.
    for ([3]f32{ 0, 0.9117089, 1 }, volume.sigma_s) |albedo, sigma_s| {
        try testing.expectApproxEqAbs(albedo * sigma_t, sigma_s, 1e-5);
    }
    // The fit is that of the albedo of an endless medium: it grows all the way.
    var before: f64 = -1;
    for (0..101) |step| {
        const albedo = singleScatterAlbedo(@as(f64, @floatFromInt(step)) / 100);
        try testing.expect(albedo > before and albedo <= 1);
        before = albedo;
    }
}
