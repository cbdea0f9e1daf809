//! `raylane info`: what is in a scene file.

const std = @import("std");
const console = @import("console.zig");
const raylane = @import("raylane");
const Account = raylane.memory_account.Account;
const Allocator = std.mem.Allocator;
const Confinement = @import("confine.zig").Confinement;
const Diagnostic = raylane.diagnostic.Diagnostic;
const ExitCode = @import("exit_code.zig").ExitCode;
const Io = std.Io;
const Message = raylane.diagnostic.Message;
const Pool = raylane.parallel.Pool;
const Session = raylane.session.Session;
const TimeLimit = @import("time_limit.zig").TimeLimit;
const cli = raylane.cli;

const Error = Session.Error || Io.Writer.Error;

/// Says what is in a scene file, or why it cannot be read.
pub fn run(gpa: Allocator, io: Io, options: *const cli.Info, diagnostic: *Diagnostic) ExitCode {
    var account: Account = .initFor(gpa, io, options.memory_max);
    var confinement: Confinement = .init(io, options.sandbox);
    confinement.addScene(options.scene, options.load.allow_outside);
    if (confinement.enter(diagnostic)) |code| return code;
    const scene = options.scene;
    var answer: Io.Writer.Allocating = .init(gpa);
    defer answer.deinit();
    var text: Io.Writer.Allocating = .init(account.allocator());
    defer text.deinit();
    // Reading has one thread; the limit ends it by the account.
    var pool: Pool = .init(1);
    defer pool.deinit();
    var limit: TimeLimit = .{
        .io = io,
        .seconds = options.time_max_s,
        .title = raylane.parse.title(scene),
    };
    if (options.json and options.time_max_s != null) {
        var message: Message = .{};
        const problem = limit.problem(&message);
        raylane.info.writeFailure(cli.version, scene, &problem, &.{}, &answer.writer) catch
            return console.outOfMemory(io);
        limit.answer.text = answer.written();
    }
    const outcome = limit.finish(
        if (limit.start(&account, &pool, diagnostic))
            describe(&account, io, options, diagnostic, &text.writer)
        else |err|
            err,
        diagnostic,
    );
    if (!options.quiet) {
        for (diagnostic.warnings[0..diagnostic.warning_count]) |*warning| {
            console.sayOf(io, scene, "warning: {s}", .{warning.text()});
        }
        console.sayDropped(io, scene, diagnostic);
    }
    outcome catch |err| {
        if (err == error.WriteFailed) return console.outOfMemory(io);
        const place = console.placeOf(diagnostic, scene);
        const code = console.fail(&account, io, place, @errorCast(err), diagnostic);
        if (!options.json) return code;
        text.clearRetainingCapacity();
        var warnings: [raylane.diagnostic.warning_count_max][]const u8 = undefined;
        raylane.info.writeFailure(
            cli.version,
            scene,
            &.of(diagnostic, scene, @backingInt(code)),
            diagnostic.warningTexts(&warnings),
            &text.writer,
        ) catch return console.outOfMemory(io);
        _ = console.print(io, text.written());
        return code;
    };
    return console.print(io, text.written());
}

fn describe(
    account: *Account,
    io: Io,
    options: *const cli.Info,
    diagnostic: *Diagnostic,
    writer: *Io.Writer,
) Error!void {
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
