//! EXT_mesh_gpu_instancing: a node that draws its mesh at many places.
//!
//! In: the accessors of a node's TRANSLATION, ROTATION and SCALE. Out: a node below it for each
//! place, whose map is the three in the order of nodes' own; the mesh goes there, and not to the
//! node itself. Attributes of other names are the application's.

const std = @import("std");
const c = @import("../cgltf.zig");
const accessors = @import("../accessor.zig");
const attributes = @import("attributes.zig");
const limits = @import("limits.zig");
const math = @import("../../math.zig");
const nodes = @import("nodes.zig");
const scene = @import("../../scene.zig");
const Accessor = accessors.Accessor;
const Error = Source.Error;
const Source = @import("source.zig");

/// Nodes of the scene that follow each other.
pub const Places = struct { first: u32, count: u32 };

const Semantic = enum { TRANSLATION, ROTATION, SCALE };

/// Accessors of what a place is made of; null: none is moved, turned or scaled.
const Used = std.enums.EnumArray(Semantic, ?Accessor);

/// Adds the places of a drawn node, `part_count` instances of meshes at each; just the node itself
/// where it has no such extension. `node_index` is the scene's node, `origin` glTF's.
pub fn place(source: *Source, origin: u32, node_index: u32, part_count: u64) Error!Places {
    const node = Source.item(source.data.nodes, origin);
    const itself: Places = .{ .first = node_index, .count = 1 };
    if (node.has_mesh_gpu_instancing == 0) return itself;
    if (node.skin != null) {
        source.warn("node {d}: has a skin, so its mesh is drawn once, not instanced", .{origin});
        return itself;
    }
    var used: Used = .initFill(null);
    const count = try find(source, origin, &used) orelse {
        source.forgive(
            "node {d}: EXT_mesh_gpu_instancing without attributes: drawn once",
            .{origin},
        );
        return itself;
    };
    const builder = source.builder;
    const instance_count = builder.instances.items.len + @as(u64, count) * part_count;
    const node_count = builder.nodes.items.len + @as(u64, count);
    if (@max(instance_count, node_count) > limits.instance_count_max) return source.fail(
        "node {d}: over {d} instances of meshes",
        .{ origin, limits.instance_count_max },
    );
    const bytes_each = @sizeOf(scene.Node) + part_count * @sizeOf(scene.Instance);
    try source.charge(count * (bytes_each + 10 * @sizeOf(f32)));
    const first: u32 = @intCast(builder.nodes.items.len);
    try addNodes(source, origin, node_index, &used, count);
    return .{ .first = first, .count = count };
}

/// How many places there are; null: nothing tells.
fn find(source: *Source, origin: u32, used: *Used) Error!?u32 {
    const instancing = &Source.item(source.data.nodes, origin).mesh_gpu_instancing;
    var count: ?u32 = null;
    var others: ?u32 = null;
    for (Source.slice(instancing.attributes, instancing.attributes_count)) |*attribute| {
        const name = std.mem.span(@as([*:0]const u8, attribute.name));
        const semantic = std.meta.stringToEnum(Semantic, name) orelse {
            others = @intCast(attribute.data[0].count);
            continue;
        };
        const index = Source.indexOf(source.data.accessors, attribute.data);
        const accessor = try attributes.required(source, index);
        if (!fits(semantic, accessor)) return source.fail(
            "node {d}: accessor {d} has no type for {t} of EXT_mesh_gpu_instancing",
            .{ origin, index, semantic },
        );
        if (count orelse accessor.count != accessor.count) return source.fail(
            "node {d}: accessor {d} has {d} elements for {d} instances",
            .{ origin, index, accessor.count, count.? },
        );
        count = accessor.count;
        used.set(semantic, accessor);
    }
    return count orelse others;
}

fn fits(semantic: Semantic, accessor: Accessor) bool {
    const is_float = accessor.component == .f32;
    const is_small = accessor.component == .i8 or accessor.component == .i16;
    return switch (semantic) {
        .TRANSLATION, .SCALE => accessor.component_count == 3 and is_float,
        .ROTATION => accessor.component_count == 4 and
            (is_float or is_small and accessor.normalized),
    };
}

fn addNodes(source: *Source, origin: u32, parent: u32, used: *const Used, count: u32) Error!void {
    const translations = try decode(source, origin, 3, used.get(.TRANSLATION));
    defer source.gpa.free(translations);
    const rotations = try decode(source, origin, 4, used.get(.ROTATION));
    defer source.gpa.free(rotations);
    const scales = try decode(source, origin, 3, used.get(.SCALE));
    defer source.gpa.free(scales);
    const is_rounded = if (used.get(.ROTATION)) |one| one.component != .f32 else false;
    var odd_count: u32 = 0;
    for (0..count) |index| {
        var rotation: [4]f64 = .{ 0, 0, 0, 1 };
        if (rotations.len > 0) {
            rotation = widen(4, rotations[index]);
            const length = nodes.quaternionLength(rotation);
            if (!(@abs(length - 1) <= 1e-3)) odd_count += 1;
            if (length < std.math.floatMin(f32)) {
                rotation = .{ 0, 0, 0, 1 };
            } else for (&rotation) |*component| component.* /= length;
        }
        const local: math.AffineD = .fromTrs(
            if (translations.len > 0) widen(3, translations[index]) else .{ 0, 0, 0 },
            rotation,
            if (scales.len > 0) widen(3, scales[index]) else .{ 1, 1, 1 },
        );
        const index_of = try source.builder.addNode(parent, local);
        source.builder.nodes.items[index_of].origin = origin;
    }
    if (odd_count > 0 and !is_rounded) source.forgive(
        "node {d}: {d} rotations of EXT_mesh_gpu_instancing are no unit quaternions, made such",
        .{ origin, odd_count },
    );
}

/// The caller frees it; empty without an accessor.
fn decode(
    source: *Source,
    origin: u32,
    comptime width: u8,
    wanted: ?Accessor,
) Error![]const [width]f32 {
    const accessor = wanted orelse return &.{};
    const values = try source.gpa.alloc([width]f32, accessor.count);
    errdefer source.gpa.free(values);
    if (accessors.decodeFloats(width, accessor, values)) |bad| return source.fail(
        "node {d}: EXT_mesh_gpu_instancing: instance {d} is not finite",
        .{ origin, bad },
    );
    return values;
}

fn widen(comptime width: u8, values: [width]f32) [width]f64 {
    var wide: [width]f64 = undefined;
    for (&wide, values) |*to, value| to.* = value;
    return wide;
}
