//! Parameter lists: `"float radius" [1] "rgb Kd" [.5 .5 .5] "string name" "x"`.
//!
//! In: the cursor behind a directive. Out: its parameters by name, with typed values. The lists of
//! values are kept from directive to directive, so that only the longest allocates. Names and
//! strings point into the text.

const std = @import("std");
const quote = @import("../../diagnostic.zig").quote;
const limits = @import("limits.zig");
const number = @import("../number.zig");
const Input = @import("input.zig");
const Resources = @import("../resource.zig");
const Allocator = std.mem.Allocator;
const Error = Input.Error;
const Vec3 = @import("../../math.zig").Vec3;

const Parameters = @This();

/// What a parameter's values are. Spectra stand for themselves or name a file.
pub const Type = enum {
    integer,
    float,
    point2,
    vector2,
    point,
    vector,
    normal,
    rgb,
    xyz,
    blackbody,
    spectrum,
    string,
    bool,
    texture,

    /// How many numbers make one value.
    fn components(type_: Type) usize {
        return switch (type_) {
            .point2, .vector2 => 2,
            .point, .vector, .normal, .rgb, .xyz => 3,
            else => 1,
        };
    }
};

const type_names: std.StaticStringMap(Type) = .initComptime(.{
    .{ "integer", .integer }, .{ "float", .float },         .{ "point", .point },
    .{ "point2", .point2 },   .{ "point3", .point },        .{ "vector", .vector },
    .{ "vector2", .vector2 }, .{ "vector3", .vector },      .{ "normal", .normal },
    .{ "normal3", .normal },  .{ "color", .rgb },           .{ "rgb", .rgb },
    .{ "xyz", .xyz },         .{ "blackbody", .blackbody }, .{ "spectrum", .spectrum },
    .{ "string", .string },   .{ "bool", .bool },           .{ "texture", .texture },
});

/// One parameter; its values are a range of the list of their kind.
pub const Parameter = struct {
    type: Type,
    name: []const u8,
    /// Where it stands.
    offset: u64,
    /// Values are strings: of strings, textures, and spectra by name.
    is_text: bool,
    first: usize,
    count: usize,
    /// Somebody has asked for it, or none need to.
    is_read: bool = false,
};

items: std.ArrayList(Parameter) = .empty,
floats: std.ArrayList(f32) = .empty,
/// Integers, and booleans as 0 and 1.
integers: std.ArrayList(i32) = .empty,
strings: std.ArrayList([]const u8) = .empty,

/// Frees everything.
pub fn deinit(parameters: *Parameters, gpa: Allocator) void {
    parameters.items.deinit(gpa);
    parameters.floats.deinit(gpa);
    parameters.integers.deinit(gpa);
    parameters.strings.deinit(gpa);
    parameters.* = undefined;
}

/// Reads the list at the cursor, which replaces the one before.
pub fn read(parameters: *Parameters, input: *Input) Error!void {
    parameters.items.clearRetainingCapacity();
    parameters.floats.clearRetainingCapacity();
    parameters.integers.clearRetainingCapacity();
    parameters.strings.clearRetainingCapacity();
    while (try input.peekInList() == '"') {
        if (parameters.items.items.len == limits.parameter_count_max) return input.fail(
            input.offset(),
            "over {d} parameters",
            .{limits.parameter_count_max},
        );
        try parameters.readOne(input);
    }
}

