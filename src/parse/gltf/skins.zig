//! Skins and morph targets (glTF 2.0, sections 3.7.3 and 3.7.2.2): how drawn nodes deform meshes.
//!
//! In: skins, and the weights of nodes and meshes; all are checked, drawn or not. Out: what of a
//! mesh its nodes ask for, the scene's skins, the weights of an instance. Joints that hang outside
//! of the shown scene become nodes of it as well.

const std = @import("std");
const c = @import("../cgltf.zig");
const math = @import("../../math.zig");
const scene = @import("../../scene.zig");
const accessors = @import("../accessor.zig");
const attributes = @import("attributes.zig");
const gltf_accessors = @import("accessors.zig");
const nodes = @import("nodes.zig");
const Meshes = @import("meshes.zig");
const Source = @import("source.zig");
const AffineD = math.AffineD;
const Animations = @import("animations.zig");
const Error = Source.Error;
const Skins = @This();

source: *Source,
/// What has been found out about a mesh; nodes may share meshes.
known: std.AutoHashMapUnmanaged(u32, Facts) = .empty,
/// By glTF skin that is drawn: the scene's.
indices: std.AutoHashMapUnmanaged(u32, u32) = .empty,
/// By glTF node: the scene's node, or `scene.none`; as long as needed only where there are skins.
places: []u32 = &.{},

const Facts = struct {
    /// Morph targets of each primitive.
    target_count: usize,
    /// What drawn nodes ask for.
    deformation: Meshes.Deformation = .{},
    /// The mesh's own weights in the scene, where some node goes by them.
    weights: ?[]const f32 = null,
};

/// Frees what has been found out.
pub fn deinit(skins: *Skins) void {
    const gpa = skins.source.gpa;
    var facts = skins.known.valueIterator();
    while (facts.next()) |entry| gpa.free(entry.deformation.targets);
    skins.known.deinit(gpa);
    skins.indices.deinit(gpa);
    gpa.free(skins.places);
    skins.* = undefined;
}

/// Checks the skins, meshes and weights that nothing drawn has needed.
pub fn checkRest(skins: *Skins) Error!void {
    const source = skins.source;
    const data = source.data;
    for (0..data.skins_count) |index| {
        if (skins.indices.contains(@intCast(index))) continue;
        if (source.findBroken(.skins, index) != null) continue;
        skins.checkSkin(@intCast(index)) catch |err| try source.excuse(err);
    }
    for (0..data.meshes_count) |index| {
        if (source.findBroken(.meshes, index) != null) continue;
        _ = skins.get(@intCast(index)) catch |err| try source.excuse(err);
    }
    for (Source.slice(data.nodes, data.nodes_count)) |*node| {
        const mesh = node.mesh orelse continue;
        if (!skins.known.contains(Source.indexOf(data.meshes, mesh))) continue;
        skins.checkNode(node) catch |err| try source.excuse(err);
    }
}

fn checkSkin(skins: *const Skins, index: u32) Error!void {
    const source = skins.source;
    const skin = Source.item(source.data.skins, index);
    const matrices = skin.inverse_bind_matrices orelse return;
    const accessor_index = Source.indexOf(source.data.accessors, matrices);
    const accessor = try gltf_accessors.resolve(source, accessor_index) orelse return;
    if (accessor.component != .f32 or accessor.component_count != 16) return source.fail(
        "skin {d}: inverseBindMatrices have to be 4 x 4 floats",
        .{index},
    );
    if (accessor.count < skin.joints_count) return source.fail(
        "skin {d}: {d} inverseBindMatrices for {d} joints",
        .{ index, accessor.count, skin.joints_count },
    );
}

fn checkNode(skins: *Skins, node: *const c.cgltf_node) Error!void {
    const mesh = node.mesh orelse return;
    const data = skins.source.data;
    const facts = try skins.get(Source.indexOf(data.meshes, mesh));
    const index = Source.indexOf(data.nodes, node);
    try checkWeights(skins.source, "node", index, node.weights_count, facts.target_count);
}

/// Notes what the drawn nodes ask of their meshes, at rest or when they move. `origins` are the
/// glTF nodes of the scene's.
pub fn collect(
    skins: *Skins,
    origins: []const u32,
    animations: *const Animations,
) Error!void {
    const source = skins.source;
    const data = source.data;
    for (origins, 0..) |origin, shown| {
        const node = Source.item(data.nodes, origin);
        const mesh = node.mesh orelse continue;
        if (source.isHidden(@intCast(shown))) continue;
        try skins.checkNode(node);
        const facts = try skins.get(Source.indexOf(data.meshes, mesh));
        const deformation = &facts.deformation;
        if (node.skin != null) deformation.has_skin = true;
        for (weightsOf(node, facts.target_count), 0..) |weight, target| {
            if (math.flushDenormal(weight) != 0) try skins.want(facts, target);
        }
        for (animations.targetsOf(origin)) |list| if (list) |moves| {
            for (moves, 0..) |moved, target| if (moved) try skins.want(facts, target);
        };
        if (node.skin == null or skins.places.len > 0) continue;
        skins.places = try source.gpa.alloc(u32, data.nodes_count);
        @memset(skins.places, scene.none);
        for (origins, 0..) |one, place| skins.places[one] = @intCast(place);
    }
}

fn want(skins: *const Skins, facts: *Facts, target: usize) error{OutOfMemory}!void {
    const deformation = &facts.deformation;
    if (deformation.targets.len == 0) {
        const targets = try skins.source.gpa.alloc(bool, facts.target_count);
        @memset(targets, false);
        deformation.targets = targets;
    }
    deformation.targets[target] = true;
}

