//! glTF 2.0 and GLB: a file becomes a `Scene`.
//!
//! In: a path. Out: a checked `Scene`; nothing of the file or of cgltf remains. The order is that
//! of trust: container, JSON text, document, extensions, buffers, accessors, and only then the
//! parts.

const std = @import("std");
const accessors = @import("gltf/accessors.zig");
const asset = @import("gltf/asset.zig");
const container = @import("gltf/container.zig");
const file = @import("file.zig");
const escapes = @import("json/escapes.zig");
const json = @import("json.zig");
const limits = @import("gltf/limits.zig");
const materials = @import("gltf/materials.zig");
const nodes = @import("gltf/nodes.zig");
const scene_data = @import("../scene.zig");
const schema = @import("gltf/schema.zig");
const views = @import("gltf/views.zig");
const Allocator = std.mem.Allocator;
const Buffers = @import("gltf/buffers.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Document = @import("gltf/document.zig");
const Meshes = @import("gltf/meshes.zig");
const Scene = scene_data.Scene;
const Settings = @import("../settings.zig").Load;
const Skins = @import("gltf/skins.zig");
const Source = @import("gltf/source.zig");

/// See parse.zig.
pub const Error = Source.Error;

/// Reads the file at `path`; see `parse.parse`.
pub fn parse(
    gpa: Allocator,
    io: std.Io,
    path: []const u8,
    settings: Settings,
    diagnostic: *Diagnostic,
) Error!Scene {
    const bytes = try readFile(gpa, io, path, settings, diagnostic);
    defer gpa.free(bytes);
    const folder_path = std.fs.path.dirname(path) orelse ".";
    const folder = std.Io.Dir.cwd().openDir(io, folder_path, .{}) catch
        return diagnostic.fail(error.InputOutput, "its folder cannot be opened", .{});
    defer folder.close(io);
    return parseBytes(gpa, io, bytes, folder, settings, diagnostic);
}

fn readFile(
    gpa: Allocator,
    io: std.Io,
    path: []const u8,
    settings: Settings,
    diagnostic: *Diagnostic,
) Error![]u8 {
    var reason: []const u8 = "";
    const opened = file.open(io, .cwd(), path, settings.output, &reason) catch
        return diagnostic.fail(error.InputOutput, "{s}", .{reason});
    defer opened.close(io);
    return file.read(gpa, io, opened, limits.file_bytes_max, &reason) catch |err| switch (err) {
        error.OutOfMemory => error.OutOfMemory,
        error.InputOutput, error.NotRegular => diagnostic.fail(error.InputOutput, "{s}", .{reason}),
        error.TooLarge => diagnostic.fail(
            error.InvalidInput,
            "is over the limit of {d} bytes",
            .{limits.file_bytes_max},
        ),
    };
}

/// Reads a file that is in memory; what it names is looked for in `folder`.
pub fn parseBytes(
    gpa: Allocator,
    io: std.Io,
    bytes: []const u8,
    folder: std.Io.Dir,
    settings: Settings,
    diagnostic: *Diagnostic,
) Error!Scene {
    const parts = try container.open(bytes, diagnostic);
    const simplified = try escapes.simplifyEscapes(gpa, parts.json);
    defer if (simplified) |copy| gpa.free(copy);
    const text = simplified orelse parts.json;
    const checked = try json.check(text, &schema.document, diagnostic);
    var document = try parseDocument(gpa, text, checked.lengths, diagnostic);
    defer document.deinit();
    const doubles = try json.readDoubles(gpa, text, &schema.document, &checked);
    defer gpa.free(doubles);
    var scene: Scene = .init(gpa);
    errdefer scene.deinit();
    var source: Source = .{
        .gpa = gpa,
        .arena = scene.arena.allocator(),
        .data = document.data,
        .doubles = doubles,
        .diagnostic = diagnostic,
    };
    defer source.deinit();
    try asset.check(&source);
    var buffers: Buffers = try .load(gpa, document.data, .{
        .io = io,
        .folder = folder,
        .allow_outside = settings.allow_outside,
        .output = settings.output,
        .binary = parts.binary,
    }, diagnostic);
    defer buffers.deinit();
    var input_bytes: u64 = bytes.len;
    for (buffers.owned.items) |owned| input_bytes += owned.len;
    source.buffers = buffers.list;
    source.decoded_bytes_left = limits.decodedBytesMax(input_bytes);
    try accessors.checkAll(&source);
    try fill(&source, &scene);
    warnOfGaps(&source, &scene);
    return scene;
}

/// Has cgltf parse a JSON text that has been checked.
fn parseDocument(
    gpa: Allocator,
    text: []const u8,
    lengths: json.Lengths,
    diagnostic: *Diagnostic,
) Error!Document {
    return Document.parse(gpa, text) catch |err| switch (err) {
        error.OutOfMemory => error.OutOfMemory,
        error.TooLarge => diagnostic.fail(
            error.InvalidInput,
            "the document would need much more memory than its size explains",
            .{},
        ),
        error.Legacy => diagnostic.fail(
            error.InvalidInput,
            "glTF 1.0 is not supported, only 2.0",
            .{},
        ),
        error.Refused => {
            // cgltf does not say why, so look for the reasons that the table leaves.
            try json.checkReferences(gpa, text, &schema.document, lengths, "node", diagnostic);
            return diagnostic.fail(
                error.InvalidInput,
                "is not valid glTF: an animation or an extension refers to what is not there",
                .{},
            );
        },
    };
}

/// Puts the parts of the document into the scene.
fn fill(source: *Source, scene: *Scene) Error!void {
    const gpa = source.gpa;
    const hierarchy = try nodes.collect(source);
    defer gpa.free(hierarchy.origins);
    var meshes: Meshes = .{ .source = source };
    defer meshes.deinit();
    var skins: Skins = .{ .source = source };
    defer skins.deinit();
    try skins.checkAll();
    var instances: std.ArrayList(scene_data.Instance) = .empty;
    defer instances.deinit(gpa);
    var cameras: std.ArrayList(scene_data.Camera) = .empty;
    defer cameras.deinit(gpa);
    var lights: std.ArrayList(scene_data.Light) = .empty;
    defer lights.deinit(gpa);
    for (hierarchy.origins, 0..) |origin, index| {
        const node = Source.item(source.data.nodes, origin);
        const node_index: u32 = @intCast(index);
        if (node.mesh) |mesh| {
            const mesh_index = Source.indexOf(source.data.meshes, mesh);
            try skins.checkNode(node, mesh_index);
            const range = try meshes.get(mesh_index);
            if (instances.items.len + range.count > limits.instance_count_max) return source.fail(
                "over {d} showings of meshes",
                .{limits.instance_count_max},
            );
            for (range.first..range.first + range.count) |drawn| {
                try instances.append(gpa, .{ .mesh = @intCast(drawn), .node = node_index });
            }
        }
        if (node.camera) |raw| {
            try cameras.append(gpa, try views.readCamera(source, raw, node.name, node_index));
        }
        if (node.light) |raw| {
            if (views.readLight(source, raw, node_index)) |light| try lights.append(gpa, light);
        }
    }
    scene.nodes = hierarchy.list;
    scene.meshes = try source.arena.dupe(scene_data.Mesh, meshes.list.items);
    scene.instances = try source.arena.dupe(scene_data.Instance, instances.items);
    scene.materials = try materials.read(source, meshes.default_material_used);
    scene.cameras = try source.arena.dupe(scene_data.Camera, cameras.items);
    scene.lights = try source.arena.dupe(scene_data.Light, lights.items);
    if (cameras.items.len > 0) scene.camera_default = 0;
}

/// Says what the picture will lack.
fn warnOfGaps(source: *const Source, scene: *const Scene) void {
    if (source.data.textures_count > 0) source.warn(
        "textures are not read yet: materials show their factors alone",
        .{},
    );
    if (scene.triangleCount() == 0) {
        source.warn("nothing to render: no triangles", .{});
    } else if (!hasArea(scene)) {
        source.warn("nothing to render: every triangle uses a vertex twice", .{});
    }
}

/// Whether any triangle has three different vertices.
fn hasArea(scene: *const Scene) bool {
    for (scene.meshes) |mesh| { // Not of instances: they may show the same mesh a million times.
        for (mesh.triangles) |corners| {
            const first, const second, const last = corners;
            if (first != second and second != last and last != first) return true;
        }
    }
    return false;
}
