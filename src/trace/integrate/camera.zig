//! Pinhole and orthographic cameras: primary rays of pixels in lanes.
//!
//! In: the view, places in the picture. Out: origins and directions, affine in the place and not
//! normalised, so that all pixels of a bundle can share work.

const world_file = @import("../../world.zig");
const vec3 = @import("../../math.zig").vec3;
const ray_file = @import("../traverse/ray.zig");
const Grid = @import("../traverse/beam/grid.zig").Grid;

/// The rays through points (x, y) of the picture in pixels from its upper left corner.
pub inline fn generate(
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

/// The directions of the rays around the one through (x, y), pixel by pixel; null where rays do not
/// share an origin.
pub fn grid(view: *const world_file.View, x: f32, y: f32) ?Grid {
    const camera = &view.camera;
    if (camera.orthographic) return null;
    const width: f32 = @floatFromInt(view.width);
    const height: f32 = @floatFromInt(view.height);
    const right = vec3.scale(camera.right, 2 / width);
    const down = vec3.scale(camera.up, -2 / height);
    const start = generate(ray_file.Single, view, .splat(x), .splat(y));
    var extent: f32 = 0;
    for (camera.right ++ camera.up ++ camera.forward) |component| extent += @abs(component);
    return .{
        .origin = camera.origin,
        .corner = start.direction.lane(0),
        .right = right,
        .down = down,
        // `generate` rounds x and y 3 times, their products and two sums once; `start` as well,
        // and steps of up to a tile are as many again.
        .deviation_roundings = 12 * extent,
    };
}
