//! Image pyramids (Williams 1983, "Pyramidal parametrics"): each level is the one before, averaged
//! over boxes of two by two texels.
//!
//! In: rows of 8-bit texels. Out: all levels down to one texel. Sizes are halved and rounded down,
//! as in OpenGL; along an odd side three texels with weights that move along it make one, so that
//! none is lost and none counts more than another (Guthe and Heckbert 2005, "Non-power-of-two
//! mipmap creation"). Light is averaged linearly: codes of the sRGB curve are decoded by a table,
//! summed in f32 in a fixed order, and encoded to the nearest code by another. Normals are averaged
//! as they stand: what is left of their length tells how much they differ. Colours count by their
//! alpha, so that what is seen nowhere bleeds into nothing.
//!
//! Alpha that is cut off keeps its coverage (Castano 2010, "Computing alpha mipmaps"): in each
//! level it is scaled so that as large a share of it as of the finest level is above the cutoff;
//! otherwise leaves would thin out with the distance.

const std = @import("std");
const huge_pages = @import("../huge_pages.zig");
const srgb = @import("../math.zig").srgb;
const world = @import("../world.zig");
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;
const Level = world.TextureLevel;

/// Longest side of an image, in texels.
pub const side_max = 1 << 15;

/// Levels at most: of a side of 2^15 texels.
const level_count_max = 16;

/// What the bytes of a texel mean, and so how they are averaged.
pub const Encoding = enum {
    /// Numbers.
    linear,
    /// Light by the sRGB curve.
    srgb,
    /// The same, and alpha as the fourth.
    srgb_alpha,
};

/// An image whose texels are owned by whoever holds it.
pub const Image = struct {
    width: u32,
    height: u32,
    channel_count: u8,
    encoding: Encoding,
    texels: []u8,
    /// What the texels lie in, from `huge_pages.alloc`.
    memory: []align(64) u8,

    fn level(image: *const Image) Level {
        return .{ .width = image.width, .height = image.height, .texels = image.texels };
    }
};

/// An image and its smaller copies.
pub const Pyramid = struct {
    level_array: [level_count_max]Level,
    level_count: u8,
    /// What the finest level lies in, and all others.
    finest: []align(64) u8,
    others: []align(64) u8,

    /// From the finest on.
    pub fn levels(pyramid: *const Pyramid) []const Level {
        return pyramid.level_array[0..pyramid.level_count];
    }

    /// Frees the texels, which came from `gpa`.
    pub fn deinit(pyramid: *const Pyramid, gpa: Allocator) void {
        huge_pages.free(gpa, pyramid.finest);
        huge_pages.free(gpa, pyramid.others);
    }
};

/// Bytes of all texels of a pyramid.
pub fn byteCount(width: u32, height: u32, channel_count: u8) u64 {
    var total: u64 = 0;
    var size = [2]u32{ width, height };
    while (true) : (size = .{ half(size[0]), half(size[1]) }) {
        total += @as(u64, size[0]) * size[1] * channel_count;
        if (size[0] == 1 and size[1] == 1) return total;
    }
}

/// The size that an image has after it was halved until no side is longer than `longest`.
pub fn sizeWithin(width: u32, height: u32, longest: u32) [2]u32 {
    assert(longest >= 1);
    var size = [2]u32{ width, height };
    while (@max(size[0], size[1]) > longest) size = .{ half(size[0]), half(size[1]) };
    return size;
}

fn half(size: u32) u32 {
    return @max(size / 2, 1);
}

