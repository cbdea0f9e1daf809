//! The light list: which light is chosen for a receiver, and how likely.
//!
//! Scenes of lamps that emit, lights at points and far away, and skies. Densities sum to 1, are the
//! same from either side, and give the irradiance that is known.

const std = @import("std");
const fixture = @import("fixture.zig");
const raylane = @import("raylane");
const Builder = fixture.Builder;
const expect = std.testing.expect;
const gpa = std.testing.allocator;
const lights = raylane.trace.light_sampling;
const Single = raylane.simd.Lanes(.scalar, 1);
const Four = raylane.simd.Lanes(.vector, 4);

/// A scene ready for sampling; must stay where it is.
const Lit = struct {
    scene: raylane.scene.Scene,
    diagnostic: raylane.diagnostic.Diagnostic,
    session: raylane.session.Session,
    made: raylane.prepare.OwnedLightSampler,
    frame: raylane.world.Frame,

    fn init(lit: *Lit, builder: *Builder, options: fixture.Options) !void {
        try builder.addCamera(.{ 0, 1, 9 }, 1);
        lit.scene = try builder.finish();
        lit.diagnostic = .{};
        lit.session = .init(gpa, std.testing.io, 1, &lit.diagnostic);
        try fixture.view(&lit.session, &lit.scene, 4, options);
        lit.frame = lit.session.world.?.frame();
        lit.made = try raylane.prepare
            .makeLightSampler(gpa, &lit.frame, true, &lit.session.pool);
        lit.frame.light_sampler = &lit.made.sampler;
    }

    fn deinit(lit: *Lit) void {
        lit.made.deinit();
        lit.session.deinit();
        lit.scene.deinit();
    }

    fn sample(
        lit: *const Lit,
        receiver: *const lights.Receiver(Single),
        numbers: [3]f32,
    ) lights.Sample(Single) {
        return lights.sample(Single, &lit.frame, receiver, .{
            .splat(numbers[0]), .splat(numbers[1]), .splat(numbers[2]),
        }, .splat(true));
    }
};

fn lamp(radiance: f32, double_sided: bool) raylane.scene.Material {
    var material = fixture.matte(.{ 0, 0, 0 });
    material.emissive = @splat(radiance);
    material.double_sided = double_sided;
    return material;
}

/// A floor, lamps of several kinds that face several ways, a closed one, and lights of all kinds.
fn addAll(builder: *Builder) !void {
    try builder.addQuad(fixture.matte(.{ 1, 1, 1 }), .{ 0, 0, 0 }, .{ 0, 0, 4 }, .{ 4, 0, 0 });
    for (0..6) |number| {
        const x = @as(f32, @floatFromInt(number)) - 2.5;
        const upward: [3]f32 = if (number % 2 == 0) .{ 0, 0, 0.2 } else .{ 0, 0.2, 0 };
        const material = lamp(1 + x * x, number % 3 == 0);
        try builder.addQuad(material, .{ x, 2, -1 }, .{ 0.3, 0, 0 }, upward);
    }
    try builder.addSphere(lamp(5, true), .{ 1, 1, 2 }, 0.25, 4);
    try builder.addPointLight(.{ -2, 1.5, 1 }, 2);
    const node = try builder.addNode(.{
        .x = .{ 1, 0, 0 },
        .y = .{ 0, 0, -1 },
        .z = .{ 0, 1, 0 },
        .translation = .{ 0.5, 3, 0.5 },
    });
    try builder.scene.addLight(.{
        .kind = .spot,
        .node = node,
        .intensity = 9,
        .inner_cone_rad = 0.3,
        .outer_cone_rad = 0.6,
    });
    for (0..3) |number| try builder.scene.addLight(.{
        .kind = .directional,
        .node = node,
        .intensity = @floatFromInt(number),
    });
}

/// Somewhere among the lights; every third one is lit from both sides.
fn receiverAt(random: std.Random, number: usize) lights.Receiver(Single) {
    var place: [3]f32 = undefined;
    var normal: [3]f32 = undefined;
    for (&place, &normal) |*coordinate, *component| {
        coordinate.* = random.float(f32) * 6 - 3;
        component.* = random.floatNorm(f32);
    }
    place[1] = @abs(place[1]);
    const unit = raylane.math.vec3.normalize(normal).?;
    return .{
        .position = .splat(place),
        .normal = .splat(if (number % 3 == 0) .{ 0, 0, 0 } else unit),
    };
}

