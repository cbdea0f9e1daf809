//! glTF's textures: the pictures that drawn materials use, and how they are looked up.
//!
//! In: what a material says of a texture (glTF 2.0, section 3.9.2; KHR_texture_transform), textures
//! and samplers (3.8; EXT_texture_webp, KHR_texture_basisu) and images (3.8.2). Out: the scene's
//! textures, and its images as the file has them, encoded. An image is read when a material first
//! asks for it, and once, however many name it. One that cannot be had is a warning and no texture.

const std = @import("std");
const buffer_views = @import("buffer_views.zig");
const c = @import("../cgltf.zig");
const diagnostic = @import("../../diagnostic.zig");
const escapes = @import("../json/escapes.zig");
const scene = @import("../../scene.zig");
const uri = @import("uri.zig");
const Error = Source.Error;
const ImageFiles = @import("../image_files.zig");
const Resources = @import("../resource.zig");
const Source = @import("source.zig");
const Textures = @This();

source: *Source,
files: ImageFiles,
/// The scene's texture for one of the file; null: it has no picture.
known: std.AutoHashMapUnmanaged(u32, ?u32) = .empty,
/// The scene's image for one of the file, and for what images are made of.
images: std.AutoHashMapUnmanaged(u32, ?u32) = .empty,
ranges: std.AutoHashMapUnmanaged(Range, u32) = .empty,
uris: std.StringHashMapUnmanaged(?u32) = .empty,
/// Bytes of buffers that may still be copied: images do not overlap.
view_bytes_left: u64,

/// Bytes of a buffer, or of what has been decompressed.
const Range = struct { start: usize, size: usize };

/// Nothing is read yet. Free with `deinit`.
pub fn init(source: *Source, resources: *Resources) Textures {
    var buffer_bytes: u64 = 0;
    for (source.buffers) |buffer| if (buffer) |bytes| {
        buffer_bytes += bytes.len;
    };
    return .{
        .source = source,
        .files = .{ .resources = resources, .builder = source.builder },
        .view_bytes_left = buffer_bytes,
    };
}

/// Frees what is not the scene's.
pub fn deinit(textures: *Textures) void {
    const gpa = textures.source.gpa;
    inline for (.{ "known", "images", "ranges", "uris" }) |name| @field(textures, name).deinit(gpa);
    textures.files.deinit();
    textures.* = undefined;
}

/// The texture of a material as `raw` says; null where there is none, or none that can be shown.
/// `material` and `slot` name it in messages.
pub fn view(
    textures: *Textures,
    raw: *const c.cgltf_texture_view,
    material: usize,
    slot: []const u8,
) Error!?scene.TextureView {
    if (raw.texture == null) return null;
    const source = textures.source;
    const transform = &raw.transform;
    const has_own_set = raw.has_transform != 0 and transform.has_texcoord != 0;
    const set = if (has_own_set) transform.texcoord else raw.texcoord;
    if (set < 0 or set >= scene.texcoord_set_count) {
        if (!hasTexcoords(source, set)) return source.fail(
            "material {d}: {s}: there is no TEXCOORD of its texCoord",
            .{ material, slot },
        );
        source.warn("material {d}: {s}: only TEXCOORD_0 to TEXCOORD_{d} are read, left out", .{
            material, slot, scene.texcoord_set_count - 1,
        });
        return null;
    }
    const index = Source.indexOf(source.data.textures, raw.texture);
    const parts: scene.TextureTransform = if (raw.has_transform == 0) .{} else .{
        .offset = transform.offset,
        .rotation_rad = transform.rotation,
        .scale = transform.scale,
    };
    return .{
        .texture = try textures.get(index) orelse return null,
        .texcoord_set = @intCast(set),
        .transform = if (raw.has_transform != 0)
            parts.rows() orelse {
                source.forgive("material {d}: {s}: its rotation is out of range, left out", .{
                    material, slot,
                });
                return null;
            }
        else
            .{ .{ 1, 0, 0 }, .{ 0, 1, 0 } },
        .parts = parts,
    };
}

