//! Parameters of the further lobes of materials at points in lanes (`world.Layers`).
//!
//! In: points that are resolved as metallic-roughness surfaces. Out: what the extensions of their
//! materials say there, textures included; it is asked for only in frames that have such materials.

const world_file = @import("../../world.zig");
const interaction_file = @import("interaction.zig");
const lookups_file = @import("lookups.zig");
const material_file = @import("material.zig");
const microfacet = @import("microfacet.zig");
const normal_map = @import("normal_map.zig");
const texturing = @import("texturing.zig");
const Frame = world_file.Frame;
const Unique = @import("unique.zig").Unique;

/// `world.Layers` in lanes; all but `present` is undefined where no lane has any.
pub fn Layers(comptime Lanes: type) type {
    return struct {
        /// Lanes whose material has some.
        present: Lanes.Mask,
        specular: Lanes.F32,
        specular_color: Lanes.Vec3,
        clearcoat: Lanes.F32,
        clearcoat_roughness: Lanes.F32,
        /// Unit normal of the coat on the side that is seen.
        clearcoat_normal: Lanes.Vec3,
        sheen_color: Lanes.Vec3,
        sheen_roughness: Lanes.F32,
        dispersion: Lanes.F32,
        iridescence: Lanes.F32,
        iridescence_ior: Lanes.F32,
        iridescence_thickness_nm: Lanes.F32,
        anisotropy: Lanes.F32,
        /// Unit vector across the normal, along which reflections are longer.
        tangent: Lanes.Vec3,
        diffuse_transmission: Lanes.F32,
        diffuse_transmission_color: Lanes.Vec3,
    };
}

/// Where hits are, for layers.
pub fn Place(comptime Lanes: type) type {
    return struct {
        corners: *const interaction_file.Corners(Lanes),
        hit: *const interaction_file.Hit(Lanes),
        primitive: Lanes.I32,
    };
}

/// Finds the layers at points, and changes what of the base their textures change: transmission
/// and, by glossiness, roughness.
pub fn find(
    comptime Lanes: type,
    frame: *const Frame,
    place: *const Place(Lanes),
    point: *interaction_file.Interaction(Lanes),
    layers: *Layers(Lanes),
) void {
    const hit = place.hit;
    const numbers = place.corners.material;
    const all: material_file.Records(Lanes, world_file.Layers) =
        .of(frame.materials.layers, numbers, hit.mask);
    layers.present = all.float("present").gt(.zero()).bitAnd(hit.mask);
    if (layers.present.none()) return;
    load(Lanes, &all, layers);
    const smooth = interaction_file.mix(Lanes, hit.barycentrics, place.corners.normal);
    layers.clearcoat_normal =
        interaction_file.shadingNormal(Lanes, smooth, point.normal_geometric);
    var bent: Bent(Lanes) = .{
        .tangent = .splat(.{ 0, 0, 0 }),
        .bitangent_sign = .splat(1),
        .along = all.pair("anisotropy_rotation"),
    };
    if (frame.hasTextures() or frame.geometry.hasTangents())
        texture(Lanes, frame, place, &all, point, layers, &bent);
    layers.tangent = bent.turned(point.normal);
}

inline fn load(
    comptime Lanes: type,
    all: *const material_file.Records(Lanes, world_file.Layers),
    layers: *Layers(Lanes),
) void {
    inline for (.{
        "specular",
        "clearcoat",
        "clearcoat_roughness",
        "sheen_roughness",
        "dispersion",
        "iridescence",
        "iridescence_ior",
        "anisotropy",
        "diffuse_transmission",
    }) |name| @field(layers, name) = all.float(name);
    inline for (.{ "specular_color", "sheen_color", "diffuse_transmission_color" }) |name| {
        @field(layers, name) = all.color(name);
    }
    layers.iridescence_thickness_nm = all.float("iridescence_thickness_max_nm");
}

/// Directions on the surface.
fn Bent(comptime Lanes: type) type {
    return struct {
        /// As vertices have it; zero where they have none.
        tangent: Lanes.Vec3,
        bitangent_sign: Lanes.F32,
        /// Where reflections are longer, along tangent and bitangent.
        along: [2]Lanes.F32,

        /// The direction as a unit vector across a normal.
        fn turned(bent: *const @This(), normal: Lanes.Vec3) Lanes.Vec3 {
            const usable = bent.tangent.dot(bent.tangent).gt(.splat(1e-30));
            const made = microfacet.tangents(Lanes, normal);
            const tangent: Lanes.Vec3 = .select(usable, bent.tangent, made[0]);
            const flat = tangent.sub(normal.scale(normal.dot(tangent)));
            const across = flat.dot(flat).gt(.splat(1e-12));
            const first = Lanes.Vec3.select(across, flat, made[0]).normalize();
            const second = normal.cross(first).scale(bent.bitangent_sign);
            return first.scale(bent.along[0]).add(second.scale(bent.along[1])).normalize();
        }
    };
}

