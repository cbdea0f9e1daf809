//! Parts of buildings for the procedural scenes: arches, vaults, walls of blocks, mouldings.
//!
//! Each part is added in the space of `MeshBuilder.place`: x to the right along a wall, y up, z out
//! of the wall towards the room that it is seen from. Lengths are metres.

const std = @import("std");
const geometry = @import("geometry.zig");
const MeshBuilder = @import("mesh_builder.zig");
const Point = geometry.Point;
const Allocator = std.mem.Allocator;
const assert = std.debug.assert;

/// Most segments in half an arch.
pub const half_segment_max = 16;

/// The line of an arch over a span, its springing points at y = 0: two arcs that meet above x = 0.
pub const Arch = struct {
    /// Half the clear width, at the intrados.
    half_span: f64,
    /// How far the centres of the arcs lie beyond the middle: 0 a round arch, `half_span` an
    /// equilateral pointed one.
    offset: f64 = 0,
    /// Straight pieces in half the arch: a power of two up to `half_segment_max`.
    half_segments: usize,

    /// Points on the curve that runs `distance` outside the intrados, from left to right; their
    /// number is `pointCount`.
    pub fn curve(arch: Arch, distance: f64, points: []Point) void {
        const half = arch.half_segments;
        assert(points.len == arch.pointCount());
        assert(half <= half_segment_max and std.math.isPowerOfTwo(half));
        const radius = arch.half_span + arch.offset + distance;
        assert(radius > arch.offset and arch.half_span > 0);
        // Directions of the right arc from its springing to the crown, halving angles.
        var directions: [half_segment_max + 1][2]f64 = undefined;
        const crown_cos = arch.offset / radius;
        directions[0] = .{ 1, 0 };
        directions[half] = .{ crown_cos, @sqrt(1 - crown_cos * crown_cos) };
        var step = half;
        while (step > 1) : (step /= 2) {
            var at: usize = 0;
            while (at < half) : (at += step) {
                const x = directions[at][0] + directions[at + step][0];
                const y = directions[at][1] + directions[at + step][1];
                const length = @sqrt(x * x + y * y);
                directions[at + step / 2] = .{ x / length, y / length };
            }
        }
        for (0..half + 1) |index| {
            const x = directions[index][0] * radius - arch.offset;
            const y = directions[index][1] * radius;
            points[index] = .{ -x, y, 0 };
            points[2 * half - index] = .{ x, y, 0 };
        }
        points[half][0] = 0;
    }

    /// Number of points on a curve of the arch.
    pub fn pointCount(arch: Arch) usize {
        return 2 * arch.half_segments + 1;
    }

    /// Height of the crown of the curve `distance` outside the intrados.
    pub fn crown(arch: Arch, distance: f64) f64 {
        const radius = arch.half_span + arch.offset + distance;
        return @sqrt(radius * radius - arch.offset * arch.offset);
    }
};

/// The surface between two sides of an arch or of a whole opening.
pub const Band = struct {
    arch: Arch,
    /// Distance from the intrados and z, from the back over the intrados (which is seen from
    /// below) to the front.
    section: []const [2]f64,
    /// Length of the straight legs below the springing line, 0 for none.
    leg: f64 = 0,
};

/// Adds the swept surface of an arch and its legs.
pub fn archBand(builder: *MeshBuilder, band: Band) Allocator.Error!void {
    const legs: usize = if (band.leg > 0) 1 else 0;
    const count = band.arch.pointCount();
    const columns = count + 2 * legs;
    const points = try builder.patchPoints(band.section.len, columns);
    for (band.section, 0..) |section_point, row| {
        const row_points = points[row * columns ..][0..columns];
        band.arch.curve(section_point[0], row_points[legs..][0..count]);
        if (legs == 1) {
            row_points[0] = row_points[1] - Point{ 0, band.leg, 0 };
            row_points[columns - 1] = row_points[columns - 2] - Point{ 0, band.leg, 0 };
        }
        for (row_points) |*point| point[2] = section_point[1];
    }
    try builder.patch(.{ .points = points, .columns = columns });
}

/// A moulded bar below the arch of a vault's barrel.
pub const Rib = struct {
    /// The line of the barrel before it is stretched.
    arch: Arch,
    half_across: f64,
    /// Height of the crown.
    rise: f64,
    /// Height above the line and z, from the back over the underside to the front.
    section: []const [2]f64,
    /// The left half ends at the crown.
    part: enum { whole, left } = .whole,
};

