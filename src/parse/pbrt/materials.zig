//! PBRT's materials as glTF's metallic-roughness ones with their extensions.
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

/// What reflects nothing.
pub const black: scene.Material = matte(.{ 0, 0, 0 });

/// What is not seen; the emission is to be set.
pub const hidden_lamp: scene.Material = .{
    .base_color = .{ 0, 0, 0, 0 },
    .alpha_mode = .blend,
    .metallic = 0,
    .ior = 1,
    .is_hidden_lamp = true,
};

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
    hair,
};

/// The material `name` with its parameters.
pub fn convert(colors: *Colors, name: []const u8, parameters: *const Parameters) Error!Material {
    if (name.len == 0 or std.mem.eql(u8, name, "none") or std.mem.eql(u8, name, "interface")) {
        parameters.pass();
        return .{ .surface = matte_default, .is_boundary = true };
    }
    const has_bumps = parameters.find("bumpmap") != null or
        parameters.find("displacement") != null;
    if (has_bumps) try colors.input.warnHere(
        "bump map",
        "Material {f}: bumps are not supported, its surfaces are smooth",
        .{quote(name)},
    );
    var reader: Reader = .{ .colors = colors, .parameters = parameters };
    const kind = std.meta.stringToEnum(Kind, name) orelse {
        parameters.pass();
        return .{ .surface = try reader.unknown(name) };
    };
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
            .plastic => reader.plastic(try reader.baseColor("Kd", 0.25)),
            .substrate => reader.substrate(),
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
            .hair => reader.hair(),
        };
    }

    /// Matte, as in version 3, of whatever colour there is.
    fn unknown(reader: *Reader, name: []const u8) Error!scene.Material {
        const input = reader.colors.input;
        const measured: std.StaticStringMap(void) = .initComptime(.{ .{"measured"}, .{"fourier"} });
        if (measured.has(name)) {
            try input.warnHere(
                name,
                "Material {f} is not supported: grey matte stands for it",
                .{quote(name)},
            );
            return matte_default;
        }
        try input.forgive(
            input.directive,
            name,
            "Material {f} is not one of PBRT's: matte stands for it",
            .{quote(name)},
        );
        const color_name = for ([_][]const u8{ "Kd", "reflectance", "color" }) |key| {
            if (reader.has(key)) break key;
        } else return matte_default;
        var surface = bounded(matte(try reader.baseColor(color_name, 0.5)));
        surface.base_color_texture = reader.base_texture;
        return surface;
    }

    fn rgb(reader: *Reader, name: []const u8, default: f32) Error!Vec3 {
        return reader.spectrum(name, @splat(default));
    }

    fn spectrum(reader: *Reader, name: []const u8, default: Vec3) Error!Vec3 {
        return reader.colors.rgb(reader.parameters, name, default);
    }

    /// The base colour: the factor of a picture, which becomes the base colour's texture.
    fn baseColor(reader: *Reader, name: []const u8, default: f32) Error!Vec3 {
        return reader.pictured(name, default, &reader.base_texture);
    }

    /// A colour: the factor of a picture, which becomes `view`.
    fn pictured(
        reader: *Reader,
        name: []const u8,
        default: f32,
        view: *?scene.TextureView,
    ) Error!Vec3 {
        const texture = try reader.colors.texture(reader.parameters, name) orelse
            return @splat(default);
        const picture = if (texture.picture) |*picture| picture else return texture.mean;
        const shown = try reader.colors.textures.show(picture) orelse return texture.mean;
        view.* = shown.view;
        return shown.factor;
    }

    /// A number from 0 to 1, the same way; of a picture the channel that the slot has.
    fn picturedNumber(
        reader: *Reader,
        name: []const u8,
        default: f32,
        view: *?scene.TextureView,
    ) Error!f32 {
        const value = try reader.pictured(name, default, view);
        return unit((value[0] + value[1] + value[2]) / 3);
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

    /// Roughness under any of its names, in `result`; `prefix` is of names in version 4.
    ///
    /// PBRT's is an inverse exponent of Blinn's, 1 / e, unless "remaproughness" says that it is
    /// alpha itself; alpha is sqrt(2 / (e + 2)) (Walter et al. 2007, section 5.1).
    fn roughen(
        reader: *Reader,
        result: *scene.Material,
        comptime prefix: []const u8,
        default: f32,
    ) Error!void {
        const value = try reader.float(prefix ++ "roughness", default);
        var u = value;
        var v = value;
        if (reader.has(prefix ++ "uroughness") or reader.has(prefix ++ "vroughness")) {
            u = try reader.float(prefix ++ "uroughness", value);
            v = try reader.float(prefix ++ "vroughness", if (prefix.len == 0) u else value);
        }
        setAlpha(result, reader.alphaOf(u), reader.alphaOf(v));
    }

    fn alphaOf(reader: *Reader, value: f32) f32 {
        const r = unit(value);
        if (!(r > 0)) return 0;
        return if (reader.parameters.boolean("remaproughness", true)) @sqrt(2 / (1 / r + 2)) else r;
    }

    /// The weight and colour of the dielectric's reflection, at normal incidence and grazing ones.
    fn tintSpecular(
        reader: *Reader,
        result: *scene.Material,
        name: []const u8,
        default: f32,
    ) Error!void {
        const color = try reader.pictured(name, default, &result.specular_color_texture);
        setSpecular(result, color);
    }

    /// A diffuse body under glass that reflects `Ks` of what glass does.
    fn plastic(reader: *Reader, base: Vec3) Error!scene.Material {
        var result = matte(base);
        result.ior = 1.5;
        try reader.tintSpecular(&result, "Ks", 0.25);
        try reader.roughen(&result, "", 0.1);
        return result;
    }

    /// A diffuse body below a layer that reflects `Ks` at normal incidence and all where it grazes.
    fn substrate(reader: *Reader) Error!scene.Material {
        var result = matte(try reader.baseColor("Kd", 0.5));
        try reader.tintSpecular(&result, "Ks", 0.5);
        result.ior = iorOf(result.specular);
        result.specular = 1;
        try reader.roughen(&result, "", 0.1);
        return result;
    }

    /// A diffuse body under a coat of its own refraction.
    fn polished(reader: *Reader, base: Vec3, ior_default: f32) Error!scene.Material {
        var result = matte(base);
        result.ior = try reader.index(ior_default);
        try reader.roughen(&result, "", 0);
        return result;
    }

    fn conductor(reader: *Reader, kind: Kind) Error!scene.Material {
        const is_coated = kind == .coatedconductor;
        const prefixed = is_coated and reader.has("conductor.eta");
        const eta_name = if (prefixed) "conductor.eta" else "eta";
        const k_name = if (is_coated and reader.has("conductor.k")) "conductor.k" else "k";
        var result = if (reader.has("reflectance"))
            metal(try reader.baseColor("reflectance", 1), 0)
        else metal: {
            // Copper, as in PBRT.
            const eta = try reader.spectrum(eta_name, spectra.fromName("metal-Cu-eta").?);
            const k = try reader.spectrum(k_name, spectra.fromName("metal-Cu-k").?);
            break :metal metal(reflectanceOf(eta, k), 0);
        };
        if (!is_coated) {
            try reader.roughen(&result, "", if (kind == .metal) 0.01 else 0);
            return result;
        }
        try reader.roughen(&result, "conductor.", 0);
        var coat: scene.Material = .{};
        try reader.roughen(&coat, "interface.", 0);
        const ior = try reader.float("interface.eta", 1.5);
        setCoat(&result, normalReflectance(ior), coat.roughness);
        return result;
    }

    fn glass(reader: *Reader, kind: Kind) Error!scene.Material {
        var result: scene.Material = .{
            .base_color = opaqueColor(try reader.baseColor("Kt", 1)),
            .metallic = 0,
            .transmission = 1,
            .volume = kind != .thindielectric,
            .ior = try reader.index(1.5),
            .double_sided = true,
        };
        try reader.tintSpecular(&result, "Kr", 1);
        try reader.roughen(&result, "", 0);
        return result;
    }

    fn uber(reader: *Reader) Error!scene.Material {
        const mirrored = try reader.bright("Kr", 0);
        const passing = try reader.rgb("Kt", 0);
        const passing_share = spectra.luminance(passing);
        // What passes is of another colour than a picture of what is reflected.
        const diffuse = if (passing_share > 0)
            try reader.rgb("Kd", 0.25)
        else
            try reader.baseColor("Kd", 0.25);
        var result = try reader.plastic(diffuse);
        result.ior = try reader.index(1.5);
        if (passing_share > 0) {
            const diffuse_share = spectra.luminance(diffuse);
            result.transmission = passing_share / (passing_share + diffuse_share);
            for (result.base_color[0..3], passing) |*to, part| to.* += part;
            result.volume = true;
            result.roughness = 0;
            result.anisotropy = 0;
            result.specular = @max(result.specular, unit(mirrored));
        } else if (mirrored > 0) {
            setCoat(&result, mirrored * normalReflectance(result.ior), 0);
        }
        const opacity = try reader.bright("opacity", 1);
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
        var result = try reader.plastic(diffuse);
        setDiffuse(&result, math.vec3.mul(diffuse, reflect), math.vec3.mul(diffuse, transmit));
        result.diffuse_transmission_color_texture = reader.base_texture;
        return result;
    }

    fn diffuseTransmission(reader: *Reader) Error!scene.Material {
        const reflect = try reader.baseColor("reflectance", 0.25);
        var result = matte(.{ 0, 0, 0 });
        const view = &result.diffuse_transmission_color_texture;
        const transmit = try reader.pictured("transmittance", 0.25, view);
        const scale = try reader.float("scale", 1);
        setDiffuse(&result, math.vec3.scale(reflect, scale), math.vec3.scale(transmit, scale));
        return result;
    }

    /// The fibres' absorption as the colour of many (Chiang et al. 2016, "A Practical and
    /// Controllable Hair and Fur Model", equation 9), on a rough surface.
    fn hair(reader: *Reader) Error!scene.Material {
        const name = if (reader.has("color")) "color" else "reflectance";
        if (reader.has(name)) return reader.strand(try reader.baseColor(name, 0.5));
        var absorbed = try reader.rgb("sigma_a", 0);
        if (!reader.has("sigma_a")) {
            const has_some = reader.has("eumelanin") or reader.has("pheomelanin");
            const dark = try reader.float("eumelanin", if (has_some) 0 else 1.3);
            const red = try reader.float("pheomelanin", 0);
            for (&absorbed, [3]f32{ 0.419, 0.697, 1.37 }, [3]f32{ 0.187, 0.4, 1.05 }) |*to, a, b|
                to.* = dark * a + red * b;
        }
        const b = try reader.float("beta_n", 0.3);
        const width = 5.969 + b * (-0.215 + b * (2.532 + b * (-10.73 + b * (5.574 + b * 0.245))));
        var color: Vec3 = undefined;
        for (&color, absorbed) |*to, a| to.* = @floatCast(exp(-width * @sqrt(@max(a, 0))));
        return reader.strand(color);
    }

    fn strand(reader: *Reader, color: Vec3) Error!scene.Material {
        var result = matte(color);
        result.ior = try reader.index(1.55);
        result.roughness = @sqrt(unit(try reader.float("beta_m", 0.3)));
        return result;
    }

    /// The diffuse reflectance that light makes of much scattering, the dipole's of Jensen et al.,
    /// "A practical model for subsurface light transport" (2001), section 2.4.
    fn subsurface(reader: *Reader) Error!scene.Material {
        for ([_][]const u8{ "scale", "g", "mfp" }) |key| _ = reader.has(key); // Distances.
        if (reader.has("Kd") or reader.has("reflectance")) return reader.polished(
            try reader.baseColor(if (reader.has("Kd")) "Kd" else "reflectance", 0.5),
            1.33,
        );
        const scattered_name = if (reader.has("sigma_prime_s")) "sigma_prime_s" else "sigma_s";
        const name = reader.parameters.string("name") orelse "Wholemilk";
        const known = spectra.mediumNamed(name) orelse default: {
            try reader.colors.input.warnHere(
                "medium",
                "Material 'subsurface': medium {f} is not known, milk stands for it",
                .{quote(name)},
            );
            break :default spectra.mediumNamed("Wholemilk").?;
        };
        const absorbed = try reader.spectrum("sigma_a", known.absorbed);
        const scattered = try reader.spectrum(scattered_name, known.scattered);
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

    /// Burley 2012 and 2015: his coat has a fourth of its weight, and sheen his colours.
    fn disney(reader: *Reader) Error!scene.Material {
        const base = try reader.baseColor("color", 0.5);
        var result = matte(base);
        result.metallic = try reader.float("metallic", 0);
        // Green is the roughness; blue would be multiplied with what is metal.
        const view = if (result.metallic == 0) &result.metallic_roughness_texture else null;
        const roughness = if (view) |texture|
            try reader.picturedNumber("roughness", 0.5, texture)
        else
            unit(try reader.float("roughness", 0.5));
        const aspect = @sqrt(1 - 0.9 * unit(try reader.float("anisotropic", 0)));
        const alpha = roughness * roughness;
        if (aspect < 1)
            setAlpha(&result, @min(alpha / aspect, 1), alpha * aspect)
        else
            result.roughness = roughness;
        result.ior = try reader.index(1.5);
        const tint = tintOf(base);
        const speculartint = unit(try reader.float("speculartint", 0));
        result.specular_color = math.vec3.mix(.{ 1, 1, 1 }, tint, speculartint);
        const sheen = try reader.float("sheen", 0);
        const sheentint = unit(try reader.float("sheentint", 0.5));
        result.sheen_color =
            math.vec3.scale(math.vec3.mix(.{ 1, 1, 1 }, tint, sheentint), unit(sheen));
        result.sheen_roughness = 0.5;
        const coat = try reader.picturedNumber("clearcoat", 0, &result.clearcoat_texture);
        result.clearcoat = 0.25 * coat;
        const gloss = unit(try reader.float("clearcoatgloss", 1));
        result.clearcoat_roughness = @sqrt(lerp(0.1, 0.001, gloss));
        const is_thin = reader.parameters.boolean("thin", false);
        result.transmission =
            try reader.picturedNumber("spectrans", 0, &result.transmission_texture);
        result.volume = result.transmission > 0 and !is_thin;
        if (is_thin) {
            result.diffuse_transmission = 0.5 * unit(0.5 * try reader.float("difftrans", 1));
            result.diffuse_transmission_color = base;
        }
        return result;
    }
};

/// Alpha along the surface's u and v: the wider lobe is along the tangent, which turns.
fn setAlpha(material: *scene.Material, u: f32, v: f32) void {
    const least = @min(u, v);
    material.roughness = @sqrt(least);
    if (u == v) return;
    // KHR_materials_anisotropy: alpha along the tangent is mix(alpha, 1, strength^2).
    material.anisotropy = @sqrt((@max(u, v) - least) / (1 - least));
    material.anisotropy_rotation_rad = if (u > v) 0 else std.math.pi / 2.0;
}

/// The largest channel is the weight.
fn setSpecular(material: *scene.Material, color: Vec3) void {
    const largest = math.vec3.maxComponent(color);
    material.specular = unit(largest);
    if (largest > 0) material.specular_color = math.vec3.scale(color, 1 / largest);
}

/// A coat that reflects so much at normal incidence, as far as one of glass does (0.04).
fn setCoat(material: *scene.Material, reflectance: f32, roughness: f32) void {
    material.clearcoat = unit(reflectance / 0.04);
    material.clearcoat_roughness = roughness;
}

/// What is diffuse is reflected and transmitted by these shares.
fn setDiffuse(material: *scene.Material, reflected: Vec3, transmitted: Vec3) void {
    const sent_back = @max(math.vec3.maxComponent(reflected), 0);
    const sent_on = @max(math.vec3.maxComponent(transmitted), 0);
    const all = sent_back + sent_on;
    if (!(all > 0)) return;
    material.diffuse_transmission = sent_on / all;
    if (sent_back > 0)
        material.base_color = opaqueColor(math.vec3.scale(reflected, all / sent_back));
    if (sent_on > 0)
        material.diffuse_transmission_color = math.vec3.scale(transmitted, all / sent_on);
}

/// A colour of luminance 1; white for black.
fn tintOf(color: Vec3) Vec3 {
    const luminance = spectra.luminance(color);
    return if (luminance > 0) math.vec3.scale(color, 1 / luminance) else .{ 1, 1, 1 };
}

/// Fresnel's reflectance of a metal at normal incidence.
fn reflectanceOf(eta: Vec3, k: Vec3) Vec3 {
    var color: Vec3 = undefined;
    for (&color, eta, k) |*to, n, absorbed| {
        const squared = absorbed * absorbed;
        const below = (n + 1) * (n + 1) + squared;
        const above = (n - 1) * (n - 1) + squared;
        to.* = if (below > 0 and below < std.math.floatMax(f32)) above / below else 1;
    }
    return color;
}

/// That of a dielectric.
fn normalReflectance(ior: f32) f32 {
    const root = (ior - 1) / (ior + 1);
    return root * root;
}

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
    inline for (.{
        "metallic",   "roughness",           "transmission",    "specular",
        "clearcoat",  "clearcoat_roughness", "sheen_roughness", "diffuse_transmission",
        "anisotropy",
    }) |name| @field(result, name) = unit(@field(result, name));
    inline for (.{ "sheen_color", "diffuse_transmission_color" }) |name| {
        for (&@field(result, name)) |*channel| channel.* = unit(channel.*);
    }
    for (&result.specular_color) |*channel| channel.* = @min(@max(channel.*, 0), 1e3);
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
    inline for (comptime std.meta.fieldNames(scene.Material)) |name| {
        const a = @field(first, name);
        const b = @field(second, name);
        switch (@TypeOf(a)) {
            f32 => if (std.math.isFinite(a) and std.math.isFinite(b)) {
                @field(result, name) = lerp(a, b, share);
            },
            Vec3 => @field(result, name) = math.vec3.mix(a, b, share),
            else => {},
        }
    }
    // A picture stays what it is.
    if (result.base_color_texture == null) {
        for (&result.base_color, first.base_color, second.base_color) |*to, a, b| {
            to.* = lerp(a, b, share);
        }
    }
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

test "roughness that differs is along the tangent, or across it" {
    var result: scene.Material = .{};
    setAlpha(&result, 0.5, 0.1);
    try std.testing.expectApproxEqRel(@sqrt(0.1), result.roughness, 1e-6);
    // KHR_materials_anisotropy: mix(alpha, 1, strength^2) along the tangent.
    const squared = result.anisotropy * result.anisotropy;
    try std.testing.expectApproxEqRel(0.5, lerp(0.1, 1, squared), 1e-6);
    try std.testing.expectEqual(0, result.anisotropy_rotation_rad);
    setAlpha(&result, 0.1, 0.5);
    try std.testing.expectApproxEqRel(std.math.pi / 2.0, result.anisotropy_rotation_rad, 1e-6);
}

test "metals reflect as measured" {
    // Johnson and Christy 1972, in linear Rec. 709 to two digits.
    const Case = struct { []const u8, Vec3 };
    for ([_]Case{
        .{ "Ag", .{ 0.97, 0.96, 0.90 } },
        .{ "Au", .{ 0.97, 0.81, 0.33 } },
        .{ "Cu", .{ 0.95, 0.62, 0.51 } },
        .{ "Al", .{ 0.93, 0.92, 0.92 } },
    }) |case| {
        var buffer: [32]u8 = undefined;
        const eta = spectra.fromName(try std.fmt.bufPrint(&buffer, "metal-{s}-eta", .{case[0]})).?;
        const k = spectra.fromName(try std.fmt.bufPrint(&buffer, "metal-{s}-k", .{case[0]})).?;
        for (case[1], reflectanceOf(eta, k)) |wanted, found| {
            try std.testing.expectApproxEqAbs(wanted, found, 0.04);
        }
    }
}

test "diffuse light is shared between the sides" {
    var result: scene.Material = .{};
    setDiffuse(&result, .{ 0.3, 0.15, 0 }, .{ 0.1, 0.1, 0.2 });
    try std.testing.expectApproxEqRel(0.4, result.diffuse_transmission, 1e-6);
    for ([3]f32{ 0.3, 0.15, 0 }, [3]f32{ 0.1, 0.1, 0.2 }, 0..) |r, t, channel| {
        const on = result.diffuse_transmission;
        const back = (1 - on) * result.base_color[channel];
        try std.testing.expectApproxEqAbs(r, back, 1e-6);
        const through = on * result.diffuse_transmission_color[channel];
        try std.testing.expectApproxEqAbs(t, through, 1e-6);
    }
}

test "mixtures lie between" {
    const half = mix(matte(.{ 0, 0, 0 }), metal(.{ 1, 1, 1 }, 0), 0.5);
    try std.testing.expectEqual([4]f32{ 0.5, 0.5, 0.5, 1 }, half.base_color);
    try std.testing.expectEqual(0.5, half.metallic);
    var coated: scene.Material = .{};
    setCoat(&coated, 0.03, 0.5);
    const third = mix(matte(.{ 0, 0, 0 }), coated, 0.25);
    try std.testing.expectApproxEqRel(0.1875, third.clearcoat, 1e-6);
    try std.testing.expectEqual(std.math.inf(f32), third.attenuation_distance);
    const wild = bounded(.{ .base_color = .{ 2, -1, std.math.nan(f32), 1 }, .ior = 0.2 });
    try std.testing.expectEqual([4]f32{ 1, 0, 0, 1 }, wild.base_color);
    try std.testing.expectEqual(1, wild.ior);
}