test "lights of the tree have probabilities that sum to 1, those of their samples" {
    var builder: Builder = try .init();
    try addAll(&builder);
    var lit: Lit = undefined;
    try lit.init(&builder, .{});
    defer lit.deinit();
    const tree = &lit.made.sampler.tree;
    const geometry = lit.frame.geometry;
    // Two triangles a quad, those of the sphere, a point and a spot.
    try std.testing.expectEqual(12 + 48, tree.emitter_count);
    try std.testing.expectEqual(tree.emitter_count + 2, tree.leaves.len);
    try expect(tree.leafOf(0) == null and tree.leafOf(1) == null);
    try expect(geometry.triangles.len == 2 + 12 + 48);
    var prng = std.Random.DefaultPrng.init(7);
    const random = prng.random();
    const tree_file = raylane.trace.light_tree;
    var total: f64 = 0;
    var count: f64 = 0;
    for (0..fixture.enough(100)) |number| {
        const lanes = receiverAt(random, number);
        const receiver: tree_file.Receiver = .{
            .position = lanes.position.lane(0),
            .normal = lanes.normal.lane(0),
        };
        var sum: f64 = 0;
        const root = tree_file.partsOf(Single, tree, &receiver);
        for (tree.leaves) |*leaf|
            sum += tree_file.probabilityOf(Single, tree, &receiver, &root, leaf);
        const chosen = tree_file.choose(Single, tree, &receiver, &root, random.float(f32));
        if (tree_file.sumOf(&root) == 0) {
            try std.testing.expectEqual(0, sum);
            try expect(chosen.leaf == null);
            continue;
        }
        // What a node promises, its children need not keep.
        try expect(sum < 1 + 1e-5);
        total += sum;
        count += 1;
        const leaf = &tree.leaves[chosen.leaf orelse continue];
        try std.testing.expectEqual(
            chosen.probability,
            tree_file.probabilityOf(Single, tree, &receiver, &root, leaf),
        );
        try expect(chosen.probability > 0);
        if (leaf.is_emitter) try std.testing.expectEqual(leaf, tree.leafOf(leaf.number).?);
    }
    try expect(total > 0.9 * count);
}

test "the density of a sample is that of its direction, in lanes as in one" {
    var builder: Builder = try .init();
    try addAll(&builder);
    var lit: Lit = undefined;
    try lit.init(&builder, .{ .environment = .{ .source = .studio }, .ambient = 0.2 });
    defer lit.deinit();
    var prng = std.Random.DefaultPrng.init(8);
    const random = prng.random();
    var counts: [4]usize = @splat(0);
    for (0..fixture.enough(300)) |number| {
        var places: [2][3][4]f32 = undefined;
        var numbers: [3][4]f32 = undefined;
        var singles: [4]lights.Sample(Single) = undefined;
        for (0..4) |lane| {
            const receiver = receiverAt(random, number + lane);
            for (&numbers) |*to| to[lane] = random.float(f32);
            const own = [3]f32{ numbers[0][lane], numbers[1][lane], numbers[2][lane] };
            const found = lit.sample(&receiver, own);
            singles[lane] = found;
            for (0..3) |axis| {
                places[0][axis][lane] = receiver.position.lane(0)[axis];
                places[1][axis][lane] = receiver.normal.lane(0)[axis];
            }
            const pdf = found.pdf.lane(0);
            if (pdf == 0) continue;
            try std.testing.expectApproxEqAbs(1, found.to_light.length().lane(0), 1e-5);
            const primitive = found.primitive.lane(0);
            if (primitive != lights.no_primitive) {
                counts[0] += 1;
                const again = lights.pdfOfEmitter(
                    Single,
                    &lit.frame,
                    &receiver,
                    found.primitive,
                    found.distance,
                    found.to_light,
                    .splat(true),
                );
                try std.testing.expectEqual(pdf, again.lane(0));
            } else if (!found.is_delta.lane(0)) {
                counts[1] += 1;
                const again = lights
                    .pdfOfEnvironment(Single, &lit.frame, &receiver, found.to_light, .splat(true));
                try std.testing.expectEqual(pdf, again.lane(0));
                try expect(std.math.isInf(found.distance.lane(0)));
                const seen = lights
                    .environmentRadiance(Single, &lit.frame, found.to_light, .splat(true));
                try std.testing.expectEqual(seen.lane(0), found.radiance.lane(0));
            } else if (std.math.isInf(found.distance.lane(0))) {
                counts[2] += 1;
            } else counts[3] += 1;
        }
        const receiver: lights.Receiver(Four) = .{
            .position = vectorOf(&places[0]),
            .normal = vectorOf(&places[1]),
        };
        const found = lights.sample(Four, &lit.frame, &receiver, .{
            .fromArray(numbers[0]), .fromArray(numbers[1]), .fromArray(numbers[2]),
        }, .splat(true));
        for (&singles, 0..) |*single, lane| {
            try std.testing.expectEqual(single.to_light.lane(0), found.to_light.lane(lane));
            try std.testing.expectEqual(single.radiance.lane(0), found.radiance.lane(lane));
            try std.testing.expectEqual(single.distance.lane(0), found.distance.lane(lane));
            try std.testing.expectEqual(single.pdf.lane(0), found.pdf.lane(lane));
            try std.testing.expectEqual(single.primitive.lane(0), found.primitive.lane(lane));
            try std.testing.expectEqual(single.is_delta.lane(0), found.is_delta.lane(lane));
        }
    }
    for (counts) |count| try expect(count > 5);
}

