//! What a tracer is made of: the arithmetic backend, the way rays are bundled, and the SIMD width.
//!
//! In: the names of the variants that the build chose by `-Dbackend= -Dtraversal= -Dlanes=
//! -Dvariants=`. Out: the comptime list of variants that this binary holds, the default one first.
//! Everything from `simd` to `trace` is generic over a comptime `Variant` and compiled by variant
//! into a kernel (`kernel.zig`); the name is looked up once, at start.

const std = @import("std");
const config = @import("config");
const assert = std.debug.assert;

/// How four floats are added: loops over arrays, Zig's `@Vector`, or C intrinsics.
pub const Backend = enum { scalar, vector, intrinsics };

/// How rays travel: single, as the thesis's 2x2 packets, or as beams, then interval packets, then
/// streams.
pub const Traversal = enum { single, packet2x2, beam };

/// One way to build the tracer; all of them give the same picture, bit for bit.
pub const Variant = struct {
    backend: Backend,
    traversal: Traversal,
    /// Lanes of a SIMD value, 4, 8 or 16; also the width of the BVH's nodes and triangle packs.
    lanes: u8,

    /// Whether the combination exists: the C intrinsics and the thesis's 2x2 packets are 4 wide.
    pub fn isSupported(variant: Variant) bool {
        if (variant.lanes != 4 and variant.lanes != 8 and variant.lanes != 16) return false;
        if (variant.backend == .intrinsics and variant.lanes != 4) return false;
        if (variant.traversal == .packet2x2 and variant.lanes != 4) return false;
        return true;
    }

    /// `backend-traversal-lanes`, as `--variant` and the reports spell it.
    pub fn name(comptime variant: Variant) []const u8 {
        return std.fmt.comptimePrint("{t}-{t}-{d}", .{
            variant.backend, variant.traversal, variant.lanes,
        });
    }
};

/// Which level of processors this is compiled for, in a program that holds several; else empty.
pub const level: []const u8 = config.level;

/// Every variant in this binary, the default first.
pub const compiled: []const Variant = listOf(config.variants);

/// The variant of the build options.
pub const default: Variant = compiled[0];

/// Those of them whose kernels hold the integrators besides Whitted's.
pub const lit: []const Variant = listOf(config.lit);

/// Index into `lit` of a variant of `compiled`, or null.
pub fn litIndexOf(index: usize) ?usize {
    const found = comptime found: {
        var list: [compiled.len]?usize = @splat(null);
        for (&list, compiled) |*to, variant| for (lit, 0..) |other, number| {
            if (std.meta.eql(variant, other)) to.* = number;
        };
        break :found list;
    };
    return found[index];
}

/// Whether there are no others.
pub const are_all = config.are_all;

/// The variant that counts the tests of this one: how many there are depends on the traversal and
/// the lanes alone.
pub fn countingOf(comptime variant: Variant) Variant {
    comptime {
        for (listOf(config.counting)) |other| {
            if (other.traversal == variant.traversal and other.lanes == variant.lanes) return other;
        }
        unreachable; // Asserts that it is one of `compiled`.
    }
}

fn listOf(comptime list_names: []const []const u8) []const Variant {
    comptime {
        @setEvalBranchQuota(100_000);
        var list: []const Variant = &.{};
        for (list_names) |name| {
            var parts = std.mem.tokenizeScalar(u8, name, '-');
            const variant: Variant = .{
                .backend = std.meta.stringToEnum(Backend, parts.next().?).?,
                .traversal = std.meta.stringToEnum(Traversal, parts.next().?).?,
                .lanes = std.fmt.parseInt(u8, parts.next().?, 10) catch unreachable,
            };
            if (!variant.isSupported()) @compileError("no such variant: " ++ name ++
                " (lanes are 4, 8 or 16; intrinsics and packet2x2 have 4 lanes only)");
            list = list ++ .{variant};
        }
        return list;
    }
}

/// Names of `compiled`, in the same order.
pub const names: []const []const u8 = list: {
    var list: []const []const u8 = &.{};
    for (compiled) |variant| list = list ++ .{variant.name()};
    break :list list;
};

/// Index into `compiled` of the variant with this name, or null.
pub fn indexOf(name: []const u8) ?usize {
    for (names, 0..) |candidate, index| {
        if (isNamed(candidate, name)) return index;
    }
    return null;
}

/// Whether `text` is the name of a variant, or its older name, which said `packet` for `beam`.
pub fn isNamed(name: []const u8, text: []const u8) bool {
    return isAlike(name, text, std.mem.eql);
}

/// Whether `text` is a part of the name of a variant, or of its older name.
pub fn isPartlyNamed(name: []const u8, text: []const u8) bool {
    return isAlike(name, text, struct {
        fn contains(comptime T: type, haystack: []const T, needle: []const T) bool {
            return std.mem.find(T, haystack, needle) != null;
        }
    }.contains);
}

fn isAlike(name: []const u8, text: []const u8, comptime match: anytype) bool {
    if (match(u8, name, text)) return true;
    const at = std.mem.find(u8, name, "beam") orelse return false;
    var older: [64]u8 = undefined;
    const parts = .{ name[0..at], name[at + "beam".len ..] };
    const written = std.fmt.bufPrint(&older, "{s}packet{s}", parts) catch return false;
    return match(u8, written, text);
}

test "the default comes first and every name is found once" {
    try std.testing.expect(std.meta.eql(compiled[0], default));
    for (names, 0..) |name, index| try std.testing.expectEqual(index, indexOf(name).?);
    try std.testing.expectEqual(null, indexOf("vector-single-5"));
    try std.testing.expect(isNamed("vector-beam-8", "vector-packet-8"));
    try std.testing.expect(!isNamed("vector-packet2x2-4", "vector-packet-4"));
    try std.testing.expect(isPartlyNamed("vector-beam-8", "vector-packet"));
    try std.testing.expect(!isPartlyNamed("vector-single-8", "packet"));
    try std.testing.expectEqual(null, indexOf(""));
}

test "4 lanes only where the hardware's registers say so" {
    const wide: Variant = .{ .backend = .intrinsics, .traversal = .single, .lanes = 8 };
    try std.testing.expect(!wide.isSupported());
    const odd: Variant = .{ .backend = .vector, .traversal = .single, .lanes = 5 };
    try std.testing.expect(!odd.isSupported());
    assert((Variant{ .backend = .vector, .traversal = .beam, .lanes = 16 }).isSupported());
}
