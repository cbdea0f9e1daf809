//! Cameras and punctual lights: what a node may carry besides a mesh.
//!
//! In: a glTF camera (glTF 2.0, section 3.10) or a light (KHR_lights_punctual) and the scene node
//! that carries it. Out: `scene.Camera`, `scene.Light`, every number finite and in its range. What
//! can be clamped is, with a warning; a camera that sees nothing is an error.

const std = @import("std");
const c = @import("../cgltf.zig");
const escapes = @import("../json/escapes.zig");
const math = @import("../../math.zig");
const scene = @import("../../scene.zig");
const diagnostic = @import("../../diagnostic.zig");
const Source = @import("source.zig");
const Error = Source.Error;

/// Here the image plane is infinite.
const y_fov_max: f32 = std.math.pi;

/// The camera of a node. `node_name` serves where the camera has no
/// name. Names are copied into the scene's memory.
pub fn readCamera(
    source: *const Source,
    raw: *const c.cgltf_camera,
    node_name: [*c]const u8,
    node: u32,
) Error!scene.Camera {
    const index = Source.indexOf(source.data.cameras, raw);
    try source.need(.cameras, index);
    const projection: scene.Camera.Projection = switch (raw.type) {
        .perspective => projection: {
            const perspective = &raw.data.perspective;
            const y_fov_rad = perspective.yfov;
            const y_fov_fits = y_fov_rad >= std.math.floatMin(f32) and y_fov_rad < y_fov_max;
            if (!y_fov_fits) return source.fail(
                "camera {d}: yfov {d} is not between 0 and pi",
                .{ index, y_fov_rad },
            );
            const aspect = perspective.aspect_ratio;
            const is_aspect = aspect >= std.math.floatMin(f32);
            const has_aspect = perspective.has_aspect_ratio != 0 and is_aspect;
            if (perspective.has_aspect_ratio != 0 and !is_aspect) source.forgive(
                "camera {d}: aspectRatio {d} is not above 0, ignored",
                .{ index, aspect },
            );
            const far_ok = perspective.has_zfar == 0 or perspective.zfar > perspective.znear;
            if (!(perspective.znear > 0) or !far_ok) source.forgive(
                "camera {d}: znear and zfar make no sense; they are not used",
                .{index},
            );
            break :projection .{ .perspective = .{
                .y_fov_rad = y_fov_rad,
                .aspect = if (has_aspect) aspect else null,
            } };
        },
        .orthographic => .{ .orthographic = .{
            .half_width = try magnification(source, index, "xmag", raw.data.orthographic.xmag),
            .half_height = try magnification(source, index, "ymag", raw.data.orthographic.ymag),
        } },
        else => return source.fail("camera {d}: neither perspective nor orthographic", .{index}),
    };
    const name = if (raw.name != null) raw.name else node_name;
    return .{
        .name = if (name == null)
            ""
        else
            try escapes.decodeString(source.arena, std.mem.span(name)),
        .node = node,
        .projection = projection,
    };
}

fn magnification(source: *const Source, index: u32, name: []const u8, value: f32) Error!f32 {
    const size = @abs(value);
    if (!(size >= std.math.floatMin(f32))) {
        return source.fail("camera {d}: {s} is 0", .{ index, name });
    }
    if (value < 0) source.forgive(
        "camera {d}: {s} is negative, its sign is ignored",
        .{ index, name },
    );
    return size;
}

/// The light of a node; null where its type is unknown.
pub fn readLight(source: *const Source, raw: *const c.cgltf_light, node: u32) ?scene.Light {
    const index = Source.indexOf(source.data.lights, raw);
    var light: scene.Light = .{
        .kind = switch (raw.type) {
            .point => .point,
            .spot => .spot,
            .directional => .directional,
            else => {
                source.forgive("light {d}: unknown type, left out", .{index});
                return null;
            },
        },
        .node = node,
    };
    for (&light.color, raw.color) |*value, factor| {
        value.* = notNegative(source, index, "color", factor);
    }
    light.intensity = notNegative(source, index, "intensity", raw.intensity);
    // cgltf says 0 where the file says nothing; the table has warned of what the file says wrong.
    const range = math.flushDenormal(raw.range);
    if (range > 0) light.range = range;
    if (light.kind == .spot) readCone(source, index, raw, &light);
    return light;
}

fn readCone(
    source: *const Source,
    index: u32,
    raw: *const c.cgltf_light,
    light: *scene.Light,
) void {
    const outer_max: f32 = std.math.pi / 2.0;
    const outer = raw.spot_outer_cone_angle;
    const inner = math.flushDenormal(raw.spot_inner_cone_angle);
    // Half an ulp of rounding in the file is no reason to complain.
    const fits = outer > 0 and outer <= outer_max + 1e-6 and inner >= 0 and inner < outer;
    if (!fits) source.forgive(
        "light {d}: cone angles {d} and {d} do not fit 0 <= inner < outer <= pi / 2, clamped",
        .{ index, inner, outer },
    );
    light.setCone(inner, outer);
}

fn notNegative(source: *const Source, index: u32, name: []const u8, value: f32) f32 {
    if (value >= 0) return math.flushDenormal(value);
    source.forgive("light {d}: {s} {d} is below 0, taken as 0", .{ index, name, value });
    return 0;
}
