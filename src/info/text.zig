//! What is in a scene file as lines for people: a name in the left column, facts in the right one.

const std = @import("std");
const decode = @import("../decode.zig");
const diagnostic = @import("../diagnostic.zig");
const info_file = @import("../info.zig");
const report = @import("../report.zig");
const scene_data = @import("../scene.zig");
const Info = info_file.Info;
const Writer = std.Io.Writer;
const printable = diagnostic.printable;
const quote = diagnostic.quote;

/// Lines of a list at most.
const line_count_max = 20;

/// Writes all that is known.
pub fn write(info: *const Info, writer: *Writer) Writer.Error!void {
    const scene = info.scene;
    const file = &scene.file;
    try writer.print("file         {f}", .{printable(info.name)});
    if (file.byte_count > 0) {
        try writer.writeAll(", ");
        try report.writeBytes(writer, file.byte_count);
        try writer.writeAll(" with what it names");
    }
    try writer.print("\nformat       {s}", .{formatName(file.format)});
    if (file.version.len > 0) try writer.print(" {f}", .{printable(file.version)});
    if (file.generator.len > 0) {
        try writer.print("\ngenerator    {f}", .{printable(file.generator)});
    }
    try writer.writeByte('\n');
    try writeScenes(writer, file);
    try writeCameras(writer, scene);
    try writeLights(writer, info);
    try writeAnimations(writer, scene.animations);
    try writeVariants(writer, scene.material_variants);
    try writeImages(writer, info.images);
    try writeCounts(writer, &info.counts);
    try writeDrawn(writer, info);
    try writer.writeAll("memory       about ");
    try report.writeBytes(writer, info.memory_bytes);
    try writer.print(" to render {d} x {d}\n", .{ info.size[0], info.size[1] });
    try writeExtensions(writer, file.extensions);
    if (file.needs_force) {
        try writer.writeAll("rendering    only with --force, for what it requires\n");
    }
}

/// What people call a format.
fn formatName(format: scene_data.File.Format) []const u8 {
    return switch (format) {
        .builtin => "built in",
        .gltf => "glTF",
        .glb => "glTF (binary)",
        .pbrt => "PBRT",
        .obj => "OBJ",
        .stl => "STL",
        .ply => "PLY",
    };
}

/// The lines of a list: the first has its name. Returns whether there is room for the one with this
/// index.
fn begin(writer: *Writer, comptime name: []const u8, index: usize, count: usize) Writer.Error!bool {
    if (index < line_count_max) {
        try writer.print("{s:<13}", .{if (index == 0) name else ""});
        return true;
    }
    if (index == line_count_max)
        try writer.print("{s:<13}and {d} more\n", .{ "", count - line_count_max });
    return false;
}

fn writeScenes(writer: *Writer, file: *const scene_data.File) Writer.Error!void {
    for (file.scenes, 0..) |name, index| {
        if (!try begin(writer, "scene", index, file.scenes.len)) return;
        try writer.print("{d}", .{index});
        if (name.len > 0) try writer.print(" {f}", .{quote(name)});
        if (index == file.scene_shown and file.scenes.len > 1) try writer.writeAll(", shown");
        try writer.writeByte('\n');
    }
}

fn writeCameras(writer: *Writer, scene: *const scene_data.Scene) Writer.Error!void {
    if (scene.cameras.len == 0) return writer.writeAll("camera       none, all is in view\n");
    for (scene.cameras, 0..) |*camera, index| {
        if (!try begin(writer, "camera", index, scene.cameras.len)) return;
        try writer.print("{d}", .{index});
        if (camera.name.len > 0) try writer.print(" {f}", .{quote(camera.name)});
        switch (camera.projection) {
            .perspective => |perspective| {
                const degrees = std.math.radiansToDegrees(perspective.y_fov_rad);
                try writer.print(", perspective, {d:.1} degrees", .{degrees});
                if (perspective.aspect) |aspect| try writer.print(", aspect {d:.3}", .{aspect});
            },
            .orthographic => |orthographic| try writer.print(
                ", orthographic, {d:.3} x {d:.3} m",
                .{ 2 * orthographic.half_width, 2 * orthographic.half_height },
            ),
        }
        try writer.writeAll(if (index == scene.camera_default) ", default\n" else "\n");
    }
}

fn writeLights(writer: *Writer, info: *const Info) Writer.Error!void {
    const lights = &info.lights;
    var lists: Commas = .{ .writer = writer };
    try writer.writeAll("lights       ");
    for (std.enums.values(scene_data.Light.Kind)) |kind| {
        const count = lights.by_kind.get(kind);
        if (count > 0) try lists.next("{d} {t}", .{ count, kind });
    }
    if (lights.material_count > 0) try lists.next("{d} {s} on {d} triangles", .{
        lights.material_count,
        if (lights.material_count == 1) "material that emits" else "materials that emit",
        lights.triangle_count,
    });
    if (info.scene.environment) |*map| try lists.next("an environment ({t})", .{map.projection});
    if (lists.is_empty) try writer.writeAll("none");
    try writer.writeByte('\n');
}

