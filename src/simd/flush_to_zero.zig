//! The floating-point control register of the calling thread: MXCSR, FPCR or FPSCR.
//!
//! In: nothing. Out: the register as it was, to be put back. Every thread that computes a pixel
//! sets flush-to-zero, because ARMv7's NEON knows no other mode; then denormal operands and
//! results count as zeros of their sign on all targets.
//!
//! One corner differs: a result just below the least normal float that would round up to it. x86
//! rounds first and keeps it, ARM flushes first. It takes a product or quotient within half a unit
//! in the last place of 2^-126, and no picture of ordinary scale holds one.

const hardware = @import("hardware.zig");

/// The control register of a thread.
pub const FloatControl = struct {
    bits: Register,

    const Register = switch (hardware.arch) {
        .x86, .arm => u32,
        .aarch64 => u64,
    };

    /// The bits that mean: results flush (FTZ, FZ) and, on x86 apart, operands too (DAZ).
    const flush: Register = switch (hardware.arch) {
        .x86 => 1 << 15 | 1 << 6,
        .aarch64, .arm => 1 << 24,
    };

    /// Whether denormals count as zeros in this state.
    pub fn flushesToZero(control: FloatControl) bool {
        return control.bits & flush == flush;
    }
};

/// The state of the calling thread.
pub fn floatControl() FloatControl {
    switch (hardware.arch) {
        .x86 => {
            var bits: u32 = 0;
            // By address in a named register: LLVM loses an operand in memory ("m"), and Zig's own
            // assembler knows no other spelling of an address.
            asm volatile ("stmxcsr (%%rax)"
                :
                : [address] "{rax}" (&bits),
                : .{ .memory = true });
            return .{ .bits = bits };
        },
        .aarch64 => return .{ .bits = asm volatile ("mrs %[bits], fpcr"
            : [bits] "=r" (-> u64),
            :
            : .{ .memory = true }) },
        .arm => return .{ .bits = asm volatile ("vmrs %[bits], fpscr"
            : [bits] "=r" (-> u32),
            :
            : .{ .memory = true }) },
    }
}

/// Puts the calling thread into a state that `floatControl` or `setFlushToZero` returned.
///
/// The optimizer may move arithmetic of the same function across this call: set the state in a
/// thread's entry function, and compute in functions that are not inlined into it.
pub fn setFloatControl(control: FloatControl) void {
    switch (hardware.arch) {
        .x86 => asm volatile ("ldmxcsr (%%rax)"
            :
            : [address] "{rax}" (&control.bits),
            : .{ .memory = true }),
        .aarch64 => asm volatile ("msr fpcr, %[bits]"
            :
            : [bits] "r" (control.bits),
            : .{ .memory = true }),
        .arm => asm volatile ("vmsr fpscr, %[bits]"
            :
            : [bits] "r" (control.bits),
            : .{ .memory = true }),
    }
}

/// From here on denormals count as zeros in the calling thread. Returns the state before, for
/// `setFloatControl`.
pub fn setFlushToZero() FloatControl {
    const before = floatControl();
    setFloatControl(.{ .bits = before.bits | FloatControl.flush });
    return before;
}

test "flush-to-zero is set and put back" {
    const testing = @import("std").testing;
    const before = floatControl();
    const returned = setFlushToZero();
    const set = floatControl();
    setFloatControl(returned);
    try testing.expectEqual(before, returned);
    try testing.expect(set.flushesToZero());
    try testing.expectEqual(before.bits | FloatControl.flush, set.bits);
    try testing.expectEqual(before, floatControl());
}
