//! Rays that start on surfaces: neither too near, so that a surface shadows itself, nor too far, so
//! that what is small loses its shadow or its inside.
//!
//! Planes in pieces, twice in the same place, in every attitude, size and place, lit at grazing
//! angles; small scenes with and without a thing that is far away.

const std = @import("std");
const fixture = @import("fixture.zig");
const raylane = @import("raylane");
const Builder = fixture.Builder;
const vec3 = raylane.math.vec3;
const expect = std.testing.expect;
const gpa = std.testing.allocator;

/// An orthonormal frame at a place, with a unit of length.
const Frame = struct {
    axes: [3][3]f32,
    origin: [3]f32,
    unit: f32,

    fn random(r: std.Random, origin: [3]f32, unit: f32) Frame {
        const normal = direction(r);
        const across = vec3.normalize(vec3.cross(normal, direction(r))).?;
        return .{
            .axes = .{ across, vec3.cross(normal, across), normal },
            .origin = origin,
            .unit = unit,
        };
    }

    fn direction(r: std.Random) [3]f32 {
        while (true) {
            const v = [3]f32{ r.floatNorm(f32), r.floatNorm(f32), r.floatNorm(f32) };
            return vec3.normalize(v) orelse continue;
        }
    }

    fn vector(frame: *const Frame, place: [3]f32) [3]f32 {
        var sum: [3]f32 = @splat(0);
        for (place, frame.axes) |share, axis| sum = vec3.add(sum, vec3.scale(axis, share));
        return sum;
    }

    fn point(frame: *const Frame, place: [3]f32) [3]f32 {
        return vec3.add(vec3.scale(frame.vector(place), frame.unit), frame.origin);
    }

    /// A node at a place that looks at another, for cameras and lights.
    fn addView(frame: *const Frame, builder: *Builder, from: [3]f32, to: [3]f32) !u32 {
        const back = vec3.normalize(frame.vector(vec3.sub(from, to))).?;
        const side = vec3.normalize(vec3.cross(frame.vector(.{ 0.6, 0.8, 0.1 }), back)).?;
        return builder.addNode(.{
            .x = side,
            .y = vec3.cross(back, side),
            .z = back,
            .translation = frame.point(from),
        });
    }

    /// The square [-1, 1]^2 in pieces of random sizes.
    fn addSquare(frame: *const Frame, builder: *Builder, r: std.Random) !void {
        const cell_count = 4;
        var cuts: [2][cell_count + 1]f32 = undefined;
        for (&cuts) |*line| {
            line[0] = -1;
            line[cell_count] = 1;
            for (line[1..cell_count], 1..) |*cut, index| {
                const middle = @as(f32, @floatFromInt(index)) / cell_count * 2 - 1;
                cut.* = middle + (r.float(f32) - 0.5) * 0.49;
            }
        }
        var corners: [(cell_count + 1) * (cell_count + 1)][3]f32 = undefined;
        for (&corners, 0..) |*corner, index| {
            const x = cuts[0][index % (cell_count + 1)];
            corner.* = frame.point(.{ x, cuts[1][index / (cell_count + 1)], 0 });
        }
        var triangles: [2 * cell_count * cell_count][3]u32 = undefined;
        for (0..cell_count * cell_count) |cell| {
            const a: u32 = @intCast(cell / cell_count * (cell_count + 1) + cell % cell_count);
            const b = a + 1;
            const c = b + cell_count + 1;
            const d = c - 1;
            const flip = r.boolean();
            triangles[2 * cell] = if (flip) .{ a, b, d } else .{ a, b, c };
            triangles[2 * cell + 1] = if (flip) .{ b, c, d } else .{ a, c, d };
        }
        try builder.addMesh(fixture.matte(.{ 1, 1, 1 }), &corners, null, &triangles);
    }

    fn addCamera(frame: *const Frame, builder: *Builder, from: [3]f32, half_height: f32) !void {
        const node = try frame.addView(builder, from, .{ 0, 0, 0 });
        try builder.scene.addCamera(.{
            .name = "",
            .node = node,
            .projection = .{ .perspective = .{
                .y_fov_rad = 2 * std.math.atan(half_height),
                .aspect = null,
            } },
        });
    }
};

