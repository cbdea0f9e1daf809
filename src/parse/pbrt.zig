//! PBRT scenes: a text in the dialects of PBRT's versions 2 and 3, and of 4 as far as they differ
//! in names, becomes a `Scene`.
//!
//! In: a text. Out: a checked `Scene`; nothing of the text remains. docs/pbrt.md tells what is
//! read, and what stands for what is not.

const std = @import("std");
const decode = @import("../decode.zig");
const scene_data = @import("../scene.zig");
const SceneBuilder = @import("pbrt/scene_builder.zig");
const diagnostic_file = @import("../diagnostic.zig");
const Diagnostic = diagnostic_file.Diagnostic;
const Message = diagnostic_file.Message;
const Input = @import("pbrt/input.zig");
const Reader = @import("pbrt/reader.zig");
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
    const plain = try plainOf(&input, path, main.bytes);
    defer if (plain) |bytes| gpa.free(bytes);
    try input.push(path, .{ .bytes = plain orelse main.bytes, .identity = main.identity });
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

/// What a scene file holds that gzip has compressed, for the caller to free; null: it is plain.
fn plainOf(input: *Input, path: []const u8, file: []const u8) Error!?[:0]u8 {
    if (!decode.gzip.isGzip(file)) return null;
    var reason: Message = .{};
    const plain = input.inflate(file, &reason) catch |err| switch (err) {
        error.OutOfMemory => |failure| return failure,
        error.InvalidGzip => return input.diagnostic.invalid("{s}", .{reason.text()}),
    };
    errdefer input.gpa.free(plain);
    if (!std.ascii.endsWithIgnoreCase(path, ".gz"))
        try input.forgiveFile("is gzip without being called so", .{});
    return plain;
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
