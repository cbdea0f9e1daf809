//! Virtual point lights (Keller 1997, "Instant Radiosity"): which of the points that light paths
//! meet light the picture, by importance resampling.
//!
//! In: points with the flux that leaves them diffusely, and how much each adds to what the camera
//! sees (after Georgiev and Slusallek 2010, "Simple and Robust Iterative Importance Sampling of
//! Virtual Point Lights"). Out: lights of the kind `emitter` that add about as much each, spread
//! over the scene in each set and each ninth of one: they are chosen at equal steps of that along a
//! curve through space, and their flux is that of all. A light is a disk of the area that it stands
//! for, so that near it no point gets more light than a surface of its radiosity would give, and
//! hardly less.

const std = @import("std");
const math = @import("../../math.zig");
const world_file = @import("../../world.zig");
const interleave = @import("interleave.zig");
const assert = std.debug.assert;
const vec3 = math.vec3;
const Box3 = math.Box3;
const Light = world_file.Light;
const Vec3 = math.Vec3;

/// A point that light leaves.
pub const Candidate = struct {
    /// Off its surface.
    position: Vec3,
    /// Unit vector to the side that it shines to.
    normal: Vec3,
    /// Flux that leaves it, linear RGB.
    flux: Vec3,
    /// What it adds to the picture, in any unit; at least 0.
    weight: f64 = 0,
    /// Place on the curve.
    place: u64 = 0,
    /// Square of the radius of the disk that bounds what it gives what is near.
    disk: f32 = 0,

    pub fn luminance(candidate: *const Candidate) f64 {
        const flux = candidate.flux;
        return @as(f64, 0.2126) * flux[0] + 0.7152 * flux[1] + 0.0722 * flux[2];
    }

    fn isBefore(_: void, a: Candidate, b: Candidate) bool {
        return a.place < b.place;
    }
};

/// Puts them in the order of a curve through space (Morton 1966), those that face one way by
/// themselves, equal places in their own.
pub fn sortAlongCurve(candidates: []Candidate, box: Box3) void {
    const extent = vec3.maxComponent(box.extent());
    const scale: f32 = if (extent > 0) 1023 / extent else 0;
    for (candidates) |*candidate| {
        var place: u64 = 0;
        const off = vec3.scale(vec3.sub(candidate.position, box.lower), scale);
        for (off, 0..) |component, axis| {
            const cell: u32 = @intFromFloat(std.math.clamp(component, 0, 1023));
            for (0..10) |bit| {
                const one: u64 = cell >> @intCast(bit) & 1;
                place |= one << @intCast(3 * bit + axis);
            }
        }
        candidate.place = faceOf(candidate.normal) << 30 | place;
    }
    std.sort.block(Candidate, candidates, {}, Candidate.isBefore);
}

/// The side of a cube that a direction goes through.
fn faceOf(direction: Vec3) u64 {
    var widest: usize = 0;
    for (1..3) |axis| {
        if (@abs(direction[axis]) > @abs(direction[widest])) widest = axis;
    }
    return 2 * widest + @intFromBool(direction[widest] < 0);
}

/// Steps of equal weight along a list.
const Steps = struct {
    total: f64,
    count: usize,
    sum: f64 = 0,
    next: usize = 0,

    fn of(candidates: []const Candidate, count: usize) Steps {
        var total: f64 = 0;
        for (candidates) |*candidate| total += candidate.weight;
        return .{ .total = total, .count = count };
    }

    /// How many steps end within the next of this weight.
    fn take(steps: *Steps, weight: f64) usize {
        steps.sum += weight;
        const first = steps.next;
        while (steps.next < steps.count) : (steps.next += 1) {
            const middle = @as(f64, @floatFromInt(steps.next)) + 0.5;
            const end = middle / @as(f64, @floatFromInt(steps.count)) * steps.total;
            if (end >= steps.sum) break;
        }
        return steps.next - first;
    }
};

/// Keeps `count` of them at most by their weights, with the flux of all. Returns how many are left,
/// in order and at the beginning.
pub fn thin(candidates: []Candidate, count: usize) usize {
    if (candidates.len <= count) return candidates.len;
    var steps: Steps = .of(candidates, count);
    var kept: usize = 0;
    if (!(steps.total > 0)) return 0;
    for (candidates) |candidate| {
        const times = steps.take(candidate.weight);
        if (times == 0) continue;
        candidates[kept] = candidate;
        const each = steps.total / @as(f64, @floatFromInt(count)) / candidate.weight;
        const share = @as(f64, @floatFromInt(times)) * each;
        candidates[kept].flux = vec3.scale(candidate.flux, @floatCast(share));
        candidates[kept].weight *= share;
        kept += 1;
    }
    return kept;
}

