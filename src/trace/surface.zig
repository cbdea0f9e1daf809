//! From a hit back to the surface: position, normals and material in lanes.
//!
//! In: rays with their nearest primitive. Out: what shading needs. The barycentric weights come
//! from the very edge functions that decided the hit; the position is a corner plus their mix of
//! the edges, which lies on the triangle whatever the ray's length (pbrt, 4th edition, section
//! 6.8.4), and rounds but once at the magnitude of coordinates: a scene far from the origin keeps
//! its corners clean.

const std = @import("std");
const world_file = @import("../world.zig");
const ray_file = @import("ray.zig");
const offset = @import("offset.zig");
const triangle = @import("triangle.zig");
const assert = std.debug.assert;
const World = world_file.World;

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

/// Corner data of the primitives in lanes, [corner][component][lane].
fn Gathered(comptime ray_count: comptime_int) type {
    return struct {
        position: [3][3][ray_count]f32,
        normal: [3][3][ray_count]f32,
        color: [3][4][ray_count]f32,
        material: [ray_count]u32,
    };
}

fn gather(comptime Lanes: type, world: *const World, primitives: Lanes.I32) Gathered(Lanes.count) {
    var gathered: Gathered(Lanes.count) = undefined;
    for (primitives.toArray(), 0..) |primitive, lane| {
        // A lane without a hit takes any triangle; its results are masked out.
        const number: usize = if (primitive >= 0) @intCast(primitive) else 0;
        const corners = world.triangles[number];
        gathered.material[lane] = corners.material;
        for (corners.corner, 0..) |vertex, corner| {
            for (0..3) |axis| {
                gathered.position[corner][axis][lane] = world.positions[vertex][axis];
                gathered.normal[corner][axis][lane] = world.normals[vertex][axis];
            }
            if (world.colors.len == 0) continue;
            for (0..4) |channel| {
                gathered.color[corner][channel][lane] = world.colors[vertex][channel];
            }
        }
    }
    return gathered;
}

inline fn vec3(comptime Lanes: type, arrays: [3][Lanes.count]f32) Lanes.Vec3 {
    return .{
        .x = .fromArray(arrays[0]),
        .y = .fromArray(arrays[1]),
        .z = .fromArray(arrays[2]),
    };
}

