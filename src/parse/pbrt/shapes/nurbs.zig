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

const Surface = struct {
    u: Direction,
    v: Direction,
    /// Homogeneous where `weighted`: four numbers a point, else three.
    points: []const f32,
    weighted: bool,
    steps: u32,

    fn sampleAt(surface: *const Surface, column: u32, row: u32) Sample {
        const at_u = parameter(&surface.u, column, surface.steps);
        const at_v = parameter(&surface.v, row, surface.steps);
        const u = Basis.at(&surface.u, at_u);
        const v = Basis.at(&surface.v, at_v);
        const whole = surface.sum(&u, &v, &u.values, &v.values);
        const by_u = surface.sum(&u, &v, &u.slopes, &v.values);
        const by_v = surface.sum(&u, &v, &u.values, &v.slopes);
        const w = if (whole[3] != 0) whole[3] else 1;
        const point: Vector = .{ whole[0] / w, whole[1] / w, whole[2] / w };
        const normal = vec3d.cross(slope(by_u, point), slope(by_v, point));
        if (!isFinite(point)) return .{ .point = .{ 0, 0, 0 }, .normal = .{ 0, 0, 0 } };
        return .{
            .point = point,
            .normal = vec3d.normalize(normal) orelse .{ 0, 0, 0 },
            .u = at_u,
            .v = at_v,
        };
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

    fn sum(
        surface: *const Surface,
        u: *const Basis,
        v: *const Basis,
        u_weights: *const [order_max]f64,
        v_weights: *const [order_max]f64,
    ) [4]f64 {
        var result: [4]f64 = .{ 0, 0, 0, 0 };
        const width: usize = if (surface.weighted) 4 else 3;
        for (0..v.count) |row| for (0..u.count) |column| {
            const weight = u_weights[column] * v_weights[row];
            const index = (v.first + row) * surface.u.point_count + u.first + column;
            const from = surface.points[width * index ..][0..width];
            for (from, result[0..width]) |component, *to| to.* += weight * component;
            if (!surface.weighted) result[3] += weight;
        };
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
    const surface: Surface = .{
        .u = u,
        .v = v,
        .points = points,
        .weighted = weighted,
        .steps = tessellator.input.resources.settings.tessellation,
    };
    const grid: Grid = .{ .columns = surface.steps, .rows = surface.steps };
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
