//! Progress for programs: a standing as one JSON object in one line (docs/progress.md).
//!
//! All keys are there in every line, in one order; what is not known is null.

const std = @import("std");
const Standing = @import("standing.zig").Standing;
const Stringify = std.json.Stringify;
const Text = @import("../report.zig").Text;
const Writer = std.Io.Writer;

/// Writes the object and a line end. `stage` is the standing's, or how the file ended.
pub fn write(writer: *Writer, stage: []const u8, standing: *const Standing) Writer.Error!void {
    try Stringify.value(.{
        .stage = stage,
        .done = standing.done,
        .total = standing.total,
        .fraction = rounded(standing.fraction, 1e4),
        .elapsed_s = rounded(standing.elapsed_s, 1e3),
        .left_s = rounded(standing.left_s, 10),
        .rays_per_s = rounded(standing.rays_per_s, 1),
        .picture = standing.picture,
        .pictures = standing.pictures,
        .pictures_left_s = rounded(standing.pictures_left_s, 10),
        .file = Text{ .bytes = standing.place.name },
        .index = standing.place.index,
        .count = standing.place.count,
    }, .{}, writer);
    try writer.writeByte('\n');
}

/// To so many parts of 1.
fn rounded(number: ?f64, parts: f64) ?f64 {
    return @round((number orelse return null) * parts) / parts;
}

test write {
    var buffer: [1024]u8 = undefined;
    var writer: Writer = .fixed(&buffer);
    var standing: Standing = .{
        .place = .{ .index = 3, .count = 60, .name = "a\n\"\xff.glb" },
        .stage = .tracing,
        .done = 12,
        .total = 64,
        .fraction = 0.19876,
        .elapsed_s = 20.12345,
        .left_s = 64.26,
        .rays_per_s = 35_240_000.7,
    };
    try write(&writer, "tracing", &standing);
    const line = writer.buffered();
    try std.testing.expectEqual(line.len - 1, std.mem.findScalar(u8, line, '\n').?);
    const Parsed = struct {
        stage: []const u8,
        done: ?u64,
        total: ?u64,
        fraction: ?f64,
        elapsed_s: f64,
        left_s: ?f64,
        rays_per_s: ?f64,
        picture: ?u64,
        pictures: ?u64,
        pictures_left_s: ?f64,
        file: []const u8,
        index: u32,
        count: u32,
    };
    const gpa = std.testing.allocator;
    const parsed = try std.json.parseFromSlice(Parsed, gpa, line, .{});
    defer parsed.deinit();
    const found = &parsed.value;
    try std.testing.expectEqualStrings("tracing", found.stage);
    try std.testing.expectEqualStrings("a\n\"\u{fffd}.glb", found.file);
    try std.testing.expectEqual(0.1988, found.fraction.?);
    try std.testing.expectEqual(20.123, found.elapsed_s);
    try std.testing.expectEqual(64.3, found.left_s.?);
    try std.testing.expectEqual(35_240_001, found.rays_per_s.?);
    try std.testing.expectEqual(12, found.done.?);
    try std.testing.expectEqual(null, found.picture);

    standing.fraction = null;
    standing.left_s = null;
    standing.done = null;
    standing.total = null;
    standing.rays_per_s = null;
    writer.end = 0;
    try write(&writer, "done", &standing);
    const ended = try std.json.parseFromSlice(Parsed, gpa, writer.buffered(), .{});
    defer ended.deinit();
    try std.testing.expectEqualStrings("done", ended.value.stage);
    try std.testing.expectEqual(null, ended.value.left_s);
    try std.testing.expectEqual(null, ended.value.total);
}
