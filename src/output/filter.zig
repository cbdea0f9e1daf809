//! PNG's filters (PNG specification, section 9): a row as differences from what is beside it.
//!
//! In: a row and the one above it. Out: the filter's number and the filtered row. The filter is the
//! one whose differences have the least sum of absolute values, as the specification suggests;
//! all five are tried, in lanes of bytes.

const std = @import("std");
const assert = std.debug.assert;

/// Bytes in front of a row that must be there, and be 0: what is beside the first pixel.
pub const margin = 16;
const lane_count = 16;
/// Sums of 16 bits in a lane hold this many differences, 128 each at most.
const block_count_max = 511;

const Filter = enum(u8) { none, sub, up, average, paeth };
const filters = std.enums.values(Filter);

/// A row of bytes with `margin` zeros in front of it, so that what is to the left of a byte can be
/// read everywhere.
pub const Row = struct {
    memory: []const u8,

    fn length(row: Row) usize {
        return row.memory.len - margin;
    }

    inline fn load(row: Row, comptime count: usize, place: usize) @Vector(count, u8) {
        return row.memory[margin + place ..][0..count].*;
    }

    /// What lies `distance` before.
    inline fn loadLeft(
        row: Row,
        comptime count: usize,
        place: usize,
        distance: usize,
    ) @Vector(count, u8) {
        return row.memory[margin + place - distance ..][0..count].*;
    }
};

/// Filters `row`, which lies below `above`. Both are as long as `out` without its first byte, which
/// becomes the filter's number. Asserts that a pixel has at most `margin` bytes.
pub fn apply(row: Row, above: Row, pixel_bytes: u8, out: []u8) void {
    assert(pixel_bytes >= 1 and pixel_bytes <= margin);
    assert(row.length() == above.length() and out.len == 1 + row.length());
    const chosen = choose(row, above, pixel_bytes);
    out[0] = @backingInt(chosen);
    switch (chosen) {
        inline else => |filter| applyOne(filter, row, above, pixel_bytes, out[1..]),
    }
}

fn applyOne(comptime filter: Filter, row: Row, above: Row, pixel_bytes: u8, out: []u8) void {
    var place: usize = 0;
    while (place + lane_count <= out.len) : (place += lane_count) {
        const near: Near(lane_count) = .init(row, above, pixel_bytes, place);
        out[place..][0..lane_count].* = near.difference(filter);
    }
    while (place < out.len) : (place += 1) {
        const near: Near(1) = .init(row, above, pixel_bytes, place);
        out[place..][0..1].* = near.difference(filter);
    }
}

/// The filter with the least sum of absolute differences; the first of several.
fn choose(row: Row, above: Row, pixel_bytes: u8) Filter {
    var sums: [filters.len]u64 = @splat(0);
    var place: usize = 0;
    while (place + lane_count <= row.length()) {
        const block_count: usize = @min((row.length() - place) / lane_count, block_count_max);
        const end = place + block_count * lane_count;
        var lanes: [filters.len]@Vector(lane_count, u16) = @splat(@splat(0));
        while (place < end) : (place += lane_count) {
            const near: Near(lane_count) = .init(row, above, pixel_bytes, place);
            inline for (&lanes, filters) |*sum, filter| sum.* +%= near.size(filter);
        }
        for (&sums, lanes) |*sum, part| sum.* += @reduce(.Add, @as(@Vector(lane_count, u32), part));
    }
    while (place < row.length()) : (place += 1) {
        const near: Near(1) = .init(row, above, pixel_bytes, place);
        inline for (&sums, filters) |*sum, filter| sum.* += near.size(filter)[0];
    }
    return @fromBackingInt(@intCast(std.mem.findMin(u64, &sums)));
}

