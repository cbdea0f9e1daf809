//! A scene as if it were of white clay in a white room: what light from everywhere leaves of it is
//! its ambient occlusion.
//!
//! In: a frame. Out: the same with materials that scatter as much of a given light whatever their
//! colours; alpha and normal textures stay. Vertices have no colours.

const std = @import("std");
const world = @import("../world.zig");
const Allocator = std.mem.Allocator;
const Clay = @This();

/// Share of light that clay scatters: what surfaces that hide light scatter in turn is to count for
/// little.
const albedo = 0.125;
/// Radiance all around with which a surface that nothing hides is white.
pub const radiance = 1 / albedo;

arena: std.heap.ArenaAllocator,
geometry: world.Geometry,
materials: world.Materials,

/// Of a world, which has to live as long. `deinit` frees it.
pub fn init(gpa: Allocator, from: *const world.World) error{OutOfMemory}!Clay {
    var arena_state: std.heap.ArenaAllocator = .init(gpa);
    errdefer arena_state.deinit();
    const arena = arena_state.allocator();
    const all = try arena.dupe(world.Material, from.materials.all);
    var lookups: std.ArrayList(world.Lookup) =
        try .initCapacity(arena, from.materials.lookups.len);
    var has_transparency = false;
    for (all, from.materials.all) |*material, *before| {
        const own = from.materials.lookups[before.first_lookup..][0..before.lookup_count];
        const first: u32 = @intCast(lookups.items.len);
        for (own) |lookup| {
            var kept = lookup;
            switch (lookup.slot) {
                .normal => {},
                .base_color => kept.channels[0..3].* = @splat(no_channel),
                else => continue,
            }
            lookups.appendAssumeCapacity(kept);
        }
        material.* = clayOf(before);
        material.first_lookup = first;
        material.lookup_count = @intCast(lookups.items.len - first);
        has_transparency = has_transparency or material.blend > 0;
    }
    var geometry = from.geometry;
    geometry.colors = &.{};
    geometry.shared.has_colors = false;
    return .{
        .arena = arena_state,
        .geometry = geometry,
        .materials = .{
            .all = all,
            .sources = from.materials.sources,
            .lookups = lookups.items,
            .has_transparency = has_transparency,
            .has_holes = from.materials.has_holes,
            .occluders = from.materials.occluders,
        },
    };
}

/// In `Lookup.channels`.
const no_channel = 255;

fn clayOf(material: *const world.Material) world.Material {
    return .{
        .base_color = .{ albedo, albedo, albedo, material.base_color[3] },
        .emissive = @splat(0),
        .metallic = 0,
        .roughness = 1,
        .dielectric_f0 = 0,
        .ior = 1,
        .transmission = 0,
        .sigma_a = @splat(0),
        .alpha_cutoff = material.alpha_cutoff,
        .blend = material.blend,
        // As what bounds a volume is seen from within, too.
        .double_sided = @max(material.double_sided, material.volume),
        .unlit = 0,
        .volume = 0,
        .normal_scale = material.normal_scale,
    };
}

/// Frees it.
pub fn deinit(clay: *Clay) void {
    clay.arena.deinit();
    clay.* = undefined;
}

/// Makes a frame of the world show it, in no other light than the environment's. It has to stay
/// where it is.
pub fn applyTo(clay: *const Clay, frame: *world.Frame) void {
    frame.geometry = &clay.geometry;
    frame.materials = &clay.materials;
    frame.lights = &.{};
    frame.all_lights = &.{};
}
