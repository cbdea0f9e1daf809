//! Materials of an OBJ file: what MTL says, as the scene's metallic-roughness materials.
//!
//! In: the names of libraries and of materials. Out: the scene's materials, those that are used,
//! and their textures. docs/meshes.md has the table of what stands for what. A library, a material
//! or an image that is missing is a warning; what has no material is grey.

const std = @import("std");
const math = @import("../../math.zig");
const plain = @import("../plain.zig");
const scene = @import("../../scene.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = @import("../../diagnostic.zig").Diagnostic;
const FileSearch = @import("../file_search.zig");
const Library = @import("library.zig");
const Map = Library.Map;
const Message = @import("../../diagnostic.zig").Message;
const NamedImages = @import("../named_images.zig");
const Reader = @import("reader.zig");
const Resources = @import("../resource.zig");
const Vec3 = math.Vec3;
const Words = @import("words.zig");
const quote = @import("../../diagnostic.zig").quote;
const markBytes = @import("../format.zig").markBytes;
const Materials = @This();

resources: *Resources,
builder: *scene.Builder,
reader: *const Reader,
diagnostic: *Diagnostic,
/// Lives as long as the scene is read.
arena: Allocator,
images: NamedImages,
library: Library,
/// The scene's by the file's number, and by the scene's what is like it.
known: std.AutoHashMapUnmanaged(u32, u32) = .empty,
bare: std.AutoHashMapUnmanaged(u32, u32) = .empty,
unlit_of: std.AutoHashMapUnmanaged(u32, u32) = .empty,
/// The scene's image as a map of heights.
reliefs: std.AutoHashMapUnmanaged(u32, u32) = .empty,

/// `mtllib` statements at most: each names at least one file that is looked for.
const library_count_max = 1000;

/// Frees what is neither the scene's nor the arena's.
pub fn deinit(materials: *Materials) void {
    materials.images.deinit();
    materials.* = undefined;
}

/// Reads the libraries that the file names; `stem` is the scene's own name, under which a library
/// may be whose name is wrong.
pub fn load(materials: *Materials, stem: []const u8) Resources.Error!void {
    var seen: std.StringHashMapUnmanaged(void) = .empty;
    for (materials.reader.libraries.items) |name| {
        const entry = try seen.getOrPut(materials.arena, name);
        if (entry.found_existing or name.len == 0) continue;
        if (seen.count() > library_count_max) return materials.diagnostic.invalid(
            "over {d} material libraries",
            .{library_count_max},
        );
        var reason: Message = .{};
        if (try materials.loadOne(name, &reason)) continue;
        // Several names, or one with blanks.
        var found = false;
        var parts = std.mem.tokenizeAny(u8, name, " \t");
        var ignored: Message = .{};
        if (std.mem.findAny(u8, name, " \t") != null) while (parts.next()) |part| {
            if (try materials.loadOne(part, &ignored)) found = true;
        };
        if (found) continue;
        const own = try materials.arena.print("{s}.mtl", .{stem});
        if (stem.len > 0 and try materials.loadOne(own, &ignored)) continue;
        materials.diagnostic.warn("material library {f} {s}", .{ quote(name), reason.text() });
    }
}

/// False, with the reason, where it cannot be read.
fn loadOne(materials: *Materials, name: []const u8, reason: *Message) Resources.Error!bool {
    const arena = materials.arena;
    var search: FileSearch = try .init(materials.resources, arena, "", name);
    while (try search.next()) |path| {
        var other: Message = .{};
        const said = if (search.isFirst()) reason else &other;
        const file = materials.resources.readOptional(arena, path, said) catch |err| switch (err) {
            error.OutOfMemory => |failure| return failure,
            error.Unreadable => continue,
            error.Overwritten => return materials.diagnostic.fail(
                error.InputOutput,
                "material library {f} {s}",
                .{ quote(name), said.text() },
            ),
        };
        if (search.isOtherCase()) materials.diagnostic.forgiveEach(
            "material library {f} is {f}",
            .{ quote(name), quote(path) },
        );
        const joined = try Words.joined(arena, file.bytes) orelse file.bytes;
        const text = joined[markBytes(joined)..];
        try materials.library.read(text, name, std.fs.path.dirname(path) orelse "");
        return true;
    }
    return false;
}

/// The scene's material for the file's of that number; beyond the last: for what has none.
pub fn get(materials: *Materials, index: u32) Resources.Error!u32 {
    if (materials.known.get(index)) |known| return known;
    const names = materials.reader.material_names.items;
    const material = if (index >= names.len)
        materials.default()
    else if (materials.find(names[index])) |raw|
        try materials.convert(raw)
    else missing: {
        if (materials.library.materials.count() > 0 or materials.reader.libraries.items.len == 0)
            materials.diagnostic.forgiveEach("material {f} is not defined, grey", .{
                quote(names[index]),
            });
        break :missing materials.default();
    };
    const added = try materials.builder.addMaterial(material);
    try materials.known.put(materials.arena, index, added);
    return added;
}

/// The material of that name. A `#` may be part of it, or begin a comment behind it.
fn find(materials: *const Materials, name: []const u8) ?*const Library.Material {
    const all = &materials.library.materials;
    if (all.getPtr(name)) |raw| return raw;
    const end = std.mem.find(u8, name, " #") orelse return null;
    return all.getPtr(std.mem.trimEnd(u8, name[0..end], " \t"));
}

/// Of what has no material of its own.
fn default(materials: *const Materials) scene.Material {
    var material = plain.material;
    if (materials.reader.colors.items.len > 0) material.base_color = .{ 1, 1, 1, 1 };
    return material;
}

/// Whether the scene's material of that number has any.
pub fn hasTextures(materials: *const Materials, index: u32) bool {
    return materials.builder.materials.items[index].hasTextures();
}

/// The same material where there are no coordinates.
pub fn withoutTextures(materials: *Materials, index: u32) Resources.Error!u32 {
    if (!materials.hasTextures(index)) return index;
    if (materials.bare.get(index)) |known| return known;
    var material = materials.builder.materials.items[index];
    inline for (scene.texture_fields) |field| @field(material, field) = null;
    if (material.alpha_mode == .mask) material.alpha_mode = .@"opaque";
    materials.diagnostic.warn("faces without coordinates show no textures", .{});
    const added = try materials.builder.addMaterial(material);
    try materials.bare.put(materials.arena, index, added);
    return added;
}

/// The same material for what is not lit.
pub fn unlit(materials: *Materials, index: u32) Resources.Error!u32 {
    if (materials.unlit_of.get(index)) |known| return known;
    const lit = &materials.builder.materials.items[index];
    const added = try materials.builder.addMaterial(.{
        .base_color = lit.base_color,
        .base_color_texture = lit.base_color_texture,
        .alpha_mode = lit.alpha_mode,
        .double_sided = true,
        .unlit = true,
    });
    try materials.unlit_of.put(materials.arena, index, added);
    return added;
}

fn convert(materials: *Materials, raw: *const Library.Material) Resources.Error!scene.Material {
    var material: scene.Material = .{ .double_sided = true, .metallic = 0 };
    const base = colorOf(raw.diffuse, raw.diffuse_map, 0.8);
    material.base_color = linear(base) ++ .{1};
    material.emissive = colorOf(raw.emissive, raw.emissive_map, 0);
    setReflection(raw, &material);
    setCoats(raw, &material);
    setTransparency(raw, &material);
    try materials.addTextures(raw, &material);
    return material;
}

/// A colour that a map is multiplied with. Exporters write black beside maps that are to be seen.
fn colorOf(color: ?Vec3, map: ?Map, missing: f32) Vec3 {
    const is_mapped = map != null;
    const own = color orelse return @splat(if (is_mapped) 1 else missing);
    return if (is_mapped and math.vec3.maxComponent(own) == 0) @splat(1) else own;
}

/// Linear light of a display's colour.
fn linear(color: Vec3) Vec3 {
    var result: Vec3 = undefined;
    for (&result, color) |*channel, code| {
        channel.* = math.flushDenormal(@floatCast(math.srgb.linear(@min(code, 1))));
    }
    return result;
}

fn unit(value: f32) f32 {
    return math.flushDenormal(std.math.clamp(value, 0, 1));
}

/// Whether it is made for physically based shading.
fn isPhysical(raw: *const Library.Material) bool {
    return raw.roughness != null or raw.metallic != null or
        raw.roughness_map != null or raw.metallic_map != null;
}

/// How it is lit, 0 to 10.
fn illuminationOf(raw: *const Library.Material) u32 {
    const value = raw.illumination orelse
        return if (raw.specular != null or raw.specular_map != null) 2 else 1;
    return if (value >= 0 and value <= 10) @intFromFloat(value) else 2;
}

fn isMirror(illumination: u32) bool {
    return illumination == 3 or illumination == 5 or illumination == 8;
}

/// Index of refraction of what reflects all that its colour lets it, as for glTF's ior 0.
const ior_total = 1e6;

/// Exponents from which a mirror is smooth.
const mirror_exponent_min = 900;

fn setReflection(raw: *const Library.Material, material: *scene.Material) void {
    if (isPhysical(raw)) {
        material.metallic = unit(raw.metallic orelse 0);
        material.roughness = unit(raw.roughness orelse if (raw.roughness_map != null)
            1
        else
            roughnessOf(raw.exponent orelse 0));
        if (raw.ior) |ior| if (ior > 1) {
            material.ior = @min(ior, 10);
        };
        return;
    }
    const illumination = illuminationOf(raw);
    const specular = colorOf(raw.specular, raw.specular_map, 0);
    const weight = math.vec3.maxComponent(specular);
    material.roughness = roughnessOf(raw.exponent orelse 0);
    if (illumination < 2 or weight == 0) {
        // Lambert's law alone.
        material.roughness = 1;
        material.ior = 1;
        return;
    }
    material.specular = @min(weight, 1);
    material.specular_color = math.vec3.scale(specular, 1 / weight);
    if (!isMirror(illumination)) return;
    material.ior = ior_total;
    const exponent = raw.exponent orelse mirror_exponent_min;
    if (exponent >= mirror_exponent_min) material.roughness = 0;
}

/// Of Phong's lobe: its alpha is sqrt(2 / (Ns + 2)), and that the square of a roughness (Walter et
/// al. 2007).
fn roughnessOf(exponent: f32) f32 {
    const alpha = @sqrt(2 / (@max(exponent, 0) + 2));
    return unit(@sqrt(alpha));
}

fn setCoats(raw: *const Library.Material, material: *scene.Material) void {
    material.clearcoat = unit(raw.clearcoat orelse if (raw.clearcoat_map != null) 1 else 0);
    material.clearcoat_roughness =
        unit(raw.clearcoat_roughness orelse if (raw.clearcoat_roughness_map != null) 1 else 0);
    const sheen = unit(raw.sheen orelse if (raw.sheen_map != null) 1 else 0);
    material.sheen_color = @splat(sheen);
    if (sheen > 0) material.sheen_roughness = 0.5;
    material.anisotropy = unit(raw.anisotropy orelse 0);
    const turns = raw.anisotropy_rotation orelse 0;
    if (@abs(turns) <= 1) material.anisotropy_rotation_rad = turns * (2 * std.math.pi);
}

fn setTransparency(raw: *const Library.Material, material: *scene.Material) void {
    // What is wholly transparent by Tr alone is written by those who mean the opposite.
    const transparency = unit(raw.transparency orelse 0);
    const by_tr = if (transparency == 1) 1 else 1 - transparency;
    const alpha = unit(raw.dissolve orelse by_tr);
    const illumination = illuminationOf(raw);
    const filter = raw.filter orelse Vec3{ 1, 1, 1 };
    if (illumination != 6 and illumination != 7) {
        material.base_color[3] = alpha;
        if (alpha < 1) material.alpha_mode = .blend;
        return;
    }
    const share = if (alpha < 1) 1 - alpha else unit(math.vec3.maxComponent(filter));
    if (share == 0) return;
    material.transmission = share;
    material.volume = true;
    material.ior = std.math.clamp(raw.ior orelse 1.5, 1, 10);
    material.specular = 1;
    material.specular_color = .{ 1, 1, 1 };
    if (raw.roughness == null) material.roughness = 0;
    if (share < 1) return;
    const largest = math.vec3.maxComponent(filter);
    for (material.base_color[0..3], filter) |*channel, part| {
        channel.* = math.flushDenormal(part / largest);
    }
}

fn addTextures(
    materials: *Materials,
    raw: *const Library.Material,
    material: *scene.Material,
) Resources.Error!void {
    const folder = raw.folder;
    inline for (.{
        .{ "base_color_texture", "diffuse_map" },
        .{ "emissive_texture", "emissive_map" },
        .{ "metallic_roughness_texture", "roughness_map" },
        .{ "clearcoat_texture", "clearcoat_map" },
        .{ "clearcoat_roughness_texture", "clearcoat_roughness_map" },
        .{ "normal_texture", "normal_map" },
    }) |pair| if (@field(raw, pair[1])) |map| {
        @field(material, pair[0]) = try materials.view(folder, map);
    };
    if (!isPhysical(raw) and material.specular > 0 and illuminationOf(raw) >= 2) {
        if (raw.specular_map) |map|
            material.specular_color_texture = try materials.view(folder, map);
    }
    if (raw.sheen_map) |map| material.sheen_color_texture = try materials.view(folder, map);
    if (raw.normal_map) |map| material.normal_scale = map.multiplier;
    try materials.addBump(raw, material);
    try materials.addDissolve(raw, material);
    const metallic_map = raw.metallic_map orelse return;
    const is_shared = if (raw.roughness_map) |map|
        std.mem.eql(u8, map.name, metallic_map.name)
    else
        false;
    if (is_shared) {
        if (raw.metallic == null) material.metallic = 1;
        return;
    }
    materials.diagnostic.warn("map_Pm {f} is another image than map_Pr, left out", .{
        quote(metallic_map.name),
    });
}

/// Holes where it is the only thing that is transparent. An image that the colours have as well
/// says it by its alpha.
fn addDissolve(
    materials: *Materials,
    raw: *const Library.Material,
    material: *scene.Material,
) Resources.Error!void {
    const map = raw.dissolve_map orelse return;
    if (material.alpha_mode == .@"opaque") material.alpha_mode = .mask;
    if (raw.diffuse_map) |colors| if (std.mem.eql(u8, colors.name, map.name)) return;
    material.alpha_texture = try materials.view(raw.folder, map);
}

/// Heights, or normals, which exporters name so as well: prepare looks at the image.
fn addBump(
    materials: *Materials,
    raw: *const Library.Material,
    material: *scene.Material,
) Resources.Error!void {
    const map = raw.bump_map orelse return;
    if (material.normal_texture != null) return;
    const image = try materials.images.get(raw.folder, map.name) orelse return;
    const entry = try materials.reliefs.getOrPut(materials.arena, image);
    if (!entry.found_existing) {
        var copy = materials.builder.images.items[image];
        copy.is_relief = true;
        entry.value_ptr.* = try materials.builder.addImage(copy);
    }
    material.normal_texture = try materials.viewOf(entry.value_ptr.*, map);
    material.normal_scale = map.multiplier;
}

/// A map as the scene's texture; null, with a warning, where its image cannot be read.
fn view(
    materials: *Materials,
    folder: []const u8,
    map: Map,
) Resources.Error!?scene.TextureView {
    const image = try materials.images.get(folder, map.name) orelse return null;
    return try materials.viewOf(image, map);
}

fn viewOf(materials: *Materials, image: u32, map: Map) Resources.Error!scene.TextureView {
    const wrap: scene.Wrap = if (map.is_clamped) .clamp_to_edge else .repeat;
    // From (u, 1 - v) to (s, 1 - t), where s = su u + ou and t = sv v + ov.
    const su, const sv = map.scale;
    const ou, const ov = map.offset;
    return .{
        .texture = try materials.builder.addTexture(.{ .image = image, .wrap = .{ wrap, wrap } }),
        .transform = .{ .{ su, 0, ou }, .{ 0, sv, 1 - sv - ov } },
    };
}
