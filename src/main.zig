//! The program: the command line, the four stages in order, the report.
//!
//! In: arguments. Out: an image, a report, and an exit code that says how it went. Whatever a stage
//! has to say reaches the user here, in one line; nothing else prints or exits.

const std = @import("std");
const raylane = @import("raylane");
const signals = @import("signals.zig");
const Allocator = std.mem.Allocator;
const Io = std.Io;
const Account = raylane.memory_account.Account;
const assert = std.debug.assert;
const Diagnostic = raylane.diagnostic.Diagnostic;
const Film = raylane.film.Film;
const Image = raylane.image.Image;
const Options = raylane.options.Options;
const Report = raylane.report.Report;
const Target = raylane.output.Target;
const World = raylane.world.World;
const printable = raylane.diagnostic.printable;

comptime {
    // What the options promise the stages keep.
    assert(raylane.options.depth_max <= raylane.trace.depth_limit);
    assert(raylane.options.thread_count_max <= raylane.parallel.thread_count_max);
}

const ExitCode = enum(u8) {
    ok = 0,
    /// Files or memory.
    failed = 1,
    usage = 2,
    /// The scene is invalid or asks for what is not supported.
    invalid = 3,
    /// Images that must be the same are not.
    differ = 4,
};

pub fn main(init: std.process.Init) u8 {
    holdStandardFiles();
    signals.catchAll();
    _ = raylane.simd.setFlushToZero();
    return @backingInt(run(init));
}

fn run(init: std.process.Init) ExitCode {
    const io = init.io;
    var diagnostic: Diagnostic = .{};
    const arguments = init.minimal.args.toSlice(init.arena.allocator()) catch
        return outOfMemory(io);
    const own_arguments = arguments[@min(1, arguments.len)..];
    const names = raylane.variant.names;
    const command = raylane.options.parse(own_arguments, names, &diagnostic) catch {
        say(io, "raylane: {s}\n", .{diagnostic.message.text()});
        return .usage;
    };
    switch (command) {
        .help => return print(io, raylane.options.help),
        .bench_help => return print(io, raylane.options.bench_help),
        .version => return print(io, "raylane " ++ raylane.options.version ++ "\n"),
        .licenses => return print(io, raylane.licenses),
        .list_variants => return print(io, comptime list: {
            var list: []const u8 = "";
            for (names) |name| list = list ++ name ++ "\n";
            break :list list;
        }),
        .render => |*options| {
            var account: Account = .init(init.gpa, options.memory_max);
            return renderAndReport(&account, io, options, &diagnostic);
        },
        .bench => |*options| return bench(init, options, &diagnostic),
    }
}

comptime {
    // What the options accept is what the reader of scenes expects.
    assert(raylane.options.tessellation_min == raylane.parse.tessellation_min);
    assert(raylane.options.tessellation_max == raylane.parse.tessellation_max);
    assert(raylane.options.tessellation_default == raylane.parse.tessellation_default);
}

/// Measures all variants on some scenes, then prints the tables, or why there are none.
fn bench(
    init: std.process.Init,
    options: *const raylane.options.Bench,
    diagnostic: *Diagnostic,
) ExitCode {
    const io = init.io;
    var settings = benchSettings(options);
    if (std.mem.findScalar(bool, &settings.wanted, true) == null) {
        say(io, "raylane: no variant's name contains {f}; --list-variants names them\n", .{
            raylane.diagnostic.quote(options.variants.?),
        });
        return .usage;
    }
    if (!raylane.variant.are_all and !options.quiet) say(
        io,
        "raylane: this program holds {d} of the variants; zig build -Dvariants=all builds all\n",
        .{raylane.variant.names.len},
    );
    // Before the work, so that a place that cannot be written is an error in the first second.
    var target = openJson(io, options.json, diagnostic) catch {
        const text = diagnostic.message.text();
        say(io, "raylane: {f}: {s}\n", .{ printable(options.json.?), text });
        return .failed;
    };
    defer target.abandon();
    settings.output = target.replaces;
    var run_of: raylane.bench.Bench = .{
        .arena = init.arena.allocator(),
        .gpa = init.gpa,
        .io = io,
        .settings = &settings,
        .diagnostic = diagnostic,
        .progress = if (options.quiet)
            .none
        else
            std.Progress.start(io, .{ .root_name = "raylane bench" }),
    };
    const outcome = run_of.run();
    run_of.progress.end();
    if (!options.quiet) for (diagnostic.warnings[0..diagnostic.warning_count]) |*warning| {
        say(io, "raylane: warning: {s}\n", .{warning.text()});
    };
    const results = outcome catch |err| {
        const text = if (err == error.OutOfMemory) "out of memory" else diagnostic.message.text();
        say(io, "raylane: {f}: {s}\n", .{ printable(placeOf(diagnostic, run_of.scene)), text });
        return switch (err) {
            error.OutOfMemory, error.InputOutput => .failed,
            error.CameraUnknown => .usage,
            error.InvalidInput, error.SceneTooLarge => .invalid,
            error.ImagesDiffer => .differ,
            error.Canceled => unreachable, // Nobody does.
        };
    };
    return printBench(init.gpa, io, options, &results, &target, diagnostic);
}

