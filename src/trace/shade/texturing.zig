//! Textures of materials at points in lanes, and what they do to interactions.
//!
//! In: points that are resolved by factors and vertices alone, the cones of their rays. Out: the
//! same with what textures say: colours, roughness, metal, occlusion, normals and opacity. One
//! material at a time, one lane after the other, at places that differ from lane to lane; frames
//! without textures never come here.

const world_file = @import("../../world.zig");
const interaction_file = @import("interaction.zig");
const lookups_file = @import("lookups.zig");
const material_file = @import("material.zig");
const normal_map = @import("normal_map.zig");
const ray_cone = @import("ray_cone.zig");
const Frame = world_file.Frame;
const Slot = world_file.Slot;

/// Where lanes look textures up.
pub fn Place(comptime Lanes: type) type {
    return struct {
        /// Lanes that do.
        asked: Lanes.Mask,
        primitive: Lanes.I32,
        /// Weights of corners 0, 1, 2.
        barycentrics: [3]Lanes.F32,
        axes: ray_cone.Axes(Lanes),
    };
}

/// What textures say: by slot, channel and lane, 1 where there is none.
pub fn Texels(comptime Lanes: type) type {
    return struct {
        values: [lookups_file.slot_count][4][Lanes.count]f32,
        /// By component; 0 where a normal texture is not used.
        tangents: [4][Lanes.count]f32,

        const Self = @This();

        /// Those of all slots, or of one.
        pub noinline fn find(
            frame: *const Frame,
            materials: *const material_file.Materials(Lanes),
            place: *const Place(Lanes),
            slot: ?Slot,
        ) Self {
            var texels: Self = .{
                .values = @splat(@splat(@splat(1))),
                .tangents = @splat(@splat(0)),
            };
            const primitives = place.primitive.toArray();
            const weights = arrays(place.barycentrics[1..3].*);
            const axes = [2][2][Lanes.count]f32{
                arrays(place.axes.weights[0]), arrays(place.axes.weights[1]),
            };
            const used = &materials.used;
            for (used.numbers[0..used.count], used.lanes[0..used.count]) |number, lanes| {
                const material = &frame.materials.all[number];
                if (material.lookup_count == 0) continue;
                const lookups = frame.materials
                    .lookups[material.first_lookup..][0..material.lookup_count];
                var bits = lanes.bitAnd(place.asked).bits();
                while (bits != 0) : (bits &= bits - 1) {
                    const lane = @ctz(bits);
                    const point: lookups_file.Point = .{
                        .primitive = @intCast(primitives[lane]),
                        .weights = .{ weights[0][lane], weights[1][lane] },
                        .axes = .{
                            .{ axes[0][0][lane], axes[0][1][lane] },
                            .{ axes[1][0][lane], axes[1][1][lane] },
                        },
                    };
                    var values: lookups_file.Values = @splat(@splat(1));
                    if (slot) |one|
                        lookups_file.sampleSlot(frame, lookups, one, &point, &values)
                    else
                        lookups_file.sample(frame, lookups, &point, &values);
                    texels.put(lane, &values);
                    if (slot == null and lookups_file.has(lookups, .normal))
                        texels.putTangent(lane, lookups_file.tangentAt(frame.geometry, &point));
                }
            }
            return texels;
        }

        fn put(texels: *Self, lane: usize, values: *const lookups_file.Values) void {
            for (&texels.values, values) |*slot, channels| {
                for (slot, channels) |*channel, value| channel[lane] = value;
            }
        }

        fn putTangent(texels: *Self, lane: usize, values: [4]f32) void {
            for (&texels.tangents, values) |*component, value| component[lane] = value;
        }

        inline fn arrays(values: [2]Lanes.F32) [2][Lanes.count]f32 {
            return .{ values[0].toArray(), values[1].toArray() };
        }

        /// Tangents between the corners.
        inline fn tangent(texels: *const Self) Lanes.Vec3 {
            const components = &texels.tangents;
            return .{
                .x = .fromArray(components[0]),
                .y = .fromArray(components[1]),
                .z = .fromArray(components[2]),
            };
        }

        /// A channel of a slot.
        pub inline fn float(
            texels: *const Self,
            comptime slot: Slot,
            comptime channel: usize,
        ) Lanes.F32 {
            return .fromArray(texels.values[@backingInt(slot)][channel]);
        }

        /// The first three.
        pub inline fn vector(texels: *const Self, comptime slot: Slot) Lanes.Vec3 {
            return .{
                .x = texels.float(slot, 0),
                .y = texels.float(slot, 1),
                .z = texels.float(slot, 2),
            };
        }
    };
}

