//! Which instructions this processor has, as far as released programs hold code by them.
//!
//! In: CPUID and XCR0 on x86, the kernel's hardware capabilities on ARMv7. Out: a level. On x86
//! these are the microarchitecture levels of the psABI ("System V Application Binary Interface,
//! AMD64 Architecture Processor Supplement", 3.1.1); one whose registers the system does not save
//! counts as absent.

const std = @import("std");
const builtin = @import("builtin");

/// What code is compiled for. Of one architecture, each level has all that those before it have.
pub const Level = enum {
    @"x86-64",
    @"x86-64-v2",
    @"x86-64-v3",
    @"x86-64-v4",
    @"armv7-neon",
    /// Multiply-add and division, as the Cortex-A7 and A15 have.
    @"armv7-neon-vfpv4",

    /// Whether what is compiled for `level` runs where `highest` is the highest.
    pub fn isWithin(level: Level, highest: Level) bool {
        return @backingInt(level) <= @backingInt(highest);
    }
};

/// The highest level of the processor that this runs on; null where there is none.
pub fn highestLevel() ?Level {
    return switch (builtin.cpu.arch) {
        .x86_64 => levelOfX86(.read()),
        .arm => levelOfArm(std.c.getauxval(std.elf.AT.HWCAP)),
        else => null,
    };
}

/// What an x86 processor says of itself, and which registers the system saves.
const X86 = struct {
    leaf_1_ecx: u32 = 0,
    leaf_7_ebx: u32 = 0,
    leaf_80000001_ecx: u32 = 0,
    xcr0: u32 = 0,

    fn read() X86 {
        var x86: X86 = .{ .leaf_1_ecx = cpuid(1).ecx };
        if (cpuid(0).eax >= 7) x86.leaf_7_ebx = cpuid(7).ebx;
        if (cpuid(0x80000000).eax >= 0x80000001) {
            x86.leaf_80000001_ecx = cpuid(0x80000001).ecx;
        }
        // XGETBV is an illegal instruction where the system has not turned it on.
        if (has(x86.leaf_1_ecx, &.{osxsave})) x86.xcr0 = asm volatile (
            \\ xor %%ecx, %%ecx
            \\ xgetbv
            : [_] "={eax}" (-> u32),
            :
            : .{ .edx = true, .ecx = true });
        return x86;
    }
};

/// Bit of leaf 1: XGETBV may be used.
const osxsave = 27;

/// The bits by which a level goes beyond the one before it.
const X86Level = struct {
    level: Level,
    leaf_1_ecx: []const u5 = &.{},
    leaf_7_ebx: []const u5 = &.{},
    leaf_80000001_ecx: []const u5 = &.{},
    xcr0: []const u5 = &.{},
};

const x86_levels = [_]X86Level{
    .{
        .level = .@"x86-64-v2",
        // SSE3, SSSE3, CMPXCHG16B, SSE4.1, SSE4.2, POPCNT; LAHF.
        .leaf_1_ecx = &.{ 0, 9, 13, 19, 20, 23 },
        .leaf_80000001_ecx = &.{0},
    },
    .{
        .level = .@"x86-64-v3",
        // FMA, MOVBE, OSXSAVE, AVX, F16C; BMI1, AVX2, BMI2; LZCNT; XMM and YMM.
        .leaf_1_ecx = &.{ 12, 22, osxsave, 28, 29 },
        .leaf_7_ebx = &.{ 3, 5, 8 },
        .leaf_80000001_ecx = &.{5},
        .xcr0 = &.{ 1, 2 },
    },
    .{
        .level = .@"x86-64-v4",
        // AVX-512 F, DQ, CD, BW, VL; masks, upper halves of ZMM0 to 15, ZMM16 to 31.
        .leaf_7_ebx = &.{ 16, 17, 28, 30, 31 },
        .xcr0 = &.{ 5, 6, 7 },
    },
};