/// What drawn nodes ask of a mesh.
pub fn deformationOf(skins: *const Skins, mesh_index: u32) Meshes.Deformation {
    return skins.known.get(mesh_index).?.deformation;
}

/// The weights that a drawn node gives its mesh, as `scene.Instance` has them.
pub fn instanceWeights(skins: *Skins, node: *const c.cgltf_node) Error![]const f32 {
    const source = skins.source;
    const facts = try skins.get(Source.indexOf(source.data.meshes, node.mesh));
    if (facts.deformation.targets.len == 0) return &.{};
    const is_own = node.weights_count > 0;
    if (!is_own) if (facts.weights) |weights| return weights;
    const weights = try source.arena.alloc(f32, facts.target_count);
    @memset(weights, 0);
    const given = weightsOf(node, weights.len);
    for (weights[0..given.len], given) |*to, weight| to.* = math.flushDenormal(weight);
    if (!is_own) facts.weights = weights;
    return weights;
}

/// The scene's skin of a drawn node, whose mesh is `range`; `scene.none` without one.
pub fn instanceSkin(skins: *Skins, node: *const c.cgltf_node, range: Meshes.Range) Error!u32 {
    const skin = node.skin orelse return scene.none;
    const source = skins.source;
    try source.need(.skins, Source.indexOf(source.data.skins, skin));
    if (range.joint_max >= skin[0].joints_count) return source.fail(
        "mesh {d}: joint {d} of {d}",
        .{
            Source.indexOf(source.data.meshes, node.mesh), range.joint_max, skin[0].joints_count,
        },
    );
    const index = Source.indexOf(source.data.skins, skin);
    if (skins.indices.get(index)) |known| return known;
    const made = try source.builder.addSkin(try skins.decode(index));
    try skins.indices.put(source.gpa, index, made);
    return made;
}

fn decode(skins: *Skins, index: u32) Error!scene.Skin {
    const source = skins.source;
    const skin = Source.item(source.data.skins, index);
    const count = skin.joints_count;
    try skins.checkSkin(index);
    try source.charge(@as(u64, count) * (@sizeOf(u32) + @sizeOf(AffineD)));
    const joints = try source.arena.alloc(u32, count);
    for (joints, Source.slice(skin.joints, count)) |*joint, node| {
        const origin = Source.indexOf(source.data.nodes, node);
        joint.* = try nodes.reach(source, skins.places, origin);
    }
    const maps = try source.arena.alloc(AffineD, count);
    if (skin.inverse_bind_matrices) |matrices| {
        try skins.decodeMatrices(index, Source.indexOf(source.data.accessors, matrices), maps);
    } else @memset(maps, .identity);
    return .{ .joints = joints, .inverse_bind_maps = maps };
}

fn decodeMatrices(skins: *Skins, index: u32, accessor_index: u32, maps: []AffineD) Error!void {
    const source = skins.source;
    const accessor = try attributes.required(source, accessor_index);
    try source.charge(@as(u64, accessor.count) * @sizeOf([16]f32));
    const matrices = try source.gpa.alloc([16]f32, accessor.count);
    defer source.gpa.free(matrices);
    if (accessors.decodeFloats(16, accessor, matrices)) |bad| return source.fail(
        "accessor {d}: element {d} is not finite",
        .{ accessor_index, bad },
    );
    var is_affine = true;
    for (maps, matrices[0..maps.len]) |*map, m| {
        for ([4]f32{ m[3], m[7], m[11], m[15] }, [4]f32{ 0, 0, 0, 1 }) |value, wanted| {
            if (!(@abs(value - wanted) <= 1e-5)) is_affine = false;
        }
        map.* = .{
            .x = .{ m[0], m[1], m[2] },
            .y = .{ m[4], m[5], m[6] },
            .z = .{ m[8], m[9], m[10] },
            .translation = .{ m[12], m[13], m[14] },
        };
    }
    if (!is_affine) source.forgive(
        "skin {d}: inverseBindMatrices are not affine, their last rows are ignored",
        .{index},
    );
}

/// A node's weights, or those of its mesh where it has none; not more than there are targets.
fn weightsOf(node: *const c.cgltf_node, target_count: usize) []const f32 {
    const list = if (node.weights_count > 0)
        Source.slice(node.weights, node.weights_count)
    else
        Source.slice(node.mesh[0].weights, node.mesh[0].weights_count);
    return list[0..@min(list.len, target_count)];
}

/// Valid until the next mesh is met.
fn get(skins: *Skins, mesh_index: u32) Error!*Facts {
    if (skins.known.getPtr(mesh_index)) |facts| return facts;
    const source = skins.source;
    try source.need(.meshes, mesh_index);
    const mesh = Source.item(source.data.meshes, mesh_index);
    var facts: Facts = .{ .target_count = 0 };
    for (Source.slice(mesh.primitives, mesh.primitives_count), 0..) |*primitive, index| {
        if (index == 0) facts.target_count = primitive.targets_count;
        if (primitive.targets_count != facts.target_count) return source.fail(
            "mesh {d}: primitives with {d} and {d} morph targets",
            .{ mesh_index, facts.target_count, primitive.targets_count },
        );
    }
    try checkWeights(source, "mesh", mesh_index, mesh.weights_count, facts.target_count);
    try skins.known.put(source.gpa, mesh_index, facts);
    return skins.known.getPtr(mesh_index).?;
}

fn checkWeights(
    source: *const Source,
    owner: []const u8,
    index: usize,
    weight_count: usize,
    target_count: usize,
) Error!void {
    if (weight_count == 0 or weight_count == target_count) return;
    const line = "{s} {d}: {d} weights for {d} morph targets";
    const parts = .{ owner, index, weight_count, target_count };
    if (target_count > 0) return source.fail(line, parts);
    source.forgive(line, parts);
}
