//! Beams against brute force: their filter must never decide otherwise than the exact test.
//!
//! Tiles of primary rays that look at nasty triangles, from far, from near, within their planes;
//! shadow rays from what they see to a point light and along a directional one; and rays that start
//! on a plane between, as a mirror makes them. Every hit is compared, to the bit.

const std = @import("std");
const fixture = @import("fixture.zig");
const soup_file = @import("soup.zig");
const raylane = @import("raylane");
const World = raylane.world.World;
const Light = raylane.world.Light;
const Grid = raylane.trace.Grid;
const Hit = soup_file.Hit;
const Query = soup_file.Query;
const ray_file = raylane.trace.ray;
const gpa = std.testing.allocator;

const side = raylane.trace.kernel.beam_side;
const inf = std.math.inf(f32);
const Directions = [side][side][3]f32;
const Hits = [side][side]Hit;

/// Some pixels have no ray, as at the border of a picture.
fn isActive(x: usize, y: usize) bool {
    return x < side - 1 and (x + 3 * y) % 23 != 4;
}

/// A tile that looks from `origin` to `target`; neighbouring rays differ by `step` of the way.
pub fn aim(origin: [3]f32, target: [3]f32, step: f32, random: std.Random) Grid {
    const vec3 = raylane.math.vec3;
    const forward = vec3.sub(target, origin);
    const length = @sqrt(vec3.dot(forward, forward));
    var right: [3]f32 = undefined;
    for (&right) |*x| x.* = random.floatNorm(f32);
    right = vec3.cross(right, forward);
    right = vec3.scale(right, step * length / @sqrt(vec3.dot(right, right)));
    var down = vec3.cross(forward, right);
    down = vec3.scale(down, step * length / @sqrt(vec3.dot(down, down)));
    const half = (side - 1.0) / 2.0;
    const corner = vec3.sub(vec3.sub(forward, vec3.scale(right, half)), vec3.scale(down, half));
    var size: f32 = 0;
    for (corner ++ right ++ down) |x| size += @abs(x);
    return .{
        .origin = origin,
        .corner = corner,
        .right = right,
        .down = down,
        .deviation_ulps = 40 * size,
    };
}

fn directionsOf(grid: *const Grid) Directions {
    var directions: Directions = undefined;
    for (&directions, 0..) |*row, y| for (row, 0..) |*direction, x| {
        for (direction, grid.corner, grid.right, grid.down) |*to, corner, right, down| {
            to.* = corner + right * @as(f32, @floatFromInt(x)) + down * @as(f32, @floatFromInt(y));
        }
    };
    return directions;
}

/// Rays of a beam, pixel by pixel.
fn bundleOf(
    comptime Kernel: type,
    queries: *const [side][side]?Query,
) raylane.trace.bundle.Bundle(Kernel) {
    const count = Kernel.ray_count;
    var bundle: raylane.trace.bundle.Bundle(Kernel) = undefined;
    for (&bundle.groups, 0..) |*group, index| {
        var origin: [3][count]f32 = @splat(@splat(0));
        var direction: [3][count]f32 = @splat(@splat(0));
        var t_max: [count]f32 = @splat(0);
        var tnear: [count]f32 = @splat(0);
        var tnear_primitive: [count]i32 = @splat(0);
        var skip: [count]i32 = @splat(ray_file.no_primitive);
        var active: [count]bool = @splat(false);
        for (0..count) |lane| {
            const x = Kernel.pixelX(index, lane);
            const query = queries[Kernel.pixelY(index, lane)][x] orelse continue;
            active[lane] = true;
            for (0..3) |axis| {
                origin[axis][lane] = query.origin[axis];
                direction[axis][lane] = query.direction[axis];
            }
            t_max[lane] = query.t_max;
            tnear[lane] = query.tnear.t;
            tnear_primitive[lane] = query.tnear.primitive;
            skip[lane] = query.skip;
        }
        group.* = .{
            .line = .init(vectors(Kernel, origin), vectors(Kernel, direction)),
            .tnear = .{ .t = .fromArray(tnear), .primitive = .fromArray(tnear_primitive) },
            .closest = .before(.fromArray(t_max)),
            .skip = .fromArray(skip),
            .active = .fromArray(active),
        };
    }
    return bundle;
}

