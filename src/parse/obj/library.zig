//! MTL files: materials by their names, as they stand in the text.
//!
//! In: a text. Out: for each material what its statements say, checked to be finite, and nothing of
//! what it means. Format: Alias/Wavefront, "MTL material format" (1995), with the statements for
//! physically based shading that Exocortex proposed and Blender writes.

const std = @import("std");
const math = @import("../../math.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = @import("../../diagnostic.zig").Diagnostic;
const Vec3 = math.Vec3;
const Words = @import("words.zig");
const quote = @import("../../diagnostic.zig").quote;
const Library = @This();

/// Options of a map, and its file.
pub const Map = struct {
    /// As it stands in the text.
    name: []const u8,
    scale: [2]f32 = .{ 1, 1 },
    offset: [2]f32 = .{ 0, 0 },
    is_clamped: bool = false,
    /// `-bm`.
    multiplier: f32 = 1,
};

/// Statements of a material; null where it does not have one.
pub const Material = struct {
    /// Of the library, relative to the scene's.
    folder: []const u8,
    diffuse: ?Vec3 = null,
    specular: ?Vec3 = null,
    emissive: ?Vec3 = null,
    /// Tf.
    filter: ?Vec3 = null,
    /// Ns.
    exponent: ?f32 = null,
    /// Ni.
    ior: ?f32 = null,
    /// d, and Tr, which is 1 less it.
    dissolve: ?f32 = null,
    transparency: ?f32 = null,
    illumination: ?f32 = null,
    /// Pr, Pm, Ps, Pc, Pcr, aniso, anisor.
    roughness: ?f32 = null,
    metallic: ?f32 = null,
    sheen: ?f32 = null,
    clearcoat: ?f32 = null,
    clearcoat_roughness: ?f32 = null,
    anisotropy: ?f32 = null,
    anisotropy_rotation: ?f32 = null,
    diffuse_map: ?Map = null,
    specular_map: ?Map = null,
    emissive_map: ?Map = null,
    dissolve_map: ?Map = null,
    bump_map: ?Map = null,
    normal_map: ?Map = null,
    roughness_map: ?Map = null,
    metallic_map: ?Map = null,
    sheen_map: ?Map = null,
    clearcoat_map: ?Map = null,
    clearcoat_roughness_map: ?Map = null,
};

/// Statements in any case: exporters write `map_kd` and `map_KD` as well.
const Names = std.StaticStringMapWithEql([]const u8, std.static_string_map.eqlAsciiIgnoreCase);

const colors: Names = .initComptime(.{
    .{ "Kd", "diffuse" }, .{ "Ks", "specular" }, .{ "Ke", "emissive" }, .{ "Tf", "filter" },
});

const numbers: Names = .initComptime(.{
    .{ "Ns", "exponent" },
    .{ "Ni", "ior" },
    .{ "d", "dissolve" },
    .{ "Tr", "transparency" },
    .{ "illum", "illumination" },
    .{ "Pr", "roughness" },
    .{ "Pm", "metallic" },
    .{ "Ps", "sheen" },
    .{ "Pc", "clearcoat" },
    .{ "Pcr", "clearcoat_roughness" },
    .{ "aniso", "anisotropy" },
    .{ "anisor", "anisotropy_rotation" },
});

const maps: Names = .initComptime(.{
    .{ "map_Kd", "diffuse_map" },
    .{ "map_Ks", "specular_map" },
    .{ "map_Ke", "emissive_map" },
    .{ "map_d", "dissolve_map" },
    .{ "map_Tr", "dissolve_map" },
    .{ "map_opacity", "dissolve_map" },
    .{ "map_Bump", "bump_map" },
    .{ "bump", "bump_map" },
    .{ "norm", "normal_map" },
    .{ "map_Norm", "normal_map" },
    .{ "map_Kn", "normal_map" },
    .{ "map_Pr", "roughness_map" },
    .{ "map_Pm", "metallic_map" },
    .{ "map_Ps", "sheen_map" },
    .{ "map_Pc", "clearcoat_map" },
    .{ "map_Pcr", "clearcoat_roughness_map" },
});

/// What is passed over in silence: it changes little, or nothing that is seen here.
const silent_words = [_][]const u8{
    "Ka", "map_Ka", "map_Ns", "map_aat", "sharpness", "map_aniso", "map_anisor",
};

/// What is known and changes the picture, but is not rendered.
const unread_words = [_][]const u8{
    "refl", "map_refl", "disp", "map_disp", "decal", "map_ORM", "map_RMA",
};

/// Lives as long as the scene is read; names and maps are parts of the texts.
arena: Allocator,
diagnostic: *Diagnostic,
materials: std.StringHashMapUnmanaged(Material) = .empty,

/// Adds the materials of a text; of several with one name the first counts. `title` is what
/// messages call it, `folder` where its maps are.
pub fn read(
    library: *Library,
    text: [:0]const u8,
    title: []const u8,
    folder: []const u8,
) Allocator.Error!void {
    var words: Words = .{ .text = text };
    var spare: Material = .{ .folder = folder };
    var material = &spare;
    while (words.nextLine()) : (words.skipLine()) {
        const start = words.cursor;
        const word = words.word();
        if (std.ascii.eqlIgnoreCase(word, "newmtl")) {
            const entry = try library.materials.getOrPut(library.arena, words.rest());
            spare = .{ .folder = folder };
            material = if (entry.found_existing) &spare else entry.value_ptr;
            if (!entry.found_existing) material.* = .{ .folder = folder };
            continue;
        }
        if (set(material, &words, word) or isOneOf(word, &silent_words)) continue;
        if (isOneOf(word, &unread_words)) {
            library.diagnostic.warn("{f}: {s} is not rendered", .{ quote(title), word });
            continue;
        }
        library.diagnostic.forgive("{f}: line {d}: {f} is not understood, ignored", .{
            quote(title), words.lineOf(start), quote(word),
        });
    }
}

/// Whether the statement was understood.
fn set(material: *Material, words: *Words, word: []const u8) bool {
    if (maps.get(word)) |name| {
        setField(Map, material, name, readMap(words) orelse return false);
    } else if (colors.get(word)) |name| {
        setField(Vec3, material, name, readColor(words) orelse return false);
    } else if (numbers.get(word)) |name| {
        _ = isOption(words, "-halo");
        setField(f32, material, name, finite(words.float()) orelse return false);
    } else return false;
    return true;
}

fn isOneOf(word: []const u8, words: []const []const u8) bool {
    return for (words) |other| {
        if (std.ascii.eqlIgnoreCase(word, other)) break true;
    } else false;
}

/// Sets the field of that name, which has this type.
fn setField(comptime Value: type, material: *Material, name: []const u8, value: Value) void {
    const names = comptime std.meta.fieldNames(Material);
    inline for (names) |field| if (@FieldType(Material, field) == ?Value) {
        if (std.mem.eql(u8, field, name)) @field(material, field) = value;
    };
}

/// Three numbers, or one for all; null: it is a spectrum, in CIE XYZ, or nothing.
fn readColor(words: *Words) ?Vec3 {
    const first = words.float() orelse return null;
    var color: Vec3 = .{ first, first, first };
    if (words.hasMore()) for (color[1..]) |*channel| {
        channel.* = words.float() orelse return null;
    };
    if (!math.vec3.isFinite(color)) return null;
    for (&color) |*channel| channel.* = math.flushDenormal(@max(channel.*, 0));
    return color;
}

/// Whether the next word is this one, which is passed over.
fn isOption(words: *Words, name: []const u8) bool {
    const before = words.cursor;
    if (std.mem.eql(u8, words.word(), name)) return true;
    words.cursor = before;
    return false;
}

/// Options of maps, by how many values they have at most.
const Option = enum {
    @"-s",
    @"-o",
    @"-t",
    @"-mm",
    @"-bm",
    @"-clamp",
    @"-blendu",
    @"-blendv",
    @"-cc",
    @"-boost",
    @"-texres",
    @"-imfchan",
    @"-type",
    @"-colorspace",
};

/// Options and then a file's name, which may have blanks.
fn readMap(words: *Words) ?Map {
    var map: Map = .{ .name = "" };
    while (words.hasMore() and words.text[words.cursor] == '-') {
        const before = words.cursor;
        const option = std.meta.stringToEnum(Option, words.word()) orelse {
            words.cursor = before; // A name that begins with a dash.
            break;
        };
        switch (option) {
            .@"-s" => readPair(words, &map.scale),
            .@"-o" => readPair(words, &map.offset),
            .@"-t" => {
                var ignored: [2]f32 = undefined;
                readPair(words, &ignored);
            },
            .@"-mm" => for (0..2) |_| {
                _ = words.float();
            },
            .@"-bm" => map.multiplier = finite(words.float()) orelse 1,
            .@"-clamp" => map.is_clamped = std.mem.eql(u8, words.word(), "on"),
            else => _ = words.word(),
        }
    }
    map.name = words.rest();
    return if (map.name.len > 0) map else null;
}

fn finite(value: ?f32) ?f32 {
    const number = value orelse return null;
    return if (std.math.isFinite(number) and @abs(number) <= 1e6) number else null;
}

/// One to three numbers, of which the first two count. A file may be called "2": the last word of
/// a line is never one of them.
fn readPair(words: *Words, pair: *[2]f32) void {
    for (0..3) |index| {
        const before = words.cursor;
        const value = words.float();
        const is_name = value == null or !words.hasMore();
        if (is_name) {
            words.cursor = before;
            return;
        }
        if (index < 2) pair[index] = finite(value) orelse pair[index];
    }
}
