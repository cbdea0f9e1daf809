//! The rays of a square of pixels, as one: which triangle each of them meets first.
//!
//! In: a bundle of 16x16 rays from one origin whose directions are linear in the pixel. Out: the
//! nearest hit of every ray. The tree is travelled once for all of them, front to back. Where a
//! triangle may be seen, its edge functions and 1/t are stepped over blocks of 4x4 pixels, then
//! over the pixels of those that it touches and does not fill, in lanes (edges.zig, found.zig).
//! What that leaves in doubt, an edge or a depth too close to tell, the exact test decides; the
//! winner's t is always its.
//!
//! Rays may also start behind that origin, as those do that a plane mirror sends back, seen from
//! the mirrored eye (starts.zig): then triangles before a ray's start do not count.

const std = @import("std");
const world_file = @import("../../../world.zig");
const TestCounts = @import("../../../statistics.zig").TestCounts;
const kernel_file = @import("../kernel.zig");
const ray_file = @import("../ray.zig");
const bundle_file = @import("../bundle.zig");
const stack = @import("../stack.zig");
const walk = @import("../walk.zig");
const vec3 = @import("../../../math.zig").vec3;
const edges_file = @import("edges.zig");
const exact = @import("exact.zig");
const grid_file = @import("grid.zig");
const found_file = @import("tile_depth_buffer.zig");
const resolve = @import("resolve.zig");
const frustum_file = @import("frustum.zig");
const Cost = @import("budget.zig").Cost;
const Starts = @import("starts.zig").Starts;
const Area = grid_file.Area;
const Grid = grid_file.Grid;
const assert = std.debug.assert;

const side = kernel_file.beam_side;
const subtile_side = kernel_file.subtile_side;
const pack_count = kernel_file.beam_subtiles;
/// With no more blocks than this, triangles are not tested against each of them first.
const few_blocks = 2;
const last: f32 = side - 1;
const block_last: f32 = subtile_side - 1;

/// Finds the nearest hits of a bundle's rays, which have none yet, start at `grid.origin` and
/// leave nothing out. Returns false, having done nothing, where the rays are too far apart or the
/// beam meets so much that it does not pay.
/// `shares` is null, or where barycentric weights go: of the second and the third corner, by group.
pub fn trace(
    comptime Kernel: type,
    geometry: *const world_file.Geometry,
    grid: *const Grid,
    bundle: *bundle_file.Bundle(Kernel),
    shares: ?*[Kernel.group_count][2]Kernel.Rays.F32,
    counts: *TestCounts,
) bool {
    return run(Kernel, false, geometry, grid, {}, bundle, shares, counts);
}

/// The same of rays that start where `starts` says, and may leave out what comes before and their
/// own triangles. Their starts are within what `Geometry.pad` allows for.
pub fn traceBehind(
    comptime Kernel: type,
    geometry: *const world_file.Geometry,
    grid: *const Grid,
    starts: *const Starts(Kernel),
    bundle: *bundle_file.Bundle(Kernel),
    shares: ?*[Kernel.group_count][2]Kernel.Rays.F32,
    counts: *TestCounts,
) bool {
    return run(Kernel, true, geometry, grid, starts, bundle, shares, counts);
}

fn run(
    comptime Kernel: type,
    comptime behind: bool,
    geometry: *const world_file.Geometry,
    grid: *const Grid,
    starts: if (behind) *const Starts(Kernel) else void,
    bundle: *bundle_file.Bundle(Kernel),
    shares: ?*[Kernel.group_count][2]Kernel.Rays.F32,
    counts: *TestCounts,
) bool {
    // In place: it is too large to be handed around.
    var search: Search(Kernel, behind) = undefined;
    search.starts = starts;
    if (!search.init(geometry, grid, bundle, counts)) return false;
    if (!search.travel()) return false;
    resolve.resolve(Kernel, behind, geometry, grid, &search.found, bundle, shares);
    return true;
}

