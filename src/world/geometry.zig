//! A bounding volume hierarchy of wide nodes over triangles in world space, and the vertices' data.

const std = @import("std");
const math = @import("../math.zig");
const assert = std.debug.assert;
const instances = @import("instances.zig");
const Face = instances.Face;
const Padding = @import("padding.zig").Padding;
const Vec3 = math.Vec3;
const Box3 = math.Box3;

/// Index that stands for "none": no primitive, no child.
pub const none: u32 = std.math.maxInt(u32);

/// Levels of a tree at most; the builder keeps to it, traversal stacks are sized by it.
pub const tree_depth_max = 64;

/// Levels that a ray may have to go down, those within clusters of instances counted.
pub const walk_depth_max = tree_depth_max + 1;

/// Bytes that nodes and triangle packs are aligned to: a cache line.
pub const cache_line_bytes = 64;

/// A child of a node. One word, since stacks write and read it as a whole: two stores that one load
/// reads back make processors wait.
pub const Child = packed struct(u64) {
    /// Number of a node, of the first triangle pack, or of an instance's cluster; `none` if there
    /// is no child.
    target: u32,
    /// 0: a node; `cluster_mark`: a cluster; else that many packs.
    pack_count: u32,

    /// Packs of a leaf are fewer.
    pub const cluster_mark = std.math.maxInt(u32) - 1;
    /// What stands on a stack below a cluster's children: here the tree is the scene's again.
    pub const cluster_end: Child = .{ .target = none, .pack_count = std.math.maxInt(u32) };

    pub const missing: Child = .{ .target = none, .pack_count = 0 };
    pub const root: Child = .{ .target = 0, .pack_count = 0 };

    /// A cluster of an instance: `target` is its number.
    pub inline fn isCluster(child: Child) bool {
        return child.pack_count == cluster_mark;
    }

    /// Whether it is a leaf with packs of its own.
    pub inline fn hasPacks(child: Child) bool {
        return child.pack_count > 0 and child.pack_count < cluster_mark;
    }

    /// The numbers of its packs, from the first to before the last; equal for a node.
    pub inline fn packs(child: Child) [2]usize {
        return .{ child.target, @as(usize, child.target) + child.pack_count };
    }
};

/// A node with `width` children, structure of arrays.
///
///     width 4, bytes   0..47   bounds[0]  lower x x x x | y y y y | z z z z
///                     48..95   bounds[1]  upper x x x x | y y y y | z z z z
///                     96..127  child      two words each, see `Child`
///
/// A missing child has the empty box (+inf, -inf).
pub fn Node(comptime width: comptime_int) type {
    return extern struct {
        /// [lower, upper][axis][child].
        bounds: [2][3][width]f32 align(cache_line_bytes),
        child: [width]Child,

        const Self = @This();

        /// A node without children.
        pub const empty: Self = .{
            .bounds = .{ @splat(@splat(std.math.inf(f32))), @splat(@splat(-std.math.inf(f32))) },
            .child = @splat(.missing),
        };

        /// The box of one child.
        pub fn childBox(node: *const Self, index: usize) Box3 {
            var box: Box3 = undefined;
            for (0..3) |axis| {
                box.lower[axis] = node.bounds[0][axis][index];
                box.upper[axis] = node.bounds[1][axis][index];
            }
            return box;
        }

        /// Sets it.
        pub fn setChildBox(node: *Self, index: usize, box: Box3) void {
            for (0..3) |axis| {
                node.bounds[0][axis][index] = box.lower[axis];
                node.bounds[1][axis][index] = box.upper[axis];
            }
        }

        comptime {
            assert(@sizeOf(Self) == 32 * width);
            assert(@alignOf(Self) == cache_line_bytes);
        }
    };
}

/// `width` triangles, structure of arrays: corners as they are in the scene, so that triangles that
/// share one see it at the same place from any origin.
///
///     width 4, bytes   0..143  corner[3]: x x x x | y y y y | z z z z each
///                    144..159  primitive
///
/// Padding lanes have `primitive = none` and three corners at the origin, which no ray hits: but
/// every test of edges is in doubt about them, so that they are left out first.
pub fn TrianglePack(comptime width: comptime_int) type {
    return extern struct {
        /// [corner][axis][lane].
        corner: [3][3][width]f32 align(16),
        /// Numbers of triangles, see `Geometry.face`.
        primitive: [width]u32,

        /// A pack without triangles.
        pub const empty: @This() = .{
            .corner = @splat(@splat(@splat(0))),
            .primitive = @splat(none),
        };

        comptime {
            assert(@sizeOf(@This()) == 40 * width);
        }
    };
}

/// A bounding volume hierarchy of one width. Node 0 is the root.
pub fn Tree(comptime width: comptime_int) type {
    return struct {
        nodes: []align(cache_line_bytes) const Node(width),
        packs: []align(cache_line_bytes) const TrianglePack(width),

        /// Asks memory for a child's node or first pack, to be there when somebody comes to it.
        pub inline fn prefetch(tree: *const @This(), child: Child) void {
            const start: [*]const u8 = if (child.pack_count == 0)
                @ptrCast(&tree.nodes[child.target])
            else if (child.isCluster())
                return
            else
                @ptrCast(&tree.packs[child.target]);
            const bytes = @max(@sizeOf(Node(width)), @sizeOf(TrianglePack(width)));
            comptime var at = 0;
            inline while (at < bytes) : (at += cache_line_bytes) @prefetch(start + at, .{});
        }
    };
}

/// The tree in the width of the variant that traces it.
pub const AnyTree = union(enum) {
    w4: Tree(4),
    w8: Tree(8),
    w16: Tree(16),

    /// The tree of the given width. Asserts that it has this width.
    pub fn get(tree: *const AnyTree, comptime width: comptime_int) *const Tree(width) {
        return switch (width) {
            4 => &tree.w4,
            8 => &tree.w8,
            16 => &tree.w16,
            else => @compileError("trees are 4, 8 or 16 wide"),
        };
    }
};

