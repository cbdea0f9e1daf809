//! What nobody means to ask for: triangles of random bits, rays that are no rays, and more layers,
//! volumes and lights than are looked at. Cost has a bound, and what is left out is said.
//!
//! Cost is counted in tests of boxes and triangles, for time depends on the machine.

const std = @import("std");
const fixture = @import("fixture.zig");
const raylane = @import("raylane");
const soup = @import("soup.zig");
const Session = raylane.session.Session;
const Scene = raylane.scene.Scene;
const World = raylane.world.World;
const gpa = std.testing.allocator;

const inf = std.math.inf(f32);
const nan = std.math.nan(f32);
/// Tests that garbage may take for each of a usual ray.
const cost_max = 2.5;

const variant = raylane.variant.compiled[0];
const Kernel = raylane.trace.kernel.Kernel(raylane.variant.countingOf(variant), true);
const no_light = std.mem.zeroes(raylane.world.Light);
const Ray = struct { origin: [3]f32, direction: [3]f32 };

/// Tests that rays take by themselves and as bundles, which look for closest hits, for any, and for
/// the first few. Fails if any of `is_hopeless` rays hits something.
fn costOf(world: *const World, rays: []const Ray, is_hopeless: bool) !f64 {
    const mode = raylane.simd.setFlushToZero();
    defer raylane.simd.setFloatControl(mode);
    const geometry = &world.geometry;
    const lists = try gpa.create(raylane.trace.multi_hit.HitLists(Kernel));
    defer gpa.destroy(lists);
    // Light passes all triangles.
    const occluders = try gpa.alloc(u32, geometry.triangleCount() / 32 + 1);
    defer gpa.free(occluders);
    @memset(occluders, 0);
    var materials = world.materials;
    materials.occluders = occluders;
    lists.geometry = geometry;
    lists.materials = &materials;
    var counts: raylane.statistics.TestCounts = .{};
    const size = Kernel.group_count * Kernel.ray_count;
    var first: usize = 0;
    while (first < rays.len) : (first += size) {
        const part = rays[first..@min(first + size, rays.len)];
        var bundle = bundleOf(part);
        var shadows = bundle;
        var through = bundle;
        _ = raylane.trace.dispatch.closestHit(Kernel, geometry, &bundle, null, &counts);
        raylane.trace.dispatch.anyHit(Kernel, geometry, &shadows, &no_light, .none, &counts);
        lists.trace(&through, &counts);
        if (!is_hopeless) continue;
        for (0..part.len) |index| {
            const group, const lane = .{ index / Kernel.ray_count, index % Kernel.ray_count };
            const found = bundle.groups[group].closest.primitive.lane(lane);
            try std.testing.expectEqual(raylane.trace.ray.no_primitive, found);
            try std.testing.expectEqual(0, lists.counts[group][lane]);
        }
    }
    const all = counts.box_useful + counts.triangle_useful;
    return @as(f64, @floatFromInt(all)) / @as(f64, @floatFromInt(rays.len));
}

fn bundleOf(rays: []const Ray) raylane.trace.bundle.Bundle(Kernel) {
    const Rays = Kernel.Rays;
    var bundle: raylane.trace.bundle.Bundle(Kernel) = undefined;
    for (&bundle.groups, 0..) |*group, number| {
        var places: [6][Kernel.ray_count]f32 = @splat(@splat(0));
        var active: [Kernel.ray_count]bool = @splat(false);
        for (0..Kernel.ray_count) |lane| {
            const index = number * Kernel.ray_count + lane;
            if (index >= rays.len) continue;
            active[lane] = true;
            for (0..3) |axis| {
                places[axis][lane] = rays[index].origin[axis];
                places[3 + axis][lane] = rays[index].direction[axis];
            }
        }
        group.* = .endless(.init(
            vectorsOf(Rays, places[0..3]),
            vectorsOf(Rays, places[3..6]),
        ), .splat(raylane.trace.ray.no_primitive), .fromArray(active));
    }
    return bundle;
}

