//! Cost budget of a beam, which is given up once it costs more than its rays would one by one.
//!
//! In: what the beam meets on its way through the tree. Out: whether to go on. How wide a beam is
//! for its scene shows early in how many children wait on the stack, before their packs are met.
//! All numbers are as measured (docs/performance.md).

/// Packs that a child on the stack stands for.
const waiting_packs = 8;
/// A beam from the eye may meet so many triangles while so many children wait. With fewer, tiles
/// give up that were almost done.
const eye_triangles = 4000;
/// See `eye_triangles`.
const eye_waiting = 30;

/// What a beam has met so far, and may meet, in packs of triangles.
pub const Budget = struct {
    pack_count: u32 = 0,
    pack_count_max: u32,

    /// Of a beam of so many rays; a pack is `lanes` triangles.
    pub fn of(comptime lanes: u32, ray_count: u32) Budget {
        return .{ .pack_count_max = 60 + 2 * lanes + ray_count / 3 };
    }

    /// Of a beam from the eye.
    pub fn ofEye(comptime lanes: u32) Budget {
        return .{ .pack_count_max = eye_triangles / lanes + waiting_packs * eye_waiting };
    }

    /// Counts packs that are met while so many children wait. Returns whether to go on.
    pub inline fn allows(budget: *Budget, pack_count: u32, waiting_count: usize) bool {
        budget.pack_count += pack_count;
        const waiting: u32 = @intCast(waiting_count);
        return budget.pack_count + waiting_packs * waiting <= budget.pack_count_max;
    }
};

test "a budget allows as many packs as it has, children that wait counted as packs" {
    const expect = @import("std").testing.expect;
    var budget: Budget = .of(4, 30);
    try expect(budget.allows(70, 1));
    try expect(!budget.allows(0, 2));
    try expect(budget.allows(8, 0));
    try expect(!budget.allows(1, 0));
}
