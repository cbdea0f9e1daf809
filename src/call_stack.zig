//! A call on a stack of its own, by the thread that makes the call.
//!
//! In: how large the stack shall be, a function and its context. Out: what the function does. The
//! first stack of a program is as large as whoever starts it says (`ulimit -s`), and the deepest
//! way takes more than some say. It is not a thread of its own that is given another stack: what
//! holds for the thread (its floating-point mode, what the system still lets it do) holds on both.

const std = @import("std");
const builtin = @import("builtin");

/// Calls `work(context)` on a stack of `bytes`, with a page below that ends the program rather than
/// be written; on the stack that there is where there is no memory for another. Asserts that the
/// context is a pointer.
pub fn call(
    bytes: usize,
    context: anytype,
    comptime work: fn (context: @TypeOf(context)) void,
) void {
    if (!has_switch) return work(context);
    const stack = allocate(bytes) orelse return @call(.never_inline, work, .{context});
    defer std.posix.munmap(stack);
    const Entry = struct {
        fn run(erased: *anyopaque) callconv(.c) void {
            work(@ptrCast(@alignCast(erased)));
        }
    };
    const switchAndCall: *const SwitchAndCall = @ptrCast(&switchAndCallNaked);
    switchAndCall(@ptrCast(context), Entry.run, @intFromPtr(stack.ptr) + stack.len);
}

/// The stack with its guard; null: there is no memory.
fn allocate(bytes: usize) ?[]align(std.heap.page_size_min) u8 {
    const guard_bytes = std.heap.pageSize();
    const stack = std.posix.mmap(
        null,
        guard_bytes + std.mem.alignForward(usize, bytes, guard_bytes),
        .{ .READ = true, .WRITE = true },
        .{ .TYPE = .PRIVATE, .ANONYMOUS = true },
        -1,
        0,
    ) catch return null;
    // Without the guard all else is as it should be.
    _ = std.posix.system.mprotect(stack.ptr, guard_bytes, .{});
    return stack;
}

const has_switch = switch (builtin.cpu.arch) {
    .x86_64, .aarch64, .arm => true,
    else => false,
};

const SwitchAndCall = fn (
    context: *anyopaque,
    work: *const fn (context: *anyopaque) callconv(.c) void,
    /// Where the stack ends and is empty.
    top: usize,
) callconv(.c) void;

/// A `SwitchAndCall`. The callee keeps the frame pointer, and traces of the stack go on by it.
fn switchAndCallNaked() callconv(.naked) void {
    switch (builtin.cpu.arch) {
        .x86_64 => {
            asm volatile (
                \\ pushq %%rbp
                \\ movq %%rsp,%%rbp
            );
            if (has_frame_information) asm volatile (
                \\ .cfi_def_cfa %%rbp,16
                \\ .cfi_offset %%rbp,-16
            );
            asm volatile (
                \\ movq %%rdx,%%rsp
                \\ callq *%%rsi
                \\ movq %%rbp,%%rsp
                \\ popq %%rbp
                \\ retq
            );
        },
        .aarch64 => {
            asm volatile (
                \\ stp x29,x30,[sp,#-16]!
                \\ mov x29,sp
            );
            if (has_frame_information) asm volatile (
                \\ .cfi_def_cfa x29,16
                \\ .cfi_offset x29,-16
                \\ .cfi_offset x30,-8
            );
            asm volatile (
                \\ mov sp,x2
                \\ blr x1
                \\ mov sp,x29
                \\ ldp x29,x30,[sp],#16
                \\ ret
            );
        },
        .arm => asm volatile (
            \\ push {r11,lr}
            \\ mov r11,sp
            \\ mov sp,r2
            \\ blx r1
            \\ mov sp,r11
            \\ pop {r11,pc}
        ),
        else => comptime unreachable,
    }
}

/// The compiler's own assembler does not know all of it.
const has_frame_information = builtin.zig_backend == .stage2_llvm and
    (builtin.unwind_tables != .none or !builtin.strip_debug_info);

/// Takes half a mebibyte of stack.
const Deep = struct {
    seed: u8,
    sum: u64 = 0,
    /// Within another call.
    inner: ?*Deep = null,

    fn run(deep: *Deep) void {
        var bytes: [512 << 10]u8 = undefined;
        for (&bytes, 0..) |*byte, index| byte.* = @truncate(index *% deep.seed);
        std.mem.doNotOptimizeAway(&bytes);
        if (deep.inner) |inner| call(1 << 20, inner, run);
        for (&bytes) |byte| deep.sum += byte;
    }

    /// For a thread that has less.
    fn callTwice(deep: *Deep) void {
        for (0..2) |_| call(1 << 20, deep, run);
    }
};

test call {
    if (!has_switch) return error.SkipZigTest;
    var inner: Deep = .{ .seed = 3 };
    var deep: Deep = .{ .seed = 1, .inner = &inner };
    const thread = try std.Thread.spawn(.{ .stack_size = 128 << 10 }, Deep.callTwice, .{&deep});
    thread.join();
    const sum_of_page = 255 * 128; // Of 256 bytes, all different.
    try std.testing.expectEqual(2 * 2048 * sum_of_page, deep.sum);
    try std.testing.expectEqual(2 * 2048 * sum_of_page, inner.sum);
}
