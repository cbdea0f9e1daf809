//! Rays of paths and of lights, recorded by what they are for.
//!
//! In: a picture's `Setup`, a tracer of single rays. Out: sets of rays in bundles of 16x16 that
//! every traversal can trace. Paths are those of a path tracer whose surfaces are all diffuse: a
//! direction by the cosine at each hit, one shadow ray to a lamp of some size and one to the sky.
//! What `lights` traces are shadow rays of what is seen: of one light a bundle, of neighbouring
//! pixels or of every third one (Keller and Heidrich 2001, Interleaved Sampling, section 4).
//! Numbers are plain float arithmetic: the rays have the same bits on every machine.

const std = @import("std");
const raylane = @import("raylane");
const batch_file = @import("../rays/batch.zig");
const workload = @import("../rays/workload.zig");
const Light = raylane.world.Light;
const Query = raylane.trace.walk.Query;
const Setup = workload.Setup;
const Vec3 = raylane.math.Vec3;
const vec3 = raylane.math.vec3;
const side = batch_file.side;

/// Pixels of one out of so many, along each axis, see the same lights where these are interleaved.
pub const interleave = 3;
/// Pixels along a side of what is recorded in one piece.
pub const block_side = interleave * side;
const tiles_per_block = interleave * interleave;
/// Virtual point lights whose rays are recorded.
const point_light_count = 4;
/// Radius of the lamp, over the diagonal of the scene.
const lamp_radius_relative = 0.02;
/// Towards the sun.
const sun: Vec3 = .{ 0.28, 0.92, 0.27 };

/// One ray; none where `limit` is 0.
pub const Course = struct {
    origin: Vec3,
    direction: Vec3,
    /// In units of the direction.
    limit: f32,

    pub const none: Course = .{ .origin = @splat(0), .direction = @splat(1), .limit = 0 };
};

/// Rays of a square of pixels, row by row.
pub const Bundle = [batch_file.ray_count]Course;

/// What the rays of a bundle have in common, so that they can go as a beam; one for each bundle.
pub const Common = union(enum) {
    nothing,
    eye: []const raylane.trace.Grid,
    light: []const Light,
};

/// How rays are put into bundles: by pixel, or all that there are sorted (sort.zig), or so many at
/// a time.
pub const Order = enum { pixels, interleaved, sorted_4096, sorted_all };

/// Rays for one purpose.
pub const Set = struct {
    /// What they are for: `primary`, `bounce`, `lamp`, `sky`, `sun` or `point`.
    name: []const u8,
    /// Bounces before them.
    depth: u32,
    query: Query,
    order: Order = .pixels,
    common: Common = .nothing,
    bundles: []const Bundle,

    /// Rays in all bundles.
    pub fn rayCount(set: *const Set) u64 {
        var count: u64 = 0;
        for (set.bundles) |*bundle| for (bundle) |*course| {
            count += @intFromBool(course.limit > 0);
        };
        return count;
    }
};

/// What was hit.
pub const Hit = struct { primitive: u32, t: f32 };

/// What to record.
pub const Settings = struct {
    /// Of the blocks along each axis every `stride`-th is.
    stride: u32,
    /// Bounces.
    depth_max: u32,
    /// Diagonal of the scene, in metres.
    diagonal: f32,
};

/// Records all sets in `arena`. `closestHit` is a function of a context and a ray.
pub fn record(
    arena: std.mem.Allocator,
    setup: *const Setup,
    settings: Settings,
    context: anytype,
    comptime closestHit: fn (@TypeOf(context), *const Course) ?Hit,
) error{OutOfMemory}![]const Set {
    var sets: std.ArrayList(Set) = .empty;
    const corners = try tileCorners(arena, setup.size, settings.stride);
    const seen = try arena.alloc(Seen, corners.len);
    const grids = try arena.alloc(raylane.trace.Grid, corners.len);
    var courses = try arena.alloc(Bundle, corners.len);
    for (courses, grids, corners) |*bundle, *grid, corner| grid.* = eyeRays(setup, corner, bundle);
    const lamp_radius = lamp_radius_relative * settings.diagonal;

    for (0..settings.depth_max + 1) |depth| {
        const vertices = if (depth == 0) seen else try arena.alloc(Seen, corners.len);
        for (vertices, courses) |*all, *bundle| for (all, bundle) |*vertex, *course| {
            const hit = if (course.limit > 0) closestHit(context, course) else null;
            vertex.* = if (hit) |found| .of(setup, course, found) else null;
        };
        var set: Set = .{
            .name = if (depth == 0) "primary" else "bounce",
            .depth = @intCast(depth),
            .query = .closest_hit,
            .common = if (depth == 0) .{ .eye = grids } else .nothing,
            .bundles = courses,
        };
        try sets.append(arena, set);
        const next = try leave(arena, setup, corners, vertices, depth, lamp_radius);
        set.query = .any_hit;
        set.common = .nothing;
        inline for (.{ "lamp", "sky" }) |name| {
            set.name = name;
            set.bundles = @field(next, name);
            try sets.append(arena, set);
        }
        courses = next.bounce;
    }
    const lights = try pointLights(arena, seen);
    for ([_]Order{ .pixels, .interleaved }) |order| {
        try sets.append(arena, try lightSet(arena, &.{sunLight()}, "sun", order, seen));
        try sets.append(arena, try lightSet(arena, lights, "point", order, seen));
    }
    return sets.items;
}

