//! What a material's textures say at a point of a triangle.
//!
//! In: lookups of a material, a point and its footprint by barycentric weights. Out: the channels
//! of each slot, which factors are multiplied with. Lookups that follow each other and are sampled
//! alike, as those of most materials are, share places, levels and weights.

const std = @import("std");
const world_file = @import("../../world.zig");
const texture_file = @import("texture.zig");
const Frame = world_file.Frame;
const Lookup = world_file.Lookup;
const Slot = world_file.Slot;
const Texel = texture_file.Texel;
const Texture = world_file.Texture;

/// Some slots that follow each other.
pub const Slots = enum {
    /// Those of every material.
    base,
    /// Those of layers.
    layers,

    /// The number of the first.
    pub fn first(slots: Slots) usize {
        return switch (slots) {
            .base => 0,
            .layers => Slot.base_count,
        };
    }

    /// How many.
    pub fn count(slots: Slots) usize {
        return switch (slots) {
            .base => Slot.base_count,
            .layers => Slot.count - Slot.base_count,
        };
    }

    /// The number of a slot among these.
    pub inline fn indexOf(slots: Slots, slot: Slot) usize {
        return @backingInt(slot) - slots.first();
    }
};

/// In `Lookup.channels`: there is no such channel.
const absent = 255;

/// A point on a triangle.
pub const Point = struct {
    primitive: u32,
    /// Barycentric weights of corners 1 and 2.
    weights: [2]f32,
    /// By axis of the footprint, from end to end: changes of both weights.
    axes: [2][2]f32,
};

/// Channels by slot, 0..1; 1 where there is no texture.
pub fn Values(comptime slots: Slots) type {
    return [slots.count()][4]f32;
}

/// Multiplies the slots, which begin with 1, with what textures say at a point.
pub fn sample(
    comptime slots: Slots,
    frame: *const Frame,
    lookups: []const Lookup,
    point: *const Point,
    values: *Values(slots),
) void {
    const at_once = texture_file.textures_max;
    const all = frame.textures.all;
    var rest = lookups;
    while (rest.len > 0) {
        var textures: [at_once]*const Texture = undefined;
        var count: usize = 0;
        for (rest[0..@min(rest.len, at_once)]) |*lookup| {
            if (count > 0 and !texture_file.isSampledAlike(all, &rest[0], lookup)) break;
            textures[count] = &all[lookup.texture];
            count += 1;
        }
        const footprint = footprintOf(frame.geometry, &rest[0], point);
        var texels: [at_once]Texel = undefined;
        texture_file.sample(textures[0..count], &rest[0], &footprint, &texels);
        for (rest[0..count], texels[0..count]) |*lookup, texel| {
            const channels = channelsOf(lookup, texel);
            const slot = &values[slots.indexOf(lookup.slot)];
            for (slot, channels) |*value, channel| value.* *= channel;
        }
        rest = rest[count..];
    }
}

/// The same of one slot alone.
pub fn sampleSlot(
    comptime slots: Slots,
    frame: *const Frame,
    lookups: []const Lookup,
    slot: Slot,
    point: *const Point,
    values: *Values(slots),
) void {
    for (lookups, 0..) |*lookup, index| {
        if (lookup.slot == slot) sample(slots, frame, lookups[index..][0..1], point, values);
    }
}

/// Whether some lookup is for a slot.
pub fn has(lookups: []const Lookup, slot: Slot) bool {
    for (lookups) |*lookup| if (lookup.slot == slot) return true;
    return false;
}

/// The tangent at a point, and the sign of its bitangent; 0 where vertices have none.
pub fn tangentAt(geometry: *const world_file.Geometry, point: *const Point) [4]f32 {
    if (!geometry.hasTangents()) return @splat(0);
    const face = geometry.face(point.primitive);
    const first = face.tangent(geometry, 0);
    const second = face.tangent(geometry, 1);
    const third = face.tangent(geometry, 2);
    var tangent: [4]f32 = undefined;
    inline for (tangent[0..3], first[0..3], second[0..3], third[0..3]) |*to, a, b, c| {
        to.* = (a + (b - a) * point.weights[0]) + (c - a) * point.weights[1];
    }
    tangent[3] = first[3];
    return tangent;
}

/// The place and axes in the coordinates of a lookup's texture.
fn footprintOf(
    geometry: *const world_file.Geometry,
    lookup: *const Lookup,
    point: *const Point,
) texture_file.Footprint {
    const set = lookup.texcoord_set;
    const rows = &lookup.transform;
    // A set that no mesh has counts as 0 everywhere.
    if (geometry.texcoords[set].len == 0 and geometry.shared.runs.len == 0) return .{
        .place = .{ rows[0][2], rows[1][2] },
        .axes = @splat(.{ 0, 0 }),
    };
    const face = geometry.face(point.primitive);
    const first = face.texcoord(geometry, set, 0);
    const edges = [2][2]f32{
        difference(face.texcoord(geometry, set, 1), first),
        difference(face.texcoord(geometry, set, 2), first),
    };
    const along = combined(edges, point.weights);
    const place = [2]f32{ first[0] + along[0], first[1] + along[1] };
    var footprint: texture_file.Footprint = undefined;
    for (&footprint.place, rows) |*to, row| {
        to.* = (row[0] * place[0] + row[1] * place[1]) + row[2];
    }
    for (&footprint.axes, point.axes) |*axis, weights| {
        const change = combined(edges, weights);
        for (axis, rows) |*to, row| to.* = row[0] * change[0] + row[1] * change[1];
    }
    return footprint;
}

inline fn difference(a: [2]f32, b: [2]f32) [2]f32 {
    return .{ a[0] - b[0], a[1] - b[1] };
}

inline fn combined(edges: [2][2]f32, weights: [2]f32) [2]f32 {
    return .{
        edges[0][0] * weights[0] + edges[1][0] * weights[1],
        edges[0][1] * weights[0] + edges[1][1] * weights[1],
    };
}

/// The channels of a slot from those of a texel.
fn channelsOf(lookup: *const Lookup, texel: Texel) [4]f32 {
    const from: [4]f32 = texel;
    var channels: [4]f32 = undefined;
    for (&channels, lookup.channels) |*to, number| {
        to.* = if (number == absent) 1 else from[number];
    }
    // A normal of two channels is of unit length.
    const is_normal = lookup.slot == .normal or lookup.slot == .clearcoat_normal;
    if (is_normal and lookup.channels[2] == absent) {
        const x = 2 * channels[0] - 1;
        const y = 2 * channels[1] - 1;
        const squared = 1 - (x * x + y * y);
        channels[2] = if (squared > 0) 0.5 + 0.5 * @sqrt(squared) else 0.5;
    }
    return channels;
}
