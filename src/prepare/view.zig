//! The view: which camera, and how large the picture.
//!
//! In: the scene's cameras, the user's wishes, and the triangles to frame where no camera is
//! wanted or there. Out: the camera of the world and the picture's size. Pixels are square; where
//! the picture's aspect is not the camera's, more is shown, above and below or at the sides, and
//! nothing is cut off (glTF 2.0, section 3.10.3). Scale and mirroring of a camera's node do not
//! count (section 3.10.2).

const std = @import("std");
const math = @import("../math.zig");
const scene = @import("../scene.zig");
const settings = @import("../settings.zig");
const world = @import("../world.zig");
const diagnostic_module = @import("../diagnostic.zig");
const framing = @import("framing.zig");
const assert = std.debug.assert;
const vec3 = math.vec3;
const pose = @import("pose.zig");
const vec3d = math.vec3d;
const viewpoint_file = @import("viewpoint.zig");
const AffineD = math.AffineD;
const Diagnostic = diagnostic_module.Diagnostic;
const Vec3 = math.Vec3;

pub const Error = error{ OutOfMemory, CameraUnknown };

const size_default = settings.long_side.default;
const aspect_default = 4.0 / 3.0;

/// What the picture shows.
pub const View = struct {
    camera: world.Camera,
    width: u32,
    height: u32,
    /// No camera of the file was used.
    camera_is_default: bool,
};

/// What the user wants of it, see `settings.View`.
pub const Wanted = struct {
    camera: settings.Camera = .default,
    viewpoint: settings.Viewpoint = .{},
    resolution: ?[2]u32 = null,
    long_side: ?u32 = null,

    /// Picture size; `width_over_height` is the camera's own aspect.
    fn size(wanted: *const Wanted, from: *const scene.Scene, width_over_height: f64) [2]u32 {
        if (wanted.resolution) |resolution| return resolution;
        const long_side = wanted.long_side orelse
            return from.resolution orelse sizeOf(width_over_height, size_default);
        return sizeOf(if (from.resolution) |film| aspect(film) else width_over_height, long_side);
    }
};

/// Chooses. `maps` holds a world map for each node.
pub fn choose(
    gpa: std.mem.Allocator,
    from: *const scene.Scene,
    maps: []const AffineD,
    geometry: *const world.Geometry,
    wanted: *const Wanted,
    diagnostic: *Diagnostic,
) Error!View {
    const viewpoint = &wanted.viewpoint;
    const in_place = viewpoint.replacesCamera();
    if (if (in_place) null else try find(from, wanted.camera, diagnostic)) |found| {
        const camera = &from.cameras[found];
        const size = wanted.size(from, aspectOf(camera) orelse aspect_default);
        if (place(camera, maps[camera.node], viewpoint.fov_degrees, size)) |placed| {
            if (camera.projection == .orthographic and viewpoint.fov_degrees != null)
                diagnostic.warn("camera {d} is orthographic and has no fov to change", .{found});
            return .{
                .camera = placed,
                .width = size[0],
                .height = size[1],
                .camera_is_default = false,
            };
        }
        diagnostic.warn("camera {d} not used: its node leaves it no place or direction", .{found});
    }
    const size = wanted.size(from, aspect_default);
    var subject: framing.Subject = try .init(gpa, geometry, from.materials);
    defer subject.deinit(gpa);
    return .{
        .camera = try viewpoint_file.place(gpa, &subject, viewpoint, aspect(size)),
        .width = size[0],
        .height = size[1],
        .camera_is_default = !in_place,
    };
}

/// Metres that a pixel stands for where the automatic view of a scene looks at, whatever camera is
/// used: points and lines do not change with it. In an orthographic view, everywhere.
pub fn pixelSize(
    gpa: std.mem.Allocator,
    from: *const scene.Scene,
    materials: []const scene.Material,
    geometry: *const world.Geometry,
    wanted: *const Wanted,
) error{OutOfMemory}!f64 {
    const size = pictureSize(from, wanted);
    var subject: framing.Subject = try .init(gpa, geometry, materials);
    defer subject.deinit(gpa);
    const camera = try viewpoint_file.place(gpa, &subject, &.{
        .fov_degrees = wanted.viewpoint.fov_degrees,
        .orthographic = wanted.viewpoint.orthographic,
    }, aspect(size));
    const toward = vec3d.sub(subject.center, pose.widen(camera.origin));
    const forward = pose.widen(camera.forward);
    const distance = if (camera.orthographic) 1 else vec3d.dot(toward, forward);
    const height: f64 = @floatFromInt(size[1]);
    return 2 * distance * vec3d.length(pose.widen(camera.up)) / height;
}

