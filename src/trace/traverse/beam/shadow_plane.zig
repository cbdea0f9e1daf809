//! Projection of one light's shadow rays onto a plane across its way: which, where, in which axes.
//!
//! In: a light and a set of a bundle's rays. Out: by pixel the place of each on the plane and how
//! near to the light it is; bounds of subtiles and of all, in the axes of a parallelogram, since a
//! flat surface seen aslant is one; what encloses them; half of the set, where depth jumps and the
//! bounds of all cover far more of the plane than the subtiles do.

const std = @import("std");
const world_file = @import("../../../world.zig");
const kernel_file = @import("../kernel.zig");
const ray_file = @import("../ray.zig");
const edges_file = @import("edges.zig");
const frustum_file = @import("frustum.zig");
const members_file = @import("members.zig");
const receivers_file = @import("shadow_receivers.zig");
const Basis = receivers_file.Basis;
const Members = members_file.Members;
const ShadowReceivers = receivers_file.ShadowReceivers;

const side = kernel_file.beam_side;
const subtile_count = kernel_file.beam_subtiles;
const subtile_pixels = kernel_file.subtile_pixels;
const pixel_count = kernel_file.beam_pixels;
const inf = std.math.inf(f32);

/// A beam is cut where its bounds cover more than this many times what its subtiles do.
const cut_ratio = 2.0;
/// Slopes at most; rays that go more sideways make a beam of their own.
const slope_limit = 4.0;

/// Puts the rays of a set on the plane of the axis that suits most of them, and takes out those
/// that do not fit on it, which are returned. All but the frustum is set then.
pub fn place(
    comptime Kernel: type,
    set: *ShadowReceivers(Kernel),
    light: *const world_file.Light,
    members: *Members,
) Members {
    choosePlane(Kernel, set, light, members);
    const all = members_file.count(members) == pixel_count;
    const unfit, const steepest = if (all)
        placeEach(Kernel, true, set, members)
    else
        placeEach(Kernel, false, set, members);
    var rest: Members = @splat(0);
    if (unfit.any()) {
        const fitting = set.left(members);
        rest = members.*;
        members.* = members_file.split(&rest, &fitting);
    }
    const slope_max = if (set.projection.slope) |slope|
        @max(@abs(slope[0]), @abs(slope[1]))
    else
        steepest.reduceMax();
    set.projection.bound(slope_max);
    set.basis = if (hasCorners(Kernel, members)) chooseBasis(Kernel, set) else .{};
    const relative_error = 64 * edges_file.unit_roundoff * (1 + 2 * slope_max);
    const margin = relative_error * set.basis.norm() *
        (if (set.projection.slope == null) 1 else set.projection.reach);
    if (all and unfit.none())
        bound(Kernel, true, set, members, margin)
    else
        bound(Kernel, false, set, members, margin);
    return rest;
}

