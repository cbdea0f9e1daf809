//! Vertex attributes: the accessors that a primitive draws from, each of the right kind.
//!
//! In: a primitive's attributes, indices and morph targets. Out: the accessors of its positions,
//! normals, colours, texture coordinates, tangents, joints and their weights. The kinds are those
//! of glTF 2.0, sections 3.7.2.1, 3.7.2.2 and 3.7.3.3, and of KHR_mesh_quantization. What is wrong
//! with an attribute that is not drawn is a warning.

const std = @import("std");
const c = @import("../cgltf.zig");
const accessors = @import("../accessor.zig");
const asset = @import("asset.zig");
const diagnostic = @import("../../diagnostic.zig");
const draco_meshes = @import("draco_meshes.zig");
const gltf_accessors = @import("accessors.zig");
const scene = @import("../../scene.zig");
const Meshes = @import("meshes.zig");
const Source = @import("source.zig");
const Accessor = accessors.Accessor;
const Error = Source.Error;
const Place = Meshes.Place;

/// Indices of accessors.
pub const Used = struct {
    position: ?u32 = null,
    normal: ?u32 = null,
    color: ?u32 = null,
    tangent: ?u32 = null,
    texcoords: [scene.texcoord_set_count]?u32 = @splat(null),
    joints: [scene.joint_set_count]?u32 = @splat(null),
    weights: [scene.joint_set_count]?u32 = @splat(null),
    /// Whether there are more joints than there are sets for.
    has_more_joints: bool = false,
    /// Whether its triangles come one by one from Draco, whatever the mode.
    is_draco: bool = false,
    vertex_count: u32 = 0,
};

/// Finds the attributes of a primitive and checks those that are always drawn; for the others there
/// is `check`. Without positions nothing is found.
pub fn find(source: *Source, primitive: *const c.cgltf_primitive, place: Place) Error!Used {
    const list = Source.slice(primitive.attributes, primitive.attributes_count);
    const position = for (list) |*attribute| {
        if (attribute.type != .position or attribute.index != 0) continue;
        break accessorIndex(source, attribute);
    } else return .{};
    var used: Used = .{ .is_draco = try draco_meshes.decode(source, primitive, place) };
    const positions = try required(source, position);
    used.vertex_count = positions.count;
    for (list) |*attribute| {
        const index = accessorIndex(source, attribute);
        if (try hasNoElements(source, attribute.data)) {
            source.forgive("{f}: {f} is empty, left out", .{ place, quote(attribute) });
            continue;
        }
        if (attribute.type == .joints and attribute.index >= scene.joint_set_count) {
            used.has_more_joints = true;
        }
        const slot = slotOf(&used, attribute) orelse continue;
        if (slot.* != null) {
            return source.fail("{f}: {f} stands twice", .{ place, quote(attribute) });
        }
        slot.* = index;
        switch (attribute.type) {
            .position, .normal, .color => {
                try checkAttribute(source, attribute, index, positions.count, place);
            },
            else => {},
        }
    }
    return used;
}

/// Whether a primitive has an accessor of no elements where there is nothing to draw without them.
pub fn isEmpty(source: *Source, primitive: *const c.cgltf_primitive) Error!bool {
    if (primitive.indices) |accessor| if (try hasNoElements(source, accessor)) return true;
    for (Source.slice(primitive.attributes, primitive.attributes_count)) |*attribute| {
        const is_position = attribute.type == .position and attribute.index == 0;
        if (is_position and try hasNoElements(source, attribute.data)) return true;
    }
    return false;
}

/// Whether an accessor is empty, and not just left out of the document.
fn hasNoElements(source: *Source, accessor: *const c.cgltf_accessor) Error!bool {
    if (accessor.count > 0) return false;
    const index = Source.indexOf(source.data.accessors, accessor);
    if (source.findBroken(.accessors, index) != null) return false;
    try source.noteResolved(index); // It has been said what becomes of it.
    return true;
}

/// Checks an attribute that is drawn by its accessor.
pub fn check(
    source: *Source,
    primitive: *const c.cgltf_primitive,
    index: u32,
    vertex_count: u32,
    place: Place,
) Error!void {
    for (Source.slice(primitive.attributes, primitive.attributes_count)) |*attribute| {
        if (accessorIndex(source, attribute) != index) continue;
        try checkAttribute(source, attribute, index, vertex_count, place);
    }
}

/// Checks all attributes of a primitive and of its morph targets: those that are drawn have been.
pub fn checkRest(
    source: *Source,
    primitive: *const c.cgltf_primitive,
    vertex_count: u32,
    place: Place,
) Error!void {
    for (Source.slice(primitive.attributes, primitive.attributes_count)) |*attribute| {
        const index = accessorIndex(source, attribute);
        if (attribute.data[0].count == 0) continue; // Has been said.
        checkAttribute(source, attribute, index, vertex_count, place) catch |err|
            try source.excuse(err);
    }
    for (Source.slice(primitive.targets, primitive.targets_count)) |*target| {
        for (Source.slice(target.attributes, target.attributes_count)) |*attribute| {
            checkTarget(source, attribute, vertex_count, place) catch |err|
                try source.excuse(err);
        }
    }
}

/// The attributes of a morph target that is drawn.
pub fn ofTarget(
    source: *Source,
    target: *const c.cgltf_morph_target,
    vertex_count: u32,
    place: Place,
) Error!Used {
    var used: Used = .{};
    for (Source.slice(target.attributes, target.attributes_count)) |*attribute| {
        try checkTarget(source, attribute, vertex_count, place);
        const slot = slotOf(&used, attribute) orelse continue;
        slot.* = accessorIndex(source, attribute);
    }
    return used;
}