/// The rays that leave vertices, by tile.
const Leaving = struct { lamp: []Bundle, sky: []Bundle, bounce: []Bundle };

fn leave(
    arena: std.mem.Allocator,
    setup: *const Setup,
    corners: []const [2]u32,
    vertices: []const Seen,
    depth: usize,
    lamp_radius: f32,
) error{OutOfMemory}!Leaving {
    var leaving: Leaving = undefined;
    inline for (.{ "lamp", "sky", "bounce" }) |name| {
        const bundles = try arena.alloc(Bundle, corners.len);
        for (bundles) |*bundle| bundle.* = @splat(.none);
        @field(leaving, name) = bundles;
    }
    for (vertices, corners, 0..) |*all, corner, tile| for (all, 0..) |maybe, index| {
        const vertex = maybe orelse continue;
        const pixel = (corner[1] + index / side) * setup.size + corner[0] + index % side;
        var numbers: Numbers = .of(pixel, depth);
        const place = vec3.add(setup.light, vec3.scale(numbers.unitVector(), lamp_radius));
        leaving.lamp[tile][index] = vertex.towards(place);
        leaving.sky[tile][index] = vertex.along(numbers.cosineVector(vertex.normal));
        leaving.bounce[tile][index] = vertex.along(numbers.cosineVector(vertex.normal));
    };
    return leaving;
}

/// First pixels of the tiles of every `stride`-th block, block by block.
fn tileCorners(
    arena: std.mem.Allocator,
    size: u32,
    stride: u32,
) error{OutOfMemory}![]const [2]u32 {
    var corners: std.ArrayList([2]u32) = .empty;
    const blocks = size / block_side;
    var row = stride / 2 % blocks;
    while (row < blocks) : (row += stride) {
        var column = stride / 2 % blocks;
        while (column < blocks) : (column += stride) for (0..tiles_per_block) |tile| {
            const x = column * block_side + tile % interleave * side;
            const y = row * block_side + tile / interleave * side;
            try corners.append(arena, .{ @intCast(x), @intCast(y) });
        };
    }
    return corners.items;
}

/// Rays through the middles of a tile's pixels, as `workload.zig` has them.
fn eyeRays(setup: *const Setup, corner: [2]u32, bundle: *Bundle) raylane.trace.Grid {
    const x: f32 = @floatFromInt(corner[0]);
    const y: f32 = @floatFromInt(corner[1]);
    const offset = vec3.add(vec3.scale(setup.across, x), vec3.scale(setup.down, y));
    const first = vec3.add(setup.corner, offset);
    for (bundle, 0..) |*course, index| {
        const across = vec3.scale(setup.across, @floatFromInt(index % side));
        const down = vec3.scale(setup.down, @floatFromInt(index / side));
        course.* = .{
            .origin = setup.eye,
            .direction = vec3.add(first, vec3.add(across, down)),
            .limit = std.math.inf(f32),
        };
    }
    const size = vec3.length1(first) + vec3.length1(setup.across) + vec3.length1(setup.down);
    return .{
        .origin = setup.eye,
        .corner = first,
        .right = setup.across,
        .down = setup.down,
        .deviation_ulps = 4 * size,
    };
}

/// Where the rays of a tile hit something.
const Seen = [batch_file.ray_count]?Vertex;

/// A point off a surface, and its unit normal on the side that the ray came from.
const Vertex = struct {
    point: Vec3,
    normal: Vec3,

    fn of(setup: *const Setup, course: *const Course, hit: Hit) Vertex {
        var normal: Vec3 = setup.normals[hit.primitive + 1][0..3].*;
        if (vec3.dot(normal, course.direction) > 0) normal = vec3.neg(normal);
        const surface = vec3.add(course.origin, vec3.scale(course.direction, hit.t));
        return .{
            .point = vec3.add(surface, vec3.scale(normal, setup.offset)),
            .normal = normal,
        };
    }

    fn along(vertex: *const Vertex, direction: Vec3) Course {
        return .{
            .origin = vertex.point,
            .direction = direction,
            .limit = std.math.inf(f32),
        };
    }

    /// The shadow ray to a place, unless that is behind the surface.
    fn towards(vertex: *const Vertex, place: Vec3) Course {
        const direction = vec3.sub(place, vertex.point);
        if (!(vec3.dot(direction, vertex.normal) > 0)) return .none;
        return .{
            .origin = vertex.point,
            .direction = direction,
            .limit = workload.shadow_end,
        };
    }

    /// The shadow ray of a light that is the same for all, as `visibility.zig` has it.
    fn shadowRay(vertex: *const Vertex, light: *const Light) Course {
        if (light.kind == .directional) {
            if (!(vec3.dot(light.direction, vertex.normal) < 0)) return .none;
            return vertex.along(vec3.neg(light.direction));
        }
        const direction = vec3.sub(vertex.point, light.position);
        if (!(vec3.dot(direction, vertex.normal) < 0)) return .none;
        if (!(vec3.dot(direction, light.direction) > 0)) return .none;
        return .{
            .origin = light.position,
            .direction = direction,
            .limit = workload.shadow_end,
        };
    }
};

