//! PBRT's materials as metallic-roughness ones.
//!
//! In: the name of a material and its parameters. Out: the nearest of our materials; docs/pbrt.md
//! has the table. Everything is double-sided, as in PBRT. What we have no counterpart of becomes a
//! grey matte one with a warning, once a kind.

const std = @import("std");
const math = @import("../../math.zig");
const quote = @import("../../diagnostic.zig").quote;
const scene = @import("../../scene.zig");
const spectra = @import("spectra.zig");
const Colors = @import("colors.zig");
const Input = @import("input.zig");
const Parameters = @import("parameters.zig");
const Error = Input.Error;
const Vec3 = math.Vec3;
const exp = math.elementary.exp;

/// Our material, or none where the surface only bounds a medium.
pub const Material = struct {
    surface: scene.Material,
    is_boundary: bool = false,
};

/// Diffuse reflectance where nothing is said.
pub const matte_default: scene.Material = matte(@splat(0.5));

const Kind = enum {
    matte,
    diffuse,
    plastic,
    coateddiffuse,
    mirror,
    glass,
    dielectric,
    thindielectric,
    metal,
    conductor,
    coatedconductor,
    shinymetal,
    uber,
    substrate,
    translucent,
    diffusetransmission,
    kdsubsurface,
    subsurface,
    disney,
};

/// The material `name` with its parameters.
pub fn convert(colors: *Colors, name: []const u8, parameters: *const Parameters) Error!Material {
    if (name.len == 0 or std.mem.eql(u8, name, "none") or std.mem.eql(u8, name, "interface"))
        return .{ .surface = matte_default, .is_boundary = true };
    const has_bumps = parameters.find("bumpmap") != null or
        parameters.find("displacement") != null;
    if (has_bumps) try colors.input.warnHere(
        "bump map",
        "Material {f}: bumps are not supported, its surfaces are smooth",
        .{quote(name)},
    );
    const kind = std.meta.stringToEnum(Kind, name) orelse {
        try colors.input.warnHere(
            name,
            "Material {f} is not supported: grey matte stands for it",
            .{quote(name)},
        );
        return .{ .surface = matte_default };
    };
    var reader: Reader = .{ .colors = colors, .parameters = parameters };
    var surface = bounded(try reader.read(kind));
    surface.base_color_texture = reader.base_texture;
    surface.normal_texture = try reader.normalTexture();
    return .{ .surface = surface };
}

