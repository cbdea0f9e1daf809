//! Where the rays of a bundle end, as their light sees it: points on a plane across its way.
//!
//! In: a light and a set of a bundle's rays. Out: by pixel the place of each on the plane and how
//! near to the light it is; bounds of blocks of 4x4 pixels and of all, in the axes of a
//! parallelogram, since a flat surface seen aslant is one; what encloses them; half of the set,
//! where depth jumps and the bounds of all cover far more of the plane than the blocks do.

const std = @import("std");
const world_file = @import("../../../world.zig");
const kernel_file = @import("../kernel.zig");
const bundle_file = @import("../bundle.zig");
const ray_file = @import("../ray.zig");
const edges_file = @import("edges.zig");
const footprint_file = @import("projected_triangle.zig");
const frustum_file = @import("frustum.zig");
const Projection = footprint_file.Projection;

const side = kernel_file.beam_side;
const pack_count = kernel_file.beam_subtiles;
const subtile_pixels = kernel_file.subtile_pixels;
const pixel_count = kernel_file.beam_pixels;

/// A beam is cut where its bounds cover more than this many times what its blocks do.
const cut_ratio = 2.0;
/// Slopes at most; rays that go more sideways make a beam of their own.
const slope_limit = 4.0;

/// A set of rays: a bit for each pixel of each block.
pub const Members = [pack_count]u16;

/// Bounds on the light's plane, in the axes of the parallelogram.
pub const Bounds = struct {
    u: [2]f32,
    v: [2]f32,
    /// Of the point farthest along the light's way.
    depth: f32,

    /// The longer side.
    pub fn extent(bounds: Bounds) f32 {
        return @max(bounds.u[1] - bounds.u[0], bounds.v[1] - bounds.v[0]);
    }

    fn area(bounds: Bounds) f32 {
        return (bounds.u[1] - bounds.u[0]) * (bounds.v[1] - bounds.v[0]);
    }
};

/// Axes of the parallelogram, and the way back: U = i00 u + i01 v, V = i10 u + i11 v.
pub const Basis = struct {
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

    /// Sum of the absolute values of the way back: by how much it stretches at most.
    pub fn norm(basis: *const Basis) f32 {
        return @abs(basis.i00) + @abs(basis.i01) + @abs(basis.i10) + @abs(basis.i11);
    }
};

