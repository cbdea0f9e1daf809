//! The variant's way to trace a bundle: in company, or every ray by itself.
//!
//! In: a bundle, and what its rays have in common. Out: hits in the bundle. The thesis's 2x2
//! packets always stay together; of the large bundles, those rays that can be go as beams, and the
//! rest finds company block by block.

const world_file = @import("../world.zig");
const TestCounts = @import("../statistics.zig").TestCounts;
const interval = @import("interval.zig");
const single = @import("single.zig");
const packet = @import("packet.zig");
const pencil = @import("beam/pencil.zig");
const primary = @import("beam/primary.zig");
const Grid = @import("beam/grid.zig").Grid;
const shadow = @import("beam/shadow.zig");
const Query = @import("walk.zig").Query;

/// Which rays of a bundle hit what is near to each other, as those of a beam do.
pub fn Together(comptime Kernel: type) type {
    return union(enum) { none, all, some: packet.Part(Kernel) };
}

/// Finds the nearest hits of all active rays. With a grid, rays start at its origin along its
/// directions, leave nothing out and have no limit; else nothing is known of them. Returns those
/// that went as beams. `shares` is null, or where the barycentric weights of these go: of the
/// second and the third corner, by group.
pub fn nearest(
    comptime Kernel: type,
    world: *const world_file.World,
    bundle: *packet.Bundle(Kernel),
    grid: ?*const Grid,
    shares: ?*[Kernel.group_count][2]Kernel.Rays.F32,
    counts: *TestCounts,
) Together(Kernel) {
    if (Kernel.variant.traversal != .packet) {
        bySelf(Kernel, .nearest, world, bundle, counts);
        return .none;
    }
    if (grid) |known| {
        if (primary.trace(Kernel, world, known, bundle, shares, counts)) return .all;
        byInterval(Kernel, .nearest, world, bundle, null, counts);
        return .none;
    }
    const beams = pencil.trace(Kernel, world, bundle, shares, counts);
    byInterval(Kernel, .nearest, world, bundle, if (beams) |*some| some else null, counts);
    return if (beams) |some| .{ .some = some } else .none;
}

/// Finds whether all active rays, of this light, have any hit; `interval.trace` says what is left
/// in the bundle. Those together end near to each other, or start there if the light is a
/// directional one.
pub fn any(
    comptime Kernel: type,
    world: *const world_file.World,
    bundle: *packet.Bundle(Kernel),
    light: *const world_file.Light,
    together: *const Together(Kernel),
    counts: *TestCounts,
) void {
    if (Kernel.variant.traversal != .packet)
        return bySelf(Kernel, .any, world, bundle, counts);
    switch (together.*) {
        .none => byInterval(Kernel, .any, world, bundle, null, counts),
        .all => shadow.trace(Kernel, world, light, bundle, counts),
        .some => |*some| {
            const active = packet.narrow(Kernel, bundle, some, true);
            shadow.trace(Kernel, world, light, bundle, counts);
            packet.restore(Kernel, bundle, &active);
            byInterval(Kernel, .any, world, bundle, some, counts);
        },
    }
}

/// All rays but those that are `done`, each in what company it finds.
fn byInterval(
    comptime Kernel: type,
    comptime query: Query,
    world: *const world_file.World,
    bundle: *packet.Bundle(Kernel),
    done: ?*const packet.Part(Kernel),
    counts: *TestCounts,
) void {
    var credit: interval.Credit = .{};
    const part = done orelse
        return interval.trace(Kernel, query, world, bundle, &credit, counts);
    const active = packet.narrow(Kernel, bundle, part, false);
    interval.trace(Kernel, query, world, bundle, &credit, counts);
    packet.restore(Kernel, bundle, &active);
}

/// One group without beams.
fn bySelf(
    comptime Kernel: type,
    comptime query: Query,
    world: *const world_file.World,
    bundle: *packet.Bundle(Kernel),
    counts: *TestCounts,
) void {
    const group = &bundle.groups[0];
    if (Kernel.variant.traversal == .packet2x2) {
        packet.trace(Kernel, query, world, group, counts);
    } else if (group.active.lane(0)) {
        _ = single.trace(Kernel, query, world, group, counts);
    }
}
