//! Shadow rays of one light, as few beams: which points does it not reach?
//!
//! In: a bundle whose active rays come from a point light, or go parallel to a directional one.
//! Out: which of them meet anything. A beam is a set of rays, which end in points on a plane
//! (points.zig), and is cut in two where depth jumps. On the same plane triangles have footprints
//! (footprint.zig), which are tested against blocks of 4x4 pixels, then against the points in them.
//! A beam that is too wide, by the triangles it meets and has still to visit, or has few rays,
//! leaves them to find company (interval_packet.zig). In doubt, the exact test decides.

const std = @import("std");
const world_file = @import("../../../world.zig");
const TestCounts = @import("../../../statistics.zig").TestCounts;
const kernel_file = @import("../kernel.zig");
const ray_file = @import("../ray.zig");
const bundle_file = @import("../bundle.zig");
const interval_packet = @import("../interval_packet.zig");
const stack = @import("../stack.zig");
const walk = @import("../walk.zig");
const edges_file = @import("edges.zig");
const exact = @import("exact.zig");
const footprint_file = @import("projected_triangle.zig");
const frustum_file = @import("frustum.zig");
const points_file = @import("shadow_receivers.zig");
const Cost = @import("budget.zig").Cost;
const assert = std.debug.assert;
const Members = points_file.Members;
const pack_count = kernel_file.beam_subtiles;

/// Cuts of a beam at most, one after the other.
const cut_depth_max = 1;
/// Beams of fewer rays are not worth their set-up.
const beam_rays_min = 8;
/// With no more blocks than this, triangles are not tested against each of them first.
const few_blocks = 3;

/// Finds which rays meet anything; `closest.primitive` of those becomes one that they meet. Asserts
/// that all active rays start at the light's place, or go against its direction.
pub fn trace(
    comptime Kernel: type,
    geometry: *const world_file.Geometry,
    light: *const world_file.Light,
    bundle: *bundle_file.Bundle(Kernel),
    counts: *TestCounts,
) void {
    var search: Search(Kernel) = .{
        .geometry = geometry,
        .tree = geometry.tree.get(Kernel.width),
        .light = light,
        .bundle = bundle,
        .counts = counts,
    };
    search.run();
}

