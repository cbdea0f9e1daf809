//! A stack of texts: the file that is read, the files that include it, and where we are.
//!
//! In: the first text, names of files to include. Out: a cursor over the top text, and errors and
//! warnings with file, line and column. Included files lie on a stack of our own, at most
//! `limits.include_depth_max` of them; none may include itself, however far around.

const std = @import("std");
const diagnostic_file = @import("../../diagnostic.zig");
const limits = @import("limits.zig");
const number = @import("../number.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = diagnostic_file.Diagnostic;
const Identity = @import("../../identity.zig").Identity;
const Resources = @import("../resource.zig");
const assert = std.debug.assert;
const printable = diagnostic_file.printable;
const quote = diagnostic_file.quote;

const Input = @This();

/// See parse.zig.
pub const Error = Resources.Error;

/// A text that is open.
const Text = struct {
    /// As messages call it. Owned, like the bytes, but for those of the first text.
    name: []const u8,
    bytes: [:0]const u8,
    cursor: usize = 0,
    /// Null for a text that is no file.
    identity: ?Identity,
};

gpa: Allocator,
resources: *Resources,
/// The path of the scene's folder as the user wrote it, for messages.
folder_name: []const u8,
diagnostic: *Diagnostic,
texts: std.ArrayList(Text) = .empty,
included_count: u32 = 0,
/// Where the directive that is read stands in the top text.
directive: usize = 0,
/// Hashes of the kinds of warnings that have been given.
warned: std.AutoHashMapUnmanaged(u64, void) = .empty,

/// Frees everything.
pub fn deinit(input: *Input) void {
    while (input.texts.items.len > 0) input.pop();
    input.texts.deinit(input.gpa);
    input.warned.deinit(input.gpa);
    input.* = undefined;
}

/// Reads from a file next; `name` is copied. The bytes of all but the first are taken over.
pub fn push(input: *Input, name: []const u8, file: Resources.File) Error!void {
    const copy = try input.gpa.dupe(u8, name);
    errdefer input.gpa.free(copy);
    const text: Text = .{ .name = copy, .bytes = file.bytes, .identity = file.identity };
    try input.texts.append(input.gpa, text);
}

/// Leaves the top text for the one that included it.
pub fn pop(input: *Input) void {
    const text = input.texts.pop().?;
    input.gpa.free(text.name);
    if (input.texts.items.len > 0) input.gpa.free(text.bytes);
}

/// The text that is read.
pub inline fn top(input: *const Input) *Text {
    return &input.texts.items[input.texts.items.len - 1];
}

/// Position of the next byte in the top text.
pub inline fn offset(input: *const Input) usize {
    return input.top().cursor;
}

/// Passes over white space and comments and returns the byte that follows, 0 at the end.
pub inline fn peek(input: *Input) u8 {
    const text = input.top();
    text.cursor = skip(text.bytes, text.cursor);
    return text.bytes[text.cursor];
}

/// Position of the first byte from `start` on that is neither white space nor within a comment.
pub inline fn skip(bytes: [:0]const u8, start: usize) usize {
    var index = start;
    while (true) {
        switch (bytes[index]) {
            ' ', '\n', '\t', '\r' => index += 1,
            '#' => while (bytes[index] != '\n' and index < bytes.len) {
                index += 1;
            },
            else => return index,
        }
    }
}

/// Whether the top text has nothing more to say.
pub fn atEnd(input: *Input) bool {
    _ = input.peek();
    return input.top().cursor == input.top().bytes.len;
}

/// Reads a bare word: a directive, or what stands in its place.
pub fn word(input: *Input) []const u8 {
    _ = input.peek();
    const text = input.top();
    const start = text.cursor;
    text.cursor = number.endOf(text.bytes, start);
    return text.bytes[start..text.cursor];
}

/// Reads a string in quotes, which the next byte opens; valid as long as the text is.
pub fn string(input: *Input) Error![]const u8 {
    const text = input.top();
    assert(text.bytes[text.cursor] == '"');
    const start = text.cursor + 1;
    var index = start;
    while (true) : (index += 1) switch (text.bytes[index]) {
        '"' => break,
        '\\' => if (text.bytes[index + 1] == '"') {
            index += 1;
        },
        '\n', 0 => return input.fail(text.cursor, "the string is not closed", .{}),
        else => {},
    };
    text.cursor = index + 1;
    return text.bytes[start..index];
}

/// Fails at `position` of the top text.
pub fn fail(
    input: *Input,
    position: usize,
    comptime format: []const u8,
    arguments: anytype,
) error{InvalidInput} {
    input.locate(position);
    return input.diagnostic.invalid(format, arguments);
}

/// Fails at the directive.
pub fn failHere(
    input: *Input,
    comptime format: []const u8,
    arguments: anytype,
) error{InvalidInput} {
    return input.fail(input.directive, format, arguments);
}

/// Says a warning about the directive, once for each `kind`.
pub fn warnHere(
    input: *Input,
    kind: []const u8,
    comptime format: []const u8,
    arguments: anytype,
) Allocator.Error!void {
    return input.warn(input.directive, kind, format, arguments);
}

/// Makes the diagnostic name `position` of the top text.
fn locate(input: *Input, position: usize) void {
    const text = input.top();
    const place = placeOf(text.bytes, position);
    input.diagnostic.place.set("{f}:{d}:{d}", .{
        printable(text.name), place.line, place.column,
    });
}

/// Says a warning about what stands at `position` of the top text, once for each `kind`.
pub fn warn(
    input: *Input,
    position: usize,
    kind: []const u8,
    comptime format: []const u8,
    arguments: anytype,
) Allocator.Error!void {
    const entry = try input.warned.getOrPut(input.gpa, std.hash.Wyhash.hash(0, kind));
    if (entry.found_existing) return;
    if (input.diagnostic.warning_count == diagnostic_file.warning_count_max) {
        // Not worth looking for its line.
        input.diagnostic.warning_dropped_count += 1;
        return;
    }
    const text = input.top();
    const line = placeOf(text.bytes, position).line;
    // The scene's own name stands before every warning about it.
    if (input.texts.items.len == 1) {
        input.diagnostic.warn("line {d}: " ++ format, .{line} ++ arguments);
        return;
    }
    // The end of a name says most where there is no room for all of it.
    const room = diagnostic_file.name_bytes_max;
    const name = text.name[text.name.len -| room..];
    input.diagnostic.warn("{f}:{d}: " ++ format, .{ printable(name), line } ++ arguments);
}

/// Line and column, from 1; the column counts bytes.
fn placeOf(bytes: []const u8, position: usize) struct { line: usize, column: usize } {
    const before = bytes[0..@min(position, bytes.len)];
    const line_start = if (std.mem.findScalarLast(u8, before, '\n')) |end| end + 1 else 0;
    return .{
        .line = std.mem.countScalar(u8, before, '\n') + 1,
        .column = before.len - line_start + 1,
    };
}

/// Goes on with the file that the string at `position` names, then returns here.
pub fn include(input: *Input, position: usize, path: []const u8) Error!void {
    if (input.texts.items.len >= limits.include_depth_max) return input.fail(
        position,
        "files include each other more than {d} deep",
        .{limits.include_depth_max},
    );
    input.included_count += 1;
    if (input.included_count > limits.include_count_max) return input.fail(
        position,
        "over {d} files are included",
        .{limits.include_count_max},
    );
    const file = try input.readFile(position, path);
    errdefer input.gpa.free(file.bytes);
    for (input.texts.items) |text| {
        if (!Identity.eql(text.identity, file.identity)) continue;
        return input.fail(position, "{f} includes itself", .{quote(path)});
    }
    const name = try std.fs.path.join(input.gpa, &.{ input.folder_name, path });
    defer input.gpa.free(name);
    try input.push(name, file);
}

/// Reads a file that the scene names at `position`. The caller frees its bytes.
pub fn readFile(input: *Input, position: usize, path: []const u8) Error!Resources.File {
    var reason: diagnostic_file.Message = .{};
    const file = input.resources.read(path, &reason) catch |err| {
        if (err == error.OutOfMemory) return err;
        input.fail(position, "{f} {s}", .{ quote(path), reason.text() }) catch {};
        return err;
    };
    errdefer input.gpa.free(file.bytes);
    if (input.resources.bytes_read > limits.text_bytes_max) return input.fail(
        position,
        "the files of the scene are over {d} bytes together",
        .{limits.text_bytes_max},
    );
    return file;
}

test placeOf {
    const text = "a\nbc\n\nd";
    inline for (.{ .{ 0, 1, 1 }, .{ 3, 2, 2 }, .{ 5, 3, 1 }, .{ 6, 4, 1 }, .{ 99, 4, 2 } }) |case| {
        const place = placeOf(text, case[0]);
        try std.testing.expectEqual(case[1], place.line);
        try std.testing.expectEqual(case[2], place.column);
    }
}

test "white space and comments are passed over, strings end on their line" {
    const gpa = std.testing.allocator;
    var diagnostic: Diagnostic = .{};
    var resources: Resources =
        .{ .gpa = gpa, .io = std.testing.io, .folder = .cwd(), .settings = .{} };
    var input: Input = .{
        .gpa = gpa,
        .resources = &resources,
        .folder_name = "",
        .diagnostic = &diagnostic,
    };
    defer input.deinit();
    const text = " # one \"\n\t\"a b\" word#two\n\"c\\\"d\" \"open\n\" #end";
    try input.push("x.pbrt", .{ .bytes = text, .identity = null });
    try std.testing.expectEqual('"', input.peek());
    try std.testing.expectEqualStrings("a b", try input.string());
    try std.testing.expectEqualStrings("word", input.word());
    try std.testing.expectEqual('"', input.peek());
    try std.testing.expectEqualStrings("c\\\"d", try input.string());
    try std.testing.expectEqual('"', input.peek());
    try std.testing.expectError(error.InvalidInput, input.string());
    try std.testing.expectEqualStrings("x.pbrt:3:8", diagnostic.place.text());
}
