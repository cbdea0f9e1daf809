//! Few lights for many emitters: clusters by position and normal, cut where that helps the most
//! (after Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree
//! Splitting", whose trees are over lights as well).
//!
//! In: small flat emitters. Out: lights of the kind `emitter`, at most so many.
//! A cluster's flux times its variance tells what a point in its place gets wrong; the worst is cut
//! in two at the mean of the coordinate that varies most, of six: a normal counts as a place as far
//! away as the cluster is wide. Its light shines by max(0, a cosine + b), with a and b such that
//! its flux and the mean of its directions are the cluster's: exactly a flat emitter's cosine, and
//! the even light of a closed convex one. That of a flat cluster stands before all of it. Any other
//! stands within, and what is as near to it as the cluster's parts casts no shadow.

const std = @import("std");
const math = @import("../math.zig");
const pose = @import("pose.zig");
const world = @import("../world.zig");
const emitters = @import("emitters.zig");
const Allocator = std.mem.Allocator;
const Piece = emitters.Piece;
const luminanceOf = emitters.luminanceOf;
const vec3 = math.vec3;
const vec3d = math.vec3d;
const Vec3d = math.Vec3d;

/// Lights of a scene, where no file says which surfaces are lights.
pub const count_default = 16;
/// And where it does, as many for each of them, up to so many in all.
pub const count_max = 256;

/// Part of the scene's size that clusters are not cut below: seen from afar they are points.
const point_share = 1.0 / 64.0;
/// Part of the scene's box for those that shine to all sides, whose shadow rays are no beams.
const round_point_share = 1.0 / 32.0;
/// Clusters that have less than this part of all light are not cut.
const cut_share = 1.0 / 1024.0;
/// Length of the mean normal of flat clusters, at least.
const flatness_min = 0.95;
/// How far before a flat cluster's middle its parts may be, in square roots of its area.
const lift_max = 0.1;
/// How far before all of them its light is.
const lift_gap = 1e-3;

/// Neighbours among the pieces.
const Cluster = struct {
    pieces: []Piece,
    /// Of all pieces, in lumens.
    flux: f64,
    /// Means by flux; the normals' is shorter the more they differ.
    middle: Vec3d,
    normal: Vec3d,
    /// Mean squared distance from the middle.
    variance: f64,
    /// Coordinate that varies most, of position and normal.
    axis: usize,

    fn of(pieces: []Piece) Cluster {
        var cluster: Cluster = .{
            .pieces = pieces,
            .flux = 0,
            .middle = .{ 0, 0, 0 },
            .normal = .{ 0, 0, 0 },
            .variance = 0,
            .axis = 0,
        };
        for (pieces) |*piece| {
            const weight = piece.luminance();
            cluster.flux += weight;
            for (0..3) |axis| {
                cluster.middle[axis] += weight * piece.position[axis];
                cluster.normal[axis] += weight * piece.normal[axis];
            }
        }
        cluster.middle = vec3d.scale(cluster.middle, 1 / cluster.flux);
        cluster.normal = vec3d.scale(cluster.normal, 1 / cluster.flux);
        var variances: [6]f64 = @splat(0);
        for (pieces) |*piece| {
            const share = piece.luminance() / cluster.flux;
            for (0..6) |axis| {
                const off = coordinate(piece, axis) - cluster.mean(axis);
                variances[axis] += share * (off * off);
            }
        }
        cluster.variance = variances[0] + variances[1] + variances[2];
        for (variances[3..]) |*variance| variance.* *= cluster.variance;
        for (variances, 0..) |variance, axis| {
            if (variance > variances[cluster.axis]) cluster.axis = axis;
        }
        return cluster;
    }

    fn coordinate(piece: *const Piece, axis: usize) f64 {
        return if (axis < 3) piece.position[axis] else piece.normal[axis - 3];
    }

    fn mean(cluster: *const Cluster, axis: usize) f64 {
        return if (axis < 3) cluster.middle[axis] else cluster.normal[axis - 3];
    }

    /// What a point in its place gets wrong; negative where it need not be cut: where it is no
    /// wider than a part of the scene's size, and if it shines to all sides, than `round_point`.
    fn cost(
        cluster: *const Cluster,
        flux_min: f64,
        geometry: *const world.Geometry,
        round_point: f64,
    ) f64 {
        if (cluster.pieces.len < 2 or cluster.flux < flux_min) return -1;
        const unlike = 1 - vec3d.dot(cluster.normal, cluster.normal);
        var least: f64 = geometry.size * point_share;
        if (unlike > 0.5) least = @max(least, round_point);
        if (cluster.variance <= least * least) return -1;
        return cluster.flux * cluster.variance * (1 + unlike);
    }

    /// How many pieces lie before the mean of its axis: those come first then.
    fn cut(cluster: *const Cluster) usize {
        const at = cluster.mean(cluster.axis);
        var count: usize = 0;
        for (cluster.pieces, 0..) |*piece, index| {
            if (coordinate(piece, cluster.axis) > at) continue;
            std.mem.swap(Piece, &cluster.pieces[count], &cluster.pieces[index]);
            count += 1;
        }
        return count;
    }
};

