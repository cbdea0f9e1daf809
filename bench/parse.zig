//! The parse benchmark: how fast PBRT text becomes a scene, beside `wc -w` on the same file.
//!
//! In: a PBRT scene, the file that holds most of its text if it is another one, a number of rounds.
//! Out: the least and the middle time of both, taken by turns, the rate, and their ratio. `wc`
//! starts anew each time and reads the file, as we do; its start is timed too, on an empty file,
//! and taken off. One thread. Not a goal: times to compare between machines.

const std = @import("std");
const raylane = @import("raylane");
const Allocator = std.mem.Allocator;
const Clock = std.Io.Clock;
const Diagnostic = raylane.diagnostic.Diagnostic;
const Io = std.Io;

const rounds_default = 15;

pub fn main(init: std.process.Init) !u8 {
    _ = raylane.simd.setFlushToZero();
    const arena = init.arena.allocator();
    const arguments = try init.minimal.args.toSlice(arena);
    const rounds = if (arguments.len == 4)
        std.fmt.parseInt(u32, arguments[3], 10) catch 0
    else
        rounds_default;
    if (arguments.len < 2 or arguments.len > 4 or rounds == 0) {
        std.debug.print("usage: parse SCENE.pbrt [TEXT [ROUNDS]]\n", .{});
        return 2;
    }
    const scene_path = arguments[1];
    const text_path = if (arguments.len > 2) arguments[2] else scene_path;
    const ours = try arena.alloc(u64, rounds);
    const words = try arena.alloc(u64, rounds);
    const starts = try arena.alloc(u64, rounds);
    var triangle_count: u64 = 0;
    const text_stat = try Io.Dir.cwd().statFile(init.io, text_path, .{});
    for (ours, words, starts) |*our, *word, *start| {
        our.* = try timeParse(init.gpa, init.io, scene_path, &triangle_count);
        word.* = try timeWords(init.gpa, init.io, text_path);
        start.* = try timeWords(init.gpa, init.io, "/dev/null");
    }
    for ([_][]u64{ ours, words, starts }) |times| std.mem.sort(u64, times, {}, std.sort.asc(u64));
    var buffer: [1024]u8 = undefined;
    var stdout: Io.File.Writer = .initStreaming(.stdout(), init.io, &buffer);
    const out = &stdout.interface;
    try out.print("{d} bytes, {d} triangles, {d} rounds\n", .{
        text_stat.size, triangle_count, rounds,
    });
    try out.print("                least    middle   MB/s (least)\n", .{});
    try report(out, "parse", ours, 0, text_stat.size);
    try report(out, "wc -w", words, starts[0], text_stat.size);
    const ratio = @as(f64, @floatFromInt(words[0] - @min(starts[0], words[0]))) /
        @as(f64, @floatFromInt(ours[0]));
    try out.print("wc -w over parse, least times: {d:.2}\n", .{ratio});
    try out.flush();
    return 0;
}

/// Nanoseconds from opening the file to the scene.
fn timeParse(gpa: Allocator, io: Io, path: []const u8, triangle_count: *u64) !u64 {
    const begin = Clock.awake.now(io);
    var diagnostic: Diagnostic = .{};
    var scene = raylane.session.loadScene(gpa, io, path, .{}, &diagnostic) catch |err| {
        std.debug.print("{s}: {s}\n", .{ diagnostic.place.text(), diagnostic.message.text() });
        return err;
    };
    const end = Clock.awake.now(io);
    defer scene.deinit();
    triangle_count.* = scene.triangleCount();
    return @intCast(begin.durationTo(end).toNanoseconds());
}

/// Nanoseconds that `wc -w` takes from its start to its end.
fn timeWords(gpa: Allocator, io: Io, path: []const u8) !u64 {
    const begin = Clock.awake.now(io);
    const result = try std.process.run(gpa, io, .{ .argv = &.{ "wc", "-w", path } });
    defer gpa.free(result.stdout);
    defer gpa.free(result.stderr);
    return @intCast(begin.untilNow(io, .awake).toNanoseconds());
}

fn report(out: *Io.Writer, name: []const u8, sorted: []const u64, less: u64, bytes: u64) !void {
    const least = sorted[0] -| less;
    const middle = sorted[sorted.len / 2] -| less;
    const rate = @as(f64, @floatFromInt(bytes)) * 1e3 / @as(f64, @floatFromInt(@max(least, 1)));
    try out.print("{s:<10} {d:>8.2} ms {d:>6.2} ms {d:>8.0}\n", .{
        name,
        @as(f64, @floatFromInt(least)) / 1e6,
        @as(f64, @floatFromInt(middle)) / 1e6,
        rate,
    });
}
