//! PBRT's textures: a constant, or a picture times a constant, whatever they are made of.
//!
//! In: the class of a Texture and its parameters. Out: its mean, and a picture where it is one,
//! from which a material makes a texture of the scene when it first needs it. Products with
//! constants are exact. What no picture can show, checkers and noise and sums, is its mean with a
//! warning, once a kind. docs/pbrt.md has the table.

const std = @import("std");
const decode = @import("../../decode.zig");
const diagnostic = @import("../../diagnostic.zig");
const math = @import("../../math.zig");
const scene = @import("../../scene.zig");
const spectra = @import("spectra.zig");
const Colors = @import("colors.zig");
const ImageFiles = @import("../image_files.zig");
const Input = @import("input.zig");
const Parameters = @import("parameters.zig");
const Error = Input.Error;
const Vec3 = math.Vec3;
const quote = diagnostic.quote;
const Textures = @This();

/// Mean of a picture: nobody has looked at it yet.
const picture_mean = 0.5;

/// What a name of a texture stands for.
pub const Texture = struct {
    /// Where a constant is needed.
    mean: Vec3,
    picture: ?Picture = null,
};

/// An image file as a texture shows it.
pub const Picture = struct {
    /// Lives as long as the scene is read.
    path: []const u8,
    /// Multiplies its colours.
    factor: Vec3 = .{ 1, 1, 1 },
    wrap: scene.Wrap = .repeat,
    filter: scene.Filter = .linear,
    /// Of the coordinates of meshes, whose v grows downwards.
    transform: [2][3]f32 = .{ .{ 1, 0, 0 }, .{ 0, 1, 0 } },
};

/// A picture in the scene.
pub const Shown = struct { view: scene.TextureView, factor: Vec3 };

input: *Input,
files: ImageFiles,
/// Lives as long as the scene is read.
arena: std.mem.Allocator,
named: std.StringHashMapUnmanaged(Texture) = .empty,
/// Images by the paths that lead to them; null: to none.
images: std.StringHashMapUnmanaged(?u32) = .empty,

/// Frees what is neither the scene's nor the arena's.
pub fn deinit(textures: *Textures) void {
    textures.files.deinit();
    textures.* = undefined;
}

/// The picture in the scene; null, with a warning, where its file cannot be read.
pub fn show(textures: *Textures, picture: *const Picture) Error!?Shown {
    const image = try textures.imageOf(picture.path) orelse return null;
    const texture = try textures.files.builder.addTexture(.{
        .image = image,
        .wrap = .{ picture.wrap, picture.wrap },
        .magnify = picture.filter,
        .minify = picture.filter,
        .mip = if (picture.filter == .nearest) .none else .linear,
    });
    return .{
        .view = .{ .texture = texture, .transform = picture.transform },
        .factor = picture.factor,
    };
}

/// The scene's image from a file; null, with a warning, where there is none.
pub fn imageOf(textures: *Textures, path: []const u8) Error!?u32 {
    if (textures.images.get(path)) |image| return image;
    const input = textures.input;
    var name: diagnostic.Message = .{};
    name.set("{f}", .{quote(path)});
    var reason: diagnostic.Message = .{};
    var buffer: [Input.path_bytes_max]u8 = undefined;
    const found = try input.slashed(input.directive, path, &buffer);
    const image = textures.files.get(found, name.text(), &reason) catch |err| switch (err) {
        error.OutOfMemory => |failure| return failure,
        error.Overwritten => {
            input.failHere("{s} {s}", .{ name.text(), reason.text() }) catch {};
            return error.InputOutput;
        },
        error.Unreadable => unreadable: {
            try input.warnHere(path, "image {s} {s}, left out", .{ name.text(), reason.text() });
            break :unreadable null;
        },
    };
    try textures.images.put(textures.arena, try textures.arena.dupe(u8, path), image);
    return image;
}