fn vectorsOf(comptime Rays: type, places: *const [3][Kernel.ray_count]f32) Rays.Vec3 {
    return .{
        .x = .fromArray(places[0]),
        .y = .fromArray(places[1]),
        .z = .fromArray(places[2]),
    };
}

/// Rays from about the middle, each somewhere else.
fn usualRays(random: std.Random, rays: []Ray) void {
    for (rays) |*ray| {
        for (&ray.origin, &ray.direction) |*from, *to| {
            from.* = random.floatNorm(f32);
            to.* = random.floatNorm(f32);
        }
    }
}

/// A number of random bits that places may have, or any.
fn bitsOf(random: std.Random, is_place: bool) f32 {
    while (true) {
        const number: f32 = @bitCast(random.int(u32));
        if (!is_place or @abs(number) < 0x1p40) return number;
    }
}

fn soupOf(random: std.Random, kind: enum { small, large, bits }, count: usize) !Scene {
    var corners: soup.Corners = .empty;
    defer corners.deinit(gpa);
    for (0..count) |_| {
        var center: [3]f32 = undefined;
        for (&center) |*place| place.* = random.floatNorm(f32);
        for (0..3) |_| {
            var corner: [3]f32 = undefined;
            for (&corner, center) |*to, from| to.* = switch (kind) {
                .small => from + 0.1 * random.floatNorm(f32),
                .large => random.floatNorm(f32),
                .bits => bitsOf(random, true),
            };
            try corners.append(gpa, corner);
        }
    }
    return soup.makeScene(corners.items);
}

test "rays that are not finite hit nothing, and no kind of garbage takes long" {
    var random_state: std.Random.DefaultPrng = .init(1);
    const random = random_state.random();
    var scene = try soupOf(random, .small, 1000);
    defer scene.deinit();
    var world = try fixture.prepare(&scene, variant.lanes, .{});
    defer world.deinit();
    const rays = try gpa.alloc(Ray, fixture.enough(256));
    defer gpa.free(rays);
    usualRays(random, rays);
    const usual = try costOf(&world, rays, false);
    // Each of the components by itself, several, and all.
    for ([_]f32{ nan, -nan, inf, -inf }) |wrong| {
        usualRays(random, rays);
        for (rays, 0..) |*ray, index| {
            for (0..6) |component| {
                const which = 1 + index % 63;
                if (which >> @intCast(component) & 1 == 0) continue;
                const vector = if (component < 3) &ray.origin else &ray.direction;
                vector[component % 3] = wrong;
            }
        }
        const cost = try costOf(&world, rays, true);
        try std.testing.expect(cost <= usual);
    }
    // One in a few among usual ones, and bits of any kind.
    usualRays(random, rays);
    for (rays, 0..) |*ray, index| if (index % 5 == 0) {
        ray.direction = .{ nan, inf, -inf };
    };
    try std.testing.expect(try costOf(&world, rays, false) <= cost_max * usual);
    for (rays) |*ray| {
        for (&ray.origin) |*place| place.* = bitsOf(random, false);
        for (&ray.direction) |*place| place.* = bitsOf(random, false);
    }
    try std.testing.expect(try costOf(&world, rays, false) <= cost_max * usual);
}

test "triangles of random bits take no more tests than others as large" {
    var random_state: std.Random.DefaultPrng = .init(2);
    const random = random_state.random();
    var costs: [2]f64 = undefined;
    for (&costs, [_]bool{ false, true }) |*cost, is_garbage| {
        var scene = try soupOf(random, if (is_garbage) .bits else .large, 1000);
        defer scene.deinit();
        var world = try fixture.prepare(&scene, variant.lanes, .{});
        defer world.deinit();
        const rays = try gpa.alloc(Ray, fixture.enough(256));
        defer gpa.free(rays);
        usualRays(random, rays);
        if (is_garbage) for (rays[0 .. rays.len / 2]) |*ray| {
            for (&ray.origin) |*place| place.* = bitsOf(random, true);
        };
        cost.* = try costOf(&world, rays, false);
    }
    try std.testing.expect(costs[1] <= cost_max * costs[0]);
}

