//! The manual's page, raylane(1), made of the texts and tables that the help is made of.
//!
//! In: the commands. Out: roff with the macros of man(7), for man, groff and mandoc alike.

const std = @import("std");
const cli = @import("../cli.zig");
const page_file = @import("page.zig");
const writeEscaped = @import("completion.zig").writeEscaped;
const Entry = page_file.Entry;
const Page = page_file.Page;
const Writer = std.Io.Writer;

/// What `raylane man --help` prints.
pub const help: []const u8 = "raylane " ++ cli.version ++
    \\: prints its manual's page, as roff
    \\
    \\usage: raylane man
    \\
    \\To read it, or to keep it where man looks:
    \\
    \\  raylane man | man -l -
    \\  raylane man > ~/.local/share/man/man1/raylane.1
    \\
;

/// Writes the page of all commands, that without a word first.
pub fn write(writer: *Writer, version: []const u8, pages: []const Page) Writer.Error!void {
    try writer.writeAll(".\\\" Made by 'raylane man'.\n");
    try writer.print(".TH RAYLANE 1 \"\" \"raylane {s}\" \"User Commands\"\n", .{version});
    for (pages) |*page| {
        if (page.word.len == 0) {
            try writer.writeAll(".SH NAME\nraylane \\- ");
            try writeText(writer, page.summary);
            try writer.writeAll("\n.SH SYNOPSIS\n");
        } else {
            try writer.print(".SH RAYLANE {s}\n", .{page.word});
            try writeText(writer, page.summary);
            try writer.writeAll(".\n");
            try writer.writeAll(".PP\n");
        }
        try writer.writeAll(".nf\n");
        try writeLines(writer, page.usage, "       ");
        try writer.writeAll(".fi\n");
        try writer.writeAll(if (page.word.len == 0) ".SH DESCRIPTION\n" else ".PP\n");
        try writeParagraphs(writer, page.before);
        if (page.describes_options) {
            if (page.word.len == 0) try writer.writeAll(".SH OPTIONS\n");
            var options = page.iterate();
            while (options.next()) |entry| try writeOption(writer, &entry);
        }
        if (page.after.len == 0) continue;
        try writer.writeAll(if (page.word.len == 0) ".SH NOTES\n" else ".SS Notes\n");
        try writeParagraphs(writer, page.after);
    }
}

fn writeOption(writer: *Writer, entry: *const Entry) Writer.Error!void {
    if (entry.section) |title| {
        try writer.writeAll(".SS \"");
        try writeText(writer, title);
        try writer.writeAll("\"\n");
    }
    const flag = entry.flag;
    try writer.writeAll(".TP\n");
    if (flag.short != 0) try writer.print("\\fB\\-{c}\\fR, ", .{flag.short});
    try writer.writeAll("\\fB");
    try writeText(writer, flag.long);
    try writer.writeAll("\\fR");
    if (flag.value.len > 0) {
        try writer.writeAll(" \\fI");
        try writeText(writer, flag.value);
        try writer.writeAll("\\fR");
    }
    try writer.writeByte('\n');
    try writeLines(writer, entry.option.help, "");
}

/// Paragraphs below a heading, with empty lines between them; those with columns stay as they are.
fn writeParagraphs(writer: *Writer, text: []const u8) Writer.Error!void {
    var paragraphs = std.mem.splitSequence(u8, std.mem.trim(u8, text, "\n"), "\n\n");
    var is_first = true;
    while (paragraphs.next()) |paragraph| : (is_first = false) {
        const has_columns = std.mem.find(u8, paragraph, "  ") != null;
        if (!is_first) try writer.writeAll(".PP\n");
        if (has_columns) try writer.writeAll(".nf\n");
        try writeLines(writer, std.mem.trim(u8, paragraph, "\n"), "");
        if (has_columns) try writer.writeAll(".fi\n");
    }
}

/// Writes lines, without what they may begin with.
fn writeLines(writer: *Writer, text: []const u8, indent: []const u8) Writer.Error!void {
    var lines = std.mem.splitScalar(u8, text, '\n');
    while (lines.next()) |line| {
        const inner = std.mem.cutPrefix(u8, line, indent) orelse line;
        // In front of a line, these would make it a request.
        if (std.mem.startsWith(u8, inner, ".") or std.mem.startsWith(u8, inner, "'"))
            try writer.writeAll("\\&");
        try writeText(writer, inner);
        try writer.writeByte('\n');
    }
}

fn writeText(writer: *Writer, text: []const u8) Writer.Error!void {
    return writeEscaped(writer, text, &.{
        .{ "\\", "\\e" }, .{ "-", "\\-" }, .{ "'", "\\(aq" }, .{ "\"", "\\(dq" },
    });
}