/// Coefficients of one triangle over the beam's pixels.
const Coverage = struct {
    /// Three edge functions, then 1/t: value at the first pixel, step right, step down; upper
    /// bounds of all of them.
    base: [4]f32,
    right: [4]f32,
    down: [4]f32,
    /// How far below them lower bounds are: by as much for edge functions, by a factor and then as
    /// much for 1/t.
    slack: f32,
    shrink: f32,
    drop: f32,
    /// Columns and rows that it may be seen in.
    first_x: u32,
    first_y: u32,
    last_x: u32,
    last_y: u32,
    slot: exact.Slot,
    /// Its number, if some ray leaves it out; else `no_primitive`.
    skipped: i32,

    /// The blocks of these columns and rows, a bit each.
    inline fn subtiles(coverage: *const Coverage) u32 {
        const across = side / subtile_side;
        const columns = (@as(u32, 2) << @intCast(coverage.last_x / subtile_side)) -
            (@as(u32, 1) << @intCast(coverage.first_x / subtile_side));
        const first_bit = coverage.first_y / subtile_side * across;
        const rows = (@as(u32, 1) << @intCast((coverage.last_y / subtile_side + 1) * across)) -
            (@as(u32, 1) << @intCast(first_bit));
        return columns * 0x1111 & rows;
    }
};

/// The inverse of a grid: for c = t (corner + x right + y down), depth . c = t, column . c = t x,
/// row . c = t y.
const Dual = struct {
    column: [3]f32,
    row: [3]f32,
    depth: [3]f32,
    /// |column| + |row| + 16 |depth|: x or y of a point is off by 4 u of it, times |c| / t.
    gain: f32,

    fn of(grid: *const Grid) Dual {
        const facing = vec3.cross(grid.right, grid.down);
        const scale = 1 / vec3.dot(facing, grid.corner);
        var dual: Dual = .{
            .column = vec3.scale(vec3.cross(grid.down, grid.corner), scale),
            .row = vec3.scale(vec3.cross(grid.corner, grid.right), scale),
            .depth = vec3.scale(facing, scale),
            .gain = undefined,
        };
        dual.gain = vec3.length1(dual.column) + vec3.length1(dual.row) +
            side * vec3.length1(dual.depth);
        return dual;
    }
};

