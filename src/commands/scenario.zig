//! `raylane --scenario`: the pictures that JSON describes, one after another.

const std = @import("std");
const confine = @import("confine.zig");
const console = @import("console.zig");
const raylane = @import("raylane");
const render = @import("render.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = raylane.diagnostic.Diagnostic;
const ExitCode = @import("exit_code.zig").ExitCode;
const Io = std.Io;
const cli = raylane.cli;
const printable = raylane.diagnostic.printable;
const standard_input = raylane.settings.standard_input;

/// What stands for a scenario's name among the arguments.
const name_place = "{scenario}";

/// Reads the scenarios, then renders each; all are read before the first is rendered. What the
/// worst of them ends with is the exit code.
pub fn run(
    init: std.process.Init,
    call: *const cli.ScenarioCall,
    diagnostic: *Diagnostic,
) ExitCode {
    const io = init.io;
    const is_json = std.mem.startsWith(u8, call.scenario, "{");
    const title = if (is_json) "--scenario" else call.scenario;
    const arena = init.arena.allocator();
    const pictures = read(arena, io, call, is_json, diagnostic) catch |err| {
        const code: ExitCode = if (err == error.UsageInvalid) .usage else .failed;
        if (err == error.OutOfMemory) diagnostic.message.set("out of memory", .{});
        console.say(io, "raylane: {f}: {s}\n", .{
            printable(title), diagnostic.message.text(),
        });
        if (cli.wantsJson(call.arguments)) console.printFailure(init.gpa, io, &.{
            .version = cli.version,
            .problem = .of(diagnostic, title, @backingInt(code)),
        }, false);
        return code;
    };
    if (confine.aroundPictures(init.gpa, io, pictures, diagnostic)) |code| return code;
    var worst: ExitCode = .ok;
    for (pictures) |*options| {
        options.sandbox = .off; // It is around all of them.
        var own: Diagnostic = .{};
        const code = render.run(init.gpa, io, options, &own);
        if (@backingInt(code) > @backingInt(worst)) worst = code;
        // A signal ends all.
        if (@backingInt(code) >= 128) break;
    }
    return worst;
}

const Error = error{ OutOfMemory, UsageInvalid, InputOutput };

fn read(
    arena: Allocator,
    io: Io,
    call: *const cli.ScenarioCall,
    is_json: bool,
    diagnostic: *Diagnostic,
) Error![]cli.Options {
    const source: cli.ScenarioSource = if (is_json)
        .{ .text = call.scenario }
    else
        .{ .text = try readFile(arena, io, call.scenario, diagnostic), .path = call.scenario };
    const scenarios = try cli.readScenarios(arena, io, source, diagnostic);
    const pictures = try arena.alloc(cli.Options, scenarios.len);
    const names = raylane.variant.names;
    for (pictures, scenarios) |*options, *scenario| {
        const arguments = try named(arena, call.arguments, scenario.name);
        const parts = .{ scenario.arguments, arguments };
        options.* = cli.parseParts(parts, names, diagnostic) catch |err| {
            if (scenarios.len == 1) return err;
            const message = diagnostic.message;
            const quoted = raylane.diagnostic.quote(scenario.name);
            return diagnostic.fail(err, "scenario {f}: {s}", .{ quoted, message.text() });
        };
    }
    try checkOutputs(arena, pictures, diagnostic);
    return pictures;
}

/// The arguments for the scenario of a name.
fn named(
    arena: Allocator,
    arguments: []const [:0]const u8,
    name: []const u8,
) error{OutOfMemory}![]const [:0]const u8 {
    const all = try arena.dupe([:0]const u8, arguments);
    for (all) |*argument| {
        if (std.mem.find(u8, argument.*, name_place) == null) continue;
        const text = try std.mem.replaceOwned(u8, arena, argument.*, name_place, name);
        argument.* = try arena.dupeSentinel(u8, text, 0);
    }
    return all;
}

/// Refuses pictures that would replace each other.
fn checkOutputs(
    arena: Allocator,
    pictures: []const cli.Options,
    diagnostic: *Diagnostic,
) error{ OutOfMemory, UsageInvalid }!void {
    var seen: std.array_hash_map.String(void) = .empty;
    for (pictures) |*options| {
        const name = try cli.outputName(arena, options);
        if ((try seen.getOrPut(arena, name)).found_existing) return diagnostic.fail(
            error.UsageInvalid,
            "two scenarios write {f}: {s} in -o stands for their names",
            .{ raylane.diagnostic.quote(name), name_place },
        );
    }
}

fn readFile(
    arena: Allocator,
    io: Io,
    path: []const u8,
    diagnostic: *Diagnostic,
) error{ OutOfMemory, InputOutput }![]const u8 {
    const limit: Io.Limit = .limited(cli.scenario_bytes_max);
    const text = if (std.mem.eql(u8, path, standard_input)) stdin: {
        var buffer: [4096]u8 = undefined;
        var reader = Io.File.stdin().readerStreaming(io, &buffer);
        break :stdin reader.interface.allocRemaining(arena, limit);
    } else Io.Dir.cwd().readFileAlloc(io, path, arena, limit);
    return text catch |err| switch (err) {
        error.OutOfMemory => error.OutOfMemory,
        error.StreamTooLong => diagnostic.fail(error.InputOutput, "it is larger than {Bi}", .{
            cli.scenario_bytes_max,
        }),
        else => diagnostic.fail(error.InputOutput, "{s}", .{
            raylane.diagnostic.systemReason(err),
        }),
    };
}