/// Where an attribute goes; null: it is not drawn.
fn slotOf(used: *Used, attribute: *const c.cgltf_attribute) ?*?u32 {
    const set = attribute.index;
    const sets: []?u32 = switch (attribute.type) {
        .texcoord => &used.texcoords,
        .joints => &used.joints,
        .weights => &used.weights,
        else => &.{},
    };
    if (set >= 0 and set < sets.len) return &sets[@intCast(set)];
    if (set != 0) return null;
    return switch (attribute.type) {
        .position => &used.position,
        .normal => &used.normal,
        .color => &used.color,
        .tangent => &used.tangent,
        else => null,
    };
}

/// The accessor of a primitive's indices.
pub fn indices(source: *Source, index: u32) Error!Accessor {
    const accessor = try gltf_accessors.resolveIndices(source, index) orelse
        return noData(source, index);
    const unsigned = switch (accessor.component) {
        .u8, .u16, .u32 => true,
        .i8, .i16, .f32 => false,
    };
    if (!unsigned or accessor.component_count != 1) return source.fail(
        "accessor {d}: indices have to be single unsigned integers",
        .{index},
    );
    return accessor;
}

/// An accessor that something drawn needs.
pub fn required(source: *Source, index: u32) Error!Accessor {
    return try gltf_accessors.resolve(source, index) orelse noData(source, index);
}

fn noData(source: *const Source, index: u32) Error {
    return source.fail("accessor {d}: its buffer has no data", .{index});
}

/// An accessor of normals or tangents. KHR_mesh_quantization has whole numbers only as normalised
/// ones, and so they are taken, or what morph targets add would not be of their size.
pub fn directions(source: *Source, index: u32) Error!Accessor {
    var accessor = try required(source, index);
    accessor.normalized = true;
    return accessor;
}

/// An accessor of colours, whose whole numbers are normalised: some writers do not say so.
pub fn colors(source: *Source, index: u32) Error!Accessor {
    var accessor = try required(source, index);
    if (accessor.component == .f32 or accessor.normalized) return accessor;
    source.forgive("accessor {d}: colours in whole numbers, taken as normalised", .{index});
    accessor.normalized = true;
    return accessor;
}

fn accessorIndex(source: *const Source, attribute: *const c.cgltf_attribute) u32 {
    return Source.indexOf(source.data.accessors, attribute.data);
}

fn quote(attribute: *const c.cgltf_attribute) diagnostic.Quoted {
    return diagnostic.quote(std.mem.span(@as([*:0]const u8, attribute.name)));
}

fn checkAttribute(
    source: *Source,
    attribute: *const c.cgltf_attribute,
    index: u32,
    vertex_count: u32,
    place: Place,
) Error!void {
    const accessor = try required(source, index);
    try checkCount(source, accessor, index, vertex_count, place);
    const fits = fits: switch (kindOf(accessor, attribute.type)) {
        .core => true,
        .quantized => {
            if (!asset.uses(source, "KHR_mesh_quantization")) source.forgive(
                "accessor {d}: its type needs KHR_mesh_quantization, which the file does not name",
                .{index},
            );
            break :fits true;
        },
        .wrong => false,
    };
    if (!fits) return source.fail("{f}: accessor {d} has no type for {f}", .{
        place, index, quote(attribute),
    });
}

fn checkTarget(
    source: *Source,
    attribute: *const c.cgltf_attribute,
    vertex_count: u32,
    place: Place,
) Error!void {
    const index = accessorIndex(source, attribute);
    const accessor = try gltf_accessors.resolve(source, index) orelse return;
    try checkCount(source, accessor, index, vertex_count, place);
    const count = accessor.component_count;
    const fits = switch (attribute.type) {
        .position,
        .normal,
        .tangent,
        => count == 3,
        .texcoord => count == 2,
        .color => count == 3 or count == 4,
        else => true,
    };
    if (!fits or accessor.component == .u32) return source.fail(
        "{f}: accessor {d} has no type for a morph target's {f}",
        .{ place, index, quote(attribute) },
    );
}

fn checkCount(
    source: *const Source,
    accessor: Accessor,
    index: u32,
    vertex_count: u32,
    place: Place,
) Error!void {
    if (accessor.count != vertex_count) return source.fail(
        "{f}: accessor {d} has {d} elements for {d} vertices",
        .{ place, index, accessor.count, vertex_count },
    );
}

/// Whether a type is glTF's own for an attribute, comes with KHR_mesh_quantization, or is neither.
const Kind = enum { core, quantized, wrong };

fn kindOf(accessor: Accessor, attribute: c.cgltf_attribute_type) Kind {
    const count = accessor.component_count;
    const component = accessor.component;
    const small_signed = component == .i8 or component == .i16;
    const small_unsigned = component == .u8 or component == .u16;
    const small = small_signed or small_unsigned;
    const count_fits = switch (attribute) {
        .position, .normal => count == 3,
        .texcoord => count == 2,
        .color => count == 3 or count == 4,
        .tangent,
        .joints,
        .weights,
        => count == 4,
        else => return .core,
    };
    if (!count_fits) return .wrong;
    switch (attribute) {
        .joints => return if (small_unsigned) .core else .wrong,
        else => if (component == .f32) return .core,
    }
    return switch (attribute) {
        .position => if (small) .quantized else .wrong,
        // Whether it says that they are normalised or not: see `directions`.
        .normal,
        .tangent,
        => if (small_signed) .quantized else .wrong,
        .texcoord => if (small_unsigned and accessor.normalized)
            .core
        else if (small)
            .quantized
        else
            .wrong,
        // Whether it says so or not: see `colors`.
        .color => if (small_unsigned) .core else .wrong,
        // Weights.
        else => if (small_unsigned and accessor.normalized) .core else .wrong,
    };
}
