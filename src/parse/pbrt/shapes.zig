//! Shapes by their names: each becomes triangles in its own space.
//!
//! In: the parameters of a Shape, in a `Maker`. Out: its geometry, turned inside out where
//! ReverseOrientation says so. One file a family stands in shapes/.

const std = @import("std");
const meshes = @import("shapes/meshes.zig");
const nurbs = @import("shapes/nurbs.zig");
const ply = @import("shapes/ply.zig");
const quadrics = @import("shapes/quadrics.zig");
const subdivision = @import("shapes/subdivision.zig");
const Maker = @import("shapes/maker.zig");
const Parameters = @import("parameters.zig");
const Error = @import("input.zig").Error;
const Geometry = Maker.Geometry;
const Vec3 = @import("../../math.zig").Vec3;

/// Names as they stand in the text.
pub const Kind = enum {
    bilinearmesh,
    cone,
    cylinder,
    disk,
    heightfield,
    hyperboloid,
    loopsubdiv,
    nurbs,
    paraboloid,
    plymesh,
    sphere,
    trianglemesh,

    /// Few parameters make many triangles, and often the same ones again.
    pub fn isCurved(kind: Kind) bool {
        return switch (kind) {
            .cone, .cylinder, .disk, .hyperboloid, .paraboloid, .sphere => true,
            else => false,
        };
    }
};

/// Makes the shape that the maker's parameters tell.
pub fn make(maker: *Maker, kind: Kind, reverse: bool) Error!Geometry {
    const geometry = try switch (kind) {
        .bilinearmesh => meshes.bilinear(maker),
        .cone => quadrics.cone(maker),
        .cylinder => quadrics.cylinder(maker),
        .disk => quadrics.disk(maker),
        .heightfield => meshes.heightfield(maker),
        .hyperboloid => quadrics.hyperboloid(maker),
        .loopsubdiv => subdivision.loop(maker),
        .nurbs => nurbs.nurbs(maker),
        .paraboloid => quadrics.paraboloid(maker),
        .plymesh => ply.mesh(maker),
        .sphere => quadrics.sphere(maker),
        .trianglemesh => meshes.triangles(maker),
    };
    if (!reverse) return geometry;
    for (geometry.triangles) |*corners| std.mem.swap(u32, &corners[1], &corners[2]);
    if (geometry.normals) |normals| {
        for (normals) |*normal| normal.* = .{ -normal[0], -normal[1], -normal[2] };
    }
    return geometry;
}

/// The same surface seen from behind, flat.
pub fn turned(maker: *Maker, geometry: *const Geometry) Error!Geometry {
    const triangles = try maker.alloc([3]u32, geometry.triangles.len);
    for (geometry.triangles, triangles) |from, *to| to.* = .{ from[0], from[2], from[1] };
    return .{ .positions = geometry.positions, .triangles = triangles };
}

/// A number for all that a curved shape depends on.
pub fn hash(kind: Kind, reverse: bool, parameters: *const Parameters) u64 {
    var state: std.hash.Wyhash = .init(@backingInt(kind));
    state.update(&.{@intFromBool(reverse)});
    for (parameters.items.items) |*parameter| {
        state.update(parameter.name);
        state.update(&.{@backingInt(parameter.type)});
        state.update(std.mem.sliceAsBytes(parameters.floatsOf(parameter)));
        state.update(std.mem.sliceAsBytes(parameters.integersOf(parameter)));
    }
    return state.final();
}

test {
    _ = meshes;
    _ = nurbs;
    _ = ply;
    _ = quadrics;
    _ = subdivision;
}
