//! `raylane`: one scene led through a session's stages to a picture and its report; several are a
//! batch.

const std = @import("std");
const batch = @import("batch.zig");
const confine = @import("confine.zig");
const console = @import("console.zig");
const facts = @import("facts.zig");
const raylane = @import("raylane");
const signals = @import("../signals.zig");
const stages = @import("stages.zig");
const Account = raylane.memory_account.Account;
const Allocator = std.mem.Allocator;
const Diagnostic = raylane.diagnostic.Diagnostic;
const Display = raylane.display.Display;
const ExitCode = @import("exit_code.zig").ExitCode;
const Io = std.Io;
const Options = raylane.cli.Options;
const Report = raylane.report.Report;
const Session = raylane.session.Session;
const TimeLimit = @import("time_limit.zig").TimeLimit;
const Target = raylane.output.Target;
const cli = raylane.cli;
const printable = raylane.diagnostic.printable;

/// Renders, then says what it cost or why it failed.
pub fn run(gpa: Allocator, io: Io, options: *const Options, diagnostic: *Diagnostic) ExitCode {
    checkVariant(&options.render, diagnostic) catch {
        console.say(io, "raylane: {s}\n", .{diagnostic.message.text()});
        return failed(gpa, io, options, null, "", .usage, diagnostic);
    };
    if (options.toStdout() and console.isTerminal(io)) return .usage;
    if (options.isBatch() or isFolder(io, options.scene))
        return batch.run(gpa, io, options, diagnostic);
    var account: Account = .initFor(gpa, io, options.memory_max);
    if (confine.aroundPictures(gpa, io, options[0..1], diagnostic)) |code|
        return failed(gpa, io, options, null, "", code, diagnostic);
    return renderAndReport(&account, io, options, diagnostic);
}

/// Refuses an integrator that the variant was built without.
pub fn checkVariant(
    chosen: *const raylane.settings.Render,
    diagnostic: *Diagnostic,
) error{UsageInvalid}!void {
    if (chosen.integrator == .whitted) return;
    if (raylane.variant.litIndexOf(chosen.variant) != null) return;
    const names = raylane.variant.names;
    return diagnostic.fail(
        error.UsageInvalid,
        "variant '{s}' has no integrator '{t}', but '{s}' has",
        .{ names[chosen.variant], chosen.integrator, names[0] },
    );
}

/// Prints what there is instead of the report that was asked for.
fn failed(
    gpa: Allocator,
    io: Io,
    options: *const Options,
    output: ?[]const u8,
    file: []const u8,
    code: ExitCode,
    diagnostic: *const Diagnostic,
) ExitCode {
    if (options.stats != .json) return code;
    var warnings: [raylane.diagnostic.warning_count_max][]const u8 = undefined;
    const failure: raylane.report.Failure = .{
        .version = cli.version,
        .scene = options.scene,
        .output = output orelse options.output,
        .problem = .of(diagnostic, file, @backingInt(code)),
        .warnings = diagnostic.warningTexts(&warnings),
    };
    console.printFailure(gpa, io, &failure, options.toStdout());
    return code;
}

fn isFolder(io: Io, path: []const u8) bool {
    const stat = Io.Dir.cwd().statFile(io, path, .{}) catch return false;
    return stat.kind == .directory;
}