fn writeAnimations(writer: *Writer, animations: []const scene_data.Animation) Writer.Error!void {
    for (animations, 0..) |*animation, index| {
        if (!try begin(writer, "animation", index, animations.len)) return;
        try writer.print("{d}", .{index});
        if (animation.name.len > 0) try writer.print(" {f}", .{quote(animation.name)});
        if (animation.span()) |span| {
            try writer.print(", {d:.3} to {d:.3} s\n", .{ span[0], span[1] });
        } else try writer.writeAll(", nothing that is drawn moves\n");
    }
}

fn writeVariants(writer: *Writer, names: []const []const u8) Writer.Error!void {
    for (names, 0..) |name, index| {
        if (!try begin(writer, "variant", index, names.len)) return;
        try writer.print("{d} {f}\n", .{ index, quote(name) });
    }
}

fn writeImages(writer: *Writer, images: []const info_file.Image) Writer.Error!void {
    for (images, 0..) |*image, index| {
        if (!try begin(writer, "image", index, images.len)) return;
        try writer.print("{f}, ", .{printable(image.name)});
        if (image.header) |*header| {
            try writer.print("{s}, {d} x {d}, {s}, ", .{
                imageFormatName(header.format), header.width,
                header.height,                  channelNames(header.channel_count),
            });
            try report.writeBytes(writer, image.byte_count);
        } else try writer.print("left out: {f}", .{printable(image.reason)});
        try writer.writeByte('\n');
    }
}

fn imageFormatName(format: decode.Format) []const u8 {
    return switch (format) {
        .png => "PNG",
        .jpeg => "JPEG",
        .webp => "WebP",
        .ktx2 => "KTX2",
        .hdr => "Radiance",
        .exr => "OpenEXR",
    };
}

fn channelNames(count: u8) []const u8 {
    return switch (count) {
        1 => "gray",
        2 => "gray, alpha",
        3 => "RGB",
        else => "RGBA",
    };
}

fn writeCounts(writer: *Writer, counts: *const scene_data.File.Counts) Writer.Error!void {
    var lists: Commas = .{ .writer = writer };
    try writer.writeAll("in the file  ");
    inline for (comptime std.meta.fieldNames(scene_data.File.Counts)) |name| {
        const count = @field(counts, name);
        const is_long = comptime std.mem.endsWith(u8, name, "hes");
        const noun = name[0 .. name.len - if (is_long) 2 else 1];
        if (count > 0) try lists.next("{d} {s}", .{ count, if (count == 1) noun else name });
    }
    if (lists.is_empty) try writer.writeAll("nothing");
    try writer.writeByte('\n');
}

fn writeDrawn(writer: *Writer, info: *const Info) Writer.Error!void {
    const drawn = &info.drawn;
    const noun = if (drawn.triangle_count == 1) "triangle" else "triangles";
    try writer.print("drawn        {d} {s}", .{ drawn.triangle_count, noun });
    if (drawn.triangle_count != drawn.unique_triangle_count) {
        try writer.print(" ({d} unique)", .{drawn.unique_triangle_count});
    }
    if (drawn.point_count > 0) try writer.print(", {d} points", .{drawn.point_count});
    if (drawn.line_count > 0) try writer.print(", {d} lines", .{drawn.line_count});
    const extent = info.extent orelse return writer.writeByte('\n');
    try writer.writeAll("\nbounds       ");
    for (extent.lower, extent.upper, "xyz", 0..) |lower, upper, axis, index| {
        if (index > 0) try writer.writeAll(", ");
        try writer.print("{c} {d:.3} to {d:.3}", .{ axis, lower, upper });
    }
    try writer.writeAll(" m\n");
}

fn writeExtensions(
    writer: *Writer,
    extensions: []const scene_data.File.Extension,
) Writer.Error!void {
    for (extensions, 0..) |*used, index| {
        if (!try begin(writer, "extension", index, extensions.len)) return;
        try writer.print("{f}: ", .{printable(used.name)});
        if (info_file.treatmentOf(used)) |known| {
            try writer.print("{t}, {s}", .{ known.treatment, known.remark });
        } else try writer.writeAll("unknown");
        try writer.writeAll(if (used.required) " (required)\n" else "\n");
    }
}

/// Prints what is listed in one line.
const Commas = struct {
    writer: *Writer,
    is_empty: bool = true,

    fn next(commas: *Commas, comptime format: []const u8, arguments: anytype) Writer.Error!void {
        if (!commas.is_empty) try commas.writer.writeAll(", ");
        commas.is_empty = false;
        try commas.writer.print(format, arguments);
    }
};
