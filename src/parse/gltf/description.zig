//! What a glTF file says of itself: generator, scenes, extensions, how much there is of what, and
//! what it calls things.
//!
//! In: a document that has been checked. Out: `scene.File` and `scene.Names`, their texts in the
//! scene's memory.

const std = @import("std");
const choice = @import("choice.zig");
const c = @import("../cgltf.zig");
const escapes = @import("../json/escapes.zig");
const scene = @import("../../scene.zig");
const Source = @import("source.zig");
const Error = error{OutOfMemory};

/// Completes the description, and gathers the names, of the file whose scene `shown` is read; null:
/// all of its nodes are. Of animations cgltf may not know.
pub fn read(
    source: *const Source,
    shown: ?*const c.cgltf_scene,
    animation_count: usize,
) Error!void {
    const data = source.data;
    const scenes = try source.arena.alloc([]const u8, data.scenes_count);
    for (scenes, Source.slice(data.scenes, data.scenes_count)) |*name, *one| {
        name.* = try choice.nameOf(source.arena, one) orelse "";
    }
    const before = source.builder.scene.file;
    source.builder.scene.file = .{
        .format = before.format,
        .needs_force = before.needs_force,
        .version = try textOf(source, data.asset.version),
        .generator = try textOf(source, data.asset.generator),
        .scenes = scenes,
        .scene_shown = if (shown) |one| Source.indexOf(data.scenes, one) else scene.none,
        .extensions = try extensionsOf(source),
        .counts = .{
            .nodes = data.nodes_count,
            .meshes = data.meshes_count,
            .materials = data.materials_count,
            .textures = data.textures_count,
            .images = data.images_count,
            .skins = data.skins_count,
            .animations = animation_count,
            .cameras = data.cameras_count,
            .lights = data.lights_count,
        },
    };
    source.builder.scene.names = .{
        .nodes = try namesOf(source, Source.slice(data.nodes, data.nodes_count)),
        .meshes = try namesOf(source, Source.slice(data.meshes, data.meshes_count)),
        .materials = try namesOf(source, Source.slice(data.materials, data.materials_count)),
    };
}

fn namesOf(source: *const Source, list: anytype) Error![]const []const u8 {
    const names = try source.arena.alloc([]const u8, list.len);
    for (names, list) |*name, *one| name.* = try choice.nameOf(source.arena, one) orelse "";
    return names;
}

fn textOf(source: *const Source, raw: [*c]const u8) Error![]const u8 {
    if (raw == null) return "";
    return escapes.decodeString(source.arena, std.mem.span(@as([*:0]const u8, raw)));
}

/// Those that are required, also where the file does not say that it uses them, and then the rest.
fn extensionsOf(source: *const Source) Error![]const scene.File.Extension {
    const data = source.data;
    var known: std.StringArrayHashMapUnmanaged(bool) = .empty;
    defer known.deinit(source.gpa);
    for ([_][]const [*c]u8{
        Source.slice(data.extensions_required, data.extensions_required_count),
        Source.slice(data.extensions_used, data.extensions_used_count),
    }, [_]bool{ true, false }) |list, required| for (list) |raw| {
        const entry = try known.getOrPut(source.gpa, std.mem.span(@as([*:0]const u8, raw)));
        if (!entry.found_existing) entry.value_ptr.* = required;
    };
    const extensions = try source.arena.alloc(scene.File.Extension, known.count());
    for (extensions, known.keys(), known.values()) |*extension, name, required| {
        extension.* = .{
            .name = try escapes.decodeString(source.arena, name),
            .required = required,
        };
    }
    return extensions;
}
