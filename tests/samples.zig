//! Real files: every glTF sample beside the checkout is read, with as many triangles as it draws.
//!
//! In: the samples and the table of their triangle counts, where there are any. Out: the count of
//! the table, or a refusal that names what is not read: Draco, where the build has none.

const std = @import("std");
const raylane = @import("raylane");
const Diagnostic = raylane.diagnostic.Diagnostic;
const testing = std.testing;
const gpa = testing.allocator;
const io = testing.io;

const folder = "../shared/scenes";

test "the samples draw as many triangles as their table says" {
    const cwd: std.Io.Dir = .cwd();
    const limit: std.Io.Limit = .limited(1 << 20);
    const table = cwd.readFileAlloc(io, folder ++ "/README.md", gpa, limit) catch
        return error.SkipZigTest;
    defer gpa.free(table);
    var lines = std.mem.tokenizeScalar(u8, table, '\n');
    var counts: struct { read: usize = 0, refused: usize = 0, failed: usize = 0 } = .{};
    while (lines.next()) |line| {
        const row = parseRow(line) orelse continue;
        const path = try std.fs.path.join(gpa, &.{ folder, "khronos", row.name });
        defer gpa.free(path);
        var said: Diagnostic = .{};
        var scene = raylane.parse.parse(gpa, io, path, .{}, &said) catch |err| {
            const is_expected = for ([_][]const u8{ "'KHR_draco_", "'EXT_mesh_gpu_" }) |name| {
                if (std.mem.find(u8, said.message.text(), name) != null) break true;
            } else false;
            if (is_expected and err == error.InvalidInput) {
                counts.refused += 1;
            } else {
                counts.failed += 1;
                std.debug.print("{s}: {s}\n", .{ row.name, said.message.text() });
            }
            continue;
        };
        defer scene.deinit();
        scene.check();
        counts.read += 1;
        if (scene.triangleCount() == row.drawn_count) continue;
        counts.failed += 1;
        std.debug.print("{s}: {d} triangles instead of {d}\n", .{
            row.name, scene.triangleCount(), row.drawn_count,
        });
    }
    try testing.expect(counts.read > 0);
    try testing.expect(counts.refused > 0 or raylane.decode.draco.is_held);
    try testing.expectEqual(0, counts.failed);
}

const Row = struct { name: []const u8, drawn_count: u64 };

/// A line of the form `| file | unique / drawn | ...`.
fn parseRow(line: []const u8) ?Row {
    var columns = std.mem.tokenizeScalar(u8, line, '|');
    const name = std.mem.trim(u8, columns.next() orelse return null, " ");
    const is_sample = std.mem.endsWith(u8, name, ".glb") or std.mem.endsWith(u8, name, ".gltf");
    var counts = std.mem.splitSequence(u8, columns.next() orelse return null, " / ");
    _ = counts.next();
    const drawn = std.mem.trim(u8, counts.next() orelse return null, " ");
    if (!is_sample) return null;
    return .{ .name = name, .drawn_count = std.fmt.parseInt(u64, drawn, 10) catch return null };
}

test "the large scenes have the triangles that their names and the thesis say" {
    const scenes = [_]struct { []const u8, u64 }{
        .{ "thesis/sponza.glb", 66_454 },
        .{ "thesis/sibenik.glb", 80_479 },
        .{ "thesis/yeahright.glb", 188_674 },
        .{ "thesis/cornell.glb", 3_978 },
        .{ "thesis/cornell_original.glb", 32 },
        .{ "large/crytek_sponza_262267.glb", 262_267 },
        .{ "large/coffee_235271.glb", 235_271 },
        .{ "large/stanford_dragon_871414.glb", 871_414 },
    };
    for (scenes) |expected| {
        const path = try std.fs.path.join(gpa, &.{ folder, expected[0] });
        defer gpa.free(path);
        std.Io.Dir.cwd().access(io, path, .{}) catch return error.SkipZigTest;
        var said: Diagnostic = .{};
        var scene = try raylane.parse.parse(gpa, io, path, .{}, &said);
        defer scene.deinit();
        scene.check();
        try testing.expectEqual(expected[1], scene.triangleCount());
        try testing.expectEqual(1, scene.cameras.len);
        try testing.expect(scene.lights.len > 0);
    }
}