fn readOne(parameters: *Parameters, input: *Input) Error!void {
    const offset = input.offset();
    const declaration = try input.string();
    var words = std.mem.tokenizeAny(u8, declaration, " \t");
    const type_name = words.next() orelse "";
    const name = words.next() orelse return input.fail(
        offset,
        "a parameter is declared as \"type name\", not as {f}",
        .{quote(declaration)},
    );
    const known = type_names.get(type_name);
    if (known == null) try input.forgive(
        offset,
        type_name,
        "{f} is no type of parameters: {f} is left out",
        .{ quote(type_name), quote(name) },
    );
    const bracketed = try input.peekInList() == '[';
    if (bracketed) input.top().cursor += 1;
    const first = try input.peekInList();
    const is_string = first == '"';
    const type_: Type = known orelse if (is_string)
        .string
    else if (first == 't' or first == 'f')
        .bool
    else
        .float;
    var parameter: Parameter = .{
        .type = type_,
        .name = name,
        .offset = offset,
        .is_text = type_ == .string or type_ == .texture or (type_ == .spectrum and is_string),
        .first = undefined,
        .count = undefined,
    };
    if (parameter.is_text) {
        parameter.first = parameters.strings.items.len;
        try parameters.readStrings(input, bracketed);
        parameter.count = parameters.strings.items.len - parameter.first;
    } else switch (type_) {
        .integer, .bool => {
            parameter.first = parameters.integers.items.len;
            if (type_ == .bool)
                try parameters.readBools(input, bracketed)
            else
                try readNumbers(i32, &parameters.integers, input, bracketed);
            parameter.count = parameters.integers.items.len - parameter.first;
        },
        else => {
            parameter.first = parameters.floats.items.len;
            try readNumbers(f32, &parameters.floats, input, bracketed);
            parameter.count = parameters.floats.items.len - parameter.first;
            if (parameter.count % type_.components() != 0) return input.fail(
                offset,
                "{d} numbers make no whole {s} values",
                .{ parameter.count, type_name },
            );
        },
    }
    if (bracketed) {
        if (input.peek() != ']') return input.fail(input.offset(), "']' is expected", .{});
        input.top().cursor += 1;
    }
    if (known != null) try parameters.items.append(input.gpa, parameter);
}

/// Numbers up to the bracket, or one. The inner loop of large scenes.
fn readNumbers(
    comptime Number: type,
    list: *std.ArrayList(Number),
    input: *Input,
    bracketed: bool,
) Error!void {
    var text = input.top();
    var bytes = text.bytes;
    var cursor = text.cursor;
    while (true) {
        if (bytes[cursor] <= ' ' or bytes[cursor] == '#') cursor = Input.skip(bytes, cursor);
        if (bytes[cursor] == ']' and bracketed) break;
        const value = (if (Number == f32)
            number.float(bytes, &cursor)
        else
            number.integer(bytes, &cursor)) catch |err| {
            text.cursor = cursor;
            const position = input.offset();
            _ = try input.peekInList();
            if (input.offset() != position) {
                // The end of an included text, or another one.
                text = input.top();
                bytes = text.bytes;
                cursor = text.cursor;
                continue;
            }
            if (Number == i32) if (try wholeNumber(input)) |value| {
                cursor = text.cursor;
                try list.append(input.gpa, value);
                if (!bracketed) break;
                continue;
            };
            return failNumber(input, err, if (Number == f32) "number" else "whole number");
        };
        if (list.items.len == list.capacity) try list.ensureUnusedCapacity(input.gpa, 1);
        list.appendAssumeCapacity(value);
        if (!bracketed) break;
    }
    text.cursor = cursor;
}

/// A whole number in the form of one that need not be, as versions 2 and 3 have them; null: it is
/// none.
fn wholeNumber(input: *Input) Error!?i32 {
    const text = input.top();
    var end = text.cursor;
    const value = number.float(text.bytes, &end) catch return null;
    // Those that f32 tells apart.
    if (value != @trunc(value) or @abs(value) > 1 << 24) return null;
    const word = text.bytes[text.cursor..end];
    try input.forgive(
        input.offset(),
        "whole number",
        "a whole number is expected, not {f}: its value counts",
        .{quote(word)},
    );
    text.cursor = end;
    return @intFromFloat(value);
}

/// Says what stands where a number should.
pub fn failNumber(input: *Input, err: number.Error, expected: []const u8) error{InvalidInput} {
    const position = input.offset();
    const bytes = input.top().bytes;
    const cursor = input.top().cursor;
    if (cursor == bytes.len) return input.fail(
        position,
        "a {s} is expected, the text ends",
        .{expected},
    );
    const word = bytes[cursor..@max(number.endOf(bytes, cursor), cursor + 1)];
    return switch (err) {
        error.NotANumber => input.fail(position, "a {s} is expected, not {f}", .{
            expected, quote(word),
        }),
        error.OutOfRange => input.fail(position, "{f} is out of range", .{quote(word)}),
    };
}

