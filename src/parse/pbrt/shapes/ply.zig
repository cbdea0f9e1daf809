//! PLY files: vertices with normals and coordinates of textures, triangles and polygons, as text or
//! binary of either order.
//!
//! In: the bytes of a file. Out: its mesh; polygons become fans. Nothing is allocated that the
//! length of the file does not explain: a value takes a byte at least, or two as text. Other
//! elements and properties are passed over. Format: Turk, "The PLY polygon file format" (1994).

const std = @import("std");
const math = @import("../../../math.zig");
const number = @import("../number.zig");
const quote = @import("../../../diagnostic.zig").quote;
const Input = @import("../input.zig");
const Tessellator = @import("tessellator.zig");
const Error = Input.Error;
const Geometry = Tessellator.Geometry;
const Vec3 = math.Vec3;

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

const type_names: std.StaticStringMap(Type) = .initComptime(.{
    .{ "char", .int8 },       .{ "uchar", .uint8 },    .{ "short", .int16 },
    .{ "ushort", .uint16 },   .{ "int", .int32 },      .{ "uint", .uint32 },
    .{ "float", .float32 },   .{ "double", .float64 }, .{ "int8", .int8 },
    .{ "uint8", .uint8 },     .{ "int16", .int16 },    .{ "uint16", .uint16 },
    .{ "int32", .int32 },     .{ "uint32", .uint32 },  .{ "float32", .float32 },
    .{ "float64", .float64 },
});

/// What we make of a property.
const Role = enum { x, y, z, nx, ny, nz, u, v, indices, other };

/// Other names of coordinates of textures.
const coordinate_names: std.StaticStringMap(Role) = .initComptime(.{
    .{ "s", .u },         .{ "t", .v },         .{ "texture_u", .u }, .{ "texture_v", .v },
    .{ "texture_s", .u }, .{ "texture_t", .v },
});

const Property = struct {
    role: Role,
    type: Type,
    /// Of a list: the type of its length.
    length_type: ?Type,
};

const Element = struct {
    const Kind = enum { vertex, face, other };

    kind: Kind,
    count: u64,
    first_property: usize,
    property_count: usize,
};

const Format = enum { ascii, binary_little_endian, binary_big_endian };

const property_count_max = 256;
const element_count_max = 64;

/// Most corners of a polygon.
const corner_count_max = 1 << 16;