/// The pyramid of an image that is halved until no side is longer than `longest`. Its texels are
/// taken over, and freed on errors; all comes from `gpa`. `cutoff`: code of alpha below which there
/// are holes, for images that have alpha.
pub fn build(
    gpa: Allocator,
    from: Image,
    longest: u32,
    cutoff: ?u8,
) error{OutOfMemory}!Pyramid {
    var image = from;
    errdefer huge_pages.free(gpa, image.memory);
    assert(image.texels.len == @as(u64, image.width) * image.height * image.channel_count);
    assert(@max(image.width, image.height) <= side_max);
    assert(image.encoding != .srgb_alpha or image.channel_count == 4);
    const coverage: ?Coverage = if (image.encoding == .srgb_alpha)
        if (cutoff) |code| .of(&image.level(), code) else null
    else
        null;
    const is_shrunk = @max(image.width, image.height) > longest;
    while (@max(image.width, image.height) > longest) {
        const width = half(image.width);
        const height = half(image.height);
        const texels = try huge_pages.alloc(gpa, u8, width * height * image.channel_count);
        halve(&image, &image.level(), texels);
        huge_pages.free(gpa, image.memory);
        image.width = width;
        image.height = height;
        image.texels = texels;
        image.memory = texels;
    }
    var pyramid: Pyramid = .{
        .level_array = undefined,
        .level_count = 1,
        .finest = image.memory,
        .others = undefined,
    };
    const total = byteCount(image.width, image.height, image.channel_count);
    pyramid.others = try huge_pages.alloc(gpa, u8, @intCast(total - image.texels.len));
    pyramid.level_array[0] = image.level();
    fillOthers(&image, &pyramid);
    if (coverage) |kept| {
        // Only now: each level is made of alphas as they were.
        const first: usize = if (is_shrunk) 0 else 1;
        for (pyramid.levels()[first..]) |*level| kept.keep(@constCast(level.texels));
    }
    return pyramid;
}

fn fillOthers(image: *const Image, pyramid: *Pyramid) void {
    var rest: []u8 = pyramid.others;
    while (true) : (pyramid.level_count += 1) {
        const level = &pyramid.level_array[pyramid.level_count - 1];
        if (level.width == 1 and level.height == 1) break;
        const width = half(level.width);
        const height = half(level.height);
        const texels = rest[0 .. width * height * image.channel_count];
        rest = rest[texels.len..];
        halve(image, level, texels);
        pyramid.level_array[pyramid.level_count] = .{
            .width = width,
            .height = height,
            .texels = texels,
        };
    }
    assert(rest.len == 0);
}

/// Makes the next level, of half the size, of a level of the image.
fn halve(image: *const Image, from: *const Level, to: []u8) void {
    switch (image.encoding) {
        .linear => switch (image.channel_count) {
            inline 1...4 => |count| Halving(.linear, count).run(from, to),
            else => unreachable,
        },
        .srgb => switch (image.channel_count) {
            inline 1, 3 => |count| Halving(.srgb, count).run(from, to),
            else => unreachable, // What holds alpha says so.
        },
        .srgb_alpha => Halving(.srgb_alpha, 4).run(from, to),
    }
}

/// The texels along one side that make one of the next level, and their weights.
const Taps = struct {
    first: u32,
    count: u32,
    weights: [3]f32,

    fn of(size: u32, index: u32) Taps {
        if (size == 1) return .{ .first = 0, .count = 1, .weights = .{ 1, 0, 0 } };
        const first = 2 * index;
        if (size % 2 == 0) return .{ .first = first, .count = 2, .weights = .{ 0.5, 0.5, 0 } };
        const all: f32 = @floatFromInt(size);
        const before: f32 = @floatFromInt(size / 2 - index);
        const middle: f32 = @floatFromInt(size / 2);
        const after: f32 = @floatFromInt(index + 1);
        return .{
            .first = first,
            .count = 3,
            .weights = .{ before / all, middle / all, after / all },
        };
    }
};

