//! Text of any bytes as strings of JSON.
//!
//! A leaf, for whatever writes JSON with names that others have chosen.

const std = @import("std");
const Stringify = std.json.Stringify;
const Writer = std.Io.Writer;

/// A JSON string of any bytes. Those that are not UTF-8, which a file name may hold, become
/// U+FFFD.
pub const Text = struct {
    bytes: []const u8,

    /// Called by `Stringify`.
    pub fn jsonStringify(text: Text, json: *Stringify) Writer.Error!void {
        try json.beginWriteRaw();
        try json.writer.writeByte('"');
        var rest = text.bytes;
        while (rest.len > 0) {
            const length = std.unicode.utf8ByteSequenceLength(rest[0]) catch 1;
            const sequence = rest[0..@min(length, rest.len)];
            const is_valid = std.unicode.utf8ValidateSlice(sequence);
            const shown = if (is_valid) sequence else "\u{fffd}";
            try Stringify.encodeJsonStringChars(shown, .{}, json.writer);
            rest = rest[if (is_valid) sequence.len else 1..];
        }
        try json.writer.writeByte('"');
        json.endWriteRaw();
    }
};

/// An array of them.
pub const Texts = struct {
    list: []const []const u8,

    /// Called by `Stringify`.
    pub fn jsonStringify(texts: Texts, json: *Stringify) Writer.Error!void {
        try json.beginArray();
        for (texts.list) |bytes| try json.write(Text{ .bytes = bytes });
        try json.endArray();
    }
};
