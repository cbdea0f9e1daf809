//! The ways to trace a set of rays: a variant, and which of its traversals.
//!
//! In: a set, the geometry. Out: what it cost, bundle by bundle, and a hash of all hits. Rays are
//! put into lanes before the clock runs, so that traversal alone is measured.

const std = @import("std");
const builtin = @import("builtin");
const raylane = @import("raylane");
const batch_file = @import("../rays/batch.zig");
const phases = @import("../rays/phases.zig");
const rays = @import("rays.zig");
const tracer_file = @import("../rays/tracer.zig");
const Geometry = raylane.world.Geometry;
const Query = raylane.trace.walk.Query;
const Variant = raylane.variant.Variant;
const World = raylane.world.World;
const ray_file = raylane.trace.ray;
const assert = std.debug.assert;

/// How rays of a bundle travel.
pub const Way = enum {
    /// One after the other.
    single,
    /// As the thesis's packets of 2x2.
    packet2x2,
    /// As a ray stream, all of them.
    stream,
    /// As interval packets, and the rest as a stream.
    interval,
    /// As beams; only where the rays have something in common (`rays.Common`).
    beam,
};

/// A variant and a way.
pub const Method = struct {
    variant: Variant,
    way: Way,

    /// `backend-way-lanes`.
    pub fn name(comptime method: Method) []const u8 {
        return std.fmt.comptimePrint("{t}-{t}-{d}", .{
            method.variant.backend, method.way, method.variant.lanes,
        });
    }
};

/// All that are compared, the reference first.
pub const all: []const Method = list: {
    const wide: []const u8 = if (builtin.cpu.arch.isX86()) &.{ 4, 8 } else &.{4};
    var list: []const Method = &.{.{
        .variant = .{ .backend = .scalar, .traversal = .single, .lanes = 4 },
        .way = .single,
    }};
    for (wide) |lanes| for (std.enums.values(Way)) |way| {
        if (way == .packet2x2 and lanes != 4) continue;
        const traversal: raylane.variant.Traversal = switch (way) {
            .single => .single,
            .packet2x2 => .packet2x2,
            .stream, .interval, .beam => .beam,
        };
        list = list ++ .{Method{
            .variant = .{ .backend = .vector, .traversal = traversal, .lanes = lanes },
            .way = way,
        }};
    };
    break :list list;
};

/// What a set cost.
pub const Cost = struct {
    /// Of this thread's processor time, while rays were traced.
    time_ns: u64 = 0,
    hits: u64 = 0,
    hash: u64 = 0,
};

/// Of the calling thread, in nanoseconds: what others do meanwhile does not count.
pub fn processorTime() u64 {
    var time: std.c.timespec = undefined;
    _ = std.c.clock_gettime(.THREAD_CPUTIME_ID, &time);
    return @as(u64, @intCast(time.sec)) * std.time.ns_per_s + @as(u64, @intCast(time.nsec));
}

/// Traces a set.
pub const RunFn = *const fn (
    world: *const World,
    set: *const rays.Set,
    mode: phases.Mode,
) Cost;

/// By method.
pub const run_fns: [all.len]RunFn = fns: {
    var fns: [all.len]RunFn = undefined;
    for (&fns, all) |*to, method| to.* = Runner(method).run;
    break :fns fns;
};

