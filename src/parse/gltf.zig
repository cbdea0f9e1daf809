//! glTF 2.0 and GLB: a file becomes a `Scene`.
//!
//! In: a file's bytes. Out: a checked `Scene`; nothing of the file or of cgltf remains. The order
//! is that of trust: container, JSON text, document, extensions, buffers, accessors, and only then
//! the parts. Images stay as they are: prepare decodes them.

const std = @import("std");
const accessors = @import("gltf/accessors.zig");
const asset = @import("gltf/asset.zig");
const container = @import("gltf/container.zig");
const description = @import("gltf/description.zig");
const image_based_light = @import("gltf/image_based_light.zig");
const instancing = @import("gltf/instancing.zig");
const limits = @import("gltf/limits.zig");
const nodes = @import("gltf/nodes.zig");
const scene_data = @import("../scene.zig");
const schema = @import("gltf/schema.zig");
const variants = @import("gltf/variants.zig");
const views = @import("gltf/views.zig");
const Animations = @import("gltf/animations.zig");
const Buffers = @import("gltf/buffers.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Materials = @import("gltf/materials.zig");
const Meshes = @import("gltf/meshes.zig");
const Resources = @import("resource.zig");
const Scene = scene_data.Scene;
const Skins = @import("gltf/skins.zig");
const Source = @import("gltf/source.zig");
const Text = @import("gltf/text.zig");
const Textures = @import("gltf/textures.zig");

/// See parse.zig.
pub const Error = Source.Error || error{ SceneUnknown, MaterialVariantUnknown };

/// Reads a file that is in memory; what it names comes from `resources`.
pub fn read(resources: *Resources, bytes: []const u8, diagnostic: *Diagnostic) Error!Scene {
    const gpa = resources.gpa;
    const parts = try container.open(bytes, diagnostic);
    var text: Text = try .open(gpa, parts.json, diagnostic);
    defer text.deinit();
    var document = try text.parse(diagnostic);
    defer document.deinit();
    const doubles = try text.readDoubles();
    defer gpa.free(doubles);
    var builder: scene_data.Builder = .init(gpa);
    errdefer builder.deinit();
    var source: Source = .{
        .gpa = gpa,
        .builder = &builder,
        .arena = builder.arena(),
        .data = document.data,
        .doubles = doubles,
        .lenience = &text.lenience,
        .force = resources.settings.force,
        .diagnostic = diagnostic,
    };
    defer source.deinit();
    const is_binary = std.mem.startsWith(u8, bytes, container.magic);
    builder.scene.file.format = if (is_binary) .glb else .gltf;
    try asset.check(&source);
    var buffers: Buffers = try .load(
        resources,
        document.data,
        parts.binary,
        &text.lenience,
        diagnostic,
    );
    defer buffers.deinit();
    var input_bytes: u64 = bytes.len;
    for (buffers.owned.items) |owned| input_bytes += owned.len;
    source.buffers = buffers.list;
    source.decoded_bytes_left = limits.decodedBytesMax(input_bytes);
    var animations: Animations = try .read(&source, text.animated());
    defer animations.deinit();
    try fill(&source, resources, &animations);
    try accessors.checkRest(&source);
    try diagnostic.failIfRefused();
    const scene = try builder.finish();
    warnOfGaps(&source, &scene);
    return scene;
}

/// Puts the parts of the document into the scene.
fn fill(source: *Source, resources: *Resources, animations: *Animations) Error!void {
    const builder = source.builder;
    const settings = &resources.settings;
    const shown = try nodes.choose(source, settings.scene);
    if (shown) |one| try source.need(.scenes, Source.indexOf(source.data.scenes, one));
    try description.read(source, shown, animations.list.len);
    const variant = try variants.choose(source, settings.material_variant);
    const origins = try nodes.collect(source, shown);
    defer source.gpa.free(origins);
    var textures: Textures = .init(source, resources);
    defer textures.deinit();
    var materials: Materials = try .init(source, &textures, animations.moves_material);
    defer materials.deinit();
    var meshes: Meshes = .{ .source = source, .materials = &materials, .variant = variant };
    defer meshes.deinit();
    var skins: Skins = .{ .source = source };
    defer skins.deinit();
    try skins.collect(origins, animations);
    for (origins, 0..) |origin, index| {
        const node = Source.item(source.data.nodes, origin);
        const node_index: u32 = @intCast(index);
        const is_hidden = source.isHidden(node_index);
        if (node.mesh != null and !is_hidden) {
            try addInstances(origin, node_index, &meshes, &skins, animations);
        }
        if (node.camera) |raw| {
            try builder.addCamera(try views.readCamera(source, raw, node.name, node_index));
            const camera = Source.indexOf(source.data.cameras, raw);
            try animations.cameras.append(source.gpa, camera);
        }
        if (node.light) |raw| if (!is_hidden) {
            const light_index = Source.indexOf(source.data.lights, raw);
            try source.need(.lights, light_index);
            if (views.readLight(source, raw, node_index)) |light| {
                try builder.addLight(light);
                try animations.lights.append(source.gpa, light_index);
            }
        };
    }
    try animations.finish(origins, skins.places, &materials);
    try materials.finish();
    if (shown) |one| try image_based_light.read(source, &textures, one);
    try skins.checkRest();
    for (source.lenience.broken.keys(), source.lenience.broken.values()) |element, broken| {
        const is_image = element.list == @backingInt(schema.List.images);
        if (is_image and textures.images.contains(element.index)) continue; // It has been said.
        source.forgiveUnneeded(broken.reason);
    }
}

/// Adds what a node of the file draws, whose number in the scene is `node_index`.
fn addInstances(
    origin: u32,
    node_index: u32,
    meshes: *Meshes,
    skins: *Skins,
    animations: *Animations,
) Error!void {
    const source = meshes.source;
    const builder = source.builder;
    const node = Source.item(source.data.nodes, origin);
    const mesh_index = Source.indexOf(source.data.meshes, node.mesh);
    const range = try meshes.get(mesh_index, skins.deformationOf(mesh_index));
    if (builder.instances.items.len + range.count > limits.instance_count_max)
        return source.fail("over {d} instances of meshes", .{limits.instance_count_max});
    const weights = try skins.instanceWeights(node);
    const weight_list = try animations.weightList(origin, weights);
    const skin = try skins.instanceSkin(node, range);
    const places = try instancing.place(source, origin, node_index, range.count);
    for (places.first..places.first + places.count) |at| {
        for (range.first..range.first + range.count) |drawn| {
            const has_joints = builder.meshes.items[drawn].joint_sets.len > 0;
            try builder.addDeformedInstance(.{
                .mesh = @intCast(drawn),
                .node = @intCast(at),
                .morph_weights = weights,
                .moving_weights = weight_list,
                .skin = if (has_joints) skin else scene_data.none,
            });
        }
    }
}

/// Says what the picture will lack.
fn warnOfGaps(source: *const Source, scene: *const Scene) void {
    for (scene.meshes) |*mesh| {
        if (mesh.points.len > 0 or mesh.segments.len > 0) return;
    }
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
