//! Frames of a scene in motion: what posing again costs beside tracing.
//!
//! In: SCENE [FRAMES [SIZE]]. Out: the middle times of the stages of a frame whose pose comes after
//! the one before it, and of a frame that is posed from nothing; both must be the same pictures
//! (exit code 4 if not). The first animation runs; in a scene without any, every node with a mesh
//! swings about an axis. Not a goal: times to compare between machines.

const std = @import("std");
const raylane = @import("raylane");
const AffineD = raylane.math.AffineD;
const Allocator = std.mem.Allocator;
const Diagnostic = raylane.diagnostic.Diagnostic;
const Io = std.Io;
const Session = raylane.session.Session;
const scene_file = raylane.scene;

const frame_count_default = 120;
const size_default = 256;

/// Half the angle that a node swings by.
const swing_rad = 0.15;

/// Nodes swing once in a second.
const frames_a_second = 30;

const Stage = enum { pose, tree, view, trace };
const Times = std.EnumArray(Stage, []u64);

pub fn main(init: std.process.Init) !u8 {
    const arena = init.arena.allocator();
    const arguments = try init.minimal.args.toSlice(arena);
    const frame_count = numberAt(arguments, 2, frame_count_default);
    const size = numberAt(arguments, 3, size_default);
    if (arguments.len < 2 or arguments.len > 4 or frame_count == 0 or size == 0) {
        std.debug.print("usage: frames SCENE [FRAMES [SIZE]]\n", .{});
        return 2;
    }
    var diagnostic: Diagnostic = .{};
    var scene = raylane.session.loadScene(init.gpa, init.io, arguments[1], .{}, &diagnostic) catch {
        std.debug.print("frames: {s}: {s}\n", .{ arguments[1], diagnostic.message.text() });
        return 1;
    };
    defer scene.deinit();
    const at_rest = scene.nodes;
    const nodes = try arena.dupe(scene_file.Node, at_rest);
    scene.nodes = nodes;
    var frames: Frames = .{
        .session = .init(init.gpa, init.io, null, &diagnostic),
        .scene = &scene,
        .at_rest = at_rest,
        .nodes = nodes,
        .moving = try movingNodes(arena, &scene),
        .size = size,
    };
    defer frames.session.deinit();
    const hashes = try arena.alloc(u64, frame_count);
    var runs: [2]Times = undefined;
    for (&runs, [_]bool{ true, false }) |*times, is_again| {
        for (&times.values) |*list| list.* = try arena.alloc(u64, frame_count);
        frames.session.adopt(scene, .borrowed);
        for (0..frame_count) |frame| {
            if (!is_again) frames.session.adopt(scene, .borrowed);
            const hash = try frames.run(frame, times);
            if (is_again) hashes[frame] = hash;
            if (hash != hashes[frame]) {
                std.debug.print("frames: {d}: another picture\n", .{frame});
                return 4;
            }
        }
    }
    try print(init.io, &scene, size, &runs);
    return 0;
}

fn numberAt(arguments: []const [:0]const u8, index: usize, default: u32) u32 {
    if (index >= arguments.len) return default;
    return std.fmt.parseInt(u32, arguments[index], 10) catch 0;
}

/// Nodes that meshes hang on.
fn movingNodes(arena: Allocator, scene: *const scene_file.Scene) ![]bool {
    const moving = try arena.alloc(bool, scene.nodes.len);
    @memset(moving, false);
    for (scene.instances) |instance| moving[instance.node] = true;
    return moving;
}

const Frames = struct {
    session: Session,
    scene: *const scene_file.Scene,
    at_rest: []const scene_file.Node,
    nodes: []scene_file.Node,
    moving: []const bool,
    size: u32,
    animation: raylane.settings.Animation = .{},

    /// Makes a frame. Returns the hash of its picture.
    fn run(frames: *Frames, frame: usize, times: *Times) !u64 {
        const time_s = @as(f64, @floatFromInt(frame)) / frames_a_second;
        if (frames.scene.animations.len > 0)
            frames.animation = .{ .which = .{ .index = 0 }, .time_s = @floatCast(time_s) }
        else
            frames.swing(time_s);
        const session = &frames.session;
        const view: raylane.settings.View = .{ .long_side = frames.size };
        try session.pose(.{
            .lanes = raylane.variant.compiled[0].lanes,
            .view = view,
            .animation = frames.animation,
        });
        times.get(.pose)[frame] = session.times.prepare_ns;
        times.get(.tree)[frame] = session.times.bvh_build_ns;
        const begin = Io.Clock.awake.now(session.io);
        try session.view(view);
        times.get(.view)[frame] = @intCast(begin.untilNow(session.io, .awake).toNanoseconds());
        try session.render(.{});
        times.get(.trace)[frame] = session.times.trace_ns;
        return session.film.?.hash();
    }

    fn swing(frames: *const Frames, time_s: f64) void {
        const elementary = raylane.math.elementary;
        for (frames.nodes, frames.at_rest, frames.moving, 0..) |*node, rest, moves, index| {
            if (!moves) continue;
            const phase = 2 * std.math.pi * time_s + @as(f64, @floatFromInt(index));
            const half = swing_rad * elementary.sin(phase) / 2;
            const turn = [4]f64{ 0, elementary.sin(half), 0, elementary.cos(half) };
            const swung: AffineD = .fromTrs(.{ 0, 0, 0 }, turn, .{ 1, 1, 1 });
            node.local = .compose(rest.local, swung);
        }
    }
};

fn print(io: Io, scene: *const scene_file.Scene, size: u32, runs: *const [2]Times) !void {
    var buffer: [1024]u8 = undefined;
    var stdout: Io.File.Writer = .initStreaming(.stdout(), io, &buffer);
    const out = &stdout.interface;
    try out.print("{d} triangles, {d} frames, {d} pixels on the long side\n", .{
        scene.triangleCount(), runs[0].get(.pose).len, size,
    });
    try out.print("middle times in ms", .{});
    for (std.enums.values(Stage)) |stage| try out.print("{t:>10}", .{stage});
    try out.print("{s:>24}\n", .{"pose and tree to all"});
    for (runs, [_][]const u8{ "posed again", "posed anew" }) |*times, name| {
        try out.print("{s:<18}", .{name});
        var sums: [2]f64 = @splat(0);
        for (std.enums.values(Stage)) |stage| {
            const list = times.get(stage);
            std.mem.sort(u64, list, {}, std.sort.asc(u64));
            const middle_ms = @as(f64, @floatFromInt(list[list.len / 2])) / std.time.ns_per_ms;
            try out.print("{d:>10.3}", .{middle_ms});
            sums[0] += middle_ms;
            if (stage == .pose or stage == .tree) sums[1] += middle_ms;
        }
        try out.print("{d:>22.2} %\n", .{100 * sums[1] / sums[0]});
    }
    try out.flush();
}
