//! Version and extensions of a document: whether this reader may read it at all.
//!
//! In: `asset`, `extensionsRequired` and `extensionsUsed` (glTF 2.0, sections 3.2 and 3.12). Out:
//! an error that names what is required and not supported, and one warning that names whatever else
//! the picture will lack.

const std = @import("std");
const c = @import("../cgltf.zig");
const diagnostic = @import("../../diagnostic.zig");
const Source = @import("source.zig");
const Error = Source.Error;

/// Extensions that are read.
const read: []const []const u8 = &.{
    "EXT_lights_image_based",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_materials_volume_scatter",
    "KHR_mesh_quantization",
    "KHR_texture_basisu",
    "KHR_texture_transform",
};

/// Extensions without which the shapes are right and only their looks are not.
const looks: []const []const u8 = &.{
    "ADOBE_materials_thin_transparency",
    "EXT_lights_ies",
    "FB_materials_modmap",
    "KHR_materials_subsurface",
};

/// Extensions that have no part in the picture that a file shows first.
const unseen: []const []const u8 = &.{
    "AGI_articulations",
    "EXT_instance_features",
    "EXT_mesh_features",
    "EXT_structural_metadata",
    "FB_ngon_encoding",
    "GRIFFEL_bim_data",
    "KHR_audio_emitter",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "MSFT_packing_normalRoughnessMetallic",
    "MSFT_packing_occlusionRoughnessMetallic",
};

/// Other forms of images; textures that have none besides are warned of one by one.
const pictures: []const []const u8 = &.{
    "EXT_texture_astc",
    "EXT_texture_avif",
    "MSFT_texture_dds",
};

/// Other forms of meshes that are there as well, unless they are required.
const meshes: []const []const u8 = &.{
    "EXT_meshopt_compression",
    "KHR_draco_mesh_compression",
    "KHR_meshopt_compression",
};

/// Names of extensions in one warning.
const named_count_max = 6;

/// Checks the version and the required extensions.
pub fn check(source: *const Source) Error!void {
    const data = source.data;
    const version = try parseVersion(source, "version", data.asset.version);
    const wanted = if (data.asset.min_version == null)
        version
    else
        try parseVersion(source, "minVersion", data.asset.min_version);
    // Later minor versions have to be readable as 2.0 unless the file says otherwise.
    const too_new = data.asset.min_version != null and wanted.minor > 0;
    if (version.major != 2 or wanted.major != 2 or too_new) return source.fail(
        "glTF {d}.{d} is not supported, only 2.0",
        .{ wanted.major, wanted.minor },
    );
    for (Source.slice(data.extensions_required, data.extensions_required_count)) |raw| {
        const name = std.mem.span(@as([*:0]const u8, raw));
        for ([_][]const []const u8{ read, looks, unseen, pictures }) |list| {
            if (contains(list, name)) break;
        } else return source.fail("the required extension {f} is not supported", .{
            diagnostic.quote(name),
        });
    }
    warnOfUnrendered(source);
}

/// Names the extensions that the file uses and the picture lacks.
fn warnOfUnrendered(source: *const Source) void {
    const data = source.data;
    var names: [named_count_max][]const u8 = undefined;
    var count: usize = 0;
    for ([_][]const [*c]u8{
        Source.slice(data.extensions_required, data.extensions_required_count),
        Source.slice(data.extensions_used, data.extensions_used_count),
    }) |list| for (list) |raw| {
        const name = std.mem.span(@as([*:0]const u8, raw));
        for ([_][]const []const u8{ read, unseen, pictures, meshes }) |known| {
            if (contains(known, name)) break;
        } else {
            if (contains(names[0..@min(count, names.len)], name)) continue;
            if (count < names.len) names[count] = name;
            count += 1;
        }
    };
    if (count == 0) return;
    var buffer: [names.len * 96]u8 = undefined;
    var writer: std.Io.Writer = .fixed(&buffer);
    for (names[0..@min(count, names.len)], 0..) |name, index| {
        // A name takes 88 bytes at most.
        if (index > 0) writer.writeAll(", ") catch unreachable;
        writer.print("{f}", .{diagnostic.quote(name)}) catch unreachable;
    }
    const more = if (count > names.len) " and others" else "";
    source.warn("not rendered: the extensions {s}{s}", .{ writer.buffered(), more });
}

/// Whether the file says that it uses the extension.
pub fn uses(source: *const Source, extension: []const u8) bool {
    const data = source.data;
    for (Source.slice(data.extensions_used, data.extensions_used_count)) |raw| {
        if (std.mem.eql(u8, extension, std.mem.span(@as([*:0]const u8, raw)))) return true;
    }
    return false;
}

fn contains(list: []const []const u8, name: []const u8) bool {
    for (list) |known| if (std.mem.eql(u8, known, name)) return true;
    return false;
}

const Version = struct { major: u32, minor: u32 };

fn parseVersion(source: *const Source, key: []const u8, raw: [*c]const u8) Error!Version {
    const text = std.mem.span(@as([*:0]const u8, raw));
    return splitVersion(text) orelse source.fail("asset.{s}: {f} is not a version", .{
        key, diagnostic.quote(text),
    });
}

fn splitVersion(text: []const u8) ?Version {
    const dot = std.mem.findScalar(u8, text, '.') orelse return null;
    return .{
        .major = parseDigits(text[0..dot]) orelse return null,
        .minor = parseDigits(text[dot + 1 ..]) orelse return null,
    };
}

fn parseDigits(text: []const u8) ?u32 {
    for (text) |byte| if (!std.ascii.isDigit(byte)) return null;
    return std.fmt.parseInt(u32, text, 10) catch null;
}

test splitVersion {
    try std.testing.expectEqual(Version{ .major = 2, .minor = 0 }, splitVersion("2.0").?);
    const bad = [_][]const u8{ "", "2", ".", "2.", ".0", "2.0.1", "+2.0", "2.x", "99999999999.0" };
    for (bad) |text| try std.testing.expectEqual(null, splitVersion(text));
}
