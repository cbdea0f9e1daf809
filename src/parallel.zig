//! Fork and join by a pool of threads, every one in the floating-point mode of the renderer.
//!
//! In: how many threads, a context they share, a function. Loops hand out indices by an atomic
//! counter until there is none left or the work is cancelled, so that the result does not depend on
//! how many threads could be started.
//!
//! Threads are started once, when first asked for, and kept until the pool is stopped: building a
//! tree of 200,000 triangles asks a dozen times, and starting and joining one thread took a tenth
//! of its time. In between they wait for a word of their own to change, at first by looking at it,
//! then asleep in the kernel (a futex). No lock is taken, and nothing is allocated but the room for
//! the threads.

const std = @import("std");
const builtin = @import("builtin");
const settings = @import("settings.zig");
const Progress = @import("progress.zig").Progress;
const simd = @import("simd.zig");
const assert = std.debug.assert;
const linux = std.os.linux;

/// Threads at most, whatever the user asks for.
pub const thread_count_max = settings.thread_count.max;

/// Addresses of a thread's stack. The deepest way, shadow rays of 16 lanes in beams, takes some
/// 200 KiB; unoptimised code gives each value a place of its own, and takes megabytes.
pub const stack_bytes = if (builtin.mode == .debug) 16 << 20 else 1 << 20;

/// Work that was cancelled is not whole.
pub const Error = error{Canceled};