/// Size of the picture that `choose` makes; a camera that it will not find has no say.
pub fn pictureSize(from: *const scene.Scene, wanted: *const Wanted) [2]u32 {
    var unsaid: Diagnostic = .{};
    const in_place = wanted.viewpoint.replacesCamera();
    const found = if (in_place) null else find(from, wanted.camera, &unsaid) catch null;
    const own = if (found) |index| aspectOf(&from.cameras[index]) else null;
    return wanted.size(from, own orelse aspect_default);
}

/// Index of the camera to use, null for a framing.
fn find(
    from: *const scene.Scene,
    choice: settings.Camera,
    diagnostic: *Diagnostic,
) error{CameraUnknown}!?u32 {
    switch (choice) {
        .auto => return null,
        .default => return if (from.camera_default == scene.none) null else from.camera_default,
        .index => |index| {
            if (index < from.cameras.len) return index;
            return unknown(from, "no camera {d}", .{index}, diagnostic);
        },
        .name => |name| {
            for (from.cameras, 0..) |camera, index| {
                if (std.mem.eql(u8, camera.name, name)) return @intCast(index);
            }
            return unknown(from, "no camera {f}", .{diagnostic_module.quote(name)}, diagnostic);
        },
    }
}

fn unknown(
    from: *const scene.Scene,
    comptime format: []const u8,
    arguments: anytype,
    diagnostic: *Diagnostic,
) error{CameraUnknown} {
    const list = diagnostic_module.listOf(from.cameras);
    return diagnostic.fail(error.CameraUnknown, format ++ "; {f}", arguments ++ .{list});
}

/// The camera's own width over height; null: the picture's.
fn aspectOf(camera: *const scene.Camera) ?f64 {
    return switch (camera.projection) {
        .perspective => |perspective| perspective.aspect orelse return null,
        .orthographic => |extent| @as(f64, extent.half_width) / extent.half_height,
    };
}

/// Picture size of an aspect: the longer side as given, the other at least 1.
fn sizeOf(width_over_height: f64, long_side: u32) [2]u32 {
    assert(width_over_height > 0);
    const is_wide = width_over_height >= 1;
    const share = if (is_wide) 1 / width_over_height else width_over_height;
    const rounded: u32 = @intFromFloat(share * @as(f64, @floatFromInt(long_side)) + 0.5);
    const short_side = @max(rounded, 1);
    return if (is_wide) .{ long_side, short_side } else .{ short_side, long_side };
}

fn aspect(size: [2]u32) f64 {
    assert(size[0] > 0 and size[1] > 0);
    return @as(f64, @floatFromInt(size[0])) / @as(f64, @floatFromInt(size[1]));
}

/// The camera in the world, or null where its node leaves it no place or direction.
fn place(
    camera: *const scene.Camera,
    map: AffineD,
    fov_degrees: ?f32,
    size: [2]u32,
) ?world.Camera {
    const origin = pose.round(map.translation);
    if (!vec3.isFinite(origin)) return null;
    const forward = vec3d.normalize(vec3d.neg(map.z)) orelse return null;
    const up_hint = vec3d.normalize(map.y) orelse return null;
    const right = vec3d.normalize(vec3d.cross(forward, up_hint)) orelse return null;
    const up = vec3d.cross(right, forward);
    const half_height: f64 = switch (camera.projection) {
        .perspective => |perspective| if (fov_degrees) |degrees|
            framing.halfTangent(degrees)
        else
            math.elementary.tan(perspective.y_fov_rad / 2) * reachOf(camera, size),
        .orthographic => |orthographic| orthographic.half_height * reachOf(camera, size),
    };
    // Within bounds that keep both sides and their squares within an f32.
    const bounded = std.math.clamp(half_height, 1e-9, 1e9);
    return .{
        .orthographic = camera.projection == .orthographic,
        .origin = origin,
        .right = pose.round(vec3d.scale(right, bounded * aspect(size))),
        .up = pose.round(vec3d.scale(up, bounded)),
        .forward = pose.round(forward),
    };
}