/// Booleans are words, or strings in the older dialects.
fn readBools(parameters: *Parameters, input: *Input, bracketed: bool) Error!void {
    while (true) {
        const byte = try input.peekInList();
        if (bracketed and byte == ']') return;
        const offset = input.offset();
        const word = if (byte == '"') try input.string() else input.word();
        const value: i32 = if (std.mem.eql(u8, word, "true"))
            1
        else if (std.mem.eql(u8, word, "false"))
            0
        else
            try spelledBool(input, offset, word);
        try parameters.integers.append(input.gpa, value);
        if (!bracketed) return;
    }
}

/// What other languages call true or false.
fn spelledBool(input: *Input, offset: u64, word: []const u8) Error!i32 {
    const value: i32 = for ([_][]const u8{ "0", "false", "1", "true" }, 0..) |name, index| {
        if (std.ascii.eqlIgnoreCase(word, name)) break @intCast(index / 2);
    } else return input.fail(offset, "true or false is expected, not {f}", .{quote(word)});
    const message = "true or false is expected, not {f}: its value counts";
    try input.forgive(offset, "bool", message, .{quote(word)});
    return value;
}

fn readStrings(parameters: *Parameters, input: *Input, bracketed: bool) Error!void {
    while (true) {
        const byte = try input.peekInList();
        if (bracketed and byte == ']') return;
        if (byte != '"') return input.fail(input.offset(), "a string is expected", .{});
        try parameters.strings.append(input.gpa, try input.string());
        if (!bracketed) return;
    }
}

/// A copy that outlives the text, all of it from `arena`.
pub fn clone(parameters: *const Parameters, arena: Allocator) Allocator.Error!Parameters {
    const copy: Parameters = .{
        .items = try parameters.items.clone(arena),
        .floats = try parameters.floats.clone(arena),
        .integers = try parameters.integers.clone(arena),
        .strings = try parameters.strings.clone(arena),
    };
    for (copy.items.items) |*item| item.name = try arena.dupe(u8, item.name);
    for (copy.strings.items) |*text| text.* = try arena.dupe(u8, text.*);
    return copy;
}

/// Adds what others have by names that are not here; messages about it name `position`.
pub fn addMissing(
    parameters: *Parameters,
    gpa: Allocator,
    others: *const Parameters,
    position: u64,
) Allocator.Error!void {
    var index = others.items.items.len;
    while (index > 0 and parameters.items.items.len < limits.parameter_count_max) {
        index -= 1;
        const item = others.items.items[index];
        if (parameters.find(item.name) != null) continue;
        var added = item;
        added.offset = position;
        added.is_read = true;
        if (item.is_text) {
            added.first = parameters.strings.items.len;
            try parameters.strings.appendSlice(gpa, others.stringsOf(&item));
        } else if (item.type == .integer or item.type == .bool) {
            added.first = parameters.integers.items.len;
            try parameters.integers.appendSlice(gpa, others.integersOf(&item));
        } else {
            added.first = parameters.floats.items.len;
            try parameters.floats.appendSlice(gpa, others.floatsOf(&item));
        }
        try parameters.items.append(gpa, added);
    }
}

/// Nobody needs to ask for any: all of it is left out, or replaced.
pub fn pass(parameters: *const Parameters) void {
    for (parameters.items.items) |*item| item.is_read = true;
}

/// Says which ones nobody has asked for, but for those that change nothing of what is seen.
pub fn warnOfUnread(
    parameters: *const Parameters,
    input: *Input,
    directive: []const u8,
) Error!void {
    for (parameters.items.items) |*item| {
        if (item.is_read or unseen.has(item.name)) continue;
        var kind: [256]u8 = undefined;
        try input.warn(
            item.offset,
            std.mem.print(&kind, "{s} {s}", .{ directive, item.name }) catch item.name,
            "{s}: {f} is not read",
            .{ directive, quote(item.name) },
        );
    }
}

/// Parameters of how PBRT makes its picture, and those that only some values of others ask for.
const unseen: std.StaticStringMap(void) = .initComptime(names: {
    const list = "S diagonal difftrans display edgelength faceIndices filename filter " ++
        "focaldistance mapname maxanisotropy maxcomponentvalue maxdepth maxsampleluminance " ++
        "meanfreepath mfp nsamples pixelbounds remaproughness samples savefp16 scheme " ++
        "shutterclose shutteropen splitdepth st trilinear uv";
    @setEvalBranchQuota(10_000);
    var rows: []const struct { []const u8 } = &.{};
    var words = std.mem.tokenizeScalar(u8, list, ' ');
    while (words.next()) |word| rows = rows ++ .{.{word}};
    break :names rows;
});