fn vectorOf(components: *const [3][4]f32) Four.Vec3 {
    return .{
        .x = .fromArray(components[0]),
        .y = .fromArray(components[1]),
        .z = .fromArray(components[2]),
    };
}

/// Mean irradiance of samples at a point that faces up, by numbers that are spread evenly (Roberts
/// 2018, "The Unreasonable Effectiveness of Quasirandom Sequences").
fn irradianceAt(lit: *const Lit, position: [3]f32, count: usize) f64 {
    const receiver: lights.Receiver(Single) = .{
        .position = .splat(position),
        .normal = .splat(.{ 0, 1, 0 }),
    };
    const steps = [3]f64{ 0.8191725133961645, 0.6710436067037893, 0.5497004779019703 };
    var sum: f64 = 0;
    for (0..count) |index| {
        var numbers: [3]f32 = undefined;
        for (&numbers, steps) |*number, step| {
            const value = 0.5 + step * @as(f64, @floatFromInt(index));
            number.* = @min(@as(f32, @floatCast(value - @floor(value))), 0x1.fffffep-1);
        }
        const found = lit.sample(&receiver, numbers);
        const pdf = found.pdf.lane(0);
        const cosine = found.to_light.lane(0)[1];
        if (pdf > 0 and cosine > 0) sum += found.radiance.lane(0)[0] * cosine / pdf;
    }
    return sum / @as(f64, @floatFromInt(count));
}

