//! Where the work on one file stands: counters and a clock -> fractions, times and rates.
//!
//! In: what was begun and when, and the counters of its progress. Out: the numbers that are shown.
//! What is left of a stage is told by what had been done of it when a piece was last finished, as
//! if it went on at that rate: pieces may take seconds.

const std = @import("std");
const progress_file = @import("../progress.zig");
const Progress = progress_file.Progress;
const Work = progress_file.Work;

/// One of the files of a run.
pub const Place = struct {
    /// From 1.
    index: usize,
    count: usize,
    name: []const u8,
};

/// Until now.
pub const Times = struct {
    /// Since the file was begun.
    file_s: f64,
    /// From the begin of the work to the last time that something of it was done.
    work_s: f64,
    /// Since then.
    idle_s: f64 = 0,
    /// How many of the file's pictures were made, and in what time; since then.
    picture_count: usize = 0,
    pictures_s: f64 = 0,
    picture_idle_s: f64 = 0,
};

/// At one moment.
pub const Standing = struct {
    place: Place,
    stage: progress_file.Stage,
    /// Of the stage's units; null: it has none.
    done: ?u64,
    /// Null: not known.
    total: ?u64,
    /// Of the stage, 0 to 1; null: not known.
    fraction: ?f64,
    /// Since the file was begun.
    elapsed_s: f64,
    /// Until the stage ends; null: not known.
    left_s: ?f64,
    /// Since the stage began; null: it traces none.
    rays_per_s: ?f64,
    /// Of the file's, from 1 on, and how many it has; null: not known.
    picture: ?u64 = null,
    pictures: ?u64 = null,
    /// Until all of them are made; null: not known.
    pictures_left_s: ?f64 = null,

    pub fn of(
        place: Place,
        work: *const Work,
        progress: *const Progress,
        times: Times,
    ) Standing {
        const done = progress.done.load(.monotonic);
        const total = progress.total.load(.monotonic);
        const rays = progress.rays.load(.monotonic);
        var standing: Standing = .{
            .place = place,
            .stage = work.stage,
            .done = if (done > 0 or total > 0) done / work.pieces_per_unit else null,
            .total = null,
            .fraction = null,
            .elapsed_s = times.file_s,
            .left_s = null,
            .rays_per_s = if (rays > 0 and times.work_s > 0)
                float(rays) / times.work_s
            else
                null,
        };
        if (total > 0) {
            const fraction = @min(1, float(done) / float(total));
            standing.fraction = fraction;
            // Before, the first of many pieces would make it hours.
            if (fraction >= fraction_min) {
                const left_s = times.work_s * (1 - fraction) / fraction;
                standing.left_s = @max(@min(1, left_s), left_s - times.idle_s);
            }
            // With a time for all of it, few expect to do as much as they may.
            if (work.budget_ns == null) standing.total = total / work.pieces_per_unit;
        }
        if (work.budget_ns) |budget_ns| {
            const budget_s = float(budget_ns) / std.time.ns_per_s;
            const left_s = @max(0, budget_s - times.work_s - times.idle_s);
            standing.fraction = @max(standing.fraction orelse 0, 1 - left_s / budget_s);
            standing.left_s = @min(standing.left_s orelse left_s, left_s);
        }
        standing.tellPictures(progress, times);
        return standing;
    }

    fn tellPictures(standing: *Standing, progress: *const Progress, times: Times) void {
        const picture = progress.picture.load(.monotonic);
        const count = progress.picture_count.load(.monotonic);
        if (picture == 0 or picture > count) return;
        standing.picture = picture;
        standing.pictures = count;
        if (times.picture_count == 0) return;
        const picture_s = times.pictures_s / float(times.picture_count);
        const left_s = picture_s * float(count - picture + 1);
        standing.pictures_left_s = @max(@min(1, left_s), left_s - times.picture_idle_s);
    }
};

/// Done of a stage before it is told how long the rest takes.
const fraction_min = 0.002;

fn float(number: anytype) f64 {
    return @floatFromInt(number);
}

const testing = std.testing;

