//! What each bounce costs: frames of at most no bounce, one, two, and so on, in turns.
//!
//! In: a subject that renders at a depth (the stages, or a stand-in), variants. Out: by variant and
//! depth, the rays that this depth adds, and samples of the frame's time and energy. What a bounce
//! costs is the difference between two depths in the same round; shading is part of it.

const std = @import("std");
const results = @import("results.zig");
const statistics = @import("../statistics.zig");
const student = @import("statistics.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Allocator = std.mem.Allocator;
const RayCounts = statistics.RayCounts;
const assert = std.debug.assert;

/// Rounds when nothing is said.
const round_count_default = 5;
/// Rounds beyond the scene's share of the time, if there is any left: fewer have no interval.
const round_count_min = 2;

/// What to measure, and for how long.
pub const Plan = struct {
    /// At least one.
    variants: []const usize,
    thread_count: usize,
    depth_max: u32,
    /// Null: some, as far as the time goes.
    round_count: ?usize,
    /// End of the scene's share of the time, by the subject's clock.
    deadline_ns: u64,
    /// What nothing is begun for that would end later.
    end_ns: u64 = std.math.maxInt(u64),
    /// What a frame of all bounces takes, by the slowest variant.
    frame_ns: u64 = 0,
    /// What the machine takes at rest, in watts.
    idle_w: f64,
};

/// Measures the scene of `rounds.Rounds`'s kind of subject, which has besides
///
///     fn setDepth(*Subject, depth: u32) void
///
/// In `arena`; nothing where there is no time for a round. `ImagesDiffer`: the diagnostic names the
/// variant.
pub fn measure(
    arena: Allocator,
    subject: anytype,
    plan: Plan,
    diagnostic: *Diagnostic,
) ![]const results.Bounce {
    const depth_count = plan.depth_max + 1;
    const cells = try arena.alloc(Cell, plan.variants.len * depth_count);
    @memset(cells, .{});
    var round: usize = 0;
    while (round < (plan.round_count orelse round_count_default)) : (round += 1) {
        const start_ns = subject.now();
        for (plan.variants, 0..) |variant, index| {
            _ = subject.prepare(variant) catch |err| return switch (err) {
                error.Canceled => listOf(arena, subject, &plan, cells, round),
                else => |other| other,
            };
            for (cells[index * depth_count ..][0..depth_count], 0..) |*cell, depth| {
                if (subject.now() +| plan.frame_ns +| subject.windowNs() > plan.end_ns)
                    return listOf(arena, subject, &plan, cells, round);
                subject.setDepth(@intCast(depth));
                cell.repeat(arena, subject, variant, &plan) catch |err| return switch (err) {
                    error.Canceled => listOf(arena, subject, &plan, cells, round),
                    else => |other| other,
                };
                subject.step();
                if (cell.hash == cells[depth].hash) continue;
                return diagnostic.fail(
                    error.ImagesDiffer,
                    "the image of {s} at depth {d} is not that of {s}",
                    .{ subject.name(variant), depth, subject.name(plan.variants[0]) },
                );
            }
        }
        const end_ns = subject.now();
        const is_over = end_ns + (end_ns - start_ns) > plan.deadline_ns;
        if (is_over and round + 1 >= round_count_min) return listOf(
            arena,
            subject,
            &plan,
            cells,
            round + 1,
        );
    }
    return listOf(arena, subject, &plan, cells, round);
}

/// What so many whole rounds have found.
fn listOf(
    arena: Allocator,
    subject: anytype,
    plan: *const Plan,
    cells: []const Cell,
    round_count: usize,
) error{OutOfMemory}![]const results.Bounce {
    if (round_count == 0) return &.{};
    const depth_count = plan.depth_max + 1;
    const list = try arena.alloc(results.Bounce, cells.len);
    for (list, cells, 0..) |*to, *cell, index| {
        const depth = index % depth_count;
        const before: RayCounts = if (depth == 0) .{} else cells[index - 1].rays;
        to.* = .{
            .variant = subject.name(plan.variants[index / depth_count]),
            .depth = @intCast(depth),
            .closest = cell.rays.primary + cell.rays.secondary -| before.primary -|
                before.secondary,
            .shadow = cell.rays.shadow -| before.shadow,
            .frame_ms = cell.frame_ms.items[0..round_count],
            // A source may have been lost half way.
            .frame_j = cell.frame_j.items[0..@min(round_count, cell.frame_j.items.len)],
        };
    }
    return list;
}

/// One variant at one depth.
const Cell = struct {
    rays: RayCounts = .{},
    hash: u64 = 0,
    frame_ms: std.ArrayList(f64) = .empty,
    frame_j: std.ArrayList(f64) = .empty,

    /// One sample: a frame, or as many as the energy's window takes.
    fn repeat(
        cell: *Cell,
        arena: Allocator,
        subject: anytype,
        variant: usize,
        plan: *const Plan,
    ) !void {
        const window_ns = subject.windowNs();
        var trace_ns: u64 = 0;
        var frame_count: f64 = 0;
        const start = subject.mark();
        const start_ns = subject.now();
        while (frame_count == 0 or subject.now() - start_ns < window_ns) : (frame_count += 1) {
            const traced = try subject.trace(variant, plan.thread_count);
            trace_ns += traced.trace_ns;
            cell.rays = traced.rays;
        }
        cell.hash = subject.hash();
        const time_ms = @as(f64, @floatFromInt(trace_ns)) * 1e-6;
        assert(cell.frame_ms.items.len < student.round_count_max);
        try cell.frame_ms.append(arena, time_ms / frame_count);
        const from = start orelse return;
        const to = subject.mark() orelse return;
        const interval = subject.between(from, to) orelse return;
        const energy_j = interval.energy_j - plan.idle_w * interval.duration_s;
        try cell.frame_j.append(arena, energy_j / frame_count);
    }
};

const testing = std.testing;

/// Traces nothing: a depth costs so many milliseconds and rays more than the one before.
const Fake = struct {
    const energy = @import("../energy.zig");
    const rounds = @import("rounds.zig");

    now_ns: u64 = 0,
    depth: u64 = 0,
    last: usize = 0,
    differs: bool = false,

    pub fn prepare(_: *Fake, _: usize) error{ OutOfMemory, Canceled }!void {}

    pub fn setDepth(fake: *Fake, depth: u32) void {
        fake.depth = depth;
    }

    pub fn trace(fake: *Fake, variant: usize, _: usize) error{Canceled}!rounds.Traced {
        fake.last = variant;
        const trace_ns = (10 + 4 * fake.depth * (1 + variant)) * std.time.ns_per_ms;
        fake.now_ns += trace_ns;
        return .{ .trace_ns = trace_ns, .rays = .{
            .primary = 100,
            .secondary = 50 * fake.depth,
            .shadow = 80 + 40 * fake.depth,
        } };
    }

    pub fn hash(fake: *const Fake) u64 {
        return fake.depth + @intFromBool(fake.differs and fake.last == 1);
    }

    pub fn now(fake: *const Fake) u64 {
        return fake.now_ns;
    }

    pub fn windowNs(_: *const Fake) u64 {
        return 0;
    }

    pub fn mark(fake: *const Fake) ?energy.Mark {
        return .{ .time_ns = fake.now_ns, .energy_j = 5e-9 * @as(f64, @floatFromInt(fake.now_ns)) };
    }

    pub fn between(_: *const Fake, from: energy.Mark, to: energy.Mark) ?energy.Interval {
        return .{
            .duration_s = @as(f64, @floatFromInt(to.time_ns - from.time_ns)) * 1e-9,
            .energy_j = to.energy_j.? - from.energy_j.?,
        };
    }

    pub fn name(_: *const Fake, variant: usize) []const u8 {
        return ([_][]const u8{ "quick", "slow" })[variant];
    }

    pub fn step(_: *const Fake) void {}
};

fn planForTest(deadline_ns: u64) Plan {
    return .{
        .variants = &.{ 0, 1 },
        .thread_count = 1,
        .depth_max = 2,
        .round_count = null,
        .deadline_ns = deadline_ns,
        .idle_w = 2,
    };
}

test "rays, time and energy by bounce, within the time" {
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    var diagnostic: Diagnostic = .{};
    var fake: Fake = .{};
    const plan = planForTest(std.time.ns_per_s);
    const list = try measure(arena.allocator(), &fake, plan, &diagnostic);
    try testing.expectEqual(6, list.len);
    try testing.expectEqual(round_count_default, list[0].frame_ms.len);
    try testing.expectEqual(100, list[0].closest);
    try testing.expectEqual(80, list[0].shadow);
    const last = &list[5];
    try testing.expectEqualStrings("slow", last.variant);
    try testing.expectEqual(50, last.closest);
    try testing.expectEqual(40, last.shadow);
    try testing.expectApproxEqAbs(26, last.frame_ms[0], 1e-9);
    try testing.expectApproxEqAbs(0.026 * (5 - 2), last.frame_j[0], 1e-9);

    var late = planForTest(std.time.ns_per_s);
    late.frame_ns = 26 * std.time.ns_per_ms;
    late.end_ns = fake.now_ns;
    try testing.expectEqual(0, (try measure(arena.allocator(), &fake, late, &diagnostic)).len);
    // A round takes 96 ms; the third would end too late.
    late.end_ns = fake.now_ns + 270 * std.time.ns_per_ms;
    const two = try measure(arena.allocator(), &fake, late, &diagnostic);
    try testing.expectEqual(2, two[0].frame_ms.len);
    try testing.expectEqual(2, two[5].frame_ms.len);
    try testing.expect(fake.now_ns <= late.end_ns);

    const hasty = try measure(arena.allocator(), &fake, planForTest(0), &diagnostic);
    try testing.expectEqual(round_count_min, hasty[0].frame_ms.len);
}

test "a variant with another image at some depth ends the run" {
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    var diagnostic: Diagnostic = .{};
    var fake: Fake = .{ .differs = true };
    const outcome = measure(arena.allocator(), &fake, planForTest(0), &diagnostic);
    try testing.expectError(error.ImagesDiffer, outcome);
    try testing.expectEqualStrings(
        "the image of slow at depth 0 is not that of quick",
        diagnostic.message.text(),
    );
}
