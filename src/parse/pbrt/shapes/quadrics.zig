//! Sphere, cylinder, disk, cone, paraboloid and hyperboloid, whole or swept in part.
//!
//! Each is a curve that turns about z, as in PBRT, whose normal is the cross product of the
//! directions of growing angle and growing v. The normals are those of the true surface.

const std = @import("std");
const Tessellator = @import("tessellator.zig");
const math = @import("../../../math.zig");
const elementary = math.elementary;
const vec3d = math.vec3d;
const Error = @import("../input.zig").Error;
const Geometry = Tessellator.Geometry;
const Grid = @import("../../../scene.zig").Grid;
const Sample = Tessellator.Sample;
const Vector = math.Vec3d;

/// Where the turning curve is, and the normal there: distance from the axis and height each.
const Outline = struct {
    radius: f64,
    height: f64,
    normal_out: f64,
    normal_up: f64,
    /// See `Sample`.
    v: ?f64 = null,
};

/// A curve and its turn.
fn Revolution(comptime Curve: type) type {
    return struct {
        curve: Curve,
        surface: Tessellator.Surface,
        phi_max: f64,

        fn sampleAt(self: *const @This(), column: u32, row: u32) Sample {
            const phi = share(column, self.surface.grid.columns) * self.phi_max;
            const cosine = elementary.cos(phi);
            const sine = elementary.sin(phi);
            const at = self.curve.at(share(row, self.surface.grid.rows));
            return .{
                .point = .{ at.radius * cosine, at.radius * sine, at.height },
                .normal = .{ at.normal_out * cosine, at.normal_out * sine, at.normal_up },
                .v = at.v,
            };
        }
    };
}

fn share(index: u32, count: u32) f64 {
    return @as(f64, @floatFromInt(index)) / @as(f64, @floatFromInt(count));
}

/// Columns around, closed where the turn is whole.
fn gridOf(tessellator: *const Tessellator, phi_max: f64, rows: u32) Grid {
    return .{
        .columns = tessellator.steps(phi_max, 3),
        .rows = rows,
        .closed = phi_max > 2 * std.math.pi - 1e-9,
    };
}

fn revolve(tessellator: *Tessellator, curve: anytype, rows: u32, ends: [2]bool) Error!Geometry {
    const phi_max = try tessellator.sweep();
    const revolution: Revolution(@TypeOf(curve)) = .{
        .curve = curve,
        .phi_max = phi_max,
        .surface = .{
            .grid = gridOf(tessellator, phi_max, rows),
            .first_row_is_point = ends[0],
            .last_row_is_point = ends[1],
        },
    };
    return tessellator.tessellate(
        revolution.surface,
        &revolution,
        Revolution(@TypeOf(curve)).sampleAt,
    );
}

/// The lower and the higher of two heights, each held between bounds.
fn heights(tessellator: *Tessellator, low_default: f32, high_default: f32) [2]f64 {
    const a: f64 = tessellator.parameters.float("zmin", low_default);
    const b: f64 = tessellator.parameters.float("zmax", high_default);
    return .{ @min(a, b), @max(a, b) };
}

const SphereCurve = struct {
    radius: f64,
    /// Angles from the top, of the first and the last row.
    from: f64,
    to: f64,

    fn at(curve: SphereCurve, v: f64) Outline {
        const theta = curve.from + v * (curve.to - curve.from);
        const cosine = elementary.cos(theta);
        // Poles are points, exactly.
        const pole = theta < 1e-9 or theta > std.math.pi - 1e-9;
        const sine = if (pole) 0 else elementary.sin(theta);
        return .{
            .radius = curve.radius * sine,
            .height = curve.radius * cosine,
            .normal_out = sine,
            .normal_up = cosine,
        };
    }
};

/// `radius`, cut at `zmin` and `zmax`: rows from the bottom up, as many as there are columns in a
/// whole sphere.
pub fn sphere(tessellator: *Tessellator) Error!Geometry {
    const radius = try tessellator.positive("radius", 1);
    const z = heights(tessellator, @floatCast(-radius), @floatCast(radius));
    const from = angleOf(z[0] / radius);
    const to = angleOf(z[1] / radius);
    if (!(from > to)) return tessellator.fail("zmin and zmax leave nothing of the sphere", .{});
    const rows = tessellator.steps(2 * (from - to), 2);
    return revolve(tessellator, SphereCurve{ .radius = radius, .from = from, .to = to }, rows, .{
        from > std.math.pi - 1e-9,
        to < 1e-9,
    });
}

/// Arc cosine of a number held within -1..1.
fn angleOf(cosine: f64) f64 {
    return std.math.acos(std.math.clamp(cosine, -1, 1));
}

/// A straight outline between two radii and two heights; the normal goes out and up.
const Line = struct {
    radii: [2]f64,
    heights: [2]f64,
    normal: [2]f64,

    fn at(line: Line, v: f64) Outline {
        return .{
            .radius = (1 - v) * line.radii[0] + v * line.radii[1],
            .height = (1 - v) * line.heights[0] + v * line.heights[1],
            .normal_out = line.normal[0],
            .normal_up = line.normal[1],
        };
    }
};