/// How many lights there may be.
pub const Limits = struct {
    /// At least 1.
    count_max: usize,
    /// Clusters that shine to all sides are cut as far as flat ones.
    cuts_round: bool,
};

/// The lights of some pieces, which change their order; from `arena`.
pub fn make(
    gpa: Allocator,
    arena: Allocator,
    pieces: []Piece,
    geometry: *const world.Geometry,
    limits: Limits,
) error{OutOfMemory}![]const world.Light {
    if (pieces.len == 0) return &.{};
    std.debug.assert(limits.count_max > 0);
    var clusters: std.ArrayList(Cluster) = try .initCapacity(gpa, limits.count_max);
    defer clusters.deinit(gpa);
    clusters.appendAssumeCapacity(.of(pieces));
    const flux_min = clusters.items[0].flux * cut_share;
    const extent: f64 = vec3.maxComponent(geometry.bounds.extent());
    const round_point = if (limits.cuts_round) 0 else extent * round_point_share;
    while (clusters.items.len < limits.count_max) {
        var worst: ?*Cluster = null;
        var most: f64 = 0;
        for (clusters.items) |*cluster| {
            const cost = cluster.cost(flux_min, geometry, round_point);
            if (cost <= most) continue;
            worst = cluster;
            most = cost;
        }
        const chosen = worst orelse break;
        const all = chosen.pieces;
        const count = chosen.cut();
        if (count == 0 or count == all.len) {
            chosen.variance = 0; // By rounding: it is a point.
            continue;
        }
        chosen.* = .of(all[0..count]);
        clusters.appendAssumeCapacity(.of(all[count..]));
    }
    const lights = try arena.alloc(world.Light, clusters.items.len);
    for (clusters.items, lights) |*cluster, *light| light.* = lightOf(cluster, geometry);
    return lights;
}

/// Pieces of a cluster without gaps between them.
const Body = struct { middle: Vec3d, radius: f64, height: f64 };

