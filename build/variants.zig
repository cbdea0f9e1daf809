//! Which variants a program holds, and which of them count tests.
//!
//! In: the default variant, how many are wanted, the target. Out: lists that the build makes a
//! kernel of each, and that `src/variant.zig` gets by name.

const std = @import("std");
const Allocator = std.mem.Allocator;

/// How four floats are added; `src/variant.zig` says what each means.
pub const Backend = enum { scalar, vector, intrinsics };
/// How rays are bundled; `src/variant.zig` says what each means.
pub const Traversal = enum { single, packet2x2, beam };
/// What a program holds: the default variant, the scalar reference beside it, or all there are.
pub const Extent = enum { one, few, all };

/// As in `src/variant.zig`.
pub const Variant = struct {
    backend: Backend,
    traversal: Traversal,
    lanes: u8,

    /// What all others are compared with.
    pub const reference: Variant = .{ .backend = .scalar, .traversal = .single, .lanes = 4 };

    /// `backend-traversal-lanes`.
    pub fn name(variant: Variant, arena: Allocator) []const u8 {
        return arena.print("{t}-{t}-{d}", .{
            variant.backend, variant.traversal, variant.lanes,
        }) catch @panic("OOM");
    }

    /// Whether the numbers of tests are the same.
    fn countsAs(variant: Variant, other: Variant) bool {
        return variant.traversal == other.traversal and variant.lanes == other.lanes;
    }
};

/// The variants of a program, `default` first.
pub fn held(
    arena: Allocator,
    cpu: std.Target.Cpu,
    default: Variant,
    extent: Extent,
) []const Variant {
    var list: std.ArrayList(Variant) = .empty;
    add(arena, &list, default);
    if (extent != .one) add(arena, &list, .reference);
    // The wide ones pay on x86 only.
    const lane_counts: []const u8 = if (cpu.arch.isX86()) &.{ 4, 8, 16 } else &.{4};
    if (extent == .all) for (lane_counts) |lanes| {
        for (std.enums.values(Backend)) |backend| for (std.enums.values(Traversal)) |traversal| {
            // The C intrinsics and the thesis's packets are 4 wide. Wide scalar loops tell nothing
            // that narrow ones do not, but take longest to compile; they are built by name.
            if (lanes > 4 and (backend != .vector or traversal == .packet2x2)) continue;
            add(arena, &list, .{ .backend = backend, .traversal = traversal, .lanes = lanes });
        };
    };
    return list.items;
}

/// Those of `variants` that count tests: one for each traversal and number of lanes, of Zig's
/// vectors where they are there.
pub fn counting(arena: Allocator, variants: []const Variant) []const Variant {
    var list: std.ArrayList(Variant) = .empty;
    for ([_]bool{ true, false }) |by_vector| for (variants) |variant| {
        if ((variant.backend == .vector) != by_vector) continue;
        const is_counted = for (list.items) |other| {
            if (other.countsAs(variant)) break true;
        } else false;
        if (!is_counted) add(arena, &list, variant);
    };
    return list.items;
}

/// Those of `variants` that hold the integrators besides Whitted's, which take as long to compile:
/// the default and, of all, those that tell how rays that bounce are best traced.
pub fn lit(arena: Allocator, variants: []const Variant) []const Variant {
    var list: std.ArrayList(Variant) = .empty;
    for (variants, 0..) |variant, index| {
        const is_told = switch (variant.backend) {
            .vector => variant.lanes == 4 or variant.traversal == .beam,
            .scalar => variant.traversal == .single,
            .intrinsics => variant.traversal == .beam,
        };
        if (index == 0 or (is_told and variants.len > 2)) add(arena, &list, variant);
    }
    return list.items;
}

fn add(arena: Allocator, list: *std.ArrayList(Variant), variant: Variant) void {
    for (list.items) |other| if (std.meta.eql(other, variant)) return;
    list.append(arena, variant) catch @panic("OOM");
}
