//! Textured pictures: one for every variant, and the same by a mirror as without.
//!
//! In: scenes whose images are PNGs made here, a few texels each. Out: hashes, and pixels that
//! follow from others.

const std = @import("std");
const fixture = @import("fixture.zig");
const raylane = @import("raylane");
const variants = @import("variants.zig");
const gpa = std.testing.allocator;
const TextureView = raylane.scene.TextureView;

/// A PNG of 8-bit texels in rows, one to four channels, not compressed.
fn png(arena: std.mem.Allocator, width: u32, height: u32, texels: []const u8) ![]const u8 {
    const channel_count = texels.len / (width * height);
    const row_length = width * channel_count;
    var rows: std.ArrayList(u8) = .empty;
    for (0..height) |row| {
        try rows.append(arena, 0); // No filter.
        try rows.appendSlice(arena, texels[row * row_length ..][0..row_length]);
    }
    const length: u16 = @intCast(rows.items.len);
    var stream: std.Io.Writer.Allocating = .init(arena);
    try stream.writer.writeAll("\x78\x01\x01");
    try stream.writer.writeInt(u16, length, .little);
    try stream.writer.writeInt(u16, ~length, .little);
    try stream.writer.writeAll(rows.items);
    try stream.writer.writeInt(u32, std.hash.Adler32.hash(rows.items), .big);
    var header: [13]u8 = @splat(0);
    std.mem.writeInt(u32, header[0..4], width, .big);
    std.mem.writeInt(u32, header[4..8], height, .big);
    header[8] = 8;
    header[9] = ([_]u8{ 0, 4, 2, 6 })[channel_count - 1];
    var file: std.Io.Writer.Allocating = .init(arena);
    try file.writer.writeAll("\x89PNG\r\n\x1a\n");
    try writeChunk(&file.writer, "IHDR", &header);
    try writeChunk(&file.writer, "IDAT", stream.written());
    try writeChunk(&file.writer, "IEND", "");
    return file.written();
}

fn writeChunk(writer: *std.Io.Writer, kind: *const [4]u8, data: []const u8) !void {
    try writer.writeInt(u32, @intCast(data.len), .big);
    try writer.writeAll(kind);
    try writer.writeAll(data);
    var hash: std.hash.Crc32 = .init();
    hash.update(kind);
    hash.update(data);
    try writer.writeInt(u32, hash.final(), .big);
}

/// Scenes with textures.
const Builder = struct {
    fixed: fixture.Builder,

    fn init() !Builder {
        return .{ .fixed = try .init() };
    }

    /// A texture with an image of its own.
    fn addTexture(
        builder: *Builder,
        size: [2]u32,
        texels: []const u8,
        sampler: raylane.scene.Texture,
    ) !TextureView {
        const scene = &builder.fixed.scene;
        var texture = sampler;
        texture.image = try scene.addImage(.{
            .name = "made",
            .bytes = try png(scene.arena(), size[0], size[1], texels),
        });
        return .{ .texture = try scene.addTexture(texture) };
    }

    /// The parallelogram center +- across +- upward with texture coordinates, (0, 0) the corner at
    /// the left above, up to `repeats`; its front is across x upward.
    fn addQuad(
        builder: *Builder,
        material: raylane.scene.Material,
        center: [3]f32,
        across: [3]f32,
        upward: [3]f32,
        repeats: [2]f32,
    ) !void {
        const vec3 = raylane.math.vec3;
        const scene = &builder.fixed.scene;
        const arena = scene.arena();
        const left = vec3.sub(center, across);
        const right = vec3.add(center, across);
        const mesh = try scene.addMesh(.{
            .positions = try arena.dupe([3]f32, &.{
                vec3.sub(left, upward),  vec3.sub(right, upward),
                vec3.add(right, upward), vec3.add(left, upward),
            }),
            .texcoords = .{ try arena.dupe([2]f32, &.{
                .{ 0, repeats[1] }, repeats, .{ repeats[0], 0 }, .{ 0, 0 },
            }), null, null, null },
            .tangents = try arena.dupe([4]f32, &@as([4][4]f32, @splat(across ++ [_]f32{1}))),
            .triangles = try arena.dupe([3]u32, &.{ .{ 0, 1, 2 }, .{ 0, 2, 3 } }),
            .material = try scene.addMaterial(material),
        });
        try scene.addInstance(mesh, 0);
    }
};

/// Texels of a noise that is the same everywhere.
fn noise(comptime count: usize, seed: u64) [count]u8 {
    var texels: [count]u8 = undefined;
    var generator: std.Random.SplitMix64 = .init(seed);
    for (&texels) |*texel| texel.* = @truncate(generator.next());
    return texels;
}

