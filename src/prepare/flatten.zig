//! The triangle soup: instances of meshes become one list of triangles in world space.
//!
//! In: a scene and the world maps of its nodes and joints. Out: vertices, deformed as instances ask
//! for, and triangles in the order of the instances; those that have no area or no finite place are
//! marked as dropped, so that the number of a triangle is the same in every pose. Fronts stay
//! fronts under mirroring maps. The arrays are the same whatever the number of threads: work is cut
//! into fixed chunks that write to places known before. The vertices of points and lines are placed
//! too, and room is left for the triangles that `strokes.zig` makes of them.

const std = @import("std");
const math = @import("../math.zig");
const parallel = @import("../parallel.zig");
const scene = @import("../scene.zig");
const world = @import("../world.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const bvh_split = @import("bvh/split.zig");
const huge_pages = @import("../huge_pages.zig");
const assert = std.debug.assert;
const vec3 = math.vec3;
const deform = @import("deform.zig");
const pose_file = @import("pose.zig");
const strokes = @import("strokes.zig");
const AffineD = math.AffineD;
const Box3 = math.Box3;
const Placement = world.Placement;
const Vec3 = math.Vec3;

pub const Error = error{ OutOfMemory, SceneTooLarge } || parallel.Error;

/// A triangle whose doubled area has no component above this, in square metres, is degenerate:
/// there the cross product of its edges is made of products that flush to zero.
pub const area_twice_min: f32 = 0x1p-120;

/// Triangles, and vertices, at most: what the builder of the tree can number, and double.
pub const element_count_max = bvh_split.number_limit;

/// Vertices or triangles a thread takes at a time.
const chunk_size = 1 << 14;

const texcoord_set_count = scene.texcoord_set_count;

/// What of the vertices the materials' textures ask for.
pub const Attributes = struct {
    texcoord_sets: [texcoord_set_count]bool = @splat(false),
    tangents: bool = false,
};

/// All that there is to hit, in world space.
pub const TriangleSoup = struct {
    positions: []Vec3,
    normals: []Vec3,
    colors: [][4]f32,
    texcoords: [texcoord_set_count][][2]f32,
    tangents: [][4]f32,
    triangles: []const world.Triangle,
    /// How many of the triangles are not of points and lines.
    surface_count: u32,
    /// Of these, and of the others, how many are dropped.
    dropped_count: u32,
    dropped_stroke_count: u32 = 0,
    strokes: strokes.Strokes,
    /// In metres, once the strokes are drawn.
    sphere_radius: f32,
    room: Room,
    /// Box of the corners of what is not dropped, empty without any.
    bounds: Box3,
    /// Box of twice the centroids of its triangles' boxes, empty without any.
    centroid_bounds: Box3,
};

/// Where the triangles of points and lines go.
pub const Room = struct {
    /// The first of their vertices, which are at the end of the arrays.
    vertex_first: u32,
    /// All of the triangles' array: those of surfaces, and room behind them.
    triangles: []world.Triangle,
};

/// One instance: where its vertices and triangles come from and go to.
const Draw = struct {
    /// First vertex of the mesh that a triangle uses, and how many from there.
    vertex_source: u32,
    vertex_count: u32,
    /// First vertex and triangle in the soup.
    vertex_target: u32,
    triangle_target: u32,

    // By pose.
    mesh: *const scene.Mesh = undefined,
    maps: Placement = undefined,
    /// Of morph targets; empty: none changes the mesh.
    weights: []const f32 = &.{},
    /// In place of `maps`; empty: the mesh has no skin.
    joint_maps: []const AffineD = &.{},
    /// The maps turn fronts into backs.
    mirrored: bool = false,
    /// The maps leave nothing: points and lines, which are as wide as ever, are not drawn either.
    is_hidden: bool = false,
    /// Colours and texture coordinates are not there from an earlier pose.
    is_colored_anew: bool = true,

    fn put(
        draw: *Draw,
        instance: *const scene.Instance,
        mesh: *const scene.Mesh,
        pose: *const pose_file.Pose,
        is_placed: bool,
    ) void {
        const map = pose.maps[instance.node];
        const has_skin = instance.skin != scene.none;
        const was_morphed = draw.weights.len > 0;
        const is_morphed = deform.isMorphed(instance.morph_weights);
        draw.joint_maps = if (has_skin) pose.joint_maps[instance.skin] else &.{};
        draw.mirrored =
            if (has_skin) deform.isMirrored(draw.joint_maps) else map.determinant() < 0;
        const placements: []const AffineD = if (has_skin) draw.joint_maps else (&map)[0..1];
        draw.is_hidden = for (placements) |placement| {
            if (!placement.isPoint()) break false;
        } else true;
        draw.mesh = mesh;
        draw.maps = .of(map, draw.mirrored);
        draw.weights = if (is_morphed) instance.morph_weights else &.{};
        draw.is_colored_anew = !is_placed or was_morphed or is_morphed;
    }
};

/// What a chunk of triangles came to.
const ChunkResult = struct {
    dropped_count: u32 = 0,
    outside_count: u32 = 0,
    bounds: Box3 = .empty,
    centroid_bounds: Box3 = .empty,
};

/// The arrays of a soup, to be written by each pose.
pub const Arrays = struct {
    positions: []Vec3,
    normals: []Vec3,
    colors: [][4]f32,
    texcoords: [texcoord_set_count][][2]f32,
    tangents: [][4]f32,
    triangles: []world.Triangle,
};

/// What is the same in all poses: where vertices and triangles go.
pub const Plan = struct {
    draws: []Draw,
    chunks: []ChunkResult,
    /// Of the arrays, but for the room at their ends, and with it.
    size: Size,
    with_room: Size,
    detail: strokes.Detail,
    /// The arrays have been written before.
    is_placed: bool = false,

    /// Plans what is drawn: instances of `meshes`, with points and lines that are to be
    /// `point_size` pixels wide, or nearly so. Memory comes from `gpa`.
    pub fn init(
        gpa: std.mem.Allocator,
        instances: []const scene.Instance,
        meshes: []const scene.Mesh,
        point_size: f32,
        diagnostic: *Diagnostic,
    ) Error!Plan {
        const draws = try gpa.alloc(Draw, instances.len);
        errdefer gpa.free(draws);
        const size = try layOut(gpa, instances, meshes, draws, diagnostic);
        const detail: strokes.Detail = .of(size.strokes, point_size);
        const with_room = try size.withRoom(detail, diagnostic);
        return .{
            .draws = draws,
            .chunks = try gpa.alloc(ChunkResult, chunkCount(size.triangle_count)),
            .size = size,
            .with_room = with_room,
            .detail = detail,
        };
    }

    /// Frees it.
    pub fn deinit(plan: *Plan, gpa: std.mem.Allocator) void {
        gpa.free(plan.draws);
        gpa.free(plan.chunks);
        plan.* = undefined;
    }

    /// Room for a soup with these attributes.
    pub fn alloc(
        plan: *const Plan,
        arena: std.mem.Allocator,
        attributes: Attributes,
    ) error{OutOfMemory}!Arrays {
        const count = plan.with_room.vertex_count;
        var arrays: Arrays = .{
            .positions = try huge_pages.alloc(arena, Vec3, count),
            .normals = try huge_pages.alloc(arena, Vec3, count),
            .colors = try huge_pages.alloc(arena, [4]f32, if (plan.size.has_colors) count else 0),
            .texcoords = undefined,
            .tangents = try huge_pages.alloc(arena, [4]f32, if (attributes.tangents) count else 0),
            .triangles = try huge_pages.alloc(
                arena,
                world.Triangle,
                plan.with_room.triangle_count,
            ),
        };
        for (&arrays.texcoords, attributes.texcoord_sets) |*set, is_used| {
            set.* = try huge_pages.alloc(arena, [2]f32, if (is_used) count else 0);
        }
        return arrays;
    }

    /// Writes the arrays, always the same ones, with what was planned for where `pose` has nodes
    /// and joints; the instances' weights may be others than before. The strokes' lists come from
    /// `arena`, what is needed meanwhile from `gpa`.
    pub fn place(
        plan: *Plan,
        gpa: std.mem.Allocator,
        arena: std.mem.Allocator,
        arrays: *const Arrays,
        instances: []const scene.Instance,
        meshes: []const scene.Mesh,
        pose: *const pose_file.Pose,
        pool: *parallel.Pool,
        diagnostic: *Diagnostic,
    ) Error!TriangleSoup {
        assert(plan.draws.len == instances.len);
        for (plan.draws, instances) |*draw, *instance| {
            draw.put(instance, &meshes[instance.mesh], pose, plan.is_placed);
        }
        var work: Work = .{
            .draws = plan.draws,
            .size = &plan.size,
            .positions = arrays.positions,
            .normals = arrays.normals,
            .colors = arrays.colors,
            .texcoords = arrays.texcoords,
            .tangents = arrays.tangents,
            .triangles = arrays.triangles,
            .chunks = plan.chunks,
        };
        try pool.forEach(chunkCount(plan.size.vertex_count), &work, Work.placeVertices);
        try pool.forEach(plan.chunks.len, &work, Work.placeTriangles);
        plan.is_placed = true;
        var soup = work.finish(diagnostic);
        if (plan.size.strokes.spheres > 0) {
            soup.strokes = try work.collectStrokes(gpa, arena, plan.detail, diagnostic);
        }
        return soup;
    }
};

const Size = struct {
    vertex_count: u32 = 0,
    triangle_count: u32 = 0,
    has_colors: bool = false,
    strokes: strokes.Count = .{},

    /// With the triangles of points and lines.
    fn withRoom(size: Size, detail: strokes.Detail, diagnostic: *Diagnostic) Error!Size {
        const vertex_total = size.vertex_count + detail.vertexCount(size.strokes);
        const triangle_total = size.triangle_count + detail.triangleCount(size.strokes);
        if (@max(vertex_total, triangle_total) > element_count_max) return tooLarge(diagnostic);
        var with_room = size;
        with_room.vertex_count = @intCast(vertex_total);
        with_room.triangle_count = @intCast(triangle_total);
        return with_room;
    }
};

fn tooLarge(diagnostic: *Diagnostic) error{SceneTooLarge} {
    return diagnostic.fail(
        error.SceneTooLarge,
        "more than {d} triangles or vertices, instances, points and lines counted",
        .{element_count_max},
    );
}

fn chunkCount(count: usize) usize {
    return @divCeil(count, chunk_size);
}

/// Fills the part of `draws` that no pose changes, and adds up their sizes.
fn layOut(
    gpa: std.mem.Allocator,
    instances: []const scene.Instance,
    meshes: []const scene.Mesh,
    draws: []Draw,
    diagnostic: *Diagnostic,
) Error!Size {
    assert(draws.len == instances.len);
    const ranges = try gpa.alloc(?VertexRange, meshes.len);
    defer gpa.free(ranges);
    const counts = try gpa.alloc(strokes.Count, meshes.len);
    defer gpa.free(counts);
    @memset(ranges, null);

    var size: Size = .{};
    var vertex_total: u64 = 0;
    var triangle_total: u64 = 0;
    for (instances, draws) |instance, *draw| {
        const mesh = &meshes[instance.mesh];
        if (ranges[instance.mesh] == null) {
            const range: VertexRange = .of(mesh);
            ranges[instance.mesh] = range;
            counts[instance.mesh] = try countStrokes(gpa, mesh, range);
        }
        const range = ranges[instance.mesh].?;
        size.strokes.add(counts[instance.mesh]);
        draw.* = .{
            .vertex_source = range.first,
            .vertex_count = range.count,
            .vertex_target = @intCast(vertex_total),
            .triangle_target = @intCast(triangle_total),
        };
        vertex_total += range.count;
        triangle_total += mesh.triangles.len;
        if (@max(vertex_total, triangle_total) > element_count_max) return tooLarge(diagnostic);
        if (mesh.colors != null and range.count > 0) size.has_colors = true;
    }
    size.vertex_count = @intCast(vertex_total);
    size.triangle_count = @intCast(triangle_total);
    return size;
}

/// Of a mesh that uses this stretch of its vertices.
pub fn countStrokes(
    gpa: std.mem.Allocator,
    mesh: *const scene.Mesh,
    range: VertexRange,
) error{OutOfMemory}!strokes.Count {
    if (mesh.points.len == 0 and mesh.segments.len == 0) return .{};
    var used: std.DynamicBitSetUnmanaged = try .initEmpty(gpa, range.count);
    defer used.deinit(gpa);
    strokes.mark(&used, mesh, range.first);
    return .of(mesh, &used);
}

/// The stretch of a mesh's vertices that it uses; files share one list of vertices among many
/// meshes.
pub const VertexRange = struct {
    first: u32,
    count: u32,

    /// Of a mesh; empty where it draws nothing.
    pub fn of(mesh: *const scene.Mesh) VertexRange {
        if (mesh.isEmpty()) return .{ .first = 0, .count = 0 };
        var lowest: u32 = std.math.maxInt(u32);
        var highest: u32 = 0;
        inline for (.{
            std.mem.bytesAsSlice(u32, std.mem.sliceAsBytes(mesh.triangles)),
            mesh.points,
            std.mem.bytesAsSlice(u32, std.mem.sliceAsBytes(mesh.segments)),
        }) |vertices| for (vertices) |vertex| {
            lowest = @min(lowest, vertex);
            highest = @max(highest, vertex);
        };
        assert(lowest <= highest);
        return .{ .first = lowest, .count = highest - lowest + 1 };
    }
};

/// Shared by the threads.
const Work = struct {
    draws: []const Draw,
    /// Of the arrays, but for the room at their ends.
    size: *const Size,
    positions: []Vec3,
    normals: []Vec3,
    colors: [][4]f32,
    texcoords: [texcoord_set_count][][2]f32,
    tangents: [][4]f32,
    triangles: []world.Triangle,
    chunks: []ChunkResult,

    fn placeVertices(work: *Work, chunk: usize, _: usize) void {
        const begin = chunk * chunk_size;
        const end = @min(begin + chunk_size, work.size.vertex_count);
        var draw_index = lastAtOrBefore(work.draws, "vertex_target", begin);
        var from = begin;
        while (from < end) : (draw_index += 1) {
            const draw = &work.draws[draw_index];
            const to = @min(end, @as(usize, draw.vertex_target) + draw.vertex_count);
            if (to > from) {
                work.placeDrawVertices(draw, from, to);
                from = to;
            }
        }
    }

    /// Places the vertices `from`..`to` of the soup, which all belong to `draw`.
    fn placeDrawVertices(work: *Work, draw: *const Draw, from: usize, to: usize) void {
        assert(from >= draw.vertex_target and to - draw.vertex_target <= draw.vertex_count);
        const source = draw.vertex_source + (from - draw.vertex_target);
        const count = to - from;
        const white: [4]f32 = .{ 1, 1, 1, 1 };
        if (draw.is_colored_anew) {
            if (work.colors.len > 0) copy(work.colors[from..to], draw.mesh.colors, source, white);
            for (work.texcoords, draw.mesh.texcoords) |to_set, set| {
                if (to_set.len > 0) copy(to_set[from..to], set, source, .{ 0, 0 });
            }
            if (draw.weights.len > 0) work.morphColors(draw, from, to, source);
        }
        if (draw.weights.len > 0 or draw.joint_maps.len > 0) {
            return work.placeDeformed(draw, from, to, source);
        }
        for (work.positions[from..to], draw.mesh.positions[source..][0..count]) |*to_p, p| {
            to_p.* = draw.maps.placePoint(p);
        }
        if (draw.mesh.normals) |normals| {
            for (work.normals[from..to], normals[source..][0..count]) |*to_n, n| {
                to_n.* = draw.maps.placeNormal(n);
            }
        } else {
            @memset(work.normals[from..to], .{ 0, 0, 0 });
        }
        if (work.tangents.len > 0) placeTangents(draw, work.tangents[from..to], source);
    }

    /// Adds to colours and texture coordinates what morph targets do.
    fn morphColors(work: *Work, draw: *const Draw, from: usize, to: usize, source: usize) void {
        const mesh = draw.mesh;
        if (work.colors.len > 0 and deform.isChanged(mesh, draw.weights, .colors)) {
            const colors = work.colors[from..to];
            deform.morph(mesh, draw.weights, .colors, 0, source, colors);
            // glTF 2.0, section 3.7.2.2. Written so that NaN becomes 0.
            for (colors) |*color| for (color) |*value| {
                value.* = if (!(value.* > 0)) 0 else if (value.* < 1) value.* else 1;
            };
        }
        for (work.texcoords, 0..) |all, set| {
            if (all.len == 0 or mesh.texcoords[set] == null) continue;
            if (!deform.isChanged(mesh, draw.weights, .{ .texcoords = set })) continue;
            const texcoords = all[from..to];
            deform.morph(mesh, draw.weights, .texcoords, set, source, texcoords);
            for (texcoords, mesh.texcoords[set].?[source..][0..texcoords.len]) |*at, modelled| {
                const is_finite = std.math.isFinite(at[0]) and std.math.isFinite(at[1]);
                if (!is_finite) at.* = modelled;
            }
        }
    }

    /// Places vertices after morph targets and joints have had their say. Normals and tangents
    /// become unit vectors, for each has a map of its own.
    fn placeDeformed(work: *Work, draw: *const Draw, from: usize, to: usize, source: usize) void {
        const mesh = draw.mesh;
        const positions = work.positions[from..to];
        @memcpy(positions, mesh.positions[source..][0..positions.len]);
        deform.morph(mesh, draw.weights, .positions, 0, source, positions);
        const normals = work.normals[from..to];
        copy(normals, mesh.normals, source, .{ 0, 0, 0 });
        if (mesh.normals != null) deform.morph(mesh, draw.weights, .normals, 0, source, normals);
        const has_tangents = work.tangents.len > 0;
        const tangents = work.tangents[if (has_tangents) from else 0..if (has_tangents) to else 0];
        copy(tangents, mesh.tangents, source, .{ 0, 0, 0, 1 });
        if (mesh.tangents != null) deform.morph(mesh, draw.weights, .tangents, 0, source, tangents);
        const sign: f32 = if (draw.mirrored) -1 else 1;
        for (positions, normals, 0..) |*position, *normal, index| {
            const maps: Placement = if (draw.joint_maps.len > 0)
                .of(deform.blend(mesh.joint_sets, draw.joint_maps, source + index), draw.mirrored)
            else
                draw.maps;
            position.* = maps.placePoint(position.*);
            normal.* = vec3.normalize(maps.normal.direction(normal.*)) orelse .{ 0, 0, 0 };
            if (!has_tangents or mesh.tangents == null) continue;
            const tangent = &tangents[index];
            const along = maps.direction.direction(tangent[0..3].*);
            const unit = vec3.normalize(along) orelse Vec3{ 0, 0, 0 };
            tangent.* = .{ unit[0], unit[1], unit[2], tangent[3] * sign };
        }
    }

    fn placeTriangles(work: *Work, chunk: usize, _: usize) void {
        const begin = chunk * chunk_size;
        const end = @min(begin + chunk_size, work.size.triangle_count);
        var result: ChunkResult = .{};
        var draw_index = lastAtOrBefore(work.draws, "triangle_target", begin);
        var from = begin;
        while (from < end) : (draw_index += 1) {
            const draw = &work.draws[draw_index];
            const to = @min(end, @as(usize, draw.triangle_target) + draw.mesh.triangles.len);
            if (to > from) {
                const source = from - draw.triangle_target;
                const triangles = draw.mesh.triangles[source..][0 .. to - from];
                work.placeDrawTriangles(draw, triangles, work.triangles[from..to], &result);
                from = to;
            }
        }
        work.chunks[chunk] = result;
    }

    fn placeDrawTriangles(
        work: *Work,
        draw: *const Draw,
        triangles: []const [3]u32,
        placed: []world.Triangle,
        result: *ChunkResult,
    ) void {
        // Wraps where the source starts later than the target; the sum is right again.
        const shift = draw.vertex_target -% draw.vertex_source;
        for (triangles, placed) |triangle, *to| {
            var corner: [3]u32 = .{
                triangle[0] +% shift, triangle[1] +% shift, triangle[2] +% shift,
            };
            if (draw.mirrored) std.mem.swap(u32, &corner[1], &corner[2]);
            const a = work.positions[corner[0]];
            const b = work.positions[corner[1]];
            const c = work.positions[corner[2]];
            const is_near = isWithinRange(a, b, c);
            if (!is_near or !hasArea(a, b, c)) {
                to.* = .{ .corner = corner, .material = world.none };
                result.dropped_count += 1;
                result.outside_count += @intFromBool(!is_near);
                continue;
            }
            to.* = .{ .corner = corner, .material = draw.mesh.material };
            const box = Box3.empty.include(a).include(b).include(c);
            result.bounds = result.bounds.join(box);
            result.centroid_bounds = result.centroid_bounds.include(box.centerTwice());
        }
    }

    fn finish(work: *const Work, diagnostic: *Diagnostic) TriangleSoup {
        var dropped_count: u32 = 0;
        var outside_count: u32 = 0;
        var bounds: Box3 = .empty;
        var centroid_bounds: Box3 = .empty;
        for (work.chunks) |chunk| {
            dropped_count += chunk.dropped_count;
            outside_count += chunk.outside_count;
            bounds = bounds.join(chunk.bounds);
            centroid_bounds = centroid_bounds.join(chunk.centroid_bounds);
        }
        if (outside_count > 0) diagnostic.warn(
            "{d} triangles left out: they reach farther than 2^40 m from the origin",
            .{outside_count},
        );
        const count = work.size.triangle_count;
        if (count > 0 and dropped_count == count and outside_count == 0) diagnostic.warn(
            "nothing to render of {d} triangles: none has an area that can be told from 0",
            .{count},
        );
        return .{
            .positions = work.positions,
            .normals = work.normals,
            .colors = work.colors,
            .texcoords = work.texcoords,
            .tangents = work.tangents,
            .triangles = work.triangles[0..work.size.triangle_count],
            .surface_count = work.size.triangle_count,
            .dropped_count = dropped_count,
            .strokes = .{},
            .sphere_radius = 0,
            .room = .{ .vertex_first = work.size.vertex_count, .triangles = work.triangles },
            .bounds = bounds,
            .centroid_bounds = centroid_bounds,
        };
    }

    /// Lists the strokes, those that are nowhere marked as dropped.
    fn collectStrokes(
        work: *const Work,
        gpa: std.mem.Allocator,
        arena: std.mem.Allocator,
        detail: strokes.Detail,
        diagnostic: *Diagnostic,
    ) error{OutOfMemory}!strokes.Strokes {
        const count = &work.size.strokes;
        const Spheres = std.ArrayList(world.Sphere);
        var spheres: Spheres = try .initCapacity(arena, @intCast(count.spheres));
        const Segments = std.ArrayList(strokes.Segment);
        var segments: Segments = try .initCapacity(arena, @intCast(count.segments));
        var outside_count: u64 = 0;
        for (work.draws) |*draw| {
            const mesh = draw.mesh;
            if (mesh.points.len == 0 and mesh.segments.len == 0) continue;
            var used: std.DynamicBitSetUnmanaged = try .initEmpty(gpa, draw.vertex_count);
            defer used.deinit(gpa);
            strokes.mark(&used, mesh, draw.vertex_source);
            var vertices = used.iterator(.{});
            while (vertices.next()) |vertex| {
                const center = draw.vertex_target + @as(u32, @intCast(vertex));
                const is_placed = work.isPlaced(center);
                outside_count += @intFromBool(!is_placed);
                const material = if (is_placed and !draw.is_hidden) mesh.material else world.none;
                spheres.appendAssumeCapacity(.{ .center = center, .material = material });
            }
            const shift = draw.vertex_target -% draw.vertex_source;
            for (mesh.segments) |pair| {
                const ends: [2]u32 = .{ pair[0] +% shift, pair[1] +% shift };
                const are_placed = work.isPlaced(ends[0]) and work.isPlaced(ends[1]);
                const material = if (are_placed and !draw.is_hidden) mesh.material else world.none;
                segments.appendAssumeCapacity(.{ .ends = ends, .material = material });
            }
        }
        if (outside_count > 0) diagnostic.warn(
            "{d} vertices of points and lines left out: they are farther than 2^40 m from the " ++
                "origin",
            .{outside_count},
        );
        return .{ .spheres = spheres.items, .segments = segments.items, .detail = detail };
    }

    fn isPlaced(work: *const Work, vertex: u32) bool {
        const place = work.positions[vertex];
        return isWithinRange(place, place, place);
    }
};

/// Copies what the vertices from `source` on have, or what counts where they have nothing.
fn copy(to: anytype, from: anytype, source: usize, missing: std.meta.Elem(@TypeOf(to))) void {
    if (from) |all| @memcpy(to, all[source..][0..to.len]) else @memset(to, missing);
}

fn placeTangents(draw: *const Draw, to: [][4]f32, source: usize) void {
    const tangents = draw.mesh.tangents orelse return @memset(to, .{ 0, 0, 0, 1 });
    for (to, tangents[source..][0..to.len]) |*to_t, t| to_t.* = draw.maps.placeTangent(t);
}

/// Index of the last draw whose `field` is at most `position`, so that what follows holds it.
fn lastAtOrBefore(draws: []const Draw, comptime field: []const u8, position: usize) usize {
    assert(draws.len > 0 and @field(draws[0], field) == 0);
    var low: usize = 0;
    var high: usize = draws.len;
    while (high - low > 1) {
        const middle = low + (high - low) / 2;
        if (@field(draws[middle], field) <= position) low = middle else high = middle;
    }
    return low;
}

/// Whether a triangle is near enough to be hit; false for infinities and NaN too.
pub fn isWithinRange(a: Vec3, b: Vec3, c: Vec3) bool {
    var within = true;
    inline for (.{ a, b, c }) |corner| {
        inline for (0..3) |axis| within = within and @abs(corner[axis]) <= pose_file.coordinate_max;
    }
    return within;
}

/// Whether a triangle can be hit.
pub fn hasArea(a: Vec3, b: Vec3, c: Vec3) bool {
    const normal = vec3.cross(vec3.sub(b, a), vec3.sub(c, a));
    return @abs(normal[0]) > area_twice_min or @abs(normal[1]) > area_twice_min or
        @abs(normal[2]) > area_twice_min;
}

test "more strokes than can be numbered are an error before memory is asked for" {
    var diagnostic: Diagnostic = .{};
    const size: Size = .{ .vertex_count = 9, .strokes = .{ .spheres = 1 << 28, .segments = 1 } };
    const detail: strokes.Detail = .of(size.strokes, 1.5);
    try std.testing.expectError(error.SceneTooLarge, size.withRoom(detail, &diagnostic));
    const fewer: Size = .{ .vertex_count = 9, .strokes = .{ .spheres = 1 << 26 } };
    const with_room = try fewer.withRoom(detail, &diagnostic);
    try std.testing.expectEqual(9 + (6 << 26), with_room.vertex_count);
    try std.testing.expectEqual(8 << 26, with_room.triangle_count);
}
