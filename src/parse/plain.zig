//! Scenes of one mesh: what STL and PLY files hold.
//!
//! In: a mesh in the scene's memory, and what it is coloured by. Out: a scene that shows it where
//! it is, with a material of no particular kind: these formats say nothing of surfaces. What has
//! neither faces nor normals is not lit.

const std = @import("std");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Resources = @import("resource.zig");
const scene = @import("../scene.zig");

/// Of what has no other: grey, neither dull nor shiny, without a back.
pub const material: scene.Material = .{
    .base_color = .{ 0.5, 0.5, 0.5, 1 },
    .metallic = 0,
    .roughness = 0.6,
    .double_sided = true,
};

/// How a mesh is coloured.
pub const Look = struct {
    has_alpha: bool = false,
    texture: ?scene.TextureView = null,
};

/// Ends a scene with `mesh`, whose material this makes, as all that there is.
pub fn finish(
    builder: *scene.Builder,
    mesh: scene.Mesh,
    look: Look,
    diagnostic: *Diagnostic,
) error{OutOfMemory}!scene.Scene {
    var own = material;
    own.base_color_texture = look.texture;
    if (mesh.colors != null or look.texture != null) own.base_color = .{ 1, 1, 1, 1 };
    if (look.has_alpha) own.alpha_mode = .blend;
    own.unlit = mesh.triangles.len == 0 and mesh.normals == null;
    var placed = mesh;
    placed.material = try builder.addMaterial(own);
    if (mesh.isEmpty())
        diagnostic.warn("nothing to render: no triangles", .{})
    else
        try builder.addWorldMesh(placed);
    return builder.finish();
}