fn lightOf(cluster: *const Cluster, geometry: *const world.Geometry) world.Light {
    const flatness = vec3d.length(cluster.normal);
    const direction = vec3d.normalize(cluster.normal) orelse Vec3d{ 0, 0, -1 };
    const body = bodyOf(cluster, direction);
    var area: f64 = 0;
    var flux: Vec3d = .{ 0, 0, 0 };
    for (cluster.pieces) |*piece| {
        area += piece.area;
        flux = vec3d.add(flux, piece.flux);
    }
    const side = @sqrt(area);
    const is_flat = flatness > flatness_min and body.height < lift_max * side;
    const lift = if (is_flat) body.height + lift_gap * side else 0;
    const position =
        vec3d.toSingle(vec3d.add(body.middle, vec3d.scale(direction, lift)));
    var intensity: math.Vec3 = undefined;
    for (&intensity, flux) |*to, lumens|
        to.* = @floatCast(@min(lumens / std.math.pi, std.math.floatMax(f32)));
    const lobe = lobeOf(flatness);
    return .{
        .kind = .emitter,
        .from_receiver = !is_flat or geometry.isCoarseAt(position),
        .position = position,
        .direction = vec3d.toSingle(direction),
        .intensity = intensity,
        .range_inv_squared = 0,
        .cone_scale = @floatCast(lobe[0]),
        .cone_offset = @floatCast(lobe[1]),
        .radius = if (is_flat) 0 else @floatCast(body.radius * (1 + 0x1p-10)),
        .disk = @floatCast(area / std.math.pi * @max(flatness, 1.0 / 16.0)),
    };
}

/// a and b of max(0, a cosine + b), whose integral over the sphere is pi, and whose first moment is
/// 2 pi / 3 of `flatness`, as a flat emitter's are where that is 1. With a = 1 / q^2 and
/// b = (q - 1) / q^2 the flux is right for any q from 1 to 2, and q = 3 - 2 flatness; rounder ones
/// shine to all sides.
fn lobeOf(flatness: f64) [2]f64 {
    if (flatness <= 0.5) return .{ 0.5 * flatness, 0.25 };
    const q = 3 - 2 * @min(flatness, 1);
    return .{ 1 / (q * q), (q - 1) / (q * q) };
}

/// Gaps that are looked for, at most.
const gap_count_max = 32;

fn bodyOf(cluster: *const Cluster, direction: Vec3d) Body {
    var pieces = cluster.pieces;
    for (0..gap_count_max) |_| {
        pieces = for (0..3) |axis| {
            std.mem.sortUnstable(Piece, pieces, axis, isBefore);
            const count = gapIn(pieces, axis) orelse continue;
            const halves = [2][]Piece{ pieces[0..count], pieces[count..] };
            break halves[@intFromBool(fluxOf(halves[1]) > fluxOf(halves[0]))];
        } else break;
    }
    var body: Body = .{ .middle = .{ 0, 0, 0 }, .radius = 0, .height = 0 };
    for (pieces) |*piece| {
        const place = vec3d.scale(pose.widen(piece.position), piece.luminance());
        body.middle = vec3d.add(body.middle, place);
    }
    body.middle = vec3d.scale(body.middle, 1 / fluxOf(pieces));
    for (pieces) |*piece| {
        const off = vec3d.sub(pose.widen(piece.position), body.middle);
        body.radius = @max(body.radius, vec3d.length(off) + piece.radius);
        // A piece that is tilted reaches farther forward than its middle.
        const across = vec3d.cross(pose.widen(piece.normal), direction);
        const tilt = piece.radius * vec3d.length(across);
        body.height = @max(body.height, vec3d.dot(off, direction) + tilt);
    }
    return body;
}

fn fluxOf(pieces: []const Piece) f64 {
    var sum: f64 = 0;
    for (pieces) |*piece| sum += piece.luminance();
    return sum;
}

fn isBefore(axis: usize, a: Piece, b: Piece) bool {
    return a.position[axis] < b.position[axis];
}

/// How many pieces, sorted along an axis, come before the widest gap that is wider than the piece
/// behind it.
fn gapIn(pieces: []const Piece, axis: usize) ?usize {
    var result: ?usize = null;
    var widest: f32 = 0;
    var end: f32 = std.math.inf(f32);
    for (pieces, 0..) |*piece, index| {
        const place = piece.position[axis];
        const gap = place - piece.radius - end;
        if (gap > @max(widest, 2 * piece.radius)) {
            widest = gap;
            result = index;
        }
        end = if (index == 0) place + piece.radius else @max(end, place + piece.radius);
    }
    return result;
}