/// With rays that start behind the grid's origin, or at it.
fn Search(comptime Kernel: type, comptime behind: bool) type {
    const Boxes = Kernel.Boxes;
    const Rays = Kernel.Rays;
    const width = Kernel.width;
    const lanes = Kernel.ray_count;
    return struct {
        geometry: *const world_file.Geometry,
        tree: *const world_file.Tree(width),
        grid: *const Grid,
        bundle: *bundle_file.Bundle(Kernel),
        counts: *TestCounts,
        starts: if (behind) *const Starts(Kernel) else void,
        frustum: Frustum,
        /// All rays start behind it.
        front: if (behind) frustum_file.Plane(width) else void,
        /// Longest direction times roundings, for edge functions and for 1/t.
        edge_scale: f32,
        inverse_scale: f32,
        /// By how much lines that miss the origin move an edge function, over its edge's length.
        edge_apart: if (behind) f32 else void,
        /// See `edges.reachMax`.
        reach_max: f32,
        /// From a point relative to the origin to column and row times t, and t; see `Dual`.
        dual: Dual,
        /// By how much lines that miss the origin, and directions off the grid, move a corner's
        /// place: the former times 1/t.
        window_apart: if (behind) [2]f32 else void,
        found: Found,

        const Self = @This();
        const Found = found_file.Found(Kernel);
        const Frustum = frustum_file.Frustum(Boxes);
        const F32 = Rays.F32;

        fn init(
            search: *Self,
            geometry: *const world_file.Geometry,
            grid: *const Grid,
            bundle: *bundle_file.Bundle(Kernel),
            counts: *TestCounts,
        ) bool {
            const longest = grid.longest();
            const spread = grid.spread();
            const roundings = grid.deviation_roundings;
            const unit = edges_file.unit_roundoff;
            search.geometry = geometry;
            search.tree = geometry.tree.get(width);
            search.grid = grid;
            search.bundle = bundle;
            search.counts = counts;
            const area: Area = if (behind) search.starts.area else .{};
            const sides = grid.sides(area) orelse return false;
            const along = grid.depthNormal() orelse return false;
            var standoff = frustum_file.slack_pads * geometry.pad;
            if (behind) standoff += search.driftMax(along);
            search.frustum = .init(grid.origin, sides, along, standoff);
            if (behind) {
                search.front = .init(along, grid.origin, standoff);
                search.front.offset -= search.starts.t_min;
            }
            // A direction off by d moves an edge function by 2 R L d, 1/t by L^2 / |det| d.
            search.edge_scale = unit * (edges_file.edge_roundings * longest +
                edges_file.step_roundings * spread + 2 * roundings);
            search.inverse_scale = unit *
                (edges_file.inverse_roundings * longest + 2 * roundings);
            // Starts are within reach, the grid's origin need not be.
            search.reach_max = if (behind)
                edges_file.reach_limit
            else
                edges_file.reachMax(geometry.pad);
            if (behind) search.edge_apart = 2 * search.starts.spread.apart * longest;
            search.dual = .of(grid);
            if (behind) search.window_apart = .{
                search.starts.spread.apart * search.dual.gain,
                unit * roundings * search.dual.gain,
            };
            search.found.clear(bundle);
            return true;
        }

        inline fn spreadOf(search: *const Self) ?edges_file.Spread {
            return if (behind) search.starts.spread else null;
        }

        /// How far, in metres, a point of a ray may be from where the grid has it, or a plane
        /// through the grid's origin off, beyond what `frustum.slack_pads` allows for.
        fn driftMax(search: *const Self, along: [3]f32) f32 {
            const grid = search.grid;
            const unit = edges_file.unit_roundoff;
            const reach = edges_file.reachMax(search.geometry.pad) + search.starts.spread.distance;
            // No direction is shorter than 1 / |along|.
            const t_max = reach * vec3.length(along);
            return 2 * search.starts.spread.apart +
                2 * unit * grid.deviation_roundings * t_max +
                64 * unit * (reach + vec3.length1(grid.origin));
        }

        /// Returns whether it came to an end.
        fn travel(search: *Self) bool {
            var cost: Cost = if (behind)
                .of(width, search.starts.ray_count)
            else
                .ofEye(width);
            var entries: [Kernel.stack_max]stack.Entry = undefined;
            entries[0] = .{ .child = .root, .near = -std.math.inf(f32) };
            var entry_count: usize = 1;
            var depth_max = std.math.inf(f32);
            while (entry_count > 0) {
                entry_count -= 1;
                const entry = entries[entry_count];
                if (entry.near > depth_max) continue;
                if (entry.child.pack_count == 0) {
                    assert(entry_count + width <= Kernel.stack_max);
                    const node = &search.tree.nodes[entry.child.target];
                    walk.countNode(Kernel, node, search.counts);
                    entry_count = search.frustum.pushChildren(
                        node,
                        if (behind) &search.front else null,
                        depth_max,
                        &entries,
                        entry_count,
                    );
                } else {
                    if (!cost.pays(entry.child.pack_count, entry_count)) return false;
                    const first, const end = entry.child.packs();
                    for (first..end) |block| {
                        search.meetBlock(@intCast(block));
                    }
                    depth_max = search.found.depthMax();
                }
            }
            return true;
        }

        /// Sets up the triangles of a block and goes on with those that the beam may see.
        ///
        /// Long: a score of lane values live through it, and stay in registers only here.
        fn meetBlock(search: *Self, block_index: u32) void {
            @setEvalBranchQuota(2000);
            const block = &search.tree.packs[block_index];
            walk.countPack(Kernel, block, search.counts);
            var corners: [3]Boxes.Vec3 = undefined;
            inline for (&corners, &block.corner) |*corner, *components| corner.* = .{
                .x = .load(&components[0]),
                .y = .load(&components[1]),
                .z = .load(&components[2]),
            };
            const primitive: Boxes.I32 = .load(@ptrCast(&block.primitive));
            var there = primitive.gt(.splat(ray_file.no_primitive))
                .bitAnd(search.frustum.mayMeet(corners));
            if (there.none()) return;
            const grid = search.grid;
            const edges: edges_file.Edges(Boxes) =
                .init(corners, .splat(grid.origin), search.reach_max, search.spreadOf());
            const zero: Boxes.F32 = .zero();
            var base: [4]Boxes.F32 = undefined;
            var right: [4]Boxes.F32 = undefined;
            var down: [4]Boxes.F32 = undefined;
            var slack = edges.slack.mul(.splat(search.edge_scale));
            if (behind) slack = edges.facet.length.mulAdd(.splat(search.edge_apart), slack);
            var least: Boxes.F32 = .splat(std.math.inf(f32));
            inline for (edges.normal, 0..) |normal, index| {
                base[index] = edges_file.dot(Boxes, normal, .splat(grid.corner)).add(slack);
                right[index] = edges_file.dot(Boxes, normal, .splat(grid.right));
                down[index] = edges_file.dot(Boxes, normal, .splat(grid.down));
                const reach = right[index].maxFast(zero).add(down[index].maxFast(zero));
                least = least.minOrNegative(reach.mulAdd(.splat(last), base[index]));
            }
            there = there.andNot(edges.facet.turned.bitAnd(least.isNegative()));
            if (there.none()) return;
            const inverse = edges.facet.inverse(search.spreadOf());
            const absolute = inverse.absolute.mul(.splat(search.inverse_scale));
            const one: Boxes.F32 = .splat(1);
            const growth = one.add(inverse.relative);
            base[3] = edges_file.dot(Boxes, inverse.vector, .splat(grid.corner))
                .mulAdd(growth, absolute);
            right[3] = edges_file.dot(Boxes, inverse.vector, .splat(grid.right)).mul(growth);
            down[3] = edges_file.dot(Boxes, inverse.vector, .splat(grid.down)).mul(growth);
            const most = right[3].maxFast(zero).add(down[3].maxFast(zero))
                .mulAdd(.splat(last), base[3]);
            const shrink = one.sub(inverse.relative).div(growth);
            const drop = absolute.add(absolute);
            if (behind) {
                const closest = right[3].minFast(zero).add(down[3].minFast(zero))
                    .mulAdd(.splat(last), base[3]).mul(shrink).sub(drop);
                there = there.andNot(inverse.decisive
                    .bitAnd(closest.ge(.splat(search.starts.tile_upper))));
            }
            const open = there.andNot(inverse.decisive);
            var undecided: u32 = 0;
            if (open.any()) undecided = open.bitAnd(mayTouch(&base, &right, &down, slack)).bits();
            var rest = there.bitAnd(inverse.decisive)
                .bitAnd(most.gt(.splat(search.found.tile_lower))).bits();
            const first: exact.Slot = @intCast(block_index * width);
            if (rest | undecided == 0) return;
            var window = Window.everywhere;
            // Bounds tell more than edges of small triangles only.
            const small = edges.facet.length.mul(.splat(search.dual.gain))
                .lt(edges.facet.reach.mul(.splat(side)));
            if (small.any()) {
                window = search.windowOf(corners, edges.facet.reach);
                rest &= window.holds_pixels.bits();
                undecided &= window.holds_pixels.bits();
                if (rest | undecided == 0) return;
            }
            var table: Table = undefined;
            window.first_x.store(&table.first_x);
            window.first_y.store(&table.first_y);
            window.last_x.store(&table.last_x);
            window.last_y.store(&table.last_y);
            inline for (0..4) |index| {
                base[index].store(&table.base[index]);
                right[index].store(&table.right[index]);
                down[index].store(&table.down[index]);
            }
            slack.add(slack).store(&table.slack);
            shrink.store(&table.shrink);
            drop.store(&table.drop);
            const skipped: u32 = if (behind) search.starts.skipped(Boxes, primitive) else 0;
            while (rest != 0) : (rest &= rest - 1) {
                const lane = @ctz(rest);
                var coverage = table.at(lane, first);
                if (behind and skipped >> @intCast(lane) & 1 != 0)
                    coverage.skipped = @bitCast(block.primitive[lane]);
                search.cover(&coverage);
            }
            while (undecided != 0) : (undecided &= undecided - 1) {
                search.coverUndecided(&table.at(@ctz(undecided), first));
            }
        }

        /// Columns and rows of pixels that triangles may be seen in.
        const Window = struct {
            first_x: Boxes.I32,
            first_y: Boxes.I32,
            last_x: Boxes.I32,
            last_y: Boxes.I32,
            holds_pixels: Boxes.Mask,

            const everywhere: Window = .{
                .first_x = .splat(0),
                .first_y = .splat(0),
                .last_x = .splat(side - 1),
                .last_y = .splat(side - 1),
                .holds_pixels = .splat(true),
            };
        };

        /// Where triangles in lanes may be seen, by their corners; everywhere if some corner is not
        /// in front of the origin. A corner's place is off by less than 8 u G |c| / t for G as in
        /// `Dual`, the exact test's displacement of corners included.
        inline fn windowOf(search: *const Self, corners: [3]Boxes.Vec3, reach: Boxes.F32) Window {
            const B = Boxes.F32;
            const dual = &search.dual;
            const from: Boxes.Vec3 = .splat(search.grid.origin);
            var low_x: B = .splat(std.math.inf(f32));
            var low_y = low_x;
            var high_x: B = .splat(-std.math.inf(f32));
            var high_y = high_x;
            var least_t = low_x;
            var greatest_inverse: B = .zero();
            inline for (corners) |corner| {
                const offset = corner.sub(from);
                const t = edges_file.dot(Boxes, offset, .splat(dual.depth));
                const inverse = B.splat(1).div(t);
                const x = edges_file.dot(Boxes, offset, .splat(dual.column)).mul(inverse);
                const y = edges_file.dot(Boxes, offset, .splat(dual.row)).mul(inverse);
                low_x = low_x.minFast(x);
                low_y = low_y.minFast(y);
                high_x = high_x.maxFast(x);
                high_y = high_y.maxFast(y);
                least_t = least_t.minFast(t);
                greatest_inverse = greatest_inverse.maxFast(inverse.abs());
            }
            var margin = reach.mul(greatest_inverse)
                .mul(.splat(16 * edges_file.unit_roundoff * dual.gain));
            if (behind) margin = greatest_inverse
                .mulAdd(.splat(search.window_apart[0]), margin).add(.splat(search.window_apart[1]));
            // Also where |t| is so small that rounding may have turned its sign.
            const bounded = least_t.gt(.zero()).bitAnd(margin.lt(.splat(side)));
            const zero: B = .zero();
            // Just below 1, so that a whole number stays what it is.
            const up: B = .splat(1 - 0x1p-10);
            const first_x = low_x.sub(margin).add(up).maxFast(zero).minFast(.splat(side)).toI32();
            const first_y = low_y.sub(margin).add(up).maxFast(zero).minFast(.splat(side)).toI32();
            const past_x = high_x.add(margin).add(.splat(1)).maxFast(zero).minFast(.splat(side));
            const past_y = high_y.add(margin).add(.splat(1)).maxFast(zero).minFast(.splat(side));
            const one: Boxes.I32 = .splat(1);
            const all: Boxes.I32 = .splat(side - 1);
            const window: Window = .{
                .first_x = .select(bounded, first_x, .zero()),
                .first_y = .select(bounded, first_y, .zero()),
                .last_x = .select(bounded, past_x.toI32().sub(one), all),
                .last_y = .select(bounded, past_y.toI32().sub(one), all),
                .holds_pixels = undefined,
            };
            var result = window;
            result.holds_pixels = window.first_x.gt(window.last_x)
                .bitOr(window.first_y.gt(window.last_y)).bitNot();
            return result;
        }

        /// Lanes of triangles whose orientation is not known that the beam may touch: unless some
        /// edge function is surely negative all over, and another surely positive.
        fn mayTouch(
            base: *const [4]Boxes.F32,
            right: *const [4]Boxes.F32,
            down: *const [4]Boxes.F32,
            slack: Boxes.F32,
        ) Boxes.Mask {
            const zero: Boxes.F32 = .zero();
            var negative: Boxes.Mask = .splat(false);
            var positive: Boxes.Mask = .splat(false);
            for (base[0..3], right[0..3], down[0..3]) |b, r, d| {
                const most = r.max(zero).add(d.max(zero)).mulAdd(.splat(last), b);
                const least = r.min(zero).add(d.min(zero)).mulAdd(.splat(last), b);
                negative = negative.bitOr(most.lt(zero));
                positive = positive.bitOr(least.gt(slack.add(slack)));
            }
            return negative.bitAnd(positive).bitNot();
        }

        /// What lanes hold of several triangles, by lane.
        const Table = struct {
            base: [4][width]f32,
            right: [4][width]f32,
            down: [4][width]f32,
            slack: [width]f32,
            shrink: [width]f32,
            drop: [width]f32,
            first_x: [width]i32,
            first_y: [width]i32,
            last_x: [width]i32,
            last_y: [width]i32,

            inline fn at(table: *const Table, lane: u6, first: exact.Slot) Coverage {
                var coverage: Coverage = .{
                    .base = undefined,
                    .right = undefined,
                    .down = undefined,
                    .slack = table.slack[lane],
                    .shrink = table.shrink[lane],
                    .drop = table.drop[lane],
                    .first_x = @intCast(table.first_x[lane]),
                    .first_y = @intCast(table.first_y[lane]),
                    .last_x = @intCast(table.last_x[lane]),
                    .last_y = @intCast(table.last_y[lane]),
                    .slot = first + @as(exact.Slot, lane),
                    .skipped = ray_file.no_primitive,
                };
                inline for (0..4) |index| {
                    coverage.base[index] = table.base[index][lane];
                    coverage.right[index] = table.right[index][lane];
                    coverage.down[index] = table.down[index][lane];
                }
                return coverage;
            }
        };

        /// Steps a triangle over the blocks of pixels and goes on with those it may be seen in.
        inline fn cover(search: *Self, coverage: *const Coverage) void {
            var candidates = coverage.subtiles();
            if (@popCount(candidates) > few_blocks) candidates &= search.blocksOf(coverage);
            while (candidates != 0) : (candidates &= candidates - 1) {
                search.coverBlock(coverage, @ctz(candidates));
            }
        }

        /// The blocks that a triangle may be seen in, but for those that it surely fills, before
        /// all that is known there: these are done.
        inline fn blocksOf(search: *Self, coverage: *const Coverage) u32 {
            var start: [4]F32 = undefined;
            var span: [4]F32 = undefined;
            inline for (&start, &span, 0..) |*to, *by, index| {
                const r = block_last * coverage.right[index];
                const d = block_last * coverage.down[index];
                const most = (if (r > 0) r else 0) + (if (d > 0) d else 0);
                to.* = .splat(coverage.base[index] + most);
                by.* = .splat(@abs(r) + @abs(d));
            }
            var blocks: u32 = 0;
            inline for (0..pack_count / lanes) |part| {
                const first = part * lanes;
                const x: F32 = .fromArray(Found.block_x[first..][0..lanes].*);
                const y: F32 = .fromArray(Found.block_y[first..][0..lanes].*);
                var most: [4]F32 = undefined;
                inline for (&most, start, coverage.right, coverage.down) |*to, from, r, d| {
                    to.* = x.mulAdd(.splat(r), y.mulAdd(.splat(d), from));
                }
                const outside = most[0].minOrNegative(most[1]).minOrNegative(most[2]).isNegative();
                const known: F32 = .loadAligned(search.found.ofBlocks("block_lower", first));
                var seen = most[3].gt(known).andNot(outside);
                const least = most[0].sub(span[0]).minOrNegative(most[1].sub(span[1]))
                    .minOrNegative(most[2].sub(span[2]));
                var covered = seen.bitAnd(least.gt(.splat(coverage.slack)));
                if (behind) {
                    const lowest = most[3].sub(span[3])
                        .mulAdd(.splat(coverage.shrink), .splat(-coverage.drop));
                    seen = seen.andNot(lowest.ge(search.starts.of("block_upper", first)));
                    covered = covered.bitAnd(most[3].lt(search.starts.of("block_lower", first)));
                    if (coverage.skipped != ray_file.no_primitive) covered = .splat(false);
                }
                if (covered.any()) {
                    const depth = .{ most[3].sub(span[3]), most[3] };
                    seen = seen.andNot(search.fill(coverage, first, covered, depth));
                }
                blocks |= seen.bits() << @intCast(first);
            }
            return blocks;
        }

        /// Of the blocks from `first` on that a triangle covers, those where it comes first. With
        /// the least and the greatest upper bound of 1/t in each.
        inline fn fill(
            search: *Self,
            coverage: *const Coverage,
            first: usize,
            covered: Rays.Mask,
            depth: [2]F32,
        ) Rays.Mask {
            const lower = depth[0].mulAdd(.splat(coverage.shrink), .splat(-coverage.drop));
            const known: F32 = .loadAligned(search.found.ofBlocks("block_upper", first));
            const filled = covered.bitAnd(lower.gt(known));
            if (filled.any()) search.found.fill(first, filled, coverage.slot, &.{
                .base = coverage.base[3],
                .right = coverage.right[3],
                .down = coverage.down[3],
                .shrink = coverage.shrink,
                .drop = coverage.drop,
            }, lower, depth[1]);
            return filled;
        }

        /// Steps a triangle over the pixels of a block.
        inline fn coverBlock(search: *Self, coverage: *const Coverage, block: u32) void {
            if (search.found.isWhole(block)) search.found.spread(block);
            const x: F32 = .fromArray(Kernel.lane_x);
            const y: F32 = .fromArray(Kernel.lane_y);
            const top = block / (side / subtile_side) * subtile_side;
            const row_first = (@max(coverage.first_y, top) - top) / Kernel.group_height;
            const row_last = (@min(coverage.last_y, top + subtile_side - 1) - top) /
                Kernel.group_height;
            const first: f32 = @floatFromInt(row_first * Kernel.group_height);
            var value: [4]F32 = undefined;
            var step: [4]F32 = undefined;
            inline for (0..4) |index| {
                const r = coverage.right[index];
                const d = coverage.down[index];
                const base = coverage.base[index] + Found.block_x[block] * r +
                    (Found.block_y[block] + first) * d;
                var start: F32 = .splat(base);
                if (Kernel.group_height > 1) start = y.mulAdd(.splat(d), start);
                value[index] = x.mulAdd(.splat(r), start);
                step[index] = .splat(d * Kernel.group_height);
            }
            var changed = false;
            var row = row_first;
            while (true) {
                const group = block * Kernel.subtile_groups + row;
                const lower = search.found.of("lower", group);
                const least = value[0].minOrNegative(value[1]).minOrNegative(value[2]);
                const known: F32 = .loadAligned(lower);
                var possible = value[3].gt(known).andNot(least.isNegative());
                const surely = value[3].mulAdd(.splat(coverage.shrink), .splat(-coverage.drop));
                const pixel = group * lanes;
                if (behind) {
                    possible = possible.andNot(surely.ge(search.starts.of("upper", pixel)));
                    if (coverage.skipped != ray_file.no_primitive) possible = possible
                        .andNot(search.bundle.groups[group].skip.eq(.splat(coverage.skipped)));
                }
                if (possible.any()) {
                    const upper = search.found.of("upper", group);
                    const slots = search.found.of("slot", group);
                    var certain = least.gt(.splat(coverage.slack))
                        .bitAnd(surely.gt(.loadAligned(upper)));
                    if (behind) certain = certain.bitAnd(possible)
                        .bitAnd(value[3].lt(search.starts.of("lower", pixel)));
                    F32.select(certain, surely, known).storeAligned(lower);
                    F32.select(certain, value[3], .loadAligned(upper)).storeAligned(upper);
                    Rays.I32.select(certain, .splat(coverage.slot), .loadAligned(slots))
                        .storeAligned(slots);
                    const doubtful = possible.andNot(certain);
                    if (doubtful.any()) {
                        search.decide(coverage.slot, group, doubtful, surely, value[3]);
                    }
                    changed = true;
                }
                if (row == row_last) break;
                row += 1;
                inline for (&value, step) |*to, by| to.* = to.add(by);
            }
            if (changed) search.found.boundBlock(block);
        }

        /// Asks the exact test about rays that a triangle comes near to. With bounds of 1/t there:
        /// where they tell it from what has been found before, nothing else is asked.
        fn decide(
            search: *Self,
            slot: exact.Slot,
            group: usize,
            doubtful: Rays.Mask,
            lower: F32,
            upper: F32,
        ) void {
            @branchHint(.unlikely);
            const ray = &search.bundle.groups[group];
            const pad = search.geometry.pad;
            const hit = exact.meet(Kernel, search.tree, pad, ray, slot);
            var met = hit.mask.bitAnd(doubtful);
            var t = hit.t;
            if (behind) {
                const number: Rays.I32 = .splat(exact.primitiveAt(width, search.tree, slot));
                met = met.bitAnd(Starts(Kernel).counted(ray, hit.t, number));
                t = t.add(search.starts.t[group]);
            }
            const known_lower = search.found.of("lower", group);
            const known_upper = search.found.of("upper", group);
            const slots = search.found.of("slot", group);
            const nearer = met.bitAnd(lower.gt(.loadAligned(known_upper)));
            const unclear = met.bitAnd(hit.t.gt(.zero())).andNot(nearer);
            const first = exact
                .comeFirst(Kernel, search.tree, pad, ray, unclear, hit.t, slot, slots);
            const inverse = F32.splat(1).div(t);
            const below = inverse.mul(.splat(1 - 4 * edges_file.unit_roundoff));
            const above = inverse.mul(.splat(1 + 4 * edges_file.unit_roundoff));
            F32.select(nearer, lower, .select(first, below, .loadAligned(known_lower)))
                .storeAligned(known_lower);
            F32.select(nearer, upper, .select(first, above, .loadAligned(known_upper)))
                .storeAligned(known_upper);
            Rays.I32.select(nearer.bitOr(first), .splat(slot), .loadAligned(slots))
                .storeAligned(slots);
        }

        /// A triangle seen edge-on, or out of all measure: pixels are left to the exact test unless
        /// some edge function is surely negative and another surely positive.
        fn coverUndecided(search: *Self, coverage: *const Coverage) void {
            @branchHint(.unlikely);
            const slack: F32 = .splat(coverage.slack);
            const x: F32 = .fromArray(Kernel.lane_x);
            const y: F32 = .fromArray(Kernel.lane_y);
            search.found.spreadAll();
            for (&search.bundle.groups, 0..) |*ray, group| {
                const first_x: F32 = .splat(@floatFromInt(Kernel.pixelX(group, 0)));
                const first_y: F32 = .splat(@floatFromInt(Kernel.pixelY(group, 0)));
                var negative: Rays.Mask = .splat(false);
                var positive: Rays.Mask = .splat(false);
                for (coverage.base[0..3], coverage.right[0..3], coverage.down[0..3]) |b, r, d| {
                    const value = first_x.add(x)
                        .mulAdd(.splat(r), first_y.add(y).mulAdd(.splat(d), .splat(b)));
                    negative = negative.bitOr(value.lt(.zero()));
                    positive = positive.bitOr(value.gt(slack));
                }
                const doubtful = ray.active.andNot(negative.bitAnd(positive));
                // Nothing is known of 1/t.
                const none: F32 = .splat(-std.math.inf(f32));
                if (doubtful.any()) search.decide(coverage.slot, group, doubtful, none, none);
            }
            for (0..pack_count) |block| search.found.boundBlock(block);
        }
    };
}
