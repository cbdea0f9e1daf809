//! Where light paths start: of every light of a scene as many rays as it has power for.
//!
//! In: lights, those that stand for an environment's map among them, and the scene's box. Out: rays
//! that leave them, each with its part of the light's flux through the box. Parallel light comes
//! through the faces of the box that it falls on, so that no ray of it passes the box by, half of
//! it those of a box around what the camera sees, weighed by the balance heuristic (Veach and
//! Guibas 1995): of a sun, next to nothing falls through a window. The others' leave a point by
//! their lobe. Half of the paths are those of lights far away, half of those in the scene: a sky
//! has more power than any lamp, but little of it comes into a room.

const std = @import("std");
const math = @import("../../math.zig");
const world_file = @import("../../world.zig");
const elementary = math.elementary;
const vec3 = math.vec3;
const vec3d = math.vec3d;
const Box3 = math.Box3;
const Light = world_file.Light;
const Vec3 = math.Vec3;
const Vec3d = math.Vec3d;

/// A light, and which paths are its.
pub const Source = struct {
    light: Light,
    first: u32 = 0,
    count: u32 = 0,
    /// Paths that it has in the mean of all ways to share them out: with fewer than one, a source
    /// that has one stands for others that have none.
    expected: f64 = 0,

    fn isFar(source: *const Source) bool {
        return source.light.kind == .directional;
    }

    fn isBefore(_: void, a: Source, b: Source) bool {
        return !a.isFar() and b.isFar();
    }
};

/// What parallel light is sent through: all, and a part of it that matters more.
pub const Boxes = struct { scene: Box3, focus: Box3 };

/// A ray, and the flux that goes with it.
pub const Start = struct { origin: Vec3, direction: Vec3, flux: Vec3 };

/// Part of the box that parallel light starts before it.
const margin_share = 0x1p-10;

/// Shares the paths out to the lights, which come into the order of their paths. Returns how many
/// have one: none where nothing shines.
pub fn shareOut(sources: []Source, box: Box3, path_count: u32) u32 {
    std.sort.block(Source, sources, {}, Source.isBefore);
    var powers: [2]f64 = .{ 0, 0 };
    for (sources) |*source| powers[@intFromBool(source.isFar())] += powerOf(source, box);
    const is_split = powers[0] > 0 and powers[1] > 0;
    var next: u32 = 0;
    for ([_]bool{ false, true }) |far| {
        const power = powers[@intFromBool(far)];
        const is_known = power > 0 and std.math.isFinite(power);
        const part = if (is_split) path_count / 2 else path_count;
        const count: f64 = @floatFromInt(if (is_known) part else 0);
        const before = next;
        var sum: f64 = 0;
        for (sources) |*source| {
            if (source.isFar() != far) continue;
            if (is_known) sum += powerOf(source, box) / power;
            const end = before + @as(u32, @intFromFloat(@round(@min(sum, 1) * count)));
            source.expected = if (is_known) powerOf(source, box) / power * count else 0;
            source.first = next;
            source.count = end - next;
            next = end;
        }
    }
    return next;
}

/// The source of a path: of those in the order of `shareOut` the last that begins there or before.
pub fn sourceOf(sources: []const Source, path: u32) *const Source {
    var low: usize = 0;
    var high = sources.len;
    while (high - low > 1) {
        const middle = low + (high - low) / 2;
        if (sources[middle].first <= path) low = middle else high = middle;
    }
    std.debug.assert(path - sources[low].first < sources[low].count);
    return &sources[low];
}

/// Luminance of a light's flux through the box.
fn powerOf(source: *const Source, box: Box3) f64 {
    const light = &source.light;
    const color = light.intensity;
    const luminance = @as(f64, 0.2126) * color[0] + 0.7152 * color[1] + 0.0722 * color[2];
    return luminance * switch (light.kind) {
        .directional => projectedArea(box, light.direction),
        .point => 4 * std.math.pi,
        .spot => capOf(light),
        .emitter => std.math.pi,
    };
}

/// The solid angle of a spot's cone.
fn capOf(light: *const Light) f64 {
    return 2 * std.math.pi * (1 - coneEnd(light));
}

fn coneEnd(light: *const Light) f64 {
    return std.math.clamp(-@as(f64, light.cone_offset) / light.cone_scale, -1, 1);
}

/// Areas of the three faces that parallel light falls on, across its way.
fn faceAreas(box: Box3, direction: Vec3) Vec3d {
    const extent = box.extent();
    var areas: Vec3d = undefined;
    for (0..3) |axis| {
        const a: f64 = extent[(axis + 1) % 3];
        areas[axis] = a * extent[(axis + 2) % 3] * @abs(@as(f64, direction[axis]));
    }
    return areas;
}

fn projectedArea(box: Box3, direction: Vec3) f64 {
    const areas = faceAreas(box, direction);
    return areas[0] + areas[1] + areas[2];
}

