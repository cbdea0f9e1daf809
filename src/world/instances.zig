//! Two-level instancing (Wald, Benthin and Slusallek 2003, "Distributed Interactive Ray Tracing of
//! Dynamic Scenes"): meshes that many instances share, with the tree over each.
//!
//! A mesh is held once, in its own space, with a tree of its own that is cut into clusters of
//! 256 triangles at most. An instance is a map and the number of its first triangle. Above the
//! clusters of all instances stand boxes in world space, so that no ray is ever transformed: where
//! one comes to a cluster, that is mapped as a whole (`MappedCluster`), by the expressions that
//! flatten meshes, and from there on it is a small tree like any other. So a hit is the same as if
//! the scene were flattened, to the bit: the same corners, the same number, the same padded boxes.
//!
//! Triangles and vertices are numbered as if everything were flattened; `Shared.runs` tells by
//! number where they are.

const std = @import("std");
const math = @import("../math.zig");
const geometry_file = @import("geometry.zig");
const assert = std.debug.assert;
const AnyTree = geometry_file.AnyTree;
const Box3 = math.Box3;
const Child = geometry_file.Child;
const Geometry = geometry_file.Geometry;
const Node = geometry_file.Node;
const Padding = @import("padding.zig").Padding;
const Placement = @import("placement.zig").Placement;
const Tree = geometry_file.Tree;
const Triangle = geometry_file.Triangle;
const TrianglePack = geometry_file.TrianglePack;
const Vec3 = math.Vec3;
const none = geometry_file.none;

/// A mesh in its own space. What it does not have is empty.
pub const SharedMesh = struct {
    positions: []const Vec3,
    normals: []const Vec3,
    colors: []const [4]f32,
    texcoords: [geometry_file.texcoord_set_count][]const [2]f32,
    tangents: []const [4]f32,
    /// Those with two corners in one place are dropped.
    triangles: []const Triangle,
    /// Its packs number the triangles of the mesh.
    tree: AnyTree,
    clusters: []const Cluster,
};

/// Part of a mesh's tree: a node and all that is below it, or a leaf.
pub const Cluster = struct {
    /// `none`: a leaf, without nodes.
    root: u32,
    /// The nodes below the root, and the packs, which follow each other.
    node_first: u32,
    node_count: u32,
    pack_first: u32,
    pack_count: u32,
};

/// Packs of a cluster at most.
pub fn clusterPacksMax(comptime width: comptime_int) comptime_int {
    return 256 / width;
}

/// Nodes of a cluster at most, which has always one.
pub fn clusterNodesMax(comptime width: comptime_int) comptime_int {
    return 64 / width;
}

/// A mesh at a place.
pub const Instance = struct {
    /// Index into `Shared.meshes`.
    mesh: u32,
    /// Numbers of its first triangle and vertex.
    primitive_first: u32,
    vertex_first: u32,
    placement: Placement,
};

/// A cluster of an instance: what a leaf of the scene's tree may be.
pub const ClusterReference = struct { instance: u32, cluster: u32 };

/// Triangles that follow each other, all of one instance, or flattened.
pub const Run = struct {
    primitive_first: u32,
    vertex_first: u32,
    /// `none`: flattened.
    instance: u32,
    /// Where flattened triangles and their vertices begin in the arrays of `Geometry`.
    triangle_first: u32,
    position_first: u32,
};

