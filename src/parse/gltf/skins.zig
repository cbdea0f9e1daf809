//! Skins and morph targets, which are checked but not applied: meshes stand as they were modelled.
//!
//! In: skins (glTF 2.0, section 3.7.3) and weights (section 3.7.2.2). Out: an error where they do
//! not fit the meshes that are drawn with them, a warning that they are not applied.

const std = @import("std");
const c = @import("../cgltf.zig");
const accessors = @import("../accessor.zig");
const gltf_accessors = @import("accessors.zig");
const Source = @import("source.zig");
const Error = Source.Error;
const Skins = @This();

source: *Source,
/// What has been found out about a mesh; nodes may share meshes.
known: std.AutoHashMapUnmanaged(u32, Facts) = .empty,

const Facts = struct {
    /// Morph targets of each primitive.
    target_count: usize,
    /// Whether a morph target has a weight of its own.
    weighted: bool,
    /// The largest joint number, 0 where there are none.
    joint_max: u32,
};

/// Frees what has been found out.
pub fn deinit(skins: *Skins) void {
    skins.known.deinit(skins.source.gpa);
    skins.* = undefined;
}

/// Checks every skin's matrices and every mesh's weights.
pub fn checkAll(skins: *Skins) Error!void {
    const source = skins.source;
    const data = source.data;
    for (Source.slice(data.skins, data.skins_count), 0..) |*skin, index| {
        const matrices = skin.inverse_bind_matrices orelse continue;
        const accessor_index = Source.indexOf(data.accessors, matrices);
        const accessor = try gltf_accessors.resolve(source, accessor_index) orelse continue;
        if (accessor.component != .f32 or accessor.component_count != 16) return source.fail(
            "skin {d}: inverseBindMatrices have to be 4 x 4 floats",
            .{index},
        );
        if (accessor.count < skin.joints_count) return source.fail(
            "skin {d}: {d} inverseBindMatrices for {d} joints",
            .{ index, accessor.count, skin.joints_count },
        );
        try gltf_accessors.checkFinite(source, accessor_index, accessor);
    }
    for (0..data.meshes_count) |index| _ = try skins.get(@intCast(index));
    for (Source.slice(data.nodes, data.nodes_count), 0..) |*node, index| {
        const mesh = node.mesh orelse continue;
        const facts = try skins.get(Source.indexOf(data.meshes, mesh));
        try checkWeights(source, "node", index, node.weights_count, facts.target_count);
    }
    if (data.animations_count > 0) source.warn("animations are not applied yet", .{});
}

/// Warns of what a drawn node would do to its mesh besides placing it.
pub fn checkNode(skins: *Skins, node: *const c.cgltf_node, mesh_index: u32) Error!void {
    const source = skins.source;
    const facts = try skins.get(mesh_index);
    if (node.has_mesh_gpu_instancing != 0) {
        source.warn("EXT_mesh_gpu_instancing is not supported: its meshes are drawn once", .{});
    }
    const own_weights = Source.slice(node.weights, node.weights_count);
    const weighted = if (own_weights.len > 0) anyWeight(own_weights) else facts.weighted;
    if (weighted) source.warn("morph targets are not applied yet", .{});
    const skin = node.skin orelse return;
    source.warn("skins are not applied yet", .{});
    if (facts.joint_max >= skin[0].joints_count) return source.fail(
        "mesh {d}: joint {d} of {d}",
        .{ mesh_index, facts.joint_max, skin[0].joints_count },
    );
}

fn get(skins: *Skins, mesh_index: u32) Error!Facts {
    if (skins.known.get(mesh_index)) |facts| return facts;
    const source = skins.source;
    const mesh = Source.item(source.data.meshes, mesh_index);
    var facts: Facts = .{ .target_count = 0, .weighted = false, .joint_max = 0 };
    for (Source.slice(mesh.primitives, mesh.primitives_count), 0..) |*primitive, index| {
        if (index == 0) facts.target_count = primitive.targets_count;
        if (primitive.targets_count != facts.target_count) return source.fail(
            "mesh {d}: primitives with {d} and {d} morph targets",
            .{ mesh_index, facts.target_count, primitive.targets_count },
        );
        for (Source.slice(primitive.attributes, primitive.attributes_count)) |*attribute| {
            if (attribute.type != .joints) continue;
            const accessor_index = Source.indexOf(source.data.accessors, attribute.data);
            facts.joint_max = @max(facts.joint_max, try skins.largestJoint(accessor_index));
        }
    }
    try checkWeights(source, "mesh", mesh_index, mesh.weights_count, facts.target_count);
    facts.weighted = anyWeight(Source.slice(mesh.weights, mesh.weights_count));
    try skins.known.put(source.gpa, mesh_index, facts);
    return facts;
}

fn largestJoint(skins: *Skins, index: u32) Error!u32 {
    const source = skins.source;
    const accessor = try gltf_accessors.resolve(source, index) orelse return 0;
    try source.charge(@as(u64, accessor.count) * accessor.elementBytes());
    return accessors.largestInteger(accessor) orelse source.fail(
        "accessor {d}: joints have to be unsigned integers",
        .{index},
    );
}

fn checkWeights(
    source: *const Source,
    owner: []const u8,
    index: usize,
    weight_count: usize,
    target_count: usize,
) Error!void {
    if (weight_count != 0 and weight_count != target_count) return source.fail(
        "{s} {d}: {d} weights for {d} morph targets",
        .{ owner, index, weight_count, target_count },
    );
}

fn anyWeight(weights: []const f32) bool {
    for (weights) |weight| if (weight != 0) return true;
    return false;
}
