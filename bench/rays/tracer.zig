//! What is measured: the rays of a batch through the tree, in the variant's own way.
//!
//! In: a batch. Out: its hits. The one file to change for another kind of traversal: the workload
//! knows no more of tracing than these three functions.

const std = @import("std");
const raylane = @import("raylane");
const batch_file = @import("batch.zig");
const bundle_file = raylane.trace.bundle;
const dispatch = raylane.trace.dispatch;
const ray_file = raylane.trace.ray;
const triangle = raylane.trace.triangle;
const Grid = raylane.trace.Grid;
const Query = raylane.trace.walk.Query;
const World = raylane.world.World;

/// Traces batches with one variant.
pub fn Tracer(comptime Kernel: type) type {
    const Lanes = Kernel.Boxes;
    const Batch = batch_file.Batch(Kernel);
    return struct {
        world: *const World,
        /// The benchmark's point light.
        light: raylane.world.Light,
        tests: raylane.statistics.TestCounts = .{},
        const Self = @This();

        /// Closest hits of rays from the eye, one through each pixel of a tile, all active.
        pub fn primary(tracer: *Self, batch: *Batch, grid: *const Grid) void {
            tracer.nearest(batch, grid);
        }

        /// Whether rays from the light hit anything on the way to their ends, which are what the
        /// eye sees or, after a bounce, anywhere.
        pub fn occluded(tracer: *Self, batch: *Batch, bounced: bool) void {
            const geometry = &tracer.world.geometry;
            const tests = &tracer.tests;
            const light = &tracer.light;
            switch (Kernel.variant.traversal) {
                .beam => {
                    const coherence: dispatch.Coherence = if (bounced) .none else .all;
                    dispatch.anyHit(Kernel, geometry, batch.bundle(), light, coherence, tests);
                },
                .packet2x2, .single => tracer.traceEach(.any_hit, batch),
            }
        }

        /// Closest hits of rays of which nothing is known.
        pub fn reflect(tracer: *Self, batch: *Batch) void {
            tracer.nearest(batch, null);
        }

        fn nearest(tracer: *Self, batch: *Batch, grid: ?*const Grid) void {
            const geometry = &tracer.world.geometry;
            const tests = &tracer.tests;
            switch (Kernel.variant.traversal) {
                .beam => _ = dispatch.closestHit(Kernel, geometry, batch.bundle(), grid, tests),
                .packet2x2, .single => tracer.traceEach(.closest_hit, batch),
            }
        }

        /// Group by group, each by itself.
        fn traceEach(tracer: *Self, comptime query: Query, batch: *Batch) void {
            const geometry = &tracer.world.geometry;
            const tests = &tracer.tests;
            for (&batch.groups) |*group| {
                if (Kernel.variant.traversal == .packet2x2) {
                    bundle_file.trace(Kernel, query, geometry, group, tests);
                    continue;
                }
                const view = bundle_file.viewOf(Lanes, &geometry.padding, group);
                raylane.trace.single.traceEach(Kernel, query, geometry, group, &view, tests);
            }
        }

        /// Barycentric weights of the closest hits, by the edge functions that decided them.
        pub fn weighHits(tracer: *const Self, batch: *Batch) void {
            var hits: [Batch.group_count]Lanes.Mask = undefined;
            for (&hits, &batch.groups) |*hit, *group| {
                hit.* = group.active.andNot(group.closest.primitive.lt(.zero()));
                if (hit.any()) tracer.prefetchCorners(group.closest.primitive, hit.bits());
            }
            for (&batch.groups, &batch.barycentrics, hits) |*group, *all, hit| {
                if (hit.none()) continue;
                const primitive: Lanes.I32 = .select(hit, group.closest.primitive, .zero());
                const weights = edgeFunctions(tracer.cornersOf(primitive, hit), group.line, hit);
                const share = Lanes.F32.splat(1).div(weights.sum());
                const both = [2]Lanes.F32{ weights.b.mul(share), weights.c.mul(share) };
                for (all, both) |*to, value| {
                    to.* = .select(hit, value, to.*);
                }
            }
        }

        /// Corners are far apart in memory; so nobody waits for one after the other.
        fn prefetchCorners(tracer: *const Self, primitive: Lanes.I32, lanes: u32) void {
            const primitives = primitive.toArray();
            var hits = lanes;
            while (hits != 0) : (hits &= hits - 1) {
                const geometry = &tracer.world.geometry;
                const numbers = geometry.triangles[@intCast(primitives[@ctz(hits)])].corner;
                inline for (numbers) |number| @prefetch(&geometry.positions[number], .{});
            }
        }

        /// Corners of what was hit: neighbours mostly hit the same.
        fn cornersOf(tracer: *const Self, primitives: Lanes.I32, hit: Lanes.Mask) [3]Lanes.Vec3 {
            const one = primitives.lane(@ctz(hit.bits()));
            if (hit.andNot(primitives.eq(.splat(one))).any()) return tracer.gather(primitives);
            const geometry = &tracer.world.geometry;
            var corners: [3]Lanes.Vec3 = undefined;
            for (&corners, geometry.triangles[@intCast(one)].corner) |*corner, number| {
                corner.* = .splat(geometry.positions[number]);
            }
            return corners;
        }

        fn gather(tracer: *const Self, primitives: Lanes.I32) [3]Lanes.Vec3 {
            var arrays: [3][3][Lanes.count]f32 = undefined;
            for (primitives.toArray(), 0..) |primitive, lane| {
                const numbers = tracer.world.geometry.triangles[@intCast(primitive)].corner;
                inline for (&arrays, numbers) |*corner, number| {
                    const position = tracer.world.geometry.positions[number];
                    inline for (corner, position) |*axis, coordinate| axis[lane] = coordinate;
                }
            }
            var corners: [3]Lanes.Vec3 = undefined;
            inline for (&corners, &arrays) |*corner, *axes| {
                corner.* = .{ .x = .load(&axes[0]), .y = .load(&axes[1]), .z = .load(&axes[2]) };
            }
            return corners;
        }

        inline fn edgeFunctions(
            corners: [3]Lanes.Vec3,
            line: ray_file.Line(Lanes),
            hit: Lanes.Mask,
        ) triangle.EdgeFunctions(Lanes) {
            const axis: ray_file.LongAxis(Lanes) = .of(line.direction);
            const padding = &raylane.world.Padding.init(@splat(0), .empty);
            const view: ray_file.ShearedRay(Lanes) = .init(line, axis, padding);
            const turned: [3]Lanes.Vec3 = .{
                axis.turn(corners[0]), axis.turn(corners[1]), axis.turn(corners[2]),
            };
            const seen = triangle.project(Lanes, turned, &view);
            var weights = triangle.edgeFunctions(Lanes, seen);
            _ = triangle.resolveTies(Lanes, seen, &weights, hit);
            return weights;
        }
    };
}
