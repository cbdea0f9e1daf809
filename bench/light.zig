//! The rays of bounced light: what single rays, packets, streams and beams make of them.
//!
//! In: a scene, a camera. Out: for each set of rays (`light/rays.zig`: by bounce, and the shadow
//! rays of each bounce; those of lights that all share) and each way to trace it
//! (`light/methods.zig`) what a ray costs, or marks for bench/count in its place; what sorting
//! costs. All ways must come to the same hits (exit code 4 if not). bench/light.py makes tables of
//! it.

const std = @import("std");
const builtin = @import("builtin");
const raylane = @import("raylane");
const input = @import("rays/input.zig");
const methods = @import("light/methods.zig");
const phases = @import("rays/phases.zig");
const processors = @import("rays/processors.zig");
const rays = @import("light/rays.zig");
const sort = @import("light/sort.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = raylane.diagnostic.Diagnostic;
const Io = std.Io;
const Setup = @import("rays/workload.zig").Setup;
const Spread = @import("rays/report.zig").Spread;
const World = raylane.world.World;
const ray_file = raylane.trace.ray;
const vec3 = raylane.math.vec3;

/// Widths of trees.
const widths = if (builtin.cpu.arch.isX86()) [_]u8{ 4, 8 } else [_]u8{4};
const method_count = methods.all.len;
/// Bundles that are sorted together, by order.
const windows = [_]struct { rays.Order, usize }{
    .{ .sorted_4096, 16 },
    .{ .sorted_all, std.math.maxInt(u32) },
};

const help =
    \\usage: light SCENE [options]
    \\  --camera FILE  as of bench/rays.zig
    \\  --size N       pixels along each side, a multiple of 48 (default 960)
    \\  --stride N     trace every Nth square of 48x48 pixels along each axis (default 7)
    \\  --depth N      bounces (default 3)
    \\  --reps N       repetitions, of all ways in turns (default 5)
    \\  --json         one JSON object in place of the table
    \\  --count        mark sets for bench/count and do not look at the clock
    \\
;

const Options = struct {
    scene: []const u8 = "",
    camera: ?[]const u8 = null,
    size: u32 = 960,
    stride: u32 = 7,
    depth: u32 = 3,
    repetitions: u32 = 5,
    json: bool = false,
    count: bool = false,
};

/// What a way to trace a set cost; `tag` is the counter's.
const CostReport = struct { method: []const u8, tag: u32, ns_per_ray: ?Spread };

const SetReport = struct {
    name: []const u8,
    depth: u32,
    order: rays.Order,
    rays: u64,
    hits: u64,
    hash: []const u8,
    costs: []const CostReport,
};

/// What sorting all incoherent sets cost.
const SortReport = struct { order: rays.Order, rays: u64, tag: u32, ns_per_ray: ?Spread };

const Report = struct {
    scene: []const u8,
    triangles: usize,
    size: u32,
    stride: u32,
    repetitions: u32,
    architecture: []const u8 = @tagName(builtin.cpu.arch),
    sets: []const SetReport,
    sorts: []const SortReport,
};

pub fn main(init: std.process.Init) u8 {
    _ = raylane.simd.setFlushToZero();
    const arena = init.arena.allocator();
    const arguments = init.minimal.args.toSlice(arena) catch return 1;
    const options = parse(arguments[@min(1, arguments.len)..]) orelse {
        std.debug.print("{s}", .{help});
        const is_asked = arguments.len == 2 and std.mem.eql(u8, arguments[1], "--help");
        return if (is_asked) 0 else 2;
    };
    var diagnostic: Diagnostic = .{};
    var bench: Bench = .{
        .gpa = init.gpa,
        .arena = arena,
        .io = init.io,
        .options = &options,
        .diagnostic = &diagnostic,
        .session = .init(init.gpa, init.io, 1, &diagnostic),
    };
    defer bench.session.deinit();
    const report = bench.run() catch |err| {
        const text = diagnostic.message.text();
        std.debug.print("light: {s}\n", .{if (text.len > 0) text else @errorName(err)});
        return 1;
    };
    print(init.io, &options, &report) catch return 1;
    if (bench.agreed) return 0;
    std.debug.print("light: the hits differ\n", .{});
    return 4;
}

const Flag = enum {
    @"--camera",
    @"--size",
    @"--stride",
    @"--depth",
    @"--reps",
    @"--json",
    @"--count",
};

fn parse(arguments: []const [:0]const u8) ?Options {
    var options: Options = .{};
    var index: usize = 0;
    while (index < arguments.len) : (index += 1) {
        const argument = arguments[index];
        const flag = std.meta.stringToEnum(Flag, argument) orelse {
            if (options.scene.len > 0 or argument.len == 0 or argument[0] == '-') return null;
            options.scene = argument;
            continue;
        };
        switch (flag) {
            .@"--json" => options.json = true,
            .@"--count" => options.count = true,
            else => {
                index += 1;
                if (index == arguments.len) return null;
                if (flag == .@"--camera") {
                    options.camera = arguments[index];
                    continue;
                }
                const number = std.fmt.parseInt(u32, arguments[index], 10) catch return null;
                switch (flag) {
                    .@"--size" => options.size = number,
                    .@"--stride" => options.stride = number,
                    .@"--depth" => options.depth = number,
                    else => options.repetitions = number,
                }
            },
        }
    }
    if (options.count) options.repetitions = 1;
    const size_fits = options.size > 0 and options.size <= 16384 and
        options.size % rays.block_side == 0;
    const others_fit = options.stride > 0 and options.depth <= 16 and options.repetitions > 0;
    return if (options.scene.len > 0 and size_fits and others_fit) options else null;
}

const Bench = struct {
    gpa: Allocator,
    arena: Allocator,
    io: Io,
    options: *const Options,
    diagnostic: *Diagnostic,
    session: raylane.session.Session,
    /// By width of tree.
    worlds: [widths.len]World = undefined,
    agreed: bool = true,

    fn run(bench: *Bench) !Report {
        const options = bench.options;
        var processor_buffer: [processors.count_max]u32 = undefined;
        if (!options.count) processors.pin(processors.allowed(&processor_buffer), 0);
        try bench.prepare();
        const setup = try input.setUp(bench.arena, &bench.worlds[0], bench.diagnostic);
        var sets: std.ArrayList(rays.Set) = .empty;
        try sets.appendSlice(bench.arena, try rays.record(bench.arena, &setup, .{
            .stride = options.stride,
            .depth_max = options.depth,
            .diagonal = input.diagonal(&bench.worlds[0]),
        }, &bench.worlds[0], closestHit));
        var sorts: [windows.len]SortReport = undefined;
        const recorded_count = sets.items.len;
        for (&sorts, windows, 0..) |*report, window, number| {
            report.* = try bench.sortAll(&sets, recorded_count, number, window);
        }
        return .{
            .scene = std.fs.path.basename(options.scene),
            .triangles = bench.worlds[0].geometry.triangles.len,
            .size = options.size,
            .stride = options.stride,
            .repetitions = options.repetitions,
            .sets = try bench.measure(sets.items),
            .sorts = try bench.arena.dupe(SortReport, &sorts),
        };
    }

    /// The scene with a tree of each width.
    fn prepare(bench: *Bench) !void {
        const options = bench.options;
        const session = &bench.session;
        try session.load(options.scene, .{});
        if (options.camera) |path|
            try input.placeCamera(bench.io, &session.scene.?, path, bench.diagnostic);
        try session.pose(.{ .lanes = widths[0] });
        try session.view(.{
            .resolution = .{ options.size, options.size },
            .environment = .{ .source = .none },
        });
        session.dropScene();
        for (&bench.worlds, widths) |*world, lanes| {
            world.* = session.world.?;
            if (lanes == widths[0]) continue;
            const pose: raylane.prepare.PoseSettings = .{ .lanes = lanes, .pool = &session.pool };
            world.facts.tree =
                try raylane.prepare.buildTree(bench.gpa, bench.arena, &world.geometry, pose);
        }
    }

    /// Sorts the sets of rays that have nothing in common and appends what comes of it.
    fn sortAll(
        bench: *Bench,
        sets: *std.ArrayList(rays.Set),
        recorded_count: usize,
        number: usize,
        window: struct { rays.Order, usize },
    ) !SortReport {
        const tag: u32 = @intCast(1 + number);
        var report: SortReport = .{ .order = window[0], .rays = 0, .tag = tag, .ns_per_ray = null };
        var time_ns: u64 = 0;
        for (0..recorded_count) |index| {
            var set = sets.items[index];
            if (set.common != .nothing) continue;
            const start_ns = methods.processorTime();
            if (bench.options.count) phases.mark(tag);
            set.bundles = try sort.sorted(bench.arena, set.bundles, window[1]);
            if (bench.options.count) phases.mark(0);
            time_ns += methods.processorTime() - start_ns;
            set.order = window[0];
            report.rays += set.rayCount();
            try sets.append(bench.arena, set);
        }
        if (bench.options.count) return report;
        var samples = [_]f64{float(time_ns) / float(report.rays)};
        report.ns_per_ray = .of(&samples);
        return report;
    }

    /// Traces every set by every method that can, in turns.
    fn measure(bench: *Bench, sets: []const rays.Set) ![]const SetReport {
        const reports = try bench.arena.alloc(SetReport, sets.len);
        for (reports, sets, 0..) |*report, *set, number| {
            var samples: [method_count][]f64 = undefined;
            var costs: [method_count]?methods.Cost = @splat(null);
            for (&samples) |*of| of.* = try bench.arena.alloc(f64, bench.options.repetitions);
            for (0..bench.options.repetitions) |repetition| {
                for (&costs, samples, 0..) |*cost, of, index| {
                    if (methods.all[index].way == .beam and set.common == .nothing) continue;
                    const mode: phases.Mode =
                        if (bench.options.count) .{ .tags = tagOf(number, index) } else .clock;
                    const world = &bench.worlds[widthIndex(index)];
                    cost.* = methods.run_fns[index](world, set, mode);
                    of[repetition] = float(cost.*.?.time_ns);
                }
            }
            report.* = try bench.reportOf(set, number, &costs, &samples);
        }
        return reports;
    }

    fn reportOf(
        bench: *Bench,
        set: *const rays.Set,
        number: usize,
        costs: *const [method_count]?methods.Cost,
        samples: *const [method_count][]f64,
    ) !SetReport {
        const first = costs[0].?;
        const count = set.rayCount();
        var list: std.ArrayList(CostReport) = .empty;
        inline for (methods.all, 0..) |method, index| if (costs[index]) |cost| {
            bench.agreed = bench.agreed and cost.hash == first.hash and cost.hits == first.hits;
            for (samples[index]) |*sample| sample.* /= @max(1, float(count));
            try list.append(bench.arena, .{
                .method = comptime method.name(),
                .tag = tagOf(number, index),
                .ns_per_ray = if (bench.options.count) null else .of(samples[index]),
            });
        };
        return .{
            .name = set.name,
            .depth = set.depth,
            .order = set.order,
            .rays = count,
            .hits = first.hits,
            .hash = try bench.arena.print("{x:0>16}", .{first.hash}),
            .costs = list.items,
        };
    }
};

/// Of a set by a method; sorting has the first ones.
fn tagOf(set: usize, method: usize) u32 {
    return @intCast(1 + windows.len + set * method_count + method);
}

fn widthIndex(method: usize) usize {
    return std.mem.findScalar(u8, &widths, methods.all[method].variant.lanes).?;
}

const RecordingKernel = raylane.trace.kernel.Kernel(.{
    .backend = .vector,
    .traversal = .single,
    .lanes = widths[0],
}, false);

fn closestHit(world: *const World, course: *const rays.Course) ?rays.Hit {
    const Single = ray_file.Single;
    var tests: raylane.statistics.TestCounts = .{};
    const line: ray_file.Line(Single) = .init(.splat(course.origin), .splat(course.direction));
    var ray: ray_file.Ray(Single) =
        .endless(line, .splat(ray_file.no_primitive), .splat(true));
    const geometry = &world.geometry;
    if (!raylane.trace.single.trace(RecordingKernel, .closest_hit, geometry, &ray, &tests))
        return null;
    return .{ .primitive = @intCast(ray.closest.primitive.lane(0)), .t = ray.closest.t.lane(0) };
}

fn float(count: u64) f64 {
    return @floatFromInt(count);
}

fn print(io: Io, options: *const Options, report: *const Report) !void {
    var buffer: [4096]u8 = undefined;
    var stdout: Io.File.Writer = .initStreaming(.stdout(), io, &buffer);
    const writer = &stdout.interface;
    if (options.json) {
        try writer.print("{f}\n", .{std.json.fmt(report, .{ .whitespace = .indent_1 })});
        return writer.flush();
    }
    try writer.print("{s}: {d} triangles, {d}x{d} pixels\n", .{
        report.scene, report.triangles, report.size, report.size,
    });
    for (report.sets) |*set| {
        try writer.print("\n{s} {d}, {t}: {d} rays, {d} hits, hash {s}\n", .{
            set.name, set.depth, set.order, set.rays, set.hits, set.hash,
        });
        for (set.costs) |*cost| if (cost.ns_per_ray) |spread| {
            try writer.print("  {s:<22}{d:>10.1} ns{d:>10.2} Mrays/s\n", .{
                cost.method, spread.min, 1e3 / spread.min,
            });
        };
    }
    for (report.sorts) |*sorting| if (sorting.ns_per_ray) |spread| {
        try writer.print("\n{t}: {d:.1} ns a ray\n", .{ sorting.order, spread.min });
    };
    try writer.flush();
}
