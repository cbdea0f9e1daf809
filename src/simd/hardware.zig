//! Features of the target's instruction set, as far as the SIMD library chooses code by them.
//!
//! Out: comptime constants only. Backends ask here, so that the tests of CPU features stand in
//! one place.

const builtin = @import("builtin");

const cpu = builtin.cpu;

/// The architectures that the library is written for.
pub const Arch = enum { x86, aarch64, arm };

/// The target's architecture; another one does not compile.
pub const arch: Arch = switch (cpu.arch) {
    .x86_64 => .x86,
    .aarch64 => .aarch64,
    .arm => .arm,
    else => @compileError("Raylane runs on x86-64, AArch64 and ARMv7 with NEON"),
};

/// A fused multiply-add instruction exists; without it `@mulAdd` is a library call a lane.
pub const has_fused = switch (arch) {
    .x86 => cpu.has(.x86, .fma),
    .aarch64 => true,
    .arm => cpu.has(.arm, .vfp4),
};

/// Comparisons write mask registers (k0 to k7), one bit a lane, whatever the vector's length.
pub const has_mask_registers = arch == .x86 and
    cpu.has(.x86, .avx512vl) and cpu.has(.x86, .avx512dq);

/// A blend that looks at sign bits only; without it a select is three bitwise operations.
pub const has_sign_blend = arch == .x86 and cpu.has(.x86, .sse4_1);

/// Minima and maxima of signed integers are one instruction.
pub const has_integer_extremes = arch != .x86 or cpu.has(.x86, .sse4_1);

comptime {
    if (arch == .arm and !cpu.has(.arm, .neon)) @compileError(
        "this ARM target has no NEON; choose a CPU that has, such as -Dcpu=cortex_a15",
    );
}
