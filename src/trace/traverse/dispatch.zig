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
const eye_rays = @import("beam/eye_rays.zig");
const Grid = @import("beam/grid.zig").Grid;
const shadow = @import("beam/shadow.zig");
const Query = @import("walk.zig").Query;

/// Whether a bundle's rays hit what is near to each other, as those of a beam do.
pub const Coherence = enum { none, all };

/// Finds the closest hits of all active rays. With a grid, rays start at its origin along its
/// directions, leave nothing out and have no limit; else nothing is known of them. Returns whether
/// they went as a beam.
pub fn closestHit(
    comptime Kernel: type,
    geometry: *const world_file.Geometry,
    bundle: *bundle_file.Bundle(Kernel),
    grid: ?*const Grid,
    counts: *TestCounts,
) Coherence {
    if (Kernel.variant.traversal != .beam) {
        bySelf(Kernel, .closest_hit, geometry, bundle, counts);
        return .none;
    }
    if (grid) |known| {
        if (eye_rays.trace(Kernel, geometry, known, bundle, counts)) return .all;
    }
    byInterval(Kernel, .closest_hit, geometry, bundle, counts);
    return .none;
}

/// Finds whether all active rays, of this light, have any hit; `interval_packet.trace` says what is
/// left in the bundle. Those together end near to each other, or start there if the light is a
/// directional one.
pub fn anyHit(
    comptime Kernel: type,
    geometry: *const world_file.Geometry,
    bundle: *bundle_file.Bundle(Kernel),
    light: *const world_file.Light,
    coherence: Coherence,
    counts: *TestCounts,
) void {
    if (Kernel.variant.traversal != .beam)
        return bySelf(Kernel, .any_hit, geometry, bundle, counts);
    switch (if (light.from_receiver) .none else coherence) {
        .none => byInterval(Kernel, .any_hit, geometry, bundle, counts),
        .all => shadow.trace(Kernel, geometry, light, bundle, counts),
    }
}

/// All rays as interval packets and ray streams.
fn byInterval(
    comptime Kernel: type,
    comptime query: Query,
    geometry: *const world_file.Geometry,
    bundle: *bundle_file.Bundle(Kernel),
    counts: *TestCounts,
) void {
    var budget: interval_packet.PacketBudget = .{};
    interval_packet.trace(Kernel, query, geometry, bundle, &budget, counts);
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
