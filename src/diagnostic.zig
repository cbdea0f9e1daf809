//! What a stage has to say to the user: the one line of an error, and the warnings of a file.
//!
//! A leaf that every stage may import. Stages write here and return a small error; `main` alone
//! prints and picks the exit code. Text from files is made printable and cut before it is kept,
//! so that no message can be longer than a line or carry control characters.

const std = @import("std");
const assert = std.debug.assert;

/// Longest message kept, in bytes.
pub const message_bytes_max = 300;
/// Longest quoted name within a message, in bytes.
pub const name_bytes_max = 80;
/// Warnings kept of one run; what comes after is counted only.
pub const warning_count_max = 32;
/// Longest number of others of a kind, in words and bytes.
const fault_count_bytes_max = " (and 18446744073709551615 more)".len;

/// A fixed-size line of text.
pub const Message = struct {
    buffer: [message_bytes_max]u8 = undefined,
    length: usize = 0,

    /// The text, without a line end.
    pub fn text(message: *const Message) []const u8 {
        return message.buffer[0..message.length];
    }

    /// Replaces the text; what does not fit is cut.
    pub fn set(message: *Message, comptime format: []const u8, arguments: anytype) void {
        message.length = 0;
        message.append(format, arguments);
    }

    /// Puts more behind the text; what does not fit is cut.
    pub fn append(message: *Message, comptime format: []const u8, arguments: anytype) void {
        const start = message.length;
        var writer: std.Io.Writer = .fixed(message.buffer[start..]);
        writer.print(format, arguments) catch |err| switch (err) {
            error.WriteFailed => {}, // Full: the beginning is what matters.
        };
        message.length = start + writer.buffered().len;
        for (message.buffer[start..message.length]) |*byte| {
            if (byte.* < 0x20 or byte.* == 0x7f) byte.* = '?';
        }
        assert(message.length <= message_bytes_max);
    }
};

/// One run's error text and warnings.
pub const Diagnostic = struct {
    /// Why the run failed; empty until `fail`.
    message: Message = .{},
    /// The place within a file that the message is about, `FILE:LINE:COLUMN`; empty: the file that
    /// the user named, as a whole.
    place: Message = .{},
    warnings: [warning_count_max]Message = undefined,
    /// Of those that `forgive` has added.
    faults: [warning_count_max]Fault = undefined,
    warning_count: usize = 0,
    /// Warnings past `warning_count_max`.
    warning_dropped_count: usize = 0,
    /// Whether what could be forgiven is an error.
    strict: bool = false,
    /// What would have been the first warning of `forgive`, if `strict`: the error line to come.
    refusal: ?Message = null,

    /// A kind of what is wrong with a file: what its warning says of the first one, and how many
    /// there are.
    const Fault = struct { kind: []const u8 = "", text_length: usize = 0, count: u64 = 0 };

    /// Sets the error line and returns the error, so that a stage can write `return d.fail(...)`.
    pub fn fail(
        diagnostic: *Diagnostic,
        err: anytype,
        comptime format: []const u8,
        arguments: anytype,
    ) @TypeOf(err) {
        diagnostic.message.set(format, arguments);
        return err;
    }

    /// Sets the error line of a scene that is invalid.
    pub fn invalid(
        diagnostic: *Diagnostic,
        comptime format: []const u8,
        arguments: anytype,
    ) error{InvalidInput} {
        return diagnostic.fail(error.InvalidInput, format, arguments);
    }

    /// Adds a warning; the same text is kept once.
    pub fn warn(diagnostic: *Diagnostic, comptime format: []const u8, arguments: anytype) void {
        var message: Message = .{};
        message.set(format, arguments);
        diagnostic.add(&message, .{});
    }

    /// Says what is wrong with a file that can be read all the same: a warning, one for each
    /// `format` with the number of the others. If `strict`, the first one is the error line; see
    /// `failIfRefused`.
    pub fn forgive(diagnostic: *Diagnostic, comptime format: []const u8, arguments: anytype) void {
        if (diagnostic.strict) return diagnostic.refuse(format, arguments);
        const count = diagnostic.warning_count;
        for (diagnostic.warnings[0..count], diagnostic.faults[0..count]) |*warning, *fault| {
            if (!std.mem.eql(u8, fault.kind, format)) continue;
            fault.count += 1;
            warning.length = fault.text_length;
            warning.append(" (and {d} more)", .{fault.count - 1});
            return;
        }
        var message: Message = .{};
        message.set(format, arguments);
        message.length = @min(message.length, message_bytes_max - fault_count_bytes_max);
        diagnostic.add(&message, .{ .kind = format, .text_length = message.length, .count = 1 });
    }

    /// The same for what has names of its own, of which each gets a warning.
    pub fn forgiveEach(
        diagnostic: *Diagnostic,
        comptime format: []const u8,
        arguments: anytype,
    ) void {
        if (diagnostic.strict) return diagnostic.refuse(format, arguments);
        diagnostic.warn(format, arguments);
    }

    fn refuse(diagnostic: *Diagnostic, comptime format: []const u8, arguments: anytype) void {
        if (diagnostic.refusal != null) return;
        var line: Message = .{};
        line.set(format, arguments);
        diagnostic.refusal = line;
    }

    /// Sets the error line and returns an error if there was something to forgive, and `strict`.
    pub fn failIfRefused(diagnostic: *Diagnostic) error{InvalidInput}!void {
        diagnostic.message = diagnostic.refusal orelse return;
        return error.InvalidInput;
    }

    /// The texts of all warnings so far.
    pub fn warningTexts(
        diagnostic: *const Diagnostic,
        buffer: *[warning_count_max][]const u8,
    ) []const []const u8 {
        const count = diagnostic.warning_count;
        for (buffer[0..count], diagnostic.warnings[0..count]) |*text, *warning| {
            text.* = warning.text();
        }
        return buffer[0..count];
    }

    fn add(diagnostic: *Diagnostic, message: *const Message, fault: Fault) void {
        for (diagnostic.warnings[0..diagnostic.warning_count]) |*other| {
            if (std.mem.eql(u8, other.text(), message.text())) return;
        }
        if (diagnostic.warning_count == warning_count_max) {
            diagnostic.warning_dropped_count += 1;
            return;
        }
        diagnostic.warnings[diagnostic.warning_count] = message.*;
        diagnostic.faults[diagnostic.warning_count] = fault;
        diagnostic.warning_count += 1;
    }
};

