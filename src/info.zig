//! What is in a scene file: `raylane info`.
//!
//! In: a scene as it was read. Out: names, counts, sizes and bounds of what is in it, what becomes
//! of the extensions that it uses, and about how much memory it takes to render, as text for people
//! and as JSON for programs (docs/info.md). No image is decoded and no tree is built.

const std = @import("std");
const decode = @import("decode.zig");
const memory = @import("info/memory.zig");
const parse = @import("parse.zig");
const prepare = @import("prepare.zig");
const scene_data = @import("scene.zig");
const settings = @import("settings.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = @import("diagnostic.zig").Diagnostic;
const Extension = parse.extensions.Extension;
const Scene = scene_data.Scene;

/// Writes lines for people.
pub const writeText = @import("info/text.zig").write;
/// Writes one JSON object and a line end.
pub const writeJson = @import("info/json.zig").write;
/// Writes why there is nothing to describe.
pub const writeFailure = @import("info/json.zig").writeFailure;

/// `SceneTooLarge`: it could not be rendered, for its textures; the diagnostic says more.
pub const Error = prepare.LoadError || prepare.AnimateError;

/// What is known of a scene.
pub const Info = struct {
    /// Of the program.
    version: []const u8 = "",
    /// The file, as on the command line.
    name: []const u8 = "",
    scene: *const Scene,
    counts: scene_data.File.Counts,
    images: []const Image,
    drawn: Drawn,
    lights: Lights,
    /// As it stands where nobody chooses an animation; null: nothing is drawn.
    extent: ?prepare.Extent,
    /// Width and height of the picture, unless the user says more.
    size: [2]u32,
    /// About the most that it takes to render that.
    memory_bytes: u64,
    warnings: []const []const u8 = &.{},
};

/// An image of the scene's, by its header.
pub const Image = struct {
    /// What messages call it.
    name: []const u8,
    byte_count: u64,
    /// Null: it cannot be read.
    header: ?decode.Info,
    /// Why not.
    reason: []const u8 = "",
};

/// What there is to see, every instance counted but where something else is said.
pub const Drawn = struct {
    instance_count: u64 = 0,
    triangle_count: u64 = 0,
    /// Instances of a mesh counted once.
    unique_triangle_count: u64 = 0,
    point_count: u64 = 0,
    /// Segments of lines.
    line_count: u64 = 0,
};

/// What shines.
pub const Lights = struct {
    by_kind: std.EnumArray(scene_data.Light.Kind, u64) = .initFill(0),
    /// Materials that emit, and the triangles that have them.
    material_count: u64 = 0,
    triangle_count: u64 = 0,
};

/// What becomes of an extension; null: it is unknown.
pub fn treatmentOf(used: *const scene_data.File.Extension) ?*const Extension {
    return parse.extensions.find(used.name);
}

/// Looks at a scene, which has to outlive the result. All memory is from `arena`; what is needed
/// meanwhile comes from `gpa`.
pub fn collect(
    gpa: Allocator,
    arena: Allocator,
    scene: *const Scene,
    diagnostic: *Diagnostic,
) Error!Info {
    const images = try arena.alloc(Image, scene.images.len);
    for (images, scene.images) |*image, *from| {
        image.* = .{ .name = from.name, .byte_count = from.bytes.len, .header = null };
        var reason: decode.Reason = .{};
        if (decode.info(from.bytes, &reason)) |header| {
            image.header = header;
        } else |err| switch (err) {
            error.InvalidImage => image.reason = try arena.dupe(u8, reason.text()),
        }
    }
    const size = prepare.pictureSize(scene, &.{});
    var posed = try prepare.animateScene(gpa, scene, .{}, diagnostic);
    defer posed.deinit();
    return .{
        .scene = scene,
        .counts = scene.file.counts orelse countsOf(scene),
        .images = images,
        .drawn = drawnOf(scene),
        .lights = try lightsOf(gpa, scene),
        .extent = try prepare.extentOf(gpa, &posed.scene),
        .size = size,
        .memory_bytes = try memory.estimate(gpa, scene, size, diagnostic),
    };
}

fn countsOf(scene: *const Scene) scene_data.File.Counts {
    var counts: scene_data.File.Counts = undefined;
    inline for (comptime std.meta.fieldNames(scene_data.File.Counts)) |name| {
        @field(counts, name) = @field(scene, name).len;
    }
    return counts;
}

fn drawnOf(scene: *const Scene) Drawn {
    var drawn: Drawn = .{ .instance_count = scene.instances.len };
    for (scene.instances) |instance| {
        const mesh = &scene.meshes[instance.mesh];
        drawn.triangle_count += mesh.triangles.len;
        drawn.point_count += mesh.points.len;
        drawn.line_count += mesh.segments.len;
    }
    for (scene.meshes) |*mesh| drawn.unique_triangle_count += mesh.triangles.len;
    return drawn;
}

fn lightsOf(gpa: Allocator, scene: *const Scene) error{OutOfMemory}!Lights {
    var lights: Lights = .{};
    for (scene.lights) |*light| lights.by_kind.getPtr(light.kind).* += 1;
    const is_counted = try gpa.alloc(bool, scene.materials.len);
    defer gpa.free(is_counted);
    @memset(is_counted, false);
    for (scene.instances) |instance| {
        const mesh = &scene.meshes[instance.mesh];
        const emits = for (scene.materials[mesh.material].emissive) |channel| {
            if (channel > 0) break true;
        } else false;
        if (!emits) continue;
        lights.triangle_count += mesh.triangles.len;
        if (!is_counted[mesh.material]) lights.material_count += 1;
        is_counted[mesh.material] = true;
    }
    return lights;
}

const testing = std.testing;

/// Two instances of a triangle that emits, cameras of both kinds, a lamp, a picture of 2 x 1, and
/// points that are in another scene.
const document_for_test =
    \\{"asset":{"version":"2.0","generator":"by \"hand\"\u0007"},
    \\"extensionsUsed":["KHR_lights_punctual","KHR_xmp","KHR_materials_variants","A_b"],
    \\"extensionsRequired":["KHR_lights_punctual","C_d"],
    \\"extensions":{"KHR_lights_punctual":{"lights":[{"type":"spot","spot":{}}]},
    \\"KHR_materials_variants":{"variants":[{"name":"red"},{"name":"blue"}]}},
    \\"scene":1,"scenes":[{"name":"points","nodes":[4]},{"nodes":[0,1,2,3]}],
    \\"nodes":[{"mesh":0,"extensions":{"KHR_lights_punctual":{"light":0}}},
    \\{"mesh":0,"translation":[10,0,0],"scale":[2,2,2]},
    \\{"camera":0,"name":"at the\tdoor"},{"camera":1},{"mesh":1}],
    \\"cameras":[{"type":"perspective","perspective":{"yfov":0.5,"znear":1,"aspectRatio":2}},
    \\{"name":"plan","type":"orthographic","orthographic":{"xmag":4,"ymag":3,"zfar":9,"znear":0}}],
    \\"materials":[{"emissiveFactor":[0,1,0],"emissiveTexture":{"index":0}},{}],
    \\"textures":[{"source":0}],
    \\"meshes":[{"primitives":[{"attributes":{"POSITION":0},"material":0}]},
    \\{"primitives":[{"attributes":{"POSITION":0},"mode":0}]}],
    \\"accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":3,
    \\"min":[0,0,-1],"max":[2,1.5,0]},{"bufferView":0,"byteOffset":4,"componentType":5126,
    \\"type":"SCALAR","count":3,"min":[0],"max":[2]}],
    \\"animations":[{"name":"drift","channels":[{"sampler":0,"target":{"node":1,
    \\"path":"translation"}}],"samplers":[{"input":1,"output":0}]},{"channels":[],"samplers":[]}],
    \\"bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36,
    \\"uri":"data:;base64,AAAAAAAAAAAAAAAAAAAAQAAAAAAAAAAAAAAAAAAAwD8AAIC/"}],
    \\"images":[{"name":"p","uri":"data:image/png;base64,
++ "iVBORw0KGgoAAAANSUhEUgAAAAIAAAABCAIAAAB7QOjdAAAA" ++
    "DUlEQVR42mMQUDAAIgACZwDBTBoccQAAAABJRU5ErkJggg==\"}]}";

/// What is written of the document.
fn writeForTest(
    choices: settings.Load,
    extensions: ?[]const scene_data.File.Extension,
    comptime write: anytype,
    writer: *std.Io.Writer,
) !void {
    var diagnostic: Diagnostic = .{};
    const gpa = testing.allocator;
    const document = document_for_test;
    const folder: std.Io.Dir = .cwd();
    var scene =
        try parse.parseBytes(gpa, testing.io, document, folder, choices, &diagnostic);
    defer scene.deinit();
    var arena: std.heap.ArenaAllocator = .init(gpa);
    defer arena.deinit();
    var found = try collect(gpa, arena.allocator(), &scene, &diagnostic);
    found.name = "a\x1b.gltf";
    scene.file.byte_count = 4 << 10;
    scene.file.extensions = extensions orelse scene.file.extensions;
    found.memory_bytes = 5 << 20;
    try write(&found, writer);
}

test "the text" {
    var text: std.Io.Writer.Allocating = .init(testing.allocator);
    defer text.deinit();
    try writeForTest(.{ .force = true }, null, writeText, &text.writer);
    try testing.expectEqualStrings(
        \\file         a?.gltf, 4.0 KiB with what it names
        \\format       glTF 2.0
        \\generator    by "hand"?
        \\scene        0 'points'
        \\             1, shown
        \\camera       0 'at the?door', perspective, 28.6 degrees, aspect 2.000, default
        \\             1 'plan', orthographic, 8.000 x 6.000 m
        \\lights       1 spot, 1 material that emits on 2 triangles
        \\animation    0 'drift', 0.000 to 2.000 s
        \\             1, nothing that is drawn moves
        \\variant      0 'red'
        \\             1 'blue'
        \\image        image 0 'p', PNG, 2 x 1, RGB, 70 bytes
        \\
    ++ "in the file  5 nodes, 2 meshes, 2 materials, 1 texture, 1 image, 2 animations, " ++
        \\2 cameras, 1 light
        \\drawn        2 triangles (1 unique)
        \\bounds       x 0.000 to 14.000, y 0.000 to 3.000, z -2.000 to 0.000 m
        \\memory       about 5.0 MiB to render 1024 x 512
        \\extension    KHR_lights_punctual: rendered, see docs/lights.md (required)
        \\             C_d: unknown (required)
        \\             KHR_xmp: ignored, data
        \\             KHR_materials_variants: rendered, by --material-variant
        \\             A_b: unknown
        \\rendering    only with --force, for what it requires
        \\
    , text.written());
}

test "the JSON has every key, and what another scene draws" {
    const Parsed = struct {
        version: []const u8,
        @"error": ?u8,
        file: []const u8,
        bytes: u64,
        files: []const struct { path: []const u8, bytes: u64 },
        format: []const u8,
        format_version: ?[]const u8,
        generator: ?[]const u8,
        scenes: []const struct { name: ?[]const u8, shown: bool },
        cameras: []const struct { name: ?[]const u8, kind: []const u8 },
        lights: struct {
            point: u64,
            spot: u64,
            directional: u64,
            emissive_materials: u64,
            emissive_triangles: u64,
            environment: ?[]const u8,
        },
        animations: []const struct {
            name: ?[]const u8,
            start: ?f32,
            end: ?f32,
            channels: u64,
        },
        material_variants: []const []const u8,
        images: []const struct {
            name: []const u8,
            bytes: u64,
            format: ?[]const u8,
            width: ?u32,
            height: ?u32,
            channels: ?u8,
            problem: ?[]const u8,
        },
        counts: scene_data.File.Counts,
        drawn: struct {
            instances: u64,
            triangles: u64,
            unique_triangles: u64,
            points: u64,
            lines: u64,
        },
        bounds: ?struct { lower: [3]f64, upper: [3]f64 },
        picture: struct { width: u32, height: u32 },
        memory_bytes: u64,
        extensions: []const struct {
            name: []const u8,
            required: bool,
            treatment: []const u8,
            remark: ?[]const u8,
        },
        needs_force: bool,
        warnings: []const []const u8,
    };
    const gpa = testing.allocator;
    var text: std.Io.Writer.Allocating = .init(gpa);
    defer text.deinit();
    const extensions = [_]scene_data.File.Extension{
        .{ .name = "KHR_accessor_float64", .required = true },
        .{ .name = "A_b", .required = false },
    };
    const choices: settings.Load = .{ .force = true, .scene = .{ .index = 0 } };
    try writeForTest(choices, &extensions, writeJson, &text.writer);
    const line = text.written();
    try testing.expectEqual(line.len - 1, std.mem.findScalar(u8, line, '\n'));
    const parsed = try std.json.parseFromSlice(Parsed, gpa, line, .{});
    defer parsed.deinit();
    const value = parsed.value;
    try testing.expectEqualStrings("by \"hand\"\x07", value.generator.?);
    try testing.expectEqualStrings("points", value.scenes[0].name.?);
    try testing.expectEqual(null, value.scenes[1].name);
    try testing.expect(value.scenes[0].shown and !value.scenes[1].shown);
    try testing.expectEqual(3, value.drawn.points);
    try testing.expectEqual(0, value.drawn.triangles);
    try testing.expectEqual([3]f64{ 2, 1.5, 0 }, value.bounds.?.upper);
    try testing.expectEqual(0, value.cameras.len + value.images.len);
    try testing.expectEqual(2, value.counts.cameras);
    try testing.expectEqual(2, value.animations.len);
    try testing.expectEqual(null, value.animations[1].end);
    try testing.expectEqualStrings("ignored", value.extensions[0].treatment);
    try testing.expect(value.extensions[0].required and value.needs_force);
    try testing.expectEqualStrings("unknown", value.extensions[1].treatment);
    try testing.expectEqual(null, value.extensions[1].remark);
}

test {
    _ = memory;
    _ = @import("info/text.zig");
    _ = @import("info/json.zig");
}