/// The parameter of that name, the last one where it stands twice.
pub fn find(parameters: *const Parameters, name: []const u8) ?*const Parameter {
    var found: ?*const Parameter = null;
    for (parameters.items.items) |*parameter| {
        if (!std.mem.eql(u8, parameter.name, name)) continue;
        parameter.is_read = true;
        found = parameter;
    }
    return found;
}

/// Its numbers, none where it is made of others or of strings.
pub fn floatsOf(parameters: *const Parameters, parameter: *const Parameter) []const f32 {
    if (parameter.is_text or parameter.type == .integer or parameter.type == .bool) return &.{};
    return parameters.floats.items[parameter.first..][0..parameter.count];
}

/// Its whole numbers or booleans, none where it is made of others.
pub fn integersOf(parameters: *const Parameters, parameter: *const Parameter) []const i32 {
    if (parameter.type != .integer and parameter.type != .bool) return &.{};
    return parameters.integers.items[parameter.first..][0..parameter.count];
}

/// Its strings, none where it is made of numbers.
pub fn stringsOf(parameters: *const Parameters, parameter: *const Parameter) []const []const u8 {
    if (!parameter.is_text) return &.{};
    return parameters.strings.items[parameter.first..][0..parameter.count];
}

/// The numbers of that name, null where it is absent or holds none.
pub fn floatsNamed(parameters: *const Parameters, name: []const u8) ?[]const f32 {
    const values = parameters.floatsOf(parameters.find(name) orelse return null);
    return if (values.len > 0) values else null;
}

/// One number, whole or not, or `default` where it is absent.
pub fn float(parameters: *const Parameters, name: []const u8, default: f32) f32 {
    const parameter = parameters.find(name) orelse return default;
    const floats = parameters.floatsOf(parameter);
    if (floats.len > 0) return floats[0];
    const integers = parameters.integersOf(parameter);
    return if (integers.len > 0) @floatFromInt(integers[0]) else default;
}

/// One whole number, or null where it is absent.
pub fn integer(parameters: *const Parameters, name: []const u8) ?i32 {
    const values = parameters.integersOf(parameters.find(name) orelse return null);
    return if (values.len > 0) values[0] else null;
}

/// A truth, or `default` where it is absent.
pub fn boolean(parameters: *const Parameters, name: []const u8, default: bool) bool {
    return (parameters.integer(name) orelse return default) != 0;
}

/// One string, or null where it is absent.
pub fn string(parameters: *const Parameters, name: []const u8) ?[]const u8 {
    const values = parameters.stringsOf(parameters.find(name) orelse return null);
    return if (values.len > 0) values[0] else null;
}

/// One point or direction, or `default` where it is absent.
pub fn vector(parameters: *const Parameters, name: []const u8, default: Vec3) Vec3 {
    const values = parameters.floatsNamed(name) orelse return default;
    return if (values.len >= 3) values[0..3].* else default;
}

const TestInput = struct {
    diagnostic: @import("../../diagnostic.zig").Diagnostic = .{},
    resources: Resources =
        .{ .gpa = std.testing.allocator, .io = std.testing.io, .folder = .cwd(), .settings = .{} },
    input: Input = undefined,
    parameters: Parameters = .{},

    fn parse(state: *TestInput, text: [:0]const u8) !void {
        state.input = .{
            .gpa = state.resources.gpa,
            .resources = &state.resources,
            .folder_name = "",
            .diagnostic = &state.diagnostic,
        };
        errdefer state.deinit();
        try state.input.push("x", .{ .bytes = text, .identity = null });
        try state.parameters.read(&state.input);
    }

    fn deinit(state: *TestInput) void {
        state.input.deinit();
        state.parameters.deinit(std.testing.allocator);
    }
};

