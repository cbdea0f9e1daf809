//! Polygons cut into triangles: convex ones as fans, others by ear clipping (Meisters 1975).
//!
//! In: the corners of a polygon in space, nearly flat, in order. Out: triangles by the numbers of
//! its corners, in the polygon's own sense of rotation. Ears are looked for in the plane along the
//! axis that Newell's normal is the longest on (Tampieri 1992). Looking takes the square of the
//! number of corners at least: there is a budget, beyond which concave ones are fans as well.

const std = @import("std");
const math = @import("../math.zig");
const Allocator = std.mem.Allocator;
const Vec3 = math.Vec3;

const Cutter = @This();

/// Corners that are looked at, at most, for a file of `input_bytes`.
pub fn stepsMax(input_bytes: u64) u64 {
    return (1 << 24) + 8 * input_bytes;
}

gpa: Allocator,
/// See `stepsMax`.
steps_left: u64,
/// The corners in the plane, and the next and last of those that are left.
flat: std.ArrayList([2]f64) = .empty,
next: std.ArrayList(u32) = .empty,
last: std.ArrayList(u32) = .empty,

/// Frees what it has worked with.
pub fn deinit(cutter: *Cutter) void {
    inline for (.{ "flat", "next", "last" }) |name| @field(cutter, name).deinit(cutter.gpa);
    cutter.* = undefined;
}

/// Appends the triangles of a polygon, of which there are two less than corners.
pub fn cut(
    cutter: *Cutter,
    corners: []const Vec3,
    out: *std.ArrayList([3]u32),
) Allocator.Error!void {
    if (corners.len < 3) return;
    try out.ensureUnusedCapacity(cutter.gpa, corners.len - 2);
    if (corners.len == 3) return out.appendAssumeCapacity(.{ 0, 1, 2 });
    if (!try cutter.flatten(corners) or cutter.isConvex()) return fan(corners.len, out);
    try cutter.clip(out);
}

fn fan(count: usize, out: *std.ArrayList([3]u32)) void {
    for (2..count) |corner| {
        const number: u32 = @intCast(corner);
        out.appendAssumeCapacity(.{ 0, number - 1, number });
    }
}

/// Lays the corners into a plane, counter-clockwise. False where they have no area.
fn flatten(cutter: *Cutter, corners: []const Vec3) Allocator.Error!bool {
    var normal: math.Vec3d = .{ 0, 0, 0 };
    var before = corners[corners.len - 1];
    for (corners) |corner| {
        inline for (0..3) |axis| {
            const one, const other = .{ (axis + 1) % 3, (axis + 2) % 3 };
            normal[axis] += (@as(f64, before[one]) - corner[one]) *
                (@as(f64, before[other]) + corner[other]);
        }
        before = corner;
    }
    var longest: usize = 0;
    for (1..3) |axis| {
        if (@abs(normal[axis]) > @abs(normal[longest])) longest = axis;
    }
    if (normal[longest] == 0 or !std.math.isFinite(normal[longest])) return false;
    const across, const up = .{ (longest + 1) % 3, (longest + 2) % 3 };
    try cutter.flat.resize(cutter.gpa, corners.len);
    for (cutter.flat.items, corners) |*point, corner| {
        point.* = if (normal[longest] > 0)
            .{ corner[across], corner[up] }
        else
            .{ corner[up], corner[across] };
    }
    return true;
}

/// Twice the area of the triangle of three corners, above 0 where they go counter-clockwise.
fn area(cutter: *const Cutter, a: u32, b: u32, c: u32) f64 {
    const flat = cutter.flat.items;
    const from, const to, const over = .{ flat[a], flat[b], flat[c] };
    return (to[0] - from[0]) * (over[1] - from[1]) - (to[1] - from[1]) * (over[0] - from[0]);
}

fn isConvex(cutter: *const Cutter) bool {
    const count: u32 = @intCast(cutter.flat.items.len);
    for (0..count) |index| {
        const corner: u32 = @intCast(index);
        if (cutter.area(corner, (corner + 1) % count, (corner + 2) % count) < 0) return false;
    }
    return true;
}

/// Cuts off ears for as long as there are any.
fn clip(cutter: *Cutter, out: *std.ArrayList([3]u32)) Allocator.Error!void {
    const count: u32 = @intCast(cutter.flat.items.len);
    try cutter.next.resize(cutter.gpa, count);
    try cutter.last.resize(cutter.gpa, count);
    for (cutter.next.items, cutter.last.items, 0..) |*next, *last, corner| {
        next.* = @intCast((corner + 1) % count);
        last.* = @intCast((corner + count - 1) % count);
    }
    var left = count;
    var corner: u32 = 0;
    var missed: u32 = 0;
    while (left > 3 and missed < left and cutter.steps_left > 0) {
        cutter.steps_left -= 1;
        const before, const behind = .{ cutter.last.items[corner], cutter.next.items[corner] };
        if (!cutter.isEar(before, corner, behind)) {
            missed += 1;
            corner = behind;
            continue;
        }
        out.appendAssumeCapacity(.{ before, corner, behind });
        cutter.next.items[before] = behind;
        cutter.last.items[behind] = before;
        left -= 1;
        missed = 0;
        // Not the neighbour, whose triangle would be a sliver of the same fan.
        corner = cutter.next.items[behind];
    }
    // The last triangle, or what crosses itself.
    const first = corner;
    for (2..left) |_| {
        const second = cutter.next.items[corner];
        const third = cutter.next.items[second];
        out.appendAssumeCapacity(.{ first, second, third });
        corner = second;
    }
}

