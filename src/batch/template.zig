//! Names of pictures by a template: `{model}_{frame:4}.png`.
//!
//! In: a text with placeholders, and what stands for each. Out: the name of one picture.
//! `{frame:4}` fills up with zeros; `{{` and `}}` are the braces themselves. Names that come from
//! files are made parts of a path: no slash, nothing that a terminal obeys, no dot in front.

const std = @import("std");
const diagnostic = @import("../diagnostic.zig");
const Writer = std.Io.Writer;

/// What a placeholder may stand for.
pub const Field = enum {
    /// The scene file's name, without folder and extension.
    model,
    camera,
    material_variant,
    frame,
    view,
    layer,

    /// `{model}, {camera}, ...`, for messages.
    pub const list = list: {
        var text: []const u8 = "";
        for (std.enums.values(Field), 0..) |field, index| {
            if (index > 0) text = text ++ ", ";
            text = text ++ "{" ++ @tagName(field) ++ "}";
        }
        break :list text;
    };

    fn isNumber(field: Field) bool {
        return field == .frame or field == .view;
    }
};

/// What is wrong with a template.
pub const Fault = union(enum) {
    /// A placeholder by this name.
    unknown: []const u8,
    /// A width that is none from 1 to 9, or where there is no number to fill up.
    width: []const u8,
    /// A brace that opens or closes nothing.
    brace,
};

/// What stands for the placeholders of one picture.
pub const Values = struct {
    model: []const u8 = "",
    camera: []const u8 = "",
    material_variant: []const u8 = "",
    frame: i32 = 0,
    view: i32 = 0,
    layer: []const u8 = "",
};

/// Whether a name is a template, rather than the name itself.
pub fn isTemplate(text: []const u8) bool {
    return std.mem.findAny(u8, text, "{}") != null;
}

/// Null: nothing is wrong.
pub fn check(text: []const u8) ?Fault {
    var pieces: Pieces = .{ .rest = text };
    while (pieces.next()) |piece| switch (piece) {
        .fault => |fault| return fault,
        .text, .field => {},
    };
    return null;
}

/// Whether there is a placeholder for it.
pub fn holds(text: []const u8, field: Field) bool {
    var pieces: Pieces = .{ .rest = text };
    while (pieces.next()) |piece| switch (piece) {
        .field => |found| if (found.field == field) return true,
        .text, .fault => {},
    };
    return false;
}

/// Writes the name of a picture. Asserts that `check` finds nothing wrong.
pub fn write(text: []const u8, values: *const Values, writer: *Writer) Writer.Error!void {
    var pieces: Pieces = .{ .rest = text };
    while (pieces.next()) |piece| switch (piece) {
        .fault => unreachable,
        .text => |bytes| try writer.writeAll(bytes),
        .field => |found| switch (found.field) {
            .frame => try writeNumber(values.frame, found.width, writer),
            .view => try writeNumber(values.view, found.width, writer),
            inline else => |field| try writePart(@field(values, @tagName(field)), writer),
        },
    };
}

fn writeNumber(number: i32, width: usize, writer: *Writer) Writer.Error!void {
    var buffer: [12]u8 = undefined;
    const digits = std.mem.print(&buffer, "{d}", .{@abs(number)}) catch unreachable; // 10 at most.
    if (number < 0) try writer.writeByte('-');
    const taken = digits.len + @intFromBool(number < 0);
    try writer.splatByteAll('0', width -| taken);
    try writer.writeAll(digits);
}

/// Writes a name as a part of a path.
fn writePart(name: []const u8, writer: *Writer) Writer.Error!void {
    if (name.len == 0) return writer.writeByte('_');
    var buffer: [1024]u8 = undefined;
    const kept = name[0..@min(name.len, buffer.len)];
    var made: Writer = .fixed(&buffer);
    // What is replaced has one byte for one or more.
    made.print("{f}", .{diagnostic.printable(kept)}) catch unreachable;
    const part = made.buffered();
    if (part[0] == '.') part[0] = '_';
    for (part) |*byte| switch (byte.*) {
        '/', '\\', '?' => byte.* = '_',
        else => {},
    };
    try writer.writeAll(part);
}

