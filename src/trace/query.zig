//! The variant's way to trace a bundle: in company, or every ray by itself.
//!
//! In: a bundle, and what its rays have in common. Out: hits in the bundle. The thesis's 2x2
//! packets always stay together; the large bundles are beams where they can be, else the rays of
//! each block find their own company.

const world_file = @import("../world.zig");
const TestCounts = @import("../statistics.zig").TestCounts;
const interval = @import("interval.zig");
const single = @import("single.zig");
const packet = @import("packet.zig");
const primary = @import("beam/primary.zig");
const shadow = @import("beam/shadow.zig");
const Query = @import("walk.zig").Query;

/// What the rays of a bundle have in common.
pub const Company = union(enum) {
    /// One origin, and directions that are linear in the pixel; nothing left out, no limit.
    pencil: *const primary.Grid,
    /// This light, at one end or in one direction, and near to each other at the other end; asked
    /// for any hit.
    light: *const world_file.Light,
    /// Nothing that is known.
    unknown,
};

/// Looks for hits of all active rays; see `interval.trace` for what is left in the bundle.
pub fn trace(
    comptime Kernel: type,
    comptime query: Query,
    world: *const world_file.World,
    bundle: *packet.Bundle(Kernel),
    company: Company,
    counts: *TestCounts,
) void {
    switch (Kernel.variant.traversal) {
        .single => if (bundle.groups[0].active.lane(0)) {
            _ = single.trace(Kernel, query, world, &bundle.groups[0], counts);
        },
        .packet2x2 => packet.trace(Kernel, query, world, &bundle.groups[0], counts),
        .packet => {
            switch (company) {
                .pencil => |grid| if (query == .nearest) {
                    if (primary.trace(Kernel, world, grid, bundle, null, counts)) return;
                },
                .light => |light| if (query == .any) {
                    return shadow.trace(Kernel, world, light, bundle, counts);
                },
                .unknown => {},
            }
            var credit: interval.Credit = .{};
            interval.trace(Kernel, query, world, bundle, &credit, counts);
        },
    }
}