/// The mean luminance of one of the scene's images, which is decoded for that; null where it is
/// none.
pub fn luminanceOf(textures: *Textures, image: u32) error{OutOfMemory}!?f64 {
    const gpa = textures.input.gpa;
    const file = textures.files.builder.images.items[image].bytes;
    var reason: decode.Reason = .{};
    var texels = decode.decode(gpa, file, &reason) catch |err| switch (err) {
        error.OutOfMemory => |failure| return failure,
        error.InvalidImage => return null,
    };
    defer texels.deinit(gpa);
    const count = @as(usize, texels.width) * texels.height;
    var sum: f64 = 0;
    for (0..count) |texel| {
        const first = texel * texels.channel_count;
        const step: usize = @intFromBool(texels.channel_count >= 3);
        var rgb: Vec3 = undefined;
        for (&rgb, 0..) |*to, channel| to.* = switch (texels.data) {
            .bytes => |bytes| math.srgb.decoded[bytes[first + step * channel]],
            .floats => |floats| floats[first + step * channel],
        };
        sum += spectra.luminance(rgb);
    }
    return sum / @as(f64, @floatFromInt(count));
}

const Class = enum {
    constant,
    scale,
    mix,
    directionmix,
    checkerboard,
    dots,
    imagemap,
    bilerp,
};

/// What `Texture "name" "type" "class" ...` makes.
pub fn make(
    textures: *Textures,
    colors: *Colors,
    class: []const u8,
    is_color: bool,
    parameters: *const Parameters,
) Error!Texture {
    const maker: Maker = .{
        .textures = textures,
        .colors = colors,
        .parameters = parameters,
        .is_color = is_color,
    };
    const known = std.meta.stringToEnum(Class, class) orelse {
        parameters.pass();
        try textures.input.warnHere(
            class,
            "Texture {f} is not supported: its mean is taken as {d}",
            .{ quote(class), picture_mean },
        );
        return .{ .mean = @splat(picture_mean) };
    };
    switch (known) {
        .constant, .scale, .mix, .imagemap => {},
        .directionmix, .checkerboard, .dots, .bilerp => {
            parameters.pass();
            try textures.input.warnHere(
                class,
                "Texture {f} is shown as its mean",
                .{quote(class)},
            );
        },
    }
    return maker.make(known);
}

