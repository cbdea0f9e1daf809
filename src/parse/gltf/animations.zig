//! Animations (glTF 2.0, section 3.11; KHR_animation_pointer): what moves in a file, and by which
//! key frames.
//!
//! In: the JSON text's channels and samplers, which cgltf reads only in part. Out: the scene's
//! animations, one for each of the file's, and what they move as it is at rest. Nothing here
//! refuses a file: a channel that cannot be read is left out with a warning. `read` comes before
//! meshes and materials, which have to know what moves; `finish` once all that may move is in the
//! scene.

const std = @import("std");
const extension_text = @import("extension_text.zig");
const accessors = @import("../accessor.zig");
const gltf_accessors = @import("accessors.zig");
const math = @import("../../math.zig");
const nodes = @import("nodes.zig");
const pointers = @import("animation_pointers.zig");
const quote = @import("../../diagnostic.zig").quote;
const scene = @import("../../scene.zig");
const Error = Source.Error;
const Materials = @import("materials.zig");
const Property = pointers.Property;
const Source = @import("source.zig");
const assert = std.debug.assert;
const Animations = @This();

source: *Source,
scratch: std.heap.ArenaAllocator,
list: []const Text = &.{},
/// Those that can be read, in the order of the file.
channels: std.ArrayList(Channel) = .empty,
/// By accessor.
decoded: std.AutoHashMapUnmanaged(u32, Decoded) = .empty,
/// By node, or mesh: which of the weights some key is not 0 of.
node_targets: std.AutoHashMapUnmanaged(u32, []bool) = .empty,
mesh_targets: std.AutoHashMapUnmanaged(u32, []bool) = .empty,
/// By material of the file.
moves_material: []bool = &.{},
/// By node of the file: the list of weights of what it draws.
list_of: std.AutoHashMapUnmanaged(u32, u32) = .empty,
lists: std.ArrayList([]const f32) = .empty,
/// By light and camera of the scene: the file's.
lights: std.ArrayList(u32) = .empty,
cameras: std.ArrayList(u32) = .empty,

/// As the file has it.
const Text = struct {
    name: []const u8 = "",
    channels: []const struct {
        sampler: u64,
        target: struct {
            node: ?u32 = null,
            path: []const u8 = "",
            extensions: struct {
                KHR_animation_pointer: ?struct { pointer: []const u8 = "" } = null,
            } = .{},
        } = .{},
    } = &.{},
    samplers: []const struct {
        input: u32,
        output: u32,
        interpolation: []const u8 = "LINEAR",
        /// It has been said why.
        left_out: bool = false,
    } = &.{},

    const Target = @FieldType(std.meta.Elem(@FieldType(Text, "channels")), "target");
};

const Channel = struct { animation: u32, sampler: scene.Sampler, property: Property };

/// Numbers of an accessor, or why there are none.
const Decoded = struct {
    numbers: []const f32 = &.{},
    width: u32 = 1,
    wrong: []const u8 = "",
    /// Each of the numbers and the next one.
    order: enum { rises, repeats, falls } = .rises,
};

/// Of a channel, for messages.
const Place = struct {
    animation: usize,
    channel: usize,

    /// Called by `{f}`.
    pub fn format(place: Place, writer: *std.Io.Writer) std.Io.Writer.Error!void {
        try writer.print("animation {d}, channel {d}", .{ place.animation, place.channel });
    }
};

/// Reads the channels of a JSON text that has been checked; null: it has none.
pub fn read(source: *Source, with_animations: ?[]const u8) Error!Animations {
    var animations: Animations = .{ .source = source, .scratch = .init(source.gpa) };
    errdefer animations.deinit();
    const text = with_animations orelse return animations;
    const Document = struct { animations: []const Text = &.{} };
    const parsed = try extension_text.parse(Document, animations.scratch.allocator(), text);
    const document = parsed orelse {
        source.forgive("its animations are not as they should be, left out", .{});
        return animations;
    };
    animations.list = document.animations;
    animations.moves_material = try source.gpa.alloc(bool, source.data.materials_count);
    @memset(animations.moves_material, false);
    var unknown: Unknown = .{};
    for (animations.list, 0..) |*animation, index| {
        for (0..animation.channels.len) |channel| {
            try animations.readChannel(.{ .animation = index, .channel = channel }, &unknown);
        }
    }
    if (unknown.count > 0) source.warn(
        "{d} channels of animations move what is not rendered: the first {f}",
        .{ unknown.count, quote(unknown.first) },
    );
    return animations;
}

/// Pointers to what is not rendered.
const Unknown = struct { first: []const u8 = "", count: usize = 0 };

