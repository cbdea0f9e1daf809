//! What is in a scene file as one JSON object in one line; docs/info.md has the keys. They grow in
//! number but never change their meaning.

const std = @import("std");
const info_file = @import("../info.zig");
const report = @import("../report.zig");
const scene_data = @import("../scene.zig");
const Info = info_file.Info;
const Stringify = std.json.Stringify;
const Text = report.Text;
const Writer = std.Io.Writer;
const writeFields = report.writeFields;

/// Writes all that is known, and a line end.
pub fn write(info: *const Info, writer: *Writer) Writer.Error!void {
    const scene = info.scene;
    const file = &scene.file;
    const map = if (scene.environment) |*map| map else null;
    var json: Stringify = .{ .writer = writer };
    try json.beginObject();
    try writeFields(&json, .{
        .version = Text{ .bytes = info.version },
        .@"error" = null,
        .file = Text{ .bytes = info.name },
        .bytes = file.byte_count,
    });
    try writeFiles(&json, file.files);
    try writeFields(&json, .{
        .format = file.format,
        .format_version = optional(file.version),
        .generator = optional(file.generator),
    });
    try writeScenes(&json, file);
    try writeCameras(&json, scene);
    try writeAnimations(&json, scene.animations);
    try writeFields(&json, .{
        .lights = .{
            .point = info.lights.by_kind.get(.point),
            .spot = info.lights.by_kind.get(.spot),
            .directional = info.lights.by_kind.get(.directional),
            .emissive_materials = info.lights.material_count,
            .emissive_triangles = info.lights.triangle_count,
            .environment = if (map) |present| present.projection else null,
        },
        .material_variants = report.Texts{ .list = scene.material_variants },
    });
    try writeImages(&json, info.images);
    try writeFields(&json, .{
        .counts = info.counts,
        .drawn = .{
            .instances = info.drawn.instance_count,
            .triangles = info.drawn.triangle_count,
            .unique_triangles = info.drawn.unique_triangle_count,
            .points = info.drawn.point_count,
            .lines = info.drawn.line_count,
        },
        .bounds = info.extent,
        .picture = .{ .width = info.size[0], .height = info.size[1] },
        .memory_bytes = info.memory_bytes,
    });
    try writeExtensions(&json, file.extensions);
    try writeFields(&json, .{
        .needs_force = file.needs_force,
        .warnings = report.Texts{ .list = info.warnings },
    });
    try json.endObject();
    try writer.writeByte('\n');
}

/// Writes why a file cannot be described, and a line end.
pub fn writeFailure(
    version: []const u8,
    file: []const u8,
    problem: *const report.Problem,
    warnings: []const []const u8,
    writer: *Writer,
) Writer.Error!void {
    var json: Stringify = .{ .writer = writer };
    try json.beginObject();
    try writeFields(&json, .{
        .version = Text{ .bytes = version },
        .@"error" = problem,
        .file = Text{ .bytes = file },
        .warnings = report.Texts{ .list = warnings },
    });
    try json.endObject();
    try writer.writeByte('\n');
}

fn optional(text: []const u8) ?Text {
    return if (text.len > 0) .{ .bytes = text } else null;
}

fn writeFiles(json: *Stringify, files: []const scene_data.File.Source) Writer.Error!void {
    try json.objectField("files");
    try json.beginArray();
    for (files) |*source| try json.write(.{
        .path = Text{ .bytes = source.path },
        .bytes = source.byte_count,
    });
    try json.endArray();
}

fn writeScenes(json: *Stringify, file: *const scene_data.File) Writer.Error!void {
    try json.objectField("scenes");
    try json.beginArray();
    for (file.scenes, 0..) |name, index| try json.write(.{
        .name = optional(name),
        .shown = index == file.scene_shown,
    });
    try json.endArray();
}

fn writeCameras(json: *Stringify, scene: *const scene_data.Scene) Writer.Error!void {
    try json.objectField("cameras");
    try json.beginArray();
    for (scene.cameras, 0..) |*camera, index| {
        try json.beginObject();
        try writeFields(json, .{
            .name = optional(camera.name),
            .default = index == scene.camera_default,
            .kind = std.meta.activeTag(camera.projection),
        });
        switch (camera.projection) {
            .perspective => |perspective| try writeFields(json, .{
                .fov_degrees = std.math.radiansToDegrees(perspective.y_fov_rad),
                .aspect = perspective.aspect,
            }),
            .orthographic => |orthographic| try writeFields(json, .{
                .width = 2 * orthographic.half_width,
                .height = 2 * orthographic.half_height,
            }),
        }
        try json.endObject();
    }
    try json.endArray();
}

fn writeAnimations(
    json: *Stringify,
    animations: []const scene_data.Animation,
) Writer.Error!void {
    try json.objectField("animations");
    try json.beginArray();
    for (animations) |*animation| {
        const span = animation.span();
        try json.write(.{
            .name = optional(animation.name),
            .start = if (span) |ends| ends[0] else null,
            .end = if (span) |ends| ends[1] else null,
            .channels = animation.channels.len,
        });
    }
    try json.endArray();
}

fn writeImages(json: *Stringify, images: []const info_file.Image) Writer.Error!void {
    try json.objectField("images");
    try json.beginArray();
    for (images) |*image| try json.write(.{
        .name = Text{ .bytes = image.name },
        .bytes = image.byte_count,
        .format = if (image.header) |header| header.format else null,
        .width = if (image.header) |header| header.width else null,
        .height = if (image.header) |header| header.height else null,
        .channels = if (image.header) |header| header.channel_count else null,
        .problem = optional(image.reason),
    });
    try json.endArray();
}

fn writeExtensions(
    json: *Stringify,
    extensions: []const scene_data.File.Extension,
) Writer.Error!void {
    try json.objectField("extensions");
    try json.beginArray();
    for (extensions) |*used| {
        const known = info_file.treatmentOf(used);
        try json.write(.{
            .name = Text{ .bytes = used.name },
            .required = used.required,
            .treatment = if (known) |row| @tagName(row.treatment) else "unknown",
            .remark = if (known) |row| row.remark else null,
        });
    }
    try json.endArray();
}
