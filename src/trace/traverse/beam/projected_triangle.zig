//! Projected edge functions (Pineda 1988, "A Parallel Algorithm for Polygon Rasterization") of
//! triangles on the plane across the rays of a beam, and their nearness.
//!
//! In: a pack of triangles, and how a ray is given by two numbers (u, v). Out: by triangle three
//! edge functions and a measure of nearness, each a value a u + b v + c, with bounds on their
//! errors in the manner of edges.zig. For the eye (u, v) is a pixel of the tile and nearness 1/t.
//! For a point light (u, v) are slopes, edge functions those of edges.zig over the slope's axis,
//! nearness is 1/depth; for a directional one (u, v) is where the light's ray meets an axis plane,
//! nearness is minus the depth. A triangle stands before a point if its nearness is greater.

const std = @import("std");
const ray_file = @import("../ray.zig");
const edges_file = @import("edges.zig");
const Grid = @import("grid.zig").Grid;

const unit = edges_file.unit_roundoff;

/// u, v and 1 times these.
pub fn Linear(comptime Value: type) type {
    return struct {
        u: Value,
        v: Value,
        one: Value,

        /// In lanes, times a factor.
        pub inline fn scale(form: @This(), factor: Value) @This() {
            const one = form.one.mul(factor);
            return .{ .u = form.u.mul(factor), .v = form.v.mul(factor), .one = one };
        }

        /// A form of numbers, at places in lanes.
        pub inline fn at(form: *const @This(), comptime F32: type, u: F32, v: F32) F32 {
            return u.mulAdd(.splat(form.u), v.mulAdd(.splat(form.v), .splat(form.one)));
        }
    };
}

/// What rounding is in proportion to, for all triangles of a beam.
pub const ErrorScale = struct {
    /// Of edge functions and of nearness.
    edge: f32,
    nearness: f32,
};

/// Triangles of a pack in lanes.
pub fn ProjectedTriangle(comptime Lanes: type) type {
    return struct {
        /// Positive within.
        edge: [3]Linear(Lanes.F32),
        /// Bound of the error of an edge function.
        slack: Lanes.F32,
        /// In a directional light's own axes, its det the area on the plane.
        facet: edges_file.Facet(Lanes),
    };
}

/// Nearness of triangles in lanes.
pub fn Nearness(comptime Lanes: type) type {
    return struct {
        /// Greater is nearer to the eye or the light.
        form: Linear(Lanes.F32),
        /// Nearness n is within n (1 +- relative) +- absolute.
        relative: Lanes.F32,
        absolute: Lanes.F32,
        /// Lanes whose bounds hold and are worth anything; others are up to the exact test.
        decisive: Lanes.Mask,
    };
}

/// Rays from a point in directions that are linear in the pixel: (u, v) is its column and row.
pub const GridProjection = struct {
    grid: Grid,
    scale: ErrorScale,

    /// Of directions no longer than |D| that the grid has within d: that moves an edge function by
    /// 2 R L d, 1/t by L^2 / |det| d.
    pub fn init(grid: *const Grid) GridProjection {
        const longest = grid.longest();
        const off = 2 * grid.deviation_ulps;
        return .{ .grid = grid.*, .scale = .{
            .edge = unit * (edges_file.edge_ulps * longest +
                edges_file.step_ulps * grid.spread() + off),
            .nearness = unit * (edges_file.inverse_ulps * longest + off),
        } };
    }

    /// Sets up triangles.
    pub inline fn project(
        projection: *const GridProjection,
        comptime Lanes: type,
        corners: [3]Lanes.Vec3,
    ) ProjectedTriangle(Lanes) {
        const origin: Lanes.Vec3 = .splat(projection.grid.origin);
        const edges: edges_file.Edges(Lanes) = .init(corners, origin);
        var projected: ProjectedTriangle(Lanes) = .{
            .edge = undefined,
            .slack = edges.slack.mul(.splat(projection.scale.edge)),
            .facet = edges.facet,
        };
        inline for (&projected.edge, edges.normal) |*to, normal|
            to.* = projection.linear(Lanes, normal);
        return projected;
    }

    /// Nearness of the triangles that the edges have left.
    pub inline fn nearness(
        projection: *const GridProjection,
        comptime Lanes: type,
        facet: *const edges_file.Facet(Lanes),
    ) Nearness(Lanes) {
        const inverse = facet.inverse();
        return .{
            .form = projection.linear(Lanes, inverse.vector),
            .relative = inverse.relative,
            .absolute = inverse.absolute.mul(.splat(projection.scale.nearness)),
            .decisive = inverse.decisive,
        };
    }

    inline fn linear(
        projection: *const GridProjection,
        comptime Lanes: type,
        vector: Lanes.Vec3,
    ) Linear(Lanes.F32) {
        const grid = &projection.grid;
        return .{
            .u = edges_file.dot(Lanes, vector, .splat(grid.right)),
            .v = edges_file.dot(Lanes, vector, .splat(grid.down)),
            .one = edges_file.dot(Lanes, vector, .splat(grid.corner)),
        };
    }
};

