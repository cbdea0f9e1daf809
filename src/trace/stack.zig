//! Children still to be visited, the nearest on top.
//!
//! In: a node, which of its children are met, where. Out: entries sorted by depth among themselves.

const world_file = @import("../world.zig");

/// A child still to be visited.
pub const Entry = struct {
    child: u32,
    /// 0: a node.
    block_count: u32,
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
        const entry: Entry = .{
            .child = node.child[child],
            .block_count = node.block_count[child],
            .near = nears[child],
        };
        var slot = count;
        while (slot > entry_count and entries[slot - 1].near < entry.near) : (slot -= 1) {
            entries[slot] = entries[slot - 1];
        }
        entries[slot] = entry;
        count += 1;
    }
    return count;
}
