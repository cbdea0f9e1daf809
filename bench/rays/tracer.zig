//! What is measured: the rays of a batch through the tree, in the variant's own way.
//!
//! In: a batch. Out: its hits. The one file to change for another kind of traversal: the workload
//! knows no more of tracing than these three functions.

const std = @import("std");
const raylane = @import("raylane");
const batch_file = @import("batch.zig");
const packet = raylane.trace.packet;
const query_file = raylane.trace.query;
const ray_file = raylane.trace.ray;
const triangle = raylane.trace.triangle;
const Company = query_file.Company;
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

        /// Nearest hits of rays from the eye, one through each pixel of a tile, all active.
        pub fn primary(tracer: *Self, batch: *Batch, grid: *const Grid) void {
            if (Kernel.variant.traversal == .packet) {
                const world = tracer.world;
                const tests = &tracer.tests;
                const bundle = batch.bundle();
                if (raylane.trace.primary.trace(Kernel, world, grid, bundle, &batch.shares, tests))
                    return;
            }
            tracer.trace(.nearest, batch, .{ .pencil = grid });
            tracer.weighHits(batch);
        }

        /// Whether rays from the light hit anything on the way to their ends, which are what the
        /// eye sees or, after a bounce, anywhere.
        pub fn occluded(tracer: *Self, batch: *Batch, bounced: bool) void {
            tracer.trace(.any, batch, if (bounced) .unknown else .{ .light = &tracer.light });
        }

        /// Nearest hits of rays that have little in common.
        pub fn reflect(tracer: *Self, batch: *Batch) void {
            tracer.trace(.nearest, batch, .unknown);
            tracer.weighHits(batch);
        }

        fn trace(
            tracer: *Self,
            comptime query: Query,
            batch: *Batch,
            company: Company,
        ) void {
            const world = tracer.world;
            const tests = &tracer.tests;
            switch (Kernel.variant.traversal) {
                .packet => query_file.trace(Kernel, query, world, batch.bundle(), company, tests),
                .packet2x2 => for (&batch.groups) |*group| {
                    var bundle: packet.Bundle(Kernel) = .{ .groups = .{group.*} };
                    query_file.trace(Kernel, query, world, &bundle, company, tests);
                    group.* = bundle.groups[0];
                },
                .single => for (&batch.groups) |*group| {
                    const view = packet.viewOf(Lanes, group);
                    raylane.trace.single.traceEach(Kernel, query, world, group, &view, tests);
                },
            }
        }

        /// Barycentric weights of the nearest hits, by the edge functions that decided them.
        fn weighHits(tracer: *const Self, batch: *Batch) void {
            for (&batch.groups) |*group| tracer.prefetchCorners(group);
            for (&batch.groups, &batch.shares) |*group, *shares| {
                const hit = group.active.andNot(group.nearest.primitive.lt(.zero()));
                if (hit.none()) continue;
                const primitive: Lanes.I32 = .select(hit, group.nearest.primitive, .zero());
                const weights = weigh(tracer.gather(primitive), group.line, hit);
                const share = Lanes.F32.splat(1).div(weights.sum());
                shares.* = .{ weights.b.mul(share), weights.c.mul(share) };
            }
        }

        /// Corners are far apart in memory; so nobody waits for one after the other.
        fn prefetchCorners(tracer: *const Self, group: *const ray_file.Ray(Lanes)) void {
            const primitives = group.nearest.primitive.toArray();
            var hits = group.active.andNot(group.nearest.primitive.lt(.zero())).bits();
            while (hits != 0) : (hits &= hits - 1) {
                const numbers = tracer.world.triangles[@intCast(primitives[@ctz(hits)])].corner;
                inline for (numbers) |number| @prefetch(&tracer.world.positions[number], .{});
            }
        }

        fn gather(tracer: *const Self, primitives: Lanes.I32) [3]Lanes.Vec3 {
            var arrays: [3][3][Lanes.count]f32 = undefined;
            for (primitives.toArray(), 0..) |primitive, lane| {
                const numbers = tracer.world.triangles[@intCast(primitive)].corner;
                inline for (&arrays, numbers) |*corner, number| {
                    const position = tracer.world.positions[number];
                    inline for (corner, position) |*axis, coordinate| axis[lane] = coordinate;
                }
            }
            var corners: [3]Lanes.Vec3 = undefined;
            inline for (&corners, &arrays) |*corner, *axes| {
                corner.* = .{ .x = .load(&axes[0]), .y = .load(&axes[1]), .z = .load(&axes[2]) };
            }
            return corners;
        }

        inline fn weigh(
            corners: [3]Lanes.Vec3,
            line: ray_file.Line(Lanes),
            hit: Lanes.Mask,
        ) triangle.Weights(Lanes) {
            const axis: ray_file.LongAxis(Lanes) = .of(line.direction);
            const view: ray_file.View(Lanes) = .init(line, axis);
            const turned: [3]Lanes.Vec3 = .{
                axis.turn(corners[0]), axis.turn(corners[1]), axis.turn(corners[2]),
            };
            const seen = triangle.project(Lanes, turned, &view);
            var weights = triangle.weigh(Lanes, seen);
            _ = triangle.settle(Lanes, seen, &weights, hit);
            return weights;
        }
    };
}
