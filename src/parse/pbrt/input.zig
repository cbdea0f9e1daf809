//! The texts of a scene: the file that is read, the files that wait for it, and where we are.
//!
//! In: the first text, names of files to include. Out: a cursor over the top text, and errors and
//! warnings with file, line and column. Included files lie on a stack of our own, at most
//! `limits.include_depth_max` of them; none may include itself, however far around.

const std = @import("std");
const diagnostic_file = @import("../../diagnostic.zig");
const file_reader = @import("../file.zig");
const limits = @import("limits.zig");
const number = @import("number.zig");
const uri = @import("../uri.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = diagnostic_file.Diagnostic;
const Identity = @import("../../identity.zig").Identity;
const Settings = @import("../../settings.zig").Load;
const assert = std.debug.assert;
const printable = diagnostic_file.printable;
const quote = diagnostic_file.quote;

const Input = @This();

/// See parse.zig.
pub const Error = error{ OutOfMemory, InputOutput, InvalidInput };

/// A text that is open.
const Text = struct {
    /// As messages call it. Owned, like the bytes.
    name: []const u8,
    bytes: [:0]const u8,
    cursor: usize = 0,
    /// Tells files apart; null for a text that is none.
    identity: ?Identity,
};

gpa: Allocator,
io: std.Io,
/// Folder of the scene, to which all names are relative, as in PBRT.
folder: std.Io.Dir,
/// The path of that folder as the user wrote it, for messages.
folder_name: []const u8,
settings: Settings,
diagnostic: *Diagnostic,
texts: std.ArrayList(Text) = .empty,
included_count: u32 = 0,
/// Bytes of all texts and data files so far.
bytes_read: u64 = 0,
/// Kinds of warnings that have been said.
said: std.AutoHashMapUnmanaged(u64, void) = .empty,

/// Frees everything.
pub fn deinit(input: *Input) void {
    while (input.texts.items.len > 0) input.pop();
    input.texts.deinit(input.gpa);
    input.said.deinit(input.gpa);
    input.* = undefined;
}

/// Reads from `bytes` next, which it takes over in any case; `name` is copied.
pub fn push(input: *Input, name: []const u8, bytes: [:0]u8, identity: ?Identity) Error!void {
    errdefer input.gpa.free(bytes);
    const copy = try input.gpa.dupe(u8, name);
    errdefer input.gpa.free(copy);
    try input.texts.append(input.gpa, .{ .name = copy, .bytes = bytes, .identity = identity });
}

/// Leaves the top text for the one that included it.
pub fn pop(input: *Input) void {
    const text = input.texts.pop().?;
    input.gpa.free(text.name);
    input.gpa.free(text.bytes);
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
    return input.diagnostic.fail(error.InvalidInput, format, arguments);
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
    const entry = try input.said.getOrPut(input.gpa, std.hash.Wyhash.hash(0, kind));
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
    var identity: ?Identity = null;
    const bytes = try input.readFile(position, path, &identity);
    for (input.texts.items) |text| {
        if (!Identity.eql(text.identity, identity)) continue;
        input.gpa.free(bytes);
        return input.fail(position, "{f} includes itself", .{quote(path)});
    }
    const name = std.fs.path.join(input.gpa, &.{ input.folder_name, path }) catch |err| {
        input.gpa.free(bytes);
        return err;
    };
    defer input.gpa.free(name);
    try input.push(name, bytes, identity);
}

/// Reads a file that the scene names at `position`: a regular one within the scene's folder, if
/// the user does not allow others. The caller frees it. `identity`, where given, tells it apart.
pub fn readFile(
    input: *Input,
    position: usize,
    path: []const u8,
    identity: ?*?Identity,
) Error![:0]u8 {
    const name = quote(path);
    if (path.len == 0 or std.mem.findScalar(u8, path, 0) != null)
        return input.fail(position, "{f} is not a valid path", .{name});
    if (!input.settings.allow_outside and uri.leavesFolder(path)) return input.fail(
        position,
        "{f} is outside the scene's folder (see --allow-outside)",
        .{name},
    );
    var reason: []const u8 = "";
    const output = input.settings.output;
    const opened = file_reader.open(input.io, input.folder, path, output, &reason) catch |err|
        return input.failFile(position, err, name, reason);
    defer opened.close(input.io);
    if (!input.settings.allow_outside and !input.isBelow(opened)) return input.fail(
        position,
        "{f} is a link that leads outside the scene's folder (see --allow-outside)",
        .{name},
    );
    if (identity) |to| to.* = .of(opened.handle);
    const bytes = file_reader.readTerminated(
        input.gpa,
        input.io,
        opened,
        limits.file_bytes_max,
        &reason,
    ) catch |err| return input.failFile(position, err, name, reason);
    errdefer input.gpa.free(bytes);
    input.bytes_read += bytes.len;
    if (input.bytes_read > limits.text_bytes_max) return input.fail(
        position,
        "the files of the scene are over {d} bytes together",
        .{limits.text_bytes_max},
    );
    return bytes;
}

fn failFile(
    input: *Input,
    position: usize,
    err: file_reader.Error,
    name: diagnostic_file.Quoted,
    reason: []const u8,
) Error {
    if (err == error.OutOfMemory) return error.OutOfMemory;
    const invalid = input.fail(position, "{f} {s}", .{ name, reason });
    return if (err == error.InputOutput) error.InputOutput else invalid;
}

/// Links may lead out of the folder as well; the open file says where it really is.
fn isBelow(input: *Input, opened: std.Io.File) bool {
    var folder_buffer: [file_reader.path_bytes_max]u8 = undefined;
    var file_buffer: [file_reader.path_bytes_max]u8 = undefined;
    const folder_length = input.folder.realPath(input.io, &folder_buffer) catch return false;
    const file_length = opened.realPath(input.io, &file_buffer) catch return false;
    return uri.isBelow(file_buffer[0..file_length], folder_buffer[0..folder_length]);
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
    var input: Input = .{
        .gpa = gpa,
        .io = std.testing.io,
        .folder = .cwd(),
        .folder_name = "",
        .settings = .{},
        .diagnostic = &diagnostic,
    };
    defer input.deinit();
    const text = " # one \"\n\t\"a b\" word#two\n\"c\\\"d\" \"open\n\" #end";
    try input.push("x.pbrt", try gpa.dupeSentinel(u8, text, 0), null);
    try std.testing.expectEqual('"', input.peek());
    try std.testing.expectEqualStrings("a b", try input.string());
    try std.testing.expectEqualStrings("word", input.word());
    try std.testing.expectEqual('"', input.peek());
    try std.testing.expectEqualStrings("c\\\"d", try input.string());
    try std.testing.expectEqual('"', input.peek());
    try std.testing.expectError(error.InvalidInput, input.string());
    try std.testing.expectEqualStrings("x.pbrt:3:8", diagnostic.place.text());
}