/// All that is not flattened.
pub const Shared = struct {
    meshes: []const SharedMesh = &.{},
    instances: []const Instance = &.{},
    clusters: []const ClusterReference = &.{},
    /// In order, without gaps; empty where all is flattened.
    runs: []const Run = &.{},
    /// Which of these are flattened.
    flat_runs: []const u32 = &.{},
    primitive_count: u32 = 0,
    vertex_count: u32 = 0,
    /// Some mesh has colours, and textures want tangents.
    has_colors: bool = false,
    has_tangents: bool = false,

    /// The number of a flattened triangle by its place in `Geometry.triangles`.
    pub fn numberOf(shared: *const Shared, triangle: u32) u32 {
        const search: FlatSearch = .{ .shared = shared, .triangle = triangle };
        const next =
            std.sort.partitionPoint(u32, shared.flat_runs, search, FlatSearch.isAtOrBefore);
        const run = &shared.runs[shared.flat_runs[next - 1]];
        return run.primitive_first + (triangle - run.triangle_first);
    }

    /// Where in `Geometry.triangles` the next ones are that do not follow this one's by number;
    /// null: nowhere.
    pub fn flatEnd(shared: *const Shared, triangle: usize) ?usize {
        const search: FlatSearch = .{ .shared = shared, .triangle = triangle };
        const next =
            std.sort.partitionPoint(u32, shared.flat_runs, search, FlatSearch.isAtOrBefore);
        if (next == shared.flat_runs.len) return null;
        return shared.runs[shared.flat_runs[next]].triangle_first;
    }

    const FlatSearch = struct {
        shared: *const Shared,
        triangle: usize,

        fn isAtOrBefore(search: FlatSearch, run: u32) bool {
            return search.shared.runs[run].triangle_first <= search.triangle;
        }
    };

    fn find(shared: *const Shared, comptime field: []const u8, number: u32) usize {
        var low: usize = 0;
        var high = shared.runs.len;
        while (high - low > 1) {
            const middle = low + (high - low) / 2;
            if (@field(shared.runs[middle], field) <= number) low = middle else high = middle;
        }
        return low;
    }

    /// See `Geometry.face`.
    pub fn face(shared: *const Shared, geometry: *const Geometry, primitive: u32) Face {
        const run = &shared.runs[shared.find("primitive_first", primitive)];
        return shared.faceIn(geometry, run, primitive);
    }

    fn faceIn(
        shared: *const Shared,
        geometry: *const Geometry,
        run: *const Run,
        primitive: u32,
    ) Face {
        const local = primitive - run.primitive_first;
        if (run.instance == none) return .of(&geometry.triangles[run.triangle_first + local]);
        const instance = &shared.instances[run.instance];
        const mesh = &shared.meshes[instance.mesh];
        var result: Face = .{
            .corner = mesh.triangles[local].corner,
            .material = mesh.triangles[local].material,
            .mesh = mesh,
            .placement = &instance.placement,
        };
        if (instance.placement.mirrored) std.mem.swap(u32, &result.corner[1], &result.corner[2]);
        return result;
    }
};

/// Triangles and vertices by their numbers, for those who look at many that follow each other: the
/// run of the last one is remembered.
pub const Cursor = struct {
    geometry: *const Geometry,
    run: Run = .{
        .primitive_first = 0,
        .vertex_first = 0,
        .instance = none,
        .triangle_first = 0,
        .position_first = 0,
    },
    /// What is in the run: where all is flattened, everything.
    primitive_count: u32 = std.math.maxInt(u32),
    vertex_count: u32 = std.math.maxInt(u32),

    /// At the first triangle.
    pub fn init(geometry: *const Geometry) Cursor {
        var cursor: Cursor = .{ .geometry = geometry };
        if (geometry.shared.runs.len > 0) cursor.enter(0);
        return cursor;
    }

    fn enter(cursor: *Cursor, index: usize) void {
        const shared = &cursor.geometry.shared;
        const runs = shared.runs;
        const is_last = index + 1 == runs.len;
        cursor.run = runs[index];
        const primitive_end =
            if (is_last) shared.primitive_count else runs[index + 1].primitive_first;
        const vertex_end = if (is_last) shared.vertex_count else runs[index + 1].vertex_first;
        cursor.primitive_count = primitive_end - cursor.run.primitive_first;
        cursor.vertex_count = vertex_end - cursor.run.vertex_first;
    }

    /// A triangle, with corners for `positionAt` and `colorAt`.
    pub fn triangleAt(cursor: *Cursor, primitive: u32) Triangle {
        const shared = &cursor.geometry.shared;
        if (primitive -% cursor.run.primitive_first >= cursor.primitive_count)
            cursor.enter(shared.find("primitive_first", primitive));
        const run = &cursor.run;
        const face = shared.faceIn(cursor.geometry, run, primitive);
        var corner = face.corner;
        // Wraps where the vertices start earlier in the array; the sum is right again.
        for (&corner) |*vertex| vertex.* +%= run.vertex_first -% run.position_first;
        return .{ .corner = corner, .material = face.material };
    }

    /// Where a vertex is.
    pub fn positionAt(cursor: *Cursor, vertex: u32) Vec3 {
        const local = cursor.localOf(vertex);
        const run = &cursor.run;
        const geometry = cursor.geometry;
        if (run.instance == none) return geometry.positions[run.position_first + local];
        const instance = &geometry.shared.instances[run.instance];
        const mesh = &geometry.shared.meshes[instance.mesh];
        return instance.placement.placePoint(mesh.positions[local]);
    }

    /// The colour of a vertex, white where it has none.
    pub fn colorAt(cursor: *Cursor, vertex: u32) [4]f32 {
        const local = cursor.localOf(vertex);
        const run = &cursor.run;
        const geometry = cursor.geometry;
        if (run.instance == none) return orElse(geometry.colors, run.position_first + local, white);
        const mesh = &geometry.shared.meshes[geometry.shared.instances[run.instance].mesh];
        return orElse(mesh.colors, local, white);
    }

    /// The number of a vertex in its run.
    fn localOf(cursor: *Cursor, vertex: u32) u32 {
        if (vertex -% cursor.run.vertex_first >= cursor.vertex_count)
            cursor.enter(cursor.geometry.shared.find("vertex_first", vertex));
        return vertex - cursor.run.vertex_first;
    }
};

