//! What surfaces emit where no ray has hit them: at points that are chosen on them.
//!
//! In: a triangle and barycentric weights. Out: radiance, by factors and textures at their finest,
//! less what alpha leaves open: what a narrow ray that hits the point sees.

const std = @import("std");
const world_file = @import("../../world.zig");
const simd = @import("../../simd.zig");
const lookups_file = @import("lookups.zig");
const material_file = @import("material.zig");
const Single = simd.Lanes(.scalar, 1);
const Frame = world_file.Frame;

/// Linear RGB; `weights` are of corners 1 and 2.
pub fn radianceAt(frame: *const Frame, primitive: u32, weights: [2]f32) [3]f32 {
    const geometry = frame.geometry;
    const face = geometry.face(primitive);
    const material = &frame.materials.all[face.material];
    const first = material.first_lookup;
    const lookups = frame.materials.lookups[first..][0..material.lookup_count];
    const point: lookups_file.Point = .{
        .primitive = primitive,
        .weights = weights,
        .axes = @splat(@splat(0)),
    };
    var values: lookups_file.Values(.base) = @splat(@splat(1));
    lookups_file.sampleSlot(.base, frame, lookups, .emissive, &point, &values);
    const emissive = values[lookups_file.Slots.base.indexOf(.emissive)];
    var radiance: [3]f32 = undefined;
    for (&radiance, material.emissive, emissive[0..3]) |*to, factor, texel| to.* = factor * texel;
    const is_solid = material.blend == 0 and material.alpha_cutoff < 0;
    if (material.is_hidden_lamp or is_solid) return radiance;
    lookups_file.sampleSlot(.base, frame, lookups, .base_color, &point, &values);
    var alpha = values[lookups_file.Slots.base.indexOf(.base_color)][3];
    if (geometry.hasColors()) {
        const a = face.color(geometry, 0)[3];
        const b = face.color(geometry, 1)[3];
        const c = face.color(geometry, 2)[3];
        alpha *= a * ((1 - weights[0]) - weights[1]) + b * weights[0] + c * weights[1];
    }
    const materials: material_file.Materials(Single) =
        .of(frame.materials.all, .splat(@intCast(face.material)), .splat(true));
    const opacity = material_file.opacity(Single, &materials, .splat(alpha)).lane(0);
    for (&radiance) |*channel| channel.* *= opacity;
    return radiance;
}

test "factors times texels, less what alpha leaves open; hidden lamps have all of it" {
    // Rows of two texels: emission dark and bright, alpha half and full.
    const glow: world_file.Texture = .{
        .levels = &.{.{ .width = 2, .height = 1, .texels = &.{ 0, 0, 0, 255, 255, 0 } }},
        .channel_count = 3,
        .is_srgb = false,
    };
    const cover: world_file.Texture = .{
        .levels = &.{.{ .width = 2, .height = 1, .texels = &.{ 0, 0, 0, 51, 0, 0, 0, 255 } }},
        .channel_count = 4,
        .is_srgb = false,
    };
    var lookups: [2]world_file.Lookup = @splat(.{
        .slot = .emissive,
        .texture = 0,
        .wrap = @splat(.clamp_to_edge),
        .magnify_linear = false,
        .minify_linear = false,
        .has_mips = false,
        .mip_linear = false,
        .texcoord_set = 0,
        .transform = .{ .{ 1, 0, 0 }, .{ 0, 1, 0 } },
        .channels = .{ 0, 1, 2, 3 },
    });
    lookups[0].channels[3] = 255;
    lookups[1].slot = .base_color;
    lookups[1].texture = 1;
    var material: world_file.Material = .{
        .base_color = .{ 1, 1, 1, 0.5 },
        .emissive = .{ 2, 4, 6 },
        .metallic = 0,
        .roughness = 1,
        .dielectric_f0 = 0,
        .ior = 1,
        .transmission = 0,
        .sigma_a = .{ 0, 0, 0 },
        .alpha_cutoff = -1,
        .blend = 0,
        .double_sided = 0,
        .unlit = 0,
        .volume = 0,
        .lookup_count = 2,
    };
    var geometry: world_file.Geometry = .empty;
    geometry.triangles = &.{.{ .corner = .{ 0, 1, 2 }, .material = 0 }};
    geometry.texcoords[0] = &.{ .{ 0, 0 }, .{ 1, 0 }, .{ 0, 1 } };
    const frame: Frame = .{
        .geometry = &geometry,
        .materials = &.{
            .all = (&material)[0..1],
            .lookups = &lookups,
            .has_transparency = true,
            .has_holes = false,
            .occluders = &.{},
        },
        .textures = &.{ .all = &.{ glow, cover } },
        .lights = &.{},
        .environment = &.{ .ambient = 0, .background = @splat(0) },
        .view = &.nowhere,
    };
    const Case = struct { [3]f32, [3]f32 };
    const states = [_]Case{
        // Solid; blended; with holes where alpha is below a third; hidden.
        .{ .{ 0, 0, 0 }, .{ 2, 4, 0 } },
        .{ .{ 0, 0, 0 }, .{ 1, 2, 0 } },
        .{ .{ 0, 0, 0 }, .{ 2, 4, 0 } },
        .{ .{ 0, 0, 0 }, .{ 2, 4, 0 } },
    };
    for (states, 0..) |expected, state| {
        material.blend = if (state == 1 or state == 3) 1 else 0;
        material.alpha_cutoff = if (state == 2) 0.3 else -1;
        material.is_hidden_lamp = state == 3;
        try std.testing.expectEqual(expected[0], radianceAt(&frame, 0, .{ 0.2, 0.5 }));
        try std.testing.expectEqual(expected[1], radianceAt(&frame, 0, .{ 0.8, 0.1 }));
    }
    // A hole: half of 51 / 255.
    lookups[0].texture = 1;
    lookups[0].channels = .{ 3, 3, 3, 255 };
    material.is_hidden_lamp = false;
    material.alpha_cutoff = 0.3;
    material.blend = 0;
    try std.testing.expectEqual([3]f32{ 0, 0, 0 }, radianceAt(&frame, 0, .{ 0.2, 0.5 }));
    material.blend = 1;
    const shown = radianceAt(&frame, 0, .{ 0.2, 0.5 });
    try std.testing.expectApproxEqRel(2 * 0.2 * 0.1, shown[0], 1e-6);
}
