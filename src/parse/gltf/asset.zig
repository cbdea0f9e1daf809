//! Version and extensions of a document: whether this reader may read it at all.
//!
//! In: `asset`, `extensionsRequired` and `extensionsUsed` (glTF 2.0, sections 3.2 and 3.12). Out:
//! an error that names what is required and not supported, unless it is to be drawn by force, and
//! one warning that names whatever else the picture will lack.

const std = @import("std");
const c = @import("../cgltf.zig");
const diagnostic = @import("../../diagnostic.zig");
const extensions = @import("extensions.zig");
const Source = @import("source.zig");
const Error = Source.Error;

/// Names of extensions in one warning.
const named_count_max = 6;

/// Checks the version and the required extensions. What can be drawn without force is: then it has
/// no effect.
pub fn check(source: *Source) Error!void {
    const data = source.data;
    const version = try parseVersion(source, "version", data.asset.version);
    const wanted = if (data.asset.min_version == null)
        version
    else
        try parseVersion(source, "minVersion", data.asset.min_version);
    // Later minor versions have to be readable as 2.0 unless the file says otherwise.
    const too_new = data.asset.min_version != null and wanted.minor > 0;
    if (version.major != 2 or wanted.major != 2 or too_new) return source.fail(
        "glTF {d}.{d} is not supported, only 2.0",
        .{ wanted.major, wanted.minor },
    );
    for (Source.slice(data.extensions_required, data.extensions_required_count)) |raw| {
        const name = std.mem.span(@as([*:0]const u8, raw));
        var lack: []const u8 = "is not supported (see --force)";
        if (extensions.find(name)) |known| {
            if (known.mayBeRequired()) continue;
            if (known.lack == .other_meshes) lack = known.remark;
        }
        source.builder.scene.file.needs_force = true;
        if (source.force) continue;
        return source.fail("the required extension {f} {s}", .{ diagnostic.quote(name), lack });
    }
    if (!source.builder.scene.file.needs_force) source.force = false;
    const required = Source.slice(data.extensions_required, data.extensions_required_count);
    const used = Source.slice(data.extensions_used, data.extensions_used_count);
    warnOf(source, &.{required}, isForced, "not supported, and yet required: the extensions ");
    warnOf(source, &.{required}, isIdle, "without a part in the picture: the required extensions ");
    warnOf(source, &.{ required, used }, isMissed, "not rendered: the extensions ");
}

/// Required, and drawn all the same.
fn isForced(source: *const Source, name: []const u8) bool {
    if (!source.force) return false;
    if (extensions.find(name)) |known| if (known.mayBeRequired()) return false;
    const data = source.data;
    return isListed(data.extensions_required, data.extensions_required_count, name);
}

fn isIdle(source: *const Source, name: []const u8) bool {
    _ = source;
    const extension = extensions.find(name) orelse return false;
    return extension.treatment == .ignored and extension.lack == .nothing;
}

fn isMissed(source: *const Source, name: []const u8) bool {
    if (isForced(source, name)) return false; // It has been said.
    return if (extensions.find(name)) |known| known.isMissed() else true;
}

/// Names the extensions of the lists that are like that in one warning.
fn warnOf(
    source: *const Source,
    lists: []const []const [*c]u8,
    isOne: *const fn (*const Source, []const u8) bool,
    comptime what: []const u8,
) void {
    var names: [named_count_max][]const u8 = undefined;
    var count: usize = 0;
    for (lists) |list| for (list) |raw| {
        const name = std.mem.span(@as([*:0]const u8, raw));
        if (!isOne(source, name)) continue;
        if (contains(names[0..@min(count, names.len)], name)) continue;
        if (count < names.len) names[count] = name;
        count += 1;
    };
    if (count == 0) return;
    var buffer: [names.len * 96]u8 = undefined;
    var writer: std.Io.Writer = .fixed(&buffer);
    for (names[0..@min(count, names.len)], 0..) |name, index| {
        // A name takes 88 bytes at most.
        if (index > 0) writer.writeAll(", ") catch unreachable;
        writer.print("{f}", .{diagnostic.quote(name)}) catch unreachable;
    }
    const more = if (count > names.len) " and others" else "";
    source.warn(what ++ "{s}{s}", .{ writer.buffered(), more });
}

/// Whether the file says that it uses the extension.
pub fn uses(source: *const Source, extension: []const u8) bool {
    const data = source.data;
    return isListed(data.extensions_used, data.extensions_used_count, extension);
}

fn isListed(list: [*c]const [*c]u8, count: usize, name: []const u8) bool {
    for (Source.slice(list, count)) |raw| {
        if (std.mem.eql(u8, name, std.mem.span(@as([*:0]const u8, raw)))) return true;
    }
    return false;
}

fn contains(list: []const []const u8, name: []const u8) bool {
    for (list) |known| if (std.mem.eql(u8, known, name)) return true;
    return false;
}

const Version = struct { major: u32, minor: u32 };

fn parseVersion(source: *const Source, key: []const u8, raw: [*c]const u8) Error!Version {
    const text = std.mem.span(@as([*:0]const u8, raw));
    if (parseDigits(text)) |major| if (text.len > 0) {
        source.forgive("asset.{s}: {f} is taken as {d}.0", .{ key, diagnostic.quote(text), major });
        return .{ .major = major, .minor = 0 };
    };
    return splitVersion(text) orelse source.fail("asset.{s}: {f} is not a version", .{
        key, diagnostic.quote(text),
    });
}

fn splitVersion(text: []const u8) ?Version {
    const dot = std.mem.findScalar(u8, text, '.') orelse return null;
    return .{
        .major = parseDigits(text[0..dot]) orelse return null,
        .minor = parseDigits(text[dot + 1 ..]) orelse return null,
    };
}

fn parseDigits(text: []const u8) ?u32 {
    for (text) |byte| if (!std.ascii.isDigit(byte)) return null;
    return std.fmt.parseInt(u32, text, 10) catch null;
}

test splitVersion {
    try std.testing.expectEqual(Version{ .major = 2, .minor = 0 }, splitVersion("2.0").?);
    const bad = [_][]const u8{ "", "2", ".", "2.", ".0", "2.0.1", "+2.0", "2.x", "99999999999.0" };
    for (bad) |text| try std.testing.expectEqual(null, splitVersion(text));
}
