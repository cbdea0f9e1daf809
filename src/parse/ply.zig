//! PLY files: vertices with normals, colours and coordinates of textures, polygons, strips of
//! triangles, edges, as text or binary of either order.
//!
//! In: the bytes of a file. Out: its mesh; polygons are cut. Nothing is allocated that the length
//! of the file does not explain: a value takes a byte at least, or two as text. Other elements and
//! properties are passed over. What is not finite is left out and counted. Format: Turk, "The PLY
//! polygon file format" (1994); names of properties as MeshLab, Blender and scanners write them.

const std = @import("std");
const math = @import("../math.zig");
const number = @import("number.zig");
const quote = @import("../diagnostic.zig").quote;
const Allocator = std.mem.Allocator;
const Message = @import("../diagnostic.zig").Message;
const Polygon = @import("polygon.zig");
const Vec3 = math.Vec3;

/// `InvalidPly`: the reason is set, as what follows the file's name.
pub const Error = error{ OutOfMemory, InvalidPly };

/// What the caller wants of a file.
pub const Wants = struct {
    texcoords: bool = true,
    /// Colours, strips, edges, points and what each corner of a face has of its own.
    extras: bool = true,
};

/// What a file holds; the arrays are the caller's.
pub const Mesh = struct {
    positions: []Vec3 = &.{},
    /// Zero where the file's are not finite.
    normals: ?[]Vec3 = null,
    /// As they stand in the file: v may point either way.
    texcoords: ?[][2]f32 = null,
    /// Linear RGBA, of colours that are the display's.
    colors: ?[][4]f32 = null,
    /// Some alpha is below 1.
    has_alpha: bool = false,
    /// All was 0 in the file, which programs write that mean nothing by it, and is 1 here.
    is_alpha_dropped: bool = false,
    triangles: [][3]u32 = &.{},
    segments: [][2]u32 = &.{},
    /// All vertices, where nothing connects them.
    points: []u32 = &.{},
    /// Name of the image that the header says belongs to the coordinates.
    texture_file: ?[]const u8 = null,
    /// Vertices, faces or edges that were left out for a position that is not finite.
    not_finite_count: u64 = 0,
    /// Normals and coordinates that were.
    dropped_count: u64 = 0,

    /// Of its arrays.
    pub fn bytes(mesh: *const Mesh) u64 {
        var sum: u64 = mesh.positions.len * @sizeOf(Vec3) + mesh.triangles.len * @sizeOf([3]u32);
        if (mesh.normals) |all| sum += all.len * @sizeOf(Vec3);
        if (mesh.texcoords) |all| sum += all.len * @sizeOf([2]f32);
        if (mesh.colors) |all| sum += all.len * @sizeOf([4]f32);
        return sum;
    }
};

const Type = enum {
    int8,
    uint8,
    int16,
    uint16,
    int32,
    uint32,
    float32,
    float64,

    fn bytes(type_: Type) u64 {
        return switch (type_) {
            .int8, .uint8 => 1,
            .int16, .uint16 => 2,
            .int32, .uint32, .float32 => 4,
            .float64 => 8,
        };
    }
};

/// Names in any case: of properties, some programs write them in capitals.
fn Names(comptime Value: type) type {
    return std.StaticStringMapWithEql(Value, std.static_string_map.eqlAsciiIgnoreCase);
}

const type_names: Names(Type) = .initComptime(.{
    .{ "char", .int8 },       .{ "uchar", .uint8 },    .{ "short", .int16 },
    .{ "ushort", .uint16 },   .{ "int", .int32 },      .{ "uint", .uint32 },
    .{ "float", .float32 },   .{ "double", .float64 }, .{ "int8", .int8 },
    .{ "uint8", .uint8 },     .{ "int16", .int16 },    .{ "uint16", .uint16 },
    .{ "int32", .int32 },     .{ "uint32", .uint32 },  .{ "float32", .float32 },
    .{ "float64", .float64 },
});

