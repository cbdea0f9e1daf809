//! Dispatch of a bundle to the traversals of its variant.
//!
//! In: a bundle, and what its rays have in common. Out: hits in the bundle. The thesis's 2x2
//! packets always stay together; of the large bundles, those rays that can be go as beams, and the
//! rest as interval packets and ray streams, subtile by subtile.

const world_file = @import("../../world.zig");
const TestCounts = @import("../../statistics.zig").TestCounts;
const interval_packet = @import("interval_packet.zig");
const single = @import("single.zig");
const bundle_file = @import("bundle.zig");
const pencil = @import("beam/virtual_origin.zig");
const primary = @import("beam/primary.zig");
const Grid = @import("beam/grid.zig").Grid;
const shadow = @import("beam/shadow.zig");
const Query = @import("walk.zig").Query;

/// Which rays of a bundle hit what is near to each other, as those of a beam do.
pub fn Coherence(comptime Kernel: type) type {
    return union(enum) { none, all, some: bundle_file.Part(Kernel) };
}

/// Finds the nearest hits of all active rays. With a grid, rays start at its origin along its
/// directions, leave nothing out and have no limit; else nothing is known of them. Returns those
/// that went as beams. `shares` is null, or where the barycentric weights of these go: of the
/// second and the third corner, by group.
pub fn closestHit(
    comptime Kernel: type,
    geometry: *const world_file.Geometry,
    bundle: *bundle_file.Bundle(Kernel),
    grid: ?*const Grid,
    shares: ?*[Kernel.group_count][2]Kernel.Rays.F32,
    counts: *TestCounts,
) Coherence(Kernel) {
    if (Kernel.variant.traversal != .beam) {
        bySelf(Kernel, .closest_hit, geometry, bundle, counts);
        return .none;
    }
    if (grid) |known| {
        if (primary.trace(Kernel, geometry, known, bundle, shares, counts)) return .all;
        byInterval(Kernel, .closest_hit, geometry, bundle, null, counts);
        return .none;
    }
    const beams = pencil.trace(Kernel, geometry, bundle, shares, counts);
    byInterval(Kernel, .closest_hit, geometry, bundle, if (beams) |*some| some else null, counts);
    return if (beams) |some| .{ .some = some } else .none;
}

/// Finds whether all active rays, of this light, have any hit; `interval_packet.trace` says what is
/// left in the bundle. Those together end near to each other, or start there if the light is a
/// directional one.
pub fn anyHit(
    comptime Kernel: type,
    geometry: *const world_file.Geometry,
    bundle: *bundle_file.Bundle(Kernel),
    light: *const world_file.Light,
    coherence: *const Coherence(Kernel),
    counts: *TestCounts,
) void {
    if (Kernel.variant.traversal != .beam)
        return bySelf(Kernel, .any_hit, geometry, bundle, counts);
    switch (coherence.*) {
        .none => byInterval(Kernel, .any_hit, geometry, bundle, null, counts),
        .all => shadow.trace(Kernel, geometry, light, bundle, counts),
        .some => |*some| {
            const active = bundle_file.narrow(Kernel, bundle, some, true);
            shadow.trace(Kernel, geometry, light, bundle, counts);
            bundle_file.restore(Kernel, bundle, &active);
            byInterval(Kernel, .any_hit, geometry, bundle, some, counts);
        },
    }
}

/// All rays but those that are `done`, as interval packets and ray streams.
fn byInterval(
    comptime Kernel: type,
    comptime query: Query,
    geometry: *const world_file.Geometry,
    bundle: *bundle_file.Bundle(Kernel),
    done: ?*const bundle_file.Part(Kernel),
    counts: *TestCounts,
) void {
    var budget: interval_packet.PacketBudget = .{};
    const part = done orelse
        return interval_packet.trace(Kernel, query, geometry, bundle, &budget, counts);
    const active = bundle_file.narrow(Kernel, bundle, part, false);
    interval_packet.trace(Kernel, query, geometry, bundle, &budget, counts);
    bundle_file.restore(Kernel, bundle, &active);
}

/// One group without beams.
fn bySelf(
    comptime Kernel: type,
    comptime query: Query,
    geometry: *const world_file.Geometry,
    bundle: *bundle_file.Bundle(Kernel),
    counts: *TestCounts,
) void {
    const group = &bundle.groups[0];
    if (Kernel.variant.traversal == .packet2x2) {
        bundle_file.trace(Kernel, query, geometry, group, counts);
    } else if (group.active.lane(0)) {
        _ = single.trace(Kernel, query, geometry, group, counts);
    }
}