/// Bytes of a row and what is beside them.
fn Near(comptime count: usize) type {
    return struct {
        here: Bytes,
        left: Bytes,
        above: Bytes,
        above_left: Bytes,

        // Nothing below wraps but where it should. Additions and subtractions are unchecked all the
        // same: the check of vectors of bytes finds an overflow where there is none on AArch64.
        const Bytes = @Vector(count, u8);

        inline fn init(row: Row, row_above: Row, pixel_bytes: u8, place: usize) @This() {
            return .{
                .here = row.load(count, place),
                .left = row.loadLeft(count, place, pixel_bytes),
                .above = row_above.load(count, place),
                .above_left = row_above.loadLeft(count, place, pixel_bytes),
            };
        }

        /// What the decoder adds to its prediction.
        inline fn difference(near: @This(), comptime filter: Filter) Bytes {
            return near.here -% switch (filter) {
                .none => @as(Bytes, @splat(0)),
                .sub => near.left,
                .up => near.above,
                // Half of the sum, rounded down, without the ninth bit of the sum.
                .average => (near.left & near.above) +%
                    ((near.left ^ near.above) >> @as(@Vector(count, u3), @splat(1))),
                .paeth => near.paeth(),
            };
        }

        /// The absolute value of the difference as a signed byte.
        inline fn size(near: @This(), comptime filter: Filter) Bytes {
            const value = near.difference(filter);
            return @min(value, -%value);
        }

        /// Of left, above and above left that which is nearest to left + above - above left, in
        /// this order. Its distances to left and above fit into a byte; where both are towards the
        /// same side, the third is their sum and not the least, so it may saturate.
        inline fn paeth(near: @This()) Bytes {
            const to_left = distance(near.above, near.above_left);
            const to_above = distance(near.left, near.above_left);
            const is_same_side =
                (near.above >= near.above_left) == (near.left >= near.above_left);
            const to_both = @select(
                u8,
                is_same_side,
                to_left +| to_above,
                distance(to_left, to_above),
            );
            const not_left = @select(u8, to_above <= to_both, near.above, near.above_left);
            const nearest = @min(to_above, to_both);
            return @select(u8, to_left <= nearest, near.left, not_left);
        }

        inline fn distance(a: Bytes, b: Bytes) Bytes {
            return @max(a, b) -% @min(a, b);
        }
    };
}

/// The specification's own words, a byte at a time.
fn predict(filter: Filter, left: i32, above: i32, above_left: i32) u8 {
    return @intCast(switch (filter) {
        .none => 0,
        .sub => left,
        .up => above,
        .average => @divFloor(left + above, 2),
        .paeth => paeth: {
            const estimate = left + above - above_left;
            const to_left = @abs(estimate - left);
            const to_above = @abs(estimate - above);
            const to_above_left = @abs(estimate - above_left);
            if (to_left <= to_above and to_left <= to_above_left) break :paeth left;
            break :paeth if (to_above <= to_above_left) above else above_left;
        },
    });
}

test "every filter on every triple of bytes" {
    // Steps that visit the ends and pairs close to each other.
    const values = [_]u8{ 0, 1, 2, 3, 63, 64, 65, 126, 127, 128, 129, 191, 200, 253, 254, 255 };
    for (0..256) |left| {
        for (values) |above| {
            const near: Near(16) = .{
                .here = @splat(77),
                .left = @splat(@intCast(left)),
                .above = @splat(above),
                .above_left = values,
            };
            inline for (filters) |filter| {
                const differences: [16]u8 = near.difference(filter);
                for (differences, values) |difference, above_left| {
                    const expected = predict(filter, @intCast(left), above, above_left);
                    try std.testing.expectEqual(@as(u8, 77) -% expected, difference);
                }
            }
        }
    }
}

test "rows of any length come back, by the filter of the least sum" {
    var random = std.Random.DefaultPrng.init(7);
    var memory: [2][margin + 9000]u8 = @splat(@splat(0));
    var out: [9001]u8 = undefined;
    const counts = [_]usize{ 3, 4, 12, 15, 16, 17, 33, 300, 8175, 8176, 8999 };
    for (counts, 0..) |count, round| {
        for ([_]u8{ 3, 4 }) |pixel_bytes| {
            for (&memory) |*row| random.random().bytes(row[margin..]);
            // Rows that each of the filters is good for.
            for (memory[1][margin..], 0..) |*byte, place| {
                const noise: u8 = @truncate(place * 7 % 5);
                const left = memory[1][margin + place - pixel_bytes];
                switch (round % 4) {
                    0 => byte.* = noise,
                    1 => byte.* = left +% noise,
                    2 => byte.* = memory[0][margin + place] +% noise,
                    else => {},
                }
            }
            const above: Row = .{ .memory = memory[0][0 .. margin + count] };
            const row: Row = .{ .memory = memory[1][0 .. margin + count] };
            apply(row, above, pixel_bytes, out[0 .. count + 1]);
            const filter: Filter = @fromBackingInt(out[0]);
            var sums: [filters.len]u64 = @splat(0);
            for (out[1 .. count + 1], 0..) |difference, place| {
                const left = row.loadLeft(1, place, pixel_bytes)[0];
                const top = above.load(1, place)[0];
                const top_left = above.loadLeft(1, place, pixel_bytes)[0];
                const here = row.load(1, place)[0];
                const prediction = predict(filter, left, top, top_left);
                try std.testing.expectEqual(here, difference +% prediction);
                for (&sums, filters) |*sum, other| {
                    const signed: i8 = @bitCast(here -% predict(other, left, top, top_left));
                    sum.* += @abs(signed);
                }
            }
            try std.testing.expectEqual(std.mem.findMin(u64, &sums), out[0]);
        }
    }
}