/// The axis along which the light's way to these points is longest.
fn choosePlane(
    comptime Kernel: type,
    set: *ShadowReceivers(Kernel),
    light: *const world_file.Light,
    members: *const Members,
) void {
    const directional = light.kind == .directional;
    var sum: Kernel.Rays.Vec3 = .splat(.{ 0, 0, 0 });
    var some: ?[3]f32 = null;
    // One group of a subtile is enough to choose by.
    for (members, 0..) |bits, at| {
        if (bits == 0) continue;
        const index = at * Kernel.subtile_groups + @ctz(bits) / Kernel.ray_count;
        const group = &set.bundle.groups[index];
        const member = members_file.groupOf(Kernel, members, index);
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
    set.projection = .{
        .origin = if (directional) some.? else light.position,
        .axis = axis,
        .sign = if (way[axis] < 0) -1 else 1,
        .slope = if (directional) .{
            way[ray_file.turnedIndex(axis, 0)] / way[axis],
            way[ray_file.turnedIndex(axis, 1)] / way[axis],
        } else null,
    };
    if (directional) set.projection.reach = reachOf(Kernel, set, members);
}

/// The largest distance of a directional light's points from the origin of the plane.
fn reachOf(
    comptime Kernel: type,
    set: *const ShadowReceivers(Kernel),
    members: *const Members,
) f32 {
    const F32 = Kernel.Rays.F32;
    var farthest: F32 = .zero();
    for (&set.bundle.groups, 0..) |*group, index| {
        const member = members_file.groupOf(Kernel, members, index);
        if (member.none()) continue;
        const offset = group.line.origin.sub(.splat(set.projection.origin));
        farthest = farthest.maxFast(.select(member, offset.dot(offset), .zero()));
    }
    return @sqrt(farthest.reduceMax());
}

/// Every member's place. Returns lanes with rays that do not fit on the plane, and the steepest
/// slopes of those that do. `all`: every ray is a member.
fn placeEach(
    comptime Kernel: type,
    comptime all: bool,
    set: *ShadowReceivers(Kernel),
    members: *const Members,
) struct { Kernel.Rays.Mask, Kernel.Rays.F32 } {
    const F32 = Kernel.Rays.F32;
    const Mask = Kernel.Rays.Mask;
    const lanes = Kernel.ray_count;
    const projection = &set.projection;
    const point_light = projection.slope == null;
    var unfit: Mask = .splat(false);
    var steepest: F32 = .zero();
    for (&set.bundle.groups, 0..) |*group, index| {
        const member: Mask =
            if (all) .splat(true) else members_file.groupOf(Kernel, members, index);
        const first = index * lanes;
        if (!all and member.none()) {
            F32.splat(inf).storeAligned(@alignCast(set.nearness[first..][0..lanes]));
            continue;
        }
        // A point light's rays are given by where t is 1; a directional one's start there.
        const point = if (point_light)
            group.line.direction
        else
            group.line.origin.sub(.splat(projection.origin));
        const on_plane = projection.place(Kernel.Rays, point);
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
        on_plane.u.storeAligned(@alignCast(set.u[first..][0..lanes]));
        on_plane.v.storeAligned(@alignCast(set.v[first..][0..lanes]));
        F32.select(fits, near, .splat(inf))
            .storeAligned(@alignCast(set.nearness[first..][0..lanes]));
    }
    return .{ unfit, steepest };
}

/// Whether the corners of the bundle are members.
fn hasCorners(comptime Kernel: type, members: *const Members) bool {
    for (comptime cornerPixels(Kernel)) |pixel| {
        const subtile = members[pixel / subtile_pixels];
        if (subtile >> @intCast(pixel % subtile_pixels) & 1 == 0) return false;
    }
    return true;
}

/// Axes along the rows and columns of pixels.
fn chooseBasis(comptime Kernel: type, set: *const ShadowReceivers(Kernel)) Basis {
    var u: [4]f32 = undefined;
    var v: [4]f32 = undefined;
    for (&u, &v, comptime cornerPixels(Kernel)) |*to_u, *to_v, pixel| {
        to_u.* = set.u[pixel];
        to_v.* = set.v[pixel];
    }
    var x0 = u[1] - u[0] + u[3] - u[2];
    var y0 = v[1] - v[0] + v[3] - v[2];
    var x1 = u[2] - u[0] + u[3] - u[1];
    var y1 = v[2] - v[0] + v[3] - v[1];
    const length0 = @sqrt(x0 * x0 + y0 * y0);
    const length1 = @sqrt(x1 * x1 + y1 * y1);
    if (!(length0 > 0 and length1 > 0)) return .{};
    x0 /= length0;
    y0 /= length0;
    x1 /= length1;
    y1 /= length1;
    if (@abs(x0 * y1 - x1 * y0) > 0.15) return .init(x0, y0, x1, y1);
    return if (length0 > length1) .init(x0, y0, -y0, x0) else .init(x1, y1, -y1, x1);
}

/// Pixels of the bundle's corners: upper left, upper right, lower left, lower right.
fn cornerPixels(comptime Kernel: type) [4]usize {
    @setEvalBranchQuota(20_000);
    var corners: [4]usize = undefined;
    for (0..Kernel.group_count) |group| {
        for (0..Kernel.ray_count) |lane| {
            const x = Kernel.pixelX(group, lane);
            const y = Kernel.pixelY(group, lane);
            if (x % (side - 1) != 0 or y % (side - 1) != 0) continue;
            corners[x / (side - 1) + 2 * (y / (side - 1))] = group * Kernel.ray_count + lane;
        }
    }
    return corners;
}

/// Ends of coordinates in the axes of the parallelogram, and the least nearness, in lanes of pixels
/// or of subtiles.
fn Ends(comptime Rays: type) type {
    const F32 = Rays.F32;
    return struct {
        u: [2]F32,
        v: [2]F32,
        near: F32,

        inline fn none() @This() {
            const nothing = [2]F32{ .splat(inf), .splat(-inf) };
            return .{ .u = nothing, .v = nothing, .near = .splat(inf) };
        }

        inline fn join(a: @This(), b: @This()) @This() {
            return .{
                .u = .{ a.u[0].minFast(b.u[0]), a.u[1].maxFast(b.u[1]) },
                .v = .{ a.v[0].minFast(b.v[0]), a.v[1].maxFast(b.v[1]) },
                .near = a.near.minFast(b.near),
            };
        }
    };
}

/// Bounds of subtiles and of all, wider by a margin. `all_there`: every ray is a member.
fn bound(
    comptime Kernel: type,
    comptime all_there: bool,
    set: *ShadowReceivers(Kernel),
    members: *const Members,
    margin_size: f32,
) void {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const lanes = Kernel.ray_count;
    const margin: F32 = .splat(margin_size);
    var all: Ends(Rays) = .none();
    set.live = 0;
    for (0..subtile_count / lanes) |part| {
        const first = part * lanes;
        var each: [5][lanes]F32 = undefined;
        for (members[first..][0..lanes], first.., 0..) |bits, index, at| {
            const gone = !all_there and bits == 0;
            const ends = if (gone) Ends(Rays).none() else endsOf(Kernel, all_there, set, index);
            each[0][at], each[1][at] = ends.u;
            each[2][at], each[3][at] = ends.v;
            each[4][at] = ends.near;
        }
        const subtiles: Ends(Rays) = .{
            .u = .{ Rays.minOfEach(&each[0]).sub(margin), Rays.maxOfEach(&each[1]).add(margin) },
            .v = .{ Rays.minOfEach(&each[2]).sub(margin), Rays.maxOfEach(&each[3]).add(margin) },
            .near = Rays.minOfEach(&each[4]),
        };
        all = all.join(subtiles);
        set.live |= subtiles.near.lt(.splat(inf)).bits() << @intCast(first);
        for (0..2) |end| {
            subtiles.u[end].storeAligned(@alignCast(set.subtile_u[end][first..][0..lanes]));
            subtiles.v[end].storeAligned(@alignCast(set.subtile_v[end][first..][0..lanes]));
        }
    }
    const near = all.near.reduceMin();
    const depth = if (set.projection.slope == null) 1 / near else -near;
    set.bounds = .{
        .u = .{ all.u[0].reduceMin(), all.u[1].reduceMax() },
        .v = .{ all.v[0].reduceMin(), all.v[1].reduceMax() },
        .depth = depth,
        .nearness = if (set.projection.slope == null) 1 / depth else -depth,
    };
}

/// What the groups of a subtile leave, by lane.
inline fn endsOf(
    comptime Kernel: type,
    comptime all_there: bool,
    set: *const ShadowReceivers(Kernel),
    subtile: usize,
) Ends(Kernel.Rays) {
    const F32 = Kernel.Rays.F32;
    const lanesOf = ShadowReceivers(Kernel).lanesOf;
    const basis = &set.basis;
    const nowhere: F32 = .splat(inf);
    var ends: Ends(Kernel.Rays) = undefined;
    inline for (0..Kernel.subtile_groups) |row| {
        const first = subtile * subtile_pixels + row * Kernel.ray_count;
        const near = lanesOf(&set.nearness, first);
        const there: Kernel.Rays.Mask = if (all_there) .splat(true) else near.lt(nowhere);
        const x = lanesOf(&set.u, first);
        const y = lanesOf(&set.v, first);
        const u = x.mul(.splat(basis.i00)).add(y.mul(.splat(basis.i01)));
        const v = x.mul(.splat(basis.i10)).add(y.mul(.splat(basis.i11)));
        const group: Ends(Kernel.Rays) = .{
            .u = .{ .select(there, u, nowhere), .select(there, u, nowhere.neg()) },
            .v = .{ .select(there, v, nowhere), .select(there, v, nowhere.neg()) },
            .near = near,
        };
        ends = if (row == 0) group else ends.join(group);
    }
    return ends;
}

/// Four planes around the rays, and depth along the light's way.
pub fn encloseRays(comptime Kernel: type, set: *ShadowReceivers(Kernel)) void {
    const projection = &set.projection;
    const basis = &set.basis;
    const bounds = &set.bounds;
    const rows = [4][3]f32{
        .{ basis.i00, basis.i01, -bounds.u[0] },
        .{ -basis.i00, -basis.i01, bounds.u[1] },
        .{ basis.i10, basis.i11, -bounds.v[0] },
        .{ -basis.i10, -basis.i11, bounds.v[1] },
    };
    var normals: [4][3]f32 = undefined;
    for (&normals, rows) |*normal, row| {
        // u - u0 >= 0 is x - u0 z >= 0 in front of a point light, and x - m z - u0 >= 0 along a
        // directional one of slope m.
        const last = if (projection.slope) |slope|
            -(row[0] * slope[0] + row[1] * slope[1])
        else
            row[2];
        const scale = if (projection.slope == null) projection.sign else 1;
        normal[projection.axisAt(0)] = row[0] * scale;
        normal[projection.axisAt(1)] = row[1] * scale;
        normal[projection.axisAt(2)] = last * scale;
    }
    var along: [3]f32 = @splat(0);
    along[projection.axis] = projection.sign;
    const apart = frustum_file.apartOf(&set.geometry.padding, projection.origin);
    set.frustum = .init(projection.origin, normals, along, .{
        .apart = apart + 2 * frustum_file.by_distance * projection.reach,
        .by_depth = frustum_file.by_distance * projection.stretch,
        .ends_at = if (projection.slope == null) null else bounds.depth,
    });
    if (projection.slope != null) {
        for (&set.frustum.sides, rows) |*plane, row| plane.offset += row[2];
    }
}

/// Half of the set if it should be cut: what lies below the middle of the longer extent, in units
/// of the median subtile.
pub fn cut(
    comptime Kernel: type,
    set: *const ShadowReceivers(Kernel),
    members: *const Members,
) ?Members {
    const F32 = Kernel.Rays.F32;
    const lanesOf = ShadowReceivers(Kernel).lanesOf;
    const lanes = Kernel.ray_count;
    const count = @popCount(set.live);
    if (count == 0) return null;
    const share: f32 = @floatFromInt(count);
    const bounds = &set.bounds;
    const length = [2]f32{ bounds.u[1] - bounds.u[0], bounds.v[1] - bounds.v[0] };
    // Of more than half of the subtiles, and so of the median.
    const area_max: F32 = .splat(length[0] * length[1] / (cut_ratio * share));
    var extents: [2][subtile_count]f32 = undefined;
    var small_count: u32 = 0;
    for (0..subtile_count / lanes) |part| {
        const first = part * lanes;
        const low = lanesOf(&set.subtile_u[0], first);
        const u = lanesOf(&set.subtile_u[1], first).sub(low);
        const v = lanesOf(&set.subtile_v[1], first).sub(lanesOf(&set.subtile_v[0], first));
        const there = low.lt(.splat(inf));
        small_count += there.bitAnd(u.mul(v).lt(area_max)).popCount();
        F32.select(there, u, .splat(inf)).store(extents[0][first..][0..lanes]);
        F32.select(there, v, .splat(inf)).store(extents[1][first..][0..lanes]);
    }
    if (small_count <= count / 2) return null;
    const along_u = length[0] * median(Kernel, &extents[1], count) >
        length[1] * median(Kernel, &extents[0], count);
    const basis = &set.basis;
    const range = if (along_u) bounds.u else bounds.v;
    const middle: F32 = .splat(0.5 * (range[0] + range[1]));
    const by_u: F32 = .splat(if (along_u) basis.i00 else basis.i10);
    const by_v: F32 = .splat(if (along_u) basis.i01 else basis.i11);
    var half: Members = @splat(0);
    for (0..Kernel.group_count) |group| {
        const u = lanesOf(&set.u, group * lanes);
        const v = lanesOf(&set.v, group * lanes);
        const bits = u.mul(by_u).add(v.mul(by_v)).lt(middle).bits();
        members_file.setGroup(Kernel, &half, group, bits);
    }
    for (&half, members) |*one, all| one.* &= all;
    const below = members_file.count(&half);
    return if (below == 0 or below == members_file.count(members)) null else half;
}

/// What half of the first `count` values are less than, or nearly; the rest are infinite.
fn median(comptime Kernel: type, values: *const [subtile_count]f32, count: usize) f32 {
    for (values[0..count]) |value| {
        var less: usize = 0;
        var not_more: usize = 0;
        inline for (0..subtile_count / Kernel.ray_count) |part| {
            const others: Kernel.Rays.F32 =
                .load(values[part * Kernel.ray_count ..][0..Kernel.ray_count]);
            less += others.lt(.splat(value)).popCount();
            not_more += others.le(.splat(value)).popCount();
        }
        if (less <= count / 2 and count / 2 < not_more) return value;
    }
    return values[0];
}
