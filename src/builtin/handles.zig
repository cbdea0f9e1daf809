//! A closed surface with many handles: tubes round the Villarceau circles of a torus, blended.
//!
//! Every point of a torus lies on two circles that are neither its meridians nor its parallels (Y.
//! Villarceau, 1848). Taking `circle_count` circles of each kind gives 2 circle_count^2 crossings,
//! where their tubes melt into each other: one surface of genus 2 circle_count^2 + 1. The tubes
//! are thinner near the torus's axis, where they lie closer.

const std = @import("std");
const elementary = @import("../math.zig").elementary;
const geometry = @import("geometry.zig");
const isosurface = @import("isosurface.zig");
const MeshBuilder = @import("mesh_builder.zig");
const placing = @import("placing.zig");
const scene_data = @import("../scene.zig");
const Place = geometry.Place;
const Point = geometry.Point;
const Slope = isosurface.Slope;
const Builder = scene_data.Builder;
const Scene = scene_data.Scene;
const Allocator = std.mem.Allocator;
const assert = std.debug.assert;

/// Circles of each of the two kinds.
const circle_count = 10;
const major_radius = 1.0;
const minor_radius = 0.55;
/// Radius of a single tube: this times the distance from the torus's axis plus `tube_offset`.
const tube_ratio = 0.05;
const tube_offset = 0.3;
/// Where the influence of a circle ends, over the same distance.
const reach_ratio = 2 * tube_ratio;
/// What one circle contributes on the surface of its tube: (1 - 1/4)^3.
const iso_value = 0.421875;

const grid: isosurface.Grid = .{
    .lower = .{ -1.72, -0.74, -1.72 },
    .cell = 0.0247,
    .counts = .{ 140, 60, 140 },
};

/// The scene, owned by the caller.
pub fn build(gpa: Allocator) Allocator.Error!Scene {
    var builder: Builder = .init(gpa);
    errdefer builder.deinit();
    const lowest = try addSculpture(&builder, gpa);
    try addStudio(&builder, lowest);
    try placing.addDirectionalLight(&builder, .{ -0.55, 0.75, 0.5 }, .{ 1, 0.95, 0.87 }, 3.4);
    try placing.addPointLight(&builder, .{ 3.5, 2.5, 3 }, .{ 0.7, 0.82, 1 }, 7);
    builder.scene.ambient = 0.22;
    try placing.addCamera(&builder, .{
        .name = "sculpture",
        .eye = .{ 0.4, 1.5, 6.2 },
        .target = .{ 0, -0.12, 0 },
        .y_fov_deg = 36,
        .resolution = .{ 1024, 768 },
    });
    return builder.finish();
}

/// How the torus, whose axis is y, is turned for the view: leaning back and to the side.
const pose: Place = .{
    .x = .{ 0.936, 0.352, 0 },
    .y = .{ -0.2112, 0.5616, 0.8 },
    .z = .{ 0.2816, -0.7488, 0.6 },
    .translation = .{ 0, 0, 0 },
};

/// Adds the sculpture about the origin and returns the height of its lowest point.
fn addSculpture(builder: *Builder, gpa: Allocator) Allocator.Error!f64 {
    var surface = try isosurface.build(gpa, grid, Tubes.init());
    defer surface.deinit(gpa);
    var mesh: MeshBuilder = .init(builder.arena());
    mesh.place = pose;
    var lowest: f64 = 0;
    for (surface.positions, surface.normals) |position, normal| {
        _ = try mesh.vertex(position, normal);
        const height = pose.point(position)[1];
        if (height < lowest) lowest = height;
    }
    for (surface.triangles) |t| try mesh.triangle(t[0], t[1], t[2]);
    const material = try builder.addMaterial(.{
        .base_color = .{ 0.03, 0.33, 0.40, 1 },
        .metallic = 0,
        .roughness = 0.22,
    });
    try builder.addWorldMesh(try mesh.finish(material));
    return lowest;
}

/// Adds a floor that bends up into a wall behind, as photographers use.
fn addStudio(builder: *Builder, floor_y: f64) Allocator.Error!void {
    var mesh: MeshBuilder = .init(builder.arena());
    mesh.place = .translate(.{ 0, floor_y, 0 });
    const bend = 3.0;
    const bend_z = -3.5;
    const segments = 16;
    const half_width = 14.0;
    var points: [2 * (segments + 3)]Point = undefined;
    points[0] = .{ -half_width, 0, 9 };
    points[1] = .{ half_width, 0, 9 };
    for (0..segments + 1) |segment| {
        const share = @as(f64, @floatFromInt(segment)) / segments;
        const angle_rad = std.math.pi / 2.0 * share;
        const y = bend * (1 - elementary.cos(angle_rad));
        const z = bend_z - bend * elementary.sin(angle_rad);
        points[2 * segment + 2] = .{ -half_width, y, z };
        points[2 * segment + 3] = .{ half_width, y, z };
    }
    points[2 * segments + 4] = .{ -half_width, 9, bend_z - bend };
    points[2 * segments + 5] = .{ half_width, 9, bend_z - bend };
    try mesh.patch(.{ .points = &points, .columns = 2 });
    const material = try builder.addMaterial(.{
        .base_color = .{ 0.55, 0.57, 0.6, 1 },
        .metallic = 0,
        .roughness = 0.9,
    });
    try builder.addWorldMesh(try mesh.finish(material));
}

