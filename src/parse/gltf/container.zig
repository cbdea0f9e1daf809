//! The two wrappings of glTF: plain JSON, and GLB's header and chunks.
//!
//! In: the bytes of the file. Out: where its JSON text and its binary chunk lie (glTF 2.0, section
//! 4.4). Every length is compared with the bytes that are there.

const std = @import("std");
const limits = @import("limits.zig");
const Diagnostic = @import("../../diagnostic.zig").Diagnostic;
const markBytes = @import("../format.zig").markBytes;

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
    // Streams are written before their length is known: some have 0 there, or all bits.
    const is_unknown = length == 0 or length == std.math.maxInt(u32);
    const declared = if (is_unknown) bytes.len else length;
    if (declared > bytes.len)
        return diagnostic.invalid("GLB is cut short: {d} bytes of {d}", .{ bytes.len, length });
    const chunks = try readChunks(bytes, declared, diagnostic);
    if (is_unknown or chunks.end > declared) diagnostic.forgive(
        "the GLB's chunks end at {d} bytes, its header says {d}",
        .{ chunks.end, length },
    );
    const end = @max(declared, chunks.end);
    if (end < bytes.len) diagnostic.forgive(
        "{d} bytes behind the end of the GLB are ignored",
        .{bytes.len - end},
    );
    return chunks.container;
}

const Chunks = struct {
    container: Container,
    /// Of the last one that is known.
    end: usize,
};

/// Reads the chunks that begin before `declared`, the length that the header gives.
fn readChunks(
    bytes: []const u8,
    declared: usize,
    diagnostic: *Diagnostic,
) error{InvalidInput}!Chunks {
    var json: ?[]const u8 = null;
    var binary: ?[]const u8 = null;
    var offset: usize = header_bytes;
    var end = offset;
    var index: usize = 0;
    while (offset < declared) : (index += 1) {
        const left = bytes.len - offset;
        const length = if (left < chunk_header_bytes) left else readU32(bytes, offset);
        const kind = if (left < chunk_header_bytes) 0 else readU32(bytes, offset + 4);
        const is_known = kind == json_type or kind == binary_type;
        const is_whole = left >= chunk_header_bytes and length <= left - chunk_header_bytes;
        if (!is_whole and index > 0 and !is_known) {
            diagnostic.forgive("{d} bytes behind the last chunk of the GLB are ignored", .{
                declared - offset,
            });
            break;
        }
        offset += chunk_header_bytes;
        if (!is_whole) return diagnostic.invalid(
            "GLB chunk {d}: {d} bytes past the end",
            .{ index, length - (bytes.len - offset) },
        );
        const content = bytes[offset..][0..length];
        end = offset + length;
        offset = try nextChunk(bytes, end, length, index, diagnostic);
        if (index == 0 and kind != json_type) break;
        if (index == 0) json = skipPadding(content, diagnostic);
        // Further chunks of a kind that is not known have to be passed over.
        if (kind == binary_type and binary == null) binary = content;
    }
    return .{ .end = end, .container = .{
        .json = json orelse return diagnostic.invalid("GLB does not begin with a JSON chunk", .{}),
        .binary = binary,
    } };
}

/// Where the chunk behind one that ends at `end` begins. Lengths are multiples of 4, but there are
/// writers that leave out the padding, and others that do not count it.
fn nextChunk(
    bytes: []const u8,
    end: usize,
    length: usize,
    index: usize,
    diagnostic: *Diagnostic,
) error{InvalidInput}!usize {
    if (length % 4 == 0) return end;
    const padded = std.mem.alignForward(usize, end, 4);
    const next = if (isChunk(bytes, padded))
        padded
    else if (isChunk(bytes, end))
        end
    else if (bytes.len - end < chunk_header_bytes)
        bytes.len
    else
        return diagnostic.invalid("GLB chunk {d}: length {d} is no multiple of 4", .{
            index, length,
        });
    diagnostic.forgive("GLB chunk {d}: length {d} is no multiple of 4", .{ index, length });
    return next;
}

/// Whether a chunk of a known kind begins at `offset`, and ends within the file.
fn isChunk(bytes: []const u8, offset: usize) bool {
    if (offset > bytes.len or bytes.len - offset < chunk_header_bytes) return false;
    const kind = readU32(bytes, offset + 4);
    if (kind != json_type and kind != binary_type) return false;
    return readU32(bytes, offset) <= bytes.len - offset - chunk_header_bytes;
}