/// Frees what is not the scene's.
pub fn deinit(animations: *Animations) void {
    const gpa = animations.source.gpa;
    inline for (.{ "channels", "decoded", "list_of", "lists", "lights", "cameras" }) |name| {
        @field(animations, name).deinit(gpa);
    }
    inline for (.{ "node_targets", "mesh_targets" }) |name| {
        var all = @field(animations, name).valueIterator();
        while (all.next()) |flags| gpa.free(flags.*);
        @field(animations, name).deinit(gpa);
    }
    gpa.free(animations.moves_material);
    animations.scratch.deinit();
    animations.* = undefined;
}

fn readChannel(animations: *Animations, place: Place, unknown: *Unknown) Error!void {
    const source = animations.source;
    const text = &animations.list[place.animation];
    const channel = &text.channels[place.channel];
    const property = animations.propertyOf(place, &channel.target, unknown) orelse return;
    const width = widthOf(source, property) orelse return source.forgive(
        "{f}: moves what is not there, left out",
        .{place},
    );
    if (channel.sampler >= text.samplers.len) return source.forgive(
        "{f}: there is no sampler {d}, left out",
        .{ place, channel.sampler },
    );
    const index: u32 = @intCast(channel.sampler);
    if (text.samplers[index].left_out) return;
    const sampler = try animations.readSampler(place, index, width) orelse return;
    try animations.channels.append(source.gpa, .{
        .animation = @intCast(place.animation),
        .sampler = sampler,
        .property = property,
    });
    switch (property) {
        .weights => |node| try note(source, &animations.node_targets, node, width, 0, &sampler),
        .mesh_weights => |mesh| {
            try note(source, &animations.mesh_targets, mesh, width, 0, &sampler);
        },
        .weight => |one| {
            const count = targetCount(source, meshOf(source, one.index).?);
            try note(source, &animations.node_targets, one.index, count, one.element, &sampler);
        },
        .mesh_weight => |one| {
            const count = targetCount(source, one.index);
            try note(source, &animations.mesh_targets, one.index, count, one.element, &sampler);
        },
        inline .material, .texture => |of| animations.moves_material[of.index] = true,
        .visible => source.keeps_hidden = true,
        else => {},
    }
}

/// Notes which of the weights from `first` on are not always 0.
fn note(
    source: *Source,
    map: *std.AutoHashMapUnmanaged(u32, []bool),
    owner: u32,
    count: u32,
    first: u32,
    sampler: *const scene.Sampler,
) Error!void {
    try source.charge(sampler.values.len * @sizeOf(f32)); // Channels may share them.
    const entry = try map.getOrPut(source.gpa, owner);
    if (!entry.found_existing) {
        errdefer _ = map.remove(owner);
        entry.value_ptr.* = try source.gpa.alloc(bool, count);
        @memset(entry.value_ptr.*, false);
    }
    for (sampler.values, 0..) |number, index| {
        if (number != 0) entry.value_ptr.*[first + index % sampler.width] = true;
    }
}

/// Null, with a warning where it is due, for what is left out.
fn propertyOf(
    animations: *const Animations,
    place: Place,
    target: *const Text.Target,
    unknown: *Unknown,
) ?Property {
    if (target.extensions.KHR_animation_pointer) |extension| {
        const property = pointers.parse(extension.pointer) orelse {
            if (unknown.count == 0) unknown.first = extension.pointer;
            unknown.count += 1;
            return null;
        };
        return if (property == .unseen) null else property;
    }
    // Without a node it is somebody else's (glTF 2.0, section 3.11).
    const node = target.node orelse return null;
    inline for (.{ "translation", "rotation", "scale", "weights" }) |name| {
        if (std.mem.eql(u8, target.path, name)) return @unionInit(Property, name, node);
    }
    animations.source.forgive("{f}: the path {f} is not known, left out", .{
        place, quote(target.path),
    });
    return null;
}

/// How many numbers a value has; null where there is nothing of the kind.
fn widthOf(source: *const Source, property: Property) ?u32 {
    const data = source.data;
    return switch (property) {
        .translation, .scale => |node| if (node < data.nodes_count) 3 else null,
        .rotation => |node| if (node < data.nodes_count) 4 else null,
        .visible => |node| if (node < data.nodes_count) 1 else null,
        .weights => |node| notZero(targetCount(source, meshOf(source, node) orelse return null)),
        .mesh_weights => |mesh| notZero(targetCount(source, mesh)),
        .weight => |one| {
            const mesh = meshOf(source, one.index) orelse return null;
            return if (one.element < targetCount(source, mesh)) 1 else null;
        },
        .mesh_weight => |one| if (one.element < targetCount(source, one.index)) 1 else null,
        .material => |of| if (of.index < data.materials_count) of.property.width() else null,
        .texture => |of| if (of.index >= data.materials_count)
            null
        else if (of.part == .rotation_rad) 1 else 2,
        .light => |of| if (of.index >= data.lights_count)
            null
        else if (of.property == .color) 3 else 1,
        .camera => |of| if (of.index < data.cameras_count) 1 else null,
        .unseen => unreachable, // Nobody asks.
    };
}

