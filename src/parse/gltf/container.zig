//! The two wrappings of glTF: plain JSON, and GLB's header and chunks.
//!
//! In: the bytes of the file. Out: where its JSON text and its binary chunk lie (glTF 2.0, section
//! 4.4). Every length is compared with the bytes that are there.

const std = @import("std");
const limits = @import("limits.zig");
const Diagnostic = @import("../../diagnostic.zig").Diagnostic;

/// The parts of a file.
pub const Container = struct {
    json: []const u8,
    /// The GLB's BIN chunk.
    binary: ?[]const u8,
};

const header_bytes = 12;
const chunk_header_bytes = 8;
/// What a GLB begins with.
pub const magic = "glTF";
const json_type = 0x4E4F534A;
const binary_type = 0x004E4942;

/// Finds the parts of a glTF file.
pub fn open(bytes: []const u8, diagnostic: *Diagnostic) error{InvalidInput}!Container {
    if (bytes.len == 0) return diagnostic.invalid("the file is empty", .{});
    const container: Container = if (std.mem.startsWith(u8, bytes, magic))
        try openBinary(bytes, diagnostic)
    else
        .{ .json = bytes, .binary = null };
    const json = skipMark(container.json, diagnostic);
    if (json.len > limits.json_bytes_max) return diagnostic.invalid(
        "{d} bytes of JSON are over the limit of {d}",
        .{ json.len, limits.json_bytes_max },
    );
    return .{ .json = json, .binary = container.binary };
}

fn openBinary(bytes: []const u8, diagnostic: *Diagnostic) error{InvalidInput}!Container {
    if (bytes.len < header_bytes + chunk_header_bytes)
        return diagnostic.invalid("GLB of {d} bytes is cut short", .{bytes.len});
    const version = readU32(bytes, 4);
    if (version != 2)
        return diagnostic.invalid("GLB version {d} is not supported, only 2", .{version});
    const length = readU32(bytes, 8);
    if (length > bytes.len)
        return diagnostic.invalid("GLB is cut short: {d} bytes of {d}", .{ bytes.len, length });
    if (length < bytes.len) diagnostic.warn(
        "{d} bytes behind the end of the GLB are ignored",
        .{bytes.len - length},
    );
    return readChunks(bytes[0..length], diagnostic);
}

fn readChunks(bytes: []const u8, diagnostic: *Diagnostic) error{InvalidInput}!Container {
    var json: ?[]const u8 = null;
    var binary: ?[]const u8 = null;
    var offset: usize = header_bytes;
    var index: usize = 0;
    while (offset < bytes.len) : (index += 1) {
        const left = bytes.len - offset;
        if (left < chunk_header_bytes) return diagnostic.invalid(
            "GLB chunk {d}: {d} bytes are no chunk header",
            .{ index, left },
        );
        const length = readU32(bytes, offset);
        const kind = readU32(bytes, offset + 4);
        offset += chunk_header_bytes;
        if (length > bytes.len - offset) return diagnostic.invalid(
            "GLB chunk {d}: {d} bytes past the end",
            .{ index, length - (bytes.len - offset) },
        );
        if (length % 4 != 0) return diagnostic.invalid(
            "GLB chunk {d}: length {d} is no multiple of 4",
            .{ index, length },
        );
        const content = bytes[offset..][0..length];
        offset += length;
        if (index == 0 and kind != json_type) break;
        if (index == 0) json = skipPadding(content, diagnostic);
        // Further chunks of a kind that is not known have to be passed over.
        if (kind == binary_type and binary == null) binary = content;
    }
    return .{
        .json = json orelse return diagnostic.invalid("GLB does not begin with a JSON chunk", .{}),
        .binary = binary,
    };
}

/// Leaves out a byte order mark, which JSON forbids but files have.
fn skipMark(json: []const u8, diagnostic: *Diagnostic) []const u8 {
    const mark = "\xef\xbb\xbf";
    if (!std.mem.startsWith(u8, json, mark)) return json;
    diagnostic.warn("the JSON text begins with a byte order mark, ignored", .{});
    return json[mark.len..];
}

/// Leaves out zero bytes where the specification wants spaces.
fn skipPadding(json: []const u8, diagnostic: *Diagnostic) []const u8 {
    const trimmed = std.mem.trimEnd(u8, json, "\x00");
    if (trimmed.len < json.len) {
        diagnostic.warn("the JSON chunk is padded with zero bytes instead of spaces", .{});
    }
    return trimmed;
}

fn readU32(bytes: []const u8, offset: usize) u32 {
    return std.mem.readInt(u32, bytes[offset..][0..4], .little);
}

test "lengths and kinds of chunks" {
    const header = "glTF\x02\x00\x00\x00";
    const chunk = "\x04\x00\x00\x00JSON{}  ";
    const good = [_][]const u8{
        header ++ "\x18\x00\x00\x00" ++ chunk,
        header ++ "\x20\x00\x00\x00" ++ chunk ++ "\x00\x00\x00\x00BIN\x00",
        header ++ "\x24\x00\x00\x00" ++ chunk ++ "\x04\x00\x00\x00what1234",
    };
    for (good, [_]bool{ false, true, false }) |bytes, has_binary| {
        var diagnostic: Diagnostic = .{};
        const container = try open(bytes, &diagnostic);
        try std.testing.expectEqualStrings("{}  ", container.json);
        try std.testing.expectEqual(has_binary, container.binary != null);
        try std.testing.expectEqual(0, diagnostic.warning_count);
    }
    const bad = [_][]const u8{
        "",
        "glTF",
        header ++ "\x00\x00\x00\x00" ++ chunk,
        header ++ "\x13\x00\x00\x00" ++ chunk,
        header ++ "\x19\x00\x00\x00" ++ chunk ++ " ",
        header ++ "\x18\x00\x00\x00" ++ "\x04\x00\x00\x00BIN\x00{}  ",
        header ++ "\x18\x00\x00\x00" ++ "\x08\x00\x00\x00JSON{}  ",
        header ++ "\x18\x00\x00\x00" ++ "\x03\x00\x00\x00JSON{}  ",
    };
    for (bad) |bytes| {
        var diagnostic: Diagnostic = .{};
        try std.testing.expectError(error.InvalidInput, open(bytes, &diagnostic));
        try std.testing.expect(diagnostic.message.text().len > 0);
    }
}

test "marks and padding are left out with a warning" {
    var diagnostic: Diagnostic = .{};
    const text = try open("\xef\xbb\xbf{}", &diagnostic);
    try std.testing.expectEqualStrings("{}", text.json);
    const padded = "glTF\x02\x00\x00\x00\x18\x00\x00\x00\x04\x00\x00\x00JSON{}\x00\x00";
    const binary = try open(padded, &diagnostic);
    try std.testing.expectEqualStrings("{}", binary.json);
    try std.testing.expectEqual(2, diagnostic.warning_count);
}
