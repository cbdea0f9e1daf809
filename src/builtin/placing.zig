//! Lights and cameras of procedural scenes, each by where it stands and where it looks.

const std = @import("std");
const math = @import("../math.zig");
const geometry = @import("geometry.zig");
const scene_data = @import("../scene.zig");
const Affine = math.Affine;
const Point = geometry.Point;
const Error = std.mem.Allocator.Error;
const assert = std.debug.assert;

/// Where a camera stands and what it sees.
pub const View = struct {
    name: []const u8,
    eye: Point,
    target: Point,
    /// Full vertical angle.
    y_fov_deg: f64,
    /// Of its picture, in pixels.
    resolution: [2]u32,
};

/// Adds a point light; `intensity` in candela.
pub fn addPointLight(
    builder: *scene_data.Builder,
    position: Point,
    color: math.Vec3,
    intensity: f32,
) Error!void {
    const place: Affine = .translate(geometry.toVec3(position));
    try addLight(builder, .point, place, color, intensity);
}

/// Adds a directional light that comes from the direction `toward_light`; `intensity` in lux.
pub fn addDirectionalLight(
    builder: *scene_data.Builder,
    toward_light: Point,
    color: math.Vec3,
    intensity: f32,
) Error!void {
    try addLight(builder, .directional, lookAt(.{ 0, 0, 0 }, -toward_light), color, intensity);
}

fn addLight(
    builder: *scene_data.Builder,
    kind: scene_data.Light.Kind,
    place: Affine,
    color: math.Vec3,
    intensity: f32,
) Error!void {
    const node = try builder.addNode(scene_data.none, .of(place));
    try builder.addLight(.{ .kind = kind, .node = node, .color = color, .intensity = intensity });
}

/// Adds a camera, and the size of its picture.
pub fn addCamera(builder: *scene_data.Builder, view: View) Error!void {
    assert(view.y_fov_deg > 0 and view.y_fov_deg < 180);
    const place = lookAt(view.eye, view.target - view.eye);
    try builder.addCamera(.{
        .name = view.name,
        .node = try builder.addNode(scene_data.none, .of(place)),
        .projection = .{ .perspective = .{
            .y_fov_rad = @floatCast(view.y_fov_deg * (std.math.pi / 180.0)),
            .aspect = null,
        } },
    });
    builder.scene.resolution = view.resolution;
}

/// The placement at `origin` whose -z points along `forward` and whose y points up as far as it
/// can. Asserts that `forward` is not vertical.
fn lookAt(origin: Point, forward: Point) Affine {
    const z = geometry.normalize(-forward);
    const x = geometry.normalize(geometry.cross(.{ 0, 1, 0 }, z));
    const y = geometry.cross(z, x);
    return .{
        .x = geometry.toVec3(x),
        .y = geometry.toVec3(y),
        .z = geometry.toVec3(z),
        .translation = geometry.toVec3(origin),
    };
}

test "a camera looks along -z with y up" {
    const place = lookAt(.{ 1, 2, 3 }, .{ 0, 0, 5 });
    try std.testing.expectEqual(math.Vec3{ -1, 0, 0 }, place.x);
    try std.testing.expectEqual(math.Vec3{ 0, 1, 0 }, place.y);
    try std.testing.expectEqual(math.Vec3{ 0, 0, -1 }, place.z);
    const tilted = lookAt(.{ 0, 0, 0 }, .{ 1, -1, 2 });
    try std.testing.expectApproxEqAbs(@as(f32, 1), tilted.determinant(), 1e-6);
    try std.testing.expect(tilted.y[1] > 0);
}