fn notZero(count: u32) ?u32 {
    return if (count > 0) count else null;
}

fn meshOf(source: *const Source, node: u32) ?u32 {
    if (node >= source.data.nodes_count) return null;
    const mesh = Source.item(source.data.nodes, node).mesh orelse return null;
    return Source.indexOf(source.data.meshes, mesh);
}

/// Morph targets of a mesh.
fn targetCount(source: *const Source, mesh: u32) u32 {
    if (mesh >= source.data.meshes_count) return 0;
    const raw = Source.item(source.data.meshes, mesh);
    const primitives = Source.slice(raw.primitives, raw.primitives_count);
    return if (primitives.len > 0) @intCast(primitives[0].targets_count) else 0;
}

/// Key frames of `width` numbers; null, with a warning, where they cannot be read.
fn readSampler(animations: *Animations, place: Place, index: u32, width: u32) Error!?scene.Sampler {
    const source = animations.source;
    const text = &animations.list[place.animation].samplers[index];
    const keys = try animations.decode(text.input);
    const values = try animations.decode(text.output);
    const wrong = if (keys.wrong.len > 0)
        keys.wrong
    else if (values.wrong.len > 0)
        values.wrong
    else if (keys.width != 1)
        "times are single numbers"
    else
        "";
    if (wrong.len > 0) {
        source.forgive("{f}: sampler {d}: {s}, left out", .{ place, index, wrong });
        return null;
    }
    const interpolation: scene.Interpolation =
        if (std.mem.eql(u8, text.interpolation, "STEP"))
            .step
        else if (std.mem.eql(u8, text.interpolation, "CUBICSPLINE")) .cubic_spline else .linear;
    if (interpolation == .linear and !std.mem.eql(u8, text.interpolation, "LINEAR")) source.forgive(
        "{f}: sampler {d}: the interpolation {f} is not known, taken as LINEAR",
        .{ place, index, quote(text.interpolation) },
    );
    if (keys.order == .falls) {
        source.forgive("{f}: sampler {d}: its times fall, left out", .{ place, index });
        return null;
    }
    if (keys.order == .repeats)
        source.forgive("{f}: sampler {d}: has two keys at one time", .{ place, index });
    const times = keys.numbers;
    const parts: u64 = if (interpolation == .cubic_spline) 3 else 1;
    // Weights are single numbers in a row.
    const fits = values.width == width or values.width == 1;
    if (!fits or values.numbers.len != times.len * parts * width) {
        source.forgive("{f}: sampler {d}: {d} times with {d} values of {d} numbers, left out", .{
            place, index, times.len, values.numbers.len / values.width, values.width,
        });
        return null;
    }
    return .{
        .times = times,
        .values = values.numbers,
        .width = width,
        .interpolation = interpolation,
    };
}

/// The numbers of an accessor of times or values.
fn decode(animations: *Animations, index: u32) Error!Decoded {
    const source = animations.source;
    if (animations.decoded.get(index)) |known| return known;
    const result = try animations.decodeNew(index);
    try animations.decoded.put(source.gpa, index, result);
    return result;
}

fn decodeNew(animations: *Animations, index: u32) Error!Decoded {
    const source = animations.source;
    if (index >= source.data.accessors_count) return .{ .wrong = "names no accessor" };
    if (source.findBroken(.accessors, index)) |broken| return .{ .wrong = broken.reason };
    const resolved = gltf_accessors.resolve(source, index) catch |err| {
        const line = try source.takeLine(err);
        return .{ .wrong = try animations.scratch.allocator().dupe(u8, line.text()) };
    };
    const accessor = resolved orelse return .{ .wrong = "has no data, or only compressed data" };
    const width = accessor.component_count;
    try source.charge(@as(u64, accessor.count) * width * @sizeOf(f32));
    switch (width) {
        inline 1, 2, 3, 4 => |known| {
            const rows = try source.arena.alloc([known]f32, accessor.count);
            const bad = accessors.decodeFloats(known, accessor, rows);
            if (bad != null) return .{ .wrong = "has numbers that are not finite" };
            const numbers: [*]const f32 = @ptrCast(rows);
            var decoded: Decoded = .{ .numbers = numbers[0 .. rows.len * known], .width = known };
            if (known > 1) return decoded;
            for (decoded.numbers[1..], numbers[0 .. rows.len - 1]) |next, number| {
                if (next < number) decoded.order = .falls;
                if (next == number and decoded.order == .rises) decoded.order = .repeats;
            }
            return decoded;
        },
        else => return .{ .wrong = "has matrices" },
    }
}

