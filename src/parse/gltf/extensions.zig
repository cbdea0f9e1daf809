//! Extensions of glTF: one table of what is known, and what becomes of each.
//!
//! What a file requires and what a picture lacks is judged by it, `raylane info` prints it, and
//! docs/formats.md has the same rows. What is not in it is unknown: it may change anything.

const std = @import("std");
const draco = @import("../../decode.zig").draco;

/// What becomes of what an extension says.
pub const Treatment = enum {
    /// It is read, and drawn as its text says.
    rendered,
    /// It is read, and drawn in part or by other means; the remark says how.
    approximated,
    /// Nothing of it is read.
    ignored,
};

/// What is missing of a picture without an extension.
pub const Lack = enum {
    nothing,
    /// The shapes are right, their colours are not.
    looks,
    /// Other forms of images, without which there are textures that have none; these are warned of
    /// one by one.
    images,
    /// Another form of meshes, which are there as well unless it is required; the remark says what
    /// would read it.
    other_meshes,
    shapes,
};

pub const Extension = struct {
    name: []const u8,
    treatment: Treatment,
    /// Where it is ignored.
    lack: Lack = .nothing,
    /// A few words without a full stop.
    remark: []const u8,

    /// Whether a file that requires it can be drawn, even if something is missing.
    pub fn mayBeRequired(extension: *const Extension) bool {
        if (extension.treatment != .ignored) return true;
        return switch (extension.lack) {
            .nothing, .looks, .images => true,
            .other_meshes, .shapes => false,
        };
    }

    /// Whether a warning names it wherever a file uses it.
    pub fn isMissed(extension: *const Extension) bool {
        if (extension.treatment != .ignored) return false;
        return switch (extension.lack) {
            .nothing, .images, .other_meshes => false,
            .looks, .shapes => true,
        };
    }
};

/// All that are known, by name.
pub const all: []const Extension = &.{
    ignored("ADOBE_materials_clearcoat_specular", .looks, "the coat's index is 1.5"),
    ignored("ADOBE_materials_clearcoat_tint", .looks, "coats have no colour"),
    ignored("ADOBE_materials_thin_transparency", .looks, "see KHR_materials_transmission"),
    ignored("AGI_articulations", .nothing, "names of movable parts"),
    ignored("AGI_stk_metadata", .nothing, "data"),
    ignored("BENTLEY_materials_line_style", .looks, "lines are as wide as --point-size"),
    ignored("BENTLEY_materials_planar_fill", .looks, "filled as other triangles"),
    ignored("BENTLEY_materials_point_style", .looks, "points are as wide as --point-size"),
    ignored("CESIUM_primitive_outline", .looks, "no outlines"),
    ignored("CESIUM_RTC", .nothing, "moves the model as a whole"),
    ignored("EXT_feature_metadata", .nothing, "data"),
    ignored("EXT_instance_features", .nothing, "data"),
    ignored("EXT_lights_ies", .looks, "such lights are left out"),
    rendered("EXT_lights_image_based", "the finest level; irradiance is made from it"),
    ignored("EXT_mesh_features", .nothing, "data"),
    rendered("EXT_mesh_gpu_instancing", "not together with a skin"),
    ignored("EXT_mesh_manifold", .nothing, "data"),
    ignored("EXT_mesh_primitive_edge_visibility", .looks, "no outlines"),
    rendered("EXT_meshopt_compression", "all modes and filters"),
    ignored("EXT_structural_metadata", .nothing, "data"),
    ignored("EXT_texture_astc", .images, "the image that stands beside it"),
    ignored("EXT_texture_avif", .images, "the image that stands beside it"),
    rendered("EXT_texture_webp", "preferred to the image that stands beside it"),
    ignored("FB_geometry_metadata", .nothing, "data"),
    ignored("FB_materials_modmap", .looks, "such textures are left out"),
    ignored("FB_ngon_encoding", .nothing, "the triangles are drawn"),
    ignored("GODOT_single_root", .nothing, "for editors"),
    ignored("GRIFFEL_bim_data", .nothing, "data"),
    ignored("KHR_accessor_float64", .shapes, "accessors of doubles"),
    rendered("KHR_animation_pointer", "what docs/animation.md lists"),
    ignored("KHR_audio_emitter", .nothing, "sound"),
    if (draco.is_held)
        rendered("KHR_draco_mesh_compression", draco_remark)
    else
        ignored("KHR_draco_mesh_compression", .other_meshes, draco_remark),
    ignored("KHR_gaussian_splatting", .looks, "splats are points"),
    ignored("KHR_implicit_shapes", .nothing, "shapes of colliders"),
    ignored("KHR_interactivity", .nothing, "behaviour"),
    rendered("KHR_lights_punctual", "see docs/lights.md"),
    rendered("KHR_materials_anisotropy", "from an environment by 8 lookups"),
    rendered("KHR_materials_clearcoat", "rough coats see the environment alone"),
    rendered("KHR_materials_diffuse_transmission", "Lambert on the other side"),
    approximated("KHR_materials_dispersion", "three rays: red, green, blue; in volumes only"),
    rendered("KHR_materials_emissive_strength", "as light see docs/lights.md"),
    rendered("KHR_materials_ior", "Fresnel by Schlick"),
    approximated("KHR_materials_iridescence", "two terms of the series, at the view's angle"),
    rendered("KHR_materials_pbrSpecularGlossiness", "in place of metallic-roughness"),
    rendered("KHR_materials_sheen", "Charlie, its albedo by a fit"),
    rendered("KHR_materials_specular", "weight and colour"),
    ignored("KHR_materials_subsurface", .looks, "a draft"),
    rendered("KHR_materials_transmission", "rough walls by 4 rays"),
    rendered("KHR_materials_unlit", "as painted, not exposed"),
    rendered("KHR_materials_variants", "by --material-variant"),
    rendered("KHR_materials_volume", "traced; thickness only says that there is a volume"),
    approximated("KHR_materials_volume_scatter", "one scattering traced, more are estimated"),
    rendered("KHR_mesh_primitive_restart", "strips, fans and loops begin anew"),
    rendered("KHR_mesh_quantization", "every type of component"),
    rendered("KHR_meshopt_compression", "all modes and filters"),
    ignored("KHR_node_hoverability", .nothing, "behaviour"),
    ignored("KHR_node_selectability", .nothing, "behaviour"),
    rendered("KHR_node_visibility", "of meshes and lights"),
    ignored("KHR_physics_rigid_bodies", .nothing, "behaviour"),
    ignored("KHR_techniques_webgl", .looks, "shaders: such materials are white"),
    rendered("KHR_texture_basisu", "preferred to the image that stands beside it"),
    rendered("KHR_texture_transform", "of every texture"),
    ignored("KHR_xmp", .nothing, "data"),
    ignored("KHR_xmp_json_ld", .nothing, "data"),
    ignored("MOZ_hubs_components", .nothing, "behaviour"),
    ignored("MOZ_lightmap", .looks, "light is traced, none is baked"),
    ignored("MSFT_audio_emitter", .nothing, "sound"),
    ignored("MSFT_lod", .nothing, "the finest level is drawn"),
    ignored("MSFT_packing_normalRoughnessMetallic", .nothing, "the core's textures are read"),
    ignored("MSFT_packing_occlusionRoughnessMetallic", .nothing, "the core's textures are read"),
    ignored("MSFT_texture_dds", .images, "the image that stands beside it"),
    ignored("NV_materials_mdl", .looks, "the core's material is drawn"),
    ignored("OMI_collider", .nothing, "behaviour"),
    ignored("OMI_physics_body", .nothing, "behaviour"),
    ignored("OMI_physics_shape", .nothing, "behaviour"),
    ignored("OMI_seat", .nothing, "behaviour"),
    ignored("OMI_spawn_point", .nothing, "behaviour"),
    ignored("VRM", .looks, "its materials are drawn as the core's"),
    ignored("VRMC_materials_mtoon", .looks, "drawn as the core's material"),
    ignored("VRMC_node_constraint", .nothing, "nodes stand as they are"),
    ignored("VRMC_springBone", .nothing, "behaviour"),
    ignored("VRMC_vrm", .nothing, "data"),
};