fn vectors(comptime Kernel: type, v: [3][Kernel.ray_count]f32) Kernel.Rays.Vec3 {
    return .{ .x = .fromArray(v[0]), .y = .fromArray(v[1]), .z = .fromArray(v[2]) };
}

fn hitsOf(world: *const World, queries: *const [side][side]?Query) Hits {
    var hits: Hits = undefined;
    for (&hits, queries) |*row, queries_row| for (row, queries_row) |*hit, query| {
        if (query) |asked| hit.* = soup_file.bruteForce(world, asked);
    };
    return hits;
}

/// One tile by one variant: primary rays, then shadow rays to both kinds of light.
pub fn expectTile(
    comptime Kernel: type,
    world: *const World,
    grid: *const Grid,
    light: [3]f32,
) !void {
    const directions = directionsOf(grid);
    var queries: [side][side]?Query = @splat(@splat(null));
    for (&queries, directions, 0..) |*row, ways, y| for (row, ways, 0..) |*query, way, x| {
        if (isActive(x, y)) query.* = .{ .origin = grid.origin, .direction = way };
    };
    const hits = hitsOf(world, &queries);
    var bundle = bundleOf(Kernel, &queries);
    var counts: raylane.statistics.TestCounts = .{};
    const searches = raylane.trace.searchesOf(Kernel);
    const traced = searches.beam_closest.?(&world.geometry, grid, &bundle, &counts);
    try std.testing.expect(traced);
    for (&bundle.groups, 0..) |*group, index| for (0..Kernel.ray_count) |lane| {
        const x = Kernel.pixelX(index, lane);
        const y = Kernel.pixelY(index, lane);
        if (queries[y][x] == null) continue;
        const t = group.closest.t.lane(lane);
        try soup_file.expectHit(hits[y][x], t, group.closest.primitive.lane(lane));
    };
    for ([_]Light.Kind{ .point, .directional }) |kind| {
        try expectShadows(Kernel, world, grid, &directions, &hits, kind, light);
    }
}

fn expectShadows(
    comptime Kernel: type,
    world: *const World,
    grid: *const Grid,
    directions: *const Directions,
    hits: *const Hits,
    kind: Light.Kind,
    place: [3]f32,
) !void {
    const vec3 = raylane.math.vec3;
    var queries: [side][side]?Query = @splat(@splat(null));
    for (&queries, directions, hits, 0..) |*row, ways, hit_row, y| {
        for (row, ways, hit_row, 0..) |*query, way, hit, x| {
            if (!isActive(x, y) or hit.primitive == ray_file.no_primitive) continue;
            const point = vec3.add(grid.origin, vec3.scale(way, hit.t));
            // Every third ray may meet the triangle that it ends or starts on.
            const skip = if (x % 3 == 0) ray_file.no_primitive else hit.primitive;
            query.* = switch (kind) {
                .directional => .{
                    .origin = point,
                    .direction = vec3.sub(place, grid.origin),
                    .skip = skip,
                },
                else => .{
                    .origin = place,
                    .direction = vec3.sub(point, place),
                    .t_max = 1,
                    .skip = skip,
                },
            };
        }
    }
    const light: Light = .{
        .kind = kind,
        .from_receiver = false,
        .position = place,
        .direction = vec3.sub(grid.origin, place),
        .intensity = .{ 1, 1, 1 },
        .range_inv_squared = 0,
        .cone_scale = 0,
        .cone_offset = 1,
    };
    const expected = hitsOf(world, &queries);
    var bundle = bundleOf(Kernel, &queries);
    var counts: raylane.statistics.TestCounts = .{};
    const searches = raylane.trace.searchesOf(Kernel);
    searches.any_hit(&world.geometry, &bundle, &light, &.all, &counts);
    for (&bundle.groups, 0..) |*group, index| for (0..Kernel.ray_count) |lane| {
        const x = Kernel.pixelX(index, lane);
        const y = Kernel.pixelY(index, lane);
        if (queries[y][x] == null) continue;
        const blocked = expected[y][x].primitive != ray_file.no_primitive;
        const found = group.closest.primitive.lane(lane) != ray_file.no_primitive;
        try std.testing.expectEqual(blocked, found);
    };
}

