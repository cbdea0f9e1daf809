//! Shapes by their names: each becomes triangles in its own space.
//!
//! In: the parameters of a Shape, in a `Tessellator`. Out: its geometry, turned inside out where
//! ReverseOrientation says so. One file a family stands in shapes/.

const std = @import("std");
const meshes = @import("shapes/meshes.zig");
const nurbs = @import("shapes/nurbs.zig");
const ply = @import("shapes/ply.zig");
const quadrics = @import("shapes/quadrics.zig");
const subdivision = @import("shapes/subdivision.zig");
const Tessellator = @import("shapes/tessellator.zig");
const Parameters = @import("parameters.zig");
const Error = @import("input.zig").Error;
const Geometry = Tessellator.Geometry;
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

/// Makes the shape that the tessellator's parameters tell.
pub fn make(tessellator: *Tessellator, kind: Kind, reverse: bool) Error!Geometry {
    const geometry = try switch (kind) {
        .bilinearmesh => meshes.bilinear(tessellator),
        .cone => quadrics.cone(tessellator),
        .cylinder => quadrics.cylinder(tessellator),
        .disk => quadrics.disk(tessellator),
        .heightfield => meshes.heightfield(tessellator),
        .hyperboloid => quadrics.hyperboloid(tessellator),
        .loopsubdiv => subdivision.loop(tessellator),
        .nurbs => nurbs.nurbs(tessellator),
        .paraboloid => quadrics.paraboloid(tessellator),
        .plymesh => ply.mesh(tessellator),
        .sphere => quadrics.sphere(tessellator),
        .trianglemesh => meshes.triangles(tessellator),
    };
    if (!reverse) return geometry;
    for (geometry.triangles) |*corners| std.mem.swap(u32, &corners[1], &corners[2]);
    if (geometry.normals) |normals| {
        for (normals) |*normal| normal.* = .{ -normal[0], -normal[1], -normal[2] };
    }
    return geometry;
}

/// The same surface seen from behind, flat.
pub fn turned(tessellator: *Tessellator, geometry: *const Geometry) Error!Geometry {
    const triangles = try tessellator.alloc([3]u32, geometry.triangles.len);
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
