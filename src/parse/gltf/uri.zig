//! URIs of glTF: data in the text itself, or the path of a file beside it.
//!
//! In: a URI reference (RFC 3986; data URIs: RFC 2397). Out: the bytes of a base64 data URI, or a
//! path with its percent signs decoded, for resource.zig to judge. A backslash is no separator in a
//! URI, but exporters write it and browsers read it as one (WHATWG URL), so it is.

const std = @import("std");
const diagnostic = @import("../../diagnostic.zig");
const escapes = @import("../json/escapes.zig");
const Allocator = std.mem.Allocator;
const quote = diagnostic.quote;

/// What a URI stands for; free what is in it.
pub const Target = union(enum) { bytes: [:0]u8, path: []u8 };

/// A URI that has been read.
pub const Resolved = struct {
    target: Target,
    /// What of it is not as it should be, as what follows "its URI"; empty: nothing.
    odd: []const u8 = "",
};

/// Resolves a URI as it stands in a JSON text. On an error but that of memory, `reason` says what
/// is wrong. Bytes come from `allocator`, a path from `gpa`.
pub fn resolve(
    gpa: Allocator,
    allocator: Allocator,
    encoded: []const u8,
    reason: *diagnostic.Message,
) error{ OutOfMemory, InvalidInput }!Resolved {
    switch (classify(encoded)) {
        .base64 => |digits| return decodeData(gpa, allocator, digits) catch |err| switch (err) {
            error.OutOfMemory => |failure| return failure,
            error.NotBase64 => return refuse(reason, "its data URI is not valid base64", .{}),
        },
        .data_not_base64 => return refuse(reason, "its data URI is not base64", .{}),
        .scheme => |scheme| return if (scheme.len == 1)
            refuse(reason, "{f} is an absolute path with a drive of Windows", .{quote(encoded)})
        else
            refuse(reason, "URIs of the scheme {f} are not read, only files and data", .{
                quote(scheme),
            }),
        .path => {},
    }
    const text = try escapes.decodeString(gpa, encoded);
    defer gpa.free(text);
    return decodePath(gpa, text);
}

/// Bytes of base64, which may be percent-encoded, or broken into lines.
fn decodeData(
    gpa: Allocator,
    allocator: Allocator,
    digits: []const u8,
) error{ OutOfMemory, NotBase64 }!Resolved {
    if (decodeBase64(allocator, digits)) |bytes| {
        return .{ .target = .{ .bytes = bytes } };
    } else |err| if (err == error.OutOfMemory) return err;
    const text = try escapes.decodeString(gpa, digits);
    defer gpa.free(text);
    var plain: std.ArrayList(u8) = try .initCapacity(gpa, text.len);
    defer plain.deinit(gpa);
    var index: usize = 0;
    while (index < text.len) : (index += 1) {
        var byte = text[index];
        if (byte == '%') if (readPercent(text[index..])) |decoded| {
            byte = decoded;
            index += 2;
        };
        if (!std.ascii.isWhitespace(byte)) plain.appendAssumeCapacity(byte);
    }
    return .{
        .target = .{ .bytes = try decodeBase64(allocator, plain.items) },
        .odd = "has escapes or spaces within its base64",
    };
}

fn refuse(
    reason: *diagnostic.Message,
    comptime format: []const u8,
    arguments: anytype,
) error{InvalidInput} {
    reason.set(format, arguments);
    return error.InvalidInput;
}

/// What a URI is.
pub const Kind = union(enum) {
    /// The base64 text of a data URI.
    base64: []const u8,
    /// A path, still percent-encoded.
    path: []const u8,
    /// A data URI of another encoding.
    data_not_base64,
    /// Something with a scheme (`http:`, `file:`).
    scheme: []const u8,
};