fn benchSettings(options: *const raylane.options.Bench) raylane.bench.Settings {
    var settings: raylane.bench.Settings = .{
        .version = raylane.options.version,
        .scenes = options.scenes[0..options.scene_count],
        .allow_outside = options.allow_outside,
        .width = options.resolution[0],
        .height = options.resolution[1],
        .thread_count = options.thread_count orelse processorCount(),
        .sample_count = options.sample_count,
        .depth = options.depth,
        .tree_quality = treeQuality(options.bvh),
        .wanted = undefined,
        .round_count = if (options.round_count) |count| count else null,
        .time_s = options.time_s,
        .energy = if (options.energy) .{
            .root = options.energy_root,
            .command = options.energy_command,
        } else null,
    };
    if (options.scene_count == 0) settings.scenes = raylane.bench.default_scenes;
    for (&settings.wanted, raylane.variant.names) |*is_wanted, name| {
        is_wanted.* = options.wants(name);
    }
    return settings;
}

/// Prints the tables, and writes the file of `--json`; on standard output that is in their place.
fn printBench(
    gpa: Allocator,
    io: Io,
    options: *const raylane.options.Bench,
    results: *const raylane.bench.Results,
    target: *Target,
    diagnostic: *Diagnostic,
) ExitCode {
    var text: Io.Writer.Allocating = .init(gpa);
    defer text.deinit();
    var json: Io.Writer.Allocating = .init(gpa);
    defer json.deinit();
    raylane.bench.writeTables(results, &text.writer) catch return outOfMemory(io);
    if (options.json) |path| {
        raylane.bench.writeJson(results, &json.writer) catch return outOfMemory(io);
        if (raylane.options.isStdout(path)) return print(io, json.written());
        target.finish(&.{json.written()}, diagnostic) catch {
            _ = print(io, text.written()); // Minutes of work: show what was found.
            say(io, "raylane: {f}: {s}\n", .{ printable(path), diagnostic.message.text() });
            return .failed;
        };
    }
    return print(io, text.written());
}

/// Where `--json` goes; standard output where it does not go to a file.
fn openJson(
    io: Io,
    path: ?[]const u8,
    diagnostic: *Diagnostic,
) raylane.output.TargetError!Target {
    const name = path orelse return .openStdout(io);
    if (raylane.options.isStdout(name)) return .openStdout(io);
    return .openFile(io, &signals.temporary_files, name, diagnostic);
}

/// Where an error of a scene is: a place in its text, or the file as a whole.
fn placeOf(diagnostic: *const Diagnostic, scene: []const u8) []const u8 {
    const place = diagnostic.place.text();
    return if (place.len > 0) place else scene;
}

fn outOfMemory(io: Io) ExitCode {
    say(io, "raylane: out of memory\n", .{});
    return .failed;
}

fn processorCount() usize {
    const cpu_count = std.Thread.getCpuCount() catch 1;
    return @min(cpu_count, raylane.options.thread_count_max);
}

fn treeQuality(bvh: raylane.options.Bvh) raylane.prepare.TreeQuality {
    return switch (bvh) {
        inline else => |quality| @field(raylane.prepare.TreeQuality, @tagName(quality)),
    };
}

