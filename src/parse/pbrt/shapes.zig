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
const Error = @import("input.zig").Error;
const Geometry = Tessellator.Geometry;
const Vec3 = @import("../../math.zig").Vec3;

/// A kind of shapes.
pub const Kind = struct {
    make: *const fn (tessellator: *Tessellator) Error!Geometry,
    /// Few parameters make many triangles, and often the same ones again.
    is_curved: bool = false,
};

/// By their names as they stand in the text.
pub const kinds: std.StaticStringMap(Kind) = .initComptime(.{
    .{ "bilinearmesh", Kind{ .make = meshes.bilinear } },
    .{ "cone", Kind{ .make = quadrics.cone, .is_curved = true } },
    .{ "cylinder", Kind{ .make = quadrics.cylinder, .is_curved = true } },
    .{ "disk", Kind{ .make = quadrics.disk, .is_curved = true } },
    .{ "heightfield", Kind{ .make = meshes.heightfield } },
    .{ "hyperboloid", Kind{ .make = quadrics.hyperboloid, .is_curved = true } },
    .{ "loopsubdiv", Kind{ .make = subdivision.loop } },
    .{ "nurbs", Kind{ .make = nurbs.nurbs } },
    .{ "paraboloid", Kind{ .make = quadrics.paraboloid, .is_curved = true } },
    .{ "plymesh", Kind{ .make = ply.mesh } },
    .{ "sphere", Kind{ .make = quadrics.sphere, .is_curved = true } },
    .{ "trianglemesh", Kind{ .make = meshes.triangles } },
});

/// Makes the shape that the tessellator's parameters tell.
pub fn make(tessellator: *Tessellator, kind: Kind, reverse: bool) Error!Geometry {
    const geometry = try kind.make(tessellator);
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
    return .{
        .positions = geometry.positions,
        .texcoords = geometry.texcoords,
        .triangles = triangles,
    };
}

/// A number for all that a curved shape depends on.
pub fn hash(tessellator: *const Tessellator, reverse: bool) u64 {
    const parameters = tessellator.parameters;
    var state: std.hash.Wyhash = .init(@intFromBool(reverse));
    state.update(tessellator.name);
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
