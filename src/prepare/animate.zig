//! A scene at a moment of its animations (glTF 2.0, section 3.11; KHR_animation_pointer).
//!
//! In: a scene with key frames, which animations run, and a time. Out: the same scene, but for the
//! maps of nodes, morph weights, numbers of materials, lights and cameras, which are what
//! `key_frames.zig` makes of theirs.

const std = @import("std");
const math = @import("../math.zig");
const scene = @import("../scene.zig");
const settings = @import("../settings.zig");
const diagnostic_file = @import("../diagnostic.zig");
const key_frames = @import("key_frames.zig");
const pose_file = @import("pose.zig");
const Allocator = std.mem.Allocator;
const AffineD = math.AffineD;
const Diagnostic = diagnostic_file.Diagnostic;
const Frame = key_frames.Frame;
const Scene = scene.Scene;
const Vec3d = math.Vec3d;

/// Animations that are tried, at most, where the scene at rest is not meant to be seen.
const forced_count_max = 16;

/// `AnimationUnknown`: none has that name or index; the diagnostic says more.
pub const Error = error{ OutOfMemory, AnimationUnknown };

/// Which animations run.
pub const Running = union(enum) { none, one: u32, all };

/// What is shown of the animations of a scene.
pub const Moment = struct {
    running: Running = .none,
    time_s: f64 = 0,
    /// Nobody asked for it, but the scene at rest cannot be meant to be seen.
    is_forced: bool = false,
};

/// The moment that is asked for. Where nobody asks it is rest, or the first key frame of the first
/// animation that lets something appear which is not there at rest: because its scale is 0, or all
/// joints of its skin are at one place.
pub fn choose(
    gpa: Allocator,
    from: *const Scene,
    wanted: settings.Animation,
    diagnostic: *Diagnostic,
) Error!Moment {
    const all = from.animations;
    const running: Running = switch (wanted.which) {
        .default => return whereHidden(gpa, from),
        .all => .all,
        .index => |index| if (index < all.len) .{ .one = index } else return unknown(
            all,
            "no animation {d}",
            .{index},
            diagnostic,
        ),
        .name => |name| for (all, 0..) |*animation, index| {
            if (std.mem.eql(u8, animation.name, name)) break .{ .one = @intCast(index) };
        } else return unknown(
            all,
            "no animation {f}",
            .{diagnostic_file.quote(name)},
            diagnostic,
        ),
    };
    return .{ .running = running, .time_s = wanted.time_s };
}

fn unknown(
    all: []const scene.Animation,
    comptime format: []const u8,
    arguments: anytype,
    diagnostic: *Diagnostic,
) error{AnimationUnknown} {
    const list = diagnostic_file.listOf(all);
    return diagnostic.fail(error.AnimationUnknown, format ++ "; {f}", arguments ++ .{list});
}

fn whereHidden(gpa: Allocator, from: *const Scene) error{OutOfMemory}!Moment {
    if (from.animations.len == 0) return .{};
    const count = try hiddenCount(gpa, from);
    if (count == 0) return .{};
    const tried = @min(from.animations.len, forced_count_max);
    for (from.animations[0..tried], 0..) |*animation, index| {
        const span = animation.span() orelse continue;
        var arena_state: std.heap.ArenaAllocator = .init(gpa);
        defer arena_state.deinit();
        const moment: Moment = .{
            .running = .{ .one = @intCast(index) },
            .time_s = span[0],
            .is_forced = true,
        };
        const shown = try at(arena_state.allocator(), from, moment);
        if (try hiddenCount(gpa, &shown) < count) return moment;
    }
    return .{};
}

