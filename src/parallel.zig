//! The same work on several threads, every one in the floating-point mode of the renderer.
//!
//! In: how many threads, a context they share, a function. The function takes its share of the
//! work from the context (an atomic counter, say) until there is none left, so that the result does
//! not depend on how many threads could be started.
//!
//! Threads are started once, when first asked for, and kept until the process ends: building a tree
//! of 200,000 triangles asks a dozen times, and starting and joining one thread took a tenth of its
//! time. In between they wait for a word of their own to change, at first by looking at it, then
//! asleep in the kernel (a futex). More than are worth keeping are started for one job. Nothing is
//! allocated and no lock is taken after the start.

const std = @import("std");
const builtin = @import("builtin");
const simd = @import("simd.zig");
const assert = std.debug.assert;
const linux = std.os.linux;

/// Threads at most, whatever the user asks for.
pub const thread_count_max = 256;

/// Runs `work(context, thread_index)` on the caller's thread, with index 0, and on as many of
/// `thread_count` - 1 others as come before that one has ended; returns when all have ended. Each
/// index is called once at most, and is that of the same thread every time. A thread that comes
/// late, on a busy machine, keeps nobody waiting. Asserts 1 <= thread_count <= `thread_count_max`,
/// and that the context is a pointer.
pub fn share(
    thread_count: usize,
    context: anytype,
    comptime work: fn (context: @TypeOf(context), thread_index: usize) void,
) void {
    start(thread_count, context, work, false);
}

/// `share`, but waits for every thread, so that each index below `thread_count` is called once;
/// fewer where the system refuses more threads.
pub fn run(
    thread_count: usize,
    context: anytype,
    comptime work: fn (context: @TypeOf(context), thread_index: usize) void,
) void {
    start(thread_count, context, work, true);
}

fn start(
    thread_count: usize,
    context: anytype,
    comptime work: fn (context: @TypeOf(context), thread_index: usize) void,
    await_all: bool,
) void {
    assert(thread_count >= 1 and thread_count <= thread_count_max);
    const call = struct {
        fn call(erased: *anyopaque, thread_index: usize) void {
            const mode = simd.setFlushToZero();
            defer simd.setFloatControl(mode);
            work(@ptrCast(@alignCast(erased)), thread_index);
        }
    }.call;
    const job: Job = .{ .call = call, .context = @ptrCast(@constCast(context)) };
    if (thread_count == 1) return job.do(0);
    // A second caller at the same time, or one from within a job, has threads of its own.
    const has_pool = builtin.os.tag == .linux and isKept(thread_count) and
        !pool.is_taken.swap(true, .acquire);
    if (!has_pool) return runOnce(thread_count, job);
    defer pool.is_taken.store(false, .release);
    pool.run(thread_count, job, await_all);
}

/// The piece of work to be done as the `turn`-th of `count`, in `stretch_count` stretches at once:
/// threads that take turns stay far apart. Two that touch a fresh large page at the same time would
/// both wait for it to be cleared. Asserts turn < count.
pub fn spread(turn: usize, count: usize, stretch_count: usize) usize {
    assert(turn < count);
    const stretch = turn % stretch_count;
    const length = count / stretch_count;
    // The first few stretches have one piece more.
    return stretch * length + @min(stretch, count % stretch_count) + turn / stretch_count;
}

/// Whether so many threads are kept: each holds 16 MiB of addresses for its stack, of which a
/// 32-bit process has room for two hundred. More than there are processors gain nothing by it.
fn isKept(thread_count: usize) bool {
    if (thread_count <= 8) return true;
    return thread_count <= kept_max and thread_count <= std.Thread.getCpuCount() catch 1;
}

/// See `isKept`, with the caller's own.
const kept_max = 64;

/// What a thread is to do.
const Job = struct {
    call: *const fn (context: *anyopaque, thread_index: usize) void,
    context: *anyopaque,

    fn do(job: Job, thread_index: usize) void {
        job.call(job.context, thread_index);
    }
};

/// By threads that are started for this job and joined after it.
fn runOnce(thread_count: usize, job: Job) void {
    var threads: [thread_count_max - 1]std.Thread = undefined;
    var started_count: usize = 0;
    while (started_count + 1 < thread_count) : (started_count += 1) {
        threads[started_count] = std.Thread.spawn(.{}, Job.do, .{
            job, started_count + 1,
        }) catch break;
    }
    job.do(0);
    for (threads[0..started_count]) |thread| thread.join();
}

