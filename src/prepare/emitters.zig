//! Emissive surfaces cut into pieces small enough to be lights, or to be put together to lights.
//!
//! In: triangles, materials and textures of a world. Out: where pieces of the triangles that emit
//! are, where they face, and how much light leaves each: a Lambertian emitter's, pi times area
//! times radiance, which is the emissive factor times the mean of the texture over the piece.
//! Triangles that emit much are cut evenly. What is double-sided shines to both sides, unless its
//! triangles, of one material in a row, face all ways alike: then it is taken for closed, and
//! what shines into it does not come out.

const std = @import("std");
const math = @import("../math.zig");
const world = @import("../world.zig");
const srgb = math.srgb;
const vec3d = math.vec3d;
const Allocator = std.mem.Allocator;
const Vec3 = math.Vec3;
const Vec3d = math.Vec3d;

/// A small flat emitter.
pub const Piece = struct {
    position: Vec3,
    /// Unit vector to the side that it shines to.
    normal: Vec3,
    /// Lumens by channel, linear RGB, at least 0 and not all 0.
    flux: Vec3d,
    area: f32,
    /// Distance of its farthest corner from `position`.
    radius: f32,

    /// In lumens.
    pub fn luminance(piece: *const Piece) f64 {
        return luminanceOf(piece.flux);
    }
};

/// Rec. 709.
pub fn luminanceOf(color: Vec3d) f64 {
    return 0.2126 * color[0] + 0.7152 * color[1] + 0.0722 * color[2];
}

/// No piece emits more than this part of everything.
const piece_share_max = 1.0 / 256.0;
/// Steps along an edge of a triangle that is cut, at most.
const step_count_max = 16;
/// Triangles that emit less than this part of everything are left out.
const triangle_share_min = 1e-9;
/// Length of the sum of the areas' normals over the sum of areas, below which double-sided
/// surfaces are taken for closed.
const open_share_min = 0.25;
/// Texels that a piece is as long as in the level that tells its mean.
const texel_count = 4;

/// Triangles of a material in a row, dropped ones between them.
pub const Run = struct { first: usize, end: usize, is_two_sided: bool };

/// All pieces, in the order of triangles; the caller frees them.
pub fn find(
    gpa: Allocator,
    geometry: *const world.Geometry,
    materials: *const world.Materials,
    textures: *const world.Textures,
) error{OutOfMemory}![]Piece {
    var finder: Finder = .{
        .gpa = gpa,
        .geometry = geometry,
        .materials = materials,
        .textures = textures,
    };
    defer finder.deinit();
    if (finder.glows()) {
        const total = try finder.measure();
        if (total > 0 and std.math.isFinite(total)) for (finder.runs.items) |run| {
            for (geometry.triangles[run.first..run.end]) |*triangle| {
                if (triangle.isDropped()) continue;
                try finder.addTriangle(triangle, run.is_two_sided, total);
            }
        };
    }
    return finder.pieces.toOwnedSlice(gpa);
}