const Piece = union(enum) {
    text: []const u8,
    field: struct { field: Field, width: usize },
    fault: Fault,
};

const Pieces = struct {
    rest: []const u8,

    fn next(pieces: *Pieces) ?Piece {
        const rest = pieces.rest;
        if (rest.len == 0) return null;
        const at = std.mem.findAny(u8, rest, "{}") orelse rest.len;
        if (at > 0) return pieces.take(at, .{ .text = rest[0..at] });
        if (rest.len > 1 and rest[1] == rest[0]) return pieces.take(2, .{ .text = rest[0..1] });
        const end = std.mem.findScalar(u8, rest, '}') orelse 0;
        if (end == 0) return pieces.take(rest.len, .{ .fault = .brace });
        return pieces.take(end + 1, pieceOf(rest[1..end]));
    }

    fn take(pieces: *Pieces, length: usize, piece: Piece) Piece {
        pieces.rest = pieces.rest[length..];
        return piece;
    }

    fn pieceOf(inside: []const u8) Piece {
        const colon = std.mem.findScalar(u8, inside, ':');
        const name = inside[0 .. colon orelse inside.len];
        const field = std.meta.stringToEnum(Field, name) orelse
            return .{ .fault = .{ .unknown = name } };
        const at = colon orelse return .{ .field = .{ .field = field, .width = 1 } };
        const digits = inside[at + 1 ..];
        const is_width = digits.len == 1 and digits[0] >= '1' and digits[0] <= '9';
        if (!is_width or !field.isNumber()) return .{ .fault = .{ .width = inside } };
        return .{ .field = .{ .field = field, .width = digits[0] - '0' } };
    }
};

const testing = std.testing;

fn expectName(expected: []const u8, text: []const u8, values: Values) !void {
    try testing.expectEqual(null, check(text));
    var buffer: [256]u8 = undefined;
    var writer: Writer = .fixed(&buffer);
    try write(text, &values, &writer);
    try testing.expectEqualStrings(expected, writer.buffered());
}

test "placeholders, numbers with zeros, braces" {
    try expectName("out/fox_0012.png", "out/{model}_{frame:4}.png", .{
        .model = "fox",
        .frame = 12,
    });
    try expectName("7-007-12345", "{view}-{view:3}-{frame:4}", .{ .view = 7, .frame = 12345 });
    try expectName("-3 -003 -2147483648", "{frame} {frame:4} {view}", .{
        .frame = -3,
        .view = std.math.minInt(i32),
    });
    try expectName("{model} a}", "{{model}} {model}}}", .{ .model = "a" });
    try expectName("plain.png", "plain.png", .{});
    try testing.expect(holds("{model}.png", .model) and !holds("{{frame}}", .frame));
    try testing.expect(isTemplate("a{") and !isTemplate("a.png"));
}

test "names of files do not leave the folder" {
    try expectName("_._etc_passwd", "{camera}", .{ .camera = "../etc/passwd" });
    try expectName("_hidden a_b é _", "{camera} {material_variant} {model} {layer}", .{
        .camera = ".hidden",
        .material_variant = "a\x1bb",
        .model = "é",
    });
}

test "what is no template" {
    try testing.expectEqualStrings("modle", check("{modle}.png").?.unknown);
    try testing.expectEqualStrings("", check("{}").?.unknown);
    for ([_][]const u8{ "{frame:}", "{frame:0}", "{frame:12}", "{model:3}", "{view:x}" }) |text|
        try testing.expectEqual(.width, std.meta.activeTag(check(text).?));
    for ([_][]const u8{ "{model", "a}", "{" }) |text|
        try testing.expectEqual(.brace, std.meta.activeTag(check(text).?));
    try testing.expect(std.mem.startsWith(u8, Field.list, "{model}, {camera}, "));
}