/// The process's own.
var pool: Pool = .{};

const Pool = struct {
    /// Somebody is using the pool.
    is_taken: std.atomic.Value(bool) = .init(false),
    started_count: usize = 0,
    job: Job = undefined,
    /// Looks at a word before the thread goes to sleep.
    look_count: std.atomic.Value(u32) = .init(0),
    /// Workers that are still at the job; `caller_asleep` on top where the caller sleeps meanwhile.
    busy_count: std.atomic.Value(u32) align(std.atomic.cache_line) = .init(0),
    workers: [kept_max - 1]Worker = @splat(.{}),

    const caller_asleep = 1 << 31;

    /// Some hundreds of microseconds on x86: longer than it takes to be called again while a tree
    /// is built. With a quarter of it, two threads took a fortieth more time.
    const look_count_max = 8000;

    const Worker = struct {
        state: std.atomic.Value(u32) align(std.atomic.cache_line) = .init(idle),

        const idle = 0;
        const asleep = 1;
        const called = 2;

        fn main(worker: *Worker, thread_index: usize) void {
            while (true) {
                worker.awaitCall();
                pool.job.do(thread_index);
                const before = pool.busy_count.fetchSub(1, .acq_rel);
                if (before == 1 | caller_asleep) wake(&pool.busy_count);
            }
        }

        fn awaitCall(worker: *Worker) void {
            for (0..pool.look_count.load(.monotonic)) |_| {
                if (worker.state.load(.monotonic) == called) break;
                std.atomic.spinLoopHint();
            }
            // Fails where the call has come, or has come and gone.
            _ = worker.state.cmpxchgStrong(idle, asleep, .monotonic, .monotonic);
            while (worker.state.cmpxchgStrong(called, idle, .acquire, .monotonic) != null) {
                sleep(&worker.state, asleep);
            }
        }

        fn wakeUp(worker: *Worker) void {
            if (worker.state.swap(called, .release) == asleep) wake(&worker.state);
        }

        /// Takes a call back; false where the worker has heard it.
        fn takeBack(worker: *Worker) bool {
            // It may be about to sleep rather than asleep: waking it then does no harm.
            return worker.state.cmpxchgStrong(called, asleep, .monotonic, .monotonic) == null;
        }
    };

    fn run(own: *Pool, thread_count: usize, job: Job, await_all: bool) void {
        own.startWorkers(thread_count - 1);
        const worker_count: u32 = @intCast(@min(thread_count - 1, own.started_count));
        own.job = job;
        own.busy_count.store(worker_count, .monotonic);
        for (own.workers[0..worker_count]) |*worker| worker.wakeUp();
        job.do(0);
        if (!await_all) for (own.workers[0..worker_count]) |*worker| {
            if (worker.takeBack()) _ = own.busy_count.fetchSub(1, .monotonic);
        };
        for (0..own.look_count.load(.monotonic)) |_| {
            if (own.busy_count.load(.monotonic) == 0) break;
            std.atomic.spinLoopHint();
        }
        if (own.busy_count.load(.acquire) == 0) return;
        // The last to finish sees either the flag or, before it, that nobody sleeps.
        _ = own.busy_count.fetchOr(caller_asleep, .acquire);
        while (true) {
            const count = own.busy_count.load(.acquire);
            if (count == caller_asleep) return;
            sleep(&own.busy_count, count);
        }
    }

    /// Starts workers until there are `worker_count`, or as many as the system allows.
    fn startWorkers(own: *Pool, worker_count: usize) void {
        if (own.started_count >= worker_count) return;
        // More threads than processors would only take turns at looking.
        const cpu_count = std.Thread.getCpuCount() catch 1;
        own.look_count.store(if (worker_count < cpu_count) look_count_max else 0, .monotonic);
        while (own.started_count < worker_count) : (own.started_count += 1) {
            const worker = &own.workers[own.started_count];
            const thread = std.Thread.spawn(.{}, Worker.main, .{
                worker, own.started_count + 1,
            }) catch return;
            thread.detach();
        }
    }
};

/// Sleeps while the word has this value; may wake early.
fn sleep(word: *const std.atomic.Value(u32), value: u32) void {
    _ = linux.futex_4arg(&word.raw, .{ .cmd = .WAIT, .private = true }, value, null);
}

