//! The extent of a scene: the box of all vertices that it draws, posed, by each of them.
//!
//! In: a scene. Out: the box in the scene's own coordinates, in metres, in double precision,
//! however far away it is. Vertices that nothing uses, or that have no finite place, do not count;
//! points and lines have no width.

const std = @import("std");
const math = @import("../math.zig");
const scene = @import("../scene.zig");
const deform = @import("deform.zig");
const pose_file = @import("pose.zig");
const Vec3d = math.Vec3d;
const vec3d = math.vec3d;

/// From the least to the largest coordinates.
pub const Extent = struct {
    lower: Vec3d,
    upper: Vec3d,

    fn grow(extent: *Extent, at: Vec3d) void {
        for (&extent.lower, &extent.upper, at) |*lower, *upper, coordinate| {
            lower.* = @min(lower.*, coordinate);
            upper.* = @max(upper.*, coordinate);
        }
    }
};

/// Null: nothing is drawn.
pub fn of(gpa: std.mem.Allocator, from: *const scene.Scene) error{OutOfMemory}!?Extent {
    const pose: pose_file.Pose = try pose_file.compose(gpa, from);
    defer pose.deinit(gpa);
    const used = try gpa.alloc(std.DynamicBitSetUnmanaged, from.meshes.len);
    defer gpa.free(used);
    for (used) |*set| set.* = .{};
    defer for (used) |*set| set.deinit(gpa);

    var extent: Extent = .{
        .lower = @splat(std.math.inf(f64)),
        .upper = @splat(-std.math.inf(f64)),
    };
    for (from.instances) |*instance| {
        const mesh = &from.meshes[instance.mesh];
        const vertices = &used[instance.mesh];
        if (vertices.capacity() == 0) vertices.* = try usedBy(gpa, mesh);
        var iterator = vertices.iterator(.{});
        while (iterator.next()) |vertex| {
            const at = deform.place(mesh, instance, pose.maps, pose.joint_maps, vertex);
            if (vec3d.isFinite(at)) extent.grow(at);
        }
    }
    if (!(extent.lower[0] <= extent.upper[0])) return null;
    for (&extent.lower, &extent.upper, pose.shift) |*lower, *upper, shift| {
        lower.* += shift;
        upper.* += shift;
    }
    return extent;
}

/// The vertices that a mesh draws.
fn usedBy(
    gpa: std.mem.Allocator,
    mesh: *const scene.Mesh,
) error{OutOfMemory}!std.DynamicBitSetUnmanaged {
    var used: std.DynamicBitSetUnmanaged = try .initEmpty(gpa, mesh.positions.len);
    inline for (.{
        std.mem.bytesAsSlice(u32, std.mem.sliceAsBytes(mesh.triangles)),
        mesh.points,
        std.mem.bytesAsSlice(u32, std.mem.sliceAsBytes(mesh.segments)),
    }) |vertices| for (vertices) |vertex| used.set(vertex);
    return used;
}

test "what is drawn, where it stands, far away as well" {
    const gpa = std.testing.allocator;
    for ([_]f64{ 0, 0x1p40 }) |far| {
        var builder: scene.Builder = .init(gpa);
        errdefer builder.deinit();
        const node = try builder.addNode(scene.none, .translate(.{ far, 1, 2 }));
        const material = try builder.addMaterial(.{});
        const mesh = try builder.addMesh(.{
            .positions = &.{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 3, 0 }, .{ 9, 9, 9 } },
            .triangles = &.{.{ 0, 1, 2 }},
            .material = material,
        });
        try builder.addInstance(mesh, node);
        var drawn = try builder.finish();
        defer drawn.deinit();
        const extent = (try of(gpa, &drawn)).?;
        try std.testing.expectEqual(Vec3d{ far, 1, 2 }, extent.lower);
        try std.testing.expectEqual(Vec3d{ far + 1, 4, 2 }, extent.upper);
        drawn.instances = &.{};
        try std.testing.expectEqual(null, try of(gpa, &drawn));
    }
}
