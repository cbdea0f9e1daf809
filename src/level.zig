//! The program as code for one level of processors, within a program that holds several.
//!
//! In: the arguments and the environment, by way of `release.zig`. Out: an exit code. All of
//! Raylane is in it, main too: trees, textures and filters gain from newer instructions as tracing
//! does. Nothing of std crosses to another level, for each has its own numbers of errors; so what
//! std does before main is done here.

const std = @import("std");
const main = @import("main.zig");
const raylane = @import("raylane");
const link = raylane.trace.link;

comptime {
    const program: link.Program = run;
    @export(&program, .{ .name = link.programOf(raylane.variant.level) });
}

fn run(
    argument_count: usize,
    arguments: [*]const [*:0]const u8,
    variable_count: usize,
    variables: [*:null]const ?[*:0]const u8,
) callconv(.c) u8 {
    const minimal: std.process.Init.Minimal = .{
        .args = .{ .vector = arguments[0..argument_count] },
        .environ = .{ .block = .{ .slice = variables[0..variable_count :null] } },
    };
    // For what is printed without an `Io`: whether colours are wanted.
    const debug = std.Options.debug_threaded_io.?;
    debug.environ = .{ .process_environ = minimal.environ };
    debug.environ_initialized = variable_count == 0;

    const gpa = std.heap.c_allocator;
    var arena: std.heap.ArenaAllocator = .init(std.heap.page_allocator);
    defer arena.deinit();
    var threaded: std.Io.Threaded = .init(gpa, .{
        .argv0 = .init(minimal.args),
        .environ = minimal.environ,
    });
    defer threaded.deinit();
    var environ_map = std.process.Environ.createMap(minimal.environ, gpa) catch
        std.process.fatal("out of memory", .{});
    defer environ_map.deinit();
    return main.main(.{
        .minimal = minimal,
        .arena = &arena,
        .gpa = gpa,
        .io = threaded.io(),
        .environ_map = &environ_map,
        .preopens = .empty,
    });
}

/// Faults are not caught, so that threads need no stacks for it, one by each level's copy of std.
pub const std_options: std.Options = .{ .signal_stack_size = null };
