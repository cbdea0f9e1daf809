//! The JSON text of a document as cgltf may see it: checked, or mended until it is.
//!
//! In: the text of the file. Out: a text that holds the schema, and cgltf's structures. Texts that
//! are as they should be are scanned once and not copied. Others get a second chance, unless they
//! are to be refused: the grammar is mended (json/repair.zig), what nobody looks at is left out,
//! and so is each broken element of a list; who needs one of those fails (Source.need).

const std = @import("std");
const escapes = @import("../json/escapes.zig");
const json = @import("../json.zig");
const repair = @import("../json/repair.zig").repair;
const schema = @import("schema.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = @import("../../diagnostic.zig").Diagnostic;
const Document = @import("document.zig");
const Error = @import("source.zig").Error;
const Graph = @import("../json/graph.zig");
const Lenience = @import("../json/lenience.zig");
const Text = @This();

gpa: Allocator,
bytes: []const u8,
/// `bytes`, where they are not the file's.
owned: ?[]u8 = null,
/// The same without animations, where cgltf refuses these: they have a reader of their own.
unanimated: ?[]u8 = null,
checked: json.Checked = undefined,
/// Elements of the schema's lists that are left out.
lenience: Lenience,

/// Checks a text, which has to outlive this. Free with `deinit`.
pub fn open(gpa: Allocator, raw: []const u8, diagnostic: *Diagnostic) Error!Text {
    var text: Text = .{ .gpa = gpa, .bytes = raw, .lenience = .init(gpa) };
    errdefer text.deinit();
    text.replace(try escapes.simplifyEscapes(gpa, raw));
    const before = diagnostic.*;
    if (json.check(text.bytes, &schema.document, diagnostic)) |checked| {
        text.checked = checked;
        return text;
    } else |err| if (diagnostic.strict) return err;
    diagnostic.* = before;
    if (try repair(gpa, raw, diagnostic)) |mended| {
        text.replace(mended);
        text.replace(try escapes.simplifyEscapes(gpa, mended));
    }
    try text.mend(diagnostic);
    return text;
}

/// Frees what is not the file's.
pub fn deinit(text: *Text) void {
    if (text.owned) |owned| text.gpa.free(owned);
    if (text.unanimated) |other| text.gpa.free(other);
    text.lenience.deinit();
    text.* = undefined;
}

/// Takes over `bytes`, unless there are none.
fn replace(text: *Text, bytes: ?[]u8) void {
    const new = bytes orelse return;
    if (text.owned) |owned| text.gpa.free(owned);
    text.owned = new;
    text.bytes = new;
}

/// Leaves out what breaks the schema.
fn mend(text: *Text, diagnostic: *Diagnostic) Error!void {
    try text.scan(null, diagnostic);
    // What is left out may have been all that was missing.
    var unheard: Diagnostic = .{};
    text.scan(null, &unheard) catch |err| {
        diagnostic.message = unheard.message;
        return err;
    };
}

fn scan(text: *Text, graph: ?*Graph, said: *Diagnostic) Error!void {
    const lenience = &text.lenience;
    text.checked = try json.checkLeniently(text.bytes, &schema.document, lenience, graph, said);
    text.replace(try lenience.apply(text.bytes));
}

/// Has cgltf parse the text. The document must not outlive it.
pub fn parse(text: *Text, diagnostic: *Diagnostic) Error!Document {
    if (try tryParse(text.gpa, text.bytes, diagnostic)) |document| return document;
    if (!diagnostic.strict) {
        try text.mendReferences(diagnostic);
        if (try tryParse(text.gpa, text.bytes, diagnostic)) |document| return document;
    }
    // cgltf does not say why, so look for the reasons that the table leaves.
    const lengths = text.checked.lengths;
    const rule = &schema.document;
    try json.checkReferences(text.gpa, text.bytes, rule, lengths, "node", diagnostic);
    text.unanimated = try text.without("animations");
    if (text.unanimated) |other| {
        if (try tryParse(text.gpa, other, diagnostic)) |document| return document;
    }
    return diagnostic.invalid(
        "is not valid glTF: an extension refers to what is not there",
        .{},
    );
}

/// Null: cgltf refuses it.
fn tryParse(gpa: Allocator, bytes: []const u8, diagnostic: *Diagnostic) Error!?Document {
    return Document.parse(gpa, bytes) catch |err| switch (err) {
        error.OutOfMemory => error.OutOfMemory,
        error.TooLarge => diagnostic.invalid(
            "the document would need much more memory than its size explains",
            .{},
        ),
        error.Legacy => diagnostic.invalid("glTF 1.0 is not supported, only 2.0", .{}),
        error.Refused => null,
    };
}

/// Leaves out what refers to what is not there, and nodes that are named once too often.
fn mendReferences(text: *Text, diagnostic: *Diagnostic) Error!void {
    var lengths = text.checked.lengths;
    const buffers = @backingInt(schema.List.buffers);
    const buffer_views = @backingInt(schema.List.buffer_views);
    // Without buffers there is nothing that views could be of, not even those that are left out.
    if (lengths[buffers] == 0 and lengths[buffer_views] > 0) {
        lengths[buffer_views] = 0;
        text.replace(try text.without("bufferViews"));
    }
    var graph: Graph = try .init(text.gpa, lengths, @backingInt(schema.List.nodes));
    defer graph.deinit();
    try text.scan(&graph, diagnostic);
    graph.is_first = false;
    var unheard: Diagnostic = .{};
    try text.scan(&graph, diagnostic);
    try text.scan(null, &unheard);
}

/// The text with a key of the document as one that is not known; null: it has none. The caller
/// frees it.
fn without(text: *Text, comptime key: []const u8) Error!?[]u8 {
    // Within strings, quotes are escaped.
    const quoted = "\"" ++ key ++ "\"";
    var start: usize = 0;
    while (std.mem.findPos(u8, text.bytes, start, quoted)) |at| : (start = at + 1) {
        const rest = std.mem.trimStart(u8, text.bytes[at + quoted.len ..], " \t\r\n");
        if (std.mem.startsWith(u8, rest, ":")) try text.lenience.hideKey(at);
    }
    return text.lenience.apply(text.bytes);
}

/// The text where it has animations, whatever cgltf sees of them.
pub fn animated(text: *const Text) ?[]const u8 {
    const count = text.checked.lengths[@backingInt(schema.List.animations)];
    return if (count > 0) text.bytes else null;
}

/// The doubles of the text; the caller frees them.
pub fn readDoubles(text: *Text) error{OutOfMemory}![]json.Double {
    return json.readDoubles(
        text.gpa,
        text.bytes,
        &schema.document,
        &text.checked,
        &text.lenience,
    );
}
