//! Beam casting from the eye (Heckbert and Hanrahan 1984): which triangle each ray of a square of
//! pixels meets first.
//!
//! In: a bundle of 16x16 rays from one origin whose directions are linear in the pixel. Out: the
//! closest hit of every ray. This is the set of rays that `traverse.zig` asks for, over a
//! hierarchical z-buffer (tile_depth_buffer.zig); the winner's t is always that of the exact test.

const std = @import("std");
const world_file = @import("../../../world.zig");
const TestCounts = @import("../../../statistics.zig").TestCounts;
const kernel_file = @import("../kernel.zig");
const bundle_file = @import("../bundle.zig");
const walk = @import("../walk.zig");
const edges_file = @import("edges.zig");
const exact = @import("exact.zig");
const frustum_file = @import("frustum.zig");
const pixel_window = @import("pixel_window.zig");
const projected = @import("projected_triangle.zig");
const rasterise = @import("rasterise.zig");
const resolve = @import("resolve.zig");
const traverse = @import("traverse.zig");
const Budget = @import("budget.zig").Budget;
const Grid = @import("grid.zig").Grid;
const TileDepthBuffer = @import("tile_depth_buffer.zig").TileDepthBuffer;

const subtile_side = kernel_file.subtile_side;
const subtiles_across = kernel_file.beam_side / subtile_side;
/// With no more subtiles than this, triangles are not tested against each of them first.
const few_subtiles = 2;
const last: f32 = kernel_file.beam_side - 1;
const subtile_last: f32 = subtile_side - 1;

/// Finds the closest hits of a bundle's rays, which have none yet, start at `grid.origin` and
/// leave nothing out. Returns false, having done nothing, where the rays are too far apart or the
/// beam meets so much that it does not pay.
pub fn trace(
    comptime Kernel: type,
    geometry: *const world_file.Geometry,
    grid: *const Grid,
    bundle: *bundle_file.Bundle(Kernel),
    counts: *TestCounts,
) bool {
    // In place: it is too large to be handed around.
    var set: EyeRays(Kernel) = undefined;
    if (!set.init(geometry, grid, bundle)) return false;
    if (!traverse.trace(Kernel, &set, .ofEye(Kernel.width), counts)) return false;
    resolve.resolve(Kernel, geometry, grid, &set.buffer, bundle);
    return true;
}

