//! Layers of a picture as channels of an OpenEXR file: their names, kinds and places.
//!
//! In: rows of RGB or RGBA floats, and images of further layers. Out: a list of channels. Their
//! names are those that compositing programs look for, where there are such: docs/layers.md.

const std = @import("std");
const Image = @import("../image.zig").Image;
const openexr = @import("openexr.zig");
const settings = @import("../settings.zig");
const assert = std.debug.assert;
const Channel = openexr.Channel;

/// What a file may hold besides the picture.
pub const Further = struct {
    layer: settings.Layer,
    /// Pixels of which the layer has some channels.
    image: *const Image,

    /// A layer's values at a pixel; those of numbers are bits.
    pub fn valuesAt(further: *const Further, at: usize) []const f32 {
        const place = namesOf(further.layer);
        return further.image.pixels[at][place.first..][0..place.names.len];
    }
};

/// Whether the values of a layer are numbers of things, `none` where there is nothing.
pub fn isNumber(layer: settings.Layer) bool {
    return namesOf(layer).kind == .uint;
}

/// What stands for no thing.
pub const none = @import("../manifest.zig").none;

/// The text in a file that has the names of the things with numbers.
pub const manifest_name = "raylane/manifest";

/// The channels of a layer.
const Names = struct {
    names: []const [*:0]const u8,
    kind: openexr.Kind = .float,
    /// Place of the first one in the pixels of the layer's image.
    first: u32 = 0,
};

fn namesOf(layer: settings.Layer) Names {
    return switch (layer) {
        .depth => .{ .names = &.{"Z"} },
        .normal => .{ .names = &.{ "N.X", "N.Y", "N.Z" }, .kind = .half },
        .albedo => .{ .names = &.{ "albedo.R", "albedo.G", "albedo.B" }, .kind = .half },
        .uv => .{ .names = &.{ "UV.U", "UV.V" } },
        .node => .{ .names = &.{"node"}, .kind = .uint },
        .material => .{ .names = &.{"material"}, .kind = .uint, .first = 1 },
        .primitive => .{ .names = &.{"primitive"}, .kind = .uint, .first = 2 },
        .alpha => .{ .names = &.{"alpha"}, .first = 3 },
        .position => .{ .names = &.{ "P.X", "P.Y", "P.Z" } },
        .cost => .{ .names = &.{ "cost.boxes", "cost.triangles" } },
        .variance => .{ .names = &.{ "variance.R", "variance.G", "variance.B" } },
    };
}

/// A picture's, and all that layers may have.
pub const Channels = struct {
    list: [4 + 3 * std.enums.values(settings.Layer).len]Channel = undefined,
    count: usize = 0,

    /// Of a picture with three or four channels a pixel.
    pub fn addPicture(
        channels: *Channels,
        pixels: []align(4) const u8,
        channel_count: u8,
        kind: settings.ExrKind,
    ) void {
        assert(channel_count == 3 or channel_count == 4);
        const first: [*]const f32 = @ptrCast(pixels.ptr);
        const names = [_][*:0]const u8{ "R", "G", "B", "A" };
        for (names[0..channel_count], 0..) |name, at| channels.add(.{
            .name = name,
            .first = first + at,
            .stride = channel_count,
            .kind = switch (kind) {
                .half => .half,
                .float => .float,
            },
        });
    }

    /// Of a layer, once at most.
    pub fn addLayer(channels: *Channels, further: *const Further) void {
        const given = namesOf(further.layer);
        const first: [*]const f32 = @ptrCast(further.image.pixels.ptr);
        for (given.names, given.first..) |name, at| channels.add(.{
            .name = name,
            .first = first + at,
            .stride = 4,
            .kind = given.kind,
        });
    }

    /// All of them.
    pub fn all(channels: *const Channels) []const Channel {
        return channels.list[0..channels.count];
    }

    fn add(channels: *Channels, channel: Channel) void {
        channels.list[channels.count] = channel;
        channels.count += 1;
    }
};