/// What we make of a property. The first ones are numbers of a vertex, or a face, by their places.
const Role = enum {
    x,
    y,
    z,
    nx,
    ny,
    nz,
    u,
    v,
    red,
    green,
    blue,
    alpha,
    /// Ends of an edge.
    vertex1,
    vertex2,
    /// A list of vertices.
    indices,
    /// A list of coordinates, two for each corner of a face.
    corner_texcoords,
    other,

    const scalar_count = @backingInt(Role.indices);
    const first_color = @backingInt(Role.red);
};

/// Names of scalars.
const scalar_names: Names(Role) = .initComptime(.{
    .{ "x", .x },             .{ "y", .y },               .{ "z", .z },
    .{ "nx", .nx },           .{ "ny", .ny },             .{ "nz", .nz },
    .{ "u", .u },             .{ "v", .v },               .{ "s", .u },
    .{ "t", .v },             .{ "texture_u", .u },       .{ "texture_v", .v },
    .{ "texture_s", .u },     .{ "texture_t", .v },       .{ "red", .red },
    .{ "green", .green },     .{ "blue", .blue },         .{ "alpha", .alpha },
    .{ "diffuse_red", .red }, .{ "diffuse_blue", .blue }, .{ "diffuse_green", .green },
    .{ "r", .red },           .{ "g", .green },           .{ "b", .blue },
    .{ "a", .alpha },         .{ "vertex1", .vertex1 },   .{ "vertex2", .vertex2 },
});

/// Names of lists.
const list_names: Names(Role) = .initComptime(.{
    .{ "vertex_indices", .indices },
    .{ "vertex_index", .indices },
    .{ "texcoord", .corner_texcoords },
});

const Property = struct {
    role: Role,
    type: Type,
    /// Of a list: the type of its length.
    length_type: ?Type,
};

const Element = struct {
    const Kind = enum { vertex, face, tristrips, edge, other };

    kind: Kind,
    count: u64,
    first_property: usize,
    property_count: usize,
};

const element_names: Names(Element.Kind) = .initComptime(.{
    .{ "vertex", .vertex },       .{ "face", .face }, .{ "edge", .edge },
    .{ "tristrips", .tristrips },
});

const Format = enum { ascii, binary_little_endian, binary_big_endian };

const property_count_max = 256;
const element_count_max = 64;

/// Most corners of a polygon.
const corner_count_max = 1 << 16;