/// A vertex colour times the base colour texture.
pub fn colored(
    comptime Lanes: type,
    frame: *const Frame,
    materials: *const material_file.Materials(Lanes),
    place: *const Place(Lanes),
    color: material_file.Color(Lanes),
) material_file.Color(Lanes) {
    const texels: Texels(Lanes) = .find(frame, materials, place, .base_color);
    return .{
        .rgb = color.rgb.mul(texels.vector(.base_color)),
        .alpha = color.alpha.mul(texels.float(.base_color, 3)),
    };
}

/// Gives points their footprints, and what the textures of their materials say. `cone` is the
/// width at the origin of the ray, and the spread.
pub noinline fn apply(
    comptime Lanes: type,
    frame: *const Frame,
    corners: *const interaction_file.Corners(Lanes),
    hit: *const interaction_file.Hit(Lanes),
    primitive: Lanes.I32,
    cone: [2]Lanes.F32,
    point: *interaction_file.Interaction(Lanes),
) void {
    const face: Lanes.Vec3 =
        .select(point.back, point.normal_geometric.neg(), point.normal_geometric);
    point.cone_width = ray_cone.widthAt(Lanes, cone[0], cone[1], point.distance);
    const curvature = ray_cone.curvatureOf(Lanes, corners.position, corners.normal);
    const smooth = interaction_file.mix(Lanes, hit.barycentrics, corners.normal);
    const opposite = smooth.dot(point.normal_geometric).lt(.zero());
    point.curvature = .select(opposite, curvature.neg(), curvature);
    const materials: material_file.Materials(Lanes) =
        .of(frame.materials.all, corners.material, hit.mask);
    const place: Place(Lanes) = .{
        .asked = hit.mask,
        .primitive = primitive,
        .barycentrics = hit.barycentrics,
        .axes = .ofCorners(corners.position, point.view.neg(), point.cone_width),
    };
    const texels: Texels(Lanes) = .find(frame, &materials, &place, null);
    const material = &point.material;
    material.base_color = material.base_color.mul(texels.vector(.base_color));
    const color = corners.colorAt(frame.geometry, hit.barycentrics);
    const alpha = color.alpha.mul(texels.float(.base_color, 3));
    point.opacity = material_file.opacity(Lanes, &materials, alpha);
    material.roughness = material.roughness.mul(texels.float(.metallic_roughness, 0));
    material.metallic = material.metallic.mul(texels.float(.metallic_roughness, 1));
    material.emissive = material.emissive.mul(texels.vector(.emissive));
    const one: Lanes.F32 = .splat(1);
    const shade = one.sub(texels.float(.occlusion, 0));
    material.occlusion = one.sub(shade.mul(materials.float("occlusion_strength")));
    const tangent = texels.tangent();
    const bumpy = hit.mask.bitAnd(tangent.dot(tangent).gt(.zero()));
    if (bumpy.none()) return;
    const mapped = normal_map.apply(Lanes, point, &.{
        .normal = interaction_file.usableNormal(Lanes, smooth, face),
        .tangent = tangent,
        .bitangent_sign = .fromArray(texels.tangents[3]),
    }, texels.vector(.normal), materials.float("normal_scale"));
    point.normal = .select(bumpy, mapped, point.normal);
}