/// Threads that work together. Must stay where it is from the first job on.
pub const Pool = struct {
    /// Threads that work, the caller's among them: 1..`thread_count_max`. May be changed between
    /// jobs.
    thread_count: usize,
    /// Makes loops end before the next index. Any thread may set it.
    cancelled: std.atomic.Value(bool) = .init(false),
    /// Told of what they work at, by those who give it to them; null: nobody is.
    progress: ?*Progress = null,
    /// Somebody is using the threads.
    is_taken: std.atomic.Value(bool) = .init(false),
    started_count: usize = 0,
    /// Null: workers end.
    job: ?Job = null,
    /// Looks at a word before the thread goes to sleep.
    look_count: std.atomic.Value(u32) = .init(0),
    /// Workers that are still at the job; `caller_asleep` on top where the caller sleeps meanwhile.
    busy_count: std.atomic.Value(u32) align(std.atomic.cache_line) = .init(0),
    /// Room for all that there may be, taken when the first is started.
    workers: []Worker = &.{},

    const caller_asleep = 1 << 31;

    /// Some hundreds of microseconds on x86: longer than it takes to be called again while a tree
    /// is built. With a quarter of it, two threads took a fortieth more time.
    const look_count_max = 8000;

    /// Starts nothing yet. Asserts 1 <= thread_count <= `thread_count_max`.
    pub fn init(thread_count: usize) Pool {
        assert(thread_count >= 1 and thread_count <= thread_count_max);
        return .{ .thread_count = thread_count };
    }

    /// Ends the threads. Asserts that no job is under way.
    pub fn deinit(pool: *Pool) void {
        assert(!pool.is_taken.load(.acquire));
        pool.job = null;
        const workers = pool.workers[0..pool.started_count];
        for (workers) |*worker| worker.wakeUp();
        for (workers) |*worker| worker.thread.join();
        std.heap.page_allocator.free(pool.workers);
        pool.* = undefined;
    }

    /// Threads that `count` pieces of work are given to.
    pub fn threadsFor(pool: *const Pool, count: usize) usize {
        return @max(1, @min(pool.thread_count, count));
    }

    /// Calls `work(context, index, thread_index)` once for each index below `count`, in any order;
    /// thread indices are below `threadsFor(count)`. Between two indices each thread looks whether
    /// the work has been cancelled. Asserts that the context is a pointer.
    pub fn forEach(
        pool: *Pool,
        count: usize,
        context: anytype,
        comptime work: fn (context: @TypeOf(context), index: usize, thread_index: usize) void,
    ) Error!void {
        const Loop = struct {
            context: @TypeOf(context),
            count: usize,
            cancelled: *const std.atomic.Value(bool),
            next: std.atomic.Value(usize) align(std.atomic.cache_line) = .init(0),

            fn run(loop: *@This(), thread_index: usize) void {
                while (!loop.cancelled.load(.monotonic)) {
                    const index = loop.next.fetchAdd(1, .monotonic);
                    if (index >= loop.count) return;
                    work(loop.context, index, thread_index);
                }
            }
        };
        var loop: Loop = .{ .context = context, .count = count, .cancelled = &pool.cancelled };
        pool.share(count, &loop, Loop.run);
        if (pool.cancelled.load(.monotonic)) return error.Canceled;
    }

    /// `forEach`, with a sum: `work(context, index, sum)` adds to one of several sums that begin as
    /// `empty`, and `add` joins them, whose result must not depend on the order.
    pub fn reduce(
        pool: *Pool,
        comptime Sum: type,
        empty: Sum,
        comptime add: fn (sum: *Sum, other: *const Sum) void,
        count: usize,
        context: anytype,
        comptime work: fn (context: @TypeOf(context), index: usize, sum: *Sum) void,
    ) Error!Sum {
        const Sums = struct {
            context: @TypeOf(context),
            by_thread: [thread_count_max]Sum = undefined,

            fn each(sums: *@This(), index: usize, thread_index: usize) void {
                work(sums.context, index, &sums.by_thread[thread_index]);
            }
        };
        var sums: Sums = .{ .context = context };
        const used = sums.by_thread[0..pool.threadsFor(count)];
        @memset(used, empty);
        try pool.forEach(count, &sums, Sums.each);
        var total = empty;
        for (used) |*sum| add(&total, sum);
        return total;
    }

    /// Runs `work(context, thread_index)` on the caller's thread, with index 0, and on as many of
    /// `threadsFor(count)` - 1 others as come before that one has ended; returns when all have
    /// ended. Each index is called once at most, and is that of the same thread every time. A
    /// thread that comes late, on a busy machine, keeps nobody waiting. Asserts that the context is
    /// a pointer.
    pub fn share(
        pool: *Pool,
        count: usize,
        context: anytype,
        comptime work: fn (context: @TypeOf(context), thread_index: usize) void,
    ) void {
        pool.start(pool.threadsFor(count), .init(context, work), false);
    }

    /// `share` by all threads, and waits for every one of them, so that each index below
    /// `thread_count` is called once; fewer where the system refuses more threads.
    pub fn run(
        pool: *Pool,
        context: anytype,
        comptime work: fn (context: @TypeOf(context), thread_index: usize) void,
    ) void {
        pool.start(pool.thread_count, .init(context, work), true);
    }

    fn start(pool: *Pool, thread_count: usize, job: Job, await_all: bool) void {
        assert(thread_count >= 1 and thread_count <= thread_count_max);
        // A second caller at the same time, or one from within a job, does it alone.
        if (thread_count == 1 or pool.is_taken.swap(true, .acquire)) return job.do(0);
        defer pool.is_taken.store(false, .release);
        pool.startWorkers(thread_count - 1);
        const worker_count: u32 = @intCast(@min(thread_count - 1, pool.started_count));
        pool.job = job;
        pool.busy_count.store(worker_count, .monotonic);
        for (pool.workers[0..worker_count]) |*worker| worker.wakeUp();
        job.do(0);
        if (!await_all) for (pool.workers[0..worker_count]) |*worker| {
            if (worker.takeBack()) _ = pool.busy_count.fetchSub(1, .monotonic);
        };
        for (0..pool.look_count.load(.monotonic)) |_| {
            if (pool.busy_count.load(.monotonic) == 0) break;
            std.atomic.spinLoopHint();
        }
        if (pool.busy_count.load(.acquire) == 0) return;
        // The last to finish sees either the flag or, before it, that nobody sleeps.
        _ = pool.busy_count.fetchOr(caller_asleep, .acquire);
        while (true) {
            const count = pool.busy_count.load(.acquire);
            if (count == caller_asleep) return;
            sleep(&pool.busy_count, count);
        }
    }

    /// Starts workers until there are `worker_count`, or as many as the system allows.
    fn startWorkers(pool: *Pool, worker_count: usize) void {
        if (pool.started_count >= worker_count) return;
        if (pool.workers.len == 0) {
            pool.workers = std.heap.page_allocator.alloc(Worker, thread_count_max - 1) catch return;
            @memset(pool.workers, .{});
        }
        // More threads than processors would only take turns at looking.
        const cpu_count = std.Thread.getCpuCount() catch 1;
        pool.look_count.store(if (worker_count < cpu_count) look_count_max else 0, .monotonic);
        while (pool.started_count < worker_count) : (pool.started_count += 1) {
            const worker = &pool.workers[pool.started_count];
            worker.thread = std.Thread.spawn(.{ .stack_size = stack_bytes }, Worker.main, .{
                worker, pool, pool.started_count + 1,
            }) catch return;
        }
    }
};