/// Reads the parameters of each kind.
const Reader = struct {
    colors: *Colors,
    parameters: *const Parameters,
    /// Set by `baseColor`.
    base_texture: ?scene.TextureView = null,

    fn read(reader: *Reader, kind: Kind) Error!scene.Material {
        return switch (kind) {
            .matte => matte(try reader.baseColor("Kd", 0.5)),
            .diffuse => matte(try reader.baseColor("reflectance", 0.5)),
            .plastic => reader.coated(
                try reader.baseColor("Kd", 0.25),
                0.04 * try reader.bright("Ks", 0.25),
            ),
            .substrate => reader.coated(
                try reader.baseColor("Kd", 0.5),
                try reader.bright("Ks", 0.5),
            ),
            .coateddiffuse => reader.polished(try reader.baseColor("reflectance", 0.5), 1.5),
            .mirror => metal(try reader.baseColor("Kr", 0.9), 0),
            .shinymetal => metal(try reader.baseColor("Kr", 1), 0),
            .metal, .conductor, .coatedconductor => reader.conductor(kind),
            .glass, .dielectric, .thindielectric => reader.glass(kind),
            .uber => reader.uber(),
            .translucent => reader.translucent(),
            .diffusetransmission => reader.diffuseTransmission(),
            .kdsubsurface => reader.polished(try reader.baseColor("Kd", 0.5), 1.3),
            .subsurface => reader.subsurface(),
            .disney => reader.disney(),
        };
    }

    fn rgb(reader: *Reader, name: []const u8, default: f32) Error!Vec3 {
        return reader.spectrum(name, @splat(default));
    }

    fn spectrum(reader: *Reader, name: []const u8, default: Vec3) Error!Vec3 {
        return reader.colors.rgb(reader.parameters, name, default);
    }

    /// The base colour: the factor of a picture, which becomes the base colour's texture.
    fn baseColor(reader: *Reader, name: []const u8, default: f32) Error!Vec3 {
        const texture = try reader.colors.texture(reader.parameters, name) orelse
            return @splat(default);
        const picture = if (texture.picture) |*picture| picture else return texture.mean;
        const shown = try reader.colors.textures.show(picture) orelse return texture.mean;
        reader.base_texture = shown.view;
        return shown.factor;
    }

    fn normalTexture(reader: *Reader) Error!?scene.TextureView {
        const path = reader.parameters.string("normalmap") orelse return null;
        const shown = try reader.colors.textures.show(&.{ .path = path }) orelse return null;
        return shown.view;
    }

    fn float(reader: *Reader, name: []const u8, default: f32) Error!f32 {
        return reader.colors.float(reader.parameters, name, default);
    }

    fn bright(reader: *Reader, name: []const u8, default: f32) Error!f32 {
        return spectra.luminance(try reader.rgb(name, default));
    }

    fn has(reader: *Reader, name: []const u8) bool {
        return reader.parameters.find(name) != null;
    }

    /// Index of refraction under either name.
    fn index(reader: *Reader, default: f32) Error!f32 {
        return reader.float(if (reader.has("eta")) "eta" else "index", default);
    }

    /// Roughness under any of its names, as glTF counts it: the root of GGX's alpha.
    ///
    /// PBRT's is an inverse exponent of Blinn's, 1 / e, unless "remaproughness" says that it is
    /// alpha itself; alpha is sqrt(2 / (e + 2)) (Walter et al. 2007, section 5.1).
    fn rough(reader: *Reader, default: f32) Error!f32 {
        var value = try reader.float("roughness", default);
        if (reader.has("uroughness")) {
            const u = try reader.float("uroughness", default);
            value = 0.5 * (u + try reader.float("vroughness", u));
        }
        const r = std.math.clamp(value, 0, 1);
        if (!(r > 0)) return 0;
        const remapped = reader.parameters.boolean("remaproughness", true);
        const alpha = if (remapped) @sqrt(2 / (1 / r + 2)) else r;
        return @sqrt(alpha);
    }

    /// A diffuse body under a coat with that reflectance at normal incidence.
    fn coated(reader: *Reader, base: Vec3, reflectance: f32) Error!scene.Material {
        var result = matte(base);
        result.ior = iorOf(reflectance);
        result.roughness = try reader.rough(0.1);
        return result;
    }

    /// A diffuse body under a coat of its own refraction.
    fn polished(reader: *Reader, base: Vec3, ior_default: f32) Error!scene.Material {
        var result = matte(base);
        result.ior = try reader.index(ior_default);
        result.roughness = try reader.rough(0);
        return result;
    }

    fn conductor(reader: *Reader, kind: Kind) Error!scene.Material {
        const coated_prefix = kind == .coatedconductor and reader.has("conductor.eta");
        const eta_name = if (coated_prefix) "conductor.eta" else "eta";
        const k_name = if (coated_prefix) "conductor.k" else "k";
        const roughness = try reader.rough(if (kind == .metal) 0.01 else 0);
        if (reader.has("reflectance"))
            return metal(try reader.baseColor("reflectance", 1), roughness);
        // Copper, as in PBRT.
        const eta = try reader.spectrum(eta_name, spectra.fromName("metal-Cu-eta").?);
        const k = try reader.spectrum(k_name, spectra.fromName("metal-Cu-k").?);
        var color: Vec3 = undefined;
        for (&color, eta, k) |*to, n, absorbed| {
            const squared = absorbed * absorbed;
            const below = (n + 1) * (n + 1) + squared;
            const above = (n - 1) * (n - 1) + squared;
            to.* = if (below > 0 and below < std.math.floatMax(f32)) above / below else 1;
        }
        return metal(color, roughness);
    }

    fn glass(reader: *Reader, kind: Kind) Error!scene.Material {
        return .{
            .base_color = opaqueColor(try reader.baseColor("Kt", 1)),
            .metallic = 0,
            .roughness = try reader.rough(0),
            .transmission = 1,
            .volume = kind != .thindielectric,
            .ior = try reader.index(1.5),
            .double_sided = true,
        };
    }

    fn uber(reader: *Reader) Error!scene.Material {
        const mirrored = try reader.bright("Kr", 0);
        const passing = try reader.rgb("Kt", 0);
        // What passes is of another colour than a picture of what is reflected.
        const diffuse = if (spectra.luminance(passing) > 0)
            try reader.rgb("Kd", 0.25)
        else
            try reader.baseColor("Kd", 0.25);
        const opacity = try reader.bright("opacity", 1);
        var result = matte(diffuse);
        const ior = try reader.index(1.5);
        const root = (ior - 1) / (ior + 1);
        const shine = @max(try reader.bright("Ks", 0.25), mirrored);
        result.ior = iorOf(root * root * shine);
        result.roughness = if (mirrored > 0) 0 else try reader.rough(0.1);
        const passing_share = spectra.luminance(passing);
        if (passing_share > 0) {
            const diffuse_share = spectra.luminance(diffuse);
            result.transmission = passing_share / (passing_share + diffuse_share);
            for (result.base_color[0..3], passing) |*to, part| to.* += part;
            result.volume = true;
            result.ior = ior;
            result.roughness = 0;
        }
        if (opacity < 1) {
            result.alpha_mode = .blend;
            result.base_color[3] = opacity;
        }
        return result;
    }

    fn translucent(reader: *Reader) Error!scene.Material {
        const diffuse = try reader.baseColor("Kd", 0.25);
        const reflect = try reader.rgb("reflect", 0.5);
        const transmit = try reader.rgb("transmit", 0.5);
        var base: Vec3 = undefined;
        for (&base, diffuse, reflect, transmit) |*to, d, r, t| to.* = d * (r + t);
        return reader.coated(base, 0.04 * try reader.bright("Ks", 0.25));
    }

    fn diffuseTransmission(reader: *Reader) Error!scene.Material {
        const reflect = try reader.rgb("reflectance", 0.25);
        const transmit = try reader.rgb("transmittance", 0.25);
        var base: Vec3 = undefined;
        for (&base, reflect, transmit) |*to, r, t| to.* = r + t;
        return matte(base);
    }

    /// The diffuse reflectance that light makes of much scattering, the dipole's of Jensen et al.,
    /// "A practical model for subsurface light transport" (2001), section 2.4.
    fn subsurface(reader: *Reader) Error!scene.Material {
        if (reader.has("Kd") or reader.has("reflectance")) return reader.polished(
            try reader.baseColor(if (reader.has("Kd")) "Kd" else "reflectance", 0.5),
            1.33,
        );
        const scattered_name = if (reader.has("sigma_prime_s")) "sigma_prime_s" else "sigma_s";
        const absorbed = try reader.spectrum("sigma_a", .{ 0.0011, 0.0024, 0.014 });
        const scattered = try reader.spectrum(scattered_name, .{ 2.55, 3.21, 3.77 });
        const ior = @max(try reader.index(1.3), 1);
        const inside = -1.440 / (ior * ior) + 0.710 / ior + 0.668 + 0.0636 * ior;
        const boundary = (1 + inside) / (1 - inside);
        var base: Vec3 = undefined;
        for (&base, absorbed, scattered) |*to, a, s| {
            const albedo = if (a + s > 0) @max(s, 0) / (a + s) else 0;
            const root = @sqrt(3 * @max(1 - albedo, 0));
            const deep: f32 = @floatCast(exp(-4.0 / 3.0 * boundary * root) * exp(-root));
            const plain: f32 = @floatCast(exp(-root));
            to.* = albedo / 2 * (deep + plain);
        }
        return reader.polished(base, 1.3);
    }

    fn disney(reader: *Reader) Error!scene.Material {
        var result = matte(try reader.baseColor("color", 0.5));
        result.metallic = try reader.float("metallic", 0);
        result.roughness = try reader.float("roughness", 0.5);
        result.ior = try reader.index(1.5);
        result.transmission = try reader.float("spectrans", 0);
        result.volume = result.transmission > 0 and !reader.parameters.boolean("thin", false);
        return result;
    }
};

