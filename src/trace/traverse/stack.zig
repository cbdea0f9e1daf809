//! The traversal stack: children still to be visited, sorted by distance, the closest on top.
//!
//! In: a node, which of its children are met, where. Out: entries sorted by depth among themselves.

const std = @import("std");
const simd = @import("../../simd.zig");
const world_file = @import("../../world.zig");
const box = @import("box.zig");

/// A child still to be visited.
pub const Entry = struct {
    child: world_file.Child,
    /// A lower bound of what can be hit in it, in the unit of whoever pushed it.
    near: f32,

    /// The whole tree.
    pub const whole: Entry = .{ .child = .root, .near = 0 };
};

/// The order of a node's children that are met: the least `near` comes last, give or take the last
/// bits; negative ones come after all others, in no order. Each child has a rank, the number of
/// those that are farther: an insertion would branch on the order, which nobody can foresee.
pub fn Ranks(comptime Lanes: type) type {
    return struct {
        keys: Lanes.I32,
        words: [Lanes.count]i32,

        /// Of the children in `met`.
        pub inline fn of(met: Lanes.Mask, near: Lanes.F32) @This() {
            // No two alike: the last bits are the child's number.
            const numbered = near.bitcast().bitAnd(.splat(-Lanes.count)).bitOr(.iota());
            const keys: Lanes.I32 = .select(met, numbered, .splat(std.math.minInt(i32)));
            return .{ .keys = keys, .words = keys.toArray() };
        }

        /// How many are farther than this one, which is met.
        pub inline fn farther(ranks: *const @This(), child: usize) usize {
            return ranks.keys.gt(.splat(ranks.words[child])).popCount();
        }
    };
}

/// Pushes the children in `met` in the order of `Ranks`. Returns the new count.
pub inline fn push(
    comptime Lanes: type,
    node: *const world_file.Node(Lanes.count),
    met: Lanes.Mask,
    near: Lanes.F32,
    entries: []Entry,
    entry_count: usize,
) usize {
    const nears = near.toArray();
    const ranks: Ranks(Lanes) = .of(met, near);
    var rest = met.bits();
    const count = entry_count + @popCount(rest);
    while (rest != 0) : (rest &= rest - 1) {
        const child = @ctz(rest);
        entries[entry_count + ranks.farther(child)] = entryOf(node, child, &nears);
    }
    return count;
}

/// Takes the nearest of the children that are met, a bit each in `met` and at least one, and pushes
/// the others, nearer ones on top. `range` is a `box.Range` of the children.
pub inline fn descend(
    comptime Lanes: type,
    node: *const world_file.Node(Lanes.count),
    range: anytype,
    met: u32,
    entries: []Entry,
    entry_count: *usize,
) Entry {
    const near = range.near;
    const nears = near.toArray();
    const others = met & (met - 1);
    const one = entryOf(node, @ctz(met), &nears);
    if (others == 0) return one;
    const other = entryOf(node, @ctz(others), &nears);
    if (others & (others - 1) == 0) {
        // By parts, so that the choice is made in registers.
        const first = one.near <= other.near;
        entries[entry_count.*] = .{
            .child = if (first) other.child else one.child,
            .near = if (first) other.near else one.near,
        };
        entry_count.* += 1;
        return .{
            .child = if (first) one.child else other.child,
            .near = if (first) one.near else other.near,
        };
    }
    entry_count.* = push(Lanes, node, range.isMet(), near, entries, entry_count.*) - 1;
    return entries[entry_count.*];
}

inline fn entryOf(node: anytype, child: usize, nears: anytype) Entry {
    return .{ .child = node.child[child], .near = nears[child] };
}

test "children come from the stack in order, however many are met and in whatever order" {
    inline for (.{ 4, 8, 16 }) |width| {
        const Lanes = simd.Lanes(.vector, width);
        var node: world_file.Node(width) = .empty;
        for (&node.child, 0..) |*child, at| child.* = .{ .target = @intCast(at), .pack_count = 0 };
        var random = std.Random.DefaultPrng.init(5);
        for (0..20_000) |_| {
            var nears: [width]f32 = undefined;
            // Few values, so that many are alike.
            for (&nears) |*near| near.* = @floatFromInt(random.random().uintLessThan(u32, width));
            const met = random.random().int(@Int(.unsigned, width)) | 1;
            const range: box.Range(Lanes) = .{
                .near = .fromArray(nears),
                .far = .select(.fromBits(met), .splat(width), .splat(-1)),
            };
            var entries: [width + 1]Entry = undefined;
            var count: usize = 1;
            entries[0] = .{ .child = .root, .near = std.math.inf(f32) };
            var seen: u32 = 0;
            var last = descend(Lanes, &node, range, met, &entries, &count);
            try std.testing.expectEqual(@popCount(met), count);
            while (true) {
                try std.testing.expectEqual(nears[last.child.target], last.near);
                seen |= @as(u32, 1) << @intCast(last.child.target);
                count -= 1;
                if (count == 0) break;
                try std.testing.expect(last.near <= entries[count].near);
                last = entries[count];
            }
            try std.testing.expectEqual(met, seen);
        }
    }
}
