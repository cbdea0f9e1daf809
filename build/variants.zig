//! Which variants a program holds, which count tests, and which hold further integrators.
//!
//! In: the default variant, how many are wanted, the target. Out: lists that the build makes a
//! kernel of each, and that `src/variant.zig` gets by name.

const std = @import("std");
const Allocator = std.mem.Allocator;

/// How four floats are added; `src/variant.zig` says what each means.
pub const Backend = enum { scalar, vector, intrinsics };
/// How rays are bundled; `src/variant.zig` says what each means.
pub const Traversal = enum { single, packet2x2, beam };
/// What a program holds: the default variant; the scalar reference beside it; some others as well,
/// so that there is each backend and each traversal; or all there are.
pub const Extent = enum { one, few, some, all };

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

    /// Whether it is one of all. The C intrinsics and the thesis's packets are 4 wide. Wide scalar
    /// loops tell nothing that narrow ones do not, but take longest to compile; they are built by
    /// name.
    fn isBuilt(variant: Variant) bool {
        return variant.lanes == 4 or
            (variant.backend == .vector and variant.traversal != .packet2x2);
    }

    /// Whether it is one of some: each backend and each traversal, but not each with each.
    fn isOfSome(variant: Variant) bool {
        return variant.lanes == 4 and switch (variant.backend) {
            .scalar => variant.traversal == .single,
            .vector => true,
            .intrinsics => variant.traversal == .beam,
        };
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
    for ([_]u8{ 4, 8, 16 }) |lanes| for (std.enums.values(Backend)) |backend| {
        for (std.enums.values(Traversal)) |traversal| {
            const variant: Variant =
                .{ .backend = backend, .traversal = traversal, .lanes = lanes };
            const is_held = switch (extent) {
                .one, .few => false,
                .some => variant.isOfSome(),
                // The wide ones pay on x86 only.
                .all => variant.isBuilt() and (lanes == 4 or cpu.arch.isX86()),
            };
            if (is_held) add(arena, &list, variant);
        }
    };
    return list.items;
}

/// Those that count tests: one for each traversal and number of lanes of `variants`, on which alone
/// the numbers depend. They are of Zig's vectors, whether the program holds that variant or not:
/// scalar loops over beams take several times as long to compile.
pub fn counting(arena: Allocator, variants: []const Variant) []const Variant {
    var list: std.ArrayList(Variant) = .empty;
    for (variants) |variant| {
        add(arena, &list, .{
            .backend = .vector,
            .traversal = variant.traversal,
            .lanes = variant.lanes,
        });
    }
    return list.items;
}

/// Those of `variants`, which are `extent` of all, that hold the integrators besides Whitted's:
/// these take as long to compile. The default and, of all, those that tell how rays that bounce are
/// best traced.
pub fn lit(arena: Allocator, variants: []const Variant, extent: Extent) []const Variant {
    var list: std.ArrayList(Variant) = .empty;
    for (variants, 0..) |variant, index| {
        const is_told = variant.isOfSome() and variant.backend != .intrinsics;
        if (index == 0 or (is_told and extent == .all)) add(arena, &list, variant);
    }
    return list.items;
}

fn add(arena: Allocator, list: *std.ArrayList(Variant), variant: Variant) void {
    for (list.items) |other| if (std.meta.eql(other, variant)) return;
    list.append(arena, variant) catch @panic("OOM");
}
