//! NURBS surfaces, cut into an even grid of their parameters.
//!
//! In: `nu`, `nv`, `uorder`, `vorder`, `uknots`, `vknots`, `P` or `Pw`, and perhaps `u0`, `u1`,
//! `v0`, `v1`. Out: as many steps each way as a full circle has, with the surface's own normals.
//! Basis functions: Piegl and Tiller, "The NURBS Book", algorithm A2.2, and their derivatives from
//! those of one degree less (equation 2.7).

const std = @import("std");
const limits = @import("../limits.zig");
const Tessellator = @import("tessellator.zig");
const math = @import("../../../math.zig");
const vec3d = math.vec3d;
const Error = @import("../input.zig").Error;
const Geometry = Tessellator.Geometry;
const Grid = @import("../../../scene.zig").Grid;
const Sample = Tessellator.Sample;
const Vector = math.Vec3d;

const order_max = limits.nurbs_order_max;

/// One direction of the surface.
const Direction = struct {
    point_count: u32,
    order: u32,
    knots: []const f32,
    from: f64,
    to: f64,

    /// The knot span that holds `t`: an index from order - 1 to point_count - 1.
    fn spanOf(direction: *const Direction, t: f64) u32 {
        var low = direction.order - 1;
        var high = direction.point_count;
        while (high - low > 1) {
            const middle = (low + high) / 2;
            if (direction.knots[middle] <= t) low = middle else high = middle;
        }
        return low;
    }
};

/// The control points that count at a parameter, with their weights and those of the derivative.
const Basis = struct {
    first: u32,
    count: u32,
    values: [order_max]f64,
    slopes: [order_max]f64,

    fn at(direction: *const Direction, t: f64) Basis {
        const span = direction.spanOf(t);
        const degree = direction.order - 1;
        var basis: Basis = .{
            .first = span - degree,
            .count = direction.order,
            .values = @splat(0),
            .slopes = @splat(0),
        };
        basis.values[0] = 1;
        for (1..direction.order) |current| {
            // The slopes of the last degree come from the values of the one before.
            if (current == degree) basis.setSlopes(direction, span, degree);
            basis.raise(direction, span, @intCast(current), t);
        }
        return basis;
    }

    /// Values of degree `current` from those of one less, in place.
    fn raise(basis: *Basis, direction: *const Direction, span: u32, current: u32, t: f64) void {
        const knots = direction.knots;
        var saved: f64 = 0;
        for (0..current) |index| {
            const right: f64 = knots[span + 1 + index];
            const left: f64 = knots[span + 1 + index - current];
            const part = ratio(basis.values[index], right - left);
            basis.values[index] = saved + (right - t) * part;
            saved = (t - left) * part;
        }
        basis.values[current] = saved;
    }

    fn setSlopes(basis: *Basis, direction: *const Direction, span: u32, degree: u32) void {
        const knots = direction.knots;
        for (0..degree) |index| {
            const right: f64 = knots[span + 1 + index];
            const left: f64 = knots[span + 1 + index - degree];
            const part = @as(f64, @floatFromInt(degree)) * ratio(basis.values[index], right - left);
            basis.slopes[index] -= part;
            basis.slopes[index + 1] += part;
        }
    }

    fn ratio(value: f64, by: f64) f64 {
        return if (by > 0) value / by else 0;
    }
};

/// Points of the surface, row by row: what the control points come to along v is summed once a row,
/// as the control points of a curve, and its derivative.
const Surface = struct {
    u: Direction,
    v: Direction,
    /// Homogeneous where `weighted`: four numbers a point, else three.
    points: []const f32,
    weighted: bool,
    steps: u32,
    /// By column of the grid.
    bases: []Basis,
    /// Of the row under way, by column of control points.
    curve: [][4]f64,
    curve_slopes: [][4]f64,
    row: ?u32 = null,

    fn sampleAt(surface: *Surface, column: u32, row: u32) Sample {
        if (surface.row != row) surface.setRow(row);
        const u = &surface.bases[column];
        const whole = sum(u, &u.values, surface.curve);
        const by_u = sum(u, &u.slopes, surface.curve);
        const by_v = sum(u, &u.values, surface.curve_slopes);
        const w = if (whole[3] != 0) whole[3] else 1;
        const point: Vector = .{ whole[0] / w, whole[1] / w, whole[2] / w };
        const normal = vec3d.cross(slope(by_u, point), slope(by_v, point));
        if (!isFinite(point)) return .{ .point = .{ 0, 0, 0 }, .normal = .{ 0, 0, 0 } };
        return .{
            .point = point,
            .normal = vec3d.normalize(normal) orelse .{ 0, 0, 0 },
            .u = parameter(&surface.u, column, surface.steps),
            .v = parameter(&surface.v, row, surface.steps),
        };
    }

    fn setColumns(surface: *Surface) void {
        for (surface.bases, 0..) |*basis, column| basis.* = .at(
            &surface.u,
            parameter(&surface.u, @intCast(column), surface.steps),
        );
    }

    fn setRow(surface: *Surface, row: u32) void {
        surface.row = row;
        const v: Basis = .at(&surface.v, parameter(&surface.v, row, surface.steps));
        @memset(surface.curve, @splat(0));
        @memset(surface.curve_slopes, @splat(0));
        for (0..v.count) |line| {
            const first = (v.first + line) * @as(usize, surface.u.point_count);
            for (surface.curve, surface.curve_slopes, first..) |*to, *to_slope, index| {
                const from = surface.pointAt(index);
                for (to, to_slope, from) |*component, *slope_component, of_point| {
                    component.* += v.values[line] * of_point;
                    slope_component.* += v.slopes[line] * of_point;
                }
            }
        }
    }

    fn pointAt(surface: *const Surface, index: usize) [4]f64 {
        const width: usize = if (surface.weighted) 4 else 3;
        const point = surface.points[width * index ..][0..width];
        return .{ point[0], point[1], point[2], if (surface.weighted) point[3] else 1 };
    }

    /// Derivative of a quotient, but for a factor above 0.
    fn slope(homogeneous: [4]f64, point: Vector) Vector {
        const own: Vector = homogeneous[0..3].*;
        return vec3d.sub(own, vec3d.scale(point, homogeneous[3]));
    }

    fn isFinite(point: Vector) bool {
        for (point) |component| if (!(@abs(component) <= std.math.floatMax(f32))) return false;
        return true;
    }

    fn sum(u: *const Basis, weights: *const [order_max]f64, points: []const [4]f64) [4]f64 {
        var result: [4]f64 = @splat(0);
        for (weights[0..u.count], points[u.first..][0..u.count]) |weight, point| {
            for (&result, point) |*to, component| to.* += weight * component;
        }
        return result;
    }

    fn parameter(direction: *const Direction, index: u32, count: u32) f64 {
        const share = @as(f64, @floatFromInt(index)) / @as(f64, @floatFromInt(count));
        return (1 - share) * direction.from + share * direction.to;
    }
};

