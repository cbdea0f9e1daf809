//! Children still to be visited, the nearest on top.
//!
//! In: a node, which of its children are met, where. Out: entries sorted by depth among themselves.

const std = @import("std");
const simd = @import("../simd.zig");
const world_file = @import("../world.zig");
const box = @import("box.zig");

/// A child still to be visited.
pub const Entry = struct {
    child: world_file.Child,
    /// A lower bound of what can be hit in it, in the unit of whoever pushed it.
    near: f32,
};

/// Pushes the children in `met` so that the one with the least `near` is on top, give or take the
/// last bits; negative ones come before all others, in no order. Returns the new count. Each goes
/// where the number of those that are farther puts it: an insertion would branch on the order,
/// which nobody can foresee.
pub inline fn push(
    comptime Lanes: type,
    node: *const world_file.Node(Lanes.count),
    met: Lanes.Mask,
    near: Lanes.F32,
    entries: []Entry,
    entry_count: usize,
) usize {
    const I32 = Lanes.I32;
    const nears = near.toArray();
    // No two alike: the last bits are the child's number.
    const numbered = near.bitcast().bitAnd(.splat(-Lanes.count)).bitOr(.iota());
    const keys: I32 = .select(met, numbered, .splat(std.math.minInt(i32)));
    const words = keys.toArray();
    var rest = met.bits();
    const count = entry_count + @popCount(rest);
    while (rest != 0) : (rest &= rest - 1) {
        const child = @ctz(rest);
        const farther = keys.gt(.splat(words[child])).popCount();
        entries[entry_count + farther] = entryOf(node, child, &nears);
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
        for (&node.child, 0..) |*child, at| child.* = .{ .target = @intCast(at), .block_count = 0 };
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
