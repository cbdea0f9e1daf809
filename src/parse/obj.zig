//! OBJ with MTL: a text becomes a `Scene`.
//!
//! In: the bytes of a file. Out: a scene of a mesh for each material and each kind of what it
//! draws. docs/meshes.md tells what is read and what stands for what.

const std = @import("std");
const scene = @import("../scene.zig");
const Assembly = @import("obj/assembly.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Materials = @import("obj/materials.zig");
const Polygon = @import("polygon.zig");
const Reader = @import("obj/reader.zig");
const Resources = @import("resource.zig");
const Words = @import("obj/words.zig");
const markBytes = @import("format.zig").markBytes;

/// Reads a text that is in memory; what it names comes from `resources`. `path` is that of the
/// text, beside which a library may be that it names wrongly.
pub fn read(
    resources: *Resources,
    path: []const u8,
    bytes: [:0]const u8,
    diagnostic: *Diagnostic,
) Resources.Error!scene.Scene {
    const gpa = resources.gpa;
    const joined = try Words.joined(gpa, bytes);
    defer if (joined) |copy| gpa.free(copy);
    const whole = joined orelse bytes;
    const text = whole[markBytes(whole)..];
    var reader: Reader = .{ .gpa = gpa, .words = .{ .text = text }, .diagnostic = diagnostic };
    defer reader.deinit();
    try reader.run();
    var arena: std.heap.ArenaAllocator = .init(gpa);
    defer arena.deinit();
    var builder: scene.Builder = .init(gpa);
    errdefer builder.deinit();
    builder.scene.file.format = .obj;
    var materials: Materials = .{
        .resources = resources,
        .builder = &builder,
        .reader = &reader,
        .diagnostic = diagnostic,
        .arena = arena.allocator(),
        .images = .{
            .files = .{ .resources = resources, .builder = &builder },
            .diagnostic = diagnostic,
            .arena = arena.allocator(),
        },
        .library = .{ .arena = arena.allocator(), .diagnostic = diagnostic },
    };
    defer materials.deinit();
    try materials.load(std.fs.path.stem(path));
    var assembly: Assembly = .{
        .gpa = gpa,
        .reader = &reader,
        .builder = &builder,
        .materials = &materials,
        .diagnostic = diagnostic,
        .cutter = .{ .gpa = gpa, .steps_left = Polygon.stepsMax(bytes.len) },
    };
    defer assembly.deinit();
    try assembly.run();
    if (builder.instances.items.len == 0)
        diagnostic.warn("nothing to render: no faces, lines or points", .{});
    return builder.finish();
}

test {
    _ = Assembly;
    _ = Materials;
    _ = Reader;
    _ = Words;
}