const draco_remark = "needs a build with Draco (-Ddraco)";

fn rendered(name: []const u8, remark: []const u8) Extension {
    return .{ .name = name, .treatment = .rendered, .remark = remark };
}

fn approximated(name: []const u8, remark: []const u8) Extension {
    return .{ .name = name, .treatment = .approximated, .remark = remark };
}

fn ignored(name: []const u8, lack: Lack, remark: []const u8) Extension {
    return .{ .name = name, .treatment = .ignored, .lack = lack, .remark = remark };
}

/// The row with this name; null: it is unknown.
pub fn find(name: []const u8) ?*const Extension {
    for (all) |*extension| if (std.mem.eql(u8, extension.name, name)) return extension;
    return null;
}

test "names are in order, each once" {
    for (all[0 .. all.len - 1], all[1..]) |*one, *next| {
        errdefer std.debug.print("{s} stands before {s}\n", .{ one.name, next.name });
        try std.testing.expect(std.ascii.orderIgnoreCase(one.name, next.name) == .lt);
    }
}

test "docs/formats.md has every row" {
    const gpa = std.testing.allocator;
    const folder: std.Io.Dir = .cwd();
    const limit: std.Io.Limit = .limited(1 << 20);
    const text = try folder.readFileAlloc(std.testing.io, "docs/formats.md", gpa, limit);
    defer gpa.free(text);
    var buffer: [256]u8 = undefined;
    for (all) |*extension| {
        // What some builds lack is there as others have it.
        const treatment = if (extension.lack == .other_meshes) .rendered else extension.treatment;
        const row = try std.mem.print(&buffer, "\n| {s} | {t} | {s} |\n", .{
            extension.name, treatment, extension.remark,
        });
        errdefer std.debug.print("missing:{s}", .{row});
        try std.testing.expect(std.mem.find(u8, text, row) != null);
    }
}

test "what is missing decides whether an extension may be required" {
    try std.testing.expect(find("KHR_materials_ior").?.mayBeRequired());
    try std.testing.expect(find("KHR_xmp").?.mayBeRequired());
    try std.testing.expect(!find("KHR_xmp").?.isMissed());
    try std.testing.expect(find("EXT_lights_ies").?.mayBeRequired());
    try std.testing.expect(find("EXT_lights_ies").?.isMissed());
    try std.testing.expect(find("MSFT_texture_dds").?.mayBeRequired());
    try std.testing.expect(!find("KHR_accessor_float64").?.mayBeRequired());
    const compression = find("KHR_draco_mesh_compression").?;
    try std.testing.expectEqual(draco.is_held, compression.mayBeRequired());
    try std.testing.expect(!compression.isMissed());
    try std.testing.expectEqual(null, find("KHR_materials_io"));
}