test "a plane in pieces, twice in the same place, does not shadow itself" {
    var random = std.Random.DefaultPrng.init(3);
    const r = random.random();
    const places = [_][3]f32{ .{ 0, 0, 0 }, .{ 30, -50, 20 }, .{ 1e4, 1e4, -1e4 }, .{ 0, 1e4, 0 } };
    for (0..120) |round| {
        const unit = ([_]f32{ 1, 1e-3, 1e3 })[round % 3];
        const origin = vec3.scale(places[round / 3 % places.len], unit);
        const frame: Frame = .random(r, origin, unit);
        var builder: Builder = try .init();
        try frame.addSquare(&builder, r);
        try frame.addSquare(&builder, r);
        // From straight above to grazing, by half of them along an edge or an axis of the frame.
        const height = std.math.pow(f32, 10, -1.4 * r.float(f32));
        const turn = if (round % 2 == 0) r.float(f32) * 7 else 0;
        const distance: f32 = if (round % 5 == 0) 30 else 3;
        const from = vec3.scale(.{ @cos(turn), @sin(turn), height }, distance);
        const node = try frame.addView(&builder, from, .{ 0, 0, 0 });
        const is_parallel = round % 4 < 2;
        try builder.scene.addLight(.{
            .kind = if (is_parallel) .directional else .point,
            .node = node,
            .intensity = if (is_parallel) 1 else unit * unit * distance * distance,
        });
        try frame.addCamera(&builder, .{ 0.1, -0.7, 1.5 }, 0.3);
        var scene = try builder.finish();
        defer scene.deinit();
        var image = try fixture.render(&scene, .{ .width = 24, .height = 24 });
        defer image.deinit(gpa);
        errdefer std.debug.print("round {d}: {any}\n", .{ round, frame });
        for (image.pixels) |pixel| try expect(pixel[0] > 0);
    }
}

test "a room is closed wherever it stands and however large it is" {
    for ([_][3]f32{ .{ 0, 0, 0 }, .{ 100, -300, 200 }, .{ 8000, 0, -8000 } }) |place| {
        for ([_]f32{ 1, 0x1p-10, 0x1p10 }) |unit| {
            const frame: Frame = .{
                .axes = .{ .{ 1, 0, 0 }, .{ 0, 1, 0 }, .{ 0, 0, 1 } },
                .origin = vec3.scale(place, unit),
                .unit = unit,
            };
            var wall = fixture.matte(.{ 0, 0, 0 });
            wall.emissive = .{ 1, 1, 1 };
            wall.double_sided = false;
            var builder: Builder = try .init();
            for ([_][3][3]f32{
                .{ .{ 0, 0, -2 }, .{ 2, 0, 0 }, .{ 0, 2, 0 } },
                .{ .{ 0, 0, 2 }, .{ -2, 0, 0 }, .{ 0, 2, 0 } },
                .{ .{ -2, 0, 0 }, .{ 0, 0, -2 }, .{ 0, 2, 0 } },
                .{ .{ 2, 0, 0 }, .{ 0, 0, 2 }, .{ 0, 2, 0 } },
                .{ .{ 0, -2, 0 }, .{ 2, 0, 0 }, .{ 0, 0, -2 } },
                .{ .{ 0, 2, 0 }, .{ 2, 0, 0 }, .{ 0, 0, 2 } },
            }) |quad| try builder.addQuad(
                wall,
                frame.point(quad[0]),
                vec3.scale(quad[1], unit),
                vec3.scale(quad[2], unit),
            );
            var chrome = fixture.matte(.{ 1, 1, 1 });
            chrome.metallic = 1;
            chrome.roughness = 0;
            try builder.addSphere(chrome, frame.point(.{ 0.3, 0.2, -1 }), 0.4 * unit, 16);
            try builder.addCamera(frame.point(.{ 0, 0, 1.5 }), 2);
            try builder.addPointLight(frame.point(.{ 0, 1, 1 }), 0);
            var scene = try builder.finish();
            defer scene.deinit();
            var image = try fixture.render(&scene, .{ .width = 48, .height = 48, .ambient = 1 });
            defer image.deinit(gpa);
            errdefer std.debug.print("place {any}, unit {d}\n", .{ place, unit });
            for (image.pixels) |pixel| {
                for (pixel) |channel| try std.testing.expectApproxEqAbs(1, channel, 1e-5);
            }
        }
    }
}

