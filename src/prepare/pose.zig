//! The pose: where the nodes of a scene are in the world, composed in double precision.
//!
//! In: the nodes with their maps into the parent's space, parents first. Out: one map into world
//! space each, one for each joint of a skin, and the center of what is drawn. Where all of it is
//! far away for its size, as models on the globe are, the world's origin is moved near to it, so
//! that single precision is enough from there on. A map may overflow to infinity or NaN; who uses
//! it looks.

const std = @import("std");
const math = @import("../math.zig");
const scene = @import("../scene.zig");
const deform = @import("deform.zig");
const placement = @import("../world.zig").placement;
const assert = std.debug.assert;
const vec3d = math.vec3d;
const AffineD = math.AffineD;
const Vec3d = math.Vec3d;

/// Largest |coordinate| of a corner, in metres: the products of three differences that the
/// triangle test forms stay within an f32 up to here.
pub const coordinate_max: f32 = 0x1p40;

/// Farther away than this many times its size, a scene is moved to the origin.
const sizes_max = 64;

/// Vertices that the center is the median of, at most, evenly spread.
const sample_count_max = 1023;

/// Where things are.
pub const Pose = struct {
    /// By node, into the world.
    maps: []const AffineD,
    joint_maps: deform.JointMaps,
    /// The median of the vertices by coordinate: in the middle of most of them, however far away
    /// a few are. No coordinate is above `coordinate_max`.
    center: Vec3d,
    /// The largest distance between quartiles along an axis.
    size: f64,
    /// What has been subtracted from all places of the scene.
    shift: Vec3d = @splat(0),

    /// Where most vertices are left out for being too far away, the rest is about the origin: pads
    /// by a center among those would reach as far.
    fn limit(pose: *Pose) void {
        for (pose.center) |coordinate| {
            if (!(@abs(coordinate) <= coordinate_max)) pose.center = @splat(0);
        }
        pose.size = @min(pose.size, 2 * coordinate_max);
    }

    /// Frees the maps.
    pub fn deinit(pose: *const Pose, gpa: std.mem.Allocator) void {
        deform.deinit(pose.joint_maps, gpa);
        gpa.free(pose.maps);
    }
};

/// The pose of a scene's nodes; its memory comes from `gpa`. Asserts that every parent stands
/// before its children.
pub fn compose(gpa: std.mem.Allocator, from: *const scene.Scene) error{OutOfMemory}!Pose {
    return composeShifted(gpa, from, null);
}

/// The same with a shift that is known.
pub fn composeShifted(
    gpa: std.mem.Allocator,
    from: *const scene.Scene,
    known_shift: ?Vec3d,
) error{OutOfMemory}!Pose {
    const maps = try gpa.alloc(AffineD, from.nodes.len);
    errdefer gpa.free(maps);
    composeNodes(from.nodes, maps);
    const joint_maps = try deform.composeJoints(gpa, from.skins, maps);
    var pose: Pose = .{ .maps = maps, .joint_maps = joint_maps, .center = @splat(0), .size = 0 };
    findCenter(from, &pose);
    const shift = known_shift orelse shiftOf(&pose);
    for (maps) |*map| map.translation = vec3d.sub(map.translation, shift);
    for (joint_maps) |of_skin| for (of_skin) |*map| {
        map.translation = vec3d.sub(map.translation, shift);
    };
    pose.center = vec3d.sub(pose.center, shift);
    pose.shift = shift;
    pose.limit();
    return pose;
}

/// Maps into the world, unshifted.
pub fn composeNodes(nodes: []const scene.Node, maps: []AffineD) void {
    for (nodes, maps, 0..) |node, *map, index| {
        if (node.parent == scene.none) {
            map.* = node.local;
        } else {
            assert(node.parent < index);
            map.* = .compose(maps[node.parent], node.local);
        }
    }
}

/// What is subtracted from all places: the center on a grid of a power of two, if it is far away.
fn shiftOf(pose: *const Pose) Vec3d {
    const distance = @max(@abs(pose.center[0]), @abs(pose.center[1]), @abs(pose.center[2]));
    if (!(pose.size > 0 and distance > sizes_max * pose.size)) return @splat(0);
    const grid = std.math.ldexp(@as(f64, 1), std.math.frexp(pose.size).exponent);
    var shift: Vec3d = undefined;
    for (&shift, pose.center) |*to, coordinate| to.* = @round(coordinate / grid) * grid;
    return shift;
}

fn findCenter(from: *const scene.Scene, pose: *Pose) void {
    var coordinates: [3][sample_count_max]f64 = undefined;
    var vertex_count: u64 = 0;
    for (from.instances) |instance| vertex_count += from.meshes[instance.mesh].positions.len;
    const stride = vertex_count / sample_count_max + 1;
    var count: usize = 0;
    var next: u64 = 0; // Of the next sample, from the first vertex of the instance on.
    for (from.instances) |*instance| {
        const mesh = &from.meshes[instance.mesh];
        while (next < mesh.positions.len) : (next += stride) {
            const vertex: usize = @intCast(next);
            const at = deform.place(mesh, instance, pose.maps, pose.joint_maps, vertex);
            if (!vec3d.isFinite(at)) continue;
            for (&coordinates, at) |*list, coordinate| list[count] = coordinate;
            count += 1;
        }
        next -= mesh.positions.len;
    }
    if (count == 0) return;
    for (&coordinates, &pose.center) |*list, *center| {
        std.mem.sortUnstable(f64, list[0..count], {}, std.sort.asc(f64));
        center.* = list[count / 2];
        pose.size = @max(pose.size, list[count * 3 / 4] - list[count / 4]);
    }
}

