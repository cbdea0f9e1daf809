//! Shadow receivers as the light sees them: where the rays of a bundle end, on a plane across the
//! light's way (Williams 1978, "Casting Curved Shadows on Curved Surfaces", at the rays' own places
//! and not at texels: Aila and Laine 2004, "Alias-Free Shadow Maps").
//!
//! In: what shadow_plane.zig has made of a light and some rays. Out: for `traverse.zig` the set of
//! these rays; those that have met anything are out of it.

const std = @import("std");
const world_file = @import("../../../world.zig");
const kernel_file = @import("../kernel.zig");
const bundle_file = @import("../bundle.zig");
const walk = @import("../walk.zig");
const edges_file = @import("edges.zig");
const exact = @import("exact.zig");
const frustum_file = @import("frustum.zig");
const members_file = @import("members.zig");
const projected = @import("projected_triangle.zig");
const rasterise = @import("rasterise.zig");
const Members = members_file.Members;

const subtile_count = kernel_file.beam_subtiles;
const subtile_pixels = kernel_file.subtile_pixels;
const pixel_count = kernel_file.beam_pixels;
const inf = std.math.inf(f32);
/// With no more subtiles than this, triangles are not tested against each of them first.
const few_subtiles = 3;

/// Bounds on the light's plane, in the axes of the parallelogram.
pub const Bounds = struct {
    u: [2]f32,
    v: [2]f32,
    /// Of the point farthest along the light's way, and its nearness.
    depth: f32,
    nearness: f32,
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
    pub fn init(x0: f32, y0: f32, x1: f32, y1: f32) Basis {
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

/// Some rays of a bundle; undefined until `shadow_plane.place`.
pub fn ShadowReceivers(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const lanes = Kernel.ray_count;
    return struct {
        geometry: *const world_file.Geometry,
        bundle: *bundle_file.Bundle(Kernel),
        projection: projected.LightProjection,
        frustum: frustum_file.Frustum(Kernel.Boxes),
        basis: Basis,
        bounds: Bounds,
        /// Points on the light's plane by pixel, and how near to the light they are there;
        /// infinitely near if there is no ray or it has met something.
        u: [pixel_count]f32 align(64),
        v: [pixel_count]f32 align(64),
        nearness: [pixel_count]f32 align(64),
        /// Bounds of every subtile; empty ones of subtiles that are done.
        subtile_u: [2][subtile_count]f32 align(64),
        subtile_v: [2][subtile_count]f32 align(64),
        /// Subtiles with rays that have met nothing yet.
        live: u32,

        pub const query: walk.Query = .any_hit;
        const Self = @This();
        const Coverage = rasterise.Coverage(Self, f32, i32);

        /// Bounds of a triangle and its edge functions, in the axes of the parallelogram.
        pub fn Window(comptime Float: type, comptime _: type) type {
            return struct { u: [2]Float, v: [2]Float, along: [3]projected.Linear(Float) };
        }

        pub inline fn depthMax(set: *const Self) f32 {
            return set.bounds.depth;
        }

        pub inline fn isDone(set: *const Self) bool {
            return set.live == 0;
        }

        pub inline fn nearnessMin(set: *const Self) f32 {
            return set.bounds.nearness;
        }

        /// A form of the coordinates in the axes of the parallelogram.
        pub inline fn inAxes(
            set: *const Self,
            comptime Lanes: type,
            form: *const projected.Linear(Lanes.F32),
        ) projected.Linear(Lanes.F32) {
            const basis = &set.basis;
            return .{
                .u = form.u.mulAdd(.splat(basis.b00), form.v.mul(.splat(basis.b10))),
                .v = form.u.mulAdd(.splat(basis.b01), form.v.mul(.splat(basis.b11))),
                .one = form.one,
            };
        }

        /// The greatest value of a form over the set.
        pub inline fn greatest(
            set: *const Self,
            comptime Lanes: type,
            form: *const projected.Linear(Lanes.F32),
        ) Lanes.F32 {
            const bounds = &set.bounds;
            const u = form.u.mul(.splat(bounds.u[0])).maxFast(form.u.mul(.splat(bounds.u[1])));
            const v = form.v.mul(.splat(bounds.v[0])).maxFast(form.v.mul(.splat(bounds.v[1])));
            return u.add(v).add(form.one);
        }

        /// Windows of triangles, and lanes of those that reach into the bounds.
        pub inline fn windowOf(
            set: *const Self,
            comptime Lanes: type,
            corners: [3]Lanes.Vec3,
            facet: *const edges_file.Facet(Lanes),
            along: *const [3]projected.Linear(Lanes.F32),
        ) struct { Window(Lanes.F32, Lanes.I32), Lanes.Mask } {
            const all = [2]Lanes.F32{ .splat(-inf), .splat(inf) };
            var window: Window(Lanes.F32, Lanes.I32) = .{ .u = all, .v = all, .along = along.* };
            // Bounds tell more than edges of small triangles only.
            const bounds = &set.bounds;
            const longest = @max(bounds.u[1] - bounds.u[0], bounds.v[1] - bounds.v[0]);
            const extent = longest * (if (set.projection.slope == null) bounds.depth else 1);
            if (facet.length.lt(.splat(extent)).none()) return .{ window, .splat(true) };
            window.u, window.v = set.boundsOf(Lanes, corners, facet.reach);
            return .{
                window,
                window.u[1].ge(.splat(bounds.u[0]))
                    .bitAnd(window.u[0].le(.splat(bounds.u[1])))
                    .bitAnd(window.v[1].ge(.splat(bounds.v[0])))
                    .bitAnd(window.v[0].le(.splat(bounds.v[1]))),
            };
        }

        /// Bounds of triangles by their corners; none if a corner is not in front of a point light.
        /// A corner's u or v is off by less than 6 u |c| / depth, the exact test's displacement of
        /// corners by as much again.
        inline fn boundsOf(
            set: *const Self,
            comptime Lanes: type,
            corners: [3]Lanes.Vec3,
            reach: Lanes.F32,
        ) [2][2]Lanes.F32 {
            const projection = &set.projection;
            const basis = &set.basis;
            const endless: Lanes.F32 = .splat(inf);
            var ends: [2][2]Lanes.F32 = @splat(.{ endless, endless.neg() });
            var least_depth = endless;
            inline for (corners) |corner| {
                const place = projection.place(Lanes, corner.sub(.splat(projection.origin)));
                const u = place.u.mulAdd(.splat(basis.i00), place.v.mul(.splat(basis.i01)));
                const v = place.u.mulAdd(.splat(basis.i10), place.v.mul(.splat(basis.i11)));
                ends[0] = .{ ends[0][0].minFast(u), ends[0][1].maxFast(u) };
                ends[1] = .{ ends[1][0].minFast(v), ends[1][1].maxFast(v) };
                least_depth = least_depth.minFast(place.depth);
            }
            const unit: Lanes.F32 = .splat(16 * edges_file.unit_roundoff * basis.norm());
            const flat = projection.slope != null;
            const margin = if (flat) reach.mul(unit) else reach.div(least_depth).mul(unit);
            var bounded = margin.lt(.splat(if (flat) inf else 1));
            if (!flat) bounded = bounded.bitAnd(least_depth.gt(.zero()));
            inline for (&ends) |*end| end.* = .{
                .select(bounded, end[0].sub(margin), endless.neg()),
                .select(bounded, end[1].add(margin), endless),
            };
            return ends;
        }

        pub inline fn subtilesOf(
            set: *const Self,
            comptime decisive: bool,
            coverage: *const Coverage,
            _: exact.Slot,
        ) u32 {
            if (!decisive or @popCount(set.live) <= few_subtiles) return set.live;
            const window = &coverage.window;
            var subtiles: u32 = 0;
            inline for (0..subtile_count / lanes) |part| {
                const first = part * lanes;
                var least: F32 = .splat(inf);
                inline for (&window.along) |*edge| {
                    const u = lanesOf(&set.subtile_u[@intFromBool(edge.u > 0)], first);
                    const v = lanesOf(&set.subtile_v[@intFromBool(edge.v > 0)], first);
                    least = least.minOrNegative(edge.at(F32, u, v));
                }
                const met = lanesOf(&set.subtile_u[0], first).le(.splat(window.u[1]))
                    .bitAnd(lanesOf(&set.subtile_u[1], first).ge(.splat(window.u[0])))
                    .bitAnd(lanesOf(&set.subtile_v[0], first).le(.splat(window.v[1])))
                    .bitAnd(lanesOf(&set.subtile_v[1], first).ge(.splat(window.v[0])))
                    .andNot(least.isNegative());
                subtiles |= met.bits() << first;
            }
            return subtiles & set.live;
        }

        pub inline fn rowsOf(set: *const Self, coverage: *const Coverage, subtile: u32) Rows {
            const group = subtile * Kernel.subtile_groups;
            return .{
                .set = set,
                .coverage = coverage,
                .group = group,
                .last = group + Kernel.subtile_groups - 1,
            };
        }

        const Rows = struct {
            set: *const Self,
            coverage: *const Coverage,
            group: u32,
            last: u32,

            pub inline fn values(rows: *const Rows) [4]F32 {
                const u = lanesOf(&rows.set.u, rows.group * lanes);
                const v = lanesOf(&rows.set.v, rows.group * lanes);
                var value: [4]F32 = undefined;
                inline for (&value, &rows.coverage.form) |*to, *form| to.* = form.at(F32, u, v);
                return value;
            }

            pub inline fn next(rows: *Rows) bool {
                if (rows.group == rows.last) return false;
                rows.group += 1;
                return true;
            }
        };

        pub inline fn lower(set: *const Self, group: usize) F32 {
            return lanesOf(&set.nearness, group * lanes);
        }

        pub inline fn upper(set: *const Self, group: usize) F32 {
            return set.lower(group);
        }

        pub inline fn withoutOwn(
            set: *const Self,
            rays: Rays.Mask,
            group: usize,
            coverage: *const Coverage,
        ) Rays.Mask {
            return rays.andNot(set.bundle.groups[group].skip.eq(.splat(coverage.primitive)));
        }

        /// Takes rays out that have met a triangle.
        pub inline fn accept(
            set: *Self,
            group: usize,
            rays: Rays.Mask,
            slot: exact.Slot,
            _: F32,
            _: F32,
        ) void {
            F32.select(rays, .splat(inf), set.lower(group))
                .storeAligned(@alignCast(set.nearness[group * lanes ..][0..lanes]));
            const primitive: Rays.I32 =
                .splat(exact.primitiveAt(Kernel.width, set.geometry, slot));
            const closest = &set.bundle.groups[group].closest.primitive;
            closest.* = .select(rays, primitive, closest.*);
        }

        /// Marks a subtile as done when all its rays are.
        pub inline fn boundSubtile(set: *Self, subtile: u32) void {
            const first = subtile * Kernel.subtile_groups;
            var least = set.lower(first);
            inline for (1..Kernel.subtile_groups) |row|
                least = least.minFast(set.lower(first + row));
            if (least.lt(.splat(inf)).any()) return;
            set.live &= ~(@as(u32, 1) << @intCast(subtile));
            for (0..2) |end| {
                const empty: f32 = if (end == 0) inf else -inf;
                set.subtile_u[end][subtile] = empty;
                set.subtile_v[end][subtile] = empty;
            }
        }

        /// Members that have met nothing yet.
        pub fn left(set: *const Self, members: *const Members) Members {
            var rest: Members = @splat(0);
            for (0..Kernel.group_count) |group| {
                const bits = set.lower(group).lt(.splat(inf)).bits();
                members_file.setGroup(Kernel, &rest, group, bits);
            }
            for (&rest, members) |*one, all| one.* &= all;
            return rest;
        }

        /// Of an array by pixel or by subtile, the lanes from `first` on.
        pub inline fn lanesOf(values: anytype, first: usize) F32 {
            return .loadAligned(@alignCast(values[first..][0..lanes]));
        }
    };
}
