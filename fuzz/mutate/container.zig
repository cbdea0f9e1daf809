//! Changes of files that consist of parts: GLB, PNG, JPEG, RIFF (WebP) and OpenEXR.
//!
//! A file is split into its parts; one is changed by what its kind allows, or dropped, doubled,
//! moved, or put in from another file; then they are joined with lengths, checksums and offsets
//! that fit. What no longer splits is changed as bytes.

const std = @import("std");
const Allocator = std.mem.Allocator;
const Mutator = @import("../mutate.zig").Mutator;
const json = @import("json.zig");

/// The kinds of files, by what is changed of them.
pub const Kind = enum { glb, glb_numbers, png, jpeg, riff, exr };

/// A part: what names it, and what it holds. Bytes between parts have no name.
const Part = struct { tag: []const u8, body: []const u8 };

const png_signature = "\x89PNG\r\n\x1a\n";
const glb_magic = "glTF";
const exr_magic = "\x76\x2f\x31\x01";
const json_tag = "JSON";

/// Changes one thing.
pub fn change(
    kind: Kind,
    mutator: *const Mutator,
    input: []const u8,
) Allocator.Error![]const u8 {
    const arena = mutator.arena;
    const found = try split(kind, arena, input) orelse return mutator.changeBytes(input);
    if (found.len == 0) return mutator.changeBytes(input);
    var parts: std.ArrayList(Part) = .empty;
    try parts.appendSlice(arena, found);
    const index = mutator.below(parts.items.len);
    if (kind == .glb_numbers) {
        parts.items[index].body = try changeBody(kind, mutator, parts.items[index]);
        return join(kind, arena, parts.items);
    }
    switch (mutator.below(12)) {
        0 => _ = parts.orderedRemove(index),
        1 => try parts.insert(arena, index, parts.items[index]),
        2 => {
            const other = &parts.items[mutator.below(parts.items.len)];
            std.mem.swap(Part, &parts.items[index], other);
        },
        3, 4 => {
            const other = try split(kind, arena, mutator.anyOther()) orelse return input;
            if (other.len == 0) return input;
            const taken = other[mutator.below(other.len)];
            if (mutator.random.boolean())
                try parts.insert(arena, index, taken)
            else
                parts.items[index] = taken;
        },
        5 => parts.items[index].tag = try mutator.changeBytes(parts.items[index].tag),
        else => parts.items[index].body = try changeBody(kind, mutator, parts.items[index]),
    }
    return join(kind, arena, parts.items);
}

fn changeBody(kind: Kind, mutator: *const Mutator, part: Part) Allocator.Error![]const u8 {
    switch (kind) {
        .glb => if (std.mem.eql(u8, part.tag, json_tag)) return json.change(mutator, part.body),
        .glb_numbers => if (std.mem.eql(u8, part.tag, json_tag))
            return json.changeNumber(mutator, part.body),
        .png => if (std.mem.eql(u8, part.tag, "IDAT") and mutator.random.boolean()) {
            const raw = try inflated(mutator.arena, part.body) orelse
                return mutator.changeBytes(part.body);
            return stored(mutator.arena, try mutator.changeBytes(raw));
        },
        .jpeg, .riff, .exr => {},
    }
    return mutator.changeBytes(part.body);
}

/// Null: it is no file of that kind.
fn split(kind: Kind, arena: Allocator, input: []const u8) Allocator.Error!?[]const Part {
    return switch (kind) {
        .glb, .glb_numbers => splitGlb(arena, input),
        .png => splitPng(arena, input),
        .jpeg => splitJpeg(arena, input),
        .riff => splitRiff(arena, input),
        .exr => splitExr(arena, input),
    };
}

fn join(kind: Kind, arena: Allocator, parts: []const Part) Allocator.Error![]const u8 {
    var out: std.ArrayList(u8) = .empty;
    switch (kind) {
        .glb, .glb_numbers => try joinGlb(arena, &out, parts),
        .png => try joinPng(arena, &out, parts),
        .jpeg => try joinJpeg(arena, &out, parts),
        .riff => try joinRiff(arena, &out, parts),
        .exr => try joinExr(arena, &out, parts),
    }
    return out.items;
}

/// glTF 2.0, section 4.4: chunks of a length, a type and bytes.
fn splitGlb(arena: Allocator, input: []const u8) Allocator.Error!?[]const Part {
    if (input.len < 12 or !std.mem.startsWith(u8, input, glb_magic)) return null;
    var parts: std.ArrayList(Part) = .empty;
    var rest = input[12..];
    while (rest.len >= 8) {
        const length = @min(std.mem.readInt(u32, rest[0..4], .little), rest.len - 8);
        try parts.append(arena, .{ .tag = rest[4..8], .body = rest[8..][0..length] });
        rest = rest[8 + length ..];
    }
    return parts.items;
}

