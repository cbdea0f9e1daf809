//! The meter: adds up the readings of a source over time.
//!
//! In: a source, read by a thread of its own at regular times and once more at each mark. Out: the
//! energy between two marks. Counters are subtracted, around the end of their range as well; power
//! is added up by the trapezoidal rule, as in section 3.4.3 of the thesis. A source that stops to
//! answer is lost for good: what was measured before counts, what touches the gap is null. What the
//! thread itself costs is counted.

const std = @import("std");
const source_file = @import("source.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Allocator = std.mem.Allocator;
const Io = std.Io;
const Reading = source_file.Reading;
const Source = source_file.Source;
const assert = std.debug.assert;

/// A moment of a meter.
pub const Mark = struct {
    time_ns: u64,
    /// Since the meter started; null where the source was lost before.
    energy_j: ?f64,
};

/// What lies between two marks.
pub const Interval = struct {
    duration_s: f64,
    energy_j: f64,
};

/// Adds up one rail.
const Sum = struct {
    range_uj: u64,
    last: ?struct { time_ns: u64, reading: Reading } = null,

    /// The energy since the reading before, in joules. Error: a counter fell that has no range, or
    /// rose faster than any machine could make it.
    fn add(sum: *Sum, time_ns: u64, reading: Reading) error{Implausible}!f64 {
        const last = sum.last orelse {
            sum.last = .{ .time_ns = time_ns, .reading = reading };
            return 0;
        };
        assert(time_ns >= last.time_ns);
        const duration_s = @as(f64, @floatFromInt(time_ns - last.time_ns)) * 1e-9;
        const energy_j = switch (reading) {
            .counter_uj => |now_uj| energy: {
                if (last.reading != .counter_uj) return error.Implausible;
                const before_uj = last.reading.counter_uj;
                if (now_uj >= before_uj) break :energy joules(now_uj - before_uj);
                if (sum.range_uj < before_uj) return error.Implausible;
                break :energy joules(sum.range_uj - before_uj + now_uj);
            },
            .power_w => |now_w| energy: {
                if (last.reading != .power_w) return error.Implausible;
                break :energy 0.5 * (now_w + last.reading.power_w) * duration_s;
            },
        };
        // A little is allowed for counters that are brought up to date in steps.
        if (energy_j > source_file.power_w_max * (duration_s + 1e-3)) return error.Implausible;
        sum.last = .{ .time_ns = time_ns, .reading = reading };
        return energy_j;
    }
};

fn joules(energy_uj: u64) f64 {
    return @as(f64, @floatFromInt(energy_uj)) * 1e-6;
}

/// Reads a source until `stop`. Not to be moved after `start`.
pub const Meter = struct {
    gpa: Allocator,
    io: Io,
    source: *const Source,
    /// Held while a reading is taken and added, by the thread or by `mark`.
    mutex: Io.Mutex = .init,
    sums: [source_file.rail_count_max]Sum = undefined,
    energy_j: f64 = 0,
    is_lost: bool = false,
    /// Why the source was lost.
    diagnostic: Diagnostic = .{},
    thread: ?std.Thread = null,
    is_ending: std.atomic.Value(bool) = .init(false),
    cost: Cost = .{},

    /// What the meter itself took.
    pub const Cost = struct {
        reading_count: u64 = 0,
        /// Waiting for readings, by all threads, in nanoseconds.
        reading_ns: u64 = 0,
        /// Computing, by the meter's thread, in nanoseconds. Without the commands that it starts.
        processor_ns: u64 = 0,
    };

    /// A meter at rest. The source must outlive it.
    pub fn init(gpa: Allocator, io: Io, source: *const Source) Meter {
        assert(source.rails.len >= 1 and source.rails.len <= source_file.rail_count_max);
        var meter: Meter = .{ .gpa = gpa, .io = io, .source = source };
        for (meter.sums[0..source.rails.len], source.rails) |*sum, *rail| {
            sum.* = .{ .range_uj = rail.rangeUj() };
        }
        return meter;
    }

    /// Starts the thread. Where the system refuses one, readings are taken at the marks alone.
    pub fn start(meter: *Meter) void {
        assert(meter.thread == null);
        meter.thread = std.Thread.spawn(.{ .stack_size = 1 << 20 }, work, .{meter}) catch null;
    }

    /// Ends the thread; `cost` is complete then.
    pub fn stop(meter: *Meter) void {
        meter.is_ending.store(true, .release);
        if (meter.thread) |thread| thread.join();
        meter.thread = null;
    }

    fn work(meter: *Meter) void {
        const io = meter.io;
        const begin = Io.Clock.cpu_thread.now(io);
        while (!meter.is_ending.load(.acquire)) {
            _ = meter.mark();
            io.sleep(.fromMilliseconds(meter.source.period_ms), .awake) catch break;
        }
        const spent = begin.untilNow(io, .cpu_thread).toNanoseconds();
        meter.cost.processor_ns = @intCast(@max(spent, 0));
    }

    /// Whether the source has stopped to answer.
    pub fn isLost(meter: *Meter) bool {
        meter.mutex.lockUncancelable(meter.io);
        defer meter.mutex.unlock(meter.io);
        return meter.is_lost;
    }

    /// Takes a reading.
    pub fn mark(meter: *Meter) Mark {
        meter.mutex.lockUncancelable(meter.io);
        defer meter.mutex.unlock(meter.io);
        const before_ns = meter.now();
        if (meter.is_lost) return .{ .time_ns = before_ns, .energy_j = null };
        var readings: [source_file.rail_count_max]Reading = undefined;
        const is_read = meter.read(&readings);
        const after_ns = meter.now();
        meter.cost.reading_count += 1;
        meter.cost.reading_ns += after_ns - before_ns;
        if (!is_read) meter.is_lost = true;
        return meter.add(before_ns + (after_ns - before_ns) / 2, &readings);
    }

    fn now(meter: *Meter) u64 {
        return @intCast(Io.Clock.awake.now(meter.io).nanoseconds);
    }

    fn read(meter: *Meter, readings: []Reading) bool {
        for (meter.source.rails, 0..) |*rail, index| {
            readings[index] = rail.read(meter.gpa, meter.io, &meter.diagnostic) catch return false;
        }
        return true;
    }

    /// Adds the readings of all rails at one moment, unless the source is lost.
    fn add(meter: *Meter, time_ns: u64, readings: []const Reading) Mark {
        if (meter.is_lost) return .{ .time_ns = time_ns, .energy_j = null };
        for (meter.source.rails, 0..) |*rail, index| {
            meter.energy_j += meter.sums[index].add(time_ns, readings[index]) catch {
                meter.is_lost = true;
                meter.diagnostic.message.set("{s}: a counter fell or leapt", .{rail.name});
                return .{ .time_ns = time_ns, .energy_j = null };
            };
        }
        return .{ .time_ns = time_ns, .energy_j = meter.energy_j };
    }

    /// The energy between two marks of this meter; null where the source was lost.
    pub fn between(_: *const Meter, from: Mark, to: Mark) ?Interval {
        const before_j = from.energy_j orelse return null;
        const after_j = to.energy_j orelse return null;
        assert(to.time_ns >= from.time_ns);
        return .{
            .duration_s = @as(f64, @floatFromInt(to.time_ns - from.time_ns)) * 1e-9,
            .energy_j = after_j - before_j,
        };
    }
};

const testing = std.testing;

/// A meter of files, fed by hand: times are given, not waited for.
const TestMeter = struct {
    rails: [2]source_file.Rail,
    source: Source,
    meter: Meter,

    fn init(test_meter: *TestMeter, ranges_uj: [2]u64) void {
        for (&test_meter.rails, ranges_uj) |*rail, range_uj| rail.* = .{
            .name = "rail",
            .access = .{ .counter = .{ .path = "absent", .range_uj = range_uj } },
        };
        test_meter.source = .{
            .name = "test",
            .scope = "",
            .rails = &test_meter.rails,
            .period_ms = 1,
            .window_ms = 1,
        };
        test_meter.meter = .init(testing.allocator, testing.io, &test_meter.source);
    }

    fn at(test_meter: *TestMeter, time_s: f64, readings: [2]Reading) Mark {
        return test_meter.meter.add(@trunc(time_s * 1e9), &readings);
    }
};

test "counters are subtracted and added over rails, across the end of their range" {
    var fixture: TestMeter = undefined;
    fixture.init(.{ 262_143_328_850, 10_000_000 });
    const start: Reading = .{ .counter_uj = 262_140_000_000 };
    const from = fixture.at(0, .{ start, .{ .counter_uj = 9_000_000 } });
    _ = fixture.at(1, .{ .{ .counter_uj = 262_143_000_000 }, .{ .counter_uj = 9_900_000 } });
    const to = fixture.at(2, .{ .{ .counter_uj = 671_150 }, .{ .counter_uj = 400_000 } });
    const interval = fixture.meter.between(from, to).?;
    // 3 + 1 joules of the first; 0.9 + 0.5 of the second.
    try testing.expectApproxEqAbs(4.0 + 1.4, interval.energy_j, 1e-6);
    try testing.expectApproxEqAbs(2.0, interval.duration_s, 1e-9);
}

test "power is added up by the trapezoidal rule at uneven times" {
    var fixture: TestMeter = undefined;
    fixture.init(.{ 0, 0 });
    // 2 t + 1 watts and 3 watts; the rule is exact for both.
    const times_s = [_]f64{ 0, 0.1, 0.15, 0.7, 2, 2.01, 4 };
    var first: Mark = undefined;
    var last: Mark = undefined;
    for (times_s, 0..) |time_s, index| {
        last = fixture.at(time_s, .{ .{ .power_w = 2 * time_s + 1 }, .{ .power_w = 3 } });
        if (index == 0) first = last;
    }
    const interval = fixture.meter.between(first, last).?;
    try testing.expectApproxEqRel(4.0 * 4.0 + 4.0 + 12.0, interval.energy_j, 1e-6);
}

test "a curved load is right to a hundredth" {
    var fixture: TestMeter = undefined;
    fixture.init(.{ 0, 0 });
    var first: Mark = undefined;
    var last: Mark = undefined;
    for (0..101) |step| {
        const time_s = @as(f64, @floatFromInt(step)) * 0.1;
        last = fixture.at(time_s, .{ .{ .power_w = 5 + 4 * @sin(time_s) }, .{ .power_w = 0 } });
        if (step == 0) first = last;
    }
    const exact = 50.0 + 4.0 * (1.0 - @cos(10.0));
    const interval = fixture.meter.between(first, last).?;
    try testing.expectApproxEqRel(exact, interval.energy_j, 0.01);
}

test "a counter that falls without a range, or leaps, is lost; what came before counts" {
    for ([_]u64{ 1_000_000, 1 << 62 }) |garbage_uj| {
        var fixture: TestMeter = undefined;
        fixture.init(.{ 0, 0 });
        const still: Reading = .{ .counter_uj = 0 };
        const from = fixture.at(0, .{ .{ .counter_uj = 5_000_000 }, still });
        const middle = fixture.at(1, .{ .{ .counter_uj = 7_000_000 }, still });
        const broken = fixture.at(2, .{ .{ .counter_uj = garbage_uj }, still });
        const after = fixture.at(3, .{ .{ .counter_uj = 8_000_000 }, still });
        try testing.expectApproxEqAbs(2.0, fixture.meter.between(from, middle).?.energy_j, 1e-9);
        try testing.expectEqual(null, fixture.meter.between(middle, broken));
        try testing.expectEqual(null, fixture.meter.between(middle, after));
        try testing.expectEqual(null, fixture.meter.between(broken, after));
    }
}

test "the thread reads by itself, and a source that disappears is lost with its name" {
    var folder = testing.tmpDir(.{});
    defer folder.cleanup();
    const io = testing.io;
    const path = try testing.allocator.print(".zig-cache/tmp/{s}/power", .{folder.sub_path});
    defer testing.allocator.free(path);
    try folder.dir.writeFile(io, .{ .sub_path = "power", .data = "7500000\n" });
    const rails = [_]source_file.Rail{.{ .name = path, .access = .{ .power = path } }};
    const source: Source = .{
        .name = "test",
        .scope = "",
        .rails = &rails,
        .period_ms = 1,
        .window_ms = 1,
    };
    var meter: Meter = .init(testing.allocator, io, &source);
    meter.start();
    const from = meter.mark();
    try io.sleep(.fromMilliseconds(20), .awake);
    const to = meter.mark();
    const interval = meter.between(from, to).?;
    // The power is constant: whatever the clock says, the energy is the power times it.
    try testing.expectApproxEqRel(7.5 * interval.duration_s, interval.energy_j, 1e-6);
    try folder.dir.deleteFile(io, "power");
    const after = meter.mark();
    meter.stop();
    try testing.expectEqual(null, meter.between(to, after));
    try testing.expectStringStartsWith(meter.diagnostic.message.text(), path);
    try testing.expect(meter.cost.reading_count >= 3 and meter.cost.reading_ns > 0);
}
