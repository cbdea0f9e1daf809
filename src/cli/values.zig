//! Values on the command line: the text of one -> what it stands for, within its limits, or null.

const std = @import("std");
const colors = @import("colors.zig");
const settings = @import("../settings.zig");
const integer = @import("arguments.zig").integer;

/// A rectangle of at least one pixel; with a dot anywhere, all are fractions.
pub fn cropOf(text: []const u8) ?settings.Part.Crop {
    const has_dot = std.mem.findScalar(u8, text, '.') != null;
    var pixels: [4]u32 = undefined;
    var shares: [4]f32 = undefined;
    var numbers = std.mem.splitScalar(u8, text, ',');
    for (&pixels, &shares) |*pixel, *share| {
        const number = numbers.next() orelse return null;
        if (has_dot)
            share.* = numberWithin(number, crop_shares) orelse return null
        else
            pixel.* = integer(number, .{ .min = 0, .max = settings.side.max }) orelse return null;
    }
    if (numbers.next() != null) return null;
    if (has_dot) {
        const is_some = shares[0] < shares[2] and shares[1] < shares[3];
        return if (is_some) .{ .shares = shares } else null;
    }
    const is_some = pixels[0] < pixels[2] and pixels[1] < pixels[3];
    return if (is_some) .{ .pixels = pixels } else null;
}

const crop_shares: struct { min: f32, max: f32 } = .{ .min = 0, .max = 1 };

/// I/N.
pub fn tileOf(text: []const u8) ?settings.Part.Tile {
    const slash = std.mem.findScalar(u8, text, '/') orelse return null;
    const number = integer(text[0..slash], settings.part_count) orelse return null;
    const count = integer(text[slash + 1 ..], settings.part_count) orelse return null;
    return if (number <= count) .{ .number = number, .count = count } else null;
}

/// A format by its extension, in either case; JPEG has two.
pub fn formatOf(extension: []const u8) ?settings.Format {
    if (std.ascii.eqlIgnoreCase(extension, "jpeg")) return .jpg;
    for (std.enums.values(settings.Format)) |format| {
        if (std.ascii.eqlIgnoreCase(extension, @tagName(format))) return format;
    }
    return null;
}

/// A number of bytes above 0, or of K, M, G or T, each 1024 times the one before.
pub fn bytesOf(text: []const u8) ?u64 {
    if (text.len == 0) return null;
    const units = "KMGT";
    const unit = std.mem.findScalar(u8, units, std.ascii.toUpper(text[text.len - 1]));
    const digits = if (unit == null) text else text[0 .. text.len - 1];
    for (digits) |digit| if (!std.ascii.isDigit(digit)) return null;
    const count = std.fmt.parseInt(u64, digits, 10) catch return null;
    if (count == 0) return null;
    const shift: u6 = if (unit) |index| @intCast(10 * (index + 1)) else 0;
    return std.math.shlExact(u64, count, shift) catch null;
}

/// A number above 0, or of K, M or G, each 1000 times the one before.
pub fn countOf(text: []const u8) ?u64 {
    if (text.len == 0) return null;
    const unit = std.mem.findScalar(u8, "KMG", std.ascii.toUpper(text[text.len - 1]));
    const digits = if (unit == null) text else text[0 .. text.len - 1];
    for (digits) |digit| if (!std.ascii.isDigit(digit)) return null;
    const count = std.fmt.parseInt(u64, digits, 10) catch return null;
    const factor = if (unit) |index| std.math.pow(u64, 1000, index + 1) else 1;
    return if (count == 0) null else std.math.mul(u64, count, factor) catch null;
}

/// The value of --max-memory, in bytes. `reader` and `given` are those of `Arguments`.
pub fn memoryMaxOf(reader: anytype, given: anytype) error{UsageInvalid}!u64 {
    return bytesOf(given.value) orelse reader.bad(given, "a size such as 512M or 2G");
}

/// The value of --max-time, in seconds.
pub fn timeMaxOf(reader: anytype, given: anytype) error{UsageInvalid}!f32 {
    const range = settings.time_max_s;
    return numberWithin(given.value, range) orelse
        reader.bad(given, std.fmt.comptimePrint("{d} to {d} seconds", .{ range.min, range.max }));
}

/// The value of --max-triangles and others that limit a number.
pub fn countMaxOf(reader: anytype, given: anytype) error{UsageInvalid}!u64 {
    return countOf(given.value) orelse
        reader.bad(given, "a number above 0 such as 500000 or 5M");
}

/// Names with commas between them.
pub fn layersOf(text: []const u8) ?std.EnumSet(settings.Layer) {
    var layers: std.EnumSet(settings.Layer) = .empty;
    var names = std.mem.splitScalar(u8, text, ',');
    while (names.next()) |name|
        layers.insert(std.meta.stringToEnum(settings.Layer, name) orelse return null);
    return layers;
}

/// A number from `range.min` to `range.max`.
pub fn numberWithin(text: []const u8, range: anytype) ?f32 {
    const number = numberOf(text) orelse return null;
    return if (number >= range.min and number <= range.max) number else null;
}

