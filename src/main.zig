//! The program: the command line, a session led through its stages, the report.
//!
//! In: arguments. Out: an image, a report, and an exit code that says how it went. Whatever a stage
//! has to say reaches the user here, in one line; nothing else prints or exits.

const std = @import("std");
const raylane = @import("raylane");
const cli = raylane.cli;
const signals = @import("signals.zig");
const Allocator = std.mem.Allocator;
const Io = std.Io;
const Account = raylane.memory_account.Account;
const assert = std.debug.assert;
const Diagnostic = raylane.diagnostic.Diagnostic;
const Options = raylane.cli.Options;
const Report = raylane.report.Report;
const Session = raylane.session.Session;
const Target = raylane.output.Target;
const World = raylane.world.World;
const printable = raylane.diagnostic.printable;

const ExitCode = enum(u8) {
    ok = 0,
    /// Files or memory.
    failed = 1,
    usage = 2,
    /// The scene is invalid or asks for what is not supported.
    invalid = 3,
    /// Images that must be the same are not.
    differ = 4,
    /// 128 and the number of the signal that asked for a picture before it was finished.
    _,
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
    const command = cli.parse(own_arguments, names, &diagnostic) catch {
        say(io, "raylane: {s}\n", .{diagnostic.message.text()});
        return .usage;
    };
    switch (command) {
        .help => return print(io, cli.help),
        .bench_help => return print(io, cli.bench_help),
        .compare_help => return print(io, cli.compare_help),
        .info_help => return print(io, cli.info_help),
        .version => return print(io, "raylane " ++ cli.version ++ "\n"),
        .licenses => return print(io, raylane.licenses),
        .list_variants => return print(io, comptime list: {
            var list: []const u8 = "";
            for (names) |name| list = list ++ name ++ "\n";
            break :list list;
        }),
        .render => |*options| {
            const chosen = &options.render;
            if (chosen.integrator != .whitted and
                raylane.variant.litIndexOf(chosen.variant) == null)
            {
                say(io, "raylane: variant '{s}' has no integrator '{t}', but '{s}' has\n", .{
                    names[chosen.variant], chosen.integrator, names[0],
                });
                return .usage;
            }
            var account: Account = .init(init.gpa, options.memory_max);
            return renderAndReport(&account, io, options, &diagnostic);
        },
        .bench => |*options| return bench(init, options, &diagnostic),
        .compare => |*options| return compare(init.gpa, io, options, &diagnostic),
        .info => |*options| return info(init.gpa, io, options, &diagnostic),
    }
}

