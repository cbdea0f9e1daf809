//! Stage 1: a scene file becomes a `Scene`.
//!
//! In: the path of a glTF 2.0 file, JSON or binary, or of a PBRT scene. Out: a checked `Scene`, or
//! one line that says what is wrong. The format is chosen here and nowhere else.

const std = @import("std");
const Diagnostic = @import("diagnostic.zig").Diagnostic;
const Scene = @import("scene.zig").Scene;
const gltf = @import("parse/gltf.zig");
const pbrt = @import("parse/pbrt.zig");
const Settings = @import("settings.zig").Load;
const Allocator = std.mem.Allocator;
const Resources = @import("parse/resource.zig");

/// Extensions of glTF: what becomes of each.
pub const extensions = @import("parse/gltf/extensions.zig");

/// `InputOutput`: a file is missing or cannot be read. `InvalidInput`: it is read, but it is not
/// what it should be, or it needs what is not supported. `SceneUnknown`,
/// `MaterialVariantUnknown`: none of its scenes, or variants, is the one that is asked for.
pub const Error = Resources.Error || error{ SceneUnknown, MaterialVariantUnknown };

/// Reads the scene at `path`. On an error the diagnostic holds one line without the path in it;
/// what is odd but harmless becomes warnings there. The caller frees the scene with `deinit`.
pub fn parse(
    gpa: Allocator,
    io: std.Io,
    path: []const u8,
    settings: Settings,
    diagnostic: *Diagnostic,
) Error!Scene {
    var opened = try Resources.open(gpa, io, path, settings, diagnostic);
    defer opened.close();
    const resources = &opened.resources;
    var scene = if (std.ascii.endsWithIgnoreCase(path, ".pbrt")) scene: {
        try checkOnly(settings, diagnostic);
        break :scene try pbrt.read(resources, path, opened.main, diagnostic);
    } else try gltf.read(resources, opened.main.bytes, diagnostic);
    scene.file.byte_count = resources.bytes_read;
    return scene;
}

/// Whether what has but one scene, without a name, and no variants is asked for that.
pub fn checkOnly(
    settings: Settings,
    diagnostic: *Diagnostic,
) error{ SceneUnknown, MaterialVariantUnknown }!void {
    const is_only = switch (settings.scene) {
        .default => true,
        .index => |index| index == 0,
        .name => false,
    };
    if (!is_only) return diagnostic.fail(error.SceneUnknown, "there is but one scene, 0", .{});
    if (settings.material_variant != .default)
        return diagnostic.fail(error.MaterialVariantUnknown, "it has no material variants", .{});
}

/// Reads a glTF file that is in memory, JSON or binary; what it names is looked for in `folder`.
/// Otherwise like `parse`.
pub fn parseBytes(
    gpa: Allocator,
    io: std.Io,
    bytes: []const u8,
    folder: std.Io.Dir,
    settings: Settings,
    diagnostic: *Diagnostic,
) Error!Scene {
    var resources: Resources = .{ .gpa = gpa, .io = io, .folder = folder, .settings = settings };
    return gltf.read(&resources, bytes, diagnostic);
}

/// The same for a PBRT text.
pub fn parsePbrt(
    gpa: Allocator,
    io: std.Io,
    bytes: []const u8,
    folder: std.Io.Dir,
    settings: Settings,
    diagnostic: *Diagnostic,
) Error!Scene {
    const copy = try gpa.dupeSentinel(u8, bytes, 0);
    defer gpa.free(copy);
    var resources: Resources = .{ .gpa = gpa, .io = io, .folder = folder, .settings = settings };
    resources.bytes_read = bytes.len;
    return pbrt.read(&resources, "text", .{ .bytes = copy, .identity = null }, diagnostic);
}

test {
    _ = Resources;
    _ = @import("parse/cgltf.zig");
    _ = gltf;
    _ = pbrt;
}

test "a format is chosen by its extension" {
    const gpa = std.testing.allocator;
    const io = std.testing.io;
    var diagnostic: Diagnostic = .{};
    for ([_][]const u8{ "does not exist.glb", "a.pbrt", "A.PBRT" }) |path| {
        const missing = parse(gpa, io, path, .{}, &diagnostic);
        try std.testing.expectError(error.InputOutput, missing);
    }
}