const integrators = std.enums.values(raylane.settings.Integrator);

/// Pictures take long under an emulator, and nothing in them is the processor's.
fn skipEmulated() error{SkipZigTest}!void {
    if (fixture.enough(4) < 4) return error.SkipZigTest;
}

/// Of pictures: few pixels, for some have hundreds of layers.
const side = 4;

/// A small picture, which belongs to the session.
fn picture(session: *Session, scene: *const Scene, options: fixture.Options) ![]const [4]f32 {
    var small = options;
    small.width = side;
    small.height = side;
    try fixture.view(session, scene, raylane.variant.compiled[small.variant].lanes, small);
    return (try fixture.trace(session, small)).pixels;
}

fn hasWarning(diagnostic: *const raylane.diagnostic.Diagnostic, text: []const u8) bool {
    var buffer: [raylane.diagnostic.warning_count_max][]const u8 = undefined;
    for (diagnostic.warningTexts(&buffer)) |warning| {
        if (std.mem.find(u8, warning, text) != null) return true;
    }
    return false;
}

test "a picture of triangles of random bits has numbers, the same by every variant" {
    try skipEmulated();
    var random_state: std.Random.DefaultPrng = .init(4);
    var builder: fixture.Builder = try .init();
    const red = fixture.matte(.{ 0.8, 0.1, 0.1 });
    var corners: [900][3]f32 = undefined;
    var triangles: [300][3]u32 = undefined;
    for (&corners) |*corner| for (corner) |*place| {
        place.* = bitsOf(random_state.random(), true);
    };
    for (&triangles, 0..) |*triangle, index| {
        const first: u32 = @intCast(3 * index);
        triangle.* = .{ first, first + 1, first + 2 };
    }
    try builder.addMesh(red, &corners, null, &triangles);
    var mirror = red;
    mirror.metallic = 1;
    mirror.roughness = 0;
    try builder.addQuad(mirror, .{ 0, 0, 0 }, .{ 1, 0, 0.2 }, .{ 0, 1, 0 });
    try builder.addPointLight(.{ 1, 2, 5 }, 100);
    try builder.addCamera(.{ 0, 0, 4 }, 0.5);
    var scene = try builder.finish();
    defer scene.deinit();
    for (integrators) |integrator| {
        var first: ?u64 = null;
        for (raylane.variant.compiled, 0..) |one, index| {
            if (raylane.variant.litIndexOf(index) == null) continue;
            var diagnostic: raylane.diagnostic.Diagnostic = .{};
            var session: Session = .init(gpa, std.testing.io, 1, &diagnostic);
            defer session.deinit();
            const options: fixture.Options = .{ .width = side, .height = side, .depth_max = 3 };
            try fixture.view(&session, &scene, one.lanes, options);
            session.film = try .init(gpa, side, side, .init(.{ .color = true }));
            try session.render(.{
                .integrator = integrator,
                .variant = index,
                .sample_count = 1,
                .depth = 3,
            });
            const image = &session.film.?.image;
            for (image.pixels) |pixel| for (pixel) |channel| {
                try std.testing.expect(std.math.isFinite(channel));
            };
            if (first) |hash| try std.testing.expectEqual(hash, image.hash());
            first = first orelse image.hash();
        }
    }
}