/// Wakes the thread that sleeps on a word.
fn wake(word: *const std.atomic.Value(u32)) void {
    _ = linux.futex_3arg(&word.raw, .{ .cmd = .WAKE, .private = true }, 1);
}

test "turns that are spread out meet every piece once, in stretches" {
    for (1..40) |count| for (1..9) |stretch_count| {
        var seen: [40]u8 = @splat(0);
        for (0..count) |turn| seen[spread(turn, count, stretch_count)] += 1;
        for (seen[0..count]) |times| try std.testing.expectEqual(1, times);
        if (count > 2 * stretch_count) {
            try std.testing.expectEqual(1, spread(stretch_count, count, stretch_count));
        }
    };
}

const TestShared = struct {
    thread_count: usize,
    next: std.atomic.Value(u32) = .init(0),
    done: [1000]std.atomic.Value(u8) = @splat(.init(0)),
    entered: [thread_count_max]std.atomic.Value(u8) = @splat(.init(0)),

    fn work(shared: *TestShared, thread_index: usize) void {
        assert(thread_index < shared.thread_count);
        assert(simd.floatControl().flushesToZero());
        _ = shared.entered[thread_index].fetchAdd(1, .monotonic);
        while (true) {
            const index = shared.next.fetchAdd(1, .monotonic);
            if (index >= shared.done.len) return;
            _ = shared.done[index].fetchAdd(1, .monotonic);
        }
    }

    fn runAndCheck(thread_count: usize) !void {
        var shared: TestShared = .{ .thread_count = thread_count };
        run(thread_count, &shared, work);
        try shared.expectDone();
        for (&shared.entered, 0..) |*entered, index| {
            const expected = @intFromBool(index < thread_count);
            try std.testing.expectEqual(expected, entered.load(.monotonic));
        }
        var second: TestShared = .{ .thread_count = thread_count };
        share(thread_count, &second, work);
        try second.expectDone();
        try std.testing.expectEqual(1, second.entered[0].load(.monotonic));
        for (&second.entered) |*entered| try std.testing.expect(entered.load(.monotonic) <= 1);
    }

    fn expectDone(shared: *const TestShared) !void {
        for (&shared.done) |*done| try std.testing.expectEqual(1, done.load(.monotonic));
    }
};

test "every thread index once, the work done whole, by more threads and fewer" {
    for ([_]usize{ 1, 2, 7, 2, 1, 40, 3 }) |thread_count| {
        try TestShared.runAndCheck(thread_count);
    }
    // Calls that come sooner than threads fall asleep, and later.
    for (0..2000) |round| {
        try TestShared.runAndCheck(2 + round % 3);
        if (round % 500 == 0) std.testing.io.sleep(.fromMilliseconds(2), .awake) catch {};
    }
}

test "a job that runs a job, and two callers at once" {
    const Outer = struct {
        failed: std.atomic.Value(bool) = .init(false),

        fn work(outer: *@This(), _: usize) void {
            TestShared.runAndCheck(3) catch outer.failed.store(true, .monotonic);
        }
    };
    var outer: Outer = .{};
    run(3, &outer, Outer.work);
    const other = try std.Thread.spawn(.{}, Outer.work, .{ &outer, 0 });
    for (0..50) |_| try TestShared.runAndCheck(2);
    other.join();
    try std.testing.expect(!outer.failed.load(.monotonic));
}

test "who comes late finds nothing to do and does nothing" {
    const Nothing = struct {
        fn work(count: *std.atomic.Value(u32), thread_index: usize) void {
            if (thread_index > 0) _ = count.fetchAdd(1, .monotonic);
        }
    };
    var late_count: u32 = 0;
    for (0..1000) |_| {
        var count: std.atomic.Value(u32) = .init(0);
        share(4, &count, Nothing.work);
        late_count += 3 - count.load(.monotonic);
    }
    // None of three thousand in time to the nanosecond would be a wonder; after, all are there.
    try std.testing.expect(late_count > 0);
    try TestShared.runAndCheck(4);
}

test "threads that start no work change nothing in the caller's mode" {
    const mode = simd.floatControl();
    try TestShared.runAndCheck(2);
    try std.testing.expectEqual(mode, simd.floatControl());
}
