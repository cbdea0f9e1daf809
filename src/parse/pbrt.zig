//! PBRT scenes: a text in the dialects of PBRT's versions 2 and 3, and of 4 as far as they differ
//! in names, becomes a `Scene`.
//!
//! In: a text. Out: a checked `Scene`; nothing of the text remains. docs/pbrt.md tells what is
//! read, and what stands for what is not.

const std = @import("std");
const scene_data = @import("../scene.zig");
const SceneBuilder = @import("pbrt/scene_builder.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Input = @import("pbrt/input.zig");
const Reader = @import("pbrt/reader.zig");
const Progress = @import("../progress.zig").Progress;
const Resources = @import("resource.zig");
const Scene = scene_data.Scene;

/// See parse.zig.
pub const Error = Input.Error;

/// Reads a text that is in memory; what it names comes from `resources`. `path` is that of the
/// text, for messages.
pub fn read(
    resources: *Resources,
    path: []const u8,
    main: Resources.File,
    diagnostic: *Diagnostic,
) Error!Scene {
    const gpa = resources.gpa;
    var input: Input = .{
        .gpa = gpa,
        .resources = resources,
        .folder_name = std.fs.path.dirname(path) orelse "",
        .diagnostic = diagnostic,
    };
    defer input.deinit();
    Progress.begin(resources.settings.progress, .{ .stage = .parsing });
    try input.push(path, main);
    try input.start();
    var scene_builder: scene_data.Builder = .init(gpa);
    errdefer scene_builder.deinit();
    scene_builder.scene.file.format = .pbrt;
    var names: std.heap.ArenaAllocator = .init(gpa);
    defer names.deinit();
    var builder: SceneBuilder = try .init(&input, &scene_builder);
    defer builder.deinit();
    var reader: Reader = .{
        .input = &input,
        .arena = names.allocator(),
        .builder = &builder,
        .colors = .{ .arena = names.allocator(), .input = &input, .textures = .{
            .input = &input,
            .files = .{ .resources = input.resources, .builder = &scene_builder },
            .arena = names.allocator(),
        } },
        .tessellator = .{ .input = &input, .arena = scene_builder.arena() },
    };
    defer reader.deinit();
    try reader.run();
    try reader.finish();
    const scene = try scene_builder.finish();
    if (scene.triangleCount() == 0) diagnostic.warn("nothing to render: no triangles", .{});
    return scene;
}

test {
    _ = @import("pbrt/colors.zig");
    _ = @import("pbrt/defaults.zig");
    _ = @import("pbrt/lights.zig");
    _ = @import("pbrt/materials.zig");
    _ = @import("pbrt/parameters.zig");
    _ = @import("pbrt/shapes.zig");
    _ = @import("pbrt/spectra.zig");
    _ = @import("pbrt/textures.zig");
    _ = @import("pbrt/transform.zig");
    _ = @import("pbrt/view.zig");
    _ = SceneBuilder;
    _ = Input;
    _ = Reader;
}