fn joinGlb(
    arena: Allocator,
    out: *std.ArrayList(u8),
    parts: []const Part,
) Allocator.Error!void {
    try out.appendSlice(arena, glb_magic ++ "\x02\x00\x00\x00\x00\x00\x00\x00");
    for (parts) |part| {
        const is_json = std.mem.eql(u8, part.tag, json_tag);
        const length = std.mem.alignForward(usize, part.body.len, 4);
        try appendInt(arena, out, u32, length, .little);
        try appendTag(arena, out, part.tag, 4);
        try out.appendSlice(arena, part.body);
        try out.appendNTimes(arena, if (is_json) ' ' else 0, length - part.body.len);
    }
    std.mem.writeInt(u32, out.items[8..12], @intCast(out.items.len), .little);
}

/// PNG (third edition), section 5: chunks of a length, a type, bytes and a checksum.
fn splitPng(arena: Allocator, input: []const u8) Allocator.Error!?[]const Part {
    if (!std.mem.startsWith(u8, input, png_signature)) return null;
    var parts: std.ArrayList(Part) = .empty;
    var rest = input[png_signature.len..];
    while (rest.len >= 12) {
        const length = @min(std.mem.readInt(u32, rest[0..4], .big), rest.len - 12);
        try parts.append(arena, .{ .tag = rest[4..8], .body = rest[8..][0..length] });
        rest = rest[12 + length ..];
    }
    return parts.items;
}

fn joinPng(
    arena: Allocator,
    out: *std.ArrayList(u8),
    parts: []const Part,
) Allocator.Error!void {
    try out.appendSlice(arena, png_signature);
    for (parts) |part| {
        try appendInt(arena, out, u32, part.body.len, .big);
        const start = out.items.len;
        try appendTag(arena, out, part.tag, 4);
        try out.appendSlice(arena, part.body);
        const checksum = std.hash.Crc32.hash(out.items[start..]);
        try appendInt(arena, out, u32, checksum, .big);
    }
}

/// What a stream of zlib holds; null where it is none.
fn inflated(arena: Allocator, stream: []const u8) Allocator.Error!?[]const u8 {
    var reader: std.Io.Reader = .fixed(stream);
    var decompress: std.compress.flate.Decompress = .init(&reader, .zlib, &.{});
    var out: std.Io.Writer.Allocating = .init(arena);
    _ = decompress.reader.streamRemaining(&out.writer) catch return null;
    return out.written();
}

/// A stream of zlib without compression (RFC 1951, section 3.2.4).
fn stored(arena: Allocator, raw: []const u8) Allocator.Error![]const u8 {
    var out: std.ArrayList(u8) = .empty;
    try out.appendSlice(arena, "\x78\x01");
    var rest = raw;
    while (true) {
        const length: u16 = @intCast(@min(rest.len, std.math.maxInt(u16)));
        const is_last = length == rest.len;
        try out.append(arena, @intFromBool(is_last));
        try appendInt(arena, &out, u16, length, .little);
        try appendInt(arena, &out, u16, ~length, .little);
        try out.appendSlice(arena, rest[0..length]);
        rest = rest[length..];
        if (is_last) break;
    }
    try appendInt(arena, &out, u32, std.hash.Adler32.hash(raw), .big);
    return out.items;
}

/// ITU-T T.81, annex B: markers, most with a length, and data between them that has no name.
fn splitJpeg(arena: Allocator, input: []const u8) Allocator.Error!?[]const Part {
    if (!std.mem.startsWith(u8, input, "\xff\xd8")) return null;
    var parts: std.ArrayList(Part) = .empty;
    var rest = input[2..];
    while (rest.len > 0) {
        if (rest.len >= 4 and rest[0] == 0xff and hasLength(rest[1])) {
            const length = @min(@max(std.mem.readInt(u16, rest[2..4], .big), 2), rest.len - 2);
            try parts.append(arena, .{ .tag = rest[0..2], .body = rest[4 .. 2 + length] });
            rest = rest[2 + length ..];
            continue;
        }
        var end: usize = 1;
        while (end + 1 < rest.len and !(rest[end] == 0xff and hasLength(rest[end + 1]))) end += 1;
        if (end + 1 >= rest.len) end = rest.len;
        try parts.append(arena, .{ .tag = "", .body = rest[0..end] });
        rest = rest[end..];
    }
    return parts.items;
}

/// Neither an escaped byte nor a marker that stands alone.
fn hasLength(marker: u8) bool {
    return marker >= 0xc0 and marker != 0xff and !(marker >= 0xd0 and marker <= 0xd9);
}

fn joinJpeg(
    arena: Allocator,
    out: *std.ArrayList(u8),
    parts: []const Part,
) Allocator.Error!void {
    try out.appendSlice(arena, "\xff\xd8");
    for (parts) |part| {
        if (part.tag.len > 0) {
            try appendTag(arena, out, part.tag, 2);
            try appendInt(arena, out, u16, @min(part.body.len + 2, 0xffff), .big);
        }
        try out.appendSlice(arena, part.body);
    }
}

