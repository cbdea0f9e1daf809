//! A program that runs on every processor of an architecture, and as fast as one that is built for
//! it: chooses, at start, among programs that are each compiled for a level.
//!
//! In: what the system hands to a program. Out: what `level.zig` makes of it; or, where nothing
//! here runs on this processor, one line. RAYLANE_CPU=LEVEL chooses a lower level, to compare and
//! to test. The libraries in C, the scalar reference and this file are there once, for the lowest.

const std = @import("std");
const config = @import("config");
const raylane = @import("raylane");
const link = raylane.trace.link;
const Level = raylane.processor.Level;
const Program = fn (init: *const std.process.Init) callconv(.c) u8;

/// One that this program holds.
const Entry = struct { level: Level, program: *const Program };

/// The lowest first.
const entries: [config.levels.len]Entry = list: {
    var list: [config.levels.len]Entry = undefined;
    for (&list, config.levels) |*entry, name| entry.* = .{
        .level = std.meta.stringToEnum(Level, name).?,
        .program = @extern(*const Program, .{ .name = link.programOf(name) }),
    };
    break :list list;
};

pub fn main(init: std.process.Init) u8 {
    const highest = raylane.processor.highestLevel() orelse {
        say(init.io, "this processor lacks NEON, and Raylane needs it", .{});
        return 1;
    };
    if (init.environ_map.get("RAYLANE_CPU")) |name| {
        const entry = entryOf(name) orelse {
            say(init.io, "RAYLANE_CPU is none of {s}", .{comptime names()});
            return 2;
        };
        if (!entry.level.isWithin(highest)) {
            say(init.io, "RAYLANE_CPU is {t}, but this processor is {t}", .{
                entry.level, highest,
            });
            return 2;
        }
        return entry.program(&init);
    }
    var chosen = &entries[0];
    for (&entries) |*entry| if (entry.level.isWithin(highest)) {
        chosen = entry;
    };
    return chosen.program(&init);
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

fn say(io: std.Io, comptime format: []const u8, arguments: anytype) void {
    var buffer: [256]u8 = undefined;
    var stderr: std.Io.File.Writer = .initStreaming(.stderr(), io, &buffer);
    // Nobody is left to tell when stderr is gone.
    stderr.interface.print("raylane: " ++ format ++ "\n", arguments) catch return;
    stderr.interface.flush() catch {};
}
