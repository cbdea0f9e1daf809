//! Textures of materials at points in lanes, and what they do to interactions.
//!
//! In: points that are resolved by factors and vertices alone, the cones of their rays. Out: the
//! same with what textures say: colours, roughness, metal, occlusion, normals and opacity. One
//! material at a time, one lane after the other, at places that differ from lane to lane; frames
//! without textures never come here.

const std = @import("std");
const simd = @import("../../simd.zig");
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

/// The lookups of a material for some slots.
pub inline fn lookupsOf(
    comptime slots: lookups_file.Slots,
    materials: *const world_file.Materials,
    number: u32,
) []const Lookup {
    const material = &materials.all[number];
    const first = material.first_lookup;
    return switch (slots) {
        .base => materials.lookups[first..][0..material.lookup_count],
        .layers => materials
            .lookups[first + material.lookup_count ..][0..material.layer_lookup_count],
    };
}

/// What textures say: by slot, channel and lane, 1 where there is none.
pub fn Texels(comptime Lanes: type, comptime slots: lookups_file.Slots) type {
    return struct {
        values: [slots.count()][4][Lanes.count]f32,
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
                const lookups = lookupsOf(slots, frame.materials, number);
                if (lookups.len == 0 and slots == .base) continue;
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
                    var values: lookups_file.Values(slots) = @splat(@splat(1));
                    if (slot) |one|
                        lookups_file.sampleSlot(slots, frame, lookups, one, &point, &values)
                    else
                        lookups_file.sample(slots, frame, lookups, &point, &values);
                    texels.put(lane, &values);
                    if (slot == null and (slots == .layers or lookups_file.has(lookups, .normal)))
                        texels.putTangent(lane, lookups_file.tangentAt(frame.geometry, &point));
                }
            }
            return texels;
        }

        fn put(texels: *Self, lane: usize, values: *const lookups_file.Values(slots)) void {
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
        pub inline fn tangent(texels: *const Self) Lanes.Vec3 {
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
            return .fromArray(texels.values[slots.indexOf(slot)][channel]);
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
    const texels: Texels(Lanes, .base) = .find(frame, materials, place, .base_color);
    return .{
        .rgb = color.rgb.mul(texels.vector(.base_color)),
        .alpha = color.alpha.mul(texels.float(.base_color, 3)),
    };
}

/// What textures leave of transmission.
pub fn transmission(
    comptime Lanes: type,
    frame: *const Frame,
    materials: *const material_file.Materials(Lanes),
    place: *const Place(Lanes),
) Lanes.F32 {
    const used = &materials.used;
    for (used.numbers[0..used.count]) |number| {
        if (frame.materials.all[number].layer_lookup_count > 0) break;
    } else return .splat(1);
    const texels: Texels(Lanes, .layers) = .find(frame, materials, place, .transmission);
    return texels.float(.transmission, 0);
}

/// Gives points their footprints, and what the textures of their materials say. `cone` is the
/// width at the origin of the ray, and the spread.
pub fn apply(
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
    if (!frame.hasTextures()) return;
    const materials: material_file.Materials(Lanes) =
        .of(frame.materials.all, corners.material, hit.mask);
    const place: Place(Lanes) = .{
        .asked = hit.mask,
        .primitive = primitive,
        .barycentrics = hit.barycentrics,
        .axes = .ofCorners(corners.position, point.view.neg(), point.cone_width),
    };
    const texels: Texels(Lanes, .base) = .find(frame, &materials, &place, null);
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

const Single = simd.Lanes(.scalar, 1);
const Lookup = world_file.Lookup;
const Texture = world_file.Texture;

const test_factors: world_file.Material = .{
    .base_color = .{ 0.5, 1, 1, 1 },
    .emissive = .{ 2, 2, 2 },
    .metallic = 0.5,
    .roughness = 0.8,
    .dielectric_f0 = 0.04,
    .ior = 1.5,
    .transmission = 0,
    .sigma_a = .{ 0, 0, 0 },
    .alpha_cutoff = -1,
    .blend = 0,
    .double_sided = 1,
    .unlit = 0,
    .volume = 0,
    .occlusion_strength = 0.5,
};

fn testLookup(slot: Slot, texture: u32) Lookup {
    return .{
        .slot = slot,
        .texture = texture,
        .wrap = @splat(.clamp_to_edge),
        .magnify_linear = false,
        .minify_linear = false,
        .has_mips = true,
        .mip_linear = false,
        .texcoord_set = 0,
        .transform = .{ .{ 1, 0, 0 }, .{ 0, 1, 0 } },
        .channels = .{ 0, 1, 2, 255 },
    };
}

/// A triangle in the plane y = 0, seen at a quarter of both its edges, (4, 0, 0) and (0, 0, -4).
const TestPoint = struct {
    material: world_file.Material = test_factors,
    textures: []const Texture,
    lookups: []const Lookup,
    texcoords: [3][2]f32 = .{ .{ 0, 1 }, .{ 1, 1 }, .{ 0, 0 } },
    tangents: [3][4]f32 = @splat(.{ 1, 0, 0, 1 }),
    normals: [3][3]f32 = @splat(.{ 0, 1, 0 }),
    /// The ray comes from there, as seen from the point.
    from: [3]f32 = .{ 0, 1, 0 },
    cone: [2]f32 = .{ 0, 0 },

    fn find(at: *const TestPoint) interaction_file.Interaction(Single) {
        var geometry: world_file.Geometry = .empty;
        const positions = [3][3]f32{ .{ 0, 0, 0 }, .{ 4, 0, 0 }, .{ 0, 0, -4 } };
        geometry.positions = &positions;
        geometry.normals = &at.normals;
        geometry.texcoords[0] = &at.texcoords;
        geometry.tangents = &at.tangents;
        geometry.triangles = &.{.{ .corner = .{ 0, 1, 2 }, .material = 0 }};
        var material = at.material;
        material.lookup_count = @intCast(at.lookups.len);
        const frame: Frame = .{
            .geometry = &geometry,
            .materials = &.{
                .all = &.{material},
                .lookups = at.lookups,
                .has_transparency = false,
                .has_holes = false,
                .occluders = &.{},
            },
            .textures = &.{ .all = at.textures },
            .lights = &.{},
            .environment = undefined,
            .view = undefined,
        };
        const corners: interaction_file.Corners(Single) =
            .of(&geometry, .splat(0), .splat(true));
        const direction = Single.Vec3.splat(at.from).neg();
        const hit: interaction_file.Hit(Single) = .{
            .mask = .splat(true),
            .origin = Single.Vec3.splat(.{ 1, 0, -1 }).sub(direction),
            .direction = direction,
            .t = .splat(1),
            .barycentrics = .{ .splat(0.5), .splat(0.25), .splat(0.25) },
        };
        var point = interaction_file.resolve(Single, &frame, &corners, &hit);
        const cone = [2]Single.F32{ .splat(at.cone[0]), .splat(at.cone[1]) };
        apply(Single, &frame, &corners, &hit, .splat(0), cone, &point);
        return point;
    }
};

fn expectVector(expected: [3]f32, found: Single.Vec3, tolerance: f32) !void {
    for (expected, found.lane(0)) |a, b| try std.testing.expectApproxEqAbs(a, b, tolerance);
}

/// A texture of one texel.
fn Texel(comptime bytes: anytype) type {
    return struct {
        const texels: [bytes.len]u8 = bytes;
        const texture: Texture = .{
            .levels = &.{.{ .width = 1, .height = 1, .texels = &texels }},
            .channel_count = bytes.len,
            .is_srgb = false,
        };
    };
}

test "every slot multiplies its factor, its channels where the lookup says" {
    var metallic_roughness = testLookup(.metallic_roughness, 1);
    metallic_roughness.channels = .{ 1, 0, 255, 255 };
    var alpha = testLookup(.base_color, 0);
    alpha.channels = .{ 0, 1, 2, 3 };
    var at: TestPoint = .{
        .textures = &.{
            Texel(.{ 255, 51, 0, 102 }).texture,
            Texel(.{ 51, 204 }).texture,
            Texel(.{51}).texture,
        },
        .lookups = &.{
            alpha,                    metallic_roughness,
            testLookup(.emissive, 0), testLookup(.occlusion, 2),
        },
    };
    at.material.blend = 1;
    const point = at.find();
    const material = &point.material;
    try expectVector(.{ 0.5, 0.2, 0 }, material.base_color, 1e-6);
    try expectVector(.{ 2, 0.4, 0 }, material.emissive, 1e-6);
    try std.testing.expectApproxEqRel(@as(f32, 0.8 * 0.8), material.roughness.lane(0), 1e-6);
    try std.testing.expectApproxEqRel(@as(f32, 0.5 * 0.2), material.metallic.lane(0), 1e-6);
    try std.testing.expectApproxEqRel(@as(f32, 0.6), material.occlusion.lane(0), 1e-6);
    try std.testing.expectApproxEqRel(@as(f32, 0.4), point.opacity.lane(0), 1e-6);
    try expectVector(.{ 0, 1, 0 }, point.normal, 0);
    var holes = testLookup(.base_color, 2);
    holes.channels = .{ 255, 255, 255, 0 };
    var twice = at;
    twice.lookups = &.{ alpha, holes };
    const both = twice.find();
    try expectVector(.{ 0.5, 0.2, 0 }, both.material.base_color, 1e-6);
    try std.testing.expectApproxEqRel(@as(f32, 0.4 * 0.2), both.opacity.lane(0), 1e-6);
    at.material.blend = 0;
    try std.testing.expectEqual(1, at.find().opacity.lane(0));
    for ([_]f32{ 0.39, 0.41 }, [_]f32{ 1, 0 }) |cutoff, opacity| {
        at.material.alpha_cutoff = cutoff;
        try std.testing.expectEqual(opacity, at.find().opacity.lane(0));
    }
}

test "a transmission texture leaves its red of what shadow rays keep" {
    var geometry: world_file.Geometry = .empty;
    geometry.triangles = &.{.{ .corner = .{ 0, 1, 2 }, .material = 0 }};
    var material = test_factors;
    const lookups = [_]Lookup{ testLookup(.emissive, 0), testLookup(.transmission, 0) };
    material.lookup_count = 1;
    for ([_]u32{ 1, 0 }, [_]f32{ 0.2, 1 }) |count, expected| {
        material.layer_lookup_count = count;
        const frame: Frame = .{
            .geometry = &geometry,
            .materials = &.{
                .all = (&material)[0..1],
                .lookups = &lookups,
                .has_transparency = true,
                .has_holes = false,
                .occluders = &.{},
            },
            .textures = &.{ .all = &.{Texel(.{ 51, 255 }).texture} },
            .lights = &.{},
            .environment = undefined,
            .view = undefined,
        };
        const materials: material_file.Materials(Single) =
            .of(frame.materials.all, .splat(0), .splat(true));
        const left = transmission(Single, &frame, &materials, &.{
            .asked = .splat(true),
            .primitive = .splat(0),
            .barycentrics = @splat(.splat(0)),
            .axes = .{ .weights = @splat(@splat(.zero())) },
        });
        try std.testing.expectApproxEqRel(expected, left.lane(0), 1e-6);
    }
}

test "coordinates lie between those of the corners, transformed, and no number does no harm" {
    // Sixteen texels, each of its own number; the point is in column 1, row 3 - 1.
    const texels: [16]u8 = std.simd.iota(u8, 16);
    var lookup = testLookup(.emissive, 0);
    var at: TestPoint = .{
        .textures = &.{.{
            .levels = &.{.{ .width = 4, .height = 4, .texels = &texels }},
            .channel_count = 1,
            .is_srgb = false,
        }},
        .lookups = (&lookup)[0..1],
        .texcoords = .{ .{ 0.1, 0.9 }, .{ 1.1, 0.9 }, .{ 0.1, -0.1 } },
    };
    at.material.emissive = .{ 255, 0, 0 };
    const Case = struct { [2][3]f32, f32 };
    for ([_]Case{
        .{ .{ .{ 1, 0, 0 }, .{ 0, 1, 0 } }, 9 },
        .{ .{ .{ 0, 1, 0 }, .{ 1, 0, 0 } }, 6 },
        .{ .{ .{ 2, 0, 0.2 }, .{ 0, 0.1, 0 } }, 3 },
    }) |case| {
        lookup.transform = case[0];
        try std.testing.expectApproxEqRel(case[1], at.find().material.emissive.x.lane(0), 1e-6);
    }
    // A set that no mesh has: the place is the transform's.
    lookup.texcoord_set = 2;
    lookup.transform = .{ .{ 1, 0, 0.6 }, .{ 0, 1, 0.3 } };
    try std.testing.expectApproxEqRel(@as(f32, 6), at.find().material.emissive.x.lane(0), 1e-6);
    lookup.texcoord_set = 0;
    const inf = std.math.inf(f32);
    const nan = std.math.nan(f32);
    for ([_][3][2]f32{
        @splat(.{ 0.5, 0.5 }),
        .{ .{ nan, 0 }, .{ 1, 0 }, .{ 0, inf } },
        .{ .{ 1e38, 0 }, .{ -1e38, 0 }, .{ 1e38, -1e38 } },
    }) |texcoords| {
        at.texcoords = texcoords;
        at.cone = .{ 0.1, 0.1 };
        const red = at.find().material.emissive.x.lane(0);
        try std.testing.expect(red >= 0 and red <= 15);
    }
}

test "the level follows from the width of the cone, its spread, the distance and the angle" {
    var levels: [6]world_file.TextureLevel = undefined;
    var all_texels: [6][1024]u8 = undefined;
    for (&levels, &all_texels, 0..) |*level, *texels, number| {
        texels.* = @splat(@intCast(number));
        const side = @as(u32, 32) >> @intCast(number);
        level.* = .{ .width = side, .height = side, .texels = texels };
    }
    var lookup = testLookup(.emissive, 0);
    lookup.mip_linear = true;
    var at: TestPoint = .{
        .textures = &.{.{ .levels = &levels, .channel_count = 1, .is_srgb = false }},
        .lookups = (&lookup)[0..1],
    };
    at.material.emissive = .{ 255, 0, 0 };
    // Texels are 4 / 32 metres wide.
    const Case = struct { [2]f32, [3]f32, f32 };
    for ([_]Case{
        .{ .{ 0.125, 0 }, .{ 0, 2, 0 }, 0 },
        .{ .{ 0.25, 0 }, .{ 0, 2, 0 }, 1 },
        .{ .{ -0.5, 0 }, .{ 0, 2, 0 }, 2 },
        .{ .{ 0.1, 0.2 }, .{ 0, 2, 0 }, 2 },
        .{ .{ 0, 0.5 }, .{ 0, -1, 0 }, 2 },
        .{ .{ 100, 0 }, .{ 0, 1, 0 }, 5 },
        // At 60 degrees it is twice as long: a circle of the same area, 2.83 texels.
        .{ .{ 0.25, 0 }, .{ 1.7320508, 1, 0 }, 1.4142135 },
    }) |case| {
        at.cone = case[0];
        at.from = case[1];
        const point = at.find();
        try std.testing.expectApproxEqAbs(case[2], point.material.emissive.x.lane(0), 1e-4);
    }
}

test "a normal texture turns normals in the frame of tangents, on either side" {
    var at: TestPoint = .{
        .textures = &.{ Texel(.{ 204, 128, 230 }).texture, Texel(.{ 128, 204, 230 }).texture },
        .lookups = &.{testLookup(.normal, 0)},
    };
    try expectVector(.{ 0.6, 0.8, 0 }, at.find().normal, 6e-3);
    at.lookups = &.{testLookup(.normal, 1)};
    try expectVector(.{ 0, 0.8, -0.6 }, at.find().normal, 6e-3);
    for (&at.tangents) |*tangent| tangent[3] = -1;
    try expectVector(.{ 0, 0.8, 0.6 }, at.find().normal, 6e-3);
    at.from = .{ 0, -1, 0 };
    try expectVector(.{ 0, -0.8, -0.6 }, at.find().normal, 6e-3);
    at.material.normal_scale = 0;
    try expectVector(.{ 0, -1, 0 }, at.find().normal, 1e-6);
    at.material.normal_scale = 1;
    at.tangents = @splat(.{ 0, 0, 0, 1 });
    try expectVector(.{ 0, -1, 0 }, at.find().normal, 0);
}

test "a flat normal texture changes nothing; one of two channels is of unit length" {
    var at: TestPoint = .{
        .textures = &.{ Texel(.{ 128, 128, 255 }).texture, Texel(.{ 204, 128 }).texture },
        .lookups = &.{testLookup(.normal, 0)},
        .normals = .{ .{ 0, 2, 0 }, .{ 0.3, 1, 0 }, .{ 0, 1, 0.3 } },
    };
    const bumpy = at.find().normal.lane(0);
    at.lookups = &.{testLookup(.emissive, 0)};
    try expectVector(bumpy, at.find().normal, 6e-3);
    var two = testLookup(.normal, 1);
    two.channels[2] = 255;
    at.lookups = (&two)[0..1];
    at.normals = @splat(.{ 0, 1, 0 });
    try expectVector(.{ 0.6, 0.8, 0 }, at.find().normal, 6e-3);
}

test "a normal that would be seen from behind is bent back to where it mirrors the horizon" {
    var at: TestPoint = .{
        .textures = &.{Texel(.{ 0, 128, 128 }).texture},
        .lookups = &.{testLookup(.normal, 0)},
    };
    for ([_][3]f32{ .{ 1, 0.5, 0 }, .{ 1, 0.01, 0 }, .{ 1, 1e-4, 1 }, .{ 0, 1, 0 } }) |from| {
        at.from = from;
        const point = at.find();
        const cosine = point.normal.dot(point.view);
        try std.testing.expect(cosine.lane(0) > 0);
        try std.testing.expectApproxEqAbs(1, point.normal.length().lane(0), 1e-6);
        const mirrored = point.normal.scale(cosine.add(cosine)).sub(point.view);
        try std.testing.expect(mirrored.y.lane(0) > 0 and mirrored.y.lane(0) <= 0.0101);
    }
}
