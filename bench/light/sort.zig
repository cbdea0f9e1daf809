//! Incoherent rays sorted by octant, origin and direction, so that neighbours go much the same way.
//!
//! In: the bundles of a set. Out: the same rays in full bundles. The key is the octant of the
//! direction, then the Morton code of the origin within the bounds of all origins, then that of the
//! direction within its octant, as ray reordering has it (Moon et al. 2010, Cache-Oblivious Ray
//! Reordering). A radix sort of 11 bits at a time; neighbours in the order are neighbours in
//! squares of 2x2 and subtiles of 4x4.

const std = @import("std");
const raylane = @import("raylane");
const batch_file = @import("../rays/batch.zig");
const rays = @import("rays.zig");
const Vec3 = raylane.math.Vec3;
const ray_count = batch_file.ray_count;
const side = batch_file.side;

const digit_bits = 11;
const digit_count = 1 << digit_bits;
/// Cells along each axis of the bounds of origins, and of a direction in its octant, in bits.
const origin_bits = 6;
const direction_bits = 5;

/// A ray's key and where it is.
const Entry = struct { key: u32, index: u32 };

/// Sorts `window` bundles at a time, or all together; results are in `arena`.
pub fn sorted(
    arena: std.mem.Allocator,
    bundles: []const rays.Bundle,
    window: usize,
) error{OutOfMemory}![]const rays.Bundle {
    const result = try arena.alloc(rays.Bundle, bundles.len);
    for (result) |*bundle| bundle.* = @splat(.none);
    const scratch = try arena.alloc([2]Entry, @min(window, bundles.len) * ray_count);
    var first: usize = 0;
    while (first < bundles.len) : (first += window) {
        const end = @min(first + window, bundles.len);
        sortWindow(bundles[first..end], result[first..end], @ptrCast(scratch));
    }
    return result;
}

fn sortWindow(from: []const rays.Bundle, to: []rays.Bundle, scratch: []Entry) void {
    const courses: []const rays.Course = @ptrCast(from);
    var lower: Vec3 = @splat(std.math.inf(f32));
    var upper: Vec3 = @splat(-std.math.inf(f32));
    for (courses) |*course| if (course.limit > 0) {
        for (&lower, &upper, course.origin) |*l, *u, x| {
            l.* = @min(l.*, x);
            u.* = @max(u.*, x);
        }
    };
    var scale: Vec3 = undefined;
    for (&scale, lower, upper) |*s, l, u| s.* = if (u > l) (1 << origin_bits) / (u - l) else 0;

    var entries = scratch[0..courses.len];
    var other = scratch[courses.len..][0..courses.len];
    var count: usize = 0;
    for (courses, 0..) |*course, index| {
        if (!(course.limit > 0)) continue;
        entries[count] = .{ .key = keyOf(course, lower, scale), .index = @intCast(index) };
        count += 1;
    }
    inline for (.{ 0, digit_bits, 2 * digit_bits }) |shift| {
        radixPass(shift, entries[0..count], other[0..count]);
        std.mem.swap([]Entry, &entries, &other);
    }
    for (entries[0..count], 0..) |entry, rank| {
        to[rank / ray_count][placeOf(rank % ray_count)] = courses[entry.index];
    }
}

fn radixPass(comptime shift: u5, from: []const Entry, to: []Entry) void {
    var starts: [digit_count]u32 = @splat(0);
    for (from) |entry| starts[entry.key >> shift & digit_count - 1] += 1;
    var sum: u32 = 0;
    for (&starts) |*start| {
        const count = start.*;
        start.* = sum;
        sum += count;
    }
    for (from) |entry| {
        const start = &starts[entry.key >> shift & digit_count - 1];
        to[start.*] = entry;
        start.* += 1;
    }
}

fn keyOf(course: *const rays.Course, lower: Vec3, scale: Vec3) u32 {
    var octant: u32 = 0;
    var size: f32 = 0;
    for (course.direction, 0..) |x, axis| {
        if (x < 0) octant |= @as(u32, 1) << @intCast(axis);
        size += @abs(x);
    }
    var origin: [3]u32 = undefined;
    for (&origin, course.origin, lower, scale) |*cell, x, l, s| {
        cell.* = cellOf((x - l) * s, origin_bits);
    }
    const step = (1 << direction_bits) / size;
    const direction = [2]u32{
        cellOf(@abs(course.direction[0]) * step, direction_bits),
        cellOf(@abs(course.direction[1]) * step, direction_bits),
    };
    const places = morton(3, origin_bits, origin);
    return (octant << 3 * origin_bits | places) << 2 * direction_bits |
        morton(2, direction_bits, direction);
}

fn cellOf(x: f32, comptime bits: u5) u32 {
    return @min(@as(u32, @trunc(@max(x, 0))), (1 << bits) - 1);
}

/// Bits of the cells in turns, those of the last axis above the others.
fn morton(comptime axes: u5, comptime bits: u5, cells: [axes]u32) u32 {
    var code: u32 = 0;
    inline for (0..bits) |bit| inline for (0..axes) |axis| {
        code |= (cells[axis] >> bit & 1) << bit * axes + axis;
    };
    return code;
}

/// Where in a bundle, row by row, the ray of a rank is: on a Morton curve.
fn placeOf(rank: usize) usize {
    return places_by_rank[rank];
}

const places_by_rank: [ray_count]u8 = places: {
    @setEvalBranchQuota(20_000);
    var places: [ray_count]u8 = undefined;
    for (&places, 0..) |*place, rank| {
        var column: usize = 0;
        var row: usize = 0;
        for (0..4) |bit| {
            column |= (rank >> 2 * bit & 1) << bit;
            row |= (rank >> 2 * bit + 1 & 1) << bit;
        }
        place.* = row * side + column;
    }
    break :places places;
};
