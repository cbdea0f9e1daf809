//! Which meshes instances share, and all that is made of these: see world/instances.zig.
//!
//! In: instances and meshes as they are drawn, where the pose has them. Out: the meshes that are
//! shared, each with a tree in its own space; their instances, with the box of each cluster in
//! world space; and the other instances, which are flattened.
//!
//! Small scenes are flattened: rays get through one tree faster than through two levels of them.
//! What is shared follows from counts alone (`Rule`), and from what is drawn: a mesh is flattened
//! if it emits or bounds a volume, for whoever looks at all of these triangles; so is an instance
//! with a skin or morph targets that count, and one of which a triangle would be left out where it
//! stands. Scenes with points or lines are flattened as a whole.

const std = @import("std");
const math = @import("../math.zig");
const parallel = @import("../parallel.zig");
const scene = @import("../scene.zig");
const world = @import("../world.zig");
const clusters_file = @import("bvh/clusters.zig");
const deform = @import("deform.zig");
const flatten = @import("flatten.zig");
const join_file = @import("bvh/join.zig");
const pose_file = @import("pose.zig");
const bvh_wide = @import("bvh/wide.zig");
const Instances = @import("../settings.zig").Instances;
const TreeQuality = @import("../settings.zig").TreeQuality;
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;
const AnyTree = world.AnyTree;
const Parts = @import("alpha.zig").Parts;
const Progress = @import("../progress.zig").Progress;
const Box3 = math.Box3;
const Geometry = world.Geometry;
const Vec3 = math.Vec3;

/// When meshes are shared.
pub const Rule = struct {
    /// Triangles that it saves, at least: drawn more than once, and not held more than once.
    saved_min: u64 = 1 << 20,
    /// Triangles of a mesh, at least.
    triangle_min: u32 = 64,

    /// As a user chooses.
    pub fn of(chosen: Instances) Rule {
        return switch (chosen) {
            .auto => .{},
            .share => .{ .saved_min = 0 },
            .flatten => .never,
        };
    }

    /// Nothing is shared.
    pub const never: Rule = .{ .saved_min = std.math.maxInt(u64) };
};

/// Triangles, or vertices, that may be drawn of what is shared: beams number twice as many.
const drawn_max = flatten.element_count_max / 2;

/// How, and by whom.
pub const Settings = struct {
    rule: Rule,
    lanes: u8,
    quality: TreeQuality,
    pool: *parallel.Pool,
};

/// What is shared, and what is not.
pub const Sharing = struct {
    /// Instances that are to be flattened, in order.
    flat: []const scene.Instance,
    meshes: []const world.instances.SharedMesh = &.{},
    /// In order; `numberAll` finds out where their numbers begin.
    instances: []world.instances.Instance = &.{},
    /// By instance as drawn: its place among `instances`, or `world.none`.
    places: []const u32 = &.{},
    clusters: []const world.instances.ClusterReference = &.{},
    /// By cluster, in world space, its triangles grown by their pads.
    boxes: []const Box3 = &.{},
    bounds: Box3 = .empty,
    centroid_bounds: Box3 = .empty,
    dropped_count: u64 = 0,
    bytes: u64 = 0,
};

/// Decides, and makes what is shared. All of it comes from `arena`, what is needed meanwhile from
/// `gpa`.
pub fn share(
    gpa: Allocator,
    arena: Allocator,
    parts: *const Parts,
    attributes: flatten.Attributes,
    pose: *const pose_file.Pose,
    settings: *const Settings,
) (error{OutOfMemory} || parallel.Error)!Sharing {
    const instances = parts.instances;
    const meshes = parts.meshes;
    const all_flat: Sharing = .{ .flat = instances };
    const chosen = try gpa.alloc(bool, meshes.len);
    defer gpa.free(chosen);
    if (!try choose(gpa, parts, settings.rule, chosen)) return all_flat;
    var maker: Maker = .{
        .gpa = gpa,
        .arena = arena,
        .settings = settings,
        .padding = .init(pose_file.round(pose.center), .empty),
        .mesh_places = try gpa.alloc(u32, meshes.len),
    };
    defer maker.deinit();
    var triangle_count: u64 = 0;
    for (meshes, chosen) |*mesh, is_chosen| {
        if (is_chosen) triangle_count += mesh.triangles.len;
    }
    Progress.begin(settings.pool.progress, bvh_wide.workOf(triangle_count, settings.quality));
    for (meshes, chosen, maker.mesh_places) |*mesh, is_chosen, *place| {
        place.* = if (is_chosen) try maker.addMesh(mesh, attributes) else world.none;
    }
    if (maker.meshes.items.len == 0) return all_flat;
    try maker.placeInstances(instances, pose);
    return maker.finish(instances);
}

