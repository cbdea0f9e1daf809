//! Traversal against brute force, on triangles as nasty as they come.
//!
//! For every ray the hit found by testing all triangles one by one must be found by single rays and
//! by packets, to the bit, in every backend and width: nothing else makes culling and order of
//! visits invisible. And a closed surface must stop every ray aimed at its seams.

const std = @import("std");
const fixture = @import("fixture.zig");
const raylane = @import("raylane");
const World = raylane.world.World;
const Variant = raylane.variant.Variant;
const ray_file = raylane.trace.ray;
const Single = ray_file.Single;
const gpa = std.testing.allocator;

const inf = std.math.inf(f32);

/// Of rays that have none in common.
const no_light = std.mem.zeroes(raylane.world.Light);

/// What a ray is asked, and its bounds.
pub const Query = struct {
    origin: [3]f32,
    direction: [3]f32,
    tnear: Hit = .{ .t = 0, .primitive = std.math.maxInt(i32) },
    t_max: f32 = inf,
    skip: i32 = ray_file.no_primitive,

    fn ray(query: Query) ray_file.Ray(Single) {
        return .{
            .line = .init(.splat(query.origin), .splat(query.direction)),
            .tnear = .{ .t = .splat(query.tnear.t), .primitive = .splat(query.tnear.primitive) },
            .closest = .before(.splat(query.t_max)),
            .skip = .splat(query.skip),
            .active = .splat(true),
        };
    }
};

/// What it should find.
pub const Hit = struct { t: f32, primitive: i32 };

/// Every triangle in turn.
pub fn bruteForce(world: *const World, query: Query) Hit {
    const triangle = raylane.trace.triangle;
    var ray = query.ray();
    const geometry = &world.geometry;
    for (0..geometry.triangleCount()) |number| {
        const face = geometry.face(@intCast(number));
        if (face.material == raylane.world.none) continue;
        const p: [3]Single.Vec3 = .{
            .splat(face.position(geometry, 0)),
            .splat(face.position(geometry, 1)),
            .splat(face.position(geometry, 2)),
        };
        const hit = triangle.intersect(Single, p, ray.line, &geometry.padding);
        const primitive: Single.I32 = .splat(@intCast(number));
        const accepted = hit.mask
            .bitAnd(ray.tnear.isBefore(hit.t, primitive))
            .bitAnd(ray.closest.isAfter(hit.t, primitive))
            .andNot(primitive.eq(ray.skip));
        if (accepted.lane(0)) ray.closest = .{ .t = hit.t, .primitive = primitive };
    }
    return .{ .t = ray.closest.t.lane(0), .primitive = ray.closest.primitive.lane(0) };
}

/// Fails unless the same triangle was found, at the same t to the bit.
pub fn expectHit(expected: Hit, t: f32, primitive: i32) !void {
    const missed = primitive == ray_file.no_primitive;
    const same_t = @as(u32, @bitCast(expected.t)) == @as(u32, @bitCast(t));
    if (expected.primitive == primitive and (missed or same_t)) return;
    std.debug.print("expected {any}, found {d} at {d}\n", .{ expected, primitive, t });
    return error.TestExpectedHit;
}

/// All rays by themselves and in bundles, by one variant.
pub fn expectVariant(
    comptime variant: Variant,
    world: *const World,
    queries: []const Query,
    expected: []const Hit,
) !void {
    const Kernel = raylane.trace.kernel.Kernel(variant, false);
    const searches = raylane.trace.searchesOf(Kernel);
    var counts: raylane.statistics.TestCounts = .{};
    for (queries, expected) |query, hit| {
        var ray = query.ray();
        const found = searches.one_closest(&world.geometry, &ray, &counts);
        try expectHit(hit, ray.closest.t.lane(0), ray.closest.primitive.lane(0));
        try std.testing.expectEqual(hit.primitive != ray_file.no_primitive, found);
        var shadow = query.ray();
        const blocked = searches.one_any(&world.geometry, &shadow, &counts);
        try std.testing.expectEqual(found, blocked);
    }
    const size = Kernel.group_count * Kernel.ray_count;
    var first: usize = 0;
    while (first < queries.len) : (first += size) {
        const end = @min(first + size, queries.len);
        try expectMultiHit(Kernel, world, queries[first..end], expected[first..end]);
    }
    if (Kernel.ray_count > 1) try expectBundles(Kernel, world, queries, expected);
}