/// A finite decimal number; a denormal one is zero, as everywhere in the renderer.
pub fn numberOf(text: []const u8) ?f32 {
    for (text) |byte| switch (byte) {
        '0'...'9', '+', '-', '.', 'e', 'E' => {},
        else => return null, // The parser knows "nan", "inf", "0x" and "_" besides.
    };
    const value = std.fmt.parseFloat(f32, text) catch return null;
    if (!std.math.isFinite(value)) return null;
    return if (@abs(value) < std.math.floatMin(f32)) 0 else value;
}

/// A number of 0 or more.
pub fn radiance(text: []const u8) ?f32 {
    const value = numberOf(text) orelse return null;
    return if (value >= 0) value else null;
}

/// Width and height, within the limits.
pub fn resolutionOf(text: []const u8) ?[2]u32 {
    const at = std.mem.findAny(u8, text, "xX") orelse return null;
    const width = integer(text[0..at], settings.side) orelse return null;
    const height = integer(text[at + 1 ..], settings.side) orelse return null;
    if (@as(u64, width) * height > settings.pixel_count_max) return null;
    return .{ width, height };
}

/// `X,Y,Z`.
pub fn vectorOf(text: []const u8) ?[3]f32 {
    var vector: [3]f32 = undefined;
    var parts = std.mem.splitScalar(u8, text, ',');
    for (&vector) |*component| component.* = numberOf(parts.next() orelse return null) orelse
        return null;
    return if (parts.next() == null) vector else null;
}

/// `X,Y,Z`, not zero.
pub fn directionOf(text: []const u8) ?[3]f32 {
    const vector = vectorOf(text) orelse return null;
    return if (std.mem.eql(f32, &vector, &.{ 0, 0, 0 })) null else vector;
}

/// `THETA,PHI[,RADIUS]`.
pub fn orbitOf(text: []const u8) ?settings.Orbit {
    var parts = std.mem.splitScalar(u8, text, ',');
    var orbit: settings.Orbit = .{
        .theta_degrees = numberOf(parts.next().?) orelse return null,
        .phi_degrees = numberOf(parts.next() orelse return null) orelse return null,
    };
    if (!(orbit.phi_degrees >= 0 and orbit.phi_degrees <= 180)) return null;
    const radius = parts.next() orelse return orbit;
    if (parts.next() != null) return null;
    if (std.mem.cutSuffix(u8, radius, "%")) |percent| {
        orbit.radius = .{ .share = (numberOf(percent) orelse return null) / 100 };
    } else orbit.radius = .{ .metres = numberOf(radius) orelse return null };
    return switch (orbit.radius) {
        inline else => |value| if (value > 0) orbit else null,
    };
}

/// The side of a tile.
pub fn tileSizeOf(text: []const u8) ?u32 {
    const size = integer(text, settings.tile_size) orelse return null;
    return if (size % settings.tile_size_step == 0) size else null;
}

/// `auto`, an index or a name.
pub fn cameraOf(text: []const u8) ?settings.Camera {
    if (text.len == 0) return null;
    if (std.mem.eql(u8, text, "auto")) return .auto;
    const index = integer(text, any_index) orelse return .{ .name = text };
    return .{ .index = index };
}

/// By its index or its name; null: it is empty.
pub fn choiceOf(text: []const u8) ?settings.Choice {
    if (text.len == 0) return null;
    const index = integer(text, any_index) orelse return .{ .name = text };
    return .{ .index = index };
}

/// `all`, an index or a name.
pub fn animationOf(text: []const u8) ?settings.Animation.Which {
    if (std.mem.eql(u8, text, "all")) return .all;
    return switch (choiceOf(text) orelse return null) {
        .default => unreachable, // Nothing spells it.
        .index => |index| .{ .index = index },
        .name => |name| .{ .name = name },
    };
}

const any_index: settings.Range = .{ .min = 0, .max = std.math.maxInt(u32) };

/// A word, a colour of CSS or radiance.
pub fn backgroundOf(text: []const u8) ?settings.Background {
    if (std.mem.eql(u8, text, "transparent")) return .transparent;
    if (std.mem.eql(u8, text, "env")) return .env;
    if (std.mem.eql(u8, text, "studio")) return .studio;
    if (std.mem.cutPrefix(u8, text, "#")) |digits|
        return .{ .srgb = colors.hexadecimal(digits) orelse return null };
    if (colors.named(text)) |codes| return .{ .srgb = codes };
    var color: [3]f32 = undefined;
    var parts = std.mem.splitScalar(u8, text, ',');
    for (&color) |*component| {
        component.* = radiance(parts.next() orelse return null) orelse return null;
    }
    return if (parts.next() == null) .{ .linear = color } else null;
}

/// A word or the name of a file.
pub fn environmentOf(text: []const u8) ?settings.Environment.Source {
    if (text.len == 0) return null;
    if (std.mem.eql(u8, text, "none")) return .none;
    return if (std.mem.eql(u8, text, "studio")) .studio else .{ .file = text };
}

/// Degrees.
pub fn rotationOf(text: []const u8) ?f32 {
    const value = numberOf(text) orelse return null;
    return if (@abs(value) <= 3600) value else null;
}

/// Stops, or `auto`.
pub fn exposureOf(text: []const u8) ?settings.Exposure {
    if (std.mem.eql(u8, text, "auto")) return .auto;
    const ev = numberOf(text) orelse return null;
    return if (@abs(ev) <= settings.exposure_ev_max) .{ .ev = ev } else null;
}
