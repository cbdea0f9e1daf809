//! A surface for tests of lobes: white, rough, dielectric, its normal along y.
//!
//! In: views. Out: points on it in lanes, and layers that change nothing.

const simd = @import("../../simd.zig");
const Interaction = @import("interaction.zig").Interaction;
const Layers = @import("layers.zig").Layers;

const Single = simd.Lanes(.scalar, 1);

/// A unit vector in the plane of x and y at a cosine to the normal.
pub fn viewAt(cosine: f32) Single.Vec3 {
    return .splat(.{ @sqrt(1 - cosine * cosine), cosine, 0 });
}

/// The surface at the origin; the view is a unit vector.
pub fn pointAt(comptime Lanes: type, view: [3]f32) Interaction(Lanes) {
    const up: Lanes.Vec3 = .splat(.{ 0, 1, 0 });
    return .{
        .hit = .splat(true),
        .position = .splat(.{ 0, 0, 0 }),
        .normal_geometric = up,
        .normal = up,
        .view = .splat(view),
        .distance = .splat(1),
        .back = .splat(false),
        .culled = .splat(false),
        .opacity = .splat(1),
        .error_ulps = .zero(),
        .offset_max = .zero(),
        .cone_width = .zero(),
        .curvature = .zero(),
        .hidden = .splat(false),
        .eta = .splat(1.0 / 1.5),
        .sigma_beyond = .splat(.{ 0, 0, 0 }),
        .beyond = @splat(.air),
        .material = .{
            .base_color = .splat(.{ 1, 1, 1 }),
            .emissive = .splat(.{ 0, 0, 0 }),
            .metallic = .splat(0),
            .roughness = .splat(1),
            .dielectric_f0 = .splat(0.04),
            .ior = .splat(1.5),
            .transmission = .splat(0),
            .occlusion = .splat(1),
            .unlit = .splat(false),
            .volume = .splat(false),
        },
    };
}

/// Layers of all lanes, with the defaults of the extensions.
pub fn layersOf(comptime Lanes: type) Layers(Lanes) {
    const white: Lanes.Vec3 = .splat(.{ 1, 1, 1 });
    return .{
        .present = .splat(true),
        .specular = .splat(1),
        .specular_color = white,
        .clearcoat = .zero(),
        .clearcoat_roughness = .zero(),
        .clearcoat_normal = .splat(.{ 0, 1, 0 }),
        .sheen_color = .splat(.{ 0, 0, 0 }),
        .sheen_roughness = .zero(),
        .dispersion = .zero(),
        .iridescence = .zero(),
        .iridescence_ior = .splat(1.3),
        .iridescence_thickness_nm = .splat(400),
        .anisotropy = .zero(),
        .tangent = .splat(.{ 1, 0, 0 }),
        .diffuse_transmission = .zero(),
        .diffuse_transmission_color = white,
    };
}