/// Adds a rib; y = 0 is where the vault springs.
pub fn addRib(builder: *MeshBuilder, rib: Rib) Allocator.Error!void {
    var buffer: [2 * half_segment_max + 1]Point = undefined;
    const line = buffer[0..rib.arch.pointCount()];
    stretchedLine(rib.arch, rib.half_across, rib.rise, line);
    const columns = switch (rib.part) {
        .whole => line.len,
        .left => rib.arch.half_segments + 1,
    };
    const points = try builder.patchPoints(rib.section.len, columns);
    for (rib.section, 0..) |section_point, row| {
        for (0..columns) |column| {
            const outward = barrelNormal(line, column);
            const offset = geometry.scale(outward, -section_point[0]);
            points[row * columns + column] =
                line[column] + offset + Point{ 0, 0, section_point[1] };
        }
    }
    try builder.patch(.{ .points = points, .columns = columns });
}

fn stretchedLine(arch: Arch, half_across: f64, rise: f64, line: []Point) void {
    arch.curve(0, line);
    const y_scale = rise / arch.crown(0);
    for (line) |*point| {
        const x = point[0] / arch.half_span * half_across;
        const y = point[1] * y_scale;
        point.* = .{ x, y, 0 };
    }
}

/// A wall above an arch.
pub const Spandrel = struct {
    arch: Arch,
    /// From the intrados to where the wall begins.
    distance: f64,
    /// Half the width of the wall.
    half_width: f64,
    top: f64,
    /// Behind 0 it is seen from behind.
    z: f64,
};

/// Adds the flat wall between an arch, the springing line, and a horizontal line above.
pub fn spandrel(builder: *MeshBuilder, wall: Spandrel) Allocator.Error!void {
    const count = wall.arch.pointCount();
    const columns = count + 2;
    assert(wall.half_width >= wall.arch.half_span + wall.distance - 1e-9);
    assert(wall.top > wall.arch.crown(wall.distance));
    var lower: [2 * half_segment_max + 3]Point = undefined;
    wall.arch.curve(wall.distance, lower[1 .. 1 + count]);
    lower[0] = .{ -wall.half_width, 0, 0 };
    lower[columns - 1] = .{ wall.half_width, 0, 0 };
    const points = try builder.patchPoints(2, columns);
    for (lower[0..columns], 0..) |point, column| {
        const at = if (wall.z < 0) columns - 1 - column else column;
        points[at] = .{ point[0], point[1], wall.z };
        points[columns + at] = .{ point[0], wall.top, wall.z };
    }
    try builder.patch(.{ .points = points, .columns = columns, .crease_cos = null });
}

/// A wall with an arched opening; y = 0 is where the arch springs.
pub const PiercedWall = struct {
    arch: Arch,
    /// From the intrados to where the wall begins.
    distance: f64,
    half_width: f64,
    bottom: f64,
    sill: f64,
    top: f64,
    z: f64,
};

/// Adds the front of a wall round a window.
pub fn piercedWall(builder: *MeshBuilder, wall: PiercedWall) Allocator.Error!void {
    assert(wall.bottom < wall.sill and wall.sill < 0);
    try spandrel(builder, .{
        .arch = wall.arch,
        .distance = wall.distance,
        .half_width = wall.half_width,
        .top = wall.top,
        .z = wall.z,
    });
    const opening = wall.arch.half_span + wall.distance;
    try rectangle(builder, .{ -wall.half_width, wall.sill }, .{ -opening, 0 }, wall.z);
    try rectangle(builder, .{ opening, wall.sill }, .{ wall.half_width, 0 }, wall.z);
    // In three parts, so that all edges meet at their ends.
    const xs = [_]f64{ -wall.half_width, -opening, opening, wall.half_width };
    for (xs[0..3], xs[1..]) |left, right| {
        try rectangle(builder, .{ left, wall.bottom }, .{ right, wall.sill }, wall.z);
    }
}

/// Adds an upright rectangle, seen from +z.
pub fn rectangle(builder: *MeshBuilder, lower: [2]f64, upper: [2]f64, z: f64) Allocator.Error!void {
    assert(lower[0] < upper[0] and lower[1] < upper[1]);
    try builder.quad(
        .{ lower[0], lower[1], z },
        .{ upper[0], lower[1], z },
        .{ upper[0], upper[1], z },
        .{ lower[0], upper[1], z },
    );
}

