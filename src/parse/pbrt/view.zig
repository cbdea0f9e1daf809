//! Camera and film: what the picture shows, and how large it is.
//!
//! In: the parameters of Camera and Film. Out: a projection of ours and a size in pixels. PBRT's
//! fov spans the shorter side of the picture; ours the vertical one.

const std = @import("std");
const elementary = @import("../../math.zig").elementary;
const quote = @import("../../diagnostic.zig").quote;
const scene = @import("../../scene.zig");
const settings = @import("../../settings.zig");
const Input = @import("input.zig");
const Parameters = @import("parameters.zig");
const math = @import("../../math.zig");
const transforms = @import("transform.zig");
const Transform = math.AffineD;
const Error = Input.Error;

const View = @This();

/// What sees as the eye does: the other sensors of version 4 are cameras'.
const plain_sensor = "cie1931";
const film_scale_max = 1e6;

/// Of the film, in pixels.
size: [2]u32 = .{ 640, 480 },
/// The film is not one of the older dialects.
is_version_4: bool = false,
/// What the film multiplies radiance with.
film_scale: f32 = 1,
/// How long the shutter is open, which counts in version 4 alone.
open_time: f32 = 1,
kind: enum { perspective, orthographic } = .perspective,
/// Angle over the shorter side.
fov_deg: f64 = 90,
/// Left, right, bottom and top on the screen, in units of half of the shorter side.
window: ?[4]f64 = null,
/// Width over height of the screen, where it is not the film's.
aspect: ?f64 = null,
/// From the camera's space into the world; null until a Camera stands there.
place: ?Transform = null,

/// `Film "name" ...`.
pub fn setFilm(
    view: *View,
    input: *Input,
    parameters: *const Parameters,
    name: []const u8,
) Error!void {
    view.is_version_4 = !std.mem.eql(u8, name, "image");
    // Version 3's own is that of version 4, but its name is that of version 2.
    var size: [2]u32 = if (view.is_version_4) .{ 1280, 720 } else .{ 640, 480 };
    for (&size, [_][]const u8{ "xresolution", "yresolution" }) |*side, key| {
        const value = parameters.integer(key) orelse continue;
        if (!settings.side.holds(value))
            return input.failHere("{s} is {d}, not " ++ settings.side.text(), .{ key, value });
        side.* = @intCast(value);
    }
    if (@as(u64, size[0]) * size[1] > settings.pixel_count_max)
        return input.failHere("the film has over {d} pixels", .{settings.pixel_count_max});
    if (parameters.find("cropwindow") != null or parameters.find("pixelbounds") != null)
        try input.warnHere("cropwindow", "Film: crop windows are not supported", .{});
    view.film_scale = parameters.float("scale", 1);
    if (view.is_version_4) {
        view.film_scale = parameters.float("iso", 100) / 100;
        const sensor = parameters.string("sensor") orelse plain_sensor;
        if (!std.mem.eql(u8, sensor, plain_sensor) or parameters.float("whitebalance", 0) != 0)
            try input.warnHere("sensor", "Film: sensors and white balance are not read", .{});
    }
    if (!(view.film_scale > 0 and view.film_scale <= film_scale_max)) {
        try input.warnHere("film scale", "Film: its scale is {d}, taken as 1", .{view.film_scale});
        view.film_scale = 1;
    }
    view.size = size;
}

