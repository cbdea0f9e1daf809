//! What the pictures of a film have of one of them, so that nothing jumps: a camera that frames the
//! scene, the turn of what is fixed to the camera, the height of the floor.
//!
//! In: the world and the view of that picture. Out: the same for the world of another moment, whose
//! places may be shifted otherwise.

const std = @import("std");
const math = @import("../math.zig");
const pose = @import("pose.zig");
const vec3d = math.vec3d;
const view_file = @import("view.zig");
const world = @import("../world.zig");
const Reference = @This();

/// By which studio and default lights are turned.
facing: world.Camera,
/// Null: nothing to stand on, or nobody asked.
floor_height: ?f32,
/// Null: the file's own camera, wherever it is by then.
view: ?view_file.View,
/// What was subtracted from all places.
shift: math.Vec3d,

/// Of a world that has a view. `is_framed`: its camera is none of the file's.
pub fn of(seen: *const world.World, is_framed: bool, shift: math.Vec3d) Reference {
    return .{
        .facing = seen.view.camera,
        .floor_height = seen.environment.floor_height,
        .view = if (!is_framed) null else .{
            .camera = seen.view.camera,
            .width = seen.view.width,
            .height = seen.view.height,
            .camera_is_default = seen.facts.camera_is_default,
        },
        .shift = shift,
    };
}

/// The same where `shift` is subtracted.
pub fn shiftedBy(reference: *const Reference, shift: math.Vec3d) Reference {
    var shifted = reference.*;
    shifted.shift = shift;
    if (std.meta.eql(shift, reference.shift)) return shifted;
    const way = vec3d.sub(reference.shift, shift);
    if (shifted.floor_height) |*height| height.* = @floatCast(height.* + way[1]);
    if (shifted.view) |*view| {
        const origin = pose.widen(view.camera.origin);
        view.camera.origin = pose.round(vec3d.add(origin, way));
    }
    return shifted;
}

test "a camera stays where it is in the scene, however places are shifted" {
    const reference: Reference = .{
        .facing = undefined,
        .floor_height = 2,
        .view = .{
            .camera = .{
                .orthographic = false,
                .origin = .{ 1, 2, 3 },
                .right = .{ 1, 0, 0 },
                .up = .{ 0, 1, 0 },
                .forward = .{ 0, 0, -1 },
            },
            .width = 4,
            .height = 3,
            .camera_is_default = true,
        },
        .shift = .{ 1024, 0, -2048 },
    };
    const same = reference.shiftedBy(reference.shift);
    try std.testing.expectEqual(reference.view.?.camera, same.view.?.camera);
    const other = reference.shiftedBy(.{ 0, 8, 0 });
    try std.testing.expectEqual(math.Vec3{ 1025, -6, -2045 }, other.view.?.camera.origin);
    try std.testing.expectEqual(-6, other.floor_height.?);
}
