//! Points and lines as triangles: a polyhedron for each point and each end of a line, a prism for
//! each line between two of them.
//!
//! In: a soup of triangles with room for more, in which the vertices of points and lines are placed
//! already, and a radius in metres, the same for all. Out: the soup with these triangles behind its
//! own. Spheres are octahedra whose faces are cut in four, once or several times, prisms have a
//! number of sides to match; both are as much larger than what they stand for that they are as
//! large seen from a random direction (Cauchy 1841: the mean silhouette of a convex body is a
//! quarter of its surface). Vertices that have a normal keep it, for points and lines are lit by
//! theirs (glTF 2.0, section 3.9.7); others have that of the sphere or the cylinder.

const std = @import("std");
const flatten = @import("flatten.zig");
const math = @import("../math.zig");
const parallel = @import("../parallel.zig");
const pose = @import("pose.zig");
const scene = @import("../scene.zig");
const world = @import("../world.zig");
const assert = std.debug.assert;
const vec3 = math.vec3;
const vec3d = math.vec3d;
const Box3 = math.Box3;
const Vec3 = math.Vec3;
const Vec3d = math.Vec3d;

/// Spheres, or prisms, a thread takes at a time.
const chunk_size = 1 << 9;

/// Where more triangles would be needed, they are coarser, as far as that goes.
const triangle_count_wanted = 1 << 21;

/// A line between two vertices of the soup.
pub const Segment = struct {
    ends: [2]u32,
    /// Index into `Materials.all`; `none` if an end has no finite place.
    material: u32,
};

/// What there is to draw.
pub const Strokes = struct {
    /// Of points and of lines' ends, each vertex once, those without a place too.
    spheres: []const world.Sphere = &.{},
    segments: []const Segment = &.{},
    detail: Detail = .{ .level = 0 },
};

/// How many strokes a mesh or a scene has.
pub const Count = struct {
    spheres: u64 = 0,
    segments: u64 = 0,

    /// Of a mesh, of whose vertices `used` is true for those that are points or ends.
    pub fn of(mesh: *const scene.Mesh, used: *const std.DynamicBitSetUnmanaged) Count {
        return .{ .spheres = used.count(), .segments = mesh.segments.len };
    }

    /// Adds those of another.
    pub fn add(count: *Count, other: Count) void {
        count.spheres += other.spheres;
        count.segments += other.segments;
    }
};

/// Sets the bits of the vertices, from `first` on, that are points or ends.
pub fn mark(used: *std.DynamicBitSetUnmanaged, mesh: *const scene.Mesh, first: u32) void {
    for (mesh.points) |vertex| used.set(vertex - first);
    for (mesh.segments) |ends| for (ends) |vertex| used.set(vertex - first);
}

/// How finely spheres and cylinders are cut.
pub const Detail = struct {
    /// How often the octahedron's faces are cut in four.
    level: u2,

    const sides_by_level = [4]u32{ 4, 6, 10, 16 };
    const vertex_count_max = 4 * 64 + 2;
    const triangle_count_max = 8 * 64;

    /// As suits a diameter in pixels, or as many strokes as there are.
    pub fn of(count: Count, diameter_pixels: f32) Detail {
        var detail: Detail = .{
            .level = if (diameter_pixels <= 2) 1 else if (diameter_pixels <= 8) 2 else 3,
        };
        while (detail.level > 0 and detail.triangleCount(count) > triangle_count_wanted) {
            detail.level -= 1;
        }
        return detail;
    }

    fn sides(detail: Detail) u32 {
        return sides_by_level[detail.level];
    }

    fn sphereVertices(detail: Detail) u32 {
        return (@as(u32, 4) << (2 * @as(u5, detail.level))) + 2;
    }

    fn sphereTriangles(detail: Detail) u32 {
        return @as(u32, 8) << (2 * @as(u5, detail.level));
    }

    /// Vertices of all strokes together.
    pub fn vertexCount(detail: Detail, count: Count) u64 {
        return count.spheres * detail.sphereVertices() + count.segments * 2 * detail.sides();
    }

    /// Triangles of all strokes together.
    pub fn triangleCount(detail: Detail, count: Count) u64 {
        return count.spheres * detail.sphereTriangles() + count.segments * 2 * detail.sides();
    }
};