fn isEar(cutter: *Cutter, before: u32, corner: u32, behind: u32) bool {
    if (!(cutter.area(before, corner, behind) > 0)) return false;
    const flat = cutter.flat.items;
    var other = cutter.next.items[behind];
    while (other != before) : (other = cutter.next.items[other]) {
        if (cutter.steps_left == 0) return true;
        cutter.steps_left -= 1;
        // Holes are bridged by corners that stand in two places.
        const is_same = std.meta.eql(flat[other], flat[before]) or
            std.meta.eql(flat[other], flat[corner]) or std.meta.eql(flat[other], flat[behind]);
        if (is_same) continue;
        if (cutter.area(before, corner, other) >= 0 and cutter.area(corner, behind, other) >= 0 and
            cutter.area(behind, before, other) >= 0) return false;
    }
    return true;
}

fn trianglesOf(corners: []const Vec3, steps: u64, out: *std.ArrayList([3]u32)) !void {
    var cutter: Cutter = .{ .gpa = std.testing.allocator, .steps_left = steps };
    defer cutter.deinit();
    out.clearRetainingCapacity();
    try cutter.cut(corners, out);
    if (corners.len >= 3) try std.testing.expectEqual(corners.len - 2, out.items.len);
    for (out.items) |triangle| for (triangle) |corner| {
        try std.testing.expect(corner < corners.len);
    };
}

/// Sum of the triangles' areas, and of what of them is turned around.
fn areasOf(corners: []const Vec3, triangles: []const [3]u32) [2]f32 {
    var areas: [2]f32 = .{ 0, 0 };
    for (triangles) |triangle| {
        const a, const b, const c = .{
            corners[triangle[0]], corners[triangle[1]], corners[triangle[2]],
        };
        const twice = math.vec3.cross(math.vec3.sub(b, a), math.vec3.sub(c, a))[2];
        areas[if (twice < 0) 1 else 0] += twice / 2;
    }
    return areas;
}

test "convex polygons are fans, others are covered by what turns as they do" {
    const gpa = std.testing.allocator;
    var out: std.ArrayList([3]u32) = .empty;
    defer out.deinit(gpa);
    try trianglesOf(&.{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 1, 1, 0 }, .{ 0, 1, 0 } }, 0, &out);
    try std.testing.expectEqualSlices([3]u32, &.{ .{ 0, 1, 2 }, .{ 0, 2, 3 } }, out.items);
    // A dart, a U, and a square with a hole that a bridge leads to.
    const cases = [_]struct { []const Vec3, f32 }{
        .{ &.{ .{ 0, 0, 1 }, .{ 2, -1, 1 }, .{ 1, 0, 1 }, .{ 2, 1, 1 } }, 1 },
        .{ &.{ .{ 2, -1, 1 }, .{ 1, 0, 1 }, .{ 2, 1, 1 }, .{ 0, 0, 1 } }, 1 },
        .{ &.{
            .{ 0, 0, 0 }, .{ 3, 0, 0 }, .{ 3, 3, 0 }, .{ 2, 3, 0 },
            .{ 2, 1, 0 }, .{ 1, 1, 0 }, .{ 1, 3, 0 }, .{ 0, 3, 0 },
        }, 7 },
        .{ &.{
            .{ 0, 0, 0 }, .{ 4, 0, 0 }, .{ 4, 4, 0 }, .{ 0, 4, 0 }, .{ 0, 0, 0 },
            .{ 1, 1, 0 }, .{ 1, 3, 0 }, .{ 3, 3, 0 }, .{ 3, 1, 0 }, .{ 1, 1, 0 },
        }, 12 },
    };
    for (cases) |case| {
        try trianglesOf(case[0], 1000, &out);
        const areas = areasOf(case[0], out.items);
        try std.testing.expectApproxEqAbs(case[1], areas[0], 1e-6);
        try std.testing.expectEqual(0, areas[1]);
    }
}

test "whatever the corners, there are as many triangles, within the budget" {
    const gpa = std.testing.allocator;
    var out: std.ArrayList([3]u32) = .empty;
    defer out.deinit(gpa);
    var random_state: std.Random.DefaultPrng = .init(5);
    const random = random_state.random();
    var corners: [20]Vec3 = undefined;
    for (0..300) |round| {
        for (&corners) |*corner| for (corner) |*value| {
            value.* = @floatFromInt(random.uintLessThan(u8, 4));
        };
        if (round % 10 == 0) corners[3] = @splat(std.math.floatMax(f32));
        const count = random.uintAtMost(usize, corners.len);
        try trianglesOf(corners[0..count], if (round % 2 == 0) 30 else 10_000, &out);
    }
}
