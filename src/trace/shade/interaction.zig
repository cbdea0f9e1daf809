//! From a hit back to the surface: position, normals and material in lanes.
//!
//! In: rays with their nearest primitive. Out: what shading needs. The barycentric weights come
//! from the very edge functions that decided the hit; the position is a corner plus their mix of
//! the edges, which lies on the triangle whatever the ray's length (pbrt, 4th edition, section
//! 6.8.4), and rounds but once at the magnitude of coordinates: a scene far from the origin keeps
//! its corners clean.

const std = @import("std");
const world_file = @import("../../world.zig");
const ray_file = @import("../traverse/ray.zig");
const offset = @import("offset.zig");
const triangle = @import("../traverse/triangle.zig");
const assert = std.debug.assert;
const Frame = world_file.Frame;
const Geometry = world_file.Geometry;

/// A material in lanes: the fields of `world.Material`, base colour times the vertex colours.
pub fn Material(comptime Lanes: type) type {
    return struct {
        base_color: Lanes.Vec3,
        emissive: Lanes.Vec3,
        metallic: Lanes.F32,
        roughness: Lanes.F32,
        dielectric_f0: Lanes.F32,
        ior: Lanes.F32,
        transmission: Lanes.F32,
        absorption: Lanes.Vec3,
        unlit: Lanes.Mask,
        volume: Lanes.Mask,
    };
}

/// A point on a surface in lanes.
pub fn Surface(comptime Lanes: type) type {
    return struct {
        /// Lanes that hit something.
        hit: Lanes.Mask,
        position: Lanes.Vec3,
        /// Unit normal of the triangle on the side that the ray came from.
        normal_geometric: Lanes.Vec3,
        /// Unit normal for shading, on the same side.
        normal: Lanes.Vec3,
        /// Unit vector towards where the ray came from.
        view: Lanes.Vec3,
        /// Length of the ray to here, in metres.
        distance: Lanes.F32,
        /// Lanes that see the back of the triangle.
        back: Lanes.Mask,
        /// Lanes where the back is not shown: single-sided and no volume.
        culled: Lanes.Mask,
        /// How much of the light is stopped here, 0..1: 0 in holes, alpha where it blends.
        coverage: Lanes.F32,
        /// How far off rays have to start, see `offset.roundings`.
        roundings: Lanes.F32,
        material: Material(Lanes),

        /// The position off the surface by what rounding may do, on the side that `away`, the
        /// geometric normal or its opposite, points to; for a ray that starts there, or that
        /// comes from `other_distance` away.
        pub fn off(
            surface: *const @This(),
            away: Lanes.Vec3,
            other_distance: Lanes.F32,
            pad: f32,
        ) Lanes.Vec3 {
            const length = offset.length(Lanes, surface.roundings, other_distance, pad);
            return surface.position.add(away.scale(length));
        }
    };
}

/// The different numbers in some lanes.
fn Distinct(comptime Lanes: type) type {
    return struct {
        numbers: [Lanes.count]u32,
        /// By number, the lanes that have it; of the first, all that are not asked for, too.
        lanes: [Lanes.count]Lanes.Mask,
        count: usize,

        /// Those of the lanes asked for; none is negative there.
        inline fn of(values: Lanes.I32, asked: Lanes.Mask) @This() {
            var distinct: @This() = undefined;
            const array = values.toArray();
            var left = asked;
            distinct.count = 0;
            while (left.any()) : (distinct.count += 1) {
                const number = array[@ctz(left.bits())];
                const same = values.eq(.splat(number));
                const first = distinct.count == 0;
                distinct.numbers[distinct.count] = @intCast(number);
                distinct.lanes[distinct.count] = if (first) same.bitOr(asked.bitNot()) else same;
                left = left.andNot(same);
            }
            return distinct;
        }
    };
}