fn Halving(comptime encoding: Encoding, comptime channel_count: comptime_int) type {
    return struct {
        /// Texels that are made at a time.
        const block = if (encoding == .linear) 16 else 8;
        const Bytes = @Vector(2 * block * channel_count, u8);
        const HalfBytes = @Vector(block * channel_count, u8);
        const lefts = everySecond(0);
        const rights = everySecond(1);

        fn run(from: *const Level, to: []u8) void {
            const width = half(from.width);
            const height = half(from.height);
            assert(to.len == width * height * channel_count);
            const is_even = from.width % 2 == 0 and from.height % 2 == 0;
            const stride = from.width * channel_count;
            for (0..height) |y| {
                const row = to[y * width * channel_count ..][0 .. width * channel_count];
                if (is_even) {
                    const upper = from.texels[2 * y * stride ..][0..stride];
                    const lower = from.texels[(2 * y + 1) * stride ..][0..stride];
                    evenRow(upper, lower, row);
                } else {
                    anyRow(from, .of(from.height, @intCast(y)), row);
                }
            }
        }

        /// Of two rows with twice as many texels.
        fn evenRow(upper: []const u8, lower: []const u8, to: []u8) void {
            assert(upper.len == 2 * to.len and lower.len == upper.len);
            const step = block * channel_count;
            var at: usize = 0;
            while (at + step <= to.len) : (at += step) {
                to[at..][0..step].* = evenBlock(
                    upper[2 * at ..][0 .. 2 * step],
                    lower[2 * at ..][0 .. 2 * step],
                );
            }
            if (at == to.len) return;
            // The rest, and whatever follows it.
            var padded: [2][2 * step]u8 = @splat(@splat(0));
            @memcpy(padded[0][0 .. upper.len - 2 * at], upper[2 * at ..]);
            @memcpy(padded[1][0 .. lower.len - 2 * at], lower[2 * at ..]);
            const last = evenBlock(&padded[0], &padded[1]);
            @memcpy(to[at..], last[0 .. to.len - at]);
        }

        inline fn evenBlock(
            upper: *const [2 * block * channel_count]u8,
            lower: *const [2 * block * channel_count]u8,
        ) [block * channel_count]u8 {
            const a: Bytes = upper.*;
            const b: Bytes = lower.*;
            if (encoding == .linear) return linearBlock(a, b);
            // Plain areas are common, and stay what they are.
            const left = @shuffle(u8, a, undefined, lefts);
            const right = @shuffle(u8, a, undefined, rights);
            if (@reduce(.And, a == b) and @reduce(.And, left == right)) return left;
            return if (encoding == .srgb) srgbBlock(upper, lower) else alphaBlock(upper, lower);
        }

        /// Rounded to nearest, halves to even, so that nothing drifts from level to level.
        inline fn linearBlock(upper: Bytes, lower: Bytes) HalfBytes {
            const Words = @Vector(2 * block * channel_count, u16);
            const HalfWords = @Vector(block * channel_count, u16);
            const sums = @as(Words, upper) + @as(Words, lower);
            const total = @shuffle(u16, sums, undefined, lefts) +
                @shuffle(u16, sums, undefined, rights);
            const one: HalfWords = @splat(1);
            const two: @Vector(block * channel_count, u4) = @splat(2);
            return @truncate((total + one + ((total >> two) & one)) >> two);
        }

        inline fn srgbBlock(
            upper: *const [2 * block * channel_count]u8,
            lower: *const [2 * block * channel_count]u8,
        ) [block * channel_count]u8 {
            var sums: [block * channel_count]f32 = undefined;
            inline for (&sums, 0..) |*sum, index| {
                const left = lefts[index];
                const right = rights[index];
                sum.* = (srgb.decoded[upper[left]] + srgb.decoded[upper[right]]) +
                    (srgb.decoded[lower[left]] + srgb.decoded[lower[right]]);
            }
            const quarter: @Vector(sums.len, f32) = @splat(0.25);
            return srgb.encodeLanes(sums.len, @as(@Vector(sums.len, f32), sums) * quarter);
        }

        fn alphaBlock(
            upper: *const [2 * block * channel_count]u8,
            lower: *const [2 * block * channel_count]u8,
        ) [block * channel_count]u8 {
            var result: [block * channel_count]u8 = undefined;
            for (0..block) |texel| {
                var average: Average = .{};
                for ([_]*const [2 * block * channel_count]u8{ upper, lower }) |row| {
                    average.add(row[2 * texel * channel_count ..][0..channel_count], 0.25);
                    average.add(row[(2 * texel + 1) * channel_count ..][0..channel_count], 0.25);
                }
                result[texel * channel_count ..][0..channel_count].* = average.codes();
            }
            return result;
        }

        /// Of rows of any sizes.
        fn anyRow(from: *const Level, rows: Taps, to: []u8) void {
            for (0..to.len / channel_count) |x| {
                const columns: Taps = .of(from.width, @intCast(x));
                var average: Average = .{};
                for (0..rows.count) |row| for (0..columns.count) |column| {
                    const texel = (rows.first + row) * from.width + columns.first + column;
                    average.add(
                        from.texels[texel * channel_count ..][0..channel_count],
                        rows.weights[row] * columns.weights[column],
                    );
                };
                to[x * channel_count ..][0..channel_count].* = average.codes();
            }
        }

        /// A weighted sum of texels whose weights add up to 1.
        const Average = struct {
            sums: [channel_count]f32 = @splat(0),
            /// Where there is alpha: colours weighted by it.
            alpha_sums: [3]f32 = @splat(0),

            inline fn add(average: *Average, texel: *const [channel_count]u8, weight: f32) void {
                inline for (&average.sums, texel, 0..) |*sum, code, channel| {
                    const is_light = encoding != .linear and channel < 3;
                    const value: f32 = if (is_light) srgb.decoded[code] else @floatFromInt(code);
                    sum.* = sum.* + weight * value;
                    if (encoding == .srgb_alpha and is_light) {
                        const alpha: f32 = @floatFromInt(texel[3]);
                        const by_alpha = &average.alpha_sums[channel];
                        by_alpha.* = by_alpha.* + weight * (alpha * value);
                    }
                }
            }

            inline fn codes(average: *const Average) [channel_count]u8 {
                var result: [channel_count]u8 = undefined;
                inline for (&result, average.sums, 0..) |*code, sum, channel| {
                    if (encoding == .linear or channel == 3) {
                        code.* = rounded(sum);
                    } else if (encoding == .srgb_alpha and average.sums[3] > 0) {
                        code.* = srgb.encode(average.alpha_sums[channel] / average.sums[3]);
                    } else {
                        code.* = srgb.encode(sum);
                    }
                }
                return result;
            }
        };

        /// Of the bytes of twice as many texels, those of every second texel from `first` on.
        fn everySecond(comptime first: comptime_int) [block * channel_count]i32 {
            var indices: [block * channel_count]i32 = undefined;
            for (&indices, 0..) |*index, byte| {
                const texel = byte / channel_count;
                index.* = (2 * texel + first) * channel_count + byte % channel_count;
            }
            return indices;
        }
    };
}