/// A soup, and where to look at it from.
const Stage = struct {
    generator: std.Random.DefaultPrng,
    corners: soup_file.Corners = .empty,
    center: f32,

    fn init(soup: soup_file.Soup, seed: u64, triangle_count: usize) !Stage {
        var stage: Stage = .{
            .generator = .init(seed + @backingInt(soup)),
            .center = if (soup == .far_away) 1e5 else 0,
        };
        const random = stage.generator.random();
        try soup_file.addTriangles(soup, &stage.corners, random, triangle_count);
        return stage;
    }

    fn deinit(stage: *Stage) void {
        stage.corners.deinit(gpa);
    }

    /// A corner of some triangle.
    fn target(stage: *Stage) [3]f32 {
        const corners = stage.corners.items;
        return corners[stage.generator.random().uintLessThan(usize, corners.len)];
    }

    /// Somewhere about the soup's middle.
    fn place(stage: *Stage, distance: f32) [3]f32 {
        var at: [3]f32 = undefined;
        for (&at) |*x| x.* = stage.center + stage.generator.random().floatNorm(f32) * distance;
        return at;
    }
};

fn expectSoup(soup: soup_file.Soup, triangle_count: usize, tile_count: usize) !void {
    var stage: Stage = try .init(soup, 77, triangle_count);
    defer stage.deinit();
    const random = stage.generator.random();
    var scene = try soup_file.makeScene(stage.corners.items);
    defer scene.deinit();
    const mode = raylane.simd.setFlushToZero();
    defer raylane.simd.setFloatControl(mode);
    inline for (.{ 4, 8, 16 }) |lanes| {
        if (comptime !soup_file.isCompiled(lanes)) continue;
        var world = try fixture.prepare(&scene, lanes, .{});
        defer world.deinit();
        for (0..tile_count) |tile| {
            const target = stage.target();
            var origin = stage.place(4);
            // Within a plane of coplanar triangles and faces of boxes, and aiming along it.
            if (tile % 3 == 1) origin[2] = target[2];
            var light = stage.place(5);
            if (tile % 4 == 2) light[2] = target[2];
            // As far as a lamp in the sky of a scene that is small.
            if (tile % 8 == 5) light = stage.place(65e3);
            const step: f32 = if (tile % 2 == 0) 1e-3 else 8e-3;
            const grid = aim(origin, target, step, random);
            inline for (raylane.variant.compiled) |variant| {
                if (comptime variant.lanes == lanes and variant.traversal == .beam) {
                    const Kernel = raylane.trace.kernel.Kernel(variant, false);
                    try expectTile(Kernel, &world, &grid, light);
                }
            }
        }
    }
}

test "beams find the hits and shadows of brute force in random and nasty soups" {
    for (std.enums.values(soup_file.Soup)) |soup| {
        expectSoup(soup, 100, fixture.enough(8)) catch |err| {
            std.debug.print("in the soup {t}\n", .{soup});
            return err;
        };
    }
}

test "a tile too wide for a beam is declined" {
    var generator = std.Random.DefaultPrng.init(3);
    var corners: soup_file.Corners = .empty;
    defer corners.deinit(gpa);
    try soup_file.addTriangles(.uniform, &corners, generator.random(), 4);
    var scene = try soup_file.makeScene(corners.items);
    defer scene.deinit();
    inline for (raylane.variant.compiled) |variant| {
        if (comptime variant.traversal != .beam) continue;
        const Kernel = raylane.trace.kernel.Kernel(variant, false);
        var world = try fixture.prepare(&scene, variant.lanes, .{});
        defer world.deinit();
        const grid = aim(.{ 0, 0, 7 }, .{ 0, 0, 0 }, 0.1, generator.random());
        var bundle: raylane.trace.bundle.Bundle(Kernel) = undefined;
        var counts: raylane.statistics.TestCounts = .{};
        const searches = raylane.trace.searchesOf(Kernel);
        const traced = searches.beam_closest.?(&world.geometry, &grid, &bundle, &counts);
        try std.testing.expect(!traced);
    }
}
