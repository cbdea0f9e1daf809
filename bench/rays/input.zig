//! What the benchmark traces: a scene file, a camera file, made ready as the renderer does it.
//!
//! In: paths. Out: a `Scene` that has the camera and the light of the camera file for its own, so
//! that `prepare` sees what rays there will be; and from the world that it makes, a `Setup`.

const std = @import("std");
const raylane = @import("raylane");
const Setup = @import("workload.zig").Setup;
const Diagnostic = raylane.diagnostic.Diagnostic;
const Scene = raylane.scene.Scene;
const Vec3 = raylane.math.Vec3;
const World = raylane.world.World;
const vec3 = raylane.math.vec3;
const assert = std.debug.assert;

/// How far shadow and reflection rays start off a surface, over the diagonal of the scene.
const offset_relative = 1e-4;

const camera_bytes_max = 4096;

pub const Error = error{ OutOfMemory, InputOutput, InvalidInput };

/// Replaces the scene's camera and lights by those of the file at `path`.
pub fn placeCamera(
    io: std.Io,
    scene: *Scene,
    path: []const u8,
    diagnostic: *Diagnostic,
) Error!void {
    const view = try readCamera(io, path, diagnostic);
    const back = vec3.normalize(vec3.sub(view.eye, view.target)) orelse
        return diagnostic.fail(error.InvalidInput, "eye and target are the same", .{});
    const right = vec3.normalize(vec3.cross(view.up, back)) orelse
        return diagnostic.fail(error.InvalidInput, "up is the way the camera looks", .{});
    const arena = scene.arena.allocator();
    const first: u32 = @intCast(scene.nodes.len);
    scene.nodes = try std.mem.concat(arena, raylane.scene.Node, &.{ scene.nodes, &.{
        .{ .parent = raylane.scene.none, .local = .of(raylane.math.Affine{
            .x = right,
            .y = vec3.cross(back, right),
            .z = back,
            .translation = view.eye,
        }) },
        .{ .parent = raylane.scene.none, .local = .of(raylane.math.Affine{
            .x = .{ 1, 0, 0 },
            .y = .{ 0, 1, 0 },
            .z = .{ 0, 0, 1 },
            .translation = view.light,
        }) },
    } });
    scene.cameras = try arena.dupe(raylane.scene.Camera, &.{.{
        .name = "",
        .node = first,
        .projection = .{ .perspective = .{ .y_fov_rad = view.angle_rad, .aspect = null } },
    }});
    scene.camera_default = 0;
    scene.lights = try arena.dupe(raylane.scene.Light, &.{.{ .kind = .point, .node = first + 1 }});
}

const View = struct { eye: Vec3, target: Vec3, up: Vec3, angle_rad: f32, light: Vec3 };

fn readCamera(io: std.Io, path: []const u8, diagnostic: *Diagnostic) Error!View {
    var buffer: [camera_bytes_max]u8 = undefined;
    const text = std.Io.Dir.cwd().readFile(io, path, &buffer) catch |err|
        return diagnostic.fail(error.InputOutput, "cannot be read: {t}", .{err});
    var numbers: [13]f32 = undefined;
    var words = std.mem.tokenizeAny(u8, text, " \t\r\n");
    for (&numbers) |*number| {
        const word = words.next() orelse "";
        number.* = std.fmt.parseFloat(f32, word) catch std.math.nan(f32);
        if (!(@abs(number.*) < 1e18))
            return diagnostic.fail(error.InvalidInput, "is not 13 numbers", .{});
    }
    if (words.next() != null)
        return diagnostic.fail(error.InvalidInput, "is more than 13 numbers", .{});
    const angle_deg = numbers[9];
    if (!(angle_deg > 0 and angle_deg < 180))
        return diagnostic.fail(error.InvalidInput, "has an angle that is not within 0 to 180", .{});
    return .{
        .eye = numbers[0..3].*,
        .target = numbers[3..6].*,
        .up = numbers[6..9].*,
        .angle_rad = std.math.degreesToRadians(angle_deg),
        .light = numbers[10..13].*,
    };
}

