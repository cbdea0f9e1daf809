//! The searches of one variant behind pointers: what tests ask of a kernel, ray by ray.
//!
//! A kernel that shows them has them compiled once, for its tracer and for the tests; who calls
//! them has to know the variant's bundles, but compiles no traversal.

const world_file = @import("../../world.zig");
const TestCounts = @import("../../statistics.zig").TestCounts;
const ray_file = @import("ray.zig");
const bundle_file = @import("bundle.zig");
const dispatch = @import("dispatch.zig");
const eye_rays = @import("beam/eye_rays.zig");
const interval_packet = @import("interval_packet.zig");
const multi_hit = @import("multi_hit.zig");
const single = @import("single.zig");
const Grid = @import("beam/grid.zig").Grid;
const Query = @import("walk.zig").Query;
const Coherence = dispatch.Coherence;
const Geometry = world_file.Geometry;
const PacketBudget = interval_packet.PacketBudget;
const Ray = ray_file.Ray(ray_file.Single);

/// See the functions of the same names; `Kernel` has to count no tests.
pub fn Searches(comptime Kernel: type) type {
    const Bundle = bundle_file.Bundle(Kernel);
    const HitLists = multi_hit.HitLists(Kernel);
    const is_beam = Kernel.variant.traversal == .beam;
    return extern struct {
        /// `single.trace`, by query.
        one_closest: *const fn (*const Geometry, *Ray, *TestCounts) callconv(.c) bool,
        one_any: *const fn (*const Geometry, *Ray, *TestCounts) callconv(.c) bool,
        hit_lists: *const fn (*HitLists, *Bundle, *TestCounts) callconv(.c) void,
        /// `dispatch.closestHit`: whether they went as a beam.
        closest_hit: *const fn (
            *const Geometry,
            *Bundle,
            ?*const Grid,
            *TestCounts,
        ) callconv(.c) bool,
        any_hit: *const fn (
            *const Geometry,
            *Bundle,
            *const world_file.Light,
            *const Coherence,
            *TestCounts,
        ) callconv(.c) void,
        /// `interval_packet.trace` for any hit, and `eye_rays.trace`; null without beams.
        packets_any: ?*const fn (
            *const Geometry,
            *Bundle,
            *PacketBudget,
            *TestCounts,
        ) callconv(.c) void,
        beam_closest: ?*const fn (
            *const Geometry,
            *const Grid,
            *Bundle,
            *TestCounts,
        ) callconv(.c) bool,

        const Self = @This();

        pub const of: Self = .{
            .one_closest = One(.closest_hit).trace,
            .one_any = One(.any_hit).trace,
            .hit_lists = hitLists,
            .closest_hit = closestHit,
            .any_hit = anyHit,
            .packets_any = if (is_beam) packetsAny else null,
            .beam_closest = if (is_beam) beamClosest else null,
        };

        fn One(comptime query: Query) type {
            return struct {
                fn trace(
                    geometry: *const Geometry,
                    ray: *Ray,
                    counts: *TestCounts,
                ) callconv(.c) bool {
                    return single.trace(Kernel, query, geometry, ray, counts);
                }
            };
        }

        fn hitLists(lists: *HitLists, bundle: *Bundle, counts: *TestCounts) callconv(.c) void {
            lists.trace(bundle, counts);
        }

        fn closestHit(
            geometry: *const Geometry,
            bundle: *Bundle,
            grid: ?*const Grid,
            counts: *TestCounts,
        ) callconv(.c) bool {
            return dispatch.closestHit(Kernel, geometry, bundle, grid, counts) == .all;
        }

        fn anyHit(
            geometry: *const Geometry,
            bundle: *Bundle,
            light: *const world_file.Light,
            coherence: *const Coherence,
            counts: *TestCounts,
        ) callconv(.c) void {
            dispatch.anyHit(Kernel, geometry, bundle, light, coherence.*, counts);
        }

        fn packetsAny(
            geometry: *const Geometry,
            bundle: *Bundle,
            budget: *PacketBudget,
            counts: *TestCounts,
        ) callconv(.c) void {
            interval_packet.trace(Kernel, .any_hit, geometry, bundle, budget, counts);
        }

        fn beamClosest(
            geometry: *const Geometry,
            grid: *const Grid,
            bundle: *Bundle,
            counts: *TestCounts,
        ) callconv(.c) bool {
            return eye_rays.trace(Kernel, geometry, grid, bundle, counts);
        }
    };
}
