//! PLY files as scenes: a mesh, lines or a cloud of points.
//!
//! In: the bytes of a file. Out: a scene of one mesh. Colours of vertices or faces are its base
//! colours; the image that the header's comment `TextureFile` names, as MeshLab writes it, is
//! multiplied with them where there are coordinates.

const std = @import("std");
const orientation = @import("orientation.zig");
const plain = @import("plain.zig");
const ply = @import("ply.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Message = @import("../diagnostic.zig").Message;
const NamedImages = @import("named_images.zig");
const Resources = @import("resource.zig");
const scene = @import("../scene.zig");
const markBytes = @import("format.zig").markBytes;

/// Reads a file that is in memory; what it names comes from `resources`.
pub fn read(
    resources: *Resources,
    bytes: [:0]const u8,
    diagnostic: *Diagnostic,
) Resources.Error!scene.Scene {
    const gpa = resources.gpa;
    var builder: scene.Builder = .init(gpa);
    errdefer builder.deinit();
    builder.scene.file.format = .ply;
    var reason: Message = .{};
    const text = bytes[markBytes(bytes)..];
    const mesh = ply.read(gpa, builder.arena(), text, .{}, &reason) catch |err| switch (err) {
        error.OutOfMemory => |failure| return failure,
        error.InvalidPly => return diagnostic.invalid("{s}", .{reason.text()}),
    };
    if (mesh.not_finite_count > 0) diagnostic.forgive(
        "{d} faces, edges or points whose places are not finite are left out",
        .{mesh.not_finite_count},
    );
    if (mesh.dropped_count > 0) diagnostic.forgive(
        "{d} normals or coordinates of textures that are not finite are dropped",
        .{mesh.dropped_count},
    );
    if (mesh.is_alpha_dropped) diagnostic.warn("alpha is 0 everywhere: taken as opaque", .{});
    // Upwards in files, downwards in scenes.
    if (mesh.texcoords) |texcoords| for (texcoords) |*texcoord| {
        texcoord[1] = 1 - texcoord[1];
    };
    if (mesh.normals) |normals| orientation.orient(mesh.positions, normals, mesh.triangles);
    const texture = if (mesh.texcoords != null and mesh.texture_file != null)
        try textureOf(resources, &builder, mesh.texture_file.?, diagnostic)
    else
        null;
    return plain.finish(&builder, .{
        .positions = mesh.positions,
        .normals = mesh.normals,
        .colors = mesh.colors,
        .texcoords = .{ if (texture != null) mesh.texcoords else null, null, null, null },
        .triangles = mesh.triangles,
        .segments = mesh.segments,
        .points = mesh.points,
        .material = scene.none,
    }, .{ .has_alpha = mesh.has_alpha, .texture = texture }, diagnostic);
}

fn textureOf(
    resources: *Resources,
    builder: *scene.Builder,
    name: []const u8,
    diagnostic: *Diagnostic,
) Resources.Error!?scene.TextureView {
    var arena: std.heap.ArenaAllocator = .init(resources.gpa);
    defer arena.deinit();
    var images: NamedImages = .{
        .files = .{ .resources = resources, .builder = builder },
        .diagnostic = diagnostic,
        .arena = arena.allocator(),
    };
    defer images.deinit();
    const image = try images.get("", name) orelse return null;
    return .{ .texture = try builder.addTexture(.{ .image = image }) };
}
