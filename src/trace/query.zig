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
const shadow = @import("beam/shadow.zig");
const Query = @import("walk.zig").Query;

/// Some of a bundle's rays, by group.
pub fn Part(comptime Kernel: type) type {
    return [Kernel.group_count]Kernel.Rays.Mask;
}

/// Finds the nearest hits of all active rays. With a grid, rays start at its origin along its
/// directions, leave nothing out and have no limit; else nothing is known of them. Returns those
/// that went as beams: what they have hit is near to each other. `shares` is null, or where the
/// barycentric weights of these go: of the second and the third corner, by group.
pub fn nearest(
    comptime Kernel: type,
    world: *const world_file.World,
    bundle: *packet.Bundle(Kernel),
    grid: ?*const primary.Grid,
    shares: ?*[Kernel.group_count][2]Kernel.Rays.F32,
    counts: *TestCounts,
) Part(Kernel) {
    if (Kernel.variant.traversal != .packet) {
        bySelf(Kernel, .nearest, world, bundle, counts);
        return @splat(.splat(false));
    }
    const active = activeOf(Kernel, bundle);
    if (grid) |known| {
        if (primary.trace(Kernel, world, known, bundle, shares, counts)) return active;
    }
    const together = pencil.trace(Kernel, world, bundle, shares, counts);
    var credit: interval.Credit = .{};
    if (narrow(Kernel, bundle, &active, &together, false))
        interval.trace(Kernel, .nearest, world, bundle, &credit, counts);
    for (&bundle.groups, active) |*group, mask| group.active = mask;
    return together;
}

/// Finds whether all active rays, of this light, have any hit; `interval.trace` says what is left
/// in the bundle. Those in `together` end near to each other, or start there if the light is a
/// directional one.
pub fn any(
    comptime Kernel: type,
    world: *const world_file.World,
    bundle: *packet.Bundle(Kernel),
    light: *const world_file.Light,
    together: *const Part(Kernel),
    counts: *TestCounts,
) void {
    if (Kernel.variant.traversal != .packet)
        return bySelf(Kernel, .any, world, bundle, counts);
    const active = activeOf(Kernel, bundle);
    if (narrow(Kernel, bundle, &active, together, true))
        shadow.trace(Kernel, world, light, bundle, counts);
    var credit: interval.Credit = .{};
    if (narrow(Kernel, bundle, &active, together, false))
        interval.trace(Kernel, .any, world, bundle, &credit, counts);
    for (&bundle.groups, active) |*group, mask| group.active = mask;
}

fn activeOf(comptime Kernel: type, bundle: *const packet.Bundle(Kernel)) Part(Kernel) {
    var active: Part(Kernel) = undefined;
    for (&active, &bundle.groups) |*mask, *group| mask.* = group.active;
    return active;
}

/// Leaves those rays active that are in a part, or those that are not. Returns whether any is left.
fn narrow(
    comptime Kernel: type,
    bundle: *packet.Bundle(Kernel),
    active: *const Part(Kernel),
    part: *const Part(Kernel),
    within: bool,
) bool {
    var some: Kernel.Rays.Mask = .splat(false);
    for (&bundle.groups, active, part) |*group, all, chosen| {
        group.active = if (within) all.bitAnd(chosen) else all.andNot(chosen);
        some = some.bitOr(group.active);
    }
    return some.any();
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
