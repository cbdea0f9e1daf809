//! Huffman codes of limited length, as DEFLATE wants them (RFC 1951, section 3.2.2).
//!
//! In: how often each symbol occurs. Out: the length of each symbol's code, then the codes
//! themselves, their first bit lowest. Least total length but for the limit, and the same on every
//! target: ties are settled by symbol.

const std = @import("std");
const assert = std.debug.assert;

/// Codes of DEFLATE at most.
pub const length_limit = 15;
/// Symbols of one alphabet at most.
pub const symbol_count_max = 288;

/// Fills in the length of each symbol's code, 0 where the symbol does not occur. The code is
/// always complete, at least two symbols, for decoders that insist: where fewer occur, others are
/// counted once. Asserts 2 symbols, that all of them fit into codes of `length_max` bits, and that
/// each occurs less than 2^23 times.
pub fn findLengths(counts: []u32, length_max: u8, lengths: []u8) void {
    assert(counts.len == lengths.len and counts.len >= 2 and counts.len <= symbol_count_max);
    assert(length_max <= length_limit and counts.len <= @as(u32, 1) << @intCast(length_max));
    var keys_buffer: [symbol_count_max]u32 = undefined;
    const keys = sortedKeys(counts, &keys_buffer);
    var depths: [symbol_count_max]u32 = undefined;
    findDepths(keys, depths[0..keys.len]);

    // How many codes there are of each length, those too long counted as the longest.
    var by_length: [length_limit + 1]u32 = @splat(0);
    for (depths[0..keys.len]) |depth| by_length[@min(depth, length_max)] += 1;
    // Each unit is a code of the longest length: what is used of 2^length_max.
    var used: u32 = 0;
    for (1..length_max + 1) |length| {
        used += by_length[length] << @intCast(length_max - length);
    }
    while (used > @as(u32, 1) << @intCast(length_max)) : (used -= 1) {
        // A leaf becomes a node with two leaves, one of them from the lowest level.
        var length = length_max - 1;
        while (by_length[length] == 0) length -= 1;
        by_length[length] -= 1;
        by_length[length + 1] += 2;
        by_length[length_max] -= 1;
    }

    @memset(lengths, 0);
    var rest = keys;
    var length: u8 = length_max;
    while (length > 0) : (length -= 1) {
        for (rest[0..by_length[length]]) |key| lengths[key & symbol_mask] = length;
        rest = rest[by_length[length]..];
    }
    assert(rest.len == 0);
}

const symbol_bits = 9;
const symbol_mask = (1 << symbol_bits) - 1;

/// Count and symbol of what occurs, rarest first; makes two symbols occur.
fn sortedKeys(counts: []u32, buffer: *[symbol_count_max]u32) []u32 {
    var used: usize = 0;
    for (counts, 0..) |count, symbol| {
        assert(count < 1 << (32 - symbol_bits));
        if (count == 0) continue;
        buffer[used] = count << symbol_bits | @as(u32, @intCast(symbol));
        used += 1;
    }
    for (counts[0..2], 0..) |*count, symbol| {
        if (used >= 2 or count.* > 0) continue;
        count.* = 1;
        buffer[used] = 1 << symbol_bits | @as(u32, @intCast(symbol));
        used += 1;
    }
    std.mem.sortUnstable(u32, buffer[0..used], {}, std.sort.asc(u32));
    return buffer[0..used];
}

/// Depth of each leaf in the tree of least weight (two queues: leaves in order, and nodes, which
/// are made in order).
fn findDepths(keys: []const u32, depths: []u32) void {
    const count = keys.len;
    assert(count >= 2 and depths.len == count);
    const Node = struct { weight: u32, parent: u32 };
    // The leaves, then the nodes.
    var nodes: [2 * symbol_count_max]Node = undefined;
    for (keys, nodes[0..count]) |key, *node| {
        node.* = .{ .weight = key >> symbol_bits, .parent = 0 };
    }
    var leaf: usize = 0;
    var node: usize = count;
    for (count..2 * count - 1) |made| {
        var weight: u32 = 0;
        for (0..2) |_| {
            const is_leaf = leaf < count and
                (node == made or nodes[leaf].weight <= nodes[node].weight);
            const child = if (is_leaf) &leaf else &node;
            weight += nodes[child.*].weight;
            nodes[child.*].parent = @intCast(made);
            child.* += 1;
        }
        nodes[made] = .{ .weight = weight, .parent = 0 };
    }
    // From the root down; a node's weight has done its work and makes room for its depth.
    nodes[2 * count - 2].weight = 0;
    var index = 2 * count - 2;
    while (index > 0) {
        index -= 1;
        nodes[index].weight = nodes[nodes[index].parent].weight + 1;
    }
    for (depths, nodes[0..count]) |*depth, leaf_node| depth.* = leaf_node.weight;
}