/// What textures and the tangents of vertices say.
fn texture(
    comptime Lanes: type,
    frame: *const Frame,
    place: *const Place(Lanes),
    all: *const material_file.Records(Lanes, world_file.Layers),
    point: *interaction_file.Interaction(Lanes),
    layers: *Layers(Lanes),
    bent: *Bent(Lanes),
) void {
    const one: Lanes.F32 = .splat(1);
    const width: Lanes.F32 = if (frame.needsFootprints()) point.cone_width else .zero();
    const where: texturing.Place(Lanes) = .{
        .asked = layers.present,
        .primitive = place.primitive,
        .barycentrics = place.hit.barycentrics,
        .axes = .ofCorners(place.corners.position, point.view.neg(), width),
    };
    const materials: material_file.Materials(Lanes) =
        .of(frame.materials.all, place.corners.material, place.hit.mask);
    const texels: texturing.Texels(Lanes, .layers) = .find(frame, &materials, &where, null);
    inline for (.{
        "specular",
        "clearcoat",
        "clearcoat_roughness",
        "sheen_roughness",
        "iridescence",
        "diffuse_transmission",
    }) |name| {
        const slot = @field(world_file.Slot, name);
        @field(layers, name) = @field(layers, name).mul(texels.float(slot, 0));
    }
    inline for (.{ "specular_color", "sheen_color", "diffuse_transmission_color" }) |name| {
        const slot = @field(world_file.Slot, name);
        @field(layers, name) = @field(layers, name).mul(texels.vector(slot));
    }
    const thin = all.float("iridescence_thickness_min_nm");
    const range = layers.iridescence_thickness_nm.sub(thin);
    layers.iridescence_thickness_nm =
        thin.add(range.mul(texels.float(.iridescence_thickness, 0)));
    const base = &point.material;
    base.transmission = base.transmission.mul(texels.float(.transmission, 0));
    const gloss = one.sub(base.roughness).mul(texels.float(.glossiness, 0));
    const glossy = lanesWith(Lanes, frame, &materials.used, .glossiness).bitAnd(layers.present);
    base.roughness = .select(glossy, one.sub(gloss), base.roughness);
    bent.tangent = texels.tangent();
    bent.bitangent_sign = .fromArray(texels.tangents[3]);
    const turned = lanesWith(Lanes, frame, &materials.used, .anisotropy).bitAnd(layers.present);
    if (turned.any()) turnByTexture(Lanes, &texels, turned, layers, bent);
    const usable = bent.tangent.dot(bent.tangent).gt(.zero());
    const bumpy = lanesWith(Lanes, frame, &materials.used, .clearcoat_normal)
        .bitAnd(layers.present).bitAnd(usable);
    if (bumpy.none()) return;
    const smooth = interaction_file.mix(Lanes, place.hit.barycentrics, place.corners.normal);
    const face: Lanes.Vec3 =
        .select(point.back, point.normal_geometric.neg(), point.normal_geometric);
    const mapped = normal_map.apply(Lanes, point, &.{
        .normal = interaction_file.usableNormal(Lanes, smooth, face),
        .tangent = bent.tangent,
        .bitangent_sign = bent.bitangent_sign,
    }, texels.vector(.clearcoat_normal), all.float("clearcoat_normal_scale"));
    layers.clearcoat_normal = .select(bumpy, mapped, layers.clearcoat_normal);
}

/// KHR_materials_anisotropy: the texture's direction, turned by the material's rotation.
fn turnByTexture(
    comptime Lanes: type,
    texels: *const texturing.Texels(Lanes, .layers),
    turned: Lanes.Mask,
    layers: *Layers(Lanes),
    bent: *Bent(Lanes),
) void {
    const one: Lanes.F32 = .splat(1);
    const channels = texels.vector(.anisotropy);
    const x = channels.x.add(channels.x).sub(one);
    const y = channels.y.add(channels.y).sub(one);
    const cosine = bent.along[0];
    const sine = bent.along[1];
    bent.along = .{
        .select(turned, cosine.mul(x).sub(sine.mul(y)), cosine),
        .select(turned, sine.mul(x).add(cosine.mul(y)), sine),
    };
    const strength = layers.anisotropy.mul(channels.z);
    layers.anisotropy = .select(turned, strength, layers.anisotropy);
}

/// Lanes whose material looks up a slot.
fn lanesWith(
    comptime Lanes: type,
    frame: *const Frame,
    used: *const Unique(Lanes),
    slot: world_file.Slot,
) Lanes.Mask {
    var found: Lanes.Mask = .splat(false);
    for (used.numbers[0..used.count], used.lanes[0..used.count]) |number, lanes| {
        const lookups = texturing.lookupsOf(.layers, frame.materials, number);
        if (lookups_file.has(lookups, slot)) found = found.bitOr(lanes);
    }
    return found;
}