/// Panes in a row that blend and are not lit, before a card, with a light from the camera.
fn layered(count: usize, alpha: f32) !Scene {
    var builder: fixture.Builder = try .init();
    try builder.addCamera(.{ 0, 0, 4 }, 0.2);
    try builder.addPointLight(.{ 0, 0, 4 }, 50);
    const green = fixture.matte(.{ 0.1, 0.8, 0.2 });
    try builder.addQuad(green, .{ 0, 0, -1 }, .{ 2, 0, 0 }, .{ 0, 2, 0 });
    var pane = fixture.flat(.{ 1, 0.2, 0.1 });
    pane.alpha_mode = .blend;
    pane.base_color[3] = alpha;
    const corners = try gpa.alloc([3]f32, 4 * count);
    defer gpa.free(corners);
    const triangles = try gpa.alloc([3]u32, 2 * count);
    defer gpa.free(triangles);
    for (0..count) |index| {
        const z = @as(f32, @floatFromInt(index)) / @as(f32, @floatFromInt(count));
        corners[4 * index ..][0..4].* =
            .{ .{ -2, -2, z }, .{ 2, -2, z }, .{ 2, 2, z }, .{ -2, 2, z } };
        const a: u32 = @intCast(4 * index);
        triangles[2 * index ..][0..2].* = .{ .{ a, a + 1, a + 2 }, .{ a, a + 2, a + 3 } };
    }
    if (count > 0) try builder.addMesh(pane, corners, null, triangles);
    return builder.finish();
}

test "a card behind layers that are next to nothing is as bright as without them" {
    try skipEmulated();
    var bare = try layered(0, 0);
    defer bare.deinit();
    // The second ones stop less light than can be seen: they are not there.
    for ([_]struct { usize, f32, f32, bool }{
        .{ 50, 2e-5, 0.01, false },
        .{ 200, 1e-5, 1e-4, true },
    }) |case| {
        const count, const alpha, const tolerance, const are_holes = case;
        var scene = try layered(count, alpha);
        defer scene.deinit();
        for (integrators) |integrator| {
            var diagnostic: raylane.diagnostic.Diagnostic = .{};
            var sessions: [2]Session = undefined;
            var pixels: [2][]const [4]f32 = undefined;
            for (&sessions, &pixels, [_]*const Scene{ &bare, &scene }) |*session, *some, shown| {
                session.* = .init(gpa, std.testing.io, 1, &diagnostic);
                some.* = try picture(session, shown, .{ .integrator = integrator, .depth_max = 1 });
            }
            defer for (&sessions) |*session| session.deinit();
            for (pixels[0], pixels[1]) |expected, found| {
                try std.testing.expect(expected[1] > 0.1);
                try std.testing.expectApproxEqRel(expected[1], found[1], tolerance);
            }
            try std.testing.expect(!hasWarning(&diagnostic, "surfaces"));
            const rays = .{ sessions[0].traced.rays, sessions[1].traced.rays };
            if (are_holes) try std.testing.expectEqual(rays[0], rays[1]);
        }
    }
}

test "behind too many layers is the background, and a warning says so" {
    try skipEmulated();
    var scene = try layered(300, 2e-5);
    defer scene.deinit();
    for (integrators) |integrator| {
        var diagnostic: raylane.diagnostic.Diagnostic = .{};
        var session: Session = .init(gpa, std.testing.io, 1, &diagnostic);
        defer session.deinit();
        const pixels = try picture(&session, &scene, .{
            .integrator = integrator,
            .background = .{ 0.25, 0.5, 0.75 },
            .depth_max = 1,
        });
        for (pixels) |pixel| try std.testing.expectApproxEqAbs(0.75, pixel[2], 0.01);
        try std.testing.expectEqual(side * side, session.traced.cuts.passing);
        try std.testing.expect(hasWarning(&diagnostic, "16 rays met more than 255"));
    }
    if (raylane.variant.compiled.len > 1)
        try fixture.expectOnePicture(&scene, .{ .width = side, .height = side, .depth_max = 1 });
    // What next to no light comes through is not gone through to its end.
    var dim = try layered(300, 0.5);
    defer dim.deinit();
    var diagnostic: raylane.diagnostic.Diagnostic = .{};
    var session: Session = .init(gpa, std.testing.io, 1, &diagnostic);
    defer session.deinit();
    _ = try picture(&session, &dim, .{ .depth_max = 1 });
    try std.testing.expectEqual(raylane.statistics.CutCounts{}, session.traced.cuts);
}

