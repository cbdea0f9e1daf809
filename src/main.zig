//! The program: the command line, the command that it asks for, an exit code that says how it went.

const std = @import("std");
const commands = @import("commands.zig");
const console = commands.console;
const raylane = @import("raylane");
const cli = raylane.cli;
const signals = @import("signals.zig");
const Diagnostic = raylane.diagnostic.Diagnostic;
const ExitCode = commands.ExitCode;

pub fn main(init: std.process.Init) u8 {
    holdStandardFiles();
    signals.catchAll();
    _ = raylane.simd.setFlushToZero();
    var program: Program = .{ .init = init };
    raylane.call_stack.call(raylane.parallel.stack_bytes, &program, Program.run);
    return @backingInt(program.exit_code);
}

/// What `main` does, on a stack that does not depend on who starts the program.
const Program = struct {
    init: std.process.Init,
    exit_code: ExitCode = .ok,

    fn run(program: *Program) void {
        program.exit_code = runCommand(program.init);
    }
};

fn runCommand(init: std.process.Init) ExitCode {
    const io = init.io;
    var diagnostic: Diagnostic = .{};
    const arguments = init.minimal.args.toSlice(init.arena.allocator()) catch
        return console.outOfMemory(io);
    const own_arguments = arguments[@min(1, arguments.len)..];
    const names = raylane.variant.names;
    const command = cli.parse(own_arguments, names, &diagnostic) catch {
        console.say(io, "raylane: {s}\n", .{diagnostic.message.text()});
        if (cli.wantsJson(own_arguments)) console.printFailure(init.gpa, io, &.{
            .version = cli.version,
            .problem = .of(&diagnostic, "", @backingInt(ExitCode.usage)),
        }, false);
        return .usage;
    };
    switch (command) {
        .help => return console.print(io, cli.help),
        .beginning => {
            console.say(io, "{s}", .{cli.beginning});
            return .usage;
        },
        .scenario => |*call| return commands.scenario.run(init, call, &diagnostic),
        .serve => |*call| return commands.serve.run(init.gpa, io, call),
        .serve_help => return console.print(io, cli.serve_help),
        .bench_help => return console.print(io, cli.bench_help),
        .compare_help => return console.print(io, cli.compare_help),
        .info_help => return console.print(io, cli.info_help),
        .merge_help => return console.print(io, cli.merge_help),
        .completion => |shell| return console.printBy(init.gpa, io, cli.writeCompletion, .{
            shell, cli.pages,
        }),
        .completion_help => return console.print(io, cli.completion_help),
        .man => return console.printBy(init.gpa, io, cli.writeMan, .{}),
        .man_help => return console.print(io, cli.man_help),
        .version => return console.print(io, "raylane " ++ cli.version ++
            (if (raylane.variant.level.len == 0) "" else " for " ++ raylane.variant.level) ++ "\n"),
        .licenses => return console.print(io, raylane.licenses),
        .list_variants => return console.print(io, comptime list: {
            var list: []const u8 = "";
            for (names) |name| list = list ++ name ++ "\n";
            break :list list;
        }),
        .render => |*options| return commands.render.run(init.gpa, io, options, &diagnostic),
        .bench => |*options| return commands.bench.run(init, options, &diagnostic),
        .compare => |*options| return commands.compare.run(init.gpa, io, options, &diagnostic),
        .info => |*options| return commands.info.run(init.gpa, io, options, &diagnostic),
        .merge => |*options| return commands.merge.run(init.gpa, io, options, &diagnostic),
    }
}

/// Puts something that cannot be written in the place of standard files that are closed, lest the
/// next file that is opened takes a message or a report for its contents.
fn holdStandardFiles() void {
    for (0..3) |file| {
        if (std.c.fcntl(@intCast(file), std.c.F.GETFD) >= 0) continue;
        _ = std.c.open("/dev/null", .{ .ACCMODE = .RDONLY });
    }
}
