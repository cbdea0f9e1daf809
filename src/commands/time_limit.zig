//! `--max-time`: a thread that ends the work on a scene which has taken too long.
//!
//! In: the account that the work allocates from, the flag that its loops look at. When the time is
//! over, the flag is set and the account refuses, so that the work ends as it does by an error:
//! nothing is half-written, and other scenes go on. What has not come to an end a little later, in
//! a C library or waiting for a file, ends with the program as by a signal.

const std = @import("std");
const raylane = @import("raylane");
const signals = @import("../signals.zig");
const Account = raylane.memory_account.Account;
const Diagnostic = raylane.diagnostic.Diagnostic;
const ExitCode = @import("exit_code.zig").ExitCode;
const Io = std.Io;
const Message = raylane.diagnostic.Message;
const Pool = raylane.parallel.Pool;
const printable = raylane.diagnostic.printable;
const settings = raylane.settings;

/// For one scene. Must stay where it is from `start` to `stop`.
pub const TimeLimit = struct {
    io: Io,
    /// Null: there is no limit.
    seconds: ?f32,
    /// What messages call the scene.
    title: []const u8,
    /// For programs, where this one is ended.
    answer: signals.Answer = .{},
    account: *Account = undefined,
    pool: *Pool = undefined,
    thread: ?std.Thread = null,
    stopped: Io.Event = .unset,
    /// The work has been told to end.
    is_over: std.atomic.Value(bool) = .init(false),
    /// Somebody has ended: the work, or the thread the program.
    is_ended: std.atomic.Value(bool) = .init(false),

    const stack_bytes = 1 << 20;
    const title_bytes_max = 200;

    /// Makes the answer, in memory from `arena`; the problem is filled in.
    pub fn prepareAnswer(
        limit: *TimeLimit,
        arena: std.mem.Allocator,
        failure: raylane.report.Failure,
        to_stderr: bool,
    ) error{OutOfMemory}!void {
        if (limit.seconds == null) return;
        var message: Message = .{};
        var told = failure;
        told.problem = limit.problem(&message);
        var text: Io.Writer.Allocating = .init(arena);
        raylane.report.writeFailure(&told, &text.writer) catch return error.OutOfMemory;
        limit.answer.text = text.written();
        if (to_stderr) limit.answer.file = std.posix.STDERR_FILENO;
    }

    /// What the error is that ends the work, its text in `message`. There has to be a limit.
    pub fn problem(limit: *const TimeLimit, message: *Message) raylane.report.Problem {
        limit.explain(message);
        return .{
            .message = message.text(),
            .file = limit.title,
            .exit_code = @backingInt(ExitCode.timed_out),
        };
    }

    /// Begins to watch the work by a pool in the memory of an account.
    pub fn start(
        limit: *TimeLimit,
        account: *Account,
        pool: *Pool,
        diagnostic: *Diagnostic,
    ) error{InputOutput}!void {
        if (limit.seconds == null) return;
        limit.account = account;
        limit.pool = pool;
        limit.thread = std.Thread.spawn(.{ .stack_size = stack_bytes }, watch, .{limit}) catch
            return diagnostic.fail(error.InputOutput, "no thread to keep to --max-time", .{});
    }

    /// The work is done, or has failed. Returns whether the time was over before; account and pool
    /// can be used again.
    pub fn stop(limit: *TimeLimit) bool {
        const thread = limit.thread orelse return false;
        _ = limit.is_ended.swap(true, .acq_rel);
        limit.stopped.set(limit.io);
        thread.join(); // Forever, where the program is being ended.
        limit.thread = null;
        if (!limit.is_over.load(.monotonic)) return false;
        limit.account.reopen();
        limit.pool.cancelled.store(false, .monotonic);
        return true;
    }

    /// Stops; an error after the time was over is that of the limit, whatever else it says.
    pub fn finish(
        limit: *TimeLimit,
        outcome: anytype,
        diagnostic: *Diagnostic,
    ) @TypeOf(outcome) {
        const is_over = limit.stop();
        return outcome catch |err| {
            if (!is_over) return err;
            diagnostic.place.set("", .{});
            diagnostic.message.set("", .{});
            limit.explain(&diagnostic.message);
            return error.Canceled;
        };
    }

    fn explain(limit: *const TimeLimit, message: *Message) void {
        message.append("takes longer than the {d} s of --max-time", .{limit.seconds.?});
    }

    fn watch(limit: *TimeLimit) void {
        const seconds: f64 = limit.seconds.?;
        if (limit.waits(seconds)) return;
        limit.is_over.store(true, .monotonic);
        limit.account.end();
        limit.pool.cancelled.store(true, .monotonic);
        if (limit.waits(seconds * settings.time_grace)) return;
        if (limit.is_ended.swap(true, .acq_rel)) return;
        var line: Message = .{};
        const title = limit.title[0..@min(limit.title.len, title_bytes_max)];
        line.set("raylane: {f}: ", .{printable(title)});
        limit.explain(&line);
        signals.endWith(limit.answer, line.text(), @backingInt(ExitCode.timed_out));
    }

    /// Whether the work comes to its end within the time.
    fn waits(limit: *TimeLimit, seconds: f64) bool {
        limit.stopped.waitTimeout(limit.io, .{ .duration = .{
            .raw = .fromNanoseconds(@intFromFloat(seconds * std.time.ns_per_s)),
            .clock = .awake,
        } }) catch |err| return err != error.Timeout;
        return true;
    }
};