/// What the corners of triangles have, in lanes.
fn Corners(comptime Lanes: type) type {
    return struct {
        position: [3]Lanes.Vec3,
        normal: [3]Lanes.Vec3,
        /// Undefined where the scene has none.
        color: [3][4]Lanes.F32,
        material: Lanes.I32,

        const Self = @This();

        /// A triangle at a time: neighbours mostly see the same. A lane that is not asked for has
        /// one that another does.
        inline fn of(geometry: *const Geometry, primitive: Lanes.I32, asked: Lanes.Mask) Self {
            const triangles: Distinct(Lanes) = .of(primitive, asked);
            var corners: Self = undefined;
            for (0..triangles.count) |index| {
                corners.put(geometry, triangles.numbers[index], triangles.lanes[index]);
            }
            return corners;
        }

        inline fn put(
            corners: *Self,
            geometry: *const Geometry,
            number: u32,
            lanes: Lanes.Mask,
        ) void {
            const triangle_ = &geometry.triangles[number];
            inline for (0..3) |corner| {
                const vertex = triangle_.corner[corner];
                corners.position[corner] =
                    .select(lanes, .splat(geometry.positions[vertex]), corners.position[corner]);
                corners.normal[corner] =
                    .select(lanes, .splat(geometry.normals[vertex]), corners.normal[corner]);
                if (geometry.colors.len > 0) {
                    const channels = &corners.color[corner];
                    inline for (channels, 0..) |*channel, index| {
                        const value = geometry.colors[vertex][index];
                        channel.* = .select(lanes, .splat(value), channel.*);
                    }
                }
            }
            const material: Lanes.I32 = .splat(@intCast(triangle_.material));
            corners.material = .select(lanes, material, corners.material);
        }
    };
}

/// The surfaces that `ray.closest` names. Asserts that some lane hit something.
pub fn resolve(
    comptime Lanes: type,
    frame: *const Frame,
    ray: *const ray_file.Ray(Lanes),
) Surface(Lanes) {
    const F32 = Lanes.F32;
    const missed = ray.closest.primitive.eq(.splat(ray_file.no_primitive));
    const hit = ray.active.andNot(missed);
    assert(hit.any());
    const all: Corners(Lanes) = .of(frame.geometry, ray.closest.primitive, hit);
    const corners = all.position;
    const share = shares(Lanes, edgeFunctions(Lanes, corners, ray));
    const edges = [2]Lanes.Vec3{ corners[1].sub(corners[0]), corners[2].sub(corners[0]) };
    const position = corners[0].add(edges[0].scale(share[1]).add(edges[1].scale(share[2])));
    const plane = edges[0].cross(edges[1]);
    const face = unit(Lanes, plane);
    const back = face.dot(ray.line.direction).gt(.zero());
    const normal_geometric: Lanes.Vec3 = .select(back, face.neg(), face);
    const smooth = mix(Lanes, share, all.normal);
    const direction_length = ray.line.direction.length();
    const distance = ray.closest.t.mul(direction_length);
    const view = ray.line.direction.neg().scale(F32.splat(1).div(direction_length));
    const color = vertexColor(Lanes, frame.geometry, &all.color, share);
    const materials: Materials(Lanes) = .{
        .all = frame.materials.all,
        .used = .of(all.material, hit),
    };
    const material = loadMaterial(Lanes, &materials, color.rgb);
    const sides = loadSides(Lanes, &materials, color.alpha);
    return .{
        .hit = hit,
        .position = position,
        .normal_geometric = normal_geometric,
        .normal = shadingNormal(Lanes, smooth, normal_geometric),
        .view = view,
        .distance = distance,
        .back = back,
        .culled = back.andNot(sides.shows_back).andNot(material.volume),
        .coverage = sides.coverage,
        .roundings = offset.roundings(Lanes, corners, position, face, plane, distance),
        .material = material,
    };
}

