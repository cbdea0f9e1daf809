//! Materials as shading wants them, in f32 throughout so that lanes can gather any of their fields.

const math = @import("../math.zig");
const Vec3 = math.Vec3;
const Layers = @import("layers.zig").Layers;
const Lookup = @import("textures.zig").Lookup;
const Volume = @import("volume.zig").Volume;

/// The metallic-roughness model of glTF 2.0 with transmission and volume.
pub const Material = struct {
    /// Linear RGB and alpha.
    base_color: [4]f32,
    emissive: Vec3,
    metallic: f32,
    roughness: f32,
    /// Reflectance at normal incidence of the dielectric part, ((n - 1) / (n + 1))^2.
    dielectric_f0: f32,
    ior: f32,
    transmission: f32,
    /// Beer-Lambert absorption coefficient inside, per metre; 0 outside of volumes.
    sigma_a: Vec3,
    /// Alpha below it is a hole; -1 for materials without holes.
    alpha_cutoff: f32,
    /// 1: alpha blends, 0: alpha counts as 1.
    blend: f32,
    /// 1: back faces are seen too, 0: they are culled from view (they still cast shadows).
    double_sided: f32,
    /// 1: shown without light.
    unlit: f32,
    /// Share of light that comes out on the other side of a thin surface that is not smooth
    /// (KHR_materials_diffuse_transmission), by channel.
    diffuse_through: Vec3 = .{ 0, 0, 0 },
    /// 1: bounds a volume, rays bend; 0: thin, they go straight on.
    volume: f32,
    /// Index into `Materials.volumes` of what it bounds, `Volume.air` where that is nothing.
    volume_rank: u16 = Volume.air,
    /// Multiplies x and y of normals from a texture.
    normal_scale: f32 = 1,
    /// How much of the occlusion texture counts.
    occlusion_strength: f32 = 1,
    /// Its textures: `Materials.lookups[first_lookup..][0..lookup_count]`.
    first_lookup: u32 = 0,
    lookup_count: u32 = 0,
    /// Those of slots of layers: that many, directly behind them.
    layer_lookup_count: u32 = 0,
    /// Surfaces emit in full, though alpha is 0; for the making of lights alone.
    is_hidden_lamp: bool = false,

    /// Whether no light passes, wherever a surface of it is hit. Its textures are `lookups`.
    pub fn stopsLight(material: *const Material, lookups: []const Lookup) bool {
        if (material.blend > 0 or material.alpha_cutoff >= 0) return false;
        var is_metal = material.metallic == 1;
        for (lookups) |*lookup| {
            if (lookup.slot == .metallic_roughness) is_metal = false; // Not everywhere.
        }
        return is_metal or !material.isClear();
    }

    /// Whether light goes through where there is no metal.
    pub fn isClear(material: *const Material) bool {
        const through = material.diffuse_through;
        return material.transmission > 0 or @max(through[0], through[1], through[2]) > 0;
    }

    /// Whether light goes through, by refraction or straight on.
    pub fn transmits(material: *const Material) bool {
        return material.transmission * (1 - material.metallic) > 0 and material.unlit == 0;
    }
};

/// All materials of a scene.
pub const Materials = struct {
    /// `Triangle.material` counts these.
    all: []const Material,
    /// By material; empty where no drawn one has any.
    layers: []const Layers = &.{},
    /// By material: the scene's that it was made of.
    sources: []const u32 = &.{},
    /// Of all materials, one after the other.
    lookups: []const Lookup = &.{},
    /// What drawn materials bound, by priority.
    volumes: []const Volume = &.{},
    /// Some of these scatter light.
    has_scattering: bool = false,
    /// Some drawn material transmits.
    has_transmission: bool = false,
    /// Some drawn material lets shadow rays through in part (blend or transmission).
    has_transparency: bool,
    /// Some drawn material has holes (mask).
    has_holes: bool,
    /// By triangle, a bit each: whether no light passes it. Small enough to be at hand when a
    /// triangle is hit, which neither that nor its material is. Empty where both of the above are
    /// false.
    occluders: []const u32,

    /// Whether a triangle lets no light pass.
    pub inline fn isOccluder(materials: *const Materials, primitive: u32) bool {
        return materials.occluders[primitive / 32] >> @truncate(primitive % 32) & 1 != 0;
    }
};