/// The nearest code. Asserts that the value is within their range, but for rounding.
fn rounded(value: f32) u8 {
    assert(value >= 0 and value < 255.5);
    return @intFromFloat(value + 0.5);
}

/// How much of an image lies above a cutoff.
const Coverage = struct {
    cutoff: u8,
    above_count: u64,
    count: u64,

    fn of(level: *const Level, cutoff: u8) Coverage {
        const histogram = alphaHistogram(level.texels);
        var above_count: u64 = 0;
        for (histogram[cutoff..]) |count| above_count += count;
        return .{ .cutoff = cutoff, .above_count = above_count, .count = level.texels.len / 4 };
    }

    /// Scales alpha so that the share above the cutoff is the nearest to this one that there is.
    fn keep(coverage: *const Coverage, texels: []u8) void {
        if (coverage.above_count == 0 or coverage.above_count == coverage.count) return;
        const histogram = alphaHistogram(texels);
        const code_count: u64 = texels.len / 4;
        // In units of 1 / (count code_count).
        const wanted = coverage.above_count * code_count;
        var nearest: u64 = std.math.maxInt(u64);
        var least: usize = 0;
        var above_count: u64 = 0;
        var code: usize = 256;
        while (code > 1) {
            code -= 1;
            above_count += histogram[code];
            const have = above_count * coverage.count;
            const difference = if (have > wanted) have - wanted else wanted - have;
            if (difference <= nearest) {
                nearest = difference;
                least = code;
            }
        }
        coverage.scale(texels, least);
    }

    /// So that the code `least` comes out above the cutoff, and the one before below it.
    fn scale(coverage: *const Coverage, texels: []u8, least: usize) void {
        assert(least >= 1 and coverage.cutoff >= 1);
        if (least == coverage.cutoff) return;
        const to = @as(f32, @floatFromInt(coverage.cutoff)) - 0.5;
        const factor = to / (@as(f32, @floatFromInt(least)) - 0.5);
        var table: [256]u8 = undefined;
        for (&table, 0..) |*scaled, code| {
            const exact = @as(f32, @floatFromInt(code)) * factor;
            scaled.* = if (exact < 255) rounded(exact) else 255;
            // Whatever the rounding of the factor.
            if (code >= least) scaled.* = @max(scaled.*, coverage.cutoff);
            if (code < least) scaled.* = @min(scaled.*, coverage.cutoff - 1);
        }
        var at: usize = 3;
        while (at < texels.len) : (at += 4) texels[at] = table[texels[at]];
    }
};

