//! Deformed vertices: morph targets (glTF 2.0, section 3.7.2.2), and linear blend skinning (section
//! 3.7.3; Magnenat-Thalmann, Laperriere and Thalmann 1988, Joint-Dependent Local Deformations).
//!
//! In: a mesh, an instance's weights, the maps of its joints into the world. Out: attributes with
//! what the targets add, in the order of the targets; a vertex's map into the world, blended in
//! double precision in the order of its joints.

const std = @import("std");
const math = @import("../math.zig");
const scene = @import("../scene.zig");
const assert = std.debug.assert;
const vec3d = math.vec3d;
const AffineD = math.AffineD;
const Mesh = scene.Mesh;
const Vec3d = math.Vec3d;

/// By skin and joint: from a mesh into the world.
pub const JointMaps = []const []AffineD;

/// Joint maps for the world maps of the nodes; the memory is `deinit`'s to free.
pub fn composeJoints(
    gpa: std.mem.Allocator,
    skins: []const scene.Skin,
    node_maps: []const AffineD,
) error{OutOfMemory}!JointMaps {
    const all = try gpa.alloc([]AffineD, skins.len);
    var done: usize = 0;
    errdefer {
        for (all[0..done]) |maps| gpa.free(maps);
        gpa.free(all);
    }
    for (all, skins) |*maps, skin| {
        maps.* = try gpa.alloc(AffineD, skin.joints.len);
        done += 1;
        for (maps.*, skin.joints, skin.inverse_bind_maps) |*map, node, inverse_bind_map| {
            map.* = .compose(node_maps[node], inverse_bind_map);
        }
    }
    return all;
}

/// Frees what `composeJoints` made.
pub fn deinit(all: JointMaps, gpa: std.mem.Allocator) void {
    for (all) |maps| gpa.free(maps);
    gpa.free(all);
}

/// Whether more of the joints turn fronts into backs than not.
pub fn isMirrored(joint_maps: []const AffineD) bool {
    var balance: i64 = 0;
    for (joint_maps) |map| {
        const volume = map.determinant();
        if (volume < 0) balance += 1;
        if (volume > 0) balance -= 1;
    }
    return balance > 0;
}

/// Whether any target changes a mesh.
pub fn isMorphed(weights: []const f32) bool {
    for (weights) |weight| if (weight != 0) return true;
    return false;
}

/// The targets' arrays by vertex.
pub const Attribute = union(enum) { positions, normals, tangents, colors, texcoords: usize };

/// Whether any target that counts adds to the attribute.
pub fn isChanged(mesh: *const Mesh, weights: []const f32, attribute: Attribute) bool {
    if (weights.len == 0) return false;
    for (mesh.morph_targets, weights) |*target, weight| {
        if (weight == 0) continue;
        const is_there = switch (attribute) {
            .texcoords => |set| target.texcoords[set] != null,
            inline else => |_, tag| @field(target, @tagName(tag)) != null,
        };
        if (is_there) return true;
    }
    return false;
}

/// Adds to the attribute of the vertices from `first` on what the targets do. Tangents are longer
/// than what is added to them: the rest stays.
pub fn morph(
    mesh: *const Mesh,
    weights: []const f32,
    comptime attribute: std.meta.Tag(Attribute),
    set: usize,
    first: usize,
    to: anytype,
) void {
    if (weights.len == 0) return;
    assert(weights.len == mesh.morph_targets.len);
    for (mesh.morph_targets, weights) |*target, weight| {
        if (weight == 0) continue;
        const all = if (attribute == .texcoords)
            target.texcoords[set]
        else
            @field(target, @tagName(attribute));
        const deltas = (all orelse continue)[first..][0..to.len];
        for (to, deltas) |*vertex, delta| {
            inline for (0..delta.len) |axis| vertex[axis] += weight * delta[axis];
        }
    }
}

/// The map of a vertex: the mean of its joints' by weight. Asserts that the mesh has joints.
pub fn blend(sets: []const scene.JointSet, joint_maps: []const AffineD, vertex: usize) AffineD {
    assert(sets.len > 0);
    const zero: Vec3d = @splat(0);
    var map: AffineD = .{ .x = zero, .y = zero, .z = zero, .translation = zero };
    var sum: f64 = 0;
    for (sets) |set| for (set.joints[vertex], set.weights[vertex]) |joint, weight| {
        if (weight == 0) continue;
        sum += weight;
        inline for (.{ "x", "y", "z", "translation" }) |name| {
            const part = vec3d.scale(@field(joint_maps[joint], name), weight);
            @field(map, name) = vec3d.add(@field(map, name), part);
        }
    };
    // In single precision weights seldom sum up to 1 exactly.
    const scale = 1 / sum;
    inline for (.{ "x", "y", "z", "translation" }) |name| {
        @field(map, name) = vec3d.scale(@field(map, name), scale);
    }
    return map;
}