const Reader = struct {
    tessellator: *Tessellator,
    name: []const u8,
    bytes: [:0]const u8,
    cursor: usize = 0,
    format: Format = .ascii,
    properties: [property_count_max]Property = undefined,
    property_count: usize = 0,
    elements: [element_count_max]Element = undefined,
    element_count: usize = 0,
    positions: []Vec3 = &.{},
    normals: ?[]Vec3 = null,
    texcoords: ?[][2]f32 = null,
    triangles: std.ArrayList([3]u32) = .empty,

    fn fail(reader: *Reader, comptime format: []const u8, arguments: anytype) error{InvalidInput} {
        return reader.tessellator.fail("{f}: " ++ format, .{quote(reader.name)} ++ arguments);
    }

    /// The next line of the header, without its end.
    fn line(reader: *Reader) Error![]const u8 {
        const rest = reader.bytes[reader.cursor..];
        const end = std.mem.findScalar(u8, rest, '\n') orelse
            return reader.fail("the PLY header does not end", .{});
        reader.cursor += end + 1;
        return std.mem.trimEnd(u8, rest[0..end], "\r \t");
    }

    fn readHeader(reader: *Reader) Error!void {
        if (!std.mem.eql(u8, try reader.line(), "ply")) return reader.fail("is no PLY file", .{});
        while (true) {
            var words = std.mem.tokenizeAny(u8, try reader.line(), " \t");
            const word = words.next() orelse continue;
            const Keyword = enum { format, comment, obj_info, element, property, end_header };
            switch (std.meta.stringToEnum(Keyword, word) orelse
                return reader.fail("the PLY header says {f}", .{quote(word)})) {
                .comment, .obj_info => {},
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
            .kind = std.meta.stringToEnum(Element.Kind, name) orelse .other,
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
        const is_list = length_type != null;
        var role = std.meta.stringToEnum(Role, name) orelse
            coordinate_names.get(name) orelse .other;
        if (role == .indices or is_list) role = .other;
        if (is_list and (std.mem.eql(u8, name, "vertex_indices") or
            std.mem.eql(u8, name, "vertex_index"))) role = .indices;
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
                        const value: Float = @bitCast(try reader.raw(Bits, endian));
                        if (!(@abs(value) <= std.math.floatMax(f32)))
                            return reader.fail("a number is not finite", .{});
                        return value;
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
        reader.cursor = Input.skip(reader.bytes, reader.cursor);
        if (reader.cursor == reader.bytes.len) return reader.fail("is cut short", .{});
        if (type_ == .float32 or type_ == .float64)
            return number.float(reader.bytes, &reader.cursor) catch
                reader.fail("a number is expected where something else stands", .{});
        const value = number.integer(reader.bytes, &reader.cursor) catch
            return reader.fail("a whole number is expected where something else stands", .{});
        return @floatFromInt(value);
    }

    /// The length of a list or an index: a whole number from 0 to `maximum`.
    fn whole(reader: *Reader, type_: Type, maximum: u32, what: []const u8) Error!u32 {
        const value = try reader.scalar(type_);
        if (value >= 0 and value <= @as(f64, @floatFromInt(maximum)) and value == @trunc(value))
            return @intFromFloat(value);
        return reader.fail("{s} {d} is not one of 0 to {d}", .{ what, value, maximum });
    }

    fn readVertices(reader: *Reader, element: *const Element) Error!void {
        if (reader.positions.len > 0) return reader.fail("has vertices twice", .{});
        try reader.checkCount(element);
        var has_normals = false;
        var has_texcoords = false;
        for (reader.propertiesOf(element)) |property| {
            if (property.role == .nx) has_normals = true;
            if (property.role == .u) has_texcoords = reader.tessellator.wants_texcoords;
        }
        const count = element.count;
        reader.positions = try reader.tessellator.alloc(Vec3, count);
        if (has_normals) reader.normals = try reader.tessellator.alloc(Vec3, count);
        if (has_texcoords) reader.texcoords = try reader.tessellator.alloc([2]f32, count);
        for (0..@intCast(count)) |index| {
            var values: [8]f32 = @splat(0);
            for (reader.propertiesOf(element)) |property| switch (property.role) {
                .indices, .other => try reader.pass(property),
                else => |role| {
                    const value: f32 = @floatCast(try reader.scalar(property.type));
                    values[@backingInt(role)] = math.flushDenormal(value);
                },
            };
            reader.positions[index] = values[0..3].*;
            if (reader.normals) |normals| normals[index] = values[3..6].*;
            if (reader.texcoords) |texcoords| {
                texcoords[index] = Tessellator.texcoordOf(values[6], values[7]);
            }
        }
    }

    fn readFaces(reader: *Reader, element: *const Element) Error!void {
        if (reader.positions.len == 0) return reader.fail("has faces before vertices", .{});
        try reader.checkCount(element);
        const gpa = reader.tessellator.input.gpa;
        const index_max: u32 = @intCast(reader.positions.len - 1);
        for (0..@intCast(element.count)) |_| {
            for (reader.propertiesOf(element)) |property| {
                if (property.role != .indices) {
                    try reader.pass(property);
                    continue;
                }
                const corner_count =
                    try reader.whole(property.length_type.?, corner_count_max, "the face's length");
                var corners: [3]u32 = undefined;
                for (0..corner_count) |corner| {
                    const index = try reader.whole(property.type, index_max, "index");
                    if (corner < 3) {
                        corners[corner] = index;
                    } else {
                        corners[1] = corners[2];
                        corners[2] = index;
                    }
                    if (corner >= 2) try reader.triangles.append(gpa, corners);
                }
            }
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

/// The mesh of `bytes`, which the scene calls `name`.
pub fn read(tessellator: *Tessellator, name: []const u8, bytes: [:0]const u8) Error!Geometry {
    var reader: Reader = .{ .tessellator = tessellator, .name = name, .bytes = bytes };
    defer reader.triangles.deinit(tessellator.input.gpa);
    try reader.readHeader();
    for (reader.elements[0..reader.element_count]) |*element| switch (element.kind) {
        .vertex => try reader.readVertices(element),
        .face => try reader.readFaces(element),
        .other => {
            try reader.checkCount(element);
            for (0..@intCast(element.count)) |_| {
                for (reader.propertiesOf(element)) |property| try reader.pass(property);
            }
        },
    };
    const triangles = try tessellator.alloc([3]u32, reader.triangles.items.len);
    @memcpy(triangles, reader.triangles.items);
    var result: Geometry = .{
        .positions = reader.positions,
        .normals = reader.normals,
        .texcoords = reader.texcoords,
        .triangles = triangles,
    };
    if (tessellator.wants_texcoords and result.texcoords == null)
        try tessellator.unshare(&result, Tessellator.triangle_corners);
    Tessellator.orient(&result);
    return result;
}

/// `filename`, relative to the scene's folder.
pub fn mesh(tessellator: *Tessellator) Error!Geometry {
    const parameter = tessellator.parameters.find("filename") orelse
        return tessellator.fail("has no filename", .{});
    const name = tessellator.parameters.string("filename") orelse
        return tessellator.fail("has no filename", .{});
    const file = try tessellator.input.readFile(parameter.offset, name);
    defer tessellator.input.gpa.free(file.bytes);
    return read(tessellator, name, file.bytes);
}
