//! Mutation: an input becomes another one, by changes that know its structure or only its bytes.
//!
//! In: an input, others to take pieces from, and random numbers. Out: one to eight changes of it.
//! A format with parts is taken apart (mutate/container.zig), one part is changed, dropped, doubled
//! or taken from another input, and what counts and checks the parts is mended, so that the change
//! gets past the first look of a reader. Same numbers, same result.

const std = @import("std");
const Allocator = std.mem.Allocator;
const container = @import("mutate/container.zig");
const json = @import("mutate/json.zig");
const text = @import("mutate/text.zig");

/// What changes know of an input.
pub const Structure = enum {
    bytes,
    text,
    json,
    /// A header in text before bytes.
    mixed,
    glb,
    /// GLB of which numbers and data alone are changed.
    glb_numbers,
    png,
    jpeg,
    riff,
    exr,
};

/// Most changes at a time.
const change_count_max = 8;

/// Makes inputs of others. All memory is from `arena`.
pub const Mutator = struct {
    arena: Allocator,
    random: std.Random,
    /// What pieces are taken from.
    others: []const []const u8,

    /// A changed copy of `input`.
    pub fn mutate(
        mutator: *const Mutator,
        structure: Structure,
        input: []const u8,
    ) Allocator.Error![]const u8 {
        var result = input;
        // One change is half of all.
        const count = @min(change_count_max, 1 + @ctz(mutator.random.int(u32) | 1 << 31));
        for (0..count) |_| result = try mutator.change(structure, result);
        return result;
    }

    fn change(
        mutator: *const Mutator,
        structure: Structure,
        input: []const u8,
    ) Allocator.Error![]const u8 {
        // What no structure allows is tried as well.
        if (mutator.oneIn(8)) return mutator.changeBytes(input);
        return switch (structure) {
            .bytes => mutator.changeBytes(input),
            .text => text.change(mutator, input),
            .json => json.change(mutator, input),
            .mixed => if (mutator.oneIn(2)) text.change(mutator, input) else mutator
                .changeBytes(input),
            .glb => container.change(.glb, mutator, input),
            .glb_numbers => container.change(.glb_numbers, mutator, input),
            .png => container.change(.png, mutator, input),
            .jpeg => container.change(.jpeg, mutator, input),
            .riff => container.change(.riff, mutator, input),
            .exr => container.change(.exr, mutator, input),
        };
    }

    /// Changes bytes, whatever they mean.
    pub fn changeBytes(mutator: *const Mutator, input: []const u8) Allocator.Error![]const u8 {
        if (input.len == 0) return mutator.noise();
        const random = mutator.random;
        const at = mutator.below(input.len);
        const length = mutator.lengthBelow(input.len - at);
        const piece = input[at..][0..length];
        const other = mutator.pieceOf(mutator.anyOther());
        return switch (mutator.below(10)) {
            0, 1 => mutator.changeNumber(input, at),
            2 => flipped: {
                const copy = try mutator.arena.dupe(u8, input);
                copy[at] ^= @as(u8, 1) << random.int(u3);
                break :flipped copy;
            },
            3 => mutator.replaced(input, at, at + 1, &.{random.int(u8)}),
            4 => mutator.replaced(input, at, at + length, ""),
            5 => mutator.replaced(input, mutator.below(input.len + 1), null, piece),
            6 => mutator.replaced(input, at, null, try mutator.noise()),
            7 => mutator.replaced(input, at, @min(input.len, at + other.len), other),
            8 => mutator.replaced(input, at, null, other),
            9 => input[0..at],
            else => unreachable,
        };
    }

    /// Writes an integer or a float over the bytes from `at` on.
    fn changeNumber(
        mutator: *const Mutator,
        input: []const u8,
        at: usize,
    ) Allocator.Error![]const u8 {
        const random = mutator.random;
        const copy = try mutator.arena.dupe(u8, input);
        const left = input.len - at;
        const log2_bytes: u3 = @intCast(@min(random.uintLessThan(u3, 4), std.math.log2_int(
            usize,
            left,
        )));
        const width = @as(usize, 1) << log2_bytes;
        // Numbers of files are mostly aligned.
        const start = if (random.boolean()) at & ~(width - 1) else at;
        const bytes = copy[start..][0..width];
        const endian: std.lang.Endian = if (mutator.oneIn(4)) .big else .little;
        const before = std.mem.readVarInt(u64, bytes, endian);
        const after = switch (random.uintLessThan(u8, 3)) {
            0 => before +% random.uintLessThan(u64, 17) -% 8,
            1 => interesting_integers[mutator.below(interesting_integers.len)],
            else => @as(u64, @as(u32, @bitCast(
                interesting_floats[mutator.below(interesting_floats.len)],
            ))),
        };
        for (bytes, 0..) |*byte, index| {
            const place = if (endian == .little) index else width - 1 - index;
            byte.* = @truncate(after >> @intCast(8 * place));
        }
        return copy;
    }

    /// `input` with `middle` in place of what is from `start` to `end`; null: to `start`.
    pub fn replaced(
        mutator: *const Mutator,
        input: []const u8,
        start: usize,
        end: ?usize,
        middle: []const u8,
    ) Allocator.Error![]const u8 {
        return std.mem.concat(mutator.arena, u8, &.{
            input[0..start], middle, input[end orelse start ..],
        });
    }

    /// One byte many times, or random ones.
    fn noise(mutator: *const Mutator) Allocator.Error![]const u8 {
        const bytes = try mutator.arena.alloc(u8, mutator.lengthBelow(256));
        if (mutator.random.boolean()) @memset(bytes, mutator.random.int(u8)) else mutator
            .random.bytes(bytes);
        return bytes;
    }

    /// Some bytes of an input.
    fn pieceOf(mutator: *const Mutator, input: []const u8) []const u8 {
        if (input.len == 0) return input;
        const at = mutator.below(input.len);
        return input[at..][0..mutator.lengthBelow(input.len - at)];
    }

    /// One of the inputs that pieces are taken from.
    pub fn anyOther(mutator: *const Mutator) []const u8 {
        if (mutator.others.len == 0) return "";
        return mutator.others[mutator.below(mutator.others.len)];
    }

    /// Whether it is one of `count` cases.
    pub fn oneIn(mutator: *const Mutator, count: usize) bool {
        return mutator.below(count) == 0;
    }

    /// A number from 0 on; asserts that there is one.
    pub fn below(mutator: *const Mutator, count: usize) usize {
        return mutator.random.uintLessThan(usize, count);
    }

    /// 1 to `count`, mostly small; asserts that `count` is not 0.
    pub fn lengthBelow(mutator: *const Mutator, count: usize) usize {
        const most = @as(usize, 1) << @intCast(mutator.below(10));
        return 1 + mutator.below(@min(count, most));
    }
};

/// At the limits of types and of tables.
const interesting_integers = [_]u64{
    0,          1,          2,          3,          4,          7,          8,
    16,         31,         32,         64,         100,        127,        128,
    255,        256,        512,        1000,       1024,       4095,       4096,
    32767,      32768,      65535,      65536,      1 << 20,    0x7fffffff, 0x80000000,
    0xfffffffe, 0xffffffff, 1 << 32,    1 << 53,    1 << 62,    1 << 63,    0x7fffffffffffffff,
    0xffffff7f, 0xffffff80, 0xffff7fff, 0xffff8000, 1000000000, 1 << 28,    0xffffffffffffffff,
};

const interesting_floats = [_]f32{
    0,                       -0.0,
    1,                       -1,
    0.5,                     1e-45,
    1e-38,                   1e10,
    1e30,                    std.math.floatMax(f32),
    -std.math.floatMax(f32), std.math.inf(f32),
    -std.math.inf(f32),      std.math.nan(f32),
};