/// Those of the rays asked for, all of which hit something, that hit what lets no light pass.
pub fn stopped(
    comptime Lanes: type,
    frame: *const Frame,
    primitive: Lanes.I32,
    asked: Lanes.Mask,
) Lanes.Mask {
    var found: Lanes.Mask = .splat(false);
    const triangles: Distinct(Lanes) = .of(primitive, asked);
    for (triangles.numbers[0..triangles.count], 0..) |number, index| {
        const material = &frame.materials.all[frame.geometry.triangles[number].material];
        if (material.stopsLight()) found = found.bitOr(triangles.lanes[index]);
    }
    return found.bitAnd(asked);
}

/// The edge functions that decided the hit.
inline fn edgeFunctions(
    comptime Lanes: type,
    corners: [3]Lanes.Vec3,
    ray: *const ray_file.Ray(Lanes),
) triangle.EdgeFunctions(Lanes) {
    const axis: ray_file.LongAxis(Lanes) = .of(ray.line.direction);
    const view: ray_file.ShearedRay(Lanes) = .init(ray.line, axis);
    const turned: [3]Lanes.Vec3 = .{
        axis.turn(corners[0]), axis.turn(corners[1]), axis.turn(corners[2]),
    };
    return triangle.edgeFunctions(Lanes, triangle.project(Lanes, turned, &view));
}

/// Barycentric weights of corners 0, 1, 2.
inline fn shares(comptime Lanes: type, weights: triangle.EdgeFunctions(Lanes)) [3]Lanes.F32 {
    const F32 = Lanes.F32;
    const sum = weights.sum();
    // All three can round to zero where a triangle is much smaller than its distance.
    const none = sum.eq(.zero());
    const divisor = F32.select(none, .splat(1), sum);
    return .{
        F32.select(none, .splat(1), weights.a.div(divisor)),
        weights.b.div(divisor),
        weights.c.div(divisor),
    };
}

inline fn mix(comptime Lanes: type, share: [3]Lanes.F32, corners: [3]Lanes.Vec3) Lanes.Vec3 {
    const first_two = corners[0].scale(share[0]).add(corners[1].scale(share[1]));
    return first_two.add(corners[2].scale(share[2]));
}

/// Unit length for vectors whose squares may leave the range of floats.
inline fn unit(comptime Lanes: type, vector: Lanes.Vec3) Lanes.Vec3 {
    const size = vector.abs();
    const largest = size.x.max(size.y).max(size.z);
    return vector.scale(Lanes.F32.splat(1).div(largest)).normalize();
}

/// The interpolated normal at unit length, on the side of the geometric one; that one itself where
/// the vertices have none (zero).
fn shadingNormal(
    comptime Lanes: type,
    smooth: Lanes.Vec3,
    normal_geometric: Lanes.Vec3,
) Lanes.Vec3 {
    const size = smooth.abs();
    const usable = size.x.max(size.y).max(size.z).gt(.splat(1e-15));
    const safe: Lanes.Vec3 = .select(usable, smooth, normal_geometric);
    const normal = unit(Lanes, safe);
    const opposite = normal.dot(normal_geometric).lt(.zero());
    return .select(opposite, normal.neg(), normal);
}

fn Color(comptime Lanes: type) type {
    return struct { rgb: Lanes.Vec3, alpha: Lanes.F32 };
}

fn vertexColor(
    comptime Lanes: type,
    geometry: *const Geometry,
    colors: *const [3][4]Lanes.F32,
    share: [3]Lanes.F32,
) Color(Lanes) {
    if (geometry.colors.len == 0) return .{ .rgb = .splat(.{ 1, 1, 1 }), .alpha = .splat(1) };
    var channels: [4]Lanes.F32 = undefined;
    inline for (&channels, 0..) |*channel, index| {
        const a = colors[0][index].mul(share[0]);
        const b = colors[1][index].mul(share[1]);
        const c = colors[2][index].mul(share[2]);
        channel.* = a.add(b).add(c);
    }
    return .{
        .rgb = .{ .x = channels[0], .y = channels[1], .z = channels[2] },
        .alpha = channels[3],
    };
}