/// What emits in a world.
pub const Finder = struct {
    gpa: Allocator,
    geometry: *const world.Geometry,
    materials: *const world.Materials,
    textures: *const world.Textures,
    runs: std.ArrayList(Run) = .empty,
    pieces: std.ArrayList(Piece) = .empty,

    /// Frees everything.
    pub fn deinit(finder: *Finder) void {
        finder.runs.deinit(finder.gpa);
        finder.pieces.deinit(finder.gpa);
    }

    /// Whether any material emits.
    pub fn glows(finder: *const Finder) bool {
        for (finder.materials.all) |*material| {
            if (emits(material)) return true;
        }
        return false;
    }

    fn emits(material: *const world.Material) bool {
        return material.unlit == 0 and math.vec3.maxComponent(material.emissive) > 0;
    }

    /// Finds the runs; returns what all triangles emit to one side, in lumens.
    pub fn measure(finder: *Finder) error{OutOfMemory}!f64 {
        const triangles = finder.geometry.triangles;
        var total: f64 = 0;
        var first: usize = 0;
        while (first < triangles.len) {
            if (triangles[first].isDropped()) {
                first += 1;
                continue;
            }
            const number = triangles[first].material;
            var end = first + 1;
            // Triangles of instances in between end a run, as if they were here.
            const limit = finder.geometry.shared.flatEnd(first) orelse triangles.len;
            while (end < limit) : (end += 1) {
                if (triangles[end].material != number and !triangles[end].isDropped()) break;
            }
            defer first = end;
            const material = &finder.materials.all[number];
            if (!emits(material)) continue;
            var area: f64 = 0;
            var facing: Vec3d = .{ 0, 0, 0 };
            for (triangles[first..end]) |*triangle| {
                if (triangle.isDropped()) continue;
                const doubled = facingOf(&finder.cornersOf(triangle));
                facing = vec3d.add(facing, doubled);
                area += vec3d.length(doubled);
                total += 0.5 * vec3d.length(doubled) *
                    luminanceOf(finder.emitted(triangle, &whole));
            }
            try finder.runs.append(finder.gpa, .{
                .first = first,
                .end = end,
                .is_two_sided = material.double_sided > 0 and
                    vec3d.length(facing) > open_share_min * area,
            });
        }
        return total;
    }

    /// In double precision.
    pub fn cornersOf(finder: *const Finder, triangle: *const world.Triangle) [3]Vec3d {
        var corners: [3]Vec3d = undefined;
        for (&corners, triangle.corner) |*corner, vertex| {
            const position = finder.geometry.positions[vertex];
            corner.* = .{ position[0], position[1], position[2] };
        }
        return corners;
    }

    /// Lumens for each square metre of a part of a triangle, by barycentrics of its corners.
    pub fn emitted(
        finder: *const Finder,
        triangle: *const world.Triangle,
        part: *const [3][2]f64,
    ) Vec3d {
        const material = &finder.materials.all[triangle.material];
        const is_seen_through = material.blend > 0 and !material.is_hidden_lamp;
        const opacity: f64 = if (is_seen_through) material.base_color[3] else 1;
        var result: Vec3d = undefined;
        for (&result, material.emissive) |*to, factor| to.* = std.math.pi * opacity * factor;
        const lookups =
            finder.materials.lookups[material.first_lookup..][0..material.lookup_count];
        for (lookups) |*lookup| {
            if (lookup.slot != .emissive) continue;
            const set = finder.geometry.texcoords[lookup.texcoord_set];
            var places: [3][2]f64 = undefined;
            for (&places, part) |*place, weights| {
                for (place, 0..) |*coordinate, axis| {
                    const a: f64 = set[triangle.corner[0]][axis];
                    const b: f64 = set[triangle.corner[1]][axis];
                    const c: f64 = set[triangle.corner[2]][axis];
                    coordinate.* = a + (b - a) * weights[0] + (c - a) * weights[1];
                }
            }
            const mean = meanOf(&finder.textures.all[lookup.texture], lookup, &places);
            for (&result, mean) |*to, factor| to.* *= factor;
        }
        return result;
    }

    fn addTriangle(
        finder: *Finder,
        triangle: *const world.Triangle,
        is_two_sided: bool,
        total: f64,
    ) error{OutOfMemory}!void {
        const corners = finder.cornersOf(triangle);
        const doubled = facingOf(&corners);
        const normal = vec3d.normalize(doubled) orelse return;
        const area = 0.5 * vec3d.length(doubled);
        const all = finder.emitted(triangle, &whole);
        const share = area * luminanceOf(all) / total;
        if (!(share > triangle_share_min)) return;
        var step_count: usize = 1;
        while (step_count < step_count_max) : (step_count += 1) {
            const count: f64 = @floatFromInt(step_count * step_count);
            if (share <= count * piece_share_max) break;
        }
        const count: f64 = @floatFromInt(step_count * step_count);
        for (0..step_count) |row| for (0..2 * (step_count - row) - 1) |column| {
            const part = partOf(step_count, row, column);
            var places: [3]Vec3d = undefined;
            for (&places, part) |*place, weights| place.* = placeOf(&corners, weights);
            const sum = vec3d.add(vec3d.add(places[0], places[1]), places[2]);
            const middle = vec3d.scale(sum, 1.0 / 3.0);
            var radius: f64 = 0;
            for (places) |place| radius = @max(radius, vec3d.length(vec3d.sub(place, middle)));
            const mean = if (step_count == 1) all else finder.emitted(triangle, &part);
            const flux = vec3d.scale(mean, area / count);
            if (!(luminanceOf(flux) > 0 and std.math.isFinite(luminanceOf(flux)))) continue;
            for (0..if (is_two_sided) 2 else 1) |side| try finder.pieces.append(finder.gpa, .{
                .position = vec3d.toSingle(middle),
                .normal = vec3d.toSingle(if (side == 0) normal else vec3d.neg(normal)),
                .flux = flux,
                .area = @floatCast(area / count),
                .radius = @floatCast(radius),
            });
        };
    }
};

