//! Key frames: the numbers of a sampler at a time (glTF 2.0, appendix C; Shoemake 1985, Animating
//! Rotation with Quaternion Curves).
//!
//! In: times with numbers. Out: numbers, or a rotation, between two of them. Rotations go the
//! shorter way at a constant speed, all else in straight lines, in steps or along Hermite splines;
//! before the first key and after the last, all stands still. In double precision, without the
//! library's functions: the same bits everywhere.

const std = @import("std");
const math = @import("../math.zig");
const scene = @import("../scene.zig");
const Sampler = scene.Sampler;
const Vec3d = math.Vec3d;

/// A place between two keys.
pub const Frame = struct {
    sampler: *const Sampler,
    /// The key before, and the one behind; the same where all stands still.
    keys: [2]usize,
    /// 0 at the first, 1 at the second.
    share: f64,
    /// Seconds between them.
    step_s: f64,

    /// Before the first key and after the last there is nothing between.
    pub fn of(sampler: *const Sampler, time_s: f64) Frame {
        const times = sampler.times;
        // The first key that is later.
        const next = std.sort.upperBound(f32, times, time_s, order);
        const before = next -| 1;
        const still = next == 0 or next == times.len or sampler.interpolation == .step;
        if (still) return .{
            .sampler = sampler,
            .keys = .{ before, before },
            .share = 0,
            .step_s = 0,
        };
        const step_s = @as(f64, times[next]) - times[before];
        return .{
            .sampler = sampler,
            .keys = .{ before, next },
            .share = (time_s - times[before]) / step_s,
            .step_s = step_s,
        };
    }

    fn order(time_s: f64, key_s: f32) std.math.Order {
        return std.math.order(time_s, key_s);
    }

    /// One of the numbers.
    pub fn number(frame: *const Frame, index: usize) f64 {
        const sampler = frame.sampler;
        const part = sampler.valuePart();
        const first: f64 = sampler.value(frame.keys[0], part)[index];
        if (frame.keys[0] == frame.keys[1]) return first;
        const second: f64 = sampler.value(frame.keys[1], part)[index];
        const t = frame.share;
        if (sampler.interpolation == .linear) return first + (second - first) * t;
        // Appendix C.5: the tangents are per second.
        const out: f64 = sampler.value(frame.keys[0], 2)[index];
        const in: f64 = sampler.value(frame.keys[1], 0)[index];
        const tt = t * t;
        const ttt = tt * t;
        const values = (2 * ttt - 3 * tt + 1) * first + (3 * tt - 2 * ttt) * second;
        const tangents = (ttt - 2 * tt + t) * out + (ttt - tt) * in;
        return values + frame.step_s * tangents;
    }

    /// The first three.
    pub fn vector(frame: *const Frame) Vec3d {
        return .{ frame.number(0), frame.number(1), frame.number(2) };
    }

    /// One of them in single precision.
    pub fn single(frame: *const Frame, index: usize) f32 {
        return singleOf(frame.number(index));
    }

    /// A unit quaternion.
    pub fn rotation(frame: *const Frame) [4]f64 {
        if (frame.sampler.interpolation == .linear and frame.keys[0] != frame.keys[1]) {
            var ends: [2][4]f64 = undefined;
            for (&ends, frame.keys) |*end, key| {
                for (end, frame.sampler.value(key, 0)) |*to, from| to.* = from;
                end.* = unit(end.*);
            }
            return slerp(ends[0], ends[1], frame.share);
        }
        var q: [4]f64 = undefined;
        for (&q, 0..) |*to, index| to.* = frame.number(index);
        return unit(q);
    }
};

/// The nearest f32 that is neither infinite nor denormal.
pub fn singleOf(value: f64) f32 {
    const largest: f64 = std.math.floatMax(f32);
    return math.flushDenormal(@floatCast(std.math.clamp(value, -largest, largest)));
}

fn dot(a: [4]f64, b: [4]f64) f64 {
    return ((a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]) + a[3] * b[3];
}

/// No rotation in place of one that is none.
fn unit(q: [4]f64) [4]f64 {
    const length = @sqrt(dot(q, q));
    if (!(length >= std.math.floatMin(f32))) return .{ 0, 0, 0, 1 };
    return .{ q[0] / length, q[1] / length, q[2] / length, q[3] / length };
}

/// Spherical linear interpolation of unit quaternions on the shorter way (glTF 2.0, appendix C.4).
fn slerp(first: [4]f64, second: [4]f64, share: f64) [4]f64 {
    const cosine = dot(first, second);
    const sign: f64 = if (cosine < 0) -1 else 1;
    var weights = [2]f64{ 1 - share, share };
    // Nearer than that, the arc is as good as straight.
    if (@abs(cosine) < 1 - 1e-12) {
        const angle = math.elementary.acos(@abs(cosine));
        const sine = math.elementary.sin(angle);
        for (&weights) |*weight| weight.* = math.elementary.sin(weight.* * angle) / sine;
    }
    var q: [4]f64 = undefined;
    for (&q, first, second) |*to, a, b| to.* = weights[0] * a + weights[1] * sign * b;
    return unit(q);
}

const testing = std.testing;

fn testSampler(
    interpolation: scene.Interpolation,
    width: u32,
    times: []const f32,
    values: []const f32,
) Sampler {
    return .{ .times = times, .values = values, .width = width, .interpolation = interpolation };
}