/// How much of what is drawn has no extent where it is.
fn hiddenCount(gpa: Allocator, from: *const Scene) error{OutOfMemory}!usize {
    const maps = try gpa.alloc(AffineD, from.nodes.len);
    defer gpa.free(maps);
    pose_file.composeNodes(from.nodes, maps);
    const collapsed = try gpa.alloc(bool, from.skins.len);
    defer gpa.free(collapsed);
    for (collapsed, from.skins) |*to, *skin| to.* = isCollapsed(skin, maps);
    var count: usize = 0;
    for (from.instances) |*instance| {
        const is_hidden = if (instance.skin == scene.none)
            maps[instance.node].isPoint()
        else
            collapsed[instance.skin];
        if (is_hidden) count += 1;
    }
    return count;
}

/// Whether the joints, which were bound at several places, are all at one, or all without a size.
fn isCollapsed(skin: *const scene.Skin, maps: []const AffineD) bool {
    var has_size = false;
    var bound: math.Box3 = .empty;
    var placed: math.Box3 = .empty;
    for (skin.joints, skin.inverse_bind_maps) |node, inverse_bind_map| {
        if (!maps[node].isPoint()) has_size = true;
        placed = placed.include(pose_file.round(maps[node].translation));
        const bind_map = inverse_bind_map.inverse() orelse continue;
        bound = bound.include(pose_file.round(bind_map.translation));
    }
    if (!has_size) return skin.joints.len > 0;
    return isSpread(bound) and !isSpread(placed);
}

fn isSpread(box: math.Box3) bool {
    for (box.lower, box.upper) |lower, upper| if (upper > lower) return true;
    return false;
}

/// A scene at the moment that is asked for.
pub const Posed = struct {
    arena: std.heap.ArenaAllocator,
    /// Shares with the scene what does not move; not to be freed.
    scene: Scene,
    moment: Moment,

    /// Frees what moves.
    pub fn deinit(posed: *Posed) void {
        posed.arena.deinit();
        posed.* = undefined;
    }
};

/// See `choose` and `at`.
pub fn pose(
    gpa: Allocator,
    from: *const Scene,
    wanted: settings.Animation,
    diagnostic: *Diagnostic,
) Error!Posed {
    const moment = try choose(gpa, from, wanted, diagnostic);
    var arena: std.heap.ArenaAllocator = .init(gpa);
    errdefer arena.deinit();
    const shown = try at(arena.allocator(), from, moment);
    return .{ .arena = arena, .scene = shown, .moment = moment };
}

/// The scene at a moment. What moves comes from `arena`, all else is still `from`'s.
pub fn at(arena: Allocator, from: *const Scene, moment: Moment) error{OutOfMemory}!Scene {
    var shown = from.*;
    if (moment.running == .none) {
        try hide(arena, &shown);
        return shown;
    }
    var stage: Stage = .{
        .nodes = try arena.dupe(scene.Node, from.nodes),
        .moving = try arena.dupe(scene.MovingNode, from.moving.nodes),
        .is_moved = try arena.alloc(bool, from.moving.nodes.len),
        .shows = try arena.dupe(bool, from.moving.shows),
        .weights = try arena.alloc([]f32, from.moving.weights.len),
        .materials = try arena.dupe(scene.Material, from.materials),
        .lights = try arena.dupe(scene.Light, from.lights),
        .cameras = try arena.dupe(scene.Camera, from.cameras),
    };
    @memset(stage.is_moved, false);
    for (stage.weights, from.moving.weights) |*to, rest| to.* = try arena.dupe(f32, rest);
    for (from.animations, 0..) |*animation, index| {
        if (moment.running == .one and moment.running.one != index) continue;
        for (animation.channels) |*channel| stage.set(channel, moment.time_s);
    }
    stage.finish();
    const instances = try arena.dupe(scene.Instance, from.instances);
    for (instances) |*instance| {
        if (instance.moving_weights == scene.none) continue;
        instance.morph_weights = stage.weights[instance.moving_weights];
    }
    shown.nodes = stage.nodes;
    shown.instances = instances;
    shown.moving = .{
        .nodes = stage.moving,
        .weights = stage.weights,
        .shows = stage.shows,
        .nowhere = from.moving.nowhere,
    };
    shown.materials = stage.materials;
    shown.lights = stage.lights;
    shown.cameras = stage.cameras;
    try hide(arena, &shown);
    return shown;
}