/// Tells what a URI is.
pub fn classify(uri: []const u8) Kind {
    const colon = schemeLength(uri) orelse return .{ .path = uri };
    if (!std.ascii.eqlIgnoreCase(uri[0..colon], "data")) return .{ .scheme = uri[0..colon] };
    const rest = uri[colon + 1 ..];
    const comma = std.mem.findScalar(u8, rest, ',') orelse return .data_not_base64;
    const last = std.mem.findScalarLast(u8, rest[0..comma], ';') orelse return .data_not_base64;
    const encoding = std.mem.trim(u8, rest[last + 1 .. comma], " ");
    if (!std.ascii.eqlIgnoreCase(encoding, "base64")) return .data_not_base64;
    return .{ .base64 = rest[comma + 1 ..] };
}

/// Position of the colon that ends a scheme.
fn schemeLength(uri: []const u8) ?usize {
    if (uri.len == 0 or !std.ascii.isAlphabetic(uri[0])) return null;
    for (uri, 0..) |byte, index| switch (byte) {
        'a'...'z', 'A'...'Z', '0'...'9', '+', '-', '.' => {},
        ':' => return index,
        else => return null,
    };
    return null;
}

/// Decodes base64 with or without padding, a zero byte behind it. The caller frees the bytes with
/// `gpa`.
pub fn decodeBase64(gpa: Allocator, text: []const u8) error{ OutOfMemory, NotBase64 }![:0]u8 {
    var digits = text;
    for (0..2) |_| {
        if (std.mem.endsWith(u8, digits, "=")) digits = digits[0 .. digits.len - 1];
    }
    const decoder = std.base64.standard_no_pad.Decoder;
    const length = decoder.calcSizeForSlice(digits) catch return error.NotBase64;
    const bytes = try gpa.allocSentinel(u8, length, 0);
    errdefer gpa.free(bytes);
    decoder.decode(bytes, digits) catch return error.NotBase64;
    return bytes;
}

/// A path with its percent signs decoded, those that escape nothing as they are, and slashes for
/// backslashes. The caller frees the path with `gpa`.
fn decodePath(gpa: Allocator, encoded: []const u8) error{OutOfMemory}!Resolved {
    var path: std.ArrayList(u8) = .empty;
    errdefer path.deinit(gpa);
    try path.ensureTotalCapacity(gpa, encoded.len + 1);
    var odd: []const u8 = "";
    var index: usize = 0;
    while (index < encoded.len) : (index += 1) {
        var byte = encoded[index];
        if (byte == '%') {
            if (readPercent(encoded[index..])) |decoded| {
                byte = decoded;
                index += 2;
            } else odd = "has a percent sign that escapes nothing";
        } else if (controlLetter(byte)) |letter| {
            // A backslash of a folder and the first letter of a name are an escape to JSON.
            try path.appendSlice(gpa, &.{ '/', letter });
            odd = "has backslashes, taken as slashes";
            continue;
        }
        if (byte == '\\') {
            byte = '/';
            odd = "has backslashes, taken as slashes";
        }
        try path.append(gpa, byte);
    }
    return .{ .target = .{ .path = try path.toOwnedSlice(gpa) }, .odd = odd };
}

/// The byte that `%XX` at the start stands for; null: it stands for none.
fn readPercent(text: []const u8) ?u8 {
    if (text.len < 3) return null;
    const high = std.fmt.charToDigit(text[1], 16) catch return null;
    const low = std.fmt.charToDigit(text[2], 16) catch return null;
    return high * 16 + low;
}

/// The letter behind the backslash that JSON escapes this control character with.
fn controlLetter(byte: u8) ?u8 {
    return switch (byte) {
        8 => 'b',
        9 => 't',
        10 => 'n',
        12 => 'f',
        13 => 'r',
        else => null,
    };
}