fn mixedScene() !raylane.scene.Scene {
    var builder: Builder = try .init();
    errdefer builder.fixed.scene.deinit();
    const checker = try builder.addTexture(.{ 4, 4 }, &noise(4 * 4 * 3, 1), .{
        .image = 0,
        .wrap = .{ .mirrored_repeat, .repeat },
    });
    const leaves = try builder.addTexture(.{ 5, 3 }, &noise(5 * 3 * 4, 2), .{
        .image = 0,
        .magnify = .nearest,
        .mip = .nearest,
        .wrap = .{ .clamp_to_edge, .mirrored_repeat },
    });
    const bumps = try builder.addTexture(.{ 8, 8 }, &bumpTexels(), .{ .image = 0 });
    const grains = try builder.addTexture(.{ 16, 16 }, &noise(16 * 16 * 3, 3), .{ .image = 0 });
    var floor = fixture.matte(.{ 1, 1, 1 });
    floor.base_color_texture = checker;
    floor.occlusion_texture = grains;
    floor.occlusion_strength = 0.5;
    try builder.addQuad(floor, .{ 0, -1, -3 }, .{ 4, 0, 0 }, .{ 0, 0, -4 }, .{ 9, 7 });
    var wall: raylane.scene.Material = .{ .metallic = 1, .roughness = 0.9, .double_sided = true };
    wall.metallic_roughness_texture = grains;
    wall.base_color_texture = checker;
    wall.base_color_texture.?.transform = .{ .{ 1.5, 0.5, 0.1 }, .{ -0.5, 1.5, 0.2 } };
    wall.normal_texture = bumps;
    wall.normal_scale = 0.7;
    try builder.addQuad(wall, .{ -1.2, 0.2, -4 }, .{ 1, 0, 0.6 }, .{ 0, 1.2, 0 }, .{ 3, 3 });
    var mirror = wall;
    mirror.roughness = 0;
    mirror.base_color_texture = null;
    mirror.metallic_roughness_texture = null;
    try builder.addQuad(mirror, .{ 1.2, 0.2, -4 }, .{ 1, 0, -0.6 }, .{ 0, 1.2, 0.4 }, .{ 2, 2 });
    var masked = fixture.matte(.{ 0.9, 1, 0.5 });
    masked.alpha_mode = .mask;
    masked.base_color_texture = leaves;
    try builder.addQuad(masked, .{ 0.3, 0.4, -2.4 }, .{ 0.6, 0.1, 0 }, .{ 0, 0.6, 0.2 }, .{ 1, 2 });
    var veil = fixture.matte(.{ 0.9, 0.2, 0.1 });
    veil.alpha_mode = .blend;
    veil.base_color_texture = leaves;
    veil.emissive = .{ 0.5, 0.5, 0.5 };
    veil.emissive_texture = grains;
    try builder.addQuad(veil, .{ -0.7, 0.5, -2.2 }, .{ 0.5, 0, 0.2 }, .{ 0, 0.5, 0 }, .{ 1, 1 });
    var glass = fixture.matte(.{ 0.9, 1, 0.9 });
    glass.ior = 1.5;
    glass.roughness = 0;
    glass.transmission = 1;
    glass.volume = true;
    try builder.fixed.addSphere(glass, .{ 0.1, -0.5, -2 }, 0.45, 8);
    try builder.fixed.addPointLight(.{ 1, 3, -1 }, 30);
    try builder.fixed.scene.addLight(.{
        .kind = .directional,
        .node = try builder.fixed
            .addNode(.fromTrs(.{ 0, 0, 0 }, .{ -0.6, 0, 0, 0.8 }, .{ 1, 1, 1 })),
    });
    try builder.fixed.addCamera(.{ 0, 0.3, 1 }, 0.6);
    return builder.fixed.finish();
}

/// Normals that lean to all sides.
fn bumpTexels() [8 * 8 * 3]u8 {
    var texels = noise(8 * 8 * 3, 4);
    for (0..8 * 8) |index| {
        for (texels[index * 3 ..][0..2]) |*component| component.* = 78 + component.* % 100;
        texels[index * 3 + 2] = 230;
    }
    return texels;
}

test "every variant renders textures of every kind to the golden hash" {
    var scene = try mixedScene();
    defer scene.deinit();
    const Golden = struct { u32, u64 };
    for ([_]Golden{ .{ 1, 0x5a472762734dbb21 }, .{ 2, 0x703444dae13eca70 } }) |golden| {
        const options: fixture.Options = .{
            .width = 60,
            .height = 44,
            .sample_count = golden[0],
            .thread_count = 2,
            .ambient = 0.3,
        };
        try variants.expectAllVariants(&scene, options, golden[1]);
    }
}