/// Three corners and a material; its index in `Geometry.triangles` is the primitive number, unless
/// instances share meshes. One that has no area or no finite place is dropped: it keeps its number,
/// but the tree lacks it.
pub const Triangle = extern struct {
    /// Indices into `Geometry.positions` and the other arrays by vertex, counter-clockwise in
    /// front.
    corner: [3]u32,
    /// Index into `Materials.all`; `none` if the triangle is dropped.
    material: u32,

    /// Whether no ray can meet it.
    pub inline fn isDropped(triangle: *const Triangle) bool {
        return triangle.material == none;
    }

    comptime {
        assert(@sizeOf(Triangle) == 16);
    }
};

/// A sphere that stands for a point, or for an end of a line.
pub const Sphere = struct {
    /// Index into `Geometry.positions`.
    center: u32,
    /// Index into `Materials.all`; `none` if it has no finite place.
    material: u32,
};

/// Facts about the tree, for the report.
pub const TreeStatistics = struct {
    node_count: u32,
    /// Levels of nodes, 1 for a root alone, 0 without triangles.
    depth: u32,
    /// Expected cost of a random ray: node visits plus packs tested, weighted by area over
    /// the root's.
    sah_cost: f64,
    /// Nodes and triangle packs.
    bytes: u64,
};

/// Sets of texture coordinates at most.
pub const texcoord_set_count = 4;

/// Rays start from points and spots as long as padding there is less than this part of the scene.
const source_shift_max = 0x1p-10;

/// What there is to hit: a function of the scene's meshes and their pose.
pub const Geometry = struct {
    tree: AnyTree,
    /// By vertex, world space.
    positions: []const Vec3,
    /// By vertex, not normalised; a zero normal stands for the triangle's own. Same length.
    normals: []const Vec3,
    /// By vertex, linear RGBA; empty where no mesh has colours.
    colors: []const [4]f32,
    /// By set and vertex; a set that no material looks up is empty.
    texcoords: [texcoord_set_count][]const [2]f32 = @splat(&.{}),
    /// By vertex: a tangent in world space, not normalised, zero where there is none, and the sign
    /// of the bitangent cross(normal, tangent); empty where no material has a normal texture.
    tangents: []const [4]f32 = &.{},
    triangles: []const Triangle,
    /// How many of the triangles are dropped.
    dropped_count: u32 = 0,
    /// How many triangles are of surfaces; those behind them are of points and lines.
    surface_count: u32 = none,
    /// Of points and lines, all with the same radius in metres.
    spheres: []const Sphere = &.{},
    sphere_radius: f32 = 0,
    /// Instances that are not flattened, whose triangles and vertices are not in the arrays above.
    shared: instances.Shared = .{},
    /// A thread's own, `ClusterCache` in the width of the tree; a must where there are such.
    cluster_cache: ?*const anyopaque = null,
    /// Box of the corners of triangles that are not dropped, empty without any.
    bounds: Box3,
    /// Box of twice the centroids of the triangles' boxes, empty without any.
    centroid_bounds: Box3,
    /// By how much boxes and rays are grown.
    padding: Padding,
    /// The largest distance between quartiles of the vertices along an axis, in metres: how large
    /// most of the scene is.
    size: f32,

    /// How many triangles are not of points and lines, those of instances counted.
    pub fn surfaceCount(geometry: *const Geometry) u32 {
        if (geometry.shared.runs.len > 0) return geometry.shared.primitive_count;
        return @intCast(@min(geometry.triangles.len, geometry.surface_count));
    }

    /// How many triangles there are, those of instances counted.
    pub fn triangleCount(geometry: *const Geometry) usize {
        if (geometry.shared.runs.len > 0) return geometry.shared.primitive_count;
        return geometry.triangles.len;
    }

    /// How many vertices there are, those of instances counted.
    pub fn vertexCount(geometry: *const Geometry) usize {
        if (geometry.shared.runs.len > 0) return geometry.shared.vertex_count;
        return geometry.positions.len;
    }

    /// Whether rounding at a position is so large that rays to a light there start at the receiver.
    pub fn isCoarseAt(geometry: *const Geometry, position: Vec3) bool {
        const shift = geometry.padding.ofBox(.{ .lower = position, .upper = position });
        return shift > geometry.size * source_shift_max;
    }

    /// Whether any vertex has a colour.
    pub inline fn hasColors(geometry: *const Geometry) bool {
        return geometry.colors.len > 0 or geometry.shared.has_colors;
    }

    /// Whether textures want tangents.
    pub inline fn hasTangents(geometry: *const Geometry) bool {
        return geometry.tangents.len > 0 or geometry.shared.has_tangents;
    }

    /// A triangle by its number.
    pub inline fn face(geometry: *const Geometry, primitive: u32) Face {
        if (geometry.shared.runs.len == 0) return .of(&geometry.triangles[primitive]);
        return geometry.shared.face(geometry, primitive);
    }

    /// Without anything to hit, and without a tree.
    pub const empty: Geometry = .{
        .tree = .{ .w4 = .{ .nodes = &.{}, .packs = &.{} } },
        .positions = &.{},
        .normals = &.{},
        .colors = &.{},
        .triangles = &.{},
        .bounds = .empty,
        .centroid_bounds = .empty,
        .padding = .init(@splat(0), .empty),
        .size = 0,
    };
};

test "an empty child's box is empty" {
    const node: Node(4) = .empty;
    for (0..4) |child| try std.testing.expect(node.childBox(child).isEmpty());
}
