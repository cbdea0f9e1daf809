//! The variant's way to trace a bundle: in company, or every ray by itself.
//!
//! In: a bundle, and what its rays have in common. Out: hits in the bundle. The thesis's 2x2
//! packets always stay together; the large bundles are beams where they can be, and scatter into
//! single rays where the rays are known to go different ways.

const world_file = @import("../world.zig");
const TestCounts = @import("../statistics.zig").TestCounts;
const ray_file = @import("ray.zig");
const interval = @import("interval.zig");
const single = @import("single.zig");
const walk = @import("walk.zig");
const packet = @import("packet.zig");
const primary = @import("beam/primary.zig");
const shadow = @import("beam/shadow.zig");

/// What the rays of a bundle have in common.
pub const Company = union(enum) {
    /// One origin, and directions that are linear in the pixel; nothing left out, no limit.
    pencil: *const primary.Grid,
    /// This light, at one end or in one direction, and near to each other at the other end; asked
    /// for any hit.
    light: *const world_file.Light,
    /// One origin or nearly one way.
    coherent,
    /// Nothing.
    scattered,
};

/// Looks for hits of all active rays; see `packet.trace` for what is left in the bundle.
pub fn trace(
    comptime Kernel: type,
    comptime query: walk.Query,
    world: *const world_file.World,
    bundle: *packet.Bundle(Kernel),
    company: Company,
    counts: *TestCounts,
) void {
    const tree = world.tree.get(Kernel.width);
    switch (Kernel.variant.traversal) {
        .single => if (bundle.groups[0].active.lane(0)) {
            _ = single.trace(Kernel, query, world, &bundle.groups[0], counts);
        },
        .packet2x2 => packet.trace(Kernel, query, tree, world.pad, bundle, counts),
        .packet => switch (company) {
            .pencil => |grid| {
                if (query == .nearest and
                    primary.trace(Kernel, world, grid, bundle, null, counts)) return;
                packet.trace(Kernel, query, tree, world.pad, bundle, counts);
            },
            .light => |light| {
                if (query == .any and interval.tune_shadow) {
                    for (0..Kernel.block_count) |block| {
                        const groups = bundle.groups[block * Kernel.block_groups ..][0..Kernel.block_groups];
                        interval.trace(Kernel, query, world, groups, counts);
                    }
                    return;
                }
                if (query == .any) return shadow.trace(Kernel, world, light, bundle, counts);
                packet.trace(Kernel, query, tree, world.pad, bundle, counts);
            },
            .coherent => packet.trace(Kernel, query, tree, world.pad, bundle, counts),
            .scattered => for (0..Kernel.block_count) |block| {
                const groups = bundle.groups[block * Kernel.block_groups ..][0..Kernel.block_groups];
                interval.trace(Kernel, query, world, groups, counts);
            },
        },
    }
}