/// Which weights of what a node draws move, or null.
pub fn targetsOf(animations: *const Animations, node: u32) [2]?[]const bool {
    const source = animations.source;
    const has_own = Source.item(source.data.nodes, node).weights_count > 0;
    const mesh = meshOf(source, node);
    return .{
        animations.node_targets.get(node),
        if (has_own or mesh == null) null else animations.mesh_targets.get(mesh.?),
    };
}

/// The list of weights of what a node draws, which are these at rest; `scene.none` where nothing
/// moves them.
pub fn weightList(animations: *Animations, node: u32, weights: []const f32) Error!u32 {
    const own, const shared = animations.targetsOf(node);
    if (weights.len == 0 or (own == null and shared == null)) return scene.none;
    const gpa = animations.source.gpa;
    const index: u32 = @intCast(animations.lists.items.len);
    try animations.lists.append(gpa, weights);
    try animations.list_of.put(gpa, node, index);
    return index;
}

/// Adds the animations to the scene. `origins` are the file's nodes of the scene's first ones,
/// `places` the scene's of the file's, or `scene.none`; empty where the former are all.
pub fn finish(
    animations: *Animations,
    origins: []const u32,
    places: []const u32,
    materials: *const Materials,
) Error!void {
    const source = animations.source;
    if (animations.list.len == 0) return;
    const gpa = source.gpa;
    const known = try gpa.alloc(u32, source.data.nodes_count);
    defer gpa.free(known);
    if (places.len > 0) @memcpy(known, places) else {
        @memset(known, scene.none);
        for (origins, 0..) |origin, place| known[origin] = @intCast(place);
    }
    var expansion: Expansion = .{
        .animations = animations,
        .places = known,
        .origins = origins,
        .form_count = materials.added.items.len,
    };
    defer expansion.deinit();
    const made = try source.arena.alloc(scene.Animation, animations.list.len);
    var rest: []const Channel = animations.channels.items;
    for (made, animations.list, 0..) |*to, *text, index| {
        expansion.channels.clearRetainingCapacity();
        while (rest.len > 0 and rest[0].animation == index) : (rest = rest[1..]) {
            try expansion.expand(&rest[0], materials);
        }
        const count = expansion.channels.items.len;
        try source.charge(@as(u64, count) * @sizeOf(scene.Channel));
        to.* = .{
            .name = try source.arena.dupe(u8, text.name),
            .channels = try source.arena.dupe(scene.Channel, expansion.channels.items),
        };
    }
    assert(rest.len == 0);
    const builder = source.builder;
    builder.scene.animations = made;
    builder.scene.moving = .{
        .nodes = try source.arena.dupe(scene.MovingNode, expansion.moving.items),
        .weights = try source.arena.dupe([]const f32, animations.lists.items),
    };
    if (source.keeps_hidden) try addVisibility(source);
}

/// Which nodes show themselves at rest.
fn addVisibility(source: *Source) Error!void {
    const builder = source.builder;
    const moving = &builder.scene.moving;
    moving.nowhere = try builder.addNode(scene.none, .scale(.{ 0, 0, 0 }));
    const shows = try source.arena.alloc(bool, builder.nodes.items.len);
    for (shows, 0..) |*is_shown, index| {
        is_shown.* = index >= source.hidden.bit_length or !source.hidden.isSet(index);
    }
    moving.shows = shows;
}

