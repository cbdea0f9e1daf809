//! Children still to be visited, the nearest on top.
//!
//! In: a node, which of its children are met, where. Out: entries sorted by depth among themselves.

const world_file = @import("../world.zig");

/// A child still to be visited.
pub const Entry = struct {
    child: world_file.Child,
    /// A lower bound of what can be hit in it, in the unit of whoever pushed it.
    near: f32,
};

/// Pushes the children in `met`, a bit each, so that the one with the least `near` is on top.
/// Returns the new count. By insertion: mostly one or two are met.
pub inline fn push(
    comptime Lanes: type,
    node: *const world_file.Node(Lanes.count),
    met: u32,
    near: Lanes.F32,
    entries: []Entry,
    entry_count: usize,
) usize {
    const nears = near.toArray();
    var count = entry_count;
    var rest = met;
    while (rest != 0) : (rest &= rest - 1) {
        const child = @ctz(rest);
        const entry = entryOf(node, child, &nears);
        var slot = count;
        while (slot > entry_count and entries[slot - 1].near < entry.near) : (slot -= 1) {
            // By parts, of which each is read as it was written.
            entries[slot].child = entries[slot - 1].child;
            entries[slot].near = entries[slot - 1].near;
        }
        entries[slot] = entry;
        count += 1;
    }
    return count;
}

/// Takes the child with the least `near` of those in `met`, a bit each and at least one, and pushes
/// the others, nearer ones on top.
pub inline fn descend(
    comptime Lanes: type,
    node: *const world_file.Node(Lanes.count),
    met: u32,
    near: Lanes.F32,
    entries: []Entry,
    entry_count: *usize,
) Entry {
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
    entry_count.* = push(Lanes, node, met, near, entries, entry_count.*) - 1;
    return entries[entry_count.*];
}

inline fn entryOf(node: anytype, child: usize, nears: anytype) Entry {
    return .{ .child = node.child[child], .near = nears[child] };
}