const system_reasons: std.StaticStringMap([]const u8) = .initComptime(.{
    .{ "AccessDenied", "permission denied" },
    .{ "BadPathName", "not a file name" },
    .{ "BrokenPipe", "nobody reads it" },
    .{ "Canceled", "the program is ending" },
    .{ "ConnectionResetByPeer", "the connection was reset" },
    .{ "DeviceBusy", "device busy" },
    .{ "DiskQuota", "disk quota exceeded" },
    .{ "FileBusy", "it is in use" },
    .{ "FileNotFound", "no such file or directory" },
    .{ "FileTooBig", "file too large" },
    .{ "InputOutput", "input/output error" },
    .{ "IsDir", "it is a directory" },
    .{ "NameTooLong", "name too long" },
    .{ "NoDevice", "no such device" },
    .{ "NoSpaceLeft", "no space left on the device" },
    .{ "NotDir", "not a directory" },
    .{ "NotOpenForWriting", "it is closed" },
    .{ "PermissionDenied", "permission denied" },
    .{ "ProcessFdQuotaExceeded", "too many open files" },
    .{ "ReadOnlyFileSystem", "read-only file system" },
    .{ "SymLinkLoop", "too many symbolic links" },
    .{ "SystemFdQuotaExceeded", "too many open files" },
    .{ "SystemResources", "the system is out of resources" },
});

/// An error of the file system in words.
pub fn systemReason(err: anyerror) []const u8 {
    return system_reasons.get(@errorName(err)) orelse @errorName(err);
}

/// Prints a text of outside origin whole, bad UTF-8 and controls as `?`.
pub const Printable = struct {
    text: []const u8,

    /// Called by `{f}`.
    pub fn format(printable_text: Printable, writer: *std.Io.Writer) std.Io.Writer.Error!void {
        const text = printable_text.text;
        var index: usize = 0;
        while (index < text.len) {
            const length = Quoted.sequenceLength(text[index..]) orelse {
                try writer.writeByte('?');
                index += 1;
                continue;
            };
            try writer.writeAll(text[index..][0..length]);
            index += length;
        }
    }
};

/// Wraps a text for `{f}`.
pub fn printable(text: []const u8) Printable {
    return .{ .text = text };
}

