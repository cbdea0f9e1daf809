//! Pinhole and orthographic cameras: from pixels to primary rays, and from lanes back to pixels.
//!
//! In: the view, a bundle's place in the picture. Out: rays, affine in the place and not
//! normalised, so that all pixels of a bundle can share work; samples on the film.

const std = @import("std");
const world_file = @import("../../world.zig");
const vec3 = @import("../../math.zig").vec3;
const bundle_file = @import("../traverse/bundle.zig");
const ray_file = @import("../traverse/ray.zig");
const film_file = @import("../../film.zig");
const statistics = @import("../../statistics.zig");
const Grid = @import("../traverse/beam/grid.zig").Grid;
const Offset = @import("sampler.zig").Offset;
const Rectangle = film_file.Rectangle;

/// The rays through pixels of a bundle, those within the rectangle, at a place in each.
pub fn primaryRays(
    comptime Kernel: type,
    view: *const world_file.View,
    rectangle: Rectangle,
    offset: Offset,
    bundle: *bundle_file.Bundle(Kernel),
) void {
    const F32 = Kernel.Rays.F32;
    const end_column: F32 = .splat(@floatFromInt(rectangle.x1));
    const end_row: F32 = .splat(@floatFromInt(rectangle.y1));
    for (&bundle.groups, 0..) |*ray, group| {
        const column, const row = pixels(Kernel, rectangle, group);
        const inside = column.lt(end_column).bitAnd(row.lt(end_row));
        const x = column.add(.splat(offset.x));
        const y = row.add(.splat(offset.y));
        const line = generate(Kernel.Rays, view, x, y);
        ray.* = .endless(line, .splat(ray_file.no_primitive), inside);
    }
}

/// Column and row of the pixels of a group, which floats hold exactly.
pub inline fn pixels(
    comptime Kernel: type,
    rectangle: Rectangle,
    group: usize,
) [2]Kernel.Rays.F32 {
    const F32 = Kernel.Rays.F32;
    const step = rectangle.step;
    const first_column: f32 = @floatFromInt(rectangle.x0 + step * Kernel.pixelX(group, 0));
    const first_row: f32 = @floatFromInt(rectangle.y0 + step * Kernel.pixelY(group, 0));
    const apart: F32 = .splat(@floatFromInt(step));
    return .{
        F32.fromArray(Kernel.lane_x).mul(apart).add(.splat(first_column)),
        F32.fromArray(Kernel.lane_y).mul(apart).add(.splat(first_row)),
    };
}

/// Which sample of which pixels.
pub const Place = struct { rectangle: Rectangle, sample: u32 };

/// Adds a sample of each pixel to a layer of the film, four channels each: of radiance the share
/// that saw nothing, else see `Film.addApart`.
pub fn expose(
    comptime Kernel: type,
    film: *film_file.Film,
    layer: film_file.Layer,
    place: Place,
    colors: *const [Kernel.group_count]Kernel.Rays.Vec3,
    shares: *const [Kernel.group_count]Kernel.Rays.F32,
) void {
    const rectangle = place.rectangle;
    for (colors, shares, 0..) |*light, *share, group| {
        const red = light.x.toArray();
        const green = light.y.toArray();
        const blue = light.z.toArray();
        const fourth = share.toArray();
        for (0..Kernel.ray_count) |lane| {
            const x = rectangle.x0 + rectangle.step * Kernel.pixelX(group, lane);
            const y = rectangle.y0 + rectangle.step * Kernel.pixelY(group, lane);
            if (x >= rectangle.x1 or y >= rectangle.y1) continue;
            const value = .{ red[lane], green[lane], blue[lane], fourth[lane] };
            const column, const row = rectangle.placeOf(x, y);
            if (layer == .color)
                film.add(column, row, place.sample, value)
            else
                film.addApart(layer, column, row, place.sample, value);
        }
    }
}

/// Adds the tests that a sample of a bundle's pixels took, as many to each, to the film.
pub fn exposeCost(
    comptime Kernel: type,
    film: *film_file.Film,
    place: Place,
    before: statistics.TestCounts,
    after: statistics.TestCounts,
) void {
    const pixel_count: f32 = @floatFromInt(place.rectangle.pixelCount());
    const boxes: f32 = @floatFromInt(after.box_useful - before.box_useful);
    const triangles: f32 = @floatFromInt(after.triangle_useful - before.triangle_useful);
    const cost = .{ boxes / pixel_count, triangles / pixel_count, 0 };
    const costs: [Kernel.group_count]Kernel.Rays.Vec3 = @splat(.splat(cost));
    const zeros: [Kernel.group_count]Kernel.Rays.F32 = @splat(.zero());
    expose(Kernel, film, .cost, place, &costs, &zeros);
}