const white: [4]f32 = .{ 1, 1, 1, 1 };

inline fn orElse(
    list: anytype,
    index: u32,
    missing: std.meta.Elem(@TypeOf(list)),
) @TypeOf(missing) {
    return if (list.len > 0) list[index] else missing;
}

/// A triangle, wherever it is, and what its corners have.
pub const Face = struct {
    /// Indices into the arrays of the mesh, or of the geometry where it is flattened.
    corner: [3]u32,
    /// Index into `Materials.all`; `none` if the triangle is dropped.
    material: u32,
    mesh: *const SharedMesh = undefined,
    /// Null: flattened.
    placement: ?*const Placement = null,

    /// One that is flattened.
    pub inline fn of(triangle: *const Triangle) Face {
        return .{ .corner = triangle.corner, .material = triangle.material };
    }

    /// Of a corner, in world space.
    pub inline fn position(face: *const Face, geometry: *const Geometry, corner: usize) Vec3 {
        const vertex = face.corner[corner];
        const placement = face.placement orelse return geometry.positions[vertex];
        return placement.placePoint(face.mesh.positions[vertex]);
    }

    /// Not normalised; zero where there is none.
    pub inline fn normal(face: *const Face, geometry: *const Geometry, corner: usize) Vec3 {
        const vertex = face.corner[corner];
        const placement = face.placement orelse return geometry.normals[vertex];
        if (face.mesh.normals.len == 0) return @splat(0);
        return placement.placeNormal(face.mesh.normals[vertex]);
    }

    /// White where there is none.
    pub inline fn color(face: *const Face, geometry: *const Geometry, corner: usize) [4]f32 {
        const list = if (face.placement == null) geometry.colors else face.mesh.colors;
        return orElse(list, face.corner[corner], white);
    }

    /// 0 where there is none.
    pub inline fn texcoord(
        face: *const Face,
        geometry: *const Geometry,
        set: u32,
        corner: usize,
    ) [2]f32 {
        const list = if (face.placement == null)
            geometry.texcoords[set]
        else
            face.mesh.texcoords[set];
        return orElse(list, face.corner[corner], .{ 0, 0 });
    }

    /// Between the corners, of which 1 and 2 have these weights.
    pub fn texcoordAt(
        face: *const Face,
        geometry: *const Geometry,
        set: u32,
        weights: [2]f32,
    ) [2]f32 {
        const first = face.texcoord(geometry, set, 0);
        const second = face.texcoord(geometry, set, 1);
        const third = face.texcoord(geometry, set, 2);
        var at = first;
        for (&at, first, second, third) |*to, a, b, c| {
            to.* += (b - a) * weights[0] + (c - a) * weights[1];
        }
        return at;
    }

    /// The same of positions, in world space.
    pub fn positionAt(face: *const Face, geometry: *const Geometry, weights: [2]f32) Vec3 {
        const first = face.position(geometry, 0);
        const second = face.position(geometry, 1);
        const third = face.position(geometry, 2);
        var at = first;
        for (&at, first, second, third) |*to, a, b, c| {
            to.* += (b - a) * weights[0] + (c - a) * weights[1];
        }
        return at;
    }

    /// See `Geometry.tangents`; asserts that there are some.
    pub inline fn tangent(face: *const Face, geometry: *const Geometry, corner: usize) [4]f32 {
        const vertex = face.corner[corner];
        const placement = face.placement orelse return geometry.tangents[vertex];
        if (face.mesh.tangents.len == 0) return .{ 0, 0, 0, 1 };
        return placement.placeTangent(face.mesh.tangents[vertex]);
    }
};