/// One way through the tree finds the first hits in order, or that one of them stops all light.
fn expectMultiHit(
    comptime Kernel: type,
    world: *const World,
    queries: []const Query,
    expected: []const Hit,
) !void {
    const lists = try gpa.create(raylane.trace.multi_hit.HitLists(Kernel));
    defer gpa.destroy(lists);
    const occluders = try gpa.alloc(u32, world.geometry.triangleCount() / 32 + 1);
    defer gpa.free(occluders);
    var materials = world.materials;
    materials.occluders = occluders;
    lists.geometry = &world.geometry;
    lists.materials = &materials;
    for ([_]bool{ true, false }) |is_opaque| {
        @memset(occluders, if (is_opaque) std.math.maxInt(u32) else 0);
        var counts: raylane.statistics.TestCounts = .{};
        var bundle = makeBundle(Kernel, queries);
        raylane.trace.searchesOf(Kernel).hit_lists(lists, &bundle, &counts);
        for (queries, expected, 0..) |query, hit, index| {
            if (!isActive(index)) continue;
            const group = index / Kernel.ray_count;
            const lane = index % Kernel.ray_count;
            const stopped = lists.stopped[group] >> @intCast(lane) & 1 == 1;
            const met = hit.primitive != ray_file.no_primitive;
            try std.testing.expectEqual(is_opaque and met, stopped);
            // Brute force takes its time.
            if (is_opaque or index % 8 != 0) continue;
            const list = lists.hits[group][lane][0..lists.counts[group][lane]];
            try expectList(world, query, list);
        }
    }
}

/// The hits of a ray are those that brute force finds one behind the other.
fn expectList(
    world: *const World,
    query: Query,
    list: []const raylane.trace.multi_hit.Hit,
) !void {
    var next = query;
    for (list) |hit| {
        next.tnear = bruteForce(world, next);
        try expectHit(next.tnear, hit.t, hit.primitive);
    }
    if (list.len == raylane.trace.multi_hit.hits_max) return;
    try std.testing.expectEqual(ray_file.no_primitive, bruteForce(world, next).primitive);
}

fn expectBundles(
    comptime Kernel: type,
    world: *const World,
    queries: []const Query,
    expected: []const Hit,
) !void {
    const searches = raylane.trace.searchesOf(Kernel);
    const geometry = &world.geometry;
    var counts: raylane.statistics.TestCounts = .{};
    const size = Kernel.group_count * Kernel.ray_count;
    var first: usize = 0;
    while (first < queries.len) : (first += size) {
        const part = queries[first..@min(first + size, queries.len)];
        var bundle = makeBundle(Kernel, part);
        var shadows = bundle;
        if (Kernel.variant.traversal == .beam) for ([_]i32{ 0, 1, 3, 12 }) |balance| {
            // Without budget all go as streams; with little, packets run out of it on their way.
            var poor = bundle;
            var budget: raylane.trace.interval_packet.PacketBudget = .{ .balance = balance };
            searches.packets_any.?(geometry, &poor, &budget, &counts);
            try expectBlocked(Kernel, &poor, expected[first..][0..part.len]);
        };
        try std.testing.expect(!searches.closest_hit(geometry, &bundle, null, &counts));
        searches.any_hit(geometry, &shadows, &no_light, &.none, &counts);
        try expectBlocked(Kernel, &shadows, expected[first..][0..part.len]);
        for (0..part.len) |index| {
            if (!isActive(index)) continue;
            const hit = expected[first + index];
            const group = &bundle.groups[index / Kernel.ray_count];
            const lane = index % Kernel.ray_count;
            try expectHit(hit, group.closest.t.lane(lane), group.closest.primitive.lane(lane));
        }
    }
}

/// Fails unless those rays found anything that have a hit.
fn expectBlocked(
    comptime Kernel: type,
    bundle: *const raylane.trace.bundle.Bundle(Kernel),
    expected: []const Hit,
) !void {
    for (expected, 0..) |hit, index| {
        if (!isActive(index)) continue;
        const group = &bundle.groups[index / Kernel.ray_count];
        const found = group.closest.primitive.lane(index % Kernel.ray_count);
        const blocked = found != ray_file.no_primitive;
        try std.testing.expectEqual(hit.primitive != ray_file.no_primitive, blocked);
    }
}