/// A triangle `far_m` away, unless that is 0.
fn addFarTriangle(builder: *Builder, far_m: f32) !void {
    if (far_m > 0) try builder.addMesh(fixture.matte(.{ 1, 1, 1 }), &.{
        .{ far_m, far_m, -1 }, .{ far_m + 1, far_m, -1 }, .{ far_m, far_m + 1, -1 },
    }, null, &.{.{ 0, 1, 2 }});
}

/// A floor and a card that ends 0.2 mm above it, lit aslant, 0.12 mm around that edge.
fn cardScene(far_m: f32) !raylane.scene.Scene {
    var builder: Builder = try .init();
    const white = fixture.matte(.{ 1, 1, 1 });
    try builder.addQuad(white, .{ 0, 0, 0 }, .{ 0.5, 0, 0 }, .{ 0, 0.5, 0 });
    try builder.addQuad(white, .{ -0.1, 0, 2e-4 }, .{ 0.1, 0, 0 }, .{ 0, 0.1, 0 });
    try addFarTriangle(&builder, far_m);
    const tilted = [4]f32{ 0, -0.5, 0, 0.8660254 };
    const node = try builder.addNode(.fromTrs(.{ 0, 0, 0 }, tilted, .{ 1, 1, 1 }));
    try builder.scene.addLight(.{ .kind = .directional, .node = node, .intensity = 1 });
    try builder.addCamera(.{ 0, 0, 0.6 }, 1e-4);
    return builder.finish();
}

/// A lamp behind a slab, 1 mm thick, that lets half of its light through.
fn slabScene(far_m: f32) !raylane.scene.Scene {
    var builder: Builder = try .init();
    var slab = fixture.matte(.{ 1, 1, 1 });
    slab.roughness = 0;
    slab.transmission = 1;
    slab.volume = true;
    slab.attenuation_color = .{ 0.5, 0.5, 0.5 };
    slab.attenuation_distance = 1e-3;
    slab.double_sided = false;
    try builder.addQuad(slab, .{ 0, 0, 0.2 }, .{ 0.1, 0, 0 }, .{ 0, 0.1, 0 });
    try builder.addQuad(slab, .{ 0, 0, 0.199 }, .{ -0.1, 0, 0 }, .{ 0, 0.1, 0 });
    const lamp = fixture.flat(.{ 1, 1, 1 });
    try builder.addQuad(lamp, .{ 0, 0, 0 }, .{ 0.2, 0, 0 }, .{ 0, 0.2, 0 });
    try addFarTriangle(&builder, far_m);
    try builder.addCamera(.{ 0, 0, 0.6 }, 0.01);
    return builder.finish();
}

test "what is small keeps its shadow and its inside, however far away something else is" {
    var hashes: ?[2]u64 = null;
    for ([_]f32{ 0, 100, 1e3, 1e4 }) |far_m| {
        errdefer std.debug.print("triangle at {d} m\n", .{far_m});
        var card = try cardScene(far_m);
        defer card.deinit();
        var contact = try fixture.render(&card, .{ .ambient = 0 });
        defer contact.deinit(gpa);
        for (0..32) |y| for (0..32) |x| {
            const expected: f32 = if (x < 16) 0.5 / std.math.pi else 0;
            const seen = contact.at(@intCast(x), @intCast(y)).*[0];
            try std.testing.expectApproxEqAbs(expected, seen, 1e-5);
        };
        var slab = try slabScene(far_m);
        defer slab.deinit();
        var inside = try fixture.render(&slab, .{ .ambient = 0 });
        defer inside.deinit(gpa);
        for (inside.pixels) |pixel| try std.testing.expectApproxEqAbs(0.5, pixel[0], 2e-3);
        const found = [2]u64{ contact.hash(), inside.hash() };
        if (hashes) |expected| try std.testing.expectEqual(expected, found);
        hashes = found;
    }
}
