//! The ray benchmark: how fast rays of each kind go through a scene, by each variant.
//!
//! In: a scene, a camera. Out: times by phase and rays a second, the tree's cost, and counts with a
//! hash that all variants must agree on (exit code 4 if not). See bench/README.md.

const std = @import("std");
const raylane = @import("raylane");
const dump = @import("rays/dump.zig");
const input = @import("rays/input.zig");
const observer_file = @import("rays/observer.zig");
const options_file = @import("rays/options.zig");
const phases = @import("rays/phases.zig");
const processors = @import("rays/processors.zig");
const report_file = @import("rays/report.zig");
const workload = @import("rays/workload.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = raylane.diagnostic.Diagnostic;
const Io = std.Io;
const Marks = phases.Marks;
const Observer = observer_file.Observer;
const Options = options_file.Options;
const Phase = phases.Phase;
const Session = raylane.session.Session;
const Spread = report_file.Spread;
const World = raylane.world.World;
const compiled = raylane.variant.compiled;
const assert = std.debug.assert;

/// Widths of trees.
const widths = [_]u8{ 4, 8, 16 };
const quality_count = std.enums.values(raylane.settings.TreeQuality).len;

pub fn main(init: std.process.Init) u8 {
    _ = raylane.simd.setFlushToZero();
    var diagnostic: Diagnostic = .{};
    const arena = init.arena.allocator();
    const all_arguments = init.minimal.args.toSlice(arena) catch
        return say(init.io, "out of memory", 1);
    const arguments = all_arguments[@min(1, all_arguments.len)..];
    const counting = init.environ_map.get("RAYLANE_COUNT") != null;
    const options = options_file.parse(arguments, counting, &diagnostic) catch |err| switch (err) {
        error.Usage => return say(init.io, diagnostic.message.text(), 2),
        error.Help => return printHelp(init.io),
    };
    var bench: Bench = .{
        .gpa = init.gpa,
        .arena = arena,
        .io = init.io,
        .options = &options,
        .diagnostic = &diagnostic,
        .session = .init(init.gpa, init.io, options.build_thread_count, &diagnostic),
    };
    defer bench.session.deinit();
    const agreed = bench.run() catch |err| {
        const text = diagnostic.message.text();
        return say(init.io, if (text.len > 0) text else @errorName(err), 1);
    };
    if (!agreed) return say(init.io, "the variants do not agree", 4);
    return 0;
}

fn printHelp(io: Io) u8 {
    var buffer: [256]u8 = undefined;
    var stdout: Io.File.Writer = .initStreaming(.stdout(), io, &buffer);
    stdout.interface.writeAll(options_file.help) catch return 1;
    stdout.interface.flush() catch return 1;
    return 0;
}

/// One line to standard error.
fn say(io: Io, text: []const u8, exit_code: u8) u8 {
    var buffer: [256]u8 = undefined;
    var stderr: Io.File.Writer = .initStreaming(.stderr(), io, &buffer);
    stderr.interface.print("rays: {s}\n", .{text}) catch return 1;
    stderr.interface.flush() catch return 1;
    return exit_code;
}

/// Makes a picture with one variant.
const RunFn = *const fn (
    io: Io,
    setup: *const workload.Setup,
    settings: workload.Settings,
    world: *const World,
    pixels: []f32,
    observer: ?*Observer,
) workload.Times;

const run_fns: [compiled.len]RunFn = fns: {
    var fns: [compiled.len]RunFn = undefined;
    for (&fns, compiled) |*to, variant| {
        to.* = workload.Workload(raylane.trace.kernel.Kernel(variant, false)).run;
    }
    break :fns fns;
};

const Bench = struct {
    gpa: Allocator,
    arena: Allocator,
    io: Io,
    options: *const Options,
    diagnostic: *Diagnostic,
    session: Session,
    /// The scene with a tree of each quality and width that is needed.
    worlds: [quality_count][widths.len]?World = @splat(@splat(null)),
    setup: workload.Setup = undefined,
    pixels: []f32 = &.{},
    processor_buffer: [processors.count_max]u32 = undefined,
    processor_list: []const u32 = &.{},

    /// Whether all variants came to the same results.
    fn run(bench: *Bench) !bool {
        const options = bench.options;
        if (!options.count) bench.processor_list = processors.allowed(&bench.processor_buffer);
        // Threads that build start where the one that starts them may run: anywhere, then.
        if (options.build_thread_count == 1) processors.pin(bench.processor_list, 0);
        try bench.prepare();
        const base = &bench.session.world.?;
        var tree_arena: std.heap.ArenaAllocator = .init(bench.gpa);
        defer tree_arena.deinit();
        const builds = try bench.buildAll(tree_arena.allocator(), base);
        bench.setup = try input.setUp(bench.arena, base, bench.diagnostic);
        if (options.dump) |path| try dump.write(bench.gpa, bench.io, path, base, &bench.setup);

        processors.pin(bench.processor_list, 0);
        const runs = if (options.build_only) &.{} else try bench.runAll();
        if (options.image) |path| try bench.writeImage(path);
        try bench.print(&.{
            .scene = std.fs.path.basename(options.scene),
            .triangles = base.geometry.triangles.len,
            .size = options.size,
            .depth = options.depth,
            .threads = options.thread_count,
            .build_threads = options.build_thread_count,
            .repetitions = options.repetition_count,
            .builds = builds,
            .runs = runs,
        });
        for (runs) |*other| if (!std.mem.eql(u8, runs[0].hash, other.hash)) return false;
        return true;
    }

    /// The world without a tree that counts: each width gets its own below.
    fn prepare(bench: *Bench) !void {
        const options = bench.options;
        const session = &bench.session;
        session.load(options.scene, .{}) catch |err| return bench.named(options.scene, err);
        const scene = &session.scene.?;
        if (options.camera) |path| {
            input.placeCamera(bench.io, scene, path, bench.diagnostic) catch |err|
                return bench.named(path, err);
        }
        for (0..options.subdivide) |_| try input.subdivide(scene);
        try session.pose(.{ .lanes = compiled[options.chosen()[0]].lanes });
        session.view(.{
            .resolution = .{ options.size, options.size },
            .environment = .{ .source = .none },
        }) catch |err|
            return bench.named(options.scene, err);
        session.dropScene();
    }

    /// Puts the file's name before the message.
    fn named(bench: *Bench, path: []const u8, err: anytype) @TypeOf(err) {
        const message = bench.diagnostic.message;
        const text = if (message.length > 0) message.text() else @errorName(err);
        bench.diagnostic.message.set("{s}: {s}", .{ path, text });
        return err;
    }

    /// Builds the trees that the chosen variants need, all of them in turns, over and over.
    fn buildAll(bench: *Bench, arena: Allocator, base: *const World) ![]const report_file.Build {
        const options = bench.options;
        var trees: std.ArrayList(TimedTree) = .empty;
        for (options.chosenQualities()) |quality| for (widths, 0..) |lanes, width_index| {
            const needed = for (options.chosen()) |variant| {
                if (compiled[variant].lanes == lanes) break true;
            } else false;
            if (!needed) continue;
            const world = &bench.worlds[@backingInt(quality)][width_index];
            world.* = base.*;
            try trees.append(bench.arena, .{
                .world = &world.*.?,
                .quality = quality,
                .lanes = lanes,
                .first_tag = firstTag(trees.items.len),
            });
        };
        for (0..options.repetition_count) |repetition| for (trees.items) |*tree| {
            try bench.build(arena, tree, repetition);
        };
        const builds = try bench.arena.alloc(report_file.Build, trees.items.len);
        for (builds, trees.items) |*to, *tree| to.* = bench.reportOfTree(tree);
        return builds;
    }

    /// A tree that is built over and over.
    const TimedTree = struct {
        world: *World,
        quality: raylane.settings.TreeQuality,
        lanes: u8,
        first_tag: u32,
        /// By repetition.
        times_ms: [options_file.repetitions_max]f64 = undefined,
    };

    /// The tree of the last repetition stays.
    fn build(bench: *Bench, arena: Allocator, tree: *TimedTree, repetition: usize) !void {
        const options = bench.options;
        const settings: raylane.prepare.PoseSettings = .{
            .lanes = tree.lanes,
            .pool = &bench.session.pool,
            .tree_quality = tree.quality,
        };
        var own_arena: std.heap.ArenaAllocator = .init(bench.gpa);
        defer own_arena.deinit();
        const last = repetition + 1 == options.repetition_count;
        const used = if (last) arena else own_arena.allocator();
        var marks: Marks = .init(if (options.count) .{ .tags = tree.first_tag } else .clock);
        const start = Io.Clock.awake.now(bench.io);
        marks.to(.build);
        const geometry = &tree.world.geometry;
        tree.world.facts.tree =
            try raylane.prepare.buildTree(bench.gpa, used, geometry, settings);
        marks.to(.other);
        const time_ns = start.untilNow(bench.io, .awake).toNanoseconds();
        tree.times_ms[repetition] = milliseconds(time_ns);
    }

    fn reportOfTree(bench: *Bench, tree: *TimedTree) report_file.Build {
        const options = bench.options;
        const spread: Spread = .of(tree.times_ms[0..options.repetition_count]);
        const facts = &tree.world.facts.tree;
        const triangle_count: f64 = @floatFromInt(tree.world.geometry.triangles.len);
        return .{
            .bvh = tree.quality,
            .lanes = tree.lanes,
            .first_tag = tree.first_tag,
            .time_ms = if (options.count) null else spread,
            .mtriangles_per_s = if (options.count) null else triangle_count / spread.min * 1e-3,
            .bytes_per_triangle = @as(f64, @floatFromInt(facts.bytes)) / triangle_count,
            .sah_cost = facts.sah_cost,
            .nodes = facts.node_count,
            .blocks = switch (tree.world.geometry.tree) {
                inline else => |*wide| wide.packs.len,
            },
        };
    }

    /// What makes a picture.
    const Candidate = struct { variant: usize, quality: raylane.settings.TreeQuality };

    fn worldOf(bench: *const Bench, candidate: Candidate) *const World {
        const index = std.mem.findScalar(u8, &widths, compiled[candidate.variant].lanes).?;
        return &bench.worlds[@backingInt(candidate.quality)][index].?;
    }

    fn candidates(bench: *Bench) ![]const Candidate {
        var all: std.ArrayList(Candidate) = .empty;
        for (bench.options.chosen()) |variant| {
            for (bench.options.chosenQualities()) |quality| {
                try all.append(bench.arena, .{ .variant = variant, .quality = quality });
            }
        }
        return all.items;
    }

    /// Makes the picture once by each candidate to see what comes out, then in turns for the times.
    fn runAll(bench: *Bench) ![]const report_file.Run {
        const options = bench.options;
        const pixel_count = @as(usize, options.size) * options.size;
        bench.pixels = try raylane.huge_pages.alloc(bench.arena, f32, pixel_count);
        const chosen = try bench.candidates();
        const observers = try bench.arena.alloc(Observer, chosen.len);
        for (observers, 0..) |*observer, position| {
            observer.* = .{};
            _ = bench.runOne(chosen[position], position, observer);
        }
        const times = try bench.arena.alloc([]workload.Times, chosen.len);
        for (times) |*of| of.* = try bench.arena.alloc(workload.Times, options.repetition_count);
        for (0..options.repetition_count) |repetition| {
            for (times, 0..) |of, position| {
                of[repetition] = bench.runOne(chosen[position], position, null);
            }
        }
        const runs = try bench.arena.alloc(report_file.Run, chosen.len);
        for (runs, observers, times, 0..) |*result, *observer, of, position| {
            result.* = try bench.reportOf(chosen[position], position, observer, of);
        }
        return runs;
    }

    /// `position` is that among the candidates. With an observer nothing is marked.
    fn runOne(
        bench: *Bench,
        candidate: Candidate,
        position: usize,
        observer: ?*Observer,
    ) workload.Times {
        const options = bench.options;
        const tag = firstTag(position);
        bench.session.pool.thread_count = if (observer == null) options.thread_count else 1;
        const settings: workload.Settings = .{
            .depth_max = options.depth,
            .pool = &bench.session.pool,
            .mode = if (options.count and observer == null) .{ .tags = tag } else .clock,
            .processors = bench.processor_list,
        };
        const world = bench.worldOf(candidate);
        const run_fn = run_fns[candidate.variant];
        return run_fn(bench.io, &bench.setup, settings, world, bench.pixels, observer);
    }

    fn firstTag(position: usize) u32 {
        return @intCast(position * phases.tags_per_run);
    }

    fn reportOf(
        bench: *Bench,
        candidate: Candidate,
        position: usize,
        observer: *Observer,
        times: []const workload.Times,
    ) !report_file.Run {
        const counting = bench.options.count;
        const counts = observer.counts;
        const frame_ms = try bench.arena.alloc(f64, times.len);
        for (frame_ms, times) |*to, time| to.* = milliseconds(time.total_ns);
        const spread: Spread = .of(frame_ms);
        const shadow_count = counts.hits + counts.reflection_hits;
        const ray_count = bench.pixels.len + counts.reflections + shadow_count;
        var result: report_file.Run = .{
            .name = raylane.variant.names[candidate.variant],
            .bvh = candidate.quality,
            .first_tag = firstTag(position),
            .frame_ms = if (counting) null else spread,
            .mrays_per_s = if (counting) null else perMicrosecond(ray_count, spread.min),
            .generation = undefined,
            .primary = undefined,
            .shading = undefined,
            .shadow = undefined,
            .bounce = undefined,
            .bounce_shadow = undefined,
            .bounce_shading = undefined,
            .hits = counts.hits,
            .occluded = counts.occluded,
            .t_sum = counts.t_sum,
            .reflections = counts.reflections,
            .reflection_hits = counts.reflection_hits,
            .reflection_occluded = counts.reflection_occluded,
            .hash = try bench.arena.print("{x:0>16}", .{observer.hash.final()}),
        };
        const phase_ms = try bench.arena.alloc(f64, times.len);
        inline for (phases.frame_phases) |phase| {
            for (phase_ms, times) |*to, *time| to.* = time.by_phase_ns.get(phase) * 1e-6;
            const phase_spread: Spread = .of(phase_ms);
            const rays = report_file.rayCount(phase, bench.pixels.len, &counts);
            @field(result, @tagName(phase)) = .{
                .rays = rays,
                .time_ms = if (counting) null else phase_spread,
                .mrays_per_s = if (counting) null else perMicrosecond(rays, phase_spread.min),
            };
        }
        return result;
    }

    fn writeImage(bench: *Bench, path: []const u8) !void {
        const size = bench.options.size;
        var image: raylane.image.Image = try .init(bench.gpa, size, size);
        defer image.deinit(bench.gpa);
        for (image.pixels, bench.pixels) |*pixel, grey| pixel.* = .{ grey, grey, grey, 1 };
        var temporaries: raylane.output.TemporaryFiles = .{};
        var target: raylane.output.Target = try .openFile(
            bench.io,
            &temporaries,
            path,
            bench.diagnostic,
        );
        defer target.abandon();
        _ = try raylane.output.write(bench.gpa, .{ .image = &image }, .{
            .format = .pfm,
            .pool = &bench.session.pool,
        }, &target, bench.diagnostic);
    }

    fn print(bench: *Bench, report: *const report_file.Report) !void {
        var buffer: [4096]u8 = undefined;
        var stdout: Io.File.Writer = .initStreaming(.stdout(), bench.io, &buffer);
        if (bench.options.json) {
            try report_file.writeJson(&stdout.interface, report);
        } else {
            try report_file.writeTable(&stdout.interface, report);
        }
        try stdout.interface.flush();
    }
};

fn milliseconds(duration_ns: anytype) f64 {
    return @as(f64, @floatFromInt(duration_ns)) * 1e-6;
}

/// Millions a second.
fn perMicrosecond(count: u64, time_ms: f64) f64 {
    return if (time_ms > 0) @as(f64, @floatFromInt(count)) / time_ms * 1e-3 else 0;
}