/// Emitters for tests: rectangles in a row, each a material of its own.
const TestEmitters = struct {
    materials: [4]world.Material = @splat(test_material),
    positions: [16]math.Vec3 = undefined,
    triangles: [8]world.Triangle = undefined,
    texcoords: [16][2]f32 = undefined,
    lookups: []const world.Lookup = &.{},
    textures: []const world.Texture = &.{},
    count: usize = 0,

    const test_material: world.Material = .{
        .base_color = .{ 1, 1, 1, 1 },
        .emissive = .{ 2, 2, 2 },
        .metallic = 0,
        .roughness = 1,
        .dielectric_f0 = 0.04,
        .ior = 1.5,
        .transmission = 0,
        .sigma_a = .{ 0, 0, 0 },
        .alpha_cutoff = -1,
        .blend = 0,
        .double_sided = 0,
        .unlit = 0,
        .volume = 0,
    };

    /// Adds the parallelogram of two edges from a corner; its front is where their product points.
    fn add(test_emitters: *TestEmitters, corner: math.Vec3, a: math.Vec3, b: math.Vec3) void {
        const number: u32 = @intCast(test_emitters.count);
        test_emitters.count += 1;
        const first = 4 * number;
        const far = vec3.add(vec3.add(corner, a), b);
        test_emitters.positions[first..][0..4].* =
            .{ corner, vec3.add(corner, a), far, vec3.add(corner, b) };
        test_emitters.texcoords[first..][0..4].* =
            .{ .{ 0, 0 }, .{ 1, 0 }, .{ 1, 1 }, .{ 0, 1 } };
        test_emitters.triangles[2 * number ..][0..2].* = .{
            .{ .corner = .{ first, first + 1, first + 2 }, .material = number },
            .{ .corner = .{ first, first + 2, first + 3 }, .material = number },
        };
    }

    /// Their lights in a scene of some size; freed with the arena.
    fn lights(
        test_emitters: *const TestEmitters,
        arena: Allocator,
        size: f32,
        count: usize,
    ) ![]const world.Light {
        var geometry: world.Geometry = .empty;
        geometry.positions = test_emitters.positions[0 .. 4 * test_emitters.count];
        geometry.triangles = test_emitters.triangles[0 .. 2 * test_emitters.count];
        geometry.texcoords[0] = test_emitters.texcoords[0 .. 4 * test_emitters.count];
        geometry.size = size;
        geometry.bounds = .{ .lower = .{ 0, 0, 0 }, .upper = @splat(size) };
        const pieces = try emitters.find(std.testing.allocator, &geometry, &.{
            .all = &test_emitters.materials,
            .lookups = test_emitters.lookups,
            .has_transparency = false,
            .has_holes = false,
            .occluders = &.{},
        }, &.{ .all = test_emitters.textures });
        defer std.testing.allocator.free(pieces);
        return make(std.testing.allocator, arena, pieces, &geometry, .{
            .count_max = count,
            .cuts_round = false,
        });
    }
};

/// Irradiance at a point of a surface that faces `normal`, by red: as `shade/light.zig` has it.
fn irradiance(lights: []const world.Light, point: Vec3d, normal: Vec3d) f64 {
    var sum: f64 = 0;
    for (lights) |*light| {
        const way = vec3d.sub(pose.widen(light.position), point);
        const squared = vec3d.dot(way, way);
        const unit = vec3d.scale(way, 1 / @sqrt(squared));
        const cosine = -vec3d.dot(unit, pose.widen(light.direction));
        const lobe = @max(0, cosine * light.cone_scale + light.cone_offset);
        const facing = @max(0, vec3d.dot(unit, normal));
        sum += facing * lobe * light.intensity[0] / (squared + light.disk);
    }
    return sum;
}

