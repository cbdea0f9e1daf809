//! A program that runs on every processor of an architecture, and as fast as one that is built for
//! it: chooses, at start, among programs that are each compiled for a level.
//!
//! In: arguments, environment. Out: what `level.zig` makes of them; or, where nothing here runs on
//! this processor, one line. RAYLANE_CPU=LEVEL chooses a lower level, to compare and
//! to test. The libraries in C, the scalar reference and this file are there once, for the lowest;
//! copying memory is what they, too, have of the level.

const std = @import("std");
const config = @import("config");
const raylane = @import("raylane");
const link = raylane.trace.link;
const Program = link.Program;
const memory = raylane.memory_functions;
const Level = raylane.processor.Level;
/// One that this program holds.
const Entry = struct { level: Level, program: *const Program, memory: *const memory.Functions };

/// Those of the chosen level, once it is chosen.
var memory_functions: *const memory.Functions = &memory.functions;

comptime {
    @export(&move, .{ .name = "memcpy" });
    @export(&move, .{ .name = "memmove" });
    @export(&set, .{ .name = "memset" });
}

fn move(to: [*]u8, from: [*]const u8, count: usize) callconv(.c) [*]u8 {
    return @call(.always_tail, memory_functions.move, .{ to, from, count });
}

fn set(to: [*]u8, byte: c_int, count: usize) callconv(.c) [*]u8 {
    return @call(.always_tail, memory_functions.set, .{ to, byte, count });
}

/// The lowest first.
const entries: [config.levels.len]Entry = list: {
    var list: [config.levels.len]Entry = undefined;
    for (&list, config.levels) |*entry, name| entry.* = .{
        .level = std.meta.stringToEnum(Level, name).?,
        .program = @extern(*const Program, .{ .name = link.programOf(name) }),
        .memory = @extern(*const memory.Functions, .{ .name = memory.nameOf(name) }),
    };
    break :list list;
};

pub fn main(init: std.process.Init.Minimal) u8 {
    const entry = chosen(init.environ.getPosix("RAYLANE_CPU")) catch |err| return switch (err) {
        error.NoLevel => 1,
        error.WrongLevel => 2,
    };
    memory_functions = entry.memory;
    const arguments = init.args.vector;
    const variables = init.environ.block.slice;
    return entry.program(arguments.len, arguments.ptr, variables.len, variables.ptr);
}

/// The one for the highest level, or for the level of this name; says why there is none.
fn chosen(wanted: ?[]const u8) error{ NoLevel, WrongLevel }!*const Entry {
    const highest = raylane.processor.highestLevel() orelse {
        say("this processor lacks NEON, and Raylane needs it", .{});
        return error.NoLevel;
    };
    if (wanted) |name| {
        const entry = entryOf(name) orelse {
            say("RAYLANE_CPU is none of {s}", .{comptime names()});
            return error.WrongLevel;
        };
        if (entry.level.isWithin(highest)) return entry;
        say("RAYLANE_CPU is {t}, but this processor is {t}", .{ entry.level, highest });
        return error.WrongLevel;
    }
    var best = &entries[0];
    for (&entries) |*entry| if (entry.level.isWithin(highest)) {
        best = entry;
    };
    return best;
}

fn entryOf(name: []const u8) ?*const Entry {
    for (&entries) |*entry| if (std.mem.eql(u8, @tagName(entry.level), name)) return entry;
    return null;
}

fn names() []const u8 {
    comptime {
        var text: []const u8 = config.levels[0];
        for (config.levels[1..]) |name| text = text ++ ", " ++ name;
        return text;
    }
}

fn say(comptime format: []const u8, arguments: anytype) void {
    var buffer: [256]u8 = undefined;
    const line = std.fmt.bufPrint(&buffer, "raylane: " ++ format ++ "\n", arguments) catch
        unreachable; // Names of levels are short.
    // Nobody is left to tell when stderr is gone.
    _ = std.c.write(2, line.ptr, line.len);
}