/// Some lanes stay empty, as at the border of a picture.
fn isActive(index: usize) bool {
    return index % 7 != 3;
}

fn makeBundle(comptime Kernel: type, queries: []const Query) raylane.trace.bundle.Bundle(Kernel) {
    const Rays = Kernel.Rays;
    const count = Kernel.ray_count;
    var bundle: raylane.trace.bundle.Bundle(Kernel) = undefined;
    for (&bundle.groups, 0..) |*group, group_index| {
        var origin: [3][count]f32 = @splat(@splat(0));
        var direction: [3][count]f32 = @splat(@splat(0));
        var t_max: [count]f32 = @splat(0);
        var tnear_t: [count]f32 = @splat(0);
        var ints: [2][count]i32 = @splat(@splat(0));
        var active: [count]bool = @splat(false);
        for (0..count) |lane| {
            const index = group_index * count + lane;
            if (index >= queries.len) continue;
            const query = queries[index];
            active[lane] = isActive(index);
            for (0..3) |axis| {
                origin[axis][lane] = query.origin[axis];
                direction[axis][lane] = query.direction[axis];
            }
            t_max[lane] = query.t_max;
            tnear_t[lane] = query.tnear.t;
            ints[0][lane] = query.tnear.primitive;
            ints[1][lane] = query.skip;
        }
        group.* = .{
            .line = .init(inLanes(Rays, origin), inLanes(Rays, direction)),
            .tnear = .{ .t = .fromArray(tnear_t), .primitive = .fromArray(ints[0]) },
            .closest = .before(.fromArray(t_max)),
            .skip = .fromArray(ints[1]),
            .active = .fromArray(active),
        };
    }
    return bundle;
}

fn inLanes(comptime Rays: type, v: [3][Rays.count]f32) Rays.Vec3 {
    return .{ .x = .fromArray(v[0]), .y = .fromArray(v[1]), .z = .fromArray(v[2]) };
}

/// Corners, three a triangle.
pub const Corners = std.ArrayList([3]f32);

/// Kinds of triangles that break careless code.
pub const Soup = enum {
    uniform,
    tiny_and_huge,
    coplanar,
    slivers,
    stacked,
    /// Many, and some that are 1e5 away.
    far_away,
    grid,
    /// One corner far away on one side.
    stray,
    /// Triangles of millimetres among some of a hundred kilometres.
    mixed_scales,
};

/// Appends three corners for each triangle.
pub fn addTriangles(soup: Soup, corners: *Corners, random: std.Random, count: usize) !void {
    for (0..count) |index| {
        for (0..3) |_| {
            var p: [3]f32 = undefined;
            for (&p) |*x| x.* = random.floatNorm(f32);
            switch (soup) {
                .uniform => {},
                .tiny_and_huge => {
                    const size: f32 = if (index % 16 == 0) 1e3 else 1e-3;
                    const place: f32 = @floatFromInt(index % 10);
                    for (&p) |*x| x.* = x.* * size + place;
                },
                .coplanar => p[2] = @floatFromInt(index % 3),
                .slivers => p[1] = p[0] + p[1] * 1e-6,
                // Each several times in the same place.
                .stacked => if (index % 4 != 0) {
                    p = corners.items[corners.items.len - 3];
                },
                .far_away => if (index % 8 < 3) for (&p) |*x| {
                    x.* += 1e5;
                },
                .stray => if (index == 5 and corners.items.len % 3 == 1) {
                    p = .{ 1e4, 0, 0 };
                },
                .mixed_scales => {
                    const size: f32 = if (index % 8 == 0) 1e5 else 1e-3;
                    const place: f32 = @floatFromInt(index % 3);
                    for (&p) |*x| x.* = x.* * size + place;
                },
                .grid => for (&p) |*x| {
                    x.* = @round(x.* * 2);
                },
            }
            try corners.append(gpa, p);
        }
    }
}