/// An octahedron whose faces have been cut, its vertices on the unit sphere.
const Polyhedron = struct {
    vertices: [Detail.vertex_count_max]Vec3d,
    vertex_count: u32,
    /// Counter-clockwise seen from outside.
    triangles: [Detail.triangle_count_max][3]u32,
    triangle_count: u32,

    fn init(detail: Detail) Polyhedron {
        var solid: Polyhedron = .{
            .vertices = undefined,
            .vertex_count = 6,
            .triangles = undefined,
            .triangle_count = 8,
        };
        for (0..6) |index| {
            solid.vertices[index] = .{ 0, 0, 0 };
            solid.vertices[index][index / 2] = if (index % 2 == 0) 1 else -1;
        }
        for (solid.triangles[0..8], 0..) |*triangle, octant| {
            const x: u32 = @intCast(octant & 1);
            const y: u32 = @intCast(2 + (octant >> 1 & 1));
            const z: u32 = @intCast(4 + (octant >> 2 & 1));
            triangle.* = if (@popCount(octant) % 2 == 0) .{ x, y, z } else .{ x, z, y };
        }
        for (0..detail.level) |_| solid.cut();
        assert(solid.vertex_count == detail.sphereVertices());
        assert(solid.triangle_count == detail.sphereTriangles());
        return solid;
    }

    /// Cuts each face at the middles of its edges, which go to the sphere.
    fn cut(solid: *Polyhedron) void {
        const count = solid.triangle_count;
        for (0..count) |index| {
            const a, const b, const c = solid.triangles[index];
            const ab = solid.middle(a, b);
            const bc = solid.middle(b, c);
            const ca = solid.middle(c, a);
            solid.triangles[index] = .{ ab, bc, ca };
            for ([_][3]u32{ .{ a, ab, ca }, .{ b, bc, ab }, .{ c, ca, bc } }) |corner| {
                solid.triangles[solid.triangle_count] = corner;
                solid.triangle_count += 1;
            }
        }
    }

    fn middle(solid: *Polyhedron, a: u32, b: u32) u32 {
        const between = vec3d.add(solid.vertices[a], solid.vertices[b]);
        const place = vec3d.normalize(between).?;
        for (solid.vertices[0..solid.vertex_count], 0..) |known, index| {
            if (std.meta.eql(known, place)) return @intCast(index);
        }
        solid.vertices[solid.vertex_count] = place;
        solid.vertex_count += 1;
        return solid.vertex_count - 1;
    }

    /// Radius of the polyhedron that is seen as large as the unit sphere on average.
    fn radius(solid: *const Polyhedron) f64 {
        var surface: f64 = 0;
        for (solid.triangles[0..solid.triangle_count]) |triangle| {
            const a = solid.vertices[triangle[0]];
            const across = vec3d.cross(
                vec3d.sub(solid.vertices[triangle[1]], a),
                vec3d.sub(solid.vertices[triangle[2]], a),
            );
            surface += vec3d.length(across) / 2;
        }
        return @sqrt(4 * std.math.pi / surface);
    }
};

/// A regular polygon, counter-clockwise.
const Ring = struct {
    /// Cosine and sine of each corner's direction.
    directions: [16][2]f64,
    side_count: u32,

    fn init(detail: Detail) Ring {
        var ring: Ring = .{ .directions = undefined, .side_count = detail.sides() };
        for (ring.directions[0..ring.side_count], 0..) |*direction, index| {
            const turn = @as(f64, @floatFromInt(index)) / @as(f64, @floatFromInt(ring.side_count));
            direction[0] = math.elementary.cos(2 * std.math.pi * turn);
            direction[1] = math.elementary.sin(2 * std.math.pi * turn);
        }
        return ring;
    }

    /// Radius of the polygon that is seen as wide as the unit circle on average: of as long a
    /// border.
    fn radius(ring: *const Ring) f64 {
        const count: f64 = @floatFromInt(ring.side_count);
        return std.math.pi / (count * math.elementary.sin(std.math.pi / count));
    }
};

/// What a chunk of strokes came to.
const ChunkResult = struct {
    /// Where the next triangle goes.
    next: u32,
    dropped_count: u32 = 0,
    bounds: Box3 = .empty,
    centroid_bounds: Box3 = .empty,

    /// Puts a triangle behind those that the chunk has, as dropped if it has no area or no place.
    fn add(result: *ChunkResult, soup: *flatten.TriangleSoup, triangle: world.Triangle) void {
        const to = &soup.room.triangles[result.next];
        result.next += 1;
        to.* = triangle;
        const a = soup.positions[triangle.corner[0]];
        const b = soup.positions[triangle.corner[1]];
        const c = soup.positions[triangle.corner[2]];
        const is_placed = !triangle.isDropped() and flatten.isWithinRange(a, b, c);
        if (!is_placed or !flatten.hasArea(a, b, c)) {
            to.material = world.none;
            result.dropped_count += 1;
            return;
        }
        const box = Box3.empty.include(a).include(b).include(c);
        result.bounds = result.bounds.join(box);
        result.centroid_bounds = result.centroid_bounds.include(box.centerTwice());
    }
};