/// What is hidden has no size, and does not shine.
fn hide(arena: Allocator, shown: *Scene) error{OutOfMemory}!void {
    if (shown.moving.shows.len == 0) return;
    const visible = try shown.moving.visibility(arena, shown.nodes);
    shown.instances = try hidden(arena, shown.instances, visible, shown.moving.nowhere);
    var lights: std.ArrayList(scene.Light) = try .initCapacity(arena, shown.lights.len);
    for (shown.lights) |light| {
        if (visible[light.node]) lights.appendAssumeCapacity(light);
    }
    shown.lights = lights.items;
}

/// The instances, of which those that are not visible are put nowhere. From `arena`.
pub fn hidden(
    arena: Allocator,
    instances: []const scene.Instance,
    visible: []const bool,
    nowhere: u32,
) error{OutOfMemory}![]const scene.Instance {
    const placed = try arena.dupe(scene.Instance, instances);
    for (placed) |*instance| {
        if (visible[instance.node]) continue;
        instance.node = nowhere;
        instance.skin = scene.none;
    }
    return placed;
}

/// What moves, while it does.
const Stage = struct {
    nodes: []scene.Node,
    moving: []scene.MovingNode,
    /// By moving node.
    is_moved: []bool,
    shows: []bool,
    weights: [][]f32,
    materials: []scene.Material,
    lights: []scene.Light,
    cameras: []scene.Camera,

    fn set(stage: *Stage, channel: *const scene.Channel, time_s: f64) void {
        const frame: Frame = .of(&channel.sampler, time_s);
        switch (channel.target) {
            .translation => |index| stage.movingNode(index).translation = frame.vector(),
            .rotation => |index| stage.movingNode(index).rotation = frame.rotation(),
            .scale => |index| stage.movingNode(index).scale = frame.vector(),
            .visible => |node| stage.shows[node] = frame.number(0) != 0,
            .weights => |list| for (stage.weights[list], 0..) |*weight, index| {
                weight.* = frame.single(index);
            },
            .weight => |one| stage.weights[one.list][one.index] = frame.single(0),
            .material => |of| setMaterial(&stage.materials[of.material], of.property, &frame),
            .texture => |of| setTexture(&stage.materials[of.material], of.field, of.part, &frame),
            .light => |of| setLight(&stage.lights[of.light], of.property, &frame),
            .camera => |of| setCamera(&stage.cameras[of.camera], of.property, &frame),
        }
    }

    fn movingNode(stage: *Stage, index: u32) *scene.MovingNode {
        stage.is_moved[index] = true;
        return &stage.moving[index];
    }

    /// What is made of several numbers that may move.
    fn finish(stage: *Stage) void {
        for (stage.moving, stage.is_moved) |*moving, is_moved| {
            if (is_moved) stage.nodes[moving.node].local = moving.local();
        }
        for (stage.lights) |*light| {
            if (light.kind == .spot) light.setCone(light.inner_cone_rad, light.outer_cone_rad);
        }
        for (stage.materials) |*material| {
            if (!material.in_motion) continue;
            for (&material.emissive, material.emissive_factor) |*to, factor| {
                to.* = key_frames.singleOf(@as(f64, factor) * material.emissive_strength);
            }
            inline for (scene.texture_fields) |field| if (@field(material, field)) |*view| {
                const is_whole = std.meta.eql(view.parts, .{});
                if (!is_whole) view.transform = view.parts.rows() orelse view.transform;
            };
        }
    }
};