test "every type, with and without brackets" {
    var state: TestInput = .{};
    try state.parse(
        \\"integer n" [1 -2] # a comment
        \\"float f" 1.5 "float g" [2] "point3 P" [0 0 0  1 2 3] "bool a" "true" "bool b" [false]
        \\"string s" "x y" "texture t" ["u"] "spectrum file" "a.spd" "spectrum list" [400 1 500 2]
        \\"rgb c" [.1 .2 .3] "normal N" [] "blackbody bb" [2700] "xyz x" [1 1 1] Shape
    );
    defer state.deinit();
    const p = &state.parameters;
    try std.testing.expectEqualSlices(i32, &.{ 1, -2 }, p.integersOf(p.find("n").?));
    try std.testing.expectEqual(1.5, p.float("f", 0));
    try std.testing.expectEqual(2, p.float("g", 0));
    try std.testing.expectEqual(1, p.float("n", 0));
    try std.testing.expectEqual(7, p.float("absent", 7));
    try std.testing.expectEqual(6, p.floatsNamed("P").?.len);
    try std.testing.expect(p.boolean("a", false) and !p.boolean("b", true));
    try std.testing.expectEqualStrings("x y", p.string("s").?);
    try std.testing.expectEqualStrings("u", p.string("t").?);
    try std.testing.expectEqualStrings("a.spd", p.string("file").?);
    try std.testing.expectEqual(4, p.floatsNamed("list").?.len);
    try std.testing.expectEqual(Vec3{ 0.1, 0.2, 0.3 }, p.vector("c", .{ 0, 0, 0 }));
    try std.testing.expectEqual(null, p.floatsNamed("N"));
    try std.testing.expectEqualStrings("Shape", state.input.word());
}

test "types and values that versions of PBRT, or none, have otherwise are forgiven" {
    var state: TestInput = .{};
    try state.parse(
        \\"integer i" [1 2.0 -3e0 4] "integer n" 16. "bool a" "True" "bool b" 0
        \\"half f" [1 2] "color4 c" "x" "flag g" true "float last" 7 Shape
    );
    defer state.deinit();
    const p = &state.parameters;
    try std.testing.expectEqualSlices(i32, &.{ 1, 2, -3, 4 }, p.integersOf(p.find("i").?));
    try std.testing.expectEqual(16, p.integer("n"));
    try std.testing.expect(p.boolean("a", false) and !p.boolean("b", true));
    for ([_][]const u8{ "f", "c", "g" }) |name|
        try std.testing.expectEqual(null, p.find(name));
    try std.testing.expectEqual(7, p.float("last", 0));
    try std.testing.expectEqualStrings("Shape", state.input.word());
    // Once a kind: whole numbers, truths, and each type.
    try std.testing.expectEqual(5, state.diagnostic.warning_count);
}

test "what is wrong is named with its place" {
    const cases = .{
        .{ "\"float\" [1]", "x:1:1", "a parameter is declared as \"type name\", not as 'float'" },
        .{ "\"half f\" [1]", "x:1:1", "'half' is no type of parameters: 'f' is left out" },
        .{ "\"integer i\" 2.", "x:1:13", "a whole number is expected, not '2.': its value counts" },
        .{ "\"bool b\" True", "x:1:10", "true or false is expected, not 'True': its value counts" },
        .{ "\"float f\" [nan]", "x:1:12", "a number is expected, not 'nan'" },
        .{ "\"float f\" [1", "x:1:13", "a number is expected, the text ends" },
        .{ "\"float f\" 1e99", "x:1:11", "'1e99' is out of range" },
        .{ "\"integer i\" [0\n1.5]", "x:2:1", "a whole number is expected, not '1.5'" },
        .{ "\"point P\" [1 2]", "x:1:1", "2 numbers make no whole point values" },
        .{ "\"string s\" [1]", "x:1:13", "a string is expected" },
        .{ "\"bool b\" maybe", "x:1:10", "true or false is expected, not 'maybe'" },
        .{ "\"float f\" [1 \"a\"]", "x:1:14", "a number is expected, not '\"'" },
    };
    inline for (cases) |case| {
        var state: TestInput = .{};
        state.resources.settings.strict = true;
        try std.testing.expectError(error.InvalidInput, state.parse(case[0]));
        try std.testing.expectEqualStrings(case[1], state.diagnostic.place.text());
        try std.testing.expectEqualStrings(case[2], state.diagnostic.message.text());
    }
}
