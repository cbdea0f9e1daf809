//! Writes `scenes/cornell.gltf` from `builtin:cornell`: `make OUTPUT`.
//!
//! Numbers are printed with the fewest digits that give the same float again, so that the file
//! and the built-in scene render to the same picture, bit for bit. The data lie in the file itself,
//! in base64: positions and normals in f32, indices in u16. Written for this scene: meshes seen
//! once, point lights, perspective cameras, factors without textures.

const std = @import("std");
const raylane = @import("raylane");
const Io = std.Io;
const Allocator = std.mem.Allocator;
const Writer = std.Io.Writer;
const scene_data = raylane.scene;
const Scene = scene_data.Scene;
const assert = std.debug.assert;

/// What the built-in scene does not say: a name for each mesh, in order.
const mesh_names = [_][]const u8{ "floor, ceiling, back", "right", "left", "mirror", "glass" };
/// And for each material.
const material_names = [_][]const u8{ "white", "green", "red", "mirror", "glass" };
const light_name = "lamp";

const target_array_buffer = 34962;
const target_element_array_buffer = 34963;
const component_unsigned_short = 5123;
const component_float = 5126;

/// Writes the scene to the path in argv[1]; without one, says how it is used and returns 2.
pub fn main(init: std.process.Init) !u8 {
    const arena = init.arena.allocator();
    const arguments = try init.minimal.args.toSlice(arena);
    if (arguments.len != 2) {
        std.debug.print("usage: make OUTPUT\n", .{});
        return 2;
    }
    var diagnostic: raylane.diagnostic.Diagnostic = .{};
    var scene = try raylane.builtin.build(init.gpa, "cornell", &diagnostic);
    defer scene.deinit();

    var text: Writer.Allocating = .init(arena);
    try writeGltf(&text.writer, arena, &scene);
    try Io.Dir.cwd().writeFile(init.io, .{ .sub_path = arguments[1], .data = text.written() });
    return 0;
}