/// Triangles of a pack where an instance has them, numbered as its own.
pub fn mapPack(
    comptime width: comptime_int,
    from: *const TrianglePack(width),
    placement: *const Placement,
    primitive_first: u32,
    to: *TrianglePack(width),
) void {
    const Doubles = @Vector(width, f64);
    const Singles = @Vector(width, f32);
    const map = &placement.point;
    const numbers: @Vector(width, u32) = from.primitive;
    const is_there = numbers != @as(@Vector(width, u32), @splat(none));
    const first: @Vector(width, u32) = @splat(primitive_first);
    to.primitive = @select(u32, is_there, numbers +% first, numbers);
    for (&from.corner, 0..) |*components, corner| {
        var p: [3]Doubles = undefined;
        for (&p, components) |*wide, *lanes| wide.* = @floatCast(@as(Singles, lanes.*));
        // As `AffineD.point` has it.
        const target = if (placement.mirrored and corner > 0) 3 - corner else corner;
        inline for (0..3) |axis| {
            const x = @as(Doubles, @splat(map.x[axis])) * p[0];
            const y = @as(Doubles, @splat(map.y[axis])) * p[1];
            const z = @as(Doubles, @splat(map.z[axis])) * p[2];
            const placed = ((x + y) + z) + @as(Doubles, @splat(map.translation[axis]));
            const rounded: Singles = @floatCast(placed);
            const zero: Singles = @splat(0);
            to.corner[target][axis] = @select(f32, is_there, rounded, zero);
        }
    }
}

/// The box of a pack's triangles, each grown by its pad.
pub fn packBox(
    comptime width: comptime_int,
    padding: *const Padding,
    pack: *const TrianglePack(width),
) Box3 {
    const Singles = @Vector(width, f32);
    const numbers: @Vector(width, u32) = pack.primitive;
    const is_there = numbers != @as(@Vector(width, u32), @splat(none));
    var lower: [3]Singles = undefined;
    var upper: [3]Singles = undefined;
    for (&lower, &upper, 0..) |*low, *high, axis| {
        const a: Singles = pack.corner[0][axis];
        const b: Singles = pack.corner[1][axis];
        const c: Singles = pack.corner[2][axis];
        const ab_low = @select(f32, b < a, b, a);
        const ab_high = @select(f32, b > a, b, a);
        low.* = @select(f32, c < ab_low, c, ab_low);
        high.* = @select(f32, c > ab_high, c, ab_high);
    }
    const pad = padding.ofVectors(width, lower, upper);
    const infinite: Singles = @splat(std.math.inf(f32));
    var box: Box3 = undefined;
    for (0..3) |axis| {
        box.lower[axis] = @reduce(.Min, @select(f32, is_there, lower[axis] - pad, infinite));
        box.upper[axis] = @reduce(.Max, @select(f32, is_there, upper[axis] + pad, -infinite));
    }
    return box;
}