/// Leaves out a byte order mark, which JSON forbids but files have.
fn skipMark(json: []const u8, diagnostic: *Diagnostic) []const u8 {
    const mark_bytes = markBytes(json);
    if (mark_bytes == 0) return json;
    diagnostic.forgive("the JSON text begins with a byte order mark, ignored", .{});
    return json[mark_bytes..];
}

/// Leaves out zero bytes where the specification wants spaces.
fn skipPadding(json: []const u8, diagnostic: *Diagnostic) []const u8 {
    const trimmed = std.mem.trimEnd(u8, json, "\x00");
    if (trimmed.len < json.len) diagnostic.forgive(
        "the JSON chunk is padded with zero bytes instead of spaces",
        .{},
    );
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
        header ++ "\x1c\x00\x00\x00" ++ chunk,
        header ++ "\x18\x00\x00\x00" ++ "\x04\x00\x00\x00BIN\x00{}  ",
        header ++ "\x18\x00\x00\x00" ++ "\x08\x00\x00\x00JSON{}  ",
        header ++ "\x1f\x00\x00\x00" ++ "\x03\x00\x00\x00JSON{}  1234567",
        header ++ "\x20\x00\x00\x00" ++ chunk ++ "\x01\x00\x00\x00BIN\x00",
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

test "padding that is missing or not counted, and bytes behind the last chunk" {
    const header = "glTF\x02\x00\x00\x00";
    const Case = struct { length: u8, chunks: []const u8, binary: ?[]const u8 };
    for ([_]Case{
        .{
            .length = 34,
            .chunks = "\x02\x00\x00\x00JSON{}\x04\x00\x00\x00BIN\x001234",
            .binary = "1234",
        },
        .{
            .length = 36,
            .chunks = "\x02\x00\x00\x00JSON{}  \x04\x00\x00\x00BIN\x001234",
            .binary = "1234",
        },
        .{
            .length = 35,
            .chunks = "\x04\x00\x00\x00JSON{}  \x03\x00\x00\x00BIN\x00123",
            .binary = "123",
        },
        .{
            .length = 36,
            .chunks = "\x04\x00\x00\x00JSON{}  \x03\x00\x00\x00BIN\x00123\x00",
            .binary = "123",
        },
        .{ .length = 26, .chunks = "\x02\x00\x00\x00JSON{}  \x00\x00", .binary = null },
        .{
            .length = 28,
            .chunks = "\x04\x00\x00\x00JSON{}  \x00\x00\x00\x00",
            .binary = null,
        },
        .{
            .length = 40,
            .chunks = "\x04\x00\x00\x00JSON{}  \xff\xff\xff\xffjunkjunkjunk",
            .binary = null,
        },
        .{ .length = 25, .chunks = "\x04\x00\x00\x00JSON{}   ", .binary = null },
        // Its header says nothing.
        .{ .length = 0, .chunks = "\x04\x00\x00\x00JSON{}  ", .binary = null },
        // It says less than there is.
        .{ .length = 19, .chunks = "\x04\x00\x00\x00JSON{}  ", .binary = null },
        .{
            .length = 35,
            .chunks = "\x04\x00\x00\x00JSON{}  \x04\x00\x00\x00BIN\x001234",
            .binary = "1234",
        },
    }) |case| {
        const parts = [_][]const u8{ header, &.{ case.length, 0, 0, 0 }, case.chunks };
        const bytes = try std.mem.concat(std.testing.allocator, u8, &parts);
        defer std.testing.allocator.free(bytes);
        for ([_]bool{ false, true }) |strict| {
            var diagnostic: Diagnostic = .{ .strict = strict };
            const container = try open(bytes, &diagnostic);
            const json = std.mem.trim(u8, container.json, " ");
            try std.testing.expectEqualStrings("{}", json);
            try std.testing.expectEqual(case.binary == null, container.binary == null);
            if (case.binary) |binary| {
                try std.testing.expectEqualStrings(binary, container.binary.?);
            }
            try std.testing.expectEqual(strict, diagnostic.refusal != null);
            try std.testing.expectEqual(!strict, diagnostic.warning_count > 0);
        }
    }
}