/// Renders one scene, then says what it cost or why it failed.
fn renderAndReport(
    account: *Account,
    io: Io,
    options: *const Options,
    diagnostic: *Diagnostic,
) ExitCode {
    const gpa = account.allocator();
    const output_name = raylane.options.outputName(gpa, options) catch {
        account.explain(&diagnostic.message);
        say(io, "raylane: {s}\n", .{diagnostic.message.text()});
        return .failed;
    };
    defer gpa.free(output_name);
    var job: Job = .{
        .gpa = gpa,
        .io = io,
        .options = options,
        .output_name = output_name,
        .diagnostic = diagnostic,
    };
    const outcome = job.run();
    job.sayWarnings();
    if (diagnostic.warning_dropped_count > 0 and !options.quiet) {
        job.sayOfScene("warning: {d} more", .{diagnostic.warning_dropped_count});
    }
    const report = outcome catch |err| {
        const file = if (err == error.OutputFailed)
            job.outputTitle()
        else
            placeOf(diagnostic, options.scene);
        if (err == error.OutOfMemory) account.explain(&diagnostic.message);
        const text = diagnostic.message.text();
        assert(text.len > 0);
        say(io, "raylane: {f}: {s}\n", .{ printable(file), text });
        return switch (err) {
            error.OutOfMemory, error.InputOutput, error.OutputFailed => .failed,
            error.CameraUnknown => .usage,
            error.InvalidInput, error.SceneTooLarge => .invalid,
            error.Canceled => unreachable, // Nobody does.
        };
    };
    return job.printReport(&report);
}