/// With so many pieces done, pieces in all, and rays.
fn ofForTest(work: *const Work, counts: [3]usize, times: Times) Standing {
    return .of(.{ .index = 1, .count = 1, .name = "a.glb" }, work, &.{
        .done = .init(counts[0]),
        .total = .init(counts[1]),
        .rays = .init(counts[2]),
        .context = undefined,
        .begun = undefined,
    }, times);
}

const recently: Times = .{ .file_s = 3, .work_s = 2 };

test "a quarter is done in 2 s, so 6 s are left" {
    const work: Work = .{ .stage = .tracing, .total = 64, .pieces_per_unit = 16 };
    const standing = ofForTest(&work, .{ 16, 64, 4_000_000 }, recently);
    try testing.expectEqual(1, standing.done.?);
    try testing.expectEqual(4, standing.total.?);
    try testing.expectEqual(0.25, standing.fraction.?);
    try testing.expectEqual(6, standing.left_s.?);
    try testing.expectEqual(3, standing.elapsed_s);
    try testing.expectEqual(2e6, standing.rays_per_s.?);
    // Nothing was finished since; what is overdue is about to be.
    for ([_][2]f64{ .{ 4, 2 }, .{ 9, 1 } }) |case| {
        const times: Times = .{ .file_s = 3, .work_s = 2, .idle_s = case[0] };
        const later = ofForTest(&work, .{ 16, 64, 0 }, times);
        try testing.expectEqual(case[1], later.left_s.?);
    }
}

test "what is not known is not told" {
    const standing = ofForTest(&.{ .stage = .writing }, .{ 0, 0, 0 }, recently);
    try testing.expectEqual(null, standing.done);
    try testing.expectEqual(null, standing.total);
    try testing.expectEqual(null, standing.fraction);
    try testing.expectEqual(null, standing.left_s);
    try testing.expectEqual(null, standing.rays_per_s);
    const reading = ofForTest(&.{ .stage = .reading }, .{ 7, 0, 0 }, recently);
    try testing.expectEqual(7, reading.done.?);
    try testing.expectEqual(null, reading.fraction);
    const begun = ofForTest(&.{ .stage = .tree, .total = 10_000 }, .{ 1, 10_000, 0 }, recently);
    try testing.expectEqual(null, begun.left_s);
    // More than was announced: files name others.
    const more = ofForTest(&.{ .stage = .tree, .total = 2 }, .{ 3, 2, 0 }, recently);
    try testing.expectEqual(1, more.fraction.?);
    try testing.expectEqual(0, more.left_s.?);
}

test "a time for the work ends it, or its pieces do" {
    const work: Work = .{ .stage = .tracing, .total = 100, .budget_ns = 10 * std.time.ns_per_s };
    const times: Times = .{ .file_s = 4, .work_s = 4 };
    const by_time = ofForTest(&work, .{ 10, 100, 0 }, times);
    try testing.expectEqual(null, by_time.total);
    try testing.expectApproxEqAbs(0.4, by_time.fraction.?, 1e-9);
    try testing.expectApproxEqAbs(6, by_time.left_s.?, 1e-9);
    const by_pieces = ofForTest(&work, .{ 80, 100, 0 }, times);
    try testing.expectApproxEqAbs(0.8, by_pieces.fraction.?, 1e-9);
    try testing.expectApproxEqAbs(1, by_pieces.left_s.?, 1e-9);
}

test "of ten pictures, two were made in 6 s" {
    const progress: Progress = .{
        .picture = .init(3),
        .picture_count = .init(10),
        .context = undefined,
        .begun = undefined,
    };
    const place: Place = .{ .index = 1, .count = 1, .name = "a.glb" };
    var times: Times = .{ .file_s = 9, .work_s = 0, .pictures_s = 6, .picture_idle_s = 1 };
    const early: Standing = .of(place, &.{ .stage = .view }, &progress, times);
    try testing.expectEqual(3, early.picture.?);
    try testing.expectEqual(10, early.pictures.?);
    try testing.expectEqual(null, early.pictures_left_s);
    times.picture_count = 2;
    const later: Standing = .of(place, &.{ .stage = .view }, &progress, times);
    try testing.expectEqual(23, later.pictures_left_s.?);
}