test classify {
    const expectEqualStrings = std.testing.expectEqualStrings;
    try expectEqualStrings("AAAA", classify("data:a/b;base64,AAAA").base64);
    try expectEqualStrings("", classify("DATA:;BASE64,").base64);
    try std.testing.expect(classify("data:text/plain,AAAA") == .data_not_base64);
    try std.testing.expect(classify("data:a/b;base64") == .data_not_base64);
    try expectEqualStrings("file", classify("file:///etc/hostname").scheme);
    try expectEqualStrings("x", classify("x:y").scheme);
    for ([_][]const u8{ "", "a.bin", "a/b:c", "1:2", "./x:y", "%41:" }) |path| {
        try expectEqualStrings(path, classify(path).path);
    }
}

test resolve {
    const gpa = std.testing.allocator;
    var reason: diagnostic.Message = .{};
    const backslashes = "has backslashes, taken as slashes";
    const percent = "has a percent sign that escapes nothing";
    const paths = [_][3][]const u8{
        .{ "a%20b.png", "a b.png", "" },
        .{ "%41%2fb", "A/b", "" },
        .{ "%2E%2e/a", "../a", "" },
        .{ "a%00", "a\x00", "" },
        .{ "", "", "" },
        .{ ".\\\\a\\\\b.png", "./a/b.png", backslashes },
        .{ "a\\u00e9%5Cb", "a\u{e9}/b", backslashes },
        // One backslash each was meant.
        .{ "a\\textures\\new.png", "a/textures/new.png", backslashes },
        .{ "100%.png", "100%.png", percent },
        .{ "a%2", "a%2", percent },
        .{ "%zz%20", "%zz ", percent },
    };
    for (paths) |case| {
        const resolved = try resolve(gpa, gpa, case[0], &reason);
        defer gpa.free(resolved.target.path);
        try std.testing.expectEqualStrings(case[1], resolved.target.path);
        try std.testing.expectEqualStrings(case[2], resolved.odd);
    }
    const data = [_][3][]const u8{
        .{ "data:;base64,QUI", "AB", "" },
        .{ "data:a/b; Base64 ,QUI=", "AB", "" },
        .{ "data:;base64,/%2B8%3D", "\xff\xef", "has escapes or spaces within its base64" },
        .{ "data:;base64,QU\\nI =", "AB", "has escapes or spaces within its base64" },
    };
    for (data) |case| {
        const resolved = try resolve(gpa, gpa, case[0], &reason);
        defer gpa.free(resolved.target.bytes);
        try std.testing.expectEqualStrings(case[1], resolved.target.bytes);
        try std.testing.expectEqualStrings(case[2], resolved.odd);
    }
    const wrong = [_][2][]const u8{
        .{ "c:\\\\a.png", "'c:\\\\a.png' is an absolute path with a drive of Windows" },
        .{ "ftp://a", "URIs of the scheme 'ftp' are not read, only files and data" },
        .{ "data:,a", "its data URI is not base64" },
        .{ "data:;base64,a", "its data URI is not valid base64" },
        .{ "data:;base64,%5C%5C%5C%5C", "its data URI is not valid base64" },
        .{ "data:;base64,QU!*", "its data URI is not valid base64" },
    };
    for (wrong) |case| {
        try std.testing.expectError(error.InvalidInput, resolve(gpa, gpa, case[0], &reason));
        try std.testing.expectEqualStrings(case[1], reason.text());
    }
}

test decodeBase64 {
    const gpa = std.testing.allocator;
    inline for (.{
        .{ "", "" },       .{ "QQ==", "A" },   .{ "QQ", "A" },
        .{ "QUI=", "AB" }, .{ "QUJD", "ABC" }, .{ "/+8=", "\xff\xef" },
    }) |pair| {
        const bytes = try decodeBase64(gpa, pair[0]);
        defer gpa.free(bytes);
        try std.testing.expectEqualStrings(pair[1], bytes);
    }
    for ([_][]const u8{ "Q", "Q===", "QU*D", "QU D", "QU=D", "QQ==\n" }) |text| {
        try std.testing.expectError(error.NotBase64, decodeBase64(gpa, text));
    }
}