/// Asserts that the scene is of the kind this tool is for.
fn writeGltf(writer: *Writer, arena: Allocator, scene: *const Scene) !void {
    assert(scene.meshes.len == mesh_names.len and scene.instances.len == mesh_names.len);
    assert(scene.materials.len == material_names.len);
    assert(scene.lights.len == 1 and scene.cameras.len == 1);
    try writer.writeAll(
        \\{
        \\"asset":{"version":"2.0","generator":"raylane scenes/make.zig"},
        \\"extensionsUsed":["KHR_lights_punctual","KHR_materials_ior",
        \\  "KHR_materials_transmission","KHR_materials_volume"],
        \\
    );
    try writeNodes(writer, scene);
    try writeLightAndCamera(writer, scene);
    try writeMaterials(writer, scene);
    try writeMeshes(writer, scene);
    try writeBuffer(writer, arena, scene);
    try writer.writeAll("}\n");
}

fn writeNodes(writer: *Writer, scene: *const Scene) Writer.Error!void {
    try writer.writeAll("\"scene\":0,\n\"scenes\":[{\"nodes\":[");
    for (0..scene.nodes.len) |index| try writer.print("{s}{d}", .{ comma(index), index });
    try writer.writeAll("]}],\n\"nodes\":[");
    for (scene.nodes, 0..) |node, index| {
        assert(node.parent == scene_data.none);
        try writer.print("{s}\n  {{", .{comma(index)});
        const node_index: u32 = @intCast(index);
        for (scene.instances) |instance| {
            if (instance.node != node_index) continue;
            try writer.print(
                "\"name\":\"{s}\",\"mesh\":{d}",
                .{ mesh_names[instance.mesh], instance.mesh },
            );
        }
        if (scene.lights[0].node == node_index) try writer.print(
            "\"name\":\"{s}\",\"extensions\":{{\"KHR_lights_punctual\":{{\"light\":0}}}}",
            .{light_name},
        );
        if (scene.cameras[0].node == node_index) try writer.print(
            "\"name\":\"{s}\",\"camera\":0",
            .{scene.cameras[0].name},
        );
        if (!std.meta.eql(node.local, raylane.math.Affine.identity)) {
            try writeMatrix(writer, node.local);
        }
        try writer.writeAll("}");
    }
    try writer.writeAll("],\n");
}

fn writeMatrix(writer: *Writer, map: raylane.math.Affine) Writer.Error!void {
    try writer.writeAll(",\"matrix\":[");
    const columns = [_]raylane.math.Vec3{ map.x, map.y, map.z, map.translation };
    for (columns, 0..) |column, index| {
        try writer.print("{s}{d},{d},{d},{d}", .{
            comma(index), column[0], column[1], column[2], @intFromBool(index == 3),
        });
    }
    try writer.writeAll("]");
}

fn writeLightAndCamera(writer: *Writer, scene: *const Scene) Writer.Error!void {
    const light = scene.lights[0];
    assert(light.kind == .point and light.range == std.math.inf(f32));
    try writer.print(
        \\"extensions":{{"KHR_lights_punctual":{{"lights":[
        \\  {{"name":"{s}","type":"point","color":[{d},{d},{d}],"intensity":{d}}}]}}}},
        \\
    , .{ light_name, light.color[0], light.color[1], light.color[2], light.intensity });
    const camera = scene.cameras[0];
    const perspective = camera.projection.perspective;
    try writer.print(
        \\"cameras":[
        \\  {{"name":"{s}","type":"perspective","perspective":
        \\    {{"yfov":{d},"aspectRatio":{d},"znear":0.01}}}}],
        \\
    , .{ camera.name, perspective.y_fov_rad, perspective.aspect.? });
}

fn writeMaterials(writer: *Writer, scene: *const Scene) Writer.Error!void {
    try writer.writeAll("\"materials\":[");
    for (scene.materials, material_names, 0..) |material, name, index| {
        const color = material.base_color;
        try writer.print(
            "{s}\n  {{\"name\":\"{s}\",\"pbrMetallicRoughness\":{{\"baseColorFactor\":" ++
                "[{d},{d},{d},{d}],\"metallicFactor\":{d},\"roughnessFactor\":{d}}}",
            .{
                comma(index),      name,
                color[0],          color[1],
                color[2],          color[3],
                material.metallic, material.roughness,
            },
        );
        if (material.double_sided) try writer.writeAll(",\"doubleSided\":true");
        if (material.volume) try writer.print(
            \\,"extensions":{{
            \\    "KHR_materials_transmission":{{"transmissionFactor":{d}}},
            \\    "KHR_materials_volume":{{"thicknessFactor":1}},
            \\    "KHR_materials_ior":{{"ior":{d}}}}}
        , .{ material.transmission, material.ior });
        try writer.writeAll("}");
    }
    try writer.writeAll("],\n");
}

/// Three views and accessors a mesh, positions, normals and indices, two where faces are flat.
fn writeMeshes(writer: *Writer, scene: *const Scene) Writer.Error!void {
    try writer.writeAll("\"meshes\":[");
    var accessor: u32 = 0;
    for (scene.meshes, mesh_names, 0..) |mesh, name, index| {
        try writer.print(
            "{s}\n  {{\"name\":\"{s}\",\"primitives\":[{{\"material\":{d}," ++
                "\"attributes\":{{\"POSITION\":{d}",
            .{ comma(index), name, mesh.material, accessor },
        );
        accessor += 1;
        if (mesh.normals != null) {
            try writer.print(",\"NORMAL\":{d}", .{accessor});
            accessor += 1;
        }
        try writer.print("}},\"indices\":{d}}}]}}", .{accessor});
        accessor += 1;
    }
    try writer.writeAll("],\n\"accessors\":[");
    accessor = 0;
    for (scene.meshes) |mesh| {
        var box: raylane.math.Box3 = .empty;
        for (mesh.positions) |position| box = box.include(position);
        try writer.print(
            "{s}\n  {{\"bufferView\":{d},\"componentType\":{d},\"count\":{d},\"type\":\"VEC3\"," ++
                "\"min\":[{d},{d},{d}],\"max\":[{d},{d},{d}]}}",
            .{
                comma(accessor), accessor,
                component_float, mesh.positions.len,
                box.lower[0],    box.lower[1],
                box.lower[2],    box.upper[0],
                box.upper[1],    box.upper[2],
            },
        );
        accessor += 1;
        if (mesh.normals) |normals| {
            try writer.print(
                ",\n  {{\"bufferView\":{d},\"componentType\":{d},\"count\":{d},\"type\":\"VEC3\"}}",
                .{ accessor, component_float, normals.len },
            );
            accessor += 1;
        }
        try writer.print(
            ",\n  {{\"bufferView\":{d},\"componentType\":{d},\"count\":{d},\"type\":\"SCALAR\"}}",
            .{ accessor, component_unsigned_short, 3 * mesh.triangles.len },
        );
        accessor += 1;
    }
    try writer.writeAll("],\n");
}

/// The views in the order of the accessors, without gaps, and the bytes.
fn writeBuffer(writer: *Writer, arena: Allocator, scene: *const Scene) !void {
    var bytes: Writer.Allocating = .init(arena);
    try writer.writeAll("\"bufferViews\":[");
    var view_count: usize = 0;
    for (scene.meshes) |mesh| {
        const lists = [_]?[]const raylane.math.Vec3{ mesh.positions, mesh.normals };
        for (lists) |list| {
            const vectors = list orelse continue;
            const offset = bytes.written().len;
            for (vectors) |vector| {
                for (vector) |value| {
                    try bytes.writer.writeInt(u32, @bitCast(value), .little);
                }
            }
            const view: View = .{ .begin = offset, .end = bytes.written().len };
            try view.write(writer, &view_count, target_array_buffer);
        }
        const offset = bytes.written().len;
        for (mesh.triangles) |triangle| {
            for (triangle) |vertex| try bytes.writer.writeInt(u16, @intCast(vertex), .little);
        }
        const view: View = .{ .begin = offset, .end = bytes.written().len };
        try view.write(writer, &view_count, target_element_array_buffer);
        // An odd number of indices would leave the next floats unaligned.
        if (bytes.written().len % 4 != 0) try bytes.writer.writeInt(u16, 0, .little);
    }
    try writer.print(
        "],\n\"buffers\":[{{\"byteLength\":{d},\"uri\":\"data:application/octet-stream;base64,",
        .{bytes.written().len},
    );
    try std.base64.standard.Encoder.encodeWriter(writer, bytes.written());
    try writer.writeAll("\"}]\n");
}

const View = struct {
    begin: usize,
    end: usize,

    fn write(view: View, writer: *Writer, view_count: *usize, target: u32) Writer.Error!void {
        try writer.print(
            "{s}\n  {{\"buffer\":0,\"byteOffset\":{d},\"byteLength\":{d},\"target\":{d}}}",
            .{ comma(view_count.*), view.begin, view.end - view.begin, target },
        );
        view_count.* += 1;
    }
};

/// What stands before element `index` of a list.
fn comma(index: usize) []const u8 {
    return if (index == 0) "" else ",";
}