/// Adds a square slab of a floor, from its corner at the least x and z.
pub fn slab(builder: *MeshBuilder, corner: Point, size: f64) Allocator.Error!void {
    const x, const y, const z = .{ corner[0], corner[1], corner[2] };
    try builder.quad(
        .{ x, y, z + size },
        .{ x + size, y, z + size },
        .{ x + size, y, z },
        .{ x, y, z },
    );
}

/// A groin vault over a rectangle: the crossing of two barrels whose lines are those of `arch`,
/// stretched to the two spans and brought to the height `rise`.
pub const Vault = struct {
    arch: Arch,
    half_x: f64,
    half_z: f64,
    rise: f64,
};

/// Adds the underside of a vault. Each of its four webs ends in a whole arch.
pub fn groinVault(builder: *MeshBuilder, vault: Vault) Allocator.Error!void {
    const place = builder.place;
    defer builder.place = place;
    for (0..4) |web| {
        builder.place = place.turned(@intCast(web));
        var turned = vault;
        if (web % 2 == 1) std.mem.swap(f64, &turned.half_x, &turned.half_z);
        try vaultWeb(builder, turned);
    }
}

/// The web at -z: part of a barrel along z, between the two groins that meet above the middle.
fn vaultWeb(builder: *MeshBuilder, vault: Vault) Allocator.Error!void {
    const arch = vault.arch;
    const count = arch.pointCount();
    const half = arch.half_segments;
    var buffer: [2 * half_segment_max + 1]Point = undefined;
    const line = buffer[0..count];
    stretchedLine(arch, vault.half_x, vault.rise, line);
    for (line) |*point| point[2] = -@abs(point[0]) / vault.half_x * vault.half_z;
    // Row r holds the points of the barrel's line from r to count - 1 - r at the z of point r.
    var vertices: [2][2 * half_segment_max + 1]u32 = undefined;
    for (0..half + 1) |row| {
        const lower = &vertices[(row + 1) % 2];
        const upper = &vertices[row % 2];
        for (row..count - row) |column| {
            const position: Point = .{ line[column][0], line[column][1], line[row][2] };
            upper[column] = try builder.vertex(position, barrelNormal(line, column));
        }
        if (row == 0) continue;
        try builder.triangle(lower[row - 1], lower[row], upper[row]);
        for (row..count - row - 1) |column| {
            try builder.triangle(lower[column], lower[column + 1], upper[column + 1]);
            try builder.triangle(lower[column], upper[column + 1], upper[column]);
        }
        try builder.triangle(lower[count - row - 1], lower[count - row], upper[count - row - 1]);
    }
}

/// Normal of a barrel along z, seen from below, at a point of its line. The crown of a pointed
/// arch gets the mean of both sides.
fn barrelNormal(line: []const Point, index: usize) Point {
    const before = line[index -| 1];
    const after = line[if (index + 1 < line.len) index + 1 else index];
    const along = after - before;
    return geometry.normalize(.{ along[1], -along[0], 0 });
}

/// An outline under construction: of a solid of revolution, a prism or a moulding, from below
/// upwards.
pub const Outline = struct {
    buffer: [64][2]f64 = undefined,
    count: usize = 0,

    /// An outline that begins at a point.
    pub fn from(first: [2]f64) Outline {
        var outline: Outline = .{};
        outline.add(first);
        return outline;
    }

    /// Goes straight from each of the corners to the next.
    pub fn line(outline: *Outline, corners: []const [2]f64) void {
        for (corners) |corner| outline.add(corner);
    }

    /// Goes to `end` on a quadratic Bezier curve, in `segments` straight pieces.
    pub fn curve(outline: *Outline, control: [2]f64, end: [2]f64, segments: usize) void {
        assert(segments >= 2 and outline.count > 0);
        const start = outline.buffer[outline.count - 1];
        for (1..segments + 1) |segment| {
            const t = @as(f64, @floatFromInt(segment)) / @as(f64, @floatFromInt(segments));
            var point: [2]f64 = undefined;
            for (&point, start, control, end) |*value, a, b, c| {
                value.* = (1 - t) * (1 - t) * a + 2 * t * (1 - t) * b + t * t * c;
            }
            outline.add(if (segment == segments) end else point);
        }
    }

    /// Goes up by `height` on a half round that stands out by `bulge` (negative: a hollow), in
    /// `2 half_segments` straight pieces.
    pub fn torus(outline: *Outline, bulge: f64, height: f64, half_segments: usize) void {
        const x, const y = outline.buffer[outline.count - 1];
        const middle: [2]f64 = .{ x + bulge, y + height / 2 };
        outline.curve(.{ x + bulge, y }, middle, half_segments);
        outline.curve(.{ x + bulge, y + height }, .{ x, y + height }, half_segments);
    }

    /// The points so far.
    pub fn points(outline: *const Outline) []const [2]f64 {
        return outline.buffer[0..outline.count];
    }

    fn add(outline: *Outline, point: [2]f64) void {
        outline.buffer[outline.count] = point;
        outline.count += 1;
    }
};