fn alphaHistogram(texels: []const u8) [256]u64 {
    var histogram: [256]u64 = @splat(0);
    var at: usize = 3;
    while (at < texels.len) : (at += 4) histogram[texels[at]] += 1;
    return histogram;
}

const testing = std.testing;

fn testBuild(
    width: u32,
    height: u32,
    channel_count: u8,
    encoding: Encoding,
    texels: []const u8,
    cutoff: ?u8,
) !Pyramid {
    const memory = try huge_pages.alloc(testing.allocator, u8, texels.len);
    @memcpy(memory, texels);
    return build(testing.allocator, .{
        .width = width,
        .height = height,
        .channel_count = channel_count,
        .encoding = encoding,
        .texels = memory,
        .memory = memory,
    }, side_max, cutoff);
}

test "levels are halved and rounded down to one texel" {
    const texels: [13 * 4]u8 = @splat(7);
    const pyramid = try testBuild(13, 4, 1, .linear, &texels, null);
    defer pyramid.deinit(testing.allocator);
    const sizes = [_][2]u32{ .{ 13, 4 }, .{ 6, 2 }, .{ 3, 1 }, .{ 1, 1 } };
    try testing.expectEqual(sizes.len, pyramid.levels().len);
    var total: u64 = 0;
    for (sizes, pyramid.levels()) |size, level| {
        try testing.expectEqual(size, .{ level.width, level.height });
        try testing.expectEqual(size[0] * size[1], level.texels.len);
        for (level.texels) |texel| try testing.expectEqual(7, texel);
        total += level.texels.len;
    }
    try testing.expectEqual(total, byteCount(13, 4, 1));
    const one = try testBuild(1, 1, 3, .srgb, &.{ 1, 2, 3 }, null);
    defer one.deinit(testing.allocator);
    try testing.expectEqual(1, one.levels().len);
    try testing.expectEqualSlices(u8, &.{ 1, 2, 3 }, one.levels()[0].texels);
}