/// Rays of a light, given by where they meet a plane across an axis.
pub const LightProjection = struct {
    /// Of a point light its place; else a point near the rays, to keep numbers small.
    origin: [3]f32,
    /// The axis along which depth counts; the others follow it in cyclic order.
    axis: u2,
    /// 1 or -1: the way the light travels along that axis.
    sign: f32,
    /// Null: from the origin on; else parallel rays that move by this much along the other two
    /// axes for each unit along the depth's.
    slope: ?[2]f32,
    /// Parallel rays: the largest distance of a ray's end from the origin.
    reach: f32 = 0,
    /// Length of the longest direction over its depth: sqrt(1 + m . m) for slopes m.
    stretch: f32 = undefined,
    scale: ErrorScale = undefined,

    /// Of rays whose slopes are at most so much along each axis.
    pub fn bound(projection: *LightProjection, slope_max: f32) void {
        const stretch = @sqrt(1 + 2 * slope_max * slope_max);
        const parallel = projection.slope != null;
        projection.stretch = stretch;
        projection.scale = .{
            .edge = unit * stretch * edges_file.edge_ulps * if (parallel) stretch else 1,
            .nearness = unit * stretch *
                if (parallel) @as(f32, 1) else edges_file.inverse_ulps,
        };
    }

    /// Index of the axis of u (0), v (1) or depth (2).
    pub fn axisAt(projection: *const LightProjection, index: usize) usize {
        return ray_file.turnedIndex(projection.axis, index);
    }

    /// Where points fall, given relative to the projection's origin. For a point light depth must
    /// not be 0.
    pub inline fn place(
        projection: *const LightProjection,
        comptime Lanes: type,
        point: Lanes.Vec3,
    ) struct { u: Lanes.F32, v: Lanes.F32, depth: Lanes.F32 } {
        const turned = turn(Lanes, projection.axis, point);
        const depth = turned.z.mul(.splat(projection.sign));
        if (projection.slope) |slope| return .{
            .u = turned.x.sub(turned.z.mul(.splat(slope[0]))),
            .v = turned.y.sub(turned.z.mul(.splat(slope[1]))),
            .depth = depth,
        };
        const inverse = Lanes.F32.splat(1).div(turned.z);
        return .{ .u = turned.x.mul(inverse), .v = turned.y.mul(inverse), .depth = depth };
    }

    /// Sets up triangles.
    pub inline fn project(
        projection: *const LightProjection,
        comptime Lanes: type,
        corners: [3]Lanes.Vec3,
    ) ProjectedTriangle(Lanes) {
        if (projection.slope) |slope| return projection.projectParallel(Lanes, corners, slope);
        const origin: Lanes.Vec3 = .splat(projection.origin);
        const edges: edges_file.Edges(Lanes) = .init(corners, origin);
        var projected: ProjectedTriangle(Lanes) = .{
            .edge = undefined,
            .slack = edges.slack.mul(.splat(projection.scale.edge)),
            .facet = edges.facet,
        };
        inline for (&projected.edge, edges.normal) |*to, normal|
            to.* = projection.linear(Lanes, normal);
        return projected;
    }

    inline fn linear(
        projection: *const LightProjection,
        comptime Lanes: type,
        vector: Lanes.Vec3,
    ) Linear(Lanes.F32) {
        const turned = turn(Lanes, projection.axis, vector.scale(.splat(projection.sign)));
        return .{ .u = turned.x, .v = turned.y, .one = turned.z };
    }

    /// An edge function is twice the area between an edge and a point of the plane; depth is
    /// that of the triangle's plane. R of the bounds is the distance to the origin, or from
    /// there to a ray's end, if that is larger. With the slopes m of the rays, |D| is
    /// sqrt(1 + m . m), det the area on the plane and R S / |det| a length.
    inline fn projectParallel(
        projection: *const LightProjection,
        comptime Lanes: type,
        corners: [3]Lanes.Vec3,
        slope: [2]f32,
    ) ProjectedTriangle(Lanes) {
        const Vec3 = Lanes.Vec3;
        const axis = projection.axis;
        const origin: Vec3 = turn(Lanes, axis, .splat(projection.origin));
        const a = turn(Lanes, axis, corners[0]).sub(origin);
        const b = turn(Lanes, axis, corners[1]).sub(origin);
        const c = turn(Lanes, axis, corners[2]).sub(origin);
        const sides = [3]Vec3{
            turn(Lanes, axis, corners[2].sub(corners[1])),
            turn(Lanes, axis, corners[0].sub(corners[2])),
            turn(Lanes, axis, corners[1].sub(corners[0])),
        };
        const along: Vec3 = .{ .x = .splat(slope[0]), .y = .splat(slope[1]), .z = .splat(1) };
        const plane = edges_file.cross(Lanes, sides[1], sides[2]);
        const area = edges_file.dot(Lanes, plane, along);
        const flip: Lanes.F32 = .select(area.lt(.zero()), .splat(-1), .splat(1));
        const length_squared = edges_file.longestSquared(Lanes, sides);
        const length = length_squared.sqrt();
        const reach = edges_file.longestSquared(Lanes, .{ a, b, c }).sqrt()
            .add(.splat(projection.reach));
        var projected: ProjectedTriangle(Lanes) = .{
            .edge = undefined,
            .slack = reach.mul(length.add(reach.mul(.splat(2 * unit))))
                .mul(.splat(projection.scale.edge)),
            .facet = .{
                .turned = edges_file.isTurned(
                    Lanes,
                    area,
                    reach.mul(.splat(projection.stretch)),
                    length_squared,
                    length,
                ).bitAnd(reach.lt(.splat(edges_file.reach_max))),
                .reach = reach,
                .length = length,
                .corner = a,
                .sides = .{ sides[1], sides[2] },
                .plane = plane,
                .det = area,
            },
        };
        const sums = [3]Vec3{ c.add(b), a.add(c), b.add(a) };
        inline for (&projected.edge, sides, sums) |*to, by, sum| {
            const u = by.x.sub(by.z.mul(along.x)).mul(flip);
            const v = by.y.sub(by.z.mul(along.y)).mul(flip);
            const middle_u = sum.x.sub(sum.z.mul(along.x)).mul(.splat(0.5));
            const middle_v = sum.y.sub(sum.z.mul(along.y)).mul(.splat(0.5));
            to.* = .{ .u = v.neg(), .v = u, .one = middle_u.mul(v).sub(middle_v.mul(u)) };
        }
        return projected;
    }

    /// Nearness of the triangles that the edges have left. Depth along parallel rays is off by
    /// (28 R + 9 L^3 / area) u |D| S / area.
    pub inline fn nearness(
        projection: *const LightProjection,
        comptime Lanes: type,
        facet: *const edges_file.Facet(Lanes),
    ) Nearness(Lanes) {
        const scale: Lanes.F32 = .splat(projection.scale.nearness);
        if (projection.slope == null) {
            const inverse = facet.inverse();
            return .{
                .form = projection.linear(Lanes, inverse.vector),
                .relative = inverse.relative,
                .absolute = inverse.absolute.mul(scale),
                .decisive = inverse.decisive,
            };
        }
        const area_inv, const steepness, const thinness = facet.shape();
        const reach = facet.reach;
        const absolute = reach.mulAdd(.splat(36), thinness.mul(.splat(11)))
            .mulAdd(steepness.mul(scale), reach.mul(scale.mul(.splat(5))));
        const height = edges_file.dot(Lanes, facet.plane, facet.corner).neg();
        const form: Linear(Lanes.F32) = .{ .u = facet.plane.x, .v = facet.plane.y, .one = height };
        return .{
            .form = form.scale(area_inv.mul(.splat(projection.sign))),
            .relative = .zero(),
            .absolute = absolute,
            .decisive = facet.turned
                .bitAnd(absolute.lt(reach.mul(.splat(edges_file.relative_error_max)))),
        };
    }
};

/// Components in cyclic order with the given axis last.
inline fn turn(comptime Lanes: type, axis: u2, vector: Lanes.Vec3) Lanes.Vec3 {
    return switch (axis) {
        0 => .{ .x = vector.y, .y = vector.z, .z = vector.x },
        1 => .{ .x = vector.z, .y = vector.x, .z = vector.y },
        else => vector,
    };
}
