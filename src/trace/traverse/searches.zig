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

        /// Room for the clusters of instances: for two of them, so that each is mapped often.
        const Room = struct {
            geometry: Geometry,
            cache: world_file.instances.ClusterCache(Kernel.width),
            sets: [1]world_file.instances.ClusterCache(Kernel.width).Set,
            slots: [2]world_file.instances.MappedCluster(Kernel.width),

            fn of(room: *Room, geometry: *const Geometry) *const Geometry {
                if (geometry.shared.runs.len == 0) return geometry;
                room.cache = .init(&room.sets, &room.slots);
                room.geometry = geometry.*;
                room.geometry.cluster_cache = &room.cache;
                return &room.geometry;
            }
        };

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
                    var room: Room = undefined;
                    return single.trace(Kernel, query, room.of(geometry), ray, counts);
                }
            };
        }

        fn hitLists(lists: *HitLists, bundle: *Bundle, counts: *TestCounts) callconv(.c) void {
            var room: Room = undefined;
            const geometry = lists.geometry;
            defer lists.geometry = geometry;
            lists.geometry = room.of(geometry);
            lists.trace(bundle, counts);
        }

        fn closestHit(
            geometry: *const Geometry,
            bundle: *Bundle,
            grid: ?*const Grid,
            counts: *TestCounts,
        ) callconv(.c) bool {
            var room: Room = undefined;
            return dispatch.closestHit(Kernel, room.of(geometry), bundle, grid, counts) == .all;
        }

        fn anyHit(
            geometry: *const Geometry,
            bundle: *Bundle,
            light: *const world_file.Light,
            coherence: *const Coherence,
            counts: *TestCounts,
        ) callconv(.c) void {
            var room: Room = undefined;
            dispatch.anyHit(Kernel, room.of(geometry), bundle, light, coherence.*, counts);
        }

        fn packetsAny(
            geometry: *const Geometry,
            bundle: *Bundle,
            budget: *PacketBudget,
            counts: *TestCounts,
        ) callconv(.c) void {
            var room: Room = undefined;
            interval_packet.trace(Kernel, .any_hit, room.of(geometry), bundle, budget, counts);
        }

        fn beamClosest(
            geometry: *const Geometry,
            grid: *const Grid,
            bundle: *Bundle,
            counts: *TestCounts,
        ) callconv(.c) bool {
            var room: Room = undefined;
            return eye_rays.trace(Kernel, room.of(geometry), grid, bundle, counts);
        }
    };
}
