//! When a beam stops paying: once it costs more than its rays would by themselves.
//!
//! In: what the beam meets on its way through the tree. Out: whether to go on. How wide a beam is
//! for its scene shows early in how many children wait on the stack, before their blocks are met.
//! All numbers are as measured (docs/performance.md).

/// Blocks of triangles that a child on the stack stands for.
const waiting_cost = 8;
/// A beam from the eye may meet so many triangles while so many children wait. With fewer, tiles
/// give up that were almost done.
const eye_triangles = 4000;
/// See `eye_triangles`.
const eye_waiting = 30;

/// What a beam has cost so far, and may cost, in blocks of triangles.
pub const Cost = struct {
    met_count: u32 = 0,
    max: u32,

    /// Of a beam of so many rays; a block is `lanes` triangles.
    pub fn of(comptime lanes: u32, ray_count: u32) Cost {
        return .{ .max = 60 + 2 * lanes + ray_count / 3 };
    }

    /// Of a beam from the eye.
    pub fn ofEye(comptime lanes: u32) Cost {
        return .{ .max = eye_triangles / lanes + waiting_cost * eye_waiting };
    }

    /// Counts blocks that are met while so many children wait. Returns whether the beam still pays.
    pub inline fn pays(cost: *Cost, pack_count: u32, waiting_count: usize) bool {
        cost.met_count += pack_count;
        const waiting: u32 = @intCast(waiting_count);
        return cost.met_count + waiting_cost * waiting <= cost.max;
    }
};

test "a beam pays up to its cost, children that wait counted as blocks" {
    const expect = @import("std").testing.expect;
    var cost: Cost = .of(4, 30);
    try expect(cost.pays(70, 1));
    try expect(!cost.pays(0, 2));
    try expect(cost.pays(8, 0));
    try expect(!cost.pays(1, 0));
}