/// Chooses meshes by counts and materials; false: none is shared.
pub fn choose(
    gpa: Allocator,
    parts: *const Parts,
    rule: Rule,
    chosen: []bool,
) error{OutOfMemory}!bool {
    const meshes = parts.meshes;
    const counts = try gpa.alloc(u32, meshes.len);
    defer gpa.free(counts);
    @memset(counts, 0);
    var drawn: u64 = 0;
    for (parts.instances) |*instance| {
        const mesh = &meshes[instance.mesh];
        if (mesh.points.len > 0 or mesh.segments.len > 0) return false;
        drawn += @max(mesh.triangles.len, mesh.positions.len);
        if (drawn > drawn_max) return false; // `flatten` says that these are too many.
        counts[instance.mesh] += @intFromBool(isRigid(instance));
    }
    var saved: u64 = 0;
    for (meshes, counts, chosen) |*mesh, count, *is_chosen| {
        const material = &parts.materials[mesh.material];
        const emits = math.vec3.maxComponent(material.emissive) > 0;
        is_chosen.* = count > 1 and mesh.triangles.len >= rule.triangle_min and
            mesh.triangles.len > 0 and !emits and !material.volume;
        if (is_chosen.*) saved += @as(u64, count - 1) * mesh.triangles.len;
    }
    return saved > 0 and saved >= rule.saved_min;
}

fn isRigid(instance: *const scene.Instance) bool {
    return instance.skin == scene.none and !deform.isMorphed(instance.morph_weights);
}

/// Whether a triangle has two corners in one place: nowhere has it an area.
fn isCollapsed(positions: []const Vec3, corners: [3]u32) bool {
    const a = positions[corners[0]];
    const b = positions[corners[1]];
    const c = positions[corners[2]];
    return std.meta.eql(a, b) or std.meta.eql(b, c) or std.meta.eql(c, a);
}

/// The triangles of a mesh by its vertices from `first` on. Returns how many are not dropped, whose
/// numbers go to `kept`.
fn copyTriangles(
    mesh: *const scene.Mesh,
    first: u32,
    triangles: []world.Triangle,
    kept: []u32,
) usize {
    var count: usize = 0;
    for (mesh.triangles, triangles, 0..) |corners, *triangle, number| {
        const is_dropped = isCollapsed(mesh.positions, corners);
        triangle.* = .{
            .corner = .{ corners[0] - first, corners[1] - first, corners[2] - first },
            .material = if (is_dropped) world.none else mesh.material,
        };
        if (is_dropped) continue;
        kept[count] = @intCast(number);
        count += 1;
    }
    return count;
}

/// Clusters that a thread takes at a time.
const chunk_size = 64;

/// Some clusters of an instance.
const Task = struct {
    instance: u32,
    cluster_first: u32,
    cluster_count: u32,
    box_first: u32,
    /// What came of it.
    bounds: Box3 = .empty,
    centroid_bounds: Box3 = .empty,
    drops: bool = false,
};