/// The rays of a tile, (u, v) their columns and rows.
fn EyeRays(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const lanes = Kernel.ray_count;
    return struct {
        geometry: *const world_file.Geometry,
        bundle: *bundle_file.Bundle(Kernel),
        projection: projected.GridProjection,
        frustum: frustum_file.Frustum(Kernel.Boxes),
        dual: pixel_window.Dual,
        buffer: Buffer,

        pub const query: walk.Query = .closest_hit;
        const Self = @This();
        const Buffer = TileDepthBuffer(Kernel);
        const Coverage = rasterise.Coverage(Self, f32, i32);

        pub fn Window(comptime _: type, comptime Int: type) type {
            return pixel_window.PixelWindow(Int);
        }

        fn init(
            set: *Self,
            geometry: *const world_file.Geometry,
            grid: *const Grid,
            bundle: *bundle_file.Bundle(Kernel),
        ) bool {
            const sides = grid.sides() orelse return false;
            const along = grid.depthNormal() orelse return false;
            set.geometry = geometry;
            set.bundle = bundle;
            set.projection = .init(grid);
            set.frustum = .init(grid.origin, sides, along, .{
                .apart = frustum_file.apartOf(&geometry.padding, grid.origin),
                .by_depth = frustum_file.by_distance * grid.longest() +
                    edges_file.unit_roundoff * grid.deviation_ulps,
            });
            set.dual = .of(grid);
            set.buffer.clear(bundle);
            return true;
        }

        pub inline fn depthMax(set: *Self) f32 {
            return set.buffer.depthMax();
        }

        pub inline fn isDone(_: *const Self) bool {
            return false;
        }

        pub inline fn nearnessMin(set: *const Self) f32 {
            return set.buffer.tile_lower;
        }

        pub inline fn inAxes(
            _: *const Self,
            comptime Lanes: type,
            form: *const projected.Linear(Lanes.F32),
        ) projected.Linear(Lanes.F32) {
            return form.*;
        }

        /// The greatest value of a form over the tile.
        pub inline fn greatest(
            _: *const Self,
            comptime Lanes: type,
            form: *const projected.Linear(Lanes.F32),
        ) Lanes.F32 {
            const steps = form.u.maxFast(.zero()).add(form.v.maxFast(.zero()));
            return steps.mulAdd(.splat(last), form.one);
        }

        pub inline fn windowOf(
            set: *const Self,
            comptime Lanes: type,
            corners: [3]Lanes.Vec3,
            facet: *const edges_file.Facet(Lanes),
            _: *const [3]projected.Linear(Lanes.F32),
        ) struct { Window(Lanes.F32, Lanes.I32), Lanes.Mask } {
            const window, const seen = set.dual.windowOf(Lanes, corners, facet);
            return .{ window, seen };
        }

        pub inline fn subtilesOf(
            set: *Self,
            comptime decisive: bool,
            coverage: *const Coverage,
            slot: exact.Slot,
        ) u32 {
            const subtiles = pixel_window.subtilesOf(&coverage.window);
            if (!decisive or @popCount(subtiles) <= few_subtiles) return subtiles;
            return subtiles & set.stepSubtiles(coverage, slot);
        }

        /// Steps a triangle over the subtiles. Returns those that it may be seen in, but for those
        /// that it surely fills, before all that is known there: these are done.
        inline fn stepSubtiles(set: *Self, coverage: *const Coverage, slot: exact.Slot) u32 {
            var start: [4]F32 = undefined;
            var span: [4]F32 = undefined;
            inline for (&start, &span, &coverage.form) |*to, *by, *form| {
                const u = subtile_last * form.u;
                const v = subtile_last * form.v;
                const most = (if (u > 0) u else 0) + (if (v > 0) v else 0);
                to.* = .splat(form.one + most);
                by.* = .splat(@abs(u) + @abs(v));
            }
            var subtiles: u32 = 0;
            inline for (0..Kernel.subtile_count / lanes) |part| {
                const first = part * lanes;
                const x: F32 = .fromArray(Buffer.subtile_x[first..][0..lanes].*);
                const y: F32 = .fromArray(Buffer.subtile_y[first..][0..lanes].*);
                var most: [4]F32 = undefined;
                inline for (&most, start, &coverage.form) |*to, from, *form| {
                    to.* = x.mulAdd(.splat(form.u), y.mulAdd(.splat(form.v), from));
                }
                const outside = most[0].minOrNegative(most[1]).minOrNegative(most[2]).isNegative();
                const known: F32 = .loadAligned(set.buffer.ofSubtiles("subtile_lower", first));
                var seen = most[3].gt(known).andNot(outside);
                const least = most[0].sub(span[0]).minOrNegative(most[1].sub(span[1]))
                    .minOrNegative(most[2].sub(span[2]));
                const covered = seen.bitAnd(least.gt(.splat(coverage.slack)));
                if (covered.any()) {
                    const nearness = .{ most[3].sub(span[3]), most[3] };
                    seen = seen.andNot(set.fill(coverage, slot, first, covered, nearness));
                }
                subtiles |= seen.bits() << @intCast(first);
            }
            return subtiles;
        }

        /// Of the subtiles from `first` on that a triangle covers, those where it comes first. With
        /// the least and the greatest upper bound of 1/t in each.
        inline fn fill(
            set: *Self,
            coverage: *const Coverage,
            slot: exact.Slot,
            first: usize,
            covered: Rays.Mask,
            nearness: [2]F32,
        ) Rays.Mask {
            const least = nearness[0].mulAdd(.splat(coverage.shrink), .splat(-coverage.drop));
            const known: F32 = .loadAligned(set.buffer.ofSubtiles("subtile_upper", first));
            const filled = covered.bitAnd(least.gt(known));
            if (filled.any()) set.buffer.fill(first, filled, slot, &.{
                .base = coverage.form[3].one,
                .right = coverage.form[3].u,
                .down = coverage.form[3].v,
                .shrink = coverage.shrink,
                .drop = coverage.drop,
            }, least, nearness[1]);
            return filled;
        }

        /// The rows of a subtile that the triangle's window has.
        pub inline fn rowsOf(set: *Self, coverage: *const Coverage, subtile: u32) Rows {
            if (set.buffer.isWhole(subtile)) set.buffer.spread(subtile);
            const top: i32 = @intCast(subtile / subtiles_across * subtile_side);
            const window = &coverage.window;
            const bottom = @min(window.last_y, top + subtile_side - 1) - top;
            const row: u32 = @intCast(@max(window.first_y, top) - top);
            const first_row = row / Kernel.group_height;
            const last_row = @as(u32, @intCast(bottom)) / Kernel.group_height;
            const skipped: f32 = @floatFromInt(first_row * Kernel.group_height);
            var rows: Rows = .{
                .value = undefined,
                .step = undefined,
                .group = subtile * Kernel.subtile_groups + first_row,
                .last = subtile * Kernel.subtile_groups + last_row,
            };
            inline for (&rows.value, &rows.step, &coverage.form) |*value, *step, *form| {
                var start: F32 = .splat(form.one + Buffer.subtile_x[subtile] * form.u +
                    (Buffer.subtile_y[subtile] + skipped) * form.v);
                if (Kernel.group_height > 1)
                    start = F32.fromArray(Kernel.lane_y).mulAdd(.splat(form.v), start);
                value.* = F32.fromArray(Kernel.lane_x).mulAdd(.splat(form.u), start);
                step.* = .splat(form.v * Kernel.group_height);
            }
            return rows;
        }

        const Rows = struct {
            value: [4]F32,
            step: [4]F32,
            group: u32,
            last: u32,

            pub inline fn values(rows: *const Rows) [4]F32 {
                return rows.value;
            }

            pub inline fn next(rows: *Rows) bool {
                if (rows.group == rows.last) return false;
                rows.group += 1;
                inline for (&rows.value, rows.step) |*value, step| value.* = value.add(step);
                return true;
            }
        };

        pub inline fn lower(set: *Self, group: usize) F32 {
            return .loadAligned(set.buffer.of("lower", group));
        }

        pub inline fn upper(set: *Self, group: usize) F32 {
            return .loadAligned(set.buffer.of("upper", group));
        }

        /// Rays from the eye leave nothing out.
        pub inline fn withoutOwn(
            _: *const Self,
            rays: Rays.Mask,
            _: usize,
            _: *const Coverage,
        ) Rays.Mask {
            return rays;
        }

        pub inline fn accept(
            set: *Self,
            group: usize,
            rays: Rays.Mask,
            slot: exact.Slot,
            least: F32,
            most: F32,
        ) void {
            const lowers = set.buffer.of("lower", group);
            const uppers = set.buffer.of("upper", group);
            const slots = set.buffer.of("slot", group);
            F32.select(rays, least, .loadAligned(lowers)).storeAligned(lowers);
            F32.select(rays, most, .loadAligned(uppers)).storeAligned(uppers);
            Rays.I32.select(rays, .splat(slot), .loadAligned(slots)).storeAligned(slots);
        }

        pub inline fn boundSubtile(set: *Self, subtile: usize) void {
            set.buffer.boundSubtile(subtile);
        }
    };
}