/// Shared by the threads.
const Work = struct {
    soup: *flatten.TriangleSoup,
    polyhedron: Polyhedron,
    ring: Ring,
    sphere_radius: f64,
    ring_radius: f64,
    sphere_chunk_count: usize,
    chunks: []ChunkResult,

    fn run(work: *Work, chunk: usize, _: usize) void {
        const strokes = &work.soup.strokes;
        if (chunk < work.sphere_chunk_count) {
            const begin = chunk * chunk_size;
            const end = @min(begin + chunk_size, strokes.spheres.len);
            const result = work.openChunk(chunk, begin * work.polyhedron.triangle_count);
            for (begin..end) |index| work.placeSphere(index, result);
        } else {
            const begin = (chunk - work.sphere_chunk_count) * chunk_size;
            const end = @min(begin + chunk_size, strokes.segments.len);
            const before = strokes.spheres.len * work.polyhedron.triangle_count;
            const result = work.openChunk(chunk, before + begin * 2 * work.ring.side_count);
            for (begin..end) |index| work.placePrism(index, result);
        }
    }

    fn openChunk(work: *Work, chunk: usize, triangles_before: usize) *ChunkResult {
        const result = &work.chunks[chunk];
        result.* = .{ .next = @intCast(work.soup.surface_count + triangles_before) };
        return result;
    }

    fn placeSphere(work: *Work, index: usize, result: *ChunkResult) void {
        const soup = work.soup;
        const solid = &work.polyhedron;
        const sphere = soup.strokes.spheres[index];
        const first: u32 = @intCast(soup.room.vertex_first + index * solid.vertex_count);
        for (solid.vertices[0..solid.vertex_count], first..) |direction, vertex| {
            work.placeVertex(sphere.center, direction, work.sphere_radius, vertex);
        }
        for (solid.triangles[0..solid.triangle_count]) |triangle| {
            var corner = triangle;
            for (&corner) |*vertex| vertex.* += first;
            result.add(soup, .{ .corner = corner, .material = sphere.material });
        }
    }

    /// Ends that are the same place have nothing between them.
    fn placePrism(work: *Work, index: usize, result: *ChunkResult) void {
        const soup = work.soup;
        const segment = soup.strokes.segments[index];
        const side_count = work.ring.side_count;
        const before = soup.strokes.spheres.len * work.polyhedron.vertex_count;
        const first: u32 = @intCast(soup.room.vertex_first + before + index * 2 * side_count);
        const from = pose.widen(soup.positions[segment.ends[0]]);
        const to = pose.widen(soup.positions[segment.ends[1]]);
        const axis = vec3d.normalize(vec3d.sub(to, from)) orelse Vec3d{ 0, 0, 0 };
        const aside = vec3d.normalize(vec3d.cross(axis, leastAxis(axis))) orelse axis;
        const above = vec3d.cross(axis, aside);
        for (work.ring.directions[0..side_count], 0..) |turn, side| {
            const direction = vec3d.add(vec3d.scale(aside, turn[0]), vec3d.scale(above, turn[1]));
            for (segment.ends, 0..) |end, side_of| {
                const vertex = first + side_of * side_count + side;
                work.placeVertex(end, direction, work.ring_radius, vertex);
            }
        }
        for (0..side_count) |side| {
            const a: u32 = first + @as(u32, @intCast(side));
            const b: u32 = first + @as(u32, @intCast((side + 1) % side_count));
            for ([_][3]u32{
                .{ a, b, b + side_count },
                .{ a, b + side_count, a + side_count },
            }) |corner| result.add(soup, .{ .corner = corner, .material = segment.material });
        }
    }

    /// Places a vertex beside that of a point or an end, as which it is in all else.
    fn placeVertex(work: *Work, center: u32, direction: Vec3d, radius: f64, vertex: usize) void {
        const soup = work.soup;
        const middle = pose.widen(soup.positions[center]);
        soup.positions[vertex] = pose.round(vec3d.add(middle, vec3d.scale(direction, radius)));
        const own = soup.normals[center];
        const has_own = own[0] != 0 or own[1] != 0 or own[2] != 0;
        soup.normals[vertex] = if (has_own) own else pose.round(direction);
        if (soup.colors.len > 0) soup.colors[vertex] = soup.colors[center];
        if (soup.tangents.len > 0) soup.tangents[vertex] = soup.tangents[center];
        for (soup.texcoords) |set| {
            if (set.len > 0) set[vertex] = set[center];
        }
    }

    fn finish(work: *Work) void {
        const soup = work.soup;
        for (work.chunks) |chunk| {
            soup.dropped_stroke_count += chunk.dropped_count;
            soup.bounds = soup.bounds.join(chunk.bounds);
            soup.centroid_bounds = soup.centroid_bounds.join(chunk.centroid_bounds);
        }
        soup.triangles = soup.room.triangles;
    }
};

