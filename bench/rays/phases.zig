//! Where the time of a frame goes: phases, marked as a tile passes from one to the next.
//!
//! In: calls of `Marks.to` by one thread. Out: ticks of the processor's own clock by phase, or,
//! where instructions are counted from outside (bench/count), a system call that no kernel has,
//! whose argument is the phase. A mark costs some 10 ns or 5 instructions a tile.

const std = @import("std");
const builtin = @import("builtin");

/// What is measured by itself.
pub const Phase = enum {
    /// Outside of the workload.
    other,
    /// Primary rays' directions.
    generation,
    /// Primary rays, with exact t of the closest hit.
    primary,
    /// Barycentrics, points, normals, brightness and shadow rays of primary hits; the pixels.
    shading,
    /// Shadow rays of primary hits.
    shadow,
    /// Reflection rays, with exact t.
    bounce,
    /// Shadow rays of their hits.
    bounce_shadow,
    /// What `shading` is, for their hits.
    bounce_shading,
    /// The tree.
    build,
};

/// Phases of a frame, in the order of their first use.
pub const frame_phases = [_]Phase{
    .generation, .primary,       .shading,        .shadow,
    .bounce,     .bounce_shadow, .bounce_shading,
};

/// Tags of one run, or of one tree, are `first` + the phase, below `first` + this; what belongs to
/// none of them has the tag 0. Runs and trees can share a `first`, since they share no phase.
pub const tags_per_run = 16;

/// Number of the system call that marks a phase; bench/plugin/count.c knows it.
const mark_call = 9999;

/// Ticks by phase.
pub const Ticks = std.enums.EnumArray(Phase, u64);

/// How phases are told apart.
pub const Mode = union(enum) {
    clock,
    /// First tag of this run or tree, a multiple of `tags_per_run`.
    tags: u32,
};

/// One thread's passage through the phases.
pub const Marks = struct {
    mode: Mode,
    current: Phase = .other,
    since: u64,
    spent: Ticks = .initFill(0),

    /// Starts in `Phase.other`.
    pub fn init(mode: Mode) Marks {
        return .{ .mode = mode, .since = if (mode == .clock) ticks() else 0 };
    }

    /// What follows belongs to `phase`.
    pub fn to(marks: *Marks, phase: Phase) void {
        switch (marks.mode) {
            .tags => |first| mark(if (phase == .other) 0 else first + @backingInt(phase)),
            .clock => {
                const now = ticks();
                marks.spent.getPtr(marks.current).* += now - marks.since;
                marks.since = now;
                marks.current = phase;
            },
        }
    }
};

/// The processor's clock, in units of its own that do not change.
pub inline fn ticks() u64 {
    switch (builtin.cpu.arch) {
        .x86_64 => {
            var high: u64 = undefined;
            const low = asm volatile ("rdtsc"
                : [low] "={rax}" (-> u64),
                  [high] "={rdx}" (high),
            );
            return high << 32 | low;
        },
        .aarch64 => return asm volatile ("mrs %[count], cntvct_el0"
            : [count] "=r" (-> u64),
        ),
        else => {
            var time: std.c.timespec = undefined;
            _ = std.c.clock_gettime(.MONOTONIC, &time);
            return @as(u64, @intCast(time.sec)) * std.time.ns_per_s + @as(u64, @intCast(time.nsec));
        },
    }
}

/// Tells a watching emulator that what follows has this tag; elsewhere an error nobody looks at.
pub inline fn mark(tag: u32) void {
    switch (builtin.cpu.arch) {
        .x86_64 => _ = asm volatile ("syscall"
            : [result] "={rax}" (-> usize),
            : [number] "{rax}" (@as(usize, mark_call)),
              [tag] "{rdi}" (@as(usize, tag)),
            : .{ .rcx = true, .r11 = true, .memory = true }),
        .aarch64 => _ = asm volatile ("svc #0"
            : [result] "={x0}" (-> usize),
            : [number] "{x8}" (@as(usize, mark_call)),
              [tag] "{x0}" (@as(usize, tag)),
            : .{ .memory = true }),
        .arm => _ = asm volatile ("svc #0"
            : [result] "={r0}" (-> usize),
            : [number] "{r7}" (@as(usize, mark_call)),
              [tag] "{r0}" (@as(usize, tag)),
            : .{ .memory = true }),
        else => @compileError("no way to mark phases on this architecture"),
    }
}