/// The way of one scene through the stages.
const Job = struct {
    gpa: Allocator,
    io: Io,
    options: *const Options,
    output_name: []const u8,
    diagnostic: *Diagnostic,
    progress: std.Progress.Node = .none,
    /// Samples a pixel and bounces: what the user says, or the scene.
    sample_count: u32 = raylane.options.sample_count_default,
    depth: u32 = raylane.options.depth_default,
    /// Warnings that the user has seen.
    warning_count: usize = 0,

    const Error = raylane.parse.Error || raylane.prepare.Error || raylane.trace.Error ||
        error{OutputFailed};

    fn run(job: *Job) Error!Report {
        if (!job.options.quiet) {
            job.progress = std.Progress.start(job.io, .{ .root_name = "raylane" });
        }
        defer job.progress.end();
        return job.render();
    }

    /// parse -> Scene -> prepare -> World -> trace -> Film -> output.
    fn render(job: *Job) Error!Report {
        const gpa = job.gpa;
        const io = job.io;
        const variant_index = job.options.variant_index;
        var times: raylane.statistics.StageTimes = .{};
        var target = try job.openTarget();
        defer target.abandon();

        const start = Io.Clock.awake.now(io);
        var scene = try raylane.parse.parse(gpa, io, job.options.scene, .{
            .allow_outside = job.options.allow_outside,
            .tessellation = job.options.tessellation,
            .output = target.replaces,
        }, job.diagnostic);
        const triangle_count = scene.triangleCount();
        job.sample_count = job.options.sample_count orelse scene.sample_count orelse
            raylane.options.sample_count_default;
        job.depth = job.options.depth orelse scene.depth orelse raylane.options.depth_default;
        times.parse_ns = since(io, start);

        var world = prepared: {
            defer scene.deinit();
            break :prepared try raylane.prepare.prepare(
                gpa,
                io,
                &scene,
                job.prepareSettings(),
                job.diagnostic,
                &times,
            );
        };
        defer world.deinit();
        job.sayWarnings();
        job.sayFacts(&world);

        const view = &world.view;
        const has_alpha = job.options.background == .transparent;
        const layers: raylane.film.Layers = .init(.{ .color = true, .alpha = has_alpha });
        var film: Film = try .init(gpa, view.width, view.height, layers);
        defer film.deinit(gpa);
        const output_settings = job.outputSettings();
        raylane.output.check(output_settings, view.width, view.height, job.diagnostic) catch
            return error.OutputFailed;
        const trace_start = Io.Clock.awake.now(io);
        const frame = world.frame();
        const settings = job.traceSettings();
        const traced = try raylane.trace.trace(gpa, variant_index, &frame, &film, settings);
        times.trace_ns = since(io, trace_start);
        if (traced.non_finite_count > 0) job.diagnostic.warn(
            "{d} pixels came out as not a number and were made black",
            .{traced.non_finite_count},
        );

        const output_start = Io.Clock.awake.now(io);
        raylane.output.write(gpa, &film.image, output_settings, &target, job.diagnostic) catch |err|
            return switch (err) {
                error.OutOfMemory => error.OutOfMemory,
                error.InputOutput => error.OutputFailed,
            };
        times.output_ns = since(io, output_start);
        times.total_ns = since(io, start);

        var report = job.reportOf(&world, &film.image);
        report.triangle_count = triangle_count;
        report.times = times;
        report.rays = traced.rays;
        if (job.options.count_tests) {
            const counted = try raylane.trace
                .traceCounting(gpa, variant_index, &frame, &film, settings);
            report.tests = counted.tests;
        }
        return report;
    }

    /// What the options and the results say; the measurements are the caller's.
    fn reportOf(job: *const Job, world: *const World, image: *const Image) Report {
        return .{
            .version = raylane.options.version,
            .scene = job.options.scene,
            .output = job.outputTitle(),
            .triangle_count = 0,
            .width = image.width,
            .height = image.height,
            .sample_count = job.sample_count,
            .depth = job.depth,
            .thread_count = job.threadCount(),
            .variant = raylane.variant.names[job.options.variant_index],
            .times = .{},
            .rays = .{},
            .tests = null,
            .bvh = .{
                .node_count = world.facts.tree.node_count,
                .depth = world.facts.tree.depth,
                .sah_cost = world.facts.tree.sah_cost,
                .bytes = world.facts.tree.bytes,
            },
            .memory_peak_bytes = raylane.report.memoryPeakBytes(),
            .image_hash = image.hash(),
            .warnings = &.{},
        };
    }

    /// What messages call the image's place.
    fn outputTitle(job: *const Job) []const u8 {
        return if (job.options.toStdout()) "standard output" else job.output_name;
    }

    fn openTarget(job: *Job) error{OutputFailed}!Target {
        if (job.options.toStdout()) return .openStdout(job.io);
        const temporaries = &signals.temporary_files;
        return Target.openFile(job.io, temporaries, job.output_name, job.diagnostic) catch
            error.OutputFailed;
    }

    fn prepareSettings(job: *const Job) raylane.prepare.Settings {
        const options = job.options;
        return .{
            .lanes = raylane.variant.compiled[options.variant_index].lanes,
            .thread_count = job.threadCount(),
            .tree_quality = treeQuality(options.bvh),
            .camera = switch (options.camera) {
                .default => .default,
                .auto => .auto,
                .index => |index| .{ .index = index },
                .name => |name| .{ .name = name },
            },
            .resolution = options.resolution,
            .ambient = options.ambient,
            .background = switch (options.background) {
                .default => null,
                .transparent => .{ 0, 0, 0 },
                .linear => |color| color,
                .srgb => |codes| color: {
                    var color: raylane.math.Vec3 = undefined;
                    for (&color, codes) |*light, code| light.* = raylane.math.srgb.decoded[code];
                    break :color color;
                },
            },
        };
    }

    fn traceSettings(job: *const Job) raylane.trace.Settings {
        return .{
            .thread_count = job.threadCount(),
            .sample_count = job.sample_count,
            .depth_max = job.depth,
            .tile_size = job.options.tile_size,
            .progress = job.progress,
        };
    }

    fn threadCount(job: *const Job) usize {
        return job.options.thread_count orelse processorCount();
    }

    fn outputSettings(job: *const Job) raylane.output.Settings {
        return .{
            .format = switch (job.options.format) {
                inline else => |format| @field(raylane.output.Format, @tagName(format)),
            },
            .exposure = switch (job.options.exposure) {
                .ev => |ev| .{ .ev = ev },
                .auto => .auto,
            },
            .transparent = job.options.background == .transparent,
            .jpeg_quality = job.options.jpeg_quality,
            .thread_count = job.threadCount(),
        };
    }

    /// Says the warnings that have not been said yet.
    fn sayWarnings(job: *Job) void {
        const diagnostic = job.diagnostic;
        const warnings = diagnostic.warnings[0..diagnostic.warning_count];
        if (!job.options.quiet) for (warnings[job.warning_count..]) |*warning| {
            job.sayOfScene("warning: {s}", .{warning.text()});
        };
        job.warning_count = warnings.len;
    }

    /// With `--verbose`: what was chosen where the user did not.
    fn sayFacts(job: *Job, world: *const World) void {
        if (!job.options.verbose) return;
        if (world.facts.camera_is_default) job.sayOfScene("view: framed on all there is", .{});
        if (world.facts.lights_are_default) {
            job.sayOfScene("lights: three directional ones fixed to the camera", .{});
        } else {
            job.sayOfScene("lights: {d}", .{world.lights.len});
        }
        job.sayOfScene("ambient radiance: {d}", .{world.environment.ambient});
        job.sayOfScene("tracer: {s}, {d} threads", .{
            raylane.variant.names[job.options.variant_index], job.threadCount(),
        });
        if (world.facts.degenerate_count > 0) {
            job.sayOfScene("{d} triangles without area left out", .{world.facts.degenerate_count});
        }
    }

    fn sayOfScene(job: *Job, comptime format: []const u8, arguments: anytype) void {
        const scene = printable(job.options.scene);
        say(job.io, "raylane: {f}: " ++ format ++ "\n", .{scene} ++ arguments);
    }

    /// Prints the report that the user wants, to standard error where the image has the output.
    fn printReport(job: *Job, measured: *const Report) ExitCode {
        const options = job.options;
        const to_stdout = !options.toStdout();
        const default: raylane.options.Stats = if (options.quiet or !to_stdout) .none else .text;
        var warnings: [raylane.diagnostic.warning_count_max][]const u8 = undefined;
        const diagnostic = job.diagnostic;
        for (diagnostic.warnings[0..diagnostic.warning_count], 0..) |*warning, index| {
            warnings[index] = warning.text();
        }
        var report = measured.*;
        report.warnings = warnings[0..diagnostic.warning_count];

        var text: Io.Writer.Allocating = .init(job.gpa);
        defer text.deinit();
        const written = switch (options.stats orelse default) {
            .none => return .ok,
            .text => raylane.report.writeText(&report, &text.writer),
            .json => raylane.report.writeJson(&report, &text.writer),
        };
        written catch return outOfMemory(job.io);
        if (!to_stdout) {
            say(job.io, "{s}", .{text.written()});
            return .ok;
        }
        // The picture is written. That goes for success where the report was not asked for.
        if (options.stats != null) return print(job.io, text.written());
        writeToStdout(job.io, text.written(), diagnostic) catch
            say(job.io, "raylane: warning: no report, standard output: {s}\n", .{
                diagnostic.message.text(),
            });
        return .ok;
    }
};

