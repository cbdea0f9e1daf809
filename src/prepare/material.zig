//! Metallic-roughness materials (glTF 2.0, appendix B) as shading wants them.
//!
//! In: materials of what is drawn. Out: the world's, one for one, and their layers where some have
//! any. Further sources: the extensions KHR_materials_ior, _transmission and _volume.

const std = @import("std");
const layers_file = @import("layers.zig");
const math = @import("../math.zig");
const scene = @import("../scene.zig");
const world = @import("../world.zig");
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;
const AlphaRange = @import("texture.zig").AlphaRange;
const MaterialUse = @import("texture.zig").MaterialUse;
const Parts = @import("alpha.zig").Parts;
const TextureSet = @import("texture.zig").TextureSet;
const volumes_file = @import("volumes.zig");

/// The world's materials in the order of the parts'. Of the geometry no tree is needed.
pub fn place(
    arena: Allocator,
    parts: *const Parts,
    textures: *const TextureSet,
    geometry: *const world.Geometry,
) error{OutOfMemory}!world.Materials {
    const converted = try arena.alloc(world.Material, parts.materials.len);
    for (parts.materials, textures.materials, converted) |*material, *use, *to| {
        to.* = convert(material, use);
    }
    const layers = try arena.alloc(world.Layers, parts.materials.len);
    for (parts.materials, textures.materials, layers) |*material, *use, *to| {
        to.* = layers_file.convert(material, use.layer_lookup_count > 0);
    }
    var has_layers = false;
    var has_transparency = false;
    var has_transmission = false;
    var has_holes = false;
    for (parts.instances) |instance| {
        const index = parts.meshes[instance.mesh].material;
        const used = &converted[index];
        has_layers = has_layers or layers[index].present > 0;
        has_transparency = has_transparency or isTransparent(used);
        has_transmission = has_transmission or used.transmits();
        has_holes = has_holes or used.alpha_cutoff >= 0;
    }
    // What bounds volumes is flattened.
    const volumes = try volumes_file
        .rank(arena, converted, layers, geometry.positions, geometry.triangles);
    var has_scattering = false;
    for (volumes) |*volume| has_scattering = has_scattering or volume.scatters();
    const stops_all = !has_transparency and !has_holes;
    return .{
        .all = converted,
        .layers = if (has_layers) layers else &.{},
        .sources = parts.sources,
        .lookups = textures.lookups,
        .volumes = volumes,
        .has_scattering = has_scattering,
        .has_transmission = has_transmission,
        .has_transparency = has_transparency,
        .has_holes = has_holes,
        .occluders = if (stops_all)
            &.{}
        else
            try occluders(arena, converted, textures.lookups, geometry),
    };
}

/// Whether there is any place where a surface of this material can be seen, or shines.
pub fn isVisible(from: *const scene.Material, use: *const MaterialUse) bool {
    if (from.in_motion or from.is_hidden_lamp) return true;
    return switch (from.alpha_mode) {
        .@"opaque" => true,
        .mask => use.alpha.largest >= from.alpha_cutoff,
        .blend => use.alpha.largest > 0,
    };
}

/// Whether light passes surfaces of this material in part.
fn isTransparent(material: *const world.Material) bool {
    return material.blend > 0 or material.isClear();
}

/// Alpha counts where the mode says so, and some place of the material is not all there.
fn convert(from: *const scene.Material, use: *const MaterialUse) world.Material {
    assert(from.ior >= 1);
    assert(!from.is_hidden_lamp or (from.alpha_mode == .blend and from.base_color[3] == 0));
    const has_holes = from.alpha_mode == .mask and use.alpha.least < from.alpha_cutoff;
    const blends = from.alpha_mode == .blend and use.alpha.least < 1;
    var base_color = from.base_color;
    if (!has_holes and !blends) base_color[3] = 1;
    const f0_root = (from.ior - 1) / (from.ior + 1);
    return .{
        .base_color = base_color,
        .emissive = from.emissive,
        .metallic = from.metallic,
        .roughness = from.roughness,
        .dielectric_f0 = f0_root * f0_root,
        .ior = from.ior,
        .transmission = from.transmission,
        .diffuse_through = math.vec3.scale(
            from.diffuse_transmission_color,
            from.diffuse_transmission,
        ),
        .sigma_a = layers_file.volumeOf(from).sigma_a,
        .alpha_cutoff = if (has_holes) from.alpha_cutoff else -1,
        .blend = flag(blends),
        .double_sided = flag(from.double_sided),
        .unlit = flag(from.unlit),
        .volume = flag(from.volume),
        .normal_scale = from.normal_scale,
        .occlusion_strength = from.occlusion_strength,
        .first_lookup = use.first_lookup,
        .lookup_count = use.lookup_count,
        .layer_lookup_count = use.layer_lookup_count,
        .is_hidden_lamp = from.is_hidden_lamp,
    };
}