/// The same of a unit square of radiance 2 at height `height`, which faces downwards, by its
/// integral over a grid.
fn irradianceOfSquare(point: Vec3d, height: f64) f64 {
    const step_count = 64;
    var sum: f64 = 0;
    for (0..step_count) |i| for (0..step_count) |k| {
        const x = (@as(f64, @floatFromInt(i)) + 0.5) / step_count;
        const z = (@as(f64, @floatFromInt(k)) + 0.5) / step_count;
        const way = vec3d.sub(.{ x, height, z }, point);
        const squared = vec3d.dot(way, way);
        sum += way[1] * way[1] / (squared * squared);
    };
    return 2 * sum / (step_count * step_count);
}

test "lights of a square are its integral, near and far" {
    var arena: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena.deinit();
    var square: TestEmitters = .{};
    square.add(.{ 0, 3, 0 }, .{ 1, 0, 0 }, .{ 0, 0, 1 });
    const up: Vec3d = .{ 0, 1, 0 };
    for ([_]f32{ 2, 100 }, [_]usize{ 16, 1 }) |size, count| {
        const lights = try square.lights(arena.allocator(), size, 16);
        try std.testing.expectEqual(count, lights.len);
        for ([_]f64{ 0.5, 1, 2, 3, 5 }) |distance| for ([_]f64{ 0.5, 0.1, 1.5 }) |x| {
            if (count == 1 and (distance < 1 or x > 1 and distance < 2.5)) continue;
            const point: Vec3d = .{ x, 3 - distance, 0.4 };
            const exact = irradianceOfSquare(point, 3);
            // One point for all of it is good from twice its size on.
            const is_near = distance * @sqrt(@as(f64, @floatFromInt(count))) < 2.5;
            const tolerance: f64 = if (is_near) 0.1 else 0.02;
            try std.testing.expectApproxEqRel(exact, irradiance(lights, point, up), tolerance);
        };
        for (lights) |*light| {
            // Below the square, and shining downwards alone.
            try std.testing.expect(light.position[1] < 3 and light.position[1] > 2.99);
            try std.testing.expectEqual(0, light.radius);
        }
        try std.testing.expectEqual(0, irradiance(lights, .{ 0.5, 4, 0.5 }, .{ 0, -1, 0 }));
        // Never more than right before it.
        const near = irradiance(lights, .{ 0.5, 2.98, 0.5 }, up);
        try std.testing.expect(near < 2.1 * std.math.pi);
    }
}

test "double-sided surfaces shine to both sides, closed ones outwards" {
    var arena: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena.deinit();
    var square: TestEmitters = .{};
    square.add(.{ 0, 3, 0 }, .{ 1, 0, 0 }, .{ 0, 0, 1 });
    square.materials[0].double_sided = 1;
    for ([_]f32{ 2, 500 }) |size| {
        const both = try square.lights(arena.allocator(), size, 16);
        const exact = irradianceOfSquare(.{ 0.5, -2, 0.5 }, 3);
        const below = irradiance(both, .{ 0.5, -2, 0.5 }, .{ 0, 1, 0 });
        const above = irradiance(both, .{ 0.5, 8, 0.5 }, .{ 0, -1, 0 });
        // From far away it is a point that shines evenly, of the same flux.
        const expected: f64 = if (size == 2) exact else exact * 0.5;
        try std.testing.expectApproxEqRel(expected, below, 0.02);
        try std.testing.expectApproxEqRel(expected, above, 0.02);
    }
    // A slab: two squares of one material that face away from each other.
    var slab: TestEmitters = .{};
    slab.add(.{ 0, 3, 0 }, .{ 1, 0, 0 }, .{ 0, 0, 1 });
    slab.add(.{ 0, 3.1, 0 }, .{ 0, 0, 1 }, .{ 1, 0, 0 });
    for (slab.triangles[2..4]) |*triangle| triangle.material = 0;
    slab.materials[0].double_sided = 1;
    const lights = try slab.lights(arena.allocator(), 2, 16);
    var flux: f64 = 0;
    for (lights) |*light| flux += light.intensity[0] * std.math.pi;
    try std.testing.expectApproxEqRel(2 * 2 * std.math.pi, flux, 1e-5);
    const found = irradiance(lights, .{ 0.5, 1, 0.5 }, .{ 0, 1, 0 });
    try std.testing.expectApproxEqRel(irradianceOfSquare(.{ 0.5, 1, 0.5 }, 3), found, 0.02);
}

