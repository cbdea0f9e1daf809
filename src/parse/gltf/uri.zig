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

/// Resolves a URI as it stands in a JSON text. On an error but that of memory, `reason` says what
/// is wrong. Bytes come from `allocator`, a path from `gpa`.
pub fn resolve(
    gpa: Allocator,
    allocator: Allocator,
    encoded: []const u8,
    reason: *diagnostic.Message,
) error{ OutOfMemory, InvalidInput }!Target {
    switch (classify(encoded)) {
        .base64 => |digits| return .{
            .bytes = decodeBase64(allocator, digits) catch |err| switch (err) {
                error.OutOfMemory => |failure| return failure,
                error.NotBase64 => return refuse(reason, "its data URI is not valid base64", .{}),
            },
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
    const path = decodePath(gpa, text) catch |err| switch (err) {
        error.OutOfMemory => |failure| return failure,
        error.BadEscape => return refuse(reason, "{f} is not a valid path", .{quote(text)}),
    };
    std.mem.replaceScalar(u8, path, '\\', '/');
    return .{ .path = path };
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
    if (!std.ascii.endsWithIgnoreCase(rest[0..comma], ";base64")) return .data_not_base64;
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

/// Decodes the percent signs of a path. The caller frees the path with `gpa`.
pub fn decodePath(gpa: Allocator, encoded: []const u8) error{ OutOfMemory, BadEscape }![]u8 {
    var path: std.ArrayList(u8) = .empty;
    errdefer path.deinit(gpa);
    try path.ensureTotalCapacity(gpa, encoded.len);
    var index: usize = 0;
    while (index < encoded.len) : (index += 1) {
        if (encoded[index] != '%') {
            path.appendAssumeCapacity(encoded[index]);
            continue;
        }
        if (encoded.len - index < 3) return error.BadEscape;
        const high = std.fmt.charToDigit(encoded[index + 1], 16) catch return error.BadEscape;
        const low = std.fmt.charToDigit(encoded[index + 2], 16) catch return error.BadEscape;
        path.appendAssumeCapacity(high * 16 + low);
        index += 2;
    }
    return path.toOwnedSlice(gpa);
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
    const paths = [_][2][]const u8{
        .{ "a%20b.png", "a b.png" },      .{ ".\\\\a\\\\b.png", "./a/b.png" },
        .{ "a\\u00e9%5Cb", "a\u{e9}/b" },
    };
    for (paths) |case| {
        const target = try resolve(gpa, gpa, case[0], &reason);
        defer gpa.free(target.path);
        try std.testing.expectEqualStrings(case[1], target.path);
    }
    const target = try resolve(gpa, gpa, "data:;base64,QUI", &reason);
    defer gpa.free(target.bytes);
    try std.testing.expectEqualStrings("AB", target.bytes);
    const wrong = [_][2][]const u8{
        .{ "c:\\\\a.png", "'c:\\\\a.png' is an absolute path with a drive of Windows" },
        .{ "ftp://a", "URIs of the scheme 'ftp' are not read, only files and data" },
        .{ "data:,a", "its data URI is not base64" },
        .{ "data:;base64,a", "its data URI is not valid base64" },
        .{ "a%2", "'a%2' is not a valid path" },
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

test decodePath {
    const gpa = std.testing.allocator;
    inline for (.{
        .{ "my%20quad.bin", "my quad.bin" }, .{ "%41%2fb", "A/b" }, .{ "%2E%2e/a", "../a" },
        .{ "a%00", "a\x00" },                .{ "", "" },
    }) |pair| {
        const path = try decodePath(gpa, pair[0]);
        defer gpa.free(path);
        try std.testing.expectEqualStrings(pair[1], path);
    }
    for ([_][]const u8{ "%", "a%2", "%zz", "%-1" }) |encoded| {
        try std.testing.expectError(error.BadEscape, decodePath(gpa, encoded));
    }
}
