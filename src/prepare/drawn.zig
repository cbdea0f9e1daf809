//! What is drawn of a scene at a moment, in place of what was loaded once: morph weights, and
//! materials with how they look textures up, what is hidden.
//!
//! In: the scene at that moment, and what was loaded of it, where nothing that a moving material
//! may want has been left out. Out: the same but for instances and materials that move. What a
//! material's numbers leave without a say now is not looked up. Tangents stay as they were made for
//! the transforms of textures at rest.

const std = @import("std");
const animate = @import("animate.zig");
const scene = @import("../scene.zig");
const texture_use = @import("texture_use.zig");
const world = @import("../world.zig");
const Allocator = std.mem.Allocator;
const Parts = @import("alpha.zig").Parts;
const TextureSet = @import("texture.zig").TextureSet;
const Drawn = @This();

parts: Parts,
/// Not to be freed.
textures: TextureSet,

/// New arrays come from `arena`.
pub fn of(
    arena: Allocator,
    from: *const scene.Scene,
    parts: *const Parts,
    textures: *const TextureSet,
) error{OutOfMemory}!Drawn {
    var drawn: Drawn = .{ .parts = parts.*, .textures = textures.* };
    if (from.moving.weights.len > 0) {
        const instances = try arena.dupe(scene.Instance, parts.instances);
        for (instances) |*instance| {
            if (instance.moving_weights == scene.none) continue;
            instance.morph_weights = from.moving.weights[instance.moving_weights];
        }
        drawn.parts.instances = instances;
    }
    if (from.moving.shows.len > 0) {
        const visible = try from.moving.visibility(arena, from.nodes);
        const instances = drawn.parts.instances;
        const nowhere = from.moving.nowhere;
        drawn.parts.instances = try animate.hidden(arena, instances, visible, nowhere);
    }
    for (from.materials) |*material| {
        if (material.in_motion) break;
    } else return drawn;
    try drawn.moveMaterials(arena, from);
    return drawn;
}

fn moveMaterials(
    drawn: *Drawn,
    arena: Allocator,
    from: *const scene.Scene,
) error{OutOfMemory}!void {
    const before = drawn.textures;
    const materials = try arena.dupe(scene.Material, drawn.parts.materials);
    const uses = try arena.dupe(std.meta.Elem(@TypeOf(before.materials)), before.materials);
    var lookups: std.ArrayList(world.Lookup) = try .initCapacity(arena, before.lookups.len);
    for (materials, uses, drawn.parts.sources, 0..) |*material, *use, source, index| {
        const own = before.lookupsOf(@intCast(index));
        use.first_lookup = @intCast(lookups.items.len);
        const moved = &from.materials[source];
        if (!moved.in_motion) {
            lookups.appendSliceAssumeCapacity(own);
            continue;
        }
        material.* = moved.*;
        material.in_motion = false;
        // Where none were made there is nothing to turn about.
        if (use.tangents == null) material.anisotropy = 0;
        use.lookup_count = 0;
        use.layer_lookup_count = 0;
        for (own) |lookup| {
            const view = viewOf(material, lookup.slot) orelse continue;
            var placed = lookup;
            placed.transform = view.transform;
            lookups.appendAssumeCapacity(placed);
            if (lookup.slot.isOfLayers()) use.layer_lookup_count += 1 else use.lookup_count += 1;
        }
    }
    drawn.parts.materials = materials;
    drawn.textures.materials = uses;
    drawn.textures.lookups = lookups.items;
}

fn viewOf(material: *const scene.Material, slot: world.Slot) ?scene.TextureView {
    for (std.enums.values(texture_use.Use)) |use| {
        if (use.slot() != slot) continue;
        if (texture_use.viewOf(material, use)) |view| return view;
    }
    return null;
}

const testing = std.testing;

fn testLookup(slot: world.Slot) world.Lookup {
    var lookup = std.mem.zeroes(world.Lookup);
    lookup.slot = slot;
    return lookup;
}

test "materials that move are looked up as they are now, the others as they were loaded" {
    var arena_state: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena_state.deinit();
    const offset: scene.TextureView = .{
        .texture = 0,
        .transform = .{ .{ 1, 0, 0.5 }, .{ 0, 1, 0 } },
    };
    const still: scene.Material = .{ .roughness = 0.25 };
    const moved: scene.Material = .{
        .base_color_texture = offset,
        .emissive_texture = offset,
        .metallic = 0.5,
        .in_motion = true,
    };
    var from: scene.Scene = .init(testing.allocator);
    defer from.deinit();
    from.materials = &.{ still, moved };
    from.moving.weights = &.{&.{ 0.5, 1 }};
    const lookups = [_]world.Lookup{
        testLookup(.normal), testLookup(.base_color), testLookup(.emissive),
    };
    const textures: TextureSet = .{
        .arena = undefined,
        .pyramids = &.{},
        .textures = .{ .all = &.{} },
        .lookups = &lookups,
        .materials = &.{ .{ .lookup_count = 1 }, .{ .first_lookup = 1, .lookup_count = 2 } },
        .byte_count = 0,
    };
    const drawn: Drawn = try .of(arena_state.allocator(), &from, &.{
        .sources = &.{ 0, 1 },
        .materials = &.{ .{ .roughness = 0.25 }, .{} },
        .meshes = &.{},
        .instances = &.{
            .{ .mesh = 0, .node = 0, .morph_weights = &.{ 0, 0 }, .moving_weights = 0 },
            .{ .mesh = 0, .node = 0, .morph_weights = &.{ 0, 2 } },
        },
    }, &textures);
    try testing.expectEqual(0.25, drawn.parts.materials[0].roughness);
    try testing.expectEqual(0.5, drawn.parts.materials[1].metallic);
    try testing.expectEqual(2, drawn.textures.lookups.len);
    try testing.expectEqual(world.Slot.normal, drawn.textures.lookupsOf(0)[0].slot);
    // It does not emit, so its emission is not looked up.
    const own = drawn.textures.lookupsOf(1);
    try testing.expectEqual(1, own.len);
    try testing.expectEqual(0.5, own[0].transform[0][2]);
    try testing.expectEqualSlices(f32, &.{ 0.5, 1 }, drawn.parts.instances[0].morph_weights);
    try testing.expectEqualSlices(f32, &.{ 0, 2 }, drawn.parts.instances[1].morph_weights);
}