fn renderAndReport(
    account: *Account,
    io: Io,
    options: *const Options,
    diagnostic: *Diagnostic,
) ExitCode {
    const gpa = account.allocator();
    const output_name = cli.outputName(gpa, options) catch {
        account.explain(&diagnostic.message);
        console.say(io, "raylane: {s}\n", .{diagnostic.message.text()});
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
    var limit: TimeLimit = .{
        .io = io,
        .seconds = options.time_max_s,
        .title = raylane.parse.title(options.scene),
    };
    var slot: [1]Display.Slot = undefined;
    var display: Display = .init(io, options.progress, &signals.progress_line, &slot);
    display.start();
    const progress = display.beginFile(.{ .index = 1, .count = 1, .name = options.scene });
    job.session.pool.progress = progress;
    var arena: std.heap.ArenaAllocator = .init(gpa);
    defer arena.deinit();
    const outcome = limit.finish(job.runWithin(&limit, account, arena.allocator()), diagnostic);
    display.endFile(progress, if (outcome) |_| .done else |_| .failed);
    display.stop();
    job.sayWarnings();
    if (!options.quiet) console.sayDropped(io, options.scene, diagnostic);
    const report = outcome catch |err| {
        const file = if (err == error.OutputFailed)
            job.failed_output orelse job.outputTitle()
        else
            console.placeOf(diagnostic, options.scene);
        const code = console.fail(account, io, file, err, diagnostic);
        return failed(gpa, io, options, job.outputTitle(), file, code, diagnostic);
    };
    const exit_code = job.printReport(&report);
    if (exit_code != .ok or !report.is_partial) return exit_code;
    const signal = signals.stop.signal.load(.monotonic);
    if (!options.quiet) console.say(io, "raylane: {s}: {f} written with {d} of {d} samples\n", .{
        signals.verbOf(@fromBackingInt(signal)), printable(job.outputTitle()),
        report.sample_count,                     job.session.sampleCount(options.render),
    });
    return @fromBackingInt(@intCast(128 + signal));
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

    const Error = stages.Error;

    fn runWithin(
        job: *Job,
        limit: *TimeLimit,
        account: *Account,
        arena: Allocator,
    ) Error!Report {
        if (job.options.stats == .json) try limit.prepareAnswer(arena, .{
            .version = cli.version,
            .scene = job.options.scene,
            .output = job.outputTitle(),
            .problem = undefined,
        }, job.options.toStdout());
        try limit.start(account, &job.session.pool, job.diagnostic);
        return job.run();
    }

    fn run(job: *Job) Error!Report {
        const session = &job.session;
        const options = job.options;
        // Before the work, so that a place that cannot be written is an error in the first second.
        var target = try job.openTarget();
        defer target.abandon();
        job.setOutcome(&target);
        defer signals.outcome.clear();
        var progress_image = try job.openProgressImage();
        defer if (progress_image) |*image| image.close();
        session.progress_image = if (progress_image) |*image| image else null;
        session.stop = &signals.stop.is_asked;
        var load = options.load;
        load.output = target.replaces;
        try session.load(options.scene, load);
        try stages.pose(session, options);
        try session.view(options.view);
        job.sayWarnings();
        facts.say(job.io, options, session);
        try stages.check(session, options);
        session.dropScene();
        signals.stop.is_awaited.store(options.partial, .release);
        try session.render(options.render);
        signals.stop.is_awaited.store(false, .release);
        try stages.write(session, &target, options, null);
        signals.outcome.clear();
        const report = try stages.report(session, options, job.outputTitle());
        return report;
    }

    /// What a signal says that ends the program.
    fn setOutcome(job: *const Job, target: *const Target) void {
        if (job.options.quiet) return;
        const title = printable(job.outputTitle());
        if (target.replaces != null)
            signals.outcome.set("{f} kept as it was", .{title})
        else
            signals.outcome.set("{f} not written", .{title});
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

    fn sayOfScene(job: *Job, comptime format: []const u8, arguments: anytype) void {
        console.sayOf(job.io, job.options.scene, format, arguments);
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
        written catch return console.outOfMemory(job.io);
        if (!to_stdout) {
            console.say(job.io, "{s}", .{text.written()});
            return .ok;
        }
        // The picture is written. That goes for success where the report was not asked for.
        if (options.stats != null) return console.print(job.io, text.written());
        console.writeToStdout(job.io, text.written(), diagnostic) catch
            console.say(job.io, "raylane: warning: no report, standard output: {s}\n", .{
                diagnostic.message.text(),
            });
        return .ok;
    }
};