fn numberAt(sampler: *const Sampler, time_s: f64) f64 {
    return Frame.of(sampler, time_s).number(0);
}

test "straight lines and steps, and nothing moves before the first key and after the last" {
    const times = [_]f32{ 1, 2, 4 };
    const values = [_]f32{ 10, 20, 0 };
    const line = testSampler(.linear, 1, &times, &values);
    const step = testSampler(.step, 1, &times, &values);
    const Case = struct { f64, f64, f64 };
    for ([_]Case{
        .{ -5, 10, 10 },  .{ 0.999, 10, 10 }, .{ 1, 10, 10 },     .{ 1.25, 12.5, 10 },
        .{ 2, 20, 20 },   .{ 2.5, 15, 20 },   .{ 3.75, 2.5, 20 }, .{ 4, 0, 0 },
        .{ 1e300, 0, 0 },
    }) |case| {
        errdefer std.debug.print("at {d} s\n", .{case[0]});
        try testing.expectEqual(case[1], numberAt(&line, case[0]));
        try testing.expectEqual(case[2], numberAt(&step, case[0]));
    }
    const one = testSampler(.linear, 1, &.{3}, &.{7});
    for ([_]f64{ 0, 3, 9 }) |time_s| try testing.expectEqual(7, numberAt(&one, time_s));
    // Of two keys at one time the later counts from then on.
    const jump = testSampler(.linear, 1, &.{ 0, 1, 1, 2 }, &.{ 0, 1, 5, 6 });
    try testing.expectEqual(0.5, numberAt(&jump, 0.5));
    try testing.expectEqual(5, numberAt(&jump, 1));
    try testing.expectEqual(5.5, numberAt(&jump, 1.5));
}

test "splines pass through their values with their tangents, which are per second" {
    // In, value, out. Over two seconds, from 0 with slope 3 to 8 with slope -1.
    const spline = testSampler(.cubic_spline, 1, &.{ 1, 3 }, &.{ 99, 0, 3, -1, 8, 99 });
    try testing.expectEqual(0, numberAt(&spline, 0));
    try testing.expectEqual(0, numberAt(&spline, 1));
    try testing.expectEqual(8, numberAt(&spline, 3));
    try testing.expectEqual(8, numberAt(&spline, 5));
    // (0 + 8) / 2 + 2 (3 - -1) / 8.
    try testing.expectEqual(5, numberAt(&spline, 2));
    const before = (numberAt(&spline, 1 + 1e-6) - numberAt(&spline, 1)) / 1e-6;
    try testing.expectApproxEqAbs(3, before, 1e-4);
    const behind = (numberAt(&spline, 3) - numberAt(&spline, 3 - 1e-6)) / 1e-6;
    try testing.expectApproxEqAbs(-1, behind, 1e-4);
    const one = testSampler(.cubic_spline, 1, &.{2}, &.{ 1, 4, 1 });
    for ([_]f64{ 0, 2, 3 }) |time_s| try testing.expectEqual(4, numberAt(&one, time_s));
}

fn expectRotation(expected: [4]f64, actual: [4]f64) !void {
    // Both signs are the same rotation.
    try testing.expectApproxEqAbs(1, @abs(dot(expected, actual)), 1e-14);
    try testing.expectApproxEqAbs(1, dot(actual, actual), 1e-14);
}

/// A rotation about z.
fn turn(angle_rad: f64) [4]f64 {
    return .{ 0, 0, math.elementary.sin(angle_rad / 2), math.elementary.cos(angle_rad / 2) };
}

test "rotations go the shorter way at a constant speed" {
    for (0..9) |index| {
        const share = @as(f64, @floatFromInt(index)) / 8;
        for ([_]f64{ 0, 1e-9, 1e-4, 0.1, 1, 3.1, -2 }) |angle_rad| {
            const end = turn(0.3 + angle_rad);
            const expected = turn(0.3 + share * angle_rad);
            try expectRotation(expected, slerp(turn(0.3), end, share));
            const other = [4]f64{ -end[0], -end[1], -end[2], -end[3] };
            try expectRotation(expected, slerp(turn(0.3), other, share));
        }
    }
    // Further than half a turn it is shorter the other way.
    try expectRotation(turn(-0.5), slerp(turn(0), turn(2 * std.math.pi - 1), 0.5));
    // At half a turn both ways are as short.
    const half = slerp(.{ 0, 0, 0, 1 }, .{ 1, 0, 0, 0 }, 0.5);
    try expectRotation(.{ @sqrt(0.5), 0, 0, @sqrt(0.5) }, half);
}

test "quaternions of any length are rotations, and none is no rotation" {
    const line = testSampler(.linear, 4, &.{ 0, 1 }, &.{ 0, 0, 2, 0, 0, 0, 0, 0 });
    try expectRotation(.{ 0, 0, 1, 0 }, Frame.of(&line, 0).rotation());
    try expectRotation(.{ 0, 0, 0, 1 }, Frame.of(&line, 1).rotation());
    try expectRotation(turn(std.math.pi / 2.0), Frame.of(&line, 0.5).rotation());
    const spline = testSampler(.cubic_spline, 4, &.{ 0, 1 }, &.{
        0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0,
        0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0,
    });
    try expectRotation(turn(std.math.pi / 2.0), Frame.of(&spline, 0.5).rotation());
}