fn since(io: Io, start: Io.Timestamp) u64 {
    return @intCast(start.untilNow(io, .awake).toNanoseconds());
}

/// Prints what was asked for to standard output.
fn print(io: Io, text: []const u8) ExitCode {
    var diagnostic: Diagnostic = .{};
    writeToStdout(io, text, &diagnostic) catch {
        say(io, "raylane: standard output: {s}\n", .{diagnostic.message.text()});
        return .failed;
    };
    return .ok;
}

fn writeToStdout(
    io: Io,
    text: []const u8,
    diagnostic: *Diagnostic,
) raylane.output.TargetError!void {
    var target: Target = .openStdout(io);
    return target.finish(&.{text}, diagnostic);
}

/// Writes to standard error, beside the progress that may be shown there. When that fails there is
/// nobody left to tell.
fn say(io: Io, comptime format: []const u8, arguments: anytype) void {
    var buffer: [512]u8 = undefined;
    const stderr = io.lockStderr(&buffer, null) catch return;
    defer io.unlockStderr();
    stderr.file_writer.interface.print(format, arguments) catch return;
    stderr.file_writer.interface.flush() catch return;
}

/// Puts something that cannot be written in the place of standard files that are closed, lest the
/// next file that is opened takes a message or a report for its contents.
fn holdStandardFiles() void {
    for (0..3) |file| {
        if (std.c.fcntl(@intCast(file), std.c.F.GETFD) >= 0) continue;
        _ = std.c.open("/dev/null", .{ .ACCMODE = .RDONLY });
    }
}