/// A picture of an unlit texture, 4.5 metres from the eye, or by a mirror half way.
fn pictureOf(is_mirrored: bool) !raylane.image.Image {
    var builder: Builder = try .init();
    errdefer builder.fixed.scene.deinit();
    var shown = fixture.flat(.{ 1, 1, 1 });
    shown.base_color_texture =
        try builder.addTexture(.{ 16, 16 }, &noise(16 * 16 * 3, 7), .{ .image = 0 });
    if (is_mirrored) {
        const mirror: raylane.scene.Material = .{ .metallic = 1, .roughness = 0 };
        try builder.fixed.addQuad(mirror, .{ 0, 0, -2 }, .{ 3, 0, 0 }, .{ 0, 3, 0 });
        try builder.addQuad(shown, .{ 0, 0, 0.5 }, .{ 3, 0, 0 }, .{ 0, 3, 0 }, .{ 20, 20 });
    } else {
        try builder.addQuad(shown, .{ 0, 0, -4.5 }, .{ 3, 0, 0 }, .{ 0, 3, 0 }, .{ 20, 20 });
    }
    try builder.fixed.addCamera(.{ 0, 0, 0 }, 0.5);
    var scene = try builder.fixed.finish();
    defer scene.deinit();
    return fixture.render(&scene, .{ .width = 40, .height = 40, .ambient = 0 });
}

test "a texture in a plane mirror is as fine as from as far away" {
    var straight = try pictureOf(false);
    defer straight.deinit(gpa);
    var mirrored = try pictureOf(true);
    defer mirrored.deinit(gpa);
    for (straight.pixels, mirrored.pixels) |a, b| {
        for (a, b) |expected, found| try std.testing.expectApproxEqAbs(expected, found, 2e-3);
    }
}

/// A floor below something that has holes by a texture, or is half as large.
fn pictureOfHoles(by_texture: bool, mode: raylane.scene.AlphaMode) !raylane.image.Image {
    var builder: Builder = try .init();
    errdefer builder.fixed.scene.deinit();
    var leaf = fixture.matte(.{ 0.8, 0.5, 0.2 });
    leaf.alpha_mode = mode;
    if (by_texture) {
        leaf.base_color_texture = try builder.addTexture(.{ 2, 1 }, &.{
            255, 255, 255, if (mode == .mask) 255 else 102, 255, 255, 255, 0,
        }, .{ .image = 0, .magnify = .nearest, .mip = .none, .minify = .nearest });
        try builder.addQuad(leaf, .{ 0, 0, -3 }, .{ 1, 0.3, 0 }, .{ 0, 0.5, -0.7 }, .{ 1, 1 });
    } else {
        if (mode == .blend) leaf.base_color[3] = 0.4;
        try builder.fixed
            .addQuad(leaf, .{ -0.5, -0.15, -3 }, .{ 0.5, 0.15, 0 }, .{ 0, 0.5, -0.7 });
    }
    try builder.fixed
        .addQuad(fixture.matte(.{ 1, 1, 1 }), .{ 0, -1, -3 }, .{ 4, 0, 0 }, .{ 0, 0, -4 });
    try builder.fixed.addPointLight(.{ 1, 3, -2 }, 30);
    try builder.fixed.scene.addLight(.{
        .kind = .directional,
        .node = try builder.fixed
            .addNode(.fromTrs(.{ 0, 0, 0 }, .{ -0.6, 0, 0, 0.8 }, .{ 1, 1, 1 })),
    });
    try builder.fixed.addCamera(.{ 0, 0.3, 0 }, 0.6);
    var scene = try builder.fixed.finish();
    defer scene.deinit();
    return fixture.render(&scene, .{ .width = 60, .height = 60, .ambient = 0.1 });
}

test "what a texture leaves open lets sight and light through, as if it was not there" {
    for ([_]raylane.scene.AlphaMode{ .mask, .blend }) |mode| {
        var cut = try pictureOfHoles(false, mode);
        defer cut.deinit(gpa);
        var textured = try pictureOfHoles(true, mode);
        defer textured.deinit(gpa);
        var different: usize = 0;
        for (cut.pixels, textured.pixels) |a, b| for (a, b) |expected, found| {
            if (@abs(expected - found) > 1e-4 * (1 + expected)) different += 1;
        };
        // But for pixels whose ray comes within rounding of the texels' border.
        try std.testing.expect(different <= 3);
    }
}
