//! Shadow rays of one light, as few beams: which points does it not reach?
//!
//! In: a bundle whose active rays come from a point light, or go parallel to a directional one.
//! Out: which of them meet anything. Seen from the light, points lie on a plane (footprint.zig),
//! where those of a block of 4x4 pixels have bounds: a parallelogram, since a flat surface seen
//! aslant is one. A beam is a set of rays; where depth jumps the set covers far more of the plane
//! than its blocks do, and is cut in two there. A beam that meets too many blocks of triangles, or
//! has few rays, leaves them to find company by block (interval.zig). In doubt, the exact test
//! decides.

const std = @import("std");
const world_file = @import("../../world.zig");
const TestCounts = @import("../../statistics.zig").TestCounts;
const kernel_file = @import("../kernel.zig");
const ray_file = @import("../ray.zig");
const packet = @import("../packet.zig");
const interval = @import("../interval.zig");
const stack = @import("../stack.zig");
const edges_file = @import("edges.zig");
const exact = @import("exact.zig");
const footprint_file = @import("footprint.zig");
const frustum_file = @import("frustum.zig");
const assert = std.debug.assert;
const Projection = footprint_file.Projection;

const side = kernel_file.beam_side;
const block_count = kernel_file.beam_side * kernel_file.beam_side /
    (kernel_file.block_side * kernel_file.block_side);
const block_pixels = kernel_file.block_side * kernel_file.block_side;
const pixel_count = side * side;

/// A beam is cut where its bounds cover more than this many times what its blocks do.
const cut_ratio = 2.0;
/// Cuts of a beam at most, one after the other.
const cut_depth_max = 1;
/// Blocks of triangles that a beam may meet before its rays go on without it: so much work as the
/// rays of a tile would have by themselves, of which a part does not depend on the lanes.
fn meetingMax(comptime lanes: u32) u32 {
    return 30 + 240 / lanes;
}
/// Beams of fewer rays are not worth their set-up.
const beam_rays_min = 8;
/// Slopes at most; rays that go more sideways make a beam of their own.
const slope_limit = 4.0;
/// With no more blocks than this, triangles are not tested against each of them first.
const few_blocks = 3;

/// A set of rays: a bit for each pixel of each block.
const Members = [block_count]u16;

/// Finds which rays meet anything; `nearest.primitive` of those becomes a number. Asserts that
/// all active rays start at the light's place, or go against its direction.
pub fn trace(
    comptime Kernel: type,
    world: *const world_file.World,
    light: *const world_file.Light,
    bundle: *packet.Bundle(Kernel),
    counts: *TestCounts,
) void {
    var search: Search(Kernel) = .{
        .world = world,
        .tree = world.tree.get(Kernel.width),
        .light = light,
        .bundle = bundle,
        .counts = counts,
    };
    search.run();
}

/// Bounds on the light's plane, in the axes of the parallelogram.
const Bounds = struct {
    u: [2]f32 = .{ std.math.inf(f32), -std.math.inf(f32) },
    v: [2]f32 = .{ std.math.inf(f32), -std.math.inf(f32) },
    depth: f32 = -std.math.inf(f32),

    /// The longer side.
    fn extent(bounds: Bounds) f32 {
        return @max(bounds.u[1] - bounds.u[0], bounds.v[1] - bounds.v[0]);
    }

    fn area(bounds: Bounds) f32 {
        return (bounds.u[1] - bounds.u[0]) * (bounds.v[1] - bounds.v[0]);
    }
};

/// Axes of the parallelogram, and the way back: U = i00 u + i01 v, V = i10 u + i11 v.
const Basis = struct {
    b00: f32 = 1,
    b01: f32 = 0,
    b10: f32 = 0,
    b11: f32 = 1,
    i00: f32 = 1,
    i01: f32 = 0,
    i10: f32 = 0,
    i11: f32 = 1,

    /// The axes (x0, y0) and (x1, y1), unit vectors that are not parallel.
    fn init(x0: f32, y0: f32, x1: f32, y1: f32) Basis {
        const scale = 1 / (x0 * y1 - x1 * y0);
        return .{
            .b00 = x0,
            .b01 = x1,
            .b10 = y0,
            .b11 = y1,
            .i00 = y1 * scale,
            .i01 = -x1 * scale,
            .i10 = -y0 * scale,
            .i11 = x0 * scale,
        };
    }

    fn norm(basis: *const Basis) f32 {
        return @abs(basis.i00) + @abs(basis.i01) + @abs(basis.i10) + @abs(basis.i11);
    }
};