/// The ray of a source's path, by numbers in 0..1.
pub fn start(source: *const Source, boxes: *const Boxes, numbers: [4]f64) Start {
    const light = &source.light;
    var flux = 1 / source.expected;
    var origin = light.position;
    var direction: Vec3d = undefined;
    switch (light.kind) {
        .directional => {
            direction = widen(light.direction);
            const is_focused = numbers[0] < 0.5;
            const twice = 2 * numbers[0];
            origin = enter(
                if (is_focused) boxes.focus else boxes.scene,
                light.direction,
                .{ if (is_focused) twice else twice - 1, numbers[1] },
            );
            // Each way has half of the paths.
            var density = 0.5 / projectedArea(boxes.scene, light.direction);
            if (is_focused or spanOf(boxes.focus, origin, direction) != null)
                density += 0.5 / projectedArea(boxes.focus, light.direction);
            flux /= density;
            if (is_focused) origin = entryOf(boxes.scene, origin, direction);
        },
        .point => {
            direction = inCap(.{ 0, 0, 1 }, -1, numbers[2..4].*);
            flux *= 4 * std.math.pi;
        },
        .spot => {
            direction = inCap(light.direction, coneEnd(light), numbers[2..4].*);
            const cosine = vec3d.dot(direction, widen(light.direction));
            const cone = std.math.clamp(cosine * light.cone_scale + light.cone_offset, 0, 1);
            flux *= capOf(light) * cone * cone;
        },
        .emitter => {
            const is_flat = light.cone_offset == 0;
            direction = if (is_flat)
                aroundNormal(light.direction, numbers[2..4].*)
            else
                inCap(light.direction, -1, numbers[2..4].*);
            const cosine = vec3d.dot(direction, widen(light.direction));
            const lobe = @max(0, cosine * light.cone_scale + light.cone_offset);
            flux *= std.math.pi * if (is_flat) @as(f64, light.cone_scale) else 4 * lobe;
            const ahead = vec3d.scale(direction, light.radius);
            origin = vec3.add(origin, vec3d.toSingle(ahead));
        },
    }
    return .{
        .origin = origin,
        .direction = vec3d.toSingle(direction),
        .flux = vec3d.toSingle(vec3d.scale(widen(light.intensity), flux)),
    };
}

/// A point where parallel light enters the box.
fn enter(box: Box3, direction: Vec3, numbers: [2]f64) Vec3 {
    const areas = faceAreas(box, direction);
    var left = numbers[0] * (areas[0] + areas[1] + areas[2]);
    var axis: usize = 0;
    while (axis < 2 and left >= areas[axis]) : (axis += 1) left -= areas[axis];
    const lower = widen(box.lower);
    const upper = widen(box.upper);
    const within = if (areas[axis] > 0) @min(left / areas[axis], 1) else 0.5;
    var shares: Vec3d = undefined;
    shares[axis] = if (direction[axis] > 0) 0 else 1;
    shares[(axis + 1) % 3] = within;
    shares[(axis + 2) % 3] = numbers[1];
    var point: Vec3d = undefined;
    for (&point, lower, upper, shares) |*to, low, high, share| to.* = low + (high - low) * share;
    const margin = vec3d.length(vec3d.sub(upper, lower)) * margin_share;
    return vec3d.toSingle(vec3d.sub(point, vec3d.scale(widen(direction), margin)));
}

/// Where a line enters a box and leaves it, in lengths of its direction; null: it passes it by.
fn spanOf(box: Box3, origin: Vec3, direction: Vec3d) ?[2]f64 {
    var near = -std.math.inf(f64);
    var far = std.math.inf(f64);
    for (0..3) |axis| {
        const low = @as(f64, box.lower[axis]) - origin[axis];
        const high = @as(f64, box.upper[axis]) - origin[axis];
        if (direction[axis] == 0) {
            if (low > 0 or high < 0) return null;
            continue;
        }
        const a = low / direction[axis];
        const b = high / direction[axis];
        near = @max(near, @min(a, b));
        far = @min(far, @max(a, b));
    }
    return if (near <= far) .{ near, far } else null;
}

/// The place on a ray's line that is just before a box.
fn entryOf(box: Box3, origin: Vec3, direction: Vec3d) Vec3 {
    const span = spanOf(box, origin, direction) orelse return origin;
    const margin = vec3d.length(widen(box.extent())) * margin_share;
    const off = vec3d.scale(direction, span[0] - margin);
    return vec3d.toSingle(vec3d.add(widen(origin), off));
}

/// A direction around a normal, by the cosine.
pub fn aroundNormal(normal: Vec3, numbers: [2]f64) Vec3d {
    const radius = @sqrt(numbers[0]);
    return turn(normal, radius, @sqrt(@max(0, 1 - numbers[0])), numbers[1]);
}

/// A direction within a cone, evenly.
fn inCap(axis: Vec3, cosine_least: f64, numbers: [2]f64) Vec3d {
    const cosine = 1 - numbers[0] * (1 - cosine_least);
    return turn(axis, @sqrt(@max(0, 1 - cosine * cosine)), cosine, numbers[1]);
}

