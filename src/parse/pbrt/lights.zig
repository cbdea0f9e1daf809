//! Light sources.
//!
//! In: the parameters of a LightSource. Out: point, spot and directional lights, the radiance of
//! the sky, or a map of it. Shapes that shine are surfaces that emit.

const std = @import("std");
const math = @import("../../math.zig");
const quote = @import("../../diagnostic.zig").quote;
const scene = @import("../../scene.zig");
const spectra = @import("spectra.zig");
const SceneBuilder = @import("scene_builder.zig");
const Colors = @import("colors.zig");
const Input = @import("input.zig");
const Parameters = @import("parameters.zig");
const Tessellator = @import("shapes/tessellator.zig");
const vec3d = math.vec3d;
const Transform = math.AffineD;
const Error = Input.Error;
const Vec3 = math.Vec3;
const Vector = math.Vec3d;

/// Radiance of a sky whose map is not read, where other lights shine; without any, the scene gets
/// the lights of scenes without lights.
pub const unknown_sky = 0.35;

/// Radiance beyond which a sky is no brighter.
const sky_max = 1e30;
const emission_max = 1e30;

/// Directive and place of a light that is being read.
pub const Source = struct {
    colors: *Colors,
    builder: *SceneBuilder,
    parameters: *const Parameters,
    place: *const Transform,

    fn color(source: *const Source, name: []const u8) Error!Vec3 {
        return source.colorBy(name, null, 1);
    }

    /// The same, or as much as makes `quantity` what the text says, if it does: of a light of this
    /// colour and luminance 1 it is `of_unit`.
    fn colorBy(
        source: *const Source,
        name: []const u8,
        quantity: ?[]const u8,
        of_unit: f64,
    ) Error!Vec3 {
        const largest = std.math.floatMax(f32);
        const emission: Emission = try .read(source.colors, source.parameters, name, largest);
        const asked = if (quantity) |key| source.parameters.float(key, 0) else 0;
        return emission.by(asked, of_unit);
    }

    fn noteOf(source: *const Source, kind: []const u8, quantity: []const u8) Error!void {
        if (source.parameters.find(quantity) == null) return;
        try source.colors.input.warnHere(quantity, "LightSource {f}: its {s} is not read", .{
            quote(kind), quantity,
        });
    }

    fn point(source: *const Source, name: []const u8, default: Vec3) Vector {
        const value = source.parameters.vector(name, default);
        return source.place.point(.{ value[0], value[1], value[2] });
    }

    fn note(source: *const Source, kind: []const u8, comptime rest: []const u8) Error!void {
        try source.colors.input.warnHere(kind, "LightSource {f}: " ++ rest, .{quote(kind)});
    }
};

/// What a light emits.
pub const Emission = struct {
    /// The colour times the one of "scale".
    color: Vec3,
    /// What makes the luminance of the colour 1: RGB tells its colour beside white, all else tells
    /// the emission itself.
    normalization: f64 = 1,
    is_normalized: bool,

    /// By the parameter `name`, white where it is absent; each component from 0 to `largest`.
    pub fn read(
        colors: *Colors,
        parameters: *const Parameters,
        name: []const u8,
        largest: f32,
    ) Error!Emission {
        const rgb = try colors.rgb(parameters, name, .{ 1, 1, 1 });
        const scale = try colors.rgb(parameters, "scale", .{ 1, 1, 1 });
        var result: Emission = .{ .color = undefined, .is_normalized = colors.is_version_4 };
        for (&result.color, rgb, scale) |*to, a, b| {
            const product = a * b;
            to.* = if (product > 0) @min(product, largest) else 0;
        }
        const parameter = parameters.find(name) orelse return result;
        if (parameter.type == .rgb) return result;
        // Only version 4 has black bodies without a scale of their own.
        if (parameter.type == .blackbody and parameter.count == 1) result.is_normalized = true;
        const luminance = spectra.luminance(rgb);
        if (luminance > 0) result.normalization = 1 / @as(f64, luminance);
        return result;
    }

    /// The colour as it is meant; or, where `asked` for more than 0, so bright that the light has
    /// that much of what a light of luminance 1 has `of_unit` of.
    pub fn by(emission: *const Emission, asked: f64, of_unit: f64) Vec3 {
        if (asked > 0 and of_unit > 0)
            return scaled(emission.color, emission.normalization * asked / of_unit);
        if (!emission.is_normalized or emission.normalization == 1) return emission.color;
        return scaled(emission.color, emission.normalization);
    }
};

/// A colour times a factor, finite.
pub fn scaled(color: Vec3, factor: f64) Vec3 {
    var result: Vec3 = undefined;
    for (&result, color) |*to, from| {
        to.* = math.flushDenormal(@floatCast(std.math.clamp(from * factor, 0, emission_max)));
    }
    return result;
}

/// `LightSource "name" ...`.
pub fn add(source: *const Source, name: []const u8) Error!void {
    const Kind = enum { point, spot, distant, goniometric, projection, infinite, exinfinite };
    const builder = source.builder;
    const kind = std.meta.stringToEnum(Kind, name) orelse {
        source.parameters.pass();
        return source.note(name, "is not supported and left out");
    };
    switch (kind) {
        .point, .goniometric => {
            if (kind == .goniometric) {
                try source.note(name, "shines evenly, its map is not read");
                try source.noteOf(name, "power");
            }
            const origin = source.point("from", .{ 0, 0, 0 });
            try builder.addLight(origin, .{ 0, 0, -1 }, .{
                .kind = .point,
                .node = undefined,
                .color = if (kind == .point)
                    try source.colorBy("I", "power", 4 * std.math.pi)
                else
                    try source.color("I"),
            });
        },
        .spot, .projection => try addSpot(source, name, kind == .projection),
        .distant => {
            const from = source.point("from", .{ 0, 0, 0 });
            const to = source.point("to", .{ 0, 0, 1 });
            const way = vec3d.sub(to, from);
            if (vec3d.normalize(way) == null)
                return source.colors.input.failHere("the light has no direction", .{});
            try builder.addLight(.{ 0, 0, 0 }, way, .{
                .kind = .directional,
                .node = undefined,
                .color = try source.colorBy("L", "illuminance", 1),
            });
        },
        .infinite, .exinfinite => try addInfinite(source, name),
    }
}