/// The surfaces that `ray.nearest` names. Asserts that some lane hit something.
pub fn resolve(
    comptime Lanes: type,
    world: *const World,
    ray: *const ray_file.Ray(Lanes),
) Surface(Lanes) {
    const F32 = Lanes.F32;
    const missed = ray.nearest.primitive.eq(.splat(ray_file.no_primitive));
    const hit = ray.active.andNot(missed);
    assert(hit.any());
    const gathered = gather(Lanes, world, Lanes.I32.select(hit, ray.nearest.primitive, .splat(0)));
    const corners: [3]Lanes.Vec3 = .{
        vec3(Lanes, gathered.position[0]),
        vec3(Lanes, gathered.position[1]),
        vec3(Lanes, gathered.position[2]),
    };
    const share = shares(Lanes, weigh(Lanes, corners, ray));
    const edges = [2]Lanes.Vec3{ corners[1].sub(corners[0]), corners[2].sub(corners[0]) };
    const position = corners[0].add(edges[0].scale(share[1]).add(edges[1].scale(share[2])));
    const plane = edges[0].cross(edges[1]);
    const face = unit(Lanes, plane);
    const back = face.dot(ray.line.direction).gt(.zero());
    const normal_geometric: Lanes.Vec3 = .select(back, face.neg(), face);
    const smooth = mix(Lanes, share, .{
        vec3(Lanes, gathered.normal[0]),
        vec3(Lanes, gathered.normal[1]),
        vec3(Lanes, gathered.normal[2]),
    });
    const direction_length = ray.line.direction.length();
    const distance = ray.nearest.t.mul(direction_length);
    const view = ray.line.direction.neg().scale(F32.splat(1).div(direction_length));
    const color = vertexColor(Lanes, world, &gathered, share);
    const material = loadMaterial(Lanes, world.materials, &gathered.material, color.rgb);
    const sides = loadSides(Lanes, world.materials, &gathered.material, color.alpha);
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

/// The edge functions that decided the hit.
inline fn weigh(
    comptime Lanes: type,
    corners: [3]Lanes.Vec3,
    ray: *const ray_file.Ray(Lanes),
) triangle.Weights(Lanes) {
    const axis: ray_file.LongAxis(Lanes) = .of(ray.line.direction);
    const view: ray_file.View(Lanes) = .init(ray.line, axis);
    const turned: [3]Lanes.Vec3 = .{
        axis.turn(corners[0]), axis.turn(corners[1]), axis.turn(corners[2]),
    };
    return triangle.weigh(Lanes, triangle.project(Lanes, turned, &view));
}

/// Barycentric weights of corners 0, 1, 2.
inline fn shares(comptime Lanes: type, weights: triangle.Weights(Lanes)) [3]Lanes.F32 {
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
    world: *const World,
    gathered: *const Gathered(Lanes.count),
    share: [3]Lanes.F32,
) Color(Lanes) {
    if (world.colors.len == 0) return .{ .rgb = .splat(.{ 1, 1, 1 }), .alpha = .splat(1) };
    var channels: [4]Lanes.F32 = undefined;
    inline for (&channels, 0..) |*channel, index| {
        const a = Lanes.F32.fromArray(gathered.color[0][index]).mul(share[0]);
        const b = Lanes.F32.fromArray(gathered.color[1][index]).mul(share[1]);
        const c = Lanes.F32.fromArray(gathered.color[2][index]).mul(share[2]);
        channel.* = a.add(b).add(c);
    }
    return .{
        .rgb = .{ .x = channels[0], .y = channels[1], .z = channels[2] },
        .alpha = channels[3],
    };
}

/// One field of the lanes' materials.
inline fn field(
    comptime Lanes: type,
    materials: []const world_file.Material,
    indices: *const [Lanes.count]u32,
    comptime name: []const u8,
) Lanes.F32 {
    var values: [Lanes.count]f32 = undefined;
    for (indices, &values) |index, *value| value.* = @field(materials[index], name);
    return .fromArray(values);
}

/// One field of three floats of the lanes' materials.
inline fn field3(
    comptime Lanes: type,
    materials: []const world_file.Material,
    indices: *const [Lanes.count]u32,
    comptime name: []const u8,
) Lanes.Vec3 {
    var values: [3][Lanes.count]f32 = undefined;
    for (indices, 0..) |index, lane| {
        const value = @field(materials[index], name);
        inline for (0..3) |component| values[component][lane] = value[component];
    }
    return vec3(Lanes, values);
}

fn loadMaterial(
    comptime Lanes: type,
    materials: []const world_file.Material,
    indices: *const [Lanes.count]u32,
    vertex_color: Lanes.Vec3,
) Material(Lanes) {
    const zero: Lanes.F32 = .zero();
    return .{
        .base_color = field3(Lanes, materials, indices, "base_color").mul(vertex_color),
        .emissive = field3(Lanes, materials, indices, "emissive"),
        .metallic = field(Lanes, materials, indices, "metallic"),
        .roughness = field(Lanes, materials, indices, "roughness"),
        .dielectric_f0 = field(Lanes, materials, indices, "dielectric_f0"),
        .ior = field(Lanes, materials, indices, "ior"),
        .transmission = field(Lanes, materials, indices, "transmission"),
        .absorption = field3(Lanes, materials, indices, "absorption"),
        .unlit = field(Lanes, materials, indices, "unlit").gt(zero),
        .volume = field(Lanes, materials, indices, "volume").gt(zero),
    };
}

fn Sides(comptime Lanes: type) type {
    return struct { shows_back: Lanes.Mask, coverage: Lanes.F32 };
}

/// What alpha and the sides of the material do to a ray.
fn loadSides(
    comptime Lanes: type,
    materials: []const world_file.Material,
    indices: *const [Lanes.count]u32,
    vertex_alpha: Lanes.F32,
) Sides(Lanes) {
    const F32 = Lanes.F32;
    var base_alpha: [Lanes.count]f32 = undefined;
    for (indices, &base_alpha) |index, *value| value.* = materials[index].base_color[3];
    const alpha = F32.fromArray(base_alpha).mul(vertex_alpha);
    const blends = field(Lanes, materials, indices, "blend").gt(.zero());
    const hole = alpha.lt(field(Lanes, materials, indices, "alpha_cutoff"));
    const clamped = alpha.max(.zero()).min(.splat(1));
    const solid = F32.select(hole, .zero(), .splat(1));
    return .{
        .shows_back = field(Lanes, materials, indices, "double_sided").gt(.zero()),
        .coverage = F32.select(blends, clamped, solid),
    };
}