/// Where a vertex of an instance is in the world.
pub fn place(
    mesh: *const Mesh,
    instance: *const scene.Instance,
    node_maps: []const AffineD,
    joint_maps: JointMaps,
    vertex: usize,
) Vec3d {
    var at: [1]math.Vec3 = .{mesh.positions[vertex]};
    morph(mesh, instance.morph_weights, .positions, 0, vertex, &at);
    const map = if (instance.skin == scene.none)
        node_maps[instance.node]
    else
        blend(mesh.joint_sets, joint_maps[instance.skin], vertex);
    return map.point(.{ at[0][0], at[0][1], at[0][2] });
}

const testing = std.testing;

test "weights add targets in order, to what vertices have" {
    const mesh: Mesh = .{
        .positions = &.{ .{ 1, 2, 3 }, .{ 4, 5, 6 }, .{ 7, 8, 9 } },
        .triangles = &.{},
        .material = 0,
        .morph_targets = &.{
            .{ .positions = &.{ .{ 9, 9, 9 }, .{ 2, 0, 4 }, .{ 0, 2, 0 } } },
            .{ .texcoords = .{ null, &.{ .{ 0, 0 }, .{ 1, 2 }, .{ 3, 4 } }, null, null } },
            .{ .tangents = &.{ .{ 9, 9, 9 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } } },
            .{},
        },
    };
    const weights = [4]f32{ 0.5, -1, 2, 1 };
    var positions = mesh.positions[1..3].*;
    morph(&mesh, &weights, .positions, 0, 1, &positions);
    try testing.expectEqual([2]math.Vec3{ .{ 5, 5, 8 }, .{ 7, 9, 9 } }, positions);
    var texcoords: [2][2]f32 = @splat(.{ 10, 10 });
    morph(&mesh, &weights, .texcoords, 1, 1, &texcoords);
    try testing.expectEqual([2][2]f32{ .{ 9, 8 }, .{ 7, 6 } }, texcoords);
    morph(&mesh, &weights, .texcoords, 0, 1, &texcoords);
    try testing.expectEqual([2]f32{ 9, 8 }, texcoords[0]);
    var tangents: [1][4]f32 = .{.{ 1, 1, 1, -1 }};
    morph(&mesh, &weights, .tangents, 0, 2, &tangents);
    try testing.expectEqual([4]f32{ 1, 3, 1, -1 }, tangents[0]);
    try testing.expect(isMorphed(&weights) and !isMorphed(&.{ 0, -0.0 }) and !isMorphed(&.{}));
    try testing.expect(isChanged(&mesh, &weights, .{ .texcoords = 1 }));
    try testing.expect(!isChanged(&mesh, &weights, .{ .texcoords = 0 }));
    try testing.expect(isChanged(&mesh, &weights, .positions));
    try testing.expect(!isChanged(&mesh, &.{ 0, 1, 1, 1 }, .positions));
    try testing.expect(!isChanged(&mesh, &weights, .colors));
}

test "a vertex goes with eight joints by their weights, whatever these sum up to" {
    const skins = [_]scene.Skin{.{
        .joints = &.{ 0, 1, 1 },
        .inverse_bind_maps = &.{ .translate(.{ -1, 0, 0 }), .identity, .scale(.{ 1, 1, 2 }) },
    }};
    const node_maps = [_]AffineD{ .scale(.{ 3, 1, 1 }), .translate(.{ 0, 8, 0 }) };
    const maps = try composeJoints(testing.allocator, &skins, &node_maps);
    defer deinit(maps, testing.allocator);
    const numbers = [2][4]u16{ .{ 0, 0, 0, 0 }, .{ 0, 0, 1, 2 } };
    const zero: [4]f32 = @splat(0);
    // (2 a + b + c) / 4, spread over both sets.
    const sets = [2]scene.JointSet{
        .{ .joints = &numbers, .weights = &.{ zero, .{ 0.25, 0.75, 0, 0 } } },
        .{ .joints = &numbers, .weights = &.{ zero, .{ 0, 1, 1, 1 } } },
    };
    const map = blend(&sets, maps[0], 1);
    try testing.expectEqual(Vec3d{ -1.5, 4, 0 }, map.translation);
    try testing.expectEqual(Vec3d{ 2, 0, 0 }, map.x);
    try testing.expectEqual(Vec3d{ 0, 1, 0 }, map.y);
    try testing.expectEqual(Vec3d{ 0, 0, 1.25 }, map.z);
}

test "what most joints do is mirroring or not" {
    const mirror: AffineD = .scale(.{ -1, 1, 1 });
    const flat: AffineD = .scale(.{ 1, 1, 0 });
    try testing.expect(!isMirrored(&.{}));
    try testing.expect(!isMirrored(&.{ mirror, .identity }));
    try testing.expect(isMirrored(&.{ mirror, flat, mirror, .identity }));
}
