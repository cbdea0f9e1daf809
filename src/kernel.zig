//! A kernel: the tracer of one variant, compiled into an object of its own.
//!
//! In: the build options, which name the variant and whether it counts tests. Out: one symbol, of
//! what one thread does for a picture. Nothing in it is mutable but what it is handed, and no thread is
//! started: the program that it is linked to does that, and panics for it.

const std = @import("std");
const config = @import("config");
const trace = @import("trace.zig");
const variant = @import("variant.zig");

/// Of this kernel; `trace/link.zig` tells kernels from programs by it.
pub const kernel_variant = variant.default;

const is_counting = config.counting.len > 0;
const Kernel = trace.kernel.Kernel(kernel_variant, is_counting);

fn work(render: *trace.Render, thread_index: usize) callconv(.c) void {
    trace.work(Kernel, render, thread_index);
}

comptime {
    @export(&work, .{ .name = trace.link.workSymbol(trace.Render, kernel_variant, is_counting) });
}

/// The program's: what prints a trace of the stack is large and has state.
pub const panic = std.debug.FullPanic(struct {
    fn panic(message: []const u8, address: ?usize) noreturn {
        trace.link.rl_kernel_panic(message.ptr, message.len, address orelse @returnAddress());
    }
}.panic);
