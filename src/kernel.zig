//! A kernel: the tracer of one variant, compiled into an object of its own.
//!
//! In: the build options, which name the variant and whether it counts tests. Out: one symbol, the
//! integrator behind pointers. Nothing in it is mutable but what it is handed, and no thread is
//! started: the program that it is linked to does that, and panics for it.

const std = @import("std");
const config = @import("config");
const trace = @import("trace.zig");
const variant = @import("variant.zig");

const is_counting = config.counting.len > 0;
const Kernel = trace.kernel.Kernel(variant.default, is_counting);
const integrator: trace.Integrator = .of(trace.Whitted(Kernel));

comptime {
    const symbol = trace.link.symbolOf(trace.Integrator, variant.default, is_counting);
    @export(&integrator, .{ .name = symbol });
    if (config.shows_searches and !is_counting) {
        const Searches = trace.searches.Searches(Kernel);
        const name = trace.link.symbolOf(Searches, variant.default, false);
        @export(&Searches.of, .{ .name = name });
    }
}

/// The program's: what prints a trace of the stack is large and has state.
pub const panic = std.debug.FullPanic(struct {
    fn panic(message: []const u8, address: ?usize) noreturn {
        trace.link.rl_kernel_panic(message.ptr, message.len, address orelse @returnAddress());
    }
}.panic);
