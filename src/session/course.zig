//! How long a picture is worked at, and when it is shown meanwhile.
//!
//! In: the clock, between rounds of passes. Out: samples that each pixel is to have after the next
//! one. A round is what fits into the time that is left, by what samples of the last one took, and
//! ends where the picture is to be shown again; it never has more than all before it, for the first
//! ones tell little. Nothing of it reaches the picture but the number of samples.

const std = @import("std");
const trace = @import("../trace.zig");
const Io = std.Io;

const second_ns = std.time.ns_per_s;

/// Of one picture.
pub const Course = struct {
    io: Io,
    start: Io.Timestamp,
    /// Since the start; null: no end but that of samples.
    budget_ns: ?u64 = null,
    /// Null: nobody looks.
    viewer: ?Viewer = null,
    /// From one time that it is shown to the next.
    interval_ns: u64 = second_ns,
    /// When it is to be shown.
    due_ns: u64 = second_ns,
    /// Where the round under way began.
    round: struct { samples: u32 = 0, start_ns: u64 = 0 } = .{},

    /// Who is shown the picture.
    pub const Viewer = struct {
        context: *anyopaque,
        show: *const fn (context: *anyopaque, standing: *const trace.Standing) void,
    };

    /// To be asked while rays are traced. The course must stay where it is.
    pub fn asked(course: *Course) trace.Course {
        return .{ .context = course, .next = next, .budget_ns = course.budget_ns };
    }

    fn next(context: *anyopaque, standing: *const trace.Standing) u32 {
        const course: *Course = @ptrCast(@alignCast(context));
        const done = standing.samples_done;
        const now_ns = course.now();
        const sample_ns = course.sampleTime(done, now_ns);
        course.round = .{ .samples = done, .start_ns = now_ns };
        if (course.viewer) |viewer| if (done > 0 and now_ns >= course.due_ns) {
            viewer.show(viewer.context, standing);
            course.round.start_ns = course.now();
            course.due_ns = course.round.start_ns + course.interval_ns;
        };
        return done + course.roundOf(done, course.round.start_ns, sample_ns);
    }

    fn now(course: *const Course) u64 {
        return @intCast(course.start.untilNow(course.io, .awake).toNanoseconds());
    }

    /// What a sample of all pixels took in the last round.
    fn sampleTime(course: *const Course, done: u32, now_ns: u64) u64 {
        if (done == course.round.samples) return 1;
        return @max(1, (now_ns - course.round.start_ns) / (done - course.round.samples));
    }

    /// Samples of the next round; 0: none fits.
    fn roundOf(course: *const Course, done: u32, now_ns: u64, sample_ns: u64) u32 {
        if (done == 0) return 1;
        var count: u64 = done;
        if (course.budget_ns) |budget_ns|
            count = @min(count, fitting(budget_ns -| now_ns, sample_ns));
        if (count > 0 and course.viewer != null)
            count = @min(count, @max(1, (course.due_ns -| now_ns) / sample_ns));
        return @intCast(count);
    }
};

/// Samples that fit into some time, of which a tenth is left where they take longer than expected.
pub fn fitting(time_ns: u64, sample_ns: u64) u64 {
    return time_ns / 10 * 9 / @max(1, sample_ns);
}

test "rounds double, end where the picture is due, and fit into the time" {
    var course: Course = .{ .io = undefined, .start = undefined };
    try std.testing.expectEqual(1, course.roundOf(0, 0, 1));
    try std.testing.expectEqual(1, course.roundOf(1, second_ns, second_ns));
    try std.testing.expectEqual(64, course.roundOf(64, 64 * second_ns, second_ns));
    course.viewer = .{ .context = undefined, .show = undefined };
    course.due_ns = 2 * second_ns;
    try std.testing.expectEqual(10, course.roundOf(64, second_ns, second_ns / 10));
    try std.testing.expectEqual(1, course.roundOf(64, 5 * second_ns, second_ns));
    course.viewer = null;
    course.budget_ns = 20 * second_ns;
    try std.testing.expectEqual(9, course.roundOf(10, 10 * second_ns, second_ns));
    try std.testing.expectEqual(0, course.roundOf(10, 19 * second_ns, second_ns));
    try std.testing.expectEqual(0, course.roundOf(10, 30 * second_ns, second_ns));
    try std.testing.expectEqual(1, course.roundOf(0, 30 * second_ns, second_ns));

    try std.testing.expectEqual(1, course.sampleTime(0, 100));
    course.round = .{ .samples = 4, .start_ns = 100 };
    try std.testing.expectEqual(25, course.sampleTime(8, 200));
}