/// A rectangle of blocks in running bond.
pub const Blocks = struct {
    lower: [2]f64,
    upper: [2]f64,
    z: f64 = 0,
    block_width: f64,
    course_height: f64,
    /// By how much a block may be darker than the brightest, 0..1.
    variation: f32,
    seed: u32,
};

/// Adds a flat wall of blocks with slightly different tints, seen from +z. Corners of blocks lie on
/// edges of others, where rays may slip through; a plain wall a little behind stops them.
pub fn blocks(builder: *MeshBuilder, wall: Blocks) Allocator.Error!void {
    assert(wall.upper[0] > wall.lower[0] and wall.upper[1] > wall.lower[1]);
    const tint = builder.tint;
    defer builder.tint = tint;
    try rectangle(builder, wall.lower, wall.upper, wall.z - 0.01);
    const courses: usize = whole((wall.upper[1] - wall.lower[1]) / wall.course_height);
    const columns: usize = whole((wall.upper[0] - wall.lower[0]) / wall.block_width);
    for (0..courses) |course| {
        const y0 = between(wall.lower[1], wall.upper[1], course, courses);
        const y1 = between(wall.lower[1], wall.upper[1], course + 1, courses);
        // Every other course begins and ends with half a block.
        const shift = course % 2;
        for (0..columns + shift) |column| {
            const left = (2 * column) -| shift;
            const right = @min(2 * column + 2 - shift, 2 * columns);
            const x0 = between(wall.lower[0], wall.upper[0], left, 2 * columns);
            const x1 = between(wall.lower[0], wall.upper[0], right, 2 * columns);
            const number: u32 = @intCast(course * 1009 + column);
            const shade = 1 - wall.variation * scatter(wall.seed +% number *% 31);
            for (&builder.tint, tint) |*value, base| value.* = base * shade;
            try rectangle(builder, .{ x0, y0 }, .{ x1, y1 }, wall.z);
        }
    }
}

/// Adds a moulding round the inside of a rectangular court about the origin. The outline gives
/// how far it stands out into the court and the height, from below upwards.
pub fn courtMoulding(
    builder: *MeshBuilder,
    outline: []const [2]f64,
    half_x: f64,
    half_z: f64,
) Allocator.Error!void {
    const points = try builder.patchPoints(outline.len, 4);
    for (outline, 0..) |outline_point, row| {
        const x = half_x - outline_point[0];
        const y = outline_point[1];
        const z = half_z - outline_point[0];
        assert(x > 0 and z > 0);
        const corners = [4]Point{ .{ -x, y, -z }, .{ x, y, -z }, .{ x, y, z }, .{ -x, y, z } };
        points[4 * row ..][0..4].* = corners;
    }
    try builder.patch(.{ .points = points, .columns = 4, .closed = true });
}

/// Adds a straight moulding from x0 to x1. The outline gives z and y, from below upwards.
pub fn moulding(
    builder: *MeshBuilder,
    outline: []const [2]f64,
    x0: f64,
    x1: f64,
) Allocator.Error!void {
    assert(x0 < x1);
    const points = try builder.patchPoints(outline.len, 2);
    for (outline, 0..) |outline_point, row| {
        points[2 * row] = .{ x0, outline_point[1], outline_point[0] };
        points[2 * row + 1] = .{ x1, outline_point[1], outline_point[0] };
    }
    try builder.patch(.{ .points = points, .columns = 2 });
}