fn setMaterial(
    material: *scene.Material,
    property: scene.MaterialProperty,
    frame: *const Frame,
) void {
    switch (property) {
        .volume => material.volume = frame.single(0) > 0,
        .ior => {
            // See KHR_materials_ior: Fresnel's term is 1.
            const ior = frame.single(0);
            material.ior = if (ior == 0) 1e6 else within(ior, .{ 1, 1e6 });
        },
        .attenuation_distance => {
            const distance = frame.single(0);
            material.attenuation_distance = if (distance > 0) distance else std.math.inf(f32);
        },
        inline else => |tag| {
            const field = &@field(material, @tagName(tag));
            const range = rangeOf(tag);
            if (@TypeOf(field.*) == f32) {
                field.* = within(frame.single(0), range);
            } else for (field, 0..) |*channel, index| {
                channel.* = within(frame.single(index), range);
            }
        },
    }
}

/// Least and largest of the numbers of a material, where they are as the scene has them.
fn rangeOf(property: scene.MaterialProperty) [2]f32 {
    const endless = std.math.floatMax(f32);
    return switch (property) {
        .normal_scale, .clearcoat_normal_scale => .{ -endless, endless },
        .alpha_cutoff, .emissive_strength, .specular_color => .{ 0, endless },
        .dispersion, .iridescence_thickness_min_nm, .iridescence_thickness_max_nm => .{ 0, 1e6 },
        .iridescence_ior => .{ 1, 1e6 },
        .anisotropy_rotation_rad => .{ -1e5, 1e5 },
        .scatter_anisotropy => .{ -0.999, 0.999 },
        else => .{ 0, 1 },
    };
}

fn within(value: f32, range: [2]f32) f32 {
    if (!(value > range[0])) return range[0];
    return if (value < range[1]) value else range[1];
}

fn setTexture(
    material: *scene.Material,
    field: scene.TextureField,
    part: scene.TransformPart,
    frame: *const Frame,
) void {
    switch (field) {
        inline else => |tag| if (@field(material, @tagName(tag))) |*view| switch (part) {
            .offset => view.parts.offset = .{ frame.single(0), frame.single(1) },
            .scale => view.parts.scale = .{ frame.single(0), frame.single(1) },
            .rotation_rad => view.parts.rotation_rad = frame.single(0),
        },
    }
}

fn setLight(light: *scene.Light, property: scene.LightProperty, frame: *const Frame) void {
    const endless = std.math.floatMax(f32);
    switch (property) {
        .color => for (&light.color, 0..) |*channel, index| {
            channel.* = within(frame.single(index), .{ 0, endless });
        },
        .intensity => light.intensity = within(frame.single(0), .{ 0, endless }),
        .range => {
            const range = frame.single(0);
            light.range = if (range > 0) range else std.math.inf(f32);
        },
        .inner_cone_rad => light.inner_cone_rad = frame.single(0),
        .outer_cone_rad => light.outer_cone_rad = frame.single(0),
    }
}

/// A camera that would see nothing stays as it is.
fn setCamera(camera: *scene.Camera, property: scene.CameraProperty, frame: *const Frame) void {
    const value = frame.single(0);
    const least = std.math.floatMin(f32);
    switch (property) {
        .y_fov_rad => if (value >= least and value < std.math.pi) {
            camera.projection.perspective.y_fov_rad = value;
        },
        .aspect => if (value >= least) {
            camera.projection.perspective.aspect = value;
        },
        inline .half_width, .half_height => |tag| if (@abs(value) >= least) {
            @field(camera.projection.orthographic, @tagName(tag)) = @abs(value);
        },
    }
}

const testing = std.testing;

