//! The program as code for one level of processors, within a program that holds several.
//!
//! In: what the system hands to a program, by way of `release.zig`. Out: an exit code. All of
//! Raylane is in it, main too: trees, textures and filters gain from newer instructions as tracing
//! does.

const std = @import("std");
const main = @import("main.zig");
const raylane = @import("raylane");
const link = raylane.trace.link;

comptime {
    @export(&run, .{ .name = link.programOf(raylane.variant.level) });
}

fn run(init: *const std.process.Init) callconv(.c) u8 {
    return main.main(init.*);
}

/// Faults are not caught, so that threads need no stacks for it, one by each level's copy of std.
pub const std_options: std.Options = .{ .signal_stack_size = null };