/// Materials in lanes, one at a time: mostly there is one for all.
fn Materials(comptime Lanes: type) type {
    return struct {
        all: []const world_file.Material,
        used: Distinct(Lanes),

        const Self = @This();

        /// A field of one float.
        inline fn float(materials: *const Self, comptime name: []const u8) Lanes.F32 {
            return materials.pick(name, null);
        }

        /// A field of three floats, or the first three of more.
        inline fn color(materials: *const Self, comptime name: []const u8) Lanes.Vec3 {
            return .{
                .x = materials.pick(name, 0),
                .y = materials.pick(name, 1),
                .z = materials.pick(name, 2),
            };
        }

        /// A field, or a component of one.
        inline fn pick(
            materials: *const Self,
            comptime name: []const u8,
            comptime component: ?usize,
        ) Lanes.F32 {
            const used = &materials.used;
            var value: Lanes.F32 = .splat(materials.one(used.numbers[0], name, component));
            for (used.numbers[1..used.count], used.lanes[1..used.count]) |number, lanes| {
                value = .select(lanes, .splat(materials.one(number, name, component)), value);
            }
            return value;
        }

        inline fn one(
            materials: *const Self,
            number: u32,
            comptime name: []const u8,
            comptime component: ?usize,
        ) f32 {
            const value = &@field(materials.all[number], name);
            return if (component) |index| value[index] else value.*;
        }
    };
}

fn loadMaterial(
    comptime Lanes: type,
    materials: *const Materials(Lanes),
    vertex_color: Lanes.Vec3,
) Material(Lanes) {
    const zero: Lanes.F32 = .zero();
    return .{
        .base_color = materials.color("base_color").mul(vertex_color),
        .emissive = materials.color("emissive"),
        .metallic = materials.float("metallic"),
        .roughness = materials.float("roughness"),
        .dielectric_f0 = materials.float("dielectric_f0"),
        .ior = materials.float("ior"),
        .transmission = materials.float("transmission"),
        .absorption = materials.color("absorption"),
        .unlit = materials.float("unlit").gt(zero),
        .volume = materials.float("volume").gt(zero),
    };
}

fn Sides(comptime Lanes: type) type {
    return struct { shows_back: Lanes.Mask, coverage: Lanes.F32 };
}

/// What alpha and the sides of the material do to a ray.
fn loadSides(
    comptime Lanes: type,
    materials: *const Materials(Lanes),
    vertex_alpha: Lanes.F32,
) Sides(Lanes) {
    const F32 = Lanes.F32;
    const alpha = materials.pick("base_color", 3).mul(vertex_alpha);
    const blends = materials.float("blend").gt(.zero());
    const cutoff = materials.float("alpha_cutoff");
    const hole = alpha.lt(cutoff).bitAnd(cutoff.ge(.zero()));
    const clamped = alpha.max(.zero()).min(.splat(1));
    const solid = F32.select(hole, .zero(), .splat(1));
    return .{
        .shows_back = materials.float("double_sided").gt(.zero()),
        .coverage = F32.select(blends, clamped, solid),
    };
}

test "each number that is asked for once, with its lanes; others go with the first" {
    const Lanes = @import("../../simd.zig").Lanes(.vector, 4);
    const values: Lanes.I32 = .fromArray(.{ -1, 7, 3, 7 });
    const distinct: Distinct(Lanes) = .of(values, .fromBits(0b1110));
    try std.testing.expectEqual(2, distinct.count);
    try std.testing.expectEqualSlices(u32, &.{ 7, 3 }, distinct.numbers[0..2]);
    try std.testing.expectEqual(0b1011, distinct.lanes[0].bits());
    try std.testing.expectEqual(0b0100, distinct.lanes[1].bits());
    const one: Distinct(Lanes) = .of(values, .fromBits(0b0100));
    try std.testing.expectEqual(1, one.count);
    try std.testing.expectEqual(3, one.numbers[0]);
    try std.testing.expectEqual(0b1111, one.lanes[0].bits());
}
