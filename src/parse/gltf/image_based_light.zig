//! EXT_lights_image_based: the cube of light around a scene.
//!
//! In: the extension of the document and that of a scene, as JSON text that has been checked. Out:
//! the scene's environment, of the finest of the cube's levels; coarser ones and the irradiance are
//! made anew from it. A light whose images cannot be had is a warning and no environment.

const std = @import("std");
const c = @import("../cgltf.zig");
const math = @import("../../math.zig");
const scene = @import("../../scene.zig");
const text = @import("extension_text.zig");
const Source = @import("source.zig");
const Textures = @import("textures.zig");
const Error = Source.Error;

const extension_name = "EXT_lights_image_based";

const Light = struct {
    rotation: [4]f64 = .{ 0, 0, 0, 1 },
    intensity: f32 = 1,
    specularImages: []const []const u32,
};

/// Surrounds the scene with the light that the shown one names, if it does.
pub fn read(source: *Source, textures: *Textures, shown: *const c.cgltf_scene) Error!void {
    const list = Source.slice(shown.extensions, shown.extensions_count);
    const reference = text.find(list, extension_name) orelse return;
    var arena_state: std.heap.ArenaAllocator = .init(source.gpa);
    defer arena_state.deinit();
    const arena = arena_state.allocator();
    const Use = struct { light: u32 };
    const Lights = struct { lights: []const Light };
    const data = source.data;
    const all = Source.slice(data.data_extensions, data.data_extensions_count);
    const use = try text.parse(Use, arena, reference) orelse
        return leaveOut(source, "has no light");
    const described = text.find(all, extension_name) orelse "";
    const lights = try text.parse(Lights, arena, described) orelse
        return leaveOut(source, "is not as it should be");
    if (use.light >= lights.lights.len) return leaveOut(source, "names a light that is not there");
    if (source.findBroken(.image_based_lights, use.light) != null)
        return leaveOut(source, "is not as it should be");
    const light = &lights.lights[use.light];
    const levels = light.specularImages;
    if (levels.len == 0 or levels[0].len != 6)
        return leaveOut(source, "has no cube of six images");
    var faces: [6]u32 = undefined;
    for (&faces, levels[0]) |*face, image| {
        if (image >= data.images_count)
            return leaveOut(source, "names an image that is not there");
        face.* = try textures.getImage(image) orelse
            return leaveOut(source, "lacks an image");
    }
    const turn = rotationOf(light.rotation) orelse
        return leaveOut(source, "has a rotation that is none");
    if (!(light.intensity >= 0)) return leaveOut(source, "is not bright");
    source.builder.scene.environment = .{
        .image = faces[0],
        .projection = .cube,
        .faces = faces,
        .scale = @splat(math.flushDenormal(light.intensity)),
        .rotation = turn,
    };
}

fn leaveOut(source: *const Source, comptime reason: []const u8) void {
    source.forgive(extension_name ++ " " ++ reason ++ ", left out", .{});
}

/// From the world's directions to the cube's: the inverse of the light's rotation.
fn rotationOf(quaternion: [4]f64) ?math.AffineD {
    var squared: f64 = 0;
    for (quaternion) |component| squared += component * component;
    if (!(squared > 1e-12 and squared < 1e12)) return null;
    const length = @sqrt(squared);
    const x, const y, const z, const w = quaternion;
    const inverse = [4]f64{ -x / length, -y / length, -z / length, w / length };
    return .fromTrs(.{ 0, 0, 0 }, inverse, .{ 1, 1, 1 });
}

test rotationOf {
    const half = @sqrt(0.5);
    // A quarter turn about y takes z to x, so that what is seen at x was at z.
    const turn = rotationOf(.{ 0, 2 * half, 0, 2 * half }).?;
    const found = turn.direction(.{ 1, 0, 0 });
    for (found, [3]f64{ 0, 0, 1 }) |value, wanted| {
        try std.testing.expectApproxEqAbs(wanted, value, 1e-12);
    }
    try std.testing.expectEqual(null, rotationOf(.{ 0, 0, 0, 0 }));
}