/// WebP container specification: chunks of a type, a length and bytes, padded to even lengths.
fn splitRiff(arena: Allocator, input: []const u8) Allocator.Error!?[]const Part {
    if (input.len < 12 or !std.mem.startsWith(u8, input, "RIFF")) return null;
    var parts: std.ArrayList(Part) = .empty;
    var rest = input[12..];
    while (rest.len >= 8) {
        const length = @min(std.mem.readInt(u32, rest[4..8], .little), rest.len - 8);
        try parts.append(arena, .{ .tag = rest[0..4], .body = rest[8..][0..length] });
        rest = rest[@min(rest.len, 8 + length + length % 2)..];
    }
    return parts.items;
}

fn joinRiff(
    arena: Allocator,
    out: *std.ArrayList(u8),
    parts: []const Part,
) Allocator.Error!void {
    try out.appendSlice(arena, "RIFF\x00\x00\x00\x00WEBP");
    for (parts) |part| {
        try appendTag(arena, out, part.tag, 4);
        try appendInt(arena, out, u32, part.body.len, .little);
        try out.appendSlice(arena, part.body);
        if (part.body.len % 2 == 1) try out.append(arena, 0);
    }
    std.mem.writeInt(u32, out.items[4..8], @intCast(out.items.len - 8), .little);
}

/// The header of a file with one part: attributes of a name, a type, a length and bytes up to an
/// empty name. What follows is a table of offsets, and the chunks; it is the last part.
fn splitExr(arena: Allocator, input: []const u8) Allocator.Error!?[]const Part {
    if (input.len < 9 or !std.mem.startsWith(u8, input, exr_magic)) return null;
    var parts: std.ArrayList(Part) = .empty;
    try parts.append(arena, .{ .tag = "", .body = input[4..8] });
    var at: usize = 8;
    while (at < input.len and input[at] != 0) {
        const name_end = std.mem.findScalarPos(u8, input, at, 0) orelse return null;
        const type_end = std.mem.findScalarPos(u8, input, name_end + 1, 0) orelse return null;
        const start = type_end + 5;
        if (start > input.len) return null;
        const length = std.mem.readInt(u32, input[type_end + 1 ..][0..4], .little);
        const end = @min(input.len, start + @as(usize, length));
        try parts.append(arena, .{ .tag = input[at .. type_end + 1], .body = input[start..end] });
        at = end;
    }
    // Offsets are counted from here on while the file is in parts.
    const tail = try arena.dupe(u8, input[@min(input.len, at + 1)..]);
    moveOffsets(tail, at + 1, .from_file);
    try parts.append(arena, .{ .tag = "", .body = tail });
    return parts.items;
}

fn joinExr(
    arena: Allocator,
    out: *std.ArrayList(u8),
    parts: []const Part,
) Allocator.Error!void {
    try out.appendSlice(arena, exr_magic);
    for (parts, 0..) |part, index| {
        const is_tail = index > 0 and part.tag.len == 0;
        if (is_tail) {
            try out.append(arena, 0);
            const start = out.items.len;
            try out.appendSlice(arena, part.body);
            moveOffsets(out.items[start..], start, .to_file);
            continue;
        }
        try out.appendSlice(arena, part.tag);
        if (part.tag.len > 0) try appendInt(arena, out, u32, part.body.len, .little);
        try out.appendSlice(arena, part.body);
    }
}

/// Counts the offsets of the table that `tail` begins with from its own beginning, which is at
/// `start` of the file, or back from the file's. The first chunk follows the table.
fn moveOffsets(tail: []u8, start: usize, direction: enum { from_file, to_file }) void {
    if (tail.len < 8) return;
    const first = std.mem.readInt(u64, tail[0..8], .little);
    const table_bytes = if (direction == .from_file) first -% start else first;
    if (table_bytes > tail.len) return;
    var at: usize = 0;
    while (at + 8 <= table_bytes) : (at += 8) {
        const offset = std.mem.readInt(u64, tail[at..][0..8], .little);
        const moved = if (direction == .from_file) offset -% start else offset +% start;
        std.mem.writeInt(u64, tail[at..][0..8], moved, .little);
    }
}

fn appendInt(
    arena: Allocator,
    out: *std.ArrayList(u8),
    comptime Int: type,
    value: anytype,
    endian: std.lang.Endian,
) Allocator.Error!void {
    var bytes: [@sizeOf(Int)]u8 = undefined;
    std.mem.writeInt(Int, &bytes, @truncate(value), endian);
    try out.appendSlice(arena, &bytes);
}

/// As many bytes as a tag has.
fn appendTag(
    arena: Allocator,
    out: *std.ArrayList(u8),
    tag: []const u8,
    length: usize,
) Allocator.Error!void {
    const kept = @min(tag.len, length);
    try out.appendSlice(arena, tag[0..kept]);
    try out.appendNTimes(arena, 'x', length - kept);
}