/// A number in 0..1 that looks random but belongs to `index` (a 32-bit finaliser: multiplications
/// and shifts that let every bit of the input reach the result).
pub fn scatter(index: u32) f32 {
    var bits = index +% 0x9e37_79b9;
    bits = (bits ^ (bits >> 16)) *% 0x85eb_ca6b;
    bits = (bits ^ (bits >> 13)) *% 0xc2b2_ae35;
    bits ^= bits >> 16;
    return @as(f32, @floatFromInt(bits >> 8)) / 16_777_216.0;
}

fn between(from: f64, to: f64, part: usize, parts: usize) f64 {
    if (part == parts) return to;
    return from + (to - from) * (@as(f64, @floatFromInt(part)) / @as(f64, @floatFromInt(parts)));
}

fn whole(value: f64) usize {
    const rounded: usize = @intFromFloat(@floor(value + 0.5));
    return if (rounded == 0) 1 else rounded;
}

test "arches reach their crown and lie on their circles" {
    var points: [17]Point = undefined;
    for ([_]f64{ 0, 0.4, 1 }) |offset| {
        const arch: Arch = .{ .half_span = 1, .offset = offset, .half_segments = 8 };
        arch.curve(0.25, &points);
        try std.testing.expectApproxEqAbs(@as(f64, -1.25), points[0][0], 1e-12);
        try std.testing.expectEqual(0, points[8][0]);
        try std.testing.expectApproxEqAbs(arch.crown(0.25), points[8][1], 1e-12);
        for (points[9..]) |point| {
            const radius = geometry.length(point + Point{ offset, 0, 0 });
            try std.testing.expectApproxEqAbs(1.25 + offset, radius, 1e-12);
        }
    }
}

test "a vault is seen from below, and its webs meet" {
    var arena: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena.deinit();
    var builder: MeshBuilder = .init(arena.allocator());
    try groinVault(&builder, .{
        .arch = .{ .half_span = 1, .half_segments = 4 },
        .half_x = 2,
        .half_z = 1,
        .rise = 1,
    });
    try std.testing.expectEqual(4 * 2 * 16, builder.triangles.items.len);
    for (builder.positions.items, builder.normals.items) |position, normal| {
        try std.testing.expect(normal[1] < 1e-6);
        try std.testing.expect(position[1] >= -1e-6 and position[1] <= 1 + 1e-6);
    }
    try std.testing.expectApproxEqRel(@as(f32, 4 * 2), try areaAlong(&builder, 1, -1), 1e-5);
}

/// Area of the triangles seen along an axis; none may be seen from behind.
fn areaAlong(builder: *const MeshBuilder, axis: usize, sign: f32) !f32 {
    const vec3 = @import("../math.zig").vec3;
    const p = builder.positions.items;
    var area: f32 = 0;
    for (builder.triangles.items) |t| {
        const normal = vec3.cross(vec3.sub(p[t[1]], p[t[0]]), vec3.sub(p[t[2]], p[t[0]]));
        try std.testing.expect(sign * normal[axis] > -1e-6);
        area += sign * normal[axis] / 2;
    }
    return area;
}

test "blocks fill their rectangle" {
    var arena: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena.deinit();
    var builder: MeshBuilder = .init(arena.allocator());
    try blocks(&builder, .{
        .lower = .{ 0, 0 },
        .upper = .{ 3, 2 },
        .block_width = 1,
        .course_height = 1,
        .variation = 0.5,
        .seed = 1,
    });
    try std.testing.expectEqual(2 * (1 + 3 + 4), builder.triangles.items.len);
    try std.testing.expectApproxEqRel(@as(f32, 2 * 6), try areaAlong(&builder, 2, 1), 1e-5);
}

test "outlines pass through their points" {
    var outline: Outline = .from(.{ 1, 0 });
    outline.line(&.{.{ 2, 0 }});
    outline.torus(0.5, 1, 2);
    outline.curve(.{ 1, 1 }, .{ 0, 3 }, 4);
    const points = outline.points();
    try std.testing.expectEqual(2 + 4 + 4, points.len);
    try std.testing.expectEqual([2]f64{ 2.5, 0.5 }, points[3]);
    try std.testing.expectEqual([2]f64{ 2, 1 }, points[5]);
    try std.testing.expectEqual([2]f64{ 0, 3 }, points[9]);
}

test "scatter spreads over 0..1" {
    var sum: f32 = 0;
    for (0..1000) |index| {
        const value = scatter(@intCast(index));
        try std.testing.expect(value >= 0 and value < 1);
        sum += value;
    }
    try std.testing.expectApproxEqAbs(@as(f32, 500), sum, 30);
}