/// The axis that a direction goes least along.
fn leastAxis(direction: Vec3d) Vec3d {
    var least: usize = 0;
    for (direction, 0..) |component, index| {
        if (@abs(component) < @abs(direction[least])) least = index;
    }
    var axis: Vec3d = .{ 0, 0, 0 };
    axis[least] = 1;
    return axis;
}

/// Draws the strokes of a soup with this radius, in metres. Memory from `gpa` is returned.
pub fn draw(
    gpa: std.mem.Allocator,
    soup: *flatten.TriangleSoup,
    radius: f64,
    pool: *parallel.Pool,
) flatten.Error!void {
    const strokes = &soup.strokes;
    var work: Work = .{
        .soup = soup,
        .polyhedron = .init(strokes.detail),
        .ring = .init(strokes.detail),
        .sphere_radius = undefined,
        .ring_radius = undefined,
        .sphere_chunk_count = @divCeil(strokes.spheres.len, chunk_size),
        .chunks = undefined,
    };
    work.sphere_radius = radius * work.polyhedron.radius();
    work.ring_radius = radius * work.ring.radius();
    const segment_chunk_count = @divCeil(strokes.segments.len, chunk_size);
    work.chunks = try gpa.alloc(ChunkResult, work.sphere_chunk_count + segment_chunk_count);
    defer gpa.free(work.chunks);
    try pool.forEach(work.chunks.len, &work, Work.run);
    work.finish();
    soup.sphere_radius = @floatCast(radius);
}

test "polyhedra are closed, face outwards and are as large as the sphere" {
    for (0..4) |level| {
        const solid: Polyhedron = .init(.{ .level = @intCast(level) });
        var volume: f64 = 0;
        for (solid.triangles[0..solid.triangle_count]) |triangle| {
            const a, const b, const c = .{
                solid.vertices[triangle[0]], solid.vertices[triangle[1]],
                solid.vertices[triangle[2]],
            };
            const part = vec3d.dot(a, vec3d.cross(b, c)) / 6;
            try std.testing.expect(part > 0);
            volume += part;
        }
        const radius = solid.radius();
        const expected = [4]f64{ 4.0 / 3.0, 2.94281, 3.81712, 4.08607 };
        errdefer std.debug.print("level {d}: {d}\n", .{ level, volume });
        try std.testing.expectApproxEqRel(expected[level], volume, 0.02);
        // The surface of the unit sphere, of an octahedron of edges sqrt(2) times the radius.
        if (level == 0) {
            const surface = 4 * @sqrt(3.0) * radius * radius;
            try std.testing.expectApproxEqRel(4 * std.math.pi, surface, 1e-12);
        }
        try std.testing.expect(radius > 1 and radius < 1.35);
    }
}

test "detail falls with the number of strokes, and grows with their size" {
    const few: Count = .{ .spheres = 10, .segments = 10 };
    try std.testing.expectEqual(1, Detail.of(few, 1.5).level);
    try std.testing.expectEqual(2, Detail.of(few, 4).level);
    try std.testing.expectEqual(3, Detail.of(few, 40).level);
    const many: Count = .{ .spheres = 1 << 20 };
    try std.testing.expectEqual(0, Detail.of(many, 40).level);
    try std.testing.expectEqual(8 << 20, Detail.of(many, 1.5).triangleCount(many));
    try std.testing.expectEqual(6 << 20, Detail.of(many, 1.5).vertexCount(many));
    try std.testing.expectEqual(258 * 10 + 32 * 10, Detail.of(few, 40).vertexCount(few));
}
