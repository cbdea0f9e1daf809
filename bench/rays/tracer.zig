//! What is measured: the rays of a batch through the tree, in the variant's own way.
//!
//! In: a batch. Out: its hits. The one file to change for another kind of traversal: the workload
//! knows no more of tracing than these three functions.

const raylane = @import("raylane");
const batch_file = @import("batch.zig");
const Batch = batch_file.Batch;
const Query = raylane.trace.single.Query;
const Vec3 = raylane.math.Vec3;
const World = raylane.world.World;
const packet = raylane.trace.packet;
const query_file = raylane.trace.query;
const ray_file = raylane.trace.ray;
const triangle = raylane.trace.triangle;

/// Traces batches with one variant.
pub fn Tracer(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const Lanes = Kernel.Boxes;
    return struct {
        world: *const World,
        tests: raylane.statistics.TestCounts = .{},

        const Self = @This();
        const bundle_ray_count = Kernel.group_count * Kernel.ray_count;

        /// Nearest hits of rays from the eye, one through each pixel of a tile: all are active, and
        /// their directions are affine in the pixel's place.
        pub fn primary(tracer: *Self, batch: *Batch, eye: Vec3) void {
            tracer.trace(.nearest, batch, eye);
            tracer.weighHits(batch, eye);
        }

        /// Whether rays from a light hit anything on the way to their ends at `batch.t`.
        pub fn occluded(tracer: *Self, batch: *Batch, light: Vec3) void {
            tracer.trace(.any, batch, light);
        }

        /// Nearest hits of rays that have little in common.
        pub fn reflect(tracer: *Self, batch: *Batch) void {
            tracer.trace(.nearest, batch, null);
            tracer.weighHits(batch, null);
        }

        /// `apex` is the origin of all rays, if they have one.
        fn trace(tracer: *Self, comptime query: Query, batch: *Batch, apex: ?Vec3) void {
            var first: usize = 0;
            while (first < batch_file.ray_count) : (first += bundle_ray_count) {
                var bundle: packet.Bundle(Kernel) = undefined;
                var any = false;
                for (&bundle.groups, 0..) |*group, index| {
                    group.* = load(batch, first + index * Kernel.ray_count, apex);
                    any = any or group.active.any();
                }
                if (!any) continue;
                const coherent = apex != null;
                query_file.trace(Kernel, query, tracer.world, &bundle, coherent, &tracer.tests);
                for (&bundle.groups, 0..) |*group, index| {
                    const at = first + index * Kernel.ray_count;
                    group.nearest.primitive.store(batch.primitive[at..][0..Kernel.ray_count]);
                    if (query == .any) continue;
                    group.nearest.t.store(batch.t[at..][0..Kernel.ray_count]);
                }
            }
        }

        inline fn load(batch: *const Batch, at: usize, apex: ?Vec3) ray_file.Ray(Rays) {
            const count = Kernel.ray_count;
            const origin: Rays.Vec3 =
                if (apex) |point| .splat(point) else loadVec3(Rays, &batch.origin, at);
            return .{
                .line = .init(origin, loadVec3(Rays, &batch.direction, at)),
                .after = .start(),
                .nearest = .before(.load(batch.t[at..][0..count])),
                .skip = .load(batch.skip[at..][0..count]),
                .active = Rays.I32.load(batch.active[at..][0..count]).lt(.zero()),
            };
        }

        /// Barycentric weights of the nearest hits, by the edge functions that decided them.
        fn weighHits(tracer: *const Self, batch: *Batch, apex: ?Vec3) void {
            var at: usize = 0;
            while (at < batch_file.ray_count) : (at += Lanes.count) {
                const active = Lanes.I32.load(batch.active[at..][0..Lanes.count]).lt(.zero());
                const primitive: Lanes.I32 = .load(batch.primitive[at..][0..Lanes.count]);
                const hit = active.andNot(primitive.lt(.zero()));
                if (hit.none()) continue;
                const corners = tracer.gather(Lanes.I32.select(hit, primitive, .zero()));
                const origin: Lanes.Vec3 =
                    if (apex) |point| .splat(point) else loadVec3(Lanes, &batch.origin, at);
                const line: ray_file.Line(Lanes) =
                    .init(origin, loadVec3(Lanes, &batch.direction, at));
                const weights = weigh(corners, line, hit);
                const share = Lanes.F32.splat(1).div(weights.sum());
                weights.b.mul(share).store(batch.u[at..][0..Lanes.count]);
                weights.c.mul(share).store(batch.v[at..][0..Lanes.count]);
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

/// Three components of as many rays as `Lanes` has, from the one at `at` on.
pub inline fn loadVec3(
    comptime Lanes: type,
    vectors: *const batch_file.Vectors,
    at: usize,
) Lanes.Vec3 {
    return .{
        .x = .load(vectors[0][at..][0..Lanes.count]),
        .y = .load(vectors[1][at..][0..Lanes.count]),
        .z = .load(vectors[2][at..][0..Lanes.count]),
    };
}
