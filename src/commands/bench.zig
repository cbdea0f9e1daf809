//! `raylane bench`: all variants on some scenes, tables and a file of what was measured.

const std = @import("std");
const console = @import("console.zig");
const raylane = @import("raylane");
const signals = @import("../signals.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = raylane.diagnostic.Diagnostic;
const Display = raylane.display.Display;
const ExitCode = @import("exit_code.zig").ExitCode;
const Io = std.Io;
const Target = raylane.output.Target;
const cli = raylane.cli;
const printable = raylane.diagnostic.printable;

/// Measures all variants on some scenes, then prints the tables, or why there are none.
pub fn run(init: std.process.Init, options: *const cli.Bench, diagnostic: *Diagnostic) ExitCode {
    const io = init.io;
    var settings = benchSettings(options);
    if (std.mem.findScalar(bool, &settings.wanted, true) == null) {
        const integrator = settings.integrator orelse .whitted;
        console.say(io, "raylane: no variant{s} has a name that contains {f}; " ++
            "--list-variants names them\n", .{
            if (integrator == .whitted) "" else " with that integrator",
            raylane.diagnostic.quote(options.variants.?),
        });
        return .usage;
    }
    if (!raylane.variant.are_all and !options.quiet) console.say(
        io,
        "raylane: this program holds {d} of the variants; zig build -Dvariants=all builds all\n",
        .{raylane.variant.names.len},
    );
    // Before the work, so that a place that cannot be written is an error in the first second.
    var target = openJson(io, options.json, diagnostic) catch {
        const text = diagnostic.message.text();
        console.say(io, "raylane: {f}: {s}\n", .{ printable(options.json.?), text });
        return .failed;
    };
    defer target.abandon();
    settings.output = target.replaces;
    const shown: raylane.settings.Progress = .{ .form = if (options.quiet) .none else .auto };
    var slot: [1]Display.Slot = undefined;
    var display: Display = .init(io, shown, &signals.progress_line, &slot);
    display.start();
    var run_of: raylane.bench.Bench = .{
        .arena = init.arena.allocator(),
        .gpa = init.gpa,
        .io = io,
        .settings = &settings,
        .diagnostic = diagnostic,
        .display = &display,
    };
    const outcome = run_of.run();
    display.stop();
    if (!options.quiet) for (diagnostic.warnings[0..diagnostic.warning_count]) |*warning| {
        console.say(io, "raylane: warning: {s}\n", .{warning.text()});
    };
    const results = outcome catch |err| {
        const text = if (err == error.OutOfMemory) "out of memory" else diagnostic.message.text();
        const place = printable(console.placeOf(diagnostic, run_of.scene));
        console.say(io, "raylane: {f}: {s}\n", .{ place, text });
        return .of(err);
    };
    return printBench(init.gpa, io, options, &results, &target, diagnostic);
}

/// Where `--json` goes; standard output where it does not go to a file.
fn openJson(io: Io, path: ?[]const u8, diagnostic: *Diagnostic) raylane.output.TargetError!Target {
    const name = path orelse return .openStdout(io);
    if (cli.isStdout(name)) return .openStdout(io);
    return .openFile(io, &signals.temporary_files, name, diagnostic);
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
    raylane.bench.writeTables(results, &text.writer) catch return console.outOfMemory(io);
    if (options.json) |path| {
        raylane.bench.writeJson(results, &json.writer) catch return console.outOfMemory(io);
        if (cli.isStdout(path)) return console.print(io, json.written());
        target.finish(&.{json.written()}, diagnostic) catch {
            _ = console.print(io, text.written()); // Minutes of work: show what was found.
            console.say(io, "raylane: {f}: {s}\n", .{ printable(path), diagnostic.message.text() });
            return .failed;
        };
    }
    return console.print(io, text.written());
}