/// A cluster of an instance in world space: a small tree, whose boxes are those that a tree over
/// the same flattened triangles would have.
pub fn MappedCluster(comptime width: comptime_int) type {
    return struct {
        pack_count: u32,
        nodes: [clusterNodesMax(width)]Node(width),
        packs: [clusterPacksMax(width)]TrianglePack(width) align(geometry_file.cache_line_bytes),

        const Self = @This();

        /// Maps a cluster, by its index in `Shared.clusters`.
        pub fn fill(mapped: *Self, geometry: *const Geometry, reference: u32) void {
            const shared = &geometry.shared;
            const at = shared.clusters[reference];
            const instance = &shared.instances[at.instance];
            const mesh = &shared.meshes[instance.mesh];
            const cluster = &mesh.clusters[at.cluster];
            const from = mesh.tree.get(width);
            mapped.pack_count = cluster.pack_count;
            const packs = from.packs[cluster.pack_first..][0..cluster.pack_count];
            for (packs, mapped.packs[0..packs.len]) |*pack, *to| {
                mapPack(width, pack, &instance.placement, instance.primitive_first, to);
            }
            if (cluster.root == none) {
                mapped.nodes[0] = .empty;
                mapped.nodes[0].child[0] = .{ .target = 0, .pack_count = cluster.pack_count };
            } else {
                mapped.nodes[0].child = from.nodes[cluster.root].child;
                for (1..cluster.node_count + 1) |index| {
                    mapped.nodes[index].child =
                        from.nodes[cluster.node_first + index - 1].child;
                }
                mapped.renumber(cluster);
            }
            mapped.fit(&geometry.padding, cluster.node_count + 1);
        }

        /// Children by their places here.
        fn renumber(mapped: *Self, cluster: *const Cluster) void {
            for (mapped.nodes[0 .. cluster.node_count + 1]) |*node| {
                for (&node.child) |*child| {
                    if (child.* == Child.missing) continue;
                    child.target = if (child.pack_count > 0)
                        child.target - cluster.pack_first
                    else
                        child.target - cluster.node_first + 1;
                }
            }
        }

        /// Sets the boxes, those below before those above: children have higher numbers.
        fn fit(mapped: *Self, padding: *const Padding, node_count: u32) void {
            var boxes: [clusterNodesMax(width)]Box3 = undefined;
            var index = node_count;
            while (index > 0) {
                index -= 1;
                const node = &mapped.nodes[index];
                boxes[index] = .empty;
                for (node.child, 0..) |child, slot| {
                    var box: Box3 = .empty;
                    if (child.pack_count > 0) {
                        const first, const end = child.packs();
                        for (mapped.packs[first..end]) |*pack| {
                            box = box.join(packBox(width, padding, pack));
                        }
                    } else if (child != Child.missing) box = boxes[child.target];
                    boxes[index] = boxes[index].join(box);
                    const is_there = child != Child.missing;
                    const grown = if (is_there) box.grow(padding.marginOfBox(box)) else box;
                    node.setChildBox(slot, grown);
                }
            }
        }

        /// As a tree; it lives as long as what is mapped.
        pub inline fn tree(mapped: *const Self) Tree(width) {
            return .{ .nodes = &mapped.nodes, .packs = &mapped.packs };
        }
    };
}

/// Clusters that a thread has mapped, so that the next of its rays find them so: a cache of two
/// ways, the one of which that was asked for last stays.
pub fn ClusterCache(comptime width: comptime_int) type {
    return struct {
        sets: []Set,
        /// Two for each set, which are as many as a power of two.
        slots: []MappedCluster(width),

        /// Which clusters two slots hold, or `none`, and which of the slots was asked for last.
        pub const Set = struct { tags: [2]u32, last: u32 };

        /// Of slots that hold nothing yet.
        pub fn init(sets: []Set, slots: []MappedCluster(width)) @This() {
            assert(2 * sets.len == slots.len and std.math.isPowerOfTwo(sets.len));
            @memset(sets, .{ .tags = @splat(none), .last = 0 });
            return .{ .sets = sets, .slots = slots };
        }

        /// A cluster, valid until the next is asked for.
        pub fn get(
            cache: *const @This(),
            geometry: *const Geometry,
            reference: u32,
        ) *const MappedCluster(width) {
            // Fibonacci hashing (Knuth, The Art of Computer Programming, volume 3, section 6.4).
            const hash = (reference *% 0x9e3779b1) >> 16;
            const index = hash & (cache.sets.len - 1);
            const set = &cache.sets[index];
            const way: u32 = if (set.tags[0] == reference)
                0
            else if (set.tags[1] == reference) 1 else 1 - set.last;
            set.last = way;
            const slot = &cache.slots[2 * index + way];
            if (set.tags[way] != reference) {
                slot.fill(geometry, reference);
                set.tags[way] = reference;
            }
            return slot;
        }
    };
}