fn Search(comptime Kernel: type) type {
    const Boxes = Kernel.Boxes;
    const Rays = Kernel.Rays;
    const width = Kernel.width;
    const lanes = Kernel.ray_count;
    return struct {
        world: *const world_file.World,
        tree: *const world_file.Tree(width),
        light: *const world_file.Light,
        bundle: *packet.Bundle(Kernel),
        counts: *TestCounts,
        projection: Projection = undefined,
        basis: Basis = .{},
        slope_max: f32 = 0,
        bounds: Bounds = .{},
        /// Points on the light's plane by pixel, and how near to the light they are there;
        /// infinitely near if there is no ray or it has met something.
        u: [pixel_count]f32 align(64) = undefined,
        v: [pixel_count]f32 align(64) = undefined,
        nearness: [pixel_count]f32 align(64) = undefined,
        /// Bounds of every block; empty ones of blocks that are done.
        block_u: [2][block_count]f32 align(64) = undefined,
        block_v: [2][block_count]f32 align(64) = undefined,
        /// Blocks with rays that have met nothing yet.
        live: u32 = 0,

        const Self = @This();
        const Frustum = frustum_file.Frustum(Boxes);
        const F32 = Rays.F32;
        const Mask = Rays.Mask;
        const inf = std.math.inf(f32);

        const Waiting = struct { members: Members, depth: u32 };

        fn run(search: *Self) void {
            // A cut leaves two sets for one; rays that do not fit leave one more, at most 3 times.
            var waiting: [4 * cut_depth_max + 8]Waiting = undefined;
            waiting[0] = .{ .members = search.active(), .depth = 0 };
            var waiting_count: usize = 1;
            while (waiting_count > 0) {
                waiting_count -= 1;
                var set = waiting[waiting_count];
                if (rayCount(&set.members) < beam_rays_min or waiting_count + 3 > waiting.len) {
                    search.apart(&set.members);
                    continue;
                }
                const rest = search.place(&set.members);
                if (rayCount(&rest) > 0) {
                    if (rayCount(&set.members) == 0) {
                        search.apart(&rest);
                        continue;
                    }
                    waiting[waiting_count] = .{ .members = rest, .depth = set.depth };
                    waiting_count += 1;
                }
                if (set.depth < cut_depth_max) {
                    if (search.cut(&set.members)) |below| {
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

        fn rayCount(members: *const Members) u32 {
            var count: u32 = 0;
            for (members) |block| count += @popCount(block);
            return count;
        }

        fn active(search: *const Self) Members {
            var members: Members = @splat(0);
            for (&search.bundle.groups, 0..) |*group, index| {
                setGroup(&members, index, group.active.bits());
            }
            return members;
        }

        inline fn setGroup(members: *Members, group: usize, bits: u32) void {
            const shift: u4 = @intCast(group % Kernel.block_groups * lanes);
            members[group / Kernel.block_groups] |= @as(u16, @truncate(bits)) << shift;
        }

        inline fn groupOf(members: *const Members, group: usize) Mask {
            const shift: u4 = @intCast(group % Kernel.block_groups * lanes);
            const all: u16 = @intCast((@as(u32, 1) << lanes) - 1);
            return .fromBits(members[group / Kernel.block_groups] >> shift & all);
        }

        /// Rays of a set without a beam, block by block.
        fn apart(search: *Self, members: *const Members) void {
            const count = Kernel.block_groups;
            for (members, 0..) |block, index| {
                if (block == 0) continue;
                const groups = search.bundle.groups[index * count ..][0..count];
                var active_before: [count]Mask = undefined;
                for (&active_before, groups, index * count..) |*mask, *group, at| {
                    mask.* = group.active;
                    group.active = groupOf(members, at);
                }
                interval.trace(Kernel, .any, search.world, groups, search.counts);
                for (active_before, groups) |mask, *group| group.active = mask;
            }
        }

        /// Puts the rays of a set on the plane of the axis that suits most of them, and takes out
        /// those that do not fit on it, which are returned.
        fn place(search: *Self, members: *Members) Members {
            search.choosePlane(members);
            const projection = &search.projection;
            var unfit: Mask = .splat(false);
            var steepest: F32 = .zero();
            for (&search.bundle.groups, 0..) |*group, index| {
                const member = groupOf(members, index);
                const first = index * lanes;
                if (member.none()) {
                    F32.splat(inf).storeAligned(@alignCast(search.nearness[first..][0..lanes]));
                    continue;
                }
                const on_plane = search.placeGroup(group);
                const steep = on_plane.u.abs().maxFast(on_plane.v.abs());
                var fits = member;
                if (projection.slope == null) fits = fits.bitAnd(on_plane.depth.gt(.zero()))
                    .bitAnd(steep.le(.splat(slope_limit)));
                unfit = unfit.bitOr(member.andNot(fits));
                steepest = steepest.maxFast(.select(fits, steep, .zero()));
                const near = if (projection.slope == null)
                    F32.splat(1).div(on_plane.depth.mul(group.nearest.t))
                else
                    on_plane.depth.neg();
                on_plane.u.storeAligned(@alignCast(search.u[first..][0..lanes]));
                on_plane.v.storeAligned(@alignCast(search.v[first..][0..lanes]));
                F32.select(fits, near, .splat(inf))
                    .storeAligned(@alignCast(search.nearness[first..][0..lanes]));
            }
            var rest: Members = @splat(0);
            if (unfit.any()) {
                rest = members.*;
                members.* = search.left(&rest);
                for (&rest, members) |*one, fitting| one.* &= ~fitting;
            }
            search.slope_max = if (projection.slope) |slope|
                @max(@abs(slope[0]), @abs(slope[1]))
            else
                steepest.reduceMax();
            search.chooseBasis(members);
            search.bound(members);
            return rest;
        }

        inline fn placeGroup(
            search: *Self,
            group: *const ray_file.Ray(Rays),
        ) footprint_file.Place(Rays) {
            const projection = &search.projection;
            // A point light's rays are given by where t is 1; a directional one's start there.
            const point = if (projection.slope == null)
                group.line.direction
            else
                group.line.origin.sub(.splat(projection.origin));
            return footprint_file.project(Rays, projection, point);
        }

        /// The axis along which the light's way to these points is longest.
        fn choosePlane(search: *Self, members: *const Members) void {
            const directional = search.light.kind == .directional;
            var sum: Rays.Vec3 = .splat(.{ 0, 0, 0 });
            var some: ?[3]f32 = null;
            // One group of a block is enough to choose by.
            for (members, 0..) |set, at| {
                if (set == 0) continue;
                const index = at * Kernel.block_groups + @ctz(set) / lanes;
                const group = &search.bundle.groups[index];
                const member = groupOf(members, index);
                const vector = if (directional) group.line.origin else group.line.direction;
                if (some == null) some = vector.lane(@ctz(member.bits()));
                sum = sum.add(.select(member, vector, .splat(.{ 0, 0, 0 })));
            }
            const way = if (directional)
                search.light.direction
            else
                [3]f32{ sum.x.reduceSum(), sum.y.reduceSum(), sum.z.reduceSum() };
            var axis: u2 = 0;
            for (1..3) |other| {
                if (@abs(way[other]) > @abs(way[axis])) axis = @intCast(other);
            }
            search.projection = .{
                .origin = if (directional) some.? else search.light.position,
                .axis = axis,
                .sign = if (way[axis] < 0) -1 else 1,
                .slope = if (directional) .{
                    way[ray_file.turnedIndex(axis, 0)] / way[axis],
                    way[ray_file.turnedIndex(axis, 1)] / way[axis],
                } else null,
            };
            if (directional) search.projection.reach = search.reachOf(members);
        }

        /// The largest distance of a directional light's points from the origin of the plane.
        fn reachOf(search: *const Self, members: *const Members) f32 {
            var farthest: F32 = .zero();
            for (&search.bundle.groups, 0..) |*group, index| {
                const member = groupOf(members, index);
                if (member.none()) continue;
                const apart_ = group.line.origin.sub(.splat(search.projection.origin));
                const distance = apart_.dot(apart_);
                farthest = farthest.maxFast(.select(member, distance, .zero()));
            }
            return @sqrt(farthest.reduceMax());
        }

        /// Axes along the rows and columns of pixels, if the corners of the bundle are members.
        fn chooseBasis(search: *Self, members: *const Members) void {
            search.basis = .{};
            const corners = comptime cornerPixels();
            for (corners) |pixel| {
                const block = members[pixel / block_pixels];
                if (block >> @intCast(pixel % block_pixels) & 1 == 0) return;
            }
            const u = [4]f32{
                search.u[corners[0]], search.u[corners[1]],
                search.u[corners[2]], search.u[corners[3]],
            };
            const v = [4]f32{
                search.v[corners[0]], search.v[corners[1]],
                search.v[corners[2]], search.v[corners[3]],
            };
            var x0 = u[1] - u[0] + u[3] - u[2];
            var y0 = v[1] - v[0] + v[3] - v[2];
            var x1 = u[2] - u[0] + u[3] - u[1];
            var y1 = v[2] - v[0] + v[3] - v[1];
            const length0 = @sqrt(x0 * x0 + y0 * y0);
            const length1 = @sqrt(x1 * x1 + y1 * y1);
            if (!(length0 > 0 and length1 > 0)) return;
            x0 /= length0;
            y0 /= length0;
            x1 /= length1;
            y1 /= length1;
            if (@abs(x0 * y1 - x1 * y0) > 0.15) {
                search.basis = .init(x0, y0, x1, y1);
            } else if (length0 > length1) {
                search.basis = .init(x0, y0, -y0, x0);
            } else {
                search.basis = .init(x1, y1, -y1, x1);
            }
        }

        /// Pixels of the bundle's corners: upper left, upper right, lower left, lower right.
        fn cornerPixels() [4]usize {
            @setEvalBranchQuota(20_000);
            var corners: [4]usize = undefined;
            for (0..Kernel.group_count) |group| {
                for (0..lanes) |lane| {
                    const x = Kernel.pixelX(group, lane);
                    const y = Kernel.pixelY(group, lane);
                    if (x % (side - 1) != 0 or y % (side - 1) != 0) continue;
                    corners[x / (side - 1) + 2 * (y / (side - 1))] = group * lanes + lane;
                }
            }
            return corners;
        }

        /// Bounds of blocks and of all.
        fn bound(search: *Self, members: *const Members) void {
            const unit = 64 * edges_file.unit_roundoff * (1 + 2 * search.slope_max);
            const length = if (search.projection.slope == null) 1 else search.projection.reach;
            const margin: F32 = .splat(unit * search.basis.norm() * length);
            const nowhere: F32 = .splat(inf);
            const nothing = [2]F32{ nowhere, nowhere.neg() };
            const none: Ends = .{ .u = nothing, .v = nothing, .near = nowhere };
            var all = none;
            search.live = 0;
            for (0..block_count / lanes) |part| {
                const first = part * lanes;
                var each: [5][lanes]F32 = undefined;
                for (members[first..][0..lanes], first.., 0..) |set, index, at| {
                    const block = if (set == 0) none else search.endsOf(index);
                    each[0][at], each[1][at] = block.u;
                    each[2][at], each[3][at] = block.v;
                    each[4][at] = block.near;
                }
                var blocks: Ends = .{
                    .u = .{ Rays.minOfEach(&each[0]), Rays.maxOfEach(&each[1]) },
                    .v = .{ Rays.minOfEach(&each[2]), Rays.maxOfEach(&each[3]) },
                    .near = Rays.minOfEach(&each[4]),
                };
                blocks.u = .{ blocks.u[0].sub(margin), blocks.u[1].add(margin) };
                blocks.v = .{ blocks.v[0].sub(margin), blocks.v[1].add(margin) };
                all = all.join(blocks);
                search.live |= blocks.near.lt(nowhere).bits() << @intCast(first);
                for (0..2) |end| {
                    blocks.u[end].storeAligned(@alignCast(search.block_u[end][first..][0..lanes]));
                    blocks.v[end].storeAligned(@alignCast(search.block_v[end][first..][0..lanes]));
                }
            }
            const near = all.near.reduceMin();
            search.bounds = .{
                .u = .{ all.u[0].reduceMin(), all.u[1].reduceMax() },
                .v = .{ all.v[0].reduceMin(), all.v[1].reduceMax() },
                .depth = if (search.projection.slope == null) 1 / near else -near,
            };
        }

        /// Ends of coordinates in the axes of the parallelogram, and the least nearness, in lanes
        /// of pixels or of blocks.
        const Ends = struct {
            u: [2]F32,
            v: [2]F32,
            near: F32,

            inline fn join(a: Ends, b: Ends) Ends {
                return .{
                    .u = .{ a.u[0].minFast(b.u[0]), a.u[1].maxFast(b.u[1]) },
                    .v = .{ a.v[0].minFast(b.v[0]), a.v[1].maxFast(b.v[1]) },
                    .near = a.near.minFast(b.near),
                };
            }
        };

        /// What the groups of a block leave, by lane.
        inline fn endsOf(search: *const Self, index: usize) Ends {
            const basis = &search.basis;
            const nowhere: F32 = .splat(inf);
            var ends: Ends = undefined;
            inline for (0..Kernel.block_groups) |row| {
                const first = index * block_pixels + row * lanes;
                const near: F32 = .loadAligned(@alignCast(search.nearness[first..][0..lanes]));
                const there = near.lt(nowhere);
                const x: F32 = .loadAligned(@alignCast(search.u[first..][0..lanes]));
                const y: F32 = .loadAligned(@alignCast(search.v[first..][0..lanes]));
                const u = x.mul(.splat(basis.i00)).add(y.mul(.splat(basis.i01)));
                const v = x.mul(.splat(basis.i10)).add(y.mul(.splat(basis.i11)));
                const group: Ends = .{
                    .u = .{ .select(there, u, nowhere), .select(there, u, nowhere.neg()) },
                    .v = .{ .select(there, v, nowhere), .select(there, v, nowhere.neg()) },
                    .near = near,
                };
                ends = if (row == 0) group else ends.join(group);
            }
            return ends;
        }

        fn setBlock(search: *Self, index: usize, bounds: Bounds) void {
            for (0..2) |end| {
                search.block_u[end][index] = bounds.u[end];
                search.block_v[end][index] = bounds.v[end];
            }
        }

        /// Half of the set if it should be cut: what lies below the middle of the longer extent, in
        /// units of the median block.
        fn cut(search: *const Self, members: *const Members) ?Members {
            var areas: [block_count]f32 = undefined;
            var extents: [2][block_count]f32 = undefined;
            for (0..block_count / lanes) |part| {
                const first = part * lanes;
                const low = boundsOf(&search.block_u[0], first);
                const u = boundsOf(&search.block_u[1], first).sub(low);
                const v = boundsOf(&search.block_v[1], first)
                    .sub(boundsOf(&search.block_v[0], first));
                const there = low.lt(.splat(inf));
                const nowhere: F32 = .splat(inf);
                F32.select(there, u.mul(v), nowhere).store(areas[first..][0..lanes]);
                F32.select(there, u, nowhere).store(extents[0][first..][0..lanes]);
                F32.select(there, v, nowhere).store(extents[1][first..][0..lanes]);
            }
            const count = @popCount(search.live);
            if (count == 0) return null;
            const share: f32 = @floatFromInt(count);
            if (!(search.bounds.area() > cut_ratio * share * median(&areas, count))) return null;
            const bounds = &search.bounds;
            const along_u = (bounds.u[1] - bounds.u[0]) * median(&extents[1], count) >
                (bounds.v[1] - bounds.v[0]) * median(&extents[0], count);
            const basis = &search.basis;
            const range = if (along_u) search.bounds.u else search.bounds.v;
            const middle: F32 = .splat(0.5 * (range[0] + range[1]));
            const by_u: F32 = .splat(if (along_u) basis.i00 else basis.i10);
            const by_v: F32 = .splat(if (along_u) basis.i01 else basis.i11);
            var half: Members = @splat(0);
            for (0..Kernel.group_count) |group| {
                const u: F32 = .loadAligned(@alignCast(search.u[group * lanes ..][0..lanes]));
                const v: F32 = .loadAligned(@alignCast(search.v[group * lanes ..][0..lanes]));
                setGroup(&half, group, u.mul(by_u).add(v.mul(by_v)).lt(middle).bits());
            }
            const below = count: {
                var both: Members = half;
                for (&both, members) |*one, all| one.* &= all;
                break :count rayCount(&both);
            };
            if (below == 0 or below == rayCount(members)) return null;
            return half;
        }

        /// What half of the first `count` values are less than, or nearly; the rest are infinite.
        fn median(values: *const [block_count]f32, count: usize) f32 {
            for (values[0..count]) |value| {
                var less: usize = 0;
                var not_more: usize = 0;
                inline for (0..block_count / lanes) |part| {
                    const others: F32 = .load(values[part * lanes ..][0..lanes]);
                    less += others.lt(.splat(value)).popCount();
                    not_more += others.le(.splat(value)).popCount();
                }
                if (less <= count / 2 and count / 2 < not_more) return value;
            }
            return values[0];
        }

        fn travel(search: *Self, members: *const Members) void {
            const frustum = search.frustumOf();
            var entries: [Kernel.stack_max]stack.Entry = undefined;
            entries[0] = .{ .child = 0, .block_count = 0, .near = -inf };
            var entry_count: usize = 1;
            var meeting_count: u32 = 0;
            while (entry_count > 0 and search.live != 0) {
                entry_count -= 1;
                const entry = entries[entry_count];
                if (entry.block_count == 0) {
                    assert(entry_count + width <= Kernel.stack_max);
                    const node = &search.tree.nodes[entry.child];
                    if (Kernel.counts_tests) search.countNode(node);
                    entry_count = frustum
                        .pushChildren(node, search.bounds.depth, &entries, entry_count);
                    continue;
                }
                meeting_count += entry.block_count;
                if (meeting_count > meetingMax(width)) return search.apart(&search.left(members));
                for (entry.child..entry.child + entry.block_count) |index| {
                    search.meetBlock(&frustum, @intCast(index));
                }
            }
        }

        /// Members that have met nothing yet.
        fn left(search: *const Self, members: *const Members) Members {
            var rest: Members = @splat(0);
            for (0..Kernel.group_count) |group| {
                const near: F32 = .loadAligned(@alignCast(
                    search.nearness[group * lanes ..][0..lanes],
                ));
                setGroup(&rest, group, near.lt(.splat(inf)).bits());
            }
            for (&rest, members) |*one, all| one.* &= all;
            return rest;
        }

        fn countNode(search: *Self, node: *const world_file.Node(width)) void {
            search.counts.box_issued += width;
            for (node.child) |child| {
                search.counts.box_useful += @intFromBool(child != world_file.none);
            }
        }

        /// Four planes around the beam, and depth along the light's way.
        fn frustumOf(search: *const Self) Frustum {
            const projection = &search.projection;
            const basis = &search.basis;
            const pad = search.world.pad;
            const bounds = &search.bounds;
            const rows = [4][3]f32{
                .{ basis.i00, basis.i01, -bounds.u[0] },
                .{ -basis.i00, -basis.i01, bounds.u[1] },
                .{ basis.i10, basis.i11, -bounds.v[0] },
                .{ -basis.i10, -basis.i11, bounds.v[1] },
            };
            var frustum: Frustum = undefined;
            for (&frustum.sides, rows) |*plane, row| {
                // u - u0 >= 0 is x - u0 z >= 0 in front of a point light, and x - m z - u0 >= 0
                // along a directional one of slope m.
                var normal: [3]f32 = undefined;
                const last = if (projection.slope) |slope|
                    -(row[0] * slope[0] + row[1] * slope[1])
                else
                    row[2];
                const scale = if (projection.slope == null) projection.sign else 1;
                normal[projection.axisAt(0)] = row[0] * scale;
                normal[projection.axisAt(1)] = row[1] * scale;
                normal[projection.axisAt(2)] = last * scale;
                plane.* = .init(normal, projection.origin, frustum_file.slack_pads * pad);
                if (projection.slope != null) plane.offset += row[2];
            }
            var along: [3]f32 = @splat(0);
            along[projection.axis] = projection.sign;
            frustum.depth = .init(along, projection.origin, -frustum_file.slack_pads * pad);
            return frustum;
        }

        /// Sets up the triangles of a block and goes on with those that may stand in the way.
        ///
        /// Long: a score of lane values live through it, and stay in registers only here.
        fn meetBlock(search: *Self, frustum: *const Frustum, block_index: u32) void {
            @setEvalBranchQuota(4000);
            const block_ = &search.tree.blocks[block_index];
            if (Kernel.counts_tests) search.countBlock(block_);
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
            const projection = &search.projection;
            const reach_max = edges_file.reachMax(search.world.pad);
            const print: footprint_file.Footprint(Boxes) =
                .init(corners, projection, search.slope_max, reach_max);
            const bounds = &search.bounds;
            const B = Boxes.F32;
            // Upper bounds from here on.
            var linear: [4]footprint_file.Linear(Boxes) = print.edge ++ .{undefined};
            var along_u: [3]B = undefined;
            var along_v: [3]B = undefined;
            var least: B = .splat(inf);
            inline for (linear[0..3], &along_u, &along_v) |*form, *by_u, *by_v| {
                form.one = form.one.add(print.slack);
                by_u.*, by_v.* = search.inBasis(form);
                least = least.minFast(maxOver(by_u.*, bounds.u)
                    .add(maxOver(by_v.*, bounds.v)).add(form.one));
            }
            there = there.andNot(print.edges.turned.bitAnd(least.lt(.zero())));
            if (there.none()) return;
            const nearness = print.nearness(projection, search.slope_max);
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
            const extent = search.bounds.extent() * (if (directional) 1 else search.bounds.depth);
            if (print.edges.length.lt(.splat(extent)).any()) {
                window = search.windowOf(corners, print.edges.reach);
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
            const projection = &search.projection;
            const basis = &search.basis;
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
            const bounds = &search.bounds;
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
            const basis = &search.basis;
            return .{
                form.u.mulAdd(.splat(basis.b00), form.v.mul(.splat(basis.b10))),
                form.u.mulAdd(.splat(basis.b01), form.v.mul(.splat(basis.b11))),
            };
        }

        inline fn maxOver(factor: Boxes.F32, range: [2]f32) Boxes.F32 {
            return factor.mul(.splat(range[0])).maxFast(factor.mul(.splat(range[1])));
        }

        fn countBlock(search: *Self, block_: *const world_file.TriangleBlock(width)) void {
            search.counts.triangle_issued += width;
            for (block_.primitive) |primitive| {
                search.counts.triangle_useful += @intFromBool(primitive != world_file.none);
            }
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
            var candidates = search.live;
            if (@popCount(candidates) > few_blocks) candidates &= search.blocksOf(coverage);
            while (candidates != 0) : (candidates &= candidates - 1) {
                search.coverBlock(coverage, @ctz(candidates));
            }
        }

        inline fn blocksOf(search: *Self, coverage: *const Coverage) u32 {
            var blocks: u32 = 0;
            inline for (0..block_count / lanes) |part| {
                const first = part * lanes;
                var least: F32 = .splat(inf);
                inline for (0..3) |index| {
                    const du = coverage.along_u[index];
                    const dv = coverage.along_v[index];
                    const u: F32 = .loadAligned(@alignCast(
                        search.block_u[@intFromBool(du > 0)][first..][0..lanes],
                    ));
                    const v: F32 = .loadAligned(@alignCast(
                        search.block_v[@intFromBool(dv > 0)][first..][0..lanes],
                    ));
                    const most = u.mulAdd(.splat(du), v.mulAdd(.splat(dv), .splat(
                        coverage.one[index],
                    )));
                    least = least.minFast(most);
                }
                const window_u = coverage.window_u;
                const window_v = coverage.window_v;
                const met = least.ge(.zero())
                    .bitAnd(boundsOf(&search.block_u[0], first).le(.splat(window_u[1])))
                    .bitAnd(boundsOf(&search.block_u[1], first).ge(.splat(window_u[0])))
                    .bitAnd(boundsOf(&search.block_v[0], first).le(.splat(window_v[1])))
                    .bitAnd(boundsOf(&search.block_v[1], first).ge(.splat(window_v[0])));
                blocks |= met.bits() << first;
            }
            return blocks;
        }

        inline fn boundsOf(bounds: *align(64) const [block_count]f32, first: usize) F32 {
            return .loadAligned(@alignCast(bounds[first..][0..lanes]));
        }

        /// Tests a triangle against the rays of a block.
        inline fn coverBlock(search: *Self, coverage: *const Coverage, index: u32) void {
            var any_met = false;
            inline for (0..Kernel.block_groups) |row| {
                const group = index * Kernel.block_groups + row;
                const first = group * lanes;
                const u: F32 = .loadAligned(@alignCast(search.u[first..][0..lanes]));
                const v: F32 = .loadAligned(@alignCast(search.v[first..][0..lanes]));
                var value: [4]F32 = undefined;
                inline for (&value, coverage.u, coverage.v, coverage.one) |*to, cu, cv, c1| {
                    to.* = u.mulAdd(.splat(cu), v.mulAdd(.splat(cv), .splat(c1)));
                }
                const near: F32 = .loadAligned(@alignCast(search.nearness[first..][0..lanes]));
                const least = value[0].minFast(value[1]).minFast(value[2]);
                var possible = least.ge(.zero()).bitAnd(value[3].gt(near));
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
            if (any_met) search.checkBlock(index);
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
            const near: F32 = .loadAligned(@alignCast(search.nearness[first..][0..lanes]));
            F32.select(met, .splat(inf), near)
                .storeAligned(@alignCast(search.nearness[first..][0..lanes]));
            const ray = &search.bundle.groups[group];
            ray.nearest.primitive = .select(met, .zero(), ray.nearest.primitive);
            return true;
        }

        /// Marks a block as done when all its rays are.
        inline fn checkBlock(search: *Self, index: u32) void {
            const first = index * block_pixels;
            var least: F32 = .loadAligned(@alignCast(search.nearness[first..][0..lanes]));
            inline for (1..Kernel.block_groups) |row| {
                least = least.minFast(.loadAligned(@alignCast(
                    search.nearness[first + row * lanes ..][0..lanes],
                )));
            }
            if (least.lt(.splat(inf)).any()) return;
            search.live &= ~(@as(u32, 1) << @intCast(index));
            search.setBlock(index, .{});
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
            const hit = exact.meet(Kernel, search.tree, search.world.pad, ray, doubtful, slot);
            const stands = hit.mask.bitAnd(hit.t.gt(.zero())).bitAnd(hit.t.lt(ray.nearest.t));
            return hit.inside.bitAnd(before.bitOr(stands));
        }

        /// A triangle seen edge-on, or out of all measure: rays are left to the exact test unless
        /// some edge function is surely negative and another surely positive.
        fn coverUndecided(search: *Self, coverage: *const Coverage) void {
            @branchHint(.unlikely);
            const slack: F32 = .splat(coverage.slack);
            for (0..Kernel.group_count) |group| {
                const block = group / Kernel.block_groups;
                if (search.live >> @intCast(block) & 1 == 0) continue;
                const first = group * lanes;
                const u: F32 = .loadAligned(@alignCast(search.u[first..][0..lanes]));
                const v: F32 = .loadAligned(@alignCast(search.v[first..][0..lanes]));
                const near: F32 = .loadAligned(@alignCast(search.nearness[first..][0..lanes]));
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
                    search.checkBlock(@intCast(block));
                }
            }
        }
    };
}