/// Shadow rays of each light to what is seen.
fn lightSet(
    arena: std.mem.Allocator,
    lights: []const Light,
    name: []const u8,
    order: Order,
    seen: []const Seen,
) error{OutOfMemory}!Set {
    const bundles = try arena.alloc(Bundle, seen.len * lights.len);
    const common = try arena.alloc(Light, bundles.len);
    for (bundles, common, 0..) |*bundle, *own, number| {
        const light = &lights[number / seen.len];
        own.* = light.*;
        for (bundle, 0..) |*course, index| {
            const tile, const place = source(order, number % seen.len, index);
            course.* = if (seen[tile][place]) |*vertex| vertex.shadowRay(light) else .none;
        }
    }
    return .{
        .name = name,
        .depth = 0,
        .query = .any_hit,
        .order = order,
        .common = .{ .light = common },
        .bundles = bundles,
    };
}

/// Tile and index in it of the pixel that a ray of a bundle is of.
fn source(order: Order, bundle: usize, index: usize) struct { usize, usize } {
    if (order == .pixels) return .{ bundle, index };
    const part = bundle % tiles_per_block;
    const x = index % side * interleave + part % interleave;
    const y = index / side * interleave + part / interleave;
    const first = bundle - part;
    return .{ first + y / side * interleave + x / side, y % side * side + x % side };
}

fn sunLight() Light {
    return lightOf(.directional, @splat(0), vec3.neg(vec3.normalize(sun).?));
}

/// On surfaces that are seen, facing away from them.
fn pointLights(
    arena: std.mem.Allocator,
    seen: []const Seen,
) error{OutOfMemory}![]const Light {
    var lights: std.ArrayList(Light) = .empty;
    for (0..1000) |attempt| {
        if (lights.items.len == point_light_count) break;
        var numbers: Numbers = .of(attempt, 1000);
        const index: usize = @intCast(numbers.next() % (seen.len * batch_file.ray_count));
        const vertex = seen[index / batch_file.ray_count][index % batch_file.ray_count] orelse
            continue;
        try lights.append(arena, lightOf(.point, vertex.point, vertex.normal));
    }
    return lights.items;
}

fn lightOf(kind: Light.Kind, position: Vec3, direction: Vec3) Light {
    return .{
        .kind = kind,
        .from_receiver = false,
        .position = position,
        .direction = direction,
        .intensity = .{ 1, 1, 1 },
        .range_inv_squared = 0,
        .cone_scale = 0,
        .cone_offset = 1,
    };
}

/// Random numbers of one vertex of one pixel's path.
const Numbers = struct {
    state: u64,

    fn of(pixel: usize, depth: usize) Numbers {
        return .{ .state = @as(u64, pixel) << 16 | depth };
    }

    /// SplitMix64 (Steele, Lea and Flood 2014).
    fn next(numbers: *Numbers) u64 {
        numbers.state +%= 0x9e37_79b9_7f4a_7c15;
        var bits = numbers.state;
        bits = (bits ^ bits >> 30) *% 0xbf58_476d_1ce4_e5b9;
        bits = (bits ^ bits >> 27) *% 0x94d0_49bb_1331_11eb;
        return bits ^ bits >> 31;
    }

    /// From -1 to 1.
    fn signed(numbers: *Numbers) f32 {
        const bits: i32 = @intCast(numbers.next() >> 40);
        return @as(f32, @floatFromInt(bits - (1 << 23))) * (1.0 / @as(f32, 1 << 23));
    }

    /// Of any direction, by rejection, without a sine.
    fn unitVector(numbers: *Numbers) Vec3 {
        while (true) {
            const vector: Vec3 = .{ numbers.signed(), numbers.signed(), numbers.signed() };
            const squared = vec3.dot(vector, vector);
            if (squared <= 1 and squared > 1e-4) return vec3.scale(vector, 1 / @sqrt(squared));
        }
    }

    /// A unit vector by the cosine to the normal.
    fn cosineVector(numbers: *Numbers, normal: Vec3) Vec3 {
        while (true) {
            const sum = vec3.add(normal, numbers.unitVector());
            const squared = vec3.dot(sum, sum);
            if (squared > 1e-6) return vec3.scale(sum, 1 / @sqrt(squared));
        }
    }
};
