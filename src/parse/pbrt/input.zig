//! A stack of texts: the file that is read, the files that include it, and where we are.
//!
//! In: the first text, names of files to include. Out: a cursor over one text that they make
//! together, and errors and warnings with file, line and column. Included files lie on a stack of
//! our own, at most `limits.include_depth_max` of them; none may include itself, however far
//! around.
//!
//! An included text stands in its Include's place, in the middle of a directive too: what goes on
//! behind its end does so behind the Include. Texts that have ended stay until the directive has,
//! for its strings point into them. A position is a number for a byte of any text.

const std = @import("std");
const diagnostic_file = @import("../../diagnostic.zig");
const gzip = @import("../../decode.zig").gzip;
const limits = @import("limits.zig");
const number = @import("../number.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = diagnostic_file.Diagnostic;
const Identity = @import("../../identity.zig").Identity;
const Progress = @import("../../progress.zig").Progress;
const Resources = @import("../resource.zig");
const markBytes = @import("../format.zig").markBytes;
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
    /// Position of its first byte.
    start: u64,
    /// What follows is not read as if it belonged to it.
    is_apart: bool,
};

gpa: Allocator,
resources: *Resources,
/// The path of the scene's folder as the user wrote it, for messages.
folder_name: []const u8,
diagnostic: *Diagnostic,
texts: std.ArrayList(Text) = .empty,
/// Those that have ended in the directive that is read. There is always room for all.
ended: std.ArrayList(Text) = .empty,
/// Position of the next text.
next_start: u64 = 0,
included_count: u32 = 0,
/// Where the directive that is read stands.
directive: u64 = 0,
/// Hashes of the kinds of warnings that have been given.
warned: std.AutoHashMapUnmanaged(u64, void) = .empty,

/// Frees everything.
pub fn deinit(input: *Input) void {
    while (input.texts.items.len > 0) input.pop();
    input.freeEnded();
    input.texts.deinit(input.gpa);
    input.ended.deinit(input.gpa);
    input.warned.deinit(input.gpa);
    input.* = undefined;
}

/// Reads from a file next; `name` is copied. The bytes of all but the first are taken over.
pub fn push(input: *Input, name: []const u8, file: Resources.File) Error!void {
    return input.pushText(name, file, false);
}

fn pushText(input: *Input, name: []const u8, file: Resources.File, is_apart: bool) Error!void {
    try input.ended.ensureTotalCapacity(
        input.gpa,
        input.ended.items.len + input.texts.items.len + 1,
    );
    const copy = try input.gpa.dupe(u8, name);
    errdefer input.gpa.free(copy);
    try input.texts.append(input.gpa, .{
        .name = copy,
        .bytes = file.bytes,
        .identity = file.identity,
        .start = input.next_start,
        .is_apart = is_apart,
    });
    input.next_start += @as(u64, file.bytes.len) + 1;
}

/// Passes over what may stand before the top text.
pub fn start(input: *Input) Error!void {
    const text = input.top();
    for ([_][]const u8{ "\xff\xfe", "\xfe\xff" }) |mark| {
        if (std.mem.startsWith(u8, text.bytes, mark))
            return input.fail(text.start, "is in UTF-16, not in UTF-8", .{});
    }
    text.cursor = markBytes(text.bytes);
    if (text.cursor == 0) return;
    try input.forgive(text.start, "mark", "a byte order mark (BOM) is passed over", .{});
}

/// Leaves the top text for the one that included it.
pub fn pop(input: *Input) void {
    input.ended.appendAssumeCapacity(input.texts.pop().?);
}

/// Makes the position the directive's, and frees what the one before has left.
pub fn beginDirective(input: *Input) void {
    input.freeEnded();
    input.directive = input.offset();
    Progress.reach(input.resources.settings.progress, input.directive, input.next_start);
}

fn freeEnded(input: *Input) void {
    while (input.ended.pop()) |text| {
        input.gpa.free(text.name);
        if (text.start > 0) input.gpa.free(text.bytes);
    }
}

/// The text that is read.
pub inline fn top(input: *const Input) *Text {
    return &input.texts.items[input.texts.items.len - 1];
}

/// Position of the next byte.
pub inline fn offset(input: *const Input) u64 {
    const text = input.top();
    return text.start + text.cursor;
}