test "what a texture leaves dark emits nothing" {
    var arena: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena.deinit();
    var square: TestEmitters = .{};
    square.add(.{ 0, 3, 0 }, .{ 1, 0, 0 }, .{ 0, 0, 1 });
    // Four texels, of which the left two are black; nothing but red.
    square.textures = &.{.{
        .levels = &.{
            .{ .width = 4, .height = 1, .texels = &.{ 0, 0, 255, 255 } },
            .{ .width = 2, .height = 1, .texels = &.{ 0, 255 } },
            .{ .width = 1, .height = 1, .texels = &.{188} },
        },
        .channel_count = 1,
        .is_srgb = true,
    }};
    square.lookups = &.{.{
        .slot = .emissive,
        .texture = 0,
        .wrap = .{ .repeat, .clamp_to_edge },
        .magnify_linear = true,
        .minify_linear = true,
        .has_mips = true,
        .mip_linear = true,
        .texcoord_set = 0,
        .transform = .{ .{ 1, 0, 2 }, .{ 0, 1, 0 } },
        .channels = .{ 0, 255, 255, 255 },
    }};
    square.materials[0].lookup_count = 1;
    square.materials[0].emissive = .{ 2, 0, 0 };
    const lights = try square.lights(arena.allocator(), 2, 16);
    var flux: math.Vec3 = .{ 0, 0, 0 };
    for (lights) |*light| {
        try std.testing.expect(light.position[0] > 0.5);
        flux = vec3.add(flux, light.intensity);
    }
    try std.testing.expectApproxEqRel(@as(f32, 1), flux[0], 0.05);
}

test "lights are as many as there may be, and none where nothing emits" {
    var arena: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena.deinit();
    var squares: TestEmitters = .{};
    for (0..4) |number| {
        squares.add(.{ @floatFromInt(2 * number), 3, 0 }, .{ 1, 0, 0 }, .{ 0, 0, 1 });
    }
    squares.materials[2].emissive = .{ 0, 0, 0 };
    squares.materials[3].unlit = 1;
    for ([_]usize{ 1, 2, 3, 7, 64 }) |count| {
        const lights = try squares.lights(arena.allocator(), 2, count);
        try std.testing.expectEqual(count, lights.len);
        var flux: f64 = 0;
        for (lights) |*light| {
            flux += light.intensity[0];
            // Where there is an emitter, not between them.
            const x = light.position[0];
            try std.testing.expect(x > 0 and x < 1 or x > 2 and x < 3);
        }
        try std.testing.expectApproxEqRel(@as(f64, 4), flux, 1e-5);
    }
    for (&squares.materials) |*material| material.emissive = .{ 0, 0, 0 };
    try std.testing.expectEqual(0, (try squares.lights(arena.allocator(), 2, 16)).len);
}

test "lobes have the flux and the mean direction of what they stand for" {
    for ([_]f64{ 0, 0.3, 0.5, 0.6, 0.8, 1 }) |flatness| {
        const lobe = lobeOf(flatness);
        const step_count = 10_000;
        var flux: f64 = 0;
        var moment: f64 = 0;
        for (0..step_count) |index| {
            const cosine = (@as(f64, @floatFromInt(index)) + 0.5) * 2 / step_count - 1;
            const value = @max(0, lobe[0] * cosine + lobe[1]) * 4 * std.math.pi / step_count;
            flux += value;
            moment += value * cosine;
        }
        try std.testing.expectApproxEqRel(std.math.pi, flux, 1e-4);
        try std.testing.expectApproxEqAbs(2 * std.math.pi / 3.0 * flatness, moment, 1e-3);
    }
}

test {
    _ = emitters;
}