/// What a thread is to do.
const Job = struct {
    call: *const fn (context: *anyopaque, thread_index: usize) void,
    context: *anyopaque,

    fn init(
        context: anytype,
        comptime work: fn (context: @TypeOf(context), thread_index: usize) void,
    ) Job {
        const call = struct {
            fn call(erased: *anyopaque, thread_index: usize) void {
                const mode = simd.setFlushToZero();
                defer simd.setFloatControl(mode);
                work(@ptrCast(@alignCast(erased)), thread_index);
            }
        }.call;
        return .{ .call = call, .context = @ptrCast(@constCast(context)) };
    }

    fn do(job: Job, thread_index: usize) void {
        job.call(job.context, thread_index);
    }
};

const Worker = struct {
    state: std.atomic.Value(u32) align(std.atomic.cache_line) = .init(idle),
    thread: std.Thread = undefined,

    const idle = 0;
    const asleep = 1;
    const called = 2;

    fn main(worker: *Worker, pool: *Pool, thread_index: usize) void {
        while (true) {
            worker.awaitCall(pool);
            const job = pool.job orelse return;
            job.do(thread_index);
            const before = pool.busy_count.fetchSub(1, .acq_rel);
            if (before == 1 | Pool.caller_asleep) wake(&pool.busy_count);
        }
    }

    fn awaitCall(worker: *Worker, pool: *const Pool) void {
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

/// The piece of work to be done as the `turn`-th of `count`, in `stretch_count` stretches at once:
/// threads that take turns stay far apart. Two that touch a fresh large page at the same time would
/// both wait for it to be cleared. Asserts turn < count.
pub fn interleave(turn: usize, count: usize, stretch_count: usize) usize {
    assert(turn < count);
    const stretch = turn % stretch_count;
    const length = count / stretch_count;
    // The first few stretches have one piece more.
    return stretch * length + @min(stretch, count % stretch_count) + turn / stretch_count;
}

/// Sleeps while the word has this value; may wake early.
fn sleep(word: *const std.atomic.Value(u32), value: u32) void {
    if (builtin.os.tag != .linux) return std.atomic.spinLoopHint();
    _ = linux.futex_4arg(&word.raw, .{ .cmd = .WAIT, .private = true }, value, null);
}

/// Wakes the thread that sleeps on a word.
fn wake(word: *const std.atomic.Value(u32)) void {
    if (builtin.os.tag != .linux) return;
    _ = linux.futex_3arg(&word.raw, .{ .cmd = .WAKE, .private = true }, 1);
}

test "turns that are interleaved meet every piece once, in stretches" {
    for (1..40) |count| for (1..9) |stretch_count| {
        var seen: [40]u8 = @splat(0);
        for (0..count) |turn| seen[interleave(turn, count, stretch_count)] += 1;
        for (seen[0..count]) |times| try std.testing.expectEqual(1, times);
        if (count > 2 * stretch_count) {
            try std.testing.expectEqual(1, interleave(stretch_count, count, stretch_count));
        }
    };
}

const TestShared = struct {
    thread_count: usize,
    done: [1000]std.atomic.Value(u8) = @splat(.init(0)),
    entered: [thread_count_max]std.atomic.Value(u8) = @splat(.init(0)),

    fn each(shared: *TestShared, index: usize, thread_index: usize) void {
        assert(thread_index < shared.thread_count);
        assert(simd.floatControl().flushesToZero());
        _ = shared.done[index].fetchAdd(1, .monotonic);
    }

    fn enter(shared: *TestShared, thread_index: usize) void {
        assert(simd.floatControl().flushesToZero());
        _ = shared.entered[thread_index].fetchAdd(1, .monotonic);
    }

    /// `is_whole`: nobody else uses the pool, so that all of its threads come.
    fn runAndCheck(pool: *Pool, is_whole: bool) !void {
        var shared: TestShared = .{ .thread_count = pool.thread_count };
        try pool.forEach(shared.done.len, &shared, each);
        for (&shared.done) |*done| try std.testing.expectEqual(1, done.load(.monotonic));
        pool.run(&shared, enter);
        for (&shared.entered, 0..) |*entered, index| {
            const times = entered.load(.monotonic);
            try std.testing.expect(times == 1 or index > 0 and times == 0);
            if (is_whole) try std.testing.expectEqual(index < pool.thread_count, times == 1);
        }
    }
};

test "every index once, the work done whole, by more threads and fewer" {
    var pool: Pool = .init(1);
    defer pool.deinit();
    for ([_]usize{ 1, 2, 7, 2, 1, 40, 3 }) |thread_count| {
        pool.thread_count = thread_count;
        try TestShared.runAndCheck(&pool, true);
    }
    // Calls that come sooner than threads fall asleep, and later.
    for (0..2000) |round| {
        pool.thread_count = 2 + round % 3;
        try TestShared.runAndCheck(&pool, true);
        if (round % 500 == 0) std.testing.io.sleep(.fromMilliseconds(2), .awake) catch {};
    }
}

test "a job that runs a job, and two callers at once" {
    const Outer = struct {
        pool: *Pool,
        failed: std.atomic.Value(bool) = .init(false),

        fn work(outer: *@This(), _: usize) void {
            TestShared.runAndCheck(outer.pool, false) catch outer.failed.store(true, .monotonic);
        }
    };
    var pool: Pool = .init(3);
    defer pool.deinit();
    var outer: Outer = .{ .pool = &pool };
    pool.run(&outer, Outer.work);
    const other = try std.Thread.spawn(.{}, Outer.work, .{ &outer, 0 });
    for (0..50) |_| try TestShared.runAndCheck(&pool, false);
    other.join();
    try std.testing.expect(!outer.failed.load(.monotonic));
}

test "a call that was taken back is not done, and the next one is" {
    const Count = struct {
        fn work(count: *std.atomic.Value(u32), _: usize) void {
            _ = count.fetchAdd(1, .monotonic);
        }
    };
    var pool: Pool = .init(2);
    defer pool.deinit();
    var count: std.atomic.Value(u32) = .init(0);
    pool.run(&count, Count.work);
    try std.testing.expectEqual(2, count.load(.monotonic));
    // Called and taken back before the worker could hear it, as where it comes late.
    const worker = &pool.workers[0];
    while (worker.state.cmpxchgWeak(Worker.asleep, Worker.called, .acquire, .monotonic) != null) {
        std.atomic.spinLoopHint();
    }
    try std.testing.expect(worker.takeBack());
    try std.testing.expect(!worker.takeBack());
    pool.run(&count, Count.work);
    try std.testing.expectEqual(4, count.load(.monotonic));
}

test "sums of several threads are joined" {
    const Sum = struct {
        fn add(sum: *u64, other: *const u64) void {
            sum.* += other.*;
        }

        fn work(factor: *const u64, index: usize, sum: *u64) void {
            sum.* += factor.* * index;
        }
    };
    const factor: u64 = 3;
    for ([_]usize{ 1, 2, 5 }) |thread_count| {
        var pool: Pool = .init(thread_count);
        defer pool.deinit();
        const total = try pool.reduce(u64, 0, Sum.add, 1001, &factor, Sum.work);
        try std.testing.expectEqual(3 * 1000 * 1001 / 2, total);
        try std.testing.expectEqual(0, try pool.reduce(u64, 0, Sum.add, 0, &factor, Sum.work));
    }
}

test "cancelled loops end before the next index and say so" {
    const Shared = struct {
        pool: *Pool,
        count: std.atomic.Value(u32) = .init(0),

        fn each(shared: *@This(), index: usize, _: usize) void {
            _ = shared.count.fetchAdd(1, .monotonic);
            if (index == 10) shared.pool.cancelled.store(true, .monotonic);
        }
    };
    for ([_]usize{ 1, 3 }) |thread_count| {
        var pool: Pool = .init(thread_count);
        defer pool.deinit();
        var shared: Shared = .{ .pool = &pool };
        try std.testing.expectError(error.Canceled, pool.forEach(1 << 30, &shared, Shared.each));
        const count = shared.count.load(.monotonic);
        try std.testing.expect(count >= 11 and count < 1 << 30);
        try std.testing.expectError(error.Canceled, pool.forEach(1, &shared, Shared.each));
        try std.testing.expectEqual(count, shared.count.load(.monotonic));
    }
}

test "threads that start no work change nothing in the caller's mode" {
    var pool: Pool = .init(2);
    defer pool.deinit();
    const mode = simd.floatControl();
    try TestShared.runAndCheck(&pool, true);
    try std.testing.expectEqual(mode, simd.floatControl());
}
