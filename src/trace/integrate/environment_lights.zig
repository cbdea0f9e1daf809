//! Directional lights that stand for an environment map, in sets that samples take turns with.
//!
//! In: a map's light in parts. Out: lights whose energies sum to the map's. Small strong sources
//! are in every set; the rest is cut into as many pieces of the same luminance as all sets have
//! lights for it, and each set gets every so-manieth, so that it, too, is spread over the whole
//! sky.

const std = @import("std");
const world_file = @import("../../world.zig");
const math = @import("../../math.zig");
const elementary = math.elementary;
const vec3 = math.vec3;
const choices = @import("../../settings.zig");
const Environment = world_file.Environment;
const Map = world_file.EnvironmentMap;
const Part = world_file.EnvironmentPart;
const Vec3 = [3]f32;
const assert = std.debug.assert;

/// One of them.
pub const EnvironmentLight = struct {
    source: world_file.Light,
    /// Unit vector, against the light's way.
    to_light: Vec3,
    /// Irradiance over pi on a plane across its way: its share of all lights' light.
    irradiance: Vec3,
    /// Of the part of the sky that it stands for; of small strong sources 0.
    solid_angle: f32,
    /// How much more often the light would have to be taken for each sample to have it: its weight
    /// where it is one of a sample's.
    weight: f32,
};

/// The lights of all sets.
pub const EnvironmentLights = struct {
    buffer: [count_max]EnvironmentLight,
    /// In every set.
    source_count: usize,
    set_count: usize,
    /// Of one set, the sources aside.
    set_size: usize,
    /// Mean radiance of the map.
    mean: Vec3,

    const count_max = 2 * choices.environment_shadow_count.max;
    const set_count_max = 16;

    /// None at all.
    pub const none: EnvironmentLights = .{
        .buffer = undefined,
        .source_count = 0,
        .set_count = 0,
        .set_size = 0,
        .mean = .{ 0, 0, 0 },
    };

    /// For so many samples a pixel.
    pub fn init(environment: *const Environment, sample_count: u32) EnvironmentLights {
        var lights: EnvironmentLights = .none;
        const map = environment.map orelse return lights;
        const shadow_count: usize = environment.shadow_count;
        if (shadow_count == 0) return lights;
        // One at least for the rest.
        lights.source_count = map.sources.len;
        lights.set_size = @max(1, shadow_count -| map.sources.len);
        lights.set_count = @min(sample_count, set_count_max);
        while (lights.set_count * lights.set_size > choices.environment_shadow_count.max) {
            lights.set_count -= 1;
        }
        for (map.sources[0..lights.source_count], 0..) |*source, index| {
            lights.buffer[index] = ofSource(environment, source);
            lights.mean = vec3.add(lights.mean, lights.buffer[index].irradiance);
        }
        const piece_count = lights.set_count * lights.set_size;
        for (0..piece_count) |piece| {
            const set = piece % lights.set_count;
            const uses = (sample_count - set - 1) / lights.set_count + 1;
            const weight = @as(f32, @floatFromInt(sample_count)) / @as(f32, @floatFromInt(uses));
            const at = lights.indexOf(set, piece / lights.set_count);
            lights.buffer[at] = pieceOf(environment, piece, piece_count, weight);
            lights.mean = vec3.add(lights.mean, lights.buffer[at].irradiance);
        }
        // Over a sphere of 4 pi, not pi.
        lights.mean = vec3.scale(lights.mean, 0.25);
        return lights;
    }

    fn indexOf(lights: *const EnvironmentLights, set: usize, number: usize) usize {
        return lights.source_count + set * lights.set_size + number;
    }

    /// All of them.
    pub fn all(lights: *const EnvironmentLights) []const EnvironmentLight {
        return lights.buffer[0..lights.indexOf(lights.set_count, 0)];
    }

    /// Those of a sample, in two parts.
    pub fn ofSample(
        lights: *const EnvironmentLights,
        sample: u32,
    ) [2][]const EnvironmentLight {
        if (lights.set_count == 0) return .{ &.{}, &.{} };
        const first = lights.indexOf(sample % lights.set_count, 0);
        return .{
            lights.buffer[0..lights.source_count],
            lights.buffer[first..][0..lights.set_size],
        };
    }
};