/// Passes over white space and comments, and over the ends of included texts, and returns the byte
/// that follows, 0 at the end.
pub inline fn peek(input: *Input) u8 {
    const text = input.top();
    text.cursor = skip(text.bytes, text.cursor);
    const byte = text.bytes[text.cursor];
    return if (byte == 0) input.peekBelow() else byte;
}

fn peekBelow(input: *Input) u8 {
    while (true) {
        const text = input.top();
        text.cursor = skip(text.bytes, text.cursor);
        if (text.cursor < text.bytes.len or input.texts.items.len == 1 or text.is_apart)
            return text.bytes[text.cursor];
        input.pop();
    }
}

/// As `peek`, within a list: a file whose Include stands there is read in its place.
pub fn peekInList(input: *Input) Error!u8 {
    while (true) {
        const byte = input.peek();
        if (byte != 'I') return byte;
        const text = input.top();
        const end = number.endOf(text.bytes, text.cursor);
        if (!std.mem.eql(u8, text.bytes[text.cursor..end], "Include")) return byte;
        text.cursor = end;
        try input.includeNext(false);
    }
}

/// Index of the first byte from `from` on that is neither white space nor within a comment.
pub inline fn skip(bytes: [:0]const u8, from: usize) usize {
    var index = from;
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

/// Whether the top text, and what includes it, have nothing more to say.
pub fn atEnd(input: *Input) bool {
    _ = input.peek();
    return input.top().cursor == input.top().bytes.len;
}

/// Reads a bare word: a directive, or what stands in its place.
pub fn word(input: *Input) []const u8 {
    _ = input.peek();
    const text = input.top();
    const first = text.cursor;
    text.cursor = number.endOf(text.bytes, first);
    return text.bytes[first..text.cursor];
}

/// Reads a string in quotes, which the next byte opens; valid as long as the directive is read.
pub fn string(input: *Input) Error![]const u8 {
    const text = input.top();
    assert(text.bytes[text.cursor] == '"');
    const first = text.cursor + 1;
    var index = first;
    while (true) : (index += 1) switch (text.bytes[index]) {
        '"' => break,
        '\\' => if (text.bytes[index + 1] == '"') {
            index += 1;
        },
        '\n', 0 => return input.fail(input.offset(), "the string is not closed", .{}),
        else => {},
    };
    text.cursor = index + 1;
    return text.bytes[first..index];
}

/// A string that has to stand there, and its position.
pub fn expectString(input: *Input) Error!struct { u64, []const u8 } {
    if (input.peek() != '"') return input.fail(input.offset(), "a string is expected", .{});
    return .{ input.offset(), try input.string() };
}

/// Fails at a position.
pub fn fail(
    input: *Input,
    position: u64,
    comptime format: []const u8,
    arguments: anytype,
) error{InvalidInput} {
    const text = input.textAt(position);
    const place = placeOf(text.bytes, position - text.start);
    input.diagnostic.place.set("{f}:{d}:{d}", .{
        printable(text.name), place.line, place.column,
    });
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

/// Says what PBRT refuses and the picture can do without, once for each `kind`: a warning, with
/// `--strict` an error.
pub fn forgive(
    input: *Input,
    position: u64,
    kind: []const u8,
    comptime format: []const u8,
    arguments: anytype,
) Error!void {
    if (!input.resources.settings.strict) return input.warn(position, kind, format, arguments);
    return input.fail(position, format, arguments);
}

/// The same about the file that the user named, as a whole.
pub fn forgiveFile(
    input: *Input,
    comptime format: []const u8,
    arguments: anytype,
) error{InvalidInput}!void {
    if (input.resources.settings.strict)
        return input.diagnostic.invalid(format, arguments);
    input.diagnostic.warn(format, arguments);
}

/// How a warning names a position.
pub fn nameOf(input: *const Input, arena: Allocator, position: u64) Allocator.Error![]u8 {
    const text = input.textAt(position);
    const line = placeOf(text.bytes, position - text.start).line;
    // The scene's own name stands before every warning about it.
    if (text.start == 0) return arena.print("line {d}", .{line});
    // The end of a name says most where there is no room for all of it.
    const name = text.name[text.name.len -| diagnostic_file.name_bytes_max..];
    return arena.print("{f}:{d}", .{ printable(name), line });
}

/// The text that has a position. It is one that is read, or has ended in this directive.
fn textAt(input: *const Input, position: u64) *const Text {
    for ([_][]const Text{ input.texts.items, input.ended.items }) |list| for (list) |*text| {
        if (position >= text.start and position <= text.start + text.bytes.len) return text;
    };
    unreachable;
}

/// Says a warning about what stands at a position, once for each `kind`.
pub fn warn(
    input: *Input,
    position: u64,
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
    const place = try input.nameOf(input.gpa, position);
    defer input.gpa.free(place);
    input.diagnostic.warn("{s}: " ++ format, .{place} ++ arguments);
}

/// Line and column, from 1; the column counts bytes.
fn placeOf(bytes: []const u8, index: u64) struct { line: usize, column: usize } {
    const before = bytes[0..@intCast(@min(index, bytes.len))];
    const line_start = if (std.mem.findScalarLast(u8, before, '\n')) |end| end + 1 else 0;
    return .{
        .line = std.mem.countScalar(u8, before, '\n') + 1,
        .column = before.len - line_start + 1,
    };
}

/// Goes on with the file that the string which follows names, then returns behind it. Where it
/// `is_apart`, its end is one for `peek`, and `pop` is the caller's.
pub fn includeNext(input: *Input, is_apart: bool) Error!void {
    const position, const path = try input.expectString();
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
    {
        errdefer input.gpa.free(file.bytes);
        for (input.texts.items) |text| {
            if (!Identity.eql(text.identity, file.identity)) continue;
            return input.fail(position, "{f} includes itself", .{quote(path)});
        }
        const name = try std.fs.path.join(input.gpa, &.{ input.folder_name, path });
        defer input.gpa.free(name);
        try input.pushText(name, file, is_apart);
    }
    try input.start();
}

/// Reads a file that the scene names at `position`, and what gzip has made of it. The caller frees
/// its bytes.
pub fn readFile(input: *Input, position: u64, path: []const u8) Error!Resources.File {
    var reason: diagnostic_file.Message = .{};
    var buffer: [path_bytes_max]u8 = undefined;
    const found = try input.slashed(position, path, &buffer);
    const file = input.resources.read(found, &reason) catch |err| {
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
    if (!gzip.isGzip(file.bytes)) return file;
    if (!std.ascii.endsWithIgnoreCase(path, ".gz"))
        try input.forgive(position, "gzip", "{f} is gzip without being called so", .{quote(path)});
    const left = limits.text_bytes_max -| input.resources.bytes_read;
    const plain = input.resources.inflate(file.bytes, left, &reason) catch |err| switch (err) {
        error.OutOfMemory => |failure| return failure,
        error.InvalidGzip => return input.fail(position, "{f} {s}", .{
            quote(path), reason.text(),
        }),
    };
    input.gpa.free(file.bytes);
    return .{ .bytes = plain, .identity = file.identity };
}

/// Longest path whose backslashes are taken for slashes.
pub const path_bytes_max = 4096;

/// The path that the scene names at `position`, as it is here: on Windows, backslashes separate.
pub fn slashed(
    input: *Input,
    position: u64,
    path: []const u8,
    buffer: *[path_bytes_max]u8,
) Error![]const u8 {
    if (std.mem.findScalar(u8, path, '\\') == null or path.len > buffer.len) return path;
    try input.forgive(
        position,
        "backslash",
        "{f}: backslashes are taken as slashes",
        .{quote(path)},
    );
    const copy = buffer[0..path.len];
    @memcpy(copy, path);
    std.mem.replaceScalar(u8, copy, '\\', '/');
    return copy;
}

/// The bytes of a file that the scene names at `position`, without the mark that may stand before.
pub fn withoutMark(
    input: *Input,
    position: u64,
    name: []const u8,
    bytes: [:0]const u8,
) Error![:0]const u8 {
    const mark_bytes = markBytes(bytes);
    if (mark_bytes == 0) return bytes;
    try input.forgive(
        position,
        "mark",
        "{f}: a byte order mark (BOM) is passed over",
        .{quote(name)},
    );
    return bytes[mark_bytes..];
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
