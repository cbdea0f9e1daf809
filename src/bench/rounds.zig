//! The measurement itself: variants in turn, round after round, every image checked.
//!
//! In: a subject that renders (the stages, or a stand-in with a clock of its own), the variants, a
//! moment to be done by. Out: samples by variant. All variants render once before anything counts:
//! caches and clocks are warm then, and a variant with another image ends the run before time is
//! spent on it.

const std = @import("std");
const results = @import("results.zig");
const statistics = @import("../statistics.zig");
const student = @import("statistics.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Interval = @import("../energy.zig").Interval;
const Mark = @import("../energy.zig").Mark;
const Allocator = std.mem.Allocator;
const assert = std.debug.assert;

/// Half width of an interval over its mean at which it is narrow.
pub const precision = 0.02;
/// Rounds before an interval may be called narrow: two samples that agree may do so by chance.
const narrow_round_count_min = 5;
/// Rounds beyond the scene's share of the time, if there is any left: fewer have no interval.
const round_count_min = 2;
/// What a piece of work may take over the longest before it, for all that is known.
const margin = 1.25;

/// When to stop.
pub const Plan = struct {
    /// What to measure; the first is the reference.
    variants: []const usize,
    thread_count: usize,
    /// Exactly so many; null: until intervals are narrow.
    round_count: ?usize,
    /// End of the scene's share of the time, by the subject's clock.
    deadline_ns: u64,
    /// What nothing is begun for that would end later.
    end_ns: u64 = std.math.maxInt(u64),
    /// What the machine takes at rest, in watts.
    idle_w: f64 = 0,
};

/// Times of what comes before tracing, in nanoseconds.
pub const Prepared = struct { parse_ns: u64, prepare_ns: u64, bvh_build_ns: u64 };

pub const Traced = struct { trace_ns: u64, rays: statistics.RayCounts };

const Column = std.ArrayList(f64);

/// Samples of one variant.
const Series = struct {
    parse_ms: Column = .empty,
    prepare_ms: Column = .empty,
    bvh_build_ms: Column = .empty,
    trace_ms: Column = .empty,
    whole_j: Column = .empty,
    whole_gross_j: Column = .empty,
    whole_s: Column = .empty,
    trace_j: Column = .empty,
    trace_gross_j: Column = .empty,
    trace_s: Column = .empty,
    tests: statistics.TestCounts = .{},

    /// Forgets what is of a round that was not finished.
    fn shrink(series: *Series, round_count: usize) void {
        inline for (comptime std.meta.fieldNames(Series)) |name| {
            const column = &@field(series, name);
            if (@TypeOf(column.*) != Column) continue;
            column.shrinkRetainingCapacity(@min(round_count, column.items.len));
        }
    }

    fn result(series: *const Series, name: []const u8) results.Variant {
        return .{
            .name = name,
            .tests = series.tests,
            .parse_ms = series.parse_ms.items,
            .prepare_ms = series.prepare_ms.items,
            .bvh_build_ms = series.bvh_build_ms.items,
            .trace_ms = series.trace_ms.items,
            .energy = if (series.whole_j.items.len == 0) null else .{
                .whole_j = series.whole_j.items,
                .whole_gross_j = series.whole_gross_j.items,
                .whole_s = series.whole_s.items,
                .trace_j = series.trace_j.items,
                .trace_gross_j = series.trace_gross_j.items,
                .trace_s = series.trace_s.items,
            },
        };
    }

    /// Keeps the energy of frames that took `whole` and of traces that took `trace`.
    fn addEnergy(
        series: *Series,
        arena: Allocator,
        idle_w: f64,
        whole: PerFrame,
        trace: PerFrame,
    ) error{OutOfMemory}!void {
        try series.whole_s.append(arena, whole.duration_s);
        try series.whole_gross_j.append(arena, whole.energy_j);
        try series.whole_j.append(arena, whole.energy_j - idle_w * whole.duration_s);
        try series.trace_s.append(arena, trace.duration_s);
        try series.trace_gross_j.append(arena, trace.energy_j);
        try series.trace_j.append(arena, trace.energy_j - idle_w * trace.duration_s);
    }
};

/// An interval divided by the frames in it.
const PerFrame = struct {
    duration_s: f64,
    energy_j: f64,

    fn of(interval: Interval, frame_count: usize) PerFrame {
        const count: f64 = @floatFromInt(frame_count);
        return .{
            .duration_s = interval.duration_s / count,
            .energy_j = interval.energy_j / count,
        };
    }
};

/// Measures the scene of a subject of type `Subject`, which has
///
///     fn prepare(*Subject, variant: usize) !Prepared
///     fn trace(*Subject, variant: usize, thread_count: usize) !Traced
///     fn count(*Subject, variant: usize) !statistics.TestCounts
///     fn hash(*Subject) u64
///     fn now(*Subject) u64
///     fn mark(*Subject) ?Mark                  null: energy is not measured
///     fn between(*Subject, Mark, Mark) ?Interval
///     fn windowNs(*Subject) u64                shortest stretch whose energy means something
///     fn name(*Subject, variant: usize) []const u8
///     fn step(*Subject) void                   told of each frame
pub fn Rounds(comptime Subject: type) type {
    return struct {
        const Self = @This();

        /// What is found lives in it.
        arena: Allocator,
        subject: *Subject,
        plan: Plan,
        diagnostic: *Diagnostic,
        series: []Series,
        /// Of the first image.
        hash: ?u64 = null,
        rays: statistics.RayCounts = .{},
        round_count: usize = 0,
        end: results.End = .rounds,

        /// Runs all rounds of a scene; none where there is no time for one. `ImagesDiffer`: the
        /// diagnostic names the variant.
        pub fn measure(
            arena: Allocator,
            subject: *Subject,
            plan: Plan,
            diagnostic: *Diagnostic,
        ) !Self {
            assert(plan.variants.len >= 1);
            const series = try arena.alloc(Series, plan.variants.len);
            for (series) |*one| one.* = .{};
            var rounds: Self = .{
                .arena = arena,
                .subject = subject,
                .plan = plan,
                .diagnostic = diagnostic,
                .series = series,
            };
            var last_round_ns = try rounds.warmUp() orelse {
                rounds.end = .time;
                return rounds;
            };
            while (!rounds.isDone(last_round_ns)) {
                const start_ns = subject.now();
                rounds.repeatAll() catch |err| {
                    if (err != error.Canceled) return err;
                    for (series) |*one| one.shrink(rounds.round_count);
                    rounds.end = .time;
                    return rounds;
                };
                rounds.round_count += 1;
                last_round_ns = subject.now() - start_ns;
            }
            return rounds;
        }

        /// The samples, by variant in the order of the plan.
        pub fn variants(rounds: *const Self) error{OutOfMemory}![]const results.Variant {
            const list = try rounds.arena.alloc(results.Variant, rounds.series.len);
            for (list, rounds.series, rounds.plan.variants) |*to, *one, variant| {
                to.* = one.result(rounds.subject.name(variant));
            }
            return list;
        }

        /// What a round takes, about, in nanoseconds; null: there is no time for one.
        fn warmUp(rounds: *Self) !?u64 {
            const subject = rounds.subject;
            const energy_ns = if (subject.mark() == null) 0 else 2 * subject.windowNs();
            var longest_ns: u64 = 0;
            var round_ns: u64 = 0;
            for (rounds.plan.variants, rounds.series) |variant, *one| {
                if (!rounds.hasTime(longest_ns)) return null;
                const start_ns = subject.now();
                rounds.warmUpOne(variant, one) catch |err|
                    return if (err == error.Canceled) null else err;
                subject.step();
                const taken_ns = subject.now() - start_ns;
                longest_ns = @max(longest_ns, taken_ns);
                round_ns += taken_ns + energy_ns;
            }
            return round_ns;
        }

        fn warmUpOne(rounds: *Self, variant: usize, one: *Series) !void {
            const subject = rounds.subject;
            _ = try subject.prepare(variant);
            const traced = try subject.trace(variant, rounds.plan.thread_count);
            try rounds.check(variant, rounds.plan.thread_count);
            rounds.rays = traced.rays;
            one.tests = try subject.count(variant);
            try rounds.check(variant, rounds.plan.thread_count);
        }

        /// Whether what takes about so long ends in time.
        fn hasTime(rounds: *const Self, expected_ns: u64) bool {
            const expected: f64 = @floatFromInt(expected_ns);
            const with_margin: u64 = @trunc(margin * expected);
            return rounds.subject.now() +| with_margin <= rounds.plan.end_ns;
        }

        fn check(rounds: *Self, variant: usize, thread_count: usize) error{ImagesDiffer}!void {
            const found = rounds.subject.hash();
            const expected = rounds.hash orelse found;
            rounds.hash = expected;
            if (found == expected) return;
            return rounds.diagnostic.fail(
                error.ImagesDiffer,
                "the image of {s} by {d} threads has the hash {x:0>16}, that of {s} {x:0>16}",
                .{
                    rounds.subject.name(variant),
                    thread_count,
                    found,
                    rounds.subject.name(rounds.plan.variants[0]),
                    expected,
                },
            );
        }

        fn repeatAll(rounds: *Self) !void {
            for (rounds.plan.variants, rounds.series) |variant, *one|
                try rounds.repeat(variant, one);
        }

        /// One sample of one variant: a frame, or as many as the energy's window takes.
        fn repeat(rounds: *Self, variant: usize, one: *Series) !void {
            const subject = rounds.subject;
            const thread_count = rounds.plan.thread_count;
            const arena = rounds.arena;
            const window_ns = subject.windowNs();
            var sums: struct { parse: u64, prepare: u64, build: u64, trace: u64 } =
                .{ .parse = 0, .prepare = 0, .build = 0, .trace = 0 };
            var frame_count: usize = 0;
            const start = subject.mark();
            const start_ns = subject.now();
            while (frame_count == 0 or subject.now() - start_ns < window_ns) : (frame_count += 1) {
                const prepared = try subject.prepare(variant);
                const traced = try subject.trace(variant, thread_count);
                sums.parse += prepared.parse_ns;
                sums.prepare += prepared.prepare_ns;
                sums.build += prepared.bvh_build_ns;
                sums.trace += traced.trace_ns;
                try rounds.check(variant, thread_count);
            }
            const whole = rounds.since(start, frame_count);
            subject.step();
            try one.parse_ms.append(arena, milliseconds(sums.parse, frame_count));
            try one.prepare_ms.append(arena, milliseconds(sums.prepare, frame_count));
            try one.bvh_build_ms.append(arena, milliseconds(sums.build, frame_count));
            try one.trace_ms.append(arena, milliseconds(sums.trace, frame_count));
            const whole_energy = whole orelse return;
            const trace_energy = try rounds.repeatTrace(variant) orelse return;
            try one.addEnergy(arena, rounds.plan.idle_w, whole_energy, trace_energy);
        }

        /// Traces alone, for as long as the energy's window takes.
        fn repeatTrace(rounds: *Self, variant: usize) !?PerFrame {
            const subject = rounds.subject;
            var frame_count: usize = 0;
            const start = subject.mark();
            const start_ns = subject.now();
            while (frame_count == 0 or subject.now() - start_ns < subject.windowNs()) {
                _ = try subject.trace(variant, rounds.plan.thread_count);
                frame_count += 1;
            }
            const energy = rounds.since(start, frame_count);
            try rounds.check(variant, rounds.plan.thread_count);
            return energy;
        }

        fn since(rounds: *Self, start: ?Mark, frame_count: usize) ?PerFrame {
            const from = start orelse return null;
            const to = rounds.subject.mark() orelse return null;
            return .of(rounds.subject.between(from, to) orelse return null, frame_count);
        }

        fn isDone(rounds: *Self, last_round_ns: u64) bool {
            const has_interval = rounds.round_count >= round_count_min;
            if (has_interval) {
                if (rounds.plan.round_count) |count| {
                    rounds.end = .rounds;
                    if (rounds.round_count >= count) return true;
                } else if (isNarrow(rounds.series)) {
                    rounds.end = .precision;
                    return true;
                }
                if (rounds.round_count == student.round_count_max) return true;
            }
            const is_late = rounds.subject.now() + last_round_ns > rounds.plan.deadline_ns;
            if (rounds.hasTime(last_round_ns) and !(has_interval and is_late)) return false;
            rounds.end = .time;
            return true;
        }

        /// Traces by each number of threads in turn, until the deadline: `lists` gets, for each
        /// variant and each number of threads, the render times in milliseconds, of whole rounds.
        /// The images are checked against the one of `measure`.
        pub fn scale(
            rounds: *Self,
            scaled_variants: []const usize,
            thread_counts: []const usize,
            deadline_ns: u64,
            lists: []Column,
        ) !void {
            const subject = rounds.subject;
            assert(lists.len == scaled_variants.len * thread_counts.len);
            var round: usize = 0;
            while (round < student.round_count_max) : (round += 1) {
                const start_ns = subject.now();
                rounds.scaleOnce(scaled_variants, thread_counts, lists) catch |err| {
                    if (err != error.Canceled) return err;
                    for (lists) |*list|
                        list.shrinkRetainingCapacity(@min(round, list.items.len));
                    return;
                };
                if (round + 1 < round_count_min) continue;
                if (rounds.plan.round_count) |count| if (round + 1 >= count) return;
                const end_ns = subject.now();
                if (end_ns + (end_ns - start_ns) > deadline_ns) return;
                if (round + 1 >= narrow_round_count_min and areNarrow(lists)) return;
            }
        }

        /// `Canceled`: there is no time for all of it.
        fn scaleOnce(
            rounds: *Self,
            scaled_variants: []const usize,
            thread_counts: []const usize,
            lists: []Column,
        ) !void {
            const subject = rounds.subject;
            for (scaled_variants, 0..) |variant, variant_index| {
                _ = try subject.prepare(variant);
                for (thread_counts, 0..) |thread_count, count_index| {
                    if (!rounds.hasTime(expectedNs(
                        &rounds.plan,
                        rounds.series,
                        variant,
                        thread_count,
                    )))
                        return error.Canceled;
                    const traced = try subject.trace(variant, thread_count);
                    try rounds.check(variant, thread_count);
                    subject.step();
                    const list = &lists[variant_index * thread_counts.len + count_index];
                    try list.append(rounds.arena, milliseconds(traced.trace_ns, 1));
                }
            }
        }
    };
}

/// What a frame may take by fewer threads than it was measured with.
fn expectedNs(
    plan: *const Plan,
    series: []const Series,
    variant: usize,
    thread_count: usize,
) u64 {
    for (plan.variants, series) |other, *one| {
        if (other != variant) continue;
        const slower = @as(f64, @floatFromInt(plan.thread_count)) /
            @as(f64, @floatFromInt(thread_count));
        const time_ms = student.estimate(one.trace_ms.items).mean;
        return @trunc(time_ms * 1e6 * @max(1, slower));
    }
    return 0;
}

fn areNarrow(lists: []const Column) bool {
    for (lists) |list| {
        if (student.estimate(list.items).relative() > precision) return false;
    }
    return true;
}

/// Whether all render times have narrow intervals, by enough samples.
fn isNarrow(series: []const Series) bool {
    for (series) |*one| {
        const samples = one.trace_ms.items;
        if (samples.len < narrow_round_count_min) return false;
        if (student.estimate(samples).relative() > precision) return false;
    }
    return true;
}

fn milliseconds(time_ns: u64, count: usize) f64 {
    return @as(f64, @floatFromInt(time_ns)) * 1e-6 / @as(f64, @floatFromInt(count));
}

const testing = std.testing;

/// Renders nothing, on a clock of its own.
const Fake = struct {
    now_ns: u64 = 0,
    random: std.Random.DefaultPrng = .init(1),
    /// Of the time of a frame, either way.
    noise: f64 = 0,
    /// In milliseconds, by variant.
    trace_ms: []const f64,
    /// Images that this variant makes are wrong from this frame on.
    wrong: ?struct { variant: usize, frame: usize } = null,
    frame_count: usize = 0,
    last_variant: usize = 0,
    order: std.ArrayList(u8) = .empty,
    /// In watts: at rest, and above that while tracing by each variant.
    idle_w: f64 = 2,
    trace_w: f64 = 6,
    energy_j: f64 = 0,
    window_ms: u64 = 0,
    meter_is_there: bool = false,
    /// When it is cancelled.
    end_ns: u64 = std.math.maxInt(u64),

    fn spend(fake: *Fake, time_ms: f64, power_w: f64) u64 {
        const time_ns: u64 = @trunc(time_ms * 1e6);
        fake.now_ns += time_ns;
        fake.energy_j += power_w * time_ms * 1e-3;
        return time_ns;
    }

    pub fn prepare(fake: *Fake, variant: usize) error{ OutOfMemory, Canceled }!Prepared {
        fake.last_variant = variant;
        _ = fake.spend(6, fake.idle_w + 3);
        if (fake.now_ns > fake.end_ns) return error.Canceled;
        return .{ .parse_ns = 1_000_000, .prepare_ns = 2_000_000, .bvh_build_ns = 3_000_000 };
    }

    pub fn trace(
        fake: *Fake,
        variant: usize,
        thread_count: usize,
    ) error{ OutOfMemory, Canceled }!Traced {
        try fake.order.append(testing.allocator, @intCast(variant));
        fake.frame_count += 1;
        const noise = fake.noise * (2 * fake.random.random().float(f64) - 1);
        const time_ms = fake.trace_ms[variant] * (1 + noise) /
            @as(f64, @floatFromInt(thread_count));
        const trace_ns = fake.spend(time_ms, fake.idle_w + fake.trace_w);
        if (fake.now_ns > fake.end_ns) return error.Canceled;
        return .{
            .trace_ns = trace_ns,
            .rays = .{ .primary = 7 },
        };
    }

    pub fn count(_: *Fake, variant: usize) error{}!statistics.TestCounts {
        return .{ .box_issued = variant + 10 };
    }

    pub fn hash(fake: *Fake) u64 {
        const wrong = fake.wrong orelse return 1;
        const is_wrong = fake.last_variant == wrong.variant and fake.frame_count >= wrong.frame;
        return if (is_wrong) 2 else 1;
    }

    pub fn now(fake: *Fake) u64 {
        return fake.now_ns;
    }

    pub fn mark(fake: *Fake) ?Mark {
        if (!fake.meter_is_there) return null;
        return .{ .time_ns = fake.now_ns, .energy_j = fake.energy_j };
    }

    pub fn between(_: *Fake, from: Mark, to: Mark) ?Interval {
        return .{
            .duration_s = @as(f64, @floatFromInt(to.time_ns - from.time_ns)) * 1e-9,
            .energy_j = to.energy_j.? - from.energy_j.?,
        };
    }

    pub fn windowNs(fake: *Fake) u64 {
        return fake.window_ms * 1_000_000;
    }

    pub fn name(_: *Fake, variant: usize) []const u8 {
        return ([_][]const u8{ "slow", "quick", "third" })[variant];
    }

    pub fn step(_: *Fake) void {}
};

const FakeRounds = Rounds(Fake);
const three: []const usize = &.{ 0, 1, 2 };

fn planFor(round_count: ?usize, deadline_ms: u64) Plan {
    return .{
        .variants = three,
        .thread_count = 1,
        .round_count = round_count,
        .deadline_ns = deadline_ms * 1_000_000,
    };
}

test "variants take turns, after one round that does not count" {
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    var fake: Fake = .{ .trace_ms = &.{ 30, 10, 20 } };
    defer fake.order.deinit(testing.allocator);
    var diagnostic: Diagnostic = .{};
    const plan = planFor(3, 1_000_000);
    const rounds = try FakeRounds.measure(arena.allocator(), &fake, plan, &diagnostic);
    try testing.expectEqualSlices(u8, &.{ 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2 }, fake.order.items);
    const variants = try rounds.variants();
    try testing.expectEqual(3, variants[1].trace_ms.len);
    try testing.expectApproxEqRel(10, variants[1].trace_ms[2], 1e-9);
    try testing.expectEqual(3, variants[2].bvh_build_ms[0]);
    try testing.expectEqual(12, variants[2].tests.box_issued);
    try testing.expectEqual(.rounds, rounds.end);
    try testing.expectEqual(null, variants[0].energy);
}

test "narrow intervals end the rounds, wide ones the time" {
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    var diagnostic: Diagnostic = .{};
    const Case = struct { f64, results.End };
    for ([_]Case{ .{ 0.001, .precision }, .{ 0.5, .time } }) |case| {
        var fake: Fake = .{ .trace_ms = &.{ 30, 10, 20 }, .noise = case[0] };
        defer fake.order.deinit(testing.allocator);
        const plan = planFor(null, 2_000);
        const rounds = try FakeRounds.measure(arena.allocator(), &fake, plan, &diagnostic);
        try testing.expectEqual(case[1], rounds.end);
        try testing.expect(fake.now_ns <= 2_000_000_000);
        if (case[1] == .precision) try testing.expectEqual(5, rounds.round_count);
    }
    // Two rounds at least, beyond the scene's share of the time.
    var fake: Fake = .{ .trace_ms = &.{ 30, 10, 20 } };
    defer fake.order.deinit(testing.allocator);
    const rounds = try FakeRounds.measure(arena.allocator(), &fake, planFor(null, 0), &diagnostic);
    try testing.expectEqual(2, rounds.round_count);
}

test "what would end too late is not begun" {
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    var diagnostic: Diagnostic = .{};
    // Variants take 36, 16 and 26 ms, and so does the round that does not count.
    const Case = struct { end_ms: u64, round_count: usize, scaled_count: usize };
    for ([_]Case{
        .{ .end_ms = 20, .round_count = 0, .scaled_count = 0 },
        .{ .end_ms = 150, .round_count = 0, .scaled_count = 0 },
        .{ .end_ms = 180, .round_count = 1, .scaled_count = 0 },
        .{ .end_ms = 260, .round_count = 2, .scaled_count = 0 },
        .{ .end_ms = 500, .round_count = 5, .scaled_count = 0 },
        .{ .end_ms = 640, .round_count = 5, .scaled_count = 2 },
    }) |case| {
        var fake: Fake = .{ .trace_ms = &.{ 30, 10, 20 } };
        defer fake.order.deinit(testing.allocator);
        var plan = planFor(null, 1 << 20);
        plan.end_ns = case.end_ms * 1_000_000;
        var rounds = try FakeRounds.measure(arena.allocator(), &fake, plan, &diagnostic);
        try testing.expectEqual(case.round_count, rounds.round_count);
        try testing.expectEqual(case.round_count < 5, rounds.end == .time);
        if (case.round_count > 0) {
            var lists: [2]Column = @splat(.empty);
            try rounds.scale(&.{0}, &.{ 1, 2 }, plan.end_ns, &lists);
            for (lists) |list| try testing.expectEqual(case.scaled_count, list.items.len);
        }
        // But for the very first frame, which nothing is known of.
        try testing.expect(fake.now_ns <= @max(36_000_000, plan.end_ns));
    }
}

test "a round that is cancelled does not count" {
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    var diagnostic: Diagnostic = .{};
    for ([_]u64{ 20, 60, 140, 200, 300 }, [_]usize{ 0, 0, 0, 1, 2 }) |end_ms, round_count| {
        var fake: Fake = .{ .trace_ms = &.{ 30, 10, 20 }, .end_ns = end_ms * 1_000_000 };
        defer fake.order.deinit(testing.allocator);
        const plan = planFor(9, 1 << 20);
        var rounds = try FakeRounds.measure(arena.allocator(), &fake, plan, &diagnostic);
        try testing.expectEqual(round_count, rounds.round_count);
        try testing.expectEqual(.time, rounds.end);
        for (try rounds.variants()) |*variant|
            try testing.expectEqual(round_count, variant.trace_ms.len);
        if (round_count == 0) continue;
        var lists: [1]Column = @splat(.empty);
        try rounds.scale(&.{0}, &.{1}, 1 << 60, &lists);
        try testing.expectEqual(0, lists[0].items.len);
    }
}

test "another image is an error that names its variant, early or late" {
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    for ([_]usize{ 0, 7, 10 }) |frame| {
        var fake: Fake = .{
            .trace_ms = &.{ 30, 10, 20 },
            .wrong = .{ .variant = 2, .frame = frame },
        };
        defer fake.order.deinit(testing.allocator);
        var diagnostic: Diagnostic = .{};
        const plan = planFor(9, 1 << 20);
        const failed = FakeRounds.measure(arena.allocator(), &fake, plan, &diagnostic);
        try testing.expectError(error.ImagesDiffer, failed);
        try testing.expectStringStartsWith(diagnostic.message.text(), "the image of third by 1");
        try testing.expect(fake.frame_count < frame + 4);
    }
}

test "energy of a frame and of tracing, less what the machine takes at rest" {
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    var diagnostic: Diagnostic = .{};
    for ([_]u64{ 0, 100 }) |window_ms| {
        var fake: Fake = .{
            .trace_ms = &.{ 30, 10, 20 },
            .meter_is_there = true,
            .window_ms = window_ms,
        };
        defer fake.order.deinit(testing.allocator);
        var plan = planFor(4, 1 << 20);
        plan.idle_w = fake.idle_w;
        const rounds = try FakeRounds.measure(arena.allocator(), &fake, plan, &diagnostic);
        const energy = (try rounds.variants())[1].energy.?;
        try testing.expectEqual(4, energy.trace_j.len);
        // 6 W over 10 ms, and 3 W over the 6 ms before; at rest 2 W.
        try testing.expectApproxEqRel(0.060, energy.trace_j[3], 0.01);
        try testing.expectApproxEqRel(0.080, energy.trace_gross_j[3], 0.01);
        try testing.expectApproxEqRel(0.078, energy.whole_j[3], 0.01);
        try testing.expectApproxEqRel(0.016, energy.whole_s[3], 0.01);
    }
}

test "more threads, in turn" {
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    var fake: Fake = .{ .trace_ms = &.{ 30, 10, 20 } };
    defer fake.order.deinit(testing.allocator);
    var diagnostic: Diagnostic = .{};
    const plan = planFor(3, 1 << 20);
    var rounds = try FakeRounds.measure(arena.allocator(), &fake, plan, &diagnostic);
    var lists: [4]Column = @splat(.empty);
    try rounds.scale(&.{ 0, 1 }, &.{ 1, 2 }, 1 << 60, &lists);
    for (lists, [_]f64{ 30, 15, 10, 5 }) |list, time_ms| {
        try testing.expectEqual(3, list.items.len);
        try testing.expectApproxEqRel(time_ms, list.items[0], 1e-9);
    }
    fake.wrong = .{ .variant = 1, .frame = 0 };
    const failed = rounds.scale(&.{ 0, 1 }, &.{ 1, 2 }, 1 << 60, &lists);
    try testing.expectError(error.ImagesDiffer, failed);
}