const Maker = struct {
    gpa: Allocator,
    arena: Allocator,
    settings: *const Settings,
    padding: world.Padding,
    /// By mesh, its place among those that are shared, or `world.none`.
    mesh_places: []u32,
    meshes: std.ArrayList(world.instances.SharedMesh) = .empty,
    /// Of each, triangles that are nowhere.
    collapsed: std.ArrayList(u32) = .empty,
    instances: std.ArrayList(world.instances.Instance) = .empty,
    tasks: std.ArrayList(Task) = .empty,
    boxes: []Box3 = &.{},
    dropping: []bool = &.{},
    bytes: u64 = 0,

    fn deinit(maker: *Maker) void {
        const gpa = maker.gpa;
        gpa.free(maker.mesh_places);
        gpa.free(maker.boxes);
        gpa.free(maker.dropping);
        inline for (.{ "meshes", "collapsed", "instances", "tasks" }) |name| {
            @field(maker, name).deinit(gpa);
        }
    }

    /// Copies a mesh and builds the tree over it. Returns its place, or `world.none` where it
    /// cannot be shared.
    fn addMesh(
        maker: *Maker,
        mesh: *const scene.Mesh,
        attributes: flatten.Attributes,
    ) (error{OutOfMemory} || parallel.Error)!u32 {
        const arena = maker.arena;
        const range: flatten.VertexRange = .of(mesh);
        const source = mesh.positions[range.first..][0..range.count];
        var bounds: Box3 = .empty;
        for (source) |position| bounds = bounds.include(position);
        if (!flatten.isWithinRange(bounds.lower, bounds.upper, bounds.upper)) return world.none;
        const triangles = try maker.arena.alloc(world.Triangle, mesh.triangles.len);
        const kept = try maker.gpa.alloc(u32, mesh.triangles.len);
        defer maker.gpa.free(kept);
        const kept_count = copyTriangles(mesh, range.first, triangles, kept);
        if (kept_count == 0) return world.none;
        var shared: world.instances.SharedMesh = .{
            .positions = try arena.dupe(Vec3, source),
            .normals = try copyOf(arena, Vec3, mesh.normals, range),
            .colors = try copyOf(arena, [4]f32, mesh.colors, range),
            .texcoords = @splat(&.{}),
            .tangents = if (attributes.tangents)
                try copyOf(arena, [4]f32, mesh.tangents, range)
            else
                &.{},
            .triangles = triangles,
            .tree = undefined,
            .clusters = undefined,
        };
        for (&shared.texcoords, mesh.texcoords, attributes.texcoord_sets) |*to, set, is_used| {
            if (is_used) to.* = try copyOf(arena, [2]f32, set, range);
        }
        try maker.buildTree(&shared, bounds, kept[0..kept_count]);
        try maker.meshes.append(maker.gpa, shared);
        try maker.collapsed.append(maker.gpa, @intCast(mesh.triangles.len - kept_count));
        return @intCast(maker.meshes.items.len - 1);
    }

    fn buildTree(
        maker: *Maker,
        mesh: *world.instances.SharedMesh,
        bounds: Box3,
        kept: []const u32,
    ) (error{OutOfMemory} || parallel.Error)!void {
        var centroid_bounds: Box3 = .empty;
        for (kept) |number| {
            var box: Box3 = .empty;
            for (mesh.triangles[number].corner) |vertex| {
                box = box.include(mesh.positions[vertex]);
            }
            centroid_bounds = centroid_bounds.include(box.centerTwice());
        }
        const input: bvh_wide.Input = .{
            .positions = mesh.positions,
            .triangles = mesh.triangles,
            .kept = kept,
            .centroid_bounds = centroid_bounds,
            .padding = .init(@splat(0), bounds),
            .pool = maker.settings.pool,
            .quality = maker.settings.quality,
        };
        switch (maker.settings.lanes) {
            inline 4, 8, 16 => |width| {
                const built = try bvh_wide.build(maker.gpa, maker.arena, &input, width);
                const tree = built.tree();
                mesh.clusters = try clusters_file.cut(maker.gpa, maker.arena, width, &tree);
                mesh.tree = @unionInit(AnyTree, std.fmt.comptimePrint("w{d}", .{width}), tree);
                maker.bytes += built.statistics.bytes;
            },
            else => unreachable, // Asserted at the door.
        }
    }

    /// Maps every cluster of every instance once, for its box and for what it would drop.
    fn placeInstances(
        maker: *Maker,
        instances: []const scene.Instance,
        pose: *const pose_file.Pose,
    ) (error{OutOfMemory} || parallel.Error)!void {
        const gpa = maker.gpa;
        var box_count: u64 = 0;
        for (instances) |*instance| {
            const mesh = maker.mesh_places[instance.mesh];
            if (mesh == world.none or !isRigid(instance)) continue;
            const map = pose.maps[instance.node];
            const number: u32 = @intCast(maker.instances.items.len);
            try maker.instances.append(gpa, .{
                .mesh = mesh,
                .primitive_first = 0,
                .vertex_first = 0,
                .placement = .of(map, map.determinant() < 0),
            });
            const clusters: u32 = @intCast(maker.meshes.items[mesh].clusters.len);
            var first: u32 = 0;
            while (first < clusters) : (first += chunk_size) {
                const count = @min(clusters - first, chunk_size);
                try maker.tasks.append(gpa, .{
                    .instance = number,
                    .cluster_first = first,
                    .cluster_count = count,
                    .box_first = @intCast(box_count),
                });
                box_count += count;
                if (box_count > flatten.element_count_max) return error.OutOfMemory;
            }
        }
        maker.boxes = try gpa.alloc(Box3, @intCast(box_count));
        switch (maker.settings.lanes) {
            inline 4, 8, 16 => |width| {
                const each = struct {
                    fn measure(owner: *Maker, index: usize, _: usize) void {
                        owner.measure(width, &owner.tasks.items[index]);
                    }
                };
                try maker.settings.pool.forEach(maker.tasks.items.len, maker, each.measure);
            },
            else => unreachable,
        }
        maker.dropping = try gpa.alloc(bool, maker.instances.items.len);
        @memset(maker.dropping, false);
        for (maker.tasks.items) |*task| {
            if (task.drops) maker.dropping[task.instance] = true;
        }
    }

    fn measure(maker: *Maker, comptime width: u32, task: *Task) void {
        const instance = &maker.instances.items[task.instance];
        const mesh = &maker.meshes.items[instance.mesh];
        const tree = mesh.tree.get(width);
        const clusters = mesh.clusters[task.cluster_first..][0..task.cluster_count];
        for (clusters, maker.boxes[task.box_first..][0..clusters.len]) |*cluster, *box| {
            box.* = .empty;
            const packs = tree.packs[cluster.pack_first..][0..cluster.pack_count];
            for (packs) |*pack| {
                var mapped: world.TrianglePack(width) = undefined;
                world.instances.mapPack(width, pack, &instance.placement, 0, &mapped);
                box.* = box.join(world.instances.packBox(width, &maker.padding, &mapped));
                measurePack(width, &mapped, task);
            }
        }
    }

    /// By what `flatten` measures.
    fn measurePack(comptime width: u32, pack: *const world.TrianglePack(width), task: *Task) void {
        for (pack.primitive, 0..) |primitive, lane| {
            if (primitive == world.none) break;
            var corners: [3]Vec3 = undefined;
            for (&corners, &pack.corner) |*corner, *from| {
                corner.* = .{ from[0][lane], from[1][lane], from[2][lane] };
            }
            const a, const b, const c = corners;
            if (!flatten.isWithinRange(a, b, c) or !flatten.hasArea(a, b, c)) task.drops = true;
            const box = Box3.empty.include(a).include(b).include(c);
            task.bounds = task.bounds.join(box);
            task.centroid_bounds = task.centroid_bounds.include(box.centerTwice());
        }
    }

    /// What is left when instances are flattened that drop triangles.
    fn finish(maker: *Maker, instances: []const scene.Instance) error{OutOfMemory}!Sharing {
        const arena = maker.arena;
        var flat: std.ArrayList(scene.Instance) = .empty;
        const places = try arena.alloc(u32, instances.len);
        var kept: std.ArrayList(world.instances.Instance) =
            try .initCapacity(arena, maker.instances.items.len);
        const numbers = try maker.gpa.alloc(u32, maker.instances.items.len);
        defer maker.gpa.free(numbers);
        var sharing: Sharing = .{ .flat = &.{}, .bytes = maker.bytes };
        var next: usize = 0;
        for (instances, places) |*instance, *place| {
            place.* = world.none;
            const mesh = maker.mesh_places[instance.mesh];
            if (mesh == world.none or !isRigid(instance)) {
                try flat.append(arena, instance.*);
                continue;
            }
            defer next += 1;
            numbers[next] = world.none;
            if (maker.dropping[next]) {
                try flat.append(arena, instance.*);
                continue;
            }
            place.* = @intCast(kept.items.len);
            numbers[next] = place.*;
            sharing.dropped_count += maker.collapsed.items[mesh];
            kept.appendAssumeCapacity(maker.instances.items[next]);
        }
        if (kept.items.len == 0) return .{ .flat = instances };
        try maker.keepBoxes(numbers, &sharing);
        sharing.flat = flat.items;
        sharing.meshes = try arena.dupe(world.instances.SharedMesh, maker.meshes.items);
        sharing.instances = kept.items;
        sharing.places = places;
        return sharing;
    }

    fn keepBoxes(maker: *Maker, numbers: []const u32, sharing: *Sharing) error{OutOfMemory}!void {
        var count: usize = 0;
        for (maker.tasks.items) |*task| {
            if (numbers[task.instance] != world.none) count += task.cluster_count;
        }
        const boxes = try maker.arena.alloc(Box3, count);
        const clusters = try maker.arena.alloc(world.instances.ClusterReference, count);
        var at: usize = 0;
        for (maker.tasks.items) |*task| {
            const number = numbers[task.instance];
            if (number == world.none) continue;
            for (0..task.cluster_count) |index| {
                boxes[at] = maker.boxes[task.box_first + index];
                clusters[at] = .{
                    .instance = number,
                    .cluster = task.cluster_first + @as(u32, @intCast(index)),
                };
                at += 1;
            }
            sharing.bounds = sharing.bounds.join(task.bounds);
            sharing.centroid_bounds = sharing.centroid_bounds.join(task.centroid_bounds);
        }
        sharing.boxes = boxes;
        sharing.clusters = clusters;
    }
};