/// `Camera "name" ...`; `to_camera` is the current transformation.
pub fn setCamera(
    view: *View,
    input: *Input,
    name: []const u8,
    parameters: *const Parameters,
    to_camera: *const Transform,
) Error!void {
    const place = to_camera.inverse() orelse
        return input.failHere("the camera's transformation has no inverse", .{});
    if (!transforms.fitsSingle(&place))
        return input.failHere("the camera is too far away", .{});
    var result: View = .{
        .size = view.size,
        .is_version_4 = view.is_version_4,
        .film_scale = view.film_scale,
        .place = place,
    };
    const opens = parameters.float("shutteropen", 0);
    const open_time = @abs(parameters.float("shutterclose", 1) - opens);
    if (open_time > 0 and open_time <= film_scale_max) result.open_time = open_time;
    if (std.mem.eql(u8, name, "orthographic")) {
        result.kind = .orthographic;
    } else if (!std.mem.eql(u8, name, "perspective")) {
        parameters.pass();
        try input.warnHere(
            name,
            "Camera {f} is not supported: a perspective one with fov 90 stands for it",
            .{quote(name)},
        );
    }
    const fov_name = if (parameters.find("halffov") != null) "halffov" else "fov";
    const factor: f64 = if (parameters.find("halffov") != null) 2 else 1;
    result.fov_deg = factor * parameters.float(fov_name, @floatCast(90 / factor));
    if (!(result.fov_deg > 0 and result.fov_deg < 180))
        return input.failHere("the camera's fov is {d}, not between 0 and 180", .{result.fov_deg});
    if (parameters.find("frameaspectratio") != null) {
        const aspect = parameters.float("frameaspectratio", 1);
        if (!(aspect > 1e-4 and aspect < 1e4))
            return input.failHere("the frame's aspect ratio is {d}", .{aspect});
        result.aspect = aspect;
    }
    if (parameters.floatsNamed("screenwindow")) |window| {
        if (window.len != 4 or window[0] == window[1] or window[2] == window[3])
            return input.failHere("the screen window is not [left right bottom top]", .{});
        result.window = .{ window[0], window[1], window[2], window[3] };
    }
    if (parameters.float("lensradius", 0) > 0)
        try input.warnHere("lensradius", "Camera: lenses are not supported, all is in focus", .{});
    view.* = result;
}

/// What light is multiplied with on its way to the picture.
pub fn exposure(view: *const View) f32 {
    return if (view.is_version_4) view.film_scale * view.open_time else view.film_scale;
}

/// The projection, and where it is seen from: windows beside the middle move an orthographic
/// camera, a perspective one is turned to the middle.
pub fn projection(view: *View, input: *Input) Error!scene.Camera.Projection {
    const film = @as(f64, @floatFromInt(view.size[0])) / @as(f64, @floatFromInt(view.size[1]));
    const aspect = view.aspect orelse film;
    var window = view.window orelse if (aspect >= 1)
        [4]f64{ -aspect, aspect, -1, 1 }
    else
        [4]f64{ -1, 1, -1 / aspect, 1 / aspect };
    // A screen from right to left, or from top to bottom, is a mirror's.
    for (0..2) |axis| {
        const ends = window[2 * axis ..][0..2];
        if (ends[0] < ends[1]) continue;
        var mirror: math.Vec3d = .{ 1, 1, 1 };
        mirror[axis] = -1;
        view.place = view.place.?.compose(.scale(mirror));
        for (ends) |*end| end.* = -end.*;
    }
    // Within what a camera can show in the end.
    const half_width = std.math.clamp(0.5 * (window[1] - window[0]), 1e-9, 1e9);
    const half_height = std.math.clamp(0.5 * (window[3] - window[2]), 1e-9, 1e9);
    const middle: math.Vec3d =
        .{ 0.5 * (window[0] + window[1]), 0.5 * (window[2] + window[3]), 0 };
    if (@abs(half_width / half_height / film - 1) > 0.01) try input.warn(
        0,
        "stretch",
        "Camera: the screen is not as wide as the film, which shows more than it",
        .{},
    );
    switch (view.kind) {
        .orthographic => {
            view.place.? = view.place.?.moved(middle);
            return .{ .orthographic = .{
                .half_width = @floatCast(half_width),
                .half_height = @floatCast(half_height),
            } };
        },
        .perspective => {
            if (middle[0] != 0 or middle[1] != 0) try input.warn(
                0,
                "window",
                "Camera: the screen window is taken as if it were in the middle",
                .{},
            );
            const slope = elementary.tan(0.5 * view.fov_deg * (std.math.pi / 180.0)) * half_height;
            const angle = 2 * std.math.atan(slope);
            return .{ .perspective = .{
                .y_fov_rad = @floatCast(std.math.clamp(angle, 1e-6, 3.14159)),
                .aspect = @floatCast(half_width / half_height),
            } };
        },
    }
}
