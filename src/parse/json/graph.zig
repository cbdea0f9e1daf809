//! Who hangs below whom, in a list whose elements name their children and which others name as
//! roots.
//!
//! In: lists of children, then lists of roots, as json.zig meets them. Out: each list without those
//! that say nothing new: what stands twice, and roots that hang below another of the same list.

const std = @import("std");
const json = @import("../json.zig");
const Allocator = std.mem.Allocator;
const Graph = @This();

gpa: Allocator,
lengths: json.Lengths,
/// Whether parents are still being found, or roots looked at.
is_first: bool = true,
/// The parent of each element, or `none`.
parents: []u32,
/// The list that is being read.
members: std.ArrayList(u32) = .empty,
/// Elements of the list.
listed: std.DynamicBitSetUnmanaged,
/// What has been found out about elements, for one list of roots, and about which ones.
places: []Place,
placed: std.ArrayList(u32) = .empty,

const none = std.math.maxInt(u32);

/// Whether an element hangs below one of a list, or of none, which is assumed on the way up as
/// well: that may be a circle.
const Place = enum { unknown, below, stray };

/// What of a list is not as it should be.
pub const Odd = struct {
    twice: ?u32 = null,
    /// Is below another one.
    child: ?u32 = null,
    /// Has a parent, and is below no other one.
    stray: ?u32 = null,
};

/// Nobody has parents yet. Free with `deinit`.
pub fn init(gpa: Allocator, lengths: json.Lengths, list: u8) error{OutOfMemory}!Graph {
    const count: usize = @intCast(lengths[list]);
    const parents = try gpa.alloc(u32, count);
    errdefer gpa.free(parents);
    @memset(parents, none);
    const places = try gpa.alloc(Place, count);
    errdefer gpa.free(places);
    @memset(places, .unknown);
    const listed: std.DynamicBitSetUnmanaged = try .initEmpty(gpa, count);
    return .{
        .gpa = gpa,
        .lengths = lengths,
        .parents = parents,
        .listed = listed,
        .places = places,
    };
}

/// Frees everything.
pub fn deinit(graph: *Graph) void {
    graph.gpa.free(graph.parents);
    graph.members.deinit(graph.gpa);
    graph.listed.deinit(graph.gpa);
    graph.gpa.free(graph.places);
    graph.placed.deinit(graph.gpa);
    graph.* = undefined;
}

/// Notes a child; whether it has no other parent.
pub fn adopt(graph: *Graph, parent: u32, child: u32) bool {
    const slot = &graph.parents[child];
    if (slot.* == none) slot.* = parent;
    return slot.* == parent;
}

/// Leaves the first of equal ones.
pub fn tidyChildren(graph: *Graph) Odd {
    var odd: Odd = .{};
    var kept: usize = 0;
    const members = graph.members.items;
    for (members) |member| {
        if (graph.listed.isSet(member)) {
            odd.twice = odd.twice orelse member;
            continue;
        }
        graph.listed.set(member);
        members[kept] = member;
        kept += 1;
    }
    for (members[0..kept]) |member| graph.listed.unset(member);
    graph.members.items.len = kept;
    return odd;
}

/// Leaves those that no other one is above.
pub fn tidyRoots(graph: *Graph) error{OutOfMemory}!Odd {
    var odd = graph.tidyChildren();
    const members = graph.members.items;
    for (members) |member| graph.listed.set(member);
    const all = try graph.gpa.dupe(u32, members);
    defer graph.gpa.free(all);
    defer for (all) |member| {
        graph.listed.unset(member);
    };
    defer {
        for (graph.placed.items) |element| graph.places[element] = .unknown;
        graph.placed.clearRetainingCapacity();
    }
    var kept: usize = 0;
    for (all) |member| {
        if (graph.parents[member] == none) {
            members[kept] = member;
            kept += 1;
        } else if (try graph.hangsBelow(member)) {
            odd.child = odd.child orelse member;
        } else odd.stray = odd.stray orelse member;
    }
    graph.members.items.len = kept;
    return odd;
}

/// Whether something of the list is above, which in turn hangs below none.
fn hangsBelow(graph: *Graph, member: u32) error{OutOfMemory}!bool {
    var top = member;
    while (graph.places[top] == .unknown) {
        const parent = graph.parents[top];
        if (parent == none) break;
        graph.places[top] = .stray;
        try graph.placed.append(graph.gpa, top);
        top = parent;
    }
    const is_below = switch (graph.places[top]) {
        .unknown => graph.listed.isSet(top),
        .below => true,
        .stray => false,
    };
    if (!is_below) return false;
    var next = member;
    while (next != top) : (next = graph.parents[next]) graph.places[next] = .below;
    return true;
}

test "what stands twice or hangs below another one is left out" {
    const gpa = std.testing.allocator;
    var lengths: json.Lengths = @splat(0);
    lengths[2] = 7;
    var graph: Graph = try .init(gpa, lengths, 2);
    defer graph.deinit();
    // 0 above 1 above 2; 4 and 5 above each other.
    for ([_][2]u32{ .{ 0, 1 }, .{ 1, 2 }, .{ 4, 5 }, .{ 5, 4 } }) |pair| {
        try std.testing.expect(graph.adopt(pair[0], pair[1]));
    }
    try std.testing.expect(graph.adopt(1, 2));
    try std.testing.expect(!graph.adopt(3, 2));
    const Case = struct { list: []const u32, kept: []const u32, odd: Odd };
    for ([_]Case{
        .{ .list = &.{ 0, 3 }, .kept = &.{ 0, 3 }, .odd = .{} },
        .{ .list = &.{ 0, 3, 0, 3 }, .kept = &.{ 0, 3 }, .odd = .{ .twice = 0 } },
        .{ .list = &.{ 2, 1, 0 }, .kept = &.{0}, .odd = .{ .child = 2 } },
        .{ .list = &.{ 3, 2 }, .kept = &.{3}, .odd = .{ .stray = 2 } },
        .{ .list = &.{ 1, 2 }, .kept = &.{}, .odd = .{ .stray = 1 } },
        .{ .list = &.{ 4, 5 }, .kept = &.{}, .odd = .{ .stray = 4 } },
    }) |case| {
        graph.members.clearRetainingCapacity();
        try graph.members.appendSlice(gpa, case.list);
        try std.testing.expectEqual(case.odd, try graph.tidyRoots());
        try std.testing.expectEqualSlices(u32, case.kept, graph.members.items);
    }
}