/// One that stands for a small strong source.
pub fn ofSource(
    environment: *const Environment,
    source: *const world_file.EnvironmentSource,
) EnvironmentLight {
    return lightOf(environment, source.direction, source.energy, 1);
}

/// One of so many that have as much luminance each, and all of the map's light but the sources'.
pub fn pieceOf(
    environment: *const Environment,
    piece: usize,
    count: usize,
    weight: f32,
) EnvironmentLight {
    const cut = cutOf(environment.map.?.parts, piece, count);
    var direction: Vec3 = .{ 0, 1, 0 };
    if (vec3.normalize(narrow(cut.moment))) |unit| direction = unit;
    var light = lightOf(environment, direction, narrow(cut.energy), weight);
    light.solid_angle = @floatCast(cut.solid_angle);
    return light;
}

/// The same of light from everywhere, for environments without a map: along a spiral (Vogel 1979).
pub fn evenPieceOf(
    environment: *const Environment,
    piece: usize,
    count: usize,
    weight: f32,
) EnvironmentLight {
    const number = @as(f64, @floatFromInt(piece)) + 0.5;
    const share = 1 / @as(f64, @floatFromInt(count));
    const height = 1 - 2 * number * share;
    const radius = @sqrt(@max(0, 1 - height * height));
    const turns = number * 0.6180339887498949;
    const angle = 2 * std.math.pi * (turns - @floor(turns));
    const direction: [3]f64 = .{
        radius * elementary.cos(angle),
        height,
        radius * elementary.sin(angle),
    };
    var even = environment.*;
    even.scale = @splat(environment.ambient);
    const solid_angle = 4 * std.math.pi * share;
    return lightOf(&even, narrow(direction), narrow(@splat(solid_angle)), weight);
}

fn lightOf(
    environment: *const Environment,
    direction: Vec3,
    energy: Vec3,
    weight: f32,
) EnvironmentLight {
    // Back from the map to the world: by the rotation's columns.
    var to_light: Vec3 = .{ 0, 0, 0 };
    for (environment.to_map, direction) |row, component| {
        to_light = vec3.add(to_light, vec3.scale(row, component));
    }
    const unit = vec3.normalize(to_light) orelse .{ 0, 1, 0 };
    return .{
        .source = .{
            .kind = .directional,
            .from_receiver = false,
            .position = .{ 0, 0, 0 },
            .direction = vec3.neg(unit),
            .intensity = .{ 0, 0, 0 },
            .range_inv_squared = 0,
            .cone_scale = 0,
            .cone_offset = 1,
        },
        .to_light = unit,
        .irradiance = vec3.mul(vec3.scale(energy, 1.0 / std.math.pi), environment.scale),
        .solid_angle = 0,
        .weight = weight,
    };
}

/// One of `count` pieces of the same luminance.
fn cutOf(parts: []const Part, piece: usize, count: usize) Part {
    const start = sumTo(parts, piece, count);
    var cut = sumTo(parts, piece + 1, count);
    cut.solid_angle -= start.solid_angle;
    cut.luminance -= start.luminance;
    for (&cut.energy, start.energy) |*to, before| to.* -= before;
    for (&cut.moment, start.moment) |*to, before| to.* -= before;
    return cut;
}

/// The sum up to a fraction of the luminance, between two parts if need be.
fn sumTo(parts: []const Part, numerator: usize, denominator: usize) Part {
    if (numerator == denominator) return parts[parts.len - 1];
    const total = parts[parts.len - 1].luminance;
    const share = @as(f64, @floatFromInt(numerator)) / @as(f64, @floatFromInt(denominator));
    const wanted = total * share;
    // The first whose sum is beyond; the first of all is zero.
    var low: usize = 0;
    var high = parts.len - 1;
    while (low < high) {
        const middle = low + (high - low) / 2;
        if (parts[middle].luminance > wanted) high = middle else low = middle + 1;
    }
    const after = &parts[high];
    if (high == 0) return after.*;
    const before = &parts[high - 1];
    const width = after.luminance - before.luminance;
    const within = if (width > 0) (wanted - before.luminance) / width else 1;
    var sum = before.*;
    sum.solid_angle += (after.solid_angle - before.solid_angle) * within;
    sum.luminance = wanted;
    for (&sum.energy, after.energy) |*to, end| to.* += (end - to.*) * within;
    for (&sum.moment, after.moment) |*to, end| to.* += (end - to.*) * within;
    return sum;
}