/// A circle in space.
const Circle = struct {
    center: Point,
    /// Unit normal of its plane.
    normal: Point,

    /// Squared distance of a point from the circle.
    fn distanceSquared(circle: Circle, p: Point) f64 {
        const q = p - circle.center;
        const height = geometry.dot(q, circle.normal);
        const radial_squared = geometry.dot(q, q) - height * height;
        const ring = @sqrt(if (radial_squared > 0) radial_squared else 0) - major_radius;
        return height * height + ring * ring;
    }

    /// Half the gradient of `distanceSquared`. Asserts that the point is off the circle's axis.
    fn distanceGradient(circle: Circle, p: Point) Point {
        const q = p - circle.center;
        const height = geometry.dot(q, circle.normal);
        const radial = q - geometry.scale(circle.normal, height);
        const radius = geometry.length(radial);
        assert(radius > 0.1);
        return geometry.scale(circle.normal, height) +
            geometry.scale(radial, (radius - major_radius) / radius);
    }
};

/// The field: the sum over all circles of (1 - d^2 / (reach_ratio s)^2)^3 within reach, where d is
/// the distance from the circle and s that from the torus's axis plus `tube_offset`, minus
/// `iso_value`.
const Tubes = struct {
    circles: [2 * circle_count]Circle,

    fn init() Tubes {
        // The planes touch the tube's section on both sides: their slope has the sine r / R.
        const sine = minor_radius / major_radius;
        const cosine = @sqrt(1 - sine * sine);
        var tubes: Tubes = undefined;
        for (&tubes.circles, 0..) |*circle, index| {
            const first_kind = index < circle_count;
            const step: f64 = @floatFromInt(index % circle_count);
            const azimuth_rad = 2 * std.math.pi * step / circle_count;
            const sin = elementary.sin(azimuth_rad);
            const cos = elementary.cos(azimuth_rad);
            const tilt: f64 = if (first_kind) sine else -sine;
            circle.* = .{
                .center = .{ minor_radius * sin, 0, minor_radius * cos },
                .normal = .{ tilt * cos, -cosine, -tilt * sin },
            };
        }
        return tubes;
    }

    /// Samples a cube of `box_samples`^3 points, taking only the circles that reach into it.
    pub fn values(tubes: Tubes, lower: Point, cell: f64, out: []f64) void {
        const edge = cell * (isosurface.box_samples - 1);
        const middle = lower + @as(Point, @splat(edge / 2));
        const half_diagonal = edge * 0.8661;
        const axis_distance = axisDistance(middle);
        const thickest = reach_ratio * (axis_distance + half_diagonal + tube_offset);
        const bound = thickest + half_diagonal;
        var near: [2 * circle_count]Circle = undefined;
        var near_count: usize = 0;
        for (tubes.circles) |circle| {
            if (circle.distanceSquared(middle) > bound * bound) continue;
            near[near_count] = circle;
            near_count += 1;
        }
        if (near_count == 0) return @memset(out, -iso_value);
        for (out, 0..) |*result, index| {
            const p = lower + geometry.scale(isosurface.boxOffset(index), cell);
            const reach = reach_ratio * (axisDistance(p) + tube_offset);
            const reach_squared = reach * reach;
            var sum: f64 = -iso_value;
            for (near[0..near_count]) |circle| {
                const squared = circle.distanceSquared(p);
                if (!(squared < reach_squared)) continue;
                const rest = 1 - squared / reach_squared;
                sum += rest * rest * rest;
            }
            result.* = sum;
        }
    }

    /// The field and its gradient at one point.
    pub fn slope(tubes: Tubes, p: Point) Slope {
        const axis_distance = axisDistance(p);
        const reach = reach_ratio * (axis_distance + tube_offset);
        const reach_squared = reach * reach;
        const per_coordinate = reach * reach_ratio / axis_distance;
        const reach_gradient: Point = .{ per_coordinate * p[0], 0, per_coordinate * p[2] };
        var result: Slope = .{ .value = -iso_value, .gradient = .{ 0, 0, 0 } };
        for (tubes.circles) |circle| {
            const squared = circle.distanceSquared(p);
            if (!(squared < reach_squared)) continue;
            const share = squared / reach_squared;
            const rest = 1 - share;
            result.value += rest * rest * rest;
            // d/dp of share = squared / reach_squared, both gradients halved above.
            const change = circle.distanceGradient(p) - geometry.scale(reach_gradient, share);
            result.gradient -= geometry.scale(change, 6 * rest * rest / reach_squared);
        }
        return result;
    }

    fn axisDistance(p: Point) f64 {
        return @sqrt(p[0] * p[0] + p[2] * p[2]);
    }
};

test "the gradient is that of the field" {
    const tubes: Tubes = .init();
    const p: Point = .{ 0.1, 0.52, 1.2 };
    const slope = tubes.slope(p);
    inline for (0..3) |axis| {
        var a = p;
        var b = p;
        a[axis] -= 1e-6;
        b[axis] += 1e-6;
        const difference = (tubes.slope(b).value - tubes.slope(a).value) / 2e-6;
        try std.testing.expectApproxEqAbs(difference, slope.gradient[axis], 1e-5);
    }
    try std.testing.expect(geometry.length(slope.gradient) > 0.1);
}

test "one closed surface with the promised number of handles" {
    const gpa = std.testing.allocator;
    var scene = try build(gpa);
    defer scene.deinit();
    const mesh = scene.meshes[0];
    const handles = try isosurface.genus(gpa, mesh.positions.len, mesh.triangles);
    try std.testing.expectEqual(2 * circle_count * circle_count + 1, handles);
}
