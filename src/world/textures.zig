//! Textures: pyramids of 8-bit texels, and how materials look them up.

/// What lies beyond the edges of an image.
pub const Wrap = enum(u8) { repeat, mirrored_repeat, clamp_to_edge };

/// One level of a pyramid.
pub const Level = struct {
    width: u32,
    height: u32,
    /// Rows from the top, `Texture.channel_count` bytes a texel.
    texels: []const u8,
};

/// An image and its smaller copies, only the channels that some material uses.
pub const Texture = struct {
    /// From the finest; each next one half as wide and high, rounded down, to 1x1. One at least.
    levels: []const Level,
    channel_count: u8,
    /// Colour channels (all but a fourth) are stored by the sRGB curve, see `math.srgb`.
    is_srgb: bool,
};

/// What of a material a lookup is for.
pub const Slot = enum(u8) {
    base_color,
    metallic_roughness,
    normal,
    occlusion,
    emissive,
    // Those of `Layers` and what else few materials have: from here on.
    transmission,
    specular,
    specular_color,
    glossiness,
    clearcoat,
    clearcoat_roughness,
    clearcoat_normal,
    sheen_color,
    sheen_roughness,
    iridescence,
    iridescence_thickness,
    anisotropy,
    diffuse_transmission,
    diffuse_transmission_color,
    multiscatter_color,

    /// Slots of every material.
    pub const base_count = @backingInt(Slot.transmission);
    /// All slots.
    pub const count = @typeInfo(Slot).@"enum".field_names.len;

    /// Whether its lookups are `Material.layer_lookup_count`'s.
    pub fn isOfLayers(slot: Slot) bool {
        return @backingInt(slot) >= base_count;
    }
};

/// A texture as one material uses it; several for one slot are multiplied.
pub const Lookup = struct {
    slot: Slot,
    /// Index into `Textures.all`.
    texture: u32,
    /// By axis.
    wrap: [2]Wrap,
    /// Texels are mixed where the texture is magnified.
    magnify_linear: bool,
    /// And where it is minified.
    minify_linear: bool,
    /// Coarser levels are used where the texture is minified.
    has_mips: bool,
    /// And mixed.
    mip_linear: bool,
    /// Index into `Geometry.texcoords`.
    texcoord_set: u8,
    /// Rows: u' = row[0] u + row[1] v + row[2].
    transform: [2][3]f32,
    /// Which channel of a texel is the first, second, ... of the slot; 255: it counts as 1.
    channels: [4]u8,
};

/// All textures of a scene.
pub const Textures = struct {
    all: []const Texture = &.{},

    pub const empty: Textures = .{};
};