/// Whether a mesh of the file has coordinates of this set.
fn hasTexcoords(source: *const Source, set: c_int) bool {
    for (Source.slice(source.data.meshes, source.data.meshes_count)) |*mesh| {
        for (Source.slice(mesh.primitives, mesh.primitives_count)) |*primitive| {
            const list = Source.slice(primitive.attributes, primitive.attributes_count);
            for (list) |*attribute| {
                if (attribute.type == .texcoord and attribute.index == set) return true;
            }
        }
    }
    return false;
}

/// The scene's texture for the file's with this index.
fn get(textures: *Textures, index: u32) Error!?u32 {
    const source = textures.source;
    if (textures.known.get(index)) |texture| return texture;
    try source.need(.textures, index);
    const raw = Source.item(source.data.textures, index);
    // What a file offers besides the image of the core is there to be preferred.
    var named = false;
    const image = for ([_][*c]c.cgltf_image{
        raw.webp_image, raw.basisu_image, raw.image,
    }) |candidate| {
        if (candidate == null) continue;
        named = true;
        const image_index = Source.indexOf(source.data.images, candidate);
        if (try textures.getImage(image_index)) |image| break image;
    } else null;
    if (!named) source.forgive("texture {d}: has no image that can be read, left out", .{index});
    var texture: ?u32 = null;
    if (image) |present| {
        var complete = try textures.readSampler(raw);
        complete.image = present;
        texture = try source.builder.addTexture(complete);
    }
    try textures.known.put(source.gpa, index, texture);
    return texture;
}

/// How a texture is looked up, without its image.
fn readSampler(textures: *const Textures, raw: *const c.cgltf_texture) Error!scene.Texture {
    var texture: scene.Texture = .{ .image = scene.none };
    if (raw.sampler == null) return texture;
    const source = textures.source;
    try source.need(.samplers, Source.indexOf(source.data.samplers, raw.sampler));
    const sampler = Source.item(raw.sampler, 0);
    switch (sampler.mag_filter) {
        .undefined, .linear => {},
        .nearest => texture.magnify = .nearest,
        else => |filter| warnOfSampler(source, raw, "magFilter", @backingInt(filter)),
    }
    switch (sampler.min_filter) {
        .undefined, .linear_mipmap_linear => {},
        .nearest => setMinify(&texture, .nearest, .none),
        .linear => setMinify(&texture, .linear, .none),
        .nearest_mipmap_nearest => setMinify(&texture, .nearest, .nearest),
        .linear_mipmap_nearest => setMinify(&texture, .linear, .nearest),
        .nearest_mipmap_linear => setMinify(&texture, .nearest, .linear),
        _ => |filter| warnOfSampler(source, raw, "minFilter", @backingInt(filter)),
    }
    const modes = [2]c.cgltf_wrap_mode{ sampler.wrap_s, sampler.wrap_t };
    const names = [2][]const u8{ "wrapS", "wrapT" };
    for (&texture.wrap, modes, names) |*wrap, mode, name| switch (mode) {
        .repeat => wrap.* = .repeat,
        .clamp_to_edge => wrap.* = .clamp_to_edge,
        .mirrored_repeat => wrap.* = .mirrored_repeat,
        _ => warnOfSampler(source, raw, name, @backingInt(mode)),
    };
    return texture;
}

fn setMinify(texture: *scene.Texture, minify: scene.Filter, mip: scene.MipFilter) void {
    texture.minify = minify;
    texture.mip = mip;
}

fn warnOfSampler(
    source: *const Source,
    raw: *const c.cgltf_texture,
    name: []const u8,
    value: c_uint,
) void {
    const index = Source.indexOf(source.data.textures, raw);
    const parts = .{ index, name, value };
    source.forgive("texture {d}: its sampler's {s} {d} is not known, ignored", parts);
}