/// The whole surface.
pub fn nurbs(tessellator: *Tessellator) Error!Geometry {
    const u = try readDirection(tessellator, .{ "nu", "uorder", "uknots", "u0", "u1" });
    const v = try readDirection(tessellator, .{ "nv", "vorder", "vknots", "v0", "v1" });
    const weighted = tessellator.parameters.find("P") == null;
    const points = tessellator.parameters.floatsNamed(if (weighted) "Pw" else "P") orelse
        return tessellator.fail("has neither points P nor Pw", .{});
    const width: u64 = if (weighted) 4 else 3;
    const needed = @as(u64, u.point_count) * v.point_count;
    if (points.len != width * needed) return tessellator.fail(
        "has {d} numbers for {d} by {d} points",
        .{ points.len, u.point_count, v.point_count },
    );
    const steps = tessellator.input.resources.settings.tessellation;
    const gpa = tessellator.input.gpa;
    const bases = try gpa.alloc(Basis, steps + 1);
    defer gpa.free(bases);
    const curves = try gpa.alloc([4]f64, 2 * @as(usize, u.point_count));
    defer gpa.free(curves);
    var surface: Surface = .{
        .u = u,
        .v = v,
        .points = points,
        .weighted = weighted,
        .steps = steps,
        .bases = bases,
        .curve = curves[0..u.point_count],
        .curve_slopes = curves[u.point_count..],
    };
    surface.setColumns();
    const grid: Grid = .{ .columns = steps, .rows = steps };
    return tessellator.tessellate(.{ .grid = grid }, &surface, Surface.sampleAt);
}

/// Asserts nothing: all of it is the file's.
fn readDirection(tessellator: *Tessellator, comptime names: [5][]const u8) Error!Direction {
    const parameters = tessellator.parameters;
    const point_count = parameters.integer(names[0]) orelse
        return tessellator.fail("has no " ++ names[0], .{});
    const order = parameters.integer(names[1]) orelse
        return tessellator.fail("has no " ++ names[1], .{});
    const knots = parameters.floatsNamed(names[2]) orelse
        return tessellator.fail("has no " ++ names[2], .{});
    if (order < 2 or order > order_max or point_count < order) return tessellator.fail(
        names[1] ++ " is {d} for {d} points: it is 2 to {d}, and not above their number",
        .{ order, point_count, order_max },
    );
    if (knots.len != @as(u64, @intCast(point_count)) + @as(u64, @intCast(order)))
        return tessellator.fail(
            names[2] ++ " has {d} knots, not {d} + {d}",
            .{ knots.len, point_count, order },
        );
    for (knots[1..], knots[0 .. knots.len - 1]) |knot, before| {
        if (knot >= before) continue;
        return tessellator.fail(names[2] ++ " falls from {d} to {d}", .{ before, knot });
    }
    const low = knots[@intCast(order - 1)];
    const high = knots[@intCast(point_count)];
    if (!(high > low)) return tessellator.fail(names[2] ++ " leaves no range of parameters", .{});
    const from = std.math.clamp(parameters.float(names[3], low), low, high);
    const to = std.math.clamp(parameters.float(names[4], high), low, high);
    return .{
        .point_count = @intCast(point_count),
        .order = @intCast(order),
        .knots = knots,
        .from = from,
        .to = to,
    };
}

test "basis functions sum to one, their slopes to none" {
    const knots = [_]f32{ 0, 0, 0, 1, 2, 2, 3, 3, 3 };
    const direction: Direction =
        .{ .point_count = 6, .order = 3, .knots = &knots, .from = 0, .to = 3 };
    for (0..31) |step| {
        const t = @as(f64, @floatFromInt(step)) / 10;
        const basis = Basis.at(&direction, t);
        var sum: f64 = 0;
        var slope: f64 = 0;
        for (0..basis.count) |index| {
            sum += basis.values[index];
            slope += basis.slopes[index];
        }
        try std.testing.expectApproxEqAbs(1, sum, 1e-12);
        try std.testing.expectApproxEqAbs(0, slope, 1e-12);
        try std.testing.expect(basis.first + basis.count <= 6);
    }
}
