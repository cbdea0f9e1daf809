//! What the extensions of glTF's materials add to the metallic-roughness model, in f32 throughout
//! so that lanes can gather any of their fields.

const math = @import("../math.zig");
const Vec3 = math.Vec3;

/// Parameters of the further lobes of one material; the defaults are those without effect.
pub const Layers = struct {
    /// 1: the material has some of these, or textures for them; 0: all are the defaults.
    present: f32 = 0,
    /// KHR_materials_specular.
    specular: f32 = 1,
    specular_color: Vec3 = .{ 1, 1, 1 },
    /// KHR_materials_clearcoat.
    clearcoat: f32 = 0,
    clearcoat_roughness: f32 = 0,
    clearcoat_normal_scale: f32 = 1,
    /// KHR_materials_sheen.
    sheen_color: Vec3 = .{ 0, 0, 0 },
    sheen_roughness: f32 = 0,
    /// KHR_materials_dispersion: 20 over the Abbe number.
    dispersion: f32 = 0,
    /// KHR_materials_iridescence.
    iridescence: f32 = 0,
    iridescence_ior: f32 = 1.3,
    iridescence_thickness_min_nm: f32 = 100,
    iridescence_thickness_max_nm: f32 = 400,
    /// KHR_materials_anisotropy: strength, and cosine and sine of the rotation.
    anisotropy: f32 = 0,
    anisotropy_rotation: [2]f32 = .{ 1, 0 },
    /// KHR_materials_diffuse_transmission.
    diffuse_transmission: f32 = 0,
    diffuse_transmission_color: Vec3 = .{ 1, 1, 1 },
    /// KHR_materials_volume_scatter: scattering coefficient inside, per metre, and the mean cosine
    /// of the phase function. `Material.sigma_a` is what is absorbed besides.
    sigma_s: Vec3 = .{ 0, 0, 0 },
    scatter_anisotropy: f32 = 0,
};