fn copyOf(
    arena: Allocator,
    comptime T: type,
    list: ?[]const T,
    range: flatten.VertexRange,
) error{OutOfMemory}![]const T {
    const all = list orelse return &.{};
    return arena.dupe(T, all[range.first..][0..range.count]);
}

/// Numbers everything as if it were flattened: `soup` is what became of `sharing.flat`.
pub fn numberAll(
    gpa: Allocator,
    arena: Allocator,
    sharing: *const Sharing,
    parts: *const Parts,
    soup: *const flatten.TriangleSoup,
    attributes: flatten.Attributes,
) error{OutOfMemory}!world.instances.Shared {
    if (sharing.instances.len == 0) return .{};
    const meshes = parts.meshes;
    const vertex_counts = try gpa.alloc(?u32, meshes.len);
    defer gpa.free(vertex_counts);
    @memset(vertex_counts, null);
    var runs: std.ArrayList(world.instances.Run) = .empty;
    var shared: world.instances.Shared = .{
        .meshes = sharing.meshes,
        .instances = sharing.instances,
        .clusters = sharing.clusters,
        .has_tangents = attributes.tangents,
        .has_colors = soup.colors.len > 0,
    };
    var triangle_next: u32 = 0;
    var vertex_end: u32 = 0;
    var vertex_next: u32 = 0;
    for (parts.instances, sharing.places) |*instance, place| {
        if (place == world.none) {
            const count = &vertex_counts[instance.mesh];
            if (count.* == null) count.* = flatten.VertexRange.of(&meshes[instance.mesh]).count;
            vertex_end += count.*.?;
            continue;
        }
        const triangle_end = firstBehind(soup.triangles, vertex_end);
        try addFlat(arena, &shared, &runs, &triangle_next, &vertex_next, triangle_end, vertex_end);
        const to = &sharing.instances[place];
        const mesh = &sharing.meshes[to.mesh];
        to.primitive_first = shared.primitive_count;
        to.vertex_first = shared.vertex_count;
        try runs.append(arena, .{
            .primitive_first = to.primitive_first,
            .vertex_first = to.vertex_first,
            .instance = place,
            .triangle_first = 0,
            .position_first = 0,
        });
        shared.primitive_count += @intCast(mesh.triangles.len);
        shared.vertex_count += @intCast(mesh.positions.len);
        if (mesh.colors.len > 0) shared.has_colors = true;
    }
    const triangle_end: u32 = @intCast(soup.triangles.len);
    try addFlat(arena, &shared, &runs, &triangle_next, &vertex_next, triangle_end, vertex_end);
    shared.runs = runs.items;
    var flat_runs: std.ArrayList(u32) = .empty;
    for (runs.items, 0..) |*run, index| {
        if (run.instance == world.none) try flat_runs.append(arena, @intCast(index));
    }
    shared.flat_runs = flat_runs.items;
    return shared;
}

