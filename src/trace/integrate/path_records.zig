//! Paths under way, one record each in memory, so that they can be put into lanes in any order.
//!
//! In: numbers of records. Out: their fields in lanes, and the numbers sorted by keys (counting
//! sort), so that rays which need the same are neighbours. What becomes of a path depends on its
//! record alone.

const std = @import("std");
const Nesting = @import("../shade/volumes.zig").Nesting;
const assert = std.debug.assert;

/// Pixels along each side of the area whose paths are traced together.
pub const area_side = 16;

/// Pixels of the area.
pub const area_pixels = area_side * area_side;

/// Samples of each pixel at most that are traced together.
pub const area_samples = 4;

/// Paths under way at most.
pub const path_count_max = area_pixels * area_samples;

/// A path between two vertices; its place among the records is that of its sample and pixel.
pub const Record = struct {
    /// Of the ray, as `ray.Ray` has them.
    origin: [3]f32,
    direction: [3]f32,
    start_t: f32,
    start_primitive: i32,
    t: f32,
    primitive: i32,
    skip: i32,
    /// Share of what the ray sees that reaches the pixel.
    throughput: [3]f32,
    /// Extinction coefficient of what the ray is in, per metre, and the volumes that it is in.
    sigma_t: [3]f32,
    nesting: Nesting,
    /// Ray cone, see `path.PathState`.
    cone_width: f32,
    cone_spread: f32,
    /// Density by solid angle of the ray's direction where light could have been chosen there as
    /// well; 0: it could not, and all light that the ray meets counts.
    scatter_pdf: f32,
    /// Where that was, see `light_sampling.Receiver`.
    receiver: [3]f32,
    receiver_normal: [3]f32,
    /// Bounces off surfaces and scatterings in volumes up to here, and surfaces that the ray has
    /// gone on through without one.
    depth: u32,
    scatter_count: u32,
    transparency_depth: u32,
    /// Sums of the sample, see `sample.Sample`.
    radiance: [3]f32,
    escaped: f32,
    displayed: [3]f32,
    display_share: f32,
    /// Share of light on the floor where the primary ray meets it.
    floor_light: f32,

    /// The number of a path.
    pub inline fn numberOf(sample: u32, x: u32, y: u32) u32 {
        assert(x < area_side and y < area_side);
        return (sample * area_side + y) * area_side + x;
    }

    /// Of the area, which sample and pixel a path is of: (sample, x, y).
    pub inline fn placeOf(number: u32) [3]u32 {
        return .{ number / area_pixels, number % area_side, number / area_side % area_side };
    }
};

/// A field of some records in lanes.
pub inline fn floats(
    comptime Lanes: type,
    records: anytype,
    numbers: *const [Lanes.count]u32,
    comptime name: []const u8,
) Lanes.F32 {
    var values: [Lanes.count]f32 = undefined;
    for (&values, numbers) |*value, number| value.* = @field(records[number], name);
    return .fromArray(values);
}

/// The same of whole numbers.
pub inline fn integers(
    comptime Lanes: type,
    records: anytype,
    numbers: *const [Lanes.count]u32,
    comptime name: []const u8,
) Lanes.I32 {
    var values: [Lanes.count]i32 = undefined;
    for (&values, numbers) |*value, number| value.* = @intCast(@field(records[number], name));
    return .fromArray(values);
}

/// The same of vectors.
pub inline fn vectors(
    comptime Lanes: type,
    records: anytype,
    numbers: *const [Lanes.count]u32,
    comptime name: []const u8,
) Lanes.Vec3 {
    var values: [3][Lanes.count]f32 = undefined;
    for (numbers, 0..) |number, lane| {
        const vector = &@field(records[number], name);
        inline for (&values, vector) |*channel, component| channel[lane] = component;
    }
    return .{
        .x = .fromArray(values[0]),
        .y = .fromArray(values[1]),
        .z = .fromArray(values[2]),
    };
}