/// How many times the camera's own height a picture shows to have all of its width. A size that is
/// the camera's aspect in whole pixels has no more.
fn reachOf(camera: *const scene.Camera, size: [2]u32) f64 {
    const own = aspectOf(camera) orelse return 1;
    const shown = aspect(size);
    const is_own = std.mem.eql(u32, &size, &sizeOf(own, @max(size[0], size[1])));
    return if (is_own or own <= shown) 1 else own / shown;
}

const test_camera: scene.Camera = .{
    .name = "main",
    .node = 0,
    .projection = .{ .perspective = .{ .y_fov_rad = std.math.pi / 2.0, .aspect = 2 } },
};

test "size follows the camera's aspect, width follows the picture" {
    const gpa = std.testing.allocator;
    var from: scene.Scene = .init(gpa);
    defer from.deinit();
    from.nodes = &.{.{ .parent = scene.none, .local = .identity }};
    from.cameras = &.{test_camera};
    from.camera_default = 0;
    // Mirrored and scaled: neither counts.
    const maps = [_]AffineD{.fromTrs(.{ 1, 2, 3 }, .{ 0, 0, 0, 1 }, .{ -2, 3, 4 })};
    var diagnostic: Diagnostic = .{};
    const wide = try choose(gpa, &from, &maps, &.empty, &.{}, &diagnostic);
    try std.testing.expectEqual(1024, wide.width);
    try std.testing.expectEqual(512, wide.height);
    try std.testing.expect(!wide.camera_is_default);
    try std.testing.expectApproxEqRel(@as(f32, 2), wide.camera.right[0], 1e-6);
    try std.testing.expectApproxEqRel(@as(f32, 1), wide.camera.up[1], 1e-6);
    try std.testing.expectEqual(Vec3{ 1, 2, 3 }, wide.camera.origin);
    try std.testing.expectEqual(-1, wide.camera.forward[2]);
    const tall = try choose(gpa, &from, &maps, &.empty, &.{ .resolution = .{ 1, 4 } }, &diagnostic);
    // All that the camera shows to the sides is there, and more above and below.
    try std.testing.expectApproxEqRel(@as(f32, 2), tall.camera.right[0], 1e-6);
    try std.testing.expectApproxEqRel(@as(f32, 8), tall.camera.up[1], 1e-6);
    const wider =
        try choose(gpa, &from, &maps, &.empty, &.{ .resolution = .{ 8, 1 } }, &diagnostic);
    try std.testing.expectApproxEqRel(@as(f32, 8), wider.camera.right[0], 1e-6);
    try std.testing.expectApproxEqRel(@as(f32, 1), wider.camera.up[1], 1e-6);
    // An angle that is asked for is the picture's.
    const angle = try choose(gpa, &from, &maps, &.empty, &.{
        .resolution = .{ 1, 4 },
        .viewpoint = .{ .fov_degrees = 90 },
    }, &diagnostic);
    try std.testing.expectApproxEqRel(@as(f32, 0.25), angle.camera.right[0], 1e-6);
    try std.testing.expectApproxEqRel(@as(f32, 1), angle.camera.up[1], 1e-6);
    const small = try choose(gpa, &from, &maps, &.empty, &.{ .long_side = 100 }, &diagnostic);
    try std.testing.expectEqual([2]u32{ 100, 50 }, [2]u32{ small.width, small.height });
    from.resolution = .{ 30, 90 };
    const film = try choose(gpa, &from, &maps, &.empty, &.{ .long_side = 60 }, &diagnostic);
    try std.testing.expectEqual([2]u32{ 20, 60 }, [2]u32{ film.width, film.height });
}