/// Prints a name from a file in quotes, cut to `name_bytes_max`, bad UTF-8 and controls as `?`.
pub const Quoted = struct {
    name: []const u8,

    /// Called by `{f}`.
    pub fn format(quoted: Quoted, writer: *std.Io.Writer) std.Io.Writer.Error!void {
        try writer.writeByte('\'');
        var index: usize = 0;
        while (index < quoted.name.len and index < name_bytes_max) {
            const length = sequenceLength(quoted.name[index..]) orelse {
                try writer.writeByte('?');
                index += 1;
                continue;
            };
            try writer.writeAll(quoted.name[index..][0..length]);
            index += length;
        }
        if (index < quoted.name.len) try writer.writeAll("...");
        try writer.writeByte('\'');
    }

    /// Bytes of the printable UTF-8 sequence at the start of `bytes`, or null.
    fn sequenceLength(bytes: []const u8) ?usize {
        const length = std.unicode.utf8ByteSequenceLength(bytes[0]) catch return null;
        if (length > bytes.len) return null;
        const code_point = std.unicode.utf8Decode(bytes[0..length]) catch return null;
        if (code_point < 0x20 or (code_point >= 0x7f and code_point < 0xa0)) return null;
        // Direction overrides and isolates can make a terminal show another name.
        if (code_point >= 0x202a and code_point <= 0x202e) return null;
        if (code_point >= 0x2066 and code_point <= 0x2069) return null;
        return length;
    }
};

/// Wraps a name for `{f}`.
pub fn quote(name: []const u8) Quoted {
    return .{ .name = name };
}

/// Prints things of a file that have names, or empty ones: index and name.
fn Listed(comptime Thing: type) type {
    return struct {
        things: []const Thing,

        /// Called by `{f}`.
        pub fn format(list: @This(), writer: *std.Io.Writer) std.Io.Writer.Error!void {
            if (list.things.len == 0) return writer.writeAll("the file has none");
            try writer.writeAll("the file has ");
            for (list.things, 0..) |*thing, index| {
                if (index > 0) try writer.writeAll(", ");
                try writer.print("{d}", .{index});
                if (thing.name.len > 0) try writer.print(" {f}", .{quote(thing.name)});
            }
        }
    };
}

/// Wraps a slice of things with a field `name` for `{f}`.
pub fn listOf(things: anytype) Listed(std.meta.Elem(@TypeOf(things))) {
    return .{ .things = things };
}

test "a message is one line, however long or wild the text" {
    var diagnostic: Diagnostic = .{};
    const long: [1000]u8 = @splat('x');
    try std.testing.expectEqual(error.Bad, diagnostic.fail(error.Bad, "{s}", .{&long}));
    try std.testing.expectEqual(message_bytes_max, diagnostic.message.text().len);
    diagnostic.message.set("{f}", .{quote("a\n\x1b[31mb\xff\u{202e}é")});
    try std.testing.expectEqualStrings("'a??[31mb????é'", diagnostic.message.text());
    diagnostic.message.set("{f}", .{quote(&long)});
    try std.testing.expect(diagnostic.message.text().len == name_bytes_max + 5);
    diagnostic.message.set("{f}", .{quote("")});
    try std.testing.expectEqualStrings("''", diagnostic.message.text());
}

test printable {
    var buffer: [64]u8 = undefined;
    var writer: std.Io.Writer = .fixed(&buffer);
    try writer.print("{f}", .{printable("a\nb\x1b\xffé")});
    try std.testing.expectEqualStrings("a?b??é", writer.buffered());
}

test "the same warning is said once, and their number is bounded" {
    var diagnostic: Diagnostic = .{};
    diagnostic.warn("skins are not applied yet", .{});
    diagnostic.warn("skins are not applied yet", .{});
    try std.testing.expectEqual(1, diagnostic.warning_count);
    for (0..100) |index| diagnostic.warn("number {d}", .{index});
    try std.testing.expectEqual(warning_count_max, diagnostic.warning_count);
    try std.testing.expectEqual(101 - warning_count_max, diagnostic.warning_dropped_count);
}

test "what is forgiven is a warning for each kind with a count, or an error" {
    var diagnostic: Diagnostic = .{};
    for (0..3) |index| {
        diagnostic.forgive("node {d}: odd", .{index});
        diagnostic.forgive("mesh {d}: odd", .{index + 7});
    }
    try std.testing.expectEqual(2, diagnostic.warning_count);
    try std.testing.expectEqualStrings("node 0: odd (and 2 more)", diagnostic.warnings[0].text());
    try std.testing.expectEqualStrings("mesh 7: odd (and 2 more)", diagnostic.warnings[1].text());
    try diagnostic.failIfRefused();
    const long: [1000]u8 = @splat('x');
    for (0..2) |_| diagnostic.forgive("{s}", .{&long});
    try std.testing.expect(std.mem.endsWith(u8, diagnostic.warnings[2].text(), "x (and 1 more)"));

    var strict: Diagnostic = .{ .strict = true };
    strict.warn("a gap", .{});
    try strict.failIfRefused();
    for (0..3) |index| strict.forgive("node {d}: odd", .{index});
    strict.message.set("an error that was no reason to give up", .{});
    try std.testing.expectError(error.InvalidInput, strict.failIfRefused());
    try std.testing.expectEqualStrings("node 0: odd", strict.message.text());
    try std.testing.expectEqual(1, strict.warning_count);
}