/// Chooses as many of `candidates`, which are in the order of the curve, as `chosen` has room for,
/// with the flux of all; `rows` says which. Returns false where nothing adds anything.
pub fn choose(candidates: []const Candidate, chosen: []Candidate, rows: []u32) bool {
    assert(chosen.len == rows.len);
    var steps: Steps = .of(candidates, chosen.len);
    if (!(steps.total > 0) or !std.math.isFinite(steps.total)) return false;
    const each = steps.total / @as(f64, @floatFromInt(chosen.len));
    for (candidates, 0..) |*candidate, row| {
        const first = steps.next;
        for (0..steps.take(candidate.weight)) |index| {
            const one = &chosen[first + index];
            one.* = candidate.*;
            one.flux = vec3.scale(candidate.flux, @floatCast(each / candidate.weight));
            rows[first + index] = @intCast(row);
        }
    }
    return steps.next == chosen.len;
}

/// Fills in lights, in the order of `interleave.Sets`.
pub fn toLights(
    chosen: []const Candidate,
    sets: *const interleave.Sets,
    geometry: *const world_file.Geometry,
    lights: []Light,
) void {
    assert(lights.len == sets.count() and chosen.len == lights.len);
    for (chosen, 0..) |*one, number| {
        const share: f32 = @floatCast(sets.weightOf(number) / std.math.pi);
        lights[sets.indexOf(number)] = .{
            .kind = .emitter,
            .from_receiver = geometry.isCoarseAt(one.position),
            .position = one.position,
            .direction = one.normal,
            .intensity = vec3.scale(one.flux, share),
            .range_inv_squared = 0,
            .cone_scale = 1,
            .cone_offset = 0,
            .disk = one.disk,
        };
    }
}

/// Lights that face much the same way and lie nearest to one tell the area that it stands for;
/// those in the same place stand for it together.
const neighbour_count = 5;
/// Radius of the smallest disk, as a part of the scene's size.
const disk_radius_least = 1.0 / 512.0;

/// Square of the radius of the disk of one of some lights.
pub fn diskOf(light: *const Candidate, all: []const Candidate, size: f32) f32 {
    var nearest: [neighbour_count]f32 = @splat(std.math.inf(f32));
    for (all) |*other| {
        if (vec3.dot(other.normal, light.normal) < 0.5) continue;
        const way = vec3.sub(other.position, light.position);
        var distance = vec3.dot(way, way);
        if (distance == 0) continue;
        for (&nearest) |*at| {
            if (distance < at.*) std.mem.swap(f32, at, &distance);
        }
    }
    const least = size * disk_radius_least;
    const most = size / 16;
    const area = nearest[neighbour_count - 1] / neighbour_count;
    return std.math.clamp(area, least * least, most * most);
}

test "lights have the flux of all candidates, and are as near to each other as these" {
    var candidates: [256]Candidate = undefined;
    var total: f64 = 0;
    for (&candidates, 0..) |*candidate, index| {
        // On the floor of a room of 16 x 16, some brighter than others.
        const flux: f32 = @floatFromInt(1 + index % 7);
        candidate.* = .{
            .position = .{ @floatFromInt(index % 16), 0, @floatFromInt(index / 16) },
            .normal = .{ 0, 1, 0 },
            .flux = @splat(flux),
        };
        candidate.weight = candidate.luminance();
        total += flux;
    }
    var geometry: world_file.Geometry = .empty;
    geometry.size = 16;
    const box: Box3 = .{ .lower = @splat(0), .upper = .{ 15, 0, 15 } };
    sortAlongCurve(&candidates, box);
    const sets: interleave.Sets = .init(9, 4, true);
    var chosen: [36]Candidate = undefined;
    var rows: [36]u32 = undefined;
    try std.testing.expect(choose(&candidates, &chosen, &rows));
    for (&chosen, rows) |*one, row| {
        try std.testing.expectEqual(candidates[row].position, one.position);
        one.disk = diskOf(one, &chosen, geometry.size);
    }
    var lights: [36]Light = undefined;
    toLights(&chosen, &sets, &geometry, &lights);
    var flux: f64 = 0;
    for (&lights) |*light| {
        flux += light.intensity[0] * std.math.pi / @as(f64, interleave.part_count * 4);
        // 36 lights on 256 square metres.
        const area = std.math.pi * light.disk;
        try std.testing.expect(area > 2 and area < 30);
    }
    try std.testing.expectApproxEqRel(total, flux, 1e-5);
    // Fewer candidates have the same flux, too.
    const kept = thin(&candidates, 50);
    var sum: f64 = 0;
    for (candidates[0..kept]) |*candidate| sum += candidate.flux[0];
    try std.testing.expect(kept <= 50);
    try std.testing.expectApproxEqRel(total, sum, 1e-5);
    for (&candidates) |*candidate| candidate.weight = 0;
    try std.testing.expect(!choose(&candidates, &chosen, &rows));
}