fn narrow(values: [3]f64) Vec3 {
    var result: Vec3 = undefined;
    for (&result, values) |*to, value| to.* = @floatCast(value);
    return result;
}

test "the lights of all sets have the light of the map, whatever their numbers" {
    // Four parts around, of one colour each, and a source above.
    var parts: [5]Part = undefined;
    parts[0] = .{ .solid_angle = 0, .luminance = 0, .energy = @splat(0), .moment = @splat(0) };
    const directions = [_]Vec3{ .{ 1, 0, 0 }, .{ 0, 0, 1 }, .{ -1, 0, 0 }, .{ 0, 0, -1 } };
    for (parts[1..], parts[0..4], directions, 1..) |*part, before, direction, number| {
        const luminance: f64 = @floatFromInt(number);
        part.* = before;
        part.solid_angle += 3;
        part.luminance += luminance;
        part.energy[number % 3] += luminance;
        for (&part.moment, direction) |*to, component| to.* += luminance * component;
    }
    const map: Map = .{
        .radiance = &.{},
        .glossy = &.{},
        .diffuse = .{ .size = 0, .texels = &.{} },
        .parts = &parts,
        .sources = &.{.{ .direction = .{ 0, 1, 0 }, .energy = .{ 5, 6, 7 } }},
    };
    for ([_]u32{ 1, 3, 4, 64 }) |shadow_count| for ([_]u32{ 1, 3, 4, 17, 100 }) |sample_count| {
        const lights: EnvironmentLights = .init(&.{
            .ambient = 0,
            .background = @splat(0),
            .map = &map,
            .shadow_count = shadow_count,
        }, sample_count);
        var all: Vec3 = @splat(0);
        for (lights.all()) |*light| all = vec3.add(all, light.irradiance);
        var by_samples: [3]f64 = @splat(0);
        for (0..sample_count) |sample| {
            const chosen = lights.ofSample(@intCast(sample));
            const count = @max(shadow_count, 2);
            try std.testing.expectEqual(count, chosen[0].len + chosen[1].len);
            for (chosen) |part| for (part) |*light| {
                for (&by_samples, light.irradiance) |*sum, channel| sum.* += channel * light.weight;
            };
        }
        var expected: [3]f64 = .{ 5, 6, 7 };
        for (&expected, parts[4].energy) |*to, energy| to.* += energy;
        for (expected, all, by_samples) |energy, whole, sum| {
            try std.testing.expectApproxEqRel(energy / std.math.pi, whole, 1e-5);
            const mean = sum / @as(f64, @floatFromInt(sample_count));
            try std.testing.expectApproxEqRel(energy / std.math.pi, mean, 1e-5);
        }
    };
}

test "lights of a sky that is the same all around are spread evenly, with all of its light" {
    const environment: Environment = .{ .ambient = 0.5, .background = @splat(0) };
    for ([_]usize{ 9, 144 }) |count| {
        var energy: f64 = 0;
        var moment: [3]f64 = @splat(0);
        for (0..count) |piece| {
            const light = evenPieceOf(&environment, piece, count, 1);
            energy += light.irradiance[1] * std.math.pi;
            for (&moment, light.to_light) |*sum, component| sum.* += component;
        }
        try std.testing.expectApproxEqRel(4 * std.math.pi * 0.5, energy, 1e-5);
        const all: f64 = @floatFromInt(count);
        for (moment) |sum| try std.testing.expectApproxEqAbs(0, sum / all, 0.1);
    }
}
