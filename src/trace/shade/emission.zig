//! What surfaces emit where no ray has hit them: at points that are chosen on them.
//!
//! In: a triangle and barycentric weights. Out: radiance, by factors and textures at their finest,
//! less what alpha leaves open: what a narrow ray that hits the point sees.

const world_file = @import("../../world.zig");
const lookups_file = @import("lookups.zig");
const Frame = world_file.Frame;

/// Linear RGB; `weights` are of corners 1 and 2.
pub fn radianceAt(frame: *const Frame, primitive: u32, weights: [2]f32) [3]f32 {
    const geometry = frame.geometry;
    const face = geometry.face(primitive);
    const material = &frame.materials.all[face.material];
    const first = material.first_lookup;
    const lookups = frame.materials.lookups[first..][0..material.lookup_count];
    const point: lookups_file.Point = .{
        .primitive = primitive,
        .weights = weights,
        .axes = @splat(@splat(0)),
    };
    var values: lookups_file.Values(.base) = @splat(@splat(1));
    lookups_file.sampleSlot(.base, frame, lookups, .emissive, &point, &values);
    const emissive = values[lookups_file.Slots.base.indexOf(.emissive)];
    var radiance: [3]f32 = undefined;
    for (&radiance, material.emissive, emissive[0..3]) |*to, factor, texel| to.* = factor * texel;
    const is_solid = material.blend == 0 and material.alpha_cutoff < 0;
    if (material.is_hidden_lamp or is_solid) return radiance;
    lookups_file.sampleSlot(.base, frame, lookups, .base_color, &point, &values);
    var alpha = material.base_color[3] *
        values[lookups_file.Slots.base.indexOf(.base_color)][3];
    if (geometry.hasColors()) {
        const a = face.color(geometry, 0)[3];
        const b = face.color(geometry, 1)[3];
        const c = face.color(geometry, 2)[3];
        alpha *= a * ((1 - weights[0]) - weights[1]) + b * weights[0] + c * weights[1];
    }
    const opacity: f32 = if (material.blend > 0)
        clamped(alpha)
    else if (alpha < material.alpha_cutoff) 0 else 1;
    for (&radiance) |*channel| channel.* *= opacity;
    return radiance;
}

fn clamped(alpha: f32) f32 {
    if (!(alpha > 0)) return 0;
    return if (alpha < 1) alpha else 1;
}
