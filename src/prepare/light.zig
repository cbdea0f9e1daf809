//! Lights and environment: where they are in the world, and what there is without them.
//!
//! In: a scene's lights and the world maps of their nodes, or none of them and a camera. Out:
//! lights in world space, ambient and background. Scale of nodes does not count, as
//! KHR_lights_punctual says. A scene without lights gets three that move with the camera.

const std = @import("std");
const math = @import("../math.zig");
const scene = @import("../scene.zig");
const settings = @import("../settings.zig");
const pose = @import("pose.zig");
const world = @import("../world.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const assert = std.debug.assert;
const vec3 = math.vec3;
const vec3d = math.vec3d;
const AffineD = math.AffineD;
const Vec3 = math.Vec3;

/// One light of the default rig: the way it travels in the camera's right, up and forward, and its
/// illuminance in lux.
const RigLight = struct { travel: Vec3, lux: f32 };

/// Key from the upper left, fill from the right and a little above, rim from behind and above.
const rig = [_]RigLight{
    .{ .travel = .{ 0.6, -1, 0.5 }, .lux = 2.5 },
    .{ .travel = .{ -0.9, -0.1, 0.5 }, .lux = 0.8 },
    .{ .travel = .{ -0.25, -0.6, -0.8 }, .lux = 1.2 },
};

/// The scene's lights that shine somewhere, from `arena`; a light whose node leaves it no
/// direction is left out with a warning.
pub fn place(
    arena: std.mem.Allocator,
    lights: []const scene.Light,
    maps: []const AffineD,
    geometry: *const world.Geometry,
    diagnostic: *Diagnostic,
) error{OutOfMemory}![]world.Light {
    const placed = try arena.alloc(world.Light, lights.len);
    var placed_count: usize = 0;
    for (lights, 0..) |*light, index| {
        placed[placed_count] = placeOne(light, maps[light.node], geometry) orelse {
            diagnostic.warn("light {d} left out: its node leaves it no place or direction", .{
                index,
            });
            continue;
        };
        placed_count += 1;
    }
    assert(placed_count <= lights.len);
    return placed[0..placed_count];
}

fn placeOne(
    light: *const scene.Light,
    map: AffineD,
    geometry: *const world.Geometry,
) ?world.Light {
    const direction: Vec3 = switch (light.kind) {
        .point => .{ 0, 0, -1 }, // Unused, but a unit vector.
        .spot, .directional => pose.round(vec3d.normalize(vec3d.neg(map.z)) orelse return null),
    };
    const position: Vec3 = switch (light.kind) {
        .point, .spot => pose.round(map.translation),
        .directional => .{ 0, 0, 0 },
    };
    if (!vec3.isFinite(position)) return null;
    var result: world.Light = .{
        .kind = switch (light.kind) {
            .point => .point,
            .spot => .spot,
            .directional => .directional,
        },
        .from_receiver = light.kind != .directional and geometry.isCoarseAt(position),
        .position = position,
        .direction = direction,
        .intensity = undefined,
        .range_inv_squared = 0,
        .cone_scale = 0,
        .cone_offset = 1,
    };
    for (&result.intensity, light.color) |*channel, color| {
        channel.* = finite(@as(f64, color) * light.intensity);
    }
    if (light.kind != .directional and light.range < std.math.inf(f32)) {
        assert(light.range > 0);
        result.range_inv_squared = finite(1 / (@as(f64, light.range) * light.range));
    }
    if (light.kind == .spot) {
        // KHR_lights_punctual, "Inner and Outer Cone Angles".
        const cosine_inner = math.elementary.cos(light.inner_cone_rad);
        const cosine_outer = math.elementary.cos(light.outer_cone_rad);
        const difference = cosine_inner - cosine_outer;
        const scale = 1 / if (difference > 0.001) difference else 0.001;
        result.cone_scale = @floatCast(scale);
        result.cone_offset = @floatCast(-cosine_outer * scale);
    }
    return result;
}

/// The nearest f32 that is not infinite.
fn finite(value: f64) f32 {
    const largest: f64 = std.math.floatMax(f32);
    assert(value >= 0);
    return @floatCast(if (value < largest) value else largest);
}

/// The three lights of a scene without any, from `arena`. Asserts that the camera's axes are not
/// zero.
pub fn placeRig(
    arena: std.mem.Allocator,
    camera: *const world.Camera,
) error{OutOfMemory}![]world.Light {
    const right = vec3.normalize(camera.right).?;
    const up = vec3.normalize(camera.up).?;
    const forward = vec3.normalize(camera.forward).?;
    const lights = try arena.alloc(world.Light, rig.len);
    for (rig, lights) |from, *light| {
        const sideways = vec3.add(
            vec3.scale(right, from.travel[0]),
            vec3.scale(up, from.travel[1]),
        );
        const travel = vec3.add(sideways, vec3.scale(forward, from.travel[2]));
        light.* = .{
            .kind = .directional,
            .from_receiver = false,
            .position = .{ 0, 0, 0 },
            .direction = vec3.normalize(travel).?,
            .intensity = @splat(from.lux),
            .range_inv_squared = 0,
            .cone_scale = 0,
            .cone_offset = 1,
        };
    }
    return lights;
}

/// Ambient light and background: the default rig comes with a grey of both, lights of the file
/// with black, the scene may say what is ambient, and the user has the last word.
pub fn environment(
    lights_are_default: bool,
    scene_ambient: ?f32,
    ambient: ?f32,
    background: ?Vec3,
) world.Environment {
    const radiance = ambient orelse scene_ambient orelse
        if (lights_are_default) settings.ambient_default else 0;
    assert(radiance >= 0);
    const shown: f32 = if (lights_are_default) radiance else 0;
    return .{ .ambient = radiance, .background = background orelse @splat(shown) };
}

/// A map, and how it is placed around the scene.
pub const EnvironmentSettings = struct {
    map: ?*const world.EnvironmentMap = null,
    /// Nobody asked for it.
    is_default: bool = false,
    /// Turns with the camera.
    is_studio: bool = false,
    /// From the world's directions to those of the map, before any rotation.
    to_map: AffineD = .identity,
    scale: Vec3 = .{ 1, 1, 1 },
    /// See `settings.Environment`.
    rotation_deg: ?f32 = null,
    /// Primary rays see it.
    is_seen: bool = false,
    shadow_count: u32 = 0,
};

/// Puts a map, if there is one, around what the camera sees.
pub fn addMap(
    to: *world.Environment,
    chosen: *const EnvironmentSettings,
    camera: *const world.Camera,
) void {
    to.is_seen = chosen.is_seen;
    to.map = chosen.map orelse return;
    to.scale = chosen.scale;
    to.shadow_count = chosen.shadow_count;
    // Cosine and sine of the turn.
    const turn: [2]f64 = if (chosen.rotation_deg) |degrees| turn: {
        const angle_rad = @as(f64, degrees) * (std.math.pi / 180.0);
        break :turn .{ math.elementary.cos(angle_rad), math.elementary.sin(angle_rad) };
    } else if (chosen.is_studio) azimuth(camera) else .{ 1, 0 };
    const back: [3]math.Vec3d = .{
        .{ turn[0], 0, -turn[1] },
        .{ 0, 1, 0 },
        .{ turn[1], 0, turn[0] },
    };
    const map = &chosen.to_map;
    for (&to.to_map, 0..) |*row, axis| {
        const first = vec3d.scale(back[0], map.x[axis]);
        const second = vec3d.scale(back[1], map.y[axis]);
        const third = vec3d.scale(back[2], map.z[axis]);
        row.* = pose.round(vec3d.add(vec3d.add(first, second), third));
    }
}

/// Height of a plane just below all that there is; null where that is nothing.
pub fn floorOf(geometry: *const world.Geometry) ?f32 {
    if (geometry.bounds.isEmpty()) return null;
    return geometry.bounds.lower[1] - geometry.size * floor_gap;
}

/// Share of the scene's size: so near that no light is seen between the two, and yet so far that
/// rounding puts no shadow on all of the plane.
const floor_gap = 0x1p-12;

/// Cosine and sine of the turn about y that a camera has which looked along -z; of one that looks
/// straight up or down by its upper side.
fn azimuth(camera: *const world.Camera) [2]f64 {
    const forward = vec3.normalize(camera.forward).?;
    const up = vec3.normalize(camera.up).?;
    // The upper side leans away from where it looks up to, and over to it where it looks down.
    const lean: f32 = if (forward[1] > 0) -1 else 1;
    const level = vec3.add(forward, vec3.scale(up, lean * @abs(forward[1])));
    const flat = vec3d.normalize(.{ level[0], 0, level[2] }) orelse return .{ 1, 0 };
    return .{ -flat[2], -flat[0] };
}

test "a spot shines along its node's -z from its node's origin, scale aside" {
    const half = @sqrt(@as(f32, 0.5)); // A quarter turn about y: -z becomes -x.
    const maps = [_]AffineD{
        .fromTrs(.{ 1, 2, 3 }, .{ 0, half, 0, half }, .{ 5, 5, 5 }),
        .fromTrs(.{ 0, 0, 0 }, .{ 0, 0, 0, 1 }, .{ 1, 1, 0 }),
    };
    const lights = [_]scene.Light{
        .{ .kind = .spot, .node = 0, .color = .{ 1, 0.5, 0 }, .intensity = 8, .range = 4 },
        .{ .kind = .directional, .node = 1 },
        .{ .kind = .point, .node = 1 },
    };
    var arena_state: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena_state.deinit();
    var diagnostic: Diagnostic = .{};
    var geometry: world.Geometry = .empty;
    geometry.size = 1;
    const placed = try place(arena_state.allocator(), &lights, &maps, &geometry, &diagnostic);
    // The flattened directional light has no direction; the point light needs none.
    try std.testing.expectEqual(2, placed.len);
    try std.testing.expectEqual(1, diagnostic.warning_count);
    const spot = placed[0];
    try std.testing.expectEqual(Vec3{ 1, 2, 3 }, spot.position);
    try std.testing.expectApproxEqAbs(@as(f32, -1), spot.direction[0], 1e-6);
    try std.testing.expectEqual(Vec3{ 8, 4, 0 }, spot.intensity);
    try std.testing.expectEqual(0.0625, spot.range_inv_squared);
    // Full at the inner cone (the axis), dark at the outer one.
    const cosine_outer = @sqrt(@as(f32, 0.5));
    try std.testing.expectApproxEqAbs(@as(f32, 1), spot.cone_scale + spot.cone_offset, 1e-6);
    const edge = cosine_outer * spot.cone_scale + spot.cone_offset;
    try std.testing.expectApproxEqAbs(@as(f32, 0), edge, 1e-6);
    try std.testing.expectEqual(world.Light.Kind.point, placed[1].kind);
}

test "cones of equal angles have an edge, and those of a right angle end at it" {
    const maps = [_]AffineD{.identity};
    const lights = [_]scene.Light{
        .{ .kind = .spot, .node = 0, .inner_cone_rad = 0.5, .outer_cone_rad = 0.5 },
        .{ .kind = .spot, .node = 0, .outer_cone_rad = std.math.pi / 2.0 },
    };
    var arena_state: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena_state.deinit();
    var diagnostic: Diagnostic = .{};
    var geometry: world.Geometry = .empty;
    geometry.size = 1;
    const placed = try place(arena_state.allocator(), &lights, &maps, &geometry, &diagnostic);
    // KHR_lights_punctual: 1 / max(0.001, cos inner - cos outer).
    try std.testing.expectApproxEqRel(@as(f32, 1000), placed[0].cone_scale, 1e-6);
    const cosine = @cos(@as(f32, 0.5));
    for ([_]f32{ 0, 0.001 }, [_]f32{ 0, 1 }) |beyond, share| {
        const ramp = (cosine + beyond) * placed[0].cone_scale + placed[0].cone_offset;
        try std.testing.expectApproxEqAbs(share, ramp, 1e-3);
    }
    // The cosine itself.
    try std.testing.expectApproxEqAbs(@as(f32, 1), placed[1].cone_scale, 1e-6);
    try std.testing.expectApproxEqAbs(@as(f32, 0), placed[1].cone_offset, 1e-6);
}

test "the rig turns with the camera" {
    var arena_state: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena_state.deinit();
    var camera: world.Camera = .{
        .orthographic = false,
        .origin = .{ 5, 5, 5 },
        .right = .{ 0.5, 0, 0 },
        .up = .{ 0, 0.25, 0 },
        .forward = .{ 0, 0, -1 },
    };
    const front = try placeRig(arena_state.allocator(), &camera);
    camera.right = .{ 0, 0, -0.5 }; // A quarter turn to the left.
    camera.forward = .{ -1, 0, 0 };
    const side = try placeRig(arena_state.allocator(), &camera);
    for (front, side) |a, b| {
        const turned: Vec3 = .{ -b.direction[2], b.direction[1], b.direction[0] };
        try std.testing.expectEqual(a.direction, turned);
        try std.testing.expectApproxEqAbs(@as(f32, 1), vec3.length(a.direction), 1e-6);
    }
    // The key falls on what faces the camera, from above.
    try std.testing.expect(front[0].direction[2] < 0 and front[0].direction[1] < 0);
}

test "ambient and background by their precedence" {
    try std.testing.expectEqual(
        world.Environment{ .ambient = 0.35, .background = @splat(0.35) },
        environment(true, null, null, null),
    );
    try std.testing.expectEqual(
        world.Environment{ .ambient = 0, .background = @splat(0) },
        environment(false, null, null, null),
    );
    try std.testing.expectEqual(
        world.Environment{ .ambient = 0.25, .background = @splat(0) },
        environment(false, 0.25, null, null),
    );
    try std.testing.expectEqual(
        world.Environment{ .ambient = 0.5, .background = .{ 1, 0, 0 } },
        environment(false, 0.25, 0.5, .{ 1, 0, 0 }),
    );
}
