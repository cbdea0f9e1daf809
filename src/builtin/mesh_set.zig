//! One mesh for each material of a procedural scene, all standing at the same place while a part
//! of the scene is added to them.

const std = @import("std");
const geometry = @import("geometry.zig");
const scene_data = @import("../scene.zig");
const MeshBuilder = @import("mesh_builder.zig");
const Builder = scene_data.Builder;
const Allocator = std.mem.Allocator;

/// A mesh for each tag of the enum `Part`.
pub fn MeshSet(comptime Part: type) type {
    return struct {
        meshes: std.EnumArray(Part, MeshBuilder),

        const Set = @This();

        /// Empty meshes whose memory comes from `arena`.
        pub fn init(arena: Allocator) Set {
            return .{ .meshes = .initFill(.init(arena)) };
        }

        /// The mesh of a material.
        pub fn get(set: *Set, part: Part) *MeshBuilder {
            return set.meshes.getPtr(part);
        }

        /// Where the next vertices of all meshes go.
        pub fn setPlace(set: *Set, place: geometry.Place) void {
            for (&set.meshes.values) |*mesh| mesh.place = place;
        }

        /// Adds the meshes with their materials to the scene. Asserts that none is empty.
        pub fn finish(
            set: *Set,
            builder: *Builder,
            materials: std.EnumArray(Part, scene_data.Material),
        ) Allocator.Error!void {
            for (&set.meshes.values, materials.values) |*mesh, look| {
                const material = try builder.addMaterial(look);
                try builder.addWorldMesh(try mesh.finish(material));
            }
        }
    };
}

test "meshes keep to their materials" {
    const Part = enum { stone, wood };
    var builder: Builder = .init(std.testing.allocator);
    defer builder.deinit();
    var set: MeshSet(Part) = .init(builder.arena());
    set.setPlace(.translate(.{ 1, 2, 3 }));
    try set.get(.stone).box(.{ 0, 0, 0 }, .{ 1, 1, 1 });
    try set.get(.wood).quad(.{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 1, 1, 0 }, .{ 0, 1, 0 });
    try set.finish(&builder, .init(.{
        .stone = .{ .roughness = 0.5 },
        .wood = .{ .roughness = 0.25 },
    }));
    const meshes = builder.meshes.items;
    try std.testing.expectEqual(10, meshes[0].triangles.len);
    try std.testing.expectEqual(2, meshes[1].triangles.len);
    try std.testing.expectEqual([3]f32{ 1, 2, 3 }, meshes[1].positions[0]);
    const materials = builder.materials.items;
    try std.testing.expectEqual(0.5, materials[meshes[0].material].roughness);
    try std.testing.expectEqual(0.25, materials[meshes[1].material].roughness);
}