const Reader = struct {
    gpa: Allocator,
    /// Where the mesh lives.
    arena: Allocator,
    bytes: [:0]const u8,
    wants: Wants,
    reason: *Message,
    cutter: Polygon,
    cursor: usize = 0,
    format: Format = .ascii,
    properties: [property_count_max]Property = undefined,
    property_count: usize = 0,
    elements: [element_count_max]Element = undefined,
    element_count: usize = 0,
    mesh: Mesh = .{},
    triangles: std.ArrayList([3]u32) = .empty,
    segments: std.ArrayList([2]u32) = .empty,
    /// Of the corners of each triangle, and colours of each triangle, where faces have any.
    corner_texcoords: std.ArrayList([3][2]f32) = .empty,
    /// Null: the face has none. Of faces behind the last one that has any there is nothing.
    face_colors: std.ArrayList(?[4]f32) = .empty,
    /// Vertices whose position is not finite; empty: none.
    bad: std.DynamicBitSetUnmanaged = .{},
    /// Of the face that is read.
    face: Face = .{},
    /// Largest code of a colour that is a float.
    color_max: f32 = 0,

    const Face = struct {
        corners: std.ArrayList(u32) = .empty,
        texcoords: std.ArrayList(f32) = .empty,
        positions: std.ArrayList(Vec3) = .empty,
        cut: std.ArrayList([3]u32) = .empty,
        color: [4]f32 = undefined,
    };

    fn deinit(reader: *Reader) void {
        const gpa = reader.gpa;
        inline for (.{ "triangles", "segments", "corner_texcoords", "face_colors", "bad" }) |name| {
            @field(reader, name).deinit(gpa);
        }
        inline for (.{ "corners", "texcoords", "positions", "cut" }) |name| {
            @field(reader.face, name).deinit(gpa);
        }
        reader.cutter.deinit();
    }

    fn fail(reader: *Reader, comptime format: []const u8, arguments: anytype) error{InvalidPly} {
        reader.reason.set(format, arguments);
        return error.InvalidPly;
    }

    /// The next line of the header, without its end, which is the same for all: old systems have
    /// returns alone, behind the last of which binary data may look like another end.
    fn line(reader: *Reader) Error![]const u8 {
        const rest = reader.bytes[reader.cursor..];
        const has_returns = std.mem.startsWith(u8, reader.bytes, "ply\r") and
            reader.bytes[4] != '\n';
        const end = std.mem.findScalar(u8, rest, if (has_returns) '\r' else '\n') orelse
            return reader.fail("the PLY header does not end", .{});
        reader.cursor += end + 1;
        return std.mem.trimEnd(u8, rest[0..end], "\r \t");
    }

    fn readHeader(reader: *Reader) Error!void {
        if (!std.mem.eql(u8, try reader.line(), "ply")) return reader.fail("is no PLY file", .{});
        while (true) {
            const text = try reader.line();
            var words = std.mem.tokenizeAny(u8, text, " \t");
            const word = words.next() orelse continue;
            const Keyword = enum { format, comment, obj_info, element, property, end_header };
            switch (std.meta.stringToEnum(Keyword, word) orelse
                return reader.fail("the PLY header says {f}", .{quote(word)})) {
                .obj_info => {},
                .comment => if (std.mem.eql(u8, words.next() orelse "", "TextureFile")) {
                    const name = std.mem.trim(u8, words.rest(), " \t");
                    if (name.len > 0 and reader.mesh.texture_file == null)
                        reader.mesh.texture_file = name;
                },
                .end_header => return,
                .format => {
                    const name = words.next() orelse "";
                    reader.format = std.meta.stringToEnum(Format, name) orelse
                        return reader.fail("is of an unknown PLY format", .{});
                },
                .element => try reader.addElement(&words),
                .property => try reader.addProperty(&words),
            }
        }
    }

    const Words = std.mem.TokenIterator(u8, .any);

    fn addElement(reader: *Reader, words: *Words) Error!void {
        if (reader.element_count == element_count_max)
            return reader.fail("has over {d} kinds of elements", .{element_count_max});
        const name = words.next() orelse "";
        const count = std.fmt.parseInt(u32, words.next() orelse "", 10) catch
            return reader.fail("the number of {f} is none", .{quote(name)});
        reader.elements[reader.element_count] = .{
            .kind = element_names.get(name) orelse .other,
            .count = count,
            .first_property = reader.property_count,
            .property_count = 0,
        };
        reader.element_count += 1;
    }

    fn addProperty(reader: *Reader, words: *Words) Error!void {
        if (reader.element_count == 0) return reader.fail("a property belongs to no element", .{});
        if (reader.property_count == property_count_max)
            return reader.fail("has over {d} properties", .{property_count_max});
        var type_name = words.next() orelse "";
        var length_type: ?Type = null;
        if (std.mem.eql(u8, type_name, "list")) {
            length_type = try reader.typeOf(words.next() orelse "");
            type_name = words.next() orelse "";
        }
        const type_ = try reader.typeOf(type_name);
        const name = words.next() orelse "";
        const role: Role = if (length_type != null)
            list_names.get(name) orelse .other
        else
            scalar_names.get(name) orelse .other;
        reader.properties[reader.property_count] =
            .{ .role = role, .type = type_, .length_type = length_type };
        reader.property_count += 1;
        reader.elements[reader.element_count - 1].property_count += 1;
    }

    fn typeOf(reader: *Reader, name: []const u8) Error!Type {
        return type_names.get(name) orelse reader.fail("{f} is no PLY type", .{quote(name)});
    }

    fn propertiesOf(reader: *const Reader, element: *const Element) []const Property {
        return reader.properties[element.first_property..][0..element.property_count];
    }

    /// Fails where the rest of the file cannot hold that many elements.
    fn checkCount(reader: *Reader, element: *const Element) Error!void {
        var element_bytes: u64 = 0;
        for (reader.propertiesOf(element)) |property| {
            element_bytes += if (reader.format == .ascii)
                2
            else
                (property.length_type orelse property.type).bytes();
        }
        // The last number of a text needs no white space behind it.
        const left = reader.bytes.len - reader.cursor + 1;
        if (element.count * @max(element_bytes, 1) > left) return reader.fail(
            "claims {d} elements, its {d} bytes hold less",
            .{ element.count, left - 1 },
        );
    }

    fn scalar(reader: *Reader, type_: Type) Error!f64 {
        return switch (reader.format) {
            .ascii => reader.textNumber(type_),
            inline else => |format| {
                const endian: std.lang.Endian =
                    if (format == .binary_little_endian) .little else .big;
                switch (type_) {
                    inline .float32, .float64 => |float| {
                        const Bits = if (float == .float32) u32 else u64;
                        const Float = if (float == .float32) f32 else f64;
                        return @as(Float, @bitCast(try reader.raw(Bits, endian)));
                    },
                    .int8 => return @floatFromInt(try reader.raw(i8, endian)),
                    .uint8 => return @floatFromInt(try reader.raw(u8, endian)),
                    .int16 => return @floatFromInt(try reader.raw(i16, endian)),
                    .uint16 => return @floatFromInt(try reader.raw(u16, endian)),
                    .int32 => return @floatFromInt(try reader.raw(i32, endian)),
                    .uint32 => return @floatFromInt(try reader.raw(u32, endian)),
                }
            },
        };
    }

    fn raw(reader: *Reader, comptime Int: type, endian: std.lang.Endian) Error!Int {
        const size = @sizeOf(Int);
        if (reader.bytes.len - reader.cursor < size) return reader.fail("is cut short", .{});
        defer reader.cursor += size;
        return std.mem.readInt(Int, reader.bytes[reader.cursor..][0..size], endian);
    }

    fn textNumber(reader: *Reader, type_: Type) Error!f64 {
        while (std.ascii.isWhitespace(reader.bytes[reader.cursor])) reader.cursor += 1;
        if (reader.cursor == reader.bytes.len) return reader.fail("is cut short", .{});
        if (type_ == .float32 or type_ == .float64)
            return number.floatOrNan(reader.bytes, &reader.cursor) catch
                reader.fail("a number is expected where something else stands", .{});
        const value = number.integer(reader.bytes, &reader.cursor) catch
            return reader.fail("a whole number is expected where something else stands", .{});
        return @floatFromInt(value);
    }

    /// The length of a list or an index: a whole number from 0 to `maximum`.
    fn whole(reader: *Reader, type_: Type, maximum: u32, what: []const u8) Error!u32 {
        return reader.wholeOf(try reader.scalar(type_), maximum, what);
    }

    fn wholeOf(reader: *Reader, value: f64, maximum: u32, what: []const u8) Error!u32 {
        if (value >= 0 and value <= @as(f64, @floatFromInt(maximum)) and value == @trunc(value))
            return @intFromFloat(value);
        return reader.fail("{s} {d} is not one of 0 to {d}", .{ what, value, maximum });
    }

    /// The scalars of an element, 0 where it has none, 1 for alpha.
    fn readScalars(reader: *Reader, element: *const Element) Error![Role.scalar_count]f32 {
        var values: [Role.scalar_count]f32 = @splat(0);
        values[@backingInt(Role.alpha)] = 1;
        for (reader.propertiesOf(element)) |property| switch (property.role) {
            .indices, .corner_texcoords, .other => try reader.pass(property),
            else => |role| {
                const value = single(try reader.scalar(property.type));
                values[@backingInt(role)] = if (@backingInt(role) >= Role.first_color)
                    reader.fractionOf(value, property.type)
                else
                    value;
            },
        };
        return values;
    }

    /// A code of a colour, as a fraction of the largest that its type has.
    fn fractionOf(reader: *Reader, value: f32, type_: Type) f32 {
        switch (type_) {
            .int8 => return value / 127,
            .uint8 => return value / 255,
            .int16 => return value / 32767,
            .uint16 => return value / 65535,
            .int32, .uint32, .float32, .float64 => {
                if (!(value > 0)) return 0;
                reader.color_max = @max(reader.color_max, value);
                return value;
            },
        }
    }

    fn readVertices(reader: *Reader, element: *const Element) Error!void {
        const mesh = &reader.mesh;
        if (mesh.positions.len > 0) return reader.fail("has vertices twice", .{});
        try reader.checkCount(element);
        const count: usize = @intCast(element.count);
        const wants = reader.wants;
        mesh.positions = try reader.arena.alloc(Vec3, count);
        // An element before it that had none has no say.
        mesh.normals = null;
        mesh.texcoords = null;
        mesh.colors = null;
        if (reader.hasRole(element, .nx)) mesh.normals = try reader.arena.alloc(Vec3, count);
        if (wants.texcoords and reader.hasRole(element, .u))
            mesh.texcoords = try reader.arena.alloc([2]f32, count);
        if (wants.extras and reader.hasRole(element, .red))
            mesh.colors = try reader.arena.alloc([4]f32, count);
        for (0..count) |index| {
            const values = try reader.readScalars(element);
            mesh.positions[index] = values[0..3].*;
            if (!math.vec3.isFinite(values[0..3].*)) try reader.setBad(index);
            if (mesh.normals) |normals| normals[index] = reader.finite(3, values[3..6].*);
            if (mesh.texcoords) |texcoords| texcoords[index] = reader.finite(2, values[6..8].*);
            if (mesh.colors) |colors| colors[index] = values[Role.first_color..][0..4].*;
        }
    }

    fn hasRole(reader: *const Reader, element: *const Element, role: Role) bool {
        for (reader.propertiesOf(element)) |property| if (property.role == role) return true;
        return false;
    }

    /// Numbers that may be left out: zero where one is not finite.
    fn finite(reader: *Reader, comptime count: usize, values: [count]f32) [count]f32 {
        for (values) |value| if (!std.math.isFinite(value)) {
            reader.mesh.dropped_count += 1;
            return @splat(0);
        };
        return values;
    }

    fn setBad(reader: *Reader, vertex: usize) Error!void {
        const positions = reader.mesh.positions;
        if (reader.bad.bit_length == 0)
            reader.bad = try .initEmpty(reader.gpa, positions.len);
        reader.bad.set(vertex);
        positions[vertex] = .{ 0, 0, 0 };
    }

    fn isBad(reader: *const Reader, vertex: u32) bool {
        return reader.bad.bit_length > 0 and reader.bad.isSet(vertex);
    }

    fn readFaces(reader: *Reader, element: *const Element) Error!void {
        if (element.count == 0) return;
        if (reader.mesh.positions.len == 0) return reader.fail("has faces before vertices", .{});
        try reader.checkCount(element);
        const extras = reader.wants.extras;
        const has_colors = extras and reader.mesh.colors == null and reader.hasRole(element, .red);
        const face = &reader.face;
        for (0..@intCast(element.count)) |_| {
            face.corners.clearRetainingCapacity();
            face.texcoords.clearRetainingCapacity();
            face.color = .{ 0, 0, 0, 1 };
            for (reader.propertiesOf(element)) |property| switch (property.role) {
                .indices => try reader.readCorners(property),
                .corner_texcoords => if (extras)
                    try reader.readCornerTexcoords(property)
                else
                    try reader.pass(property),
                .red, .green, .blue, .alpha => |role| {
                    const value = single(try reader.scalar(property.type));
                    face.color[@backingInt(role) - Role.first_color] =
                        reader.fractionOf(value, property.type);
                },
                else => try reader.pass(property),
            };
            try reader.addFace(has_colors);
        }
    }

    fn readCorners(reader: *Reader, property: Property) Error!void {
        const index_max: u32 = @intCast(reader.mesh.positions.len - 1);
        const count =
            try reader.whole(property.length_type.?, corner_count_max, "the face's length");
        for (0..count) |_| {
            const index = try reader.whole(property.type, index_max, "index");
            try reader.face.corners.append(reader.gpa, index);
        }
    }

    fn readCornerTexcoords(reader: *Reader, property: Property) Error!void {
        const what = "the list's length";
        const count = try reader.whole(property.length_type.?, 2 * corner_count_max, what);
        for (0..count) |_| {
            const value = single(try reader.scalar(property.type));
            try reader.face.texcoords.append(reader.gpa, value);
        }
    }

    /// Cuts the face that has been read into triangles.
    fn addFace(reader: *Reader, has_color: bool) Error!void {
        const face = &reader.face;
        const corners = face.corners.items;
        for (corners) |corner| if (reader.isBad(corner)) {
            reader.mesh.not_finite_count += 1;
            return;
        };
        face.cut.clearRetainingCapacity();
        if (corners.len == 3) {
            try face.cut.append(reader.gpa, .{ 0, 1, 2 });
        } else {
            face.positions.clearRetainingCapacity();
            for (corners) |corner| {
                try face.positions.append(reader.gpa, reader.mesh.positions[corner]);
            }
            try reader.cutter.cut(face.positions.items, &face.cut);
        }
        // Where one face has coordinates of its own, all have, or (0, 0).
        const texcoords = face.texcoords.items;
        const has_texcoords = texcoords.len > 0 and texcoords.len == 2 * corners.len;
        if (has_texcoords or reader.corner_texcoords.items.len > 0) {
            const before = reader.triangles.items.len - reader.corner_texcoords.items.len;
            const missing: [3][2]f32 = @splat(.{ 0, 0 });
            try reader.corner_texcoords.appendNTimes(reader.gpa, missing, before);
        }
        if (has_color) {
            const before = reader.triangles.items.len - reader.face_colors.items.len;
            try reader.face_colors.appendNTimes(reader.gpa, null, before);
        }
        for (face.cut.items) |triangle| {
            try reader.triangles.append(reader.gpa, .{
                corners[triangle[0]], corners[triangle[1]], corners[triangle[2]],
            });
            if (has_color) try reader.face_colors.append(reader.gpa, face.color);
            if (!has_texcoords) continue;
            var own: [3][2]f32 = undefined;
            for (&own, triangle) |*to, corner| {
                to.* = reader.finite(2, texcoords[2 * corner ..][0..2].*);
            }
            try reader.corner_texcoords.append(reader.gpa, own);
        }
    }

    /// Lists of vertices of which each makes a triangle with the two before it, turned every second
    /// time; -1 begins anew.
    fn readStrips(reader: *Reader, element: *const Element) Error!void {
        if (element.count == 0) return;
        if (reader.mesh.positions.len == 0) return reader.fail("has faces before vertices", .{});
        try reader.checkCount(element);
        const index_max: u32 = @intCast(reader.mesh.positions.len - 1);
        for (0..@intCast(element.count)) |_| for (reader.propertiesOf(element)) |property| {
            if (property.role != .indices) {
                try reader.pass(property);
                continue;
            }
            const length_max = std.math.maxInt(i32);
            const length =
                try reader.whole(property.length_type.?, length_max, "the strip's length");
            var corners: [3]u32 = undefined;
            var count: u32 = 0;
            for (0..length) |_| {
                const value = try reader.scalar(property.type);
                if (value == -1) {
                    count = 0;
                    continue;
                }
                const corner = try reader.wholeOf(value, index_max, "index");
                corners = .{ corners[1], corners[2], corner };
                count += 1;
                if (count < 3) continue;
                const is_turned = count % 2 == 0;
                const a, const b = if (is_turned) .{ corners[1], corners[0] } else corners[0..2].*;
                if (reader.isBad(a) or reader.isBad(b) or reader.isBad(corners[2])) {
                    reader.mesh.not_finite_count += 1;
                    continue;
                }
                try reader.triangles.append(reader.gpa, .{ a, b, corners[2] });
            }
        };
    }

    fn readEdges(reader: *Reader, element: *const Element) Error!void {
        try reader.checkCount(element);
        for (0..@intCast(element.count)) |_| {
            var ends: [2]?u32 = .{ null, null };
            for (reader.propertiesOf(element)) |property| switch (property.role) {
                .vertex1, .vertex2 => |role| {
                    const vertex_count = reader.mesh.positions.len;
                    if (vertex_count == 0) return reader.fail("has edges before vertices", .{});
                    const end = @backingInt(role) - @backingInt(Role.vertex1);
                    ends[end] =
                        try reader.whole(property.type, @intCast(vertex_count - 1), "index");
                },
                else => try reader.pass(property),
            };
            const first = ends[0] orelse continue;
            const last = ends[1] orelse continue;
            if (reader.isBad(first) or reader.isBad(last)) {
                reader.mesh.not_finite_count += 1;
            } else try reader.segments.append(reader.gpa, .{ first, last });
        }
    }

    /// Everything that has been read, in the caller's memory.
    fn finish(reader: *Reader) Error!Mesh {
        const mesh = &reader.mesh;
        const arena = reader.arena;
        mesh.triangles = try arena.dupe([3]u32, reader.triangles.items);
        const has_corners = reader.corner_texcoords.items.len > 0;
        if (has_corners) {
            // Faces behind the last one that has any.
            const missing = mesh.triangles.len - reader.corner_texcoords.items.len;
            try reader.corner_texcoords.appendNTimes(reader.gpa, @splat(.{ 0, 0 }), missing);
        }
        if (reader.segments.items.len > 0 and mesh.triangles.len == 0) {
            mesh.segments = try arena.dupe([2]u32, reader.segments.items);
        } else if (mesh.triangles.len == 0 and reader.wants.extras) {
            try reader.addPoints();
        } else if (has_corners or reader.face_colors.items.len > 0) {
            try reader.unshare();
        }
        if (mesh.colors) |colors| reader.linearize(colors);
        return mesh.*;
    }

    fn addPoints(reader: *Reader) Error!void {
        const mesh = &reader.mesh;
        const bad_count = if (reader.bad.bit_length > 0) reader.bad.count() else 0;
        mesh.not_finite_count += bad_count;
        mesh.points = try reader.arena.alloc(u32, mesh.positions.len - bad_count);
        var made: usize = 0;
        for (0..mesh.positions.len) |index| {
            const vertex: u32 = @intCast(index);
            if (reader.isBad(vertex)) continue;
            mesh.points[made] = vertex;
            made += 1;
        }
    }

    /// Gives each corner of a triangle a vertex of its own.
    fn unshare(reader: *Reader) Error!void {
        const from = reader.mesh;
        const arena = reader.arena;
        const count = std.math.cast(u32, 3 * @as(u64, from.triangles.len)) orelse
            return reader.fail("has too many corners", .{});
        const to = &reader.mesh;
        to.positions = try arena.alloc(Vec3, count);
        if (from.normals != null) to.normals = try arena.alloc(Vec3, count);
        const has_texcoords = reader.corner_texcoords.items.len > 0 or from.texcoords != null;
        if (has_texcoords) to.texcoords = try arena.alloc([2]f32, count);
        const has_colors = reader.face_colors.items.len > 0 or from.colors != null;
        if (has_colors) to.colors = try arena.alloc([4]f32, count);
        for (from.triangles, 0..) |*triangle, index| for (triangle, 0..) |*vertex, corner| {
            const place: u32 = @intCast(3 * index + corner);
            to.positions[place] = from.positions[vertex.*];
            if (from.normals) |normals| to.normals.?[place] = normals[vertex.*];
            if (has_texcoords) to.texcoords.?[place] = if (reader.corner_texcoords.items.len > 0)
                reader.corner_texcoords.items[index][corner]
            else
                from.texcoords.?[vertex.*];
            if (has_colors) to.colors.?[place] = if (from.colors) |colors|
                colors[vertex.*]
            else
                reader.faceColor(index);
            vertex.* = place;
        };
    }

    /// White where the triangle's face has none.
    fn faceColor(reader: *const Reader, triangle: usize) [4]f32 {
        const colors = reader.face_colors.items;
        const white = reader.colorScale();
        return (if (triangle < colors.len) colors[triangle] else null) orelse
            .{ white, white, white, 1 };
    }

    /// Floats of 0 to 1, unless there are larger ones: those are codes.
    fn colorScale(reader: *const Reader) f32 {
        return if (reader.color_max > 1) 255 else 1;
    }

    /// Fractions of codes become linear light.
    fn linearize(reader: *Reader, colors: [][4]f32) void {
        const scale = reader.colorScale();
        const is_seen = for (colors) |color| {
            if (color[3] > 0) break true;
        } else false;
        reader.mesh.is_alpha_dropped = !is_seen and colors.len > 0;
        for (colors) |*color| {
            for (color[0..3]) |*channel| {
                const fraction = std.math.clamp(channel.* / scale, 0, 1);
                channel.* = math.flushDenormal(@floatCast(math.srgb.linear(fraction)));
            }
            const alpha = if (is_seen) std.math.clamp(color[3], 0, 1) else 1;
            color[3] = math.flushDenormal(alpha);
            if (alpha < 1) reader.mesh.has_alpha = true;
        }
    }

    /// Passes over a property that is not used.
    fn pass(reader: *Reader, property: Property) Error!void {
        const length: u32 = if (property.length_type) |type_|
            try reader.whole(type_, std.math.maxInt(i32), "the list's length")
        else
            1;
        for (0..length) |_| _ = try reader.scalar(property.type);
    }
};