/// Properties of the file become those of the scene, where one may stand for several.
const Expansion = struct {
    animations: *const Animations,
    /// By node of the file: the scene's.
    places: []const u32,
    origins: []const u32,
    channels: std.ArrayList(scene.Channel) = .empty,
    moving: std.ArrayList(scene.MovingNode) = .empty,
    /// By node of the file: its number among the moving ones.
    moving_of: std.AutoHashMapUnmanaged(u32, u32) = .empty,
    forms: std.ArrayList(Materials.Form) = .empty,
    form_count: u64,

    fn deinit(expansion: *Expansion) void {
        const gpa = expansion.animations.source.gpa;
        inline for (.{ "channels", "moving", "moving_of", "forms" }) |name| {
            @field(expansion, name).deinit(gpa);
        }
    }

    fn add(expansion: *Expansion, channel: *const Channel, target: scene.Target) Error!void {
        try expansion.channels.append(expansion.animations.source.gpa, .{
            .sampler = channel.sampler,
            .target = target,
        });
    }

    fn expand(
        expansion: *Expansion,
        channel: *const Channel,
        materials: *const Materials,
    ) Error!void {
        const animations = expansion.animations;
        const builder = animations.source.builder;
        try animations.source.charge(expansion.choiceCount(channel.property));
        switch (channel.property) {
            inline .translation, .rotation, .scale => |node, tag| {
                const moving = try expansion.movingNode(node) orelse return;
                try expansion.add(channel, @unionInit(scene.Target, @tagName(tag), moving));
            },
            .visible => |node| if (expansion.places[node] != scene.none) {
                try expansion.add(channel, .{ .visible = expansion.places[node] });
            },
            .weights, .weight => try expansion.addWeights(channel),
            .mesh_weights, .mesh_weight => try expansion.addWeights(channel),
            .material => |of| {
                try materials.addForms(of.index, &expansion.forms);
                for (expansion.forms.items) |form| if (form.follows(of.property)) {
                    const property = of.property;
                    try expansion.add(channel, .{
                        .material = .{ .material = form.material, .property = property },
                    });
                };
            },
            .texture => |of| {
                try materials.addForms(of.index, &expansion.forms);
                for (expansion.forms.items) |form| try expansion.add(channel, .{
                    .texture = .{ .material = form.material, .field = of.field, .part = of.part },
                });
            },
            .light => |of| for (animations.lights.items, 0..) |light, index| {
                if (light != of.index) continue;
                const property = of.property;
                try expansion.add(channel, .{
                    .light = .{ .light = @intCast(index), .property = property },
                });
            },
            .camera => |of| for (animations.cameras.items, 0..) |camera, index| {
                const is_perspective = builder.cameras.items[index].projection == .perspective;
                const property = of.property;
                const fits = switch (property) {
                    .y_fov_rad, .aspect => is_perspective,
                    .half_width, .half_height => !is_perspective,
                };
                if (camera == of.index and fits) try expansion.add(channel, .{
                    .camera = .{ .camera = @intCast(index), .property = property },
                });
            },
            .unseen => unreachable, // Left out before.
        }
    }

    /// How many are looked at to find those that a property stands for.
    fn choiceCount(expansion: *const Expansion, property: Property) u64 {
        return switch (property) {
            .light => expansion.animations.lights.items.len,
            .camera => expansion.animations.cameras.items.len,
            .mesh_weights, .mesh_weight => expansion.origins.len,
            .material, .texture => expansion.form_count,
            else => 0,
        };
    }

    /// Of a node, or of all that draw a mesh and have none of their own.
    fn addWeights(expansion: *Expansion, channel: *const Channel) Error!void {
        const animations = expansion.animations;
        const source = animations.source;
        switch (channel.property) {
            .weights => |node| try expansion.addList(channel, node, null),
            .weight => |one| try expansion.addList(channel, one.index, one.element),
            .mesh_weights, .mesh_weight => for (expansion.origins) |node| {
                if (Source.item(source.data.nodes, node).weights_count > 0) continue;
                const mesh, const element = switch (channel.property) {
                    .mesh_weights => |mesh| .{ mesh, null },
                    .mesh_weight => |one| .{ one.index, one.element },
                    else => unreachable,
                };
                if (meshOf(source, node) == mesh) try expansion.addList(channel, node, element);
            },
            else => unreachable, // `expand` hands over the above.
        }
    }

    fn addList(
        expansion: *Expansion,
        channel: *const Channel,
        node: u32,
        element: ?u32,
    ) Error!void {
        const list = expansion.animations.list_of.get(node) orelse return;
        try expansion.add(channel, if (element) |index|
            .{ .weight = .{ .list = list, .index = index } }
        else
            .{ .weights = list });
    }

    /// Null for a node that the scene does without.
    fn movingNode(expansion: *Expansion, node: u32) Error!?u32 {
        const source = expansion.animations.source;
        const place = expansion.places[node];
        if (place == scene.none) return null;
        const entry = try expansion.moving_of.getOrPut(source.gpa, node);
        if (!entry.found_existing) {
            errdefer _ = expansion.moving_of.remove(node);
            entry.value_ptr.* = @intCast(expansion.moving.items.len);
            var moving = try nodes.partsOf(source, node);
            moving.node = place;
            try expansion.moving.append(source.gpa, moving);
        }
        return entry.value_ptr.*;
    }
};