/// Barycentrics of the second and third corner, of all corners of a whole triangle.
pub const whole = [3][2]f64{ .{ 0, 0 }, .{ 1, 0 }, .{ 0, 1 } };

/// One of the congruent parts of a triangle whose edges are cut into so many steps.
fn partOf(step_count: usize, row: usize, column: usize) [3][2]f64 {
    const step = 1 / @as(f64, @floatFromInt(step_count));
    const u = @as(f64, @floatFromInt(row)) * step;
    const v = @as(f64, @floatFromInt(column / 2)) * step;
    if (column % 2 == 0) return .{ .{ u, v }, .{ u + step, v }, .{ u, v + step } };
    return .{ .{ u + step, v + step }, .{ u, v + step }, .{ u + step, v } };
}

fn placeOf(corners: *const [3]Vec3d, weights: [2]f64) Vec3d {
    const along = vec3d.scale(vec3d.sub(corners[1], corners[0]), weights[0]);
    const across = vec3d.scale(vec3d.sub(corners[2], corners[0]), weights[1]);
    return vec3d.add(corners[0], vec3d.add(along, across));
}

/// The normal of a triangle, twice as long as its area is large.
pub fn facingOf(corners: *const [3]Vec3d) Vec3d {
    return vec3d.cross(
        vec3d.sub(corners[1], corners[0]),
        vec3d.sub(corners[2], corners[0]),
    );
}

/// Mean of a texture over a triangle in its coordinates, linear RGB: of the texels in the middle of
/// parts of it, in a level that has about as many.
fn meanOf(
    texture: *const world.Texture,
    lookup: *const world.Lookup,
    places: *const [3][2]f64,
) Vec3d {
    var corners: [3][2]f64 = undefined;
    var length: f64 = 0;
    const finest = &texture.levels[0];
    for (&corners, places) |*corner, place| for (corner, lookup.transform) |*to, row| {
        to.* = row[0] * place[0] + row[1] * place[1] + row[2];
    };
    for ([2]u32{ finest.width, finest.height }, 0..) |size, axis| {
        const least = @min(corners[0][axis], corners[1][axis], corners[2][axis]);
        const most = @max(corners[0][axis], corners[1][axis], corners[2][axis]);
        length = @max(length, (most - least) * @as(f64, @floatFromInt(size)));
    }
    var number: usize = 0;
    while (number + 1 < texture.levels.len and !(length <= texel_count)) {
        length *= 0.5;
        number += 1;
    }
    const level = &texture.levels[number];
    const step_count: usize = if (length <= 1) 1 else texel_count;
    var sum: Vec3d = .{ 0, 0, 0 };
    for (0..step_count) |row| for (0..2 * (step_count - row) - 1) |column| {
        var middle: [2]f64 = .{ 0, 0 };
        for (partOf(step_count, row, column)) |weights| for (&middle, 0..) |*to, axis| {
            const a = corners[0][axis];
            to.* += (a + (corners[1][axis] - a) * weights[0] +
                (corners[2][axis] - a) * weights[1]) / 3.0;
        };
        const x = texelAt(middle[0], level.width, lookup.wrap[0]);
        const y = texelAt(middle[1], level.height, lookup.wrap[1]);
        const texel = level.texels[(y * level.width + x) * texture.channel_count ..];
        for (&sum, lookup.channels[0..3]) |*to, channel| to.* += valueOf(texture, texel, channel);
    };
    return vec3d.scale(sum, 1 / @as(f64, @floatFromInt(step_count * step_count)));
}

fn valueOf(texture: *const world.Texture, texel: []const u8, channel: u8) f64 {
    if (channel >= texture.channel_count) return 1;
    const code = texel[channel];
    const is_color = texture.is_srgb and channel < 3;
    return if (is_color) srgb.decoded[code] else @as(f64, @floatFromInt(code)) / 255.0;
}

/// Where a coordinate is in a row of texels.
fn texelAt(coordinate: f64, size: u32, wrap: world.Wrap) usize {
    const period: f64 = if (wrap == .mirrored_repeat) 2 else 1;
    var place = coordinate;
    if (wrap != .clamp_to_edge) place -= @floor(place / period) * period;
    if (wrap == .mirrored_repeat and place > 1) place = 2 - place;
    const scaled = place * @as(f64, @floatFromInt(size));
    if (!(scaled > 0)) return 0;
    const last: f64 = @floatFromInt(size - 1);
    return @intFromFloat(@min(scaled, last));
}