/// A number in single precision; NaN where it has no finite one.
fn single(value: f64) f32 {
    if (!(@abs(value) <= std.math.floatMax(f32))) return std.math.nan(f32);
    return math.flushDenormal(@floatCast(value));
}

/// The mesh of a file, whose arrays come from `arena`.
pub fn read(
    gpa: Allocator,
    arena: Allocator,
    bytes: [:0]const u8,
    wants: Wants,
    reason: *Message,
) Error!Mesh {
    var reader: Reader = .{
        .gpa = gpa,
        .arena = arena,
        .bytes = bytes,
        .wants = wants,
        .reason = reason,
        .cutter = .{ .gpa = gpa, .steps_left = Polygon.stepsMax(bytes.len) },
    };
    defer reader.deinit();
    try reader.readHeader();
    for (reader.elements[0..reader.element_count]) |*element| {
        const kind = switch (element.kind) {
            .tristrips, .edge => |kind| if (wants.extras) kind else .other,
            else => |kind| kind,
        };
        switch (kind) {
            .vertex => try reader.readVertices(element),
            .face => try reader.readFaces(element),
            .tristrips => try reader.readStrips(element),
            .edge => try reader.readEdges(element),
            .other => {
                try reader.checkCount(element);
                for (0..@intCast(element.count)) |_| {
                    for (reader.propertiesOf(element)) |property| try reader.pass(property);
                }
            },
        }
    }
    return reader.finish();
}
