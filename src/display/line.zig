//! The line of progress on a terminal: a standing in words, cut to the terminal's width.
//!
//! It stands alone in its row, is written over by the next one, and is erased before anything else
//! is said. Its escape codes are those that every terminal but a dumb one knows (ECMA-48, EL).

const std = @import("std");
const progress_file = @import("../progress.zig");
const Place = @import("standing.zig").Place;
const Standing = @import("standing.zig").Standing;
const Writer = std.Io.Writer;
const printable = @import("../diagnostic.zig").printable;

/// Columns of a terminal that does not tell.
pub const width_default = 80;

/// To the start of the row, and erase it to its end.
const erasing = "\r\x1b[K";

/// Whether the line is on the terminal: for whoever writes there, a signal handler as well.
pub const Line = struct {
    is_shown: std.atomic.Value(bool) = .init(false),
    /// The program is ending.
    is_closed: std.atomic.Value(bool) = .init(false),

    /// Writes a text in place of the one before; the writer has room for all of it.
    pub fn draw(line: *Line, writer: *Writer, text: []const u8) Writer.Error!void {
        line.is_shown.store(true, .seq_cst);
        if (line.is_closed.load(.seq_cst)) return;
        try writer.print("\r{s}\x1b[K", .{text});
        try writer.flush();
    }

    /// Erases it where it is shown, before something else is written.
    pub fn erase(line: *Line, writer: *Writer) Writer.Error!void {
        if (line.is_shown.swap(false, .seq_cst)) try writer.writeAll(erasing);
    }

    /// Erases it from a terminal for good. Async-signal-safe.
    pub fn close(line: *Line, terminal: std.posix.fd_t) void {
        line.is_closed.store(true, .seq_cst);
        if (line.is_shown.swap(false, .seq_cst))
            _ = std.c.write(terminal, erasing, erasing.len);
    }
};

/// Writes where the first of `under_way` files stands in less than `width` columns. The buffer has
/// room for `text_bytes_max`.
pub fn write(buffer: []u8, standing: *const Standing, under_way: usize, width: usize) []const u8 {
    var writer: Writer = .fixed(buffer[0..text_bytes_max]);
    writeText(&writer, standing, under_way) catch |err| switch (err) {
        error.WriteFailed => {}, // Full, and wider than any terminal.
    };
    return cut(writer.buffered(), width -| 1);
}

/// Of a line, whatever the width.
pub const text_bytes_max = 1024;

fn writeText(writer: *Writer, standing: *const Standing, under_way: usize) Writer.Error!void {
    try writePlace(writer, standing.place);
    if (under_way > 1) try writer.print(" and {d} more", .{under_way - 1});
    const pictures = standing.pictures orelse 1;
    if (pictures > 1) try writer.print(", picture {d}/{d}", .{ standing.picture.?, pictures });
    try writer.print(": {t}", .{standing.stage});
    if (standing.fraction) |fraction| try writer.print(" {d:.0}%", .{@floor(100 * fraction)});
    try writeUnits(writer, standing);
    if (if (pictures > 1) standing.pictures_left_s else standing.left_s) |left_s| {
        try writer.writeAll(", ");
        try writeDuration(writer, left_s);
        try writer.writeAll(" left");
    }
    const rate = (standing.rays_per_s orelse return) / 1e6;
    try if (rate < 1)
        writer.print(", {d:.2} Mrays/s", .{rate})
    else
        writer.print(", {d:.1} Mrays/s", .{rate});
}

/// `3/60 Fox.glb`, or without the number where it is the only one.
fn writePlace(writer: *Writer, place: Place) Writer.Error!void {
    if (place.count > 1) try writer.print("{d}/{d} ", .{ place.index, place.count });
    const name = std.fs.path.basename(place.name);
    const shown = cut(name, name_columns_max);
    try writer.print("{f}{s}", .{ printable(shown), if (shown.len < name.len) "..." else "" });
}

/// Of a file's name: what follows matters more.
const name_columns_max = 30;

fn writeUnits(writer: *Writer, standing: *const Standing) Writer.Error!void {
    const done = standing.done orelse return;
    const unit: []const u8 = switch (standing.stage) {
        .reading => return writer.print(", {B:.1}", .{done}),
        .textures => "images",
        .tracing => "samples",
        .measuring => "renderings",
        .parsing, .geometry, .tree, .view, .lights, .denoising, .writing => return,
    };
    if (standing.total) |total| {
        if (total > 1) try writer.print(", {d} of {d} {s}", .{ done, total, unit });
    } else try writer.print(", {d} {s}", .{ done, unit });
}

/// `12 s`, `3:05` or `1:02:03`.
pub fn writeDuration(writer: *Writer, seconds: f64) Writer.Error!void {
    const whole: u64 = @intFromFloat(@min(@ceil(@max(0, seconds)), 1e9));
    if (whole < 60) return writer.print("{d} s", .{whole});
    const minutes = whole / 60;
    if (minutes < 60) return writer.print("{d}:{d:0>2}", .{ minutes, whole % 60 });
    return writer.print("{d}:{d:0>2}:{d:0>2}", .{ minutes / 60, minutes % 60, whole % 60 });
}