fn levelOfX86(x86: X86) Level {
    var level: Level = .@"x86-64";
    for (&x86_levels) |*next| {
        if (!has(x86.leaf_1_ecx, next.leaf_1_ecx) or
            !has(x86.leaf_7_ebx, next.leaf_7_ebx) or
            !has(x86.leaf_80000001_ecx, next.leaf_80000001_ecx) or
            !has(x86.xcr0, next.xcr0)) break;
        level = next.level;
    }
    return level;
}

fn has(word: u32, bits: []const u5) bool {
    for (bits) |bit| if (word >> bit & 1 == 0) return false;
    return true;
}

/// Of Linux' arch/arm/include/uapi/asm/hwcap.h: NEON; VFPv4, division in both instruction sets.
fn levelOfArm(capabilities: usize) ?Level {
    const word: u32 = @truncate(capabilities);
    if (!has(word, &.{12})) return null;
    return if (has(word, &.{ 16, 17, 18 })) .@"armv7-neon-vfpv4" else .@"armv7-neon";
}

const Leaf = struct { eax: u32, ebx: u32, ecx: u32 };

fn cpuid(leaf: u32) Leaf {
    var eax: u32 = undefined;
    var ebx: u32 = undefined;
    var ecx: u32 = undefined;
    asm volatile ("cpuid"
        : [_] "={eax}" (eax),
          [_] "={ebx}" (ebx),
          [_] "={ecx}" (ecx),
        : [_] "{eax}" (leaf),
          [_] "{ecx}" (@as(u32, 0)),
        : .{ .edx = true });
    return .{ .eax = eax, .ebx = ebx, .ecx = ecx };
}

const testing = std.testing;

test "a level needs all of its bits, and the system to save its registers" {
    // Of a Nehalem, a Haswell and a Skylake server.
    var x86: X86 = .{ .leaf_1_ecx = 0x0098e3fd, .leaf_80000001_ecx = 1 };
    try testing.expectEqual(.@"x86-64-v2", levelOfX86(x86));
    x86.leaf_1_ecx &= ~@as(u32, 1 << 19);
    try testing.expectEqual(.@"x86-64", levelOfX86(x86));
    x86 = .{
        .leaf_1_ecx = 0x7ffafbff,
        .leaf_7_ebx = 0x000027ab,
        .leaf_80000001_ecx = 0x21,
        .xcr0 = 7,
    };
    try testing.expectEqual(.@"x86-64-v3", levelOfX86(x86));
    x86.xcr0 = 3;
    try testing.expectEqual(.@"x86-64-v2", levelOfX86(x86));
    x86.leaf_7_ebx = 0xd19f27ab;
    x86.xcr0 = 7;
    try testing.expectEqual(.@"x86-64-v3", levelOfX86(x86));
    x86.xcr0 = 0xe7;
    try testing.expectEqual(.@"x86-64-v4", levelOfX86(x86));
}

test "ARMv7 needs NEON" {
    // Of a Tegra 2, a Cortex-A9 and a Cortex-A15.
    try testing.expectEqual(null, levelOfArm(0x0000a0d7));
    try testing.expectEqual(.@"armv7-neon", levelOfArm(0x0000b8d7));
    try testing.expectEqual(.@"armv7-neon-vfpv4", levelOfArm(0x003fb8d7));
}

test "this processor runs what these tests are compiled for" {
    const level = highestLevel() orelse return error.SkipZigTest;
    try testing.expect(level.isWithin(level));
    if (comptime builtin.cpu.arch == .x86_64) {
        const features = builtin.cpu.features;
        if (std.Target.x86.featureSetHas(features, .avx512vl)) {
            try testing.expectEqual(.@"x86-64-v4", level);
        } else if (std.Target.x86.featureSetHas(features, .avx2)) {
            try testing.expect(Level.@"x86-64-v3".isWithin(level));
        }
    }
}
