//! Backslashes in JSON strings (RFC 8259, section 7).
//!
//! In: the content of a string, or a whole text. Out: what the escapes stand for, as UTF-8. Nothing
//! here fails: a bad escape stays as it is for json.zig to refuse, or becomes U+FFFD in a name.

const std = @import("std");
const Allocator = std.mem.Allocator;
const assert = std.debug.assert;

/// A copy of a JSON text without the escapes that JSON does not need (`\/`, and `\uXXXX` for
/// letters and all else but quotes, backslashes and controls), so that keys and words can be
/// compared byte by byte; null where there are none. The caller frees the copy with `gpa`.
pub fn simplifyEscapes(gpa: Allocator, text: []const u8) error{OutOfMemory}!?[]u8 {
    const has_any = std.mem.find(u8, text, "\\u") != null or std.mem.find(u8, text, "\\/") != null;
    if (!has_any) return null;
    // What an escape stands for is never longer than the escape.
    var copy: std.ArrayList(u8) = try .initCapacity(gpa, text.len);
    errdefer copy.deinit(gpa);
    var quoted = false;
    var index: usize = 0;
    while (index < text.len) {
        const byte = text[index];
        if (byte != '\\' or !quoted or index + 1 == text.len) {
            if (byte == '"') quoted = !quoted;
            copy.appendAssumeCapacity(byte);
            index += 1;
            continue;
        }
        const escape = decodeEscape(text[index..]);
        const raw = text[index..][0..escape.length];
        switch (escape.code_point) {
            '"', '\\', 0...0x1f, 0xfffd => copy.appendSliceAssumeCapacity(raw),
            else => appendCodePoint(&copy, escape.code_point),
        }
        index += escape.length;
    }
    return try copy.toOwnedSlice(gpa);
}

/// Resolves the escapes of a JSON string's content (RFC 8259, section 7); what is no valid escape,
/// or half of a surrogate pair, becomes U+FFFD. The caller frees the text with `gpa`.
pub fn decodeString(gpa: Allocator, raw: []const u8) error{OutOfMemory}![]u8 {
    // A bad escape of one byte becomes three.
    var text: std.ArrayList(u8) = try .initCapacity(gpa, raw.len + 2);
    errdefer text.deinit(gpa);
    var index: usize = 0;
    while (index < raw.len) {
        if (raw[index] != '\\') {
            text.appendAssumeCapacity(raw[index]);
            index += 1;
            continue;
        }
        const escape = decodeEscape(raw[index..]);
        try text.ensureUnusedCapacity(gpa, raw.len - index + 3);
        appendCodePoint(&text, escape.code_point);
        index += escape.length;
    }
    return text.toOwnedSlice(gpa);
}

/// Asserts that `code_point` is one, and no surrogate.
fn appendCodePoint(text: *std.ArrayList(u8), code_point: u21) void {
    var bytes: [4]u8 = undefined;
    const length = std.unicode.utf8Encode(code_point, &bytes) catch unreachable;
    text.appendSliceAssumeCapacity(bytes[0..length]);
}

const Escape = struct { code_point: u21, length: usize };

/// The escape at the start of `raw`. Asserts that there is a backslash.
fn decodeEscape(raw: []const u8) Escape {
    assert(raw[0] == '\\');
    const unknown: Escape = .{ .code_point = 0xfffd, .length = @min(raw.len, 2) };
    if (raw.len < 2) return unknown;
    return .{ .length = 2, .code_point = switch (raw[1]) {
        '"', '\\', '/' => raw[1],
        'b' => 8,
        't' => 9,
        'n' => 10,
        'f' => 12,
        'r' => 13,
        'u' => return decodeUnicode(raw) orelse unknown,
        else => return unknown,
    } };
}

fn decodeUnicode(raw: []const u8) ?Escape {
    const first = readHex(raw) orelse return null;
    const lone: Escape = .{ .code_point = 0xfffd, .length = 6 };
    if (std.unicode.utf16IsLowSurrogate(first)) return lone;
    if (!std.unicode.utf16IsHighSurrogate(first)) return .{ .code_point = first, .length = 6 };
    const second = readHex(raw[6..]) orelse return lone;
    const pair = std.unicode.utf16DecodeSurrogatePair(&.{ first, second }) catch return lone;
    return .{ .code_point = pair, .length = 12 };
}

/// The number in `\uXXXX` at the start of `raw`, null where there is none.
pub fn readHex(raw: []const u8) ?u16 {
    if (raw.len < 6 or raw[0] != '\\' or raw[1] != 'u') return null;
    var value: u16 = 0;
    for (raw[2..6]) |byte| {
        const digit = std.fmt.charToDigit(byte, 16) catch return null;
        value = value << 4 | digit;
    }
    return value;
}

test simplifyEscapes {
    const gpa = std.testing.allocator;
    try std.testing.expectEqual(null, try simplifyEscapes(gpa, "{\"a\\\"\\n\":1}"));
    inline for (.{
        .{ "{\"\\u0061\\/b\":1}", "{\"a/b\":1}" },
        .{ "\"\\u0022\\u005c\\u0000\\/\"", "\"\\u0022\\u005c\\u0000/\"" },
        .{ "\"\\ud83d\\ude00\\u00e9\"", "\"\u{1f600}\u{e9}\"" },
        .{ "\"\\ud83d\\/\"", "\"\\ud83d/\"" },
        .{ "\"\\\\\" \\u0061 \"\\u0061\"", "\"\\\\\" \\u0061 \"a\"" },
        .{ "\"\\u12\\/", "\"\\u12/" },
        .{ "\"\\/\\", "\"/\\" },
    }) |pair| {
        const copy = (try simplifyEscapes(gpa, pair[0])).?;
        defer gpa.free(copy);
        try std.testing.expectEqualStrings(pair[1], copy);
    }
}

test decodeString {
    const gpa = std.testing.allocator;
    inline for (.{
        .{ "", "" },
        .{ "a\\n\\\"\\/\\\\\\t", "a\n\"/\\\t" },
        .{ "\\u00e9\\ud83d\\ude00", "\u{e9}\u{1f600}" },
        .{ "\\ud83dx\\ude00", "\u{fffd}x\u{fffd}" },
        .{ "\\", "\u{fffd}" },
        .{ "\\x\\u12", "\u{fffd}\u{fffd}12" },
    }) |pair| {
        const text = try decodeString(gpa, pair[0]);
        defer gpa.free(text);
        try std.testing.expectEqualStrings(pair[1], text);
    }
}