/// As much of a text as some columns hold. Letters of Latin, Greek, Cyrillic and others up to
/// Georgian take one, all that comes later counts as two, which East Asian ones take.
fn cut(text: []const u8, columns: usize) []const u8 {
    var left = columns;
    var index: usize = 0;
    while (index < text.len) {
        const length = std.unicode.utf8ByteSequenceLength(text[index]) catch 1;
        const end = @min(index + length, text.len);
        const is_whole = index + length == end;
        const code_point = if (is_whole) std.unicode.utf8Decode(text[index..end]) catch 0 else 0;
        const taken: usize = if (code_point < 0x1100) 1 else 2;
        if (taken > left) break;
        left -= taken;
        index = end;
    }
    return text[0..index];
}

const testing = std.testing;

const tracing_for_test: Standing = .{
    .place = .{ .index = 3, .count = 60, .name = "models/Fox.glb" },
    .stage = .tracing,
    .done = 12,
    .total = 64,
    .fraction = 0.199,
    .elapsed_s = 20,
    .left_s = 64.2,
    .rays_per_s = 35.24e6,
};

test "a standing in words" {
    var buffer: [text_bytes_max]u8 = undefined;
    try testing.expectEqualStrings(
        "3/60 Fox.glb: tracing 19%, 12 of 64 samples, 1:05 left, 35.2 Mrays/s",
        write(&buffer, &tracing_for_test, 1, 80),
    );
    try testing.expectEqualStrings(
        "3/60 Fox.glb and 2 more: tracin",
        write(&buffer, &tracing_for_test, 3, 32),
    );
    try testing.expectEqualStrings("", write(&buffer, &tracing_for_test, 1, 1));
    var standing = tracing_for_test;
    standing.picture = 7;
    standing.pictures = 240;
    standing.pictures_left_s = 50;
    try testing.expectEqualStrings(
        "3/60 Fox.glb, picture 7/240: tracing 19%, 12 of 64 samples, 50 s left, 35.2 Mrays/s",
        write(&buffer, &standing, 1, 100),
    );
    standing.pictures = 1;
    standing.place = .{ .index = 1, .count = 1, .name = "-" };
    standing.total = null;
    standing.left_s = null;
    standing.rays_per_s = null;
    standing.fraction = null;
    try testing.expectEqualStrings(
        "-: tracing, 12 samples",
        write(&buffer, &standing, 1, width_default),
    );
    standing.stage = .reading;
    standing.done = 2_500_000;
    try testing.expectEqualStrings("-: reading, 2.5MB", write(&buffer, &standing, 1, 80));
    standing.stage = .tree;
    standing.fraction = 1;
    try testing.expectEqualStrings("-: tree 100%", write(&buffer, &standing, 1, 80));
}

test "a stranger's name neither steers the terminal nor takes the whole row" {
    var buffer: [text_bytes_max]u8 = undefined;
    var standing = tracing_for_test;
    standing.place.name = "\x1b[2Ja\nb\xff";
    try testing.expectEqualStrings("3/60 ?[2Ja?b?: tracing", write(&buffer, &standing, 1, 23));
    const long: [5000]u8 = @splat('x');
    standing.place.name = &long;
    const text = write(&buffer, &standing, 1, 500);
    try testing.expect(std.mem.startsWith(u8, text, "3/60 " ++ long[0..30] ++ "...: tracing 19%"));
    standing.place.name = "\u{72d0}\u{72d0}\u{72d0}";
    try testing.expectEqualStrings("3/60 \u{72d0}\u{72d0}", write(&buffer, &standing, 1, 11));
}

test "times" {
    for ([_]struct { f64, []const u8 }{
        .{ 0, "0 s" },      .{ 0.2, "1 s" },      .{ 59, "59 s" },           .{ 59.5, "1:00" },
        .{ 3599, "59:59" }, .{ 3723, "1:02:03" }, .{ 1e30, "277777:46:40" },
    }) |case| {
        var buffer: [64]u8 = undefined;
        var writer: Writer = .fixed(&buffer);
        try writeDuration(&writer, case[0]);
        try testing.expectEqualStrings(case[1], writer.buffered());
    }
}

test "the line is erased once, and not drawn any more when the program is ending" {
    var buffer: [64]u8 = undefined;
    var writer: Writer = .fixed(&buffer);
    var line: Line = .{};
    try line.erase(&writer);
    try testing.expectEqual(0, writer.end);
    try line.draw(&writer, "a");
    try line.erase(&writer);
    try line.erase(&writer);
    try testing.expectEqualStrings("\ra\x1b[K\r\x1b[K", writer.buffered());
    writer.end = 0;
    try line.draw(&writer, "a");
    var ends: [2]std.posix.fd_t = undefined;
    try testing.expectEqual(0, std.c.pipe(&ends));
    defer for (ends) |end| {
        _ = std.c.close(end);
    };
    line.close(ends[1]);
    var read: [16]u8 = undefined;
    const count = std.c.read(ends[0], &read, read.len);
    try testing.expectEqual(@as(isize, erasing.len), count);
    try testing.expectEqualStrings(erasing, read[0..erasing.len]);
    writer.end = 0;
    try line.draw(&writer, "b");
    try testing.expectEqual(0, writer.end);
}
