//! The benchmark of the variants: the measurements of the thesis, made anew on this machine.
//!
//! In: scenes, settings, variants. Out: `Results`, from which `writeTables` and `writeJson` make
//! what people and programs read. Like `main` it leads scenes through the stages, and like `main`
//! alone it may know all of them; it prints nothing. A source of energy is looked for first and the
//! machine measured at rest; then come the scenes, each with its share of the time; then the last
//! scene again by one thread, two, and so on.

const std = @import("std");
const energy = @import("energy.zig");
const Alarm = @import("bench/alarm.zig").Alarm;
const bounces = @import("bench/bounces.zig");
const choices = @import("settings.zig");
const machine = @import("bench/machine.zig");
const results_file = @import("bench/results.zig");
const rounds_file = @import("bench/rounds.zig");
const stages_file = @import("bench/stages.zig");
const statistics = @import("bench/statistics.zig");
const tables = @import("bench/tables.zig");
const variant_file = @import("variant.zig");
const Diagnostic = @import("diagnostic.zig").Diagnostic;
const Display = @import("display.zig").Display;
const Identity = @import("identity.zig").Identity;
const Progress = @import("progress.zig").Progress;
const printable = @import("diagnostic.zig").printable;
const Allocator = std.mem.Allocator;
const Io = std.Io;
const Meter = energy.Meter;
const Rounds = rounds_file.Rounds(Stages);
const Stages = stages_file.Stages;
const assert = std.debug.assert;

pub const Results = results_file.Results;
pub const writeTables = tables.write;

/// The scenes without an argument, in the place of the thesis's four.
pub const default_scenes: []const []const u8 = &.{
    "builtin:cornell", "builtin:atrium", "builtin:nave", "builtin:handles",
};
/// What ratios are of, where it is measured.
pub const reference_name = "scalar-single-4";

/// What to measure.
pub const Settings = struct {
    version: []const u8,
    /// At least one.
    scenes: []const []const u8,
    allow_outside: bool = false,
    /// See `settings.Load`.
    output: ?Identity = null,
    width: u32,
    height: u32,
    thread_count: usize,
    sample_count: u32,
    depth: u32,
    tree_quality: choices.TreeQuality,
    /// Null: the thesis's, Whitted's. Else what each bounce costs is measured as well, and scenes
    /// have all their light.
    integrator: ?choices.Integrator = null,
    /// By variant of `variant.compiled`: whether it is measured. At least one is.
    wanted: [variant_file.compiled.len]bool,
    /// Null: until intervals are narrow.
    round_count: ?usize,
    time_s: u32,
    /// Null: energy is not measured.
    energy: ?energy.Wanted,
};

/// `ImagesDiffer`: a variant renders another image than the others. `TimeOver`: there is nothing to
/// show for the time.
pub const Error = Stages.Error || error{ ImagesDiffer, TimeOver };

/// Share of the time that the numbers of threads get, where there is more than one.
const scaling_share = 0.15;
/// Share of a scene's time that its bounces get, where they are measured.
const bounces_share = 0.4;
/// Share of the time to look at the machine at rest, and the most of it.
const idle_share = 1.0 / 48.0;
const idle_s_max = 10.0;

