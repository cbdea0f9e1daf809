//! The same work on several threads, every one in the floating-point mode of the renderer.
//!
//! In: how many threads, a context they share, a function. The function takes its share of the
//! work from the context (an atomic counter, say) until there is none left, so that the result does
//! not depend on how many threads could be started.

const std = @import("std");
const simd = @import("simd.zig");
const assert = std.debug.assert;

/// Threads at most, whatever the user asks for.
pub const thread_count_max = 256;

/// Runs `work(context, thread_index)` on `thread_count` threads, the caller's among them, and
/// returns when all have ended. Starts fewer where the system refuses more. Asserts
/// 1 <= thread_count <= `thread_count_max`.
pub fn run(
    thread_count: usize,
    context: anytype,
    comptime work: fn (context: @TypeOf(context), thread_index: usize) void,
) void {
    assert(thread_count >= 1 and thread_count <= thread_count_max);
    const entry = struct {
        fn entry(shared: @TypeOf(context), thread_index: usize) void {
            const mode = simd.setFlushToZero();
            defer simd.setFloatControl(mode);
            work(shared, thread_index);
        }
    }.entry;
    var threads: [thread_count_max - 1]std.Thread = undefined;
    var started_count: usize = 0;
    while (started_count + 1 < thread_count) : (started_count += 1) {
        threads[started_count] = std.Thread.spawn(.{}, entry, .{
            context, started_count + 1,
        }) catch break;
    }
    entry(context, 0);
    for (threads[0..started_count]) |thread| thread.join();
}

test "every thread index at most once, the work done whole" {
    const Shared = struct {
        next: std.atomic.Value(u32) = .init(0),
        done: [1000]std.atomic.Value(u8) = @splat(.init(0)),

        fn work(shared: *@This(), thread_index: usize) void {
            assert(thread_index < 7);
            while (true) {
                const index = shared.next.fetchAdd(1, .monotonic);
                if (index >= shared.done.len) return;
                _ = shared.done[index].fetchAdd(1, .monotonic);
            }
        }
    };
    for ([_]usize{ 1, 2, 7 }) |thread_count| {
        var shared: Shared = .{};
        run(thread_count, &shared, Shared.work);
        for (&shared.done) |*done| try std.testing.expectEqual(1, done.load(.monotonic));
    }
}