/// A code and its length, ready to be written.
pub const Code = packed struct(u32) {
    bits: u24 = 0,
    length: u8 = 0,
};

/// The canonical codes of these lengths.
pub fn findCodes(lengths: []const u8, codes: []Code) void {
    assert(codes.len == lengths.len);
    var by_length: [length_limit + 1]u16 = @splat(0);
    for (lengths) |length| by_length[length] += 1;
    var next: [length_limit + 1]u16 = undefined;
    var code: u16 = 0;
    by_length[0] = 0;
    for (next[1..], by_length[0..length_limit]) |*first, shorter| {
        code = (code + shorter) << 1;
        first.* = code;
    }
    for (lengths, codes) |length, *out| {
        out.* = .{};
        if (length == 0) continue;
        const reversed = @bitReverse(next[length]) >> @intCast(16 - length);
        out.* = .{ .bits = reversed, .length = length };
        next[length] +%= 1;
    }
}

/// Sum of 2^-length, in units of the longest code: 2^15 for a complete code.
fn kraftSum(lengths: []const u8) u32 {
    var sum: u32 = 0;
    for (lengths) |length| {
        if (length > 0) sum += @as(u32, 1) << @intCast(length_limit - length);
    }
    return sum;
}

fn expectLengths(expected: []const u8, counts: []const u32, length_max: u8) !void {
    var counts_copy: [16]u32 = undefined;
    @memcpy(counts_copy[0..counts.len], counts);
    var lengths: [16]u8 = undefined;
    findLengths(counts_copy[0..counts.len], length_max, lengths[0..counts.len]);
    try std.testing.expectEqualSlices(u8, expected, lengths[0..counts.len]);
}

test findLengths {
    try expectLengths(&.{ 1, 2, 3, 3 }, &.{ 4, 2, 1, 1 }, 15);
    try expectLengths(&.{ 2, 2, 2, 2 }, &.{ 4, 3, 3, 3 }, 15);
    try expectLengths(&.{ 0, 2, 0, 1, 2 }, &.{ 0, 1, 0, 5, 1 }, 15);
    // The limit: Fibonacci's numbers make the deepest tree.
    try expectLengths(&.{ 5, 5, 4, 3, 2, 1 }, &.{ 1, 1, 2, 3, 5, 8 }, 15);
    try expectLengths(&.{ 4, 4, 4, 4, 2, 1 }, &.{ 1, 1, 2, 3, 5, 8 }, 4);
    try expectLengths(&.{ 3, 3, 3, 3, 2, 2 }, &.{ 1, 1, 2, 3, 5, 8 }, 3);
    // Two symbols at least.
    try expectLengths(&.{ 1, 1, 0 }, &.{ 0, 0, 0 }, 15);
    try expectLengths(&.{ 1, 1, 0 }, &.{ 0, 9, 0 }, 15);
    try expectLengths(&.{ 1, 0, 1 }, &.{ 0, 0, 9 }, 15);
}

test "codes are complete and no longer than allowed" {
    var random = std.Random.DefaultPrng.init(6);
    for (0..200) |round| {
        var counts: [symbol_count_max]u32 = undefined;
        for (&counts) |*count| count.* = random.random().int(u32) >> @intCast(9 + round % 23);
        if (round % 3 == 0) @memset(counts[round % 280 ..], 0);
        var lengths: [symbol_count_max]u8 = undefined;
        const length_max: u8 = @intCast(9 + round % 7);
        // Weights of all together must fit as well.
        for (&counts) |*count| count.* /= symbol_count_max;
        findLengths(&counts, length_max, &lengths);
        try std.testing.expectEqual(1 << length_limit, kraftSum(&lengths));
        for (lengths, counts) |length, count| {
            try std.testing.expectEqual(count > 0, length > 0);
            try std.testing.expect(length <= length_max);
        }
    }
}

test findCodes {
    // The example of RFC 1951, section 3.2.2, its codes written backwards.
    const lengths = [_]u8{ 3, 3, 3, 3, 3, 2, 4, 4 };
    const reversed = [_]u24{ 0b010, 0b110, 0b001, 0b101, 0b011, 0b00, 0b0111, 0b1111 };
    var codes: [8]Code = undefined;
    findCodes(&lengths, &codes);
    for (codes, lengths, reversed) |code, length, bits| {
        try std.testing.expectEqual(Code{ .bits = bits, .length = length }, code);
    }
}