fn Runner(comptime method: Method) type {
    const Kernel = raylane.trace.kernel.Kernel(method.variant, false);
    const Batch = batch_file.Batch(Kernel);
    const Lanes = Batch.Lanes;
    return struct {
        /// Asserts that the tree has the variant's width.
        fn run(world: *const World, set: *const rays.Set, mode: phases.Mode) Cost {
            var cost: Cost = .{};
            var hasher: std.hash.XxHash64 = .init(0);
            var tracer: tracer_file.Tracer(Kernel) = .{ .world = world, .light = undefined };
            var batch: Batch = undefined;
            for (set.bundles, 0..) |*bundle, number| {
                fill(&batch, bundle);
                if (set.common == .light) tracer.light = set.common.light[number];
                const start_ns = processorTime();
                if (mode == .tags) phases.mark(mode.tags);
                switch (set.query) {
                    inline .closest_hit, .any_hit => |query| {
                        const grid = if (set.common == .eye) &set.common.eye[number] else null;
                        trace(query, &tracer, &batch, grid);
                    },
                    .multi_hit => unreachable,
                }
                if (mode == .tags) phases.mark(0);
                cost.time_ns += processorTime() - start_ns;
                cost.hits += look(&batch, bundle, set.query, &hasher);
            }
            cost.hash = hasher.final();
            return cost;
        }

        noinline fn trace(
            comptime query: Query,
            tracer: *tracer_file.Tracer(Kernel),
            batch: *Batch,
            grid: ?*const raylane.trace.Grid,
        ) void {
            const geometry = &tracer.world.geometry;
            const tests = &tracer.tests;
            switch (method.way) {
                .single, .packet2x2 => switch (query) {
                    .closest_hit => tracer.reflect(batch),
                    .any_hit => tracer.occluded(batch, true),
                    .multi_hit => comptime unreachable,
                },
                .stream, .interval => {
                    // Packets whose budget is spent leave all rays to the stream.
                    var budget: raylane.trace.interval_packet.PacketBudget = .{};
                    if (method.way == .stream) budget.balance = 0;
                    raylane.trace.interval_packet
                        .trace(Kernel, query, geometry, batch.bundle(), &budget, tests);
                },
                .beam => switch (query) {
                    .closest_hit => tracer.primary(batch, grid.?),
                    .any_hit => tracer.occluded(batch, false),
                    .multi_hit => comptime unreachable,
                },
            }
        }

        /// Rays in lanes.
        fn fill(batch: *Batch, bundle: *const rays.Bundle) void {
            for (&batch.groups, 0..) |*group, number| {
                var origins: [3][Lanes.count]f32 = undefined;
                var directions: [3][Lanes.count]f32 = undefined;
                var limits: [Lanes.count]f32 = undefined;
                var active: u32 = 0;
                for (&limits, 0..) |*limit, lane| {
                    const place = Batch.places[number * Lanes.count + lane];
                    const course = &bundle[place[1] * batch_file.side + place[0]];
                    for (0..3) |axis| {
                        origins[axis][lane] = course.origin[axis];
                        directions[axis][lane] = course.direction[axis];
                    }
                    limit.* = course.limit;
                    if (course.limit > 0) active |= @as(u32, 1) << @intCast(lane);
                }
                group.* = .{
                    .line = .init(vectors(&origins), vectors(&directions)),
                    .tnear = .start(),
                    .closest = .before(.fromArray(limits)),
                    .skip = .splat(ray_file.no_primitive),
                    .active = .fromBits(@intCast(active)),
                };
            }
        }

        fn vectors(axes: *const [3][Lanes.count]f32) Lanes.Vec3 {
            return .{
                .x = .fromArray(axes[0]),
                .y = .fromArray(axes[1]),
                .z = .fromArray(axes[2]),
            };
        }

        /// Counts the hits, and hashes what all methods must agree on: of the closest hits
        /// primitive and t, to the last bit.
        fn look(
            batch: *const Batch,
            bundle: *const rays.Bundle,
            query: Query,
            hasher: *std.hash.XxHash64,
        ) u64 {
            var found: [batch_file.ray_count][2]u32 = @splat(.{ std.math.maxInt(u32), 0 });
            var count: u64 = 0;
            for (&batch.groups, 0..) |*group, number| for (0..Lanes.count) |lane| {
                const place = Batch.places[number * Lanes.count + lane];
                const index = place[1] * batch_file.side + place[0];
                const primitive = group.closest.primitive.lane(lane);
                if (!(bundle[index].limit > 0) or primitive == ray_file.no_primitive) continue;
                count += 1;
                found[index] = if (query == .any_hit)
                    .{ 0, 0 }
                else
                    .{ @intCast(primitive), @bitCast(group.closest.t.lane(lane)) };
            };
            hasher.update(std.mem.sliceAsBytes(&found));
            return count;
        }
    };
}