/// Appends the flattened triangles and vertices up to these ends, if there are any.
fn addFlat(
    arena: Allocator,
    shared: *world.instances.Shared,
    runs: *std.ArrayList(world.instances.Run),
    triangle_next: *u32,
    vertex_next: *u32,
    triangle_end: u32,
    vertex_end: u32,
) error{OutOfMemory}!void {
    if (vertex_end == vertex_next.*) return;
    try runs.append(arena, .{
        .primitive_first = shared.primitive_count,
        .vertex_first = shared.vertex_count,
        .instance = world.none,
        .triangle_first = triangle_next.*,
        .position_first = vertex_next.*,
    });
    shared.primitive_count += triangle_end - triangle_next.*;
    shared.vertex_count += vertex_end - vertex_next.*;
    triangle_next.* = triangle_end;
    vertex_next.* = vertex_end;
}

/// The first triangle whose vertices are not before `vertex`: they are in the order of instances.
fn firstBehind(triangles: []const world.Triangle, vertex: u32) u32 {
    return @intCast(std.sort.partitionPoint(world.Triangle, triangles, vertex, isBefore));
}

fn isBefore(vertex: u32, triangle: world.Triangle) bool {
    return triangle.corner[0] < vertex;
}

/// Numbers the triangles of the packs of a tree over the flattened ones.
pub fn renumber(
    comptime width: u32,
    tree: *const world.Tree(width),
    geometry: *const Geometry,
) void {
    for (@constCast(tree.packs)) |*pack| for (&pack.primitive) |*primitive| {
        if (primitive.* != world.none) primitive.* = geometry.shared.numberOf(primitive.*);
    };
}