test "numbers are averaged as they are, light linearly" {
    const texels = [_]u8{ 0, 255, 255, 255, 0, 7, 0, 8, 255, 7, 0, 9 };
    const linear = try testBuild(2, 2, 3, .linear, &texels, null);
    defer linear.deinit(testing.allocator);
    // Of 65.5, 65.75 and 131.5, halves to even.
    try testing.expectEqualSlices(u8, &.{ 66, 66, 132 }, linear.levels()[1].texels);
    const light = try testBuild(2, 2, 1, .srgb, &.{ 0, 255, 255, 0 }, null);
    defer light.deinit(testing.allocator);
    try testing.expectEqualSlices(u8, &.{188}, light.levels()[1].texels);
}

test "halves are rounded to even" {
    const Case = struct { [4]u8, u8 };
    for ([_]Case{
        .{ .{ 0, 0, 1, 1 }, 0 },
        .{ .{ 1, 1, 2, 2 }, 2 },
        .{ .{ 2, 2, 3, 3 }, 2 },
        .{ .{ 0, 1, 1, 1 }, 1 },
        .{ .{ 255, 255, 254, 254 }, 254 },
        .{ .{ 253, 253, 254, 254 }, 254 },
    }) |case| {
        const pyramid = try testBuild(2, 2, 1, .linear, &case[0], null);
        defer pyramid.deinit(testing.allocator);
        try testing.expectEqual(case[1], pyramid.levels()[1].texels[0]);
    }
}

test "no texel of an odd side is lost, and all count the same" {
    // The mean of the 1x1 level is that of the image, whatever single texel is bright.
    const width = 5;
    const height = 3;
    for (0..width * height) |bright| {
        var texels: [width * height]u8 = @splat(0);
        texels[bright] = 255;
        const level: Level = .{ .width = width, .height = height, .texels = &texels };
        var next: [2]u8 = undefined;
        Halving(.linear, 1).run(&level, &next);
        // 255 / 15 = 17 is the mean; half of what two texels sum up to.
        const sum = @as(u32, next[0]) + next[1];
        try testing.expect(sum >= 33 and sum <= 35);
    }
    var weights: [7]f32 = @splat(0);
    for (0..3) |index| {
        const taps: Taps = .of(7, @intCast(index));
        for (0..taps.count) |tap| weights[taps.first + tap] += taps.weights[tap];
    }
    for (weights) |weight| try testing.expectApproxEqAbs(@as(f32, 3.0 / 7.0), weight, 1e-6);
}

test "blocks, and what is left of a row, are the averages that they should be" {
    var random_state: std.Random.DefaultPrng = .init(3);
    const random = random_state.random();
    const kinds = .{ .{ Encoding.linear, 3 }, .{ Encoding.linear, 2 }, .{ Encoding.srgb, 3 } };
    inline for (kinds) |kind| {
        const channel_count = kind[1];
        for ([_]u32{ 2, 6, 16, 34, 70 }) |width| {
            var texels: [70 * 2 * channel_count]u8 = undefined;
            random.bytes(&texels);
            const used = texels[0 .. width * 2 * channel_count];
            var next: [35 * channel_count]u8 = undefined;
            const level: Level = .{ .width = width, .height = 2, .texels = used };
            Halving(kind[0], channel_count).run(&level, next[0 .. width / 2 * channel_count]);
            for (next[0 .. width / 2 * channel_count], 0..) |code, index| {
                const texel = index / channel_count;
                const channel = index % channel_count;
                var sum: f64 = 0;
                for (0..2) |row| for (0..2) |column| {
                    const at = row * width + 2 * texel + column;
                    const value = used[at * channel_count + channel];
                    sum += if (kind[0] == .srgb) srgb.decoded[value] else @floatFromInt(value);
                };
                if (kind[0] == .srgb) {
                    try testing.expectEqual(srgb.encode(@floatCast(sum / 4)), code);
                } else {
                    try testing.expect(@abs(sum / 4 - @as(f64, @floatFromInt(code))) <= 0.5);
                }
            }
        }
    }
}