/// Fills `queries` with rays at and about corners, along planes, near and far.
pub fn addQueries(soup: Soup, queries: []Query, corners: []const [3]f32, random: std.Random) void {
    const center: f32 = if (soup == .far_away) 1e5 else 0;
    const shared: [3]f32 = .{ center + 0.1, center - 0.3, center + 7 };
    for (queries, 0..) |*query, index| {
        const target = corners[random.uintLessThan(usize, corners.len)];
        const other = corners[random.uintLessThan(usize, corners.len)];
        query.* = .{ .origin = shared, .direction = undefined };
        // The first half starts at one point, as primary rays do.
        if (index >= queries.len / 2) for (&query.origin) |*x| {
            x.* = center + random.floatNorm(f32) * 4;
            // Some of the others a thousand kilometres away.
            if (index % 16 == 0) x.* = random.floatNorm(f32) * 1e6;
        };
        // And every other subtile's rays go much the same way from much the same place.
        const led = index % 32 < 16 and index % 16 > 0;
        if (led) {
            const leader = queries[index - index % 16];
            for (0..3) |axis| {
                query.origin[axis] = leader.origin[axis] + random.floatNorm(f32) * 1e-3;
                const across = random.floatNorm(f32) * 1e-2;
                query.direction[axis] = leader.direction[axis] * (1 + across);
            }
        } else switch (index % 6) {
            0 => for (0..3) |axis| { // At a corner.
                query.direction[axis] = target[axis] - query.origin[axis];
            },
            1 => for (0..3) |axis| { // At the middle of two corners, often an edge.
                query.direction[axis] = (target[axis] + other[axis]) * 0.5 - query.origin[axis];
            },
            2 => { // Along an axis, often within a plane of triangles and boxes.
                if (index >= queries.len / 2) query.origin = target;
                query.direction = .{ 0, 0, 0 };
                query.direction[index / 6 % 3] = if (index % 4 < 2) 1 else -1;
            },
            else => for (&query.direction) |*x| {
                x.* = random.floatNorm(f32);
            },
        }
        if (index % 5 == 0) query.t_max = random.float(f32) * 3;
        if (index % 11 == 0) query.skip = random.intRangeLessThan(i32, 0, 64);
    }
}

fn expectSoup(soup: Soup, triangle_count: usize, query_count: usize) !void {
    var random = std.Random.DefaultPrng.init(@backingInt(soup) + 1);
    var corners: Corners = .empty;
    defer corners.deinit(gpa);
    try addTriangles(soup, &corners, random.random(), triangle_count);
    var scene = try makeScene(corners.items);
    defer scene.deinit();

    const mode = raylane.simd.setFlushToZero();
    defer raylane.simd.setFloatControl(mode);
    const queries = try gpa.alloc(Query, query_count);
    defer gpa.free(queries);
    addQueries(soup, queries, corners.items, random.random());
    const expected = try gpa.alloc(Hit, query_count);
    defer gpa.free(expected);
    inline for (.{ 4, 8, 16 }) |lanes| {
        if (comptime !isCompiled(lanes)) continue;
        var world = try fixture.prepare(&scene, lanes, .{});
        defer world.deinit();
        // Layers behind one another: the second half of the shared rays starts behind a hit.
        for (queries, expected, 0..) |*query, *hit, index| {
            query.tnear = .{ .t = 0, .primitive = std.math.maxInt(i32) };
            hit.* = bruteForce(&world, query.*);
            if (index % 3 != 0 or hit.primitive == ray_file.no_primitive) continue;
            query.tnear = hit.*;
            hit.* = bruteForce(&world, query.*);
        }
        inline for (raylane.variant.compiled) |variant| {
            if (variant.lanes == lanes) try expectVariant(variant, &world, queries, expected);
        }
    }
}

/// A scene of triangles that share no corner, with a camera.
pub fn makeScene(corners: []const [3]f32) !raylane.scene.Scene {
    var builder: fixture.Builder = try .init();
    const triangles = try gpa.alloc([3]u32, corners.len / 3);
    defer gpa.free(triangles);
    for (triangles, 0..) |*triangle, index| {
        const first: u32 = @intCast(3 * index);
        triangle.* = .{ first, first + 1, first + 2 };
    }
    try builder.addMesh(fixture.matte(.{ 1, 1, 1 }), corners, null, triangles);
    try builder.addCamera(.{ 0, 0, 7 }, 1);
    return builder.finish();
}

