//! Coherent gathering: what lanes share is loaded once for all that share it.
//!
//! In: numbers in lanes, such as triangles or materials. Out: each number once, with its lanes.
//! Neighbours mostly hit the same, which is then broadcast instead of gathered lane by lane; it is
//! also where shading can go on for one material at a time.

const std = @import("std");
const simd = @import("../../simd.zig");

/// The different numbers in some lanes.
pub fn Unique(comptime Lanes: type) type {
    return struct {
        numbers: [Lanes.count]u32,
        /// By number, the lanes that have it; of the first, all that are not asked for, too.
        lanes: [Lanes.count]Lanes.Mask,
        count: usize,

        /// Those of the lanes asked for; none is negative there.
        pub inline fn of(values: Lanes.I32, asked: Lanes.Mask) @This() {
            var unique: @This() = undefined;
            const array = values.toArray();
            var left = asked;
            unique.count = 0;
            while (left.any()) : (unique.count += 1) {
                const number = array[@ctz(left.bits())];
                const same = values.eq(.splat(number));
                const first = unique.count == 0;
                unique.numbers[unique.count] = @intCast(number);
                unique.lanes[unique.count] = if (first) same.bitOr(asked.bitNot()) else same;
                left = left.andNot(same);
            }
            return unique;
        }
    };
}

test "each number that is asked for once, with its lanes; others go with the first" {
    const Lanes = simd.Lanes(.vector, 4);
    const values: Lanes.I32 = .fromArray(.{ -1, 7, 3, 7 });
    const unique: Unique(Lanes) = .of(values, .fromBits(0b1110));
    try std.testing.expectEqual(2, unique.count);
    try std.testing.expectEqualSlices(u32, &.{ 7, 3 }, unique.numbers[0..2]);
    try std.testing.expectEqual(0b1011, unique.lanes[0].bits());
    try std.testing.expectEqual(0b0100, unique.lanes[1].bits());
    const one: Unique(Lanes) = .of(values, .fromBits(0b0100));
    try std.testing.expectEqual(1, one.count);
    try std.testing.expectEqual(3, one.numbers[0]);
    try std.testing.expectEqual(0b1111, one.lanes[0].bits());
}
