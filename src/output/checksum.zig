//! The two checksums of a PNG: CRC-32 of its chunks, Adler-32 of what they compress.
//!
//! In: bytes. Out: 32 bits. CRC-32 goes by 8 bytes at a time (M. Kounavis and F. Berry, "A
//! Systematic Approach to Building High Performance, Software-based, CRC Generators", 2005:
//! slicing-by-8), Adler-32 (RFC 1950) by blocks of lanes. Adler-32 of parts can be joined.

const std = @import("std");
const assert = std.debug.assert;

/// tables[k][byte]: what this byte adds to the remainder with k more bytes behind it.
const tables: [8][256]u32 = tables: {
    @setEvalBranchQuota(40_000);
    var result: [8][256]u32 = undefined;
    for (&result[0], 0..) |*entry, byte| {
        var remainder: u32 = byte;
        for (0..8) |_| {
            remainder = (remainder >> 1) ^ (if (remainder & 1 != 0) 0xedb88320 else 0);
        }
        entry.* = remainder;
    }
    for (result[1..], result[0..7]) |*table, *shorter| {
        for (table, shorter) |*entry, before| {
            entry.* = (before >> 8) ^ result[0][before & 0xff];
        }
    }
    break :tables result;
};

/// CRC-32 as PNG has it (ISO 3309), of all bytes.
pub fn crc32(bytes: []const u8) u32 {
    var remainder: u32 = 0xffff_ffff;
    var rest = bytes;
    while (rest.len >= 8) : (rest = rest[8..]) {
        const word = std.mem.readInt(u64, rest[0..8], .little) ^ remainder;
        remainder = 0;
        inline for (0..8) |index| {
            remainder ^= tables[7 - index][@as(u8, @truncate(word >> 8 * index))];
        }
    }
    for (rest) |byte| {
        remainder = (remainder >> 8) ^ tables[0][@as(u8, @truncate(remainder)) ^ byte];
    }
    return ~remainder;
}

/// Adler-32 of a number of bytes.
pub const Adler32 = struct {
    /// 1 and all bytes.
    sum: u32 = 1,
    /// All values that `sum` had after a byte.
    sum_of_sums: u32 = 0,

    const modulus = 65521;
    const lane_count = 32;
    /// Blocks of lanes before a lane of 16 bits overflows: 255 * (0 + ... + 22) < 2^16.
    const block_count_max = 22;

    /// Of these bytes.
    pub fn of(bytes: []const u8) Adler32 {
        const Lanes = @Vector(lane_count, u16);
        // How often the byte of a lane counts within its own block.
        const weights: @Vector(lane_count, u32) =
            @as(@Vector(lane_count, u32), @splat(lane_count)) - std.simd.iota(u32, lane_count);
        var adler: Adler32 = .{};
        var rest = bytes;
        while (rest.len >= lane_count) {
            const block_count: usize = @min(rest.len / lane_count, block_count_max);
            var sums: Lanes = @splat(0);
            var sums_before: Lanes = @splat(0);
            for (0..block_count) |block| {
                sums_before += sums;
                sums += @as(@Vector(lane_count, u8), rest[block * lane_count ..][0..lane_count].*);
            }
            const wide: @Vector(lane_count, u32) = sums;
            const wide_before: @Vector(lane_count, u32) = sums_before;
            const count: u32 = @intCast(block_count * lane_count);
            adler.sum_of_sums = (adler.sum_of_sums + count * adler.sum +
                lane_count * @reduce(.Add, wide_before) + @reduce(.Add, wide * weights)) % modulus;
            adler.sum = (adler.sum + @reduce(.Add, wide)) % modulus;
            rest = rest[count..];
        }
        for (rest) |byte| {
            adler.sum = (adler.sum + byte) % modulus;
            adler.sum_of_sums = (adler.sum_of_sums + adler.sum) % modulus;
        }
        return adler;
    }

    /// Of the bytes so far and then `byte_count` more, of which `next` is.
    pub fn join(adler: Adler32, next: Adler32, byte_count: usize) Adler32 {
        const count: u32 = @intCast(byte_count % modulus);
        // `next` began with 1 where it would have begun with `adler.sum`.
        const shift: u32 = @intCast(@as(u64, count) * (adler.sum + modulus - 1) % modulus);
        return .{
            .sum = (adler.sum + next.sum + modulus - 1) % modulus,
            .sum_of_sums = (adler.sum_of_sums + next.sum_of_sums + shift) % modulus,
        };
    }

    /// The checksum.
    pub fn value(adler: Adler32) u32 {
        assert(adler.sum < modulus and adler.sum_of_sums < modulus);
        return adler.sum_of_sums << 16 | adler.sum;
    }
};

test crc32 {
    try std.testing.expectEqual(0, crc32(""));
    // The check value of the CRC catalogues.
    try std.testing.expectEqual(0xcbf43926, crc32("123456789"));
    var random = std.Random.DefaultPrng.init(1);
    var bytes: [300]u8 = undefined;
    random.random().bytes(&bytes);
    for (0..bytes.len) |count| {
        try std.testing.expectEqual(std.hash.Crc32.hash(bytes[0..count]), crc32(bytes[0..count]));
    }
}

test Adler32 {
    var random = std.Random.DefaultPrng.init(2);
    var bytes: [8000]u8 = undefined;
    random.random().bytes(bytes[0..4000]);
    // The largest sums.
    @memset(bytes[4000..], 0xff);
    for ([_]usize{ 0, 1, 31, 32, 33, 703, 704, 705, 3999, 8000 }) |count| {
        for ([_][]const u8{ bytes[0..count], bytes[bytes.len - count ..] }) |part| {
            try std.testing.expectEqual(std.hash.Adler32.hash(part), Adler32.of(part).value());
            const rest = bytes[0 .. bytes.len - count];
            const joined = Adler32.of(part).join(.of(rest), rest.len);
            var expected: std.hash.Adler32 = .{};
            expected.update(part);
            expected.update(rest);
            try std.testing.expectEqual(expected.adler, joined.value());
        }
    }
}