/// Whether there is a variant of this width.
pub fn isCompiled(comptime lanes: u8) bool {
    for (raylane.variant.compiled) |variant| {
        if (variant.lanes == lanes) return true;
    }
    return false;
}

test "brute force, single rays and packets find the same hits in random and nasty soups" {
    for (std.enums.values(Soup)) |soup| {
        expectSoup(soup, 300, fixture.enough(500)) catch |err| {
            std.debug.print("in the soup {t}\n", .{soup});
            return err;
        };
    }
}

test "a tree without triangles and one with a single triangle" {
    for ([_]usize{ 0, 1 }) |triangle_count| {
        var builder: fixture.Builder = try .init();
        const corners = [_][3]f32{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } };
        const triangles = [_][3]u32{.{ 0, 1, 2 }};
        try builder.addMesh(
            fixture.matte(.{ 1, 1, 1 }),
            &corners,
            null,
            triangles[0..triangle_count],
        );
        try builder.addCamera(.{ 0, 0, 7 }, 1);
        var scene = try builder.finish();
        defer scene.deinit();
        const queries = [_]Query{.{ .origin = .{ 0.2, 0.2, 1 }, .direction = .{ 0, 0, -1 } }};
        const hit: Hit = if (triangle_count == 0)
            .{ .t = inf, .primitive = ray_file.no_primitive }
        else
            .{ .t = 1, .primitive = 0 };
        inline for (raylane.variant.compiled) |variant| {
            var world = try fixture.prepare(&scene, variant.lanes, .{});
            defer world.deinit();
            try expectVariant(variant, &world, &queries, &.{hit});
        }
    }
}

test "a closed surface stops every ray that aims at its edges and corners, near and far" {
    for ([_]f32{ 0, 100, 1e4 }) |distance| {
        var builder: fixture.Builder = try .init();
        const center: [3]f32 = .{ distance, -distance, distance };
        try builder.addSphere(fixture.matte(.{ 1, 1, 1 }), center, 1, 12);
        // Most of the scene is elsewhere, so that it stays where it is.
        try builder.addSphere(fixture.matte(.{ 1, 1, 1 }), .{ 0, 0, 0 }, 1, 14);
        try builder.addCamera(.{ 0, 0, 7 }, 1);
        var scene = try builder.finish();
        defer scene.deinit();
        const lanes = raylane.variant.compiled[0].lanes;
        var world = try fixture.prepare(&scene, lanes, .{});
        defer world.deinit();
        const mode = raylane.simd.setFlushToZero();
        defer raylane.simd.setFloatControl(mode);
        var random = std.Random.DefaultPrng.init(5);
        const mesh = scene.meshes[0];
        var lost_count: u32 = 0;
        const ray_count = 40_000;
        for (0..ray_count) |index| {
            const corners = mesh.triangles[random.random().uintLessThan(usize, mesh.triangles.len)];
            const a = mesh.positions[corners[0]];
            const b = mesh.positions[corners[1]];
            // At corners, middles and anywhere on an edge.
            const share: f32 = switch (index % 4) {
                0 => 0,
                1 => 0.5,
                else => random.random().float(f32),
            };
            var origin: [3]f32 = undefined;
            var direction: [3]f32 = undefined;
            for (0..3) |axis| {
                // Inside, so that no ray can pass the outline.
                origin[axis] = center[axis] + (random.random().float(f32) - 0.5) * 0.5;
                direction[axis] = a[axis] + (b[axis] - a[axis]) * share - origin[axis];
            }
            var ray = (Query{ .origin = origin, .direction = direction }).ray();
            var counts: raylane.statistics.TestCounts = .{};
            const Kernel = raylane.trace.kernel.Kernel(raylane.variant.compiled[0], false);
            const searches = raylane.trace.searchesOf(Kernel);
            const hit = searches.one_closest(&world.geometry, &ray, &counts);
            lost_count += @intFromBool(!hit);
        }
        if (lost_count > 0) std.debug.print("{d} of {d} lost at {d}\n", .{
            lost_count, ray_count, distance,
        });
        try std.testing.expectEqual(0, lost_count);
    }
}