fn Search(comptime Kernel: type) type {
    const Boxes = Kernel.Boxes;
    const Rays = Kernel.Rays;
    const width = Kernel.width;
    const lanes = Kernel.ray_count;
    return struct {
        geometry: *const world_file.Geometry,
        tree: *const world_file.Tree(width),
        light: *const world_file.Light,
        bundle: *bundle_file.Bundle(Kernel),
        counts: *TestCounts,
        points: Points = undefined,
        /// Of the rays that go without a beam.
        budget: interval_packet.PacketBudget = .{},

        const Self = @This();
        const Points = points_file.Points(Kernel);
        const Frustum = frustum_file.Frustum(Boxes);
        const F32 = Rays.F32;
        const Mask = Rays.Mask;
        const inf = std.math.inf(f32);

        const Waiting = struct { members: Members, depth: u32 };

        fn run(search: *Self) void {
            // A cut leaves two sets for one; rays that do not fit leave one more, at most 3 times.
            var waiting: [4 * cut_depth_max + 8]Waiting = undefined;
            waiting[0] = .{ .members = Points.membersOf(search.bundle), .depth = 0 };
            var waiting_count: usize = 1;
            while (waiting_count > 0) {
                waiting_count -= 1;
                var set = waiting[waiting_count];
                const ray_count = Points.rayCount(&set.members);
                if (ray_count < beam_rays_min or waiting_count + 3 > waiting.len) {
                    search.apart(&set.members);
                    continue;
                }
                const rest = search.points.place(search.light, search.bundle, &set.members);
                if (Points.rayCount(&rest) > 0) {
                    if (Points.rayCount(&set.members) == 0) {
                        search.apart(&rest);
                        continue;
                    }
                    waiting[waiting_count] = .{ .members = rest, .depth = set.depth };
                    waiting_count += 1;
                }
                if (set.depth < cut_depth_max) {
                    if (search.points.cut(&set.members)) |below| {
                        var half = below;
                        for (&half, &set.members) |*one, *both| {
                            one.* &= both.*;
                            both.* &= ~one.*;
                        }
                        const depth = set.depth + 1;
                        waiting[waiting_count] = .{ .members = half, .depth = depth };
                        waiting[waiting_count + 1] = .{ .members = set.members, .depth = depth };
                        waiting_count += 2;
                        continue;
                    }
                }
                search.travel(&set.members);
            }
        }

        /// Rays of a set without a beam.
        fn apart(search: *Self, members: *const Members) void {
            const groups = &search.bundle.groups;
            var active_before: [Kernel.group_count]Mask = undefined;
            for (&active_before, groups, 0..) |*mask, *group, at| {
                mask.* = group.active;
                group.active = Points.groupOf(members, at);
            }
            const bundle = search.bundle;
            const budget = &search.budget;
            interval_packet.trace(Kernel, .any_hit, search.geometry, bundle, budget, search.counts);
            for (active_before, groups) |mask, *group| group.active = mask;
        }

        fn travel(search: *Self, members: *const Members) void {
            const frustum = search.points.frustumOf(search.geometry.pad);
            var entries: [Kernel.stack_max]stack.Entry = undefined;
            entries[0] = .{ .child = .root, .near = -inf };
            var entry_count: usize = 1;
            var cost: Cost = .of(width, Points.rayCount(members));
            while (entry_count > 0 and search.points.live != 0) {
                entry_count -= 1;
                const child = entries[entry_count].child;
                if (child.pack_count == 0) {
                    assert(entry_count + width <= Kernel.stack_max);
                    const node = &search.tree.nodes[child.target];
                    walk.countNode(Kernel, node, search.counts);
                    const depth_max = search.points.bounds.depth;
                    entry_count = frustum
                        .pushChildren(node, null, depth_max, &entries, entry_count);
                    continue;
                }
                if (!cost.pays(child.pack_count, entry_count)) {
                    return search.apart(&search.points.left(members));
                }
                const first, const end = child.packs();
                for (first..end) |index| {
                    search.meetBlock(&frustum, @intCast(index));
                }
            }
        }

        /// Sets up the triangles of a block and goes on with those that may stand in the way.
        ///
        /// Long: a score of lane values live through it, and stay in registers only here.
        fn meetBlock(search: *Self, frustum: *const Frustum, block_index: u32) void {
            @setEvalBranchQuota(4000);
            const block_ = &search.tree.packs[block_index];
            walk.countPack(Kernel, block_, search.counts);
            var corners: [3]Boxes.Vec3 = undefined;
            inline for (&corners, &block_.corner) |*corner, *components| corner.* = .{
                .x = .load(&components[0]),
                .y = .load(&components[1]),
                .z = .load(&components[2]),
            };
            const primitive: Boxes.I32 = .load(@ptrCast(&block_.primitive));
            var there = primitive.gt(.splat(ray_file.no_primitive))
                .bitAnd(frustum.mayMeet(corners));
            if (there.none()) return;
            const projection = &search.points.projection;
            const reach_max = edges_file.reachMax(search.geometry.pad);
            const print: footprint_file.Footprint(Boxes) =
                .init(corners, projection, search.points.slope_max, reach_max);
            const bounds = &search.points.bounds;
            const B = Boxes.F32;
            // Upper bounds from here on.
            var linear: [4]footprint_file.Linear(Boxes) = print.edge ++ .{undefined};
            var along_u: [3]B = undefined;
            var along_v: [3]B = undefined;
            var least: B = .splat(inf);
            inline for (linear[0..3], &along_u, &along_v) |*form, *by_u, *by_v| {
                form.one = form.one.add(print.slack);
                by_u.*, by_v.* = search.inBasis(form);
                least = least.minOrNegative(maxOver(by_u.*, bounds.u)
                    .add(maxOver(by_v.*, bounds.v)).add(form.one));
            }
            there = there.andNot(print.facet.turned.bitAnd(least.isNegative()));
            if (there.none()) return;
            const nearness = print.nearness(projection, search.points.slope_max);
            const growth = B.splat(1).add(nearness.relative);
            linear[3] = .{
                .u = nearness.form.u.mul(growth),
                .v = nearness.form.v.mul(growth),
                .one = nearness.form.one.mulAdd(growth, nearness.absolute),
            };
            const near_by_u, const near_by_v = search.inBasis(&linear[3]);
            const most = maxOver(near_by_u, bounds.u)
                .add(maxOver(near_by_v, bounds.v)).add(linear[3].one);
            const directional = projection.slope != null;
            const farthest = if (directional) -bounds.depth else 1 / bounds.depth;
            const open = there.andNot(nearness.decisive);
            var undecided: u32 = 0;
            if (open.any()) undecided = open
                .bitAnd(search.mayTouch(&along_u, &along_v, &linear, print.slack)).bits();
            var rest = there.bitAnd(nearness.decisive).bitAnd(most.gt(.splat(farthest))).bits();
            const first: exact.Slot = @intCast(block_index * width);
            if (rest | undecided == 0) return;
            var window = Window.everywhere;
            // Bounds tell more than edges of small triangles only.
            const extent = bounds.extent() * (if (directional) 1 else bounds.depth);
            if (print.facet.length.lt(.splat(extent)).any()) {
                window = search.windowOf(corners, print.facet.reach);
                rest &= window.u[1].ge(.splat(bounds.u[0]))
                    .bitAnd(window.u[0].le(.splat(bounds.u[1])))
                    .bitAnd(window.v[1].ge(.splat(bounds.v[0])))
                    .bitAnd(window.v[0].le(.splat(bounds.v[1]))).bits();
                if (rest | undecided == 0) return;
            }
            var table: Table = undefined;
            inline for (0..2) |end| {
                window.u[end].store(&table.window_u[end]);
                window.v[end].store(&table.window_v[end]);
            }
            inline for (0..4) |index| {
                linear[index].u.store(&table.u[index]);
                linear[index].v.store(&table.v[index]);
                linear[index].one.store(&table.one[index]);
            }
            inline for (0..3) |index| {
                along_u[index].store(&table.along_u[index]);
                along_v[index].store(&table.along_v[index]);
            }
            print.slack.add(print.slack).store(&table.slack);
            B.splat(1).sub(nearness.relative).div(growth).store(&table.shrink);
            nearness.absolute.add(nearness.absolute).store(&table.drop);
            while (rest != 0) : (rest &= rest - 1) {
                const lane = @ctz(rest);
                search.cover(&table.at(lane, first, block_.primitive[lane]));
            }
            while (undecided != 0) : (undecided &= undecided - 1) {
                const lane = @ctz(undecided);
                search.coverUndecided(&table.at(lane, first, block_.primitive[lane]));
            }
        }

        /// Bounds of triangles in the axes of the parallelogram.
        const Window = struct {
            u: [2]Boxes.F32,
            v: [2]Boxes.F32,

            const everywhere: Window = .{
                .u = .{ .splat(-inf), .splat(inf) },
                .v = .{ .splat(-inf), .splat(inf) },
            };
        };

        /// Bounds of triangles by their corners; none if a corner is not in front of a point light.
        /// A corner's u or v is off by less than 6 u |c| / depth, the exact test's displacement of
        /// corners by as much again.
        inline fn windowOf(search: *const Self, corners: [3]Boxes.Vec3, reach: Boxes.F32) Window {
            const B = Boxes.F32;
            const projection = &search.points.projection;
            const basis = &search.points.basis;
            const from: Boxes.Vec3 = .splat(projection.origin);
            const endless: B = .splat(inf);
            var window: Window = .{
                .u = .{ endless, endless.neg() },
                .v = .{ endless, endless.neg() },
            };
            var least_depth = endless;
            inline for (corners) |corner| {
                const on_plane = footprint_file.project(Boxes, projection, corner.sub(from));
                const u = on_plane.u.mulAdd(.splat(basis.i00), on_plane.v.mul(.splat(basis.i01)));
                const v = on_plane.u.mulAdd(.splat(basis.i10), on_plane.v.mul(.splat(basis.i11)));
                window.u = .{ window.u[0].minFast(u), window.u[1].maxFast(u) };
                window.v = .{ window.v[0].minFast(v), window.v[1].maxFast(v) };
                least_depth = least_depth.minFast(on_plane.depth);
            }
            const unit: B = .splat(16 * edges_file.unit_roundoff * basis.norm());
            const flat = projection.slope != null;
            const margin = if (flat) reach.mul(unit) else reach.div(least_depth).mul(unit);
            var bounded = margin.lt(.splat(if (flat) inf else 1));
            if (!flat) bounded = bounded.bitAnd(least_depth.gt(.zero()));
            return .{
                .u = .{
                    .select(bounded, window.u[0].sub(margin), endless.neg()),
                    .select(bounded, window.u[1].add(margin), endless),
                },
                .v = .{
                    .select(bounded, window.v[0].sub(margin), endless.neg()),
                    .select(bounded, window.v[1].add(margin), endless),
                },
            };
        }

        /// Lanes of triangles whose orientation is not known that the beam may touch: unless some
        /// edge function is surely negative all over, and another surely positive.
        fn mayTouch(
            search: *const Self,
            along_u: *const [3]Boxes.F32,
            along_v: *const [3]Boxes.F32,
            linear: *const [4]footprint_file.Linear(Boxes),
            slack: Boxes.F32,
        ) Boxes.Mask {
            const bounds = &search.points.bounds;
            var negative: Boxes.Mask = .splat(false);
            var positive: Boxes.Mask = .splat(false);
            for (along_u, along_v, linear[0..3]) |u, v, form| {
                const most = maxOver(u, bounds.u).add(maxOver(v, bounds.v)).add(form.one);
                const less = maxOver(u.neg(), bounds.u).add(maxOver(v.neg(), bounds.v));
                negative = negative.bitOr(most.lt(.zero()));
                positive = positive.bitOr(form.one.sub(less).gt(slack.add(slack)));
            }
            return negative.bitAnd(positive).bitNot();
        }

        /// What lanes hold of several triangles, by lane.
        const Table = struct {
            u: [4][width]f32,
            v: [4][width]f32,
            one: [4][width]f32,
            along_u: [3][width]f32,
            along_v: [3][width]f32,
            slack: [width]f32,
            shrink: [width]f32,
            drop: [width]f32,
            window_u: [2][width]f32,
            window_v: [2][width]f32,

            inline fn at(
                table: *const Table,
                lane: u6,
                first: exact.Slot,
                primitive: u32,
            ) Coverage {
                var coverage: Coverage = .{
                    .u = undefined,
                    .v = undefined,
                    .one = undefined,
                    .along_u = undefined,
                    .along_v = undefined,
                    .slack = table.slack[lane],
                    .shrink = table.shrink[lane],
                    .drop = table.drop[lane],
                    .window_u = .{ table.window_u[0][lane], table.window_u[1][lane] },
                    .window_v = .{ table.window_v[0][lane], table.window_v[1][lane] },
                    .slot = first + @as(exact.Slot, lane),
                    .primitive = @bitCast(primitive),
                };
                inline for (0..4) |index| {
                    coverage.u[index] = table.u[index][lane];
                    coverage.v[index] = table.v[index][lane];
                    coverage.one[index] = table.one[index][lane];
                }
                inline for (0..3) |index| {
                    coverage.along_u[index] = table.along_u[index][lane];
                    coverage.along_v[index] = table.along_v[index][lane];
                }
                return coverage;
            }
        };

        /// A linear form's factors of the coordinates in the axes of the parallelogram.
        inline fn inBasis(
            search: *const Self,
            form: *const footprint_file.Linear(Boxes),
        ) struct { Boxes.F32, Boxes.F32 } {
            const basis = &search.points.basis;
            return .{
                form.u.mulAdd(.splat(basis.b00), form.v.mul(.splat(basis.b10))),
                form.u.mulAdd(.splat(basis.b01), form.v.mul(.splat(basis.b11))),
            };
        }

        inline fn maxOver(factor: Boxes.F32, range: [2]f32) Boxes.F32 {
            return factor.mul(.splat(range[0])).maxFast(factor.mul(.splat(range[1])));
        }

        /// One triangle's edge functions and nearness: upper bounds, and how far below them lower
        /// ones are, by as much for edge functions, by a factor and then as much for nearness.
        const Coverage = struct {
            u: [4]f32,
            v: [4]f32,
            one: [4]f32,
            /// Edge functions in the axes of the parallelogram.
            along_u: [3]f32,
            along_v: [3]f32,
            slack: f32,
            shrink: f32,
            drop: f32,
            /// Bounds in the axes of the parallelogram.
            window_u: [2]f32,
            window_v: [2]f32,
            slot: exact.Slot,
            primitive: i32,
        };

        /// Goes on with the blocks of rays that a triangle may stand before.
        inline fn cover(search: *Self, coverage: *const Coverage) void {
            var candidates = search.points.live;
            if (@popCount(candidates) > few_blocks) candidates &= search.blocksOf(coverage);
            while (candidates != 0) : (candidates &= candidates - 1) {
                search.coverBlock(coverage, @ctz(candidates));
            }
        }

        inline fn blocksOf(search: *Self, coverage: *const Coverage) u32 {
            var blocks: u32 = 0;
            inline for (0..pack_count / lanes) |part| {
                const first = part * lanes;
                var least: F32 = .splat(inf);
                inline for (0..3) |index| {
                    const du = coverage.along_u[index];
                    const dv = coverage.along_v[index];
                    const u = Points.lanesOf(&search.points.block_u[@intFromBool(du > 0)], first);
                    const v = Points.lanesOf(&search.points.block_v[@intFromBool(dv > 0)], first);
                    const most = u.mulAdd(.splat(du), v.mulAdd(.splat(dv), .splat(
                        coverage.one[index],
                    )));
                    least = least.minOrNegative(most);
                }
                const window_u = coverage.window_u;
                const window_v = coverage.window_v;
                const block_u = &search.points.block_u;
                const block_v = &search.points.block_v;
                const met = Points.lanesOf(&block_u[0], first).le(.splat(window_u[1]))
                    .bitAnd(Points.lanesOf(&block_u[1], first).ge(.splat(window_u[0])))
                    .bitAnd(Points.lanesOf(&block_v[0], first).le(.splat(window_v[1])))
                    .bitAnd(Points.lanesOf(&block_v[1], first).ge(.splat(window_v[0])))
                    .andNot(least.isNegative());
                blocks |= met.bits() << first;
            }
            return blocks;
        }

        /// Tests a triangle against the rays of a block.
        inline fn coverBlock(search: *Self, coverage: *const Coverage, index: u32) void {
            var any_met = false;
            inline for (0..Kernel.subtile_groups) |row| {
                const group = index * Kernel.subtile_groups + row;
                const first = group * lanes;
                const u = Points.lanesOf(&search.points.u, first);
                const v = Points.lanesOf(&search.points.v, first);
                var value: [4]F32 = undefined;
                inline for (&value, coverage.u, coverage.v, coverage.one) |*to, cu, cv, c1| {
                    to.* = u.mulAdd(.splat(cu), v.mulAdd(.splat(cv), .splat(c1)));
                }
                const near = Points.lanesOf(&search.points.nearness, first);
                const least = value[0].minOrNegative(value[1]).minOrNegative(value[2]);
                var possible = value[3].gt(near).andNot(least.isNegative());
                if (possible.any()) {
                    const own = search.bundle.groups[group].skip.eq(.splat(coverage.primitive));
                    possible = possible.andNot(own);
                    const surely = value[3].mulAdd(.splat(coverage.shrink), .splat(-coverage.drop));
                    const before = possible.bitAnd(surely.gt(near));
                    const certain = before.bitAnd(least.gt(.splat(coverage.slack)));
                    const doubtful = possible.andNot(certain);
                    any_met = search.meet(coverage.slot, group, certain, doubtful, before) or
                        any_met;
                }
            }
            if (any_met) search.points.checkBlock(index);
        }

        /// Takes rays out that have met a triangle; `before` tells of those in doubt before which
        /// the triangle stands, if they pass within its edges. Returns whether there were any.
        inline fn meet(
            search: *Self,
            slot: exact.Slot,
            group: usize,
            certain: Mask,
            doubtful: Mask,
            before: Mask,
        ) bool {
            var met = certain;
            if (doubtful.any()) met = met.bitOr(search.decide(slot, group, doubtful, before));
            if (met.none()) return false;
            const first = group * lanes;
            const near = Points.lanesOf(&search.points.nearness, first);
            F32.select(met, .splat(inf), near)
                .storeAligned(@alignCast(search.points.nearness[first..][0..lanes]));
            const ray = &search.bundle.groups[group];
            const primitive: Rays.I32 = .splat(exact.primitiveAt(width, search.tree, slot));
            ray.closest.primitive = .select(met, primitive, ray.closest.primitive);
            return true;
        }

        /// Asks the exact test. Returns those of the rays in doubt that meet the triangle.
        fn decide(
            search: *Self,
            slot: exact.Slot,
            group: usize,
            doubtful: Mask,
            before: Mask,
        ) Mask {
            @branchHint(.unlikely);
            const ray = &search.bundle.groups[group];
            const hit = exact.meet(Kernel, search.tree, search.geometry.pad, ray, slot);
            const stands = hit.t.gt(.zero()).bitAnd(hit.t.lt(ray.closest.t));
            return doubtful.bitAnd(hit.mask).bitAnd(before.bitOr(stands));
        }

        /// A triangle seen edge-on, or out of all measure: rays are left to the exact test unless
        /// some edge function is surely negative and another surely positive.
        fn coverUndecided(search: *Self, coverage: *const Coverage) void {
            @branchHint(.unlikely);
            const slack: F32 = .splat(coverage.slack);
            for (0..Kernel.group_count) |group| {
                const block = group / Kernel.subtile_groups;
                if (search.points.live >> @intCast(block) & 1 == 0) continue;
                const first = group * lanes;
                const u = Points.lanesOf(&search.points.u, first);
                const v = Points.lanesOf(&search.points.v, first);
                const near = Points.lanesOf(&search.points.nearness, first);
                var negative: Mask = .splat(false);
                var positive: Mask = .splat(false);
                for (coverage.u[0..3], coverage.v[0..3], coverage.one[0..3]) |cu, cv, c1| {
                    const value = u.mulAdd(.splat(cu), v.mulAdd(.splat(cv), .splat(c1)));
                    negative = negative.bitOr(value.lt(.zero()));
                    positive = positive.bitOr(value.gt(slack));
                }
                const own = search.bundle.groups[group].skip.eq(.splat(coverage.primitive));
                const possible = near.lt(.splat(inf)).andNot(own)
                    .andNot(negative.bitAnd(positive));
                if (possible.none()) continue;
                if (search.meet(coverage.slot, group, .splat(false), possible, .splat(false))) {
                    search.points.checkBlock(@intCast(block));
                }
            }
        }
    };
}