fn matte(color: Vec3) scene.Material {
    return .{
        .base_color = opaqueColor(color),
        .metallic = 0,
        .roughness = 1,
        .ior = 1,
        .double_sided = true,
    };
}

fn metal(color: Vec3, roughness: f32) scene.Material {
    return .{
        .base_color = opaqueColor(color),
        .metallic = 1,
        .roughness = roughness,
        .double_sided = true,
    };
}

fn opaqueColor(color: Vec3) [4]f32 {
    return .{ color[0], color[1], color[2], 1 };
}

/// Index of refraction of a dielectric with that reflectance at normal incidence.
fn iorOf(reflectance: f32) f32 {
    const root = @sqrt(std.math.clamp(reflectance, 0, 0.9));
    return (1 + root) / (1 - root);
}

/// Everything within the ranges that `scene.Material` promises.
fn bounded(material: scene.Material) scene.Material {
    var result = material;
    for (&result.base_color) |*channel| channel.* = unit(channel.*);
    result.metallic = unit(result.metallic);
    result.roughness = unit(result.roughness);
    result.transmission = unit(result.transmission);
    result.ior = if (result.ior >= 1) @min(result.ior, 100) else 1;
    return result;
}

fn unit(value: f32) f32 {
    // Not a number becomes 0 as well.
    return if (value > 0) @min(value, 1) else 0;
}

