//! What a part of a picture says of itself: an attribute of its OpenEXR file, and its channels.
//!
//! In: a film with a part of a picture, and what its output would need. Out: a file of floats whose
//! data window is where the part lies in the display window; tiles that are spread over the picture
//! lie side by side in a file of their own size. The attribute is an object of JSON. What is read
//! of it is a stranger's: every number is within its limits before anything is made of it.

const std = @import("std");
const film_file = @import("film.zig");
const output = @import("output.zig");
const settings = @import("settings.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = @import("diagnostic.zig").Diagnostic;
const Film = film_file.Film;
const Layer = film_file.Layer;
const Layout = film_file.Layout;
const Manifest = @import("manifest.zig").Manifest;
const quote = @import("diagnostic.zig").quote;
const assert = std.debug.assert;

/// Name of the attribute.
pub const attribute_name = "raylane:part";
/// Bytes of its text at most.
const text_bytes_max = output.openexr.text_bytes_max;

/// What the attribute says. Slices are the caller's.
pub const Record = struct {
    /// Of the program.
    version: []const u8,
    /// Of the whole picture.
    width: u32,
    height: u32,
    /// A crop in pixels, or tiles.
    part: settings.Part,
    /// Fingerprints of what was read, and of all options that the picture depends on.
    scene: [16]u8,
    options: [16]u8,
    /// Of the pixels that have the most.
    sample_count: u32,
    /// It was stopped before its end.
    is_partial: bool,
    /// What is in its channels, colours among them.
    layers: []const Layer,
    /// Which of these the picture's file is to have.
    further: []const settings.Layer,
    /// The picture is to be denoised.
    denoise: bool,
    exposure_ev: f32,
    tone_mapping: settings.ToneMapping,
    transparent: bool,
    background: output.Background,
    /// Names of what the part shows.
    manifest: ?Names,
    jpeg_quality: u8,
    webp_quality: ?u8,
    exr_kind: settings.ExrKind,
    frame_rate: settings.FrameRate,

    /// The layers as a film has them.
    pub fn layerSet(record: *const Record) film_file.Layers {
        return .initMany(record.layers);
    }

    /// In what it is first unlike a part of the same picture, for messages that go on with its
    /// name; null: in nothing.
    pub fn differenceFrom(record: *const Record, other: *const Record) ?[]const u8 {
        if (record.width != other.width or record.height != other.height)
            return "it is of another size than";
        if (!std.mem.eql(u8, &record.scene, &other.scene))
            return "it is of another scene than";
        if (!std.mem.eql(u8, &record.options, &other.options))
            return "it was rendered with other options than";
        // What follows from these, unless somebody has changed it.
        const is_same = record.layerSet().eql(other.layerSet()) and
            std.mem.eql(settings.Layer, record.further, other.further) and
            record.denoise == other.denoise and record.exposure_ev == other.exposure_ev and
            record.tone_mapping == other.tone_mapping and
            record.transparent == other.transparent and
            std.meta.eql(record.background, other.background) and
            (record.manifest == null) == (other.manifest == null) and
            record.jpeg_quality == other.jpeg_quality and
            std.meta.eql(record.webp_quality, other.webp_quality) and
            record.exr_kind == other.exr_kind and
            std.meta.eql(record.frame_rate, other.frame_rate);
        return if (is_same) null else "it was changed, other than";
    }
};

/// A manifest as records have it.
pub const Names = struct {
    node: []const Entry,
    mesh: []const Entry,
    material: []const Entry,

    const Entry = @import("manifest.zig").Entry;

    /// Of the one that a picture has.
    pub fn of(manifest: *const Manifest) Names {
        return .{
            .node = manifest.node,
            .mesh = manifest.mesh,
            .material = manifest.material,
        };
    }

    /// The manifest again.
    pub fn manifestOf(names: *const Names) Manifest {
        return .{ .node = names.node, .mesh = names.mesh, .material = names.material };
    }
};

/// A fingerprint as records have it.
pub fn hexOf(fingerprint: u64) [16]u8 {
    var text: [16]u8 = undefined;
    _ = std.mem.print(&text, "{x:0>16}", .{fingerprint}) catch unreachable; // It is as long.
    return text;
}

/// Names of a layer's channels.
pub fn channelNames(layer: Layer) *const [4][:0]const u8 {
    return switch (layer) {
        .color => &.{ "R", "G", "B", "A" },
        .alpha => unreachable, // It is a channel of the colours.
        inline else => |apart| comptime &.{
            @tagName(apart) ++ ".R", @tagName(apart) ++ ".G",
            @tagName(apart) ++ ".B", @tagName(apart) ++ ".A",
        },
    };
}

/// Channels of all layers at most.
pub const channel_count_max = 4 * std.enums.values(Layer).len;

/// Writes the part that a film has, without what is around it. Closes the target in any case.
pub fn write(
    gpa: Allocator,
    film: *const Film,
    layout: *const Layout,
    record: *const Record,
    target: *output.Target,
    diagnostic: *Diagnostic,
) output.Error!void {
    defer target.abandon();
    assert(!layout.hasSurroundings());
    const text = try gpa.printSentinel("{f}", .{std.json.fmt(record, .{})}, 0);
    defer gpa.free(text);
    var channels: [channel_count_max]output.openexr.Channel = undefined;
    var count: usize = 0;
    for (record.layers) |layer| {
        const image = switch (layer) {
            .alpha => continue,
            .color => &film.image,
            else => film.imageOf(layer).?,
        };
        for (channelNames(layer), 0..) |name, at| {
            channels[count] = .{
                .name = name,
                .first = @as([*]const f32, @ptrCast(image.pixels.ptr)) + at,
                .stride = 4,
            };
            count += 1;
        }
    }
    const is_window = layout.form == .window;
    try output.writeChannels(gpa, .{
        .width = if (is_window) layout.width else layout.film_width,
        .height = if (is_window) layout.height else layout.film_height,
        .window = switch (layout.form) {
            .window => |own| .{ .x0 = own[0], .y0 = own[1], .x1 = own[2], .y1 = own[3] },
            .share => null,
        },
        .channels = channels[0..count],
        .attributes = &.{.{ .name = attribute_name, .text = text }},
    }, target, diagnostic);
}

/// Reads an attribute, whose slices are from `arena`.
pub fn read(
    arena: Allocator,
    text: []const u8,
    version: []const u8,
    diagnostic: *Diagnostic,
) error{ OutOfMemory, InvalidInput }!Record {
    const damaged = "its attribute {s} is damaged";
    if (text.len > text_bytes_max)
        return diagnostic.invalid(damaged, .{attribute_name});
    const options: std.json.ParseOptions = .{ .ignore_unknown_fields = true };
    const Version = struct { version: []const u8 };
    const by = std.json.parseFromSliceLeaky(Version, arena, text, options) catch |err|
        return failed(err, diagnostic);
    if (!std.mem.eql(u8, by.version, version)) return diagnostic.invalid(
        "it was written by version {f}, this is {s}",
        .{ quote(by.version), version },
    );
    const record = std.json.parseFromSliceLeaky(Record, arena, text, .{}) catch |err|
        return failed(err, diagnostic);
    if (!isWithinLimits(&record)) return diagnostic.invalid(damaged, .{attribute_name});
    return record;
}

fn failed(err: anyerror, diagnostic: *Diagnostic) error{ OutOfMemory, InvalidInput } {
    if (err == error.OutOfMemory) return error.OutOfMemory;
    return diagnostic.invalid("its attribute {s} is damaged", .{attribute_name});
}

fn isWithinLimits(record: *const Record) bool {
    const is_size = settings.side.holds(record.width) and settings.side.holds(record.height) and
        @as(u64, record.width) * record.height <= settings.pixel_count_max;
    const is_part = switch (record.part) {
        .whole => false,
        .crop => |crop| crop == .pixels,
        .tile => |tile| settings.part_count.holds(tile.count) and tile.number >= 1 and
            tile.number <= tile.count,
    };
    const layers = record.layerSet();
    var has_further = layers.count() == record.layers.len;
    for (record.further) |layer| {
        has_further = has_further and layers.contains(film_file.layerOf(layer));
    }
    return is_size and is_part and layers.contains(.color) and has_further and
        record.further.len <= std.enums.values(settings.Layer).len and
        settings.sample_count.holds(record.sample_count) and
        @abs(record.exposure_ev) <= settings.exposure_ev_max and
        settings.jpeg_quality.holds(record.jpeg_quality) and
        (record.webp_quality == null or settings.webp_quality.holds(record.webp_quality.?)) and
        record.frame_rate.numerator > 0 and record.frame_rate.denominator > 0;
}

const testing = std.testing;

/// One that says something of everything.
const record_for_test: Record = .{
    .version = "1.2",
    .width = 40,
    .height = 30,
    .part = .{ .tile = .{ .number = 2, .count = 3 } },
    .scene = "0123456789abcdef".*,
    .options = hexOf(7),
    .sample_count = 4,
    .is_partial = false,
    .layers = &.{ .color, .alpha, .depth },
    .further = &.{.depth},
    .denoise = false,
    .exposure_ev = -0.1,
    .tone_mapping = .agx,
    .transparent = true,
    .background = .{ .srgb = .{ 1, 2, 255 } },
    .manifest = .{ .node = &.{.{ .number = 3, .name = "a\xff" }}, .mesh = &.{}, .material = &.{} },
    .jpeg_quality = 90,
    .webp_quality = null,
    .exr_kind = .float,
    .frame_rate = .{ .numerator = 30_000, .denominator = 1001 },
};

test "a record comes back as it was, and no other gets through" {
    var arena_state: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena_state.deinit();
    const arena = arena_state.allocator();
    var diagnostic: Diagnostic = .{};
    const Change = struct { []const u8, []const u8, []const u8 };
    const text = try arena.print("{f}", .{std.json.fmt(record_for_test, .{})});
    const back = try read(arena, text, "1.2", &diagnostic);
    try testing.expectEqualDeep(record_for_test, back);
    try testing.expectEqual(null, back.differenceFrom(&record_for_test));
    try testing.expectError(error.InvalidInput, read(arena, text, "1.3", &diagnostic));
    try testing.expect(std.mem.find(u8, diagnostic.message.text(), "'1.2', this is 1.3") != null);
    for ([_]Change{
        .{ "\"width\":40", "\"width\":0", "damaged" },
        .{ "\"width\":40", "\"width\":65537", "damaged" },
        .{ "\"number\":2", "\"number\":4", "damaged" },
        .{ "\"count\":3", "\"count\":4294967295", "damaged" },
        .{ "\"jpeg_quality\":90", "\"jpeg_quality\":101", "damaged" },
        .{ "\"layers\":[\"color\"", "\"layers\":[\"albedo\"", "damaged" },
        .{ "\"depth\"],\"further\"", "\"depth\",\"depth\"],\"further\"", "damaged" },
        .{ "[\"depth\"]", "[\"normal\"]", "damaged" },
        .{ "\"sample_count\":4", "\"sample_count\":-1", "damaged" },
        .{ "\"version\":\"1.2\"", "\"version\":\"1.2\",\"more\":1", "damaged" },
        .{ "\"denominator\":1001", "\"denominator\":0", "damaged" },
        .{ "{\"version\"", "[\"version\"", "damaged" },
    }) |change| {
        errdefer std.debug.print("{s}\n", .{change[1]});
        const changed = try std.mem.replaceOwned(u8, arena, text, change[0], change[1]);
        try testing.expect(!std.mem.eql(u8, text, changed));
        try testing.expectError(error.InvalidInput, read(arena, changed, "1.2", &diagnostic));
        try testing.expect(std.mem.find(u8, diagnostic.message.text(), change[2]) != null);
    }
    var other = back;
    other.options = hexOf(8);
    try testing.expect(std.mem.find(u8, other.differenceFrom(&back).?, "options") != null);
}
