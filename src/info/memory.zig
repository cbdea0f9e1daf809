//! About how much memory a scene takes to render.
//!
//! In: a scene that was read, and the headers of its images. Out: the largest sum of what is there
//! at the same time, stage by stage. What stages allocate is known but for the build of the tree,
//! which is measured (docs/info.md).

const std = @import("std");
const decode = @import("../decode.zig");
const prepare = @import("../prepare.zig");
const scene_data = @import("../scene.zig");
const settings = @import("../settings.zig");
const world = @import("../world.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Scene = scene_data.Scene;

/// The program, its threads' stacks, the light from all around.
const base_bytes = 4 << 20;
/// The tree has 50 bytes a triangle whatever its width: packs that are not all full, and nodes.
const tree_triangle_bytes = 50;
/// While it is written, besides: numbers, and what is touched of binary nodes and their costs.
const build_triangle_bytes = 24;
/// Triangles of a cluster, which an instance of a shared mesh has in place of its own, and bytes of
/// each: a box, and its part of the tree over all clusters.
const cluster_triangles = 80;
const cluster_bytes = 240;
/// A map of the surroundings: what is decoded, radiance, its levels; by texel of the image.
const environment_texel_bytes = 56;
/// What else is made of it.
const environment_bytes = 4 << 20;
/// The picture's sums; a second layer where something is unlit.
const film_pixel_bytes = 16;
/// Encoded rows, and the file that they become.
const output_pixel_bytes = 11;

/// Bytes at the peak. `size`: width and height of the picture.
pub fn estimate(
    gpa: Allocator,
    scene: *const Scene,
    size: [2]u32,
    diagnostic: *Diagnostic,
) prepare.LoadError!u64 {
    const side_max = settings.texture_side.default;
    const textures = try prepare.planTextures(gpa, scene, side_max, diagnostic);
    const read = try sceneBytes(gpa, scene);
    const soup = try soupOf(gpa, scene);
    const pixels = @as(u64, size[0]) * size[1];
    const layers: u64 = if (hasUnlit(scene)) 2 else 1;
    const tree = soup.triangle_count * tree_triangle_bytes;
    const posed = textures.byte_count + soup.byte_count + tree;
    return base_bytes + @max(
        scene.file.byte_count + read,
        read + textures.peak_byte_count,
        read + posed + soup.triangle_count * build_triangle_bytes,
        read + posed + environmentBytes(scene),
        posed + pixels * (layers * film_pixel_bytes + output_pixel_bytes),
    );
}

/// Bytes of what `parse` hands over. Meshes may share their arrays.
fn sceneBytes(gpa: Allocator, scene: *const Scene) error{OutOfMemory}!u64 {
    var arrays: Arrays = .{ .gpa = gpa };
    defer arrays.known.deinit(gpa);
    for (scene.meshes) |*mesh| {
        try arrays.add(mesh.positions);
        try arrays.addAny(mesh.normals);
        try arrays.addAny(mesh.colors);
        try arrays.addAny(mesh.tangents);
        for (mesh.texcoords) |set| try arrays.addAny(set);
        for (mesh.morph_targets) |target| {
            try arrays.addAny(target.positions);
            try arrays.addAny(target.normals);
            try arrays.addAny(target.tangents);
            try arrays.addAny(target.colors);
            for (target.texcoords) |set| try arrays.addAny(set);
        }
        for (mesh.joint_sets) |set| {
            try arrays.add(set.joints);
            try arrays.add(set.weights);
        }
        try arrays.add(mesh.triangles);
        try arrays.add(mesh.points);
        try arrays.add(mesh.segments);
    }
    for (scene.images) |image| try arrays.add(image.bytes);
    inline for (.{ "nodes", "meshes", "instances", "materials", "lights" }) |name| {
        const list = @field(scene, name);
        arrays.byte_count += list.len * @sizeOf(std.meta.Elem(@TypeOf(list)));
    }
    return arrays.byte_count;
}

/// Arrays, each counted once.
const Arrays = struct {
    gpa: Allocator,
    known: std.AutoHashMapUnmanaged(usize, void) = .empty,
    byte_count: u64 = 0,

    fn add(arrays: *Arrays, array: anytype) error{OutOfMemory}!void {
        if (array.len == 0) return;
        const entry = try arrays.known.getOrPut(arrays.gpa, @intFromPtr(array.ptr));
        if (!entry.found_existing) arrays.byte_count += std.mem.sliceAsBytes(array).len;
    }

    fn addAny(arrays: *Arrays, array: anytype) error{OutOfMemory}!void {
        if (array) |present| try arrays.add(present);
    }
};

/// What `prepare` places in the world, or shares.
const Soup = struct { triangle_count: u64 = 0, byte_count: u64 = 0 };

fn soupOf(gpa: Allocator, scene: *const Scene) error{OutOfMemory}!Soup {
    const is_shared = try gpa.alloc(bool, scene.meshes.len);
    defer gpa.free(is_shared);
    if (!try prepare.chooseShared(gpa, scene, is_shared)) @memset(is_shared, false);
    const is_placed = try gpa.alloc(bool, scene.meshes.len);
    defer gpa.free(is_placed);
    @memset(is_placed, false);
    var vertex_count: u64 = 0;
    var soup: Soup = .{};
    var vertex_bytes: u64 = 2 * @sizeOf([3]f32);
    var has_colors = false;
    var has_tangents = false;
    var has_texcoords: [scene_data.texcoord_set_count]bool = @splat(false);
    for (scene.instances) |instance| {
        const mesh = &scene.meshes[instance.mesh];
        const material = &scene.materials[mesh.material];
        if (is_shared[instance.mesh]) {
            const cluster_count = mesh.triangles.len / cluster_triangles + 1;
            soup.byte_count += @sizeOf(world.instances.Instance) + cluster_count * cluster_bytes;
            if (is_placed[instance.mesh]) continue;
            is_placed[instance.mesh] = true;
        }
        soup.triangle_count += mesh.triangles.len;
        // Files share one list of vertices among many meshes, of which each draws some.
        vertex_count += @min(mesh.positions.len, 3 * mesh.triangles.len);
        if (mesh.colors != null) has_colors = true;
        if (material.normal_texture != null or material.clearcoat_normal_texture != null or
            material.anisotropy > 0) has_tangents = true;
        inline for (scene_data.texture_fields) |field| {
            if (@field(material, field)) |view| has_texcoords[view.texcoord_set] = true;
        }
    }
    if (has_colors) vertex_bytes += @sizeOf([4]f32);
    if (has_tangents) vertex_bytes += @sizeOf([4]f32);
    for (has_texcoords) |is_used| {
        if (is_used) vertex_bytes += @sizeOf([2]f32);
    }
    soup.byte_count += vertex_count * vertex_bytes + soup.triangle_count * @sizeOf(world.Triangle);
    return soup;
}

fn environmentBytes(scene: *const Scene) u64 {
    const map = if (scene.environment) |*map| map else return 0;
    const faces: []const u32 = if (map.projection == .cube) &map.faces else &.{map.image};
    var texel_count: u64 = 0;
    for (faces) |face| {
        var reason: decode.Reason = .{};
        const header = decode.info(scene.images[face].bytes, &reason) catch continue;
        texel_count += @as(u64, header.width) * header.height;
    }
    return environment_bytes + texel_count * environment_texel_bytes;
}

fn hasUnlit(scene: *const Scene) bool {
    for (scene.instances) |instance| {
        if (scene.materials[scene.meshes[instance.mesh].material].unlit) return true;
    }
    return false;
}

test "what is drawn, its textures and the picture count" {
    const gpa = std.testing.allocator;
    var diagnostic: Diagnostic = .{};
    var builder: scene_data.Builder = .init(gpa);
    errdefer builder.deinit();
    const material = try builder.addMaterial(.{});
    const unlit = try builder.addMaterial(.{ .unlit = true });
    // Fewer triangles than meshes have that are shared.
    const triangles: [50][3]u32 = @splat(.{ 0, 1, 2 });
    const mesh = try builder.addMesh(.{
        .positions = &.{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } },
        .triangles = &triangles,
        .material = material,
    });
    const node = try builder.addNode(scene_data.none, .identity);
    for (0..20_000) |_| try builder.addInstance(mesh, node);
    var scene = try builder.finish();
    defer scene.deinit();
    const instances = scene.instances;
    scene.instances = &.{};
    const empty = try estimate(gpa, &scene, .{ 1000, 1000 }, &diagnostic);
    try std.testing.expectEqual(base_bytes + 27_000_000, empty);
    scene.instances = instances;
    const drawn = try estimate(gpa, &scene, .{ 1, 1 }, &diagnostic);
    // A million triangles: 16 bytes, the tree's 50, and 24 to write that.
    try std.testing.expect(drawn > base_bytes + 90_000_000);
    const shown = try estimate(gpa, &scene, .{ 4000, 4000 }, &diagnostic);
    const meshes: [*]scene_data.Mesh = @constCast(scene.meshes.ptr);
    meshes[0].material = unlit;
    const layered = try estimate(gpa, &scene, .{ 4000, 4000 }, &diagnostic);
    try std.testing.expectEqual(shown + 16 * 4000 * 4000, layered);
}