/// The rays through points (x, y) of the picture in pixels from its upper left corner.
inline fn generate(
    comptime Lanes: type,
    view: *const world_file.View,
    x: Lanes.F32,
    y: Lanes.F32,
) ray_file.Line(Lanes) {
    const camera = &view.camera;
    const width: f32 = @floatFromInt(view.width);
    const height: f32 = @floatFromInt(view.height);
    const one: Lanes.F32 = .splat(1);
    const across = x.mul(.splat(2 / width)).sub(one);
    const upward = one.sub(y.mul(.splat(2 / height)));
    const right: Lanes.Vec3 = .splat(camera.right);
    const up: Lanes.Vec3 = .splat(camera.up);
    const origin: Lanes.Vec3 = .splat(camera.origin);
    const forward: Lanes.Vec3 = .splat(camera.forward);
    const base = if (camera.orthographic) origin else forward;
    const point = base.add(right.scale(across)).add(up.scale(upward));
    return if (camera.orthographic)
        .{ .origin = point, .direction = forward }
    else
        .{ .origin = origin, .direction = point };
}

/// Part of a sample's area that its footprint covers: lookups between texels and levels average
/// over more than that. Of 1/4, 1/2, 1 and 2 it comes nearest to pictures of 256 samples.
const footprint_share = 0.5;

/// How wide primary rays are.
pub const Footprint = struct {
    /// At the origin, in metres.
    width: f32,
    /// Growth by distance, times the length of the ray's direction.
    slope: f32,
};

/// Of the part of a pixel that one of its samples stands for: a square of the same area.
pub fn footprint(view: *const world_file.View, sample_count: u32) Footprint {
    const camera = &view.camera;
    const width: f32 = @floatFromInt(view.width);
    const height: f32 = @floatFromInt(view.height);
    const across = vec3.length(camera.right) * (2 / width);
    const upward = vec3.length(camera.up) * (2 / height);
    const count: f32 = @floatFromInt(sample_count);
    const side = @sqrt(footprint_share * across * upward / count);
    return if (camera.orthographic)
        .{ .width = side, .slope = 0 }
    else
        .{ .width = 0, .slope = side };
}

/// The directions of the primary rays of a bundle, pixel by pixel; null where they do not share an
/// origin.
pub fn grid(view: *const world_file.View, rectangle: Rectangle, offset: Offset) ?Grid {
    const camera = &view.camera;
    if (camera.orthographic) return null;
    const width: f32 = @floatFromInt(view.width);
    const height: f32 = @floatFromInt(view.height);
    const step: f32 = @floatFromInt(rectangle.step);
    const right = vec3.scale(camera.right, 2 * step / width);
    const down = vec3.scale(camera.up, -2 * step / height);
    const x = @as(f32, @floatFromInt(rectangle.x0)) + offset.x;
    const y = @as(f32, @floatFromInt(rectangle.y0)) + offset.y;
    const start = generate(ray_file.Single, view, .splat(x), .splat(y));
    // Samples may lie so many times the half extents from the middle of the picture, beyond its
    // edges where the filter is.
    const beyond = @max(@abs(offset.x - 0.5), @abs(offset.y - 0.5), 0.5) - 0.5;
    const reach = 1 + 2 * beyond / @min(width, height);
    var extent: f32 = 0;
    for (camera.right ++ camera.up) |component| extent += reach * @abs(component);
    for (camera.forward) |component| extent += @abs(component);
    return .{
        .origin = camera.origin,
        .corner = start.direction.lane(0),
        .right = right,
        .down = down,
        // `generate` rounds x and y 3 times, their products and two sums once; `start` as well,
        // and steps within the picture are as many again.
        .deviation_ulps = 12 * extent,
    };
}

test "a cone is as wide as what a sample stands for, wherever it is cut" {
    var view: world_file.View = .nowhere;
    view.width = 40;
    view.height = 20;
    view.camera.right = .{ 2, 0, 0 };
    view.camera.forward = .{ 0, 0, -4 };
    // Pixels are 0.1 wide and high where the direction ends.
    const expected: f32 = 0.1 * 0.70710678 / 2.0;
    const perspective = footprint(&view, 4);
    try std.testing.expectEqual(0, perspective.width);
    try std.testing.expectApproxEqRel(expected, perspective.slope, 1e-6);
    view.camera.orthographic = true;
    const orthographic = footprint(&view, 4);
    try std.testing.expectEqual(0, orthographic.slope);
    try std.testing.expectApproxEqRel(expected, orthographic.width, 1e-6);
}
