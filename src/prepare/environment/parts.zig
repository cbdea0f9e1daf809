//! The light of a map in an order from which few directional lights can be cut.
//!
//! In: the nodes of a level. Out: sources so small and strong that they are lights of their own,
//! and running sums of the rest along Hilbert's curve (1891) over the octahedral square, whose
//! pieces are round: pieces of equal luminance, each seen from its centre, stand for the whole (as
//! Agarwal et al. 2003, Structured Importance Sampling of Environment Maps).

const std = @import("std");
const world = @import("../../world.zig");
const math = @import("../../math.zig");
const filter = @import("filter.zig");
const Node = filter.Node;
const vec3 = math.vec3;
const assert = std.debug.assert;

/// Sources at most.
const source_count_max = 2;
/// Share of the light from which on a source is one, however the rest is cut.
const source_share_min = 0.1;

/// What `world.EnvironmentMap` has of it.
pub const Parts = struct {
    parts: []world.EnvironmentPart,
    sources: []world.EnvironmentSource,
};

/// From `arena`. `nodes` are those of a square level with a power of two of texels on each side.
pub fn make(arena: std.mem.Allocator, nodes: []const Node) error{OutOfMemory}!Parts {
    const size = std.math.sqrt(nodes.len);
    const rest = try arena.dupe(Node, nodes);
    const sources = try arena.alloc(world.EnvironmentSource, source_count_max);
    var source_count: usize = 0;
    while (source_count < sources.len) : (source_count += 1) {
        sources[source_count] = takeSource(rest, size) orelse break;
    }
    const parts = try arena.alloc(world.EnvironmentPart, rest.len + 1);
    var sum: world.EnvironmentPart = .{
        .solid_angle = 0,
        .luminance = 0,
        .energy = @splat(0),
        .moment = @splat(0),
    };
    parts[0] = sum;
    for (parts[1..], 0..) |*part, index| {
        const place = hilbert(size, index);
        const node = &rest[place[1] * size + place[0]];
        const luminance: f64 = filter.luminance(node.energy);
        sum.solid_angle += node.solid_angle;
        sum.luminance += luminance;
        for (&sum.energy, node.energy) |*to, energy| to.* += energy;
        for (&sum.moment, node.direction) |*to, component| to.* += luminance * component;
        part.* = sum;
    }
    return .{ .parts = parts, .sources = sources[0..source_count] };
}

/// The strongest square of 3x3 nodes, taken out, if it has enough of the light; less what its
/// surroundings have as well.
fn takeSource(nodes: []Node, size: usize) ?world.EnvironmentSource {
    var total: f64 = 0;
    var strongest: usize = 0;
    for (nodes, 0..) |*node, index| {
        const luminance = filter.luminance(node.energy);
        total += luminance;
        if (luminance > filter.luminance(nodes[strongest].energy)) strongest = index;
    }
    const column = strongest % size;
    const row = strongest / size;
    var source: world.EnvironmentSource = .{ .direction = @splat(0), .energy = @splat(0) };
    const rows = [2]usize{ row -| 1, @min(row + 2, size) };
    const columns = [2]usize{ column -| 1, @min(column + 2, size) };
    for (rows[0]..rows[1]) |y| for (columns[0]..columns[1]) |x| {
        const node = &nodes[y * size + x];
        const weighted = vec3.scale(node.direction, filter.luminance(node.energy));
        source.direction = vec3.add(source.direction, weighted);
        source.energy = vec3.add(source.energy, node.energy);
    };
    // Not where the sky is as bright all over.
    if (!(filter.luminance(source.energy) > source_share_min * total)) return null;
    source.direction = vec3.normalize(source.direction) orelse return null;
    for (rows[0]..rows[1]) |y| for (columns[0]..columns[1]) |x| {
        nodes[y * size + x].energy = @splat(0);
    };
    return source;
}

/// Column and row of a point of the curve through a square.
fn hilbert(size: usize, index: usize) [2]usize {
    var x: usize = 0;
    var y: usize = 0;
    var rest = index;
    var side: usize = 1;
    while (side < size) : (side *= 2) {
        const right = rest / 2 & 1;
        const down = (rest ^ right) & 1;
        if (down == 0) {
            if (right == 1) {
                x = side - 1 - x;
                y = side - 1 - y;
            }
            std.mem.swap(usize, &x, &y);
        }
        x += side * right;
        y += side * down;
        rest /= 4;
    }
    return .{ x, y };
}

test "Hilbert's curve meets every place once and goes on next to it" {
    var seen: [64]u8 = @splat(0);
    var last = hilbert(8, 0);
    for (0..64) |index| {
        const place = hilbert(8, index);
        seen[place[1] * 8 + place[0]] += 1;
        if (index > 0) {
            const across = @max(place[0], last[0]) - @min(place[0], last[0]);
            const down = @max(place[1], last[1]) - @min(place[1], last[1]);
            try std.testing.expectEqual(1, across + down);
        }
        last = place;
    }
    for (seen) |times| try std.testing.expectEqual(1, times);
}
