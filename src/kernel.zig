//! A kernel: the tracer of one variant, compiled into an object of its own.
//!
//! In: the build options, which name the variant, and whether it counts tests and makes AOVs or
//! holds the integrators besides Whitted's. Out: a symbol for each integrator, behind pointers.
//! Nothing in it is mutable but what it is handed, and no thread is started: the program that it is
//! linked to does that, and panics for it.

const std = @import("std");
const config = @import("config");
const trace = @import("trace.zig");
const variant = @import("variant.zig");

const is_counting = config.counting.len > 0;
const Kernel = trace.kernel.Kernel(variant.default, is_counting);

comptime {
    if (variant.lit.len > 0) {
        show(trace.Lights(Kernel), "lights");
        show(trace.PathTracer(Kernel), "path");
    } else {
        show(trace.Whitted(Kernel), if (is_counting) "counting" else "whitted");
        if (is_counting) show(trace.AovIntegrator(Kernel), "aov");
        if (config.shows_searches and !is_counting) {
            const Searches = trace.searches.Searches(Kernel);
            const name = trace.link.symbolOf(Searches, variant.default, "searches");
            @export(&Searches.of, .{ .name = name });
        }
    }
}

fn show(comptime Integrator: type, comptime what: []const u8) void {
    const face = struct {
        const integrator: trace.Integrator = .of(Integrator);
    };
    const name = trace.link.symbolOf(trace.Integrator, variant.default, what);
    @export(&face.integrator, .{ .name = name });
}

/// The program's: what prints a trace of the stack is large and has state.
pub const panic = std.debug.FullPanic(struct {
    fn panic(message: []const u8, address: ?usize) noreturn {
        trace.link.kernelPanic(message.ptr, message.len, address orelse @returnAddress());
    }
}.panic);