test "a viewpoint replaces the file's camera, but for a mere angle" {
    const gpa = std.testing.allocator;
    var from: scene.Scene = .init(gpa);
    defer from.deinit();
    from.cameras = &.{test_camera};
    from.camera_default = 0;
    const maps = [_]AffineD{.identity};
    var diagnostic: Diagnostic = .{};
    const own = try choose(gpa, &from, &maps, &.empty, &.{
        .viewpoint = .{ .eye = .{ 1, 2, 3 }, .target = .{ 1, 2, 9 }, .fov_degrees = 90 },
        .resolution = .{ 3, 1 },
    }, &diagnostic);
    try std.testing.expect(!own.camera_is_default);
    try std.testing.expectEqual(Vec3{ 1, 2, 3 }, own.camera.origin);
    try std.testing.expectEqual(Vec3{ 0, 0, 1 }, own.camera.forward);
    try std.testing.expectApproxEqRel(@as(f32, -3), own.camera.right[0], 1e-6);
    const angle = try choose(gpa, &from, &maps, &.empty, &.{
        .viewpoint = .{ .fov_degrees = 20 },
    }, &diagnostic);
    try std.testing.expectEqual(Vec3{ 0, 0, 0 }, angle.camera.origin);
    try std.testing.expectApproxEqRel(@as(f32, 0.17632698), angle.camera.up[1], 1e-6);
}

test "orthographic cameras keep their height" {
    const gpa = std.testing.allocator;
    var from: scene.Scene = .init(gpa);
    defer from.deinit();
    from.cameras = &.{.{
        .name = "",
        .node = 0,
        .projection = .{ .orthographic = .{ .half_width = 1, .half_height = 4 } },
    }};
    var diagnostic: Diagnostic = .{};
    const maps = [_]AffineD{.identity};
    const wanted: Wanted = .{ .camera = .{ .index = 0 } };
    const view = try choose(gpa, &from, &maps, &.empty, &wanted, &diagnostic);
    try std.testing.expect(view.camera.orthographic);
    try std.testing.expectEqual(256, view.width);
    try std.testing.expectEqual(1024, view.height);
    try std.testing.expectEqual(Vec3{ 1, 0, 0 }, view.camera.right);
    try std.testing.expectEqual(Vec3{ 0, 4, 0 }, view.camera.up);
}

test "cameras are found by index and name, or the message lists them" {
    const gpa = std.testing.allocator;
    var from: scene.Scene = .init(gpa);
    defer from.deinit();
    var nameless = test_camera;
    nameless.name = "";
    from.cameras = &.{ nameless, test_camera };
    var diagnostic: Diagnostic = .{};
    try std.testing.expectEqual(1, (try find(&from, .{ .name = "main" }, &diagnostic)).?);
    try std.testing.expectEqual(null, try find(&from, .auto, &diagnostic));
    try std.testing.expectEqual(null, try find(&from, .default, &diagnostic));
    const by_name: settings.Camera = .{ .name = "mian" };
    try std.testing.expectError(error.CameraUnknown, find(&from, by_name, &diagnostic));
    try std.testing.expectEqualStrings(
        "no camera 'mian'; the file has 0, 1 'main'",
        diagnostic.message.text(),
    );
    const by_index: settings.Camera = .{ .index = 2 };
    try std.testing.expectError(error.CameraUnknown, find(&from, by_index, &diagnostic));
    from.cameras = &.{};
    try std.testing.expectError(error.CameraUnknown, find(&from, by_index, &diagnostic));
    try std.testing.expectEqualStrings("no camera 2; the file has none", diagnostic.message.text());
}

test "a flattened camera gives way to a framing" {
    const gpa = std.testing.allocator;
    var from: scene.Scene = .init(gpa);
    defer from.deinit();
    from.cameras = &.{test_camera};
    from.camera_default = 0;
    var diagnostic: Diagnostic = .{};
    const maps = [_]AffineD{.fromTrs(.{ 0, 0, 0 }, .{ 0, 0, 0, 1 }, .{ 1, 1, 0 })};
    const view = try choose(gpa, &from, &maps, &.empty, &.{}, &diagnostic);
    try std.testing.expect(view.camera_is_default);
    try std.testing.expectEqual(1024, view.width);
    try std.testing.expectEqual(768, view.height);
    try std.testing.expectEqual(1, diagnostic.warning_count);
}

test "no aspect makes a picture without pixels" {
    try std.testing.expectEqual([2]u32{ 1024, 1 }, sizeOf(1e30, 1024));
    try std.testing.expectEqual([2]u32{ 1, 1024 }, sizeOf(1e-30, 1024));
    try std.testing.expectEqual([2]u32{ 7, 7 }, sizeOf(1, 7));
}
