//! Which tree suits SIMD best: a binary BVH, one of four children, a kd-tree; single rays against
//! packets of 2x2.
//!
//! In: SCENE [--size N] [--count] [--json]. Out: times of primary, shadow and mirror rays through
//! each, or marks for bench/count in their place; all must come to the same hits (exit code 4 if
//! not). bench/structures.py makes docs/structures.md of it.

const std = @import("std");
const raylane = @import("raylane");
const binary = @import("structures/binary.zig");
const cost = @import("structures/cost.zig");
const input = @import("rays/input.zig");
const kd = @import("structures/kd.zig");
const phases = @import("rays/phases.zig");
const work = @import("structures/work.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = raylane.diagnostic.Diagnostic;
const Io = std.Io;
const Phase = phases.Phase;
const Query = raylane.trace.walk.Query;
const Setup = @import("rays/workload.zig").Setup;
const World = raylane.world.World;
const ray_file = raylane.trace.ray;

const repetition_count = 5;

const Structure = enum { bvh2, bvh4, kd };
const Traversal = enum { single, packet };

fn KernelOf(comptime traversal: raylane.variant.Traversal) type {
    return raylane.trace.kernel.Kernel(.{
        .backend = .vector,
        .traversal = traversal,
        .lanes = cost.width,
    }, false);
}
const SingleKernel = KernelOf(.single);
const PacketKernel = KernelOf(.packet2x2);

/// One structure with one kind of rays.
fn Tracer(comptime structure: Structure, comptime traversal: Traversal) type {
    return struct {
        worlds: *const Worlds,

        pub const Lanes = if (traversal == .single) ray_file.Single else PacketKernel.Rays;

        pub fn trace(
            tracer: *const @This(),
            comptime query: Query,
            group: *ray_file.Ray(Lanes),
        ) void {
            const worlds = tracer.worlds;
            const world = if (structure == .bvh2) &worlds.binary else &worlds.wide;
            var counts: raylane.statistics.TestCounts = .{};
            if (traversal == .single and !group.active.lane(0)) return;
            if (structure == .kd) switch (traversal) {
                .single => kd.traceSingle(SingleKernel, query, &worlds.kd, world, group),
                .packet => {
                    kd.tracePacket(SingleKernel, PacketKernel, query, &worlds.kd, world, group);
                },
            } else switch (traversal) {
                .single => {
                    _ = raylane.trace.single
                        .trace(SingleKernel, query, &world.geometry, group, &counts);
                },
                .packet => {
                    raylane.trace.bundle
                        .trace(PacketKernel, query, &world.geometry, group, &counts);
                },
            }
        }
    };
}

const Worlds = struct { wide: World, binary: World, kd: kd.Tree };

/// One structure with one kind of rays, as the JSON has it. The phases are those of bench/count.
const Run = struct {
    name: []const u8,
    first_tag: u32,
    primary: Cost,
    shadow: Cost,
    bounce: Cost,
    generation: Cost = .{},
    shading: Cost = .{},
    bounce_shadow: Cost = .{},
    bounce_shading: Cost = .{},
    hits: u64,
    occluded: u64,
    hash: []const u8,

    const Cost = struct { rays: u64 = 0, ms: ?f64 = null };
};

/// A tree, as the JSON has it; `lanes` is its name, the key by which bench/count reports.
const Build = struct {
    lanes: []const u8,
    first_tag: u32,
    nodes: usize,
    blocks: usize,
    bytes: usize,
};

const Options = struct {
    scene: []const u8 = "",
    size: u32 = 512,
    count: bool = false,
    json: bool = false,
};

pub fn main(init: std.process.Init) u8 {
    _ = raylane.simd.setFlushToZero();
    const arena = init.arena.allocator();
    const arguments = init.minimal.args.toSlice(arena) catch return 1;
    const options = parse(arguments[@min(1, arguments.len)..]) orelse {
        std.debug.print("usage: structures SCENE [--size N] [--count] [--json]\n", .{});
        return 2;
    };
    var diagnostic: Diagnostic = .{};
    const is_agreed = measure(init.gpa, arena, init.io, options, &diagnostic) catch |err| {
        const text = diagnostic.message.text();
        std.debug.print("structures: {s}\n", .{if (text.len > 0) text else @errorName(err)});
        return 1;
    };
    if (is_agreed) return 0;
    std.debug.print("structures: the hits differ\n", .{});
    return 4;
}

fn parse(arguments: []const [:0]const u8) ?Options {
    var options: Options = .{};
    var index: usize = 0;
    while (index < arguments.len) : (index += 1) {
        const argument = arguments[index];
        if (std.mem.eql(u8, argument, "--count")) {
            options.count = true;
        } else if (std.mem.eql(u8, argument, "--json")) {
            options.json = true;
        } else if (std.mem.eql(u8, argument, "--size") and index + 1 < arguments.len) {
            index += 1;
            options.size = std.fmt.parseInt(u32, arguments[index], 10) catch return null;
            if (options.size < 16 or options.size > 4096 or options.size % 16 != 0) return null;
        } else if (options.scene.len == 0 and argument.len > 0 and argument[0] != '-') {
            options.scene = argument;
        } else return null;
    }
    return if (options.scene.len > 0) options else null;
}

/// Whether all came to the same hits.
fn measure(
    gpa: Allocator,
    arena: Allocator,
    io: Io,
    options: Options,
    diagnostic: *Diagnostic,
) !bool {
    var worlds: Worlds = undefined;
    var session: raylane.session.Session = .init(gpa, io, 1, diagnostic);
    defer session.deinit();
    try session.load(options.scene, .{});
    try session.pose(.{ .lanes = cost.width });
    try session.view(.{
        .resolution = .{ options.size, options.size },
        .environment = .{ .source = .none },
    });
    session.dropScene();
    worlds.wide = session.world.?;
    const builds = try buildAll(gpa, arena, options, &session.pool, &worlds);
    const setup = try input.setUp(arena, &worlds.wide, diagnostic);

    var runs: std.ArrayList(Run) = .empty;
    const repetitions: usize = if (options.count) 1 else repetition_count;
    for (0..repetitions) |repetition| {
        var position: usize = 0;
        inline for (comptime std.enums.values(Structure)) |structure| {
            inline for (comptime std.enums.values(Traversal)) |traversal| {
                const T = Tracer(structure, traversal);
                const tag: u32 = @intCast(position * phases.tags_per_run);
                const name = @tagName(structure) ++ "-" ++ @tagName(traversal);
                const run = try runOne(T, arena, io, options, &worlds, &setup, name, tag);
                if (repetition == 0) try runs.append(arena, run);
                keepLeast(&runs.items[position], &run);
                position += 1;
            }
        }
    }
    try print(io, options, &worlds, builds, runs.items);
    for (runs.items) |run| if (!std.mem.eql(u8, run.hash, runs.items[0].hash)) return false;
    return true;
}

fn keepLeast(kept: *Run, run: *const Run) void {
    inline for (.{ "primary", "shadow", "bounce" }) |phase| {
        const ms = &@field(kept, phase).ms;
        if (ms.*) |least| ms.* = @min(least, @field(run, phase).ms.?);
    }
}

/// Builds all three, marked by themselves.
fn buildAll(
    gpa: Allocator,
    arena: Allocator,
    options: Options,
    pool: *raylane.parallel.Pool,
    worlds: *Worlds,
) ![]const Build {
    const tags = [_]u32{ 0, phases.tags_per_run, 2 * phases.tags_per_run };
    const list = try cost.references(arena, &worlds.wide);

    markBuild(options, tags[0]);
    worlds.binary = worlds.wide;
    const narrow = try binary.build(arena, &worlds.wide, try arena.dupe(cost.Reference, list));
    worlds.binary.geometry.tree = .{ .w4 = narrow };
    markBuild(options, tags[1]);
    _ = try raylane.prepare.buildTree(gpa, arena, &worlds.wide.geometry, .{
        .lanes = cost.width,
        .pool = pool,
    });
    markBuild(options, tags[2]);
    worlds.kd = try kd.build(arena, gpa, &worlds.wide, list);
    markBuild(options, null);

    const wide = &worlds.wide.geometry.tree.w4;
    return arena.dupe(Build, &.{
        buildOf("bvh2", tags[0], narrow.nodes, narrow.packs),
        buildOf("bvh4", tags[1], wide.nodes, wide.packs),
        buildOf("kd", tags[2], worlds.kd.nodes, worlds.kd.blocks),
    });
}

fn markBuild(options: Options, tag: ?u32) void {
    if (!options.count) return;
    var marks: phases.Marks = .init(.{ .tags = tag orelse 0 });
    marks.to(if (tag == null) .other else .build);
}

fn buildOf(name: []const u8, tag: u32, nodes: anytype, blocks: anytype) Build {
    return .{
        .lanes = name,
        .first_tag = tag,
        .nodes = nodes.len,
        .blocks = blocks.len,
        .bytes = std.mem.sliceAsBytes(nodes).len + std.mem.sliceAsBytes(blocks).len,
    };
}

fn runOne(
    comptime T: type,
    arena: Allocator,
    io: Io,
    options: Options,
    worlds: *const Worlds,
    setup: *const Setup,
    name: []const u8,
    tag: u32,
) !Run {
    const tracer: T = .{ .worlds = worlds };
    var marks: phases.Marks = .init(if (options.count) .{ .tags = tag } else .clock);
    const start = Io.Clock.awake.now(io);
    const start_ticks = phases.ticks();
    const counts = work.run(T.Lanes, &tracer, setup, &marks);
    const ticks: f64 = @floatFromInt(phases.ticks() - start_ticks);
    const total_ms = @as(f64, @floatFromInt(start.untilNow(io, .awake).toNanoseconds())) * 1e-6;
    const tick_ms = total_ms / ticks;
    const times: [3]?f64 = if (options.count) @splat(null) else .{
        tick_ms * @as(f64, @floatFromInt(marks.spent.get(.primary))),
        tick_ms * @as(f64, @floatFromInt(marks.spent.get(.shadow))),
        tick_ms * @as(f64, @floatFromInt(marks.spent.get(.bounce))),
    };
    return .{
        .name = name,
        .first_tag = tag,
        .primary = .{ .rays = counts.primary, .ms = times[0] },
        .shadow = .{ .rays = counts.hits, .ms = times[1] },
        .bounce = .{ .rays = counts.hits, .ms = times[2] },
        .hits = counts.hits,
        .occluded = counts.occluded,
        .hash = try arena.print("{x:0>16}", .{counts.hash}),
    };
}

fn print(
    io: Io,
    options: Options,
    worlds: *const Worlds,
    builds: []const Build,
    runs: []const Run,
) !void {
    var buffer: [4096]u8 = undefined;
    var stdout: Io.File.Writer = .initStreaming(.stdout(), io, &buffer);
    const writer = &stdout.interface;
    if (options.json) {
        try writer.print("{f}\n", .{std.json.fmt(.{
            .scene = options.scene,
            .triangles = worlds.wide.geometry.triangles.len,
            .size = options.size,
            .depth = 1,
            .builds = builds,
            .runs = runs,
        }, .{ .whitespace = .indent_1 })});
        return writer.flush();
    }
    try writer.print("{s:<14}{s:>14}{s:>14}{s:>14}   hits\n", .{
        "", "primary ms", "shadow ms", "mirror ms",
    });
    for (runs) |run| try writer.print("{s:<14}{d:>14.2}{d:>14.2}{d:>14.2}   {s}\n", .{
        run.name,
        run.primary.ms orelse 0,
        run.shadow.ms orelse 0,
        run.bounce.ms orelse 0,
        run.hash,
    });
    try writer.flush();
}