/// See `world.Materials.occluders`.
fn occluders(
    arena: Allocator,
    materials: []const world.Material,
    lookups: []const world.Lookup,
    geometry: *const world.Geometry,
) error{OutOfMemory}![]const u32 {
    const stops = try arena.alloc(bool, materials.len);
    for (stops, materials) |*to, *material| {
        to.* = material.stopsLight(lookups[material.first_lookup..][0..material.lookup_count]);
    }
    const count = geometry.triangleCount();
    const words = try arena.alloc(u32, @divCeil(count, 32));
    @memset(words, 0);
    var cursor: world.Cursor = .init(geometry);
    for (0..count) |number| {
        const triangle = cursor.triangleAt(@intCast(number));
        if (triangle.isDropped() or !stops[triangle.material]) continue;
        words[number / 32] |= @as(u32, 1) << @intCast(number % 32);
    }
    return words;
}

fn flag(condition: bool) f32 {
    return if (condition) 1 else 0;
}

/// Of a material without textures on vertices without colours.
fn testConvert(from: *const scene.Material) world.Material {
    const alpha = from.base_color[3];
    return convert(from, &.{ .alpha = .{ .least = alpha, .largest = alpha } });
}

test "alpha counts only where the mode says so" {
    const from: scene.Material = .{ .base_color = .{ 0.1, 0.2, 0.3, 0.4 } };
    try std.testing.expectEqual([4]f32{ 0.1, 0.2, 0.3, 1 }, testConvert(&from).base_color);
    try std.testing.expectEqual(-1, testConvert(&from).alpha_cutoff);
    var mask = from;
    mask.alpha_mode = .mask;
    try std.testing.expectEqual(0.5, testConvert(&mask).alpha_cutoff);
    try std.testing.expectEqual(0.4, testConvert(&mask).base_color[3]);
    try std.testing.expect(!isTransparent(&testConvert(&mask)));
    var blend = from;
    blend.alpha_mode = .blend;
    try std.testing.expectEqual(-1, testConvert(&blend).alpha_cutoff);
    try std.testing.expect(isTransparent(&testConvert(&blend)));
}

test "light is stopped where nothing blends, has holes or lets it through" {
    const Case = struct { scene.Material, bool };
    for ([_]Case{
        .{ .{}, true },
        .{ .{ .transmission = 0.5, .metallic = 0 }, false },
        .{ .{ .transmission = 1, .metallic = 1 }, true },
        .{ .{ .alpha_mode = .blend, .base_color = .{ 1, 1, 1, 0.9 } }, false },
        .{ .{ .alpha_mode = .blend }, true },
        .{ .{ .alpha_mode = .mask, .base_color = .{ 1, 1, 1, 0.4 } }, false },
        .{ .{ .alpha_mode = .mask, .base_color = .{ 1, 1, 1, 0.5 } }, true },
    }) |case| try std.testing.expectEqual(case[1], testConvert(&case[0]).stopsLight(&.{}));
    // Metal by a texture is not metal everywhere.
    const metal = testConvert(&.{ .transmission = 1, .metallic = 1 });
    var lookup: world.Lookup = undefined;
    lookup.slot = .metallic_roughness;
    try std.testing.expect(!metal.stopsLight(&.{lookup}));
    lookup.slot = .transmission;
    try std.testing.expect(metal.stopsLight(&.{lookup}));
}

test "reflectance of glass and of nothing" {
    try std.testing.expectApproxEqRel(@as(f32, 0.04), testConvert(&.{}).dielectric_f0, 1e-6);
    try std.testing.expectEqual(0, testConvert(&.{ .ior = 1 }).dielectric_f0);
}

test "what is all holes or all clear is seen nowhere" {
    const Case = struct { scene.AlphaMode, AlphaRange, bool };
    for ([_]Case{
        .{ .@"opaque", .{ .least = 0, .largest = 0 }, true },
        .{ .mask, .{ .least = 0, .largest = 0.4 }, false },
        .{ .mask, .{ .least = 0, .largest = 0.5 }, true },
        .{ .blend, .{ .least = 0, .largest = 0 }, false },
        .{ .blend, .{ .least = 0, .largest = 0.01 }, true },
    }) |case| {
        const seen = isVisible(&.{ .alpha_mode = case[0] }, &.{ .alpha = case[1] });
        try std.testing.expectEqual(case[2], seen);
    }
}