/// One run of the benchmark.
pub const Bench = struct {
    /// Everything that is found lives in it.
    arena: Allocator,
    gpa: Allocator,
    io: Io,
    settings: *const Settings,
    diagnostic: *Diagnostic,
    /// Told of the scenes; null: nobody is.
    display: ?*Display = null,
    /// What is being measured: for the message of an error.
    scene: []const u8 = "",
    /// The reference first, then as a reader would sort them.
    order: []const usize = &.{},
    meter: ?*Meter = null,
    idle_w: f64 = 0,

    /// Measures everything. On an error the diagnostic says what is wrong with `scene`.
    pub fn run(bench: *Bench) Error!Results {
        const settings = bench.settings;
        assert(settings.scenes.len >= 1);
        const start = Io.Clock.awake.now(bench.io);
        const start_ns: u64 = @intCast(start.nanoseconds);
        const deadline_ns = start_ns + @as(u64, settings.time_s) * std.time.ns_per_s;
        bench.order = try bench.orderOf();
        bench.scene = settings.scenes[0];
        var results: Results = .{
            .version = settings.version,
            .started_unix_s = Io.Clock.real.now(bench.io).toSeconds(),
            .machine = try machine.describe(bench.arena, bench.io),
            .build = machine.build,
            .settings = .{
                .width = settings.width,
                .height = settings.height,
                .samples = settings.sample_count,
                .depth = settings.depth,
                .integrator = @tagName(settings.integrator orelse .whitted),
                .threads = settings.thread_count,
                .bvh = @tagName(settings.tree_quality),
                .time_limit_s = settings.time_s,
                .rounds = settings.round_count,
                .precision = rounds_file.precision,
            },
            .reference = variant_file.names[bench.order[0]],
            .energy = .{ .reason = "not asked for" },
        };
        var source: energy.Source = undefined;
        var meter: Meter = undefined;
        if (settings.energy) |wanted| {
            try bench.findEnergy(wanted, &source, &meter, &results.energy);
        }
        errdefer if (bench.meter) |running| running.stop();
        try bench.measureScenes(deadline_ns, &results);
        if (bench.meter) |running| try bench.endEnergy(running, &results.energy);
        results.duration_s = seconds(start.untilNow(bench.io, .awake));
        return results;
    }

    /// The variants to measure: by lanes, backend, traversal, but the reference first.
    fn orderOf(bench: *Bench) error{OutOfMemory}![]const usize {
        var order: std.ArrayList(usize) = .empty;
        for (bench.settings.wanted, 0..) |is_wanted, index| {
            if (is_wanted) try order.append(bench.arena, index);
        }
        assert(order.items.len >= 1);
        std.mem.sort(usize, order.items, {}, comesBefore);
        return order.items;
    }

    fn comesBefore(_: void, a: usize, b: usize) bool {
        return rank(a) < rank(b);
    }

    fn rank(index: usize) usize {
        if (std.mem.eql(u8, variant_file.names[index], reference_name)) return 0;
        const variant = variant_file.compiled[index];
        const kind = @as(usize, @backingInt(variant.backend)) * 8 + @backingInt(variant.traversal);
        return 1 + @as(usize, variant.lanes) * 64 + kind;
    }

    /// Finds a source, starts the meter and looks at the machine at rest. Not inlined: what it
    /// needs of the stack is not to be there while scenes are measured.
    noinline fn findEnergy(
        bench: *Bench,
        wanted: energy.Wanted,
        source: *energy.Source,
        meter: *Meter,
        about: *results_file.Energy,
    ) error{OutOfMemory}!void {
        var reason: Diagnostic = .{};
        source.* = energy.find(bench.arena, bench.gpa, bench.io, wanted, &reason) catch |err|
            switch (err) {
                error.OutOfMemory => return error.OutOfMemory,
                error.NotMeasurable => {
                    const text = reason.message.text();
                    about.reason = try bench.arena.print("{f}", .{printable(text)});
                    return;
                },
            };
        const rails = try bench.arena.alloc([]const u8, source.rails.len);
        for (rails, source.rails) |*name, *rail| {
            name.* = try bench.arena.print("{f}", .{printable(rail.name)});
        }
        about.* = .{
            .source = source.name,
            .scope = source.scope,
            .rails = rails,
            .period_ms = source.period_ms,
            .window_ms = source.window_ms,
        };
        meter.* = .init(bench.gpa, bench.io, source);
        meter.start();
        bench.meter = meter;
        const time_s: f64 = @floatFromInt(bench.settings.time_s);
        const from = meter.mark();
        const idle_ms: i64 = @trunc(1e3 * @min(idle_s_max, time_s * idle_share));
        bench.io.sleep(.fromMilliseconds(idle_ms), .awake) catch {};
        const idle = meter.between(from, meter.mark()) orelse return;
        bench.idle_w = idle.energy_j / idle.duration_s;
        about.idle_w = bench.idle_w;
        about.idle_s = idle.duration_s;
    }

    fn endEnergy(
        bench: *Bench,
        meter: *Meter,
        about: *results_file.Energy,
    ) error{OutOfMemory}!void {
        meter.stop();
        bench.meter = null;
        about.readings = meter.cost.reading_count;
        about.reading_s = @as(f64, @floatFromInt(meter.cost.reading_ns)) * 1e-9;
        about.processor_s = @as(f64, @floatFromInt(meter.cost.processor_ns)) * 1e-9;
        if (!meter.isLost()) return;
        const text = meter.diagnostic.message.text();
        about.reason = try bench.arena.print("{f}, half way", .{printable(text)});
    }

    /// Each scene gets an equal part of the time that is left; the numbers of threads theirs.
    fn measureScenes(bench: *Bench, deadline_ns: u64, results: *Results) Error!void {
        const names = bench.settings.scenes;
        const share: f64 = if (bench.settings.thread_count > 1) scaling_share else 0;
        const time_s: f64 = @floatFromInt(bench.settings.time_s);
        const scaling_ns: u64 = @trunc(share * time_s * 1e9);
        const scenes = try bench.arena.alloc(results_file.Scene, names.len);
        var measured_count: usize = 0;
        for (names, 0..) |name, index| {
            bench.scene = name;
            const now_ns: u64 = @intCast(Io.Clock.awake.now(bench.io).nanoseconds);
            const left_ns = deadline_ns -| scaling_ns -| now_ns;
            const is_last = index + 1 == names.len;
            const scene_deadline_ns = now_ns + left_ns / (names.len - index);
            scenes[measured_count] = try bench.measureScene(
                name,
                scene_deadline_ns,
                deadline_ns,
                if (is_last) results else null,
            ) orelse {
                bench.diagnostic.warn("no time was left for {f}", .{printable(name)});
                continue;
            };
            measured_count += 1;
        }
        results.scenes = scenes[0..measured_count];
        if (measured_count > 0) return;
        bench.scene = names[0];
        return bench.diagnostic.fail(
            error.TimeOver,
            "{d} s are not enough for one round of {d} variants: a longer --time-limit, " ++
                "a smaller -r or fewer --variants may do",
            .{ bench.settings.time_s, bench.order.len },
        );
    }

    /// Measures one scene until `deadline_ns`, for what has to be there until `end_ns`; in the last
    /// one the numbers of threads as well, which `scaled` gets. Null: there is no time for a round.
    fn measureScene(
        bench: *Bench,
        name: []const u8,
        deadline_ns: u64,
        end_ns: u64,
        scaled: ?*Results,
    ) Error!?results_file.Scene {
        const settings = bench.settings;
        const title = try bench.arena.print("{f}", .{printable(name)});
        const progress = bench.beginScene(name, deadline_ns);
        errdefer if (bench.display) |display| display.endFile(progress, .failed);
        var stages: Stages = .init(
            bench.gpa,
            bench.io,
            bench.stagesOf(name),
            settings.thread_count,
            bench.diagnostic,
            bench.meter,
            progress,
        );
        defer stages.deinit();
        var alarm: Alarm = .{ .io = bench.io, .session = &stages.session, .end_ns = end_ns };
        alarm.start();
        defer alarm.stop();
        var rounds = try Rounds.measure(bench.arena, &stages, .{
            .variants = bench.order,
            .thread_count = settings.thread_count,
            .round_count = settings.round_count,
            .deadline_ns = if (settings.integrator == null)
                deadline_ns
            else
                deadline_ns -| bounceTime(stages.now(), deadline_ns),
            .end_ns = end_ns,
            .idle_w = bench.idle_w,
        }, bench.diagnostic);
        if (rounds.round_count == 0) {
            if (bench.display) |display| display.endFile(progress, .failed);
            return null;
        }
        const variants = try rounds.variants();
        const by_bounce = try bench.bouncesOf(&stages, variants, deadline_ns, end_ns);
        if (scaled) |results| if (settings.thread_count > 1) {
            results.scaling = try bench.scale(&rounds, title, variants, end_ns);
        };
        if (bench.display) |display| display.endFile(progress, .done);
        return .{
            .scene = title,
            .triangles = stages.session.facts.triangle_count,
            .image_hash = try bench.arena.print("{x:0>16}", .{rounds.hash.?}),
            .rays = rounds.rays,
            .rounds = rounds.round_count,
            .ended_by = rounds.end,
            .variants = variants,
            .bounces = by_bounce,
        };
    }

    fn beginScene(bench: *const Bench, name: []const u8, deadline_ns: u64) ?*Progress {
        const display = bench.display orelse return null;
        const names = bench.settings.scenes;
        const index = for (names, 1..) |*other, number| {
            if (other.ptr == name.ptr) break number;
        } else unreachable; // It is one of them.
        const progress = display.beginFile(.{ .index = index, .count = names.len, .name = name });
        const now_ns: u64 = @intCast(Io.Clock.awake.now(bench.io).nanoseconds);
        Progress.begin(progress, .{
            .stage = .measuring,
            .budget_ns = @max(1, deadline_ns -| now_ns),
        });
        return progress;
    }

    /// What a scene is rendered with. The thesis's light is that of lamps alone.
    fn stagesOf(bench: *const Bench, name: []const u8) stages_file.Settings {
        const settings = bench.settings;
        var view: choices.View = .{
            .resolution = .{ settings.width, settings.height },
            .display_referred = false,
        };
        if (settings.integrator == null) {
            view.environment = .{ .source = .none };
            view.emitters = false;
        }
        return .{
            .scene = name,
            .load = .{ .allow_outside = settings.allow_outside, .output = settings.output },
            .tree_quality = settings.tree_quality,
            .view = view,
            .integrator = settings.integrator orelse .whitted,
            .sample_count = settings.sample_count,
            .depth = settings.depth,
        };
    }

    /// Measures each bounce, where an integrator was asked for.
    fn bouncesOf(
        bench: *Bench,
        stages: *Stages,
        variants: []const results_file.Variant,
        deadline_ns: u64,
        end_ns: u64,
    ) Error![]const results_file.Bounce {
        const settings = bench.settings;
        if (settings.integrator == null) return &.{};
        var frame_ms: f64 = 0;
        for (variants) |*variant| for (variant.trace_ms) |time_ms| {
            frame_ms = @max(frame_ms, time_ms);
        };
        return bounces.measure(bench.arena, stages, .{
            .variants = bench.order,
            .thread_count = settings.thread_count,
            .depth_max = settings.depth,
            .round_count = settings.round_count,
            .deadline_ns = deadline_ns,
            .end_ns = end_ns,
            .frame_ns = @trunc(frame_ms * 1e6),
            .idle_w = bench.idle_w,
        }, bench.diagnostic);
    }

    /// The reference and the quickest variant by more and more threads.
    fn scale(
        bench: *Bench,
        rounds: *Rounds,
        title: []const u8,
        variants: []const results_file.Variant,
        deadline_ns: u64,
    ) Error![]const results_file.Scaling {
        var quickest: usize = 0;
        for (variants, 0..) |*variant, index| {
            const time_ms = statistics.estimate(variant.trace_ms).mean;
            if (time_ms < statistics.estimate(variants[quickest].trace_ms).mean) quickest = index;
        }
        const both = [_]usize{ bench.order[0], bench.order[quickest] };
        const chosen: []const usize = if (quickest == 0) both[0..1] else &both;
        var count_buffer: [thread_counts_max]usize = undefined;
        const counts = threadCounts(bench.settings.thread_count, &count_buffer);
        const lists = try bench.arena.alloc(std.ArrayList(f64), chosen.len * counts.len);
        @memset(lists, .empty);
        try rounds.scale(chosen, counts, deadline_ns, lists);
        if (lists[0].items.len == 0) return &.{};
        const scaling = try bench.arena.alloc(results_file.Scaling, lists.len);
        for (scaling, lists, 0..) |*to, list, index| to.* = .{
            .scene = title,
            .variant = variant_file.names[chosen[index / counts.len]],
            .threads = counts[index % counts.len],
            .trace_ms = list.items,
        };
        return scaling;
    }
};

