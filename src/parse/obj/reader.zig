//! The statements of an OBJ file: vertices and what connects them, as they stand in the text.
//!
//! In: a text. Out: lists of positions, normals and coordinates, and elements whose corners are
//! numbers into them, each within its range. Format: Wavefront, "Object Files (.obj)", appendix B1
//! of the Advanced Visualizer's manual; colours behind positions as MeshLab and scanners write
//! them. Groups and objects say nothing that is seen. Curves and surfaces are left out, with a
//! warning.

const std = @import("std");
const math = @import("../../math.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = @import("../../diagnostic.zig").Diagnostic;
const Resources = @import("../resource.zig");
const Vec3 = math.Vec3;
const Words = @import("words.zig");
const none = @import("../../scene.zig").none;
const quote = @import("../../diagnostic.zig").quote;
const Reader = @This();

/// Numbers of what meets in a corner; `none` for what it has not.
pub const Corner = struct { position: u32, texcoord: u32 = none, normal: u32 = none };

/// A face, a line through its corners, or points.
pub const Element = struct {
    kind: Kind,
    /// Index of the first corner.
    first: u32,
    count: u32,
    /// Index into `material_names`, or `none`.
    material: u32,
    /// 0: it is flat where it has no normals.
    smoothing: u32,

    pub const Kind = enum { face, line, points };
};

/// How often something was wrong that can be left out, and where first.
const Fault = struct {
    count: u64 = 0,
    position: usize = 0,

    fn add(fault: *Fault, position: usize) void {
        if (fault.count == 0) fault.position = position;
        fault.count += 1;
    }
};

gpa: Allocator,
words: Words,
diagnostic: *Diagnostic,
/// NaN where the file's are not finite.
positions: std.ArrayList(Vec3) = .empty,
/// As the file has them, one for each position, white for those without; empty: there are none.
colors: std.ArrayList(Vec3) = .empty,
/// v upwards.
texcoords: std.ArrayList([2]f32) = .empty,
normals: std.ArrayList(Vec3) = .empty,
corners: std.ArrayList(Corner) = .empty,
elements: std.ArrayList(Element) = .empty,
/// Parts of the text.
material_names: std.ArrayList([]const u8) = .empty,
libraries: std.ArrayList([]const u8) = .empty,
name_indices: std.StringHashMapUnmanaged(u32) = .empty,
material: u32 = none,
smoothing: u32 = 0,
not_finite: Fault = .{},
out_of_range: Fault = .{},
too_short: Fault = .{},
curves: Fault = .{},
unknown: Fault = .{},
unknown_word: []const u8 = "",

/// Frees the lists.
pub fn deinit(reader: *Reader) void {
    inline for (.{
        "positions", "colors",         "texcoords", "normals",      "corners",
        "elements",  "material_names", "libraries", "name_indices",
    }) |name| @field(reader, name).deinit(reader.gpa);
    reader.* = undefined;
}

const Keyword = enum { v, vt, vn, f, fo, l, p, usemtl, mtllib, s, g, o, mg };

/// What is passed over in silence: it changes nothing that is seen.
const silent_words = [_][]const u8{
    "lod", "shadow_obj", "trace_obj", "bevel", "c_interp", "d_interp", "maplib", "usemap",
};

/// Statements of free-form geometry.
const curve_words = [_][]const u8{
    "vp",   "cstype", "deg", "bmat", "step", "curv", "curv2", "surf", "parm",  "trim",
    "hole", "scrv",   "sp",  "end",  "con",  "bzp",  "bsp",   "cdc",  "ctech", "stech",
};

/// Reads all of the text.
pub fn run(reader: *Reader) Resources.Error!void {
    const words = &reader.words;
    while (words.nextLine()) : (words.skipLine()) {
        const start = words.cursor;
        const word = words.word();
        switch (std.meta.stringToEnum(Keyword, word) orelse {
            reader.passOver(word, start);
            continue;
        }) {
            .v => try reader.readPosition(start),
            .vt => try reader.readTexcoord(start),
            .vn => try reader.readNormal(start),
            .f, .fo => try reader.readElement(.face, start),
            .l => try reader.readElement(.line, start),
            .p => try reader.readElement(.points, start),
            .s => reader.smoothing = smoothingOf(words.word()),
            .usemtl => try reader.useMaterial(words.rest()),
            .mtllib => try reader.libraries.append(reader.gpa, words.rest()),
            .g, .o, .mg => {},
        }
    }
    reader.sayFaults();
    try reader.addCloud();
}

/// Vertices of a file that uses none of them are a cloud of points, as scanners write it.
fn addCloud(reader: *Reader) Allocator.Error!void {
    if (reader.elements.items.len > 0 or reader.curves.count > 0 or reader.too_short.count > 0)
        return;
    const positions = reader.positions.items;
    // Each that is not finite is left out by itself.
    for ([_]bool{ true, false }) |are_finite| for (positions, 0..) |position, vertex| {
        if (math.vec3.isFinite(position) != are_finite) continue;
        const first = reader.corners.items.len;
        try reader.corners.append(reader.gpa, .{ .position = @intCast(vertex) });
        if (are_finite and first > 0) {
            reader.elements.items[0].count += 1;
            continue;
        }
        try reader.elements.append(reader.gpa, .{
            .kind = .points,
            .first = @intCast(first),
            .count = 1,
            .material = none,
            .smoothing = 0,
        });
    };
}

fn passOver(reader: *Reader, word: []const u8, start: usize) void {
    for (silent_words) |silent| if (std.mem.eql(u8, word, silent)) return;
    for (curve_words) |curve| if (std.mem.eql(u8, word, curve)) return reader.curves.add(start);
    if (reader.unknown.count == 0) reader.unknown_word = word;
    reader.unknown.add(start);
}

fn sayFaults(reader: *Reader) void {
    const diagnostic = reader.diagnostic;
    const words = &reader.words;
    if (reader.curves.count > 0) diagnostic.warn(
        "line {d}: free-form curves and surfaces are not read",
        .{words.lineOf(reader.curves.position)},
    );
    if (reader.unknown.count > 0) diagnostic.forgive(
        "line {d}: {f} is no statement of OBJ, ignored: {d} of them",
        .{
            words.lineOf(reader.unknown.position), quote(reader.unknown_word),
            reader.unknown.count,
        },
    );
    for ([_]struct { *const Fault, []const u8 }{
        .{ &reader.not_finite, "normals or coordinates of textures are not finite" },
        .{ &reader.out_of_range, "normals or coordinates of textures are not in the file" },
        .{ &reader.too_short, "faces or lines have too few corners" },
    }) |fault| if (fault[0].count > 0) diagnostic.forgive(
        "line {d}: {d} {s}, left out",
        .{ words.lineOf(fault[0].position), fault[0].count, fault[1] },
    );
}

fn fail(
    reader: *Reader,
    position: usize,
    comptime format: []const u8,
    arguments: anytype,
) error{InvalidInput} {
    const line = reader.words.lineOf(position);
    return reader.diagnostic.invalid("line {d}: " ++ format, .{line} ++ arguments);
}

fn readPosition(reader: *Reader, start: usize) Resources.Error!void {
    const words = &reader.words;
    var position: Vec3 = undefined;
    for (&position) |*value| value.* = words.float() orelse
        return reader.fail(start, "a vertex has three numbers", .{});
    try reader.positions.append(reader.gpa, position);
    var more: [3]f32 = undefined;
    var count: usize = 0;
    while (count < more.len and words.hasMore()) : (count += 1) more[count] = words.float() orelse
        return reader.fail(start, "a number is expected behind a vertex's first three", .{});
    if (count < 3 and reader.colors.items.len == 0) return; // A weight.
    // Those before had none.
    const missing = reader.positions.items.len - 1 - reader.colors.items.len;
    try reader.colors.appendNTimes(reader.gpa, .{ 1, 1, 1 }, missing);
    try reader.colors.append(reader.gpa, if (count < 3) .{ 1, 1, 1 } else more);
}

fn readTexcoord(reader: *Reader, start: usize) Resources.Error!void {
    const words = &reader.words;
    const u = words.float() orelse return reader.fail(start, "vt has no number", .{});
    const v = if (words.hasMore())
        words.float() orelse return reader.fail(start, "vt has something else than numbers", .{})
    else
        0;
    const is_finite = std.math.isFinite(u) and std.math.isFinite(v);
    if (!is_finite) reader.not_finite.add(start);
    try reader.texcoords.append(reader.gpa, if (is_finite) .{ u, v } else .{ 0, 0 });
}

fn readNormal(reader: *Reader, start: usize) Resources.Error!void {
    var normal: Vec3 = undefined;
    for (&normal) |*value| value.* = reader.words.float() orelse
        return reader.fail(start, "a normal has three numbers", .{});
    if (!math.vec3.isFinite(normal)) {
        reader.not_finite.add(start);
        normal = .{ 0, 0, 0 };
    }
    try reader.normals.append(reader.gpa, normal);
}

fn smoothingOf(word: []const u8) u32 {
    if (std.mem.eql(u8, word, "on")) return 1;
    return std.fmt.parseInt(u32, word, 10) catch 0;
}

fn useMaterial(reader: *Reader, name: []const u8) Allocator.Error!void {
    reader.material = none;
    if (name.len == 0) return;
    const entry = try reader.name_indices.getOrPut(reader.gpa, name);
    if (!entry.found_existing) {
        entry.value_ptr.* = @intCast(reader.material_names.items.len);
        try reader.material_names.append(reader.gpa, name);
    }
    reader.material = entry.value_ptr.*;
}

fn readElement(reader: *Reader, kind: Element.Kind, start: usize) Resources.Error!void {
    const first = reader.corners.items.len;
    while (reader.words.hasMore()) {
        const corner = try reader.readCorner(start);
        try reader.corners.append(reader.gpa, corner);
    }
    const count = reader.corners.items.len - first;
    const count_min: usize = switch (kind) {
        .face => 3,
        .line => 2,
        .points => 1,
    };
    if (count < count_min) {
        reader.corners.items.len = first;
        reader.too_short.add(start);
        return;
    }
    try reader.elements.append(reader.gpa, .{
        .kind = kind,
        .first = @intCast(first), // Two bytes of text at least, of 2^31.
        .count = @intCast(count),
        .material = reader.material,
        .smoothing = reader.smoothing,
    });
}

/// `v`, `v/vt`, `v//vn` or `v/vt/vn`.
fn readCorner(reader: *Reader, start: usize) Resources.Error!Corner {
    const words = &reader.words;
    const count = reader.positions.items.len;
    const position = try reader.index(start) orelse return reader.wrongCorner(start);
    var corner: Corner = .{ .position = resolve(position, count) orelse
        return reader.fail(start, "vertex {d} of {d}", .{ position, count }) };
    if (words.text[words.cursor] == '/') {
        words.cursor += 1;
        if (try reader.index(start)) |number_of| {
            corner.texcoord = resolve(number_of, reader.texcoords.items.len) orelse none;
            if (corner.texcoord == none) reader.out_of_range.add(start);
        }
        if (words.text[words.cursor] == '/') {
            words.cursor += 1;
            if (try reader.index(start)) |number_of| {
                corner.normal = resolve(number_of, reader.normals.items.len) orelse none;
                if (corner.normal == none) reader.out_of_range.add(start);
            }
        }
    }
    const end = words.text[words.cursor];
    if (end > ' ' and end != '#') return reader.wrongCorner(start);
    return corner;
}

fn wrongCorner(reader: *Reader, start: usize) error{InvalidInput} {
    return reader.fail(start, "{f} is no corner", .{quote(reader.words.word())});
}

/// The whole number that stands here; null: none does.
inline fn index(reader: *Reader, start: usize) Resources.Error!?i64 {
    const words = &reader.words;
    const text = words.text;
    var at = words.cursor;
    const is_negative = text[at] == '-';
    if (is_negative or text[at] == '+') at += 1;
    const digits_start = at;
    var value: i64 = 0;
    while (text[at] -% '0' < 10) : (at += 1) value = value *% 10 +% (text[at] - '0');
    if (at == digits_start) return null;
    if (at - digits_start > 18) return reader.fail(start, "a number has too many digits", .{});
    words.cursor = at;
    return if (is_negative) -value else value;
}

/// From 1 for the first, or from -1 for the last so far; null: there is none.
inline fn resolve(value: i64, count: usize) ?u32 {
    const from_zero = if (value < 0) value + @as(i64, @intCast(count)) else value - 1;
    return if (from_zero >= 0 and from_zero < count) @intCast(from_zero) else null;
}

test "vertices alone are points, those with faces are not" {
    const gpa = std.testing.allocator;
    for ([_][:0]const u8{
        "v 0 0 0 1 0 0\nv 1 2 3\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    }, [_]Element.Kind{ .points, .face }, [_]u32{ 2, 3 }) |text, kind, count| {
        var said: Diagnostic = .{};
        var reader: Reader = .{ .gpa = gpa, .words = .{ .text = text }, .diagnostic = &said };
        defer reader.deinit();
        try reader.run();
        try std.testing.expectEqual(1, reader.elements.items.len);
        try std.testing.expectEqual(kind, reader.elements.items[0].kind);
        try std.testing.expectEqual(count, reader.elements.items[0].count);
    }
}