/// Splits every triangle in four of the same shape, through the middles of its edges. Shared edges
/// stay closed; normals and colours are dropped.
pub fn subdivide(scene: *Scene) error{OutOfMemory}!void {
    const arena = scene.arena.allocator();
    const meshes = try arena.alloc(raylane.scene.Mesh, scene.meshes.len);
    for (meshes, scene.meshes) |*to, from| {
        const positions = try arena.alloc(Vec3, from.positions.len + 3 * from.triangles.len);
        const triangles = try arena.alloc([3]u32, 4 * from.triangles.len);
        @memcpy(positions[0..from.positions.len], from.positions);
        for (from.triangles, 0..) |corner, index| {
            const first = from.positions.len + 3 * index;
            var middle: [3]u32 = undefined;
            for (&middle, 0..) |*vertex, edge| {
                const a = positions[corner[edge]];
                const b = positions[corner[(edge + 1) % 3]];
                positions[first + edge] = vec3.add(vec3.scale(a, 0.5), vec3.scale(b, 0.5));
                vertex.* = @intCast(first + edge);
            }
            triangles[4 * index ..][0..4].* = .{
                .{ corner[0], middle[0], middle[2] },
                .{ middle[0], corner[1], middle[1] },
                .{ middle[2], middle[1], corner[2] },
                middle,
            };
        }
        to.* = .{ .positions = positions, .triangles = triangles, .material = from.material };
    }
    scene.meshes = meshes;
}

/// What the workload needs to know of a world, from `arena`.
pub fn setUp(
    arena: std.mem.Allocator,
    world: *const World,
    diagnostic: *Diagnostic,
) Error!Setup {
    const camera = &world.view.camera;
    if (camera.orthographic) return diagnostic.fail(
        error.InvalidInput,
        "the camera is orthographic; --camera gives another",
        .{},
    );
    assert(world.view.width == world.view.height);
    const pixel_share = 2 / @as(f32, @floatFromInt(world.view.width));
    const across = vec3.scale(camera.right, pixel_share);
    const down = vec3.scale(camera.up, -pixel_share);
    const upper_left = vec3.add(vec3.sub(camera.forward, camera.right), camera.up);
    return .{
        .size = world.view.width,
        .eye = camera.origin,
        .corner = vec3.add(upper_left, vec3.scale(vec3.add(across, down), 0.5)),
        .across = across,
        .down = down,
        .light = lightOf(world),
        .offset = offset_relative * diagonal(world),
        .normals = try normalsOf(arena, world),
    };
}

/// The first light that has a place, or the eye.
fn lightOf(world: *const World) Vec3 {
    for (world.lights) |light| switch (light.kind) {
        .point, .spot, .emitter => return light.position,
        .directional => {},
    };
    return world.view.camera.origin;
}

/// Of the box around all triangles, in metres.
pub fn diagonal(world: *const World) f32 {
    var lower: Vec3 = @splat(std.math.inf(f32));
    var upper: Vec3 = @splat(-std.math.inf(f32));
    for (world.geometry.triangles) |triangle| {
        if (triangle.isDropped()) continue;
        for (triangle.corner) |vertex| {
            lower = vec3.min(lower, world.geometry.positions[vertex]);
            upper = vec3.max(upper, world.geometry.positions[vertex]);
        }
    }
    return if (world.geometry.bounds.isEmpty()) 0 else vec3.length(vec3.sub(upper, lower));
}

fn normalsOf(arena: std.mem.Allocator, world: *const World) Error![]align(16) const [4]f32 {
    const normals = try arena.alignedAlloc([4]f32, .@"16", world.geometry.triangles.len + 1);
    normals[0] = .{ 0, 0, 0, 0 };
    for (normals[1..], world.geometry.triangles) |*normal, triangle| {
        const a = world.geometry.positions[triangle.corner[0]];
        const b = world.geometry.positions[triangle.corner[1]];
        const c = world.geometry.positions[triangle.corner[2]];
        const unit = vec3.normalize(vec3.cross(vec3.sub(b, a), vec3.sub(c, a)));
        normal[0..3].* = unit orelse .{ 0, 0, 0 };
        normal[3] = 0;
    }
    return normals;
}