/// Makes the texture that the parameters tell.
const Maker = struct {
    textures: *Textures,
    colors: *Colors,
    parameters: *const Parameters,
    is_color: bool,

    const white: Texture = .{ .mean = .{ 1, 1, 1 } };
    const black: Texture = .{ .mean = .{ 0, 0, 0 } };

    fn operand(maker: Maker, name: []const u8, default: Texture) Error!Texture {
        return try maker.colors.texture(maker.parameters, name) orelse default;
    }

    fn make(maker: Maker, class: Class) Error!Texture {
        switch (class) {
            .constant => return maker.operand("value", white),
            .scale => {
                const has_first = maker.parameters.find("tex1") != null;
                const has_second = maker.parameters.find("tex2") != null;
                return maker.product(
                    try maker.operand(if (has_first) "tex1" else "tex", white),
                    try maker.operand(if (has_second) "tex2" else "scale", white),
                );
            },
            .mix => return maker.blend(
                try maker.operand("tex1", black),
                try maker.operand("tex2", white),
                try maker.amount(),
            ),
            .directionmix, .checkerboard => return maker.blend(
                try maker.operand("tex1", white),
                try maker.operand("tex2", black),
                null,
            ),
            .dots => return maker.blend(
                try maker.operand("inside", white),
                try maker.operand("outside", black),
                null,
            ),
            .bilerp => return maker.corners(),
            .imagemap => return maker.picture(),
        }
    }

    /// The product, exact unless both are pictures.
    fn product(maker: Maker, first: Texture, second: Texture) Error!Texture {
        var result: Texture = .{ .mean = multiply(first.mean, second.mean) };
        if (first.picture != null and second.picture != null) try maker.textures.input.warnHere(
            "product of pictures",
            "Texture 'scale': of two pictures the second counts as its mean",
            .{},
        );
        if (first.picture) |one| {
            result.picture = one;
            result.picture.?.factor = multiply(one.factor, second.mean);
        } else if (second.picture) |one| {
            result.picture = one;
            result.picture.?.factor = multiply(one.factor, first.mean);
        }
        return result;
    }

    /// The second one's share of a mixture; null: half of it, as another texture has it.
    fn amount(maker: Maker) Error!?f32 {
        const texture = try maker.colors.texture(maker.parameters, "amount") orelse return 0.5;
        if (texture.picture != null) return null;
        return (texture.mean[0] + texture.mean[1] + texture.mean[2]) / 3;
    }

    /// A mixture: exact where both are constants or one does not count, or is black.
    fn blend(maker: Maker, first: Texture, second: Texture, share: ?f32) Error!Texture {
        const known = share orelse 0.5;
        if (share != null and known == 0) return first;
        if (share != null and known == 1) return second;
        var result: Texture = .{ .mean = undefined };
        for (&result.mean, first.mean, second.mean) |*to, a, b| {
            to.* = (1 - known) * a + known * b;
        }
        if (first.picture == null and second.picture == null) return result;
        const is_dark = Vec3{ 0, 0, 0 };
        if (share != null and std.meta.eql(second.mean, is_dark)) return maker.product(first, .{
            .mean = @splat(1 - known),
        });
        if (share != null and std.meta.eql(first.mean, is_dark)) return maker.product(second, .{
            .mean = @splat(known),
        });
        try maker.textures.input.warnHere(
            "sum of pictures",
            "Texture: sums of pictures count as their mean",
            .{},
        );
        return result;
    }

    fn corners(maker: Maker) Error!Texture {
        var result = black;
        for ([_][]const u8{ "v00", "v01", "v10", "v11" }, 0..) |name, index| {
            const value = try maker.operand(name, if (index % 2 == 0) black else white);
            for (&result.mean, value.mean) |*to, part| to.* += 0.25 * part;
        }
        return result;
    }

    fn picture(maker: Maker) Error!Texture {
        const input = maker.textures.input;
        const from = maker.parameters;
        const scale = from.float("scale", 1);
        const result: Texture = .{ .mean = @splat(picture_mean * scale) };
        const default = if (from.boolean("gamma", true)) "sRGB" else "linear";
        const encoding = from.string("encoding") orelse default;
        if (maker.is_color and !std.mem.eql(u8, encoding, "sRGB")) try input.warnHere(
            "encoding",
            "Texture 'imagemap': colours of 8 bits are sRGB, not {f}",
            .{quote(encoding)},
        );
        const path = from.string("filename") orelse {
            from.pass();
            try input.warnHere("no file", "Texture 'imagemap' has no filename, left out", .{});
            return result;
        };
        const mapping = from.string("mapping") orelse "uv";
        if (from.boolean("invert", false) or !std.mem.eql(u8, mapping, "uv")) {
            from.pass();
            try input.warnHere(
                "imagemap",
                "Texture 'imagemap': inverted pictures, and those that are mapped otherwise " ++
                    "than by uv, count as {d}",
                .{picture_mean},
            );
            return result;
        }
        var shown: Picture = .{
            .path = try maker.textures.arena.dupe(u8, path),
            .factor = @splat(scale),
            .transform = transformOf(from) orelse {
                try input.warnHere("mapping", "Texture: its mapping is out of range", .{});
                return result;
            },
        };
        const wrap = from.string("wrap") orelse "repeat";
        if (std.mem.eql(u8, wrap, "clamp")) shown.wrap = .clamp_to_edge;
        if (std.mem.eql(u8, wrap, "black")) {
            shown.wrap = .clamp_to_edge;
            try input.warnHere(wrap, "Texture: what is black around a picture is its edge", .{});
        }
        const filter = from.string("filter") orelse "";
        if (std.mem.eql(u8, filter, "point")) shown.filter = .nearest;
        return .{ .mean = result.mean, .picture = shown };
    }
};

fn multiply(a: Vec3, b: Vec3) Vec3 {
    return .{ a[0] * b[0], a[1] * b[1], a[2] * b[2] };
}

/// From coordinates of meshes, (u, 1 - v), to those of pictures, (s, 1 - t), where s = su u + du
/// and t = sv v + dv; null where it is out of range.
fn transformOf(parameters: *const Parameters) ?[2][3]f32 {
    const su = either(parameters, "uscale", "su", 1);
    const sv = either(parameters, "vscale", "sv", 1);
    const du = either(parameters, "udelta", "du", 0);
    const dv = either(parameters, "vdelta", "dv", 0);
    const rows: [2][3]f32 = .{ .{ su, 0, du }, .{ 0, sv, 1 - sv - dv } };
    for (rows) |row| for (row) |value| if (!(@abs(value) <= 1e6)) return null;
    return rows;
}

fn either(parameters: *const Parameters, name: []const u8, other: []const u8, default: f32) f32 {
    return parameters.float(name, parameters.float(other, default));
}