/// The scene's image for the file's with this index; null, with a warning, where it has none.
pub fn getImage(textures: *Textures, index: u32) Error!?u32 {
    const source = textures.source;
    if (textures.images.get(index)) |image| return image;
    if (source.findBroken(.images, index)) |broken| {
        source.forgiveEach("image {d}: {s}, left out", .{ index, broken.reason });
        try textures.images.put(source.gpa, index, null);
        return null;
    }
    const raw = Source.item(source.data.images, index);
    const image = if (raw.buffer_view != null)
        try textures.fromView(index, Source.item(raw.buffer_view, 0))
    else if (raw.uri != null)
        try textures.fromUri(index, std.mem.span(@as([*:0]const u8, raw.uri)))
    else no_data: {
        source.forgiveEach("image {d}: has neither bufferView nor uri, left out", .{index});
        break :no_data null;
    };
    try textures.images.put(source.gpa, index, image);
    return image;
}

fn fromView(textures: *Textures, index: u32, raw: *const c.cgltf_buffer_view) Error!?u32 {
    const source = textures.source;
    const view_bytes = buffer_views.contents(source, raw) catch |err| {
        const line = try source.takeLine(err);
        source.forgiveEach("image {d}: {s}, left out", .{ index, line.text() });
        return null;
    } orelse {
        source.forgiveEach("image {d}: its buffer has no data, left out", .{index});
        return null;
    };
    const range: Range = .{ .start = @intFromPtr(view_bytes.ptr), .size = view_bytes.len };
    if (textures.ranges.get(range)) |image| return image;
    if (range.size > textures.view_bytes_left) {
        source.forgiveEach("image {d}: images of the file overlap, left out", .{index});
        return null;
    }
    textures.view_bytes_left -= range.size;
    const bytes = try source.arena.dupe(u8, view_bytes);
    const image = try textures.addImage(index, bytes);
    try textures.ranges.put(source.gpa, range, image);
    return image;
}

fn fromUri(textures: *Textures, index: u32, encoded: []const u8) Error!?u32 {
    const source = textures.source;
    if (textures.uris.get(encoded)) |image| return image;
    var reason: diagnostic.Message = .{};
    const image = if (uri.resolve(source.gpa, source.arena, encoded, &reason)) |resolved| image: {
        if (resolved.odd.len > 0)
            source.forgive("image {d}: its URI {s}", .{ index, resolved.odd });
        switch (resolved.target) {
            .bytes => |bytes| break :image try textures.addImage(index, bytes),
            .path => |path| {
                defer source.gpa.free(path);
                break :image try textures.fromFile(index, path);
            },
        }
    } else |err| switch (err) {
        error.OutOfMemory => |failure| return failure,
        error.InvalidInput => none: {
            source.forgiveEach("image {d}: {s}, left out", .{ index, reason.text() });
            break :none null;
        },
    };
    try textures.uris.put(source.gpa, encoded, image);
    return image;
}

fn fromFile(textures: *Textures, index: u32, path: []const u8) Error!?u32 {
    const source = textures.source;
    var name: diagnostic.Message = .{};
    name.set("image {d} {f}", .{ index, diagnostic.quote(path) });
    var reason: diagnostic.Message = .{};
    return textures.files.get(path, name.text(), &reason) catch |err| switch (err) {
        error.OutOfMemory => |failure| failure,
        error.Overwritten => source.diagnostic.fail(
            error.InputOutput,
            "image {d}: {f} {s}",
            .{ index, diagnostic.quote(path), reason.text() },
        ),
        error.Unreadable => {
            source.forgiveEach("image {d}: {f} {s}, left out", .{
                index, diagnostic.quote(path), reason.text(),
            });
            return null;
        },
    };
}

/// Adds an image whose bytes are the scene's.
fn addImage(textures: *Textures, index: u32, bytes: []const u8) Error!u32 {
    const source = textures.source;
    const raw = Source.item(source.data.images, index);
    var name: diagnostic.Message = .{};
    if (raw.name != null) {
        const text = try escapes.decodeString(source.gpa, std.mem.span(raw.name));
        defer source.gpa.free(text);
        name.set("image {d} {f}", .{ index, diagnostic.quote(text) });
    } else name.set("image {d}", .{index});
    return source.builder.addImage(.{
        .name = try source.arena.dupe(u8, name.text()),
        .bytes = bytes,
    });
}
