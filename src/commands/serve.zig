//! `raylane serve`: jobs on standard input, one JSON object a line, each answered by one line on
//! standard output, in one process that keeps what the next job can use.
//!
//! In: lines of bounded length. Out: pictures, and for each job its report or what is wrong with
//! it. Nothing that is wrong with a job ends the program.

const std = @import("std");
const console = @import("console.zig");
const raylane = @import("raylane");
const signals = @import("../signals.zig");
const stages = @import("stages.zig");
const Allocator = std.mem.Allocator;
const Confinement = @import("confine.zig").Confinement;
const Diagnostic = raylane.diagnostic.Diagnostic;
const ExitCode = @import("exit_code.zig").ExitCode;
const Io = std.Io;
const Kept = @import("serve/kept.zig").Kept;
const Options = raylane.cli.Options;
const Report = raylane.report.Report;
const Session = raylane.session.Session;
const Target = raylane.output.Target;
const TimeLimit = @import("time_limit.zig").TimeLimit;
const cli = raylane.cli;

const line_bytes_max = raylane.settings.job_bytes_max;

/// Answers all jobs, then ends with 0.
pub fn run(gpa: Allocator, io: Io, call: *const cli.ServeCall) ExitCode {
    var confinement: Confinement = .init(io, call.sandbox);
    confinement.is_verbose = call.verbose;
    confinement.addAll();
    var unused: Diagnostic = .{};
    if (confinement.enter(&unused)) |code| return code;
    const buffer = gpa.alloc(u8, line_bytes_max + 1) catch return console.outOfMemory(io);
    defer gpa.free(buffer);
    var input = Io.File.stdin().readerStreaming(io, buffer);
    var server: Server = .{ .gpa = gpa, .io = io, .call = call };
    defer server.forget();
    while (true) {
        const line = input.interface.takeDelimiter('\n') catch |err| switch (err) {
            error.StreamTooLong => {
                const code = server.refuseLine();
                if (code != .ok) return code;
                _ = input.interface.discardDelimiterInclusive('\n') catch |end| switch (end) {
                    error.EndOfStream => return .ok,
                    error.ReadFailed => return unreadable(io),
                };
                continue;
            },
            error.ReadFailed => return unreadable(io),
        } orelse return .ok;
        if (std.mem.trim(u8, line, " \t\r").len == 0) continue;
        const code = server.answer(line);
        if (code != .ok) return code;
    }
}

fn unreadable(io: Io) ExitCode {
    console.say(io, "raylane: standard input: it cannot be read\n", .{});
    return .failed;
}