/// Light from all around: an even sky, or a map of it.
fn addInfinite(source: *const Source, name: []const u8) Error!void {
    const builder = source.builder;
    const parameters = source.parameters;
    const is_older = parameters.find("mapname") != null;
    const path = parameters.string(if (is_older) "mapname" else "filename") orelse {
        const radiance = try source.colorBy("L", "illuminance", std.math.pi);
        var sum = builder.sky orelse Vec3{ 0, 0, 0 };
        for (&sum, radiance) |*to, part| to.* = @min(to.* + part, sky_max);
        builder.sky = sum;
        return;
    };
    if (builder.scene.scene.environment != null)
        return source.note(name, "the first map is the only one");
    try source.noteOf(name, "illuminance");
    if (parameters.find("portal") != null)
        try source.note(name, "shines from all around, its portal is not read");
    const image = try source.colors.textures.imageOf(path) orelse {
        parameters.pass();
        try source.note(name, "without its map a grey sky stands for it");
        builder.has_unknown_sky = true;
        return;
    };
    const turn = rotationOf(source.place) orelse turn: {
        try source.note(name, "its transformation is no rotation, and not read");
        break :turn Transform.identity;
    };
    builder.scene.scene.environment = .{
        .image = image,
        .projection = if (is_older) .equirectangular else .octahedral,
        .is_seen = true,
        .scale = try source.color("L"),
        .rotation = if (is_older) to_equirectangular.compose(turn) else turn,
    };
}

/// From PBRT's directions, z up and u = 0 along x, to those of our maps, y up and u = 0 along -x.
const to_equirectangular: Transform = .{
    .x = .{ -1, 0, 0 },
    .y = .{ 0, 0, -1 },
    .z = .{ 0, 1, 0 },
    .translation = .{ 0, 0, 0 },
};

/// From the world's directions to the light's: the inverse of its place, which may mirror and
/// scale, evenly; null where it does more.
fn rotationOf(place: *const Transform) ?Transform {
    const x = vec3d.normalize(place.x) orelse return null;
    const y = vec3d.normalize(place.y) orelse return null;
    const z = vec3d.normalize(place.z) orelse return null;
    for ([_]f64{ vec3d.dot(x, y), vec3d.dot(y, z), vec3d.dot(z, x) }) |cosine| {
        if (!(@abs(cosine) < 1e-4)) return null;
    }
    return .{
        .x = .{ x[0], y[0], z[0] },
        .y = .{ x[1], y[1], z[1] },
        .z = .{ x[2], y[2], z[2] },
        .translation = .{ 0, 0, 0 },
    };
}

fn addSpot(source: *const Source, name: []const u8, is_projection: bool) Error!void {
    const parameters = source.parameters;
    const origin = source.point("from", .{ 0, 0, 0 });
    // A projector looks along z.
    const target = if (is_projection)
        source.place.point(.{ 0, 0, 1 })
    else
        source.point("to", .{ 0, 0, 1 });
    const way = vec3d.sub(target, origin);
    if (vec3d.normalize(way) == null)
        return source.colors.input.failHere("the light has no direction", .{});
    var outer_deg = parameters.float("coneangle", 30);
    var inner_deg = outer_deg - parameters.float("conedeltaangle", 5);
    if (is_projection) {
        try source.note(name, "is shown as a spot, its map is not read");
        try source.noteOf(name, "power");
        outer_deg = 0.5 * parameters.float("fov", 45);
        inner_deg = outer_deg - 1;
    }
    const outer = std.math.clamp(outer_deg, 0.1, 90) * (std.math.pi / 180.0);
    const inner = std.math.clamp(inner_deg, 0, 90) * (std.math.pi / 180.0);
    try source.builder.addLight(origin, way, .{
        .kind = .spot,
        .node = undefined,
        .color = if (is_projection)
            try source.color("I")
        else
            try source.colorBy("I", "power", spotPower(inner, outer)),
        .inner_cone_rad = @min(inner, 0.999 * outer),
        .outer_cone_rad = outer,
    });
}

/// The power of PBRT's spot of unit intensity, whose edge counts by half.
fn spotPower(inner_rad: f64, outer_rad: f64) f64 {
    const inner = math.elementary.cos(inner_rad);
    const outer = math.elementary.cos(outer_rad);
    return 2 * std.math.pi * ((1 - inner) + 0.5 * (inner - outer));
}

/// The area of triangles at their place in the world.
pub fn areaOf(geometry: *const Tessellator.Geometry, place: *const Transform) f64 {
    var area: f64 = 0;
    for (geometry.triangles) |triangle| {
        var corners: [3]Vector = undefined;
        for (&corners, triangle) |*corner, vertex| {
            const position = geometry.positions[vertex];
            corner.* = place.point(.{ position[0], position[1], position[2] });
        }
        area += 0.5 * vec3d.length(vec3d.cross(
            vec3d.sub(corners[1], corners[0]),
            vec3d.sub(corners[2], corners[0]),
        ));
    }
    return area;
}