/// A point in double precision.
pub const widen = placement.widen;
/// A point in single precision: the one rounding of all that is placed in the world.
pub const round = placement.round;

fn testPose(nodes: []const scene.Node, positions: []const math.Vec3, node: u32) !Pose {
    const gpa = std.testing.allocator;
    var from: scene.Scene = .init(gpa);
    defer from.deinit();
    from.nodes = nodes;
    from.meshes = &.{.{ .positions = positions, .triangles = &.{}, .material = 0 }};
    from.instances = &.{.{ .mesh = 0, .node = node }};
    return compose(gpa, &from);
}

test "the center is that of what joints move, and they move with it" {
    const gpa = std.testing.allocator;
    var from: scene.Scene = .init(gpa);
    defer from.deinit();
    from.nodes = &.{
        .{ .parent = scene.none, .local = .identity },
        .{ .parent = scene.none, .local = .translate(.{ 4_700_000.25, 0, 0 }) },
    };
    const corners = [_]math.Vec3{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 }, .{ 1, 1, 0 } };
    const joints: [4][4]u16 = @splat(.{ 0, 0, 0, 0 });
    const weights: [4][4]f32 = @splat(.{ 0.3, 0.1, 0, 0 });
    from.meshes = &.{.{
        .positions = &corners,
        .joint_sets = &.{.{ .joints = &joints, .weights = &weights }},
        .triangles = &.{},
        .material = 0,
    }};
    from.skins = &.{.{ .joints = &.{1}, .inverse_bind_maps = &.{.translate(.{ 8, 0, 0 })} }};
    from.instances = &.{.{ .mesh = 0, .node = 0, .skin = 0 }};
    const pose = try compose(gpa, &from);
    defer pose.deinit(gpa);
    for (pose.center) |coordinate| try std.testing.expect(@abs(coordinate) <= 1);
    const instance = &from.instances[0];
    const at = deform.place(&from.meshes[0], instance, pose.maps, pose.joint_maps, 0);
    try std.testing.expect(@abs(at[0]) <= 2);
    try std.testing.expectEqual(0.25, at[0] - @floor(at[0]));
    // The other node is left behind.
    try std.testing.expect(pose.maps[0].translation[0] < -4e6);
}

test "a child moves with its parent" {
    const nodes = [_]scene.Node{
        .{ .parent = scene.none, .local = .fromTrs(.{ 1, 0, 0 }, .{ 0, 0, 0, 1 }, .{ 2, 2, 2 }) },
        .{ .parent = 0, .local = .fromTrs(.{ 0, 3, 0 }, .{ 0, 0, 0, 1 }, .{ 1, 1, -1 }) },
        .{ .parent = scene.none, .local = .identity },
        .{ .parent = 1, .local = .identity },
    };
    const pose = try testPose(&nodes, &.{}, 0);
    defer pose.deinit(std.testing.allocator);
    try std.testing.expectEqual(Vec3d{ 3, 8, -8 }, pose.maps[3].point(.{ 1, 1, 4 }));
    try std.testing.expectEqual(AffineD.identity, pose.maps[2]);
}

test "no nodes, no maps" {
    const pose = try testPose(&.{}, &.{}, 0);
    defer pose.deinit(std.testing.allocator);
    try std.testing.expectEqual(0, pose.maps.len);
}

test "what is far away for its size comes to the origin, whatever strays" {
    const far: Vec3d = .{ 4_700_000.25, -1, 500 };
    const nodes = [_]scene.Node{
        .{ .parent = scene.none, .local = .fromTrs(far, .{ 0, 0, 0, 1 }, .{ 1, 1, 1 }) },
    };
    const corners = [_]math.Vec3{
        .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 }, .{ 1, 1, 0 }, .{ 0, 0, 1 }, .{ 1e6, 1e6, 0 },
    };
    const pose = try testPose(&nodes, &corners, 0);
    defer pose.deinit(std.testing.allocator);
    for (pose.center) |coordinate| try std.testing.expect(@abs(coordinate) <= 1);
    const here = pose.maps[0].point(.{ 0, 0, 0 });
    try std.testing.expectEqual(0.25, here[0] - @floor(here[0]));
    for (here) |coordinate| try std.testing.expect(@abs(coordinate) <= 2);
    // Near enough for its size: left where it is.
    const near = try testPose(&.{.{ .parent = scene.none, .local = .identity }}, &corners, 0);
    defer near.deinit(std.testing.allocator);
    try std.testing.expectEqual(AffineD.identity, near.maps[0]);
}

test "where most is too far away, the center and the size stay in the world" {
    const nodes = [_]scene.Node{.{
        .parent = scene.none,
        .local = .fromTrs(.{ 3e38, 0, 0 }, .{ 0, 0, 0, 1 }, .{ 0x1p64, 2, 1 }),
    }};
    const large = std.math.floatMax(f32);
    for ([_][]const math.Vec3{
        &.{ .{ 0, 0, 0 }, .{ large, 1, 0 }, .{ -large, 0, 1 }, .{ large, large, -large } },
        &.{.{ large, 0, 0 }},
    }) |corners| {
        const pose = try testPose(&nodes, corners, 0);
        defer pose.deinit(std.testing.allocator);
        const center = round(pose.center);
        for (center) |coordinate| try std.testing.expect(@abs(coordinate) <= coordinate_max);
        try std.testing.expect(pose.size <= 2 * coordinate_max);
    }
}