test "what is not seen gives no colour" {
    const pyramid = try testBuild(2, 2, 4, .srgb_alpha, &.{
        255, 0, 0, 255, 0, 255, 0, 0, 0, 255, 0, 0, 255, 0, 0, 255,
    }, null);
    defer pyramid.deinit(testing.allocator);
    try testing.expectEqualSlices(u8, &.{ 255, 0, 0, 128 }, pyramid.levels()[1].texels);
    const unseen = try testBuild(2, 1, 4, .srgb_alpha, &.{ 255, 0, 0, 0, 255, 255, 0, 0 }, null);
    defer unseen.deinit(testing.allocator);
    try testing.expectEqualSlices(u8, &.{ 255, 188, 0, 0 }, unseen.levels()[1].texels);
}

test "the share above the cutoff stays over the levels" {
    var random_state: std.Random.DefaultPrng = .init(17);
    const random = random_state.random();
    const side = 64;
    for ([_]u8{ 10, 90, 160 }) |percent| for ([_]u8{ 128, 26, 230 }) |cutoff| {
        var texels: [side * side * 4]u8 = undefined;
        for (0..side * side) |texel| {
            const is_above = random.uintLessThan(u8, 200) < percent;
            texels[4 * texel ..][0..4].* = .{ 9, 9, 9, if (is_above) 255 else 0 };
        }
        const pyramid = try testBuild(side, side, 4, .srgb_alpha, &texels, cutoff);
        defer pyramid.deinit(testing.allocator);
        const finest: Coverage = .of(&pyramid.levels()[0], cutoff);
        for (pyramid.levels()[1..4]) |*level| {
            const coarse: Coverage = .of(level, cutoff);
            const wanted = @as(f64, @floatFromInt(finest.above_count)) / side / side;
            const count: f64 = @floatFromInt(coarse.count);
            const have = @as(f64, @floatFromInt(coarse.above_count)) / count;
            // Alphas of one level take few values at first.
            try testing.expect(@abs(have - wanted) < 0.2);
        }
    };
}

test "images are halved until they fit" {
    var texels: [12 * 10 * 2]u8 = undefined;
    for (&texels, 0..) |*texel, index| texel.* = @intCast(index);
    const whole = try testBuild(12, 10, 2, .linear, &texels, null);
    defer whole.deinit(testing.allocator);
    try testing.expectEqual([2]u32{ 6, 5 }, sizeWithin(12, 10, 6));
    try testing.expectEqual([2]u32{ 3, 2 }, sizeWithin(12, 10, 5));
    try testing.expectEqual([2]u32{ 1, 1 }, sizeWithin(12, 10, 1));
    for ([_]u32{ 12, 6, 5, 1 }, [_]usize{ 0, 1, 2, 3 }) |longest, dropped| {
        const memory = try huge_pages.alloc(testing.allocator, u8, texels.len);
        @memcpy(memory, &texels);
        const made = try build(testing.allocator, .{
            .width = 12,
            .height = 10,
            .channel_count = 2,
            .encoding = .linear,
            .texels = memory,
            .memory = memory,
        }, longest, null);
        defer made.deinit(testing.allocator);
        const rest = whole.levels()[dropped..];
        try testing.expectEqual(rest.len, made.levels().len);
        for (rest, made.levels()) |a, b| try testing.expectEqualSlices(u8, a.texels, b.texels);
    }
}

test "memory that runs out leaks nothing" {
    const one = struct {
        fn one(failing: Allocator, longest: u32) !void {
            const memory = try huge_pages.alloc(failing, u8, 8 * 8 * 3);
            @memset(memory, 5);
            const pyramid = try build(failing, .{
                .width = 8,
                .height = 8,
                .channel_count = 3,
                .encoding = .srgb,
                .texels = memory,
                .memory = memory,
            }, longest, null);
            pyramid.deinit(failing);
        }
    }.one;
    for ([_]u32{ 8, 3 }) |longest| {
        try testing.checkAllAllocationFailures(testing.allocator, one, .{longest});
    }
}