test "a card behind more layers than light goes through is dark, and a warning says so" {
    try skipEmulated();
    var scene = try layered(80, 2e-5);
    defer scene.deinit();
    var diagnostic: raylane.diagnostic.Diagnostic = .{};
    var session: Session = .init(gpa, std.testing.io, 1, &diagnostic);
    defer session.deinit();
    const pixels = try picture(&session, &scene, .{ .depth_max = 0 });
    for (pixels) |pixel| try std.testing.expect(pixel[1] < 1e-3);
    try std.testing.expect(hasWarning(&diagnostic, "goes through more than 67 surfaces"));
}

test "glass in glass in glass: what is in too many volumes is said" {
    try skipEmulated();
    for ([_]usize{ 3, 6 }) |count| {
        var builder: fixture.Builder = try .init();
        try builder.addCamera(.{ 0, 0, 4 }, 0.3);
        try builder.addPointLight(.{ 2, 2, 4 }, 100);
        for (0..count) |index| {
            var glass = fixture.matte(.{ 1, 1, 1 });
            glass.roughness = 0;
            glass.ior = 1.2 + 0.05 * @as(f32, @floatFromInt(index));
            glass.transmission = 1;
            glass.volume = true;
            glass.double_sided = false;
            const radius = 1 - 0.1 * @as(f32, @floatFromInt(index));
            try builder.addSphere(glass, .{ 0, 0, 0 }, radius, 6);
        }
        var scene = try builder.finish();
        defer scene.deinit();
        for (integrators) |integrator| {
            var diagnostic: raylane.diagnostic.Diagnostic = .{};
            var session: Session = .init(gpa, std.testing.io, 1, &diagnostic);
            defer session.deinit();
            _ = try picture(&session, &scene, .{ .integrator = integrator, .depth_max = 8 });
            try std.testing.expectEqual(count > 4, hasWarning(&diagnostic, "more than 4 volumes"));
        }
    }
}

test "very many lights: a few stand for them, as bright as all" {
    try skipEmulated();
    var random_state: std.Random.DefaultPrng = .init(5);
    const random = random_state.random();
    var builder: fixture.Builder = try .init();
    try builder.addCamera(.{ 0, 0, 4 }, 0.2);
    const grey = fixture.matte(.{ 0.8, 0.8, 0.8 });
    try builder.addQuad(grey, .{ 0, 0, 0 }, .{ 2, 0, 0 }, .{ 0, 2, 0 });
    const count = 3000;
    var expected: f64 = 0;
    for (0..count) |_| {
        const place: [3]f32 = .{
            random.floatNorm(f32), random.floatNorm(f32), 2 + random.float(f32),
        };
        const intensity = 0.001 * random.float(f32);
        try builder.addPointLight(place, intensity);
        const squared: f64 = raylane.math.vec3.dot(place, place);
        expected += intensity * place[2] / (squared * @sqrt(squared));
    }
    expected *= 0.8 / std.math.pi;
    var scene = try builder.finish();
    defer scene.deinit();
    for (integrators) |integrator| {
        var diagnostic: raylane.diagnostic.Diagnostic = .{};
        var session: Session = .init(gpa, std.testing.io, 1, &diagnostic);
        defer session.deinit();
        const pixels = try picture(&session, &scene, .{
            .integrator = integrator,
            .depth_max = 0,
            .sample_count = if (integrator == .path) 64 else 1,
        });
        try std.testing.expect(hasWarning(&diagnostic, "3000 lights: "));
        try std.testing.expect(session.world.?.lights.len <= 1024);
        var mean: f64 = 0;
        for ([_]usize{ 5, 6, 9, 10 }) |middle| mean += 0.25 * pixels[middle][0];
        try std.testing.expectApproxEqRel(expected, mean, 0.05);
    }
}