/// Lies between two materials; `amount` is the second one's share.
pub fn mix(first: scene.Material, second: scene.Material, amount: f32) scene.Material {
    const share = unit(amount);
    var result = if (share < 0.5) first else second;
    // A picture stays what it is.
    if (result.base_color_texture == null) {
        for (&result.base_color, first.base_color, second.base_color) |*to, a, b| {
            to.* = lerp(a, b, share);
        }
    }
    result.metallic = lerp(first.metallic, second.metallic, share);
    result.roughness = lerp(first.roughness, second.roughness, share);
    result.transmission = lerp(first.transmission, second.transmission, share);
    result.ior = lerp(first.ior, second.ior, share);
    result.volume = first.volume or second.volume;
    if (first.alpha_mode == .blend or second.alpha_mode == .blend) result.alpha_mode = .blend;
    return result;
}

fn lerp(a: f32, b: f32, share: f32) f32 {
    return (1 - share) * a + share * b;
}

test "reflectance and index of refraction" {
    try std.testing.expectApproxEqRel(1.5, iorOf(0.04), 1e-6);
    try std.testing.expectEqual(1, iorOf(0));
    try std.testing.expect(std.math.isFinite(iorOf(2)));
}

test "mixtures lie between" {
    const half = mix(matte(.{ 0, 0, 0 }), metal(.{ 1, 1, 1 }, 0), 0.5);
    try std.testing.expectEqual([4]f32{ 0.5, 0.5, 0.5, 1 }, half.base_color);
    try std.testing.expectEqual(0.5, half.metallic);
    const wild = bounded(.{ .base_color = .{ 2, -1, std.math.nan(f32), 1 }, .ior = 0.2 });
    try std.testing.expectEqual([4]f32{ 1, 0, 0, 1 }, wild.base_color);
    try std.testing.expectEqual(1, wild.ior);
}
