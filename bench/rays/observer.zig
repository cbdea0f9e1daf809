//! What came out of a picture's rays, looked at in a run of its own that is not timed.
//!
//! In: batches after they were traced. Out: counts, and one number that is the same for two tracers
//! only if every ray of theirs hit the same primitive at the same t, to the last bit.

const std = @import("std");
const batch_file = @import("batch.zig");
const XxHash64 = std.hash.XxHash64;

/// Counts of a picture.
pub const Counts = struct {
    hits: u64 = 0,
    /// Of primary hits in shadow.
    occluded: u64 = 0,
    /// Of primary hits, in the order of the tiles.
    t_sum: f64 = 0,
    reflections: u64 = 0,
    reflection_hits: u64 = 0,
    reflection_occluded: u64 = 0,
};

/// Watches one thread that makes a whole picture.
pub const Observer = struct {
    counts: Counts = .{},
    hash: XxHash64 = .init(0),

    /// Primary rays were traced.
    pub fn sawPrimary(observer: *Observer, rays: anytype) void {
        observer.counts.hits += observer.sawHits(rays);
        for (0..batch_file.ray_count) |index| {
            const hit = hitAt(rays, index) orelse continue;
            observer.counts.t_sum += hit[1];
        }
    }

    /// Reflection rays were traced.
    pub fn sawReflections(observer: *Observer, rays: anytype) void {
        for (0..batch_file.ray_count) |index| {
            const is_active = rays.isActive(index % batch_file.side, index / batch_file.side);
            observer.counts.reflections += @intFromBool(is_active);
        }
        observer.counts.reflection_hits += observer.sawHits(rays);
    }

    /// Shadow rays of the hits after `depth` bounces were traced.
    pub fn sawShadows(observer: *Observer, rays: anytype, depth: u32) void {
        var occluded: [batch_file.ray_count]u8 = undefined;
        var count: u64 = 0;
        for (&occluded, 0..) |*flag, index| {
            flag.* = @intFromBool(hitAt(rays, index) != null);
            count += flag.*;
        }
        observer.hash.update(&occluded);
        if (depth == 0) {
            observer.counts.occluded += count;
        } else {
            observer.counts.reflection_occluded += count;
        }
    }

    fn sawHits(observer: *Observer, rays: anytype) u64 {
        var hits: [batch_file.ray_count][2]u32 = @splat(.{ std.math.maxInt(u32), 0 });
        var count: u64 = 0;
        for (&hits, 0..) |*hit, index| {
            const number, const t = hitAt(rays, index) orelse continue;
            hit.* = .{ number, @bitCast(t) };
            count += 1;
        }
        observer.hash.update(std.mem.sliceAsBytes(&hits));
        return count;
    }

    /// The hit of a pixel, row by row.
    fn hitAt(rays: anytype, index: usize) ?struct { u32, f32 } {
        const hit = rays.hitAt(index % batch_file.side, index / batch_file.side) orelse return null;
        return .{ hit[0], hit[1] };
    }
};