const Server = struct {
    gpa: Allocator,
    io: Io,
    call: *const cli.ServeCall,
    /// Of the job before.
    kept: ?*Kept = null,

    const Error = stages.Error;

    /// Does what a line asks for and says how it went. Other codes than 0 are for the end of all.
    fn answer(server: *Server, line: []const u8) ExitCode {
        var arena_state: std.heap.ArenaAllocator = .init(server.gpa);
        defer arena_state.deinit();
        const arena = arena_state.allocator();
        var diagnostic: Diagnostic = .{};
        const job = cli.readJob(arena, server.io, line, &diagnostic) catch |err| {
            if (err == error.OutOfMemory) diagnostic.message.set("out of memory", .{});
            return server.refuse(arena, cli.idOf(arena, line), null, &diagnostic);
        };
        const parts = .{ server.call.defaults, job.arguments };
        const options = cli.parseParts(parts, raylane.variant.names, &diagnostic) catch
            return server.refuse(arena, job.id, null, &diagnostic);
        server.check(&options, &diagnostic) catch
            return server.refuse(arena, job.id, &options, &diagnostic);
        const output = cli.outputName(arena, &options) catch return console.outOfMemory(server.io);
        var warnings: [raylane.diagnostic.warning_count_max][]const u8 = undefined;
        var text: Io.Writer.Allocating = .init(arena);
        var limit: TimeLimit = .{
            .io = server.io,
            .seconds = options.time_max_s,
            .title = options.scene,
        };
        limit.prepareAnswer(arena, .{
            .id = job.id,
            .version = cli.version,
            .scene = options.scene,
            .output = output,
            .problem = undefined,
        }, false) catch return console.outOfMemory(server.io);
        const outcome = server.picture(&options, output, &limit, &diagnostic);
        if (limit.finish(outcome, &diagnostic)) |measured| {
            var report = measured;
            report.id = job.id;
            report.warnings = diagnostic.warningTexts(&warnings);
            raylane.report.writeJson(&report, &text.writer) catch
                return console.outOfMemory(server.io);
        } else |err| {
            if (err == error.OutOfMemory) server.explain(&diagnostic);
            // Whatever it was in the middle of.
            server.forget();
            const is_output = err == error.OutputFailed;
            const file = if (is_output) output else raylane.parse.title(options.scene);
            raylane.report.writeFailure(&.{
                .id = job.id,
                .version = cli.version,
                .scene = options.scene,
                .output = output,
                .problem = .of(&diagnostic, file, @backingInt(ExitCode.of(err))),
                .warnings = diagnostic.warningTexts(&warnings),
            }, &text.writer) catch return console.outOfMemory(server.io);
        }
        return console.print(server.io, text.written());
    }

    /// Answers a job that nothing was begun of.
    fn refuse(
        server: *Server,
        arena: Allocator,
        id: std.json.Value,
        options: ?*const Options,
        diagnostic: *const Diagnostic,
    ) ExitCode {
        var text: Io.Writer.Allocating = .init(arena);
        raylane.report.writeFailure(&.{
            .id = id,
            .version = cli.version,
            .scene = if (options) |known| known.scene else null,
            .output = if (options) |known| known.output else null,
            .problem = .of(diagnostic, "", @backingInt(ExitCode.usage)),
        }, &text.writer) catch return console.outOfMemory(server.io);
        return console.print(server.io, text.written());
    }

    fn refuseLine(server: *Server) ExitCode {
        var arena: std.heap.ArenaAllocator = .init(server.gpa);
        defer arena.deinit();
        var diagnostic: Diagnostic = .{};
        diagnostic.message.set("the line is longer than {d} bytes", .{line_bytes_max});
        return server.refuse(arena.allocator(), .null, null, &diagnostic);
    }

    /// Refuses what has no place among jobs.
    fn check(
        server: *const Server,
        options: *const Options,
        diagnostic: *Diagnostic,
    ) error{UsageInvalid}!void {
        const fail = Diagnostic.fail;
        if (options.toStdout())
            return fail(diagnostic, error.UsageInvalid, "standard output has the answers", .{});
        if (std.mem.eql(u8, options.scene, raylane.settings.standard_input))
            return fail(diagnostic, error.UsageInvalid, "standard input has the jobs", .{});
        if (options.progress_image != null)
            return fail(diagnostic, error.UsageInvalid, "a job has no progress image", .{});
        if (options.progress.form == .json)
            return fail(diagnostic, error.UsageInvalid, "a job tells no progress", .{});
        if (options.isBatch() or options.write.format == .y4m)
            return fail(diagnostic, error.UsageInvalid, "a job is one picture of a name", .{});
        if (options.sandbox != server.call.sandbox)
            return fail(diagnostic, error.UsageInvalid, "a job has no sandbox of its own", .{});
        return @import("render.zig").checkVariant(&options.render, diagnostic);
    }

    fn picture(
        server: *Server,
        asked: *const Options,
        output: []const u8,
        limit: *TimeLimit,
        diagnostic: *Diagnostic,
    ) Error!Report {
        var target = Target.openFile(server.io, &signals.temporary_files, output, diagnostic) catch
            return error.OutputFailed;
        defer target.abandon();
        const kept = try server.keep(asked, target.replaces, limit, diagnostic);
        const session = &kept.session;
        var options = asked.*;
        try kept.recall(server.io, &options.view.environment.source);
        try stages.pose(session, &options);
        try session.view(options.view);
        // They would not be said again, and what was missing may be there next time.
        if (diagnostic.warning_count > 0) kept.is_good = false;
        try stages.check(session, &options);
        try session.render(options.render);
        try stages.write(session, &target, &options, null);
        return stages.report(session, &options, output);
    }

    /// The session of the job before where the same scene is as it was, else a new one.
    fn keep(
        server: *Server,
        options: *const Options,
        replaced: ?raylane.identity.Identity,
        limit: *TimeLimit,
        diagnostic: *Diagnostic,
    ) Session.Error!*Kept {
        if (server.kept) |kept| {
            if (try kept.holds(server.io, options, replaced)) {
                kept.begin(server.io, replaced, diagnostic);
                try limit.start(&kept.account, &kept.session.pool, diagnostic);
                return kept;
            }
            server.forget();
        }
        server.kept = try .create(server.gpa, server.io, options, diagnostic);
        const kept = server.kept.?;
        try limit.start(&kept.account, &kept.session.pool, diagnostic);
        try kept.load(server.io, options, replaced);
        return kept;
    }

    fn explain(server: *const Server, diagnostic: *Diagnostic) void {
        if (server.kept) |kept| return kept.account.explain(&diagnostic.message);
        diagnostic.message.set("out of memory", .{});
    }

    fn forget(server: *Server) void {
        if (server.kept) |kept| kept.destroy();
        server.kept = null;
    }
};