/// One of everything that moves; the caller frees it.
fn testScene(channels: []const scene.Channel) !Scene {
    var builder: scene.Builder = .init(testing.allocator);
    errdefer builder.deinit();
    const root = try builder.addNode(scene.none, .translate(.{ 1, 0, 0 }));
    const node = try builder.addNode(root, .identity);
    const material = try builder.addMaterial(.{
        .in_motion = true,
        .emissive = .{ 2, 0, 4 },
        .emissive_factor = .{ 0.5, 0, 1 },
        .emissive_strength = 4,
        .normal_texture = .{ .texture = 0, .parts = .{ .scale = .{ 2, 2 } } },
    });
    _ = try builder.addTexture(.{ .image = try builder.addImage(.{ .name = "", .bytes = "" }) });
    const mesh = try builder.addMesh(.{
        .positions = &.{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } },
        .triangles = &.{.{ 0, 1, 2 }},
        .material = material,
        .morph_targets = &.{ .{}, .{} },
    });
    try builder.addDeformedInstance(.{
        .mesh = mesh,
        .node = node,
        .morph_weights = &.{ 0.5, 0 },
        .moving_weights = 0,
    });
    try builder.addLight(.{ .kind = .spot, .node = node });
    try builder.addCamera(.{ .name = "", .node = node, .projection = .{
        .perspective = .{ .y_fov_rad = 1, .aspect = null },
    } });
    var made = try builder.finish();
    errdefer made.deinit();
    const arena = made.arena.allocator();
    made.moving = .{
        .nodes = &.{.{
            .node = 1,
            .translation = .{ 0, 2, 0 },
            .rotation = .{ 0, 0, 0, 1 },
            .scale = .{ 1, 1, 1 },
        }},
        .weights = &.{&.{ 0.5, 0 }},
    };
    made.animations = try arena.dupe(scene.Animation, &.{
        .{ .name = "still" }, .{ .name = "all", .channels = channels },
    });
    made.check();
    return made;
}

/// From these numbers at 1 s to twice as much at 3 s.
fn doubling(target: scene.Target, comptime values: []const f32) scene.Channel {
    const doubled = comptime doubled: {
        var all: [2 * values.len]f32 = undefined;
        for (values, 0..) |value, index| {
            all[index] = value;
            all[values.len + index] = 2 * value;
        }
        break :doubled all;
    };
    return .{
        .target = target,
        .sampler = .{
            .times = &.{ 1, 3 },
            .values = &doubled,
            .width = values.len,
            .interpolation = .linear,
        },
    };
}

test "all that moves is as it is at the moment, and the rest as it was" {
    const light: scene.Channel = doubling(
        .{ .light = .{ .light = 0, .property = .outer_cone_rad } },
        &.{1.2},
    );
    var from = try testScene(&.{
        doubling(.{ .scale = 0 }, &.{ 1, 2, 3 }),
        doubling(.{ .weight = .{ .list = 0, .index = 1 } }, &.{-1}),
        doubling(.{ .material = .{ .material = 0, .property = .emissive_strength } }, &.{2}),
        doubling(.{ .material = .{ .material = 0, .property = .base_color } }, &.{ 0.5, 0, 0, 1 }),
        doubling(.{ .material = .{ .material = 0, .property = .volume } }, &.{0.1}),
        doubling(.{ .texture = .{
            .material = 0,
            .field = .normal_texture,
            .part = .offset,
        } }, &.{ 0.5, 0.25 }),
        light,
        doubling(.{ .light = .{ .light = 0, .property = .range } }, &.{-1}),
        doubling(.{ .camera = .{ .camera = 0, .property = .y_fov_rad } }, &.{0.5}),
    });
    defer from.deinit();
    var said: Diagnostic = .{};
    var rest = try pose(testing.allocator, &from, .{}, &said);
    defer rest.deinit();
    try testing.expectEqual(from.nodes.ptr, rest.scene.nodes.ptr);
    try testing.expectEqual(from.materials.ptr, rest.scene.materials.ptr);
    var posed = try pose(testing.allocator, &from, .{ .which = .all, .time_s = 2 }, &said);
    defer posed.deinit();
    const shown = &posed.scene;
    shown.check();
    const map = shown.nodes[1].local;
    try testing.expectEqual(Vec3d{ 0, 2, 0 }, map.translation);
    try testing.expectEqual(Vec3d{ 1.5, 5, 4.5 }, map.point(.{ 1, 1, 1 }));
    try testing.expectEqual(from.nodes[0].local, shown.nodes[0].local);
    try testing.expectEqualSlices(f32, &.{ 0.5, -1.5 }, shown.instances[0].morph_weights);
    const material = &shown.materials[0];
    try testing.expectEqual(math.Vec3{ 1.5, 0, 3 }, material.emissive);
    try testing.expectEqual([4]f32{ 0.75, 0, 0, 1 }, material.base_color);
    try testing.expect(material.volume);
    try testing.expectEqual(
        [2][3]f32{ .{ 2, 0, 0.75 }, .{ 0, 2, 0.375 } },
        material.normal_texture.?.transform,
    );
    try testing.expectEqual(std.math.pi / 2.0, shown.lights[0].outer_cone_rad);
    try testing.expectEqual(std.math.inf(f32), shown.lights[0].range);
    try testing.expectEqual(0.75, shown.cameras[0].projection.perspective.y_fov_rad);
}