/// Of a scene's time.
fn bounceTime(now_ns: u64, deadline_ns: u64) u64 {
    return @trunc(bounces_share * @as(f64, @floatFromInt(deadline_ns -| now_ns)));
}

fn seconds(duration: Io.Duration) f64 {
    return @as(f64, @floatFromInt(duration.toNanoseconds())) * 1e-9;
}

const thread_counts_max = 32;

/// Numbers of threads to measure: each up to 8, then about four for every doubling, and the last.
fn threadCounts(thread_count: usize, buffer: *[thread_counts_max]usize) []const usize {
    var length: usize = 0;
    var count: usize = 1;
    while (count < thread_count) : (count += @max(1, std.math.floorPowerOfTwo(usize, count) / 4)) {
        buffer[length] = count;
        length += 1;
    }
    buffer[length] = thread_count;
    return buffer[0 .. length + 1];
}

/// Writes the results as one JSON object.
pub fn writeJson(results: *const Results, writer: *Io.Writer) Io.Writer.Error!void {
    try std.json.Stringify.value(results.*, .{ .whitespace = .indent_1 }, writer);
    try writer.writeByte('\n');
}

test {
    _ = @import("bench/alarm.zig");
    _ = bounces;
    _ = machine;
    _ = rounds_file;
    _ = stages_file;
    _ = statistics;
    _ = tables;
}

