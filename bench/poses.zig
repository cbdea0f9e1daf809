//! Posed triangles, for `poses.py` to compare with what it comes to by itself.
//!
//! In: a scene, an animation as `--animation` has it (or `-` for none), a time in seconds. Out, on
//! standard output: nine little-endian 32-bit floats for each triangle in the order of their
//! numbers, the three corners in the world; NaN for triangles that are dropped.

const std = @import("std");
const raylane = @import("raylane");
const prepare = raylane.prepare;

pub fn main(init: std.process.Init) !u8 {
    _ = raylane.simd.setFlushToZero();
    const arguments = try init.minimal.args.toSlice(init.arena.allocator());
    if (arguments.len != 4) {
        std.debug.print("usage: poses SCENE ANIMATION|- SECONDS\n", .{});
        return 2;
    }
    var diagnostic: raylane.diagnostic.Diagnostic = .{};
    write(init, arguments, &diagnostic) catch |err| {
        std.debug.print("poses: {s}: {s}\n", .{ arguments[1], diagnostic.message.text() });
        return err;
    };
    return 0;
}

fn write(
    init: std.process.Init,
    arguments: []const [:0]const u8,
    diagnostic: *raylane.diagnostic.Diagnostic,
) !void {
    const gpa = init.gpa;
    const io = init.io;
    const animation: raylane.settings.Animation = .{
        .which = whichOf(arguments[2]),
        .time_s = try std.fmt.parseFloat(f32, arguments[3]),
    };
    var scene = try raylane.parse.parse(gpa, io, arguments[1], .{}, diagnostic);
    defer scene.deinit();
    var pool: raylane.parallel.Pool = .init(1);
    defer pool.deinit();
    var times: raylane.statistics.StageTimes = .{};
    var loaded = try prepare.load(gpa, io, &scene, .{ .pool = &pool }, diagnostic, &times);
    defer loaded.deinit();
    var shown = try prepare.animateScene(gpa, &scene, animation, diagnostic);
    defer shown.deinit();
    var posed = try prepare.pose(gpa, io, &shown.scene, &loaded, .{
        .lanes = 4,
        .pool = &pool,
    }, diagnostic, &times);
    defer posed.deinit();
    const geometry = &posed.world.geometry;
    var buffer: [1 << 16]u8 = undefined;
    var stdout: std.Io.File.Writer = .initStreaming(.stdout(), io, &buffer);
    const out = &stdout.interface;
    var cursor: raylane.world.Cursor = .init(geometry);
    for (0..geometry.surfaceCount()) |primitive| {
        const triangle = cursor.triangleAt(@intCast(primitive));
        for (triangle.corner) |vertex| {
            const position: [3]f32 = if (triangle.isDropped())
                @splat(std.math.nan(f32))
            else
                cursor.positionAt(vertex);
            for (position) |number| try out.writeInt(u32, @bitCast(number), .little);
        }
    }
    try out.flush();
}

fn whichOf(text: []const u8) raylane.settings.Animation.Which {
    if (std.mem.eql(u8, text, "-")) return .default;
    if (std.mem.eql(u8, text, "all")) return .all;
    const index = std.fmt.parseInt(u32, text, 10) catch return .{ .name = text };
    return .{ .index = index };
}
