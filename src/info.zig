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

/// `SceneTooLarge`: it could not be rendered, for its textures; the diagnostic says more.
pub const Error = prepare.LoadError;

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
    /// Null: nothing is drawn.
    extent: ?prepare.Extent,
    /// Width and height of the picture, unless the user says more.
    size: [2]u32,
    /// About the most that it takes to render that.
    memory_bytes: u64,
    warnings: []const []const u8 = &.{},

    /// Whether it is rendered only with `--force`.
    pub fn needsForce(info: *const Info) bool {
        for (info.scene.file.extensions) |used| {
            if (!used.required) continue;
            const known = parse.extensions.find(used.name) orelse return true;
            if (!known.mayBeRequired()) return true;
        }
        return false;
    }
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
    return .{
        .scene = scene,
        .counts = scene.file.counts orelse countsOf(scene),
        .images = images,
        .drawn = drawnOf(scene),
        .lights = try lightsOf(gpa, scene),
        .extent = try prepare.extentOf(gpa, scene),
        .size = size,
        .memory_bytes = try memory.estimate(gpa, scene, size, diagnostic),
    };
}

fn countsOf(scene: *const Scene) scene_data.File.Counts {
    return .{
        .nodes = scene.nodes.len,
        .meshes = scene.meshes.len,
        .materials = scene.materials.len,
        .textures = scene.textures.len,
        .images = scene.images.len,
        .skins = scene.skins.len,
        .animations = 0,
        .cameras = scene.cameras.len,
        .lights = scene.lights.len,
    };
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

test {
    _ = memory;
    _ = @import("info/text.zig");
    _ = @import("info/json.zig");
}
