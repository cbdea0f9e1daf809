//! Cancels a session at a moment, so that nothing that it is in the middle of takes longer.

const std = @import("std");
const Io = std.Io;
const Session = @import("../session.zig").Session;

/// Seconds of the system are 32 bits where addresses are.
const wait_max_ns = std.math.maxInt(i32) * std.time.ns_per_s;

/// Must stay where it is from `start` to `stop`.
pub const Alarm = struct {
    io: Io,
    session: *Session,
    /// By the clock that never goes back.
    end_ns: u64,
    is_over: Io.Event = .unset,
    thread: ?std.Thread = null,

    /// Without a thread nothing is cancelled.
    pub fn start(alarm: *Alarm) void {
        alarm.thread = std.Thread.spawn(.{}, wait, .{alarm}) catch null;
    }

    /// After that the session is cancelled by others alone.
    pub fn stop(alarm: *Alarm) void {
        alarm.is_over.set(alarm.io);
        if (alarm.thread) |thread| thread.join();
    }

    fn wait(alarm: *Alarm) void {
        const now_ns: u64 = @intCast(Io.Clock.awake.now(alarm.io).nanoseconds);
        const left_ns: i64 = @min(alarm.end_ns -| now_ns, wait_max_ns);
        alarm.is_over.waitTimeout(alarm.io, .{
            .duration = .{ .raw = .fromNanoseconds(left_ns), .clock = .awake },
        }) catch |err| switch (err) {
            error.Timeout => alarm.session.cancel(),
            error.Canceled => {},
        };
    }
};

test Alarm {
    const testing = std.testing;
    const Diagnostic = @import("../diagnostic.zig").Diagnostic;
    var diagnostic: Diagnostic = .{};
    for ([_]bool{ true, false }) |is_late| {
        var session: Session = .init(testing.allocator, testing.io, 1, &diagnostic);
        defer session.deinit();
        const end_ns: u64 = if (is_late) 0 else std.math.maxInt(u64);
        var alarm: Alarm = .{ .io = testing.io, .session = &session, .end_ns = end_ns };
        alarm.start();
        // Not before the thread waits, mostly.
        if (!is_late) try testing.io.sleep(.fromMilliseconds(20), .awake);
        while (is_late and !session.pool.cancelled.load(.monotonic)) std.Thread.yield() catch {};
        alarm.stop();
        try testing.expectEqual(is_late, session.pool.cancelled.load(.monotonic));
    }
}