test "animations are found by index and name, or the message lists them" {
    var from = try testScene(&.{doubling(.{ .translation = 0 }, &.{ 1, 1, 1 })});
    defer from.deinit();
    const gpa = testing.allocator;
    var said: Diagnostic = .{};
    const named = try choose(gpa, &from, .{ .which = .{ .name = "all" } }, &said);
    try testing.expectEqual(Running{ .one = 1 }, named.running);
    const all = try choose(gpa, &from, .{ .which = .all, .time_s = 4 }, &said);
    try testing.expectEqual(4, all.time_s);
    const wrong: settings.Animation = .{ .which = .{ .name = "al" } };
    try testing.expectError(error.AnimationUnknown, choose(gpa, &from, wrong, &said));
    const list = "no animation 'al'; the file has 0 'still', 1 'all'";
    try testing.expectEqualStrings(list, said.message.text());
    from.animations = &.{};
    const first: settings.Animation = .{ .which = .{ .index = 0 } };
    try testing.expectError(error.AnimationUnknown, choose(gpa, &from, first, &said));
    try testing.expectEqualStrings("no animation 0; the file has none", said.message.text());
}

test "what is not there at rest is seen as the first animation begins that shows it" {
    const gpa = testing.allocator;
    var said: Diagnostic = .{};
    var from = try testScene(&.{doubling(.{ .scale = 0 }, &.{ 1, 1, 1 })});
    defer from.deinit();
    try testing.expectEqual(Running.none, (try choose(gpa, &from, .{}, &said)).running);
    const nodes = try from.arena.allocator().dupe(scene.Node, from.nodes);
    nodes[1].local = .scale(.{ 0, 0, 0 });
    from.nodes = nodes;
    const moment = try choose(gpa, &from, .{}, &said);
    try testing.expectEqual(Moment{
        .running = .{ .one = 1 },
        .time_s = 1,
        .is_forced = true,
    }, moment);
    // Nothing is gained by animations that leave it as it is.
    nodes[0].local = .scale(.{ 0, 0, 0 });
    try testing.expectEqual(Running.none, (try choose(gpa, &from, .{}, &said)).running);
}

test "joints that are all at one place at rest, but were bound at several, are not seen so" {
    const skin: scene.Skin = .{
        .joints = &.{ 0, 1 },
        .inverse_bind_maps = &.{ .identity, .translate(.{ 0, -1, 0 }) },
    };
    try testing.expect(isCollapsed(&skin, &.{ .identity, .identity }));
    try testing.expect(!isCollapsed(&skin, &.{ .identity, .translate(.{ 0, 1, 0 }) }));
    try testing.expect(isCollapsed(&skin, &.{ .scale(@splat(0)), .scale(@splat(0)) }));
    const together: scene.Skin = .{
        .joints = &.{ 0, 1 },
        .inverse_bind_maps = &.{ .identity, .identity },
    };
    try testing.expect(!isCollapsed(&together, &.{ .identity, .identity }));
}

test {
    _ = key_frames;
}