/// The points of some rays of a bundle; undefined until `place`.
pub fn Points(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const lanes = Kernel.ray_count;
    return struct {
        projection: Projection,
        basis: Basis,
        /// Slopes of these rays, or of the light's, at most.
        slope_max: f32,
        bounds: Bounds,
        /// Points on the light's plane by pixel, and how near to the light they are there;
        /// infinitely near if there is no ray or it has met something.
        u: [pixel_count]f32 align(64),
        v: [pixel_count]f32 align(64),
        nearness: [pixel_count]f32 align(64),
        /// Bounds of every block; empty ones of blocks that are done.
        block_u: [2][pack_count]f32 align(64),
        block_v: [2][pack_count]f32 align(64),
        /// Blocks with rays that have met nothing yet.
        live: u32,

        const Self = @This();
        const Bundle = bundle_file.Bundle(Kernel);
        const Frustum = frustum_file.Frustum(Kernel.Boxes);
        const F32 = Rays.F32;
        const Mask = Rays.Mask;
        const inf = std.math.inf(f32);

        /// How many rays a set has.
        pub fn rayCount(members: *const Members) u32 {
            return @popCount(@as(@Int(.unsigned, pixel_count), @bitCast(members.*)));
        }

        /// The active rays of a bundle.
        pub fn membersOf(bundle: *const Bundle) Members {
            var members: Members = @splat(0);
            for (&bundle.groups, 0..) |*group, index| {
                setGroup(&members, index, group.active.bits());
            }
            return members;
        }

        inline fn setGroup(members: *Members, group: usize, bits: u32) void {
            const shift: u4 = @intCast(group % Kernel.subtile_groups * lanes);
            members[group / Kernel.subtile_groups] |= @as(u16, @truncate(bits)) << shift;
        }

        /// A group's part of a set.
        pub inline fn groupOf(members: *const Members, group: usize) Mask {
            const shift: u4 = @intCast(group % Kernel.subtile_groups * lanes);
            const all: u16 = @intCast((@as(u32, 1) << lanes) - 1);
            return .fromBits(members[group / Kernel.subtile_groups] >> shift & all);
        }

        /// Puts the rays of a set on the plane of the axis that suits most of them, and takes out
        /// those that do not fit on it, which are returned.
        pub fn place(
            points: *Self,
            light: *const world_file.Light,
            bundle: *const Bundle,
            members: *Members,
        ) Members {
            points.choosePlane(light, bundle, members);
            const all = rayCount(members) == pixel_count;
            const unfit, const steepest = if (all)
                points.placeEach(true, bundle, members)
            else
                points.placeEach(false, bundle, members);
            var rest: Members = @splat(0);
            if (unfit.any()) {
                rest = members.*;
                members.* = points.left(&rest);
                for (&rest, members) |*one, fitting| one.* &= ~fitting;
            }
            points.slope_max = if (points.projection.slope) |slope|
                @max(@abs(slope[0]), @abs(slope[1]))
            else
                steepest.reduceMax();
            points.chooseBasis(members);
            if (all and unfit.none()) points.bound(true, members) else points.bound(false, members);
            return rest;
        }

        /// Every member's place. Returns lanes with rays that do not fit on the plane, and the
        /// steepest slopes of those that do. `all`: every ray is a member.
        fn placeEach(
            points: *Self,
            comptime all: bool,
            bundle: *const Bundle,
            members: *const Members,
        ) struct { Mask, F32 } {
            const point_light = points.projection.slope == null;
            var unfit: Mask = .splat(false);
            var steepest: F32 = .zero();
            for (&bundle.groups, 0..) |*group, index| {
                const member: Mask = if (all) .splat(true) else groupOf(members, index);
                const first = index * lanes;
                if (!all and member.none()) {
                    F32.splat(inf).storeAligned(@alignCast(points.nearness[first..][0..lanes]));
                    continue;
                }
                const on_plane = points.placeGroup(group);
                const steep = on_plane.u.abs().maxFast(on_plane.v.abs());
                var fits = member;
                if (point_light) fits = fits.bitAnd(on_plane.depth.gt(.zero()))
                    .bitAnd(steep.le(.splat(slope_limit)));
                unfit = unfit.bitOr(member.andNot(fits));
                steepest = steepest.maxFast(.select(fits, steep, .zero()));
                const near = if (point_light)
                    F32.splat(1).div(on_plane.depth.mul(group.closest.t))
                else
                    on_plane.depth.neg();
                on_plane.u.storeAligned(@alignCast(points.u[first..][0..lanes]));
                on_plane.v.storeAligned(@alignCast(points.v[first..][0..lanes]));
                F32.select(fits, near, .splat(inf))
                    .storeAligned(@alignCast(points.nearness[first..][0..lanes]));
            }
            return .{ unfit, steepest };
        }

        inline fn placeGroup(
            points: *const Self,
            group: *const ray_file.Ray(Rays),
        ) footprint_file.Place(Rays) {
            const projection = &points.projection;
            // A point light's rays are given by where t is 1; a directional one's start there.
            const point = if (projection.slope == null)
                group.line.direction
            else
                group.line.origin.sub(.splat(projection.origin));
            return footprint_file.project(Rays, projection, point);
        }

        /// The axis along which the light's way to these points is longest.
        fn choosePlane(
            points: *Self,
            light: *const world_file.Light,
            bundle: *const Bundle,
            members: *const Members,
        ) void {
            const directional = light.kind == .directional;
            var sum: Rays.Vec3 = .splat(.{ 0, 0, 0 });
            var some: ?[3]f32 = null;
            // One group of a block is enough to choose by.
            for (members, 0..) |set, at| {
                if (set == 0) continue;
                const index = at * Kernel.subtile_groups + @ctz(set) / lanes;
                const group = &bundle.groups[index];
                const member = groupOf(members, index);
                const vector = if (directional) group.line.origin else group.line.direction;
                if (some == null) some = vector.lane(@ctz(member.bits()));
                sum = sum.add(.select(member, vector, .splat(.{ 0, 0, 0 })));
            }
            const way = if (directional)
                light.direction
            else
                [3]f32{ sum.x.reduceSum(), sum.y.reduceSum(), sum.z.reduceSum() };
            var axis: u2 = 0;
            for (1..3) |other| {
                if (@abs(way[other]) > @abs(way[axis])) axis = @intCast(other);
            }
            points.projection = .{
                .origin = if (directional) some.? else light.position,
                .axis = axis,
                .sign = if (way[axis] < 0) -1 else 1,
                .slope = if (directional) .{
                    way[ray_file.turnedIndex(axis, 0)] / way[axis],
                    way[ray_file.turnedIndex(axis, 1)] / way[axis],
                } else null,
            };
            if (directional) points.projection.reach = points.reachOf(bundle, members);
        }

        /// The largest distance of a directional light's points from the origin of the plane.
        fn reachOf(points: *const Self, bundle: *const Bundle, members: *const Members) f32 {
            var farthest: F32 = .zero();
            for (&bundle.groups, 0..) |*group, index| {
                const member = groupOf(members, index);
                if (member.none()) continue;
                const apart_ = group.line.origin.sub(.splat(points.projection.origin));
                const distance = apart_.dot(apart_);
                farthest = farthest.maxFast(.select(member, distance, .zero()));
            }
            return @sqrt(farthest.reduceMax());
        }

        /// Axes along the rows and columns of pixels, if the corners of the bundle are members.
        fn chooseBasis(points: *Self, members: *const Members) void {
            points.basis = .{};
            const corners = comptime cornerPixels();
            for (corners) |pixel| {
                const block = members[pixel / subtile_pixels];
                if (block >> @intCast(pixel % subtile_pixels) & 1 == 0) return;
            }
            const u = [4]f32{
                points.u[corners[0]], points.u[corners[1]],
                points.u[corners[2]], points.u[corners[3]],
            };
            const v = [4]f32{
                points.v[corners[0]], points.v[corners[1]],
                points.v[corners[2]], points.v[corners[3]],
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
                points.basis = .init(x0, y0, x1, y1);
            } else if (length0 > length1) {
                points.basis = .init(x0, y0, -y0, x0);
            } else {
                points.basis = .init(x1, y1, -y1, x1);
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

        /// Bounds of blocks and of all. `all`: every ray is a member.
        fn bound(points: *Self, comptime all_there: bool, members: *const Members) void {
            const unit = 64 * edges_file.unit_roundoff * (1 + 2 * points.slope_max);
            const length = if (points.projection.slope == null) 1 else points.projection.reach;
            const margin: F32 = .splat(unit * points.basis.norm() * length);
            const nowhere: F32 = .splat(inf);
            const nothing = [2]F32{ nowhere, nowhere.neg() };
            const none: Ends = .{ .u = nothing, .v = nothing, .near = nowhere };
            var all = none;
            points.live = 0;
            for (0..pack_count / lanes) |part| {
                const first = part * lanes;
                var each: [5][lanes]F32 = undefined;
                for (members[first..][0..lanes], first.., 0..) |set, index, at| {
                    const gone = !all_there and set == 0;
                    const block = if (gone) none else points.endsOf(all_there, index);
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
                points.live |= blocks.near.lt(nowhere).bits() << @intCast(first);
                for (0..2) |end| {
                    blocks.u[end].storeAligned(@alignCast(points.block_u[end][first..][0..lanes]));
                    blocks.v[end].storeAligned(@alignCast(points.block_v[end][first..][0..lanes]));
                }
            }
            const near = all.near.reduceMin();
            points.bounds = .{
                .u = .{ all.u[0].reduceMin(), all.u[1].reduceMax() },
                .v = .{ all.v[0].reduceMin(), all.v[1].reduceMax() },
                .depth = if (points.projection.slope == null) 1 / near else -near,
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
        inline fn endsOf(points: *const Self, comptime all_there: bool, index: usize) Ends {
            const basis = &points.basis;
            const nowhere: F32 = .splat(inf);
            var ends: Ends = undefined;
            inline for (0..Kernel.subtile_groups) |row| {
                const first = index * subtile_pixels + row * lanes;
                const near = lanesOf(&points.nearness, first);
                const there: Mask = if (all_there) .splat(true) else near.lt(nowhere);
                const x = lanesOf(&points.u, first);
                const y = lanesOf(&points.v, first);
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

        /// Half of the set if it should be cut: what lies below the middle of the longer extent, in
        /// units of the median block.
        pub fn cut(points: *const Self, members: *const Members) ?Members {
            const count = @popCount(points.live);
            if (count == 0) return null;
            const share: f32 = @floatFromInt(count);
            // Of more than half of the blocks, and so of the median.
            const area_max: F32 = .splat(points.bounds.area() / (cut_ratio * share));
            var extents: [2][pack_count]f32 = undefined;
            var small_count: u32 = 0;
            for (0..pack_count / lanes) |part| {
                const first = part * lanes;
                const low = lanesOf(&points.block_u[0], first);
                const u = lanesOf(&points.block_u[1], first).sub(low);
                const v = lanesOf(&points.block_v[1], first)
                    .sub(lanesOf(&points.block_v[0], first));
                const there = low.lt(.splat(inf));
                const nowhere: F32 = .splat(inf);
                small_count += there.bitAnd(u.mul(v).lt(area_max)).popCount();
                F32.select(there, u, nowhere).store(extents[0][first..][0..lanes]);
                F32.select(there, v, nowhere).store(extents[1][first..][0..lanes]);
            }
            if (small_count <= count / 2) return null;
            const bounds = &points.bounds;
            const along_u = (bounds.u[1] - bounds.u[0]) * median(&extents[1], count) >
                (bounds.v[1] - bounds.v[0]) * median(&extents[0], count);
            const basis = &points.basis;
            const range = if (along_u) points.bounds.u else points.bounds.v;
            const middle: F32 = .splat(0.5 * (range[0] + range[1]));
            const by_u: F32 = .splat(if (along_u) basis.i00 else basis.i10);
            const by_v: F32 = .splat(if (along_u) basis.i01 else basis.i11);
            var half: Members = @splat(0);
            for (0..Kernel.group_count) |group| {
                const u = lanesOf(&points.u, group * lanes);
                const v = lanesOf(&points.v, group * lanes);
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
        fn median(values: *const [pack_count]f32, count: usize) f32 {
            for (values[0..count]) |value| {
                var less: usize = 0;
                var not_more: usize = 0;
                inline for (0..pack_count / lanes) |part| {
                    const others: F32 = .load(values[part * lanes ..][0..lanes]);
                    less += others.lt(.splat(value)).popCount();
                    not_more += others.le(.splat(value)).popCount();
                }
                if (less <= count / 2 and count / 2 < not_more) return value;
            }
            return values[0];
        }

        /// Members that have met nothing yet.
        pub fn left(points: *const Self, members: *const Members) Members {
            var rest: Members = @splat(0);
            for (0..Kernel.group_count) |group| {
                const near = lanesOf(&points.nearness, group * lanes);
                setGroup(&rest, group, near.lt(.splat(inf)).bits());
            }
            for (&rest, members) |*one, all| one.* &= all;
            return rest;
        }

        /// Four planes around the beam, and depth along the light's way.
        pub fn frustumOf(points: *const Self, pad: f32) Frustum {
            const projection = &points.projection;
            const basis = &points.basis;
            const bounds = &points.bounds;
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

        /// Of an array by pixel or by block, the lanes from `first` on.
        pub inline fn lanesOf(values: anytype, first: usize) F32 {
            return .loadAligned(@alignCast(values[first..][0..lanes]));
        }

        /// Marks a block as done when all its rays are.
        pub inline fn checkBlock(points: *Self, index: u32) void {
            const first = index * subtile_pixels;
            var least = lanesOf(&points.nearness, first);
            inline for (1..Kernel.subtile_groups) |row| {
                least = least.minFast(lanesOf(&points.nearness, first + row * lanes));
            }
            if (least.lt(.splat(inf)).any()) return;
            points.live &= ~(@as(u32, 1) << @intCast(index));
            for (0..2) |end| {
                const empty: f32 = if (end == 0) inf else -inf;
                points.block_u[end][index] = empty;
                points.block_v[end][index] = empty;
            }
        }
    };
}