/// Vectors out of lanes.
pub fn Stored(comptime Lanes: type) type {
    return struct {
        components: [3][Lanes.count]f32,

        /// Those of these lanes.
        pub inline fn of(vector: Lanes.Vec3) @This() {
            return .{
                .components = .{ vector.x.toArray(), vector.y.toArray(), vector.z.toArray() },
            };
        }

        /// That of one lane.
        pub inline fn at(stored: *const @This(), lane: usize) [3]f32 {
            const all = &stored.components;
            return .{ all[0][lane], all[1][lane], all[2][lane] };
        }
    };
}

/// Adds vectors to a field of records in some lanes.
pub inline fn addVectors(
    comptime Lanes: type,
    records: anytype,
    numbers: *const [Lanes.count]u32,
    comptime name: []const u8,
    lanes: Lanes.Mask,
    vector: Lanes.Vec3,
) void {
    const stored: Stored(Lanes) = .of(vector);
    var bits = lanes.bits();
    while (bits != 0) : (bits &= bits - 1) {
        const lane = @ctz(bits);
        const sum = &@field(records[numbers[lane]], name);
        for (sum, stored.at(lane)) |*channel, more| channel.* += more;
    }
}

/// The numbers of a group: the first stands for those that are missing. Returns the lanes that
/// have one of their own.
pub inline fn groupOf(comptime Lanes: type, all: []const u32, numbers: *[Lanes.count]u32) u32 {
    const count = @min(all.len, Lanes.count);
    for (numbers, 0..) |*number, lane| number.* = all[if (lane < count) lane else 0];
    return @truncate((@as(u64, 1) << @intCast(count)) - 1);
}

/// A key of rays that go much the same way: the octant of a direction, and of its axes the longest.
pub fn wayOf(direction: [3]f32) u16 {
    var key: u16 = 0;
    for (direction) |component| key = key << 1 | @intFromBool(component < 0);
    const size = [3]f32{ @abs(direction[0]), @abs(direction[1]), @abs(direction[2]) };
    const longest: u16 = if (size[0] >= size[1] and size[0] >= size[2])
        0
    else if (size[1] >= size[2]) 1 else 2;
    return key << 2 | longest;
}

/// Keys are smaller.
pub const key_count = 1024;

/// Sorts numbers by their keys, `keys[i]` that of `numbers[i]`; those of equal keys stay in order.
pub fn sort(numbers: []u32, keys: []const u16, room: []u32) void {
    assert(keys.len == numbers.len and room.len >= numbers.len);
    var ends: [key_count]u32 = @splat(0);
    for (keys) |key| ends[key] += 1;
    var sum: u32 = 0;
    for (&ends) |*end| {
        const start = sum;
        sum += end.*;
        end.* = start;
    }
    for (numbers, keys) |number, key| {
        room[ends[key]] = number;
        ends[key] += 1;
    }
    @memcpy(numbers, room[0..numbers.len]);
}

test "numbers are sorted by key, and in order where keys are the same" {
    var numbers = [_]u32{ 10, 11, 12, 13, 14 };
    var room: [5]u32 = undefined;
    sort(&numbers, &.{ 7, 0, 1023, 7, 0 }, &room);
    try std.testing.expectEqual([5]u32{ 11, 14, 10, 13, 12 }, numbers);
}

test "places of paths, and groups that are not full" {
    for ([_][3]u32{ .{ 0, 0, 0 }, .{ 3, 15, 2 }, .{ 1, 7, 15 } }) |place| {
        const number = Record.numberOf(place[0], place[1], place[2]);
        try std.testing.expectEqual(place, Record.placeOf(number));
    }
    const Lanes = @import("../../simd.zig").Lanes(.vector, 4);
    var numbers: [4]u32 = undefined;
    try std.testing.expectEqual(0b11, groupOf(Lanes, &.{ 9, 5 }, &numbers));
    try std.testing.expectEqual([4]u32{ 9, 5, 9, 9 }, numbers);
    try std.testing.expectEqual(0b1111, groupOf(Lanes, &.{ 9, 5, 1, 2, 3 }, &numbers));
}
