//! `raylane merge`: a picture of its parts, in the place where one run would have written it.

const std = @import("std");
const console = @import("console.zig");
const raylane = @import("raylane");
const signals = @import("../signals.zig");
const Account = raylane.memory_account.Account;
const Allocator = std.mem.Allocator;
const Confinement = @import("confine.zig").Confinement;
const Diagnostic = raylane.diagnostic.Diagnostic;
const ExitCode = @import("exit_code.zig").ExitCode;
const Io = std.Io;
const Target = raylane.output.Target;
const cli = raylane.cli;

/// Merges the parts and writes the picture.
pub fn run(gpa: Allocator, io: Io, options: *const cli.Merge, diagnostic: *Diagnostic) ExitCode {
    var account: Account = .initFor(gpa, io, options.memory_max);
    if (confine(gpa, io, options, diagnostic)) |code| return code;
    var job: Job = .{ .gpa = account.allocator(), .io = io, .options = options };
    job.run(diagnostic) catch |err| {
        const title = if (options.toStdout()) "standard output" else options.output;
        const place = diagnostic.place.text();
        return console.fail(&account, io, if (place.len > 0) place else title, err, diagnostic);
    };
    return .ok;
}

fn confine(
    gpa: Allocator,
    io: Io,
    options: *const cli.Merge,
    diagnostic: *Diagnostic,
) ?ExitCode {
    const parts = options.parts(gpa) catch return console.outOfMemory(io);
    defer gpa.free(parts);
    var confinement: Confinement = .init(io, options.sandbox);
    for (parts) |path| confinement.addFile(path);
    confinement.addOutput(options.output);
    return confinement.enter(diagnostic);
}

const Job = struct {
    gpa: Allocator,
    io: Io,
    options: *const cli.Merge,

    fn run(job: *const Job, diagnostic: *Diagnostic) raylane.merge.Error!void {
        const options = job.options;
        var target = try job.openTarget(diagnostic);
        defer target.abandon();
        const parts = try options.parts(job.gpa);
        defer job.gpa.free(parts);
        var pool: raylane.parallel.Pool =
            .init(options.thread_count orelse raylane.session.processorCount());
        defer pool.deinit();
        var merged = try raylane.merge.run(job.gpa, job.io, parts, .{
            .version = cli.version,
            .pool = &pool,
            .output = target.replaces,
        }, diagnostic);
        defer merged.deinit();
        try merged.write(options.format, &pool, &target, diagnostic);
    }

    fn openTarget(job: *const Job, diagnostic: *Diagnostic) raylane.output.TargetError!Target {
        if (job.options.toStdout()) return .openStdout(job.io);
        return .openFile(job.io, &signals.temporary_files, job.options.output, diagnostic);
    }
};