test "samples give the irradiance of a square, of a lamp, of the sun and of the sky" {
    // A square of radiance 3, two metres above, two metres wide: four times that of a quarter seen
    // from under its corner (Howell, "A Catalog of Radiation Heat Transfer Configuration Factors").
    var builder: Builder = try .init();
    try builder.addQuad(lamp(3, false), .{ 0, 2, 0 }, .{ 1, 0, 0 }, .{ 0, 0, 1 });
    builder.scene.scene.ambient = 0;
    var lit: Lit = undefined;
    try lit.init(&builder, .{});
    defer lit.deinit();
    const ratio: f64 = 0.5;
    const slant = @sqrt(1.0 + ratio * ratio);
    const factor = 4.0 / std.math.pi * (ratio / slant) * std.math.atan(ratio / slant);
    const expected = 3 * std.math.pi * factor;
    try std.testing.expectApproxEqRel(expected, irradianceAt(&lit, .{ 0, 0, 0 }, 1000), 5e-3);
    // It shines downwards alone.
    try std.testing.expectEqual(0, irradianceAt(&lit, .{ 0, 2.5, 0 }, 10));
    // Nobody asked for it: rays that meet it have all of it.
    lit.made.deinit();
    lit.made = try raylane.prepare.makeLightSampler(gpa, &lit.frame, false, &lit.session.pool);
    try std.testing.expectEqual(0, irradianceAt(&lit, .{ 0, 0, 0 }, 10));
    const point: lights.Receiver(Single) = .{
        .position = .splat(.{ 0, 0, 0 }),
        .normal = .splat(.{ 0, 1, 0 }),
    };
    const pdf = lights.pdfOfEmitter(Single, &lit.frame, &point, .splat(0), .splat(2), .splat(
        .{ 0, 1, 0 },
    ), .splat(true));
    try std.testing.expectEqual(0, pdf.lane(0));

    var other: Builder = try .init();
    try other.addQuad(fixture.matte(.{ 1, 1, 1 }), .{ 0, 0, 0 }, .{ 0, 0, 4 }, .{ 4, 0, 0 });
    try other.addPointLight(.{ 0, 2, 0 }, 8);
    const down = try other.addNode(.{
        .x = .{ 1, 0, 0 },
        .y = .{ 0, 0, -1 },
        .z = .{ 0, 1, 0 },
        .translation = .{ 0, 0, 0 },
    });
    try other.scene.addLight(.{ .kind = .directional, .node = down, .intensity = 1.5 });
    var sunny: Lit = undefined;
    try sunny.init(&other, .{ .ambient = 0.5 });
    defer sunny.deinit();
    const all = 2 + 1.5 + 0.5 * std.math.pi;
    try std.testing.expectApproxEqRel(all, irradianceAt(&sunny, .{ 0, 0, 0 }, 1000), 0.01);
}

/// What all lights of a frame give a point that faces up, each by itself: triangles by their parts.
fn irradianceOfAll(lit: *const Lit, position: [3]f32) f64 {
    const vec3 = raylane.math.vec3;
    const geometry = lit.frame.geometry;
    const steps = 8;
    var sum: f64 = 0;
    for (geometry.triangles) |*triangle| {
        const material = &lit.frame.materials.all[triangle.material];
        if (material.emissive[0] == 0) continue;
        const corner = geometry.positions[triangle.corner[0]];
        const along = vec3.sub(geometry.positions[triangle.corner[1]], corner);
        const across = vec3.sub(geometry.positions[triangle.corner[2]], corner);
        const doubled = vec3.cross(along, across);
        for (0..steps) |row| for (0..2 * (steps - row) - 1) |column| {
            // Middles of congruent parts.
            const third: f32 = if (column % 2 == 0) 1.0 / 3.0 else 2.0 / 3.0;
            const a = (@as(f32, @floatFromInt(row)) + third) / steps;
            const b = (@as(f32, @floatFromInt(column / 2)) + third) / steps;
            const place = vec3.add(corner, vec3.add(vec3.scale(along, a), vec3.scale(across, b)));
            const way = vec3.sub(place, position);
            const squared = vec3.dot(way, way);
            const leaving = -vec3.dot(doubled, way);
            const shown = if (material.double_sided > 0) @abs(leaving) else @max(0, leaving);
            const arriving = @max(0, way[1]);
            const area = 0.5 / @as(f32, steps * steps);
            sum += material.emissive[0] * area * shown * arriving / (squared * squared);
        };
    }
    var point: raylane.trace.interaction.Interaction(Single) = undefined;
    point.position = .splat(position);
    for (lit.frame.lights) |*light| {
        if (light.kind == .emitter) continue;
        const arrival = raylane.trace.light.arrive(Single, light, &point);
        sum += arrival.irradiance.lane(0)[0] * @max(0, arrival.to_light.lane(0)[1]);
    }
    return sum;
}

test "no light is left out, wherever it is" {
    var builder: Builder = try .init();
    try addAll(&builder);
    var lit: Lit = undefined;
    try lit.init(&builder, .{});
    defer lit.deinit();
    for ([_][3]f32{ .{ 0, 0, 0 }, .{ 1, 0.1, -1 }, .{ -3, 0.5, 2 }, .{ 1, 1, 2 } }) |position| {
        const expected = irradianceOfAll(&lit, position);
        const found = irradianceAt(&lit, position, fixture.enough(4000));
        errdefer std.debug.print("{any}: {d} {d}\n", .{ position, expected, found });
        try std.testing.expectApproxEqRel(expected, found, 0.04);
    }
}