/// `radius` from `zmin` to `zmax`, without lids.
pub fn cylinder(tessellator: *Tessellator) Error!Geometry {
    const radius = try tessellator.positive("radius", 1);
    const line: Line = .{
        .radii = @splat(radius),
        .heights = heights(tessellator, -1, 1),
        .normal = .{ 1, 0 },
    };
    return revolve(tessellator, line, 1, .{ false, false });
}

/// At `height`, from `innerradius` to `radius`, looking up.
pub fn disk(tessellator: *Tessellator) Error!Geometry {
    const radius = try tessellator.positive("radius", 1);
    const inner: f64 = std.math.clamp(tessellator.parameters.float("innerradius", 0), 0, radius);
    const height = tessellator.parameters.float("height", 0);
    const line: Line = .{
        .radii = .{ radius, inner },
        .heights = @splat(height),
        .normal = .{ 0, 1 },
    };
    return revolve(tessellator, line, 1, .{ false, inner == 0 });
}

/// `radius` at z = 0, a point at `height`.
pub fn cone(tessellator: *Tessellator) Error!Geometry {
    const radius = try tessellator.positive("radius", 1);
    const height = try tessellator.positive("height", 1);
    const slant = @sqrt(radius * radius + height * height);
    const line: Line = .{
        .radii = .{ radius, 0 },
        .heights = .{ 0, height },
        .normal = .{ height / slant, radius / slant },
    };
    return revolve(tessellator, line, 1, .{ false, true });
}

const ParaboloidCurve = struct {
    radius: f64,
    /// Height where it has that radius.
    top: f64,
    z: [2]f64,

    fn at(curve: ParaboloidCurve, v: f64) Outline {
        // Even steps of the radius, which is the root of the height.
        const root = (1 - v) * @sqrt(curve.z[0]) + v * @sqrt(curve.z[1]);
        const radius = curve.radius * root / @sqrt(curve.top);
        const slope = 2 * curve.top * radius / (curve.radius * curve.radius);
        const length = @sqrt(1 + slope * slope);
        return .{
            .radius = radius,
            .height = root * root,
            .normal_out = slope / length,
            .normal_up = -1 / length,
            .v = (root * root - curve.z[0]) / (curve.z[1] - curve.z[0]),
        };
    }
};

/// z = zmax (r / radius)^2 from `zmin` to `zmax`.
pub fn paraboloid(tessellator: *Tessellator) Error!Geometry {
    const radius = try tessellator.positive("radius", 1);
    const z = heights(tessellator, 0, 1);
    const low = @max(z[0], 0);
    if (!(z[1] > low))
        return tessellator.fail("zmin and zmax leave nothing of the paraboloid", .{});
    const rows = tessellator.steps(std.math.pi, 2);
    const curve: ParaboloidCurve = .{ .radius = radius, .top = z[1], .z = .{ low, z[1] } };
    return revolve(tessellator, curve, rows, .{ low == 0, false });
}

/// A line that turns about z.
const Hyperboloid = struct {
    first: Vector,
    last: Vector,
    surface: Tessellator.Surface,
    phi_max: f64,

    fn sampleAt(self: *const Hyperboloid, column: u32, row: u32) Sample {
        const phi = share(column, self.surface.grid.columns) * self.phi_max;
        const cosine = elementary.cos(phi);
        const sine = elementary.sin(phi);
        const v = share(row, self.surface.grid.rows);
        const along = vec3d.sub(self.last, self.first);
        const on_line = vec3d.add(self.first, vec3d.scale(along, v));
        const point = turn(on_line, cosine, sine);
        const across: Vector = .{ -point[1], point[0], 0 };
        const normal = vec3d.cross(across, turn(along, cosine, sine));
        return .{ .point = point, .normal = vec3d.normalize(normal) orelse .{ 0, 0, 0 } };
    }

    fn turn(vector: Vector, cosine: f64, sine: f64) Vector {
        return .{
            vector[0] * cosine - vector[1] * sine,
            vector[0] * sine + vector[1] * cosine,
            vector[2],
        };
    }
};

/// The line from `p1` to `p2`, turned about z.
pub fn hyperboloid(tessellator: *Tessellator) Error!Geometry {
    const first = tessellator.parameters.vector("p1", .{ 0, 0, 0 });
    const last = tessellator.parameters.vector("p2", .{ 1, 1, 1 });
    const phi_max = try tessellator.sweep();
    const turned: Hyperboloid = .{
        .first = .{ first[0], first[1], first[2] },
        .last = .{ last[0], last[1], last[2] },
        .phi_max = phi_max,
        .surface = .{
            .grid = gridOf(tessellator, phi_max, tessellator.steps(std.math.pi, 2)),
            .first_row_is_point = first[0] == 0 and first[1] == 0,
            .last_row_is_point = last[0] == 0 and last[1] == 0,
        },
    };
    return tessellator.tessellate(turned.surface, &turned, Hyperboloid.sampleAt);
}
