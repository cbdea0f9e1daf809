//! STL: triangles, each by its three corners, as text or binary.
//!
//! In: the bytes of a file. Out: a scene of one flat mesh, z upwards. Normals are computed from the
//! corners, for those in files are often zero or wrong; vertices are not merged. Colours of binary
//! triangles are read in both of their ways (VisCAM and SolidView; Materialise Magics). What has a
//! corner that is not finite is left out. Format: 3D Systems, "StereoLithography Interface
//! Specification" (1988), and what programs make of it.

const std = @import("std");
const format = @import("format.zig");
const math = @import("../math.zig");
const number = @import("number.zig");
const plain = @import("plain.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Resources = @import("resource.zig");
const scene = @import("../scene.zig");
const Vec3 = math.Vec3;

const header_bytes = format.stl_header_bytes;
const triangle_bytes = format.stl_triangle_bytes;

/// Triangles of a mesh: three vertices each have 32-bit numbers.
const triangle_count_max = std.math.maxInt(u32) / 3;

/// Reads a file that is in memory.
pub fn read(
    resources: *Resources,
    bytes: [:0]const u8,
    diagnostic: *Diagnostic,
) Resources.Error!scene.Scene {
    var builder: scene.Builder = .init(resources.gpa);
    errdefer builder.deinit();
    builder.scene.is_z_up = true;
    builder.scene.file.format = .stl;
    var reader: Reader = .{
        .gpa = resources.gpa,
        .arena = builder.arena(),
        .bytes = bytes,
        .diagnostic = diagnostic,
    };
    defer reader.positions.deinit(reader.gpa);
    var colors: ?[]const [4]f32 = null;
    if (format.isTextStl(bytes)) {
        try reader.readText();
    } else {
        colors = try reader.readBinary();
    }
    if (reader.left_out_count > 0) diagnostic.forgive(
        "{d} triangles with corners that are not finite are left out",
        .{reader.left_out_count},
    );
    const positions = try reader.arena.dupe(Vec3, reader.positions.items);
    const triangles = try reader.arena.alloc([3]u32, positions.len / 3);
    for (triangles, 0..) |*triangle, index| {
        const first: u32 = @intCast(3 * index);
        triangle.* = .{ first, first + 1, first + 2 };
    }
    return plain.finish(&builder, .{
        .positions = positions,
        .colors = colors,
        .triangles = triangles,
        .material = scene.none,
    }, .{}, diagnostic);
}

/// How the last two bytes of a binary triangle colour it, five bits a channel.
const Coloring = union(enum) {
    none,
    /// Bit 15: it has one. Blue is lowest.
    viscam,
    /// Bit 15: it has the whole mesh's, which this is. Red is lowest.
    magics: [4]f32,
};

const Reader = struct {
    gpa: Allocator,
    arena: Allocator,
    bytes: [:0]const u8,
    diagnostic: *Diagnostic,
    /// Three for each triangle.
    positions: std.ArrayList(Vec3) = .empty,
    left_out_count: u64 = 0,

    /// Returns the colours, if any has one.
    fn readBinary(reader: *Reader) Resources.Error!?[]const [4]f32 {
        const bytes = reader.bytes;
        if (bytes.len < header_bytes)
            return reader.diagnostic.invalid("STL of {d} bytes is cut short", .{bytes.len});
        const count = try reader.binaryCount();
        const coloring = coloringOf(bytes[0..80], bytes[header_bytes..], count);
        try reader.positions.ensureTotalCapacityPrecise(reader.gpa, 3 * count);
        const colors: ?[][4]f32 = if (coloring != .none)
            try reader.arena.alloc([4]f32, 3 * count)
        else
            null;
        for (0..count) |index| {
            const from = bytes[header_bytes + triangle_bytes * index ..][0..triangle_bytes];
            var corners: [3]Vec3 = undefined;
            for (&corners, 0..) |*corner, which| for (corner, 0..) |*value, axis| {
                const place = 12 * (which + 1) + 4 * axis;
                value.* = @bitCast(std.mem.readInt(u32, from[place..][0..4], .little));
            };
            const before = reader.positions.items.len;
            try reader.add(corners);
            if (reader.positions.items.len == before) continue;
            const color = colorOf(coloring, std.mem.readInt(u16, from[48..50], .little));
            if (colors) |all| for (all[before..][0..3]) |*one| {
                one.* = color;
            };
        }
        return if (colors) |all| all[0..reader.positions.items.len] else null;
    }

    /// As many as the header says, if they are there; programs that write as they go leave 0, or
    /// -1.
    fn binaryCount(reader: *Reader) Resources.Error!usize {
        const claimed = std.mem.readInt(u32, reader.bytes[header_bytes - 4 ..][0..4], .little);
        const left = reader.bytes.len - header_bytes;
        const present = left / triangle_bytes;
        const is_unknown = claimed == 0 or claimed == std.math.maxInt(u32);
        if (is_unknown and present > 0 and left % triangle_bytes == 0) {
            reader.diagnostic.forgive(
                "STL claims {d} triangles, all {d} are read",
                .{ claimed, present },
            );
            return reader.bounded(present);
        }
        if (claimed > present) return reader.diagnostic.invalid(
            "STL claims {d} triangles, its {d} bytes hold {d}",
            .{ claimed, reader.bytes.len, present },
        );
        if (left > @as(u64, claimed) * triangle_bytes) reader.diagnostic.forgive(
            "{d} bytes behind the triangles are ignored",
            .{left - @as(u64, claimed) * triangle_bytes},
        );
        return reader.bounded(claimed);
    }

    fn bounded(reader: *Reader, count: usize) Resources.Error!usize {
        if (count <= triangle_count_max) return count;
        return reader.diagnostic.invalid("over {d} triangles", .{triangle_count_max});
    }

    fn add(reader: *Reader, corners: [3]Vec3) Resources.Error!void {
        var whole = corners;
        for (&whole) |*corner| {
            if (!math.vec3.isFinite(corner.*)) {
                reader.left_out_count += 1;
                return;
            }
            for (corner) |*value| value.* = math.flushDenormal(value.*);
        }
        try reader.positions.appendSlice(reader.gpa, &whole);
    }

    /// Facets between `outer loop` and `endloop`; more than three corners are a fan.
    fn readText(reader: *Reader) Resources.Error!void {
        var cursor: usize = 0;
        var corners: [3]Vec3 = undefined;
        var count: u32 = 0;
        var is_open = false;
        while (nextWord(reader.bytes, &cursor)) |word| {
            if (std.ascii.eqlIgnoreCase(word, "vertex")) {
                const corner = try reader.readCorner(&cursor);
                if (count < 3) corners[count] = corner else {
                    corners[1] = corners[2];
                    corners[2] = corner;
                }
                count += 1;
                if (count >= 3) try reader.add(corners);
            } else if (std.ascii.eqlIgnoreCase(word, "facet")) {
                is_open = true;
            } else if (std.ascii.eqlIgnoreCase(word, "endfacet")) {
                if (count < 3) reader.diagnostic.forgive(
                    "a facet has less than three corners, and is left out",
                    .{},
                );
                is_open = false;
                count = 0;
            } else if (isName(word)) {
                skipLine(reader.bytes, &cursor);
            }
        }
        if (is_open) return reader.fail(cursor, "the facet does not end", .{});
    }

    fn readCorner(reader: *Reader, cursor: *usize) Resources.Error!Vec3 {
        var corner: Vec3 = undefined;
        for (&corner) |*value| {
            skipSpace(reader.bytes, cursor);
            value.* = number.floatOrNan(reader.bytes, cursor) catch
                return reader.fail(cursor.*, "a number is expected", .{});
        }
        return corner;
    }

    fn fail(
        reader: *Reader,
        position: usize,
        comptime text: []const u8,
        arguments: anytype,
    ) error{InvalidInput} {
        const line = std.mem.countScalar(u8, reader.bytes[0..position], '\n') + 1;
        return reader.diagnostic.invalid("line {d}: " ++ text, .{line} ++ arguments);
    }
};

/// Whether the rest of the line is a name.
fn isName(word: []const u8) bool {
    return std.ascii.eqlIgnoreCase(word, "solid") or std.ascii.eqlIgnoreCase(word, "endsolid");
}

fn skipSpace(bytes: [:0]const u8, cursor: *usize) void {
    while (std.ascii.isWhitespace(bytes[cursor.*])) cursor.* += 1;
}

fn skipLine(bytes: [:0]const u8, cursor: *usize) void {
    cursor.* = std.mem.findAnyPos(u8, bytes, cursor.*, "\r\n") orelse bytes.len;
}

fn nextWord(bytes: [:0]const u8, cursor: *usize) ?[]const u8 {
    skipSpace(bytes, cursor);
    const start = cursor.*;
    if (start == bytes.len) return null;
    var end = start + 1; // A zero byte is a word.
    while (end < bytes.len and bytes[end] > ' ') end += 1;
    cursor.* = end;
    return bytes[start..end];
}

fn coloringOf(header: *const [80]u8, triangles: []const u8, count: usize) Coloring {
    if (std.mem.find(u8, header, "COLOR=")) |at| if (at + 10 <= header.len) {
        var color: [4]f32 = undefined;
        for (color[0..3], header[at + 6 ..][0..3]) |*channel, code| {
            channel.* = math.srgb.decoded[code];
        }
        color[3] = 1; // What is transparent in a workshop's preview is not meant to be in pictures.
        return .{ .magics = color };
    };
    // Others leave rubbish there: every triangle has to have a colour or nothing.
    var has_color = false;
    var all_same = true;
    const first = if (count > 0) std.mem.readInt(u16, triangles[48..50], .little) else 0;
    for (0..count) |index| {
        const bits = std.mem.readInt(u16, triangles[triangle_bytes * index ..][48..50], .little);
        if (bits != 0 and bits & 0x8000 == 0) return .none;
        if (bits != 0) has_color = true;
        if (bits != first) all_same = false;
    }
    return if (has_color and !(all_same and first == 0xffff)) .viscam else .none;
}

fn colorOf(coloring: Coloring, bits: u16) [4]f32 {
    const low, const middle, const high = .{ bits & 31, bits >> 5 & 31, bits >> 10 & 31 };
    return switch (coloring) {
        .none => plain.material.base_color,
        .viscam => if (bits & 0x8000 == 0)
            plain.material.base_color
        else
            fiveBits(.{ high, middle, low }),
        .magics => |all| if (bits & 0x8000 != 0) all else fiveBits(.{ low, middle, high }),
    };
}

fn fiveBits(channels: [3]u16) [4]f32 {
    var color: [4]f32 = .{ 0, 0, 0, 1 };
    for (color[0..3], channels) |*channel, code| {
        channel.* = math.srgb.decoded[(code * 255 + 15) / 31];
    }
    return color;
}
