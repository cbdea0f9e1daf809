//! JSON texts as exporters write them: what breaks the grammar, and yet can mean but one thing.
//!
//! In: a text that json.zig has refused. Out: a copy that says the same by the grammar (RFC 8259),
//! or nothing where there was nothing to mend. In strings: bytes that are no UTF-8 (a name in
//! Latin-1, GBK or Shift-JIS) are shown as `\xE9`, in a URI as `%E9`; a backslash that escapes
//! nothing stands for itself; controls become spaces. Elsewhere: comments, commas before a closing
//! bracket, byte order marks, and zero bytes behind the document are left out; what C and Python
//! write for infinity and NaN becomes null. What is still wrong then is refused by json.zig as
//! before.

const std = @import("std");
const escapes = @import("escapes.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = @import("../../diagnostic.zig").Diagnostic;
const markBytes = @import("../format.zig").markBytes;

/// The mended copy of a text, a warning for each kind of what was wrong; null: nothing was. The
/// caller frees it.
pub fn repair(
    gpa: Allocator,
    text: []const u8,
    diagnostic: *Diagnostic,
) error{OutOfMemory}!?[]u8 {
    var mender: Mender = .{
        .text = text,
        .diagnostic = diagnostic,
        // Few bytes become longer.
        .out = .init(gpa),
    };
    errdefer mender.out.deinit();
    mender.run() catch return error.OutOfMemory; // It writes to memory.
    if (mender.is_changed) return try mender.out.toOwnedSlice();
    mender.out.deinit();
    return null;
}

const Mender = struct {
    text: []const u8,
    diagnostic: *Diagnostic,
    out: std.Io.Writer.Allocating,
    offset: usize = 0,
    /// Brackets that are open.
    depth: usize = 0,
    is_changed: bool = false,
    /// The string before the last colon: the key of what follows.
    key: []const u8 = "",
    last_string: []const u8 = "",

    const Error = std.Io.Writer.Error;

    fn run(mender: *Mender) Error!void {
        const out = &mender.out.writer;
        while (mender.offset < mender.text.len) {
            const rest = mender.text[mender.offset..];
            if (gapLength(rest)) |length| {
                mender.noteGap(rest);
                mender.offset += length;
                continue;
            }
            switch (rest[0]) {
                '"' => {
                    try mender.string();
                    continue;
                },
                '{', '[' => mender.depth += 1,
                '}', ']' => mender.depth -|= 1,
                ':' => mender.key = mender.last_string,
                ',' => {
                    mender.key = "";
                    const next = skipSpaceAndGaps(rest[1..]);
                    if (next.len > 0 and (next[0] == '}' or next[0] == ']')) {
                        mender.note("a comma stands before a closing bracket, ignored");
                        mender.offset += 1;
                        continue;
                    }
                },
                0 => if (mender.depth == 0 and std.mem.trim(u8, rest, "\x00 \t\r\n").len == 0) {
                    mender.note("the JSON text ends in zero bytes, ignored");
                    return;
                },
                else => if (notANumber(rest)) |length| {
                    mender.note("the JSON text has words for what is not a number, read as null");
                    try out.writeAll("null");
                    mender.offset += length;
                    continue;
                },
            }
            try out.writeByte(rest[0]);
            mender.offset += 1;
        }
    }

    fn note(mender: *Mender, comptime what: []const u8) void {
        mender.is_changed = true;
        mender.diagnostic.forgive(what, .{});
    }

    fn noteGap(mender: *Mender, rest: []const u8) void {
        if (rest[0] == '/')
            mender.note("the JSON text has comments, ignored")
        else
            mender.note("the JSON text has byte order marks within, ignored");
    }

    /// Copies a string, from its quote to behind the last.
    fn string(mender: *Mender) Error!void {
        const out = &mender.out.writer;
        const text = mender.text;
        const start = mender.offset + 1;
        const is_uri = std.mem.eql(u8, mender.key, "uri");
        try out.writeByte('"');
        mender.offset = start;
        var is_foreign = false;
        while (mender.offset < text.len) {
            const byte = text[mender.offset];
            switch (byte) {
                '"' => break,
                '\\' => try mender.escape(),
                0...0x1f => {
                    mender.note("strings have control characters, taken as spaces");
                    // Within a URI they are where a line was broken.
                    if (!is_uri) try out.writeByte(' ');
                    mender.offset += 1;
                },
                else => {
                    const sequence = sequenceLength(text[mender.offset..]);
                    if (sequence) |length| {
                        try out.writeAll(text[mender.offset..][0..length]);
                    } else {
                        if (!is_foreign)
                            mender.note("strings are not UTF-8, their other bytes shown as \\xNN");
                        is_foreign = true;
                        try out.print("{s}{X:0>2}", .{ if (is_uri) "%" else "\\\\x", byte });
                    }
                    mender.offset += sequence orelse 1;
                },
            }
        }
        mender.last_string = text[start..@min(mender.offset, text.len)];
        if (mender.offset == text.len) return; // It is not closed: json.zig says so.
        try out.writeByte('"');
        mender.offset += 1;
    }

    /// Copies an escape, or a backslash that is none.
    fn escape(mender: *Mender) Error!void {
        const rest = mender.text[mender.offset..];
        const length: usize = if (rest.len < 2) 0 else switch (rest[1]) {
            // The second byte of a letter may be a backslash (GBK, Shift-JIS).
            '"' => if (mender.isAfterForeign() and endsString(rest[1..])) 0 else 2,
            '\\', '/', 'b', 'f', 'n', 'r', 't' => 2,
            'u' => if (escapes.readHex(rest) != null) 6 else 0,
            else => 0,
        };
        const out = &mender.out.writer;
        if (length > 0) {
            try out.writeAll(rest[0..length]);
            mender.offset += length;
            return;
        }
        mender.note("strings have backslashes that escape nothing, taken for themselves");
        try out.writeAll("\\\\");
        mender.offset += 1;
    }

    /// Whether the byte before is no UTF-8. Asserts that there is one.
    fn isAfterForeign(mender: *const Mender) bool {
        const before = mender.text[mender.offset - 1];
        return before >= 0x80 and !isEndOfSequence(mender.text[0..mender.offset]);
    }
};

/// Whether a text ends in a whole sequence of UTF-8.
fn isEndOfSequence(text: []const u8) bool {
    for (1..@min(text.len, 4) + 1) |length| {
        const tail = text[text.len - length ..];
        if (sequenceLength(tail) == length) return true;
    }
    return false;
}

/// Bytes of the UTF-8 sequence at the start; null: there is none.
fn sequenceLength(text: []const u8) ?usize {
    const length = std.unicode.utf8ByteSequenceLength(text[0]) catch return null;
    if (length > text.len) return null;
    _ = std.unicode.utf8Decode(text[0..length]) catch return null;
    return length;
}

/// Whether a quote is a string's last: what follows can stand behind a string alone.
fn endsString(text: []const u8) bool {
    const next = skipSpaceAndGaps(text[1..]);
    return next.len == 0 or std.mem.findScalar(u8, ",:}]", next[0]) != null;
}

/// Bytes of a word for infinity or NaN at the start; null: there is none.
fn notANumber(text: []const u8) ?usize {
    const sign = @intFromBool(text[0] == '-' or text[0] == '+');
    for ([_][]const u8{ "NaN", "nan(ind)", "nan", "Infinity", "inf" }) |word| {
        if (!std.mem.startsWith(u8, text[sign..], word)) continue;
        const rest = text[sign + word.len ..];
        if (rest.len == 0 or std.mem.findScalar(u8, " \t\r\n,]}", rest[0]) != null)
            return sign + word.len;
    }
    return null;
}

/// Bytes of a comment or a byte order mark at the start; null: there is neither.
fn gapLength(text: []const u8) ?usize {
    const mark_bytes = markBytes(text);
    if (mark_bytes > 0) return mark_bytes;
    if (std.mem.startsWith(u8, text, "//"))
        return std.mem.findScalar(u8, text, '\n') orelse text.len;
    if (!std.mem.startsWith(u8, text, "/*")) return null;
    const length = std.mem.find(u8, text[2..], "*/") orelse return null;
    return length + 4;
}

fn skipSpaceAndGaps(text: []const u8) []const u8 {
    var rest = text;
    while (true) {
        rest = std.mem.trimStart(u8, rest, " \t\r\n");
        rest = rest[gapLength(rest) orelse return rest ..];
    }
}

test repair {
    const gpa = std.testing.allocator;
    inline for (.{
        .{ "{\"name\":\"caf\xe9\"}", "{\"name\":\"caf\\\\xE9\"}" },
        .{ "[\"\xb2\xe2\xca\xd4\",\"\u{e9}\"]", "[\"\\\\xB2\\\\xE2\\\\xCA\\\\xD4\",\"\u{e9}\"]" },
        // The second byte is a backslash, before a letter and at the end.
        .{ "[\"\x95\x5cx\"]", "[\"\\\\x95\\\\x\"]" },
        .{ "{\"name\":\"\x95\x5c\",\"b\":1}", "{\"name\":\"\\\\x95\\\\\",\"b\":1}" },
        .{ "{\"uri\":\"\xe9.png\"}", "{\"uri\":\"%E9.png\"}" },
        .{ "{\"uri\":\"a\\w.png\"}", "{\"uri\":\"a\\\\w.png\"}" },
        .{ "{\"uri\":\"QUFB\r\nQUFB\"}", "{\"uri\":\"QUFBQUFB\"}" },
        .{ "[\"a\tb\"]", "[\"a b\"]" },
        .{ "[1,2,]", "[1,2]" },
        .{ "{\"a\":1, }", "{\"a\":1 }" },
        .{ "// x\n{/* , */\"a\":\"//\"}", "\n{\"a\":\"//\"}" },
        .{ "[]\x00\x00\n\x00", "[]" },
        .{ "[] \xef\xbb\xbf[\xef\xbb\xbf]", "[] []" },
        .{ "[\"\\u12\"]", "[\"\\\\u12\"]" },
        .{ "[NaN,-Infinity , nan]", "[null,null , null]" },
        .{ "{\"a\":-nan(ind)}", "{\"a\":null}" },
    }) |pair| {
        var diagnostic: Diagnostic = .{};
        const copy = (try repair(gpa, pair[0], &diagnostic)).?;
        defer gpa.free(copy);
        try std.testing.expectEqualStrings(pair[1], copy);
        try std.testing.expect(diagnostic.warning_count > 0);
    }
    // What there is no doubt about stays as it is.
    const kept = [_][]const u8{
        "{\"a\":[\"\\\"\\u0041\"]}", "", "[", "\"", "\"\\\"", "nano", "[1\x00]",
    };
    for (kept) |text| {
        var diagnostic: Diagnostic = .{};
        try std.testing.expectEqual(null, try repair(gpa, text, &diagnostic));
    }
}