/// Basis of Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
fn turn(axis: Vec3, sine: f64, cosine: f64, turns: f64) Vec3d {
    const n = widen(axis);
    const sign: f64 = if (n[2] < 0) -1 else 1;
    const a = -1 / (sign + n[2]);
    const b = n[0] * n[1] * a;
    const tangent: Vec3d = .{ 1 + sign * n[0] * n[0] * a, sign * b, -sign * n[0] };
    const bitangent: Vec3d = .{ b, sign + n[1] * n[1] * a, -n[1] };
    const angle = 2 * std.math.pi * turns;
    const across = vec3d.add(
        vec3d.scale(tangent, sine * elementary.cos(angle)),
        vec3d.scale(bitangent, sine * elementary.sin(angle)),
    );
    return vec3d.add(across, vec3d.scale(n, cosine));
}

fn widen(v: Vec3) Vec3d {
    return .{ v[0], v[1], v[2] };
}

const primes = primes: {
    @setEvalBranchQuota(10_000);
    var list: [number_count_max]u32 = undefined;
    var candidate: u32 = 2;
    for (&list, 0..) |*prime, found| {
        while (for (list[0..found]) |other| {
            if (candidate % other == 0) break true;
        } else false) candidate += 1;
        prime.* = candidate;
        candidate += 1;
    }
    break :primes list;
};

/// Numbers of a path at most.
pub const number_count_max = 40;

/// Number `dimension` of a path in 0..1: Halton's sequence (1964).
pub fn numberOf(path: u32, dimension: u32) f64 {
    const base = primes[dimension];
    const step = 1 / @as(f64, @floatFromInt(base));
    var left = path;
    var weight = step;
    var number: f64 = 0;
    while (left > 0) : (left /= base) {
        number += @as(f64, @floatFromInt(left % base)) * weight;
        weight *= step;
    }
    return @min(number, 1 - 0x1p-53);
}

fn testLight(kind: Light.Kind) Light {
    return .{
        .kind = kind,
        .from_receiver = false,
        .position = .{ 1, 2, 3 },
        .direction = .{ 0, -1, 0 },
        .intensity = .{ 1, 2, 3 },
        .range_inv_squared = 0,
        .cone_scale = 1,
        .cone_offset = 0,
    };
}

test "paths have the flux of their lights, and parallel ones go through the box" {
    const box: Box3 = .{ .lower = .{ 0, 0, 0 }, .upper = .{ 2, 3, 5 } };
    var sources = [_]Source{
        .{ .light = testLight(.emitter) },
        .{ .light = testLight(.point) },
        .{ .light = testLight(.spot) },
        .{ .light = testLight(.directional) },
    };
    sources[3].light.direction = .{ 0.6, -0.8, 0 };
    const boxes: Boxes = .{
        .scene = box,
        .focus = .{ .lower = .{ 0.5, 1, 1 }, .upper = .{ 1.5, 2, 3 } },
    };
    const path_count = 4096;
    try std.testing.expectEqual(path_count, shareOut(&sources, box, path_count));
    try std.testing.expectEqual(path_count / 2, sources[3].count);
    // Faces across; pi, 4 pi; and the integral of the squared cosine over half a sphere.
    const pi = std.math.pi;
    const expected = [_]f64{ pi, 4 * pi, 2 * pi / 3.0, 0.6 * 15 + 0.8 * 10 };
    for (&sources, expected) |*source, flux| {
        var sum: f64 = 0;
        var focused: u32 = 0;
        for (source.first..source.first + source.count) |path| {
            try std.testing.expectEqual(source, sourceOf(&sources, @intCast(path)));
            var numbers: [4]f64 = undefined;
            for (&numbers, 0..) |*number, dimension|
                number.* = numberOf(@intCast(path), @intCast(dimension));
            const one = start(source, &boxes, numbers);
            sum += one.flux[0];
            const direction = widen(one.direction);
            if (spanOf(boxes.focus, one.origin, direction) != null) focused += 1;
            try std.testing.expectApproxEqRel(one.flux[0] * 3, one.flux[2], 1e-5);
            try std.testing.expectApproxEqAbs(1, vec3.length(one.direction), 1e-5);
            if (source.light.kind == .point) continue;
            try std.testing.expect(vec3.dot(one.direction, source.light.direction) > -1e-6);
            if (source.light.kind != .directional) continue;
            // It enters by the face in x or by the one above.
            const around = box.grow(0.05);
            try std.testing.expect(around.contains(Box3.empty.include(one.origin)));
            try std.testing.expect(one.origin[0] < 0 or one.origin[1] > 3);
        }
        try std.testing.expectApproxEqRel(flux, sum, 0.01);
        if (source.light.kind == .directional)
            try std.testing.expect(focused > source.count / 2);
    }
}

test "numbers of paths fill 0..1 evenly in each dimension" {
    for ([_]u32{ 0, 1, 4, 27 }) |dimension| {
        var counts: [8]u32 = @splat(0);
        for (0..2048) |path| {
            const number = numberOf(@intCast(path), dimension);
            counts[@intFromFloat(number * 8)] += 1;
        }
        for (counts) |count| try std.testing.expect(count > 230 and count < 282);
    }
}
