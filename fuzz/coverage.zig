//! Which code inputs reach: counters that LLVM's SanitizerCoverage puts on every edge.
//!
//! In: the counters of the program, which it counts up as it runs. Out: whether an input has done
//! what none before it did: reached an edge, or reached it another number of times (by powers of
//! two, as AFL has it). A program without counters reaches nothing new.

const std = @import("std");
const Allocator = std.mem.Allocator;

/// Counters at a time; most are 0.
const block_bytes = 64;

/// The edges of one program.
pub const Coverage = struct {
    counters: []u8,
    /// A bit for each number of times that an edge was reached, by `bitOf`.
    seen: []u8,
    edge_count: usize = 0,

    pub fn init(gpa: Allocator, counters: []u8) Allocator.Error!Coverage {
        const seen = try gpa.alloc(u8, counters.len);
        @memset(seen, 0);
        return .{ .counters = counters, .seen = seen };
    }

    pub fn deinit(coverage: *Coverage, gpa: Allocator) void {
        gpa.free(coverage.seen);
        coverage.* = undefined;
    }

    /// Before an input.
    pub fn clear(coverage: *const Coverage) void {
        @memset(coverage.counters, 0);
    }

    /// After an input: whether it did something new, which from now on is not.
    pub fn collect(coverage: *Coverage) bool {
        var is_new = false;
        var start: usize = 0;
        while (start < coverage.counters.len) : (start += block_bytes) {
            const end = @min(coverage.counters.len, start + block_bytes);
            const block = coverage.counters[start..end];
            if (std.mem.allEqual(u8, block, 0)) continue;
            for (block, coverage.seen[start..end]) |count, *seen| {
                const bit = bitOf(count);
                if (bit & ~seen.* == 0) continue;
                if (seen.* == 0) coverage.edge_count += 1;
                seen.* |= bit;
                is_new = true;
            }
        }
        return is_new;
    }

    fn bitOf(count: u8) u8 {
        return switch (count) {
            0 => 0,
            1...3 => @as(u8, 1) << @intCast(count - 1),
            4...7 => 1 << 3,
            8...15 => 1 << 4,
            16...31 => 1 << 5,
            32...127 => 1 << 6,
            128...255 => 1 << 7,
        };
    }
};