const testing = std.testing;

fn settingsForTest(scenes: []const []const u8) Settings {
    return .{
        .version = "0",
        .scenes = scenes,
        .width = 8,
        .height = 8,
        .thread_count = 2,
        .sample_count = 1,
        .depth = 3,
        .tree_quality = .default,
        .wanted = @splat(true),
        .round_count = 2,
        .time_s = 600,
        .energy = .{ .command = "echo 4 W" },
    };
}

test "numbers of threads" {
    var buffer: [thread_counts_max]usize = undefined;
    try testing.expectEqualSlices(usize, &.{1}, threadCounts(1, &buffer));
    try testing.expectEqualSlices(usize, &.{ 1, 2 }, threadCounts(2, &buffer));
    const expected = [_]usize{ 1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 18 };
    try testing.expectEqualSlices(usize, &expected, threadCounts(18, &buffer));
    try testing.expect(threadCounts(256, &buffer).len <= buffer.len);
}

test "the built-in scene by all variants, with energy of a constant load" {
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    var diagnostic: Diagnostic = .{};
    var settings = settingsForTest(&.{"builtin:cornell"});
    // Sensors of power need a second each: one variant will do.
    settings.wanted = @splat(false);
    settings.wanted[0] = true;
    var bench: Bench = .{
        .arena = arena.allocator(),
        .gpa = testing.allocator,
        .io = testing.io,
        .settings = &settings,
        .diagnostic = &diagnostic,
    };
    const results = try bench.run();
    const joules = results.scenes[0].variants[0].energy.?;
    try testing.expectEqual(2, joules.trace_j.len);
    try testing.expectApproxEqRel(4, results.energy.idle_w.?, 0.01);
    for (joules.trace_gross_j, joules.trace_s) |energy_j, duration_s| {
        try testing.expectApproxEqRel(4 * duration_s, energy_j, 0.01);
    }
    try testing.expectEqual(null, results.energy.reason);
    try testing.expect(results.energy.readings > 4);

    var json: Io.Writer.Allocating = .init(testing.allocator);
    defer json.deinit();
    try writeJson(&results, &json.writer);
    const parsed = try std.json.parseFromSlice(Results, testing.allocator, json.written(), .{});
    defer parsed.deinit();
    try testing.expectEqualStrings("builtin:cornell", parsed.value.scenes[0].scene);
    try testing.expectEqual(2, parsed.value.scaling.len);
}

test "a scene that is not there is named, and the meter ends" {
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    var diagnostic: Diagnostic = .{};
    const settings = settingsForTest(&.{"builtin:absent"});
    var bench: Bench = .{
        .arena = arena.allocator(),
        .gpa = testing.allocator,
        .io = testing.io,
        .settings = &settings,
        .diagnostic = &diagnostic,
    };
    try testing.expectError(error.InvalidInput, bench.run());
    try testing.expectEqualStrings("builtin:absent", bench.scene);
}