/// Measures all variants on some scenes, then prints the tables, or why there are none.
fn bench(init: std.process.Init, options: *const cli.Bench, diagnostic: *Diagnostic) ExitCode {
    const io = init.io;
    var settings = benchSettings(options);
    if (std.mem.findScalar(bool, &settings.wanted, true) == null) {
        const integrator = settings.integrator orelse .whitted;
        say(io, "raylane: no variant{s} has a name that contains {f}; --list-variants names " ++
            "them\n", .{
            if (integrator == .whitted) "" else " with that integrator",
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
        return exitCodeOf(err);
    };
    return printBench(init.gpa, io, options, &results, &target, diagnostic);
}

fn benchSettings(options: *const cli.Bench) raylane.bench.Settings {
    var settings: raylane.bench.Settings = .{
        .version = cli.version,
        .scenes = options.scenes[0..options.scene_count],
        .allow_outside = options.allow_outside,
        .width = options.resolution[0],
        .height = options.resolution[1],
        .thread_count = options.thread_count orelse raylane.session.processorCount(),
        .sample_count = options.sample_count,
        .depth = options.depth,
        .tree_quality = options.tree_quality,
        .integrator = options.integrator,
        .wanted = undefined,
        .round_count = if (options.round_count) |count| count else null,
        .time_s = options.time_s,
        .energy = if (options.energy) .{
            .root = options.energy_root,
            .command = options.energy_command,
        } else null,
    };
    if (options.scene_count == 0) settings.scenes = raylane.bench.default_scenes;
    const is_lit = (options.integrator orelse .whitted) != .whitted;
    for (&settings.wanted, raylane.variant.names, 0..) |*is_wanted, name, index| {
        const holds = !is_lit or raylane.variant.litIndexOf(index) != null;
        is_wanted.* = holds and options.wants(name);
    }
    return settings;
}

/// Prints the tables, and writes the file of `--json`; on standard output that is in their place.
fn printBench(
    gpa: Allocator,
    io: Io,
    options: *const cli.Bench,
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
        if (cli.isStdout(path)) return print(io, json.written());
        target.finish(&.{json.written()}, diagnostic) catch {
            _ = print(io, text.written()); // Minutes of work: show what was found.
            say(io, "raylane: {f}: {s}\n", .{ printable(path), diagnostic.message.text() });
            return .failed;
        };
    }
    return print(io, text.written());
}

/// Compares two images, prints how far they are apart, and says which thresholds they pass.
fn compare(gpa: Allocator, io: Io, options: *const cli.Compare, diagnostic: *Diagnostic) ExitCode {
    var account: Account = .init(gpa, null);
    const allocator = account.allocator();
    var target: ?Target = openMap(io, options.output, diagnostic) catch {
        say(io, "raylane: {f}: {s}\n", .{ printable(options.output.?), diagnostic.message.text() });
        return .failed;
    };
    defer if (target) |*map| map.abandon();
    const replaced = if (target) |*map| map.replaces else null;
    var pictures: [2]raylane.compare.Picture = undefined;
    var count: usize = 0;
    defer for (pictures[0..count]) |*picture| picture.deinit(allocator);
    for (&pictures, options.images) |*picture, name| {
        const ev = options.exposure_ev;
        picture.* = raylane.compare.read(
            allocator,
            io,
            name,
            replaced,
            ev,
            diagnostic,
        ) catch |err| {
            return fail(&account, io, name, err, diagnostic);
        };
        count += 1;
    }
    const first = &pictures[0];
    const second = &pictures[1];
    if (first.width != second.width or first.height != second.height) {
        say(io, "raylane: {f}: {d}x{d} pixels, where {f} has {d}x{d}\n", .{
            printable(options.images[1]), second.width, second.height,
            printable(options.images[0]), first.width,  first.height,
        });
        return .invalid;
    }
    const map = if (target) |*map| map else null;
    return printComparison(allocator, io, options, .{ first, second }, map, diagnostic) catch
        outOfMemory(io);
}

/// Where the picture of the differences goes; null: there is none.
fn openMap(io: Io, path: ?[]const u8, diagnostic: *Diagnostic) raylane.output.TargetError!?Target {
    const name = path orelse return null;
    if (cli.isStdout(name)) return Target.openStdout(io);
    return try Target.openFile(io, &signals.temporary_files, name, diagnostic);
}

fn printComparison(
    gpa: Allocator,
    io: Io,
    options: *const cli.Compare,
    pictures: [2]*const raylane.compare.Picture,
    map: ?*Target,
    diagnostic: *Diagnostic,
) error{ OutOfMemory, WriteFailed }!ExitCode {
    var comparison: raylane.compare.Comparison = try .of(gpa, pictures[0], pictures[1]);
    defer comparison.deinit(gpa);
    if (map) |target| {
        writeHeatMap(gpa, target, &comparison, diagnostic) catch |err| {
            if (err == error.OutOfMemory) return error.OutOfMemory;
            const name = printable(options.output.?);
            say(io, "raylane: {f}: {s}\n", .{ name, diagnostic.message.text() });
            return .failed;
        };
    }
    var text: Io.Writer.Allocating = .init(gpa);
    defer text.deinit();
    const to_stdout = options.output == null or !cli.isStdout(options.output.?);
    switch (options.stats orelse if (to_stdout) cli.Stats.text else .none) {
        .none => {},
        .text => try comparison.writeText(&text.writer),
        .json => try comparison.writeJson(options.images, &text.writer),
    }
    if (!to_stdout) {
        say(io, "{s}", .{text.written()});
    } else if (text.written().len > 0 and print(io, text.written()) != .ok) return .failed;
    var exit_code: ExitCode = .ok;
    for (std.enums.values(raylane.settings.Metric)) |metric| {
        const threshold = options.thresholds.get(metric) orelse continue;
        if (!comparison.metrics.isBeyond(metric, threshold)) continue;
        exit_code = .differ;
        say(io, "raylane: {f}: {t} is {d:.5}, the threshold {d}\n", .{
            printable(options.images[1]), metric, comparison.metrics.of(metric), threshold,
        });
    }
    return exit_code;
}

fn writeHeatMap(
    gpa: Allocator,
    target: *Target,
    comparison: *const raylane.compare.Comparison,
    diagnostic: *Diagnostic,
) error{ OutOfMemory, InputOutput }!void {
    const pixels = try comparison.heatMap(gpa);
    defer gpa.free(pixels);
    const width = comparison.width;
    const height = comparison.height;
    try raylane.output.check(.png, false, width, height, diagnostic);
    const file = try raylane.output.encodePng(gpa, width, height, pixels);
    defer gpa.free(file);
    return target.finish(&.{file}, diagnostic);
}

/// Says what is in a scene file, or why it cannot be read.
fn info(gpa: Allocator, io: Io, options: *const cli.Info, diagnostic: *Diagnostic) ExitCode {
    var account: Account = .init(gpa, null);
    var text: Io.Writer.Allocating = .init(account.allocator());
    defer text.deinit();
    const outcome = describe(&account, io, options, diagnostic, &text.writer);
    const scene = options.scene;
    if (!options.quiet) {
        for (diagnostic.warnings[0..diagnostic.warning_count]) |*warning| {
            sayOf(io, scene, "warning: {s}", .{warning.text()});
        }
        sayDropped(io, scene, diagnostic);
    }
    outcome catch |err| return switch (err) {
        error.WriteFailed => outOfMemory(io),
        else => |other| fail(&account, io, placeOf(diagnostic, scene), other, diagnostic),
    };
    return print(io, text.written());
}

fn describe(
    account: *Account,
    io: Io,
    options: *const cli.Info,
    diagnostic: *Diagnostic,
    writer: *Io.Writer,
) (Session.Error || Io.Writer.Error)!void {
    const gpa = account.allocator();
    const name = options.scene;
    var scene = try raylane.session.loadScene(gpa, io, name, options.load, diagnostic);
    defer scene.deinit();
    var arena: std.heap.ArenaAllocator = .init(gpa);
    defer arena.deinit();
    var found = try raylane.info.collect(gpa, arena.allocator(), &scene, diagnostic);
    found.version = cli.version;
    found.name = name;
    var warnings: [raylane.diagnostic.warning_count_max][]const u8 = undefined;
    found.warnings = diagnostic.warningTexts(&warnings);
    return if (options.json)
        raylane.info.writeJson(&found, writer)
    else
        raylane.info.writeText(&found, writer);
}

/// Says why a file could not be had.
fn fail(
    account: *const Account,
    io: Io,
    file: []const u8,
    err: (Job.Error || raylane.bench.Error),
    diagnostic: *Diagnostic,
) ExitCode {
    if (err == error.OutOfMemory) account.explain(&diagnostic.message);
    const text = diagnostic.message.text();
    assert(text.len > 0);
    say(io, "raylane: {f}: {s}\n", .{ printable(file), text });
    return exitCodeOf(err);
}

fn exitCodeOf(err: (Job.Error || raylane.bench.Error)) ExitCode {
    return switch (err) {
        error.OutOfMemory, error.InputOutput, error.OutputFailed => .failed,
        error.CameraUnknown, error.SceneUnknown => .usage,
        error.MaterialVariantUnknown, error.AnimationUnknown => .usage,
        error.InvalidInput, error.SceneTooLarge => .invalid,
        error.ImagesDiffer => .differ,
        error.Canceled => unreachable, // Nobody asks for it here.
    };
}

/// Where `--json` goes; standard output where it does not go to a file.
fn openJson(io: Io, path: ?[]const u8, diagnostic: *Diagnostic) raylane.output.TargetError!Target {
    const name = path orelse return .openStdout(io);
    if (cli.isStdout(name)) return .openStdout(io);
    return .openFile(io, &signals.temporary_files, name, diagnostic);
}

/// Where an error of a scene is: a place in its text, or the file as a whole.
fn placeOf(diagnostic: *const Diagnostic, scene: []const u8) []const u8 {
    const place = diagnostic.place.text();
    return if (place.len > 0) place else raylane.parse.title(scene);
}

fn outOfMemory(io: Io) ExitCode {
    say(io, "raylane: out of memory\n", .{});
    return .failed;
}

/// Renders one scene, then says what it cost or why it failed.
fn renderAndReport(
    account: *Account,
    io: Io,
    options: *const Options,
    diagnostic: *Diagnostic,
) ExitCode {
    const gpa = account.allocator();
    const output_name = cli.outputName(gpa, options) catch {
        account.explain(&diagnostic.message);
        say(io, "raylane: {s}\n", .{diagnostic.message.text()});
        return .failed;
    };
    defer gpa.free(output_name);
    var job: Job = .{
        .io = io,
        .options = options,
        .output_name = output_name,
        .diagnostic = diagnostic,
        .session = .init(
            gpa,
            io,
            if (options.thread_count) |count| count else null,
            diagnostic,
        ),
    };
    defer job.session.deinit();
    const outcome = job.run();
    job.sayWarnings();
    if (!options.quiet) sayDropped(io, options.scene, diagnostic);
    const report = outcome catch |err| {
        const file = if (err == error.OutputFailed)
            job.failed_output orelse job.outputTitle()
        else
            placeOf(diagnostic, options.scene);
        return fail(account, io, file, err, diagnostic);
    };
    const exit_code = job.printReport(&report);
    if (exit_code != .ok or !report.is_partial) return exit_code;
    return @fromBackingInt(@intCast(128 + signals.stop.signal.load(.monotonic)));
}

/// The way of one scene through the session.
const Job = struct {
    io: Io,
    options: *const Options,
    output_name: []const u8,
    diagnostic: *Diagnostic,
    session: Session,
    /// Where the picture could not be written, if it is not the output.
    failed_output: ?[]const u8 = null,
    /// Warnings that the user has seen.
    warning_count: usize = 0,

    const Error = Session.Error || error{OutputFailed};

    fn run(job: *Job) Error!Report {
        const session = &job.session;
        if (!job.options.quiet) {
            session.progress = std.Progress.start(job.io, .{ .root_name = "raylane" });
        }
        defer session.progress.end();
        const options = job.options;
        // Before the work, so that a place that cannot be written is an error in the first second.
        var target = try job.openTarget();
        defer target.abandon();
        var progress_image = try job.openProgressImage();
        defer if (progress_image) |*image| image.close();
        session.progress_image = if (progress_image) |*image| image else null;
        session.stop = &signals.stop.is_asked;
        var load = options.load;
        load.output = target.replaces;
        try session.load(options.scene, load);
        try session.pose(.{
            .lanes = raylane.variant.compiled[options.render.variant].lanes,
            .tree_quality = options.tree_quality,
            .sharing = .of(options.instances),
            .animation = options.animation,
            .view = options.view,
        });
        try session.view(options.view);
        job.sayWarnings();
        job.sayVariants(session.scene.?.material_variants);
        job.sayAnimations();
        session.dropScene();
        signals.stop.is_awaited.store(options.partial, .release);
        job.sayFacts(&session.world.?);
        session.checkWrite(options.write) catch return error.OutputFailed;
        try session.render(options.render);
        signals.stop.is_awaited.store(false, .release);
        session.write(&target, options.write) catch |err| return switch (err) {
            error.OutOfMemory, error.Canceled => |other| other,
            error.InputOutput => error.OutputFailed,
        };
        var report = session.report(options.render);
        report.version = cli.version;
        report.scene = options.scene;
        report.output = job.outputTitle();
        if (options.count_tests) report.tests = try session.countTests(options.render);
        return report;
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

    fn openProgressImage(job: *Job) error{OutputFailed}!?raylane.session.ProgressImage {
        const path = job.options.progress_image orelse return null;
        const temporaries = &signals.temporary_files;
        const choices = job.options.write;
        return raylane.session.ProgressImage
            .open(job.io, temporaries, path, choices, job.diagnostic) catch {
            job.failed_output = path;
            return error.OutputFailed;
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
        if (world.facts.environment_is_default) {
            const dimmed = if (world.facts.own_light_count > 0) ", dimmed" else "";
            job.sayOfScene("environment: the studio{s}", .{dimmed});
        }
        if (world.facts.lights_are_default) {
            job.sayOfScene("lights: three directional ones fixed to the camera", .{});
        } else {
            job.sayOfScene("lights: {d}", .{world.lights.len});
        }
        job.sayOfScene("ambient radiance: {d}", .{world.environment.ambient});
        job.sayOfScene("tracer: {s}, {d} threads", .{
            raylane.variant.names[job.options.render.variant], job.session.pool.thread_count,
        });
        if (world.facts.degenerate_count > 0) {
            job.sayOfScene("{d} triangles without area left out", .{world.facts.degenerate_count});
        }
    }

    /// The same of what the file offers besides.
    fn sayVariants(job: *Job, names: []const []const u8) void {
        if (!job.options.verbose or job.options.load.material_variant != .default) return;
        for (names, 0..) |name, index| {
            const quoted = raylane.diagnostic.quote(name);
            job.sayOfScene("material variant {d}: {f}, not chosen", .{ index, quoted });
        }
    }

    /// And of its animations; which one is shown where nobody asked for it.
    fn sayAnimations(job: *Job) void {
        if (!job.options.verbose or job.options.animation.which != .default) return;
        const moment = job.session.posed.?.moment;
        for (job.session.scene.?.animations, 0..) |*animation, index| {
            const quoted = raylane.diagnostic.quote(animation.name);
            const span = animation.span() orelse continue;
            if (moment.running == .one and moment.running.one == index) {
                job.sayOfScene("animation {d}: {f} at {d} s, for at rest not all is seen", .{
                    index, quoted, moment.time_s,
                });
            } else job.sayOfScene("animation {d}: {f}, {d} to {d} s, not chosen", .{
                index, quoted, span[0], span[1],
            });
        }
    }

    fn sayOfScene(job: *Job, comptime format: []const u8, arguments: anytype) void {
        sayOf(job.io, job.options.scene, format, arguments);
    }

    /// Prints the report that the user wants, to standard error where the image has the output.
    fn printReport(job: *Job, measured: *const Report) ExitCode {
        const options = job.options;
        const to_stdout = !options.toStdout();
        const default: cli.Stats = if (options.quiet or !to_stdout) .none else .text;
        var warnings: [raylane.diagnostic.warning_count_max][]const u8 = undefined;
        const diagnostic = job.diagnostic;
        var report = measured.*;
        report.warnings = diagnostic.warningTexts(&warnings);

        var text: Io.Writer.Allocating = .init(job.session.gpa);
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

/// Says something of a scene.
fn sayOf(io: Io, scene: []const u8, comptime format: []const u8, arguments: anytype) void {
    const title = printable(raylane.parse.title(scene));
    say(io, "raylane: {f}: " ++ format ++ "\n", .{title} ++ arguments);
}

fn sayDropped(io: Io, scene: []const u8, diagnostic: *const Diagnostic) void {
    const count = diagnostic.warning_dropped_count;
    if (count > 0) sayOf(io, scene, "warning: {d} more", .{count});
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
